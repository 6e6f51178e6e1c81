"""Power supplies and processors of the junction boxes: what one dead part takes along.

Every box has one or two supplies and one or two processors. It works as long as one of each does;
the points of a box that does not work are lost, whatever the buses do.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING, NamedTuple

from shipnet.engine.points import Point, by_box, check_points
from shipnet.errors import ArgumentError
from shipnet.fields import check_whole

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["Part", "Redundancy", "part_fault_table"]

#: Most supplies or processors of a box, and most parts that are taken to fail together.
_MOST = 4


class Part(NamedTuple):
    """A supply or a processor.

    Attributes
    ----------
    kind : {"supply", "cpu"}
        What it is.
    box : str
        Box that it serves; empty for a supply that all boxes share.
    number : int
        1 or more.
    """

    kind: str
    box: str
    number: int

    def __str__(self) -> str:
        """Return what a table calls it."""
        return f"{self.kind} {self.number} of {self.box or 'all boxes'}"


@dataclass(frozen=True, slots=True)
class Redundancy:
    """How many supplies and processors the boxes have.

    Parameters
    ----------
    points : iterable of Point
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
    The paper names one microcontroller and one power connector a box (section IV.1) and asks for
    two of each (section II); supplies and processors are taken to change over by themselves.

    Examples
    --------
    >>> from shipnet.engine.points import load_points
    >>> system = Redundancy(load_points())
    >>> len(system.parts), system.lost([Part("cpu", "JB1", 1)])
    (6, 43)
    >>> Redundancy(load_points(), supplies=2, cpus=2).lost([Part("cpu", "JB1", 1)])
    0
    """

    points: tuple[Point, ...]
    supplies: int = 1
    cpus: int = 1
    shared_supply: bool = False

    def __post_init__(self) -> None:
        """Check every field."""
        object.__setattr__(self, "points", check_points(self.points))
        for name in ("supplies", "cpus"):
            object.__setattr__(self, name, check_whole(name, getattr(self, name), 1, _MOST))
        if not isinstance(self.shared_supply, bool):
            raise ArgumentError(f"shared_supply is {self.shared_supply!r}; it must be a bool")

    @property
    def parts(self) -> tuple[Part, ...]:
        """All supplies, then all processors."""
        boxes = tuple(by_box(self.points))
        served = ("",) if self.shared_supply else boxes
        supplies = [Part("supply", box, n + 1) for box in served for n in range(self.supplies)]
        cpus = [Part("cpu", box, n + 1) for box in boxes for n in range(self.cpus)]
        return (*supplies, *cpus)

    def dead_boxes(self, dead: Iterable[Part]) -> tuple[str, ...]:
        """Return the boxes that do not work without some parts.

        Parameters
        ----------
        dead : iterable of Part
            Parts that have failed.
        """
        gone = set(dead)
        if not gone <= set(self.parts):
            raise ArgumentError(f"dead has {sorted(gone - set(self.parts))}, which are no parts")
        boxes = []
        for box in by_box(self.points):
            for kind in ("supply", "cpu"):
                own = {part for part in self.parts if part.kind == kind and part.box in ("", box)}
                if own <= gone:
                    boxes.append(box)
                    break
        return tuple(boxes)

    def lost(self, dead: Iterable[Part]) -> int:
        """Return how many points are lost without some parts.

        Parameters
        ----------
        dead : iterable of Part
            Parts that have failed.
        """
        boxes = self.dead_boxes(dead)
        return sum(point.box in boxes for point in self.points)

    def worst(self, failures: int = 1) -> int:
        """Return how many points the worst failure of some parts at once costs.

        Parameters
        ----------
        failures : int, default 1
            Parts that fail together, 0..4.
        """
        count = check_whole("failures", failures, 0, _MOST)
        return max((self.lost(dead) for dead in combinations(self.parts, count)), default=0)


def part_fault_table(
    points: Iterable[Point],
    *,
    failures: int = 1,
    designs: Mapping[str, tuple[int, int]] | None = None,
) -> pd.DataFrame:
    """Return what dead supplies and processors cost in several designs.

    Parameters
    ----------
    points : iterable of Point
        One or more.
    failures : int, default 1
        Parts that fail together, 1..4.
    designs : mapping of str to (int, int), optional
        Supplies and processors of each box, by the name of the design; one or two of each if not
        given.

    Returns
    -------
    pandas.DataFrame
        One row a design and combination of parts: ``design``, ``dead``, ``boxes_lost``,
        ``points_lost``.

    Raises
    ------
    ArgumentError
        If an argument is out of range.

    Examples
    --------
    >>> from shipnet.engine.points import load_points
    >>> table = part_fault_table(load_points())
    >>> table.groupby("design", sort=False).points_lost.max().to_dict()
    {'one of each': 43, 'two supplies': 43, 'two CPUs': 43, 'two of each': 0}
    """
    import pandas as pd

    known = check_points(points)
    count = check_whole("failures", failures, 1, _MOST)
    usual = {
        "one of each": (1, 1),
        "two supplies": (2, 1),
        "two CPUs": (1, 2),
        "two of each": (2, 2),
    }
    rows = []
    for design, (supplies, cpus) in (usual if designs is None else designs).items():
        system = Redundancy(known, supplies, cpus)
        for dead in combinations(system.parts, count):
            boxes = ", ".join(system.dead_boxes(dead))
            rows.append((design, ", ".join(map(str, dead)), boxes, system.lost(dead)))
    return pd.DataFrame(rows, columns=["design", "dead", "boxes_lost", "points_lost"])
