"""The limits, prices and allowances of a design, each declared once under its own name."""

from __future__ import annotations

from collections.abc import Mapping
from copy import copy
from dataclasses import MISSING, dataclass, field, fields, replace
from difflib import get_close_matches
from functools import cache, partial
from os import PathLike
from pathlib import Path
from textwrap import wrap
from types import MappingProxyType
from typing import Any, TypeAlias

import numpy as np

from shipnet.design.catalogue import Assumptions, Range, cables, ordered, read_assumptions
from shipnet.design.words import Reading
from shipnet.errors import ArgumentError, InputError
from shipnet.fields import (
    Choice,
    Kind,
    Switch,
    Whole,
    check_whole,
    choice,
    declared,
    number,
    record,
    switch,
    whole,
)
from shipnet.files import read_bytes
from shipnet.lazy import pd
from shipnet.modbus.electrical import INTERFACES
from shipnet.modbus.uart import CHARACTERS
from shipnet.tables import save_suffix, text_of
from shipnet.toml_file import parse_toml, shown

# Kinds of values that only designs have ------------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class _CableFor(Kind):
    """The catalogue key of a cable that suits a bus."""

    bus: str

    @property
    def legal(self) -> str:
        """The legal keys."""
        keys = [name for name, cable in cables().items() if self.bus in cable.buses]
        return f"one of {', '.join(keys)}"

    def _check(self, name: str, value: Any, record: Any) -> str:
        if not isinstance(value, str) or self.bus not in getattr(cables().get(value), "buses", ()):
            raise ArgumentError(f"{name} is {value!r}; it must be {self.legal}")
        return value


@dataclass(frozen=True, kw_only=True)
class _BitRates(Kind):
    """One or more bit rates to choose from."""

    legal = "one or more whole numbers 1000..1000000"

    def _check(self, name: str, value: Any, record: Any) -> tuple[int, ...]:
        if not isinstance(value, tuple) or not value:
            raise ArgumentError(f"{name} is {value!r}; it must be {self.legal}")
        return tuple(check_whole(f"one of {name}", rate, 1000, 1_000_000) for rate in value)


@dataclass(frozen=True, kw_only=True)
class _Ends(Kind):
    """A price, a number of hours or a factor, with its range."""

    legal = "[low, nominal, high] in this order, or one number; 0 or more and finite"

    def _check(self, name: str, value: Any, record: Any) -> Range:
        ends = value if isinstance(value, tuple) else (value,) * 3
        if len(ends) != 3 or not all(map(_is_number, ends)):
            raise ArgumentError(f"{name} is {value!r}; it must be {self.legal}")
        return ordered(name, Range(*ends))


def _cable(bus: str, help: str, default: str) -> Any:
    return field(default=default, metadata={"kind": _CableFor(help=help, bus=bus)})


def _bit_rates(help: str, default: tuple[int, ...]) -> Any:
    return field(default=default, metadata={"kind": _BitRates(help=help, unit="bit/s")})


# Limits of boxes and buses -------------------------------------------------------------------


@record(slots=True)
class BoxLimits:
    """Limits of the boxes planned for points without a box; distances are along the ship's axes."""

    points: int = whole(1, 100_000, help="Maximum number of points per box; assumed", default=32)
    reach: float = number(
        0, 1000, "m", "Largest distance between two points of a box; assumed", default=20.0
    )


@record(slots=True)
class AsiLimits:
    """Limits of an AS-i line.

    Sources: ICN magazine, July 2007 (length, shared addresses); kim2023, section 3.3 (repeaters,
    ports); ifm AC2216 and AC2526 (channels); Schneider D-SA-0011271 (current); Murr (rating).
    The flat cable has no type approval for ships.
    """

    shared: bool = switch(
        "Whether an A and a B slave may share an address (62 slaves per line, not 31)", default=True
    )
    inputs: int = whole(1, 4, help="Digital inputs per module", default=4)
    outputs: int = whole(1, 4, help="Digital outputs per module", default=4)
    channels: int = whole(1, 4, help="Analogue values per module with profile S-7.3", default=4)
    reach: float = number(
        0, 1000, "m", "Largest distance between two points of a module; assumed", default=10.0
    )
    length: float = number(1, 10e3, "m", "Longest segment, including branches", default=100.0)
    repeaters: int = whole(0, 9, help="Repeaters between the master and a module", default=2)
    tree: bool = switch("Whether the cable branches; otherwise it is a daisy chain", default=True)
    cable: str = _cable("AS-i", "Catalogue key of the cable", "ASI_MARINE")
    current: float = number(
        0, 10, "A", "Current of a module and its sensors, without 4-20 mA loops", default=0.065
    )
    voltage: float = number(1, 60, "V", "Voltage of a supply", default=30.0)
    rating: float = number(0.01, 100, "A", "Largest current of a supply", default=8.0)
    auxiliary: bool = switch(
        "Whether a second pair feeds the outputs from a supply in the cabinet", default=True
    )
    conversion: float = number(
        0, 10, "s", "Analogue conversion time; manufacturers state 20 to 60 ms", default=0.06
    )
    repetitions: int = whole(
        0, 1000, help="Repetitions in the worst-case response time; 0: no disturbances", default=1
    )


