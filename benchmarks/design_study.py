"""Where a comparison spends its time, and how fast a study runs on one core and on all cores."""

from time import perf_counter

import loky
import numpy as np
import pandas as pd

from shipnet import datasets
from shipnet.design.comparison import compare
from shipnet.design.costs import draw, likely, tornado
from shipnet.design.failures import single_failures
from shipnet.design.iolist import read_iolist
from shipnet.design.layout import Site
from shipnet.design.planning import OPTIONS, plan

GRID = {"detour": [1.0, 1.1, 1.2, 1.3, 1.4, 1.5, 1.6, 1.7]}
N = len(GRID["detour"])


def timed(function):
    start = perf_counter()
    result = function()
    return result, perf_counter() - start


def main():
    iolist = read_iolist(datasets.path("synthetic_iolist_ship.csv"))
    site = Site((26.0, 6.0, 14.0))
    designs, times = {}, {}
    for option in OPTIONS:
        designs[option], times[f"plan {option}"] = timed(lambda o=option: plan(iolist, site, o))
    made = list(designs.values())
    _, times["failures of all"] = timed(lambda: [single_failures(design) for design in made])
    _, times["rules of all"] = timed(lambda: [design.check() for design in made])
    _, times["tornado"] = timed(lambda: tornado(designs))
    rng = np.random.default_rng(2024)
    _, times["draws"] = timed(lambda: likely(draw(designs, rng=rng)))
    _, times["all except the plans"] = timed(lambda: str(compare(made, rng=rng)))
    print(f"{f'{len(iolist)} points, {len(made)} options':<32}{'seconds':>10}")
    for what, time in times.items():
        print(f"{what:<32}{time:>10.3f}")

    # The first study with worker processes also starts them.
    workers = loky.cpu_count()
    runs = {
        "one by one": lambda: iolist.study(GRID, site),
        f"{workers} processes, with start-up": lambda: iolist.study(GRID, site, workers=workers),
        f"{workers} processes": lambda: iolist.study(GRID, site, workers=workers),
    }
    print(f"{f'a study of {N} comparisons':<32}{'seconds':>10}{'faster by':>12}")
    tables, first = [], 0.0
    for what, run in runs.items():
        table, time = timed(run)
        tables.append(table)
        first = first or time
        print(f"{what:<32}{time:>10.2f}{first / time:>11.2f}x")
    for table in tables[1:]:
        pd.testing.assert_frame_equal(table, tables[0], check_exact=True)


if __name__ == "__main__":
    main()
