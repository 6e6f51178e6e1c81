"""Exercises of lesson 1: bits on a wire."""

from __future__ import annotations

from itertools import pairwise

from shipnet.asi.modulation import Modulation
from shipnet.exercises.answers import Bits, Function, Number, Whole
from shipnet.exercises.exercise import Exercise


def _levels(bits: str) -> str:
    return "".join(map(str, Modulation(bits).levels))


def _pulses(bits: str) -> int:
    return Modulation(bits).pulses.count


def _telegram_time(n_bits: int, rate: float) -> float:
    return 1e3 * n_bits / rate


def _equal_pairs(bits: str) -> int:
    return sum(a == b for a, b in pairwise(bits))


#: Telegrams to try a function on; the shortest, no pulse between, all between, two real ones.
_TRIED = [("0",), ("01",), ("00",), ("0011001",), ("00101010111011",)]

EXERCISES = (
    Exercise(
        "ex-01-1",
        # Neither the same backwards, nor the opposite: each mistake gives another row.
        draws={"bits": ("0010", "0100", "1011", "1101", "0001", "1000", "0111", "1110")},
        answer=lambda bits: Bits(_levels(bits)),
    ),
    Exercise(
        "ex-01-2",
        draws={"n_bits": range(7, 22), "rate": (50, 125, 200, 250, 400)},
        answer=lambda n_bits, rate: Number(_telegram_time(n_bits, rate), "us"),
        traps={
            "the last bit takes its time too: n bits last n bit times": lambda n_bits, rate: (
                _telegram_time(n_bits - 1, rate)
            ),
            "that is one bit; how long is the whole telegram?": lambda n_bits, rate: _telegram_time(
                1, rate
            ),
        },
    ),
    Exercise(
        "ex-01-3",
        answer=lambda: Function(_pulses, _TRIED, lambda right: Whole(right, "pulses")),
        traps={
            "a pulse in the middle of each bit is not all: what stands between two equal bits?": (
                lambda: len
            ),
            "count again where the extra pulses stand: between equal bits, or different ones?": (
                lambda: lambda bits: 2 * len(bits) - 1 - _equal_pairs(bits)
            ),
        },
    ),
    Exercise(
        "ex-01-4",
        draws={"limit": range(400, 1201, 80)},
        answer=lambda limit: Number(limit / 4, "kbit/s"),
        traps={
            "the zero lies at 2 over a half-bit, and a bit has two of them": lambda limit: (
                limit / 2
            ),
            "that is the limit itself; how many bits go with it?": lambda limit: limit,
        },
    ),
)
