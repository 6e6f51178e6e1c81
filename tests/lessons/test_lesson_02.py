"""The right answers of lesson 2, each found by a second route."""

from itertools import pairwise

import numpy as np
import pytest

from shipnet.asi.modulation import SEND_CURRENT, Modulation
from shipnet.asi.receiver import receive
from shipnet.asi.segment import POWER_SUPPLY
from shipnet.asi.slave import DEVICE
from shipnet.asi.telegram import RESPONSES
from shipnet.exercises.lesson_02 import _echo
from shipnet.line import Cable, CableRun, Network
from shipnet.line.characteristics import simulate
from tests.lessons.students import NAMED, right, solved


def at_both_ends(volts, resistor, z0):
    """Return the echo from Ohm's and Kirchhoff's laws at the end of the cable."""
    # out + back = resistor * current, out - back = z0 * current
    current, back = np.linalg.solve([[resistor, -1], [z0, 1]], [volts, volts])
    assert resistor * current == pytest.approx(volts + back)
    return back


@pytest.mark.parametrize(
    ("volts", "resistor", "z0"), [(1, 300, 100), (2, 25, 100), (3, 120, 120), (5, 1e6, 60)]
)
def test_an_echo_obeys_ohm_and_kirchhoff(volts, resistor, z0):
    assert _echo(volts, resistor, z0) == pytest.approx(at_both_ends(volts, resistor, z0), abs=1e-9)


@NAMED
def test_an_open_cable_is_a_short_at_a_quarter_wave(name):
    """An echo that needs half a period of a wave comes back against it."""
    numbers, echo = right("ex-02-2", name)
    cable = Cable.lossless(100, numbers["delay"] * 1e-9)
    network = Network([CableRun("near", "far", numbers["length"] - numbers["place"], cable)])
    f = np.linspace(1e3, 1.2e6, 4000)
    z = abs(network.transfer("near", 2j * np.pi * f)[network.index("near")])
    first = f[np.flatnonzero((z[1:-1] < z[:-2]) & (z[1:-1] < z[2:]))[0] + 1]
    assert 1 / (2 * first) * 1e6 == pytest.approx(echo, rel=5e-3)


@pytest.mark.parametrize(("further", "kept"), [(0, True), (10, False)])
def test_the_longest_cable_is_that_of_another_solver(further, kept):
    """By the method of characteristics, in time, where the lesson adds up frequencies."""
    delay = 6.0
    length = solved("ex-02-4", delay=delay).value + further
    cable, dt = Cable.lossless(100, delay * 1e-9), 10e-9
    runs = [
        CableRun(f"{near}", f"{far}", far - near, cable) for near, far in pairwise((0, 5, length))
    ]
    loads = {"0": POWER_SUPPLY + DEVICE, "5": DEVICE, f"{length}": DEVICE}
    network = Network(runs, loads)
    t, slot = dt * np.arange(10240), round(3e-6 / dt)
    x = np.clip((t - 5e-6) / 3e-6, 0, 1)
    current = -SEND_CURRENT * (x - np.sin(2 * np.pi * x) / (2 * np.pi))
    u = []
    for place in ("5", f"{length}"):
        once = simulate(network, {place: (current, np.zeros_like(t))}, dt)[network.index("0")]
        # A telegram is a row of changes of current, and the network is linear.
        late = [np.pad(once, (k * slot, 0))[: t.size] for k in range(14)]
        u.append(Modulation(RESPONSES).steps @ late)
    heard = receive(np.concatenate(u)[:, ::25], 25 * dt, 7)
    assert (heard.error == 0).all()
    assert (heard.bits == np.tile(Modulation(RESPONSES).bits, (2, 1))).all()
    assert heard.within_tolerance.all() == kept
