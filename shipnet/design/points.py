"""Conversion of the rows of an I/O list to points; faults are reported by row and column."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain, pairwise, zip_longest
from os import PathLike
from pathlib import Path
from typing import Self

import numpy as np
import pandas as pd

from shipnet.arrays import Bools, Floats
from shipnet.design.words import (
    COLUMNS,
    PLACED,
    UNITS,
    YES,
    Reading,
    column_of,
    decimal_mark,
    folded,
    is_frame,
    is_intrinsically_safe,
    is_place_titles,
    read_number,
    widened,
    without_safety,
)
from shipnet.errors import ArgumentError, InputError, listed
from shipnet.signals import SIGNALS, find_signal, meanings, plain, spellings
from shipnet.tables import Remark, Sheet, frame_sheet, parse_sheet, read_sheet, read_sheets

# The columns of a sheet, and the rows that are points -------------------------------------------

_POSITION, _BOX = ("x_m", "y_m", "z_m"), ("box_x_m", "box_y_m", "box_z_m")

#: Legal range of each column in its unit, both ends included, but an update time must exceed 0. A
#: ship is shorter than 1 km, and its cables are shorter than 10 km.
RANGES: Mapping[str, tuple[float, float]] = {
    **dict.fromkeys((*_POSITION, *_BOX), (-1e3, 1e3)),
    **dict.fromkeys(("to_box_m", "home_run_m"), (0.0, 1e4)),
    "update_ms": (0.0, 3.6e6),
}

#: Marks of points that will not be built, and of spare tags.
_MARK = r"\W*(?:deleted?|cancell?ed|void|not used|spare|삭제|예비)"
_MARKED = re.compile(rf"{_MARK}\W*", re.IGNORECASE)
_MARKED_TAG = re.compile(rf"{_MARK}\b.*", re.IGNORECASE)


def score(reading: Reading) -> Callable[[Sequence[str]], float]:
    """Return a function that scores how well the cells of a row serve as titles of an I/O list."""

    def worth(cells: Sequence[str]) -> float:
        found = {column.name for cell in cells if (column := column_of(cell, reading.columns))}
        named = not found.isdisjoint({"tag", "type", "signal"})
        return len(found) if len(found) > 1 and named else 0

    return worth


class Cells:
    """The columns of a sheet (one cell per point), and the remarks and faults found in it."""

    def __init__(self, sheet: Sheet, reading: Reading) -> None:
        self.sheet, self.reading = sheet, reading
        self._source = f"{sheet.source}, sheet {sheet.sheet}" if sheet.sheet else sheet.source
        self.remarks = list(sheet.remarks)
        self.places: dict[str, list[int]] = {}
        self.scales: dict[str, float] = {}
        self._faults: list[tuple[int, int, str]] = []
        rows = list(sheet.rows)
        self.titles = list(sheet.titles)
        self._repeated = [self.titles]
        if rows and (second := self._second_line(rows[0][1])):
            self.titles = second
            self.remarks.append(Remark("titles in two rows", (sheet.top, rows[0][0]), detail=True))
            self._repeated.append(rows.pop(0)[1])
        if sheet.above:
            self.remarks.append(Remark("left out, above the titles", sheet.above, detail=True))
        self._find_columns(rows)
        rows = self._points_of(rows)
        if not rows:
            raise InputError(self._source, "has no points; expected one per row")
        self.rows = [number for number, _ in rows]
        self._columns = [list(c) for c in zip_longest(*(row for _, row in rows), fillvalue="")]
        self._check_width(rows)
        self._fill_down("system")

    def _second_line(self, below: Sequence[str]) -> list[str] | None:
        """Return the titles combined with the row `below`, or None if it is not a row of titles."""
        titles, above, understood = [], "", 0
        for title, cell in zip_longest(self.titles, below, fillvalue=""):
            above = title or above
            if not plain(cell):
                titles.append(title)
                continue
            both = (f"{above} {cell}", cell)
            found = next((t for t in both if column_of(t, self.reading.columns)), None)
            if found is None and (cell.isascii() or not title):
                return None
            understood += found is not None
            titles.append(found or title)
        return titles if understood else None

    def _find_columns(self, rows: Sequence[tuple[int, list[str]]]) -> None:
        unused = []
        for place, title in enumerate(self.titles):
            column = column_of(title, self.reading.columns)
            if column is not None:
                self.places.setdefault(column.name, []).append(place)
                self.scales.setdefault(column.name, column.scale)
            elif title:
                unused.append(title)
            elif any(row[place] for _, row in rows if place < len(row)):
                unused.append(f"column {_letter(place)}, which has no title")
        if "signal" not in self.places and len(self.places.get("type", ())) == 1:
            # Many lists have signals, such as Pt100, in a column called type.
            (place,) = self.places["type"]
            words = {clean(widened(row[place])) for _, row in rows if place < len(row)}
            others = (word for word in words if plain(word) not in spellings("type"))
            if any(map(meanings, map(self.reading.signal, others))):
                self.places["signal"] = self.places.pop("type")
        faults = [
            f"{' and '.join(repr(self.titles[place]) for place in places)} both mean {name}"
            for name, places in self.places.items()
            if len(places) > 1 and name != "note"
        ]
        for group in (_POSITION, _BOX):
            missing = [name for name in group if name not in self.places]
            if 0 < len(missing) < 3:
                wanted = ", ".join(group)
                faults.append(f"no column {' and no '.join(missing)}; expected {wanted}, or none")
        if "tag" not in self.places:
            faults.append("no column tag")
        if "signal" not in self.places and "type" not in self.places:
            faults.append("no column signal and no column type; expected at least one")
        used = "; ".join(unused)
        if faults:
            faults = [f"row {self.sheet.top}: {fault}" for fault in faults]
            hint = f"unknown titles: {used}; [columns] in the settings may define them"
            raise InputError(self._source, *faults, *([hint] * bool(used)))
        if unused:
            self.remarks.append(Remark(f"not used: {used}"))

    def _points_of(self, rows: Iterable[tuple[int, list[str]]]) -> list[tuple[int, list[str]]]:
        """Return the rows that are points, and add remarks on rows that are left out or hidden."""
        points, left = [], dict[str, list[int]]()
        heads = [{cell for cell in titles if cell} for titles in self._repeated]
        # Few rows contain a title or a mark such as `void`; compare only these with the titles.
        words = set(chain.from_iterable(cells for _, cells in rows))
        marked = set(filter(_MARKED.fullmatch, words))
        suspect = marked.union(*heads)
        meant: dict[tuple[str, str], bool] = {}
        for number, cells in rows:
            near = () if suspect.isdisjoint(cells) else heads
            why = self._no_point(number, cells, near, not marked.isdisjoint(cells), meant)
            if why:
                left.setdefault(why, []).append(number)
            else:
                points.append((number, cells))
        for why, numbers in left.items():
            harmless = why in (_REPEATED, _TEXT)
            self.remarks.append(Remark(f"left out, {why}", tuple(numbers), doubt=not harmless))
        if hidden := tuple(number for number, _ in points if number in self.sheet.hidden):
            self.remarks.append(Remark("hidden, but read", hidden, doubt=True))
        return points

    def _no_point(
        self,
        number: int,
        cells: list[str],
        heads: Sequence[set[str]],
        is_marked: bool,
        meant: dict[tuple[str, str], bool],
    ) -> str:
        """Return why a row is not a point, or "" if it is one; `meant` caches look-ups of words."""
        for head in heads:
            if not head.isdisjoint(cells):
                same = sum(" ".join(cell.split()) in head for cell in cells if cell)
                if same > 1 and 2 * same >= sum(map(bool, cells)):
                    return _REPEATED
        if number in self.sheet.struck:
            return "struck out"

        def cell(name: str) -> str:
            place = self.places.get(name, [len(cells)])[0]
            return cells[place] if place < len(cells) else ""

        tag, what = clean(cell("tag")), (cell("type"), cell("signal"))
        if is_marked or _MARKED_TAG.fullmatch(tag):
            return "marked as deleted or spare"
        if what not in meant:
            word, _ = without_safety(self.reading.signal(clean(widened(what[1]))))
            meant[what] = plain(widened(what[0])) in spellings("type") or bool(meanings(word))
        numbers = (cell(name) for name in (*RANGES, "conductors"))
        if meant[what] or any(map(_holds_number, numbers)) or is_frame(cell("frame")):
            return ""
        # A row with only a tag may be a point whose other cells were forgotten.
        return "" if re.search(r"[0-9]", tag) and not re.search(r"\s", tag) else _TEXT

    def _check_width(self, rows: Sequence[tuple[int, list[str]]]) -> None:
        width = len(self.titles)
        beside = [row for row, (_, cells) in enumerate(rows) if any(cells[width:])]
        if self.sheet.separator:
            # Either the row is shifted, or an unquoted cell contains the separator.
            for row in beside:
                self.fault(row, "", f" has {len(rows[row][1])} cells; expected {width}")
        elif beside:
            numbers = tuple(self.rows[row] for row in beside)
            self.remarks.append(Remark("not used: cells beside the table", numbers))

    def _fill_down(self, name: str) -> None:
        """Fill a column that has values only in the first row of each group."""
        cells = self[name]
        given = [cell for cell in cells if cell]
        twice = any(a and a == b for a, b in pairwise(cells))
        if not given or len(given) == len(cells) or not cells[0] or twice:
            return
        filled = tuple(row for row, cell in zip(self.rows, cells, strict=True) if not cell)
        for row in range(1, len(cells)):
            cells[row] = cells[row] or cells[row - 1]
        said = f"{name} filled down from the row above, because it is given once per group"
        self.remarks.append(Remark(said, filled, doubt=True))

    def __getitem__(self, name: str) -> list[str]:
        """Return the cells of a column, all empty if the list has no such column."""
        places = self.places.get(name)
        return self.column(places[0]) if places else [""] * len(self.rows)

    def column(self, place: int) -> list[str]:
        """Return the cells of a column by its index."""
        return self._columns[place] if place < len(self._columns) else [""] * len(self.rows)

    def given(self, name: str) -> Bools:
        """Return a mask of the filled cells of a column."""
        return np.fromiter(map(bool, self[name]), bool, len(self.rows))

    def title(self, name: str) -> str:
        """Return the title of a column in the list, with the column's letter in a spreadsheet."""
        places = self.places.get(name)
        if not places:
            return name
        letter = f" ({_letter(places[0])})" if self.sheet.top > 0 else ""
        return f"{self.titles[places[0]]}{letter}"

    def fault(self, row: int, name: str, text: str) -> None:
        """Record a fault in a row."""
        place = self.places[name][0] if name in self.places else -1
        self._faults.append((row, place, f"row {self.rows[row]}{text}"))

    def wrong(self, rows: Iterable[int], name: str, expected: str) -> None:
        """Record the same fault for the cells of a column in the given rows."""
        cells = self[name]
        for row in rows:
            what = self.odd(row, name)
            cell = f"{cells[row]!r}{what and f', {what}'}" if cells[row] else "is empty"
            self.fault(row, name, f", column {self.title(name)}: {cell}; expected {expected}")

    def doubt(self, what: str, rows: Bools) -> None:
        """Add a remark on doubtful points."""
        if rows.any():
            numbers = tuple(self.rows[row] for row in np.flatnonzero(rows).tolist())
            self.remarks.append(Remark(what, numbers, doubt=True))

    def odd(self, row: int, name: str) -> str:
        """Return a description of a cell if it is neither text nor a number, otherwise ""."""
        places = self.places.get(name, [-1])
        return self.sheet.odd.get((self.rows[row], places[0]), "")

    def check(self, strict: bool) -> None:
        """Raise InputError with all faults, if any; with `strict`, doubtful rows are faults too."""
        faults = [text for _, _, text in sorted(self._faults)]
        if strict:
            faults += [f"row {n}: {one.what}" for one in self.remarks if one.doubt
                       for n in one.rows]  # fmt: skip
        if faults:
            raise InputError(self._source, *faults)


