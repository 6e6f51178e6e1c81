"""Conversion of the rows of an I/O list to points; faults are reported by row and column."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from os import PathLike
from pathlib import Path
from typing import Self

import numpy as np
import pandas as pd

from shipnet.arrays import Bools, Floats
from shipnet.design.words import (
    COLUMNS,
    PLACED,
    YES,
    Reading,
    column_of,
    folded,
    has_side,
    is_frame,
    is_intrinsically_safe,
    is_place_titles,
    off_centre,
    without_safety,
    words,
)
from shipnet.errors import ArgumentError, InputError, some
from shipnet.lists import ALIKE, Cells, clean, cleaned, read_number, widened
from shipnet.signals import SIGNALS, find_signal, meanings, plain, spellings
from shipnet.tables import (
    Remark,
    Sheet,
    frame_sheet,
    parse_sheet,
    read_sheet,
    read_sheets,
    remark_table,
)

# The columns of a sheet, and the rows that are points -------------------------------------------

_POSITION, _BOX = ("x_m", "y_m", "z_m"), ("box_x_m", "box_y_m", "box_z_m")

#: Legal range of each column in its unit, both ends included, but an update time must exceed 0. A
#: ship is shorter than 1 km, and its cables are shorter than 10 km.
RANGES: Mapping[str, tuple[float, float]] = {
    **dict.fromkeys((*_POSITION, *_BOX), (-1e3, 1e3)),
    **dict.fromkeys(("to_box_m", "home_run_m"), (0.0, 1e4)),
    "update_ms": (0.0, 3.6e6),
}

#: The axes of a position: its column, the columns that give it by frame, deck and side.
_AXES = {"x_m": ("frame", "location"), "y_m": ("side", "location"), "z_m": ("deck", "location")}

#: Words in the title of a column that may be a position.
_PLACE_WORD = re.compile(
    r"\b(?:x|y|z|pos\w*|coord\w*|loc\w*|dist\w*|offset|abstand|avstand|cl|centre|center|ap|fp|bl|"
    r"frame|spant\w*|deck|dekk|height|elev\w*|h\xf6he|h\xf8yde)\b|위치|거리|좌표|높이",
    re.IGNORECASE,
)


class Points(Cells):
    """The cells of an I/O list."""

    words, noun, key = words(), "point", "tag"
    titled_by = frozenset({"tag", "type", "signal"})
    has_spares = True
    grouped = ("system", "box")
    literal = ("type", "signal")
    hint = "[columns] in the settings may define them"

    def __init__(self, sheet: Sheet, reading: Reading) -> None:
        self.reading = reading
        # Few rows differ in their type and signal, so each pair is looked up once.
        self._meant: dict[tuple[str, str], bool] = {}
        is_saved = {*COLUMNS} - {"device", "ex"} <= {*sheet.titles} <= {*COLUMNS}
        super().__init__(sheet, reading.columns, is_saved=is_saved)

    def arrange(self, rows: Sequence[tuple[int, list[str]]]) -> None:
        """Read the column of types as that of signals if it contains some, such as Pt100."""
        if "signal" not in self.places and len(self.places.get("type", ())) == 1:
            (column,) = self.places["type"]
            entries = {clean(widened(row[column])) for _, row in rows if column < len(row)}
            others = (word for word in entries if plain(word) not in spellings("type"))
            if any(map(meanings, map(self.reading.signal, others))):
                self.places["signal"] = self.places.pop("type")
        sides = self.places.get("side", [])
        far = [column for column in sides if _DISTANCE.search(self.titles[column])]
        if len(sides) == 2 and len(far) == 1 and "y_m" not in self.places:
            # One column has the side and the other the distance.
            self.places["y_m"] = far
            self.places["side"] = [column for column in sides if column not in far]
            distance = self.column_of(self.titles[far[0]])
            self.units["y_m"] = distance.unit if distance else ""
        positions = [title for title in self.unused if _PLACE_WORD.search(title)]
        if positions and not {*_POSITION} <= self.places.keys():
            self.unused = [title for title in self.unused if title not in positions]
            statement = "; ".join(positions)
            self.remarks.append(Remark(f"not used, but may be a position: {statement}", doubt=True))

    def column_faults(self) -> list[str]:
        """Return which columns of a position, the tag and the signal are missing."""
        faults = []
        for group in (_POSITION, _BOX):
            ways = {name: {name, *_AXES.get(name, ())} for name in group}
            missing = " and no ".join(n for n in group if ways[n].isdisjoint(self.places))
            if missing and not self.places.keys().isdisjoint(group):
                faults.append(f"no column {missing}; expected {', '.join(group)}, or none")
        if "tag" not in self.places:
            faults.append("no column tag")
        if "signal" not in self.places and "type" not in self.places:
            faults.append("no column signal and no column type; expected at least one")
        return faults

    def is_entry(self, cell: Callable[[str], str]) -> bool:
        """Return whether a row has a type, a signal, a number or a frame."""
        pair = cell("type"), cell("signal")
        if pair not in self._meant:
            word, _ = without_safety(self.reading.signal(clean(widened(pair[1]))))
            self._meant[pair] = plain(widened(pair[0])) in spellings("type") or bool(meanings(word))
        numbers = filter(None, (cell(name) for name in (*RANGES, "conductors")))
        has_number = any(
            read_number(number, ".", unit, unit) is not None
            for number in numbers
            for unit in ("m", "ms")
        )
        return self._meant[pair] or has_number or is_frame(cell("frame"))


# Numeric columns of an I/O list: positions of points and boxes, lengths of cables, update times --

#: Amount by which rounding may make a cable shorter than the straight distance [m].
ROUNDED = 0.2


def read_numbers(cells: Points, boxes: Sequence[str]) -> dict[str, Floats]:
    """Return the values of the columns in `RANGES`, NaN where unknown, and record all faults."""
    numbers = {
        name: cells.numbers(name, *RANGES[name], positive=name == "update_ms")
        for name in RANGES
        if name != "y_m"
    }
    numbers["y_m"] = _off_centre(cells)
    if coordinates := [name for name in _POSITION if name in cells.places]:
        _check_partly(cells, coordinates)
    _place_by_frames(cells, numbers)
    _check_boxes(cells, boxes, numbers)
    for name in ("to_box_m", "home_run_m"):
        if 2 * np.count_nonzero(blank := ~cells.given(name)) < len(blank):
            cells.doubt(f"read without {name}, which most others have", blank)
    return {name: numbers[name] for name in RANGES}


def _off_centre(cells: Points) -> Floats:
    """Return y of each point from its own column and that of the side, NaN where both are empty."""
    sides, first = cells["side"], "y_m" if "y_m" in cells.places else "side"
    if "side" in cells.places and cells.places.keys().isdisjoint({"x_m", "frame", "location"}):
        cells.remarks.append(Remark(f"not used: {cells.title('side')}, without a place along"))
        sides = [""] * len(sides)
    (low, high), unit = RANGES["y_m"], cells.units.get("y_m") or cells.units.get("side") or "m"

    @cache
    def read(text: str, beside: str, is_text: bool) -> float | None:
        return off_centre(text, beside, lambda number: cells.read(number, is_text, unit, "m"))

    y, bare = np.full(len(sides), np.nan), np.zeros(len(sides), dtype=bool)
    texts = zip(map(widened, cells["y_m"]), map(widened, sides), cells.typed(first), strict=True)
    for row, (text, beside, is_text) in enumerate(texts):
        value = read(text, beside, is_text) if text or beside else np.nan
        if value is None or value < low or value > high:
            scale = 10.0 ** ALIKE[unit][unit]
            legal = f"a number {low / scale:.7g}..{high / scale:.7g} {unit}"
            cells.wrong([row], "y_m" if text else "side", legal if text else PLACED["side"])
        else:
            y[row] = value
            bare[row] = abs(value) > 0 and not has_side(f"{text} {beside}")
    if first == "side" or _DISTANCE.search(cells.title(first)):
        signed = bool((y[bare] < 0).any())
        end = "as metres to port, negative ones to starboard" if signed else "as metres to port"
        cells.doubt(f"{cells.title(first)}: numbers without a side are read {end}", bare)
    return y


#: Titles of a distance, which may have no sign.
_DISTANCE = re.compile(r"\b(?:dist\w*|off|offset|from|abstand|avstand|von|fra)\b", re.IGNORECASE)


def _place_by_frames(cells: Points, numbers: dict[str, Floats]) -> None:
    """Compute x from frames and z from decks if the list has no columns for them."""
    columns = [name for name in ("frame", "deck", "location") if name in cells.places]
    computed = [axis for axis in ("x_m", "z_m") if axis not in cells.places] if columns else []
    if computed:
        rows = list(zip(*(map(widened, cells[name]) for name in columns), strict=True))
        stated = np.array([any(row) for row in rows], dtype=bool)
        reading = cells.reading
        tables = {"x_m": reading.frames, "z_m": reading.decks}
        if not all(tables[axis] for axis in computed):
            statement = (
                "not placed by frame and deck; the settings do not define both [frames] and [decks]"
            )
            cells.doubt(statement, stated)
            return
        cells_of = {row: dict(zip(columns, row, strict=True)) for row in set(rows)}
        coordinates = {row: axes_at(reading, cells_of[row], computed) for row in cells_of}
        for index in np.flatnonzero(stated).tolist():
            axes = coordinates[rows[index]]
            if isinstance(axes, str):
                cells.wrong([index], axes if axes in columns else "location", PLACED[axes])
                continue
            for name, value in axes.items():
                if name != "y_m" or np.isnan(numbers[name][index]):
                    numbers[name][index] = value
        statement = ", ".join(axis[0] for axis in computed)
        cells.remarks.append(Remark(f"computed from frame and deck: {statement}", detail=True))
        for axis in cells.places.keys() & {*_POSITION}:
            alone = np.flatnonzero(cells.given(axis) & ~stated).tolist()
            empty = np.flatnonzero(stated & ~cells.given(axis)).tolist()
            cells.wrong(alone, columns[0], f"{PLACED[columns[0]]}, because {axis[0]} is given")
            cells.wrong(empty, axis, "a number, because the frame or the deck is given")
    if "y_m" not in cells.places:
        placed = np.isfinite(numbers["x_m"]) & np.isfinite(numbers["z_m"])
        centred = placed & np.isnan(numbers["y_m"])
        cells.doubt("y is 0: no side and no distance from the centre line is given", centred)
        numbers["y_m"][centred] = 0.0


def axes_at(
    reading: Reading, cells: Mapping[str, str], computed: Sequence[str]
) -> dict[str, float] | str:
    """Return the coordinates that frame, deck and location give, or the name of what is unknown."""
    parts = reading.parts(cells)
    ways = {"x_m": ("frame", reading.along), "z_m": ("deck", reading.above)}
    if parts.get("side"):
        ways["y_m"] = ("side", off_centre)
    axes = {}
    for axis, (name, read) in ways.items():
        if axis in computed or axis == "y_m":
            value = read(parts.get(name, ""))
            if value is None:
                return name
            axes[axis] = value
    return axes


def _check_partly(cells: Points, names: Sequence[str]) -> Bools:
    """Check that each point has all coordinates or none; return a mask of those given."""
    have = np.column_stack([cells.given(name) for name in names])
    for row in np.flatnonzero(have.any(axis=1) & ~have.all(axis=1)).tolist():
        missing = [name for name, one in zip(names, have[row], strict=True) if not one]
        titles = " and ".join(map(cells.title, missing))
        required = ", ".join(map(cells.title, names))
        cells.fault(row, missing[0], f", column {titles}: is empty; expected {required}, or none")
    return have


def _check_boxes(cells: Points, boxes: Sequence[str], numbers: dict[str, Floats]) -> None:
    """Check the boxes, and copy the position of a box to those of its points that give none."""
    have = _check_partly(cells, _BOX)
    named = np.array([box != "" for box in boxes], dtype=bool)
    alone = (have.any(axis=1) | cells.given("to_box_m")) & ~named
    cells.wrong(np.flatnonzero(alone).tolist(), "box", "a name for the given position or length")
    places = np.column_stack([numbers[name] for name in _BOX])
    whole = np.isfinite(places).all(axis=1)
    first: dict[str, int] = {}
    for row in np.flatnonzero(named & whole).tolist():
        first.setdefault(boxes[row], row)
    same = np.array([first.get(box, -1) for box in boxes])
    stray = whole & (same >= 0) & (places != places[same]).any(axis=1)
    for row in np.flatnonzero(stray).tolist():
        where = ", ".join(f"{value:g}" for value in places[same[row]])
        other = f"box {boxes[row]!r} has a different position in row {cells.rows[same[row]]}"
        statement = f", column {cells.title(_BOX[0])}: {other}; expected {where} m"
        cells.fault(row, _BOX[0], statement)
    fill = (same >= 0) & ~have.any(axis=1)
    for axis, name in enumerate(_BOX):
        numbers[name] = np.where(fill, places[same, axis], numbers[name])
    away = [numbers[axis_of] - numbers[box] for axis_of, box in zip(_POSITION, _BOX, strict=True)]
    straight = np.sqrt(np.square(away).sum(axis=0))
    short = numbers["to_box_m"] < straight - ROUNDED
    cells.doubt("the length to the box is used, but is shorter than the straight distance", short)


# The points, or all faults of the rows ------------------------------------------------------------

_CATEGORIES = {
    plain(word): name
    for number, name in enumerate(("I", "II", "III"), start=1)
    for word in (name, str(number), f"cat {name}", f"cat {number}", f"category {name}")
}


def points_of(
    sheet: Sheet, reading: Reading, *, strict: bool = False
) -> tuple[pd.DataFrame, tuple[Remark, ...]]:
    """Convert the rows of a sheet to points; return the points and the remarks."""
    cells = Points(sheet, reading)
    texts = {name: _text(cells, name) for name in ("tag", "system", "box", "device")}
    texts["ex"] = _safety(cells)
    cells.wrong([row for row, tag in enumerate(texts["tag"]) if not tag], "tag", "a tag")
    first: dict[str, int] = {}
    for row, tag in enumerate(texts["tag"]):
        before = first.setdefault(tag.casefold(), row)
        if before != row and tag:
            taken = f"{tag!r} is already the tag of row {cells.rows[before]}"
            statement = f", column {cells.title('tag')}: {taken}; expected a different tag"
            cells.fault(row, "tag", statement)
    types = {plain(word): find_signal(name) for word, name in reading.signals}
    types |= {word: means[0][0] for word, means in spellings("type").items()}
    unsafe = cells.given("ex") & ~np.fromiter(map(bool, texts["ex"]), bool, len(cells.rows))
    signals = _signals(cells, _look_up(cells, "type", types, "DI, DO, AI or AO"), texts["ex"])
    disagree = unsafe & np.fromiter(map(bool, texts["ex"]), bool, len(cells.rows))
    cells.doubt(
        f"intrinsically safe by the signal, but not by column {cells.title('ex')}", disagree
    )
    categories = _look_up(cells, "category", _CATEGORIES, "I, II, III or nothing")
    numbers = read_numbers(cells, texts["box"])
    if "system" in cells.places:
        cells.doubt("no system", ~cells.given("system"))
    unboxed = tuple(row for row, box in zip(cells.rows, texts["box"], strict=True) if not box)
    if 0 < len(unboxed) < len(cells.rows):
        cells.remarks.append(Remark("no box", unboxed, detail=True))
    cells.check(strict=strict)
    if safe := tuple(row for row, mark in zip(cells.rows, texts["ex"], strict=True) if mark):
        cells.remarks.append(Remark("intrinsically safe, each with a barrier", safe))
    if count := int(np.isnan(numbers["update_ms"]).sum()):
        which = f"{count} points have" if count > 1 else "1 point has"
        statement = f"{which} no update time; the one in the settings is used, by default 1000 ms"
        cells.remarks.append(Remark(statement))
    # The printable text of all note columns.
    notes = [cleaned(cells.column(column)) for column in cells.places.get("note", [])]
    together = ["; ".join(filter(None, n)) for n in zip(*notes, strict=True)] if notes else ""
    if not "".join(together).isprintable():
        together = ["".join(filter(str.isprintable, note)) for note in together]
    columns: dict[str, object] = {
        **texts,
        "type": [SIGNALS[name].kind for name in signals],
        "signal": signals,
        "conductors": np.array([SIGNALS[name].conductors for name in signals], dtype=np.int64),
        **numbers,
        "category": categories,
        "note": together,
    }
    return pd.DataFrame({name: columns[name] for name in COLUMNS}), tuple(cells.remarks)


def _text(cells: Points, name: str) -> list[str]:
    texts = cleaned(cells[name])
    # If every text is printable, one test of all texts suffices.
    if cells.sheet.odd or not "".join(texts).isprintable():
        bad = [n for n, text in enumerate(texts) if not text.isprintable() or cells.odd(n, name)]
        cells.wrong(bad, name, "printable text")
    return texts


#: Titles of columns whose "yes" may also mean another type of protection.
_HAZARD = re.compile("hazard|explosion|protection|class|방폭", re.IGNORECASE)


def _safety(cells: Points) -> list[str]:
    """Return the mark of each point that its column calls intrinsically safe, otherwise ""."""
    texts, title = cleaned(cells["ex"]), cells.title("ex")
    marks = {text: folded(text) for text in dict.fromkeys(texts) if text}
    bad = [n for n in range(len(texts)) if cells.odd(n, "ex") not in ("", "true or false")]
    bad += [n for n, text in enumerate(texts) if not text.isprintable()]
    cells.wrong(sorted(set(bad)), "ex", "a mark such as Ex ia or Ex d, yes or no")
    read = {text: is_intrinsically_safe(text) for text in marks}
    if {"o", "x"} <= set(marks.values()):
        read |= {text: (mark == "o", True) for text, mark in marks.items() if mark in ("o", "x")}
        remark = "o read as intrinsically safe, and x as not, because the column has both"
        cells.remarks.append(Remark(f"{title}: {remark}"))
    is_yes = {text for text, (safe, _) in read.items() if safe and marks[text] in YES | {"o"}}
    if _HAZARD.search(title):
        read |= dict.fromkeys(is_yes, (True, False))
    for safe, sure in sorted(set(read.values())):
        alike = {text: repr(text) for text in marks if read[text] == (safe, sure)}
        rows = tuple(row for row, text in zip(cells.rows, texts, strict=True) if text in alike)
        cited, negated = some([*alike.values()], 5), "" if safe else "not "
        remark = f"{title} {cited} read as {negated}intrinsically safe"
        remark += "" if sure else ", but does not say so clearly"
        cells.remarks.append(Remark(remark, rows, doubt=not sure, detail=sure))
    meaning = {text: "IS" if text in is_yes else text for text, (safe, _) in read.items() if safe}
    return [meaning.get(text, "") for text in texts]


def _look_up(cells: Points, name: str, words: Mapping[str, str], expected: str) -> list[str]:
    """Return the meaning of each cell of a column, "" if empty; unknown cells are faults."""
    meaning = {cell: words.get(plain(widened(cell)), "") for cell in set(cells[name])}
    rows = [row for row, cell in enumerate(cells[name]) if cell and not meaning[cell]]
    cells.wrong(rows, name, expected)
    return [meaning[cell] for cell in cells[name]]


#: Number of unknown signals for each of which the nearest known one is searched.
_UNKNOWN = 1000


def _signals(cells: Points, kinds: list[str], safety: list[str]) -> list[str]:
    """Return the signal of each point, and add intrinsic-safety markings to `safety`."""
    # A list has few distinct signals, so each is looked up once.
    cache: dict[tuple[str, str, str, str], tuple[str, str, list[tuple[str, str]]]] = {}
    signals: list[str] = []
    unknown = 0
    taken: dict[tuple[str, str], list[int]] = {}
    words = cleaned([*map(widened, cells["signal"])])
    points = zip(words, cells["type"], kinds, cells["conductors"], strict=True)
    for row, point in enumerate(points):
        if point not in cache:
            bare, safe = without_safety(cells.reading.signal(point[0]))
            signal, faults = _signal(bare, *point[1:])
            cache[point] = signal, safe, faults
            unknown += any(column == "signal" for column, _ in faults)
            if unknown > _UNKNOWN:
                title, more = cells.title("signal"), f"more than {_UNKNOWN} different cells"
                why = f"column {title}: {more} are not known signals, such as {point[0]!r}"
                raise InputError(cells.source, f"{why}; is it the column of signals?")
        signal, safe, faults = cache[point]
        for column, text in faults:
            cells.fault(row, column, f", column {cells.title(column)}: {text}")
        signals.append(signal)
        safety[row] = safety[row] or safe
        if point[0] and point[0] != signal and not faults:
            taken.setdefault((point[0], signal), []).append(cells.rows[row])
    untyped = (word for word, kind in zip(words, kinds, strict=True) if not kind)
    for word, count in Counter(filter(_input_of, untyped)).items():
        statement = f"signal {word!r} without a type is read as an input, not an output"
        cells.remarks.append(Remark(f"{statement}: {count} time{'s' if count > 1 else ''}"))
    for (word, signal), rows in taken.items():
        cells.remarks.append(Remark(f"signal {word!r} read as {signal}", tuple(rows), detail=True))
    return signals


def _input_of(word: str) -> str:
    """Return the input type of a word if it may mean an input or an output, otherwise ""."""
    kinds = {SIGNALS[name].kind for name in meanings(word)}
    return next((k for k in kinds if k[1] == "I"), "") if {k[1] for k in kinds} == {*"IO"} else ""


def _signal(word: str, text: str, kind: str, count: str) -> tuple[str, list[tuple[str, str]]]:
    """Return a point's signal, given or inferred from its type, and its faults by column.

    A type such as SERIAL is a signal, and stands for the type of this signal.
    """
    named, kind = (kind, SIGNALS[kind].kind) if kind in SIGNALS else ("", kind)
    word = word or named
    whole = re.fullmatch(r"([0-9]{1,4})([.,]0+)?", widened(count))
    conductors = int(whole[1]) if whole else None
    faults = []
    if count and not conductors:
        faults.append(("conductors", f"{count!r}; expected a whole number 1..9999"))
    if not word and not kind:
        if not text:  # an unknown type is already recorded as a fault
            expected = f"is empty; expected one of {', '.join(SIGNALS)}, or a type"
            faults.append(("signal", expected))
        return "contact", faults
    try:
        signal = find_signal(word or kind, kind or _input_of(word), conductors)
    except ArgumentError as error:
        if word:
            return "contact", [*faults, ("signal", str(error))]
        alike = ", ".join(name for name, signal in SIGNALS.items() if signal.kind == kind)
        return "contact", [*faults, ("signal", f"is empty; expected one of {alike}")]
    entry = SIGNALS[signal]
    if (kind and entry.kind != kind) or (named and named != signal):
        faults.append(("type", f"{text!r}; expected {entry.kind} for the signal {signal}"))
    if conductors and entry.conductors != conductors:
        expected = f"expected {entry.conductors} for the signal {signal}"
        faults.append(("conductors", f"{count!r}; {expected}"))
    return signal, faults


# The table of points ---------------------------------------------------------------------------

#: The default words for reading a list.
_PLAIN = Reading()

#: The titles that an I/O list must have, as error messages call them.
_WHAT = "titles of an I/O list (at least tag and either signal or type)"


@dataclass(frozen=True, eq=False)
class PointTable:
    """The points of a list, one per row; `IoList` adds plans, comparisons and figures."""

    points: pd.DataFrame
    source: str
    notes: tuple[Remark, ...] = ()
    words: Reading = _PLAIN

    def __post_init__(self) -> None:
        missing = [name for name in COLUMNS if name not in self.points.columns]
        if missing:
            raise ArgumentError(
                f"points have no column {', '.join(missing)}; use IoList.from_table"
            )
        if not self.points.index.equals(pd.RangeIndex(len(self.points))):
            raise ArgumentError("the rows of points must be numbered from 0; use IoList.from_table")

    @classmethod
    def parse(
        cls, text: str, source: str = "text", *, reading: Reading = _PLAIN, strict: bool = False
    ) -> Self:
        """Read an I/O list from text, such as the content of an editor."""
        is_titles = Points.score(reading.columns)
        return cls._of(parse_sheet(text, source, is_titles=is_titles, what=_WHAT), reading, strict)

    @classmethod
    def from_table(cls, table: pd.DataFrame, source: str = "table") -> Self:
        """Make an I/O list from a table, with the same checks as for a file."""
        return cls._of(frame_sheet(table, source), _PLAIN, False)

    @classmethod
    def read(
        cls,
        path: str | PathLike[str],
        sheet: str | None = None,
        *,
        reading: Reading = _PLAIN,
        strict: bool = False,
    ) -> Self:
        """Read an I/O list from a CSV file or an Excel workbook."""
        table = read_sheet(path, sheet, is_titles=Points.score(reading.columns), what=_WHAT)
        near = [table.titles, *(cells for _, cells in [*table.above[-1:], *table.rows[:1]])]
        titles = (title for cells in near for title in cells)
        names = {column.name for t in titles if (column := column_of(t, reading.columns))}
        needed = names & {"frame", "deck", "location"} and not {"x_m", "z_m"} <= names
        if needed and not (reading.frames or reading.decks):
            places = read_sheets(path, is_place_titles)
            reading, remarks = reading.with_sheets(places)
            table = table.also_read([one.sheet for one in places]) if places else table
            table = replace(table, remarks=(*table.remarks, *remarks))
        return cls._of(table, reading, strict)

    @classmethod
    def _of(cls, sheet: Sheet, reading: Reading, strict: bool) -> Self:
        points, notes = points_of(sheet, reading, strict=strict)
        return cls(points, sheet.source, notes, reading)

    @property
    def remarks(self) -> tuple[str, ...]:
        """Remarks on data that were not used, left out, filled in or assumed."""
        return tuple(str(note) for note in self.notes if not note.detail)

    def reading(self) -> pd.DataFrame:
        """Return the remarks on how the list was read; columns what, count, rows and doubt."""
        return remark_table(self.notes)

    def __len__(self) -> int:
        return len(self.points)

    def __str__(self) -> str:
        return f"{self._said} of {Path(self.source).name}"

    def __repr__(self) -> str:
        return f"<{type(self).__name__}: {self._said}>"

    @property
    def _said(self) -> str:
        counts = self.points["type"].value_counts(sort=False)
        kinds = ", ".join(f"{number} {kind}" for kind, number in counts.items())
        return f"{len(self)} point{'' if len(self) == 1 else 's'} ({kinds})"

    def table(self) -> pd.DataFrame:
        """Return the points, one per row, without empty columns."""
        filled = (self.points.notna() & (self.points != "")).any()
        return self.points.loc[:, filled].copy()

    def where(self, query: str) -> Self:
        """Return a list of the points that match a query for `pandas.DataFrame.query`."""
        try:
            chosen = self.points.query(query)
        except Exception as error:  # pandas raises many kinds of errors for illegal queries
            raise ArgumentError(f"query is {query!r}; {error}") from None
        if not len(chosen):
            raise ArgumentError(f"query is {query!r}; no point of the list matches it")
        return replace(self, points=chosen.reset_index(drop=True))

    @property
    def counts(self) -> dict[str, int]:
        """Number of points per signal, the most frequent first."""
        return {str(s): int(n) for s, n in self.points["signal"].value_counts().items()}

    @property
    def places(self) -> Floats:
        """Positions of the points [m], shape (n, 3); NaN where unknown."""
        return self.points[["x_m", "y_m", "z_m"]].to_numpy(float)

    @property
    def box_places(self) -> Floats:
        """Positions of the points' junction boxes [m], shape (n, 3); NaN where unknown."""
        return self.points[["box_x_m", "box_y_m", "box_z_m"]].to_numpy(float)

    @property
    def located(self) -> Bools:
        """Mask of the points whose position is known, shape (n,)."""
        return np.asarray(np.isfinite(self.places).all(axis=1))
