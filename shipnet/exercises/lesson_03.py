"""Exercises of lesson 3: frames, and the errors that their checks detect or miss."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import combinations, pairwise
from math import ceil, log2
from random import Random

from shipnet.asi.telegram import frame
from shipnet.exercises.answers import Bits, Function, Whole
from shipnet.exercises.exercise import ANY, Solution, solution

_TURNED = str.maketrans("01", "10")


# Palindromes such as 0110 are left out: they would hide a wrong order.
@solution(
    "ex-03-1", "telegram", bits=tuple(f"{data:04b}" for data in range(1, 15) if data not in (6, 9))
)
def telegram(bits: str) -> Solution:
    """Telegram with the given data bits."""
    right = frame(bits)
    parity = right[-2]
    return Bits(right), {
        "count the ones again: without the end bit, their number must be even": (
            right[:-2] + parity.translate(_TURNED) + "1"
        ),
        "are the data bits those given, in the same order?": frame(bits[::-1]),
        "what value does the start bit always have?": "1" + right[1:],
        "what value does the end bit always have?": right[:-1] + "0",
        "Write the start bit, data and end bit first; then count the ones without the end bit": ANY,
    }


#: The generators of exercise 2, each the reverse of the other.
_GENERATORS = ("10011", "11001")


def _remainder(row: str, generator: str) -> str:
    """Divide without carries; return the remainder, one bit shorter than the generator."""
    width = len(generator) - 1
    left = int(row, 2)
    for shift in reversed(range(len(row) - width)):
        if left >> (shift + width) & 1:
            left ^= int(generator, 2) << shift
    return f"{left:0{width}b}"


def _check_bits(bits: str, generator: str) -> str:
    return _remainder(bits + "0" * (len(generator) - 1), generator)


def _mistaken(bits: str, generator: str) -> set[str]:
    """Return the results of typical mistakes; too many of the 16 words to name each in a hint."""
    wrong_zeros = {_remainder(bits + zeros, generator) for zeros in ("", "000", "00000")}
    with_carries = f"{int(bits + '0000', 2) % int(generator, 2):04b}"
    return {*wrong_zeros, with_carries, _check_bits(bits, generator[::-1])}


#: Bits for which no mistake gives the right check bits, with either generator.
_MESSAGES = tuple(
    bits
    for bits in (f"{k:06b}" for k in range(33, 64))
    if all(_check_bits(bits, one) not in _mistaken(bits, one) for one in _GENERATORS)
)


@solution("ex-03-2", "four_bits", bits=_MESSAGES, generator=_GENERATORS)
def check_bits(bits: str, generator: str) -> Solution:
    """Check bits of a CRC."""
    return Bits(_check_bits(bits, generator)), {
        "Append four zeros. Write the generator under the first 1 and subtract, repeatedly": ANY,
    }


def _differences(one: str, other: str) -> int:
    return sum(a != b for a, b in zip(one, other, strict=True))


def _between(pairs: Iterable[tuple[str, str]]) -> list[int]:
    return [_differences(one, other) for one, other in pairs]


def _distance(words: Sequence[str]) -> int:
    """Return the smallest number of places in which two of the words differ."""
    return min(_between(combinations(words, 2)))


#: Sets of words for tests: two words; nearest words not adjacent; responses of a slave; a word and
#: its inverse; then random sets, for which a function that compares only some pairs fails.
_TRIED = [
    (["000", "111"],),
    (["0000", "1111", "0001"],),
    ([frame(f"{data:04b}") for data in (0, 3, 5, 8)],),
    (["010101", "101010", "011001"],),
    *(
        ([f"{word:08b}" for word in Random(seed).sample(range(256), 3 + seed % 4)],)
        for seed in range(20)
    ),
]


@solution("ex-03-3", "distance")
def distance() -> Solution:
    """Hamming distance of the given words."""
    return Function(_distance, _TRIED, lambda right: Whole(right, "places")), {
        "0 for different words? Compare no word with itself, and do not start the smallest at 0": (
            lambda words: 0
        ),
        "compare all pairs, not only neighbours": lambda words: min(_between(pairwise(words))),
        "compare all pairs, not only neighbours after sorting": (
            lambda words: min(_between(pairwise(sorted(words))))
        ),
        "what about the pairs without the first word?": (
            lambda words: min(_between((words[0], other) for other in words[1:]))
        ),
        "that is for the pair that differs most; which pair counts?": (
            lambda words: max(_between(combinations(words, 2)))
        ),
        "that is the number of wrong bits that are always detected; what is the distance?": (
            lambda words: _distance(words) - 1
        ),
        "Count by hand for every pair of these words: in how many places do they differ?": ANY,
    }


@solution("ex-03-4", "crc_bits", hits=(5, 8, 10, 20, 30, 40), years=(5, 10, 20, 25))
def crc_width(hits: int, years: int) -> Solution:
    """Width of the shortest CRC that misses, on average, fewer than one bad message in `years`."""
    messages = hits * 365 * years
    width = ceil(log2(messages))
    return Whole(width, "bits"), {
        "compute how many messages pass with that many bits: is it fewer than one?": width - 1,
        "the number of bits must be whole: round up or down?": log2(messages),
        "that is the number of messages; with n check bits, one in how many passes?": messages,
        "with one bit less, does still fewer than one message pass?": width + 1,
        "How many messages are hit in total? What fraction passes with one check bit?": ANY,
    }
