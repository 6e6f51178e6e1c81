"""What can fail on a redundant line: sections of cable, slaves, ports of the master."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

from shipnet.errors import ArgumentError
from shipnet.fields import check_scalar, check_whole

__all__ = ["Break", "DeadPort", "DeadSlave", "Fault", "Port", "Short", "check_faults"]

Port = Literal["A", "B"]

_NEVER = float("inf")


class Fault:
    """What all faults share: a time at which they begin, and one at which they are mended."""

    start: float
    stop: float

    def __post_init__(self) -> None:
        """Check the times."""
        check_scalar("start", self.start, "s", 0, 1e9)
        check_scalar("stop", self.stop, "s", 0, _NEVER)
        if not self.stop > self.start:
            raise ArgumentError(f"stop is {self.stop} s; it must be later than {self.start} s")


@dataclass(frozen=True)
class Break(Fault):
    """A section of the cable is interrupted.

    Parameters
    ----------
    section : int
        Section k lies between slave k and slave k + 1; section 0 is at port A, and the last one
        at port B. On `Channels`, 0 and 1 are the cables of channel 1 and 2.
    start : float, default 0
        When it begins, 0..1e9 [s].
    stop : float, default inf
        When it is mended, later than `start` [s].

    Raises
    ------
    ArgumentError
        If a field is out of its range.

    Examples
    --------
    >>> print(Break(2, start=10))
    break 2
    """

    section: int
    start: float = 0.0
    stop: float = _NEVER

    def __post_init__(self) -> None:
        """Check every field."""
        super().__post_init__()
        check_whole("section", self.section, 0, 247)

    def __str__(self) -> str:
        """Return the short name that tables use."""
        return f"break {self.section}"


@dataclass(frozen=True)
class Short(Fault):
    """The two conductors of a section touch: without isolators, all that they reach is dead.

    Parameters
    ----------
    section, start, stop
        As for `Break`.

    Examples
    --------
    >>> print(Short(2))
    short 2
    """

    section: int
    start: float = 0.0
    stop: float = _NEVER

    def __post_init__(self) -> None:
        """Check every field."""
        super().__post_init__()
        check_whole("section", self.section, 0, 247)

    def __str__(self) -> str:
        """Return the short name that tables use."""
        return f"short {self.section}"


@dataclass(frozen=True)
class DeadSlave(Fault):
    """A slave does not answer; the cable runs on past it.

    Parameters
    ----------
    slave : int
        Its number on the cable, counted from port A. On `Channels`, 1 and 2 are the slaves of
        channel 1 and 2.
    start, stop
        As for `Break`.

    Examples
    --------
    >>> print(DeadSlave(3, start=1, stop=2))
    slave 3
    """

    slave: int
    start: float = 0.0
    stop: float = _NEVER

    def __post_init__(self) -> None:
        """Check every field."""
        super().__post_init__()
        check_whole("slave", self.slave, 1, 247)

    def __str__(self) -> str:
        """Return the short name that tables use."""
        return f"slave {self.slave}"


@dataclass(frozen=True)
class DeadPort(Fault):
    """A port of the master neither sends nor hears, and leaves the line alone.

    Parameters
    ----------
    port : {"A", "B"}
        Which. On `Channels`, A is channel 1 and B is channel 2.
    start, stop
        As for `Break`.

    Examples
    --------
    >>> print(DeadPort("B"))
    port B
    """

    port: Port
    start: float = 0.0
    stop: float = _NEVER

    def __post_init__(self) -> None:
        """Check every field."""
        super().__post_init__()
        if self.port not in ("A", "B"):
            raise ArgumentError(f"port is {self.port!r}; it must be A or B")

    def __str__(self) -> str:
        """Return the short name that tables use."""
        return f"port {self.port}"


def check_faults(faults: Iterable[Fault]) -> tuple[Fault, ...]:
    """Return faults as a tuple, or raise if they are no list; one alone is none.

    Parameters
    ----------
    faults : iterable of Fault
        What was given. Whether a line has what fails is for `Loop.reach` and `Channels.reach`.

    Returns
    -------
    tuple of Fault
        The faults.

    Raises
    ------
    ArgumentError
        If they are no list.

    Examples
    --------
    >>> check_faults(DeadPort("A"))
    Traceback (most recent call last):
        ...
    shipnet.errors.ArgumentError: faults is DeadPort(port='A', start=0.0, stop=inf); faults must \
come in a list
    """
    if isinstance(faults, Fault | str) or not isinstance(faults, Iterable):
        raise ArgumentError(f"faults is {faults!r}; faults must come in a list")
    return tuple(faults)
