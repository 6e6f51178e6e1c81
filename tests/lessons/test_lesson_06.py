"""The right answers of lesson 6, by another way."""

import numpy as np
import pytest

from shipnet.modbus.frame import rtu_frame
from shipnet.modbus.pdu import Request, Response, decode
from shipnet.modbus.uart import SerialLine
from tests.lessons.students import NAMED, right, solved


@NAMED
def test_a_peer_reads_the_request_as_it_was_meant(name):
    pymodbus = pytest.importorskip("pymodbus.pdu.register_message")
    numbers, expected = right("ex-06-1", name)
    request = pymodbus.ReadHoldingRegistersRequest(
        address=numbers["number"] - 1, count=numbers["quantity"]
    )
    assert expected == bytes([numbers["unit"], 3]) + request.encode()
    read = Request.parse(decode(rtu_frame(expected[0], expected[1:])).pdu)
    assert read == Request.read_holding_registers(numbers["number"] - 1, numbers["quantity"])


@NAMED
def test_the_response_is_as_long_as_its_waveform(name):
    numbers, expected = right("ex-06-2", name)
    frame = rtu_frame(1, Response(3, registers=[0] * numbers["registers"]).pdu)
    time = SerialLine(numbers["rate"]).waveform(frame, gap=0).time
    assert expected == pytest.approx(1e3 * time[-1])


def transaction(line, quantity):
    """Return how long request and response of zeros last on the line with their silences."""
    frames = [
        rtu_frame(1, Request.read_holding_registers(0, quantity).pdu),
        rtu_frame(1, Response(3, registers=[0] * quantity).pdu),
    ]
    return line.waveform(frames, start=0).time[-1]


def test_a_scan_is_as_long_as_its_waveforms():
    asked = solved("ex-06-3")
    for slaves, quantity, rate in asked.cases:
        right = slaves * transaction(SerialLine(rate), quantity)
        assert asked.value(slaves, quantity, rate) == pytest.approx(right)


@NAMED
def test_one_valve_more_would_be_late(name):
    numbers, most = right("ex-06-4", name)
    line = SerialLine(numbers["rate"])
    alive = transaction(line, 4) + numbers["think_ms"] / 1e3
    dead = 8 * 11 / numbers["rate"] + numbers["timeout_ms"] / 1e3
    scan = dead + alive * (np.arange(1, 248) - 1)
    assert int((scan <= 2).sum()) == most < 247
