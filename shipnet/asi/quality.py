"""How well the telegrams of a segment come over: level, evenness, ringing, and whether read."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from shipnet.asi.modulation import as_bits
from shipnet.asi.receiver import receive
from shipnet.asi.segment import Segment
from shipnet.asi.telegram import RESPONSES
from shipnet.asi.timing import BIT_TIME

#: Sampling interval of the waveforms, and the silence behind a telegram [s].
_STEP, _SILENCE = 250e-9, 60e-6

Floats = npt.NDArray[np.float64]


class SignalQuality(NamedTuple):
    """The worst over all telegrams, one entry a slave."""

    level_least: Floats
    level_most: Floats
    evenness: Floats
    ringing: Floats
    received: Floats


def signal_quality(segment: Segment, words: Sequence[str] = RESPONSES) -> SignalQuality:
    """Return how telegrams come over between the master and each slave of a segment."""
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
