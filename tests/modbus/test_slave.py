import logging

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shipnet.errors import ArgumentError
from shipnet.modbus.pdu import Adu, Request, Response
from shipnet.modbus.slave import DeviceError, Registers, Slave, answer


def device():
    return Registers(
        coils=[0] * 20,
        discrete_inputs=[1, 0, 1],
        holding_registers={**dict.fromkeys(range(10), 7), 0x4001: 0, 65535: 9},
        input_registers=range(100, 110),
        limits={0x4001: (0, 100)},
    )


REQUEST_TO_RESPONSE = [
    (Request.read_coils(18, 2), Response(1, coils=[0, 0])),
    (Request.read_discrete_inputs(0, 3), Response(2, coils=[1, 0, 1])),
    (Request.read_holding_registers(65535, 1), Response(3, registers=[9])),
    (Request.read_input_registers(3, 2), Response(4, registers=[103, 104])),
    (Request.write_single_coil(19, True), Request.write_single_coil(19, True)),
    (Request.write_single_register(0x4001, 100), Request.write_single_register(0x4001, 100)),
    (Request.write_multiple_coils(1, [1, 0, 1]), Response(15, address=1, quantity=3)),
    (Request.write_multiple_registers(8, [1, 2]), Response(16, address=8, quantity=2)),
]


def test_every_function_code_is_answered_with_the_values_of_the_device():
    slave = Slave(device())
    for request_, response in REQUEST_TO_RESPONSE:
        assert slave.answer(request_.pdu) == response.pdu
    # What was written is read back.
    assert slave.answer(Request.read_coils(0, 5).pdu) == Response(1, coils=[0, 1, 0, 1, 0]).pdu
    written = Response(3, registers=[7, 1, 2]).pdu
    assert slave.answer(Request.read_holding_registers(7, 3).pdu) == written


@pytest.mark.parametrize(
    ("pdu", "response"),
    [
        ("0100130002", "8102"),  # coil 20 is one too many
        ("0300090002", "8302"),
        ("03ffff0002", "8302"),  # beyond the last address there is
        ("0300000000", "8303"),
        ("030000007e", "8303"),
        ("03000000", "8303"),
        ("030000000100", "8303"),
        ("0500000001", "8503"),
        ("0640010065", "8603"),  # 101 is above the limit
        ("060063ffff", "8602"),
        ("0f0000000801", "8f03"),
        ("10000000010100", "9003"),
        ("1000080003060001000200 03", "9002"),
        ("17000800030000000102ffff", "9701"),
        ("07", "8701"),
        ("0800000000", "8801"),
        ("2b0e0100", "ab01"),
        ("7f", "ff01"),
        ("00", ""),
        ("80", ""),
        ("8301", ""),
        ("", ""),
    ],
)
def test_impossible_requests_get_the_exception_of_the_standard(pdu, response):
    slave = Slave(device())
    assert slave.answer(bytes.fromhex(pdu)).hex() == response
    # Nothing was partly written.
    assert vars(slave.device) == vars(device())


def test_the_junction_box_of_lee2012_serves_function_code_3_alone():
    box = Slave(device(), functions={3})
    assert box.answer(Request.read_holding_registers(0, 1).pdu) == bytes.fromhex("03020007")
    others = [*range(1, 3), *range(4, 128)]
    assert [box.answer(bytes([code, 0, 0, 0, 1])) for code in others] == [
        bytes([code | 0x80, 1]) for code in others
    ]


def test_an_injected_exception_and_silence_execute_nothing():
    slave = Slave(device(), exception=6)
    assert slave.answer(Request.write_single_register(0, 1).pdu).hex() == "8606"
    assert slave.answer(b"\x07").hex() == "8701"
    slave.exception, slave.silent = None, True
    assert slave.answer(Request.write_single_register(0, 1).pdu) == b""
    slave.silent = False
    assert slave.answer(Request.read_holding_registers(0, 1).pdu).hex() == "03020007"


LEGAL = [1, 2, 3, 4, 5, 6, 15, 16, 23]


class Scripted:
    """A device that does what the test needs."""

    def __init__(self, act):
        self.act = act

    def read(self, table, address, quantity, time):
        return self.act(quantity, time)

    def write(self, table, address, values, time):
        self.act(values, time)


