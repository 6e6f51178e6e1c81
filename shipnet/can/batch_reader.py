"""Lines -> frames by the million: what `shipnet.can.reader.decode` does to one, to every row.

All bits are read first, as if stuffing never ended. What each rule of the standard finds then has
a place on the line, and the first on the line is the error of the row.
"""

from __future__ import annotations

from itertools import accumulate
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from shipnet.can.batch import CHUNK, check_values, region_bits
from shipnet.can.layout import CRC_BITS, TAIL, head
from shipnet.can.packed import DEAD, Words, left, reading_table, right, stuff_count
from shipnet.errors import (
    AcknowledgeError,
    ArgumentError,
    CrcError,
    FormError,
    FrameError,
    LengthError,
    StartBitError,
    StuffError,
    SymbolError,
)

__all__ = ["Decoded", "decode_frames"]

Integers = npt.NDArray[np.int64]
Flags = npt.NDArray[np.bool_]
Bits = npt.NDArray[np.uint8]


def _starts(extended: bool) -> dict[str, int]:
    """Return the first bit of each field of the head, and of the data."""
    fields = head(extended)
    ends = accumulate(map(len, fields.values()), initial=0)
    return dict(zip([*fields, "data"], ends, strict=True))


_BASE, _LONG = _starts(False), _starts(True)


class Decoded(NamedTuple):
    """What was read; all arrays but `data` have the shape (n,).

    Attributes
    ----------
    error : ndarray of uint8
        0, or a code of `shipnet.errors`; the fields from `arbitration_id` on are then 0.
    position : ndarray of int16
        The bit that broke the rule, counted from 0, or the first that is missing; -1 without an
        error.
    arbitration_id : ndarray of int64
        Arbitration ids.
    dlc : ndarray of uint8
        Data length codes.
    data : ndarray of uint8, shape (n, 8)
        Data bytes, 0 behind those that a frame carries.
    extended, remote : ndarray of bool
        As in `Frame`.
    length : ndarray of uint8
        Bits from start of frame to end of frame.
    """

    error: npt.NDArray[np.uint8]
    position: npt.NDArray[np.int16]
    arbitration_id: Integers
    dlc: npt.NDArray[np.uint8]
    data: npt.NDArray[np.uint8]
    extended: Flags
    remote: Flags
    length: npt.NDArray[np.uint8]


class _Read(NamedTuple):
    """The bits of rows without stuff bits."""

    high: Words
    low: Words
    kept: Integers
    passed: Integers
    dead: Flags

    def at(self, place: int, width: int = 1) -> Integers:
        """Return a field of the head as a number."""
        return (self.high >> (64 - place - width)).astype(np.int64) & ((1 << width) - 1)

    def first(self, count: npt.ArrayLike) -> tuple[Words, Words]:
        """Return the first bits of each row as a number; their count is 1..118."""
        beyond = 128 - np.asarray(count, dtype=np.int64)
        low = right(self.low, beyond) | left(self.high, 64 - beyond)
        return right(self.high, beyond), low | right(self.high, beyond - 64)

    def on_line(self, count: npt.ArrayLike) -> Integers:
        """Return how many bits of the line the first bits and their stuff bits take."""
        size = np.asarray(count, dtype=np.int64)
        high, low = self.first(size)
        one = np.ones_like(low)
        return size + stuff_count(high | left(one, size - 64), low | left(one, size))


class _First:
    """The error of each row that stands first on its line."""

    def __init__(self, end: Integers, error: npt.NDArray[np.uint8]) -> None:
        self.position = end
        self.error = error

    def note(self, kind: type[FrameError], broken: Flags, position: Integers | int) -> None:
        """Take an error where it stands before all others."""
        earlier = broken & (position < self.position)
        self.error = np.where(earlier, np.uint8(kind.code), self.error)
        self.position = np.where(earlier, position, self.position)


def decode_frames(bits: npt.ArrayLike) -> Decoded:
    """Read the frame that each row of bits begins with.

    Parameters
    ----------
    bits : array_like of int, shape (n, n_bits)
        0 (dominant) and 1, from start of frame on, with stuff bits; n_bits at most 1024. What
        follows the end of a frame is not looked at.

    Returns
    -------
    Decoded
        One array a field.

    Raises
    ------
    ArgumentError
        If `bits` is no table of whole numbers.

    Examples
    --------
    >>> from shipnet.can.batch import encode_frames
    >>> bits = encode_frames([0x14, 0x15], range(8)).bits
    >>> bits[1, 50] ^= 1
    >>> decoded = decode_frames(bits)
    >>> decoded.error.tolist(), decoded.data[0].tolist()
    ([0, 14], [0, 1, 2, 3, 4, 5, 6, 7])
    """
    rows = np.asarray(bits)
    if rows.dtype.kind not in "iu" or rows.ndim != 2 or rows.shape[1] > 1024:
        raise ArgumentError(
            f"bits are {rows.dtype} of shape {rows.shape}; they must be whole numbers of shape "
            "(n, n_bits), with at most 1024 bits"
        )
    parts = [_decode(rows[k : k + CHUNK]) for k in range(0, max(1, len(rows)), CHUNK)]
    return Decoded(*(np.concatenate(field) for field in zip(*parts, strict=True)))


