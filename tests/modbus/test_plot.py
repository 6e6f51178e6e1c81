import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from shipnet import style
from shipnet.errors import ArgumentError
from shipnet.modbus.faults import Break, DeadPort, DeadSlave, Short
from shipnet.modbus.pdu import Request
from shipnet.modbus.polling import Poll
from shipnet.modbus.redundancy import Loop
from shipnet.modbus.simulation import simulate
from shipnet.modbus.uart import SerialLine, _line_bits

LINE = SerialLine(9600)
POLL = Poll(Request.read_input_registers(0, 4), LINE, timeout=0.1)


@pytest.fixture
def ax():
    with mpl.rc_context():
        style.use()
        figure = Figure()
        FigureCanvasAgg(figure)
        yield figure.subplots()


def test_a_uart_picture_shows_the_levels_and_the_bytes(ax):
    data = bytes.fromhex("0104402000") + b"\xff"
    assert LINE.waveform(data).plot(ax=ax) is ax
    (trace,) = ax.lines
    middles = (LINE.t35 + (np.arange(66) + 0.5) / 9600) * 1e3
    drawn = trace.get_ydata()[np.searchsorted(trace.get_xdata(), middles, side="right") - 1]
    assert (drawn == _line_bits(data, LINE).ravel()).all()
    assert trace.get_drawstyle() == "steps-post"
    assert [text.get_text() for text in ax.texts] == ["01", "04", "40", "20", "00", "FF"]
    assert all(text.get_position()[1] > 1 for text in ax.texts)
    character = LINE.character_time * 1e3
    centres = [text.get_position()[0] for text in ax.texts]
    assert centres == pytest.approx(LINE.t35 * 1e3 + (np.arange(6) + 0.5) * character)
    starts = [patch.get_x() for patch in ax.patches]
    assert starts == pytest.approx(LINE.t35 * 1e3 + np.arange(6) * character + 1e3 / 9600)
    assert ax.get_xlabel() == "time [ms]"
    assert ax.get_ylabel() == "level"


def test_the_drawing_of_a_loop_shows_the_port_of_each_slave_and_the_faults(ax):
    loop = Loop(12, POLL)
    faults = [Break(4), Break(6), DeadSlave(9)]
    assert loop.plot(faults, ax=ax) is ax
    served = [text.get_text() for text in ax.get_legend().get_texts()]
    assert served == ["4 through A", "5 through B", "3 lost"]
    groups = {line.get_label(): line for line in ax.lines}
    places = {text.get_text(): np.array(text.get_position()) for text in ax.texts}
    for label, slaves in zip(served, ([1, 2, 3, 4], [7, 8, 10, 11, 12], [5, 6, 9]), strict=True):
        drawn = groups[label].get_xydata()
        assert drawn == pytest.approx(np.array([places[str(s)] for s in slaves]))
    red = [k for k in range(13) if groups[f"_section {k}"].get_color() == style.LIMIT["color"]]
    assert red == [4, 6]
    ends = groups["_section 4"].get_xydata()[[0, -1]]
    assert ends == pytest.approx(np.array([places["4"], places["5"]]))
    assert groups["_dead"].get_xydata()[0] == pytest.approx(places["9"])
    assert {"break 4", "break 6", "master", "A", "B"} <= set(places)


def test_a_large_loop_is_drawn_with_all_slaves_but_no_numbers(ax):
    Loop(247, POLL).plot([Short(100), DeadPort("B")], ax=ax)
    assert {text.get_text() for text in ax.texts} == {"short 100", "master", "A", "B"}
    (lost,) = (line for line in ax.lines if line.get_label() == "247 lost")
    assert len(lost.get_xdata()) == 247


def test_a_line_that_is_not_closed_ends_at_its_last_slave(ax):
    Loop(5, POLL, closed=False).plot(Break(3), ax=ax)
    assert {"A", "break 3", "5"} <= {text.get_text() for text in ax.texts}
    assert "B" not in {text.get_text() for text in ax.texts}
    sections = [line for line in ax.lines if line.get_label().startswith("_section")]
    assert len(sections) == 5
    assert [t.get_text() for t in ax.get_legend().get_texts()] == ["3 through A", "2 lost"]


def bars(ax, label):
    (found,) = (c for c in ax.collections if c.get_label() == label)
    boxes = [path.get_extents() for path in found.get_paths()]
    return [(box.x0, box.x1) for box in boxes]


def test_a_drawn_switch_over_shows_requests_responses_and_time_outs(ax):
    run = simulate(Loop(1, POLL), faults=Break(0, start=0.1, stop=0.35), until=0.5)
    assert run.plot(ax=ax) is ax
    request, response = LINE.frame_time(8), LINE.frame_time(13)
    begins = np.arange(4) * POLL.time
    assert bars(ax, "request") == [pytest.approx((t, t + request)) for t in begins]
    answers = begins[:3] + request + LINE.t35
    assert bars(ax, "response") == [pytest.approx((t, t + response)) for t in answers]
    silent = begins[3] + request
    assert bars(ax, "no response") == [pytest.approx((silent, silent + 0.1))]
    assert bars(ax, "_request")[0][0] == pytest.approx(silent + 0.1)
    assert bars(ax, "_no response") == []
    assert [text.get_text() for text in ax.texts] == [" break 0", " break 0 repaired"]
    assert [line.get_xdata()[0] for line in ax.lines] == [0.1, 0.35]
    assert [label.get_text() for label in ax.get_yticklabels()] == ["port A", "port B"]
    assert ax.get_xlabel() == "time [s]" and ax.get_xlim() == (0, 0.5)


def test_a_fault_that_cannot_be_drawn_is_named(ax):
    with pytest.raises(ArgumentError, match="section is 9"):
        Loop(3, POLL).plot([Break(9)], ax=ax)
