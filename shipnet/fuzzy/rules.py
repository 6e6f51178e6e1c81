"""Rule bases: firing strengths, decisions with their reasons, and overlaps of rules."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations, product
from math import isnan, prod
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from shipnet import style
from shipnet.arguments import checked
from shipnet.arrays import Bools, Floats, Integers
from shipnet.errors import ArgumentError
from shipnet.fields import check_choice, check_rng, check_whole
from shipnet.fuzzy.firing import (
    METHODS,
    Ramps,
    Samples,
    arrays,
    compare,
    control_system,
    persistent,
)  # fmt: skip
from shipnet.fuzzy.terms import NORMAL, UNKNOWN, Rule, Term, Variable
from shipnet.lazy import Axes, pd

#: Number of samples processed at a time, so that their arrays fit in the cache.
_BLOCK = 8192

#: Maximum numbers of regions computed, and of columns in a matrix drawn with numbers.
_MOST_REGIONS, _MOST_NUMBERS = 10**6, 20


@checked
@dataclass(frozen=True)
class RuleBase:
    """Rules and the variables that they use.

    Parameters
    ----------
    variables : sequence of Variable
        One or more variables with different names.
    rules : sequence of Rule
        One or more, with different codes and priorities, using existing terms; the first is rule 1.

    Examples
    --------
    >>> from shipnet import ballast
    >>> base = ballast.rule_base()
    >>> base.decide({"FP": 121, "OP": 2.9}).explain()
    'V1 0.60: FP 121 bar high 0.60, OP 2.9 bar high 0.90; missing MC OT VPos DVPos'
    >>> base.fire({"FP": [90, 120, 124], "OP": 2.83})["V1"].round(2).tolist()
    [0.0, 0.5, 0.83]
    >>> base.overlaps().query("relation == 'b in a'")[["a", "b"]].to_numpy().tolist()
    [['S1', 'Pos1'], ['S2', 'Pos2']]
    >>> int(base.regions()["count"].max())
    6
    """

    variables: tuple[Variable, ...]
    rules: tuple[Rule, ...]

    if TYPE_CHECKING:

        def __init__(self, variables: Sequence[Variable], rules: Sequence[Rule]) -> None: ...

    def __post_init__(self) -> None:
        object.__setattr__(self, "variables", tuple(self.variables))
        object.__setattr__(self, "rules", tuple(self.rules))
        if not self.rules or not self.variables:
            raise ArgumentError("variables or rules are empty; there must be one or more of each")
        unique = [("variable", name) for name in self.names] + [("code", c) for c in self.codes]
        unique += [("priority", str(rule.priority)) for rule in self.rules]
        twice = dict.fromkeys(one for one in unique if unique.count(one) > 1)
        faults = [f"{kind} {name} occurs twice" for kind, name in twice]
        known = {
            (variable.name, term.name) for variable in self.variables for term in variable.terms
        }
        faults += [
            f"{rule.code}: there is no term {variable}.{term}"
            for rule in self.rules
            for variable, term in rule.antecedent
            if (variable, term) not in known
        ]
        if faults:
            raise ArgumentError("; ".join(faults))

    def __repr__(self) -> str:
        return f"RuleBase({len(self.rules)} rules, variables {' '.join(self.names)})"

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the variables, in order."""
        return tuple(variable.name for variable in self.variables)

    @cached_property
    def codes(self) -> tuple[str, ...]:
        """Codes of the rules, in order."""
        return tuple(rule.code for rule in self.rules)

    @cached_property
    def ranking(self) -> tuple[str, ...]:
        """Codes of the rules, the highest priority first."""
        return tuple(rule.code for rule in sorted(self.rules, key=lambda rule: rule.priority))

    @cached_property
    def ramps(self) -> Ramps:
        """The rules as ramps, from which firing strengths are computed."""
        return Ramps(self.variables, [rule.antecedent for rule in self.rules])

    def __getitem__(self, name: str) -> Variable:
        """Return the variable with this name."""
        for variable in self.variables:
            if variable.name == name:
                return variable
        raise ArgumentError(f"variable is {name!r}; the variables are {', '.join(self.names)}")

    def rule(self, code: str) -> Rule:
        """Return the rule with this code."""
        for rule in self.rules:
            if rule.code == code:
                return rule
        raise ArgumentError(f"code is {code!r}; the codes are {', '.join(self.codes)}")

    def terms_of(self, rule: Rule) -> list[tuple[Variable, Term]]:
        """Return the variables and terms that a rule uses."""
        return [(self[name], self[name][term]) for name, term in rule.antecedent]

    def top_codes(self, active: Bools, silent: npt.ArrayLike = False) -> npt.NDArray[np.object_]:
        """Return the top active code per row; if none, ``unknown`` if `silent`, else ``normal``."""
        places = [self.codes.index(code) for code in self.ranking]
        ranked = active[..., places]
        first = np.where(ranked.any(axis=-1), ranked.argmax(axis=-1), len(places))
        names = np.array([*self.ranking, NORMAL, UNKNOWN], dtype=object)
        first += np.asarray(silent) & (first == len(places))
        return np.asarray(names[first], dtype=object)

    def active_codes(self, active: Bools) -> list[str]:
        """Return each row's active codes as one string, highest priority first; `active` is 2-D."""
        places = [self.codes.index(code) for code in self.ranking]
        names = np.array(self.ranking, dtype=object)
        return [" ".join(names[row]) for row in active[:, places]]

    def table(self) -> pd.DataFrame:
        """Return one row per rule: code, antecedent, flag, priority and English label."""
        rows = [
            (rule.code, rule.text, rule.flag, rule.priority, rule.english) for rule in self.rules
        ]
        return pd.DataFrame(rows, columns=["code", "antecedent", "flag", "priority", "english"])

    def random_samples(self, n: int, rng: Any = None) -> dict[str, Floats]:
        """Return `n` samples, uniformly distributed over the universe of each variable."""
        size, generator = check_whole("n", n, 0, 2**31), check_rng(rng)
        return {v.name: generator.uniform(v.low, v.high, size) for v in self.variables}

    def fire(self, samples: Samples, method: str = "fuzzy") -> Firing:
        """Return the firing strength of every rule for every sample.

        `samples` maps names of variables to numbers or arrays; it may be a DataFrame. NaN and
        omitted variables count as missing; a rule that needs a missing value does not fire.
        `method` is ``fuzzy``, ``crisp`` (comparisons as written) or ``midpoint`` (comparisons with
        the midpoints of the ramps).
        """
        check_choice("method", method, METHODS)
        values = arrays(self.names, samples)
        flat = [x.reshape(-1) for x in values.values()]
        # One row per rule, so that each is written to consecutive memory.
        strength = np.empty((len(self.rules), flat[0].size))
        for start in range(0, flat[0].size, _BLOCK):
            part = slice(start, start + _BLOCK)
            x = np.array([row[part] for row in flat])
            if method == "fuzzy":
                strength[:, part] = self.ramps.strengths(x)
            else:
                midpoint = method == "midpoint"
                strength[:, part] = compare(self.variables, self.rules, x, midpoint=midpoint)
        shape = values[self.names[0]].shape
        return Firing(self, values, strength.T.reshape(*shape, len(self.rules)))

    def decide(
        self,
        samples: Samples,
        method: str = "fuzzy",
        *,
        threshold: float = 0.5,
        k: int = 1,
        n: int = 1,
    ) -> Decision:
        """Call `fire`, then `Firing.decide`, and return the decision for every sample."""
        return self.fire(samples, method).decide(threshold=threshold, k=k, n=n)

    def overlaps(self, method: str = "crisp") -> pd.DataFrame:
        """Return the pairs of rules that can fire together: ``a``, ``b`` and their ``relation``.

        ``a in b`` means that b fires whenever a does; the other relations are ``b in a``, ``equal``
        and ``overlap``. `method` is ``crisp`` or ``midpoint``.
        """
        names = {
            (True, True): "equal", (True, False): "a in b", (False, True): "b in a",
            (False, False): "overlap",
        }  # fmt: skip
        rows, counts = [], self._overlap_counts(method)
        for (i, a), (j, b) in combinations(enumerate(self.codes), 2):
            both, only_a, only_b = counts[i, j], counts[i, i], counts[j, j]
            if both:
                rows.append((a, b, names[bool(both == only_a), bool(both == only_b)]))
        return pd.DataFrame(rows, columns=["a", "b", "relation"])

    def plot_overlaps(self, ax: Axes | None = None) -> Axes:
        """For each row's rule, draw the % of its regions in which each column's rule also fires."""
        ax = style.axes(ax)
        count = self._overlap_counts("crisp").astype(float)
        alone = np.diag(count)[:, None]
        share = np.divide(count, alone, out=np.zeros_like(count), where=alone > 0)

        def written(row: int, column: int, value: float) -> str:
            return "" if row == column else "in" if value == 1 else f"{100 * value:.0f}"

        draw_matrix(ax, share, written)
        ax.set_xticks(range(len(self.codes)), self.codes)
        ax.set_yticks(range(len(self.codes)), self.codes)
        ax.set_xlabel("also fires [% of the regions]")
        ax.set_ylabel("when this fires")
        return ax

    def _overlap_counts(self, method: str) -> Integers:
        """Count the regions in which rules i and j both fire, shape (n_rules, n_rules)."""
        table = self.regions(method)[list(self.names)]
        fires = self.fire(table, method).strength.astype(np.int64)
        return fires.T @ fires

    def regions(self, method: str = "crisp") -> pd.DataFrame:
        """Return every combination of terms that can hold at once, and the rules that then fire.

        One row per region: a value of each variable, the codes that ``fired``, and their ``count``.
        The regions cover everything that the sensors can report, regardless of how often each
        occurs. `method` is ``crisp`` or ``midpoint``.
        """
        check_choice("method", method, ("crisp", "midpoint"))
        cells = [variable.cells(method) for variable in self.variables]
        number = prod(map(len, cells))
        if number > _MOST_REGIONS:
            raise ArgumentError(
                f"the variables have {number} regions; at most {_MOST_REGIONS} are computed"
            )
        points = np.array(list(product(*cells)), dtype=float)
        table = pd.DataFrame(points, columns=list(self.names))
        fires = self.fire(table, method).strength > 0
        codes = np.array(self.codes, dtype=object)
        return table.assign(fired=[" ".join(codes[row]) for row in fires], count=fires.sum(axis=1))

    def check(self, vectors: pd.DataFrame, method: str = "fuzzy") -> pd.DataFrame:
        """Return the decisions for test vectors, whose index contains the expected codes.

        One row per vector: the code ``expected``, the codes that ``fired``, the ``top`` code, and
        whether the top code is ``right``.
        """
        decision = self.decide(vectors, method)
        table = decision.table().rename(columns={"active": "fired"})
        table.insert(0, "expected", vectors.index.astype(str).to_numpy(dtype=object))
        table["right"] = table["top"] == table["expected"]
        return table[["expected", "fired", "top", "right"]]

    def centroid(self, samples: Samples) -> pd.DataFrame:
        r"""Defuzzify the fault number as a controller would, to show why this is wrong.

        One row per sample: the ``active`` codes, the ``top`` code, the ``centroid`` z of all rule
        numbers (NaN if all strengths are 0), and the code ``nearest`` to z (in a tie, the lower
        number). Rule i has the consequent "number is i", a triangle of half-width 1/2 about i that
        is cut off at the rule's firing strength w_i:

        .. math:: z = \frac{\sum_i w_i \left( 2 - w_i \right) i}{\sum_i w_i \left( 2 - w_i \right)}
        """
        firing = self.fire(samples)
        strength = np.atleast_2d(firing.strength)
        area = strength * (2 - strength)
        total = area.sum(axis=-1)
        number = np.full(total.shape, np.nan)
        np.divide(area @ np.arange(1, len(self.rules) + 1), total, out=number, where=total > 0)
        place = np.where(total > 0, np.ceil(np.nan_to_num(number, nan=1.0) - 0.5), 0).astype(int)
        silent = np.atleast_1d(firing.missing.all(axis=-1))
        nearest = np.array([NORMAL, *self.codes], dtype=object)[place]
        decided = firing.decide().table()[["active", "top"]]
        return decided.assign(centroid=number, nearest=np.where(silent, UNKNOWN, nearest))

    def to_skfuzzy(self) -> Any:
        """Return the rules as a `skfuzzy.control.ControlSystem`, for comparison.

        Each variable in use becomes an antecedent with 101 points and its terms' corners. Each rule
        becomes a consequent that is named after the rule's code and has the single term ``on``.
        """
        return control_system(self.variables, self.rules)


