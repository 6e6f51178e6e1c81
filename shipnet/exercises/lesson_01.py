"""Exercises of lesson 1: bits on a wire."""

from __future__ import annotations

from itertools import pairwise

from shipnet.asi.modulation import Modulation
from shipnet.exercises.answers import Bits, Function, Number, Whole
from shipnet.exercises.exercise import Solution, solution


# Neither the same backwards, nor the opposite: each mistake gives another row.
@solution("ex-01-1", bits=("0010", "0100", "1011", "1101", "0001", "1000", "0111", "1110"))
def levels(bits: str) -> Solution:
    """Levels that bits make on the line."""
    return Bits("".join(map(str, Modulation(bits).levels))), {}


@solution("ex-01-2", n_bits=range(7, 22), rate=(50, 125, 200, 250, 400))
def telegram_time(n_bits: int, rate: int) -> Solution:
    """How long a telegram is at a rate in kbit/s."""
    return Number(1e3 * n_bits / rate, "us"), {
        "the last bit takes its time too: n bits last n bit times": 1e3 * (n_bits - 1) / rate,
        "that is one bit; how long is the whole telegram?": 1e3 / rate,
    }


#: Telegrams to try a function on; the shortest, no pulse between, all between, two real ones.
_TRIED = [("0",), ("01",), ("00",), ("0011001",), ("00101010111011",)]


def _pulses(bits: str) -> int:
    return Modulation(bits).pulses.count


def _between_different(bits: str) -> int:
    """Count pulses as somebody does who puts the extra ones between different bits."""
    return 2 * len(bits) - 1 - sum(a == b for a, b in pairwise(bits))


@solution("ex-01-3")
def pulses() -> Solution:
    """How many pulses a telegram has."""
    return Function(_pulses, _TRIED, lambda right: Whole(right, "pulses")), {
        "a pulse in the middle of each bit is not all: what stands between two equal bits?": len,
        "count again where the extra pulses stand: between equal bits, or different ones?": (
            _between_different
        ),
    }


@solution("ex-01-4", limit=range(400, 1201, 80))
def highest_rate(limit: int) -> Solution:
    """What bit rate has its first zero at a frequency in kHz."""
    return Number(limit / 4, "kbit/s"), {
        "the zero lies at 2 over a half-bit, and a bit has two of them": limit / 2,
        "that is the limit itself; how many bits go with it?": limit,
    }
