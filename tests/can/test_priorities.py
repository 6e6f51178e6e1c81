"""Priority orders, compared with all possible orders."""

import math
from itertools import permutations

import numpy as np

from shipnet.can import Assumptions, Message, MessageSet, audsley
from shipnet.can.faults import ErrorBound
from shipnet.can.response import response_times

FAST = 1_000_000
US = 1e-6


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


def test_audsley_finds_an_order_exactly_if_one_of_all_orders_works():
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
    # Both verdicts are frequent enough to be meaningful, and the order of deadlines is not optimal.
    assert 30 < sum(verdicts) < 120
    assert better > 0


def test_messages_that_cannot_be_placed_come_first_by_their_deadlines():
    messages = MessageSet(
        Message(name, number, 8, period, deadline)
        for number, (name, period, deadline) in enumerate(
            [
                ("slow", 1.0, 1.0),
                ("b", 0.001, 220 * US),
                ("c", 0.001, 230 * US),
                ("a", 0.001, 210 * US),
            ]
        )
    )
    found = audsley(messages, FAST)
    assert (found.feasible, found.unplaced) == (False, ("a", "b", "c"))
    assert found.messages.names == ("a", "b", "c", "slow")
    assert audsley(MessageSet([]), FAST) == (MessageSet([]), True, ())


def test_an_order_that_fails_only_in_a_second_instance_is_not_feasible():
    # The example of Davis et al. 2007: B and C are alike, and the lower one takes 3.5 ms.
    rows = (("A", 2.5e-3, 2.5e-3), ("B", 3.5e-3, 3.25e-3), ("C", 3.5e-3, 3.25e-3))
    messages = MessageSet(Message(name, k, 7, *times) for k, (name, *times) in enumerate(rows))
    assert not audsley(messages, 125e3).feasible
    assert audsley(messages.replace("C", deadline=3.5e-3), 125e3).feasible


def test_assumptions_and_errors_reach_the_test_of_an_order():
    # 135 + 135 bits fit into 270 us; with a fault they do not.
    messages = MessageSet([Message("a", 1, 8, 270 * US), Message("b", 2, 8, 540 * US)])
    assert audsley(messages, FAST).feasible
    assert not audsley(messages, FAST, faults=ErrorBound(math.inf)).feasible
    short = messages.replace("a", deadline=267 * US)
    assert not audsley(short, FAST).feasible
    assert audsley(short, FAST, assumptions=Assumptions(intermission="between")).feasible


def test_the_order_of_deadlines_breaks_ties_by_the_given_order():
    messages = MessageSet(
        [Message("a", 1, 8, 2.0, 0.5), Message("b", 2, 8, 1.0), Message("c", 3, 8, 1.0, 0.5)]
    )
    found = messages.deadline_monotonic()
    assert found.names == ("a", "c", "b")
    assert [m.arbitration_id for m in found] == [1, 2, 3]
