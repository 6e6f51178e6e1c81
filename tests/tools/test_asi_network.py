import numpy as np
import pytest
from matplotlib.figure import Figure

from shipnet.asi.faults import TelegramErrors
from shipnet.asi.simulation import simulate
from shipnet.asi.slave import Slave
from shipnet.asi.timing import cycle_time
from shipnet.errors import ArgumentError
from shipnet.tools.asi_network import STRUCTURES, AsiNetwork


@pytest.mark.parametrize("structure", STRUCTURES)
@pytest.mark.parametrize("slaves", [1, 2, 31, 32, 62])
def test_any_number_of_slaves_on_any_structure(structure, slaves):
    result = AsiNetwork(slaves=slaves, structure=structure).result
    assert len(result.plan.slaves) == slaves
    assert sum(run.length for run in result.plan.cables) == pytest.approx(100)
    assert result.cycle == pytest.approx(cycle_time(min(slaves, 31)))
    assert result.heard == pytest.approx(result.cycle * (2 if slaves > 31 else 1))


@pytest.mark.parametrize(
    ("slaves", "pairs", "shared"), [(31, 0, 0), (31, 31, 15), (62, 0, 31), (40, 20, 20), (40, 3, 9)]
)
def test_pairs_shorten_the_cycle_and_wait_for_every_other(slaves, pairs, shared):
    result = AsiNetwork(slaves=slaves, pairs=pairs).result
    assert sum(slave.half == "B" for slave in result.plan.slaves) == shared
    assert result.cycle == pytest.approx(cycle_time(slaves, pairs=shared))
    assert result.heard == pytest.approx(result.cycle * (2 if shared else 1))
    assert result.broken == []


def test_the_voltage_breaks_first_beside_the_master():
    assert AsiNetwork(slaves=62).result.broken == []
    (said,) = AsiNetwork(slaves=62, supply=0).result.broken
    assert said.startswith("slave voltage: 24.47 V at slave 31B at 100 m, at least 26.5 V")
    assert AsiNetwork(slaves=62, structure="ring").result.broken == []


def test_too_much_cable_and_too_much_current_are_named():
    long = " ".join(AsiNetwork(length=300).result.broken)
    assert "cable length: 300 m" in long and "at most 100 m" in long
    heavy = " ".join(AsiNetwork(slaves=62, current_ma=200).result.broken)
    assert "supply current" in heavy and "at most 8 A" in heavy


def test_repetitions_are_those_of_the_simulated_line():
    rate = 0.1
    result = AsiNetwork(error_rate=rate).result
    slaves = [Slave(f"{address}") for address in range(1, 32)]
    faults = [TelegramErrors(str(address), response=rate) for address in range(1, 32)]
    run = simulate(slaves, cycles=500, faults=faults, rng=np.random.default_rng(2024))
    summary = run.summary
    seconds = run.cycle_times.sum()
    # 1550 expected: four standard deviations are a tenth; the cycles grow by a tenth as well.
    assert summary.repetitions / seconds == pytest.approx(result.repetitions, rel=0.2)
    assert AsiNetwork().result.repetitions == 0 and AsiNetwork().result.drops == 0


@pytest.mark.parametrize(
    ("field", "value", "message"),
    [
        ("slaves", 63, "slaves is 63"),
        ("slaves", 0, "slaves is 0"),
        ("pairs", 32, "pairs is 32"),
        ("structure", "tree", "structure is 'tree'; it must be one of 'line'"),
        ("length", 301, "length is 301 m; it must be 10..300 m"),
        ("supply", 1.1, "supply is 1.1; it must be 0..1"),
        ("current_ma", float("nan"), "current_ma is nan mA"),
        ("error_rate", -0.1, "error_rate is -0.1"),
    ],
)
def test_a_value_out_of_range_is_named(field, value, message):
    with pytest.raises(ArgumentError, match=message):
        AsiNetwork(**{field: value})


def test_broken_slaves_are_red():
    ax = AsiNetwork(slaves=62, supply=0).plot(ax=Figure().subplots())
    labels = [text.get_text() for text in ax.get_legend().get_texts()]
    assert "slave, failed" in labels and "slave, passed" in labels


def test_the_sliders_start_where_the_inputs_do():
    page = AsiNetwork().explore()
    values = [control.value for control in page.controls.values()]
    assert values == [getattr(AsiNetwork(), name) for name in page.controls]
    before = page.figure.value
    page.controls["slaves"].value, page.controls["supply"].value = 62, 0.0
    assert "slave voltage" in page.text
    assert page.figure.value != before
