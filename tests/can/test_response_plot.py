import math

import matplotlib as mpl
import pytest
from matplotlib.colors import same_color
from matplotlib.figure import Figure

from shipnet import style
from shipnet.can import Message, MessageSet, response_times


@pytest.fixture
def ax():
    with mpl.rc_context():
        yield Figure(figsize=(6.4, 3.2)).subplots()


def responses(period=3.5e-3):
    messages = MessageSet(
        [
            Message("A", 1, 7, 2.5e-3),
            Message("B", 2, 7, period, 3.25e-3),
            Message("C", 3, 7, period, 3.25e-3),
        ]
    )
    return response_times(messages, 125_000)


def test_bars_are_the_responses_in_order_of_priority_and_marks_the_deadlines(ax):
    assert responses().plot(ax) is ax
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
    without = responses(period=1.5e-3 / 0.9)
    assert [one.response for one in without][1:] == [math.inf, math.inf]
    without.plot(ax)
    assert [text.get_text().strip() for text in ax.texts] == ["no bound", "no bound"]
    assert ax.containers[1][0].get_width() > ax.get_xlim()[1]
    ax.figure.draw_without_rendering()


def test_a_set_without_messages_can_be_drawn(ax):
    response_times(MessageSet([]), 125_000).plot(ax)
    ax.figure.draw_without_rendering()
