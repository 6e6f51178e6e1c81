"""The messages of a bus: what each is, which goes first, how much they load it, and their files.

    name,arbitration_id,extended,dlc,period_ms,deadline_ms,jitter_ms,offset_ms,sender,bits
    oil pressure,0x120,no,8,100,50,0.5,,JB1,

In a file an identifier is decimal, or hexadecimal after 0x. An empty `deadline_ms` is the period,
`jitter_ms` and `offset_ms` are 0, `extended` is no, `bits` follows from the data bytes. Columns
may come in any order; those with a default may be left out. `note` is for remarks, which are not
kept. Titles as yards write them are known too: `Message`, `CAN-ID (hex)`, `Cycle time [s]`.
"""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from decimal import Decimal
from os import PathLike
from pathlib import Path
from typing import Any, Literal, NamedTuple, TypeVar, overload

import numpy as np
import numpy.typing as npt

from shipnet import datasets
from shipnet.arguments import checked
from shipnet.arrays import Floats, Indices
from shipnet.can.frame import check_bit_rate, highest_id
from shipnet.can.lengths import Stuffing, length_table
from shipnet.clock import nanoseconds
from shipnet.errors import ArgumentError, InputError, load_extra
from shipnet.fields import (
    Kind,
    Number,
    Switch,
    Whole,
    check_whole,
    declared,
    number,
    record,
    switch,
    text,
    whole,
)
from shipnet.lazy import pd
from shipnet.tables import (
    NUMBER,
    Sheet,
    frame_sheet,
    parse_sheet,
    read_bytes,
    read_sheet,
    text_of,
)

T = TypeVar("T")

#: Bit rates in use [bit/s], with bus lengths from 5000 m down to 20 m: Beckhoff, BX5100
#: documentation.
BIT_RATES = (10_000, 20_000, 50_000, 125_000, 250_000, 500_000, 1_000_000)

#: The times of a message.
TIMES = ("period", "deadline", "jitter", "offset")


@record(slots=True)
class Message:
    """A message that is sent again and again; its times are kept to the nanosecond.

    Examples
    --------
    >>> oil = Message("oil pressure", 0x120, 8, period=0.1)
    >>> oil.deadline, oil.frame_time(125e3)
    (0.1, 0.00108)
    """

    name: str = text("What it is called; printable text", most=1000)
    arbitration_id: int = whole(
        0, 2**29 - 1, "", "Identifier, up to 0x7FF unless `extended`; the lower goes first"
    )
    dlc: int = whole(0, 8, "", "Data bytes")
    period: float = number(
        1e-6, 1e5, "s", "Shortest time from one event that causes the message to the next"
    )
    deadline: float = number(
        1e-6, 1e5, "s",
        "Longest time from the event to its arrival; the period by default. It may be longer "
        "than the period", default=None, optional=True,
    )  # fmt: skip
    jitter: float = number(
        0, 1e5, "s", "Longest time from the event until the message is queued for sending",
        default=0.0,
    )  # fmt: skip
    offset: float = number(
        0, 1e5, "s",
        "Time of the first event in a simulation; the analysis does without it, because no two "
        "nodes share a clock", default=0.0,
    )  # fmt: skip
    extended: bool = switch("Whether the identifier has 29 bits", default=False)
    sender: str = text("Node that sends it", default="", most=1000)
    bits: int | None = whole(
        47, 160, "bit", "Length of the frame with intermission, if known better than by `dlc`",
        default=None, optional=True,
    )  # fmt: skip

    def __post_init__(self) -> None:
        for field, value in (("name", self.name), ("sender", self.sender)):
            if not value.isprintable() or value != value.strip():
                raise ArgumentError(f"{field} is {value!r}; it must be printable text")
        if not self.name:
            raise ArgumentError("name is '', empty; a message needs one")
        if not self.extended:
            check_whole("arbitration_id", self.arbitration_id, 0, highest_id(False))
        if self.deadline is None:
            object.__setattr__(self, "deadline", self.period)
        for field in TIMES:
            given = getattr(self, field)
            if given and (rounded := nanoseconds(given) / 1e9) != given:
                object.__setattr__(self, field, rounded)

    @property
    def priority(self) -> tuple[int, bool, int]:
        """What arbitration compares; the smaller wins.

        The first 11 bits of an identifier come first. A standard frame wins over an extended one
        that begins like it, because its RTR bit is dominant where the other sends SRR.
        """
        if not self.extended:
            return self.arbitration_id, False, 0
        return self.arbitration_id >> 18, True, self.arbitration_id & 0x3FFFF

    def frame_length(self, stuffing: Stuffing = "worst") -> float:
        """Return the length of its frame, intermission included [bit]."""
        return self.bits or length_table(stuffing)[self.extended][self.dlc]

    def frame_time(self, bit_rate: float, stuffing: Stuffing = "worst") -> float:
        """Return how long its frame keeps the bus busy, intermission included [s]."""
        return self.frame_length(stuffing) / check_bit_rate(bit_rate)


