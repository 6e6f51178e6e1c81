import numpy as np
import pytest
from scipy import stats

from shipnet.asi.emc.disturbances import (
    PACKET_LENGTH,
    PULSE_RATE,
    burst,
    burst_area,
    burst_pulse,
    burst_spectrum,
)
from shipnet.errors import ArgumentError

FINE = np.arange(0, 2e-6, 0.02e-9)


def rng():
    return np.random.default_rng(2024)


def measure(pulse):
    """Return peak, rise from 10 % to 90 %, width above half, and area of a pulse on FINE."""
    top = pulse.argmax()
    low, half, high = np.interp(np.array([0.1, 0.5, 0.9]) * pulse[top], pulse[:top], FINE[:top])
    fall = np.interp(-0.5 * pulse[top], -pulse[top:], FINE[top:])
    return pulse[top], high - low, fall - half, np.trapezoid(pulse, FINE)


def test_the_pulse_is_that_of_the_standard():
    peak, rise, width, area = measure(burst_pulse(FINE))
    assert peak == pytest.approx(1, abs=1e-5)
    # The standard tolerates 30 % of both; the constants are fitted to the nominal values.
    assert rise == pytest.approx(5e-9, rel=1e-3)
    assert width == pytest.approx(50e-9, rel=1e-3)
    assert area == pytest.approx(burst_area(), rel=1e-6)
    assert burst_pulse([-1.0, -1e-12, 0.0]).tolist() == [0, 0, 0]


def test_the_formula_of_the_standard_is_near():
    # What IEC 61000-4-4 is said to print; its text was not read, but rise and width come out.
    x = (FINE / 3.5e-9) ** 1.8
    theirs = 0.92 * x / (1 + x) * np.exp(-FINE / 51e-9)
    theirs /= np.exp(-3.5 / 51 * (1.8 * 51 / 3.5) ** (1 / 1.8))
    peak, rise, width, area = measure(theirs)
    assert peak == pytest.approx(1, rel=0.01)
    assert rise == pytest.approx(5e-9, rel=0.05)
    assert width == pytest.approx(50e-9, rel=0.05)
    assert area == pytest.approx(burst_area(), rel=0.05)


def test_the_spectrum_is_the_transform_of_the_pulse():
    f = np.fft.rfftfreq(FINE.size, 0.02e-9)
    numeric = np.fft.rfft(burst_pulse(FINE)) * 0.02e-9
    low = f < 200e6
    assert np.abs(numeric - burst_spectrum(f))[low].max() < 1e-4 * burst_area()
    assert burst_spectrum(0) == burst_area()


@pytest.mark.parametrize("corner", [0.3e6, 1e6, 2.862e6, 1e9])
@pytest.mark.parametrize("dt", [20e-9, 250e-9, 1e-6])
def test_the_samples_keep_the_area_of_the_pulses_on_any_grid(dt, corner):
    # 1 ms holds five pulses; one that the ends of the record cut is the exception.
    t = np.arange(round(1e-3 / dt)) * dt
    u = burst(t, 40.0, rng(), 60, corner=corner)
    pulses = np.abs(u.sum(axis=1)) * dt / (40 * burst_area())
    whole = np.abs(pulses - pulses.round()) < 1e-6
    assert whole.mean() > 0.9
    assert set(pulses[whole].round()) <= {4, 5}
    assert pulses.mean() == pytest.approx(1e-3 * PULSE_RATE, rel=0.01)


def test_a_sample_is_the_pulse_behind_the_low_pass_and_the_mean():
    # 100 us in steps of 10 ns with one pulse: its spectrum is the product of all three.
    dt, corner = 10e-9, 1e6
    t = np.arange(10_000) * dt
    u = burst(t, 1.0, rng(), 40, rate=1e4, corner=corner)
    u = u[(np.abs(u[:, :300]).max(axis=1) == 0) & (np.abs(u[:, -500:]).max(axis=1) < 1e-7)]
    assert len(u) > 20
    f = np.fft.rfftfreq(t.size, dt)[:1000]
    expected = np.abs(burst_spectrum(f) / (1 + 1j * f / corner)) * np.sinc(f * dt)
    numeric = np.abs(np.fft.rfft(u)[:, :1000]) * dt
    assert np.abs(numeric - expected).max() < 1e-3 * burst_area()


def test_pulses_come_at_their_rate_with_one_sign_and_any_phase():
    dt = 250e-9
    t = np.arange(round(1e-3 / dt)) * dt
    u = burst(t, 10.0, rng(), 2000)
    assert (np.sign(u.sum(axis=1))[:, np.newaxis] * u > -1e-9).all()
    assert stats.binomtest(int((u.sum(axis=1) > 0).sum()), 2000).pvalue > 0.01
    first = np.abs(u[:, :800]).argmax(axis=1)
    assert stats.kstest(first * dt, stats.uniform(0, 200e-6).cdf).pvalue > 0.01
    inside = (first > 10) & (first < 790)
    shifted = np.stack([row[800:1600] for row in u[inside]])
    np.testing.assert_allclose(shifted, u[inside, :800], atol=1e-7)
    assert PACKET_LENGTH * PULSE_RATE == 75


def test_a_pulse_ahead_of_the_record_is_still_felt_in_it():
    # A slow input makes the pulses long; the first sample is disturbed as often as the last.
    u = np.abs(burst(np.arange(100) * 250e-9, 1.0, rng(), 4000, corner=30e3))
    assert u[:, 0].mean() == pytest.approx(u[:, -1].mean(), rel=0.15)
    assert u[:, 0].mean() > 0


def test_constants_that_coincide_are_no_pole():
    t = np.arange(400) * 25e-9
    for constant in (55.61e-9, 3.291e-9):
        corner = 1 / (2 * np.pi * constant)
        at, beside = (
            burst(t, 1.0, rng(), 50, rate=1e6, corner=c) for c in (corner, corner * 1.001)
        )
        assert np.abs(at).max() > 0.1
        assert np.abs(at - beside).max() < 2e-3


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"rate": 0}, r"rate is 0 1/s; it must be 1\.\.1e\+06 1/s"),
        ({"rate": np.nan}, "rate is nan"),
        ({"corner": 10}, "corner is 10 Hz"),
        ({"corner": np.inf}, "corner is inf Hz"),
    ],
)
def test_bad_bursts_are_named(change, message):
    with pytest.raises(ArgumentError, match=message):
        burst(np.arange(256) * 250e-9, 1.0, rng(), 3, **change)
