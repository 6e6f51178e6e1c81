import itertools

import numpy as np
import pytest

from shipnet.asi import Response
from shipnet.asi.channel import VARIANTS
from shipnet.asi.modulation import ONE_PULSE_CODES, Modulation, Pulses, collide
from shipnet.errors import FrameError, name_of
from tests.asi.lines import REQUESTS, draw

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