#: What each field of a message declares, and the columns of a table; the first four must be there.
_KINDS = declared(Message)
COLUMNS = tuple(f"{field}_ms" if field in TIMES else field for field in _KINDS)
_NEEDED = COLUMNS[:4]

#: Other titles of columns, without unit and signs.
_TITLES = {
    "name": "message messagename msg msgname framename",
    "arbitration_id": "id canid canidentifier identifier messageid msgid frameid cobid",
    "dlc": "length len bytes databytes datalength datalengthcode size",
    "period": "cycle cycletime repetition repetitiontime interval sendinterval periodicity",
    "deadline": "maxlatency latency maxdelay maxage",
    "jitter": "releasejitter queuingjitter queueingjitter",
    "offset": "startoffset startdelay phase",
    "extended": "ext extendedid 29bit ide",
    "sender": "node sendernode transmitter txnode ecu source station",
    "bits": "framelength framebits",
    "note": "notes remark remarks comment comments description no nr item pos receiver receivers "
    "receivingnode rx rxnode direction dir signal signals content contents system type sendtype "
    "messagetype bus channel network priority prio pgn revision rev status",
}  # fmt: skip
_SYNONYMS = {other: column for column, others in _TITLES.items() for other in others.split()}

#: A title and its unit, in brackets or behind a sign; what makes milliseconds of each unit.
_UNIT = re.compile(
    r"(.*?)[\s_]*(?:[\[(]|[\s_]|,|/|\bin\b)\s*(ms|s|us|\xb5s|hex|dec)\s*[\])]?", re.I
)
_LONGEST = 100  #: No title is longer; the pattern takes long for some that are.
_POWERS = {"ms": 0, "s": 3, "us": -3, "\xb5s": -3}

_WHOLE = re.compile(r"[0-9]{1,12}(\.0)?|0[xX][0-9a-fA-F]{1,8}")
_YES = {"yes": True, "true": True, "1": True, "no": False, "false": False, "0": False}


def set_faults(messages: Iterable[Message]) -> list[tuple[int, str]]:
    """Return the places of messages whose name or identifier is already taken, and why."""
    names: set[str] = set()
    taken: dict[tuple[int, bool, int], str] = {}
    faults = []
    for place, message in enumerate(messages):
        if message.name in names:
            faults.append((place, f"name {message.name!r} is taken"))
        priority = message.priority
        if priority in taken:
            identifier = f"arbitration_id {message.arbitration_id:#x} of {message.name!r}"
            faults.append((place, f"{identifier} is taken by {taken[priority]!r}"))
        names.add(message.name)
        taken.setdefault(priority, message.name)
    return faults


