"""The limits of each bus, checked again from the tables of a design alone."""

import re
from collections import Counter, defaultdict
from itertools import pairwise
from math import ceil

import networkx as nx
import numpy as np
import pandas as pd
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from shipnet import datasets
from shipnet.design.planning import OPTIONS

CLOSE = 1e-6


def check_everything(design, settings):
    """Assert everything that must hold for every design."""
    check_tables(design)
    check_points(design, settings)
    check_connection(design)
    check_lengths(design)
    for segment in design.segments.itertuples():
        network = Segment(design, segment, settings)
        {"AS-i": check_asi, "CAN": check_can, "Modbus RTU": check_modbus}[segment.bus](network)


def check_tables(design):
    """The tables name only existing devices, segments and points, and each name is unique."""
    points, devices, runs = design.points, design.devices, design.cables
    assert points["tag"].tolist() == design.iolist.points["tag"].tolist()
    assert (devices["kind"] == "cabinet").sum() == 1
    for names in (devices["device"], runs["run"], design.segments["segment"]):
        assert names.is_unique
    names, segments = set(devices["device"]), {"", *design.segments["segment"]}
    to_point = runs["kind"].isin(["drop", "home run"])
    assert names.issuperset([*runs["a"], *runs.loc[~to_point, "b"]])
    assert set(points["tag"]).issuperset(runs.loc[to_point, "b"])
    assert {"", *names}.issuperset([*points["device"], *devices["at"]])
    for table in (points, devices, runs):
        assert segments.issuperset(table["segment"])
    assert {"hardwired", "AS-i", "CAN", "Modbus RTU", ""}.issuperset(points["bus"])
    assert {"drop", "trunk", "home run", "feeder"}.issuperset(runs["kind"])
    assert {"", "A", "B"}.issuperset(runs["line"])
    assert ((runs["length_m"] >= 0) & np.isfinite(runs["length_m"])).all()
    assert runs["used"].between(0, runs["conductors"]).all()


def check_points(design, settings):
    """Every point is connected by one cable of its own, or has a reason."""
    points, runs = design.points, design.cables
    ends = Counter(runs.loc[runs["kind"].isin(["drop", "home run"]), "b"])
    reasons = set(design.reasons["subject"])
    line = dict(zip(design.devices["device"], design.devices["line"], strict=True))
    for point in points.itertuples():
        if point.fits:
            assert ends[point.tag] == (2 if line[point.device] == "A" else 1)
            assert point.device and point.bus
            assert point.tag not in reasons
            drops = runs[(runs["b"] == point.tag) & runs["kind"].isin(["drop", "home run"])]
            assert drops["a"].iloc[0] == point.device
        else:
            assert ends[point.tag] == 0
            assert point.tag in reasons
            assert not point.device and not point.bus and np.isnan(point.response_ms)
    need = design.iolist.points["update_ms"].fillna(1e3 * settings.update)
    fit = points["fits"]
    assert (points.loc[fit, "response_ms"] <= need[fit] + CLOSE).all()
    assert (design.reasons["text"].str.len() > 20).all()


def check_connection(design):
    """Every device and every point that fits is connected to the cabinet."""
    inside = design.devices[design.devices["at"] != ""]
    fit = design.points.loc[design.points["fits"], "tag"]
    names = pd.Index([*design.devices["device"], *fit])
    assert names.is_unique
    a = names.get_indexer([*design.cables["a"], *inside["at"]])
    b = names.get_indexer([*design.cables["b"], *inside["device"]])
    assert (a >= 0).all() and (b >= 0).all()
    graph = coo_array((np.ones(len(a)), (a, b)), shape=(len(names),) * 2)
    assert connected_components(graph, directed=False)[0] == 1


def check_lengths(design):
    """A cable between two places has the length computed by the site."""
    places = {d.device: (d.x_m, d.y_m, d.z_m) for d in design.devices.itertuples()}
    places |= {
        p.tag: (p.x_m, p.y_m, p.z_m) for p in design.iolist.points.itertuples() if p.x_m == p.x_m
    }
    repeaters = set(design.devices.loc[design.devices["kind"] == "repeater", "device"])
    for run in design.cables.itertuples():
        if np.isnan(run.route_m) or {run.a, run.b} & repeaters or run.line == "B":
            continue
        assert run.route_m == float(design.site.route(places[run.a], places[run.b])), run
        slack = run.length_m - design.site.detour * run.route_m
        assert abs(slack - design.site.tails) < CLOSE, run


