from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from shipnet.errors import ArgumentError
from shipnet.line import CABLES, Cable
from shipnet.line.characteristics import simulate
from shipnet.line.waveform import laplace_grid, synthesize
from tests.line.building import DEVICE, Net, subdivided
from tests.support import tolerance

FOLDER = Path(__file__).parents[1] / "reference" / "line"
ASI, BUS = (np.load(FOLDER / name) for name in ("asi.npz", "can_rs485.npz"))
LOSSLESS = CABLES["as-i lossless"]


def times(until, dt):
    return np.arange(int(until / dt + 1e-9) + 1) * dt


def waves(network, senders, until, dt, probes=None):
    """Return voltages at nodes; a sender is a node and the result of `drawn` or `driven`."""
    sources = {node: sender(times(until, dt)) for node, sender in senders}
    network = getattr(network, "network", network)
    v = simulate(network, sources, dt)
    return v if probes is None else v[[network.index(probe) for probe in probes]]


def drawn(current):
    """Return a sender that draws a current."""
    return lambda t: (-current(t), np.zeros_like(t))


def driven(voltage, conductance):
    """Return a sender with a voltage behind a conductance."""
    return lambda t: (conductance(t) * voltage(t), conductance(t))


def constant(value):
    return lambda t: np.full_like(t, value)


def ramp(x):
    x = np.clip(x, 0, 1)
    return x - np.sin(2 * np.pi * x) / (2 * np.pi)


def send_current(bits, swing=60e-3):
    level = np.stack([bits, 1 - bits], axis=-1).ravel()
    steps = np.diff(level, prepend=0)
    return lambda t: (
        swing * sum(step * ramp((t - 5e-6) / 3e-6 - slot) for slot, step in enumerate(steps))
    )