class Named(Sequence[T]):
    """A sequence whose items are also found by their names."""

    __slots__ = ()
    _items: tuple[T, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the items, in their order."""
        raise NotImplementedError

    def _place(self, name: str) -> int:
        """Return the place of an item, or raise if there is none of the name."""
        if name not in self.names:
            raise ArgumentError(f"name is {name!r}; the messages are {', '.join(self.names)}")
        return self.names.index(name)

    def __len__(self) -> int:
        return len(self._items)

    def __iter__(self) -> Iterator[T]:
        return iter(self._items)

    @overload
    def __getitem__(self, key: int | str) -> T: ...
    @overload
    def __getitem__(self, key: slice) -> tuple[T, ...]: ...
    def __getitem__(self, key: int | str | slice) -> T | tuple[T, ...]:
        """Return an item by its place or its name, or some by a slice."""
        return self._items[self._place(key) if isinstance(key, str) else key]


@checked
class MessageSet(Named[Message]):
    """The messages of one bus, the highest priority first.

    Parameters
    ----------
    messages : iterable of Message
        In any order; names and identifiers must differ.
    overlooked : iterable of str, optional
        Faults of the file that the set was read from, with `strict` switched off.

    Raises
    ------
    ArgumentError
        If it holds anything but messages, or two have the same name or identifier; the error
        names all of them.

    Examples
    --------
    >>> messages = MessageSet([Message("slow", 0x300, 8, 1.0), Message("fast", 0x100, 2, 0.01)])
    >>> messages
    MessageSet(2 messages: fast, slow)
    >>> messages["slow"].period
    1.0
    >>> messages.replace("slow", dlc=4).table()["dlc"].to_dict()
    {'fast': 2, 'slow': 4}
    """

    __slots__ = ("_items", "overlooked")

    def __init__(self, messages: Iterable[Message], *, overlooked: Iterable[str] = ()) -> None:
        self.overlooked = tuple(overlooked)
        given = list(messages)
        others = [item for item in given if not isinstance(item, Message)]
        if others:
            raise ArgumentError(f"one of messages is {others[0]!r}; it must be a Message")
        faults = set_faults(given)
        if faults:
            raise ArgumentError("; ".join(fault for _, fault in faults))
        self._items = tuple(sorted(given, key=lambda message: message.priority))

    @property
    def names(self) -> tuple[str, ...]:
        """Names in order of priority."""
        return tuple(message.name for message in self._items)

    @property
    def periods(self) -> Floats:
        """Periods in order of priority [s]."""
        return np.array([message.period for message in self._items], dtype=np.float64)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, MessageSet) and self._items == other._items

    def __hash__(self) -> int:
        return hash(self._items)

    def __repr__(self) -> str:
        faults = f"; {len(self.overlooked)} faults overlooked" if self.overlooked else ""
        return f"MessageSet({counted(self.names)}{faults})"

    def replace(self, name: str, **new: Any) -> MessageSet:
        """Return the set with some fields of one message replaced.

        A deadline equal to the period follows a new period.
        """
        place = self._place(name)
        known = Message.__dataclass_fields__
        unknown = [field for field in new if field not in known]
        if unknown:
            raise ArgumentError(f"{unknown[0]!r} is not a field; a message has {', '.join(known)}")
        if "period" in new and "deadline" not in new and self[name].deadline == self[name].period:
            new["deadline"] = None
        changed = replace(self[name], **new)
        return MessageSet([*self[:place], changed, *self[place + 1 :]])

    def ordered(self, names: Iterable[str]) -> MessageSet:
        """Return the same messages in another order of priority, all named, the highest first.

        The identifiers of the set are shared out anew. Where some have 11 and some 29 bits, the
        first 11 bits count up from 0 instead.
        """
        order = list(names)
        if sorted(order) != sorted(self.names):
            raise ArgumentError(f"names are {order}; they must be {', '.join(self.names)}, once")
        moved = [self[name] for name in order]
        new = [message.arbitration_id for message in self._items]
        if len({message.extended for message in moved}) > 1:
            new = [place << 18 * message.extended for place, message in enumerate(moved)]
        return MessageSet(
            replace(message, arbitration_id=identifier)
            for message, identifier in zip(moved, new, strict=True)
        )

    def deadline_monotonic(self, *, less_jitter: bool = False) -> MessageSet:
        """Return the same messages in the order of their deadlines, the shortest first.

        With `less_jitter` the order is that of deadline less jitter, the time left on the bus.
        """
        order = sorted(self, key=lambda m: m.deadline - (m.jitter if less_jitter else 0))
        return self.ordered(message.name for message in order)

    def table(self) -> pd.DataFrame:
        """Return one row per message, indexed by name: its fields, times in ms."""
        columns: dict[str, list[Any]] = {}
        for column in COLUMNS[1:]:
            field = column.removesuffix("_ms")
            values = [getattr(message, field) for message in self]
            # From whole nanoseconds 2.5 ms stay 2.5.
            columns[column] = [nanoseconds(t) / 1e6 for t in values] if field in TIMES else values
        index = pd.Index(self.names, name="name", dtype=object)
        return pd.DataFrame(columns, index=index).astype({"bits": "Int64", "sender": object})

    @classmethod
    def from_table(cls, table: pd.DataFrame) -> MessageSet:
        """Return the set that a table describes, with the columns of `table` or some of them.

        A missing value takes its default. All the faults of a table are raised at once.
        """
        if table.index.name == "name" and "name" not in table:
            table = table.reset_index()
        try:
            return _from_sheet(frame_sheet(table), {}, None)
        except InputError as error:
            raise ArgumentError(str(error)) from None

    @classmethod
    def parse(cls, text: str, source: str = "text") -> MessageSet:
        """Return the set that a text describes, written as a CSV file for `read_messages`."""
        return _from_sheet(parse_sheet(text, source, is_titles=_is_titles), {}, None)

    @property
    def text(self) -> str:
        """The set as the text of a CSV file, every time to the nanosecond."""
        stream = io.StringIO()
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(COLUMNS)
        for message in self:
            times = (_milliseconds(getattr(message, time)) for time in TIMES)
            writer.writerow(
                [message.name, f"{message.arbitration_id:#x}", message.dlc, *times,
                 "yes" if message.extended else "no", message.sender, message.bits]
            )  # fmt: skip
        return stream.getvalue()

    def save(self, path: str | PathLike[str]) -> None:
        """Write a CSV file from which `read_messages` makes the same set.

        Its suffix must not be that of another format: a DBC file would lose its signals.
        """
        if (suffix := Path(path).suffix.lower()) in (".dbc", ".xls", ".xlsm", ".xlsx"):
            raise ArgumentError(
                f"path is {str(path)!r}; a CSV file has not the suffix {suffix}; to write a DBC "
                "file, use cantools"
            )
        Path(path).write_text(self.text, encoding="utf-8", newline="")


def counted(names: Sequence[str]) -> str:
    """Return how many messages there are, and the names of the first."""
    some = ", ".join(names[:3]) + (", ..." if len(names) > 3 else "")
    return f"{len(names)} message{'s' if len(names) != 1 else ''}{': ' if some else ''}{some}"


@overload
def bus_load(messages: MessageSet, bit_rate: float, stuffing: Stuffing = ...) -> float: ...
@overload
def bus_load(
    messages: MessageSet, bit_rate: npt.ArrayLike, stuffing: Stuffing = ...
) -> float | Floats: ...
@checked
def bus_load(
    messages: MessageSet, bit_rate: npt.ArrayLike, stuffing: Stuffing = "worst"
) -> float | Floats:
    r"""Return the share of the time that messages keep the bus busy.

    .. math:: U = \sum_m \frac{L_m}{T_m f_{bit}}

    Parameters
    ----------
    messages : MessageSet
        The messages; the length of one with ``bits`` of its own is that.
    bit_rate : float or array_like of float
        Bit rate, 1000..1000000 [bit/s].
    stuffing : {"none", "mean", "attainable", "worst", "worst 1994"}, default "worst"
        Which stuff bits count, as in `frame_length`.

    Returns
    -------
    float or ndarray of float
        Load, 1 for a bus that is always busy; an array of the shape of `bit_rate`. What each
        message contributes is in ``response_times(...).table()``.

    Raises
    ------
    ArgumentError
        If a bit rate is out of range, or `stuffing` is unknown.

    Examples
    --------
    >>> messages = MessageSet([Message("A", 1, 8, 5e-3), Message("B", 2, 8, 10e-3)])
    >>> round(bus_load(messages, 125e3), 3)
    0.324
    >>> bus_load(messages, [125e3, 250e3]).round(3).tolist()
    [0.324, 0.162]
    """
    rate = np.asarray(bit_rate)
    if rate.dtype.kind not in "iuf" or not ((rate >= 1000) & (rate <= 1e6)).all():
        raise ArgumentError(f"bit_rate is {bit_rate!r}; it must be 1000..1000000 bit/s")
    bits = message_lengths(messages, stuffing)
    load = (bits / messages.periods / rate[..., np.newaxis]).sum(axis=-1)
    return float(load) if rate.ndim == 0 else np.asarray(load)


def message_lengths(messages: MessageSet, stuffing: Stuffing = "worst") -> Floats:
    """Return the length of the frame of each message, intermission included [bit]."""
    table = length_table(stuffing)
    return np.array([m.bits or table[m.extended][m.dlc] for m in messages], dtype=np.float64)


def packed(analogue: npt.ArrayLike, bits: int = 16) -> tuple[Indices, int]:
    """Return the first bit of each point in the data of a station, and how many bytes they fill.

    Analogue values come first, `bits` each, filled up to a whole byte; then the states, one bit
    each. The data are sent in frames of eight bytes.
    """
    analogue = np.asarray(analogue, dtype=bool)
    values, states = np.cumsum(analogue) - 1, np.cumsum(~analogue) - 1
    start = -(-int(analogue.sum()) * bits // 8)
    first = np.where(analogue, bits * values, 8 * start + states)
    return np.asarray(first, dtype=np.intp), start + -(-int((~analogue).sum()) // 8)


# Files -----------------------------------------------------------------------------------------

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


@checked
def example(name: Literal["engine", "lee2012"] = "engine") -> MessageSet:
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
        return MessageSet.parse(EXAMPLE)
    return read_list(Path(datasets.path("synthetic_can_lee2012.csv")), None, None, True)


def read_list(
    path: Path, columns: Mapping[str, str] | None, period: float | None, strict: bool
) -> MessageSet:
    """Return the set that a CSV file, an Excel workbook or a DBC file describes."""
    if path.suffix.lower() == ".dbc":
        return parse_dbc(text_of(read_bytes(path)), str(path), period, strict)
    sheet = read_sheet(path, is_titles=_is_titles)
    return _from_sheet(sheet, {k.strip().lower(): v for k, v in (columns or {}).items()}, period)


def parse_dbc(
    text: str, source: str, period: float | None = None, strict: bool = True
) -> MessageSet:
    """Read the messages of the text of a DBC file through cantools."""
    cantools = load_extra("cantools", "cantools")
    try:
        database = cantools.database.load_string(text, database_format="dbc", strict=False)
    # cantools raises whatever its parsing meets.
    except Exception as problem:
        raise InputError(source, f"is not a DBC file: {said(problem)}") from None
    messages, faults, overlooked = [], [], []
    for found in database.messages:
        place = f"message {found.name!r}"
        try:
            found.refresh(strict=True)
        except Exception as problem:
            overlooked.append(f"{place}: {said(problem)}")
        try:
            message = Message(
                found.name, found.frame_id, found.length, _cycle_time(found.cycle_time, period),
                # cantools keeps senders of messages that are not sent as Vector__XXX.
                extended=found.is_extended_frame, sender=found.senders[0] if found.senders else "",
            )  # fmt: skip
        except ArgumentError as fault:
            faults.append(f"{place}{'' if str(fault).startswith('has ') else ':'} {fault}")
        else:
            messages.append((place, message))
    if strict:
        faults += [f"{fault}; strict=False reads the message" for fault in overlooked]
        return _checked(source, messages, faults, "has no message")
    twice = dict(set_faults(message for _, message in messages))
    faults += [f"{messages[number][0]}: {why}" for number, why in twice.items()]
    kept = [found for number, found in enumerate(messages) if number not in twice]
    if not kept:
        return _checked(source, [], faults, "has no message")
    return MessageSet((message for _, message in kept), overlooked=[*overlooked, *faults])


def _cycle_time(given: object, period: float | None) -> float:
    """Return a cycle time of a DBC file in seconds, or the period if it has none."""
    try:
        cycle = float(str(given or 0)) / 1e3
    except ValueError:
        raise ArgumentError(f"cycle time is {given!r}; it must be a number of ms") from None
    if cycle:
        return cycle
    if period is None:
        raise ArgumentError("has no cycle time; give one with period=")
    return period


def said(problem: Exception) -> str:
    """Return what an exception says, in one line."""
    text = " ".join(str(problem).split())
    return (text if len(text) <= 150 else text[:147] + "...") or type(problem).__name__


def _is_titles(cells: Sequence[str]) -> int:
    """Return how well cells serve as titles: above them there may be a heading, or comments."""
    if not any(cells) or cells[0].startswith("#"):
        return 0
    return 1 + sum(_Title.of(cell.lower()).column in (*COLUMNS, *TIMES) for cell in cells)


def _from_sheet(sheet: Sheet, renamed: Mapping[str, str], period: float | None) -> MessageSet:
    """Make the set of a sheet, or raise all that is wrong with it."""
    titles = [title.lower() for title in sheet.titles]
    if missing := sorted(set(renamed) - set(titles)):
        raise InputError(
            sheet.source, f"no column {missing[0]!r}; the titles are {', '.join(titles)}"
        )
    read = [_Title.of(renamed.get(title, title)) for title in titles]
    columns = [title.column for title in read]
    usual = {} if period is None else {"period_ms": _milliseconds(period)}
    faults = []
    legal = ", ".join(COLUMNS)
    for at, (column, title) in enumerate(zip(columns, titles, strict=True), start=1):
        if column in TIMES:
            unit = f"expected such as {column}_ms or {column} [s]"
            faults.append(f"column {at}: title {title!r} has no unit; {unit}")
        elif column not in (*COLUMNS, "note"):
            faults.append(
                f"column {at}: title {title!r} is unknown; expected one of {legal}, or "
                "note for a column to leave out"
            )
    twice = sorted({title for title in columns if columns.count(title) > 1 and title != "note"})
    faults += [f"title {title!r} appears twice" for title in twice]
    faults += [f"no column {title}" for title in _NEEDED if title not in (*columns, *usual)]
    if faults:
        raise InputError(sheet.source, *faults)
    messages, width = [], len(columns)
    for line, row in sheet.rows:
        place = f"row {line}"
        if any(row[width:]):
            faults.append(f"{place} has {len(row)} cells; expected {width}")
            continue
        filled = {
            title.column: title.plain(cell) for title, cell in zip(read, row, strict=False) if cell
        }
        number = filled.get("arbitration_id", "")
        if "extended" not in columns and _WHOLE.fullmatch(number):
            long = len(number) == 10 or _whole(number) > 0xFFFF
            filled["extended"] = "yes" if long else "no"
        message, wrong = _message(usual | filled)
        faults += [f"{place}, {fault}" for fault in wrong]
        if message is not None:
            messages.append((place, message))
    return _checked(sheet.source, messages, faults, "has no message; expected one row per message")


class _Title(NamedTuple):
    """Which column a title means, and how to read the cells below it."""

    column: str
    power: int = 0
    hexadecimal: bool = False

    @classmethod
    def of(cls, title: str) -> _Title:
        """Return what a title in small letters means; one that is unknown means itself."""
        if title in COLUMNS:
            return cls(title)
        match = _UNIT.fullmatch(title) if len(title) < _LONGEST else None
        words, unit = (match[1], match[2]) if match else (title, "")
        plain = re.sub(r"[\W_]", "", words)
        plain = _SYNONYMS.get(plain, plain.replace("arbitrationid", "arbitration_id"))
        if plain in TIMES:
            return cls(f"{plain}_ms" if unit in _POWERS else plain, _POWERS.get(unit, 0))
        return cls(plain if plain in (*COLUMNS, "note") else title, 0, unit == "hex")

    def plain(self, cell: str) -> str:
        """Return a cell as it would be below the plain name of the column."""
        if self.power and NUMBER.fullmatch(cell):
            return f"{Decimal(cell).scaleb(self.power):f}"
        if self.column == "arbitration_id":
            digits = cell.lower().removesuffix("h")
            if digits != cell.lower() or (self.hexadecimal and not digits.startswith("0x")):
                return "0x" + digits
        return cell


def _checked(
    source: str, found: list[tuple[str, Message]], faults: list[str], empty: str
) -> MessageSet:
    """Return the set of messages found at places of a file, or raise all that is wrong."""
    messages = [message for _, message in found]
    faults += [f"{found[number][0]}: {why}" for number, why in set_faults(messages)]
    if not messages and not faults:
        faults = [empty]
    if faults:
        raise InputError(source, *faults)
    return MessageSet(messages)


def _message(cells: Mapping[str, str]) -> tuple[Message | None, list[str]]:
    """Make a message of the cells that are filled, or say all that keeps it from being one."""
    faults = []
    fields: dict[str, Any] = {}
    for (field, kind), column in zip(_KINDS.items(), COLUMNS, strict=True):
        cell = cells.get(column, "")
        if cell:
            fields[field] = _value(kind, cell)
            if fields[field] is None:
                faults.append(f"column {column}: {cell!r}; expected {_legal(field, kind)}")
        elif column in _NEEDED:
            faults.append(f"column {column}: is empty; a message needs it")
    if not faults:
        try:
            return Message(**fields), []
        except ArgumentError as fault:
            faults.append(str(fault))
    return None, faults


def _value(kind: Kind, cell: str) -> Any:
    """Return the value of a cell as its field declares it, None if it has none."""
    if isinstance(kind, Number):
        time = float(Decimal(cell).scaleb(-3)) if NUMBER.fullmatch(cell) else -1
        return time if kind.low <= time <= kind.high else None
    if isinstance(kind, Whole):
        whole = _whole(cell) if _WHOLE.fullmatch(cell) else -1
        return whole if kind.low <= whole <= kind.high else None
    if isinstance(kind, Switch):
        return _YES.get(cell.lower())
    return cell if cell.isprintable() else None


def _whole(cell: str) -> int:
    """Return a whole number as tables have it: decimal, also with zeros in front, or with 0x."""
    return int(cell.removesuffix(".0"), 16 if cell[:2] in ("0x", "0X") else 10)


def _legal(field: str, kind: Kind) -> str:
    """Return in words what a cell may hold."""
    if field == "arbitration_id":
        return "an identifier 0..0x7FF, or 0x1FFFFFFF if extended"
    if isinstance(kind, Number):
        return f"a number {kind.low * 1e3:g}..{kind.high * 1e3:g} ms"
    if isinstance(kind, Whole):
        return f"a whole number {kind.legal}"
    return "yes or no" if isinstance(kind, Switch) else "printable text"


def _milliseconds(time: float) -> str:
    """Return a time in seconds as decimal milliseconds, to the nanosecond."""
    return f"{Decimal(nanoseconds(time)).scaleb(-6).normalize():f}"
