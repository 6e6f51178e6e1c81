"""The quality of the diagnosis: trials with each fault, false alarms, and a fleet over time.

The faults are those of our own simulator and are made to fit the rules. Finding them verifies the
code but does not validate the method.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from shipnet import style
from shipnet.ballast.actuator import Actuator
from shipnet.ballast.diagnosis import Diagnosis, Run, Tail, diagnose_run, stroke_rows
from shipnet.ballast.plant import FAULTS, Command, Fault
from shipnet.ballast.rule_table import rule_base
from shipnet.ballast.scan import System, as_system
from shipnet.ballast.simulation import blocks
from shipnet.clock import as_faults
from shipnet.errors import ArgumentError
from shipnet.fields import check_choice, check_rng, check_scalar, check_whole
from shipnet.fuzzy.firing import METHODS
from shipnet.fuzzy.rules import RuleBase, draw_matrix
from shipnet.fuzzy.terms import NORMAL, UNDETERMINED
from shipnet.html import as_html
from shipnet.intervals import event_interval, share_interval
from shipnet.lazy import Axes, pd
from shipnet.parallel import track

#: What the results are based on.
BASIS = "faults simulated by us to fit the rules: verifies the code, does not validate the method"

#: A year [s].
_YEAR = 365.25 * 86400

#: Standard deviation of the logarithm of pump leak, restrictor and bearing torque among valves.
_SPREAD = 0.02

#: Times in a trial [s]: opening, closing and end; a motor runs for at most 20 s.
_OPEN, _CLOSE, _END = 5.0, 35.0, 65.0

#: Instants per block: the readings of 3328 valves then take 13 MB.
_BLOCK = 100


def spread_valves(n_valves: int, rng: np.random.Generator) -> System:
    """Return valves that differ from each other as new valves do; the spread is our assumption."""
    n = check_whole("n_valves", n_valves, 1, 10_000)
    usual = Actuator()
    factors = np.exp(_SPREAD * rng.standard_normal((3, n)))
    actuator = Actuator(
        pump_leak=usual.pump_leak * factors[0],
        restrictor=usual.restrictor * factors[1],
        bearing_torque=usual.bearing_torque * factors[2],
    )
    return System(actuator=actuator)


@dataclass(frozen=True, eq=False)
class Trials:
    """Trials of the diagnosis, as returned by `fault_trials`.

    Parameters
    ----------
    rows : pandas.DataFrame
        One row per trial and method: ``method``, ``fault``, ``valve``, ``severity``; the codes that
        were ``active`` during the trial, and their ``top_fault``; whether any code was active
        (``detected``), whether the fault's own code was active (``named``), and whether ``fault``
        was the top fault (``isolated``); and ``detection_time_s`` and ``isolation_time_s``, counted
        from the first command: 0 if before that command, NaN if never.

    Notes
    -----
    The indices are those of the DAMADICS benchmark [1]_, whose text was not available to us; we
    define them as follows. *Detection time*: time until any code is active. *Isolation time*: time
    until the fault's own code is active, if it is the top fault of the trial. *Isolability*: the
    fraction of the detected faults that are isolated. *Sensitivity*: the lowest severity that was
    detected.

    References
    ----------
    .. [1] M. Bartys, R. Patton, M. Syfert, S. de las Heras, J. Quevedo, "Introduction to the
       DAMADICS actuator FDI benchmark study", Control Engineering Practice 14 (2006), 577-596.

    Examples
    --------
    While the motor is off, a position far above 100 % also activates S1, which ranks higher:

    >>> trials = fault_trials(["S1", "Pos3"], n_valves=9, methods=["fuzzy"], rng=2024)
    >>> trials.confusion().loc["Pos3"].to_dict()
    {'S1': 9, 'Pos3': 0}
    """

    rows: pd.DataFrame

    @property
    def basis(self) -> str:
        """What the results are based on, in one line."""
        return BASIS

    def __repr__(self) -> str:
        share = self.rows.groupby("method", sort=False)["isolated"].mean()
        isolated = ", ".join(f"{name} {100 * x:.0f} %" for name, x in share.items())
        return f"Trials({len(self.rows) // max(len(share), 1)} valves, isolated: {isolated})"

    def _repr_html_(self) -> str:
        return as_html(self, table=self.rates())

    def table(self) -> pd.DataFrame:
        """Return one row per trial and method, as a copy."""
        return self.rows.copy()

    def rates(self) -> pd.DataFrame:
        """Return how often faults were found, indexed by method and fault.

        Columns: number of trials ``n``; fractions ``detected``, ``named`` and ``isolated`` with the
        ends ``_low`` and ``_high`` of their 95 % intervals; ``isolability``, ``sensitivity``, and
        median ``detection_time_s`` and ``isolation_time_s``. For ``normal`` valves, ``detected`` is
        the fraction with a false alarm and ``isolated`` the fraction without one.
        """
        groups = self.rows.groupby(["method", "fault"], sort=False)
        table = pd.DataFrame({"n": groups.size()})
        for name in ("detected", "named", "isolated"):
            hits = groups[name].sum().astype(int)
            table[name] = hits / table["n"]
            ends = share_interval(hits, table["n"])
            table[f"{name}_low"], table[f"{name}_high"] = ends
        faulty = self.rows["detected"] & (self.rows["fault"] != NORMAL)
        detected = self.rows[faulty].groupby(["method", "fault"], sort=False)
        table["isolability"] = detected["isolated"].mean()
        table["sensitivity"] = detected["severity"].min()
        for name in ("detection_time_s", "isolation_time_s"):
            table[name] = groups[name].median()
        return table

    def confusion(self, method: str = "fuzzy") -> pd.DataFrame:
        """Return the number of trials by fault (rows) and top fault (columns)."""
        check_choice("method", method, self.rows["method"].unique())
        rows = self.rows[self.rows["method"] == method]
        faults = list(rows["fault"].unique())
        order = list(dict.fromkeys([*faults, *sorted(rows["top_fault"].unique())]))
        counts = pd.crosstab(rows["fault"], rows["top_fault"])
        return counts.reindex(index=faults, columns=order, fill_value=0)

    @style.applied
    def plot(self, method: str = "fuzzy", ax: Axes | None = None) -> Axes:
        """Draw the confusion matrix in percent of each row."""
        table = self.confusion(method)
        ax = style.axes(ax)
        count = table.to_numpy(float)
        total = count.sum(axis=1, keepdims=True)
        share = np.divide(count, total, out=np.zeros_like(count), where=total > 0)
        draw_matrix(ax, share, lambda _, __, x: f"{100 * x:.0f}" if x >= 0.005 else "<1")
        ax.autoscale(False)
        for row, column in np.argwhere(table.index.to_numpy()[:, None] == table.columns.to_numpy()):
            ax.bar(column, 1, 1, row - 0.5, fill=False, edgecolor="0.3", linewidth=1)
        ax.set_xticks(range(len(table.columns)), [str(name) for name in table.columns])
        ax.set_yticks(range(len(table.index)), [str(name) for name in table.index])
        ax.set(xlabel="top-ranked fault [% of the row]", ylabel="fault of the valve")
        return ax


def fault_trials(
    codes: Iterable[str] = (NORMAL, *FAULTS),
    *,
    n_valves: int = 256,
    severity: npt.ArrayLike = 1.0,
    methods: Iterable[str] = METHODS,
    rules: RuleBase | None = None,
    rng: Any,
) -> Trials:
    """For each fault, open and close a set of valves once, and diagnose them.

    Parameters
    ----------
    codes : iterable of str, optional
        Faults; ``normal`` means healthy valves. All of them if omitted.
    n_valves : int, default 256
        Number of valves per fault; at most 10000 in all.
    severity : float or array_like of float, shape (n_valves,), default 1
        Severity of the faults, 0..1.
    methods : iterable of str, optional
        Methods of diagnosis, applied to the same readings: ``crisp``, ``midpoint`` and ``fuzzy`` if
        omitted.
    rules : RuleBase, optional
        Rules of diagnosis, by default those of the paper. A fault is named or isolated by the rule
        that has its code.
    rng : Generator, int or None
        Seed or generator (`numpy.random.default_rng`) of valve differences and sensor noise.

    Returns
    -------
    Trials
        One row per trial and method.

    Notes
    -----
    The fault is present from the beginning. The valve rests closed for 5 s, opens, is commanded to
    close 30 s later, and is observed for 30 s more. Pump leak, restrictor and bearing torque vary
    among the valves with a standard deviation of 2 %, which is our assumption.

    Examples
    --------
    >>> fault_trials(["normal", "V1"], n_valves=8, rng=2024).confusion().loc["V1"].to_dict()
    {'normal': 0, 'V1': 8}
    """
    generator = check_rng(rng)
    chosen, ways = _some("codes", codes, (NORMAL, *FAULTS)), _some("methods", methods, METHODS)
    valves = check_whole("n_valves", n_valves, 1, 10_000 // len(chosen))
    try:
        each = np.broadcast_to(np.asarray(severity, float), valves)
    except (TypeError, ValueError):
        raise ArgumentError(
            f"severity is {severity!r}; it must be 0..1, one value for all or {valves} values"
        ) from None
    severities = np.tile(each, len(chosen))
    base = rules if rules is not None else rule_base()
    faults = np.repeat(np.array(chosen, dtype=object), valves)
    places = {code: np.flatnonzero(faults == code) for code in chosen if code != NORMAL}
    plan = [Fault(code, severities[where], valves=where + 1) for code, where in places.items()]
    active = {method: np.zeros((faults.size, len(base.rules)), bool) for method in ways}
    first = {method: np.full((faults.size, len(base.rules)), np.nan) for method in ways}
    runs = blocks(
        spread_valves(faults.size, generator),
        [Command("open", _OPEN), Command("close", _CLOSE)],
        faults=plan,
        until=_END,
        idle_step=0.5,
        rng=generator,
        size=_BLOCK,
    )
    for block in track(_diagnosed(runs, ways, base), "fault trials"):
        for method, diagnosis in block.items():
            active[method] |= diagnosis.active.any(axis=0)
            first[method] = np.fmin(first[method], diagnosis.alarm_times)
    of_fault = faults[:, np.newaxis] == np.array(base.codes, dtype=object)
    tables = []
    for method, codes in active.items():
        top = base.top_codes(codes)
        since = np.maximum(first[method] - _OPEN, 0.0)
        isolated = (top == faults)[:, np.newaxis]
        rows = {
            "method": method,
            "fault": faults,
            "valve": np.tile(np.arange(1, valves + 1), len(chosen)),
            "severity": np.where(faults == NORMAL, 0.0, severities),
            "active": base.active_codes(codes),
            "top_fault": top,
            "detected": codes.any(axis=1),
            "named": (codes & of_fault).any(axis=1),
            "isolated": top == faults,
            "detection_time_s": np.fmin.reduce(since, axis=1),
            "isolation_time_s": np.fmin.reduce(
                np.where(of_fault & isolated, since, np.nan), axis=1
            ),
        }
        tables.append(pd.DataFrame(rows))
    return Trials(pd.concat(tables, ignore_index=True))


def _diagnosed(
    runs: Iterable[Run], methods: Iterable[str], rules: RuleBase | None
) -> Iterator[dict[str, Diagnosis]]:
    """Diagnose consecutive blocks with every method."""
    tails: dict[str, Tail] = {}
    for run in runs:
        block = {m: diagnose_run(run, rules, method=m, earlier=tails.get(m)) for m in methods}
        tails = {method: diagnosis.tail for method, diagnosis in block.items()}
        yield block


def _some(name: str, words: Iterable[str], legal: Collection[str]) -> list[str]:
    chosen = [check_choice(f"one of {name}", word, legal) for word in words]
    if not chosen:
        raise ArgumentError(f"{name} is empty; it must name at least one")
    return chosen


def false_alarms(
    n_valves: int = 256,
    *,
    until: float = 3600.0,
    period: float = 600.0,
    methods: Iterable[str] = METHODS,
    rules: RuleBase | None = None,
    rng: Any,
) -> pd.DataFrame:
    """Operate healthy valves, and count the faults reported for them.

    Parameters
    ----------
    n_valves : int, default 256
        Number of valves, 1..10000.
    until : float, default 3600
        End time, `period`..1e7 [s].
    period : float, default 600
        Time between two commands, 60..1e6 [s]. They alternately open and close all valves.
    methods, rules, rng
        As for `fault_trials`.

    Returns
    -------
    pandas.DataFrame
        Indexed by ``method``. Columns: ``commands``, counted per valve; ``alarmed``, the number of
        these after which a fault is reported before the next command, and ``per_command``, their
        fraction, with its interval (``_low``, ``_high``); ``valve_years``; ``alarms``, the number
        of changes from normal to a top fault, and ``per_valve_year``, their rate, with its
        interval; and ``false_detection_rate``, the fraction of the time with a fault reported.

    Notes
    -----
    Sensors are read every second, and ten times as often while a motor runs. The noise is white,
    and sensors neither drift nor age, so the rates are a lower bound for a ship.

    Examples
    --------
    >>> table = false_alarms(16, until=120, period=60, rng=2024)
    >>> table["alarmed"].to_dict()
    {'crisp': 32, 'midpoint': 0, 'fuzzy': 0}
    """
    every = check_scalar("period", period, "s", 60, 1e6)
    time = check_scalar("until", until, "s", every, 1e7)
    valves = check_whole("n_valves", n_valves, 1, 10_000)
    starts = np.arange(0.0, time - every + 1e-6, every)
    orders = [Command(("open", "close")[i % 2], start) for i, start in enumerate(starts)]
    chosen, generator = _some("methods", methods, METHODS), check_rng(rng)
    alarmed = {method: np.zeros((starts.size, valves), bool) for method in chosen}
    alarms, reported = dict.fromkeys(chosen, 0), dict.fromkeys(chosen, 0.0)
    quiet = {method: np.ones((1, valves), bool) for method in chosen}
    system = spread_valves(valves, generator)
    # The last period is complete: it ends just before the next command would be due.
    end = starts[-1] + every - 0.1
    runs = blocks(system, orders, until=end, rng=generator, size=max(2**19 // valves, 1))
    last = 0.0
    for block in track(_diagnosed(runs, chosen, rules), "false alarms"):
        for method, diagnosis in block.items():
            of = np.minimum((diagnosis.time + 1e-6) // every, starts.size - 1).astype(int)
            calm = np.isin(diagnosis.top, [NORMAL, UNDETERMINED])
            before = np.concatenate([quiet[method], calm[:-1]])
            alarms[method] += int((before & ~calm).sum())
            spans = np.diff(diagnosis.time, prepend=last)
            reported[method] += float(spans @ (~before).sum(axis=1))
            np.logical_or.at(alarmed[method], of, ~calm)
            quiet[method] = calm[-1:]
        last = diagnosis.time[-1]
    hits = np.array([int(alarmed[method].sum()) for method in chosen])
    seen = np.array([alarms[method] for method in chosen])
    commands, years = starts.size * valves, valves * (starts.size * every) / _YEAR
    share = share_interval(hits, np.full(hits.shape, commands))
    rate = event_interval(seen, years)
    columns = {
        "commands": commands,
        "alarmed": hits,
        "per_command": hits / commands,
        "per_command_low": share[0],
        "per_command_high": share[1],
        "valve_years": years,
        "alarms": seen,
        "per_valve_year": seen / years,
        "per_valve_year_low": rate[0],
        "per_valve_year_high": rate[1],
        "false_detection_rate": [reported[method] / (valves * last) for method in chosen],
    }
    return pd.DataFrame(columns, index=pd.Index(chosen, name="method"))


#: Columns of `FleetReport.faults`, and their types.
_FAULT_COLUMNS = {
    "valve": np.int64,
    "code": object,
    "severity": float,
    "start_s": float,
    "top_fault": object,
    "named": bool,
    "detection_time_s": float,
    "isolation_time_s": float,
    "true_detection_rate": float,
    "command_s": float,
    "after_command_s": float,
}


@dataclass(frozen=True, eq=False)
class FleetReport:
    """The faults and alarms of a fleet, as returned by `run_fleet`.

    Parameters
    ----------
    n_valves : int
        Number of valves.
    duration : float
        Duration [s].
    n_samples : int
        Number of samples diagnosed; a sample is one reading of all five sensors of a valve.
    injected : list of Fault
        The faults.
    commands : DataFrame
        One row per run of a motor: ``valve``, ``action``, ``start_s``, ``end_s``, ``outcome``.
    alarms : DataFrame
        One row for every time a code became active: ``time_s``, ``valve``, ``code``, ``top_fault``.
    signals : DataFrame
        One row for every time the top fault of a valve changed: ``time_s``, ``valve``,
        ``top_fault``. The top fault is normal until the first change.

    Notes
    -----
    The indices are those of `Trials`, with times counted from the beginning of the fault. A fault
    may be visible only during strokes, so it counts as isolated when its own code first becomes the
    top fault of its valve. *True-detection rate*: the fraction of the fault's duration for which
    its valve has a top fault.

    Examples
    --------
    >>> run_fleet(2, [Command("open", 60.0)], faults=Fault("V1", valves=2), until=120)
    2 valves, 0.0333333 h, 0.0 million samples, 2 motor runs
    1 fault: 1 detected, 1 named, 1 isolated; 0 false alarms
    """

    n_valves: int
    duration: float
    n_samples: int
    injected: list[Fault]
    commands: pd.DataFrame
    alarms: pd.DataFrame
    signals: pd.DataFrame

    def faults(self) -> pd.DataFrame:
        """Return one row per fault and valve, in the order of `injected`."""
        rows = []
        for fault in self.injected:
            severities = fault.severities(self.n_valves)
            for valve in severities.nonzero()[0]:
                alarms, shown, ran = (
                    table[table["valve"] == valve + 1]
                    for table in (self.alarms, self.signals, self.commands)
                )
                later = alarms[alarms["time_s"] >= fault.start]
                isolated = shown[
                    (shown["time_s"] >= fault.start) & (shown["top_fault"] == fault.code)
                ]
                alarm, end = later["time_s"].min(), min(fault.stop, self.duration)
                ran = ran[(ran["end_s"] >= fault.start) & (ran["start_s"] <= alarm)]
                command = np.maximum(ran["start_s"].max(), fault.start)
                # Time for which a fault is reported while there is one.
                until = shown["time_s"].shift(-1).fillna(self.duration)
                spans = until.clip(fault.start, end) - shown["time_s"].clip(fault.start, end)
                reported = spans[~shown["top_fault"].isin([NORMAL, UNDETERMINED])].sum()
                rows.append(
                    (
                        valve + 1,
                        fault.code,
                        severities[valve],
                        fault.start,
                        [*later["top_fault"], ""][0],
                        fault.code in later["code"].tolist(),
                        alarm - fault.start,
                        isolated["time_s"].min() - fault.start,
                        reported / (end - fault.start) if end > fault.start else np.nan,
                        command,
                        alarm - command,
                    )
                )
        # An empty table must have the same column types.
        return pd.DataFrame(rows, columns=list(_FAULT_COLUMNS)).astype(_FAULT_COLUMNS)

    def false_alarms(self) -> pd.DataFrame:
        """Return the alarms of valves that had no fault yet, with the columns of `alarms`."""
        begin = np.full(self.n_valves, np.inf)
        for fault in self.injected:
            sick = fault.severities(self.n_valves) > 0
            begin[sick] = np.minimum(begin[sick], fault.start)
        false = self.alarms["time_s"].to_numpy() < begin[self.alarms["valve"].to_numpy(int) - 1]
        alarms: pd.DataFrame = self.alarms[false].reset_index(drop=True)
        return alarms

    def summary(self) -> pd.DataFrame:
        """Return counts, median times and indices per code; ``true_detection_rate`` is a mean."""
        groups = self.faults().groupby("code", sort=False)
        table: pd.DataFrame = groups.agg(
            faults=("code", "size"),
            detected=("detection_time_s", "count"),
            named=("named", "sum"),
            isolated=("isolation_time_s", "count"),
            detection_time_s=("detection_time_s", "median"),
            isolation_time_s=("isolation_time_s", "median"),
            true_detection_rate=("true_detection_rate", "mean"),
        )
        table["isolability"] = table["isolated"] / table["detected"].where(table["detected"] > 0)
        detected = self.faults().dropna(subset="detection_time_s")
        table["sensitivity"] = detected.groupby("code")["severity"].min()
        return table.reindex([code for code in FAULTS if code in groups.groups])

    def __repr__(self) -> str:
        table = self.faults()
        detected, isolated = table["detection_time_s"].count(), table["isolation_time_s"].count()
        return (
            f"{self.n_valves} valves, {self.duration / 3600:g} h, "
            f"{self.n_samples / 1e6:.1f} million samples, {len(self.commands)} motor runs\n"
            f"{len(table)} fault{'s' if len(table) != 1 else ''}: {detected} detected, "
            f"{table['named'].sum()} named, {isolated} isolated; "
            f"{len(self.false_alarms())} false alarms"
        )

    def _repr_html_(self) -> str:
        return as_html(self, table=self.faults())

    def false_alarm_rate(self, confidence: float = 0.95) -> tuple[float, float]:
        """Return the confidence interval of the false alarm rate per valve and year."""
        years = self.n_valves * self.duration / _YEAR
        low, high = event_interval(len(self.false_alarms()), years, confidence=confidence)
        return float(low), float(high)

    @style.applied
    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw when each fault appeared, when it was reported, and when its valve was moved."""
        ax = style.axes(ax)
        faults, commands = self.faults(), self.commands
        hour = 3600.0
        rows = np.arange(len(faults))
        start = faults["start_s"].to_numpy()
        until = (start + faults["detection_time_s"]).fillna(self.duration).to_numpy()
        names = []
        for row, (valve, code) in enumerate(faults[["valve", "code"]].itertuples(index=False)):
            names.append(f"{code}, valve {valve}")
            moved = commands.loc[commands["valve"] == valve, "start_s"] / hour
            ax.plot(
                moved,
                np.full(len(moved), row),
                "|",
                color="0.55",
                markersize=11,
                label="_" if row else "valve is moved",
            )
        red = style.LIMIT["color"]
        ax.hlines(rows, start / hour, until / hour, color=red, linewidth=3, label="not reported")
        ax.plot(start / hour, rows, "o", color=red, markersize=5, label="fault appears")
        reported = faults["detection_time_s"].notna().to_numpy()
        ax.plot(
            until[reported] / hour, rows[reported], "D", color="C2", markersize=6, label="reported"
        )
        ax.set_yticks(rows, names)
        ax.invert_yaxis()
        ax.set(xlabel="time [h]", xlim=(0, self.duration / hour))
        style.legend(ax, 2)
        return ax