@record(slots=True)
class CanLimits:
    """Limits of a CAN segment; NMEA 2000 allows 50 nodes (Maretron's guide, pp. 20-21).

    The load leaves room for errors. The update time of a point is at least the period of its
    message and the message's deadline together; both shares are assumed.
    """

    bit_rates: tuple[int, ...] = _bit_rates(
        "Bit rates to choose from; a segment uses the highest that its length allows",
        (50_000, 125_000, 250_000, 500_000),
    )
    nodes: int = whole(2, 128, help="Nodes per segment, including the host: NMEA 2000", default=50)
    load: float = number(
        0.001, 1, "", "Highest bus load; assumed, to leave room for errors", default=0.5
    )
    period_share: float = number(
        0.01, 0.99, "", "Period per update time; the rest is the deadline; assumed", default=0.5
    )
    cable: str = _cable("CAN", "Catalogue key of the trunk cable", "CAN_5_0p75")


#: The limits of RS-485 as manufacturers state them; some state 1200 m, which is 4000 ft rounded.
_RS485 = INTERFACES["RS-485"]


@record(slots=True)
class ModbusLimits:
    """Limits of a Modbus RTU loop on RS-485.

    Sources: EIA-485 (length: 4000 ft up to 100 kbit/s and less above, in inverse proportion to the
    bit rate; unit loads, master and repeaters included); "MODBUS over serial line" V1.02, sections
    2.2 and 2.4.1 (unit ids; time-out of 1 s to several seconds beyond the longest response).
    """

    bit_rates: tuple[int, ...] = _bit_rates(
        "Bit rates to choose from; a loop uses the lowest that is fast enough",
        (9600, 19_200, 38_400, 57_600),
    )
    length: float = number(
        1, 10e3, "m", "Longest cable between ends or repeaters: EIA-485", default=_RS485.length
    )
    unit_loads: int = whole(
        2, 256, help="Devices between ends or repeaters: EIA-485", default=_RS485.receivers
    )
    repeaters: int = whole(0, 9, help="Maximum number of repeaters per loop", default=0)
    units: int = whole(1, 247, help="Unit ids per loop", default=247)
    processing: float = number(0, 60, "s", "Processing time of a station; assumed", default=0.005)
    timeout: float = number(
        0.001, 60, "s", "Time without a response until the second line is used", default=1.0
    )
    character: str = choice(
        CHARACTERS, "Data bits, parity and stop bits of a character", default="8E1"
    )
    cable: str = _cable("Modbus RTU", "Catalogue key of the trunk cable", "RS485_MARINE")


@record(slots=True)
class SupplyLimits:
    """The supplies of stations and outputs, and the loads on them and on AS-i lines.

    Sources: WAGO 750-1405 (voltage drop: "24 VDC (-25 ... +30 %)", with approvals by DNV and GL),
    750-531 (short) and the manuals of the series 750 (station: "500 mA" at most); Atlas Copco
    A4530001 (contact). Values without a source are assumed, and so is the upper limit of a loop.
    """

    voltage: float = number(1, 60, "V", "Voltage of a supply", default=24.0)
    drop: float = number(
        0.001, 0.999, "", "Highest voltage drop to a load per supply voltage: WAGO", default=0.25
    )
    rating: float = number(0.01, 1000, "A", "Largest current of a supply; assumed", default=20.0)
    station: float = number(0, 100, "A", "Current of a station without its points", default=0.5)
    contact: float = number(0, 10, "A", "Current of a contact or NAMUR switch", default=0.007)
    sensor: float = number(
        0, 10, "A", "Current of a proximity switch or potentiometer; assumed", default=0.025
    )
    loop: float = number(
        0, 1, "A", "Current of a 4-20 mA loop, or of an analogue AS-i point", default=0.022
    )
    solenoid: float = number(0, 10, "A", "Current of a coil: 6 W at 24 V, assumed", default=0.25)
    simultaneity: float = number(0, 1, "", "Fraction of coils that are on at once", default=0.6)
    short: float = number(
        0, 100, "A", "Additional current into a short on one point's cable: WAGO", default=1.7
    )


