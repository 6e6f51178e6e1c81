"""The whole system in simulated time, and what the AMS knows of every point after every poll.

Time is a whole number of nanoseconds from the start of the AMS; the boxes have run before.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from shipnet.clock import nanoseconds
from shipnet.engine.faults import (
    DeadBox,
    EngineFault,
    LostCanFrames,
    LostModbusFrames,
    StuckSensor,
    check_faults,
    outages,
)
from shipnet.engine.screen import Screen, SyntheticValues, take_screen
from shipnet.engine.system import System
from shipnet.engine.traffic import (
    NEVER,
    OUTCOMES,
    Attempts,
    Cpu,
    Frames,
    Rounds,
    ask,
    rounds,
    send,
)
from shipnet.errors import ArgumentError
from shipnet.fields import check_scalar

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

Bools = npt.NDArray[np.bool_]
Integers = npt.NDArray[np.int64]

#: Most frames that one run may send, and the AMS read: some gigabytes of memory. A poll reads all
#: of them.
_MOST_FRAMES = 20_000_000

_Slices = list[tuple[int, int, str]]


def simulate(
    system: System,
    *,
    faults: EngineFault | Iterable[EngineFault] = (),
    until: float,
    phases: Mapping[str, float] | None = None,
    rng: Any = None,
) -> Run:
    """Simulate the system from the first poll on.

    Parameters
    ----------
    system : System
        The system.
    faults : fault or iterable of faults, optional
        What goes wrong, from `shipnet.engine.faults`.
    until : float
        The last poll begins before this time, 0.001..1e6 [s].
    phases : mapping of str to float, optional
        When a round of each box begins, and under ``"AMS"`` the first poll, 0..100 [s]. What is
        not named begins at 0, or at random if there is an `rng`: no two clocks are in step.
    rng : optional
        Chance, whatever `numpy.random.default_rng` takes; needed if frames get lost. With None
        nothing is random.

    Returns
    -------
    Run
        What happened.

    Raises
    ------
    ArgumentError
        If an argument is out of its range, or more than 20 million frames would be sent and read;
        each poll reads the newest frame of every message.

    Notes
    -----
    All clocks run at the same rate, so phases stay as they are.

    Examples
    --------
    Box 2 dies after 10 s. Its values are shown as good for another four seconds and more:

    >>> from shipnet import engine
    >>> dead = engine.faults.DeadBox("JB2", start=10)
    >>> run = engine.simulate(engine.System(), faults=dead, until=20)
    >>> run
    Run(20 s, 20 requests, 18 alarms, oldest value shown 4.75 s)
    >>> run.alarms()[["time_s", "kind"]].drop_duplicates().round(2).values.tolist()
    [[14.25, '0xFF']]
    >>> run.table().groupby("box")["worst_s"].max().round(2).to_dict()
    {'JB1': 1.75, 'JB2': 4.75, 'JB3': 1.75}
    """
    horizon = nanoseconds(check_scalar("until", until, "s", 1e-3, 1e6))
    wrong = check_faults(system, faults)
    if rng is None and any(isinstance(f, LostCanFrames | LostModbusFrames) for f in wrong):
        raise ArgumentError("rng is None; frames are lost at random, so there must be one")
    chance = None if rng is None else np.random.default_rng(rng)
    begins = _phases(system, phases or {}, chance)
    frames = sum(horizon / period for period in system.period_ns[system.sender].tolist())
    polls = until / system.poll_spacing() * (2 if system.polled == "both" else 1)
    frames += polls * system.sender.size
    if frames > _MOST_FRAMES:
        raise ArgumentError(
            f"until is {until} s; in that time {frames:.0f} frames are sent and read; they must "
            f"be {_MOST_FRAMES} at most"
        )
    attempts = ask(system, horizon, begins["AMS"], wrong, chance)
    answered = nanoseconds(system.poll.time)
    last = int(attempts.start.max(initial=0)) + answered
    warm = 3 * int(system.period_ns.max()) + 10**9
    span = (-warm, max(horizon, last))
    asked = attempts.start + nanoseconds(system.poll.line.frame_time(8) + system.serial.t35)
    served = attempts.outcome != 1
    readers = np.array(system.ports)[attempts.channel]
    cpus = [
        Cpu(asked[served & (readers == box)], system.service_ns) for box in range(len(system.boxes))
    ]
    loops = [
        rounds(system, box, cpu, span, begins[system.boxes[box]], wrong)
        for box, cpu in enumerate(cpus)
    ]
    sent = send(system, loops, span, wrong)
    lost = _lost(system, [loop.work.size for loop in loops], loops, wrong, chance)
    good = attempts.outcome == 0
    seen, channel = attempts.start[good] + answered, attempts.channel[good]
    width = system.sender.size
    number, known = np.full((seen.size, width), -1), np.full((seen.size, width), NEVER)
    for port, box in enumerate(system.ports):
        rows = np.flatnonzero(channel == port)
        table = _Table(system, box, cpus[box], loops[box], sent, lost, wrong)
        number[rows], known[rows] = table.read(asked[good][rows])
    views = Views(seen, number, known)
    paths: tuple[Views, ...] = ()
    if system.polled == "both":
        paths = tuple(Views(*(c[channel == port] for c in views)) for port in (0, 1))
        views = _freshest(views, channel)
    return Run(
        system, wrong, until, span[1], attempts, tuple(cpus), tuple(loops), sent, views, paths
    )


def _phases(
    system: System, given: Mapping[str, float], rng: np.random.Generator | None
) -> dict[str, int]:
    periods = dict(zip(system.boxes, system.period_ns.tolist(), strict=True))
    periods["AMS"] = nanoseconds(system.poll_period)
    if strange := sorted(set(given) - set(periods)):
        raise ArgumentError(f"phases name {strange}; they must be of {', '.join(periods)}")
    found = {}
    for name, period in periods.items():
        drawn = 0 if rng is None else int(rng.integers(period))
        chosen = check_scalar(f"phase of {name}", given.get(name, 0.0), "s", 0, 100)
        found[name] = nanoseconds(chosen) if name in given else drawn
    return found


def _lost(
    system: System,
    counts: Sequence[int],
    loops: Sequence[Rounds],
    faults: Sequence[EngineFault],
    rng: np.random.Generator | None,
) -> npt.NDArray[np.bool_] | None:
    """Return what each box does not hear, shape (n_boxes, n_messages, n_rounds)."""
    random = [fault for fault in faults if isinstance(fault, LostCanFrames)]
    if not random or rng is None:
        return None
    lost = np.zeros((len(system.boxes), system.sender.size, max(counts)), dtype=bool)
    for fault in random:
        box = system.boxes.index(fault.where)
        begin, stop = fault.span
        due = (loops[box].queued >= begin) & (loops[box].queued < stop)
        for message in np.flatnonzero(system.sender == box):
            chance = rng.random((len(system.boxes), counts[box]))
            lost[:, message, : counts[box]] |= (chance < fault.probability) & due
    return lost


class _Table:
    """What a box knows: its own values, and what it heard."""

    def __init__(
        self,
        system: System,
        box: int,
        cpu: Cpu,
        loop: Rounds,
        sent: Frames,
        lost: npt.NDArray[np.bool_] | None,
        faults: Sequence[EngineFault],
    ) -> None:
        self.system, self.box, self.cpu, self.loop = system, box, cpu, loop
        self.deaths = outages(faults, system.boxes[box], DeadBox)
        heard = (sent.hearers >> box & 1).astype(bool) & (system.sender[sent.message] != box)
        if lost is not None:
            heard &= ~lost[box, sent.message, sent.round]
        rows = np.flatnonzero(heard)
        rows = rows[np.lexsort((sent.message[rows], sent.arrival[rows]))]
        self.message, self.number = sent.message[rows], sent.round[rows]
        work = nanoseconds(system.firmware.receive)
        due = sent.arrival[rows]
        self.done = cpu.at(cpu.queue(due, work) + work) if rows.size else due

    def read(self, time: Integers) -> tuple[Integers, Integers]:
        """Return the round that every message is from at some times, and the safe sample time.

        The round is -1, and the sample time `NEVER`, where a value is missing or marked.
        """
        system, box = self.system, self.box
        number = np.full((time.size, system.sender.size), -1)
        known = np.full((time.size, system.sender.size), NEVER)
        hop = system.hop_ns(box)
        emptied = np.full(time.size, NEVER)
        for _, back in self.deaths:
            emptied = np.where(time >= back, back, emptied)
        for message, sender in enumerate(system.sender.tolist()):
            if sender == box:
                rounds_ = np.flatnonzero(self.loop.converted > NEVER)
                done = self.loop.converted[rounds_]
            else:
                rows = self.message == message
                rounds_, done = self.number[rows], self.done[rows]
            place = np.searchsorted(done, time, side="right") - 1
            there = place >= 0
            if not there.any():
                continue
            when = np.where(there, done[place], NEVER)
            there &= when >= emptied
            if sender != box and system.coding == "printed":
                there &= when > self._marked(sender, time)
            number[there, message] = rounds_[place][there]
            known[there, message] = when[there] - hop[message]
        return number, known

    def _marked(self, sender: int, time: Integers) -> Integers:
        """Return when the timer of a sender last marked its values [ns]."""
        heard = self.done[self.system.sender[self.message] == sender]
        limit = nanoseconds(self.system.stale_limit)
        silent = np.append(np.diff(heard) > limit, True) if heard.size else np.zeros(0, bool)
        work = nanoseconds(self.system.firmware.mark)
        # In front of all marks stands one that never was.
        marks = np.append(NEVER, self.cpu.at(self.cpu.until(heard[silent] + limit) + work))
        return np.asarray(marks[np.searchsorted(marks, time, side="right") - 1])


def _freshest(views: Views, channel: Integers) -> Views:
    """Return what the AMS knows after every answer, each message from the better channel."""
    order = np.argsort(views.seen, kind="stable")
    seen, channel = views.seen[order], channel[order]
    number, known = views.number[order], views.known[order]
    rows = np.arange(seen.size)
    best_number, best_known = np.full_like(number, -1), np.full_like(known, NEVER)
    for port in (0, 1):
        newest = np.maximum.accumulate(np.where(channel == port, rows, -1))
        held = newest >= 0
        theirs = np.where(held[:, None], known[newest], NEVER)
        better = theirs > best_known
        best_known = np.where(better, theirs, best_known)
        best_number = np.where(better, number[newest], best_number)
    # Of answers that end at the same instant the last one leaves its view.
    last = np.append(seen[1:] > seen[:-1], True)[: seen.size]
    return Views(seen[last], best_number[last], best_known[last])


# What came of it -------------------------------------------------------------------------------


class Views(NamedTuple):
    """What the AMS knows after each answer, one row per answer.

    `seen` is when the answer was complete [ns]; by message, `number` is the round of the sender's
    loop that the values are from, -1 if they are missing or marked, and no value was sampled
    before `known` [ns], as far as the reader can tell.
    """

    seen: Integers
    number: Integers
    known: Integers


class Shown(NamedTuple):
    """What the AMS shows of a point, one entry per view, from `seen` to `until` [ns].

    It is shown as `good` at first, and so until `good_until`, which is `seen` if it is marked from
    the start; the value was true when it was `sampled` [ns].
    """

    seen: Integers
    until: Integers
    good: Bools
    good_until: Integers
    sampled: Integers


@dataclass(frozen=True, eq=False, repr=False)
class Ages:
    """The age of one point over time."""

    tag: str
    _table: pd.DataFrame

    def table(self) -> pd.DataFrame:
        """Return one row per answer of a box.

        ``seen_s``, ``until_s`` (the next answer), ``good_until_s`` (until when it is shown as
        good), ``sampled_s``, ``age_s`` when it is seen and ``last_age_s`` when it is last shown as
        good; ages are NaN where it is marked at once.
        """
        return self._table.copy()

    def plot(
        self, ax: Axes | None = None, *, limits: Mapping[str, float] | None = None, label: str = ""
    ) -> Axes:
        """Draw the age as a saw, broken while the point is marked, and `limits` [s] by name."""
        from shipnet.engine.plot import plot_ages

        return plot_ages(self._table, ax=ax, limits=limits, label=label)

    def __repr__(self) -> str:
        return f"Ages({self.tag}, at most {self._table['last_age_s'].max():.2f} s)"


@dataclass(frozen=True, eq=False, repr=False)
class Timeline:
    """What each CPU and each line does in a stretch of time."""

    start: float
    stop: float
    _table: pd.DataFrame

    def table(self) -> pd.DataFrame:
        """Return one row per stretch of work.

        ``row`` (a box, ``CAN``, ``channel 1`` or ``channel 2``), ``task`` (``convert``, ``send``,
        ``CAN``, ``timer``, ``Modbus``; a box whose frame is on the bus; ``request``,
        ``response``), ``start_ms`` and ``end_ms``.
        """
        return self._table.copy()

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw CPUs, CAN bus and Modbus lines as rows of bars; what is not drawn is waiting."""
        from shipnet.engine.plot import plot_timeline

        return plot_timeline(self._table, ax=ax)

    def __repr__(self) -> str:
        return f"Timeline({self.start:g}..{self.stop:g} s: {len(self._table)} stretches of work)"


