"""Designs of the same points side by side: what each takes, loses and meets."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from shipnet.design.costs import FIGURES, Quantities, number, quantities
from shipnet.design.designs import Network
from shipnet.design.failures import single_cuts, worst
from shipnet.design.planning import OPTIONS, plan
from shipnet.design.rules import RuleSet, check, rules_of
from shipnet.design.settings import HOST_TIME, Assumptions, Basis, Settings, changed
from shipnet.design.uncertainty import Tornado, draw, likely, tornado
from shipnet.errors import ArgumentError
from shipnet.parallel import points_of, sweep

if TYPE_CHECKING:
    import pandas as pd

    from shipnet.design.iolist import IoList
    from shipnet.design.site import Site


# Which of several options are worth a look: whole ones, and those that no other beats

RESPONSE = "worst response [ms]"

#: Columns of a comparison in which less is better, and by which options are weighed.
CRITERIA = ("total cost", RESPONSE, "lost by one failure")


def not_beaten(values: npt.ArrayLike) -> npt.NDArray[np.bool_]:
    """Return which rows no other row beats: the Pareto front, where less is better."""
    rows = np.asarray(values, float)
    if rows.ndim != 2:
        raise ArgumentError(f"values have shape {rows.shape}; it must be (n, k)")
    rows = np.where(np.isnan(rows), np.inf, rows)
    as_low = (rows[:, None] <= rows).all(axis=-1)
    return np.asarray(~(as_low & ~as_low.T).any(axis=0))


def complete(networks: Mapping[str, Network]) -> dict[str, Network]:
    """Return the networks that connect every point; all of them if none does."""
    return {name: network for name, network in networks.items() if network.fits} or dict(networks)


# What a comparison comes to, in words -----------------------------------------------------------

#: Share of the lengths given by which those of our own may be off, one by one, and unsaid; assumed.
_ALIKE = 0.1

#: Columns of which the lowest value is told, with words and unit.
_TOLD = (
    ("total cost", "Lowest cost", "EUR"),
    ("conductors at the cabinet", "Fewest conductors at the cabinet", ""),
    (RESPONSE, "Shortest response at worst", "ms"),
    ("lost by one failure", "Fewest points lost by one cable or device", ""),
)


def conclusions(
    networks: Mapping[str, Network], table: pd.DataFrame, tornado: Tornado, criteria: Sequence[str]
) -> list[str]:
    """Return what a comparison comes to, in words."""
    said = []
    for name, network in networks.items():
        if left := int(table["points left out"][name]):
            said.append(f"{name} leaves {left} of {len(network.points)} points out{_why(network)}.")
    said += _lengths(networks)
    whole = table[table["points left out"] == 0]
    if whole.empty:
        return [*said, "No option connects every point."]
    for column, words, unit in _TOLD:
        values = whole[column].dropna()
        if len(values) > 1:
            same = ", ".join(map(str, values.index[values == values.min()]))
            least = number(values.min())
            said.append(f"{words}: {same} ({least}{f' {unit}' if unit else ''}).")
    if beaten := [str(name) for name in whole.index[~whole["not beaten"]]]:
        said.append(f"Beaten in {', '.join(criteria)} at once: {', '.join(beaten)}.")
    return [*said, f"{str(tornado)[:1].upper()}{str(tornado)[1:]}."]


def _lengths(networks: Mapping[str, Network]) -> Iterator[str]:
    """Say that home runs of given lengths are not weighed alike, if it makes a difference."""
    first = next(iter(networks.values()))
    iolist, site = first.iolist, first.site
    kept = {
        tag
        for network in networks.values()
        for tag in network.runs.query("kind == 'home run' and route_m != route_m")["b"]
    }
    mine = iolist.points["tag"].isin(kept).to_numpy() & iolist.located
    if not mine.any():
        return
    given = iolist.points["home_run_m"].to_numpy(float)[mine]
    own = site.length(site.route(site.cabinet, iolist.places[mine]))
    if np.abs(own - given).sum() > _ALIKE * given.sum():
        cabinet = ", ".join(f"{value:g}" for value in site.cabinet)
        over = "" if site.trays is None else " over the trays"
        yield (
            f"Home runs keep the lengths of the list, {number(given.sum() / 1e3)} km for "
            f"{len(given)} points; from the cabinet at {cabinet} m{over}, as all other cables are "
            f"reckoned, they would be {number(own.sum() / 1e3)} km. With list_lengths false, all "
            "are reckoned alike."
        )


def _why(network: Network) -> str:
    """Return the first reason of each limit that an option runs into."""
    counts = network.reasons["limit"].value_counts()
    first = network.reasons.drop_duplicates("limit")
    said = [
        f"{text} (and {more} more)" if (more := counts[limit] - 1) else text
        for limit, text in zip(first["limit"], first["text"], strict=True)
    ]
    return f": {'; '.join(said)}" if said else ""


# The same points connected in several ways, side by side: what each takes, loses and keeps

_VERDICTS = {"pass": "rules kept", "fail": "rules broken", "not verified": "rules not verified"}


@dataclass(frozen=True, eq=False)
class Comparison:
    """Several ways to connect the points of one I/O list."""

    networks: dict[str, Network]
    quantities: dict[str, Quantities]
    cuts: dict[str, pd.DataFrame]
    rules: pd.DataFrame
    tornado: Tornado
    likely: pd.DataFrame | None
    criteria: tuple[str, ...]
    basis: Basis

    @property
    def changes(self) -> pd.DataFrame:
        """Values that are not the defaults: name, value, default, legal, meaning."""
        return self.basis.changes

    @property
    def iolist(self) -> IoList:
        """The points, which all options share."""
        return next(iter(self.networks.values())).iolist

    @property
    def site(self) -> Site:
        """The place, which all options share."""
        return next(iter(self.networks.values())).site

    @cached_property
    def table(self) -> pd.DataFrame:
        """One row an option: what it leaves out, takes, loses and keeps."""
        import pandas as pd

        rows = {name: self._row(name) for name in self.networks}
        table = pd.DataFrame.from_dict(rows, orient="index").rename_axis("option")
        complete = table["points left out"].to_numpy() == 0
        best = not_beaten(table[list(self.criteria)].to_numpy(float)[complete])
        return table.assign(**{"not beaten": _spread(complete, best)})

    @property
    def short(self) -> pd.DataFrame:
        """The rows of `table` that are asked for first, one column an option."""
        trays = ["lost by one tray"] if self.table["lost by one tray"].notna().any() else []
        rows = [
            "points left out", "conductors at the cabinet", "cable length", "cable mass", "labour",
            "total cost, low", "total cost", "total cost, high", RESPONSE, "lost by one cable",
            *trays, "lost by one device", "rules kept", "rules broken", "rules not verified",
        ]  # fmt: skip
        units = {row: FIGURES.get(row.split(",")[0], "1") for row in rows}
        named = {row: f"{row} [{unit}]" for row, unit in units.items() if unit != "1"}
        shown = self.table[rows].astype(object)
        for row in rows:
            shown[row] = [number(value) for value in shown[row]]
        shown["not beaten"] = self.pareto.map({True: "yes", False: "no"})
        return shown.T.rename(named)

    def _row(self, name: str) -> dict[str, float]:
        network, takes, cuts = self.networks[name], self.quantities[name], self.cuts[name]
        verdicts = self.rules.loc[self.rules["option"] == name, "verdict"].value_counts()
        most = worst(cuts).set_index("failure")["points_lost"]
        cable = max(most.get("cut", 0), most.get("short", 0))
        cost = takes.table.loc["total cost"]
        return {
            "points left out": int((~network.points["fits"]).sum()),
            **takes.table["nominal"],
            "total cost, low": cost["low"],
            "total cost, high": cost["high"],
            RESPONSE: network.worst_response_ms,
            "lost by one cable": cable,
            "lost by one tray": most.get("tray", float("nan")),
            "lost by one device": most.get("device", 0),
            "lost by one failure": max(cable, most.get("device", 0)),
            **{title: int(verdicts.get(verdict, 0)) for verdict, title in _VERDICTS.items()},
        }

    @property
    def pareto(self) -> pd.Series[bool]:
        """Which options no other beats: as good in every criterion, and better in one."""
        return self.table["not beaten"]

    @cached_property
    def reasons(self) -> pd.DataFrame:
        """Why something does not fit: the reasons of each network, behind a column ``option``."""
        return _by_option({name: network.reasons for name, network in self.networks.items()})

    @property
    def sentences(self) -> list[str]:
        """What the comparison comes to, in words."""
        return conclusions(self.networks, self.table, self.tornado, self.criteria)


def compare(
    iolist: IoList,
    site: Site,
    options: Sequence[str] = OPTIONS,
    *,
    rule_set: RuleSet = "DNV",
    assumptions: Assumptions | None = None,
    settings: Settings | None = None,
    more: Iterable[Network] = (),
    criteria: Sequence[str] = CRITERIA,
    host_time: float = HOST_TIME,
    rng: np.random.Generator | None = None,
) -> Comparison:
    """Plan the points of a list in several ways and compare them."""
    planned = [plan(iolist, site, option, settings=settings) for option in options]
    return compare_networks(
        [*planned, *more],
        rule_set=rule_set,
        assumptions=assumptions,
        settings=settings,
        criteria=criteria,
        host_time=host_time,
        rng=rng,
    )


def compare_networks(
    networks: Iterable[Network],
    *,
    rule_set: RuleSet = "DNV",
    assumptions: Assumptions | None = None,
    settings: Settings | None = None,
    criteria: Sequence[str] = CRITERIA,
    host_time: float = HOST_TIME,
    rng: np.random.Generator | None = None,
) -> Comparison:
    """Compare networks that connect the same points."""
    given = list(networks)
    named = {network.name: network for network in given}
    if not given or len(named) < len(given):
        names = ", ".join(repr(network.name) for network in given) or "none"
        raise ArgumentError(f"networks are {names}; it must be one or more, each of its own name")
    tags = given[0].points["tag"].tolist()
    if other := [net.name for net in given if net.points["tag"].tolist() != tags]:
        raise ArgumentError(f"networks {', '.join(other)} have not the points of {given[0].name}")
    site = given[0].site
    basis = Basis(
        Settings() if settings is None else settings,
        Assumptions() if assumptions is None else assumptions,
        site.detour, site.tails, host_time,
    )  # fmt: skip
    sums = {name: quantities(network, assumptions) for name, network in named.items()}
    cuts = {name: single_cuts(network) for name, network in named.items()}
    checked = {
        name: check(network, rule_set, host_time=host_time, cuts=cuts[name])
        for name, network in named.items()
    }
    made = Comparison(
        named,
        sums,
        cuts,
        _by_option(checked),
        tornado(complete(named), assumptions=assumptions),
        None if rng is None else likely(draw(named, assumptions, rng=rng)),
        tuple(criteria),
        basis,
    )
    known = [*made._row(given[0].name)]
    if not criteria or not set(criteria) <= set(known):
        raise ArgumentError(f"criteria are {tuple(criteria)}; they must be of {', '.join(known)}")
    return made


def _spread(where: npt.NDArray[np.bool_], values: npt.NDArray[np.bool_]) -> npt.NDArray[np.bool_]:
    spread = np.zeros(len(where), bool)
    spread[where] = values
    return spread


def _by_option(tables: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    import pandas as pd

    named = [table.assign(option=name) for name, table in tables.items()]
    joined = pd.concat([table for table in named if len(table)] or named[:1], ignore_index=True)
    return joined[["option", *joined.columns.drop("option")]]


# Whole comparisons over values of what they rest on, to see how far the answer depends on them


@dataclass(frozen=True)
class _Case:
    """A comparison at given values; it travels to other processes, so it is no inner function."""

    iolist: IoList
    site: Site
    options: tuple[str, ...]
    basis: Basis
    rule_set: RuleSet

    def __call__(self, **values: Any) -> dict[str, pd.DataFrame]:
        basis = self.basis.with_(values)
        found = compare(
            self.iolist,
            replace(self.site, detour=basis.detour, tails=basis.tails),
            self.options,
            rule_set=self.rule_set,
            assumptions=basis.assumptions,
            settings=basis.settings,
            host_time=basis.host_time,
        )
        return {_TABLE: found.table.reset_index()}


_TABLE = "comparison"


def study(
    iolist: IoList,
    site: Site,
    grid: Mapping[str, Sequence[Any]] | Iterable[Mapping[str, Any]],
    options: Sequence[str] = OPTIONS,
    *,
    rule_set: RuleSet = "DNV",
    assumptions: Assumptions | None = None,
    settings: Settings | None = None,
    host_time: float = HOST_TIME,
    parallel: bool | AbstractContextManager[Any] | None = None,
    progress: bool | Callable[[int, int], object] | None = None,
) -> pd.DataFrame:
    """Compare the options anew at every point of a grid of values."""
    import pandas as pd

    points = points_of(grid)
    start = Basis(
        Settings() if settings is None else settings,
        Assumptions() if assumptions is None else assumptions,
        site.detour, site.tails, host_time,
    )  # fmt: skip
    faults = {fault for point in points for fault in changed(start, point)[1]}
    if faults:
        raise ArgumentError("; ".join(sorted(faults)))
    case = _Case(iolist, site, tuple(options), start, rules_of(rule_set))
    found = sweep(case, points, parallel=parallel, progress=progress)
    tables = []
    for point, table in zip(points, found[_TABLE], strict=True):
        # A value may be a range or several bit rates: it stands as it is in every row.
        given = {name: [value] * len(table) for name, value in point.items()}
        tables.append(table.assign(**given)[[*point, *table.columns]])
    joined: pd.DataFrame = pd.concat(tables, ignore_index=True)
    return joined
