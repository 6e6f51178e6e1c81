import math
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shipnet.ballast.rule_table import rule_base
from shipnet.errors import ArgumentError
from shipnet.fuzzy import Rule, RuleBase, Term, Variable
from tests.fuzzy.skfuzzy_control import control_strengths
from tests.support import tolerance

BASE = rule_base()
NAN = math.nan
#: Tolerance for two computations in double precision, which differ by rounding errors.
TOLERANCE = 1e-12

# Sensor values at, near and far from every corner and limit, missing and extreme values.
LIMITS = sorted(
    {
        value
        for variable in BASE.variables
        for term in variable.terms
        for value in (*term.corners, term.crisp.low, term.crisp.high)
        if math.isfinite(value)
    }
)
values = st.one_of(
    st.sampled_from(LIMITS), st.floats(-50, 350), st.sampled_from([NAN, math.inf, -math.inf])
)
rows = st.lists(st.tuples(*(values for _ in BASE.names)), max_size=8)


def samples_of(table):
    columns = np.array(table, dtype=float).reshape(-1, len(BASE.names)).T
    return dict(zip(BASE.names, columns, strict=True))


@given(
    corners=st.lists(
        st.tuples(*(st.integers(-3, 3) for _ in range(4)), st.sampled_from(["", "left", "right"])),
        min_size=1,
        max_size=4,
    ),
    x=st.lists(st.one_of(st.floats(-4, 4), st.integers(-4, 4), st.just(NAN)), min_size=1),
)
def test_a_strength_is_the_smallest_membership_including_steps_and_shoulders(corners, x):
    variables = []
    for place, (*numbers, open_end) in enumerate(corners):
        a, b, c, d = sorted(map(float, numbers))
        a, b = (-math.inf, -math.inf) if open_end == "left" else (a, b)
        c, d = (math.inf, math.inf) if open_end == "right" else (c, d)
        term = Term("t", (a, b, c, d), "x >= 0")
        variables.append(Variable(f"V{place}", "1", -3.5, 3.5, (term,)))
    names = [variable.name for variable in variables]
    # Rules of all lengths, shortest first.
    rules = [
        Rule(f"R{k}", tuple((name, "t") for name in names[: k + 1]), k + 1)
        for k in range(len(names))
    ]
    values = np.array(x, float)
    found = RuleBase(variables, rules).fire(dict.fromkeys(names, values)).strength
    within = np.clip(values, -3.5, 3.5)
    # A value outside 3.6..21 mA on a scale of 4..20 mA is missing.
    read = (values >= -3.5 - 7 / 40) & (values <= 3.5 + 7 / 16)
    degrees = [np.where(read, variable.terms[0].membership(within), 0) for variable in variables]
    for k in range(len(names)):
        assert np.array_equal(found[:, k], np.min(degrees[: k + 1], axis=0))


def uniform(n, seed=2024):
    rng = np.random.default_rng(seed)
    return {v.name: rng.uniform(v.low, v.high, n) for v in BASE.variables}


def plain_strength(rule, row):
    """Compute one strength in plain Python, following the textbook definition."""
    degrees = []
    for variable, term in BASE.terms_of(rule):
        x = row[BASE.names.index(variable.name)]
        if not variable.valid[0] <= x <= variable.valid[1]:
            return 0.0
        x = min(max(x, variable.low), variable.high)
        a, b, c, d = term.corners
        if b <= x <= c:
            degrees.append(1.0)
        elif x <= a or x >= d:
            degrees.append(0.0)
        else:
            degrees.append((x - a) / (b - a) if x < b else (d - x) / (d - c))
    return min(degrees)


@given(rows)
def test_strengths_are_those_of_a_textbook_loop(table):
    firing = BASE.fire(samples_of(table))
    expected = [[plain_strength(rule, row) for rule in BASE.rules] for row in table]
    assert firing.strength.shape == (len(table), len(BASE.rules))
    assert np.allclose(firing.strength, np.reshape(expected, (-1, 12)), rtol=0, atol=TOLERANCE)


