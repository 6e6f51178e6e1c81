"""What goes over both buses in simulated time: the boxes' CPUs, the AMS's requests, CAN frames.

Times are whole nanoseconds from the start of the AMS. The frames are arbitrated one by one, as a
simulation needs the actual times; the worst ones are bounds of `shipnet.engine.system`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from shipnet.can.frame import INTERMISSION
from shipnet.clock import nanoseconds
from shipnet.engine.faults import (
    BusOff,
    CanBreak,
    DeadBox,
    DeadPort,
    EngineFault,
    LostModbusFrames,
    ModbusBreak,
    outages,
)
from shipnet.engine.system import System

Integers = npt.NDArray[np.int64]

#: Frames that the bus simulator gets at a time.
_CHUNK = 200_000


# What a box computes ---------------------------------------------------------------------------


class Cpu:
    """What the Modbus interrupts of a given length [ns] leave of a CPU's time, in nanoseconds.

    The next interrupt does not begin earlier than the one before ends.
    """

    def __init__(self, begins: npt.ArrayLike, length: int) -> None:
        self.begins = np.asarray(begins, dtype=np.int64)
        self.length = length
        self._left = self.begins - length * np.arange(self.begins.size)

    def until(self, time: Integers) -> Integers:
        """Return how much time the interrupts have left until some times [ns]."""
        begun = np.searchsorted(self.begins, time, side="right")
        if not self.begins.size:
            return np.asarray(time, dtype=np.int64)
        inside = time - self.begins[np.maximum(begun - 1, 0)]
        last = np.where(begun > 0, np.minimum(inside, self.length), 0)
        taken = self.length * np.maximum(begun - 1, 0) + last
        return np.asarray(time - taken, dtype=np.int64)

    def at(self, left: Integers) -> Integers:
        """Return when so much time has been left: the inverse of `until` [ns].

        Work that is done when an interrupt begins is done before it.
        """
        begun = np.searchsorted(self._left, left, side="left")
        return np.asarray(left + self.length * begun, dtype=np.int64)

    def queue(self, due: Integers, work: int) -> Integers:
        """Return when jobs begin that wait for each other, as time left by the interrupts [ns].

        `due` rises, `work` is what each takes of the CPU; `at` makes times of the result.
        """
        number = work * np.arange(due.size, dtype=np.int64)
        return np.asarray(number + np.maximum.accumulate(self.until(due) - number), dtype=np.int64)


# What the AMS asks ----------------------------------------------------------------------------

#: What became of a request.
OUTCOMES = ("answered", "no answer", "response damaged")


class Attempts(NamedTuple):
    """Requests in order of time: poll, channel (0 or 1), first bit [ns], place in `OUTCOMES`."""

    poll: Integers
    channel: Integers
    start: Integers
    outcome: Integers


def ask(
    system: System,
    horizon: int,
    phase: int,
    faults: Sequence[EngineFault],
    rng: np.random.Generator | None,
) -> Attempts:
    """Return the requests of all polls that begin before the `horizon`, the first at `phase` [ns].

    A poll begins at a multiple of the poll period, at the first that finds the one before ended.
    What is broken or dead at any moment between the first bit of the request and the end of the
    response makes the box deaf to the request.
    """
    lines = [_Line(system, channel, faults, horizon, rng) for channel in (0, 1)]
    if system.polled == "one":
        rows = _follow(system, horizon, phase, lines)
    else:
        rows = [row for line in lines for row in _follow(system, horizon, phase, [line])]
        rows.sort(key=lambda row: (row[2], row[1]))
    columns = np.array(rows, dtype=np.int64).reshape(-1, 4).T
    return Attempts(*columns)


class _Line:
    """A channel with what goes wrong on it."""

    def __init__(
        self,
        system: System,
        channel: int,
        faults: Sequence[EngineFault],
        horizon: int,
        rng: np.random.Generator | None,
    ) -> None:
        self.channel = channel
        name, box = str(channel + 1), system.boxes[system.ports[channel]]
        self.deaf = outages(faults, name, ModbusBreak, DeadPort) + outages(faults, box, DeadBox)
        self.losses = [f for f in faults if isinstance(f, LostModbusFrames) and f.where == name]
        self.answered = nanoseconds(system.poll.time)
        self.silent = nanoseconds(system.poll.line.frame_time(8) + system.timeout)
        self.draws: Iterator[list[float]] = iter(())
        if self.losses and rng is not None:
            most = (horizon // nanoseconds(system.poll_period) + 2) * (1 + system.retries)
            self.draws = iter(rng.random((most, 2 * len(self.losses))).tolist())

    def ask(self, start: int) -> tuple[int, int]:
        """Send a request; return its outcome and when the AMS goes on."""
        end = start + self.answered
        deaf = any(begin < end and start < stop for begin, stop in self.deaf)
        damaged = False
        if self.losses:
            chances: list[float] = next(self.draws)
            for fault, request, response in zip(
                self.losses, chances[::2], chances[1::2], strict=True
            ):
                begin, stop = fault.span
                if begin <= start < stop:
                    deaf |= request < fault.request
                    damaged |= response < fault.response
        if deaf:
            return 1, start + self.silent
        return (2 if damaged else 0), end


def _follow(
    system: System, horizon: int, phase: int, lines: list[_Line]
) -> list[tuple[int, int, int, int]]:
    """Return the requests of a port that has one line, or two to choose from."""
    period = nanoseconds(system.poll_period)
    rows = []
    number, now, order = 0, phase, lines
    while now < horizon:
        for line in order:
            for _ in range(1 + system.retries):
                outcome, then = line.ask(now)
                rows.append((number, line.channel, now, outcome))
                now = then
                if outcome == 0:
                    break
            if outcome == 0:
                # Whoever answered is asked first next time; the other one is the spare.
                if system.switch_rule == "stay" and line is not order[0]:
                    order = order[::-1]
                break
        number = max(number + 1, -((phase - now) // period))
        now = phase + number * period
    return rows


# What the boxes send each other ----------------------------------------------------------------

#: A round, or a step of it, that did not happen.
NEVER = -1 << 62


class Rounds(NamedTuple):
    """Rounds of the loop of one box, by number; `NEVER` for steps that did not happen.

    `work` is the CPU time left by the interrupts at which a round begins [ns], for `Cpu.at`;
    `converted` is when its values are in the box's own table, and `queued` when its frames ask for
    the bus [ns].
    """

    work: Integers
    converted: Integers
    queued: Integers


def rounds(
    system: System,
    box: int,
    cpu: Cpu,
    span: tuple[int, int],
    phase: int,
    faults: Sequence[EngineFault],
) -> Rounds:
    """Return the rounds of a box that begin within a span, one of them at `phase` [ns].

    A dead box begins no round and ends none.
    """
    period = int(system.period_ns[box])
    first = span[0] + (phase - span[0]) % period
    due = np.arange(first, span[1] + 1, period, dtype=np.int64)
    work, converted, queued = (np.full(due.size, NEVER) for _ in range(3))
    begin = NEVER
    for death, back in [*outages(faults, system.boxes[box], DeadBox), (-NEVER, -NEVER)]:
        alive = slice(*np.searchsorted(due, (begin, death)))
        if alive.start < alive.stop:
            start = cpu.queue(due[alive], int(system.loop_ns[box]))
            work[alive] = start
            for steps, length in ((converted, system.convert_ns), (queued, system.loop_ns)):
                time = cpu.at(start + length[box])
                steps[alive] = np.where(time <= death, time, NEVER)
        begin = max(begin, back)
    return Rounds(work, converted, queued)


class Frames(NamedTuple):
    """Frames that went over the bus, in no order.

    `start` is the first bit and `arrival` the end without the intermission [ns]; bit k of
    `hearers` is set if box k is on the same part of the bus.
    """

    message: Integers
    round: Integers
    start: Integers
    arrival: Integers
    hearers: Integers


def islands(system: System, faults: Sequence[EngineFault], time: int) -> list[list[int]]:
    """Return the boxes of each part of the bus at a time [ns]; a box off the bus is in none."""

    def out(where: str, *kinds: type[EngineFault]) -> bool:
        return any(a <= time < b for a, b in outages(faults, where, *kinds))

    part = list(range(len(system.boxes)))
    for place, segment in enumerate(system.segments):
        ends = place, (place + 1) % len(part)
        if not out(segment, CanBreak):
            # The cable runs through a box, whether that is alive or not.
            old, new = part[ends[1]], part[ends[0]]
            part = [new if p == old else p for p in part]
    able = [k for k, box in enumerate(system.boxes) if not out(box, DeadBox, BusOff)]
    groups = [[k for k in able if part[k] == p] for p in sorted(set(part))]
    return [group for group in groups if group]


def send(
    system: System, loops: Sequence[Rounds], span: tuple[int, int], faults: Sequence[EngineFault]
) -> Frames:
    """Return all frames that somebody else hears within a span [ns].

    When a cable, a box or a controller fails or returns, all that is queued or on the bus is lost;
    the next round replaces it. Every frame is as long as its worst stuffing makes it.
    """
    message = np.repeat(
        np.arange(system.sender.size), [loops[b].queued.size for b in system.sender]
    )
    number = np.concatenate([np.arange(loops[b].queued.size) for b in system.sender])
    queued = np.concatenate([loops[b].queued for b in system.sender])
    kinds = (CanBreak, DeadBox, BusOff)
    times = {time for fault in faults if type(fault) in kinds for time in fault.span}
    borders = [span[0], *sorted(time for time in times if span[0] < time < span[1]), span[1]]
    parts = []
    for begin, end in pairwise(borders):
        for members in islands(system, faults, begin):
            if len(members) < 2:
                continue
            due = (queued >= begin) & (queued < end) & np.isin(system.sender[message], members)
            rows = np.flatnonzero(due)
            rows = rows[np.lexsort((message[rows], queued[rows]))]
            start = _arbitrate(queued[rows] - begin, message[rows], system.frame_ns, end - begin)
            gap = round(INTERMISSION * 1e9 / system.can_bit_rate)
            arrival = begin + start + system.frame_ns[message[rows]] - gap
            keep = (start >= 0) & (arrival <= end)
            rows, start, arrival = rows[keep], start[keep] + begin, arrival[keep]
            mask = np.full(rows.size, sum(1 << k for k in members), dtype=np.int64)
            parts.append((message[rows], number[rows], start, arrival, mask))
    if not parts:
        return Frames(*(np.zeros(0, dtype=np.int64) for _ in range(5)))
    return Frames(*(np.concatenate(column) for column in zip(*parts, strict=True)))


def _arbitrate(time: Integers, message: Integers, frame: Integers, horizon: int) -> Integers:
    """Return when each frame begins, -1 if never; a busy bus is never cut in two."""
    from shipnet.can.bus import Releases, send_all

    length = frame[message]
    before = np.cumsum(length) - length
    ends = np.maximum.accumulate(time - before) + before + length
    idle = np.flatnonzero(np.append(ends[:-1] <= time[1:], True)) + 1
    cuts = [0]
    for place in idle.tolist():
        if place - cuts[-1] >= _CHUNK or place == time.size:
            cuts.append(place)
    start = [
        np.array(send_all(Releases(time[a:b], message[a:b], length[a:b]), horizon, overwrite=False))
        for a, b in pairwise(cuts)
        if a < b
    ]
    return np.concatenate(start).astype(np.int64) if start else np.zeros(0, dtype=np.int64)
