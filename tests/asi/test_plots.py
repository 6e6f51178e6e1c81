import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
import pytest
from matplotlib.figure import Figure

from shipnet import style
from shipnet.asi import Modulation, Profile, Request, Response, Transaction, compare
from shipnet.asi.profile import IO_CONFIGURATIONS
from shipnet.asi.receiver import Waveform
from shipnet.asi.telegram import plot_telegram
from shipnet.asi.topologies import line
from shipnet.errors import LengthError
from shipnet.papers import ledger
from shipnet.papers.kim2023.signals import train_of


@pytest.fixture
def ax():
    with mpl.rc_context():
        yield Figure().subplots()


def texts(ax):
    return [text.get_text() for text in ax.texts]


def test_telegram_shows_its_bits_and_levels(ax):
    bits = "00101010111001"
    assert plot_telegram(bits, ax=ax) is ax
    assert "".join(text for text in texts(ax) if text in "01") == bits
    labels = [text for text in texts(ax) if text not in "01"]
    assert labels == ["ST", "CB", "address A4..A0", "information I4..I0", "PB", "EB"]
    (line,) = ax.lines
    levels = line.get_ydata()
    assert [level > 1.5 for level in levels[:-1]] == [bit == "1" for bit in bits]
    assert sum(patch.get_width() for patch in ax.patches) == 14


def test_transaction_is_drawn_to_scale(ax):
    Transaction(2, 1.5).plot(Request.data_exchange(21, 0xE), Response(6), ax)
    assert sum(patch.get_width() for patch in ax.patches) == 24.5
    assert {
        "request\n14 bit",
        "master pause\n2 bit",
        "response\n7 bit",
        "slave pause\n1.5 bit",
    } <= set(texts(ax))
    assert ax.get_xlabel() == "time [bit]"
    (top,) = ax.child_axes
    assert top.get_xlabel() == "time [us]"
    ax.figure.draw_without_rendering()
    assert top.get_xlim() == pytest.approx([6 * x for x in ax.get_xlim()])


def test_a_faulty_frame_can_be_drawn(ax):
    Transaction().plot("00101010111011", "0011001", ax)
    assert "".join(text for text in texts(ax) if text in "01") == "001010101110110011001"


def test_a_telegram_of_another_length_is_refused(ax):
    with pytest.raises(LengthError, match="14 or 7 bits"):
        plot_telegram("0101", ax=ax)


def test_io_codes_read_down_from_d0(ax):
    Profile.plot_table(ax)
    names = [label.get_text() for label in ax.get_yticklabels()]
    assert names == ["D0", "D1", "D2", "D3"]
    assert ax.yaxis_inverted()
    shown = np.array(texts(ax)).reshape(16, 4)
    assert [tuple(ports) for ports in shown.tolist()] == list(IO_CONFIGURATIONS)


def test_counts_are_drawn_with_one_bar_per_paper(ax):
    table = ledger().counts()
    assert ledger().plot(ax=ax) is ax
    assert len(ax.patches) == (len(table.columns) - 1) * len(table)
    assert sum(patch.get_width() for patch in ax.patches) == table["claims"].sum()
    assert [label.get_text() for label in ax.get_yticklabels()] == list(table.index)


def test_all_figures_share_one_style():
    with mpl.rc_context():
        style.use()
        assert mpl.rcParams["figure.figsize"] == [6.4, 3.2]
        assert mpl.rcParams["axes.grid"] is True


def test_an_eye_draws_every_half_bit_and_the_tolerances(ax):
    bits = Modulation(["0011001", "0000001"]).bits
    opened = Waveform(train_of(2 * Modulation(bits).pulses.signs), 250e-9, bits=bits).eye()
    opened.plot(ax)
    drawn = [line for line in ax.lines if len(line.get_xdata()) == len(opened.t)]
    assert len(drawn) == len(opened.pulses) + len(opened.gaps)
    assert drawn[0].get_ydata() == pytest.approx(opened.pulses[0])
    levels = [line.get_ydata()[0] for line in ax.lines[-3:]]
    assert levels == [0.65, 0.30, -0.30]
    assert ax.get_xlabel() == "time from the middle [us]"


def test_the_tolerances_of_a_comparison_are_named_on_their_lines(ax):
    compare({100: line(100, slaves=(5, 100))}).plot(ax)
    named = {text.get_text(): text.get_position() for text in ax.texts}
    assert {name: y for name, (_, y) in named.items()} == pytest.approx(
        {"weakest pulse,\nat least": 65, "ringing,\nat most": 30}
    )
    # Names and legend are outside and do not cover the data.
    assert all(x > 1 for x, _ in named.values())
    ax.figure.draw_without_rendering()
    assert ax.get_legend().get_window_extent().y0 >= ax.get_window_extent().y1 - 1


def test_bits_and_pulses_share_their_time():
    axes = Figure().subplots(3, 1, sharex=True)
    wave = line(100, slaves=(5,)).waveform("0011001", "5 m", dt=50e-9)
    Modulation("0011001").plot(wave, axes)
    assert "".join(texts(axes[0])) == "0011001"
    assert axes[1].lines[0].get_ydata().max() == pytest.approx(60)
    assert axes[2].lines[0].get_ydata() == pytest.approx(wave.u)
    assert axes[2].get_xlabel() == "time [us]"


def test_a_telegram_on_axes_of_its_own_needs_no_tuning():
    for telegram in (Request.data_exchange(21, 0xE), Response(6)):
        ax = telegram.plot()
        ax.figure.draw_without_rendering()
        fields = [text for text in ax.texts if text.get_position()[1] < 0]
        inside = ax.get_window_extent()
        # The names of the fields are above the ticks, and nothing is cut off.
        assert all(text.get_window_extent().y0 > inside.y0 for text in fields) and fields
        assert (ax.get_xlabel(), len(ax.get_yticks())) == ("time [bit]", 0)
        assert ax.figure.get_layout_engine() is not None
        plt.close(ax.figure)
