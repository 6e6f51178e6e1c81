from dataclasses import replace

import numpy as np
import pytest

from shipnet.asi.modulation import as_bits, pulses_of
from shipnet.asi.receiver import Receiver, Waveform
from shipnet.asi.telegram import RESPONSES
from shipnet.asi.topologies import line
from shipnet.errors import ArgumentError
from shipnet.papers.kim2023.signals import train_of

WORDS = as_bits(RESPONSES)


def test_ideal_pulses_lie_on_each_other():
    opened = Waveform(train_of(1.5 * pulses_of(WORDS)), 250e-9, bits=WORDS).eye()
    assert len(opened.pulses) == (pulses_of(WORDS) != 0).sum()
    assert len(opened.pulses) + len(opened.gaps) == 16 * 15
    # Linear interpolation between samples a twelfth of a pulse apart.
    ideal = np.cos(np.pi * opened.t / 3e-6) ** 2
    assert np.abs(opened.pulses - ideal).max() < 0.03
    assert np.abs(opened.gaps).max() < 0.03


def test_a_supply_voltage_and_a_scale_change_nothing():
    wave = line(100, slaves=(5, 100)).waveform()
    plain, lifted = wave.eye(), replace(wave, u=1.5 * wave.u + 30).eye()
    assert lifted.pulses == pytest.approx(plain.pulses, abs=1e-9)
    assert lifted.gaps == pytest.approx(plain.gaps, abs=1e-9)
    assert len(plain.pulses) == 2 * (pulses_of(WORDS) != 0).sum()


def test_the_weakest_pulse_is_the_receivers():
    for length in (100, 150):
        wave = line(length, slaves=(5,)).waveform(dt=50e-9)
        heard, opened = wave.receive(Receiver(matched=False)), wave.eye()
        near = np.abs(opened.t) < 0.11 * 3e-6
        assert opened.pulses[:, near].max(axis=1).min() == pytest.approx(
            heard.weakest.min(), abs=0.03
        )


@pytest.mark.parametrize(
    ("u", "points", "message"),
    [
        (np.zeros((16, 320)), 61, "holds no pulse"),
        (train_of(2 * pulses_of(WORDS)), 1, "points is 1"),
        (train_of(pulses_of(WORDS))[:, :190], 61, "u ends after 4.75e-05 s"),
    ],
)
def test_what_does_not_fit_is_named(u, points, message):
    with pytest.raises(ArgumentError, match=message):
        Waveform(u, 250e-9, bits=WORDS).eye(points)
