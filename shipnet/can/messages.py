"""Messages of a bus: their priorities, load and files.

A table has the columns `COLUMNS` in any order. Other common titles such as ``CAN-ID (hex)`` are
recognised; other columns are not used, as a remark says. Identifiers are decimal, or hexadecimal
with 0x.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from decimal import Decimal
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import Any, Literal, TypeVar, overload

import numpy as np
import numpy.typing as npt

from shipnet import datasets, tables
from shipnet.arrays import Floats, Indices, Integers
from shipnet.can.frame import check_bit_rate, hexadecimal, highest_id
from shipnet.can.j1939 import TP_DT, TRANSPORTS, frame_count, id_columns
from shipnet.can.lengths import Stuffing, length_table
from shipnet.clock import nanoseconds
from shipnet.errors import ArgumentError, InputError
from shipnet.fields import (
    Number,
    Switch,
    Whole,
    check_choice,
    check_fields,
    check_whole,
    choice,
    declared,
    number,
    record,
    switch,
    text,
    whole,
)
from shipnet.html import as_html
from shipnet.lazy import pd
from shipnet.lists import Cells, Words, widened
from shipnet.signals import plain
from shipnet.tables import Sheet, csv_text, parse_sheet, read_sheet

T = TypeVar("T")

#: Common bit rates [bit/s], from Beckhoff's documentation of the BX5100.
BIT_RATES = (10_000, 20_000, 50_000, 125_000, 250_000, 500_000, 1_000_000)

TIMES = ("period", "deadline", "jitter", "offset")  #: Fields of a message that are times.


@record(slots=True)
class Message:
    """A periodic message; its times are stored to the nanosecond.

    Examples
    --------
    >>> oil = Message("oil pressure", 0x120, 8, period=0.1)
    >>> oil.deadline, oil.frame_time(125e3)
    (0.1, 0.00108)
    """

    name: str = text("Name; printable text", most=1000)
    arbitration_id: int = whole(
        0,
        2**29 - 1,
        "",
        "Identifier, up to 0x7FF unless `extended`; the lowest has the highest priority",
    )
    dlc: int = whole(0, 1785, "", "Number of data bytes; above 8 only with a `transport`")
    period: float = number(1e-6, 1e5, "s", "Shortest time between two events that trigger it")
    deadline: float = number(
        1e-6,
        1e5,
        "s",
        "Longest allowed time from the event to the end of the frame; the "
        "period by default. It may exceed the period",
        default=None,
        optional=True,
    )
    jitter: float = number(
        0, 1e5, "s", "Longest time from the event until the message is queued", default=0.0
    )
    offset: float = number(
        0,
        1e5,
        "s",
        "Time of the first event in a simulation; the analysis ignores it by "
        "default, because nodes do not share a clock",
        default=0.0,
    )
    extended: bool = switch("Whether the identifier has 29 bits", default=False)
    sender: str = text("Node that sends the message", default="", most=1000)
    bits: int | None = whole(
        47,
        160,
        "bit",
        "Length of the frame with intermission, if not calculated from `dlc`",
        default=None,
        optional=True,
    )
    transport: str = choice(
        TRANSPORTS,
        "How a message of NMEA 2000 (fast packet) or J1939 is sent in several frames",
        default="",
    )

    def __post_init__(self) -> None:
        check_fields(self)
        for field, value in (("name", self.name), ("sender", self.sender)):
            if not value.isprintable() or value != value.strip():
                raise ArgumentError(f"{field} is {value!r}; it must be printable text")
        if not self.name:
            raise ArgumentError("name is ''; a message needs a name")
        if not self.extended:
            check_whole("arbitration_id", self.arbitration_id, 0, highest_id(False))
        least, most = TRANSPORTS[self.transport]
        if not least <= self.dlc <= most:
            how = f"if transport is {self.transport!r}"
            raise ArgumentError(f"dlc is {self.dlc}; it must be {least}..{most} {how}")
        if self.transport and (self.bits or not self.extended):
            raise ArgumentError(f"transport is {self.transport!r}; it needs `extended`, not `bits`")
        if self.deadline is None:
            object.__setattr__(self, "deadline", self.period)
        for field in TIMES:
            time = getattr(self, field)
            if time and (rounded := nanoseconds(time) / 1e9) != time:
                object.__setattr__(self, field, rounded)

    @property
    def hex_id(self) -> str:
        """Identifier in hexadecimal, with 3 digits or, if `extended`, 8."""
        return hexadecimal(self.arbitration_id, self.extended)

    @property
    def priority(self) -> tuple[int, bool, int]:
        """Sort key for arbitration; the smallest key wins.

        The first 11 bits of the identifier are compared first. If they are equal, a standard frame
        wins: its RTR bit is dominant, but the SRR bit of an extended frame is recessive. The
        sessions of J1939 use the PGN of data transfer, with priority 7.
        """
        if not self.extended:
            return self.arbitration_id, False, 0
        number = 7 << 26 | TP_DT << 8 if self.session else self.arbitration_id
        return number >> 18, True, number & 0x3FFFF

    @property
    def session(self) -> bool:
        """True if its frames are those of a session of J1939, not its own."""
        return self.transport in ("BAM", "RTS/CTS")

    @property
    def frames(self) -> int:
        """Number of frames, including those with which the receiver of a session answers."""
        return frame_count(self.dlc, self.transport)

    def frame_length(self, stuffing: Stuffing = "worst") -> float:
        """Return the length of the frame or of all frames, with intermission [bit]."""
        if self.transport:
            return self.frames * length_table(stuffing)[True][8]
        return self.bits or length_table(stuffing)[self.extended][self.dlc]

    def frame_time(self, bit_rate: float) -> float:
        """Return the duration of the longest frame (or all frames) and its intermission [s]."""
        return self.frame_length() / check_bit_rate(bit_rate)


#: Kind of each field of a message, and the columns of a table; the first four are required.
_KINDS = declared(Message)
COLUMNS = tuple(f"{field}_ms" if field in TIMES else field for field in _KINDS)
_NEEDED = COLUMNS[:4]
_WHAT = f"titles of messages (at least {', '.join(_NEEDED)})"

#: Column titles, without spaces or punctuation. A time needs a unit, such as ``period_ms``.
_TITLES = {
    "name": "name message messagename msg msgname framename",
    "arbitration_id": "arbitrationid id canid canidentifier identifier messageid msgid frameid "
    "cobid",
    "dlc": "dlc length len bytes databytes datalength datalengthcode size",
    "period_ms": "period cycle cycletime repetition repetitiontime interval sendinterval "
    "periodicity",
    "deadline_ms": "deadline maxlatency latency maxdelay maxage",
    "jitter_ms": "jitter releasejitter queuingjitter queueingjitter",
    "offset_ms": "offset startoffset startdelay phase",
    "extended": "extended ext extendedid 29bit stdext extstd ide format frameformat idtype",
    "sender": "sender node sendernode transmitter txnode ecu source station",
    "bits": "bits framelength framebits",
    "transport": "transport transportprotocol",
    "note": "note notes remark remarks comment comments description no nr item pos receiver "
    "receivers receivingnode rx rxnode direction dir signal signals content contents system "
    "sendtype messagetype bus channel network priority prio pgn revision rev status",
}

_YES = dict.fromkeys("yes y x true 1 ext extended 29 29bit".split(), True) | dict.fromkeys(
    "no n false 0 std standard 11 11bit".split(), False
)


class _Messages(Cells):
    """The cells of a list of messages."""

    words = Words(
        {plain(word): column for column, all_ in _TITLES.items() for word in all_.split()},
        dict.fromkeys((f"{time}_ms" for time in TIMES), "ms")
        | {"arbitration_id": "dec", "dlc": "byte", "bits": "bit"},
    )
    noun, key = "message", "name"
    titled_by = frozenset({"name", "arbitration_id"})
    needs_unit = frozenset(f"{time}_ms" for time in TIMES)
    hint = "columns= or --column TITLE=NAME may define them"

    def __init__(self, sheet: Sheet, assigned: Mapping[str, str], period: float | None) -> None:
        self.needed = _NEEDED if period is None else _NEEDED[:3]
        super().__init__(sheet, tuple(assigned.items()), is_saved=sheet.titles == COLUMNS)

    def column_faults(self) -> list[str]:
        """Return which of the required columns are missing."""
        return [f"no column {name}" for name in self.needed if name not in self.places]

    def is_entry(self, cell: Callable[[str], str]) -> bool:
        """Return whether a row has an identifier, a length or a period."""
        return any(map(cell, _NEEDED[1:]))


def set_faults(messages: Iterable[Message]) -> list[tuple[int, str]]:
    """Return the indices of messages whose name or identifier is already taken, with the reason."""
    names: set[str] = set()
    taken: dict[tuple[int, bool], str] = {}
    faults = []
    for index, message in enumerate(messages):
        if message.name in names:
            faults.append((index, f"name {message.name!r} is taken"))
        key = message.arbitration_id, message.extended
        if key in taken:
            identifier = f"arbitration_id {message.hex_id} of {message.name!r}"
            faults.append((index, f"{identifier} is taken by {taken[key]!r}"))
        names.add(message.name)
        taken.setdefault(key, message.name)
    return faults


class Named(Sequence[T]):
    """A sequence whose items can also be accessed by name."""

    __slots__ = ()
    _items: tuple[T, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the items, in the order of the sequence."""
        raise NotImplementedError

    def _index(self, name: str) -> int:
        """Return the index of an item by its name."""
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
        """Return an item by index or name, or several by a slice."""
        return self._items[self._index(key) if isinstance(key, str) else key]


