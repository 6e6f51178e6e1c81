"""Voltage and current on every feeder and AS-i line of a design, and the sizes of feeders.

Feeders and lines form trees whose roots are the supplies. Currents are summed from the leaves, and
voltage drops from the roots, one level of all trees at a time.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.sparse import coo_array
from scipy.sparse.csgraph import breadth_first_order, connected_components

from shipnet.arrays import Bools, Floats, Indices
from shipnet.asi.rules import rule_limits
from shipnet.design.catalogue import Cable, cables, read_assumptions
from shipnet.design.layout import Layout
from shipnet.lazy import pd
from shipnet.line.cable import CABLES

#: Setting with the current of each signal; other signals draw no current.
_SIGNALS = {
    "contact": "contact contact_common namur",
    "sensor": "proximity_3wire potentiometer",
    "loop": "current_loop current_loop_3wire analogue_output",
    "solenoid": "solenoid solenoid_common",
}
LOADS = {signal: load for load, signals in _SIGNALS.items() for signal in signals.split()}

#: Layers of nodes, each with one node per device: 0 for single lines, lines A and AS-i lines; 1
#: for lines B and the master side of AS-i repeaters; 2 for feeders of the outputs of AS-i modules.
_LINE_B, _OUTPUTS, _LAYERS = 1, 2, 3


@dataclass(frozen=True, eq=False)
class Forest:
    """Feeders and AS-i lines as trees; nodes are numbered, and -1 means no node."""

    #: Number of the device at each node.
    device: Indices
    #: Next node towards the supply, and the cable run to it.
    parent: Indices
    run: Indices
    #: Length of that run [m], and resistance of both its conductors together [ohm/m].
    metres: Floats
    ohms: Floats
    #: Current that each node draws, and the additional current of a shorted point [A].
    load: Floats
    short: Floats
    #: Voltage drop in the cable of a node's worst point, and the allowed drop up to that point [V].
    spur: Floats
    allowed: Floats
    #: Root of each node's tree, and the number of the supply at each root.
    root: Indices
    supply: Mapping[int, int]
    #: Nodes except the roots, level by level from the supplies.
    levels: tuple[Indices, ...]

    @property
    def fed(self) -> Indices:
        """Nodes except the roots, nearest the supplies first."""
        return np.concatenate([np.zeros(0, np.intp), *self.levels])

    def solve(self, *, short: bool = False) -> tuple[Floats, Floats]:
        """Return the current into each node [A], and the voltage drop up to it [V].

        With `short`, the drop along each 24 V run includes the current of one shorted point.
        """
        flow, drop = self.load.copy(), np.zeros(len(self.load))
        for level in reversed(self.levels):
            np.add.at(flow, self.parent[level], flow[level])  # fixed order, for reproducible sums
        along = flow + self.short if short else flow
        for level in self.levels:
            lost = self.metres[level] * self.ohms[level] * along[level]
            drop[level] = drop[self.parent[level]] + lost
        return flow, drop

    def cut(self, nodes: Sequence[int], metres: float) -> Forest:
        """Return a forest in which each of `nodes` has its own supply, `metres` of cable away."""
        if not nodes:
            return self
        new = len(self.parent) + np.arange(len(nodes))
        parent, length = self.parent.copy(), self.metres.copy()
        parent[list(nodes)], length[list(nodes)] = new, metres

        fills = dict.fromkeys(("ohms", "metres", "load", "short", "spur", "allowed"), 0)
        fills |= {"device": -1, "run": -1, "parent": -1}
        changed = replace(self, parent=parent, metres=length)
        arrays = {name: getattr(changed, name) for name in fills}
        longer = {
            name: np.concatenate([array, np.full(len(new), fills[name], array.dtype)])
            for name, array in arrays.items()
        }
        root, levels = _rooted(longer["parent"], np.append(self.fed, new))
        supply = {**self.supply, **dict.fromkeys(new.tolist(), -1)}
        return replace(changed, root=root, levels=levels, supply=supply, **longer)


def _rooted(parent: Indices, nodes: Indices) -> tuple[Indices, tuple[Indices, ...]]:
    """Return the root of each node, and the nodes in `nodes` that are not roots, by level."""
    root, depth, up = np.arange(len(parent)), np.zeros(len(parent), np.intp), parent.copy()
    while (up >= 0).any():
        root, depth = np.where(up >= 0, up, root), depth + (up >= 0)
        up = np.where(up >= 0, parent[up], -1)
    of = depth[nodes]
    return root, tuple(nodes[of == level] for level in range(1, of.max(initial=0) + 1))


def forest(design: Layout) -> Forest:
    """Return the trees of a design, without any run that closes a ring."""
    devices, runs, settings = design.devices, design.cables, design.settings
    kinds, count = devices["kind"].to_numpy(object), len(devices)
    index = {name: number for number, name in enumerate(devices["device"])}
    at = np.array([index.get(name, -1) for name in devices["at"]], np.intp)
    buses = dict(zip(design.segments["segment"], design.segments["bus"], strict=True))
    on_asi = devices["segment"].map(buses).to_numpy(object) == "AS-i"
    run_asi = runs["segment"].map(buses).to_numpy(object) == "AS-i"

    feeder, trunk = ((runs["kind"] == kind).to_numpy() for kind in ("feeder", "trunk"))
    laid = np.flatnonzero(feeder | (trunk & run_asi))
    a, b = (runs[end].iloc[laid].map(index).to_numpy(np.intp) for end in "ab")
    # A feeder from the cabinet brings mains to a supply.
    kept = ~(feeder[laid] & (kinds == "cabinet")[np.stack([a, b])].any(axis=0))
    laid, a, b = laid[kept], a[kept], b[kept]
    outputs = feeder[laid] & run_asi[laid]
    # Each line of a doubled AS-i segment has its own devices, so both lines are in layer 0.
    second = ~run_asi[laid] & (runs["line"].to_numpy()[laid] == "B")
    layer = np.where(outputs, _OUTPUTS, _LINE_B * second)
    towards = trunk[laid] & (kinds[b] == "repeater")
    u, v = layer * count + a, np.where(towards, _LINE_B, layer) * count + b
    nodes = _LAYERS * count

    # A device in the cabinet is beside the master of its line; any other is beside its housing.
    segments = list(zip(devices["segment"], devices["line"], strict=True))
    master = {segments[number]: number for number in np.flatnonzero(kinds == "master").tolist()}
    beside = [
        master.get(segment, device) if device >= 0 and kinds[device] == "cabinet" else device
        for segment, device in zip(segments, at.tolist(), strict=True)
    ]
    supply = _roots(kinds, beside, on_asi, u, v)

    # Search once, from an extra node that is joined to all supplies.
    roots = np.fromiter(supply, np.intp, len(supply))
    ends = np.concatenate([u, np.full(len(roots), nodes)]), np.concatenate([v, roots])
    graph = coo_array((np.ones(len(ends[0])), ends), shape=(nodes + 1, nodes + 1)).tocsr()
    order, parent = breadth_first_order(graph, nodes, directed=False, return_predecessors=True)
    parent = np.where((parent < 0) | (parent == nodes), -1, parent)[:nodes].astype(np.intp)
    run = np.full(nodes, -1, np.intp)
    run[v[parent[v] == u]], run[u[parent[u] == v]] = laid[parent[v] == u], laid[parent[u] == v]
    root, levels = _rooted(parent, order[order < nodes].astype(np.intp))

    types = cables()
    each = [
        CABLES[types[name].line].resistance if of_trunk else types[name].resistance
        for name, of_trunk in zip(runs["cable"].iloc[laid], trunk[laid], strict=True)
    ]
    ohms, metres = np.zeros(len(runs) + 1), np.append(runs["length_m"].to_numpy(float), 0.0)
    ohms[laid] = each
    load, spur, fed_24 = _loads(design, kinds, beside, on_asi, index, set(v.tolist()))
    limits, drop_asi = settings.supply, settings.asi.voltage - slave_voltage()
    return Forest(
        device=np.arange(nodes, dtype=np.intp) % count,
        parent=parent,
        run=run,
        metres=metres[run],
        ohms=ohms[run],
        load=load,
        short=np.where(fed_24, limits.short, 0.0),
        spur=spur,
        allowed=np.where(fed_24, limits.drop * limits.voltage, drop_asi),
        root=root,
        supply=MappingProxyType(supply),
        levels=levels,
    )


@cache
def slave_voltage() -> float:
    """Return the minimum supply voltage of an AS-i slave [V]."""
    return float(rule_limits()["low"]["slave_voltage"])


def _roots(
    kinds: npt.NDArray[np.object_], beside: Sequence[int], on_asi: Bools, u: Indices, v: Indices
) -> dict[int, int]:
    """Return the supplies by the node to which each is connected."""
    count, reached = len(kinds), {*u.tolist(), *v.tolist()}
    supply: dict[int, int] = {}
    between = []
    for number in np.flatnonzero(np.isin(kinds, ("supply", "auxiliary supply"))).tolist():
        feeding = [node for node in range(number, _LAYERS * count, count) if node in reached]
        housing = beside[number]
        if feeding or not on_asi[number] or housing < 0:
            supply[feeding[0] if feeding else number] = number
        elif kinds[housing] == "repeater" and housing + count in reached:
            between.append((number, housing))
        else:
            supply[housing] = number
    if between:
        # In the housing of a repeater, a supply feeds the side that has no supply yet.
        shape = (_LAYERS * count,) * 2
        labels = connected_components(coo_array((np.ones(len(u)), (u, v)), shape=shape), False)[1]
        done = {int(labels[node]) for node in supply}
        for number, housing in between:
            node = housing + count * (int(labels[housing]) in done)
            done.add(int(labels[node]))
            supply[node] = number
    return supply


def point_currents(design: Layout) -> pd.Series[float]:
    """Return the current of each point while it is on [A]."""
    draws = {name: getattr(design.settings.supply, kind) for name, kind in LOADS.items()}
    return design.iolist.points["signal"].map(draws).fillna(0.0).astype(float)


def _loads(
    design: Layout,
    kinds: npt.NDArray[np.object_],
    beside: Sequence[int],
    on_asi: Bools,
    index: Mapping[str, int],
    ends: set[int],
) -> tuple[Floats, Floats, Bools]:
    """Return each node's load [A], voltage drop to its worst point [V], and whether it has 24 V."""
    settings, limits, count = design.settings, design.settings.supply, len(kinds)
    listed, cable_types = design.iolist.points, cables()
    load, spur = np.zeros((2, _LAYERS * count))
    # A point on doubled AS-i lines loads both.
    drops = design.cables[design.cables["kind"] == "drop"]
    row = dict(zip(listed["tag"], range(len(listed)), strict=True))
    point = np.array([row[tag] for tag in drops["b"]], np.intp)
    device = np.array([index[name] for name in drops["a"]], np.intp)
    amps = point_currents(design).to_numpy()[point]
    share = np.where(listed["signal"].map(LOADS) == "solenoid", limits.simultaneity, 1.0)[point]
    asi = (design.points["bus"] == "AS-i").to_numpy()[point]
    types = listed["type"].to_numpy(object)[point]
    # The line itself feeds its modules, except their digital outputs.
    from_line = asi & (types != "DO")
    loops = from_line & np.isin(types, ("AI", "AO"))
    np.add.at(load, device[loops], limits.loop)
    fed = (np.where(asi, _OUTPUTS, 0) * count + device)[~from_line]
    lost = amps * drops["length_m"].to_numpy(np.float64)
    lost *= np.array([cable_types[name].resistance for name in drops["cable"]], np.float64)
    np.add.at(load, fed, (amps * share)[~from_line])
    np.maximum.at(spur, fed, lost[~from_line])
    load[:count][kinds == "station"] += limits.station
    load[count : 2 * count], spur[count : 2 * count] = load[:count], spur[:count]
    fed_24 = np.concatenate([~on_asi, ~on_asi, np.ones(count, bool)])
    load[:count][on_asi & np.isin(kinds, ("module", "master", "repeater"))] += settings.asi.current
    load[count : 2 * count][on_asi] = 0.0
    for number in np.flatnonzero(on_asi & (kinds == "repeater")).tolist():
        # A repeater loads both sides; its master side may be at the node of the device beside it.
        node = number + count if number + count in ends else beside[number]
        load[node] += settings.asi.current if node >= 0 else 0.0
    return load, spur, fed_24


