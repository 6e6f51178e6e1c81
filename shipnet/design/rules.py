"""Class rules as data, the values computed for them, and the check of a design."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import MISSING, asdict, dataclass, fields
from functools import cache, cached_property
from operator import ge, le, lt
from os import PathLike
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from shipnet import datasets
from shipnet.answers import Findings
from shipnet.arrays import Bools, Floats
from shipnet.crc import Crc
from shipnet.design.catalogue import cables
from shipnet.design.layout import Layout
from shipnet.design.supply import point_currents, supply_tables
from shipnet.engine.class_rules import STANDARDS as DATA_LINKS
from shipnet.errors import ArgumentError, InputError
from shipnet.fields import (
    Choice,
    Kind,
    Number,
    Switch,
    check_fields,
    check_scalar,
    choice,
    declared,
    number,
    record,
    switch,
    text,
)
from shipnet.lazy import pd
from shipnet.tables import NUMBER, Sheet, frame_sheet, in_order, read_sheet, titled

# Measures of a planned design that a rule may limit ---------------------------------------------

#: Open international standard or public specification of each bus that has one; its CRC, or None.
STANDARDS: Mapping[str, tuple[str, Crc | None]] = {**DATA_LINKS, "AS-i": ("IEC 62026-2", None)}

#: Longest update time of a fast point [ms]: the shortest time in class rules, 0.1 s in
#: DNV-OS-D202 Ch.2 Sec.3 Table A1.
FAST_MS = 100.0

#: The only measure that includes the points left out.
LEFT_OUT = "unconnected points"


class Outcome(NamedTuple):
    """A measure's value, the part concerned, an explanation, and whether the value is partial."""

    computed: float
    subject: str = ""
    why: str = ""
    partial: bool = False


#: Functions that return a mask of the points to which a rule applies, by name.
APPLIES: Mapping[str, Callable[[pd.DataFrame], pd.Series[bool]]] = {
    "all": lambda points: points["type"] != "",
    "inputs": lambda points: points["type"].isin(["DI", "AI"]),
    "outputs": lambda points: points["type"].isin(["DO", "AO"]),
    "fast": lambda points: points["update_ms"] <= FAST_MS,
    "fast outputs": lambda points: APPLIES["fast"](points) & APPLIES["outputs"](points),
    "essential": lambda points: points["category"] != "I",
    "category III": lambda points: points["category"] == "III",
}


@dataclass(frozen=True, eq=False)
class Facts:
    """A design with the tables that several measures need."""

    design: Layout
    #: One row per single failure.
    cuts: pd.DataFrame
    host_time: float

    @cached_property
    def fed(self) -> tuple[pd.DataFrame, pd.DataFrame]:
        """The supplies of the design, and the devices that they feed."""
        return supply_tables(self.design)

    @cached_property
    def links(self) -> pd.DataFrame:
        """The segments that are data links."""
        segments = self.design.segments
        return segments[segments["bus"].isin(["AS-i", "CAN", "Modbus RTU"])]

    @property
    def left_out(self) -> Bools:
        """Mask of the points that do not fit."""
        return ~self.design.points["fits"].to_numpy(bool)


#: Function that computes a measure for some points, with or without the host time.
_Compute: TypeAlias = Callable[[Facts, Bools, bool], Outcome]


class Measure(NamedTuple):
    """A value that can be computed for a design."""

    unit: str
    meaning: str
    compute: _Compute


_NAN = float("nan")

#: Current that corresponds to a load equivalence number (LEN) of 1 in NMEA 2000 [A].
LOAD_UNIT = 0.05


def _response(facts: Facts, concerned: Bools, host: bool) -> Outcome:
    points = facts.design.points[concerned]
    if points.empty:
        return Outcome(_NAN, why="the list has no such point")
    # A hardwired point responds at once.
    times = points["response_ms"].where(points["bus"] != "hardwired", 0.0) / 1e3
    known = times.dropna()
    missing = len(times) - len(known)
    if known.empty:
        return Outcome(_NAN, why=f"no response time is known (points: {missing})")
    added = facts.host_time if host else 0.0
    worst: Any = known.idxmax()
    parts = [f"{known[worst]:.3g} s to the host"]
    parts += [f"{added:g} s in the host, assumed"] if host else []
    parts += [f"{missing} points have no response time"] if missing else []
    where: Any = points.loc[worst, "segment"] or points.loc[worst, "tag"]
    return Outcome(float(known[worst] + added), str(where), "; ".join(parts), missing > 0)


