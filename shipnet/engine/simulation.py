"""The whole system in simulated time: the AMS's requests, the boxes' CPUs and their CAN frames.

Time is in whole nanoseconds from the start of the AMS; the boxes are already running then.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from math import inf
from typing import Any

import numpy as np

from shipnet.arrays import Bools, Integers
from shipnet.can.frame import INTERMISSION
from shipnet.clock import nanoseconds
from shipnet.engine.faults import (
    BusOff,
    CanBreak,
    DeadBox,
    DeadPort,
    EngineFault,
    LostCanFrames,
    LostModbusFrames,
    ModbusBreak,
    outages,
)
from shipnet.engine.run import NEVER, Attempts, Cpu, Frames, Rounds, Run, Views, marks
from shipnet.engine.system import RULE, System
from shipnet.errors import ArgumentError
from shipnet.fields import check_rng, check_scalar, check_whole
from shipnet.lazy import pd
from shipnet.parallel import track

#: Maximum number of frames sent and read in one run; they take several gigabytes of memory. Each
#: poll reads the newest frame of every message.
_MOST_FRAMES = 20_000_000

#: Shortest time from the nominal start of a lasting fault to the end of its run [s]; the run is
#: longer if the system marks values late.
_LENGTH = 20.0


def simulate(
    system: System,
    *,
    faults: EngineFault | Iterable[EngineFault] = (),
    until: float,
    phases: Mapping[str, float] | None = None,
    rng: Any = None,
) -> Run:
    """Simulate the system from the first poll onwards, with clocks that all run at the same rate.

    Parameters
    ----------
    system : System
        The system.
    faults : fault or iterable of faults, optional
        Faults from `shipnet.engine.faults`.
    until : float
        The last poll begins before this time, 0.001..1e6 [s].
    phases : mapping of str to float, optional
        Start of a round, by box, and of the first poll, under ``"AMS"``; 0..100 [s]. Phases not
        given are 0, or random if `rng` is given.
    rng : optional
        Seed or generator (`numpy.random.default_rng`); required if frames are lost.

    Returns
    -------
    Run
        Requests, frames, and the values that the AMS shows.

    Raises
    ------
    ArgumentError
        If an argument is out of its range, or more than 20 million frames would be sent and read;
        each poll reads the newest frame of every message.

    Examples
    --------
    Box 2 dies after 10 s. Its values are shown as good for more than four seconds:

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
    wrong = system.check_faults(faults)
    if rng is None and any(isinstance(f, LostCanFrames | LostModbusFrames) for f in wrong):
        raise ArgumentError("rng is None; it is required because frames are lost at random")
    chance = None if rng is None else check_rng(rng)
    periods = dict(zip(system.boxes, system.period_ns.tolist(), strict=True))
    periods["AMS"] = nanoseconds(system.poll_period)
    chosen = phases or {}
    if strange := sorted(set(chosen) - set(periods)):
        raise ArgumentError(f"phases has unknown names {strange}; known are {', '.join(periods)}")
    begins = {}
    for name, period in periods.items():
        drawn = 0 if chance is None else int(chance.integers(period))
        phase = check_scalar(f"phase of {name}", chosen.get(name, 0.0), "s", 0, 100)
        begins[name] = nanoseconds(phase) if name in chosen else drawn
    frames = sum(horizon / period for period in system.period_ns[system.sender].tolist())
    polls = until / system.poll_spacing() * (2 if system.polled == "both" else 1)
    frames += polls * system.sender.size
    if frames > _MOST_FRAMES:
        raise ArgumentError(
            f"until is {until} s; in that time {frames:.0f} frames are sent and read; the "
            f"limit is {_MOST_FRAMES}"
        )
    attempts = ask(system, horizon, begins["AMS"], wrong, chance)
    answered = nanoseconds(system.poll.time)
    last = int(attempts.start.max(initial=0)) + answered
    warm = 3 * int(system.period_ns.max()) + 10**9
    span = (-warm, max(horizon, last))
    requested = attempts.start + nanoseconds(system.poll.line.frame_time(8) + system.serial.t35)
    readers = np.where(attempts.received, np.array(system.ports)[attempts.channel], -1)
    cpus = [Cpu(requested[readers == box], system.service_ns) for box in range(len(system.boxes))]
    loops = [
        rounds(system, box, cpu, span, begins[system.boxes[box]], wrong)
        for box, cpu in enumerate(cpus)
    ]
    sent = send(system, loops, span, wrong)
    lost = _lost(system, loops, wrong, chance)
    good = attempts.outcome == 0
    seen, channel = attempts.start[good] + answered, attempts.channel[good]
    width = system.sender.size
    number, earliest = np.full((seen.size, width), -1), np.full((seen.size, width), NEVER)
    for port, box in enumerate(system.ports):
        rows = np.flatnonzero(channel == port)
        time = requested[good][rows]
        number[rows], earliest[rows] = _stored(system, box, cpus, loops, sent, lost, wrong, time)
    views = Views(seen, number, earliest)
    paths: tuple[Views, ...] = ()
    if system.polled == "both":
        paths = tuple(Views(*(c[channel == port] for c in views)) for port in (0, 1))
        views = freshest(views, channel)
    return Run(
        system, wrong, until, span[1], attempts, tuple(cpus), tuple(loops), sent, views, paths
    )


