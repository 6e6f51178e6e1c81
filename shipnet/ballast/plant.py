"""Valves with their commands and faults, simulated step by step.

The effects of a fault are our assumption: the paper describes the symptoms, not the defect. At
severity 1 the effects satisfy the rule of the fault, so a correct diagnosis verifies the code, but
not the rules.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from math import ceil, floor, inf
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from shipnet.arrays import Bools, Floats, Indices
from shipnet.ballast.actuator import (
    Actuator,
    Hydraulics,
    Oil,
    load_pressure,
    losses,
    motor_current,
    steady_temperature,
)
from shipnet.ballast.registers import check_action
from shipnet.ballast.scan import System, as_system
from shipnet.ballast.sensors import CHANNELS
from shipnet.clock import Fault as TimedFault
from shipnet.clock import as_faults
from shipnet.errors import ArgumentError
from shipnet.fields import (
    check_fields,
    check_rng,
    check_scalar,
    check_whole,
    choice,
    number,
    record,
)

#: The commands other than a position.
ACTIONS = ("open", "close", "stop")

#: Time between the commands of consecutive groups [s]: longer than the default `motor_time`.
_GROUP_PAUSE = 30.0

#: Difference from the commanded position up to which a valve does not start [%]; our assumption.
DEAD_BAND = 0.5

#: Row indices of temperature and position in the readings.
_OT, _VPOS = 3, 4


def _numbers(valves: int | Iterable[int] | None, n_valves: int = 10_000) -> tuple[int, ...] | None:
    """Return one or more valve numbers as a tuple; None, for all valves, is returned unchanged."""
    if valves is None:
        return None
    many = valves if isinstance(valves, Iterable) else (valves,)
    return tuple(check_whole("one of valves", valve, 1, n_valves) for valve in many)


def _places(valves: int | Iterable[int] | None, n_valves: int) -> Indices:
    """Return the indices, counted from 0, of the given valves; None means all `n_valves`."""
    numbers = _numbers(valves, n_valves)
    return np.arange(n_valves) if numbers is None else np.array(numbers, np.intp) - 1


@record
class Command:
    """A command to one or more valves.

    The `action` is ``open``, ``close``, ``stop`` or a position to go to, 0..100 [%]. `valves` is
    one or more valve numbers, counted from 1; None means all valves.

    Examples
    --------
    >>> Command("open", 3.0, valves=range(1, 4)).valves
    (1, 2, 3)
    >>> Command(40, 5.0).position
    40.0
    """

    action: str | float
    time: float = number(0, 1e9, "s", "Time at which the command is given", default=0.0)
    valves: int | Iterable[int] | None = None

    def __post_init__(self) -> None:
        check_fields(self)
        object.__setattr__(self, "action", check_action(self.action, ACTIONS))
        object.__setattr__(self, "valves", _numbers(self.valves))

    @property
    def position(self) -> float | None:
        """The commanded position [%]; None for any other command."""
        return None if isinstance(self.action, str) else self.action

    @property
    def kind(self) -> str:
        """The action in one word: ``open``, ``close``, ``stop`` or ``position``."""
        return self.action if isinstance(self.action, str) else "position"

    def mask(self, n_valves: int) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
        """Return a mask of the commanded valves among `n_valves`, valve 1 first."""
        count = check_whole("n_valves", n_valves, 1, 10_000)
        return np.isin(np.arange(count), _places(self.valves, count))

    @classmethod
    def random(
        cls,
        n_valves: int = 256,
        *,
        until: float = 86400.0,
        operations: int = 6,
        group: int = 16,
        rng: Any = None,
    ) -> list[Command]:
        """Return a random plan in which all valves alternately open and close, one group at a time.

        Each valve gets `operations` commands up to the time `until` [s]. Groups of `group` valves
        start 30 s apart. While any motor runs, all valves are read at 10 Hz by default, so a plan
        in which motors run together is simulated faster. The paper gives no plan; this one is ours.
        """
        valves = check_whole("n_valves", n_valves, 1, 10_000)
        times = check_whole("operations", operations, 1, 1000)
        size = check_whole("group", group, 1, valves)
        lasts = -(-valves // size) * _GROUP_PAUSE
        share = check_scalar("until", until, "s", 0, 1e8) / times
        if share < lasts:
            raise ArgumentError(
                f"until is {until:g} s; {times} operations of {lasts:g} s take {times * lasts:g} s"
            )
        plan, generator = [], check_rng(rng)
        for turn in range(times):
            begin = turn * share + generator.uniform(0, share - lasts)
            order = generator.permutation(valves)
            for group_number, first in enumerate(range(0, valves, size)):
                members = [int(valve) + 1 for valve in order[first : first + size]]
                when = begin + group_number * _GROUP_PAUSE
                plan.append(cls(("open", "close")[turn % 2], when, valves=members))
        return plan


#: How severity s changes a parameter or reading: linearly, as a power, towards infinity, or by
#: addition. A severity of 0 leaves the value unchanged to the last bit.
_LAWS = {
    "linear": lambda number, value, s: number * (1 + (value - 1) * s),
    "power": lambda number, value, s: number * value**s,
    "stuck": lambda number, value, s: number / np.maximum(1 - s, 0.0),
    "added": lambda number, value, s: number + value * s,
}


#: Meaning of each fault by its code in the rule table, and the changes that it causes: the
#: parameter or reading, the law, and its value.
FAULTS: dict[str, tuple[str, tuple[tuple[str, str, float], ...]]] = {
    "G1": ("pressure gauge reads too high", (("FP", "added", 125.0),)),
    "P1": (
        "discharge blocked and pump seizing",
        (("restrictor", "linear", 0.02), ("friction", "added", 10.6)),
    ),
    "P2": ("pump leaks inside", (("pump_leak", "power", 821.0),)),
    "V1": ("valve stuck", (("bearing_torque", "stuck", np.inf),)),
    "V2": ("piston leaks", (("piston_leak", "power", 6000.0),)),
    "O1": ("motor no longer cooled", (("cooling", "linear", 0.1),)),
    "S1": ("position reads too high, cylinder vented", (("VPos", "added", 5.0),)),
    "S2": ("position reads too low, cylinder vented", (("VPos", "added", -5.0),)),
    "Pos1": (
        "position reads too high, pressure trapped",
        (("VPos", "added", 5.0), ("trapped", "added", 1.0)),
    ),
    "Pos2": (
        "position reads too low, pressure trapped",
        (("VPos", "added", -5.0), ("trapped", "added", 1.0)),
    ),
    "Pos3": ("position reads far too high", (("VPos", "added", 15.0),)),
    "Pos4": ("position reads far too low", (("VPos", "added", -15.0),)),
}


@record
class Fault(TimedFault):
    """A fault of one or more valves.

    `valves` is one or more valve numbers, counted from 1; None means all valves. When a fault ends,
    a valve stays where the fault left it. A motor whose cooling is already faulty at time 0 starts
    at the temperature that it would have reached over earlier strokes.

    Examples
    --------
    >>> fault = Fault.parse("3:P2:0.5")
    >>> fault.code, fault.severity, fault.valves
    ('P2', 0.5, (3,))
    """

    code: str = choice(tuple(FAULTS), "Code in the rule table")
    severity: float | Floats = number(
        0,
        1,
        "",
        "0 is healthy; an array has one value for each of `valves`",
        default=1.0,
        many=True,
    )
    valves: int | Iterable[int] | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "valves", _numbers(self.valves))

    def severities(self, n_valves: int) -> Floats:
        """Return the severity for each valve, shape (n_valves,)."""
        count = check_whole("n_valves", n_valves, 1, 10_000)
        places, size = _places(self.valves, count), np.size(self.severity)
        if np.ndim(self.severity) and size != len(places):
            raise ArgumentError(
                f"severity of {self.code} has {size} values for {len(places)} valves"
            )
        severities = np.zeros(count)
        severities[places] = self.severity
        return severities

    @classmethod
    def parse(cls, fault: str, n_valves: int = 247) -> Fault:
        """Return the fault that a text such as ``3:V1:0.8`` describes: valve, code, severity."""
        parts, most = fault.split(":"), check_whole("n_valves", n_valves, 1, 10_000)
        try:
            if len(parts) not in (2, 3):
                raise ValueError
            unit, severity = int(parts[0]), float(parts[2]) if parts[2:] else 1.0
        except ValueError:
            raise ArgumentError(
                f"fault is {fault!r}; it must be VALVE:CODE or VALVE:CODE:SEVERITY, "
                "such as 3:V1:0.8"
            ) from None
        try:
            return cls(parts[1], severity, valves=check_whole("valve", unit, 1, most))
        except ArgumentError as error:
            raise ArgumentError(f"fault {fault!r}: {error}") from None

    @classmethod
    def random(
        cls,
        n_faults: int,
        *,
        n_valves: int = 256,
        until: float = 86400.0,
        severity: float | tuple[float, float] = 1.0,
        rng: Any = None,
    ) -> list[Fault]:
        """Return faults that begin at random times up to `until` [s], each on a different valve.

        The numbers of faults per code differ by at most one. `severity` is one value for all
        faults, 0..1, or the range (lowest, highest) from which each value is drawn.
        """
        valves = check_whole("n_valves", n_valves, 1, 10_000)
        count = check_whole("n_faults", n_faults, 0, valves)
        end = check_scalar("until", until, "s", 0, 1e8)
        low, high = severity if isinstance(severity, tuple) else (severity, severity)
        low = check_scalar("severity", low, "", 0, 1)
        high = check_scalar("severity", high, "", low, 1)
        generator = check_rng(rng)
        names = np.resize(np.array(list(FAULTS), dtype=object), count)
        generator.shuffle(names)
        where = generator.choice(valves, count, replace=False)
        when, how = np.sort(generator.uniform(0, end, count)), generator.uniform(low, high, count)
        return [
            cls(code, float(s), int(valve) + 1, start=float(t))
            for code, s, t, valve in zip(names, how, when, where, strict=True)
        ]


def faulty(actuator: Actuator, faults: Iterable[Fault], n_valves: int) -> tuple[Actuator, Floats]:
    """Return the actuator with the faults applied, and the sensor offsets, shape (5, n_valves)."""
    sensors = [channel.name for channel in CHANNELS]
    offsets = np.zeros((len(sensors), n_valves))
    numbers: dict[str, Any] = {}
    for fault in faults:
        severity = fault.severities(n_valves)
        for target, law, value in FAULTS[fault.code][1]:
            if target in sensors:
                offsets[sensors.index(target)] += value * severity
                continue
            number = numbers.get(target, getattr(actuator, target))
            with np.errstate(divide="ignore"):
                numbers[target] = _LAWS[law](number, value, severity)
    if "trapped" in numbers:
        numbers["trapped"] = np.minimum(numbers["trapped"], 1.0)
    return replace(actuator, **numbers), offsets


class Movement(NamedTuple):
    """A motor run that has ended."""

    valve: int
    action: str
    start: float
    end: float
    opening: float
    outcome: str


class Plant:
    """The valves at the present time, which can only advance.

    The state of a valve is its opening and its motor temperature. Commands and faults take effect
    at the first reading at or after their time. Between two readings a valve turns at its mid-step
    speed, and it stops exactly at its target, not at the next reading. Limit switches act at the
    true ends of travel; a commanded position is compared with the potentiometer reading.
    """

    def __init__(self, system: System | int = 1, faults: Any = (), rng: Any = None) -> None:
        self.system = as_system(system)
        self.n_valves, self.step = self.system.n_valves, self.system.step
        self._healthy, self.sensors = self.system.actuator, self.system.sensors
        self.faults: tuple[Any, ...] = as_faults(faults, Fault)
        self._rng = None if rng is None else check_rng(rng)
        times = {time for fault in self.faults for time in (fault.start, fault.stop)} - {inf}
        #: Indices of the readings at which a fault begins or ends.
        self.changes = sorted(map(self.ticks, times))
        n = self.n_valves
        self.tick = 0
        self.opening = np.array(np.broadcast_to(self.system.opening, n), float)
        self.running, self.active = np.zeros(n, bool), np.zeros(n, bool)
        self.direction, self.ran = np.zeros(n, int), np.zeros(n, int)
        self.started, self.last_run = np.zeros(n), np.zeros(n)
        self.latest, self.deadline = np.full(n, np.inf), np.full(n, np.inf)
        self.movements: list[Movement] = []
        self.watchers: list[Callable[[], None]] = []
        self._target, self._action = np.full(n, np.nan), ["open"] * n
        self._load: Floats | None
        self._driven: Hydraulics | None
        self._change()
        # In earlier strokes the valve was healthy, except that its motor may not have been cooled.
        before = replace(self._healthy, cooling=self._actuator.cooling)
        self.temperature = np.broadcast_to(steady_temperature(before), n).copy()
        self.readings, self._measured, self._stale = np.zeros((5, n)), -1, True

    @property
    def time(self) -> float:
        """Time of the plant [s]."""
        return self.tick * self.step

    @property
    def _busy(self) -> bool:
        return bool(np.count_nonzero(self.running))  # five times as fast as any()

    @property
    def run_time(self) -> Floats:
        """Time for which each motor has been running at this reading [s]; NaN if it is off."""
        return np.where(self.running, (self.ran - 1) * self.step, np.nan)

    def ticks(self, time: float) -> int:
        """Return the index of the first reading at or after a time."""
        return ceil(time / self.step - 1e-6)

    def order(self, command: Command) -> None:
        """Carry out a command now, whatever its time."""
        meant = command.mask(self.n_valves)
        outcome = "stopped" if command.kind == "stop" else "replaced"
        self._stop(meant & self.running, self.time, outcome)
        self._stale = True
        self.active[meant] = False
        if command.kind == "stop":
            return
        self._target[meant] = np.nan
        if command.position is not None:
            seen = self.sensors.read(self._truth() + self._offsets)[_VPOS]
            gap = command.position - seen
            self.direction[meant] = np.where(gap < 0, -1, 1)[meant]
            self._target[meant] = command.position
            meant = meant & (np.abs(gap) > DEAD_BAND)
        else:
            self.direction[meant] = 1 if command.kind == "open" else -1
        self._load = self._driven = None
        there = np.where(self.direction > 0, self.opening >= 1, self.opening <= 0)
        meant = meant & ~there
        self.running[meant] = self.active[meant] = True
        self.ran[meant] = 0
        self.started[meant] = self.time
        allowed = np.broadcast_to(np.asarray(self._actuator.motor_time), self.n_valves)
        self.latest[meant] = self.deadline[meant] = self.time + allowed[meant]
        for valve in np.flatnonzero(meant):
            self._action[valve] = command.kind

    def measure(self) -> Floats:
        """Read the sensors; if there is an `rng`, each reading has new random noise."""
        self.ran = np.where(self.running, self.ran + (self._measured != self.tick), 0)
        self.readings = self.sensors.read(self._truth() + self._offsets, self._rng)
        self._measured, self._stale = self.tick, False
        for look in self.watchers:
            look()
        return self.readings

    def advance(self, ticks: int = 1) -> None:
        """Advance time by `ticks` (1 while a motor runs); stop motors at their targets."""
        heat: npt.ArrayLike = 0.0
        if self._busy:
            if self._stale or self._measured != self.tick:
                self.measure()
            heat = self._turn()
        aim, fading = self._cooling(ticks, heat)
        self.temperature = aim + (self.temperature - aim) * fading
        self._pass(ticks)

    def rest(self, count: int, ticks: int) -> Floats:
        """Return `count` readings, `ticks` apart, while no motor runs and no fault changes."""
        truth = np.repeat((self._truth() + self._offsets)[np.newaxis], count, axis=0)
        aim, fading = self._cooling(ticks, 0.0)
        for row in truth:
            row[_OT] = self.temperature + self._offsets[_OT]
            self.temperature = aim + (self.temperature - aim) * fading
        self.ran = np.zeros_like(self.ran)
        readings = self.sensors.read(truth, self._rng)
        self._pass(count * ticks)
        return readings

    def _cooling(self, ticks: int, heat: npt.ArrayLike) -> tuple[Floats, Floats]:
        """Return the final temperatures, and the fraction of the gap to them left after `ticks`."""
        cooling = np.asarray(self._actuator.cooling)
        aim = np.asarray(self._actuator.ambient + heat / cooling)
        return aim, np.exp(-cooling * (ticks * self.step) / self._actuator.heat_capacity)

    def _pass(self, ticks: int) -> None:
        self.tick += ticks
        if self.tick >= self._next_change:
            self._change()

    def run_until(self, time: float) -> Floats:
        """Advance time to the last reading at or before a time."""
        last = floor(time / self.step + 1e-6)
        while self.tick < last:
            jump = 1 if self._busy else min(last, self._next_change) - self.tick
            self.advance(int(jump))
        if self._stale or self._measured != self.tick:
            self.measure()
        return self.readings

    def _turn(self) -> Floats:
        """Move the valves for a step; return the mean heat of each motor [W]."""
        dt, way = self.step, self.direction
        now, volume = self._state(), self._volume
        half = self.opening + way * now.flow / volume * dt / 2
        speed = self._oil.state(load_pressure(self._actuator, half, way)).flow / volume
        to_limit = np.where(way > 0, 1 - self.opening, self.opening)
        to_target = np.maximum(way * (self._target - self.readings[_VPOS]) / 100, 0.0)
        distance = np.fmin(to_limit, to_target)  # NaN without a target
        arrives = self.running & (speed * dt >= distance) & (speed > 0)
        # A reading past the target stops the motor even if the valve cannot move.
        arrives |= self.running & (distance <= 0)
        lasted = np.where(self.running, dt, 0.0)
        if np.count_nonzero(arrives):
            np.divide(distance, speed, out=lasted, where=arrives & (speed > 0))
            lasted = np.where(arrives & (distance <= 0), 0.0, lasted)
        late = self.running & (self.time + lasted > self.deadline)
        if np.count_nonzero(late):
            lasted = np.where(late, np.maximum(self.deadline - self.time, 0.0), lasted)
            arrives &= ~late
        at_limit = arrives & (to_limit <= np.where(np.isnan(to_target), np.inf, to_target))
        moved = self.opening + way * speed * lasted * self.running
        self.opening = np.where(at_limit, way > 0, np.minimum(np.maximum(moved, 0), 1))
        self._load = self._driven = None
        self._stop(late, self.time + lasted, "time")
        self._stop(at_limit, self.time + lasted, "limit")
        self._stop(arrives & ~at_limit, self.time + lasted, "position")
        self.active &= ~arrives
        return losses(self._actuator, now.pump_pressure) * lasted / self.step

    def _stop(self, which: Bools, when: npt.ArrayLike, outcome: str) -> None:
        if not np.count_nonzero(which):
            return
        ends = np.broadcast_to(np.asarray(when, float), self.n_valves)
        for valve in np.flatnonzero(which):
            start, end = float(self.started[valve]), float(ends[valve])
            action, position = self._action[valve], float(self.opening[valve])
            self.movements.append(Movement(int(valve), action, start, end, position, outcome))
            self.last_run[valve] = end - start
        self.running &= ~which

    def _loaded(self) -> Floats:
        """Return the load pressure of the valves in their present positions."""
        if self._load is None:
            self._load = load_pressure(self._actuator, self.opening, self.direction)
        return self._load

    def _state(self) -> Hydraulics:
        """Return the state of the oil in the present positions, as if all motors ran."""
        if self._driven is None:
            self._driven = self._oil.state(self._loaded())
        return self._driven

    def _truth(self) -> Floats:
        """Return the readings of ideal sensors, without offsets."""
        a, on = self._actuator, self.running
        truth = np.zeros((5, self.n_valves))
        busy, resting = self._busy, np.asarray(a.trapped)
        if busy or np.count_nonzero(resting):
            load = self._loaded()
            # The lock valve also holds the load of a stuck valve if that load is finite.
            kept = np.where(resting > 0, np.where(np.isfinite(load), load, 0.0) * resting, 0.0)
            truth[1] = kept / 1e5
            if busy:
                state = self._state()
                truth[0] = np.where(on, state.pump_pressure, 0.0) / 1e5
                truth[1] = np.where(on, state.cylinder_pressure, kept) / 1e5
                truth[2] = np.where(on, motor_current(a, state.pump_pressure), 0.0)
        truth[_OT] = self.temperature
        truth[_VPOS] = 100 * self.opening
        return truth

    def _change(self) -> None:
        """Apply the present faults."""
        for fault in self.faults:
            fault.severities(self.n_valves)  # refuse an unknown valve before the fault is due
        now = self.tick * self.step + 1e-6 * self.step
        due = [fault for fault in self.faults if fault.start <= now < fault.stop]
        self._actuator, self._offsets = faulty(self._healthy, due, self.n_valves)
        self._oil, self._volume = Oil(self._actuator), np.asarray(self._actuator.stroke_volume)
        self._load = self._driven = None
        later = [change for change in self.changes if change > self.tick]
        self._next_change = later[0] if later else inf
