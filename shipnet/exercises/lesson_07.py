"""Exercises of lesson 7: ring buffers and state machines."""

from __future__ import annotations

from collections.abc import Callable

from shipnet.exercises.answers import Function, Number, Whole
from shipnet.exercises.exercise import ANY, Solution, solution
from shipnet.remote_control.ring_buffer import Ring, State

_SIZE, _CHARACTER = 128, 10

#: States in which the unread bytes continue from the last place of the ring to the first.
_RINGS = tuple(
    {"no": 4 + 11 * k % 37, "ring_f": 1 - k % 2, "get_no": 88 + 17 * k % 40, "ring_get_f": k % 2}
    for k in range(24)
)


@solution("ex-07-1", "unread_1", ring=_RINGS)
def unread(ring: dict[str, int]) -> Solution:
    """Number of unread bytes that the variables of a ring indicate."""
    model, target = Ring(_SIZE, "corrected"), State(**ring)
    while model.state[2:] != target[2:]:
        model.store(0)
        model.extract()
    while model.state != target:
        model.store(0)
    return Whole(model.seems_unread, "bytes"), {
        "the difference is below zero: what do the different flags mean?": ring["no"]
        - ring["get_no"],
        "are those the unread bytes, or the free places?": ring["get_no"] - ring["no"],
        "that is one lap of the ring too many": model.seems_unread + _SIZE,
        "the bytes at `get_no` and at place 127 are unread, too": model.seems_unread - 1,
        "the byte at `no` has not been written yet": model.seems_unread + 1,
        "Draw the places as a circle and mark `no` and `get_no`: which bytes lie between?": ANY,
    }


@solution(
    "ex-07-2", "empty_again_ms", places=(32, 64, 128, 256), rate=(600, 1200, 2400, 4800, 9600)
)
def empty_again(places: int, rate: int) -> Solution:
    """Time after which a ring that is not read looks empty again."""
    ring, stored = Ring(places), 0
    while ring.seems_unread or not stored:
        ring.store(0)
        stored += 1
    right = 1e3 * stored * _CHARACTER / rate
    return Number(right, "ms"), {
        "at that time the ring is full; when are the flags equal again?": right / 2,
        "a byte takes 10 bits on this line": 0.8 * right,
        "a byte takes 10 bits on this line, and after one lap the ring is full": 0.4 * right,
        "these lines have no parity bit: 10 bits per byte": 1.1 * right,
        "the rate counts bits, not bytes": right / _CHARACTER,
        "that is one byte; how many bytes arrive?": 1e3 * _CHARACTER / rate,
        "After how many bytes do number and flag both repeat? How long does a byte take?": ANY,
    }


def _lost(events: str, size: int) -> int:
    ring = Ring(size, "corrected")
    for event in events:
        if event == "w":
            ring.store(0)
        elif ring.extract().action == "repair":
            ring.extract()
    # Also count unread bytes that are already overwritten but not yet skipped by the reader.
    return ring.lost + max(0, ring.unread - size)


def _counting(most: int, least: int = 0) -> Callable[[str, int], int]:
    """Return a `lost_bytes` that keeps its unread count in `least` .. ``size + most``."""

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


def _emptied(events: str, size: int) -> int:
    """Count lost bytes as if a write to a full ring emptied it first."""
    waiting = lost = 0
    for event in events:
        if event == "r":
            waiting = max(0, waiting - 1)
        elif waiting == size:
            waiting, lost = 1, lost + size
        else:
            waiting += 1
    return lost


#: No events, just full, one byte too many, reads when empty, losses after or before reads.
_TRIED = [
    ("", 4),
    ("wwww", 4),
    ("wwwww", 4),
    ("rrwwwww", 4),
    ("wwwrwwww", 4),
    ("w" * 300, 128),
    ("wwwwwrr", 4),
]


@solution("ex-07-3", "lost_bytes")
def lost_bytes() -> Solution:
    """Number of bytes lost in a sequence of writes and reads."""
    return Function(_lost, _TRIED, lambda right: Whole(right, "bytes")), {
        "that many are unread; how many of them are still in the ring?": (
            lambda events, size: max(0, events.count("w") - events.count("r"))
        ),
        "a ring of `size` places holds `size` bytes": _counting(-1),
        "a read of an empty ring changes nothing: the count of unread bytes stays at 0": (
            _counting(0, -1000)
        ),
        "some bytes are read between writes": lambda events, size: max(0, events.count("w") - size),
        "the order matters: a later read does not recover a lost byte": (
            lambda events, size: max(0, events.count("w") - events.count("r") - size)
        ),
        "a write to a full ring loses only the oldest byte": _emptied,
        "a full ring loses a byte with each write": lambda events, size: 0,
        "Count the unread bytes by hand, event by event: the count stays between 0 and `size`": ANY,
    }


def _places(needed: int) -> int:
    """Return the smallest ring size, a power of two, with which none of `needed` bytes is lost."""
    places = 2
    while _lost("w" * needed, places):
        places *= 2
    return places


# Without the bytes already waiting, the next smaller power of two would be enough.
@solution(
    "ex-07-4",
    "free_places",
    rate=(4800, 9600, 19200),
    pause_ms=(125, 250),
    waiting=(33, 36, 39, 42),
)
def free_places(rate: int, pause_ms: int, waiting: int) -> Solution:
    """Free places of the smallest ring for the waiting bytes and those that arrive in a pause."""
    coming = rate * pause_ms // (1000 * _CHARACTER)
    needed = waiting + coming
    size = _places(needed)
    return Whole(size - needed, "places"), {
        "that ring has room only for the bytes of the pause; some bytes are already waiting": (
            _places(coming) - coming
        ),
        "those are the bytes that need room; how many places are left?": needed,
        "that is the size of the ring; how many of its places are free?": size,
        "the next smaller power of two is enough": 2 * size - needed,
        "some bytes are already waiting and need room": size - coming,
        "a byte takes 10 bits on this line": _free(waiting + rate * pause_ms / 8000),
        "Compute the bytes that need room, the next power of two, and the free places": ANY,
    }


def _free(needed: float) -> float:
    return _places(int(needed)) - needed