# Cable sizes of feeders, and devices that need a nearer supply -----------------------------------


class Feeders(NamedTuple):
    """Cable sizes of a design's feeders, and additional supplies."""

    #: Cable of each feeder, by the number of its run.
    cable: Mapping[int, str]
    #: Former supply of each run that is replaced by a supply beside the device at its far end.
    own: Mapping[int, int]
    #: Supplies that no longer feed any device.
    idle: Collection[int]
    #: Devices that violate a limit even with a supply beside them: name, value, limit and unit.
    weak: Sequence[tuple[str, float, float, str]]


def sized(design: Layout) -> Feeders:
    """Return the cheapest feeders that meet all limits, with thicker cables or more supplies.

    Each cross-section is tried with the fewest supplies, and the cheapest result is chosen. At
    constant currents, drops are proportional to resistance, so each tree is solved only once.
    """
    settings, trees = design.settings, forest(design)
    limits, kinds = settings.supply, design.cables["kind"].to_numpy(object)
    feeders = trees.fed[kinds[trees.run[trees.fed]] == "feeder"]
    if not len(feeders):
        return Feeders({}, {}, (), ())
    sizes = feeders_of(settings.feeder)
    tails = settings.tails
    cuts = [_cuts(trees, feeders.tolist(), cable, limits.rating, tails) for cable in sizes]
    spent = [
        _spent(design, trees, feeders, cable, np.array(cut, np.intp))
        for cable, cut in zip(sizes, cuts, strict=True)
    ]
    best = np.argmin(spent, axis=0)
    nearby = [
        node for size, cut in enumerate(cuts) for node in cut if best[trees.root[node]] == size
    ]
    nearer = {int(trees.run[node]): trees.supply[int(trees.root[node])] for node in nearby}
    heads = feeders[trees.parent[feeders] == trees.root[feeders]]
    feeding = {trees.supply[root] for root in trees.parent[np.setdiff1d(heads, nearby)].tolist()}
    trees = trees.cut(nearby, tails)
    trees = replace(trees, ohms=np.where(trees.metres > 0, 1.0, 0.0))
    (flow, _), (_, lost) = trees.solve(), trees.solve(short=True)
    roots = trees.root[feeders]
    # For each tree, the highest allowed resistance per metre and the largest current.
    left = (trees.allowed[feeders] - trees.spur[feeders]) / np.maximum(lost[feeders], 1e-12)
    most, into = np.full(len(flow), np.inf), np.zeros(len(flow))
    np.minimum.at(most, roots, left)
    np.maximum.at(into, roots, flow[feeders] + limits.short)
    fits = np.array(
        [(size.resistance <= most * (1 + 1e-12)) & (size.current >= into) for size in sizes]
    )
    chosen = np.where(fits.any(axis=0), fits.argmax(axis=0), len(sizes) - 1)
    names = design.devices["device"].to_numpy(object)[trees.device[feeders]]
    ohms = np.array([cable.resistance for cable in sizes])[chosen[roots]]
    total, volts = flow[roots] + limits.short, limits.voltage - trees.spur[feeders]
    over, under = total > limits.rating, ~fits[chosen, np.arange(len(chosen))][roots]
    comes = np.where(over, total, volts - lost[feeders] * ohms)
    bound = np.where(over, limits.rating, limits.voltage - trees.allowed[feeders])
    weak = [
        (str(names[n]), float(comes[n]), float(bound[n]), "A" if over[n] else "V")
        for n in np.flatnonzero(over | under).tolist()
    ]
    cable = {
        int(run): sizes[int(size)].id
        for run, size in zip(trees.run[feeders], chosen[roots], strict=True)
    }
    return Feeders(cable, nearer, set(nearer.values()) - feeding, weak)