class Segment:
    """A segment with its rows of each table."""

    def __init__(self, design, row, settings):
        self.row, self.settings, self.design = row, settings, design
        self.points = design.points[design.points["segment"] == row.segment]
        self.devices = design.devices[design.devices["segment"] == row.segment]
        if row.bus == "AS-i":
            check_both_lines(design, row.segment)
            self.devices = self.devices[self.devices["line"] != "B"]
        runs = design.cables[design.cables["segment"] == row.segment]
        self.trunk = runs[(runs["kind"] == "trunk") & (runs["line"] != "B")]
        self.second = runs[(runs["kind"] == "trunk") & (runs["line"] == "B")]
        table = design.iolist.points.loc[self.points.index]
        self.type = table["type"]
        self.need = table["update_ms"].fillna(1e3 * settings.update) / 1e3
        assert len(self.points) == row.points > 0
        need, late = 1e3 * self.need, self.points["response_ms"]
        shown = (late - row.response_ms).abs() + (need - row.slowest_update_ms).abs() < CLOSE
        assert shown.any() and abs((late / need)[shown].max() - (late / need).max()) < CLOSE
        assert 0 < row.bus_time <= 1 and 0 < row.capacity_used <= 1

    def count(self, kind):
        return int((self.devices["kind"] == kind).sum())


def check_both_lines(design, segment):
    """Line B of a doubled AS-i segment is a copy of line A, and each point is wired to both."""
    for table, names in ((design.devices, ["device", "at"]), (design.cables, ["run", "a", "b"])):
        rows = table[table["segment"] == segment]
        first, second = (rows[rows["line"] == line].reset_index(drop=True) for line in "AB")
        assert (len(second) > 0) == (design.name == "AS-i doubled" or len(first) > 0)
        first = first.replace({name: {r" A( \(\d+\))?$": r" B\1"} for name in names}, regex=True)
        pd.testing.assert_frame_equal(first.drop(columns="line"), second.drop(columns="line"))


def check_chain(segment, longest):
    """The trunk runs from the master past each station once, and so does the second line."""
    doubled = len(segment.second) > 0
    assert segment.design.name not in OPTIONS or segment.design.name.endswith("doubled") == doubled
    lines = [segment.trunk, segment.second] if doubled else [segment.trunk]
    for trunk in lines:
        assert len(trunk) == segment.count("station")
        assert trunk["length_m"].sum() <= longest + CLOSE
        assert set(trunk["b"]) == set(
            segment.devices.loc[segment.devices["kind"] == "station", "device"]
        )
    assert segment.count("master") == len(lines)
    assert segment.count("terminator") == 2 * len(lines)
    longer = max(trunk["length_m"].sum() for trunk in lines)
    assert segment.row.length_m >= longer - CLOSE


def check_can(segment):
    """Check bits (no overlap), station and update time per message, load, nodes and length."""
    limits = segment.settings.can
    table = datasets.read("can_bus_lengths.csv").astype({"bit_rate_kbit_per_s": float})
    reach = table.loc[table["bit_rate_kbit_per_s"] * 1e3 >= segment.row.bit_rate, "length_m"]
    check_chain(segment, reach.astype(float).max())
    assert segment.count("station") + 1 <= limits.nodes
    bits = defaultdict(set)
    about = defaultdict(set)
    for point in segment.points.itertuples():
        identifier, bit = re.fullmatch(r"(0x[0-9a-f]+) bit (\d+)", point.address).groups()
        kind = segment.type[point.Index]
        taken = set(range(int(bit), int(bit) + (16 if kind[0] == "A" else 1)))
        assert not taken & bits[identifier] and max(taken) < 64
        bits[identifier] |= taken
        about[identifier].add((point.device, kind[1], segment.need[point.Index]))
    assert all(len(kinds) == 1 for kinds in about.values())
    assert len(bits) == segment.row.messages
    load, order = 0.0, {}
    for identifier, taken in bits.items():
        ((_, _, need),) = about[identifier]
        frame = (55 + 10 * ceil(max(taken) / 8 + 1e-9)) / segment.row.bit_rate
        load += frame / (limits.period_share * need)
        order[int(identifier, 16)] = need
    assert abs(load - segment.row.bus_time) < 1e-9 and load <= limits.load + 1e-9
    nodes = (segment.count("station") + 1) / limits.nodes
    assert abs(segment.row.capacity_used - max(load, nodes)) < 1e-9
    assert all(order[a] <= order[b] for a, b in pairwise(sorted(order)))


