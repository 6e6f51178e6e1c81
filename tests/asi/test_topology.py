import numpy as np
import pytest

from shipnet.asi.segment import DEVICE, POWER_SUPPLY, Segment
from shipnet.asi.topology import ring, star, straight_line
from shipnet.errors import ArgumentError
from shipnet.line import CABLES, Cable, CableRun, Network


def total(segment: Segment) -> float:
    return sum(run.length for run in segment.network.runs)


def test_a_star_counts_every_leg():
    whole = star(90, [10 / 62] * 62)
    assert len(whole.slaves) == 62
    assert total(whole) == pytest.approx(100)
    assert whole.network.ring is None


def test_equal_legs_sound_alike_and_a_longer_leg_later():
    _, u = star(0, (10, 10, 40)).signals("0011001")
    assert u[0] == pytest.approx(u[1], abs=1e-12)
    assert np.abs(u[2] - u[0]).max() > 0.01


def test_a_star_of_one_leg_is_a_line():
    trunk = star(60, (40,), along=(20,))
    line = straight_line(100, slaves=(20, 100))
    assert trunk.signals("0011001")[1] == pytest.approx(line.signals("0011001")[1], abs=1e-9)


def test_a_ring_is_fed_from_both_sides():
    segment = ring(100, slaves=(25, 50, 75))
    assert total(segment) == pytest.approx(100)
    _, u = segment.signals("0011001")
    assert u[0] == pytest.approx(u[2], abs=1e-9)


def test_a_ring_agrees_with_its_two_halves_folded():
    # By symmetry no current crosses the middle: two cables side by side, open at their ends.
    closed = ring(100, slaves=(25, 50, 75))
    cable = CABLES["as-i 1.5"]
    both = Cable(r=cable.r / 2, l=cable.l / 2, c=cable.c * 2)
    runs = [CableRun("0 m", "25 m", 25, both), CableRun("25 m", "50 m", 25, both)]
    loads = {"0 m": POWER_SUPPLY + DEVICE, "25 m": DEVICE + DEVICE, "50 m": DEVICE}
    fold = Network(runs, loads)
    folded = Segment(fold, "0 m", ("25 m", "50 m")).signals("0011001")[1]
    assert closed.signals("0011001")[1][:2] == pytest.approx(folded, abs=1e-9)


@pytest.mark.parametrize(
    ("build", "message"),
    [
        (lambda: straight_line(100, slaves=(101,)), "the slave is at 101 m; it must be 0..100 m"),
        (lambda: star(10, (1,), along=(11,)), "the slave is at 11 m; it must be 0..10 m"),
        (lambda: star(10, (1,), supply=-1), "the supply is at -1 m"),
        (lambda: star(10, (1, -2)), "cable 10 m - leg 2 is -2"),
        (lambda: star(10, (float("nan"),)), "leg 1"),
        (lambda: ring(100, ()), "the last place on the ring is 0.0 m"),
        (lambda: ring(100, (50, 100)), "less than 100 m"),
        (lambda: ring(100, (50,)), "lies there already"),
        (lambda: ring(100, (0,)), "last place on the ring is 0"),
    ],
)
def test_a_place_off_the_cable_is_named(build, message):
    with pytest.raises(ArgumentError, match=message):
        build()
