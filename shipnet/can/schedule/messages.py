"""What is sent on a CAN bus, how often, and by when it has to arrive."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from numbers import Real
from typing import overload

from shipnet.clock import nanoseconds
from shipnet.errors import ArgumentError
from shipnet.fields import check_whole

__all__ = ["RANGES", "Message", "MessageSet", "check_set", "set_faults"]

#: Shortest and longest legal value of each time of a message [s].
RANGES = {
    "period": (1e-6, 1e5),
    "deadline": (1e-6, 1e5),
    "jitter": (0.0, 1e5),
    "offset": (0.0, 1e5),
}

#: Most bits of a frame: 8 bytes, a 29-bit identifier, the bound on stuff bits, intermission.
_MOST_BITS = 160


@dataclass(frozen=True, slots=True)
class Message:
    """A message that is sent again and again.

    Parameters
    ----------
    name : str
        What it is called; text without line breaks.
    arbitration_id : int
        Identifier, 0..0x7FF, or 0..0x1FFFFFFF if `extended`.
    dlc : int
        Data bytes, 0..8.
    period : float
        Shortest time from one event that causes the message to the next, 1e-6..1e5 [s].
    deadline : float, optional
        Longest time that it may take from the event to its arrival, 1e-6..1e5 [s]; the period if
        not given. It may be longer than the period.
    jitter : float, default 0
        Longest time from the event until the message is queued for sending, 0..1e5 [s].
    offset : float, default 0
        Time of the first event, 0..1e5 [s]. The analysis does without it: no two nodes share a
        clock.
    extended : bool, default False
        Whether the identifier has 29 bits.
    sender : str, default ""
        Node that sends it.
    bits : int, optional
        Length of the frame, 47..160 bit with intermission, where it is known better than by
        `dlc`; it takes the place of all formulas.

    Raises
    ------
    ArgumentError
        If a field is outside its range; the message names it and its value.

    Notes
    -----
    Times are kept to the nanosecond.

    Examples
    --------
    >>> Message("oil pressure", 0x120, 8, period=0.1).deadline
    0.1
    """

    name: str
    arbitration_id: int
    dlc: int
    period: float
    deadline: float = None  # type: ignore[assignment] # the period takes its place at once
    jitter: float = 0.0
    offset: float = 0.0
    extended: bool = False
    sender: str = ""
    bits: int | None = None

    def __post_init__(self) -> None:
        """Check every field."""
        for field in ("name", "sender"):
            text = getattr(self, field)
            if not isinstance(text, str) or not text.isprintable() or text != text.strip():
                raise ArgumentError(f"{field} is {text!r}; it must be printable text")
        if not self.name:
            raise ArgumentError("name is empty; a message needs one")
        if not isinstance(self.extended, bool):
            raise ArgumentError(f"extended is {self.extended!r}; it must be True or False")
        set_field = object.__setattr__
        highest = 2**29 - 1 if self.extended else 2**11 - 1
        whole = check_whole("arbitration_id", self.arbitration_id, 0, highest)
        set_field(self, "arbitration_id", whole)
        set_field(self, "dlc", check_whole("dlc", self.dlc, 0, 8))
        if self.bits is not None:
            set_field(self, "bits", check_whole("bits", self.bits, 47, _MOST_BITS))
        if self.deadline is None:
            set_field(self, "deadline", self.period)
        for field, (low, high) in RANGES.items():
            value = getattr(self, field)
            number = isinstance(value, Real) and not isinstance(value, bool)
            if not (number and low <= value <= high):
                raise ArgumentError(f"{field} is {value!r} s; it must be {low:g}..{high:g} s")
            set_field(self, field, nanoseconds(value) / 1e9)

    @property
    def priority(self) -> tuple[int, bool, int]:
        """What arbitration compares; the smaller wins.

        The first 11 bits of an identifier come first. A standard frame wins over an extended one
        that begins like it, as its RTR bit is dominant where the other sends SRR.
        """
        if not self.extended:
            return self.arbitration_id, False, 0
        return self.arbitration_id >> 18, True, self.arbitration_id & 0x3FFFF


def set_faults(messages: Iterable[Message]) -> list[tuple[int, str]]:
    """Return which messages cannot be in one set with those before them, and why.

    Parameters
    ----------
    messages : iterable of Message
        Messages in any order.

    Returns
    -------
    list of (int, str)
        Place of the message, and the fault: its name or its identifier is taken.

    Examples
    --------
    >>> set_faults([Message("A", 1, 8, 0.1), Message("B", 1, 8, 0.1)])
    [(1, "arbitration_id 0x1 of 'B' is taken by 'A'")]
    """
    names: set[str] = set()
    taken: dict[tuple[int, bool, int], str] = {}
    faults = []
    for place, message in enumerate(messages):
        if message.name in names:
            faults.append((place, f"name {message.name!r} is taken"))
        if message.priority in taken:
            identifier = f"arbitration_id {message.arbitration_id:#x} of {message.name!r}"
            faults.append((place, f"{identifier} is taken by {taken[message.priority]!r}"))
        names.add(message.name)
        taken.setdefault(message.priority, message.name)
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
    >>> messages.names
    ('fast', 'slow')
    >>> messages["slow"].period
    1.0
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
        if isinstance(key, str):
            if key not in self.names:
                raise ArgumentError(f"name is {key!r}; the messages are {', '.join(self.names)}")
            return self._messages[self.names.index(key)]
        return self._messages[key]

    def __eq__(self, other: object) -> bool:
        return isinstance(other, MessageSet) and self._messages == other._messages

    def __hash__(self) -> int:
        return hash(self._messages)

    def __repr__(self) -> str:
        return f"MessageSet({list(self._messages)!r})"

    def ordered(self, names: Iterable[str]) -> MessageSet:
        """Return the same messages with identifiers that give another order of priority.

        Parameters
        ----------
        names : iterable of str
            All names, the highest priority first.

        Returns
        -------
        MessageSet
            The identifiers of the set, shared out anew. Where some have 11 and some 29 bits, the
            first 11 bits count up from 0 instead.

        Raises
        ------
        ArgumentError
            If the names are not those of the set, each once.

        Examples
        --------
        >>> messages = MessageSet([Message("a", 0x10, 8, 1.0), Message("b", 0x20, 8, 1.0)])
        >>> [(m.name, m.arbitration_id) for m in messages.ordered(["b", "a"])]
        [('b', 16), ('a', 32)]
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


def check_set(messages: object) -> None:
    """Raise unless the messages are a set, whose identifiers differ.

    Parameters
    ----------
    messages : object
        What was given for a message set.

    Raises
    ------
    ArgumentError
        If it is something else.

    Examples
    --------
    >>> check_set([])
    Traceback (most recent call last):
        ...
    shipnet.errors.ArgumentError: messages are of type list; they must be a MessageSet
    """
    if not isinstance(messages, MessageSet):
        kind = type(messages).__name__
        raise ArgumentError(f"messages are of type {kind}; they must be a MessageSet")
