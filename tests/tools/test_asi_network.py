import numpy as np
import pytest
from matplotlib.figure import Figure

from shipnet.asi.faults import TelegramErrors
from shipnet.asi.simulation import simulate
from shipnet.asi.slave import Slave
from shipnet.asi.timing import cycle_time
from shipnet.errors import ArgumentError
from shipnet.tools.asi_network import AsiNetwork


@pytest.mark.parametrize("structure", ["line", "star", "ring"])
@pytest.mark.parametrize("slaves", [1, 2, 31, 32, 62])
def test_any_number_of_slaves_works_in_any_structure(structure, slaves):
    plan = AsiNetwork(slaves=slaves, structure=structure).plan
    assert len(plan.slaves) == slaves
    assert sum(run.length for run in plan.cables) == pytest.approx(100)
    assert plan.cycle.time == pytest.approx(cycle_time(min(slaves, 31)))


@pytest.mark.parametrize(
    ("slaves", "pairs", "shared"), [(31, 0, 0), (31, 31, 15), (62, 0, 31), (40, 20, 20), (40, 3, 9)]
)
def test_pairs_shorten_the_cycle_but_are_polled_every_second_cycle(slaves, pairs, shared):
    tool = AsiNetwork(slaves=slaves, pairs=pairs)
    assert sum(slave.half == "B" for slave in tool.plan.slaves) == shared
    cycle = 1e3 * float(cycle_time(slaves, pairs=shared))
    assert tool.numbers["cycle"] == f"{cycle:.2f} ms"
    assert tool.numbers["each slave polled every"] == f"{cycle * (2 if shared else 1):.2f} ms"
    assert tool.ok


@pytest.mark.parametrize(
    ("inputs", "violated"),
    [
        ({"slaves": 62}, []),
        (
            {"slaves": 62, "supply": 0},
            ["slave voltage: 24.47 V at slave 31B at 100 m, at least 26.5 V"],
        ),
        ({"slaves": 62, "structure": "ring"}, []),
        ({"length": 300}, ["cable length: 300 m", "at most 100 m"]),
        ({"slaves": 62, "current_ma": 200}, ["supply current", "at most 8 A"]),
    ],
)
def test_what_violates_a_rule_is_named(inputs, violated):
    tool = AsiNetwork(**inputs)
    assert tool.ok == (not violated) and all(part in tool.verdict for part in violated)
    assert tool.ok == tool.verdict.startswith("all rules met: ")


def test_repetitions_agree_with_the_simulated_line():
    rate = 0.1
    numbers = AsiNetwork(error_rate=rate).numbers
    slaves = [Slave(f"{address}") for address in range(1, 32)]
    faults = [TelegramErrors(str(address), response=rate) for address in range(1, 32)]
    run = simulate(slaves, cycles=500, faults=faults, rng=np.random.default_rng(2024))
    # 1550 expected; four standard deviations are 10 %, and the cycles are also 10 % longer.
    seen = run.summary.repetitions / run.cycle_times.sum()
    assert seen == pytest.approx(float(numbers["repetitions"].split()[0]), rel=0.2)
    none = AsiNetwork().numbers
    assert none["repetitions"] == "0 per second" and none["slaves dropped"].startswith("0 per hour")


@pytest.mark.parametrize(
    ("field", "value", "message"),
    [
        ("slaves", 63, "slaves is 63"),
        ("structure", "tree", "structure is 'tree'; it must be one of 'line'"),
        ("length", 301, "length is 301 m; it must be 10..300 m"),
        ("current_ma", float("nan"), "current_ma is nan mA"),
    ],
)
def test_a_value_out_of_range_is_named(field, value, message):
    with pytest.raises(ArgumentError, match=message):
        AsiNetwork(**{field: value})


def test_slaves_that_violate_a_rule_are_red():
    ax = AsiNetwork(slaves=62, supply=0).plot(ax=Figure().subplots())
    labels = [text.get_text() for text in ax.get_legend().get_texts()]
    assert "slave, failed" in labels and "slave, passed" in labels


def test_two_sliders_move_verdict_and_figure():
    page = AsiNetwork().explore()
    before = page.figure.value
    page.controls["slaves"].value, page.controls["supply"].value = 62, 0.0
    assert "slave voltage" in page.text
    assert page.figure.value != before
