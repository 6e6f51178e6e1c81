"""Thousands of sets of release offsets at once, one frame a step in every set."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import pandas as pd

from shipnet.can.bus.messages import bit_time_ns, read_messages
from shipnet.errors import ArgumentError

__all__ = ["BatchRun", "simulate_batch"]

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

#: What no time of a run reaches [ns].
_NEVER = np.iinfo(np.int64).max // 2


class BatchRun(NamedTuple):
    """Responses by set of offsets and message, messages in the order of the table given.

    Attributes
    ----------
    max_response, mean_response : ndarray of float, shape (n_sets, n_messages)
        Largest and mean response [s]; NaN where nothing was sent.
    sent : ndarray of int64, shape (n_sets, n_messages)
        Frames sent.
    """

    max_response: Floats
    mean_response: Floats
    sent: Integers


def simulate_batch(
    messages: pd.DataFrame | Mapping[str, npt.ArrayLike],
    offsets: npt.ArrayLike,
    duration: float,
    bit_rate: float,
) -> BatchRun:
    """Simulate the same messages with many sets of offsets, without jitter and errors.

    Parameters
    ----------
    messages : pandas.DataFrame or mapping of str to array_like
        As for `shipnet.can.bus.simulate`; offsets in it are ignored, jitter must be 0.
    offsets : array_like of float, shape (n_sets, n_messages)
        First release of each message in the order of the table, 0 or more [s].
    duration : float
        Time to simulate, 1e-9 to 1e6 [s].
    bit_rate : float
        Bit rate, 5e3 to 1e6 [bit/s].

    Returns
    -------
    BatchRun
        Largest and mean responses, and how many frames were sent: exactly those that
        `shipnet.can.bus.simulate` finds, one set after the other, with ``queue="fifo"``.

    Raises
    ------
    ArgumentError
        If an argument is out of range, or a message has jitter.

    Examples
    --------
    Two messages of 1 ms: if the lower one begins first, the higher one has to wait for it.

    >>> table = {"arbitration_id": [1, 2], "bits": 125, "period_ms": 10}
    >>> run = simulate_batch(table, [[0, 0], [0.5e-3, 0]], 0.1, 125e3)
    >>> run.max_response.tolist(), run.sent.tolist()
    ([[0.001, 0.002], [0.0015, 0.001]], [[10, 10], [10, 10]])
    """
    columns = read_messages(messages)
    if columns.jitter.any():
        raise ArgumentError("messages have jitter; a batch takes none")
    bit = bit_time_ns(bit_rate)
    if not isinstance(duration, int | float | np.number) or not 1e-9 <= duration <= 1e6:
        raise ArgumentError(f"duration is {duration!r} s; it must be 1e-9..1e6")
    number = len(columns.name)
    begin = np.asarray(offsets)
    if begin.dtype.kind not in "iuf" or begin.ndim != 2 or begin.shape[1] != number:
        raise ArgumentError(
            f"offsets have the shape {begin.shape} and dtype {begin.dtype}; they must be numbers, "
            f"a row a set, a column for each of the {number} messages"
        )
    if not np.all((begin >= 0) & (begin <= 1e5)):
        raise ArgumentError("offsets hold a time that is not 0..1e5 s")
    first = np.rint(begin.T[columns.order] * 1e9).astype(np.int64)
    largest, total, sent = _run(
        first, columns.period, columns.bits * bit, round(float(duration) * 1e9)
    )
    none = sent == 0
    back = np.argsort(columns.order)
    return BatchRun(
        np.where(none, np.nan, largest / 1e9)[back].T,
        np.where(none, np.nan, total / 1e9 / np.maximum(sent, 1))[back].T,
        sent[back].T,
    )


def _run(
    first: Integers, period: Integers, length: Integers, horizon: int
) -> tuple[Integers, Integers, Integers]:
    """Return largest response, sum of responses and frames sent, by message and set."""
    number, sets = first.shape
    largest, total, sent = (np.zeros(first.shape, dtype=np.int64) for _ in range(3))
    # Release of the oldest frame of each message that was not sent yet: a queue needs no more.
    head = np.ascontiguousarray(np.where(first < horizon, first, _NEVER))
    which = np.arange(sets)
    now = head.min(axis=0, initial=_NEVER)
    while True:
        active = now < horizon
        if not active.all():
            head, which, now = head.compress(active, axis=1), which[active], now[active]
            if not which.size:
                return largest, total, sent
        # The last one written is the most important one that waits.
        picked = np.zeros(which.size, dtype=np.intp)
        for rank in range(number - 1, -1, -1):
            np.copyto(picked, rank, where=head[rank] <= now)
        place = picked * which.size + np.arange(which.size)
        released = head.take(place)
        now = now + length[picked]
        response = now - released
        at = (picked, which)
        largest[at] = np.maximum(largest[at], response)
        total[at] += response
        sent[at] += 1
        following = released + period[picked]
        head.put(place, np.where(following < horizon, following, _NEVER))
        now = np.maximum(now, head.min(axis=0))
