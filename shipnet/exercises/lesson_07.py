"""Exercises of lesson 7: ring buffers and state machines."""

from __future__ import annotations

from collections.abc import Callable

from shipnet.exercises.answers import Function, Number, Whole
from shipnet.exercises.exercise import Exercise
from shipnet.remote_control.ring_buffer import Ring, State

_SIZE, _CHARACTER = 128, 10


def _shown(ring: dict[str, int]) -> int:
    """Return what the variables show, by bringing a ring into that state."""
    found, wanted = Ring(_SIZE, "corrected"), State(**ring)
    while found.state[2:] != wanted[2:]:
        found.store(0)
        found.extract()
    while found.state != wanted:
        found.store(0)
    return found.seems_unread


def _rings() -> tuple[dict[str, int], ...]:
    """Return states whose bytes lie across the end of the ring."""
    places = ((7, 95), (12, 101), (19, 110), (24, 118), (33, 106), (38, 123), (5, 88), (27, 99))
    return tuple(
        {"no": no, "ring_f": 1 - k % 2, "get_no": get_no, "ring_get_f": k % 2}
        for k, (no, get_no) in enumerate(places)
    )


def _full_ms(places: int, rate: int) -> float:
    """Return how long unbroken bytes need to fill a ring."""
    return 1e3 * places * _CHARACTER / rate


def _empty_again_ms(places: int, rate: int) -> float:
    ring, stored = Ring(places), 0
    while ring.seems_unread or not stored:
        ring.store(0)
        stored += 1
    return 1e3 * stored * _CHARACTER / rate


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


def _never_read(events: str, size: int) -> int:
    return max(0, events.count("w") - events.count("r"))


#: Nothing; just full; one too many; a read of nothing before; losses before and behind a read.
_TRIED = [("", 4), ("wwww", 4), ("wwwww", 4), ("rrwwwww", 4), ("wwwrwwww", 4), ("w" * 300, 128)]


def _needed(rate: int, pause_ms: int, waiting: int) -> int:
    return waiting + rate * pause_ms // (1000 * _CHARACTER)


def _places(rate: int, pause_ms: int, waiting: int) -> int:
    """Return the smallest ring of a power of two that loses nothing."""
    places, events = 1, "w" * _needed(rate, pause_ms, waiting)
    while places < 2 or _lost(events, places):
        places *= 2
    return places


EXERCISES = (
    Exercise(
        "ex-07-1",
        draws={"ring": _rings()},
        answer=lambda ring: Whole(_shown(ring), "bytes"),
        traps={
            "a distance below zero: what do the different flags say?": lambda ring: (
                ring["no"] - ring["get_no"]
            ),
            "that is the free part; the writer is ahead, across the end": lambda ring: (
                ring["get_no"] - ring["no"]
            ),
            "one round of the ring too many": lambda ring: _shown(ring) + _SIZE,
        },
    ),
    Exercise(
        "ex-07-2",
        draws={"places": (32, 64, 128, 256), "rate": (600, 1200, 2400, 4800, 9600)},
        answer=lambda places, rate: Number(_empty_again_ms(places, rate), "ms"),
        traps={
            "then it is full; when do the flags come back as well?": _full_ms,
            "a byte takes 10 bits on this line": lambda places, rate: (
                0.8 * _empty_again_ms(places, rate)
            ),
        },
    ),
    Exercise(
        "ex-07-3",
        answer=lambda: Function(_lost, _TRIED, lambda right: Whole(right, "bytes")),
        traps={
            "that many are not read yet; how many of them are still there?": lambda: _never_read,
            "a ring of size places holds size bytes": lambda: _counting(-1),
            "an empty ring gives nothing; the number that waits does not fall below 0": lambda: (
                _counting(0, -1000)
            ),
        },
    ),
    Exercise(
        "ex-07-4",
        # Without what waits already, the next smaller power of two would do.
        draws={"rate": (4800, 9600, 19200), "pause_ms": (125, 250), "waiting": (33, 36, 39, 42)},
        answer=lambda rate, pause_ms, waiting: Whole(_places(rate, pause_ms, waiting), "places"),
        traps={
            "that holds what comes in the pause; some bytes wait already": (
                lambda rate, pause_ms, waiting: _places(rate, pause_ms, 0)
            ),
            "enough, but no power of two": _needed,
        },
    ),
)
