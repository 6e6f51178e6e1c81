"""The right answers of lesson 5, by another way."""

from itertools import permutations, product
from math import ceil
from re import finditer

import numpy as np
import pytest

from shipnet.can import Frame, MessageSet
from shipnet.exercises.exercise import exercise
from tests.lessons.students import solved


def draws(key):
    options = exercise(key).draws
    return [dict(zip(options, values, strict=True)) for values in product(*options.values())]


@pytest.mark.parametrize("numbers", draws("ex-05-1"), ids=str)
def test_the_bus_carries_the_lower_id_down_to_the_highest_bit_of_the_difference(numbers):
    one, other = (int(number, 16) for number in numbers["ids"])
    bits = solved("ex-05-1", **numbers).value
    bit = 11 - ((one ^ other).bit_length() - 1)
    assert bits == f"{min(one, other):011b}"[:bit]
    # No stuff bit stands before it, so that bits of the id can be counted on the bus.
    assert all(place > bit for n in (one, other) for place in Frame(n).stuff_positions)


def test_stuffing_is_what_a_pattern_finds():
    asked = solved("ex-05-2")
    for (bits,) in asked.cases:
        stuffed = asked.value(bits)
        # A receiver takes a bit out behind each five equal ones, itself counted for the next.
        taken, place = "", 0
        while place < len(stuffed):
            taken += stuffed[place]
            run = stuffed[max(0, place - 4) : place + 1]
            if len(run) == 5 and len(set(run)) == 1:
                assert stuffed[place + 1] != stuffed[place]
                place += 1
            place += 1
        assert taken == bits
        assert not list(finditer("0{6}|1{6}", stuffed))


@pytest.mark.parametrize("numbers", draws("ex-05-3"), ids=str)
def test_the_response_is_that_of_counting_bit_by_bit(numbers):
    # All that is more urgent comes as often as it can, the log began one bit earlier.
    stop, own = numbers["stop_ms"], 55 + 10 * numbers["n_bytes"]
    wait = next(
        w
        for w in range(135, 10_000)
        if w == 135 + ceil((w + 1) / (125 * stop)) * 65 + ceil((w + 1) / 1250) * 95
    )
    answer = solved("ex-05-3", **numbers).value
    assert answer == pytest.approx((wait + own) / 125)


def slack(messages):
    """Return the smallest slack [bit], over the frames of a message one after the other."""
    sizes = [55 + 10 * m.dlc for m in messages]
    periods = [125_000 * m.period for m in messages]
    found = []
    for k, message in enumerate(messages):
        for before in range(20):
            fixed = max(sizes[k + 1 :], default=0) + before * sizes[k]
            wait, last = fixed, -1
            while last < wait < 10_000:
                comings = [ceil((wait + 1) / period) for period in periods[:k]]
                last, wait = wait, fixed + sum(np.multiply(comings, sizes[:k]))
            found.append(before * periods[k] + 125_000 * message.deadline - wait - sizes[k])
    return min(found)


@pytest.mark.parametrize("numbers", draws("ex-05-4"), ids=range(36))
def test_the_slack_is_that_of_the_one_order_in_time(numbers):
    messages = MessageSet.parse(numbers["messages"])
    slacks = [slack(messages.ordered(names)) for names in permutations(messages.names)]
    (good,) = [one for one in slacks if one > 0]
    assert solved("ex-05-4", **numbers).value == pytest.approx(good / 125)
