"""A day of 256 valves, simulated and diagnosed in blocks: time, peak memory and findings.

For comparison, the peak memory is measured for one hour in blocks and for one hour held in memory
as a whole, each in its own process, because the peak of a process never falls. The fraction of the
time that is spent on simulation is printed too.
"""

import subprocess
import sys
from resource import RUSAGE_SELF, getrusage
from time import perf_counter

import numpy as np

from shipnet.ballast.plant import Command, Fault
from shipnet.ballast.simulation import blocks
from shipnet.ballast.trials import run_fleet

DAY, N = 86400.0, 256


def peak():
    """Return the peak memory of this process [MB]; Linux counts in kB, macOS in bytes."""
    return getrusage(RUSAGE_SELF).ru_maxrss / (2**20 if sys.platform == "darwin" else 2**10)


def scenario(duration):
    rng = np.random.default_rng(2024)
    plan = Command.random(rng=rng, until=duration, operations=max(round(6 * duration / DAY), 2))
    return plan, Fault.random(24, rng=rng, until=0.9 * duration), rng


def day(duration=DAY):
    plan, faults, rng = scenario(duration)
    start = perf_counter()
    report = run_fleet(256, plan, faults=faults, rng=rng, until=duration)
    return report, perf_counter() - start


def simulated_only():
    plan, faults, rng = scenario(DAY)
    start = perf_counter()
    for _ in blocks(N, plan, faults=faults, until=DAY, rng=rng):
        pass
    return perf_counter() - start


def alone(*arguments):
    """Run this program with arguments in its own process, and return what it prints."""
    return subprocess.check_output([sys.executable, __file__, *arguments], text=True).strip()


def main():
    if sys.argv[1:2] == ["hour"]:
        plan, faults, rng = scenario(3600.0)
        size = int(sys.argv[2])
        for run in blocks(N, plan, faults=faults, until=3600.0, rng=rng, size=size):
            run.diagnose()
        print(peak())
        return
    report, time = day()
    memory = peak()
    print(report)
    print(f"time {time:.1f} s, {report.n_samples / time / 1e6:.2f} million samples per second")
    print(f"of which simulation {simulated_only() / time:.0%}")
    print(f"peak memory {memory:.0f} MB")
    small, large = float(alone("hour", "2000")), float(alone("hour", "1000000"))
    print(f"an hour in one piece takes {large / small:.1f}x the memory of blocks, {large:.0f} MB")
    print(report.summary().round(1).to_string())


if __name__ == "__main__":
    main()
