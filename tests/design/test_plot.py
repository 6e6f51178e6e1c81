from itertools import combinations

import matplotlib as mpl
import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure

from shipnet.design.costs import quantities
from shipnet.design.plant import Plant
from shipnet.design.plot import plot_pareto, plot_quantities, plot_tornado
from shipnet.design.uncertainty import draw, likely, tornado
from shipnet.errors import ArgumentError

PLANT = Plant(modules=8, contacts=4, distance=40)
NETWORKS = {"hardwired": PLANT.hardwired, "AS-i": PLANT.on_asi}
OPTIONS = {name: quantities(network) for name, network in NETWORKS.items()}


@pytest.fixture
def ax():
    with mpl.rc_context():
        yield Figure().subplots()


def spans(collection):
    return [segment[:, 0].tolist() for segment in collection.get_segments()]


def test_options_stand_side_by_side_with_their_ranges(ax):
    ranges = likely(draw(NETWORKS, rng=np.random.default_rng(1), draws=100))
    assert plot_quantities(OPTIONS, "cable mass", ax=ax, likely=ranges) is ax
    assert [bar.get_width() for bar in ax.patches] == [q["cable mass"] for q in OPTIONS.values()]
    bounds, inner = ax.collections
    ends = [q.table.loc["cable mass"] for q in OPTIONS.values()]
    assert spans(bounds) == [[row["low"], row["high"]] for row in ends]
    rows = [ranges.loc[(option, "cable mass")] for option in OPTIONS]
    assert spans(inner) == [[row["low"], row["high"]] for row in rows]
    assert ax.get_xlabel() == "cable mass [kg]"
    assert [label.get_text() for label in ax.get_yticklabels()] == ["hardwired", "AS-i"]


def test_options_can_be_drawn_without_draws(ax):
    plot_quantities({"AS-i": OPTIONS["AS-i"]}, ax=ax)
    assert len(ax.collections) == 1
    with pytest.raises(ArgumentError, match="no option"):
        plot_quantities({}, ax=ax)
    with pytest.raises(ArgumentError, match="figure is 'mass'"):
        plot_quantities(OPTIONS, "mass", ax=ax)


def test_the_tornado_has_its_longest_bars_on_top(ax):
    found = tornado(NETWORKS)
    plot_tornado(found, ax=ax, rows=5)
    low, high = ax.patches[:5], ax.patches[5:]
    ends = found.ends.iloc[:5]
    for bars, level in ((low, "low"), (high, "high")):
        reached = [bar.get_x() + bar.get_width() for bar in bars]
        assert reached == pytest.approx(ends[level].tolist())
    assert {line.get_xdata()[0] for line in ax.lines} >= {found.at_nominal}
    assert ax.get_xlabel() == f"{found.subject} [EUR]"
    assert ax.get_yticklabels()[0].get_text() == found.top(1)[0].replace("_", " ")
    assert ax.get_ylim() == (4.5, -0.5)


def test_level_options_are_marked_only_if_they_are_in_the_picture(ax):
    plot_tornado(tornado(NETWORKS, "cable mass"), ax=ax)
    assert len(ax.lines) == 1
    other = Figure().subplots()
    plot_tornado(tornado({"a": PLANT.on_asi, "b": PLANT.on_asi}), ax=other)
    assert [line.get_xdata()[0] for line in other.lines] == [0, 0]
    assert not other.patches


def test_the_front_joins_the_options_that_none_beats(ax):
    table = pd.DataFrame(
        {"total cost": [3.0, 1.0, 2.0], "worst response": [1.0, 3.0, 4.0]}, index=list("abc")
    )
    best = pd.Series([True, True, False], table.index)
    plot_pareto(table, y="worst response", pareto=best, ax=ax)
    front, *dots = ax.lines
    assert list(zip(*front.get_data(), strict=True)) == [(1, 3), (3, 1)]
    assert [dot.get_markerfacecolor() for dot in dots] == ["C0", "C0", "white"]
    assert [text.get_text() for text in ax.texts] == ["a", "b", "c"]
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("total cost [EUR]", "worst response")
    with pytest.raises(ArgumentError, match="no column conductors at the cabinet"):
        plot_pareto(table, ax=ax)


def test_options_at_the_same_place_share_a_label_and_near_ones_do_not_overlap(ax):
    table = pd.DataFrame(
        {
            "total cost": [217.0, 113.0, 108.0, 108.1, 150.0],
            "cables": [792.0, 34.0, 4.0, 4.0, np.nan],
        },
        index=["home runs", "AS-i", "CAN", "Modbus RTU", "none"],
    )
    ax.figure.set_size_inches(6.4, 2.6)
    plot_pareto(table, y="cables", ax=ax)
    assert [text.get_text() for text in ax.texts] == ["home runs", "AS-i", "CAN, Modbus RTU"]
    ax.figure.draw_without_rendering()
    boxes = [text.get_window_extent() for text in ax.texts]
    assert not any(a.overlaps(b) for a, b in combinations(boxes, 2))
    width = ax.figure.bbox.width
    assert all(0 <= box.x0 and box.x1 <= width for box in boxes)


def test_a_filled_dot_is_not_hidden_by_another(ax):
    table = pd.DataFrame({"total cost": [3.0, 3.0], "cables": [1.0, 1.0]}, index=["a", "b"])
    plot_pareto(table, y="cables", pareto=pd.Series([True, False], table.index), ax=ax)
    _, filled, empty = ax.lines
    assert filled.get_zorder() > empty.get_zorder()


def test_options_that_are_all_at_one_place_have_one_label(ax):
    table = pd.DataFrame({"total cost": [3.0, 3.0], "cables": [0.0, 0.0]}, index=["a", "b"])
    plot_pareto(table, y="cables", ax=ax)
    assert [text.get_text() for text in ax.texts] == ["a, b"]
    nothing = plot_pareto(table.iloc[:0], y="cables", ax=Figure().subplots())
    assert len(nothing.texts) == 0


def test_a_count_has_no_unit(ax):
    table = pd.DataFrame({"conductors at the cabinet": [3.0], "cable mass": [1.0]}, index=["a"])
    plot_pareto(table, x="cable mass", ax=ax)
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("cable mass [kg]", "conductors at the cabinet")


def test_without_a_front_no_option_is_filled(ax):
    table = pd.DataFrame({"total cost": [3.0], "cables": [1.0]}, index=["a"])
    plot_pareto(table, y="cables", ax=ax)
    front, dot = ax.lines
    assert len(front.get_xdata()) == 0
    assert dot.get_markerfacecolor() == "white"
