import pytest

from shipnet import datasets
from shipnet.asi import Profile
from shipnet.asi.timing import (
    Cycle,
    cycle_time,
    transfer_cycles,
)
from shipnet.errors import ArgumentError
from shipnet.papers.kim2023.protocol import least_cycles

PUBLISHED = datasets.read("asi_published_cycles.csv").astype({"number": int, "time_ms": float})


def test_published_transfer_times_are_reproduced():
    transfers = PUBLISHED[PUBLISHED["quantity"].str.startswith("transfer of S-7.3")]
    assert len(transfers) == 4
    for row in transfers.itertuples():
        rounds = int("one round" in row.quantity)
        cycles = transfer_cycles("S-7.3", channels=row.number, extra_rounds=rounds)
        assert cycles * 5 == pytest.approx(row.time_ms)


def test_a_real_transfer_never_beats_four_bits_a_cycle():
    for row in datasets.read("asi_analogue_profiles.csv").itertuples():
        assert int(row.cycles) >= least_cycles(int(row.value_bit)) / int(row.addresses)
        assert str(Profile.parse(row.profile)) == row.profile


def test_messages_of_more_than_four_bits_take_several_cycles():
    assert [least_cycles(bits) for bits in (1, 4, 5, 8, 16)] == [1, 1, 2, 2, 4]
    assert transfer_cycles("S-7.3") > least_cycles(16)


def test_sharing_an_address_doubles_the_time():
    times = Cycle([10, 31]).transfer_time("S-7.A.7", paired=True, direction="out")
    assert times.tolist() == [4 * cycle_time(10), 4 * cycle_time(31)]
    assert Cycle(31).transfer_time("S-7.A.7", paired=True) == 2 * cycle_time(31)
    # About 50 Bd: 16 bits take 0.32 s in cycles of 5 ms.
    time = Cycle(31).transfer_time("S-7.A.5", paired=True)
    assert 16 / time == pytest.approx(50 * 5e-3 / cycle_time(31))


def test_a_profile_is_found_by_its_first_two_codes():
    assert transfer_cycles(Profile.parse("S-7.3.C")) == 7
    assert transfer_cycles("S-6.0", value_bit=8) == 1
    with pytest.raises(ArgumentError, match=r"profile is 'S-7\.A\.8' in; known are S-7\.3 in 16"):
        transfer_cycles("S-7.A.8")
    with pytest.raises(ArgumentError, match=r"'S-7\.A\.5' out"):
        transfer_cycles("S-7.A.5", direction="out")
    with pytest.raises(ArgumentError, match="12 bit"):
        transfer_cycles("S-7.3", value_bit=12)


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
