"""What a design is made of and what it costs: cables, prices, hours and factors, as ranges."""

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
from shipnet.lazy import pd
from shipnet.line.cable import CABLES

#: How far the truth may lie from a figure, by what is known of it. Geometry: the model of the file
#: is good to a quarter. Work: the one span that is published, 5 to 15 minutes a conductor
#: (industrialmonitordirect.com), is half of its middle to either side.
SPREAD: Mapping[str, float] = {
    "confirmed": 0.0, "estimate": 0.25, "derived": 0.5, "assumption": 0.5,
}  # fmt: skip


#: The names of the three values of a range.
LEVELS: tuple[Literal["low", "nominal", "high"], ...] = ("low", "nominal", "high")

#: Where in its range an assumption is taken: at one of its three values, or at quantiles of the
#: triangular distribution over it, shape (n_draws,).
Level = Literal["low", "nominal", "high"] | Floats


class Range(NamedTuple):
    """A figure that is known only within bounds."""

    low: float
    nominal: float
    high: float

    @classmethod
    def around(cls, nominal: float, status: str) -> Range:
        """Return the range of a figure of which so much is known."""
        return cls(nominal * (1 - SPREAD[status]), nominal, nominal * (1 + SPREAD[status]))


@dataclass(frozen=True, slots=True)
class Cable:
    """A cable of the catalogue."""

    id: str
    description: str
    #: What it is for, "hardwired" or one or more buses.
    buses: tuple[str, ...]
    #: The cable of `shipnet.line.CABLES` that its signals meet; "" if it carries none of a bus.
    line: str
    conductors: int
    #: Cross-section over all: a circle, or the rectangle about a flat cable.
    area_mm2: float
    mass: Range
    price: Range
    lay: Range
    termination: Range
    longest_m: float
    #: Cross-section of a conductor [mm2], resistance of two [ohm/m]; NaN where it is not known.
    section: float
    resistance: float
    #: Most current of a conductor [A]; without limit where none was found.
    current: float
    status: str
    source: str


@cache
def cables() -> Mapping[str, Cable]:
    """Return the cables of the catalogue."""
    with datasets.path("estimated_cables.csv").open(newline="", encoding="utf-8") as stream:
        found = [_cable(row) for row in csv.DictReader(stream)]
    return MappingProxyType({cable.id: cable for cable in found})


def _cable(row: dict[str, str]) -> Cable:
    low, high = float(row["price_low_eur_per_m"]), float(row["price_high_eur_per_m"])
    width, height = float(row["diameter_mm"]), row["height_mm"]
    if row["line_cable"] not in ("", *CABLES):
        raise ArgumentError(f"line_cable is {row['line_cable']!r}; it must be a key of line.CABLES")
    return Cable(
        row["cable_id"],
        row["description"],
        tuple(row["bus"].split(" / ")),
        row["line_cable"],
        int(row["conductors"]),
        width * float(height) if height else pi / 4 * width**2,
        Range.around(float(row["mass_kg_per_km"]) / 1e3, row["status_mass"]),
        Range(low, (low + high) / 2, high),
        Range.around(float(row["lay_h_per_m"]), row["status_labour"]),
        Range.around(float(row["termination_h_per_conductor"]), row["status_labour"]),
        float(row["longest_m"] or inf),
        float(row["cross_section_mm2"]),
        float(row["loop_resistance_ohm_per_km"] or nan) / 1e3,
        float(row["current_a"] or inf),
        ", ".join(
            f"{what} {row[f'status_{what}']}" for what in ("diameter", "mass", "price", "labour")
        ),
        row["source"],
    )


def with_spare(used: int, spare: float) -> int:
    """Return how many conductors, channels or ports there are with the spare ones."""
    # A share such as 0.12 is not a binary number, but 25 conductors with 12 % are 28.
    return ceil(round(used * (1 + spare), 9))


@cache
def smallest(conductors: int, *, spare: float) -> Cable:
    """Return the thinnest cable for hardwired points that has enough conductors and a reserve."""
    needed = with_spare(conductors, spare)
    own = [cable for cable in cables().values() if "hardwired" in cable.buses]
    fit = [cable for cable in own if cable.conductors >= needed]
    if not fit:
        most = max(cable.conductors for cable in own)
        raise ArgumentError(
            f"conductors is {conductors}; with a reserve of {100 * spare:g} % that is {needed}, "
            f"and the largest cable for hardwired points has {most}"
        )
    return min(fit, key=lambda cable: cable.area_mm2)


# Assumptions: prices, hours and factors ------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Assumption:
    """A price, an hour or a factor that a design rests on, with its unit, status and source."""

    range: Range
    unit: str
    meaning: str = ""
    status: str = "given"
    source: str = "the user"


class Assumptions(Mapping[str, Range]):
    """All assumptions by name: a mapping to their ranges, read from the data file by default."""

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
        """Return assumptions of which some are the user's own."""
        changed = {
            name: replace(self.entry(name), range=given, status="given", source="the user")
            for name, given in ranges.items()
        }
        return Assumptions({**self._entries, **changed})

    @property
    def table(self) -> pd.DataFrame:
        """One row per assumption: name, meaning, low, nominal, high, unit, status, source."""
        rows = [
            (name, entry.meaning, *entry.range, entry.unit, entry.status, entry.source)
            for name, entry in self._entries.items()
        ]
        return pd.DataFrame(
            rows, columns=["name", "meaning", *LEVELS, "unit", "status", "source"]
        ).set_index("name")


def values_at(ranges: npt.ArrayLike, level: Level) -> Floats:
    """Return ranges at a level: one of their three values, or triangular quantiles."""
    rows = np.asarray(ranges, dtype=float).reshape(-1, 3)
    if isinstance(level, str):
        chosen: Floats = rows[:, LEVELS.index(level)]
        return chosen
    low, nominal, high = rows.T
    u = np.asarray(level, dtype=float)[:, None]
    width, rise, fall = high - low, nominal - low, high - nominal
    # The density is a triangle from low to high with its peak at nominal.
    left = low + np.sqrt(u * width * rise)
    right = high - np.sqrt((1 - u) * width * fall)
    drawn: Floats = np.clip(np.where(u * width < rise, left, right), low, high)
    return drawn


#: Parts of names that are written otherwise in a text.
_SPELT = {"asi": "AS-i", "can": "CAN", "modbus": "Modbus", "plc": "PLC"}


def words(name: str) -> str:
    """Return the name of an assumption as a text or a figure says it."""
    return " ".join(_SPELT.get(part, part) for part in name.split("_"))


def ordered(name: str, given: Range) -> Range:
    """Return a range, or raise unless its values are finite and in order."""
    finite = len(given) == 3 and all(map(isfinite, given))
    if not finite or not 0 <= given[0] <= given[1] <= given[2]:
        raise ArgumentError(
            f"{name} is {tuple(given)}; it must be low <= nominal <= high, 0 or more and finite"
        )
    return given


@cache
def read_assumptions() -> Mapping[str, Assumption]:
    """Return the assumptions of the data file."""
    return MappingProxyType(
        {
            row["name"]: Assumption(
                Range(*(float(row[level]) for level in LEVELS)),
                row["unit"], row["meaning"], row["status"], row["source"],
            )
            for row in datasets.read("synthetic_design_assumptions.csv").to_dict("records")
        }
    )  # fmt: skip
