"""Tables from CSV files of any spreadsheet and from Excel workbooks, as rows of text.

A workbook is not trusted: formulas are never evaluated, a part with a DTD is refused, and sizes are
bounded. In files written here, text never becomes a formula.
"""

from __future__ import annotations

import csv
import re
import warnings
from bisect import bisect_left, bisect_right
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from datetime import date, time, timedelta
from functools import cache
from io import BytesIO, StringIO
from math import inf
from numbers import Number
from operator import itemgetter
from os import PathLike
from pathlib import Path
from types import SimpleNamespace
from typing import IO, Any, cast
from xml.etree import ElementTree
from zipfile import ZipFile

from shipnet.errors import ArgumentError, InputError, listed, load_extra
from shipnet.files import LARGEST_TABLE, LONGEST, read_bytes
from shipnet.lazy import pd

#: A number; its decimal separator, if any, is a point.
NUMBER = re.compile(r"[+-]?([0-9]+(\.[0-9]*)?|\.[0-9]+)([eE][+-]?[0-9]{1,3})?")

#: The values of cells whose formula failed.
ERRORS = ("#DIV/0!", "#N/A", "#NAME?", "#NULL!", "#NUM!", "#REF!", "#VALUE!")

#: Largest unpacked workbook [bytes].
_UNPACKED = 2**28

#: What any workbook may have, and what it may have more per byte of the file: bytes and XML
#: elements when it is unpacked. Otherwise a tiny file could have any number of them.
_BYTES, _ELEMENTS = (2**24, 24), (2**17, 0.5)

#: Elements of rows, cells and texts, and maximum number of others, which openpyxl reads slowly.
_OF_CELLS = re.compile(rb"<(?:\w{1,9}:)?(?:row|c|v|f|is|si|t|r|rPr|rPh|phoneticPr)[\s/>]")
_OTHERS = 2**16

#: Beginnings of the names of parts that are not read, in which only bytes are counted: a comment
#: has 20 elements. No sheet may have such a name.
_UNREAD = ("xl/comments", "xl/threadedComments/", "xl/drawings/")

#: Maximum numbers of cells in a table, including gaps, of its filled rows and columns, and of the
#: sheets of a workbook; and the last row of any sheet.
MOST_CELLS, _ROWS, _COLUMNS, _SHEETS, _LAST = 2**22, 2**16, 1024, 256, 2**20

#: Characters that a row of empty cells may contain.
_BLANK = ' ,;\t"\r\n'

#: Number of rows that are searched for the row of titles.
_TOP = 50

_CAPTURE = (
    "is a sigrok capture, not a table; read it with can.read_capture, asi.decode or "
    "remote_control.read_capture"
)

_SEPARATORS = {",": "commas", ";": "semicolons", "\t": "tabs"}


@dataclass(frozen=True, slots=True)
class Remark:
    """A remark on how a table was read, and the rows that it concerns.

    With `doubt`, the rows may have been misunderstood; a `detail` is shown only in the full table.
    """

    what: str
    rows: tuple[int, ...] = ()
    doubt: bool = False
    detail: bool = False

    def __str__(self) -> str:
        if not self.rows:
            return self.what
        several, places = "s" * (len(self.rows) > 1), listed(self.rows).lstrip("s ")
        return f"{self.what}: {len(self.rows)} row{several} ({places})"


def remark_table(remarks: Sequence[Remark]) -> pd.DataFrame:
    """Return remarks as a table with the columns what, count, rows and doubt."""
    rows = []
    for one in remarks:
        which = listed(one.rows, None)[1:].lstrip() if one.rows else ""
        rows.append((one.what, len(one.rows) or None, which, one.doubt))
    table = pd.DataFrame(rows, columns=["what", "count", "rows", "doubt"])
    return table.astype({"count": "Int64"})


