"""A fleet of valves over a day: faults appear at random, and the diagnosis is watched.

The faults come from our own simulator and are made to fit the rules, so what is found verifies
code and shows how long a fault waits for a command that reveals it; it validates no method.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from shipnet import style
from shipnet.ballast.diagnosis import Diagnosis, diagnose_run, stroke_rows
from shipnet.ballast.plant import FAULTS, Command, Fault
from shipnet.ballast.scan import System, as_system
from shipnet.ballast.simulation import blocks
from shipnet.fields import check_scalar
from shipnet.fuzzy.rules import RuleBase
from shipnet.intervals import event_interval

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes


#: Columns of `FleetReport.faults`, and their types.
_FAULT_COLUMNS = {
    "valve": np.int64, "code": object, "severity": float, "start_s": float, "alarm_s": float,
    "top_fault": object, "diagnosed_s": float, "isolated": bool, "delay_s": float,
    "command_s": float, "after_command_s": float,
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class FleetReport:
    """What was found of a fleet, as `run_fleet` returns it.

    Parameters
    ----------
    n_valves : int
        Number of valves.
    duration : float
        How long [s].
    n_samples : int
        Valve readings of all five sensors that were diagnosed.
    injected : list of Fault
        What was wrong, from when on.
    commands : DataFrame
        One row per run of a motor: ``valve``, ``action``, ``start_s``, ``end_s``, ``outcome``.
    alarms : DataFrame
        One row for every time a code became active: ``time_s``, ``valve``, ``code``, ``top_fault``.

    Examples
    --------
    >>> report = run_fleet(2, [Command("open", 60.0)], faults=Fault("V1", valves=2), until=120)
    >>> report
    FleetReport(2 valves, 0.0333333 h, 1 faults, 1 alarmed, 0 false alarms)
    """

    n_valves: int
    duration: float
    n_samples: int
    injected: list[Fault]
    commands: pd.DataFrame
    alarms: pd.DataFrame

    def faults(self) -> pd.DataFrame:
        """One row a fault and valve, in order of time."""
        import pandas as pd

        rows = []
        for fault in self.injected:
            severities = fault.severities(self.n_valves)
            for valve in severities.nonzero()[0]:
                mine = self.alarms[
                    (self.alarms["valve"] == valve + 1) & (self.alarms["time_s"] >= fault.start)
                ]
                own = mine[mine["code"] == fault.code]
                alarm = float(mine["time_s"].iloc[0]) if len(mine) else np.nan
                ran = self.commands[
                    (self.commands["valve"] == valve + 1)
                    & (self.commands["end_s"] >= fault.start)
                    & (self.commands["start_s"] <= alarm)
                ]
                command = max(float(ran["start_s"].iloc[-1]), fault.start) if len(ran) else np.nan
                rows.append(
                    {
                        "valve": int(valve) + 1,
                        "code": fault.code,
                        "severity": float(severities[valve]),
                        "start_s": fault.start,
                        "alarm_s": alarm,
                        "top_fault": mine["top_fault"].iloc[0] if len(mine) else "",
                        "diagnosed_s": float(own["time_s"].iloc[0]) if len(own) else np.nan,
                        "isolated": bool((mine["top_fault"] == fault.code).any()),
                        "delay_s": alarm - fault.start,
                        "command_s": command,
                        "after_command_s": alarm - command,
                    }
                )
        # Types of a report without faults: what counts and compares them must work there too.
        return pd.DataFrame(rows, columns=list(_FAULT_COLUMNS)).astype(_FAULT_COLUMNS)

    def false_alarms(self) -> pd.DataFrame:
        """Alarms of valves on which nothing was wrong yet; columns as `alarms`."""
        begin = np.full(self.n_valves, np.inf)
        for fault in self.injected:
            sick = fault.severities(self.n_valves) > 0
            begin[sick] = np.minimum(begin[sick], fault.start)
        alarms: pd.DataFrame = self.alarms
        wrong = alarms["time_s"].to_numpy() < begin[alarms["valve"].to_numpy(int) - 1]
        false: pd.DataFrame = alarms.loc[wrong].reset_index(drop=True)
        return false

    def summary(self) -> pd.DataFrame:
        """One row a code: counts of ``faults``, ``alarmed``, ``own_code``, ``isolated``; delay."""
        groups = self.faults().groupby("code", sort=False)
        table: pd.DataFrame = groups.agg(
            faults=("code", "size"),
            alarmed=("alarm_s", "count"),
            own_code=("diagnosed_s", "count"),
            isolated=("isolated", "sum"),
            median_delay_s=("delay_s", "median"),
        )
        return table.reindex([code for code in FAULTS if code in groups.groups])

    def __str__(self) -> str:
        """Return the report in a few lines."""
        table = self.faults()
        found, own = table["alarm_s"].count(), table["diagnosed_s"].count()
        return (
            f"{self.n_valves} valves, {self.duration / 3600:g} h, "
            f"{self.n_samples / 1e6:.1f} million samples, {len(self.commands)} motor runs\n"
            f"{len(table)} faults: {found} alarmed, {own} with their own code; "
            f"{len(self.false_alarms())} false alarms"
        )

    def __repr__(self) -> str:
        """Return the numbers of valves, faults and false alarms."""
        table = self.faults()
        return (
            f"FleetReport({self.n_valves} valves, {self.duration / 3600:g} h, {len(table)} faults, "
            f"{table['alarm_s'].count()} alarmed, {len(self.false_alarms())} false alarms)"
        )

    def false_alarm_rate(self, confidence: float = 0.95) -> tuple[float, float]:
        """Return the interval of the rate of false alarms, per valve and year."""
        years = self.n_valves * self.duration / (365.25 * 86400)
        low, high = event_interval(len(self.false_alarms()), years, confidence=confidence)
        return float(low), float(high)

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw when each fault appeared, when its valve was moved, and when it was reported."""
        ax = style.axes(ax)
        faults, commands = self.faults(), self.commands
        hour = 3600.0
        rows = np.arange(len(faults))
        known = faults["alarm_s"].fillna(self.duration).to_numpy()
        start = faults["start_s"].to_numpy()
        names = []
        for row, (valve, code) in enumerate(faults[["valve", "code"]].itertuples(index=False)):
            names.append(f"{code}, valve {valve}")
            moved = commands.loc[commands["valve"] == valve, "start_s"] / hour
            ax.plot(
                moved, np.full(len(moved), row), "|", color="0.55", markersize=11,
                label="_" if row else "valve is moved",
            )  # fmt: skip
        red = style.LIMIT["color"]
        ax.hlines(rows, start / hour, known / hour, color=red, linewidth=3, label="unknown")
        ax.plot(start / hour, rows, "o", color=red, markersize=5, label="fault appears")
        found = faults["alarm_s"].notna().to_numpy()
        ax.plot(known[found] / hour, rows[found], "D", color="C2", markersize=6, label="reported")
        ax.set_yticks(rows, names, fontsize="small")
        ax.invert_yaxis()
        ax.set(xlabel="time [h]", xlim=(0, self.duration / hour))
        ax.legend(loc="lower left", bbox_to_anchor=(0, 1), ncols=4, frameon=False, fontsize="small")
        return ax


