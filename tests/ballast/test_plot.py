import numpy as np
import pytest
from matplotlib.figure import Figure

from shipnet.ballast.diagnosis import diagnose_run
from shipnet.ballast.plant import Command, Fault
from shipnet.ballast.scan import System, status_poll
from shipnet.ballast.simulation import simulate
from shipnet.modbus.faults import DeadSlave


def axes():
    return Figure().subplots()


def test_the_bars_of_the_screen_show_the_openings():
    system = System(5, status_poll(9600), opening=[0, 1, 0.4, 0, 0.5])
    run = simulate(system, faults=DeadSlave(4), until=3)
    ax = run.screen().plot(ax=axes(), columns=3)
    bars = [bar for bar in ax.patches if bar.get_linewidth() != 0.5]
    heights = np.array([bar.get_height() for bar in bars]) / 0.62
    assert heights == pytest.approx([0.05 / 0.62, 1, 0.4, 0.05 / 0.62, 0.5])
    assert [bar.get_y() for bar in bars] == [1, 1, 1, 0, 0]
    said = [text.get_text() for text in ax.texts[:-1]]
    assert said == ["0", "1", "100", "2", "40", "3", "-", "4", "50", "5"]
    legend = [text.get_text() for text in ax.get_legend().get_texts()]
    assert legend == ["open", "closed", "part open", "silent"]


def test_the_operating_display_shows_every_sensor_in_percent_of_its_scale():
    run = simulate(1, [Command("open", 1.0)], until=12)
    ax = run.plot(ax=axes())
    fp, _, mc, ot, position = (line.get_ydata() for line in ax.lines)
    assert fp == pytest.approx(run.samples["FP"][:, 0] / 1.6)
    assert mc == pytest.approx(run.samples["MC"][:, 0] / 0.06)
    assert ot == pytest.approx(run.samples["OT"][:, 0] / 1.5)
    assert position == pytest.approx(run.samples["VPos"][:, 0])
    assert ax.get_ylabel() == "of full scale [%]"
    assert "MC, 100 % = 6 A" in [text.get_text() for text in ax.get_legend().get_texts()]


def test_the_diagnosis_names_what_is_active_and_how_strongly_it_fired():
    run = simulate(2, [Command("open", 1.0)], until=20, faults=[Fault("P1", valves=2)])
    diagnosis = diagnose_run(run)
    ax = diagnosis.plot(2, ax=axes())
    widths = dict(zip(diagnosis.base.codes, [bar.get_width() for bar in ax.patches], strict=True))
    assert (widths["P1"], widths["V2"], widths["G1"]) == (1, 1, 0)
    assert ax.get_title("left") == "diagnosis of valve 2: P1, also V2"
    assert diagnosis.plot(ax=axes()).get_title("left") == "diagnosis of valve 2: P1, also V2"
    assert diagnosis.plot(1, ax=axes()).get_title("left") == "diagnosis of valve 1: normal"
    colours = [bar.get_facecolor() for bar in ax.patches]
    assert colours[1] == colours[4] != colours[0]
