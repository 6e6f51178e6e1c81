"""What the boxes tell each other: their loops, the CAN bus between them, who hears what and when.

The frames are arbitrated one by one, by the simulator of `shipnet.can.bus`, as a simulation needs
the actual times; the worst ones, by response-time analysis, are in `shipnet.engine.age`.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from shipnet.can.bus import Releases, send_all
from shipnet.can.frame import INTERMISSION
from shipnet.engine.faults import BusOff, CutCan, DeadBox, Fault, outages
from shipnet.engine.firmware import Cpu
from shipnet.engine.system import System

__all__ = ["Frames", "Rounds", "islands", "rounds", "send"]

Integers = npt.NDArray[np.int64]

#: A round, or a step of it, that did not happen.
NEVER = -1 << 62

#: Frames that the bus simulator gets at a time.
_CHUNK = 200_000


class Rounds(NamedTuple):
    """Rounds of the loop of one box, by number; `NEVER` for steps that did not happen.

    Attributes
    ----------
    work : ndarray of int64, shape (n_rounds,)
        CPU time left by the interrupts at which each round begins [ns], for `Cpu.at`.
    converted : ndarray of int64, shape (n_rounds,)
        When its values are in the box's own table [ns].
    queued : ndarray of int64, shape (n_rounds,)
        When its frames ask for the bus [ns].
    """

    work: Integers
    converted: Integers
    queued: Integers


def rounds(
    system: System, box: int, cpu: Cpu, span: tuple[int, int], phase: int, faults: Sequence[Fault]
) -> Rounds:
    """Return the rounds of the loop of a box.

    Parameters
    ----------
    system : System
        The system.
    box : int
        Number of the box.
    cpu : Cpu
        Its CPU.
    span : tuple of int
        First and last time of a begin [ns].
    phase : int
        A time at which a round begins [ns].
    faults : sequence of Fault
        What goes wrong; a dead box counts.

    Returns
    -------
    Rounds
        The rounds. A dead box begins none and ends none.

    Examples
    --------
    >>> found = rounds(System(), 1, Cpu([], 1), (0, 10**9), 0, [])
    >>> found.converted.tolist(), found.queued.tolist()
    ([17664000, 517664000, 1017664000], [18164000, 518164000, 1018164000])
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

    Attributes
    ----------
    message, round : ndarray of int64, shape (n_frames,)
        Which message, and which round of its sender's loop.
    start, arrival : ndarray of int64, shape (n_frames,)
        First bit, and end without the intermission [ns].
    hearers : ndarray of int64, shape (n_frames,)
        Bit k is set if box k is on the same part of the bus.
    """

    message: Integers
    round: Integers
    start: Integers
    arrival: Integers
    hearers: Integers


def islands(system: System, faults: Sequence[Fault], time: int) -> list[list[int]]:
    """Return which boxes hear each other at a time.

    Parameters
    ----------
    system : System
        The system.
    faults : sequence of Fault
        What goes wrong.
    time : int
        The time [ns].

    Returns
    -------
    list of list of int
        Numbers of the boxes of each part of the bus; a box off the bus is in none.

    Examples
    --------
    >>> islands(System(), [CutCan("JB1-JB2")], 0)
    [[0], [1, 2]]
    >>> islands(System(topology="ring"), [CutCan("JB1-JB2")], 0)
    [[0, 1, 2]]
    """

    def out(where: str, *kinds: type[Fault]) -> bool:
        return any(a <= time < b for a, b in outages(faults, where, *kinds))

    part = list(range(len(system.boxes)))
    for place, segment in enumerate(system.segments):
        ends = place, (place + 1) % len(part)
        if not out(segment, CutCan):
            # The cable runs through a box, whether that is alive or not.
            old, new = part[ends[1]], part[ends[0]]
            part = [new if p == old else p for p in part]
    able = [k for k, box in enumerate(system.boxes) if not out(box, DeadBox, BusOff)]
    groups = [[k for k in able if part[k] == p] for p in sorted(set(part))]
    return [group for group in groups if group]


def send(
    system: System, loops: Sequence[Rounds], span: tuple[int, int], faults: Sequence[Fault]
) -> Frames:
    """Return what goes over the bus.

    Parameters
    ----------
    system : System
        The system.
    loops : sequence of Rounds
        Rounds of every box.
    span : tuple of int
        Begin and end of the time to look at [ns].
    faults : sequence of Fault
        What goes wrong.

    Returns
    -------
    Frames
        All frames that somebody else hears.

    Notes
    -----
    When a cable, a box or a controller fails or returns, all that is queued or on the bus is
    lost; the next round replaces it. Every frame is as long as its worst stuffing makes it.

    Examples
    --------
    >>> system = System()
    >>> loops = [rounds(system, box, Cpu([], 1), (0, 10**9), 0, []) for box in range(3)]
    >>> found = send(system, loops, (0, 10**9), [])
    >>> found.message.size, int(found.arrival.max()) < 10**9
    (44, True)
    """
    message = np.repeat(
        np.arange(system.sender.size), [loops[b].queued.size for b in system.sender]
    )
    number = np.concatenate([np.arange(loops[b].queued.size) for b in system.sender])
    queued = np.concatenate([loops[b].queued for b in system.sender])
    kinds = (CutCan, DeadBox, BusOff)
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
