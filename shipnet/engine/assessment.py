"""What failures cost: of cables, boxes and transmissions by simulation, of parts by count."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import combinations
from math import inf
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from shipnet.clock import nanoseconds
from shipnet.engine.faults import EngineFault, check_faults, single_faults
from shipnet.engine.points import Point, PointList
from shipnet.engine.simulation import Run, simulate
from shipnet.engine.system import System
from shipnet.errors import ArgumentError
from shipnet.fields import check_scalar, check_whole, record, switch, whole

if TYPE_CHECKING:
    import pandas as pd

#: From a fault that lasts to the end of its run [s]: the same for all designs, unless marks take
#: longer in one.
_LENGTH = 20.0

#: Most supplies or processors of a box, and most parts that are taken to fail together.
_MOST = 4


# Faults of the system, by simulation -----------------------------------------------------------


def single_failures(
    system: System,
    faults: EngineFault | Iterable[EngineFault] | None,
    *,
    rule: float,
    trials: int,
    rng: Any,
) -> pd.DataFrame:
    """Return what each fault does; the columns are those of `System.single_failures`.

    An old value that nobody marks is found by its true age, which the simulation knows and the
    AMS does not. A stuck sensor is such a case in any design.
    """
    import pandas as pd

    check_scalar("rule", rule, "s", 0.1, 100)
    check_whole("trials", trials, 1, 1000)
    chance = np.random.default_rng(rng)
    chosen = single_faults(system) if faults is None else check_faults(system, faults)
    rows = []
    for fault in (None, *chosen):
        runs = [_run(system, fault, rule, chance) for _ in range(trials)]
        rows.append(_row(fault, runs, rule))
    return pd.DataFrame(rows).set_index("fault")


def _run(system: System, fault: EngineFault | None, rule: float, rng: np.random.Generator) -> Run:
    # Long enough for the last mark, and for two more polls.
    settled = max(system.staleness_flag().after, rule) + 3 * system.poll_period
    start, stop = (10.0, inf) if fault is None else (fault.start, fault.stop)
    end = start + max(2 * settled, _LENGTH) if stop == inf else stop + settled
    # No phase between fault and clocks is special: the fault itself begins a little later.
    late = float(rng.uniform(0, system.poll_period))
    moved = [] if fault is None else [replace(fault, start=start + late, stop=stop + late)]
    return simulate(system, faults=moved, until=end, rng=rng)


def _row(fault: EngineFault | None, runs: Sequence[Run], rule: float) -> dict[str, object]:
    tables = [run.table() for run in runs]
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
                growing |= gone & (run.table()["good_until_s"] == run.end / 1e9).to_numpy()
        alarms = run.alarms()
        alarms = alarms[alarms["time_s"] >= begin]
        first = alarms[alarms["kind"].isin(["0xFF", "too old"])].groupby("source")["time_s"].min()
        after.append(first.max() - begin if len(first) else np.nan)
    marked = np.max([table["marked_s"] for table in tables], axis=0) > 0
    kinds = {kind for run in runs for kind in run.alarms()["kind"]}
    words = {"link": {"no answer"}, "path": {"path lost"}, "mark": {"0xFF", "too old"}}
    noticed = [word for word, raised in words.items() if kinds & raised]
    answer = max(run.answers()["answer_s"].max() for run in runs)
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


# Parts of the boxes, by count -------------------------------------------------------------------


class Part(NamedTuple):
    """A ``supply`` or ``cpu`` of a box; the box is empty for a supply that all boxes share."""

    kind: str
    box: str
    number: int

    def __str__(self) -> str:
        """Return what a table calls it."""
        return f"{self.kind} {self.number} of {self.box or 'all boxes'}"


@record(slots=True)
class Redundancy:
    """How many supplies and processors the boxes have, and what dead ones cost.

    A box works as long as one supply and one processor of it do; the points of a box that does not
    work are lost, whatever the buses do.

    Parameters
    ----------
    points : PointList or iterable of Point
        One or more.
    supplies, cpus : int, default 1
        In each box, 1..4.
    shared_supply : bool, default False
        Whether the supplies serve all boxes together, not each box its own.

    Raises
    ------
    ArgumentError
        If a field is out of range.

    Notes
    -----
    The paper names one microcontroller and one power connector per box (section IV.1) and asks for
    two of each (section II); supplies and processors are taken to change over by themselves.

    Examples
    --------
    >>> from shipnet import engine
    >>> points = engine.read_points()
    >>> engine.Redundancy(points).worst(), engine.Redundancy(points, supplies=2, cpus=2).worst()
    (43, 0)
    >>> table = engine.Redundancy.compare(points)
    >>> table.groupby("design", sort=False).points_lost.max().to_dict()
    {'one of each': 43, 'two supplies': 43, 'two CPUs': 43, 'two of each': 0}
    """

    points: PointList
    supplies: int = whole(1, _MOST, "", "Supplies of each box", default=1)
    cpus: int = whole(1, _MOST, "", "Processors of each box", default=1)
    shared_supply: bool = switch("Whether all boxes share the supplies", default=False)

    def __post_init__(self) -> None:
        """Check the points."""
        object.__setattr__(self, "points", PointList(self.points))

    @property
    def parts(self) -> tuple[Part, ...]:
        """All supplies, then all processors."""
        boxes = self.points.boxes
        served = ("",) if self.shared_supply else boxes
        supplies = [Part("supply", box, n + 1) for box in served for n in range(self.supplies)]
        cpus = [Part("cpu", box, n + 1) for box in boxes for n in range(self.cpus)]
        return (*supplies, *cpus)

    def dead_boxes(self, dead: Iterable[Part]) -> tuple[str, ...]:
        """Return the boxes that do not work without some parts."""
        gone = set(dead)
        if not gone <= set(self.parts):
            raise ArgumentError(f"dead has {sorted(gone - set(self.parts))}, which are not parts")
        boxes = []
        for box in self.points.boxes:
            for kind in ("supply", "cpu"):
                own = {part for part in self.parts if part.kind == kind and part.box in ("", box)}
                if own <= gone:
                    boxes.append(box)
                    break
        return tuple(boxes)

    def lost(self, dead: Iterable[Part]) -> int:
        """Return how many points are lost without some parts."""
        boxes = self.dead_boxes(dead)
        return sum(point.box in boxes for point in self.points)

    def worst(self, failures: int = 1) -> int:
        """Return how many points the worst failure of some parts at once costs, 0..4 parts."""
        count = check_whole("failures", failures, 0, _MOST)
        return max((self.lost(dead) for dead in combinations(self.parts, count)), default=0)

    @classmethod
    def compare(
        cls,
        points: Iterable[Point],
        *,
        failures: int = 1,
        designs: Mapping[str, tuple[int, int]] | None = None,
    ) -> pd.DataFrame:
        """Return what dead parts cost in several designs: one row per design and combination.

        `failures` parts fail together, 1..4. `designs` are supplies and processors of each box by
        name; one or two of each if not given.
        """
        import pandas as pd

        known = PointList(points)
        count = check_whole("failures", failures, 1, _MOST)
        usual = {
            "one of each": (1, 1),
            "two supplies": (2, 1),
            "two CPUs": (1, 2),
            "two of each": (2, 2),
        }
        rows = []
        for design, (supplies, cpus) in (usual if designs is None else designs).items():
            system = cls(known, supplies, cpus)
            for dead in combinations(system.parts, count):
                boxes = ", ".join(system.dead_boxes(dead))
                rows.append((design, ", ".join(map(str, dead)), boxes, system.lost(dead)))
        return pd.DataFrame(rows, columns=["design", "dead", "boxes_lost", "points_lost"])
