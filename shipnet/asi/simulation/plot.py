"""Drawings of plans, of the traffic on a line, and of the receive states of a slave."""

from __future__ import annotations

from collections import defaultdict
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.markers import CARETUP
from matplotlib.patches import FancyArrowPatch, Rectangle

from shipnet import style
from shipnet.asi.simulation.states import TRANSITIONS, Action, Event, State
from shipnet.asi.telegram import REQUEST_BITS, RESPONSE_BITS
from shipnet.asi.timing import BIT_TIME
from shipnet.errors import ArgumentError
from shipnet.line.plot import axes, layout
from shipnet.style import LIMIT

if TYPE_CHECKING:
    import pandas as pd

    from shipnet.answers import Findings
    from shipnet.asi.plan import Plan

#: Requests and slaves that one figure can show.
_MOST_REQUESTS, _MOST_SLAVES = 500, 64


def plot_exchange(
    transactions: pd.DataFrame,
    *,
    ax: Axes,
    start: float | None = None,
    stop: float | None = None,
    bit_time: float = BIT_TIME,
) -> Axes:
    """Draw requests and responses as blocks in time, one row for the master and one a slave.

    Parameters
    ----------
    transactions : pandas.DataFrame
        What `Simulation.transactions` holds.
    ax : matplotlib.axes.Axes
        Where to draw.
    start, stop : float, optional
        What to show, from the start of the simulation [s]; all if omitted.
    bit_time : float, default 6e-6
        Length of a bit [s].

    Returns
    -------
    matplotlib.axes.Axes
        The axes given; x is in milliseconds. A response with an error is red, and so is the
        place where one is missing; a repeated request is hatched, with its number on it.

    Raises
    ------
    ArgumentError
        If there is nothing to show, or more than 500 requests.
    """
    keep = transactions["time_s"] >= (0.0 if start is None else start)
    if stop is not None:
        keep &= transactions["time_s"] < stop
    shown = transactions[keep]
    if not 1 <= len(shown) <= _MOST_REQUESTS:
        raise ArgumentError(
            f"start and stop show {len(shown)} requests; a figure shows 1 to {_MOST_REQUESTS}"
        )
    slaves = shown.sort_values(["address", "half"], kind="stable")["slave"].unique()
    row = {slave: place + 1 for place, slave in enumerate(slaves)}
    bit = 1e3 * bit_time
    for one in shown.to_dict("records"):
        begin, place = 1e3 * one["time_s"], row[one["slave"]]
        again = one["attempt"] > 0
        ax.add_patch(
            Rectangle(
                (begin, -0.4), REQUEST_BITS * bit, 0.8, facecolor=style.FIELD["address"],
                edgecolor="0.3", linewidth=0.5, hatch="////" if again else None,
            )
        )  # fmt: skip
        if again:
            ax.text(
                begin + REQUEST_BITS * bit / 2, -0.5, str(one["attempt"]), ha="center",
                va="bottom", fontsize=7,
            )  # fmt: skip
        fine, pause = one["outcome"] == "ok", one["master_pause_bit"]
        if fine and pause != pause:
            continue  # a call without an answer
        # Where nothing came, the first place at which it could have come stays marked.
        heard = pause == pause
        offset = REQUEST_BITS + (pause if heard else 2.0)
        ax.add_patch(
            Rectangle(
                (begin + offset * bit, place - 0.4), RESPONSE_BITS * bit, 0.8,
                facecolor=style.FIELD["information"] if fine else style.LIMIT["color"],
                edgecolor="0.3", linewidth=0.5, alpha=1.0 if heard else 0.35,
                linestyle="-" if heard else ":",
            )
        )  # fmt: skip
    last = shown.iloc[-1]
    end = last["time_s"] + (REQUEST_BITS + 10 + RESPONSE_BITS) * bit_time
    ax.set(xlim=(1e3 * shown["time_s"].iloc[0] - bit, 1e3 * end), ylim=(len(row) + 0.6, -0.8))
    ax.set_yticks(range(len(row) + 1), ["master", *(f"slave {slave}" for slave in row)])
    ax.set_xlabel("time [ms]")
    ax.grid(visible=False)
    return ax


#: Middle of each state's box; half its width and height, and how far arrows keep from its middle.
_X = {State.ASYNCHRONOUS: 0.0, State.RECEIVE: 6.0, State.SYNCHRONOUS: 12.0}
_HALF_WIDTH, _HALF_HEIGHT, _LANE = 1.2, 0.5, 0.22


def plot_states(*, ax: Axes) -> Axes:
    """Draw the receive states of a slave from their table: the figure that icn2007 calls 3.19.

    Parameters
    ----------
    ax : matplotlib.axes.Axes
        Where to draw.

    Returns
    -------
    matplotlib.axes.Axes
        The axes given: a box a state, an arrow from state to state with the events that lead
        along it, and behind a stroke what the slave does.
    """
    for state, x in _X.items():
        ax.add_patch(
            Rectangle(
                (x - _HALF_WIDTH, -_HALF_HEIGHT), 2 * _HALF_WIDTH, 2 * _HALF_HEIGHT,
                facecolor=style.FIELD["address"], edgecolor="0.3",
            )
        )  # fmt: skip
        ax.text(x, 0, state.value.upper(), ha="center", va="center", fontsize=8)
    words = defaultdict(list)
    for (state, event), step in TRANSITIONS.items():
        # A pause after a response is a pause: where any will do, it need not be named.
        if event is Event.SLAVE_PAUSE and (state, Event.PAUSE) in TRANSITIONS:
            continue
        doing = "" if step.action is Action.NONE else f" / {step.action.value}"
        words[state, step.state].append(event.value + doing)
    for (begin, end), said in words.items():
        # Arrows out of RECEIVE run above those back to it, with their words outside.
        lane = _LANE if begin is State.RECEIVE else -_LANE
        side = 1 if _X[end] > _X[begin] else -1
        x0, x1 = _X[begin] + side * _HALF_WIDTH, _X[end] - side * _HALF_WIDTH
        ax.add_patch(
            FancyArrowPatch(
                (x0, lane), (x1, lane), arrowstyle="-|>", mutation_scale=12, color="0.3",
                shrinkA=0, shrinkB=0,
            )
        )  # fmt: skip
        ax.text(
            (x0 + x1) / 2, lane + (0.08 if lane > 0 else -0.08), "\n".join(said), ha="center",
            va="bottom" if lane > 0 else "top", fontsize=7,
        )  # fmt: skip
    return style.bare(ax, (-1.4, 13.4), (-0.9, 1.6))


# Plans -----------------------------------------------------------------------------------------

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


def plot_plan(plan: Plan, findings: Findings | None = None, *, ax: Axes | None = None) -> Axes:
    """Draw a plan to scale along the cable, the slaves in the colour of their verdict.

    A slave with a rule not met is red, a segment with one has red cable. A cable that closes a
    ring is dashed, a repeater is joined to both of its nodes. Few slaves are named.
    """
    ax = axes(ax)
    table = None if findings is None else findings.table()
    failed = set() if table is None else set(table.loc[table["verdict"] != "met", "object"])
    points: dict[str, list[Spot]] = {kind: [] for kind in _MARKS}
    places: dict[str, Spot] = {}
    top = 0.0
    for segment in plan.segments:
        network = segment.network
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
