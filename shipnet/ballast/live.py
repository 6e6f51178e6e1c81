"""A test bed in simulated time, its acceptance tests, and real servers and clients.

The test bed of Figure 15 has a PC, a master and five slaves on a loop; S3 fills a tank, and S5 has
the fault simulator. The plant is our own model: the paper prints no measurements of the real test
bed.
"""

from __future__ import annotations

import socket
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from math import cos, pi
from typing import Any, NamedTuple

import numpy as np

from shipnet.ballast.diagnosis import Recorder, Run, diagnose_run
from shipnet.ballast.master import Screen, Station
from shipnet.ballast.plant import FAULTS, Fault, Plant
from shipnet.ballast.registers import COMMAND_REGISTER, Code, RegisterMap
from shipnet.ballast.scan import READ_STATUS, System, status_poll
from shipnet.ballast.slave import ValveDevice, ValveRegisters, valve_slaves
from shipnet.errors import FrameError
from shipnet.fields import check_choice, check_rng, check_scalar, check_whole
from shipnet.fuzzy.terms import NORMAL, UNDETERMINED
from shipnet.lazy import pd
from shipnet.modbus.frame import MAX_UNIT
from shipnet.modbus.pdu import Adu, ExceptionCode, Request, Response, decode
from shipnet.modbus.server import Server, real_clock
from shipnet.modbus.server import serve as serve_slaves
from shipnet.modbus.slave import DeviceError, Slave, answer


class _Image(ValveRegisters):
    """The status of a valve as the master last received it."""

    def __init__(self, station: Station, unit: int) -> None:
        self.station, self.unit = station, unit

    def status(self, time: float) -> Sequence[int]:
        """Return the last status that arrived; raise exception 11 if none has arrived yet."""
        for status in reversed(self.station.shown):
            if status.unit == self.unit:
                return status.registers
        raise DeviceError(ExceptionCode.GATEWAY_TARGET_FAILED_TO_RESPOND)

    def command(self, value: int, time: float) -> None:
        """Forward a command to the slave; raise its exception, or exception 11 if it is silent."""
        response = self.station.write(value, self.unit).response
        if not response:
            raise DeviceError(ExceptionCode.GATEWAY_TARGET_FAILED_TO_RESPOND)
        if response[0] & 0x80:
            raise DeviceError(response[1])


def gateway(station: Station) -> dict[int, Slave]:
    """Return the valves as slaves through which the master serves a PC; kim2014, section 3.5."""
    # The paper does not say whether the master polls the slave when the PC asks. Here the master
    # responds from memory, because its scans keep the line busy.
    return {unit: Slave(_Image(station, unit), functions={4, 6}) for unit in station.slaves}


#: Number of slaves in Figure 15, the slave with the tank, and the slave with the fault simulator.
N_SLAVES, _TANK, _SIMULATOR = 5, 3, 5

#: Time within which a healthy valve opens or closes [s], row 0 of the rule table; time for which it
#: is observed afterwards [s]; and the tolerance of a position [%].
_STROKE, _SETTLE, _NEAR = 10.0, 5.0, 1.5

#: Faults that appear at the closed end: the test closes the valve instead of opening it.
_CLOSING = ("S2", "Pos2", "Pos4")


class Step(NamedTuple):
    """A step of a test."""

    step: str
    expected: str
    found: str
    passed: bool


