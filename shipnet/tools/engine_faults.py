"""The engine explorer: the alarm screen of lee2012 after a fault."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from functools import cached_property, lru_cache
from typing import ClassVar

from shipnet.engine.faults import EngineFault
from shipnet.engine.run import Run, Screen
from shipnet.engine.simulation import simulate
from shipnet.engine.system import RULE, System
from shipnet.errors import ArgumentError
from shipnet.fields import check_fields, choice, number, record
from shipnet.tools._tool import Tool
from shipnet.tools._view import Measure, View, words

_WORDS = words("engine_faults")

#: Start of the fault, and the last time that the screen can show [s].
START, _END = 10.0, 25.0

#: Designs to choose from.
DESIGNS = {
    "as printed, CAN as a line": System(),
    "as printed, CAN as a ring": System(topology="ring"),
    "corrected, CAN as a line": System.corrected(),
}

#: Faults to choose from, by name: single faults of any design. A line lacks one cable of the ring.
FAULTS: dict[str, EngineFault | None] = {"none": None} | {
    str(fault): fault for design in DESIGNS.values() for fault in design.single_faults(START)
}

#: Seed of the random phases and losses.
_SEED = 2024


@record
class EngineFaults(Tool):
    """The alarm screen of lee2012 after a fault.

    `result` is the screen, an `engine.Screen`, and `raised` lists the alarms up to `time`.

    Raises
    ------
    ArgumentError
        If a value is out of its range, or the design lacks the cable of the fault.

    Examples
    --------
    >>> seen = EngineFaults(fault="box dead JB2", time=13)
    >>> seen.result.marked, seen.result.old
    (0, 18)
    """

    #: The designs to choose from, by name.
    DESIGNS: ClassVar[Mapping[str, System]] = DESIGNS

    fault: str = choice(list(FAULTS), _WORDS["fault"], default="box dead JB2")
    design: str = choice(list(DESIGNS), _WORDS["design"], default=next(iter(DESIGNS)))
    time: float = number(2, _END, "s", _WORDS["time"], default=13.0, step=0.25)

    def __post_init__(self) -> None:
        check_fields(self)
        chosen = FAULTS[self.fault]
        if chosen is not None and chosen.where not in DESIGNS[self.design].places[chosen.at]:
            raise ArgumentError(f"fault is {self.fault!r}; {self.design!r} has no such cable")

    @cached_property
    def result(self) -> Screen:
        """The alarm screen at the chosen time."""
        return _run(self.fault, self.design).screen(self.time)

    @cached_property
    def raised(self) -> list[str]:
        """Alarms up to `time`; equal alarms of a box's points at one time are counted together."""
        alarms = _run(self.fault, self.design).alarms()
        alarms = alarms[alarms["time_s"] <= self.time]
        box = alarms["source"].str.extract(r"^ME-(JB\d+)-", expand=False)
        source = (box + " points").fillna(alarms["source"])
        counted = Counter(zip(alarms["time_s"].round(2), source, alarms["kind"], strict=True))
        return [
            f"{time:.2f} s: {who}, {kind}" + (f" ({count})" if count > 1 else "")
            for (time, who, kind), count in counted.items()
        ]

    def _view(self) -> View:
        old, marked = self.result.old, self.result.marked
        healthy = not (old or marked or self.raised)
        return View(
            verdict="all values fresh" if healthy else f"{old} old values shown as good",
            ok=not old,
            numbers={
                "marked": f"{marked} points",
                f"shown as good, but older than {RULE:g} s": f"{old} points",
                "alarms": "; ".join(self.raised[-3:]) or "none",
            },
            plot=self.plot,
            narrow=lambda ax: self.result.plot(ax, columns=6),
            height=5.2,
            about="Screen of the alarm monitoring system, one tile per value",
            data=self.result.table,
            short="old values shown" if old else "no old values",
            measure=Measure("old_points", "old values shown as good", old, 0),
        )


@lru_cache(maxsize=64)
def _run(fault: str, design: str) -> Run:
    chosen = FAULTS[fault]
    faults = [] if chosen is None else [chosen]
    return simulate(DESIGNS[design], faults=faults, until=_END + 1, rng=_SEED)
