"""Firing strengths: how far each rule holds for each sample, all rules at once."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, reduce
from math import inf
from operator import and_
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
import numpy.typing as npt

from shipnet.errors import ArgumentError
from shipnet.fields import check_whole
from shipnet.fuzzy.rules import METHODS, NORMAL, RuleBase
from shipnet.fuzzy.terms import Variable

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

    from shipnet.fuzzy.decision import Decision

Floats = npt.NDArray[np.float64]
Bools = npt.NDArray[np.bool_]

#: Values by the name of their variable.
Samples: TypeAlias = "Mapping[str, npt.ArrayLike] | pd.DataFrame"

#: Samples that are processed at once: what they need stays in the cache.
_BLOCK = 8192


@dataclass(frozen=True, eq=False)
class Firing:
    """How far each rule holds for each sample, as `RuleBase.fire` returns it.

    Parameters
    ----------
    base : RuleBase
        The rules.
    values : dict of str to ndarray
        The values given for each variable, all of one shape; NaN where one is missing.
    strength : ndarray of float, shape (..., n_rules)
        0..1, in the order of `base.codes`; the other axes are those of the samples.

    Notes
    -----
    A strength is the membership of the weakest term of the rule. `skfuzzy.trapmf` gives the same
    memberships to the last bit, but takes one axis only and calls NaN a full member.

    Examples
    --------
    >>> from shipnet import datasets
    >>> from shipnet.fuzzy import read_rules
    >>> base = read_rules(*(datasets.path(f"kim2014_assumed_{x}.csv") for x in ("rules", "terms")))
    >>> firing = base.fire({"FP": [90, 120, 124], "OP": 2.83})
    >>> firing["V1"].round(2).tolist(), firing.normal.round(2).tolist()
    ([0.0, 0.5, 0.83], [1.0, 0.5, 0.17])
    >>> base.fire({"FP": 125, "MC": [2.5, 2.6]}, method="crisp")["P1"].tolist()
    [0.0, 1.0]
    """

    base: RuleBase
    values: Mapping[str, Floats]
    strength: Floats

    def __repr__(self) -> str:
        """Return the numbers of samples and rules."""
        n = self.strength[..., 0].size
        return f"Firing({n} sample{'s' if n != 1 else ''}, {len(self.base.rules)} rules)"

    @cached_property
    def missing(self) -> Bools:
        """Which sensors report nothing, shape (..., n_variables)."""
        return np.stack([np.isnan(x) for x in self.values.values()], axis=-1)

    @cached_property
    def clipped(self) -> Bools:
        """Which sensors lie outside their universe, shape (..., n_variables)."""
        ends = [(variable.low, variable.high) for variable in self.base.variables]
        values = zip(self.values.values(), ends, strict=True)
        return np.stack([(x < low) | (x > high) for x, (low, high) in values], axis=-1)

    @cached_property
    def normal(self) -> Floats:
        """Strength of "no fault", 1 - the greatest; NaN where every sensor is missing."""
        rest = np.asarray(1 - self.strength.max(axis=-1))
        return np.where(self.missing.all(axis=-1), np.nan, rest)

    def __getitem__(self, code: str) -> Floats:
        """Return the strength of one rule for each sample."""
        return np.asarray(self.strength[..., self.base.codes.index(self.base.rule(code).code)])

    def table(self) -> pd.DataFrame:
        """Return one row per sample, one column per rule, and ``normal``."""
        import pandas as pd

        if self.strength.ndim > 2:
            raise ArgumentError(f"strength has {self.strength.ndim} axes; a table has two")
        table = pd.DataFrame(np.atleast_2d(self.strength), columns=list(self.base.codes))
        return table.assign(**{NORMAL: np.atleast_1d(self.normal)})

    def decide(self, *, threshold: float = 0.5, k: int = 1, n: int = 1) -> Decision:
        """Return what to report: rules that fired in `k` or more of the last `n` samples.

        A rule fires from a strength of `threshold` on, above 0, up to 1. With `n` above 1 time runs
        along the first axis, and the sample itself is the last of the `n`; before the first sample
        nothing fired.
        """
        from shipnet.fuzzy.decision import decide

        return decide(self, threshold=threshold, k=k, n=n)

    def plot(self, labels: Sequence[object] | None = None, ax: Axes | None = None) -> Axes:
        """Draw the strengths as a matrix, a row per rule and a column per sample."""
        from shipnet.fuzzy.plot import plot_firing

        return plot_firing(self, ax, labels)


class Ramps:
    """The terms of all rules as ramps, evaluated as rows of one array.

    A trapezoid is the smaller of two ramps and a rule the smallest of its terms, so a rule is the
    smallest of ramps that rise with x or with -x.
    """

    def __init__(
        self,
        variables: Sequence[Variable],
        antecedents: Iterable[Sequence[tuple[str, str]]],
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
        # The longest rules first: those with a k-th ramp then come before all others.
        self._order = np.array(sorted(range(len(rules)), key=lambda k: -len(rules[k])))
        longest = len(rules[self._order[0]])
        self._needed = [
            np.array([rules[k][place] for k in self._order if len(rules[k]) > place])
            for place in range(longest)
        ]
        self._sign, self._foot, self._shoulder = (x[:, np.newaxis] for x in (sign, foot, shoulder))
        self._steps = np.flatnonzero(foot == shoulder)
        self._width = np.where(foot == shoulder, 1.0, shoulder - foot)[:, np.newaxis]

    def strengths(self, x: Floats) -> Floats:
        """Return how far each rule holds for each sample; a row per rule from a row per variable.

        Values are clipped to the universe of their variable; NaN is a member of nothing.
        """
        within = np.minimum(np.maximum(x, self._low), self._high)
        signed = within[self._variable]
        signed *= self._sign
        # fmax drops a NaN, which so becomes 0. Nothing overflows, however narrow the ramp.
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


def fire(base: RuleBase, samples: Samples, method: str = "fuzzy") -> Firing:
    """Return the firing strengths of all rules for all samples, block by block."""
    check_method(method)

    def rows(x: Floats) -> Floats:
        if method == "fuzzy":
            return base.ramps.strengths(x)
        return _compare(base, x, midpoint=method == "midpoint")

    values = _arrays(base, samples)
    shape = values[base.names[0]].shape
    flat = [x.reshape(-1) for x in values.values()]
    # While it is computed, each rule has its own row, so that it is written in one go.
    strength = np.empty((len(base.rules), flat[0].size))
    for start in range(0, flat[0].size, _BLOCK):
        part = slice(start, start + _BLOCK)
        strength[:, part] = rows(np.array([x[part] for x in flat]))
    return Firing(base, values, strength.T.reshape(*shape, len(base.rules)))


def check_method(method: str, *legal: str) -> str:
    """Return a method, or raise unless it is one of `METHODS` or of the legal ones among them."""
    known = legal or tuple(METHODS)
    if not isinstance(method, str) or method not in known:
        raise ArgumentError(f"method is {method!r}; it must be one of {', '.join(known)}")
    return method


def _compare(base: RuleBase, x: Floats, *, midpoint: bool) -> Floats:
    """Return which rules hold when terms are comparisons, as strengths of 0 and 1."""
    used = {pair for rule in base.rules for pair in rule.antecedent}
    holds = {}
    for values, variable in zip(x, base.variables, strict=True):
        # A comparison as written has no universe.
        seen = np.clip(values, variable.low, variable.high) if midpoint else values
        for term in variable.terms:
            if (variable.name, term.name) in used:
                limits = term.midpoint if midpoint else term.crisp
                holds[variable.name, term.name] = limits.contains(seen)
    rows = [np.logical_and.reduce([holds[pair] for pair in rule.antecedent]) for rule in base.rules]
    return np.array(rows, float)


def _arrays(base: RuleBase, samples: Samples) -> dict[str, Floats]:
    """Return one array per variable, all of one shape."""
    if not hasattr(samples, "keys"):
        raise ArgumentError(
            f"samples is {samples!r}; it must give the variables {', '.join(base.names)} by name"
        )
    strangers = [str(name) for name in samples if name not in base.names]
    if strangers:
        raise ArgumentError(
            f"samples have {', '.join(strangers)}; the variables are {', '.join(base.names)}"
        )
    given = {}
    for name in base.names:
        try:
            given[name] = np.asarray(samples[name] if name in samples else np.nan, dtype=float)
        except (TypeError, ValueError):
            raise ArgumentError(f"{name} must be numbers, NaN where there is none") from None
    if len({x.shape for x in given.values()}) == 1:
        return given
    try:
        arrays = np.broadcast_arrays(*given.values())
    except ValueError:
        shapes = ", ".join(f"{name} {x.shape}" for name, x in given.items())
        raise ArgumentError(f"shapes are {shapes}; they must fit each other") from None
    return dict(zip(base.names, arrays, strict=True))


def control_system(base: RuleBase, n_points: int) -> Any:
    """Return the rules as a control system of scikit-fuzzy.

    A consequent of its own for each rule, because rules with a common one hide each other and the
    number of a fault must not be defuzzified. A variable that no rule uses is left out.
    """
    from skfuzzy import control
    from skfuzzy.membership import trapmf

    check_whole("n_points", n_points, 2, 100_001)
    used = {name for rule in base.rules for name in rule.variables}
    antecedents = {}
    for variable in base.variables:
        if variable.name in used:
            universe = _universe(variable, n_points)
            antecedents[variable.name] = control.Antecedent(universe, variable.name)
            for term in variable.terms:
                # trapmf has no open shoulder: a corner beyond the universe is equivalent.
                corners = np.clip(term.corners, universe[0] - 1, universe[-1] + 1)
                antecedents[variable.name][term.name] = trapmf(universe, corners)
    rules = []
    for rule in base.rules:
        consequent = control.Consequent(np.array([0.0, 0.5, 1.0]), rule.code)
        consequent["on"] = np.array([0.0, 0.5, 1.0])
        terms = (antecedents[name][term] for name, term in rule.antecedent)
        rules.append(control.Rule(reduce(and_, terms), consequent["on"], label=rule.code))
    return control.ControlSystem(rules)


def _universe(variable: Variable, n_points: int) -> Floats:
    """Return points of a universe with the corners of its terms, between which nothing bends."""
    grid = np.linspace(variable.low, variable.high, n_points)
    corners = np.array([corner for term in variable.terms for corner in term.corners])
    within = (corners > variable.low) & (corners < variable.high)
    return np.union1d(grid, corners[within])
