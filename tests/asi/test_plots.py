import matplotlib as mpl
import pytest
from matplotlib.figure import Figure

from shipnet.asi import Transaction
from shipnet.asi.telegram import plot_telegram
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
