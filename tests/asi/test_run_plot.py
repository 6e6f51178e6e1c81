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


def test_nothing_and_too_much_are_refused(ax):
    run = traffic()
    with pytest.raises(ArgumentError, match="select 0 requests"):
        run.plot(start=1.0, ax=ax)
    with pytest.raises(ArgumentError, match=r"select \d{3} requests; a figure shows 1 to 500"):
        simulate([Slave("1")], cycles=300).plot(ax=ax)


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
