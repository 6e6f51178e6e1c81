import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components, dijkstra

from shipnet.asi import Profile
from shipnet.asi.network.elements import CableRun, Master, Repeater, Slave, Supply, Terminator
from shipnet.asi.network.graph import Groups, shortest_ways
from shipnet.asi.network.plan import Plan, structure_faults
from shipnet.asi.network.structures import behind, evenly, line, numbered, ring, star
from shipnet.errors import ArgumentError

EDGES = st.lists(
    st.tuples(st.integers(0, 8), st.integers(0, 8), st.integers(1, 50)), min_size=1, max_size=20
).map(lambda edges: list({frozenset((a, b)): (a, b, n) for a, b, n in edges if a != b}.values()))


@given(EDGES.filter(bool))
def test_groups_and_ways_are_those_of_scipy(edges):
    a, b, length = np.transpose(edges)
    graph = coo_array((length.astype(float), (a, b)), shape=(9, 9)).tocsr()
    _, label = connected_components(graph, directed=False)
    groups = Groups()
    for i, j, _ in edges:
        groups.join(str(i), str(j))
    for i in range(9):
        for j in range(9):
            assert (groups.leader(str(i)) == groups.leader(str(j))) == (label[i] == label[j])
    ways = shortest_ways([CableRun(str(i), str(j), n) for i, j, n in edges], str(a[0]))
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
            [Master("x")],
            [Supply("y")],
            [Slave("z", 1)],
            [Repeater("a", "b"), Repeater("a", "c"), Repeater("b", "d"), Repeater("a", "w")],
        )
    assert str(caught.value).split("; ") == [
        "cable b - a lies there already",
        "master at x: no cable reaches its node x",
        "supply at y: no cable reaches its node y",
        "slave 1 at z: no cable reaches its node z",
        "repeater a | b has both ends in one segment",
        "repeater b | d gives telegrams a second way around",
        "repeater a | w: no cable reaches its node w",
    ]


def test_segments_know_their_way_from_the_master():
    plan = behind(
        behind(line(100, [50]), "100 m", line(80, [80]), prefix="2/", first=2),
        "2/80 m",
        line(60, [60]),
        prefix="3/",
        first=3,
    )
    assert [segment.head for segment in plan.segments] == ["0 m", "2/0 m", "3/0 m"]
    assert [len(segment.way) for segment in plan.segments] == [0, 1, 2]
    assert [segment.lead for segment in plan.segments] == [0, 100, 180]
    assert [segment.reach for segment in plan.segments] == [100, 180, 240]
    assert [len(segment.onward) for segment in plan.segments] == [1, 1, 0]
    assert [len(segment.draws) for segment in plan.segments] == [3, 3, 2]
    assert len(plan.lines) == 1


def test_which_end_of_a_repeater_comes_first_does_not_matter():
    runs, devices = [CableRun("a", "b", 10), CableRun("c", "d", 20)], [Slave("d", 1)]
    there, back = (
        Plan(runs, [Master("a")], slaves=devices, repeaters=[Repeater(*ends)])
        for ends in (("b", "c"), ("c", "b"))
    )
    for one, other in zip(there.segments, back.segments, strict=True):
        assert (one.head, one.lead, one.reach) == (other.head, other.lead, other.reach)


def test_a_line_without_a_master_has_no_heads_and_two_lines_are_told_apart():
    plan = Plan([CableRun("a", "b", 10), CableRun("c", "d", 20)], [Master("c")])
    assert [segment.head for segment in plan.segments] == [None, "c"]
    assert [segment.line for segment in plan.segments] == [0, 1]
    assert plan.segments[0].reach == 0
    assert str(plan.segments[0]) == "segment at a"


def test_a_renamed_plan_is_the_same_plan():
    plan = behind(ring(90, [30, 60]), "30 m", star(20, [1, 2]), prefix="x ", first=5)
    moved = plan.renamed("y ")
    assert [s.length for s in moved.segments] == [s.length for s in plan.segments]
    assert moved.repeaters[0].a == "y 30 m"
    assert moved != plan


