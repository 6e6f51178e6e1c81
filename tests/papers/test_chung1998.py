"""Evidence for verdicts on chung1998 that need more than the claim's own function."""

import numpy as np
import pytest

from shipnet.errors import ArgumentError
from shipnet.papers import ledger
from shipnet.papers.chung1998 import given_up, link, recovered, ring, ring_trials, send_loops
from shipnet.papers.chung1998.link import PRINTED
from shipnet.papers.registry import REGISTRY
from shipnet.remote_control import (
    Change,
    MarkerFormat,
    Ring,
    Supervision,
    System,
    recommend,
    simulate,
    switch_delays,
)
from shipnet.remote_control.experiment import candidates
from shipnet.remote_control.faults import HOPS, STATIONS, LostPacket, Stall
from shipnet.remote_control.ring_buffer import case_of
from shipnet.remote_control.system import BIT_RATES


def test_no_claim_is_open():
    assert ledger("chung1998").counts().loc["chung1998", "open"] == 0


def test_three_seconds_need_both_tests_to_be_reached():
    tick, count, miss = (
        float(PRINTED[name]) for name in ("tick", "count_threshold", "miss_threshold")
    )
    assert (
        REGISTRY["chung1998-007"]()
        == pytest.approx((count + 1) * (miss + 1) * tick)
        == pytest.approx(4.4)
    )
    assert (
        Supervision.intended().detection_time[1]
        == pytest.approx(count * miss * tick)
        == pytest.approx(3.0)
    )
    assert Supervision() == Supervision(tick, int(count), int(miss))


def test_the_events_of_the_trials_are_those_of_the_paper():
    names = ("without_parameter_change", "with_enter_presses")
    printed = [int(PRINTED[f"abnormal_events_{name}"]) for name in names]
    assert [ring.TRIALS[0][-1], ring.TRIALS[2][-1]] == printed == [0, 1]


def test_the_rates_are_those_of_the_paper():
    assert [float(PRINTED[f"baud_rate_{k}"]) for k in range(1, 6)] == list(BIT_RATES)


def test_the_delay_of_a_switch_grows_with_the_length_of_a_bit():
    alone, all_data = (switch_delays(System(repeat=repeat), rng=2024) for repeat in (0, 10))
    for table in (alone, all_data):
        assert (table["followed"] == 20).all()
        assert 10 < table["longest_s"].iloc[-1] / table["longest_s"].iloc[0] < 20
    assert alone["longest_s"].max() < 0.5 < 3 < all_data["longest_s"].max()
    assert System(bit_rate=600).response_time() == pytest.approx(16 * System().response_time())


def test_bcs_may_report_rcs_as_failed_and_always_does_at_600_bit_per_s():
    assert [link.as_printed(bit_rate=rate).cascade().alarm for rate in (9600, 600)] == [
        "possible",
        "certain",
    ]


def test_no_reading_lets_the_flags_show_every_single_error():
    values = {number: 1000 + number for number in range(10)}
    passed = {}
    for reading in "ABC":
        form = MarkerFormat("A" if reading == "C" else reading, numbers="any")
        parts = [{n: v} for n, v in values.items()] if reading == "C" else [values]
        stream = b"".join(form.encode(part) for part in parts)
        sent = form.parser().feed(stream)
        assert len(stream) == link.length(reading=reading, items=10)
        count = 0
        for bit in range(8 * len(stream)):
            hit = bytearray(stream)
            hit[bit >> 3] ^= 1 << (bit & 7)
            packets = form.parser().feed(bytes(hit))
            count += len(packets) == len(sent) and packets != sent
        passed[reading] = count / (8 * len(stream))
    # A bit that turns a number into 0xEE would end the packet: of 0..9 none is one bit from it.
    assert passed == {"A": 30 / 33, "B": 30 / 42, "C": 30 / 60}


def test_as_printed_an_empty_ring_is_repaired_again_and_again():
    assert ring.abnormal_states() == 0
    assert ring.abnormal_states(empty_is_empty=False) > 0
    # The reader has passed the last place, the writer stands on it: this looks like an ring.
    one = Ring(8)
    for _ in range(7):
        one.store(0xCC)
    for _ in range(8):
        assert one.extract().action == "take"
    assert (one.case, one.unread) == ("c", 0)


