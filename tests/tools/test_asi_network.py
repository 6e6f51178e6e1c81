import pytest

from shipnet.asi.timing import cycle_time
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
