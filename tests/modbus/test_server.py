"""The server on real sockets and pseudo-terminals, with clients written by others."""

import os
import select
import socket
import subprocess
import sys
import threading
from contextlib import ExitStack, contextmanager, suppress
from time import monotonic, sleep

import minimalmodbus
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymodbus.client import ModbusSerialClient, ModbusTcpClient, ModbusUdpClient
from pymodbus.exceptions import ModbusIOException

from benchmarks.modbus_clients.run import serial_pair
from shipnet.errors import ArgumentError
from shipnet.modbus import handlers
from shipnet.modbus.frame import rtu_frame, tcp_frame
from shipnet.modbus.pdu import Request, Response
from shipnet.modbus.server import serve
from shipnet.modbus.slave import Registers, Slave
from shipnet.modbus.uart import SerialLine
from tests.support import require

READ = Request.read_holding_registers(0, 2).pdu
LINE = SerialLine(115200, "8N1")

#: How long a test waits for what must arrive [s]; it only ends a test that has failed.
PATIENCE = 60.0


def device(first=10):
    return Registers(
        coils=[1, 0, 1, 1],
        discrete_inputs=[0, 1],
        holding_registers=[first, first + 1, first + 2],
        input_registers={0x4020: 42},
    )


class Readable:
    """A device whose reads call a function with the quantity and the time."""

    def __init__(self, read):
        self._read = read

    def read(self, table, address, quantity, time):
        return self._read(quantity, time)

    def write(self, table, address, values, time):
        raise AssertionError


class Gate(Readable):
    """A device that blocks the whole server until it is opened, and counts the reads."""

    def __init__(self, value=0):
        self.open, self.value, self.reads = threading.Event(), value, 0

    def _read(self, quantity, time):
        self.reads += 1
        self.open.wait()
        return [self.value + k for k in range(quantity)]


def journal(unit, book):
    """Return a device that notes its unit id at each read."""
    return Readable(lambda quantity, time: book.append(unit) or [0] * quantity)


def response(first=10):
    return Response(3, registers=[first, first + 1]).pdu


@contextmanager
def raw(server, kind=socket.SOCK_STREAM, timeout=PATIENCE):
    with socket.socket(socket.AF_INET, kind) as client:
        client.settimeout(timeout)
        client.connect(("127.0.0.1", server.port))
        yield client


def receive(client, size):
    data = b""
    while len(data) < size and (part := client.recv(size - len(data))):
        data += part
    return data


def is_closed(client):
    try:
        return client.recv(1) == b""
    except ConnectionResetError:
        return True


def is_silent(client, seconds=0.15):
    return not select.select([client], [], [], seconds)[0]


def wait_for(find):
    end = monotonic() + PATIENCE
    while not (found := find()):
        assert monotonic() < end, "waited in vain"
        sleep(0.002)
    return found


@pytest.fixture
def line():
    """Two serial ports whose bytes reach each other."""
    require("pty", hasattr(os, "openpty"), "this system has no pseudo-terminals")
    with serial_pair() as pair:
        yield pair


@contextmanager
def opened(client):
    assert client.connect()
    try:
        yield client
    finally:
        client.close()


def ask_everything(client, unit=1):
    """Use every function code through pymodbus's client."""
    one = {"device_id": unit}
    assert client.read_coils(0, count=4, **one).bits[:4] == [True, False, True, True]
    assert client.read_discrete_inputs(0, count=2, **one).bits[:2] == [False, True]
    assert client.read_holding_registers(0, count=3, **one).registers == [10, 11, 12]
    assert client.read_input_registers(0x4020, **one).registers == [42]
    assert not client.write_coil(1, True, **one).isError()
    assert not client.write_register(0, 500, **one).isError()
    assert not client.write_coils(2, [False, False], **one).isError()
    assert not client.write_registers(1, [501, 502], **one).isError()
    assert client.read_coils(0, count=4, **one).bits[:4] == [True, True, False, False]
    assert client.read_holding_registers(0, count=3, **one).registers == [500, 501, 502]
    assert client.read_holding_registers(2, count=2, **one).exception_code == 2
    assert client.mask_write_register(address=0, **one).exception_code == 1
    assert client.read_input_registers(0x4020, **one).registers == [42]


