"""Tables as people keep them: CSV files of any spreadsheet, and Excel workbooks, as rows of text.

What the rows mean is for the caller; here is only how to come by them, and where each stood.
"""

from __future__ import annotations

import csv
import re
from bisect import bisect_left, bisect_right
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from datetime import date, time, timedelta
from io import StringIO
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

from shipnet.errors import InputError
from shipnet.workbook import ERRORS, Merged, Row, Workbook

if TYPE_CHECKING:
    import pandas as pd

__all__ = [
    "NUMBER", "Sheet", "decode", "frame_sheet", "parse_sheet", "read_bytes", "read_sheet",
]  # fmt: skip

#: A number with a decimal point, nothing before or behind it.
NUMBER = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]{1,3})?")

#: Most bytes of a file that are read.
_LARGEST = 2**24

#: What a row without anything in its cells is made of.
_BLANK = ' ,;\t"\r\n'

#: Lines among which the row of titles is looked for.
_TOP = 50


@dataclass(frozen=True, slots=True)
class Sheet:
    """A row of titles and the rows under it.

    Parameters
    ----------
    source : str
        What the file is called in an error.
    top : int
        Number of the row of titles; the first row of the file is 1.
    titles : tuple of str
        Titles without blanks around them.
    rows : sequence of (int, list of str)
        Number and cells of each row that is not blank, without blanks around them.
    separator : str, default ","
        What stood between the cells; ``""`` in a workbook.
    odd : dict
        What a cell of a workbook is that is neither text nor plain number, by row and place (from
        0), as `shipnet.workbook.Row` has it.
    remarks : tuple of str
        What of a workbook was not read.
    """

    source: str
    top: int
    titles: tuple[str, ...]
    rows: Sequence[tuple[int, list[str]]]
    separator: str = ","
    odd: dict[tuple[int, int], str] = field(default_factory=dict)
    remarks: tuple[str, ...] = ()


def read_bytes(path: str | PathLike[str]) -> bytes:
    """Return what a file holds.

    Parameters
    ----------
    path : path
        File of at most 16 MiB.

    Returns
    -------
    bytes
        All of it.

    Raises
    ------
    InputError
        If the file cannot be read or is larger.

    Examples
    --------
    >>> from shipnet import datasets
    >>> read_bytes(datasets.path("kim2023_table1_sensors.csv"))[:4].isascii()
    True
    """
    try:
        with Path(path).open("rb") as stream:
            data = stream.read(_LARGEST + 1)
    except OSError as error:
        raise InputError(str(path), f"cannot be read: {error.strerror or error}") from None
    except ValueError as error:  # a path that no system can have, such as one with a zero byte
        raise InputError(str(path), f"cannot be read: {error}") from None
    if len(data) > _LARGEST:
        raise InputError(str(path), f"is larger than {_LARGEST} bytes; expected a table")
    return data


def decode(data: bytes) -> str:
    r"""Return the text of a file.

    Parameters
    ----------
    data : bytes
        UTF-8 with or without a mark, UTF-16 with a mark, or else Windows-1252.

    Returns
    -------
    str
        The text, without the mark; a byte that the encoding does not know is replaced.

    Examples
    --------
    >>> decode(b"\xef\xbb\xbf\xc2\xb5"), decode(b"\xb5"), decode("\u00b5".encode("utf-16"))
    ('µ', 'µ', 'µ')
    """
    if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return data.decode("utf-16", errors="replace")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("cp1252", errors="replace")


