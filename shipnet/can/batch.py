"""Frames by the million: their lengths, stuff bits and check values, and their bits on the line.

The functions raise nothing for a frame that cannot be: an array of codes of `shipnet.errors` says
which. They agree with `shipnet.can.frame` on every frame.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from shipnet.can.layout import CRC, CRC_BITS, LONGEST, TAIL, highest_id, stuffed_region
from shipnet.can.packed import Words, columns, left, right, stuff_count, stuffing_table
from shipnet.crc import crc_batch
from shipnet.errors import ArgumentError

__all__ = ["Encoded", "Measures", "check_values", "encode_frames", "measure_frames", "region_bits"]

#: Frames worked on at a time: they and what is made of them stay in a core's own cache.
CHUNK = 2**13

Integers = npt.NDArray[np.int64]
Flags = npt.NDArray[np.bool_]
Codes = npt.NDArray[np.uint8]

_TAIL_BITS = sum(len(bits) for _, bits in TAIL)


class Measures(NamedTuple):
    """What frames take of the bus; all arrays have the shape (n,).

    Attributes
    ----------
    error : ndarray of uint8
        0, or ``ArgumentError.code`` where there is no such frame; the other fields are then 0.
    crc : ndarray of uint16
        Check values.
    stuff_bits : ndarray of uint8
        Number of stuff bits.
    length : ndarray of uint8
        Bits from start of frame to end of frame; `INTERMISSION` comes on top.
    """

    error: Codes
    crc: npt.NDArray[np.uint16]
    stuff_bits: npt.NDArray[np.uint8]
    length: npt.NDArray[np.uint8]


class Encoded(NamedTuple):
    """Frames on the line.

    Attributes
    ----------
    error : ndarray of uint8, shape (n,)
        0, or ``ArgumentError.code`` where there is no such frame; the bus is idle then.
    length : ndarray of uint8, shape (n,)
        Bits from start of frame to end of frame, 0 where there is no frame.
    bits : ndarray of uint8, shape (n, 160)
        A frame a row, with its stuff bits; behind its end the bus is recessive.
    """

    error: Codes
    length: npt.NDArray[np.uint8]
    bits: npt.NDArray[np.uint8]


class _Fields(NamedTuple):
    """Checked arguments, one row a frame."""

    error: Codes
    number: Integers
    data: npt.NDArray[np.uint8]
    dlc: Integers
    extended: Flags
    remote: Flags


def measure_frames(
    arbitration_id: npt.ArrayLike,
    data: npt.ArrayLike,
    dlc: npt.ArrayLike = 8,
    *,
    extended: npt.ArrayLike = False,
    remote: npt.ArrayLike = False,
) -> Measures:
    """Return check value, stuff bits and length of many frames.

    Parameters
    ----------
    arbitration_id : array_like of int, shape () or (n,)
        Arbitration ids, 0..2047, or 0..2**29 - 1 where `extended`.
    data : array_like of int, shape (8,) or (n, 8)
        Data bytes, 0..255. What a frame does not carry after its `dlc` is not looked at.
    dlc : array_like of int, shape () or (n,), default 8
        Data length codes, 0..15.
    extended, remote : array_like of bool, shape () or (n,), default False
        As in `Frame`.

    Returns
    -------
    Measures
        One array a field.

    Raises
    ------
    ArgumentError
        If an array has another type, or if the shapes do not fit.

    Examples
    --------
    >>> rows = np.array([[0] * 8, [0xFF] * 8, [0x55] * 8])
    >>> measure_frames(0x123, rows).stuff_bits.tolist()
    [14, 13, 1]
    """
    fields = _checked(arbitration_id, data, dlc, extended, remote)
    parts = [_measure(chunk) for chunk in _chunks(fields)]
    return Measures(*(np.concatenate(field) for field in zip(*parts, strict=True)))


def encode_frames(
    arbitration_id: npt.ArrayLike,
    data: npt.ArrayLike,
    dlc: npt.ArrayLike = 8,
    *,
    extended: npt.ArrayLike = False,
    remote: npt.ArrayLike = False,
) -> Encoded:
    """Return the bits on the line of many frames.

    Parameters
    ----------
    arbitration_id : array_like of int, shape () or (n,)
        Arbitration ids, 0..2047, or 0..2**29 - 1 where `extended`.
    data : array_like of int, shape (8,) or (n, 8)
        Data bytes, 0..255. What a frame does not carry after its `dlc` is not looked at.
    dlc : array_like of int, shape () or (n,), default 8
        Data length codes, 0..15.
    extended, remote : array_like of bool, shape () or (n,), default False
        As in `Frame`.

    Returns
    -------
    Encoded
        One array a field.

    Raises
    ------
    ArgumentError
        If an array has another type, or if the shapes do not fit.

    Examples
    --------
    >>> encoded = encode_frames([0x14, 0x15], [0] * 8, 0)
    >>> encoded.length.tolist(), encoded.bits.shape
    ([47, 46], (2, 160))
    >>> "".join(map(str, encoded.bits[0, :47]))
    '00000100101000001000001110100001010101011111111'
    """
    fields = _checked(arbitration_id, data, dlc, extended, remote)
    parts = [_encode(chunk) for chunk in _chunks(fields)]
    return Encoded(*(np.concatenate(field) for field in zip(*parts, strict=True)))


def region_bits(dlc: Integers, extended: Flags, remote: Flags) -> Integers:
    """Return how many bits of frames are subject to stuffing, stuff bits not counted.

    Parameters
    ----------
    dlc : ndarray of int, shape (n,)
        Data length codes, 0..15.
    extended, remote : ndarray of bool, shape (n,)
        As in `Frame`.

    Returns
    -------
    ndarray of int64, shape (n,)
        Bits from the start of frame to the end of the CRC sequence.

    Examples
    --------
    >>> region_bits(np.array([8, 8]), np.array([False, True]), np.array([False, True])).tolist()
    [98, 54]
    """
    empty = np.where(extended, stuffed_region(0, True), stuffed_region(0, False))
    return empty + np.where(remote, 0, 8 * np.minimum(dlc, 8))


def check_values(high: Words, low: Words) -> npt.NDArray[np.uint16]:
    """Return the check values of frames given as numbers.

    Parameters
    ----------
    high, low : ndarray of uint64, shape (n,)
        The bits from start of frame to the last of the data, as numbers below 2**104.

    Returns
    -------
    ndarray of uint16, shape (n,)
        Check values; zeros before the start of frame do not count.

    Examples
    --------
    >>> check_values(np.array([0], np.uint64), np.array([0x7C0 << 15 | 0x17D], np.uint64)).tolist()
    [30]
    """
    return crc_batch(CRC, columns(high, low)[3:].T).astype(np.uint16)


def _checked(
    arbitration_id: npt.ArrayLike,
    data: npt.ArrayLike,
    dlc: npt.ArrayLike,
    extended: npt.ArrayLike,
    remote: npt.ArrayLike,
) -> _Fields:
    number = _array("arbitration_id", arbitration_id, "iu", "whole numbers")
    rows = _array("data", data, "iu", "whole numbers")
    code = _array("dlc", dlc, "iu", "whole numbers")
    long = _array("extended", extended, "b", "True or False")
    asks = _array("remote", remote, "b", "True or False")
    shapes = [array.shape for array in (number, code, long, asks)] + [rows.shape[:-1]]
    if rows.ndim == 0 or rows.shape[-1] != 8 or max(map(len, shapes)) > 1:
        raise ArgumentError(
            f"data have shape {rows.shape} and the rest {shapes[:-1]}; they must be (n, 8) and (n,)"
        )
    try:
        (n,) = np.broadcast_shapes((1,), *shapes)
    except ValueError:
        raise ArgumentError(f"the arguments have different lengths: {shapes}") from None
    bad = (number < 0) | (number > np.where(long, highest_id(True), highest_id(False)))
    bad = bad | (code < 0) | (code > 15)
    if rows.dtype != np.uint8:
        bad = bad | ((rows < 0) | (rows > 255)).any(axis=-1)
    error = np.where(bad, ArgumentError.code, 0).astype(np.uint8)

    def column(array: npt.NDArray[Any], to: type[np.generic]) -> npt.NDArray[Any]:
        return np.broadcast_to(np.where(bad, 0, array).astype(to), (n,))

    return _Fields(
        np.broadcast_to(error, (n,)),
        column(number, np.int64),
        np.broadcast_to(rows.astype(np.uint8, copy=False), (n, 8)),
        column(code, np.int64),
        column(long, np.bool_),
        column(asks, np.bool_),
    )


def _array(name: str, values: npt.ArrayLike, kinds: str, what: str) -> npt.NDArray[Any]:
    array = np.asarray(values)
    if array.size and array.dtype.kind not in kinds:
        raise ArgumentError(f"{name} must be {what}, but their dtype is {array.dtype}")
    return array if array.size else array.astype(np.int64 if "i" in kinds else np.bool_)


def _chunks(fields: _Fields) -> list[_Fields]:
    n = len(fields.error)
    return [
        _Fields._make(field[begin : begin + CHUNK] for field in fields)
        for begin in range(0, max(1, n), CHUNK)
    ]


def _pack(fields: _Fields) -> tuple[Words, Words, npt.NDArray[np.uint16]]:
    """Return the bits subject to stuffing behind a mark, and the check values."""
    number, extended, remote = fields.number, fields.extended, fields.remote
    base = number << 7
    # SRR and IDE are the bits 26 and 25 of an extended frame's head.
    long = number >> 18 << 27 | 3 << 25 | (number & 2**18 - 1) << 7
    head = (np.where(extended, long, base) | remote * 64 | fields.dlc).astype(np.uint64)
    carried = region_bits(fields.dlc, extended, remote) - region_bits(0 * number, extended, remote)
    content = np.ascontiguousarray(fields.data).view(">u8")[:, 0].astype(np.uint64)
    low = right(content, 64 - carried) | left(head, carried)
    high = right(head, 64 - carried)
    check = check_values(high, low)
    high = left(high, CRC_BITS) | right(low, 64 - CRC_BITS)
    low = left(low, CRC_BITS) | check
    size = region_bits(fields.dlc, extended, remote)
    one = np.ones_like(low)
    return high | left(one, size - 64), low | left(one, size), check


def _measure(fields: _Fields) -> Measures:
    high, low, check = _pack(fields)
    stuffed = stuff_count(high, low)
    length = region_bits(fields.dlc, fields.extended, fields.remote) + stuffed + _TAIL_BITS
    legal = fields.error == 0
    return Measures(
        fields.error,
        check * legal,
        (stuffed * legal).astype(np.uint8),
        (length * legal).astype(np.uint8),
    )


def _encode(fields: _Fields) -> Encoded:
    high, low, _ = _pack(fields)
    table = stuffing_table()
    dominant = np.zeros((3, len(high)), dtype=np.uint64)
    position = np.zeros(len(high), dtype=np.int64)
    state = np.zeros(len(high), dtype=np.uint16)
    for column in columns(high, low):
        index = state | column
        state = table.state.take(index)
        position += table.length.take(index)
        _put(dominant, table.dominant.take(index), position)
    ack = sum(len(bits) for _, bits in TAIL[:1]) + 1
    _put(dominant, np.ones(len(high), dtype=np.uint64), position + ack)
    legal = fields.error == 0
    words = (~dominant | np.where(legal, np.uint64(0), ~np.uint64(0))).T.astype(">u8", order="C")
    return Encoded(
        fields.error,
        ((position + _TAIL_BITS) * legal).astype(np.uint8),
        np.unpackbits(words.view(np.uint8), axis=1, count=LONGEST),
    )


def _put(words: Words, bits: Words, end: Integers) -> None:
    """Write bits into rows of words, the last of them just before `end`."""
    for place, word in enumerate(words, start=1):
        word |= left(bits, 64 * place - end) | right(bits, end - 64 * place)
