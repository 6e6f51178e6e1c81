"""Firing strengths as `skfuzzy.control` computes them, sample by sample, to verify ours.

Workarounds for differences of scikit-fuzzy 0.5 are explained in comments.
"""

import warnings

import numpy as np
from skfuzzy import control

from shipnet.errors import ArgumentError


def control_strengths(base, samples):
    """Return the strengths of all rules, of the shape of `base.fire(samples).strength`."""
    firing = base.fire(samples)
    given = {name: firing.values[name].reshape(-1) for name in base.names}
    used = {name for rule in base.rules for name in rule.variables}
    size = given[base.names[0]].size
    result = np.zeros((size, len(base.rules)))
    system = base.to_skfuzzy()
    rules = {rule.label: rule for rule in system.rules}
    # A flush deletes the firing strengths; so does a run without the cache.
    simulation = control.ControlSystemSimulation(system, flush_after_run=size + 1)
    with warnings.catch_warnings():
        # scikit-fuzzy 0.5 gives np.maximum a third argument, deprecated from numpy 2.4 on.
        warnings.filterwarnings("ignore", category=DeprecationWarning, module="skfuzzy")
        for place in range(size):
            sample = {name: float(given[name][place]) for name in used}
            for name, x in sample.items():
                # Any number can replace a missing sensor: its rules are left at 0 below. A NaN
                # would count as true, because scikit-fuzzy's minimum ignores NaN.
                simulation.input[name] = base[name].low if np.isnan(x) else x
            simulation.compute()
            for column, rule in enumerate(base.rules):
                fired = rules[rule.code].aggregate_firing[simulation]
                if fired is None:
                    raise ArgumentError(f"scikit-fuzzy kept no firing strength of {rule.code}")
                if not any(np.isnan(sample[name]) for name in rule.variables):
                    result[place, column] = fired
    return result.reshape(firing.strength.shape)
