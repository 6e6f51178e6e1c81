"""Comparison of designs of the same points: quantities, points lost, and rules met."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass, replace
from functools import cached_property
from operator import attrgetter
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from shipnet.answers import Findings
from shipnet.design import ship
from shipnet.design.costs import (
    CRITERIA,
    FIGURES,
    LABELS,
    WEIGHED,
    Quantities,
    Rng,
    Tornado,
    counted,
    draw,
    label,
    likely,
    number,
    ranges_of,
    tornado,
)
from shipnet.design.designs import Design
from shipnet.design.failures import worst
from shipnet.design.layout import Site
from shipnet.design.planning import OPTIONS, plan
from shipnet.design.plot import plot_pareto, plot_ranges
from shipnet.design.points import ROUNDED, PointTable
from shipnet.design.report import BANNER, report_html
from shipnet.design.rules import RuleSet
from shipnet.design.settings import Settings, kind_of, names
from shipnet.design.tables import file_name, save_files
from shipnet.errors import ArgumentError, some
from shipnet.fields import check_choice, check_kind, check_rng
from shipnet.html import as_html
from shipnet.lazy import Axes, pd
from shipnet.tables import as_csv
from shipnet.toml_file import shown

#: Columns on the segments of buses; each shows the highest value of all segments of a design.
_BUS = ("bus_time", "capacity_used")

#: Fraction by which given and computed lengths may differ without a remark; assumed.
_ALIKE = 0.1

#: Columns whose lowest value the conclusions state, with a label and a unit for each.
_TOLD = (
    ("conductors_at_cabinet", "Fewest conductors at the cabinet", ""),
    ("worst_response_ms", "Shortest worst response", "ms"),
    ("lost_by_failure", "Fewest points lost in the worst single failure", ""),
)

#: Rows of a comparison printed as text; rows about buses appear only if a design has a bus.
_SHORT = (
    "points_left_out conductors_at_cabinet cable_length_km cable_mass_kg labour_h "
    "total_cost_low_eur total_cost_eur total_cost_high_eur bus_time capacity_used "
    "worst_response_ms lost_by_cable lost_by_device rules_met rules_violated rules_not_verified"
).split()


def pareto_optimal(values: npt.ArrayLike) -> npt.NDArray[np.bool_]:
    """Return True for each Pareto-optimal row; lower values are better, and NaN is the worst."""
    rows = np.asarray(values, float)
    if rows.ndim != 2:
        raise ArgumentError(f"values have shape {rows.shape}; it must be (n, k)")
    rows = np.where(np.isnan(rows), np.inf, rows)
    as_low = (rows[:, None] <= rows).all(axis=-1)
    return np.asarray(~(as_low & ~as_low.T).any(axis=0))


@dataclass(frozen=True, eq=False)
class Comparison:
    r"""Comparison of several ways to connect the points of one list.

    `IoList.compare` plans designs and compares them; `compare` compares existing designs. All
    designs have the same points, cabinet and assumptions, and the same `detour` and `tails`.

    Parameters
    ----------
    designs : dict of str to Design
        The designs by name.
    rules : RuleSet
        The rules against which the designs are checked.
    rng : numpy.random.Generator
        Generator that draws the assumptions from their ranges.
    remarks : tuple of str, optional
        Remarks from planning, such as the inferred position of the cabinet.
    previous : Comparison, optional
        Comparison of an earlier list; the conclusions say what changed.

    Examples
    --------
    >>> from shipnet.design import IoList
    >>> points = IoList.parse("tag,signal,x,y,z\nLS-1,contact,3,2,3\nLS-2,contact,30,2,3")
    >>> found = points.compare((0, 0, 0), ["home runs", "AS-i", "CAN"])
    >>> found.verdict.partition(" (")[0]
    'home runs, 610 EUR, is the cheapest design that connects every point and violates no rule'
    >>> found.table()["conductors_at_cabinet"].to_dict()
    {'home runs': 4.0, 'AS-i': 2.0, 'CAN': 4.0}
    >>> more = found.add(found.plan("AS-i", settings={"asi.tree": False}, name="chain"))
    >>> more.pareto("total_cost_eur", "lost_by_failure"), more.changes()["name"].tolist()
    (['home runs'], ['asi.tree'])
    """

    designs: dict[str, Design]
    rules: RuleSet
    rng: np.random.Generator
    remarks: tuple[str, ...] = ()
    previous: Comparison | None = None

    @property
    def iolist(self) -> PointTable:
        """The points, which all designs share."""
        return self._first.iolist

    @property
    def site(self) -> Site:
        """The position of the cabinet and the cable allowances, which all designs share."""
        return self._first.site

    @property
    def settings(self) -> Settings:
        """Settings of the first design; `changes` lists the changed settings of all designs."""
        return self._first.settings

    @property
    def _first(self) -> Design:
        return next(iter(self.designs.values()))

    @cached_property
    def quantities(self) -> dict[str, Quantities]:
        """Quantities of each design: conductors, cable, hours and cost."""
        return {name: design.quantities() for name, design in self.designs.items()}

    def table(self) -> pd.DataFrame:
        """Return one row per design: points left out, quantities, points lost, and rules met."""
        return self._table.copy()

    @cached_property
    def _table(self) -> pd.DataFrame:
        rows = {}
        for name, design in self.designs.items():
            row: dict[str, Any] = {"points_left_out": int((~design.points["fits"]).sum())}
            rows[name] = row
            if not design.connected:
                continue
            figures = self.quantities[name].figures
            verdicts = self._checked[name].table()["verdict"].value_counts()
            most = worst(design._failures).set_index("failure")["points_lost"]
            cable, device = max(most.get("cut", 0), most.get("short", 0)), most.get("device", 0)
            row |= {
                **figures["nominal"],
                "total_cost_low_eur": figures.loc["total_cost_eur", "low"],
                "total_cost_high_eur": figures.loc["total_cost_eur", "high"],
                **design.segments[list(_BUS)].max(),
                "worst_response_ms": design.worst_response_ms,
                "lost_by_cable": cable,
                "lost_by_device": device,
                "lost_by_failure": max(cable, device),
                "rules_met": int(verdicts.get("met", 0)),
                "rules_violated": int(verdicts.get("violated", 0)),
                "rules_not_verified": int(verdicts.get("not verified", 0)),
            }
        table = pd.DataFrame.from_dict(rows, orient="index").rename_axis("design")
        table = table.reindex(columns=[column for column in LABELS if column != "pareto"])
        return table.assign(pareto=self._optimal(table, CRITERIA))

    @staticmethod
    def _optimal(table: pd.DataFrame, columns: Sequence[str]) -> npt.NDArray[np.bool_]:
        """Return True for each design that has all points and is Pareto-optimal in `columns`."""
        whole = table["points_left_out"].to_numpy() == 0
        best = np.zeros(len(table), bool)
        best[whole] = pareto_optimal(table[list(columns)].to_numpy(float)[whole])
        return best

    def pareto(self, *columns: str) -> list[str]:
        """Return the designs that are Pareto-optimal in `columns`, or by default in `CRITERIA`."""
        chosen = [check_choice("one of columns", column, self._table.columns) for column in columns]
        best = self._optimal(self._table, chosen or CRITERIA)
        return [str(name) for name in self._table.index[best]]

    @property
    def meeting(self) -> list[str]:
        """Names of the designs that connect every point and violate no rule, cheapest first."""
        table = self._table
        table = table[(table["points_left_out"] == 0) & (table["rules_violated"] == 0)]
        return [str(name) for name in table.sort_values("total_cost_eur", kind="stable").index]

    @property
    def best(self) -> Design | None:
        """The cheapest design that connects every point and violates no rule, or None."""
        return next((self.designs[name] for name in self.meeting), None)

    @property
    def ok(self) -> bool:
        """True if at least one design connects every point and violates no rule."""
        return bool(self.meeting)

    @property
    def verdict(self) -> str:
        """The result of the comparison in one line."""
        connecting = [name for name, design in self.designs.items() if design.connected]
        parts = []
        if len(connecting) < min(2, len(self.designs)):
            only = "".join(f"only {name} can connect points" for name in connecting)
            parts.append(f"nothing to compare: {only or 'no design can connect a point'}")
            if not self.iolist.located.any():
                parts.append("give the position of each point, as x, y, z or frame, deck and side")
        elif all(self._table["points_left_out"]):
            parts.append("no design connects all points")
        elif self.best is None:
            parts.append("every design that connects all points violates a rule")
        return "; ".join([*parts, *self._winner, *self._remedy])

    @property
    def _winner(self) -> Iterator[str]:
        """Phrases on the best design, with its doubts, and on a cheaper one that violates rules."""
        if self.best is None:
            return
        costs = self._table["total_cost_eur"][self._table["points_left_out"] == 0]
        best, rank, doubts = self.best.name, "only", []
        if len(self.meeting) > 1:
            # A random sample cannot show a probability of 0 or 1.
            percent = f"{100 * np.clip(self.chances[best], 0.01, 0.99):.0f} %"
            rank, doubts = "cheapest", [f"cheapest with {percent} probability"]
        rules = self._checked[best].table()
        not_verified = rules[rules["verdict"] == "not verified"]
        unread = int((not_verified["confirmed"] == "no").sum())
        if count := len(not_verified):
            more = f", {unread} unread" if unread else ""
            doubts.append(f"{count} of {len(rules)} rules not verified{more}")
        doubt = f" ({'; '.join(doubts)})" if doubts else ""
        which = f"the {rank} design that connects every point and violates no rule{doubt}"
        yield f"{best}, {number(costs[best])} EUR, is {which}"
        least = str(costs.idxmin())
        if (less := costs[best] - costs[least]) > 0:
            yield f"{least} costs {number(less)} EUR less but violates {self._violated[least]}"

    @cached_property
    def _remedy(self) -> list[str]:
        """At most one phrase: a doubled bus that is not compared, but would be the best design."""
        others = [
            plan(self.iolist, self.site, way, settings=design.settings, rules=self.rules)
            for name, design in self.designs.items()
            if name in self._violated and (way := f"{name} doubled") in {*OPTIONS} - {*self.designs}
        ]
        best = self.add(*others).best if others else None
        if best is None or best.name in self.designs:
            return []
        cost = number(best.quantities()["total_cost_eur"])
        return [f"{best.name} would cost {cost} EUR and violate none of the rules verified"]

    @cached_property
    def chances(self) -> dict[str, float]:
        """Probability that each of `meeting` is the cheapest, with assumptions drawn at random."""
        if not self.meeting:
            return {}
        costs = np.stack([self._sample[name, "total_cost_eur"] for name in self.meeting])
        wins = np.bincount(costs.argmin(axis=0), minlength=len(costs))
        return dict(zip(self.meeting, (wins / wins.sum()).tolist(), strict=True))

    @property
    def _violated(self) -> dict[str, str]:
        """The first three rules that each design violates, in words, if it violates any."""
        words = {}
        for name, findings in self._checked.items():
            if rules := [repr(rule) for rule in findings.violated()["rule"]]:
                words[name] = some(rules, 3)
        return words

    @cached_property
    def _checked(self) -> dict[str, Findings]:
        return {name: design.check(self.rules) for name, design in self.designs.items()}

    def findings(self) -> Findings:
        """Return the findings for all designs; the column ``design`` contains the design's name."""
        return Findings(
            _by_design({name: checked.table() for name, checked in self._checked.items()})
        )

    def failures(self) -> pd.DataFrame:
        """Return the points lost in each single failure, worst first, one design after another."""
        return _by_design({name: design.failures() for name, design in self.designs.items()})

    def reasons(self) -> pd.DataFrame:
        """Return the reasons why points or cables do not fit, for each design."""
        return _by_design({name: design.reasons for name, design in self.designs.items()})

    def changes(self) -> pd.DataFrame:
        """Return the settings that differ from the defaults, and the designs that use them."""
        default, rows = Settings(), []
        for name in names():
            having: dict[str, list[str]] = {}
            for design in self.designs.values():
                if design.settings[name] != default[name]:
                    having.setdefault(shown(design.settings[name]), []).append(design.name)
            for using in having.values():
                value, kind = self.designs[using[0]].settings[name], kind_of(name)
                which = "all" if len(using) == len(self.designs) else ", ".join(using)
                rows.append((name, value, default[name], kind.unit, kind.help, which))
        columns = ["name", "value", "default", "unit", "meaning", "designs"]
        return pd.DataFrame(rows, columns=columns)

    def likely(self) -> pd.DataFrame:
        """Return the median and the central 90 % interval of each figure of each design."""
        return self._likely.copy()

    @cached_property
    def _likely(self) -> pd.DataFrame:
        return likely(self._sample)

    @cached_property
    def _sample(self) -> pd.DataFrame:
        # Draw from a copy of rng, so that every comparison with this rng has the same draws.
        return draw(self.designs, rng=deepcopy(self.rng))

    def tornado(self, a: str | None = None, b: str | None = None) -> Tornado:
        """Return the effect of each assumption on the difference in cost, design `a` minus `b`.

        By default, `b` is the first design with all points, and `a` is the other such design with
        the lowest cost. If only `a` or `b` is given, the effect on its own cost is returned.
        """
        if a is None and b is None:
            whole = {name: design for name, design in self.designs.items() if design.fits}
            return tornado(whole or self.designs)
        if a == b:
            raise ArgumentError(f"a and b are both {a!r}; they must be different designs")
        chosen = [(what, one) for what, one in (("b", b), ("a", a)) if one is not None]
        names = [check_choice(what, one, self.designs) for what, one in chosen]
        return tornado({name: self.designs[name] for name in names})

    def plot(self, x: str = "total_cost_eur", y: str | None = None, ax: Axes | None = None) -> Axes:
        """Draw figure `x` of each design with its range, or plot column `y` against column `x`."""
        if y is None:
            drawn: Any = self._likely.xs(check_choice("x", x, FIGURES), level="figure")
            named = counted(self._table)
            ends, drawn = (t.rename(named) for t in (ranges_of(self.quantities, x), drawn))
            return plot_ranges(ends, label(x), likely=drawn, ax=ax)
        for what, column in (("x", x), ("y", y)):
            check_choice(what, column, self._table.columns)
        whole = self._table[self._table["points_left_out"] == 0]
        return plot_pareto(
            whole[[x, y]].set_axis([label(x), label(y)], axis=1), self.pareto(x, y), ax=ax
        )

    def drawing(self) -> ship.ShipDrawing:
        """Return all designs in the ship, in which a cable or device that is clicked fails."""
        drawn = {}
        for name, design in self.designs.items():
            cost = f"{number(self.quantities[name]['total_cost_eur'])} EUR"
            rules = [f"violates {self._violated[name]}"] if name in self._violated else []
            words = "; ".join([cost, ship.note(design, design._failures), *rules])
            drawn[name] = design, design._failures, words
        return ship.draw(drawn)

    def plan(
        self,
        option: str,
        *,
        settings: Mapping[str, object] | None = None,
        mix: Mapping[str, str] | None = None,
        name: str | None = None,
    ) -> Design:
        """Plan another design with the first one's points, cabinet and, unless given, settings.

        Of a revised list, it keeps the earlier design of the same name.
        """
        values = self.settings.replace(settings or {})
        old = self.previous.designs.get(name or option) if self.previous else None
        more: dict[str, Any] = {"mix": mix, "name": name, "rules": self.rules, "keep": old}
        return plan(self.iolist, self.site, option, settings=values, **more)

    def add(self, *designs: Design) -> Comparison:
        """Return a comparison that also contains further designs of the same points."""
        every = [*self.designs.values(), *(check_kind("design", one, Design) for one in designs)]
        return replace(compared(every, self.rules, self.rng, self.remarks), previous=self.previous)

    def diff(self, other: Comparison) -> pd.DataFrame:
        """Return what changes from this comparison to an `other`, one row per common design.

        The other comparison is of a revised list or of another ship. The columns count the points
        and cables that are added, removed or changed, and give the differences in cable length,
        labour, cost and rules violated; `words` says it in one sentence, with the first names.
        """
        common = [name for name in self.designs if name in other.designs]
        rows = [_difference(self, other, name) for name in common]
        return pd.DataFrame(rows, index=pd.Index(common, name="design"))

    def conclusions(self) -> list[str]:
        """Return the results of the comparison as sentences."""
        table = self._table
        left_out = {}
        for name, design in self.designs.items():
            if left := int((~design.points["fits"]).sum()):
                counts = design.reasons["limit"].value_counts()
                first = design.reasons.drop_duplicates("limit")
                why = [
                    f"{text} (and {more} more)" if (more := counts[limit] - 1) else text
                    for limit, text in zip(first["limit"], first["text"], strict=True)
                ]
                of = f"out {left} of {len(design.points)} points"
                left_out[name] = f"{of}: {'; '.join(why)}" if why else of
        sentences = [*_alike("leave", left_out), *_alike("violate", self._violated)]
        sentences += _lengths(self.designs)
        limited = {}
        for name, design in self.designs.items():
            if loose := design.without_limits:
                cost = self.quantities[name]["total_cost_eur"]
                more = cost - loose.quantities()["total_cost_eur"]
                limited[name] = f"{_than(more)} without the rules' response limits"
        sentences += _alike("cost", limited)
        sentences += self._safe_points
        whole = table[table["points_left_out"] == 0]
        if self.previous is not None:
            source = Path(self.previous.iolist.source).name
            changed = self.previous.diff(self)["words"].items()
            sentences += [f"{name} compared with {source}: {words}." for name, words in changed]
        sentences = [f"{self.verdict[:1].upper()}{self.verdict[1:]}.", *sentences]
        if whole.empty:
            return sentences
        for column, words, in_ in _TOLD:
            values = whole[column].dropna()
            if len(values) > 1:
                same = ", ".join(map(str, values.index[values == values.min()]))
                least = number(values.min())
                sentences.append(f"{words}: {same} ({least}{f' {in_}' if in_ else ''}).")
        if others := [str(name) for name in whole.index[~whole["pareto"]]]:
            sentences.append(f"Not Pareto-optimal in {WEIGHED}: {', '.join(others)}.")
        last = str(self.tornado())
        return [*sentences, f"{last[:1].upper()}{last[1:]}."]

    @cached_property
    def _safe_points(self) -> list[str]:
        """At most one sentence: where intrinsic-safety barriers are, and the alternative's cost."""
        safe = (self.iolist.points["ex"] != "").to_numpy()
        buses = [
            name for name in OPTIONS[2:] if name in self.designs and self.designs[name].connected
        ]
        start = f"Intrinsically safe points: {safe.sum()}, each with a barrier in "
        if not safe.any() or not buses:
            return [f"{start}the cabinet."] if safe.any() else []
        name = min(buses, key=lambda bus: self.quantities[bus]["total_cost_eur"])
        design = self.designs[name]
        onto, values = design.settings.field_barriers, design.settings
        values = values.replace({"field_barriers": not onto})
        other = plan(self.iolist, self.site, name, settings=values, rules=self.rules)
        more = self.quantities[name]["total_cost_eur"] - other.quantities()["total_cost_eur"]
        if np.isnan(more):  # the points without their barriers cannot be connected at all
            return [f"{start}{'its box' if onto else 'the cabinet'}."]
        where, other_way = "the cabinet", "field_barriers, which connects such points to the bus"
        if onto:
            where, other_way = "its box", "home runs to barriers in the cabinet"
        return [f"{start}{where}; {name} costs {_than(more)} with {other_way}."]

    def short(self) -> pd.DataFrame:
        """Return the most important results as text, with one column per design."""
        table = self._table
        rows = [row for row in _SHORT if row not in _BUS or table[row].notna().any()]
        shown = table[rows].astype(object)
        for row in rows:
            shown[row] = [number(value) for value in shown[row]]
        shown["pareto"] = table["pareto"].map({True: "yes", False: "no"})
        return shown.T.rename(label)

    def __str__(self) -> str:
        changed = [
            f"changed: {row['name']} {shown(row['value'])} (default {shown(row['default'])})"
            + ("" if row["designs"] == "all" else f", {row['designs']}")
            for row in self.changes().to_dict("records")
        ]
        top = [str(self.iolist), *self.iolist.remarks, *self.remarks, *changed]
        used = pd.concat([each.assumptions for each in self.quantities.values()])
        status = used.drop_duplicates("name")["status"]
        assumed = f"{(status != 'given').sum()} of {len(status)}"
        last = f"{BANNER} {assumed} prices, masses, hours and factors are assumed."
        return "\n".join([*top, f"\n{self.short().to_string()}\n", *self.conclusions(), last])

    def __repr__(self) -> str:
        return f"<Comparison: {self.verdict}>"

    def _repr_html_(self) -> str:
        order = ["points_left_out", "rules_violated", "total_cost_eur"]
        names = [*order, "total_cost_low_eur", "total_cost_high_eur", "lost_by_failure"]
        return as_html(self, self._table[names].sort_values(order))

    def html(self, *, title: str | None = None, date: str | None = None) -> str:
        """Return the report as one self-contained HTML page."""
        title = title or f"Connecting the points of {Path(self.iolist.source).name}"
        return report_html(self, title, date or "")

    def report(
        self, path: str | PathLike[str], *, title: str | None = None, date: str | None = None
    ) -> None:
        """Write the report as one HTML file that can be read offline and printed."""
        page = self.html(title=title, date=date)
        Path(path).write_text(page, encoding="utf-8", newline="\n")

    def files(self) -> Iterator[tuple[str, bytes]]:
        """Yield the name and the content of each file that `save` writes."""
        for name, table in (
            ("comparison", self.table().reset_index()),
            ("findings", self.findings().table()),
            ("failures", self.failures()),
            ("reading", self.iolist.reading()),
        ):
            yield f"{name}.csv", as_csv(table, digits=10)
        taken = Counter[str]()
        for name, design in self.designs.items():
            folder = file_name(name)
            taken[folder.casefold()] += 1
            if (number := taken[folder.casefold()]) > 1:
                folder += f" ({number})"
            yield from ((f"{folder}/{file}", content) for file, content in design.files())

    def save(self, folder: str | PathLike[str]) -> None:
        """Write the comparison, its findings and failures, and every design to a folder.

        Each design has a subfolder with the files that `Design.save` writes.
        """
        save_files(folder, self.files())


