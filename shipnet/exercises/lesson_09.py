"""Exercises of lesson 9: rules, ramps and persistence."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import cache
from itertools import product
from typing import Any

import numpy as np

from shipnet.ballast.rule_table import rule_base
from shipnet.exercises.answers import Bits, Function, Table, Words
from shipnet.exercises.exercise import ANY, Solution, solution

_BASE = rule_base()


def _firing(readings: Mapping[str, Any], method: str) -> list[list[str]]:
    """Return, for each set of readings, the codes of the rules whose strength is above zero."""
    fired = np.atleast_2d(_BASE.fire(readings, method=method).strength) > 0
    return [[code for code, fires in zip(_BASE.codes, row, strict=True) if fires] for row in fired]


def _cases() -> tuple[dict[str, float], ...]:
    """Return readings for which 2 to 4 rules hold; ramps, or `_any_of`, give a different list."""
    values = ((1.8, 118, 128), (0, 1.2, 4.1), (0, 2.3, 3.4), (50, 86, 95), (-3, 40, 103), (0, 2))
    every = np.array(list(product(*values)))
    readings = dict(zip(_BASE.names, every.T, strict=True))
    hold, ramps = _firing(readings, "crisp"), _firing(readings, "fuzzy")
    rows = (dict(zip(_BASE.names, row, strict=True)) for row in every.tolist())
    return tuple(
        each
        for each, crisp, fuzzy in zip(rows, hold, ramps, strict=True)
        if 2 <= len(crisp) <= 4 and crisp not in (fuzzy, _any_of(each))
    )


def _any_of(readings: dict[str, float]) -> list[str]:
    """Return the rules with at least one comparison that holds."""
    return [
        rule.code
        for rule in _BASE.rules
        if any(_BASE[name][word].crisp.contains(readings[name]) for name, word in rule.antecedent)
    ]


@solution("ex-09-1", "codes", readings=_cases())
def codes(readings: dict[str, float]) -> Solution:
    """Rules that hold for the given readings."""
    held = list(_BASE.decide(readings, method="crisp").codes())
    return Words(frozenset(held), _BASE.codes), {
        "that is only the highest-ranked rule; list every rule that holds": frozenset(held[:1]),
        "that is only the lowest-ranked rule; list every rule that holds": frozenset(held[-1:]),
        "in these rules at least one comparison holds; all comparisons must hold": (
            frozenset(_any_of(readings))
        ),
        "not all of these hold without ramps: what are the printed thresholds?": frozenset(
            _firing(readings, "fuzzy")[0]
        ),
        "these rules do not hold; which ones do?": frozenset(_BASE.codes) - frozenset(held),
        "some rules hold: compare the readings with the thresholds, row by row": frozenset(),
        "Go through the table row by row: a rule holds only if all its comparisons hold": ANY,
    }


# No two memberships are equal, so each mistake gives a different number.
@solution("ex-09-2", "V1", FP=(116, 118, 119, 122, 124), OP=(2.25, 2.45, 2.65, 2.85))
def strength(FP: float, OP: float) -> Solution:
    """Whether a rule with two terms holds as printed, and its firing strength with ramps."""
    terms = [float(_BASE[name]["high"].membership(x)) for name, x in (("FP", FP), ("OP", OP))]
    holds = int(_BASE.fire({"FP": FP, "OP": OP}, method="crisp")["V1"])

    def row(ramps: float, printed: int = holds) -> list[dict[str, float]]:
        return [{"printed": printed, "ramps": ramps}]

    return Table(row(min(terms))), {
        "as printed, the rule holds only if both comparisons hold": row(min(terms), 1 - holds),
        "your `ramps` is the product; the weaker term decides": row(float(np.prod(terms))),
        "your `ramps` is the mean; a strong term does not compensate for a weak one": row(
            float(np.mean(terms))
        ),
        "your `ramps` is the stronger term; both terms must apply": row(max(terms)),
        "your `ramps` is the sum; the weaker term decides": row(sum(terms)),
        "your `ramps` is 1 minus the weaker term": row(1 - min(terms)),
        "For `printed`, test both comparisons; for `ramps`, how far along is each reading?": ANY,
    }


@cache
def _persistent(fires: str, k: int, n: int) -> str:
    """Return, as 0s and 1s, when the hot-motor code is active if its rule fires as in `fires`."""
    hot = {"OT": np.where(np.array(list(fires)) == "1", 100, 20)}
    active = _BASE.decide(hot, k=k, n=n).active[:, _BASE.codes.index("O1")]
    return "".join(map(str, active.astype(int)))


def _marks(flags: Iterable[bool]) -> str:
    return "".join("1" if one else "0" for one in flags)


def _windows(fires: str, n: int, last: int = 0) -> list[str]:
    """Return, for each reading, the window of at most `n` that ends `last` readings before it."""
    return [fires[max(0, i + 1 - last - n) : max(0, i + 1 - last)] for i in range(len(fires))]


#: One reading; the rule fires never, always or with gaps; fewer readings than the window.
_TRIED = [
    ("1", 1, 1),
    ("0000", 1, 3),
    ("11111", 3, 5),
    ("0110100", 2, 3),
    ("0101011100100", 3, 5),
    ("1101110111", 3, 4),
    ("11", 1, 5),
]


@solution("ex-09-3", "persistent")
def persistence() -> Solution:
    """Readings for which a code is active if its rule fires intermittently."""
    return Function(_persistent, _TRIED, Bits), {
        "k readings are enough; you seem to require more than k": (
            lambda fires, k, n: _marks(part.count("1") > k for part in _windows(fires, n))
        ),
        "the k readings need not be consecutive": (
            lambda fires, k, n: _marks("1" * k in part for part in _windows(fires, n))
        ),
        "the current reading is the last of the n": (
            lambda fires, k, n: _marks(part.count("1") >= k for part in _windows(fires, n, last=1))
        ),
        "the window ends with this reading; it does not begin with it": (
            lambda fires, k, n: _marks(fires[i : i + n].count("1") >= k for i in range(len(fires)))
        ),
        "those are the readings; count the 1s among the last n": lambda fires, k, n: fires,
        "which of k and n is the window's length, and which is how often the rule must fire?": (
            lambda fires, k, n: _marks(part.count("1") >= n for part in _windows(fires, k))
        ),
        "Write the last n readings below each reading, and count the 1s": ANY,
    }


@solution("ex-09-4", "windows", burst=(2, 3), period=(6, 7, 8), step=(50, 100, 200, 250))
def windows(burst: int, period: int, step: int) -> Solution:
    """Smallest k with which bursts raise no alarm, and the resulting delay, for each window."""
    bursts = ("1" * burst + "0" * (period - burst)) * 20
    rows = []
    for n in (5, 10, 20):
        k = next(k for k in range(1, n + 1) if "1" not in _persistent(bursts, k, n))
        rows.append({"n": n, "k": k, "delay": _persistent("1" * n, k, n).index("1") * step})
    return Table(rows, {"delay": "ms"}), {
        "a long window contains more than one burst: count again in the longer windows": [
            {**row, "k": burst + 1, "delay": burst * step} for row in rows
        ],
        "with these values of `k` the bursts raise an alarm: each `k` must be one larger": [
            {**row, "k": row["k"] - 1, "delay": row["delay"] - step} for row in rows
        ],
        "the first reading of the fault counts too: how many steps later is the k-th?": [
            {**row, "delay": row["delay"] + step} for row in rows
        ],
        "the alarm need not wait until the window is full": [
            {**row, "delay": (row["n"] - 1) * step} for row in rows
        ],
        "your `delay` is in steps; how long is a step?": [
            {**row, "delay": row["delay"] / step} for row in rows
        ],
        "For `k`, slide a window along the bursts; for `delay`, count steps to reading k": ANY,
    }
