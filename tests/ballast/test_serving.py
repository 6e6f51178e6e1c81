"""Valves behind a real server, polled by third-party clients."""

import os
import re
import signal
from contextlib import contextmanager

import pytest
from pymodbus.client import ModbusTcpClient, ModbusUdpClient

from shipnet.__main__ import main
from shipnet.ballast.live import serve
from shipnet.ballast.plant import Fault
from shipnet.ballast.registers import RegisterMap
from shipnet.errors import ArgumentError
from shipnet.modbus.uart import SerialLine
from tests.support import require, running

OPEN, CLOSE, HALF = 8, 4, 50 << 8 | 10
CLIENTS = {"tcp": ModbusTcpClient, "udp": ModbusUdpClient}


@contextmanager
def connected(kind, port):
    client = CLIENTS[kind]("127.0.0.1", port=port, timeout=60)
    assert client.connect()
    try:
        yield client
    finally:
        client.close()


def status(client, unit):
    registers = client.read_input_registers(0x4020, count=4, device_id=unit).registers
    return RegisterMap().decode([registers])


def test_a_server_with_a_test_clock_moves_the_valve_in_simulated_time(monkeypatch):
    now = [0.0]
    monkeypatch.setattr("shipnet.ballast.live.real_clock", lambda factor: lambda: now[0])
    with serve(3) as server, connected("tcp", server.port) as client:
        plant = server.slaves[1].device.plant
        assert client.write_register(0x4001, OPEN, device_id=2).registers == [OPEN]
        places = []
        for now[0] in (0.0, 3.0, 6.0, 12.0):
            seen = status(client, 2)
            places.append(seen.readings[4, 0])
            assert abs(seen.readings[4, 0] - 100 * plant.opening[1]) <= 0.55
            assert seen.readings[:4, 0] == pytest.approx(plant.readings[:4, 1], abs=0.55)
        # 11.1 % per second, sent as whole percent.
        assert places == [0, 33, 67, 100]
        assert plant.opening.tolist() == [0, 1, 0]
        assert client.write_register(0x4001, HALF, device_id=2).registers == [HALF]
        now[0] = 30.0
        assert status(client, 2).readings[4, 0] == 50


@pytest.mark.parametrize("kind", CLIENTS)
def test_a_valve_opens_and_closes_in_real_time_for_pymodbus(kind):
    with serve(4, speed=1000, transport=kind) as server:
        with connected(kind, server.port) as client:
            for command, end, way in ((OPEN, 100, "open"), (CLOSE, 0, "close")):
                assert client.write_register(0x4001, command, device_id=4).registers == [command]
                for _ in range(1000):
                    seen = status(client, 4)
                    if seen.readings[4, 0] == end:
                        break
                assert seen.readings[4, 0] == end
                assert getattr(seen, way)[0]
            assert status(client, 3).readings[4, 0] == 0
            assert client.read_holding_registers(0x4001, device_id=4).exception_code == 1
            assert client.write_register(0x4001, 7, device_id=4).exception_code == 3


def test_the_valves_are_served_on_a_serial_line():
    require("pty", hasattr(os, "openpty"), "there are no pseudo-terminals")
    ours, theirs = os.openpty()
    name, line = os.ttyname(theirs), SerialLine(115200, "8N1")
    try:
        server = serve(2, speed=1000, transport="rtu", serial_port=name, line=line)
        with server, os.fdopen(os.dup(ours), "r+b", buffering=0) as port:
            port.write(bytes.fromhex("02 06 40 01 00 08 cc 3f"))
            assert read(port, 8).hex(" ") == "02 06 40 01 00 08 cc 3f"
    finally:
        os.close(ours)
        os.close(theirs)


def read(port, size):
    got = b""
    while len(got) < size:
        got += port.read(size - len(got))
    return got


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "it must be VALVE:CODE"),
        ("3", "it must be VALVE:CODE"),
        ("x:V1", "it must be VALVE:CODE"),
        ("3:V1:much", "it must be VALVE:CODE"),
        ("3:V1:1:1", "it must be VALVE:CODE"),
        ("3:v1", "code is 'v1'"),
        ("0:V1", "valve is 0; it must be a whole number 1..64"),
        ("65:V1", "valve is 65; it must be a whole number 1..64"),
        ("3:V1:1.5", "severity is 1.5; it must be 0..1"),
        ("3:V1:nan", "severity is nan"),
    ],
)
def test_a_wrong_fault_is_reported_in_one_line(text, message, capsys):
    assert main(["serve", "ballast", "--port", "0", "--fault", text]) == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--valves", "0"], "--valves is 0; it must be a whole number 1..247"),
        (["--valves", "248"], "--valves is 248; it must be a whole number 1..247"),
        (["--speed", "-1"], "--speed is -1"),
        (["--watchdog", "0"], "--watchdog is 0"),
        (["--port", "65536"], "--port is 65536"),
        (["--bit-rate", "1"], "--bit-rate is 1 bit/s; it must be 300..1e+07"),
        (["--udp", "--serial", "line"], "cannot be combined"),
        (["--serial", "line", "--character", "7E1"], "character is '7E1'"),
        (["--serial", "no-such-line"], "cannot listen on no-such-line: no such device"),
        (["--host", "256.1.1.1"], "cannot listen on 256.1.1.1, port 0: unknown host"),
    ],
)
def test_a_wrong_option_is_reported_in_one_line(arguments, message, capsys):
    assert main(["serve", "ballast", "--port", "0", *arguments]) == 2
    error = capsys.readouterr().err
    assert message in error


def test_a_fault_is_parsed_with_and_without_its_severity():
    assert Fault.parse("7:P2:0.5") == Fault("P2", 0.5, valves=7)
    assert Fault.parse("1:O1") == Fault("O1", 1.0, valves=1)
    with pytest.raises(ArgumentError, match="valves is 3"):
        serve(2, faults=[Fault("V1", valves=3)])


@pytest.mark.parametrize(
    ("device", "host", "warned"),
    [
        ("ballast", "0.0.0.0", True),
        ("engine", "0.0.0.0", True),
        ("ballast", "localhost", False),
    ],
)
def test_the_program_warns_that_the_network_can_operate_the_devices(device, host, warned):
    with running("serve", device, "--port", "0", "--host", host) as program:
        assert program.stdout.readline().startswith(f"listening on {host}, port ")
        if warned:
            warning = "Anybody on the network can now operate the simulated devices.\n"
            assert program.stdout.readline() == warning
        program.send_signal(signal.SIGINT)
        assert program.communicate(timeout=60) == ("stopped\n", "")


@pytest.mark.parametrize("options", [[], ["--udp"]])
def test_the_program_says_where_it_listens_and_stops_upon_an_interrupt(options):
    arguments = ["--port", "0", "--valves", "3", "--fault", "2:S1", "--speed", "100", *options]
    kind = "udp" if options else "tcp"
    with running("serve", "ballast", *arguments) as program:
        said = program.stdout.readline()
        port = int(
            re.fullmatch(rf"listening on 127.0.0.1, port (\d+) \({kind.upper()}\): .*\n", said)[1]
        )
        with connected(kind, port) as client:
            assert [status(client, unit).readings[4, 0] for unit in (1, 2)] == [0, 5]
        program.send_signal(signal.SIGINT)
        out, error = program.communicate(timeout=60)
        assert (program.returncode, out, error) == (0, "stopped\n", "")


def test_an_engine_has_no_watchdog_of_a_valve(capsys):
    assert main(["serve", "engine", "--port", "0", "--watchdog", "2"]) == 2
    assert "--watchdog applies to ballast only" in capsys.readouterr().err
