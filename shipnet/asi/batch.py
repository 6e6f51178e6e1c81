"""Telegrams by the million: requests and responses as arrays of words.

A word is a telegram as an unsigned number, its first bit on the line the highest. The functions
raise nothing for a bad telegram: an array of codes of `shipnet.errors` says which are bad and
why. They agree with `shipnet.asi.telegram` on every one of the 2**14 and 2**7 words.
"""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import numpy.typing as npt

from shipnet.asi.telegram import REQUEST_BITS, RESPONSE_BITS, Call
from shipnet.errors import (
    ArgumentError,
    EndBitError,
    LengthError,
    ParityError,
    StartBitError,
    UnknownCallError,
    name_of,
)
from shipnet.fields import check_whole

if TYPE_CHECKING:
    import pandas as pd

#: Stands in a field that has no value: no half, or a telegram that could not be read.
NONE = -1

Integers = npt.NDArray[np.int64]
Codes = npt.NDArray[np.uint8]


class Requests(NamedTuple):
    """A batch of requests, one array per field, all of the shape of the words.

    Attributes
    ----------
    error : ndarray of uint8
        0, or a code of `shipnet.errors`; the other fields are then -1.
    call : ndarray of int8
        Value of `Call`.
    address : ndarray of int8
        Address, 0..31.
    data : ndarray of int8
        Data as in `Request.data`.
    half : ndarray of int8
        0 for A, 1 for B, -1 for a standard slave.

    Examples
    --------
    >>> batch = Requests.parse([0b00101010111001, 0b00101010111011])
    >>> batch.table()[["error", "address", "data"]].values.tolist()
    [['ok', 21, 14], ['ParityError', -1, -1]]
    >>> [f"{word:014b}" for word in batch.words]
    ['00101010111001', '00000000000000']
    """

    error: Codes
    call: npt.NDArray[np.int8]
    address: npt.NDArray[np.int8]
    data: npt.NDArray[np.int8]
    half: npt.NDArray[np.int8]

    @classmethod
    def parse(cls, words: npt.ArrayLike, *, extended: npt.ArrayLike = False) -> Requests:
        """Parse words of 14 bits, the first bit on the line the highest; raise for none.

        `extended` says, for all or for each word, whether the addressed slave works in extended
        addressing; see `Request.parse`.
        """
        return parse_requests(words, extended=extended)

    @property
    def words(self) -> npt.NDArray[np.uint16]:
        """The telegrams; 0, which is none, where the fields make no request."""
        return encode_requests(self.call, self.address, self.data, self.half)[0]

    def table(self) -> pd.DataFrame:
        """Return one row per telegram, with its error and its call by name."""
        import pandas as pd

        title = np.array([call.rule.title for call in Call] + [""], dtype=object)
        codes, which = np.unique(self.error.ravel(), return_inverse=True)
        errors = np.array([name_of(code) for code in codes.tolist()], dtype=object)
        return pd.DataFrame(
            {
                "error": errors[which],
                "call": title[self.call.ravel()],
                "address": self.address.ravel(),
                "half": np.array(["A", "B", ""], dtype=object)[self.half.ravel()],
                "data": self.data.ravel(),
            }
        )


class _Layouts(NamedTuple):
    """The patterns of all calls as numbers, row 0 for standard and row 1 for A/B slaves."""

    fixed: npt.NDArray[np.int64]
    fixed_mask: npt.NDArray[np.int64]
    data_mask: npt.NDArray[np.int64]
    select_mask: npt.NDArray[np.int64]
    inverted: npt.NDArray[np.bool_]
    free_address: npt.NDArray[np.bool_]
    lowest_address: npt.NDArray[np.int64]
    lowest_data: npt.NDArray[np.int64]


@cache
def _layouts() -> _Layouts:
    def mask(pattern: str, letters: str) -> int:
        return int("".join("01"[letter in letters] for letter in pattern), 2)

    patterns = [[call.rule.layout(extended) for call in Call] for extended in (False, True)]

    def table(letters: str) -> npt.NDArray[np.int64]:
        return np.array([[mask(pattern, letters) for pattern in row] for row in patterns])

    return _Layouts(
        fixed=table("1"),
        fixed_mask=table("01"),
        data_mask=table("d"),
        select_mask=table("sS"),
        inverted=table("S") > 0,
        free_address=table("a") > 0,
        lowest_address=np.array([call.rule.lowest_address for call in Call]),
        lowest_data=np.array([int(call is Call.ASSIGN_ADDRESS) for call in Call]),
    )


@cache
def _dictionary() -> npt.NDArray[np.int8]:
    """Call, address, data and half of all 2 x 2**11 information words, `NONE` if unknown."""
    information = np.arange(2**11)
    meaning = np.full((2, 2**11, 4), NONE, dtype=np.int8)
    layouts = _layouts()
    address = information >> 5 & 31
    for extended in (0, 1):
        for call in Call:
            fixed, fixed_mask, data_mask, select_mask = (
                int(table[extended, call]) for table in layouts[:4]
            )
            data = information & data_mask
            known = information & fixed_mask == fixed
            known &= data >= layouts.lowest_data[call]
            if layouts.free_address[extended, call]:
                known &= address >= layouts.lowest_address[call]
            half = np.full(information.shape, NONE)
            if select_mask:
                select = (information & select_mask > 0) ^ layouts.inverted[extended, call]
                half = np.where(select, 1, 0 if extended else NONE)
            calls = np.full(information.shape, call)
            meaning[extended, known] = np.column_stack([calls, address, data, half])[known]
    return meaning


