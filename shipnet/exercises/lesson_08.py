"""Exercises of lesson 8: redundancy, switch-over and class rules."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

from shipnet.engine.system import RULE
from shipnet.exercises.answers import Function, Number, Whole
from shipnet.exercises.exercise import Exercise
from shipnet.modbus.faults import Break
from shipnet.modbus.pdu import Request
from shipnet.modbus.polling import Poll
from shipnet.modbus.redundancy import DualChannel, Loop
from shipnet.modbus.uart import SerialLine

_LINE = SerialLine(9600)
_STATUS = Request.read_input_registers(0x4020, 4)
_POLL = Poll(_STATUS, _LINE)
_REQUEST = _LINE.frame_time(8)


def _lost(n: int, cuts: Sequence[int]) -> int:
    return len(Loop(n, _POLL).reach([Break(section) for section in cuts]).lost)


def _gap(period: float, timeout: float, retries: int) -> float:
    poll = Poll(_STATUS, _LINE, timeout=timeout / 1e3, retries=retries)
    return float(DualChannel(poll, period=period).worst_gap(Break(0))[0])


def _timeout(n: int, waits: int = 2) -> float:
    """Return the time-out with which a round and some waits take 2 s [ms]."""
    return 1e3 * ((RULE - _POLL.scan_time(n)) / waits - _REQUEST)


#: Loops to try a function on: whole, cut once, beside the ports, out of order, and one cut twice.
_TRIED: list[tuple[int, list[int]]] = [
    (40, []),
    (40, [12]),
    (40, [12, 30]),
    (40, [40, 0]),
    (25, [20, 3, 11]),
    (247, [100, 100]),
]

EXERCISES = (
    Exercise(
        "ex-08-1",
        draws={"n": range(32, 41), "first": range(10, 14), "second": range(16, 19)},
        answer=lambda n, first, second: Whole(_lost(n, [first, second]), "valves"),
        traps={
            "what lies beyond the second cut still hangs on port B": lambda n, first, second: (
                n - first
            ),
            "port B reaches those; which ones does no port reach?": (
                lambda n, first, second: n - second
            ),
            "port A reaches those; which ones does no port reach?": (
                lambda n, first, second: first
            ),
            "a cut behind a valve leaves this valve with those before it: one too many": (
                lambda n, first, second: second - first + 1
            ),
            "the valve in front of the second cut is lost as well: one too few": (
                lambda n, first, second: second - first - 1
            ),
        },
    ),
    Exercise(
        "ex-08-2",
        draws={"period": (0.5, 1.0, 2.0), "timeout": range(120, 221, 20), "retries": (2, 3)},
        answer=lambda period, timeout, retries: Number(_gap(period, timeout, retries), "s"),
        traps={
            "and how long until the master asks at all? The cut came just after an answer": (
                lambda period, timeout, retries: _gap(period, timeout, retries) - period
            ),
            "each retry waits for its own time-out": lambda period, timeout, retries: _gap(
                period, timeout, 0
            ),
            "each try in vain is a request and a time-out: how long is the request?": (
                lambda period, timeout, retries: (
                    _gap(period, timeout, retries) - (1 + retries) * _REQUEST
                )
            ),
            "from the end of one answer to the end of the next: both are sent in the same time": (
                lambda period, timeout, retries: _gap(period, timeout, retries) + _POLL.time
            ),
            "the first try is in vain too: how often does it ask on the first cable?": (
                lambda period, timeout, retries: _gap(period, timeout, retries - 1)
            ),
        },
    ),
    Exercise(
        "ex-08-3",
        answer=lambda: Function(_lost, _TRIED, lambda right: Whole(right, "valves")),
        traps={
            "that is a line; in a loop the far piece hangs on port B": lambda: (
                lambda n, cuts: n - min(cuts, default=n)
            ),
            "the cuts may come in any order": lambda: (
                lambda n, cuts: cuts[-1] - cuts[0] if cuts else 0
            ),
        },
    ),
    Exercise(
        "ex-08-4",
        draws={"n": range(20, 46, 5)},
        answer=lambda n: Number(_timeout(n), "ms"),
        traps={
            "how often can one cut be missed before all beyond it are moved?": partial(
                _timeout, waits=1
            ),
            "the round itself takes time too": lambda n: 1e3 * (RULE / 2 - _REQUEST),
            "a poll in vain is more than its time-out: the request has to be sent": lambda n: (
                _timeout(n) + 1e3 * _REQUEST
            ),
        },
    ),
)
