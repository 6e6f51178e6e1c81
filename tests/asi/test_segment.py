from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from shipnet.asi import Request, Response
from shipnet.asi.modulation import Modulation
from shipnet.asi.segment import POWER_SUPPLY, Terminator, quality_of, telegram_voltages
from shipnet.asi.slave import DEVICE
from shipnet.asi.telegram import RESPONSES
from shipnet.asi.topologies import line, ring, star
from shipnet.errors import ArgumentError
from shipnet.line import CABLES, Cable, CableRun, Load, Network
from shipnet.line.waveform import laplace_grid, synthesize
from tests.support import tolerance

SIX = Response(6)


def test_telegrams_are_sums_of_single_changes():
    plan = line(100, slaves=(5, 50, 100))
    nodes, dt = ["5 m", "50 m", "100 m"], 50e-9
    u = telegram_voltages(
        plan.network, "0 m", nodes, RESPONSES, dt=dt, before=5e-6, after=55.4e-6, f_max=6e6
    )[0]
    assert u.shape == (3, 16, 2048)
    s = laplace_grid(102.4e-6, 6e6)
    transfer = plan.network.transfer("0 m", s)
    for row, node in enumerate(nodes):
        spectrum = Modulation(Modulation(RESPONSES).bits).transform(s, start=5e-6)
        whole = synthesize(-transfer[plan.network.index(node)] * spectrum, 2048, 102.4e-6)
        assert u[row] == pytest.approx(whole, abs=2e-5 * np.abs(whole).max())


def test_both_directions_have_the_same_voltage():
    network = line(100, slaves=(30,), supply=70).network
    bits = Request.data_exchange(21, 0xE).bits
    (there,) = telegram_voltages(network, "0 m", ["30 m"], bits)
    (back,) = telegram_voltages(network, "30 m", ["0 m"], bits)
    assert there == pytest.approx(back, abs=1e-9)


def test_a_terminated_line_agrees_with_a_solution_of_the_nodal_equations():
    # Chain matrices of two cables joined at 5 m, solved as 3 equations per frequency.
    ohm, henry, cable = 180.0, 300e-6, CABLES["as-i 1.5"]
    plain = line(200, slaves=(5, 200))
    plan = replace(plain, terminators=[Terminator("200 m", ohm, henry)])
    a, n = 5e4, 4096
    dt = 102.4e-6 / n
    s = a + 2j * np.pi * np.fft.rfftfreq(n, dt)
    z, y = cable.series_impedance(s), cable.shunt_admittance(s)
    gamma = np.sqrt(z * y)
    admittance = np.zeros((s.size, 3, 3), complex)
    for k, metres in enumerate((5, 195)):
        diagonal = gamma / z / np.tanh(gamma * metres)
        mutual = gamma / z / np.sinh(gamma * metres)
        admittance[:, k, k] += diagonal
        admittance[:, k + 1, k + 1] += diagonal
        admittance[:, k, k + 1] -= mutual
        admittance[:, k + 1, k] -= mutual
    device = 1 / 13.5e3 + 1 / (13.5e-3 * s) + 50e-12 * s
    admittance[:, 0, 0] += device + 1 / 78 + 1 / (100e-6 * s)
    admittance[:, 1, 1] += device
    admittance[:, 2, 2] += device + 1 / ohm + 1 / (henry * s)
    current = Modulation("0011001").transform(s, start=5e-6)
    for row, node in ((1, "5 m"), (2, "200 m")):
        drawn = np.zeros((s.size, 3, 1), complex)
        drawn[:, row, 0] = -current
        voltage = np.linalg.solve(admittance, drawn)[:, 0, 0]
        t = np.arange(n) * dt
        u = np.exp(a * t) * np.fft.irfft(voltage, n) / dt
        wave = plan.waveform(SIX, node, dt=50e-9, before=5e-6, after=20e-6)
        true = np.interp(np.arange(wave.u.size) * wave.dt, t, u)
        assert wave.u == pytest.approx(true, abs=5e-4 * np.abs(true).max())


