"""The values that class rules limit, each computed for a planned design."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from math import inf, isnan, nan
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from shipnet import datasets
from shipnet.arrays import Bools
from shipnet.crc import Crc
from shipnet.design.catalogue import cables
from shipnet.design.layout import Layout
from shipnet.design.supply import point_currents, supply_tables
from shipnet.engine.class_rules import STANDARDS as DATA_LINKS
from shipnet.lazy import pd

#: Open international standard or public specification of each bus that has one; its CRC, or None.
STANDARDS: Mapping[str, tuple[str, Crc | None]] = {**DATA_LINKS, "AS-i": ("IEC 62026-2", None)}

#: The only measure that includes the points left out.
LEFT_OUT = "unconnected points"

#: Current that corresponds to a load equivalence number (LEN) of 1 in NMEA 2000 [A].
LOAD_UNIT = 0.05


class Outcome(NamedTuple):
    """A measure's value, the part concerned, an explanation, and whether the value is partial."""

    computed: float
    subject: str = ""
    why: str = ""
    partial: bool = False


_NO_LINK = Outcome(nan, why="no data link")
_NO_POINT = Outcome(nan, why="the list has no such point")


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

    @cached_property
    def cables(self) -> pd.DataFrame:
        """The cables of the data links, with their loop resistance [ohm/m]."""
        runs, types = self.design.cables, cables()
        runs = runs[runs["segment"].isin(self.links["segment"])]
        return runs.assign(ohms=[types[name].resistance for name in runs["cable"]])

    @property
    def buses(self) -> list[str]:
        """The buses of the data links."""
        return sorted(set(self.links["bus"]))

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


#: The measures, by their names in rules.
MEASURES: dict[str, Measure] = {}


def _measure(name: str, unit: str, meaning: str) -> Callable[[_Compute], _Compute]:
    def register(compute: _Compute) -> _Compute:
        MEASURES[name] = Measure(unit, meaning, compute)
        return compute

    return register


def _largest(values: pd.Series[float], subjects: pd.Series[str], none: str) -> Outcome:
    """Return the largest value and its subject."""
    if not values.notna().any():
        return Outcome(nan, why=none)
    worst: Any = values.idxmax()
    why = f"the largest of {int(values.notna().sum())}"
    return Outcome(float(values[worst]), str(subjects[worst]), why)


# Response times ---------------------------------------------------------------------------------


@_measure("response", "s", "longest response, plus host time if the rule includes it")
def _response(facts: Facts, concerned: Bools, host: bool) -> Outcome:
    points = facts.design.points[concerned]
    if points.empty:
        return _NO_POINT
    # A hardwired point responds at once.
    times = points["response_ms"].where(points["bus"] != "hardwired", 0.0) / 1e3
    available = times.dropna()
    missing = len(times) - len(available)
    if available.empty:
        return Outcome(nan, why=f"no response time is known (points: {missing})")
    added = facts.host_time if host else 0.0
    worst: Any = available.idxmax()
    parts = [f"{available[worst]:.3g} s to the host"]
    parts += [f"{added:g} s in the host, assumed"] if host else []
    parts += [f"{missing} points have no response time"] if missing else []
    where: Any = points.loc[worst, "segment"] or points.loc[worst, "tag"]
    return Outcome(float(available[worst] + added), str(where), "; ".join(parts), missing > 0)


@_measure("late points", "points", "points slower than the list requires")
def _late(facts: Facts, concerned: Bools, host: bool) -> Outcome:
    points = facts.design.points
    needs = facts.design.iolist.points["update_ms"]
    late = points["tag"][concerned & (points["response_ms"] > needs)]
    first = str(late.iloc[0]) if len(late) else ""
    return Outcome(len(late), first, "response longer than the list's update time")


@_measure(LEFT_OUT, "points", "points that do not fit")
def _unconnected(facts: Facts, concerned: Bools, host: bool) -> Outcome:
    out = facts.design.points["tag"][concerned & facts.left_out]
    if out.empty:
        return Outcome(0)
    return Outcome(len(out), str(out.iloc[0]), "see the plan's table of reasons")


# Failures ---------------------------------------------------------------------------------------


