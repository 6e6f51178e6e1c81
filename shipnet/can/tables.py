"""Message sets as tables and files: CSV, Excel and DBC files, and DataFrames.

    name,arbitration_id,extended,dlc,period_ms,deadline_ms,jitter_ms,offset_ms,sender,bits
    oil pressure,0x120,no,8,100,50,0.5,,JB1,

An identifier is decimal, or hexadecimal after 0x. `deadline_ms` left empty is the period,
`jitter_ms` and `offset_ms` are 0, `extended` is no, `bits` follows from the data bytes. Columns
may come in any order; those with a default may be left out. `note` is for remarks, which are not
kept.
"""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Callable, Iterable, Mapping
from decimal import Decimal
from importlib import import_module
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

from shipnet import datasets
from shipnet.can.messages import TIMES, Message, MessageSet, set_faults
from shipnet.clock import nanoseconds
from shipnet.errors import ArgumentError, InputError
from shipnet.fields import Number, declared
from shipnet.tables import NUMBER, Sheet, parse_sheet, read_sheet

if TYPE_CHECKING:
    import pandas as pd

#: Columns of a table of messages; the first four must be there.
COLUMNS = ("name", "arbitration_id", "dlc", "period_ms", "deadline_ms", "jitter_ms", "offset_ms",
           "extended", "sender", "bits")  # fmt: skip
_NEEDED = COLUMNS[:4]

_WHOLE = re.compile(r"[0-9]{1,12}(\.0)?|0[xX][0-9a-fA-F]{1,8}")
_YES = {"yes": True, "true": True, "1": True, "no": False, "false": False, "0": False}

#: Synthetic: the messages of an engine's junction boxes and controls.
EXAMPLE = """name,arbitration_id,dlc,period_ms,deadline_ms,sender
shutdown,0x010,1,50,5,safety
speed,0x020,4,10,5,governor
fuel index,0x030,4,10,10,governor
load limit,0x040,2,20,20,governor
alarm,0x080,8,100,50,JB1
lube oil,0x100,8,200,200,JB1
cooling water,0x101,8,200,200,JB1
exhaust 1-4,0x200,8,500,500,JB2
exhaust 5-8,0x201,8,500,500,JB2
bearings,0x300,8,1000,1000,JB3
"""


def example(name: str = "engine") -> MessageSet:
    """Return a message set to try things with.

    Parameters
    ----------
    name : {"engine", "lee2012"}, default "engine"
        ``"engine"``: ten synthetic messages of an engine's controls and junction boxes.
        ``"lee2012"``: the points of the engine of lee2012, 16 bits each once a second, with
        identifiers of our own.

    Returns
    -------
    MessageSet
        The messages.

    Raises
    ------
    ArgumentError
        If the name is unknown.

    Examples
    --------
    >>> example()
    MessageSet(10 messages: shutdown, speed, fuel index, ...)
    >>> len(example("lee2012")), sum(message.dlc for message in example("lee2012"))
    (22, 164)
    """
    if name == "engine":
        return parse_messages(EXAMPLE)
    if name == "lee2012":
        return read_messages(datasets.path("synthetic_can_lee2012.csv"))
    raise ArgumentError(f"name is {name!r}; it must be 'engine' or 'lee2012'")


def read_messages(
    path: str | PathLike[str],
    *,
    columns: Mapping[str, str] | None = None,
    period: float | None = None,
) -> MessageSet:
    """Read a message set from a file: CSV, Excel or DBC, by its suffix.

    Parameters
    ----------
    path : path
        A CSV file or an Excel workbook with a row of column titles and one row per message
        (separated by commas, semicolons or tabs; UTF-8, UTF-16 with a mark, or Windows-1252), or
        a ``.dbc`` file, which needs cantools.
    columns : mapping of str to str, optional
        Names of the columns for the titles of the file: ``{"Cycle [ms]": "period_ms"}``. Columns
        are ``name``, ``arbitration_id``, ``dlc``, ``period_ms`` and, if wanted, ``deadline_ms``,
        ``jitter_ms``, ``offset_ms``, ``extended``, ``sender``, ``bits`` and ``note``.
    period : float, optional
        Period of messages for which the file names none [s].

    Returns
    -------
    MessageSet
        The messages, the highest priority first.

    Raises
    ------
    InputError
        If the file cannot be read, or does not describe a message set: every fault with its row,
        column and value, and what was expected.
    ImportError
        If the file needs a package that is not installed; the message says how to install it.

    Notes
    -----
    The period of a message in a DBC file is its attribute ``GenMsgCycleTime``; 0 means that none
    is given. Signals are not read: cantools decodes them. Frames of CAN FD are refused.

    Examples
    --------
    >>> from shipnet import datasets
    >>> read_messages(datasets.path("synthetic_can_lee2012.csv"))
    MessageSet(22 messages: JB1-01, JB1-02, JB1-03, ...)
    """
    if Path(path).suffix.lower() == ".dbc":
        try:
            text = Path(path).read_text(encoding="cp1252", errors="replace")
        except OSError as problem:
            raise InputError(str(path), f"cannot be read: {problem.strerror}") from None
        return parse_dbc(text, str(path), period)
    sheet = read_sheet(path)
    return _from_sheet(sheet, {k.strip().lower(): v for k, v in (columns or {}).items()}, period)


def parse_messages(text: str, source: str = "text") -> MessageSet:
    """Read a message set from text, as an editor holds it."""
    return _from_sheet(parse_sheet(text, source))


