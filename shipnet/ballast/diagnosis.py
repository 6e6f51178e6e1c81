"""Readings of valves over time, and their diagnosis by the rule table.

The faults are those of our own simulator and are made to fit the rules. Finding them verifies the
code but does not validate the method.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from math import inf
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from shipnet import style
from shipnet.arrays import Bools, Floats
from shipnet.ballast.plant import Movement, Plant
from shipnet.ballast.rule_table import rule_base
from shipnet.ballast.sensors import CHANNELS, WINDOW, position_speed, stroke_speed
from shipnet.errors import ArgumentError, some
from shipnet.fields import check_choice, check_scalar, check_whole
from shipnet.fuzzy.firing import METHODS
from shipnet.fuzzy.rules import Decision, Firing, RuleBase, all_normal
from shipnet.fuzzy.terms import NORMAL
from shipnet.html import as_html
from shipnet.lazy import Axes, pd

#: Full scale of each sensor on the operating display, in the sensor's unit.
_FULL = {"FP": 160.0, "OP": 10.0, "MC": 6.0, "OT": 150.0, "VPos": 100.0}

#: Time after a command ends during which codes are still attributed to it [s]; our choice.
_SETTLE = 5.0

#: Number of readings whose firing strengths are in memory at once: 25 MB for 12 rules.
_AT_ONCE = 2**18


@dataclass(frozen=True, eq=False)
class Run:
    """Readings of the sensors, one row per instant, as returned by `simulate`.

    Parameters
    ----------
    time : ndarray of float, shape (n_times,)
        Instants [s], not evenly spaced.
    readings : ndarray of float, shape (n_times, 5, n_valves)
        FP, OP [bar], MC [A], OT [degC], VPos [%].
    speed : ndarray of float, shape (n_times, n_valves)
        Absolute mean speed of VPos since the latest reading at least 1 s old [%/s]; NaN if none.
    ran : ndarray of float, shape (n_times, n_valves)
        Time since the present motor run began [s]; NaN while the motor is off.
    moving, active : ndarray of bool, shape (n_times, n_valves)
        True while the valve turns (`moving`), and while a command is in progress (`active`).
    opening : ndarray of float, shape (n_times, n_valves)
        True opening, 0..1, without errors of the position sensor.
    movements : tuple of Movement
        Motor runs that have ended.

    Examples
    --------
    >>> from shipnet.ballast import Command, simulate
    >>> run = simulate(1, [Command("open", 1.0)], until=12)
    >>> run.samples["VPos"][::20, 0].round().tolist()
    [0.0, 11.0, 33.0, 56.0, 78.0, 100.0, 100.0]
    """

    time: Floats
    readings: Floats
    speed: Floats
    ran: Floats
    moving: Bools
    active: Bools
    opening: Floats
    movements: tuple[Movement, ...]

    @property
    def n_valves(self) -> int:
        """Number of valves."""
        return int(self.readings.shape[2])

    @cached_property
    def DVPos(self) -> Floats:
        """Rate of change of VPos [%/s]; NaN unless the motor has run throughout the last second."""
        return stroke_speed(self.speed, self.ran)

    @cached_property
    def running(self) -> Bools:
        """Mask of the running motors, shape (n_times, n_valves)."""
        return ~np.isnan(self.ran)

    @property
    def samples(self) -> dict[str, Floats]:
        """Readings by sensor name, and DVPos, each of shape (n_times, n_valves)."""
        readings = {channel.name: self.readings[:, k] for k, channel in enumerate(CHANNELS)}
        return readings | {"DVPos": self.DVPos}

    def valve(self, valve: int) -> pd.DataFrame:
        """Return the columns of one valve, counted from 1, indexed by ``time_s``."""
        k = check_whole("valve", valve, 1, self.n_valves) - 1
        columns = {c.column: self.readings[:, channel, k] for channel, c in enumerate(CHANNELS)}
        columns["DVPos_percent_per_s"] = self.DVPos[:, k]
        flags = {name: getattr(self, name)[:, k] for name in ("running", "moving", "active")}
        return pd.DataFrame(columns | flags, index=pd.Index(self.time, name="time_s"))

    def table(self) -> pd.DataFrame:
        """Return one row per instant and valve, indexed by ``valve`` and ``time_s``."""
        tables = {k: self.valve(k) for k in range(1, self.n_valves + 1)}
        return pd.concat(tables, names=["valve"])

    def strokes(self) -> pd.DataFrame:
        """Return one row per motor run that has ended.

        Columns from the readings: ``travel_percent`` and, while the motor ran, the medians
        ``FP_bar`` and ``MC_A`` and the maxima ``OP_max_bar`` and ``OT_max_degC``.
        """
        strokes = stroke_rows(self)
        names = ["travel_percent", "FP_bar", "MC_A", "OP_max_bar", "OT_max_degC"]
        strokes[names] = np.nan
        for row, moved in enumerate(self.movements):
            first, last = np.searchsorted(self.time, [moved.start - 1e-9, moved.end + 1e-9])
            if first < last:
                fp, op, mc, ot, position = self.readings[first:last, :, moved.valve].T
                # The first reading after the run shows where the valve stopped.
                end = self.readings[min(last, self.time.size - 1), 4, moved.valve]
                travel = abs(end - position[0])
                strokes.loc[row, names] = travel, np.median(fp), np.median(mc), op.max(), ot.max()
        return strokes

    def diagnose(
        self,
        rules: RuleBase | None = None,
        method: str = "fuzzy",
        *,
        k: int = 3,
        n: int = 5,
        threshold: float = 0.5,
    ) -> Diagnosis:
        """Diagnose all valves at all instants, by default with the rules of the paper.

        A code is active if its rule fired at `k` or more of the last `n` instants. `method` is
        ``fuzzy``, ``midpoint`` or ``crisp``. Only ``crisp``, the rule table as printed, evaluates
        DVPos while no command is active.
        """
        return diagnose_run(self, rules, method=method, k=k, n=n, threshold=threshold)

    @style.applied
    def plot(self, valve: int = 1, ax: Axes | None = None) -> Axes:
        """Draw a valve's readings over time in percent of full scale, as in Figure 12."""
        ax = style.axes(ax)
        frame = self.valve(valve)
        ax.fill_between(
            frame.index,
            0,
            1,
            where=frame["running"].to_numpy(),
            color="0.92",
            zorder=0,
            step="post",
            linewidth=0,
            label="motor runs",
            transform=ax.get_xaxis_transform(),
        )
        looks = ("C0-", "C1--", "C2-.", "C3:", "C4-")
        for look, channel in zip(looks, CHANNELS, strict=True):
            full, label = _FULL[channel.name], channel.name
            if label != "VPos":
                label = f"{channel.name}, 100 % = {full:g} {style.sign(channel.unit)}"
            ax.plot(frame.index, 100 * frame[channel.column] / full, look, label=label)
        ax.set(xlabel="time [s]", ylabel="of full scale [%]")
        ax.legend(loc="upper left", bbox_to_anchor=(1, 1))
        return ax

    def __repr__(self) -> str:
        span = f"{self.time[-1] - self.time[0]:g} s, " if self.time.size else ""
        valves = f"{self.n_valves} valve{'s' if self.n_valves != 1 else ''}"
        n = len(self.movements)
        return f"Run({span}{valves}, {n} motor run{'s' if n != 1 else ''})"

    def _repr_html_(self) -> str:
        return as_html(self, table=self.strokes())