class TestBed:
    """The test bed of Figure 15: five valves, line, master, gateway to a PC, and a tank on valve 3.

    `wait` advances the time; `level` is the level of the tank [m].

    Parameters
    ----------
    fault : str, optional
        Code of the fault that the simulator on valve 5 imitates; none if omitted.
    opening : float, default 0
        Initial opening of all valves, 0..1.
    bit_rate : float, default 9600
        Bit rate of the line [bit/s], with 8E1 characters; the paper prints 2400 to 115200 bit/s.
    rng : Generator, int or None, optional
        Source of the sensors' noise, for `numpy.random.default_rng`; no noise if omitted.

    Examples
    --------
    >>> bed = TestBed()
    >>> bed.command(3, "open")
    'done'
    >>> bed.wait(12.0)
    >>> bed.position(3), round(bed.level, 3)
    (100.0, 0.313)
    """

    # Otherwise pytest would collect this class as a test.
    __test__ = False

    def __init__(
        self,
        fault: str | None = None,
        *,
        opening: float = 0.0,
        bit_rate: float = 9600.0,
        rng: Any = None,
    ) -> None:
        faults = []
        if fault is not None:
            faults = [Fault(check_choice("fault", fault, FAULTS), valves=_SIMULATOR)]
        system = System(N_SLAVES, status_poll(bit_rate), opening=opening)
        self.plant = Plant(system, faults, rng)
        self.station = Station(self.plant)
        self.gateway, self.recorder = gateway(self.station), Recorder(self.plant)
        self.level = 0.0

    def __repr__(self) -> str:
        return f"TestBed({self.time:.1f} s, {self.screen()!r})"

    @property
    def time(self) -> float:
        """Time of the master [s]."""
        return self.station.time

    def device(self, unit: int) -> ValveDevice:
        """Return a slave, for access to its switches."""
        device = self.station.slaves[check_whole("unit", unit, 1, N_SLAVES)].device
        assert isinstance(device, ValveDevice)
        return device

    def wait(self, duration: float) -> None:
        """Let `duration` [s] pass: the master scans, the tank fills, and readings are recorded."""
        end, plant = self.time + check_scalar("duration", duration, "s", 0, 1e8), self.plant
        while self.time < end:
            self.recorder.take()
            before, since = plant.opening[_TANK - 1], plant.time
            self.station.run_until(min(self.time + plant.step, end))
            # Up to 0.01 m3/s flows into the tank, which has a base area of 0.2 m2.
            opening = (before + plant.opening[_TANK - 1]) / 2
            self.level += 0.01 * (1 - cos(pi * opening / 2)) * (plant.time - since) / 0.2
        self.recorder.take()

    def position(self, valve: int) -> float:
        """Return the position of a valve on the master's screen [%]."""
        return float(self.screen()[valve].position_percent)

    def command(self, valve: int, action: str | float) -> str:
        """Send a command from the master; return ``done``, or the reason why it failed.

        `action` is ``open``, ``close``, a position [%], or the mode ``manual`` or ``auto``.
        """
        unit = check_whole("valve", valve, 1, N_SLAVES)
        return self.station.command(action, unit).outcome

    def screen(self) -> Screen:
        """Return the present screen of the master."""
        return self.station.seen.screen()

    @property
    def run(self) -> Run:
        """The readings of the valves' sensors so far."""
        return self.recorder.run

    def serve(self, **options: Any) -> Server:
        """Return a real server for a ``with`` block; it responds to a PC as the master does."""
        return serve_slaves(self.gateway, clock=lambda: self.time, **options)


def acceptance_tests(*, bit_rate: float = 9600.0, rng: Any = None) -> pd.DataFrame:
    """Carry out the four tests of section 4 of kim2014, each on a new test bed.

    Parameters
    ----------
    bit_rate : float, default 9600
        Bit rate of the line [bit/s].
    rng : Generator, int or None, optional
        Source of the sensors' noise, for `numpy.random.default_rng`; no noise if omitted.

    Returns
    -------
    pandas.DataFrame
        One row per step: ``test`` (``manual``, ``remote``, ``PC`` or ``diagnosis``), ``step``,
        ``expected`` and ``found`` results, and whether it ``passed``.

    Notes
    -----
    The paper says that all tests passed, but prints neither the steps nor the criteria; we chose
    them. A fault counts as found if its code is active at any time in the test: the rules are
    nested, so other codes may be active too. The slave's status contains only one code; its step
    passes if this is the fault's code, or that of a rule that fires only if the fault's rule fires.

    Examples
    --------
    >>> table = acceptance_tests(rng=2024)
    >>> table.groupby("test", sort=False)["passed"].sum().to_dict()
    {'manual': 20, 'remote': 20, 'PC': 11, 'diagnosis': 26}
    """
    noise = None if rng is None else check_rng(rng)
    make = partial(TestBed, bit_rate=bit_rate, rng=noise)
    tests = {"manual": _manual, "remote": _remote, "PC": _pc}
    rows = [(name, *step) for name, test in tests.items() for step in test(make)]
    rows += [("diagnosis", *step) for code in (None, *FAULTS) for step in _diagnosis(make, code)]
    return pd.DataFrame(rows, columns=["test", *Step._fields])


