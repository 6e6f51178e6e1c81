from functools import partial

import numpy as np
import pytest
from scipy import stats

from shipnet.asi.emc.disturbances import burst, conducted_rf, impulses, noise
from shipnet.asi.emc.monte_carlo import all_telegrams, telegram_error_rate
from shipnet.asi.topology import straight_line
from shipnet.errors import ArgumentError

DT = 250e-9
T = np.arange(256) * DT
ALL = [noise, impulses, partial(conducted_rf, frequency=200e3), partial(burst, rate=50e3)]
NAMES = ["noise", "impulses", "conducted_rf", "burst"]
each = pytest.mark.parametrize("make", ALL, ids=NAMES)


def rng():
    return np.random.default_rng(2024)


@each
def test_a_disturbance_has_a_row_a_telegram_and_follows_its_generator(make):
    u = make(T, 1.5, rng(), 7)
    assert u.shape == (7, T.size)
    assert np.isfinite(u).all()
    np.testing.assert_array_equal(u, make(T, 1.5, rng(), 7))
    assert (u != make(T, 1.5, np.random.default_rng(1), 7)).any()
    assert np.unique(u, axis=0).shape[0] == 7
    assert make(T, 1.5, rng(), 0).shape == (0, T.size)
    assert make(T, 1.5, rng()).shape == (1, T.size)


@each
def test_a_disturbance_grows_with_its_amplitude(make):
    one = make(T, 1.0, rng(), 50)
    assert make(T, 2.5, rng(), 50) == pytest.approx(2.5 * one, rel=1e-12)
    assert not make(T, 0, rng(), 50).any()
    # Neither sign is preferred: the sum is small beside what one sign alone would add up to.
    many = make(T, 1.0, rng(), 4000)
    assert abs(many.sum()) < 0.1 * np.abs(many).sum()


@each
@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"t": []}, "t has the shape .0,. .* a row of two times or more"),
        ({"t": [1.0]}, "t has the shape .1,."),
        ({"t": [[0.0, 1.0]]}, "t has the shape .1, 2."),
        ({"t": ["a", "b"]}, "dtype <U1"),
        ({"t": [0, 1, 3]}, "t must be finite, rise and be evenly spaced"),
        ({"t": [0, 0, 0]}, "t must be finite, rise"),
        ({"t": [2, 1, 0]}, "t must be finite, rise"),
        ({"t": [0, np.nan, 2]}, "t must be finite"),
        ({"t": [0, 1, np.inf]}, "t must be finite"),
        ({"amplitude": -1}, r"amplitude is -1 V; it must be 0..1e\+09 V"),
        ({"amplitude": np.nan}, "amplitude is nan V"),
        ({"amplitude": np.inf}, "amplitude is inf V"),
        ({"amplitude": "1"}, "amplitude is '1'"),
        ({"amplitude": [1, 2]}, "must be a single number"),
        ({"size": -1}, "size is -1"),
        ({"size": 1.5}, "size is 1.5"),
    ],
)
def test_bad_arguments_are_named(make, change, message):
    arguments = {"t": T, "amplitude": 1.0, "rng": rng(), "size": 3} | change
    with pytest.raises(ArgumentError, match=message), np.errstate(invalid="ignore"):
        make(**arguments)


def test_noise_is_normal_and_white():
    u = noise(T, 0.7, rng(), 2000)
    assert stats.kstest(u.ravel()[::5], stats.norm(0, 0.7).cdf).pvalue > 0.01
    # 510 000 pairs of neighbours: their correlation would be 0 within 1.4e-3.
    assert abs(np.mean(u[:, 1:] * u[:, :-1])) / 0.49 < 6e-3


def test_an_impulse_is_a_raised_cosine():
    width = 3e-6
    # Far from the ends all of it is inside: area a w / 2, energy 3 a^2 w / 8, on any phase.
    u = impulses(T, 2.0, rng(), 500, width=(width, width), spread=0, between=(10e-6, 50e-6))
    assert np.abs(u.sum(axis=1)) * DT == pytest.approx(2.0 * width / 2, rel=1e-9)
    assert (u**2).sum(axis=1) * DT == pytest.approx(3 / 8 * 4.0 * width, rel=1e-9)
    assert set((u != 0).sum(axis=1)) <= {11, 12, 13}
    assert np.abs(u).max() <= 2.0


@pytest.mark.parametrize("width", [0.4e-6, 2.9e-6, 2.95e-6])
def test_an_impulse_follows_its_formula_on_any_phase(width):
    for middle in 30e-6 + np.linspace(0, DT, 7):
        u = impulses(T, 2.0, rng(), 1, width=(width, width), spread=0, between=(middle, middle))
        x = (T - middle) / width
        expected = np.where(np.abs(x) < 0.5, 1 + np.cos(2 * np.pi * x), 0)
        np.testing.assert_allclose(np.abs(u[0]), expected, atol=1e-9)


def test_places_signs_heights_and_widths_are_drawn_evenly():
    fine = np.arange(2560) * 25e-9
    u = impulses(fine, 2.0, rng(), 4000, width=(1e-6, 4e-6), between=(5e-6, 47e-6))
    area = np.abs(u).sum(axis=1)
    middle = (np.abs(u) @ fine) / area
    height = np.abs(u).max(axis=1)
    width = 2 * area * 25e-9 / height
    for value, low, high in ((middle, 5e-6, 47e-6), (height, 1, 3), (width, 1e-6, 4e-6)):
        assert stats.kstest(value, stats.uniform(low, high - low).cdf).pvalue > 0.01
    assert stats.binomtest(int((u.sum(axis=1) > 0).sum()), 4000).pvalue > 0.01
    assert abs(np.corrcoef([middle, height, width])[np.triu_indices(3, 1)]).max() < 0.06


