"""Evidence for verdicts on chung1998 that need more than the claim's own function."""

import numpy as np
import pytest

from shipnet.papers import counts
from shipnet.papers.chung1998 import integrity, link, overrun, packets, ring
from shipnet.papers.chung1998.stations import PRINTED
from shipnet.remote_control import Markers, Ring
from shipnet.remote_control.experiment import Criterion, candidates, recommend
from shipnet.remote_control.link import BIT_RATES, MEANT, Supervision, System, cascade, worst_age
from shipnet.remote_control.link import PRINTED as PRINTED_RULE
from shipnet.remote_control.link.trials import overrun_stall, ring_trials, switch_trials


def test_no_claim_is_open():
    assert counts().loc["chung1998", "open"] == 0


def test_three_seconds_need_both_tests_to_be_reached():
    tick, count, miss = (
        float(PRINTED[name]) for name in ("tick", "count_threshold", "miss_threshold")
    )
    assert (
        link.failure_time() == pytest.approx((count + 1) * (miss + 1) * tick) == pytest.approx(4.4)
    )
    assert MEANT.detection_time[1] == pytest.approx(count * miss * tick) == pytest.approx(3.0)
    assert PRINTED_RULE == Supervision(tick, int(count), int(miss))


def test_the_rates_are_those_of_the_paper():
    assert [float(PRINTED[f"baud_rate_{k}"]) for k in range(1, 6)] == list(BIT_RATES)


def test_the_delay_of_a_switch_grows_with_the_length_of_a_bit():
    alone, all_data = (
        switch_trials(np.random.default_rng(2024), System(repeat=repeat)) for repeat in (0, 10)
    )
    for table in (alone, all_data):
        assert (table["followed"] == 20).all()
        assert 10 < table["longest_s"].iloc[-1] / table["longest_s"].iloc[0] < 20
    assert alone["longest_s"].max() < 0.5 < 3 < all_data["longest_s"].max()
    assert worst_age(System(bit_rate=600)) == 16 * worst_age(System(bit_rate=9600))


def test_bcs_may_take_rcs_as_failed_and_at_600_bit_per_s_must():
    assert [cascade(link.as_printed(rate)).alarm for rate in (9600, 600)] == ["possible", "certain"]


def test_no_reading_lets_the_flags_show_every_single_error():
    passed = {"A": 30 / 33, "B": 30 / 42, "C": 30 / 60}
    for reading, share in passed.items():
        size = packets.length(reading, 10)
        flags = (
            len(packets.flags_at("A", 1)) * 10
            if reading == "C"
            else len(packets.flags_at(reading, 10))
        )
        assert 1 - flags / size == pytest.approx(share)


def test_by_the_letter_an_empty_ring_is_repaired_again_and_again():
    assert overrun.abnormal_states() == 0
    assert overrun.abnormal_states(empty_is_empty=False) > 0
    # The reader has passed the last place, the writer stands on it: this looks like an overrun.
    one = Ring(8)
    for _ in range(7):
        one.store(0xCC)
    for _ in range(8):
        assert one.extract().action == "take"
    assert (one.case, one.unread) == ("c", 0)


@pytest.mark.parametrize("rate", BIT_RATES)
@pytest.mark.parametrize("reading", ["A", "B"])
def test_in_lock_step_no_speed_brings_the_ring_out_of_order(reading, rate):
    table = ring_trials(System(Markers(reading), bit_rate=rate, repeat=10), duration=8.0)
    assert (table["events"] == 0).all()
    assert table["unread"].max() <= packets.length(reading, 10) < ring.SIZE


def test_it_takes_three_more_packets_to_overrun_the_ring():
    stall = overrun_stall(link.as_printed())
    assert stall == pytest.approx((13.14, 13.54), abs=0.01)
    assert overrun.parameter_change_does_no_harm(stall=stall[0] - 0.2)
    assert not overrun.parameter_change_does_no_harm(stall=stall[1] + 0.01)


def test_with_the_search_a_repair_gives_up_a_packet_more_at_most():
    given_up = overrun.given_up(overrun.overrun_rings(10))
    assert (min(given_up), max(given_up)) == (1, 64 + 32)
    assert np.mean(given_up) == pytest.approx(32.5 + 16)


def test_a_crc_is_recommended_for_one_datum_too():
    table = candidates(1).query("check == 'markers'")
    assert not table["errors_ok"].any()
    assert "CRC" in recommend(1).check
    # It stays so if a hundred wrong packets a year are borne with.
    assert "CRC" in recommend(1, criterion=Criterion(wrong_per_year=100)).check


def test_what_a_lost_packet_costs_depends_on_how_often_the_value_moves():
    assert not integrity.loss_does_no_harm(interval=3.1)
    assert integrity.loss_does_no_harm(interval=2.9)
