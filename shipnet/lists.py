"""Lists as people write them: titles with units, group rows, ditto marks, void rows and numbers.

I/O lists, lists of CAN messages and AS-i plans are read by the same rules, each with its own words.
What is left out, filled in or converted becomes a remark, and what is not understood a fault.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import chain, pairwise, zip_longest
from typing import Any, ClassVar, NamedTuple

import numpy as np

from shipnet.arrays import Bools, Floats
from shipnet.errors import InputError
from shipnet.signals import plain
from shipnet.tables import MOST_CELLS, Remark, Sheet

# Units ------------------------------------------------------------------------------------------

#: Units that convert into each other, each with its power of ten.
UNITS: Sequence[Mapping[str, int]] = (
    {"m": 0, "mm": -3, "cm": -2, "meter": 0, "metre": 0, "meters": 0, "metres": 0},
    {"s": 0, "ms": -3, "us": -6, "\u03bcs": -6, "sec": 0, "msec": -3},
    {"a": 0, "ma": -3},
    {"v": 0, "mv": -3},
    {"ohm": 0, "ohms": 0, "kohm": 3, "\u03c9": 0, "k\u03c9": 3},
    {"h": 0, "mh": -3, "uh": -6, "\u03bch": -6},
    {"byte": 0, "bytes": 0},
    {"bit": 0, "bits": 0},
    {"dec": 0, "hex": 0},
    {"bar": 0, "mbar": -3, "pa": -5, "hpa": -3, "kpa": -2, "mpa": 1},
    {"degc": 0, "\u00b0c": 0, "\u00bac": 0, "\u2103": 0},
    {"%": 0, "percent": 0},
    {"%/s": 0, "percent per s": 0},
    {"": 0},  # of quantities whose unit is not converted
)

#: The units that a unit converts into, the unit itself included.
ALIKE: Mapping[str, Mapping[str, int]] = {unit: units for units in UNITS for unit in units}

#: Units that a title may name, but that are not read.
_OTHER = frozenset(
    "km dm ft foot feet in inch inches yd yard yards ns min mins minute minutes hr hrs hour "
    "hours d day days hz khz mhz".split()
)


def spelled(unit: str) -> str:
    """Return a unit as engineers write it."""
    units = {"ma": "mA", "a": "A", "mv": "mV", "v": "V", "h": "H", "mh": "mH", "uh": "uH"}
    units |= {"pa": "Pa", "hpa": "hPa", "kpa": "kPa", "mpa": "MPa", "degc": "degC"}
    return units.get(unit, unit)


def _legal(usual: str) -> str:
    """Return the units that convert into the usual unit of a column, each power of ten once."""
    units: dict[int, str] = {}
    for unit, power in ALIKE[usual].items():
        units.setdefault(power, spelled(unit))
    return ", ".join(units.values())


# Titles -----------------------------------------------------------------------------------------

#: Longest text that may be a title [characters].
_LONGEST = 200


class Column(NamedTuple):
    """The meaning of a title: the column, and the unit that the title states, otherwise ""."""

    name: str
    unit: str = ""


@dataclass(frozen=True, eq=False)
class Words:
    """The titles of a kind of list.

    `titles` maps each spelling, as `plain` returns it, to a column; `units` contains the unit of
    each quantity, which its title may state.
    """

    titles: Mapping[str, str]
    units: Mapping[str, str]

    @lru_cache(4096)  # noqa: B019 # one object per kind of list, and per log
    def column_of(self, title: str, assigned: tuple[tuple[str, str], ...] = ()) -> Column | None:
        """Return the column that a title, which may be in two languages, names, or None.

        `assigned` has further pairs of a spelling and its column.
        """
        if len(title) > _LONGEST:
            return None
        column_for = {plain(word): column for word, column in assigned}
        bare, unit = _without_unit(title)
        for text in (title, bare):
            if (word := column_for.get(plain(text))) and (named := self._column(word)):
                usual = self.units.get(named.name, "")
                ends = [last for last in _words(bare)[-1:] if last in ALIKE.get(usual, ())]
                return Column(named.name, unit or "".join(ends) or named.unit)
        if column := self._column(title):
            return column
        # A unit in brackets may be anywhere; a second language may come before or after the first.
        mark = f" {unit}" if unit else ""
        ascii_letters = "".join(c if c.isascii() else " " for c in bare)
        others = "".join(" " if c.isascii() else c for c in bare)
        for split in ((bare,), (ascii_letters, others), re.split(r"[/|()\[\]]", bare)):
            parts = [part for part in split if plain(part)]
            each = [self._column(part + mark) for part in parts]
            # A part of a title may be unknown only if it has a letter outside ASCII.
            foreign = all(one or not part.isascii() for part, one in zip(parts, each, strict=True))
            columns = {one for one in each if one is not None}
            if {one.name for one in columns} == {"type", "signal"}:
                columns = {Column("type")}  # a column of types may contain signals
            if len(columns) == 1 and foreign and (parts[1:] or mark):
                return columns.pop()
        return None

    def _column(self, title: str) -> Column | None:
        name = self.titles.get(plain(title))
        if name is not None:
            return Column(name)
        *words, last = _words(title) or [""]
        words = words[: len(words) - (words[-1:] == ["in"])]
        name = self.titles.get("".join(words)) if last in ALIKE or last in _OTHER else None
        return Column(name, last) if name is not None and name in self.units else None


def _words(title: str) -> list[str]:
    return re.findall(r"[^\W_]+", title.casefold())


def _without_unit(title: str) -> tuple[str, str]:
    """Return a title without the units in brackets, and these units."""
    units = []
    for bracket, content in re.findall(r"([\[(]([^\[\]()]*)[\])])", title):
        unit = content.casefold().strip(" .").removeprefix("in ").strip()
        square = bracket[0] == "[" and re.fullmatch(r"[a-z/%\"']{1,4}", unit)
        if unit in ALIKE or unit in _OTHER or square:
            units.append(unit)
            title = title.replace(bracket, " ")
    return title, " ".join(dict.fromkeys(units))


def united(
    upper: Sequence[str],
    lower: Sequence[str],
    column_of: Callable[[str], Column | None],
    *,
    certain: bool = False,
) -> list[str] | None:
    """Return the titles in two rows, or None if the lower row may not be one, unless `certain`.

    A title in the upper row may span several columns of the lower row.
    """
    titles, spanning, understood = [], "", 0
    for title, cell in zip_longest(upper, lower, fillvalue=""):
        spanning = (title or spanning) if plain(cell) else ""
        if not plain(cell):
            titles.append(title)
            continue
        both = (f"{spanning} {cell}".strip(), cell)
        recognised = next((text for text in both if column_of(text)), None)
        if recognised is None and not certain and (cell.isascii() or not title):
            return None
        understood += recognised is not None
        titles.append(recognised or (both[0] if certain else title))
    return titles if understood else None


# Numbers ----------------------------------------------------------------------------------------

#: Replacements for East Asian wide characters, the minus sign and non-breaking spaces.
_WIDE = {0xFF01 + k: 0x21 + k for k in range(94)} | {0x3000: 32, 0x2212: 45, 0xA0: 32, 0x202F: 32}

_CELL = re.compile(
    r"([+-]?(?:[0-9][0-9., ']*|[.,][0-9]+))(?<! )(e[+-]?[0-9]{1,3})? ?([^\W\d_]*)\.?", re.IGNORECASE
)
_GROUPS = {
    mark: re.compile(rf"[+-]?[1-9][0-9]{{0,2}}(?:{re.escape(mark)}[0-9]{{3}})+") for mark in ",. '"
}


def widened(cell: str) -> str:
    """Return a cell with wide characters replaced by plain ones."""
    return cell if cell.isascii() else cell.translate(_WIDE).strip()


def decimal_mark(cells: Iterable[str]) -> str:
    """Return a list's decimal mark: a point, a comma, or "" if its numbers show neither or both."""
    marks = set()
    for cell in set(cells):
        match = _CELL.fullmatch(widened(cell))
        digits = match[1] if match else ""
        last = max(".,", key=digits.rfind)
        if digits.count(last) == 1 and not _GROUPS[last].fullmatch(digits):
            marks.add(last)
    return marks.pop() if len(marks) == 1 else ""


