import numpy as np
import pytest

from shipnet.errors import ArgumentError
from shipnet.line import Cable
from shipnet.modbus import electrical
from shipnet.modbus.electrical import INTERFACES, Rs485, interfaces


def fits(*args, **kwargs):
    table = interfaces(*args, **kwargs)
    assert (table.fits == (table.why_not == "")).all()
    return set(table.interface[table.fits])


def longest(name, rate):
    return interfaces(2, 10, rate).set_index("interface").longest_m[name]


def test_lengths_and_rates_equal_the_published_ones():
    # Brainboxes: 40 ft at 10 Mbit/s, 4000 ft at 100 kbit/s; NI: 50 ft and 20 kbit/s for RS-232.
    for name in ("RS-422", "RS-485"):
        assert longest(name, 10e6) == pytest.approx(40 * 0.3048, rel=0.001)
        assert longest(name, 100e3) == pytest.approx(4000 * 0.3048, rel=0.001)
    assert longest("RS-232", 20e3) == pytest.approx(50 * 0.3048, abs=0.3)
    assert longest("RS-232", 20_001) == 0


@pytest.mark.parametrize("name", INTERFACES)
def test_a_line_is_never_longer_at_a_higher_rate(name):
    lengths = [longest(name, rate) for rate in np.geomspace(300, 10e6, 200)]
    assert (np.diff(lengths) <= 0).all()


def test_an_interface_stops_fitting_at_each_limit():
    assert fits(2, 15, 20e3) == {"RS-232", "RS-422", "RS-485"}
    assert fits(2, 15.1, 20e3) == fits(2, 15, 20_001) == {"RS-422", "RS-485"}
    assert fits(3, 15, 20e3) == {"RS-485"}
    assert fits(32, 1219, 9600) == {"RS-485"}
    assert fits(33, 1219, 9600) == fits(2, 1219.1, 9600) == set()


def test_reasons_are_given_and_lines_out_of_range_refused():
    why = interfaces(40, 5000, 5e6).set_index("interface").why_not
    assert why["RS-232"] == "40 stations are more than 2; 5e+06 bit/s is more than 20000 bit/s"
    assert why["RS-485"] == "40 stations are more than 32; 5000 m is more than 24.38 m"
    for arguments, message in (
        ((1, 10, 9600), "n_stations is 1"),
        ((2, -1, 9600), "length is -1 m"),
        ((2, 1, 10), "bit_rate is 10 bit/s"),
    ):
        with pytest.raises(ArgumentError, match=message):
            interfaces(*arguments)


def two_wire(length, unit_loads, terminator, bias):
    """Return the least idle voltage, and the load of a driver, of both wires with their ground.

    Each wire is a chain of resistors; node k of wire A is k, and of wire B n + k.
    """
    n = max(2, min(32, int(np.ceil(unit_loads))))
    g, injected = np.zeros((2 * n, 2 * n)), np.zeros(2 * n)

    def join(a, b, r):
        g[a, a] += 1 / r
        if b is not None:
            g[b, b] += 1 / r
            g[a, b] -= 1 / r
            g[b, a] -= 1 / r

    for k in range(n):
        for wire in (0, n):
            join(wire + k, None, 12e3 * n / unit_loads)
            if k:
                join(wire + k - 1, wire + k, 0.1339 * length / (n - 1))
    if terminator:
        join(0, n, terminator)
        join(n - 1, 2 * n - 1, terminator)
    if bias:
        join(0, None, bias)
        join(n, None, bias)
        injected[0] = 4.75 / bias
    v = np.linalg.solve(g, injected)
    driven = np.zeros(2 * n)
    driven[0], driven[n] = 1.0, -1.0
    load = np.linalg.solve(g, driven)
    return min(v[1:n] - v[n + 1 :]), load[0] - load[n]


@pytest.mark.parametrize("length", [0.1, 300, 1000])
@pytest.mark.parametrize("unit_loads", [0.125, 24, 32, 33])
@pytest.mark.parametrize("terminator", [120.0, None])
@pytest.mark.parametrize("bias", [560.0, None])
def test_direct_voltages_are_those_of_two_wires_and_ground(length, unit_loads, terminator, bias):
    line = Rs485(length, 9600, unit_loads=unit_loads, terminator=terminator, bias=bias)
    value = line.check().table().set_index("rule")["value"]
    idle, load = two_wire(length, unit_loads, terminator, bias)
    assert value["driver_load"] == pytest.approx(load, rel=1e-6)
    if bias is None:
        assert np.isnan(value["idle_voltage"])
        return
    assert value["idle_voltage"] == pytest.approx(idle, rel=1e-6)
    if length == 0.1:
        # The closed form has no cable; 0.1 m have 0.03 ohm.
        assert value["idle_voltage_of_short_line"] == pytest.approx(idle, rel=1e-3)


