import itertools

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from shipnet import style
from shipnet.asi.simulation import simulate
from shipnet.asi.slave import ACTIONS, TRANSITIONS, Slave, State
from shipnet.errors import ArgumentError
from tests.asi.lines import simulate_drawn


@pytest.fixture
def ax():
    with mpl.rc_context():
        style.use()
        yield Figure(figsize=(9, 2.4)).subplots()


def traffic():
    drawn = np.zeros((4, 3, 2, 2), dtype=np.uint8)
    drawn[1, 0, 1, 0] = 1
    drawn[2, 0, 1, 0] = 5 << 2
    return simulate_drawn(drawn, [Slave("1", "S-7.F.F"), Slave("2", "S-7.F.F")], cycles=4)


def test_each_request_and_each_answer_is_a_block_at_its_time(ax):
    run = traffic()
    table = run.events().query("cycle >= 0")
    assert run.plot("cycle >= 0", ax=ax) is ax
    blocks = [patch for patch in ax.patches if isinstance(patch, Rectangle)]
    requests = [block for block in blocks if block.get_y() == -0.4]
    assert [block.get_x() for block in requests] == pytest.approx((1e3 * table["time_s"]).to_list())
    assert {round(block.get_width(), 9) for block in requests} == {0.084}
    answers = [block for block in blocks if block.get_y() != -0.4]
    assert {round(block.get_width(), 9) for block in answers} == {0.042}
    red = [b for b in answers if mpl.colors.to_hex(b.get_facecolor()) == style.LIMIT["color"]]
    assert len(red) == (table["outcome"] != "ok").sum()
    assert [b.get_hatch() for b in requests].count("////") == (table["attempt"] > 0).sum() == 2
    assert [text.get_text() for text in ax.texts] == ["1", "1"]
    names = [label.get_text() for label in ax.get_yticklabels()]
    assert names[:3] == ["master", "slave 0", "slave 1"]
    assert ax.get_xlabel() == "time [ms]"


def test_a_window_shows_what_begins_in_it(ax):
    run = traffic()
    start, stop = run.events().query("cycle >= 0")["time_s"].iloc[[3, 5]]
    run.plot(start=start, stop=stop, ax=ax)
    requests = [patch for patch in ax.patches if patch.get_y() == -0.4]
    assert len(requests) == 2


def requests_in(ax):
    return [patch for patch in ax.patches if patch.get_y() == -0.4]


def test_of_many_requests_those_around_the_first_fault_are_drawn(ax):
    drawn = np.zeros((300, 3, 2, 2), dtype=np.uint8)
    drawn[[200, 250], 0, 1, 0] = 1
    run = simulate_drawn(drawn, [Slave("1"), Slave("2")], cycles=300)
    run.plot(ax=ax)
    events = run.events()
    fault = events.query("phase == 'data_exchange' and outcome != 'ok'").index[0]
    assert len(requests_in(ax)) == 40
    assert requests_in(ax)[20].get_x() == pytest.approx(1e3 * events["time_s"][fault])
    said = f"requests {fault - 19} to {fault + 20} of {len(events)}, around the first fault"
    assert ax.get_title("left") == said


@pytest.mark.parametrize("cycles", [60, 300])
def test_of_many_requests_without_a_fault_the_longest_wait_is_drawn(ax, cycles):
    run = simulate([Slave("1"), Slave("2")], cycles=cycles)
    run.plot(ax=ax)
    many = len(run.events()) > 500
    assert many == (cycles == 300)
    assert len(requests_in(ax)) == (40 if many else len(run.events()))
    assert ax.get_title("left").endswith("around the longest wait of a slave" if many else "")


def test_a_figure_of_nothing_is_refused(ax):
    with pytest.raises(ArgumentError, match="select no request"):
        traffic().plot(start=1.0, ax=ax)


def test_the_states_are_drawn_from_their_table(ax):
    Slave.plot_states(ax=ax)
    said = "\n".join(text.get_text() for text in ax.texts).split("\n")
    assert [name for name in said if name.isupper()] == [state.value.upper() for state in State]
    pairs = {(state, after) for (state, _), after in TRANSITIONS.items()}
    assert sum(text.get_text() == "" for text in ax.texts) == len(pairs)
    for state, event in TRANSITIONS:
        if (state, event.name) != (State.ASYNCHRONOUS, "SLAVE_PAUSE"):
            assert any(line.startswith(event.value) for line in said)
            assert any(line.endswith(ACTIONS.get(event, "")) for line in said)


def test_an_arrow_names_no_pause_twice(ax):
    Slave.plot_states(ax=ax)
    said = [text.get_text() for text in ax.texts]
    assert {"any pause", "pause after the response"} <= set(said)


def test_no_words_overlap_and_none_leaves_the_figure(ax):
    Slave.plot_states(ax=ax)
    ax.figure.draw_without_rendering()
    boxes = [text.get_window_extent() for text in ax.texts if text.get_text()]
    for one, other in itertools.combinations(boxes, 2):
        assert not one.overlaps(other)
    states = [patch.get_window_extent() for patch in ax.patches if isinstance(patch, Rectangle)]
    words = [box for box in boxes if not any(s.contains(*box.min) for s in states)]
    assert not any(box.overlaps(state) for box in words for state in states)
    frame = ax.get_window_extent()
    assert all(frame.x0 <= box.x0 and box.x1 <= frame.x1 for box in boxes)
