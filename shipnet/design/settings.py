"""Every limit, price and allowance of a design, by one dotted name."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, fields, is_dataclass, replace
from difflib import get_close_matches
from functools import cache
from inspect import cleandoc
from math import isfinite
from os import PathLike
from textwrap import wrap
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, ClassVar, Literal

import numpy as np
import numpy.typing as npt

from shipnet import datasets
from shipnet.design.catalogue import Range, cables
from shipnet.design.site import Site
from shipnet.errors import ArgumentError, InputError
from shipnet.fields import check_scalar, check_whole
from shipnet.modbus.uart import SerialLine
from shipnet.tables import read_bytes, text_of

if TYPE_CHECKING:
    import pandas as pd

    from shipnet.design.site import Place, Trays


# The limits that a plan keeps, each with its source; what is assumed says so --------------------

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
        As `shipnet.modbus.SerialLine` has it.
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


# What prices, hours and factors of a design are assumed to be: low, nominal and high

Floats = npt.NDArray[np.float64]

#: The names of the three values of a range.
LEVELS: tuple[Literal["low", "nominal", "high"], ...] = ("low", "nominal", "high")

#: Where in its range an assumption is taken: at one of its three values, or at quantiles of the
#: triangular distribution over it, shape (n_draws,).
Level = Literal["low", "nominal", "high"] | Floats

_FILE = "synthetic_design_assumptions.csv"

#: Parts of names that are written otherwise in a text.
_SPELT = {"asi": "AS-i", "can": "CAN", "modbus": "Modbus", "plc": "PLC"}


@dataclass(frozen=True, slots=True)
class Assumption:
    """A price, an hour or a factor that a design rests on."""

    range: Range
    unit: str
    meaning: str = ""
    status: str = "given"
    source: str = "the user"

    def __post_init__(self) -> None:
        """Check the order."""
        _check("range", self.range)


class Assumptions(Mapping[str, Range]):
    """All assumptions by name: a mapping to their ranges."""

    def __init__(self, entries: Mapping[str, Assumption] | None = None) -> None:
        read = _read()
        self._entries = dict(read if entries is None else entries)
        missing = [name for name in read if name not in self._entries]
        if missing:
            raise ArgumentError(f"the assumptions lack {', '.join(missing)}")

    def __getitem__(self, name: str) -> Range:
        return self._entries[name].range

    def __iter__(self) -> Iterator[str]:
        return iter(self._entries)

    def __len__(self) -> int:
        return len(self._entries)

    def __hash__(self) -> int:
        """Return the same for equal ranges."""
        return hash(frozenset(self.items()))

    def __repr__(self) -> str:
        given = [name for name, entry in self._entries.items() if entry.status == "given"]
        return f"<Assumptions: {len(self)}, given by the user: {', '.join(given) or 'none'}>"

    def entry(self, name: str) -> Assumption:
        """Return an assumption with its unit and source."""
        if name not in self._entries:
            raise ArgumentError(
                f"assumption is {name!r}; it must be one of {', '.join(self._entries)}"
            )
        return self._entries[name]

    def at(self, name: str, level: Literal["low", "nominal", "high"] = "nominal") -> float:
        """Return one of the three values of an assumption."""
        return self.entry(name).range[_place(level)]

    def with_(self, **ranges: Range) -> Assumptions:
        """Return assumptions of which some are the user's own."""
        changed = dict(self._entries)
        for name, given in ranges.items():
            _check(name, given)
            changed[name] = replace(
                self.entry(name), range=Range(*given), status="given", source="the user"
            )
        return Assumptions(changed)

    @property
    def table(self) -> pd.DataFrame:
        """One row an assumption: name, meaning, low, nominal, high, unit, status, source."""
        import pandas as pd

        rows = [
            (name, entry.meaning, *entry.range, entry.unit, entry.status, entry.source)
            for name, entry in self._entries.items()
        ]
        return pd.DataFrame(
            rows, columns=["name", "meaning", *LEVELS, "unit", "status", "source"]
        ).set_index("name")


