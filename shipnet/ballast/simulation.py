"""Commands and faults over time, for many valves: what their sensors read."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from math import ceil
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from shipnet.ballast.actuator import Actuator
from shipnet.ballast.plant import Command, Fault, Movement, Plant
from shipnet.ballast.sensors import CHANNELS, WINDOW, Sensors, position_speed
from shipnet.errors import ArgumentError
from shipnet.fields import check_scalar, check_whole

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

    from shipnet.ballast.diagnosis import Diagnosis
    from shipnet.ballast.master import MasterRun
    from shipnet.ballast.scan import System
    from shipnet.fuzzy.rules import RuleBase


Floats = npt.NDArray[np.float64]


Flags = npt.NDArray[np.bool_]


#: Fields of a `Run` that have a row an instant.
_COLUMNS = ("time", "readings", "DVPos", "running", "moving", "active", "opening")


@dataclass(frozen=True, eq=False)
class Run:
    """What was read, one row per instant, as `simulate` returns it.

    Parameters
    ----------
    time : ndarray of float, shape (n_times,)
        When [s]; not evenly spaced if it was idle in between.
    readings : ndarray of float, shape (n_times, 5, n_valves)
        FP, OP [bar], MC [A], OT [degC], VPos [%].
    DVPos : ndarray of float, shape (n_times, n_valves)
        By how much VPos has changed within the last second, up or down [%/s]; NaN unless the motor
        has been running in one direction for all of it.
    running, moving, active : ndarray of bool, shape (n_times, n_valves)
        The motor runs; the valve turns; a command has not been fulfilled.
    opening : ndarray of float, shape (n_times, n_valves)
        True opening, 0..1, which no sensor knows.
    movements : tuple of Movement
        Runs of motors that ended meanwhile.

    Examples
    --------
    >>> from shipnet.ballast.simulation import simulate
    >>> run = simulate(1, [Command("open", 1.0)], until=12)
    >>> run.VPos[::20, 0].round().tolist()
    [0.0, 11.0, 33.0, 56.0, 78.0, 100.0, 100.0]
    """

    time: Floats
    readings: Floats
    DVPos: Floats
    running: Flags
    moving: Flags
    active: Flags
    opening: Floats
    movements: tuple[Movement, ...]

    @property
    def n_valves(self) -> int:
        """Number of valves."""
        return int(self.readings.shape[2])

    @property
    def FP(self) -> Floats:
        """Pump pressure, shape (n_times, n_valves) [bar]."""
        return self.readings[:, 0]

    @property
    def OP(self) -> Floats:
        """Operating pressure, shape (n_times, n_valves) [bar]."""
        return self.readings[:, 1]

    @property
    def MC(self) -> Floats:
        """Motor current, shape (n_times, n_valves) [A]."""
        return self.readings[:, 2]

    @property
    def OT(self) -> Floats:
        """Motor temperature, shape (n_times, n_valves) [degC]."""
        return self.readings[:, 3]

    @property
    def VPos(self) -> Floats:
        """Valve position, shape (n_times, n_valves) [%]."""
        return self.readings[:, 4]

    @property
    def samples(self) -> dict[str, Floats]:
        """All channels by their name in the rule table, DVPos included."""
        found = {channel.name: self.readings[:, k] for k, channel in enumerate(CHANNELS)}
        return found | {"DVPos": self.DVPos}

    def valve(self, valve: int) -> pd.DataFrame:
        """Return the columns of one valve, counted from 1, indexed by ``time_s``."""
        import pandas as pd

        k = check_whole("valve", valve, 1, self.n_valves) - 1
        columns = {c.column: self.readings[:, place, k] for place, c in enumerate(CHANNELS)}
        columns["DVPos_percent_per_s"] = self.DVPos[:, k]
        flags = {name: getattr(self, name)[:, k] for name in ("running", "moving", "active")}
        return pd.DataFrame(columns | flags, index=pd.Index(self.time, name="time_s"))

    def table(self) -> pd.DataFrame:
        """Return one row per instant and valve, indexed by ``valve`` and ``time_s``."""
        import pandas as pd

        tables = {k: self.valve(k) for k in range(1, self.n_valves + 1)}
        return pd.concat(tables, names=["valve"])

    def strokes(self) -> pd.DataFrame:
        """Return one row per run of a motor that has ended, from what sensors and clock say.

        ``valve``, ``action``, ``start_s``, ``end_s``, ``outcome``; ``duration_s``;
        ``travel_percent`` of VPos; ``stroke_s``, the time of a whole stroke at that speed (NaN for
        a way of less than 20 %); medians ``FP_bar``, ``MC_A`` and maxima ``OP_max_bar``,
        ``OT_max_degC`` while the motor ran.
        """
        return command_features(self)

    def diagnose(
        self,
        rules: RuleBase | None = None,
        method: str = "fuzzy",
        *,
        k: int = 3,
        n: int = 5,
        threshold: float = 0.5,
    ) -> Diagnosis:
        """Diagnose all valves at all instants; the rules are those of the paper by default.

        A code is active if its rule fired in `k` or more of the last `n` instants. `method` is
        ``fuzzy``, ``midpoint`` or ``crisp``; with the last, which takes the table as printed, DVPos
        counts at any time, with the others while a command is active only.
        """
        from shipnet.ballast.diagnosis import diagnose_run

        return diagnose_run(self, rules, method=method, k=k, n=n, threshold=threshold)

    def plot(self, valve: int = 1, ax: Axes | None = None) -> Axes:
        """Draw the sensors of a valve over time in percent of full scale, after Figure 12."""
        from shipnet.ballast.plot import plot_operation

        return plot_operation(self, ax, valve)

    def __repr__(self) -> str:
        """Return the time, and the numbers of valves and motor runs."""
        span = f"{self.time[-1] - self.time[0]:g} s, " if self.time.size else ""
        said = f"{self.n_valves} valve{'s' if self.n_valves != 1 else ''}"
        n = len(self.movements)
        return f"Run({span}{said}, {n} motor run{'s' if n != 1 else ''})"


def blocks(
    actuator: Actuator | None = None,
    commands: Iterable[Command] = (),
    *,
    duration: float,
    n_valves: int | None = None,
    faults: Iterable[Fault] = (),
    sensors: Sensors | None = None,
    opening: npt.ArrayLike = 0.0,
    step: float = 0.1,
    idle_step: float = 1.0,
    rng: np.random.Generator | None = None,
    size: int = 2000,
) -> Iterator[Run]:
    """Simulate valves piece by piece, for runs that do not fit into memory."""
    plant = Plant(
        actuator, n_valves=n_valves, sensors=sensors, faults=faults, opening=opening, step=step,
        rng=rng,
    )  # fmt: skip
    last = plant.ticks(check_scalar("duration", duration, "s", 0, 1e8))
    idle = check_scalar("idle_step", idle_step, "s", step, 3600)
    most = check_whole("size", size, 1, 10**6)
    try:
        orders = sorted(commands, key=lambda command: command.time)
    except (AttributeError, TypeError):
        raise ArgumentError(f"commands is {commands!r}; it must have `Command`s only") from None
    for command in orders:
        command.mask(plant.n_valves)
    events = {*plant.changes, *(plant.ticks(command.time) for command in orders)}
    pause = max(round(idle / plant.step), 1)
    return _record(plant, orders, sorted(events), last, pause, most)


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
        The valves; a number stands for plain valves that are commanded and read directly.
    commands : iterable of Command, optional
        What they are told, in any order. A master sends one for each valve, between two polls.
    faults : Fault or iterable of Fault, optional
        What is wrong, and from when on; also faults of the line (`shipnet.modbus`).
    until : float
        End time, 0..1e8 [s]; with a master 0..1e5 [s].
    idle_step : float, optional
        Time between two readings while no motor runs, `step`..3600 [s]; that of the system if
        omitted. Without a master only.
    rng : Generator, int or None, optional
        Draws the noise of the sensors, as `numpy.random.default_rng` takes it; there is no noise if
        omitted.

    Returns
    -------
    Run or MasterRun
        Readings, flags and movements; with a master what it received and showed.

    Raises
    ------
    ArgumentError
        If an argument is out of its range, or names a valve that is not there.

    Examples
    --------
    Four valves open; the pump of the last leaks:

    >>> leak = Fault("P2", 0.5, valves=4)
    >>> run = simulate(4, [Command("open")], faults=leak, until=20, rng=2024)
    >>> run
    Run(20 s, 4 valves, 4 motor runs)
    >>> run.strokes()[["valve", "duration_s", "FP_bar"]].round().astype(int).values.tolist()
    [[1, 9, 90], [2, 9, 90], [3, 9, 90], [4, 17, 28]]
    """
    from shipnet.ballast.scan import as_system

    valves = as_system(system)
    noise = None if rng is None else np.random.default_rng(rng)
    several = list(faults) if isinstance(faults, Iterable) else [faults]
    own = [fault for fault in several if isinstance(fault, Fault)]
    others = [fault for fault in several if not isinstance(fault, Fault)]
    if valves.poll is not None:
        from shipnet.ballast.master import scan_fleet

        return scan_fleet(valves, commands, own, others, until, noise)
    if others:
        raise ArgumentError(f"one of faults is {others[0]!r}; the system has no line, give a poll")
    return simulate_valves(valves, commands, own, until, idle_step, noise)