def _spent(
    design: Layout, trees: Forest, feeders: Indices, cable: Cable, nearby: Indices
) -> Floats:
    """Return each tree's feeder cost for one cable and supplies at the nodes `nearby` [EUR].

    Prices are nominal values of the data files, so a plan does not depend on prices in settings.
    Moving a supply out of the cabinet costs as much as adding one, because it needs a housing.
    """
    settings, site, runs = design.settings, design.site, trees.metres
    price = {name: one.range.nominal for name, one in read_assumptions().items()}
    rate, mains = price["labour_rate"], cables()[settings.feeder]
    supply = price["supply"] + rate * price["part_time"]
    end = price["gland"] + rate * (price["gland_time"] + 2 * mains.termination.nominal)

    def metre(one: Cable) -> float:
        return price["laid_length"] * (one.price.nominal + rate * one.lay.nominal)

    spent = np.zeros(len(trees.root))
    np.add.at(spent, trees.root[feeders], metre(cable) * runs[feeders])
    places = design.devices[["x_m", "y_m", "z_m"]].to_numpy(float)[trees.device[nearby]]
    away = site.length(site.route(np.array(site.cabinet), places))
    more = supply + metre(cable) * (settings.tails - runs[nearby])
    np.add.at(spent, trees.root[nearby], more + settings.fed * (metre(mains) * away + 2 * end))
    return spent


