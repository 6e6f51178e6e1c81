"""Lengths of CAN frames: bounds, mean lengths, and the exact lengths of millions of frames."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal, overload

import numpy as np
import numpy.typing as npt

from shipnet.arrays import Floats, Integers
from shipnet.can.frame import CRC_BITS, HEADS, INTERMISSION, RUN, TAIL, stuffed_region
from shipnet.compiled import compiled
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
        np.broadcast_to(np.asarray(values, dtype=np.int64), len(data))
        for values in (arbitration_id, dlc, extended, remote)
    )
    octets: Octets = np.ascontiguousarray(data, dtype=np.uint8).reshape(-1, 8)
    payloads = octets.view(">i8").astype(np.int64).reshape(-1)
    head = np.where(long, *(_head(number, kind, asks, code) for kind in (True, False)))
    head_bits = np.where(long, *(stuffed_region(0, kind) - CRC_BITS for kind in (True, False)))
    data_bits = np.where(asks, 0, 8 * np.minimum(code, 8))
    steps = int((head_bits + data_bits + CRC_BITS).sum())
    lengths = stuffed_lengths.run(
        steps, head, head_bits, payloads, data_bits, CRC.polynomial, CRC_BITS, RUN
    )
    return lengths + _TAIL_BITS


def _head(number: Integers, extended: bool, remote: Integers, dlc: Integers) -> Integers:
    """Return the bits before the data, field by field, as one integer."""
    chosen = {
        "base identifier": number >> 18 if extended else number,
        "identifier extension": number % 2**18,
        "RTR": remote,
        "DLC": dlc,
    }
    head = np.zeros_like(number)
    for name, bits in HEADS[extended].items():
        head = head << len(bits) | (chosen[name] if name in chosen else int(bits))
    return head


@compiled
def stuffed_lengths(
    head: Integers,
    head_bits: Integers,
    data: Integers,
    data_bits: Integers,
    polynomial: int,
    crc_bits: int,
    run_length: int,
) -> Integers:
    """Return the number of bits up to the end of the CRC sequence, with stuff bits.

    `data` contains 64 bits, of which the first `data_bits` are sent. The polynomial is subtracted
    if the bit sent and the bit that leaves the CRC register differ. After the data, the register
    itself is sent (Bosch, "CAN Specification" 2.0, 1991, part A, sections 3.1.1 and 5).
    """
    length, mask = np.zeros_like(head), 2**crc_bits - 1
    for frame in range(len(head)):
        checked = head_bits[frame] + data_bits[frame]
        register, last, run, stuffed = 0, -1, 0, 0
        for index in range(checked + crc_bits):
            out = register >> (crc_bits - 1)
            if index < head_bits[frame]:
                bit = head[frame] >> (head_bits[frame] - 1 - index) & 1
            elif index < checked:
                bit = data[frame] >> (head_bits[frame] + 63 - index) & 1
            else:
                bit = out
            register = register << 1 & mask ^ (bit ^ out) * polynomial
            run = run + 1 if bit == last else 1
            last = bit
            if run == run_length:
                stuffed += 1
                last, run = 1 - bit, 1
        length[frame] = checked + crc_bits + stuffed
    return length
