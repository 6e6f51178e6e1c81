"""The steps from an I/O list to a comparison, each kept for what it depends on."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import lru_cache
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from shipnet import datasets
from shipnet.design.comparison import CRITERIA, Comparison, complete
from shipnet.design.costs import quantities
from shipnet.design.designs import Network
from shipnet.design.failures import single_cuts
from shipnet.design.iolist import IoList, parse_iolist
from shipnet.design.planning import OPTIONS, mix, plan
from shipnet.design.rules import check
from shipnet.design.settings import Assumptions, Basis, Settings, parse_basis
from shipnet.design.site import Site, find_cabinet
from shipnet.design.uncertainty import draw, likely, tornado
from shipnet.errors import ArgumentError

if TYPE_CHECKING:
    from shipnet.design.site import Place

__all__ = ["EXAMPLES", "MIXES", "assumptions", "basis_of", "compared", "place", "planned", "points"]

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
    "asi_",
    "can_",
    "modbus_",
    "station_",
    "second_interface",
    "supply",
    "repeater",
    "terminator",
    "gateway",
)


def _examples() -> Mapping[str, str]:
    ship = datasets.path("synthetic_iolist_ship.csv").read_text(encoding="utf-8")
    titles, *rows = ship.splitlines(keepends=True)
    engine = [row for row in rows if row.split(",")[1] == "Main engine"]
    return MappingProxyType({"main engine": titles + "".join(engine), "ship": ship})


#: Lists to begin with, both synthetic: the 99 points of an engine, and the 353 of a ship.
EXAMPLES = _examples()


@lru_cache(maxsize=8)
def points(text: str, name: str, update_ms: int) -> IoList:
    """Return the points of a text, none of which may wait longer than a time."""
    iolist = parse_iolist(text, name)
    if not update_ms:
        return iolist
    # Where the list names none it is NaN, which fmin passes over.
    needed = np.fmin(iolist.points["update_ms"], float(update_ms))
    return replace(iolist, points=iolist.points.assign(update_ms=needed))


@lru_cache(maxsize=8)
def place(iolist: IoList, typed: str) -> tuple[Place, str]:
    """Return where the cabinet stands, and how that is known."""
    if typed.strip():
        try:
            x, y, z = (float(number) for number in typed.replace(";", ",").split(","))
            return Site((x, y, z)).cabinet, f"the cabinet stands at {x:g}, {y:g}, {z:g} m, as typed"
        except ValueError:
            raise ArgumentError(
                f"cabinet is {typed!r}; it must be three numbers in m, such as 26, 6, 14"
            ) from None
    if not iolist.located.any():
        return (0.0, 0.0, 0.0), "every length to the cabinet is given by the list"
    try:
        found = find_cabinet(iolist)
    except ArgumentError as problem:
        raise ArgumentError(f"{problem}; type its place, such as 26, 6, 14") from None
    return found.place, f"{found}; type its place if you know it"


@lru_cache(maxsize=4)
def _site(cabinet: Place, detour: float, tails: float) -> Site:
    return Site(cabinet, detour=detour, tails=tails)


@lru_cache(maxsize=48)
def _planned(iolist: IoList, site: Site, settings: Settings, option: str) -> Network:
    if option in OPTIONS:
        return plan(iolist, site, option, settings=settings)
    choose, default = MIXES[option]
    there = {*iolist.points["type"], *iolist.points["category"]}
    named = {key: value for key, value in choose.items() if key in there}
    return mix(iolist, site, named, default=default, settings=settings, name=option)


def planned(
    iolist: IoList, cabinet: Place, basis: Basis, options: tuple[str, ...]
) -> tuple[Network, ...]:
    """Return the points of a list connected in several ways."""
    site = _site(cabinet, basis.detour, basis.tails)
    return tuple(_planned(iolist, site, basis.settings, option) for option in options)


@lru_cache(maxsize=8)
def assumptions(labour: float, parts: float) -> Assumptions:
    """Return the assumptions with another labour rate and other prices of bus parts."""
    assumed = Assumptions()
    times = {"labour_rate": labour / assumed.at("labour_rate")}
    times |= {
        name: parts
        for name in assumed
        if name.startswith(_BUS_PARTS) and assumed.entry(name).unit == "EUR"
    }
    changed = {
        name: type(assumed[name])(*(factor * value for value in assumed[name]))
        for name, factor in times.items()
        if factor != 1
    }
    return assumed.with_(**changed)


@lru_cache(maxsize=8)
def basis_of(
    spare: float,
    redundant: bool,
    list_lengths: bool,
    detour: float,
    labour: float,
    parts: float,
    own: str,
) -> Basis:
    """Return the values of the controls, and over them lines of one's own."""
    settings = Settings(spare=spare, redundant=redundant, list_lengths=list_lengths)
    controls = Basis(settings, assumptions(labour, parts), detour)
    told = parse_basis(own, "limits and prices")
    return controls.with_({name: told[name] for name in told.changes["name"]})


# A network is the key to what is found of it, and lives as long as that.
_cuts = lru_cache(maxsize=48)(single_cuts)


@lru_cache(maxsize=48)
def _checked(network: Network, rule_set: str, host_time: float) -> pd.DataFrame:
    return check(network, rule_set, host_time=host_time, cuts=_cuts(network))


@lru_cache(maxsize=4)
def compared(networks: tuple[Network, ...], rule_set: str, basis: Basis) -> Comparison:
    """Compare networks, as `shipnet.design.comparison.compare_networks` does."""
    named = {network.name: network for network in networks}
    assumed, host = basis.assumptions, basis.host_time
    rules = [_checked(net, rule_set, host).assign(option=name) for name, net in named.items()]
    return Comparison(
        named,
        {name: quantities(network, assumed) for name, network in named.items()},
        {name: _cuts(network) for name, network in named.items()},
        pd.concat(rules, ignore_index=True),
        tornado(complete(named), assumptions=assumed),
        likely(draw(named, assumed, rng=np.random.default_rng(_SEED))),
        CRITERIA,
        basis,
    )