def _lost(failures: tuple[str, ...], kinds: tuple[str, ...], none: str) -> _Compute:
    """Return a function that counts the points lost by the worst failure of devices of `kinds`."""

    def compute(facts: Facts, concerned: Bools, host: bool) -> Outcome:
        rows = facts.cuts[facts.cuts["failure"].isin(failures)]
        rows = rows[rows["kind"].isin(kinds)] if kinds else rows[rows["kind"] != "cabinet"]
        if rows.empty:
            return Outcome(nan, why=none)
        if not concerned.any():
            return _NO_POINT
        counts = rows["points_lost"]
        if not concerned.all():
            tags = set(facts.design.points["tag"].to_numpy()[concerned])
            counts = rows["tags"].map(lambda lost: len(tags.intersection(lost)))
        worst: Any = counts.idxmax()
        failed, why = str(rows.loc[worst, "failed"]), f"worst of {len(rows)} failures"
        return Outcome(int(counts[worst]), failed, why)

    return compute


_by_supply = _lost(("device",), ("supply", "auxiliary supply"), "no supply is planned")
_BY_PART = _lost(("device",), ("module", "station", "box"), "no station, module or box")
_BY_DEVICE = _lost(("device",), (), "no device except the cabinet")
MEASURES |= {
    "points lost by a cable": Measure(
        "points", "lost by the worst cut or short", _lost(("cut", "short"), (), "no cable")
    ),
    "points lost by a station": Measure(
        "points", "lost by the worst station, module or box", _BY_PART
    ),
    "points lost by a supply": Measure("points", "lost by the worst supply", _by_supply),
}


@_measure("supply change-over", "s", "time until another supply takes over")
def _change_over(facts: Facts, concerned: Bools, host: bool) -> Outcome:
    lost = _by_supply(facts, concerned, host)
    if isnan(lost.computed):
        return lost
    if lost.computed:
        return Outcome(inf, lost.subject, "has no second supply in parallel")
    return Outcome(0.0, "", "two supplies feed in parallel, so neither has to take over")


@_measure("switch-over", "s", "longest silence of a point until its second line takes over")
def _switch_over(facts: Facts, concerned: Bools, host: bool) -> Outcome:
    segments = set(facts.design.points.loc[concerned, "segment"])
    links = facts.links[facts.links["segment"].isin(segments)]
    if links.empty:
        return Outcome(nan, why="no data link has such a point")
    lined = facts.cables.loc[facts.cables["line"] != "", "segment"]
    single = links.loc[~links["segment"].isin(lined), "segment"]
    if len(single):
        return Outcome(inf, str(single.iloc[0]), "has no second line to switch to")
    gaps = links.set_index("segment").get("switch_over_ms")
    if gaps is None or gaps.isna().any():
        return Outcome(nan, why="the plan does not show how a second line takes over")
    return Outcome(gaps.max() / 1e3, str(gaps.idxmax()), "longest silence when a line breaks")


MEASURES["points lost by a device"] = Measure(
    "points", "lost by the worst device except the cabinet", _BY_DEVICE
)


@_measure("systems on one link", "systems", "systems affected by the worst failure of a link")
def _systems(facts: Facts, concerned: Bools, host: bool) -> Outcome:
    if facts.links.empty:
        return Outcome(0, why="no data link")
    rows = facts.cuts[facts.cuts["failure"].isin(["cut", "short"])]
    rows = rows[rows["kind"].isin(["trunk", "feeder"])]
    rows = rows[rows["segment"].isin(facts.links["segment"])]
    if rows.empty:
        return Outcome(nan, why="the links have no cable of their own")
    if not concerned.any():
        return _NO_POINT
    points = facts.design.iolist.points[concerned]
    system = dict(zip(points["tag"], points["system"], strict=True))
    hit = rows["tags"].map(lambda tags: sorted({system[tag] for tag in tags if system.get(tag)}))
    unnamed = {tag for tags in rows["tags"] for tag in tags if system.get(tag) == ""}
    worst: Any = hit.map(len).idxmax()
    parts = [f"a failure affects points of {', '.join(hit[worst])}"] if hit[worst] else []
    if unnamed:
        s = "s" if len(unnamed) > 1 else ""
        parts.append(f"the list names no system for {len(unnamed)} point{s} lost in a failure")
    why = "; ".join(parts) or "no failure affects a system"
    return Outcome(len(hit[worst]), str(rows.loc[worst, "failed"]), why, bool(unnamed))


