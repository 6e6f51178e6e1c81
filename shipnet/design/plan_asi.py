"""Planning of AS-i: modules for points, and lines that meet every installation rule."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import cache, lru_cache
from itertools import pairwise
from math import ceil, inf
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from shipnet.arrays import Bools, Floats, Indices
from shipnet.asi.master import Master
from shipnet.asi.plan import Plan
from shipnet.asi.profile import Profile
from shipnet.asi.rules import meets, rule_limits
from shipnet.asi.segment import Repeater, Supply
from shipnet.asi.slave import Slave
from shipnet.asi.timing import ADDRESSES, Cycle, polling_cycle
from shipnet.asi.topologies import assign_addresses
from shipnet.design.catalogue import cables, with_spare
from shipnet.design.drafting import (
    PAIR,
    Draft,
    Laid,
    Place,
    balanced,
    chain,
    divided,
    tree,
    without_place,
    zones,
)
from shipnet.design.settings import AsiLimits, Settings
from shipnet.design.supply import slave_voltage
from shipnet.lazy import pd
from shipnet.line.cable import CABLES
from shipnet.line.network import CableRun

# Modules: their points, positions and response times --------------------------------------------

#: Profile of analogue modules, which need an address of their own.
_ANALOGUE = "S-7.3"

#: Profiles of digital modules, by whether they have outputs and whether they may share an address.
#: An A/B slave needs two requests for four outputs, because one of the four bits selects A or B.
_DIGITAL = {
    (False, False): "S-0.F",
    (True, False): "S-7.F",
    (False, True): "S-0.A",
    (True, True): "S-7.A.7",
}

#: Maximum number of points divided among modules at once; the run time grows with its cube.
_MOST = 400


class Module(NamedTuple):
    """An AS-i module with its points."""

    profile: str
    place: Place
    rows: Indices
    ports: list[str]
    #: Current that the module draws from the line [A].
    current: float

    @property
    def shares(self) -> bool:
        """Whether the module's profile allows a shared address."""
        return _extended(self.profile)

    @property
    def channels(self) -> int:
        """Number of analogue values that the module transfers; 1 for a digital module."""
        return len(self.ports) if self.ports[0].startswith("A") else 1

    @property
    def outputs(self) -> bool:
        """Whether the module has outputs, which the auxiliary supply feeds."""
        return any("Q" in port for port in self.ports)


def modules(draft: Draft, rows: Indices, places: Floats) -> list[Module]:
    """Return modules for the given points."""
    limits, spare = draft.settings.asi, draft.settings.spare
    kinds = np.array([draft.types[row] for row in rows], dtype=object)
    channels = _channels(draft, rows, kinds)
    # Mask of the points that may share modules, their kinds, and, for each kind, the maximum number
    # of points and the number of ports per module. Analogue modules are faster with fewer values.
    digital = limits.inputs, limits.outputs
    sharing: list[tuple[Bools, tuple[str, ...], tuple[int, ...], tuple[int, ...]]] = [
        (np.isin(kinds, ["DI", "DO"]) & (channels > 0), ("DI", "DO"), digital, digital)
    ]
    for name in ("AI", "AO"):
        for number in range(limits.channels, 0, -1):
            chosen = (kinds == name) & (channels == number)
            sharing.append((chosen, (name,), (number,), (limits.channels,)))
    found = []
    for chosen, names, room, ports in sharing:
        mine = np.flatnonzero(chosen)
        labels = zones(places[mine], reach=limits.reach, most=_MOST)
        kind = np.array([names.index(str(name)) for name in kinds[mine]], dtype=np.intp)
        for zone, most in enumerate(_room(labels, kind, room, ports, spare).tolist()):
            inside, of_kind = mine[labels == zone], kind[labels == zone]
            counts = np.bincount(of_kind, minlength=len(names))
            needed = max(ceil(count / each) for count, each in zip(counts, most, strict=True))
            groups = balanced(places[inside], needed, kinds=of_kind, most=most)
            for group in range(groups.max() + 1):
                own = inside[groups == group]
                found.append(_module(rows[own], places[own], kinds[own], draft.settings))
    return found


@lru_cache(4096)
def response(
    profile: str, cycle: Cycle, limits: AsiLimits, *, channels: int = 1, output: bool = False,
    paired: bool = False, delay: float = 0.0,
) -> float:  # fmt: skip
    """Return the worst-case response time of a point [s]; `delay` is that of its repeaters."""
    return float(
        cycle.response_time(
            profile, channels=channels, conversion=limits.conversion, paired=paired,
            direction="out" if output else "in", delay=delay,
            repetitions=limits.repetitions or None,
        ).worst
    )  # fmt: skip


