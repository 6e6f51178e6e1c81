"""The master: it scans its valves, sends commands between polls, and shows what it received.

All data pass through the slaves' registers, and each transfer takes as long as its frames on the
line. `shipnet.modbus` simulates the two ports, and faults of ports, cables and slaves.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property
from math import inf
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from shipnet import style
from shipnet.arrays import Bools, Floats, Integers
from shipnet.ballast.diagnosis import Run
from shipnet.ballast.plant import Command, Plant
from shipnet.ballast.plant import Fault as ValveFault
from shipnet.ballast.registers import COMMAND_REGISTER, MISSING, Code, RegisterMap
from shipnet.ballast.scan import READ_STATUS, System, command_poll
from shipnet.ballast.sensors import CHANNELS, position_speed, stroke_speed
from shipnet.ballast.slave import valve_slaves
from shipnet.clock import Fault
from shipnet.errors import ArgumentError
from shipnet.fields import check_rng, check_scalar, check_whole
from shipnet.html import as_html
from shipnet.lazy import Axes, pd
from shipnet.modbus.frame import MAX_UNIT
from shipnet.modbus.pdu import Adu, ExceptionCode, Request
from shipnet.modbus.polling import Poll
from shipnet.modbus.simulation import LOST, A, Master, Try
from shipnet.modbus.slave import Slave, answer

#: States of a valve on the screen; the first that applies is shown.
STATES = ("silent", "not seen", "fault", "moving", "open", "closed", "part open")

#: Colour of each state on the screen, in the order of the legend.
STATE_COLOURS = {
    "open": "#004d38",
    "closed": "C0",
    "part open": "C2",
    "moving": "C4",
    "fault": style.LIMIT["color"],
    "silent": "0.35",
    "not seen": "0.8",
}

#: Hatches of states that an operator must notice even without colours.
_HATCHES = {"fault": "xxxx", "silent": "...."}

#: Height of a bar; rows of bars are 1 apart.
_HEIGHT = 0.5

#: Maximum number of valves per row at which bars still show position and number.
_NUMBERED = 20

#: A valve within this distance of an end counts as open or closed [%]; our assumption.
_END = 1.0

#: Lowest current at which a motor counts as running [A]; one step of the register may be noise.
LEAST_CURRENT = 0.15


class Shown(NamedTuple):
    """A received status: the time at which it was read, and the time from which it is shown."""

    unit: int
    read: float
    time: float
    registers: tuple[int, ...]


class Write(NamedTuple):
    """A command that was sent."""

    time: float
    end: float
    unit: int
    value: int
    response: bytes

    @property
    def outcome(self) -> str:
        """``done``, ``no answer``, or the name of the exception."""
        if not self.response:
            return "no answer"
        if self.response[:1] == b"\x06":
            return "done"
        return ExceptionCode(self.response[1]).name.replace("_", " ").lower()


@dataclass(frozen=True, eq=False)
class Screen:
    """Every valve as the master shows it at one time.

    Parameters
    ----------
    shown : pandas.DataFrame
        Indexed by ``valve``: ``position_percent`` and ``age_s`` (NaN and inf before the first
        status), ``fault`` as the slave reports it (0 if none), and ``state``. A valve is silent
        if it did not respond to the last request.
    time : float
        Time [s].

    Examples
    --------
    >>> from shipnet.ballast.scan import System, status_poll
    >>> from shipnet.ballast.simulation import simulate
    >>> screen = simulate(System(5, status_poll(9600)), [Command("open")], until=20).screen()
    >>> screen
    Screen(20.0 s: 5 open)
    >>> screen[2].state
    'open'
    """

    shown: pd.DataFrame
    time: float

    @classmethod
    def of(cls, rows: pd.DataFrame, *, silent: Bools, age: Floats, time: float) -> Screen:
        """Return the screen; `rows` are the last statuses as in `Status.table`, NaN if none."""
        position = rows["VPos_percent"].to_numpy()
        fault = rows["fault"].fillna(0).to_numpy().astype(np.int64)
        conditions = [
            silent,
            np.isnan(position),
            fault > 0,
            rows["MC_A"].to_numpy() >= LEAST_CURRENT,
            position >= 100 - _END,
            position <= _END,
        ]
        columns = {
            "position_percent": position,
            "age_s": age,
            "fault": fault,
            "state": np.select(conditions, STATES[:-1], STATES[-1]),
        }
        index = pd.RangeIndex(1, position.size + 1, name="valve")
        return cls(pd.DataFrame(columns, index=index), time)

    def table(self) -> pd.DataFrame:
        """Return one row per valve, as a copy."""
        return self.shown.copy()

    def __getitem__(self, valve: int) -> Any:
        """Return the row of one valve, counted from 1."""
        return self.shown.loc[check_whole("valve", valve, 1, len(self.shown))]

    def __repr__(self) -> str:
        counts = self.shown["state"].value_counts()
        states = ", ".join(f"{counts[name]} {name}" for name in STATES if name in counts)
        return f"Screen({self.time:.1f} s: {states})"

    _repr_html_ = as_html

    @style.applied
    def plot(
        self, selected: int | None = None, ax: Axes | None = None, *, columns: int = 32
    ) -> Axes:
        """Draw one bar per valve, coloured by its state; the selected bar is framed.

        With at most 20 bars per row, its valve's position [%] is above each bar, its number below.
        """
        units = self.shown.index.to_numpy()
        if selected is not None:
            selected = check_whole("selected", selected, 1, len(units))
        wide = min(len(units), check_whole("columns", columns, 1, 1000))
        ax = style.axes(ax)
        rows = -(-len(units) // wide)
        places = np.arange(len(units))
        x, y = places % wide, rows - 1 - places // wide
        position, framed = self.shown["position_percent"].to_numpy(float), units == selected
        states = self.shown["state"].tolist()
        ax.bar(
            x,
            _HEIGHT,
            0.84,
            y,
            color="0.94",
            edgecolor=[STATE_COLOURS[s] if s in _HATCHES else "0.6" for s in states],
            linewidth=0.5,
            hatch=[_HATCHES.get(state, "") for state in states],
        )
        part = _HEIGHT * np.clip(np.nan_to_num(position), 0, 100) / 100
        # A closed valve still shows a strip of colour.
        ax.bar(x, np.maximum(part, 0.05), 0.84, y, color=[STATE_COLOURS[state] for state in states])
        ax.set(xlim=(-0.6, wide - 0.4), ylim=(-0.3, rows - 0.2), xticks=[])
        if wide <= _NUMBERED:
            ax.set_yticks([])
            for index, (unit, percent) in enumerate(zip(units, position, strict=True)):
                words = "-" if np.isnan(percent) else f"{percent:.0f}"
                ax.text(x[index], y[index] + _HEIGHT + 0.05, words, ha="center")
                ax.text(x[index], y[index] - 0.04, str(unit), ha="center", va="top", color="0.4")
            ax.set_xlabel("valve", color="0.4", labelpad=0)
            ax.set_ylabel("position [%]")
        else:
            ax.set_yticks(y[::wide] + _HEIGHT / 2, [f"from {unit}" for unit in units[::wide]])
            ax.tick_params(length=0)
        ax.grid(False)
        ax.spines[:].set_visible(False)
        present = [state for state in STATE_COLOURS if state in states]
        for state in present:
            colour, hatch = STATE_COLOURS[state], _HATCHES.get(state)
            face = "0.94" if hatch else colour
            ax.fill_between([], [], facecolor=face, edgecolor=colour, hatch=hatch, label=state)
        if selected is not None:
            look: Any = {"fill": False, "edgecolor": "k", "linewidth": 2, "label": "selected"}
            ax.bar(x[framed], _HEIGHT, 0.84, y[framed], **look)
        ax.legend(loc="lower left", bbox_to_anchor=(0, 1), ncols=len(present) + 1)
        return ax


@dataclass(frozen=True, eq=False)
class MasterRun:
    """What a master received from its valves, as returned by `simulate` for a system with a poll.

    It contains the statuses received (`shown`), the commands sent (`writes`) and the polls
    (`tries`), each in order of time, and ends at `duration` [s]. Each poll is a tuple: its start,
    its valve (counted from 0), its port, its kind, and whether the valve responded.

    Examples
    --------
    A master with 50 valves at 9600 bit/s opens valve 7; its screen lags by up to about a scan:

    >>> from shipnet.ballast.scan import System, status_poll
    >>> from shipnet.ballast.simulation import simulate
    >>> run = simulate(System(50, status_poll(9600)), [Command("open", 3.0, valves=7)], until=15)
    >>> run.received(7).samples["VPos"][:, 0].tolist()
    [0.0, 0.0, 4.0, 22.0, 40.0, 58.0, 76.0, 93.0, 100.0, 100.0]
    >>> run.screen(7.2)
    Screen(7.2 s: 1 moving, 49 closed)
    """

    n_valves: int
    poll: Poll
    registers: RegisterMap
    duration: float
    shown: list[Shown]
    writes: list[Write]
    tries: list[Try]

    @cached_property
    def answers(self) -> pd.DataFrame:
        """One row per status: ``unit``, ``read_s``, ``shown_s``, readings, flags, ``fault``."""
        table = pd.DataFrame(self.shown, columns=["unit", "read_s", "shown_s", "registers"])
        words = np.array(table.pop("registers").tolist(), np.int64).reshape(-1, 4)
        status = self.registers.decode(words).table()
        return table.astype({"unit": int, "read_s": float, "shown_s": float}).join(status)

    @cached_property
    def commands(self) -> pd.DataFrame:
        """One row per command: ``unit``, ``value``, ``sent_s``, ``free_s``, ``outcome``."""
        rows = [(w.unit, f"0x{w.value:04X}", w.time, w.end, w.outcome) for w in self.writes]
        return pd.DataFrame(rows, columns=["unit", "value", "sent_s", "free_s", "outcome"])

    def ages(self, times: npt.ArrayLike) -> Floats:
        """Return the ages of the statuses shown, shape (n_times, n_valves) [s]; inf if none."""
        looked = np.atleast_1d(np.asarray(times, float))
        last = self._last(looked)
        read = np.append(self.answers["read_s"], -np.inf)
        return np.asarray(looked[:, np.newaxis] - read[last])

    @property
    def oldest(self) -> float:
        """Greatest age of any status while it was shown [s]; inf if a valve has none."""
        shown = self.answers[["unit", "read_s", "shown_s"]]
        if shown["unit"].nunique() < self.n_valves:
            return inf
        # Each status is shown until the valve's next status arrives, or until the end.
        until = shown.groupby("unit")["shown_s"].shift(-1).fillna(self.duration)
        return float((until - shown["read_s"]).max())

    def screen(self, time: float | None = None) -> Screen:
        """Return what the master shows at a time [s], by default at the end."""
        at = self.duration if time is None else check_scalar("time", time, "s", 0, 1e9)
        last = self._last(np.array([at]))[0]
        rows = self.answers.reindex(np.where(last < len(self.shown), last, -1))
        return Screen.of(rows, silent=self._silent(at), age=self.ages([at])[0], time=at)

    def received(self, valve: int) -> Run:
        """Return the readings of one valve as the master received them, one instant per status.

        The last command counts as active while the current shows that the motor runs and the
        commanded position has not been reached.
        """
        unit, target = check_whole("valve", valve, 1, self.n_valves), np.nan
        for write in self.writes:
            if write.unit == unit and write.outcome == "done":
                code, position = self.registers.decode_command(write.value)
                target = {Code.OPEN: 100.0, Code.CLOSE: 0.0}.get(code, float(position))
        rows = self.answers[self.answers["unit"] == unit]
        if rows.empty:
            raise ArgumentError(f"valve is {unit}; no status was received from it")
        time = rows["read_s"].to_numpy()
        readings = rows[[c.column for c in CHANNELS]].to_numpy()[:, :, np.newaxis]
        running, opening = readings[:, 2] >= LEAST_CURRENT, readings[:, 4]
        starts = running.copy()
        starts[1:] &= ~running[:-1]
        began = np.maximum.accumulate(np.where(starts, time[:, np.newaxis], -np.inf))
        ran = np.where(running, time[:, np.newaxis] - began, np.nan)
        speed = position_speed(time, opening)
        moving = running & (stroke_speed(speed, ran) != 0)
        active = running & (np.abs(opening - target) > 0.5)
        return Run(time, readings, speed, ran, moving, active, opening / 100, ())

    def __repr__(self) -> str:
        return (
            f"MasterRun({self.duration:g} s, {self.n_valves} valves, {len(self.shown)} statuses, "
            f"oldest value shown {self.oldest:.2f} s)"
        )

    def _repr_html_(self) -> str:
        screen = self.screen()
        return as_html(self, table=screen.table(), plot=screen.plot)

    def _last(self, times: Floats) -> Integers:
        """Return the index of the status shown for each valve; ``len(shown)`` if there is none."""
        unit, shown = (self.answers[name].to_numpy() for name in ("unit", "shown_s"))
        last = np.full((times.size, self.n_valves), len(self.shown))
        for k in range(self.n_valves):
            rows = np.flatnonzero(unit == k + 1)
            latest = np.searchsorted(shown[rows], times, side="right") - 1
            last[latest >= 0, k] = rows[latest[latest >= 0]]
        return last

    def _silent(self, time: float) -> Bools:
        silent = np.zeros(self.n_valves, bool)
        took = (self.poll.unanswered_time, self.poll.time)
        for start, slave, _, _, answered in self.tries:
            if start + took[answered] <= time + 1e-9:
                silent[slave] = not answered
        return silent


class Station(Master):
    """A master with two ports, its line and the valves on it; time only moves forward."""

    # Section 3.3 of the paper: the command goes out between two polls, and the scan continues after
    # its echo. Our assumptions: a command is sent only once, because without a response the
    # master does not know whether the valve moves; it goes through the port that serves the slave.
    # The slave takes its readings at the end of the request.
    def __init__(self, plant: Plant, faults: Iterable[Fault] = ()) -> None:
        self.plant, system = plant, plant.system
        super().__init__(system.loop, tuple(faults))
        self.registers = RegisterMap()
        self.slaves: dict[int, Slave] = valve_slaves(plant)
        self._command = command_poll(system.loop.poll)
        self.shown: list[Shown] = []
        self.writes: list[Write] = []
        self._position: dict[int, int] = {}
        self._next = self._skipped = 0

    @property
    def seen(self) -> MasterRun:
        """The run so far, from the statuses that the master received."""
        return MasterRun(
            self.n,
            self.rule.poll,
            self.registers,
            self.time,
            list(self.shown),
            list(self.writes),
            list(self.tries),
        )

    def run_until(self, time: float) -> None:
        """Continue the scan; the last transaction that begins before `time` is completed."""
        while self.time < time:
            before = self.time
            self.turn(self._next)
            self._next = (self._next + 1) % self.n
            self._skipped = 0 if self.time > before else self._skipped + 1
            if self._skipped == self.n:
                # No slave can be reached: nothing happens until the next attempt is due.
                self.time = min(max(self.last_failure + self.rule.recheck, before), time)
                self._skipped = 0
        self.plant.run_until(self.time)

    def command(self, action: str | float, unit: int) -> Write:
        """Send an action, a mode or a position [%] as a command now; wait for the response."""
        if unit not in self.slaves:
            raise ArgumentError(f"unit is {unit!r}; it must be 1..{self.n}")
        if action == "stop":
            raise ArgumentError("action is 'stop'; Table 2 has no code for it; use 'manual'")
        return self.write(self.registers.encode_command(action, self._position.get(unit, 0)), unit)

    def write(self, value: int, unit: int) -> Write:
        """Send a value for the command register now, and wait for the response."""
        port = self.port[unit - 1]
        begin, poll = self.time, self._command
        arrives = begin + poll.line.frame_time(poll.request_size)
        done = arrives + poll.shortest_timeout
        request = Request.write_single_register(COMMAND_REGISTER, value)
        response, self.time = b"", arrives + poll.timeout
        if self._holds(begin, arrives, unit, port):
            echo = answer(self.slaves, Adu(unit, request.pdu), arrives, serial=True).pdu
            if self._holds(arrives, done, unit, port):
                response, self.time = echo, done + poll.line.t35
        self.writes.append(Write(begin, self.time, unit, value, response))
        return self.writes[-1]

    def attempt(self, slave: int, port: int, kind: int) -> bool:
        """Poll a slave for its status; return whether it responded."""
        start, unit, line = self.time, slave + 1, self.rule.poll.line
        read = start + line.frame_time(self.rule.poll.request_size)
        pdu = b""
        # The slave must take its readings before the plant advances past the end of the request.
        if self.paths.hold(start, read, slave, port):
            pdu = answer(self.slaves, Adu(unit, READ_STATUS.pdu), read, serial=True).pdu
        if not super().attempt(slave, port, kind):
            return False
        words = tuple(int.from_bytes(pdu[k : k + 2], "big") for k in (2, 4, 6, 8))
        if words[0] >> 8 != MISSING:
            self._position[unit] = words[0] >> 8
        self.shown.append(Shown(unit, read, start + self.needed, words))
        return True

    def _holds(self, start: float, end: float, unit: int, port: int) -> bool:
        """Return whether the path is intact; commands to a lost slave go through port A."""
        return self.paths.hold(start, end, unit - 1, A if port == LOST else port)


def operate(
    plant: Plant, commands: Iterable[Command] = (), *, until: float, faults: Iterable[Fault] = ()
) -> MasterRun:
    """Simulate a master that scans its valves and sends commands at their times."""
    end = check_scalar("until", until, "s", 0, 1e5)
    station = Station(plant, faults)
    orders = sorted(commands, key=lambda command: command.time)
    due = [(c.time, c, k + 1) for c in orders for k in c.mask(plant.n_valves).nonzero()[0]]
    for time, order, unit in due:
        station.run_until(min(time, end))
        if station.time < end:
            station.command(order.action, int(unit))
    station.run_until(end)
    return station.seen


def scan_fleet(
    system: System, commands: Iterable[Command], faults: Iterable[Fault], until: float, rng: Any
) -> MasterRun:
    """Simulate a system's valves and its masters, among which the valves are divided."""
    shares = system.valve_addresses()["master"].value_counts(sort=False).tolist()
    orders, several = list(commands), list(faults)
    of_valves = [fault for fault in several if isinstance(fault, ValveFault)]
    of_line = [fault for fault in several if not isinstance(fault, ValveFault)]
    if len(shares) > 1 and (several or system.actuator.n_valves or np.ndim(system.opening)):
        raise ArgumentError(
            f"n_valves is {system.n_valves}; with faults, or an actuator or opening per valve, "
            f"only one master is simulated, so it must be 1..{MAX_UNIT}"
        )
    masks = [command.mask(system.n_valves) for command in orders]
    noise = None if rng is None else check_rng(rng)
    runs: list[MasterRun] = []
    shown, writes, tries = list[Shown](), list[Write](), list[Try]()
    for share in shares:
        first = sum(run.n_valves for run in runs)
        meant = [np.flatnonzero(mask[first : first + share]) + 1 for mask in masks]
        due = [
            replace(order, valves=valves.tolist())
            for order, valves in zip(orders, meant, strict=True)
            if valves.size
        ]
        plant = Plant(replace(system, n_valves=share), of_valves, noise)
        runs.append(run := operate(plant, due, until=until, faults=of_line))
        shown += [status._replace(unit=status.unit + first) for status in run.shown]
        writes += [write._replace(unit=write.unit + first) for write in run.writes]
        tries += [(attempt[0], attempt[1] + first, *attempt[2:]) for attempt in run.tries]
    return replace(
        runs[0],
        n_valves=system.n_valves,
        duration=max(run.duration for run in runs),
        shown=sorted(shown, key=lambda status: status.time),
        writes=sorted(writes, key=lambda write: write.time),
        tries=sorted(tries),
    )
