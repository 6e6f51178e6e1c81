"""Faults on the wire of a real server: their bytes and order, and that no other client waits."""

import re
import select
import signal
import socket
import struct
from contextlib import ExitStack
from time import monotonic, sleep

import numpy as np
import pytest

from benchmarks.modbus_clients.run import serial_pair
from shipnet.__main__ import main
from shipnet.errors import ArgumentError
from shipnet.modbus import Adu, Request, SerialLine, Slave, WireFault, decode, serve
from shipnet.modbus.frame import rtu_frame
from shipnet.modbus.wire import Wire
from tests.support import running

READ = Request.read_holding_registers(0, 2)
PDU = READ.response([350, 412]).pdu
RTU, TCP = Adu(1, PDU), Adu(1, PDU, 7)
BEFORE = READ.response([1, 2]).pdu

#: How long a test waits for what must arrive [s]; it only ends a test that has failed.
PATIENCE = 60.0


def sent(name, answer, previous=None):
    """Return the bytes of a fault that takes no time, as hexadecimal text."""
    ((silence, data),) = WireFault(name).pieces(answer, previous, 1)
    assert silence == 0
    return data.hex(" ")


@pytest.mark.parametrize(
    ("name", "pdu", "unit"),
    [
        ("double", None, 1),
        ("previous", "03 04 0001 0002", 1),
        ("wrong-unit", "03 04 015e 019d", 2),
        ("wrong-function", "04 04 015e 019d", 1),
        ("wrong-count", "03 02 015e 019c", 1),
    ],
)
def test_each_fault_sends_the_expected_bytes(name, pdu, unit):
    before = bytes.fromhex("0006 0000 0007 01 03 04 0001 0002")
    if pdu is None:
        assert sent(name, TCP) == (2 * TCP.tcp).hex(" ")
        assert sent(name, RTU) == (2 * RTU.rtu).hex(" ")
        return
    pdu = bytes.fromhex(pdu)
    tcp = before if name == "previous" else TCP.tcp[:6] + bytes([unit]) + pdu
    assert sent(name, TCP, Adu(1, BEFORE, 6)) == tcp.hex(" ")
    assert sent(name, RTU, Adu(1, BEFORE)) == rtu_frame(unit, pdu).hex(" ")


@pytest.mark.parametrize(
    ("name", "answer", "changed"),
    [
        ("short", TCP, TCP.tcp[:6]),
        ("wrong-crc", RTU, RTU.rtu[:6] + b"\x9d" + RTU.rtu[7:]),  # the CRC of other data
        ("wrong-transaction", TCP, b"\0\x08" + TCP.tcp[2:-1] + b"\x9d"),
        ("wrong-transaction", Adu(1, b"\x83\x02", 0xFFFF), Adu(1, b"\x83\x03", 0).tcp),
        ("wrong-unit", Adu(247, b"\x03\x02\x00\x07", 1), Adu(1, b"\x03\x02\x00\x06", 1).tcp),
        ("wrong-function", Adu(1, b"\x01\x01\x01", 1), Adu(1, b"\x02\x01\x00", 1).tcp),
        ("wrong-function", Adu(1, b"\xff\x01", 1), Adu(1, b"\x00\x00", 1).tcp),
        ("wrong-count", Adu(1, b"\x01\x01\x01", 1), Adu(1, b"\x01\x00\x01", 1).tcp),
        ("wrong-count", Adu(1, b"\x83\x02", 1), Adu(1, b"\x83\x02", 1).tcp),
        ("wrong-count", Adu(1, b"\x06\0\1\0\2", 1), Adu(1, b"\x06\0\1\0\2", 1).tcp),
        ("previous", TCP, TCP.tcp),
    ],
)
def test_short_responses_first_ones_and_ends_of_ranges(name, answer, changed):
    assert sent(name, answer) == changed.hex(" ")


def test_garbage_is_four_bytes_before_or_after_the_response():
    good = RTU.rtu.hex(" ")
    before, after = sent("garbage-before", RTU), sent("garbage-after", RTU)
    assert before.endswith(good) and after.startswith(good)
    assert len(before) == len(after) == len(good) + 12
    assert before[:11] == after[-11:]  # one seed


