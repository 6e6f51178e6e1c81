from collections import Counter
from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.stats import binom

from shipnet.crc import MODBUS
from shipnet.errors import ArgumentError
from shipnet.fields import check_rng
from shipnet.intervals import share_interval
from shipnet.remote_control import (
    Change,
    CobsFormat,
    MarkerFormat,
    System,
    compare_checks,
    recommend,
    simulate,
)
from shipnet.remote_control.experiment import candidates, check_formats, switch_staleness
from shipnet.remote_control.faults import LostPacket
from shipnet.remote_control.packet import code_weights, crc_residual
from shipnet.remote_control.packet_format import Outcomes, flipped

#: Probability with which a correct count may fail a test by chance.
RARE = 1e-6


def is_likely(count, sent, share):
    return min(binom.cdf(count, sent, share), binom.sf(count - 1, sent, share)) > RARE / 2


@pytest.mark.parametrize("reading", ["A", "B"])
@pytest.mark.parametrize(("n_items", "rate"), [(1, 1e-2), (10, 1e-3), (10, 5e-2), (40, 2e-3)])
def test_markers_pass_as_many_packets_as_in_the_closed_form(reading, n_items, rate):
    form = MarkerFormat(reading, n_items)
    trial = form.transmit(n_items, rate, 20_000, np.random.default_rng(2024))
    shares = form.error_shares(n_items, rate)
    assert sum(shares) == pytest.approx(1)
    assert sum(trial) == 20_000
    assert all(is_likely(count, 20_000, share) for count, share in zip(trial, shares, strict=True))


# Claim chung1998-019: 240 of 264 and of 336 bits.
@pytest.mark.parametrize(("reading", "share"), [("A", 240 / 264), ("B", 240 / 336)])
def test_markers_miss_the_counted_fraction_of_single_inverted_bits(reading, share):
    assert MarkerFormat(reading, 10).undetected_flips(10) == share
    # The closed form at a small rate gives the same fraction of the disturbed packets.
    assert MarkerFormat(reading, 10).error_shares(10, 1e-9).missed == pytest.approx(share)


@pytest.mark.parametrize("numbers", ["known", "rising"])
def test_a_check_of_the_numbers_detects_most_of_their_bits(numbers):
    form = MarkerFormat("A", 10, numbers)
    share = form.undetected_flips(10)
    assert 160 / 264 <= share < 160 / 264 + 0.12
    trial = form.transmit(10, 1e-3, 20_000, np.random.default_rng(2024))
    assert trial.undetected / 20_000 < form.error_shares(10, 1e-3).undetected


