"""What can go wrong in the system. Times are seconds from the start of the AMS."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, fields
from math import inf

from shipnet.clock import nanoseconds
from shipnet.engine.system import System
from shipnet.errors import ArgumentError
from shipnet.fields import check_scalar

__all__ = [
    "BusOff",
    "CutCan",
    "CutModbus",
    "DeadBox",
    "DeadPort",
    "Fault",
    "LostCan",
    "LostModbus",
    "StuckSensor",
    "check_faults",
    "outages",
    "single_faults",
]

#: A time behind all others [ns].
_NEVER = 1 << 62


@dataclass(frozen=True)
class Fault:
    """What all faults share: begin, end and their checks.

    Parameters
    ----------
    where : str
        What fails.
    start : float, default 0
        When it begins, 0..1e6 [s].
    stop : float, default inf
        When it is over [s].

    Raises
    ------
    ArgumentError
        If a time or a probability is out of its range.
    """

    where: str
    start: float = 0.0
    stop: float = inf

    def __post_init__(self) -> None:
        """Check times and probabilities."""
        if not isinstance(self.where, str):
            raise ArgumentError(f"where is {self.where!r}; it must be a name as text")
        check_scalar("start", self.start, "s", 0.0, 1e6)
        check_scalar("stop", self.stop, "s", 0.0, inf)
        if not self.start < self.stop:
            raise ArgumentError(f"stop is {self.stop!r} s; it must be after start, {self.start} s")
        for name in {"probability", "request", "response"} & {f.name for f in fields(self)}:
            check_scalar(name, getattr(self, name), "", 0, 1)

    @property
    def span(self) -> tuple[int, int]:
        """Begin and end [ns]."""
        return nanoseconds(self.start), _NEVER if self.stop == inf else nanoseconds(self.stop)

    def places(self, system: System) -> tuple[str, ...]:
        """Return what can fail in this way.

        Parameters
        ----------
        system : System
            Where.
        """
        return system.boxes

    def __str__(self) -> str:
        """Say what fails."""
        return f"{_WORDS[type(self)]} {self.where}".strip()


class _AtChannel(Fault):
    def places(self, system: System) -> tuple[str, ...]:
        """Return the channels."""
        return "1", "2"


class CutCan(Fault):
    """A CAN cable is cut; `where` is one of `System.segments`.

    Notes
    -----
    A cut splits a line into two. Each part is left with one terminating resistor of the two. Here
    both go on working, which is an **assumption** that suits short cables and a low bit rate. What
    is queued or on the bus at the moment of the cut, or of its mending, is lost. A box that is
    left alone gets no acknowledgement and is heard by nobody.

    Examples
    --------
    >>> print(CutCan("JB1-JB2", start=10))
    CAN cable cut JB1-JB2
    """

    def places(self, system: System) -> tuple[str, ...]:
        """Return the cables."""
        return system.segments


class CutModbus(_AtChannel):
    """The cable of a Modbus channel is cut; `where` is ``"1"`` or ``"2"``.

    Examples
    --------
    >>> print(CutModbus("1", start=10, stop=20))
    Modbus cable cut 1
    """


class DeadPort(_AtChannel):
    """A port of the AMS is dead; `where` is ``"1"`` or ``"2"``.

    Examples
    --------
    >>> print(DeadPort("2"))
    AMS port dead 2
    """


class DeadBox(Fault):
    """A box has no supply, or its one CPU is dead. When it returns, it knows nothing of others.

    Examples
    --------
    >>> print(DeadBox("JB2"))
    box dead JB2
    """


class BusOff(Fault):
    """The CAN controller of a box has left the bus; the box neither sends nor receives.

    Examples
    --------
    >>> print(BusOff("JB2"))
    CAN bus-off JB2
    """


class StuckSensor(Fault):
    """The input of a point, named by its tag, does not change any more.

    Examples
    --------
    >>> print(StuckSensor("ME-JB1-001"))
    sensor stuck ME-JB1-001
    """

    def places(self, system: System) -> tuple[str, ...]:
        """Return the tags."""
        return tuple(point.tag for point in system.points)


@dataclass(frozen=True)
class LostCan(Fault):
    """CAN frames of a box are lost at random at each receiver, by overrun of its buffers.

    Parameters
    ----------
    where : str
        The sender.
    start, stop : float
        As `Fault`.
    probability : float, default 0.5
        That one receiver loses one frame, 0..1.

    Examples
    --------
    >>> LostCan("JB2", probability=0.1).probability
    0.1
    """

    probability: float = 0.5


@dataclass(frozen=True)
class LostModbus(_AtChannel):
    """Modbus frames are damaged at random.

    Parameters
    ----------
    where : str
        The channel, ``"1"`` or ``"2"``.
    start, stop : float
        As `Fault`.
    request, response : float, default 0.5 and 0
        Probability that a request is not understood, and a response not, 0..1.

    Examples
    --------
    >>> LostModbus("1", response=0.2).response
    0.2
    """

    request: float = 0.5
    response: float = 0.0


_WORDS = {
    CutCan: "CAN cable cut",
    CutModbus: "Modbus cable cut",
    DeadPort: "AMS port dead",
    DeadBox: "box dead",
    BusOff: "CAN bus-off",
    StuckSensor: "sensor stuck",
    LostCan: "CAN frames lost of",
    LostModbus: "Modbus frames lost on",
    Fault: "",
}


def check_faults(system: System, faults: Iterable[Fault]) -> tuple[Fault, ...]:
    """Return faults as a tuple, or raise unless the system has what fails.

    Parameters
    ----------
    system : System
        Where they happen.
    faults : iterable of Fault
        What was given.

    Returns
    -------
    tuple of Fault
        The faults.

    Raises
    ------
    ArgumentError
        If they are no list, or one is no fault, or at a place that is not there.

    Examples
    --------
    >>> check_faults(System(), [CutCan("JB3-JB1")])
    Traceback (most recent call last):
        ...
    shipnet.errors.ArgumentError: where is 'JB3-JB1'; it must be one of JB1-JB2, JB2-JB3
    """
    if isinstance(faults, Fault | str) or not isinstance(faults, Iterable):
        raise ArgumentError(f"faults is {faults!r}; faults must come in a list")
    found = tuple(faults)
    for fault in found:
        if not isinstance(fault, Fault) or type(fault) not in _WORDS or type(fault) is Fault:
            raise ArgumentError(f"faults hold {fault!r}; all must be of a class of faults")
        legal = fault.places(system)
        if fault.where not in legal:
            few = [*legal[:6], *(["..."] if len(legal) > 6 else [])]
            raise ArgumentError(f"where is {fault.where!r}; it must be one of {', '.join(few)}")
    return found


def outages(faults: Iterable[Fault], where: str, *kinds: type[Fault]) -> list[tuple[int, int]]:
    """Return when something is out of order.

    Parameters
    ----------
    faults : iterable of Fault
        What goes wrong.
    where : str
        The place.
    *kinds : type
        Classes of faults that count.

    Returns
    -------
    list of (int, int)
        Begin and end [ns] of each fault, in order.

    Examples
    --------
    >>> outages([DeadBox("JB1", 1, 2), DeadBox("JB2", 3)], "JB1", DeadBox)
    [(1000000000, 2000000000)]
    """
    return sorted(fault.span for fault in faults if type(fault) in kinds and fault.where == where)


def single_faults(
    system: System, start: float = 10.0, *, every_sensor: bool = False
) -> tuple[Fault, ...]:
    """Return all single faults of a system that last.

    Parameters
    ----------
    system : System
        The system.
    start : float, default 10
        When they begin [s].
    every_sensor : bool, default False
        Whether each sensor gets stuck in its turn, or the first of each box alone.

    Returns
    -------
    tuple of Fault
        Every cable cut, every port and box dead, every node off the bus, the frames of every box
        and both channels lost by one half, and stuck sensors.

    Raises
    ------
    ArgumentError
        If an argument is out of its range.

    Examples
    --------
    >>> len(single_faults(System())), len(single_faults(System(topology="ring"), every_sensor=True))
    (20, 117)
    """
    if not isinstance(every_sensor, bool):
        raise ArgumentError(f"every_sensor is {every_sensor!r}; it must be True or False")
    boxes = dict.fromkeys(point.box for point in system.points)
    stuck = [point for point in system.points if every_sensor or boxes.pop(point.box, 1) is None]
    found: list[Fault] = [CutCan(segment, start) for segment in system.segments]
    found += [kind(channel, start) for kind in (CutModbus, DeadPort) for channel in ("1", "2")]
    found += [kind(box, start) for kind in (DeadBox, BusOff, LostCan) for box in system.boxes]
    found += [LostModbus(channel, start) for channel in ("1", "2")]
    found += [StuckSensor(point.tag, start) for point in stuck]
    return tuple(found)
