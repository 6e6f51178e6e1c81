"""What scikit-fuzzy 0.5 does that a diagnosis must not do: each shown there, then avoided here."""

import math

import numpy as np
import pytest
import skfuzzy
from skfuzzy import control
from skfuzzy.control.exceptions import EmptyMembershipError
from skfuzzy.defuzzify.exceptions import EmptyMembershipError as DefuzzEmpty

from shipnet.ballast.rule_table import rule_base
from shipnet.fuzzy import Rule, RuleBase, Term, Variable
from tests.fuzzy.skfuzzy_control import control_strengths

# np.maximum with a third argument in place of out, in scikit-fuzzy's own code.
pytestmark = pytest.mark.filterwarnings("ignore:Passing more than 2 positional:DeprecationWarning")

BASE = rule_base()
INF = math.inf
X = np.arange(0.0, 11.0)
Y = np.linspace(0, 1, 101)


def system(method="centroid", universe=X):
    """One rule: if x is high (7 to 9, up to 10), then y is on."""
    x = control.Antecedent(universe, "x")
    x["high"] = skfuzzy.trapmf(universe, [7, 9, 10, 10])
    y = control.Consequent(Y, "y", defuzzify_method=method)
    y["on"] = skfuzzy.trimf(Y, [0, 1, 1])
    return control.ControlSystem([control.Rule(x["high"], y["on"], label="on")])


def computed(simulation, **inputs):
    for name, value in inputs.items():
        simulation.input[name] = value
    simulation.compute()
    return dict(simulation.output)


@pytest.fixture
def high():
    term = Term("high", (7, 9, INF, INF), "x > 8")
    return RuleBase((Variable("x", "", 0, 10, (term,)),), (Rule("on", (("x", "high"),), 1),))


def test_1_a_flag_of_the_last_sample_stays_on(high):
    simulation = control.ControlSystemSimulation(system())
    assert computed(simulation, x=5) == {}
    flag = computed(simulation, x=9)
    assert flag["y"] == pytest.approx(2 / 3, abs=0.01)
    assert computed(simulation, x=5) == flag
    x = {"x": [5, 9, 5, 9, 5]}
    assert high.fire(x).decide().top.tolist() == ["normal", "on"] * 2 + ["normal"]
    assert control_strengths(high, x)[:, 0].tolist() == [0, 1, 0, 1, 0]


def test_2_nan_is_true():
    assert skfuzzy.trapmf(np.array([math.nan]), [7, 9, 10, 10]).tolist() == [1]
    assert np.fmin(math.nan, 1.0) == 1
    # P2 of the paper, by scikit-fuzzy's minimum: no pump pressure, a running motor.
    samples = {"FP": math.nan, "MC": 1.2}
    assert BASE.fire(samples)["P2"] == 0
    assert control_strengths(BASE, samples)[BASE.codes.index("P2")] == 0
    assert np.array_equal(control_strengths(BASE, {}), np.zeros(12))


def test_3_without_a_rule_there_is_no_output_or_the_middle_of_the_universe(high):
    assert "y" not in computed(control.ControlSystemSimulation(system()), x=5)
    strict = control.ControlSystemSimulation(system(), lenient=False)
    with pytest.raises(EmptyMembershipError):
        computed(strict, x=5)
    for method, value in (("mom", 0.5), ("som", 0), ("lom", 1)):
        simulation = control.ControlSystemSimulation(system(method))
        assert computed(simulation, x=5)["y"] == pytest.approx(value)
    firing = high.fire({"x": 5})
    assert firing.strength.tolist() == [0] and firing.normal == 1
    assert firing.decide().top[()] == "normal"


def test_4_one_quiet_sample_spoils_the_whole_batch(high):
    simulation = control.ControlSystemSimulation(system())
    assert len(computed(simulation, x=np.array([8.0, 9.0]))["y"]) == 2
    with pytest.raises(DefuzzEmpty, match="area is empty"):
        computed(control.ControlSystemSimulation(system()), x=np.array([5.0, 9.0]))
    assert high.fire({"x": [5, 9]})["on"].tolist() == [0, 1]