def run_fleet(
    system: System | int,
    commands: Iterable[Command],
    *,
    faults: Fault | Iterable[Fault] = (),
    until: float = 86400.0,
    rules: RuleBase | None = None,
    rng: Any = None,
) -> FleetReport:
    """Simulate and diagnose a fleet block by block; store its alarms but not its samples.

    The sensors are read every 0.1 s while a motor runs, and every second otherwise.

    Parameters
    ----------
    system : System or int
        The valves, or their number. They are read directly, without a master.
    commands : iterable of Command
        Commands to the valves, such as those from `Command.random`.
    faults : Fault or iterable of Fault, optional
        Faults of the valves, such as those from `Fault.random`.
    until : float, default 86400
        End time, up to 1e8 [s].
    rules : RuleBase, optional
        Rules of diagnosis, by default those of the paper.
    rng : Generator, int or None, optional
        Source of the sensors' noise, for `numpy.random.default_rng`; no noise if omitted.

    Returns
    -------
    FleetReport
        Times at which each fault began and was diagnosed, and false alarms.

    Notes
    -----
    A motor that is not cooled (O1) reaches the 90 degC limit of its rule only after many strokes in
    a row; with six strokes per day it never does.

    Examples
    --------
    Eight valves receive four commands each within two hours; two of the valves fail:

    >>> rng = np.random.default_rng(2024)
    >>> plan = Command.random(8, until=7200, operations=4, group=4, rng=rng)
    >>> faults = [Fault("V1", start=1000.0, valves=3), Fault("O1", start=1000.0, valves=6)]
    >>> report = run_fleet(8, plan, faults=faults, until=7200, rng=rng)
    >>> report.faults()[["valve", "code", "top_fault"]].values.tolist()
    [[3, 'V1', 'V1'], [6, 'O1', '']]
    """
    fleet = as_system(system)
    failed: list[Any] = list(as_faults(faults, Fault))
    end = check_scalar("until", until, "s", 0, 1e8)
    runs = blocks(fleet, commands, faults=failed, until=end, rng=rng)
    n_samples, strokes, alarms, signals = 0, [], [], []
    shown = np.full((1, fleet.n_valves), NORMAL, dtype=object)
    for block in track(_diagnosed(runs, ["fuzzy"], rules), "diagnosis of the fleet"):
        diagnosis = block["fuzzy"]
        n_samples += diagnosis.time.size * fleet.n_valves
        strokes.append(
            stroke_rows(diagnosis.run)[["valve", "action", "start_s", "end_s", "outcome"]]
        )
        alarms.append(diagnosis.alarms())
        top = diagnosis.top
        times, valves = np.nonzero(top != np.concatenate([shown, top[:-1]]))
        columns = {"time_s": diagnosis.time[times], "valve": valves + 1}
        signals.append(pd.DataFrame({**columns, "top_fault": top[times, valves]}))
        shown = top[-1:]
    moved, began, changed = (
        pd.concat([table for table in tables if len(table)] or tables[:1], ignore_index=True)
        for tables in (strokes, alarms, signals)
    )
    return FleetReport(fleet.n_valves, end, n_samples, failed, moved, began, changed)
