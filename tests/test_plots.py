import matplotlib as mpl
import pytest
from matplotlib.figure import Figure

from shipnet import datasets, style
from shipnet.asi import Request, Response, Transaction
from shipnet.asi.plot import plot_telegram, plot_transaction
from shipnet.design.plot import plot_asi, plot_hardwired

IOLIST = datasets.read("synthetic_iolist_valves.csv")


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
    (line,) = ax.lines
    levels = line.get_ydata()
    assert [level > 1.5 for level in levels[:-1]] == [bit == "1" for bit in bits]
    assert sum(patch.get_width() for patch in ax.patches) == 14


def test_transaction_is_drawn_to_scale(ax):
    plot_transaction(Request.data_exchange(21, 0xE), Response(6), Transaction(2, 1.5), ax=ax)
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
    plot_transaction("00101010111011", "0011001", ax=ax)
    assert "".join(text for text in texts(ax) if text in "01") == "001010101110110011001"


def test_hardwired_draws_each_strand(ax):
    plot_hardwired(IOLIST, ax=ax)
    assert len(ax.lines) == 32
    assert "hardwired: 32 strands for 16 points" in texts(ax)
    assert {"BV-01", "BV-02", "BV-03", "BV-04"} <= set(texts(ax))


def test_asi_draws_one_module_a_device(ax):
    plot_asi(IOLIST, ax=ax)
    assert [text for text in texts(ax) if text.startswith("slave")] == [
        f"slave {n}" for n in (1, 2, 3, 4)
    ]
    assert "AS-i: 2 strands in the trunk for 16 points" in texts(ax)


def test_one_device_and_other_signals_can_be_drawn(ax):
    one = IOLIST.iloc[:1].assign(signal="rtd_3wire")
    plot_hardwired(one, ax=ax)
    assert len(ax.lines) == 3
    plot_asi(one, ax=ax)


def test_style_is_one_for_all():
    with mpl.rc_context():
        style.use()
        assert mpl.rcParams["figure.figsize"] == [6.4, 3.2]
        assert mpl.rcParams["axes.grid"] is True
