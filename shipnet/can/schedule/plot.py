"""Figures of schedules."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes

from shipnet.style import LIMIT

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["plot_load", "plot_response_times"]


def plot_response_times(table: pd.DataFrame, *, ax: Axes) -> Axes:
    """Draw the longest response of each message as a bar, its deadline as a red mark.

    Parameters
    ----------
    table : pandas.DataFrame
        What `response_table` returned.
    ax : matplotlib.axes.Axes
        Where to draw.

    Returns
    -------
    matplotlib.axes.Axes
        The axes given, the highest priority on top, a logarithmic axis of time. The dark part of a
        bar is the message's own frame. A bar that passes its deadline is red; without a bound it
        runs out of the axes and says so.
    """
    y = np.arange(len(table))
    response = table["response_ms"].to_numpy(dtype=float)
    deadline = table["deadline_ms"].to_numpy(dtype=float)
    frame = table["frame_ms"].to_numpy(dtype=float)
    met = table["met"].to_numpy(dtype=bool)
    finite = np.isfinite(response)
    ends = np.concatenate([response[finite], deadline, frame])
    left, right = (0.5 * ends.min(), 2 * ends.max()) if len(ends) else (0.1, 10.0)
    width = np.where(finite, response, 10 * right)
    for which, colour, label in ((met, "C0", "met"), (~met, LIMIT["color"], "missed")):
        if which.any():
            ax.barh(y[which], width[which], color=colour, alpha=0.45, label=f"response, {label}")
    if len(table):
        ax.barh(y, frame, color="0.35", label="own frame")
        ax.plot(
            deadline, y, linestyle="none", marker="|", markersize=14, markeredgewidth=2.5,
            color=LIMIT["color"], label="deadline",
        )  # fmt: skip
        ax.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=4, frameon=False)
    for place in y[~finite]:
        ax.text(
            right, float(place), "no bound ", ha="right", va="center", color="0.1", fontsize="small"
        )
    ax.set_xscale("log")
    ax.set_xlim(left, right)
    ax.set_ylim(len(table) - 0.4, -0.6)
    ax.set_yticks(y, [str(name) for name in table["name"]])
    ax.set_xlabel("time [ms]")
    ax.grid(visible=False, axis="y")
    return ax


#: Colours of the ways of counting.
_WAYS = {"nominal": "0.6", "mean": "C2", "attainable": "C1", "worst": "C0"}


def plot_load(table: pd.DataFrame, *, ax: Axes, limit: float = 100.0) -> Axes:
    """Draw the load of the bus over the bit rate, one line a way to count stuff bits.

    Parameters
    ----------
    table : pandas.DataFrame
        What `load_table` returned.
    ax : matplotlib.axes.Axes
        Where to draw.
    limit : float, default 100
        Load that is not to be passed, drawn as a red dashed line [%].

    Returns
    -------
    matplotlib.axes.Axes
        The axes given, both axes logarithmic.
    """
    rate = table["bit_rate"].to_numpy(dtype=float) / 1e3
    for way, colour in _WAYS.items():
        load = table[f"{way}_percent"].to_numpy(dtype=float)
        ax.plot(rate, load, marker=".", color=colour, label=way)
    ax.axhline(limit, color=LIMIT["color"], linestyle=LIMIT["linestyle"])
    ax.annotate(
        f"limit {limit:g} %", (1, limit), (-4, 3), xycoords=("axes fraction", "data"),
        textcoords="offset points", ha="right", color=LIMIT["color"],
    )  # fmt: skip
    ax.set_xscale("log")
    ax.set_yscale("log")
    ax.set_xticks(rate, [f"{one:g}" for one in rate])
    ax.minorticks_off()
    ax.set_xlabel("bit rate [kbit/s]")
    ax.set_ylabel("bus load [%]")
    ax.legend(title="stuff bits")
    return ax
