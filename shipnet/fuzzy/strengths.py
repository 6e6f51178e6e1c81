"""Firing strengths: how far each rule holds for each sample, all rules at once."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
import numpy.typing as npt

from shipnet.errors import ArgumentError
from shipnet.fuzzy.rules import NORMAL, RuleBase

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["Firing", "Samples", "crisp_strengths", "strengths"]

Floats = npt.NDArray[np.float64]
Bools = npt.NDArray[np.bool_]

#: Name of a variable -> its values.
Samples: TypeAlias = "Mapping[str, npt.ArrayLike] | pd.DataFrame"

#: Samples that are worked on at once: what they need stays in the cache.
_BLOCK = 8192


@dataclass(frozen=True, eq=False)
class Firing:
    """How far each rule holds for each sample.

    Parameters
    ----------
    base : RuleBase
        The rules.
    values : dict of str to ndarray
        What was given for each variable, of one shape; NaN where nothing was.
    strength : ndarray of float, shape (..., n_rules)
        0..1, in the order of `base.codes`.
    """

    base: RuleBase
    values: Mapping[str, Floats]
    strength: Floats

    @cached_property
    def missing(self) -> Bools:
        """Which sensors say nothing, shape (..., n_variables)."""
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

    def of(self, code: str) -> Floats:
        """Return the strength of one rule for each sample.

        Parameters
        ----------
        code : str
            One of `base.codes`.
        """
        return np.asarray(self.strength[..., self.base.codes.index(self.base.rule(code).code)])

    @property
    def table(self) -> pd.DataFrame:
        """One row a sample, one column a rule, and ``normal``; samples along one axis only."""
        import pandas as pd

        if self.strength.ndim != 2:
            raise ArgumentError(f"strength has {self.strength.ndim} axes; a table is of two")
        table = pd.DataFrame(self.strength, columns=list(self.base.codes))
        return table.assign(**{NORMAL: self.normal})


def strengths(base: RuleBase, samples: Samples) -> Firing:
    r"""Return the firing strength of every rule for every sample.

    .. math:: w = \min_k \mu_k \left( x_k \right)

    Parameters
    ----------
    base : RuleBase
        The rules.
    samples : mapping of str to array_like, or DataFrame
        Values of the variables, in their units, of shapes that fit each other: (n_samples,), or
        (n_samples, n_units). A variable that is left out is missing, as is NaN.

    Returns
    -------
    Firing
        Strengths of shape (n_samples, n_rules), or (n_samples, n_units, n_rules), in 0..1. A rule
        that needs a missing sensor has strength 0. A value outside the universe is clipped to it.

    Raises
    ------
    ArgumentError
        If there is no such variable, a value is no number, or the shapes do not fit.

    Notes
    -----
    The ramps are exact; `skfuzzy.trapmf` gives the same to the last bit, but takes one axis only
    and calls NaN a full member.

    Examples
    --------
    A pump pressure that rises into the ramp of ``FP.high``, 115 to 125 bar:

    >>> from shipnet.fuzzy import published
    >>> firing = strengths(published.rule_base("kim2014"), {"FP": [90, 120, 124], "OP": 2.83})
    >>> firing.of("V1").round(2).tolist(), firing.normal.round(2).tolist()
    ([0.0, 0.5, 0.83], [1.0, 0.5, 0.17])
    """
    return _fire(base, samples, base.ramps.strengths)


def crisp_strengths(base: RuleBase, samples: Samples, *, dead_band: bool = False) -> Firing:
    """Return which rules hold when terms are comparisons, as strengths of 0 and 1.

    Parameters
    ----------
    base : RuleBase
        The rules.
    samples : mapping of str to array_like, or DataFrame
        As for `strengths`.
    dead_band : bool, default False
        Take the values with a membership of 0.5 or more instead of the comparison as printed.

    Returns
    -------
    Firing
        As from `strengths`.

    Raises
    ------
    ArgumentError
        As `strengths`.

    Notes
    -----
    With dead bands this is what `strengths` decides with a cut of 0.5: a minimum reaches 0.5 just
    when every term does.

    Examples
    --------
    2.5 A is neither "running" nor "over" as printed:

    >>> from shipnet.fuzzy import published
    >>> base = published.rule_base("kim2014")
    >>> crisp_strengths(base, {"FP": 125, "MC": [2.5, 2.6]}).of("P1").tolist()
    [0.0, 1.0]
    >>> crisp_strengths(base, {"FP": 125, "MC": [2.5, 2.6]}, dead_band=True).of("P1").tolist()
    [1.0, 1.0]
    """
    used = {pair for rule in base.rules for pair in rule.antecedent}

    def compare(x: Floats) -> Floats:
        holds = {}
        for values, variable in zip(x, base.variables, strict=True):
            # A comparison as printed knows no universe.
            seen = np.clip(values, variable.low, variable.high) if dead_band else values
            for term in variable.terms:
                if (variable.name, term.name) in used:
                    meant = term.dead_band if dead_band else term.crisp
                    holds[variable.name, term.name] = meant.contains(seen)
        rows = [
            np.logical_and.reduce([holds[pair] for pair in rule.antecedent]) for rule in base.rules
        ]
        return np.array(rows, float)

    return _fire(base, samples, compare)


def _fire(base: RuleBase, samples: Samples, rows: Callable[[Floats], Floats]) -> Firing:
    """Work out strengths by blocks; `rows` makes a row a rule of a row a variable."""
    values = _arrays(base, samples)
    shape = values[base.names[0]].shape
    flat = [x.reshape(-1) for x in values.values()]
    # A row a rule while it is made: each is then written in one go.
    strength = np.empty((len(base.rules), flat[0].size))
    for start in range(0, flat[0].size, _BLOCK):
        part = slice(start, start + _BLOCK)
        strength[:, part] = rows(np.array([x[part] for x in flat]))
    return Firing(base, values, strength.T.reshape(*shape, len(base.rules)))


def _arrays(base: RuleBase, samples: Samples) -> dict[str, Floats]:
    """Return one array a variable, all of one shape."""
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
