"""Rows of text made into points, or all that is wrong with them."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from shipnet.design.iolist_titles import COLUMNS, column_of, plain
from shipnet.design.signals import KINDS, SIGNALS, find_signal
from shipnet.errors import ArgumentError, InputError
from shipnet.spreadsheet import NUMBER

if TYPE_CHECKING:
    from shipnet.spreadsheet import Sheet

__all__ = ["ASSUMED_UPDATE_MS", "RANGES", "points_of"]

#: What is assumed where a list names no update time [ms]: once a second, so that an alarm is shown
#: within the 2 s that class rules ask for. Assumed by us.
ASSUMED_UPDATE_MS = 1000.0

#: Legal values: lowest, highest and unit. No ship is 1 km long, no cable 10 km.
RANGES = {
    **dict.fromkeys(("x_m", "y_m", "z_m", "box_x_m", "box_y_m", "box_z_m"), (-1e3, 1e3, "m")),
    **dict.fromkeys(("to_box_m", "home_run_m"), (0.0, 1e4, "m")),
    "update_ms": (0.0, 3.6e6, "ms"),
}

_POSITION, _BOX = ("x_m", "y_m", "z_m"), ("box_x_m", "box_y_m", "box_z_m")

#: How far a length may fall short of the straight way: both are rounded [m].
_ROUNDED = 0.2

_KIND_WORDS = {
    "DI": ("digital input", "discrete input", "binary input"),
    "DO": ("digital output", "discrete output", "binary output"),
    "AI": ("analogue input", "analog input"),
    "AO": ("analogue output", "analog output"),
}
_KINDS = {plain(word): kind for kind in KINDS for word in (kind, *_KIND_WORDS[kind])}
_CATEGORIES = {
    plain(word): name
    for number, name in enumerate(("I", "II", "III"), start=1)
    for word in (name, str(number), f"cat {name}", f"cat {number}", f"category {name}")
}

_Cells = list[str]
_Floats = NDArray[np.float64]
_Bools = NDArray[np.bool_]


def points_of(sheet: Sheet) -> tuple[pd.DataFrame, tuple[str, ...]]:
    """Make points of the rows of a sheet.

    Parameters
    ----------
    sheet : Sheet
        Titles and rows.

    Returns
    -------
    points : pandas.DataFrame
        The columns of an I/O list, one row a point.
    remarks : tuple of str
        What was not used, and what was assumed.

    Raises
    ------
    InputError
        If the rows are no I/O list: every fault with its row, column and value, and what was
        expected.

    Examples
    --------
    >>> from shipnet.spreadsheet import parse_sheet
    >>> points, remarks = points_of(parse_sheet("tag,signal,home run\\nLS-1,limit switch,40"))
    >>> points[["type", "signal", "conductors", "home_run_m"]].values.tolist()
    [['DI', 'contact', 2, 40.0]]
    >>> remarks
    ('1 point has no update time: 1000 ms are assumed',)
    """
    return _Reader(sheet).read()


class _Reader:
    """Reads the columns of one sheet and collects their faults."""

    def __init__(self, sheet: Sheet) -> None:
        self.sheet = sheet
        self.numbers = [number for number, _ in sheet.rows]
        self.faults: list[tuple[int, int, str]] = []
        self.remarks: list[str] = []
        self.places: dict[str, list[int]] = {}
        self.scales: dict[str, float] = {}

    def read(self) -> tuple[pd.DataFrame, tuple[str, ...]]:
        """Read everything, or raise everything that is wrong."""
        self._titles()
        self._shape()
        texts = {name: self._text(name) for name in ("tag", "system", "box")}
        self._tags(texts["tag"])
        kinds = self._look_up("type", _KINDS, "DI, DO, AI or AO")
        signals = self._signals(kinds)
        comma = self._decimal_comma()
        numbers = {name: self._numbers(name, comma) for name in RANGES}
        given = {name: self._given(name) for name in RANGES}
        self._positions(given)
        self._boxes(texts["box"], numbers, given)
        update, missing = numbers["update_ms"], ~given["update_ms"]
        categories = self._look_up("category", _CATEGORIES, "I, II, III or nothing")
        notes = self._notes()
        if self.faults:
            raise InputError(self.sheet.source, *(text for _, _, text in sorted(self.faults)))
        if missing.any():
            count = int(missing.sum())
            self.remarks.append(
                f"{count} point{'s have' if count > 1 else ' has'} no update time: "
                f"{ASSUMED_UPDATE_MS:g} ms are assumed"
            )
            update[missing] = ASSUMED_UPDATE_MS
        columns: dict[str, object] = {
            **texts,
            "type": [SIGNALS[name].kind for name in signals],
            "signal": signals,
            "conductors": np.array([SIGNALS[name].conductors for name in signals], dtype=np.int64),
            **numbers,
            "category": categories,
            "note": notes,
        }
        return pd.DataFrame({name: columns[name] for name in COLUMNS}), tuple(self.remarks)

    # What the sheet holds.

    def _fault(self, row: int, name: str, text: str) -> None:
        """Keep a fault of a row; they are told in the order of rows and columns."""
        place = self.places.get(name, [0])[0]
        self.faults.append((row, place, f"row {self.numbers[row]}{text}"))

    def _wrong(self, rows: Iterable[int], name: str, cells: _Cells, expected: str) -> None:
        for row in rows:
            what = next(
                (self.sheet.odd[key] for place in self.places[name]
                 if (key := (self.numbers[row], place)) in self.sheet.odd), "",
            )  # fmt: skip
            cell = f"{cells[row]!r}{f' is {what}' if what else ''}"
            self._fault(row, name, f", column {self._title(name)}: {cell}; expected {expected}")

    def _title(self, name: str) -> str:
        places = self.places.get(name)
        return self.sheet.titles[places[0]] if places else name

    def _titles(self) -> None:
        faults, unused = [], []
        for place, title in enumerate(self.sheet.titles):
            column = column_of(title)
            if column is not None:
                self.places.setdefault(column.name, []).append(place)
                self.scales[column.name] = column.scale
            elif title:
                unused.append(title)
        for name, places in self.places.items():
            if len(places) > 1 and name != "note":
                titles = " and ".join(repr(self.sheet.titles[place]) for place in places)
                faults.append(f"row {self.sheet.top}: {titles} all mean {name}; expected one")
        for group in (_POSITION, _BOX):
            missing = [name for name in group if name not in self.places]
            if 0 < len(missing) < 3:
                faults.append(
                    f"row {self.sheet.top}: no column {' and no column '.join(missing)}; expected "
                    f"{', '.join(group)}, all or none"
                )
        if "tag" not in self.places:
            faults.append(f"row {self.sheet.top}: no column tag")
        if "signal" not in self.places and "type" not in self.places:
            faults.append(f"row {self.sheet.top}: no column signal and no column type")
        if not {*_POSITION, "home_run_m"} & self.places.keys():
            faults.append(
                f"row {self.sheet.top}: the points have no position and no length; expected "
                f"columns {', '.join(_POSITION)}, or home_run_m"
            )
        if faults or not self.sheet.rows:
            faults = faults or ["has no points; expected one a row"]
            if unused:
                faults.append(f"not used: {', '.join(map(repr, unused))}")
            raise InputError(self.sheet.source, *faults)
        if unused:
            s = "s" if len(unused) > 1 else ""
            self.remarks.append(f"column{s} not used: {', '.join(unused)}")

    def _shape(self) -> None:
        width = len(self.sheet.titles)
        for row, (number, cells) in enumerate(self.sheet.rows):
            if len(cells) > width and any(cells[width:]):
                text = f"row {number} has {len(cells)} cells; expected {width}"
                self.faults.append((row, -1, text))

    def _cells(self, name: str, place: int | None = None) -> _Cells:
        if place is None:
            if name not in self.places:
                return [""] * len(self.numbers)
            place = self.places[name][0]
        return [cells[place] if place < len(cells) else "" for _, cells in self.sheet.rows]

    def _odd(self, name: str) -> set[int]:
        """Return the rows whose cell is a date, an error or the like."""
        if not self.sheet.odd:
            return set()
        places = set(self.places.get(name, ()))
        bad = {number for number, place in self.sheet.odd if place in places}
        return {row for row, number in enumerate(self.numbers) if number in bad}

    # Text.

    def _text(self, name: str) -> _Cells:
        cells = [_clean(cell) for cell in self._cells(name)]
        odd = self._odd(name)
        bad = [row for row, cell in enumerate(cells) if not cell.isprintable() or row in odd]
        self._wrong(bad, name, cells, "printable text")
        return cells

    def _notes(self) -> _Cells:
        columns = [self._cells("note", place) for place in self.places.get("note", [])]
        notes = ["; ".join(filter(None, map(_clean, cells))) for cells in zip(*columns)]  # noqa: B905
        if not notes:
            return [""] * len(self.numbers)
        return [note if note.isprintable() else _printable(note) for note in notes]

    def _tags(self, tags: _Cells) -> None:
        first: dict[str, int] = {}
        for row, tag in enumerate(tags):
            if not tag:
                self._fault(row, "tag", f", column {self._title('tag')}: is empty; expected a tag")
                continue
            before = first.setdefault(tag.casefold(), row)
            if before != row:
                self._fault(
                    row, "tag",
                    f", column {self._title('tag')}: {tag!r} stands in row "
                    f"{self.numbers[before]} already; expected a tag of its own",
                )  # fmt: skip

    def _look_up(self, name: str, known: dict[str, str], expected: str) -> _Cells:
        cells = self._cells(name)
        found = {cell: known.get(plain(cell), "") for cell in set(cells)}
        unknown = {cell for cell, value in found.items() if not value and cell}
        if unknown:
            rows = [row for row, cell in enumerate(cells) if cell in unknown]
            self._wrong(rows, name, cells, expected)
        return [found[cell] for cell in cells]

    def _signals(self, kinds: _Cells) -> _Cells:
        """Return the signal of each point, that of its type where the list names none."""
        words, types = [_clean(cell) for cell in self._cells("signal")], self._cells("type")
        odd = self._odd("signal") | self._odd("conductors")
        counts = self._cells("conductors")
        known: dict[tuple[str, str, str, str], tuple[str, list[tuple[str, str]]]] = {}
        signals = []
        for row, point in enumerate(zip(words, types, kinds, counts, strict=True)):
            if point not in known:
                known[point] = self._signal(*point)
            signal, faults = known[point]
            for column, text in faults:
                self._fault(row, column, f", column {self._title(column)}: {text}")
            signals.append(signal)
        for name in ("signal", "conductors"):
            rows = sorted(odd & self._odd(name))
            self._wrong(rows, name, self._cells(name), "text" if name == "signal" else "a number")
        return signals

    def _signal(
        self, word: str, given: str, kind: str, count: str
    ) -> tuple[str, list[tuple[str, str]]]:
        """Return the signal of a point, and what is wrong by column."""
        whole = re.fullmatch(r"([0-9]{1,4})([.,]0+)?", count)
        conductors = int(whole[1]) if whole else None
        faults = []
        if count and not conductors:
            faults.append(("conductors", f"{count!r}; expected a whole number 1..9999"))
        if not word and not kind:
            # That the type is wrong has been said; without one, there is nothing to go by.
            if not given:
                legal = ", ".join(SIGNALS)
                faults.append(("signal", f"is empty; expected one of {legal}"))
            return "contact", faults
        try:
            signal = find_signal(word or kind, kind, conductors)
        except ArgumentError as error:
            column = "signal" if word or "signal" in self.places else "type"
            return "contact", [*faults, (column, str(error))]
        own = SIGNALS[signal]
        if kind and own.kind != kind:
            faults.append(("type", f"{given!r}; expected {own.kind}, as the signal is {signal}"))
        if conductors and own.conductors != conductors:
            text = f"{count!r}; expected {own.conductors}, as the signal is {signal}"
            faults.append(("conductors", text))
        return signal, faults

    # Numbers.

    def _given(self, name: str) -> _Bools:
        return np.array([cell != "" for cell in self._cells(name)], dtype=bool)

    def _decimal_comma(self) -> bool:
        """Say whether the file writes its numbers with a decimal comma."""
        return self.sheet.separator in (";", "\t") and any(
            "," in cell for name in RANGES if name in self.places for cell in self._cells(name)
        )

    def _numbers(self, name: str, comma: bool) -> _Floats:
        low, high, unit = RANGES[name]
        cells = self._cells(name)
        values = np.full(len(cells), np.nan)
        if name not in self.places:
            return values
        match: Callable[[str], object] = NUMBER.fullmatch
        odd = self._odd(name)
        rows = []
        for row, cell in enumerate(cells):
            if cell:
                text = cell.replace(",", ".") if comma and "." not in cell else cell
                if match(text) and row not in odd and not (comma and "." in cell):
                    values[row] = float(text)
                else:
                    rows.append(row)
        scale = self.scales[name]
        values *= scale
        outside = (values < low) | (values > high) | (np.isinf(values))
        if name == "update_ms":
            outside |= values == 0
        rows += np.flatnonzero(outside).tolist()
        legal = f"a number {low / scale:g}..{high / scale:g}"
        if name == "update_ms":
            legal = f"a number above 0, up to {high / scale:g}"
        point = " with a decimal comma" if comma else ""
        shown = next((u for u, s in {"m": 1, "mm": 1e-3, "cm": 1e-2}.items() if s == scale), unit)
        shown = {"ms": {1.0: "ms", 1e3: "s"}}.get(unit, {}).get(scale, shown)
        self._wrong(rows, name, cells, f"{legal} {shown}{point}")
        return values

    def _positions(self, given: dict[str, _Bools]) -> None:
        have = np.column_stack([given[name] for name in _POSITION])
        for row in np.flatnonzero(have.any(axis=1) & ~have.all(axis=1)).tolist():
            self._partly(row, _POSITION, have[row])
        for row in np.flatnonzero(~have.any(axis=1) & ~given["home_run_m"]).tolist():
            self._fault(
                row, "home_run_m",
                f": has neither a position nor a length; expected {', '.join(_POSITION)}, or "
                "home_run_m",
            )  # fmt: skip

    def _partly(self, row: int, names: Sequence[str], have: _Bools) -> None:
        empty = [self._title(name) for name, one in zip(names, have, strict=True) if not one]
        text = f"is empty; expected {', '.join(map(self._title, names))}, all or none"
        self._fault(row, names[0], f", column {' and '.join(empty)}: {text}")

    def _boxes(
        self, boxes: _Cells, numbers: dict[str, _Floats], given: dict[str, _Bools]
    ) -> None:
        """Check the boxes, and give all points of a box the position that one of them names."""
        have = np.column_stack([given[name] for name in _BOX])
        named = np.array([box != "" for box in boxes], dtype=bool)
        for row in np.flatnonzero(have.any(axis=1) & ~have.all(axis=1)).tolist():
            self._partly(row, _BOX, have[row])
        for row in np.flatnonzero((have.any(axis=1) | given["to_box_m"]) & ~named).tolist():
            text = "is empty; expected a name, as a length to the box or its position is given"
            self._fault(row, "box", f", column {self._title('box')}: {text}")
        places = np.column_stack([numbers[name] for name in _BOX])
        whole = named & np.isfinite(places).all(axis=1)
        first: dict[str, int] = {}
        for row in np.flatnonzero(whole).tolist():
            before = first.setdefault(boxes[row], row)
            if before != row and (places[row] != places[before]).any():
                where = ", ".join(f"{value:g}" for value in places[before])
                self._fault(
                    row, "box",
                    f", column {self._title('box')}: {boxes[row]!r} stands elsewhere than in row "
                    f"{self.numbers[before]}; expected it at {where} m",
                )  # fmt: skip
        for row in np.flatnonzero(named & ~have.any(axis=1)).tolist():
            if boxes[row] in first:
                for name in _BOX:
                    numbers[name][row] = numbers[name][first[boxes[row]]]
        own = np.column_stack([numbers[name] for name in _POSITION])
        box = np.column_stack([numbers[name] for name in _BOX])
        straight = np.sqrt(((own - box) ** 2).sum(axis=1))
        for row in np.flatnonzero(numbers["to_box_m"] < straight - _ROUNDED).tolist():
            cell = self._cells("to_box_m")[row]
            text = f"{cell!r}; expected more than the straight way of {straight[row]:.1f} m"
            self._fault(row, "to_box_m", f", column {self._title('to_box_m')}: {text}")


def _clean(cell: str) -> str:
    """Return text on one line, without the apostrophe that kept it from being a formula."""
    if not cell:
        return cell
    text = cell if cell.isalnum() else " ".join(cell.split())
    return text[1:] if re.match(r"'+[=+\-@]", text) else text


def _printable(text: str) -> str:
    return "".join(letter for letter in text if letter.isprintable())
