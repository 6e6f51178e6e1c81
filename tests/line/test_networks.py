import math
from itertools import combinations, pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from shipnet.errors import ArgumentError
from shipnet.line import CABLES, Cable, CableRun, Load, Network, Waveform
from shipnet.line.waveform import laplace_grid, synthesize
from tests.line.building import CABLE, DEVICE, SUPPLY, Net, dense_transfer
from tests.support import tolerance

REFERENCE = np.load(Path(__file__).parents[1] / "reference" / "line" / "asi.npz")
CASES = sorted({name.split("/")[0] for name in REFERENCE.files})


def asi_network(case):
    name, model = case.split("_")[0], case.split("_")[-1]
    cable = CABLES["as-i lossless" if model == "T" else "as-i 1.5"]
    length = int(name[3:]) if name.startswith("len") else 100
    places = [0, 5, 50, 55, 100] if name == "b" else [0, 5, length // 2, length]
    network = Net()
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
    assert np.abs(v - expected).max() <= tolerance("line.ngspice") * np.abs(expected).max()
    dense = dense_transfer(network, str(REFERENCE[f"{case}/sender"]), s)
    assert np.abs(z - dense).max() <= 1e-12 * np.abs(z).max()


def test_a_coarse_grid_shows_samples_of_the_same_curve():
    s = laplace_grid(100e-6, 3e6)
    z = asi_network("a_T").transfer("n5", s) * send_spectrum(s, np.array([0, 0, 1]))
    fine, coarse = (synthesize(z, n, 100e-6) for n in (2000, 50))
    assert coarse == pytest.approx(fine[:, ::40], abs=1e-9)


def small_network(draw):
    network = Net()
    network.load("n0", **SUPPLY)
    for node in range(1, draw(st.integers(2, 9))):
        cable = draw(st.sampled_from([*CABLES.values(), Cable(0.1, 8e-7, 5e-11, 1e-6, 3e4)]))
        length = draw(st.floats(1, 300))
        network.line(f"n{draw(st.integers(0, node - 1))}", f"n{node}", length, cable)
        if draw(st.booleans()):
            network.load(f"n{node}", **DEVICE)
        if draw(st.booleans()):
            network.terminator(f"n{node}", draw(st.floats(1, 1e5)))
    joined = {frozenset((run.a, run.b)) for run in network.runs}
    apart = [pair for pair in combinations(network.nodes, 2) if frozenset(pair) not in joined]
    if apart and draw(st.booleans()):
        network.line(*draw(st.sampled_from(apart)), draw(st.floats(0.01, 300)), cable)
    return network


@settings(max_examples=100)
@given(st.data())
def test_random_trees_and_rings_agree_with_the_dense_route_and_are_reciprocal(data):
    network = data.draw(st.composite(small_network)())
    a, b = (data.draw(st.sampled_from(network.nodes)) for _ in range(2))
    s = laplace_grid(100e-6, 0.5e6)
    z = network.transfer(a, s)
    dense = dense_transfer(network, a, s)
    assert np.abs(z - dense).max() <= tolerance("line.trees") * np.abs(z).max()
    back = network.transfer(b, s)[network.index(a)]
    assert np.abs(z[network.index(b)] - back).max() <= 1e-12 * np.abs(z).max()
    assert (z[network.index(a)].real > 0).all(), "a passive network takes energy in"


def test_an_open_quarter_wave_is_a_short_and_a_half_wave_repeats_its_load():
    network = Net()
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
    network = Net()
    network.line("near", "far", 70, cable)
    gamma, wave = np.sqrt(z * y), np.sqrt(z / y)
    expected = wave / np.tanh(gamma * 70), wave / np.sinh(gamma * 70)
    assert network.transfer("near", s) == pytest.approx(np.array(expected), rel=1e-12)


@pytest.mark.parametrize("length", [1e-6, 1.5, 9e5])
def test_lengths_count_as_equal_only_if_their_difference_is_a_rounding_error(length):
    def ends(relative):
        stubs = {"one": length, "other": length * (1 + relative)}
        runs = [CableRun("root", name, metres, CABLE) for name, metres in stubs.items()]
        net = Network(runs, dict.fromkeys(stubs, Load(r=50)))
        return net.transfer("root", [1j / CABLE.delay / length])[1:, 0]

    one, other = ends(1e-9)
    assert one != other
    one, other = ends(2e-15)
    assert one == pytest.approx(other, rel=1e-12)


def test_extreme_lengths_neither_overflow_nor_lose_digits():
    network = Net()
    s = 1e9 + 1e9j
    network.line("near", "far", 1e6, Cable(1e3, 1e-6, 1e-10))
    z = network.transfer("near", [s])
    assert z[0, 0] == pytest.approx(np.sqrt((1e3 + s * 1e-6) / (s * 1e-10)), rel=1e-12)
    assert z[1, 0] == 0
    network = Net()
    network.line("near", "far", 1e-6, CABLE)
    network.terminator("far", 50)
    assert network.transfer("near", [1.0])[:, 0] == pytest.approx([50 + 0.06e-6, 50], rel=1e-14)


def ring(half=40.0, cable=CABLE):
    network = Net()
    for a, b in (("p", "up"), ("up", "q"), ("p", "down"), ("down", "q")):
        network.line(a, b, half, cable)
    return network


@pytest.mark.parametrize("waves", [1e-12, 0.25, 0.5, 1.0, 3.7])
def test_it_does_not_matter_which_cable_closes_a_ring(waves):
    # One of the cables is `waves` wavelengths long; at half a wave, its matrix element B is 0.
    s = [2j * np.pi * waves / (100 * 6.5e-9)]
    found = []
    for first in range(4):
        network = Net()
        ends = (("p", "up", 100), ("up", "q", 37), ("q", "down", 12), ("down", "p", 51))
        for a, b, length in (*ends[first:], *ends[:first]):
            network.line(a, b, length, Cable.lossless(100, 6.5e-9))
        network.load("p", **SUPPLY)
        network.terminator("q", 1000)
        z = network.transfer("up", s)
        found.append([z[network.index(node)] for node in "p up q down".split()])
    assert np.array(found) == pytest.approx(np.array(found[:1] * 4), rel=1e-11)


TREES = 7
RNG = np.random.default_rng(2024)
L, C, R = (x * RNG.uniform(0.8, 1.2, TREES) for x in (0.65e-6, 65e-12, 0.06))
LENGTH, SKIN = RNG.uniform(1, 90, TREES), RNG.uniform(1e4, 1e5, TREES)


def varied(k, closed, what):
    """Network number k, or all of them for k = slice(None)."""
    cable = Cable(R[k], L[k], C[k], skin=SKIN[k]) if "cable" in what else CABLE
    network = Net()
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
@pytest.mark.parametrize("block", [1 << 17, 1 << 6])
def test_a_monte_carlo_batch_equals_the_loop(monkeypatch, closed, what, block):
    monkeypatch.setattr("shipnet.line.network._BLOCK", block)
    s = laplace_grid(50e-6, 1e6)
    batch = varied(slice(None), closed, what)
    assert batch.trees == TREES
    together = batch.transfer("b", s)
    assert together.shape == (TREES, 5, s.size)
    loop = np.array([varied(k, closed, what).transfer("b", s) for k in range(TREES)])
    assert together == pytest.approx(loop, rel=1e-12)
    first = dense_transfer(varied(0, closed, what), "b", s)
    assert loop[0] == pytest.approx(first, rel=1e-9)
    if "length" in what:
        drop = batch.operating_point("m", 30, {"b": 0.1, "d": LENGTH / 100})
        for k in range(TREES):
            one = varied(k, closed, what).operating_point("m", 30, {"b": 0.1, "d": LENGTH[k] / 100})
            mine = {node: volts[k] for node, volts in drop.items()}
            assert mine == pytest.approx(one, rel=1e-14)


def dense_dc(network, supply, voltage, currents):
    nodes, root = len(network.nodes), network.index(supply)
    matrix, right = np.zeros((nodes, nodes)), np.zeros(nodes)
    for run in network.runs:
        g = 1 / (run.made_of.resistance * run.length)
        i, j = network.index(run.a), network.index(run.b)
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
        point = network.operating_point(supply, 30, drawn)
        assert [*point] == [*network.nodes]
        expected = dense_dc(network, supply, 30, drawn)
        assert [*point.values()] == pytest.approx(expected, rel=tolerance("line.dc"))


@given(st.sampled_from([-30.0, 30.0]), st.floats(0, 60), st.booleans(), st.floats(1, 200))
def test_currents_that_cannot_flow_have_no_operating_point(supply, draw, closed, metres):
    network = Net()
    network.line("supply", "far", metres, CABLE)
    resistance = metres * CABLE.resistance
    if closed:
        network.line("far", "back", metres, CABLE)
        network.line("back", "supply", metres, CABLE)
        resistance *= 2 / 3
    current = math.copysign(draw, supply)
    point = network.operating_point("supply", supply, {"far": [current, 0.0]})
    expected = supply - current * resistance
    if abs(expected) > 1e-9:
        possible = expected * supply >= 0
        assert point["far"] == pytest.approx(
            [expected if possible else math.nan, supply], nan_ok=True
        )
        assert math.isnan(point["supply"][0]) != possible


def test_cables_are_equal_if_their_constants_are():
    assert CABLES["can"] == CABLES["rs-485"] != CABLES["as-i lossless"]
    assert len({Cable(0.06, 0.65e-6, 65e-12, r_dc=0.027), CABLE}) == 1
    assert Cable(0.06, 0.65e-6, 65e-12) != CABLE != 1


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((-0.1, 1e-6, 1e-10), r"r is -0.1 ohm/m; it must be 0\.\."),
        ((0, 0, 1e-10), "l is 0 H/m"),
        ((0, 1e-6, math.nan), "c is nan F/m"),
        ((0, 1e-6, 1e-10, math.inf), "g is inf S/m"),
        ((0, 1e-6, 1e-10, 0, -1), "skin is -1 Hz"),
        ((0, [1e-6, -1], 1e-10), "l is -1 H/m in tree 1"),
        ((0.06, 0.65, 65), r"l is 0.65 H/m; it must be 1e-18\.\.0.001"),
        ((0.06, 0.65e-6, 65), "c is 65 F/m"),
        ((0, [1e-6, 1e-6], [1e-10] * 3), "values for 3 trees, others for 2"),
    ],
)
def test_bad_cables_are_refused(arguments, message):
    with pytest.raises(ArgumentError, match=message):
        Cable(*arguments)


