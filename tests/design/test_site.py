import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from shipnet import datasets
from shipnet.design.iolist import read_iolist
from shipnet.design.layout import Site
from shipnet.errors import ArgumentError

SHIP = read_iolist(datasets.path("synthetic_iolist_ship.csv"))
#: The two cabinets of the example ship.
CABINETS = {"engine control room": (26, 6, 14), "ballast control": (20, -6, 14)}
SITE = Site(CABINETS["engine control room"])


def test_a_route_is_parallel_to_the_axes_of_the_ship():
    site = Site((0, 0, 0), detour=1.2, tails=3)
    rng = np.random.default_rng(9)
    a, b = rng.normal(size=(2, 4, 1, 3)), rng.normal(size=(5, 3))
    routes = site.route(a, b)
    assert routes.shape == (2, 4, 5)
    assert routes[1, 2, 3] == pytest.approx(sum(abs(a[1, 2, 0, k] - b[3, k]) for k in range(3)))
    assert site.length(routes)[0, 0, 0] == pytest.approx(1.2 * routes[0, 0, 0] + 3)


def test_the_lengths_of_the_example_ship_end_at_its_two_cabinets():
    points = SHIP.points
    ballast = points["system"].isin(["Ballast valve", "Tank level"]).to_numpy()
    for cabinet, own in (("ballast control", ballast), ("engine control room", ~ballast)):
        site = Site(CABINETS[cabinet])
        length = site.length(site.route(SHIP.places, site.cabinet))
        # The file has one decimal, so allow half of the last digit.
        assert np.abs(length - points["home_run_m"])[own].max() <= 0.0501
        assert np.abs(length - points["home_run_m"])[~own].max() > 1
    to_box = Site((0, 0, 0)).route(SHIP.places, SHIP.box_places)
    assert np.abs(1.15 * to_box + 5 - points["to_box_m"]).max() <= 0.0501


@given(st.lists(st.tuples(*[st.floats(-50, 50)] * 3), min_size=2, max_size=2))
@settings(max_examples=60)
def test_routes_are_symmetric_and_no_shorter_than_the_straight_line(places):
    a, b = np.array(places)
    route = SITE.route(a, b)
    assert route == pytest.approx(SITE.route(b, a), rel=1e-9, abs=1e-9)
    assert route >= np.linalg.norm(a - b) - 1e-9
    assert SITE.route(a, a) == 0


def test_an_unknown_position_has_no_route():
    unknown = [(np.nan,) * 3, (1.0, 2.0, 3.0)]
    assert np.isnan(SITE.route(unknown, SITE.cabinet)).tolist() == [True, False]
    assert SITE.route(np.zeros((0, 3)), SITE.cabinet).shape == (0,)


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
    ],
)
def test_bad_arguments_are_named(call, message):
    with pytest.raises(ArgumentError, match=message):
        call()
