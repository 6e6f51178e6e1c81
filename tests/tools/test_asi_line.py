import numpy as np
import pytest

from shipnet.asi.receiver import matched_filter
from shipnet.tools.asi_line import FILTERED, STEP, AsiLine


def test_a_line_with_uneven_pulses_fails_even_if_the_response_is_read():
    far = AsiLine(length=230, place=230)
    assert far.numbers["ringing"] > "30%" and far.verdict.startswith("read 0011001: ")
    assert not far.ok and far.verdict.endswith("; the pulses are outside their tolerance")


def test_noise_hides_the_response_and_another_try_may_pass():
    assert AsiLine(noise=10).verdict.startswith("SilenceError: no pulse")
    assert list(AsiLine(noise=10).numbers) == ["signal"]
    assert {AsiLine(noise=0.9, seed=seed).ok for seed in range(30)} == {True, False}


def test_a_fault_that_no_check_finds_is_named(monkeypatch):
    other = AsiLine(data=0)
    monkeypatch.setattr(AsiLine, "result", other.result)
    verdict = "read 0000001, but 0011001 was sent: the fault went undetected"
    assert AsiLine().verdict == verdict and not AsiLine().ok


def test_the_filter_reduces_the_noise_by_the_computed_ratio():
    noise = np.random.default_rng(1).normal(0, 1, (200, 4000))
    assert matched_filter(noise, STEP).std() == pytest.approx(FILTERED, rel=0.01)


def test_a_slave_beyond_the_end_is_at_the_end():
    beyond, end = (AsiLine(length=50, place=place).wave.u for place in (300, 50))
    assert beyond == pytest.approx(end)