def check_modbus(segment):
    """Check unit ids, registers (no overlap), unit loads and length; compute the scan by hand."""
    limits = segment.settings.modbus
    check_chain(segment, limits.length * (1 + limits.repeaters))
    stations = segment.count("station")
    assert stations <= limits.units
    repeaters = segment.count("repeater") // (2 if len(segment.second) else 1)
    assert repeaters == segment.row.repeaters <= limits.repeaters
    assert stations + 1 + 2 * repeaters <= limits.unit_loads * (1 + repeaters)
    units = defaultdict(lambda: {"input": set(), "holding": set()})
    devices = defaultdict(set)
    for point in segment.points.itertuples():
        unit, kind, register, _, bit = re.fullmatch(
            r"(\d+) (input|holding) register (\d+)( bit (\d+))?", point.address
        ).groups()
        analogue, output = segment.type[point.Index][0] == "A", segment.type[point.Index][1] == "O"
        assert (bit is None) == analogue and (kind == "holding") == output
        bit_place = (int(register), -1 if bit is None else int(bit))
        assert bit_place not in units[unit][kind] and bit_place[1] < 16
        units[unit][kind].add(bit_place)
        devices[unit].add(point.device)
    assert sorted(map(int, units)) == list(range(1, stations + 1))
    assert all(len(names) == 1 for names in devices.values())
    character = 11 / segment.row.bit_rate
    silence = 1.75e-3 if segment.row.bit_rate > 19200 else 3.5 * character
    scan, slowest, given_up, on_wire = 0.0, {}, 0.0, 0.0
    for unit, kinds in units.items():
        times = []
        # Function 4: 8 bytes, then 5 plus 2 per register; 16: 9 plus 2 per register, then 8.
        for kind, fixed in (("input", 13), ("holding", 17)):
            count = len({register for register, _ in kinds[kind]})
            if count:
                bytes_ = fixed + 2 * count
                on_wire += bytes_ * character
                times.append(bytes_ * character + 2 * silence + limits.processing)
        # A request that writes has 9 bytes plus 2 per register, one that reads has 8.
        written = len({register for register, _ in kinds["holding"]})
        waiting = limits.timeout + limits.processing + 256 * character
        given_up += (9 + 2 * written if written else 8) * character + waiting
        scan += sum(times)
        slowest[unit] = max(times)
    assert abs(1e3 * scan - segment.row.scan_ms) < CLOSE
    assert abs(on_wire / scan - segment.row.bus_time) < 1e-9
    room = min(limits.units, (1 + limits.repeaters) * (limits.unit_loads - 2) + 1)
    used = max(scan / segment.need.min(), stations / room)
    assert abs(used - segment.row.capacity_used) < 1e-9
    if len(segment.second):
        assert abs(1e3 * (scan + given_up) - segment.row.switch_over_ms) < CLOSE
    else:
        assert np.isnan(segment.row.switch_over_ms)
    for point in segment.points.itertuples():
        response = scan + slowest[point.address.split()[0]]
        assert abs(1e3 * response - point.response_ms) < CLOSE
    slower = [rate for rate in limits.bit_rates if rate < segment.row.bit_rate]
    assert segment.row.bit_rate in limits.bit_rates and (not slower or segment.row.scan_ms > 0)


