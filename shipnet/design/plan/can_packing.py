"""Which points share a CAN message: one station, one direction, one update need, 64 bits."""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from shipnet.errors import ArgumentError

__all__ = ["ANALOGUE_BITS", "FRAME_BITS", "Packed", "pack"]

#: What a value takes, and what a frame has for data [bit].
ANALOGUE_BITS, FRAME_BITS = 16, 64

Ints = npt.NDArray[np.intp]


class Packed(NamedTuple):
    """A message with its points.

    Attributes
    ----------
    output : bool
        Whether it goes from the host to the station.
    need : float
        Update need of all its points [s].
    rows : ndarray of int, shape (n,)
        Its points, by their places in what was packed.
    bits : ndarray of int, shape (n,)
        Where each begins, from 0.
    dlc : int
        Data bytes, 1..8.
    """

    output: bool
    need: float
    rows: Ints
    bits: Ints
    dlc: int


def pack(types: Sequence[str], need: npt.ArrayLike) -> list[Packed]:
    r"""Return the messages of a station, as few as there can be.

    .. math:: n = \max\left( \left\lceil \frac{a}{4} \right\rceil,
              \left\lceil \frac{16 a + d}{64} \right\rceil \right)

    Parameters
    ----------
    types : sequence of {"DI", "DO", "AI", "AO"}
        Type of each point: a digital one takes 1 bit, an analogue one 16.
    need : array_like, shape (n,)
        Update need of each point, positive [s]; a message holds points of one need only.

    Returns
    -------
    list of Packed
        Inputs before outputs, the most urgent first; analogue values lie at the front of a frame.

    Raises
    ------
    ArgumentError
        If a type is unknown, or a need is not positive or not given for each point.

    Examples
    --------
    Five values and eight contacts: the contacts find room behind the fifth value.

    >>> for message in pack(["AI"] * 5 + ["DI"] * 8, [1.0] * 13):
    ...     print(message.dlc, message.bits.tolist())
    8 [0, 16, 32, 48]
    3 [0, 16, 17, 18, 19, 20, 21, 22, 23]
    """
    kinds = np.asarray(types, dtype=object)
    times = np.asarray(need, dtype=np.float64)
    if times.shape != kinds.shape or not (times > 0).all():
        raise ArgumentError(f"need must be a positive time for each of {len(kinds)} points")
    strange = sorted({str(kind) for kind in kinds} - {"DI", "DO", "AI", "AO"})
    if strange:
        raise ArgumentError(f"type is {strange[0]!r}; it must be DI, DO, AI or AO")
    output = np.isin(kinds, ["DO", "AO"])
    analogue = np.isin(kinds, ["AI", "AO"])
    messages = []
    for way in (False, True):
        for time in np.unique(times[output == way]):
            mine = (output == way) & (times == time)
            messages += _pack(way, float(time), mine & analogue, mine & ~analogue)
    return messages


def _pack(
    output: bool, need: float, analogue: npt.NDArray[np.bool_], digital: npt.NDArray[np.bool_]
) -> list[Packed]:
    values, states = np.flatnonzero(analogue), np.flatnonzero(digital)
    each = FRAME_BITS // ANALOGUE_BITS
    total = ANALOGUE_BITS * len(values) + len(states)
    number = max(ceil(len(values) / each), ceil(total / FRAME_BITS))
    in_frame = np.bincount(np.arange(len(values)) // each, minlength=number)
    front = ANALOGUE_BITS * in_frame
    ends = np.cumsum(FRAME_BITS - front)
    place = np.arange(len(states))
    frame = np.searchsorted(ends, place, side="right")
    bit = place - np.concatenate([[0], ends])[frame] + front[frame]
    rows = np.concatenate([values, states])
    frames = np.concatenate([np.arange(len(values)) // each, frame])
    bits = np.concatenate([ANALOGUE_BITS * (np.arange(len(values)) % each), bit])
    messages = []
    for own in range(number):
        inside = frames == own
        filled = front[own] + (frame == own).sum()
        messages.append(
            Packed(output, need, rows[inside], bits[inside].astype(np.intp), ceil(filled / 8))
        )
    return messages