@_measure("lines of a link", "lines", "smallest number of lines of a link")
def _lines(facts: Facts, concerned: Bools, host: bool) -> Outcome:
    trunk = facts.cables[facts.cables["kind"] == "trunk"]
    if trunk.empty:
        return _NO_LINK
    lines = trunk.groupby("segment", sort=False)["line"].nunique()
    return Outcome(int(lines.min()), str(lines.idxmin()), "the fewest of any segment")


# Properties of the buses ------------------------------------------------------------------------


@_measure("links without a standard", "links", "buses without an open standard")
def _standard(facts: Facts, concerned: Bools, host: bool) -> Outcome:
    without = [bus for bus in facts.buses if bus not in STANDARDS]
    standards = [f"{bus}: {STANDARDS[bus][0]}" for bus in facts.buses if bus in STANDARDS]
    return Outcome(len(without), ", ".join(without), "; ".join(standards) or "no data link")


@_measure("bit errors unseen", "patterns", "patterns of one or two wrong bits that a CRC misses")
def _unseen(facts: Facts, concerned: Bools, host: bool) -> Outcome:
    if facts.links.empty:
        return _NO_LINK
    checks = {bus: STANDARDS[bus][1] for bus in facts.buses}
    if without := [bus for bus, check in checks.items() if check is None]:
        return Outcome(inf, ", ".join(without), "has no CRC")
    used = [check for check in checks.values() if check]
    missed = sum(check.undetected(flips=n) for check in used for n in (1, 2))
    return Outcome(missed, "", ", ".join(check.name for check in used))


@_measure("repeats", "repeats", "how often a lost message is repeated")
def _repeats(facts: Facts, concerned: Bools, host: bool) -> Outcome:
    if facts.links.empty:
        return _NO_LINK
    if polled := [bus for bus in facts.buses if bus != "CAN"]:
        return Outcome(nan, why=f"a plan does not show how often the {polled[0]} master retries")
    return Outcome(inf, "", "CAN controllers retransmit frames automatically")


# Supplies: voltages and currents ----------------------------------------------------------------


def _fed(value: Callable[[pd.DataFrame], pd.Series[float]]) -> _Compute:
    """Return a function that finds the largest `value` of all devices fed by supplies."""

    def compute(facts: Facts, concerned: Bools, host: bool) -> Outcome:
        supplies, devices = facts.fed
        types = cables()
        cable = facts.design.cables.set_index("run")["cable"]
        table = devices.assign(
            source_v=devices["supply"].map(supplies.set_index("supply")["voltage_v"]),
            most_a=devices["run"].map(cable.map(lambda name: types[name].current)),
        )
        return _largest(value(table), table["device"], "no supply feeds any device")

    return compute


for _name, _unit, _meaning, _value in (
    (
        "voltage below nominal",
        "%",
        "largest voltage drop to a device's worst point, in % of the supply voltage",
        lambda t: 100 * (1 - t["lowest_v"] / t["source_v"]),
    ),
    (
        "voltage with a short",
        "%",
        "as 'voltage below nominal', but with one point's cable shorted",
        lambda t: 100 * (1 - t["shorted_v"] / t["source_v"]),
    ),
    (
        "voltage drop",
        "V",
        "largest voltage drop to a device",
        lambda t: t["source_v"] - t["voltage_v"],
    ),
    (
        "cable load",
        "%",
        "largest current of a feeder, as a percentage of its cable's limit",
        lambda t: 100 * t["current_a"] / t["most_a"],
    ),
    (
        "load units of a device",
        "units",
        "units of 50 mA that one device draws",
        lambda t: np.ceil(t["load_a"] / LOAD_UNIT - 1e-9),
    ),
):
    MEASURES[_name] = Measure(_unit, _meaning, _fed(_value))


@_measure("supply load", "%", "largest current of a supply, as a percentage of its rating")
def _supply_load(facts: Facts, concerned: Bools, host: bool) -> Outcome:
    table = facts.fed[0]
    share = 100 * table["current_a"] / table["rating_a"]
    return _largest(share, table["supply"], "no supply is planned")


@_measure(
    "voltage above nominal", "%", "largest excess over 24 V of any supply for stations or outputs"
)
def _supply_voltage(facts: Facts, concerned: Bools, host: bool) -> Outcome:
    table = facts.fed[0]
    on_asi = table["segment"].isin(facts.links.query("bus == 'AS-i'")["segment"])
    table = table[~on_asi | (table["kind"] != "supply")]
    return _largest(100 * (table["voltage_v"] / 24 - 1), table["supply"], "no supply has 24 V")


