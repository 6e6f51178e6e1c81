import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import brentq

from shipnet.engine.inputs import InputCard, pt100_resistance, pt100_temperature
from shipnet.engine.points import Point, read_points
from shipnet.errors import ArgumentError

POINTS = read_points()
LOW, HIGH = (np.array([getattr(point, end) for point in POINTS]) for end in ("low", "high"))
ANALOGUE = np.array([point.analogue for point in POINTS])
RTD = np.array([point.condition == "RTD" for point in POINTS])

#: Table 1 of IEC 60751, two decimals.
TEMPERATURES = [-200, -150, -100, -50, -10, 0, 10, 50, 100, 150, 200, 400, 600, 850]
OHMS = "18.52 39.72 60.26 80.31 96.09 100 103.9 119.4 138.51 157.33 175.86 247.09 313.71 390.48"


def test_resistances_equal_the_table_of_the_standard():
    expected = [float(ohms) for ohms in OHMS.split()]
    assert pt100_resistance(TEMPERATURES) == pytest.approx(expected, abs=0.00501)


def test_the_inverse_equals_the_root_of_a_solver():
    for r in np.linspace(18.6, 390.4, 60):
        root = brentq(lambda t, r=r: pt100_resistance(t) - r, -200, 850, xtol=1e-12)
        assert pt100_temperature(r) == pytest.approx(root, abs=1e-8)


@pytest.mark.parametrize("bad", [-201, 851, np.nan, np.inf, "x", True, None])
def test_temperatures_out_of_range_are_refused(bad):
    with pytest.raises(ArgumentError, match="temperature is"):
        pt100_resistance(bad)
    with pytest.raises(ArgumentError, match="resistance is"):
        pt100_temperature(bad)


#: A single current loop.
LOOP = InputCard([Point("P", "B", "4-20 mA", "pressure", 0, 10, "bar")])


def test_the_current_loop_equals_that_of_the_paper():
    # 4..20 mA produce 1..5 V across 250 ohm, and 1.25 (u - 1 V) is 0..5 V.
    current = LOOP.signal([[0.0], [2.5], [10.0]])
    assert current.ravel() == pytest.approx([4e-3, 8e-3, 20e-3])
    assert LOOP.voltage(current) == pytest.approx(1.25 * (250 * current - 1))
    # A transmitter stays within its limits.
    assert LOOP.signal([[-1e9], [1e9]]).ravel().tolist() == [3.8e-3, 20.5e-3]


def test_a_step_is_the_reference_over_1024():
    assert LOOP.step == 5 / 1024
    steps = 4e-3 + 16e-3 * (np.arange(1023) + 0.5)[:, None] / 1024
    assert LOOP.code(steps - 1e-12).ravel().tolist() == list(range(1023))
    assert LOOP.code(steps + 1e-12).ravel().tolist() == list(range(1, 1024))
    assert LOOP.code([[-np.inf], [np.inf]]).ravel().tolist() == [0, 1023]


@pytest.mark.parametrize("margin", [0.0, 0.125, 1.0])
def test_the_conversion_error_equals_that_of_a_dense_grid(margin):
    card = InputCard(POINTS, margin=margin)
    table = card.accuracy()
    places = [k for k, _ in POINTS.kinds() if POINTS[k].analogue]
    grid = np.linspace(LOW, HIGH, 100_001)[:, places]
    few = InputCard([POINTS[k] for k in places], margin=margin)
    error = np.abs(few.value(few.code(few.signal(grid))) - grid).max(axis=0)
    # The grid may miss the maximum by two steps.
    slack = 2 * (HIGH - LOW)[places] / 100_000
    assert (error <= table.conversion_error + 1e-9).all()
    assert (error >= table.conversion_error - slack).all()


def test_without_margin_no_fault_of_an_analogue_sensor_is_detected():
    table = InputCard(POINTS).wire_faults()
    assert not table.detected.any()


def test_with_margin_every_fault_of_an_analogue_sensor_is_detected():
    card = InputCard(POINTS, margin=0.125)
    table = card.wire_faults()
    analogue = table.condition != "switch"
    assert table.detected[analogue].all()
    assert not table.detected[~analogue].any()
    # Values within the range, or within a transmitter's limits, are not mistaken for faults.
    values = np.linspace(LOW, HIGH, 2001)
    values[:, ~ANALOGUE] = values[:, ~ANALOGUE].round()
    assert card.valid(card.code(card.signal(values))).all()
    loops = np.array([point.condition == "4-20 mA" for point in POINTS])
    for i, told in ((3.6e-3, True), (3.8e-3, False), (20.5e-3, False), (21e-3, True)):
        codes = card.code(np.where(RTD, 110.0, np.where(loops, i, 1.0)))
        assert (card.valid(codes)[loops] != told).all()


def test_a_broken_wire_alarms_a_closed_contact_and_hides_an_open_one():
    closed = Point("C", "B", "switch", "logic", signal="NC contact")
    opens = Point("O", "B", "switch", "logic", signal="NO contact")
    card = InputCard([closed, opens])
    assert card.value(card.code(card.signal([[0, 0], [1, 1]]))).tolist() == [[0, 0], [1, 1]]
    assert card.value(card.broken("open")).tolist() == [1, 0]
    assert card.value(card.broken("short")).tolist() == [0, 1]


@given(st.integers(0, 2**32 - 1), st.sampled_from([0.0, 0.05, 0.125]), st.integers(6, 16))
def test_a_value_is_recovered_within_the_error_of_the_table(seed, margin, bits):
    card = InputCard(POINTS, bits=bits, margin=margin)
    values = LOW + (HIGH - LOW) * np.random.default_rng(seed).random((4, 99))
    values[:, ~ANALOGUE] = values[:, ~ANALOGUE].round()
    back = card.value(card.code(card.signal(values)))
    assert (back[:, ~ANALOGUE] == values[:, ~ANALOGUE]).all()
    span = HIGH - LOW
    # A step of resistance is at most 1.25 times the mean step of temperature: the curve is flat.
    step = 1.25 * span * (1 + 2 * margin) / 2**bits
    assert (np.abs(back - values) <= step + 1e-9).all()


def test_impossible_cards_values_and_codes_are_refused():
    card = InputCard(POINTS)
    nan = LOW.copy()
    nan[21] = np.nan
    half = LOW.copy()
    half[-1] = 0.5
    cold = LOW.copy()
    cold[0] = -300
    assert card.code(card.signal(np.zeros((0, 99)))).shape == (0, 99)
    assert card.value(np.zeros((2, 3, 99), int)).shape == (2, 3, 99)
    for action, message in (
        (lambda: InputCard(POINTS, reference=0), "reference is 0 V"),
        (lambda: InputCard([]), "points are empty"),
        (lambda: InputCard(POINTS, bits=17), "bits is 17"),
        (lambda: InputCard(POINTS, margin=-0.1), "margin is -0.1"),
        (lambda: card.signal(LOW[:-1]), r"values has shape \(98,\)"),
        (lambda: card.signal(nan), "ME-JB1-022 is nan"),
        (lambda: card.signal(half), "ME-JB3-099 is neither 0 nor 1"),
        (lambda: card.signal(cold), "temperature is -300"),
        (lambda: card.code(nan), "signal is nan"),
        (lambda: card.value([0] * 98), r"code has shape \(98,\)"),
        (lambda: card.value([0.5] * 99), "of whole numbers"),
        (lambda: card.value([1024] * 99), "out of range"),
    ):
        with pytest.raises(ArgumentError, match=message):
            action()