class MessageSet(Named[Message]):
    """The messages of one bus, highest priority first.

    Parameters
    ----------
    messages : iterable of Message
        The messages in any order; names and identifiers must be unique.
    overlooked : iterable of str, optional
        Faults that were ignored when the file was read.
    observed : DataFrame, optional
        The pattern of each message in the log from which the set was read, as described in the
        notes of `read_messages`, indexed by ``name``; None for other sets.
    any_source : iterable of str, optional
        Names of the J1939 messages, which `compare` recognises by their PGN from any source.
    remarks : iterable of str, optional
        Remarks on rows and columns of the file that were not used, filled in or assumed.

    Examples
    --------
    >>> messages = MessageSet([Message("slow", 0x300, 8, 1.0), Message("fast", 0x100, 2, 0.01)])
    >>> messages
    MessageSet(2 messages: fast, slow)
    >>> messages.replace("slow", dlc=4).table()["dlc"].to_dict()
    {'fast': 2, 'slow': 4}
    """

    def __init__(
        self,
        messages: Iterable[Message],
        *,
        overlooked: Iterable[str] = (),
        observed: pd.DataFrame | None = None,
        any_source: Iterable[str] = (),
        remarks: Iterable[str] = (),
    ) -> None:
        self.overlooked = tuple(overlooked)
        self.observed = observed
        self.any_source = frozenset(any_source)
        self.remarks = tuple(remarks)
        items = list(messages)
        if faults := set_faults(items):
            raise ArgumentError("; ".join(fault for _, fault in faults))
        self._items = tuple(sorted(items, key=lambda one: (one.priority, one.arbitration_id)))
        self._lengths: dict[Stuffing, Floats] = {}

    @property
    def names(self) -> tuple[str, ...]:
        """Names in order of priority."""
        return tuple(message.name for message in self._items)

    @property
    def periods(self) -> Floats:
        """Periods in order of priority [s]."""
        periods: Floats = self.times[0] / 1e9
        return periods

    @cached_property
    def times(self) -> Integers:
        """Rows of the periods, deadlines, jitters and offsets in order of priority [ns]."""
        rows = [[getattr(message, time) for message in self._items] for time in TIMES]
        times = np.rint(np.array(rows) * 1e9).astype(np.int64)
        times.flags.writeable = False
        return times

    def lengths(self, stuffing: Stuffing = "worst") -> Floats:
        """Return the lengths of each message's frames in order of priority [bit]."""
        if stuffing not in self._lengths:
            lengths = np.array([m.frame_length(stuffing) for m in self._items], dtype=np.float64)
            lengths.flags.writeable = False
            self._lengths[stuffing] = lengths
        return self._lengths[stuffing]

    def __eq__(self, other: object) -> bool:
        return isinstance(other, MessageSet) and self._items == other._items

    def __hash__(self) -> int:
        return hash(self._items)

    def __repr__(self) -> str:
        faults = f"; {len(self.overlooked)} faults overlooked" if self.overlooked else ""
        remarks = f"; {'; '.join(self.remarks)}" if self.remarks else ""
        return f"MessageSet({counted(self.names)}{faults}{remarks})"

    _repr_html_ = as_html

    def replace(self, name: str, **new: Any) -> MessageSet:
        """Return a copy with some fields of one message replaced.

        If the deadline equals the period, a new period also becomes the deadline.
        """
        index = self._index(name)
        if "period" in new and "deadline" not in new and self[name].deadline == self[name].period:
            new["deadline"] = None
        changed = replace(self[name], **new)
        messages = [*self[:index], changed, *self[index + 1 :]]
        return MessageSet(messages, any_source=self.any_source)

    def ordered(self, names: Iterable[str]) -> MessageSet:
        """Return the messages with new priorities; `names` lists all names, highest priority first.

        The identifiers of the set are reassigned in this order. If the set has both 11-bit and
        29-bit identifiers, all messages get new identifiers, whose first 11 bits count up from 0.
        """
        order = list(names)
        if sorted(order) != sorted(self.names):
            raise ArgumentError(f"names are {order}; each must occur once: {', '.join(self.names)}")
        moved = [self[name] for name in order]
        new = [message.arbitration_id for message in self._items]
        if len({message.extended for message in moved}) > 1:
            new = [index << 18 * message.extended for index, message in enumerate(moved)]
        return MessageSet(
            replace(message, arbitration_id=identifier)
            for message, identifier in zip(moved, new, strict=True)
        )

    def deadline_monotonic(self) -> MessageSet:
        """Return the messages in deadline-monotonic priority order: shortest deadline first."""
        return self.ordered(m.name for m in sorted(self, key=lambda message: message.deadline))

    def table(self) -> pd.DataFrame:
        """Return one row per message, indexed by name: its fields, with times in ms.

        The parts of 29-bit identifiers in J1939, and ``transport``, are included if there are any.
        """
        columns: dict[str, list[Any]] = {}
        for column in COLUMNS[1:]:
            field = column.removesuffix("_ms")
            values = [getattr(message, field) for message in self]
            # Conversion from whole nanoseconds keeps 2.5 ms exact.
            columns[column] = [nanoseconds(t) / 1e6 for t in values] if field in TIMES else values
        if not any(columns["transport"]):
            del columns["transport"]
        columns = id_columns(columns["arbitration_id"], columns["extended"]) | columns
        columns["arbitration_id"] = [message.hex_id for message in self]
        index = pd.Index(self.names, name="name", dtype=object)
        return pd.DataFrame(columns, index=index).astype({"bits": "Int64", "sender": object})

    @classmethod
    def parse(cls, text: str) -> MessageSet:
        """Return the messages in CSV text of the form that `read_messages` accepts."""
        sheet = parse_sheet(text, "text", is_titles=_Messages.score(), what=_WHAT)
        return _from_sheet(sheet, {}, None)

    @property
    def text(self) -> str:
        """The set as CSV text, with times to the nanosecond."""
        return csv_text([COLUMNS, *self._rows])

    def save(self, path: str | PathLike[str]) -> None:
        """Write a CSV file or an Excel workbook that `read_messages` can read."""
        tables.save_table(path, pd.DataFrame(self._rows, columns=COLUMNS))

    @property
    def _rows(self) -> list[tuple[object, ...]]:
        return [
            (
                message.name,
                message.hex_id,
                message.dlc,
                # Decimal milliseconds, to the nanosecond.
                *(
                    f"{Decimal(nanoseconds(getattr(message, time))).scaleb(-6).normalize():f}"
                    for time in TIMES
                ),
                "yes" if message.extended else "no",
                message.sender,
                message.bits,
                message.transport,
            )
            for message in self
        ]


