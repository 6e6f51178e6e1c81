"""Diagnosis of valves by the rule table: which faults are reported when, and why.

That it finds the faults of our own simulator verifies code: those faults are made to fit the rules.
It does not validate the method.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from shipnet.ballast.rule_table import rule_base
from shipnet.ballast.sensors import WINDOW, position_speed
from shipnet.ballast.simulation import Run, running_time, stroke_rows, valve_row
from shipnet.errors import ArgumentError
from shipnet.fields import check_scalar, check_whole
from shipnet.fuzzy.firing import Samples, check_method
from shipnet.fuzzy.rules import Decision, Firing, RuleBase

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes


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


#: Valve readings whose strengths are held at once: 12 rules of them take 25 MB.
_AT_ONCE = 2**18


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """What is reported of every valve at every instant, as `Run.diagnose` returns it.

    Parameters
    ----------
    run : Run
        What was read.
    base : shipnet.fuzzy.RuleBase
        The rules.
    method : str
        ``fuzzy``, ``midpoint`` or ``crisp``.
    k, n : int
        A code is active if its rule fired in `k` of the last `n` instants.
    threshold : float
        Strength from which on a rule fires.
    samples : dict of str to ndarray, shape (n_times, n_valves)
        The values of each variable; NaN where it does not count.
    active : ndarray of bool, shape (n_times, n_valves, n_rules)
        Which codes are active, in the order of ``base.codes``; valve 1 comes first.
    tail : Tail
        What the diagnosis of the run that follows needs.

    Notes
    -----
    V2 asks for no change of position. But for ``crisp`` that counts only while a command is active,
    its target is not reached, and the motor has been running for a second; else a healthy valve at
    rest would have a leaking piston. ``midpoint`` and ``fuzzy`` with a threshold of 0.5 decide the
    same.

    Examples
    --------
    >>> from shipnet.ballast.plant import Command
    >>> from shipnet.ballast.simulation import simulate
    >>> from shipnet.ballast.plant import Fault
    >>> stuck = Fault("V1", valves=2)
    >>> run = simulate(2, [Command("open", 1.0)], faults=stuck, until=25, rng=2024)
    >>> found = run.diagnose()
    >>> found
    Diagnosis(2 valves, valve 2: V1)
    >>> found.commands()[["valve", "active", "top_fault", "delay_s"]].round(1).values.tolist()
    [[1, '', 'normal', nan], [2, 'V1', 'V1', 0.2]]
    >>> found.explain(2, 2.0)
    'V1 1.00: FP 126.7 bar high 1.00, OP 10 bar high 1.00'
    """

    run: Run
    base: RuleBase
    method: str
    k: int
    n: int
    threshold: float
    samples: dict[str, Floats]
    active: Flags
    tail: Tail

    @property
    def time(self) -> Floats:
        """Instants, shape (n_times,) [s]."""
        return self.run.time

    @cached_property
    def top(self) -> npt.NDArray[np.object_]:
        """The first of the active codes, ``normal`` or ``unknown``; shape (n_times, n_valves)."""
        silent = np.logical_and.reduce([np.isnan(self.samples[name]) for name in self.base.names])
        return self.base.top_codes(self.active, silent)

    @cached_property
    def onset(self) -> Flags:
        """Where a code becomes active that was not before, shape as `active`."""
        new = self.active.copy()
        new[1:] &= ~self.active[:-1]
        new[:1] &= ~self.tail.active_before
        return new

    @cached_property
    def alarm_times(self) -> Floats:
        """When each code became active first, shape (n_valves, n_rules) [s]; NaN if it did not."""
        if not self.time.size:
            return np.full(self.active.shape[1:], np.nan)
        return np.where(self.active.any(axis=0), self.time[self.active.argmax(axis=0)], np.nan)

    def alarms(self) -> pd.DataFrame:
        """One row for every time a code becomes active, in order of time."""
        import pandas as pd

        rows, valves, places = np.nonzero(self.onset)
        return pd.DataFrame(
            {
                "time_s": self.time[rows],
                "valve": valves + 1,
                "code": np.array(self.base.codes, dtype=object)[places],
                "top_fault": self.top[rows, valves],
            }
        )

    def commands(self, settle: float = 5.0) -> pd.DataFrame:
        """Return what the master would show after every command."""
        wait = check_scalar("settle", settle, "s", 0, 3600)
        table = stroke_rows(self.run)[["valve", "action", "start_s", "end_s", "outcome"]].copy()
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
        table["top_fault"] = self.base.top_codes(found)
        table["delay_s"] = delay
        return table

    def firing(self, valve: int) -> Firing:
        """Return the firing strengths of one valve over time."""
        k = self._place(valve)
        return _fire(self.base, {name: x[:, k] for name, x in self.samples.items()}, self.method)

    def decision(self, valve: int) -> Decision:
        """Return what was decided for one valve: its table, its reasons, a picture over time."""
        return Decision(self.firing(valve), self.threshold, self.active[:, self._place(valve)])

    def explain(self, valve: int, time: float) -> str:
        """Return why a valve is diagnosed as it is at a time [s], in one sentence.

        The last instant that is not after it counts. A code that fires, but not for long enough, is
        not active yet.
        """
        row, k = valve_row(self.run, time), self._place(valve)
        given = {name: x[row : row + 1, k] for name, x in self.samples.items()}
        firing = _fire(self.base, given, self.method)
        return Decision(firing, self.threshold, self.active[row : row + 1, k]).explain(0)

    def is_active(self, valve: int, code: str) -> Flags:
        """Return at which instants a code is active."""
        return np.asarray(self.active[:, self._place(valve), self._column(code)])

    def first_alarm(self, valve: int, code: str) -> float:
        """Return when a code became active first [s]; NaN if it did not."""
        return float(self.alarm_times[self._place(valve), self._column(code)])

    def n_alarms(self, valve: int, code: str | None = None) -> int:
        """Return how often a code, or any, became active that was not before."""
        mine = self.onset[:, self._place(valve)]
        return int(mine.sum() if code is None else mine[:, self._column(code)].sum())

    def plot(self, valve: int = 1, ax: Axes | None = None) -> Axes:
        """Draw the greatest strength of each rule, and what was found, after Figure 13."""
        from shipnet.ballast.plot import plot_diagnosis

        return plot_diagnosis(self, ax, valve)

    def __repr__(self) -> str:
        """Return the numbers of valves and alarms, and the top fault of each that has one."""
        n, ever = self.run.n_valves, np.asarray(self.active.any(axis=0))
        found, said = np.flatnonzero(ever.any(axis=1)), self.base.top_codes(ever)
        faults = ", ".join(f"valve {k + 1}: {said[k]}" for k in found[:3])
        more = f" and {found.size - 3} more" if found.size > 3 else ""
        return f"Diagnosis({n} valve{'s' if n != 1 else ''}, {faults or 'all normal'}{more})"

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
    after: Diagnosis | None = None,
) -> Diagnosis:
    """Diagnose all valves at all instants of a run."""
    base = rules if rules is not None else rule_base()
    check_method(method)
    window = check_whole("n", n, 1, 1000)
    if after is not None:
        _check_after(run, after, (base, method, k, n, threshold))
    earlier = after.tail if after is not None else None
    time = run.time if earlier is None else np.concatenate([earlier.time, run.time])
    samples = rule_inputs(run, base, earlier, any_time=method == "crisp")
    kept = time.size - run.time.size
    active = np.empty((run.time.size, run.n_valves, len(base.rules)), bool)
    size = max(_AT_ONCE // run.n_valves, window)
    # Also decided when there is nothing to decide, so that wrong arguments are refused.
    for start in range(kept, max(time.size, kept + 1), size):
        first = max(start - window + 1, 0)
        part = {name: x[first : start + size] for name, x in samples.items()}
        decided = _fire(base, part, method).decide(threshold=threshold, k=k, n=n).active
        active[start - kept : start - kept + size] = decided[start - first :]
    own = {name: x[kept:] for name, x in samples.items()}
    tail = Tail.keep(run, time, samples, active, window, earlier)
    return Diagnosis(run, base, method, k, n, threshold, own, active, tail)


def _fire(base: RuleBase, samples: dict[str, Floats], method: str) -> Firing:
    return base.fire({name: samples[name] for name in base.names}, method)


def _check_after(run: Run, after: Diagnosis, settings: tuple[object, ...]) -> None:
    if (after.base, after.method, after.k, after.n, after.threshold) != settings:
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


def diagnose(
    readings: Samples | None = None,
    method: str = "fuzzy",
    *,
    threshold: float = 0.5,
    rules: RuleBase | None = None,
    **values: float,
) -> Decision:
    """Diagnose readings of a valve.

    Parameters
    ----------
    readings : mapping of str to array_like, or DataFrame, optional
        Values of FP and OP [bar], MC [A], OT [degC], VPos [%] and DVPos [%/s] by name. One that is
        left out is missing, as is NaN, and a rule that needs it does not fire.
    method : {"fuzzy", "crisp", "midpoint"}, default "fuzzy"
        How the rules are read: with ramps, as comparisons as printed, or as comparisons in the
        middle of the ramps.
    threshold : float, default 0.5
        Strength from which on a rule counts, above 0, up to 1.
    rules : shipnet.fuzzy.RuleBase, optional
        The rules; `rule_base` if omitted.
    **values : float
        Readings by keyword, in place of or beside `readings`.

    Returns
    -------
    shipnet.fuzzy.Decision
        The top fault, all active codes, and why.

    Raises
    ------
    ArgumentError
        If there is no such sensor or method, or a value is not a number.

    Examples
    --------
    >>> diagnose(FP=125, OP=4, MC=4)
    Decision(P1 1.00: FP 125 bar high 1.00, MC 4 A over 1.00; also V1 1.00; missing OT VPos DVPos)
    >>> diagnose(FP=90, OP=2, MC=1.2, OT=50, VPos=50, DVPos=11).top.item()
    'normal'
    """
    base = rules if rules is not None else rule_base()
    given: dict[str, Any] = {} if readings is None else dict(readings)
    return base.decide({**given, **values}, method, threshold=threshold)
