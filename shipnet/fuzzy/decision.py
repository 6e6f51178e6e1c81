"""Decisions: from firing strengths to the fault that is reported, and why."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import isnan
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from shipnet.errors import ArgumentError
from shipnet.fields import check_whole
from shipnet.fuzzy.firing import Firing, Ramps
from shipnet.fuzzy.rules import NORMAL, UNKNOWN, Rule, RuleBase

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

Bools = npt.NDArray[np.bool_]


def top_codes(
    base: RuleBase, active: Bools, silent: npt.ArrayLike = False
) -> npt.NDArray[np.object_]:
    """Return the active code of the highest priority, else ``normal``, or ``unknown`` if silent.

    `active` has shape (..., n_rules); `silent` says where no sensor reports anything.
    """
    places = [base.codes.index(code) for code in base.ranking]
    ranked = active[..., places]
    first = np.where(ranked.any(axis=-1), ranked.argmax(axis=-1), len(places))
    names = np.array([*base.ranking, NORMAL, UNKNOWN], dtype=object)
    return np.asarray(names[first + (np.asarray(silent) & (first == len(places)))], dtype=object)


@dataclass(frozen=True, eq=False)
class Decision:
    """What is reported for each sample, as `RuleBase.decide` returns it.

    Parameters
    ----------
    firing : Firing
        The strengths that it is decided on.
    threshold : float
        Strength from which on a rule counts.
    active : ndarray of bool, shape (..., n_rules)
        Which rules are reported, in the order of ``firing.base.codes``.

    Examples
    --------
    The motor current drops out for one sample, then for good:

    >>> from shipnet import datasets
    >>> from shipnet.fuzzy import read_rules
    >>> base = read_rules(*(datasets.path(f"kim2014_assumed_{x}.csv") for x in ("rules", "terms")))
    >>> samples = {"FP": 124, "MC": [1, 0, 1, 0, 0, 0, 0], "OP": 1, "DVPos": 9}
    >>> print(*base.decide(samples).top)
    normal G1 normal G1 G1 G1 G1
    >>> print(*base.decide(samples, k=3, n=5).top)
    normal normal normal normal G1 G1 G1
    >>> base.decide(samples).explain(1)
    'G1 0.90: FP 124 bar high 0.90, MC 0 A zero 1.00; missing OT VPos'
    """

    firing: Firing
    threshold: float
    active: Bools

    def __repr__(self) -> str:
        """Return the reason for one sample, or how often each code is on top."""
        shape = self.active.shape[:-1]
        if self.active.size == len(self.firing.base.codes):
            return f"Decision({self.explain(*(0 for _ in shape))})"
        codes, counts = np.unique(self.top.astype(str), return_counts=True)
        said = ", ".join(f"{n} {code}" for code, n in zip(codes, counts, strict=True))
        return f"Decision({int(np.prod(shape))} samples: {said})"

    @cached_property
    def top(self) -> npt.NDArray[np.object_]:
        """The active code of the highest priority; else ``normal``, or ``unknown``; shape (...).

        It is unknown where no sensor reports anything.
        """
        return top_codes(self.firing.base, self.active, self.firing.missing.all(axis=-1))

    def codes(self, *index: int) -> tuple[str, ...]:
        """Return all active codes of the sample at this index, the highest priority first."""
        return self._codes(self.active[self._place(index)])

    def _codes(self, active: Bools) -> tuple[str, ...]:
        base = self.firing.base
        return tuple(code for code in base.ranking if active[base.codes.index(code)])

    def table(self) -> pd.DataFrame:
        """Return one row per sample: ``top``, its ``strength``, ``active`` codes, faulty sensors.

        ``missing`` and ``clipped`` name the sensors that report nothing, or lie outside their
        universe.
        """
        import pandas as pd

        if self.active.ndim > 2:
            raise ArgumentError(f"active has {self.active.ndim} axes; a table has two")
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
                "active": [" ".join(self._codes(row)) for row in np.atleast_2d(self.active)],
                "missing": [self._sensors(row) for row in np.atleast_2d(firing.missing)],
                "clipped": [self._sensors(row) for row in np.atleast_2d(firing.clipped)],
            }
        )

    def explain(self, *index: int) -> str:
        """Return why the sample at this index is decided as it is, in one sentence.

        The top code with its strength and terms, the other active codes, and the sensors that are
        missing or out of range. ``normal`` is followed by the rule that comes closest, if any.
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

    def plot(self, time: npt.ArrayLike, ax: Axes | None = None) -> Axes:
        """Draw over time [s] how strongly every rule fires, and when it is active."""
        from shipnet.fuzzy.plot import plot_decision

        return plot_decision(self, time, ax)

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


def decide(firing: Firing, *, threshold: float = 0.5, k: int = 1, n: int = 1) -> Decision:
    """Return what to report: rules that fired in `k` or more of the last `n` samples."""
    window = check_whole("n", n, 1, 10**6)
    least = check_whole("k", k, 1, window)
    if not isinstance(threshold, (int, float, np.floating)) or not 0 < threshold <= 1:
        raise ArgumentError(f"threshold is {threshold!r}; it must be a number above 0, up to 1")
    fires = firing.strength >= threshold
    if window > 1:
        if fires.ndim < 2:
            raise ArgumentError(f"n is {window}; the samples must have an axis of time")
        count = np.cumsum(fires, axis=0, dtype=np.int32)
        count[window:] -= count[:-window]
        fires = count >= least
    return Decision(firing, float(threshold), fires)