#: Reasons to leave out a row that is clearly not a point.
_REPEATED, _TEXT = "repeated titles", "not a point: a subtitle, page header, page footer or note"


def _letter(place: int) -> str:
    """Return the letters of a spreadsheet column, such as AB, given its index from 0."""
    more, own = divmod(place, 26)
    return (_letter(more - 1) if more else "") + chr(65 + own)


def _holds_number(cell: str) -> bool:
    units = {**UNITS["length"], **UNITS["time"]}
    return bool(cell) and read_number(cell, "", 1.0, units) is not None


def clean(cell: str) -> str:
    """Return the text of a cell as one line."""
    # The space is the only printable whitespace character.
    return cell if cell.isprintable() and "  " not in cell else " ".join(cell.split())


def _cleaned(cells: Sequence[str]) -> list[str]:
    """Return the cleaned cells of a column."""
    # If no cell needs cleaning, one test of all cells suffices; cells are already stripped.
    text = "|".join(cells)
    if text.isprintable() and "  " not in text:
        return list(cells)
    known = {cell: clean(cell) for cell in set(cells)}
    return [known[cell] for cell in cells]


# Numeric columns of an I/O list: positions of points and boxes, lengths of cables, update times --

#: Amount by which rounding may make a cable shorter than the straight distance [m].
ROUNDED = 0.2


