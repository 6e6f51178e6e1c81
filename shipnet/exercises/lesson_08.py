"""Exercises of lesson 8: redundancy, switch-over and class rules."""

from __future__ import annotations

from collections.abc import Sequence

from shipnet.engine.system import RULE
from shipnet.exercises.answers import Function, Number, Whole
from shipnet.exercises.exercise import ANY, Solution, solution
from shipnet.modbus.faults import Break
from shipnet.modbus.pdu import Request
from shipnet.modbus.polling import Poll
from shipnet.modbus.redundancy import Loop
from shipnet.modbus.uart import SerialLine

_LINE = SerialLine(9600)
_STATUS = Request.read_input_registers(0x4020, 4)
_POLL = Poll(_STATUS, _LINE)
_REQUEST = _LINE.frame_time(8)


def _lost(n: int, cuts: Sequence[int]) -> int:
    return len(Loop(n, _POLL).reach([Break(section) for section in cuts]).lost)


@solution("ex-08-1", "lost_1", n=range(32, 41), first=range(10, 14), second=range(16, 19))
def between_cuts(n: int, first: int, second: int) -> Solution:
    """Number of valves lost if a loop is cut twice."""
    return Whole(_lost(n, [first, second]), "valves"), {
        "those are the valves that still answer": n - second + first,
        "port B still reaches the valves after the second cut": n - first,
        "which port reaches valve `first`?": second - first + 1,
        "does a port reach valve `first` + 1, or valve `second`?": second - first - 1,
        "List the valves that port A reaches, and those that port B reaches; count the others": ANY,
    }


@solution(
    "ex-08-2",
    "oldest_s",
    period=(0.5, 1.0, 2.0),
    timeout=range(120, 221, 20),
    retries=(2, 3),
    age=(0.3, 0.4, 0.6, 0.7),
)
def oldest(period: float, timeout: int, retries: int, age: float) -> Solution:
    """Age of the values on the screen when the first response on the second cable ends."""

    def old(retries: int) -> float:
        poll = Poll(_STATUS, _LINE, timeout=timeout / 1e3, retries=retries)
        return age + period + poll.timeout_time

    right = old(retries)
    return Number(right, "s"), {
        "that is the gap; how old were the values when it began?": right - age,
        "how long is it until the next request? The cut came just after a response": right - period,
        "each retry takes another request and another time-out": old(0),
        "each failed try takes a request and a time-out: how long is the request?": (
            right - (1 + retries) * _REQUEST
        ),
        "count from the end of one response to the end of the next": (right + _POLL.time),
        "the first try fails too: how many requests are sent on the first cable?": old(retries - 1),
        "`retries` requests follow the first one: how many are sent on the first cable?": (
            old(retries + 1)
        ),
        "Draw the time from one response to the next: first a pause, then each failed try": ANY,
    }


#: Loops for tests: no cut, one, two; cuts at both ports, out of order, and in the same place.
_TRIED: list[tuple[int, list[int]]] = [
    (40, []),
    (40, [12]),
    (40, [12, 30]),
    (40, [40, 0]),
    (25, [20, 3, 11]),
    (247, [100, 100]),
    (30, [8, 20, 3]),
]


@solution("ex-08-3", "lost_valves")
def lost_valves() -> Solution:
    """Number of valves lost if a loop is cut any number of times."""
    return Function(_lost, _TRIED, lambda right: Whole(right, "valves")), {
        "that is for an open line; in a loop, port B reaches the valves after the last cut": (
            lambda n, cuts: n - min(cuts, default=n)
        ),
        "the cuts may be listed in any order": lambda n, cuts: cuts[-1] - cuts[0] if cuts else 0,
        "there may be more than two cuts": (
            lambda n, cuts: abs(cuts[1] - cuts[0]) if len(cuts) > 1 else 0
        ),
        "the valve just before the first cut is still connected to port A": (
            lambda n, cuts: max(cuts) - min(cuts) + 1 if len(cuts) > 1 else 0
        ),
        "one cut may disconnect several valves, or none": lambda n, cuts: len(cuts),
        "port A reaches the valves before the first cut": lambda n, cuts: max(cuts, default=0),
        "a loop without a cut loses no valve": lambda n, cuts: max(cuts) - min(cuts) if cuts else n,
        "Draw ten valves in a loop cut after 3 and 7, then also after 5: which are lost?": ANY,
    }


@solution("ex-08-4", "timeout_ms", n=range(20, 46))
def timeout(n: int) -> Solution:
    """Time-out with which one scan and two failed polls take exactly the 2 s of the rule."""
    left = RULE - _POLL.scan_time(n)
    return Number(1e3 * (left / 2 - _REQUEST), "ms"), {
        "how many failed polls can one cut cause before all valves downstream use port B?": 1e3
        * (left - _REQUEST),
        "the scan of answered polls takes time too": 1e3 * (RULE / 2 - _REQUEST),
        "a failed poll takes longer than its time-out: the request has to be sent": 1e3 * left / 2,
        "one cut causes two failed polls at most, not three": 1e3 * (left / 3 - _REQUEST),
        "in the scan every valve answers: how long is an answered poll?": (
            1e3 * ((RULE - n * _REQUEST) / 2 - _REQUEST)
        ),
        "that is the time for both failed polls, requests included": 1e3 * left,
        "Write the 2 s as a sum: one scan, plus how many times a request and a time-out?": ANY,
    }
