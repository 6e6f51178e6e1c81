from dataclasses import replace

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from shipnet import style
from shipnet.can.faults import BitErrors, ErrorAt
from shipnet.can.frame import Frame
from shipnet.can.messages import Message, MessageSet, example
from shipnet.can.response import response_times
from shipnet.can.simulation import simulate
from shipnet.errors import ArgumentError
from tests.can.frames import LONGEST

FRAMES = [
    LONGEST[-1],
    Frame(0x1ABCDEF5, bytes(range(1, 9)), True),
    Frame(0x123, bytes.fromhex("00000000DEADBEEF")),
    Frame(0x14, remote=True),
]


@pytest.fixture
def ax():
    with mpl.rc_context():
        style.use()
        figure = Figure(figsize=(6.4, 4.6))
        FigureCanvasAgg(figure)
        yield figure.subplots()


@pytest.mark.parametrize("frame", FRAMES, ids=str)
def test_no_name_covers_another_or_a_level_line(ax, frame):
    frame.plot(ax)
    ax.figure.draw_without_rendering()
    renderer = ax.figure.canvas.get_renderer()
    boxes = [(text.get_text(), text.get_window_extent(renderer)) for text in ax.texts]
    for place, (name, box) in enumerate(boxes):
        for other, near in boxes[place + 1 :]:
            assert not box.overlaps(near), f"{name} covers {other}"
    lines = [line.get_window_extent(renderer) for line in ax.lines]
    for name, box in boxes:
        assert not any(box.overlaps(line) for line in lines), f"{name} covers a level"


@pytest.mark.parametrize("rate", [50_000, 125_000])
@pytest.mark.parametrize("jitter", [0.0, 2e-3])
def test_the_stairs_of_a_wait_end_at_the_response_time(ax, rate, jitter):
    times = response_times(MessageSet([replace(one, jitter=jitter) for one in example()]), rate)
    for item in times:
        ax.clear()
        times.plot_wait(item.message.name, ax=ax)
        stairs, *_, end = (line.get_data() for line in ax.lines)
        wait = item.instances[0] - item.frame_time - item.message.jitter
        assert end[0][0] == end[1][0] == pytest.approx(1e3 * wait)
        # Before the end the bus needs more time than it has had; the stairs meet the line there.
        earlier = np.linspace(0, 1e3 * wait, 50, endpoint=False)
        height = stairs[1][np.searchsorted(stairs[0], earlier, "right") - 1]
        assert (height > earlier).all()


def test_a_wait_without_a_bound_is_refused():
    slow = response_times(MessageSet([Message("A", 1, 8, 1e-3), Message("B", 2, 8, 1e-3)]), 125e3)
    with pytest.raises(ArgumentError, match="'B', whose wait has no bound"):
        slow.plot_wait("B")
    long = MessageSet([Message("A", 0x18FF0001, 20, 1.0, extended=True, transport="fast packet")])
    with pytest.raises(ArgumentError, match="only one frame is drawn"):
        response_times(long, 250e3).plot_wait("A")


def test_a_counter_is_that_of_the_simulation(ax):
    noise = BitErrors(0.01, start=0.05, stop=0.15)
    run = simulate(example(), 125_000, until=0.4, faults=noise, rng=np.random.default_rng(2024))
    run.plot_errors("governor", ax=ax)
    time, count = ax.lines[0].get_data()
    errors = run.errors().query("sender == 'governor'")
    assert np.array_equal(count[np.isin(time, errors["free_ms"])], errors["tec"])
    assert (count.max() >= 256, count[-1]) == (True, run.nodes()["tec"]["governor"])
    # A sender that was bus off begins again after at least 128 sequences of 11 bits.
    (off,) = np.flatnonzero(count >= 256)
    assert count[off + 1] == 0
    assert time[off + 1] - time[off] >= 128 * 11 / 125
    with pytest.raises(ArgumentError, match="sender is 'x'"):
        run.plot_errors("x")


def test_a_message_without_a_sender_is_its_own_sender(ax):
    messages = MessageSet([Message("alone", 1, 8, 0.01)])
    run = simulate(messages, 125_000, until=0.2, faults=[ErrorAt(0.011)])
    run.plot_errors("alone", ax=ax)
    count = ax.lines[0].get_ydata()
    assert (count.max(), count[-1]) == (8, run.nodes()["tec"]["alone"]) == (8, 0)
