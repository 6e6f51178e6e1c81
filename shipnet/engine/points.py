"""The measuring points of an engine: what is measured, in which box, over which range.

A list of points is a tuple of `Point`; all other modules of `shipnet.engine` take it in the order
of its file, which is the order of registers and of bytes.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Iterable
from dataclasses import dataclass
from math import isfinite
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from shipnet import datasets
from shipnet.errors import ArgumentError, InputError

if TYPE_CHECKING:
    import pandas as pd

__all__ = [
    "CONDITIONS",
    "Point",
    "by_box",
    "check_points",
    "load_points",
    "point_table",
    "read_points",
]

Condition = Literal["RTD", "4-20 mA", "switch"]

#: What a junction box can read: a resistance thermometer, a current loop, a contact.
CONDITIONS: tuple[Condition, ...] = ("RTD", "4-20 mA", "switch")

#: Columns of a file of points; any other column is for remarks.
_COLUMNS = ("tag", "box", "condition", "quantity", "low", "high", "unit", "signal", "alarm",
            "service")  # fmt: skip

#: Range of a platinum thermometer [degC]; IEC 60751.
_PT100 = (-200.0, 850.0)

#: The row of Table 3 that may be the row behind it printed twice.
_DOUBLE_ROW = "2"


@dataclass(frozen=True, slots=True)
class Point:
    """A measuring point.

    Parameters
    ----------
    tag : str
        What it is called; printable and not empty.
    box : str
        Junction box that it is wired to.
    condition : {"RTD", "4-20 mA", "switch"}
        Kind of its signal.
    quantity : str
        What is measured, such as ``"temperature"``.
    low, high : float, default 0 and 1
        Ends of the range [`unit`]; 0 and 1 for a switch, -200..850 for a thermometer.
    unit : str, default ""
        Unit of the range; none for a switch.
    signal : str, default ""
        Kind of sensor, such as ``"Pt100 3-wire"``.
    alarm : {"high", "low", ""}, default ""
        Which side is alarmed.
    service : str, default ""
        What it measures on the engine.

    Raises
    ------
    ArgumentError
        If a field is out of its range.

    Examples
    --------
    >>> Point("TE-1", "JB1", "RTD", "temperature", -50, 600, "degC").span
    650.0
    """

    tag: str
    box: str
    condition: Condition
    quantity: str
    low: float = 0.0
    high: float = 1.0
    unit: str = ""
    signal: str = ""
    alarm: Literal["high", "low", ""] = ""
    service: str = ""

    def __post_init__(self) -> None:
        """Check every field."""
        for field in ("tag", "box", "quantity", "unit", "signal", "service"):
            text = getattr(self, field)
            if not isinstance(text, str) or not text.isprintable() or text != text.strip():
                raise ArgumentError(f"{field} is {text!r}; it must be printable text")
            if not text and field in ("tag", "box"):
                raise ArgumentError(f"{field} is empty; a point needs one")
        if self.condition not in CONDITIONS:
            legal = ", ".join(CONDITIONS)
            raise ArgumentError(f"condition is {self.condition!r}; it must be one of {legal}")
        if self.alarm not in ("high", "low", ""):
            raise ArgumentError(f"alarm is {self.alarm!r}; it must be high, low or empty")
        for field in ("low", "high"):
            value = getattr(self, field)
            number = isinstance(value, int | float) and not isinstance(value, bool)
            if not (number and isfinite(value)):
                raise ArgumentError(f"{field} is {value!r}; it must be a finite number")
            object.__setattr__(self, field, float(value))
        if not self.low < self.high:
            raise ArgumentError(f"range is {self.low:g}..{self.high:g}; low must be below high")
        ends = (self.low, self.high)
        if self.condition == "switch" and ends != (0, 1):
            raise ArgumentError(f"range is {self.low:g}..{self.high:g}; that of a switch is 0..1")
        if self.condition == "RTD" and not _PT100[0] <= self.low < self.high <= _PT100[1]:
            raise ArgumentError(
                f"range is {self.low:g}..{self.high:g}; a Pt100 has -200..850 degC (IEC 60751)"
            )

    @property
    def span(self) -> float:
        """Length of the range [`unit`]."""
        return self.high - self.low

    @property
    def analogue(self) -> bool:
        """Whether it has a value, not only two states."""
        return self.condition != "switch"

    @property
    def cylinder(self) -> int | None:
        """Number of the cylinder that `service` names as ``cyl 3``; None if it names none."""
        found = re.search(r"\bcyl (\d+)\b", self.service)
        return int(found[1]) if found else None


def load_points(*, double_row: bool = True) -> tuple[Point, ...]:
    """Return the points of the engine of lee2012: 99, or 89 if a row was printed twice.

    Parameters
    ----------
    double_row : bool, default True
        Whether both rows of JB1 that read "temperature, 10, -50..600" count. If not, the current
        loops stay: section IV.1.b of [1]_ brings the exhaust gas in over the I/V converter.

    Returns
    -------
    tuple of Point
        The points in the order of Table 3.

    Raises
    ------
    ArgumentError
        If `double_row` is no bool.

    Notes
    -----
    Box, condition, alarm of the switches, number and range are those of Table 3 of [1]_. Tags and
    services are **assumed**, after the usual points of such an engine, and so are the alarms of
    the analogue points, contacts that open on alarm, and which of the seven pressures has which of
    the four ranges.

    References
    ----------
    .. [1] J. H. Lee, D. S. Kim, "Design and implementation of distributed control system based on
       dual field-bus for ship engine", J. IEEK 49-SC(2), 2012.

    Examples
    --------
    >>> points = load_points()
    >>> len(points), len(load_points(double_row=False)), points[10].service
    (99, 89, 'Exhaust gas outlet cyl 1 (RTD)')
    """
    if not isinstance(double_row, bool):
        raise ArgumentError(f"double_row is {double_row!r}; it must be True or False")
    file = datasets.path("synthetic_iolist_engine.csv")
    with file.open(newline="", encoding="utf-8") as stream:
        rows = [row["printed_row"] for row in csv.DictReader(stream)]
    points = zip(read_points(file), rows, strict=True)
    return tuple(point for point, row in points if double_row or row != _DOUBLE_ROW)


def read_points(path: str | PathLike[str]) -> tuple[Point, ...]:
    """Read points from a CSV file.

    Parameters
    ----------
    path : path
        File in UTF-8 with a row of column titles: the fields of `Point`, of which ``tag``,
        ``box``, ``condition`` and ``quantity`` must be there. Other columns are for remarks; an
        empty cell takes the default.

    Returns
    -------
    tuple of Point
        The points in the order of their rows.

    Raises
    ------
    InputError
        If the file cannot be read or a row is no point: every fault with its row.

    Examples
    --------
    >>> len(read_points(datasets.path("synthetic_iolist_engine.csv")))
    99
    """
    name = str(path)
    try:
        text = Path(path).read_text(encoding="utf-8-sig")
    except OSError as error:
        raise InputError(name, f"cannot be read: {error.strerror or error}") from None
    except UnicodeDecodeError:
        raise InputError(name, "is not UTF-8 text; expected a CSV file") from None
    lines = csv.DictReader(text.splitlines())
    missing = [column for column in _COLUMNS[:4] if column not in (lines.fieldnames or ())]
    if missing:
        raise InputError(name, f"column {', '.join(missing)} is missing; expected a row of titles")
    points: list[Point] = []
    faults = []
    tags: set[str] = set()
    try:
        for row in lines:
            where = f"row {lines.line_num}"
            try:
                points.append(_point(row))
            except ArgumentError as error:
                faults.append(f"{where}: {error}")
            tag = (row["tag"] or "").strip()
            if tag in tags:
                faults.append(f"{where}: tag {tag!r} is taken")
            tags.add(tag)
    except csv.Error as error:
        faults.append(f"is no CSV file: {error}")
    if faults or not points:
        raise InputError(name, *(faults or ["has no points; expected one a row"]))
    return tuple(points)


def _point(row: dict[str, str]) -> Point:
    given = {column: (row.get(column) or "").strip() for column in _COLUMNS}
    fields: dict[str, str | float] = {k: v for k, v in given.items() if v or k in _COLUMNS[:4]}
    for end in ("low", "high"):
        if end in fields:
            try:
                fields[end] = float(fields[end])
            except ValueError:
                raise ArgumentError(f"{end} is {fields[end]!r}; it must be a number") from None
    if fields["condition"] in CONDITIONS[:2] and len({"low", "high"} & fields.keys()) < 2:
        raise ArgumentError("low or high is empty; a point that is no switch needs both")
    return Point(**fields)  # type: ignore[arg-type] # what a cell may hold is checked by Point


def check_points(points: Iterable[Point]) -> tuple[Point, ...]:
    """Return points as a tuple, or raise unless there are some and their tags differ.

    Parameters
    ----------
    points : iterable of Point
        What was given.

    Returns
    -------
    tuple of Point
        The points.

    Raises
    ------
    ArgumentError
        If there is none, one is of another class, or a tag occurs twice.

    Examples
    --------
    >>> check_points([])
    Traceback (most recent call last):
        ...
    shipnet.errors.ArgumentError: points are empty; there must be one at least
    """
    try:
        found = tuple(points)
    except TypeError:
        raise ArgumentError(f"points are {points!r}; they must be a sequence of Point") from None
    for point in found:
        if not isinstance(point, Point):
            raise ArgumentError(f"points hold {point!r}; all must be of class Point")
    if not found:
        raise ArgumentError("points are empty; there must be one at least")
    if len({point.tag for point in found}) < len(found):
        raise ArgumentError("two points have the same tag; tags must differ")
    return found


def by_box(points: Iterable[Point]) -> dict[str, tuple[Point, ...]]:
    """Return the points of each junction box.

    Parameters
    ----------
    points : iterable of Point
        One or more.

    Returns
    -------
    dict of str to tuple of Point
        Points by box; boxes and points in their order.

    Raises
    ------
    ArgumentError
        As `check_points`.

    Examples
    --------
    >>> {box: len(points) for box, points in by_box(load_points()).items()}
    {'JB1': 43, 'JB2': 18, 'JB3': 38}
    """
    boxes: dict[str, tuple[Point, ...]] = {}
    for point in check_points(points):
        boxes[point.box] = (*boxes.get(point.box, ()), point)
    return boxes


def point_table(points: Iterable[Point]) -> pd.DataFrame:
    """Return how many points of each kind the boxes have.

    Parameters
    ----------
    points : iterable of Point
        One or more.

    Returns
    -------
    pandas.DataFrame
        One row a box and a last one ``"all"``: number of points by condition, of ``analogue``
        ones, and of all.

    Raises
    ------
    ArgumentError
        As `check_points`.

    Examples
    --------
    >>> print(point_table(load_points()))
         RTD  4-20 mA  switch  analogue  points
    JB1   20       17       6        37      43
    JB2   15        1       2        16      18
    JB3   27        0      11        27      38
    all   62       18      19        80      99
    """
    import pandas as pd

    boxes = by_box(points)
    boxes["all"] = tuple(point for box in boxes.values() for point in box)
    rows = []
    for own in boxes.values():
        kinds = [point.condition for point in own]
        count = [kinds.count(kind) for kind in CONDITIONS]
        rows.append([*count, count[0] + count[1], len(own)])
    columns = [*CONDITIONS, "analogue", "points"]
    return pd.DataFrame(rows, index=list(boxes), columns=columns)
