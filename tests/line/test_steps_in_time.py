import math
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from shipnet.errors import ArgumentError
from shipnet.line import CABLES, Cable, Driver, simulate
from shipnet.line.waveform import laplace_grid, synthesize
from tests.line.building import DEVICE, Net
from tests.support import tolerance

FOLDER = Path(__file__).parents[1] / "reference" / "line"
ASI, BUS = (np.load(FOLDER / name) for name in ("asi.npz", "can_rs485.npz"))
LOSSLESS = CABLES["as-i lossless"]


def waves(network, drivers, until, dt, **options):
    """Return the voltages of each case; drivers that are not in lists are one case."""
    u = simulate(network.network, drivers, until, dt, **options).u
    return u if isinstance(drivers[0], list) else u[:, np.newaxis]


def timed(network, drivers, until, dt, **options):
    t = simulate(network.network, drivers, until, dt, **options).t
    return t, waves(network, drivers, until, dt, **options)


def fine(network, longest):
    cut = Net()
    cut.network = network.subdivided(longest)
    cut.runs, cut.loads = [*cut.network.runs], cut.network.loads
    return cut


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
        network = fine(network, 5)
    cases = [
        case
        for case in sorted({key.split("/")[0] for key in ASI.files})
        if case.startswith(f"{name}_") and case.endswith(f"_{model}")
    ]
    drivers = [
        [Driver(str(ASI[f"{case}/sender"]), send_current(ASI[f"{case}/bits"]))] for case in cases
    ]
    probes = ASI[f"{cases[0]}/probes"].tolist()
    v = waves(network, drivers, 110e-6, 2.5e-9, probes=probes)
    for column, case in enumerate(cases):
        expected = ASI[f"{case}/v"]
        error = v[:, column, ::100][:, : expected.shape[1]] - expected
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
    can = Driver("b0", conductance=lambda t: pattern(t) / 40, voltage=3.2)
    rs485 = Driver("b0", conductance=1 / 27, voltage=lambda t: 5 * pattern(t))
    probes = BUS[f"can_40m_1M_{case}/probes"].tolist()
    v = waves(network, [[can], [rs485]], 10e-6, 0.25e-9, probes=probes)
    for column, name in enumerate(("can", "rs485")):
        expected = BUS[f"{name}_40m_1M_{case}/v"]
        error = np.abs(v[:, column, ::80] - expected).max()
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
    assert np.abs(wave - v[:, 1, ::80]).max() <= 3e-4 * np.abs(expected).max()


@pytest.mark.parametrize("closed", [False, True])
def test_steps_agree_with_frequencies_on_a_network_with_everything(closed):
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
    cut = fine(network, 5)
    rows = [cut.index(node) for node in network.nodes]
    v = waves(cut, [Driver("c", send_current(bits))], 40e-6, 2.5e-9)
    s = laplace_grid(duration, 20e6)
    x = s * 1.5e-6
    edge = -np.expm1(-2 * x) / (2 * x) / (1 + (x / np.pi) ** 2)
    steps = np.diff(np.stack([bits, 1 - bits], axis=-1).ravel(), prepend=0)
    current = 0.06 * edge / s * (steps @ np.exp(-np.outer(5e-6 + 3e-6 * np.arange(6), s)))
    wave = synthesize(-network.transfer("c", s) * current, 600, duration)[:, :401]
    assert np.abs(v[rows, 0, ::40] - wave).max() <= 2e-5 * np.abs(wave).max()


def line(length=100, cable=LOSSLESS):
    network = Net()
    network.line("near", "far", length, cable)
    return network


def test_a_matched_line_only_delays_and_an_open_one_doubles():
    network = line()
    matched = Driver("near", conductance=0.01, voltage=lambda t: 2 * ramp(t / 200e-9))
    v = waves(network, [matched], 3e-6, 10e-9)
    t = 10e-9 * np.arange(301)
    assert v[1, 0] == pytest.approx(2 * ramp((t - 650e-9) / 200e-9), abs=1e-12)
    expected = ramp(t / 200e-9) + ramp((t - 1300e-9) / 200e-9)
    assert v[0, 0] == pytest.approx(expected, abs=1e-12)
    network.terminator("far", 100)
    v = waves(network, [matched], 3e-6, 10e-9)
    assert v[1, 0] == pytest.approx(ramp((t - 650e-9) / 200e-9), abs=1e-12)


def test_a_delay_between_two_steps_is_interpolated():
    network = line(99.37)
    network.terminator("far", 100)
    driver = Driver("near", conductance=0.01, voltage=lambda t: 2 * ramp(t / 1e-6))
    delay = 99.37 * 6.5e-9
    errors = []
    for dt in (20e-9, 10e-9):
        t, v = timed(network, [driver], 3e-6, dt)
        errors.append(np.abs(v[1, 0] - ramp((t - delay) / 1e-6)).max())
    assert errors[0] < 1e-3
    assert errors[1] < errors[0]


@pytest.mark.parametrize(("load", "rising"), [({"c": 2e-9}, True), ({"l": 20e-6}, False)])
def test_a_capacitor_fills_and_an_inductor_lets_go_with_its_time_constant(load, rising):
    network = line()
    network.load("far", **load)
    t, v = timed(network, [Driver("near", conductance=0.01, voltage=2.0)], 2e-6, 1e-9)
    tau = 200e-9
    since = t - 650e-9 - 0.5e-9  # a jump between two samples counts from their middle
    later = since > 5e-9
    fading = np.exp(-since[later] / tau)
    expected = 2 * (1 - fading) if rising else 2 * fading
    assert v[1, 0][later] == pytest.approx(expected, abs=2e-4)


