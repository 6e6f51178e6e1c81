"""Firing strengths of all rules at once, from arrays of samples."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from functools import reduce
from math import inf
from operator import and_
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from shipnet.arrays import Bools, Floats, Integers
from shipnet.errors import ArgumentError
from shipnet.fields import check_whole
from shipnet.fuzzy.terms import Rule, Variable
from shipnet.lazy import pd

#: Values by variable name.
Samples: TypeAlias = "Mapping[str, npt.ArrayLike] | pd.DataFrame"

#: How terms are evaluated: by their comparisons as written, by comparisons with the midpoints of
#: their ramps, or by their membership functions.
METHODS = ("crisp", "midpoint", "fuzzy")

#: Number of evenly spaced points of a scikit-fuzzy universe; the terms' corners are added.
_POINTS = 101


class Ramps:
    """The terms of all rules as ramps that rise with x or with -x."""

    # A membership is the minimum of a term's ramps, a firing strength that of a rule's memberships.

    def __init__(
        self, variables: Sequence[Variable], antecedents: Iterable[Sequence[tuple[str, str]]]
    ) -> None:
        places = {variable.name: place for place, variable in enumerate(variables)}
        self._low = np.array([[variable.low] for variable in variables])
        self._high = np.array([[variable.high] for variable in variables])
        ramps: dict[tuple[int, float, float, float], int] = {}
        rules: list[list[int]] = []
        for antecedent in antecedents:
            rules.append([])
            for name, term in antecedent:
                a, b, c, d = variables[places[name]][term].corners
                rising = [(places[name], 1.0, a, b)] if a > -inf else []
                falling = [(places[name], -1.0, -d, -c)] if d < inf else []
                for ramp in rising + falling:
                    rules[-1].append(ramps.setdefault(ramp, len(ramps)))
        variable, sign, foot, shoulder = (np.array(row) for row in zip(*ramps, strict=True))
        self._variable = variable
        # Longest rules first, so that the rules with a k-th ramp precede all others.
        self._order = np.array(sorted(range(len(rules)), key=lambda k: -len(rules[k])))
        longest = len(rules[self._order[0]])
        self._needed = [
            np.array([rules[k][place] for k in self._order if len(rules[k]) > place])
            for place in range(longest)
        ]
        self._sign, self._foot, self._shoulder = (x[:, np.newaxis] for x in (sign, foot, shoulder))
        self._steps = np.flatnonzero(foot == shoulder)
        self._width = np.where(foot == shoulder, 1.0, shoulder - foot)[:, np.newaxis]

    def __repr__(self) -> str:
        return f"Ramps({len(self._sign)} ramps of {len(self._order)} rules)"

    def strengths(self, x: Floats, *, doubtful: bool = False) -> Floats:
        """Return the firing strengths (one row per rule) for values (one row per variable).

        The membership of a missing value, NaN, is 0, or 1 if `doubtful`.
        """
        within = np.minimum(np.maximum(x, self._low), self._high)
        signed = within[self._variable]
        signed *= self._sign
        if doubtful:
            signed[np.isnan(signed)] = inf
        # fmax replaces NaN with the foot (membership 0). Clipping avoids overflow on narrow ramps.
        part = np.fmax(signed, self._foot)
        np.minimum(part, self._shoulder, out=part)
        part -= self._foot
        part /= self._width
        for step in self._steps:
            part[step] = signed[step] >= self._foot[step]
        least = part[self._needed[0]]
        for needed in self._needed[1:]:
            some = least[: needed.size]
            np.minimum(some, part[needed], out=some)
        strength = np.empty(least.shape)
        strength[self._order] = least
        return strength


def compare(
    variables: Sequence[Variable],
    rules: Sequence[Rule],
    x: Floats,
    *,
    midpoint: bool,
    doubtful: bool = False,
) -> Floats:
    """Return the firing strengths: 1 if all comparisons of a rule hold, 0 otherwise.

    A comparison with a missing value, NaN, holds only if `doubtful`.
    """
    used = {pair for rule in rules for pair in rule.antecedent}
    holds = {}
    for values, variable in zip(x, variables, strict=True):
        # Values are clipped to the universe only if they are compared with the ramps' midpoints.
        seen = np.clip(values, variable.low, variable.high) if midpoint else values
        for term in variable.terms:
            if (variable.name, term.name) in used:
                limits = term.midpoint if midpoint else term.crisp
                holds[variable.name, term.name] = limits.contains(seen)
                if doubtful:
                    holds[variable.name, term.name] |= np.isnan(values)
    rows = [np.logical_and.reduce([holds[pair] for pair in rule.antecedent]) for rule in rules]
    return np.array(rows, float)


def persistent(fires: Bools, k: int, n: int) -> Bools:
    """Return where a rule fired in `k` or more of the last `n` rows; no rule fires before row 0."""
    window = check_whole("n", n, 1, 10**6)
    least = check_whole("k", k, 1, window)
    return fires if window == 1 else np.asarray(_recent(fires, window) >= least)


def undecided(fires: Bools, could: Bools, k: int, n: int) -> Bools:
    """Return where only missing readings keep a rule from being active.

    The rule `could` have fired in `k` of the last `n` rows or, of fewer than `k` rows, in all.
    """
    if could is fires:
        return np.broadcast_to(np.False_, fires.shape)
    if n == 1:
        return could & ~fires
    fired, most = _recent(fires, int(n)), _recent(could, int(n))
    least = np.minimum(np.arange(1, len(fires) + 1), k)
    enough = most >= least.reshape(-1, *[1] * (fires.ndim - 1))
    return np.asarray(enough & (fired < k) & (fired < most))


def _recent(fires: Bools, n: int) -> Integers:
    """Return in how many of the last `n` rows each rule fired."""
    count = np.cumsum(fires, axis=0, dtype=np.int32)
    count[n:] -= count[:-n]
    return np.asarray(count)


def arrays(names: Sequence[str], samples: Samples) -> dict[str, Floats]:
    """Return one array per variable, all of the same shape."""
    unknown = [str(name) for name in samples if name not in names]
    if unknown:
        raise ArgumentError(
            f"samples contain {', '.join(unknown)}; the variables are {', '.join(names)}"
        )
    given = {}
    for name in names:
        try:
            given[name] = np.asarray(samples[name] if name in samples else np.nan, dtype=float)
        except (TypeError, ValueError):
            raise ArgumentError(f"{name} must be numbers; use NaN for missing values") from None
    if len({x.shape for x in given.values()}) == 1:
        return given
    try:
        return dict(zip(names, np.broadcast_arrays(*given.values()), strict=True))
    except ValueError:
        shapes = ", ".join(f"{name} {x.shape}" for name, x in given.items())
        raise ArgumentError(f"shapes are {shapes}; they must be equal or broadcastable") from None


def masks(names: Sequence[str], applies: Samples, shape: tuple[int, ...]) -> dict[str, Bools]:
    """Return the masks of variables by name, each of this shape."""
    made: dict[str, Bools] = {}
    for name, mask in applies.items():
        given = np.asarray(mask)
        if name not in names or given.dtype != bool:
            raise ArgumentError(
                f"applies[{name!r}] has the type {given.dtype}; it must be a bool mask of one of "
                f"{', '.join(names)}"
            )
        try:
            made[str(name)] = np.broadcast_to(given, shape)
        except ValueError:
            raise ArgumentError(
                f"applies[{name!r}] has the shape {given.shape}; the samples have {shape}"
            ) from None
    return made


def control_system(variables: Sequence[Variable], rules: Sequence[Rule]) -> Any:
    """Return the rules as a scikit-fuzzy control system, without the unused variables."""
    from skfuzzy import control
    from skfuzzy.membership import trapmf

    used = {name for rule in rules for name in rule.variables}
    antecedents = {}
    for variable in variables:
        if variable.name in used:
            grid = np.linspace(variable.low, variable.high, _POINTS)
            corners = np.array([term.corners for term in variable.terms]).reshape(-1)
            # The membership functions are linear between their corners.
            within = (corners > variable.low) & (corners < variable.high)
            universe = np.union1d(grid, corners[within])
            antecedents[variable.name] = control.Antecedent(universe, variable.name)
            for term in variable.terms:
                # trapmf has no open shoulders; a corner outside the universe has the same effect.
                corners = np.clip(term.corners, universe[0] - 1, universe[-1] + 1)
                antecedents[variable.name][term.name] = trapmf(universe, corners)
    made = []
    # Each rule has its own consequent, because rules that share one would hide each other.
    for rule in rules:
        consequent = control.Consequent(np.array([0.0, 0.5, 1.0]), rule.code)
        consequent["on"] = np.array([0.0, 0.5, 1.0])
        terms = (antecedents[name][term] for name, term in rule.antecedent)
        made.append(control.Rule(reduce(and_, terms), consequent["on"], label=rule.code))
    return control.ControlSystem(made)
