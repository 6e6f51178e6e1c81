import math
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from matplotlib.figure import Figure

from shipnet.errors import ArgumentError
from shipnet.line import CABLES, Cable, Network, laplace_grid, solve_dc, synthesize
from shipnet.line.plot import plot_network, plot_waveform

REFERENCE = np.load(Path(__file__).parent / "reference" / "line" / "asi.npz")
CASES = sorted({name.split("/")[0] for name in REFERENCE.files})
DEVICE = {"r": 13.5e3, "l": 13.5e-3, "c": 50e-12}
SUPPLY = {"r": 78.0, "l": 100e-6}
CABLE = CABLES["as-i"]


def asi_network(case):
    name, model = case.split("_")[0], case.split("_")[-1]
    cable = CABLES["as-i lossless" if model == "T" else "as-i"]
    length = int(name[3:]) if name.startswith("len") else 100
    places = [0, 5, 50, 55, 100] if name == "b" else [0, 5, length // 2, length]
    network = Network()
    for near, far in pairwise(places):
        network.line(f"n{near}", f"n{far}", far - near, cable)
    supply = 50 if name == "b" else 0
    network.load(f"n{supply}", **SUPPLY)
    for place in places:
        if name != "b" or place != supply:
            network.load(f"n{place}", **DEVICE)
    return network


def send_spectrum(s, bits, start=5e-6, swing=60e-3, half_bit=3e-6):
    level = np.stack([bits, 1 - bits], axis=-1).ravel()  # a 0 is sent as no current, then current
    steps = np.diff(level, prepend=0)
    x = s * half_bit / 2
    pulse = -np.expm1(-2 * x) / (2 * x) / (1 + (x / np.pi) ** 2)
    at = start + half_bit * np.arange(len(steps))
    return swing * pulse / s * (steps @ np.exp(-np.outer(at, s)))


@pytest.mark.parametrize("case", CASES)
def test_waveforms_agree_with_ngspice(case):
    expected = REFERENCE[f"{case}/v"]
    duration, dt = 204.8e-6, 50e-9
    s = laplace_grid(duration, 10e6)
    network = asi_network(case)
    z = network.transfer(str(REFERENCE[f"{case}/sender"]), s)
    rows = [network.index(probe) for probe in REFERENCE[f"{case}/probes"].tolist()]
    spectrum = -z[rows] * send_spectrum(s, REFERENCE[f"{case}/bits"])
    v = synthesize(spectrum, round(duration / dt), duration)[:, ::5][:, : expected.shape[1]]
    assert np.abs(v - expected).max() <= 5e-5 * np.abs(expected).max()
    dense = network.dense_transfer(str(REFERENCE[f"{case}/sender"]), s)
    assert np.abs(z - dense).max() <= 1e-12 * np.abs(z).max()


def test_a_coarse_grid_shows_samples_of_the_same_curve():
    s = laplace_grid(100e-6, 3e6)
    z = asi_network("a_T").transfer("n5", s) * send_spectrum(s, np.array([0, 0, 1]))
    fine, coarse = (synthesize(z, n, 100e-6) for n in (2000, 50))
    assert coarse == pytest.approx(fine[:, ::40], abs=1e-9)


def small_tree(draw):
    network = Network()
    network.load("n0", **SUPPLY)
    for node in range(1, draw(st.integers(2, 9))):
        cable = draw(st.sampled_from([*CABLES.values(), Cable(0.1, 8e-7, 5e-11, 1e-6, 3e4)]))
        length = draw(st.floats(1, 300))
        network.line(f"n{draw(st.integers(0, node - 1))}", f"n{node}", length, cable)
        if draw(st.booleans()):
            network.load(f"n{node}", **DEVICE)
        if draw(st.booleans()):
            network.terminator(f"n{node}", draw(st.floats(1, 1e5)))
    return network


@settings(max_examples=100)
@given(st.data())
def test_random_trees_agree_with_the_dense_route_and_are_reciprocal(data):
    network = data.draw(st.composite(small_tree)())
    a, b = (data.draw(st.sampled_from(network.nodes)) for _ in range(2))
    s = laplace_grid(100e-6, 0.5e6)
    z = network.transfer(a, s)
    assert np.abs(z - network.dense_transfer(a, s)).max() <= 1e-10 * np.abs(z).max()
    back = network.transfer(b, s)[network.index(a)]
    assert np.abs(z[network.index(b)] - back).max() <= 1e-12 * np.abs(z).max()
    assert (z[network.index(a)].real > 0).all(), "a passive network takes energy in"


def test_a_matched_line_only_delays():
    network = Network()
    network.line("near", "far", 40, Cable.lossless(120, 5e-9))
    network.terminator("far", 120)
    s = laplace_grid(20e-6, 5e6)
    near, far = network.transfer("near", s)
    assert near == pytest.approx(np.full(s.size, 120), rel=1e-13)
    assert far == pytest.approx(120 * np.exp(-s * 200e-9), rel=1e-12)


def test_an_open_quarter_wave_is_a_short_and_a_half_wave_repeats_its_load():
    network = Network()
    network.line("near", "far", 100, Cable.lossless(100, 6.5e-9))
    quarter = 1 / (4 * 100 * 6.5e-9)
    assert round(quarter / 1e3) == 385
    s = 2j * np.pi * np.array([quarter, quarter / 2])
    near = network.transfer("near", s)[0]
    assert abs(near[0]) < 1e-10
    assert near[1] == pytest.approx(-100j, rel=1e-12)
    network.terminator("far", 33)
    z = network.transfer("near", 2 * s[:1])
    assert abs(z) == pytest.approx(np.full((2, 1), 33.0), rel=1e-12)


def test_a_lossy_line_follows_the_telegraph_equations():
    cable = Cable(0.06, 0.65e-6, 65e-12, g=5e-6, skin=30e3)
    s = 2j * np.pi * np.array([1e3, 1e5, 1e7])
    z, y = 0.06 * np.sqrt(1 + s / (2 * np.pi * 30e3)) + s * 0.65e-6, 5e-6 + s * 65e-12
    assert cable.series_impedance(s) == pytest.approx(z)
    assert cable.shunt_admittance(s) == pytest.approx(y)
    network = Network()
    network.line("near", "far", 70, cable)
    gamma, wave = np.sqrt(z * y), np.sqrt(z / y)
    expected = wave / np.tanh(gamma * 70), wave / np.sinh(gamma * 70)
    assert network.transfer("near", s) == pytest.approx(np.array(expected), rel=1e-12)


def test_propagation_is_what_a_matched_line_does():
    cable = Cable(r=0.03, l=0.65e-6, c=65e-12, g=1e-6, skin=30e3)
    s = 2j * np.pi * np.array([50e3, 167e3, 480e3])
    net = Network()
    net.line("near", "far", 40, cable)
    # An endless rest of the same cable, long enough that nothing comes back.
    net.line("far", "end", 1e5, cable)
    z = net.transfer("near", s)
    assert z[1] / z[0] == pytest.approx(np.exp(-40 * cable.propagation(s)), rel=1e-9)


def test_extreme_lengths_neither_overflow_nor_lose_digits():
    network = Network()
    s = 1e9 + 1e9j
    network.line("near", "far", 1e6, Cable(1e3, 1e-6, 1e-10))
    z = network.transfer("near", [s])
    assert z[0, 0] == pytest.approx(np.sqrt((1e3 + s * 1e-6) / (s * 1e-10)), rel=1e-12)
    assert z[1, 0] == 0
    network = Network()
    network.line("near", "far", 1e-6, CABLE)
    network.terminator("far", 50)
    assert network.transfer("near", [1.0])[:, 0] == pytest.approx([50 + 0.06e-6, 50], rel=1e-14)


def ring(half=40.0, cable=CABLE):
    network = Network()
    for a, b in (("p", "up"), ("up", "q"), ("p", "down"), ("down", "q")):
        network.line(a, b, half, cable)
    return network


def test_a_ring_of_two_equal_halves_is_one_line_of_half_the_impedance():
    s = laplace_grid(100e-6, 1e6)
    closed = ring()
    assert closed.ring == closed.branches[3]
    single = Network()
    single.line("p", "mid", 40, Cable(0.03, 0.325e-6, 130e-12))
    single.line("mid", "q", 40, single.branches[0].cable)
    for network in (closed, single):
        network.load("p", **SUPPLY)
        network.load("q", **DEVICE)
    expected = single.transfer("p", s)
    z = closed.transfer("p", s)
    assert np.abs(z[[0, 1, 3, 2]] - expected[[0, 1, 1, 2]]).max() < 1e-12 * np.abs(z).max()
    assert z[2] == pytest.approx(closed.transfer("q", s)[0], rel=1e-12)


TREES = 7
RNG = np.random.default_rng(2024)
L, C, R = (x * RNG.uniform(0.8, 1.2, TREES) for x in (0.65e-6, 65e-12, 0.06))
LENGTH, SKIN = RNG.uniform(1, 90, TREES), RNG.uniform(1e4, 1e5, TREES)


def varied(k, closed, what):
    """Network number k, or all of them for k = slice(None)."""
    cable = Cable(R[k], L[k], C[k], skin=SKIN[k]) if "cable" in what else CABLE
    network = Network()
    network.line("m", "a", 20, cable)
    network.line("a", "b", LENGTH[k] if "length" in what else 10, cable)
    network.line("a", "c", 10, CABLE)
    network.line("c", "d", 12, cable)
    if closed:
        network.line("d", "b", LENGTH[k] / 3 if "length" in what else 5, CABLE)
    network.load("m", r=78, l=100e-6 * (LENGTH[k] if "load" in what else 1))
    network.load("b", **DEVICE)
    return network


@pytest.mark.parametrize("closed", [False, True])
@pytest.mark.parametrize("what", ["cable", "length", "load", "cable length load"])
@pytest.mark.parametrize("block", [1 << 17, 1 << 9])
def test_a_monte_carlo_batch_equals_the_loop(monkeypatch, closed, what, block):
    monkeypatch.setattr("shipnet.line.tree._BLOCK_TREES", block)
    s = laplace_grid(50e-6, 1e6)
    batch = varied(slice(None), closed, what)
    assert batch.trees == TREES
    together = batch.transfer("b", s)
    assert together.shape == (TREES, 5, s.size)
    loop = np.array([varied(k, closed, what).transfer("b", s) for k in range(TREES)])
    assert together == pytest.approx(loop, rel=1e-12)
    assert batch.dense_transfer("b", s) == pytest.approx(loop, rel=1e-9)
    if "length" in what:
        drop = solve_dc(batch, "m", 30, {"b": 0.1, "d": LENGTH / 100})
        for k in range(TREES):
            one = solve_dc(varied(k, closed, what), "m", 30, {"b": 0.1, "d": LENGTH[k] / 100})
            assert drop.voltage[k] == pytest.approx(one.voltage, rel=1e-14)
            assert drop.current[k] == pytest.approx(one.current, rel=1e-12)


def dense_dc(network, supply, voltage, currents):
    nodes, root = len(network.nodes), network.index(supply)
    matrix, right = np.zeros((nodes, nodes)), np.zeros(nodes)
    for a, b, length, cable in network.branches:
        i, j, g = network.index(a), network.index(b), 1 / (cable.r * length)
        matrix[[i, j], [i, j]] += g
        matrix[[i, j], [j, i]] -= g
    for node, current in currents.items():
        right[network.index(node)] = -current
    matrix[root], right[root] = np.eye(nodes)[root], voltage
    return np.linalg.solve(matrix, right)


@pytest.mark.parametrize("closed", [False, True])
def test_dc_agrees_with_the_nodal_equations(closed):
    network = varied(3, closed, "cable length")
    drawn = {"b": 0.2, "c": 0.5, "d": -0.1}
    for supply in network.nodes:
        point = solve_dc(network, supply, 30, drawn)
        assert point.voltage == pytest.approx(dense_dc(network, supply, 30, drawn), rel=1e-12)
        for (a, b, length, cable), current in zip(network.branches, point.current, strict=True):
            drop = point.voltage[network.index(a)] - point.voltage[network.index(b)]
            assert drop == pytest.approx(cable.r * length * current, abs=1e-12)


def test_a_ring_drops_a_quarter_of_what_a_line_does():
    n, length, current = 8, 100.0, 2.0
    line, closed = Network(), Network()
    for k in range(n):
        for network in (line, closed):
            network.line(f"n{k}", f"n{k + 1}", length / n, CABLE)
    closed.line(f"n{n}", "back", 1e-6, CABLE)
    closed.line("back", "n0", 1e-6, CABLE)
    total = CABLE.r * length
    end = solve_dc(line, "n0", 30, {f"n{n}": current}, resistance=0.5)
    assert end.voltage[-1] == pytest.approx(30 - current * (total + 0.5))
    middle = solve_dc(closed, "n0", 30, {f"n{n // 2}": current}, resistance=0.5)
    assert middle.voltage[n // 2] == pytest.approx(30 - current * (total / 4 + 0.5))
    assert solve_dc(closed, "n0", 30, {}).voltage == pytest.approx(np.full(n + 2, 30.0))


def test_a_subdivided_network_is_the_same_network():
    network = asi_network("b_LTRA")
    fine = network.subdivided(7)
    assert fine.nodes[:5] == network.nodes
    assert len(fine.branches) == 1 + 7 + 1 + 7
    s = laplace_grid(100e-6, 1e6)
    assert fine.transfer("n5", s)[:5] == pytest.approx(network.transfer("n5", s), rel=1e-9)
    batch = varied(slice(None), True, "length")
    sections = [math.ceil(np.max(length) / 10) for _, _, length, _ in batch.branches]
    assert len(batch.subdivided(10).branches) == sum(sections)
    assert ring().subdivided(20).ring is not None


def test_cables_are_equal_if_their_constants_are():
    assert CABLES["can"] == CABLES["rs-485"] != CABLES["as-i"]
    assert len({Cable(0.06, 0.65e-6, 65e-12), CABLE}) == 1
    assert Cable(0, [1e-6, 2e-6], 1e-10) == Cable(0, [1e-6, 2e-6], 1e-10)
    assert Cable(0, [1e-6, 2e-6], 1e-10) != Cable(0, [1e-6, 1e-6], 1e-10)
    assert CABLE != 1


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((-0.1, 1e-6, 1e-10), r"r of a cable is -0.1 ohm/m; it must be 0\.\."),
        ((0, 0, 1e-10), "l of a cable is 0 H/m"),
        ((0, 1e-6, math.nan), "c of a cable is nan F/m"),
        ((0, 1e-6, 1e-10, math.inf), "g of a cable is inf S/m"),
        ((0, 1e-6, 1e-10, 0, -1), "skin of a cable is -1 Hz"),
        ((0, [1e-6, -1], 1e-10), "l of a cable is -1 H/m in tree 1"),
        ((0, [1e-6, 1e-6], [1e-10] * 3), "values for 3 trees, others for 2"),
        (("0.1", 1e-6, 1e-10), "r of a cable is '0.1'; it must be a number"),
        ((True, 1e-6, 1e-10), "r of a cable is True"),
        ((10**400, 1e-6, 1e-10), "r of a cable is 1000"),
        (([], 1e-6, 1e-10), "r of a cable is"),
    ],
)
def test_bad_cables_are_refused(arguments, message):
    with pytest.raises(ArgumentError, match=message):
        Cable(*arguments)


