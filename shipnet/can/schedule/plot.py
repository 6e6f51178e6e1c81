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
        The axes given, the highest priority on top, a logarithmic axis of time. A bar that
        passes its deadline is red; without a bound it runs out of the axes and says so.
    """
    y = np.arange(len(table))
    response = table["response_ms"].to_numpy(dtype=float)
    deadline = table["deadline_ms"].to_numpy(dtype=float)
    met = table["met"].to_numpy(dtype=bool)
    finite = np.isfinite(response)
    ends = np.concatenate([response[finite], deadline])
    left, right = (0.5 * ends.min(), 2 * ends.max()) if len(ends) else (0.1, 10.0)
    width = np.where(finite, response, 10 * right)
    for which, colour, label in ((met, "C0", "met"), (~met, LIMIT["color"], "missed")):
        if which.any():
            ax.barh(y[which], width[which], color=colour, alpha=0.45, label=f"response, {label}")
    if len(table):
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
    ax.xaxis.set_major_formatter("{x:g}")
    ax.set_xlim(left, right)
    ax.set_ylim(len(table) - 0.4, -0.6)
    ax.set_yticks(y, [str(name) for name in table["name"]])
    ax.set_xlabel("time [ms]")
    ax.grid(visible=False, axis="y")
    return ax


def plot_load(table: pd.DataFrame, *, ax: Axes, limit: float = 100.0) -> Axes:
    """Draw the load of the bus over the bit rate, from no stuff bits to the most there can be.

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
    ax.fill_between(
        rate,
        table["nominal_percent"].to_numpy(dtype=float),
        table["worst_percent"].to_numpy(dtype=float),
        color="C0", alpha=0.3, linewidth=0, label="no stuff bits to worst case",
    )  # fmt: skip
    mean = table["mean_percent"].to_numpy(dtype=float)
    ax.plot(rate, mean, marker=".", color="C0", label="mean of random data")
    ax.axhline(limit, color=LIMIT["color"], linestyle=LIMIT["linestyle"])
    ax.annotate(
        f"limit {limit:g} %", (1, limit), (-4, 3), xycoords=("axes fraction", "data"),
        textcoords="offset points", ha="right", color=LIMIT["color"],
    )  # fmt: skip
    ax.set_xscale("log")
    ax.set_yscale("log")
    ax.yaxis.set_major_formatter("{x:g}")
    ax.set_xticks(rate, [f"{one:g}" for one in rate])
    ax.minorticks_off()
    ax.set_xlabel("bit rate [kbit/s]")
    ax.set_ylabel("bus load [%]")
    ax.legend()
    return ax