def compare(
    designs: Iterable[Design],
    *,
    rules: RuleSet | str | PathLike[str] = "DNV",
    rng: Rng = 2024,
) -> Comparison:
    """Compare designs of the same points with the same cabinet.

    Parameters
    ----------
    designs : iterable of Design
        Designs with different names but the same points, cabinet, assumptions, detour and tails.
    rules : RuleSet, str or path, default "DNV"
        Rule set, name of a published rule set, or path of a file with rules.
    rng : numpy.random.Generator or int, default 2024
        Generator that draws the assumptions from their ranges, or its seed.

    Returns
    -------
    Comparison
        The comparison of the designs.

    Raises
    ------
    ArgumentError
        If no design is given, or if two have the same name or differ in a value that must be equal.

    Examples
    --------
    >>> from shipnet.design import Plant
    >>> plant = Plant(10, contacts=2, distance=20, spacing=4)
    >>> compare([plant.hardwired, plant.on_asi]).table()["total_cost_eur"].round().to_dict()
    {'hardwired': 8454.0, 'AS-i': 7440.0}
    """
    return compared(list(designs), RuleSet.of(rules), check_rng(rng))


def compared(
    designs: Sequence[Design],
    rules: RuleSet,
    rng: np.random.Generator,
    remarks: tuple[str, ...] = (),
) -> Comparison:
    """Return a comparison of designs that includes the remarks from planning."""
    named = {design.name: design for design in designs}
    if not designs or len(named) < len(designs):
        names = ", ".join(repr(design.name) for design in designs) or "none"
        raise ArgumentError(f"designs are {names}; there must be one or more, with different names")
    first = designs[0]
    tags = first.points["tag"].tolist()
    for design in designs[1:]:
        if design.points["tag"].tolist() != tags:
            raise ArgumentError(f"designs {design.name!r} and {first.name!r} have different points")
        for name in ("cabinet", "detour", "tails", "assumptions"):
            of = attrgetter("site.cabinet" if name == "cabinet" else f"settings.{name}")
            if of(design) != of(first):
                raise ArgumentError(
                    f"designs {design.name!r} and {first.name!r} differ in {name}, so their costs "
                    "cannot be compared"
                )
    return Comparison(named, rules, rng, remarks)


