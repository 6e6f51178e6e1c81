"""How fast all single failures of a plan are evaluated, compared with a loop over networkx.

Both programs get the same plan of 2000 points, without redundant trunks. The loop removes one cable
or box from the graph of cables, finds with networkx which points the cabinet still reaches, and
puts the cable or box back. It evaluates only a sample of the failures: its results must equal those
of shipnet, and its time is scaled up. The loop ignores supplies and short circuits, which shipnet
covers. AS-i, whose results depend on both, is therefore left out.
"""

import os

# Run on one core, as the targets assume; numpy reads these variables when it is imported.
os.environ["OMP_NUM_THREADS"] = os.environ["OPENBLAS_NUM_THREADS"] = "1"


import networkx as nx
import numpy as np
import pandas as pd
from _timing import seconds

from shipnet.design.failures import single_failures
from shipnet.design.iolist import IoList
from shipnet.design.layout import Site
from shipnet.design.planning import plan

POINTS = 2000
SAMPLE = 100  # number of failures for the loop
OPTIONS = ("home runs", "junction boxes", "CAN", "Modbus RTU")


def ship(n):
    """Return points spread over a ship."""
    rng = np.random.default_rng(1)
    places = rng.uniform([0, -12, 0], [180, 12, 20], (n, 3)).round(1)
    signals = rng.choice(["contact", "rtd_3wire", "solenoid"], n)
    columns = dict(zip(("x_m", "y_m", "z_m"), places.T, strict=True))
    return IoList.from_table(
        pd.DataFrame({"tag": [f"P{k}" for k in range(n)], "signal": signals} | columns)
    )


def graph_of(design):
    """Return a graph with an edge per cable, except power feeders, and per device in a housing."""
    graph = nx.MultiGraph()
    graph.add_nodes_from(design.devices["device"])
    for inside in design.devices[design.devices["at"] != ""].itertuples():
        graph.add_edge(inside.at, inside.device, key=f"inside {inside.device}")
    for cable in design.cables[design.cables["kind"] != "feeder"].itertuples():
        graph.add_edge(cable.a, cable.b, key=cable.run)
    graph.ends = {cable.run: (cable.a, cable.b) for cable in design.cables.itertuples()}
    return graph


def lost_by(design, graph, points, failure):
    """Return how many points the cabinet no longer reaches after a failure."""
    if failure.failure == "device":
        gone = list(graph.edges(failure.failed, keys=True))
    else:
        gone = [(*graph.ends[failure.failed], failure.failed)]
    graph.remove_edges_from(gone)
    left = nx.node_connected_component(graph, design.cabinet)
    graph.add_edges_from(gone)
    return len(points - left)


def main():
    iolist = ship(POINTS)
    print(f"all single failures of {POINTS} points; the time of networkx is scaled up")
    for option in OPTIONS:
        design = plan(iolist, Site((26, 6, 14)), option)
        cuts = single_failures(design)
        graph = graph_of(design)
        points = set(design.points["tag"]) & nx.node_connected_component(graph, design.cabinet)
        cables = (cuts["failure"] == "cut") & (cuts["kind"] != "feeder")
        known = cuts[cables | (cuts["kind"] == "box")]
        sample = list(known.sample(SAMPLE, random_state=2026).itertuples())
        theirs = [lost_by(design, graph, points, failure) for failure in sample]
        ours = [failure.points_lost for failure in sample]
        assert ours == theirs, [pair for pair in zip(sample, theirs, strict=True)
                                if pair[0].points_lost != pair[1]][:3]  # fmt: skip
        all_of_ours = seconds(lambda n=design: single_failures(n), 2)
        loop = seconds(
            lambda n=design, g=graph, p=points, s=sample: [lost_by(n, g, p, f) for f in s], 1
        )
        loop *= len(cuts) / SAMPLE
        print(f"  {option:<16}{len(cuts):>6} failures{all_of_ours:>8.2f} s"
              f"   networkx{loop:>8.1f} s{loop / all_of_ours:>7.0f}x")  # fmt: skip


if __name__ == "__main__":
    main()
