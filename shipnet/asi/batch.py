"""Parse arrays of telegrams; the most significant bit of each word is the first bit sent.

A bad telegram does not raise an exception; the result has an error code for each telegram.
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from shipnet.arrays import Integers
from shipnet.asi.telegram import REQUEST_BITS, RESPONSE_BITS, Call, all_requests
from shipnet.errors import (
    ArgumentError,
    EndBitError,
    LengthError,
    ParityError,
    StartBitError,
    UnknownCallError,
    name_of,
)
from shipnet.lazy import pd

#: Value of an absent field, such as the half of a standard slave or the data of a bad telegram.
NONE = -1

Codes = npt.NDArray[np.uint8]


class Requests(NamedTuple):
    """A batch of requests, one array per field, all of the same shape.

    Attributes
    ----------
    error : ndarray of uint8
        0 if correct; otherwise an error code of `shipnet.errors`, and the other fields are -1.
    call : ndarray of int8
        Value of `Call`.
    address : ndarray of int8
        Address of the slave, 0..31.
    data : ndarray of int8
        Data as in `Request.data`.
    half : ndarray of int8
        0 for an A slave, 1 for a B slave, -1 for a standard slave.

    Examples
    --------
    >>> batch = Requests.parse([0b00101010111001, 0b00101010111011])
    >>> batch.table()[["error", "address", "data"]].values.tolist()
    [['ok', 21, 14], ['ParityError', -1, -1]]
    """

    error: Codes
    call: npt.NDArray[np.int8]
    address: npt.NDArray[np.int8]
    data: npt.NDArray[np.int8]
    half: npt.NDArray[np.int8]

    @classmethod
    def parse(cls, words: npt.ArrayLike, *, extended: npt.ArrayLike = False) -> Requests:
        """Parse 14-bit words; a bad word gets an `error` code instead of raising an exception.

        `extended` is True for slaves with extended addressing: one value, or one value per word.
        """
        words, mode = _integers(words), np.asarray(extended)
        if mode.dtype.kind != "b" or mode.shape not in ((), words.shape):
            raise ArgumentError(
                f"extended has shape {mode.shape} and dtype {mode.dtype}; it must be one bool, or "
                "one per word"
            )
        error = _frame_errors(words, REQUEST_BITS)
        information = np.where(error == 0, words >> 2, 0) & 0x7FF
        meaning = _meanings()[mode.astype(np.intp), information]
        error[(error == 0) & (meaning[..., 0] == NONE)] = UnknownCallError.code
        meaning[error > 0] = NONE
        return cls(error, *np.moveaxis(meaning, -1, 0))

    def table(self) -> pd.DataFrame:
        """Return a table with one row per request; errors and calls are given by name."""
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


@cache
def _meanings() -> npt.NDArray[np.int8]:
    """Return (call, address, data, half) by addressing mode (1: extended) and information word."""
    meaning = np.full((2, 2**11, 4), NONE, dtype=np.int8)
    halves = {"A": 0, "B": 1, None: NONE}
    for extended in (False, True):
        for bits, one in all_requests(extended).items():
            fields = one.call, one.address, one.data, halves[one.half]
            meaning[int(extended), int(bits[1:-2], 2)] = fields
    return meaning


def _integers(words: npt.ArrayLike) -> Integers:
    array = np.asarray(words)
    if array.size and array.dtype.kind not in "iu":
        raise ArgumentError(f"words must be whole numbers, but their dtype is {array.dtype}")
    return array.astype(np.int64)


def _frame_errors(words: Integers, length: int) -> Codes:
    """Return the error code of each frame; if several checks fail, the last one sets the code."""
    error = np.zeros(words.shape, dtype=np.uint8)
    error[np.bitwise_count(words >> 1) & 1 == 1] = ParityError.code
    error[words & 1 == 0] = EndBitError.code
    error[words >> (length - 1) == 1] = StartBitError.code
    error[(words < 0) | (words >> length > 0)] = LengthError.code
    return error


def parse_responses(words: npt.ArrayLike) -> tuple[npt.NDArray[np.int8], Codes]:
    """Parse an array of responses; return their data (-1 if bad) and their error codes."""
    words = _integers(words)
    error = _frame_errors(words, RESPONSE_BITS)
    data = np.where(error == 0, words >> 2 & 15, NONE).astype(np.int8)
    return data, error
