"""The receive side of a station: the interrupt that fills the ring, and the task that reads it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

from shipnet.remote_control.items import Items
from shipnet.remote_control.link.system import System
from shipnet.remote_control.packet import Parser
from shipnet.remote_control.ring_buffer import Ring

__all__ = ["Reading", "Receiver"]


class Reading(NamedTuple):
    """What the task found when it emptied the ring.

    Attributes
    ----------
    packets : list of Items
        Packets that are complete.
    unread : int
        Bytes that had been stored and not yet read.
    repaired : bool
        Whether the reader had to give up a part of the ring: case c of `Ring`.
    stopped : bool
        Whether it stopped before the ring was empty: case a.
    lost : int
        Bytes that will never be read.
    """

    packets: list[Items]
    unread: int
    repaired: bool
    stopped: bool
    lost: int


@dataclass(slots=True)
class Receiver:
    """Ring and parser of one station.

    Parameters
    ----------
    system : System
        Format of the packets, size and rule of the ring.

    Examples
    --------
    >>> system = System()
    >>> receiver = Receiver(system)
    >>> for byte in system.packet_format.encode({0: 7}):
    ...     receiver.store(byte)
    >>> receiver.read()
    Reading(packets=[((0, 7),)], unread=6, repaired=False, stopped=False, lost=0)
    """

    system: System
    _ring: Ring = field(init=False)
    _parser: Parser = field(init=False)

    def __post_init__(self) -> None:
        """Begin with an empty ring."""
        self._ring = Ring(self.system.ring_size, self.system.ring_rule)
        self._parser = self.system.packet_format.parser()

    def store(self, byte: int) -> None:
        """Put a byte into the ring, as the interrupt does.

        Parameters
        ----------
        byte : int
            What the chip has received.
        """
        self._ring.store(byte)

    def read(self) -> Reading:
        """Take everything out of the ring, and return what was in it."""
        ring = self._ring
        unread, lost_before = ring.unread, ring.lost
        data, repaired = bytearray(), False
        while (step := ring.extract()).action in ("take", "repair"):
            if step.byte is None:
                repaired = True
            else:
                data.append(step.byte)
        stopped = step.action == "stop"
        packets = self._parser.feed(bytes(data))
        return Reading(packets, unread, repaired, stopped, ring.lost - lost_before)
