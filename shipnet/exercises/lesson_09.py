"""Exercises of lesson 9: rules, ramps and persistence."""

from __future__ import annotations

from functools import cache, partial
from typing import Any

import numpy as np

from shipnet.ballast.rule_table import rule_base
from shipnet.exercises.answers import Bits, Choices, Function, Number, Table
from shipnet.exercises.exercise import Exercise

_BASE = rule_base()

#: Readings for which two rules or more hold: the order is FP, OP, MC, OT, VPos, DVPos.
_STATES = (
    (128, 3.2, 3.1, 50, 40, 0),
    (127, 1.2, 3.4, 50, 40, 0),
    (1.8, 1.4, 0.7, 50, 40, 0),
    (124, 4.1, 0, 50, 20, 0),
    (0, 0, 0, 45, 103, 0),
    (0, 0, 0, 95, -3, 0.4),
    (60, 3.1, 1.2, 93, -3, 2),
)

#: Windows of the design.
_WINDOWS = (5, 10, 20)


def _codes(readings: dict[str, float]) -> tuple[str, ...]:
    return _BASE.decide(readings, method="crisp").codes()


def _degrees(FP: float, OP: float) -> tuple[float, float]:
    high = (_BASE[name]["high"].membership(x) for name, x in (("FP", FP), ("OP", OP)))
    one, other = map(float, high)
    return one, other


@cache
def _persistent(fires: str, k: int, n: int) -> str:
    """Let a hot motor fire as given, and see when its code is active."""
    hot = {"OT": np.where(np.array(list(fires)) == "1", 100, 20)}
    active = _BASE.decide(hot, k=k, n=n).active[:, _BASE.codes.index("O1")]
    return "".join(map(str, active.astype(int)))


def _windows(fires: str, n: int, last: int = 0) -> list[str]:
    """Return the `n` readings before each place, those up to `last` places behind it left out."""
    return [fires[max(0, i + 1 - last - n) : max(0, i + 1 - last)] for i in range(len(fires))]


def _more_than(fires: str, k: int, n: int) -> str:
    return "".join(str(int(part.count("1") > k)) for part in _windows(fires, n))


def _in_a_row(fires: str, k: int, n: int) -> str:
    return "".join(str(int("1" * k in part)) for part in _windows(fires, n))


def _before(fires: str, k: int, n: int) -> str:
    return "".join(str(int(part.count("1") >= k)) for part in _windows(fires, n, last=1))


def _ahead(fires: str, k: int, n: int) -> str:
    return "".join(str(int(fires[i : i + n].count("1") >= k)) for i in range(len(fires)))


#: Readings to try a function on: one, none fires, all fire, a gap, a flicker.
_TRIED = [
    ("1", 1, 1),
    ("0000", 1, 3),
    ("11111", 3, 5),
    ("0110100", 2, 3),
    ("0101011100100", 3, 5),
    ("1101110111", 3, 4),
]


def _least(burst: int, period: int, n: int) -> int:
    """Return the least k of n that is not active while bursts go on for ever."""
    bursts = ("1" * burst + "0" * (period - burst)) * 20
    return next(k for k in range(1, n + 1) if "1" not in _persistent(bursts, k, n))


def _rows(burst: int, period: int, step: int, *, late: int = 0) -> list[dict[str, Any]]:
    rows = []
    for n in _WINDOWS:
        k = _least(burst, period, n)
        first = _persistent("1" * n, k, n).index("1")
        rows.append({"n": n, "k": k, "delay": (first + late) * step})
    return rows


def _one_burst(burst: int, period: int, step: int) -> list[dict[str, Any]]:
    return [{"n": n, "k": burst + 1, "delay": burst * step} for n in _WINDOWS]


def _one_less(burst: int, period: int, step: int) -> list[dict[str, Any]]:
    rows = _rows(burst, period, step, late=-1)
    return [{**row, "k": row["k"] - 1} for row in rows]


EXERCISES = (
    Exercise(
        "ex-09-1",
        draws={"readings": tuple(dict(zip(_BASE.names, x, strict=True)) for x in _STATES)},
        answer=lambda readings: Choices(frozenset(_codes(readings)), _BASE.codes),
        traps={
            "that is the first in rank only; asked for is every rule that holds": lambda readings: (
                frozenset(_codes(readings)[:1])
            ),
        },
    ),
    Exercise(
        "ex-09-2",
        # No two memberships are equal, so that each mistake gives another number.
        draws={"FP": (116, 118, 122, 124), "OP": (2.25, 2.45, 2.65, 2.85)},
        answer=lambda FP, OP: Number(min(_degrees(FP, OP))),
        traps={
            "that is the product; a chain is as strong as its weakest link": lambda FP, OP: float(
                np.prod(_degrees(FP, OP))
            ),
            "that is the mean; a strong term does not make up for a weak one": lambda FP, OP: float(
                np.mean(_degrees(FP, OP))
            ),
            "that is the stronger term; both must hold": lambda FP, OP: max(_degrees(FP, OP)),
        },
    ),
    Exercise(
        "ex-09-3",
        answer=lambda: Function(_persistent, _TRIED, Bits),
        traps={
            "k readings are enough: k or more, not more than k": lambda: _more_than,
            "the k readings need not stand in a row": lambda: _in_a_row,
            "the reading itself is the last of the n": lambda: _before,
            "the window ends with this reading; it does not begin with it": lambda: _ahead,
            "that is what fires now; count over the last n readings": lambda: (
                lambda fires, k, n: fires
            ),
        },
    ),
    Exercise(
        "ex-09-4",
        draws={"burst": (2, 3), "period": (6, 7, 8), "step": (50, 100, 200)},
        answer=lambda burst, period, step: Table(_rows(burst, period, step), {"delay": "ms"}),
        traps={
            "a long window holds more than one burst: count again in the longer ones": _one_burst,
            "with this k the bursts themselves are an alarm: one more is needed": _one_less,
            "the first reading that fires already counts: how long from it to the last of the k?": (
                partial(_rows, late=1)
            ),
        },
    ),
)
