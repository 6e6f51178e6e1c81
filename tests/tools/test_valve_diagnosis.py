from math import nan

import numpy as np
import pytest
from matplotlib.figure import Figure

from shipnet.__main__ import main
from shipnet.ballast import Command, simulate
from shipnet.ballast.actuator import Actuator
from shipnet.ballast.plant import FAULTS, Fault, faulty
from shipnet.errors import ArgumentError, InputError
from shipnet.tools.valve_diagnosis import STATES, ValveDiagnosis
from tests.ballast.nominal import operating_point
from tests.tools.test_tools_page import load


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


# Logs ---------------------------------------------------------------------------------------------

ROWS = ["90,2,1.2,50,50,11", "127,10,1.2,50,50,0", ",2,1.2,50,50,11"]
TITLES = "time_s,FP,OP,MC,OT,VPos,DVPos\n"


def log_of(*kinds):
    return TITLES + "".join(f"{t},{ROWS[kind]}\n" for t, kind in enumerate(kinds))


def test_the_log_of_a_simulated_valve_is_diagnosed_as_by_the_command(tmp_path, capsys):
    run = simulate(2, [Command("open", 1.0)], faults=Fault("V1", valves=2), until=25, rng=2024)
    columns = dict(zip(run.valve(2).columns, ["FP", "OP", "MC", "OT", "VPos"], strict=False))
    file = tmp_path / "log.csv"
    run.valve(2)[[*columns]].rename(columns=columns).to_csv(file)
    page = ValveDiagnosis(threshold=0.6).explore()
    load(page.uploads["open a log"], file.read_bytes(), "log.csv")
    assert "log.csv is loaded<br>DVPos computed from VPos" in page._noted.value
    tool = page.inputs
    assert tool.verdict == "V1 in 200 of 251 samples" and not tool.ok and tool.threshold == 0.6
    assert list(tool.numbers) == ["1.2 to 21.1 s"]
    main(["diagnose", str(file)])
    assert "251 samples: 200 V1, 51 normal" in capsys.readouterr().out
    assert tool._view().data()["top"].value_counts().to_dict() == {"V1": 200, "normal": 51}
    # The readings' controls have no effect, and a simulated valve takes the place of the log.
    assert "No effect now: the log has" in page._controls._rows["FP"].children[1].value
    page.presets["fault"].value = "P1"
    assert page.inputs.log == "" and page.text.startswith("P1")


def test_a_code_is_active_after_three_of_five_samples_and_spans_are_explained():
    tool = ValveDiagnosis(log=log_of(0, 0, 1, 1, 1, 0, 0, 0, 0, 1, 2, 2, 2))
    assert tool.verdict.startswith("V1 in 3")
    ax = tool.plot(axes())
    labels = [text.get_text() for text in ax.get_yticklabels()]
    assert labels[2] == "V1  valve stuck" and ax.get_xlabel() == "time [s]"
    lines = [line for line in ax.collections if len(getattr(line, "get_segments", list)())]
    spans = [tuple(segment[:, 0]) for segment in lines[0].get_segments()]
    assert spans == [(4, 5), (5, 6), (6, 7)]
    narrow = axes()
    tool._view().narrow(narrow)
    assert [text.get_text() for text in narrow.get_yticklabels()][2] == "V1"


@pytest.mark.parametrize(("kinds", "verdict"), [((0,), "normal in all of 1 samples"), ((1,), "1")])
def test_a_log_of_one_sample_has_a_diagnosis_and_a_figure(kinds, verdict):
    tool = ValveDiagnosis(log=log_of(*kinds))
    assert verdict in tool.verdict and tool.plot(axes()).get_xlim() == (0, 1)


def test_many_diagnoses_are_counted():
    tool = ValveDiagnosis(log=log_of(*[0, 0, 0, 0, 0, 1, 1, 1] * 12))
    assert len(tool.numbers) == 9 and tool.numbers["later"].startswith("4 more")


@pytest.mark.parametrize("text", ["x", TITLES, "a,b\n1,2\n", TITLES + "0,x,2,1.2,50,50,11\n"])
def test_a_log_with_faults_is_refused_with_its_row(text):
    with pytest.raises(InputError, match=r"^the log: "):
        _ = ValveDiagnosis(log=text).verdict
    page = ValveDiagnosis().explore()
    load(page.uploads["open a log"], text.encode(), "own.csv")
    assert page.note.startswith("own.csv: ") and page.inputs == ValveDiagnosis()