@checked
@dataclass(frozen=True, eq=False)
class Firing:
    """The firing strength of each rule for each sample, as returned by `RuleBase.fire`.

    A strength is the lowest membership among the rule's terms. With the method ``fuzzy``, each
    membership equals the result of `skfuzzy.trapmf` to the last bit.

    Parameters
    ----------
    base : RuleBase
        The rules.
    values : dict of str to ndarray
        The values of each variable, all of the same shape; NaN where a value is missing.
    strength : ndarray of float, shape (..., n_rules)
        0..1; the last axis is in the order of `base.codes`, the others are those of the samples.

    Examples
    --------
    >>> from shipnet import ballast
    >>> firing = ballast.rule_base().fire({"FP": [90, 120, 124], "OP": 2.83})
    >>> firing["V1"].round(2).tolist(), firing.normal.round(2).tolist()
    ([0.0, 0.5, 0.83], [1.0, 0.5, 0.17])
    """

    base: RuleBase
    values: Mapping[str, Floats]
    strength: Floats

    def __repr__(self) -> str:
        n = self.strength[..., 0].size
        return f"Firing({n} sample{'s' if n != 1 else ''}, {len(self.base.rules)} rules)"

    @cached_property
    def missing(self) -> Bools:
        """Mask of the sensors without a value, shape (..., n_variables)."""
        return np.stack([np.isnan(x) for x in self.values.values()], axis=-1)

    @cached_property
    def clipped(self) -> Bools:
        """Mask of the values outside their universe, shape (..., n_variables)."""
        ends = [(variable.low, variable.high) for variable in self.base.variables]
        values = zip(self.values.values(), ends, strict=True)
        return np.stack([(x < low) | (x > high) for x, (low, high) in values], axis=-1)

    @cached_property
    def normal(self) -> Floats:
        """Strength of "no fault": 1 minus the greatest strength; NaN if no sensor has a value."""
        rest = np.asarray(1 - self.strength.max(axis=-1))
        return np.where(self.missing.all(axis=-1), np.nan, rest)

    def __getitem__(self, code: str) -> Floats:
        """Return the strength of one rule for each sample."""
        return np.asarray(self.strength[..., self.base.codes.index(self.base.rule(code).code)])

    def decide(self, *, threshold: float = 0.5, k: int = 1, n: int = 1) -> Decision:
        """Return the decision: the rules that fired in `k` or more of the last `n` samples.

        A rule fires if its strength is at least `threshold`, which is above 0 and at most 1. With
        `n` above 1, time runs along the first axis; the `n` samples include the current one.
        """
        if not isinstance(threshold, (int, float, np.floating)) or not 0 < threshold <= 1:
            raise ArgumentError(
                f"threshold is {threshold!r}; it must be a number above 0 and at most 1"
            )
        fires = self.strength >= threshold
        if n != 1 and fires.ndim < 2:
            raise ArgumentError(f"n is {n}; it must be 1 for samples without a time axis")
        return Decision(self, float(threshold), persistent(fires, k, n))

    def plot(self, labels: Sequence[object] | None = None, ax: Axes | None = None) -> Axes:
        """Draw the strengths as a matrix with one row per rule and one column per sample."""
        if self.strength.ndim > 2:
            raise ArgumentError(f"strength has {self.strength.ndim} axes; at most two can be drawn")
        strength = np.atleast_2d(self.strength)
        n_samples = len(strength)
        if labels is not None and len(labels) != n_samples:
            raise ArgumentError(f"there are {len(labels)} labels; expected {n_samples}")
        ax = style.axes(ax)
        draw_matrix(
            ax, strength.T, lambda _, __, x: "1" if x == 1 else f"{x:.2f}".removeprefix("0")
        )
        if labels is not None:
            ax.set_xticks(range(n_samples), [str(label) for label in labels])
        ax.set_yticks(range(len(self.base.codes)), self.base.codes)
        ax.set_xlabel("sample")
        ax.set_ylabel("rule")
        return ax