@dataclass(frozen=True, slots=True)
class Sheet:
    """A row of titles and the rows below it, as stripped text.

    Rows are numbered from 1, as in a spreadsheet: `top` is the row of titles, `above` the filled
    rows before it, `hidden` those hidden, `merged` those filled from merged cells. Cells are
    (row, column from 0): `odd` describes those that are neither text nor a plain number, `struck`
    are struck out. In a workbook, `separator` is ``""``, and `typed` are cells of text that may
    be a number, and `unread` names the other sheets.
    """

    source: str
    top: int
    titles: tuple[str, ...]
    rows: Sequence[tuple[int, list[str]]]
    separator: str = ","
    odd: dict[tuple[int, int], str] = field(default_factory=dict)
    remarks: tuple[Remark, ...] = ()
    sheet: str = ""
    hidden: frozenset[int] = frozenset()
    struck: frozenset[tuple[int, int]] = frozenset()
    typed: frozenset[tuple[int, int]] = frozenset()
    merged: frozenset[int] = frozenset()
    above: Sequence[tuple[int, list[str]]] = ()
    unread: tuple[str, ...] = ()

    def also_read(self, sheets: Iterable[str]) -> Sheet:
        """Return the sheet with a remark on the sheets that were read, and those that were not."""
        read = list(dict.fromkeys([self.sheet, *sheets]))
        unread = tuple(name for name in self.unread if name not in read)
        remark = f"read: sheet{'s' * (len(read) > 1)} {', '.join(read)}"
        remark += f"; not read: {', '.join(unread)}" if unread else ""
        others = [one for one in self.remarks if not str(one).startswith("read: sheet")]
        remarks = (*others, Remark(remark, detail=not unread))
        return replace(self, unread=unread, remarks=remarks)


def titled(
    sheet: Sheet, known: Mapping[str, str | None]
) -> tuple[list[tuple[int, dict[str, str]]], list[tuple[int, str]]]:
    """Return (number, cells by title) for each well-formed row, and (number, fault) for the others.

    `known` maps each title to the value of an empty cell, or to None if the column is required.
    """
    titles = ["_".join(title.lower().split()) for title in sheet.titles]
    faults = [
        f"title {title!r} is unknown; expected one of {', '.join(known)}"
        for title in titles
        if title and title not in known
    ]
    twice = [title for title in dict.fromkeys(titles) if title and titles.count(title) > 1]
    faults += [f"title {title!r} occurs twice" for title in twice]
    faults += [f"no column {t}" for t, empty in known.items() if empty is None and t not in titles]
    if faults:
        raise InputError(sheet.source, *(f"row {sheet.top}: {fault}" for fault in faults))
    rows, wider = [], []
    for number, cells in sheet.rows:
        if any(cells[len(titles) :]):
            wider.append((number, f" has {len(cells)} cells; expected {len(titles)}"))
            continue
        given = {title: cell for title, cell in zip(titles, cells, strict=False) if cell}
        if "" in given:
            wider.append((number, f" has {given['']!r} in a column without a title"))
            continue
        rows.append((number, {t: given.get(t, empty or "") for t, empty in known.items()}))
    return rows, wider


def in_order(faults: Iterable[tuple[int, str]]) -> list[str]:
    """Return the faults in the order of their rows, each with its row number."""
    return [f"row {number}{fault}" for number, fault in sorted(faults, key=itemgetter(0))]


def text_of(data: bytes) -> str:
    """Return the text of a file in UTF-8, UTF-16, Korean (cp949) or Windows-1252."""
    return _decoded(data)[0]


def _decoded(data: bytes) -> tuple[str, str]:
    """Return the text of a file and its encoding; undefined bytes are replaced."""
    # charset-normalizer read five of nine short lists as Big5 or cp775, so we try the few encodings
    # that spreadsheets write.
    if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return data.decode("utf-16", errors="replace"), "utf-16"
    for encoding, odd in (("utf-16-le", data[1:200:2]), ("utf-16-be", data[:200:2])):
        if len(data) > 3 and odd.count(0) > 0.9 * len(odd):
            return data.decode(encoding, errors="replace"), encoding
    try:
        return data.decode("utf-8-sig"), "utf-8"
    except UnicodeDecodeError:
        pass
    try:
        # Two bytes of Windows-1252, such as a degree sign and a letter, can be a rare syllable of
        # cp949. Nearly all Korean text is in the smaller set EUC-KR.
        korean = data.decode("cp949")
        beyond = [character for character in korean if not character.isascii()]
        # Python writes a syllable that is not in the set as four characters of two bytes.
        common = [one for one in beyond if len(one.encode("euc-kr", errors="ignore")) == 2]
        if len(common) > 0.9 * len(beyond):
            return korean, "cp949"
    except UnicodeDecodeError:
        pass
    return data.decode("cp1252", errors="replace"), "cp1252"