def _lost(
    system: System,
    loops: Sequence[Rounds],
    faults: Sequence[EngineFault],
    rng: np.random.Generator | None,
) -> Bools | None:
    """Return a mask of the frames that each box loses, shape (n_boxes, n_messages, n_rounds)."""
    random = [fault for fault in faults if isinstance(fault, LostCanFrames)]
    if not random or rng is None:
        return None
    counts = [loop.work.size for loop in loops]
    lost = np.zeros((len(system.boxes), system.sender.size, max(counts)), dtype=bool)
    for fault in random:
        box = system.boxes.index(fault.where)
        begin, stop = fault.span
        due = (loops[box].queued >= begin) & (loops[box].queued < stop)
        for message in np.flatnonzero(system.sender == box):
            chance = rng.random((len(system.boxes), counts[box]))
            lost[:, message, : counts[box]] |= (chance < fault.probability) & due
    return lost


def _stored(
    system: System,
    box: int,
    cpus: Sequence[Cpu],
    loops: Sequence[Rounds],
    sent: Frames,
    lost: Bools | None,
    faults: Sequence[EngineFault],
    time: Integers,
) -> tuple[Integers, Integers]:
    """Return what a box has stored of each message at each `time` [ns]: two columns of `Views`."""
    cpu = cpus[box]
    rows = sent.heard_by(box, system)
    if lost is not None:
        rows = rows[~lost[box, sent.message[rows], sent.round[rows]]]
    work = nanoseconds(system.firmware.receive)
    read = cpu.at(cpu.queue(sent.arrival[rows], work) + work)
    number = np.full((time.size, system.sender.size), -1)
    earliest = np.full((time.size, system.sender.size), NEVER)
    hop = system.hop_ns(box)
    emptied = np.full(time.size, NEVER)
    for _, back in outages(faults, system.boxes[box], DeadBox):
        emptied = np.where(time >= back, back, emptied)
    for message, sender in enumerate(system.sender.tolist()):
        if sender == box:
            newer = np.flatnonzero(loops[box].converted > NEVER)
            done = loops[box].converted[newer]
        else:
            of_message = sent.message[rows] == message
            newer, done = sent.round[rows][of_message], read[of_message]
        newest = np.searchsorted(done, time, side="right") - 1
        there = newest >= 0
        if not there.any():
            continue
        when = np.where(there, done[newest], NEVER)
        there &= when >= emptied
        if sender != box and system.coding == "printed":
            # The timer marks all values of a sender; the first entry precedes all times.
            arrivals = read[system.sender[sent.message[rows]] == sender]
            left = marks(system, cpu, arrivals) + nanoseconds(system.firmware.mark)
            ends = np.append(NEVER, cpu.at(left))
            there &= when > ends[np.searchsorted(ends, time, side="right") - 1]
        number[there, message] = newer[newest][there]
        earliest[there, message] = when[there] - hop[message]
    return number, earliest


