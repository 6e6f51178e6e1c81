"""Many valves with their relays, limit switches and sensors, a step of time at once.

Opening and motor temperature are the state; pressures and current follow from them at every
instant.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from math import ceil, floor

import numpy as np
import numpy.typing as npt

from shipnet.ballast.actuator import Actuator
from shipnet.ballast.commands import Command
from shipnet.ballast.faults import Fault, faulty
from shipnet.ballast.hydraulics import Hydraulics, Oil, load_pressure
from shipnet.ballast.motor import losses, motor_current, steady_temperature
from shipnet.ballast.movement import Movement
from shipnet.ballast.sensors import Sensors
from shipnet.errors import ArgumentError
from shipnet.fields import check_scalar, check_whole

__all__ = ["DEAD_BAND", "Movement", "Plant"]

Floats = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]

#: A valve so near to the position asked for does not start [%]; our assumption.
DEAD_BAND = 0.5

#: Where the readings of temperature and position stand.
_OT, _VPOS = 3, 4


class Plant:
    """Valves whose state is known at one time, which only moves on.

    Parameters
    ----------
    actuator : Actuator, optional
        What they are; `Actuator` with its defaults if omitted.
    n_valves : int, default 1
        How many, 1..10000; what `actuator` has arrays for if it has any.
    sensors : Sensors, optional
        What measures them; `Sensors` with its defaults if omitted.
    faults : iterable of Fault, optional
        What is wrong with them, and from when on.
    opening : float or array_like of float, default 0
        Where they stand at time 0, 0..1.
    step : float, default 0.1
        Time between two readings while a motor runs, 1e-3..1 [s].
    rng : numpy.random.Generator, optional
        Draws the noise of the sensors; there is none if omitted.

    Attributes
    ----------
    opening, temperature : ndarray of float, shape (n_valves,)
        True opening, 0..1, and motor temperature [degC].
    running, active : ndarray of bool, shape (n_valves,)
        Motor runs; a command has not been fulfilled.
    direction : ndarray of int, shape (n_valves,)
        1 opens, -1 closes: the last command; 0 before the first.
    started, ran : ndarray, shape (n_valves,)
        When the motor was last started [s], and for how many readings it has been running in this
        direction.
    last_run : ndarray of float, shape (n_valves,)
        How long the motor ran last [s].
    latest, deadline : ndarray of float, shape (n_valves,)
        When a running motor is stopped by its motor time; and by that or a watchdog, which may set
        an earlier time [s].
    movements : list of Movement
        What has ended.
    watchers : list of callable
        Called without arguments after every reading of the sensors.

    Raises
    ------
    ArgumentError
        If an argument is out of its range.

    Notes
    -----
    Commands and faults take effect at the first reading not before their time. Between two
    readings a valve turns with the speed of the middle of its way. The controller is quicker than
    `step`: a valve stops where it should, not at the next reading. A limit switch feels the true
    end; a position is judged by the potentiometer.

    Examples
    --------
    >>> plant = Plant()
    >>> plant.order(Command("position", position=40))
    >>> while plant.running.any():
    ...     readings = plant.measure()
    ...     plant.advance()
    >>> plant.movements[0].outcome, round(plant.movements[0].end, 2), plant.opening.round(3)
    ('position', 3.6, array([0.4]))
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
        """Return the first reading that is not before a time.

        Parameters
        ----------
        time : float
            Time [s].

        Returns
        -------
        int
            Its number; reading 0 is at time 0.
        """
        return ceil(time / self.step - 1e-6)

    def order(self, command: Command) -> None:
        """Carry out a command now, whatever time it names.

        Parameters
        ----------
        command : Command
            What to do; a valve that runs the other way turns round at once.
        """
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
        """Read the sensors, which draws noise.

        Returns
        -------
        ndarray of float, shape (5, n_valves)
            FP, OP, MC, OT and VPos in their units; kept in `readings` too.
        """
        self.ran = np.where(self.running, self.ran + (self._measured != self.tick), 0)
        self.readings = self.sensors.read(self._truth() + self._offsets, self._rng)
        self._measured, self._stale = self.tick, False
        for look in self.watchers:
            look()
        return self.readings

    def advance(self, ticks: int = 1) -> None:
        """Let time pass, and motors stop where they should.

        Parameters
        ----------
        ticks : int, default 1
            How many steps; more than 1 only while no motor runs and no fault begins.

        Raises
        ------
        ArgumentError
            If a motor runs, or a fault begins on the way, and it is more than 1.
        """
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
        """Read the sensors and let time pass, again and again, while nothing happens.

        Parameters
        ----------
        count : int
            How often, 1..1e6.
        ticks : int
            Steps after each reading, 1..1e9.

        Returns
        -------
        ndarray of float, shape (count, 5, n_valves)
            The readings: those of `measure` and `advance` in turn, noise included.

        Raises
        ------
        ArgumentError
            If a motor runs, a fault begins on the way, or somebody watches.

        Examples
        --------
        >>> plant = Plant(sensors=Sensors.ideal(), faults=[Fault("O1")])
        >>> plant.rest(3, 600)[:, 3, 0].round(1).tolist(), plant.time
        ([95.3, 94.9, 94.5], 180.0)
        """
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
        """Let time pass up to the last reading that is not after a time.

        Parameters
        ----------
        time : float
            Time [s]; nothing happens if it has passed already.

        Returns
        -------
        ndarray of float, shape (5, n_valves)
            The readings then.
        """
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
