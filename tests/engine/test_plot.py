import numpy as np
import pytest

from shipnet.engine import plot
from shipnet.engine.faults import DeadBox
from shipnet.engine.run import Screen, SyntheticValues
from shipnet.engine.simulation import simulate
from shipnet.engine.system import System
from shipnet.errors import ArgumentError

PHASES = {"JB1": 0.1, "JB2": 0.2, "JB3": 0.3, "AMS": 0.0}


@pytest.fixture(scope="module")
def run():
    return simulate(System(), until=20, faults=[DeadBox("JB2", start=10)], phases=PHASES)


@pytest.fixture(scope="module")
def values(run):
    return SyntheticValues(run.system.points, np.random.default_rng(2024))


def test_a_screen_marks_old_and_marked_values_by_text_too(ax, run, values, monkeypatch):
    texts, outline = [], plot._outline
    monkeypatch.setattr(plot, "_outline", lambda text: texts.append(text) or outline(text))
    run.screen(13.0, values).plot(ax)
    assert len(texts) == 2 * 99 and "0xFF" not in texts
    assert sum(text.endswith("*") for text in texts) == 18
    texts.clear()
    run.screen(16.0, values).plot(ax)
    assert texts.count("0xFF") == 18


def test_a_screen_of_few_points_is_drawn_without_options(ax, run, values):
    screen = run.screen(13.0, values)
    screen = Screen(screen.time, screen.table().head(3))
    assert len(screen.plot(ax).collections[0].get_paths()) == 3
    with pytest.raises(ArgumentError, match="columns is 0"):
        screen.plot(ax, columns=0)


def test_an_empty_timeline_is_refused(ax, run):
    with pytest.raises(ArgumentError, match="table has 0 rows"):
        run.plot_timeline(50, 51, ax)


def test_a_timeline_has_all_bars_and_a_row_for_each_sender_of_frames(ax, run):
    run.plot_timeline(1.0, 1.5, ax)
    table = run.timeline(1.0, 1.5)
    assert sum(len(bars.get_paths()) for bars in ax.collections) == len(table)
    rows = [label.get_text() for label in ax.get_yticklabels()]
    senders = {f"CAN, {task}" for task in table.loc[table["row"] == "CAN", "task"]}
    assert senders == {row for row in rows if row.startswith("CAN")} and len(senders) > 1
    assert len(ax.get_legend().get_texts()) <= 7


def test_ages_are_drawn_as_a_sawtooth_with_the_values_of_the_table(ax, run):
    run.plot_ages("ME-JB2-044", ax, limits={"rule": 2.0}, label="point")
    ages = run.ages("ME-JB2-044")
    saw = ax.lines[0].get_ydata()
    assert np.nanmax(saw) == pytest.approx(ages["last_age_s"].max())
    assert np.nanmax(saw) == pytest.approx(run.table().loc["ME-JB2-044", "worst_s"])
    bad = ages[ages["good_until_s"] < ages["until_s"]]
    assert len(bad) > 0 and not ax.collections
    # The background is shaded at all ages: a bar at some age would look like a value.
    spans = [(patch.get_x(), patch.get_x() + patch.get_width()) for patch in ax.patches]
    assert np.allclose(spans, bad[["good_until_s", "until_s"]])
    assert all(patch.get_height() == 1 for patch in ax.patches)
    assert ax.lines[1].get_ydata()[0] == 2.0


def test_a_value_on_the_screen_is_that_of_its_sampling_time(run, values):
    table = run.screen(13.0, values).table()
    for place in (0, 50, 98):
        sampled = 13.0 - table["age_s"].iloc[place]
        assert table["value"].iloc[place] == np.round(values.at(place, sampled))
    assert table.loc[table["box"] == "JB2", "age_s"].min() > 2.5


def test_a_good_reading_of_255_looks_like_an_error_in_the_printed_coding_only(values):
    # Take the exhaust gas temperature that stays at 255 for longest.
    times = np.arange(0, 900, 0.5)
    at_255 = [np.abs(values.at(place, times) - 255) < 0.4 for place in range(10, 30)]
    exhaust = 10 + int(np.argmax([there.sum() for there in at_255]))
    near = times[np.flatnonzero(at_255[exhaust - 10])[2]]
    marks = {}
    for system in (System(), System.corrected()):
        run = simulate(system, until=910)
        seen = np.arange(max(near - 3, 1), near + 6, 0.25)
        marks[system.coding] = {run.screen(t, values).table()["mark"].iloc[exhaust] for t in seen}
    assert "0xFF?" in marks["printed"]
    assert marks["corrected"] == {""}


def test_synthetic_values_stay_within_their_ranges(values):
    for place, point in enumerate(values.points):
        found = values.at(place, np.linspace(0, 3600, 500))
        assert (found >= point.low).all()
        assert (found <= point.high).all()


def test_a_screen_outside_the_run_is_refused(run, values):
    with pytest.raises(ArgumentError, match=r"time is 0 s; it must be 0\.25"):
        run.screen(0, values)
    with pytest.raises(ArgumentError, match="time is 99"):
        run.screen(99, values)
    other = SyntheticValues(run.system.points[:5], np.random.default_rng(0))
    with pytest.raises(ArgumentError, match="values are for other points"):
        run.screen(5, other)
