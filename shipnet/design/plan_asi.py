"""Planning of AS-i: modules for points, and lines that meet every installation rule."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import lru_cache, partial
from itertools import pairwise
from math import ceil, inf
from typing import Literal, NamedTuple

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
from shipnet.design.revision import Device, numbered
from shipnet.design.settings import AsiLimits
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

#: Profiles that allow a shared address.
_SHARED = frozenset(name for name in _DIGITAL.values() if Profile.parse(name).extended)

#: Names of ports, by the type of their point.
_PORTS = {"DI": "I", "DO": "Q", "AI": "AI", "AO": "AQ"}

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
    #: Address and segment that the module keeps, or "".
    label: str = ""
    segment: str = ""

    @property
    def shares(self) -> bool:
        """Whether the module's profile allows a shared address."""
        return self.profile in _SHARED

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
    kept_modules = _kept_modules(draft, rows, kinds, channels)
    kept = [row for members in kept_modules.values() for row in members]

    def module(chosen: Indices, place: Place, device: Device | None = None) -> Module:
        of = kinds[chosen]
        kept_by, address = draft.kept.device, draft.kept.address
        addresses = [
            address[row].split() if device and kept_by.get(row) == device else []
            for row in rows[chosen].tolist()
        ]
        old = [float(address[1].lstrip("AIQ")) if address else np.nan for address in addresses]
        names = [f"{_PORTS[k]}{n}" for k, n in zip(of, numbered(of, old), strict=True)]
        analogue = of[0][0] == "A"
        profile = _ANALOGUE if analogue else _DIGITAL["DO" in of, limits.shared]
        current = limits.current + analogue * len(of) * draft.settings.supply.loop
        label = next((address[0] for address in addresses if address), "")
        segment = device.segment if device else ""
        return Module(profile, place, rows[chosen], names, current, label, segment)

    made = [module(np.array(n), device.place, device) for device, n in kept_modules.items()]
    for mask, types, room, ports in sharing:
        together = np.flatnonzero(mask & ~np.isin(np.arange(len(rows)), kept))
        labels = zones(places[together], reach=limits.reach, most=_MOST)
        kind = np.array([types.index(str(name)) for name in kinds[together]], dtype=np.intp)
        for zone, most in enumerate(_room(labels, kind, room, ports, spare).tolist()):
            inside, of_kind = together[labels == zone], kind[labels == zone]
            counts = np.bincount(of_kind, minlength=len(types))
            needed = max(ceil(count / each) for count, each in zip(counts, most, strict=True))
            groups = balanced(places[inside], needed, kinds=of_kind, most=most)
            for group in range(groups.max() + 1):
                chosen = inside[groups == group]
                x, y, z = np.median(places[chosen], axis=0).tolist()
                made.append(module(chosen, (x, y, z)))
    return made


def _kept_modules(
    draft: Draft, rows: Indices, kinds: npt.NDArray[np.object_], channels: Indices
) -> dict[Device, list[int]]:
    """Return the points of each kept module, as indices; new ones take free ports within reach."""
    index = {row: n for n, row in enumerate(rows.tolist()) if channels[n]}
    groups = {
        device: [index[row] for row in members]
        for device, members in draft.kept.groups(index, "module", "AS-i ").items()
    }
    limits = draft.settings.asi
    room = {"DI": limits.inputs, "DO": limits.outputs, "AI": limits.channels, "AO": limits.channels}
    for n in sorted({*index.values()}.difference(*groups.values())):
        kind, digital = kinds[n], kinds[n] in ("DI", "DO")
        for members in groups.values():
            alike = {*kinds[members]} <= ({"DI", "DO"} if digital else {kind})
            fits = digital or len(members) < min(channels[[n, *members]])
            free = np.count_nonzero(kinds[members] == kind) < room[kind]
            away = draft.site.route(draft.places[rows[members]], draft.places[rows[n]])
            if alike and fits and free and away.max() <= limits.reach:
                members.append(n)
                break
    return groups


def _labels(group: Sequence[Module], need: Sequence[float]) -> list[str]:
    """Return the addresses of a line's modules: the kept ones, and free ones for the others."""
    kept = [module.label for module in group if module.label]
    taken = {label.rstrip("AB") for label in kept}
    free = [str(n) for n in range(1, ADDRESSES + 1) if str(n) not in taken]
    if not kept or len({*kept}) < len(kept) or len(free) < len(group) - len(kept):
        return assign_addresses(len(group), shares=[module.shares for module in group], need=need)
    return [module.label or free.pop(0) + "A" * module.shares for module in group]


