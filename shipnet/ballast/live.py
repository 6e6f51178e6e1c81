"""Valves that can be talked to: a test bed in simulated time, its acceptance tests, real servers.

The test bed is that of Figure 15: a PC, the master and five slaves on a loop; S3 fills a tank, S5
has the fault simulator. The plant is ours; what the real test bed measured is not printed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from math import cos, pi
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from shipnet.ballast.diagnosis import diagnose_run
from shipnet.ballast.master import Station, received_run
from shipnet.ballast.plant import Plant
from shipnet.ballast.registers import COMMAND_REGISTER, FIRST_REGISTER, N_REGISTERS, Code
from shipnet.ballast.scan import status_poll
from shipnet.ballast.simulation import Recorder
from shipnet.ballast.slave import ValveDevice, valve_slaves
from shipnet.ballast.valve_faults import FAULTS, Fault
from shipnet.errors import ArgumentError
from shipnet.fields import check_scalar, check_whole
from shipnet.fuzzy.rules import NORMAL, RuleBase
from shipnet.modbus.adu import MAX_UNIT, decode, tcp_frame
from shipnet.modbus.pdu import ExceptionCode, Request
from shipnet.modbus.redundancy import Loop
from shipnet.modbus.server import Server, real_clock, serve
from shipnet.modbus.slave import DeviceError, Slave, Table, answer
from shipnet.modbus.uart import SerialLine

if TYPE_CHECKING:
    import pandas as pd


class _Image:
    """A valve as the master knows it."""

    def __init__(self, station: Station, unit: int) -> None:
        self.station, self.unit = station, unit

    def read(self, table: Table, address: int, quantity: int, time: float) -> Sequence[int]:
        """Return registers of the status that came last; exception 11 before the first."""
        first = address - FIRST_REGISTER
        if table != "input_registers" or not 0 <= first <= N_REGISTERS - quantity:
            raise DeviceError(ExceptionCode.ILLEGAL_DATA_ADDRESS)
        for status in reversed(self.station.shown):
            if status.unit == self.unit:
                return status.registers[first : first + quantity]
        raise DeviceError(ExceptionCode.GATEWAY_TARGET_FAILED_TO_RESPOND)

    def write(self, table: Table, address: int, values: Sequence[int], time: float) -> None:
        """Send a command on to the slave, and its exception back."""
        if table != "holding_registers" or address != COMMAND_REGISTER or len(values) != 1:
            raise DeviceError(ExceptionCode.ILLEGAL_DATA_ADDRESS)
        response = self.station.write(values[0], self.unit).response
        if not response:
            raise DeviceError(ExceptionCode.GATEWAY_TARGET_FAILED_TO_RESPOND)
        if response[0] & 0x80:
            raise DeviceError(response[1])


class Gateway:
    """What the master answers a PC.

    Section 3.5 of the paper: the PC watches a slave and commands it through the master. Whether
    the master answers from memory or asks the slave is not printed; here it answers at once, for a
    scan keeps the line busy.
    """

    def __init__(self, station: Station) -> None:
        self.station = station
        self.slaves = {
            unit: Slave(_Image(station, unit), functions={4, 6}) for unit in station.slaves
        }

    def answer(self, adu: bytes) -> bytes:
        """Return the answer to a frame."""
        request = decode(adu, "tcp")
        if request.unit_id == 0:
            return b""
        pdu = answer(self.slaves, request, self.station.time).pdu
        return tcp_frame(request.unit_id, pdu, request.transaction_id or 0) if pdu else b""


@dataclass
class Tank:
    """A tank whose level follows from the opening of its valve."""

    area: float = 0.2
    flow: float = 0.01
    level: float = 0.0

    def __post_init__(self) -> None:
        """Check every field."""
        self.area = check_scalar("area", self.area, "m2", 1e-3, 1e5)
        self.flow = check_scalar("flow", self.flow, "m3/s", 0, 100)
        self.level = check_scalar("level", self.level, "m", 0, 100)

    def fill(self, opening: float, duration: float) -> None:
        """Let water in."""
        x = check_scalar("opening", opening, "", 0, 1)
        lasted = check_scalar("duration", duration, "s", 0, 1e6)
        self.level += self.flow * (1 - cos(pi * x / 2)) * lasted / self.area


#: Slaves of Figure 15; that with the tank, and that with the fault simulator.
N_SLAVES, _TANK, _SIMULATOR = 5, 3, 5


#: A healthy valve opens or closes within this; row 0 of the rule table [s].
_STROKE = 10.0


#: How long a valve is watched after its stroke [s], and the tolerance of a position [%].
_SETTLE, _NEAR = 5.0, 1.5


#: Faults that show at the closed end: the valve is open, and closes.
_CLOSING = ("S2", "Pos2", "Pos4")


#: Kinds of test, in the order of section 4.
TESTS = ("manual", "remote", "PC", "diagnosis")


class Step(NamedTuple):
    """A step of a test."""

    test: str
    step: str
    expected: str
    found: str
    passed: bool


class TestBed:
    """Five valves, their line, the master, the gateway to the PC, and the tank on S3.

    Parameters
    ----------
    rng : numpy.random.Generator, optional
        Draws the noise of the sensors; there is none if omitted.
    fault : str, optional
        Code of the rule table: what the simulator on S5 imitates; nothing if omitted.
    opening : float, default 0
        Where all valves stand at first, 0..1.
    serial : SerialLine, default 9600 bit/s and 8E1
        Settings of the line; the paper prints 2400 to 115200 bit/s.

    Examples
    --------
    >>> bed = TestBed()
    >>> bed.station.command("open", 3).outcome
    'done'
    >>> bed.wait(12.0)
    >>> bed.position(3), round(bed.tank.level, 3)
    (100.0, 0.313)
    """

    # pytest takes a class of this name for one of tests.
    __test__ = False

    def __init__(
        self,
        rng: np.random.Generator | None = None,
        *,
        fault: str | None = None,
        opening: float = 0.0,
        serial: SerialLine | None = None,
    ) -> None:
        faults = [] if fault is None else [Fault(fault, valves=_SIMULATOR - 1)]
        self.plant = Plant(n_valves=N_SLAVES, faults=faults, opening=opening, rng=rng)
        line = serial if serial is not None else SerialLine(9600)
        self.station = Station(self.plant, Loop(N_SLAVES, status_poll(line)))
        self.gateway, self.recorder = Gateway(self.station), Recorder(self.plant)
        self.tank = Tank()

    @property
    def time(self) -> float:
        """Time of the master [s]."""
        return self.station.time

    def device(self, unit: int) -> ValveDevice:
        """Return a slave, for its switches."""
        device = self.station.slaves[unit].device
        if not isinstance(device, ValveDevice):
            raise ArgumentError(f"unit {unit} is no valve")
        return device

    def wait(self, duration: float) -> None:
        """Let time pass [s]: the master scans, the tank fills, the sensors are recorded."""
        end, plant = self.time + duration, self.plant
        while self.time < end:
            self.recorder.take()
            before, since = plant.opening[_TANK - 1], plant.time
            self.station.run_until(min(self.time + plant.step, end))
            now = plant.opening[_TANK - 1]
            self.tank.fill((before + now) / 2, plant.time - since)
        self.recorder.take()

    def position(self, unit: int) -> float:
        """Return the position that the master shows of a valve [%]."""
        return float(self.station.seen.screen().position_percent[unit])


def acceptance(
    rng: np.random.Generator | None = None,
    *,
    diagnosed_by: str = "slave",
    tests: Iterable[str] = TESTS,
    serial: SerialLine | None = None,
) -> pd.DataFrame:
    """Carry out the four tests of section 4, each on a new test bed.

    Parameters
    ----------
    rng : numpy.random.Generator, optional
        Draws the noise of the sensors; there is none if omitted.
    diagnosed_by : {"slave", "master"}, default "slave"
        Who applies the rules: the slave, to its own readings ten times a second, or the master, to
        what the registers brought it once a scan.
    tests : iterable of str, optional
        Which of `TESTS`; all if omitted.
    serial : SerialLine, optional
        Settings of the line, as for `TestBed`.

    Returns
    -------
    pandas.DataFrame
        One row a step: fields of `Step`.

    Raises
    ------
    ArgumentError
        If nobody, or no test, is called so.

    Notes
    -----
    The paper prints that all tests were passed, but neither steps nor criteria; these are ours. A
    fault is found when its code is among those active after the command, for the rules are nested:
    where S1 fires, Pos3 does. The slave's status has room for one of them, the first in rank; it
    passes if its row is that of the fault, or of a rule that implies it. The faults are made to fit
    the rules, so that this verifies code and validates no method. The master misses what the
    position byte cannot carry: below 0 %.

    Examples
    --------
    >>> table = acceptance(np.random.default_rng(2024), tests=["PC"])
    >>> table.iloc[-1][["step", "found"]].tolist(), int(table.passed.sum())
    (['tank of S3 after closing', 'rose, then held'], 11)
    """
    import pandas as pd

    if diagnosed_by not in ("slave", "master"):
        raise ArgumentError(f"diagnosed_by is {diagnosed_by!r}; it must be 'slave' or 'master'")
    chosen = list(tests)
    strange = [repr(test) for test in chosen if test not in TESTS]
    if strange:
        raise ArgumentError(f"tests has {', '.join(strange)}; there are {', '.join(TESTS)}")
    steps, make = [], partial(TestBed, rng, serial=serial)
    for test in chosen:
        match test:
            case "manual":
                steps += _manual(make)
            case "remote":
                steps += _remote(make)
            case "PC":
                steps += _pc(make)
            case _:
                for code in (None, *FAULTS):
                    steps += _diagnosis(make, code, diagnosed_by)
    return pd.DataFrame(steps, columns=list(Step._fields))


def _manual(make: Callable[..., TestBed]) -> list[Step]:
    """Move every valve by its switches, while commands of the master are refused."""
    bed, steps = make(), []
    for unit in range(1, N_SLAVES + 1):
        device = bed.device(unit)
        device.local = True
        device.turn("open", bed.time)
        bed.wait(_STROKE + _SETTLE / 2)
        steps.append(_at("manual", f"S{unit} switched to open", bed.position(unit), 100))
        refused = bed.station.command("close", unit).outcome
        steps.append(
            _same("manual", f"S{unit} closed by the master", "server device failure", refused)
        )
        device.turn("close", bed.time)
        bed.wait(_STROKE / 2)
        device.turn("stop", bed.time)
        bed.wait(_SETTLE / 2)
        held = bed.position(unit)
        bed.wait(_SETTLE)
        steps.append(_at("manual", f"S{unit} stopped on its way", bed.position(unit), held))
        device.turn("close", bed.time)
        bed.wait(_STROKE)
        steps.append(_at("manual", f"S{unit} switched to close", bed.position(unit), 0))
    return steps


def _remote(make: Callable[..., TestBed]) -> list[Step]:
    """Open, set and close every valve from the master."""
    bed, steps = make(), []
    for unit in range(1, N_SLAVES + 1):
        echo = bed.station.command("open", unit).outcome
        steps.append(_same("remote", f"S{unit} told to open", "done", echo))
        for action, target in (("open", 100.0), ("position", 40.0), ("close", 0.0)):
            if action != "open":
                bed.station.command(action, unit, target if action == "position" else None)
            bed.wait(_STROKE)
            steps.append(_at("remote", f"S{unit} {action}", bed.position(unit), target))
    return steps


def _pc(make: Callable[..., TestBed]) -> list[Step]:
    """Command every valve from the PC, in frames of Modbus/TCP, and fill the tank."""
    bed, steps = make(), []
    registers = bed.station.registers

    def frame(unit: int, code: Code | None = None) -> bytes:
        """Return a command, or a query for the status, as the PC sends it."""
        query = Request.read_input_registers(FIRST_REGISTER, N_REGISTERS)
        write = (
            None
            if code is None
            else Request.write_single_register(COMMAND_REGISTER, registers.command(code))
        )
        return tcp_frame(unit, (write or query).pdu, unit)

    for unit in range(1, N_SLAVES + 1):
        sent = frame(unit, Code.OPEN)
        echo = bed.gateway.answer(sent)
        steps.append(_same("PC", f"S{unit} told to open", sent.hex(), echo.hex()))
        bed.wait(_STROKE)
        shown = float(bed.gateway.answer(frame(unit))[9])
        steps.append(_at("PC", f"S{unit} open", shown, 100))
    level = bed.tank.level
    bed.gateway.answer(frame(_TANK, Code.CLOSE))
    bed.wait(_STROKE + _SETTLE)
    full = bed.tank.level
    bed.wait(_SETTLE)
    found = f"{'rose' if full > level > 0 else 'did not rise'}, " + (
        "then held" if bed.tank.level == full else "then did not hold"
    )
    steps.append(_same("PC", "tank of S3 after closing", "rose, then held", found))
    return steps


def _diagnosis(make: Callable[..., TestBed], code: str | None, by: str) -> list[Step]:
    """Let the simulator imitate a fault, move the valve, and see what is reported."""
    closing = code in _CLOSING
    bed = make(fault=code, opening=float(closing))
    bed.wait(1.0)
    bed.station.command("close" if closing else "open", _SIMULATOR)
    # A valve that does not arrive runs until its motor time is over.
    while bed.plant.running.any():
        bed.wait(1.0)
    bed.wait(_SETTLE)
    if by == "slave":
        run, valve = bed.recorder.run, _SIMULATOR - 1
    else:
        run = received_run(bed.station.seen, _SIMULATOR, target=0.0 if closing else 100.0)
        valve = 0
    diagnosis = diagnose_run(run)
    base = diagnosis.base
    active = diagnosis.active[:, valve]
    found = [name for name in base.ranking if active[:, base.codes.index(name)].any()]
    expected = code or NORMAL
    said = " ".join(found) or NORMAL
    step = f"{FAULTS[code][0]} ({code})" if code else "nothing wrong"
    steps = [Step("diagnosis", step, expected, said, expected in said.split())]
    if by == "master":
        return steps
    # The slave finds it by itself, and reports the row of the table in its status.
    seen = bed.station.seen.screen().loc[_SIMULATOR]
    shown = f"fault {seen['fault']}" if seen["state"] == "fault" else str(seen["state"])
    right = [f"fault {row}" for row in _rows(base, code)] if code else ["open"]
    step = f"screen with {code or 'nothing wrong'}"
    return [*steps, Step("diagnosis", step, " or ".join(right), shown, shown in right)]


def _rows(base: RuleBase, code: str) -> list[int]:
    """Return the row of a code, then those of the rules that cannot fire without its own."""
    own = set(base.rule(code).antecedent)
    rows = [row for row, rule in enumerate(base.rules, 1) if own <= set(rule.antecedent)]
    return sorted(rows, key=lambda row: base.codes[row - 1] != code)


def _same(test: str, step: str, expected: str, found: str) -> Step:
    return Step(test, step, expected, found, expected == found)


def _at(test: str, step: str, position: float, target: float) -> Step:
    near = abs(position - target) <= _NEAR
    return Step(test, step, f"{target:g} %", f"{position:g} %", near)


def parse_fault(text: str, n_valves: int = MAX_UNIT) -> Fault:
    """Return the fault that a text such as ``3:V1:0.8`` names."""
    parts = text.split(":")
    try:
        if len(parts) not in (2, 3):
            raise ValueError
        unit, severity = int(parts[0]), float(parts[2]) if parts[2:] else 1.0
    except ValueError:
        raise ArgumentError(
            f"fault is {text!r}; it must be VALVE:CODE or VALVE:CODE:SEVERITY, such as 3:V1:0.8"
        ) from None
    try:
        valve = check_whole("valve", unit, 1, n_valves)
        return Fault(parts[1], severity, valves=valve - 1)
    except ArgumentError as error:
        raise ArgumentError(f"fault {text!r}: {error}") from None


def valve_server(
    n_valves: int = 64,
    *,
    faults: Iterable[Fault] = (),
    speed: float = 1.0,
    rng: np.random.Generator | None = None,
    watchdog: float | None = None,
    **options: Any,
) -> Server:
    """Return a server for the valves of a new plant, all closed, to be used in ``with``.

    Parameters
    ----------
    n_valves : int, default 64
        Number of valves, 1..247.
    faults : iterable of Fault, optional
        What is wrong with them, by model time.
    speed : float, default 1
        Seconds of the valves in a real one, 0..1e4.
    rng : numpy.random.Generator, optional
        Draws the noise of the sensors; there is none if omitted.
    watchdog : float, optional
        A motor stops when its valve has had no request for so long, 0.1..3600 [s] of the valves;
        never if omitted.
    **options
        As `shipnet.modbus.server.serve` takes them: transport, host, port, and for a serial line
        serial_port and line.

    Returns
    -------
    Server
        When its block begins, it listens.

    Raises
    ------
    ArgumentError
        If an argument is out of its range.
    ImportError
        If pymodbus, or pyserial for a serial line, is missing.

    Examples
    --------
    >>> with valve_server(3) as server:
    ...     sorted(server.slaves)
    [1, 2, 3]
    """
    count = check_whole("n_valves", n_valves, 1, MAX_UNIT)
    factor = check_scalar("speed", speed, "s/s", 0, 1e4)
    failed = list(faults)
    for fault in failed:
        fault.severities(count)
    plant = Plant(n_valves=count, faults=failed, rng=rng)
    return serve(valve_slaves(plant, watchdog=watchdog), clock=real_clock(factor), **options)
