"""Bounds with offsets, compared with bounds without and with simulations; the gain of spreading."""

import math
from dataclasses import replace

import numpy as np
import pytest

from shipnet import can
from shipnet.errors import ArgumentError

FAST, US = 1_000_000, 1e-6


def random_set(rng, *, periods=(600, 1200, 2400), senders=3, jitter=0.0, most=12):
    """Return messages of a few senders on a bus with 1 us per bit and a load of 0.3 to 0.95."""
    n = int(rng.integers(2, most))
    bits, every = rng.integers(47, 161, n), rng.choice(periods, n)
    every *= max(1, math.ceil((bits / every).sum() / rng.uniform(0.3, 0.95)))
    return can.MessageSet(
        can.Message(
            f"m{k}",
            k,
            8,
            int(every[k]) * US,
            offset=int(rng.integers(every[k])) * US,
            jitter=int(every[k] * jitter * rng.random()) * US,
            bits=int(bits[k]),
            sender=f"s{rng.integers(senders)}",
        )
        for k in range(n)
    )


def responses(messages, **more):
    return np.array([one.response for one in can.response_times(messages, FAST, **more)])


def shifted(messages, phases):
    """Return the messages with the clock of each sender moved."""
    return can.MessageSet(
        replace(m, offset=round((m.offset + phases[m.sender]) % m.period, 9)) for m in messages
    )


@pytest.mark.parametrize("jitter", [0.0, 0.4, 1.5])
@pytest.mark.parametrize("intermission", ["everywhere", "between"])
def test_messages_with_their_own_clocks_have_the_bounds_without_offsets(jitter, intermission):
    rng, assumptions = np.random.default_rng(1), can.Assumptions(intermission=intermission)
    for _ in range(40):
        messages = random_set(rng, jitter=jitter)
        for alone in ("", None):
            own = can.MessageSet(
                replace(m, sender=m.name if alone is None else alone) for m in messages
            )
            plain = responses(own, assumptions=assumptions)
            bounded = responses(own, assumptions=assumptions, offsets=True)
            assert bounded.tolist() == plain.tolist()


def test_frames_of_the_sender_count_in_its_whole_hyperperiod():
    # Every second instance of m1 is due with m0, long after the hyperperiod of m0 alone.
    messages = can.MessageSet(
        can.Message(f"m{k}", k, 8, period, offset=0.005 * k, sender="s")
        for k, period in enumerate((0.01, 0.015))
    )
    assert can.response_times(messages, 125e3, offsets=True)["m1"].response == 2.16e-3
    even = messages.replace("m1", period=0.02)
    assert can.response_times(even, 125e3, offsets=True)["m1"].response == 1.08e-3


def pair(*messages, last):
    """Return messages of one sender, (period, deadline, offset, length) in bits, and another."""
    both = [
        can.Message(f"m{k}", k, 8, period * US, due * US, offset=at * US, sender="s", bits=bits)
        for k, (period, due, at, bits) in enumerate(messages)
    ]
    return can.MessageSet([*both, can.Message("last", 9, 8, 1.0, bits=last)])


@pytest.mark.parametrize("offset", [200, 200.5])
@pytest.mark.parametrize(("deadline", "met"), [(250, True), (249.999, False)])
def test_a_bound_with_offsets_is_one_instance_without_a_busy_period(offset, deadline, met):
    # The second message is due this many bits after the first, and waits for a frame of 150 bits.
    messages = pair((1000, deadline, 0, 100), (1000, deadline, offset, 100), last=150)
    found = can.response_times(messages, FAST, offsets=True)["m1"]
    assert math.isnan(found.busy_period)
    assert found.instances == (found.response,)
    assert found.response == pytest.approx(250 * US, rel=1e-12)
    assert found.met is met


@pytest.mark.parametrize(("jitter", "cases"), [(0.0, 30), (0.3, 8)])
def test_no_simulated_response_exceeds_the_bound_and_offsets_never_raise_it(jitter, cases):
    rng, tight = np.random.default_rng(2), []
    for _ in range(cases):
        messages = random_set(rng, jitter=jitter)
        bounded, plain = responses(messages, offsets=True), responses(messages)
        assert (bounded <= plain + 1e-12).all()
        phases = [{m.sender: int(rng.integers(10**4)) * US for m in messages} for _ in range(12)]
        sets = [shifted(messages, phase) for phase in phases]
        if jitter:
            runs = [can.simulate(one, FAST, until=0.02, rng=rng).table()["max_ms"] for one in sets]
            longest = np.nanmax(runs, axis=0) / 1e3
        else:
            offsets = [[m.offset for m in one] for one in sets]
            run = can.simulate_batch(messages, FAST, offsets=offsets, until=0.05)
            longest = np.nanmax(run.max_response, axis=0)
        assert (longest <= bounded + 1e-9).all()
        tight += (bounded < 0.999 * plain).tolist()
    assert np.mean(tight) > 0.2


def test_a_frame_of_the_same_sender_queued_within_the_arbitration_time_goes_first():
    # After a frame of 50 bits m1 is sent, unless m0 is queued less than a bit later.
    for offset, expected in ((50, 210), (50.5, 210), (51, 150)):
        messages = pair((1000, 1000, offset, 60), (1000, 1000, 0, 100), last=50)
        low = can.response_times(messages, FAST, offsets=True)["m1"]
        assert low.response == pytest.approx(expected * US, rel=1e-12)