def simulate_valves(
    system: System,
    commands: Iterable[Command],
    faults: list[Fault],
    until: float,
    idle_step: float | None,
    rng: np.random.Generator | None,
) -> Run:
    """Simulate valves without a master."""
    pieces = list(
        blocks(
            system.actuator, commands, duration=check_scalar("until", until, "s", 0, 1e8),
            n_valves=system.n_valves, faults=faults, sensors=system.sensors, opening=system.opening,
            step=system.step, rng=rng, idle_step=system.step if idle_step is None else idle_step,
        )
    )  # fmt: skip
    columns = {
        name: np.concatenate([getattr(piece, name) for piece in pieces]) for name in _COLUMNS
    }
    return Run(**columns, movements=tuple(moved for piece in pieces for moved in piece.movements))


def _record(
    plant: Plant, orders: list[Command], events: list[int], last: int, pause: int, size: int
) -> Iterator[Run]:
    """Step the plant until its last tick, and yield what it read."""
    n, window = plant.n_valves, ceil(WINDOW / plant.step - 1e-6)
    before, since = np.empty((0, n)), np.empty(0)
    due = told = 0
    done = False
    while not done:
        time, readings = np.empty(size), np.empty((size, 5, n))
        flags, opening = np.zeros((3, size, n), bool), np.empty((size, n))
        ran = np.zeros((size, n), int)
        row = 0
        while row < size and not done:
            while told < len(orders) and plant.ticks(orders[told].time) <= plant.tick:
                plant.order(orders[told])
                told += 1
            while due < len(events) and events[due] <= plant.tick:
                due += 1
            upcoming = min(events[due], last) if due < len(events) else last
            calm = 0 if plant.running.any() else min((upcoming - plant.tick) // pause, size - row)
            if calm:
                rows = slice(row, row + calm)
                time[rows] = (plant.tick + pause * np.arange(calm)) * plant.step
                opening[rows], flags[2, rows] = plant.opening, plant.active
                readings[rows] = plant.rest(calm, pause)
                row += calm
                continue
            readings[row] = plant.measure()
            time[row], opening[row], ran[row] = plant.time, plant.opening, plant.ran
            flags[0, row], flags[2, row] = plant.running, plant.active
            was = plant.opening
            row += 1
            done = plant.tick >= last
            if not done:
                plant.advance(1 if plant.running.any() else upcoming - plant.tick)
                flags[1, row - 1] = plant.opening != was
        earlier = np.concatenate([before, readings[:row, 4]])
        instants, kept = np.concatenate([since, time[:row]]), len(since)
        lasted = np.concatenate([np.zeros((kept, n)), (ran[:row] - 1) * plant.step])
        rate = position_speed(instants, earlier, lasted)[kept:]
        before, since = earlier[-window:], instants[-window:]
        movements, plant.movements = tuple(plant.movements), []
        yield Run(
            time[:row], readings[:row], rate, flags[0, :row], flags[1, :row], flags[2, :row],
            opening[:row], movements,
        )  # fmt: skip


#: Shorter ways than this say little about a whole stroke [%]; our choice.
_SHORTEST = 20.0


def running_time(run: Run, before: npt.ArrayLike = np.nan) -> Floats:
    """Return for how long each motor has been running in its direction."""
    running, time = run.running, run.time
    if not time.size:
        return np.full(running.shape, np.nan)
    starts = running.copy()
    starts[1:] &= ~running[:-1]
    # A motor that was running before goes on, unless it has been told otherwise.
    goes_on = running[0] & np.isfinite(np.asarray(before, float))
    for moved in run.movements:
        # One that runs at the first instant after its end has been started again there.
        row = int(np.searchsorted(time, moved.end - 1e-9))
        if row < time.size and running[row, moved.valve]:
            starts[row, moved.valve] = True
            goes_on[moved.valve] &= row > 0
    began = np.where(starts, time[:, np.newaxis], -np.inf)
    began[0] = np.where(goes_on, before, began[0])
    since = time[:, np.newaxis] - np.maximum.accumulate(began, axis=0)
    return np.where(running, since, np.nan)


def stroke_rows(run: Run) -> pd.DataFrame:
    """Return the runs of motors that have ended: valve, action, times, opening, outcome."""
    import pandas as pd

    frame = pd.DataFrame(run.movements, columns=list(Movement._fields))
    frame["valve"] += 1
    frame["duration_s"] = frame["end"] - frame["start"]
    return frame.rename(columns={"start": "start_s", "end": "end_s"})


def command_features(run: Run) -> pd.DataFrame:
    """Return one row for every run of a motor that has ended, from what sensors and clock say."""
    import pandas as pd

    strokes = stroke_rows(run)
    rows = np.full((len(strokes), 5), np.nan)
    for row, moved in zip(rows, run.movements, strict=True):
        first, last = np.searchsorted(run.time, [moved.start - 1e-9, moved.end + 1e-9])
        if last - first < 1:
            continue
        seen = run.readings[first:last, :, moved.valve]
        # The reading after the end is that of the place where it stopped.
        place = run.readings[min(last, run.time.size - 1), 4, moved.valve]
        row[0] = abs(place - seen[0, 4])
        row[1:3] = np.median(seen[:, [0, 2]], axis=0)
        row[3:5] = seen[:, [1, 3]].max(axis=0)
    names = ["travel_percent", "FP_bar", "MC_A", "OP_max_bar", "OT_max_degC"]
    table = strokes.join(pd.DataFrame(rows, columns=names))
    far = table["travel_percent"].where(table["travel_percent"] >= _SHORTEST)
    table["stroke_s"] = 100 * table["duration_s"] / far
    return table


def valve_row(run: Run, time: float) -> int:
    """Return the last instant that is not after a time."""
    if not run.time.size:
        raise ArgumentError(f"time is {time!r}; the run has no instants")
    if not isinstance(time, int | float | np.number) or not time >= run.time[0] - 1e-9:
        raise ArgumentError(
            f"time is {time!r} s; it must be a number, and the run begins at {run.time[0]:g} s"
        )
    return int(np.searchsorted(run.time, time + 1e-9, side="right")) - 1


class Recorder:
    """Keeps what the sensors of a plant read while something else moves its time on."""

    def __init__(self, plant: Plant) -> None:
        self.plant = plant
        self._rows: list[tuple[float, Floats, Flags, Flags, Floats, npt.NDArray[np.int64]]] = []
        self._first = len(plant.movements)

    def take(self) -> None:
        """Keep what is read now; twice at the same time counts once."""
        plant = self.plant
        if self._rows and self._rows[-1][0] == plant.time:
            return
        readings = plant.run_until(plant.time)
        self._rows.append(
            (plant.time, readings.copy(), plant.running.copy(), plant.active.copy(),
             plant.opening.copy(), plant.ran.copy())
        )  # fmt: skip

    @property
    def run(self) -> Run:
        """What was kept."""
        if not self._rows:
            raise ArgumentError("nothing has been recorded")
        columns = [np.array(column) for column in zip(*self._rows, strict=True)]
        time, readings, running, active, opening, ran = columns
        # A reading taken at the start is the first of the motor's run.
        rate = position_speed(time, readings[:, 4], (ran - 1) * self.plant.step)
        moving = np.zeros_like(running)
        moving[:-1] = opening[1:] != opening[:-1]
        movements = tuple(self.plant.movements[self._first :])
        return Run(time, readings, rate, running, moving, active, opening, movements)