def _lengths(designs: Mapping[str, Design]) -> Iterator[str]:
    """Yield sentences on home runs whose listed lengths differ from the computed lengths."""
    first = next(iter(designs.values()))
    iolist, site = first.iolist, first.site
    kept = set[str]()
    for design in designs.values():
        cables = design.cables
        kept.update(cables["b"][(cables["kind"] == "home run") & cables["route_m"].isna()])
    both = iolist.points["tag"].isin(kept).to_numpy() & iolist.located
    if not both.any():
        return
    listed = iolist.points["home_run_m"].to_numpy(float)[both]
    computed = site.length(site.route(site.cabinet, iolist.places[both]))
    straight = np.linalg.norm(iolist.places[both] - np.array(site.cabinet), axis=1)
    if short := int((listed < straight - ROUNDED).sum()):
        yield (
            f"{short} home {'run' if short == 1 else 'runs'} of the list "
            f"{'is' if short == 1 else 'are'} "
            "shorter than the straight distance to the cabinet; the list's length is used."
        )
    if np.abs(computed - listed).sum() > _ALIKE * listed.sum():
        cabinet = ", ".join(f"{value:g}" for value in site.cabinet)
        yield (
            f"Home runs have the lengths in the list, {number(listed.sum() / 1e3)} km in total for "
            f"{len(listed)} points; computed from positions, with the cabinet at {cabinet} m, the "
            f"total would be {number(computed.sum() / 1e3)} km. Set list_lengths to false to use "
            "computed lengths."
        )


