from itertools import pairwise

import networkx as nx
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from shipnet import datasets
from shipnet.design.iolist import read_iolist
from shipnet.design.site import Site, Tray, Trays
from shipnet.errors import ArgumentError, InputError

SHIP = read_iolist(datasets.path("synthetic_iolist_ship.csv"))
TRAYS = Trays.read(datasets.path("synthetic_trays_ship.csv"))
SITE = Site(TRAYS.cabinets["engine control room"], TRAYS)


def nearest(trays, place):
    """Return the nearest tray, where on it and how far away, one tray after the other."""
    best = None
    for tray in trays.trays:
        a, b = (np.array(trays.nodes[end], float) for end in (tray.a, tray.b))
        share = min(max(np.dot(place - a, b - a) / np.dot(b - a, b - a), 0), 1)
        point = a + share * (b - a)
        off = np.abs(place - point).sum()
        if best is None or off < best[2] - 1e-12:
            best = tray, point, off
    return best


def by_networkx(trays, a, b, avoid=()):
    """Return length and trays of the way between two places, with both as nodes of the graph."""
    a, b = np.array(a, float), np.array(b, float)
    one, other = nearest(trays, a), nearest(trays, b)
    direct = np.abs(a - b).sum()
    if direct <= one[2] + other[2]:
        return direct, ()
    graph = nx.MultiGraph()

    def join(name, p, q, tray):
        length = float(np.linalg.norm(np.subtract(*(graph.nodes[x]["at"] for x in (p, q)))))
        weight = length * (1e6 if tray in avoid else 1)
        graph.add_edge(p, q, name, length=length, weight=weight, tray=tray)

    for name, place in trays.nodes.items():
        graph.add_node(name, at=np.array(place, float))
    graph.add_node("a", at=one[1])
    graph.add_node("b", at=other[1])
    for tray in trays.trays:
        join(tray.name, tray.a, tray.b, tray.name)
    for node, (tray, _, _) in (("a", one), ("b", other)):
        for end in (tray.a, tray.b):
            join(f"{node}-{end}", node, end, tray.name)
    if one[0] == other[0]:
        join("ab", "a", "b", one[0].name)
    path = nx.dijkstra_path(graph, "a", "b")
    length, names = 0.0, []
    for p, q in pairwise(path):
        edge = min(graph[p][q].values(), key=lambda e: e["weight"])
        length += edge["length"]
        if edge["length"] > 0:
            names.append(edge["tray"])
    return one[2] + other[2] + length, tuple(dict.fromkeys(names))


def test_without_trays_a_route_is_square_to_the_ship():
    site = Site((0, 0, 0), detour=1.2, tails=3)
    rng = np.random.default_rng(9)
    a, b = rng.normal(size=(2, 4, 1, 3)), rng.normal(size=(5, 3))
    routes = site.route(a, b)
    assert routes.shape == (2, 4, 5)
    assert routes[1, 2, 3] == pytest.approx(sum(abs(a[1, 2, 0, k] - b[3, k]) for k in range(3)))
    assert site.length(routes)[0, 0, 0] == pytest.approx(1.2 * routes[0, 0, 0] + 3)
    assert site.ways(a, b) == [()] * 40


def test_the_lengths_of_the_example_ship_end_at_its_two_cabinets():
    points = SHIP.points
    ballast = points["system"].isin(["Ballast valve", "Tank level"]).to_numpy()
    for cabinet, own in (("ballast control", ballast), ("engine control room", ~ballast)):
        site = Site(TRAYS.cabinets[cabinet])
        length = site.length(site.route(SHIP.places, site.cabinet))
        # Printed with one decimal: half of the last digit.
        assert np.abs(length - points["home_run_m"])[own].max() <= 0.0501
        assert np.abs(length - points["home_run_m"])[~own].max() > 1
    to_box = Site((0, 0, 0)).route(SHIP.places, SHIP.box_places)
    assert np.abs(1.15 * to_box + 5 - points["to_box_m"]).max() <= 0.0501


def test_the_example_trays_hold_two_ways_to_every_part_of_the_ship():
    graph = nx.Graph((tray.a, tray.b) for tray in TRAYS.trays)
    assert list(nx.bridges(graph)) == []
    assert len(graph) == len(TRAYS.nodes)
    # Every point is nearer to a tray than the beam of the ship.
    assert max(nearest(TRAYS, place)[2] for place in SHIP.places) < 16


@pytest.mark.parametrize("avoid", [(), ("port main 60-90",), tuple(TRAYS.names[:6]), TRAYS.names])
def test_routes_are_the_shortest_that_networkx_finds(avoid):
    rng = np.random.default_rng(2024)
    a, b = rng.uniform([0, -10, 0], [176, 10, 17], (2, 60, 3))
    a[:30] = SHIP.places[:300:10]
    b[:30] = SITE.cabinet
    routes, ways = SITE.route(a, b, avoid=avoid), SITE.ways(a, b, avoid=avoid)
    for k in range(len(a)):
        length, names = by_networkx(TRAYS, a[k], b[k], avoid)
        assert routes[k] == pytest.approx(length, rel=1e-12, abs=1e-9)
        assert ways[k] == names


def test_a_second_cable_takes_other_trays_where_there_are_any():
    valve, cabinet = SHIP.places[200:201], SITE.cabinet
    (first,) = SITE.ways(valve, cabinet)
    (second,) = SITE.ways(valve, cabinet, avoid=first)
    # The trays on which both ends hang stay common.
    assert set(first) & set(second) == {first[0], first[-1]}
    assert SITE.route(valve, cabinet, avoid=first) > SITE.route(valve, cabinet)


