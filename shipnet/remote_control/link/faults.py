"""What can go wrong on the link; times are seconds from the start of the simulation."""

from __future__ import annotations

from dataclasses import dataclass, fields
from numbers import Real

from shipnet.errors import ArgumentError
from shipnet.remote_control.signals import HOPS, STATIONS

__all__ = ["BitErrors", "Dead", "Fault", "LostPacket", "Stall"]

_NEVER = float("inf")


@dataclass(frozen=True)
class Fault:
    """What all faults share: the check of their fields."""

    def __post_init__(self) -> None:
        """Check station, times and probability."""
        values = {field.name: getattr(self, field.name) for field in fields(self)}
        if values.get("station", "RCS") not in STATIONS:
            raise ArgumentError(f"station is {values['station']!r}; it must be one of {STATIONS}")
        if "source" in values and (values["source"], values["target"]) not in HOPS:
            raise ArgumentError(
                f"source and target are {values['source']!r}, {values['target']!r}; one must be "
                "RCS, the other BCS or SS"
            )
        for name in values.keys() & {"start", "stop", "rate"}:
            if isinstance(values[name], bool) or not isinstance(values[name], Real):
                raise ArgumentError(f"{name} is {values[name]!r}; it must be a number")
        start, stop = values.get("start", 0.0), values.get("stop", _NEVER)
        if not 0 <= start < stop or start == _NEVER:
            raise ArgumentError(
                f"start is {start} s and stop is {stop} s; they must be 0 <= start < stop"
            )
        if not 0 <= values.get("rate", 0.0) <= 0.5:
            raise ArgumentError(f"rate is {values['rate']}; it must be 0..0.5")


@dataclass(frozen=True)
class Dead(Fault):
    """A station does nothing from `start` to `stop`.

    Parameters
    ----------
    station : str
        RCS, BCS or SS.
    start : float, default 0
        When it dies [s].
    stop : float, default inf
        When it is switched on again, with everything it knew [s].

    Examples
    --------
    >>> Dead("SS", start=1.0)
    Dead(station='SS', start=1.0, stop=inf)
    """

    station: str
    start: float = 0.0
    stop: float = _NEVER


@dataclass(frozen=True)
class Stall(Fault):
    """A slow task, such as writing an EEPROM, keeps a station from reading its ring and sending.

    Interrupts go on: bytes are stored, and ticks counted. A packet that is being sent is finished.

    Parameters
    ----------
    station : str
        RCS, BCS or SS.
    start, stop : float
        Begin and end [s]; the end must be finite.

    Examples
    --------
    >>> Stall("BCS", 1.0, 1.2).stop
    1.2
    """

    station: str
    start: float
    stop: float

    def __post_init__(self) -> None:
        """Check the fields, and that the stall ends."""
        super().__post_init__()
        if self.stop == _NEVER:
            raise ArgumentError("stop is inf; a stall must end")


@dataclass(frozen=True)
class LostPacket(Fault):
    """A packet is lost on the line: the first that its sender begins at `start` or later.

    Parameters
    ----------
    source, target : str
        From whom to whom.
    start : float
        From when on [s].

    Examples
    --------
    >>> LostPacket("BCS", "RCS", 1.0).start
    1.0
    """

    source: str
    target: str
    start: float


@dataclass(frozen=True)
class BitErrors(Fault):
    """Bits on all lines are inverted at random, independently of each other.

    A byte whose start bit is hit is lost. A hit parity or stop bit does no harm, for the printed
    interrupt routine stores the byte without a look at the status register.

    Parameters
    ----------
    rate : float
        Probability, 0..0.5.

    Examples
    --------
    >>> BitErrors(1)
    Traceback (most recent call last):
        ...
    shipnet.errors.ArgumentError: rate is 1; it must be 0..0.5
    """

    rate: float