def test_5_firing_strengths_vanish_without_a_cache_with_arrays_and_at_a_flush(high):
    def kept(run=1, x=9.0, **options):
        one = system()
        simulation = control.ControlSystemSimulation(one, **options)
        for step in range(run):
            computed(simulation, x=x - step / 10)
        (rule,) = one.rules
        return rule.aggregate_firing[simulation]

    assert kept() == 1
    assert kept(cache=False) is None
    assert kept(run=2, flush_after_run=2) is None
    assert kept(run=3, flush_after_run=2) is not None
    # More samples than the thousand after which scikit-fuzzy flushes by default.
    x = np.linspace(7, 9, 1001)
    difference = control_strengths(high, {"x": x}) - high.fire({"x": x}).strength
    assert np.abs(difference).max() < 1e-12


def test_6_without_a_cache_the_inputs_are_forgotten(high):
    simulation = control.ControlSystemSimulation(system(), cache=False)
    computed(simulation, x=9)
    with pytest.raises(ValueError, match="All antecedents must have input values"):
        simulation.compute()
    # Ours are functions of their arguments: nothing is kept that could be forgotten, or stay.
    assert [high.fire(sample)["on"] for sample in ({"x": 9}, {}, {"x": 9})] == [1, 0, 1]


def test_7_the_cache_grows_with_every_new_sample():
    simulation = control.ControlSystemSimulation(system())
    for x in np.linspace(7, 9, 50):
        computed(simulation, x=x)
    assert len(simulation._calculated) == 50


def test_8_the_centroid_of_a_full_flag_is_two_thirds(high):
    simulation = control.ControlSystemSimulation(system())
    assert computed(simulation, x=10)["y"] == pytest.approx(2 / 3, abs=0.01)
    assert high.fire({"x": 10})["on"] == 1


def test_9_trapmf_takes_one_axis_and_interpolation_stops_at_the_universe(high):
    with pytest.raises(TypeError):
        skfuzzy.trapmf(9.0, [7, 9, 10, 10])
    with pytest.raises(ValueError, match="shape mismatch"):
        skfuzzy.trapmf(np.array([[5.0, 9.0], [9.0, 5.0]]), [7, 9, 10, 10])
    curve = skfuzzy.trapmf(X, [7, 9, 10, 10])
    assert skfuzzy.interp_membership(X, curve, 11.0) == 0
    firing = high.fire({"x": [[5, 11], [8, math.inf]]})
    assert firing["on"].tolist() == [[0, 1], [0.5, 1]]
    assert firing.clipped[..., 0].tolist() == [[False, True], [False, True]]
    assert control_strengths(high, {"x": [11, -1]})[:, 0].tolist() == [1, 0]


def test_9_a_corner_between_the_points_bends_the_function():
    term = Term("high", (7.5, 8.5, INF, INF), "x > 8")
    base = RuleBase((Variable("x", "", 0, 10, (term,)),), (Rule("on", (("x", "high"),), 1),))
    curve = skfuzzy.trapmf(X, [7.5, 8.5, 10, 10])
    assert skfuzzy.interp_membership(X, curve, 8.25) == pytest.approx(0.625)
    assert base.fire({"x": 8.25})["on"] == 0.75
    # The corners are on the universe that we give to scikit-fuzzy.
    assert control_strengths(base, {"x": 8.25}).tolist() == [pytest.approx(0.75, abs=1e-12)]


def test_10_single_precision_misses_the_peak(high):
    coarse = np.linspace(0, 1, 11, dtype=np.float32)
    assert skfuzzy.trimf(coarse, [0.1, 0.3, 0.3]).max() < 1
    x = np.array([9, 7.5], dtype=np.float32)
    assert high.fire({"x": x}).strength.dtype == np.float64
    assert high.fire({"x": x})["on"].tolist() == [1, 0.25]


def test_11_rules_with_one_consequent_hide_each_other():
    x, y = control.Antecedent(X, "x"), control.Consequent(Y, "y")
    x["high"] = skfuzzy.trapmf(X, [7, 9, 10, 10])
    x["low"] = skfuzzy.trapmf(X, [0, 0, 9, 10])
    y["on"] = skfuzzy.trimf(Y, [0, 1, 1])
    rules = [control.Rule(x[term], y["on"], label=term) for term in ("high", "low")]
    both = control.ControlSystemSimulation(control.ControlSystem(rules))
    alone = control.ControlSystemSimulation(control.ControlSystem(rules[1:]))
    assert computed(both, x=8) == computed(alone, x=8)
    # The six rules that set one flag in the paper keep their own strengths.
    samples = {"MC": 0.1, "VPos": 103.5, "OP": 2}
    firing = BASE.fire(samples)
    found = [round(float(firing[code]), 3) for code in ("Pos1", "S1", "Pos3")]
    assert found == [0.5, 0.5, 0.833]