@pytest.mark.parametrize(("kind", "client"), [("tcp", ModbusTcpClient), ("udp", ModbusUdpClient)])
def test_pymodbus_reads_and_writes_everything_over_a_socket(kind, client):
    with serve({1: device()}, kind) as server:
        with opened(client("127.0.0.1", port=server.port, timeout=PATIENCE)) as master:
            ask_everything(master)
            assert master.read_coils(0, device_id=2).exception_code == 0x0B


def test_pymodbus_and_minimalmodbus_read_and_write_everything_over_a_serial_line(line):
    ours, theirs = line
    with serve({1: device(), 2: device(20)}, "rtu", serial_port=ours, line=LINE):
        with opened(ModbusSerialClient(theirs, baudrate=115200, timeout=PATIENCE)) as master:
            ask_everything(master)
        instrument = minimalmodbus.Instrument(theirs, 2)
        instrument.serial.baudrate, instrument.serial.timeout = 115200, PATIENCE
        try:
            assert instrument.read_registers(0, 3) == [20, 21, 22]
            assert instrument.read_bits(0, 4, functioncode=1) == [1, 0, 1, 1]
            instrument.write_register(1, 77, functioncode=6)
            instrument.write_registers(2, [78])
            instrument.write_bit(1, 1)
            assert instrument.read_registers(0, 3) == [20, 77, 78]
            assert instrument.read_bit(1, functioncode=1) == 1
            instrument.serial.timeout = 0.2  # it waits for a longer response than a refusal
            with pytest.raises(minimalmodbus.ModbusException):
                instrument.read_register(3)
            instrument.address = 3
            with pytest.raises(minimalmodbus.NoResponseError):
                instrument.read_register(0)
            instrument.address = 0
            instrument.write_register(0, 5, functioncode=6)
            instrument.serial.timeout = PATIENCE
            for unit in (1, 2):
                instrument.address = unit
                assert instrument.read_register(0) == 5
        finally:
            instrument.serial.close()


def test_the_bytes_on_the_line_are_those_of_our_encoders(line, monkeypatch):
    import serial

    monkeypatch.setattr(handlers, "_SILENCE", 10)
    ours, theirs = line
    devices = {k: Slave(device(10 * k)) for k in (1, 247)}
    with serve(devices, "rtu", serial_port=ours, line=LINE) as server:
        with serial.Serial(theirs, 115200, timeout=PATIENCE) as port:

            def ask(frame, size):
                port.write(frame)
                return port.read(size)

            for unit in devices:
                expected = rtu_frame(unit, response(10 * unit))
                assert ask(rtu_frame(unit, READ), len(expected)) == expected
            refused = rtu_frame(1, b"\xc1\x01")  # a function code that no library knows
            assert ask(rtu_frame(1, b"\x41\x00"), len(refused)) == refused
            (handler,) = server._listener.handlers
            port.write(rtu_frame(247, READ)[:3])
            wait_for(lambda: len(handler.received) == 3)
            expected = rtu_frame(247, response(2470))
            assert ask(rtu_frame(247, READ)[3:], len(expected)) == expected


@pytest.mark.parametrize(
    "noise", [b"\xff", rtu_frame(1, READ)[:5], rtu_frame(1, READ)[:-1] + b"\0", bytes(300)]
)
def test_noise_is_dropped_after_silence(line, noise):
    import serial

    expected = rtu_frame(1, response())
    with serve({1: device()}, "rtu", serial_port=line[0], line=LINE):
        with serial.Serial(line[1], 115200, timeout=0.2) as port:
            port.write(noise)
            assert is_silent(port)

            def answered():
                # Until the noise is dropped, a request is part of it.
                port.write(rtu_frame(1, READ))
                return port.read(len(expected)) == expected

            wait_for(answered)


def test_responses_in_tcp_and_udp_are_the_bytes_of_our_encoders():
    devices = {k: device(k) for k in (0, 1, 200, 247)}
    for kind, sort in (("tcp", socket.SOCK_STREAM), ("udp", socket.SOCK_DGRAM)):
        with serve(devices, kind) as server, raw(server, sort) as client:
            for number, unit in enumerate([0, 1, 200, 247]):
                client.send(tcp_frame(unit, READ, 65535 - number))
                expected = tcp_frame(unit, response(unit), 65535 - number)
                assert receive(client, len(expected)) == expected
            client.send(tcp_frame(255, READ, 0))
            assert receive(client, 13) == tcp_frame(255, response(0), 0)
            client.send(tcp_frame(248, b"\x41", 7))
            assert receive(client, 9) == tcp_frame(248, b"\xc1\x0b", 7)


