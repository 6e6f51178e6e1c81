"""Message sets as tables: CSV files that a spreadsheet can write, and DataFrames.

    name,arbitration_id,extended,dlc,period_ms,deadline_ms,jitter_ms,offset_ms,sender,bits
    oil pressure,0x120,no,8,100,50,0.5,,JB1,

An identifier is decimal, or hexadecimal behind 0x. `deadline_ms` left empty is the period,
`jitter_ms` and `offset_ms` are 0, `extended` is no, `bits` follows from the data bytes. Columns
may come in any order; those with a default may be left out. `note` is for remarks, which are not
kept.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Callable, Iterable, Mapping
from decimal import Decimal
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

from shipnet.can.schedule.messages import RANGES, Message, MessageSet, set_faults
from shipnet.clock import nanoseconds
from shipnet.errors import ArgumentError, InputError
from shipnet.tables import NUMBER, Sheet, parse_sheet, read_sheet

if TYPE_CHECKING:
    import pandas as pd

__all__ = [
    "COLUMNS", "from_table", "load_messages", "parse_messages", "save_messages", "to_table",
]  # fmt: skip

#: Columns of a table of messages; the first four must be there.
COLUMNS = ("name", "arbitration_id", "dlc", "period_ms", "deadline_ms", "jitter_ms", "offset_ms",
           "extended", "sender", "bits")  # fmt: skip
_NEEDED = COLUMNS[:4]

_WHOLE = re.compile(r"[0-9]{1,12}(\.0)?|0[xX][0-9a-fA-F]{1,8}")
_YES = {"yes": True, "true": True, "1": True, "no": False, "false": False, "0": False}


def load_messages(path: str | PathLike[str]) -> MessageSet:
    """Read a message set from a CSV file.

    Parameters
    ----------
    path : path
        File with a row of column titles and one row a message, separated by commas, semicolons or
        tabs, numbers with a decimal point; UTF-8, UTF-16 with a mark, or Windows-1252. Blank rows
        are skipped. Or an Excel workbook with such a sheet.

    Returns
    -------
    MessageSet
        The messages, the highest priority first.

    Raises
    ------
    InputError
        If the file cannot be read, or does not describe a message set: every fault with its row,
        column and value, and what was expected.

    Examples
    --------
    The engine of lee2012, every value as 16 bits once a second; the identifiers are our own:

    >>> from shipnet import datasets
    >>> messages = load_messages(datasets.path("synthetic_can_lee2012.csv"))
    >>> len(messages), sum(message.dlc for message in messages)
    (22, 164)
    """
    return _from_sheet(read_sheet(path))


def parse_messages(text: str, source: str = "text") -> MessageSet:
    r"""Read a message set from text, as an editor holds it.

    Parameters
    ----------
    text : str
        What a file for `load_messages` holds.
    source : str, default "text"
        What to call it in an error.

    Returns
    -------
    MessageSet
        The messages, the highest priority first.

    Raises
    ------
    InputError
        As `load_messages`.

    Examples
    --------
    >>> parse_messages("name;arbitration_id;dlc;period_ms\noil;0x120;8;100").names
    ('oil',)
    """
    return _from_sheet(parse_sheet(text, source))


def save_messages(messages: MessageSet, path: str | PathLike[str]) -> None:
    """Write a message set as a CSV file, from which `load_messages` makes the same set.

    Parameters
    ----------
    messages : MessageSet
        What to write.
    path : path
        File, in an existing folder; it is overwritten.

    Returns
    -------
    None
        Every time is written to the nanosecond.

    Examples
    --------
    >>> import tempfile
    >>> messages = MessageSet([Message("oil pressure", 0x120, 8, period=0.1)])
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     save_messages(messages, Path(folder) / "set.csv")
    ...     load_messages(Path(folder) / "set.csv") == messages
    True
    """
    with Path(path).open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(COLUMNS)
        for message in messages:
            times = (
                f"{Decimal(nanoseconds(getattr(message, time))).scaleb(-6).normalize():f}"
                for time in RANGES
            )
            writer.writerow(
                [message.name, f"{message.arbitration_id:#x}", message.dlc, *times,
                 "yes" if message.extended else "no", message.sender, message.bits]
            )  # fmt: skip


def to_table(messages: MessageSet) -> pd.DataFrame:
    """Return a message set as a table, one row a message, the highest priority first.

    Parameters
    ----------
    messages : MessageSet
        The messages.

    Returns
    -------
    pandas.DataFrame
        The columns of `COLUMNS`: the fields of `Message`, times in ms; ``bits`` is NA where the
        length follows from the data bytes.

    Examples
    --------
    >>> messages = MessageSet([Message("a", 0x10, 8, 0.0025)])
    >>> to_table(messages)[["name", "arbitration_id", "period_ms"]].values.tolist()
    [['a', 16, 2.5]]
    """
    import pandas as pd

    columns: dict[str, list[Any]] = {}
    for column in COLUMNS:
        time = column.removesuffix("_ms")
        values = [getattr(message, time) for message in messages]
        # From whole nanoseconds 2.5 ms stay 2.5.
        columns[column] = [nanoseconds(t) / 1e6 for t in values] if time in RANGES else values
    return pd.DataFrame(columns).astype({"bits": "Int64", "name": object, "sender": object})


def from_table(table: pd.DataFrame) -> MessageSet:
    """Make a message set of a table.

    Parameters
    ----------
    table : pandas.DataFrame
        Columns of `COLUMNS`, the first four at least; a missing value takes its default. An
        identifier is a number or text.

    Returns
    -------
    MessageSet
        The messages, the highest priority first.

    Raises
    ------
    InputError
        If the table does not describe a message set: every fault with the label of its row, its
        column and value, and what was expected.

    Examples
    --------
    >>> import pandas as pd
    >>> table = pd.DataFrame({"name": ["b", "a"], "arbitration_id": [2, 1], "dlc": 8})
    >>> from_table(table.assign(period_ms=[5, 2.5])).names
    ('a', 'b')
    """
    columns = [str(column) for column in table.columns]
    cells = table.astype(object).where(table.notna(), "")
    rows = (
        (f"row {label}", {c: str(v).strip() for c, v in zip(columns, row, strict=True)})
        for label, row in zip(table.index, cells.itertuples(index=False, name=None), strict=True)
    )
    return _message_set("table", columns, rows)


def _from_sheet(sheet: Sheet) -> MessageSet:
    columns = [title.lower() for title in sheet.titles]
    width = len(columns)
    long = [
        f"row {number} has {len(row)} cells; expected {width}"
        for number, row in sheet.rows
        if any(row[width:])
    ]
    cells = (
        (f"row {number}", dict(zip(columns, row, strict=False)))
        for number, row in sheet.rows
        if not any(row[width:])
    )
    return _message_set(sheet.source, columns, cells, long)


def _message_set(
    source: str,
    columns: list[str],
    rows: Iterable[tuple[str, Mapping[str, str]]],
    found: Iterable[str] = (),
) -> MessageSet:
    """Make the set of cells of text, or raise all that is wrong with them."""
    faults = [
        f"column {place}: title {title!r} is unknown; expected one of {', '.join(COLUMNS)}, note"
        for place, title in enumerate(columns, start=1)
        if title not in (*COLUMNS, "note")
    ]
    twice = sorted({title for title in columns if columns.count(title) > 1})
    faults += [f"title {title!r} stands twice" for title in twice]
    faults += [f"no column {title}" for title in _NEEDED if title not in columns]
    if faults:
        raise InputError(source, *faults)
    faults += found
    messages, places = [], []
    for place, cells in rows:
        message, wrong = _message(cells)
        faults += [f"{place}, {fault}" for fault in wrong]
        if message is not None:
            messages.append(message)
            places.append(place)
    faults += [f"{places[number]}: {fault}" for number, fault in set_faults(messages)]
    if not messages and not faults:
        faults = ["has no message; expected one row a message"]
    if faults:
        raise InputError(source, *faults)
    return MessageSet(messages)


def _message(cells: Mapping[str, str]) -> tuple[Message | None, list[str]]:
    """Make a message of a row, or say all that keeps it from being one."""
    faults = []
    fields: dict[str, Any] = {}
    for column in COLUMNS:
        cell = cells.get(column, "")
        if not cell:
            if column in _NEEDED:
                faults.append(f"column {column}: is empty; a message needs it")
            continue
        read, expected = _READERS[column]
        try:
            fields[column.removesuffix("_ms")] = read(cell)
        except ValueError:
            faults.append(f"column {column}: {cell!r}; expected {expected}")
    if not faults:
        try:
            return Message(**fields), []
        except ArgumentError as fault:
            faults.append(str(fault))
    return None, faults


def _within(value: float, low: float, high: float) -> float:
    if not low <= value <= high:
        raise ValueError
    return value


def _time(low: float, high: float) -> tuple[Callable[[str], float], str]:
    def read(cell: str) -> float:
        if not NUMBER.fullmatch(cell):
            raise ValueError
        return _within(float(Decimal(cell).scaleb(-3)), low, high)

    return read, f"a number {low * 1e3:g}..{high * 1e3:g} ms"


def _whole(low: int, high: int, expected: str = "") -> tuple[Callable[[str], int], str]:
    def read(cell: str) -> int:
        if not _WHOLE.fullmatch(cell):
            raise ValueError
        base = 16 if cell[:2] in ("0x", "0X") else 10
        return int(_within(int(cell.removesuffix(".0"), base), low, high))

    return read, expected or f"a whole number {low}..{high}"


def _text(cell: str) -> str:
    if not cell.isprintable():
        raise ValueError
    return cell


def _yes(cell: str) -> bool:
    if cell.lower() not in _YES:
        raise ValueError
    return _YES[cell.lower()]


_READERS: dict[str, tuple[Callable[[str], Any], str]] = {
    "name": (_text, "printable text"),
    "arbitration_id": _whole(0, 2**29 - 1, "an identifier 0..0x7FF, or 0x1FFFFFFF if extended"),
    "dlc": _whole(0, 8),
    **{f"{time}_ms": _time(*limits) for time, limits in RANGES.items()},
    "extended": (_yes, "yes or no"),
    "sender": (_text, "printable text"),
    "bits": _whole(47, 160),
}