def run_fleet(
    system: System | int,
    commands: Iterable[Command],
    *,
    faults: Fault | Iterable[Fault] = (),
    until: float = 86400.0,
    rng: Any = None,
    idle_step: float = 1.0,
    rules: RuleBase | None = None,
    size: int = 2000,
    **options: Any,
) -> FleetReport:
    """Simulate a fleet block by block, and diagnose it on the way; alarms are kept, samples not.

    Parameters
    ----------
    system : System or int
        The valves; a number stands for plain valves. They are read directly, without a master.
    commands : iterable of Command
        What the valves are told, such as `Command.random` returns.
    faults : Fault or iterable of Fault, optional
        What goes wrong, such as `Fault.random` returns.
    until : float, default 86400
        End time, up to 1e8 [s].
    rng : Generator, int or None, optional
        Draws the noise of the sensors, as `numpy.random.default_rng` takes it; there is none if
        omitted.
    idle_step : float, default 1
        Time between two readings while no motor runs; it is 0.1 s while one does [s].
    rules : shipnet.fuzzy.RuleBase, optional
        Those of the paper if omitted.
    size : int, default 2000
        Most instants of a block, which sets the memory; 1..1e6.
    **options
        As `Run.diagnose` takes them: method, k, n, threshold.

    Returns
    -------
    FleetReport
        When each fault appeared, and when it was diagnosed; false alarms.

    Raises
    ------
    ArgumentError
        If an argument is out of its range.

    Notes
    -----
    A motor that is not cooled (O1) needs many strokes in a row to reach the 90 degC of its rule:
    with six a day it never does.

    Examples
    --------
    Two hours of eight valves, which are opened and closed; two of them break:

    >>> rng = np.random.default_rng(2024)
    >>> plan = Command.random(8, until=7200, operations=4, group=4, rng=rng)
    >>> faults = [Fault("V1", start=1000.0, valves=3), Fault("O1", start=1000.0, valves=6)]
    >>> report = run_fleet(8, plan, faults=faults, until=7200, rng=rng)
    >>> report.faults()[["valve", "code", "top_fault"]].values.tolist()
    [[3, 'V1', 'V1'], [6, 'O1', '']]
    """
    import pandas as pd

    fleet = as_system(system)
    failed = [faults] if isinstance(faults, Fault) else list(faults)
    end = check_scalar("until", until, "s", 0, 1e8)
    noise = None if rng is None else np.random.default_rng(rng)
    runs = blocks(
        fleet.actuator, commands, n_valves=fleet.n_valves, duration=end, faults=failed,
        sensors=fleet.sensors, opening=fleet.opening, step=fleet.step, idle_step=idle_step,
        rng=noise, size=size,
    )  # fmt: skip
    n_samples, before = 0, None
    strokes, alarms = [], []
    for run in runs:
        diagnosis = diagnose_run(run, rules, after=before, **options)
        n_samples += run.time.size * run.n_valves
        strokes.append(stroke_rows(run)[["valve", "action", "start_s", "end_s", "outcome"]])
        alarms.append(diagnosis.alarms())
        before = _without_bulk(diagnosis)
    known = [table for table in alarms if len(table)] or alarms[:1]
    moved = [table for table in strokes if len(table)] or strokes[:1]
    return FleetReport(
        fleet.n_valves,
        end,
        n_samples,
        failed,
        pd.concat(moved, ignore_index=True),
        pd.concat(known, ignore_index=True),
    )


def _without_bulk(diagnosis: Diagnosis) -> Diagnosis:
    """Keep of a block what the next one needs, so that both are never in memory."""
    run = diagnosis.run
    bare = replace(
        run, **{name: getattr(run, name)[:0] for name in ("time", "readings", "DVPos", "running")},
        moving=run.moving[:0], active=run.active[:0], opening=run.opening[:0],
    )  # fmt: skip
    return replace(diagnosis, run=bare, samples={}, active=diagnosis.active[:0])