def read_number(cell: str, mark: str, unit: str, target: str) -> float | None:
    """Return a cell's number in the unit `target`, or None if it is illegible or ambiguous.

    `unit` is that of the title; a unit in the cell overrides it. With the decimal mark "", a number
    such as 1.234 or 1,234 is ambiguous.
    """
    match = _CELL.fullmatch(widened(cell))
    units = ALIKE[target]
    if match is None or (match[3] and match[3].casefold() not in units):
        return None
    digits, exponent, cell_unit = match.groups("")
    for blank in " '":
        digits = digits.replace(blank, "") if _GROUPS[blank].match(digits) else digits
    last = max(".,", key=digits.rfind)
    other = "." if last == "," else ","
    if other in digits:
        head, _, tail = digits.partition(last)
        if not _GROUPS[other].fullmatch(head) or last in tail:
            return None
        digits = f"{head.replace(other, '')}.{tail}"
    elif _GROUPS[last].fullmatch(digits) and (digits.count(last) > 1 or mark != last):
        if digits.count(last) == 1 and not mark:
            return None
        digits = digits.replace(last, "")
    power = int(exponent[1:] or 0) + units[cell_unit.casefold() or unit] - units[target]
    try:
        return float(f"{digits.replace(',', '.')}e{power}")
    except ValueError:
        return None