def parse_sheet(
    text: str,
    source: str = "text",
    *,
    is_titles: Callable[[Sequence[str]], float] = any,
    what: str = "column titles",
) -> Sheet:
    """Split text into rows of cells separated by commas, semicolons or tabs.

    The row of titles is the one among the first 50 for which `is_titles` is highest, by default the
    first that is not blank. Error messages call the titles `what`.
    """
    if "\0" in text:
        raise InputError(source, "is not text: it contains zero bytes; expected a CSV file")
    lines = list(StringIO(text, newline=""))
    worth, above, separator = _top(lines, is_titles)
    if not worth:
        empty = not text.strip(_BLANK)
        raise InputError(source, f"{'is empty; expected a' if empty else 'has no'} row of {what}")
    first, rows = list[list[str]](), list[tuple[int, list[str]]]()
    number = 0
    try:
        # A row has several lines if a cell contains line breaks.
        reader = csv.reader(lines[:above], delimiter=separator)
        first.extend(list(map(cell_text, cells)) for cells in reader)
        reader = csv.reader(lines[above:], delimiter=separator, strict=True)
        for number, row in enumerate(reader, len(first) + 1):
            cells = list(map(cell_text, row))
            if any(cells):
                _check_row(source, len(rows), number, cells)
                rows.append((number, cells))
    except csv.Error as error:
        place = max(number, len(first)) + 1
        raise InputError(source, f"is not a CSV file: {error}, in row {place}") from None
    (top, titles), *rows = rows
    filled = [(number, cells) for number, cells in enumerate(first, 1) if any(cells)]
    return Sheet(source, top, _trim(titles), rows, separator, above=filled)


def _top(
    lines: Sequence[str], is_titles: Callable[[Sequence[str]], float]
) -> tuple[float, int, str]:
    """Return how likely the best line contains the column titles, its index and its separator."""
    best = (0.0, 0, "")
    for place, line in enumerate(lines[:_TOP]):
        # The first line may name the separator.
        if not line.strip(_BLANK) or (place == 0 and re.fullmatch(r"sep=.\s*", line)):
            continue
        for separator in sorted(";\t,", key=line.count, reverse=True):
            try:
                cells = next(csv.reader(lines[place:], delimiter=separator))
            except csv.Error:
                continue
            worth = float(is_titles(list(map(cell_text, cells[:_COLUMNS]))))
            best = max(best, (worth, place, separator), key=itemgetter(0))
    return best


def _check_row(source: str, before: int, number: int, cells: list[str]) -> None:
    """Raise if a filled row, with a number of others before it, is too far down, wide or long.

    Empty cells at the end of a wide row are removed.
    """
    if before > _ROWS:
        raise InputError(source, f"row {number}: at most {_ROWS} filled rows are read")
    while len(cells) > _COLUMNS and not cells[-1]:
        del cells[-1]
    if len(cells) > _COLUMNS:
        raise InputError(
            source, f"row {number} has {len(cells)} cells; at most {_COLUMNS} are read"
        )
    for place, cell in enumerate(cells if max(map(len, cells)) > LONGEST else (), 1):
        if len(cell) > LONGEST:
            why = f"a cell has {len(cell)} characters; at most {LONGEST} are read"
            raise InputError(source, f"row {number}, column {place}: {why}")


def _trim(titles: Sequence[str]) -> tuple[str, ...]:
    """Return titles without the empty ones at the end."""
    width = max((n for n, title in enumerate(titles, start=1) if title), default=0)
    return tuple(" ".join(title.split()) for title in titles[:width])


def read_sheet(
    path: str | PathLike[str],
    sheet: str | None = None,
    *,
    is_titles: Callable[[Sequence[str]], float] = any,
    what: str = "column titles",
) -> Sheet:
    """Read a CSV file or a sheet of an Excel workbook; the format is detected from the content.

    By default, the visible sheet with the most likely row of titles is read; a remark names it.
    Formulas are read as their saved values; merged cells are repeated in each of their rows.
    `is_titles` and `what` are as in `parse_sheet`.
    """
    source, data = str(path), read_bytes(path)
    if data[:4] == b"PK\x03\x04":
        return _workbook(source, data, sheet, is_titles, what)
    if data[:8] == b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1":
        raise InputError(source, "is an old Excel file (.xls), or has a password; save it as .xlsx")
    if sheet is not None:
        raise InputError(source, f"has no sheet {sheet!r}; expected an Excel workbook (.xlsx)")
    text, encoding = _decoded(data)
    parsed = parse_sheet(text, source, is_titles=is_titles, what=what)
    remark = f"read as {encoding}, with {_SEPARATORS[parsed.separator]} between the cells"
    return replace(parsed, remarks=(Remark(remark, detail=encoding == "utf-8"),))