@cache
def _extended(profile: str) -> bool:
    return Profile.parse(profile).extended


def _channels(draft: Draft, rows: Indices, kinds: npt.NDArray[np.object_]) -> Indices:
    """Return the maximum number of points on each point's module; 0 if even one is too slow."""
    limits, need = draft.settings.asi, draft.need[rows]
    channels, least = np.zeros(len(rows), dtype=np.intp), np.empty(len(rows))
    for output, kind, most in ((False, "DI", limits.inputs), (True, "DO", limits.outputs)):
        mine = kinds == kind
        least[mine] = response(_DIGITAL[output, limits.shared], Cycle(1), limits, output=output)
        channels[mine & (need >= least)] = most
    analogue = np.isin(kinds, ["AI", "AO"])
    for number in range(limits.channels, 0, -1):
        late = response(_ANALOGUE, Cycle(), limits, channels=number)
        least[analogue] = late
        channels[analogue & (need >= late) & (channels == 0)] = number
    for place in np.flatnonzero(channels == 0):
        words = "even on an AS-i module of its own, its response takes"
        draft.too_slow(rows[place], float(least[place]), words)
    return channels


def _room(
    zone: Indices, kind: Indices, room: Sequence[int], ports: Sequence[int], spare: float
) -> Indices:
    """Return the maximum number of points per module, shape (zones, kinds).

    The number is reduced in the fullest zones until there are enough spare ports, or until each
    point has a module of its own.
    """
    used = np.zeros((zone.max(initial=-1) + 1, len(ports)), np.intp)
    np.add.at(used, (zone, kind), 1)
    most = np.tile(np.asarray(room, np.intp), (len(used), 1))
    number = np.ceil(used / most).max(axis=1)
    for own, left, each in zip(used.T, most.T, ports, strict=True):
        while number.sum() * each < with_spare(int(own.sum()), spare) and (left > 1).any():
            fullest = np.where(left > 1, own / number, 0.0).argmax()
            left[fullest] -= 1
            number[fullest] = np.ceil(used[fullest] / most[fullest]).max()
    return most


def _module(
    rows: Indices, places: Floats, kinds: npt.NDArray[np.object_], settings: Settings
) -> Module:
    letters = {"DI": "I", "DO": "Q", "AI": "AI", "AO": "AQ"}
    ports = [f"{letters[kind]}{(kinds[:n] == kind).sum() + 1}" for n, kind in enumerate(kinds)]
    x, y, z = np.median(places, axis=0).tolist()
    analogue = kinds[0][0] == "A"
    profile = _ANALOGUE if analogue else _DIGITAL["DO" in kinds, settings.asi.shared]
    current = settings.asi.current + analogue * len(rows) * settings.supply.loop
    return Module(profile, (x, y, z), rows, ports, current)


# One line: the route of its cable, its segments between repeaters, and their supplies -----------

#: Minimum length of a cable in a plan [m].
_SHORTEST = 0.01

#: Maximum number of divisions compared per node; only nodes with many branches have more.
_COMPARED = 20


class Piece(NamedTuple):
    """A piece of cable between two nodes of a plan."""

    near: str
    far: str
    edge: tuple[int, int]
    length: float
    share: float


class Drawn(NamedTuple):
    """The cable of a line by segment, and the nodes upstream and downstream of each repeater."""

    #: Pieces of cable of each segment, by the node at which the segment begins.
    segments: dict[str, list[Piece]]
    repeaters: list[tuple[str, str]]
    #: Number of repeaters between the master and each node.
    depths: dict[str, int]

    @property
    def pieces(self) -> list[Piece]:
        """All pieces of cable."""
        return [piece for segment in self.segments.values() for piece in segment]


class _Division(NamedTuple):
    """A way to divide the cable downstream of a node into segments."""

    #: Repeaters, the most of them in series, and cable of the segment that continues upstream [m].
    repeaters: int = 0
    series: int = 0
    used: float = 0.0
    #: Number of segments that begin at the node, and cable of the last of them [m].
    begun: int = 0
    last: float = inf
    branches: tuple[_Branch, ...] = ()