def _late(facts: Facts, concerned: Bools, host: bool) -> Outcome:
    points = facts.design.points
    needs = facts.design.iolist.points["update_ms"]
    late = points["tag"][concerned & (points["response_ms"] > needs)]
    first = str(late.iloc[0]) if len(late) else ""
    return Outcome(len(late), first, "response longer than the list's update time")


def _unconnected(facts: Facts, concerned: Bools, host: bool) -> Outcome:
    out = facts.design.points["tag"][concerned & facts.left_out]
    if out.empty:
        return Outcome(0)
    return Outcome(len(out), str(out.iloc[0]), "see the plan's table of reasons")


def _lost(failures: tuple[str, ...], kinds: tuple[str, ...] | None, none: str) -> _Compute:
    def compute(facts: Facts, concerned: Bools, host: bool) -> Outcome:
        rows = facts.cuts[facts.cuts["failure"].isin(failures)]
        rows = rows[rows["kind"].isin(kinds)] if kinds else rows[rows["kind"] != "cabinet"]
        if rows.empty:
            return Outcome(_NAN, why=none)
        if not concerned.any():
            return Outcome(_NAN, why="the list has no such point")
        counts = rows["points_lost"]
        if not concerned.all():
            mine = set(facts.design.points["tag"].to_numpy()[concerned])
            counts = rows["tags"].map(lambda tags: len(mine.intersection(tags)))
        worst: Any = counts.idxmax()
        failed, why = str(rows.loc[worst, "failed"]), f"worst of {len(rows)} failures"
        return Outcome(int(counts[worst]), failed, why)

    return compute


def _systems(facts: Facts, concerned: Bools, host: bool) -> Outcome:
    cuts = facts.cuts
    if facts.links.empty:
        return Outcome(0, why="no data link")
    rows = cuts[
        cuts["failure"].isin(["cut", "short"])
        & cuts["kind"].isin(["trunk", "feeder"])
        & cuts["segment"].isin(facts.links["segment"])
    ]
    if rows.empty:
        return Outcome(_NAN, why="the links have no cable of their own")
    if not concerned.any():
        return Outcome(_NAN, why="the list has no such point")
    points = facts.design.iolist.points[concerned]
    system = dict(zip(points["tag"], points["system"], strict=True))
    found = rows["tags"].map(lambda tags: sorted({system[tag] for tag in tags if system.get(tag)}))
    unnamed = {tag for tags in rows["tags"] for tag in tags if system.get(tag) == ""}
    worst: Any = found.map(len).idxmax()
    parts = [f"a failure affects points of {', '.join(found[worst])}"] if found[worst] else []
    if unnamed:
        s = "s" if len(unnamed) > 1 else ""
        parts.append(f"the list names no system for {len(unnamed)} point{s} lost in a failure")
    why = "; ".join(parts) or "no failure affects a system"
    return Outcome(len(found[worst]), str(rows.loc[worst, "failed"]), why, bool(unnamed))


def _lines(facts: Facts, concerned: Bools, host: bool) -> Outcome:
    trunk = facts.design.cables[facts.design.cables["kind"] == "trunk"]
    trunk = trunk[trunk["segment"].isin(facts.links["segment"])]
    if trunk.empty:
        return Outcome(_NAN, why="no data link")
    lines = trunk.groupby("segment", sort=False)["line"].nunique()
    return Outcome(int(lines.min()), str(lines.idxmin()), "the fewest of any segment")


def _switch_over(facts: Facts, concerned: Bools, host: bool) -> Outcome:
    own = set(facts.design.points.loc[concerned, "segment"])
    links = facts.links[facts.links["segment"].isin(own)]
    if links.empty:
        return Outcome(_NAN, why="no data link has such a point")
    trunk = facts.design.cables[facts.design.cables["line"] != ""]
    single = links.loc[~links["segment"].isin(trunk["segment"]), "segment"]
    if len(single):
        return Outcome(float("inf"), str(single.iloc[0]), "has no second line to switch to")
    gaps = links.set_index("segment").get("switch_over_ms")
    if gaps is None or gaps.isna().any():
        return Outcome(_NAN, why="the plan does not show how a second line takes over")
    return Outcome(gaps.max() / 1e3, str(gaps.idxmax()), "longest silence when a line breaks")


