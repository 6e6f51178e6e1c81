"""The limits that a plan keeps, each with its source; what is assumed says so."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from math import isfinite
from typing import ClassVar

from shipnet.design.catalogue import cables
from shipnet.errors import ArgumentError
from shipnet.fields import check_whole
from shipnet.modbus.uart import SerialLine

__all__ = ["AsiLimits", "BoxLimits", "CanLimits", "ModbusLimits", "Settings"]

#: Legal values of each number: unit, lowest, highest. Numbers of type int are whole.
_RANGES: dict[str, tuple[str, float, float]] = {
    "spare": ("", 0.0, 10.0),
    "update": ("s", 1e-4, 3600.0),
    "points": ("", 1, 100_000),
    "reach": ("m", 0.0, 1000.0),
    "inputs": ("", 1, 4),
    "outputs": ("", 1, 4),
    "channels": ("", 1, 4),
    "length": ("m", 1.0, 10e3),
    "slack": ("m", 0.0, 50.0),
    "current": ("A", 0.0, 10.0),
    "loop_current": ("A", 0.0, 1.0),
    "voltage": ("V", 1.0, 60.0),
    "rating": ("A", 0.01, 100.0),
    "conversion": ("s", 0.0, 10.0),
    "repetitions": ("", 0, 1000),
    "nodes": ("", 2, 128),
    "load": ("", 0.001, 1.0),
    "period_share": ("", 0.01, 0.99),
    "unit_loads": ("", 2, 256),
    "units": ("", 1, 247),
    "processing": ("s", 0.0, 60.0),
    "timeout": ("s", 0.001, 60.0),
}

#: Parts of the settings, and what each must be.
_PARTS = {"boxes": "BoxLimits", "asi": "AsiLimits", "can": "CanLimits", "modbus": "ModbusLimits"}


class _Checked:
    """Checks the numbers of a set of limits by their names."""

    __slots__ = ()

    #: What its cables are for.
    _bus: ClassVar[str] = "hardwired"

    def __post_init__(self) -> None:
        """Check every field."""
        for own in fields(self):  # type: ignore[arg-type]  # every child is a dataclass
            value = getattr(self, own.name)
            if own.type == "bool":
                if not isinstance(value, bool):
                    raise ArgumentError(f"{own.name} is {value!r}; it must be True or False")
            elif own.name == "repeaters":
                check_whole(own.name, value, 0, 9)
            elif own.name in _RANGES:
                unit, low, high = _RANGES[own.name]
                if own.type == "int":
                    check_whole(own.name, value, int(low), int(high))
                elif isinstance(value, bool) or not (
                    isinstance(value, int | float) and isfinite(value) and low <= value <= high
                ):
                    raise ArgumentError(
                        f"{own.name} is {value!r}; it must be {low:g}..{high:g} {unit}".rstrip()
                    )
            elif own.name in ("cable", "feeder"):
                fitting = [name for name, cable in cables().items() if self._bus in cable.buses]
                if value not in fitting:
                    raise ArgumentError(
                        f"{own.name} is {value!r}; it must be one of {', '.join(fitting)}"
                    )
            elif own.name == "character":
                SerialLine(9600, value)
            elif own.name == "bit_rates":
                if not isinstance(value, tuple) or not value:
                    raise ArgumentError(f"bit_rates is {value!r}; it must be a tuple of bit rates")
                for rate in value:
                    check_whole("bit rate", rate, 1000, 1_000_000)
            elif own.name in _PARTS and type(value).__name__ != _PARTS[own.name]:
                raise ArgumentError(f"{own.name} is {value!r}; it must be {_PARTS[own.name]}")


@dataclass(frozen=True, slots=True)
class BoxLimits(_Checked):
    """Junction boxes where the list names none.

    Parameters
    ----------
    points : int, default 32
        Most points of a box; assumed.
    reach : float, default 20
        Longest way between two points of a box, along the axes of the ship [m]; assumed.
    """

    points: int = 32
    reach: float = 20.0


@dataclass(frozen=True, slots=True)
class AsiLimits(_Checked):
    """What an AS-i line may be.

    Parameters
    ----------
    shared : bool, default True
        Whether an A and a B slave may share an address: 62 slaves a line, else 31 [1]_.
    inputs, outputs : int, default 4
        Digital inputs and outputs of a module [2]_.
    channels : int, default 4
        Most analogue values of a module of profile S-7.3, 1..4 [3]_.
    reach : float, default 10
        Longest way between two points of a module, along the axes of the ship [m]; assumed.
    length : float, default 100
        Cable of a segment, all branches added up [m] [1]_.
    repeaters : int, default 2
        Repeaters in series between the master and a module [2]_.
    tree : bool, default True
        Whether the cable branches; else it goes from module to module.
    cable : str, default "ASI_MARINE"
        The line, a key of the catalogue. The flat cable is not type-approved for ships as it is.
    slack : float, default 1
        Cable that is needed at each module beside the way [m]; assumed.
    current, loop_current : float, default 0.065, 0.022
        Current of a module with its sensors [4]_, and of each analogue channel on top: the upper
        end of a 4-20 mA loop, assumed [A].
    voltage, rating : float, default 30, 8
        Supply [V], and the most that it gives [A] [5]_.
    auxiliary : bool, default True
        Whether a second pair feeds the outputs, from a supply of its own in the cabinet along the
        line.
    conversion : float, default 0.06
        Conversion of an analogue value [s]; makers print 20 to 60 ms a channel.
    repetitions : int, default 1
        Telegrams repeated while a change waits.

    References
    ----------
    .. [1] "AS-Interface communication system for field networks (2)", ICN magazine, July 2007.
    .. [2] R. G. Kim, Y. H. Cho, K. H. Hyun, "AS-Interface protocol utilization for smart ships",
       J. Soc. Nav. Archit. Korea 60(6), 2023, section 3.3.
    .. [3] ifm AC2216, p. 17; ifm AC2526, p. 13.
    .. [4] Schneider Electric, AS-i help D-SA-0011271.
    .. [5] Bihl+Wiedemann; Murr: 8 A.
    """

    _bus: ClassVar[str] = "AS-i"

    shared: bool = True
    inputs: int = 4
    outputs: int = 4
    channels: int = 4
    reach: float = 10.0
    length: float = 100.0
    repeaters: int = 2
    tree: bool = True
    cable: str = "ASI_MARINE"
    slack: float = 1.0
    current: float = 0.065
    loop_current: float = 0.022
    voltage: float = 30.0
    rating: float = 8.0
    auxiliary: bool = True
    conversion: float = 0.06
    repetitions: int = 1


@dataclass(frozen=True, slots=True)
class CanLimits(_Checked):
    """What a CAN segment may be.

    Parameters
    ----------
    bit_rates : tuple of int
        Bit rates to choose from [bit/s]; the highest that the length allows is taken, by
        ``can_bus_lengths.csv``.
    nodes : int, default 50
        Nodes of a segment, the host among them: the 50 of NMEA 2000 [1]_.
    load : float, default 0.5
        Highest bus load; assumed, so that errors and growth find room.
    period_share : float, default 0.5
        Share of a point's update need after which its message is sent again; the rest is its
        deadline. Assumed.
    cable : str, default "CAN_5_0p75"
        The trunk, a key of the catalogue.

    References
    ----------
    .. [1] Maretron, NMEA 2000 network installation guide, pp. 20-21.
    """

    _bus: ClassVar[str] = "CAN"

    bit_rates: tuple[int, ...] = (50_000, 125_000, 250_000, 500_000)
    nodes: int = 50
    load: float = 0.5
    period_share: float = 0.5
    cable: str = "CAN_5_0p75"


@dataclass(frozen=True, slots=True)
class ModbusLimits(_Checked):
    """What a Modbus RTU loop on RS-485 may be.

    Parameters
    ----------
    bit_rates : tuple of int
        Bit rates to choose from [bit/s]; the lowest that is fast enough is taken. All of them
        reach the full length.
    length : float, default 1200
        Cable between the ends or repeaters [m]: EIA-485 up to about 90 kbit/s.
    unit_loads : int, default 32
        Devices between the ends or repeaters, the master among them: EIA-485.
    repeaters : int, default 0
        Most repeaters of a loop.
    units : int, default 247
        Unit ids of a loop [1]_.
    processing : float, default 0.005
        How long a station works on a request [s]; assumed.
    timeout : float, default 1
        How long the master waits beyond the longest answer before it asks a silent station on the
        second line [s]; the guide has 1 s to several seconds [2]_.
    character : str, default "8E1"
        As `shipnet.modbus.timing.Serial` has it.
    cable : str, default "RS485_MARINE"
        The trunk, a key of the catalogue.

    References
    ----------
    .. [1] "MODBUS over serial line specification and implementation guide", V1.02, 2006,
       section 2.2.
    .. [2] The same, section 2.4.1.
    """

    _bus: ClassVar[str] = "Modbus RTU"

    bit_rates: tuple[int, ...] = (9600, 19_200, 38_400, 57_600)
    length: float = 1200.0
    unit_loads: int = 32
    repeaters: int = 0
    units: int = 247
    processing: float = 0.005
    timeout: float = 1.0
    character: str = "8E1"
    cable: str = "RS485_MARINE"


@dataclass(frozen=True, slots=True)
class Settings(_Checked):
    """All the limits of a plan.

    Parameters
    ----------
    spare : float, default 0.2
        Spare pairs of a trunk of many pairs, as a share of those in use; assumed.
    redundant : bool, default False
        Whether the trunks of CAN and Modbus are doubled.
    update : float, default 1
        Update need of a point where the list names none [s]: "other indications" of DNV-OS-D202,
        Ch. 2 Sec. 3 Table A1.
    fed : bool, default True
        Whether stations, and supplies in the field, are fed from the cabinet by a cable of their
        own; else from a board beside them, which is not counted.
    feeder : str, default "MI1P150"
        That cable, a key of the catalogue.
    list_lengths : bool, default True
        Whether a cable whose length the list gives keeps it; else it is reckoned from places like
        all others, where they are known.
    boxes : BoxLimits, optional
        Junction boxes where the list names none.
    asi, can, modbus : AsiLimits, CanLimits, ModbusLimits, optional
        Each bus.

    Raises
    ------
    ArgumentError
        If a number, here or in a part, is out of its range.

    Examples
    --------
    >>> Settings(asi=AsiLimits(shared=False), redundant=True).asi.length
    100.0
    """

    spare: float = 0.2
    redundant: bool = False
    update: float = 1.0
    fed: bool = True
    feeder: str = "MI1P150"
    list_lengths: bool = True
    boxes: BoxLimits = field(default_factory=BoxLimits)
    asi: AsiLimits = field(default_factory=AsiLimits)
    can: CanLimits = field(default_factory=CanLimits)
    modbus: ModbusLimits = field(default_factory=ModbusLimits)
