"""The measuring points of an engine, in the order of their registers."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable
from dataclasses import fields
from functools import cache
from os import PathLike
from typing import Any, Literal, SupportsIndex, overload

import numpy as np
import numpy.typing as npt

from shipnet import datasets
from shipnet.errors import ArgumentError, InputError
from shipnet.fields import check_fields, choice, number, record
from shipnet.lazy import pd
from shipnet.signals import Saving, hardwired_conductors
from shipnet.tables import read_sheet

Condition = Literal["RTD", "4-20 mA", "switch"]

#: Inputs of a junction box: a resistance thermometer, a current loop, a contact.
CONDITIONS: tuple[Condition, ...] = ("RTD", "4-20 mA", "switch")

#: The signal of each condition, which determines its conductors.
_SIGNAL = {"RTD": "rtd_3wire", "4-20 mA": "current_loop", "switch": "contact"}

#: Range of a platinum thermometer [degC]; IEC 60751.
PT100 = (-200.0, 850.0)


@record(slots=True)
class Point:
    """A measuring point.

    `box` is the junction box of the point, `quantity` the measured quantity, such as
    ``"temperature"``, `unit` the unit of the range, `signal` the kind of sensor, such as ``"Pt100
    3-wire"``, and `service` the place on the engine. `tag` and `box` must not be empty.

    Examples
    --------
    >>> Point("TE-1", "JB1", "RTD", "temperature", -50, 600, "degC").span
    650.0
    """

    tag: str
    box: str
    condition: Condition = choice(CONDITIONS, "Kind of signal")
    quantity: str
    low: float = number(
        -1e300,
        1e300,
        "",
        "Lower end of the range; 0 for a switch, -200 or more for a thermometer",
        default=0.0,
    )
    high: float = number(
        -1e300,
        1e300,
        "",
        "Upper end of the range; 1 for a switch, 850 or less for a thermometer",
        default=1.0,
    )
    unit: str = ""
    signal: str = ""
    alarm: Literal["high", "low", ""] = choice(("high", "low", ""), "Kind of alarm", default="")
    service: str = ""

    def __post_init__(self) -> None:
        check_fields(self)
        for field in ("tag", "box", "quantity", "unit", "signal", "service"):
            text = getattr(self, field)
            if not isinstance(text, str) or not text.isprintable() or text != text.strip():
                raise ArgumentError(f"{field} is {text!r}; it must be printable text")
            if not text and field in ("tag", "box"):
                raise ArgumentError(f"{field} is empty; every point must have one")
        rule = ""
        if not self.low < self.high:
            rule = "low must be below high"
        elif self.condition == "switch" and (self.low, self.high) != (0, 1):
            rule = "that of a switch is 0..1"
        elif self.condition == "RTD" and not PT100[0] <= self.low < self.high <= PT100[1]:
            rule = "a Pt100 covers -200..850 degC (IEC 60751)"
        if rule:
            raise ArgumentError(f"range is {self.low:g}..{self.high:g}; {rule}")

    @property
    def span(self) -> float:
        """Length of the range [`unit`]."""
        return self.high - self.low

    @property
    def analogue(self) -> bool:
        """True if the point has a continuous value, False if it has two states."""
        return self.condition != "switch"

    @property
    def cylinder(self) -> int | None:
        """Number of the cylinder in `service`, such as 3 in ``cyl 3``; None if there is none."""
        number = re.search(r"\bcyl (\d+)\b", self.service)
        return int(number[1]) if number else None


#: Columns of a point file; other columns are ignored.
_COLUMNS = tuple(field.name for field in fields(Point))


class PointList(tuple[Point, ...]):
    """The points of an engine, in the order of their registers; a tuple with methods.

    Parameters
    ----------
    points : iterable of Point
        One or more, with different tags.

    Raises
    ------
    ArgumentError
        If there is no point, an element is not a `Point`, or a tag occurs twice.

    Examples
    --------
    >>> points = read_points()
    >>> points, points[10].service
    (PointList(99 points, boxes JB1 JB2 JB3), 'Exhaust gas outlet cyl 1 (RTD)')
    >>> print(points.counts())
         RTD  4-20 mA  switch  analogue  points
    JB1   20       17       6        37      43
    JB2   15        1       2        16      18
    JB3   27        0      11        27      38
    all   62       18      19        80      99
    >>> points.saving
    Saving(hardwired=260, bus=10)
    """

    __slots__ = ()

    def __new__(cls, points: Iterable[Point]) -> PointList:
        """Check the points."""
        if isinstance(points, PointList):
            return points
        try:
            several = tuple(points)
        except TypeError:
            raise ArgumentError(
                f"points are {points!r}; they must be a sequence of Point"
            ) from None
        for point in several:
            if not isinstance(point, Point):
                raise ArgumentError(f"points contain {point!r}; all must be of class Point")
        if not several:
            raise ArgumentError("points are empty; there must be at least one")
        if len({point.tag for point in several}) < len(several):
            raise ArgumentError("two points have the same tag; tags must differ")
        return super().__new__(cls, several)

    @overload
    def __getitem__(self, index: SupportsIndex, /) -> Point: ...
    @overload
    def __getitem__(self, index: slice, /) -> PointList: ...
    def __getitem__(self, index: SupportsIndex | slice, /) -> Point | PointList:
        points = super().__getitem__(index)
        return points if isinstance(points, Point) else PointList(points)

    def __repr__(self) -> str:
        number = f"{len(self)} point{'s' if len(self) != 1 else ''}"
        return f"PointList({number}, boxes {' '.join(self.boxes)})"

    @property
    def boxes(self) -> tuple[str, ...]:
        """Names of the boxes in the order of their first points."""
        return tuple(dict.fromkeys(point.box for point in self))

    def by_box(self) -> dict[str, PointList]:
        """Return the points of each box."""
        return {box: PointList(p for p in self if p.box == box) for box in self.boxes}

    def table(self) -> pd.DataFrame:
        """Return all points: one row per tag, with the fields of `Point` as columns."""
        rows = [[getattr(point, name) for name in _COLUMNS] for point in self]
        return pd.DataFrame(rows, columns=list(_COLUMNS)).set_index("tag")

    def counts(self) -> pd.DataFrame:
        """Return the number of points by box and condition; the last row is the total, ``all``."""
        rows = []
        for points in (*self.by_box().values(), self):
            count = Counter(point.condition for point in points)
            analogue = len(points) - count["switch"]
            rows.append([*(count[kind] for kind in CONDITIONS), analogue, len(points)])
        columns = [*CONDITIONS, "analogue", "points"]
        return pd.DataFrame(rows, index=[*self.boxes, "all"], columns=columns)

    @property
    def saving(self) -> Saving:
        """Conductors of hardwired points, and of the two buses that replace them.

        CAN has three segments and Modbus two channels, of two conductors each. Shields, supplies
        and spare cores are not counted.
        """
        wired = hardwired_conductors(Counter(_SIGNAL[point.condition] for point in self))
        return Saving(wired, (3 + 2) * 2)

    def kinds(self) -> list[tuple[int, int]]:
        """Return the index of the first point and the number of points for each kind of input."""
        first: dict[tuple[object, ...], list[int]] = {}
        for k, point in enumerate(self):
            key = (point.condition, point.low, point.high, point.unit, point.signal)
            first.setdefault(key, []).append(k)
        return [(places[0], len(places)) for places in first.values()]


def by_point(
    points: PointList, name: str, values: npt.ArrayLike, kinds: str = "iufb"
) -> npt.NDArray[Any]:
    """Return values as an array of shape (..., n_points); `kinds` are the accepted dtype kinds."""
    array = np.asarray(values)
    if array.dtype.kind not in kinds or not array.ndim or array.shape[-1] != len(points):
        what = "numbers" if "f" in kinds else "whole numbers"
        raise ArgumentError(
            f"{name} has shape {array.shape}; it must be (..., {len(points)}) of {what}"
        )
    return array


def read_points(path: str | PathLike[str] | None = None) -> PointList:
    """Read the points of an engine: the 99 of lee2012, or those of a CSV or Excel file.

    Parameters
    ----------
    path : path, optional
        CSV file or Excel workbook with a row of column titles: the fields of `Point`, of which
        ``tag``, ``box``, ``condition`` and ``quantity`` are required. Other columns are ignored; an
        empty cell means the default.

    Returns
    -------
    PointList
        The points in the order of their rows.

    Raises
    ------
    InputError
        If the file cannot be read, lacks points or a required column, or has invalid rows (listed).

    Notes
    -----
    Box, condition, range and number of the 99 points, and the alarms of the switches, are those of
    Table 3 of lee2012. Tags, services, the alarms of the analogue points, contacts that open on
    alarm, and the range of each of the seven pressures are **assumed**.

    Examples
    --------
    >>> read_points()
    PointList(99 points, boxes JB1 JB2 JB3)
    """
    return _read(path) if path is not None else _shipped()


@cache
def _shipped() -> PointList:
    return _read(datasets.path("synthetic_iolist_engine.csv"))


def _read(path: str | PathLike[str]) -> PointList:
    sheet = read_sheet(path)
    missing = [column for column in _COLUMNS[:4] if column not in sheet.titles]
    if missing:
        raise InputError(
            sheet.source, f"column {', '.join(missing)} is missing; expected a row of titles"
        )
    points: list[Point] = []
    faults = []
    tags: set[str] = set()
    for line, cells in sheet.rows:
        row = dict(zip(sheet.titles, cells, strict=False))
        try:
            points.append(_point(row))
        except ArgumentError as error:
            faults.append(f"row {line}: {error}")
        tag = row.get("tag", "")
        if tag in tags:
            faults.append(f"row {line}: tag {tag!r} occurs twice")
        tags.add(tag)
    if faults or not points:
        raise InputError(sheet.source, *(faults or ["has no points; expected one per row"]))
    return PointList(points)


def _point(row: dict[str, str]) -> Point:
    cells = {column: row.get(column, "") for column in _COLUMNS}
    values: dict[str, Any] = {k: cell for k, cell in cells.items() if cell or k in _COLUMNS[:4]}
    for end in {"low", "high"} & values.keys():
        try:
            values[end] = float(values[end])
        except ValueError:
            raise ArgumentError(f"{end} is {values[end]!r}; it must be a number") from None
    if values["condition"] in CONDITIONS[:2] and len({"low", "high"} & values.keys()) < 2:
        raise ArgumentError("low or high is empty; a point that is not a switch needs both")
    return Point(**values)