def parse_sheet(
    text: str,
    source: str = "text",
    *,
    is_titles: Callable[[Sequence[str]], bool] = any,
    what: str = "column titles",
) -> Sheet:
    r"""Split text into rows and cells.

    Parameters
    ----------
    text : str
        What a CSV file holds; separated by commas, semicolons or tabs.
    source : str, default "text"
        What to call it in an error.
    is_titles : function, optional
        Says whether cells are the row of titles, which is looked for among the first 50 lines;
        if it is not given, the first row that is not blank.
    what : str, default "column titles"
        What to call the row of titles in an error.

    Returns
    -------
    Sheet
        The titles and what stands below them.

    Raises
    ------
    InputError
        If there is no row of titles, a quotation mark is left open, or zero bytes show that it is
        no text.

    Examples
    --------
    >>> sheet = parse_sheet("sep=;\n\ntag;x_m\nLS-1;3,5\n")
    >>> sheet.titles, sheet.rows, sheet.separator
    (('tag', 'x_m'), [(4, ['LS-1', '3,5'])], ';')
    """
    if "\0" in text:
        raise InputError(source, "is not text: it holds zero bytes; expected a CSV file")
    lines = list(StringIO(text, newline=""))
    found = _top(lines, is_titles)
    if found is None:
        empty = not text.strip(_BLANK)
        raise InputError(source, f"{'is empty; expected a' if empty else 'has no'} row of {what}")
    above, separator = found
    reader = csv.reader(lines[above:], delimiter=separator, strict=True)
    rows = []
    line = above + 1
    try:
        for row in reader:
            cells = list(map(str.strip, row))
            if any(cells):
                rows.append((line, cells))
            line = above + reader.line_num + 1
    except csv.Error as error:
        raise InputError(source, f"is no CSV file: {error}, in row {line}") from None
    (top, titles), *rows = rows
    return Sheet(source, top, _trim(titles), rows, separator)


def _top(
    lines: Sequence[str], is_titles: Callable[[Sequence[str]], bool]
) -> tuple[int, str] | None:
    """Return the place of the row of titles, and the separator that makes it one."""
    for place, line in enumerate(lines[:_TOP]):
        # A spreadsheet may have told itself the separator in a line of its own.
        if not line.strip(_BLANK) or (place == 0 and re.fullmatch(r"sep=.\s*", line)):
            continue
        for separator in sorted(";\t,", key=line.count, reverse=True):
            try:
                cells = next(csv.reader(lines[place:], delimiter=separator))
            except csv.Error:
                continue
            if is_titles([cell.strip() for cell in cells]):
                return place, separator
    return None


def _trim(titles: Sequence[str]) -> tuple[str, ...]:
    """Return titles without the empty ones at the end."""
    width = max((n for n, title in enumerate(titles, start=1) if title), default=0)
    return tuple(" ".join(title.split()) for title in titles[:width])


def read_sheet(
    path: str | PathLike[str],
    sheet: str | None = None,
    *,
    is_titles: Callable[[Sequence[str]], bool] = any,
    what: str = "column titles",
) -> Sheet:
    """Read a CSV file or a sheet of an Excel workbook; what it holds decides, not its name.

    Parameters
    ----------
    path : path
        File.
    sheet : str, optional
        Name of the sheet of a workbook; if it is not given, the first that has a row of titles and
        is not hidden.
    is_titles, what
        As `parse_sheet`.

    Returns
    -------
    Sheet
        The titles and what stands below them. A formula is the value that the spreadsheet saved
        with it; nothing is ever evaluated. Cells that are merged downwards hold the same in each
        of their rows.

    Raises
    ------
    InputError
        If the file cannot be read, or has no such sheet or no row of titles.

    Examples
    --------
    >>> from shipnet import datasets
    >>> read_sheet(datasets.path("synthetic_iolist_valves.csv")).titles
    ('tag', 'device', 'service', 'signal', 'direction')
    """
    source, data = str(path), read_bytes(path)
    if data[:4] == b"PK\x03\x04":
        return _workbook(source, data, sheet, is_titles, what)
    if data[:8] == b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1":
        raise InputError(source, "is an old Excel file (.xls), or has a password; save it as .xlsx")
    if sheet is not None:
        raise InputError(source, f"has no sheet {sheet!r}; expected an Excel workbook (.xlsx)")
    return parse_sheet(decode(data), source, is_titles=is_titles, what=what)