@given(rows)
def test_missing_sensors_and_impossible_readings_are_flagged(table):
    firing = BASE.fire(samples_of(table))
    for row, missing, outside in zip(table, firing.missing, firing.out_of_range, strict=True):
        for variable, x, lacks, out in zip(BASE.variables, row, missing, outside, strict=True):
            assert lacks == math.isnan(x)
            milliamperes = 4 + 16 * (x - variable.low) / (variable.high - variable.low)
            assert out == (milliamperes < 3.6 or milliamperes > 21)


@given(rows)
def test_a_threshold_of_one_half_equals_the_midpoint_comparison(table):
    samples = samples_of(table)
    fuzzy, crisp = BASE.fire(samples), BASE.fire(samples, "midpoint")
    clear = np.abs(fuzzy.strength - 0.5) > 1e-9
    assert ((fuzzy.strength >= 0.5) == (crisp.strength == 1))[clear].all()


def test_a_missing_sensor_never_raises_a_strength():
    given_all = uniform(500)
    full = BASE.fire(given_all)
    for name in BASE.names:
        without = {key: x for key, x in given_all.items() if key != name}
        nan = BASE.fire({**given_all, name: NAN})
        assert np.array_equal(BASE.fire(without).strength, nan.strength)
        needs = np.array([name in rule.variables for rule in BASE.rules])
        assert not nan.strength[:, needs].any() and full.strength[:, needs].any()
        assert np.array_equal(nan.strength[:, ~needs], full.strength[:, ~needs])


def test_a_value_just_beyond_the_universe_counts_as_its_end_and_one_far_beyond_as_missing():
    for variable in BASE.variables:
        inside = BASE.fire({variable.name: [variable.low, variable.high]})
        edge = BASE.fire({variable.name: variable.valid})
        beyond = BASE.fire({variable.name: np.nextafter(variable.valid, [-math.inf, math.inf])})
        assert np.array_equal(inside.strength, edge.strength)
        place = BASE.names.index(variable.name)
        assert beyond.out_of_range[:, place].all() and not edge.out_of_range.any()
        missing = BASE.fire({variable.name: [NAN, NAN]})
        assert np.array_equal(beyond.strength, missing.strength)
        assert np.array_equal(beyond.possible, missing.possible)
    # Comparisons as printed have no universe, so a negative current is not zero.
    sample = {"FP": 125, "MC": -0.01}
    assert BASE.fire(sample, "crisp")["G1"] == 0
    assert BASE.fire(sample)["G1"] == 1


def test_normal_is_one_minus_the_greatest_possible_strength():
    healthy = {"FP": 90, "OP": 2, "MC": 1.2, "VPos": 50, "DVPos": 9}
    firing = BASE.fire({**healthy, "OT": [50, 82, 90, NAN]})
    assert np.allclose(firing.normal, [1, 0.8, 0, 0], atol=TOLERANCE)


def test_many_samples_give_the_same_as_each_alone():
    n = 3 * 8192 + 5
    samples = uniform(n)
    copies = {name: x.copy() for name, x in samples.items()}
    firing = BASE.fire(samples)
    assert all(np.array_equal(samples[name], copies[name]) for name in samples)
    for place in (0, 8191, 8192, 16384, n - 1):
        alone = BASE.fire({name: x[place] for name, x in samples.items()})
        assert alone.strength.shape == (12,)
        assert np.array_equal(alone.strength, firing.strength[place])


def test_samples_of_several_valves_keep_their_axes():
    samples = {name: x.reshape(30, 4) for name, x in uniform(120).items()}
    firing = BASE.fire(samples)
    assert firing.strength.shape == (30, 4, 12)
    assert firing.normal.shape == (30, 4) and firing.missing.shape == (30, 4, 6)
    for unit in range(4):
        alone = BASE.fire({name: x[:, unit] for name, x in samples.items()})
        assert np.array_equal(alone.strength, firing.strength[:, unit])
    spread = BASE.fire({"FP": np.full((30, 1), 125), "MC": np.zeros(4)})
    assert spread.strength.shape == (30, 4, 12) and (spread["G1"] == 1).all()


