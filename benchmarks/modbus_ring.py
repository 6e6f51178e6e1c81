"""Redundant Modbus loops beside a graph library and a process-based simulator, same answers."""

from functools import partial
from itertools import combinations
from time import perf_counter

import networkx as nx
import numpy as np
import simpy

from shipnet.modbus.ring import Break, Loop, fault_table, simulate, single_faults, sweep
from shipnet.modbus.timing import Poll, Serial
from shipnet.modbus.uart import decode_uart, uart_waveform

LINE = Serial(9600)


def seconds(function, repeats=3):
    """Return the shortest of several times, and what the function returned."""
    times = []
    for _ in range(repeats):
        begin = perf_counter()
        result = function()
        times.append(perf_counter() - begin)
    return min(times), result


def graph_counts(n, pairs):
    """Count who is lost by two breaks, by components of a graph."""
    lost = []
    for i, j in pairs:
        graph = nx.path_graph(n + 2)
        graph.remove_edges_from([(i, i + 1), (j, j + 1)])
        ends = nx.node_connected_component(graph, 0) | nx.node_connected_component(graph, n + 1)
        lost.append(n + 2 - len(ends))
    return lost


def polled(loop, place, start, end):
    """Poll a loop that breaks, with a process and its time-outs; return the successful polls."""
    env, poll, answers = simpy.Environment(), loop.poll, []
    needed = poll.answered - LINE.t35
    port = [0] * loop.n_slaves

    def attempt(slave):
        whole = env.now + needed <= start or (slave >= place) == (port[slave] == 1)
        answers.extend([(slave, env.now + needed)] if whole else [])
        yield env.timeout(poll.answered if whole else poll.unanswered)
        return whole

    def master():
        while True:
            for slave in range(loop.n_slaves):
                if not (yield from attempt(slave)):
                    port[slave] = 1
                    yield from attempt(slave)

    env.process(master())
    env.run(until=end)
    return answers


def main():
    loop = Loop(247, Poll(LINE, 8, 13))
    own, table = seconds(partial(fault_table, loop, order=2))
    breaks = table["first"].str.startswith("break") & table["second"].str.startswith("break")
    pairs = list(combinations(range(248), 2))[::100]
    peer, lost = seconds(partial(graph_counts, 247, pairs))
    assert table.loc[breaks, "lost"].to_list()[::100] == lost
    ratio = peer / len(pairs) / (own / len(table))
    print(f"all {len(table)} pairs of faults, 247 slaves: {own:6.2f} s, graph {ratio:6.0f}x a pair")

    # Both stop before the slaves that have moved are tried through port A again.
    faults, end = [Break(200, start=10.0)], 60.0
    own, run = seconds(lambda: simulate(loop, faults, duration=end))
    peer, answers = seconds(partial(polled, loop, 200, 10.0, end))
    times = np.sort([time for _, time in answers])
    most = min(times.size, run.answer_times.size)
    assert np.allclose(times[:most], run.answer_times[:most], rtol=0, atol=1e-9)
    print(f"one break, {len(run.tries):5} tries:              {own * 1e3:6.1f} ms, "
          f"simpy {peer / own:6.1f}x")  # fmt: skip

    own, _ = seconds(lambda: [sweep(loop, [f], [8.0]) for f in single_faults(loop)], repeats=1)
    print(f"all 745 single faults simulated:       {own:6.2f} s")

    data = bytes(range(256)) * 40
    waveform = uart_waveform(data, LINE)
    own, found = seconds(lambda: decode_uart(*waveform, LINE))
    assert found.data == data
    print(f"{len(data)} characters decoded:            {own * 1e3:6.1f} ms, "
          f"{len(data) / own / 1e3:.0f} k/s")  # fmt: skip


if __name__ == "__main__":
    main()