def read_sheets(
    path: str | PathLike[str], is_titles: Callable[[Sequence[str]], float]
) -> list[Sheet]:
    """Return the sheets in which `is_titles` accepts a row; [] if the file is not a workbook."""
    source, data = str(path), read_bytes(path)
    if data[:4] != b"PK\x03\x04":
        return []
    with _opened(data, source) as book:
        worths = [(title, *_best_row(book, title, is_titles)) for title in book.sheets]
        return [_table(source, book, title, top) for title, worth, top in worths if worth]


def _workbook(
    source: str,
    data: bytes,
    name: str | None,
    is_titles: Callable[[Sequence[str]], float],
    what: str,
) -> Sheet:
    with _opened(data, source) as book:
        if name is not None and name not in book.sheets:
            raise InputError(source, f"has no sheet {name!r}; it has {', '.join(book.sheets)}")
        if name is not None:
            worth, top = _best_row(book, name, is_titles)
            if not worth:
                raise InputError(source, f"has no row of {what}, on the sheet {name}")
            return _table(source, book, name, top).also_read([])
        shown = [title for title in book.sheets if title not in book.hidden_sheets]
        worths = {title: _best_row(book, title, is_titles) for title in shown}
        chosen = max(worths, key=lambda title: worths[title][0], default="")
        if chosen and worths[chosen][0]:
            others = tuple(title for title in book.sheets if title != chosen)
            table = _table(source, book, chosen, worths[chosen][1])
            return replace(table, unread=others).also_read([])
        hidden = f"; hidden sheets, which are read only if named: {', '.join(book.hidden_sheets)}"
        where = f"the sheets {', '.join(shown)}{hidden if book.hidden_sheets else ''}"
        raise InputError(source, f"has no row of {what}, on {where}")


def _best_row(
    book: _Workbook, title: str, is_titles: Callable[[Sequence[str]], float]
) -> tuple[float, int]:
    """Return the highest value of `is_titles` and the number of its row, or (0, 0) if all are 0."""
    best = (0.0, 0)
    for number, cells, _ in book.rows(title):
        if number > _TOP:
            break
        best = max(best, (float(is_titles(cells[:_COLUMNS])), number), key=itemgetter(0))
    return best


def _table(source: str, book: _Workbook, title: str, top: int) -> Sheet:
    """Return a sheet of a workbook, given the number of its row of titles."""
    rows, above = list[tuple[int, list[str]]](), list[tuple[int, list[str]]]()
    odd, titles = dict[tuple[int, int], str](), list[str]()
    for number, cells, own in book.rows(title):
        if any(cells):
            _check_row(source, len(rows), number, cells)
        if number == top:
            titles = cells
        elif number < top and any(cells):
            above.append((number, cells))
        elif any(cells):
            rows.append((number, cells))
            odd |= {(number, place): what for place, what in own.items()}
    numbers, filled, room = [number for number, _ in rows], set(), MOST_CELLS
    for upper, bottom, left in book.merged:
        # Copy the content of the merged cell to each of its rows.
        first, end = bisect_left(numbers, upper), bisect_right(numbers, bottom)
        if upper <= top or upper not in numbers[first:end] or len(rows[first][1]) <= left:
            continue
        for number, cells in rows[first + 1 : end]:
            room -= 1 + max(0, left + 1 - len(cells))
            if room < 0:
                raise ValueError(f"its merged areas span more than {MOST_CELLS} cells")
            cells += [""] * (left + 1 - len(cells))
            cells[left] = rows[first][1][left]
            if cells[left]:
                filled.add(number)
            if (upper, left) in odd:
                odd[number, left] = odd[upper, left]
            if (upper, left) in book.typed:
                book.typed.add((number, left))
    return Sheet(
        source,
        top,
        _trim(titles),
        rows,
        separator="",
        odd=odd,
        sheet=title,
        hidden=frozenset(book.hidden.intersection(numbers)),
        struck=frozenset(book.struck),
        typed=frozenset(book.typed),
        merged=frozenset(filled),
        above=above,
    )


