import numpy as np
import pytest

from shipnet.asi.modulation import as_bits, pulses_of
from shipnet.asi.receiver import eye, receive
from shipnet.asi.telegram import RESPONSES
from shipnet.asi.topology import straight_line
from shipnet.errors import ArgumentError
from shipnet.papers.kim2023.signals import train_of

WORDS = as_bits(RESPONSES)


def test_ideal_pulses_lie_on_each_other():
    u = train_of(1.5 * pulses_of(WORDS))
    opened = eye(u, 250e-9, WORDS)
    assert len(opened.pulses) == (pulses_of(WORDS) != 0).sum()
    assert len(opened.pulses) + len(opened.gaps) == 16 * 15
    # Linear interpolation between samples a twelfth of a pulse apart.
    ideal = np.cos(np.pi * opened.t / 3e-6) ** 2
    assert np.abs(opened.pulses - ideal).max() < 0.03
    assert np.abs(opened.gaps).max() < 0.03


def test_a_supply_voltage_and_a_scale_change_nothing():
    _, u = straight_line(100, slaves=(5, 100)).signals(WORDS, dt=250e-9)
    plain, lifted = eye(u, 250e-9, WORDS), eye(1.5 * u + 30, 250e-9, WORDS)
    assert lifted.pulses == pytest.approx(plain.pulses, abs=1e-9)
    assert lifted.gaps == pytest.approx(plain.gaps, abs=1e-9)
    assert len(plain.pulses) == 2 * (pulses_of(WORDS) != 0).sum()


def test_the_weakest_pulse_is_the_receivers():
    for length in (100, 150):
        _, u = straight_line(length, slaves=(5,)).signals(WORDS, dt=50e-9)
        heard = receive(u, 50e-9, 7, matched=False)
        opened = eye(u, 50e-9, WORDS)
        near = np.abs(opened.t) < 0.11 * 3e-6
        assert opened.pulses[:, near].max(axis=1).min() == pytest.approx(
            heard.weakest.min(), abs=0.03
        )


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"bits": WORDS[:3]}, r"shape \(3,\), which does not fit the telegrams' \(1, 16\)"),
        ({"u": np.zeros((1, 16, 320))}, "holds no pulse"),
        ({"points": 1}, "points is 1"),
        ({"u": train_of(pulses_of(WORDS))[np.newaxis, :, :190]}, "u ends after 4.75e-05 s"),
    ],
)
def test_what_does_not_fit_is_named(change, message):
    arguments = {"u": train_of(2 * pulses_of(WORDS))[np.newaxis], "dt": 250e-9, "bits": WORDS}
    with pytest.raises(ArgumentError, match=message):
        eye(**{**arguments, **change})
