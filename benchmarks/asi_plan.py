"""How long it takes to check AS-i plans, and how our network solver compares with a dense one."""

import os

# Run on one core, as the targets assume; numpy reads these variables when it is imported.
os.environ["OMP_NUM_THREADS"] = os.environ["OPENBLAS_NUM_THREADS"] = "1"


import numpy as np
from _timing import seconds

from shipnet import datasets
from shipnet.asi.plan import read_plan
from shipnet.asi.topologies import line, ring, star
from shipnet.line.waveform import F_MAX, laplace_grid


def dense_transfer(network, root, s):
    """Compute transfer impedances [ohm] from nodal equations, as a simple script would."""
    matrix = np.zeros((len(s), len(network.nodes), len(network.nodes)), dtype=complex)
    conductance, per_henry, capacitance = network.shunts()[..., 0]
    each = range(len(network.nodes))
    matrix[:, each, each] = conductance + per_henry / s[:, None] + capacitance * s[:, None]
    for run in network.runs:
        cable, ends = run.made_of, [network.index(run.a), network.index(run.b)]
        angle = cable.propagation(s) * run.length
        wave = np.sqrt(cable.shunt_admittance(s) / cable.series_impedance(s))
        for i, j in (ends, ends[::-1]):
            matrix[:, i, i] += wave / np.tanh(angle)
            matrix[:, i, j] -= wave / np.sinh(angle)
    unit = np.zeros((len(network.nodes), 1))
    unit[network.index(root)] = 1
    return np.linalg.solve(matrix, unit)[..., 0].T


def main():
    plans = {
        "line of 62": line(100, 62, supply=50),
        "90 m and a star of 62": star(90, [10 / 62] * 62, supply=90),
        "ring of 62": ring(100, 62),
        "submarine, 190 on 14 lines": read_plan(datasets.path("synthetic_asi_plan_submarine.csv")),
    }
    grid = laplace_grid(102e-6, F_MAX)
    print(f"{'plan':<28}{'check':>10}{'signals':>10}{'sweep':>10}{'dense':>10}{'dense/sweep':>13}")
    for name, plan in plans.items():
        assert plan.check().ok
        networks = [(segment.network, segment.head) for segment in plan.segments]
        for network, head in networks:
            ours, dense = network.transfer(head, grid), dense_transfer(network, head, grid)
            assert np.abs(ours - dense).max() < 1e-9 * np.abs(dense).max()
        times = [
            seconds(lambda plan=plan: plan.check()),
            seconds(lambda plan=plan: [segment.signals() for segment in plan.segments]),
            seconds(lambda nets=networks: [network.transfer(head, grid) for network, head in nets]),
            seconds(
                lambda nets=networks: [
                    dense_transfer(network, head, grid) for network, head in nets
                ]
            ),
        ]
        print(f"{name:<28}", *(f"{1e3 * time:6.1f} ms" for time in times), end="")
        print(f"{times[3] / times[2]:>11.1f}x")


if __name__ == "__main__":
    main()
