"""Exercises of lesson 3: frames, and what the checks of a frame find and miss."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import combinations, pairwise
from math import ceil, log2

from shipnet.asi.telegram import frame
from shipnet.exercises.answers import Bits, Function, Whole
from shipnet.exercises.exercise import Exercise

#: The generator of exercise 2, and zeros for the check bits that it makes.
_GENERATOR, _ROOM = "1011", "000"

#: Bits of exercise 2: the mistakes below give something else for each, and the reverse too.
_MESSAGES = (
    *("100001", "100010", "100101", "100110", "101001", "101010", "101101", "101110"),
    *("110000", "110011", "110100", "110111", "111000", "111011", "111100", "111111"),
)


def _parity_flipped(bits: str) -> str:
    telegram = frame(bits)
    return telegram[:-2] + "10"[int(telegram[-2])] + telegram[-1]


def _remainder(row: str, generator: str = _GENERATOR) -> str:
    """Return what a division without carries leaves, one bit less than the generator has."""
    width = len(generator) - 1
    left = int(row, 2)
    for place in reversed(range(len(row) - width)):
        if left >> (place + width) & 1:
            left ^= int(generator, 2) << place
    return f"{left:0{width}b}"


def _differences(one: str, other: str) -> int:
    return sum(a != b for a, b in zip(one, other, strict=True))


def _distance(words: Sequence[str]) -> int:
    """Return in how many places two of the words differ at least."""
    return min(_differences(one, other) for one, other in combinations(words, 2))


def _neighbours(words: Sequence[str]) -> int:
    return min(_differences(one, other) for one, other in pairwise(words))


def _with_itself(words: Sequence[str]) -> int:
    return min(_differences(one, other) for one in words for other in words)


def _function(distance: Callable[[Sequence[str]], int]) -> Callable[[], Callable[..., int]]:
    return lambda: distance


#: Sets of words to try: two words, no neighbours the nearest, answers of a slave, opposites.
_TRIED = [
    (["000", "111"],),
    (["0000", "1111", "0001"],),
    ([frame(f"{data:04b}") for data in (0, 3, 5, 8)],),
    (["010101", "101010", "011001"],),
]


def _width(hits: int, years: int) -> int:
    """Return the fewest bits of a CRC with which fewer than one hit message passes."""
    return ceil(log2(hits * 365 * years))


EXERCISES = (
    Exercise(
        "ex-03-1",
        # None is the same backwards: the wrong order gives another telegram.
        draws={"bits": tuple(f"{data:04b}" for data in range(1, 15) if data not in (6, 9))},
        answer=lambda bits: Bits(frame(bits)),
        traps={
            "count the ones again: without the end bit, their number must be even": _parity_flipped,
            "in which order do the data stand? As they are given": lambda bits: frame(bits[::-1]),
        },
    ),
    Exercise(
        "ex-03-2",
        draws={"bits": _MESSAGES},
        answer=lambda bits: Bits(_remainder(bits + _ROOM)),
        traps={
            "make room first: three zeros behind the bits, then divide": lambda bits: _remainder(
                bits
            ),
        },
    ),
    Exercise(
        "ex-03-3",
        answer=lambda: Function(_distance, _TRIED, lambda right: Whole(right, "places")),
        traps={
            "a word differs from itself nowhere: compare different words only": _function(
                _with_itself
            ),
            "neighbours in the list are not all pairs": _function(_neighbours),
        },
    ),
    Exercise(
        "ex-03-4",
        draws={"hits": (5, 8, 10, 20, 30, 40), "years": (5, 10, 20, 25)},
        answer=lambda hits, years: Whole(_width(hits, years), "bits"),
        traps={
            "with so few bits more than one passes: round up": lambda hits, years: (
                _width(hits, years) - 1
            ),
            "the hits are counted in a day: how many are they in all the years?": (
                lambda hits, years: ceil(log2(hits * years))
            ),
            "so many messages are hit; with how many check bits does one in so many pass?": (
                lambda hits, years: hits * 365 * years
            ),
        },
    ),
)