@given(st.lists(st.tuples(*[st.floats(-50, 50)] * 3), min_size=2, max_size=2))
@settings(max_examples=60)
def test_routes_are_symmetric_and_no_shorter_than_the_straight_line(places):
    a, b = np.array(places)
    for site in (SITE, Site(SITE.cabinet)):
        route = site.route(a, b)
        assert route == pytest.approx(site.route(b, a), rel=1e-9, abs=1e-9)
        assert route >= np.linalg.norm(a - b) - 1e-9
        assert site.route(a, a) == 0


def test_a_place_that_is_not_known_has_no_route():
    unknown = [(np.nan,) * 3, (1.0, 2.0, 3.0)]
    for site in (SITE, Site(SITE.cabinet)):
        assert np.isnan(site.route(unknown, SITE.cabinet)).tolist() == [True, False]
        assert site.ways(unknown, SITE.cabinet)[0] == ()
    assert SITE.route(np.zeros((0, 3)), SITE.cabinet).shape == (0,)
    assert SITE.ways(np.zeros((0, 3)), SITE.cabinet) == []


def test_of_two_trays_between_the_same_nodes_the_other_is_taken_when_one_is_avoided():
    nodes = {"A": (0, 0, 0), "B": (10, 0, 0), "C": (5, 5, 0)}
    trays = Trays(nodes, (Tray("low", "A", "B"), Tray("twin", "B", "A"), Tray("up", "A", "C"),
                          Tray("down", "C", "B")))  # fmt: skip
    site = Site((0, 0, 0), trays)
    assert site.ways([(-2, 0, 0)], (12, 0, 0)) in ([("low",)], [("twin",)])
    graph = by_networkx(trays, (-2, 0, 0), (12, 0, 0))
    assert site.route((-2, 0, 0), (12, 0, 0)) == graph[0] == 14


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: Site((1, 2)), r"cabinet is \(1, 2\); it must be an array of shape"),
        (lambda: Site((1, 2, np.nan)), "it must be three finite numbers"),
        (lambda: Site([[1, 2, 3]]), "it must be three finite numbers"),
        (lambda: Site((1, 2, np.inf)), "infinite"),
        (lambda: Site("abc"), "cabinet is 'abc'"),
        (lambda: Site((0, 0, 0), detour=0.9), r"detour is 0\.9; it must be 1\.\.10"),
        (lambda: Site((0, 0, 0), tails=float("nan")), r"tails is nan m; .* 0\.\.1000"),
        (lambda: Site((0, 0, 0), tails=True), "tails is True"),
        (lambda: SITE.route((1, 2), (1, 2, 3)), "a is .* shape"),
        (lambda: SITE.route(np.zeros((2, 3)), np.zeros((4, 3))), "which does not fit"),
        (lambda: SITE.route((1, 2, 3), (1, 2, 3), avoid=["xx"]), "avoid names 'xx'"),
        (lambda: Site((0, 0, 0)).ways((1, 2, 3), (1, 2, 3), avoid=["x"]), "has no trays"),
    ],
)
def test_bad_arguments_are_named(call, message):
    with pytest.raises(ArgumentError, match=message):
        call()


TITLES = "kind,name,x_m,y_m,z_m,from,to\n"
TWO = "node,A,0,0,0,,\nnode,B,9,0,0,,\n"


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("", ["is empty; expected a row of column titles"]),
        ("kind,name\nnode,A", ["row 1: no column x_m"]),
        (TITLES.replace("from", "form"), ["title 'form' is unknown", "row 1: no column from"]),
        (TITLES, ["there is no tray"]),
        (TITLES + TWO + "tray,t,,,,A,C", ["row 4: tray 't' ends at 'C', which is not a node"]),
        (TITLES + TWO + "tray,t,,,,A,A", ["row 4: tray 't' has no length"]),
        (TITLES + TWO + "tray,t,,,,A,B\ntray,t,,,,B,A", ["row 5: tray 't' appears twice"]),
        (TITLES + TWO + "node,A,1,1,1,,\ntray,t,,,,A,", ["row 4: node 'A' appears twice",
                                                        "row 5, column to: is empty"]),
        (TITLES + TWO + "node,C,1,x,inf,,\npipe,,,,,,\ntray,t,,,,A,B",
         ["row 4, column y_m: 'x'; expected a number -1000..1000 m",
          "row 4, column z_m: 'inf'", "row 5, column kind: 'pipe'; expected cabinet, node, tray",
          "row 5, column name: ''"]),
        (TITLES + TWO + "node,C,5,5,5,,\ntray,t,,,,A,B", ["no tray joins C to the rest"]),
        (TITLES + TWO + "tray,t,,,,A,B,C", ["row 4 has 8 cells; expected 7"]),
    ],
)  # fmt: skip
def test_every_fault_of_a_file_of_trays_is_told_at_once(text, found):
    with pytest.raises(InputError) as error:
        Trays.parse(text)
    assert len(error.value.faults) >= len(found)
    for expected in found:
        assert any(expected in fault for fault in error.value.faults), expected


def test_trays_that_are_no_graph_are_refused():
    with pytest.raises(ArgumentError, match="ends at 'B', which is not a node"):
        Trays({"A": (0, 0, 0)}, (Tray("t", "A", "B"),))
    with pytest.raises(ArgumentError, match="expected three finite numbers"):
        Trays({"A": (0, 0, np.nan), "B": (1, 1, 1)}, (Tray("t", "A", "B"),))


@given(st.text(max_size=80) | st.text("nodetrayABx_m,;\n0159.", max_size=80).map(TITLES.__add__))
@settings(max_examples=100)
def test_any_text_gives_trays_or_an_input_error(text):
    try:
        trays = Trays.parse(text)
    except InputError:
        return
    assert trays.lengths.min() > 0
