"""The master on a clock: it scans its valves, sends commands in between, and keeps what it saw.

Everything goes through the registers of the slaves and the time that frames take on the line; the
two ports and their faults are those of `shipnet.modbus.simulation`.
"""

from __future__ import annotations

from collections.abc import Iterable

from shipnet.ballast.codes import Code
from shipnet.ballast.commands import Command
from shipnet.ballast.plant import Plant
from shipnet.ballast.registers import COMMAND_REGISTER, RegisterMap
from shipnet.ballast.scales import MISSING
from shipnet.ballast.scan import READ_STATUS, command_poll
from shipnet.ballast.screen import MasterRun, Shown, Write
from shipnet.ballast.slave import valve_slaves
from shipnet.clock import Fault
from shipnet.errors import ArgumentError
from shipnet.fields import check_scalar
from shipnet.modbus.adu import Adu
from shipnet.modbus.pdu import Request
from shipnet.modbus.redundancy import Loop
from shipnet.modbus.simulation import LOST, A, Master
from shipnet.modbus.slave import Slave, answer

__all__ = ["Station", "operate"]


class Station(Master):
    """A master with two ports, its line and the valves on it, whose time only moves on.

    Parameters
    ----------
    plant : Plant
        The valves; slave n, which also is unit id n, has valve n - 1.
    system : Loop
        The line, with as many slaves as there are valves, polled by `status_poll`.
    faults : iterable of shipnet.clock.Fault, optional
        What fails on the line, and when.
    registers : RegisterMap, optional
        Reading of the paper's tables, which slaves and master share.
    answer_at_end : bool, default False
        Whether a slave answers a command when the valve has arrived, as the paper prints it, else
        at once.
    timeout : float, optional
        How long the master waits for the answer to a command [s]; that of the poll if omitted.
    watchdog : float, optional
        As for `ValveDevice`: a motor stops that has had no request for so long [s]; never if
        omitted.

    Attributes
    ----------
    slaves : dict of int to Slave
        By unit id; their devices have the toggle switches.
    shown : list of Shown
        Every status that came back.
    writes : list of Write
        Every command that was sent.

    Raises
    ------
    ArgumentError
        If line and plant differ in their number of valves, or the timeout is shorter than an
        answer takes.

    Notes
    -----
    Section 3.3 of the paper: the command goes out between two polls, and with its echo the master
    scans on. Not printed, and assumed: a command is sent once, through the port that serves the
    slave, for without an answer the master does not know whether the valve moves; the slave takes
    its readings at the end of the request. An answer that comes after its timeout garbles the
    transaction that it falls into.

    Examples
    --------
    >>> from shipnet.ballast.scan import status_poll
    >>> from shipnet.modbus.uart import SerialLine
    >>> station = Station(Plant(n_valves=5), Loop(5, status_poll(SerialLine(9600))))
    >>> station.run_until(1.0)
    >>> station.command("open", 2).answered
    True
    >>> station.run_until(12.0)
    >>> station.seen.screen().state.tolist()
    ['closed', 'open', 'closed', 'closed', 'closed']
    """

    def __init__(
        self,
        plant: Plant,
        system: Loop,
        faults: Iterable[Fault] = (),
        *,
        registers: RegisterMap | None = None,
        answer_at_end: bool = False,
        timeout: float | None = None,
        watchdog: float | None = None,
    ) -> None:
        if system.n_slaves != plant.n_valves:
            raise ArgumentError(
                f"system has {system.n_slaves} slaves; the plant has {plant.n_valves} valves"
            )
        if not isinstance(answer_at_end, bool):
            raise ArgumentError(f"answer_at_end is {answer_at_end!r}; it must be True or False")
        failed = tuple(faults)
        super().__init__(system, failed)
        self.plant, self.system = plant, system
        self.registers = registers if registers is not None else RegisterMap()
        self.slaves: dict[int, Slave] = valve_slaves(
            plant, registers=self.registers, watchdog=watchdog
        )
        self.at_end = answer_at_end
        poll = system.poll
        self._command = command_poll(
            poll.line,
            processing=poll.processing,
            timeout=poll.timeout if timeout is None else timeout,
        )
        self.shown: list[Shown] = []
        self.writes: list[Write] = []
        self._position: dict[int, int] = {}
        self._late: dict[int, float] = {}
        self._next = self._skipped = 0

    @property
    def seen(self) -> MasterRun:
        """What the master has seen up to now."""
        return MasterRun(
            self.system, self.registers, self.time, list(self.shown), list(self.writes),
            list(self.tries), float(self._command.time),
        )  # fmt: skip

    def run_until(self, time: float) -> None:
        """Scan on; the last transaction that begins before `time` is carried out in full.

        Parameters
        ----------
        time : float
            Time [s]; nothing happens if it has passed already.
        """
        while self.time < time:
            before = self.time
            self.turn(self._next)
            self._next = (self._next + 1) % self.n
            self._skipped = 0 if self.time > before else self._skipped + 1
            if self._skipped == self.n:
                # All are lost: nothing happens before the next try is due.
                self.time = min(max(self.last_failure + self.rule.recheck, before), time)
                self._skipped = 0
        self.plant.run_until(self.time)

    def command(self, action: str, unit: int, position: float | None = None) -> Write:
        """Send a command now, and wait for its answer.

        Parameters
        ----------
        action : str
            ``open``, ``close``, ``position``; or ``manual`` and ``auto``, the modes.
        unit : int
            Which valve, by its unit id.
        position : float, optional
            Where to go, 0..100, rounded to whole percent; with ``position`` only.

        Returns
        -------
        Write
            When it was sent, and what came back.

        Raises
        ------
        ArgumentError
            If there is no such action, valve or position.
        """
        if unit not in self.slaves:
            raise ArgumentError(f"unit is {unit!r}; it must be 1..{self.n}")
        if action in ("manual", "auto"):
            return self.write(self.registers.command(Code(action.title())), unit)
        asked = Command(action, position=position)
        if action == "stop":
            raise ArgumentError("action is 'stop'; Table 2 has no code for it, 'manual' stops too")
        if asked.position is None:
            return self.write(self.registers.command(Code(action.title())), unit)
        whole = round(asked.position)
        code = Code.POSITION_OPEN
        if whole < self._position.get(unit, 0):
            code = Code.POSITION_CLOSE
        return self.write(self.registers.command(code, whole), unit)

    def write(self, value: int, unit: int) -> Write:
        """Send a value for the command register now, and wait for its answer.

        Parameters
        ----------
        value : int
            0..65535.
        unit : int
            Which valve, by its unit id.

        Returns
        -------
        Write
            When it was sent, and what came back.
        """
        port = self.port[unit - 1]
        begin, poll = self.time, self._command
        arrives = begin + poll.line.frame_time(poll.request_size)
        request = Request.write_single_register(COMMAND_REGISTER, value)
        response, end = b"", arrives + poll.timeout
        if self._holds(begin, arrives, unit, port):
            response = answer(self.slaves, Adu(unit, request.pdu), arrives, serial=True).pdu
            waits = self.at_end and response[:1] == b"\x06"
            ready = max(self._arrival(unit, end), arrives) if waits else arrives
            done = ready + poll.shortest_timeout
            if done <= end + 1e-9 and self._holds(arrives, done, unit, port):
                end = done + poll.line.t35
            else:
                response = b""
                if waits:
                    self._late[unit] = self.plant.started[unit - 1]
        self.time = end
        write = Write(begin, end, unit, value, response)
        self.writes.append(write)
        return write

    def attempt(self, slave: int, port: int, kind: int) -> bool:
        """Ask a slave for its status, from its devices; return whether it answered."""
        start = self.time
        if self._garbled(start, start + self.needed):
            self.tries.append((start, slave, port, kind, False))
            self.time = self.last_failure = start + self.unanswered
            return False
        if not super().attempt(slave, port, kind):
            return False
        unit, poll = slave + 1, self.system.poll
        read = start + poll.line.frame_time(poll.request_size)
        response = answer(self.slaves, Adu(unit, READ_STATUS.pdu), read, serial=True).pdu
        words = tuple(int.from_bytes(response[k : k + 2], "big") for k in (2, 4, 6, 8))
        if words[0] >> 8 != MISSING:
            self._position[unit] = words[0] >> 8
        self.shown.append(Shown(unit, read, start + self.needed, words))
        return True

    def _holds(self, start: float, end: float, unit: int, port: int) -> bool:
        """Return whether a path is whole; a lost slave is tried through port A."""
        return self.paths.hold(start, end, unit - 1, A if port == LOST else port)

    def _arrival(self, unit: int, latest: float) -> float:
        """Let time pass until a motor stops, or until `latest`; return when it stopped."""
        k, plant = unit - 1, self.plant
        while plant.running[k] and plant.time < latest:
            plant.advance()
        return self._stopped(unit, plant.started[k])

    def _stopped(self, unit: int, started: float) -> float:
        """Return when the motor stopped that was started then: inf while it runs."""
        k = unit - 1
        if self.plant.running[k] and self.plant.started[k] == started:
            return float("inf")
        ends = [m.end for m in self.plant.movements if m.valve == k and m.start == started]
        return max([started, *ends])

    def _garbled(self, start: float, end: float) -> bool:
        """Return whether an answer that nobody waits for falls into a transaction."""
        if not self._late:
            return False
        # A motor that stops between two readings is known to have stopped at the second.
        self.plant.run_until(end + self.plant.step)
        serial, garbled = self.system.poll.line, False
        for unit, started in list(self._late.items()):
            begins = self._stopped(unit, started) + serial.t35
            lasts = serial.frame_time(self._command.response_size)
            if begins < end:
                garbled |= begins + lasts > start
                del self._late[unit]
        return garbled


