import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components, dijkstra

from shipnet import datasets
from shipnet.asi.master import Master
from shipnet.asi.plan import Plan, read_plan
from shipnet.asi.segment import (
    Groups,
    Repeater,
    Supply,
    Terminator,
    shortest_paths,
    structure_faults,
)
from shipnet.asi.slave import Slave
from shipnet.asi.timing import cycle_time
from shipnet.asi.topologies import assign_addresses, evenly_spaced, line, star
from shipnet.errors import ArgumentError
from shipnet.line.network import CableRun

EDGES = st.lists(
    st.tuples(st.integers(0, 8), st.integers(0, 8), st.integers(1, 50)), min_size=1, max_size=20
).map(lambda edges: list({frozenset((a, b)): (a, b, n) for a, b, n in edges if a != b}.values()))


@given(EDGES.filter(bool))
def test_groups_and_paths_are_those_of_scipy(edges):
    a, b, length = np.transpose(edges)
    graph = coo_array((length.astype(float), (a, b)), shape=(9, 9)).tocsr()
    _, label = connected_components(graph, directed=False)
    groups = Groups()
    for i, j, _ in edges:
        groups.join(str(i), str(j))
    for i in range(9):
        for j in range(9):
            assert (groups.leader(str(i)) == groups.leader(str(j))) == (label[i] == label[j])
    ways = shortest_paths([CableRun(str(i), str(j), n) for i, j, n in edges], str(a[0]))
    expected = dijkstra(graph, directed=False, indices=a[0])
    assert ways == {str(k): way for k, way in enumerate(expected) if math.isfinite(way)}


@given(EDGES.filter(bool))
def test_a_segment_has_at_most_one_ring_whatever_the_order_of_cables(edges):
    runs = [CableRun(str(i), str(j), n) for i, j, n in edges]
    a, b, length = np.transpose(edges)
    graph = coo_array((length, (a, b)), shape=(9, 9)).tocsr()
    count, label = connected_components(graph, directed=False)
    rings = [int((label[a] == k).sum()) - int((label == k).sum()) + 1 for k in range(count)]
    faults = structure_faults(runs)
    assert len(faults) == sum(max(0, number - 1) for number in rings)
    assert all("closes a second ring" in fault for _, fault in faults)


def test_all_faults_of_a_plan_are_named_at_once():
    runs = [CableRun("a", "b", 1), CableRun("b", "a", 2), CableRun("c", "d", 1)]
    with pytest.raises(ArgumentError) as caught:
        Plan(
            runs,
            [Master(node="x")],
            [Supply("y")],
            [Slave("1", node="z")],
            [Repeater("a", "b"), Repeater("a", "c"), Repeater("b", "d"), Repeater("a", "w")],
        )
    assert str(caught.value).split("; ") == [
        "cable b - a joins two nodes that another cable already joins",
        "master at x: no cable reaches its node x",
        "supply at y: no cable reaches its node y",
        "slave 1 at z: no cable reaches its node z",
        "repeater a | b has both ends in one segment",
        "repeater b | d makes a second path for telegrams",
        "repeater a | w: no cable reaches its node w",
    ]


def test_segments_have_their_path_from_the_master():
    plan = line(100, [50]).with_repeater("100 m", line(80, [80]))
    plan = plan.with_repeater("2/80 m", line(60, [60]), prefix="3/")
    assert [slave.label for slave in plan.slaves] == ["1", "2", "3"]
    assert [segment.head for segment in plan.segments] == ["0 m", "2/0 m", "3/0 m"]
    assert [len(segment.path) for segment in plan.segments] == [0, 1, 2]
    assert [segment.lead for segment in plan.segments] == [0, 100, 180]
    assert [segment.reach for segment in plan.segments] == [100, 180, 240]
    onward = [len(segment.listeners) - len(segment.slaves) for segment in plan.segments]
    assert onward == [1, 1, 0]
    assert [len(segment.draws) for segment in plan.segments] == [3, 3, 2]
    assert len(plan.lines) == 1


def test_a_line_without_a_master_has_no_heads_and_lines_are_numbered():
    plan = Plan([CableRun("a", "b", 10), CableRun("c", "d", 20)], [Master(node="c")])
    assert [segment.head for segment in plan.segments] == [None, "c"]
    assert [segment.line for segment in plan.segments] == [0, 1]
    assert plan.segments[0].reach == 0
    assert str(plan.segments[0]) == "segment at a"


@pytest.mark.parametrize("n", [0, 1, 31, 32, 45, 62])
def test_slaves_are_numbered_so_that_none_clashes(n):
    slaves = star(10, [1.0] * n).slaves
    assert len({slave.label for slave in slaves}) == n
    assert len({slave.address for slave in slaves}) == min(n, 31)
    assert all(slave.profile.extended == (n > 31) for slave in slaves)