def counted(names: Sequence[str]) -> str:
    """Return the number of messages and the first three names as one string."""
    some = ", ".join(names[:3]) + (", ..." if len(names) > 3 else "")
    return f"{len(names)} message{'s' if len(names) != 1 else ''}{': ' if some else ''}{some}"


@overload
def bus_load(messages: MessageSet, bit_rate: float, stuffing: Stuffing = ...) -> float: ...
@overload
def bus_load(
    messages: MessageSet, bit_rate: npt.ArrayLike, stuffing: Stuffing = ...
) -> float | Floats: ...
def bus_load(
    messages: MessageSet, bit_rate: npt.ArrayLike, stuffing: Stuffing = "worst"
) -> float | Floats:
    r"""Return the bus load: the fraction of time during which messages occupy the bus.

    .. math:: U = \sum_m \frac{L_m}{T_m f_{bit}}

    Parameters
    ----------
    messages : MessageSet
        The messages.
    bit_rate : float or array_like of float
        Bit rate, 1000..1000000 [bit/s].
    stuffing : {"none", "mean", "attainable", "worst"}, default "worst"
        Which stuff bits count, as in `frame_length`. If a message has ``bits``, that is its length.

    Returns
    -------
    float or ndarray of float
        Load, 1 if the bus is always busy; an array if `bit_rate` is an array. The load per message
        is in ``response_times(...).table()``.

    Examples
    --------
    >>> messages = MessageSet([Message("A", 1, 8, 5e-3), Message("B", 2, 8, 10e-3)])
    >>> bus_load(messages, [125e3, 250e3]).round(3).tolist()
    [0.324, 0.162]
    """
    rate = np.asarray(bit_rate)
    if rate.dtype.kind not in "iuf" or not ((rate >= 1000) & (rate <= 1e6)).all():
        raise ArgumentError(f"bit_rate is {bit_rate!r}; it must be 1000..1000000 bit/s")
    bits = messages.lengths(stuffing)
    load = (bits / messages.periods / rate[..., np.newaxis]).sum(axis=-1)
    return float(load) if rate.ndim == 0 else np.asarray(load)


