"""Cables to choose from, each figure as a range: what is only estimated says so by its width."""

from __future__ import annotations

import csv
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from math import ceil, isfinite, nan, pi
from types import MappingProxyType
from typing import NamedTuple

from shipnet import datasets
from shipnet.errors import ArgumentError
from shipnet.fields import check_whole

#: How far the truth may lie from a figure, by what is known of it. Geometry: the model of the file
#: is good to a quarter. Work: the one span that is published, 5 to 15 minutes a conductor
#: (industrialmonitordirect.com), is half of its middle to either side.
SPREAD: Mapping[str, float] = {
    "confirmed": 0.0, "estimate": 0.25, "derived": 0.5, "assumption": 0.5,
}  # fmt: skip


class Range(NamedTuple):
    """A figure that is known only within bounds."""

    low: float
    nominal: float
    high: float

    @classmethod
    def around(cls, nominal: float, status: str) -> Range:
        """Return the range of a figure of which so much is known."""
        if status not in SPREAD:
            raise ArgumentError(f"status is {status!r}; it must be one of {', '.join(SPREAD)}")
        if not (isfinite(nominal) and nominal >= 0):
            raise ArgumentError(f"nominal is {nominal!r}; it must be a number of at least 0")
        return cls(nominal * (1 - SPREAD[status]), nominal, nominal * (1 + SPREAD[status]))


@dataclass(frozen=True, slots=True)
class Cable:
    """A cable of the catalogue."""

    id: str
    description: str
    bus: str
    pairs: int
    conductors: int
    cross_section_mm2: float
    diameter_mm: float
    height_mm: float
    mass: Range
    price: Range
    lay: Range
    termination: Range
    loop_resistance: float
    longest_m: float
    status: str
    source: str

    @property
    def buses(self) -> tuple[str, ...]:
        """What it is for, one by one."""
        return tuple(self.bus.split(" / "))

    @property
    def area_mm2(self) -> float:
        """Cross-section over all [mm2]: a circle, or the rectangle about a flat cable."""
        if self.height_mm < self.diameter_mm:
            return self.diameter_mm * self.height_mm
        return pi / 4 * self.diameter_mm**2


@cache
def cables() -> Mapping[str, Cable]:
    """Return the cables of the catalogue."""
    with datasets.path("estimated_cables.csv").open(newline="", encoding="utf-8") as stream:
        found = [_cable(row) for row in csv.DictReader(stream)]
    return MappingProxyType({cable.id: cable for cable in found})


def _cable(row: dict[str, str]) -> Cable:
    low, high = float(row["price_low_eur_per_m"]), float(row["price_high_eur_per_m"])
    diameter = float(row["diameter_mm"])
    known = ", ".join(f"{what} {row[f'status_{what}']}" for what in
                      ("diameter", "mass", "price", "labour"))  # fmt: skip
    return Cable(
        row["cable_id"],
        row["description"],
        row["bus"],
        int(row["pairs"]),
        int(row["conductors"]),
        float(row["cross_section_mm2"]),
        diameter,
        float(row["height_mm"] or diameter),
        Range.around(float(row["mass_kg_per_km"]) / 1e3, row["status_mass"]),
        Range(low, (low + high) / 2, high),
        Range.around(float(row["lay_h_per_m"]), row["status_labour"]),
        Range.around(float(row["termination_h_per_conductor"]), row["status_labour"]),
        float(row["loop_resistance_ohm_per_km"] or nan),
        float(row["longest_m"] or "inf"),
        known,
        row["source"],
    )


def smallest(conductors: int, bus: str = "hardwired", spare: float = 0.2) -> Cable:
    """Return the thinnest cable that has so many conductors and a reserve."""
    buses = list(dict.fromkeys(name for cable in cables().values() for name in cable.buses))
    if bus not in buses:
        raise ArgumentError(f"bus is {bus!r}; it must be one of {', '.join(buses)}")
    conductors = check_whole("conductors", conductors, 1, 10**9)
    if isinstance(spare, bool) or not isinstance(spare, int | float) or not 0 <= spare <= 10:
        raise ArgumentError(f"spare is {spare!r}; it must be a number 0..10")
    # A share such as 0.12 is no binary number, but 25 conductors with 12 % are 28.
    needed = ceil(round(conductors * (1 + spare), 9))
    own = [cable for cable in cables().values() if bus in cable.buses]
    fit = [cable for cable in own if cable.conductors >= needed]
    if not fit:
        most = max(cable.conductors for cable in own)
        raise ArgumentError(
            f"conductors is {conductors}; with a reserve of {100 * spare:g} % that is {needed}, "
            f"and the largest cable for {bus} has {most}"
        )
    return min(fit, key=lambda cable: cable.diameter_mm)
