"""Clusters, groups of equal size and trunks, compared with brute force and networkx."""

from itertools import pairwise, permutations, product
from math import inf

import networkx as nx
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.spatial.distance import cdist

from shipnet.design.drafting import balanced, chain, divided, tree, zones

metres = st.integers(0, 40).map(float)


def some_places(least=0, most=9):
    return st.integers(least, most).flatmap(lambda n: arrays(float, (n, 3), elements=metres))


@given(some_places(), st.sampled_from([0.0, 5.0, 30.0]), st.integers(1, 4))
def test_a_zone_meets_its_limits_of_reach_and_size(places, reach, most):
    labels = zones(places, reach=reach, most=most)
    assert labels.shape == (len(places),)
    assert list(dict.fromkeys(labels)) == list(range(labels.max(initial=-1) + 1))
    for zone in set(labels):
        own = places[labels == zone]
        assert len(own) <= most
        assert cdist(own, own, "cityblock").max() <= reach + 1e-9


def test_places_within_reach_are_one_zone_unless_it_is_full():
    places = np.zeros((10, 3))
    assert set(zones(places, reach=0.0, most=10)) == {0}
    assert max(np.bincount(zones(places, reach=0.0, most=4))) <= 4


def test_many_places_are_halved_and_still_within_reach():
    rng = np.random.default_rng(3)
    places = rng.uniform(0, 200, (4000, 3))
    labels = zones(places, reach=30.0, most=5)
    assert np.bincount(labels).max() <= 5
    spans = [np.ptp(places[labels == zone], axis=0).sum() for zone in range(0, labels.max(), 50)]
    assert max(spans) <= 3 * 30


@given(some_places(1, 8), st.integers(1, 4))
def test_groups_are_of_nearly_equal_size(places, groups):
    labels = balanced(places, groups)
    assert np.bincount(labels).max() <= -(-len(places) // groups)


@given(some_places(1, 8), st.data())
def test_no_group_has_more_points_of_a_kind_than_ports(places, data):
    kinds = data.draw(arrays(int, len(places), elements=st.integers(0, 1)))
    counts = np.bincount(kinds, minlength=2)
    groups = max(1, *(-(-count // 2) for count in counts))
    labels = balanced(places, groups, kinds=kinds, most=(2, 2))
    for kind, group in product((0, 1), range(groups)):
        assert ((kinds == kind) & (labels == group)).sum() <= 2


def test_grouping_by_separate_rooms_is_optimal():
    places = np.array([[x, 0.0, 0.0] for x in (0, 1, 2, 50, 51, 52, 100, 101, 102)])
    labels = balanced(places, 3)
    assert labels.tolist() == [0, 0, 0, 1, 1, 1, 2, 2, 2]

    def metres_of(labels):
        return sum(
            np.abs(own - np.median(own, axis=0)).sum()
            for own in (places[np.array(labels) == g] for g in range(3))
        )

    best = min(
        metres_of(labels)
        for labels in product(range(3), repeat=9)
        if sorted(np.bincount(labels, minlength=3)) == [3, 3, 3]
    )
    assert metres_of(labels) == best


@given(st.lists(st.integers(0, 60), max_size=12))
def test_division_ends_when_every_group_meets_its_limits(items):
    def judge(group):
        span = max(group) - min(group)
        return span, max(len(group) / 3, 1 if span <= 10 else inf)

    groups = divided(items, lambda x: (x, 0, 0), judge)
    assert sorted(x for group, _ in groups for x in group) == sorted(items)
    for group, span in groups:
        assert len(group) <= 3
        assert span == max(group) - min(group) <= 10


def test_an_item_that_fits_nowhere_is_halved_until_it_fits():
    groups = divided(
        [(7,)],
        lambda item: (0, 0, 0),
        lambda group: (None, 1 if sum(item[0] for item in group) <= 2 else inf),
        lambda item: [(item[0] // 2,), (item[0] - item[0] // 2,)] if item[0] > 1 else [],
    )
    assert [group for group, _ in groups] == [[(1,)], [(2,)], [(2,)], [(2,)]]


def test_an_item_that_fits_nowhere_and_cannot_be_halved_is_a_group():
    assert divided([5], lambda x: (x, 0, 0), lambda group: ("no", inf)) == [([5], "no")]


@given(some_places(1, 9))
def test_the_tree_is_as_short_as_the_one_of_networkx(places):
    ways = cdist(places, places, "cityblock")
    edges = tree(ways)
    graph = nx.Graph()
    graph.add_nodes_from(range(len(places)))
    graph.add_weighted_edges_from((a, b, ways[a, b]) for a in range(len(places)) for b in range(a))
    assert sum(ways[a, b] for a, b in edges) == pytest.approx(
        nx.minimum_spanning_tree(graph).size("weight"), abs=1e-6
    )
    reached = {0}
    for near, far in edges:
        assert near in reached
        reached.add(far)
    assert reached == set(range(len(places)))


@given(some_places(1, 7))
def test_a_chain_is_not_shorter_than_the_tree_and_near_the_optimum(places):
    ways = cdist(places, places, "cityblock")
    order = chain(ways)
    assert order[0] == 0 and sorted(order) == list(range(len(places)))

    def length(order):
        return sum(ways[a, b] for a, b in pairwise(order))

    best = min(length((0, *rest)) for rest in permutations(range(1, len(places))))
    shortest = sum(ways[a, b] for a, b in tree(ways))
    assert shortest - 1e-6 <= best <= length(order) + 1e-6
    assert length(order) <= 2 * shortest + 1e-6


def test_a_chain_along_a_line_is_the_line():
    x = np.array([0.0, 50, 10, 40, 20, 30])
    assert chain(abs(x - x[:, None])) == [0, 2, 4, 5, 3, 1]