@lru_cache(4096)
def response(
    profile: str,
    cycle: Cycle,
    limits: AsiLimits,
    *,
    channels: int = 1,
    output: bool = False,
    paired: bool = False,
    delay: float = 0.0,
) -> float:
    """Return the worst-case response time of a point [s]; `delay` is that of its repeaters."""
    way: Literal["in", "out"] = "out" if output else "in"
    time = cycle.response_time(
        profile,
        channels=channels,
        conversion=limits.conversion,
        paired=paired,
        direction=way,
        delay=delay,
        repetitions=limits.repetitions or None,
    )
    return float(time.worst)


def _channels(draft: Draft, rows: Indices, kinds: npt.NDArray[np.object_]) -> Indices:
    """Return the maximum number of points on each point's module; 0 if even one is too slow."""
    limits, need = draft.settings.asi, draft.need[rows]
    channels, least = np.zeros(len(rows), dtype=np.intp), np.empty(len(rows))
    for output, kind, most in ((False, "DI", limits.inputs), (True, "DO", limits.outputs)):
        of_kind = kinds == kind
        least[of_kind] = response(_DIGITAL[output, limits.shared], Cycle(1), limits, output=output)
        channels[of_kind & (need >= least)] = most
    analogue = np.isin(kinds, ["AI", "AO"])
    for number in range(limits.channels, 0, -1):
        late = response(_ANALOGUE, Cycle(), limits, channels=number)
        least[analogue] = late
        channels[analogue & (need >= late) & (channels == 0)] = number
    for index in np.flatnonzero(channels == 0):
        words = "even on an AS-i module of its own, its response takes"
        draft.too_slow(rows[index], float(least[index]), words)
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
    for points, left, each in zip(used.T, most.T, ports, strict=True):
        while number.sum() * each < with_spare(int(points.sum()), spare) and (left > 1).any():
            fullest = np.where(left > 1, points / number, 0.0).argmax()
            left[fullest] -= 1
            number[fullest] = np.ceil(used[fullest] / most[fullest]).max()
    return most


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
    series = downstream.series + more
    both = node._replace(
        repeaters=node.repeaters + downstream.repeaters + more, series=max(node.series, series)
    )

    def branches(segment: int) -> tuple[_Branch, ...]:
        return *node.branches, _Branch(segment, module, lengths, separate, downstream)

    if node.used + used <= most:
        yield both._replace(used=node.used + used, branches=branches(0))
    both = both._replace(series=max(node.series, series + 1))
    if node.last + used <= most:
        yield both._replace(last=node.last + used, branches=branches(node.begun))
    begun = node.begun + 1
    yield both._replace(
        repeaters=both.repeaters + 1, begun=begun, last=used, branches=branches(begun)
    )


