"""From telegrams on the line to transactions: who answered whom, and what they said."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from functools import cache
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from shipnet.asi.batch import NONE, parse_requests, parse_responses, words_of
from shipnet.asi.calls import Call
from shipnet.asi.frame import REQUEST_BITS, RESPONSE_BITS
from shipnet.asi.receiver import Reception
from shipnet.asi.response import Response
from shipnet.asi.telegram import Request
from shipnet.asi.timing import BIT_TIME, MASTER_PAUSE_BITS
from shipnet.errors import ArgumentError, explain

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["CUT_OFF", "NO_ANSWER", "Telegrams", "transactions_of"]

#: What stands in the columns of errors beside "ok" and the names of the classes.
CUT_OFF, NO_ANSWER = "cut off", "no answer"

#: Longest pause behind a request in which its response begins [bit], with room for its pulses'
#: delay, and the longest one behind a response: a master may stretch it to 500 us.
_MASTER_PAUSE = MASTER_PAUSE_BITS[1] + 0.5
_SLAVE_PAUSE = 500e-6 / BIT_TIME

Bools = npt.NDArray[np.bool_]
Floats = npt.NDArray[np.float64]
Indices = npt.NDArray[np.intp]
Integers = npt.NDArray[np.int64]
Strings = npt.NDArray[np.object_]


class Telegrams(NamedTuple):
    """The telegrams of a record, one array a field, all of the shape (n,).

    Attributes
    ----------
    start : ndarray of float
        Start of the first bit [s].
    first, last : ndarray of float
        Peaks of the first and of the last pulse [s].
    length : ndarray of int
        Bits.
    word, known : ndarray of int
        The bits, and a 1 for each one that a pulse told.
    error : ndarray of int
        0, or a code of `shipnet.errors`.
    amplitude : ndarray of float
        Size of the first pulse [V].
    weakest, ringing : ndarray of float
        As in `shipnet.asi.receiver.Reception`.
    fits : ndarray of bool
        Whether it is as long as a telegram.
    edge : ndarray of int
        1 if recording begins so shortly before it that it may be the rest of a longer one, 2 if
        recording ends so shortly behind it, else 0.
    """

    start: Floats
    first: Floats
    last: Floats
    length: Integers
    word: Integers
    known: Integers
    error: Integers
    amplitude: Floats
    weakest: Floats
    ringing: Floats
    fits: Bools
    edge: Integers

    @classmethod
    def of(
        cls,
        received: Reception,
        begin: Floats,
        *,
        first: Floats,
        last: Floats,
        unit: Floats,
        fits: Bools,
        edge: Integers,
    ) -> Telegrams:
        """Take what was received from rows that begin at times, each measured in its own unit."""
        bits = received.bits.astype(np.int64)
        return cls(
            begin + received.start,
            first,
            last,
            np.full(len(bits), bits.shape[-1]),
            words_of(np.maximum(bits, 0)),
            words_of((bits != NONE).astype(np.int64)),
            received.error.astype(np.int64),
            received.amplitude * unit,
            received.weakest,
            received.ringing,
            fits,
            edge,
        )

    @classmethod
    def none(cls) -> Telegrams:
        """Return no telegram."""
        kinds = [float] * 3 + [np.int64] * 4 + [float] * 3 + [bool, np.int64]
        return cls._make(np.zeros(0, kind) for kind in kinds)

    @classmethod
    def joined(cls, parts: Sequence[Telegrams]) -> Telegrams:
        """Put batches together, in the order of time."""
        whole = [np.concatenate(field) for field in zip(*parts, strict=True)]
        order = np.argsort(whole[1], kind="stable")
        return cls._make(field[order] for field in whole)


def transactions_of(
    telegrams: Telegrams, ends: Floats, extended: Collection[int] = ()
) -> pd.DataFrame:
    """Pair requests with responses, and say what they mean.

    Parameters
    ----------
    telegrams : Telegrams
        In the order of time.
    ends : ndarray of float
        When recording ends, or is interrupted [s].
    extended : collection of int, optional
        Addresses that hold A/B slaves.

    Returns
    -------
    pandas.DataFrame
        The columns are described at `shipnet.asi.capture.Capture`.

    Examples
    --------
    >>> len(transactions_of(Telegrams.none(), np.array([1.0])))
    0
    """
    import pandas as pd

    cut, asks, answers = _roles(telegrams)
    request, response = _pairs(asks, answers)
    states = np.array([explain(code) for code in telegrams.error.tolist()], dtype=object)
    states[cut] = CUT_OFF
    request_error, response_error = _pick(states, request, ""), _pick(states, response, "")

    words = np.where(request_error == "ok", _pick(telegrams.word, request, 0), -1)
    calls = parse_requests(words, extended=np.isin(words >> 7 & 31, list(extended)))
    readable = request_error == "ok"
    request_error[readable] = [explain(code) for code in calls.error[readable].tolist()]
    replies = np.where(response_error == "ok", _pick(telegrams.word, response, 0), -1)
    data, _ = parse_responses(replies)

    # A request at the end of the record has no answer yet.
    start = _pick(telegrams.start, request, np.nan)
    rest = np.append(ends, np.inf)[np.searchsorted(ends, start)] - start
    room = (REQUEST_BITS + MASTER_PAUSE_BITS[1] + RESPONSE_BITS) * BIT_TIME
    asks = np.array([call.rule.answer is not None for call in Call] + [False])[calls.call]
    alone = (response < 0) & (request_error == "ok") & asks
    response_error[alone] = np.where(rest[alone] < room, CUT_OFF, NO_ANSWER)

    told = _told(telegrams)
    requests, responses = _pick(told, request, ""), _pick(told, response, "")
    speaker = np.where(response >= 0, response, request)
    master_pause, slave_pause = _pauses(telegrams, request, response, cut)
    return pd.DataFrame(
        {
            "start_s": np.where(request >= 0, start, _pick(telegrams.start, response, np.nan)),
            "request": requests,
            "call": np.array([_title(call) for call in calls.call.tolist()], dtype=object),
            "address": _nullable(calls.address),
            "half": np.array(["A", "B", ""], dtype=object)[calls.half],
            "request_data": _nullable(calls.data),
            "response": responses,
            "response_data": _nullable(data),
            "master_pause_bit": master_pause,
            "slave_pause_bit": slave_pause,
            "request_amplitude_V": _pick(telegrams.amplitude, request, np.nan),
            "response_amplitude_V": _pick(telegrams.amplitude, response, np.nan),
            "weakest_pulse": _pick(telegrams.weakest, speaker, np.nan),
            "ringing": _pick(telegrams.ringing, speaker, np.nan),
            "request_error": request_error,
            "response_error": response_error,
            "text": np.array(
                [
                    _in_words(*row)
                    for row in zip(
                        requests.tolist(),
                        request_error.tolist(),
                        (calls.half >= 0).tolist(),
                        responses.tolist(),
                        response_error.tolist(),
                        calls.call.tolist(),
                        strict=True,
                    )
                ],
                dtype=object,
            ),
        }
    )


def _pick(field: npt.NDArray[Any], index: Indices, missing: object) -> npt.NDArray[Any]:
    """Return elements of a field, and `missing` where the index is -1."""
    end = np.empty(1, dtype=field.dtype)
    end[0] = missing
    return np.concatenate([field, end])[index]


def _roles(telegrams: Telegrams) -> tuple[Bools, Bools, Bools]:
    """Return which telegrams are cut off, which are requests, and which answer one."""
    # From the last pulse to the next first one it takes a bit time more than the pause.
    pause = np.diff(telegrams.first, prepend=np.nan)
    pause[1:] = (telegrams.first[1:] - telegrams.last[:-1]) / BIT_TIME - 1
    broken = (telegrams.error > 0) | ~telegrams.fits
    short = telegrams.length == RESPONSE_BITS
    # The last half of a request, and the first one, may look like a response.
    front = (telegrams.edge == 1) & (broken | short)
    asks = ~short | front
    in_time = np.append(False, asks[:-1]) & (pause <= _MASTER_PAUSE)
    back = (telegrams.edge == 2) & ~front & (broken | (short & ~in_time))
    asks = np.where(back, ~in_time, asks)
    return front | back, asks, ~asks & np.append(False, asks[:-1]) & (pause <= _MASTER_PAUSE)


def _pairs(asks: Bools, answers: Bools) -> tuple[Indices, Indices]:
    """Return, for each transaction, which telegram is its request and its response, or -1."""
    row = np.cumsum(~answers) - 1
    rows = int((~answers).sum())
    request, response = np.full(rows, -1), np.full(rows, -1)
    request[row[asks]] = np.flatnonzero(asks)
    response[row[~asks]] = np.flatnonzero(~asks)
    return request, response


def _pauses(
    telegrams: Telegrams, request: Indices, response: Indices, cut: Bools
) -> tuple[Floats, Floats]:
    """Return the pauses behind requests and behind responses [bit], NaN where there is none."""
    # What is cut off has lost its start, so it cannot be measured from there.
    begins = np.where(cut & (telegrams.edge == 1), np.nan, telegrams.start)
    asked, answered = _pick(begins, request, np.nan), _pick(begins, response, np.nan)
    master = (answered - asked) / BIT_TIME - REQUEST_BITS
    slave = np.full(len(request), np.nan)
    slave[:-1] = (asked[1:] - answered[:-1]) / BIT_TIME - RESPONSE_BITS
    slave[~(slave <= _SLAVE_PAUSE)] = np.nan
    return master, slave


def _told(telegrams: Telegrams) -> Strings:
    """Return the telegrams as strings of 0 and 1, with ? where no pulse told a bit."""

    @cache
    def text(word: int, known: int, length: int) -> str:
        bits, told = f"{word:0{length}b}", f"{known:0{length}b}"
        return "".join(bit if one == "1" else "?" for bit, one in zip(bits, told, strict=True))

    columns = (telegrams.word.tolist(), telegrams.known.tolist(), telegrams.length.tolist())
    return np.array([text(*row) for row in zip(*columns, strict=True)], dtype=object)


def _nullable(values: npt.NDArray[np.int8]) -> pd.api.extensions.ExtensionArray:
    import pandas as pd

    return pd.arrays.IntegerArray(values.astype(np.int64), values == NONE)


def _title(call: int) -> str:
    return "" if call == NONE else Call(call).rule.title


@cache
def _in_words(
    request: str, request_error: str, extended: bool, response: str, response_error: str, call: int
) -> str:
    """Say in one line what was asked and what was answered, or what went wrong."""
    parts = []
    if request_error == "ok":
        parts.append(str(Request.parse(request, extended=extended)))
    elif request_error:
        parts.append(f"request {request_error}: {request}")
    if response_error == "ok":
        try:
            parts.append(str(Response.parse(response, None if call == NONE else Call(call))))
        except ArgumentError:
            parts.append(f"response {response} where none is expected")
    elif response_error == NO_ANSWER:
        parts.append(NO_ANSWER)
    elif response_error:
        parts.append(f"response {response_error}" + (f": {response}" if response else ""))
    return "; ".join(parts)