def read_numbers(cells: Cells, boxes: Sequence[str]) -> dict[str, Floats]:
    """Return the values of the columns in `RANGES`, NaN where unknown, and record all faults."""
    mark = decimal_mark(set().union(*(cells[name] for name in RANGES)))
    if mark == ",":
        cells.remarks.append(Remark("numbers have a decimal comma", detail=True))
    numbers = {name: _numbers(cells, name, mark) for name in RANGES}
    _check_partly(cells, _POSITION)
    _place_by_frames(cells, numbers)
    _check_boxes(cells, boxes, numbers)
    return numbers


def _numbers(cells: Cells, name: str, mark: str) -> Floats:
    low, high = RANGES[name]
    if name not in cells.places:
        return np.full(len(cells.rows), np.nan)
    units, scale = UNITS[COLUMNS[name]], cells.scales[name]
    # A list has few distinct numbers, so each is parsed once.
    known = {cell: read_number(cell, mark, scale, units) for cell in set(cells[name])}
    wrong = {cell for cell, value in known.items() if cell and value is None}
    bad = [row for row, cell in enumerate(cells[name]) if cell in wrong] if wrong else []
    values = np.array([known[cell] for cell in cells[name]], dtype=np.float64)
    outside = (values < low) | (values > high) | ((values == 0) & (name == "update_ms"))
    unit = next(u for u, s in units.items() if s == scale)
    above = "above 0, up to " if name == "update_ms" else f"{low / scale:.7g}.."
    expected = f"a number {above}{high / scale:.7g} {unit}"
    cells.wrong([*bad, *np.flatnonzero(outside).tolist()], name, expected)
    return values