def feeders_of(thinnest: str) -> list[Cable]:
    """Return a cable and all thicker single-pair cables, in order of cross-section."""
    types = cables()
    pairs = [c for c in types.values() if "hardwired" in c.buses and c.conductors == 2]
    thicker = [cable for cable in pairs if cable.section > types[thinnest].section]
    return [types[thinnest], *sorted(thicker, key=lambda cable: cable.section)]


def _cuts(
    trees: Forest, feeders: Sequence[int], cable: Cable, rating: float, tails: float
) -> list[int]:
    """Return the smallest set of nodes that need a supply of their own with a given cable.

    From the leaves up, a branch stays on its parent node if one supply can feed both.
    """
    parent, short = trees.parent.tolist(), trees.short.tolist()
    metres, allowed = trees.metres.tolist(), trees.allowed.tolist()
    flow, below = trees.load.tolist(), trees.spur.tolist()
    most = min(rating, cable.current)
    cut = []
    for node in reversed(feeders):
        above, into = parent[node], flow[node] + short[node]
        fall = max(below[above], below[node] + cable.resistance * metres[node] * into)
        total = flow[above] + flow[node] + short[node]
        head = parent[above] < 0
        ends = 0.0 if head else cable.resistance * tails * total
        if into > most or total > (rating if head else most) or fall + ends > allowed[node]:
            cut.append(node)
        else:
            flow[above] += flow[node]
            below[above] = fall
    return cut