def _decode(rows: npt.NDArray[np.integer]) -> Decoded:
    n, width = rows.shape
    strange = (rows != 0) & (rows != 1)
    # Where no bit stands the line is taken for recessive; what is read there comes too late to
    # count. The columns are whole bytes, and one more than there are bits.
    line = np.ones((n, 8 * (width // 8 + 1)), dtype=np.uint8)
    line[:, :width] = np.where(strange, 1, rows)
    strange = np.column_stack([strange, np.ones(n, dtype=bool)])
    end = strange.argmax(axis=1)
    first = _First(end, np.where(end < width, SymbolError.code, LengthError.code).astype(np.uint8))

    read = _destuff(line)
    extended = read.at(_LONG["IDE"]) == 1
    remote = np.where(extended, read.at(_LONG["RTR"]), read.at(_BASE["RTR"])) == 1
    dlc = np.where(extended, read.at(_LONG["DLC"], 4), read.at(_BASE["DLC"], 4))
    first.note(StartBitError, read.at(0) == 1, 0)
    _check_head(first, read, extended)

    size = region_bits(dlc, extended, remote)
    first.note(StuffError, read.dead & (read.kept <= size), read.passed)
    whole = read.kept >= size
    region = read.on_line(size)
    high, low = read.first(size)
    received = low.astype(np.int64) & 2**CRC_BITS - 1
    low = right(low, CRC_BITS) | left(high, 64 - CRC_BITS)
    expected = check_values(right(high, CRC_BITS), low)
    first.note(CrcError, whole & (received != expected), region - 1)
    length = _check_tail(first, line, whole, region)

    right_row = whole & (first.position >= length)
    error = np.where(right_row, np.uint8(0), first.error)
    number = read.at(_BASE["base identifier"], 11)
    long = number << 18 | read.at(_LONG["identifier extension"], 18)
    before = np.where(extended, _LONG["data"], _BASE["data"])
    content = left(read.high, before) | right(read.low, 64 - before)
    content &= ~right(np.full(n, ~np.uint64(0)), np.where(remote, 0, 8 * np.minimum(dlc, 8)))
    data = content.astype(">u8").view(np.uint8).reshape(n, 8)
    return Decoded(
        error,
        np.where(right_row, -1, first.position).astype(np.int16),
        np.where(extended, long, number) * right_row,
        (dlc * right_row).astype(np.uint8),
        data * right_row[:, np.newaxis],
        extended & right_row,
        remote & right_row,
        (length * right_row).astype(np.uint8),
    )


def _destuff(line: Bits) -> _Read:
    """Take the stuff bits away, up to a sixth equal bit."""
    table = reading_table()
    n = len(line)
    state = np.zeros(n, dtype=np.uint16)
    high, low = np.zeros((2, n), dtype=np.uint64)
    count, passed = np.zeros((2, n), dtype=np.int64)
    for column in np.ascontiguousarray(np.packbits(line, axis=1).T):
        index = state | column
        state = table.state.take(index)
        kept = table.bits.take(index)
        count += table.length.take(index)
        passed += table.passed.take(index)
        high |= left(kept, 64 - count) | right(kept, count - 64)
        low |= left(kept, 128 - count)
    return _Read(high, low, count, passed, state == DEAD)


def _check_head(first: _First, read: _Read, extended: Flags) -> None:
    """Find reserved bits that are recessive, and a dominant SRR in front of IDE."""
    rules = [
        (_BASE["r0"], ~extended & (read.at(_BASE["r0"]) == 1)),
        (_LONG["r0"], extended & (read.at(_LONG["r0"]) == 1)),
        (_LONG["r1"], extended & (read.at(_LONG["r1"]) == 1)),
        (_LONG["IDE"], extended & (read.at(_LONG["SRR"]) == 0)),
    ]
    # Bits that were never read are 0, and break none of these.
    for place, broken in rules:
        if broken.any():
            first.note(FormError, broken, read.on_line(np.full(len(broken), place)))


def _check_tail(first: _First, line: Bits, whole: Flags, region: Integers) -> Integers:
    """Find fixed bits behind the CRC sequence that are wrong; return the length of the frames."""
    position = region
    last = line.shape[1] - 1
    rows = np.arange(len(line))
    for name, fixed in TAIL:
        kind = AcknowledgeError if name == "ACK slot" else FormError
        for place, bit in enumerate(fixed, start=1):
            seen = line[rows, np.minimum(position, last)]
            if not (name == "EOF" and place == len(fixed)):
                first.note(kind, whole & (seen != int(bit)), position)
            position = position + 1
    return position
