from dataclasses import replace
from itertools import combinations, pairwise

import networkx as nx
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from shipnet.errors import ArgumentError
from shipnet.modbus.faults import Break, DeadPort, DeadSlave, Short
from shipnet.modbus.pdu import Request
from shipnet.modbus.polling import Poll
from shipnet.modbus.redundancy import Loop
from shipnet.modbus.simulation import simulate
from shipnet.modbus.uart import SerialLine
from tests.modbus.sweeps import answer_times, longest_recovery, pairs, sweep

LINE = SerialLine(9600)
STATUS, ONE = Request.read_input_registers(0, 4), Request.read_holding_registers(0, 1)
#: Rounding error of sums of some hundred times, each from milliseconds to seconds [s].
DUST = 1e-9


def loop(n=5, *, timeout=0.1, retries=0, move="slave", isolators=False, recheck=60, closed=True):
    poll = Poll(STATUS, LINE, timeout=timeout, retries=retries)
    return Loop(n, poll, closed=closed, isolators=isolators, move=move, recheck=recheck)


def joined_in_a_graph(loop, faults):
    """Return the slaves that each port reaches in a graph, whose nodes are the ends of sections."""
    n = loop.n_slaves
    graph = nx.Graph()
    graph.add_nodes_from(range(n + 2))
    broken = {f.section for f in faults if isinstance(f, Break)}
    shorted = {f.section for f in faults if isinstance(f, Short)}
    if loop.isolators:
        broken, shorted = broken | shorted, set()
    graph.add_edges_from((k, k + 1) for k in range(n + 1) if k not in broken)
    touched = {end for k in shorted for end in (k, k + 1)}
    dead_slaves = {f.slave for f in faults if isinstance(f, DeadSlave)}
    dead_ports = {f.port for f in faults if isinstance(f, DeadPort)}
    reached = []
    for name, node in (("A", 0), ("B", n + 1)):
        group = nx.node_connected_component(graph, node)
        alive = name not in dead_ports and not group & touched
        reached.append([s for s in range(1, n + 1) if alive and s in group - dead_slaves])
    return reached


@pytest.mark.parametrize("isolators", [False, True])
@pytest.mark.parametrize("n", [1, 2, 6])
def test_reach_equals_a_walk_along_the_cable(n, isolators):
    system = loop(n, isolators=isolators)
    faults = system.single_faults()
    for count in range(4):
        for case in combinations(faults, count):
            reach = system.reach(case)
            assert [reach.through_a, reach.through_b] == joined_in_a_graph(system, case)
            union = {*reach.through_a, *reach.through_b, *reach.lost}
            assert union == set(range(1, n + 1))


@pytest.mark.parametrize("isolators", [False, True])
@pytest.mark.parametrize("move", ["slave", "downstream"])
def test_the_table_of_all_cases_agrees_with_each_case(isolators, move):
    system = loop(7, isolators=isolators, move=move)
    table = system.single_failures()
    cases = system.single_faults()
    assert len(table) == len(cases)
    for row, case in zip(table.itertuples(), cases, strict=True):
        assert row.Index == str(case) and row.kind == row.Index.split()[0]
        served, gaps = system.reach(case).served, system.worst_gap(case)
        counts = [served.count(port) for port in "AB-"]
        assert [row.served_a, row.served_b, row.lost] == counts
        finite = gaps[np.isfinite(gaps)]
        longest = finite.max() if finite.size else np.nan
        assert row.worst_gap_s == pytest.approx(longest, nan_ok=True)


RULES = [
    pytest.param(retries, timeout, move, id=f"{retries}-{timeout}-{move}")
    for retries, timeout in ((0, 0.02), (1, 0.1), (0, 1.0))
    for move in ("slave", "downstream")
]


@pytest.mark.parametrize(("retries", "timeout", "move"), RULES)
def test_the_closed_form_equals_the_worst_of_a_simulation(retries, timeout, move):
    system = loop(4, retries=retries, timeout=timeout, move=move)
    for case in [*((f,) for f in system.single_faults()), *pairs(system)]:
        bound, found = system.worst_gap(case), sweep(system, case).max(axis=0)
        served = np.array(system.reach(case).served)
        assert (np.isinf(found) == (served == "-")).all()
        slack = bound[served != "-"] - found[served != "-"]
        assert (np.abs(slack) <= DUST).all(), case


