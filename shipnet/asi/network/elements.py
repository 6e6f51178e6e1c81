"""What an AS-i installation is made of: cables, masters, supplies, slaves, repeaters, terminators.

Each element knows its node, the point of the cable to which it is clamped, and checks its own
numbers; whether the whole makes sense is for `plan` and `rules` to ask.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Literal

from shipnet.asi.profile import Profile
from shipnet.errors import ArgumentError
from shipnet.fields import check_scalar, check_whole
from shipnet.line.cable import CABLES

__all__ = [
    "RANGES",
    "CableRun",
    "Device",
    "Element",
    "Master",
    "Repeater",
    "Slave",
    "Supply",
    "Terminator",
]

#: Legal values of each quantity: unit, lowest, highest. Outside them a plan is a slip of the pen;
#: within them it may still break a rule of `shipnet.asi.network.rules`.
RANGES: dict[str, tuple[str, float, float]] = {
    "length": ("m", 0.01, 10e3),
    "current": ("A", 0.0, 10.0),
    "voltage": ("V", 1.0, 60.0),
    "rating": ("A", 0.01, 100.0),
    "delay": ("s", 0.0, 1e-3),
    "resistance": ("ohm", 1.0, 1e6),
}

#: Current of a slave unless it is given, from Schneider's AS-i help D-SA-0011271: 65 mA on
#: average. Masters and repeaters are assumed to draw the same.
CURRENT = 0.065

#: Profile of a slave unless it is given: four inputs, and an address of its own.
PROFILE = Profile(0, 0xF)

#: Delay of a repeater in one direction unless it is given [s]: assumed, one bit time. No maker's
#: figure was found; two such repeaters just fit the time-out of 10 bit times, three do not.
REPEATER_DELAY = 6e-6

#: Resistance of a terminator or extension plug unless it is given [ohm]: assumed, the wave
#: impedance of the cable. A capacitor keeps the supply away from it.
TERMINATOR = 100.0


class _Checked:
    """Checks the fields of an element by their names."""

    __slots__ = ()

    def __post_init__(self) -> None:
        """Check every field."""
        for field in fields(self):  # type: ignore[arg-type]  # every child is a dataclass
            value = getattr(self, field.name)
            if field.name in RANGES:
                unit, low, high = RANGES[field.name]
                value = check_scalar(f"{field.name} of {self}", value, unit, low, high)
                object.__setattr__(self, field.name, value)
            elif field.name in ("node", "a", "b"):
                _check_node(value)


def _check_node(name: object) -> None:
    # What a file could not give back is no name.
    if not isinstance(name, str) or not name or name != name.strip() or not name.isprintable():
        raise ArgumentError(
            f"a node is {name!r}; it must be a printable name without blanks around it"
        )


@dataclass(frozen=True, slots=True)
class CableRun(_Checked):
    """A cable between two nodes.

    Parameters
    ----------
    a, b : str
        Nodes at its ends.
    length : float
        Length, 0.01..10000 [m].
    cable : str, default "as-i 1.5"
        Its type, a key of `shipnet.line.cable.CABLES`.
    """

    a: str
    b: str
    length: float
    cable: str = "as-i 1.5"

    def __post_init__(self) -> None:
        """Check the ends and the type."""
        _Checked.__post_init__(self)
        if self.a == self.b:
            raise ArgumentError(f"{self} ends where it begins; its two nodes must differ")
        if self.cable not in CABLES:
            raise ArgumentError(
                f"cable of {self} is {self.cable!r}; it must be one of {', '.join(CABLES)}"
            )

    def __str__(self) -> str:
        """Name the cable by its ends."""
        return f"cable {self.a} - {self.b}"


@dataclass(frozen=True, slots=True)
class Master(_Checked):
    """A master.

    Parameters
    ----------
    node : str
        Where it is.
    current : float, default 0.065
        What it draws from the line [A]; assumed to be that of a slave.
    """

    node: str
    current: float = CURRENT

    def __str__(self) -> str:
        """Name the master by its node."""
        return f"master at {self.node}"


@dataclass(frozen=True, slots=True)
class Supply(_Checked):
    """A power supply with its decoupling.

    Parameters
    ----------
    node : str
        Where it is.
    voltage : float, default 30
        Voltage, 1..60 [V].
    rating : float, default 8
        Most current that it delivers [A].
    """

    node: str
    voltage: float = 30.0
    rating: float = 8.0

    def __str__(self) -> str:
        """Name the supply by its node."""
        return f"supply at {self.node}"


@dataclass(frozen=True, slots=True)
class Slave(_Checked):
    """A slave.

    Parameters
    ----------
    node : str
        Where it is.
    address : int
        Its address, 0..31.
    half : {"A", "B"}, optional
        Which half of the address is its own; None for a standard slave.
    profile : Profile, default S-0.F
        What it is; the default has four inputs and no address to share.
    current : float, default 0.065
        What it draws from the line, sensors included [A].

    Examples
    --------
    >>> print(Slave("hatch 3", 12, "B", Profile.parse("S-0.A")))
    slave 12B at hatch 3
    """

    node: str
    address: int
    half: Literal["A", "B"] | None = None
    profile: Profile = PROFILE
    current: float = CURRENT

    def __post_init__(self) -> None:
        """Check address, half and profile."""
        object.__setattr__(self, "address", check_whole("address", self.address, 0, 31))
        if self.half not in (None, "A", "B"):
            raise ArgumentError(f"half is {self.half!r}; it must be 'A', 'B' or None")
        if not isinstance(self.profile, Profile):
            raise ArgumentError(f"profile is {self.profile!r}; it must be a Profile")
        _Checked.__post_init__(self)

    @property
    def label(self) -> str:
        """Address and half, such as ``12B``."""
        return f"{self.address}{self.half or ''}"

    def __str__(self) -> str:
        """Name the slave by address and node."""
        return f"slave {self.label} at {self.node}"


@dataclass(frozen=True, slots=True)
class Repeater(_Checked):
    """A repeater: it couples two segments, and passes telegrams but no current.

    Parameters
    ----------
    a, b : str
        Its nodes, one in either segment; which of them lies toward the master follows from the
        plan.
    delay : float, default 6e-6
        Delay in one direction, 0..1e-3 [s]; the default is assumed.
    current : float, default 0.065
        What it draws from either segment [A]; assumed to be that of a slave.
    """

    a: str
    b: str
    delay: float = REPEATER_DELAY
    current: float = CURRENT

    def __str__(self) -> str:
        """Name the repeater by its nodes."""
        return f"repeater {self.a} | {self.b}"


@dataclass(frozen=True, slots=True)
class Terminator(_Checked):
    """A terminator or extension plug: a resistance that only the signal meets.

    Parameters
    ----------
    node : str
        Where it is.
    resistance : float, default 100
        Resistance, 1..1e6 [ohm]; the default is assumed.
    """

    node: str
    resistance: float = TERMINATOR

    def __str__(self) -> str:
        """Name the terminator by its node."""
        return f"terminator at {self.node}"


#: What sits at one node.
Device = Master | Supply | Slave | Terminator

Element = CableRun | Device | Repeater
