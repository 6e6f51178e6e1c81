"""What a master shows of a fleet of valves, beside what is true of them."""

import numpy as np
import pytest
from matplotlib.figure import Figure

from shipnet.ballast.plant import Command, Fault
from shipnet.ballast.scan import System, status_poll
from shipnet.ballast.simulation import simulate
from shipnet.ballast.trials import run_fleet
from shipnet.modbus.redundancy import Loop
from shipnet.modbus.uart import SerialLine
from shipnet.papers.kim2014.faults import age_table, broken_loops, picture_table, seen_strokes
from shipnet.papers.kim2014.plot import plot_ages, plot_seen_strokes

SLOW, QUICK = "one by one, time-out 1 s", "all downstream, time-out 0.1 s"


@pytest.fixture(scope="module")
def pictures():
    return broken_loops()


def test_a_master_of_more_valves_sees_less_of_the_same_stroke():
    seen = seen_strokes([5, 64])
    counts = [run.time.size for run in seen.values()]
    period = Loop(64, status_poll(SerialLine(9600))).period
    assert counts[0] > 10 * counts[1]
    assert np.diff(seen[64].time) == pytest.approx(np.full(counts[1] - 1, period), abs=0.03)
    true = simulate(1, [Command("open", 3.0)], until=15)
    for run in seen.values():
        # The command goes out after the poll under way, and a register has steps of 1 %.
        there = np.interp(run.time, true.time, true.samples["VPos"][:, 0])
        assert np.abs(run.samples["VPos"][:, 0] - there).max() < 3.0


def test_the_oldest_position_of_a_simulated_run_is_that_of_the_formula():
    table = age_table()
    assert table["simulated_s"].to_numpy() == pytest.approx(table["formula_s"].to_numpy(), abs=1e-6)
    assert table.loc[0, "formula_s"] == System(247, status_poll(9600)).worst_age()


def test_a_slow_rule_leaves_a_wrong_picture_and_a_quick_one_does_not(pictures):
    table = picture_table(pictures)
    assert (table["moving"] == 0).all()
    assert table.loc[SLOW, "shown_moving"] == table.loc[SLOW, "wrong"] == 100
    assert table.loc[["no break", QUICK], "wrong"].tolist() == [0, 0]
    assert table.loc["no break", "unanswered"] == 0 < table.loc[QUICK, "unanswered"]
    # If all slaves downstream of the break are moved, hardly any request stays unanswered.
    unanswered = table["unanswered"]
    assert unanswered["all downstream, time-out 1 s"] < 5 < unanswered[SLOW]
    # From before the break to the end nobody beyond it is heard again.
    assert 60.0 - 12.0 < table.loc[SLOW, "oldest_s"] < 60.0
    assert pictures[SLOW].seen.screen().table()["state"].eq("silent").sum() == 0


def test_the_ages_drawn_are_those_of_the_masters(pictures):
    ax = plot_ages(pictures, ax=Figure().subplots(), start=12.0)
    panels = ax.figure.axes[1:]
    lines = {panel.get_title(loc="left"): panel.lines[0].get_ydata() for panel in panels}
    oldest = pictures[SLOW].seen.ages([20.0, 39.0]).max(axis=1)
    assert lines[SLOW][[200, 390]] == pytest.approx(oldest)
    assert np.isnan(lines[SLOW][0])
    assert list(lines) == list(pictures)
    assert "oldest position shown [s]" in {panel.get_ylabel() for panel in panels}


def test_one_marker_is_drawn_for_each_status():
    true, seen = simulate(1, [Command("open", 3.0)], until=15), seen_strokes([5, 64])
    ax = plot_seen_strokes(true, seen, ax=Figure().subplots())
    assert [len(line.get_xdata()) for line in ax.lines[1:]] == [r.time.size for r in seen.values()]
    assert ax.lines[0].get_ydata() == pytest.approx(true.samples["VPos"][:, 0])


def test_the_history_has_a_line_from_each_fault_to_its_report_or_to_the_end():
    orders = [Command("open", 600.0), Command("close", 1500.0)]
    faults = [Fault("V1", start=900.0, valves=2), Fault("O1", start=1000.0, valves=1)]
    report = run_fleet(2, orders, faults=faults, until=1800.0)
    ax = report.plot(Figure().subplots())
    (lines,) = ax.collections
    ends = [(3600 * a[0], 3600 * b[0]) for a, b in lines.get_segments()]
    assert ends[0] == pytest.approx((900.0, 900.0 + report.faults()["detection_time_s"][0]))
    assert ends[1] == pytest.approx((1000.0, 1800.0))
    assert [text.get_text() for text in ax.get_yticklabels()] == ["V1, valve 2", "O1, valve 1"]
    reported = next(line for line in ax.lines if line.get_label() == "reported")
    assert len(reported.get_xdata()) == 1