class _Workbook:
    """An open workbook, whose sheets are read row by row.

    Of the last sheet, `struck` are the cells struck out and `typed` those of text like a number;
    `hidden` are its hidden rows, and `merged` its merged areas: first row, last row, first column.
    """

    def __init__(self, archive: ZipFile, reader: Any) -> None:
        self._archive, self._reader = archive, reader
        existing = {name for name in archive.namelist() if not name.startswith(_UNREAD)}
        sheets = [
            (sheet, relation.target)
            for sheet, relation in reader.parser.find_sheets()
            if "chartsheet" not in relation.Type and relation.target in existing
        ]
        if not 0 < len(sheets) <= _SHEETS:
            raise ValueError(f"it has {len(sheets)} sheets with cells; expected 1..{_SHEETS}")
        self._parts = {sheet.name: part for sheet, part in sheets}
        if len({*self._parts.values()}) < len(sheets):
            raise ValueError("two of its sheets have the same name or content")
        self.sheets = tuple(self._parts)
        self.hidden_sheets = tuple(sheet.name for sheet, _ in sheets if sheet.state != "visible")
        self.struck, self.typed = set[tuple[int, int]](), set[tuple[int, int]]()
        self.hidden, self.merged = set[int](), list[tuple[int, int, int]]()
        self._strikes: dict[Any, bool] = {}

    def rows(self, title: str) -> Iterator[tuple[int, list[str], dict[int, str]]]:
        """Yield the number, cells and odd cells of each row of a sheet; skip rows without cells."""
        from openpyxl.cell.read_only import ReadOnlyCell

        for collected in (self.struck, self.typed, self.hidden, self.merged):
            collected.clear()
        sheet: Any = SimpleNamespace(parent=self._reader.wb)
        area = length = last = 0
        for elements, cells in self._cells(title):
            number, texts = cells[0]["row"], [""] * max(cell["column"] for cell in cells)
            area += len(texts)
            if area > MOST_CELLS:
                raise ValueError(f"the sheet {title} spans more than {MOST_CELLS} cells")
            # Any number of cells may refer to one shared string.
            length += sum(len(cell["value"]) for cell in cells if isinstance(cell["value"], str))
            if length > LARGEST_TABLE:
                raise ValueError(f"the sheet {title} has more than {LARGEST_TABLE} characters")
            if number > _LAST:
                raise ValueError(f"the sheet {title} has a row beyond {_LAST}")
            if number <= last:
                raise ValueError(f"row {number} follows row {last}")
            last, odd = number, dict[int, str]()
            for element, values in zip(elements, cells, strict=True):
                place, cell = values["column"] - 1, ReadOnlyCell(sheet, **values)
                texts[place] = text = _text(cell, place, odd)
                if text and self._is_struck(cell):
                    self.struck.add((number, place))
                if isinstance(cell.value, str) and _TYPED.match(text):
                    self.typed.add((number, place))
                has_formula = not text and any(part.tag.endswith("}f") for part in element)
                if has_formula and "t" not in element.attrib:
                    texts[place], odd[place] = "=", "a formula without a saved value"
            yield number, texts, odd

    def _cells(self, title: str) -> Iterator[tuple[list[Any], list[dict[str, Any]]]]:
        """Yield the elements and the values of the cells of each row that has some."""
        from openpyxl.worksheet._reader import WorkSheetParser
        from openpyxl.worksheet.cell_range import CellRange

        book = self._reader.wb
        with self._archive.open(self._parts[title]) as part:
            # Only its reading of rows is used: it would read a sheet twice, and much besides rows.
            parser: Any = WorkSheetParser(
                part,
                self._reader.shared_strings,
                data_only=True,
                epoch=book.epoch,
                date_formats=book._date_formats,
                timedelta_formats=book._timedelta_formats,
            )
            for element in _elements(part):
                tag = element.tag.rpartition("}")[2]
                if tag == "mergeCell":
                    area = CellRange(element.attrib["ref"])
                    self.merged.append((area.min_row, area.max_row, area.min_col - 1))
                elif tag == "row":
                    elements, (number, cells) = list(element), parser.parse_row(element)
                    if element.get("hidden") in ("1", "true"):
                        self.hidden.add(number)
                    # A sheet may have a million empty rows with attributes.
                    element.clear()
                    parser.row_dimensions.clear()
                    if cells:
                        yield elements, cells

    def _is_struck(self, cell: Any) -> bool:
        # The font of a cell is slow to look up, and a workbook has few styles.
        style = cell._style_id
        if style not in self._strikes:
            self._strikes[style] = bool(cell.font.strike)
        return self._strikes[style]


