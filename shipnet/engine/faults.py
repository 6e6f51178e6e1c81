"""What can go wrong in the system. Times are seconds from the start of the AMS."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, ClassVar

from shipnet.clock import Fault, as_faults
from shipnet.errors import ArgumentError
from shipnet.fields import number, record, text

if TYPE_CHECKING:
    from shipnet.engine.system import System

__all__ = [
    "BusOff",
    "CanBreak",
    "DeadBox",
    "DeadPort",
    "LostCanFrames",
    "LostModbusFrames",
    "ModbusBreak",
    "StuckSensor",
]


@record
class EngineFault(Fault):
    """A fault at a place of the system; the kinds derive from it."""

    words: ClassVar[str] = ""

    where: str = text("What fails")

    def places(self, system: System) -> tuple[str, ...]:
        """Return what can fail in this way."""
        return system.boxes

    def __str__(self) -> str:
        """Say what fails."""
        return f"{self.words} {self.where}".strip()


@record
class CanBreak(EngineFault):
    """A CAN cable is broken; `where` is one of `System.segments`.

    Notes
    -----
    A break splits a line into two. Each part is left with one terminator of the two. Here both go
    on working, which is an **assumption** that suits short cables and a low bit rate. What is
    queued or on the bus at the moment of the break, or of its repair, is lost. A box that is left
    alone gets no acknowledgement and is heard by nobody.

    Examples
    --------
    >>> print(CanBreak("JB1-JB2", start=10))
    CAN cable cut JB1-JB2
    """

    words: ClassVar[str] = "CAN cable cut"

    def places(self, system: System) -> tuple[str, ...]:
        """Return the cables."""
        return system.segments


@record
class _AtChannel(EngineFault):
    """A fault of a Modbus channel."""

    def places(self, system: System) -> tuple[str, ...]:
        """Return the channels."""
        return "1", "2"


@record
class ModbusBreak(_AtChannel):
    """The cable of a Modbus channel is broken; `where` is ``"1"`` or ``"2"``.

    Examples
    --------
    >>> print(ModbusBreak("1", start=10, stop=20))
    Modbus cable cut 1
    """

    words: ClassVar[str] = "Modbus cable cut"


@record
class DeadPort(_AtChannel):
    """A port of the AMS is dead; `where` is ``"1"`` or ``"2"``.

    Examples
    --------
    >>> print(DeadPort("2"))
    AMS port dead 2
    """

    words: ClassVar[str] = "AMS port dead"


@record
class DeadBox(EngineFault):
    """A box has no supply, or its one CPU is dead; after its return it has no values of others.

    Examples
    --------
    >>> print(DeadBox("JB2"))
    box dead JB2
    """

    words: ClassVar[str] = "box dead"


@record
class BusOff(EngineFault):
    """The CAN controller of a box has left the bus; the box neither sends nor receives.

    Examples
    --------
    >>> print(BusOff("JB2"))
    CAN bus-off JB2
    """

    words: ClassVar[str] = "CAN bus-off"


@record
class StuckSensor(EngineFault):
    """The input of a point, named by its tag, does not change any more.

    Examples
    --------
    >>> print(StuckSensor("ME-JB1-001"))
    sensor stuck ME-JB1-001
    """

    words: ClassVar[str] = "sensor stuck"

    def places(self, system: System) -> tuple[str, ...]:
        """Return the tags."""
        return tuple(point.tag for point in system.points)


@record
class LostCanFrames(EngineFault):
    """CAN frames of a box are lost at random at each receiver, by overrun of its buffers.

    Examples
    --------
    >>> LostCanFrames("JB2", probability=0.1).probability
    0.1
    """

    words: ClassVar[str] = "CAN frames lost of"

    probability: float = number(
        0, 1, "", "That one receiver loses one frame", default=0.5, kw_only=True
    )


@record
class LostModbusFrames(_AtChannel):
    """Modbus frames of a channel, ``"1"`` or ``"2"``, are damaged at random.

    Examples
    --------
    >>> LostModbusFrames("1", response=0.2).response
    0.2
    """

    words: ClassVar[str] = "Modbus frames lost on"

    request: float = number(
        0, 1, "", "Probability that a request is not understood", default=0.5, kw_only=True
    )
    response: float = number(
        0, 1, "", "Probability that a response is not understood", default=0.0, kw_only=True
    )


#: All kinds.
KINDS: tuple[type[EngineFault], ...] = (
    CanBreak, ModbusBreak, DeadPort, DeadBox, BusOff, StuckSensor, LostCanFrames, LostModbusFrames,
)  # fmt: skip


def check_faults(system: System, faults: Fault | Iterable[Fault]) -> tuple[EngineFault, ...]:
    """Return one or several faults as a tuple, or raise unless the system has what fails."""
    found: list[EngineFault] = []
    for fault in as_faults(faults, *KINDS):
        assert isinstance(fault, EngineFault)
        legal = fault.places(system)
        if fault.where not in legal:
            few = [*legal[:6], *(["..."] if len(legal) > 6 else [])]
            raise ArgumentError(f"where is {fault.where!r}; it must be one of {', '.join(few)}")
        found.append(fault)
    return tuple(found)


def outages(
    faults: Iterable[EngineFault], where: str, *kinds: type[Fault]
) -> list[tuple[int, int]]:
    """Return begin and end [ns] of each fault of some kinds at a place, in order."""
    return sorted(fault.span for fault in faults if type(fault) in kinds and fault.where == where)


def single_faults(
    system: System, start: float = 10.0, *, every_sensor: bool = False
) -> tuple[EngineFault, ...]:
    """Return all lasting single faults of a system."""
    if not isinstance(every_sensor, bool):
        raise ArgumentError(f"every_sensor is {every_sensor!r}; it must be True or False")
    boxes = dict.fromkeys(system.boxes)
    stuck = [point for point in system.points if every_sensor or boxes.pop(point.box, 1) is None]
    places: list[tuple[type[EngineFault], Iterable[str]]] = [
        (CanBreak, system.segments),
        *((kind, ("1", "2")) for kind in (ModbusBreak, DeadPort)),
        *((kind, system.boxes) for kind in (DeadBox, BusOff, LostCanFrames)),
        (LostModbusFrames, ("1", "2")),
        (StuckSensor, [point.tag for point in stuck]),
    ]
    return tuple(kind(where, start=start) for kind, some in places for where in some)


def parse_fault(system: System, words: str) -> EngineFault:
    """Return the lasting fault that these words name, such as ``box dead JB1``."""
    known = {str(fault): fault for fault in single_faults(system, 0.0, every_sensor=True)}
    if words not in known:
        few = ", ".join(str(fault) for fault in single_faults(system, 0.0))
        raise ArgumentError(f"fault is {words!r}; it must be one of {few}")
    return known[words]
