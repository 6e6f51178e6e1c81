"""Devices on the cable other than masters and slaves: supply, repeater, terminator."""

from __future__ import annotations

from shipnet.fields import number, part, record, text
from shipnet.line.network import CableRun as CableRun
from shipnet.line.network import Load, check_node

#: Default current of a slave [A], from Schneider's AS-i help D-SA-0011271: 65 mA on average.
#: Masters and repeaters are assumed to draw the same.
CURRENT = 0.065

#: Load of a slave or a master, the limits of the SAP5S/SAP51 data sheet (2012, p. 29) for an A/B
#: slave.
DEVICE = Load(r=13.5e3, l=13.5e-3, c=50e-12)

#: The decoupling of the power supply, 39 ohm beside 50 uH in each wire: assumed after IEC 62026-2.
POWER_SUPPLY = Load(r=78.0, l=100e-6)


@record
class Supply:
    """A power supply with its decoupling, by default 39 ohm beside 50 uH in each wire.

    Examples
    --------
    >>> print(Supply("bridge", rating=4))
    supply at bridge
    """

    node: str = text("Where it is")
    voltage: float = number(1, 60, "V", "Voltage", default=30.0)
    rating: float = number(0.01, 100, "A", "Maximum current", default=8.0)
    load: Load = part(Load, "Load on the signal", default=POWER_SUPPLY, kw_only=True)

    def __post_init__(self) -> None:
        check_node(self.node)

    def __str__(self) -> str:
        return f"supply at {self.node}"


@record
class Repeater:
    """A repeater: it couples two segments and passes telegrams but no current.

    We found no maker's figure for the delay, so the default is one bit time: two such repeaters
    meet the time-out of 10 bit times, three exceed it. The current is assumed to equal a slave's.

    Examples
    --------
    >>> print(Repeater("deck", "hold"))
    repeater deck | hold
    """

    a: str = text("Node in one segment")
    b: str = text("Node in the other segment")
    delay: float = number(0, 1e-3, "s", "Delay in one direction", default=6e-6)
    current: float = number(0, 10, "A", "Current from each segment", default=CURRENT)

    def __post_init__(self) -> None:
        check_node(self.a)
        check_node(self.b)

    def __str__(self) -> str:
        return f"repeater {self.a} | {self.b}"


@record
class Terminator:
    """A terminator or extension plug: a resistance behind a capacitor, so only for the signal.

    The default resistance is assumed: the wave impedance of the cable.

    Examples
    --------
    >>> print(Terminator("bow"))
    terminator at bow
    """

    node: str = text("Where it is")
    resistance: float = number(1, 1e6, "ohm", "Resistance", default=100.0)

    def __post_init__(self) -> None:
        check_node(self.node)

    def __str__(self) -> str:
        return f"terminator at {self.node}"
