"""The messages of a bus: what each is, which goes first, and what share of the time they take."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from os import PathLike
from typing import TYPE_CHECKING, Any, overload

import numpy as np
import numpy.typing as npt

from shipnet.can.frame import check_bit_rate, highest_id
from shipnet.can.lengths import Stuffing, length_table
from shipnet.clock import nanoseconds
from shipnet.errors import ArgumentError
from shipnet.fields import check_whole, number, record, switch, text, whole

if TYPE_CHECKING:
    import pandas as pd

Floats = npt.NDArray[np.float64]

#: Bit rates in use [bit/s], with bus lengths from 5000 m down to 20 m: Beckhoff, BX5100
#: documentation.
BIT_RATES = (10_000, 20_000, 50_000, 125_000, 250_000, 500_000, 1_000_000)

#: The times of a message.
TIMES = ("period", "deadline", "jitter", "offset")


@record(slots=True)
class Message:
    """A message that is sent again and again; its times are kept to the nanosecond.

    Raises
    ------
    ArgumentError
        If a field is outside its range; the message names it and its value.

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
        """Check what depends on several fields, and round the times to nanoseconds."""
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


def set_faults(messages: Iterable[Message]) -> list[tuple[int, str]]:
    """Return the places of messages whose name or identifier is taken before, and why."""
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


class MessageSet(Sequence[Message]):
    """The messages of one bus, the highest priority first.

    Parameters
    ----------
    messages : iterable of Message
        In any order; names and identifiers must differ.

    Raises
    ------
    ArgumentError
        If something else than a message is in it, or two have the same name or identifier; the
        error names all of them.

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

    __slots__ = ("_messages",)

    def __init__(self, messages: Iterable[Message]) -> None:
        given = list(messages)
        strange = [item for item in given if not isinstance(item, Message)]
        if strange:
            raise ArgumentError(f"messages hold {strange[0]!r}; all must be of class Message")
        faults = set_faults(given)
        if faults:
            raise ArgumentError("; ".join(fault for _, fault in faults))
        self._messages = tuple(sorted(given, key=lambda message: message.priority))

    @property
    def names(self) -> tuple[str, ...]:
        """Names in order of priority."""
        return tuple(message.name for message in self._messages)

    @property
    def periods(self) -> Floats:
        """Periods in order of priority [s]."""
        return np.array([message.period for message in self._messages], dtype=np.float64)

    def __len__(self) -> int:
        return len(self._messages)

    def __iter__(self) -> Iterator[Message]:
        return iter(self._messages)

    @overload
    def __getitem__(self, key: int | str) -> Message: ...
    @overload
    def __getitem__(self, key: slice) -> tuple[Message, ...]: ...
    def __getitem__(self, key: int | str | slice) -> Message | tuple[Message, ...]:
        """Return a message by its place or its name, or some by a slice."""
        return self._messages[self.place(key) if isinstance(key, str) else key]

    def __eq__(self, other: object) -> bool:
        return isinstance(other, MessageSet) and self._messages == other._messages

    def __hash__(self) -> int:
        return hash(self._messages)

    def __repr__(self) -> str:
        """Count the messages and name the first."""
        return f"MessageSet({counted(self.names)})"

    def place(self, name: str) -> int:
        """Return the place of a message in the order of priority, or raise if there is none."""
        if name not in self.names:
            raise ArgumentError(f"name is {name!r}; the messages are {', '.join(self.names)}")
        return self.names.index(name)

    def replace(self, name: str, **new: Any) -> MessageSet:
        """Return the set with some fields of one message replaced.

        A deadline equal to the period follows a new period.
        """
        place = self.place(name)
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
        new = [message.arbitration_id for message in self._messages]
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
        from shipnet.can.tables import to_table

        return to_table(self)

    @classmethod
    def from_table(cls, table: pd.DataFrame) -> MessageSet:
        """Return the set that a table describes, with the columns of `table` or some of them.

        A missing value takes its default. All the faults of a table are raised at once.
        """
        from shipnet.can.tables import from_table

        return from_table(table)

    @classmethod
    def parse(cls, text: str, source: str = "text") -> MessageSet:
        """Return the set that a text describes, written as a CSV file for `read_messages`."""
        from shipnet.can.tables import parse_messages

        return parse_messages(text, source)

    @property
    def text(self) -> str:
        """The set as the text of a CSV file."""
        from shipnet.can.tables import text_of

        return text_of(self)

    def save(self, path: str | PathLike[str]) -> None:
        """Write a CSV file from which `read_messages` makes the same set."""
        with open(path, "w", newline="", encoding="utf-8") as stream:
            stream.write(self.text)


def counted(names: Sequence[str]) -> str:
    """Return how many messages there are, and the names of the first."""
    some = ", ".join(names[:3]) + (", ..." if len(names) > 3 else "")
    return f"{len(names)} message{'s' if len(names) != 1 else ''}{': ' if some else ''}{some}"


def check_set(messages: object) -> None:
    """Raise unless the messages are a set, whose identifiers differ."""
    if not isinstance(messages, MessageSet):
        kind = type(messages).__name__
        raise ArgumentError(
            f"messages are of type {kind}; they must be a MessageSet, such as "
            "MessageSet([Message(...), ...]) or MessageSet.from_table(table)"
        )


@overload
def bus_load(messages: MessageSet, bit_rate: float, stuffing: Stuffing = ...) -> float: ...
@overload
def bus_load(
    messages: MessageSet, bit_rate: npt.ArrayLike, stuffing: Stuffing = ...
) -> float | Floats: ...
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
    check_set(messages)
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


def packed(analogue: npt.ArrayLike, bits: int = 16) -> tuple[npt.NDArray[np.intp], int]:
    """Return the first bit of each point in the data of a station, and how many bytes they fill.

    Analogue values come first, `bits` each, filled up to a whole byte; then the states, one bit
    each. The data are sent in frames of eight bytes.
    """
    analogue = np.asarray(analogue, dtype=bool)
    values, states = np.cumsum(analogue) - 1, np.cumsum(~analogue) - 1
    start = -(-int(analogue.sum()) * bits // 8)
    first = np.where(analogue, bits * values, 8 * start + states)
    return np.asarray(first, dtype=np.intp), start + -(-int((~analogue).sum()) // 8)
