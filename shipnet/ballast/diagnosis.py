"""Diagnosis of valves by the rule table: which faults are reported when, and why.

That it finds the faults of our own simulator verifies code: those faults are made to fit the rules.
It does not validate the method.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from shipnet.ballast.rule_table import rule_base
from shipnet.ballast.sensors import WINDOW, position_speed
from shipnet.ballast.simulation import Run, running_time, valve_row
from shipnet.errors import ArgumentError
from shipnet.fields import check_scalar, check_whole
from shipnet.fuzzy.decision import Decision, top_codes
from shipnet.fuzzy.firing import Firing
from shipnet.fuzzy.rules import RuleBase

if TYPE_CHECKING:
    import pandas as pd


Floats = npt.NDArray[np.float64]


Flags = npt.NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Tail:
    """The end of a run, for the diagnosis of the run that follows it."""

    time: Floats
    samples: dict[str, Floats]
    active_before: Flags
    active: Flags
    started: Floats

    @classmethod
    def keep(
        cls,
        run: Run,
        time: Floats,
        samples: dict[str, Floats],
        active: Flags,
        window: int,
        earlier: Tail | None,
    ) -> Tail:
        """Copy what the next block needs, so that it does not keep this one in memory."""
        before = np.zeros(active.shape[1:], bool) if earlier is None else earlier.active
        last = active[-1].copy() if len(active) else before
        then = int(np.searchsorted(time, time[-1] - WINDOW + 1e-9)) - 1 if time.size else 0
        keep = slice(max(min(then, time.size - window + 1), 0), None)
        started = np.full(run.n_valves, np.nan)
        if "Time" in samples and time.size:
            started = time[-1] - samples["Time"][-1]
            for moved in run.movements:
                if moved.end > time[-1]:
                    started[moved.valve] = np.nan
        kept = {name: x[keep].copy() for name, x in samples.items()}
        return cls(time[keep].copy(), kept, before, last, started)


def rule_inputs(
    run: Run, base: RuleBase, earlier: Tail | None = None, *, any_time: bool = False
) -> dict[str, Floats]:
    """Return the channels that rules speak of, those of the tail before them."""
    found = dict(run.samples)
    if "Time" in base.names:
        found["Time"] = running_time(run, np.nan if earlier is None else earlier.started)
    strange = [name for name in base.names if name not in found]
    if strange:
        raise ArgumentError(f"rules speak of {', '.join(strange)}; a run has {', '.join(found)}")
    found["DVPos"] = np.where(run.active, run.DVPos, np.nan)
    # The change of VPos needs it, whether the rules speak of it or not.
    found = {name: found[name] for name in dict.fromkeys((*base.names, "VPos"))}
    if earlier is not None:
        found = {name: np.concatenate([earlier.samples[name], x]) for name, x in found.items()}
    if any_time and "DVPos" in found:
        kept = 0 if earlier is None else earlier.time.size
        time = run.time if earlier is None else np.concatenate([earlier.time, run.time])
        found["DVPos"][kept:] = position_speed(time, found["VPos"])[kept:]
    return found


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
        """When each code became active first, shape (n_valves, n_rules) [s]; NaN if it did not."""
        if not self.time.size:
            return np.full(self.active.shape[1:], np.nan)
        return np.where(self.active.any(axis=0), self.time[self.active.argmax(axis=0)], np.nan)

    @cached_property
    def alarms(self) -> pd.DataFrame:
        """One row for every time a code becomes active, in order of time."""
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
        """Return what the master would show after every command."""
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
        """Return the firing strengths of one valve over time."""
        k = check_whole("valve", valve, 0, self.run.n_valves - 1)
        return _fire(self.base, {name: x[:, k] for name, x in self.samples.items()}, self.reading)

    def decision(self, valve: int) -> Decision:
        """Return what was decided for one valve: its `table` and reasons."""
        return Decision(self.firing(valve), self.cut, self.active[:, valve])

    def explain(self, valve: int, time: float) -> str:
        """Return why a valve is diagnosed as it is, in one sentence."""
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
    """Diagnose all valves at all instants of a run."""
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