# Two tables: the supplies of a design, and the devices that they feed ----------------------------


def supply_tables(design: Layout) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Return two tables: one row per supply, and one row per fed device and line."""
    trees, devices, runs = forest(design), design.devices, design.cables
    (flow, drop), (_, shorted) = trees.solve(), trees.solve(short=True)
    line = devices["segment"].isin(design.segments.query("bus == 'AS-i'")["segment"])
    is_supply = devices["kind"].isin(["supply", "auxiliary supply"])
    of_line = (line & (devices["kind"] == "supply"))[is_supply]
    limits, asi = design.settings.supply, design.settings.asi
    current = {supply: flow[root] for root, supply in trees.supply.items()}
    supplies = devices[is_supply].assign(
        voltage_v=np.where(of_line, asi.voltage, limits.voltage),
        rating_a=np.where(of_line, asi.rating, limits.rating),
        current_a=pd.Series(current, dtype=float),
    )
    supplies = supplies.fillna({"current_a": 0.0})

    nodes = np.sort(trees.fed)
    supply = [trees.supply[root] for root in trees.root[nodes].tolist()]
    source, cable_rows = supplies.loc[supply], runs.iloc[trees.run[nodes]]
    volts = source["voltage_v"].to_numpy(float)
    spur, types = trees.spur[nodes], cables()
    table = pd.DataFrame(
        {
            "device": devices["device"].to_numpy(object)[trees.device[nodes]],
            "segment": source["segment"].to_numpy(object),
            "line": cable_rows["line"].to_numpy(object),
            "supply": source["device"].to_numpy(object),
            "run": cable_rows["run"].to_numpy(object),
            "length_m": cable_rows["length_m"].to_numpy(float),
            "cross_section_mm2": [types[name].section for name in cable_rows["cable"]],
            "load_a": trees.load[nodes],
            "current_a": flow[nodes],
            "voltage_v": volts - drop[nodes],
            "lowest_v": volts - drop[nodes] - spur,
            "shorted_v": volts - shorted[nodes] - spur,
            "needed_v": volts - trees.allowed[nodes],
        }
    )
    margin = table["lowest_v"] - table["needed_v"]
    worst = table.loc[margin.groupby(table["supply"]).idxmin()].set_index("supply")
    feeding = table.groupby("supply").agg({"length_m": "sum", "cross_section_mm2": "max"})
    feeding = feeding.join(worst[["device", "lowest_v", "needed_v"]])
    feeding = feeding.rename(columns={"device": "worst_device"})
    feeding = feeding.assign(devices=table["supply"].value_counts())
    supplies = supplies.rename(columns={"device": "supply"}).join(feeding, on="supply")
    supplies = supplies.assign(drop_v=supplies["voltage_v"] - supplies["lowest_v"])
    return supplies[_SUPPLIES].reset_index(drop=True), table


_SUPPLIES = (
    "supply kind segment at x_m y_m z_m voltage_v current_a rating_a devices worst_device drop_v "
    "lowest_v needed_v length_m cross_section_mm2"
).split()