@checked
@dataclass(frozen=True, eq=False)
class Decision:
    """The decision for each sample, as returned by `RuleBase.decide`.

    Parameters
    ----------
    firing : Firing
        The strengths that the decision is based on.
    threshold : float
        Lowest strength at which a rule fires.
    active : ndarray of bool, shape (..., n_rules)
        True for each reported rule, in the order of ``firing.base.codes``.

    Examples
    --------
    The motor current drops out for one sample, then permanently:

    >>> from shipnet import ballast
    >>> base = ballast.rule_base()
    >>> samples = {"FP": 124, "MC": [1, 0, 1, 0, 0, 0, 0], "OP": 1, "DVPos": 9}
    >>> print(*base.decide(samples).top)
    normal G1 normal G1 G1 G1 G1
    >>> print(*base.decide(samples, k=3, n=5).top)
    normal normal normal normal G1 G1 G1
    """

    firing: Firing
    threshold: float
    active: Bools

    def __repr__(self) -> str:
        shape = self.active.shape[:-1]
        if self.active.size == len(self.firing.base.codes):
            return f"Decision({self.explain(*(0 for _ in shape))})"
        codes, counts = np.unique(self.top.astype(str), return_counts=True)
        said = ", ".join(f"{n} {code}" for code, n in zip(codes, counts, strict=True))
        return f"Decision({int(np.prod(shape))} samples: {said})"

    @cached_property
    def top(self) -> npt.NDArray[np.object_]:
        """Top-priority active code; else ``normal``, or ``unknown`` if no sensor has a value."""
        return self.firing.base.top_codes(self.active, self.firing.missing.all(axis=-1))

    def codes(self, *index: int) -> tuple[str, ...]:
        """Return all active codes of the sample at this index, the highest priority first."""
        active = self.active[self._place(index)]
        return tuple(self.firing.base.active_codes(active[np.newaxis])[0].split())

    def table(self) -> pd.DataFrame:
        """Return one row per sample: the ``top`` code, its ``strength`` and all ``active`` codes.

        ``missing`` names the sensors without a value, ``clipped`` those with values outside their
        universe.
        """
        if self.active.ndim > 2:
            raise ArgumentError(f"active has {self.active.ndim} axes; at most two fit in a table")
        firing, top = self.firing, np.atleast_1d(self.top)
        rows = zip(top, np.atleast_2d(firing.strength), np.atleast_1d(firing.normal), strict=True)
        strength = [
            normal if code in (NORMAL, UNKNOWN) else row[firing.base.codes.index(code)]
            for code, row, normal in rows
        ]
        return pd.DataFrame(
            {
                "top": top,
                "strength": np.array(strength, dtype=float),
                "active": firing.base.active_codes(np.atleast_2d(self.active)),
                "missing": [self._sensors(row) for row in np.atleast_2d(firing.missing)],
                "clipped": [self._sensors(row) for row in np.atleast_2d(firing.clipped)],
            }
        )

    def explain(self, *index: int) -> str:
        """Return one line of text that explains the decision for the sample at this index.

        It names the top code with its strength and terms, the other active codes, and the sensors
        that are missing or out of range; for ``normal``, also the closest rule, if there is one.
        """
        place, firing = self._place(index), self.firing
        base, top = firing.base, self.top[place]
        parts = []
        if top in base.codes:
            parts.append(self._reason(base.rule(top), place))
            others = [code for code in self.codes(*index) if code != top]
            if others:
                said = (f"{code} {firing[code][place]:.2f}" for code in others)
                parts.append(f"also {', '.join(said)}")
        else:
            normal = float(firing.normal[place])
            parts.append(top if isnan(normal) else f"{top} {normal:.2f}")
            closest = base.rules[int(firing.strength[place].argmax())]
            if firing[closest.code][place] > 0:
                parts.append(f"closest {self._reason(closest, place)}")
        for word, flags in (("missing", firing.missing), ("out of range", firing.clipped)):
            if flags[place].any():
                parts.append(f"{word} {self._sensors(flags[place])}")
        return "; ".join(parts)

    def _reason(self, rule: Rule, place: tuple[int, ...]) -> str:
        said = []
        for variable, term in self.firing.base.terms_of(rule):
            x = self.firing.values[variable.name][place]
            degree = Ramps([variable], [[(variable.name, term.name)]]).strengths(np.full((1, 1), x))
            label = term.english or term.name
            said.append(f"{variable.name} {x:.4g} {variable.unit} {label} {degree[0, 0]:.2f}")
        return f"{rule.code} {self.firing[rule.code][place]:.2f}: {', '.join(said)}"

    def _sensors(self, flags: Bools) -> str:
        return " ".join(np.array(self.firing.base.names)[flags])

    def _place(self, index: tuple[int, ...]) -> tuple[int, ...]:
        shape = self.active.shape[:-1]
        fits = len(index) == len(shape)
        if not fits or any(not -n <= i < n for i, n in zip(index, shape, strict=True)):
            raise ArgumentError(f"index is {index}; the samples have shape {shape}")
        return index


def draw_matrix(ax: Axes, values: Floats, written: Callable[[int, int, float], str]) -> None:
    """Draw values from 0 to 1 as a heat map; if it has few columns, add text to nonzero cells."""
    rows, columns = values.shape
    ax.imshow(values, cmap="Blues", vmin=0, vmax=1, aspect="auto", interpolation="nearest")
    ax.grid(visible=False)
    ax.tick_params(which="both", length=0)
    if columns > _MOST_NUMBERS:
        return
    ax.set_xticks(np.arange(columns - 1) + 0.5, minor=True)
    ax.set_yticks(np.arange(rows - 1) + 0.5, minor=True)
    ax.grid(visible=True, which="minor", color="0.88")
    ax.tick_params(which="minor", length=0)
    for (row, column), value in np.ndenumerate(values):
        # Dark text on the pale cells, white text on the dark ones.
        colour = "white" if value > 0.6 else "0.1"
        text = written(row, column, value) if value > 0 else ""
        if text:
            ax.text(column, row, text, ha="center", va="center", color=colour)
