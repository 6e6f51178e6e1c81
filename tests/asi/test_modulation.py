import itertools

import numpy as np
import pytest
from scipy.integrate import quad

from shipnet.asi import Request, Response
from shipnet.asi.channel import VARIANTS
from shipnet.asi.modulation import (
    HALF_BIT,
    ONE_PULSE_CODES,
    SEND_CURRENT,
    Modulation,
    Pulses,
    collide,
    ramp,
    ramp_spectrum,
)
from shipnet.errors import ArgumentError, FrameError, name_of
from tests.asi.lines import REQUESTS, draw

TELEGRAMS = [Response(data).bits for data in range(16)]
TELEGRAMS += [Request.data_exchange(a, d).bits for a in range(1, 32) for d in range(16)]


@pytest.mark.parametrize("bits", TELEGRAMS[::37] + TELEGRAMS[:16])
def test_rules_of_every_pulse_train(bits):
    pulses = Modulation(bits).pulses.signs
    signs = pulses[pulses != 0]
    assert signs[0] == -1, "the first pulse is negative"
    assert signs[-1] == 1, "the last pulse is positive"
    assert all(a == -b for a, b in itertools.pairwise(signs)), "signs alternate"
    assert (pulses[1::2] != 0).all(), "every bit has a pulse in its middle"
    assert [int(pulse > 0) for pulse in pulses[1::2]] == [int(bit) for bit in bits]
    equal = [a == b for a, b in itertools.pairwise(bits)]
    assert [pulse != 0 for pulse in pulses[2::2]] == equal, "a pulse between equal bits only"
    assert Modulation(bits).steps.sum() == 0, "the current returns to nothing"


def test_the_slope_is_a_sin_squared_pulse():
    x = np.linspace(0, 1, 1001)
    assert np.gradient(ramp(x), x)[1:-1] == pytest.approx(
        2 * np.sin(np.pi * x[1:-1]) ** 2, abs=2e-5
    )
    assert quad(lambda x: 2 * np.sin(np.pi * x) ** 2, 0, 1)[0] == pytest.approx(1)


@pytest.mark.parametrize(
    "s", [1e4, 3e5 + 2e5j, 2j * np.pi * 1e5, 2j * np.pi / HALF_BIT, 7e5 - 4e6j]
)
def test_ramp_spectrum_is_the_integral(s):
    def part(kind):
        return quad(
            lambda t: kind(2 / HALF_BIT * np.sin(np.pi * t / HALF_BIT) ** 2 * np.exp(-s * t)),
            0,
            HALF_BIT,
            epsabs=1e-12,
        )[0]

    assert ramp_spectrum(s) == pytest.approx(part(np.real) + 1j * part(np.imag), abs=1e-9)


