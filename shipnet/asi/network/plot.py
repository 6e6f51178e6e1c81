"""Figures of planned installations."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.markers import CARETUP

from shipnet.asi.network.electrical import segment_network
from shipnet.asi.network.plan import Plan
from shipnet.line.plot import layout
from shipnet.style import LIMIT

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["plot_plan"]

Spot = npt.NDArray[np.float64]

#: Marker, colour and size by the name in the legend, the last ones drawn on top.
_MARKS: dict[str, tuple[Any, str, int]] = {
    "supply": (CARETUP, "C4", 12),
    "master": ("s", "0.2", 7),
    "repeater": ("D", "C1", 6),
    "terminator": ("|", "0.2", 14),
    "slave": ("o", "C0", 4),
    "slave, passed": ("o", "C2", 4),
    "slave, failed": ("o", LIMIT["color"], 4),
}

#: Most slaves that are named one by one.
_NAMED = 12


def plot_plan(plan: Plan, table: pd.DataFrame | None = None, *, ax: Axes) -> Axes:
    """Draw a plan to scale along the cable, the slaves in the colour of their verdict.

    Parameters
    ----------
    plan : Plan
        The plan; its lines lie one below the other.
    table : pandas.DataFrame, optional
        What `check` returned: a slave with a rule not passed is red, a segment with one has red
        cable. Without it nothing is judged.
    ax : matplotlib.axes.Axes
        Where to draw.

    Returns
    -------
    matplotlib.axes.Axes
        The axes given; x is the distance from the master along the cable. A cable that closes a
        ring is dashed, a repeater is joined to both of its nodes. Few slaves are named.

    Examples
    --------
    >>> from matplotlib.figure import Figure
    >>> from shipnet.asi.network.structures import line
    >>> ax = plot_plan(line(100, [40, 100]), ax=Figure().subplots())
    >>> ax.get_xlabel(), [text.get_text() for text in ax.texts]
    ('distance from the master [m]', ['1', '2'])
    """
    failed = set() if table is None else set(table.loc[~table["passed"], "object"])
    points: dict[str, list[Spot]] = {kind: [] for kind in _MARKS}
    places: dict[str, Spot] = {}
    top = 0.0
    for segment in plan.segments:
        network = segment_network(segment)
        placed = layout(network, segment.head)
        origin = np.array([segment.lead, top])
        places |= dict(zip(network.nodes, placed.spot + origin, strict=True))
        colour = LIMIT["color"] if str(segment) in failed else "0.6"
        for stroke in placed.strokes:
            ax.plot(*(stroke + origin[:, np.newaxis]), color=colour, zorder=1)
        if placed.closing is not None:
            ax.plot(*(placed.closing + origin[:, np.newaxis]), "--", color=colour, zorder=1)
        top += placed.lowest - 1.5
    for master in plan.masters:
        points["master"].append(places[master.node])
    for supply in plan.supplies:
        points["supply"].append(places[supply.node])
    for terminator in plan.terminators:
        points["terminator"].append(places[terminator.node])
    for repeater in plan.repeaters:
        ends = np.array([places[repeater.a], places[repeater.b]])
        ax.plot(*ends.T, ":", color="C1", zorder=1)
        # Clear of the branches that hang on the upper one.
        points["repeater"].append(ends[ends[:, 1].argmin()] + [0, 0.75])
    for slave in plan.slaves:
        verdict = (
            "slave" if table is None else f"slave, {'failed' if str(slave) in failed else 'passed'}"
        )
        points[verdict].append(places[slave.node])
    if len(plan.slaves) <= _NAMED:
        for node in dict.fromkeys(slave.node for slave in plan.slaves):
            labels = " ".join(slave.label for slave in plan.slaves if slave.node == node)
            ax.annotate(
                labels, tuple(places[node]), (0, 6), textcoords="offset points",
                ha="center", fontsize=8,
            )  # fmt: skip
    for label, (marker, colour, size) in _MARKS.items():
        if points[label]:
            x, y = np.transpose(points[label])
            ax.plot(
                x, y, marker=marker, color=colour, markersize=size, linestyle="none", label=label
            )
    ax.set(
        xlabel="distance from the master [m]", yticks=[], ylim=(1.04 * top + 0.7, 0.8 - 0.04 * top)
    )
    ax.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=6, fontsize=8)
    return ax
