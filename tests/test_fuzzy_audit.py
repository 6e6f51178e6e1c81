from itertools import combinations

import numpy as np
import pandas as pd
import pytest
import skfuzzy

from shipnet.errors import ArgumentError
from shipnet.fuzzy import (
    Interval,
    Rule,
    RuleBase,
    Term,
    Variable,
    centroid_codes,
    corners,
    crisp_strengths,
    diagnose,
    overlap_matrix,
    overlaps,
    published,
    regions,
    strengths,
)

BASE = published.rule_base("kim2014")
INF = float("inf")


def meets(a, b):
    """Whether two intervals have a number in common, by their ends."""
    low, high = max(a.low, b.low), min(a.high, b.high)
    closed = all(one.low_closed if one.low == low else True for one in (a, b)) and all(
        one.high_closed if one.high == high else True for one in (a, b)
    )
    return low < high or (low == high and closed)


def within(a, b):
    """Whether the first interval lies in the second, by their ends."""
    left = a.low > b.low or (a.low == b.low and (b.low_closed or not a.low_closed))
    right = a.high < b.high or (a.high == b.high and (b.high_closed or not a.high_closed))
    return left and right


def intervals_of(base, rule, dead_band):
    pairs = base.terms_of(rule)
    return {v.name: term.dead_band if dead_band else term.crisp for v, term in pairs}


@pytest.mark.parametrize("dead_band", [False, True])
def test_overlaps_are_those_that_the_ends_of_the_intervals_have(dead_band):
    expected = []
    for a, b in combinations(BASE.rules, 2):
        left, right = (intervals_of(BASE, rule, dead_band) for rule in (a, b))
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
    assert overlaps(BASE, dead_band=dead_band).to_numpy().tolist() == expected


def test_42_of_66_pairs_of_the_printed_rules_overlap_and_6_are_nested():
    pairs = overlaps(BASE)
    assert len(pairs) == 42
    nested = {
        (row.a, row.b) if row.relation == "a in b" else (row.b, row.a)
        for row in pairs.itertuples()
        if row.relation != "overlap"
    }
    assert nested == {
        ("Pos1", "S1"), ("S1", "Pos3"), ("Pos1", "Pos3"),
        ("Pos2", "S2"), ("S2", "Pos4"), ("Pos2", "Pos4"),
    }  # fmt: skip


def test_with_a_cut_of_a_half_seven_more_pairs_touch_on_a_common_limit():
    printed, cut = (
        {(row.a, row.b) for row in overlaps(BASE, dead_band=band).itertuples()}
        for band in (False, True)
    )
    more = cut - printed
    # Where both terms are a half: MC 0.1 or 2.5 A, OP 2.5 bar.
    assert printed < cut and len(more) == 7
    assert all(
        any(
            BASE.rule(a).variables.count(name) and BASE.rule(b).variables.count(name)
            for name in ("MC", "OP")
        )
        for a, b in more
    )


@pytest.mark.parametrize("dead_band", [False, True])
def test_every_sample_lies_in_a_region(dead_band):
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
    fires = crisp_strengths(BASE, samples, dead_band=dead_band).strength > 0
    codes = np.array(BASE.codes)
    seen = {" ".join(codes[row]) for row in fires}
    assert len(seen) > 40
    assert seen <= set(regions(BASE, dead_band=dead_band)["fired"])


def test_there_are_432_regions_and_41_of_them_have_no_rule():
    table = regions(BASE)
    assert len(table) == 432
    assert table["count"].value_counts().sort_index().to_dict() == {
        0: 41, 1: 127, 2: 147, 3: 77, 4: 26, 5: 12, 6: 2,
    }  # fmt: skip
    assert (table["count"] == table["fired"].str.split().str.len()).all()


def test_chosen_values_count_what_is_chosen():
    # Two pressures without flow and no 2.5 A: 432 points again, but not the same regions.
    chosen = {
        "FP": [0, 2, 90, 125], "OP": [0, 2, 4], "MC": [0, 1.2, 4], "OT": [50, 90],
        "VPos": [-5, 50, 305], "DVPos": [0, 10],
    }  # fmt: skip
    count = regions(BASE, values=chosen)["count"]
    assert len(count) == 432 and count.max() == 6
    assert [int((count == n).sum()) for n in range(3)] == [38, 110, 144]
    with pytest.raises(ArgumentError, match="expected FP, OP"):
        regions(BASE, values={"FP": [1]})
    with pytest.raises(ArgumentError, match="expected FP, OP"):
        regions(BASE, values={**chosen, "FP": []})
    with pytest.raises(ArgumentError, match="4320000 regions"):
        regions(BASE, values={**chosen, "FP": range(40_000)})


def test_the_matrix_counts_the_regions_that_list_both_codes():
    matrix, table = overlap_matrix(BASE), regions(BASE)
    lists = table["fired"].str.split()
    for a, b in combinations(BASE.codes, 2):
        both = sum(a in fired and b in fired for fired in lists)
        assert matrix.loc[a, b] == matrix.loc[b, a] == both
    assert np.diag(matrix).tolist() == [sum(c in one for one in lists) for c in BASE.codes]