def test_the_last_slaves_share_addresses_or_those_that_can_wait():
    assert assign_addresses(4, pairs=1) == ["1", "2", "3A", "3B"]
    assert assign_addresses(33)[28:] == ["29A", "30A", "30B", "31A", "31B"][0:5]
    labels = assign_addresses(32, shares=[True] * 32, need=[2.0] * 2 + [1.0] * 30)
    assert labels[:3] == ["31A", "31B", "1A"]
    with pytest.raises(ArgumentError, match="need 32 addresses"):
        assign_addresses(32, shares=[False] * 32)
    with pytest.raises(ArgumentError, match=r"pairs is 3; it must be a whole number 0\.\.2"):
        assign_addresses(4, pairs=3)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: CableRun("a", "a", 5), "ends where it begins"),
        (lambda: CableRun("a", "b", 0), "length of cable a - b is 0 m"),
        (lambda: CableRun("a", "b", math.nan), "is nan m"),
        (lambda: CableRun("a", "b", "5"), "length of cable a - b is '5'"),
        (lambda: CableRun("a", "b", 5, "cat 5"), "is 'cat 5'; it must be a Cable or one"),
        (lambda: CableRun("", "b", 5), "a node is ''"),
        (lambda: Master(node=" a"), "a node is ' a'"),
        (lambda: Master(node="a\nb"), "printable"),
        (lambda: Master(node=3), "node is 3; it must be text"),
        (lambda: Slave(1), "label is 1; it must be text"),
        (lambda: Slave("1C"), "label is '1C'"),
        (lambda: Slave("1", "S-0"), "S-0"),
        (lambda: Slave("1", current=-0.1), "current is -0.1 A"),
        (lambda: Plan([CableRun("a", "b", 1)], slaves=[Slave("1")]), "slave 1 has no node"),
        (lambda: Supply("a", voltage=230), "voltage is 230 V"),
        (lambda: Repeater("a", "b", delay=math.inf), "delay is inf"),
        (lambda: Terminator("a", 0), "resistance is 0 ohm"),
        (lambda: Plan([]), "the plan has no cable"),
        (lambda: line(100, 63), "63 slaves need 32 addresses"),
        (lambda: line(9, 1).with_repeater("9 m", line(9, 1), prefix=" 2"), "is ' 20 m'"),
        (lambda: line(9).with_repeater("9 m", line(9), prefix=""), "would have a node '0 m'"),
        (lambda: line(9).with_repeater("9 m", Plan([CableRun("a", "b", 1)])), "has 0 masters"),
        (lambda: line(9, 31).with_repeater("9 m", line(9, 1)), "label is '32'"),
    ],
)
def test_what_is_not_a_plan_is_refused(call, message):
    with pytest.raises(ArgumentError, match=message):
        call()


def test_a_slave_has_four_inputs_by_default():
    assert str(Slave("1").profile) == "S-0.F.F"
    assert str(Slave("1B").profile) == "S-0.A.F"


def test_voltages_cycle_and_responses_of_a_plan():
    plan = line(100, 3, pairs=1)
    assert plan.voltages["0 m"] == 30
    assert plan.cycle.time == cycle_time(2)
    times = plan.response_times()
    assert times.index.tolist() == ["1", "2A", "2B"] and not times["why"].any()
    assert times.loc["1", "worst_s"] == pytest.approx(60e-6 + 4 * 156e-6)
    assert times.loc["2B", "worst_s"] == pytest.approx(60e-6 + 8 * 156e-6)
    module = Slave("1", "S-7.3.C", node="0 m", conversion=60e-3)
    unknown = Slave("2A", "S-7.A.9", node="0 m")
    times = Plan(plan.cables, slaves=[module, unknown]).response_times()
    assert times.loc["1", "worst_s"] == pytest.approx(2 * 7 * 4 * 156e-6 + 60e-3)
    assert times.loc["2A"].isna().tolist() == [True] * 4 + [False]
    assert "'S-7.A.9'; its number of exchanges" in times.loc["2A", "why"]
    with pytest.raises(ArgumentError, match="cycle needs a plan of one line; this one has 14"):
        _ = read_plan(datasets.path("synthetic_asi_plan_submarine.csv")).cycle


@pytest.mark.parametrize(("length", "n"), [(float("nan"), 5), (100, -1), (100, 1.5), (-1, 3)])
def test_places_need_a_length_and_a_number(length, n):
    with pytest.raises(ArgumentError, match=r"^(n|length) is"):
        evenly_spaced(length, n)
