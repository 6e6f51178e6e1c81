import numpy as np
import pytest
from scipy import stats

from shipnet.asi.emc.disturbances import (
    _DECAY,
    _RISE,
    AREA,
    INPUT_CORNER,
    PULSE_RATE,
    Burst,
    ConductedRF,
    Impulses,
    Noise,
)
from shipnet.errors import ArgumentError

DT = 250e-9
T = np.arange(256) * DT
ALL = [Noise(), Impulses(), ConductedRF(200e3), Burst(rate=50e3)]
each = pytest.mark.parametrize("disturbance", ALL, ids=lambda one: type(one).__name__)


def rng():
    return np.random.default_rng(2024)


def draw(disturbance, t, amplitude, rng, size=1, *, span=None):
    span = (t[0], t[-1]) if span is None else span
    return disturbance.voltage(t, amplitude, rng, size, span=span)


@each
def test_a_disturbance_has_a_row_per_telegram_and_follows_its_generator(disturbance):
    u = draw(disturbance, T, 1.5, rng(), 7)
    assert u.shape == (7, T.size)
    assert np.isfinite(u).all()
    np.testing.assert_array_equal(u, draw(disturbance, T, 1.5, rng(), 7))
    assert (u != draw(disturbance, T, 1.5, np.random.default_rng(1), 7)).any()
    assert np.unique(u, axis=0).shape[0] == 7
    assert draw(disturbance, T, 1.5, rng(), 0).shape == (0, T.size)
    assert draw(disturbance, T, 1.5, rng()).shape == (1, T.size)


@each
def test_a_disturbance_grows_with_its_amplitude(disturbance):
    one = draw(disturbance, T, 1.0, rng(), 50)
    assert draw(disturbance, T, 2.5, rng(), 50) == pytest.approx(2.5 * one, rel=1e-12)
    assert not draw(disturbance, T, 0, rng(), 50).any()
    # Neither sign is preferred: the sum is small compared with that of one sign alone.
    many = draw(disturbance, T, 1.0, rng(), 4000)
    assert abs(many.sum()) < 0.1 * np.abs(many).sum()


def test_noise_is_normal_and_white():
    u = draw(Noise(), T, 0.7, rng(), 2000)
    assert stats.kstest(u.ravel()[::5], stats.norm(0, 0.7).cdf).pvalue > 0.01
    # 510 000 pairs of neighbours: if independent, their correlation is 0 within 1.4e-3.
    assert abs(np.mean(u[:, 1:] * u[:, :-1])) / 0.49 < 6e-3


@pytest.mark.parametrize("width", [0.4e-6, 2.9e-6, 2.95e-6])
def test_an_impulse_follows_its_formula_on_any_phase(width):
    for middle in 30e-6 + np.linspace(0, DT, 7):
        u = draw(Impulses(1, (width, width), 0), T, 2.0, rng(), span=(middle, middle))
        x = (T - middle) / width
        expected = np.where(np.abs(x) < 0.5, 1 + np.cos(2 * np.pi * x), 0)
        np.testing.assert_allclose(np.abs(u[0]), expected, atol=1e-9)


def test_places_signs_heights_and_widths_are_drawn_evenly():
    fine = np.arange(2560) * 25e-9
    u = draw(Impulses(width=(1e-6, 4e-6)), fine, 2.0, rng(), 4000, span=(5e-6, 47e-6))
    area = np.abs(u).sum(axis=1)
    middle = (np.abs(u) @ fine) / area
    height = np.abs(u).max(axis=1)
    width = 2 * area * 25e-9 / height
    for value, low, high in ((middle, 5e-6, 47e-6), (height, 1, 3), (width, 1e-6, 4e-6)):
        assert stats.kstest(value, stats.uniform(low, high - low).cdf).pvalue > 0.01
    assert stats.binomtest(int((u.sum(axis=1) > 0).sum()), 4000).pvalue > 0.01
    assert abs(np.corrcoef([middle, height, width])[np.triu_indices(3, 1)]).max() < 0.06


