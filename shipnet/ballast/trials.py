"""Trials of the diagnosis, and how good it is: rates with intervals, confusion, false alarms.

The faults are those of our own simulator, made to fit the rules: a high rate verifies code, it does
not validate the method.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import numpy.typing as npt

from shipnet.ballast.actuator import Actuator
from shipnet.ballast.diagnosis import READINGS, Diagnosis, diagnose_run
from shipnet.ballast.plant import Command
from shipnet.ballast.rule_table import rule_base
from shipnet.ballast.sensors import Sensors
from shipnet.ballast.simulation import blocks
from shipnet.ballast.valve_faults import FAULTS, Fault
from shipnet.errors import ArgumentError
from shipnet.fields import check_scalar, check_whole
from shipnet.fuzzy.decision import top_codes
from shipnet.fuzzy.rules import NORMAL, UNKNOWN, RuleBase
from shipnet.intervals import event_interval, share_interval

if TYPE_CHECKING:
    import pandas as pd


Floats = npt.NDArray[np.float64]


Flags = npt.NDArray[np.bool_]


#: When a fault counts as found.
CRITERIA = {
    "detected": "any code was active",
    "named": "its own code was active",
    "isolated": "its own code was the headline",
}


#: A trial: rest, open, rest, close, rest [s]. A motor may run for 20 s.
_OPEN, _CLOSE, _END = 5.0, 35.0, 65.0


#: Instants of a block: what 3328 valves read in it takes 27 MB.
_BLOCK = 100


def spread_actuator(n_valves: int, spread: float, rng: np.random.Generator) -> Actuator:
    """Return valves that differ from each other as new ones do."""
    n = check_whole("n_valves", n_valves, 1, 10_000)
    sigma = check_scalar("spread", spread, "", 0, 0.5)
    usual = Actuator()
    factors = np.exp(sigma * rng.standard_normal((3, n)))
    return Actuator(
        pump_leak=usual.pump_leak * factors[0],
        restrictor=usual.restrictor * factors[1],
        bearing_torque=usual.bearing_torque * factors[2],
    )


class Outcome(NamedTuple):
    """What became of trials, for one reading of the rules."""

    active: Flags
    first: Floats


def fault_trials(
    codes: Iterable[str] = (NORMAL, *FAULTS),
    *,
    n_valves: int = 256,
    severity: npt.ArrayLike = 1.0,
    readings: Iterable[str] = tuple(READINGS),
    rules: RuleBase | None = None,
    k: int = 3,
    n: int = 5,
    spread: float = 0.02,
    sensors: Sensors | None = None,
    rng: np.random.Generator,
) -> pd.DataFrame:
    """Let valves with each fault open and close once, and diagnose them.

    Parameters
    ----------
    codes : iterable of str, optional
        Faults; ``normal`` are healthy valves. All of them if omitted.
    n_valves : int, default 256
        Valves with each fault; 10000 in all at most.
    severity : float or array_like of float, shape (n_valves,), default 1
        How severe the faults are, 0..1.
    readings : iterable of str, optional
        Readings of the rules, see `READINGS`; all if omitted. They see the same sensors.
    rules, k, n
        As for `diagnose_run`.
    spread : float, default 0.02
        How far the valves differ, see `spread_actuator`.
    sensors : Sensors, optional
        What measures; `Sensors` with its defaults if omitted.
    rng : numpy.random.Generator
        Draws valves and noise of the sensors.

    Returns
    -------
    pandas.DataFrame
        One row a trial and reading: ``reading``, ``fault``, ``valve``, ``severity``; the codes
        ``active`` at any time of it, their ``headline``, the flags of `CRITERIA`, and ``delay_s``
        from the first command to the first code: 0 if it was active before, NaN if there was none.

    Raises
    ------
    ArgumentError
        If an argument is out of its range.

    Notes
    -----
    The fault is there from the beginning. The valve rests closed for 5 s, opens, rests, is told to
    close 30 s later, and is watched for 30 s more.

    Examples
    --------
    >>> trials = fault_trials(["normal", "V1"], n_valves=8, rng=np.random.default_rng(2024))
    >>> trials.groupby("reading")["headline"].unique().str.join(" ").to_dict()
    {'crisp': 'normal V1', 'fuzzy': 'normal V1', 'literal': 'P2 V1'}
    """
    import pandas as pd

    wanted, asked = _some("codes", codes), _some("readings", readings)
    valves = check_whole("n_valves", n_valves, 1, 10_000 // len(wanted))
    try:
        each = np.broadcast_to(np.asarray(severity, float), valves)
    except (TypeError, ValueError):
        raise ArgumentError(
            f"severity is {severity!r}; it must be 0..1, one for all or one for each of {valves} "
            "valves"
        ) from None
    severities = np.tile(each, len(wanted))
    base = rules if rules is not None else rule_base()
    faults = np.repeat(np.array(wanted, dtype=object), valves)
    actuator = spread_actuator(faults.size, spread, rng)
    found = _cycle(actuator, faults, severities, base, asked, (k, n), sensors, rng)
    ranked = [base.codes.index(code) for code in base.ranking]
    names = np.array(base.ranking, dtype=object)
    tables = []
    for reading, outcome in found.items():
        rows = {
            "reading": reading,
            "fault": faults,
            "valve": np.tile(np.arange(valves), len(wanted)),
            "severity": np.where(faults == NORMAL, 0.0, severities),
            "active": [" ".join(names[row]) for row in outcome.active[:, ranked]],
            "headline": top_codes(base, outcome.active),
            **{name: _found(base, faults, outcome, name) for name in CRITERIA},
            "delay_s": np.maximum(outcome.first - _OPEN, 0.0),
        }
        tables.append(pd.DataFrame(rows))
    return pd.concat(tables, ignore_index=True)


def _some(name: str, words: Iterable[str]) -> list[str]:
    given = [words] if isinstance(words, str) else list(words)
    if not given:
        raise ArgumentError(f"{name} is empty; it must have one or more")
    if len(given) > 10_000:
        raise ArgumentError(f"{name} has {len(given)} words; it must have 10000 at most")
    return given


def _found(base: RuleBase, faults: npt.NDArray[np.object_], outcome: Outcome, how: str) -> Flags:
    if how == "detected":
        return np.asarray(outcome.active.any(axis=1))
    if how == "isolated":
        return np.asarray(top_codes(base, outcome.active) == faults)
    own = faults[:, np.newaxis] == np.array(base.codes, dtype=object)
    return np.asarray((outcome.active & own).any(axis=1))


def _cycle(
    actuator: Actuator,
    faults: npt.NDArray[np.object_],
    severities: Floats,
    base: RuleBase,
    readings: list[str],
    persistence: tuple[int, int],
    sensors: Sensors | None,
    rng: np.random.Generator,
) -> dict[str, Outcome]:
    """Simulate one trial of every valve, and diagnose it in every reading."""
    known = [code for code in dict.fromkeys(faults) if code != NORMAL]
    plan = []
    for code in known:
        mine = np.flatnonzero(faults == code)
        plan.append(Fault(code, severities[mine], valves=mine))
    orders = [Command("open", _OPEN), Command("close", _CLOSE)]
    k, n = persistence
    last: dict[str, Diagnosis | None] = dict.fromkeys(readings)
    active = {reading: np.zeros((faults.size, len(base.rules)), bool) for reading in readings}
    first = {reading: np.full(faults.size, np.nan) for reading in readings}
    for run in blocks(
        actuator,
        orders,
        duration=_END,
        faults=plan,
        sensors=sensors,
        rng=rng,
        idle_step=0.5,
        size=_BLOCK,
    ):
        for reading in readings:
            found = diagnose_run(run, base, reading=reading, k=k, n=n, after=last[reading])
            active[reading] |= found.active.any(axis=0)
            soonest = np.fmin.reduce(found.first_alarm, axis=1)
            first[reading] = np.fmin(first[reading], soonest)
            last[reading] = found
    return {reading: Outcome(active[reading], first[reading]) for reading in readings}


#: What stands behind the numbers.
BASIS = "own simulator, faults made to fit the rules: verifies code, does not validate the method"


#: A year [s].
_YEAR = 365.25 * 86400


def rates(trials: pd.DataFrame, *, confidence: float = 0.95) -> pd.DataFrame:
    """Return how often faults were found, for each reading and fault."""
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
    """Return what was said first of which fault."""
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