@pytest.mark.parametrize(
    ("lay", "message"),
    [
        (lambda n: n.line("a", "c", 0, CABLE), r"length of cable a - c is 0 m; .* 1e-06\.\.1e\+06"),
        (lambda n: n.line("a", "c", [1, math.nan], CABLE), "cable a - c is nan m in tree 1"),
        (
            lambda n: n.line("a", "c", 5, "as-i"),
            "the type of cable a - c is 'as-i'; it must be a Cable or",
        ),
        (lambda n: n.line("", "c", 5, CABLE), "a node is ''"),
        (lambda n: n.line("a", "a", 5, CABLE), "cable a - a ends where it begins"),
        (lambda n: n.line("b", "a", 5, CABLE), "cable b - a joins two nodes that another"),
        (lambda n: n.load("a"), "a load has neither r nor l nor c"),
        (lambda n: n.load("a", r=0), "r is 0 ohm"),
        (lambda n: n.index("x"), "name is 'x'; the nodes are 'a', 'b'"),
        (lambda n: n.transfer("x", [1.0]), "root is 'x'; the nodes are"),
        (lambda n: n.transfer("a", [1.0, 0]), r"s is 0\+0j rad/s"),
        (lambda n: n.transfer("a", [1j, -1.0]), r"s is -1\+0j rad/s"),
        (lambda n: n.transfer("a", []), r"s has shape \(0,\)"),
        (lambda n: n.transfer("a", ["x"]), "s has shape"),
        (lambda n: n.operating_point("x", 30, {}), "supply is 'x'"),
        (lambda n: n.operating_point("a", 30, {"x": 1}), "one of currents is 'x'"),
        (lambda n: n.operating_point("a", math.nan, {}), "voltage of the supply is nan V"),
        (
            lambda n: n.operating_point("a", 30, {"b": math.inf}),
            "current drawn at node 'b' is inf A",
        ),
        (
            lambda n: n.operating_point("a", [1, 2], {"b": [1, 2, 3]}),
            "^the supply or a current has values for 3 trees, others for 2$",
        ),
    ],
)
def test_bad_arguments_are_refused_with_their_legal_range(lay, message):
    network = Net()
    network.line("a", "b", 5, CABLE)
    with pytest.raises(ArgumentError, match=message):
        lay(network)


