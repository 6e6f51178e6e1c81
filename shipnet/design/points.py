"""The rows of an I/O list as points, or all that is wrong with them, each with its place."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import zip_longest
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from shipnet.errors import ArgumentError, InputError
from shipnet.signals import KINDS, SIGNALS, find_signal, meanings, plain
from shipnet.tables import NUMBER, frame_sheet, parse_sheet, read_sheet

if TYPE_CHECKING:
    from typing import Self

    from shipnet.tables import Sheet


# What the columns of an I/O list are called, on paper and here ----------------------------------

#: Columns of a list of points, in their order: what they hold ("text", or a quantity whose unit
#: the name ends with), and what lists call them. Case, blanks and punctuation do not matter.
COLUMNS: Mapping[str, tuple[str, tuple[str, ...]]] = {
    "tag": ("text", ("tag no", "tag nr", "tag number", "tag name", "tag id", "io tag", "point",
                     "point id", "point name", "instrument", "instrument tag", "instrument no",
                     "id")),
    "system": ("text", ("sys", "system name", "ship system", "subsystem", "plant")),
    "type": ("text", ("io", "io type", "io kind", "point type", "channel type", "kind")),
    "signal": ("text", ("signal type", "signal kind", "sensor", "sensor type", "connection")),
    "conductors": ("whole", ("cores", "wires", "strands", "no of cores", "no of wires",
                             "number of cores", "number of wires", "number of conductors",
                             "no of conductors", "core count")),
    "x_m": ("length", ("pos x", "position x", "deck x", "x pos", "x position", "x coord",
                       "x coordinate", "coordinate x")),
    "y_m": ("length", ("pos y", "position y", "deck y", "y pos", "y position", "y coord",
                       "y coordinate", "coordinate y")),
    "z_m": ("length", ("pos z", "position z", "deck z", "z pos", "z position", "z coord",
                       "z coordinate", "coordinate z", "height", "elevation")),
    "box": ("text", ("jb", "junction box", "jb no", "box no", "jb tag", "terminal box",
                     "junction box no")),
    "box_x_m": ("length", ("jb x", "junction box x", "x box", "x jb", "x of box")),
    "box_y_m": ("length", ("jb y", "junction box y", "y box", "y jb", "y of box")),
    "box_z_m": ("length", ("jb z", "junction box z", "z box", "z jb", "z of box")),
    "to_box_m": ("length", ("len to jb", "len to box", "length to jb", "length to box",
                            "length to junction box", "cable to box", "cable to jb",
                            "distance to box", "distance to jb", "to jb", "drop", "drop length")),
    "home_run_m": ("length", ("len home run", "length home run", "home run length", "length",
                              "cable length", "cable length to cabinet", "length to cabinet",
                              "distance to cabinet")),
    "update_ms": ("time", ("update time", "update period", "update interval", "update need",
                           "scan", "scan time", "cycle", "cycle time", "sampling time",
                           "refresh time")),
    "category": ("text", ("cat", "e22 category", "system category", "category e22")),
    "note": ("text", ("notes", "remark", "remarks", "comment", "comments", "description",
                      "service")),
    "device": ("text", ("actuator",)),
}  # fmt: skip

#: Units that a title may name, each as a multiple of that of the column.
UNITS: Mapping[str, Mapping[str, float]] = {
    "length": {"m": 1.0, "mm": 1e-3, "cm": 1e-2},
    "time": {"ms": 1.0, "s": 1e3},
}


class Column(NamedTuple):
    """What a title means: the name of the column, and the multiple of its unit."""

    name: str
    scale: float = 1.0


def _titles() -> dict[str, str]:
    titles: dict[str, str] = {}
    for name, (holds, others) in COLUMNS.items():
        base = name.rpartition("_")[0] if holds in UNITS else name
        titles |= {plain(title): name for title in (base, *others)}
    return titles


_TITLES = _titles()


def column_of(title: str) -> Column | None:
    """Return the column that a title means."""
    name = _TITLES.get(plain(title))
    if name is not None:
        return Column(name)
    words = re.findall(r"[^\W_]+", title.casefold())
    name = _TITLES.get("".join(words[:-1])) if words else None
    units = UNITS.get(COLUMNS[name][0], {}) if name is not None else {}
    return Column(name, units[words[-1]]) if name is not None and words[-1] in units else None


def is_titles(cells: Sequence[str]) -> bool:
    """Say whether cells are the titles of an I/O list."""
    known = {column.name for column in map(column_of, cells) if column is not None}
    return len(known) > 1 and not known.isdisjoint({"tag", "type", "signal"})


# The cells of an I/O list by column, and the faults that are found in them ----------------------

_POSITION, _BOX = ("x_m", "y_m", "z_m"), ("box_x_m", "box_y_m", "box_z_m")

#: What a spreadsheet may take for a formula begins so; an apostrophe before it makes it text.
_FORMULA = re.compile(r"'+[=+\-@]")


class Cells:
    """The cells of a sheet under the columns of an I/O list."""

    def __init__(self, sheet: Sheet) -> None:
        self.sheet = sheet
        self.rows = [number for number, _ in sheet.rows]
        self.remarks = list(sheet.remarks)
        self.places: dict[str, list[int]] = {}
        self.scales: dict[str, float] = {}
        self._faults: list[tuple[int, int, str]] = []
        self._read_titles()
        width = len(sheet.titles)
        beside = [
            row for row, (_, cells) in enumerate(sheet.rows)
            if len(cells) > width and any(cells[width:])
        ]  # fmt: skip
        if sheet.separator:
            # The row is shifted, or a number has a comma in it.
            for row in beside:
                self.fault(row, "", f" has {len(sheet.rows[row][1])} cells; expected {width}")
        elif beside:
            self.remarks.append(f"not used: what stands beside the table in {len(beside)} rows")

    def __getitem__(self, name: str) -> list[str]:
        """Return the cells of a column, empty ones if the list has no such column."""
        places = self.places.get(name)
        return self.column(places[0]) if places else [""] * len(self.rows)

    def column(self, place: int) -> list[str]:
        """Return the cells of a column by its place."""
        return self._columns[place] if place < len(self._columns) else [""] * len(self.rows)

    @cached_property
    def _columns(self) -> list[list[str]]:
        return [list(c) for c in zip_longest(*(row for _, row in self.sheet.rows), fillvalue="")]

    def given(self, name: str) -> NDArray[np.bool_]:
        """Return whether each cell of a column holds something."""
        return np.array([cell != "" for cell in self[name]], dtype=bool)

    def title(self, name: str) -> str:
        """Return what the list itself calls a column."""
        places = self.places.get(name)
        return self.sheet.titles[places[0]] if places else name

    def fault(self, row: int, name: str, text: str) -> None:
        """Keep a fault of a row."""
        place = self.places[name][0] if name in self.places else -1
        self._faults.append((row, place, f"row {self.rows[row]}{text}"))

    def wrong(self, rows: Iterable[int], name: str, expected: str) -> None:
        """Keep the same fault of some cells of a column."""
        cells = self[name]
        for row in rows:
            what = self.odd(row, name)
            cell = f"{cells[row]!r}{what and f', {what}'}" if cells[row] else "is empty"
            self.fault(row, name, f", column {self.title(name)}: {cell}; expected {expected}")

    def odd(self, row: int, name: str) -> str:
        """Return what a cell is that is neither text nor number, else ``""``."""
        places = self.places.get(name, [-1])
        return self.sheet.odd.get((self.rows[row], places[0]), "")

    def check(self) -> None:
        """Raise all faults that were found, in the order of rows and columns."""
        if self._faults:
            raise InputError(self.sheet.source, *(text for _, _, text in sorted(self._faults)))

    def _read_titles(self) -> None:
        unused = []
        for place, title in enumerate(self.sheet.titles):
            column = column_of(title)
            if column is not None:
                self.places.setdefault(column.name, []).append(place)
                self.scales.setdefault(column.name, column.scale)
            elif title:
                unused.append(title)
            elif any(self.column(place)):
                unused.append(f"column {place + 1}, which has no title")
        faults = [
            f"{' and '.join(repr(self.sheet.titles[place]) for place in places)} both mean {name}"
            for name, places in self.places.items()
            if len(places) > 1 and name != "note"
        ]
        for group in (_POSITION, _BOX):
            missing = [name for name in group if name not in self.places]
            if 0 < len(missing) < 3:
                wanted = ", ".join(group)
                faults.append(f"no column {' and no '.join(missing)}; expected {wanted} or none")
        if "tag" not in self.places:
            faults.append("no column tag")
        if "signal" not in self.places and "type" not in self.places:
            faults.append("no column signal and no column type; expected one at least")
        used = "; ".join(unused)
        if faults:
            faults = [f"row {self.sheet.top}: {fault}" for fault in faults]
            raise InputError(self.sheet.source, *faults, *([f"not known: {used}"] * bool(used)))
        if not self.rows:
            raise InputError(self.sheet.source, "has no points; expected one a row")
        if unused:
            self.remarks.append(f"not used: {used}")


def clean(cell: str) -> str:
    """Return text on one line, without the apostrophe that kept it from being a formula."""
    # Of all blanks, only the common one can be printed.
    text = cell if cell.isprintable() and "  " not in cell else " ".join(cell.split())
    return text[1:] if text[:1] == "'" and _FORMULA.match(text) else text


# The numbers of an I/O list: where points and boxes are, lengths of cables, update times

#: Legal values in the unit of the column, both ends included, but for an update time of 0. No ship
#: is a kilometre long, no cable of one ten.
RANGES: Mapping[str, tuple[float, float]] = {
    **dict.fromkeys((*_POSITION, *_BOX), (-1e3, 1e3)),
    **dict.fromkeys(("to_box_m", "home_run_m"), (0.0, 1e4)),
    "update_ms": (0.0, 3.6e6),
}

#: How far a cable may fall short of the straight way, as both are rounded [m].
_ROUNDED = 0.2

_Floats = NDArray[np.float64]


def read_numbers(cells: Cells, boxes: Sequence[str]) -> dict[str, _Floats]:
    """Return the numbers of an I/O list, and keep the faults that are found."""
    comma = cells.sheet.separator in (";", "\t") and any(
        "," in cell for name in RANGES if name in cells.places for cell in cells[name]
    )
    numbers = {name: _numbers(cells, name, comma) for name in RANGES}
    _check_positions(cells)
    _check_boxes(cells, boxes, numbers)
    return numbers


def _numbers(cells: Cells, name: str, comma: bool) -> _Floats:
    low, high = RANGES[name]
    if name not in cells.places:
        return np.full(len(cells.rows), np.nan)
    # A list holds few different numbers; each is read once.
    known = {cell: _number(cell, comma) for cell in set(cells[name])}
    wrong = {cell for cell, value in known.items() if cell and value is None}
    bad = [row for row, cell in enumerate(cells[name]) if cell in wrong] if wrong else []
    values = np.array([known[cell] for cell in cells[name]], dtype=np.float64)
    scale = cells.scales[name]
    values = values if scale == 1 else values * scale
    outside = (values < low) | (values > high) | ((values == 0) & (name == "update_ms"))
    unit = next(u for u, s in UNITS[COLUMNS[name][0]].items() if s == scale)
    above = "above 0, up to " if name == "update_ms" else f"{low / scale:.7g}.."
    point = " with a decimal comma" if comma else ""
    expected = f"a number {above}{high / scale:.7g} {unit}{point}"
    cells.wrong([*bad, *np.flatnonzero(outside).tolist()], name, expected)
    return values


def _number(cell: str, comma: bool) -> float | None:
    """Return the number that a cell holds; None, which numpy takes for NaN, if it holds none."""
    if comma:
        # A point beside a decimal comma may part thousands: then the number is not certain.
        cell = cell.replace(",", ".") if "." not in cell else ""
    return float(cell) if NUMBER.fullmatch(cell) else None


def _check_positions(cells: Cells) -> None:
    have = np.column_stack([cells.given(name) for name in _POSITION])
    _check_partly(cells, _POSITION, have)


def _check_partly(cells: Cells, names: Sequence[str], have: NDArray[np.bool_]) -> None:
    for row in np.flatnonzero(have.any(axis=1) & ~have.all(axis=1)).tolist():
        missing = [name for name, one in zip(names, have[row], strict=True) if not one]
        titles = " and ".join(map(cells.title, missing))
        wanted = ", ".join(map(cells.title, names))
        cells.fault(row, missing[0], f", column {titles}: is empty; expected {wanted}, or none")


def _check_boxes(cells: Cells, boxes: Sequence[str], numbers: dict[str, _Floats]) -> None:
    """Check the boxes; all points of a box get the position that one of them names."""
    have = np.column_stack([cells.given(name) for name in _BOX])
    named = np.array([box != "" for box in boxes], dtype=bool)
    _check_partly(cells, _BOX, have)
    alone = (have.any(axis=1) | cells.given("to_box_m")) & ~named
    cells.wrong(np.flatnonzero(alone).tolist(), "box", "a name, as the list says where it is")
    places = np.column_stack([numbers[name] for name in _BOX])
    whole = np.isfinite(places).all(axis=1)
    first: dict[str, int] = {}
    for row in np.flatnonzero(named & whole).tolist():
        first.setdefault(boxes[row], row)
    same = np.array([first.get(box, -1) for box in boxes])
    stray = whole & (same >= 0) & (places != places[same]).any(axis=1)
    for row in np.flatnonzero(stray).tolist():
        where = ", ".join(f"{value:g}" for value in places[same[row]])
        cells.fault(
            row, _BOX[0],
            f", column {cells.title(_BOX[0])}: box {boxes[row]!r} stands elsewhere in row "
            f"{cells.rows[same[row]]}; expected it at {where} m",
        )  # fmt: skip
    fill = (same >= 0) & ~have.any(axis=1)
    for axis, name in enumerate(_BOX):
        numbers[name] = np.where(fill, places[same, axis], numbers[name])
    away = [numbers[own] - numbers[box] for own, box in zip(_POSITION, _BOX, strict=True)]
    straight = np.sqrt(np.square(away).sum(axis=0))
    for row in np.flatnonzero(numbers["to_box_m"] < straight - _ROUNDED).tolist():
        expected = f"the straight way of {straight[row]:.1f} m at least"
        cells.wrong([row], "to_box_m", expected)


# Rows of an I/O list made into points, or all that is wrong with them ---------------------------

_KIND_WORDS = {
    "DI": ("digital input", "discrete input", "binary input"),
    "DO": ("digital output", "discrete output", "binary output"),
    "AI": ("analogue input", "analog input"),
    "AO": ("analogue output", "analog output"),
}
_KINDS = {plain(word): str(kind) for kind in KINDS for word in (kind, *_KIND_WORDS[kind])}
_CATEGORIES = {
    plain(word): name
    for number, name in enumerate(("I", "II", "III"), start=1)
    for word in (name, str(number), f"cat {name}", f"cat {number}", f"category {name}")
}

#: A signal, and what is wrong with the point by column.
_Found = tuple[str, list[tuple[str, str]]]


def points_of(sheet: Sheet) -> tuple[pd.DataFrame, tuple[str, ...]]:
    """Make points of the rows of a sheet."""
    cells = Cells(sheet)
    texts = {name: _text(cells, name) for name in ("tag", "system", "box", "device")}
    _check_tags(cells, texts["tag"])
    signals = _signals(cells, _look_up(cells, "type", _KINDS, "DI, DO, AI or AO"))
    categories = _look_up(cells, "category", _CATEGORIES, "I, II, III or nothing")
    numbers = read_numbers(cells, texts["box"])
    cells.check()
    missing = np.isnan(numbers["update_ms"])
    if missing.any():
        count = int(missing.sum())
        which = f"{count} points have" if count > 1 else "1 point has"
        cells.remarks.append(
            f"{which} no update time: that of the settings holds, 1000 ms unless they say other"
        )
    columns: dict[str, object] = {
        **texts,
        "type": [SIGNALS[name].kind for name in signals],
        "signal": signals,
        "conductors": np.array([SIGNALS[name].conductors for name in signals], dtype=np.int64),
        **numbers,
        "category": categories,
        "note": _notes(cells),
    }
    return pd.DataFrame({name: columns[name] for name in COLUMNS}), tuple(cells.remarks)


def _text(cells: Cells, name: str) -> list[str]:
    texts = [clean(cell) for cell in cells[name]]
    # One look at all of them suffices where nothing is wrong.
    suspect = cells.sheet.odd or not "".join(texts).isprintable()
    bad = [
        row for row, text in enumerate(texts if suspect else ())
        if not text.isprintable() or cells.odd(row, name)
    ]  # fmt: skip
    cells.wrong(bad, name, "printable text")
    return texts


def _notes(cells: Cells) -> list[str]:
    """Return the remarks of each point, of all columns for them; what cannot be shown is left."""
    columns = [map(clean, cells.column(place)) for place in cells.places.get("note", [])]
    if not columns:
        return [""] * len(cells.rows)
    notes = ["; ".join(filter(None, own)) for own in zip(*columns, strict=True)]
    return [
        note if note.isprintable() else "".join(filter(str.isprintable, note)) for note in notes
    ]


def _check_tags(cells: Cells, tags: list[str]) -> None:
    first: dict[str, int] = {}
    cells.wrong([row for row, tag in enumerate(tags) if not tag], "tag", "a tag")
    for row, tag in enumerate(tags):
        before = first.setdefault(tag.casefold(), row)
        if before != row and tag:
            cells.fault(
                row, "tag",
                f", column {cells.title('tag')}: {tag!r} stands in row {cells.rows[before]} "
                "already; expected a tag of its own",
            )  # fmt: skip


def _look_up(cells: Cells, name: str, known: Mapping[str, str], expected: str) -> list[str]:
    """Return the meanings of the words of a column; that of an empty cell is ""."""
    found = {cell: known.get(plain(cell), "") for cell in set(cells[name])}
    rows = [row for row, cell in enumerate(cells[name]) if cell and not found[cell]]
    cells.wrong(rows, name, expected)
    return [found[cell] for cell in cells[name]]


def _signals(cells: Cells, kinds: list[str]) -> list[str]:
    """Return the signal of each point; a list has few different ones, each is looked up once."""
    known: dict[tuple[str, str, str, str], _Found] = {}
    signals = []
    points = zip(
        map(clean, cells["signal"]), cells["type"], kinds, cells["conductors"], strict=True
    )
    for row, point in enumerate(points):
        if point not in known:
            known[point] = _signal(*point)
        signal, faults = known[point]
        for column, text in faults:
            cells.fault(row, column, f", column {cells.title(column)}: {text}")
        signals.append(signal)
    either = Counter(
        word for word, kind in zip(map(clean, cells["signal"]), kinds, strict=True)
        if not kind and _input_of(word)
    )  # fmt: skip
    cells.remarks += [
        f"signal {word!r} without a type is taken for an input, not an output: {count} times"
        for word, count in either.items()
    ]
    return signals


def _input_of(word: str) -> str:
    """Return the type of the input that a word means, if it may mean an output too, else ""."""
    kinds = {SIGNALS[name].kind for name in meanings(word)}
    return next((k for k in kinds if k[1] == "I"), "") if {k[1] for k in kinds} == {*"IO"} else ""


def _signal(word: str, given: str, kind: str, count: str) -> _Found:
    """Return the signal that a point names, or that of its type if it names none."""
    whole = re.fullmatch(r"([0-9]{1,4})([.,]0+)?", count)
    conductors = int(whole[1]) if whole else None
    faults = []
    if count and not conductors:
        faults.append(("conductors", f"{count!r}; expected a whole number 1..9999"))
    if not word and not kind:
        # That a type is unknown has been said.
        none = [("signal", f"is empty; expected one of {', '.join(SIGNALS)}, or a type")]
        return "contact", faults + none * (not given)
    try:
        signal = find_signal(word or kind, kind or _input_of(word), conductors)
    except ArgumentError as error:
        if word:
            return "contact", [*faults, ("signal", str(error))]
        alike = ", ".join(name for name, signal in SIGNALS.items() if signal.kind == kind)
        return "contact", [*faults, ("signal", f"is empty; expected one of {alike}")]
    own = SIGNALS[signal]
    if kind and own.kind != kind:
        faults.append(("type", f"{given!r}; expected {own.kind}, as the signal is {signal}"))
    if conductors and own.conductors != conductors:
        expected = f"expected {own.conductors}, as the signal is {signal}"
        faults.append(("conductors", f"{count!r}; {expected}"))
    return signal, faults


# I/O lists: the points of a ship, from a CSV file or an Excel workbook --------------------------

_WHAT = "titles of an I/O list, which are at least tag, and signal or type"


@dataclass(frozen=True, eq=False)
class PointTable:
    """The points of a list, one per row; `IoList` adds what is done with them."""

    points: pd.DataFrame
    source: str
    remarks: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Check the form of the table."""
        missing = [name for name in COLUMNS if name not in self.points.columns]
        if missing:
            raise ArgumentError(
                f"points have no column {', '.join(missing)}; use IoList.from_table"
            )
        if not self.points.index.equals(pd.RangeIndex(len(self.points))):
            raise ArgumentError("the rows of points must be numbered from 0; use IoList.from_table")

    @classmethod
    def parse(cls, text: str, source: str = "text") -> Self:
        """Read an I/O list from text, as an editor holds it."""
        return cls._of(parse_sheet(text, source, is_titles=is_titles, what=_WHAT))

    @classmethod
    def from_table(cls, table: pd.DataFrame, source: str = "table") -> Self:
        """Make an I/O list of a table, checked as a file would be."""
        return cls._of(frame_sheet(table, source))

    @classmethod
    def read(cls, path: str | PathLike[str], sheet: str | None = None) -> Self:
        """Read an I/O list from a CSV file or an Excel workbook."""
        return cls._of(read_sheet(path, sheet, is_titles=is_titles, what=_WHAT))

    @classmethod
    def _of(cls, sheet: Sheet) -> Self:
        points, remarks = points_of(sheet)
        return cls(points, sheet.source, remarks)

    def __len__(self) -> int:
        """Return the number of points."""
        return len(self.points)

    def __str__(self) -> str:
        """Say how many points there are, of what kind, and where they come from."""
        return f"{self._said} of {Path(self.source).name}"

    def __repr__(self) -> str:
        """Say how many points there are, and of what kind."""
        return f"<{type(self).__name__}: {self._said}>"

    @property
    def _said(self) -> str:
        counts = self.points["type"].value_counts(sort=False)
        kinds = ", ".join(f"{number} {kind}" for kind, number in counts.items())
        return f"{len(self)} point{'' if len(self) == 1 else 's'} ({kinds})"

    def table(self) -> pd.DataFrame:
        """Return one row per point, without the columns in which the list says nothing."""
        said = (self.points.notna() & (self.points != "")).any()
        return self.points.loc[:, said].copy()

    def where(self, query: str) -> Self:
        """Return the points that a query of `pandas.DataFrame.query` chooses."""
        try:
            chosen = self.points.query(query)
        except Exception as error:  # pandas raises many kinds for what cannot be parsed
            raise ArgumentError(f"query is {query!r}; {error}") from None
        if not len(chosen):
            raise ArgumentError(f"query is {query!r}; no point of the list meets it")
        return replace(self, points=chosen.reset_index(drop=True))

    @property
    def counts(self) -> dict[str, int]:
        """Number of points by signal, the most frequent first."""
        return {str(s): int(n) for s, n in self.points["signal"].value_counts().items()}

    @property
    def places(self) -> NDArray[np.float64]:
        """Positions of the points [m], shape (n, 3); NaN where the list gives none."""
        return self.points[["x_m", "y_m", "z_m"]].to_numpy(dtype=np.float64)

    @property
    def box_places(self) -> NDArray[np.float64]:
        """Positions of their junction boxes [m], shape (n, 3); NaN where the list gives none."""
        return self.points[["box_x_m", "box_y_m", "box_z_m"]].to_numpy(dtype=np.float64)

    @property
    def located(self) -> NDArray[np.bool_]:
        """Whether the position of each point is known, shape (n,)."""
        return np.asarray(np.isfinite(self.places).all(axis=1))
