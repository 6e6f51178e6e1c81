"""Lengths of CAN frames: bounds, mean lengths, and the exact lengths of millions of frames.

Frames are measured byte by byte: a table gives the number of stuff bits for each state and byte.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Literal, NamedTuple, overload

import numpy as np
import numpy.typing as npt

from shipnet.arrays import Bools, Floats, Integers
from shipnet.can.frame import INTERMISSION, RUN, TAIL, stuffed_region
from shipnet.crc import CAN as CRC
from shipnet.errors import ArgumentError
from shipnet.fields import check_choice

Stuffing = Literal["none", "mean", "attainable", "worst"]

Octets = npt.NDArray[np.uint8]

#: Number of bits after the CRC sequence, including intermission.
_TAIL_BITS = sum(len(bits) for _, bits in TAIL) + INTERMISSION

#: Mean number of stuff bits by identifier length (11, 29 bits) and number of data bytes, for
#: uniformly random identifiers and data, including the CRC; calculated by dynamic programming over
#: CRC register, last bit and run. The tests repeat the calculation (`tests/can/test_lengths.py`).
_MEAN_STUFF = (
    (1.968750, 2.018089, 2.248796, 2.648793, 2.348793, 2.548793, 2.815460, 3.352960, 3.283168),
    (2.738010, 2.791322, 3.022456, 3.422457, 3.122450, 3.322451, 3.589117, 4.126897, 4.055775),
)

#: Largest number of stuff bits for any identifier and data, calculated in the same way.
_MOST_STUFF = ((6, 7, 9, 12, 14, 15, 18, 21, 22), (11, 13, 15, 17, 19, 21, 23, 25, 27))


def _bits(most: Callable[[int, int, bool], float]) -> tuple[tuple[float, ...], tuple[float, ...]]:
    standard, extended = (
        tuple(
            stuffed_region(n, kind) + _TAIL_BITS + most(stuffed_region(n, kind), n, kind)
            for n in range(9)
        )
        for kind in (False, True)
    )
    return standard, extended


_TABLE: dict[Stuffing, tuple[tuple[float, ...], tuple[float, ...]]] = {
    "none": _bits(lambda bits, n, kind: 0),
    "mean": _bits(lambda bits, n, kind: _MEAN_STUFF[kind][n]),
    "attainable": _bits(lambda bits, n, kind: _MOST_STUFF[kind][n]),
    "worst": _bits(lambda bits, n, kind: (bits - 1) // 4),
}


def length_table(stuffing: Stuffing) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Return frame lengths [bit] by identifier length (11, 29 bits) and number of data bytes."""
    check_choice("stuffing", stuffing, _TABLE)
    return _TABLE[stuffing]


@overload
def frame_length(dlc: int, *, stuffing: Stuffing = ..., extended: bool = ...) -> float: ...
@overload
def frame_length(
    dlc: npt.ArrayLike, *, stuffing: Stuffing = ..., extended: npt.ArrayLike = ...
) -> Floats: ...
def frame_length(
    dlc: npt.ArrayLike, *, stuffing: Stuffing = "worst", extended: npt.ArrayLike = False
) -> float | Floats:
    r"""Return the length of data frames, including intermission.

    With :math:`s` data bytes and :math:`g` other bits that are subject to stuffing, 34 for an
    11-bit and 54 for a 29-bit identifier, the bound is

    .. math:: n = g + 8 s + 13 + \left\lfloor \frac{g + 8 s - 1}{4} \right\rfloor

    Parameters
    ----------
    dlc : int or array_like of int
        Data bytes, 0..8.
    stuffing : {"none", "mean", "attainable", "worst"}, default "worst"
        Stuff bits counted: none, their mean number over random identifiers and data, their largest
        number in any frame, or the bound above.
    extended : bool or array_like of bool, default False
        True if the identifier has 29 bits.

    Returns
    -------
    int or float or ndarray of float
        Length [bit], in the broadcast shape of the arguments; a whole number except for ``"mean"``.

    Notes
    -----
    In the bound of Davis et al. (2007), a run of equal bits may begin with a stuff bit. Tindell and
    Burns (1994) overlooked this and divided by 5 instead of 4; see `response_times`. No frame
    reaches the bound, because reserved bits and CRC cannot be chosen freely: the longest standard
    frame has 133 bits. Real data are not random: a standard frame with eight zero bytes has 13 to
    17 stuff bits, not the mean of 3.3.

    Examples
    --------
    >>> frame_length(8), frame_length(8, stuffing="none"), frame_length(8, stuffing="attainable")
    (135, 111, 133)
    >>> frame_length([0, 7, 8], extended=True).tolist()
    [80.0, 150.0, 160.0]
    """
    table = length_table(stuffing)
    if type(dlc) is int and type(extended) is bool and 0 <= dlc <= 8:
        return table[extended][dlc]
    size = np.asarray(dlc)
    whole = size.dtype.kind in "iu" or (size.dtype.kind == "f" and bool((size % 1 == 0).all()))
    if not whole or (size.size and not (0 <= size.min() and size.max() <= 8)):
        raise ArgumentError(f"dlc is {dlc!r}; expected whole numbers 0..8")
    long = np.asarray(extended)
    if long.dtype.kind != "b":
        raise ArgumentError(f"extended is {extended!r}; it must be True or False")
    columns = np.array(table, dtype=np.float64)
    return np.asarray(columns[long.astype(np.intp), size.astype(np.intp)], dtype=np.float64)