def test_spectrum_and_time_agree():
    # A Laplace contour off the axis, as in the line solver, restores the time signal.
    duration, n = 102.4e-6, 4096
    t = np.arange(n) * duration / n
    damping = 7.0
    s = damping / duration + 2j * np.pi * np.arange(n // 2 + 1) / duration
    spectrum = Modulation("0011001").transform(s, start=5e-6)
    back = np.fft.irfft(spectrum, n) * n / duration * np.exp(damping * t / duration)
    assert back == pytest.approx(
        Modulation("0011001").current(t, start=5e-6), abs=1e-6 * SEND_CURRENT
    )


def test_a_batch_equals_its_telegrams():
    bits = np.array([[int(bit) for bit in word] for word in TELEGRAMS[:16]]).reshape(4, 4, 7)
    t = np.arange(0, 45e-6, 1e-6)
    s = 1e5 + 2j * np.pi * np.arange(0, 5) * 1e5
    currents, spectra = Modulation(bits).current(t), Modulation(bits).transform(s)
    assert currents.shape == (4, 4, t.size)
    for index, word in zip(np.ndindex(4, 4), TELEGRAMS[:16], strict=True):
        assert (Modulation(bits).pulses.signs[index] == Modulation(word).pulses.signs).all()
        assert currents[index] == pytest.approx(Modulation(word).current(t))
        assert spectra[index] == pytest.approx(Modulation(word).transform(s))


@pytest.mark.parametrize("bits", ["", [], [0, 2], [[0.5]], 1, "0a", "01\u0661"])
def test_other_bits_are_refused(bits):
    with pytest.raises(ArgumentError, match=r"bits .*must"):
        Modulation(bits)


def test_a_current_has_no_value_at_frequency_0():
    with pytest.raises(ArgumentError, match="s contains 0"):
        Modulation("01").transform([1j, 0])


def test_a_spectrum_is_the_transform_of_the_slope():
    code = Modulation("0011001")
    t = np.arange(0, 50e-6, 5e-9)
    slope = np.gradient(code.current(t), t)
    by_hand = [abs(np.trapezoid(slope * np.exp(-2j * np.pi * f * t), t)) for f in (50e3, 167e3)]
    assert code.spectrum([50e3, 167e3]) == pytest.approx(by_hand, rel=1e-3)


ANSWERS = [Response(data).bits for data in range(16)]


def test_different_answers_at_once_never_pass_for_an_answer():
    for first, second in itertools.product(ANSWERS, repeat=2):
        bits, error = collide(((first, 0), (second, 0)), 7)
        assert (error == 0) == (first == second)
        assert bits == (first if first == second else "")


@pytest.mark.parametrize("shift", range(1, 14))
def test_partly_overlapping_answers_never_pass(shift):
    for first, second in itertools.product(ANSWERS, repeat=2):
        assert collide(((first, 0), (second, shift)), 7)[1] != 0


def test_an_answer_over_a_request_never_makes_another_request():
    pulses = np.pad(Modulation(REQUESTS).pulses.signs.astype(int), ((0, 0), (0, 2)))
    survived = 0
    for answer, shift in itertools.product(ANSWERS, range(28)):
        both = pulses.copy()
        heard = Modulation(answer).pulses.signs[: 30 - shift]
        both[:, shift : shift + heard.size] += heard
        bits, error = Pulses(np.sign(both)).check()
        passed = error == 0
        assert (bits[passed] == REQUESTS[passed]).all()
        survived += passed.sum()
    # It survives only if the pulses of both coincide: 2560 of 917504 cases.
    assert survived == 2560


def test_the_codes_of_one_disturbed_pulse_are_those_that_the_scalar_receiver_finds():
    for data, codes in enumerate(ONE_PULSE_CODES):
        word = np.pad(Modulation(ANSWERS[data]).pulses.signs, (0, 2))
        wrong = iter(codes)
        for slot in range(16):
            for value in sorted({-1, 0, 1} - {int(word[slot])}):
                other = word.copy()
                other[slot] = value
                with pytest.raises(FrameError) as caught:
                    Pulses(other).decode()
                assert type(caught.value).__name__ == name_of(next(wrong))


def test_disturbances_have_the_given_rates_and_are_independent():
    rng = np.random.default_rng(3)
    drawn = draw(rng, 8000, [0.1, 0.0, 1.0], [0.2, 0.0, 1.0], attempts=3)
    assert drawn.shape == (8000, 3, 3, 3)
    lost, missed, variant = drawn["lost"], drawn["missed"], drawn["variant"]
    assert not any(column[..., 1, :].any() for column in (lost, missed, variant))
    n = drawn[..., 0, :].size
    for share, p in ((lost, 0.1), (missed, 0.1), (variant > 0, 0.2), (lost & missed, 0.01)):
        assert share[..., 0, :].mean() == pytest.approx(p, abs=5 * np.sqrt(p / n))
    assert lost[..., 2, :].all() and missed[..., 2, :].all()
    counts = np.bincount(variant[..., 2, :].ravel(), minlength=VARIANTS + 1)
    assert counts[0] == 0 and counts.size == VARIANTS + 1
    assert (np.abs(counts[1:] / n - 1 / VARIANTS) < 5 * np.sqrt(1 / VARIANTS / n)).all()
