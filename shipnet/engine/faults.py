"""Faults of the system; times are in seconds from the start of the simulation."""

from __future__ import annotations

from collections.abc import Iterable
from typing import ClassVar, Literal

from shipnet.clock import Fault
from shipnet.fields import number, record, text

__all__ = [
    "BusOff",
    "CanBreak",
    "DeadBox",
    "DeadPort",
    "LostCanFrames",
    "LostModbusFrames",
    "ModbusBreak",
    "OpenWire",
    "ShortCircuit",
    "StuckSensor",
]
__dir__ = __all__.copy


@record
class EngineFault(Fault):
    """A fault at a place in the system; base class of all kinds of faults."""

    words: ClassVar[str] = ""
    at: ClassVar[Literal["box", "cable", "channel", "sensor"]] = "box"

    where: str = text("Place that fails")

    def __str__(self) -> str:
        return f"{self.words} {self.where}".strip()


@record
class CanBreak(EngineFault):
    """A CAN cable is broken; `where` is one of `System.segments`.

    Notes
    -----
    In a line, a break splits the bus into two parts, each with one of the two terminators. Both
    are **assumed** to work, as they can on short cables at low bit rates. Frames queued or on the
    bus when the cable breaks or is repaired are lost. An isolated box receives no acknowledgement.

    Examples
    --------
    >>> print(CanBreak("JB1-JB2", start=10))
    CAN cable cut JB1-JB2
    """

    words = "CAN cable cut"
    at = "cable"


@record
class ModbusBreak(EngineFault):
    """The cable of a Modbus channel is broken; `where` is ``"1"`` or ``"2"``.

    Examples
    --------
    >>> print(ModbusBreak("1", start=10, stop=20))
    Modbus cable cut 1
    """

    words = "Modbus cable cut"
    at = "channel"


@record
class DeadPort(EngineFault):
    """A port of the AMS is dead; `where` is ``"1"`` or ``"2"``.

    Examples
    --------
    >>> print(DeadPort("2"))
    AMS port dead 2
    """

    words = "AMS port dead"
    at = "channel"


@record
class DeadBox(EngineFault):
    """A box has no supply or a dead CPU; after the fault it restarts with no stored values.

    Examples
    --------
    >>> print(DeadBox("JB2"))
    box dead JB2
    """

    words = "box dead"


@record
class BusOff(EngineFault):
    """The CAN controller of a box is bus-off; the box neither sends nor receives CAN frames.

    Examples
    --------
    >>> print(BusOff("JB2"))
    CAN bus-off JB2
    """

    words = "CAN bus-off"


@record
class StuckSensor(EngineFault):
    """The input of a point no longer changes; `where` is the tag of the point.

    Examples
    --------
    >>> print(StuckSensor("ME-JB1-001"))
    sensor stuck ME-JB1-001
    """

    words = "sensor stuck"
    at = "sensor"


@record
class OpenWire(EngineFault):
    """A wire of a sensor is broken; `where` is the tag of the point.

    Examples
    --------
    >>> print(OpenWire("ME-JB1-001"))
    sensor wire open ME-JB1-001
    """

    words = "sensor wire open"
    at = "sensor"


@record
class ShortCircuit(EngineFault):
    """The wires of a sensor are short-circuited; `where` is the tag of the point.

    Examples
    --------
    >>> print(ShortCircuit("ME-JB1-001"))
    sensor wires shorted ME-JB1-001
    """

    words = "sensor wires shorted"
    at = "sensor"


@record
class LostCanFrames(EngineFault):
    """Each receiver loses CAN frames of a box at random, because the receiver's buffers overrun.

    Examples
    --------
    >>> LostCanFrames("JB2", probability=0.1).probability
    0.1
    """

    words = "lost CAN frames of"

    probability: float = number(
        0, 1, "", "Probability that one receiver loses one frame", default=0.5, kw_only=True
    )


@record
class LostModbusFrames(EngineFault):
    """Modbus frames on a channel are damaged at random; `where` is ``"1"`` or ``"2"``.

    Examples
    --------
    >>> LostModbusFrames("1", response=0.2).response
    0.2
    """

    words = "lost Modbus frames on"
    at = "channel"

    request: float = number(
        0, 1, "", "Probability that a request arrives damaged", default=0.5, kw_only=True
    )
    response: float = number(
        0, 1, "", "Probability that a response arrives damaged", default=0.0, kw_only=True
    )


#: Kinds, in the order of the rows of `single_failures`.
KINDS: tuple[type[EngineFault], ...] = (
    CanBreak,
    ModbusBreak,
    DeadPort,
    DeadBox,
    BusOff,
    LostCanFrames,
    LostModbusFrames,
    StuckSensor,
)

#: Faults of a sensor's wires, which make values wrong but not old.
WIRES: dict[Literal["open", "short"], type[EngineFault]] = {"open": OpenWire, "short": ShortCircuit}


def outages(
    faults: Iterable[EngineFault], where: str, *kinds: type[Fault]
) -> list[tuple[int, int]]:
    """Return start and end [ns] of each fault of the given kinds at a place, in order."""
    return sorted(fault.span for fault in faults if type(fault) in kinds and fault.where == where)