@dataclass(frozen=True, eq=False, repr=False)
class Run:
    """A finished simulation of a `system` with some `faults`; `simulate` makes one.

    A table has one row per point, alarm, request or poll. Times are in seconds from the start of
    the AMS; the attributes after `until` are arrays of the simulator, in nanoseconds.

    Examples
    --------
    >>> from shipnet import engine
    >>> run = engine.simulate(engine.System(), until=30)
    >>> run
    Run(30 s, 30 requests, 0 alarms, oldest value shown 1.75 s)
    >>> run.ages("ME-JB2-044")
    Ages(ME-JB2-044, at most 1.75 s)
    >>> run.bus_loads.round(3).to_dict()
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

    def shown(self, tag: str) -> Shown:
        """Return what the AMS shows of a point over time."""
        return self._shown(self._place(tag))

    def _place(self, tag: str) -> int:
        tags = [point.tag for point in self.system.points]
        if tag not in tags:
            raise ArgumentError(f"tag is {tag!r}; it must be one of {tags[0]} .. {tags[-1]}")
        return tags.index(tag)

    def _shown(self, place: int) -> Shown:
        system, message = self.system, self.system.message_of[place]
        box = int(system.sender[message])
        number = self.views.number[:, message]
        begun = self.loops[box].work[number] + system.offset_ns[place]
        sampled = self.cpus[box].at(begun)
        for begin, stop in outages(self.faults, system.points[place].tag, StuckSensor):
            sampled = np.where((sampled > begin) & (sampled < stop), begin, sampled)
        until, good, good_until = self._good
        return Shown(self.views.seen, until, good[:, message], good_until[:, message], sampled)

    @cached_property
    def _good(self) -> tuple[Integers, Bools, Integers]:
        """Until when each view holds, which messages are shown as good, and until when [ns]."""
        seen = self.views.seen
        until = np.append(seen[1:], max(self.end, int(seen.max(initial=0))))
        good = self.views.number >= 0
        good_until = np.broadcast_to(until[:, None], good.shape)
        if self.system.coding == "corrected":
            limit = self.views.known + nanoseconds(self.system.age_limit)
            good, good_until = good & (limit > seen[:, None]), np.minimum(good_until, limit)
        return until, good, np.where(good, good_until, seen[:, None])

    def ages(self, tag: str) -> Ages:
        """Return the age of a point over time."""
        import pandas as pd

        shown = self.shown(tag)
        good = shown.good
        columns = {
            "seen_s": shown.seen,
            "until_s": shown.until,
            "good_until_s": shown.good_until,
            "sampled_s": np.where(good, shown.sampled, np.nan),
            "age_s": np.where(good, shown.seen - shown.sampled, np.nan),
            "last_age_s": np.where(good, shown.good_until - shown.sampled, np.nan),
        }
        table = pd.DataFrame({name: values / 1e9 for name, values in columns.items()})
        return Ages(tag, table)

    @property
    def worst_age(self) -> float:
        """Greatest age of any value shown as good [s]."""
        return float(self._table["worst_s"].max())

    @property
    def mean_age(self) -> float:
        """Mean over the points of their mean age while they are shown as good [s]."""
        return float(self._table["mean_s"].mean())

    def timeline(self, start: float, stop: float) -> Timeline:
        """Return what each CPU and each line does between two times, 60 s apart at most [s].

        Where a CPU is not listed it waits. The CAN routine runs while the loop waits for the
        multiplexer, so it cuts the conversion in two without making it longer; a Modbus interrupt
        makes it longer. Frames that are lost by overrun are shown as if they were taken over.
        """
        return _timeline(self, start, stop)

    def screen(self, time: float, values: SyntheticValues | None = None) -> Screen:
        """Return what the AMS shows at a time between its first answer and the end [s].

        `values` are what the sensors measure; synthetic ones with the seed 2024 if not given.
        """
        return take_screen(self, time, values or SyntheticValues(self.system.points, 2024))

    def table(self) -> pd.DataFrame:
        """Return how old each point was: one row per tag.

        ``box``, ``worst_s`` (greatest age shown as good), ``mean_s`` (mean age over the
        time in which it is shown as good), ``marked_s`` (how long it is marked), ``sampled_s``
        (when the value that is shown as good at last was true, NaN without any) and
        ``good_until_s`` (when it was last shown as good).
        """
        return self._table.copy()

    @cached_property
    def _table(self) -> pd.DataFrame:
        import pandas as pd

        rows = []
        for place, point in enumerate(self.system.points):
            shown = self._shown(place)
            length = shown.good_until - shown.seen
            good = np.flatnonzero(shown.good)
            marked = int((shown.until - shown.good_until).sum()) / 1e9
            row = [point.tag, point.box, np.nan, np.nan, marked, np.nan, np.nan]
            if good.size:
                length = length[good]
                last = shown.good_until[good] - shown.sampled[good]
                middle = last - length / 2
                mean = float(np.average(middle, weights=np.maximum(length, 1)))
                sampled = int(shown.sampled[good].max())
                until = int(shown.good_until[good].max())
                row[2:4] = [int(last.max()) / 1e9, mean / 1e9]
                row[5:] = [sampled / 1e9, until / 1e9]
            rows.append(row)
        columns = ["tag", "box", "worst_s", "mean_s", "marked_s", "sampled_s", "good_until_s"]
        return pd.DataFrame(rows, columns=columns).set_index("tag")

    def requests(self) -> pd.DataFrame:
        """Return one row per request: ``poll``, ``channel``, ``time_s``, ``outcome``."""
        import pandas as pd

        return pd.DataFrame(
            {
                "poll": self.attempts.poll,
                "channel": self.attempts.channel + 1,
                "time_s": self.attempts.start / 1e9,
                "outcome": pd.Categorical.from_codes(self.attempts.outcome, pd.Index(OUTCOMES)),
            }
        )

    def answers(self) -> pd.DataFrame:
        """Return one row per poll: ``time_s``, ``answer_s`` (how long; infinite without one)."""
        import pandas as pd

        rows = pd.DataFrame(self.attempts._asdict())
        took = np.where(rows["outcome"] == 0, nanoseconds(self.system.poll.time), np.inf)
        rows["end"] = rows["start"] + took
        by = rows.groupby("poll").agg(start=("start", "min"), end=("end", "min")).reset_index()
        return pd.DataFrame(
            {
                "poll": by["poll"],
                "time_s": by["start"] / 1e9,
                "answer_s": (by["end"] - by["start"]) / 1e9,
            }
        )

    def alarms(self) -> pd.DataFrame:
        """Return what the AMS raises: ``time_s``, ``source`` (a tag or a channel), ``kind``.

        Kinds are ``no answer`` and ``answers again`` of a channel; ``0xFF`` (or ``too old`` in the
        corrected coding) and ``good again`` of a point; ``path lost`` and ``path back`` of a box as
        one of two polled channels shows it.
        """
        return self._alarms.copy()

    @cached_property
    def _alarms(self) -> pd.DataFrame:
        import pandas as pd

        rows = self._link_alarms() + self._path_alarms()
        until, good, good_until = self._good
        bad = "0xFF" if self.system.coding == "printed" else "too old"
        tags: dict[int, list[str]] = {}
        for point, message in zip(self.system.points, self.system.message_of.tolist(), strict=True):
            tags.setdefault(message, []).append(point.tag)
        for message, own in tags.items():
            # Good from each answer on, bad from where that ends before the next.
            fine, end = good[:, message], good_until[:, message]
            time = np.stack([self.views.seen, end], axis=1)
            state = np.stack([fine, fine & (end == until)], axis=1)
            for when, back in _changes(time.ravel(), state.ravel()):
                rows += [(when / 1e9, tag, "good again" if back else bad) for tag in own]
        rows.sort(key=lambda row: row[0])
        return pd.DataFrame(rows, columns=["time_s", "source", "kind"])

    def _link_alarms(self) -> list[tuple[float, str, str]]:
        rows = []
        tries = 1 + self.system.retries
        silent = nanoseconds(self.system.poll.line.frame_time(8) + self.system.timeout)
        for channel in (0, 1):
            own = self.attempts.channel == channel
            columns = (self.attempts.poll, self.attempts.start, self.attempts.outcome)
            poll, start, outcome = (column[own] for column in columns)
            fine = outcome == 0
            _, count = np.unique(poll, return_counts=True)
            final = np.repeat(count, count) == tries
            ends = np.append(poll[1:] != poll[:-1], True) if poll.size else fine
            known = ends & (fine | final)
            wait = np.where(outcome == 1, silent, nanoseconds(self.system.poll.time))
            for when, good in _changes((start + wait)[known], fine[known]):
                word = "answers again" if good else "no answer"
                rows.append((when / 1e9, f"channel {channel + 1}", word))
        return rows

    def _path_alarms(self) -> list[tuple[float, str, str]]:
        rows = []
        limit = nanoseconds(self.system.age_limit)
        for channel, path in enumerate(self.paths, start=1):
            fresh = path.known + limit > path.seen[:, None]
            for box, name in enumerate(self.system.boxes):
                fine = np.asarray(fresh[:, self.system.sender == box].all(axis=1))
                for when, good in _changes(path.seen, fine):
                    word = "path back" if good else "path lost"
                    rows.append((when / 1e9, f"{name} on channel {channel}", word))
        return rows

    @cached_property
    def bus_loads(self) -> pd.Series[float]:
        """Share of the time in which the CAN bus and both Modbus lines are busy."""
        import pandas as pd

        inside = self.sent.start >= 0
        bits = self.system.frame_ns[self.sent.message[inside]]
        busy = {"CAN": int(bits.sum())}
        line = self.system.serial
        request = nanoseconds(line.frame_time(8))
        response = nanoseconds(line.frame_time(5 + 2 * self.system.registers))
        for channel in (0, 1):
            outcome = self.attempts.outcome[self.attempts.channel == channel]
            heard = int((outcome != 1).sum())
            busy[f"channel {channel + 1}"] = outcome.size * request + heard * response
        return pd.Series(busy) / self.end


def _changes(time: Integers, good: Bools) -> Sequence[tuple[int, bool]]:
    """Return when a state, good at first, changes, and to what."""
    before = np.append(True, good[:-1]) if good.size else good
    places = np.flatnonzero(good != before)
    return list(zip(time[places].tolist(), good[places].tolist(), strict=True))


# Who works when: figures 5 and 6 of lee2012 in time --------------------------------------------


def _timeline(run: Run, start: float, stop: float) -> Timeline:
    """Return who works when."""
    import pandas as pd

    check_scalar("start", start, "s", -1.0, 1e6)
    check_scalar("stop", stop, "s", -1.0, 1e6 + 60)
    if not start < stop <= start + 60:
        raise ArgumentError(f"stop is {stop!r} s; it must be in the 60 s after {start!r} s")
    span = nanoseconds(start), nanoseconds(stop)
    rows: dict[str, _Slices] = {}
    for box, name in enumerate(run.system.boxes):
        rows[name] = _cpu(run, box)
    senders = run.system.sender[run.sent.message].tolist()
    ends = run.sent.start + run.system.frame_ns[run.sent.message]
    names = run.system.boxes
    rows["CAN"] = [
        (begin, end, names[sender])
        for begin, end, sender in zip(run.sent.start.tolist(), ends.tolist(), senders, strict=True)
    ]
    rows.update(_lines(run))
    table = [
        (row, task, max(begin, span[0]) / 1e6, min(end, span[1]) / 1e6)
        for row, slices in rows.items()
        for begin, end, task in sorted(slices)
        if begin < span[1] and end > span[0]
    ]
    columns = ["row", "task", "start_ms", "end_ms"]
    return Timeline(start, stop, pd.DataFrame(table, columns=columns))


def _cpu(run: Run, box: int) -> _Slices:
    system, cpu, loop = run.system, run.cpus[box], run.loops[box]
    modbus = [(t, t + system.service_ns, "Modbus") for t in cpu.begins.tolist()]
    heard = (run.sent.hearers >> box & 1).astype(bool) & (system.sender[run.sent.message] != box)
    work = nanoseconds(system.firmware.receive)
    order = np.argsort(run.sent.arrival[heard], kind="stable")
    due = run.sent.arrival[heard][order]
    left = cpu.queue(due, work) if due.size else due
    starts, ends = np.maximum(cpu.at(left), due), cpu.at(left + work)
    can = _without(
        [(a, b, "CAN") for a, b in zip(starts.tolist(), ends.tolist(), strict=True)], modbus
    )
    if system.coding == "printed" and box in system.ports:
        senders = system.sender[run.sent.message[heard][order]]
        timer = [m for sender in set(senders) for m in _marks(run, box, ends[senders == sender])]
        can += _without(timer, [*modbus, *can])
    whole = loop.queued > NEVER
    begins = cpu.at(loop.work[whole]).tolist()
    converted, queued = loop.converted[whole].tolist(), loop.queued[whole].tolist()
    steps = [(a, b, "convert") for a, b in zip(begins, converted, strict=True)]
    steps += [(a, b, "send") for a, b in zip(converted, queued, strict=True)]
    return [*modbus, *can, *_without(steps, [*modbus, *can])]


def _marks(run: Run, box: int, heard: Integers) -> _Slices:
    """Return when the timer of a sender marks its values: each time it was silent for too long."""
    system, cpu = run.system, run.cpus[box]
    silent = np.append(np.diff(heard) > nanoseconds(system.stale_limit), True)
    begins = cpu.until(heard[silent] + nanoseconds(system.stale_limit))
    ends = cpu.at(begins + nanoseconds(system.firmware.mark))
    return [(a, b, "timer") for a, b in zip(cpu.at(begins).tolist(), ends.tolist(), strict=True)]


def _without(slices: _Slices, busy: _Slices) -> _Slices:
    """Return what is left of slices of time when others take theirs."""
    found = []
    starts = np.array(sorted(begin for begin, _, _ in busy), dtype=np.int64)
    taken = sorted(busy)
    for begin, end, task in slices:
        # A slice of the busy ones that began before may reach into this one.
        first = max(int(np.searchsorted(starts, begin)) - 1, 0)
        for other, until, _ in taken[first : int(np.searchsorted(starts, end))]:
            if until <= begin:
                continue
            if other > begin:
                found.append((begin, other, task))
            begin = max(begin, until)
        if begin < end:
            found.append((begin, end, task))
    return found


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
