"""How the time to plan, check and compare all options of a design grows with its points.

Prints CPU seconds on one core, excluding imports, and the peak memory so far, next to the targets
for two cores. Numbers of points may be given: `python benchmarks/design_scale.py 1000 20000`.
"""

import os

# Run on one core; numpy reads these variables when it is imported.
os.environ["OMP_NUM_THREADS"] = os.environ["OPENBLAS_NUM_THREADS"] = "1"

import resource
import sys
from time import process_time

import numpy as np
from design_plan import CABINET, ship

from shipnet.design.comparison import compare
from shipnet.design.layout import Site
from shipnet.design.planning import OPTIONS, plan
from shipnet.design.rules import RuleSet

#: Targets in CPU seconds and MB, by number of points.
GOALS = {1_000: (3, 1500), 20_000: (20, 500), 100_000: (240, 5000)}


def whole(n):
    """Plan and compare all options for n points; return the CPU time of each part [s]."""
    iolist, rules, spent, designs = ship(n), RuleSet.published("DNV"), {}, []
    begin = process_time()
    for option in OPTIONS:
        designs.append(plan(iolist, Site(CABINET), option, rules=rules))
        spent[option], begin = process_time() - begin, process_time()
    for design in designs:
        design.failures()
    spent["failures"], begin = process_time() - begin, process_time()
    found = compare(designs, rules=rules, rng=1)
    found.html()
    spent["rules, costs, report"] = process_time() - begin
    return spent


def main():
    whole(200)  # first call: triggers lazy imports
    sizes = [int(size) for size in sys.argv[1:]] or [1000, 4000, 20_000]
    totals = []
    for n in sizes:
        spent = whole(n)
        totals.append(sum(spent.values()))
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        print(f"{n} points: {totals[-1]:.1f} s, {peak:.0f} MB", end="")
        print("; target {} s, {} MB".format(*GOALS[n]) if n in GOALS else "")
        for what, seconds in spent.items():
            print(f"  {what:<24}{seconds:8.2f} s")
    powers = np.diff(np.log(totals)) / np.diff(np.log(sizes))
    for n, power in zip(sizes[1:], powers, strict=True):
        print(f"up to {n} points the time grows as n^{power:.2f}")


if __name__ == "__main__":
    main()
