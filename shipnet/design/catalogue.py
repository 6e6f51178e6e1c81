"""The cable catalogue, and the prices, hours and factors used in designs, each with its range."""

from __future__ import annotations

import csv
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cache
from math import ceil, inf, isfinite, nan, pi
from types import MappingProxyType
from typing import Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from shipnet import datasets
from shipnet.arrays import Floats
from shipnet.errors import ArgumentError
from shipnet.line.cable import CABLES

#: Half the range of a figure as a fraction of its nominal value, by status. The geometric model for
#: estimating diameters and masses is accurate to 25 %. The only published range for labour, 5 to 15
#: minutes per conductor (industrialmonitordirect.com), is 10 minutes plus or minus 50 %.
SPREAD = {"confirmed": 0.0, "estimate": 0.25, "derived": 0.5, "assumption": 0.5}

#: The names of the three values of a range.
LEVELS: tuple[Literal["low", "nominal", "high"], ...] = ("low", "nominal", "high")

#: A level in a range: its name, or quantiles of the triangular distribution, shape (n_draws,).
Level = Literal["low", "nominal", "high"] | Floats


class Range(NamedTuple):
    """The low, nominal and high values of a figure that is not known exactly."""

    low: float
    nominal: float
    high: float

    @classmethod
    def around(cls, nominal: float, status: str) -> Range:
        """Return the range around a nominal value, with the relative half-width from `SPREAD`."""
        return cls(nominal * (1 - SPREAD[status]), nominal, nominal * (1 + SPREAD[status]))


@dataclass(frozen=True, slots=True)
class Cable:
    """A cable in the catalogue."""

    id: str
    description: str
    #: Uses of the cable: "hardwired", or the names of one or more buses.
    buses: tuple[str, ...]
    #: Key of the cable in `shipnet.line.CABLES`, or "" if it carries no bus.
    line: str
    conductors: int
    #: Overall cross-sectional area: a circle, or the rectangle around a flat cable.
    area_mm2: float
    mass: Range
    price: Range
    lay: Range
    termination: Range
    longest_m: float
    #: Cross-section of a conductor [mm2], and loop resistance [ohm/m]; NaN where unknown.
    section: float
    resistance: float
    #: Current rating of a conductor [A]; inf where no rating was found.
    current: float
    status: str
    source: str


@cache
def cables() -> Mapping[str, Cable]:
    """Return the cables in the catalogue, by id."""
    with datasets.path("estimated_cables.csv").open(newline="", encoding="utf-8") as stream:
        entries = [_cable(row) for row in csv.DictReader(stream)]
    return MappingProxyType({cable.id: cable for cable in entries})


def _cable(row: dict[str, str]) -> Cable:
    low, high = float(row["price_low_eur_per_m"]), float(row["price_high_eur_per_m"])
    width, height = float(row["diameter_mm"]), row["height_mm"]
    if row["line_cable"] not in ("", *CABLES):
        raise ArgumentError(f"line_cable is {row['line_cable']!r}; it must be a key of line.CABLES")
    kinds = ("diameter", "mass", "price", "labour")
    status = ", ".join(f"{kind} {row[f'status_{kind}']}" for kind in kinds)
    area = width * float(height) if height else pi / 4 * width**2
    labour = row["status_labour"]
    return Cable(
        id=row["cable_id"],
        description=row["description"],
        buses=tuple(row["bus"].split(" / ")),
        line=row["line_cable"],
        conductors=int(row["conductors"]),
        area_mm2=area,
        mass=Range.around(float(row["mass_kg_per_km"]) / 1e3, row["status_mass"]),
        price=Range(low, (low + high) / 2, high),
        lay=Range.around(float(row["lay_h_per_m"]), labour),
        termination=Range.around(float(row["termination_h_per_conductor"]), labour),
        longest_m=float(row["longest_m"] or inf),
        section=float(row["cross_section_mm2"]),
        resistance=float(row["loop_resistance_ohm_per_km"] or nan) / 1e3,
        current=float(row["current_a"] or inf),
        status=status,
        source=row["source"],
    )


def with_spare(used: int, spare: float) -> int:
    """Return a number of conductors, channels or ports plus a fraction of spares, rounded up."""
    # Round twice: 25 with 12 % spares must be 28, although 0.12 is not exact in binary.
    return ceil(round(used * (1 + spare), 9))


