import matplotlib as mpl
import matplotlib.pyplot as plt
import pytest
from matplotlib.figure import Figure

from shipnet import style
from shipnet.asi import Request, Response, Transaction, compare
from shipnet.asi.telegram import plot_telegram
from shipnet.asi.topologies import line
from shipnet.errors import LengthError


@pytest.fixture
def ax():
    with mpl.rc_context():
        yield Figure().subplots()


def texts(ax):
    return [text.get_text() for text in ax.texts]


def test_a_faulty_frame_can_be_drawn(ax):
    Transaction().plot("00101010111011", "0011001", ax)
    assert "".join(text for text in texts(ax) if text in "01") == "001010101110110011001"


def test_a_telegram_of_another_length_is_refused(ax):
    with pytest.raises(LengthError, match="14 or 7 bits"):
        plot_telegram("0101", ax=ax)


def test_all_figures_share_one_style():
    with mpl.rc_context():
        style.use()
        assert mpl.rcParams["figure.figsize"] == [6.4, 3.2]
        assert mpl.rcParams["axes.grid"] is True


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