def test_a_network_never_gives_more_energy_than_it_took():
    network = asi_network(50, CABLES["as-i 1.5"])
    current = send_current(np.array([0, 1, 1, 0, 1]))
    t, v = timed(network, [Driver("n5", current)], 60e-6, 5e-9, probes=["n5"])
    taken = np.cumsum(-v[0, 0] * current(t)) * 5e-9
    assert taken.min() > -1e-12
    assert taken[-1] > 0.3 * taken.max()


def test_columns_do_not_see_each_other_and_drivers_of_one_column_do():
    network = asi_network(0, LOSSLESS)
    a = Driver("n5", send_current(np.array([0, 1])))
    b = Driver("n100", lambda t: 0.01 * ramp(t / 5e-6))
    v = waves(network, [[a], [b], [a, b], [a, a], []], 30e-6, 10e-9)
    assert v.shape == (4, 5, 3001)
    assert v[:, 2] == pytest.approx(v[:, 0] + v[:, 1], abs=1e-12)
    assert v[:, 3] == pytest.approx(2 * v[:, 0], abs=1e-12)
    assert not v[:, 4].any()
    t = 10e-9 * np.arange(3001)
    same = waves(network, [Driver("n5", a.current(t))], 30e-6, 10e-9)
    assert (same[:, 0] == v[:, 0]).all()


def test_two_can_nodes_at_once_pull_harder_than_one():
    network = bus("", terminated=True)
    one, other = (Driver(node, conductance=1 / 40, voltage=3.2) for node in ("b0", "b8"))
    v = waves(network, [[one], [one, other]], 8e-6, 5e-9, probes=["b4"])
    assert v[0, 0, -1] == pytest.approx(3.2 / 40 / (1 / 40 + 2 / 120 + 9 / 20e3), rel=1e-3)
    assert v[0, 1, -1] == pytest.approx(6.4 / 40 / (2 / 40 + 2 / 120 + 9 / 20e3), rel=1e-3)


def test_a_wave_can_be_watched_on_its_way():
    cut = fine(line(), 10)
    cut.terminator("far", 100)
    probes = ["near", *(f"near-far:{k}" for k in range(1, 10)), "far"]
    pulse = Driver(
        "near", conductance=0.01, voltage=lambda t: 2 * np.sin(np.pi * np.clip(t / 2e-7, 0, 1))
    )
    t, v = timed(cut, [pulse], 1e-6, 5e-9, probes=probes)
    peaks = t[v[:, 0].argmax(axis=-1)]
    assert peaks == pytest.approx(1e-7 + 65e-9 * np.arange(11), abs=1e-12)


def quiet(**changed):
    arguments = {
        "network": line(),
        "drivers": [Driver("near", 0.0)],
        "until": 1e-6,
        "dt": 50e-9,
        **changed,
    }
    arguments["network"] = arguments["network"].network
    return lambda: simulate(**arguments)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (quiet(dt=0.7e-6), r"dt is 7e-07 s, but cable near - far delays by 6.5e-07 s only"),
        (quiet(dt=0), "dt is 0 s"),
        (quiet(dt=-1e-9), "dt is -1e-09 s"),
        (quiet(dt=math.nan), "dt is nan s"),
        (quiet(dt=[1e-9, 1e-9]), "dt is .* must be a single number"),
        (quiet(until=1e-9), "until is 1e-09 s; it must be at least dt"),
        (quiet(until=math.inf), "until is inf s"),
        (quiet(network=Net()), "the network has no line"),
        (quiet(network=line([10, 20])), "the network holds 2 trees"),
        (quiet(network=line(cable=Cable(0.1, 1e-6, 1e-10, skin=1e4))), "near - far has skin"),
        (quiet(network=line(cable=Cable(5, 1e-6, 1e-10))), "near - far has 500 ohm"),
        (quiet(drivers=[]), "drivers are empty"),
        (quiet(drivers=[[]]), "drivers are empty"),
        (lambda: Driver("far"), "driver at node 'far' must have a current, or a voltage and"),
        (lambda: Driver("far", voltage=1.0), "must have a current"),
        (quiet(drivers=[[3]]), "one of drivers is 3"),
        (quiet(drivers=[3]), "one of drivers is 3"),
        (quiet(drivers=[Driver("x", 0.0)]), "node of a driver is 'x'"),
        (quiet(drivers=[Driver("far", math.nan)]), "current of the driver at node 'far'"),
        (quiet(drivers=[Driver("far", [1.0, 2.0])]), r"'far' has shape \(2,\)"),
        (quiet(drivers=[Driver("far", [1.0])]), "'far' has shape"),
        (quiet(drivers=[Driver("far", None, 0, -1)]), "conductance .* 'far' is -1 S"),
        (quiet(drivers=[Driver("far", None, math.inf, 1)]), "voltage .* 'far' is inf V"),
        (quiet(probes=["x"]), "one of probes is 'x'"),
    ],
)
def test_bad_arguments_are_refused(call, message):
    with pytest.raises(ArgumentError, match=message):
        call()


def test_an_unconnected_node_is_named():
    network = line()
    network.load("lost", r=50)
    with pytest.raises(ArgumentError, match="no line leads from node 'near' to 'lost'"):
        simulate(network.network, Driver("near", 0.0), 1e-6, 50e-9)