def _place_by_frames(cells: Cells, numbers: dict[str, Floats]) -> None:
    """Place points by frame, deck and side if the list has no columns for x, y and z."""
    columns = [name for name in PLACED if name in cells.places]
    if not columns or "x_m" in cells.places:
        return
    rows = list(zip(*(map(widened, cells[name]) for name in columns), strict=True))
    given = np.array([any(row) for row in rows], dtype=bool)
    if not (cells.reading.frames and cells.reading.decks):
        said = "not placed by frame and deck; the settings do not define both [frames] and [decks]"
        cells.doubt(said, given)
        return
    known = {row: cells.reading.place(dict(zip(columns, row, strict=True))) for row in set(rows)}
    for place in np.flatnonzero(given).tolist():
        found = known[rows[place]]
        if isinstance(found, str):
            cells.wrong([place], found if found in columns else "location", PLACED[found])
            continue
        for name, value in zip(_POSITION, found, strict=True):
            numbers[name][place] = value
    cells.remarks.append(Remark("x, y, z computed from frame, deck and side", detail=True))


def _check_partly(cells: Cells, names: Sequence[str]) -> Bools:
    """Check that each point has all coordinates or none; return a mask of those given."""
    have = np.column_stack([cells.given(name) for name in names])
    for row in np.flatnonzero(have.any(axis=1) & ~have.all(axis=1)).tolist():
        missing = [name for name, one in zip(names, have[row], strict=True) if not one]
        titles = " and ".join(map(cells.title, missing))
        wanted = ", ".join(map(cells.title, names))
        cells.fault(row, missing[0], f", column {titles}: is empty; expected {wanted}, or none")
    return have


