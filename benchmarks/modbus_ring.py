"""How fast redundant Modbus loops are simulated, compared with a graph library and SimPy."""

from functools import partial
from itertools import combinations
from time import perf_counter

import networkx as nx
import numpy as np
import simpy

from shipnet.modbus import Loop, Poll, Request, SerialLine, simulate
from shipnet.modbus.faults import Break

LINE = SerialLine(9600)


def seconds(function, repeats=3):
    """Return the shortest of several run times [s], and the function's result."""
    times = []
    for _ in range(repeats):
        begin = perf_counter()
        result = function()
        times.append(perf_counter() - begin)
    return min(times), result


def graph_counts(n, pairs):
    """Count the slaves that each pair of breaks cuts off, from the components of a graph."""
    lost = []
    for i, j in pairs:
        graph = nx.path_graph(n + 2)
        graph.remove_edges_from([(i, i + 1), (j, j + 1)])
        ends = nx.node_connected_component(graph, 0) | nx.node_connected_component(graph, n + 1)
        lost.append(n + 2 - len(ends))
    return lost


def polled(loop, place, start, end):
    """In SimPy, poll a loop that breaks at `start`; return slave and end [s] of each good poll."""
    env, poll, answers = simpy.Environment(), loop.poll, []
    needed = poll.time - LINE.t35
    port = [0] * loop.n_slaves

    def attempt(slave):
        whole = env.now + needed <= start or (slave >= place) == (port[slave] == 1)
        answers.extend([(slave, env.now + needed)] if whole else [])
        yield env.timeout(poll.time if whole else poll.unanswered_time)
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
    loop = Loop(247, Poll(Request.read_input_registers(0, 4), LINE))
    pairs = list(combinations(range(248), 2))[::100]
    own, ours = seconds(lambda: [len(loop.reach([Break(i), Break(j)]).lost) for i, j in pairs])
    peer, lost = seconds(partial(graph_counts, 247, pairs))
    assert ours == lost
    print(
        f"{len(pairs)} pairs of breaks, 247 slaves: {own * 1e3:6.1f} ms, graph {peer / own:6.0f}x"
    )

    # Both simulations end before slaves that respond through B are tried through A again.
    fault, end = Break(200, start=10.0), 60.0
    own, run = seconds(lambda: simulate(loop, faults=fault, until=end))
    peer, answers = seconds(partial(polled, loop, 200, 10.0, end))
    times = np.sort([time for _, time in answers])
    ours = run.events().query("answered")["start_s"] + loop.poll.time - loop.poll.line.t35
    most = min(times.size, ours.size)
    assert np.allclose(times[:most], ours[:most], rtol=0, atol=1e-9)
    print(f"one break, {len(run.tries):5} tries:              {own * 1e3:6.1f} ms, "
          f"simpy {peer / own:6.1f}x")  # fmt: skip

    own, table = seconds(loop.single_failures)
    print(f"all {len(table)} single failures:              {own * 1e3:6.1f} ms")

    data = bytes(range(256)) * 40
    waveform = LINE.waveform(data)
    own, found = seconds(waveform.decode)
    assert found.data == data
    print(f"{len(data)} characters decoded:            {own * 1e3:6.1f} ms, "
          f"{len(data) / own / 1e3:.0f} k/s")  # fmt: skip


if __name__ == "__main__":
    main()