@_measure("load units", "units", "units of 50 mA that one supply feeds")
def _units(facts: Facts, concerned: Bools, host: bool) -> Outcome:
    devices = facts.fed[1]
    # An excess over a whole unit is ignored if it is only a rounding error.
    units = np.ceil(devices["load_a"] / LOAD_UNIT - 1e-9).groupby(devices["supply"]).sum()
    return _largest(units, units.index.to_series(), "no supply feeds any device")


# Cables and devices of the links ----------------------------------------------------------------


@_measure("spur current", "A", "largest current of a point on a link")
def _spur_current(facts: Facts, concerned: Bools, host: bool) -> Outcome:
    points = facts.design.points
    on = points["segment"].isin(facts.links["segment"]) & concerned
    amps = point_currents(facts.design)[on]
    return _largest(amps, points["tag"], "no data link has such a point")


def _runs(kind: str, *, total: bool, ohms: bool = False) -> _Compute:
    """Return a function that finds the largest length or resistance of a run or a whole line."""

    def compute(facts: Facts, concerned: Bools, host: bool) -> Outcome:
        runs = facts.cables[facts.cables["kind"] == kind]
        value = runs["length_m"] * (runs["ohms"] if ohms else 1.0)
        if not total:
            return _largest(value, runs["run"], "no data link has such a cable")
        added = value.groupby([runs["segment"], runs["line"]]).sum(min_count=1)
        names = added.index.to_series().map(" ".join).str.strip()
        return _largest(added, names, "no data link has such a cable")

    return compute


_SPURS = "largest total length of the points' cables on a segment"
_OHMS = "largest loop resistance of a trunk"
MEASURES |= {
    "spur length": Measure("m", "longest cable of a point on a link", _runs("drop", total=False)),
    "spurs in all": Measure("m", _SPURS, _runs("drop", total=True)),
    "trunk length": Measure("m", "longest trunk of a segment", _runs("trunk", total=True)),
    "trunk resistance": Measure("ohm", _OHMS, _runs("trunk", total=True, ohms=True)),
}


@_measure(
    "trunk resistance by length",
    "%",
    "largest conductor resistance per km of a CAN trunk, in % of the value for its length",
)
def _resistance_by_length(facts: Facts, concerned: Bools, host: bool) -> Outcome:
    can = facts.links.loc[facts.links["bus"] == "CAN", "segment"]
    runs = facts.cables[(facts.cables["kind"] == "trunk") & facts.cables["segment"].isin(can)]
    trunks = runs.groupby(["segment", "line"])
    length, ohms = trunks["length_m"].sum(), trunks["ohms"].max() / 2
    table = datasets.read("can_bus_resistances.csv")
    lengths, listed = table[["length_m", "resistance_ohm_per_km"]].to_numpy(float).T
    # The table has no value for a trunk longer than its last length.
    listed = np.append(listed, nan) / 1e3
    share = 100 * (ohms / listed[np.searchsorted(lengths, length - 1e-9)])
    names = share.index.to_series().map(" ".join).str.strip()
    worst = _largest(share, names, "no CAN trunk whose resistance and length are listed")
    return worst._replace(partial=bool(share.isna().any()))


@_measure("devices of a segment", "devices", "most on a segment, including the master")
def _nodes(facts: Facts, concerned: Bools, host: bool) -> Outcome:
    return _largest(facts.links["devices"].astype(float), facts.links["segment"], "no data link")


@_measure("terminators", "terminators", "terminators missing or in excess of two per trunk")
def _terminators(facts: Facts, concerned: Bools, host: bool) -> Outcome:
    devices = facts.design.devices
    links = facts.links.loc[facts.links["bus"] != "AS-i", "segment"]
    if links.empty:
        return Outcome(nan, why="no data link needs terminators")
    trunk = facts.cables[facts.cables["kind"] == "trunk"]
    lines = trunk.groupby("segment")["line"].nunique().reindex(links, fill_value=1)
    placed = devices.loc[devices["kind"] == "terminator", "segment"].value_counts()
    wrong = (placed.reindex(links, fill_value=0) - 2 * lines).abs()
    subject = str(wrong.idxmax()) if wrong.any() else ""
    return Outcome(int(wrong.sum()), subject, "each trunk needs one at each end")