def _check_boxes(cells: Cells, boxes: Sequence[str], numbers: dict[str, Floats]) -> None:
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
        said = f", column {cells.title(_BOX[0])}: {other}; expected {where} m"
        cells.fault(row, _BOX[0], said)
    fill = (same >= 0) & ~have.any(axis=1)
    for axis, name in enumerate(_BOX):
        numbers[name] = np.where(fill, places[same, axis], numbers[name])
    away = [numbers[own] - numbers[box] for own, box in zip(_POSITION, _BOX, strict=True)]
    straight = np.sqrt(np.square(away).sum(axis=0))
    short = numbers["to_box_m"] < straight - ROUNDED
    cells.doubt("the length to the box is used, but is shorter than the straight distance", short)


# The points, or all faults of the rows ------------------------------------------------------------

_CATEGORIES = {
    plain(word): name
    for number, name in enumerate(("I", "II", "III"), start=1)
    for word in (name, str(number), f"cat {name}", f"cat {number}", f"category {name}")
}

#: A signal, its intrinsic-safety marking, and the faults of the point by column.
_Found = tuple[str, str, list[tuple[str, str]]]


def points_of(
    sheet: Sheet, reading: Reading, *, strict: bool = False
) -> tuple[pd.DataFrame, tuple[Remark, ...]]:
    """Convert the rows of a sheet to points; return the points and the remarks."""
    cells = Cells(sheet, reading)
    texts = {name: _text(cells, name) for name in ("tag", "system", "box", "device")}
    texts["ex"] = _safety(cells)
    _check_tags(cells, texts["tag"])
    types = {word: found[0][0] for word, found in spellings("type").items()}
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
    cells.check(strict)
    if safe := tuple(row for row, mark in zip(cells.rows, texts["ex"], strict=True) if mark):
        cells.remarks.append(Remark("intrinsically safe, each with a barrier", safe))
    if count := int(np.isnan(numbers["update_ms"]).sum()):
        which = f"{count} points have" if count > 1 else "1 point has"
        said = f"{which} no update time; the one in the settings is used, by default 1000 ms"
        cells.remarks.append(Remark(said))
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
    texts = _cleaned(cells[name])
    # If every text is printable, one test of all texts suffices.
    if cells.sheet.odd or not "".join(texts).isprintable():
        bad = [n for n, text in enumerate(texts) if not text.isprintable() or cells.odd(n, name)]
        cells.wrong(bad, name, "printable text")
    return texts


#: Titles of columns whose "yes" may also mean another type of protection.
_HAZARD = re.compile("hazard|explosion|protection|class|방폭", re.IGNORECASE)


def _safety(cells: Cells) -> list[str]:
    """Return the mark of each point that its column calls intrinsically safe, otherwise ""."""
    texts, title = _cleaned(cells["ex"]), cells.title("ex")
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
        more = f" and {len(alike) - 5} more" if len(alike) > 5 else ""
        cited = ", ".join([*alike.values()][:5]) + more
        remark = f"{title} {cited} read as {'' if safe else 'not '}intrinsically safe"
        remark += "" if sure else ", but does not say so clearly"
        cells.remarks.append(Remark(remark, rows, doubt=not sure, detail=sure))
    known = {text: "IS" if text in is_yes else text for text, (safe, _) in read.items() if safe}
    return [known.get(text, "") for text in texts]


def _notes(cells: Cells) -> list[str]:
    """Return the printable text of each point's notes, from all note columns."""
    columns = [_cleaned(cells.column(place)) for place in cells.places.get("note", [])]
    if not columns:
        return [""] * len(cells.rows)
    notes = ["; ".join(filter(None, own)) for own in zip(*columns, strict=True)]
    return [n if n.isprintable() else "".join(filter(str.isprintable, n)) for n in notes]


def _check_tags(cells: Cells, tags: list[str]) -> None:
    first: dict[str, int] = {}
    cells.wrong([row for row, tag in enumerate(tags) if not tag], "tag", "a tag")
    for row, tag in enumerate(tags):
        before = first.setdefault(tag.casefold(), row)
        if before != row and tag:
            taken = f"{tag!r} is already the tag of row {cells.rows[before]}"
            said = f", column {cells.title('tag')}: {taken}; expected a different tag"
            cells.fault(row, "tag", said)


def _look_up(cells: Cells, name: str, known: Mapping[str, str], expected: str) -> list[str]:
    """Return the meaning of each cell of a column, "" if empty; unknown cells are faults."""
    found = {cell: known.get(plain(widened(cell)), "") for cell in set(cells[name])}
    rows = [row for row, cell in enumerate(cells[name]) if cell and not found[cell]]
    cells.wrong(rows, name, expected)
    return [found[cell] for cell in cells[name]]