def _than(more: float) -> str:
    """Return the phrase that compares one cost with another."""
    if not round(more):
        return "as much as"
    return f"{number(abs(more))} EUR {'less' if more < 0 else 'more'} than"


def _alike(verb: str, objects: Mapping[str, str]) -> Iterator[str]:
    """Yield a sentence for each object, about the designs that share it."""
    for what in dict.fromkeys(objects.values()):
        names = [name for name in objects if objects[name] == what]
        yield f"{', '.join(names)} {verb}{'s' if len(names) == 1 else ''} {what}."


def _by_design(tables: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    named = [table.assign(design=name) for name, table in tables.items()]
    joined = pd.concat([table for table in named if len(table)] or named[:1], ignore_index=True)
    return joined[["design", *joined.columns.drop("design")]]


#: What changes of points and cables: words, and the columns that differ.
_CHANGES: Mapping[str, Mapping[str, list[str]]] = {
    "point": {"changed": ["signal"], "moved": ["x_m", "y_m", "z_m"]},
    "cable": {
        "re-terminated": ["a", "b"],
        "of another type": ["cable"],
        "of another length": ["length_m"],
    },
}


def _difference(old: Comparison, new: Comparison, name: str) -> dict[str, Any]:
    """Return the row of `Comparison.diff` for one design."""
    row, words = dict[str, Any](), []
    designs = old.designs[name], new.designs[name]
    tables = {
        "point": [one.iolist.points.set_index("tag") for one in designs],
        "cable": [one.cables.set_index("run") for one in designs],
    }
    for what, (before, after) in tables.items():
        added = after.index.difference(before.index, sort=False)
        changed = {"added": added, "removed": before.index.difference(after.index, sort=False)}
        both = before.index.intersection(after.index, sort=False)
        for kind, columns in _CHANGES[what].items():
            was, becomes = (one.loc[both, columns].round(9).fillna("") for one in (before, after))
            changed[kind] = both[(was != becomes).any(axis=1)]
        for kind, keys in changed.items():
            row[f"{what}s_{re.sub('[ -]', '_', kind)}"] = len(keys)
            if len(keys):
                plural = "s" if len(keys) > 1 else ""
                words.append(f"{len(keys)} {what}{plural} {kind} ({some(list(keys), 3)})")
    units = {"cable_length_km": "km of cable", "labour_h": "h", "total_cost_eur": "EUR"}
    for figure, unit in units.items():
        row[figure] = more = new.quantities[name][figure] - old.quantities[name][figure]
        words.append(f"{'+' if round(more, 6) > 0 else ''}{number(round(more, 6))} {unit}")
    rules = [{*one._checked[name].violated()["rule"]} for one in (old, new)]
    row["rules_violated"] = len(rules[1]) - len(rules[0])
    for verb, of_rules in (("violates", rules[1] - rules[0]), ("meets", rules[0] - rules[1])):
        words += [f"now {verb} {', '.join(sorted(of_rules))}"] if of_rules else []
    return row | {"words": ", ".join(words)}