class _Branch(NamedTuple):
    """A cable from a node to a module, and everything downstream of the module."""

    #: Number of its segment at the node; 0 is the one that continues upstream.
    segment: int
    module: int
    #: Pieces of the cable [m], with repeaters between them.
    lengths: list[float]
    #: Whether a repeater at the module separates the cable from everything downstream.
    separate: bool
    downstream: _Division


def _joined(
    node: _Division, module: int, length: float, downstream: _Division, most: float
) -> Iterator[_Division]:
    """Yield the divisions of a node with one more branch: a cable to a divided part of the line."""
    used, lengths = downstream.used, [length]
    separate = ceil((used + length) / most) > ceil(length / most)
    if separate:
        used = 0.0
    while used + lengths[0] > most:
        lengths[:1] = [used + lengths[0] - most, most - used]
        used = 0.0
    used += lengths[0]
    more = separate + len(lengths) - 1
    repeaters, series = node.repeaters + downstream.repeaters + more, downstream.series + more

    def branches(segment: int) -> tuple[_Branch, ...]:
        return *node.branches, _Branch(segment, module, lengths, separate, downstream)

    if node.used + used <= most:
        yield node._replace(
            repeaters=repeaters, series=max(node.series, series), used=node.used + used,
            branches=branches(0),
        )  # fmt: skip
    series = max(node.series, series + 1)
    if node.last + used <= most:
        yield node._replace(
            repeaters=repeaters, series=series, last=node.last + used, branches=branches(node.begun)
        )
    begun = node.begun + 1
    yield _Division(repeaters + 1, series, node.used, begun, used, branches(begun))


def _best(divisions: Iterable[_Division], series: int) -> list[_Division]:
    """Return the divisions that no other equals or beats in every respect, the best first."""
    best: list[_Division] = []
    for one in sorted(divisions, key=lambda division: division[:5]):
        if one.series <= series and len(best) < _COMPARED and not any(
            two.series <= one.series and two.used <= one.used and two.last <= one.last
            for two in best
        ):  # fmt: skip
            best.append(one)
    return best


def draw(ways: Floats, cable: Floats, limits: AsiLimits) -> Drawn | None:
    """Route the cable of a line past all modules, with as few repeaters as the limits allow.

    The best divisions of the cable downstream of each node follow from those of the next nodes.
    Without a limit on repeaters in series, one would be enough: that with the fewest repeaters and
    then the shortest segment (S. Kundu and J. Misra, "A linear tree partitioning algorithm", SIAM
    Journal on Computing 6, 1977, pp. 151-154).
    """
    edges = tree(ways) if limits.tree else list(pairwise(chain(ways)))
    best = {node: [_Division()] for node in range(len(ways))}
    for near, far in reversed(edges):
        if not best[far]:
            return None
        length = max(float(cable[near, far]), _SHORTEST)
        done = _best((one._replace(begun=0, last=inf) for one in best[far]), limits.repeaters)
        if done[0].repeaters == 0:
            done = done[:1]  # a single segment can still be separated further upstream
        best[near] = _best(
            (joined for node in best[near] for one in done
             for joined in _joined(node, far, length, one, limits.length)),
            limits.repeaters,
        )  # fmt: skip
    return _drawn(best[0][0]) if best[0] else None


def _drawn(division: _Division) -> Drawn:
    """Return the cable of a line, divided at the master, with names for its nodes."""
    segments: dict[str, list[Piece]] = {"0": []}
    repeaters: list[tuple[str, str]] = []
    head, depths = {"0": "0"}, {"0": 0}
    # Branches not yet laid, each with its upstream device, and the node there if they share one.
    waiting = [(0, "0", branch) for branch in division.branches]
    while waiting:
        near, node, branch = waiting.pop()
        far, into = branch.module, str(near)
        if branch.segment:
            node = f"{near} out {branch.segment}"
        for turn, length in enumerate(branch.lengths, 1):
            if node not in head:
                repeaters.append((into, node))
                head[node], depths[node] = node, depths[into] + 1
            end = str(far) if turn == len(branch.lengths) else f"{near}>{far} {turn} in"
            piece = Piece(node, end, (near, far), length, length / sum(branch.lengths))
            segments.setdefault(head[node], []).append(piece)
            head[end], depths[end] = head[node], depths[node]
            into, node = end, f"{near}>{far} {turn} out"
        onward = f"{far} out" if branch.separate else str(far)
        waiting += [(far, onward, further) for further in branch.downstream.branches]
    return Drawn(segments, repeaters, depths)


