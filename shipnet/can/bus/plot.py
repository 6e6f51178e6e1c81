"""Figures of what happened on a bus."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes

from shipnet.can.bus.simulation import BusRun
from shipnet.errors import ArgumentError
from shipnet.style import LIMIT

__all__ = ["plot_gantt"]


def plot_gantt(
    run: BusRun, begin: float = 0.0, end: float | None = None, *, colour: str = "C0", ax: Axes
) -> Axes:
    """Draw who was on the bus when: a lane a message, the highest priority on top.

    Parameters
    ----------
    run : BusRun
        What `simulate` returned.
    begin, end : float, optional
        Part to draw [s]; to the end of the last frame by default.
    colour : str, default "C0"
        Colour of the frames.
    ax : matplotlib.axes.Axes
        Where to draw.

    Returns
    -------
    matplotlib.axes.Axes
        The axes given: frames are bars, the wait from release to start a thin line, a frame
        destroyed by an error with its error frame a red bar, and a release overwritten a cross.

    Raises
    ------
    ArgumentError
        If `begin` does not lie before `end`.
    """
    frames, errors = run.transmissions, run.errors
    names = run.statistics["message"].tolist()
    last = np.nanmax([0.0, *frames["end_ms"], *errors["free_ms"]])
    low, high = 1e3 * begin, last if end is None else 1e3 * end
    if not low < high:
        raise ArgumentError(f"begin is {begin} s; it must lie before end, {high / 1e3:g} s")
    stop = frames["end_ms"].fillna(high)
    shown = frames[(frames["release_ms"] < high) & (stop > low)]
    sent = shown[shown["outcome"] == "sent"]
    lost = shown[shown["outcome"] == "overwritten"]
    waits = shown[shown["outcome"] != "overwritten"]
    failed = errors[(errors["start_ms"] < high) & (errors["free_ms"] > low)]
    lane = {name: row for row, name in enumerate(names)}
    rows = waits["message"].astype(object).map(lane)
    ax.hlines(
        rows, waits["release_ms"], waits["start_ms"].fillna(high), color="0.45", lw=1, zorder=0.5
    )
    ax.barh(
        sent["message"].astype(object).map(lane),
        sent["end_ms"] - sent["start_ms"],
        left=sent["start_ms"],
        height=0.6,
        color=colour,
        edgecolor="white",
        linewidth=0.5,
        label="frame",
    )
    if len(failed):
        ax.barh(
            failed["message"].map(lane),
            failed["free_ms"] - failed["start_ms"],
            left=failed["start_ms"],
            height=0.6,
            color=LIMIT["color"],
            edgecolor="white",
            linewidth=0.5,
            label="error",
        )
    if len(lost):
        ax.plot(
            lost["release_ms"],
            lost["message"].astype(object).map(lane),
            marker="x",
            color="0.2",
            linestyle="none",
            label="overwritten",
        )
    ax.plot([], [], color="0.45", lw=1, label="waiting")
    ax.set(xlabel="time [ms]", xlim=(low, high), ylim=(len(names) - 0.4, -0.6))
    ax.set_yticks(range(len(names)), names)
    ax.grid(axis="y", visible=False)
    ax.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=4, fontsize=8)
    return ax
