import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shipnet.ballast.rule_table import rule_base
from shipnet.errors import ArgumentError
from shipnet.fuzzy import Firing

BASE = rule_base()


def firing_of(strength):
    """Return a firing with given strengths; the sensor values do not matter."""
    array = np.asarray(strength, dtype=float)
    zeros = dict.fromkeys(BASE.names, np.zeros(array.shape[:-1]))
    return Firing(BASE, zeros, array, array)


def of_rule(code, column):
    strength = np.zeros((len(column), len(BASE.codes)))
    strength[:, BASE.codes.index(code)] = column
    return firing_of(strength)


@given(
    st.lists(
        st.lists(st.sampled_from([0.0, 0.49, 0.5, 1.0]), min_size=12, max_size=12), min_size=1
    ),
    st.integers(1, 7).flatmap(lambda n: st.tuples(st.integers(1, n), st.just(n))),
)
def test_persistence_counts_the_last_samples(strength, k_n):
    k, n = k_n
    decision = firing_of(strength).decide(k=k, n=n)
    fires = np.array(strength) >= 0.5
    for place, active in enumerate(decision.active):
        window = fires[max(0, place - n + 1) : place + 1]
        assert active.tolist() == (window.sum(axis=0) >= k).tolist()


@given(st.lists(st.booleans(), min_size=12, max_size=12))
def test_the_top_code_is_the_active_code_of_the_highest_priority(fires):
    decision = firing_of([fires]).decide()
    active = {code for code, fired in zip(BASE.codes, fires, strict=True) if fired}
    expected = next((code for code in BASE.ranking if code in active), "normal")
    assert decision.top.tolist() == [expected]
    assert set(decision.codes(0)) == active
    assert decision.codes(0)[:1] == ((expected,) if active else ())


def test_each_unit_has_its_own_persistence():
    rng = np.random.default_rng(7)
    strength = rng.uniform(0, 1, (40, 3, 12))
    together = firing_of(strength).decide(k=3, n=5)
    for unit in range(3):
        alone = firing_of(strength[:, unit]).decide(k=3, n=5)
        assert np.array_equal(together.active[:, unit], alone.active)
        assert together.top[:, unit].tolist() == alone.top.tolist()
    assert together.codes(39, 2) == alone.codes(39)


def test_without_any_sensor_the_state_is_undetermined():
    firing = BASE.fire({"OT": [math.nan, 50, 95, math.nan]})
    decision = firing.decide()
    assert decision.top.tolist() == ["undetermined", "undetermined", "O1", "undetermined"]
    assert decision.explain(0) == (
        "undetermined: cannot exclude G1 P1 V1 P2 V2 Pos1 Pos2 S1 S2 Pos3 Pos4 O1; "
        "missing FP OP MC OT VPos DVPos"
    )
    # A persistent fault is reported even while its sensor is silent.
    assert BASE.fire({"OT": [95, math.nan]}).decide(k=1, n=2).top.tolist() == ["O1"] * 2


def test_the_table_has_the_decisions_and_the_bad_sensors():
    readings = {"FP": 90, "MC": [0, 0, 9], "VPos": [105, 50, 50], "OP": [2, 2, 2], "DVPos": 9}
    table = BASE.fire(readings).decide().table()
    assert table.iloc[0].tolist() == ["Pos1", 1.0, "Pos1 S1 Pos3", "O1", "OT", ""]
    assert table.iloc[1].fillna("").tolist() == ["undetermined", "", "", "O1", "OT", ""]
    assert BASE.fire(readings | {"OT": 50}).decide().table()["strength"].tolist() == [1, 1, 1]
    assert table["out_of_range"].tolist() == ["", "", "MC"]


def test_the_sentence_names_terms_values_and_degrees():
    full = {"MC": 1.2, "OT": 50, "VPos": 50, "DVPos": 10}
    decision = BASE.fire({"FP": [124, 116, 90], "OP": [2.83, 9, 2], **full}).decide()
    assert decision.explain(0) == "V1 0.83: FP 124 bar high 0.90, OP 2.83 bar high 0.83"
    assert decision.explain(1) == (
        "normal 0.90; closest V1 0.10: FP 116 bar high 0.10, OP 9 bar high 1.00"
    )
    assert decision.explain(-1) == "normal 1.00"


