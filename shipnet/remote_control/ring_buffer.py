"""The receive ring: an interrupt stores bytes, and a task extracts them later.

`PrintedRing` is the program of chung1998. `Ring` runs it, or a corrected reader, and counts what a
program cannot know: which bytes are lost, and which are read twice.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from copy import deepcopy
from dataclasses import dataclass
from typing import Literal, NamedTuple, get_args

import numpy as np
import numpy.typing as npt

from shipnet.fields import check_choice, check_whole
from shipnet.lazy import Axes, pd
from shipnet.remote_control.packet import PACKET_START
from shipnet.remote_control.packet_format import check_bytes

Case = Literal["a", "b", "c", "d"]
Action = Literal["take", "wait", "stop", "repair"]
Rule = Literal["printed", "intended", "corrected"]

_LAPS = 3  #: Laps of lead that `RingCases` and, by default, `Ring.explore` cover.


class State(NamedTuple):
    """The four variables of the paper: places and flags of the writer and of the reader."""

    no: int
    ring_f: int
    get_no: int
    ring_get_f: int

    @property
    def case(self) -> Case:
        """The case that the variables show, lettered in the order of the printed list."""
        if self.ring_f == self.ring_get_f:
            return "b" if self.no >= self.get_no else "a"
        return "c" if self.no >= self.get_no else "d"


class Step(NamedTuple):
    """One step of the reader, and the case in which it took place.

    The reader read a `byte`, waited, stopped receiving, or repaired the ring. `lost` counts the
    unread bytes that the reader skipped; a `stale` byte was read before or was never received.
    """

    case: Case
    action: Action
    byte: int | None = None
    lost: int = 0
    stale: bool = False


def bytes_of(steps: Iterable[Step]) -> bytes:
    """Return the bytes that the reader read in these steps."""
    return bytes(step.byte for step in steps if step.byte is not None)


def case_of(get_no: int, lead: int, size: int) -> Case:
    """Return the case shown when the writer leads a reader at `get_no` by `lead` bytes."""
    ring_f, no = divmod((get_no + lead) % (2 * size), size)
    return State(no, ring_f, get_no, 0).case


class PrintedRing:
    """The ring of chung1998: writer and reader each have a place, and a flag for the lap.

    The writer stores at ``no``, and the reader extracts at ``get_no``; their flags ``ring_f`` and
    ``ring_get_f`` toggle at the end of the ring. The four variables show one of four cases:

    - a: same flags, ``no < get_no``: the reader seems to have passed the writer;
    - b: same flags, ``no >= get_no``: in order, or empty;
    - c: different flags, ``no >= get_no``: the writer seems to have passed the reader;
    - d: different flags, ``no < get_no``: in order; the writer has wrapped around.
    """

    def __init__(self, size: int, empty_is_data: bool) -> None:
        self.size, self.empty_is_data = size, empty_is_data
        self.cells = bytearray(size)
        self.no = self.ring_f = self.get_no = self.ring_get_f = 0

    def store(self, byte: int) -> None:
        """Store a byte, as the receive interrupt does, regardless of the reader (Fig 7)."""
        self.cells[self.no] = byte
        self.no += 1
        if self.no == self.size:
            self.no = 0
            self.ring_f = 1 - self.ring_f

    def extract(self) -> tuple[Action, int | None]:
        """Do one step of the reader (Fig 8); return the action, and the byte if one was read."""
        if self.ring_f == self.ring_get_f:
            if self.no < self.get_no:
                return "stop", None
            if self.no == self.get_no and not self.empty_is_data:
                return "wait", None
        elif self.no >= self.get_no:
            self.repair()
            return "repair", None
        byte = self.cells[self.get_no]
        self.raise_get_no()
        return "take", byte

    def raise_get_no(self) -> None:
        """Move the reader to the next place."""
        self.get_no += 1
        if self.get_no == self.size:
            self.get_no = 0
            self.ring_get_f = 1 - self.ring_get_f

    def repair(self) -> None:
        """Move the reader to the other half, and from there to the next 0xCC (Fig 9)."""
        if self.no < self.size // 2:
            self.get_no = self.size // 2
        else:
            self.get_no = 0
            self.ring_get_f = 1 - self.ring_get_f
        while (self.get_no, self.ring_get_f) != (self.no, self.ring_f):
            if self.cells[self.get_no] == PACKET_START:
                break
            self.raise_get_no()

    @property
    def state(self) -> State:
        """The four variables."""
        return State(self.no, self.ring_f, self.get_no, self.ring_get_f)


class Ring:
    """A receive ring that is written and read step by step.

    Parameters
    ----------
    size : int, default 128
        Capacity of the ring, 2..65536 bytes.
    rule : {"printed", "intended", "corrected"}, default "printed"
        Rule of the reader. "printed": the printed tests, in which ``no == get_no`` with equal flags
        counts as data. "intended": the same tests, but this state counts as empty.
        "corrected": writer and reader count their bytes without returning to 0.

    Attributes
    ----------
    written : int
        Bytes stored so far; the printed program does not keep this count.
    lost : int
        Bytes overwritten or skipped unread; they are counted when the reader moves past them.
    stale : int
        Bytes read that had been read before or were never received.

    Notes
    -----
    In case a the printed reader [1]_ switches the receive interrupt off and sends; here it stops,
    and continues when the case has changed. In case c it moves to the other half of the ring and
    searches for 0xCC. If it finds none, it moves to the writer, which empties the ring. ``no ==
    size / 2`` counts as the upper half. The paper specifies neither of these two cases, so both
    rules are our choice.

    A corrected program can use 16-bit counters: their difference, modulo 65536, is correct as long
    as fewer than 65536 bytes are unread.

    References
    ----------
    .. [1] K. Y. Chung, K. S. Rhyu, "A study on the communication method for a ship main engine
       remote control system", J. Korean Soc. Marine Eng., 1998, sections 3.1, 4.2, 4.3, Figs 7
       to 9. The drawings are lost; the rules follow the text.

    Examples
    --------
    >>> from shipnet import remote_control as rc
    >>> ring = rc.Ring(8)
    >>> ring.store(0xCC)
    >>> ring.state, ring.case, ring.unread
    (State(no=1, ring_f=0, get_no=0, ring_get_f=0), 'b', 1)
    >>> ring.extract()
    Step(case='b', action='take', byte=204, lost=0, stale=False)

    With the printed test, the reader continues although the ring is empty:

    >>> ring.extract()
    Step(case='b', action='take', byte=0, lost=0, stale=True)
    >>> ring.extract().action, rc.Ring(8, "corrected").extract().action
    ('stop', 'wait')
    """

    def __init__(self, size: int = 128, rule: Rule = "printed") -> None:
        self.size = check_whole("size", size, 2, 65536)
        check_choice("rule", rule, get_args(Rule))
        self.rule: Rule = rule
        self._program = PrintedRing(self.size, empty_is_data=rule == "printed")
        self.written = self.lost = self.stale = 0
        # The first byte that was neither read nor skipped, counted from the first byte stored.
        self._due = 0

    @classmethod
    def filled(cls, unread: int, get_no: int = 0, size: int = 128, rule: Rule = "intended") -> Ring:
        """Return a ring with `unread` unread bytes and the reader at index `get_no`.

        The bytes stored are 0, 1, 2, ..., modulo 256.
        """
        ring = cls(size, rule)
        get_no = check_whole("get_no", get_no, 0, size - 1)
        unread = check_whole("unread", unread, 0, 10**6)
        for n in range(get_no + unread):
            ring.store(n % 256)
            if n < get_no:
                ring.extract()
        return ring

    @property
    def cells(self) -> bytes:
        """The bytes in all cells of the ring; 0 in cells not yet used."""
        return bytes(self._program.cells)

    @property
    def state(self) -> State:
        """The four variables."""
        return self._program.state

    @property
    def case(self) -> Case:
        """The case that the variables show."""
        return self.state.case

    @property
    def unread(self) -> int:
        """Number of bytes that were stored and neither read nor skipped."""
        return self.written - self._due

    @property
    def seems_unread(self) -> int:
        """Number of bytes that the four variables show as unread, 0..2 * size - 1."""
        no, ring_f, get_no, ring_get_f = self.state
        return (no + self.size * ring_f - get_no - self.size * ring_get_f) % (2 * self.size)

    def copy(self) -> Ring:
        """Return an independent copy of the ring."""
        return deepcopy(self)

    def store(self, byte: int) -> None:
        """Store a byte, as the receive interrupt does, regardless of the reader."""
        self._program.store(check_whole("byte", byte, 0, 255))
        self.written += 1

    def store_all(self, data: bytes) -> None:
        """Store bytes one after another; only the last `size` bytes remain."""
        for byte in check_bytes("data", data):
            self.store(byte)

    def extract(self) -> Step:
        """Do one step of the reader."""
        before = self.state
        action, byte = self._extract() if self.rule == "corrected" else self._program.extract()
        if action == "take":
            # The cell holds the last byte that was stored in it.
            first = self.written - 1 - (self.written - 1 - before.get_no) % self.size
            following = first + 1
        elif action == "repair":
            first = following = self.written - self.seems_unread
        else:
            return Step(before.case, action)
        lost, stale = max(0, first - self._due), action == "take" and first < self._due
        self.lost += lost
        self.stale += stale
        self._due = max(self._due, following)
        return Step(before.case, action, byte, lost, stale)

    def _extract(self) -> tuple[Action, int | None]:
        """Do one step of the corrected reader, which counts bytes without returning to 0."""
        program = self._program
        if self.unread == 0:
            return "wait", None
        if self.unread > self.size:
            # The oldest byte is at the writer's place, one lap behind it.
            program.get_no, program.ring_get_f = program.no, 1 - program.ring_f
            return "repair", None
        byte = program.cells[program.get_no]
        program.raise_get_no()
        return "take", byte

    def drain(self) -> list[Step]:
        """Read until the reader waits or stops, as the task does; return the steps."""
        steps = [self.extract()]
        while steps[-1].action in ("take", "repair"):
            steps.append(self.extract())
        return steps

    def explore(self, max_unread: int | None = None) -> pd.DataFrame:
        """Return every state that storing and extracting can reach, with the reader's next step.

        The search begins with an empty ring of this size, 2..16, and this rule; the writer pauses
        at `max_unread` unread bytes, by default three laps. One row per state: the four variables,
        ``unread``, ``first_lap`` (whether some cells are still empty), the ``case``, and the
        ``action`` of the reader with the bytes ``lost`` and whether it read a ``stale`` byte. Every
        byte stored is 0xCC, so that a repair finds the start of a packet at once.
        """
        check_whole("size", self.size, 2, 16)
        limit = _LAPS * self.size
        if max_unread is not None:
            limit = check_whole("max_unread", max_unread, 0, 4 * self.size)
        start = Ring(self.size, self.rule)
        seen, rows, waiting = {_key(start)}, [], deque([start])
        while waiting:
            ring = waiting.popleft()
            after, more = ring.copy(), ring.copy()
            step = after.extract()
            more.store(PACKET_START)
            row = (*ring.state, ring.unread, ring.written < ring.size)
            rows.append((*row, step.case, step.action, step.lost, step.stale))
            for other in (after, more) if ring.unread < limit else (after,):
                if _key(other) not in seen:
                    seen.add(_key(other))
                    waiting.append(other)
        columns = [*State._fields, "unread", "first_lap", "case", "action", "lost", "stale"]
        return pd.DataFrame(rows, columns=columns)

    def cases(self) -> RingCases:
        """Return the cases for a writer that is less than three laps ahead of the reader."""
        check_whole("size", self.size, 2, 512)
        return RingCases(self.size)

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the ring as a circle of cells, clockwise from the top, with writer and reader.

        Cells with unread bytes are shaded, in red if earlier bytes were overwritten before they
        were read. Rings of up to 32 cells show their bytes.
        """
        from shipnet.remote_control.plot import plot_ring

        return plot_ring(self, ax)