def _change_over(facts: Facts, concerned: Bools, host: bool) -> Outcome:
    lost = _LOST_BY_A_SUPPLY(facts, concerned, host)
    if lost.computed != lost.computed:
        return lost
    if lost.computed:
        return Outcome(float("inf"), lost.subject, "has no second supply in parallel")
    return Outcome(0.0, "", "two supplies feed in parallel, so neither has to take over")


def _buses(facts: Facts) -> list[str]:
    return sorted(set(facts.links["bus"]))


def _standard(facts: Facts, concerned: Bools, host: bool) -> Outcome:
    without = [bus for bus in _buses(facts) if bus not in STANDARDS]
    known = [f"{bus}: {STANDARDS[bus][0]}" for bus in _buses(facts) if bus in STANDARDS]
    return Outcome(len(without), ", ".join(without), "; ".join(known) or "no data link")


def _unseen(facts: Facts, concerned: Bools, host: bool) -> Outcome:
    if facts.links.empty:
        return Outcome(_NAN, why="no data link")
    checks = {bus: STANDARDS[bus][1] for bus in _buses(facts)}
    without = [bus for bus, check in checks.items() if check is None]
    if without:
        return Outcome(float("inf"), ", ".join(without), "has no CRC")
    used = [check for check in checks.values() if check]
    missed = sum(check.undetected(flips=n) for check in used for n in (1, 2))
    return Outcome(missed, "", ", ".join(check.name for check in used))


def _repeats(facts: Facts, concerned: Bools, host: bool) -> Outcome:
    if facts.links.empty:
        return Outcome(_NAN, why="no data link")
    asked = [bus for bus in _buses(facts) if bus != "CAN"]
    if asked:
        return Outcome(_NAN, why=f"a plan does not show how often the {asked[0]} master retries")
    return Outcome(float("inf"), "", "CAN controllers retransmit frames automatically")


def _most(values: pd.Series[float], subjects: pd.Series[str], none: str) -> Outcome:
    """Return the largest value and its subject."""
    if not values.notna().any():
        return Outcome(_NAN, why=none)
    worst: Any = values.idxmax()
    why = f"the largest of {int(values.notna().sum())}"
    return Outcome(float(values[worst]), str(subjects[worst]), why)


def _fed(value: Callable[[pd.DataFrame], pd.Series[float]]) -> _Compute:
    """Return a function that finds the largest `value` of all devices fed by supplies."""

    def compute(facts: Facts, concerned: Bools, host: bool) -> Outcome:
        supplies, devices = facts.fed
        known = cables()
        cable = facts.design.cables.set_index("run")["cable"]
        table = devices.assign(
            source_v=devices["supply"].map(supplies.set_index("supply")["voltage_v"]),
            most_a=devices["run"].map(cable.map(lambda name: known[name].current)),
        )
        return _most(value(table), table["device"], "no supply feeds any device")

    return compute


def _supply_load(facts: Facts, concerned: Bools, host: bool) -> Outcome:
    table = facts.fed[0]
    share = 100 * table["current_a"] / table["rating_a"]
    return _most(share, table["supply"], "no supply is planned")


def _supply_voltage(facts: Facts, concerned: Bools, host: bool) -> Outcome:
    table = facts.fed[0]
    table = table[~table["segment"].isin(facts.links.query("bus == 'AS-i'")["segment"])
                  | (table["kind"] != "supply")]  # fmt: skip
    return _most(100 * (table["voltage_v"] / 24 - 1), table["supply"], "no supply has 24 V")


def _spur_current(facts: Facts, concerned: Bools, host: bool) -> Outcome:
    points = facts.design.points
    on = points["segment"].isin(facts.links["segment"]) & concerned
    return _most(point_currents(facts.design)[on], points["tag"], "no data link has such a point")


def _runs(kind: str, total: bool, ohms: bool = False) -> _Compute:
    """Return a function that finds the largest length or resistance of a run or a whole line."""

    def compute(facts: Facts, concerned: Bools, host: bool) -> Outcome:
        runs, known = facts.design.cables, cables()
        runs = runs[(runs["kind"] == kind) & runs["segment"].isin(facts.links["segment"])]
        each = runs["cable"].map(lambda name: known[name].resistance if ohms else 1.0)
        value = runs["length_m"] * each
        if not total:
            return _most(value, runs["run"], "no data link has such a cable")
        added = value.groupby([runs["segment"], runs["line"]]).sum(min_count=1)
        names = added.index.to_series().map(" ".join).str.strip()
        return _most(added, names, "no data link has such a cable")

    return compute