def test_faults_of_timing_delay_or_split_the_response():
    assert WireFault("late").pieces(RTU) == [(5.0, RTU.rtu)]
    assert WireFault("late", seconds=0).pieces(TCP) == [(0.0, TCP.tcp)]
    gap = WireFault("gap", seconds=0.25).pieces(TCP)
    assert [silence for silence, _ in gap] == [0.0, 0.25]
    assert b"".join(data for _, data in gap) == TCP.tcp
    rng = np.random.default_rng(1)
    delays = [WireFault("delay", seconds=2).pieces(RTU, rng=rng)[0][0] for _ in range(500)]
    assert 0 <= min(delays) < 0.1 and 1.9 < max(delays) <= 2 and 0.9 < np.mean(delays) < 1.1


def test_at_most_one_fault_hits_a_response_with_the_stated_probability():
    wire = Wire([WireFault("short", 0.3), WireFault("double", 0.2)], 1)
    sizes = np.array([len(wire.pieces(RTU)[0][1]) for _ in range(4000)])
    assert set(sizes) == {4, 9, 18}
    # Three standard deviations of a fraction of 4000 answers are at most 0.024.
    assert abs((sizes == 4).mean() - 0.3) < 0.024 and abs((sizes == 18).mean() - 0.2) < 0.024
    again = Wire([WireFault("short", 0.3), WireFault("double", 0.2)], 1)
    assert [len(again.pieces(RTU)[0][1]) for _ in range(4000)] == sizes.tolist()
    never, always = Wire([WireFault("short", 0)], 1), Wire([WireFault("short", 1)], 1)
    assert {len(never.pieces(RTU)[0][1]) for _ in range(99)} == {9}
    assert {len(always.pieces(RTU)[0][1]) for _ in range(99)} == {4}


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "name is ''; it must be one of 'late', 'delay'"),
        ("wrong", "name is 'wrong'; it must be one of .*'wrong-transaction'"),
        ("late:", "it must be NAME, NAME:PROBABILITY or"),
        ("late:x", "it must be NAME"),
        ("late:1:2:3", "it must be NAME"),
        ("late:1.5", "probability is 1.5; it must be 0..1"),
        ("late:nan", "probability is nan"),
        ("late:1:-1", "seconds is -1 s; it must be 0..3600"),
        ("double:1:1", "only late, delay, gap take time"),
    ],
)
def test_a_wrong_text_is_refused(text, message):
    with pytest.raises(ArgumentError, match=message):
        WireFault.parse(text)
    assert WireFault.parse("short") == WireFault("short", 1.0)
    assert WireFault.parse("late:0.5:2") == WireFault("late", 0.5, 2.0)


@pytest.mark.parametrize(
    ("faults", "transport", "message"),
    [
        (WireFault("wrong-crc"), "tcp", "'wrong-crc' needs a serial line; a TCP frame has no CRC"),
        (WireFault("wrong-transaction"), "rtu", "needs TCP; an RTU frame has no transaction id"),
        (WireFault("double"), "udp", "need TCP or a serial line, not datagrams"),
        ([WireFault("double", 0.6), WireFault("gap", 0.6)], "tcp", "add up to 1.2"),
    ],
)
def test_faults_must_fit_the_transport_and_each_other(faults, transport, message):
    where = {"serial_port": "none"} if transport == "rtu" else {}
    with pytest.raises(ArgumentError, match=message):
        serve({1: Slave()}, transport, wire_faults=faults, **where)


@pytest.mark.parametrize("device", ["ballast", "engine"])
@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--wire-fault", "wrong"], "it must be one of 'late', 'delay', 'gap', 'double'"),
        (["--wire-fault", "wrong-crc:0.1"], "'wrong-crc' needs a serial line"),
        (["--udp", "--wire-fault", "late"], "not datagrams"),
        (["--wire-fault", "gap:0.9", "--wire-fault", "late:0.2"], "add up to 1.1"),
    ],
)
def test_the_program_refuses_in_one_line(device, words, message, capsys):
    assert main(["serve", device, "--port", "0", *words]) == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1


@pytest.mark.parametrize(
    ("device", "unit", "request_sent"),
    [
        ("ballast", 1, Request.read_input_registers(0x4020, 4)),
        ("engine", 2, Request.read_holding_registers(0, 3)),
    ],
)
def test_the_program_sends_responses_with_a_fault(device, unit, request_sent):
    with running("serve", device, "--port", "0", "--wire-fault", "wrong-unit:1") as program:
        port = int(re.search(r"port (\d+) \(TCP\)", program.stdout.readline())[1])
        with socket.create_connection(("127.0.0.1", port), PATIENCE) as client:
            client.sendall(request_sent.tcp(unit, 5))
            size = len(request_sent.response([0] * request_sent.quantity).tcp(unit, 5))
            found = decode(bytes.fromhex(received(client, size)), "tcp")
        program.send_signal(signal.SIGINT)
        _, error = program.communicate(timeout=PATIENCE)
    assert (found.unit_id, found.transaction_id, error) == (unit + 1, 5, "")