def test_the_bias_of_a_short_full_line_is_that_of_texas_instruments():
    # SLLA272: 528 ohm give 250 mV from 4.75 V if 375 ohm to ground include the bias resistors.
    line = Rs485(1, 9600, unit_loads=32 - 12e3 / 528, bias=528)
    value = line.check().table().set_index("rule")["value"]
    assert value["idle_voltage_of_short_line"] == pytest.approx(0.25, rel=1e-3)


@pytest.mark.parametrize(("length", "rate"), [(12, 10e6), (8, 10e6), (45, 1e6), (60, 2e6)])
def test_the_eye_of_an_open_line_is_that_of_a_lattice_diagram(length, rate, monkeypatch):
    # A source of 27 ohm; each wave is doubled at the open end and returns from the source.
    back, delay = (27 - 120) / (27 + 120), 5e-9 * length
    times = (np.arange(12) + 0.5) / rate
    first = 1.5 * 81 / 54 * 120 / 147 * 2
    samples = [first * sum(back**k for k in range(1 + int(t / (2 * delay)))) for t in times]
    eye = samples[0] - sum(abs(np.diff(samples)))
    line = Rs485(length, rate, unit_loads=0.125, terminator=None)
    # The lattice has neither the resistance of the cable nor the eighth of a unit load.
    monkeypatch.setattr(electrical, "_CABLE", Cable.lossless(120, 5e-9))
    assert line.eye() == pytest.approx(eye, abs=0.01 * first)


def test_the_eye_of_a_slow_line_is_the_direct_voltage():
    line = Rs485(300, 9600, unit_loads=24)
    network, receivers = line.network()
    z = network.transfer("t0", [1e-6])[:, 0].real
    drop = z[network.index("t23")] / (27 + z[0]) * 1.5 * 81 / 54
    assert receivers["t23"] == pytest.approx(300)
    assert line.eye() == pytest.approx(drop, rel=2e-3)


def verdicts(*args, **kwargs):
    return Rs485(*args, **kwargs).check().table().set_index("rule")["verdict"]


@pytest.mark.parametrize(
    ("rule", "good", "bad"),
    [
        ("length", {"length": 1000}, {"length": 1000.1}),
        ("length_at_bit_rate", {"bit_rate": 406e3}, {"bit_rate": 407e3}),
        ("unit_loads", {"unit_loads": 32}, {"unit_loads": 32.125}),
        ("unit_loads_with_bias", {"unit_loads": 28, "bias": 600}, {"unit_loads": 29, "bias": 600}),
        ("terminator", {"terminator": 120}, {"terminator": 119}),
        ("terminator", {"terminator": 150}, {"terminator": None}),
        ("bias", {"bias": 450}, {"bias": 449}),
        ("bias", {"bias": 650}, {"bias": 651}),
        ("stub", {"stub": 20}, {"stub": 20.1}),
        ("stub_of_rise_time", {"stub": 2, "rise_time": 101e-9}, {"stub": 2, "rise_time": 99e-9}),
        ("driver_load", {"terminator": 120}, {"terminator": 60}),
        ("idle_voltage", {"bias": 450, "length": 100}, {"bias": 650, "unit_loads": 32}),
        ("eye", {}, {"bit_rate": 2e6, "terminator": None, "length": 30, "stub": 10}),
    ],
)
def test_each_rule_is_violated_just_beyond_its_limit(rule, good, bad):
    plain = {"length": 300, "bit_rate": 19200, "unit_loads": 24}
    assert verdicts(**(plain | good))[rule] == "met"
    assert verdicts(**(plain | bad))[rule] == "violated"


def test_what_is_not_known_is_not_verified():
    found = Rs485(300, 19200, unit_loads=24, stub=2).check()
    unknown = found.table().query("verdict == 'not verified'")["rule"].tolist()
    assert (unknown, found.ok) == (["idle_voltage", "stub_of_rise_time"], None)
    assert found.table()["source"].str.len().min() > 10
    for wrong in ({"length": 0}, {"bit_rate": np.nan}, {"unit_loads": 0}, {"stub": -1}):
        with pytest.raises(ArgumentError, match=next(iter(wrong))):
            Rs485(**({"length": 300, "bit_rate": 9600} | wrong))