def _key(ring: Ring) -> tuple[int, ...]:
    # Only these values determine the future: places, flags, unread bytes, and number of used cells.
    return (*ring.state, ring.unread, min(ring.written, ring.size))


@dataclass(frozen=True)
class RingCases:
    """The case of a ring, by the reader's place and by the writer's lead."""

    size: int

    def _shown(self) -> npt.NDArray[np.str_]:
        """Return the case by the writer's lead and the reader's place."""
        leads, places = range(_LAPS * self.size), range(self.size)
        return np.array([[case_of(index, lead, self.size) for index in places] for lead in leads])

    def table(self) -> pd.DataFrame:
        """Return how many pairs of writer's lead and reader's place show each case, by lap.

        Each row is a lap, with the leads ``from`` .. ``to`` [byte]. A lead of exactly one lap is a
        full ring: nothing is lost yet, although the variables show case c.
        """
        shown = self._shown().reshape(_LAPS, -1)
        first = np.arange(_LAPS) * self.size
        counts = {case: (shown == case).sum(axis=1) for case in get_args(Case)}
        return pd.DataFrame({"from": first, "to": first + self.size - 1, **counts})

    def plot(self, ax: Axes | None = None, *, get_no: int | None = None) -> Axes:
        """Draw a map of the cases over the unread bytes and the reader's place.

        With `get_no`, the place of the reader, draw the apparent number of unread bytes over the
        true number.
        """
        from shipnet.remote_control.plot import plot_cases, plot_lead

        if get_no is None:
            return plot_cases(self._shown().T, ax)
        column = check_whole("get_no", get_no, 0, self.size - 1)
        return plot_lead(self._shown()[:, column].tolist(), self.size, ax)