def place_supply(
    pieces: Sequence[Piece], draws: Mapping[str, float], voltage: float, resistance: float
) -> str:
    """Return a supply's node: the first if the voltages suffice, else that with the smallest drop.

    Each piece must begin at a node of the pieces before it.
    """
    nodes, away = [pieces[0].near], np.zeros((len(pieces) + 1,) * 2)
    for far, piece in enumerate(pieces, 1):
        away[far, :far] = away[:far, far] = away[nodes.index(piece.near), :far] + piece.length
        nodes.append(piece.far)
    current = np.array([draws.get(node, 0.0) for node in nodes])

    def drops(here: list[int]) -> Floats:
        # Length shared by the routes from a supply to two devices; axes: supply, device, device.
        shared = (away[here, :, None] + away[here, None, :] - away[None]) / 2
        lost = resistance * shared @ current
        return np.asarray(lost.max(axis=1, where=current > 0, initial=0.0))

    if voltage - drops([0])[0] >= slave_voltage():
        return nodes[0]
    drop = drops([*range(len(nodes))])
    drop[[node not in draws for node in nodes]] = np.inf
    return nodes[int(drop.argmin())]


def plan_of(drawn: Drawn, slaves: Sequence[Slave], limits: AsiLimits) -> Plan:
    """Return the plan of a line, with a supply in each segment, where it begins if possible."""
    cable = cables()[limits.cable].line
    runs = [CableRun(p.near, p.far, max(p.length, _SHORTEST), cable) for p in drawn.pieces]
    draws = defaultdict(float, {"0": limits.current})
    for slave in slaves:
        draws[slave.node] += slave.current
    for upstream, downstream in drawn.repeaters:
        draws[upstream] += limits.current
        draws[downstream] += limits.current
    resistance = float(CABLES[cable].resistance)
    supplies = [
        Supply(
            place_supply(pieces, draws, limits.voltage, resistance), limits.voltage, limits.rating
        )
        for pieces in drawn.segments.values()
    ]
    master = Master(node="0", current=limits.current)
    repeaters = [Repeater(a, b, current=limits.current) for a, b in drawn.repeaters]
    return Plan(runs, [master], supplies, slaves, repeaters)


# One line as planned: addresses, responses, and the limit that the line exceeds -----------------


class Exceeded(NamedTuple):
    """A limit that a line exceeds."""

    limit: str
    value: float
    bound: float
    unit: str


class Line(NamedTuple):
    """A planned line."""

    modules: list[Module]
    drawn: Drawn | None
    slaves: list[Slave]
    plan: Plan | None
    cycle: Cycle
    #: Addresses that two slaves share.
    paired: set[int]
    responses: list[Floats]
    exceeded: Exceeded | None


def build(
    group: Sequence[Module], ways: Floats, cable: Floats, need: Floats, limits: AsiLimits
) -> Line:
    """Plan a line; the nodes of its modules are numbered from 1."""
    most = [float(min(need[module.rows])) for module in group]
    labels = assign_addresses(len(group), shares=[module.shares for module in group], need=most)
    slaves = [
        Slave(label, module.profile, node=str(place), current=module.current)
        for place, (label, module) in enumerate(zip(labels, group, strict=True), 1)
    ]
    paired = {slave.address for slave in slaves if slave.half == "B"}
    drawn = draw(ways, cable, limits)
    depths = drawn.depths if drawn else {}
    delays = [depths.get(slave.node, 0) * Repeater.delay for slave in slaves]
    addresses = [slave.address for slave in slaves]
    cycle = polling_cycle(zip(addresses, delays, strict=True))
    responses = [
        np.array([
            response(module.profile, cycle, limits, channels=module.channels, output="Q" in port,
                     paired=slave.address in paired, delay=delay)
            for port in module.ports
        ])
        for module, slave, delay in zip(group, slaves, delays, strict=True)
    ]  # fmt: skip
    exceeded = _too_late(group, responses, need)
    plan = None
    if drawn is None:
        bound = limits.length * (1 + limits.repeaters)
        exceeded = exceeded or Exceeded("length", float(cable[0].max()), bound, "m")
    elif exceeded is None:
        plan = plan_of(drawn, slaves, limits)
        exceeded = _against_rules(plan, limits)
    return Line(list(group), drawn, slaves, plan, cycle, paired, responses, exceeded)


