from dataclasses import replace
from itertools import combinations

import matplotlib as mpl
import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure

from shipnet import datasets
from shipnet.design.costs import quantities, tornado
from shipnet.design.iolist import IoList, read_iolist
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


def test_a_zero_difference_is_marked_only_if_it_is_in_the_picture(ax):
    tornado(NETWORKS, "cable_mass_kg").plot(ax)
    assert len(ax.lines) == 1
    other = Figure().subplots()
    tornado({"a": PLANT.on_asi, "b": PLANT.on_asi}).plot(other)
    assert [line.get_xdata()[0] for line in other.lines] == [0, 0]
    assert not other.patches


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


def texts(ax):
    return [text.get_text() for text in ax.texts]


def changed(points):
    return replace(VALVES, points=points.reset_index(drop=True))


def test_hardwired_draws_each_conductor(ax):
    VALVES.plot("home runs", ax)
    assert len(ax.lines) == 32
    assert "hardwired: 32 conductors for 16 points" in texts(ax)
    assert {"BV-01", "BV-02", "BV-03", "BV-04"} <= set(texts(ax))


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


def test_a_cut_is_marked_with_the_points_that_it_loses(ax):
    rows = [f"V{n},DI,{6 * n},{3 * (-1) ** n},4" for n in range(1, 13)]
    deck = IoList.parse("\n".join(["tag,type,x,y,z", *rows]))
    design = deck.plan("CAN", (0, 0, 4))
    (cut,) = design.cables.query("kind == 'drop'")["run"].head(1)
    both = [cut, design.cables.query("kind == 'trunk'")["run"].iloc[-1]]
    for cables in ([cut], both):
        ax.clear()
        design.plot(ax, cables=cables)
        bars, crosses = (line for line in ax.lines if line.get_label() in ("cut", "lost"))
        lost = design.iolist.points.set_index("tag").loc[list(design.lost(cables=cables))]
        places = pd.concat([design.devices.set_index("device"), deck.points.set_index("tag")])
        for run, spot in zip(cables, bars.get_xydata(), strict=True):
            ends = design.cables.set_index("run").loc[run, ["a", "b"]]
            assert spot.tolist() == places.loc[ends, ["x_m", "y_m"]].mean().tolist()
        assert np.array_equal(crosses.get_xydata(), lost[["x_m", "y_m"]])
        assert ax.get_title() == f"CAN: {len(lost)} of 12 points lost"
    with pytest.raises(ArgumentError, match="no cable 'x'"):
        design.plot(ax, cables=["x"])