def _signals(cells: Cells, kinds: list[str], safety: list[str]) -> list[str]:
    """Return the signal of each point, and add intrinsic-safety markings to `safety`."""
    # A list has few distinct signals, so each is looked up once.
    known: dict[tuple[str, str, str, str], _Found] = {}
    signals: list[str] = []
    taken: dict[tuple[str, str], list[int]] = {}
    words = _cleaned([*map(widened, cells["signal"])])
    points = zip(words, cells["type"], kinds, cells["conductors"], strict=True)
    for row, point in enumerate(points):
        if point not in known:
            bare, safe = without_safety(cells.reading.signal(point[0]))
            signal, faults = _signal(bare, *point[1:])
            known[point] = signal, safe, faults
        signal, safe, faults = known[point]
        for column, text in faults:
            cells.fault(row, column, f", column {cells.title(column)}: {text}")
        signals.append(signal)
        safety[row] = safety[row] or safe
        if point[0] and point[0] != signal and not faults:
            taken.setdefault((point[0], signal), []).append(cells.rows[row])
    untyped = (word for word, kind in zip(words, kinds, strict=True) if not kind)
    for word, count in Counter(filter(_input_of, untyped)).items():
        said = f"signal {word!r} without a type is read as an input, not an output"
        cells.remarks.append(Remark(f"{said}: {count} time{'s' if count > 1 else ''}"))
    for (word, signal), rows in taken.items():
        cells.remarks.append(Remark(f"signal {word!r} read as {signal}", tuple(rows), detail=True))
    return signals


def _input_of(word: str) -> str:
    """Return the input type of a word if it may mean an input or an output, otherwise ""."""
    kinds = {SIGNALS[name].kind for name in meanings(word)}
    return next((k for k in kinds if k[1] == "I"), "") if {k[1] for k in kinds} == {*"IO"} else ""


def _signal(word: str, given: str, kind: str, count: str) -> tuple[str, list[tuple[str, str]]]:
    """Return a point's signal, given or inferred from its type, and its faults by column."""
    whole = re.fullmatch(r"([0-9]{1,4})([.,]0+)?", widened(count))
    conductors = int(whole[1]) if whole else None
    faults = []
    if count and not conductors:
        faults.append(("conductors", f"{count!r}; expected a whole number 1..9999"))
    if not word and not kind:
        # An unknown type is already recorded as a fault.
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
        faults.append(("type", f"{given!r}; expected {own.kind} for the signal {signal}"))
    if conductors and own.conductors != conductors:
        expected = f"expected {own.conductors} for the signal {signal}"
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
        return cls._of(
            parse_sheet(text, source, is_titles=score(reading), what=_WHAT), reading, strict
        )

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
        found = read_sheet(path, sheet, is_titles=score(reading), what=_WHAT)
        first = [*found.titles, *(found.rows[0][1] if found.rows else ())]
        placed = any((column := column_of(cell)) and column.name in PLACED for cell in first)
        if placed and not (reading.frames or reading.decks):
            places = read_sheets(path, is_place_titles)
            reading = reading.with_sheets(places)
            found = found.also_read([one.sheet for one in places]) if places else found
        return cls._of(found, reading, strict)

    @classmethod
    def _of(cls, sheet: Sheet, reading: Reading, strict: bool) -> Self:
        points, notes = points_of(sheet, reading, strict=strict)
        return cls(points, sheet.source, notes)

    @property
    def remarks(self) -> tuple[str, ...]:
        """Remarks on data that were not used, left out, filled in or assumed."""
        return tuple(str(note) for note in self.notes if not note.detail)

    def reading(self) -> pd.DataFrame:
        """Return the remarks on how the list was read; columns what, count, rows and doubt."""
        rows = []
        for note in self.notes:
            which = listed(note.rows, None)[1:].lstrip() if note.rows else ""
            rows.append((note.what, len(note.rows) or np.nan, which, note.doubt))
        table = pd.DataFrame(rows, columns=["what", "count", "rows", "doubt"])
        return table.astype({"count": "Int64"})

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
        said = (self.points.notna() & (self.points != "")).any()
        return self.points.loc[:, said].copy()

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
