"""How long a plan of 62 slaves takes to check, beside a dense solution of its network."""

import os

# One core is promised, so one is measured: numpy reads this when it is loaded.
os.environ["OMP_NUM_THREADS"] = os.environ["OPENBLAS_NUM_THREADS"] = "1"


import numpy as np
from _timing import seconds

from shipnet import datasets
from shipnet.asi.plan import read_plan
from shipnet.asi.topologies import line, ring, star
from shipnet.line.waveform import laplace_grid


def main():
    plans = {
        "line of 62": line(100, 62, supply=50),
        "90 m and a star of 62": star(90, [10 / 62] * 62, supply=90),
        "ring of 62": ring(100, 62),
        "submarine, 190 on 14 lines": read_plan(datasets.path("synthetic_asi_plan_submarine.csv")),
    }
    grid = laplace_grid(102e-6, 3e6)
    print(f"{'plan':<28}{'check':>10}{'signals':>10}{'sweep':>10}{'dense':>10}{'dense/sweep':>13}")
    for name, plan in plans.items():
        assert plan.check().ok
        networks = [(segment.network, segment.head) for segment in plan.segments]
        for network, head in networks:
            ours, dense = (network.transfer(head, grid), network.transfer(head, grid, dense=True))
            assert np.abs(ours - dense).max() < 1e-9 * np.abs(dense).max()
        times = [
            seconds(lambda plan=plan: plan.check()),
            seconds(lambda plan=plan: [segment.signals() for segment in plan.segments]),
            seconds(lambda nets=networks: [network.transfer(head, grid) for network, head in nets]),
            seconds(
                lambda nets=networks: [
                    network.transfer(head, grid, dense=True) for network, head in nets
                ]
            ),
        ]
        print(f"{name:<28}", *(f"{1e3 * time:6.1f} ms" for time in times), end="")
        print(f"{times[3] / times[2]:>11.1f}x")


if __name__ == "__main__":
    main()