def freshest(views: Views, channel: Integers) -> Views:
    """Return the views after every response, each message from the channel with the newer data."""
    order = np.argsort(views.seen, kind="stable")
    seen, channel = views.seen[order], channel[order]
    number, earliest = views.number[order], views.earliest[order]
    rows = np.arange(seen.size)
    best_number, best_earliest = np.full_like(number, -1), np.full_like(earliest, NEVER)
    for port in (0, 1):
        newest = np.maximum.accumulate(np.where(channel == port, rows, -1))
        held = newest >= 0
        theirs = np.where(held[:, None], earliest[newest], NEVER)
        better = theirs > best_earliest
        best_earliest = np.where(better, theirs, best_earliest)
        best_number = np.where(better, number[newest], best_number)
    # Of responses that end at the same instant, the last one counts.
    last = np.append(seen[1:] > seen[:-1], True)[: seen.size]
    return Views(seen[last], best_number[last], best_earliest[last])


# Requests of the AMS --------------------------------------------------------------------------


def ask(
    system: System,
    horizon: int,
    phase: int,
    faults: Sequence[EngineFault],
    rng: np.random.Generator | None,
) -> Attempts:
    """Return the requests of all polls that begin before the `horizon`, the first at `phase` [ns].

    A later poll begins at the first whole number of poll periods after `phase` at which the
    previous poll has ended. If no response begins, the AMS continues after its time-out. If a
    response breaks off, the AMS continues when the response should have ended. A response whose
    beginning the AMS missed counts as silence.
    """
    lines = [_Line(system, channel, faults, horizon, rng) for channel in (0, 1)]
    if system.polled == "one":
        rows = _follow(system, horizon, phase, lines)
    else:
        rows = [row for line in lines for row in _follow(system, horizon, phase, [line])]
        rows.sort(key=lambda row: (row[2], row[1]))
    poll, channel, start, outcome, received = np.array(rows, dtype=np.int64).reshape(-1, 5).T
    return Attempts(poll, channel, start, outcome, received.astype(bool))