def _resistance_by_length(facts: Facts, concerned: Bools, host: bool) -> Outcome:
    runs, known = facts.design.cables, cables()
    can = facts.links.loc[facts.links["bus"] == "CAN", "segment"]
    runs = runs[(runs["kind"] == "trunk") & runs["segment"].isin(can)]
    loop = runs["cable"].map(lambda name: known[name].resistance)
    trunks = runs.assign(ohms=loop / 2).groupby(["segment", "line"])
    length, ohms = trunks["length_m"].sum(), trunks["ohms"].max()
    table = datasets.read("can_bus_resistances.csv")
    lengths, listed = table[["length_m", "resistance_ohm_per_km"]].to_numpy(float).T
    # The table has no value for a trunk longer than its last length.
    listed = np.append(listed, _NAN) / 1e3
    share = 100 * (ohms / listed[np.searchsorted(lengths, length - 1e-9)])
    names = share.index.to_series().map(" ".join).str.strip()
    found = _most(share, names, "no CAN trunk whose resistance and length are listed")
    return found._replace(partial=bool(share.isna().any()))


def _nodes(facts: Facts, concerned: Bools, host: bool) -> Outcome:
    links = facts.links
    return _most(links["devices"].astype(float), links["segment"], "no data link")


def _units(facts: Facts, concerned: Bools, host: bool) -> Outcome:
    devices = facts.fed[1]
    # An excess over a whole unit is ignored if it is only a rounding error.
    units = np.ceil(devices["load_a"] / LOAD_UNIT - 1e-9).groupby(devices["supply"]).sum()
    return _most(units, units.index.to_series(), "no supply feeds any device")


def _terminators(facts: Facts, concerned: Bools, host: bool) -> Outcome:
    devices, runs = facts.design.devices, facts.design.cables
    links = facts.links.loc[facts.links["bus"] != "AS-i", "segment"]
    if links.empty:
        return Outcome(_NAN, why="no data link needs terminators")
    trunk = runs[(runs["kind"] == "trunk") & runs["segment"].isin(links)]
    lines = trunk.groupby("segment")["line"].nunique().reindex(links, fill_value=1)
    own = devices.loc[devices["kind"] == "terminator", "segment"].value_counts()
    wrong = (own.reindex(links, fill_value=0) - 2 * lines).abs()
    subject = str(wrong.idxmax()) if wrong.any() else ""
    return Outcome(int(wrong.sum()), subject, "each trunk needs one at each end")


_PARTS = ("module", "station", "box")
_LOST_BY_A_SUPPLY = _lost(("device",), ("supply", "auxiliary supply"), "no supply is planned")

