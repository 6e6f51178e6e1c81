"""The states of a master and its slaves, telegram by telegram."""

from itertools import pairwise

import matplotlib.pyplot as plt
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.colors import to_rgb

from shipnet import style
from shipnet.asi import ExchangeStates, Master, Slave, simulate
from shipnet.asi.slave import TRANSITIONS
from shipnet.asi.states import CHANGES, TURNS, Turn
from shipnet.asi.telegram import Request, Response
from shipnet.errors import ArgumentError, FrameError

TWO = [Slave("21", inputs=6), Slave("22")]


def test_a_slave_that_misreads_a_request_to_another_slave_waits_for_a_pause():
    table = ExchangeStates(TWO, damaged=[4], steps=8).table()
    assert table["slave 21"].tolist() == [
        "asynchronous",  # power-on: it has not heard a pause
        "receive",
        "synchronous",
        "receive",
        "asynchronous",  # the damaged request to slave 22
        "receive",
        "synchronous",
        "receive",
    ]
    assert table["master"].tolist() == ["wait", "repeat", "wait", "send"] * 2
    assert table["telegram"][6] == Request.data_exchange(22, 0xF).bits != table["telegram"][4]
    with pytest.raises(FrameError):
        Request.parse(table["telegram"][4])


def test_a_damaged_response_is_sent_again_by_a_slave_that_has_already_obeyed():
    table = ExchangeStates(TWO, damaged=[5], steps=8).table()
    assert table["sender"].tolist()[4:] == ["master", "slave 22"] * 2
    assert table["telegram"][4] == table["telegram"][6]
    assert table["master"].tolist()[4:] == ["wait", "repeat", "wait", "send"]
    assert table["telegram"][7] == Response(0).bits != table["telegram"][5]


def test_after_a_second_failure_the_master_asks_the_next_slave():
    table = ExchangeStates(TWO, damaged=[3], steps=5).table()
    assert table["master"].tolist() == ["wait", "repeat", "wait", "send", "wait"]
    assert table["telegram"][4] == Request.data_exchange(22, 0xF).bits


def test_the_master_sends_the_requests_of_a_simulation():
    states = ExchangeStates(TWO, steps=200).table()
    requests = states.loc[states["sender"] == "master", "telegram"].tolist()[1:]
    events = simulate(TWO, Master({"21": "S-0.F.F", "22": "S-0.F.F"}), cycles=30).events()
    cyclic = events.loc[events["cycle"] >= 0, "request"].tolist()
    assert requests == cyclic[: len(requests)]


@given(st.sets(st.integers(0, 199)))
def test_a_master_changes_its_state_only_as_drawn(damaged):
    turns = ExchangeStates(TWO, damaged=sorted(damaged), steps=200).table()["master"]
    states = [Turn.SEND, *map(Turn, turns)]
    assert set(pairwise(states)) <= set(TURNS)


def test_a_master_makes_every_change_that_is_drawn():
    turns = ExchangeStates(TWO, steps=8).table()["master"]
    states = [Turn.SEND, *map(Turn, turns)]
    assert set(pairwise(states)) == set(TURNS)


def test_a_slave_makes_every_change_that_is_drawn_and_no_other():
    assert {(begin, end) for (begin, _), end in TRANSITIONS.items()} == set(CHANGES)


def marked(ax):
    """Return the names of the marked states."""
    now = to_rgb(style.FIELD["information"])
    boxes = [one for one in ax.patches if one.get_facecolor()[:3] == now]
    names = {text.get_position(): text.get_text() for text in ax.texts}
    middles = [(one.get_x() + one.get_width() / 2, one.get_y() + 0.4) for one in boxes]
    return [
        name
        for (x, y), name in names.items()
        if any(abs(x - u) + abs(y - v) < 1e-9 for u, v in middles)
    ]


@pytest.mark.parametrize("step", [0, 1, 4, 19])
def test_a_step_marks_the_states_of_its_row(step):
    states = ExchangeStates(TWO, damaged=[4])
    row = states.table().loc[step]
    assert marked(states.plot("22", step)) == [row["master"], row["slave 22"]]
    plt.close()


def test_the_figure_without_a_step_marks_no_state():
    assert marked(ExchangeStates(TWO).plot("21")) == []


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"slaves": []}, r"slaves are \[\]; give at least one, and no address twice"),
        ({"slaves": TWO[:1] * 2}, r"slaves are \['21', '21'\]"),
        ({"slaves": [Slave("3A"), Slave("3")]}, r"slaves are \['3A', '3'\]"),
        ({"slaves": ["21"]}, "a slave is '21'; it must be a Slave"),
        ({"damaged": [20]}, "a step in damaged is 20; it must be a whole number 0..19"),
        ({"damaged": 3}, "damaged"),
        ({"steps": 0}, "steps is 0; it must be a whole number 1..1000"),
    ],
)
def test_impossible_exchanges_are_refused(settings, message):
    with pytest.raises(ArgumentError, match=message):
        ExchangeStates(**{"slaves": TWO} | settings)


def test_a_figure_of_an_unknown_slave_or_step_is_refused():
    states = ExchangeStates(TWO, steps=3)
    with pytest.raises(ArgumentError, match="slave"):
        states.plot("5")
    with pytest.raises(ArgumentError, match=r"step is 3; it must be a whole number 0..2"):
        states.plot("21", 3)