class _Line:
    """A channel and its faults."""

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
        self.breaks = outages(faults, name, ModbusBreak, DeadPort)
        self.deaths = outages(faults, box, DeadBox)
        self.losses = [f for f in faults if isinstance(f, LostModbusFrames) and f.where == name]
        request = system.poll.line.frame_time(8)
        # Times from the first bit of a request: its end, the interrupt that it causes, the first
        # and the last bit of the response, and when the AMS continues, with and without a response.
        self.sent = nanoseconds(request)
        self.read = nanoseconds(request + system.serial.t35)
        self.first = nanoseconds(request + system.shortest_timeout)
        self.last = nanoseconds(system.poll.time - system.serial.t35)
        self.answered = nanoseconds(system.poll.time)
        self.silent = nanoseconds(request + system.timeout)
        self.draws: Iterator[list[float]] = iter(())
        if self.losses and rng is not None:
            most = (horizon // nanoseconds(system.poll_period) + 2) * (1 + system.retries)
            self.draws = iter(rng.random((most, 2 * len(self.losses))).tolist())

    def ask(self, start: int) -> tuple[int, bool, int]:
        """Send a request; return its outcome, whether it was received, and when the AMS continues.

        A cable must be intact while it carries a frame; a box must work from the request onwards.
        """
        first, last = start + self.first, start + self.last
        damaged = missed = silent = False
        for begin, stop in self.breaks:
            missed |= begin < start + self.sent and start < stop
            silent |= begin <= first < stop
            damaged |= begin < last and first < stop
        for begin, stop in self.deaths:
            missed |= begin <= start + self.read and start < stop
            silent |= begin <= first and start < stop
            damaged |= begin < last and first < stop
        if self.losses:
            chances: list[float] = next(self.draws)
            for fault, request, response in zip(
                self.losses, chances[::2], chances[1::2], strict=True
            ):
                begin, stop = fault.span
                missed |= begin <= start < stop and request < fault.request
                damaged |= begin <= first < stop and response < fault.response
        if missed or silent:
            return 1, not missed, start + self.silent
        return (2 if damaged else 0), True, start + self.answered


def _follow(
    system: System, horizon: int, phase: int, lines: list[_Line]
) -> list[tuple[int, int, int, int, bool]]:
    """Return the requests on one line, or on two lines of which the AMS uses one at a time."""
    period = nanoseconds(system.poll_period)
    rows = []
    number, now, order = 0, phase, lines
    while now < horizon:
        for line in order:
            for _ in range(1 + system.retries):
                outcome, received, then = line.ask(now)
                rows.append((number, line.channel, now, outcome, received))
                now = then
                if outcome == 0:
                    break
            if outcome == 0:
                # The next poll starts on the channel that responded.
                if line is not order[0]:
                    order = order[::-1]
                break
        number = max(number + 1, -((phase - now) // period))
        now = phase + number * period
    return rows


# Frames of the boxes ---------------------------------------------------------------------------


def rounds(
    system: System,
    box: int,
    cpu: Cpu,
    span: tuple[int, int],
    phase: int,
    faults: Sequence[EngineFault],
) -> Rounds:
    """Return the rounds of a box due in a span, at whole periods before or after `phase` [ns]."""
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


def islands(system: System, faults: Sequence[EngineFault], time: int) -> list[list[int]]:
    """Return the boxes in each part of the bus at `time` [ns]; boxes off the bus are left out."""

    def out(where: str, *kinds: type[EngineFault]) -> bool:
        return any(a <= time < b for a, b in outages(faults, where, *kinds))

    part = list(range(len(system.boxes)))
    for index, segment in enumerate(system.segments):
        ends = index, (index + 1) % len(part)
        if not out(segment, CanBreak):
            # The bus runs through each box, even if the box is dead.
            old, new = part[ends[1]], part[ends[0]]
            part = [new if p == old else p for p in part]
    able = [k for k, box in enumerate(system.boxes) if not out(box, DeadBox, BusOff)]
    groups = [[k for k in able if part[k] == p] for p in sorted(set(part))]
    return [group for group in groups if group]


def send(
    system: System, loops: Sequence[Rounds], span: tuple[int, int], faults: Sequence[EngineFault]
) -> Frames:
    """Return all frames that some other box receives in a span [ns], with worst-case stuffing.

    When a cable, a box or a controller fails or recovers, all frames queued or on the bus are
    lost; the next round replaces them.
    """
    from shipnet.can import bus

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
            last = np.cumsum(np.bincount(message[rows], minlength=system.sender.size))
            release = np.insert(queued[rows], last, end) - begin
            first = np.r_[0, last] + np.arange(system.sender.size + 1)
            steps = release.size * system.sender.size / 2
            start = bus.send.run(steps, release, first, system.frame_ns, end - begin)
            start = np.delete(start, first[1:] - 1)
            gap = round(INTERMISSION * 1e9 / system.can_bit_rate)
            arrival = begin + start + system.frame_ns[message[rows]] - gap
            keep = (start >= 0) & (arrival <= end)
            rows, start, arrival = rows[keep], start[keep] + begin, arrival[keep]
            mask = np.full(rows.size, sum(1 << k for k in members), dtype=np.int64)
            parts.append((message[rows], number[rows], start, arrival, mask))
    if not parts:
        return Frames(*(np.zeros(0, dtype=np.int64) for _ in range(5)))
    return Frames(*(np.concatenate(column) for column in zip(*parts, strict=True)))


# Faults of the system, by simulation -----------------------------------------------------------


def single_failures(
    system: System,
    faults: EngineFault | Iterable[EngineFault] | None = None,
    *,
    trials: int = 5,
    rng: Any = 2024,
) -> pd.DataFrame:
    """Return the effect of each fault alone: bounds for all phases, and results for random phases.

    Parameters
    ----------
    system : System
        The system.
    faults : fault or iterable of faults, optional
        Faults from `shipnet.engine.faults`; `System.single_faults` if not given.
    trials : int, default 5
        Number of simulations of each fault, 1..1000.
    rng : optional
        Source of random phases and losses, for `numpy.random.default_rng`.

    Returns
    -------
    pandas.DataFrame
        One row per fault, after a first row ``none``: ``lost`` (points without a value newer than
        the fault while it lasts), ``old`` (points shown as good although older than 2 s),
        ``oldest_s`` (greatest age shown as good; infinite if it grows without limit during a
        lasting fault), ``bound_s`` (bound on ``oldest_s`` in any phase; infinite if none is known),
        ``marked`` (points ever marked), ``marked_after_s`` (longest time from the fault until the
        last of these points was first marked; NaN if none), ``noticed`` (alarms of the AMS:
        ``link``, ``path``, ``mark`` or ``no``), ``answer_s`` (longest time to a response),
        ``answer_ok`` and ``age_ok`` (whether the bounds on this time and the age are at most 2 s).

    Notes
    -----
    The bounds and the verdicts come from `System.failure_bounds`; all other columns come from the
    simulations and use the true ages of values, which are not available to the AMS.

    Examples
    --------
    >>> from shipnet import engine
    >>> dead = engine.faults.DeadBox("JB2", start=10)
    >>> table = engine.single_failures(engine.System(), dead, trials=2)
    >>> table[["lost", "marked", "noticed", "answer_ok", "age_ok"]].values.tolist()
    [[0, 0, 'no', True, True], [18, 18, 'mark', True, False]]
    """
    trials = check_whole("trials", trials, 1, 1000)
    chance = check_rng(rng)
    chosen = system.single_faults() if faults is None else system.check_faults(faults)
    # A run must last until two polls after the last mark.
    settled = max(system.staleness_flag().after, RULE) + 3 * system.poll_period
    rows = []
    for fault in track((None, *chosen), "single failures"):
        runs = []
        start, stop = (10.0, inf) if fault is None else (fault.start, fault.stop)
        end = start + max(2 * settled, _LENGTH) if stop == inf else stop + settled
        for _ in range(trials):
            # A random delay avoids a special phase relation between the fault and the clocks.
            late = float(chance.uniform(0, system.poll_period))
            moved = [] if fault is None else [replace(fault, start=start + late, stop=stop + late)]
            runs.append(simulate(system, faults=moved, until=end, rng=chance))
        rows.append(_fault_row(system, fault, runs))
    return pd.DataFrame(rows).set_index("fault")


def _fault_row(system: System, fault: EngineFault | None, runs: Sequence[Run]) -> dict[str, object]:
    """Return the effect of a fault as a row of `single_failures`."""
    try:
        answer_bound, _, oldest_bound = system.failure_bounds(fault)
    except ArgumentError:
        answer_bound = oldest_bound = inf
    worst = np.max([run.table()["worst_s"] for run in runs], axis=0)
    marked = np.max([run.table()["marked_s"] for run in runs], axis=0) > 0
    lost, growing = (np.zeros(worst.size, dtype=bool) for _ in range(2))
    after = []
    for run in runs:
        begin = inf
        if run.faults:
            begin, end = run.faults[0].start, min(run.faults[0].stop, run.end / 1e9)
            gone = _unseen(run, begin, end)
            lost |= gone
            if run.faults[0].stop == inf:
                growing |= gone & (run.table()["good_until_s"] == run.end / 1e9).to_numpy()
        alarms = run.alarms()
        marks = alarms[(alarms["time_s"] >= begin) & alarms["kind"].isin(["0xFF", "too old"])]
        after.append(marks.groupby("source")["time_s"].min().max() - begin)
    kinds = {kind for run in runs for kind in run.alarms()["kind"]}
    words = {"link": {"no answer"}, "path": {"path lost"}, "mark": {"0xFF", "too old"}}
    noticed = [word for word, raised in words.items() if kinds & raised]
    return {
        "fault": "none" if fault is None else str(fault),
        "lost": int(lost.sum()),
        "old": int((worst > RULE).sum()),
        "oldest_s": inf if growing.any() else float(np.nanmax(worst)),
        "bound_s": oldest_bound,
        "marked": int(marked.sum()),
        "marked_after_s": float(np.fmax.reduce(after)),
        "noticed": ", ".join(noticed) or "no",
        "answer_s": float(max(run.answers()["answer_s"].max() for run in runs)),
        "answer_ok": answer_bound <= RULE,
        "age_ok": oldest_bound <= RULE,
    }


def _unseen(run: Run, begin: float, end: float) -> Bools:
    """Return a mask of the points that show no value newer than the fault while it lasts."""
    shown = [run._shown(index) for index in range(len(run.system.points))]
    # The values of a stuck sensor date from exactly the nanosecond at which it became stuck.
    first, last = nanoseconds(begin), nanoseconds(end)
    newer = [s.good & (s.sampled > first) & (s.seen <= last) for s in shown]
    return np.asarray(~np.any(newer, axis=1))
