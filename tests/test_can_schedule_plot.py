import math

import matplotlib as mpl
import pytest
from matplotlib.colors import same_color
from matplotlib.figure import Figure

from shipnet import style
from shipnet.can.schedule import (
    Message,
    MessageSet,
    load_table,
    response_table,
    response_times,
)
from shipnet.can.schedule.plot import plot_load, plot_response_times


@pytest.fixture
def ax():
    with mpl.rc_context():
        yield Figure(figsize=(6.4, 3.2)).subplots()


def table(period=3.5e-3):
    messages = MessageSet(
        [
            Message("A", 1, 7, 2.5e-3),
            Message("B", 2, 7, period, 3.25e-3),
            Message("C", 3, 7, period, 3.25e-3),
        ]
    )
    return response_table(response_times(messages, 125_000))


def test_bars_are_the_responses_in_order_of_priority_and_marks_the_deadlines(ax):
    assert plot_response_times(table(), ax=ax) is ax
    met, missed = ax.containers
    assert [bar.get_width() for bar in met] == [2.0, 3.0]
    assert [bar.get_width() for bar in missed] == [3.5]
    assert same_color(missed[0].get_facecolor()[:3], style.LIMIT["color"])
    assert not same_color(met[0].get_facecolor()[:3], style.LIMIT["color"])
    (marks,) = ax.lines
    assert marks.get_xydata().tolist() == [[2.5, 0], [3.25, 1], [3.25, 2]]
    assert [label.get_text() for label in ax.get_yticklabels()] == ["A", "B", "C"]
    bottom, top = ax.get_ylim()
    assert bottom > 2 > 0 > top
    assert ax.get_xlabel() == "time [ms]"
    labels = ax.get_legend_handles_labels()[1]
    assert labels == ["deadline", "response, met", "response, missed"]
    ax.figure.draw_without_rendering()


def test_a_response_without_bound_leaves_the_axes_and_says_so(ax):
    without = table(period=1.5e-3 / 0.9)
    assert without["response_ms"].tolist()[1:] == [math.inf, math.inf]
    plot_response_times(without, ax=ax)
    assert [text.get_text().strip() for text in ax.texts] == ["no bound", "no bound"]
    assert ax.containers[1][0].get_width() > ax.get_xlim()[1]
    ax.figure.draw_without_rendering()


def test_a_table_without_messages_can_be_drawn(ax):
    plot_response_times(table()[:0], ax=ax)
    ax.figure.draw_without_rendering()


def test_load_has_a_band_from_nominal_to_worst_a_mean_and_a_limit(ax):
    loads = load_table(MessageSet([Message("A", 1, 8, 5e-3)]), [125_000, 250_000])
    assert plot_load(loads, ax=ax, limit=70) is ax
    mean, limit = ax.lines
    assert mean.get_xdata().tolist() == [125, 250]
    assert mean.get_ydata() == pytest.approx(loads["mean_percent"].to_numpy())
    (band,) = ax.collections
    corners = band.get_paths()[0].vertices[:, 1]
    # 111 and 135 bits in 5 ms.
    assert (corners.min(), corners.max()) == pytest.approx((111 / 12.5, 135 / 6.25))
    assert set(limit.get_ydata()) == {70}
    assert limit.get_color() == style.LIMIT["color"]
    assert [text.get_text() for text in ax.texts] == ["limit 70 %"]
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("bit rate [kbit/s]", "bus load [%]")
    ax.figure.draw_without_rendering()
