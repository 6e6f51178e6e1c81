"""Figures of the package have its style, whatever rcParams are set."""

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
import pytest
from matplotlib.figure import Figure

from shipnet import asi, can, modbus, papers, style
from shipnet import remote_control as rc
from shipnet.design.plot import plot_ranges
from shipnet.errors import ArgumentError
from shipnet.figure import svg
from shipnet.lazy import pd
from tests.objects import made

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
