"""Random faults: the published sum, a count of drawn faults, and a bus that is played."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from shipnet.can.schedule import (
    Convention,
    ErrorModel,
    Message,
    MessageSet,
    fault_table,
    miss_probability,
    response_times,
)
from shipnet.errors import ArgumentError
from tests.can_simulation import simulate

FAST = 1_000_000
US = 1e-6


def messages():
    return MessageSet(
        [
            Message("A", 1, 8, 1500 * US, bits=135),
            Message("B", 2, 4, 2500 * US, deadline=2000 * US, bits=95),
            Message("C", 3, 8, 5000 * US, jitter=200 * US, bits=135),
        ]
    )


def published_sum(windows, rate):
    """Return p_K by the recursion of Broster et al., which subtracts."""
    p = []
    for k, window in enumerate(windows):
        earlier = sum(
            p[j] * stats.poisson.pmf(k - j, rate * (window - windows[j])) for j in range(k)
        )
        p.append(stats.poisson.pmf(k, rate * window) - earlier)
    return np.array(p)


@pytest.mark.parametrize("name", "ABC")
@pytest.mark.parametrize("rate", [1.0, 300.0, 3000.0])
@pytest.mark.parametrize("method", ["1994", "sufficient"])
def test_probabilities_are_those_of_the_published_sum(name, rate, method):
    table = fault_table(messages(), FAST, name, rate, 28, method=method)
    windows = table["response_ms"].to_numpy() / 1e3 - messages()[name].jitter
    expected = published_sum(windows, rate)
    # The published sum loses digits by subtraction: twelve behind the point are left.
    assert table["probability"].to_numpy() == pytest.approx(expected, rel=1e-9, abs=1e-12)
    later = 1 - np.cumsum(table["probability"])
    assert table["later"].to_numpy() == pytest.approx(later.to_numpy(), abs=1e-12)
    met = table["response_ms"] <= messages()[name].deadline * 1e3
    assert table["met"].tolist() == met.tolist()
    place = messages().names.index(name)
    missed = miss_probability(messages(), FAST, rate, method=method)[place]
    within = fault_table(messages(), FAST, name, rate, int(met.sum()) - 1, method=method)
    assert 0 < met.sum() < len(table)
    assert missed == pytest.approx(within["later"].iloc[-1], rel=1e-12)


def test_responses_are_those_of_the_analysis_with_so_many_faults():
    for method in ("sufficient", "1994"):
        table = fault_table(messages(), FAST, "C", 10, 4, method=method, error_bits=29)
        for k, response in enumerate(table["response_ms"]):
            found = response_times(messages(), FAST, method=method, errors=ErrorModel(k, bits=29))
            assert response == pytest.approx(found[2].response * 1e3, rel=1e-12)


def test_drawn_faults_miss_as_often_as_the_probability_says():
    # Each draw ends at the first K with no more than K faults up to R_K.
    rate, n = 1500.0, 40_000
    rng = np.random.default_rng(2024)
    table = fault_table(messages(), FAST, "B", rate, 40)
    windows = table["response_ms"].to_numpy() / 1e3
    times = np.cumsum(rng.exponential(1 / rate, size=(n, 60)), axis=1)
    count = (times[:, np.newaxis, :] <= windows[:, np.newaxis]).sum(axis=2)
    passes = count <= np.arange(len(windows))
    first = np.where(passes.any(axis=1), passes.argmax(axis=1), len(windows))
    drawn = np.bincount(first, minlength=len(windows) + 1)[: len(windows)] / n
    p = table["probability"].to_numpy()
    # Five standard deviations of a share of n draws, and one draw.
    assert (np.abs(drawn - p) <= 5 * np.sqrt(p * (1 - p) / n) + 1 / n).all()
    assert p[:4].min() > 0.01
    most = int(table["met"].sum())
    missed = miss_probability(messages(), FAST, rate)[1]
    assert (first >= most).mean() == pytest.approx(missed, abs=5 * math.sqrt(missed / n))


def test_a_played_bus_misses_no_more_often_than_the_probability_says():
    # Critical release of B behind C; faults are drawn along the time axis.
    rate, n, frames, deadline = 3000.0, 4000, [135, 95, 135], 700
    rng = np.random.default_rng(7)
    releases = [[0, 1500, 3000, 4500], [0], []]
    late = 0
    for _ in range(n):
        faults = np.ceil(np.cumsum(rng.exponential(1 / rate / US, size=20))).tolist()
        late += simulate(frames, releases, foreign=(-1, 136), faults=faults)[1][0] > deadline
    urgent = MessageSet(replace(m, deadline=deadline * US) for m in messages())
    bound = miss_probability(urgent, FAST, rate, method="1994")[1]
    assert bound < 0.5
    assert 0 < late / n <= bound + 5 * math.sqrt(bound / n)


def test_small_chances_keep_their_digits():
    # Without subtraction 1e-20 is as exact as 0.1: the leading term of the series is its ratio.
    few, fewer = (fault_table(messages(), FAST, "A", rate, 6)["later"].to_numpy()
                  for rate in (1e-3, 1e-4))  # fmt: skip
    assert few[-1] < 1e-20
    # Seven faults, each ten times as rare.
    assert few / fewer == pytest.approx(10.0 ** np.arange(1, 8), rel=1e-3)


def test_the_ends_of_the_scale():
    table = fault_table(messages(), FAST, "A", 0, 3)
    assert table["probability"].tolist() == [1, 0, 0, 0]
    assert table["later"].tolist() == [0, 0, 0, 0]
    missed = miss_probability(messages(), FAST, [0, 1e6])
    assert missed.shape == (2, 3)
    assert missed[0].tolist() == [0, 0, 0]
    assert missed[1] == pytest.approx([1, 1, 1])
    assert miss_probability(MessageSet([]), FAST, [[1, 2]]).shape == (1, 2, 0)
    rates = [10, 100, 1000]
    assert (np.diff(miss_probability(messages(), FAST, rates), axis=0) > 0).all()


def test_a_message_that_is_late_without_faults_misses_for_certain():
    late = MessageSet([Message("A", 1, 8, 1e-3), Message("B", 2, 8, 1e-2, deadline=2e-4)])
    assert miss_probability(late, FAST, 0).tolist() == [0, 1]
    never = MessageSet([Message("A", 1, 8, 135 * US), Message("B", 2, 8, 1e-2)])
    assert miss_probability(never, FAST, 0, method="1994").tolist() == [1, 1]
    table = fault_table(never, FAST, "B", 10, 2)
    assert table["response_ms"].tolist() == [math.inf] * 3
    assert table["probability"].tolist() == [0, 0, 0]
    assert table["later"].tolist() == [1, 1, 1]
    assert not table["met"].any()


def test_conventions_reach_the_time_in_which_faults_count():
    own = fault_table(messages(), FAST, "C", 100, 2)
    none = fault_table(messages(), FAST, "C", 100, 2, convention=Convention(own_jitter=False))
    # Jitter is no time on the bus: it changes the response, not the chances.
    assert (own["response_ms"] - none["response_ms"]).round(9).tolist() == [0.2] * 3
    assert own["probability"].tolist() == none["probability"].tolist()
    short = fault_table(messages(), FAST, "C", 100, 2, convention=Convention("worst", "between"))
    assert (short["later"] < own["later"]).all()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"rate": -1}, "rate is -1"),
        ({"rate": math.nan}, "rate is nan"),
        ({"rate": [1, 2]}, "rate is .* one number"),
        ({"most": -1}, "most is -1"),
        ({"most": 1001}, "most is 1001"),
        ({"name": "Z"}, "name is 'Z'; the messages are A, B, C"),
        ({"method": "exact"}, "method is 'exact'"),
        ({"error_bits": 5}, "bits is 5"),
    ],
)
def test_wrong_arguments_are_refused(change, message):
    arguments = {"name": "A", "rate": 1.0, "most": 2} | change
    with pytest.raises(ArgumentError, match=message):
        fault_table(messages(), FAST, **arguments)


def test_a_deadline_beyond_the_period_is_refused():
    long = MessageSet([Message("A", 1, 8, 1e-3, deadline=2e-3)])
    with pytest.raises(ArgumentError, match="it may wait for itself"):
        miss_probability(long, FAST, 1)