@pytest.mark.parametrize(
    ("lay", "message"),
    [
        (lambda n: n.line("a", "c", -1, CABLE), "length of line 'a'-'c' is -1 m"),
        (
            lambda n: n.line("a", "c", 0, CABLE),
            r"length of line 'a'-'c' is 0 m; .* 1e-06\.\.1e\+06",
        ),
        (lambda n: n.line("a", "c", math.nan, CABLE), "length of line 'a'-'c' is nan m"),
        (lambda n: n.line("a", "c", math.inf, CABLE), "length of line 'a'-'c' is inf m"),
        (lambda n: n.line("a", "c", [1, math.nan], CABLE), "'a'-'c' is nan m in tree 1"),
        (lambda n: n.line("a", "c", None, CABLE), "length of line 'a'-'c' is None"),
        (lambda n: n.line("a", "c", 5, "as-i"), "cable of line 'a'-'c' is 'as-i'"),
        (lambda n: n.line("a", 3, 5, CABLE), "node name is 3; it must be a string"),
        (lambda n: n.line("", "c", 5, CABLE), "node name is ''"),
        (lambda n: n.line("a", "a", 5, CABLE), "line 'a'-'a' ends where it begins"),
        (lambda n: n.line("b", "a", 5, CABLE), "line 'b'-'a' lies there already"),
        (lambda n: n.load(None, r=5), "node name is None"),
        (lambda n: n.load("a"), "load at node 'a' has neither r nor l nor c"),
        (lambda n: n.load("a", r=0), "r of the load at node 'a' is 0 ohm"),
        (lambda n: n.load("a", l=-1e-3), "l of the load at node 'a' is -0.001 H"),
        (lambda n: n.load("a", c=math.nan), "c of the load at node 'a' is nan F"),
        (lambda n: n.terminator("a", -120), "r of the load at node 'a' is -120 ohm"),
        (lambda n: n.index("x"), "node 'x' is unknown; the nodes are 'a', 'b'"),
        (lambda n: n.index(["a"]), "node \\['a'\\] is unknown"),
        (lambda n: n.transfer("x", [1.0]), "node 'x' is unknown"),
        (lambda n: n.transfer("a", [1.0, 0]), r"s is 0\+0j rad/s"),
        (lambda n: n.transfer("a", [1j, -1.0]), r"s is -1\+0j rad/s"),
        (lambda n: n.transfer("a", [complex(math.nan, 1)]), r"s is nan\+1j rad/s"),
        (lambda n: n.transfer("a", []), r"s has shape \(0,\)"),
        (lambda n: n.transfer("a", 1j), r"s has shape \(\)"),
        (lambda n: n.transfer("a", ["x"]), "s has shape"),
        (lambda n: n.subdivided(0), "longest is 0 m"),
        (lambda n: solve_dc(n, "x", 30, {}), "node 'x' is unknown"),
        (lambda n: solve_dc(n, "a", 30, {"x": 1}), "node 'x' is unknown"),
        (lambda n: solve_dc(n, "a", math.nan, {}), "voltage of the supply is nan V"),
        (lambda n: solve_dc(n, "a", 30, {"b": math.inf}), "current drawn at node 'b' is inf A"),
        (lambda n: solve_dc(n, "a", 30, {}, resistance=-1), "resistance of the supply is -1 ohm"),
        (lambda n: solve_dc(n, "a", [1, 2], {"b": [1, 2, 3]}), "values for 3 trees, others for 2"),
    ],
)
def test_bad_arguments_are_refused_and_leave_the_network_as_it_was(lay, message):
    network = Network()
    network.line("a", "b", 5, CABLE)
    with pytest.raises(ArgumentError, match=message):
        lay(network)
    assert network.nodes == ("a", "b")
    assert len(network.branches) == 1
    assert not network.shunts().any()
    assert network.trees is None


