"""Simulation of many valves: commands and faults over time, and the sensor readings."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from math import ceil
from typing import Any

import numpy as np

from shipnet.ballast.diagnosis import Run
from shipnet.ballast.master import MasterRun, scan_fleet
from shipnet.ballast.plant import Command, Fault, Plant
from shipnet.ballast.scan import System, as_system
from shipnet.ballast.sensors import WINDOW, position_speed
from shipnet.clock import as_faults
from shipnet.errors import ArgumentError
from shipnet.fields import check_scalar, check_whole

#: Fields of a `Run` that have one row per instant.
_COLUMNS = ("time", "readings", "speed", "ran", "moving", "active", "opening")


def blocks(
    system: System | int,
    commands: Iterable[Command] = (),
    *,
    faults: Iterable[Fault] = (),
    until: float,
    idle_step: float = 1.0,
    rng: Any = None,
    size: int = 2000,
) -> Iterator[Run]:
    """Simulate valves in consecutive runs, because one long run may not fit into memory."""
    plant = Plant(system, faults, rng)
    last = plant.ticks(check_scalar("until", until, "s", 0, 1e8))
    idle = check_scalar("idle_step", idle_step, "s", plant.step, 3600)
    most = check_whole("size", size, 1, 10**6)
    orders = sorted(commands, key=lambda command: command.time)
    for command in orders:
        command.mask(plant.n_valves)
    events = {*plant.changes, *(plant.ticks(command.time) for command in orders)}
    pause = max(round(idle / plant.step), 1)
    return record(plant, orders, sorted(events), last, pause, most)


def simulate(
    system: System | int = 1,
    commands: Iterable[Command] = (),
    *,
    faults: Any = (),
    until: float,
    idle_step: float | None = None,
    rng: Any = None,
) -> Run | MasterRun:
    """Simulate valves, and the master that scans them if the system has a poll.

    Parameters
    ----------
    system : System or int
        The valves, or their number if they are commanded and read directly.
    commands : iterable of Command, optional
        Commands to the valves, in any order. A master sends one at a time, between polls.
    faults : Fault or iterable of Fault, optional
        Faults of the valves and, with a master, of the line (`shipnet.modbus`).
    until : float
        End time, 0..1e8 [s]; with a master 0..1e5 [s].
    idle_step : float, optional
        Time between two readings while no motor runs, from the system's `step` (the default) to
        3600 [s]. It applies only without a master.
    rng : Generator, int or None, optional
        Source of the sensors' noise, for `numpy.random.default_rng`; no noise if omitted.

    Returns
    -------
    Run or MasterRun
        Readings, flags and movements; with a master, the data that it received and showed.

    Examples
    --------
    Four valves open; the pump of the last one leaks:

    >>> leak = Fault("P2", 0.5, valves=4)
    >>> run = simulate(4, [Command("open")], faults=leak, until=20, rng=2024)
    >>> run
    Run(20 s, 4 valves, 4 motor runs)
    >>> run.strokes()[["valve", "duration_s", "FP_bar"]].round().astype(int).values.tolist()
    [[1, 9, 90], [2, 9, 90], [3, 9, 90], [4, 17, 28]]
    """
    valves = as_system(system)
    several = as_faults(faults)
    if valves.poll is not None:
        return scan_fleet(valves, commands, several, until, rng)
    if others := [fault for fault in several if not isinstance(fault, Fault)]:
        raise ArgumentError(f"one of faults is {others[0]!r}; it requires a system with a poll")
    return simulate_valves(valves, commands, faults, until, idle_step, rng)


def simulate_valves(
    system: System,
    commands: Iterable[Command],
    faults: Any,
    until: float,
    idle_step: float | None = None,
    rng: Any = None,
) -> Run:
    """Simulate valves without a master."""
    idle = system.step if idle_step is None else idle_step
    pieces = list(blocks(system, commands, faults=faults, until=until, idle_step=idle, rng=rng))
    columns = {
        name: np.concatenate([getattr(piece, name) for piece in pieces]) for name in _COLUMNS
    }
    return Run(**columns, movements=tuple(moved for piece in pieces for moved in piece.movements))


def record(
    plant: Plant, orders: list[Command], events: list[int], last: int, pause: int, size: int
) -> Iterator[Run]:
    """Advance the plant to tick `last`; yield its readings in runs of up to `size` instants."""
    n, window = plant.n_valves, ceil(WINDOW / plant.step - 1e-6)
    before, since = np.empty((0, n)), np.empty(0)
    due = ordered = 0
    done = False
    while not done:
        time, readings = np.empty(size), np.empty((size, 5, n))
        moving, active = np.zeros((2, size, n), bool)
        opening, ran = np.empty((size, n)), np.full((size, n), np.nan)
        row = 0
        while row < size and not done:
            while ordered < len(orders) and plant.ticks(orders[ordered].time) <= plant.tick:
                plant.order(orders[ordered])
                ordered += 1
            while due < len(events) and events[due] <= plant.tick:
                due += 1
            upcoming = min(events[due], last) if due < len(events) else last
            calm = 0 if plant.running.any() else min((upcoming - plant.tick) // pause, size - row)
            if calm:
                rows = slice(row, row + calm)
                time[rows] = (plant.tick + pause * np.arange(calm)) * plant.step
                opening[rows], active[rows] = plant.opening, plant.active
                readings[rows] = plant.rest(calm, pause)
                row += calm
                continue
            readings[row] = plant.measure()
            time[row], opening[row] = plant.time, plant.opening
            ran[row], active[row] = plant.run_time, plant.active
            was = plant.opening
            row += 1
            done = plant.tick >= last
            if not done:
                plant.advance(1 if plant.running.any() else upcoming - plant.tick)
                moving[row - 1] = plant.opening != was
        places = np.concatenate([before, readings[:row, 4]])
        instants, kept = np.concatenate([since, time[:row]]), len(since)
        speed = position_speed(instants, places)[kept:]
        before, since = places[-window:], instants[-window:]
        movements, plant.movements = tuple(plant.movements), []
        yield Run(
            time[:row],
            readings[:row],
            speed,
            ran[:row],
            moving[:row],
            active[:row],
            opening[:row],
            movements,
        )