def test_the_bound_of_two_senders_is_nearly_attained_in_some_phase():
    rng, ratios = np.random.default_rng(3), []
    for _ in range(6):
        messages = random_set(rng, periods=(200, 400), senders=2, most=6)
        bounded = responses(messages, offsets=True)
        whole = round(max(m.period for m in messages) / US)
        phases = np.arange(0, whole)[:, np.newaxis] * US * [m.sender == "s1" for m in messages]
        offsets = (phases + [m.offset for m in messages]) % messages.periods
        batch = can.simulate_batch(messages, FAST, offsets=offsets, until=4 * whole * US)
        longest = np.nanmax(batch.max_response, axis=0)
        assert (longest <= bounded + 1e-9).all()
        ratios += (bounded / longest).tolist()
    assert np.median(ratios) < 1.2


def test_a_sender_whose_hyperperiod_is_too_long_counts_as_several(monkeypatch):
    rng = np.random.default_rng(4)
    messages = random_set(rng, senders=1, most=8)
    assert (responses(messages, offsets=True) < responses(messages) - 1e-9).any()
    monkeypatch.setattr("shipnet.can.offsets.MOST_RELEASES", 1)
    assert responses(messages, offsets=True).tolist() == responses(messages).tolist()


@pytest.mark.parametrize(
    ("bit_rate", "fast", "slow"),
    [
        # Ticks of 1 fs: the jitter has more than 64 bits.
        (999_983, {"period": 0.1}, {"period": 0.1, "jitter": 1e5}),
        # 2 ** 53 ticks are 9 s here, and the clock repeats after 12 s.
        (999_983, {"period": 3.0, "offset": 1e-9}, {"period": 4.0}),
        # 10 ** 8 frames of the fast message are late at once.
        (125e3, {"period": 1e-3, "jitter": 1e5, "bits": 47}, {"period": 1.0}),
    ],
)
def test_clocks_too_long_to_follow_have_the_bounds_without_offsets(bit_rate, fast, slow):
    messages = can.MessageSet(
        can.Message(f"m{k}", k, 8, sender="s", **more) for k, more in enumerate((fast, slow))
    )
    plain, bounded = (
        [one.response for one in can.response_times(messages, bit_rate, offsets=offsets)]
        for offsets in (False, True)
    )
    assert bounded == plain


def spread_slowly(messages):
    """Return offsets in slots: the slot with the least traffic nearby, or the middle of several."""
    slots = math.lcm(*(round(m.period * 1e3) for m in messages))
    sent, offsets = {}, {}
    for message in sorted(messages, key=lambda m: (m.period, -m.frame_length())):
        every = round(message.period * 1e3)
        crowd = [0.0] * every
        for slot in range(slots):
            for other, bits in sent.items():
                apart = abs(slot - other)
                crowd[slot % every] += bits / (1 + min(apart, slots - apart))
        least = [slot for slot, bits in enumerate(crowd) if bits < min(crowd) + 1e-6]
        offsets[message.name] = least[len(least) // 2]
        for slot in range(offsets[message.name], slots, every):
            sent[slot] = sent.get(slot, 0.0) + message.frame_length()
    return offsets


@pytest.mark.parametrize("case", range(6))
def test_offsets_equal_those_of_loops_and_stay_without_a_sender(case):
    rng = np.random.default_rng(case)
    mine = [
        can.Message(
            f"m{k}", k, int(rng.integers(9)), float(rng.choice([5, 10, 15, 20])) / 1e3, sender="s"
        )
        for k in rng.permutation(7).tolist()
    ]
    alone = can.Message("alone", 99, 8, 0.01, offset=1.5e-3)
    found = can.spread_offsets(can.MessageSet([*mine, alone]))
    assert found["alone"] == alone
    expected = spread_slowly(can.MessageSet(mine))
    assert {m.name: round(m.offset * 1e3) for m in found if m.sender} == expected


def test_arguments_that_exclude_offsets_are_refused():
    messages = can.example()
    for more in (
        {"faults": can.faults.ErrorBound(0.1)},
        {"assumptions": can.Assumptions(own_jitter=False)},
    ):
        with pytest.raises(ArgumentError, match=r"^offsets is True; it requires own_jitter"):
            can.response_times(messages, 125e3, offsets=True, **more)
    with pytest.raises(ArgumentError, match=r"^step is 2 s; it must be 1e-06..1 s"):
        can.spread_offsets(messages, 2)
    with pytest.raises(ArgumentError, match="the period of 'speed' is not a multiple"):
        can.spread_offsets(messages.replace("speed", period=10.5e-3), 1e-3)
    odd = [can.Message(f"m{k}", k, 8, t, sender="s") for k, t in enumerate((0.997, 0.991, 0.983))]
    with pytest.raises(ArgumentError, match="'s' repeats after"):
        can.spread_offsets(can.MessageSet(odd))
    full = can.MessageSet([can.Message(f"m{k}", k, 8, 2.17e-3, sender="s") for k in range(2)])
    assert list(can.response_times(full, 125e3, offsets=True)) == list(
        can.response_times(full, 125e3)
    )
