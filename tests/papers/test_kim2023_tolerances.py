import numpy as np
import pytest

from shipnet.asi.segment import POWER_SUPPLY
from shipnet.asi.slave import DEVICE
from shipnet.asi.topologies import line
from shipnet.line import Load, Network
from shipnet.papers.icn2007 import arriving_share, pulse_height, share_above
from shipnet.papers.kim2023.signals import (
    copes_with_amplitudes,
    copes_with_overshoot,
    train_of,
    works_without,
)


def test_an_inductor_is_meant_not_a_conductor():
    assert works_without(part="inductor")
    assert not works_without(part="conductor")
    # The supply's inductor turns changes of current into voltage: without it the line is a
    # capacitor, whatever inductor a slave may have.
    plan = line(100, slaves=(50,))
    network = plan.network
    bare = Network(plan.cables, {"0 m": Load(r=POWER_SUPPLY.r), "50 m": DEVICE})
    s = [2j * np.pi * 100e3]
    row = network.index("0 m")
    assert network.transfer("50 m", s)[row].imag > 0
    assert bare.transfer("50 m", s)[row].imag < 0


@pytest.mark.parametrize("difference", [0.0, 0.35, 0.44])
def test_the_receiver_copes_up_to_the_comparators_limit(difference):
    assert copes_with_amplitudes(difference=difference or 0.01) > 0


def test_the_limits_lie_where_the_comparator_puts_them():
    # The mean, which the receiver takes off, moves half of the first pulse by a little.
    assert copes_with_amplitudes(difference=0.52) < 0
    # Half of 65 % is 32.5 %.
    assert copes_with_overshoot(overshoot=0.31) > 0 > copes_with_overshoot(overshoot=0.34)


def test_a_train_holds_its_pulses_in_their_places():
    u = train_of([[0, -1, 2, 0], [0, 0, 0, 3]])
    assert u.shape == (2, 2048)
    assert u.min() == pytest.approx(-1) and u[1].argmax() * 250e-9 == pytest.approx(15e-6)
    assert not train_of(np.zeros(14)).any()


def test_a_matched_end_treats_all_spacings_alike_at_any_length():
    ratios = [
        pulse_height(length, "0" * 16, terminator=100)
        / pulse_height(length, "01" * 8, terminator=100)
        for length in (20, 100, 200)
    ]
    # The cable loses a little, so 100 ohm do not match it quite.
    assert ratios == pytest.approx([ratios[0]] * 3, rel=0.02)
    # Without a cable the supply's 78 ohm || 100 uH alone decides; an open end changes it.
    assert pulse_height(200, "0" * 16) / pulse_height(200, "01" * 8) < 0.5


def test_shares_of_energy_follow_from_the_cable_and_the_pulse():
    assert arriving_share(0) == pytest.approx(1)
    lossless_by_half = arriving_share(1000) / arriving_share(500)
    assert lossless_by_half == pytest.approx(arriving_share(500), rel=0.01)
    shares = [share_above(1e6, pulse=pulse) for pulse in ("sin2", "half sine", "rectangle")]
    assert shares == sorted(shares)
    assert shares[0] < 1e-2 * shares[2]
    assert share_above(0) == pytest.approx(1)