# All settings --------------------------------------------------------------------------------


@record
class _Plain:
    """Settings whose names have no dot.

    The update time is that of "other indications" in Ch. 2 Sec. 3 Table A1. Spares are pairs in
    trunks, channels of the cabinet and the stations, and ports of AS-i modules; assumed.
    """

    detour: float = number(
        1, 10, "", "Laid length of a cable as a multiple of its route; assumed", default=1.15
    )
    tails: float = number(0, 1000, "m", "Length added for both cable ends; assumed", default=5.0)
    # From the arrival of a value to its alarm or indication: scan, alarm logic and screen.
    host_time: float = number(
        0, 60, "s", "Time in the host, added if a rule includes it; assumed", default=0.5
    )
    spare: float = number(
        0, 10, "", "Spare pairs, channels and ports per those in use; assumed", default=0.2
    )
    update: float = number(
        1e-4, 3600, "s", "Update time of a point without one: DNV-OS-D202, Table A1", default=1.0
    )
    fed: bool = switch(
        "Whether the cabinet, not local boards, feeds stations and supplies", default=True
    )
    feeder: str = _cable("hardwired", "Catalogue key of the thinnest feeder cable", "MI1P150")
    field_barriers: bool = switch(
        "Whether intrinsically safe points are on buses, with barriers in boxes", default=False
    )
    list_lengths: bool = switch(
        "Whether the list's cable lengths are used even for points with a position", default=True
    )


#: Settings, or values other than the defaults, by name.
Given: TypeAlias = "Settings | Mapping[str, object] | None"

_PARTS: Mapping[str, type[Any]] = {
    "": _Plain,
    "boxes": BoxLimits,
    "asi": AsiLimits,
    "can": CanLimits,
    "modbus": ModbusLimits,
    "supply": SupplyLimits,
}

_HEAD = """\
# The settings of a comparison. Change values if you know better ones, and delete the other lines.
"""

#: Comments that a settings file has in place of an empty table for a list's own words.
_EXAMPLES: Mapping[str, str] = {
    "columns": '# Titles of the list and their columns:\n# [columns]\n# "KKS code" = "tag"',
    "signals": '# Words for signals and their meanings:\n# [signals]\n# "TIT" = "rtd_3wire"',
    "frames": "# Frames and their x in m (interpolated):\n# [frames]\n# 0 = 0.0\n# 30 = 18.0",
    "decks": "# Decks and their z in m:\n# [decks]\n# DK3 = 8.0",
}


