"""Outlines, tables and the talk that the notebooks of kim2014 show."""

import matplotlib.pyplot as plt
import numpy as np
import pytest

from shipnet.ballast.scan import System
from shipnet.ballast.wear import Wear
from shipnet.errors import CrcError
from shipnet.modbus.faults import Break
from shipnet.modbus.frame import rtu_frame, tcp_frame
from shipnet.modbus.pdu import Request, decode
from shipnet.modbus.redundancy import Loop
from shipnet.modbus.uart import SerialLine
from shipnet.papers import figure
from shipnet.papers.kim2014.faults import graded_trials, reading_table
from shipnet.papers.kim2014.line import RATES, break_table, conversation, status_poll
from tests.modbus.sweeps import sweep

PDU = Request.read_input_registers(0x4020, 4).pdu


@pytest.fixture
def ax():
    figure, axes = plt.subplots()
    yield axes
    plt.close(figure)


def words(ax):
    return [text.get_text() for text in ax.texts]


def test_central_has_two_pipes_per_valve_distributed_has_bus_and_power(ax):
    figure("kim2014", "Fig 1", ax, n_valves=3)
    labels = [line.get_label() for line in ax.lines]
    assert [labels.count(kind) for kind in ("_pipe", "_bus", "_power")] == [6, 3, 3]


def test_an_rtu_frame_is_drawn_with_all_its_bytes_and_its_silence(ax):
    frame = rtu_frame(17, PDU)
    said = words(figure("kim2014", "Fig 4", ax, frame=frame, serial=SerialLine(115200)))
    drawn = "".join(text for text in said if text and set(text) <= set("0123456789abcdef "))
    assert bytes.fromhex(drawn) == frame
    assert said.count("silence\n18.3 char") == 2
    widths = [patch.get_width() for patch in ax.patches]
    assert widths == [1, 1, 4, 2, 2, 1, 1, 4, 2, 2]
    with pytest.raises(CrcError):
        figure("kim2014", "Fig 4", ax, frame=frame[:-1] + b"\0")


def test_a_tcp_frame_is_drawn_twice_with_all_its_bytes(ax):
    frame = tcp_frame(17, PDU, 0x1501)
    said = words(figure("kim2014", "Fig 6", ax, frame=frame))
    drawn = "".join(text for text in said if set(text) <= set("0123456789abcdef "))
    assert bytes.fromhex(drawn) == frame + frame
    assert [patch.get_width() for patch in ax.patches] == [7, 5, 2, 2, 2, 1, 1, 4]


def test_scan_times_are_those_of_the_polls():
    for number in (5, 247):
        expected = [number * status_poll(rate).time for rate in RATES]
        assert System(number).scan_times()["scan_s"].tolist() == pytest.approx(expected)
    # By hand: 28 characters of 11 bits.
    assert 1e3 * status_poll(9600).time == pytest.approx(28 * 11 / 9.6)


def test_the_cost_of_a_break_is_what_a_simulation_finds():
    table = break_table(6, timeouts=[0.1, 1.0])
    for timeout, row in table.iterrows():
        for column, move in (("one_by_one_s", "slave"), ("with_downstream_s", "downstream")):
            ring = Loop(6, status_poll(timeout=timeout), move=move)
            assert sweep(ring, [Break(3)]).max() == pytest.approx(row[column], rel=1e-9)


def test_a_conversation_is_made_of_sound_frames_and_ends_where_it_was_sent():
    table = conversation(25, times=(1.0, 4.0))
    assert table["from"].tolist() == ["master", "valve"] * 3
    for frame in table["frame"]:
        assert decode(bytes.fromhex(frame)).unit_id == 1
    echoed, *_ = (table["frame"][k] == table["frame"][k + 1] for k in (0, 2))
    assert echoed and table["says"].iloc[-1].endswith("VPos 25 %")
    moving = decode(bytes.fromhex(table["frame"][3])).pdu
    assert 0 < moving[2] < 25 and np.isclose(moving[2], 100 / 9.0, atol=1)


def test_the_rows_that_fire_and_those_that_do_not_make_13():
    table = reading_table()
    missed = table["not"].str.split(", ").map(lambda names: sum(map(bool, names)))
    assert (table["fires"] + missed == 13).all()
    assert (table["fires"] == table["fuzzy"]).all()
    assert table["fires"].tolist() == [11, 10, 10, 10, 13, 13, 13, 13]
    assert table["our ranking"].tolist() == [10, 10, 9, 10, 11, 13, 11, 13]


def test_a_fault_without_severity_is_not_reported_and_the_worst_is():
    table = graded_trials(rng=np.random.default_rng(2024))
    assert table["severity"].nunique() == 101
    some = table[table["fault"].isin(["V1", "Pos4", "O1"])]
    assert (some.loc[some["severity"] == 0, "said"] == "nothing").all()
    assert some[some["severity"] == 1].set_index("fault")["said"].to_dict() == {
        "V1": "its own name",
        "Pos4": "another fault's name",
        "O1": "its own name",
    }
    named = table["said"] == "its own name"
    assert (named == (table["top_fault"] == table["fault"])).all()


def test_more_strokes_predict_the_end_of_a_pump_more_closely():
    wear = Wear.synthetic(2, 300, rng=np.random.default_rng(2024))
    table = wear.life_table(2, [20, 60, 180])
    assert table.index.tolist() == [20, 60, 180]
    assert np.allclose(table["true"] + table.index, wear.life[1])
    width = table["high"] - table["low"]
    assert (width.diff().dropna() < 0).all()
    assert (abs(table["remaining"] - table["true"]) <= width).all()