def _integers(name: str, values: npt.ArrayLike) -> Integers:
    array = np.asarray(values)
    if array.size and array.dtype.kind not in "iu":
        raise ArgumentError(f"{name} must be whole numbers, but their dtype is {array.dtype}")
    return array.astype(np.int64)


def _parity(words: Integers) -> Integers:
    return np.bitwise_count(words) & 1


def _frame_errors(words: Integers, length: int) -> Codes:
    """Return the codes of the frame's own rules; the last written is the first checked."""
    error = np.zeros(words.shape, dtype=np.uint8)
    error[_parity(words >> 1) == 1] = ParityError.code
    error[words & 1 == 0] = EndBitError.code
    error[words >> (length - 1) == 1] = StartBitError.code
    error[(words < 0) | (words >> length > 0)] = LengthError.code
    return error


def encode_requests(
    call: npt.ArrayLike,
    address: npt.ArrayLike,
    data: npt.ArrayLike = 0,
    half: npt.ArrayLike = NONE,
) -> tuple[npt.NDArray[np.uint16], Codes]:
    """Encode many requests at once."""
    call, address, data, half = np.broadcast_arrays(
        _integers("call", call),
        _integers("address", address),
        _integers("data", data),
        _integers("half", half),
    )
    known = (call >= 0) & (call < len(Call)) & (half >= NONE) & (half <= 1)
    safe = np.where(known, call, 0)
    extended = np.where(known & (half != NONE), 1, 0)
    layouts = _layouts()
    free = layouts.free_address[extended, safe]
    fixed = layouts.fixed[extended, safe]
    select_mask = layouts.select_mask[extended, safe]

    own_address = np.where(free, address, fixed >> 5 & 31)
    legal = known & (address == own_address) & (address >= 0) & (address <= 31)
    legal &= ~free | (address >= layouts.lowest_address[safe])
    legal &= (data >= layouts.lowest_data[safe]) & (data <= layouts.data_mask[extended, safe])
    legal &= (half == NONE) | (select_mask > 0)

    select = (half == 1) ^ layouts.inverted[extended, safe]
    information = fixed | np.where(free, address << 5, 0) | data | np.where(select, select_mask, 0)
    words = information << 2 | _parity(information) << 1 | 1
    error = np.where(legal, 0, ArgumentError.code).astype(np.uint8)
    return np.where(legal, words, 0).astype(np.uint16), error


def parse_requests(words: npt.ArrayLike, *, extended: npt.ArrayLike = False) -> Requests:
    """Parse many requests at once."""
    words = _integers("words", words)
    mode = np.asarray(extended)
    if mode.dtype.kind != "b":
        raise ArgumentError(f"extended must be True or False, but its dtype is {mode.dtype}")
    try:
        mode = np.broadcast_to(mode, words.shape)
    except ValueError:
        raise ArgumentError(
            f"extended has the shape {mode.shape}; it must fit the words' shape {words.shape}"
        ) from None
    error = _frame_errors(words, REQUEST_BITS)
    information = np.where(error == 0, words >> 2, 0) & 0x7FF
    meaning = _dictionary()[mode.astype(np.intp), information]
    error[(error == 0) & (meaning[..., 0] == NONE)] = UnknownCallError.code
    meaning[error > 0] = NONE
    return Requests(error, *np.moveaxis(meaning, -1, 0))


def encode_responses(data: npt.ArrayLike) -> tuple[npt.NDArray[np.uint8], Codes]:
    """Encode many responses at once."""
    data = _integers("data", data)
    legal = (data >= 0) & (data <= 15)
    words = data << 2 | _parity(data) << 1 | 1
    error = np.where(legal, 0, ArgumentError.code).astype(np.uint8)
    return np.where(legal, words, 0).astype(np.uint8), error


def parse_responses(words: npt.ArrayLike) -> tuple[npt.NDArray[np.int8], Codes]:
    """Parse many responses at once."""
    words = _integers("words", words)
    error = _frame_errors(words, RESPONSE_BITS)
    data = np.where(error == 0, words >> 2 & 15, NONE).astype(np.int8)
    return data, error


def bits_of(words: npt.ArrayLike, length: int) -> npt.NDArray[np.uint8]:
    """Spread words into their bits, the first on the line first."""
    words = _integers("words", words)
    check_whole("length", length, 1, 62)
    if np.any((words < 0) | (words >> length > 0)):
        raise ArgumentError(f"words must be 0..{2**length - 1}, to fit {length} bits")
    return (words[..., np.newaxis] >> np.arange(length - 1, -1, -1) & 1).astype(np.uint8)


def words_of(bits: npt.ArrayLike) -> npt.NDArray[np.int64]:
    """Gather bits into words; the inverse of `bits_of`."""
    bits = np.atleast_1d(_integers("bits", bits))
    check_whole("number of bits", bits.shape[-1], 1, 62)
    if np.any((bits < 0) | (bits > 1)):
        raise ArgumentError(f"bits must be 0 or 1, but range from {bits.min()} to {bits.max()}")
    return np.asarray(bits @ (1 << np.arange(bits.shape[-1] - 1, -1, -1)))