def stroke_rows(run: Run) -> pd.DataFrame:
    """Return the motor runs that have ended: valve, action, times, opening, outcome."""
    frame = pd.DataFrame(run.movements, columns=list(Movement._fields))
    frame["valve"] += 1
    frame["duration_s"] = frame["end"] - frame["start"]
    return frame.rename(columns={"start": "start_s", "end": "end_s"})


class Recorder:
    """Records a plant's sensor readings while other code advances the plant's time."""

    def __init__(self, plant: Plant) -> None:
        self.plant = plant
        self._rows: list[tuple[float, Floats, Floats, Bools, Floats]] = []
        self._first = len(plant.movements)

    def take(self) -> None:
        """Record the present readings; a second call at the same time does nothing."""
        plant = self.plant
        if self._rows and self._rows[-1][0] == plant.time:
            return
        readings = plant.run_until(plant.time).copy()
        states = plant.run_time, plant.active.copy(), plant.opening.copy()
        self._rows.append((plant.time, readings, *states))

    @property
    def run(self) -> Run:
        """The readings so far."""
        if not self._rows:
            raise ArgumentError("nothing has been recorded")
        columns = [np.array(column) for column in zip(*self._rows, strict=True)]
        time, readings, ran, active, opening = columns
        moving = np.zeros_like(active)
        moving[:-1] = opening[1:] != opening[:-1]
        movements = tuple(self.plant.movements[self._first :])
        speed = position_speed(time, readings[:, 4])
        return Run(time, readings, speed, ran, moving, active, opening, movements)


