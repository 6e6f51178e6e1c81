"""Rule bases: firing strengths, decisions with their reasons, and overlaps of rules."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, reduce
from itertools import combinations, compress, product
from math import nan, prod
from operator import and_
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from shipnet import style
from shipnet.arrays import Bools, Floats, Indices, Integers
from shipnet.errors import ArgumentError
from shipnet.fields import check_choice, check_rng, check_whole
from shipnet.fuzzy.export import fcl_text, st_text, toml_text
from shipnet.fuzzy.firing import METHODS, Samples, arrays, masks, persistent, undecided
from shipnet.fuzzy.terms import NORMAL, UNDETERMINED, Rule, Term, Variable, sloping, trapezoid
from shipnet.html import as_html
from shipnet.lazy import Axes, pd
from shipnet.tables import save_suffix

#: Number of samples processed at a time, so that their arrays fit in the cache.
_BLOCK = 8192

#: Maximum numbers of regions computed, and of columns in a matrix drawn with numbers.
_MOST_REGIONS, _MOST_NUMBERS = 10**6, 20

#: Number of points along each side of a surface.
_FINE = 301


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
    >>> base.decide({"FP": 121, "OP": 2.9, "MC": 1.2}).explain()
    'V1 0.60: FP 121 bar high 0.60, OP 2.9 bar high 0.90; missing OT VPos DVPos'
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
        faults = [
            f"{kind} {name} occurs twice" for (kind, name), n in Counter(unique).items() if n > 1
        ]
        terms = {f"{v.name}.{term.name}" for v in self.variables for term in v.terms}
        faults += [
            f"{rule.code}: {pair} is not a term"
            for rule in self.rules
            for pair in rule.text.split(" & ")
            if pair not in terms
        ]
        if faults:
            raise ArgumentError("; ".join(faults))

    def __repr__(self) -> str:
        return f"RuleBase({len(self.rules)} rules, variables {' '.join(self.names)})"

    def _repr_html_(self) -> str:
        return as_html(self, plot=self.plot_overlaps)

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
        return tuple(self.codes[number] for number in self._ranked)

    @cached_property
    def _ranked(self) -> Indices:
        return np.argsort([rule.priority for rule in self.rules])

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

    def top_codes(self, active: Bools, doubtful: npt.ArrayLike = False) -> npt.NDArray[np.object_]:
        """Return each row's top active code, else ``undetermined`` if `doubtful`, or ``normal``."""
        ranked, n = active[..., self._ranked], len(self.rules)
        first = np.where(ranked.any(axis=-1), ranked.argmax(axis=-1), np.where(doubtful, n + 1, n))
        names = np.array([*self.ranking, NORMAL, UNDETERMINED], dtype=object)
        return np.asarray(names[first], dtype=object)

    def active_codes(self, active: Bools) -> list[str]:
        """Return each row's active codes as one string, highest priority first; `active` is 2-D."""
        names = np.array(self.ranking, dtype=object)
        return [" ".join(names[row]) for row in active[:, self._ranked]]

    def table(self) -> pd.DataFrame:
        """Return one row per rule: code, antecedent, flag, priority and English label."""
        rows = [
            (rule.code, rule.text, rule.flag, rule.priority, rule.english) for rule in self.rules
        ]
        return pd.DataFrame(rows, columns=["code", "antecedent", "flag", "priority", "english"])

    def save(self, path: str | PathLike[str]) -> None:
        """Write the rule base to a file, whose suffix decides the form.

        A ``.toml`` file is for `read_rules`. For a PLC, ``.fcl`` is in the Fuzzy Control Language
        (IEC 61131-7), and ``.st`` a function block in structured text (IEC 61131-3). Both compute
        the firing strengths. The priorities are comments; the decision is left to the PLC's
        program. The syntax has been tested, but no compiler has read these files.
        """
        forms = {".toml": toml_text, ".fcl": fcl_text, ".st": st_text}
        write = forms[save_suffix(path, *forms)]
        text = write(self.variables, self.rules)
        Path(path).write_text(text, encoding="utf-8", newline="\n")

    def random_samples(self, n: int, rng: Any = None) -> dict[str, Floats]:
        """Return `n` samples, uniformly distributed over the universe of each variable."""
        size, generator = check_whole("n", n, 0, 2**31), check_rng(rng)
        return {v.name: generator.uniform(v.low, v.high, size) for v in self.variables}

    def fire(
        self, samples: Samples, method: str = "fuzzy", *, applies: Samples | None = None
    ) -> Firing:
        """Return the firing strength of every rule for every sample.

        `samples` maps names of variables to numbers or arrays; it may be a DataFrame. NaN, omitted
        variables and values that no sensor reports (see `Variable`) count as missing; a rule that
        needs a missing value does not fire. `applies` maps names of variables to masks: where a
        variable does not apply, no value is missing, and no rule that uses it can fire. `method` is
        ``fuzzy``, ``crisp`` (comparisons as written) or ``midpoint`` (comparisons with the
        midpoints of the ramps).
        """
        check_choice("method", method, METHODS)
        values = arrays(self.names, samples)
        shape = values[self.names[0]].shape
        due = {} if applies is None else masks(self.names, applies, shape)
        flat = [x.reshape(-1) for x in values.values()]
        # One row per rule, so that each is written to consecutive memory.
        strength = possible = np.empty((len(self.rules), flat[0].size))
        for start in range(0, flat[0].size, _BLOCK):
            part = slice(start, start + _BLOCK)
            membership = self._membership(np.array([x[part] for x in flat]), method)
            for name, mask in due.items():
                of_name = self._places == self.names.index(name)
                membership[np.ix_(of_name, ~mask.reshape(-1)[part])] = 0.0
            # A rule fires as strongly as its weakest condition.
            conditions = membership[self._conditions]
            weakest = conditions.min(axis=1)
            strength[:, part] = weakest
            unknown = np.isnan(weakest)
            if unknown.any():
                if possible is strength:
                    possible = strength.copy()
                strength[:, part][unknown] = 0.0
                # A missing condition may be met, so the weakest of the others decides.
                weakest = np.nan_to_num(np.fmin.reduce(conditions, axis=1), nan=1.0)
            if possible is not strength:
                possible[:, part] = weakest
        of_samples = [rows.T.reshape(*shape, len(self.rules)) for rows in (strength, possible)]
        return Firing(self, values, of_samples[0], of_samples[possible is not strength], due)

    @cached_property
    def _terms(self) -> list[tuple[str, str]]:
        """The terms that the rules use, as pairs of variable and term."""
        return list(dict.fromkeys(pair for rule in self.rules for pair in rule.antecedent))

    @cached_property
    def _conditions(self) -> Indices:
        """Index in `_terms` of each rule's conditions; a short rule repeats its last condition."""
        rows = [[self._terms.index(pair) for pair in rule.antecedent] for rule in self.rules]
        longest = max(map(len, rows))
        return np.array([row + row[-1:] * (longest - len(row)) for row in rows])

    @cached_property
    def _places(self) -> Indices:
        """Index of the variable of each term in use."""
        return np.array([self.names.index(name) for name, _ in self._terms])

    @cached_property
    def _limits(self) -> Floats:
        """Ends of the universes, and lowest and highest readings, shape (4, n_variables, 1)."""
        rows = [(variable.low, variable.high, *variable.valid) for variable in self.variables]
        return np.array(rows).T[..., np.newaxis]

    @cached_property
    def _trapezoids(self) -> Floats:
        """Corners of the terms in use, for `trapezoid`, shape (4, n_terms, 1)."""
        pairs = [(self[name], self[name][term]) for name, term in self._terms]
        rows = [sloping(term.corners, variable.low, variable.high) for variable, term in pairs]
        return np.array(rows).T[..., np.newaxis]

    def _membership(self, x: Floats, method: str) -> Floats:
        """Return one row of memberships per term in use, NaN where its variable is missing."""
        low, high, lowest, highest = self._limits
        x[~((x >= lowest) & (x <= highest))] = nan
        if method != "crisp":
            x = x.clip(low, high)
        x = x[self._places]
        if method == "fuzzy":
            return trapezoid(x, *self._trapezoids)
        terms = [self[name][term] for name, term in self._terms]
        intervals = [term.midpoint if method == "midpoint" else term.crisp for term in terms]
        holds = [interval.contains(row) for interval, row in zip(intervals, x, strict=True)]
        membership = np.array(holds, float)
        membership[np.isnan(x)] = nan
        return membership

    def decide(
        self,
        samples: Samples,
        method: str = "fuzzy",
        *,
        threshold: float = 0.5,
        k: int = 1,
        n: int = 1,
        applies: Samples | None = None,
    ) -> Decision:
        """Call `fire`, then `Firing.decide`, and return the decision for every sample."""
        return self.fire(samples, method, applies=applies).decide(threshold=threshold, k=k, n=n)

    def overlaps(self, method: str = "crisp") -> pd.DataFrame:
        """Return the pairs of rules that can fire together: ``a``, ``b`` and their ``relation``.

        ``a in b`` means that b fires whenever a does; the other relations are ``b in a``, ``equal``
        and ``overlap``. `method` is ``crisp`` or ``midpoint``.
        """
        rows, counts = [], self._overlap_counts(method)
        for (i, a), (j, b) in combinations(enumerate(self.codes), 2):
            both, of_a, of_b = counts[i, j], counts[i, i], counts[j, j]
            one_way = "a in b" if both == of_a else "b in a" if both == of_b else "overlap"
            if both:
                rows.append((a, b, "equal" if of_a == both == of_b else one_way))
        return pd.DataFrame(rows, columns=["a", "b", "relation"])

    @style.applied
    def plot_overlaps(self, ax: Axes | None = None) -> Axes:
        """For each row's rule, draw the % of its regions in which each column's rule also fires."""
        ax = style.axes(ax)
        count = self._overlap_counts("crisp").astype(float)
        alone = np.diag(count)[:, None]
        share = np.divide(count, alone, out=np.zeros_like(count), where=alone > 0)

        def written(row: int, column: int, value: float) -> str:
            return "" if row == column else "all" if value == 1 else f"{100 * value:.0f}"

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

    def regions(self, method: str = "crisp", *, healthy: Samples | None = None) -> pd.DataFrame:
        """Return every combination of terms that can hold at once, and the rules that then fire.

        One row per region: a value of each variable, the codes that ``fired``, and their ``count``.
        The regions cover everything that the sensors can report, regardless of how often each
        occurs. `method` is ``crisp`` or ``midpoint``.

        `healthy` are samples of a plant without a fault, such as a log. The column ``healthy``
        counts those in each region; a sample with a missing value is in none. A region without a
        rule is a gap only if no healthy sample lies in it: there, no rule should fire.
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
        table = table.assign(fired=[" ".join(codes[row]) for row in fires], count=fires.sum(axis=1))
        if healthy is None:
            return table
        region_of, is_known = np.zeros(1, int), np.ones(1, bool)
        values = arrays(self.names, healthy).values()
        for variable, cell, sample in zip(self.variables, cells, values, strict=True):
            x, (lowest, highest) = sample.ravel(), variable.valid
            is_known = is_known & (x >= lowest) & (x <= highest)
            if method == "midpoint":
                x = x.clip(variable.low, variable.high)
            # A sample lies in the cell in which the same terms hold.
            terms = variable.holds(x, method)[:, np.newaxis]
            alike = (terms == variable.holds(cell, method)).all(axis=2)
            is_known &= alike.any(axis=1)
            region_of = region_of * len(cell) + alike.argmax(axis=1)
        return table.assign(healthy=np.bincount(region_of[is_known], minlength=number))

    @style.applied
    def plot_surface(
        self,
        x: str,
        y: str,
        others: Mapping[str, float] | None = None,
        *,
        code: str | None = None,
        method: str = "fuzzy",
        ax: Axes | None = None,
    ) -> Axes:
        """Draw the decision, or the firing strength of the rule `code`, over two variables.

        `others` are the values of the other variables; those omitted are missing. A decision has
        the colour of its highest-ranked rule, which is paler the weaker the rule fires.
        """
        across, up, fixed = self[x], self[y], dict(others or {})
        if x == y or x in fixed or y in fixed:
            raise ArgumentError(
                f"x is {x!r}, y is {y!r}; they must be two variables that are not in others"
            )
        sides = [np.linspace(one.low, one.high, _FINE) for one in (across, up)]
        decision = self.decide({**fixed, x: sides[0], y: sides[1][:, np.newaxis]}, method)
        order = (NORMAL, UNDETERMINED, *reversed(self.ranking))
        present = [name for name in order if (decision.top == name).any()]
        if code is None:
            shade = np.select([decision.top == name for name in present], range(len(present)))
            firing = [decision.firing[name] for name in self.codes]
            fires = np.select([decision.top == name for name in self.codes], firing, 1.0)
            ends, colours = (-0.5, len(present) - 0.5), "YlGnBu"
        else:
            shade, fires, ends, colours = decision.firing[code], None, (0, 1), "Blues"
        ax, extent = style.axes(ax), (across.low, across.high, up.low, up.high)
        look: dict[str, Any] = {"origin": "lower", "extent": extent, "aspect": "auto"}
        image = ax.imshow(shade, cmap=colours, vmin=ends[0], vmax=ends[-1], alpha=fires, **look)
        if code is None:
            from scipy.ndimage import distance_transform_edt

            for name in present:
                # The middle of the places within a region that are farthest from its edges.
                depth = distance_transform_edt(np.pad(decision.top == name, 1))[1:-1, 1:-1]
                deepest = np.argwhere(depth == depth.max())
                row, column = deepest[abs(deepest - deepest.mean(0)).sum(1).argmin()]
                white = {"facecolor": "white", "edgecolor": "none", "alpha": 0.75, "pad": 1.5}
                words: dict[str, Any] = {"ha": "center", "va": "center", "bbox": white}
                if depth.max() < 0.02 * _FINE:  # a strip that its name would cover
                    # Its middle is near the name of the region beside it.
                    row, column = deepest[3 * len(deepest) // 8]
                    words |= {"xytext": (24, 10), "textcoords": "offset points"}
                    words |= {"arrowprops": {"arrowstyle": "-"}}
                ax.annotate(style.literal(name), (sides[0][column], sides[1][row]), **words)
        else:
            bar = ax.figure.colorbar(image, ax=ax, label=f"firing strength of {code}")
            bar.set_ticks([0, 0.5, 1])
        ax.grid(visible=False)
        ax.set(xlabel=across.label, ylabel=up.label)
        return ax

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
        rule = np.ceil(np.nan_to_num(number, nan=1.0) - 0.5).astype(int) - 1
        nearest = np.array(self.codes, dtype=object)[rule]
        decided = firing.decide().table()[["active", "top"]]
        return decided.assign(centroid=number, nearest=np.where(total > 0, nearest, decided["top"]))

    def to_skfuzzy(self) -> Any:
        """Return the rules as a `skfuzzy.control.ControlSystem`, for comparison.

        Each variable in use becomes an antecedent with 101 points and its terms' corners. Each rule
        becomes a consequent that is named after the rule's code and has the single term ``on``.
        """
        from skfuzzy import control
        from skfuzzy.membership import trapmf

        antecedents = {}
        for name in dict(self._terms):
            variable = self[name]
            grid = np.linspace(variable.low, variable.high, 101)
            corners = np.array([term.corners for term in variable.terms]).reshape(-1)
            # The membership functions are linear between their corners.
            within = (corners > variable.low) & (corners < variable.high)
            universe = np.union1d(grid, corners[within])
            antecedents[name] = control.Antecedent(universe, name)
            for term in variable.terms:
                # trapmf has no open shoulders; a corner outside the universe has the same effect.
                corners = np.clip(term.corners, universe[0] - 1, universe[-1] + 1)
                antecedents[name][term.name] = trapmf(universe, corners)
        rules = []
        # Each rule has its own consequent, because rules that share one would hide each other.
        for rule in self.rules:
            consequent = control.Consequent(np.array([0.0, 0.5, 1.0]), rule.code)
            consequent["on"] = np.array([0.0, 0.5, 1.0])
            terms = (antecedents[name][term] for name, term in rule.antecedent)
            rules.append(control.Rule(reduce(and_, terms), consequent["on"], label=rule.code))
        return control.ControlSystem(rules)


@dataclass(frozen=True, eq=False)
class Firing:
    """The firing strength of each rule for each sample, as returned by `RuleBase.fire`.

    A strength is the lowest membership among the rule's terms. With the method ``fuzzy``, each
    membership equals the result of `skfuzzy.trapmf` to the last bit. The membership of a missing
    value is between 0 and 1, so the true strength is between `strength` and `possible`.

    Parameters
    ----------
    base : RuleBase
        The rules.
    values : dict of str to ndarray
        The values of each variable, all of the same shape; NaN where a value is missing.
    strength : ndarray of float, shape (..., n_rules)
        0..1; the last axis is in the order of `base.codes`, the others are those of the samples.
    possible : ndarray of float, shape (..., n_rules)
        The strengths if all missing values had a membership of 1.
    applies : dict of str to ndarray of bool
        Where the variables apply; those not listed apply everywhere.

    Examples
    --------
    >>> from shipnet import ballast
    >>> firing = ballast.rule_base().fire({"FP": [90, 120, 124], "OP": 2.83})
    >>> firing["V1"].round(2).tolist(), firing.possible[:, 0].round(2).tolist()
    ([0.0, 0.5, 0.83], [0.0, 0.5, 0.9])
    """

    base: RuleBase
    values: Mapping[str, Floats]
    strength: Floats
    possible: Floats
    applies: Mapping[str, Bools] = field(default_factory=dict)

    def __repr__(self) -> str:
        return f"Firing({self.strength[..., 0].size} samples, {len(self.base.rules)} rules)"

    @cached_property
    def missing(self) -> Bools:
        """Mask of the sensors that apply but have no value, shape (..., n_variables)."""
        return np.stack(
            [np.isnan(x) & self.applies.get(name, True) for name, x in self.values.items()], axis=-1
        )

    @cached_property
    def out_of_range(self) -> Bools:
        """Mask of the values that no sensor reports, which count as missing; same shape."""
        flags = []
        for variable in self.base.variables:
            x, (low, high) = self.values[variable.name], variable.valid
            flags.append(((x < low) | (x > high)) & self.applies.get(variable.name, True))
        return np.stack(flags, axis=-1)

    @property
    def normal(self) -> Floats:
        """Strength of "no fault", at least: 1 minus the greatest possible strength."""
        return np.asarray(1 - self.possible.max(axis=-1))

    def __getitem__(self, code: str) -> Floats:
        """Return the strength of one rule for each sample."""
        return np.asarray(self.strength[..., self.base.rules.index(self.base.rule(code))])

    def decide(self, *, threshold: float = 0.5, k: int = 1, n: int = 1) -> Decision:
        """Return the decision: the rules that fired in `k` or more of the last `n` samples.

        A rule fires if its strength is at least `threshold`, which is above 0 and at most 1. With
        `n` above 1, time runs along the first axis; the `n` samples include the current one. A rule
        is open if it could have fired often enough with other values for its missing readings.
        """
        if not isinstance(threshold, (int, float, np.floating)) or not 0 < threshold <= 1:
            raise ArgumentError(
                f"threshold is {threshold!r}; it must be a number above 0 and at most 1"
            )
        fires = self.strength >= threshold
        could = fires if self.possible is self.strength else self.possible >= threshold
        if n != 1 and fires.ndim < 2:
            raise ArgumentError(f"n is {n}; it must be 1 for samples without a time axis")
        active = persistent(fires, k, n)
        return Decision(self, float(threshold), active, undecided(fires, could, k, n))

    @style.applied
    def plot(self, labels: Sequence[object] | None = None, ax: Axes | None = None) -> Axes:
        """Draw the strengths as a matrix with one row per rule and one column per sample."""
        if self.strength.ndim > 2:
            raise ArgumentError(
                f"strength has {self.strength.ndim} axes; at most two can be drawn. "
                "RuleBase.plot_surface draws a decision over two variables"
            )
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
    open : ndarray of bool, shape (..., n_rules)
        True for each rule that is not active but cannot be excluded, because readings are missing.

    Notes
    -----
    A rule with a known term below the threshold is excluded, even if other readings are missing. If
    no rule is active, the decision is ``normal`` if all are excluded, otherwise ``undetermined``.

    Examples
    --------
    The motor current drops to 0 for one sample, then permanently:

    >>> from shipnet import ballast
    >>> base = ballast.rule_base()
    >>> samples = {"FP": 124, "OP": 1, "OT": 50, "VPos": 50, "DVPos": 9}
    >>> samples["MC"] = [1, 0, 1, 0, 0, 0, 0]
    >>> print(*base.decide(samples).top)
    normal G1 normal G1 G1 G1 G1
    >>> print(*base.decide(samples, k=3, n=5).top)
    normal normal normal normal G1 G1 G1

    Without a reading of the current, the gauge fault G1 cannot be excluded:

    >>> base.decide({**samples, "MC": float("nan")})
    Decision(undetermined: cannot exclude G1 P1; missing MC)
    """

    firing: Firing
    threshold: float
    active: Bools
    open: Bools

    @property
    def ok(self) -> bool | None:
        """Whether all samples are normal; None if none has a fault but some are undetermined."""
        return all_normal(self.top)

    @property
    def verdict(self) -> str:
        """The number of samples per top code or, for one sample, its explanation."""
        shape = self.active.shape[:-1]
        if self.active.size == len(self.firing.base.codes):
            return self.explain(*(0 for _ in shape))
        codes, counts = np.unique(self.top.astype(str), return_counts=True)
        top = ", ".join(f"{n} {code}" for code, n in zip(codes, counts, strict=True))
        return f"{int(np.prod(shape))} samples: {top}"

    def __repr__(self) -> str:
        return f"Decision({self.verdict})"

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the firing strengths, as `Firing.plot`."""
        return self.firing.plot(ax=ax)

    def _repr_html_(self) -> str:
        table = self.table() if self.active.ndim < 3 else pd.DataFrame()
        return as_html(self, table=table, figure=len(table) > 1)

    @cached_property
    def top(self) -> npt.NDArray[np.object_]:
        """Top-priority active code; else ``undetermined`` if a rule is open, or ``normal``."""
        return self.firing.base.top_codes(self.active, self.open.any(axis=-1))

    def codes(self, *index: int) -> tuple[str, ...]:
        """Return all active codes of the sample at this index, the highest priority first."""
        return self._codes(self.active[self._place(index)])

    def table(self) -> pd.DataFrame:
        """Return one row per sample: the ``top`` code, its ``strength`` and all ``active`` codes.

        The ``strength`` is NaN if the decision is undetermined. ``open`` lists the rules that
        cannot be excluded, ``missing`` the sensors without a value, and ``out_of_range`` those with
        values that no sensor reports.
        """
        if self.active.ndim > 2:
            raise ArgumentError(f"active has {self.active.ndim} axes; at most two fit in a table")
        firing, top = self.firing, np.atleast_1d(self.top)
        strength = np.where(top == NORMAL, firing.normal, nan)
        of_top = top[:, np.newaxis] == np.array(firing.base.codes, dtype=object)
        strength[of_top.any(axis=1)] = np.atleast_2d(firing.strength)[of_top]
        return pd.DataFrame(
            {
                "top": top,
                "strength": strength,
                "active": firing.base.active_codes(np.atleast_2d(self.active)),
                "open": firing.base.active_codes(np.atleast_2d(self.open)),
                "missing": [self._sensors(row) for row in np.atleast_2d(firing.missing)],
                "out_of_range": [self._sensors(row) for row in np.atleast_2d(firing.out_of_range)],
            }
        )

    def explain(self, *index: int) -> str:
        """Return one line of text that explains the decision for the sample at this index.

        It names the top code with its strength and terms, the other active codes, the open rules of
        higher priority, and the sensors that are missing or out of range. If no rule is active, it
        also names the closest rule, if there is one; if the decision is undetermined, it names only
        the sensors that would decide it.
        """
        element, firing = self._place(index), self.firing
        base, top = firing.base, self.top[element]
        opened = self._codes(self.open[element])
        parts = []
        if top in base.codes:
            parts.append(self._reason(base.rule(top), element))
            others = [code for code in self.codes(*index) if code != top]
            if others:
                texts = (f"{code} {firing[code][element]:.2f}" for code in others)
                parts.append(f"also {', '.join(texts)}")
            higher = [code for code in opened if base.ranking.index(code) < base.ranking.index(top)]
            if higher:
                parts.append(f"cannot exclude {' '.join(higher)}")
        else:
            normal = f"{NORMAL} {firing.normal[element]:.2f}"
            parts.append(f"{top}: cannot exclude {' '.join(opened)}" if opened else normal)
            closest = base.rules[int(firing.strength[element].argmax())]
            if firing[closest.code][element] > 0:
                parts.append(f"closest {self._reason(closest, element)}")
        missing, outside = firing.missing[element], firing.out_of_range[element]
        if top == UNDETERMINED:
            opened_rules = compress(base.rules, self.open[element])
            decisive = {name for rule in opened_rules for name in rule.variables}
            decides = np.isin(base.names, list(decisive))
            missing, outside = missing & decides, outside & decides
            if not (missing | outside).any():
                parts.append("missing earlier readings")
        if missing.any():
            parts.append(f"missing {self._sensors(missing)}")
        if outside.any():
            texts = (
                self._reading(variable, element) for variable in compress(base.variables, outside)
            )
            parts.append(f"out of range {', '.join(texts)}")
        return "; ".join(parts)

    def _reason(self, rule: Rule, element: tuple[int, ...]) -> str:
        conditions = []
        for variable, term in self.firing.base.terms_of(rule):
            x = self.firing.values[variable.name][element]
            degree = term.membership(np.clip(x, variable.low, variable.high))
            label = term.english or term.name
            conditions.append(f"{self._reading(variable, element)} {label} {degree:.2f}")
        return f"{rule.code} {self.firing[rule.code][element]:.2f}: {', '.join(conditions)}"

    def _reading(self, variable: Variable, element: tuple[int, ...]) -> str:
        return f"{variable.name} {self.firing.values[variable.name][element]:.4g} {variable.unit}"

    def _codes(self, flags: Bools) -> tuple[str, ...]:
        return tuple(self.firing.base.active_codes(flags[np.newaxis])[0].split())

    def _sensors(self, flags: Bools) -> str:
        return " ".join(np.array(self.firing.base.names)[flags])

    def _place(self, index: tuple[int, ...]) -> tuple[int, ...]:
        shape = self.active.shape[:-1]
        fits = len(index) == len(shape)
        if not fits or any(not -n <= i < n for i, n in zip(index, shape, strict=True)):
            legal = ", ".join(f"0..{n - 1}" for n in shape) or "empty"
            raise ArgumentError(
                f"index is {index}; for samples of shape {shape}, it must be {legal}"
            )
        return index


def all_normal(top: npt.NDArray[np.object_]) -> bool | None:
    """Return whether all top codes are normal; None if the others are undetermined."""
    others = set(top.ravel()) - {NORMAL}
    return None if others == {UNDETERMINED} else not others


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
