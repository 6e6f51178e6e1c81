"""Commands, and valves that carry them out: relays, limit switches, sensors, step by step.

Opening and motor temperature are the state; pressures and current follow from them at every
instant.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from math import ceil, floor
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from shipnet.ballast.actuator import (
    Actuator,
    Hydraulics,
    Oil,
    load_pressure,
    losses,
    motor_current,
    steady_temperature,
)
from shipnet.ballast.sensors import Sensors
from shipnet.ballast.valve_faults import Fault, faulty
from shipnet.errors import ArgumentError
from shipnet.fields import check_scalar, check_whole

#: What a command may ask for.
ACTIONS = ("open", "close", "position", "stop")


@dataclass(frozen=True)
class Command:
    """A command to some valves.

    Parameters
    ----------
    action : str
        ``open``, ``close``, ``position`` or ``stop``.
    time : float, default 0
        When it is given [s].
    position : float or None, default None
        Where to go, 0..100 [%]; only and always with ``position``.
    valves : int, sequence of int or None, default None
        Which valves, counted from 0; None is all.

    Raises
    ------
    ArgumentError
        If a field is out of its range.

    Examples
    --------
    >>> Command("position", 5.0, position=40, valves=[0, 7]).valves
    (0, 7)
    """

    action: str
    time: float = 0.0
    position: float | None = None
    valves: int | Iterable[int] | None = None

    def __post_init__(self) -> None:
        """Check every field."""
        if self.action not in ACTIONS:
            raise ArgumentError(
                f"action is {self.action!r}; it must be one of {', '.join(ACTIONS)}"
            )
        object.__setattr__(self, "time", check_scalar("time", self.time, "s", 0, 1e9))
        if (self.position is None) == (self.action == "position"):
            raise ArgumentError(
                f"position is {self.position!r} with action {self.action!r}; it belongs to "
                "'position', and must be given there"
            )
        if self.position is not None:
            position = check_scalar("position", self.position, "%", 0, 100)
            object.__setattr__(self, "position", position)
        if self.valves is not None:
            many = self.valves if isinstance(self.valves, Iterable) else (self.valves,)
            checked = tuple(check_whole("valve", valve, 0, 9_999) for valve in many)
            object.__setattr__(self, "valves", checked)

    def mask(self, n_valves: int) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
        """Return which of so many valves are meant."""
        if self.valves is None:
            return np.ones(n_valves, bool)
        meant = np.zeros(n_valves, bool)
        for valve in self.valves:  # type: ignore[union-attr]
            meant[check_whole("valve", valve, 0, n_valves - 1)] = True
        return meant


class Movement(NamedTuple):
    """A run of a motor that has ended."""

    valve: int
    action: str
    start: float
    end: float
    opening: float
    outcome: str


Floats = npt.NDArray[np.float64]


Flags = npt.NDArray[np.bool_]


#: A valve so near to the position asked for does not start [%]; our assumption.
DEAD_BAND = 0.5


#: Where the readings of temperature and position stand.
_OT, _VPOS = 3, 4


class Plant:
    """Valves whose state is known at one time, which only moves on.

    Commands and faults take effect at the first reading not before their time. Between two
    readings a valve turns with the speed of the middle of its way. The controller is quicker than
    `step`: a valve stops where it should, not at the next reading. A limit switch feels the true
    end; a position is judged by the potentiometer.
    """

    def __init__(
        self,
        actuator: Actuator | None = None,
        *,
        n_valves: int | None = None,
        sensors: Sensors | None = None,
        faults: Iterable[Fault] = (),
        opening: npt.ArrayLike = 0.0,
        step: float = 0.1,
        rng: np.random.Generator | None = None,
    ) -> None:
        self._healthy = actuator if actuator is not None else Actuator()
        known = self._healthy.n_valves
        wanted = n_valves if n_valves is not None else known or 1
        self.n_valves = check_whole("n_valves", wanted, 1, 10_000)
        if known not in (None, self.n_valves):
            raise ArgumentError(f"n_valves is {n_valves}; the actuator has numbers for {known}")
        self.sensors = sensors if sensors is not None else Sensors()
        self.step = check_scalar("step", step, "s", 1e-3, 1.0)
        self.faults = list(faults)
        self._rng = rng
        self._starts = sorted({self.ticks(fault.start) for fault in self.faults})
        place = np.asarray(opening, float)
        if place.shape not in ((), (self.n_valves,)) or not ((place >= 0) & (place <= 1)).all():
            raise ArgumentError(
                f"opening is {opening!r}; it must be 0..1, one for all or one for each of "
                f"{self.n_valves} valves"
            )
        n = self.n_valves
        self.tick = 0
        self.opening = np.broadcast_to(place, n).copy()
        self.running, self.active = np.zeros(n, bool), np.zeros(n, bool)
        self.direction, self.ran = np.zeros(n, int), np.zeros(n, int)
        self.started, self.last_run = np.zeros(n), np.zeros(n)
        self.latest, self.deadline = np.full(n, np.inf), np.full(n, np.inf)
        self.movements: list[Movement] = []
        self.watchers: list[Callable[[], None]] = []
        self._target, self._action = np.full(n, np.nan), ["open"] * n
        self._load: Floats | None
        self._driven: Hydraulics | None
        self._break()
        # The strokes before were those of a healthy valve, but perhaps without cooling.
        before = replace(self._healthy, cooling=self._actuator.cooling)
        self.temperature = np.broadcast_to(steady_temperature(before), n).copy()
        self.readings, self._measured, self._stale = np.zeros((5, n)), -1, True

    @property
    def time(self) -> float:
        """Time of the plant [s]."""
        return self.tick * self.step

    @property
    def _busy(self) -> bool:
        return bool(np.count_nonzero(self.running))  # in a fifth of the time of any()

    def ticks(self, time: float) -> int:
        """Return the first reading that is not before a time."""
        return ceil(time / self.step - 1e-6)

    def order(self, command: Command) -> None:
        """Carry out a command now, whatever time it names."""
        meant = command.mask(self.n_valves)
        outcome = "stopped" if command.action == "stop" else "replaced"
        self._stop(meant & self.running, self.time, outcome)
        self._stale = True
        self.active[meant] = False
        if command.action == "stop":
            return
        self._target[meant] = np.nan
        if command.position is not None:
            seen = self.sensors.read(self._truth() + self._offsets)[_VPOS]
            gap = command.position - seen
            self.direction[meant] = np.where(gap < 0, -1, 1)[meant]
            self._target[meant] = command.position
            meant = meant & (np.abs(gap) > DEAD_BAND)
        else:
            self.direction[meant] = 1 if command.action == "open" else -1
        self._load = self._driven = None
        there = np.where(self.direction > 0, self.opening >= 1, self.opening <= 0)
        meant = meant & ~there
        self.running[meant] = self.active[meant] = True
        self.ran[meant] = 0
        self.started[meant] = self.time
        allowed = np.broadcast_to(np.asarray(self._actuator.motor_time), self.n_valves)
        self.latest[meant] = self.deadline[meant] = self.time + allowed[meant]
        for valve in np.flatnonzero(meant):
            self._action[valve] = command.action

    def measure(self) -> Floats:
        """Read the sensors, which draws noise."""
        self.ran = np.where(self.running, self.ran + (self._measured != self.tick), 0)
        self.readings = self.sensors.read(self._truth() + self._offsets, self._rng)
        self._measured, self._stale = self.tick, False
        for look in self.watchers:
            look()
        return self.readings

    def advance(self, ticks: int = 1) -> None:
        """Let time pass, and motors stop where they should."""
        count = check_whole("ticks", ticks, 1, 10**9)
        if count > 1 and (self._busy or self._next_start < self.tick + count):
            raise ArgumentError(f"ticks is {count}; it must be 1 here, for something happens")
        heat: npt.ArrayLike = 0.0
        if self._busy:
            if self._stale or self._measured != self.tick:
                self.measure()
            heat = self._turn()
        aim, fading = self._cooling(count, heat)
        self.temperature = aim + (self.temperature - aim) * fading
        self._pass(count)

    def rest(self, count: int, ticks: int) -> Floats:
        """Read the sensors and let time pass, again and again, while nothing happens."""
        many = check_whole("count", count, 1, 10**6)
        steps = check_whole("ticks", ticks, 1, 10**9)
        if self._busy or self._next_start < self.tick + many * steps or self.watchers:
            raise ArgumentError(f"count is {many}; something happens within {many * steps} steps")
        truth = np.repeat((self._truth() + self._offsets)[np.newaxis], many, axis=0)
        aim, fading = self._cooling(steps, 0.0)
        for row in truth:
            row[_OT] = self.temperature + self._offsets[_OT]
            self.temperature = aim + (self.temperature - aim) * fading
        self.ran = np.zeros_like(self.ran)
        readings = self.sensors.read(truth, self._rng)
        self._pass(many * steps)
        return readings

    def _cooling(self, ticks: int, heat: npt.ArrayLike) -> tuple[Floats, Floats]:
        """Return where the temperatures tend to, and how much of the way is left."""
        cooling = np.asarray(self._actuator.cooling)
        aim = np.asarray(self._actuator.ambient + heat / cooling)
        return aim, np.exp(-cooling * (ticks * self.step) / self._actuator.heat_capacity)

    def _pass(self, ticks: int) -> None:
        self.tick += ticks
        if self.tick >= self._next_start:
            self._break()

    def run_until(self, time: float) -> Floats:
        """Let time pass up to the last reading that is not after a time."""
        last = floor(time / self.step + 1e-6)
        while self.tick < last:
            jump = 1 if self._busy else min(last, self._next_start) - self.tick
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
        distance = np.fmin(to_limit, to_target)  # no target is NaN
        arrives = self.running & (speed * dt >= distance) & (speed > 0)
        # A reading that is past the target stops even a valve that cannot move.
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
        return losses(self._actuator, now.pump_pressure) * lasted / dt

    def _stop(self, which: Flags, when: npt.ArrayLike, outcome: str) -> None:
        if not np.count_nonzero(which):
            return
        ends = np.broadcast_to(np.asarray(when, float), self.n_valves)
        for valve in np.flatnonzero(which):
            start, end = float(self.started[valve]), float(ends[valve])
            action, place = self._action[valve], float(self.opening[valve])
            self.movements.append(Movement(int(valve), action, start, end, place, outcome))
            self.last_run[valve] = end - start
        self.running &= ~which

    def _loaded(self) -> Floats:
        """Return the pressure that the valves ask for, where they stand."""
        if self._load is None:
            self._load = load_pressure(self._actuator, self.opening, self.direction)
        return self._load

    def _state(self) -> Hydraulics:
        """Return the oil where the valves stand, as if all motors ran."""
        if self._driven is None:
            self._driven = self._oil.state(self._loaded())
        return self._driven

    def _truth(self) -> Floats:
        """Return what ideal sensors would read now, offsets left out."""
        a, on = self._actuator, self.running
        truth = np.zeros((5, self.n_valves))
        busy, resting = self._busy, np.asarray(a.trapped)
        if busy or np.count_nonzero(resting):
            load = self._loaded()
            # The lock valve keeps a stuck valve's load too, which has no bound: what is finite.
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

    def _break(self) -> None:
        """Let the faults begin that are due."""
        for fault in self.faults:
            fault.severities(self.n_valves)  # refuses a valve that is not there before it is due
        due = [fault for fault in self.faults if self.ticks(fault.start) <= self.tick]
        self._actuator, self._offsets = faulty(self._healthy, due, self.n_valves)
        self._oil, self._volume = Oil(self._actuator), np.asarray(self._actuator.stroke_volume)
        self._load = self._driven = None
        later = [start for start in self._starts if start > self.tick]
        self._next_start = later[0] if later else np.inf