def test_an_impulse_at_an_end_of_the_record_is_cut():
    wide = Impulses(1, (4e-6, 4e-6), 0)
    for end in (0, -1):
        u = draw(wide, T, 1.0, rng(), span=(T[end], T[end]))
        assert abs(u[0, end]) == pytest.approx(1)
        assert (u != 0).sum() == 8
    for outside in (-1e-5, 1e-4, -1e6, 1e6):
        assert not draw(wide, T, 1.0, rng(), 5, span=(outside, outside)).any()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"count": -1}, r"count is -1; it must be a whole number 0..1000"),
        ({"count": 1.5}, "count is 1.5"),
        ({"spread": 1.1}, "spread is 1.1"),
        ({"width": (1e-6,)}, r"width is \(1e-06,\)"),
        ({"width": (0, 1e-6)}, r"width is \(0, 1e-06\); it must be two durations in .* above 0"),
        ({"width": (2e-6, 1e-6)}, "in ascending order"),
        ({"width": (1e-6, 1.0)}, "and up to 6.* s"),
        ({"width": (1e-6, np.nan)}, "width is"),
    ],
)
def test_bad_impulses_are_named(change, message):
    with pytest.raises(ArgumentError, match=message):
        draw(Impulses(**change), T, 1.0, rng(), 3)


def test_a_carrier_has_two_sidebands():
    # 2 ms contain whole periods of 200 kHz and of 1 kHz, so that the lines are separate.
    t = np.arange(8000) * DT
    u = draw(ConductedRF(200e3, 0.6), t, 3.0, rng(), 20)
    lines = 2 * np.abs(np.fft.rfft(u)) / t.size
    f = np.fft.rfftfreq(t.size, DT)
    expected = np.zeros_like(f)
    for frequency, height in ((200e3, 3.0), (199e3, 0.9), (201e3, 0.9)):
        expected[np.abs(f - frequency).argmin()] = height
    np.testing.assert_allclose(lines, np.tile(expected, (20, 1)), atol=1e-9)
    assert np.abs(u).max(axis=1) == pytest.approx(3 * 1.6, rel=0.015)


def test_a_telegram_meets_the_carrier_at_any_strength_and_phase():
    u = draw(ConductedRF(200e3), T, 1.0, rng(), 4000)
    peak = np.abs(u).max(axis=1)
    assert 0.2 < peak.min() < 0.3
    assert 1.7 < peak.max() < 1.81
    # 1 + 0.8 sin of a uniform phase: below x as often as the arcsine law says.
    law = stats.arcsine(0.2, 1.6).cdf
    assert stats.kstest(peak, law).statistic < 0.08
    turned = np.angle(u @ np.exp(-2j * np.pi * 200e3 * T))
    assert stats.kstest(turned, stats.uniform(-np.pi, 2 * np.pi).cdf).pvalue > 0.01
    seen = np.corrcoef([peak, np.cos(turned), np.sin(turned)])
    assert np.abs(seen[np.triu_indices(3, 1)]).max() < 0.06


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"frequency": 2e6}, r"frequency is 2e\+06 Hz; .* below 2e\+06 Hz, half the sampling rate"),
        ({"frequency": 1.9995e6}, "with its sideband it must be below"),
        ({"frequency": 0}, "frequency is 0 Hz"),
        ({"frequency": np.nan}, "frequency is nan Hz"),
        ({"modulation": 1.1}, "modulation is 1.1"),
        ({"f_mod": 3e5}, "f_mod is 300000 Hz"),
    ],
)
def test_bad_carriers_are_named(change, message):
    with pytest.raises(ArgumentError, match=message):
        draw(ConductedRF(**{"frequency": 2e5} | change), T, 1.0, rng(), 3)


FINE = np.arange(0, 2e-6, 0.02e-9)


