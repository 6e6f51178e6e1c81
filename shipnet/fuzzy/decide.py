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
from shipnet.fuzzy.rules import NORMAL, UNKNOWN, Rule, RuleBase
from shipnet.fuzzy.strengths import Firing

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["Decision", "decide", "headlines"]

Bools = npt.NDArray[np.bool_]


def headlines(
    base: RuleBase, active: Bools, silent: npt.ArrayLike = False
) -> npt.NDArray[np.object_]:
    """Return the active code of the highest priority; else ``normal``, or ``unknown``.

    Parameters
    ----------
    base : RuleBase
        The rules.
    active : ndarray of bool, shape (..., n_rules)
        Which of them are reported, in the order of `base.codes`.
    silent : array_like of bool, shape (...), default False
        Where no sensor says anything: unknown, unless a rule is active all the same.

    Returns
    -------
    ndarray of str, shape (...)
        What is said first.

    Examples
    --------
    >>> from shipnet.fuzzy import published
    >>> base = published.rule_base("kim2014")
    >>> active = np.isin(base.codes, ["Pos3", "S1"])
    >>> headlines(base, np.stack([active, ~active, active & ~active])).tolist()
    ['S1', 'G1', 'normal']
    """
    places = [base.codes.index(code) for code in base.ranking]
    ranked = active[..., places]
    first = np.where(ranked.any(axis=-1), ranked.argmax(axis=-1), len(places))
    names = np.array([*base.ranking, NORMAL, UNKNOWN], dtype=object)
    return np.asarray(names[first + (np.asarray(silent) & (first == len(places)))], dtype=object)


@dataclass(frozen=True, eq=False)
class Decision:
    """What is reported for each sample.

    Parameters
    ----------
    firing : Firing
        What it is decided on.
    cut : float
        Strength from which on a rule counts.
    active : ndarray of bool, shape (..., n_rules)
        Which rules are reported, in the order of ``firing.base.codes``.
    """

    firing: Firing
    cut: float
    active: Bools

    @cached_property
    def headline(self) -> npt.NDArray[np.object_]:
        """The active code of the highest priority; else ``normal``, or ``unknown``; shape (...).

        It is unknown where no sensor says anything.
        """
        return headlines(self.firing.base, self.active, self.firing.missing.all(axis=-1))

    def codes(self, *index: int) -> tuple[str, ...]:
        """Return all active codes of one sample, the highest priority first.

        Parameters
        ----------
        *index : int
            Place of the sample, one number an axis.
        """
        return self._codes(self.active[self._place(index)])

    def _codes(self, active: Bools) -> tuple[str, ...]:
        base = self.firing.base
        return tuple(code for code in base.ranking if active[base.codes.index(code)])

    @property
    def table(self) -> pd.DataFrame:
        """One row a sample: ``headline``, ``strength`` of it, ``active`` codes, what is wrong.

        ``missing`` and ``clipped`` name the sensors that say nothing, or lie outside their
        universe. Samples along one axis only.
        """
        import pandas as pd

        if self.active.ndim != 2:
            raise ArgumentError(f"active has {self.active.ndim} axes; a table is of two")
        firing = self.firing
        strength = [
            normal if code in (NORMAL, UNKNOWN) else row[firing.base.codes.index(code)]
            for code, row, normal in zip(self.headline, firing.strength, firing.normal, strict=True)
        ]
        return pd.DataFrame(
            {
                "headline": self.headline,
                "strength": np.array(strength, dtype=float),
                "active": [" ".join(self._codes(row)) for row in self.active],
                "missing": [self._sensors(row) for row in firing.missing],
                "clipped": [self._sensors(row) for row in firing.clipped],
            }
        )

    def explain(self, *index: int) -> str:
        """Return why one sample is decided as it is, in one sentence.

        Parameters
        ----------
        *index : int
            Place of the sample, one number an axis.

        Returns
        -------
        str
            The headline with its strength and terms, the other active codes, and the sensors that
            are missing or out of range. Behind ``normal`` the rule that comes closest, if any.
        """
        place, firing = self._place(index), self.firing
        base, headline = firing.base, self.headline[place]
        parts = []
        if headline in base.codes:
            parts.append(self._reason(base.rule(headline), place))
            others = [code for code in self.codes(*index) if code != headline]
            if others:
                said = (f"{code} {firing.of(code)[place]:.2f}" for code in others)
                parts.append(f"also {', '.join(said)}")
        else:
            normal = float(firing.normal[place])
            parts.append(headline if isnan(normal) else f"{headline} {normal:.2f}")
            closest = base.rules[int(firing.strength[place].argmax())]
            if firing.of(closest.code)[place] > 0:
                parts.append(f"closest {self._reason(closest, place)}")
        for word, flags in (("missing", firing.missing), ("out of range", firing.clipped)):
            if flags[place].any():
                parts.append(f"{word} {self._sensors(flags[place])}")
        return "; ".join(parts)

    def _reason(self, rule: Rule, place: tuple[int, ...]) -> str:
        said = []
        for variable, term in self.firing.base.terms_of(rule):
            x = float(self.firing.values[variable.name][place])
            degree = float(term.membership(min(max(x, variable.low), variable.high)))
            label = term.english or term.name
            said.append(f"{variable.name} {x:.4g} {variable.unit} {label} {degree:.2f}")
        return f"{rule.code} {self.firing.of(rule.code)[place]:.2f}: {', '.join(said)}"

    def _sensors(self, flags: Bools) -> str:
        return " ".join(np.array(self.firing.base.names)[flags])

    def _place(self, index: tuple[int, ...]) -> tuple[int, ...]:
        shape = self.active.shape[:-1]
        fits = len(index) == len(shape)
        if not fits or any(not -n <= i < n for i, n in zip(index, shape, strict=True)):
            raise ArgumentError(f"index is {index}; the samples have shape {shape}")
        return index


