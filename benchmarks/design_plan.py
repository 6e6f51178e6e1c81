"""How long planning takes, and how much wire its groups and routes save over greedy ones."""

import os

# Run on one core, as the targets assume; numpy reads these variables when it is imported.
os.environ["OMP_NUM_THREADS"] = os.environ["OPENBLAS_NUM_THREADS"] = "1"

from itertools import pairwise

import numpy as np
import pandas as pd
from _timing import seconds

from shipnet import datasets
from shipnet.design.drafting import balanced, chain, zones
from shipnet.design.iolist import IoList, read_iolist
from shipnet.design.layout import Site
from shipnet.design.planning import OPTIONS, plan

PORTS, REACH = 4, 10.0
CABINET = (26.0, 6.0, 14.0)


def ship(n):
    """Return points of a ship, clustered around n / 25 places."""
    rng = np.random.default_rng(2026)
    middles = rng.uniform([0, -12, 0], [180, 12, 16], (n // 25, 3))
    places = middles[rng.integers(0, len(middles), n)] + rng.normal(0, [3, 2, 1], (n, 3))
    columns = dict(zip(("x_m", "y_m", "z_m"), places.T.round(1), strict=True))
    signals = rng.choice(["contact", "solenoid", "rtd_3wire", "current_loop"], n)
    tags = [f"P{number:05d}" for number in range(n)]
    return IoList.from_table(pd.DataFrame({"tag": tags, "signal": signals, **columns}))


def by_clusters(places):
    """Form groups of up to PORTS places: split by reach into zones, then minimise distances."""
    labels = np.empty(len(places), dtype=int)
    zone = zones(places, reach=REACH, most=400)
    found = 0
    for own in range(zone.max() + 1):
        inside = np.flatnonzero(zone == own)
        groups = balanced(places[inside], -(-len(inside) // PORTS), most=[PORTS])
        labels[inside] = found + groups
        found += groups.max() + 1
    return labels


def by_greed(places):
    """Group greedily: the first remaining place, then the nearest in reach of the whole group."""
    left = list(range(len(places)))
    labels = np.empty(len(places), dtype=int)
    group = 0
    while left:
        first = left[0]
        own = []
        away = sorted((float(abs(places[k] - places[first]).sum()), k) for k in left)
        for _, place in away:
            if len(own) < PORTS and all(abs(places[k] - places[place]).sum() <= REACH for k in own):
                own.append(place)
                labels[place] = group
                left.remove(place)
        group += 1
    return labels


def nearest_next(ways):
    """Return a greedy order for a trunk: always go to the nearest remaining device."""
    order, left = [0], set(range(1, len(ways)))
    while left:
        order.append(min(left, key=lambda place: ways[order[-1], place]))
        left.remove(order[-1])
    return order


def metres(places, labels):
    """Return the total length of the wires from each place to the median of its group."""
    middles = pd.DataFrame(places).groupby(labels).transform("median").to_numpy()
    return abs(places - middles).sum()


def main():
    example = read_iolist(datasets.path("synthetic_iolist_ship.csv"))
    print("plans, in seconds (the example ship, and a ship of 2000 points)")
    for iolist in (example, ship(2000)):
        times = {option: seconds(lambda o=option, i=iolist: plan(i, Site(CABINET), o), 1)
                 for option in OPTIONS}  # fmt: skip
        print(
            f"{len(iolist):>6}", *(f"{name} {time:.2f}" for name, time in times.items()), sep="  "
        )

    print("\nmodules of 4 ports: time, groups, total wire length")
    for n in (353, 2000):
        places = example.places if n == 353 else ship(n).places
        result = {}
        for name, method in (("clusters", by_clusters), ("greedy", by_greed)):
            time, labels = seconds(lambda m=method, p=places: m(p), 1), method(places)
            result[name] = (time, labels.max() + 1, metres(places, labels))
            print(f"{n:>6}  {name:<9}{1e3 * time:8.0f} ms{labels.max() + 1:>6}"
                  f"{result[name][2]:>8.0f} m")  # fmt: skip
        ours, theirs = result["clusters"], result["greedy"]
        ratios = [b / a for a, b in zip(ours, theirs, strict=True)]
        print(f"{'':>6}  greedy/clusters: time {ratios[0]:.1f}, groups {ratios[1]:.2f}, "
              f"wires {ratios[2]:.2f}")  # fmt: skip

    print("\ntrunks past n devices: time and length")
    rng = np.random.default_rng(7)
    for n in (15, 31, 62):
        sums = np.zeros((2, 2))
        for _ in range(20):
            at = rng.uniform([0, -12, 0], [180, 12, 16], (n + 1, 3))
            ways = abs(at[:, None] - at[None]).sum(axis=-1)
            for row, method in enumerate((chain, nearest_next)):
                order = method(ways)
                sums[row] += (
                    seconds(lambda m=method, w=ways: m(w), 1),
                    sum(ways[a, b] for a, b in pairwise(order)),
                )
        print(f"{n:>6}  chain {1e3 * sums[0, 0] / 20:.2f} ms, {sums[0, 1] / 20:.0f} m   "
              f"nearest next {1e3 * sums[1, 0] / 20:.2f} ms, {sums[1, 1] / 20:.0f} m   "
              f"length {sums[1, 1] / sums[0, 1]:.2f}x")  # fmt: skip


if __name__ == "__main__":
    main()
