"""The receive ring: an interrupt stores bytes, a task extracts them later.

Writer and reader each have a place (``no``, ``get_no``) and a flag that turns over at the end of
the ring (``ring_f``, ``ring_get_f``). Place and flag together count to twice the size of the ring
and begin again, and the four cases that the paper tells apart are what this count shows of the
unread bytes:

- a: same flags, ``no < get_no``: seems that the reader has passed the writer;
- b: same flags, ``no >= get_no``: in order, or empty;
- c: different flags, ``no >= get_no``: seems that the writer has passed the reader;
- d: different flags, ``no < get_no``: in order, across the end of the ring.
"""

from __future__ import annotations

from copy import copy
from typing import Literal, NamedTuple

from shipnet.errors import ArgumentError
from shipnet.fields import check_whole
from shipnet.remote_control.items import check_bytes
from shipnet.remote_control.packet import PACKET_START

__all__ = ["Action", "Case", "Ring", "Rule", "State", "Step", "pointer_case"]

Case = Literal["a", "b", "c", "d"]
Action = Literal["take", "wait", "stop", "repair"]
Rule = Literal["literal", "meant", "mended"]


class State(NamedTuple):
    """The four variables of the paper.

    Attributes
    ----------
    no, ring_f : int
        Where the next byte is stored, and the flag of the writer.
    get_no, ring_get_f : int
        Where the next byte is taken, and the flag of the reader.
    """

    no: int
    ring_f: int
    get_no: int
    ring_get_f: int


class Step(NamedTuple):
    """What one step of the reader did.

    Attributes
    ----------
    case : {"a", "b", "c", "d"}
        The case in which it found the ring.
    action : {"take", "wait", "stop", "repair"}
        It took a byte; found none and waited; stopped receiving; or gave up bytes.
    byte : int or None
        The byte taken.
    lost : int
        How many unread bytes were skipped, be it noticed or not.
    stale : bool
        Whether the byte taken is none that was due: read before, or never received.
    """

    case: Case
    action: Action
    byte: int | None = None
    lost: int = 0
    stale: bool = False


def pointer_case(state: State) -> Case:
    """Return which of the four cases the variables show.

    Parameters
    ----------
    state : State
        The four variables.

    Returns
    -------
    {"a", "b", "c", "d"}
        The case; lettered in the order in which the paper lists them.

    References
    ----------
    .. [1] K. Y. Chung, K. S. Rhyu, "A study on the communication method for a ship main engine
       remote control system", J. Korean Soc. Marine Eng., 1998, section 4.3.

    Examples
    --------
    >>> pointer_case(State(no=5, ring_f=0, get_no=3, ring_get_f=0))
    'b'
    >>> pointer_case(State(no=5, ring_f=1, get_no=3, ring_get_f=0))
    'c'
    """
    return _case(state.no >= state.get_no, state.ring_f == state.ring_get_f)


def _case(ahead: bool, same_flag: bool) -> Case:
    if same_flag:
        return "b" if ahead else "a"
    return "c" if ahead else "d"