def test_places_may_coincide():
    assert line(100, slaves=(0, 100), master=100).waveform(SIX).names == ("0 m", "100 m")


def test_equal_legs_receive_alike_and_a_longer_leg_later():
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
    folded = telegram_voltages(
        Network(runs, loads), "0 m", ["25 m", "50 m"], SIX.bits, before=18e-6
    )[0][:, 0]
    u = ring(100, slaves=(25, 50, 75)).waveform(SIX).u
    assert u[:2] == pytest.approx(folded, abs=1e-9)


def test_quality_is_the_worst_of_all_receptions():
    plan = line(140, slaves=(5, 70, 140))
    quality, wave = plan.quality(), plan.waveform(before=5e-6, after=55e-6)
    reception = wave.receive()
    assert quality.evenness == pytest.approx(reception.weakest.min(axis=1), abs=1e-12)
    assert quality.ringing == pytest.approx(reception.ringing.max(axis=1), abs=1e-12)
    assert quality.level_least == pytest.approx(np.ptp(wave.u, axis=-1).min(axis=1), abs=1e-12)
    assert (quality.level_most >= quality.level_least).all()
    assert quality.received.tolist() == [1, 1, 1]


def test_too_long_a_cable_loses_some_telegrams_and_no_signal_loses_all():
    assert 0 <= line(250, slaves=(5,)).quality().received[0] < 1
    plan = line(10, slaves=(10,))
    shorted = Network(plan.cables, {"0 m": Load(r=0.01, l=POWER_SUPPLY.l)})
    wave = plan.waveform()
    (silent,) = telegram_voltages(shorted, "0 m", ["10 m"], RESPONSES)
    quality = quality_of(type(wave)(silent, wave.dt, bits=wave.bits))
    assert (quality.evenness[0], quality.ringing[0], quality.received[0]) == (0, 1, 0)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: line(100, slaves=(101,)), r"the slave is at 101 m; it must be 0\.\.100 m"),
        (lambda: line(100, slaves=(5,), master=-1), "the master is at -1 m"),
        (lambda: line(100, slaves=(5,), supply=float("nan")), "the supply is at nan m"),
        (lambda: star(10, (1,), along=(11,)), r"the slave is at 11 m; it must be 0\.\.10 m"),
        (lambda: star(10, (1, -2)), "cable 10 m - leg 2 is -2"),
        (lambda: star(10, (float("nan"),)), "leg 1"),
        (lambda: ring(100, ()), r"the last position on the ring is 0\.0 m"),
        (lambda: ring(100, (50, 100)), "between 0 and 100 m"),
        (lambda: line(100, slaves=(5,)).waveform(SIX, dt=7e-8), "dt is 7e-08 s"),
        (lambda: line(100, slaves=(5,)).waveform(SIX, dt=1e-5), "dt is 1e-05 s"),
        (lambda: line(100, slaves=(5,)).waveform("0200000"), "bits of telegrams must be 0 or 1"),
        (lambda: line(100).waveform(), "has no slave; at least one must send or receive"),
        (lambda: line(10, (5,)).waveform(("0011001", "00101010111001")), "equal length"),
    ],
)
def test_bad_places_steps_and_telegrams_are_named(make, message):
    with pytest.raises(ArgumentError, match=message):
        make()


def random_tree(rng, *, supplied):
    """Return a network of at most 100 m in a random shape, and the node of its master."""
    count, total = int(rng.integers(1, 40)), float(rng.uniform(5, 100))
    lengths = np.maximum(rng.dirichlet(np.full(count, rng.choice([0.5, 1.0, 5.0]))) * total, 0.01)
    cable = rng.choice(["as-i 0.75", "as-i 1.5", "as-i 2.5", "as-i lossless"])
    back = int(rng.choice([1, 3, 99]))
    runs = [
        CableRun(f"n{rng.integers(max(0, k - back), k)}", f"n{k}", float(length), str(cable))
        for k, length in enumerate(lengths, start=1)
    ]
    loads = {f"n{k}": DEVICE for k in range(count + 1) if k == 0 or rng.random() < 0.7}
    if supplied:
        node = f"n{rng.integers(count + 1)}"
        loads[node] = loads[node] + POWER_SUPPLY if node in loads else POWER_SUPPLY
    return Network(runs, loads), f"n{rng.integers(count + 1)}"