def test_bad_shapes_of_networks_are_refused():
    network = ring()
    with pytest.raises(ArgumentError, match=r"'up'-'down' would close a second ring, after .*'q'"):
        network.line("up", "down", 5, CABLE)
    network.load("lost", r=50)
    for solve in (network.transfer, network.dense_transfer):
        with pytest.raises(ArgumentError, match="no line leads from node 'p' to 'lost'"):
            solve("p", [1j])
    with pytest.raises(ArgumentError, match="no line leads from node 'p' to 'lost'"):
        solve_dc(network, "p", 30, {})
    with pytest.raises(ArgumentError, match="no resistance"):
        solve_dc(ring(cable=CABLES["can"]), "p", 30, {"q": 1})
    with pytest.raises(ArgumentError, match="the network has no line"):
        Network().transfer("a", [1j])
    island = Network()
    island.line("a", "b", 5, CABLE)
    island.line("c", "d", 5, CABLE)
    with pytest.raises(ArgumentError, match="no line leads from node 'a' to 'c', 'd'"):
        island.transfer("a", [1j])
    island.line("b", "c", [1, 2], CABLE)
    with pytest.raises(ArgumentError, match="'d'-'e' has values for 3 trees, others for 2"):
        island.line("d", "e", [1, 2, 3], CABLE)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: laplace_grid(0, 1e6), "duration is 0 s"),
        (lambda: laplace_grid(1e-3, math.nan), "f_max is nan Hz"),
        (lambda: laplace_grid(1e-3, 1e6, 0), "damping is 0 nepers"),
        (lambda: laplace_grid([1e-3, 1e-3], 1e6), "must be a single number"),
        (lambda: synthesize([1, 2], 0, 1e-3), "n_samples is 0"),
        (lambda: synthesize([], 4, 1e-3), "at least one frequency"),
        (lambda: synthesize([1, 2], 4, -1e-3), "duration is -0.001 s"),
    ],
)
def test_bad_windows_are_refused(call, message):
    with pytest.raises(ArgumentError, match=message):
        call()


def test_a_network_is_drawn_to_scale():
    network = ring()
    network.line("q", "stub", 10, CABLE)
    network.load("stub", **DEVICE)
    ax = Figure().subplots()
    assert plot_network(network, ax=ax) is ax
    assert {text.get_text() for text in ax.texts} == set(network.nodes)
    assert max(max(line.get_xdata()) for line in ax.lines) == 90
    assert [line.get_linestyle() for line in ax.lines].count("--") == 1
    assert ax.get_xlabel() == "distance along the cable [m]"


def test_a_waveform_is_drawn_in_microseconds():
    ax = Figure().subplots()
    assert plot_waveform([0, 1e-6], [0, 2.5], ax=ax, label="far") is ax
    (line,) = ax.lines
    assert (line.get_xdata().tolist(), line.get_label()) == ([0, 1], "far")
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("time [us]", "voltage [V]")