def test_delayed_responses_keep_their_transaction_ids_and_their_addresses():
    slow = {1: Slave(device(1), delay=0.2), 2: device(2)}
    with serve(slow) as server, raw(server) as client:
        start = monotonic()
        client.send(tcp_frame(1, READ, 11) + tcp_frame(2, READ, 22) + b"\0\x21\0")
        assert receive(client, 13) == tcp_frame(2, response(2), 22)
        assert receive(client, 13) == tcp_frame(1, response(1), 11)
        assert monotonic() - start >= 0.2
        server.slaves[1].delay = 0.0
        client.send(tcp_frame(1, READ, 0x21)[3:])
        assert receive(client, 13) == tcp_frame(1, response(1), 0x21)
    with serve(slow | {1: Slave(device(1), delay=0.2)}, "udp") as server:
        with raw(server, socket.SOCK_DGRAM) as one, raw(server, socket.SOCK_DGRAM) as other:
            one.send(tcp_frame(1, READ, 1))
            other.send(tcp_frame(2, READ, 2))
            assert other.recv(300) == tcp_frame(2, response(2), 2)
            assert one.recv(300) == tcp_frame(1, response(1), 1)
            assert is_silent(other)


def test_a_late_response_is_taken_for_the_next_valve_if_ids_are_0_and_dropped_if_they_count():
    gate = Gate(100)
    with serve({1: gate, 2: device(200)}, "udp") as server:
        with raw(server, socket.SOCK_DGRAM) as master:
            # Like a master that relies on the order of the answers, with the header of kim2014.
            master.send(tcp_frame(1, READ, 0))
            assert is_silent(master)
            gate.open.set()
            assert not is_silent(master, PATIENCE)
            master.send(tcp_frame(2, READ, 0))
            assert master.recv(300)[8:] == response(100)[1:]  # valve 1's registers, not valve 2's
        gate.open.clear()
        client = ModbusUdpClient("127.0.0.1", port=server.port, timeout=0.1, retries=0)
        with opened(client) as master:
            with pytest.raises(ModbusIOException, match="No response"):
                master.read_holding_registers(0, count=2, device_id=1)
            gate.open.set()
            assert not is_silent(master.socket, PATIENCE)
            master.comm_params.timeout_connect = PATIENCE
            master.socket.settimeout(PATIENCE)
            found = master.read_holding_registers(0, count=2, device_id=2)
            assert found.registers == [200, 201]


def test_frames_of_another_protocol_are_skipped_and_an_impossible_length_ends_the_connection():
    with serve({1: device()}) as server:
        with raw(server) as client:
            client.send(bytes.fromhex("000100070003010300") + tcp_frame(1, READ, 2))
            assert receive(client, 13) == tcp_frame(1, response(), 2)
        for length in (0, 1, 255, 65535):
            with raw(server) as client:
                client.send(bytes(4) + length.to_bytes(2, "big") + b"\1\3\0\0\0\2")
                assert is_closed(client)


def test_a_client_that_never_reads_is_disconnected():
    ask = tcp_frame(1, Request.read_holding_registers(0, 125).pdu, 1) * 1000
    many = Slave(holding_registers=[0] * 125)
    # This does not depend on timing: 250 MB of answers are more than a system buffers.
    with serve({1: many}) as server, raw(server, timeout=None) as client, raw(server) as other:
        with pytest.raises(ConnectionError):  # noqa: PT012 # one of many calls is cut off
            for _ in range(1000):
                client.sendall(ask)
        other.send(tcp_frame(1, Request.read_holding_registers(0, 1).pdu, 2))
        assert len(receive(other, 11)) == 11


def test_clients_take_turns_with_one_that_sends_as_fast_as_it_can():
    fcntl, termios = pytest.importorskip("fcntl"), pytest.importorskip("termios")
    book, gate = [], Gate()
    devices = {1: journal(1, book), 2: journal(2, book), 3: gate}
    with serve(devices) as server, raw(server) as many, raw(server) as few, raw(server) as third:
        for client in (many, few, third):  # all three are accepted
            client.send(tcp_frame(1, READ, 1))
            assert len(receive(client, 13)) == 13
        ends = {
            one.transport.get_extra_info("peername"): one.transport.get_extra_info("socket")
            for one in server._listener.handlers
        }

        def waiting(client):
            end, count = ends[client.getsockname()], bytearray(4)
            fcntl.ioctl(end.fileno(), termios.FIONREAD, count)
            return int.from_bytes(count, sys.byteorder)

        book.clear()
        third.send(tcp_frame(3, READ, 1))
        wait_for(lambda: gate.reads)  # the server stands still while the others send
        for client, unit, number in ((many, 1, 2000), (few, 2, 20)):
            client.sendall(tcp_frame(unit, READ, 1) * number)
            wait_for(lambda c=client, n=number: waiting(c) == 12 * n)
        gate.open.set()
        assert len(receive(few, 20 * 13)) == 20 * 13
        assert len(receive(many, 2000 * 13)) == 2000 * 13
    # Every turn answers four requests of each client: the 20 take five turns.
    assert [k for k, unit in enumerate(book) if unit == 2][-1] < 20 + 6 * 4
    assert (book.count(1), book.count(2)) == (2000, 20)


