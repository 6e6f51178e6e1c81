from dataclasses import replace

import numpy as np
import pytest
from matplotlib.figure import Figure

from shipnet.asi.receiver import matched_filter
from shipnet.asi.telegram import Response
from shipnet.errors import ArgumentError
from shipnet.tools.asi_line import CABLE_CHOICES, FILTERED, STEP, AsiLine


@pytest.mark.parametrize("data", range(16))
@pytest.mark.parametrize("cable", CABLE_CHOICES)
def test_every_response_is_read_on_every_cable(data, cable):
    tool = AsiLine(data=data, cable=cable, place=100)
    assert tool.ok and tool.verdict.startswith(f"read {Response(data).bits}: ")


def test_too_long_a_cable_raises_a_named_error_and_a_terminator_prevents_it():
    long = AsiLine(length=250)
    assert not long.ok and long.verdict.startswith("AlternationError: slot 4")
    terminated = replace(long, terminator=True)
    assert terminated.verdict.startswith("read 0011001: ")


def test_a_terminator_loads_the_line_and_leaves_the_tolerances_of_the_pulses():
    for length in (100, 200, 250):
        tool = AsiLine(length=length, terminator=True)
        assert tool._read() == Response(tool.data).bits
        assert not tool.ok and tool.result.ringing > 0.30


def test_a_line_with_uneven_pulses_fails_even_if_the_response_is_read():
    far = AsiLine(length=230, place=230)
    assert far.numbers["ringing"] > "30%" and far._read() == Response(far.data).bits
    assert not far.ok and far.verdict.endswith("; the pulses are outside their tolerance")


def test_noise_hides_the_response_and_another_try_may_pass():
    assert AsiLine(noise=10).verdict.startswith("SilenceError: no pulse")
    assert list(AsiLine(noise=10).numbers) == ["signal"]
    assert {AsiLine(noise=0.9, seed=seed).ok for seed in range(30)} == {True, False}


def test_a_fault_that_no_check_finds_is_named(monkeypatch):
    other = AsiLine(data=0)
    monkeypatch.setattr(AsiLine, "result", other.result)
    verdict = "read 0000001, but 0011001 was sent: the fault went undetected"
    assert AsiLine().verdict == verdict and not AsiLine().ok


def test_the_filter_reduces_the_noise_by_the_computed_ratio():
    noise = np.random.default_rng(1).normal(0, 1, (200, 4000))
    assert matched_filter(noise, STEP).std() == pytest.approx(FILTERED, rel=0.01)


def test_a_slave_beyond_the_end_is_at_the_end():
    beyond, end = (AsiLine(length=50, place=place).wave.u for place in (300, 50))
    assert beyond == pytest.approx(end)


@pytest.mark.parametrize(
    ("field", "value", "message"),
    [
        ("length", 0, "length is 0 m; it must be 1..500 m"),
        ("cable", "thick", "cable is 'thick'; it must be one of 'nominal"),
        ("data", 16, "data is 16"),
    ],
)
def test_a_value_out_of_range_is_named(field, value, message):
    with pytest.raises(ArgumentError, match=message):
        AsiLine(**{field: value})


def test_the_figure_has_the_threshold_of_the_receiver():
    ax = Figure().subplots()
    tool = AsiLine(length=150)
    assert tool.plot(ax) is ax
    assert ax.lines[0].get_ydata() == pytest.approx(tool.wave.u)
    AsiLine(noise=10).plot(ax)


def test_a_slider_moves_verdict_and_figure():
    page = AsiLine().explore()
    assert "read 0011001" in page.text
    before = page.figure.value
    assert "data:image/png" in before and 'alt="Voltage at the master over time' in before
    page.controls["length"].value = 200
    assert "InformationError" in page.text
    assert page.figure.value != before