def test_bad_shapes_of_networks_are_refused():
    network = ring()
    with pytest.raises(ArgumentError, match=r"up - down would close a second ring, after .* q"):
        network.line("up", "down", 5, CABLE)
    network.load("lost", r=50)
    with pytest.raises(ArgumentError, match="no cable leads from node 'p' to 'lost'"):
        network.transfer("p", [1j])
    with pytest.raises(ArgumentError, match="no cable leads from node 'p' to 'lost'"):
        network.operating_point("p", 30, {})
    with pytest.raises(ArgumentError, match=r"has no resistance; .* needs r greater than 0$"):
        ring(cable=CABLES["can"]).operating_point("p", 30, {"q": 1})
    with pytest.raises(ArgumentError, match="the network has no cable"):
        Net().transfer("a", [1j])
    island = Net()
    island.line("a", "b", 5, CABLE)
    island.line("c", "d", 5, CABLE)
    with pytest.raises(ArgumentError, match="no cable leads from node 'a' to 'c', 'd'"):
        island.transfer("a", [1j])
    island.line("b", "c", [1, 2], CABLE)
    with pytest.raises(ArgumentError, match="cable d - e has values for 3 trees, others for 2"):
        island.line("d", "e", [1, 2, 3], CABLE)
    many = Net()
    many.line("a", "b", [1, 2, 3], CABLE)
    with pytest.raises(ArgumentError, match=r"^the supply .* for 2 trees, others for 3$"):
        many.operating_point("a", [1, 2], {})


