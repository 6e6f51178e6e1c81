from itertools import combinations

import numpy as np
import pandas as pd
import pytest
import skfuzzy

from shipnet.ballast.rule_table import rule_base, rule_vectors
from shipnet.errors import ArgumentError
from shipnet.fuzzy import Rule, RuleBase, Term, Variable

BASE = rule_base()
INF = float("inf")


def meets(a, b):
    """Return whether two intervals overlap, judged by their ends."""
    low, high = max(a.low, b.low), min(a.high, b.high)
    closed = all(one.low_closed if one.low == low else True for one in (a, b)) and all(
        one.high_closed if one.high == high else True for one in (a, b)
    )
    return low < high or (low == high and closed)


def within(a, b):
    """Return whether the first interval lies in the second, judged by their ends."""
    left = a.low > b.low or (a.low == b.low and (b.low_closed or not a.low_closed))
    right = a.high < b.high or (a.high == b.high and (b.high_closed or not a.high_closed))
    return left and right


def intervals_of(base, rule, method):
    pairs = base.terms_of(rule)
    return {v.name: term.midpoint if method == "midpoint" else term.crisp for v, term in pairs}


@pytest.mark.parametrize("method", ["crisp", "midpoint"])
def test_overlaps_equal_those_of_the_intervals(method):
    expected = []
    for a, b in combinations(BASE.rules, 2):
        left, right = (intervals_of(BASE, rule, method) for rule in (a, b))
        if all(meets(left[name], right[name]) for name in left.keys() & right.keys()):
            a_in_b = right.keys() <= left.keys() and all(
                within(left[name], right[name]) for name in right
            )
            b_in_a = left.keys() <= right.keys() and all(
                within(right[name], left[name]) for name in left
            )
            relation = {(1, 1): "equal", (1, 0): "a in b", (0, 1): "b in a"}.get(
                (a_in_b, b_in_a), "overlap"
            )
            expected.append([a.code, b.code, relation])
    assert BASE.overlaps(method).to_numpy().tolist() == expected


@pytest.mark.parametrize("method", ["crisp", "midpoint"])
def test_every_sample_lies_in_a_region(method):
    rng = np.random.default_rng(11)
    limits = {
        v.name: [x for t in v.terms for x in (t.crisp.low, t.crisp.high) if np.isfinite(x)]
        for v in BASE.variables
    }
    samples = {
        v.name: np.where(
            rng.random(4000) < 0.3,
            rng.choice([v.low, v.high, *limits[v.name]], 4000),
            rng.uniform(v.low, v.high, 4000),
        )
        for v in BASE.variables
    }
    fires = BASE.fire(samples, method).strength > 0
    codes = np.array(BASE.codes)
    seen = {" ".join(codes[row]) for row in fires}
    assert len(seen) > 40
    assert seen <= set(BASE.regions(method)["fired"])


def test_there_are_432_regions_and_41_of_them_have_no_rule():
    table = BASE.regions()
    assert len(table) == 432
    assert table["count"].value_counts().sort_index().to_dict() == {
        0: 41, 1: 127, 2: 147, 3: 77, 4: 26, 5: 12, 6: 2,
    }  # fmt: skip
    assert (table["count"] == table["fired"].str.split().str.len()).all()


def test_more_regions_than_can_be_computed_are_refused():
    terms = tuple(Term(f"t{k}", (k, k, k, k), f"x == {k}") for k in range(9))
    variables = [Variable(name, "", 0, 9, terms) for name in "ABCDEFG"]
    with pytest.raises(ArgumentError, match="have 10000000 regions; at most 1000000"):
        RuleBase(variables, [Rule("one", "A.t1", 1)]).regions()


def test_a_point_between_two_terms_is_a_cell_of_its_own():
    assert BASE.regions()["MC"].unique().tolist() == [0, 1.25, 2.5, 4.25]
    step = Term("low", (-INF, -INF, 2, 2), "x <= 2")
    rest = Term("high", (2, 2, INF, INF), "x >= 2")
    variable = Variable("X", "", 0, 4, (step, rest))
    rules = (Rule("A", (("X", "low"),), 1), Rule("B", (("X", "high"),), 2))
    base = RuleBase((variable,), rules)
    assert base.regions()["fired"].tolist() == ["A", "A B", "B"]
    same = RuleBase((variable,), (rules[0], Rule("B", (("X", "low"),), 2)))
    assert same.overlaps()["relation"].tolist() == ["equal"]
    apart = Term("high", (2, 3, INF, INF), "x > 2")
    base = RuleBase((Variable("X", "", 0, 4, (step, apart)),), rules)
    assert base.overlaps().empty


