import numpy as np
import pytest
from matplotlib.figure import Figure

from shipnet.asi.receiver import matched_filter
from shipnet.errors import ArgumentError, SilenceError
from shipnet.tools.asi_line import CABLE_CHOICES, FILTERED, STEP, AsiLine


@pytest.mark.parametrize("data", range(16))
@pytest.mark.parametrize("cable", CABLE_CHOICES)
def test_every_answer_is_read_on_every_cable(data, cable):
    result = AsiLine(data=data, cable=cable, place=100).result
    assert result.read == result.sent
    assert result.verdict.startswith(f"read {result.sent}")


def test_too_long_a_cable_gives_a_named_error_and_a_terminator_corrects_it():
    long = AsiLine(length=250).result
    assert long.read == "" and type(long.error).__name__ in long.verdict
    assert AsiLine(length=250, terminator=True).result.read == long.sent


def test_noise_hides_the_answer_and_another_try_may_pass():
    assert isinstance(AsiLine(noise=10).result.error, SilenceError)
    tries = {AsiLine(noise=0.9, seed=seed).result.read != "" for seed in range(30)}
    assert tries == {True, False}


def test_an_undetected_fault_is_said_to_be_one():
    result = AsiLine().result
    fooled = type(result)(
        result.t, result.u, result.filtered, "0000001", result.reception, result.error
    )
    assert fooled.verdict == "read 0011001, but 0000001 was sent: the fault went undetected"


def test_the_filter_leaves_so_much_of_the_noise():
    noise = np.random.default_rng(1).normal(0, 1, (200, 4000))
    assert matched_filter(noise, STEP).std() == pytest.approx(FILTERED, rel=0.01)


def test_a_slave_beyond_the_end_is_at_the_end():
    assert AsiLine(length=50, place=300).result.u == pytest.approx(
        AsiLine(length=50, place=50).result.u
    )


@pytest.mark.parametrize(
    ("field", "value", "message"),
    [
        ("length", 0, "length is 0 m; it must be 1..500 m"),
        ("length", float("nan"), "length is nan m"),
        ("place", -1, "place is -1 m"),
        ("cable", "thick", "cable is 'thick'; it must be one of 'nominal"),
        ("noise", -0.1, "noise is -0.1 V"),
        ("data", 16, "data is 16"),
    ],
)
def test_a_value_out_of_range_is_named(field, value, message):
    with pytest.raises(ArgumentError, match=message):
        _ = AsiLine(**{field: value}).result


def test_the_figure_shows_line_filter_and_slots():
    ax = Figure().subplots()
    tool = AsiLine(length=150)
    assert tool.plot(ax=ax) is ax
    result = tool.result
    raw, filtered, pulses, gaps = ax.lines[:4]
    assert raw.get_ydata() == pytest.approx(result.u)
    assert filtered.get_ydata() == pytest.approx(result.filtered)
    slots = result.reception.slots
    assert len(pulses.get_xdata()) == (slots != 0).sum()
    assert len(gaps.get_xdata()) == (slots == 0).sum() - 1
    assert np.abs(pulses.get_ydata()).min() > ax.lines[4].get_ydata()[0]
    assert ax.get_xlabel() == "time [us]"
    AsiLine(noise=10).plot(ax=ax)


def test_the_sliders_start_where_the_inputs_do():
    page = AsiLine().explore()
    values = [control.value for control in page.controls.values()]
    assert values == [getattr(AsiLine(), name) for name in page.controls]
    assert "read 0011001" in page.text
    before = page.figure.value
    assert "data:image/png" in before and 'alt="Voltage at the master over time' in before
    page.controls["length"].value = 200
    assert "InformationError" in page.text
    assert page.figure.value != before