@pytest.mark.parametrize("rate", BIT_RATES)
@pytest.mark.parametrize("reading", ["A", "B"])
def test_in_lock_step_no_speed_brings_the_ring_out_of_order(reading, rate):
    table = ring_trials(System(MarkerFormat(reading), bit_rate=rate, repeat=10))
    assert (table["events"] == 0).all()
    assert table["unread"].max() <= link.length(reading=reading, items=10) < ring.SIZE


def test_it_takes_three_more_packets_to_overrun_the_ring():
    stall = link.as_printed().overrun_stall()
    assert stall == pytest.approx((13.14, 13.54), abs=0.01)
    assert ring.parameter_change_does_no_harm(stall=stall[0] - 0.2)
    assert not ring.parameter_change_does_no_harm(stall=stall[1] + 0.01)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: link.length(reading="C", items=-2), "items is -2"),
        (lambda: send_loops(b"a", polls=()), "polls is empty"),
    ],
)
def test_arguments_out_of_range_are_named(make, message):
    with pytest.raises(ArgumentError, match=message):
        make()


def test_only_the_remote_control_has_two_partners():
    partners = {name: sum(name == source for source, _ in HOPS) for name in STATIONS}
    assert partners == {"RCS": 2, "BCS": 1, "SS": 1}
    assert link.serial_chips() == max(partners.values())


def test_of_overruns_by_less_than_a_lap_half_show_the_case_that_means_one():
    places, leads = range(ring.SIZE), range(ring.SIZE + 1, 2 * ring.SIZE)
    shown = [case_of(place, lead, ring.SIZE) for place in places for lead in leads]
    assert (shown.count("a"), shown.count("c")) == (8128, 8128)
    assert len(shown) == 2 * 8128
    # A ring that is just full shows case c as well, with nothing overwritten.
    assert {case_of(place, ring.SIZE, ring.SIZE) for place in places} == {"c"}


def test_where_the_ring_stops_in_case_a_the_printed_reader_finds_nothing():
    table = recovered([100, 160, 200, 240])
    stops = [sum(place + n >= 256 for place in range(0, 128, 8)) / 16 for n in table.waiting]
    assert table.stops.tolist() == stops
    assert table.fewest.tolist() == [3, 0, 0, 0] and table.corrected.tolist() == [3, 3, 3, 3]
    for place in (5, 64, 127):
        assert [ring.packets_found(n, "corrected", get_no=place) for n in table.waiting] == [
            3,
            3,
            3,
            3,
        ]


@pytest.mark.parametrize(("stall", "unread"), [(0.2, 33), (3.8, 33), (5.0, 66), (9.0, 99)])
def test_up_to_three_packets_wait_in_a_stall_that_leaves_the_ring_in_order(stall, unread):
    run = simulate(link.as_printed(), faults=Stall("BCS", start=5.0, stop=5.0 + stall), until=25.0)
    assert unread - 33 < run.max_unread <= unread
    assert ring.parameter_change_does_no_harm(stall=stall)


def test_with_the_search_a_repair_gives_up_a_packet_more_at_most():
    lost = given_up(10)
    assert (min(lost), max(lost)) == (1, 64 + 32)
    assert np.mean(lost) == pytest.approx(32.5 + 16)


def test_a_crc_is_recommended_for_one_datum_too():
    table = candidates(1, System(), 1e-5, 3.0).query("check == 'markers'")
    assert not table["errors_ok"].any()
    assert "CRC" in recommend(1).check


def test_the_check_depends_on_the_error_rate_not_on_the_number():
    for rate, check in ((1e-5, "CRC"), (1e-11, "CRC"), (4e-12, "markers")):
        assert {recommend(n, rate=rate).check for n in (1, 3, 10, 40)} == {check}


def test_what_a_lost_packet_costs_depends_on_how_often_the_value_moves():
    assert link.loss_does_no_harm(interval=3.1) < 0 < link.loss_does_no_harm(interval=2.9)
    # The same on a simulated link: the move at 1 s is lost, and SS is right after the next one.
    system = System(turn_timeout=0.1)
    for interval in (2.0, 4.0):
        moves = [Change(1.0 + k * interval, "BCS", 1, k + 1) for k in range(3)]
        run = simulate(system, moves, faults=LostPacket("BCS", "RCS", start=1.0), until=14)
        second = next(u.time for u in run.updates if (u.station, u.value) == ("SS", 2))
        assert not [u for u in run.updates if (u.station, u.value) == ("SS", 1)]
        assert interval < second - 1.0 < interval + system.response_time()
