"""What a new user types first, and the results in one line."""

import pytest

from shipnet import modbus
from shipnet.errors import ArgumentError
from shipnet.modbus.faults import Break, DeadSlave

STATUS = modbus.Request.read_input_registers(0x4020, 4)
LINE = modbus.SerialLine(9600)


def test_a_frame_is_encoded_and_decoded_in_one_line_each():
    frame = modbus.Request.read_holding_registers(0, 10).rtu(17)
    assert frame.hex(" ") == "11 03 00 00 00 0a c7 5d"
    assert modbus.decode(frame).request() == modbus.Request.read_holding_registers(0, 10)
    response = STATUS.response([5672, 5, 5170, 23052])
    for framing, data in (
        ("rtu", response.rtu(1)),
        ("tcp", response.tcp(1, 7)),
    ):
        adu = modbus.decode(data, framing)
        assert adu.unit_id == 1 and adu.response(STATUS).registers == (5672, 5, 5170, 23052)


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


def test_a_response_has_as_many_values_as_were_requested():
    with pytest.raises(ArgumentError, match="values has 3 values; 4 were requested"):
        STATUS.response([1, 2, 3])
    with pytest.raises(ArgumentError, match="framing is 'RTU'"):
        modbus.decode(b"", "RTU")


def test_the_repr_of_a_run_is_one_line():
    loop = modbus.Loop(6, modbus.Poll(STATUS, LINE, timeout=0.1))
    run = modbus.simulate(loop, faults=[Break(3, start=0.3), DeadSlave(1)], until=1.0)
    assert repr(run).startswith("Run(6 slaves, break 3, slave 1, ")
    assert run.faults == (Break(3, start=0.3), DeadSlave(1)) and run.until == 1.0
    lost = modbus.udp.compare([1, 2, 1, 2], modbus.udp.LossyPath(lost=1.0), rng=1)
    assert lost["timeouts"].tolist() == [4, 4, 4] and not lost["mismatched"].any()
    with pytest.raises(ArgumentError, match="must be one of Break, DeadPort, DeadSlave, Short"):
        modbus.simulate(loop, faults=[3], until=1)


def test_a_slave_has_a_device_or_tables():
    with pytest.raises(ArgumentError, match="a device and input_registers are given"):
        modbus.Slave(modbus.Slave(coils=[1]).device, input_registers=[1])
    slave = modbus.Slave(input_registers=[7, 8])
    slave.device.input_registers[0] = 9
    found = slave.answer(modbus.Request.read_input_registers(0, 2))
    assert modbus.Response.parse(found).registers == (9, 8)


def test_the_reprs_of_slaves_and_servers_are_one_line():
    box = modbus.Slave(holding_registers=[1, 2], coils=[1], functions={3}, delay=0.02)
    assert repr(box) == "Slave(Registers, delay 0.02 s)"
    box = modbus.Slave(input_registers=[7], exception=6, silent=True)
    assert repr(box) == "Slave(Registers, delay 0 s, exception SERVER_DEVICE_BUSY, silent)"
    server = modbus.serve({1: box, 2: box})
    assert repr(server) == "Server(2 slaves, does not listen)"
    with server:
        assert repr(server) == f"Server(2 slaves, listens on port {server.port})"


def test_a_server_runs_at_a_multiple_of_real_time():
    times = []

    class Clock:
        def read(self, table, address, quantity, time):
            times.append(time)
            return [0] * quantity

        def write(self, table, address, values, time): ...

    with modbus.serve({1: Clock()}, speed=1e5) as server:
        import socket

        with socket.create_connection(("127.0.0.1", server.port), timeout=10) as client:
            for _ in range(2):
                client.sendall(modbus.Request.read_coils(0, 1).tcp(1, 5))
                assert client.recv(260)
    assert times[1] > times[0] > 0
    with pytest.raises(ArgumentError, match="speed is -1"):
        modbus.serve({1: Clock()}, speed=-1)


def test_the_longest_legal_frames_are_read():
    for framing in ("rtu", "tcp"):
        adu = modbus.Adu(247, bytes([3, *range(252)]), 9 if framing == "tcp" else None)
        assert modbus.decode(getattr(adu, framing), framing) == adu