@settings(max_examples=60)
@given(data=st.data())
def test_no_instant_of_a_fault_is_worse_than_the_closed_form(data):
    retries = data.draw(st.integers(0, 2))
    move, n = data.draw(st.sampled_from(["slave", "downstream"])), data.draw(st.integers(1, 9))
    timeout = data.draw(st.floats(0.02, 1.5))
    isolators = data.draw(st.booleans())
    system = loop(n, timeout=timeout, retries=retries, move=move, isolators=isolators)
    faults = st.sampled_from(system.single_faults())
    case = data.draw(st.lists(faults, min_size=1, max_size=4, unique=True))
    instants = data.draw(st.lists(st.floats(system.period, 5 * system.period), min_size=1))
    found = sweep(system, case, instants)
    assert (found <= system.worst_gap(case) + DUST).all()


@pytest.mark.parametrize("move", ["slave", "downstream"])
def test_the_bound_is_attained_on_the_largest_loop(move):
    system = loop(247, timeout=1.0, move=move)
    case = [Break(100)]
    instant = answer_times(simulate(system, until=2 * system.period - 0.01))[247 + 149]
    found = sweep(system, case, [instant])[0]
    assert found[149] == pytest.approx(system.worst_gap(case)[149], abs=1e-6)
    by_hand = 247 * system.poll.time + (147 if move == "slave" else 2) * system.poll.timeout_time
    assert found[149] == pytest.approx(by_hand, abs=1e-6)


def test_a_line_that_is_not_closed_has_one_port():
    system = loop(5, closed=False)
    faults = system.single_faults()
    assert {str(f) for f in loop(5).single_faults()} - {str(f) for f in faults} == {
        "break 5",
        "short 5",
        "port B",
    }
    for case in [*((f,) for f in faults), *pairs(system)]:
        reach = system.reach(case)
        assert reach == loop(5).reach([*case, DeadPort("B")])
        bound, found = system.worst_gap(case), sweep(system, case).max(axis=0)
        assert found == pytest.approx(bound), case
        run = simulate(system, faults=case, until=20)
        assert set(run.events().port) <= {"A"} and run.table().port.tolist() == reach.served


def test_polls_never_overlap_and_their_outcome_decides_their_length():
    faults = [Break(2, start=1.0, stop=30), DeadSlave(4, start=5, stop=40), DeadPort("B", start=9)]
    polls = simulate(loop(6, retries=1, recheck=3), faults=faults, until=60).events()
    assert (polls.start_s.to_numpy()[1:] >= polls.end_s.to_numpy()[:-1] - DUST).all()
    length = (polls.end_s - polls.start_s).groupby(polls.answered).agg(["min", "max"])
    poll = loop().poll
    assert length.loc[True].tolist() == pytest.approx([poll.time] * 2)
    assert length.loc[False].tolist() == pytest.approx([poll.unanswered_time] * 2)


def test_a_try_is_answered_exactly_if_its_path_is_whole_throughout():
    faults = [
        Break(2, start=1.0, stop=9.015),
        Short(4, start=5.01, stop=14),
        DeadSlave(4, start=3, stop=20),
    ]
    system = loop(6, recheck=0.5)
    for row in simulate(system, faults=faults, until=25).events().itertuples():
        end = row.start_s + system.poll.time - LINE.t35
        changes = (t for f in faults for t in (f.start, f.stop) if row.start_s < t < end)
        for t in (row.start_s, *changes):
            now = [f for f in faults if f.start <= t < f.stop]
            if row.slave not in joined_in_a_graph(system, now)[row.port == "B"]:
                assert not row.answered
                break
        else:
            assert row.answered


@pytest.mark.parametrize("move", ["slave", "downstream"])
@pytest.mark.parametrize("fault", loop(6).single_faults(), ids=str)
def test_a_repair_soon_restores_the_original_ports(fault, move):
    system = loop(6, move=move, recheck=2.0)
    longest = longest_recovery(system)
    for stop in np.linspace(8, 10.5, 26):
        run = simulate(system, faults=[replace(fault, start=1.0, stop=stop)], until=20)
        assert (run.table().port == "A").all()
        events = run.events()
        after = events[events.start_s > stop + longest]
        assert after.answered.all() and (after.port == "A").all() and len(after) > 100


