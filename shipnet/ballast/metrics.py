"""How good a diagnosis is, in numbers with intervals: rates, confusion, false alarms, delay.

What they are taken of here comes from our own simulator, whose faults are made to fit the rules:
that verifies code, it does not validate the method. Every table says so in ``attrs["basis"]``.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np

from shipnet.ballast.commands import Command
from shipnet.ballast.diagnosis import READINGS, Diagnosis, diagnose_run
from shipnet.ballast.sensors import Sensors
from shipnet.ballast.simulation import blocks
from shipnet.ballast.trials import CRITERIA, spread_actuator
from shipnet.errors import ArgumentError
from shipnet.fields import check_scalar, check_whole
from shipnet.fuzzy.rules import NORMAL, UNKNOWN, RuleBase
from shipnet.intervals import event_interval, share_interval

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["BASIS", "confusion", "false_alarms", "rates"]

#: What stands behind the numbers.
BASIS = "own simulator, faults made to fit the rules: verifies code, does not validate the method"

#: A year [s].
_YEAR = 365.25 * 86400


def rates(trials: pd.DataFrame, *, confidence: float = 0.95) -> pd.DataFrame:
    """Return how often faults were found, for each reading and fault.

    Parameters
    ----------
    trials : pandas.DataFrame
        What `fault_trials` returned.
    confidence : float, default 0.95
        Of the intervals.

    Returns
    -------
    pandas.DataFrame
        Indexed by ``reading`` and ``fault``, in the order of the trials: number ``n``; the shares
        of `CRITERIA`, each with its ends ``_low`` and ``_high``
        (`shipnet.intervals.share_interval`); and the median ``delay_s``. For ``normal`` valves
        ``detected`` is the share with a false alarm, ``named`` is 0, and ``isolated`` is the share
        without one.

    Examples
    --------
    >>> from shipnet.ballast.trials import fault_trials
    >>> trials = fault_trials(["O1"], n_valves=20, readings=["fuzzy"],
    ...                       rng=np.random.default_rng(2024))
    >>> rates(trials).loc[("fuzzy", "O1"), ["n", "isolated", "isolated_low"]].round(3).tolist()
    [20.0, 1.0, 0.832]
    """
    import pandas as pd

    groups = trials.groupby(["reading", "fault"], sort=False)
    table = pd.DataFrame({"n": groups.size()})
    for name in CRITERIA:
        hits = groups[name].sum().astype(int)
        table[name] = hits / table["n"]
        ends = share_interval(hits, table["n"], confidence=confidence)
        table[f"{name}_low"], table[f"{name}_high"] = ends
    table["delay_s"] = groups["delay_s"].median()
    table.attrs["basis"] = BASIS
    return table


def confusion(trials: pd.DataFrame, *, reading: str = "fuzzy") -> pd.DataFrame:
    """Return what was said first of which fault.

    Parameters
    ----------
    trials : pandas.DataFrame
        What `fault_trials` returned.
    reading : str, default "fuzzy"
        Which of its readings.

    Returns
    -------
    pandas.DataFrame
        Trials by ``fault`` (rows) and ``headline`` (columns): both in the order of the trials, then
        headlines that are no fault of theirs.

    Raises
    ------
    ArgumentError
        If the trials are of other readings.

    Examples
    --------
    With the motor off, a position far too high is a switch error as well, of higher rank:

    >>> from shipnet.ballast.trials import fault_trials
    >>> trials = fault_trials(["S1", "Pos3"], n_valves=9, readings=["fuzzy"],
    ...                       rng=np.random.default_rng(2024))
    >>> confusion(trials).loc["Pos3"].to_dict()
    {'S1': 9, 'Pos3': 0}
    """
    import pandas as pd

    mine = trials[trials["reading"] == reading]
    if mine.empty:
        known = ", ".join(trials["reading"].unique())
        raise ArgumentError(f"reading is {reading!r}; the trials are of {known}")
    order = list(dict.fromkeys([*mine["fault"], *sorted(mine["headline"].unique())]))
    counted = pd.crosstab(mine["fault"], mine["headline"])
    table = counted.reindex(index=list(mine["fault"].unique()), columns=order, fill_value=0)
    table.attrs["basis"] = BASIS
    return table


def false_alarms(
    *,
    duration: float = 3600.0,
    period: float = 600.0,
    n_valves: int = 256,
    readings: Iterable[str] = tuple(READINGS),
    rules: RuleBase | None = None,
    k: int = 3,
    n: int = 5,
    spread: float = 0.02,
    sensors: Sensors | None = None,
    confidence: float = 0.95,
    rng: np.random.Generator,
) -> pd.DataFrame:
    """Let healthy valves work, and count what is reported of them.

    Parameters
    ----------
    duration : float, default 3600
        For how long, `period`..1e7 [s].
    period : float, default 600
        Time between two commands, which open and close all valves in turn, 60..1e6 [s].
    n_valves : int, default 256
        How many, 1..10000.
    readings, rules, k, n
        As for `fault_trials`.
    spread : float, default 0.02
        How far the valves differ, see `spread_actuator`.
    sensors : Sensors, optional
        What measures; `Sensors` with its defaults if omitted.
    confidence : float, default 0.95
        Of the intervals.
    rng : numpy.random.Generator
        Draws valves and noise of the sensors.

    Returns
    -------
    pandas.DataFrame
        Indexed by ``reading``: ``commands``; those with an ``alarmed`` period, its share
        ``per_command`` with ``_low`` and ``_high`` (`shipnet.intervals.share_interval`);
        ``valve_years``, the ``alarms`` in them (a headline other than normal that follows normal),
        and ``per_valve_year`` with ``_low`` and ``_high`` (`shipnet.intervals.event_interval`).

    Raises
    ------
    ArgumentError
        If an argument is out of its range.

    Notes
    -----
    Sensors are read every second, and ten times as often while a motor runs. A period lasts from a
    command to the next. Noise is white here, sensors neither drift nor age: a lower bound of what a
    ship would see.

    Examples
    --------
    >>> table = false_alarms(duration=120, period=60, n_valves=16, rng=np.random.default_rng(2024))
    >>> table[["commands", "alarmed"]].T
    reading   literal  crisp  fuzzy
    commands       32     32     32
    alarmed        32      0      0
    """
    import pandas as pd

    every = check_scalar("period", period, "s", 60, 1e6)
    time = check_scalar("duration", duration, "s", every, 1e7)
    valves = check_whole("n_valves", n_valves, 1, 10_000)
    starts = np.arange(0.0, time - every + 1e-6, every)
    orders = [Command(("open", "close")[i % 2], start) for i, start in enumerate(starts)]
    wanted = list(readings)
    alarmed = {reading: np.zeros((starts.size, valves), bool) for reading in wanted}
    alarms = dict.fromkeys(wanted, 0)
    last: dict[str, Diagnosis | None] = dict.fromkeys(wanted)
    quiet = {reading: np.ones((1, valves), bool) for reading in wanted}
    actuator = spread_actuator(valves, spread, rng)
    # The last period is whole: it ends just before the next command would come.
    end = starts[-1] + every - 0.1
    for run in blocks(
        actuator, orders, duration=end, sensors=sensors, rng=rng, size=max(2**19 // valves, 1)
    ):
        of = np.minimum((run.time + 1e-6) // every, starts.size - 1).astype(int)
        for reading in wanted:
            found = diagnose_run(run, rules, reading=reading, k=k, n=n, after=last[reading])
            calm = np.isin(found.headline, [NORMAL, UNKNOWN])
            before = np.concatenate([quiet[reading], calm[:-1]])
            alarms[reading] += int((before & ~calm).sum())
            np.logical_or.at(alarmed[reading], of, ~calm)
            last[reading], quiet[reading] = found, calm[-1:]
    hits = np.array([int(alarmed[reading].sum()) for reading in wanted])
    seen = np.array([alarms[reading] for reading in wanted])
    commands, years = starts.size * valves, valves * (starts.size * every) / _YEAR
    share = share_interval(hits, np.full(hits.shape, commands), confidence=confidence)
    rate = event_interval(seen, years, confidence=confidence)
    table = pd.DataFrame(
        {
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
        },
        index=pd.Index(wanted, name="reading"),
    )
    table.attrs["basis"] = BASIS
    return table