def test_no_crc_code_word_has_a_weight_below_four_and_those_of_four_are_counted():
    # Two ways to count words of weight four: pairs with equal sums, and the residual at a small p.
    size = 20
    frame = np.zeros(size + 2, np.uint8)
    check = int(MODBUS.of(frame[:size]))
    frame[size:] = check & 0xFF, check >> 8
    bits = np.unpackbits(frame)
    rows = np.packbits(bits ^ np.eye(bits.size, dtype=np.uint8), axis=1)
    syndrome = MODBUS.of(rows).astype(int)
    assert np.unique(syndrome).size == bits.size and 0 not in syndrome
    pairs = np.bincount([a ^ b for a, b in combinations(syndrome.tolist(), 2)])
    fours = int((pairs * (pairs - 1) // 2).sum()) // 3
    rate = 1e-6
    assert crc_residual(size, rate) / rate**4 == pytest.approx(fours, rel=1e-3)


#: Bound on the probability that CRC-16/MODBUS does not detect errors, at any bit error rate. It is
#: more than 2**-16 because few errors already reach a code word of a short block. The maximum is
#: 1.94e-4, for one byte and its CRC at a rate of 0.184; up to 120 bytes no other block has more.
UNDETECTED = 2.0**-12


def test_the_polynomial_bounds_the_residual_of_the_shortest_block():
    # Code words are the multiples of x^16 + x^15 + x^2 + 1: for one byte, sums of eight shifts.
    words = [0]
    for shift in range(8):
        words += [word ^ 0x18005 << shift for word in words]
    weights = Counter(word.bit_count() for word in words[1:])
    assert weights == {4: 8, 6: 34, 8: 49, 10: 92, 12: 62, 14: 10}

    def chance(weight, rate):
        return weights[weight] * rate**weight * (1 - rate) ** (24 - weight)

    for rate in (1e-3, 0.1, 0.184, 0.25, 0.5):
        assert crc_residual(1, rate) == pytest.approx(sum(chance(w, rate) for w in weights))
    # Each term is largest at the rate w / 24; the sum of these maxima is 2.31e-4.
    assert sum(chance(w, w / 24) for w in weights) < UNDETECTED
    assert crc_residual(1, 0.184) == pytest.approx(1.94e-4, rel=1e-2)


@settings(max_examples=30)
@example(n=1, rate=0.184)
@example(n=1, rate=0.25)
@given(n=st.integers(0, 120), rate=st.floats(1e-9, 0.5))
def test_the_residual_of_a_crc_is_below_its_bound_and_two_to_the_minus_sixteen_for_noise(n, rate):
    assert 0 <= crc_residual(n, rate) < UNDETECTED
    exact = 2.0**-16 - 2.0 ** -(8 * n + 16)
    assert crc_residual(n, 0.5) == pytest.approx(exact)
    assert sum(code_weights(n)) == 2**16


def test_the_crc_passes_as_many_packets_as_its_weights_predict():
    form = MarkerFormat(crc=True, n_numbers=1)
    # One item, at a rate that often leaves the markers intact.
    trial = form.transmit(1, 0.06, 200_000, np.random.default_rng(2024))
    expected = form.error_shares(1, 0.06).undetected
    assert trial.undetected > 0
    assert is_likely(trial.undetected, 200_000, expected)


def test_the_stuffed_packet_stays_below_its_estimate():
    form = CobsFormat(3)
    trial = form.transmit(3, 0.02, 100_000, np.random.default_rng(2024))
    shares = form.error_shares(3, 0.02)
    assert is_likely(trial.intact, 100_000, shares.intact)
    assert share_interval(trial.undetected, 100_000, confidence=0.999)[0] < shares.undetected


def test_no_single_inverted_bit_passes_the_stuffed_packet():
    form = CobsFormat(84)
    assert not any(form.undetected_flips(n) for n in (0, 1, 2, 10, 84))
    for values in np.random.default_rng(7).integers(0, 2**16, (40, 10)).tolist():
        packet = form.encode(dict(enumerate(values)))
        bits = range(8 * len(packet))
        assert not any(form._read(flipped(packet, [bit])) for bit in bits)
    # So the estimate consists only of packets with two or more inverted bits.
    bits = 8 * form.size(10)
    two = 1 - (1 - 1e-6) ** bits - bits * 1e-6 * (1 - 1e-6) ** (bits - 1)
    assert form.error_shares(10, 1e-6).undetected == pytest.approx(two / 2**16, rel=1e-3)


@settings(max_examples=30)
@given(
    n=st.integers(0, 84),
    rate=st.sampled_from([0.0, 1e-6, 1e-3, 0.1, 0.5]),
    count=st.sampled_from([0, 1, 300]),
    name=st.sampled_from(["markers", "markers + CRC", "CRC"]),
)
def test_every_size_and_rate_can_be_simulated(n, rate, count, name):
    outcome = check_formats(84)[name].outcomes(n, rate, count, np.random.default_rng(1))
    assert outcome.shape == (count,) and outcome.dtype == np.uint8
    assert set(outcome) <= ({0} if rate == 0 else {0, 1, 2})
    shares = check_formats(84)[name].error_shares(n, rate)
    assert min(shares) >= -1e-15 and sum(shares) == pytest.approx(1)


def simulate_switch(form, n_items, rate, period, interval, sending, packets, rng):
    """Return the fraction of packets after which the receiver shows a wrong position."""
    outcome = form.outcomes(n_items, rate, packets, rng)
    if sending == "changed":
        position = np.arange(packets) % 2
    else:
        position = np.cumsum(rng.poisson(period / interval, packets)) % 2
    # The receiver shows the position from the last accepted packet, and 0 before the first one.
    taken = np.maximum.accumulate(np.where(outcome != 1, np.arange(packets), -1))
    shown = np.where(taken >= 0, np.where(outcome[taken] == 2, -1, position[taken]), 0)
    return float((shown != position).mean())


@pytest.mark.parametrize("sending", ["changed", "cyclic"])
@pytest.mark.parametrize(
    ("check", "n_items", "rate", "interval"),
    [("markers", 1, 5e-3, 0.3), ("markers + CRC", 10, 2e-3, 2.0)],
)
def test_a_switch_is_stale_as_long_as_in_the_closed_form(check, sending, n_items, rate, interval):
    form, n = check_formats(n_items)[check], 200_000
    rng = np.random.default_rng(2024)
    share = simulate_switch(form, n_items, rate, 0.1375, interval, sending, n, rng)
    shares = form.error_shares(n_items, rate)
    expected = switch_staleness(shares, 0.1375, interval, sending)[0]
    # Neighbouring packets are correlated over 1 / (1 - d) packets, so the margin is a wide 3 %.
    assert share == pytest.approx(expected, rel=0.03)


def test_a_stale_switch_waits_as_long_as_a_walk_from_failure_to_success():
    rng = np.random.default_rng(2024)
    d, u, n = 0.3, 0.2, 200_000
    outcome = rng.choice(3, n, p=[1 - d - u, d, u])
    position, shown, waits, since = 0, 0, [], None
    for k, fate in enumerate(outcome.tolist()):
        position ^= 1
        shown = position if fate == 0 else -1 if fate == 2 else shown
        if shown == position:
            waits += [] if since is None else [k - since]
            since = None
        elif since is None:
            since = k
    duration = switch_staleness(Outcomes(1 - d - u, d, u), 1.0, 50.0, "changed")[1]
    assert np.mean(waits) * 50.0 == pytest.approx(duration, rel=0.02)


def test_markers_miss_the_same_fraction_for_any_number_of_items_and_a_crc_misses_none():
    table = compare_checks([1, 10, 40], [1e-4], packets=50_000, rng=2024).table()
    assert (table.low <= table.expected).all() and (table.expected <= table.high).all()
    markers = table[table.check == "markers"]
    assert (markers.missed > 0.4).all() and markers.missed.is_monotonic_increasing
    assert (table[table.check != "markers"].undetected == 0).all()
    assert markers.undetected.is_monotonic_increasing


@pytest.mark.parametrize("bit_rate", [9600, 600])
@pytest.mark.parametrize("n_items", [1, 10, 40])
def test_the_recommendation_is_the_fastest_way_that_meets_every_limit(n_items, bit_rate):
    system = System(bit_rate=bit_rate)
    chosen = recommend(n_items, system, stale_time=20)
    table = candidates(n_items, system, 1e-5, 20)
    good = table.query("errors_ok and stale_ok and alarm_ok")
    assert chosen.refresh_time == good.refresh_s.min()
    assert chosen.wrong_per_year <= 1 and chosen.stale_time <= 20
    assert "CRC" in chosen.check and chosen.sending == "cyclic"


def test_a_lost_packet_costs_the_predicted_cycle_and_turn():
    best = recommend(10, rate=1e-7)
    assert best.check == "CRC"
    link = System(CobsFormat(10), repeat=10, turn_timeout=best.turn_timeout)
    lost, move = LostPacket("BCS", "RCS", start=1.0), Change(1.0, "BCS", 1, 1)
    run = simulate(link, move, faults=lost, until=3)
    failed = next(packet for packet in run.packets if packet.outcome == "lost")
    seen = next(u.time for u in run.updates if (u.station, u.number, u.value) == ("RCS", 1, 1))
    assert seen - failed.end == pytest.approx(best.stale_time, rel=1e-4)
    # As printed, RCS waits until its counters reach the limit, which takes over four seconds.
    printed = simulate(replace(link, turn_timeout=None), move, faults=lost, until=9)
    assert 4.3 < printed.delays("SS").delay_s[0] < 4.9


def test_rare_errors_need_no_crc_and_a_noisy_line_needs_short_packets():
    assert recommend(3, rate=1e-13).check == "markers"
    assert recommend(3, rate=1e-5).check != "markers"
    assert recommend(40, rate=1e-6).per_packet == 40
    assert recommend(40, rate=1e-3).per_packet < 20


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: MarkerFormat().error_shares(11, 0.1), r"n_items is 11.*0\.\.10"),
        (lambda: MarkerFormat().error_shares(1, 0.6), "rate is 0.6"),
        (lambda: check_formats(85), r"n_items is 85.*1\.\.84"),
        (lambda: MarkerFormat().outcomes(1, 0.1, -1, check_rng(1)), "packets is -1"),
        (lambda: recommend(1, stale_time=0), "stale_time is 0"),
        (lambda: recommend(10, System(turn_timeout=0.005, bit_rate=600)), "turn_timeout is short"),
        (
            lambda: recommend(84, System(bit_rate=600), stale_time=1),
            "n_items is 84: of .* ways to send them",
        ),
    ],
)
def test_arguments_out_of_range_are_named(make, message):
    with pytest.raises(ArgumentError, match=message):
        make()