def _elements(part: IO[bytes]) -> Iterator[Any]:
    """Yield the elements of a part of a workbook, each when it ends."""
    # The parser starts again at a tag or comment that is not complete. If it gets 16 kB at a time,
    # as from ElementTree.iterparse, one of many megabytes takes minutes.
    parser: Any = ElementTree.XMLPullParser()
    size = 2**14
    while piece := part.read(size):
        parser.feed(piece)
        size *= 2
        for _, element in parser.read_events():
            size = 2**14
            yield element
    parser.close()
    yield from (element for _, element in parser.read_events())


def _strings(archive: ZipFile, package: Any) -> list[str]:
    """Return the shared strings of a workbook, to which cells refer."""
    from openpyxl.cell.text import Text
    from openpyxl.xml.constants import SHARED_STRINGS

    strings, kind = list[str](), cast(Any, Text)
    table = package.find(SHARED_STRINGS)
    if table is not None and not table.PartName[1:].startswith(_UNREAD):
        with archive.open(table.PartName[1:]) as part:
            for element in _elements(part):
                if element.tag.endswith("}si"):
                    strings.append(kind.from_tree(element).content)
                    element.clear()
    return strings


@contextmanager
def _opened(data: bytes, source: str) -> Iterator[_Workbook]:
    """Open a workbook; raise any fault in it as an InputError."""
    try:
        with ZipFile(BytesIO(data)) as archive, warnings.catch_warnings():
            if "metadata" in archive.namelist():
                raise InputError(source, _CAPTURE)
            import openpyxl.reader.excel
            import openpyxl.styles.stylesheet

            warnings.simplefilter("ignore")  # openpyxl warns about ignored parts, such as pictures
            _check_parts(archive, len(data))
            reader = openpyxl.reader.excel.ExcelReader(BytesIO(data), keep_links=False)
            reader.read_manifest()
            reader.shared_strings = _strings(archive, reader.package)
            reader.read_workbook()
            openpyxl.styles.stylesheet.apply_stylesheet(reader.archive, reader.wb)
            yield _Workbook(archive, reader)
    except InputError:
        raise
    except ImportError:
        missing = "is an Excel workbook; install openpyxl to read it, or save it as CSV"
        raise InputError(source, missing) from None
    except Exception as error:  # openpyxl may raise any exception for a malformed file
        reason = " ".join(str(error).split()) or type(error).__name__
        raise InputError(source, f"is not an Excel workbook: {reason[:200]}") from None


def _check_parts(archive: ZipFile, size: int) -> None:
    """Raise if a workbook unpacks to too much, or a part has a DTD or cannot be unpacked."""
    unpacked = elements = others = 0
    most, most_elements = (int(fixed + each * size) for fixed, each in (_BYTES, _ELEMENTS))
    for name in archive.namelist():
        with archive.open(name) as part:
            before = b""
            while chunk := part.read(2**16):
                unpacked += len(chunk)
                if not name.startswith(_UNREAD):
                    more = chunk.count(b"<") - chunk.count(b"</")
                    elements += more
                    others += more - len(_OF_CELLS.findall(chunk))
                if unpacked > min(_UNPACKED, most):
                    raise ValueError(f"it unpacks to more than {min(_UNPACKED, most)} bytes")
                if elements > most_elements:
                    raise ValueError(f"it has more than {most_elements} XML elements")
                if others > _OTHERS:
                    raise ValueError(f"it has more than {_OTHERS} XML elements besides its cells")
                # No spreadsheet writes a DTD, whose entities could grow without bound.
                if b"<!DOCTYPE" in (before + chunk).replace(b"\0", b""):
                    raise ValueError(f"the part {name} declares a document type")
                before = chunk[-32:]


