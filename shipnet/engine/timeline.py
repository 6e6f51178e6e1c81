"""Who works when: CPUs of the boxes, CAN bus, Modbus lines; figures 5 and 6 of lee2012 in time."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from shipnet.clock import nanoseconds
from shipnet.engine.exchange import NEVER
from shipnet.engine.result import Run
from shipnet.errors import ArgumentError
from shipnet.fields import check_scalar

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["timeline"]

Integers = npt.NDArray[np.int64]
_Slices = list[tuple[int, int, str]]


def timeline(run: Run, start: float, stop: float) -> pd.DataFrame:
    """Return what each CPU and each line does in a stretch of time.

    Parameters
    ----------
    run : Run
        What `simulate` returned.
    start, stop : float
        From when to when, 60 s at most [s].

    Returns
    -------
    pandas.DataFrame
        One row a stretch of work: ``row`` (a box, ``CAN``, ``channel 1`` or ``channel 2``),
        ``task`` (``convert``, ``send``, ``CAN``, ``timer``, ``Modbus``; a box whose frame is on
        the bus; ``request``, ``response``), ``start_ms`` and ``end_ms``.

    Raises
    ------
    ArgumentError
        If the times are out of order or of range.

    Notes
    -----
    Where a CPU is not listed it waits. The CAN routine runs while the loop waits for the
    multiplexer, so it cuts the conversion in two without making it longer; a Modbus interrupt
    makes it longer. Frames that are lost by overrun are shown as if they were taken over.

    Examples
    --------
    Box 2 converts its 16 inputs, is heard by both others, and nothing interrupts it but they:

    >>> from shipnet.engine.simulation import simulate
    >>> from shipnet.engine.system import System
    >>> phases = {"JB1": 0.1, "JB2": 0.2, "JB3": 0.3}
    >>> found = timeline(simulate(System(), 2, phases=phases), 0.2, 0.3)
    >>> found[found.row == "JB2"].round(2).values.tolist()
    [['JB2', 'convert', 200.0, 217.66], ['JB2', 'send', 217.66, 218.16]]
    """
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
    return pd.DataFrame(table, columns=["row", "task", "start_ms", "end_ms"])


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