def test_an_impulse_at_an_end_of_the_record_is_cut():
    wide = {"width": (4e-6, 4e-6), "spread": 0.0}
    for end in (0, -1):
        u = impulses(T, 1.0, rng(), 1, between=(T[end], T[end]), **wide)
        assert abs(u[0, end]) == pytest.approx(1)
        assert (u != 0).sum() == 8
    for outside in (-1e-5, 1e-4, -1e6, 1e6):
        assert not impulses(T, 1.0, rng(), 5, between=(outside, outside), **wide).any()


def test_several_impulses_add_up():
    fixed = {"width": (2e-6, 2e-6), "spread": 0.0, "between": (30e-6, 30e-6)}
    peak = np.abs(impulses(T, 1.0, rng(), 400, count=3, **fixed)).max(axis=1)
    assert np.unique(peak.round(9)).tolist() == [1, 3]
    assert np.mean(peak > 2) == pytest.approx(0.25, abs=0.08)
    assert not impulses(T, 1.0, rng(), 3, count=0).any()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"count": -1}, r"count is -1; it must be a whole number 0..1000"),
        ({"count": 1.5}, "count is 1.5"),
        ({"spread": 1.1}, "spread is 1.1"),
        ({"width": 1e-6}, "width is 1e-06; it must be two times"),
        ({"width": (0, 1e-6)}, "width begins with 0 s"),
        ({"width": (2e-6, 1e-6)}, r"width is 2e-06\.\.1e-06 s; its end"),
        ({"width": (1e-6, 1.0)}, "width is 1 s"),
        ({"between": (2e-6, 1e-6)}, "between is"),
        ({"between": (np.nan, 1e-6)}, "between is nan s"),
        ({"between": (1, 2, 3)}, "must be two times"),
    ],
)
def test_bad_impulses_are_named(change, message):
    with pytest.raises(ArgumentError, match=message):
        partial(impulses, **change)(T, 1.0, rng(), 3)


def test_a_carrier_has_two_sidebands():
    # 2 ms hold whole periods of 200 kHz and of 1 kHz, so that the lines stand alone.
    t = np.arange(8000) * DT
    u = conducted_rf(t, 3.0, rng(), 20, frequency=200e3, modulation=0.6)
    lines = 2 * np.abs(np.fft.rfft(u)) / t.size
    f = np.fft.rfftfreq(t.size, DT)
    expected = np.zeros_like(f)
    for frequency, height in ((200e3, 3.0), (199e3, 0.9), (201e3, 0.9)):
        expected[np.abs(f - frequency).argmin()] = height
    np.testing.assert_allclose(lines, np.tile(expected, (20, 1)), atol=1e-9)
    assert np.abs(u).max(axis=1) == pytest.approx(3 * 1.6, rel=0.015)


def test_a_carrier_without_modulation_is_a_sine_of_the_phase_given():
    u = conducted_rf(T, 2.0, rng(), 3, frequency=333e3, modulation=0, phase=0.7)
    np.testing.assert_allclose(u, [2 * np.sin(2 * np.pi * 333e3 * T + 0.7)] * 3, atol=1e-9)
    slow = conducted_rf(T, 2.0, rng(), 3, frequency=333e3, phase=0.7)
    np.testing.assert_allclose(np.sign(slow), np.sign(u))


def test_a_telegram_meets_the_carrier_at_any_strength_and_phase():
    u = conducted_rf(T, 1.0, rng(), 4000, frequency=200e3)
    peak = np.abs(u).max(axis=1)
    assert 0.2 < peak.min() < 0.3
    assert 1.7 < peak.max() < 1.81
    # 1 + 0.8 sin of an even phase: below x as often as the arcsine law says.
    law = stats.arcsine(0.2, 1.6).cdf
    assert stats.kstest(peak, law).statistic < 0.08
    turned = np.angle(u @ np.exp(-2j * np.pi * 200e3 * T))
    assert stats.kstest(turned, stats.uniform(-np.pi, 2 * np.pi).cdf).pvalue > 0.01
    seen = np.corrcoef([peak, np.cos(turned), np.sin(turned)])
    assert np.abs(seen[np.triu_indices(3, 1)]).max() < 0.06


def test_a_carrier_in_a_zero_of_the_filter_does_no_harm():
    # The filter of 3 us is blind at 667 kHz; at 200 kHz, amid the signal, 2.5 V do harm.
    near = all_telegrams(straight_line(100, slaves=(5,)))
    rates = {
        frequency: telegram_error_rate(
            near, partial(conducted_rf, frequency=frequency, f_mod=0), 2.5, 500, rng()
        )["rate"][0]
        for frequency in (200e3, 2 / 3e-6)
    }
    assert rates[200e3] > 0.5
    assert rates[2 / 3e-6] == 0


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"frequency": 2e6}, r"frequency is 2e\+06 Hz; .* below 2e\+06 Hz, half the sampling rate"),
        ({"frequency": 1.9995e6}, "with its sideband it must lie below"),
        ({"frequency": 0}, "frequency is 0 Hz"),
        ({"frequency": np.nan}, "frequency is nan Hz"),
        ({"modulation": 1.1}, "modulation is 1.1"),
        ({"f_mod": 3e5}, "f_mod is 300000 Hz"),
        ({"phase": np.inf}, "phase is inf rad"),
    ],
)
def test_bad_carriers_are_named(change, message):
    with pytest.raises(ArgumentError, match=message):
        conducted_rf(T, 1.0, rng(), 3, **{"frequency": 2e5} | change)
