import numpy as np
import pytest

from shipnet.asi import Request, Response
from shipnet.asi.elements import DEVICE, POWER_SUPPLY
from shipnet.asi.modulation import as_bits, send_spectrum
from shipnet.asi.segment import quality_of, telegram_voltages
from shipnet.asi.telegram import RESPONSES
from shipnet.asi.topologies import line, ring, star
from shipnet.errors import ArgumentError
from shipnet.line import CABLES, Cable, CableRun, Load, Network
from shipnet.line.waveform import laplace_grid, synthesize

SIX = Response(6)


def test_telegrams_are_sums_of_single_changes():
    plan = line(100, slaves=(5, 50, 100))
    nodes, dt = ["5 m", "50 m", "100 m"], 50e-9
    u = telegram_voltages(
        plan.network, "0 m", nodes, RESPONSES, dt=dt, before=5e-6, after=55.4e-6, f_max=6e6
    )
    assert u.shape == (3, 16, 2048)
    s = laplace_grid(102.4e-6, 6e6)
    transfer = plan.network.transfer("0 m", s)
    for row, node in enumerate(nodes):
        spectrum = send_spectrum(s, as_bits(RESPONSES), start=5e-6)
        whole = synthesize(-transfer[plan.network.index(node)] * spectrum, 2048, 102.4e-6)
        assert u[row] == pytest.approx(whole, abs=2e-5 * np.abs(whole).max())


def test_what_a_slave_hears_is_what_the_master_hears_of_it():
    network = line(100, slaves=(30,), supply=70).network
    bits = Request.data_exchange(21, 0xE).bits
    there = telegram_voltages(network, "0 m", ["30 m"], bits)
    assert there == pytest.approx(telegram_voltages(network, "30 m", ["0 m"], bits), abs=1e-9)


def test_a_terminator_and_a_lossless_cable_change_the_signal():
    plain, lossless, ended = (
        line(150, slaves=(5,), **options).waveform(SIX).u
        for options in ({}, {"cable": CABLES["as-i lossless"]}, {"terminator": 100.0})
    )
    assert np.abs(plain - lossless).max() > 1e-3
    assert np.abs(plain - ended).max() > 0.1


def test_places_may_coincide():
    assert line(100, slaves=(0, 100), master=100).waveform(SIX).names == ("0 m", "100 m")


def test_equal_legs_sound_alike_and_a_longer_leg_later():
    u = star(0, (10, 10, 40)).waveform(SIX).u
    assert u[0] == pytest.approx(u[1], abs=1e-12)
    assert np.abs(u[2] - u[0]).max() > 0.01


def test_a_star_of_one_leg_is_a_line():
    trunk, straight = star(60, (40,), along=(20,)), line(100, slaves=(20, 100))
    assert trunk.waveform(SIX).u == pytest.approx(straight.waveform(SIX).u, abs=1e-9)


def test_a_ring_is_fed_from_both_sides():
    u = ring(100, slaves=(25, 50, 75)).waveform(SIX).u
    assert u[0] == pytest.approx(u[2], abs=1e-9)


def test_a_ring_agrees_with_its_two_halves_folded():
    # By symmetry no current crosses the middle: two cables side by side, open at their ends.
    cable = CABLES["as-i 1.5"]
    both = Cable(r=cable.r / 2, l=cable.l / 2, c=cable.c * 2)
    runs = [CableRun("0 m", "25 m", 25, both), CableRun("25 m", "50 m", 25, both)]
    loads = {"0 m": POWER_SUPPLY + DEVICE, "25 m": DEVICE + DEVICE, "50 m": DEVICE}
    folded = telegram_voltages(Network(runs, loads), "0 m", ["25 m", "50 m"], SIX.bits)[:, 0]
    u = ring(100, slaves=(25, 50, 75)).waveform(SIX).u
    assert u[:2] == pytest.approx(folded, abs=1e-9)


def test_quality_is_the_worst_of_what_the_receiver_says():
    plan = line(140, slaves=(5, 70, 140))
    found, wave = plan.quality(), plan.waveform(before=5e-6, after=55e-6)
    heard = wave.receive()
    assert found.evenness == pytest.approx(heard.weakest.min(axis=1), abs=1e-12)
    assert found.ringing == pytest.approx(heard.ringing.max(axis=1), abs=1e-12)
    assert found.level_least == pytest.approx(np.ptp(wave.u, axis=-1).min(axis=1), abs=1e-12)
    assert (found.level_most >= found.level_least).all()
    assert found.received.tolist() == [1, 1, 1]


def test_too_long_a_cable_loses_some_telegrams_and_no_signal_loses_all():
    assert 0 <= line(250, slaves=(5,)).quality().received[0] < 1
    plan = line(10, slaves=(10,))
    shorted = Network(plan.cables, {"0 m": Load(r=0.01, l=POWER_SUPPLY.l)})
    wave = plan.waveform()
    silent = telegram_voltages(shorted, "0 m", ["10 m"], RESPONSES)
    found = quality_of(type(wave)(silent, wave.dt, bits=wave.bits))
    assert (found.evenness[0], found.ringing[0], found.received[0]) == (0, 1, 0)


def test_many_slaves_hear_requests():
    plan = star(90, [10 / 62] * 62)
    found = quality_of(plan.waveform(("00101010111001", "01010101010101")))
    assert found.received.tolist() == [1] * 62


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: line(100, slaves=(101,)), r"the slave is at 101 m; it must be 0\.\.100 m"),
        (lambda: line(100, slaves=(5,), master=-1), "the master is at -1 m"),
        (lambda: line(100, slaves=(5,), supply=float("nan")), "the supply is at nan m"),
        (lambda: star(10, (1,), along=(11,)), r"the slave is at 11 m; it must be 0\.\.10 m"),
        (lambda: star(10, (1, -2)), "cable 10 m - leg 2 is -2"),
        (lambda: star(10, (float("nan"),)), "leg 1"),
        (lambda: ring(100, ()), r"the last place on the ring is 0\.0 m"),
        (lambda: ring(100, (50, 100)), "between 0 and 100 m"),
        (lambda: line(100, slaves=(5,)).waveform(SIX, dt=7e-8), "dt is 7e-08 s"),
        (lambda: line(100, slaves=(5,)).waveform(SIX, dt=1e-5), "dt is 1e-05 s"),
        (lambda: line(100, slaves=(5,)).waveform("0200000"), "bits must be 0 or 1"),
        (lambda: line(100).waveform(), "has no slave; one must send or hear"),
        (lambda: line(10, (5,)).waveform(("0011001", "00101010111001")), "one length"),
    ],
)
def test_bad_places_steps_and_telegrams_are_named(make, message):
    with pytest.raises(ArgumentError, match=message):
        make()
