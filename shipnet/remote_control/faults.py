"""The stations of the link, and faults: a dead station, a stalled task, a lost packet."""

from __future__ import annotations

from math import inf

from shipnet.clock import Fault
from shipnet.errors import ArgumentError
from shipnet.fields import choice, record

__all__ = ["DeadStation", "LostPacket", "Stall"]
__dir__ = __all__.copy

Hop = tuple[str, str]

#: Remote control system in the engine room (the master), bridge control system, safety system.
STATIONS = ("RCS", "BCS", "SS")

#: Senders and receivers, in the order of a cycle: chung1998, section 4.
HOPS: tuple[Hop, ...] = (("RCS", "BCS"), ("BCS", "RCS"), ("RCS", "SS"), ("SS", "RCS"))


@record
class DeadStation(Fault):
    """A station is inactive from `start` to `stop`, and then continues with its old values.

    Examples
    --------
    >>> from shipnet.remote_control import faults
    >>> faults.DeadStation("SS", start=3.0)
    DeadStation(start=3.0, stop=inf, station='SS')
    """

    station: str = choice(STATIONS, "Station that is inactive")


@record
class Stall(Fault):
    """A slow task, such as an EEPROM write, keeps a station from reading its ring and from sending.

    Interrupts continue: bytes are stored and ticks counted. A packet that is being sent is
    completed. A stall must end.

    Examples
    --------
    >>> from shipnet.remote_control import faults
    >>> faults.Stall("BCS", start=1.0, stop=1.2).stop
    1.2
    """

    station: str = choice(STATIONS, "Station whose task is slow")

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.stop == inf:
            raise ArgumentError("stop is inf; a stall must end")


@record
class LostPacket(Fault):
    """A packet is lost: the first one that its sender begins between `start` and `stop`.

    Examples
    --------
    >>> from shipnet.remote_control import faults
    >>> faults.LostPacket("BCS", "RCS", start=1.0).start
    1.0
    """

    source: str = choice(STATIONS, "Sender of the packet")
    target: str = choice(STATIONS, "Receiver of the packet; either sender or receiver is RCS")

    def __post_init__(self) -> None:
        super().__post_init__()
        if (self.source, self.target) not in HOPS:
            raise ArgumentError(
                f"source and target are {self.source!r}, {self.target!r}; one must be RCS, the "
                "other BCS or SS"
            )