def _too_late(
    group: Sequence[Module], responses: Sequence[Floats], need: Floats
) -> Exceeded | None:
    for module, response in zip(group, responses, strict=True):
        place = int(np.argmax(response / need[module.rows]))
        late, bound = float(response[place]), float(need[module.rows[place]])
        if late > bound:
            return Exceeded("update", 1e3 * late, 1e3 * bound, "ms")
    return None


@lru_cache(1)
def _rules(limits: AsiLimits) -> pd.DataFrame:
    rules = rule_limits()
    rules.loc["cable_length", "high"] = limits.length
    rules.loc["repeaters_in_series", "high"] = limits.repeaters
    return rules


def _against_rules(plan: Plan, limits: AsiLimits) -> Exceeded | None:
    rules = _rules(limits)
    if meets(plan.lines, rules):
        return None
    findings = plan.check(limits=rules)
    first = findings.worst().query("verdict != 'met'").sort_values("margin", kind="stable").iloc[0]
    bound = first["low"] if first["value"] < first["low"] else first["high"]
    name = str(first.name).replace("_", " ")
    return Exceeded(name, float(first["value"]), float(bound), str(first["unit"]))


# All points: modules, divided among lines that meet every limit ---------------------------------


def plan_asi(draft: Draft, rows: Indices, *, doubled: bool = False) -> None:
    """Connect points to nearby AS-i modules, on as few lines as the limits allow.

    If `doubled`, each line is laid twice, with a master, supplies, repeaters and modules of its
    own, and each point is wired to a module of both lines.
    """
    limits = draft.settings.asi
    places = np.where(draft.iolist.located[:, None], draft.places, draft.iolist.box_places)
    known = np.isfinite(places[rows]).all(axis=1)
    without_place(draft, rows[~known])
    rows = rows[known]
    found = modules(draft, rows, places[rows])
    spots = np.array([draft.middle, *(module.place for module in found)])

    def judge(group: Sequence[int]) -> tuple[Line | None, float]:
        own = [found[place] for place in group]
        sharing = sum(module.shares for module in own)
        needed = len(own) - sharing + ceil(sharing / 2)
        if needed > ADDRESSES:
            return None, needed / ADDRESSES
        at = spots[[0, *(place + 1 for place in group)]]
        ways = draft.site.route(at[:, None], at[None, :])
        line = build(own, ways, draft.site.length(ways), draft.need, limits)
        return line, 1 if line.exceeded is None else inf

    number = draft.segments("AS-i")
    for _, line in divided(range(len(found)), lambda place: found[place].place, judge):
        assert line is not None
        if line.exceeded is None:
            number += 1
            for name in ("A", "B") if doubled else ("",):
                _Laying(draft, f"AS-i {number}", line, name).lay()
            continue
        limit, value, bound, unit = line.exceeded
        of = f" {unit}" if unit else ""
        said = f"even on its own line: {value:.4g}{of}; the limit is {bound:.4g}{of}"
        for row in line.modules[0].rows:
            tag = draft.tags[row]
            text = f"{tag} does not meet the AS-i limit on {limit} {said}"
            draft.reason(tag, limit, value, bound, unit, text)