def _manual(make: Callable[..., TestBed]) -> Iterator[Step]:
    """Move every valve with its switches, and check that it refuses a command from the master."""
    bed = make()
    for unit in range(1, N_SLAVES + 1):
        device = bed.device(unit)
        device.local = True
        device.turn("open", bed.time)
        bed.wait(_STROKE + _SETTLE / 2)
        yield _at(f"S{unit} opened by switch", bed.position(unit), 100)
        refused = bed.command(unit, "close")
        yield _same(f"command S{unit} to close", "server device failure", refused)
        device.turn("close", bed.time)
        bed.wait(_STROKE / 2)
        device.turn("stop", bed.time)
        bed.wait(_SETTLE / 2)
        held = bed.position(unit)
        bed.wait(_SETTLE)
        yield _at(f"S{unit} stopped in mid-stroke", bed.position(unit), held)
        device.turn("close", bed.time)
        bed.wait(_STROKE)
        yield _at(f"S{unit} closed by switch", bed.position(unit), 0)


def _remote(make: Callable[..., TestBed]) -> Iterator[Step]:
    """Open, position and close every valve from the master."""
    bed = make()
    for unit in range(1, N_SLAVES + 1):
        echo = bed.command(unit, "open")
        yield _same(f"command S{unit} to open", "done", echo)
        for action, target in (("open", 100.0), ("position", 40.0), ("close", 0.0)):
            if action != "open":
                bed.command(unit, target if action == "position" else action)
            bed.wait(_STROKE)
            yield _at(f"S{unit} {action}", bed.position(unit), target)


def _pc(make: Callable[..., TestBed]) -> Iterator[Step]:
    """Command every valve from the PC, in Modbus/TCP frames, and fill the tank."""
    bed = make()
    registers = bed.station.registers

    def ask(unit: int, request: Request) -> bytes:
        """Return the frame of the response to a request; its transaction id is the unit id."""
        pdu = answer(bed.gateway, Adu(unit, request.pdu), bed.time).pdu
        return Adu(unit, pdu, transaction_id=unit).tcp

    opening, closing = (
        Request.write_single_register(COMMAND_REGISTER, registers.command(code))
        for code in (Code.OPEN, Code.CLOSE)
    )
    for unit in range(1, N_SLAVES + 1):
        sent, echo = opening.tcp(unit, unit), ask(unit, opening)
        yield _same(f"command S{unit} to open", sent.hex(), echo.hex())
        bed.wait(_STROKE)
        yield _at(f"S{unit} open", float(ask(unit, READ_STATUS)[9]), 100)
    level = bed.level
    ask(_TANK, closing)
    bed.wait(_STROKE + _SETTLE)
    full = bed.level
    bed.wait(_SETTLE)
    result = f"{'rose' if full > level > 0 else 'did not rise'}, " + (
        "then held" if bed.level == full else "then did not hold"
    )
    yield _same("tank of S3 after closing", "rose, then held", result)


def _diagnosis(make: Callable[..., TestBed], code: str | None) -> Iterator[Step]:
    """Imitate a fault with the simulator, move the valve, and check the reported codes."""
    closing = code in _CLOSING
    bed = make(fault=code, opening=float(closing))
    bed.wait(1.0)
    bed.command(_SIMULATOR, "close" if closing else "open")
    # The motor of a valve that does not reach its target runs until its time limit.
    while bed.plant.running.any():
        bed.wait(1.0)
    bed.wait(_SETTLE)
    diagnosis = diagnose_run(bed.run)
    base, active = diagnosis.base, diagnosis.active[:, _SIMULATOR - 1]
    (codes,) = base.active_codes(np.any(active, axis=0, keepdims=True))
    expected = code or NORMAL
    calm = (diagnosis.top[:, _SIMULATOR - 1] == NORMAL).all()
    reported = codes or (NORMAL if calm else UNDETERMINED)
    step = f"{FAULTS[code][0]} ({code})" if code else "nothing wrong"
    yield Step(step, expected, reported, expected in reported.split())
    # The slave also diagnoses its own valve, and reports one row of the rule table: that of the
    # fault, or of a rule that fires only if the fault's rule fires.
    seen = bed.screen()[_SIMULATOR]
    shown = f"fault {seen['fault']}" if seen["state"] == "fault" else str(seen["state"])
    right = ["open"]
    if code:
        terms = set(base.rule(code).antecedent)
        nested = [rule.code for rule in base.rules if terms < set(rule.antecedent)]
        right = [f"fault {base.codes.index(name) + 1}" for name in (code, *nested)]
    step = f"screen with {code or 'nothing wrong'}"
    yield Step(step, " or ".join(right), shown, shown in right)


def _same(step: str, expected: str, actual: str) -> Step:
    return Step(step, expected, actual, expected == actual)


def _at(step: str, position: float, target: float) -> Step:
    near = abs(position - target) <= _NEAR
    return Step(step, f"{target:g} %", f"{position:g} %", near)