def decide(firing: Firing, *, cut: float = 0.5, k: int = 1, n: int = 1) -> Decision:
    """Return what to report: rules that fired in k of the last n samples.

    Parameters
    ----------
    firing : Firing
        Strengths; with `n` above 1 time runs along the first axis.
    cut : float, default 0.5
        Strength from which on a rule fires, above 0, up to 1.
    k, n : int, default 1
        A rule is active if it fired in `k` or more of the last `n` samples, 1 <= k <= n; the
        sample itself is the last of them. 3 of 5 keeps single disturbed samples out. Before the
        first sample nothing fired.

    Returns
    -------
    Decision
        Active rules, and the headline of every sample.

    Raises
    ------
    ArgumentError
        If an argument is out of range, or there is no axis of time.

    Examples
    --------
    The motor current drops out for one sample, then for good:

    >>> from shipnet.fuzzy import published, strengths
    >>> base = published.rule_base("kim2014")
    >>> firing = strengths(base, {"FP": 124, "MC": [1, 0, 1, 0, 0, 0, 0], "OP": 1, "DVPos": 9})
    >>> print(*decide(firing).headline)
    normal G1 normal G1 G1 G1 G1
    >>> print(*decide(firing, k=3, n=5).headline)
    normal normal normal normal G1 G1 G1
    >>> decide(firing).explain(1)
    'G1 0.90: FP 124 bar high 0.90, MC 0 A zero 1.00; missing OT VPos'
    """
    window = check_whole("n", n, 1, 10**6)
    least = check_whole("k", k, 1, window)
    if not isinstance(cut, (int, float, np.floating)) or not 0 < cut <= 1:
        raise ArgumentError(f"cut is {cut!r}; it must be a number above 0, up to 1")
    fires = firing.strength >= cut
    if window > 1:
        if fires.ndim < 2:
            raise ArgumentError(f"n is {window}; the samples must have an axis of time")
        count = np.cumsum(fires, axis=0, dtype=np.int32)
        count[window:] -= count[:-window]
        fires = count >= least
    return Decision(firing, float(cut), fires)
