"""The class rules that lee2012 quotes in section II, and the check of a system against them.

A rule is not verified if the description lacks a value that the rule needs. The text of the rules
was not available to us; `Rule.elsewhere` says what public texts require on the same matter.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from itertools import combinations
from math import inf, isnan, nan
from typing import Any, Literal

from shipnet.answers import Findings
from shipnet.crc import CAN, MODBUS, Crc
from shipnet.engine.points import Point, PointList, read_points
from shipnet.engine.registers import RegisterMap
from shipnet.errors import ArgumentError
from shipnet.fields import check_fields, number, part, record, switch, whole
from shipnet.lazy import pd
from shipnet.modbus.polling import Poll
from shipnet.modbus.uart import SerialLine

Verdict = Literal["met", "violated", "not verified"]

#: Open international standard or public specification of each protocol, and its CRC, if any.
STANDARDS: dict[str, tuple[str, Crc | None]] = {
    "CAN": ("ISO 11898-1", CAN),
    "Modbus RTU": ("MODBUS over serial line V1.02", MODBUS),
    # TCP has a checksum, which is not a CRC.
    "Modbus TCP": ("MODBUS application protocol V1.1b3", None),
}

_DNV = "DNV-OS-D202 Ch.2 Sec.3 Table A1"
_CIRCULAR = "MSC/Circ.891"


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
            for box, own in self.points.by_box().items():
                cost = (box, len(own)) if count == 1 else ("", 0)
                rows += [(f"{kind} {n + 1} of {box}", *cost) for n in range(count)]
        return pd.DataFrame(rows, columns=["dead", "boxes_lost", "points_lost"])

    def worst(self) -> int:
        """Return the largest number of points lost when one part is dead."""
        return int(self.table()["points_lost"].max())

    @classmethod
    def compare(cls, points: Iterable[Point]) -> pd.DataFrame:
        """Compare designs with one or two of each part: one row per design and dead part."""
        designs = {
            "one of each": (1, 1),
            "two supplies": (2, 1),
            "two CPUs": (1, 2),
            "two of each": (2, 2),
        }
        known = PointList(points)
        tables = {name: cls(known, *counts).table() for name, counts in designs.items()}
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
            given = getattr(self, name)
            if given is None:
                continue
            if not given or isinstance(given, str):
                raise ArgumentError(f"{name} is {given!r}; it must contain at least one name")
            if not isinstance(given, Mapping):
                object.__setattr__(self, name, tuple(given))
            elif any(isinstance(names, str) for names in given.values()):
                raise ArgumentError(f"{name} is {given!r}; each link must have a tuple of names")
            else:
                names = {link: tuple(names) for link, names in given.items()}
                object.__setattr__(self, name, names)
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

#: The computed value, NaN if the description is incomplete, and the reason.
_Outcome = tuple[float, str]


@dataclass(frozen=True, slots=True)
class Rule:
    """A class rule as the paper quotes it: the requirement on an object, its measure and its limit.

    `compute` is called with a system and the value of the field that `known` names. The limit is
    the highest permitted value, or the lowest if `at_least` is true; `elsewhere` says what public
    texts require on the same matter.
    """

    name: str
    object: str
    asks: str
    measure: str
    unit: str
    limit: float
    known: str
    compute: Callable[[Description, Any], _Outcome]
    elsewhere: str
    at_least: bool = False

    def judge(self, system: Description) -> tuple[Verdict, float, str]:
        """Return the verdict on a system, the value computed, and the reason."""
        known = getattr(system, self.known)
        value, why = (nan, "not described") if known is None else self.compute(system, known)
        if isnan(value):
            return "not verified", value, why
        good = value >= self.limit if self.at_least else value <= self.limit
        return "met" if good else "violated", value, why


def _lost(system: Description, count: int) -> _Outcome:
    return Redundancy(system.points, supplies=count, cpus=count).worst(), f"{count} per box"


def _itself(system: Description, known: float) -> _Outcome:
    return float(known), ""


def _standard(system: Description, protocols: tuple[str, ...]) -> _Outcome:
    unlisted = [name for name in protocols if name not in STANDARDS]
    standard = [f"{name}: {STANDARDS[name][0]}" for name in protocols if name in STANDARDS]
    return len(unlisted), "; ".join([*standard, *(f"{name}: none known" for name in unlisted)])


def _apart(system: Description, links: Mapping[str, tuple[str, ...]]) -> _Outcome:
    """Return the largest number of links that share no name, and the names that links share."""
    sets = [set(touched) for touched in links.values()]
    shared: set[str] = set().union(*(a & b for a, b in combinations(sets, 2)))
    why = f"shared: {', '.join(sorted(shared))}" if shared else ""
    for count in range(len(sets), 0, -1):
        for some in combinations(sets, count):
            if all(not (a & b) for a, b in combinations(some, 2)):
                return count, why
    return 0, why


def _routes(system: Description, points: PointList) -> _Outcome:
    if system.routes is None:
        return nan, "the routes are not described"
    return _apart(system, system.routes)


def _answer(system: Description, poll: Poll) -> _Outcome:
    time = poll.line.frame_time(poll.request_size) + poll.shortest_timeout
    return time, "from the first bit of the request to the last of the response"


def _crc(system: Description, protocols: tuple[str, ...]) -> _Outcome:
    checks = {name: STANDARDS.get(name, ("", None))[1] for name in protocols}
    if without := [name for name, check in checks.items() if check is None]:
        return inf, f"no CRC: {', '.join(without)}"
    used = [check for check in checks.values() if check]
    missed = sum(check.undetected(flips=n) for check in used for n in (1, 2))
    return missed, ", ".join(check.name for check in used)


def _repeats(system: Description, protocols: tuple[str, ...]) -> _Outcome:
    # A CAN controller repeats a frame until it succeeds; ISO 11898-1. A Modbus master may retry.
    repeated = [name for name in protocols if name != "CAN"]
    if not repeated:
        return inf, "CAN controllers retransmit frames automatically"
    if system.poll is None or not system.retries_known:
        return nan, f"retries of {repeated[0]} are not described"
    return system.poll.retries, f"retries of {repeated[0]}"


_NONE_FOUND = "none found in the public texts consulted"

#: The rules of section II in the order of the paper.
RULES = (
    Rule(
        name="CPU duplicated",
        object="CPUs",
        asks="the CPU is duplicated",
        measure="points lost with a dead CPU",
        unit="",
        limit=0,
        known="cpus",
        compute=_lost,
        elsewhere=_NONE_FOUND,
    ),
    Rule(
        name="supply duplicated",
        object="supplies",
        asks="the power supply is duplicated",
        measure="points lost with a dead supply",
        unit="",
        limit=0,
        known="supplies",
        compute=_lost,
        elsewhere="SOLAS II-1/51: a stand-by supply for the alarm system",
    ),
    Rule(
        name="supply changes over",
        object="supplies",
        asks="the supply changes over within 2 s",
        measure="change-over",
        unit="s",
        limit=2.0,
        known="power_switch_over",
        compute=_itself,
        elsewhere="SOLAS II-1/51: automatic, no time limit given",
    ),
    Rule(
        name="memory",
        object="memory",
        asks="only non-volatile memory",
        measure="volatile memories (1 if any)",
        unit="",
        limit=0,
        known="volatile",
        compute=_itself,
        elsewhere=_NONE_FOUND,
    ),
    Rule(
        name="standard protocol",
        object="protocols",
        asks="the protocol is an open international standard",
        measure="protocols without a standard",
        unit="",
        limit=0,
        known="protocols",
        compute=_standard,
        elsewhere=f"{_CIRCULAR} 4.6.4: standardised interfaces",
    ),
    Rule(
        name="links duplicated",
        object="links",
        asks="the data link is duplicated",
        measure="links that share no station",
        unit="",
        limit=2,
        known="links",
        compute=_apart,
        elsewhere=f"{_CIRCULAR} 4.6.2: redundant where two essential functions share a link",
        at_least=True,
    ),
    Rule(
        name="links routed apart",
        object="links",
        asks="the cables of the links are routed apart",
        measure="links that share no space",
        unit="",
        limit=2,
        known="points",
        compute=_routes,
        elsewhere=f"{_CIRCULAR} 4.6.2: as much separation as practical",
        at_least=True,
    ),
    Rule(
        name="answer",
        object="poll",
        asks="requests are answered within 2 s",
        measure="request and response",
        unit="s",
        limit=2.0,
        known="poll",
        compute=_answer,
        elsewhere=f"{_DNV}: alarms presented within 2 s; BV Pt C Ch 3 Sec 3: 5 s",
    ),
    Rule(
        name="CRC",
        object="protocols",
        asks="transmission is verified by a CRC",
        measure="single and double bit errors missed (CAN: before bit stuffing)",
        unit="",
        limit=0,
        known="protocols",
        compute=_crc,
        elsewhere=f"{_CIRCULAR} 4.6.1: the link checks itself",
    ),
    Rule(
        name="retransmission",
        object="protocols",
        asks="failed transmissions are repeated",
        measure="repeats",
        unit="",
        limit=1,
        known="protocols",
        compute=_repeats,
        elsewhere=_NONE_FOUND,
        at_least=True,
    ),
)


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
    rows: list[dict[str, Any]] = []
    for rule in RULES:
        verdict, value, why = rule.judge(system)
        rows.append(
            {
                "rule": rule.name,
                "object": rule.object,
                "value": value,
                "low": rule.limit if rule.at_least else nan,
                "high": nan if rule.at_least else rule.limit,
                "unit": rule.unit,
                "verdict": verdict,
                "why": why,
                "source": rule.elsewhere,
                "asks": rule.asks,
                "measure": rule.measure,
            }
        )
    return Findings(pd.DataFrame(rows))