class Tail(NamedTuple):
    """The last samples and active codes of a run, from which the next diagnosis starts."""

    samples: dict[str, Floats]
    applies: dict[str, Bools]
    active: Bools


def rule_inputs(
    run: Run, base: RuleBase, *, any_time: bool
) -> tuple[dict[str, Floats], dict[str, Bools]]:
    """Return the rules' variables, and where those of a movement apply (see `RuleBase.fire`)."""
    values = run.samples | {"Time": run.ran}
    # Without a reading of the motor current it is not known whether the valve moves.
    blind = np.isnan(run.readings[:, 2])
    applies = {"Time": run.running | blind}
    if any_time:
        # The speed is evaluated as soon as the position has been read for a second.
        values["DVPos"] = run.speed
        applies["DVPos"] = ~np.isnan(run.speed) | np.isnan(run.readings[:, 4])
    else:
        values["DVPos"] = np.where(run.active, run.DVPos, np.nan)
        applies["DVPos"] = run.active & (run.ran >= WINDOW - 1e-9) | blind
    unknown = [name for name in base.names if name not in values]
    if unknown:
        raise ArgumentError(f"rules use {', '.join(unknown)}; a run has {', '.join(values)}")
    values = {name: values[name] for name in base.names}
    return values, {name: mask for name, mask in applies.items() if name in base.names}


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """The diagnosis of every valve at every instant, as returned by `Run.diagnose`.

    The `run` was diagnosed with the rules of `base`. `samples` are the values of each variable,
    shape (n_times, n_valves), NaN where it is missing or, by `applies`, not evaluated. `active`
    marks the active codes in the order of ``base.codes``, shape (n_times, n_valves, n_rules), and
    `open` the codes that may be active but cannot be evaluated, because readings are missing.
    `before` marks the codes that were active just before the run; the diagnosis of the next run
    starts from `tail`.

    Notes
    -----
    V2 fires if OP is low and the position does not change. Except with ``crisp``, V2 is evaluated
    only during a command, after the motor has run for a second; otherwise a healthy valve at rest
    with the paper's OP of 2 bar would appear to have a leaking piston. ``midpoint`` is equivalent
    to ``fuzzy`` with threshold 0.5.

    Examples
    --------
    >>> from shipnet.ballast import Command, Fault, simulate
    >>> stuck = Fault("V1", valves=2)
    >>> run = simulate(2, [Command("open", 1.0)], faults=stuck, until=25, rng=2024)
    >>> found = run.diagnose()
    >>> found
    Diagnosis(2 valves, valve 2: V1)
    >>> found.explain(2, 2.0)
    'V1 1.00: FP 126.7 bar high 1.00, OP 10 bar high 1.00'
    """

    run: Run
    base: RuleBase
    method: str
    threshold: float
    samples: dict[str, Floats]
    applies: dict[str, Bools]
    active: Bools
    open: Bools
    before: Bools
    tail: Tail

    @property
    def time(self) -> Floats:
        """Instants, shape (n_times,) [s]."""
        return self.run.time

    @cached_property
    def top(self) -> npt.NDArray[np.object_]:
        """Top active code, else ``undetermined`` or ``normal``; shape (n_times, n_valves)."""
        return self.base.top_codes(self.active, self.open.any(axis=2))

    @cached_property
    def onset(self) -> Bools:
        """Mask of the instants at which a code becomes active; same shape as `active`."""
        new = self.active.copy()
        new[1:] &= ~self.active[:-1]
        new[:1] &= ~self.before
        return new

    @cached_property
    def alarm_times(self) -> Floats:
        """First time at which each code is active [s], shape (n_valves, n_rules); NaN if never."""
        if not self.time.size:
            return np.full(self.active.shape[1:], np.nan)
        return np.where(self.active.any(axis=0), self.time[self.active.argmax(axis=0)], np.nan)

    def alarms(self) -> pd.DataFrame:
        """Return one row for every time a code becomes active, in order of time."""
        rows, valves, places = np.nonzero(self.onset)
        codes, top = np.array(self.base.codes, dtype=object)[places], self.top[rows, valves]
        columns = {"time_s": self.time[rows], "valve": valves + 1, "code": codes, "top_fault": top}
        return pd.DataFrame(columns)

    def commands(self) -> pd.DataFrame:
        """Return one row per motor run: its diagnosis to 5 s after its end, or to the next run."""
        table = stroke_rows(self.run)[["valve", "action", "start_s", "end_s", "outcome"]].copy()
        active = np.zeros((len(table), len(self.base.codes)), bool)
        doubtful, delay = np.zeros(len(table), bool), np.full(len(table), np.nan)
        for row, moved in enumerate(self.run.movements):
            first, ended, last = np.searchsorted(
                self.time, [moved.start - 1e-9, moved.end - 1e-9, moved.end + _SETTLE + 1e-9]
            )
            again = np.flatnonzero(self.run.running[ended:last, moved.valve])
            last = ended + again[0] if again.size else last
            seen = self.active[first:last, moved.valve]
            doubtful[row] = self.open[first:last, moved.valve].any()
            if seen.any():
                active[row] = seen.any(axis=0)
                delay[row] = self.time[first + seen.any(axis=1).argmax()] - moved.start
        table["active"] = self.base.active_codes(active)
        table["top_fault"] = self.base.top_codes(active, doubtful)
        table["delay_s"] = delay
        return table

    def firing(self, valve: int) -> Firing:
        """Return the firing strengths of all rules for one valve over time."""
        return self._fire((slice(None), self._place(valve)))

    def explain(self, valve: int, time: float) -> str:
        """Return one sentence that explains the diagnosis of a valve at a time [s].

        The sentence describes the last instant at or before that time. A code whose rule has fired
        at too few instants is not active yet.
        """
        if not self.time.size:
            raise ArgumentError(f"time is {time!r}; the run contains no readings")
        at = check_scalar("time", time, "s", float(self.time[0]), inf)
        row, k = int(np.searchsorted(self.time, at + 1e-9, side="right")) - 1, self._place(valve)
        firing = self._fire((row, k))
        return Decision(firing, self.threshold, self.active[row, k], self.open[row, k]).explain()

    def is_active(self, valve: int, code: str) -> Bools:
        """Return a mask of the instants at which a code is active."""
        return np.asarray(self.active[:, self._place(valve), self._column(code)])

    def first_alarm(self, valve: int, code: str) -> float:
        """Return the first time at which a code is active [s]; NaN if never."""
        return float(self.alarm_times[self._place(valve), self._column(code)])

    def n_alarms(self, valve: int, code: str | None = None) -> int:
        """Return how many times a code became active; None counts all codes."""
        new = self.onset[:, self._place(valve)]
        return int(new.sum() if code is None else new[:, self._column(code)].sum())

    @style.applied
    def plot(self, valve: int | None = None, ax: Axes | None = None) -> Axes:
        """Draw the greatest firing strength of each rule, and the diagnosis, as in Figure 13.

        By default, `valve` is the first that is not normal, or 1.
        """
        if valve is None:
            valve = int((self._overall != NORMAL).argmax()) + 1
        ax, base = style.axes(ax), self.base
        strength = self.firing(valve).strength.max(axis=0)
        active = np.any(self.active[:, self._place(valve)], axis=0)
        names = [style.literal(f"{one.english or one.flag} ({one.code})") for one in base.rules]
        colours = [style.LIMIT["color"] if on else "0.75" for on in active]
        ax.barh(names, strength, color=colours)
        ax.invert_yaxis()
        ax.axvline(self.threshold, color="0.3", linestyle=":", linewidth=1)
        ax.set(xlim=(0, 1.02), xlabel="greatest firing strength")
        ax.set_xticks([0, self.threshold, 1], ["0", f"{self.threshold:g}\nalarm threshold", "1"])
        (codes,) = base.active_codes(active[np.newaxis])
        others = f", also {', '.join(codes.split()[1:])}" if " " in codes else ""
        top = self._overall[valve - 1]
        ax.set_title(
            f"diagnosis of valve {valve}: {top}{others}",
            loc="left",
            color="C2" if top == NORMAL else style.LIMIT["color"],
        )
        return ax

    @property
    def _overall(self) -> npt.NDArray[np.object_]:
        """Top code of each valve over the whole run, as in `top`."""
        active = np.asarray(self.active.any(axis=0))
        return self.base.top_codes(active, self.open.any(axis=(0, 2)))

    def __repr__(self) -> str:
        n, top = self.run.n_valves, self._overall
        faulty = np.flatnonzero(top != NORMAL)
        faults = some([f"valve {k + 1}: {top[k]}" for k in faulty], 3)
        return f"Diagnosis({n} valve{'s' if n != 1 else ''}, {faults or 'all normal'})"

    def _repr_html_(self) -> str:
        return as_html(self, ok=all_normal(self._overall), table=self.alarms())

    def _fire(self, at: tuple[Any, int]) -> Firing:
        return self.base.fire(_at(at, self.samples), self.method, applies=_at(at, self.applies))

    def _place(self, valve: int) -> int:
        return check_whole("valve", valve, 1, self.run.n_valves) - 1

    def _column(self, code: str) -> int:
        return self.base.codes.index(self.base.rule(code).code)


