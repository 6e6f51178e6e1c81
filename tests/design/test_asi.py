"""AS-i lines: cables and repeaters, positions of supplies, and response times."""

from collections import Counter
from dataclasses import replace
from itertools import combinations, pairwise

import networkx as nx
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.distance import cdist

from shipnet.asi.master import Master
from shipnet.asi.plan import Plan
from shipnet.asi.segment import Supply
from shipnet.asi.slave import Slave
from shipnet.asi.timing import Cycle, Transaction
from shipnet.design import drafting
from shipnet.design.costs import bill_table
from shipnet.design.layout import Site
from shipnet.design.plan_asi import Piece, draw, place_supply, response
from shipnet.design.planning import plan
from shipnet.design.settings import Settings
from shipnet.line.cable import CABLES
from shipnet.line.network import CableRun
from tests.design.checks import check_everything
from tests.design.lists import table

LIMITS = Settings().asi


def between(places):
    """Return the distances between places along a line."""
    x = np.asarray(places, dtype=float)
    return abs(x - x[:, None])


def fewest_repeaters(edges, length, limits):
    """Return the fewest repeaters of a line, by trying all ways to divide it into segments.

    The cable to each module continues a segment of the module before, or begins one there. The
    plan has one supply per segment, so the fewest repeaters also need the fewest supplies.
    """

    def powered(segment):
        # The voltage at each module, for a supply at the best of all places.
        graph, current = nx.Graph(), 0.065
        graph.add_weighted_edges_from((a, b, length[b]) for a, b in segment["edges"])
        drawn = Counter([*graph, segment["edges"][0][0], *segment["begun"]])
        ways = dict(nx.all_pairs_shortest_path(graph))
        cables = {
            (a, b): {frozenset(run) for run in pairwise(ways[a][b])} for a in ways for b in ways
        }
        metres = {frozenset(edge): length[edge[1]] for edge in segment["edges"]}
        drop = min(
            max(
                sum(
                    amps * metres[run]
                    for b, amps in drawn.items()
                    for run in cables[supply, a] & cables[supply, b]
                )
                for a in graph
            )
            for supply in graph
        )
        lowest = limits.voltage - CABLES["as-i 1.5"].resistance * current * drop
        return drawn.total() * current <= limits.rating and lowest >= 26.5

    def divides(rest, segments, at, left):
        if not rest:
            return all(powered(segment) for segment in segments)
        near, far = rest[0]
        for segment in at[near]:
            if sum(length[b] for _, b in segment["edges"]) + length[far] <= limits.length:
                segment["edges"].append(rest[0])
                if divides(rest[1:], segments, {**at, far: [segment]}, left):
                    return True
                segment["edges"].pop()
        before = at[near][0]
        if left == 0 or before["series"] == limits.repeaters:
            return False
        begun = {"edges": [rest[0]], "begun": [], "series": before["series"] + 1}
        before["begun"].append(near)
        at = {**at, near: [*at[near], begun], far: [begun]}
        if divides(rest[1:], [*segments, begun], at, left - 1):
            return True
        before["begun"].pop()
        return False

    for repeaters in range(len(edges)):
        first = {"edges": [], "begun": [], "series": 0}
        if divides(edges, [first], {0: [first]}, repeaters):
            return repeaters
    return None


def scattered(seed, span=(90, 30, 10)):
    """Return 8 to 20 places, and the shortest tree from the cabinet past them."""
    rng = np.random.default_rng(seed)
    places = rng.uniform(-np.array([0, 30, 0]), span, (rng.integers(8, 21), 3)).round(2)
    graph = nx.Graph()
    for (a, start), (b, end) in combinations(enumerate([np.zeros(3), *places]), 2):
        graph.add_edge(a, b, weight=abs(start - end).sum())
    edges = list(nx.dfs_edges(nx.minimum_spanning_tree(graph), 0))
    return places, edges, {b: graph.edges[a, b]["weight"] for a, b in edges}


