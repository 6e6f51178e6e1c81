"""What every single fault costs: points lost, old values shown as good, alarms, two rules."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from math import inf
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from shipnet.clock import nanoseconds
from shipnet.engine.age import marking
from shipnet.engine.faults import Fault, check_faults, single_faults
from shipnet.engine.simulation import simulate
from shipnet.engine.system import RULE, System
from shipnet.errors import ArgumentError
from shipnet.fields import check_scalar, check_whole

if TYPE_CHECKING:
    import pandas as pd

    from shipnet.engine.result import Run

__all__ = ["fault_table"]

#: From a fault that lasts to the end of its run [s]: the same for all designs, unless marks take
#: longer in one.
_LENGTH = 20.0


def fault_table(
    system: System,
    faults: Iterable[Fault] | None = None,
    *,
    rule: float = RULE,
    trials: int = 5,
    rng: np.random.Generator | None = None,
) -> pd.DataFrame:
    """Return what each fault does, by simulation; the worst of some random phases of all clocks.

    Parameters
    ----------
    system : System
        The system.
    faults : iterable of Fault, optional
        Each happens alone, from its start to its stop; `single_faults` if not given.
    rule : float, default 2
        Longest time of an answer, and of the age of a value, 0.1..100 [s]. The paper asks it of
        the answer alone.
    trials : int, default 5
        How often each fault is simulated, 1..1000.
    rng : numpy.random.Generator, optional
        Draws phases and losses; one seeded with 2024 if not given.

    Returns
    -------
    pandas.DataFrame
        One row a fault: ``fault``; ``lost`` (points of which no newer value arrives as long as
        the fault lasts), ``old`` (points shown as good beyond the age of `rule`), ``oldest_s``
        (greatest age shown as good; infinite if it grows for as long as the fault lasts, and the
        fault lasts for good), ``marked`` (points marked at some time), ``marked_after_s``
        (longest time from the fault until the last of them was first marked, NaN if none),
        ``noticed`` (what the AMS raises: ``link``, ``path``, ``mark``, or ``no``), ``answer_s``
        (longest answer), ``answer_ok`` (rule a: an answer within the time), and ``age_ok`` (rule
        b: nothing older is shown as good). The first row is the system in health.

    Raises
    ------
    ArgumentError
        If an argument is out of its range.

    Notes
    -----
    An old value that nobody marks is found by its true age, which the simulation knows and the
    AMS does not. A stuck sensor is such a case in any design.

    Examples
    --------
    >>> from shipnet.engine.faults import CutCan, DeadBox
    >>> table = fault_table(System(), [CutCan("JB1-JB2", 10), DeadBox("JB2", 10)], trials=2)
    >>> table[["fault", "lost", "old", "noticed", "answer_ok", "age_ok"]].values.tolist()
    [['none', 0, 0, 'no', True, True], ['CAN cable cut JB1-JB2', 56, 56, 'mark', True, False], \
['box dead JB2', 18, 18, 'mark', True, False]]
    """
    import pandas as pd

    check_scalar("rule", rule, "s", 0.1, 100)
    check_whole("trials", trials, 1, 1000)
    if rng is not None and not isinstance(rng, np.random.Generator):
        raise ArgumentError(f"rng is {rng!r}; it must be a numpy.random.Generator")
    chance = np.random.default_rng(2024) if rng is None else rng
    chosen = check_faults(system, single_faults(system) if faults is None else faults)
    rows = []
    for fault in (None, *chosen):
        runs = [_run(system, fault, rule, chance) for _ in range(trials)]
        rows.append(_row(fault, runs, rule))
    return pd.DataFrame(rows)


def _run(system: System, fault: Fault | None, rule: float, rng: np.random.Generator) -> Run:
    # Long enough for the last mark, and for two more polls.
    settled = max(marking(system).after, rule) + 3 * system.poll_period
    start, stop = (10.0, inf) if fault is None else (fault.start, fault.stop)
    end = start + max(2 * settled, _LENGTH) if stop == inf else stop + settled
    # No phase between fault and clocks is special: the fault itself begins a little later.
    late = float(rng.uniform(0, system.poll_period))
    moved = [] if fault is None else [replace(fault, start=start + late, stop=stop + late)]
    return simulate(system, end, faults=moved, rng=rng)


def _row(fault: Fault | None, runs: Sequence[Run], rule: float) -> dict[str, object]:
    tables = [run.table for run in runs]
    begins = [run.faults[0].start if run.faults else inf for run in runs]
    ends = [min(run.faults[0].stop, run.end / 1e9) if run.faults else 0.0 for run in runs]
    worst = np.max([table["worst_s"] for table in tables], axis=0)
    lost, growing = (np.zeros(worst.size, dtype=bool) for _ in range(2))
    after = []
    for run, begin, end in zip(runs, begins, ends, strict=True):
        if run.faults:
            gone = _lost(run, begin, end)
            lost |= gone
            if run.faults[0].stop == inf:
                growing |= gone & (run.table["good_until_s"] == run.end / 1e9).to_numpy()
        alarms = run.alarms[run.alarms["time_s"] >= begin]
        first = alarms[alarms["kind"].isin(["0xFF", "too old"])].groupby("source")["time_s"].min()
        after.append(first.max() - begin if len(first) else np.nan)
    marked = np.max([table["marked_s"] for table in tables], axis=0) > 0
    kinds = {kind for run in runs for kind in run.alarms["kind"]}
    words = {"link": {"no answer"}, "path": {"path lost"}, "mark": {"0xFF", "too old"}}
    noticed = [word for word, raised in words.items() if kinds & raised]
    answer = max(run.answers["answer_s"].max() for run in runs)
    return {
        "fault": "none" if fault is None else str(fault),
        "lost": int(lost.sum()),
        "old": int((worst > rule).sum()),
        "oldest_s": inf if growing.any() else float(np.nanmax(worst)),
        "marked": int(marked.sum()),
        "marked_after_s": float(np.nanmax(after)) if not np.isnan(after).all() else np.nan,
        "noticed": ", ".join(noticed) or "no",
        "answer_s": float(answer),
        "answer_ok": bool(answer <= rule),
        "age_ok": bool((worst <= rule).all()),
    }


def _lost(run: Run, begin: float, end: float) -> npt.NDArray[np.bool_]:
    """Return of which points nothing newer than the fault is seen while it lasts."""
    shown = [run.shown(point.tag) for point in run.system.points]
    # A stuck sensor's values are of the very nanosecond at which it got stuck.
    first, last = nanoseconds(begin), nanoseconds(end)
    newer = [s.good & (s.sampled > first) & (s.seen <= last) for s in shown]
    return np.asarray(~np.any(newer, axis=1))
