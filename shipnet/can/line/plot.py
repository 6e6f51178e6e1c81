"""Figures of bits on a cable."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes

from shipnet.can.line.waveforms import DOMINANT, RECESSIVE, LineRun
from shipnet.errors import ArgumentError
from shipnet.style import LIMIT

__all__ = ["plot_line"]


def plot_line(run: LineRun, node: str, *, colour: str = "C0", ax: Axes) -> Axes:
    """Draw the voltage at a node, and the bits that it reads.

    Parameters
    ----------
    run : LineRun
        What `send` returned.
    node : str
        Which node.
    colour : str, default "C0"
        Colour of the waveform.
    ax : matplotlib.axes.Axes
        Where to draw.

    Returns
    -------
    matplotlib.axes.Axes
        The axes given; a sample that is read as it was sent is a filled marker, another one a
        cross. The bit read stands above it, ? where either may be read.

    Raises
    ------
    ArgumentError
        If the node is unknown.
    """
    if node not in run.nodes:
        raise ArgumentError(f"node is {node!r}; it must be one of {', '.join(run.nodes)}")
    row = run.nodes.index(node)
    ax.plot(run.t * 1e6, run.v[row], color=colour, label=f"voltage at {node}")
    top = max(run.v[row].max(), DOMINANT)
    for level, name in ((DOMINANT, "dominant"), (RECESSIVE, "recessive")):
        ax.axhline(level, lw=1, color=LIMIT["color"], linestyle=LIMIT["linestyle"])
        above = level == DOMINANT
        ax.annotate(
            name,
            (0, level),
            (3, 2 if above else -2),
            xycoords=("axes fraction", "data"),
            textcoords="offset points",
            color=LIMIT["color"],
            fontsize=7,
            ha="left",
            va="bottom" if above else "top",
        )
    good = run.correct[row]
    for chosen, marker, name in ((good, "o", "sample, right"), (~good, "x", "sample, wrong")):
        if chosen.any():
            ax.plot(
                run.sample_times[chosen] * 1e6,
                run.samples[row, chosen],
                marker,
                color="0.2",
                label=name,
            )
    for when, bit in zip(run.sample_times, run.bits[row], strict=True):
        ax.annotate("?" if bit < 0 else str(bit), (when * 1e6, 1.06 * top), ha="center", fontsize=9)
    ax.set(
        xlabel="time [us]",
        ylabel="voltage [V]",
        xlim=(0, run.t[-1] * 1e6),
        ylim=(min(-0.2, 1.1 * float(np.min(run.v[row]))), 1.2 * top),
    )
    ax.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=3, fontsize=8)
    return ax
