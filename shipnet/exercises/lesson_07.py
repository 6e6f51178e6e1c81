"""Exercises of lesson 7: ring buffers and state machines."""

from __future__ import annotations

from collections.abc import Callable

from shipnet.exercises.answers import Function, Number, Whole
from shipnet.exercises.exercise import Solution, solution
from shipnet.remote_control.ring_buffer import Ring, State

_SIZE, _CHARACTER = 128, 10

#: States whose bytes lie across the end of the ring.
_RINGS = tuple(
    {"no": no, "ring_f": 1 - k % 2, "get_no": get_no, "ring_get_f": k % 2}
    for k, (no, get_no) in enumerate(
        ((7, 95), (12, 101), (19, 110), (24, 118), (33, 106), (38, 123), (5, 88), (27, 99))
    )
)


@solution("ex-07-1", ring=_RINGS)
def unread(ring: dict[str, int]) -> Solution:
    """What the variables show, by bringing a ring into that state."""
    found, wanted = Ring(_SIZE, "corrected"), State(**ring)
    while found.state[2:] != wanted[2:]:
        found.store(0)
        found.extract()
    while found.state != wanted:
        found.store(0)
    return Whole(found.seems_unread, "bytes"), {
        "a distance below zero: what do the different flags say?": ring["no"] - ring["get_no"],
        "that is the free part; the writer is ahead, across the end": ring["get_no"] - ring["no"],
        "one round of the ring too many": found.seems_unread + _SIZE,
    }


@solution("ex-07-2", places=(32, 64, 128, 256), rate=(600, 1200, 2400, 4800, 9600))
def empty_again(places: int, rate: int) -> Solution:
    """When a ring that nobody reads looks empty again."""
    ring, stored = Ring(places), 0
    while ring.seems_unread or not stored:
        ring.store(0)
        stored += 1
    right = 1e3 * stored * _CHARACTER / rate
    return Number(right, "ms"), {
        "then it is full; when do the flags come back as well?": 1e3 * places * _CHARACTER / rate,
        "a byte takes 10 bits on this line": 0.8 * right,
    }


def _lost(events: str, size: int) -> int:
    ring = Ring(size, "corrected")
    for event in events:
        if event == "w":
            ring.store(0)
        elif ring.extract().action == "repair":
            ring.extract()
    # What is overwritten is lost, whether or not the reader has come to it.
    return ring.lost + max(0, ring.unread - size)


def _counting(most: int, least: int = 0) -> Callable[[str, int], int]:
    """Return a function that lets up to size + most bytes wait, and down to least."""

    def lost_bytes(events: str, size: int) -> int:
        waiting = lost = 0
        for event in events:
            if event == "r":
                waiting = max(least, waiting - 1)
            elif waiting < size + most:
                waiting += 1
            else:
                lost += 1
        return lost

    return lost_bytes


#: Nothing; just full; one too many; a read of nothing before; losses before and behind a read.
_TRIED = [("", 4), ("wwww", 4), ("wwwww", 4), ("rrwwwww", 4), ("wwwrwwww", 4), ("w" * 300, 128)]


@solution("ex-07-3")
def lost_bytes() -> Solution:
    """Bytes that are lost by writes and reads in some order."""
    return Function(_lost, _TRIED, lambda right: Whole(right, "bytes")), {
        "that many are not read yet; how many of them are still there?": (
            lambda events, size: max(0, events.count("w") - events.count("r"))
        ),
        "a ring of size places holds size bytes": _counting(-1),
        "an empty ring gives nothing; the number that waits does not fall below 0": (
            _counting(0, -1000)
        ),
    }


def _places(needed: int) -> int:
    """Return the smallest ring of a power of two that loses nothing."""
    places = 2
    while _lost("w" * needed, places):
        places *= 2
    return places


# Without what waits already, the next smaller power of two would do.
@solution("ex-07-4", rate=(4800, 9600, 19200), pause_ms=(125, 250), waiting=(33, 36, 39, 42))
def ring_size(rate: int, pause_ms: int, waiting: int) -> Solution:
    """Places of a ring that holds what comes in a pause and what waits already."""
    coming = rate * pause_ms // (1000 * _CHARACTER)
    return Whole(_places(waiting + coming), "places"), {
        "that holds what comes in the pause; some bytes wait already": _places(coming),
        "enough, but no power of two": waiting + coming,
    }