def equal_star(length, *, supplied=True):
    """Return a star of equal legs, 100 m of lossless cable in all, with the master on one leg."""
    count = min(int(100 / length), 40)
    runs = [CableRun("hub", f"leg {k}", length, "as-i lossless") for k in range(count)]
    loads = dict.fromkeys(("hub", *(f"leg {k}" for k in range(count))), DEVICE)
    if supplied:
        loads["leg 0"] = DEVICE + POWER_SUPPLY
    return Network(runs, loads), "leg 1"


def family():
    rng = np.random.default_rng(2024)
    for number in range(24):
        yield f"tree {number}", *random_tree(rng, supplied=number % 3 > 0)
    for length in (1.6, 2.5, 3, 4, 5.5, 6, 10, 12):
        yield f"star of {length} m", *equal_star(length)
    yield "star without a supply", *equal_star(6, supplied=False)
    for length in (10, 100, 200, 300):
        yield f"line of {length} m", line(length, slaves=(5, length)).network, "0 m"
    yield "ring", ring(100, slaves=(25, 50, 75)).network, "0 m"
    stubs = [CableRun(f"t{k}", f"s{k}", 1.0) for k in range(1, 20)]
    trunk = [CableRun(f"t{k}", f"t{k + 1}", 4.0) for k in range(20)]
    yield "stubs", Network(trunk + stubs, {"t0": DEVICE + POWER_SUPPLY, "s19": DEVICE}), "s10"


FAMILY = list(family())


@pytest.mark.parametrize(
    ("network", "master"), [one[1:] for one in FAMILY], ids=[n for n, *_ in FAMILY]
)
def test_every_voltage_is_within_5e_5_of_its_peak(network, master):
    # Four times the cut-off, and a record so long that nothing of it wraps around.
    bits = "00011111111111"
    (u,) = telegram_voltages(network, master, network.nodes, bits)
    (exact,) = telegram_voltages(network, master, network.nodes, bits, after=400e-6, f_max=48e6)
    error = np.abs(u - exact[..., : u.shape[-1]])
    allowed = tolerance("asi.cut_off") * np.abs(exact).max(axis=-1)
    assert (error.max(axis=-1) <= allowed).all()


REFERENCE = np.load(Path(__file__).parents[1] / "reference" / "line" / "asi.npz")


@pytest.mark.parametrize("case", sorted({name.split("/")[0] for name in REFERENCE.files}))
def test_voltages_at_the_default_cut_off_agree_with_ngspice(case):
    expected, bits = REFERENCE[f"{case}/v"], REFERENCE[f"{case}/bits"]
    name, cable = case.split("_")[0], "as-i lossless" if case.endswith("_T") else "as-i 1.5"
    far = int(name[3:]) if name.startswith("len") else 100
    places, supply = ((0, 5, 50, 55, 100), 50) if name == "b" else ((0, 5, far // 2, far), 0)
    runs = [CableRun(f"n{a}", f"n{b}", b - a, cable) for a, b in pairwise(places)]
    loads = {f"n{number}": DEVICE for number in places}
    loads[f"n{supply}"] = POWER_SUPPLY if supply else POWER_SUPPLY + DEVICE
    u = telegram_voltages(
        Network(runs, loads),
        str(REFERENCE[f"{case}/sender"]),
        REFERENCE[f"{case}/probes"].tolist(),
        bits,
        before=5e-6,
        after=120e-6,
    )[0][:, 0]
    error = np.abs(u[:, : expected.shape[1]] - expected[:, : u.shape[1]])
    assert error.max() <= tolerance("asi.ngspice") * np.abs(expected).max()
