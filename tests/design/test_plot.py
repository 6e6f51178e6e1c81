from dataclasses import replace
from itertools import combinations

import matplotlib as mpl
import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure

from shipnet import datasets
from shipnet.design.comparison import compare
from shipnet.design.costs import quantities, tornado
from shipnet.design.iolist import read_iolist
from shipnet.design.plant import Plant
from shipnet.design.plot import plot_pareto
from shipnet.errors import ArgumentError

VALVES = read_iolist(datasets.path("synthetic_iolist_valves.csv"))
PLANT = Plant(modules=8, contacts=4, distance=40)
NETWORKS = {"hardwired": PLANT.hardwired, "AS-i": PLANT.on_asi}
OPTIONS = {name: quantities(design) for name, design in NETWORKS.items()}


@pytest.fixture
def ax():
    with mpl.rc_context():
        yield Figure().subplots()


def spans(collection):
    return [segment[:, 0].tolist() for segment in collection.get_segments()]


def test_designs_are_drawn_side_by_side_with_their_ranges(ax):
    found = compare(NETWORKS.values())
    assert found.plot("cable_mass_kg", ax=ax) is ax
    assert [bar.get_width() for bar in ax.patches] == [q["cable_mass_kg"] for q in OPTIONS.values()]
    bounds, inner = ax.collections
    ends = [q.figures.loc["cable_mass_kg"] for q in OPTIONS.values()]
    assert spans(bounds) == [[row["low"], row["high"]] for row in ends]
    rows = [found.likely().loc[(option, "cable_mass_kg")] for option in OPTIONS]
    assert spans(inner) == [[row["low"], row["high"]] for row in rows]
    assert ax.get_xlabel() == "cable mass [kg]"
    assert [label.get_text() for label in ax.get_yticklabels()] == ["hardwired", "AS-i"]
    with pytest.raises(ArgumentError, match="x is 'mass'"):
        found.plot("mass", ax=ax)


def test_two_columns_of_a_comparison_are_drawn_in_words(ax):
    found = compare(NETWORKS.values())
    found.plot("cable_mass_kg", "conductors_at_cabinet", ax=ax)
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("cable mass [kg]", "conductors at the cabinet")
    with pytest.raises(ArgumentError, match="x is 'mass'"):
        found.plot("mass", "cables", ax=ax)


def test_the_tornado_has_its_longest_bars_on_top(ax):
    found = tornado(NETWORKS)
    found.plot(ax, rows=5)
    low, high = ax.patches[:5], ax.patches[5:]
    ends = found.ends.iloc[:5]
    for bars, level in ((low, "low"), (high, "high")):
        reached = [bar.get_x() + bar.get_width() for bar in bars]
        assert reached == pytest.approx(ends[level].tolist())
    assert {line.get_xdata()[0] for line in ax.lines} >= {found.at_nominal}
    assert ax.get_xlabel() == f"{found.subject} [EUR]"
    assert ax.get_yticklabels()[0].get_text() == found.top(1)[0].replace("_", " ")
    assert ax.get_ylim() == (4.5, -0.5)


def test_a_zero_difference_is_marked_only_if_it_is_in_the_picture(ax):
    tornado(NETWORKS, "cable_mass_kg").plot(ax)
    assert len(ax.lines) == 1
    other = Figure().subplots()
    tornado({"a": PLANT.on_asi, "b": PLANT.on_asi}).plot(other)
    assert [line.get_xdata()[0] for line in other.lines] == [0, 0]
    assert not other.patches


def test_the_front_joins_the_pareto_optimal_options(ax):
    table = pd.DataFrame(
        {"total_cost_eur": [3.0, 1.0, 2.0], "worst response": [1.0, 3.0, 4.0]}, index=list("abc")
    )
    plot_pareto(table, ["a", "b"], ax=ax)
    front, *dots = ax.lines
    assert list(zip(*front.get_data(), strict=True)) == [(1, 3), (3, 1)]
    assert [dot.get_markerfacecolor() for dot in dots] == ["C0", "C0", "white"]
    assert [text.get_text() for text in ax.texts] == ["a", "b", "c"]
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("total_cost_eur", "worst response")


