"""Figures of a fleet: one stroke as masters see it, the age of the picture, the life of faults."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes

from shipnet.ballast.fleet import FleetReport
from shipnet.ballast.simulation import Run
from shipnet.papers.kim2014.fleet.picture import Picture
from shipnet.style import LIMIT

__all__ = ["plot_ages", "plot_history", "plot_seen_strokes"]

_MARKS = ".o^sD"


def plot_seen_strokes(true: Run, seen: Mapping[int, Run], *, ax: Axes) -> Axes:
    """Draw the position of a valve as it is, and as masters with so many valves were sent it.

    Parameters
    ----------
    true : Run
        The valve itself, its command given at the same time.
    seen : mapping of int to Run
        As `seen_strokes` returns them.
    ax : matplotlib.axes.Axes
        Where to draw.

    Returns
    -------
    matplotlib.axes.Axes
        The axes given; one marker for each status that came.
    """
    ax.plot(true.time, true.VPos[:, 0], color="0.6", linewidth=1, label="the valve itself")
    for place, (number, run) in enumerate(seen.items()):
        ax.plot(
            run.time, run.VPos[:, 0], _MARKS[place % len(_MARKS)], color=f"C{place}",
            markersize=4 + 2 * place, label=f"master of {number}",
        )  # fmt: skip
    ax.set(xlabel="time [s]", ylabel="position [%]")
    ax.legend(loc="lower right")
    return ax


def plot_ages(pictures: Mapping[str, Picture], *, ax: Axes, start: float) -> Axes:
    """Draw how old the oldest position on the screen is.

    Parameters
    ----------
    pictures : mapping of str to Picture
        Such as from `broken_loops`, all of one duration.
    ax : matplotlib.axes.Axes
        Where to draw.
    start : float
        When the loop breaks [s], drawn as a dashed line.

    Returns
    -------
    matplotlib.axes.Axes
        The axes given; a line begins when every valve has been heard.
    """
    for place, (name, picture) in enumerate(pictures.items()):
        time = np.arange(0.0, picture.seen.duration, 0.1)
        oldest = picture.seen.age(time).max(axis=1)
        ax.plot(
            time, np.where(np.isfinite(oldest), oldest, np.nan), color=f"C{place}", label=name,
            linewidth=5 - 0.8 * place, alpha=0.9,
        )  # fmt: skip
    ax.axvline(start, linewidth=1, color=LIMIT["color"], linestyle=LIMIT["linestyle"])
    ax.annotate(
        " the loop breaks", (start, 0.95), xycoords=ax.get_xaxis_transform(), va="top",
        color=LIMIT["color"], fontsize=8,
    )  # fmt: skip
    ax.set(xlabel="time [s]", ylabel="oldest position shown [s]", ylim=(0, None))
    ax.legend(loc="upper left", bbox_to_anchor=(1, 1), frameon=False)
    return ax


def plot_history(report: FleetReport, *, ax: Axes) -> Axes:
    """Draw when each fault appeared, when its valve was moved, and when it was reported.

    Parameters
    ----------
    report : FleetReport
        What `shipnet.ballast.fleet.watch` returned, with a fault or more.
    ax : matplotlib.axes.Axes
        Where to draw.

    Returns
    -------
    matplotlib.axes.Axes
        The axes given: one row a fault, in order of their time; the red line is the time for which
        nobody knew, and reaches the end if nobody ever did.
    """
    faults, commands = report.faults, report.commands
    hour = 3600.0
    rows = np.arange(len(faults))
    known = faults["alarm_s"].fillna(report.duration).to_numpy()
    start = faults["start_s"].to_numpy()
    names = []
    for row, (valve, code) in enumerate(faults[["valve", "code"]].itertuples(index=False)):
        names.append(f"{code}, valve {valve + 1}")
        moved = commands.loc[commands["valve"] == valve, "start_s"] / hour
        ax.plot(
            moved, np.full(len(moved), row), "|", color="0.55", markersize=11,
            label="_" if row else "valve is moved",
        )  # fmt: skip
    ax.hlines(rows, start / hour, known / hour, color=LIMIT["color"], linewidth=3, label="unknown")
    ax.plot(start / hour, rows, "o", color=LIMIT["color"], markersize=5, label="fault appears")
    found = faults["alarm_s"].notna().to_numpy()
    ax.plot(known[found] / hour, rows[found], "D", color="C2", markersize=6, label="reported")
    ax.set_yticks(rows, names, fontsize="small")
    ax.invert_yaxis()
    ax.set(xlabel="time [h]", xlim=(0, report.duration / hour))
    ax.legend(loc="lower left", bbox_to_anchor=(0, 1), ncols=4, frameon=False, fontsize="small")
    return ax