def two_exponentials(t):
    """Return the pulse of height 1 with the time constants of the package."""
    raw = np.where(t >= 0, np.exp(-t / _DECAY) - np.exp(-t / _RISE), 0)
    return raw * AREA / (_DECAY - _RISE)


def measure(pulse):
    """Return peak, rise from 10 % to 90 %, width above half, and area of a pulse on FINE."""
    top = pulse.argmax()
    low, half, high = np.interp(np.array([0.1, 0.5, 0.9]) * pulse[top], pulse[:top], FINE[:top])
    fall = np.interp(-0.5 * pulse[top], -pulse[top:], FINE[top:])
    return pulse[top], high - low, fall - half, np.trapezoid(pulse, FINE)


def test_the_pulse_is_that_of_the_standard():
    peak, rise, width, area = measure(two_exponentials(FINE))
    assert peak == pytest.approx(1, abs=1e-5)
    # The standard tolerates 30 % of both; the constants are fitted to the nominal values.
    assert rise == pytest.approx(5e-9, rel=1e-3)
    assert width == pytest.approx(50e-9, rel=1e-3)
    assert area == pytest.approx(AREA, rel=1e-6)


def test_the_formula_of_the_standard_is_close_to_ours():
    # As IEC 61000-4-4 is quoted; we have not read its text, but rise and width agree.
    x = (FINE / 3.5e-9) ** 1.8
    theirs = 0.92 * x / (1 + x) * np.exp(-FINE / 51e-9)
    theirs /= np.exp(-3.5 / 51 * (1.8 * 51 / 3.5) ** (1 / 1.8))
    peak, rise, width, area = measure(theirs)
    assert peak == pytest.approx(1, rel=0.01)
    assert rise == pytest.approx(5e-9, rel=0.05)
    assert width == pytest.approx(50e-9, rel=0.05)
    assert area == pytest.approx(AREA, rel=0.05)


@pytest.mark.parametrize("dt", [20e-9, 250e-9, 1e-6])
def test_the_samples_keep_the_area_of_the_pulses_on_any_grid(dt):
    # 1 ms contains five pulses, unless an end of the record cuts one.
    t = np.arange(round(1e-3 / dt)) * dt
    u = draw(Burst(), t, 40.0, rng(), 60)
    pulses = np.abs(u.sum(axis=1)) * dt / (40 * AREA)
    whole = np.abs(pulses - pulses.round()) < 1e-6
    assert whole.mean() > 0.9
    assert set(pulses[whole].round()) <= {4, 5}
    assert pulses.mean() == pytest.approx(1e-3 * PULSE_RATE, rel=0.01)


def test_a_sample_is_the_pulse_after_the_low_pass_and_the_mean():
    # 100 us in steps of 10 ns with one pulse: its spectrum is the product of all three.
    dt = 10e-9
    t = np.arange(10_000) * dt
    u = draw(Burst(1e4), t, 1.0, rng(), 40)
    u = u[(np.abs(u[:, :300]).max(axis=1) == 0) & (np.abs(u[:, -500:]).max(axis=1) < 1e-7)]
    assert len(u) > 20
    f = np.fft.rfftfreq(t.size, dt)[:1000]
    s = 2j * np.pi * f
    pulse = AREA / ((1 + s * _DECAY) * (1 + s * _RISE))
    expected = np.abs(pulse / (1 + 1j * f / INPUT_CORNER)) * np.sinc(f * dt)
    numeric = np.abs(np.fft.rfft(u)[:, :1000]) * dt
    assert np.abs(numeric - expected).max() < 1e-3 * AREA


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"rate": 0}, r"rate is 0 1/s; it must be 1\.\.1e\+06 1/s"),
        ({"rate": np.nan}, "rate is nan"),
    ],
)
def test_bad_bursts_are_named(change, message):
    with pytest.raises(ArgumentError, match=message):
        Burst(**change)