@pytest.mark.parametrize("kind", ["tcp", "udp"])
def test_the_number_of_delayed_responses_per_client_is_limited(kind):
    book = []
    slow = Slave(journal(1, book), delay=3600)
    sort = {"tcp": socket.SOCK_STREAM, "udp": socket.SOCK_DGRAM}[kind]
    with serve({1: slow, 2: device()}, kind) as server:
        with raw(server, sort) as client, raw(server, sort) as other:
            while len(book) < 256:
                client.send(tcp_frame(1, READ, 1))
                sleep(1e-4)  # the system drops datagrams that come too fast
            for _ in range(100):
                client.send(tcp_frame(2, READ, 1))
            assert is_silent(client)
            for _ in range(3):
                other.send(tcp_frame(2, READ, 1))
                assert len(receive(other, 13)) == 13
    assert len(book) == 256


def test_a_client_without_requests_is_disconnected_but_not_while_its_response_is_delayed(
    monkeypatch,
):
    monkeypatch.setattr(handlers, "_IDLE", 0.05)
    devices = {1: Slave(device(), delay=0.3)}
    with serve(devices) as server:
        with raw(server) as silent:
            assert is_closed(silent)

        def answered():
            with raw(server) as client:
                return is_answered(client) and is_closed(client)

        wait_for(answered)  # a slow machine may take longer than the limit to send


def is_answered(client):
    try:
        client.send(tcp_frame(1, READ, 1))
        return receive(client, 13) == tcp_frame(1, response(), 1)
    except ConnectionError:
        return False


def test_one_busy_client_too_many_is_refused_and_counted(caplog, monkeypatch):
    monkeypatch.setattr(handlers, "_CLIENTS", 2)
    with serve({1: device()}) as server, raw(server) as one:
        with raw(server) as two:
            assert is_answered(one) and is_answered(two)
            for _ in range(3):
                with raw(server) as three:
                    assert not is_answered(three)
            assert is_answered(one) and is_answered(two)

        def returned():
            with raw(server) as four:
                return is_answered(four)

        wait_for(returned)
        refused = server._listener.refused
    first, total = caplog.messages
    assert first == "connections are refused: 2 clients are connected"
    assert total == f"connections refused in all: {refused}" and refused >= 3


def test_a_new_client_replaces_the_one_that_is_silent_longest(monkeypatch):
    monkeypatch.setattr(handlers, "_CLIENTS", 8)
    with serve({1: device()}) as server, raw(server) as good, ExitStack() as stack:
        assert is_answered(good)
        idle = [stack.enter_context(raw(server)) for _ in range(40)]
        wait_for(lambda: len(server._listener.handlers) == 8)
        assert is_answered(good)  # it has sent a request, so it stays
        with raw(server) as newcomer:
            assert is_answered(newcomer) and is_answered(good)
        assert is_closed(idle[0]) and is_answered(idle[-1])
        assert server._listener.refused == 0
        monkeypatch.setattr(handlers, "_REPLACED", 0.0)
        for _ in range(8):
            assert is_answered(stack.enter_context(raw(server)))
        assert is_closed(good)


def test_connected_clients_are_answered_at_the_limit_of_file_descriptors():
    pytest.importorskip("resource")
    program = """
import resource, sys
from shipnet.modbus import Slave, serve
with serve({1: Slave(holding_registers=[10, 11])}) as server:
    resource.setrlimit(resource.RLIMIT_NOFILE, (40, 40))
    print(server.port, flush=True)
    sys.stdin.read()
"""
    command = [sys.executable, "-c", program]
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.DEVNULL}
    with subprocess.Popen(command, text=True, **pipes) as server:
        server.port = int(server.stdout.readline())
        with ExitStack() as stack:
            clients = [stack.enter_context(raw(server)) for _ in range(60)]
            assert all(is_answered(client) for client in clients[:20])
            assert all(is_answered(client) for client in clients[:20])
            clients[-1].settimeout(0.2)
            with pytest.raises(TimeoutError):
                is_answered(clients[-1])
        with raw(server) as client:
            assert is_answered(client)
        server.stdin.close()


