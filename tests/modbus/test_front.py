"""Tables and one-line texts of frames, slaves, servers and runs."""

import pytest

from shipnet import modbus
from shipnet.modbus.faults import Break, DeadSlave

STATUS = modbus.Request.read_input_registers(0x4020, 4)


@pytest.mark.parametrize(
    ("pdu", "fields"),
    [
        (STATUS, "unit id, function code, starting address, quantity, CRC"),
        (STATUS.response([0] * 4), "unit id, function code, byte count, values, CRC"),
        (STATUS.exception(2), "unit id, function code, exception code, CRC"),
        (modbus.Request.write_single_register(1, 2), "unit id, function code, address, value, CRC"),
        (
            modbus.Request.write_multiple_registers(1, [2]),
            "unit id, function code, starting address, quantity, byte count, values, CRC",
        ),
        (
            modbus.Request.write_multiple_registers(1, [2]).response(),
            "unit id, function code, starting address, quantity, CRC",
        ),
        (bytes.fromhex("2b0e"), "unit id, function code, data, CRC"),
    ],
)
def test_a_table_names_each_field_and_contains_every_byte(pdu, fields):
    adu = modbus.Adu(1, pdu)
    table = adu.table()
    assert ", ".join(table.index) == fields
    assert bytes.fromhex("".join(table["bytes"])) == adu.rtu
    tcp = modbus.Adu(1, pdu, 5).table()
    assert bytes.fromhex("".join(tcp["bytes"])) == modbus.Adu(1, pdu, 5).tcp
    assert list(tcp.index[:4]) == ["transaction id", "protocol id", "length", "unit id"]


@pytest.mark.parametrize(
    "request_",
    [
        STATUS,
        modbus.Request.write_single_coil(3, True),
        modbus.Request.write_single_register(3, 4),
        modbus.Request.write_multiple_coils(3, [1, 0]),
        modbus.Request.write_multiple_registers(3, [1, 2]),
    ],
)
def test_the_repr_of_a_request_is_the_call_that_makes_it(request_):
    assert eval(repr(request_), {"Request": modbus.Request}) == request_


def test_the_reprs_are_one_line():
    loop = modbus.Loop(6, modbus.Poll(STATUS, modbus.SerialLine(9600), timeout=0.1))
    run = modbus.simulate(loop, faults=[Break(3, start=0.3), DeadSlave(1)], until=1.0)
    assert repr(run).startswith("Run(6 slaves, break 3, slave 1, ")
    box = modbus.Slave(holding_registers=[1, 2], coils=[1], functions={3}, delay=0.02)
    assert repr(box) == "Slave(Registers, delay 0.02 s)"
    box = modbus.Slave(input_registers=[7], exception=6, silent=True)
    assert repr(box) == "Slave(Registers, delay 0 s, exception SERVER_DEVICE_BUSY, silent)"
    server = modbus.serve({1: box, 2: box})
    assert repr(server) == "Server(2 slaves, does not listen)"
    with server:
        assert repr(server) == f"Server(2 slaves, listens on port {server.port})"