def values_at(ranges: npt.ArrayLike, level: Level) -> Floats:
    """Return where ranges stand at a level: one of their three values, or quantiles."""
    rows = np.asarray(ranges, dtype=float).reshape(-1, 3)
    if isinstance(level, str):
        chosen: Floats = rows[:, _place(level)]
        return chosen
    low, nominal, high = rows.T
    u = np.asarray(level, dtype=float)[:, None]
    width, rise, fall = high - low, nominal - low, high - nominal
    left = low + np.sqrt(u * width * rise)
    right = high - np.sqrt((1 - u) * width * fall)
    drawn: Floats = np.clip(np.where(u * width < rise, left, right), low, high)
    return drawn


def words(name: str) -> str:
    """Return the name of an assumption as a text or a figure says it."""
    return " ".join(_SPELT.get(part, part) for part in name.split("_"))


def _place(level: str) -> int:
    if level not in LEVELS:
        raise ArgumentError(f"level is {level!r}; it must be one of {', '.join(LEVELS)}")
    return LEVELS.index(level)


def _check(name: str, given: Range) -> None:
    ordered = len(given) == 3 and all(isfinite(value) for value in given)
    if not ordered or not 0 <= given[0] <= given[1] <= given[2]:
        raise ArgumentError(
            f"{name} is {tuple(given)}; it must be low <= nominal <= high, 0 or more and finite"
        )


@cache
def _read() -> Mapping[str, Assumption]:
    return MappingProxyType(
        {
            row["name"]: Assumption(
                Range(*(float(row[level]) for level in LEVELS)),
                row["unit"], row["meaning"], row["status"], row["source"],
            )
            for row in datasets.read(_FILE).to_dict("records")
        }
    )  # fmt: skip


# What a comparison rests on, beside its list and its place: every value by its name

#: From a value's arrival at the host to its alarm or indication [s]: scan, alarm logic and screen.
#: Assumed; it is the host's, which no plan of cables knows.
HOST_TIME = 0.5

_ASSUMPTIONS = "assumptions."

#: Fields whose legal values are not told by refusing None.
_PROBES: Mapping[str, object] = {"host_time": -1.0, "bit_rates": (None,)}


@dataclass(frozen=True)
class Basis:
    """What a comparison rests on, beside its list and its place.

    Parameters
    ----------
    settings : Settings, optional
        Limits of the planners.
    assumptions : Assumptions, optional
        Prices, hours and factors.
    detour : float, default 1.15
        Laid length of a cable as a multiple of its route, for bends and what is in the way;
        assumed.
    tails : float, default 5.0
        Length for both ends of a cable together [m]; assumed.
    host_time : float, default 0.5
        What the host adds to a response where a rule counts it [s]; assumed.

    Raises
    ------
    ArgumentError
        If a value is out of its range.

    Examples
    --------
    >>> basis = Basis(detour=1.3).with_({"asi.length": 200, "assumptions.gland": 6})
    >>> print(basis)
    not the defaults: detour 1.3 (1.15), asi.length 200 (100.0), assumptions.gland [6, 6, 6] (...)
    >>> basis.settings.asi.length, basis.site((26, 6, 14)).detour
    (200, 1.3)
    """

    settings: Settings = field(default_factory=Settings)
    assumptions: Assumptions = field(default_factory=Assumptions)
    detour: float = 1.15
    tails: float = 5.0
    host_time: float = HOST_TIME

    def __post_init__(self) -> None:
        """Check every field."""
        if not isinstance(self.settings, Settings):
            raise ArgumentError(f"settings is {self.settings!r}; it must be Settings")
        if not isinstance(self.assumptions, Assumptions):
            raise ArgumentError(f"assumptions is {self.assumptions!r}; it must be Assumptions")
        self.site((0.0, 0.0, 0.0))
        check_scalar("host_time", self.host_time, "s", 0.0, 60.0)

    def __getitem__(self, name: str) -> Any:
        """Return a value by its name."""
        _check_name(name)
        if name.startswith(_ASSUMPTIONS):
            return self.assumptions[name.removeprefix(_ASSUMPTIONS)]
        value: Any = self if name in _OWN else self.settings
        for part in name.split("."):
            value = getattr(value, part)
        return value

    def with_(self, values: Mapping[str, object]) -> Basis:
        """Return a basis of which some values are others."""
        made, faults = changed(self, values)
        if faults:
            raise ArgumentError("; ".join(faults))
        return made

    def site(self, cabinet: Place, trays: Trays | None = None) -> Site:
        """Return a site with these allowances."""
        return Site(cabinet, trays, self.detour, self.tails)

    @property
    def changes(self) -> pd.DataFrame:
        """Values that are not the defaults: name, value, default, legal, meaning."""
        import pandas as pd

        default = Basis()
        rows = [
            (name, self[name], default[name], legal(name), meaning(name))
            for name in names()
            if self[name] != default[name]
        ]
        return pd.DataFrame(rows, columns=["name", "value", "default", "legal", "meaning"])

    @property
    def told(self) -> list[str]:
        """Each value that is not the default, with the default behind it, in words."""
        return [
            f"{row['name']} {shown(row['value'])} ({shown(row['default'])})"
            for row in self.changes.to_dict("records")
        ]

    def __str__(self) -> str:
        """Name the values that are not the defaults."""
        return f"not the defaults: {', '.join(self.told)}" if self.told else "all defaults"