# Lists that one line can serve, with 2 to 5 repeaters.
@pytest.mark.parametrize("seed", [0, 5, 7, 14, 18, 22, 28, 30, 39, 55])
def test_repeaters_and_supplies_are_as_few_as_brute_force_finds(seed):
    places, edges, length = scattered(seed)
    rows = [("contact", place, 1000) for place in places.tolist()]
    design = plan(
        table(rows), Site((0, 0, 0), detour=1, tails=0), "AS-i", settings=Settings({"asi.reach": 0})
    )
    kinds = Counter(design.devices["kind"])
    assert design.fits and kinds["module"] == len(places) and kinds["master"] == 1
    assert kinds["repeater"] == fewest_repeaters(edges, length, LIMITS)
    assert kinds["supply"] == kinds["repeater"] + 1


@settings(max_examples=100)
@given(
    st.lists(st.tuples(st.integers(-90, 90), st.integers(-90, 90)), min_size=1, max_size=9),
    st.sampled_from([60, 100, 250]),
    st.integers(0, 3),
    st.booleans(),
)
def test_a_line_is_divided_within_its_limits_into_the_fewest_segments(places, most, series, tree):
    limits = Settings({"asi.length": most, "asi.repeaters": series, "asi.tree": tree}).asi
    ways = cdist([(0, 0), *places], [(0, 0), *places], "cityblock")
    drawn = draw(ways, ways, limits)
    edges = drafting.tree(ways) if tree else list(pairwise(drafting.chain(ways)))
    length = {far: max(ways[near, far], 0.01) for near, far in edges}
    if max(length.values()) <= most:
        fewest = fewest_repeaters(edges, length, limits)
        assert fewest == (None if drawn is None else len(drawn.repeaters))
    if drawn is None:
        return
    depth = {"0": 0}
    for into, out in drawn.repeaters:
        depth[out] = (
            depth[
                next(
                    h
                    for h, own in drawn.segments.items()
                    if into in {h, *(piece.far for piece in own)}
                )
            ]
            + 1
        )
    assert set(depth) == set(drawn.segments) and max(depth.values()) <= series
    for head, segment in drawn.segments.items():
        assert sum(piece.length for piece in segment) <= most + 1e-9
        graph = nx.Graph([(piece.near, piece.far) for piece in segment])
        assert nx.is_tree(graph) and head in graph
    assert {piece.far for piece in drawn.pieces} >= {str(far) for _, far in edges}
    for near, far in edges:
        own = [piece for piece in drawn.pieces if piece.edge == (near, far)]
        assert sum(piece.length for piece in own) == pytest.approx(length[far])
        assert sum(piece.share for piece in own) == pytest.approx(1)


@pytest.mark.parametrize(
    ("places", "repeaters"),
    [((0, 100), 0), ((0, 101), 1), ((0, 200), 1), ((0, 201), 2), ((0, 300), 2)],
)
def test_a_long_cable_has_a_repeater_every_100_m(places, repeaters):
    assert len(draw(between(places), between(places), LIMITS).repeaters) == repeaters


def test_a_cable_longer_than_repeaters_in_series_allow_is_refused_with_its_length():
    assert draw(between((0, 301)), between((0, 301)), LIMITS) is None
    far = table([("contact", (301, 0, 0), 1000)])
    design = plan(far, Site((0, 0, 0), detour=1, tails=0), "AS-i")
    (reason,) = design.reasons.itertuples()
    assert (reason.limit, reason.value, reason.bound) == ("length", 301, 300)


