import numpy as np
import pytest

from shipnet.errors import ArgumentError
from shipnet.line import CABLES, Cable

LOSSLESS = CABLES["as-i lossless"]


@pytest.mark.parametrize("resistor", [None, 300.0, 100.0, 20.0])
def test_without_loss_two_waves_add_up(resistor):
    length, width = 80.0, 60e-9
    pulse = LOSSLESS.pulse(length, resistor, width=width)
    out = pulse.x * LOSSLESS.delay
    back = (2 * length - pulse.x) * LOSSLESS.delay

    def shape(since):
        return np.exp(-(((pulse.t[:, np.newaxis] - since) / width) ** 2) / 2)

    expected = shape(out) + LOSSLESS.reflection(resistor) * shape(back)
    np.testing.assert_allclose(pulse.u, expected, atol=1e-4)


def test_loss_attenuates_the_pulse():
    # A wave loses exp(-r x / 2 z0) over x metres.
    pulse = CABLES["as-i 1.5"].pulse(200.0, 100.0)
    cable = CABLES["as-i 1.5"]
    at_end = pulse.u[len(pulse.t) // 2, -1]
    assert at_end == pytest.approx(np.exp(-cable.r * 200 / (2 * cable.z0)), abs=0.003)


@pytest.mark.parametrize("resistor", [1e-6, 1e9])
def test_a_short_circuit_inverts_the_pulse_and_an_open_end_does_not(resistor):
    pulse = LOSSLESS.pulse(100, resistor)
    assert pulse.u[-1, 0] == pytest.approx(LOSSLESS.reflection(resistor), abs=1e-4)
    assert LOSSLESS.reflection(resistor) == pytest.approx(1 if resistor > 100 else -1, abs=1e-6)


@pytest.mark.parametrize(
    "wrong",
    [
        {"length": 0.5},
        {"length": float("nan")},
        {"end": 0.0},
        {"width": 1e-10},
        {"width": 1e-3},
        {"n_steps": 1},
    ],
)
def test_arguments_have_a_range(wrong):
    with pytest.raises(ArgumentError):
        LOSSLESS.pulse(**wrong)


def test_a_pulse_needs_a_single_cable():
    for many in ({"r": [0.06, 0.07]}, {"g": [1e-6, 2e-6]}, {"l": [0.6e-6, 0.7e-6]}):
        with pytest.raises(ArgumentError, match="a single cable"):
            Cable(**{"r": 0.06, "l": 0.65e-6, "c": 65e-12, **many}).pulse()


def test_the_nominal_cable_takes_a_quarter_of_a_decibel_on_100_m():
    loss = 100 * CABLES["as-i 1.5"].attenuation([167e3])
    assert loss == pytest.approx([0.26], abs=0.005)
