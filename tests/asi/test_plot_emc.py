import matplotlib as mpl
import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure

from shipnet import style
from shipnet.asi.emc.immunity import levels_table
from shipnet.asi.emc.plot import plot_error_rate, plot_levels


@pytest.fixture
def ax():
    with mpl.rc_context():
        yield Figure(figsize=(6.4, 4)).subplots()


def names(ax):
    return [label.get_text() for label in ax.get_yticklabels()]


def test_every_test_that_a_ship_asks_for_has_its_row(ax):
    assert plot_levels(ax=ax) is ax
    table = levels_table()
    asked = table.loc[table["gap"] != "not asked", "test"].unique()
    shown = {name.removesuffix(", highest frequency") for name in names(ax)}
    assert shown == set(asked) - {"burst"}
    assert len(names(ax)) == len(set(names(ax))) == 12
    assert ax.get_xlabel() == "AS-i level over marine level [1]"
    assert ax.get_xscale() == "log"


def test_dots_stand_at_the_ratio_and_show_what_is_wrong_or_unsure(ax):
    plot_levels(ax=ax)
    dots = {line.get_ydata()[0]: line for line in ax.lines if line.get_marker() in ("o", "x")}
    texts = [text.get_text() for text in ax.texts]
    seen = {name: (dots[y], texts[y]) for y, name in enumerate(names(ax))}
    contact, text = seen["electrostatic discharge, contact"]
    assert contact.get_xdata()[0] == pytest.approx(4 / 6)
    assert contact.get_color() == contact.get_markerfacecolor() == style.LIMIT["color"]
    assert text == "4 kV, ship 6 kV"
    signal, text = seen["burst, signal lines"]
    assert signal.get_xdata()[0] == 2
    assert signal.get_color() == "C0"
    assert signal.get_markerfacecolor() == "white"
    assert text == "2 kV, ship 1 kV (not confirmed)"
    surge, text = seen["surge, line to line"]
    assert surge.get_marker() == "x"
    assert surge.get_color() == style.LIMIT["color"]
    assert surge.get_xdata()[0] < 0.5
    assert text == "no test, ship 0.5 kV"
    assert "what a ship asks for" in texts


def test_another_table_moves_the_dots(ax):
    table = levels_table()
    table.loc[0, "ratio"], table.loc[0, "gap"] = 1.5, "covers"
    plot_levels(table=table, ax=ax)
    dot = next(line for line in ax.lines if line.get_marker() == "o")
    assert dot.get_xdata()[0] == 1.5
    assert dot.get_color() == "C0"


def test_rates_have_their_intervals_and_zeros_an_arrow(ax):
    table = pd.DataFrame(
        {
            "amplitude_V": [0.1, 0.5, 0.6],
            "failed": [0, 3, 20],
            "rate": [0, 0.03, 0.2],
            "rate_low": [0, 0.01, 0.13],
            "rate_high": [0.04, 0.08, 0.29],
        }
    )
    assert plot_error_rate(table, ax=ax, label="noise") is ax
    points, arrows = ax.containers
    assert points.lines[0].get_xydata().tolist() == [[0.5, 0.03], [0.6, 0.2]]
    ends = np.sort([segment[:, 1] for segment in points.lines[2][0].get_segments()])
    assert ends == pytest.approx(np.array([[0.01, 0.08], [0.13, 0.29]]))
    assert arrows.lines[0].get_xydata().tolist() == [[0.1, 0.04]]
    assert arrows.lines[0].get_color() == points.lines[0].get_color()
    assert ax.get_yscale() == "log"
    assert ax.get_xlabel() == "amplitude [V]"
    assert ax.get_legend_handles_labels()[1] == ["noise"]
    ax.figure.draw_without_rendering()


def test_a_table_without_failures_can_be_drawn(ax):
    table = pd.DataFrame(
        {"amplitude_V": [0.1], "failed": [0], "rate": [0.0], "rate_low": [0.0], "rate_high": [0.1]}
    )
    plot_error_rate(table, ax=ax)
    plot_error_rate(table.iloc[:0], ax=ax)
    ax.figure.draw_without_rendering()
