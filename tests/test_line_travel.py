import numpy as np
import pytest
from matplotlib.figure import Figure

from shipnet.errors import ArgumentError
from shipnet.line.cable import CABLES
from shipnet.line.plot import plot_travel
from shipnet.line.travel import reflection_factor, travel

LOSSLESS = CABLES["as-i lossless"]


@pytest.mark.parametrize("resistor", [None, 300.0, 100.0, 20.0])
def test_without_loss_two_waves_add_up(resistor):
    length, width = 80.0, 60e-9
    pulse = travel(length, resistor, cable=LOSSLESS, width=width)
    out = pulse.x * LOSSLESS.delay
    back = (2 * length - pulse.x) * LOSSLESS.delay

    def shape(since):
        return np.exp(-(((pulse.t[:, np.newaxis] - since) / width) ** 2) / 2)

    expected = shape(out) + reflection_factor(resistor, LOSSLESS) * shape(back)
    np.testing.assert_allclose(pulse.v, expected, atol=1e-4)


def test_loss_takes_its_share_on_the_way():
    # A wave loses exp(-r x / 2 z0) over x metres.
    pulse = travel(200.0, 100.0)
    cable = CABLES["as-i"]
    at_end = pulse.v[len(pulse.t) // 2, -1]
    assert at_end == pytest.approx(np.exp(-cable.r * 200 / (2 * cable.z0)), abs=0.003)


@pytest.mark.parametrize("resistor", [1e-6, 1e9])
def test_a_short_turns_the_pulse_over_and_an_open_end_does_not(resistor):
    pulse = travel(100, resistor, cable=LOSSLESS)
    assert pulse.v[-1, 0] == pytest.approx(reflection_factor(resistor, LOSSLESS), abs=1e-4)
    assert reflection_factor(resistor, LOSSLESS) == pytest.approx(
        1 if resistor > 100 else -1, abs=1e-6
    )


@pytest.mark.parametrize(
    "wrong",
    [
        {"length": 0.5},
        {"length": float("nan")},
        {"resistor": 0.0},
        {"width": 1e-10},
        {"width": 1e-3},
        {"n_places": 1},
        {"n_steps": 1},
    ],
)
def test_arguments_have_a_range(wrong):
    with pytest.raises(ArgumentError):
        travel(**wrong)


def test_a_step_is_drawn_with_what_was_reached_before():
    pulse = travel(100, n_steps=5)
    ax = plot_travel(pulse, 2, ax=Figure().subplots())
    np.testing.assert_array_equal(ax.lines[0].get_ydata(), pulse.v[2])
    assert ax.texts[0].get_text() == "650 ns"
    assert ax.get_xlabel() == "place [m]"