# Without a printed speed, V2 cannot be excluded.
RIGHT = {
    ("printed", "absent"): {
        "normal": "undetermined", "V2": "undetermined", "S2": "S1", "Pos2": "undetermined",
    },
    ("printed", "normal"): {"V2": "normal", "S1": "Pos1", "S2": "Pos1", "Pos2": "normal"},
    ("printed", "physical"): {"V2": "normal", "S2": "S1", "Pos2": "undetermined"},
    ("corrected", "absent"): {},
    ("corrected", "normal"): {"S1": "Pos1", "S2": "Pos2"},
    ("corrected", "physical"): {},
}  # fmt: skip


@pytest.mark.parametrize("crisp", [True, False])
@pytest.mark.parametrize(("how", "wrong"), RIGHT.items())
def test_the_diagnoses_of_the_published_vectors(how, wrong, crisp):
    reading, fill = how
    tests = rule_vectors(reading, fill=fill)
    table = BASE.check(tests, "crisp" if crisp else "fuzzy")
    missed = table[~table["right"]]
    assert dict(zip(missed["expected"], missed["top"], strict=True)) == wrong


def test_on_a_limit_the_comparison_and_the_ramp_differ():
    tests = pd.DataFrame({"FP": [125], "MC": [2.5]}, index=["P1"])
    assert BASE.check(tests, "crisp")["right"].tolist() == [False]
    assert BASE.check(tests)["right"].tolist() == [True]


def test_which_rules_fire_on_a_nested_vector():
    table = BASE.check(rule_vectors()).set_index("expected")["fired"]
    assert table["Pos1"] == "Pos1 S1 Pos3" and table["Pos2"] == "Pos2 S2 Pos4"
    assert table["S1"] == "S1 Pos3" and table["normal"] == ""


def test_a_start_position_of_0_or_100_makes_no_difference():
    tests = rule_vectors(fill="normal")
    moved = tests.assign(VPos=tests["VPos"].replace(100, 0))
    pd.testing.assert_frame_equal(BASE.check(moved), BASE.check(tests))


def test_the_normal_values_fire_v2_once_the_valve_has_stopped():
    tests = rule_vectors().loc[["normal"]].assign(DVPos=0)
    for crisp in (True, False):
        assert BASE.check(tests, "crisp" if crisp else "fuzzy")["fired"].tolist() == ["V2"]


# The centroid of a fault number.


def test_the_centroid_is_that_of_scikit_fuzzy():
    rng = np.random.default_rng(5)
    samples = {v.name: rng.uniform(v.low, v.high, 40) for v in BASE.variables}
    samples["MC"][::2] = rng.uniform(0, 0.2, 20)
    ours = BASE.centroid(samples)
    # Every corner of a cut triangle must lie on the grid, or very close to it.
    grid = np.linspace(0, 13, 13 * 2000 + 1)
    for row, number in zip(BASE.fire(samples).strength, ours["centroid"], strict=True):
        shape = np.zeros_like(grid)
        for place, strength in enumerate(row, start=1):
            triangle = skfuzzy.trimf(grid, [place - 0.5, place, place + 0.5])
            shape = np.maximum(shape, np.minimum(strength, triangle))
        if row.any():
            assert skfuzzy.defuzz(grid, shape, "centroid") == pytest.approx(number, abs=1e-3)
        else:
            assert np.isnan(number)


def test_the_centroid_of_two_faults_names_a_third():
    samples = {"MC": [0, 4, 1.2], "VPos": [105, 50, 50], "FP": [0, 125, 90], "OP": [0, 4, 0]}
    table = BASE.centroid(samples)
    assert table["active"].tolist() == ["S1 Pos3", "P1 V1", ""]
    assert table["centroid"].tolist()[:2] == [8.5, 3.0]
    assert table["nearest"].tolist() == ["O1", "P2", "undetermined"]
    assert table["top"].tolist() == ["S1", "P1", "undetermined"]
    healthy = BASE.centroid({"FP": 90, "OP": 2, "MC": 1.2, "OT": 50, "VPos": 50, "DVPos": [9]})
    assert healthy["nearest"].tolist() == ["normal"]


def test_the_centroid_of_one_fault_is_its_own_number():
    tests = rule_vectors().loc[["G1", "P1", "P2", "V1", "V2", "O1", "Pos3"]]
    table = BASE.centroid(tests)
    assert table["nearest"].tolist() == tests.index.tolist()
    assert table["centroid"].tolist() == [1, 2, 3, 4, 5, 8, 11]
    assert BASE.centroid({"OT": [float("nan")]})["nearest"].tolist() == ["undetermined"]