def diagnose_run(
    run: Run,
    rules: RuleBase | None = None,
    *,
    method: str = "fuzzy",
    k: int = 3,
    n: int = 5,
    threshold: float = 0.5,
    earlier: Tail | None = None,
) -> Diagnosis:
    """Diagnose all valves at all instants of a run, which may continue the run of `earlier`."""
    base = rules if rules is not None else rule_base()
    check_choice("method", method, METHODS)
    window = check_whole("n", n, 1, 1000)
    values, due = rule_inputs(run, base, any_time=method == "crisp")
    before = np.zeros((run.n_valves, len(base.rules)), bool)
    samples, applies, kept = values, due, 0
    if earlier is not None:
        before = earlier.active
        samples = {name: np.concatenate([earlier.samples[name], x]) for name, x in values.items()}
        applies = {name: np.concatenate([earlier.applies[name], x]) for name, x in due.items()}
        kept = len(earlier.samples[base.names[0]])
    n_times = run.time.size
    # Pages of zeros take no memory until something is open.
    active, opened = (np.zeros((n_times, run.n_valves, len(base.rules)), bool) for _ in range(2))
    size = max(_AT_ONCE // run.n_valves, window)
    # Without instants the loop still runs once, so that wrong arguments are refused.
    for start in range(0, max(n_times, 1), size):
        first = max(kept + start - window + 1, 0)
        part = slice(first, kept + start + size)
        firing = base.fire(_at(part, samples), method, applies=_at(part, applies))
        decided = firing.decide(threshold=threshold, k=k, n=n)
        new = slice(kept + start - first, None)
        active[start : start + size] = decided.active[new]
        if decided.open.any():
            opened[start : start + size] = decided.open[new]
    last = slice(max(kept + n_times - window + 1, 0), None)
    tail = Tail(
        {name: x.copy() for name, x in _at(last, samples).items()},
        {name: x.copy() for name, x in _at(last, applies).items()},
        active[-1].copy() if n_times else before,
    )
    return Diagnosis(run, base, method, threshold, values, due, active, opened, before, tail)


def _at(rows: Any, columns: Mapping[str, npt.NDArray[Any]]) -> dict[str, Any]:
    return {name: x[rows] for name, x in columns.items()}


def diagnose(
    readings: Mapping[str, npt.ArrayLike] | pd.DataFrame | None = None,
    method: str = "fuzzy",
    *,
    threshold: float = 0.5,
    **values: float,
) -> Decision:
    """Diagnose a valve from its readings.

    Parameters
    ----------
    readings : mapping of str to array_like, or DataFrame, optional
        Values of FP and OP [bar], MC [A], OT [degC], VPos [%] and DVPos [%/s] by name. NaN, omitted
        values and values that no sensor reports count as missing (see Notes); a rule that needs a
        missing value does not fire.
    method : {"fuzzy", "crisp", "midpoint"}, default "fuzzy"
        How the rules are evaluated: with ramps, with the comparisons as printed, or by comparison
        with the midpoints of the ramps.
    threshold : float, default 0.5
        Lowest firing strength at which a code is active, above 0 and up to 1.
    **values : float
        Readings as keyword arguments, in addition to or instead of `readings`.

    Returns
    -------
    shipnet.fuzzy.Decision
        The top fault, all active codes, and the reasons. Without a fault, ``normal`` means that
        every rule is excluded by a reading; otherwise the decision is ``undetermined``.

    Notes
    -----
    A value counts as missing if it lies below its sensor's scale by more than 2.5 % of the scale or
    above it by more than 6.25 %. These are the failure limits of NAMUR NE 43, 3.6 mA and 21 mA on a
    scale of 4 to 20 mA. The scales are the universes of `rule_base`, such as 0..160 bar for FP: 170
    bar is still a high pressure, 171 bar is not a reading.

    Examples
    --------
    >>> diagnose(FP=125, OP=4, MC=4)
    Decision(P1 1.00: FP 125 bar high 1.00, MC 4 A over 1.00; also V1 1.00; missing OT VPos DVPos)
    >>> diagnose(FP=100, OP=2, MC=1.2, OT=-400, VPos=50)
    Decision(undetermined: cannot exclude V2 O1; missing DVPos; out of range OT -400 degC)
    """
    several: dict[str, Any] = {} if readings is None else dict(readings)
    return rule_base().decide({**several, **values}, method, threshold=threshold)
