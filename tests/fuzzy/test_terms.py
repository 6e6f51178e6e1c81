import math

import numpy as np
import pytest
import skfuzzy
from hypothesis import assume, example, given
from hypothesis import strategies as st

from shipnet.errors import ArgumentError
from shipnet.fuzzy import Interval, Term, Variable
from shipnet.fuzzy.terms import parse_comparison

INF = math.inf
ANY = "x > 0"
numbers = st.floats(-1e6, 1e6)


@st.composite
def trapezoids(draw):
    """Draw corners of all shapes: ramps, steps, points, shoulders."""
    a, b, c, d = sorted(draw(st.lists(numbers, min_size=4, max_size=4)))
    shape = draw(st.sampled_from(["full", "left", "right", "steps", "point"]))
    return {
        "full": (a, b, c, d),
        "left": (-INF, -INF, c, d),
        "right": (a, b, INF, INF),
        "steps": (a, a, d, d),
        "point": (a, a, a, a),
    }[shape]


@pytest.mark.parametrize(
    ("text", "inside", "outside"),
    [
        ("x > 120", [120.1, INF], [120, -INF]),
        ("x >= 90", [90, 91], [89.9]),
        ("x < 2.5", [2.4, -INF], [2.5, INF]),
        ("0 < x < 2.5", [0.1, 2.4], [0, 2.5]),
        ("0 <= x <= 2.5", [0, 2.5], [-0.1, 2.6]),
        ("x == 0", [0, -0.0], [1e-300]),
        ("-1e3 < x", [0, INF], [-1000, -INF]),
    ],
)
def test_a_comparison_holds_in_its_interval(text, inside, outside):
    interval = parse_comparison(text)
    assert interval.contains(inside).all()
    assert not interval.contains([*outside, math.nan]).any()


@pytest.mark.parametrize(
    "text",
    [
        "",
        "x",
        "y > 1",
        "x > y",
        "1 < x > 2",
        "2 < x < 1",
        "1 < x < 1",
        "0 < x == 1",
        "x > nan",
        "5",
    ],
)
def test_text_that_is_not_a_comparison_is_refused(text):
    with pytest.raises(ArgumentError):
        parse_comparison(text)


@given(numbers, numbers, st.booleans(), st.booleans(), st.sampled_from(["both", "low", "high"]))
def test_the_text_of_a_comparison_parses_to_the_same_comparison(
    a, b, low_closed, high_closed, ends
):
    low, high = (a, b) if a <= b else (b, a)
    assume(low < high)
    interval = {
        "both": Interval(low, high, low_closed, high_closed),
        "low": Interval(low, INF, low_closed),
        "high": Interval(-INF, high, high_closed=high_closed),
    }[ends]
    assert parse_comparison(str(interval)) == interval
    point = Interval(a, a, True, True)
    assert parse_comparison(str(point)) == point


@example((0.0, 5e-324, 1.0, 1.0), [0.0])  # the narrowest possible ramp
@given(trapezoids(), st.lists(numbers, min_size=1, max_size=20))
def test_membership_equals_that_of_scikit_fuzzy_to_the_last_bit(corners, x):
    values = np.array([*x, *(corner for corner in corners if math.isfinite(corner))])
    far = [(-1e9, -1e9), (1e9, 1e9)]
    given_corners = [
        *(far[0] if corners[0] == -INF else corners[:2]),
        *(far[1] if corners[3] == INF else corners[2:]),
    ]
    ours = Term("a", corners, ANY).membership(values)
    assert ours.tolist() == skfuzzy.trapmf(values, given_corners).tolist()


def test_membership_keeps_the_shape():
    term = Term("a", (0, 1, 2, 3), ANY)
    assert term.membership(0.25).tolist() == 0.25
    assert term.membership(np.zeros((2, 0, 3))).shape == (2, 0, 3)


@pytest.mark.parametrize(
    "corners",
    [
        (1, 0, 2, 3),
        (0, 1, 2),
        (0, 1, 2, math.nan),
        (-INF, -INF, INF, INF),
        (-INF, 0, 1, 2),
        (0, 1, 2, INF),
        (INF, INF, INF, INF),
    ],
)
def test_corners_that_are_not_a_trapezoid_are_refused(corners):
    with pytest.raises(ArgumentError, match="corners are"):
        Term("a", corners, ANY)


def test_a_variable_refuses_terms_outside_its_universe():
    hot = Term("hot", (80, 90, INF, INF), "x >= 90")
    assert Variable("OT", "degC", 0, 150, (hot,))["hot"] is hot
    with pytest.raises(ArgumentError, match=r"shoulder of OT\.hot lies outside 0\.\.85"):
        Variable("OT", "degC", 0, 85, (hot,))
    with pytest.raises(ArgumentError, match=r"comparison of OT\.far"):
        Variable("OT", "degC", 0, 85, (Term("far", (0, 1, 2, 3), "x > 90"),))
    with pytest.raises(ArgumentError, match="terms of OT are hot, hot"):
        Variable("OT", "degC", 0, 150, (hot, hot))
    with pytest.raises(ArgumentError, match="terms of"):
        Variable("OT", "degC", 0, 150, ())
    with pytest.raises(ArgumentError, match="low of OT is 150"):
        Variable("OT", "degC", 150, 0, (hot,))
    with pytest.raises(ArgumentError, match="name of a variable is 'O T'"):
        Variable("O T", "degC", 0, 150, (hot,))
    with pytest.raises(ArgumentError, match="the terms of OT are hot"):
        Variable("OT", "degC", 0, 150, (hot,))["cold"]
