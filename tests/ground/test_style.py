"""Figures of the package have its style, whatever rcParams are set."""

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
import pytest
from matplotlib.figure import Figure

from shipnet import asi, ballast, can, datasets, design, engine, modbus, papers, style
from shipnet import remote_control as rc
from shipnet.design.plot import plot_ranges
from shipnet.errors import ArgumentError
from shipnet.figure import svg
from shipnet.lazy import pd
from tests.objects import OBJECTS, made
from tests.support import figure_faults

#: What is drawn, beside the plots of `OBJECTS`.
PLOTS = {
    "levels": asi.emc.plot_levels,
    "modulation": lambda: asi.Modulation("00101010111001").plot(
        asi.line(100, slaves=(5,)).waveform("00101010111001", "5 m")
    )[0],
    "telegram": lambda: asi.Request.data_exchange(21, 0xE).plot(),
    "frame": lambda: can.Frame(0x123, b"\x01\x02").plot(),
    "ledger": lambda: papers.ledger().plot(),
    "paper": lambda: papers.figure("kim2014", "Fig 7"),
    "serial": lambda: modbus.SerialLine(9600).waveform(b"AS-i").plot(),
    "timing": lambda: rc.System().timing().plot(),
    "plan": lambda: made("asi.Plan").plot(),
}
for name in """
    PlanFindings asi.Capture asi.Comparison asi.Run ballast.Diagnosis ballast.FleetReport
    ballast.Run ballast.Screen ballast.Trials can.Analysis can.Capture design.Design design.Tornado
    engine.Screen modbus.Run modbus.Scan rc.Comparison rc.Run
""".split():
    PLOTS[name] = lambda name=name: made(name).plot()


@pytest.fixture(autouse=True)
def rc_params():
    with mpl.rc_context():
        mpl.use("agg")
        plt.rcdefaults()
        yield
    plt.close("all")


def pixels(plot):
    ax = plot()
    ax.figure.canvas.draw()
    image = np.array(ax.figure.canvas.buffer_rgba())
    plt.close(ax.figure)
    return image


@pytest.mark.parametrize("plot", PLOTS.values(), ids=PLOTS)
def test_a_figure_has_the_same_pixels_whatever_rc_params_are_set(plot):
    plain = pixels(plot)
    plt.style.use("dark_background")
    mpl.rcParams.update({"font.size": 20, "lines.linewidth": 5, "patch.linewidth": 4})
    mpl.rcParams["axes.prop_cycle"] = mpl.cycler(color=["red"])
    assert np.array_equal(pixels(plot), plain)
    plt.rcdefaults()
    style.use()
    assert np.array_equal(pixels(plot), plain)


#: What is drawn for the rules of all figures only.
MORE = {
    "states": lambda: asi.ExchangeStates([asi.Slave("21")], damaged=[4]).plot("21", 4),
    "table": asi.Profile.plot_table,
    "rules": lambda: ballast.rule_base().plot_surface("MC", "OP"),
    "overlaps": lambda: ballast.rule_base().plot_overlaps(),
    "strokes": lambda: made("ballast.Run").plot(1),
    "segment": lambda: can.Segment(40, 4).send({1: "0101"}, 500e3).plot(),
    "contest": lambda: can.arbitrate([can.Frame(1), can.Frame(2)]).plot(["1", "2"]),
    "wait": lambda: made("can.ResponseTimes").plot_wait("speed"),
    "ages": lambda: made("engine.Run").plot_ages("ME-JB2-044"),
    "timeline": lambda: made("engine.Run").plot_timeline(1.0, 1.2),
    "engine": lambda: engine.System().plot(),
    "loop": lambda: modbus.Loop(4, ballast.status_poll(9600)).plot(),
    "ring": lambda: rc.Ring.filled(6, get_no=14, size=16).plot(),
    "pulses": lambda: asi.Modulation("00101010111001").pulses.plot(),
    "eye": lambda: asi.line(100, slaves=(5,)).waveform("00101010111001").eye().plot(),
    "devices": lambda: design.read_iolist(datasets.path("synthetic_iolist_valves.csv")).plot(),
}
for name in OBJECTS:
    # The I/O list of a ship has no devices to draw.
    if hasattr(made(name), "plot") and name != "design.IoList":
        MORE.setdefault(name, lambda name=name: made(name).plot())


@pytest.mark.parametrize("plot", (PLOTS | MORE).values(), ids=PLOTS | MORE)
def test_a_figure_meets_the_rules_of_all_figures(plot):
    assert figure_faults(np.ravel(plot())[0].figure) == []


def test_the_rules_of_all_figures_are_checked():
    figure = Figure(figsize=(6.5, 3))
    ax = figure.subplots()
    ax.set(xlabel="time [us]", ylabel="level [1]", title="120 ohm")
    ax.set_yticks([1], ["20 degC"], fontsize=9.9)
    ax.axhline(0, **style.LIMIT)
    faults = ["9.9 pt: 20 degC", "time [us]", "120 ohm", "20 degC", "level [1]"]
    assert sorted(figure_faults(figure)) == sorted([*faults, "a limit without its name"])
    style.limit(ax, 0, "limit")
    assert sorted(figure_faults(figure)) == sorted(faults)
    figure.set_figwidth(7)
    assert sorted(figure_faults(figure)) == sorted(faults[1:])


def test_the_rc_params_are_left_as_they_were(tmp_path):
    plt.style.use("dark_background")
    before = dict(mpl.rcParams)
    ax = made("modbus.Scan").plot()
    ax.figure.savefig(tmp_path / "a.png")
    with pytest.raises(ArgumentError, match="names no device"):
        made("design.IoList").plot()
    assert dict(mpl.rcParams) == before


def test_given_axes_keep_their_own_style():
    plt.style.use("dark_background")
    for draw in (
        lambda ax: made("can.Analysis").plot(ax),
        lambda ax: made("can.Analysis").plot(ax=ax),
    ):
        ax = Figure().subplots()
        draw(ax)
        texts = [*ax.get_legend().get_texts(), *ax.get_xticklabels()]
        assert {text.get_color() for text in texts} == {"white"}
        assert ax.get_legend().get_frame_on()


def test_a_saved_figure_has_the_style(tmp_path):
    plt.style.use("dark_background")
    made("modbus.Scan").plot().figure.savefig(tmp_path / "dark.png")
    plt.rcdefaults()
    made("modbus.Scan").plot().figure.savefig(tmp_path / "plain.png")
    assert (tmp_path / "dark.png").read_bytes() == (tmp_path / "plain.png").read_bytes()


def test_the_users_font_supplies_the_letters_that_ours_lacks():
    mpl.rcParams["font.family"] = ["STIXGeneral"]
    ax = made("modbus.Scan").plot()
    assert ax.xaxis.label.get_family() == ["DejaVu Sans", "STIXGeneral"]


def test_a_dollar_sign_in_a_drawing_stays_one():
    names = ["Pump $1$", "$", r"\frac$"]
    ends = pd.DataFrame({"nominal": 1.0, "low": 0.5, "high": 2.0}, index=names)
    drawn = svg(lambda ax: plot_ranges(ends, "cost", ax=ax))
    assert [f"<!-- {name} -->" in drawn for name in names] == [True] * 3
