"""The same rules in scikit-fuzzy, to compare with: `skfuzzy.control`, one sample after another.

Nothing else here needs it. What scikit-fuzzy 0.5 does unlike us is worked around in this module,
each with its reason.
"""

from __future__ import annotations

import warnings
from functools import reduce
from operator import and_
from typing import Any

import numpy as np
import numpy.typing as npt

from shipnet.errors import ArgumentError
from shipnet.fields import check_whole
from shipnet.fuzzy.rules import RuleBase
from shipnet.fuzzy.strengths import Samples, strengths
from shipnet.fuzzy.terms import Term, Variable

__all__ = ["control_strengths", "to_skfuzzy"]

Floats = npt.NDArray[np.float64]


def to_skfuzzy(base: RuleBase, *, n_points: int = 101) -> Any:
    """Return the rules as a control system of scikit-fuzzy.

    Parameters
    ----------
    base : RuleBase
        The rules.
    n_points : int, default 101
        Points of each universe, 2..100001, beside the corners of its terms.

    Returns
    -------
    skfuzzy.control.ControlSystem
        One antecedent a variable; one consequent a rule, with the rule's code and the one term
        ``on``: a number of the fault must not be defuzzified. A variable that no rule uses is left
        out.

    Raises
    ------
    ArgumentError
        If `n_points` is out of range.

    Notes
    -----
    scikit-fuzzy interpolates a term between the points of its universe: the corners must be among
    these, in double precision, or the term is bent.

    Examples
    --------
    >>> from shipnet.fuzzy import published
    >>> system = to_skfuzzy(published.rule_base("kim2014"))
    >>> len(list(system.rules)), sorted(a.label for a in system.antecedents)
    (12, ['DVPos', 'FP', 'MC', 'OP', 'OT', 'VPos'])
    """
    from skfuzzy import control

    check_whole("n_points", n_points, 2, 100_001)
    used = {name for rule in base.rules for name in rule.variables}
    antecedents = {}
    for variable in base.variables:
        if variable.name in used:
            universe = _universe(variable, n_points)
            antecedents[variable.name] = control.Antecedent(universe, variable.name)
            for term in variable.terms:
                antecedents[variable.name][term.name] = _trapezoid(universe, term)
    rules = []
    for rule in base.rules:
        consequent = control.Consequent(np.array([0.0, 0.5, 1.0]), rule.code)
        consequent["on"] = np.array([0.0, 0.5, 1.0])
        terms = (antecedents[name][term] for name, term in rule.antecedent)
        rules.append(control.Rule(reduce(and_, terms), consequent["on"], label=rule.code))
    return control.ControlSystem(rules)


def control_strengths(base: RuleBase, samples: Samples) -> Floats:
    """Return the firing strengths as `skfuzzy.control` finds them, to compare with `strengths`.

    Parameters
    ----------
    base : RuleBase
        The rules.
    samples : mapping of str to array_like, or DataFrame
        As for `strengths`.

    Returns
    -------
    ndarray of float, shape (..., n_rules)
        In the order of ``base.codes``.

    Raises
    ------
    ArgumentError
        As `strengths`, and if the simulation does not keep what a rule fired with.

    Notes
    -----
    A loop of Python: some hundred samples a second. Rules that need a missing sensor get 0 here,
    for scikit-fuzzy's minimum leaves NaN out, which makes it true.

    Examples
    --------
    >>> from shipnet.fuzzy import published
    >>> base, samples = published.rule_base("kim2014"), {"FP": [90, 124], "OP": 2.83}
    >>> np.allclose(control_strengths(base, samples), strengths(base, samples).strength, atol=1e-12)
    True
    """
    from skfuzzy import control

    firing = strengths(base, samples)
    shape = firing.strength.shape[:-1]
    given = {name: firing.values[name].reshape(-1) for name in base.names}
    used = {name for rule in base.rules for name in rule.variables}
    size = given[base.names[0]].size
    result = np.zeros((size, len(base.rules)))
    system = to_skfuzzy(base)
    rules = {rule.label: rule for rule in system.rules}
    # A flush forgets what the rules fired with; so does a run without the cache.
    simulation = control.ControlSystemSimulation(system, flush_after_run=size + 1)
    with warnings.catch_warnings():
        # np.maximum with a third argument in place of out: scikit-fuzzy 0.5, numpy 2.4 and later.
        warnings.filterwarnings("ignore", category=DeprecationWarning, module="skfuzzy")
        for place in range(size):
            sample = {name: float(given[name][place]) for name in used}
            for name, x in sample.items():
                # Any number will do for a missing sensor: its rules are left at 0 below.
                simulation.input[name] = base.variable(name).low if np.isnan(x) else x
            simulation.compute()
            for column, rule in enumerate(base.rules):
                fired = rules[rule.code].aggregate_firing[simulation]
                if fired is None:
                    raise ArgumentError(f"scikit-fuzzy kept no firing strength of {rule.code}")
                if not any(np.isnan(sample[name]) for name in rule.variables):
                    result[place, column] = fired
    return result.reshape(*shape, len(base.rules))


def _universe(variable: Variable, n_points: int) -> Floats:
    grid = np.linspace(variable.low, variable.high, n_points)
    corners = np.array([corner for term in variable.terms for corner in term.corners])
    within = (corners > variable.low) & (corners < variable.high)
    return np.union1d(grid, corners[within])


def _trapezoid(universe: Floats, term: Term) -> Floats:
    import skfuzzy

    # trapmf has no open shoulder: one beyond the universe is the same.
    corners = np.clip(term.corners, universe[0] - 1, universe[-1] + 1)
    return np.asarray(skfuzzy.trapmf(universe, corners))