def test_lost_slaves_cost_one_try_on_each_port_per_recheck():
    system = loop(6, recheck=5.0)
    polls = simulate(system, faults=[DeadSlave(2, start=1)], until=60).events()
    failed = polls[~polls.answered]
    assert failed.slave.unique().tolist() == [2]
    probes = failed[failed.kind == "probe"]
    assert probes.port.tolist() == ["A", "B"] * (len(probes) // 2)
    waits = np.diff(probes.start_s.to_numpy()[::2])
    assert (waits >= 5.0).all() and (waits <= 5.0 + system.period + 2 * 0.11).all()


def test_one_lost_response_switches_the_slave_and_no_time_has_no_polls():
    run = simulate(loop(5), faults=[DeadSlave(3, start=0.56, stop=0.57)], until=10)
    assert (~run.events().answered).sum() == 1
    assert (run.events().kind == "switch").any()
    assert run.table().answers.sum() == run.events().answered.sum()
    none = simulate(loop(2), until=0)
    assert len(none.events()) == 0 and none.table().port.tolist() == ["A", "A"]
    assert none.gaps.tolist() == [0, 0]


def test_a_loop_in_which_all_are_lost_waits_and_recovers():
    system = loop(3, recheck=1.0)
    run = simulate(system, faults=[Short(1, start=2, stop=20.5)], until=40)
    assert (run.table().port == "A").all()
    events = run.events()
    assert events.answered[events.start_s > 20.5 + longest_recovery(system)].all()


def test_lost_slaves_are_tried_in_turn():
    system = loop(6, recheck=1.0)
    faults = [DeadSlave(2), DeadSlave(5), Break(5, start=4)]
    polls = simulate(system, faults=faults, until=30).events()
    probed = polls[(polls.kind == "probe") & (polls.port == "A") & (polls.start_s > 8)].slave
    assert len(probed) > 9
    assert {*pairwise(probed)} == {(2, 5), (5, 6), (6, 2)}


def test_gaps_and_ports_are_those_of_the_slaves_concerned():
    system = loop(6, recheck=2.0)
    run = simulate(system, faults=[Break(4, start=1, stop=6), DeadSlave(1, start=2)], until=12)
    assert run.table().port.tolist() == ["-"] + ["A"] * 5
    ends = run.events().query("answered and slave == 1").start_s + system.poll.time - LINE.t35
    assert run.gaps[0] == pytest.approx(12 - ends.max()) and run.gaps[0] > 9


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: loop(0), r"n_slaves is 0.*1\.\.247"),
        (lambda: loop(248), "n_slaves is 248"),
        (lambda: loop(247, recheck=5), "recheck is 5 s"),
        (lambda: loop(isolators=1), "isolators is 1"),
        (lambda: loop(move="all"), "move is 'all'"),
        (lambda: Break(248), "section is 248"),
        (lambda: Break(1, start=-1), "start is -1"),
        (lambda: Break(1, start=2, stop=2), "stop is 2 s"),
        (lambda: Short(1.5), "section is 1.5"),
        (lambda: DeadSlave(0), "slave is 0"),
        (lambda: DeadPort("C"), "port is 'C'"),
        (lambda: loop(5).reach([Break(6)]), r"section is 6.*0\.\.5"),
        (lambda: loop(5).reach([DeadSlave(6)]), r"slave is 6.*1\.\.5"),
        (lambda: loop(5).reach(["break"]), "'break'; it must be one of Break, DeadPort"),
        (lambda: simulate(loop(), until=-1), "until is -1"),
        (lambda: simulate(loop(), faults=[Break(9)], until=1), "section is 9"),
        (lambda: sweep(loop(), [Break(1)], [-1.0]), "start is -1"),
    ],
)
def test_arguments_out_of_range_are_named(make, message):
    with pytest.raises(ArgumentError, match=message):
        make()
