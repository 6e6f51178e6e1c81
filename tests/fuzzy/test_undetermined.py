"""What a rule base says when readings are missing or cannot be readings."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shipnet import ballast
from shipnet.errors import ArgumentError
from shipnet.fuzzy import Rule, RuleBase, Term, Variable
from shipnet.fuzzy.firing import METHODS

BASE = ballast.rule_base()
NAN = math.nan
HEALTHY = {"FP": 90, "OP": 2, "MC": 1.2, "OT": 50, "VPos": 50, "DVPos": 10}


def sensor(variable):
    """Draw a reading at or near a limit of a variable, within its universe, missing or absurd."""
    limits = [x for t in variable.terms for x in (*t.corners, t.crisp.low, t.crisp.high)]
    usual = sorted({x for x in limits if variable.low <= x <= variable.high})
    inside = st.one_of(st.sampled_from(usual), st.floats(variable.low, variable.high))
    return st.one_of(inside, inside, st.sampled_from([NAN, -1e4, 1e4, math.inf, -math.inf]))


readings = st.fixed_dictionaries({v.name: sensor(v) for v in BASE.variables})
methods = st.sampled_from(METHODS)
thresholds = st.sampled_from([0.1, 0.5, 1.0])


def top(vector, method="fuzzy", threshold=0.5):
    return BASE.decide(vector, method, threshold=threshold).top[()]


def lost(name, x):
    """Return whether a reading is missing, or outside 3.6..21 mA on a scale of 4..20 mA."""
    milliamperes = 4 + 16 * (x - BASE[name].low) / (BASE[name].high - BASE[name].low)
    return not 3.6 <= milliamperes <= 21


@given(readings, methods, thresholds, st.sampled_from(BASE.names))
def test_no_reading_turns_normal_by_its_loss(vector, method, threshold, name):
    before = top(vector, method, threshold)
    after = top({**vector, name: NAN}, method, threshold)
    assert after != "normal" or before == "normal"


@given(readings, st.sets(st.sampled_from(BASE.names)), methods, thresholds)
def test_no_reading_that_is_found_turns_normal_into_a_fault(vector, gone, method, threshold):
    vector |= dict.fromkeys(gone, NAN)
    if top(vector, method, threshold) == "normal":
        cells = BASE.regions("midpoint" if method == "fuzzy" else method)
        remaining = {name: x for name, x in vector.items() if not lost(name, x)}
        decision = BASE.decide(
            cells[list(BASE.names)].assign(**remaining), method, threshold=threshold
        )
        assert set(decision.top) == {"normal"}


@given(readings, methods, thresholds)
def test_undetermined_means_that_some_readings_would_fire_an_open_rule(vector, method, threshold):
    decision = BASE.decide(vector, method, threshold=threshold)
    opened = [code for code, flag in zip(BASE.codes, decision.open, strict=True) if flag]
    assert (decision.top[()] == "undetermined") == (bool(opened) and not decision.active.any())
    for code in opened:
        filled = dict(vector)
        for variable, term in BASE.terms_of(BASE.rule(code)):
            if lost(variable.name, vector[variable.name]):
                places = [*np.linspace(variable.low, variable.high, 101), *term.corners[1:3]]
                places += [
                    x + d for x in (term.crisp.low, term.crisp.high) for d in (-1e-3, 0, 1e-3)
                ]
                holds = term.crisp.contains if method == "crisp" else term.midpoint.contains
                inside = [x for x in places if variable.low <= x <= variable.high]
                full = [x for x in inside if term.membership(x) == 1 and holds(x)]
                filled[variable.name] = full[0] if full else next(x for x in inside if holds(x))
        assert code in BASE.decide(filled, method, threshold=threshold).codes()


@given(
    st.lists(readings, min_size=1, max_size=9), methods, st.sampled_from([(1, 1), (2, 3), (3, 5)])
)
def test_arrays_have_the_decisions_of_their_samples_and_of_plain_loops(rows, method, k_n):
    k, n = k_n
    table = {name: [row[name] for row in rows] for name in BASE.names}
    decision = BASE.decide(table, method, k=k, n=n)
    alone = [BASE.decide(row, method) for row in rows]
    for sample in range(len(rows)):
        window = alone[max(0, sample - n + 1) : sample + 1]
        fired = sum(one.active.astype(int) for one in window)
        could = fired + sum(one.open.astype(int) for one in window)
        assert decision.active[sample].tolist() == (fired >= k).tolist()
        opened = (fired < k) & (could > fired) & (could >= min(k, sample + 1))
        assert decision.open[sample].tolist() == opened.tolist()


def test_one_healthy_reading_is_no_healthy_valve():
    diagnosis = ballast.diagnose(FP=100)
    assert diagnosis.top[()] == "undetermined"
    assert diagnosis.explain() == (
        "undetermined: cannot exclude V2 Pos1 Pos2 S1 S2 Pos3 Pos4 O1; missing OP MC OT VPos DVPos"
    )
    assert ballast.diagnose().top[()] == "undetermined"
    assert ballast.diagnose(HEALTHY).explain() == "normal 1.00"


def test_a_missing_reading_that_decides_nothing_leaves_the_valve_normal():
    decision = ballast.diagnose({**HEALTHY, "OP": NAN})
    assert decision.explain() == "normal 1.00; missing OP"
    row = ballast.diagnose({**HEALTHY, "OP": NAN, "FP": 400}).table().iloc[0]
    assert row[["top", "active", "open", "missing", "out_of_range"]].tolist() == [
        "undetermined",
        "",
        "V1 P2",
        "OP",
        "FP",
    ]
    assert math.isnan(row["strength"])


@pytest.mark.parametrize("method", METHODS)
def test_readings_that_no_sensor_gives_are_missing_and_fire_nothing(method):
    absurd = ballast.diagnose(FP=-50, OT=-400, method=method)
    assert absurd.top[()] == "undetermined" and not absurd.active.any()
    assert absurd.explain().endswith("out of range FP -50 bar, OT -400 degC")
    high = HEALTHY | {"FP": 125}
    for name, x in (("FP", 1e4), ("FP", math.inf), ("MC", -9.0), ("OT", 1e5), ("VPos", -math.inf)):
        diagnosis = ballast.diagnose(
            {**(high if name == "MC" else HEALTHY), name: x}, method=method
        )
        assert diagnosis.top[()] == "undetermined" and f"out of range {name}" in diagnosis.explain()


@pytest.mark.parametrize("method", METHODS)
def test_a_reading_just_beyond_its_scale_still_alarms(method):
    jammed = {**HEALTHY, "FP": 170, "OP": 10.6}
    assert ballast.diagnose(jammed, method=method).top[()] == "V1"
    assert ballast.diagnose({**jammed, "FP": 170.1}, method=method).top[()] == "undetermined"
    assert ballast.diagnose({**HEALTHY, "OT": 159}, method=method).top[()] == "O1"
    assert ballast.diagnose({**HEALTHY, "FP": -4}, method=method).top[()] == "P2"


def test_a_fault_names_the_higher_ranked_faults_that_are_open():
    decision = ballast.diagnose({**HEALTHY, "OT": 95, "MC": NAN, "FP": 125})
    assert decision.explain() == ("O1 1.00: OT 95 degC hot 1.00; cannot exclude G1 P1; missing MC")
    decision = ballast.diagnose({**HEALTHY, "OT": NAN, "MC": 4, "FP": 125})
    assert decision.explain() == "P1 1.00: FP 125 bar high 1.00, MC 4 A over 1.00; missing OT"


def test_what_does_not_apply_is_not_missing():
    readings = {**HEALTHY, "DVPos": NAN}
    assert top(readings) == "undetermined"
    decision = BASE.decide(readings, applies={"DVPos": False})
    assert decision.explain() == "normal 1.00" and not decision.firing.missing.any()
    mixed = BASE.decide({**HEALTHY, "DVPos": [0, 0, NAN]}, applies={"DVPos": [True, False, False]})
    assert mixed.top.tolist() == ["V2", "normal", "normal"]
    # It does not hide that other readings are missing.
    blind = BASE.decide({**readings, "OT": NAN}, applies={"DVPos": False})
    assert blind.explain() == "undetermined: cannot exclude O1; missing OT"


@pytest.mark.parametrize(
    ("applies", "fault"),
    [
        (
            {"PP": True},
            r"applies\['PP'\] has the type bool; it must be a bool mask of one of FP, OP",
        ),
        ({"FP": 1}, r"applies\['FP'\] has the type int64; it must be a bool mask"),
        ({"FP": [True, False]}, r"applies\['FP'\] has the shape \(2,\); the samples have \(\)"),
    ],
)
def test_masks_that_do_not_fit_are_refused(applies, fault):
    with pytest.raises(ArgumentError, match=fault):
        BASE.decide(HEALTHY, applies=applies)


def test_persistence_bridges_a_gap_but_not_an_outage():
    FP = [90, NAN, 90, 90, NAN, NAN, NAN, 90, 90, 90]
    decision = BASE.decide({**HEALTHY, "OP": 4, "FP": FP}, k=3, n=5)
    assert [one[0] for one in decision.top] == list("nnnnnuuuun")
    assert decision.explain(7).startswith("undetermined: cannot exclude")
    assert decision.explain(7).endswith("; missing earlier readings")
    # An alarm that only missing readings keep back is not excluded.
    gaps = BASE.decide({**HEALTHY, "OP": 4, "FP": [125, NAN, NAN] * 4}, k=3, n=5)
    assert set(gaps.top[2:]) == {"undetermined"}
    silent = BASE.decide({"FP": [NAN, NAN]}, k=3, n=5)
    assert silent.top.tolist() == ["undetermined"] * 2


def test_a_rule_base_of_ones_own_follows_the_same_logic():
    hot = Term("hot", (60, 70, math.inf, math.inf), "x > 65")
    level = Term("low", (-math.inf, -math.inf, 10, 20), "x < 15")
    variables = (Variable("T", "degC", 0, 100, (hot,)), Variable("L", "%", 0, 100, (level,)))
    base = RuleBase(variables, (Rule("Dry", "T.hot & L.low", 1), Rule("Hot", "T.hot", 2)))
    decision = base.decide({"T": [20, 90, 90, NAN, 300, 62], "L": [NAN, NAN, 50, 50, 5, NAN]})
    assert decision.top.tolist() == [
        "normal",
        "Hot",
        "Hot",
        "undetermined",
        "undetermined",
        "normal",
    ]
    assert decision.explain(1) == "Hot 1.00: T 90 degC hot 1.00; cannot exclude Dry; missing L"
    assert decision.explain(4) == "undetermined: cannot exclude Dry Hot; out of range T 300 degC"
