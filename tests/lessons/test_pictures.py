"""Numbers of the lessons' pictures, each found by a second route."""

from functools import cache
from itertools import pairwise

import matplotlib.pyplot as plt
import nbformat
import numpy as np
import pytest

from docs.editions import LESSONS, ROOT
from shipnet import asi, can
from shipnet.line import CABLES


@cache
def drawn(name, caption):
    """Return the names of a notebook, and the axes of its figure with this caption."""
    (path,) = (ROOT / "notebooks").glob(name)
    names = {"display": print}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(plt, "show", lambda: None)
        for cell, below in pairwise(nbformat.read(path, as_version=4).cells):
            if cell.cell_type == "code" and not cell.metadata.get("tags"):
                plt.close("all")
                exec(compile(cell.source, path.name, "exec"), names)
            if below.source.startswith(f"*{caption}"):
                return names, plt.gcf().axes
    raise LookupError(caption)


def lesson(number, caption):
    return drawn(f"{LESSONS.name}/{number}_*.ipynb", caption)


def test_pulses_have_the_spectrum_of_the_closed_form():
    names, axes = lesson("01", "Average power")
    assert [len(ax.collections) for ax in axes] == [1, 1, 1]
    f, words = names["f"][1:3000], names["words"]
    closed = np.mean([asi.Modulation(word).spectrum(f) ** 2 for word in words[:50]], axis=0)
    seen = (abs(np.fft.rfft(names["pulses"][:50], 2**14)) ** 2).mean(axis=0)[1:3000]
    assert seen / seen.max() == pytest.approx(closed / closed.max(), abs=0.01)


@pytest.mark.parametrize(("row", "length"), [(0, 100), (1, 200)])
def test_an_echo_returns_when_the_voltages_part(row, length):
    """The lattice multiplies a distance by a delay; the voltages are sums of many frequencies."""
    _, axes = lesson("02", "Left: the fronts")
    lattice, master = axes[2 * row : 2 * row + 2]
    left, _, back = lattice.lines[0].get_ydata()
    assert back - left == pytest.approx((2 * length - 5) * CABLES["as-i 1.5"].delay * 1e6)
    voltages = [line.get_data() for line in master.lines if len(line.get_xdata()) > 2]
    (opened, time), (matched, _) = voltages
    apart = np.abs(opened - matched) > 0.02 * np.abs(opened).max()
    # A pulse begins slowly: it needs up to about 0.6 us for 2 % of its height.
    assert 0 <= time[apart.argmax()] - back < 0.6


@pytest.mark.parametrize(("length", "place"), [(100, 50), (160, 20), (200, 50), (200, 150)])
def test_the_red_contour_is_where_a_slave_reaches_the_tolerance(length, place):
    _, (ax,) = lesson("02", "Weakest pulse of a valve")
    (contour,) = ax.collections[-1].get_paths()
    across = np.sort(contour.vertices[contour.codes == 2], axis=0)
    (slave,) = asi.line(length, slaves=(place,)).quality().evenness
    assert (place < np.interp(length, *across.T, left=0)) == (slave < asi.TOLERANCE.evenness)


def test_a_change_waits_for_its_poll():
    _, axes = lesson("04", "Two cycles of five slaves")
    cycle = 7 * 26 - 2  # five slaves, management, and a search without response [bit times]
    expected = [20 + 60, 6 * cycle - 20 + 60, 6 * cycle - 500 + 60]
    assert [float(ax.get_title().split()[2]) for ax in axes] == pytest.approx(expected, abs=1)
    for ax, wait in zip(axes, expected, strict=True):
        (dot,) = (line for line in ax.lines if line.get_marker() == "o")
        (arrow,) = (text for text in ax.texts if text.arrow_patch)
        assert 1e3 * (arrow.xy[0] - dot.get_xdata()[0]) == pytest.approx(wait, abs=1)


def test_the_staircase_ends_at_the_response_time():
    _, (ax,) = lesson("05", "The wait of exhaust 1-4")
    bound = can.response_times(can.example(), 50_000)["exhaust 1-4"]
    (end,) = ax.lines[-1].get_xdata()
    assert end == pytest.approx(1e3 * (bound.response - bound.frame_time))


def test_a_cut_loses_what_is_beyond_it():
    names, axes = lesson("10", "The ship from above")
    for ax, (name, cable) in zip(axes, names["cuts"].items(), strict=True):
        (crosses,) = (line for line in ax.lines if line.get_marker() == "X")
        (rings,) = (line for line in ax.lines if line.get_label() == "lost")
        failures = names["seven"].designs[name].failures().set_index(["failure", "failed"])
        lost = failures.loc[("cut", cable), "points_lost"]
        assert (len(crosses.get_xdata()), len(rings.get_xdata())) == (1, lost)
        assert ax.get_title() == f"{name}: {lost} of 120 points lost"


def test_no_change_takes_longer_than_its_bound():
    names, axes = drawn("01_three_buses.ipynb", "Response times of 5000 changes")
    for ax, delay, bound in zip(axes, names["delays"], names["bounds"], strict=True):
        assert 0.9 * bound < delay.max() <= bound + 1e-9
        assert ax.lines[0].get_xdata()[0] == bound
        # No change is outside the bins.
        assert sum(bar.get_height() for bar in ax.patches) >= 0.99 * len(delay)
    # Waits are uniform between the shortest and the longest.
    assert names["delays"][1].mean() == pytest.approx(0.25 / 2 + names["delays"][1].min(), rel=0.05)


def test_a_scope_shows_the_fields_of_the_frame_that_was_sent():
    names, (wires, difference, lanes) = drawn("papers/lee2012/1_buses.ipynb", "The first frame of")
    high, low = (line.get_ydata() for line in wires.lines)
    assert high - low == pytest.approx(difference.lines[0].get_ydata())
    words = dict(text.get_text().split("\n") for text in lanes.texts if "\n" in text.get_text())
    assert (words["base"], words["DLC"], words["data"]) == ("100", "1", "12")
    # The CRC by a second route: division of the bits before it by the polynomial 0x4599.
    sent = can.decode("".join(map(str, names["read"]))).unstuffed
    register = 0
    for bit in sent[:-15]:
        register = ((register << 1) ^ (0x4599 if (register >> 14) ^ int(bit) else 0)) & 0x7FFF
    assert words["CRC"] == f"{register:X}"


def test_the_sign_of_the_pulse_after_the_middle_of_a_bit_is_its_value():
    names, (scope, _) = drawn("papers/kim2023/1_telegrams.ipynb", "The response of a slave at")
    time, voltage = scope.lines[0].get_data()
    # A pulse is highest about 0.45 bit times after the middle in which it begins.
    heights = np.interp(np.arange(7) + 0.95, time, voltage)
    assert "".join("1" if u > 1 else "0" if u < -1 else "?" for u in heights) == "0011001"
    assert names["response"].bits == "0011001"


def test_two_places_of_a_packet_give_a_wrong_value_of_each_item():
    _, (ax,) = drawn("papers/chung1998/2_ring.ipynb", "Red: the value of this item")
    shades = np.reshape(ax.collections[0].get_array(), (10, 128))
    # The high byte of item k is 4 + 3 k places after the first byte of the packet.
    places = np.arange(128) + 4 + 3 * np.arange(10)[:, None]
    for k, row in enumerate(shades):
        (begins,) = np.nonzero(row)
        assert len(begins) == 2, k
        assert np.ptp(begins) == 1
        assert set(places[k, begins]) == {128, 129}
