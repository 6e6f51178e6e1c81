"""Confidence intervals, against scipy's exact tests."""

import pytest
from scipy.stats import binomtest, poisson

from shipnet.errors import ArgumentError
from shipnet.intervals import event_interval, share_interval


@pytest.mark.parametrize(("hits", "n"), [(0, 1), (0, 2048), (3, 7), (7, 7), (100, 2048)])
@pytest.mark.parametrize("confidence", [0.5, 0.95, 0.999])
def test_the_interval_of_a_fraction_is_that_of_the_exact_test(hits, n, confidence):
    low, high = share_interval(hits, n, confidence=confidence)
    peer = binomtest(hits, n).proportion_ci(confidence, method="exact")
    assert (low, high) == pytest.approx((peer.low, peer.high), abs=1e-9)


@pytest.mark.parametrize("events", [0, 1, 4, 250])
def test_the_interval_of_a_rate_has_equal_tail_probabilities(events):
    low, high = event_interval(events, 3.0, confidence=0.9)
    assert poisson.cdf(events, 3.0 * high) == pytest.approx(0.05)
    if events:
        assert poisson.sf(events - 1, 3.0 * low) == pytest.approx(0.05)
    else:
        assert low == 0


def test_intervals_of_arrays_and_without_trials():
    low, high = share_interval([0, 1, 0], [0, 2, 4])
    assert low[0] == 0
    assert high[0] == 1
    assert low.shape == high.shape == (3,)


@pytest.mark.parametrize("confidence", [0.0, 1.0, float("nan"), 95, None])
def test_an_impossible_confidence_is_named(confidence):
    for interval in (share_interval, event_interval):
        with pytest.raises(ArgumentError, match=f"confidence is {confidence}"):
            interval(1, 2, confidence=confidence)