@pytest.mark.parametrize(
    ("samples", "fault"),
    [
        ({"PP": 1, "QQ": 2}, r"^samples contain PP, QQ; the variables are FP, OP, MC, "),
        ({"FP": "high"}, "FP must be numbers"),
        ({"FP": [[1], [1, 2]]}, "FP must be numbers"),
        ({"FP": [1, 2], "OP": [1, 2, 3]}, r"shapes are FP \(2,\), OP \(3,\)"),
        ({"FP": 1j}, "FP must be numbers"),
    ],
)
def test_samples_that_do_not_fit_are_refused(samples, fault):
    with pytest.raises(ArgumentError, match=fault):
        BASE.fire(samples)


@pytest.mark.parametrize("method", ["x", 5, None])
def test_an_unknown_method_is_refused(method):
    message = f"^method is {method!r}; it must be one of 'crisp', 'midpoint', 'fuzzy'$"
    with pytest.raises(ArgumentError, match=message):
        BASE.fire({"FP": 1}, method)


def test_values_beyond_the_universe_count_as_its_ends_except_in_printed_comparisons():
    wide = Term("wide", (-3, 1, 9, 13), "x < 12")
    base = RuleBase((Variable("x", "", 0, 10, (wide,)),), (Rule("on", (("x", "wide"),), 1),))
    samples = {"x": [-0.25, 10.5]}
    assert base.fire(samples, "midpoint")["on"].tolist() == [1, 1]
    assert base.fire(samples, "crisp")["on"].tolist() == [1, 1]
    assert base.fire(samples, "crisp").strength.dtype == np.float64
    assert base.fire(samples)["on"].tolist() == [0.75, 0.75]
    assert base.fire({"x": np.float32([5])}).strength.dtype == np.float64


def test_empty_samples_make_empty_results():
    firing = BASE.fire({"FP": []})
    assert firing.strength.shape == (0, 12) and firing.normal.shape == (0,)
    assert len(firing.decide(k=3, n=5).top) == 0
    assert BASE.fire({}).missing.all()


# Comparison with scikit-fuzzy.


def test_scikit_fuzzy_has_the_same_strengths_for_random_samples():
    samples = uniform(120)
    # Also in the narrow ramps, and with missing sensors.
    samples["MC"][:60] = np.linspace(0, 0.2, 60)
    samples["VPos"][40:90] = np.linspace(-5, 105, 50)
    samples["DVPos"][::2] = np.linspace(0, 2, 60)
    for start, name in enumerate(BASE.names):
        samples[name][start::17] = NAN
    ours = BASE.fire(samples).strength
    theirs = control_strengths(BASE, samples)
    assert ((ours > 0) & (ours < 1)).sum() > 50
    assert np.abs(theirs - ours).max() < tolerance("fuzzy.random")


def test_a_variable_that_no_rule_uses_is_left_out_of_the_control_system():
    small = RuleBase(BASE.variables, BASE.rules[:1])
    assert sorted(a.label for a in small.to_skfuzzy().antecedents) == ["FP", "MC"]
    samples = {"FP": [[125, 90]], "MC": [[0], [0.1]], "OT": 50}
    theirs = control_strengths(small, samples)
    assert theirs.shape == (2, 2, 1)
    assert np.allclose(theirs, small.fire(samples).strength, rtol=0, atol=TOLERANCE)


def test_corners_between_the_points_are_also_points_of_scikit_fuzzy():
    term = Term("high", (7.52, 7.56, math.inf, math.inf), "x > 7.54")
    base = RuleBase((Variable("x", "", 0, 10, (term,)),), (Rule("on", (("x", "high"),), 1),))
    # Without them scikit-fuzzy interpolates 0.5 between its points at 7.5 and 7.6.
    assert base.fire({"x": 7.55})["on"] == pytest.approx(0.75, abs=1e-12)
    assert control_strengths(base, {"x": 7.55}).tolist() == [pytest.approx(0.75, abs=1e-12)]


def test_scikit_fuzzy_is_loaded_only_when_needed():
    program = (
        "import sys; from shipnet.ballast.rule_table import rule_base; "
        "rule_base().decide({'OT': [90]}).explain(0); "
        "print('skfuzzy' in sys.modules, 'pandas' in sys.modules)"
    )
    result = subprocess.check_output([sys.executable, "-c", program], text=True)
    assert result.split() == ["False", "False"]