def test_options_at_the_same_place_share_a_label_and_near_ones_do_not_overlap(ax):
    table = pd.DataFrame(
        {
            "total_cost_eur": [217.0, 113.0, 108.0, 108.1, 150.0],
            "cables": [792.0, 34.0, 4.0, 4.0, np.nan],
        },
        index=["home runs", "AS-i", "CAN", "Modbus RTU", "none"],
    )
    ax.figure.set_size_inches(6.4, 2.6)
    plot_pareto(table, [], ax=ax)
    assert [text.get_text() for text in ax.texts] == ["home runs", "AS-i", "CAN, Modbus RTU"]
    ax.figure.draw_without_rendering()
    boxes = [text.get_window_extent() for text in ax.texts]
    assert not any(a.overlaps(b) for a, b in combinations(boxes, 2))
    width = ax.figure.bbox.width
    assert all(0 <= box.x0 and box.x1 <= width for box in boxes)


def test_a_filled_dot_is_not_hidden_by_another(ax):
    table = pd.DataFrame({"total_cost_eur": [3.0, 3.0], "cables": [1.0, 1.0]}, index=["a", "b"])
    plot_pareto(table, ["a"], ax=ax)
    _, filled, empty = ax.lines
    assert filled.get_zorder() > empty.get_zorder()


def test_options_that_are_all_at_one_place_have_one_label(ax):
    table = pd.DataFrame({"total_cost_eur": [3.0, 3.0], "cables": [0.0, 0.0]}, index=["a", "b"])
    plot_pareto(table, [], ax=ax)
    assert [text.get_text() for text in ax.texts] == ["a, b"]
    nothing = plot_pareto(table.iloc[:0], [], ax=Figure().subplots())
    assert len(nothing.texts) == 0


def test_without_a_front_no_option_is_filled(ax):
    table = pd.DataFrame({"total_cost_eur": [3.0], "cables": [1.0]}, index=["a"])
    plot_pareto(table, [], ax=ax)
    front, dot = ax.lines
    assert len(front.get_xdata()) == 0
    assert dot.get_markerfacecolor() == "white"


def texts(ax):
    return [text.get_text() for text in ax.texts]


def changed(points):
    return replace(VALVES, points=points.reset_index(drop=True))


def test_hardwired_draws_each_conductor(ax):
    VALVES.plot("home runs", ax)
    assert len(ax.lines) == 32
    assert "hardwired: 32 conductors for 16 points" in texts(ax)
    assert {"BV-01", "BV-02", "BV-03", "BV-04"} <= set(texts(ax))


def test_asi_draws_one_module_per_device(ax):
    VALVES.plot("AS-i", ax)
    assert [text for text in texts(ax) if text.startswith("slave")] == [
        f"slave {n}" for n in (1, 2, 3, 4)
    ]
    assert "AS-i: 2 conductors in the trunk for 16 points" in texts(ax)


def test_one_device_and_other_signals_can_be_drawn(ax):
    one = changed(VALVES.points.iloc[:1].assign(signal="rtd_3wire", type="AI", conductors=3))
    one.plot(ax=ax)
    assert len(ax.lines) == 3
    one.plot("AS-i", ax)
    assert "3 short conductors" in texts(ax)


def test_a_common_return_is_drawn_too(ax):
    changed(VALVES.points.iloc[:4].assign(signal="contact_common", type="DI", conductors=1)).plot(
        ax=ax
    )
    assert len(ax.lines) == 5
    assert "hardwired: 5 conductors for 4 points" in texts(ax)
    assert "ZSO  1 conductor" in texts(ax)


def test_an_iolist_without_devices_is_refused(ax):
    for option in ("home runs", "AS-i"):
        bare = changed(VALVES.points.assign(device=["", *VALVES.points["device"][1:]]))
        with pytest.raises(ArgumentError, match="points, the first is BV-01-ZSO; add a column"):
            bare.plot(option, ax)
    with pytest.raises(ArgumentError, match="option is 'CAN'; it must be one of 'home runs'"):
        VALVES.plot("CAN", ax)


def test_a_design_is_drawn_from_above(ax):
    design = NETWORKS["AS-i"]
    assert design.plot(ax) is ax and ax.get_title() == "AS-i"
    assert sum(len(own.get_segments()) for own in ax.collections) == len(design.cables)


def test_the_costs_of_a_design_are_drawn_with_their_ranges(ax):
    takes = OPTIONS["AS-i"]
    takes.plot(ax)
    assert [bar.get_width() for bar in ax.patches][-1] == takes["total_cost_eur"]
