"""Orders of priority against all orders there are, and sensitivity against its own definition."""

import math
from dataclasses import replace
from itertools import permutations

import numpy as np
import pytest

from shipnet.can.schedule import (
    BIT_RATES,
    Convention,
    ErrorModel,
    Message,
    MessageSet,
    audsley,
    deadline_monotonic,
    lowest_bit_rate,
    period_factor,
    rate_monotonic,
    schedulable,
)
from shipnet.errors import ArgumentError

FAST = 1_000_000
US = 1e-6


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
        better += works and not schedulable(deadline_monotonic(messages), FAST)
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


def test_conventions_and_errors_reach_the_test_of_an_order():
    # 135 + 135 bits fit 270 us; a fault, or a foreign frame, is too much.
    messages = MessageSet([Message("a", 1, 8, 270 * US), Message("b", 2, 8, 540 * US)])
    assert audsley(messages, FAST).feasible
    assert not audsley(messages, FAST, errors=ErrorModel(1)).feasible
    assert not audsley(messages, FAST, convention=Convention(foreign_bits=160)).feasible


def test_orders_by_period_and_deadline_break_ties_by_the_order_before():
    messages = MessageSet(
        [Message("a", 1, 8, 2.0, 0.5), Message("b", 2, 8, 1.0), Message("c", 3, 8, 1.0, 0.5)]
    )
    assert rate_monotonic(messages).names == ("b", "c", "a")
    assert deadline_monotonic(messages).names == ("a", "c", "b")
    assert [m.arbitration_id for m in rate_monotonic(messages)] == [1, 2, 3]


def test_the_lowest_bit_rate_works_and_the_next_lower_one_does_not():
    rng = np.random.default_rng(1)
    for _ in range(20):
        messages = MessageSet(
            replace(m, period=10 * m.period, deadline=10 * m.deadline) for m in random_set(rng)
        )
        rate = lowest_bit_rate(messages)
        assert schedulable(messages, int(rate))
        assert not schedulable(messages, int(rate) - 1)
        assert lowest_bit_rate(messages, BIT_RATES) == min(r for r in BIT_RATES if r >= rate)


def test_the_ends_of_the_bit_rates():
    quiet = MessageSet([Message("a", 1, 8, 100.0)])
    assert lowest_bit_rate(quiet) == 1000
    assert lowest_bit_rate(MessageSet([])) == 1000
    loud = MessageSet([Message("a", 1, 8, 100 * US)])
    assert lowest_bit_rate(loud) == math.inf
    assert lowest_bit_rate(quiet, []) == math.inf
    assert lowest_bit_rate(quiet, [500_000, 20_000]) == 20_000
    for wrong in ([500], [125_000, 2_000_000], [125e3], ["125000"]):
        with pytest.raises(ArgumentError, match="candidate is"):
            lowest_bit_rate(quiet, wrong)


def changed(messages, names, deadlines, millionths):
    """Return the set with scaled periods, rounded down to nanoseconds: ticks at 1 Mbit/s."""

    def scale(t):
        return round(t * 1e9) * millionths // 10**6 / 1e9

    return MessageSet(
        replace(
            m,
            period=scale(m.period),
            deadline=scale(m.deadline) if deadlines == "scaled" else m.deadline,
        )
        if names is None or m.name in names
        else m
        for m in messages
    )


@pytest.mark.parametrize("deadlines", ["scaled", "kept"])
@pytest.mark.parametrize("names", [None, ["m1"], ["m0", "m3"]])
def test_the_factor_works_and_a_millionth_less_does_not(deadlines, names):
    rng = np.random.default_rng(3)
    found = 0
    for _ in range(15):
        messages = random_set(rng)
        factor = period_factor(messages, FAST, names, deadlines=deadlines)
        if factor == math.inf:
            assert names or deadlines == "kept"
            continue

        least = round(factor * 1e6)
        assert schedulable(changed(messages, names, deadlines, least), FAST)
        assert not schedulable(changed(messages, names, deadlines, least - 1), FAST)
        found += 1
    assert found >= 3


def test_scaled_periods_are_a_scaled_bit_rate():
    # Without jitter, factor f at 1 Mbit/s is the bit rate f x 1 Mbit/s.
    rng = np.random.default_rng(11)
    for _ in range(10):
        messages = MessageSet(replace(m, jitter=0) for m in random_set(rng))
        factor, rate = period_factor(messages, FAST), lowest_bit_rate(messages)
        if rate < math.inf:
            assert factor == pytest.approx(rate / FAST, abs=3e-6)
        else:
            assert factor > 1


def test_wrong_factors_are_refused():
    messages = MessageSet([Message("a", 1, 8, 1.0)])
    with pytest.raises(ArgumentError, match=r"names are \['z'\]; they must be of a"):
        period_factor(messages, FAST, ["z"])
    with pytest.raises(ArgumentError, match=r"names are \[\]"):
        period_factor(messages, FAST, [])
    with pytest.raises(ArgumentError, match="deadlines is 'both'"):
        period_factor(messages, FAST, deadlines="both")
