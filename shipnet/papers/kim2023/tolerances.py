"""Section 3.4: what the receiver copes with, and what an open cable does to the pulses."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from shipnet.asi.modulation import HALF_BIT, as_bits, pulses_of
from shipnet.asi.receiver import receive, within_tolerance
from shipnet.asi.segment import DEVICE, Segment
from shipnet.asi.telegram import RESPONSES
from shipnet.asi.topology import straight_line
from shipnet.line.cable import CABLES, Cable
from shipnet.line.network import CableRun, Network
from shipnet.papers.registry import check

__all__ = ["train_of"]

Floats = npt.NDArray[np.float64]

#: Sampling interval of the trains [s].
STEP = 250e-9


def train_of(heights: npt.ArrayLike) -> Floats:
    """Return the voltage of pulses of given heights, one a half-bit, between two silences.

    Such pulses have a mean, which a receiver takes off; the long silence behind keeps it small.

    Parameters
    ----------
    heights : array_like of float, shape (..., n_slots)
        Height and sign of each pulse [V].

    Returns
    -------
    ndarray of float, shape (..., 2048)
        Voltage every 250 ns, the first pulse from 4.5 us on [V].

    Examples
    --------
    >>> u = train_of([0, -2.0, 1.0])
    >>> float(u.min().round(6)), float(u.max().round(6))
    (-2.0, 1.0)
    """
    heights = np.asarray(heights, dtype=float)
    x = (np.arange(2048) * STEP - 4.5e-6) / HALF_BIT - np.arange(heights.shape[-1])[:, np.newaxis]
    shape = np.where((x > 0) & (x < 1), np.sin(np.pi * x) ** 2, 0.0)
    return np.asarray(heights @ shape)


@check("kim2023-023", counter={"difference": 0.65})
def copes_with_amplitudes(*, difference: float = 0.35) -> bool:
    """Whether every response is read if its pulses differ by this share of the largest.

    With the first pulse as the largest and as the smallest, and both ends of the range of the
    comparator, 45 % to 55 % of the first pulse.
    """
    sent = as_bits(RESPONSES)
    low = np.full((2, 14), 1 - difference)
    low[0, 1], low[1, 2:] = 1, 1
    u = train_of(2 * pulses_of(sent)[:, np.newaxis] * low)
    heard = [receive(u, STEP, 7, threshold=threshold, matched=False) for threshold in (0.45, 0.55)]
    return all(bool((one.bits == sent[:, np.newaxis]).all()) for one in heard)


@check("kim2023-024", counter={"overshoot": 0.4})
def copes_with_overshoot(*, overshoot: float = 0.3) -> bool:
    """Whether every response is read if all slots without a pulse ring by this share.

    The first pulse, by which the receiver sets its threshold, is the smallest that the other
    tolerance allows, 65 % of the largest.
    """
    sent = as_bits(RESPONSES)
    pulses = np.pad(pulses_of(sent), ((0, 0), (0, 2))).astype(float)
    swing = overshoot * (-1.0) ** np.arange(pulses.shape[1])
    heights = np.where(pulses != 0, pulses, np.stack([swing, -swing])[:, np.newaxis])
    heights[..., 0] = 0
    heights[..., 1] *= 0.65
    heard = receive(train_of(2 * heights), STEP, 7, matched=False)
    return bool((heard.error == 0).all() and (heard.bits == sent).all())


@check("kim2023-098", "icn2007-047", counter={"length": 200.0})
def copes_with_open_end(*, length: float = 100.0) -> bool:
    """Whether all responses from along an unterminated cable stay within both tolerances."""
    segment = straight_line(length, slaves=(0.05 * length, 0.5 * length, length))
    sent = as_bits(RESPONSES)
    heard = receive(segment.signals(sent, dt=STEP)[1], STEP, 7)
    return bool(within_tolerance(heard).all() and (heard.bits == sent).all())


@check("kim2023-095", "icn2007-053", counter={"part": "inductor"})
def works_without(*, part: str = "conductor") -> bool:
    """Whether the master still reads a slave that lacks this part of its own.

    The conductor is the metre of wire from the slave to the cable.
    """
    segment = straight_line(100, slaves=())
    lost = Cable(r=1e12, l=1e-6, c=1e-15)
    stub = CableRun("100 m", "slave", 1, lost if part == "conductor" else CABLES["as-i 1.5"])
    slave = replace(DEVICE, l=None) if part == "inductor" else DEVICE
    network = Network([*segment.network.runs, stub], {**segment.network.loads, "slave": slave})
    sent = as_bits(RESPONSES)
    _, u = Segment(network, segment.master, ("slave",)).signals(sent, dt=STEP)
    return bool((receive(u[0], STEP, 7).error == 0).all())