# Rows -------------------------------------------------------------------------------------------

#: Marks of entries that will not be built, and of spare ones.
_MARK = r"\W*(?:deleted?|cancell?ed|void|not used|spare|삭제|예비|entf\xe4llt|utg\xe5r)"
_MARKED = re.compile(rf"{_MARK}\W*", re.IGNORECASE)
_MARKED_KEY = re.compile(rf"{_MARK}\b.*", re.IGNORECASE)

#: A note that says so: such words alone, or with where or why; and a note that mentions one.
_GONE = (
    r"(?:deleted|cancell?ed|not (?:fitted|installed|used|required)|removed|gestrichen|entfallen|"
    r"entf\xe4llt|nicht eingebaut|utg\xe5r|slettet|ikke montert|삭제|취소|미설치)"
)
_GONE_NOTE = re.compile(
    rf"\W*{_GONE}(?:[\W_]+{_GONE})*\W*(?:\b(?:in|per|by|see|rev|at|acc|according)\b.*)?",
    re.IGNORECASE | re.DOTALL,
)
_GONE_WORD = re.compile(rf"\b{_GONE}\b", re.IGNORECASE)

#: Marks for "as above", without blanks and dashes.
_DITTO = frozenset(
    "\" '' \u3003 \u2033 \u201d \u201c \u201e ,, ditto dito dto. dto do. idem id. asabove wieoben "
    "s.o. somover \u540c\u4e0a 상동 위와같음".split()
)


def is_ditto(cell: str) -> bool:
    """Return whether a cell says that it repeats the cell above."""
    return len(cell) < 12 and "".join(cell.split()).casefold().strip("-\u2013\u2014") in _DITTO


#: Reasons to leave out a row that is clearly not an entry.
_REPEATED, _TEXT = "repeated titles", "a subtitle, page header, page footer or note"


