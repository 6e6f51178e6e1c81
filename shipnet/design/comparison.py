"""The same points connected in several ways, side by side: what each takes, loses and keeps."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from shipnet.design.basis import Basis
from shipnet.design.conclusions import conclusions
from shipnet.design.costs.assumptions import Assumptions
from shipnet.design.costs.quantities import FIGURES, Quantities, quantities
from shipnet.design.costs.sensitivity import Tornado, tornado
from shipnet.design.costs.uncertainty import draw, likely
from shipnet.design.digits import number
from shipnet.design.front import CRITERIA, RESPONSE, complete, not_beaten
from shipnet.design.network import Network
from shipnet.design.plan import OPTIONS, Settings, plan
from shipnet.design.rules import HOST_TIME, RuleSet, check
from shipnet.design.rules.cuts import single_cuts, worst
from shipnet.errors import ArgumentError

if TYPE_CHECKING:
    import pandas as pd

    from shipnet.design.iolist import IoList
    from shipnet.design.site import Site

__all__ = [
    "CRITERIA",
    "RESPONSE",
    "Comparison",
    "compare",
    "compare_networks",
    "complete",
    "not_beaten",
]

_VERDICTS = {"pass": "rules kept", "fail": "rules broken", "not verified": "rules not verified"}


@dataclass(frozen=True, eq=False)
class Comparison:
    """Several ways to connect the points of one I/O list.

    Parameters
    ----------
    networks : dict of str to Network
        The options by name.
    quantities : dict of str to Quantities
        What each takes.
    cuts : dict of str to pandas.DataFrame
        What every single failure of each costs.
    rules : pandas.DataFrame
        What `shipnet.design.rules.check` returned for each, behind a column ``option``.
    tornado : Tornado
        Which assumptions matter for what the cheapest option costs less than the first one, of
        those that connect every point.
    likely : pandas.DataFrame or None
        Figures in 9 of 10 draws of the assumptions, by option and figure, if drawn.
    criteria : tuple of str
        Columns of `table` by which options are weighed.
    basis : Basis
        What else it rests on: limits, prices, allowances, and what the host adds.

    Examples
    --------
    >>> from shipnet.design.example import example
    >>> both = compare_networks([example(), example(redundant=True)])
    >>> both.table[["cables", "lost by one cable", "rules broken"]].values.tolist()
    [[6.0, 4.0, 1.0], [8.0, 1.0, 0.0]]
    """

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
        """One row an option: what it leaves out, takes, loses and keeps.

        ``points left out``; every figure of `shipnet.design.costs.quantities.FIGURES`, nominal, and
        ``total cost, low`` and ``, high``; ``worst response [ms]``; points ``lost by one cable``
        (cut or shorted), ``by one tray`` (NaN without trays), ``by one device`` (but the cabinet)
        and ``by one failure`` (cable or device); ``rules kept``, ``rules broken`` and ``rules not
        verified``; ``not beaten``, as `pareto`.
        """
        import pandas as pd

        rows = {name: self._row(name) for name in self.networks}
        table = pd.DataFrame.from_dict(rows, orient="index").rename_axis("option")
        complete = table["points left out"].to_numpy() == 0
        best = not_beaten(table[list(self.criteria)].to_numpy(float)[complete])
        return table.assign(**{"not beaten": _spread(complete, best)})

    @property
    def short(self) -> pd.DataFrame:
        """The rows of `table` that are asked for first, one column an option.

        Counts are whole; quantities have three digits. What a tray costs stands there if trays are
        given.
        """
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
        """Which options no other beats: as good in every criterion, and better in one.

        An option that leaves points out is beaten by not being one.
        """
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
    """Plan the points of a list in several ways and compare them.

    Parameters
    ----------
    iolist : IoList
        The points.
    site : Site
        Where the cabinet is, and how cables get from place to place.
    options : sequence of str, default all of `shipnet.design.plan.OPTIONS`
        Which ways.
    rule_set : str, path or tuple of Rule, default "DNV"
        As `shipnet.design.rules.rules_of`.
    assumptions : Assumptions, optional
        Those of the data file if omitted.
    settings : Settings, optional
        Limits of the planners; their own if omitted.
    more : iterable of Network
        Networks of the same list to be compared too, such as those of `shipnet.design.plan.mix`.
    criteria, host_time, rng
        As `compare_networks`.

    Returns
    -------
    Comparison
        The options in the order given, then those of `more`.

    Raises
    ------
    ArgumentError
        If there is nothing to compare, an option is unknown or stands twice, or another argument
        is out of range.
    InputError
        If a file of rules does not hold any.

    Examples
    --------
    >>> from shipnet.design.example import example
    >>> small = example()
    >>> both = compare(small.iolist, small.site, ["home runs", "Modbus RTU"], rule_set="IMO")
    >>> both.table["points left out"].tolist()
    [0, 0]
    """
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
    """Compare networks that connect the same points.

    Parameters
    ----------
    networks : iterable of Network
        One or more, each with a name of its own.
    rule_set : str, path or tuple of Rule, default "DNV"
        As `shipnet.design.rules.rules_of`.
    assumptions : Assumptions, optional
        Those of the data file if omitted.
    settings : Settings, optional
        Limits that they were planned within, which a report tells; the defaults if omitted.
    criteria : sequence of str, default `CRITERIA`
        Columns of the table by which options are weighed; less is better in each.
    host_time : float, default 0.5
        What the host adds to the response where a rule counts it [s]; assumed.
    rng : numpy.random.Generator, optional
        Draws the assumptions for the likely figures; without one there are none.

    Returns
    -------
    Comparison
        In the order given.

    Raises
    ------
    ArgumentError
        If there is no network, two have one name or not the same points, or a criterion is no
        column.

    Examples
    --------
    >>> from shipnet.design.costs.plants import Plant
    >>> plant = Plant(modules=62, contacts=4)
    >>> both = compare_networks([plant.hardwired, plant.on_asi])
    >>> both.table["conductors at the cabinet"].tolist()
    [496.0, 2.0]
    """
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