#: Date formats that ECMA-376 part 1, section 18.8.30 defines for East Asia; openpyxl reads them as
#: numbers.
_EAST_ASIAN_DATES = {*range(27, 37), *range(50, 59)}

#: The start of text that may be a number.
_TYPED = re.compile("[+\u2212\uff0b\uff0d-]?[.,\uff0c\uff0e]?\\d")

#: A number format with literal letters, which are quoted or follow a backslash.
_WORDS = re.compile(r'"(?:[^"\w]|[\d_])*[^\W\d_][^"]*"|\\[^\W\d_]')


@cache
def _format(code: str) -> str:
    """Return a format of zeros such as ``00``, ``"words"`` for one with letters, else ``""``."""
    first = code.partition(";")[0]
    return "words" if _WORDS.search(first) else first if re.fullmatch("00+", first) else ""


def _text(cell: Any, place: int, odd: dict[int, str]) -> str:
    """Return a cell of a workbook as text; if it is not a plain value, describe it in `odd`."""
    value = cell.value
    text = _cell(value)
    if what := "an error" if cell.data_type == "e" else _odd(value, text):
        odd[place] = what
    elif isinstance(value, int | float):
        if cell.style_array.numFmtId in _EAST_ASIAN_DATES:
            odd[place] = "a date or a time"
        shown = _format(cell.number_format)
        if shown == "words":
            odd[place] = "a number with words beside it"
        elif shown and text.isdecimal():
            return text.zfill(len(shown))
    return text


def _odd(value: Any, text: str) -> str:
    """Describe a truth value, a date, a time or an error; return ``""`` for any other value."""
    if isinstance(value, bool):
        return "true or false"
    if isinstance(value, date | time | timedelta):
        return "a date or a time"
    return "an error" if text.startswith("#") and text in ERRORS else ""


def frame_sheet(table: pd.DataFrame, source: str = "table") -> Sheet:
    """Return a DataFrame as a sheet, its rows numbered from 0, to be checked like a file."""
    titles = tuple(" ".join(str(title).split()) for title in table.columns)
    cells = table.astype(object).where(table.notna(), None)
    odd: dict[tuple[int, int], str] = {}
    typed = set()
    rows = []
    for number, values in enumerate(cells.itertuples(index=False, name=None)):
        row = [_cell(value) for value in values]
        if any(row):
            rows.append((number, row))
            for place, value in enumerate(values):
                if what := _odd(value, row[place]):
                    odd[number, place] = what
                if isinstance(value, str) and _TYPED.match(row[place]):
                    typed.add((number, place))
    return Sheet(source, -1, titles, rows, "", odd, typed=frozenset(typed))


def _cell(value: Any) -> str:
    """Return a value as text."""
    if isinstance(value, str):
        return cell_text(value)
    if value is None:
        return ""
    # Excel stores every number as a float, and shows 7.0 as 7.
    return str(int(value)) if isinstance(value, float) and value.is_integer() else str(value)


# Writing: DataFrames as CSV files and Excel workbooks --------------------------------------------

#: Text that a spreadsheet may read as a formula. Some drop white space before the sign; those of
#: East Asia accept wide signs. Apostrophes are included, so that `cell_text` inverts `no_formula`.
_FORMULA = re.compile(r"['\s\x00-\x1f\ufeff]*[=+\-@\uff1d\uff0b\uff0d\uff20\t\r\n]")

#: Maximum width of a column [characters], and the number of rows that determine the width.
_WIDEST, _LOOKED_AT = 60, 200


def no_formula(text: str) -> str:
    """Return text for a CSV file; an apostrophe precedes text like a formula, except a number."""
    return f"'{text}" if _FORMULA.match(text) and not NUMBER.fullmatch(text) else text


def cell_text(cell: str) -> str:
    """Return the text of a cell, stripped, and without the apostrophe that precedes a formula."""
    cell = cell.lstrip()
    return (cell[1:] if cell[:1] == "'" and _FORMULA.match(cell, 1) else cell).strip()


