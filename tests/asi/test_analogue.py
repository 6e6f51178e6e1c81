import numpy as np
import pytest

from shipnet import datasets
from shipnet.asi import Profile
from shipnet.asi.timing import (
    Cycle,
    cycle_time,
    transfer_cycles,
    transfer_time,
)
from shipnet.errors import ArgumentError
from shipnet.papers.kim2023.protocol import least_cycles

PUBLISHED = datasets.read("asi_published_cycles.csv").astype({"number": int, "time_ms": float})


def test_published_transfer_times_are_reproduced():
    transfers = PUBLISHED[PUBLISHED["quantity"].str.startswith("transfer of S-7.3")]
    assert len(transfers) == 4
    for row in transfers.itertuples():
        rounds = int("one round" in row.quantity)
        time = transfer_time("S-7.3", 5e-3, channels=row.number, extra_rounds=rounds)
        assert time * 1e3 == pytest.approx(row.time_ms)


def test_a_real_transfer_never_beats_four_bits_a_cycle():
    for row in datasets.read("asi_analogue_profiles.csv").itertuples():
        assert int(row.cycles) >= least_cycles(int(row.value_bit)) / int(row.addresses)
        assert str(Profile.parse(row.profile)) == row.profile


def test_messages_of_more_than_four_bits_take_several_cycles():
    assert [least_cycles(bits) for bits in (1, 4, 5, 8, 16)] == [1, 1, 2, 2, 4]
    assert transfer_cycles("S-7.3") > least_cycles(16)


def test_sharing_an_address_doubles_the_time():
    times = transfer_time("S-7.A.7", [5e-3, cycle_time(31)], paired=True, direction="out")
    assert times.tolist() == [4 * 5e-3, 4 * cycle_time(31)]
    assert transfer_time("S-7.A.7", 5e-3, paired=True) == 10e-3
    # About 50 Bd: 16 bits take 0.32 s.
    assert 16 / transfer_time("S-7.A.5", 5e-3, paired=True) == pytest.approx(50)


def test_a_profile_is_found_by_its_first_two_codes():
    assert transfer_cycles(Profile.parse("S-7.3.C")) == 7
    assert transfer_cycles("S-6.0", value_bit=8) == 1
    with pytest.raises(ArgumentError, match=r"profile is 'S-7\.A\.8' in; known are S-7\.3 in 16"):
        transfer_cycles("S-7.A.8")
    with pytest.raises(ArgumentError, match=r"'S-7\.A\.5' out"):
        transfer_cycles("S-7.A.5", direction="out")
    with pytest.raises(ArgumentError, match="12 bit"):
        transfer_cycles("S-7.3", value_bit=12)


@pytest.mark.parametrize("cycle", [0, -1, np.nan, np.inf, "5 ms", [5e-3, 0]])
def test_what_is_no_cycle_is_refused(cycle):
    with pytest.raises(ArgumentError, match="cycle is"):
        transfer_time("S-7.3", cycle)


@pytest.mark.parametrize("channels", [0, 5, 1.0])
def test_numbers_of_channels(channels):
    with pytest.raises(ArgumentError, match="channels is"):
        transfer_cycles("S-7.3", channels=channels)


def test_a_value_waits_for_a_round_its_transfer_and_the_conversions():
    cycle, one = Cycle(31), 7 * cycle_time(31)
    best, worst = cycle.response_time("S-7.3", channels=4, conversion=60e-3)
    assert (best, worst) == pytest.approx((one + 60e-3, 5 * one + 4 * 60e-3))
    # The second of two exchanges waits as one does.
    best, worst = Cycle(62).response_time("S-7.A.7", direction="out")
    assert worst == pytest.approx(60e-6 + 4 * cycle_time(31))
