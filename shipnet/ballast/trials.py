"""Trials of the diagnosis: valves with a known fault open and close once, and what is reported.

The faults are those of our own simulator, made to fit the rules: a high rate verifies code, it does
not validate the method.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import numpy.typing as npt

from shipnet.ballast.actuator import Actuator
from shipnet.ballast.commands import Command
from shipnet.ballast.diagnosis import READINGS, Diagnosis, diagnose_run
from shipnet.ballast.faults import FAULTS, Fault
from shipnet.ballast.rule_table import rule_base
from shipnet.ballast.sensors import Sensors
from shipnet.ballast.simulation import blocks
from shipnet.errors import ArgumentError
from shipnet.fields import check_scalar, check_whole
from shipnet.fuzzy.decision import top_codes
from shipnet.fuzzy.rules import NORMAL, RuleBase

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["CRITERIA", "fault_trials", "half_found", "spread_actuator"]

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
    """Return valves that differ from each other as new ones do.

    Parameters
    ----------
    n_valves : int
        How many, 1..10000.
    spread : float
        Standard deviation of the logarithm of pump leak, restrictor and bearing torque, 0..0.5; our
        assumption.
    rng : numpy.random.Generator
        Draws them.

    Returns
    -------
    Actuator
        With arrays of `n_valves`.

    Raises
    ------
    ArgumentError
        If an argument is out of its range.

    Examples
    --------
    >>> from shipnet.ballast import operating_point
    >>> some = spread_actuator(5, 0.02, np.random.default_rng(2024))
    >>> operating_point(some).FP.round(1).tolist()
    [89.7, 87.1, 88.2, 84.7, 88.0]
    """
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
    """What became of trials, for one reading of the rules.

    Attributes
    ----------
    active : ndarray of bool, shape (n_valves, n_rules)
        Which codes were active at any time.
    first : ndarray of float, shape (n_valves,)
        When the first of them became so [s]; NaN if none did.
    """

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


def half_found(
    codes: Sequence[str] = tuple(FAULTS),
    *,
    n_valves: int = 32,
    reading: str = "fuzzy",
    criterion: str = "named",
    rules: RuleBase | None = None,
    k: int = 3,
    n: int = 5,
    spread: float = 0.02,
    sensors: Sensors | None = None,
    steps: int = 8,
    rng: np.random.Generator,
) -> pd.DataFrame:
    """Return how severe faults must be before half of the valves are found, by bisection.

    Parameters
    ----------
    codes : sequence of str, optional
        Faults; all if omitted.
    n_valves : int, default 32
        Valves with each fault.
    reading : str, default "fuzzy"
        One of `READINGS`.
    criterion : str, default "named"
        One of `CRITERIA`.
    rules, k, n, spread, sensors
        As for `fault_trials`.
    steps : int, default 8
        Bisections, 1..20; the last leaves an uncertainty of 2**-(steps + 1).
    rng : numpy.random.Generator
        Draws valves and noise of the sensors.

    Returns
    -------
    pandas.DataFrame
        Indexed by ``fault``: the severity at which ``half`` are found, and at which the first and
        last tenth are, ``tenth`` and ``nine_tenths``; NaN beyond severity 1.

    Raises
    ------
    ArgumentError
        If an argument is out of its range.

    Notes
    -----
    Each valve is halved in by itself, all at once, with new noise at every step. That takes the
    criterion to be met from some severity on for good; `isolated` need not be, where a code of
    higher rank joins in later.

    Examples
    --------
    A position that is 2.5 % wrong has half of the membership; the fault adds 15 %:

    >>> table = half_found(["Pos3"], n_valves=8, steps=6, rng=np.random.default_rng(2024))
    >>> bool(abs(table.loc["Pos3", "half"] - 2.5 / 15) < 0.02)
    True
    """
    import pandas as pd

    if criterion not in CRITERIA:
        raise ArgumentError(f"criterion is {criterion!r}; it must be one of {', '.join(CRITERIA)}")
    wanted = _some("codes", codes)
    valves = check_whole("n_valves", n_valves, 1, 10_000 // len(wanted))
    turns = check_whole("steps", steps, 1, 20)
    base = rules if rules is not None else rule_base()
    faults = np.repeat(np.array(wanted, dtype=object), valves)
    actuator = spread_actuator(faults.size, spread, rng)

    def are_found(severities: Floats) -> Flags:
        outcome = _cycle(actuator, faults, severities, base, [reading], (k, n), sensors, rng)[
            reading
        ]
        return _found(base, faults, outcome, criterion)

    low, high = np.zeros(faults.size), np.ones(faults.size)
    never = ~are_found(high)
    for _ in range(turns):
        middle = (low + high) / 2
        yes = are_found(middle)
        low, high = np.where(yes, low, middle), np.where(yes, middle, high)
    severity = np.where(never, np.inf, (low + high) / 2).reshape(len(wanted), valves)
    rows = np.quantile(severity, [0.1, 0.5, 0.9], axis=1, method="higher").T
    return pd.DataFrame(
        np.where(np.isinf(rows), np.nan, rows),
        columns=["tenth", "half", "nine_tenths"],
        index=pd.Index(wanted, name="fault"),
    )


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
