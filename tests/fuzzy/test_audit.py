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


@pytest.mark.parametrize("method", ["crisp", "midpoint"])
def test_samples_lie_in_regions_and_show_the_overlaps(method):
    rng = np.random.default_rng(11)
    samples = {}
    for v in BASE.variables:
        intervals = [t.midpoint if method == "midpoint" else t.crisp for t in v.terms]
        ends = [x for i in intervals for x in (i.low, i.high) if np.isfinite(x)]
        at_end = rng.choice([v.low, v.high, *ends], 40_000)
        anywhere = rng.uniform(v.low, v.high, 40_000)
        samples[v.name] = np.where(rng.random(40_000) < 0.6, at_end, anywhere)
    fires = BASE.fire(samples, method).strength > 0
    codes = np.array(BASE.codes)
    seen = {" ".join(codes[row]) for row in fires}
    assert len(seen) > 40
    assert seen <= set(BASE.regions(method)["fired"])
    overlaps = []
    for (i, a), (j, b) in combinations(enumerate(BASE.codes), 2):
        if (fires[:, i] & fires[:, j]).any():
            only_a, only_b = fires[:, i] > fires[:, j], fires[:, j] > fires[:, i]
            relation = "overlap" if only_a.any() else "a in b"
            overlaps.append([a, b, "b in a" if not only_b.any() else relation])
    assert BASE.overlaps(method).to_numpy().tolist() == overlaps


def test_there_are_432_regions_and_41_of_them_have_no_rule():
    table = BASE.regions()
    assert len(table) == 432
    assert table["count"].value_counts().sort_index().tolist() == [41, 127, 147, 77, 26, 12, 2]
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
        "normal": "undetermined",
        "V2": "undetermined",
        "S2": "S1",
        "Pos2": "undetermined",
    },
    ("printed", "normal"): {"V2": "normal", "S1": "Pos1", "S2": "Pos1", "Pos2": "normal"},
    ("printed", "physical"): {"V2": "normal", "S2": "S1", "Pos2": "undetermined"},
    ("corrected", "absent"): {},
    ("corrected", "normal"): {"S1": "Pos1", "S2": "Pos2"},
    ("corrected", "physical"): {},
}


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