def test_the_structures_have_the_lengths_that_are_asked_for():
    assert line(100, evenly(100, 62)).segments[0].length == pytest.approx(100)
    assert star(90, [1.5] * 4, along=(30, 60)).segments[0].length == pytest.approx(96)
    assert ring(100, evenly(90, 9)).segments[0].length == pytest.approx(100)
    assert star(0, [5, 6]).segments[0].length == 11


@pytest.mark.parametrize("n", [0, 1, 31, 32, 45, 62])
def test_slaves_are_numbered_so_that_none_clashes(n):
    slaves = numbered(["x"] * n)
    assert len({slave.label for slave in slaves}) == n
    assert len({slave.address for slave in slaves}) == min(n, 31)
    assert all(slave.profile.extended == (n > 31) for slave in slaves)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: CableRun("a", "a", 5), "ends where it begins"),
        (lambda: CableRun("a", "b", 0), r"length of cable a - b is 0 m; it must be 0\.01"),
        (lambda: CableRun("a", "b", math.nan), "is nan m"),
        (lambda: CableRun("a", "b", "5"), "length of cable a - b is '5'"),
        (lambda: CableRun("a", "b", 5, "cat 5"), "is 'cat 5'; it must be one of as-i 0.75"),
        (lambda: CableRun("", "b", 5), "a node is ''"),
        (lambda: Master(" a"), "a node is ' a'"),
        (lambda: Master("a\nb"), "printable"),
        (lambda: Master(3), "a node is 3"),
        (lambda: Slave("a", 32), "address is 32"),
        (lambda: Slave("a", 1.0), "address is 1.0"),
        (lambda: Slave("a", 1, "C"), "half is 'C'"),
        (lambda: Slave("a", 1, profile="S-0.F"), "must be a Profile"),
        (lambda: Slave("a", 1, current=-0.1), "current of slave 1 at a is -0.1 A"),
        (lambda: Supply("a", voltage=230), "voltage of supply at a is 230 V"),
        (lambda: Repeater("a", "b", delay=math.inf), "delay of repeater a | b is inf s"),
        (lambda: Terminator("a", 0), "resistance of terminator at a is 0 ohm"),
        (lambda: Plan([]), "the plan has no cable"),
        (lambda: Plan([Master("a")]), "cables holds Master"),
        (lambda: line(100, [101]), "the slave is at 101 m"),
        (lambda: ring(100, []), "the last place on the ring is 0.0 m"),
        (lambda: ring(100, [100]), "must lie between 0 and 100 m"),
        (lambda: numbered(["a"] * 63), "there are 63 slaves"),
        (lambda: behind(line(9, [9]), "9 m", line(9, [9]), prefix=" 2"), "a node is ' 20 m'"),
        (lambda: behind(line(9, []), "9 m", line(9, []), prefix=""), "would have a node '0 m'"),
        (
            lambda: behind(line(9, []), "9 m", Plan([CableRun("a", "b", 1)]), prefix="2/"),
            "has 0 masters",
        ),
        (
            lambda: behind(line(9, []), "9 m", line(9, [9]), prefix="2/", first=32),
            "address is 32",
        ),
    ],
)
def test_what_makes_no_plan_is_refused(call, message):
    with pytest.raises(ArgumentError, match=message):
        call()


def test_profiles_of_numbered_slaves_have_four_inputs():
    assert numbered(["a"])[0].profile == Profile(0, 0xF)
    assert numbered(["a"] * 40)[0].profile == Profile(0, 0xA)


@pytest.mark.parametrize(("length", "n"), [(float("nan"), 5), (100, -1), (100, 1.5), (-1, 3)])
def test_places_need_a_length_and_a_number(length, n):
    with pytest.raises(ArgumentError, match=r"^(n|length) is"):
        evenly(length, n)