def asked(client, transaction, first):
    client.sendall(Request.read_holding_registers(first, 1).tcp(1, transaction))


def received(client, size):
    data = b""
    while len(data) < size and (part := client.recv(size - len(data))):
        data += part
    return data.hex(" ")


def connected(stack, server):
    client = stack.enter_context(socket.create_connection(("127.0.0.1", server.port), PATIENCE))
    client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    return client


def hits(share, *wanted):
    """Return a seed whose first draws hit or miss as requested."""
    for seed in range(10_000):
        draws = np.random.default_rng(seed).random(len(wanted)) < share
        if draws.tolist() == list(wanted):
            return seed
    raise AssertionError


def test_a_late_response_is_not_overtaken_and_keeps_no_other_client_waiting():
    late, seed = WireFault("late", 0.5, 1.0), hits(0.5, True, False, False)
    slave = Slave(holding_registers=[10, 11, 12])
    with ExitStack() as stack:
        server = stack.enter_context(serve({1: slave}, wire_faults=late, rng=seed))
        one, other = connected(stack, server), connected(stack, server)
        begin = monotonic()
        asked(one, 1, 0)
        asked(one, 2, 1)
        asked(other, 3, 2)
        assert received(other, 11) == "00 03 00 00 00 05 01 03 02 00 0c"
        early = select.select([one], [], [], 0)[0]
        assert not early or monotonic() - begin >= 0.99
        both = received(one, 22)
        assert both == "00 01 00 00 00 05 01 03 02 00 0a 00 02 00 00 00 05 01 03 02 00 0b"
        assert monotonic() - begin >= 0.99


def test_many_responses_after_a_late_one_come_in_order():
    late, seed = WireFault("late", 0.001, 0.3), hits(0.001, True)
    n = 400  # more than are held back for one client
    with ExitStack() as stack:
        slave = Slave(holding_registers=range(n))
        server = stack.enter_context(serve({1: slave}, wire_faults=late, rng=seed))
        client = connected(stack, server)
        for k in range(n):
            asked(client, k, k)
        data = bytes.fromhex(received(client, 11 * n))
    assert [int.from_bytes(data[11 * k + 9 :][:2], "big") for k in range(n)] == list(range(n))


def test_a_gap_splits_a_response():
    with ExitStack() as stack:
        slave = Slave(holding_registers=[10])
        gap = WireFault("gap", seconds=0.3)
        client = connected(stack, stack.enter_context(serve({1: slave}, wire_faults=gap)))
        begin = monotonic()
        asked(client, 1, 0)
        assert received(client, 5) == "00 01 00 00 00"
        assert received(client, 6) == "05 01 03 02 00 0a"
        assert monotonic() - begin >= 0.29


def test_a_serial_line_has_faults_too():
    import serial

    slaves = {1: Slave(holding_registers=[350, 412])}
    line = {"line": SerialLine(19200, "8N1"), "wire_faults": WireFault("double")}
    with serial_pair() as (ours, theirs), serial.Serial(theirs, 19200, timeout=PATIENCE) as port:
        with serve(slaves, "rtu", serial_port=ours, **line):
            for _ in range(3):
                port.write(READ.rtu(1))
                assert port.read(18) == 2 * RTU.rtu


def test_a_client_may_leave_before_a_late_response_and_another_gets_the_previous_one():
    faults = [WireFault("late", 0.5, 0.05), WireFault("previous", 0.5)]
    slave, seed = Slave(holding_registers=[10, 11]), hits(0.5, True, False)
    with ExitStack() as stack:
        server = stack.enter_context(serve({1: slave}, wire_faults=faults, rng=seed))
        gone, other = connected(stack, server), connected(stack, server)
        asked(gone, 1, 0)
        # RST at once: the late response finds no connection.
        gone.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        sleep(0.02)
        gone.close()
        sleep(0.2)
        asked(other, 2, 1)
        assert received(other, 11) == "00 01 00 00 00 05 01 03 02 00 0a"