@pytest.fixture(scope="module")
def hosts():
    with serve({1: device()}) as tcp, serve({1: device()}, "udp") as udp:
        yield tcp, udp


FRAMES = st.one_of(
    st.binary(min_size=1, max_size=600),
    st.builds(tcp_frame, st.integers(0, 255), st.binary(min_size=1, max_size=20), st.just(5)),
    st.builds(
        lambda length, rest: b"\0\1\0\0" + length.to_bytes(2, "big") + rest,
        st.integers(0, 65535),
        st.binary(max_size=300),
    ),
)


@settings(max_examples=40)
@given(frames=st.lists(FRAMES, min_size=1, max_size=4))
def test_no_bytes_of_one_client_keep_another_from_its_response(hosts, frames):
    for server, kind in zip(hosts, (socket.SOCK_STREAM, socket.SOCK_DGRAM), strict=True):
        with raw(server, kind) as hostile, raw(server, kind) as client:
            with suppress(ConnectionError):
                for frame in frames:
                    hostile.send(frame)
            client.send(tcp_frame(1, Request.read_input_registers(0x4020, 1).pdu, 9))
            assert receive(client, 11) == tcp_frame(1, b"\x04\x02\x00\x2a", 9)


def test_devices_get_the_time_of_the_given_clock():
    times = iter([5.0, 3600.0])
    watch = Readable(lambda quantity, time: [int(time)])
    asked = Request.read_holding_registers(0, 1).pdu
    with serve({1: watch}, clock=lambda: next(times)) as server, raw(server) as client:
        for shown in (5, 3600):
            client.send(tcp_frame(1, asked, 1))
            assert receive(client, 11)[-2:] == shown.to_bytes(2, "big")
    seen = []
    timed = Readable(lambda quantity, time: seen.append(time) or [0])
    with serve({1: timed}, speed=1e5) as server, raw(server) as client:
        for _ in range(2):
            client.send(tcp_frame(1, asked, 1))
            assert receive(client, 11)
    assert 0 < seen[0] < seen[1]


def test_everything_is_closed_at_the_end_even_with_responses_outstanding():
    before = threading.active_count()
    server = serve({1: Slave(device(), delay=60)})
    with server:
        assert threading.active_count() == before + 1
        with pytest.raises(RuntimeError, match="already listening"):
            server.__enter__()
        with raw(server) as client, raw(server) as idle:
            client.send(tcp_frame(1, READ, 1))
            port = server.port
            assert is_silent(client, 0.05)
            server.__exit__()
            for connection in (client, idle):
                assert is_closed(connection)
            assert server.port == 0 and threading.active_count() == before
            with pytest.raises(ConnectionRefusedError):
                socket.create_connection(("127.0.0.1", port), 1)
            server.__enter__()  # and it may listen again


def test_unsent_responses_do_not_keep_the_server_from_stopping():
    ask = tcp_frame(1, Request.read_holding_registers(0, 125).pdu, 1) * 20
    before = threading.active_count()
    with serve({1: Slave(holding_registers=[0] * 125)}) as server, raw(server) as client:
        (connection,) = wait_for(lambda: list(server._listener.handlers))
        transport = connection.transport
        # The system must buffer little of what is unsent, so that the server has to.
        client.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        transport.get_extra_info("socket").setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 4096)

        def unsent():
            client.sendall(ask)
            sleep(0.02)
            return transport.get_write_buffer_size()

        wait_for(unsent)
        server.__exit__()
        assert threading.active_count() == before
        with suppress(ConnectionError):
            while client.recv(1 << 16):  # what the system held; then comes the end
                pass


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"port": "taken"}, r"127\.0\.0\.1, port \d+: port in use"),
        ({"port": "taken", "transport": "udp"}, r"127\.0\.0\.1, port \d+: port in use"),
        ({"host": "256.1.1.1"}, r"256\.1\.1\.1, port 0: unknown host"),
        ({"host": "a..b"}, r"a\.\.b, port 0: unknown host"),
        ({"host": "192.0.2.1"}, r"192\.0\.2\.1, port 0: this machine does not have that address"),
        ({"serial_port": "missing"}, "missing: no such device"),
        ({"serial_port": ""}, "not a tty"),
        ({"serial_port": "file"}, "file: not a tty"),
    ],
)
def test_an_error_on_entry_names_its_cause(options, message, tmp_path):
    (tmp_path / "file").touch()
    before = threading.active_count()
    kind = options.get("transport", "tcp")
    with serve({1: device()}, kind) as server:
        if "port" in options:
            options = {**options, "port": server.port}
        if "serial_port" in options:
            pytest.importorskip("termios")
            place = str(tmp_path / options["serial_port"])
            options = {"transport": "rtu", "serial_port": place}
        with pytest.raises(OSError, match=f"cannot listen on .*{message}"):
            with serve({1: device()}, **options):
                pass
    assert threading.active_count() == before