def _workbook(
    source: str,
    data: bytes,
    name: str | None,
    is_titles: Callable[[Sequence[str]], bool],
    what: str,
) -> Sheet:
    book = Workbook(data, source)
    if name is not None and name not in book.sheets:
        raise InputError(source, f"has no sheet {name!r}; it has {', '.join(book.sheets)}")
    shown = [title for title in book.sheets if title not in book.hidden]
    asked = shown if name is None else [name]
    for place, title in enumerate(asked):
        found = _table(source, book, title, is_titles)
        if found is not None:
            too = [other for other in asked[place + 1 :] if _top_row(book.rows(other), is_titles)]
            said = f"read: sheet {title}; not read: {', '.join(too)}, with such titles too"
            return replace(found, remarks=(said,)) if too else found
    where = f"the sheets {', '.join(shown)}" if name is None else f"the sheet {name}"
    more = (
        f"; hidden, to be named: {', '.join(book.hidden)}" if name is None and book.hidden else ""
    )
    raise InputError(source, f"has no row of {what}, on {where}{more}")


def _top_row(table: Iterator[Row], is_titles: Callable[[Sequence[str]], bool]) -> Row | None:
    """Return the row of titles, and leave the rows below it; None if there is none."""
    for row in table:
        if row.number > _TOP:
            break
        if is_titles(row.cells):
            return row
    return None


def _table(
    source: str, book: Workbook, title: str, is_titles: Callable[[Sequence[str]], bool]
) -> Sheet | None:
    """Return what a sheet of a workbook holds; None if it has no row of titles."""
    merged: list[Merged] = []
    table = book.rows(title, merged)
    top = _top_row(table, is_titles)
    if top is None:
        return None
    rows: list[tuple[int, list[str]]] = []
    odd: dict[tuple[int, int], str] = {}
    for number, cells, own in table:
        if any(cells):
            rows.append((number, cells))
            odd |= {(number, place): what for place, what in own.items()}
    below = [area for area in merged if area.top > top.number]
    _fill_down(rows, odd, below)
    return Sheet(source, top.number, _trim(top.cells), rows, "", odd)


def _fill_down(
    rows: Sequence[tuple[int, list[str]]],
    odd: dict[tuple[int, int], str],
    merged: Sequence[Merged],
) -> None:
    """Put what merged cells hold into each of their rows."""
    numbers = [number for number, _ in rows]
    for top, bottom, left in merged:
        first, behind = bisect_left(numbers, top), bisect_right(numbers, bottom)
        own = rows[first : min(first + 1, behind)]
        if not own or own[0][0] != top or len(own[0][1]) <= left:
            continue
        for number, cells in rows[first + 1 : behind]:
            cells += [""] * (left + 1 - len(cells))
            cells[left] = own[0][1][left]
            if (top, left) in odd:
                odd[number, left] = odd[top, left]


def frame_sheet(table: pd.DataFrame, source: str = "table") -> Sheet:
    """Return a DataFrame as a sheet, so that it is checked as a file is.

    Parameters
    ----------
    table : pandas.DataFrame
        Missing values are empty cells.
    source : str, default "table"
        What to call it in an error.

    Returns
    -------
    Sheet
        Its rows, numbered from 0.

    Examples
    --------
    >>> import pandas as pd
    >>> frame_sheet(pd.DataFrame({"tag": ["a", None], "x_m": [1.0, 2.5]})).rows
    [(0, ['a', '1']), (1, ['', '2.5'])]
    """
    titles = tuple(" ".join(str(title).split()) for title in table.columns)
    cells = table.astype(object).where(table.notna(), None)
    odd: dict[tuple[int, int], str] = {}
    rows = []
    for number, values in enumerate(cells.itertuples(index=False, name=None)):
        row = [_cell(value) for value in values]
        if any(row):
            rows.append((number, row))
            for place, value in enumerate(values):
                if isinstance(value, bool):
                    odd[number, place] = "true or false"
                elif isinstance(value, date | time | timedelta):
                    odd[number, place] = "a date or a time"
                elif row[place] in ERRORS:
                    odd[number, place] = "an error"
    return Sheet(source, -1, titles, rows, "", odd)


def _cell(value: Any) -> str:
    if isinstance(value, str):
        return value.strip()
    if value is None:
        return ""
    # Excel knows no whole numbers: 7.0 is what it shows as 7.
    return str(int(value)) if isinstance(value, float) and value.is_integer() else str(value)
