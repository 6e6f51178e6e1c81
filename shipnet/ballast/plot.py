"""Figures of a valve: what its sensors show over a stroke."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.patches import Patch, Rectangle

from shipnet.ballast.channels import CHANNELS, rule_limits
from shipnet.ballast.simulation import Run
from shipnet.ballast.trend import Trend
from shipnet.errors import ArgumentError
from shipnet.style import LIMIT

if TYPE_CHECKING:
    import pandas as pd

    from shipnet.ballast.diagnosis import Diagnosis

__all__ = ["STATE_COLOURS", "plot_channel", "plot_confusion", "plot_diagnosis", "plot_operation"]
__all__ += ["plot_screen", "plot_stroke", "plot_trend"]

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


def plot_confusion(table: pd.DataFrame, *, ax: Axes) -> Axes:
    """Draw what was said first of which fault, as shares of the rows.

    Parameters
    ----------
    table : pandas.DataFrame
        What `confusion` returned.
    ax : matplotlib.axes.Axes
        Where to draw; 7.5 x 4 inches are enough for all faults.

    Returns
    -------
    matplotlib.axes.Axes
        The axes given: one row a fault, one column a headline, percent in every cell above 0; right
        ones are framed.
    """
    count = table.to_numpy(float)
    total = count.sum(axis=1, keepdims=True)
    share = np.divide(count, total, out=np.zeros_like(count), where=total > 0)
    ax.imshow(share, cmap="Blues", vmin=0, vmax=1, aspect="auto", interpolation="nearest")
    for (row, column), value in np.ndenumerate(share):
        right = table.index[row] == table.columns[column]
        if right:
            ax.add_patch(
                Rectangle((column - 0.5, row - 0.5), 1, 1, fill=False, edgecolor="0.3", linewidth=1)
            )
        if value > 0:
            ax.text(
                column, row, f"{100 * value:.0f}" if value >= 0.005 else "<1", fontsize=8,
                ha="center", va="center", color="white" if value > 0.6 else "0.1",
            )  # fmt: skip
    ax.set_xticks(range(len(table.columns)), [str(name) for name in table.columns], fontsize=8)
    ax.set_yticks(range(len(table.index)), [str(name) for name in table.index], fontsize=8)
    ax.set_xticks(np.arange(len(table.columns) - 1) + 0.5, minor=True)
    ax.set_yticks(np.arange(len(table.index) - 1) + 0.5, minor=True)
    ax.grid(visible=False)
    ax.grid(visible=True, which="minor", color="0.88")
    ax.tick_params(which="both", length=0)
    ax.set(xlabel="headline of the diagnosis [% of the row]", ylabel="fault of the valve")
    return ax


def plot_trend(
    trend: Trend,
    x: npt.ArrayLike,
    y: npt.ArrayLike,
    *,
    limit: float,
    ax: Axes,
    until: float | None = None,
) -> Axes:
    """Draw points, their trend with its interval, and the limit that it runs to.

    Parameters
    ----------
    trend : Trend
        What `fit_trend` made of the points, or of some of them.
    x, y : array_like of float, shape (n,)
        The points.
    limit : float
        Limit, on the scale of the points.
    ax : matplotlib.axes.Axes
        Where to draw.
    until : float, optional
        Where the line ends; a quarter beyond the crossing, or beyond the points, if omitted.

    Returns
    -------
    matplotlib.axes.Axes
        The axes given; without a trend there is no line, and the legend says so. The scale of y is
        logarithmic for a log-linear trend. Labels of the axes are the caller's.
    """
    places, values = np.asarray(x, float), np.asarray(y, float)
    ax.plot(places, values, ".", color="C0", markersize=3, label="read")
    ax.axhline(limit, **LIMIT, linewidth=1, label="limit")  # type: ignore[arg-type]
    found = trend.crossing(limit)
    first, last = float(places.min()), float(places.max())
    if trend.found:
        # A crossing far away, or in the past, does not set the scale.
        far = first + 5 * (last - first)
        end = found.estimate if last < found.estimate < far else last
        stop = until if until is not None else end + 0.25 * (end - first)
        grid = np.linspace(first, stop, 200)
        low, high = trend.band(grid)
        ax.plot(grid, trend.at(grid), color="C2", label="trend")
        share = f"{100 * trend.confidence:g} % of it"
        ax.fill_between(grid, low, high, color="C2", alpha=0.25, linewidth=0, label=share)
        ax.set_xlim(first, stop)
        if found.estimate <= stop:
            ends = np.array([[found.estimate - found.low], [found.high - found.estimate]])
            ax.errorbar(
                [found.estimate], [limit], xerr=np.clip(ends, 0, stop), fmt="o", color="C2",
                capsize=4, markersize=5, label="end of life",
            )  # fmt: skip
    else:
        ax.plot([], [], " ", label="no trend")
    if trend.method == "log-linear":
        ax.set_yscale("log")
    ax.legend(fontsize=8)
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


#: Colour of each state on the master's screen.
STATE_COLOURS = {
    "open": "C2",
    "closed": "C0",
    "part open": "C9",
    "moving": "C1",
    "fault": LIMIT["color"],
    "silent": "0.35",
    "not seen": "0.8",
}

#: What 100 % of the operating display is for each sensor, in its unit.
_FULL = {"FP": 160.0, "OP": 10.0, "MC": 6.0, "OT": 150.0, "VPos": 100.0}


def plot_screen(
    screen: pd.DataFrame, *, ax: Axes, chosen: int | None = None, columns: int = 32
) -> Axes:
    """Draw the master's screen: a bar and a number for each valve, coloured by its state.

    Parameters
    ----------
    screen : DataFrame
        As `MasterRun.screen` returns it.
    ax : matplotlib.axes.Axes
        Where to draw; half an inch for each row of valves is high enough.
    chosen : int, optional
        Unit id of a valve that is framed.
    columns : int, default 32
        Most valves in a row.

    Returns
    -------
    matplotlib.axes.Axes
        The axes given, with a legend of the states that occur.

    Notes
    -----
    After Figure 11 of the paper as its text tells it; the figure was not available.
    """
    units = screen.index.to_numpy()
    wide = min(len(units), columns)
    rows = -(-len(units) // wide)
    size = 9 if wide <= 20 else 6
    places = np.arange(len(units))
    x, y = places % wide, rows - 1 - places // wide
    position, framed = screen["position_percent"].to_numpy(float), units == chosen
    colours = [STATE_COLOURS[state] for state in screen["state"]]
    ax.bar(
        x, 0.62, 0.84, y, color="0.94", linewidth=np.where(framed, 2.0, 0.5),
        edgecolor=["k" if frame else "0.7" for frame in framed],
    )  # fmt: skip
    part = 0.62 * np.clip(np.nan_to_num(position), 0, 100) / 100
    # A strip of colour is left of a closed valve.
    ax.bar(x, np.maximum(part, 0.05), 0.84, y, color=colours)
    for place, unit in enumerate(units):
        said = "-" if np.isnan(position[place]) else f"{position[place]:.0f}"
        where = x[place], y[place]
        texts = (
            ax.text(where[0], where[1] + 0.33, said, ha="center", va="center", fontsize=size),
            ax.text(
                where[0], where[1] - 0.04, str(unit), ha="center", va="top", fontsize=size - 1,
                color="0.4",
            ),
        )  # fmt: skip
        for text in texts:
            # It stands within the axes, and hundreds of them take their time to measure.
            text.set_in_layout(False)
    ax.set(xlim=(-0.6, wide - 0.4), ylim=(-0.35, rows - 0.25), xticks=[], yticks=[])
    ax.grid(False)
    for spine in ax.spines.values():
        spine.set_visible(False)
    present = [state for state in STATE_COLOURS if (screen["state"] == state).any()]
    handles = [Patch(color=STATE_COLOURS[state], label=state) for state in present]
    ax.legend(
        handles=handles, loc="lower left", bbox_to_anchor=(0, 1), ncols=len(handles), frameon=False,
        fontsize="small",
    )  # fmt: skip
    ax.text(
        1, 1.02, "position [%]", transform=ax.transAxes, ha="right", va="bottom", fontsize="small"
    )
    return ax


def plot_operation(run: Run, *, ax: Axes, valve: int = 0) -> Axes:
    """Draw all sensors of a valve over time on one pair of axes, in percent of full scale.

    Parameters
    ----------
    run : Run
        What was read.
    ax : matplotlib.axes.Axes
        Where to draw.
    valve : int, default 0
        Which valve.

    Returns
    -------
    matplotlib.axes.Axes
        The axes given; times while the motor runs are shaded.

    Notes
    -----
    After Figure 12 of the paper as its text tells it; the figure was not available. The scales are
    ours: 160 bar, 10 bar, 6 A, 150 degC.
    """
    frame = run.valve(valve)
    ax.fill_between(
        frame.index, 0, 1, where=frame["running"].to_numpy(), transform=ax.get_xaxis_transform(),
        color="0.92", zorder=0, step="post", linewidth=0, label="motor runs",
    )  # fmt: skip
    for place, channel in enumerate(CHANNELS):
        full = _FULL[channel.name]
        said = f"{channel.name}, 100 % = {full:g} {channel.unit}"
        if channel.name == "VPos":
            said = "VPos"
        ax.plot(frame.index, 100 * frame[channel.column] / full, color=f"C{place}", label=said)
    ax.set(xlabel="time [s]", ylabel="of full scale [%]")
    ax.legend(loc="upper left", bbox_to_anchor=(1, 1), fontsize="small", frameon=False)
    return ax


def plot_diagnosis(diagnosis: Diagnosis, *, ax: Axes, valve: int = 0) -> Axes:
    """Draw what is shown after a command: the greatest strength of each rule, and the finding.

    Parameters
    ----------
    diagnosis : Diagnosis
        Of a run with the command in it.
    ax : matplotlib.axes.Axes
        Where to draw.
    valve : int, default 0
        Which valve.

    Returns
    -------
    matplotlib.axes.Axes
        The axes given; rules that were active are coloured, the first of them is named above.

    Notes
    -----
    After Figure 13 of the paper as its text tells it; the figure was not available.
    """
    base = diagnosis.base
    strength = diagnosis.firing(valve).strength.max(axis=0)
    active = [bool(diagnosis.active[:, valve, place].any()) for place in range(len(base.codes))]
    colours = [LIMIT["color"] if on else "0.75" for on in active]
    places = np.arange(len(base.codes))
    ax.barh(places, strength, color=colours)
    names = [f"{rule.english or rule.flag} ({rule.code})" for rule in base.rules]
    ax.set_yticks(places, names, fontsize="small")
    ax.invert_yaxis()
    ax.axvline(diagnosis.cut, color="0.3", linestyle=":", linewidth=1)
    ax.set(xlim=(0, 1.02), xlabel="greatest firing strength [-]")
    found = [code for code in base.ranking if active[base.codes.index(code)]]
    others = f", also {', '.join(found[1:])}" if found[1:] else ""
    ax.set_title(
        f"diagnosis: {found[0]}{others}" if found else "diagnosis: normal", loc="left",
        fontsize="medium", color=LIMIT["color"] if found else "C2",
    )  # fmt: skip
    return ax