def asi_network(supply, cable, far=100):
    places = [0, 5, far // 2, 55, far] if supply else [0, 5, far // 2, far]
    network = Net()
    for near, end in pairwise(places):
        network.line(f"n{near}", f"n{end}", end - near, cable)
    network.load(f"n{supply}", r=78, l=100e-6)
    for place in places:
        if not supply or place != supply:
            network.load(f"n{place}", **DEVICE)
    return network


@pytest.mark.parametrize("model", ["T", "LTRA"])
@pytest.mark.parametrize(
    ("name", "supply", "far"), [("a", 0, 100), ("b", 50, 100), ("len200", 0, 200)]
)
def test_asi_waveforms_agree_with_ngspice(name, supply, far, model):
    network = asi_network(supply, CABLES["as-i lossless" if model == "T" else "as-i 1.5"], far)
    if model == "LTRA":
        network = subdivided(network, 5)
    cases = sorted({key.split("/")[0] for key in ASI.files})
    for case in cases:
        if not (case.startswith(f"{name}_") and case.endswith(f"_{model}")):
            continue
        sender = str(ASI[f"{case}/sender"]), drawn(send_current(ASI[f"{case}/bits"]))
        v = waves(network, [sender], 110e-6, 2.5e-9, ASI[f"{case}/probes"].tolist())
        expected = ASI[f"{case}/v"]
        error = v[:, ::100][:, : expected.shape[1]] - expected
        assert np.abs(error).max() <= tolerance("line.ngspice_steps") * np.abs(expected).max()


def bus(case, *, terminated):
    network = Net()
    for k in range(8):
        network.line(f"b{k}", f"b{k + 1}", 5, CABLES["can"])
    if case.endswith("stub10m"):
        network.line("b4", "st", 10, CABLES["can"])
    for node in network.nodes:
        network.load(node, r=20e3, c=100e-12)
    if terminated:
        network.terminator("b0", 120)
        network.terminator("b8", 120)
    return network


def pattern(t):
    steps = np.diff([0, 1, 0, 1, 1, 0, 0, 1, 0])
    return sum(d * ramp((t - 0.5e-6 - k * 1e-6) / 30e-9) for k, d in enumerate(steps))


@pytest.mark.parametrize("case", ["term", "open", "term_stub10m", "open_stub10m"])
def test_can_and_rs485_waveforms_agree_with_ngspice(case):
    network = bus(case, terminated=case.startswith("term"))
    can = driven(constant(3.2), lambda t: pattern(t) / 40)
    rs485 = driven(lambda t: 5 * pattern(t), constant(1 / 27))
    probes = BUS[f"can_40m_1M_{case}/probes"].tolist()
    for name, sender in (("can", can), ("rs485", rs485)):
        v = waves(network, [("b0", sender)], 10e-6, 0.25e-9, probes)[:, ::80]
        expected = BUS[f"{name}_40m_1M_{case}/v"]
        error = np.abs(v - expected).max()
        assert error <= tolerance("line.ngspice_fast") * np.abs(expected).max()

    network.load("b0", r=27)
    duration = 20e-6
    s = laplace_grid(duration, 500e6)
    x = s * 15e-9
    edge = -np.expm1(-2 * x) / (2 * x) / (1 + (x / np.pi) ** 2)
    steps = np.diff([0, 1, 0, 1, 1, 0, 0, 1, 0])
    at = 0.5e-6 + 1e-6 * np.arange(len(steps))
    current = 5 / 27 * edge / s * (steps @ np.exp(-np.outer(at, s)))
    rows = [network.index(probe) for probe in probes]
    wave = synthesize(network.transfer("b0", s)[rows] * current, 1000, duration)[:, :501]
    assert np.abs(wave - expected).max() <= 2e-4 * np.abs(expected).max()
    assert np.abs(wave - v).max() <= 3e-4 * np.abs(expected).max()


@pytest.mark.parametrize("closed", [False, True])
def test_time_and_frequency_domain_agree_on_a_network_with_everything(closed):
    network = Net()
    cable = Cable(0.05, 0.65e-6, 65e-12, g=2e-6)
    network.line("a", "b", 30, cable)
    network.line("b", "c", 20, cable)
    network.line("b", "d", 10, LOSSLESS)
    if closed:
        network.line("d", "c", 15, cable)
    network.load("a", r=78, l=100e-6)
    network.load("d", r=300, c=2e-9)
    network.load("c", **DEVICE)
    bits = np.array([0, 1, 1])
    duration = 60e-6
    cut, sender = subdivided(network, 5), drawn(send_current(bits))
    v = waves(cut, [("c", sender)], 40e-6, 2.5e-9, network.nodes)
    s = laplace_grid(duration, 20e6)
    x = s * 1.5e-6
    edge = -np.expm1(-2 * x) / (2 * x) / (1 + (x / np.pi) ** 2)
    steps = np.diff(np.stack([bits, 1 - bits], axis=-1).ravel(), prepend=0)
    current = 0.06 * edge / s * (steps @ np.exp(-np.outer(5e-6 + 3e-6 * np.arange(6), s)))
    wave = synthesize(-network.transfer("c", s) * current, 600, duration)[:, :401]
    assert np.abs(v[:, ::40] - wave).max() <= 2e-5 * np.abs(wave).max()


def line(length=100, cable=LOSSLESS):
    network = Net()
    network.line("near", "far", length, cable)
    return network


def test_a_matched_line_only_delays_and_an_open_one_doubles():
    network = line()
    matched = "near", driven(lambda t: 2 * ramp(t / 200e-9), constant(0.01))
    v = waves(network, [matched], 3e-6, 10e-9)
    t = times(3e-6, 10e-9)
    assert v[1] == pytest.approx(2 * ramp((t - 650e-9) / 200e-9), abs=1e-12)
    expected = ramp(t / 200e-9) + ramp((t - 1300e-9) / 200e-9)
    assert v[0] == pytest.approx(expected, abs=1e-12)
    network.terminator("far", 100)
    v = waves(network, [matched], 3e-6, 10e-9)
    assert v[1] == pytest.approx(ramp((t - 650e-9) / 200e-9), abs=1e-12)


def test_a_delay_between_two_steps_is_interpolated():
    network = line(99.37)
    network.terminator("far", 100)
    sender = "near", driven(lambda t: 2 * ramp(t / 1e-6), constant(0.01))
    delay = 99.37 * 6.5e-9
    errors = []
    for dt in (20e-9, 10e-9):
        t, v = times(3e-6, dt), waves(network, [sender], 3e-6, dt)
        errors.append(np.abs(v[1] - ramp((t - delay) / 1e-6)).max())
    assert errors[0] < 1e-3
    assert errors[1] < errors[0]


@pytest.mark.parametrize(("load", "rising"), [({"c": 2e-9}, True), ({"l": 20e-6}, False)])
def test_a_capacitor_charges_and_an_inductor_discharges_in_its_time_constant(load, rising):
    network = line()
    network.load("far", **load)
    sender = "near", driven(constant(2.0), constant(0.01))
    t, v = times(2e-6, 1e-9), waves(network, [sender], 2e-6, 1e-9)
    tau = 200e-9
    since = t - 650e-9 - 0.5e-9  # a jump between two samples counts from their middle
    later = since > 5e-9
    fading = np.exp(-since[later] / tau)
    expected = 2 * (1 - fading) if rising else 2 * fading
    assert v[1][later] == pytest.approx(expected, abs=2e-4)


@pytest.mark.parametrize(
    ("network", "dt", "message"),
    [
        (line(), 0.7e-6, r"dt is 7e-07 s, but the delay of cable near - far is only 6.5e-07 s"),
        (line([10, 20]), 5e-8, "the network has 2 trees"),
        (line(cable=Cable(0.1, 1e-6, 1e-10, skin=1e4)), 5e-8, "near - far has skin"),
        (line(cable=Cable(5, 1e-6, 1e-10)), 5e-8, "near - far has 500 ohm"),
    ],
)
def test_networks_that_steps_in_time_cannot_compute_are_refused(network, dt, message):
    with pytest.raises(ArgumentError, match=message):
        waves(network, [("near", drawn(np.zeros_like))], 1e-6, dt)
