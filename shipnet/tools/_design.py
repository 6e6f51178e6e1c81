"""Behind the page of the ship design tool: the steps to a comparison, and what it comes to."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from types import MappingProxyType
from typing import Any

import numpy as np
import pandas as pd

from shipnet import datasets
from shipnet.design.catalogue import Assumptions, Range, words
from shipnet.design.comparison import RESPONSE, Comparison, compare
from shipnet.design.costs import label
from shipnet.design.designs import Design
from shipnet.design.failures import worst
from shipnet.design.iolist import IoList
from shipnet.design.planning import OPTIONS, plan
from shipnet.design.settings import Settings, names
from shipnet.design.site import Place, Site, find_cabinet
from shipnet.errors import ArgumentError

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
def points(text: str, name: str, update_ms: int) -> IoList:
    """Return the points of a text, none of which may wait longer than a time."""
    iolist = IoList.parse(text, name)
    if not update_ms:
        return iolist
    # Where the list names none it is NaN, which fmin passes over.
    needed = np.fmin(iolist.points["update_ms"], float(update_ms))
    return replace(iolist, points=iolist.points.assign(update_ms=needed))


@lru_cache(maxsize=8)
def place(iolist: IoList, typed: str) -> tuple[Place, str]:
    """Return the place of the cabinet, and how it is known."""
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
def _planned(iolist: IoList, site: Site, settings: Settings, option: str) -> Design:
    if option in OPTIONS:
        return plan(iolist, site, option, settings=settings)
    choose, default = MIXES[option]
    there = {*iolist.points["type"], *iolist.points["category"]}
    named = {key: value for key, value in choose.items() if key in there}
    return plan(iolist, site, default, settings=settings, mix=named, name=option)


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
    controls = Settings(values)
    told = Settings.parse(own, "limits and prices").changes()["value"]
    return controls.replace(dict(told))


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
    iolist: IoList,
    cabinet: Place,
    said: str,
    settings: Settings,
    options: tuple[str, ...],
    rules: str,
) -> Comparison:
    """Plan and compare; a plan is kept for what it depends on, which prices and host are not."""
    site = _site(cabinet, settings.detour, settings.tails)
    default = Settings()
    unpriced = settings.replace(
        {name: default[name] for name in names() if name.startswith("assumptions.")}
        | {"host_time": default.host_time}
    )
    designs = [_planned(iolist, site, unpriced, option).priced(settings) for option in options]
    found = compare(designs, rules=rules, rng=_SEED)
    return replace(found, remarks=(said,))


# What the options come to, in words and in one table for a page -----------------------------------

#: Reasons for points left out, and violated rules, that are shown of each design.
_TOLD = 3

_FAILED = {"cut": "is cut", "short": "is shorted", "tray": "is lost", "device": "is dead"}


@dataclass(frozen=True, eq=False, slots=True)
class Result:
    """What the options come to."""

    comparison: Comparison
    cabinet: str
    picture: str

    @property
    def kept(self) -> list[str]:
        """Designs that connect every point and violate no rule, the cheapest first."""
        return self.comparison.meeting

    @property
    def names(self) -> dict[str, str]:
        """What a figure calls each option: with the points that it leaves out, if there are."""
        left = self.comparison.table()["points_left_out"]
        return {
            str(option): f"{option}, {n:.0f} left out" if n else str(option)
            for option, n in left.items()
        }

    @property
    def asking(self) -> str:
        """Whose rules are judged: what IMO asks holds beside the rules of some societies."""
        return _and(list(dict.fromkeys(rule.rule_set for rule in self.comparison.rules)))

    @property
    def verdict(self) -> str:
        """Which options can be built, and the cheapest of them."""
        found, n = self.comparison.table(), len(self.comparison.iolist)
        if self.kept:
            cheapest = found[found.index == self.kept[0]].iloc[0]
            verb = "connects" if len(self.kept) == 1 else "connect"
            violates = "violates" if len(self.kept) == 1 else "violate"
            return (
                f"{_and(self.kept)} {verb} all {n} points and {violates} no rule of {self.asking} "
                f"that a plan can show\ncheapest of them: {self.kept[0]}, {_cost(cheapest, ' EUR')}"
            )
        if (found["points_left_out"] == 0).any():
            return f"every option that connects all {n} points violates a rule of {self.asking}"
        return f"no option connects all {n} points"

    @property
    def table(self) -> pd.DataFrame:
        """One row an option, as text."""
        found = self.comparison.table()
        counts = ["rules_met", "rules_violated", "rules_not_verified"]
        return pd.DataFrame(
            {
                "points left out": [f"{n:.0f}" for n in found["points_left_out"]],
                "conductors at the cabinet": [f"{n:,.0f}" for n in found["conductors_at_cabinet"]],
                "cable [kg]": [f"{kg:,.0f}" for kg in found["cable_mass_kg"]],
                "cost [EUR]": [_cost(row) for _, row in found.iterrows()],
                "worst response [ms]": [
                    f"{ms:,.0f}" if ms == ms else "-" for ms in found[RESPONSE]
                ],
                "points lost by one failure": [f"{n:.0f}" for n in found["lost_by_failure"]],
                "rules met / violated / unverified": [
                    " / ".join(f"{n:.0f}" for n in row) for row in found[counts].to_numpy()
                ],
                "Pareto-optimal": ["yes" if best else "no" for best in found["pareto"]],
            },
            index=found.index,
        )

    @property
    def numbers(self) -> dict[str, str]:
        """What the table leaves out, in words."""
        comparison = self.comparison
        criteria = _and([label(name).partition(" [")[0] for name in comparison.criteria])
        return {
            "list": "; ".join([str(comparison.iolist), *comparison.iolist.remarks]),
            "cabinet": self.cabinet,
            "Pareto-optimal": f"{_and(comparison.pareto()) or 'none'}, weighed by {criteria}",
            "what decides": self._assumptions,
            **self._misfits,
            **self._broken,
            **self._failures,
        }

    @property
    def _misfits(self) -> dict[str, str]:
        reasons = self.comparison.reasons()
        return {
            f"{option} does not fit": _told(
                f"{rows['text'].iloc[0]}{_such(len(rows))}"
                for _, rows in own.groupby("limit", sort=False)
            )
            for option, own in reasons.groupby("design", sort=False)
        }

    @property
    def _broken(self) -> dict[str, str]:
        violated = self.comparison.findings().violated()
        return {
            f"{option} violates": _told(
                f"{row.rule} ({row.asks}; {row.value:.4g} {row.unit} at {row.object})"
                for row in _each(rows)
            )
            for option, rows in violated.groupby("design", sort=False)
        }

    @property
    def _failures(self) -> dict[str, str]:
        said: dict[str, str] = {}
        for option, design in self.comparison.designs.items():
            ranked = worst(design.failures()).sort_values(
                "points_lost", ascending=False, kind="stable"
            )
            # Where no point fits, there is nothing to lose.
            said |= {
                f"{option} at worst": f"{row.points_lost} {_points(row.points_lost)} lost when "
                f"{row.failed} {_FAILED[row.failure]}"
                for row in _each(ranked[ranked["points_lost"] > 0])
            }
        return said

    @property
    def _assumptions(self) -> str:
        tornado = self.comparison.tornado()
        ends, unit, top = tornado.ends, tornado.unit, tornado.top()
        said = [
            f"{words(name)} ({_rounded(low)} to {_rounded(high)} {unit})"
            for name, (low, high) in zip(top, ends.loc[top].to_numpy(), strict=True)
        ]
        decides = f"; over their ranges: {', '.join(said)}" if said else ""
        return f"{tornado.subject}: {_rounded(tornado.at_nominal)} {unit}{decides}"


def _such(number: int) -> str:
    return f" ({number} such)" if number > 1 else ""


def _points(number: int) -> str:
    return "point is" if number == 1 else "points are"


def _each(rows: pd.DataFrame) -> Iterator[Any]:
    return iter(rows.itertuples())


def _and(names: Sequence[str]) -> str:
    return " and ".join(filter(None, [", ".join(names[:-1]), *names[-1:]]))


def _rounded(value: float) -> str:
    """Return a value to three digits; a fourth would say more than is known."""
    return f"{float(f'{value:.3g}'):,.0f}"


def _cost(row: pd.Series[float], unit: str = "") -> str:
    ends = (row[f"total_cost{end}_eur"] for end in ("", "_low", "_high"))
    nominal, low, high = map(_rounded, ends)
    return f"{nominal}{unit} ({low} to {high})"


def _told(texts: Iterable[str]) -> str:
    said = [text.replace(". (", " (").rstrip(".") for text in texts]
    more = f"; and {len(said) - _TOLD} more" if len(said) > _TOLD else ""
    return "; ".join(said[:_TOLD]) + more
