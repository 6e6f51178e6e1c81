"""A fleet of valves over a day: faults appear at random, and the diagnosis is watched.

The faults come from our own simulator and are made to fit the rules, so what is found verifies
code and shows how long a fault waits for a command that reveals it; it validates no method.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from shipnet.ballast.diagnosis import Diagnosis, diagnose_run
from shipnet.ballast.plant import Command
from shipnet.ballast.simulation import blocks
from shipnet.ballast.valve_faults import FAULTS, Fault
from shipnet.errors import ArgumentError
from shipnet.fields import check_scalar, check_whole
from shipnet.fuzzy.rules import RuleBase

if TYPE_CHECKING:
    import pandas as pd


#: The last valve of a group starts so long before the next group is commanded [s]: room for the
#: longest run of a motor.
_GROUP_PAUSE = 30.0


#: Columns of `FleetReport.faults`, and their types.
_FAULT_COLUMNS = {
    "valve": np.int64, "code": object, "severity": float, "start_s": float, "alarm_s": float,
    "headline": object, "diagnosed_s": float, "isolated": bool, "delay_s": float,
    "command_s": float, "after_command_s": float,
}  # fmt: skip


def random_faults(
    n_faults: int,
    rng: np.random.Generator,
    *,
    n_valves: int = 256,
    duration: float = 86400.0,
    codes: Sequence[str] = tuple(FAULTS),
    severity: float | tuple[float, float] = 1.0,
) -> list[Fault]:
    """Draw faults that appear at random times, each on a valve of its own."""
    valves = check_whole("n_valves", n_valves, 1, 10_000)
    count = check_whole("n_faults", n_faults, 0, valves)
    end = check_scalar("duration", duration, "s", 0, 1e8)
    if not codes:
        raise ArgumentError("codes is empty; it must name 1.. faults")
    low, high = severity if isinstance(severity, tuple) else (severity, severity)
    low, high = check_scalar("severity", low, "", 0, 1), check_scalar("severity", high, "", low, 1)
    names = np.resize(np.array(codes, dtype=object), count)
    rng.shuffle(names)
    where = rng.choice(valves, count, replace=False)
    when, how = np.sort(rng.uniform(0, end, count)), rng.uniform(low, high, count)
    return [
        Fault(str(code), float(s), float(t), int(valve))
        for code, s, t, valve in zip(names, how, when, where, strict=True)
    ]


def random_commands(
    rng: np.random.Generator,
    *,
    n_valves: int = 256,
    duration: float = 86400.0,
    operations: int = 6,
    group: int = 16,
) -> list[Command]:
    """Draw a plan in which every valve is opened and closed in turn, a group at a time."""
    valves = check_whole("n_valves", n_valves, 1, 10_000)
    times = check_whole("operations", operations, 1, 1000)
    size = check_whole("group", group, 1, valves)
    lasts = -(-valves // size) * _GROUP_PAUSE
    share = check_scalar("duration", duration, "s", 0, 1e8) / times
    if share < lasts:
        raise ArgumentError(
            f"duration is {duration:g} s; {times} operations of {lasts:g} s take {times * lasts:g}"
        )
    plan = []
    for place in range(times):
        begin = place * share + rng.uniform(0, share - lasts)
        order = rng.permutation(valves)
        for number, first in enumerate(range(0, valves, size)):
            members = [int(valve) for valve in order[first : first + size]]
            when = begin + number * _GROUP_PAUSE
            plan.append(Command(("open", "close")[place % 2], when, valves=members))
    return plan


@dataclass(frozen=True, eq=False)
class FleetReport:
    """What came of watching a fleet.

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
        One row a run of a motor: ``valve``, ``action``, ``start_s``, ``end_s``, ``outcome``.
    alarms : DataFrame
        One row for every time a code became active: ``time_s``, ``valve``, ``code``, ``headline``.
    """

    n_valves: int
    duration: float
    n_samples: int
    injected: list[Fault]
    commands: pd.DataFrame
    alarms: pd.DataFrame

    @cached_property
    def faults(self) -> pd.DataFrame:
        """One row a fault and valve, in order of time."""
        import pandas as pd

        rows = []
        for fault in self.injected:
            severities = fault.severities(self.n_valves)
            for valve in severities.nonzero()[0]:
                mine = self.alarms[
                    (self.alarms["valve"] == valve) & (self.alarms["time_s"] >= fault.start)
                ]
                own = mine[mine["code"] == fault.code]
                alarm = float(mine["time_s"].iloc[0]) if len(mine) else np.nan
                ran = self.commands[
                    (self.commands["valve"] == valve)
                    & (self.commands["end_s"] >= fault.start)
                    & (self.commands["start_s"] <= alarm)
                ]
                command = max(float(ran["start_s"].iloc[-1]), fault.start) if len(ran) else np.nan
                rows.append(
                    {
                        "valve": int(valve),
                        "code": fault.code,
                        "severity": float(severities[valve]),
                        "start_s": fault.start,
                        "alarm_s": alarm,
                        "headline": mine["headline"].iloc[0] if len(mine) else "",
                        "diagnosed_s": float(own["time_s"].iloc[0]) if len(own) else np.nan,
                        "isolated": bool((mine["headline"] == fault.code).any()),
                        "delay_s": alarm - fault.start,
                        "command_s": command,
                        "after_command_s": alarm - command,
                    }
                )
        # Types of a report without faults: what counts and compares them must work there too.
        return pd.DataFrame(rows, columns=list(_FAULT_COLUMNS)).astype(_FAULT_COLUMNS)

    @cached_property
    def false_alarms(self) -> pd.DataFrame:
        """Alarms of valves on which nothing was wrong yet; columns as `alarms`."""
        begin = np.full(self.n_valves, np.inf)
        for fault in self.injected:
            sick = fault.severities(self.n_valves) > 0
            begin[sick] = np.minimum(begin[sick], fault.start)
        alarms: pd.DataFrame = self.alarms
        wrong = alarms["time_s"].to_numpy() < begin[alarms["valve"].to_numpy(int)]
        false: pd.DataFrame = alarms.loc[wrong].reset_index(drop=True)
        return false

    @cached_property
    def summary(self) -> pd.DataFrame:
        """One row a code: counts of ``faults``, ``alarmed``, ``own_code``, ``isolated``; delay."""
        groups = self.faults.groupby("code", sort=False)
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
        table = self.faults
        found, own = table["alarm_s"].count(), table["diagnosed_s"].count()
        return (
            f"{self.n_valves} valves, {self.duration / 3600:g} h, "
            f"{self.n_samples / 1e6:.1f} million samples, {len(self.commands)} motor runs\n"
            f"{len(table)} faults: {found} alarmed, {own} with their own code; "
            f"{len(self.false_alarms)} false alarms"
        )


def watch(
    commands: Iterable[Command],
    faults: Iterable[Fault] = (),
    *,
    rng: np.random.Generator | None = None,
    n_valves: int = 256,
    duration: float = 86400.0,
    idle_step: float = 1.0,
    rules: RuleBase | None = None,
    size: int = 2000,
    **options: Any,
) -> FleetReport:
    """Simulate a fleet block by block, and diagnose it on the way.

    Parameters
    ----------
    commands : iterable of Command
        What the valves are told, such as from `random_commands`.
    faults : iterable of Fault, optional
        What goes wrong, such as from `random_faults`.
    rng : numpy.random.Generator, optional
        Draws the noise of the sensors; there is none if omitted.
    n_valves : int, default 256
        Number of valves, 1..10000.
    duration : float, default 86400
        How long, up to 1e8 [s].
    idle_step : float, default 1
        Time between two readings while no motor runs; it is 0.1 s while one does [s].
    rules : RuleBase, optional
        Those of the paper if omitted.
    size : int, default 2000
        Most instants of a block, which sets the memory; 1..1e6.
    **options
        As `diagnose_run` takes them: reading, k, n, cut.

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
    Readings are those of the slaves. Through the line they come once a scan and in the steps of
    the registers; `shipnet.ballast.testbed` compares what either sees. A motor that is not cooled
    (O1) needs many strokes in a row to reach the 90 degC of its rule: with six a day it never does.

    Examples
    --------
    Two hours of eight valves, which are opened and closed; two of them break:

    >>> rng = np.random.default_rng(2024)
    >>> plan = random_commands(rng, n_valves=8, duration=7200, operations=4, group=4)
    >>> faults = [Fault("V1", start=1000.0, valves=2), Fault("O1", start=1000.0, valves=5)]
    >>> report = watch(plan, faults, rng=rng, n_valves=8, duration=7200)
    >>> report.faults[["code", "headline"]].values.tolist(), len(report.false_alarms)
    ([['V1', 'V1'], ['O1', '']], 0)
    """
    import pandas as pd

    failed = list(faults)
    runs = blocks(
        commands=commands, n_valves=n_valves, duration=duration, faults=failed,
        idle_step=idle_step, rng=rng, size=size,
    )  # fmt: skip
    n_samples, before = 0, None
    strokes, alarms = [], []
    for run in runs:
        diagnosis = diagnose_run(run, rules, after=before, **options)
        n_samples += run.time.size * run.n_valves
        strokes.append(run.strokes[["valve", "action", "start_s", "end_s", "outcome"]])
        alarms.append(diagnosis.alarms)
        before = _without_bulk(diagnosis)
    known = [table for table in alarms if len(table)] or alarms[:1]
    moved = [table for table in strokes if len(table)] or strokes[:1]
    return FleetReport(
        n_valves,
        float(duration),
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
