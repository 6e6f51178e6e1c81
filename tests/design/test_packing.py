"""CAN messages and Modbus registers: nothing is lost, overlaps or is wasted."""

from itertools import chain, pairwise
from math import ceil

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from shipnet.design.plan_stations import bit_rate_for, pack, registers_of, sections

KINDS = st.sampled_from(["DI", "DO", "AI", "AO"])
POINTS = st.lists(st.tuples(KINDS, st.sampled_from([0.1, 1.0])), max_size=150)


@given(POINTS)
def test_every_point_is_in_one_message_of_its_update_time_and_direction(points):
    types, needs = [kind for kind, _ in points], np.array([need for _, need in points], float)
    messages = pack(types, needs)
    assert sorted(chain.from_iterable(m.rows.tolist() for m in messages)) == list(
        range(len(points))
    )
    for message in messages:
        taken = []
        for row, bit in zip(message.rows, message.bits, strict=True):
            assert needs[row] == message.need and (types[row][1] == "O") == message.output
            taken += range(bit, bit + (16 if types[row][0] == "A" else 1))
        assert len(set(taken)) == len(taken) and max(taken) < 8 * message.dlc <= 64
        assert max(taken) >= 8 * (message.dlc - 1)


def first_fit(values, states):
    """Return the frames of a first fit, values first; this is optimal for sizes 16 and 1."""
    room = []
    for size in [16] * values + [1] * states:
        for bin_number, left in enumerate(room):
            if left >= size:
                room[bin_number] -= size
                break
        else:
            room.append(64 - size)
    return len(room)


@given(st.integers(0, 30), st.integers(0, 200))
def test_packing_needs_at_most_the_messages_of_a_first_fit(values, states):
    messages = pack(["AI"] * values + ["DI"] * states, np.ones(values + states))
    assert len(messages) == first_fit(values, states)


def test_a_bit_rate_reaches_as_far_as_is_published():
    # Beckhoff BX5100: 500 kbit/s 100 m, 250 kbit/s 250 m, 125 kbit/s 500 m, 50 kbit/s 1000 m.
    rates = (50_000, 125_000, 250_000, 500_000)
    bit_rates = [bit_rate_for(length, rates) for length in (100, 100.1, 250, 500, 500.1, 1000)]
    assert bit_rates == [500_000, 250_000, 250_000, 125_000, 50_000, 50_000]
    assert bit_rate_for(1000.1, rates) is None
    # A rate between two published ones reaches as far as the higher one.
    assert [bit_rate_for(length, (200_000,)) for length in (250, 251)] == [200_000, None]


@given(st.lists(KINDS, min_size=1, max_size=400))
def test_every_point_has_a_register_and_every_register_is_polled(types):
    addresses, requests = registers_of(types)
    places = {}
    for kind, address in zip(types, addresses, strict=True):
        what, _, number, *bit = address.split()
        assert what == ("holding" if kind[1] == "O" else "input")
        assert (kind[0] == "D") == bool(bit)
        places.setdefault((what, int(number)), []).append(int(bit[1]) if bit else None)
    assert all(len(set(bits)) == len(bits) <= 16 for bits in places.values())
    counts = {kind: types.count(kind) for kind in ("AI", "AO", "DI", "DO")}
    for what, analogue, digital in (("input", "AI", "DI"), ("holding", "AO", "DO")):
        used = sum(place == what for place, _ in places)
        assert used == counts[analogue] + ceil(counts[digital] / 16)
    polled = []
    for request in requests:
        what = {4: "input", 16: "holding"}[request.function]
        start = request.address
        polled += [(what, start + n) for n in range(request.quantity)]
        assert request.quantity <= (125 if what == "input" else 123)
    assert sorted(polled) == sorted(places)


@given(st.lists(st.integers(1, 120), min_size=1, max_size=40), st.integers(3, 8))
def test_sections_meet_their_limits_of_load_and_length(hops, unit_loads):
    found = sections(hops, length=200, unit_loads=unit_loads)
    cuts = [0, *(section + 1 for section in found), len(hops)]
    for number, (start, end) in enumerate(pairwise(cuts)):
        repeaters = (number > 0) + (end < len(hops))
        assert end > start and sum(hops[start:end]) <= 200
        assert end - start + (number == 0) + repeaters <= unit_loads
    assert sections([201], length=200, unit_loads=8) is None