def text_of(messages: MessageSet) -> str:
    """Return a message set as the text of a CSV file, every time to the nanosecond."""
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(COLUMNS)
    for message in messages:
        times = (
            f"{Decimal(nanoseconds(getattr(message, time))).scaleb(-6).normalize():f}"
            for time in TIMES
        )
        writer.writerow(
            [message.name, f"{message.arbitration_id:#x}", message.dlc, *times,
             "yes" if message.extended else "no", message.sender, message.bits]
        )  # fmt: skip
    return stream.getvalue()


def to_table(messages: MessageSet) -> pd.DataFrame:
    """Return a message set as a table indexed by name, times in ms; `bits` is NA if not given."""
    import pandas as pd

    columns: dict[str, list[Any]] = {}
    for column in COLUMNS[1:]:
        time = column.removesuffix("_ms")
        values = [getattr(message, time) for message in messages]
        # From whole nanoseconds 2.5 ms stay 2.5.
        columns[column] = [nanoseconds(t) / 1e6 for t in values] if time in TIMES else values
    index = pd.Index(messages.names, name="name", dtype=object)
    return pd.DataFrame(columns, index=index).astype({"bits": "Int64", "sender": object})


def from_table(table: pd.DataFrame) -> MessageSet:
    """Make a message set of a table, or raise an ArgumentError with all that is wrong with it."""
    if table.index.name == "name" and "name" not in table:
        table = table.reset_index()
    columns = [str(column) for column in table.columns]
    cells = table.astype(object).where(table.notna(), "")
    rows = (
        (f"row {label}", {c: str(v).strip() for c, v in zip(columns, row, strict=True)})
        for label, row in zip(table.index, cells.itertuples(index=False, name=None), strict=True)
    )
    try:
        return _message_set("table", columns, rows)
    except InputError as error:
        raise ArgumentError(str(error)) from None


def load_extra(module: str, package: str) -> Any:
    """Return an optional module, or say which package to install for it."""
    try:
        return import_module(module)
    except ModuleNotFoundError as problem:
        if problem.name != module:
            raise
        raise ImportError(
            f'{package} is not installed; this installs it: python -m pip install "shipnet[bus]"'
        ) from None


def parse_dbc(text: str, source: str, period: float | None = None) -> MessageSet:
    """Read the messages of the text of a DBC file through cantools."""
    cantools = load_extra("cantools", "cantools")
    try:
        database = cantools.database.load_string(text, database_format="dbc", strict=False)
    except (cantools.database.Error, UnicodeError, ValueError) as problem:
        why = " ".join(str(problem).split())
        raise InputError(source, f"is not a DBC file: {why}") from None
    messages, faults = [], []
    for found in database.messages:
        # cantools keeps senders of messages that are not sent as Vector__XXX.
        sender = found.senders[0] if found.senders else ""
        cycle = found.cycle_time / 1e3 if found.cycle_time else period
        if cycle is None:
            faults.append(f"message {found.name!r} has no cycle time; give one with period=")
            continue
        try:
            messages.append(
                Message(
                    found.name, found.frame_id, found.length, cycle,
                    extended=found.is_extended_frame, sender=sender,
                )
            )  # fmt: skip
        except ArgumentError as fault:
            faults.append(f"message {found.name!r}: {fault}")
    faults += [f"message {messages[place].name!r}: {why}" for place, why in set_faults(messages)]
    if not messages and not faults:
        faults = ["has no message"]
    if faults:
        raise InputError(source, *faults)
    return MessageSet(messages)


def _from_sheet(
    sheet: Sheet, renamed: Mapping[str, str] | None = None, period: float | None = None
) -> MessageSet:
    titles = [title.lower() for title in sheet.titles]
    missing = sorted(set(renamed or {}) - set(titles))
    if missing:
        raise InputError(
            sheet.source, f"no column {missing[0]!r}; the titles are {', '.join(titles)}"
        )
    columns = [(renamed or {}).get(title, title) for title in titles]
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
    return _message_set(sheet.source, columns, cells, long, period)


def _message_set(
    source: str,
    columns: list[str],
    rows: Iterable[tuple[str, Mapping[str, str]]],
    found: Iterable[str] = (),
    period: float | None = None,
) -> MessageSet:
    """Make the set of cells of text, or raise all that is wrong with them."""
    if period is not None and "period_ms" not in columns:
        columns = [*columns, "period_ms"]
    faults = [
        f"column {place}: title {title!r} is unknown; expected one of {', '.join(COLUMNS)}, note"
        for place, title in enumerate(columns, start=1)
        if title not in (*COLUMNS, "note")
    ]
    twice = sorted({title for title in columns if columns.count(title) > 1})
    faults += [f"title {title!r} appears twice" for title in twice]
    faults += [f"no column {title}" for title in _NEEDED if title not in columns]
    if faults:
        raise InputError(source, *faults)
    faults += found
    messages, places = [], []
    for place, cells in rows:
        if period is not None and not cells.get("period_ms"):
            cells = {**cells, "period_ms": f"{Decimal(nanoseconds(period)).scaleb(-6):f}"}
        message, wrong = _message(cells)
        faults += [f"{place}, {fault}" for fault in wrong]
        if message is not None:
            messages.append(message)
            places.append(place)
    faults += [f"{places[number]}: {fault}" for number, fault in set_faults(messages)]
    if not messages and not faults:
        faults = ["has no message; expected one row per message"]
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
    **{
        f"{name}_ms": _time(kind.low, kind.high)
        for name, kind in declared(Message).items()
        if isinstance(kind, Number)
    },
    "extended": (_yes, "yes or no"),
    "sender": (_text, "printable text"),
    "bits": _whole(47, 160),
}