@pytest.mark.parametrize(
    "act",
    [
        lambda n, t: [1] * (n + 1),
        lambda n, t: [65536] * n,
        lambda n, t: [1.5] * n,
        lambda n, t: None,
        lambda n, t: 1 / 0,
    ],
)
def test_a_device_that_fails_is_answered_with_exception_4(act, caplog):
    with caplog.at_level(logging.ERROR, "shipnet.modbus.server"):
        assert Slave(Scripted(act)).answer(Request.read_holding_registers(0, 2).pdu).hex() == "8304"
    assert "the device failed" in caplog.text


def test_a_device_gets_simulated_time_and_chooses_its_exception():
    def act(n, time):
        if time < 4:
            raise DeviceError(5)
        return [int(time)] * n

    slave = Slave(Scripted(act))
    assert slave.answer(Request.read_input_registers(0, 1).pdu, 3.9).hex() == "8405"
    assert slave.answer(Request.read_input_registers(0, 1).pdu, 17.0).hex() == "04020011"


def test_unit_ids_address_slaves_as_in_the_guides():
    read, write = Request.read_holding_registers(0, 1).pdu, Request.write_single_register(0, 1).pdu
    slaves = {k: Slave(device(), delay=0.1 * k) for k in (1, 247)}
    assert answer(slaves, Adu(247, read)) == (b"\x03\x02\x00\x07", pytest.approx(24.7))
    for unit in (2, 248, 255):
        assert answer(slaves, Adu(unit, read)) == (b"\x83\x0b", 0)
        assert answer(slaves, Adu(unit, read), serial=True) == (b"", 0)
        assert answer(slaves, Adu(unit, b"\x83\x02")).pdu == b""
    assert answer(slaves, Adu(0, read)) == answer(slaves, Adu(0, write)) == (b"", 0)
    assert [s.device.holding_registers[0] for s in slaves.values()] == [1, 1]
    slaves[0] = Slave(device())
    for unit in (0, 255):
        assert answer(slaves, Adu(unit, read)).pdu == b"\x03\x02\x00\x07"
    written = []
    slaves = {1: Slave(Scripted(lambda values, time: written.append(values)))}
    answer(slaves, Adu(0, read))  # a broadcast reads nothing
    answer(slaves, Adu(0, write))
    assert written == [[1]]


@given(
    pdu=st.binary(min_size=1, max_size=253)
    | st.builds(
        bytes.__add__, st.sampled_from([bytes([k]) for k in LEGAL]), st.binary(max_size=30)
    ),
    unit=st.integers(0, 255),
    serial=st.booleans(),
)
def test_any_bytes_get_silence_an_exception_or_the_right_response(pdu, unit, serial):
    found, _ = answer({1: Slave(device())}, Adu(unit, pdu), serial=serial)
    if found:
        assert found[0] & 0x7F == pdu[0]
        Response.parse(found, None if found[0] > 127 else Request.parse(pdu))
    if serial and unit != 1:
        assert found == b""


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Slave(device(), delay=-1), "delay is -1 s"),
        (lambda: Slave(device(), functions={7}), r"functions is \{7\}"),
        (lambda: Slave(device(), functions=3), "functions is 3"),
        (lambda: Slave(device(), exception=7), "exception is 7"),
        (lambda: Slave(device(), silent=1), "silent is 1"),
        (lambda: Slave(device(), input_registers=[1]), "a device and input_registers are given"),
        (lambda: DeviceError(9), "exception is 9"),
        (lambda: Slave(coils=[2]), r"coils\[0\] is 2"),
        (lambda: Slave(holding_registers=[-1]), r"registers\[0\] is -1"),
        (lambda: Slave(input_registers={65536: 0}), "address in input_registers is 65536"),
        (lambda: Slave(limits={0: (0, 1)}), "limits has address 0"),
        (lambda: Slave(holding_registers=[0], limits={0: (2, 1)}), r"limits\[0\]\[1\] is 1"),
    ],
)
def test_arguments_out_of_range_are_named(make, message):
    with pytest.raises(ArgumentError, match=message):
        make()


def test_a_misspelt_field_is_refused():
    with pytest.raises(AttributeError, match="dealy"):
        Slave(device()).dealy = 1


def test_numpy_columns_and_full_tables_are_accepted():
    full = Registers(holding_registers=np.arange(65536))
    assert full.read("holding_registers", 65411, 125, 0.0) == list(range(65411, 65536))
    assert Registers(coils=np.array([True])).coils == {0: 1}
