"""The whole system in simulated time: what the AMS knows of every point after every poll.

Time is a whole number of nanoseconds from the start of the AMS; the boxes have run before.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np
import numpy.typing as npt

from shipnet.clock import nanoseconds
from shipnet.engine.age import hop_ns, poll_spacing
from shipnet.engine.ams import ask
from shipnet.engine.exchange import NEVER, Frames, Rounds, rounds, send
from shipnet.engine.faults import DeadBox, Fault, LostCan, LostModbus, check_faults, outages
from shipnet.engine.firmware import Cpu
from shipnet.engine.result import Run, Views
from shipnet.engine.system import System
from shipnet.errors import ArgumentError
from shipnet.fields import check_scalar

__all__ = ["simulate"]

Integers = npt.NDArray[np.int64]

#: Most frames that one run may send, and the AMS read: some gigabytes of memory. A poll reads all
#: of them.
_MOST_FRAMES = 20_000_000


def simulate(
    system: System,
    duration: float,
    *,
    faults: Iterable[Fault] = (),
    phases: Mapping[str, float] | None = None,
    rng: np.random.Generator | None = None,
) -> Run:
    """Simulate the system from the first poll on.

    Parameters
    ----------
    system : System
        The system.
    duration : float
        The last poll begins before this time, 0.001..1e6 [s].
    faults : iterable of Fault, optional
        What goes wrong.
    phases : mapping of str to float, optional
        When a round of each box begins, and under ``"AMS"`` the first poll, 0..100 [s]. What is
        not named begins at 0, or at random if there is an `rng`: no two clocks are in step.
    rng : numpy.random.Generator, optional
        Chance; needed if frames get lost.

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

    >>> run = simulate(System(), 20, faults=[DeadBox("JB2", start=10)])
    >>> run.alarms[["time_s", "kind"]].drop_duplicates().round(2).values.tolist()
    [[14.25, '0xFF']]
    >>> run.table.groupby("box")["worst_s"].max().round(2).to_dict()
    {'JB1': 1.75, 'JB2': 4.75, 'JB3': 1.75}
    """
    horizon = nanoseconds(check_scalar("duration", duration, "s", 1e-3, 1e6))
    wrong = check_faults(system, faults)
    if rng is not None and not isinstance(rng, np.random.Generator):
        raise ArgumentError(f"rng is {rng!r}; it must be a numpy.random.Generator")
    if rng is None and any(isinstance(fault, LostCan | LostModbus) for fault in wrong):
        raise ArgumentError("rng is None; frames are lost at random, so there must be one")
    begins = _phases(system, phases or {}, rng)
    frames = sum(horizon / period for period in system.period_ns[system.sender].tolist())
    polls = duration / poll_spacing(system) * (2 if system.polled == "both" else 1)
    frames += polls * system.sender.size
    if frames > _MOST_FRAMES:
        raise ArgumentError(
            f"duration is {duration} s, in which {frames:.0f} frames are sent and read; they must "
            f"be {_MOST_FRAMES} at most"
        )
    attempts = ask(system, horizon, begins["AMS"], wrong, rng)
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
    lost = _lost(system, [loop.work.size for loop in loops], loops, wrong, rng)
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
    return Run(system, span[1], wrong, attempts, tuple(cpus), tuple(loops), sent, views, paths)


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
    faults: Sequence[Fault],
    rng: np.random.Generator | None,
) -> npt.NDArray[np.bool_] | None:
    """Return what each box does not hear, shape (n_boxes, n_messages, n_rounds)."""
    random = [fault for fault in faults if isinstance(fault, LostCan)]
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
        faults: Sequence[Fault],
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
        hop = hop_ns(system, box)
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