class _Laying:
    """A line to add to a draft, with the names and positions of its nodes."""

    def __init__(self, draft: Draft, segment: str, line: Line, name: str) -> None:
        assert line.plan is not None
        assert line.drawn is not None
        self.draft, self.segment, self.line, self.name = draft, segment, line, name
        self.plan, self.drawn = line.plan, line.drawn
        self.spots: list[Place] = [draft.middle, *(module.place for module in line.modules)]
        self.names: dict[str, str] = {}
        self.where = {str(place): spot for place, spot in enumerate(self.spots)}

    def lay(self) -> None:
        """Add the devices and cables of the line, and connect its points."""
        draft, segment, names = self.draft, self.segment, self.names
        limits = draft.settings.asi
        names["0"] = self.device("master", draft.middle, draft.cabinet)
        for slave, module in zip(self.line.slaves, self.line.modules, strict=True):
            what = f"slave {slave.label}"
            names[slave.node] = self.device("module", module.place, what=what)
        self.lay_repeaters()
        for supply in self.plan.supplies:
            place = self.where[supply.node]
            at = draft.cabinet if supply.node == "0" else names[supply.node]
            name = self.device("supply", place, at)
            if name not in draft.in_cabinet and draft.settings.fed:
                self.feed(draft.cabinet, name, Laid(draft.middle, place))
        for piece in self.drawn.pieces:
            near, far = piece.edge
            laid = Laid(self.spots[near], self.spots[far], share=piece.share)
            ends = names[piece.near], names[piece.far]
            draft.run("trunk", ends, laid, cables()[limits.cable], PAIR, segment, self.name)
        if limits.auxiliary and (powered := self.powered()):
            # A feeder from the cabinet along the line, up to the last module with outputs.
            source = self.device("auxiliary supply", draft.middle, draft.cabinet)
            for near, far in dict.fromkeys(piece.edge for piece in self.drawn.pieces):
                if far in powered:
                    begin = source if near == 0 else names[str(near)]
                    self.feed(begin, names[str(far)], Laid(self.spots[near], self.spots[far]))
        self.connect()

    def device(self, kind: str, place: Place, at: str = "", what: str = "") -> str:
        """Add a device, and return its name."""
        name = f"{self.segment} {what or kind} {self.name}".rstrip()
        return self.draft.device(name, kind, self.segment, place, at, self.name)

    def feed(self, begin: str, end: str, laid: Laid) -> None:
        """Add a feeder."""
        feeder = cables()[self.draft.settings.feeder]
        self.draft.run("feeder", (begin, end), laid, feeder, PAIR, self.segment, self.name)

    def lay_repeaters(self) -> None:
        """Add repeaters, beside the master or a module, or partway along a long cable."""
        names, where, drawn = self.names, self.where, self.drawn
        done = dict.fromkeys({piece.edge for piece in drawn.pieces}, 0.0)
        ends: dict[str, Place] = {}
        for piece in drawn.pieces:
            done[piece.edge] += piece.share
            near, far = (np.array(self.spots[place]) for place in piece.edge)
            x, y, z = (near + done[piece.edge] * (far - near)).tolist()
            ends[piece.far] = (x, y, z)
        for into, out in drawn.repeaters:
            beside = into in names
            place = where[into] if beside else ends[into]
            at = "" if not beside else self.draft.cabinet if into == "0" else names[into]
            names[out], where[out] = self.device("repeater", place, at), place
            if not beside:
                names[into], where[into] = names[out], place

    def powered(self) -> set[int]:
        """Return the node numbers of the modules with outputs and of those on the route to them."""
        before = {far: near for near, far in (piece.edge for piece in self.drawn.pieces)}
        powered: set[int] = set()
        for place, module in enumerate(self.line.modules, 1):
            while module.outputs and place != 0 and place not in powered:
                powered.add(place)
                place = before[place]
        return powered

    def connect(self) -> None:
        """Connect the points, and add the segment."""
        draft, segment, line = self.draft, self.segment, self.line
        for module, slave, response in zip(line.modules, line.slaves, line.responses, strict=True):
            device = self.names[slave.node]
            for row, port, late in zip(module.rows, module.ports, response, strict=True):
                address = f"{slave.label} {port}"
                if self.name != "B":
                    draft.connect(int(row), "AS-i", segment, device, address, float(late))
                draft.drop(int(row), device, module.place, segment, np.nan, self.name)
        if self.name == "B":
            return
        rows = np.concatenate([module.rows for module in line.modules])
        shares = [
            line.cycle.update_time(
                module.profile, channels=module.channels, paired=slave.address in line.paired,
                direction="out" if module.outputs else "in",
            ) / draft.need[module.rows].min()
            for module, slave in zip(line.modules, line.slaves, strict=True)
        ]  # fmt: skip
        parts = self.plan.segments
        used = len({slave.address for slave in line.slaves})
        draft.segment(
            rows, segment=segment, bus="AS-i",
            devices=len(line.slaves) + 1 + len(self.drawn.repeaters),
            length_m=sum(piece.length for piece in self.drawn.pieces), bus_time=line.cycle.bus_time,
            capacity_used=max(used / ADDRESSES, *shares), masters=1,
            slaves=len(line.slaves), addresses=used, cycle_ms=1e3 * float(line.cycle.time),
            repeaters=len(self.drawn.repeaters),
            supply_current_a=max(part.current for part in parts),
            lowest_v=min(min(part.voltages[node] for node, _ in part.draws) for part in parts),
            # The host reads both masters, so no change-over is needed.
            switch_over_ms=0.0 if self.name else np.nan,
        )  # fmt: skip