def operate(
    plant: Plant,
    system: Loop,
    commands: Iterable[Command] = (),
    *,
    duration: float,
    faults: Iterable[Fault] = (),
    answer_at_end: bool = False,
    timeout: float | None = None,
    watchdog: float | None = None,
) -> MasterRun:
    """Let a master scan its valves and send commands at their times.

    Parameters
    ----------
    plant : Plant
        The valves.
    system : Loop
        The line, with as many slaves.
    commands : iterable of Command, optional
        What the master is told, in any order; it sends one for each valve, between two polls.
    duration : float
        No transaction begins after it, 0..1e5 [s].
    faults, answer_at_end, timeout, watchdog
        As for `Station`.

    Returns
    -------
    MasterRun
        What the master saw.

    Raises
    ------
    ArgumentError
        If an argument is out of its range, or a command is one that Table 2 has no code for.

    Examples
    --------
    A master with 50 valves at 9600 bit/s opens one; its position is up to a scan old:

    >>> from shipnet.ballast.scan import status_poll
    >>> from shipnet.modbus.uart import SerialLine
    >>> loop = Loop(50, status_poll(SerialLine(9600)))
    >>> run = operate(Plant(n_valves=50), loop, [Command("open", 3.0, valves=6)], duration=15)
    >>> run.answers.query("unit == 7").VPos_percent.tolist()
    [0.0, 0.0, 4.0, 22.0, 40.0, 58.0, 76.0, 93.0, 100.0, 100.0]
    """
    end = check_scalar("duration", duration, "s", 0, 1e5)
    station = Station(
        plant, system, faults, answer_at_end=answer_at_end, timeout=timeout, watchdog=watchdog
    )
    orders = sorted(commands, key=lambda command: command.time)
    due = [(c.time, c, k + 1) for c in orders for k in c.mask(plant.n_valves).nonzero()[0]]
    for time, order, unit in due:
        station.run_until(min(time, end))
        if station.time < end:
            station.command(order.action, int(unit), order.position)
    station.run_until(end)
    return station.seen