def serve(
    n_valves: int = 64,
    *,
    faults: Fault | Iterable[Fault] = (),
    speed: float = 1.0,
    rng: Any = None,
    watchdog: float | None = None,
    **options: Any,
) -> Server:
    """Return a real Modbus server for a new plant of closed valves, for use in a ``with`` block.

    Parameters
    ----------
    n_valves : int, default 64
        Number of valves, 1..247; their unit ids start at 1.
    faults : Fault or iterable of Fault, optional
        Faults of the valves; they begin and end at simulated times.
    speed : float, default 1
        Simulated seconds per real second, 0..1e4.
    rng : Generator, int or None, optional
        Source of the sensors' noise, for `numpy.random.default_rng`; no noise if omitted.
    watchdog : float, optional
        Simulated time without a request after which the motor of a valve stops, 0.1..3600 [s]; no
        limit if omitted.
    **options
        Options of `shipnet.modbus.serve`: transport, host, port, wire_faults, and, for a serial
        line, serial_port and line.

    Returns
    -------
    Server
        It listens while its ``with`` block runs.

    Raises
    ------
    ImportError
        For RTU, if pymodbus or pyserial is missing.

    Examples
    --------
    >>> with serve(3, speed=100) as server:
    ...     sorted(server.slaves)
    [1, 2, 3]
    """
    count = check_whole("n_valves", n_valves, 1, MAX_UNIT)
    factor = check_scalar("speed", speed, "s/s", 0, 1e4)
    plant = Plant(System(count, watchdog=watchdog), faults, rng)
    return serve_slaves(valve_slaves(plant), clock=real_clock(factor), **options)


class Link:
    """A connection to a server, called with a unit id and a request."""

    def __init__(self, address: str, port: int, timeout: float = 1.0) -> None:
        self.where, self._last = f"{address}, port {port}", 0
        try:
            self._socket = socket.create_connection((address, port), timeout)
        except (OSError, UnicodeError) as problem:
            raise OSError(f"no server at {self.where}: {problem}") from None

    def __call__(self, unit: int, request: Request) -> Response:
        """Send a request and return the response."""
        self._last = (self._last + 1) % 0x10000
        try:
            self._socket.sendall(request.tcp(unit, self._last))
            while True:
                head = self._receive(7)
                adu = decode(head + self._receive(int.from_bytes(head[4:6], "big") - 1), "tcp")
                # A late response to an earlier request, which timed out, is skipped.
                if adu.transaction_id == self._last:
                    return Response.parse(adu.pdu, request)
        except (OSError, FrameError) as problem:
            raise OSError(f"{self.where} does not answer for valve {unit}: {problem}") from None

    def _receive(self, size: int) -> bytes:
        received = b""
        while len(received) < size:
            more = self._socket.recv(size - len(received))
            if not more:
                raise OSError("the connection was closed")
            received += more
        return received

    def close(self) -> None:
        """Close the connection."""
        self._socket.close()


class ModelValves:
    """Valves without a server; the caller sets the simulated time.

    Parameters
    ----------
    n_valves : int, default 16
        Number of valves, 1..247.
    faults : tuple of Fault, optional
        Faults of the valves.
    rng : numpy.random.Generator, optional
        Source of the sensors' noise; no noise if omitted.

    Attributes
    ----------
    time : float
        Simulated time [s]; it may only increase.

    Examples
    --------
    >>> valves = ModelValves(4)
    >>> pc = Client.over(valves, n_valves=4)
    >>> pc.command(2, "open"), pc.command(5, "close")
    ('valve 2: open', 'valve 5 refuses: gateway target failed to respond')
    """

    def __init__(
        self,
        n_valves: int = 16,
        faults: tuple[Fault, ...] = (),
        rng: np.random.Generator | None = None,
    ) -> None:
        system = System(check_whole("n_valves", n_valves, 1, MAX_UNIT))
        self._slaves = valve_slaves(Plant(system, faults, rng))
        self.time = 0.0

    def __call__(self, unit: int, request: Request) -> Response:
        """Answer a request."""
        return Response.parse(answer(self._slaves, Adu(unit, request.pdu), self.time).pdu, request)


