from math import nan

import numpy as np
import pytest
from matplotlib.figure import Figure

from shipnet.ballast.actuator import Actuator
from shipnet.ballast.plant import FAULTS, Fault, faulty
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


def test_an_unknown_fault_or_state_is_named():
    with pytest.raises(ArgumentError, match="fault is 'V9'"):
        ValveDiagnosis.from_plant("V9")
    with pytest.raises(ArgumentError, match="state is 'flying'"):
        ValveDiagnosis.from_plant("V1", state="flying")
    with pytest.raises(ArgumentError, match=r"severity is 1\.5"):
        ValveDiagnosis.from_plant("V1", 1.5)


def test_a_fault_sets_the_sliders_but_not_the_threshold():
    page = ValveDiagnosis().explore()
    controls, plant = page.controls, page.presets
    plant["fault"].value = "V1"
    assert "V1: valve stuck" in page.text
    assert controls["FP"].value == pytest.approx(ValveDiagnosis.from_plant("V1").FP, abs=0.025)
    plant["severity"].value = 0.0
    assert "normal" in page.text
    plant["severity"].value, plant["state"].value = 1.0, "at rest, closed"
    assert not controls["commanded"].value
    controls["threshold"].value = 1.0
    plant["state"].value = "opening"
    assert controls["threshold"].value == 1.0
