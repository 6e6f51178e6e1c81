"""The class rules that lee2012 quotes in section II, and the check of a system against them.

A rule is not verified if the description lacks a value that the rule needs. The text of the rules
was not available to us; `lee2012_class_rules.csv` quotes the paper.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import field
from itertools import combinations
from math import inf, isnan, nan
from typing import Any

from shipnet import datasets
from shipnet.answers import COLUMNS, Findings
from shipnet.crc import CAN, MODBUS, Crc
from shipnet.engine.points import Point, PointList, read_points
from shipnet.engine.registers import RegisterMap
from shipnet.errors import ArgumentError
from shipnet.fields import check_fields, number, part, record, switch, whole
from shipnet.lazy import pd
from shipnet.modbus.polling import Poll
from shipnet.modbus.uart import SerialLine

#: Open international standard or public specification of each protocol, and its CRC, if any.
STANDARDS: dict[str, tuple[str, Crc | None]] = {
    "CAN": ("ISO 11898-1", CAN),
    "Modbus RTU": ("MODBUS over serial line V1.02", MODBUS),
    # TCP has a checksum, which is not a CRC.
    "Modbus TCP": ("MODBUS application protocol V1.1b3", None),
}

# Supplies and processors of the boxes ----------------------------------------------------------


@record(slots=True)
class Redundancy:
    """Supplies and processors per box, and the points lost when one of them is dead.

    A box works as long as at least one of its supplies and one of its processors work; otherwise
    its points are lost.

    The paper names one microcontroller and one power connector per box (section IV.1) but
    requires two of each (section II). Change-over is assumed to be automatic.

    Examples
    --------
    >>> from shipnet import engine
    >>> points = engine.read_points()
    >>> engine.Redundancy(points).worst(), engine.Redundancy(points, supplies=2, cpus=2).worst()
    (43, 0)
    >>> table = engine.Redundancy.compare(points)
    >>> table.groupby("design", sort=False).points_lost.max().to_dict()
    {'one of each': 43, 'two supplies': 43, 'two CPUs': 43, 'two of each': 0}
    """

    points: PointList = part(PointList, "One or more points", make=PointList)
    supplies: int = whole(1, 4, "", "Supplies per box", default=1)
    cpus: int = whole(1, 4, "", "Processors per box", default=1)

    def table(self) -> pd.DataFrame:
        """Return the effect of each ``dead`` part: ``boxes_lost``, ``points_lost``."""
        rows = []
        for kind, count in (("supply", self.supplies), ("cpu", self.cpus)):
            for box, points in self.points.by_box().items():
                cost = (box, len(points)) if count == 1 else ("", 0)
                rows += [(f"{kind} {n + 1} of {box}", *cost) for n in range(count)]
        return pd.DataFrame(rows, columns=["dead", "boxes_lost", "points_lost"])

    def worst(self) -> int:
        """Return the largest number of points lost when one part is dead."""
        return int(self.table()["points_lost"].max())

    @classmethod
    def compare(cls, points: Iterable[Point]) -> pd.DataFrame:
        """Compare designs with one or two of each part: one row per design and dead part."""
        designs = {"one of each": (1, 1), "two supplies": (2, 1), "two CPUs": (1, 2)}
        designs["two of each"] = (2, 2)
        checked = PointList(points)
        tables = {name: cls(checked, *counts).table() for name, counts in designs.items()}
        return pd.concat(tables, names=["design", ""]).reset_index("design").reset_index(drop=True)


# Descriptions ----------------------------------------------------------------------------------


@record
class Description:
    """Data of a monitoring system, to be checked against the class rules; None means unknown.

    `links` maps each link to its stations, not counting the master, and `routes` maps each link to
    the spaces or trays that it runs through.

    Examples
    --------
    >>> from shipnet import engine
    >>> engine.Description.printed().cpus, engine.Description.printed().supplies
    (1, None)
    """

    points: PointList = part(PointList, "One or more points", make=PointList)
    cpus: int | None = whole(1, 4, "", "Processors per box", default=None, optional=True)
    supplies: int | None = whole(1, 4, "", "Supplies per box", default=None, optional=True)
    power_switch_over: float | None = number(
        0, 3600, "s", "Duration of a supply change-over", default=None, optional=True
    )
    volatile: bool | None = switch(
        "Whether settings or programs are stored in volatile memory", default=None, optional=True
    )
    protocols: tuple[str, ...] | None = None
    links: Mapping[str, tuple[str, ...]] | None = field(default=None, hash=False)
    routes: Mapping[str, tuple[str, ...]] | None = field(default=None, hash=False)
    poll: Poll | None = part(
        Poll, "Poll that requests all points from one junction box", default=None, optional=True
    )
    retries_known: bool = switch(
        "Whether the retries of `poll` are those of the system, not the default", default=False
    )

    def __post_init__(self) -> None:
        check_fields(self)
        for name in ("protocols", "links", "routes"):
            value = getattr(self, name)
            if value is None:
                continue
            if not value or isinstance(value, str):
                raise ArgumentError(f"{name} is {value!r}; it must contain at least one name")
            if isinstance(value, Mapping):
                if any(isinstance(names, str) for names in value.values()):
                    raise ArgumentError(
                        f"{name} is {value!r}; each link must have a tuple of names"
                    )
                object.__setattr__(self, name, {k: tuple(names) for k, names in value.items()})
            else:
                object.__setattr__(self, name, tuple(value))
        if self.routes is not None and set(self.routes) != set(self.links or ()):
            raise ArgumentError("routes and links must name the same links")

    @classmethod
    def printed(cls) -> Description:
        """Return the description of the system as printed in lee2012.

        It has one microcontroller per box (section IV.1), CAN and Modbus RTU, one channel to JB1
        and one to JB3 (Fig 3), and 9600 bit/s 8E1 (Table 2). We assume that one request polls all
        99 points.
        """
        points = read_points()
        return cls(
            points,
            cpus=1,
            protocols=("CAN", "Modbus RTU"),
            links={"channel 1": ("JB1",), "channel 2": ("JB3",)},
            poll=Poll(RegisterMap(points).requests()[0], SerialLine(9600)),
        )


# The rules -------------------------------------------------------------------------------------

# Each measure of a rule is called with a description and the value that the rule needs. It returns
# the computed value, NaN if the description is incomplete, and the reason.


def _lost(system: Description, count: int) -> tuple[float, str]:
    return Redundancy(system.points, supplies=count, cpus=count).worst(), f"{count} per box"


def _itself(system: Description, value: float) -> tuple[float, str]:
    return float(value), ""


def _standard(system: Description, protocols: tuple[str, ...]) -> tuple[float, str]:
    unlisted = [name for name in protocols if name not in STANDARDS]
    standard = [f"{name}: {STANDARDS[name][0]}" for name in protocols if name in STANDARDS]
    return len(unlisted), "; ".join([*standard, *(f"{name}: none known" for name in unlisted)])


def _apart(system: Description, links: Mapping[str, tuple[str, ...]]) -> tuple[float, str]:
    """Return the largest number of links that share no name, and the names that links share."""
    sets = [set(names) for names in links.values()]
    shared: set[str] = set().union(*(a & b for a, b in combinations(sets, 2)))
    why = f"shared: {', '.join(sorted(shared))}" if shared else ""
    for count in range(len(sets), 0, -1):
        for some in combinations(sets, count):
            if all(not (a & b) for a, b in combinations(some, 2)):
                return count, why
    return 0, why


def _routes(system: Description, points: PointList) -> tuple[float, str]:
    if system.routes is None:
        return nan, "the routes are not described"
    return _apart(system, system.routes)


def _answer(system: Description, poll: Poll) -> tuple[float, str]:
    time = poll.line.frame_time(poll.request_size) + poll.shortest_timeout
    return time, "from the first bit of the request to the last of the response"


def _crc(system: Description, protocols: tuple[str, ...]) -> tuple[float, str]:
    checks = {name: STANDARDS.get(name, ("", None))[1] for name in protocols}
    if without := [name for name, check in checks.items() if check is None]:
        return inf, f"no CRC: {', '.join(without)}"
    used = [check for check in checks.values() if check]
    missed = sum(check.undetected(flips=n) for check in used for n in (1, 2))
    return missed, ", ".join(check.name for check in used)


def _repeats(system: Description, protocols: tuple[str, ...]) -> tuple[float, str]:
    # A CAN controller repeats a frame until it succeeds; ISO 11898-1. A Modbus master may retry.
    repeated = [name for name in protocols if name != "CAN"]
    if not repeated:
        return inf, "CAN controllers retransmit frames automatically"
    if system.poll is None or not system.retries_known:
        return nan, f"retries of {repeated[0]} are not described"
    return system.poll.retries, f"retries of {repeated[0]}"


#: How each rule of the data file is measured.
_MEASURES: dict[str, Callable[[Description, Any], tuple[float, str]]] = {
    "CPU duplicated": _lost,
    "supply duplicated": _lost,
    "supply changes over": _itself,
    "memory": _itself,
    "standard protocol": _standard,
    "links duplicated": _apart,
    "links routed apart": _routes,
    "answer": _answer,
    "CRC": _crc,
    "retransmission": _repeats,
}


def check(system: Description) -> Findings:
    """Check a system against the class rules that lee2012 quotes.

    Parameters
    ----------
    system : Description
        Data of the system.

    Returns
    -------
    Findings
        One row per rule, with the additional columns ``asks`` and ``measure``; ``source`` says what
        public texts require on the same matter.

    Examples
    --------
    >>> from shipnet import engine
    >>> findings = engine.check(engine.Description.printed())
    >>> findings
    <Findings: 10 checks, 1 violated, 5 not verified>
    >>> print(*findings.violated().loc[0, ["rule", "value", "high"]])
    CPU duplicated 43.0 0.0
    """
    rows = []
    rules = datasets.read("lee2012_class_rules.csv")
    rules[["low", "high"]] = rules[["low", "high"]].apply(pd.to_numeric)
    for rule in rules.to_dict("records"):
        described = getattr(system, rule.pop("described_by"))
        value, why = nan, "not described"
        if described is not None:
            value, why = _MEASURES[str(rule["rule"])](system, described)
        good = not (value < rule["low"] or value > rule["high"])
        verdict = "not verified" if isnan(value) else "met" if good else "violated"
        rows.append(rule | {"value": value, "verdict": verdict, "why": why})
    table = pd.DataFrame(rows).rename(columns={"elsewhere": "source"})
    return Findings(table[[*COLUMNS, "asks", "measure"]])