def test_a_line_of_many_branches_is_divided_in_little_time():
    # 60 cables of 10 to 20 m from the cabinet: comparing all divisions would take years.
    spokes = np.concatenate([[0], np.random.default_rng(1).uniform(10, 20, 60)])
    ways = (spokes[:, None] + spokes) * (1 - np.eye(61))
    drawn = draw(ways, ways, LIMITS)
    assert len(drawn.repeaters) == -(-spokes.sum() // 100) - 1


@settings(max_examples=30)
@given(
    st.lists(st.integers(1, 20), min_size=1, max_size=7),
    st.lists(st.sampled_from([0.0, 0.065, 0.5]), min_size=8, max_size=8),
)
def test_the_supply_is_where_the_voltage_drop_is_least(hops, currents):
    places = np.cumsum([0, *hops])
    pieces = [
        Piece(str(a), str(b), (a, b), float(places[b] - places[a]), 1.0)
        for a, b in pairwise(range(len(places)))
    ]
    draws = {str(n): currents[n] for n in range(len(places))}
    # At 20 V no place is good enough, so none is preferred.
    found = place_supply(pieces, draws, 20.0, CABLES["as-i 1.5"].resistance)

    def lowest(node):
        circuit = Plan(
            [CableRun(p.near, p.far, p.length) for p in pieces],
            [Master(node="0", current=currents[0])],
            [Supply(node)],
            [Slave(str(n), node=str(n), current=currents[n]) for n in range(1, len(places))],
        )
        volts = circuit.voltages
        return min(volts[node] for node in draws if draws[node] > 0 or node == found)

    # The circuit is solved with its own resistances; 0.1 mV allows for rounding.
    assert lowest(found) >= max(map(lowest, draws)) - 1e-4


def test_the_supply_stays_in_the_cabinet_while_the_voltage_allows_it():
    near, far = (
        plan(table([("contact", (x, 0, 0), 1000)] * n), Site((0, 0, 0)), "AS-i")
        for x, n in ((50, 4), (80, 160))
    )
    assert near.devices.loc[near.devices["kind"] == "supply", "at"].tolist() == ["cabinet"]
    assert "feeder" not in set(near.cables["kind"])
    supplies = far.devices[far.devices["kind"] == "supply"]
    feeders = far.cables[far.cables["kind"] == "feeder"]
    assert feeders["at_cabinet"].all() and len(feeders) > 0
    assert set(feeders["b"]) == set(supplies.loc[supplies["at"] != "cabinet", "device"])
    assert (far.segments["lowest_v"] >= 26.5).all()


def test_response_times_agree_with_the_published_cycles():
    full = Cycle(31)
    # Alone at its address: one cycle, the response and a repetition; shared: two cycles. On a
    # disturbed line, a transaction with a slave out of step takes 28 bit times.
    assert response("S-0.A", full, LIMITS) == pytest.approx(5.784e-3)
    assert response("S-0.A", full, LIMITS, paired=True) == pytest.approx(11.328e-3)
    # Nord BU0090, p. 69: at most 21 ms to an A/B slave with four outputs.
    quick = Settings({"asi.conversion": 0, "asi.repetitions": 0}).asi
    late = response("S-7.A.7", full, quick, output=True, paired=True)
    assert late == pytest.approx(21e-3, rel=0.02)
    # ifm: seven cycles of 5 ms per value; a round of four values, then its own value once more.
    five = Cycle(1, transaction=Transaction(bit_time=5e-3 / 3 / 26))
    assert response("S-7.3", five, quick, channels=4) == pytest.approx(5 * 35e-3)


def test_slow_points_share_addresses():
    needs = [1000.0] * 31 + [8.0]
    rows = [
        ("contact", (10 + 12 * (n % 8), 12 * (n // 8), 0), need) for n, need in enumerate(needs)
    ]
    design = plan(table(rows), Site((0, 0, 0)), "AS-i", settings=Settings({"asi.length": 1000.0}))
    assert design.fits
    late = design.points["response_ms"]
    assert late.iloc[-1] < 8 < late.max() <= 10.6 or len(design.segments) > 1


def test_auxiliary_power_reaches_outputs_only():
    rows = [("solenoid", (30, 0, 0), 1000), ("contact", (60, 0, 0), 1000)]
    iolist = table(rows)
    both = plan(iolist, Site((0, 0, 0)), "AS-i")
    feeders = both.cables[both.cables["kind"] == "feeder"]
    assert feeders["a"].tolist() == ["AS-i 1 auxiliary supply"]
    assert feeders["at_cabinet"].tolist() == [True]
    supply = both.devices.set_index("device").loc["AS-i 1 auxiliary supply"]
    assert (supply["kind"], supply["at"]) == ("auxiliary supply", "cabinet")
    assert feeders["b"].item() == both.points["device"].iloc[0]
    none = plan(iolist, Site((0, 0, 0)), "AS-i", settings=Settings({"asi.auxiliary": False}))
    assert "feeder" not in set(none.cables["kind"])
    assert "auxiliary supply" not in set(none.devices["kind"])
    inputs = plan(table(rows[1:]), Site((0, 0, 0)), "AS-i")
    assert "auxiliary supply" not in set(inputs.devices["kind"])


def test_doubled_lines_have_twice_the_parts_of_a_single_line_and_no_cut_loses_a_point():
    rows = [("contact", 3), ("contact", 4), ("solenoid", 5), ("rtd_3wire", 60), ("contact", 130)]
    points = table([(signal, (x, 2, 3), 1000) for signal, x in rows])
    systems = points.points.assign(system=["Bilge", "Cooling"] * 2 + ["Fuel oil"], category="II")
    points = replace(points, points=systems)
    single, doubled = (plan(points, Site((0, 0, 0)), way) for way in ("AS-i", "AS-i doubled"))
    check_everything(doubled, Settings())
    # By hand: one line of 133 m past three modules, with a repeater and a second supply at it.
    parts = {"master": 1, "module": 3, "supply": 2, "auxiliary supply": 1, "repeater": 1}
    runs = {"trunk": 3, "drop": 5, "feeder": 2}
    for design, lines in ((single, 1), (doubled, 2)):
        devices, cables = Counter(design.devices["kind"]), Counter(design.cables["kind"])
        assert devices == {"cabinet": 1, **{kind: lines * n for kind, n in parts.items()}}
        assert cables == {kind: lines * n for kind, n in runs.items()}
        worst = design.failures().query("kind != 'cabinet'").groupby("failure")["points_lost"].max()
        assert worst.to_dict() == dict.fromkeys(("cut", "short", "device"), 5 if lines == 1 else 0)
        verdict = design.check("IMO").table().set_index("rule")["verdict"]["shared link redundant"]
        assert verdict == ("met" if lines == 2 else "violated")
    bill = [bill_table(design).set_index("item")["number"] for design in (single, doubled)]
    assert (bill[1] / bill[0]).to_numpy() == pytest.approx(2)
    # Both lines are needed: a cut on each loses the points beyond both.
    assert doubled.lost(cables=["AS-i 1 trunk 3 A", "AS-i 1 trunk 3 B"]) == ("P4",)
    both = ["AS-i 1 supply A", "AS-i 1 master B"]
    assert doubled.lost(devices=both) == single.lost(devices=["AS-i 1 supply"]) != ()


def test_a_line_that_violates_a_signal_rule_is_refused_with_the_rule():
    limits = Settings({"asi.voltage": 20.0})
    design = plan(table([("contact", (30, 0, 0), 1000)]), Site((0, 0, 0)), "AS-i", settings=limits)
    (reason,) = design.reasons.itertuples()
    assert not design.fits
    assert (reason.limit, reason.value, reason.bound) == ("supply voltage", 20.0, 29.5)
    assert reason.text == (
        "P0 does not meet the AS-i limit on supply voltage even on its own line: 20 V; "
        "the limit is 29.5 V"
    )


def test_the_voltage_drop_is_that_of_the_chosen_cable():
    far = table([("rtd_3wire", (90 + n, 0, 0), 1000.0) for n in range(8)])
    lowest = {
        cable: plan(far, Site((0, 0, 0)), "AS-i", settings=Settings({"asi.cable": cable}))
        .segments["lowest_v"]
        .min()
        for cable in ("ASI_MARINE", "ASI_FLAT25")
    }
    assert lowest["ASI_FLAT25"] > lowest["ASI_MARINE"]
