"""Exercises of lesson 9: rules, ramps and persistence."""

from __future__ import annotations

from functools import cache

import numpy as np

from shipnet.ballast.rule_table import rule_base
from shipnet.exercises.answers import Bits, Choices, Function, Number, Table
from shipnet.exercises.exercise import Solution, solution

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


@solution("ex-09-1", readings=tuple(dict(zip(_BASE.names, x, strict=True)) for x in _STATES))
def codes(readings: dict[str, float]) -> Solution:
    """Rules that hold for some readings."""
    found = _BASE.decide(readings, method="crisp").codes()
    return Choices(frozenset(found), _BASE.codes), {
        "that is the first in rank only; asked for is every rule that holds": frozenset(found[:1]),
    }


# No two memberships are equal, so that each mistake gives another number.
@solution("ex-09-2", FP=(116, 118, 122, 124), OP=(2.25, 2.45, 2.65, 2.85))
def strength(FP: float, OP: float) -> Solution:
    """Firing strength of a rule with two terms."""
    terms = [float(_BASE[name]["high"].membership(x)) for name, x in (("FP", FP), ("OP", OP))]
    return Number(min(terms)), {
        "that is the product; a chain is as strong as its weakest link": float(np.prod(terms)),
        "that is the mean; a strong term does not make up for a weak one": float(np.mean(terms)),
        "that is the stronger term; both must hold": max(terms),
    }


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


@solution("ex-09-3")
def persistence() -> Solution:
    """When a code is active that fires now and then."""
    return Function(_persistent, _TRIED, Bits), {
        "k readings are enough: k or more, not more than k": _more_than,
        "the k readings need not stand in a row": _in_a_row,
        "the reading itself is the last of the n": _before,
        "the window ends with this reading; it does not begin with it": _ahead,
        "that is what fires now; count over the last n readings": lambda fires, k, n: fires,
    }


@solution("ex-09-4", burst=(2, 3), period=(6, 7, 8), step=(50, 100, 200))
def windows(burst: int, period: int, step: int) -> Solution:
    """Least k of each window that bursts do not make active, and the delay that it costs."""
    bursts = ("1" * burst + "0" * (period - burst)) * 20
    rows = []
    for n in (5, 10, 20):
        k = next(k for k in range(1, n + 1) if "1" not in _persistent(bursts, k, n))
        rows.append({"n": n, "k": k, "delay": _persistent("1" * n, k, n).index("1") * step})
    return Table(rows, {"delay": "ms"}), {
        "a long window holds more than one burst: count again in the longer ones": [
            {**row, "k": burst + 1, "delay": burst * step} for row in rows
        ],
        "with this k the bursts themselves are an alarm: one more is needed": [
            {**row, "k": row["k"] - 1, "delay": row["delay"] - step} for row in rows
        ],
        "the first reading that fires already counts: how long from it to the last of the k?": [
            {**row, "delay": row["delay"] + step} for row in rows
        ],
    }
