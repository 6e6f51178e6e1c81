"""The result of a simulation: the traffic on both buses, and what the AMS shows.

Times run from the start of the AMS, in whole nanoseconds in arrays and in s or ms in tables.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from shipnet.arrays import Bools, Floats, Integers
from shipnet.clock import nanoseconds
from shipnet.engine.faults import WIRES, EngineFault, StuckSensor, outages
from shipnet.engine.inputs import InputCard
from shipnet.engine.points import Point, PointList
from shipnet.engine.system import RULE, System
from shipnet.errors import ArgumentError
from shipnet.fields import check_choice, check_rng, check_scalar, check_whole
from shipnet.html import as_html
from shipnet.lazy import Axes, pd

_Slices = list[tuple[int, int, str]]


# The traffic on the buses ----------------------------------------------------------------------


class Cpu:
    """The CPU time [ns] not used by Modbus interrupts of equal length, which do not overlap."""

    def __init__(self, begins: npt.ArrayLike, length: int) -> None:
        self.begins = np.asarray(begins, dtype=np.int64)
        self.length = length
        self._left = self.begins - length * np.arange(self.begins.size)

    def until(self, time: Integers) -> Integers:
        """Return the CPU time not used by interrupts up to each of these times [ns]."""
        begun = np.searchsorted(self.begins, time, side="right")
        if not self.begins.size:
            return np.asarray(time, dtype=np.int64)
        inside = time - self.begins[np.maximum(begun - 1, 0)]
        last = np.where(begun > 0, np.minimum(inside, self.length), 0)
        taken = self.length * np.maximum(begun - 1, 0) + last
        return np.asarray(time - taken, dtype=np.int64)

    def at(self, left: Integers) -> Integers:
        """Return when the CPU time reaches `left` [ns]; interrupts that begin then do not count."""
        begun = np.searchsorted(self._left, left, side="left")
        return np.asarray(left + self.length * begun, dtype=np.int64)

    def queue(self, due: Integers, work: int) -> Integers:
        """Return the start times of jobs that run one after another, as CPU times (see `at`) [ns].

        `due` must be in ascending order; `work` is the CPU time per job.
        """
        number = work * np.arange(due.size, dtype=np.int64)
        return np.asarray(number + np.maximum.accumulate(self.until(due) - number), dtype=np.int64)


#: Outcomes of a request.
OUTCOMES = ("answered", "no answer", "response damaged")


class Attempts(NamedTuple):
    """Requests in chronological order: poll, channel (0 or 1), start [ns], index in `OUTCOMES`.

    `received` is True if the box received the request, even if no response began.
    """

    poll: Integers
    channel: Integers
    start: Integers
    outcome: Integers
    received: Bools


#: Time stored for a round, or a step of a round, that did not happen.
NEVER = -1 << 62


class Rounds(NamedTuple):
    """Times of one box's rounds, by round number [ns]; `NEVER` for steps that did not happen.

    A round begins at `work`, a CPU time as in `Cpu.at`. Its values are ready at `converted`, and
    its frames are queued for the bus at `queued`.
    """

    work: Integers
    converted: Integers
    queued: Integers


class Frames(NamedTuple):
    """Frames that were sent on the bus, in no particular order.

    A frame begins at `start` and ends, before the intermission, at `arrival` [ns]; bit k of
    `hearers` is set if box k is on the sender's part of the bus.
    """

    message: Integers
    round: Integers
    start: Integers
    arrival: Integers
    hearers: Integers

    def heard_by(self, box: int, system: System) -> Integers:
        """Return the indices of the frames that a box receives, in order of arrival."""
        others = (self.hearers >> box & 1).astype(bool) & (system.sender[self.message] != box)
        rows = np.flatnonzero(others)
        return rows[np.lexsort((self.message[rows], self.arrival[rows]))]


def marks(system: System, cpu: Cpu, arrivals: Integers) -> Integers:
    """Return the CPU times [ns] at which the timer marks a box with these arrivals of frames."""
    limit = nanoseconds(system.stale_limit)
    silent = np.diff(arrivals, append=arrivals[-1:] + limit + 1) > limit
    return cpu.until(arrivals[silent] + limit)


class Views(NamedTuple):
    """The AMS's data after each response, one row per response.

    `seen` is the time at which the response was complete [ns]. For each message, `number` is the
    round in which its values were sampled, -1 if they are missing or marked, and `earliest` is the
    AMS's lower bound on their sampling time [ns].
    """

    seen: Integers
    number: Integers
    earliest: Integers


class Shown(NamedTuple):
    """What the AMS shows for a point, one entry per view, from `seen` to `until` [ns].

    `sampled` is the sampling time of the value. The value is shown as good until `good_until`,
    which equals `seen` if the value is marked from the start.
    """

    seen: Integers
    until: Integers
    good: Bools
    good_until: Integers
    sampled: Integers


# What the AMS shows --------------------------------------------------------------------------


#: Register content that marks an error; lee2012, section III.2.c. In 16 bits it is 0x00FF.
_ERROR = 0xFF


class SyntheticValues:
    """Synthetic values: for each analogue point, a slow wave around a mean.

    Mean (40..60 % of the range), amplitude (5..15 %), period (60..600 s) and phase of each wave are
    drawn from `rng`. Switches stay closed, at 0.
    """

    def __init__(self, points: Iterable[Point], rng: Any) -> None:
        self.points, rng = PointList(points), check_rng(rng)
        low = np.array([point.low for point in self.points])
        span = np.array([point.span for point in self.points])
        n = low.size
        self._mean = low + span * rng.uniform(0.4, 0.6, n)
        self._amplitude = span * rng.uniform(0.05, 0.15, n)
        self._omega = 2 * np.pi / rng.uniform(60, 600, n)
        self._phase = rng.uniform(0, 2 * np.pi, n)

    def at(self, index: int, time: npt.ArrayLike) -> Floats:
        """Return the values of the point with index `index` at the given times [s]."""
        t = np.asarray(time, dtype=np.float64)
        if not self.points[index].analogue:
            return np.zeros(t.shape)
        angle = self._omega[index] * t + self._phase[index]
        return np.asarray(self._mean[index] + self._amplitude[index] * np.sin(angle))


def reading(
    values: SyntheticValues, faults: Iterable[EngineFault], index: int, time: float
) -> float:
    """Return the value that a box reads for a point at `time` [s], including any wire fault."""
    point, now = values.points[index], nanoseconds(time)
    for wire, kind in WIRES.items():
        if any(begin <= now < stop for begin, stop in outages(faults, point.tag, kind)):
            card = InputCard(PointList([point]))
            return float(card.value(card.broken(wire))[0])
    return float(values.at(index, time))


class Screen:
    """The screen of the AMS at a given time, with **synthetic** values; `Run.screen` creates one.

    Parameters
    ----------
    time : float
        Time of the screen [s].
    table : pandas.DataFrame
        One row per point, by tag: ``box``, ``service``, ``value`` shown, ``unit``, ``true`` (the
        present value without faults), ``age_s`` and ``mark``: empty; ``0xFF`` or ``too old``, with
        value and age NaN; or ``0xFF?`` for a good value that equals the error mark.

    Notes
    -----
    In the printed coding a register is **assumed** to contain whole units, so 255 degC looks
    like an error. In the corrected coding it contains tenths, and no value equals the error mark.

    Examples
    --------
    >>> from shipnet import engine
    >>> dead = engine.faults.DeadBox("JB2", start=10)
    >>> run = engine.simulate(engine.System(), faults=dead, until=20)
    >>> run.screen(13)
    Screen(13 s: 99 points, 0 marked, 18 older than 2 s)
    >>> run.screen(14).mark("JB2"), run.screen(15).mark("JB2")
    ('', '0xFF')
    """

    def __init__(self, time: float, table: pd.DataFrame) -> None:
        self.time, self._table = time, table

    def table(self) -> pd.DataFrame:
        """Return all points: one row per tag."""
        return self._table.copy()

    def mark(self, box: str) -> str:
        """Return the mark of the first point of a box; empty if the point is not marked."""
        check_choice("box", box, self._table["box"].unique())
        return str(self._table.loc[self._table["box"] == box, "mark"].iloc[0])

    @property
    def marked(self) -> int:
        """Number of points that are marked."""
        return int((self._table["mark"] != "").sum())

    @property
    def old(self) -> int:
        """Number of points shown as good although older than 2 s."""
        return int((self._table["age_s"] > RULE).sum())

    def plot(self, ax: Axes | None = None, *, columns: int = 8) -> Axes:
        """Draw the points as tiles: good ones pale blue, old ones orange, marked ones dark.

        A contact, which has no unit, reads alarm or no alarm. With fewer than eight `columns`,
        which suit a narrow figure, the tiles do not show the tags.
        """
        from shipnet.engine.plot import plot_screen

        wide = check_whole("columns", columns, 1, 100)
        return plot_screen(self._table, ax=ax, old=RULE, columns=wide)

    def __repr__(self) -> str:
        return (
            f"Screen({self.time:g} s: {len(self._table)} points, {self.marked} marked, "
            f"{self.old} older than {RULE:g} s)"
        )

    def _repr_html_(self) -> str:
        rows = self._table.sort_values(["mark", "age_s"], ascending=False)
        return as_html(self, rows, ok=not self.marked + self.old, figure=False)


@dataclass(frozen=True, eq=False, repr=False)
class Run:
    """A finished simulation of a `system` with the given `faults`; `simulate` creates one.

    Times run from the start of the AMS; the attributes after `until` are internal to the simulator
    and have times in nanoseconds.

    Examples
    --------
    >>> from shipnet import engine
    >>> run = engine.simulate(engine.System(), until=30)
    >>> run
    Run(30 s, 30 requests, 0 alarms, oldest value shown 1.75 s)
    >>> f"{run.ages('ME-JB2-044')['last_age_s'].max():.2f} s"
    '1.75 s'
    >>> run.bus_time.round(3).to_dict()
    {'CAN': 0.046, 'channel 1': 0.242, 'channel 2': 0.0}
    """

    system: System
    faults: tuple[EngineFault, ...]
    until: float
    end: int
    attempts: Attempts
    cpus: tuple[Cpu, ...]
    loops: tuple[Rounds, ...]
    sent: Frames
    views: Views
    paths: tuple[Views, ...] = ()

    def __repr__(self) -> str:
        return (
            f"Run({self.until:g} s, {self.attempts.start.size} requests, "
            f"{len(self.alarms())} alarms, oldest value shown {self.worst_age:.2f} s)"
        )

    def _repr_html_(self) -> str:
        rows = self._table[["box", "worst_s"]].assign(limit_s=RULE)
        rows["margin_s"] = RULE - rows["worst_s"]
        rows = rows.sort_values("margin_s")
        plot = partial(self.plot_ages, str(rows.index[0]), limits={f"{RULE:g} s": RULE})
        return as_html(self, rows, plot=plot)

    def _shown(self, index: int) -> Shown:
        """Return what the AMS shows over time for the point with this index."""
        system, message = self.system, self.system.message_of[index]
        box = int(system.sender[message])
        number = self.views.number[:, message]
        begun = self.loops[box].work[number] + system.offset_ns[index]
        sampled = self.cpus[box].at(begun)
        for begin, stop in outages(self.faults, system.points[index].tag, StuckSensor):
            sampled = np.where((sampled > begin) & (sampled < stop), begin, sampled)
        until, good, good_until = self._good
        return Shown(self.views.seen, until, good[:, message], good_until[:, message], sampled)

    @cached_property
    def _good(self) -> tuple[Integers, Bools, Integers]:
        """End of each view, mask of its good messages, and times until which they are good [ns]."""
        seen = self.views.seen
        until = np.append(seen[1:], max(self.end, int(seen.max(initial=0))))
        good = self.views.number >= 0
        good_until = np.broadcast_to(until[:, None], good.shape)
        if self.system.coding == "corrected":
            limit = self.views.earliest + nanoseconds(self.system.age_limit)
            good, good_until = good & (limit > seen[:, None]), np.minimum(good_until, limit)
        return until, good, np.where(good, good_until, seen[:, None])

    def ages(self, tag: str) -> pd.DataFrame:
        """Return the age of a point over time: one row per response that the AMS received.

        Columns: ``seen_s``, ``until_s`` (the next response), ``good_until_s`` (shown as good until
        then), ``sampled_s``, ``age_s`` when seen and ``last_age_s`` when last shown as good. The
        last three are NaN if the point is marked from the start.
        """
        tags = [point.tag for point in self.system.points]
        if tag not in tags:
            raise ArgumentError(f"tag is {tag!r}; it must be one of {tags[0]} .. {tags[-1]}")
        shown = self._shown(tags.index(tag))
        good = shown.good
        columns = {
            "seen_s": shown.seen,
            "until_s": shown.until,
            "good_until_s": shown.good_until,
            "sampled_s": np.where(good, shown.sampled, np.nan),
            "age_s": np.where(good, shown.seen - shown.sampled, np.nan),
            "last_age_s": np.where(good, shown.good_until - shown.sampled, np.nan),
        }
        return pd.DataFrame({name: values / 1e9 for name, values in columns.items()})

    def plot_ages(
        self,
        tag: str,
        ax: Axes | None = None,
        *,
        limits: Mapping[str, float] | None = None,
        label: str = "",
    ) -> Axes:
        """Draw the age of a point as a sawtooth, with gaps where it is marked and `limits` [s]."""
        from shipnet.engine.plot import plot_ages

        return plot_ages(self.ages(tag), ax=ax, limits=limits, label=label)

    @property
    def worst_age(self) -> float:
        """Greatest age of any value shown as good [s]."""
        return float(self._table["worst_s"].max())

    @property
    def mean_age(self) -> float:
        """Mean age of a point while it is shown as good, averaged over all points [s]."""
        return float(self._table["mean_s"].mean())

    def timeline(self, start: float, stop: float) -> pd.DataFrame:
        """Return the work of each CPU and each line between two times [s], at most 60 s apart.

        One row per uninterrupted piece of work: ``row`` (a box, ``CAN``, ``channel 1`` or
        ``channel 2``), ``task`` (for a box ``convert``, ``send``, ``CAN``, ``timer`` or ``Modbus``;
        for CAN the sender; for a channel ``request`` or ``response``), ``start_ms`` and ``end_ms``.

        A CPU is idle while no work is listed. The CAN routine runs while the loop waits for the
        multiplexer, so it does not prolong the conversion; a Modbus interrupt does.
        """
        check_scalar("start", start, "s", -1.0, 1e6)
        check_scalar("stop", stop, "s", -1.0, 1e6 + 60)
        if not start < stop <= start + 60:
            raise ArgumentError(f"stop is {stop!r} s; it must be at most 60 s after {start!r} s")
        span = nanoseconds(start), nanoseconds(stop)
        rows: dict[str, _Slices] = {}
        for box, name in enumerate(self.system.boxes):
            rows[name] = _cpu(self, box)
        ends = self.sent.start + self.system.frame_ns[self.sent.message]
        senders = [self.system.boxes[k] for k in self.system.sender[self.sent.message]]
        rows["CAN"] = list(zip(self.sent.start.tolist(), ends.tolist(), senders, strict=True))
        rows.update(_lines(self))
        table = [
            (row, task, max(begin, span[0]) / 1e6, min(end, span[1]) / 1e6)
            for row, slices in rows.items()
            for begin, end, task in sorted(slices)
            if begin < span[1] and end > span[0]
        ]
        columns = ["row", "task", "start_ms", "end_ms"]
        return pd.DataFrame(table, columns=columns)

    def plot_timeline(self, start: float, stop: float, ax: Axes | None = None) -> Axes:
        """Draw CPUs, CAN bus and Modbus lines as rows of bars; gaps are idle times."""
        from shipnet.engine.plot import plot_timeline

        return plot_timeline(self.timeline(start, stop), ax=ax)

    def screen(self, time: float, values: SyntheticValues | None = None) -> Screen:
        """Return the AMS's screen at `time` [s], between the first response and the end of the run.

        Without `values`, the screen shows synthetic values drawn with the seed 2024.
        """
        sensors = values or SyntheticValues(self.system.points, 2024)
        seen = self.views.seen
        now = nanoseconds(check_scalar("time", time, "s", 0, 1e6))
        first = int(seen[0]) if seen.size else self.end
        if not first <= now <= self.end:
            raise ArgumentError(
                f"time is {time} s; it must be {first / 1e9:g}..{self.end / 1e9:g} s"
            )
        if sensors.points != self.system.points:
            raise ArgumentError("values are for other points; they must be for those of the run")
        row = int(np.searchsorted(seen, now, side="right")) - 1
        printed = self.system.coding == "printed"
        rows = []
        for index, point in enumerate(self.system.points):
            shown = self._shown(index)
            value, age, mark = np.nan, np.nan, "0xFF" if printed else "too old"
            if shown.good[row] and (
                now < shown.good_until[row] or shown.good_until[row] == self.end
            ):
                sampled = int(shown.sampled[row]) / 1e9
                age, mark = time - sampled, ""
                value = reading(sensors, self.faults, index, sampled)
                value = round(value, 0 if printed else 1)
                if printed and int(value) == _ERROR:
                    mark = "0xFF?"
            true = float(sensors.at(index, time))
            rows.append((point.tag, point.box, point.service, value, point.unit, true, age, mark))
        columns = ["tag", "box", "service", "value", "unit", "true", "age_s", "mark"]
        return Screen(time, pd.DataFrame(rows, columns=columns).set_index("tag"))

    def table(self) -> pd.DataFrame:
        """Return the age of each point: one row per tag.

        Columns: ``box``, ``worst_s`` and ``mean_s`` (ages while shown as good), ``marked_s`` (time
        for which the point is marked), ``sampled_s`` (sampling time of the last good value, NaN if
        none) and ``good_until_s`` (time at which the point was last shown as good).
        """
        return self._table.copy()

    @cached_property
    def _table(self) -> pd.DataFrame:
        rows = []
        for index, point in enumerate(self.system.points):
            shown = self._shown(index)
            marked = int((shown.until - shown.good_until).sum()) / 1e9
            worst = mean = sampled = until = np.nan
            if (good := shown.good).any():
                length = (shown.good_until - shown.seen)[good]
                last = (shown.good_until - shown.sampled)[good]
                mean = np.average(last - length / 2, weights=np.maximum(length, 1)) / 1e9
                worst, sampled = last.max() / 1e9, shown.sampled[good].max() / 1e9
                until = shown.good_until[good].max() / 1e9
            rows.append((point.tag, point.box, worst, mean, marked, sampled, until))
        columns = ["tag", "box", "worst_s", "mean_s", "marked_s", "sampled_s", "good_until_s"]
        return pd.DataFrame(rows, columns=columns).set_index("tag")

    def requests(self) -> pd.DataFrame:
        """Return one row per request: ``poll``, ``channel``, ``time_s``, ``outcome``."""
        poll, channel, start, outcome, _ = self.attempts
        words = pd.Categorical.from_codes(outcome, pd.Index(OUTCOMES))
        columns = {"poll": poll, "channel": channel + 1, "time_s": start / 1e9, "outcome": words}
        return pd.DataFrame(columns)

    def answers(self) -> pd.DataFrame:
        """Return one row per ``poll``: ``time_s`` and ``answer_s`` (response time; inf if none)."""
        rows = pd.DataFrame(self.attempts._asdict())
        took = np.where(rows["outcome"] == 0, nanoseconds(self.system.poll.time), np.inf)
        rows["end"] = rows["start"] + took
        by = rows.groupby("poll").agg(start=("start", "min"), end=("end", "min"))
        columns = {"time_s": by["start"] / 1e9, "answer_s": (by["end"] - by["start"]) / 1e9}
        return pd.DataFrame(columns).reset_index()

    def alarms(self) -> pd.DataFrame:
        """Return the alarms of the AMS: ``time_s``, ``source`` and ``kind``.

        Kinds for a channel: ``no answer``, ``answers again``; for a tag: ``0xFF`` (``too old`` in
        the corrected coding), ``good again``; for a box, if both channels are polled: ``path lost``
        and ``path back``.
        """
        return self._alarms.copy()

    @cached_property
    def _alarms(self) -> pd.DataFrame:
        rows = []
        silent = nanoseconds(self.system.poll.line.frame_time(8) + self.system.timeout)
        for channel in (0, 1):
            on_channel = self.attempts.channel == channel
            poll, _, start, outcome, _ = (column[on_channel] for column in self.attempts)
            fine = outcome == 0
            # A poll of the channel fails with its last retry.
            _, count = np.unique(poll, return_counts=True)
            final = np.repeat(count, count) == 1 + self.system.retries
            ended = (poll != np.append(poll[1:], -1)) & (fine | final)
            wait = np.where(outcome == 1, silent, nanoseconds(self.system.poll.time))
            for when, good in _changes((start + wait)[ended], fine[ended]):
                word = "answers again" if good else "no answer"
                rows.append((when / 1e9, f"channel {channel + 1}", word))
        limit = nanoseconds(self.system.age_limit)
        for channel, path in enumerate(self.paths, start=1):
            fresh = path.earliest + limit > path.seen[:, None]
            for box, name in enumerate(self.system.boxes):
                fine = np.asarray(fresh[:, self.system.sender == box].all(axis=1))
                for when, good in _changes(path.seen, fine):
                    word = "path back" if good else "path lost"
                    rows.append((when / 1e9, f"{name} on channel {channel}", word))
        until, all_good, good_until = self._good
        bad = "0xFF" if self.system.coding == "printed" else "too old"
        tags: dict[int, list[str]] = {}
        for point, message in zip(self.system.points, self.system.message_of.tolist(), strict=True):
            tags.setdefault(message, []).append(point.tag)
        for message, of_message in tags.items():
            # Points stay good until the next response, or until their limit if that is earlier.
            valid, end = all_good[:, message], good_until[:, message]
            time = np.stack([self.views.seen, end], axis=1)
            state = np.stack([valid, valid & (end == until)], axis=1)
            for when, back in _changes(time.ravel(), state.ravel()):
                rows += [(when / 1e9, tag, "good again" if back else bad) for tag in of_message]
        rows.sort(key=lambda row: row[0])
        return pd.DataFrame(rows, columns=["time_s", "source", "kind"])

    @cached_property
    def bus_time(self) -> pd.Series[float]:
        """Fractions of the time for which the CAN bus and each Modbus line are busy."""
        bits = self.system.frame_ns[self.sent.message[self.sent.start >= 0]]
        busy = {"CAN": int(bits.sum())}
        for name, slices in _lines(self).items():
            busy[name] = sum(end - begin for begin, end, _ in slices)
        return pd.Series(busy) / self.end


def _changes(time: Integers, good: Bools) -> Sequence[tuple[int, bool]]:
    """Return the times at which a state changes, and the new states; the state is good at first."""
    before = np.append(True, good[:-1]) if good.size else good
    places = np.flatnonzero(good != before)
    return list(zip(time[places].tolist(), good[places].tolist(), strict=True))


# Timelines: figures 5 and 6 of lee2012 ---------------------------------------------------------


def _cpu(run: Run, box: int) -> _Slices:
    system, cpu, loop = run.system, run.cpus[box], run.loops[box]
    modbus = [(t, t + system.service_ns, "Modbus") for t in cpu.begins.tolist()]
    received = run.sent.heard_by(box, system)
    due, work = run.sent.arrival[received], nanoseconds(system.firmware.receive)
    left = cpu.queue(due, work)
    starts, ends = np.maximum(cpu.at(left), due), cpu.at(left + work)
    can = _without(
        [(a, b, "CAN") for a, b in zip(starts.tolist(), ends.tolist(), strict=True)], modbus
    )
    if system.coding == "printed" and box in system.ports:
        senders = system.sender[run.sent.message[received]]
        length = nanoseconds(system.firmware.mark)
        begun = [marks(system, cpu, ends[senders == sender]) for sender in set(senders)]
        timer = [
            (a, b, "timer")
            for left in begun
            for a, b in zip(cpu.at(left).tolist(), cpu.at(left + length).tolist(), strict=True)
        ]
        can += _without(timer, [*modbus, *can])
    whole = loop.queued > NEVER
    begins = cpu.at(loop.work[whole]).tolist()
    converted, queued = loop.converted[whole].tolist(), loop.queued[whole].tolist()
    steps = [(a, b, "convert") for a, b in zip(begins, converted, strict=True)]
    steps += [(a, b, "send") for a, b in zip(converted, queued, strict=True)]
    return [*modbus, *can, *_without(steps, [*modbus, *can])]


def _without(slices: _Slices, busy: _Slices) -> _Slices:
    """Return time slices without the parts that busy slices occupy."""
    free = []
    starts = np.array(sorted(begin for begin, _, _ in busy), dtype=np.int64)
    taken = sorted(busy)
    for begin, end, task in slices:
        # An earlier busy slice may extend into this slice.
        first = max(int(np.searchsorted(starts, begin)) - 1, 0)
        for other, until, _ in taken[first : int(np.searchsorted(starts, end))]:
            if until <= begin:
                continue
            if other > begin:
                free.append((begin, other, task))
            begin = max(begin, until)
        if begin < end:
            free.append((begin, end, task))
    return free


def _lines(run: Run) -> dict[str, _Slices]:
    request = nanoseconds(run.system.poll.line.frame_time(8))
    response = nanoseconds(run.system.poll.line.frame_time(5 + 2 * run.system.registers))
    wait = nanoseconds(run.system.serial.t35 + run.system.firmware.processing)
    lines: dict[str, _Slices] = {"channel 1": [], "channel 2": []}
    columns = (run.attempts.channel, run.attempts.start, run.attempts.outcome)
    for channel, begin, outcome in zip(*(c.tolist() for c in columns), strict=True):
        line = lines[f"channel {channel + 1}"]
        line.append((begin, begin + request, "request"))
        if outcome != 1:
            answer = begin + request + wait
            line.append((answer, answer + response, "response"))
    return lines