def csv_text(rows: Iterable[Iterable[object]], digits: int | None = None) -> str:
    """Return rows as CSV text in which no text is a formula; by default, numbers are exact."""

    def written(cell: object) -> object:
        if cell is None or (isinstance(cell, Number) and not (digits and isinstance(cell, float))):
            return cell
        if isinstance(cell, float):
            return f"{cell:.{digits}g}"
        # Before Python 3.13, csv does not quote a carriage return, which starts a new row.
        return no_formula(re.sub("\r\n?", "\n", str(cell)))

    stream = StringIO()
    csv.writer(stream, lineterminator="\n").writerows(map(written, row) for row in rows)
    # UTF-8 cannot encode half a pair of surrogates, which a JSON file may contain.
    return stream.getvalue().encode("utf-8", "backslashreplace").decode("utf-8")


def as_csv(table: pd.DataFrame, digits: int | None = None) -> bytes:
    """Return a table as CSV in UTF-8; its byte order mark keeps Excel from garbling Korean text."""
    rows = _values(table).itertuples(index=False, name=None)
    return csv_text([table.columns, *rows], digits).encode("utf-8-sig")


def as_workbook(tables: Mapping[str, pd.DataFrame]) -> bytes:
    """Return tables as the sheets of an Excel workbook, with frozen titles."""
    load_extra("openpyxl", "openpyxl")

    from openpyxl import Workbook
    from openpyxl.cell import WriteOnlyCell
    from openpyxl.cell.cell import ILLEGAL_CHARACTERS_RE
    from openpyxl.styles import Font
    from openpyxl.utils import get_column_letter

    # XML has no half pairs of surrogates and no noncharacters.
    illegal = re.compile(f"{ILLEGAL_CHARACTERS_RE.pattern}|[\ud800-\udfff\ufffe\uffff]")
    book = Workbook(write_only=True)
    for name, table in tables.items():
        sheet = book.create_sheet(name)

        def text(value: str, sheet: Any = sheet, font: Font | None = None) -> Any:
            value = illegal.sub("?", value)
            formula = _FORMULA.match(value) is not None
            if not (font or formula or value.startswith("#")):
                return value
            cell = WriteOnlyCell(sheet, value)
            cell.data_type = "s"  # openpyxl would treat "=1" as a formula, "#N/A" as an error
            cell.quotePrefix = formula  # it stays text when a user edits the cell
            if font:
                cell.font = font
            return cell

        sheet.freeze_panes = "A2"
        # A workbook cannot store infinity.
        rows = _values(table).replace({inf: "inf", -inf: "-inf"})
        for place, title in enumerate(table.columns, 1):
            shown = [title, *rows.iloc[:_LOOKED_AT, place - 1]]
            width = max(len(str(cell)) for cell in shown) + 2
            sheet.column_dimensions[get_column_letter(place)].width = min(width, _WIDEST)
        sheet.append([text(title, font=Font(bold=True)) for title in table.columns])
        for row in rows.itertuples(index=False, name=None):
            sheet.append([text(cell) if isinstance(cell, str) else cell for cell in row])
    stream = BytesIO()
    book.save(stream)
    return stream.getvalue()


def save_suffix(path: str | PathLike[str], *legal: str) -> str:
    """Return the suffix of a file to be written; raise if it is not a legal one."""
    if (suffix := Path(path).suffix.lower()) not in legal:
        raise ArgumentError(f"path is {str(path)!r}; its suffix must be {' or '.join(legal)}")
    return suffix


def save_table(path: str | PathLike[str], table: pd.DataFrame) -> None:
    """Write a table to a CSV file or an Excel workbook, as the suffix says."""
    if save_suffix(path, ".csv", ".xlsx") == ".xlsx":
        Path(path).write_bytes(as_workbook({"table": table.map(_as_number)}))
    else:
        content = as_csv(table)
        # Only other letters need the byte order mark.
        Path(path).write_bytes(content[3:] if content[3:].isascii() else content)


def _as_number(cell: object) -> object:
    """Return text as the number that is read back as the same text, if there is one."""
    is_number = isinstance(cell, str) and NUMBER.fullmatch(cell) and _cell(float(cell)) == cell
    return float(cell) if is_number else cell  # type: ignore[arg-type]


def _values(table: pd.DataFrame) -> pd.DataFrame:
    """Return a table of objects, None where missing; a tuple is joined into one string."""

    def joined(cell: object) -> object:
        return "; ".join(map(str, cell)) if isinstance(cell, tuple) else cell

    return table.map(joined).astype(object).where(table.notna(), None)