#: Number of frames processed at once; their intermediate results fit into a core's cache.
CHUNK = 2**13

#: States of the stuffing table: 0 before the mark, 1..4 after a run of 1..4 zeros, 5..8 of ones.
_IDLE, _MARK = 0, 1 + (RUN - 1)


def measure_frames(
    arbitration_id: npt.ArrayLike,
    data: npt.NDArray[np.integer],
    dlc: npt.ArrayLike = 8,
    *,
    extended: npt.ArrayLike = False,
    remote: npt.ArrayLike = False,
) -> Integers:
    """Return the lengths of frames, including intermission [bit]; `data` has the shape (n, 8)."""
    number, code, long, asks = (
        np.broadcast_to(np.asarray(values, dtype=kind), len(data))
        for values, kind in (
            (arbitration_id, np.int64), (dlc, np.int64), (extended, np.bool_), (remote, np.bool_)
        )
    )  # fmt: skip
    carried = np.where(asks, 0, np.minimum(code, 8))
    length = np.empty(len(data), dtype=np.int64)
    for size in np.unique(carried).tolist():
        alike = np.flatnonzero(carried == size)
        for part in np.split(alike, range(CHUNK, len(alike), CHUNK)):
            octets = data[part, :size].astype(np.uint8)
            length[part] = _measure(octets, number[part], code[part], long[part], asks[part])
    return length


def _measure(
    data: Octets, number: Integers, dlc: Integers, extended: Bools, remote: Bools
) -> Integers:
    """Return the lengths of frames that have the same number of data bytes."""
    # In an extended frame, SRR and IDE are bits 26 and 25 of the head.
    long = number >> 18 << 27 | 3 << 25 | (number & 2**18 - 1) << 7
    head = np.where(extended, long, number << 7) | remote * 64 | dlc
    # One row per byte, so that each step covers all frames.
    octets = np.empty((5 + data.shape[1] + 2, len(data)), dtype=np.uint8)
    octets[:5] = head.astype(">u8").view(np.uint8).reshape(-1, 8)[:, 3:].T
    octets[5:-2] = data.T
    check = CRC.of(octets[:-2].T).astype(np.uint16)
    # The inverse of the last CRC bit fills the last byte without causing a stuff bit.
    octets[-2:] = (check << 1 | ~check & 1).astype(">u2").view(np.uint8).reshape(-1, 2).T
    # A 1 before the start of frame, in bit 39 or 19 of the head, marks where the frame begins.
    octets[0] |= extended * np.uint8(1 << 7)
    octets[2] |= ~extended * np.uint8(1 << 3)
    table = stuffing_table()
    state = np.zeros(len(data), dtype=np.uint16)
    stuffed = np.zeros(len(data), dtype=np.uint8)
    for row in octets:
        index = state | row
        stuffed += table.stuffed.take(index)
        state = table.state.take(index)
    bare = np.array(length_table("none"), dtype=np.int64)[:, data.shape[1]]
    length: Integers = stuffed + np.where(extended, bare[1], bare[0])
    return length


class StuffingTable(NamedTuple):
    """Next state (times 256) and number of stuff bits inserted, by state * 256 + byte."""

    state: npt.NDArray[np.uint16]
    stuffed: npt.NDArray[np.uint8]


@cache
def stuffing_table() -> StuffingTable:
    """Return the table with which `measure_frames` counts stuff bits."""
    size = (1 + 2 * (RUN - 1)) * 256
    table = StuffingTable(np.zeros(size, np.uint16), np.zeros(size, np.uint8))
    for index in range(size):
        state, byte = divmod(index, 256)
        stuffed = 0
        for bit in map(int, f"{byte:08b}"):
            if state == _IDLE:
                state = _MARK if bit else _IDLE
                continue
            last, run = divmod(state - 1, RUN - 1)
            run = run + 2 if bit == last else 1
            if run == RUN:
                bit, run = 1 - bit, 1
                stuffed += 1
            state = 1 + bit * (RUN - 1) + run - 1
        table.state[index] = state * 256
        table.stuffed[index] = stuffed
    return table