class Ring:
    """A ring that is written and read step by step.

    Parameters
    ----------
    size : int, default 128
        How many bytes it holds, 2..65536.
    rule : {"literal", "meant", "mended"}, default "literal"
        How the reader decides. "literal": by the printed tests, in which ``no == get_no`` with
        equal flags counts as data. "meant": the same, but such a ring is empty. "mended": writer
        and reader count their bytes without beginning again.

    Attributes
    ----------
    written : int
        Bytes stored so far; the truth, which the printed program does not know.
    lost : int
        Bytes that nobody has read or ever will.
    stale : int
        Bytes taken that were not due.

    Raises
    ------
    ArgumentError
        If `size` is out of range, or there is no such rule.

    Notes
    -----
    In case a the printed reader switches the receive interrupt off and turns to sending; here it
    stops, and goes on when the case has changed. In case c it gives up a part of the ring: with
    ``no`` in the lower half it goes to the middle, else to the start, and seeks 0xCC from there.
    Should there be none, the reader here ends at the writer, with an empty ring; the paper does
    not say. Nor does it place ``no == size / 2``, which is taken with the upper half.

    The counters of a mended program may be 16 bit wide: they begin again at a multiple of 128,
    and their difference is right as long as fewer than 65536 bytes are unread.

    References
    ----------
    .. [1] K. Y. Chung, K. S. Rhyu, "A study on the communication method for a ship main engine
       remote control system", J. Korean Soc. Marine Eng., 1998, sections 3.1, 4.2, 4.3, Figs 7
       to 9. The drawings are lost; the rules follow the text.

    Examples
    --------
    >>> ring = Ring(8)
    >>> ring.store(0xCC)
    >>> ring.state, ring.case, ring.unread
    (State(no=1, ring_f=0, get_no=0, ring_get_f=0), 'b', 1)
    >>> ring.extract()
    Step(case='b', action='take', byte=204, lost=0, stale=False)

    The ring is empty, but the printed test reads on:

    >>> ring.extract()
    Step(case='b', action='take', byte=0, lost=0, stale=True)
    >>> ring.extract().action, Ring(8, "mended").extract().action
    ('stop', 'wait')
    """

    def __init__(self, size: int = 128, rule: Rule = "literal") -> None:
        self.size = check_whole("size", size, 2, 65536)
        if rule not in ("literal", "meant", "mended"):
            raise ArgumentError(f"rule is {rule!r}; it must be 'literal', 'meant' or 'mended'")
        self.rule = rule
        self.written = self.lost = self.stale = 0
        self._cells = bytearray(self.size)
        # Place and flag of the reader as one number, 0..2 * size - 1.
        self._reader = 0
        # The next byte that was never read, counted from the first one stored.
        self._due = 0

    @property
    def cells(self) -> bytes:
        """What stands in the ring."""
        return bytes(self._cells)

    @property
    def state(self) -> State:
        """The four variables."""
        ring_f, no = divmod(self.written % (2 * self.size), self.size)
        ring_get_f, get_no = divmod(self._reader, self.size)
        return State(no, ring_f, get_no, ring_get_f)

    @property
    def case(self) -> Case:
        """The case that the variables show."""
        round_, no = divmod(self.written, self.size)
        round_read, get_no = divmod(self._reader, self.size)
        return _case(no >= get_no, (round_ - round_read) % 2 == 0)

    @property
    def unread(self) -> int:
        """How many bytes were stored and not read or given up: the truth."""
        return self.written - self._due

    @property
    def seems_unread(self) -> int:
        """How many bytes the four variables show as unread, 0..2 * size - 1."""
        return (self.written - self._reader) % (2 * self.size)

    def copy(self) -> Ring:
        """Return a ring in the same state that goes its own way."""
        other = copy(self)
        other._cells = bytearray(self._cells)
        return other

    def store(self, byte: int) -> None:
        """Store a byte, as the receive interrupt does: it never looks at the reader.

        Parameters
        ----------
        byte : int
            The byte, 0..255.
        """
        self._cells[self.written % self.size] = check_whole("byte", byte, 0, 255)
        self.written += 1

    def store_all(self, data: bytes) -> None:
        """Store bytes one after the other.

        Parameters
        ----------
        data : bytes-like
            The bytes; of more than `size` of them the last are left, as of single ones.

        Examples
        --------
        >>> ring = Ring(4)
        >>> ring.store_all(b"abcdef")
        >>> ring.cells, ring.written, ring.case
        (b'efcd', 6, 'c')
        """
        given = check_bytes("data", data)
        kept = given[-self.size :]
        first = (self.written + len(given) - len(kept)) % self.size
        end = min(first + len(kept), self.size)
        self._cells[first:end] = kept[: end - first]
        self._cells[: len(kept) - (end - first)] = kept[end - first :]
        self.written += len(given)

    def extract(self) -> Step:
        """Do one step of the reader."""
        case = self.case
        if self.rule == "mended":
            if self.unread == 0:
                return Step(case, "wait")
            if self.unread > self.size:
                return Step(case, "repair", lost=self._move(self.written - self.size))
            return self._take(case)
        if case == "a":
            return Step(case, "stop")
        if case == "c":
            return Step(case, "repair", lost=self._move(self._first_start()))
        if self.rule == "meant" and self.seems_unread == 0:
            return Step(case, "wait")
        return self._take(case)

    def _take(self, case: Case) -> Step:
        place = self._reader % self.size
        self._reader = (self._reader + 1) % (2 * self.size)
        # The cell holds the last byte that was stored in it.
        count = self.written - 1 - (self.written - 1 - place) % self.size
        if count < self._due:
            self.stale += 1
            return Step(case, "take", self._cells[place], stale=True)
        lost = count - self._due
        self.lost += lost
        self._due = count + 1
        return Step(case, "take", self._cells[place], lost)

    def _move(self, count: int) -> int:
        """Move the reader on to a byte; return how many bytes it gives up."""
        self._reader = count % (2 * self.size)
        lost = max(0, count - self._due)
        self._due += lost
        self.lost += lost
        return lost

    def _first_start(self) -> int:
        """Return which byte the repair of Fig 9 finds."""
        no = self.state.no
        half = self.size >> 1
        # From the middle on stands what was stored in the round before, behind it this round's.
        oldest = self.written - no + (half - self.size if no < half else 0)
        for count in range(oldest, self.written):
            if self._cells[count % self.size] == PACKET_START:
                return count
        return self.written
