"""Figures of networks and of waveforms on them."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes

from shipnet.line.network import Network
from shipnet.line.tree import rooted

__all__ = ["plot_network", "plot_waveform"]


def plot_waveform(
    t: npt.ArrayLike, u: npt.ArrayLike, *, ax: Axes, label: str | None = None
) -> Axes:
    """Draw a voltage over time.

    Parameters
    ----------
    t : array_like, shape (n_t,)
        Times [s].
    u : array_like, shape (n_t,)
        Voltages [V].
    ax : matplotlib.axes.Axes
        Where to draw.
    label : str, optional
        Its name in a legend.

    Returns
    -------
    matplotlib.axes.Axes
        The axes given; x is in microseconds.
    """
    ax.plot(np.multiply(t, 1e6), u, label=label)
    ax.set(xlabel="time [us]", ylabel="voltage [V]")
    return ax


def plot_network(network: Network, *, ax: Axes) -> Axes:
    """Draw a network: lines to scale along x, loads as dots.

    Parameters
    ----------
    network : Network
        The network; it grows from its first node. Of a Monte Carlo, the mean lengths are drawn.
    ax : matplotlib.axes.Axes
        Where to draw.

    Returns
    -------
    matplotlib.axes.Axes
        The axes given; x is the distance from the first node along the cable. The longest way
        goes straight on at every node; the line that closes a ring is dashed.
    """
    tree = rooted(network, next(iter(network.nodes), ""))
    count = len(tree.order)
    length = [float(np.mean(branch.length)) for branch in network.branches]
    children: list[list[int]] = [[] for _ in range(count)]
    x, reach = [0.0] * count, [0.0] * count
    for place in range(1, count):
        children[tree.parent[place]].append(place)
        x[place] = x[tree.parent[place]] + length[tree.branch[place]]
    for place in range(count - 1, 0, -1):
        way = reach[place] + length[tree.branch[place]]
        reach[tree.parent[place]] = max(reach[tree.parent[place]], way)

    # What lies ahead takes the upper rows and a stub the next one below, so that no lines cross.
    row, lowest, waiting = [0] * count, 0, [(0, 0)]
    while waiting:
        place, beside = waiting.pop()
        lowest -= beside
        row[place] = lowest if beside or place == 0 else row[tree.parent[place]]
        ahead = sorted(children[place], key=lambda child: reach[child] + x[child], reverse=True)
        waiting += [(child, int(child != ahead[0])) for child in reversed(ahead)]

    for place in range(1, count):
        near = tree.parent[place]
        ax.plot([x[near], x[near], x[place]], [row[near], row[place], row[place]], color="C0")
    if network.ring is not None:
        a, b = (tree.order.index(network.index(end)) for end in network.ring[:2])
        lowest -= 1
        ax.plot([x[a], x[a], x[b], x[b]], [row[a], lowest, lowest, row[b]], color="C0", ls="--")
    loaded = np.asarray(network.shunts().any(axis=(0, 2)))
    for place, node in enumerate(tree.order):
        filled = "C0" if loaded[node] else "white"
        ax.plot(x[place], row[place], "o", color="C0", markerfacecolor=filled, markersize=5)
        ax.annotate(
            network.nodes[node], (x[place], row[place]), (0, 6), textcoords="offset points",
            ha="center", fontsize=8,
        )  # fmt: skip
    ax.set(xlabel="distance along the cable [m]", yticks=[], ylim=(lowest - 0.6, 0.8))
    return ax
