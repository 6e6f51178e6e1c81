from shipnet.asi.commands import ChangeAddress
from shipnet.asi.simulation import simulate
from shipnet.asi.telegram import Call, Request
from shipnet.asi.timing import Transaction
from shipnet.asi.topologies import star
from shipnet.crc import CAN, MODBUS
from shipnet.papers import icn2007
from shipnet.papers.icn2007 import allowed_plans, trunk_and_star
from shipnet.papers.kim2023 import protocol, signals
from shipnet.papers.kim2023.protocol import moves
from shipnet.papers.kim2023.ship import margin_of
from shipnet.papers.registry import REGISTRY


def test_the_wait_is_that_of_the_timing():
    assert Transaction().timeout == 10
    assert protocol.goes_on_after(repeats=True) and not protocol.goes_on_after(
        repeats=True, wait=9.0
    )


def test_only_own_and_sound_requests_are_answered():
    assert icn2007.answer_to(Request(Call.READ_ID, 3).bits) != "silence"
    for address in (1, 2, 4, 31):
        assert icn2007.answer_to(Request(Call.READ_ID, address).bits) == "silence"
    assert icn2007.answer_to(icn2007.UNKNOWN) == "silence"


def test_a_move_to_a_taken_address_is_refused():
    assert moves(target="9") >= 0 and moves(target="31") >= 0
    assert moves(target="3") < 0 and moves(target="1") < 0
    run = simulate(icn2007.five_slaves(), until=0.2, commands=[(0.05, ChangeAddress("2", "3"))])
    assert not run.commands["done"].item()


def test_each_allowed_structure_has_100_m_and_62_slaves_at_most():
    plans = allowed_plans()
    assert all(sum(run.length for run in plan.cables) <= 100 + 1e-9 for plan in plans.values())
    assert [len(plan.slaves) for plan in plans.values()] == [1] + [62] * 7
    assert margin_of(trunk_and_star(leg=2.0)) < 0


def test_the_place_of_the_supply_is_a_condition_too():
    least = {}
    for supply in (0, 90):
        table = star(90, [10 / 62] * 62, supply=supply).check().table()
        least[supply] = table.query("rule == 'slave_voltage'")["value"].min()
    assert round(least[0], 1) == 20.2
    assert least[0] < 26.5 < least[90]
    assert icn2007.star_behind_trunk(supply=0.0) < 0 < icn2007.star_behind_trunk(supply=90.0)


def test_a_quarter_wave_in_the_signal_distorts_it_as_much_as_noise():
    signal, noise = icn2007.open_end_distortion()
    assert (round(signal, 2), round(noise, 2)) == (0.23, 0.47)
    signal, noise = icn2007.open_end_distortion(speed=2.0)
    assert round(signal, 2) == 0.57 > noise
    signal, noise = icn2007.open_end_distortion(length=200.0)
    assert signal > noise


def test_the_distance_is_that_of_the_first_pattern_that_passes():
    for crc in (MODBUS, CAN):
        single = crc.syndromes(6).tolist()
        assert 0 not in single and len(set(single)) == len(single)
    assert signals.hamming_distance(MODBUS, 6) == 4
    # A valid frame 4 bits away from another, by its four places.
    single = MODBUS.syndromes(6)
    assert not REGISTRY["icn2007-061"](distance=5) and len(set(single.tolist())) == 64