#: Fields of the basis itself.
_OWN = ("detour", "tails", "host_time")


@cache
def names() -> tuple[str, ...]:
    """Return the names of all values."""
    settings = Settings()
    of_parts: list[str] = []
    plain: list[str] = []
    for own in fields(settings):
        value = getattr(settings, own.name)
        if is_dataclass(value):
            of_parts += [f"{own.name}.{inner.name}" for inner in fields(value)]
        else:
            plain.append(own.name)
    return (*_OWN, *plain, *of_parts, *(_ASSUMPTIONS + name for name in Assumptions()))


def changed(basis: Basis, values: Mapping[str, object]) -> tuple[Basis, list[str]]:
    """Return a basis with other values, and what is wrong with those that it did not take."""
    faults = []
    for name, value in values.items():
        try:
            _check_name(name)
        except ArgumentError as fault:
            faults.append(str(fault))
            continue
        try:
            basis = _put(basis, name, _plain(value))
        except ArgumentError:
            faults.append(f"{name} is {_brief(value)}; it must be {legal(name)}")
    return basis, faults


@cache
def legal(name: str) -> str:
    """Return what a value may be."""
    _check_name(name)
    if name.startswith(_ASSUMPTIONS):
        return "[low, nominal, high] in this order, or one number; 0 or more and finite"
    own = name.rpartition(".")[2]
    try:
        # Whoever checks a value says what is legal when it refuses one.
        _put(Basis(), name, _PROBES.get(own))
    except ArgumentError as refusal:
        said = str(refusal).partition("it must be ")[2]
        if own == "bit_rates":
            return said.replace("a whole number", "one or more of whole numbers")
        return said.replace("True or False", "true or false")
    raise AssertionError(f"{name} may be anything")


@cache
def meaning(name: str) -> str:
    """Return what a value is."""
    _check_name(name)
    if name.startswith(_ASSUMPTIONS):
        entry = Assumptions().entry(name.removeprefix(_ASSUMPTIONS))
        return f"{entry.unit if entry.unit != '1' else 'factor'}: {entry.meaning}"
    part, _, own = name.rpartition(".")
    if name in _OWN:
        return _documented(Basis)[own]
    return _documented(type(getattr(Settings(), part)) if part else Settings)[own]


def _documented(kind: type[Any]) -> dict[str, str]:
    """Return what the parameters of a class mean, from its docstring."""
    section = cleandoc(str(kind.__doc__)).partition("Parameters\n----------\n")[2]
    found: dict[str, str] = {}
    for entry in re.finditer(r"^(\w[\w, ]*) : .*\n((?: {4}.*\n?)+)", section, re.MULTILINE):
        said = re.sub(r"`+| \[\d\]_", "", " ".join(entry[2].split()))
        found |= dict.fromkeys(entry[1].split(", "), said)
    return found


def shown(value: object) -> str:
    """Return a value as a file of settings has it."""
    if isinstance(value, tuple):
        return f"[{', '.join(map(shown, value))}]"
    if isinstance(value, bool):
        return "true" if value else "false"
    return f'"{value}"' if isinstance(value, str) else repr(value)