#: The measures, by their names in rules.
MEASURES: Mapping[str, Measure] = {
    "response": Measure("s", "longest response, plus host time if the rule includes it", _response),
    "late points": Measure("points", "points slower than the list requires", _late),
    LEFT_OUT: Measure("points", "points that do not fit", _unconnected),
    "points lost by a cable": Measure(
        "points", "lost by the worst cut or short", _lost(("cut", "short"), None, "no cable")
    ),
    "points lost by a station": Measure(
        "points", "lost by the worst station, module or box",
        _lost(("device",), _PARTS, "no station, module or box"),
    ),
    "points lost by a supply": Measure("points", "lost by the worst supply", _LOST_BY_A_SUPPLY),
    "supply change-over": Measure("s", "time until another supply takes over", _change_over),
    "switch-over": Measure(
        "s", "longest silence of a point until its second line takes over", _switch_over
    ),
    "points lost by a device": Measure(
        "points", "lost by the worst device except the cabinet",
        _lost(("device",), None, "no device except the cabinet"),
    ),
    "systems on one link": Measure(
        "systems", "systems affected by the worst failure of a link", _systems
    ),
    "lines of a link": Measure("lines", "smallest number of lines of a link", _lines),
    "links without a standard": Measure("links", "buses without an open standard", _standard),
    "bit errors unseen": Measure(
        "patterns", "patterns of one or two wrong bits that a CRC misses", _unseen
    ),
    "voltage below nominal": Measure(
        "%", "largest voltage drop to a device's worst point, in % of the supply voltage",
        _fed(lambda t: 100 * (1 - t["lowest_v"] / t["source_v"])),
    ),
    "voltage with a short": Measure(
        "%", "as 'voltage below nominal', but with one point's cable shorted",
        _fed(lambda t: 100 * (1 - t["shorted_v"] / t["source_v"])),
    ),
    "voltage drop": Measure(
        "V", "largest voltage drop to a device",
        _fed(lambda t: t["source_v"] - t["voltage_v"]),
    ),
    "voltage above nominal": Measure(
        "%", "largest excess over 24 V of any supply for stations or outputs", _supply_voltage
    ),
    "supply load": Measure(
        "%", "largest current of a supply, as a percentage of its rating", _supply_load
    ),
    "cable load": Measure(
        "%", "largest current of a feeder, as a percentage of its cable's limit",
        _fed(lambda t: 100 * t["current_a"] / t["most_a"]),
    ),
    "spur current": Measure("A", "largest current of a point on a link", _spur_current),
    "spur length": Measure("m", "longest cable of a point on a link", _runs("drop", total=False)),
    "spurs in all": Measure(
        "m", "largest total length of the points' cables on a segment", _runs("drop", total=True)
    ),
    "trunk length": Measure("m", "longest trunk of a segment", _runs("trunk", total=True)),
    "trunk resistance": Measure(
        "ohm", "largest loop resistance of a trunk", _runs("trunk", total=True, ohms=True)
    ),
    "trunk resistance by length": Measure(
        "%", "largest conductor resistance per km of a CAN trunk, in % of the value for its length",
        _resistance_by_length,
    ),
    "devices of a segment": Measure("devices", "most on a segment, including the master", _nodes),
    "load units": Measure("units", "units of 50 mA that one supply feeds", _units),
    "load units of a device": Measure(
        "units", "units of 50 mA that one device draws",
        _fed(lambda t: np.ceil(t["load_a"] / LOAD_UNIT - 1e-9)),
    ),
    "terminators": Measure(
        "terminators", "terminators missing or in excess of two per trunk", _terminators
    ),
    "repeats": Measure("repeats", "how often a lost message is repeated", _repeats),
}  # fmt: skip


# Class rules as data ----------------------------------------------------------------------------

#: Rule sets of `data/design_rules.csv`; a society's rules apply together with those of the IMO.
RULE_SETS = ("DNV", "BV", "IMO", "lee2012", "supply", "NMEA 2000")
_WITH_IMO = ("DNV", "BV")

#: The comparison of a computed value with its limit, by its name in rules.
BOUNDS = {"at most": le, "below": lt, "at least": ge}

_YES = {"yes": True, "true": True, "1": True, "no": False, "false": False, "0": False, "": False}


@record(slots=True)
class Rule:
    """One class rule: the measure computed for it, and its limit.

    Raises
    ------
    ArgumentError
        If a value is not legal, or a rule with a measure has no limit.

    Examples
    --------
    >>> rule = Rule("one cable", "points lost by a cable", 10, confirmed="yes")
    >>> rule.meets(8), rule.unit
    (True, 'points')
    """

    rule: str = text("Name of the rule")
    measure: str = choice(
        ("", *MEASURES), "A name in `RuleSet.measures`, or empty if no plan can show compliance"
    )
    limit: float = number(0, 1e12, help="The limit, in the unit of the measure", missing=True)
    topic: str = text("Topic of the rule", default="own")
    asks: str = text("The requirement in words", default="", most=1000)
    applies: str = choice(tuple(APPLIES), "The points concerned", default="all")
    bound: str = choice(tuple(BOUNDS), "How a value compares with the limit", default="at most")
    unit: str = text("Unit of the limit: empty, or the unit of the measure", default="")
    host: bool = switch("Whether the time in the host is included", default=False)
    clause: str = text("Clause of the document", default="")
    edition: str = text("Edition of the document", default="")
    source: str = text("The document", default="", most=1000)
    confirmed: str = choice(
        ("no", "maker", "yes"), "yes: the rule's text was read; maker: only a manufacturer's "
        "document; no: neither was read, so the rule counts as not verified", default="no",
    )  # fmt: skip
    note: str = text("Why no plan can show compliance", default="", most=1000)
    rule_set: str = text("Rule set of the rule", default="own")

    def __post_init__(self) -> None:
        check_fields(self)
        if not self.rule:
            raise ArgumentError("rule is ''; it must be a name")
        if self.measure:
            unit = MEASURES[self.measure].unit
            if self.unit not in ("", unit):
                raise ArgumentError(f"unit is {self.unit!r}; it must be {unit!r} for this measure")
            if math.isnan(self.limit):
                raise ArgumentError("limit is nan; it must be a number, 0 or more")
            object.__setattr__(self, "unit", unit)

    def meets(self, computed: float) -> bool:
        """Return whether a computed value meets the limit; NaN never does."""
        return bool(BOUNDS[self.bound](computed, self.limit))


