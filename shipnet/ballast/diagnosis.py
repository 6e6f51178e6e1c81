"""Diagnosis of valves by the rule table: which faults are reported when, and why.

Twelve rules and five sensors in three readings (`READINGS`). That one of them finds the faults of
`shipnet.ballast.faults` verifies code: the faults are made to fit the rules. It does not validate
the method.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from shipnet.ballast.features import valve_row
from shipnet.ballast.inputs import Tail, rule_inputs
from shipnet.ballast.rule_table import rule_base
from shipnet.ballast.simulation import Run
from shipnet.errors import ArgumentError
from shipnet.fields import check_scalar, check_whole
from shipnet.fuzzy.decision import Decision, top_codes
from shipnet.fuzzy.firing import Firing
from shipnet.fuzzy.rules import RuleBase

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["READINGS", "Diagnosis", "diagnose_run"]

Floats = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]

#: How the table is read, and what that means.
READINGS = {
    "literal": "comparisons as printed; DVPos is the change of VPos at any time",
    "crisp": "limits in the middle of the ramps; DVPos counts while a command is active only",
    "fuzzy": "firing strengths, cut; DVPos counts while a command is active only",
}

#: Valve readings whose strengths are held at once: 12 rules of them take 25 MB.
_AT_ONCE = 2**18


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """What is reported of every valve at every instant.

    Parameters
    ----------
    run : Run
        What was read.
    base : RuleBase
        The rules.
    reading : str
        One of `READINGS`.
    k, n : int
        A code is active if it fired in `k` of the last `n` instants.
    cut : float
        Strength from which on a rule fires.
    samples : dict of str to ndarray, shape (n_times, n_valves)
        What the rules were given, by the name of the variable; NaN where it does not count.
    active : ndarray of bool, shape (n_times, n_valves, n_rules)
        Which codes are active, in the order of ``base.codes``.
    tail : Tail
        What the diagnosis of the run that follows needs to know of this one.
    """

    run: Run
    base: RuleBase
    reading: str
    k: int
    n: int
    cut: float
    samples: dict[str, Floats]
    active: Flags
    tail: Tail

    @property
    def time(self) -> Floats:
        """Instants, shape (n_times,) [s]."""
        return self.run.time

    @cached_property
    def headline(self) -> npt.NDArray[np.object_]:
        """The first of the active codes, ``normal`` or ``unknown``; shape (n_times, n_valves)."""
        silent = np.logical_and.reduce([np.isnan(self.samples[name]) for name in self.base.names])
        return top_codes(self.base, self.active, silent)

    @cached_property
    def onset(self) -> Flags:
        """Where a code becomes active that was not before, shape as `active`."""
        new = self.active.copy()
        new[1:] &= ~self.active[:-1]
        new[:1] &= ~self.tail.active_before
        return new

    @cached_property
    def first_alarm(self) -> Floats:
        """When each code became active first, shape (n_valves, n_rules) [s]; NaN if it did not.

        A code that was active before this run began has the time of its first instant.
        """
        if not self.time.size:
            return np.full(self.active.shape[1:], np.nan)
        return np.where(self.active.any(axis=0), self.time[self.active.argmax(axis=0)], np.nan)

    @cached_property
    def alarms(self) -> pd.DataFrame:
        """One row for every time a code becomes active, in order of time.

        ``time_s``, ``valve``, ``code``, and the ``headline`` of the valve then.
        """
        import pandas as pd

        rows, valves, places = np.nonzero(self.onset)
        return pd.DataFrame(
            {
                "time_s": self.time[rows],
                "valve": valves,
                "code": np.array(self.base.codes, dtype=object)[places],
                "headline": self.headline[rows, valves],
            }
        )

    def commands(self, settle: float = 5.0) -> pd.DataFrame:
        """Return what the master would show after every command.

        Parameters
        ----------
        settle : float, default 5
            How long a valve is watched after its motor has stopped, 0..3600 [s], but not into its
            next run: rules that need the motor off have `k` instants to fire in.

        Returns
        -------
        pandas.DataFrame
            One row for each run of a motor that has ended: ``valve``, ``action``, ``start_s``,
            ``end_s``, ``outcome``; the codes ``active`` meanwhile, highest priority first, the
            ``headline`` among them or ``normal``; ``delay_s`` from the command to the first code,
            NaN without one. Of a command that began before this run only the rest is seen.

        Raises
        ------
        ArgumentError
            If `settle` is out of range.
        """
        wait = check_scalar("settle", settle, "s", 0, 3600)
        table = self.run.strokes[["valve", "action", "start_s", "end_s", "outcome"]].copy()
        found = np.zeros((len(table), len(self.base.codes)), bool)
        delay = np.full(len(table), np.nan)
        for place, moved in enumerate(self.run.movements):
            first, ended, last = np.searchsorted(
                self.time, [moved.start - 1e-9, moved.end - 1e-9, moved.end + wait + 1e-9]
            )
            again = np.flatnonzero(self.run.running[ended:last, moved.valve])
            last = ended + again[0] if again.size else last
            seen = self.active[first:last, moved.valve]
            if seen.any():
                found[place] = seen.any(axis=0)
                delay[place] = self.time[first + seen.any(axis=1).argmax()] - moved.start
        ranked = [self.base.codes.index(code) for code in self.base.ranking]
        names = np.array(self.base.ranking, dtype=object)
        table["active"] = [" ".join(names[row]) for row in found[:, ranked]]
        table["headline"] = top_codes(self.base, found)
        table["delay_s"] = delay
        return table

    def firing(self, valve: int) -> Firing:
        """Return the firing strengths of one valve over time.

        Parameters
        ----------
        valve : int
            Which, from 0 on.
        """
        k = check_whole("valve", valve, 0, self.run.n_valves - 1)
        return _fire(self.base, {name: x[:, k] for name, x in self.samples.items()}, self.reading)

    def decision(self, valve: int) -> Decision:
        """Return what was decided for one valve: its `table` and reasons.

        Parameters
        ----------
        valve : int
            Which, from 0 on.
        """
        return Decision(self.firing(valve), self.cut, self.active[:, valve])

    def explain(self, valve: int, time: float) -> str:
        """Return why a valve is diagnosed as it is, in one sentence.

        Parameters
        ----------
        valve : int
            Which, from 0 on.
        time : float
            When [s]; the last instant that is not after it counts.

        Returns
        -------
        str
            As from `shipnet.fuzzy.Decision.explain`. A code that fires, but not for long enough,
            is not active yet.
        """
        row = valve_row(self.run, time)
        k = check_whole("valve", valve, 0, self.run.n_valves - 1)
        given = {name: x[row : row + 1, k] for name, x in self.samples.items()}
        firing = _fire(self.base, given, self.reading)
        return Decision(firing, self.cut, self.active[row : row + 1, k]).explain(0)


def diagnose_run(
    run: Run,
    rules: RuleBase | None = None,
    *,
    reading: str = "fuzzy",
    k: int = 3,
    n: int = 5,
    cut: float = 0.5,
    after: Diagnosis | None = None,
) -> Diagnosis:
    """Diagnose all valves at all instants of a run.

    Parameters
    ----------
    run : Run
        What was read, as from `simulate`, or one of `blocks`.
    rules : RuleBase, optional
        The rules; those of the paper if omitted.
    reading : {"fuzzy", "crisp", "literal"}, default "fuzzy"
        How they are read, see `READINGS`.
    k, n : int, default 3 and 5
        A code is active if it fired in `k` or more of the last `n` instants, 1 <= k <= n <= 1000,
        however far these lie apart.
    cut : float, default 0.5
        Strength from which on a rule fires, above 0, up to 1.
    after : Diagnosis, optional
        That of the block before, with the same settings; the rules then see no edge.

    Returns
    -------
    Diagnosis
        Active codes, headlines, alarms, reasons.

    Raises
    ------
    ArgumentError
        If an argument is out of its range, if a rule needs what no run has, or if `after` was made
        otherwise or is of other valves.

    Notes
    -----
    V2 asks for no change of position. In the readings ``crisp`` and ``fuzzy`` that counts only
    while a command is active, its target is not reached, and the motor has been running for a
    second; else a healthy valve at rest would have a leaking piston. All other channels count at
    any time. ``crisp`` and ``fuzzy`` with a cut of 0.5 decide the same.

    Memory beyond the run is some 40 bytes for each valve and instant.

    Examples
    --------
    >>> from shipnet.ballast import Command, Fault, simulate
    >>> stuck = [Fault("V1", valves=1)]
    >>> run = simulate(commands=[Command("open", 1.0)], n_valves=2, duration=25, faults=stuck,
    ...                rng=np.random.default_rng(2024))
    >>> diagnosis = diagnose_run(run)
    >>> diagnosis.commands()[["valve", "active", "headline", "delay_s"]].round(1).values.tolist()
    [[0, '', 'normal', nan], [1, 'V1', 'V1', 0.2]]
    >>> diagnosis.explain(1, 2.0)
    'V1 1.00: FP 126.7 bar high 1.00, OP 10 bar high 1.00'
    """
    base = rules if rules is not None else rule_base()
    if not isinstance(reading, str) or reading not in READINGS:
        raise ArgumentError(f"reading is {reading!r}; it must be one of {', '.join(READINGS)}")
    window = check_whole("n", n, 1, 1000)
    if after is not None:
        _check_after(run, after, (base, reading, k, n, cut))
    earlier = after.tail if after is not None else None
    time = run.time if earlier is None else np.concatenate([earlier.time, run.time])
    samples = rule_inputs(run, base, earlier, any_time=reading == "literal")
    kept = time.size - run.time.size
    active = np.empty((run.time.size, run.n_valves, len(base.rules)), bool)
    size = max(_AT_ONCE // run.n_valves, window)
    # Also decided when there is nothing to decide, so that wrong arguments are refused.
    for start in range(kept, max(time.size, kept + 1), size):
        first = max(start - window + 1, 0)
        part = {name: x[first : start + size] for name, x in samples.items()}
        decided = _fire(base, part, reading).decide(threshold=cut, k=k, n=n).active
        active[start - kept : start - kept + size] = decided[start - first :]
    own = {name: x[kept:] for name, x in samples.items()}
    tail = Tail.keep(run, time, samples, active, window, earlier)
    return Diagnosis(run, base, reading, k, n, cut, own, active, tail)


def _fire(base: RuleBase, samples: dict[str, Floats], reading: str) -> Firing:
    method = {"fuzzy": "fuzzy", "crisp": "midpoint", "literal": "crisp"}[reading]
    return base.fire({name: samples[name] for name in base.names}, method)


def _check_after(run: Run, after: Diagnosis, settings: tuple[object, ...]) -> None:
    if (after.base, after.reading, after.k, after.n, after.cut) != settings:
        raise ArgumentError("after was diagnosed with other rules or settings; they must be equal")
    if after.run.n_valves != run.n_valves:
        raise ArgumentError(
            f"after is of {after.run.n_valves} valves; the run is of {run.n_valves}"
        )
    if run.time.size and after.tail.time.size and not run.time[0] > after.tail.time[-1]:
        raise ArgumentError(
            f"after ends at {after.tail.time[-1]:g} s; the run begins at {run.time[0]:g} s, which "
            "must be later"
        )