def test_loads_at_one_node_add_up():
    both = Load(**DEVICE) + Load(**SUPPLY)
    network = Network([CableRun("a", "b", 5)], {"a": both})
    expected = [1 / 13.5e3 + 1 / 78, 1 / 13.5e-3 + 1 / 100e-6, 50e-12]
    assert network.shunts()[:, 0, 0] == pytest.approx(expected, rel=1e-12)
    assert both == Load(**SUPPLY) + Load(**DEVICE) != Load(**DEVICE)
    with pytest.raises(TypeError):
        both + 100.0


def test_the_nominal_cables_differ_in_resistance_only():
    for name, dc in (("as-i 0.75", 5.2), ("as-i 1.5", 2.7), ("as-i 2.5", 1.6)):
        cable = CABLES[name]
        assert (cable.l, cable.c) == (CABLE.l, CABLE.c)
        assert cable.resistance * 100 == pytest.approx(dc)
        assert cable.r / cable.resistance == pytest.approx(0.06 / 0.027, rel=0.02)


@pytest.mark.parametrize("suffix", [".csv", ".npz"])
def test_a_saved_waveform_is_read_back(tmp_path, suffix):
    u = np.array([[0.0, 1.5, -2.25, 30.0], [1.0, 2.0, 3.0, 4.0]])
    wave = Waveform(u, 50e-9, names=("near", "far"))
    wave.save(tmp_path / f"wave{suffix}")
    for name, row in zip(wave.names, u, strict=True):
        back = Waveform.read(tmp_path / f"wave{suffix}", channel=name)
        assert back.u == pytest.approx(row, rel=1e-8)
        assert back.dt == pytest.approx(50e-9, rel=1e-6)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Waveform(["x"], 1.0), "u has shape"),
        (lambda: Waveform([1.0], 0.0), "dt is 0.0 s"),
        (lambda: Waveform([1.0], 1.0, names=("a", "b")), "there are 2 names; u has 1 rows"),
        (lambda: Waveform(np.zeros((2, 2, 2)), 1.0).save("x.csv"), "one row per node"),
    ],
)
def test_bad_waveforms_are_refused(make, message):
    with pytest.raises(ArgumentError, match=message):
        make()