def test_a_point_between_two_terms_is_a_cell_of_its_own():
    assert corners(BASE)["MC"] == [0, 1.25, 2.5, 4.25]
    step = Term("low", (-INF, -INF, 2, 2), Interval.parse("x <= 2"))
    rest = Term("high", (2, 2, INF, INF), Interval.parse("x >= 2"))
    variable = Variable("X", "", 0, 4, (step, rest))
    rules = (Rule("A", (("X", "low"),), 1), Rule("B", (("X", "high"),), 2))
    base = RuleBase((variable,), rules)
    assert regions(base)["fired"].tolist() == ["A", "A B", "B"]
    same = RuleBase((variable,), (rules[0], Rule("B", (("X", "low"),), 2)))
    assert overlaps(same)["relation"].tolist() == ["equal"]
    apart = Term("high", (2, 3, INF, INF), Interval.parse("x > 2"))
    assert overlaps(base.with_term("X", apart)).empty


RIGHT = {
    ("printed", "absent"): {"V2": "normal", "S2": "S1", "Pos2": "normal"},
    ("printed", "normal"): {"V2": "normal", "S1": "Pos1", "S2": "Pos1", "Pos2": "normal"},
    ("printed", "physical"): {"V2": "normal", "S2": "S1", "Pos2": "normal"},
    ("meant", "absent"): {},
    ("meant", "normal"): {"S1": "Pos1", "S2": "Pos2"},
    ("meant", "physical"): {},
}


@pytest.mark.parametrize("crisp", [True, False])
@pytest.mark.parametrize(("how", "wrong"), RIGHT.items())
def test_what_the_published_vectors_are_diagnosed_as(how, wrong, crisp):
    reading, fill = how
    tests = published.vectors("kim2014", reading=reading, fill=fill)
    table = diagnose(BASE, tests, crisp=crisp)
    missed = table[~table["right"]]
    assert dict(zip(missed["expected"], missed["headline"], strict=True)) == wrong


def test_on_a_limit_the_comparison_and_the_ramp_differ():
    tests = pd.DataFrame({"FP": [125], "MC": [2.5]}, index=["P1"])
    assert diagnose(BASE, tests, crisp=True)["right"].tolist() == [False]
    assert diagnose(BASE, tests)["right"].tolist() == [True]


def test_which_rules_fire_on_a_nested_vector():
    table = diagnose(BASE, published.vectors("kim2014")).set_index("expected")["fired"]
    assert table["Pos1"] == "Pos1 S1 Pos3" and table["Pos2"] == "Pos2 S2 Pos4"
    assert table["S1"] == "S1 Pos3" and table["normal"] == ""


def test_a_start_position_of_0_or_100_makes_no_difference():
    tests = published.vectors("kim2014", fill="normal")
    moved = tests.assign(VPos=tests["VPos"].replace(100, 0))
    pd.testing.assert_frame_equal(diagnose(BASE, moved), diagnose(BASE, tests))


def test_the_normal_values_fire_v2_once_the_valve_stands_still():
    tests = published.vectors("kim2014").loc[["normal"]].assign(DVPos=0)
    for crisp in (True, False):
        assert diagnose(BASE, tests, crisp=crisp)["fired"].tolist() == ["V2"]


# The centroid of a fault number.


def test_the_centroid_is_that_of_scikit_fuzzy():
    rng = np.random.default_rng(5)
    samples = {v.name: rng.uniform(v.low, v.high, 40) for v in BASE.variables}
    samples["MC"][::2] = rng.uniform(0, 0.2, 20)
    ours = centroid_codes(BASE, samples)
    # Every corner of a cut triangle must lie on the grid, or nearly so.
    grid = np.linspace(0, 13, 13 * 2000 + 1)
    for row, number in zip(strengths(BASE, samples).strength, ours["centroid"], strict=True):
        shape = np.zeros_like(grid)
        for place, strength in enumerate(row, start=1):
            triangle = skfuzzy.trimf(grid, [place - 0.5, place, place + 0.5])
            shape = np.maximum(shape, np.minimum(strength, triangle))
        if row.any():
            assert skfuzzy.defuzz(grid, shape, "centroid") == pytest.approx(number, abs=1e-3)
        else:
            assert np.isnan(number)


def test_two_faults_make_a_third_that_nobody_has():
    samples = {"MC": [0, 4, 1.2], "VPos": [105, 50, 50], "FP": [0, 125, 90], "OP": [0, 4, 0]}
    table = centroid_codes(BASE, samples)
    assert table["active"].tolist() == ["S1 Pos3", "P1 V1", ""]
    assert table["centroid"].tolist()[:2] == [8.5, 3.0]
    assert table["nearest"].tolist() == ["O1", "P2", "normal"]
    assert table["headline"].tolist() == ["S1", "P1", "normal"]


def test_one_fault_alone_keeps_its_number_and_none_is_none():
    tests = published.vectors("kim2014").loc[["G1", "P1", "P2", "V1", "V2", "O1", "Pos3"]]
    table = centroid_codes(BASE, tests)
    assert table["nearest"].tolist() == tests.index.tolist()
    assert table["centroid"].tolist() == [1, 2, 3, 4, 5, 8, 11]
    assert centroid_codes(BASE, {"OT": [float("nan")]})["nearest"].tolist() == ["unknown"]


def test_of_the_nested_vectors_the_centroid_names_half_and_those_by_chance():
    tests = published.vectors("kim2014").loc[["S1", "S2", "Pos1", "Pos2"]]
    table = centroid_codes(BASE, tests)
    # (6 + 9 + 11) / 3 happens to lie near 9, (7 + 10 + 12) / 3 near 10.
    assert table["nearest"].tolist() == ["O1", "Pos1", "Pos1", "Pos2"]
    assert table["headline"].tolist() == tests.index.tolist()
