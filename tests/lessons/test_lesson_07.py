"""The right answers of lesson 7, by another way."""

from collections import deque
from itertools import product

import pytest
from hypothesis import given
from hypothesis import strategies as st

from shipnet.exercises.exercise import exercise
from tests.lessons.students import solved


def draws(key):
    options = exercise(key).draws
    return [dict(zip(options, values, strict=True)) for values in product(*options.values())]


@pytest.mark.parametrize("numbers", draws("ex-07-1"), ids=str)
def test_the_unread_bytes_lie_across_the_end(numbers):
    ring = numbers["ring"]
    assert ring["ring_f"] != ring["ring_get_f"] and ring["no"] < ring["get_no"]
    across = [*range(ring["get_no"], 128), *range(ring["no"])]
    assert solved("ex-07-1", **numbers).value == len(across)


@pytest.mark.parametrize("numbers", draws("ex-07-2"), ids=str)
def test_it_looks_empty_again_after_two_laps(numbers):
    two_laps = 2 * numbers["places"] * 10 / numbers["rate"]
    assert solved("ex-07-2", **numbers).value == pytest.approx(1e3 * two_laps)


@given(st.text("wr", max_size=60), st.integers(2, 9))
def test_what_is_lost_is_what_a_deque_pushes_out(events, size):
    waiting, lost = deque(maxlen=size), 0
    for place, event in enumerate(events):
        if event == "w":
            lost += len(waiting) == size
            waiting.append(place)
        elif waiting:
            waiting.popleft()
    assert solved("ex-07-3").value(events, size) == lost


@pytest.mark.parametrize("numbers", draws("ex-07-4"), ids=str)
def test_half_the_ring_would_lose_bytes(numbers):
    came = numbers["waiting"] + numbers["rate"] * numbers["pause_ms"] / 10_000
    places = round(solved("ex-07-4", **numbers).value + came)
    assert places & (places - 1) == 0
    assert places / 2 < came <= places