@cache
def smallest(conductors: int, *, spare: float) -> Cable:
    """Return the thinnest cable for hardwired points that has enough conductors and spares."""
    needed = with_spare(conductors, spare)
    hardwired = [cable for cable in cables().values() if "hardwired" in cable.buses]
    fit = [cable for cable in hardwired if cable.conductors >= needed]
    if not fit:
        most = max(cable.conductors for cable in hardwired)
        raise ArgumentError(
            f"conductors is {conductors}, or {needed} with {100 * spare:g} % spares; the largest "
            f"cable for hardwired points has {most}"
        )
    return min(fit, key=lambda cable: cable.area_mm2)


# Assumptions: prices, hours and factors ------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Assumption:
    """A price, a number of hours or a factor, with its unit, status and source."""

    range: Range
    unit: str
    meaning: str = ""
    status: str = "given"
    source: str = "the user"


class Assumptions(Mapping[str, Range]):
    """Mapping from the name of each assumption to its range, by default from the data files."""

    def __init__(self, entries: Mapping[str, Assumption] | None = None) -> None:
        self._entries = read_assumptions() if entries is None else entries

    def __getitem__(self, name: str) -> Range:
        return self._entries[name].range

    def __iter__(self) -> Iterator[str]:
        return iter(self._entries)

    def __len__(self) -> int:
        return len(self._entries)

    def __hash__(self) -> int:
        return hash(frozenset(self.items()))

    def entry(self, name: str) -> Assumption:
        """Return an assumption with its unit and source."""
        return self._entries[name]

    def with_(self, **ranges: Range) -> Assumptions:
        """Return a copy with some ranges replaced by the user's."""
        changed = {
            name: replace(self.entry(name), range=values, status="given", source="the user")
            for name, values in ranges.items()
        }
        return Assumptions({**self._entries, **changed})


def values_at(ranges: npt.ArrayLike, level: Level) -> Floats:
    """Return values of ranges (n, 3) at a level, with shape (n,), or (n_draws, n) for quantiles."""
    rows = np.asarray(ranges, dtype=float).reshape(-1, 3)
    if isinstance(level, str):
        chosen: Floats = rows[:, LEVELS.index(level)]
        return chosen
    low, nominal, high = rows.T
    u = np.asarray(level, dtype=float)[:, None]
    width, rise, fall = high - low, nominal - low, high - nominal
    # The density is triangular from low to high, with its peak at nominal.
    left = low + np.sqrt(u * width * rise)
    right = high - np.sqrt((1 - u) * width * fall)
    drawn: Floats = np.clip(np.where(u * width < rise, left, right), low, high)
    return drawn


#: Parts of assumption names that are spelled differently in sentences.
_SPELT = {"asi": "AS-i", "can": "CAN", "modbus": "Modbus", "plc": "PLC"}


def words(name: str) -> str:
    """Return the name of an assumption as words for use in a sentence."""
    return " ".join(_SPELT.get(part, part) for part in name.split("_"))


def ordered(name: str, values: Range) -> Range:
    """Return a range; raise ArgumentError unless 0 <= low <= nominal <= high < infinity."""
    finite = len(values) == 3 and all(map(isfinite, values))
    if not finite or not 0 <= values[0] <= values[1] <= values[2]:
        raise ArgumentError(
            f"{name} is {tuple(values)}; it must be low <= nominal <= high, 0 or more and finite"
        )
    return values


#: Figures of each cable that are assumptions, named such as price_MI1P075: unit, meaning, and the
#: name of the range of all cables.
CABLE_FIGURES = {
    "mass": ("kg/m", "mass", "cable_mass"),
    "price": ("EUR/m", "price", "cable_price"),
    "lay": ("h/m", "laying", "laying_time"),
    "termination": ("h", "termination of a conductor at one end", "termination_time"),
}


@cache
def read_assumptions() -> Mapping[str, Assumption]:
    """Return the assumptions in the data files, by name; those for each cable come last."""
    rows = datasets.read("synthetic_design_assumptions.csv").to_dict("records")
    entries = {}
    for row in rows:
        ends = Range(*(float(row[level]) for level in LEVELS))
        entries[row["name"]] = Assumption(
            ends, row["unit"], row["meaning"], row["status"], row["source"]
        )
    for name, (unit, meaning, _) in CABLE_FIGURES.items():
        for cable in cables().values():
            what = f"{meaning} of {cable.id}"
            figure = Assumption(getattr(cable, name), unit, what, cable.status, cable.source)
            entries[f"{name}_{cable.id}"] = figure
    return MappingProxyType(entries)