@dataclass(frozen=True, init=False, repr=False)
class Settings(_Plain):
    """The limits, prices and allowances of a design, each under its own name.

    `table` lists all names with their legal values. Some names have no prefix, such as ``detour``;
    others begin with ``boxes.``, ``asi.``, ``can.``, ``modbus.`` or ``supply.``; those of prices,
    hours and factors begin with ``assumptions.``. The tables ``columns``, ``signals``, ``frames``
    and ``decks`` define a list's own words for `read_iolist`.

    Parameters
    ----------
    values : mapping of str to object, optional
        Values other than the defaults, by name or nested as in TOML. An assumption has three
        values, low, nominal and high, or one number for all three.

    Raises
    ------
    ArgumentError
        If a name is unknown, or a value is not legal; all faults are listed.

    Examples
    --------
    >>> settings = Settings({"detour": 1.3, "asi.length": 200, "assumptions.gland": 6})
    >>> settings["asi.length"], settings["assumptions.gland"].nominal
    (200.0, 6)
    >>> print(settings)
    changed: detour 1.3 (default 1.15), asi.length 200.0 (default 100.0), assumptions.gland ...
    >>> Settings({"asi.lenght": 90, "spare": 99})
    Traceback (most recent call last):
        ...
    shipnet.errors.ArgumentError: there is no setting 'asi.lenght'; the nearest is asi.length; ...
    """

    boxes: BoxLimits = field(default_factory=BoxLimits)
    asi: AsiLimits = field(default_factory=AsiLimits)
    can: CanLimits = field(default_factory=CanLimits)
    modbus: ModbusLimits = field(default_factory=ModbusLimits)
    supply: SupplyLimits = field(default_factory=SupplyLimits)
    assumptions: Assumptions = field(default_factory=Assumptions)
    reading: Reading = field(default_factory=Reading)

    def __init__(self, values: Mapping[str, object] | None = None) -> None:
        for part in fields(self):
            if part.default_factory is not MISSING:
                object.__setattr__(self, part.name, part.default_factory())
        if faults := self._take(values or {}):
            raise ArgumentError("; ".join(faults))

    @classmethod
    def of(cls, settings: Given) -> Settings:
        """Return settings unchanged, or make them from values by name."""
        return settings if isinstance(settings, Settings) else cls(settings)

    def _take(self, values: Mapping[str, object]) -> list[str]:
        """Replace the settings whose new values are legal, and return the faults of the others."""
        faults: list[str] = []
        reading = self.reading
        words = {n: v for n, v in values.items() if n in Reading._fields and isinstance(v, Mapping)}
        for table, added in words.items():
            reading, wrong = reading.tried(table, added)
            faults += wrong
        object.__setattr__(self, "reading", reading)
        taken: dict[str, dict[str, Any]] = {}
        flat: list[tuple[str, object]] = []
        for name, value in values.items():
            if name not in words and isinstance(value, Mapping) and "." not in name:
                flat += [(f"{name}.{inner}", each) for inner, each in value.items()]
            elif name not in words:
                flat.append((name, value))
        for name, value in flat:
            try:
                kind = kind_of(name)
            except ArgumentError as fault:
                faults.append(str(fault))
                continue
            part, _, last = name.rpartition(".")
            try:
                taken.setdefault(part, {})[last] = kind.check(name, _plain(value), None)
            except ArgumentError:
                faults.append(f"{name} is {_brief(value)}; it must be {legal(name)}")
        changed = taken.pop("", {})
        for part, own_values in taken.items():
            old = getattr(self, part)
            make = old.with_ if part == "assumptions" else partial(replace, old)
            changed[part] = make(**own_values)
        for name, value in changed.items():
            object.__setattr__(self, name, value)
        return faults

    def replace(self, values: Mapping[str, object]) -> Settings:
        """Return a copy with some values replaced, or raise ArgumentError with all faults."""
        made, faults = self.tried(values)
        if faults:
            raise ArgumentError("; ".join(faults))
        return made

    def tried(self, values: Mapping[str, object]) -> tuple[Settings, list[str]]:
        """Return a copy with all legal new values, and the faults of the other values."""
        made = copy(self)
        return made, made._take(values)

    def __getitem__(self, name: str) -> Any:
        """Return the value of a setting by its name."""
        kind_of(name)
        part, _, key = name.rpartition(".")
        if part == "assumptions":
            return self.assumptions[key]
        return getattr(getattr(self, part) if part else self, key)

    def table(self) -> pd.DataFrame:
        """Return one row per name: value, default, unit, legal values and meaning."""
        default = _default()
        rows = [
            (name, self[name], default[name], kind.unit, legal(name), kind.help)
            for name, kind in _kinds().items()
        ]
        columns = ["name", "value", "default", "unit", "legal", "meaning"]
        return pd.DataFrame(rows, columns=columns).set_index("name")

    def changes(self) -> pd.DataFrame:
        """Return the rows of `table` whose value is not the default."""
        return self.table().loc[self._changed]

    @property
    def _changed(self) -> list[str]:
        return [name for name in names() if self[name] != _default()[name]]

    def __str__(self) -> str:
        values = [f"{n} {shown(self[n])} (default {shown(_default()[n])})" for n in self._changed]
        return f"changed: {', '.join(values)}" if values else "all defaults"

    def __repr__(self) -> str:
        return f"<Settings: {self}>"

    @classmethod
    def read(cls, path: str | PathLike[str]) -> Settings:
        """Read a TOML file of settings; values that it omits keep their defaults."""
        return cls.parse(text_of(read_bytes(path)), str(path))

    @classmethod
    def parse(cls, text: str, source: str = "text") -> Settings:
        """Read settings from TOML text, or raise InputError with all faults."""
        settings, faults = _default().tried(parse_toml(text, source))
        if faults:
            raise InputError(source, *faults)
        return settings

    def save(self, path: str | PathLike[str]) -> None:
        """Write all values to a TOML file that `read` can read."""
        save_suffix(path, ".toml")
        Path(path).write_text(self.text(), encoding="utf-8", newline="\n")

    def text(self) -> str:
        """Return all values as TOML, each with its meaning and legal range."""
        default, lines, table = _default(), [_HEAD], ""
        for name, kind in _kinds().items():
            part, _, key = name.rpartition(".")
            assumed = part == "assumptions"
            if part != table:
                table = part
                lines += [f"[{part}]", *[f"# Each must be {legal(name)}."] * assumed, ""]
            was = f" Default {shown(default[name])}." if self[name] != default[name] else ""
            if assumed:
                lines.append(f"{key} = {shown(self[name])}  # {kind.help}.{was}")
                continue
            for comment in (f"{kind.help}.", f"It must be {legal(name)}.{was}"):
                lines += [f"# {line}" for line in wrap(comment, 98)]
            lines += [f"{key} = {shown(self[name])}", ""]
        for words, pairs in zip(Reading._fields, self.reading, strict=True):
            quoted = [[shown(each) for each in pair] for pair in pairs]
            lines += (
                ["", f"[{words}]", *map(" = ".join, quoted)] if pairs else ["", _EXAMPLES[words]]
            )
        return "\n".join(lines) + "\n"


