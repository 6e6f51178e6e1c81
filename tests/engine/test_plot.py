import matplotlib.pyplot as plt
import numpy as np
import pytest

from shipnet.engine import plot
from shipnet.engine.faults import CanBreak, DeadBox, StuckSensor
from shipnet.engine.run import SyntheticValues
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


def texts(ax):
    return [text.get_text() for text in ax.texts]


@pytest.fixture
def shown(monkeypatch):
    """Collect the texts of a screen with the outlines that draw them."""
    drawn, outline = [], plot._outline

    def draw(text):
        drawn.append((text, outline(text)))
        return drawn[-1][1]

    monkeypatch.setattr(plot, "_outline", draw)
    return drawn


def test_a_timeline_has_a_row_for_each_cpu_and_line(ax, run):
    table = run.timeline(1.0, 1.5)
    run.plot_timeline(1.0, 1.5, ax)
    rows = [label.get_text() for label in ax.get_yticklabels()]
    assert rows == ["JB1", "JB2", "JB3", "CAN", "channel 1"]
    drawn = sum(len(bars.get_paths()) for bars in ax.collections)
    assert drawn == len(table)
    assert ax.get_xlabel() == "time [ms]"
    legend = [text.get_text() for text in ax.get_legend().get_texts()]
    assert {"Modbus interrupt", "CAN interrupt", "convert", "frame of JB2"} <= set(legend)
    with pytest.raises(ArgumentError, match="table has 0 rows"):
        run.plot_timeline(50, 51, ax)


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
    assert texts(ax) == ["rule"]


def test_a_screen_distinguishes_good_old_and_marked_values_by_text_too(ax, run, values, shown):
    run.screen(13.0, values).plot(ax)
    said = [text for text, _ in shown]
    assert len(said) == 2 * 99
    assert sum(text.endswith("*") for text in said) == 18
    assert "0xFF" not in said
    ax.clear()
    shown.clear()
    run.screen(16.0, values).plot(ax)
    assert [text for text, _ in shown].count("0xFF") == 18


def test_a_screen_can_be_read_and_has_units(run, values, shown):
    figure, ax = plt.subplots(figsize=(7.5, 4.6), layout="constrained")
    run.screen(13.0, values).plot(ax)
    table = run.screen(13.0, values).table()
    figure.canvas.draw()
    width = ax.transData.transform([1, 0])[0] - ax.transData.transform([0, 0])[0]
    sizes = [outline.get_extents().size * figure.dpi / 72 for _, outline in shown]
    assert max(wide for wide, _ in sizes) < 0.94 * width
    # Capitals of a 9-point font.
    assert min(high for _, high in sizes) > 0.7 * 9 * figure.dpi / 72
    # The texts are in their tiles, so they cover the axes.
    full = np.array(figure.canvas.buffer_rgba())
    ax.collections[-1].set_visible(False)
    figure.canvas.draw()
    written = np.argwhere((full != figure.canvas.buffer_rgba()).any(axis=2))
    spread = np.ptp(written, axis=0) / ax.bbox.size[::-1]
    assert all(0.9 < spread) and all(spread < 1)
    said = [text.rstrip("*") for text, _ in shown[::2]]
    expected = [f"{v:g} {u}".rstrip() for v, u in zip(table["value"], table["unit"], strict=True)]
    assert said == expected
    plt.close(figure)


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


@pytest.mark.parametrize("topology", ["line", "ring"])
def test_the_outline_has_all_parts_and_the_faults_in_red(ax, topology):
    system = System(topology=topology)
    faults = [CanBreak("JB1-JB2"), DeadBox("JB3"), StuckSensor("ME-JB1-001")]
    system.plot(faults, ax)
    shown = texts(ax)
    assert {"AMS", "JB1\n43 points", "JB3\n38 points", " channel 1", " channel 2"} <= set(shown)
    assert {"CAN cable cut JB1-JB2", "box dead JB3", "sensor stuck ME-JB1-001"} <= set(shown)
    cables = [line for line in ax.lines if line.get_color() == "#0072B2"]
    assert len(cables) == len(system.segments)
    assert sum(line.get_marker() == "X" for line in ax.lines) == 3