class Cells:
    """The columns of a list (one cell per entry), and the remarks and faults found in it.

    A kind of list is a subclass, which states its words, the noun for its entries and the column
    that names an entry. In a list that the package saved (`is_saved`), no cell is filled in.
    """

    words: ClassVar[Words]
    noun: ClassVar[str]
    key: ClassVar[str]
    titled_by: ClassVar[frozenset[str]]  #: A row with two titles, one of these, is a row of titles.
    literal: ClassVar[tuple[str, ...]] = ()  #: Columns in which ``do.`` is not a ditto mark.
    grouped: ClassVar[tuple[str, ...]] = ()  #: Columns that may be given once per group.
    needs_unit: ClassVar[frozenset[str]] = frozenset()  #: Quantities without a usual unit.
    hint: ClassVar[str] = "rename them, or leave them out"  #: What to do about unknown titles.
    missing: ClassVar[frozenset[str]] = frozenset()  #: Cells that mark a missing value.
    has_spares: ClassVar[bool] = False  #: Whether rows marked spare or named by a dash are void.

    def __init__(
        self, sheet: Sheet, assigned: tuple[tuple[str, str], ...] = (), *, is_saved: bool = False
    ) -> None:
        self.sheet, self.assigned = sheet, assigned
        self.source = f"{sheet.source}, sheet {sheet.sheet}" if sheet.sheet else sheet.source
        self.remarks = list(sheet.remarks)
        self.places: dict[str, list[int]] = {}
        self.units: dict[str, str] = {}
        self.unused: list[str] = []
        self.faulty: set[int] = set()  #: The indices of the entries that have a fault.
        self._faults: list[tuple[int, int, str]] = []
        self._typed = set(sheet.typed)
        rows = self._read_titles()
        self._find_columns(rows)
        rows, alone = self._entries(rows, is_saved)
        if not rows:
            raise InputError(self.source, f"has no {self.noun}s; expected one per row")
        self.rows = [number for number, _ in rows]
        self._columns = [list(column) for column in zip(*(cells for _, cells in rows), strict=True)]
        width = len(self.titles)
        beside = [row for row, (_, cells) in enumerate(rows) if any(cells[width:])]
        if sheet.separator:
            # Either the row is shifted, or an unquoted cell contains the separator.
            for row in beside:
                last = max(index for index, cell in enumerate(rows[row][1]) if cell)
                self.fault(row, "", f" has {last + 1} cells; expected {width}")
        elif beside:
            numbers = tuple(self.rows[row] for row in beside)
            self.remarks.append(Remark("not used: cells beside the table", numbers))
        row_of = {number: row for row, number in enumerate(self.rows)}
        for number, name in alone:
            self.wrong([row_of[number]], name, "a value; a ditto mark here has none above it")
        for name in self.words.units if self.missing else ():
            cells = self[name]
            marked = [row for row, cell in enumerate(cells) if cell.casefold() in self.missing]
            if marked:
                places = tuple(self.rows[row] for row in marked)
                self.remarks.append(Remark(f"{self.title(name)}: marked as missing", places))
            for row in marked:
                cells[row] = ""
        # In a workbook, only cells of text show the decimal mark.
        quantities = [
            zip(self[name], self.typed(name), strict=True)
            for name in self.places.keys() & self.words.units.keys()
        ]
        self._mark = decimal_mark({cell for cell, text in chain(*quantities) if text})
        if self._mark == ",":
            self.remarks.append(Remark("numbers have a decimal comma", detail=True))

    # What a kind of list decides.

    @classmethod
    def score(cls, assigned: tuple[tuple[str, str], ...] = ()) -> Callable[[Sequence[str]], float]:
        """Return a function that scores how well the cells of a row serve as titles."""

        def worth(cells: Sequence[str]) -> float:
            names = {
                column.name for cell in cells if (column := cls.words.column_of(cell, assigned))
            }
            return len(names) if len(names) > 1 and not names.isdisjoint(cls.titled_by) else 0

        return worth

    def column_faults(self) -> list[str]:
        """Return what is wrong with the columns of the list."""
        return []

    def is_entry(self, cell: Callable[[str], str]) -> bool:
        """Return whether the cells of a row, by column, describe an entry."""
        raise NotImplementedError

    def arrange(self, rows: Sequence[tuple[int, list[str]]]) -> None:
        """Change the meaning of columns if the rows require it."""

    # Titles and rows.

    def column_of(self, title: str) -> Column | None:
        """Return the column that a title names, or None."""
        return self.words.column_of(title, self.assigned)

    def _read_titles(self) -> list[tuple[int, list[str]]]:
        """Find the titles, which may be in two rows; return the rows below them."""
        rows, above = list(self.sheet.rows), list(self.sheet.above)
        self.titles, numbers = list(self.sheet.titles), [self.sheet.top]
        heads, score = [self.titles], self.score(self.assigned)
        if above and (both := united(above[-1][1], self.titles, self.column_of, certain=True)):
            if score(both) > score(self.titles):
                number, upper = above.pop()
                numbers.insert(0, number)
                heads.append(upper)
                self.titles = both
        if rows and (both := united(self.titles, rows[0][1], self.column_of)):
            number, lower = rows.pop(0)
            numbers.append(number)
            heads.append(lower)
            self.titles = both
        self._heads = [set(filter(None, titles)) for titles in heads]
        if len(numbers) > 1:
            statement = f"titles in {'two' if len(numbers) == 2 else 'three'} rows"
            self.remarks.append(Remark(statement, tuple(numbers), detail=True))
        if above:
            numbers = [number for number, _ in above]
            self.remarks.append(Remark("left out, above the titles", tuple(numbers), detail=True))
        return rows

    def _find_columns(self, rows: Sequence[tuple[int, list[str]]]) -> None:
        faults, converted = [], []
        for index, title in enumerate(self.titles):
            column = self.column_of(title)
            if column is not None:
                self.places.setdefault(column.name, []).append(index)
                usual = self.words.units.get(column.name, "")
                if usual and column.unit and column.unit not in ALIKE[usual]:
                    statement = f"title {title!r} has the unit {column.unit!r}"
                    faults.append(f"{statement}; expected {_legal(usual)}")
                elif usual:
                    self.units.setdefault(column.name, column.unit)
                    if column.unit and ALIKE[usual][column.unit] != ALIKE[usual][usual]:
                        converted.append(f"{title} from {spelled(column.unit)} to {spelled(usual)}")
            elif title:
                self.unused.append(title)
            elif any(row[index] for _, row in rows if index < len(row)):
                self.unused.append(f"column {letter(index)}, which has no title")
        self.arrange(rows)
        faults += [
            f"{' and '.join(repr(self.titles[index]) for index in places)} both mean {name}"
            for name, places in self.places.items()
            if len(places) > 1 and name != "note"
        ]
        faults += self.column_faults()
        used = "; ".join(self.unused)
        if faults:
            faults = [f"row {self.sheet.top}: {fault}" for fault in faults]
            hint = f"unknown titles: {used}; {self.hint}"
            raise InputError(self.source, *faults, *([hint] if used else []))
        if used:
            self.remarks.append(Remark(f"not used: {used}"))
        if converted:
            self.remarks.append(Remark(f"converted: {'; '.join(converted)}", detail=True))

    def _entries(
        self, rows: list[tuple[int, list[str]]], is_saved: bool
    ) -> tuple[list[tuple[int, list[str]]], list[tuple[int, str]]]:
        """Return the rows that are entries, and the cells whose ditto mark repeats nothing.

        Remarks are added on rows left out, hidden or struck out, and on cells filled in.
        """
        width = max([len(self.titles), *(len(cells) for _, cells in rows)])
        if len(rows) * width > MOST_CELLS:
            area = f"{len(rows)} rows and {width} columns"
            raise InputError(self.source, f"spans {area}; at most {MOST_CELLS} cells are read")
        for _, cells in rows:
            cells += [""] * (width - len(cells))
        # Few rows contain a mark such as `void`; each distinct cell is compared once.
        words = set(chain.from_iterable(cells for _, cells in rows))
        self._marked = set(filter(_MARKED.fullmatch, words)) if self.has_spares else set()
        self._gone = set(filter(_GONE_NOTE.fullmatch, words))
        self._dittos = set() if is_saved else set(filter(is_ditto, words))
        struck = {number for number, _ in self.sheet.struck}
        listed, left = list[tuple[int, list[str], str]](), dict[str, list[int]]()
        for number, cells in rows:
            why = self._no_entry(number, cells, number in struck)
            if why:
                left.setdefault(why, []).append(number)
            if why not in (_TEXT, _REPEATED):
                listed.append((number, cells, why))
        for why, numbers in left.items():
            article = "an" if self.noun[0] in "aeiou" else "a"
            shown = f"not {article} {self.noun}: {_TEXT}" if why == _TEXT else why
            doubt = why not in (_REPEATED, _TEXT)
            self.remarks.append(Remark(f"left out, {shown}", tuple(numbers), doubt=doubt))
        alone = self._fill_dittos(listed)
        for name in () if is_saved else self.grouped:
            self._fill_down(name, listed)
        entries = [(number, cells) for number, cells, why in listed if not why]
        notes = self.places.get("note", ())
        gone = {
            number
            for number, cells in entries
            if any(_GONE_WORD.search(cells[index]) for index in notes)
        }
        for statement, rows_of in (
            ("hidden, but read", self.sheet.hidden),
            ("read, although a cell is struck out", struck),
            ("read, although a note says that something is deleted or not fitted", gone),
            ("filled from merged cells", self.sheet.merged),
        ):
            if both := tuple(number for number, _ in entries if number in rows_of):
                doubt = rows_of is not self.sheet.merged
                self.remarks.append(Remark(statement, both, doubt=doubt, detail=not doubt))
        return entries, alone

    def _no_entry(self, number: int, cells: list[str], is_struck: bool) -> str:
        """Return why a row is not an entry, or "" if it is one."""

        def cell(name: str) -> str:
            return cells[self.places[name][0]] if name in self.places else ""

        for head in self._heads:
            if not head.isdisjoint(cells):
                same = sum(" ".join(one.split()) in head for one in cells if one)
                if same > 1 and 2 * same >= sum(map(bool, cells)):
                    return _REPEATED
        key, key_place = clean(cell(self.key)), self.places.get(self.key, [-1])[0]
        if is_struck:
            first = next((index for index, one in enumerate(cells) if one), 0)
            if not self.sheet.struck.isdisjoint({(number, key_place), (number, first)}):
                return "struck out"
        is_marked = not self._marked.isdisjoint(cells)
        if is_marked or (self.has_spares and _MARKED_KEY.fullmatch(key)):
            return "marked as deleted or spare"
        if any(cells[index] in self._gone for index in self.places.get("note", ())):
            return "deleted or not fitted, as a note says"
        is_odd = (number, key_place) in self.sheet.odd
        if self.has_spares and key and not (plain(key) or is_odd or is_ditto(key)):
            return f"with a dash as {self.key}"
        ditto = not self._dittos.isdisjoint(cells) and any(
            cell(name) in self._dittos for name in self.places if name != self.key
        )
        if ditto or self.is_entry(cell):
            return ""
        # A row with only a name may be an entry whose other cells were forgotten.
        return "" if re.search(r"[0-9]", key) and not re.search(r"\s", key) else _TEXT

    def _fill_dittos(self, rows: Iterable[tuple[int, list[str], str]]) -> list[tuple[int, str]]:
        """Replace ditto marks by the cell of the row above; return those with none above."""
        filled, alone = dict[int, list[int]](), list[tuple[int, str]]()
        last, above = 0, list[str]()
        for number, cells, why in rows:
            places = () if self._dittos.isdisjoint(cells) else self.places.items()
            for name, column in ((name, column) for name, several in places for column in several):
                is_word = name == self.key or (
                    name in self.literal and plain(cells[column]) == "do"
                )
                if cells[column] not in self._dittos or is_word:
                    continue
                cells[column] = above[column] if above else ""
                if (last, column) in self._typed:
                    self._typed.add((number, column))
                if not why and cells[column]:
                    filled.setdefault(column, []).append(number)
                elif not why and name != "note":
                    alone.append((number, name))
            last, above = number, cells
        for column, numbers in filled.items():
            statement = f"{self.titles[column]}: ditto marks filled from the row above"
            self.remarks.append(Remark(statement, tuple(numbers)))
        return alone

    def _fill_down(self, name: str, rows: Sequence[tuple[int, list[str], str]]) -> None:
        """Fill a column that has values only in the first row of each group."""
        if name not in self.places or not rows:
            return
        column = self.places[name][0]
        kept = [cells[column] for _, cells, why in rows if not why]
        twice = any(a and a == b for a, b in pairwise(kept))
        if not any(kept) or all(kept) or not rows[0][1][column] or twice:
            return
        filled = tuple(number for number, cells, why in rows if not cells[column] and not why)
        for (_, above, _), (_, cells, _) in pairwise(rows):
            cells[column] = cells[column] or above[column]
        statement = f"{name} filled down from the row above, because it is given once per group"
        self.remarks.append(Remark(statement, filled, doubt=True))

    # Columns, remarks and faults.

    def __getitem__(self, name: str) -> list[str]:
        """Return the cells of a column, all empty if the list has no such column."""
        places = self.places.get(name)
        return self.column(places[0]) if places else [""] * len(self.rows)

    def column(self, number: int) -> list[str]:
        """Return the cells of a column by its index."""
        return self._columns[number]

    def given(self, name: str) -> Bools:
        """Return a mask of the filled cells of a column."""
        return np.fromiter(map(bool, self[name]), bool, len(self.rows))

    def title(self, name: str) -> str:
        """Return the title of a column in the list, with the column's letter in a spreadsheet."""
        places = self.places.get(name)
        if not places:
            return name
        at = f" ({letter(places[0])})" if self.sheet.top > 0 else ""
        return f"{self.titles[places[0]]}{at}"

    def fault(self, row: int, name: str, text: str) -> None:
        """Record a fault in a row."""
        column = self.places[name][0] if name in self.places else -1
        self._faults.append((row, column, f"row {self.rows[row]}{text}"))
        self.faulty.add(row)

    def wrong(self, rows: Iterable[int], name: str, expected: str) -> None:
        """Record the same fault for the cells of a column in the given rows."""
        cells = self[name]
        for row in rows:
            what = self.odd(row, name)
            cell = f"{cells[row]!r}{what and f', {what}'}" if cells[row] else "is empty"
            self.fault(row, name, f", column {self.title(name)}: {cell}; expected {expected}")

    def doubt(self, what: str, rows: Bools) -> None:
        """Add a remark on doubtful entries."""
        if rows.any():
            numbers = tuple(self.rows[row] for row in np.flatnonzero(rows).tolist())
            self.remarks.append(Remark(what, numbers, doubt=True))

    def odd(self, row: int, name: str) -> str:
        """Return a description of a cell if it is neither text nor a number, otherwise ""."""
        places = self.places.get(name, [-1])
        return self.sheet.odd.get((self.rows[row], places[0]), "")

    def check(self, *more: str, strict: bool = False) -> None:
        """Raise InputError with all faults and `more`; with `strict`, doubts are faults too."""
        faults = [*(text for _, _, text in sorted(self._faults)), *more]
        for one in self.remarks:
            if strict and one.doubt:
                faults += [f"row {number}: {one.what}" for number in one.rows]
        if faults:
            raise InputError(self.source, *faults)

    @property
    def shown(self) -> tuple[str, ...]:
        """The remarks that are not details, as text."""
        return tuple(str(remark) for remark in self.remarks if not remark.detail)

    def values(self, name: str, read: Callable[[str], Any], expected: str) -> list[Any]:
        """Return what `read` makes of each cell, None where empty; its ValueError is a fault."""
        cells = self[name]
        results: dict[str, Any] = {}
        illegal = set()
        for cell in {*cells} - {""}:
            try:
                results[cell] = read(cell)
            except (ValueError, KeyError):
                illegal.add(cell)
        self.wrong([row for row, cell in enumerate(cells) if cell in illegal], name, expected)
        return [results.get(cell) for cell in cells]

    # Numbers.

    def typed(self, name: str) -> list[bool]:
        """Return for each cell of a column whether it is text, not a number of a workbook."""
        if self.sheet.separator or not self._typed:
            return [bool(self.sheet.separator)] * len(self.rows)
        column = self.places.get(name, [-1])[0]
        return [(number, column) in self._typed for number in self.rows]

    def read(self, cell: str, is_text: bool, unit: str, target: str) -> float | None:
        """Return the number in a cell in the unit `target`; `unit` is that of the column."""
        mark = self._mark if is_text else "."
        if not mark and self.sheet.separator == "," and "," not in cell:
            mark = "."  # where commas separate cells, a point marks decimals
        return read_number(cell, mark, unit, target)

    def numbers(
        self,
        name: str,
        low: float,
        high: float,
        target: str = "",
        *,
        positive: bool = False,
        whole: bool = False,
    ) -> Floats:
        """Return the numbers of a column, by default in its usual unit, NaN where it is empty.

        Numbers that are illegible or outside low..high become faults; with `positive`, so does 0.
        """
        usual = self.words.units[name]
        target, unit = target or usual, self.units.get(name) or usual
        cells, texts = self[name], self.typed(name)
        if name in self.needs_unit and not self.units.get(name):
            bare = [n for n, cell in enumerate(cells) if cell and not re.search(r"[^\W\d_]", cell)]
            self.wrong(bare, name, f"a unit in the title, such as {name} or [{spelled(unit)}]")
        # A list has few distinct numbers, so each is read once.
        pairs = [*zip(cells, texts, strict=True)]
        values = {pair: self.read(*pair, unit, target) for pair in set(pairs)}
        column = np.array([values[pair] for pair in pairs], dtype=np.float64)
        illegible = np.isnan(column) & self.given(name)
        outside = (column < low) | (column > high) | (positive & (column == 0))
        if whole:
            outside |= np.floor(column) < column
        scale = 10.0 ** (ALIKE[unit][unit] - ALIKE[unit][target])
        least = "above 0, up to " if positive else f"{low / scale:.7g}.."
        kind = "a whole number" if whole else "a number"
        expected = f"{kind} {least}{high / scale:.7g}{'' if whole else ' ' + spelled(unit)}"
        for row in np.flatnonzero(illegible | outside).tolist():
            either = {read_number(cells[row], mark, unit, target) for mark in ".,"}
            clear = illegible[row] and None not in either and len(either) == 2
            both = " or ".join(f"{value / scale:g}" for value in sorted(filter(None, either)))
            self.wrong([row], name, f"{expected}; it may be {both}" if clear else expected)
        return column


def letter(number: int) -> str:
    """Return the letters of a spreadsheet column, such as AB, given its index from 0."""
    more, last = divmod(number, 26)
    return (letter(more - 1) if more else "") + chr(65 + last)


def clean(cell: str) -> str:
    """Return the text of a cell as one line."""
    # The space is the only printable whitespace character.
    return cell if cell.isprintable() and "  " not in cell else " ".join(cell.split())


def cleaned(cells: Sequence[str]) -> list[str]:
    """Return the texts of cells, each as one line."""
    # If no cell needs cleaning, one test of all cells suffices; cells are already stripped.
    text = "|".join(cells)
    return list(cells) if text.isprintable() and "  " not in text else [*map(clean, cells)]
