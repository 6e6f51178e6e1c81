"""Figures of networks and of waveforms on them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes

from shipnet.line.network import Network
from shipnet.line.travel import Travel
from shipnet.line.tree import rooted

__all__ = ["Layout", "layout", "plot_network", "plot_travel", "plot_waveform"]


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


def plot_travel(pulse: Travel, step: int, *, ax: Axes) -> Axes:
    """Draw a pulse on its way at one time, with all that it has reached in grey.

    Parameters
    ----------
    pulse : Travel
        What `travel` returned.
    step : int
        Which of its times, from 0.
    ax : matplotlib.axes.Axes
        Where to draw.

    Returns
    -------
    matplotlib.axes.Axes
        The axes given; x is the place.
    """
    lowest, highest = min(pulse.v.min(), 0.0), max(pulse.v.max(), 0.0)
    margin = 0.08 * (highest - lowest)
    reached = pulse.v[: step + 1]
    ax.fill_between(
        pulse.x, reached.min(axis=0), reached.max(axis=0), color="0.9", label="reached so far"
    )
    ax.plot(pulse.x, pulse.v[step], label="now")
    ax.set(
        xlim=(pulse.x[0], pulse.x[-1]),
        ylim=(lowest - margin, highest + margin),
        xlabel="place [m]",
        ylabel="voltage [V]",
    )
    ax.text(
        0.98, 0.95, f"{pulse.t[step] * 1e9:.0f} ns", transform=ax.transAxes, ha="right", va="top"
    )
    return ax


class Layout(NamedTuple):
    """Where the nodes of a network lie in a drawing.

    Attributes
    ----------
    spot : ndarray of float, shape (n_nodes, 2)
        Distance of each node from the first one along the cable [m], and its row, 0 and below.
    strokes : list of ndarray of float, shape (2, 3)
        Points of each line: x in the first row, y in the second.
    closing : ndarray of float, shape (2, 4), or None
        The same of the line that closes a ring.
    """

    spot: npt.NDArray[np.float64]
    strokes: list[npt.NDArray[np.float64]]
    closing: npt.NDArray[np.float64] | None

    @property
    def lowest(self) -> float:
        """Lowest y that is drawn at."""
        everything = [self.spot[:, 1], *([] if self.closing is None else [self.closing[1]])]
        return float(np.concatenate(everything).min())


def layout(network: Network) -> Layout:
    """Place a network: lines to scale along x, branches in rows that do not cross.

    Parameters
    ----------
    network : Network
        The network; it grows from its first node. Of a Monte Carlo, the mean lengths count.

    Returns
    -------
    Layout
        The longest way goes straight on at every node.
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

    strokes = []
    for place in range(1, count):
        near = tree.parent[place]
        stroke = [[x[near], x[near], x[place]], [row[near], row[place], row[place]]]
        strokes.append(np.array(stroke, dtype=float))
    closing = None
    if network.ring is not None:
        a, b = (tree.order.index(network.index(end)) for end in network.ring[:2])
        below = lowest - 1
        closing = np.array([[x[a], x[a], x[b], x[b]], [row[a], below, below, row[b]]], dtype=float)
    spot = np.empty((count, 2))
    spot[tree.order] = np.transpose([x, row])
    return Layout(spot, strokes, closing)


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
    placed = layout(network)
    for stroke in placed.strokes:
        ax.plot(*stroke, color="C0")
    if placed.closing is not None:
        ax.plot(*placed.closing, color="C0", ls="--")
    loaded = np.asarray(network.shunts().any(axis=(0, 2)))
    for name, spot, filled in zip(network.nodes, placed.spot, loaded, strict=True):
        face = "C0" if filled else "white"
        ax.plot(*spot, "o", color="C0", markerfacecolor=face, markersize=5)
        ax.annotate(name, tuple(spot), (0, 6), textcoords="offset points", ha="center", fontsize=8)
    ax.set(xlabel="distance along the cable [m]", yticks=[], ylim=(placed.lowest - 0.6, 0.8))
    return ax
