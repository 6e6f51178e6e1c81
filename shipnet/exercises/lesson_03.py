"""Exercises of lesson 3: frames, and what the checks of a frame find and miss."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations, pairwise
from math import ceil, log2

from shipnet.asi.telegram import frame
from shipnet.exercises.answers import Bits, Function, Whole
from shipnet.exercises.exercise import Solution, solution


# None is the same backwards: the wrong order gives another telegram.
@solution("ex-03-1", bits=tuple(f"{data:04b}" for data in range(1, 15) if data not in (6, 9)))
def telegram(bits: str) -> Solution:
    """The telegram that frames some bits."""
    right = frame(bits)
    return Bits(right), {
        "count the ones again: without the end bit, their number must be even": (
            right[:-2] + "10"[int(right[-2])] + right[-1]
        ),
        "in which order do the data stand? As they are given": frame(bits[::-1]),
    }


#: The generator of exercise 2, and zeros for the check bits that it makes.
_GENERATOR, _ROOM = "1011", "000"

#: Bits of exercise 2: the mistakes below give something else for each, and the reverse too.
_MESSAGES = (
    *("100001", "100010", "100101", "100110", "101001", "101010", "101101", "101110"),
    *("110000", "110011", "110100", "110111", "111000", "111011", "111100", "111111"),
)


def _remainder(row: str, generator: str = _GENERATOR) -> str:
    """Return what a division without carries leaves, one bit less than the generator has."""
    width = len(generator) - 1
    left = int(row, 2)
    for place in reversed(range(len(row) - width)):
        if left >> (place + width) & 1:
            left ^= int(generator, 2) << place
    return f"{left:0{width}b}"


@solution("ex-03-2", bits=_MESSAGES)
def check_bits(bits: str) -> Solution:
    """Check bits of a CRC."""
    return Bits(_remainder(bits + _ROOM)), {
        "make room first: three zeros behind the bits, then divide": _remainder(bits),
    }


def _differences(one: str, other: str) -> int:
    return sum(a != b for a, b in zip(one, other, strict=True))


def _distance(words: Sequence[str]) -> int:
    """Return in how many places two of the words differ at least."""
    return min(_differences(one, other) for one, other in combinations(words, 2))


#: Sets of words to try: two words, no neighbours the nearest, answers of a slave, opposites.
_TRIED = [
    (["000", "111"],),
    (["0000", "1111", "0001"],),
    ([frame(f"{data:04b}") for data in (0, 3, 5, 8)],),
    (["010101", "101010", "011001"],),
]


@solution("ex-03-3")
def distance() -> Solution:
    """Hamming distance of some words."""
    return Function(_distance, _TRIED, lambda right: Whole(right, "places")), {
        "a word differs from itself nowhere: compare different words only": (
            lambda words: min(_differences(one, other) for one in words for other in words)
        ),
        "neighbours in the list are not all pairs": (
            lambda words: min(_differences(one, other) for one, other in pairwise(words))
        ),
    }


@solution("ex-03-4", hits=(5, 8, 10, 20, 30, 40), years=(5, 10, 20, 25))
def crc_width(hits: int, years: int) -> Solution:
    """Fewest bits of a CRC with which fewer than one of the messages hit each day passes."""
    width = ceil(log2(hits * 365 * years))
    return Whole(width, "bits"), {
        "with so few bits more than one passes: round up": width - 1,
        "the hits are counted in a day: how many are they in all the years?": (
            ceil(log2(hits * years))
        ),
        "so many messages are hit; with how many check bits does one in so many pass?": (
            hits * 365 * years
        ),
    }