def _check_name(name: str) -> None:
    if name in names():
        return
    part, _, own = name.rpartition(".")
    beside = {other.rpartition(".")[2]: other for other in names() if _part(other) == part}
    near = get_close_matches(own, beside, n=1)
    elsewhere = [other for other in names() if other.rpartition(".")[2] == own]
    hint = "see shipnet design --show-settings"
    if elsewhere:
        hint = f"there is {' and '.join(elsewhere)}"
    elif near:
        hint = f"the nearest is {beside[near[0]]}"
    raise ArgumentError(f"there is no {_brief(name)}; {hint}")


def _part(name: str) -> str:
    return name.rpartition(".")[0]


def _put(basis: Basis, name: str, value: Any) -> Basis:
    part, _, own = name.rpartition(".")
    if name in _OWN:
        return replace(basis, **{name: value})
    if name.startswith(_ASSUMPTIONS):
        ends = value if isinstance(value, tuple) else (value,) * 3
        if len(ends) != 3 or not all(map(_is_number, ends)):
            raise ArgumentError(f"{name} is {value!r}; it must be three numbers or one")
        return replace(basis, assumptions=basis.assumptions.with_(**{own: Range(*ends)}))
    if part:
        value = replace(getattr(basis.settings, part), **{own: value})
    return replace(basis, settings=replace(basis.settings, **{part or own: value}))


def _plain(value: object) -> object:
    """Return a value as one that a check can take, however it was given."""
    if isinstance(value, np.generic | np.ndarray):
        value = value.tolist()
    if isinstance(value, list):
        value = tuple(value)
    for one in value if isinstance(value, tuple) else (value,):
        if not isinstance(one, bool | str) and not _is_number(one):
            raise ArgumentError("it is no value")
    return value


def _is_number(value: object) -> bool:
    # A whole number of any size may stand in a file; no float holds one beyond 1e308.
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    return isinstance(value, float) or abs(value) < 2**63


def _brief(value: object) -> str:
    try:
        said = shown(value) if isinstance(value, bool) else repr(value)
    except ValueError:  # a whole number of more digits than Python prints
        said = "a very large number"
    return said if len(said) <= 60 else f"{said[:57]}..."


# Files of settings: what a design rests on, as TOML that an engineer edits ----------------------

_HEAD = """\
# What a comparison rests on, beside its list and its place. Change what you know better, and delete
# the lines that you leave as they are.
"""

_WIDTH = 98

#: A value that is a number with a decimal comma, as much of Europe types it.
_COMMA = re.compile(r"^[\w. \t]+=[ \t]*([0-9]+,[0-9]+)[ \t]*(?:#.*)?$", re.MULTILINE)


def load_basis(path: str | PathLike[str]) -> Basis:
    """Read a file of settings."""
    return parse_basis(text_of(read_bytes(path)), str(path))


def parse_basis(text: str, source: str = "text") -> Basis:
    """Read settings from text."""
    try:
        tables = tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        said = " ".join(str(error).split())[:200]
        if comma := _COMMA.search(text):
            said += f"; {comma[1]} has a decimal comma, expected a point"
        raise InputError(source, f"is no TOML file: {said}") from None
    basis, faults = changed(Basis(), _flat(tables))
    if faults:
        raise InputError(source, *faults)
    return basis


def format_basis(basis: Basis) -> str:
    """Return settings as a file, with what each value is and may be."""
    default = Basis()
    lines = [_HEAD]
    table = ""
    for name in names():
        part, _, own = name.rpartition(".")
        assumed = part == "assumptions"
        if part != table:
            table = part
            lines.append(f"[{part}]")
            if assumed:
                lines.append(f"# Each must be {legal(name)}.")
            lines.append("")
        was = f" Default {shown(default[name])}." if basis[name] != default[name] else ""
        if assumed:
            lines.append(f"{own} = {shown(basis[name])}  # {meaning(name)}.{was}")
        else:
            lines += [f"# {line}" for line in wrap(meaning(name), _WIDTH)]
            lines += [f"# {line}" for line in wrap(f"It must be {legal(name)}.{was}", _WIDTH)]
            lines += [f"{own} = {shown(basis[name])}", ""]
    return "\n".join(lines) + "\n"


def _flat(tables: Mapping[str, object]) -> dict[str, object]:
    """Return values by names with their table."""
    found: dict[str, object] = {}
    for name, value in tables.items():
        if isinstance(value, dict):
            found |= {f"{name}.{own}": one for own, one in value.items()}
        else:
            found[name] = value
    return found
