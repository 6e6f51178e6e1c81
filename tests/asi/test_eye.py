from dataclasses import replace

import numpy as np
import pytest

from shipnet.asi.modulation import Modulation
from shipnet.asi.receiver import Receiver, Waveform
from shipnet.asi.telegram import RESPONSES
from shipnet.asi.topologies import line
from shipnet.errors import ArgumentError
from shipnet.papers.kim2023.signals import train_of

WORDS = Modulation(RESPONSES).bits


def test_ideal_pulses_coincide():
    opened = Waveform(train_of(1.5 * Modulation(WORDS).pulses.signs), 250e-9, bits=WORDS).eye()
    assert opened.t.tolist() == np.linspace(-1.5e-6, 1.5e-6, 61).tolist()
    assert len(opened.pulses) == (Modulation(WORDS).pulses.signs != 0).sum()
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
    assert len(plain.pulses) == 2 * (Modulation(WORDS).pulses.signs != 0).sum()
    # Each telegram is relative to its own mean and divided by its own largest sample.
    scaled = replace(
        wave, u=wave.u * np.linspace(1, 2, 16)[:, np.newaxis] + np.arange(16.0)[:, np.newaxis]
    )
    assert scaled.eye().pulses == pytest.approx(plain.pulses, abs=1e-9)
    assert np.abs(plain.pulses).max() == pytest.approx(1, abs=1e-12)


def test_the_weakest_pulse_is_the_receivers():
    for length in (100, 150):
        wave = line(length, slaves=(5,)).waveform(dt=50e-9)
        heard, opened = wave.receive(Receiver(matched=False)), wave.eye()
        near = np.abs(opened.t) < 0.11 * 3e-6
        assert opened.pulses[:, near].max(axis=1).min() == pytest.approx(
            heard.weakest.min(), abs=0.03
        )


@pytest.mark.parametrize(
    ("u", "message"),
    [
        (np.zeros((16, 320)), "^a telegram in u has no pulse above the receiver's minimum$"),
        (train_of(Modulation(WORDS).pulses.signs)[:, :190], "u ends after 4.75e-05 s"),
    ],
)
def test_what_does_not_fit_is_named(u, message):
    with pytest.raises(ArgumentError, match=message):
        Waveform(u, 250e-9, bits=WORDS).eye()


@pytest.mark.parametrize(
    ("bits", "message"),
    [
        (WORDS[:5], r"^bits have shape \(5, 7\), but u has shape \(16, 268\)$"),
        (np.tile(WORDS, (2, 1, 1)), r"shape \(2, 16, 7\), but u has shape \(16, 268\)$"),
        (WORDS[:, :5], r"^n_bits is 5; it must be 7 \(a response\) or 14 \(a request\)$"),
    ],
)
def test_bits_that_do_not_fit_the_voltages_are_refused(bits, message):
    with pytest.raises(ArgumentError, match=message):
        Waveform(np.zeros((16, 268)), 250e-9, bits=bits)
    one = Waveform(np.zeros((16, 268)), 250e-9, bits=WORDS[0].tolist())
    assert one.bits.shape == (7,)
    assert one.span == pytest.approx((0, 42e-6))
