import numpy as np
import pytest

from shipnet import datasets
from shipnet.asi import CableRun, Master, Plan, Profile, Slave, simulate
from shipnet.asi.timing import CONVERSION, Cycle, cycle_time, exchanges
from shipnet.errors import ArgumentError
from shipnet.papers.kim2023.protocol import least_cycles
from tests.support import tolerance

PUBLISHED = datasets.read("asi_published_cycles.csv").astype({"number": int, "time_ms": float})


def test_published_transfer_times_are_reproduced():
    transfers = PUBLISHED[PUBLISHED["quantity"].str.startswith("transfer of S-7.3")]
    assert len(transfers) == 4
    for row in transfers.itertuples():
        rounds = int("one round" in row.quantity)
        assert exchanges("S-7.3") * (row.number + rounds) * 5 == pytest.approx(row.time_ms)


def test_a_real_transfer_never_beats_four_bits_per_cycle():
    profiles = datasets.read("asi_analogue_profiles.csv")
    assert set(profiles.loc[profiles["cycles"] == "", "evidence"]) == {"unknown"}
    for row in profiles[profiles["cycles"] != ""].itertuples():
        assert int(row.cycles) >= least_cycles(int(row.value_bit)) / int(row.addresses)
        assert str(Profile.parse(row.profile)) == row.profile


def test_messages_of_more_than_four_bits_take_several_cycles():
    assert [least_cycles(bits) for bits in (1, 4, 5, 8, 16)] == [1, 1, 2, 2, 4]
    assert exchanges("S-7.3") > least_cycles(16)


def test_sharing_an_address_doubles_the_time():
    answer = 60e-6
    for n in (10, 31):
        times = Cycle(n).response_time("S-7.A.7", paired=True, direction="out")
        assert times.worst == pytest.approx(4 * cycle_time(n) + 84e-6)
    late = Cycle(31).response_time("S-7.A.7", paired=True).worst
    assert late == pytest.approx(2 * cycle_time(31) + answer)
    # About 50 Bd: 16 bits take 0.32 s in cycles of 5 ms.
    time = Cycle(31).response_time("S-7.A.5", paired=True).best
    assert 16 / time == pytest.approx(50 * 5e-3 / cycle_time(31))


def test_the_first_two_codes_identify_a_profile():
    assert exchanges(Profile.parse("S-7.3.C")) == 7
    assert exchanges("S-6.0") == exchanges("S-0.F") == 1
    for profile in ("S-7.A.8", "S-7.A.9", "S-7.5.5"):
        with pytest.raises(ArgumentError, match=rf"'{profile}'; its number of exchanges"):
            Cycle(31).response_time(profile)
    with pytest.raises(ArgumentError, match=r"'S-7\.A\.5'.*'out' value"):
        exchanges("S-7.A.5", "out")
    with pytest.raises(ArgumentError, match="direction is 'up'"):
        Cycle(31).response_time(direction="up")


@pytest.mark.parametrize("channels", [0, 5, 1.5])
def test_numbers_of_channels(channels):
    with pytest.raises(ArgumentError, match="channels is"):
        Cycle(31).response_time("S-7.3", channels=channels)


def test_a_value_waits_for_a_round_its_transfer_and_the_conversions():
    cycle, one = Cycle(31), 7 * cycle_time(31)
    best, typical, worst = cycle.response_time("S-7.3", channels=4)
    assert (best, worst) == pytest.approx((one, 5 * one + 4 * CONVERSION))
    assert typical == pytest.approx((best + worst) / 2)
    # The second of two exchanges waits as long as a single one.
    worst = Cycle(62).response_time("S-7.A.7", direction="out").worst
    assert worst == pytest.approx(84e-6 + 4 * cycle_time(31))


@pytest.mark.parametrize(
    ("channels", "conversion", "cycles"),
    [(1, 58.2e-3, 4000), (2, 22.2e-3, 4000), (4, 0.0, 2000), (1, 0.3, 4000)],
)
def test_responses_of_values_and_bits_are_those_of_the_simulated_line(channels, conversion, cycles):
    module = Slave("1", "S-7.3", node="0 m", channels=channels, conversion=conversion)
    bits = [Slave(f"{n}", node="0 m") for n in range(2, 32)]
    plan = Plan([CableRun("0 m", "50 m", 50)], masters=[Master(node="0 m")], slaves=[module, *bits])
    computed, seen = plan.response_times(), simulate(plan, cycles=cycles).response_times()
    close = {"rel": tolerance("asi.responses")}
    assert seen["longest_s"].to_dict() == pytest.approx(computed["worst_s"].to_dict(), **close)
    assert seen["mean_s"].to_dict() == pytest.approx(computed["typical_s"].to_dict(), **close)
    # The formula uses the longer cycle, and the simulation does not contain the best moment.
    assert (seen["longest_s"] <= computed["worst_s"]).all()
    assert (seen["least_s"] >= (1 - close["rel"]) * computed["best_s"]).all()


def test_a_simulation_has_no_response_time_for_an_unknown_value():
    slaves = [Slave("1"), Slave("2A", "S-7.A.9")]
    found = simulate(slaves, cycles=20).table()
    assert np.isnan(found.loc["2A", "longest_s"]) and found.loc["1", "longest_s"] > 0


def test_a_module_transfers_one_value_unless_it_names_more():
    assert Slave("1", "S-7.3") == Slave("1", "S-7.3", channels=1)
    assert Slave("1", "S-7.3") != Slave("1", "S-7.3", channels=2)