def test_the_sentence_names_the_other_codes_and_bad_sensors():
    decision = BASE.fire({"VPos": [[330.0]], "MC": [[0]], "FP": 400}).decide()
    assert decision.explain(0, 0) == (
        "S1 1.00: MC 0 A zero 1.00, VPos 330 % above open 1.00; also Pos3 1.00; "
        "cannot exclude G1 V1 V2 Pos1; missing OP OT DVPos; out of range FP 400 bar"
    )


def test_strengths_that_are_not_a_matrix_are_not_drawn():
    with pytest.raises(ArgumentError, match="at most two can be drawn"):
        BASE.fire({"FP": [[1]]}).plot()
    with pytest.raises(ArgumentError, match="2 labels; expected 1"):
        BASE.fire({"FP": [1]}).plot(["a", "b"])


@pytest.mark.parametrize("index", [(), (3,), (-4,), (0, 0)])
def test_an_index_outside_the_samples_is_refused(index):
    decision = of_rule("V1", [1, 1, 1]).decide()
    said = r"index is .*; for samples of shape \(3,\), it must be 0\.\.2"
    with pytest.raises(ArgumentError, match=said):
        decision.explain(*index)
    with pytest.raises(ArgumentError, match=said):
        decision.codes(*index)


@pytest.mark.parametrize(
    "arguments",
    [
        {"threshold": 0},
        {"threshold": 1.01},
        {"threshold": math.nan},
        {"threshold": "0.5"},
        {"k": 0},
        {"k": 2},
        {"n": 0},
        {"k": 6, "n": 5},
        {"k": 1.5, "n": 3},
        {"n": True},
    ],
)
def test_arguments_out_of_range_are_refused(arguments):
    with pytest.raises(ArgumentError, match=f"{next(iter(arguments))} is"):
        of_rule("V1", [1, 1, 1]).decide(**arguments)


def test_one_sample_has_no_past():
    firing = BASE.fire({"OT": 95})
    assert firing.decide().top[()] == "O1"
    assert firing.decide().explain().startswith("O1 1.00: OT 95 degC hot 1.00")
    with pytest.raises(ArgumentError, match="time axis"):
        firing.decide(k=1, n=2)
    assert firing.decide().table()["top"].tolist() == ["O1"]
    assert repr(firing.decide()).startswith("Decision(O1 1.00")
    assert repr(BASE.decide({"OT": [95, 50, 50]})) == "Decision(3 samples: 1 O1, 2 undetermined)"
    with pytest.raises(ArgumentError, match="at most two fit in a table"):
        BASE.decide({"OT": [[95]]}).table()


@pytest.mark.parametrize(
    ("pressure", "ok", "verdict"),
    [
        ([90, 90], True, "2 samples: 2 normal"),
        ([90, 125], False, "2 samples: 1 V1, 1 normal"),
        ([90, np.nan], None, "2 samples: 1 normal, 1 undetermined"),
        ([125, np.nan], False, "2 samples: 1 V1, 1 undetermined"),
        ([], True, "0 samples: "),
    ],
)
def test_a_decision_is_good_if_every_sample_is_normal(pressure, ok, verdict):
    other = {"OP": 4, "MC": 1.2, "OT": 50, "VPos": 50, "DVPos": 9}
    decision = rule_base().decide({"FP": pressure, **other})
    assert (decision.ok, decision.verdict) == (ok, verdict)
    assert repr(decision) == f"Decision({verdict})"


def test_a_decision_is_drawn_as_its_strengths(ax):
    decision = rule_base().decide({"FP": [90, 125], "OP": 4})
    assert decision.plot(ax=ax) is ax
    assert ax.images[0].get_array().T.tolist() == decision.firing.strength.tolist()
