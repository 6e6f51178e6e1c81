"""How well the telegrams of a segment come over: level, evenness, ringing, and whether read."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from shipnet.asi.apm import as_bits
from shipnet.asi.receiver import receive
from shipnet.asi.response import RESPONSES
from shipnet.asi.segment import Segment
from shipnet.asi.timing import BIT_TIME

__all__ = ["SignalQuality", "signal_quality"]

#: Sampling interval of the waveforms, and the silence behind a telegram [s].
_STEP, _SILENCE = 250e-9, 60e-6

Floats = npt.NDArray[np.float64]


class SignalQuality(NamedTuple):
    """The worst over all telegrams, one entry a slave.

    Attributes
    ----------
    level_least, level_most : ndarray of float, shape (n_slaves,)
        Signal, peak to peak [V].
    evenness : ndarray of float, shape (n_slaves,)
        Smallest pulse over largest pulse of a telegram, 0..1; 0 if none is received.
    ringing : ndarray of float, shape (n_slaves,)
        Largest voltage without a pulse over largest pulse; 1 if none is received.
    received : ndarray of float, shape (n_slaves,)
        Share of the telegrams that are received as they were sent, 0..1.
    """

    level_least: Floats
    level_most: Floats
    evenness: Floats
    ringing: Floats
    received: Floats


def signal_quality(segment: Segment, words: Sequence[str] = RESPONSES) -> SignalQuality:
    """Return how telegrams come over between the master and each slave of a segment.

    Parameters
    ----------
    segment : Segment
        Cable, supply, master and slaves.
    words : sequence of str, default all 16 responses
        Telegrams of one length, 7 or 14 bits.

    Returns
    -------
    SignalQuality
        One entry for each of `segment.slaves`.

    Raises
    ------
    ArgumentError
        If the words are not telegrams of one length, or a node is unknown.

    Notes
    -----
    By reciprocity a slave hears of the master what the master hears of it, if both send with the
    same current, so it serves both directions. The send current does not depend on the voltage
    here; a real sender may clip.

    Examples
    --------
    >>> from shipnet.asi.topology import straight_line
    >>> quality = signal_quality(straight_line(100, slaves=(5, 100)))
    >>> quality.level_least.round(1).tolist(), quality.evenness.round(2).tolist()
    ([4.9, 6.5], [0.96, 0.95])
    """
    bits = as_bits(words)
    n_bits = bits.shape[-1]
    duration = n_bits * BIT_TIME + _SILENCE
    _, u = segment.signals(bits, dt=_STEP, duration=duration)
    heard = receive(u, _STEP, n_bits)
    right = (heard.error == 0) & (heard.bits == bits).all(axis=-1)
    level = np.ptp(u, axis=-1)
    return SignalQuality(
        level.min(axis=1),
        level.max(axis=1),
        np.nan_to_num(heard.weakest, nan=0.0).min(axis=1),
        np.nan_to_num(heard.ringing, nan=1.0).max(axis=1),
        right.mean(axis=1),
    )