@dataclass(frozen=True)
class RuleSet:
    """A set of class rules: a published one, or your own from a file.

    Parameters
    ----------
    rules : tuple of Rule
        One or more rules.

    Raises
    ------
    ArgumentError
        If there is no rule.

    Examples
    --------
    >>> dnv = RuleSet.published("DNV")
    >>> len(dnv), float(dnv.table().loc["indication", "limit"])
    (15, 1.0)
    >>> RuleSet.measures().loc["response", "unit"]
    's'
    """

    rules: tuple[Rule, ...]

    def __post_init__(self) -> None:
        object.__setattr__(self, "rules", tuple(self.rules))
        if not self.rules:
            raise ArgumentError("rules is empty; there must be at least one Rule")

    @classmethod
    def published(cls, rules: str = "DNV") -> RuleSet:
        """Return a published rule set by its name; DNV and BV include the rules of the IMO."""
        if rules not in RULE_SETS:
            raise ArgumentError(
                f"rules is {rules!r}; it must be one of {', '.join(RULE_SETS)}, or a file"
            )
        wanted = (rules, "IMO") if rules in _WITH_IMO else (rules,)
        return cls(tuple(rule for rule in _all() if rule.rule_set in wanted))

    @classmethod
    def read(cls, path: str | PathLike[str]) -> RuleSet:
        """Read your own rules from a CSV file or an Excel workbook."""
        what = "titles (at least rule, measure and limit)"
        return cls(_rules(read_sheet(path, what=what)))

    @classmethod
    def of(cls, rules: RuleSet | str | PathLike[str]) -> RuleSet:
        """Return `rules` if it is a rule set, or the set that it names: published, or in a file."""
        if isinstance(rules, RuleSet):
            return rules
        if isinstance(rules, PathLike) or str(rules).lower().endswith((".csv", ".xlsx")):
            return cls.read(rules)
        return cls.published(rules)

    def __len__(self) -> int:
        return len(self.rules)

    def __iter__(self) -> Iterator[Rule]:
        return iter(self.rules)

    def __repr__(self) -> str:
        sets = ", ".join(dict.fromkeys(rule.rule_set for rule in self.rules))
        return f"<RuleSet: {len(self)} rules of {sets}>"

    def table(self) -> pd.DataFrame:
        """Return a table with one row per rule, indexed by name."""
        return pd.DataFrame([asdict(rule) for rule in self.rules]).set_index("rule")

    @staticmethod
    def measures() -> pd.DataFrame:
        """Return a table of the measures that rules may name, with unit and meaning."""
        rows = {name: measure[:2] for name, measure in MEASURES.items()}
        table = pd.DataFrame.from_dict(rows, orient="index", columns=["unit", "meaning"])
        return table.rename_axis("measure")


@cache
def _all() -> tuple[Rule, ...]:
    name = "design_rules.csv"
    return _rules(frame_sheet(datasets.read(name), name))


def _rules(sheet: Sheet) -> tuple[Rule, ...]:
    kinds = declared(Rule)
    needed = {one.name for one in fields(Rule) if one.default is MISSING}
    rows, faults = titled(sheet, {name: None if name in needed else "" for name in kinds})
    rules: list[Rule] = []
    for row, cells in rows:
        values: dict[str, Any] = {}
        wrong = len(faults)
        for name, kind in kinds.items():
            if cells[name] or name in needed:
                try:
                    values[name] = kind.check(name, _value(kind, cells[name]), None)
                except ArgumentError as fault:
                    faults.append((row, f": {fault}"))
        if len(faults) == wrong:
            try:
                rules.append(Rule(**values))
            except ArgumentError as fault:
                faults.append((row, f": {fault}"))
    said = in_order(faults)
    names = Counter((rule.rule_set, rule.rule) for rule in rules)
    said += [f"rule {name!r} is listed twice" for (_, name), count in names.items() if count > 1]
    if said or not rules:
        raise InputError(sheet.source, *(said or ["has no rule; expected one row per rule"]))
    return tuple(rules)


