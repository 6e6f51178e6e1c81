"""Orders of priority against all orders there are, and the lowest bit rate."""

import math
from dataclasses import replace
from itertools import permutations

import numpy as np
import pytest

from shipnet.can import BIT_RATES, Assumptions, Message, MessageSet, audsley, lowest_bit_rate
from shipnet.can.faults import ErrorBound
from shipnet.can.response import response_times
from shipnet.errors import ArgumentError

FAST = 1_000_000
US = 1e-6


#: Every bit rate.
ANY = range(1000, 1_000_001)


def schedulable(messages, bit_rate):
    return response_times(messages, bit_rate).met


def random_set(rng, n=4):
    bits = rng.integers(47, 161, size=n)
    periods = rng.integers(2 * bits.sum(), 6 * bits.sum(), size=n) // 2
    deadlines = rng.integers(bits + 100, periods + 1)
    return MessageSet(
        Message(f"m{k}", k, 8, p * US, d * US, j * US, bits=int(b))
        for k, (b, p, d, j) in enumerate(
            zip(bits, periods, deadlines, rng.integers(0, 60, size=n), strict=True)
        )
    )


def test_audsley_finds_an_order_exactly_where_one_of_all_orders_works():
    rng = np.random.default_rng(2024)
    verdicts, better = [], 0
    for _ in range(150):
        messages = random_set(rng)
        works = any(schedulable(messages.ordered(o), FAST) for o in permutations(messages.names))
        found = audsley(messages, FAST)
        assert found.feasible == works
        assert schedulable(found.messages, FAST) == works
        assert bool(found.unplaced) == (not works)
        better += works and not schedulable(messages.deadline_monotonic(), FAST)
        verdicts.append(works)
    # Both answers come up often enough to mean something, and deadlines alone are not optimal.
    assert 30 < sum(verdicts) < 120
    assert better > 0


def test_the_order_before_does_not_matter():
    messages = random_set(np.random.default_rng(5))
    found = {audsley(messages.ordered(o), FAST).feasible for o in permutations(messages.names)}
    assert len(found) == 1


def test_what_cannot_be_placed_is_named():
    messages = MessageSet(
        [
            Message("slow", 1, 8, 1.0),
            Message("a", 2, 8, 0.001, deadline=200 * US),
            Message("b", 3, 8, 0.001, deadline=200 * US),
        ]
    )
    found = audsley(messages, FAST)
    assert not found.feasible
    assert set(found.unplaced) == {"a", "b"}
    assert found.messages.names[2] == "slow"
    assert audsley(MessageSet([]), FAST) == (MessageSet([]), True, ())


def test_assumptions_and_errors_reach_the_test_of_an_order():
    # 135 + 135 bits fit 270 us; a fault, or a foreign frame, is too much.
    messages = MessageSet([Message("a", 1, 8, 270 * US), Message("b", 2, 8, 540 * US)])
    assert audsley(messages, FAST).feasible
    assert not audsley(messages, FAST, faults=ErrorBound(math.inf)).feasible
    assert not audsley(messages, FAST, assumptions=Assumptions(foreign_bits=160)).feasible


def test_the_order_of_deadlines_breaks_ties_by_the_order_before():
    messages = MessageSet(
        [Message("a", 1, 8, 2.0, 0.5), Message("b", 2, 8, 1.0), Message("c", 3, 8, 1.0, 0.5)]
    )
    found = messages.deadline_monotonic()
    assert found.names == ("a", "c", "b")
    assert [m.arbitration_id for m in found] == [1, 2, 3]
    jitter = MessageSet([Message("a", 1, 8, 0.5, jitter=0.2), Message("b", 2, 8, 1.0, 0.4)])
    assert jitter.deadline_monotonic().names == ("b", "a")
    assert jitter.deadline_monotonic(less_jitter=True).names == ("a", "b")


def test_the_lowest_bit_rate_works_and_the_next_lower_one_does_not():
    rng = np.random.default_rng(1)
    for _ in range(20):
        messages = MessageSet(
            replace(m, period=10 * m.period, deadline=10 * m.deadline) for m in random_set(rng)
        )
        rate = lowest_bit_rate(messages, ANY)
        assert schedulable(messages, int(rate))
        assert not schedulable(messages, int(rate) - 1)
        assert lowest_bit_rate(messages) == min(r for r in BIT_RATES if r >= rate)


def test_the_ends_of_the_bit_rates():
    quiet = MessageSet([Message("a", 1, 8, 100.0)])
    assert lowest_bit_rate(quiet, ANY) == 1000
    assert lowest_bit_rate(MessageSet([]), ANY) == 1000
    loud = MessageSet([Message("a", 1, 8, 100 * US)])
    assert lowest_bit_rate(loud) == lowest_bit_rate(loud, ANY) == math.inf
    assert lowest_bit_rate(quiet, []) == math.inf
    assert lowest_bit_rate(quiet, [500_000, 20_000]) == 20_000
    assert lowest_bit_rate(quiet, [125e3, 20e3]) == 20_000
    for wrong in ([500], [125_000, 2_000_000], ["125000"]):
        with pytest.raises(ArgumentError, match="candidates is"):
            lowest_bit_rate(quiet, wrong)
