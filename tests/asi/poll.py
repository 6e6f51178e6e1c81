"""Many runs of a polled line at once: statistics of cycles, repetitions and dropped slaves.

The model is that of `shipnet.asi.simulation`, for slaves that are all active at the start and
whose telegrams are disturbed: data exchange, one status request, one request to a vacant address.
Given the same disturbances, both give the same cycles. Here all runs go through a cycle together,
and only what is disturbed is looked at one by one.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from shipnet.asi.channel import MISSED, PLANES, REQUEST_LOST
from shipnet.asi.slave import slave_key
from shipnet.asi.telegram import REQUEST_BITS, RESPONSE_BITS
from shipnet.asi.timing import Transaction
from shipnet.errors import ArgumentError
from shipnet.fields import check_whole

__all__ = ["PollStatistics", "poll"]

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]
Bools = npt.NDArray[np.bool_]
Bytes = npt.NDArray[np.uint8]


@dataclass(frozen=True)
class PollStatistics:
    """What came of many runs.

    Parameters
    ----------
    slaves : tuple of str
        Labels of the slaves, in the order of the columns below.
    cycle_time : ndarray of float, shape (n_runs, n_cycles)
        Length of each cycle [s].
    requests, repetitions : ndarray of int, shape (n_runs,)
        Requests in all cycles, and how many of them were repetitions.
    dropped_in : ndarray of int, shape (n_runs, n_slaves)
        Cycle in which the slave was dropped, or -1.
    failure_classes : ndarray of int, shape (n_runs, n_slaves, n_classes)
        How often n data exchanges failed in a row, n from 1.
    mean_response, longest_response : ndarray of float, shape (n_runs, n_slaves)
        Time from a change of an input to the end of the response that reports it [s], for a
        change at a random time between the first exchange that succeeds and the last; NaN if
        fewer than two did.
    """

    slaves: tuple[str, ...]
    cycle_time: Floats
    requests: Integers
    repetitions: Integers
    dropped_in: Integers
    failure_classes: Integers
    mean_response: Floats
    longest_response: Floats


def poll(
    slaves: Sequence[str],
    disturbances: Bytes,
    *,
    transaction: Transaction | None = None,
    delays: Mapping[str, float] | None = None,
    drop_after: int = 3,
    status_poll: bool = True,
) -> PollStatistics:
    """Run the cycles of a line many times at once.

    Parameters
    ----------
    slaves : sequence of str
        Labels of the slaves, one or more; all different, no standard slave beside an A or a B
        slave.
    disturbances : ndarray of uint8, shape (n_runs, n_cycles, 3, n_slaves, 1 + repetitions)
        As `draw_disturbances` returns them.
    transaction : Transaction, optional
        The pauses.
    delays : mapping of str to float, optional
        Delay of the repeaters on the way to each slave, one way [s]. All answers must come
        before the time-out.
    drop_after : int, default 3
        After so many failed data exchanges in a row, one a cycle, a slave is dropped, for good.
    status_poll : bool, default True
        Whether one slave a cycle is asked for its status.

    Returns
    -------
    PollStatistics
        One row a run.

    Raises
    ------
    ArgumentError
        If the labels clash, a shape does not fit, or a value is out of its range.

    Notes
    -----
    The counterpart is `simulate` with ``Master(readmit=False)``, whose inclusion phase does not
    ask at the addresses of dropped slaves.
    """
    transaction = transaction or Transaction()
    check_whole("drop_after", drop_after, 1, 1000)
    given = [slave_key(label) for label in slaves]
    _check_labels(slaves, given)
    if disturbances.ndim != 5 or disturbances.shape[2:4] != (PLANES, len(given)):
        raise ArgumentError(
            f"disturbances have the shape {disturbances.shape}; it must be (n_runs, n_cycles, "
            f"{PLANES}, {len(given)}, attempts)"
        )
    unknown = set(delays or {}) - set(slaves)
    if unknown:
        raise ArgumentError(f"delays name {', '.join(sorted(unknown))}, which are not polled")
    keys = np.array([key for key, _ in given], dtype=np.int64)
    order = np.argsort(keys)
    one_way = np.array([(delays or {}).get(label, 0.0) for label in slaves], dtype=float)
    pause = transaction.master_pause + 2 * one_way / transaction.bit_time
    if (one_way < 0).any() or (pause + transaction.unsynchronised > transaction.timeout).any():
        raise ArgumentError(
            f"delays are {delays}; with them every answer must begin "
            f"within {transaction.timeout:g} bit times"
        )
    runs = _Runs(keys[order], pause[order], disturbances, transaction, drop_after)
    columns = _rows(order)
    for cycle in range(disturbances.shape[1]):
        runs.exchange(cycle, disturbances[:, cycle, 0, columns])
        if status_poll:
            runs.ask_status(disturbances[:, cycle, 1, columns])
        runs.finish(cycle)
    return runs.statistics(tuple(slaves), np.argsort(order))


def _check_labels(slaves: Sequence[str], given: Sequence[tuple[int, str | None]]) -> None:
    standard = {key for key, half in given if half is None}
    halves = {key & ~1 for key, half in given if half is not None}
    if not slaves or len(set(slaves)) != len(slaves) or standard & halves or 0 in standard:
        raise ArgumentError(
            f"slaves are {list(slaves)}; there must be one or more, with addresses of their own or "
            "an A and a B slave at one"
        )


class _Runs:
    """The state of all runs: slaves by rising key along the first axis, runs along the second."""

    def __init__(
        self, keys: Integers, pause: Floats, drawn: Bytes, transaction: Transaction, drop_after: int
    ) -> None:
        n_runs, n_cycles, _, n, self.attempts = drawn.shape
        self.keys, self.pause, self.transaction, self.drop_after = (
            keys,
            pause,
            transaction,
            drop_after,
        )
        self.answered = REQUEST_BITS + pause + RESPONSE_BITS + transaction.slave_pause
        self.time, self.begin = np.zeros(n_runs), np.zeros(n_runs)
        self.requests = np.zeros(n_runs, dtype=np.int64)
        self.repetitions = np.zeros(n_runs, dtype=np.int64)
        self.cycle_time = np.zeros((n_runs, n_cycles))
        shape = (n, n_runs)
        self.active = np.ones(shape, dtype=bool)
        self.dropped = False
        self.failing, self.streak = np.zeros(shape, np.int16), np.zeros(shape, np.int64)
        self.dropped_in = np.full(shape, -1, dtype=np.int64)
        self.classes = np.zeros((*shape, self.attempts * drop_after), dtype=np.int64)
        # When inputs were taken first and last, and what came of the times between.
        self.first, self.last = np.full(shape, np.nan), np.full(shape, np.nan)
        self.fresh_start = True
        self.area, self.longest = np.zeros(shape), np.zeros(shape)
        self.turn = np.full(n_runs, -1, dtype=np.int64)
        self.partner = np.full(n, -1, dtype=np.int64)
        pairs = np.flatnonzero(np.diff(keys >> 1) == 0)
        self.partner[pairs], self.partner[pairs + 1] = pairs + 1, pairs

    def exchange(self, cycle: int, drawn: Bytes) -> None:
        """Exchange data with all active slaves; of two halves, with the one whose turn it is."""
        turn = (self.partner < 0) | (self.keys & 1 == cycle & 1)
        if self.dropped:
            alone = (self.partner < 0)[:, np.newaxis] | ~self.active[self.partner]
            polled = self.active & (alone | turn[:, np.newaxis])
            some = polled
            rows: slice | Integers = slice(None)
            self.requests += polled.sum(axis=0)
            length = np.where(polled, self.answered[:, np.newaxis], 0.0)
            self.polled_last = len(self.keys) - 1 - polled[::-1].argmax(axis=0)
        else:
            rows = _rows(np.flatnonzero(turn))
            some = np.broadcast_to(turn[:, np.newaxis], self.active.shape)
            self.requests += np.count_nonzero(turn)
            length = np.repeat(self.answered[rows, np.newaxis], self.time.size, axis=1)
            self.polled_last = np.full(self.time.size, np.flatnonzero(turn)[-1:].sum())

        run, slave = np.nonzero(drawn[..., 0] != 0)
        keep = some[slave, run]
        run, slave = run[keep], slave[keep]
        tried = self._try(drawn[run, slave], slave, np.ones(run.size, dtype=bool))
        self._count(run, tried)
        place = slave if self.dropped else (np.cumsum(turn) - 1)[slave]
        length[place, run] = tried.length
        self.out_of_step = np.zeros(self.time.size, dtype=bool)
        self.out_of_step[run] = (slave == self.polled_last[run]) & ~tried.in_step

        self._age(rows, length, some[rows], place, run, tried)
        self.time += length.sum(axis=0)
        self._fail(cycle, some, slave, run, tried)

    def _fail(
        self, cycle: int, polled: Bools, slave: Integers, run: Integers, tried: _Tried
    ) -> None:
        """Count failures in a row, and drop slaves."""
        fails = ~tried.done
        lost = np.zeros(polled.shape, dtype=bool)
        lost[slave, run] = fails
        self.streak[slave, run] += tried.failures
        # Only a slave with a streak has cycles that failed.
        ends = (self.streak != 0) & polled & ~lost
        self._close(ends)
        self.failing[ends] = 0
        slave, run = slave[fails], run[fails]
        self.failing[slave, run] += 1
        leaves = self.failing[slave, run] >= self.drop_after
        if leaves.any():
            self.dropped = True
            slave, run = slave[leaves], run[leaves]
            self.active[slave, run] = False
            self.dropped_in[slave, run] = cycle
            self.failing[slave, run] = 0

    def ask_status(self, drawn: Bytes) -> None:
        """Ask the next active slave of each run for its status."""
        if self.dropped:
            run = np.flatnonzero(self.active.any(axis=0))
            active = self.active[:, run]
            behind = active & (self.keys[:, np.newaxis] > self.turn[run])
            slave = np.where(behind.any(axis=0), behind.argmax(axis=0), active.argmax(axis=0))
        else:
            run = np.arange(self.time.size)
            following = np.searchsorted(self.keys, self.turn, side="right")
            slave = following % len(self.keys)
        self.turn[run] = self.keys[slave]
        what = drawn[run, slave]
        # The slave that was polled last heard no request in between, and is as it was.
        at_once = slave == self.polled_last[run]
        what[at_once, 0] &= ~np.uint8(MISSED)
        in_step = ~(at_once & self.out_of_step[run])
        self.requests[run] += 1
        rough = (what[:, 0] > 0) | ~in_step
        self.time[run[~rough]] += self.answered[slave[~rough]]
        run = run[rough]
        tried = self._try(what[rough], slave[rough], in_step[rough])
        self._count(run, tried)
        self.time[run] += tried.length

    def finish(self, cycle: int) -> None:
        """Ask at a vacant address, and end the cycle."""
        self.time += self.transaction.unanswered
        self.requests += 1
        self.cycle_time[:, cycle] = (self.time - self.begin) * self.transaction.bit_time
        self.begin = self.time.copy()

    def _try(self, what: Bytes, slave: Integers, in_step: Bools) -> _Tried:
        """Send requests until they succeed or all attempts are used up."""
        n = slave.size
        length, waits, pause = np.zeros(n), np.zeros(n), np.zeros(n)
        pending = np.ones(n, dtype=bool)
        failures = np.zeros(n, dtype=np.int64)
        in_step = in_step & (what[:, 0] & MISSED == 0)
        for attempt in range(self.attempts):
            lost = what[:, attempt] & REQUEST_LOST > 0
            garbled = what[:, attempt] >> 2 > 0
            late = np.where(in_step, 0.0, self.transaction.unsynchronised)
            waits[pending], pause[pending] = length[pending], (self.pause[slave] + late)[pending]
            took = np.where(lost, self.transaction.unanswered, self.answered[slave] + late)
            length += np.where(pending, took, 0.0)
            in_step = np.where(pending, ~lost, in_step)
            pending = pending & (lost | garbled)
            failures += pending
        return _Tried(length, waits, pause, ~pending, failures, in_step)

    def _count(self, run: Integers, tried: _Tried) -> None:
        again = np.minimum(tried.failures, self.attempts - 1)
        more = np.bincount(run, weights=again, minlength=self.requests.size).astype(np.int64)
        self.repetitions += more
        self.requests += more

    def _close(self, ends: Bools) -> None:
        """Note streaks of failures that end."""
        slave, run = np.nonzero(ends)
        length = np.minimum(self.streak[slave, run], self.classes.shape[2])
        self.classes[slave, run, length.astype(np.int64) - 1] += 1
        self.streak[slave, run] = 0

    def _age(
        self,
        rows: slice | Integers,
        length: Floats,
        polled: Bools,
        place: Integers,
        run: Integers,
        tried: _Tried,
    ) -> None:
        """Note how old inputs are when they arrive; `length` and `polled` have these rows only."""
        sampled = np.cumsum(length, axis=0)
        sampled += self.time + REQUEST_BITS
        sampled -= length
        sampled[place, run] += tried.waits
        fresh = np.repeat(self.pause[rows, np.newaxis] + RESPONSE_BITS, self.time.size, axis=1)
        fresh[place, run] = tried.pause + RESPONSE_BITS
        failed = (place[~tried.done], run[~tried.done])
        if self.dropped:
            known = polled.copy()
            known[failed] = False
            place, run = np.nonzero(~known)
            failed = (place, run)
        last = self.last[rows]
        gap = sampled - last
        sampled[failed] = last[failed]
        gap[failed] = fresh[failed] = 0.0
        if self.fresh_start:
            new = np.isnan(last)
            self.first[rows] = np.where(new, sampled, self.first[rows])
            gap[new] = 0.0
            self.fresh_start = bool(np.isnan(self.first).any())
        self.last[rows] = sampled
        fresh += gap
        self.longest[rows] = np.maximum(self.longest[rows], fresh)
        fresh -= gap / 2
        self.area[rows] += gap * fresh

    def statistics(self, slaves: tuple[str, ...], back: Integers) -> PollStatistics:
        """Return the results with the slaves in the order given."""
        self._close(self.streak > 0)
        bit = self.transaction.bit_time
        waited = self.last - self.first
        known = waited > 0
        mean = np.divide(self.area, waited, out=np.full(known.shape, np.nan), where=known)
        longest = np.where(known, self.longest, np.nan)
        return PollStatistics(
            slaves,
            self.cycle_time,
            self.requests,
            self.repetitions,
            self.dropped_in[back].T,
            np.swapaxes(self.classes[back], 0, 1),
            mean[back].T * bit,
            longest[back].T * bit,
        )


def _rows(index: Integers) -> slice | Integers:
    """Return an index as a slice if it is evenly spaced: numpy then copies nothing."""
    steps = np.diff(index)
    if index.size > 1 and steps[0] > 0 and (steps == steps[0]).all():
        return slice(int(index[0]), int(index[-1]) + 1, int(steps[0]))
    return index


@dataclass(frozen=True)
class _Tried:
    """What came of requests and their repetitions."""

    length: Floats
    waits: Floats
    pause: Floats
    done: Bools
    failures: Integers
    in_step: Bools