def _value(kind: Kind, cell: str) -> object:
    """Return the value of a cell, or the cell itself if it is not legal."""
    if isinstance(kind, Switch):
        return _YES.get(cell.lower(), cell)
    if isinstance(kind, Choice):
        return next((option for option in kind.options if option.lower() == cell.lower()), cell)
    if isinstance(kind, Number):
        plain = cell.replace(",", ".") or "nan"
        return float(plain) if NUMBER.fullmatch(plain) or not cell else cell
    return cell


def longest_responses(rules: Iterable[Rule], points: pd.DataFrame, host_time: float) -> Floats:
    """Return the longest response that rules allow for each point [s]; inf without a limit.

    A limit that the host alone exceeds is ignored, because no plan can meet it.
    """
    longest = np.full(len(points), np.inf)
    for rule in rules:
        if rule.measure == "response" and rule.bound != "at least":
            # Reduced slightly, so that a rounding error cannot decide the verdict.
            limit = (rule.limit - rule.host * host_time) * (1 - 1e-9)
            if limit > 0:
                mine = APPLIES[rule.applies](points).to_numpy(bool)
                longest[mine] = np.minimum(longest[mine], limit)
    return longest


# The check: each rule with the value computed for it, and its verdict ----------------------------


def check(
    design: Layout,
    failures: pd.DataFrame,
    rules: RuleSet | str | PathLike[str] = "DNV",
    *,
    host_time: float | None = None,
) -> Findings:
    """Check a design and its single failures against class rules."""
    host = design.settings.host_time if host_time is None else host_time
    facts = Facts(design, failures, check_scalar("host_time", host, "s", 0.0, 60.0))
    rows = []
    for rule in RuleSet.of(rules):
        outcome = _outcome(rule, facts)
        verdict, why = _judge(rule, outcome)
        limits = {"low" if rule.bound == "at least" else "high": rule.limit}
        rows.append({**asdict(rule), "object": outcome.subject, "value": float(outcome.computed),
                     **limits, "verdict": verdict, "why": why})  # fmt: skip
    return Findings(pd.DataFrame(rows, columns=_FINDINGS))


_FINDINGS = [
    "rule", "object", "value", "low", "high", "unit", "verdict", "why", "source", "limit", "bound",
    "clause", "edition", "confirmed", "topic", "asks", "rule_set",
]  # fmt: skip


def _outcome(rule: Rule, facts: Facts) -> Outcome:
    if not rule.measure:
        return Outcome(_NAN, why=rule.note or "a plan cannot show it")
    concerned = APPLIES[rule.applies](facts.design.iolist.points).to_numpy(bool)
    outcome = MEASURES[rule.measure].compute(facts, concerned, rule.host)
    out = int((concerned & facts.left_out).sum())
    if not out or outcome.partial or rule.measure == LEFT_OUT:
        return outcome
    # The value may omit points that are left out: one without a bus is neither late nor lost.
    said = f"{out} point{'s' if out > 1 else ''} left out"
    why = f"{outcome.why}; {said}" if outcome.why else said
    return outcome._replace(why=why, partial=True)


def _judge(rule: Rule, outcome: Outcome) -> tuple[str, str]:
    """Return the verdict and its reason."""
    if outcome.computed != outcome.computed:
        return "not verified", outcome.why
    verdict = "met" if rule.meets(outcome.computed) else "violated"
    if verdict == "met" and outcome.partial:
        return "not verified", outcome.why
    if rule.confirmed == "no":
        made = f" ({outcome.why})" if outcome.why else ""
        return "not verified", f"would be {verdict}{made}, but the clause was not read"
    maker = "the limit is from a manufacturer's document; no standard was read for it"
    said = [outcome.why, maker if rule.confirmed == "maker" else ""]
    return verdict, "; ".join(filter(None, said))
