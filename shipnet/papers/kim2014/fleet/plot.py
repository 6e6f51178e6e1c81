"""Figures of a fleet: one stroke as masters see it, the age of the picture, the life of faults."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes

from shipnet.ballast.simulation import Run
from shipnet.papers.kim2014.fleet.picture import Picture
from shipnet.style import LIMIT

__all__ = ["plot_ages", "plot_seen_strokes"]

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
        oldest = picture.seen.ages(time).max(axis=1)
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