class Client:
    """A client that commands and reads valves over Modbus/TCP, as the paper's PC does.

    Parameters
    ----------
    address : str, default "127.0.0.1"
        Name or address of the server.
    port : int, default 5020
        Port of the server.
    n_valves : int, default 16
        Number of valves that are read, 1..247.
    timeout : float, default 1
        Time to wait for a connection or a response [s].

    Raises
    ------
    OSError
        If the server does not respond when the client is created or used.

    Examples
    --------
    >>> with serve(3, speed=100) as server, Client(port=server.port, n_valves=3) as pc:
    ...     pc.command(2, "open")
    'valve 2: open'
    """

    def __init__(
        self,
        address: str = "127.0.0.1",
        port: int = 5020,
        *,
        n_valves: int = 16,
        timeout: float = 1.0,
    ) -> None:
        self.n_valves = check_whole("n_valves", n_valves, 1, MAX_UNIT)
        number = check_whole("port", port, 0, 65535)
        wait = check_scalar("timeout", timeout, "s", 1e-3, 3600)
        self._ask: Callable[[int, Request], Response] = Link(address, number, wait)

    @classmethod
    def over(cls, ask: Callable[[int, Request], Response], n_valves: int = 16) -> Client:
        """Return a client that sends its requests through `ask`, such as `ModelValves`."""
        client = cls.__new__(cls)
        client.n_valves = check_whole("n_valves", n_valves, 1, MAX_UNIT)
        client._ask = ask
        return client

    def __enter__(self) -> Client:
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the connection."""
        if isinstance(self._ask, Link):
            self._ask.close()

    def command(self, valve: int, action: str | float) -> str:
        """Command a valve: ``open``, ``close``, ``manual``, ``auto`` or a position, 0..100 [%].

        Return, as text, the command that was accepted, or why the valve refused it.
        """
        unit = check_whole("valve", valve, 1, MAX_UNIT)
        request = Request.write_single_register(
            COMMAND_REGISTER, RegisterMap().encode_command(action)
        )
        response = self._ask(unit, request)
        if response.exception is not None:
            why = ExceptionCode(response.exception).name.replace("_", " ").lower()
            return f"valve {unit} refuses: {why}"
        accepted = action if isinstance(action, str) else f"position {round(action)} %"
        return f"valve {unit}: {accepted}"

    def read(self) -> Readout:
        """Read all valves; a valve that responds with an exception gets no values."""
        valves = pd.RangeIndex(1, self.n_valves + 1, name="valve")
        responses = {valve: self._ask(valve, READ_STATUS) for valve in valves}
        words = {k: answer.registers for k, answer in responses.items() if answer.exception is None}
        status = RegisterMap().decode(np.array(list(words.values()), np.int64).reshape(-1, 4))
        return Readout(status.table().set_axis(list(words)).reindex(valves))

    def screen(self) -> Screen:
        """Read all valves and return them as the master would show them."""
        return self.read().screen

    def status(self, valve: int) -> pd.Series:
        """Read all valves and return the values of one as text with units."""
        unit = check_whole("valve", valve, 1, self.n_valves)
        return pd.Series(self.read().numbers(unit), name=f"valve {unit}", dtype=object)


@dataclass(frozen=True, eq=False)
class Readout:
    """Values by valve: `rows` has the columns of `Status.table`, NaN for a valve that sent none."""

    rows: pd.DataFrame

    @property
    def screen(self) -> Screen:
        """The valves as the master would show them if it had just read them."""
        silent = self.rows["fault"].isna().to_numpy()
        return Screen.of(self.rows, silent=silent, age=np.where(silent, np.inf, 0.0), time=0.0)

    def numbers(self, valve: int) -> dict[str, str]:
        """Return the values of one valve as text with units; empty if it sent none."""
        row = self.rows.loc[valve]
        if pd.isna(row["fault"]):
            return {}
        way = "open" if row["open"] else "close" if row["close"] else "none"
        return {
            "position": reading_text(row["VPos_percent"], 0, "%"),
            "pump pressure": reading_text(row["FP_bar"], 0, "bar"),
            "operating pressure": reading_text(row["OP_bar"], 1, "bar"),
            "motor current": reading_text(row["MC_A"], 1, "A"),
            "motor temperature": reading_text(row["OT_degC"], 0, "degC"),
            "motor ran": f"{row['operating_s']:.1f} s",
            "mode": "auto" if row["auto"] else "manual",
            "last command reported": way,
            "fault reported": str(int(row["fault"])) if row["fault"] else "none",
        }


def reading_text(value: float, digits: int, unit: str) -> str:
    """Return a reading as text, ``missing`` for NaN."""
    return "missing" if np.isnan(value) else f"{value:.{digits}f} {unit}"
