"""How fast the rules of kim2014 are evaluated, compared with scikit-fuzzy and simpful.

simpful is left out if it is not installed.
"""

import sys
import warnings
from contextlib import redirect_stdout
from importlib.util import find_spec
from io import StringIO
from pathlib import Path

import numpy as np
from _timing import seconds

from shipnet.ballast.rule_table import rule_base

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from tests.fuzzy.skfuzzy_control import control_strengths

NUMBER = 1_000_000
FEW = 200  # samples in the loops, whose times are scaled up


def control_loop(base):
    """Return a function that calls ControlSystemSimulation.compute for each sample."""
    from skfuzzy import control

    system = base.to_skfuzzy()
    rules = {rule.label: rule for rule in system.rules}
    order = [rules[code] for code in base.codes]

    def loop(rows):
        simulation = control.ControlSystemSimulation(system, flush_after_run=10 * len(rows))
        result = []
        for row in rows:
            for name, x in row.items():
                simulation.input[name] = x
            simulation.compute()
            result.append([rule.aggregate_firing[simulation] for rule in order])
        return result

    return loop


def trapezoids(base, given):
    """Compute firing strengths from whole columns with skfuzzy.trapmf, as a careful user would."""
    from skfuzzy import trapmf

    degrees = {
        (v.name, term.name): trapmf(given[v.name], np.clip(term.corners, v.low - 1, v.high + 1))
        for v in base.variables
        for term in v.terms
    }
    return np.stack(
        [np.minimum.reduce([degrees[pair] for pair in rule.antecedent]) for rule in base.rules], 1
    )


def simpful_loop(base):
    """Return a function that computes simpful's firing strengths for each sample."""
    import simpful

    system = simpful.FuzzySystem(show_banner=False, verbose=False)
    for v in base.variables:
        sets = [
            simpful.TrapezoidFuzzySet(*np.clip(term.corners, v.low - 1, v.high + 1), term=term.name)
            for term in v.terms
        ]
        # simpful does not accept a variable with only one term.
        sets += [
            simpful.TrapezoidFuzzySet(v.high + 2, v.high + 3, v.high + 4, v.high + 5, term="_")
        ]
        edges = [v.low - 1, v.high + 5]
        system.add_linguistic_variable(
            v.name, simpful.LinguisticVariable(sets, universe_of_discourse=edges)
        )
    for code in base.codes:
        system.set_crisp_output_value(f"on_{code}", 1.0)
    text = [
        f"IF {' AND '.join(f'({name} IS {term})' for name, term in rule.antecedent)}"
        f" THEN ({rule.code} IS on_{rule.code})"
        for rule in base.rules
    ]
    system.add_rules(text)

    def loop(rows):
        result = []
        for row in rows:
            for name, x in row.items():
                system.set_variable(name, x)
            result.append(system.get_firing_strengths())
        return result

    return loop


def main():
    warnings.filterwarnings("ignore", category=DeprecationWarning, module="skfuzzy")
    rng = np.random.default_rng(2024)
    base = rule_base()
    many, few = base.random_samples(NUMBER, rng), base.random_samples(FEW, rng)
    rows = [dict(zip(few, map(float, row), strict=True)) for row in zip(*few.values(), strict=True)]
    exact = base.fire(few).strength
    assert np.abs(control_strengths(base, few) - exact).max() < 1e-12

    per_sample = {
        "RuleBase.fire": seconds(lambda: base.fire(many)) / NUMBER,
        "RuleBase.decide (3 of 5), top": seconds(lambda: base.decide(many, k=3, n=5).top) / NUMBER,
        "skfuzzy.trapmf on columns": seconds(lambda: trapezoids(base, many)) / NUMBER,
    }
    loops = {"ControlSystemSimulation in a loop": control_loop(base)}
    if find_spec("simpful"):
        with redirect_stdout(StringIO()):  # simpful prints the kind of model that it assumes
            loops["simpful in a loop"] = simpful_loop(base)
    for name, loop in loops.items():
        assert np.abs(np.array(loop(rows), dtype=float) - exact).max() < 1e-12
        per_sample[name] = seconds(lambda loop=loop: loop(rows), repeats=3) / FEW
    assert np.array_equal(trapezoids(base, few), exact)

    print(
        f"{f'{len(base.rules)} rules, {len(base.names)} sensors':<40}{'samples/s':>12}{'ratio':>12}"
    )
    for name, time in per_sample.items():
        print(f"{name:<40}{1 / time:>12.3g}{time / per_sample['RuleBase.fire']:>11.1f}x")
    if "simpful in a loop" not in loops:
        print("simpful is not installed, so it is left out")


if __name__ == "__main__":
    main()