@cache
def _default() -> Settings:
    return Settings()


@cache
def _kinds() -> Mapping[str, Kind]:
    """Return the declaration of each setting by name."""
    kinds = {
        f"{part}.{key}" if part else key: kind
        for part, record in _PARTS.items()
        for key, kind in declared(record).items()
    }
    for name, entry in read_assumptions().items():
        meaning = f"{entry.unit if entry.unit != '1' else 'factor'}: {entry.meaning}"
        kinds[f"assumptions.{name}"] = _Ends(help=meaning, unit=entry.unit.replace("1", ""))
    return MappingProxyType(kinds)


def names() -> tuple[str, ...]:
    """Return the names of all settings."""
    return tuple(_kinds())


def kind_of(name: str) -> Kind:
    """Return the declaration of a setting, or raise ArgumentError with the nearest name."""
    if name in _kinds():
        return _kinds()[name]
    part, _, key = name.rpartition(".")
    beside = {last: n for n in names() for head, _, last in [n.rpartition(".")] if head == part}
    near = get_close_matches(key, beside, n=1)
    elsewhere = [other for other in names() if other.rpartition(".")[2] == key]
    hint = "see shipnet design --show-settings"
    if elsewhere:
        hint = f"use {' or '.join(elsewhere)}"
    elif near:
        hint = f"the nearest is {beside[near[0]]}"
    raise ArgumentError(f"there is no setting {_brief(name)}; {hint}")


def legal(name: str) -> str:
    """Return the legal values of a setting in words."""
    kind = kind_of(name)
    if isinstance(kind, Switch):
        return "true or false"
    words = {Whole: "a whole number ", Choice: "one of "}
    text = words.get(type(kind), "") + kind.legal
    unit = "" if isinstance(kind, _Ends | _BitRates) else kind.unit
    return f"{text} {unit}".rstrip()


def _plain(value: object) -> object:
    """Return a value as a number, text or tuple, or raise ArgumentError."""
    if isinstance(value, np.generic | np.ndarray):
        value = value.tolist()
    if isinstance(value, list):
        value = tuple(value)
    for one in value if isinstance(value, tuple) else (value,):
        if not isinstance(one, bool | str) and not _is_number(one):
            raise ArgumentError("it must be a number, text or a boolean, or a list of these")
    return value


def _is_number(value: object) -> bool:
    # A file may contain an integer of any size, but a float cannot exceed 1e308.
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    return isinstance(value, float) or abs(value) < 2**63


def _brief(value: object) -> str:
    try:
        text = shown(value) if isinstance(value, bool) else repr(value)
    except ValueError:  # an integer with more digits than Python prints
        text = "a very large number"
    return text if len(text) <= 60 else f"{text[:57]}..."
