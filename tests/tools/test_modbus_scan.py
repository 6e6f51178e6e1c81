from math import isclose

import pytest
from matplotlib.figure import Figure

from shipnet.errors import ArgumentError
from shipnet.modbus.polling import BIT_RATES
from shipnet.tools.modbus_scan import CHARACTERS, ModbusScan


@pytest.mark.parametrize("character", CHARACTERS)
@pytest.mark.parametrize("slaves", [1, 31, 247])
@pytest.mark.parametrize("registers", [1, 125])
def test_scan_times_follow_from_characters_and_silences(character, slaves, registers):
    inputs = ModbusScan(9600, character, slaves, registers, processing_ms=3, timeout_ms=1000)
    bits = {"8E1": 11, "8O1": 11, "8N2": 11, "8N1": 10}[character]
    characters = 8 + (5 + 2 * registers) + 2 * 3.5
    assert isclose(inputs.result.time, slaves * (characters * bits / 9600 + 3e-3))


def test_each_dead_slave_costs_its_time_outs():
    alive, dead = ModbusScan(retries=2), ModbusScan(retries=2, dead=3)
    tries = 3 * 3 * (8 * 11 / 9600 + 0.5)
    assert isclose(dead.result.time, alive.result.time * 28 / 31 + tries)
    assert dead.numbers["scan without dead slaves"] == alive.numbers["scan"]
    assert isclose(ModbusScan(dead=31).result.time, 31 * 2 * (8 * 11 / 9600 + 0.5))


@pytest.mark.parametrize("dead", [0, 1])
def test_one_slave_too_many_is_too_slow(dead):
    most = ModbusScan(dead=dead).result.max_slaves
    assert ModbusScan(slaves=most, dead=dead).ok
    assert not ModbusScan(slaves=most + 1, dead=dead).ok


@pytest.mark.parametrize(
    ("field", "value", "message"),
    [
        ("bit_rate", 9601, "bit_rate is 9601; it must be one of"),
        ("character", "7E1", "character is '7E1'"),
        ("slaves", 0, "slaves is 0"),
        ("slaves", 248, "slaves is 248"),
        ("registers", 126, "registers is 126"),
        ("dead", 32, "dead is 32"),
        ("retries", 11, "retries is 11"),
        ("processing_ms", 501, "processing_ms is 501 ms; it must be 0..500 ms"),
        ("timeout_ms", float("nan"), "timeout_ms is nan ms"),
        ("limit", None, "limit is None"),
        ("limit", 0, "limit is 0 s; it must be 0.1..60 s"),
    ],
)
def test_a_value_out_of_range_is_named(field, value, message):
    with pytest.raises(ArgumentError, match=message):
        ModbusScan(**{field: value})


def test_the_figure_shows_the_limit_and_the_choice():
    ax = ModbusScan(dead=1).plot(ax=Figure().subplots())
    curve, chosen, limit = ax.lines
    assert list(curve.get_xdata()) == list(BIT_RATES)
    assert (chosen.get_xdata()[0], round(chosen.get_ydata()[0], 3)) == (9600, 2.543)
    assert set(limit.get_ydata()) == {2.0}
    assert ax.get_xlabel() == "bit rate [bit/s]"


def test_the_sliders_start_where_the_inputs_do_and_errors_are_sentences():
    page = ModbusScan().explore()
    values = [control.value for control in page.controls.values()]
    assert values == [getattr(ModbusScan(), name) for name in page.controls]
    picture = page.figure.value
    page.controls["dead"].value = 5
    assert "too slow: 6.4" in page.text
    assert page.figure.value != picture
    page.controls["timeout_ms"].value = 20.0
    assert "timeout is 0.02 s; it must be" in page.text
    page.controls["timeout_ms"].value = 100.0
    # There are fewer slaves than dead ones.
    page.controls["slaves"].value = 3
    assert page.controls["dead"].value == page.controls["dead"].max == 3
    assert "scan: 0.655 s" in page.text
