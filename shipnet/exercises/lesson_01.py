"""Exercises of lesson 1: bits on a wire."""

from __future__ import annotations

from itertools import pairwise

from shipnet.asi.modulation import Modulation
from shipnet.exercises.answers import Bits, Function, Number, Whole
from shipnet.exercises.exercise import ANY, Solution, solution

_TURNED = str.maketrans("01", "10")

#: Five-bit words except palindromes and 11110, for which a mistake gives the right levels.
_WORDS = tuple(
    word for word in (f"{k:05b}" for k in range(32)) if word != word[::-1] and word != "11110"
)


def _levels(bits: str) -> str:
    return "".join(map(str, Modulation(bits).levels))


@solution("ex-01-1", "levels_1", bits=_WORDS)
def levels(bits: str) -> Solution:
    """Levels of the given bits on the line."""
    right = _levels(bits)
    return Bits(right), {
        "in the middle of the bit, a 0 falls and a 1 rises; do yours?": right.translate(_TURNED),
        "that is one level per bit; how many half-bits does a bit have?": bits,
        "these are plain levels: what changes within a bit?": "".join(2 * bit for bit in bits),
        "Take one bit at a time: which level does a 0 start with, and which does a 1?": ANY,
    }


@solution("ex-01-2", "time_us", n_bits=range(15, 29), rate=(50, 125, 200, 250, 400))
def telegram_time(n_bits: int, rate: int) -> Solution:
    """Duration of a telegram of equal bits, which has no edges, at a rate in kbit/s."""
    right = 1e3 * n_bits / rate
    return Number(right, "us"), {
        "the last bit takes time too: n bits last n bit times": right - 1e3 / rate,
        "that is one bit time; what if the next bit is the same?": 1e3 / rate,
        "`n_bits` counts bits, not bytes": 8 * right,
        "more bits take longer: what is divided by what?": rate / n_bits,
        "a higher rate makes a telegram shorter, not longer": n_bits * rate,
        "6 us is the bit time of AS-i; this bus has another rate": 6 * n_bits,
        "14 bits are the telegram in the lesson; how many has yours?": 14e3 / rate,
        "plain levels have no half-bits": right / 2,
        "Which data give no edge at all? Start with one bit: how long does it last?": ANY,
    }


#: Telegrams for tests: the shortest ones, with and without extra pulses, and realistic ones.
_TRIED = [("0",), ("01",), ("00",), ("0011001",), ("00101010111011",), ("0111",)]


def _equal(bits: str) -> int:
    return sum(a == b for a, b in pairwise(bits))


@solution("ex-01-3", "count_pulses")
def pulses() -> Solution:
    """Number of pulses in a telegram."""
    return Function(
        lambda bits: Modulation(bits).pulses.count, _TRIED, lambda right: Whole(right, "pulses")
    ), {
        "those are the pulses in the middle of the bits; what happens between two equal bits?": len,
        "where are the extra pulses: between equal or between different bits?": (
            lambda bits: 2 * len(bits) - 1 - _equal(bits)
        ),
        "those are the pulses between bits; what happens in the middle of each bit?": _equal,
        "equal pairs may overlap: how many does `000` have?": (
            lambda bits: len(bits) + bits.count("00") + bits.count("11")
        ),
        "is there really a pulse after every bit?": lambda bits: 2 * len(bits),
        "does your loop include the last two bits?": lambda bits: len(bits) + _equal(bits[:-1]),
        "two consecutive ones have a pulse between them, too": (
            lambda bits: len(bits) + sum(a == b == "0" for a, b in pairwise(bits))
        ),
        "Draw the pulses of `00` and `01` on paper: where do they differ?": ANY,
    }


@solution("ex-01-4", "rate_kbit", limit=range(400, 1201, 40))
def highest_rate(limit: int) -> Solution:
    """Bit rate at which the first zero of a pulse's spectrum is at `limit` [kHz]."""
    return Number(limit / 4, "kbit/s"), {
        "one of two factors of 2 is missing: in the half-bit time, or in the bit time?": limit / 2,
        "that is the limit itself; how long are a half-bit and a bit?": limit,
        "did you divide by 2 once too often?": limit / 8,
        "the limit is 2 divided by the half-bit time, so the bit rate is lower": 2 * limit,
        "that is the half-bit time in us; what bit rate follows from it?": 2e3 / limit,
        "that is the bit time in us; what bit rate follows from it?": 4e3 / limit,
        "Go step by step: from the limit to the half-bit time, the bit time and the bit rate": ANY,
    }
