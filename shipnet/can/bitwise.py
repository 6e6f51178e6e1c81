"""Bitwise arbitration: what frames that begin together put on the bus, and who stops at which bit.

A 0 is dominant: it wins over every 1 that is sent at the same time, so the bus carries the least
of the bits. A sender that reads a 0 where it sent a 1 stops, and the others never notice.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

from shipnet.can.frame import Frame
from shipnet.errors import ArgumentError

if TYPE_CHECKING:
    from matplotlib.axes import Axes


class Arbitration(NamedTuple):
    """How frames that began together settled who goes on.

    Attributes
    ----------
    frames : tuple of Frame
        Who took part.
    bus : str
        Bits on the bus, stuff bits among them, from the start of frame to the last that can
        decide: IDE, of an extended frame RTR.
    stopped : tuple of int or None
        For each frame the bit at which its sender stopped, 0 the start of frame; None for the
        winner.

    Examples
    --------
    >>> arbitrate([Frame(0x200), Frame(0x101)]).winner
    Frame(101#)
    """

    frames: tuple[Frame, ...]
    bus: str
    stopped: tuple[int | None, ...]

    @property
    def winner(self) -> Frame:
        """The frame that goes on."""
        return self.frames[self.stopped.index(None)]

    def plot(
        self, names: Sequence[str] = (), ax: Axes | None = None, *, upto: int | None = None
    ) -> Axes:
        """Draw what each sender puts on the bus, one row each, and the bus below.

        `names` are the labels of the rows, by default the frames as text; `upto` is the last bit
        to show.
        """
        from shipnet.can.plot import plot_arbitration

        return plot_arbitration(self, names, ax, upto)


def arbitrate(frames: Sequence[Frame]) -> Arbitration:
    """Send frames that begin together, bit by bit, until one is left.

    Parameters
    ----------
    frames : sequence of Frame
        One or more; no two with the same id, length of the id and kind.

    Returns
    -------
    Arbitration
        What was on the bus, and at which bit each sender stopped.

    Raises
    ------
    ArgumentError
        If there is no frame, something else is among them, or two do not differ before
        their data.

    Notes
    -----
    The bus is taken to be short: within a bit time every node has read the same level.

    References
    ----------
    .. [1] Robert Bosch GmbH, "CAN Specification", version 2.0, 1991, section 1, bus values and
       arbitration.

    Examples
    --------
    0x200 sends its first 1 in bit 2, where the others send 0; 0x101 differs from 0x100 in the
    last bit of the id, which is bit 12 on the bus, because a stuff bit is sent before it:

    >>> contest = arbitrate([Frame(0x200), Frame(0x101), Frame(0x100)])
    >>> contest.stopped, contest.bus
    ((2, 12, None), '000100000100000')
    """
    given = tuple(frames)
    strange = [frame for frame in given if not isinstance(frame, Frame)]
    if strange or not given:
        raise ArgumentError(f"frames are {given!r}; there must be one Frame or more")
    rows = [frame.bits for frame in given]
    ends = [_end(frame) for frame in given]
    active = set(range(len(given)))
    stopped: list[int | None] = [None] * len(given)
    bus = ""
    while len(bus) < max(ends[k] for k in active):
        place = len(bus)
        level = min(rows[k][place] for k in active)
        for k in sorted(active):
            if rows[k][place] != level:
                stopped[k] = place
                active.remove(k)
        bus += level
    if len(active) > 1:
        same = " and ".join(str(given[k]) for k in sorted(active))
        raise ArgumentError(f"frames {same} have the same id; they would collide in their data")
    return Arbitration(given, bus, tuple(stopped))


def _end(frame: Frame) -> int:
    """Return how many bits of a frame, stuff bits included, can decide an arbitration."""
    last = "RTR" if frame.extended else "IDE"
    return 1 + next(field.line_start for field in frame.fields if field.name == last)
