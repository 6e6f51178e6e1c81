"""Behind the page of the ship design tool: the steps to a comparison, and its words."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import lru_cache
from types import MappingProxyType

import numpy as np

from shipnet import datasets
from shipnet.design.catalogue import Assumptions, Range
from shipnet.design.comparison import Comparison, compare
from shipnet.design.designs import Design
from shipnet.design.failures import worst
from shipnet.design.iolist import IoList
from shipnet.design.planning import OPTIONS, plan
from shipnet.design.rules import RuleSet
from shipnet.design.settings import Settings, names
from shipnet.design.site import Site, site_of
from shipnet.design.words import Reading

# The steps from an I/O list to a comparison, each kept for what it depends on ---------------------

#: Ways to connect some points by one option and the others by another: what decides, and how the
#: points that it does not name are connected.
MIXES: Mapping[str, tuple[Mapping[str, str], str]] = MappingProxyType(
    {
        "digital AS-i + analogue CAN": ({"DI": "AS-i", "DO": "AS-i"}, "CAN"),
        "digital AS-i + analogue Modbus RTU": ({"DI": "AS-i", "DO": "AS-i"}, "Modbus RTU"),
        "digital AS-i + analogue home runs": ({"DI": "AS-i", "DO": "AS-i"}, "home runs"),
        "category III home runs + rest CAN": ({"III": "home runs"}, "CAN"),
        "category III home runs + rest Modbus RTU": ({"III": "home runs"}, "Modbus RTU"),
    }
)

#: Seed of the draws of what is assumed, as `shipnet design` has it.
_SEED = 2024

#: Assumptions that make up the price of a bus, beside its cable.
_BUS_PARTS = (
    "asi_", "can_", "modbus_", "station_", "second_interface", "supply", "repeater", "terminator",
    "gateway",
)  # fmt: skip


def _examples() -> Mapping[str, str]:
    ship = datasets.path("synthetic_iolist_ship.csv").read_text(encoding="utf-8")
    titles, *rows = ship.splitlines(keepends=True)
    engine = [row for row in rows if row.split(",")[1] == "Main engine"]
    return MappingProxyType({"main engine": titles + "".join(engine), "ship": ship})


#: Lists to begin with, both synthetic: the 99 points of an engine, and the 353 of a ship.
EXAMPLES = _examples()


@lru_cache(maxsize=8)
def points(text: str, name: str, update_ms: int, reading: Reading) -> IoList:
    """Return the points of a text, none of which may wait longer than a time."""
    iolist = IoList.parse(text, name, reading=reading)
    if not update_ms:
        return iolist
    # Where the list names none it is NaN, which fmin passes over.
    needed = np.fmin(iolist.points["update_ms"], float(update_ms))
    return replace(iolist, points=iolist.points.assign(update_ms=needed))


@lru_cache(maxsize=8)
def site(iolist: IoList, cabinet: str, settings: Settings) -> tuple[Site, str]:
    """Return where a list is planned, and how the place of the cabinet is known if it was found."""
    return site_of(iolist, cabinet.strip() or None, None, settings)


@lru_cache(maxsize=48)
def _planned(iolist: IoList, site: Site, settings: Settings, option: str, rules: str) -> Design:
    asked = RuleSet.of(rules)
    if option in OPTIONS:
        return plan(iolist, site, option, settings=settings, rules=asked)
    choose, default = MIXES[option]
    there = {*iolist.points["type"], *iolist.points["category"]}
    named = {key: value for key, value in choose.items() if key in there}
    return plan(iolist, site, default, settings=settings, mix=named, name=option, rules=asked)


@lru_cache(maxsize=8)
def settings_of(
    spare: float,
    redundant: bool,
    list_lengths: bool,
    detour: float,
    labour: float,
    parts: float,
    own: str,
) -> Settings:
    """Return the values of the controls, and over them lines of one's own."""
    values: dict[str, object] = {
        "spare": spare, "redundant": redundant, "list_lengths": list_lengths, "detour": detour,
        **_prices(labour, parts),
    }  # fmt: skip
    given = Settings.parse(own, "limits and prices")
    words = {table: dict(pairs) for table, pairs in given.reading._asdict().items()}
    return Settings(values | dict(given.changes()["value"]) | words)


@lru_cache(maxsize=8)
def _prices(labour: float, parts: float) -> dict[str, Range]:
    """Return the assumptions that another labour rate and other prices of bus parts change."""
    assumed = Assumptions()
    times = {"labour_rate": labour / assumed["labour_rate"].nominal}
    times |= {
        name: parts
        for name in assumed
        if name.startswith(_BUS_PARTS) and assumed.entry(name).unit == "EUR"
    }
    return {
        f"assumptions.{name}": Range(*(factor * value for value in assumed[name]))
        for name, factor in times.items()
        if factor != 1
    }


@lru_cache(maxsize=4)
def compared(
    iolist: IoList, cabinet: str, settings: Settings, options: tuple[str, ...], rules: str
) -> Comparison:
    """Plan and compare; a plan is kept for what it depends on, which prices are not."""
    default = Settings()
    unpriced = settings.replace(
        {name: default[name] for name in names() if name.startswith("assumptions.")}
    )
    at, said = site(iolist, cabinet, unpriced)
    designs = [_planned(iolist, at, unpriced, option, rules).priced(settings) for option in options]
    found = compare(designs, rules=rules, rng=_SEED)
    return replace(found, remarks=(said,) if said else ())


#: Violated rules that are shown of each design.
_SHOWN = 3

_FAILED = {"cut": "is cut", "short": "is shorted", "tray": "is lost", "device": "is dead"}


def numbers(comparison: Comparison) -> dict[str, str]:
    """Return what the table of a comparison leaves out, in words."""
    x, y, z = comparison.site.cabinet
    said = {
        "list": "; ".join([str(comparison.iolist), *comparison.iolist.remarks]),
        "cabinet": "; ".join(comparison.remarks) or f"the cabinet stands at {x:g}, {y:g}, {z:g} m",
        "conclusions": " ".join(comparison.conclusions()),
    }
    for option, rows in comparison.findings().violated().groupby("design", sort=False):
        violated = [
            f"{row.rule} ({row.asks}; {row.value:.4g} {row.unit} at {row.object})"
            for row in rows.itertuples()
        ]
        more = f"; and {len(rows) - _SHOWN} more" if len(rows) > _SHOWN else ""
        said[f"{option} violates"] = "; ".join(violated[:_SHOWN]) + more
    for option, design in comparison.designs.items():
        for row in worst(design.failures()).query("points_lost > 0").itertuples():
            lost = f"{row.points_lost} point{'' if row.points_lost == 1 else 's'}"
            said[f"{option} at worst"] = (
                f"{lost} lost when {row.failed} {_FAILED[str(row.failure)]}"
            )
    return said
