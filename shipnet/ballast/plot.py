"""Figures of a valve: what its sensors show over a stroke."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes

from shipnet.ballast.channels import CHANNELS, rule_limits
from shipnet.ballast.simulation import Run
from shipnet.errors import ArgumentError
from shipnet.style import LIMIT

__all__ = ["plot_channel", "plot_stroke"]

#: Ends of the position, which the rule table calls CLOSE and OPEN [%].
_ENDS = {"CLOSE": 0.0, "OPEN": 100.0}

_TITLES = {channel.name: channel for channel in CHANNELS}


def plot_channel(run: Run, channel: str, *, ax: Axes, valve: int = 0, limits: bool = True) -> Axes:
    """Draw one sensor of a valve over time.

    Parameters
    ----------
    run : Run
        What was read.
    channel : str
        FP, OP, MC, OT or VPos.
    ax : matplotlib.axes.Axes
        Where to draw.
    valve : int, default 0
        Which valve.
    limits : bool, default True
        Whether the limits of the rule table are drawn, dashed and with the codes that use them.

    Returns
    -------
    matplotlib.axes.Axes
        The axes given; times while the motor runs are shaded.

    Raises
    ------
    ArgumentError
        If there is no such channel.
    """
    if channel not in _TITLES:
        raise ArgumentError(f"channel is {channel!r}; it must be one of {', '.join(_TITLES)}")
    known = _TITLES[channel]
    frame = run.valve(valve)
    ax.plot(frame.index, frame[known.column], color="C0", linewidth=1)
    on = frame["running"].to_numpy()
    ax.fill_between(
        frame.index, 0, 1, where=on, transform=ax.get_xaxis_transform(), color="0.92", zorder=0,
        step="post", linewidth=0,
    )  # fmt: skip
    if limits:
        lines: dict[float, list[str]] = {}
        for limit in rule_limits():
            if limit.channel == channel:
                lines.setdefault(limit.value, []).extend(limit.codes)
        if channel == "VPos":
            lines = {value: [name] for name, value in _ENDS.items()}
        for value, names in lines.items():
            ax.axhline(value, linewidth=1, color=LIMIT["color"], linestyle=LIMIT["linestyle"])
            ax.annotate(
                " ".join(dict.fromkeys(names)), (1, value), (-3, 2), ha="right", fontsize=7,
                xycoords=ax.get_yaxis_transform(), textcoords="offset points", color=LIMIT["color"],
            )  # fmt: skip
        # Room above the highest line, so that its codes stay within the axes.
        top = max([*lines, float(np.nanmax(frame[known.column]))])
        ax.set_ylim(top=max(ax.get_ylim()[1], 1.15 * top))
    ax.set(xlabel="time [s]", ylabel=f"{channel} [{known.unit}]")
    return ax


def plot_stroke(run: Run, *, axes: Sequence[Axes], valve: int = 0) -> Sequence[Axes]:
    """Draw FP, OP, MC and VPos of a valve, one above the other.

    Parameters
    ----------
    run : Run
        What was read.
    axes : sequence of four matplotlib.axes.Axes
        Where to draw, as ``subplots(4, sharex=True)`` returns them; 5 inches are high enough.
    valve : int, default 0
        Which valve.

    Returns
    -------
    sequence of matplotlib.axes.Axes
        The axes given.

    Raises
    ------
    ArgumentError
        If there are not four axes.
    """
    if len(axes) != 4:
        raise ArgumentError(f"axes has {len(axes)} axes; it must have 4")
    for channel, ax in zip(("FP", "OP", "MC", "VPos"), axes, strict=True):
        plot_channel(run, channel, ax=ax, valve=valve)
    for ax in axes[:-1]:
        ax.set_xlabel("")
    return axes