def check_asi(segment):
    """Check addresses, ports, cable and repeaters in series; compute the cycle by hand."""
    limits = segment.settings.asi
    modules = segment.points.groupby("device")
    labels, ports = {}, defaultdict(list)
    for device, points in modules:
        label, *_ = {address.split()[0] for address in points["address"]}
        assert all(address.split()[0] == label for address in points["address"])
        labels[device] = label
        ports[device] = [address.split()[1] for address in points["address"]]
    assert len(set(labels.values())) == len(labels) == segment.row.slaves == segment.count("module")
    parts, before = _asi_parts(segment)
    on_address, delays = defaultdict(list), defaultdict(list)
    for device, label in labels.items():
        number, half = re.fullmatch(r"(\d+)([AB]?)", label).groups()
        on_address[int(number)].append(half)
        # A repeater delays a request and its response by 6 us each.
        delays[int(number)].append(12e-6 * before[device])
    assert set(on_address) <= set(range(1, 32))
    for halves in on_address.values():
        assert sorted(halves) in ([""], ["A"], ["A", "B"])
        assert limits.shared or halves == [""]
    assert len(labels) <= (62 if limits.shared else 31)
    # The status request may go to the slave with the longest delay.
    without_delays = 156e-6 * (len(on_address) + 2) + max(map(max, delays.values()))
    cycle = without_delays + sum(map(max, delays.values()))
    two_cycles = 2 * without_delays + sum(2 * sum(pair) / len(pair) for pair in delays.values())
    assert abs(segment.row.cycle_ms - 1e3 * cycle) < CLOSE
    # 21 bits per exchange, management included; the search for a new slave is not answered.
    bits = 21 * (len(on_address) + 1) + 14
    assert abs(bits * 6e-6 / cycle - segment.row.bus_time) < 1e-9
    used = [len(on_address) / 31]
    for device, points in modules:
        (number, _), names = re.fullmatch(r"(\d+)([AB]?)", labels[device]).groups(), ports[device]
        both = 2 if len(on_address[int(number)]) > 1 else 1
        # Seven exchanges per value; outputs of an A/B slave take two.
        turns = 7 * len(names) if names[0][0] == "A" else 1
        if limits.shared and any(name[0] == "Q" for name in names):
            turns = 2
        cycles = both * turns
        time = cycles // 2 * two_cycles + cycles % 2 * cycle
        used.append(time / segment.need[points.index].min())
    assert abs(max(used) - segment.row.capacity_used) < 1e-9
    for device, names in ports.items():
        assert len(set(names)) == len(names)
        kinds = Counter(re.sub(r"\d", "", name) for name in names)
        assert kinds["I"] <= limits.inputs and kinds["Q"] <= limits.outputs
        assert kinds["AI"] + kinds["AQ"] <= limits.channels
        assert not (kinds["AI"] + kinds["AQ"] and (len(kinds) > 1 or labels[device][-1] in "AB"))
    assert max(parts) <= limits.length + CLOSE
    assert abs(sum(parts) - segment.row.length_m) < 0.02 * len(segment.trunk)
    assert max(before.values()) <= limits.repeaters
    assert segment.count("supply") == len(parts)
    assert segment.row.supply_current_a <= 8 and segment.row.lowest_v >= 26.5 - CLOSE


def _asi_parts(segment):
    """Return the cable of each electrical segment, and the number of repeaters before each node."""
    repeaters = segment.devices[segment.devices["kind"] == "repeater"].set_index("device")["at"]
    graph = nx.Graph()
    line = nx.Graph()
    for run in segment.trunk.itertuples():
        a = f"{run.a} out" if run.a in repeaters else run.a
        b = f"{run.b} in" if run.b in repeaters else run.b
        graph.add_edge(a, b, length=run.length_m)
        line.add_edge(run.a, run.b)
    for name, at in repeaters.items():
        if at:
            master = segment.devices.loc[segment.devices["kind"] == "master", "device"].item()
            line.add_edge(name, master if at == segment.design.cabinet else at)
    parts = [
        sum(length for *_, length in graph.subgraph(part).edges(data="length"))
        for part in nx.connected_components(graph)
    ]
    master = segment.devices.loc[segment.devices["kind"] == "master", "device"].item()
    if master not in graph:
        parts.append(0.0)
        line.add_node(master)
    ways = nx.single_source_shortest_path(line, master)
    assert set(ways) >= set(segment.points["device"])
    return parts, {end: sum(node in repeaters for node in way[:-1]) for end, way in ways.items()}