def packed(analogue: npt.ArrayLike, bits: int = 16) -> tuple[Indices, int]:
    """Return the position of each point's first bit in a station's data, and the number of bytes.

    Analogue values (`bits` bits each) come first, padded to a whole byte, then one bit per state.
    """
    analogue = np.asarray(analogue, dtype=bool)
    values, states = np.cumsum(analogue) - 1, np.cumsum(~analogue) - 1
    start = -(-int(analogue.sum()) * bits // 8)
    first = np.where(analogue, bits * values, 8 * start + states)
    return np.asarray(first, dtype=np.intp), start + -(-int((~analogue).sum()) // 8)


#: CSV text with synthetic messages of an engine's junction boxes and controls.
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


def example(name: Literal["engine", "lee2012"] = "engine") -> MessageSet:
    """Return an example message set.

    Parameters
    ----------
    name : {"engine", "lee2012"}, default "engine"
        ``"engine"``: ten synthetic messages of an engine's controls and junction boxes.
        ``"lee2012"``: the points of lee2012's engine, sent once per second with 16 bits each; the
        identifiers are ours.

    Returns
    -------
    MessageSet
        The messages.

    Examples
    --------
    >>> example()
    MessageSet(10 messages: shutdown, speed, fuel index, ...)
    """
    check_choice("name", name, ("engine", "lee2012"))
    if name == "engine":
        return MessageSet.parse(EXAMPLE)
    return read_list(Path(datasets.path("synthetic_can_lee2012.csv")))


def read_list(
    path: Path, columns: Mapping[str, str] | None = None, period: float | None = None
) -> MessageSet:
    """Return the messages in a CSV file or Excel workbook."""
    assigned = {title.strip(): column for title, column in (columns or {}).items()}
    sheet = read_sheet(path, is_titles=_Messages.score(tuple(assigned.items())), what=_WHAT)
    titles = {plain(title) for title in sheet.titles}
    for title, column in assigned.items():
        if plain(title) not in titles:
            existing = ", ".join(sheet.titles)
            raise InputError(sheet.source, f"no column {title!r}; the titles are {existing}")
        if _Messages.words.column_of(column) is None:
            legal = ", ".join((*COLUMNS, "note"))
            raise ArgumentError(f"columns has {column!r}; it must be one of {legal}")
    return _from_sheet(sheet, assigned, period)


def _from_sheet(sheet: Sheet, assigned: Mapping[str, str], period: float | None) -> MessageSet:
    """Return the messages in a sheet, or raise an error that lists all faults."""
    cells = _Messages(sheet, assigned, period)
    is_hex = cells.units.get("arbitration_id") == "hex"
    columns: dict[str, list[Any]] = {}
    for (field, kind), column in zip(_KINDS.items(), COLUMNS, strict=True):
        if column in cells.needed:
            cells.wrong(np.flatnonzero(~cells.given(column)).tolist(), column, "a value")
        if field == "arbitration_id":
            legal = "an identifier 0..0x7FF, or 0x1FFFFFFF if extended"
            columns[field] = cells.values(column, lambda cell: _identifier(cell, is_hex), legal)
        elif isinstance(kind, Switch):
            columns[field] = cells.values(column, lambda cell: _YES[plain(cell)], "yes or no")
        elif isinstance(kind, Number | Whole):
            whole, target = isinstance(kind, Whole), "s" if field in TIMES else ""
            values = cells.numbers(column, kind.low, kind.high, target, whole=whole).tolist()
            convert = int if whole else float
            columns[field] = [convert(value) if np.isfinite(value) else None for value in values]
        else:
            columns[field] = cells.values(column, _printable, "printable text")
    messages: list[tuple[int, Message]] = []
    for row, values in enumerate(zip(*columns.values(), strict=True)):
        if row in cells.faulty:
            continue
        fields = {
            field: value for field, value in zip(columns, values, strict=True) if value is not None
        }
        fields["arbitration_id"], is_long = fields["arbitration_id"]
        if "extended" not in cells.places:
            fields["extended"] = is_long
        try:
            messages.append((row, Message(**{"period": period} | fields)))
        except ArgumentError as fault:
            cells.fault(row, "arbitration_id", f", {fault}")
    for index, why in set_faults(message for _, message in messages):
        cells.fault(messages[index][0], "name", f": {why}")
    cells.check()
    return MessageSet((message for _, message in messages), remarks=cells.shown)


def _printable(cell: str) -> str:
    if not cell.isprintable():
        raise ValueError
    return cell


def _identifier(cell: str, is_hex: bool) -> tuple[int, bool]:
    """Return an identifier, and whether its digits show that it has 29 bits."""
    digits = widened(cell).lower().removesuffix(".0")
    bare = digits.removesuffix("h").removeprefix("0x")
    base = 16 if is_hex or bare != digits else 10
    number = int(bare, base) if bare.isalnum() and bare.isascii() and len(bare) < 13 else -1
    if not 0 <= number <= highest_id(True):
        raise ValueError
    return number, number > 0xFFFF or (base == 16 and len(bare) == 8)