def _best(divisions: Iterable[_Division], series: int) -> list[_Division]:
    """Return the divisions that no other equals or beats in every respect, the best first."""
    best: list[_Division] = []
    for new in sorted(divisions, key=lambda division: division[:5]):
        dominated = any(
            division.series <= new.series
            and division.used <= new.used
            and division.last <= new.last
            for division in best
        )
        if new.series <= series and len(best) < _COMPARED and not dominated:
            best.append(new)
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
        joined = (
            division
            for node in best[near]
            for one in done
            for division in _joined(node, far, length, one, limits.length)
        )
        best[near] = _best(joined, limits.repeaters)
    if not best[0]:
        return None
    # The cable of the best division, with names for its nodes.
    segments: dict[str, list[Piece]] = {"0": []}
    repeaters: list[tuple[str, str]] = []
    head, depths = {"0": "0"}, {"0": 0}
    # Branches not yet laid, each with its upstream device, and the node there if they share one.
    waiting = [(0, "0", branch) for branch in best[0][0].branches]
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
    volts, amps = limits.voltage, limits.rating
    supplies = [
        Supply(place_supply(pieces, draws, volts, resistance), volts, amps)
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
    labels = _labels(group, [float(min(need[module.rows])) for module in group])
    slaves = [
        Slave(label, module.profile, node=str(node), current=module.current)
        for node, (label, module) in enumerate(zip(labels, group, strict=True), 1)
    ]
    paired = {slave.address for slave in slaves if slave.half == "B"}
    drawn = draw(ways, cable, limits)
    depths = drawn.depths if drawn else {}
    delays = [depths.get(slave.node, 0) * Repeater.delay for slave in slaves]
    addresses = [slave.address for slave in slaves]
    cycle = polling_cycle(zip(addresses, delays, strict=True))
    responses, exceeded = [], None
    for module, slave, delay in zip(group, slaves, delays, strict=True):
        late = partial(
            response,
            module.profile,
            cycle,
            limits,
            channels=module.channels,
            delay=delay,
            paired=slave.address in paired,
        )
        times = np.array([late(output="Q" in port) for port in module.ports])
        responses.append(times)
        worst = int(np.argmax(times / need[module.rows]))
        time, bound = float(times[worst]), float(need[module.rows[worst]])
        if time > bound and exceeded is None:
            exceeded = Exceeded("update", 1e3 * time, 1e3 * bound, "ms")
    plan = None
    if drawn is None:
        bound = limits.length * (1 + limits.repeaters)
        exceeded = exceeded or Exceeded("length", float(cable[0].max()), bound, "m")
    elif exceeded is None:
        plan = plan_of(drawn, slaves, limits)
        rules = _rules(limits)
        if not meets(plan.lines, rules):
            worst_first = plan.check(limits=rules).worst().query("verdict != 'met'")
            first = worst_first.sort_values("margin", kind="stable").iloc[0]
            bound = first["low"] if first["value"] < first["low"] else first["high"]
            name = str(first.name).replace("_", " ")
            exceeded = Exceeded(name, float(first["value"]), float(bound), str(first["unit"]))
    return Line(list(group), drawn, slaves, plan, cycle, paired, responses, exceeded)


@lru_cache(1)
def _rules(limits: AsiLimits) -> pd.DataFrame:
    rules = rule_limits()
    rules.loc["cable_length", "high"] = limits.length
    rules.loc["repeaters_in_series", "high"] = limits.repeaters
    return rules


# All points: modules, divided among lines that meet every limit ---------------------------------


def plan_asi(draft: Draft, rows: Indices, *, doubled: bool = False) -> None:
    """Connect points to nearby AS-i modules, on as few lines as the limits allow.

    If `doubled`, each line is laid twice, with a master, supplies, repeaters and modules of its
    chosen, and each point is wired to a module of both lines.
    """
    limits = draft.settings.asi
    places = np.where(draft.iolist.located[:, None], draft.places, draft.iolist.box_places)
    located = np.isfinite(places[rows]).all(axis=1)
    without_place(draft, rows[~located])
    rows = rows[located]
    all_modules = modules(draft, rows, places[rows])
    spots = np.array([draft.middle, *(module.place for module in all_modules)])

    def judge(group: Sequence[int]) -> tuple[Line | None, float]:
        chosen = [all_modules[index] for index in group]
        sharing = sum(module.shares for module in chosen)
        needed = len(chosen) - sharing + ceil(sharing / 2)
        if needed > ADDRESSES:
            return None, needed / ADDRESSES
        at = spots[[0, *(index + 1 for index in group)]]
        ways = draft.site.route(at[:, None], at[None, :])
        line = build(chosen, ways, draft.site.length(ways), draft.need, limits)
        return line, 1 if line.exceeded is None else inf

    number = draft.segments("AS-i")
    lines = divided(
        range(len(all_modules)),
        lambda index: all_modules[index].place,
        judge,
        segment=lambda index: all_modules[index].segment,
    )
    for _, line in lines:
        assert line is not None
        if line.exceeded is None:
            number += 1
            for name in ("A", "B") if doubled else ("",):
                _lay(draft, f"AS-i {number}", line, name)
            continue
        limit, value, bound, unit = line.exceeded
        of = f" {unit}" if unit else ""
        for tag in (draft.tags[row] for row in line.modules[0].rows):
            text = f"{tag} does not meet the AS-i limit on {limit} even on its own line: "
            text += f"{value:.4g}{of}; the limit is {bound:.4g}{of}"
            draft.reason(tag, limit, value, bound, unit, text)


def _lay(draft: Draft, segment: str, line: Line, name: str) -> None:
    """Add the devices and cables of a line, its name "" or A or B, and connect its points."""
    plan, drawn = line.plan, line.drawn
    assert plan is not None
    assert drawn is not None
    limits, spots = draft.settings.asi, [draft.middle, *(module.place for module in line.modules)]
    feeder, cable = cables()[draft.settings.feeder], cables()[limits.cable]

    def device(kind: str, place: Place, at: str = "", what: str = "") -> str:
        called = f"{segment} {what or kind} {name}".rstrip()
        return draft.device(called, kind, segment, place, at, name)

    # Names and positions of the plan's nodes; a repeater is beside a device, or along a cable.
    names = {"0": device("master", draft.middle, draft.cabinet)}
    for slave, module in zip(line.slaves, line.modules, strict=True):
        names[slave.node] = device("module", module.place, what=f"slave {slave.label}")
    where = {str(node): spot for node, spot in enumerate(spots)}
    laid, ends = dict.fromkeys({piece.edge for piece in drawn.pieces}, 0.0), dict[str, Place]()
    for piece in drawn.pieces:
        laid[piece.edge] += piece.share
        near, far = (np.array(spots[node]) for node in piece.edge)
        x, y, z = (near + laid[piece.edge] * (far - near)).tolist()
        ends[piece.far] = (x, y, z)
    for into, out in drawn.repeaters:
        beside = into in names
        place = where[into] if beside else ends[into]
        at = "" if not beside else draft.cabinet if into == "0" else names[into]
        names[out], where[out] = device("repeater", place, at), place
        if not beside:
            names[into], where[into] = names[out], place

    for supply in plan.supplies:
        place = where[supply.node]
        at = draft.cabinet if supply.node == "0" else names[supply.node]
        fed = device("supply", place, at)
        if fed not in draft.in_cabinet and draft.settings.fed:
            ways = Laid(draft.middle, place)
            draft.run("feeder", (draft.cabinet, fed), ways, feeder, PAIR, segment, name)
    for piece in drawn.pieces:
        a, b = piece.edge
        ways = Laid(spots[a], spots[b], share=piece.share)
        draft.run("trunk", (names[piece.near], names[piece.far]), ways, cable, PAIR, segment, name)
    # A feeder from the cabinet along the line, up to the last module with outputs.
    upstream = {far: near for near, far in (piece.edge for piece in drawn.pieces)}
    powered: set[int] = set()
    for node, module in enumerate(line.modules, 1):
        while limits.auxiliary and module.outputs and node != 0 and node not in powered:
            powered.add(node)
            node = upstream[node]
    if powered:
        source = device("auxiliary supply", draft.middle, draft.cabinet)
        for a, b in dict.fromkeys(piece.edge for piece in drawn.pieces):
            if b in powered:
                begin = source if a == 0 else names[str(a)]
                ways = Laid(spots[a], spots[b])
                draft.run("feeder", (begin, names[str(b)]), ways, feeder, PAIR, segment, name)

    shares = []
    for module, slave, response in zip(line.modules, line.slaves, line.responses, strict=True):
        for row, port, late in zip(module.rows.tolist(), module.ports, response, strict=True):
            if name != "B":
                address = f"{slave.label} {port}"
                draft.connect(row, "AS-i", segment, names[slave.node], address, float(late))
            draft.drop(row, names[slave.node], module.place, segment, np.nan, name)
        time = line.cycle.update_time(
            module.profile,
            channels=module.channels,
            paired=slave.address in line.paired,
            direction="out" if module.outputs else "in",
        )
        shares.append(time / draft.need[module.rows].min())
    if name == "B":
        return
    parts = plan.segments
    used = len({slave.address for slave in line.slaves})
    draft.segment(
        np.concatenate([module.rows for module in line.modules]),
        segment=segment,
        bus="AS-i",
        devices=len(line.slaves) + 1 + len(drawn.repeaters),
        length_m=sum(piece.length for piece in drawn.pieces),
        bus_time=line.cycle.bus_time,
        capacity_used=max(used / ADDRESSES, *shares),
        masters=1,
        slaves=len(line.slaves),
        addresses=used,
        cycle_ms=1e3 * float(line.cycle.time),
        repeaters=len(drawn.repeaters),
        supply_current_a=max(part.current for part in parts),
        lowest_v=min(min(part.voltages[node] for node, _ in part.draws) for part in parts),
        # The host reads both masters, so no change-over is needed.
        switch_over_ms=0.0 if name else np.nan,
    )