@pytest.mark.parametrize(
    ("problem", "kind", "message"),
    [
        (PermissionError(13, "Permission denied"), "tcp", "not permitted; ports below 1024"),
        (PermissionError(13, "Permission denied"), "rtu", "not permitted; .* dialout"),
        (OSError(11, "Could not exclusively lock port"), "rtu", "in use by another program"),
        (OSError(5, "Input/output error"), "rtu", "Input/output error"),
    ],
)
def test_a_refusal_of_the_system_is_named(problem, kind, message, monkeypatch):
    async def listen(self):
        raise problem

    for name in ("TcpListener", "RtuListener"):
        monkeypatch.setattr(f"shipnet.modbus.handlers.{name}.listen", listen)
    with pytest.raises(OSError, match=f"cannot listen on .*{message}"):
        with serve({1: device()}, kind, serial_port="x" if kind == "rtu" else ""):
            pass


@pytest.mark.skipif(sys.platform != "linux", reason="other systems may have such a parity")
def test_a_pseudo_terminal_has_no_parity_whatever_its_settings_were_before(line, caplog):
    before = threading.active_count()
    for rate in (9600, 9600, 19200):
        with pytest.raises(OSError, match=f"cannot listen on {line[0]}: .* not support 8E1"):
            with serve({1: device()}, "rtu", serial_port=line[0], line=SerialLine(rate, "8E1")):
                pass
    assert threading.active_count() == before and not caplog.messages


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: serve({248: device()}), r"unit id is 248.*0\.\.247"),
        (lambda: serve({-1: device()}), "unit id is -1"),
        (lambda: serve({True: device()}), "unit id is True"),
        (lambda: serve({0: device()}, "rtu"), r"unit id is 0.*1\.\.247 on a serial line"),
        (lambda: serve({}), "devices is empty"),
        (lambda: serve({1: device()}, "tls"), "transport is 'tls'"),
        (lambda: serve({1: device()}, "rtu"), "serial_port is ''"),
        (lambda: serve({1: device()}, serial_port="x"), "only for RTU"),
        (lambda: serve({1: device()}, port=65536), "port is 65536"),
        (lambda: serve({1: device()}, host=""), "host is ''"),
        (lambda: serve({1: device()}, speed=-1), "speed is -1"),
    ],
)
def test_arguments_out_of_range_are_named(make, message):
    with pytest.raises(ArgumentError, match=message):
        make()


@pytest.mark.parametrize(("module", "package"), [("pymodbus", "pymodbus"), ("serial", "pyserial")])
def test_a_missing_library_is_named_with_the_command_that_installs_it(module, package):
    program = (
        f"import sys; sys.modules[{module!r}] = None\n"
        "from shipnet.modbus import Slave, serve\n"
        "try: serve({1: Slave()}, 'rtu', serial_port='x')\n"
        "except ImportError as problem: print(problem)"
    )
    printed = subprocess.check_output([sys.executable, "-c", program], text=True)
    assert printed.startswith(f"{package} is not installed")
    assert printed.endswith(f"python -m pip install {package}\n")


def test_the_reprs_of_slaves_and_servers_are_one_line():
    box = Slave(holding_registers=[1, 2], exception=6, silent=True)
    assert repr(box) == "Slave(Registers, delay 0 s, exception SERVER_DEVICE_BUSY, silent)"
    server = serve({1: box, 2: box})
    assert repr(server) == "Server(2 slaves, does not listen)"
    with server:
        assert repr(server) == f"Server(2 slaves, listens on port {server.port})"
