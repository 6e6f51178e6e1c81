from math import nan

import numpy as np
import pytest
from matplotlib.figure import Figure

from shipnet.ballast.actuator import Actuator
from shipnet.ballast.plant import FAULTS, Fault, faulty
from shipnet.ballast.rule_table import rule_vectors
from shipnet.ballast.trials import fault_trials
from shipnet.ballast.wear import Wear
from shipnet.errors import ArgumentError
from shipnet.tools.valve_diagnosis import STATES, ValveDiagnosis
from tests.ballast.nominal import operating_point


def axes():
    return Figure().subplots()


@pytest.mark.parametrize("code", ["normal", "P1", "P2", "O1"])
def test_the_plant_sets_the_sensors_to_its_operating_point(code):
    sick, _ = faulty(Actuator(), [] if code == "normal" else [Fault(code)], 1)
    point = operating_point(sick)
    read = ValveDiagnosis.from_plant(code)
    # The readings are near the open end, where the flow exerts no torque; the point is half open.
    assert read.FP == pytest.approx(np.ravel(point.FP)[0], abs=0.5)
    assert read.OP == pytest.approx(np.ravel(point.OP)[0], abs=0.5)
    assert read.MC == pytest.approx(np.ravel(point.MC)[0], abs=0.02)


@pytest.mark.parametrize("code", FAULTS)
def test_every_fault_is_active_in_some_state_and_health_in_all_is_normal(code):
    results = {state: ValveDiagnosis.from_plant(code, state=state).result for state in STATES}
    assert any(code in decision.codes(0) for decision in results.values())
    assert all(ValveDiagnosis.from_plant(state=state).verdict == "normal" for state in STATES)
    mild = [ValveDiagnosis.from_plant(code, 0.0, state).verdict for state in STATES]
    assert mild == ["normal"] * 4


def test_the_papers_vectors_are_diagnosed_as_printed():
    table = rule_vectors(fill="physical")
    for code, row in table.iterrows():
        commanded = bool(row["DVPos"] == row["DVPos"])
        values = {name: float(x) for name, x in row.items()}
        assert ValveDiagnosis(**values, commanded=commanded).result.top[0] == code


def test_standstill_without_a_command_and_a_missing_sensor_fire_nothing():
    assert ValveDiagnosis(DVPos=0.0).result.top[0] == "V2"
    assert ValveDiagnosis(DVPos=0.0, commanded=False).verdict == "normal"
    lost = ValveDiagnosis(FP=nan, MC=4.0)
    assert lost.verdict == "undetermined" and not lost.result.active.any()
    assert lost.result.explain(0) == "undetermined: cannot exclude P1; missing FP"


def test_the_threshold_decides_what_is_active_but_not_what_fires_as_printed():
    half = ValveDiagnosis(FP=119.0, OP=4.0)
    assert half.result.codes(0) == half.printed == ()
    low = ValveDiagnosis(FP=119.0, OP=4.0, threshold=0.4)
    assert low.result.codes(0) == ("V1",)
    assert low.strength["V1"] == pytest.approx(0.4)
    noise = ValveDiagnosis(FP=0.0, MC=0.0, VPos=100.1)
    assert noise.printed == ("Pos1", "S1", "Pos3")
    assert noise.result.codes(0) == ()


@pytest.mark.parametrize(
    ("field", "value", "message"),
    [
        ("FP", 161.0, "FP is 161 bar; it must be 0..160 bar"),
        ("VPos", 321.0, "VPos is 321 %"),
        ("OP", "x", "OP is 'x'"),
        ("MC", None, "MC is None"),
        ("threshold", 0.0, "threshold is 0"),
        ("threshold", nan, "threshold is nan"),
    ],
)
def test_a_value_out_of_range_is_named(field, value, message):
    with pytest.raises(ArgumentError, match=message):
        ValveDiagnosis(**{field: value})


def test_an_unknown_fault_or_state_is_named():
    with pytest.raises(ArgumentError, match="fault is 'V9'"):
        ValveDiagnosis.from_plant("V9")
    with pytest.raises(ArgumentError, match="state is 'flying'"):
        ValveDiagnosis.from_plant("V1", state="flying")
    with pytest.raises(ArgumentError, match=r"severity is 1\.5"):
        ValveDiagnosis.from_plant("V1", 1.5)


def test_the_bars_are_the_strengths_and_crosses_mark_what_is_printed():
    tool = ValveDiagnosis.from_plant("P2", 0.96)
    ax = tool.plot(ax=axes())
    assert [bar.get_width() for bar in ax.patches] == list(tool.strength.values())
    active = [bar.get_facecolor() for bar in ax.patches]
    assert len(set(active)) == 2
    threshold, crosses = ax.lines
    assert set(threshold.get_xdata()) == {0.5}
    codes = list(tool.strength)
    assert [codes[int(y)] for y in crosses.get_ydata()] == ["P2"]


def test_the_sliders_start_where_the_inputs_do_and_a_fault_sets_them():
    page = ValveDiagnosis().explore()
    values = [control.value for control in page.controls.values()]
    assert values == [getattr(ValveDiagnosis(), name) for name in page.controls]
    assert "normal" in page.text
    picture = page.figure.value
    controls, plant = page.controls, page.presets
    plant["fault"].value = "V1"
    assert "V1: valve stuck" in page.text
    assert page.figure.value != picture
    assert controls["FP"].value == pytest.approx(ValveDiagnosis.from_plant("V1").FP, abs=0.025)
    plant["severity"].value = 0.0
    assert "normal" in page.text
    plant["severity"].value, plant["state"].value = 1.0, "at rest, closed"
    assert not controls["commanded"].value
    controls["FP"].value, controls["MC"].value = 125.0, 0.0
    assert "G1: pressure gauge fault" in page.text
    controls["threshold"].value = 1.0
    controls["FP"].value = 124.0
    assert "closest G1 0.90" in page.text
    plant["state"].value = "opening"
    assert controls["threshold"].value == 1.0


def test_the_confusion_matrix_shows_percent_and_frames_correct_results():
    trials = fault_trials(
        ["normal", "Pos3"], n_valves=4, methods=["fuzzy"], rng=np.random.default_rng(1)
    )
    ax = trials.plot(ax=axes())
    assert [text.get_text() for text in ax.texts] == ["100", "100"]
    assert [label.get_text() for label in ax.get_xticklabels()] == ["normal", "Pos3", "S1"]
    assert sorted(p.get_xy() for p in ax.patches) == [(-0.5, -0.5), (0.5, 0.5)]
    assert ax.get_xlabel() == "top-ranked fault [% of the row]"


def test_the_trend_is_drawn_up_to_its_limit_and_a_missing_trend_is_reported():
    wear = Wear.synthetic(1, 300, spread=0.0, rng=np.random.default_rng(1))
    prediction = wear.predict(1, 300)
    ax = prediction.plot(ax=axes())
    labels = [text.get_text() for text in ax.get_legend().get_texts()]
    assert labels == ["readings", "limit", "trend", "95 % interval", "end of life"]
    line = next(one for one in ax.lines if one.get_label() == "trend")
    np.testing.assert_allclose(line.get_ydata(), prediction.trend.at(line.get_xdata()))
    assert ax.get_xlim()[1] > 300 + prediction.remaining.estimate
    assert ax.get_yscale() == "log"
    sound = Wear.synthetic(1, 50, rate=1e-6, spread=0.0, rng=np.random.default_rng(3))
    ax = sound.predict(1, 50).plot(ax=axes())
    assert [t.get_text() for t in ax.get_legend().get_texts()] == ["readings", "limit", "no trend"]
