import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shipnet.engine.points import Point, read_points
from shipnet.engine.registers import CODINGS, Coding, RegisterMap
from shipnet.engine.system import System
from shipnet.errors import ArgumentError
from shipnet.modbus.polling import Poll
from shipnet.modbus.uart import SerialLine

POINTS = read_points()
LOW, HIGH = (np.array([getattr(point, end) for point in POINTS]) for end in ("low", "high"))
ANALOGUE = np.array([point.analogue for point in POINTS])
CORRECTED = CODINGS["corrected: decimal, 0x8000"]
CODING = pytest.mark.parametrize("coding", CODINGS.values(), ids=CODINGS)


def readings(rng, rows):
    values = LOW + (HIGH - LOW) * rng.random((rows, 99))
    values[:, ~ANALOGUE] = values[:, ~ANALOGUE].round()
    return values


CLIPPED = [
    Coding("8 bit and sign", 1.0, 0xFF, bits=9),
    Coding("0 is the mark", 1.0, 0, bits=10),
    Coding("7 bit and sign", 1.0, 0xFF80, bits=8),
]


@pytest.mark.parametrize("coding", [*CODINGS.values(), *CLIPPED], ids=lambda c: c.name)
def test_collisions_equal_those_of_a_dense_grid(coding):
    grid = np.linspace(LOW, HIGH, 20_001)
    grid[:, ~ANALOGUE] = grid[:, ~ANALOGUE].round()
    hit = coding.encode(POINTS, grid) == coding.error
    table = coding.collisions(POINTS)
    assert table.collides.tolist() == hit.any(axis=0).tolist()
    assert table.percent.to_numpy() == pytest.approx(100 * hit.mean(axis=0), abs=0.02)
    for k in np.flatnonzero(hit.any(axis=0) & ANALOGUE):
        taken = grid[hit[:, k], k]
        slack = 2 * (HIGH - LOW)[k] / 20_000
        assert taken.min() == pytest.approx(table["from"][k], abs=slack)
        assert taken.max() == pytest.approx(table["to"][k], abs=slack)


def test_a_number_includes_the_lower_end_of_its_values_and_not_the_upper_end():
    coding = CODINGS["whole units, 0x00FF"]
    ends = [
        Point("A", "M", "4-20 mA", "level", 0, 254.5, "m"),
        Point("B", "M", "4-20 mA", "level", 255.5, 300, "m"),
    ]
    table = coding.collisions(ends)
    assert coding.encode(ends, [[254.5, 255.5]]).tolist() == [[0xFF, 0x100]]
    assert table["collides"].tolist() == [True, False]
    assert (table["from"][0], table["to"][0], table["percent"][0]) == (254.5, 254.5, 0)


def test_the_corrected_coding_never_sends_its_mark_for_a_value():
    wild = np.random.default_rng(3).normal(0, 1e6, (1000, 99))
    assert (CORRECTED.encode(POINTS, wild) != CORRECTED.error).all()
    assert not CORRECTED.collisions(POINTS).collides.any()


@CODING
@given(seed=st.integers(0, 2**32 - 1))
def test_a_value_is_recovered_within_half_a_step_or_as_missing(coding, seed):
    values = readings(np.random.default_rng(seed), 3)
    registers = coding.encode(POINTS, values)
    back = coding.decode(POINTS, registers)
    step = np.array([coding.step_of(point) for point in POINTS])
    marked = registers == coding.error
    assert (np.isnan(back) == marked).all()
    assert (np.abs(back - values) <= step / 2 + 1e-9)[~marked].all()


def test_the_decimal_step_is_within_a_thousandth_of_the_span():
    for point in POINTS:
        if point.analogue:
            step = CORRECTED.step_of(point)
            assert point.span / 10_000 < step <= point.span / 1000 * (1 + 1e-12)
            assert np.log10(step) == pytest.approx(round(np.log10(step)))
    bar = Point("P", "B", "4-20 mA", "pressure", 0, 1000, "bar")
    assert CORRECTED.step_of(bar) == 1.0


@pytest.mark.parametrize("coding", ["tenths, 0xFFFF", "corrected: decimal, 0x8000"])
def test_decoded_registers_equal_the_encoded_values(coding):
    rng = np.random.default_rng(7)
    values = readings(rng, 50)
    failed = rng.random((50, 99)) < 0.1
    layout = RegisterMap(POINTS, CODINGS[coding])
    registers = layout.encode(values, failed)
    assert registers.shape == (50, len(layout)) == (50, 99)
    read = layout.decode(registers)
    near = np.abs(read - values)[~failed & ~np.isnan(read)]
    assert near.max() <= 0.05 + 1e-9
    assert np.isnan(read)[failed].all()
    if coding.startswith("corrected"):
        assert (np.isnan(read) == failed).all()


def test_sizes_and_requests_of_the_maps():
    assert len(RegisterMap(POINTS)) == System().registers == 99
    # The corrected system also sends the ages of 10, 5 and 7 frames.
    assert System.corrected().registers == 99 + 10 + 5 + 7
    (request,) = RegisterMap(POINTS).requests()
    assert Poll(request, SerialLine(9600)).time == pytest.approx(249.79e-3, abs=5e-6)
    many = [Point(f"P{k}", "B", "4-20 mA", "pressure", 0, 1) for k in range(251)]
    asked = [(r.address, r.quantity) for r in RegisterMap(many).requests()]
    assert asked == [(0, 125), (125, 125), (250, 1)]


def test_wrong_codings_and_registers_are_refused():
    for action, message in (
        (lambda: Coding("x", 0.0, 255), "step is 0"),
        (lambda: Coding("x", "half", 255), "step is 'half'"),
        (lambda: Coding("x", 1, 65536), "error is 65536"),
        (lambda: Coding("x", 1, 255, bits=17), "bits is 17"),
        (lambda: CORRECTED.encode(POINTS, LOW[1:]), r"shape \(98,\)"),
        (lambda: CORRECTED.encode(POINTS, LOW, 1), "failed is 1"),
        (lambda: CORRECTED.encode(POINTS, LOW, [True, False]), "failed has shape"),
        (lambda: CORRECTED.decode(POINTS, [0] * 98), r"shape \(98,\)"),
        (lambda: CORRECTED.decode(POINTS, [65536] * 99), "out of range"),
        (lambda: RegisterMap([]), "points are empty"),
        (lambda: RegisterMap(POINTS, "tenths"), "coding is 'tenths'"),
    ):
        with pytest.raises(ArgumentError, match=message):
            action()
