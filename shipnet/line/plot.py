"""Figures of networks and of waveforms on them."""

from __future__ import annotations

from typing import Any, NamedTuple

import matplotlib.pyplot as plt
import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes

from shipnet.line.network import Network
from shipnet.line.pulse import Pulse
from shipnet.line.solver import rooted
from shipnet.line.waveform import Waveform


def axes(ax: Axes | None, **size: Any) -> Axes:
    """Return the axes given, or new ones."""
    return plt.subplots(**size)[1] if ax is None else ax


def plot_waveform(wave: Waveform, *, ax: Axes | None = None) -> Axes:
    """Draw every voltage of a waveform over time; x is in microseconds."""
    ax = axes(ax)
    rows = wave.u.reshape(-1, wave.u.shape[-1])
    names = wave.names if len(wave.names) == len(rows) else [None] * len(rows)
    for name, row in zip(names, rows, strict=True):
        ax.plot(wave.t * 1e6, row, label=name)
    ax.set(xlabel="time [us]", ylabel="voltage [V]")
    if len(wave.names) == len(rows) > 1:
        ax.legend()
    return ax


def plot_pulse(pulse: Pulse, step: int, *, ax: Axes | None = None) -> Axes:
    """Draw a pulse on its way at one time, with all that it has reached in grey."""
    ax = axes(ax)
    lowest, highest = min(pulse.u.min(), 0.0), max(pulse.u.max(), 0.0)
    margin = 0.08 * (highest - lowest)
    reached = pulse.u[: step + 1]
    ax.fill_between(
        pulse.x, reached.min(axis=0), reached.max(axis=0), color="0.9", label="reached so far"
    )
    ax.plot(pulse.x, pulse.u[step], label="now")
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
    """Where the nodes of a network lie in a drawing."""

    spot: npt.NDArray[
        np.float64
    ]  # distance from the root along the cable [m], and row, 0 and below
    strokes: list[
        npt.NDArray[np.float64]
    ]  # points of each run: x in the first row, y in the second
    closing: npt.NDArray[np.float64] | None  # the same of the run that closes a ring

    @property
    def lowest(self) -> float:
        """Lowest y that is drawn at."""
        everything = [self.spot[:, 1], *([] if self.closing is None else [self.closing[1]])]
        return float(np.concatenate(everything).min())


def layout(network: Network, root: str | None = None) -> Layout:
    """Place a network: lines to scale along x, branches in rows that do not cross."""
    tree = rooted(network, root or next(iter(network.nodes), ""))
    count = len(tree.order)
    length = [float(np.mean(run.length)) for run in network.runs]
    children: list[list[int]] = [[] for _ in range(count)]
    x, reach = [0.0] * count, [0.0] * count
    for place in range(1, count):
        children[tree.parent[place]].append(place)
        x[place] = x[tree.parent[place]] + length[tree.run[place]]
    for place in range(count - 1, 0, -1):
        way = reach[place] + length[tree.run[place]]
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
        a, b = (tree.order.index(network.index(end)) for end in (network.ring.a, network.ring.b))
        below = lowest - 1
        closing = np.array([[x[a], x[a], x[b], x[b]], [row[a], below, below, row[b]]], dtype=float)
    spot = np.empty((count, 2))
    spot[tree.order] = np.transpose([x, row])
    return Layout(spot, strokes, closing)


def plot_network(network: Network, *, root: str | None = None, ax: Axes | None = None) -> Axes:
    """Draw a network: lines to scale along x, loads as dots."""
    ax = axes(ax)
    placed = layout(network, root)
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
