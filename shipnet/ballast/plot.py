"""Figures of a valve: what its sensors show over a stroke."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.patches import Patch, Rectangle

from shipnet.ballast.sensors import CHANNELS
from shipnet.ballast.simulation import Run
from shipnet.ballast.wear import Trend
from shipnet.style import LIMIT

if TYPE_CHECKING:
    import pandas as pd

    from shipnet.ballast.diagnosis import Diagnosis
    from shipnet.ballast.fleet import FleetReport


#: Ends of the position, which the rule table calls CLOSE and OPEN [%].
_ENDS = {"CLOSE": 0.0, "OPEN": 100.0}


_TITLES = {channel.name: channel for channel in CHANNELS}


def plot_confusion(table: pd.DataFrame, ax: Axes | None) -> Axes:
    """Draw the top fault of each fault as shares of the rows; right ones are framed."""
    ax = plt.gca() if ax is None else ax
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
    ax.set(xlabel="top-ranked fault [% of the row]", ylabel="fault of the valve")
    return ax


def plot_trend(
    trend: Trend,
    x: npt.ArrayLike,
    y: npt.ArrayLike,
    *,
    limit: float,
    ax: Axes | None,
    until: float | None = None,
) -> Axes:
    """Draw points, their trend with its interval, and the limit that it runs to."""
    ax = plt.gca() if ax is None else ax
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


def plot_screen(screen: pd.DataFrame, ax: Axes | None, selected: int | None, columns: int) -> Axes:
    """Draw a bar and a number per valve, coloured by its state, after Figure 11."""
    ax = plt.gca() if ax is None else ax
    units = screen.index.to_numpy()
    wide = min(len(units), columns)
    rows = -(-len(units) // wide)
    size = 9 if wide <= 20 else 6
    places = np.arange(len(units))
    x, y = places % wide, rows - 1 - places // wide
    position, framed = screen["position_percent"].to_numpy(float), units == selected
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


def plot_operation(run: Run, ax: Axes | None, valve: int) -> Axes:
    """Draw all sensors of a valve over time in percent of full scale, after Figure 12."""
    ax = plt.gca() if ax is None else ax
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


def plot_diagnosis(diagnosis: Diagnosis, ax: Axes | None, valve: int) -> Axes:
    """Draw the greatest strength of each rule, active ones coloured, after Figure 13."""
    ax = plt.gca() if ax is None else ax
    base = diagnosis.base
    strength = diagnosis.firing(valve).strength.max(axis=0)
    active = [bool(diagnosis.active[:, valve - 1, place].any()) for place in range(len(base.codes))]
    colours = [LIMIT["color"] if on else "0.75" for on in active]
    places = np.arange(len(base.codes))
    ax.barh(places, strength, color=colours)
    names = [f"{rule.english or rule.flag} ({rule.code})" for rule in base.rules]
    ax.set_yticks(places, names, fontsize="small")
    ax.invert_yaxis()
    ax.axvline(diagnosis.threshold, color="0.3", linestyle=":", linewidth=1)
    ax.set(xlim=(0, 1.02), xlabel="greatest firing strength [-]")
    found = [code for code in base.ranking if active[base.codes.index(code)]]
    others = f", also {', '.join(found[1:])}" if found[1:] else ""
    ax.set_title(
        f"diagnosis: {found[0]}{others}" if found else "diagnosis: normal", loc="left",
        fontsize="medium", color=LIMIT["color"] if found else "C2",
    )  # fmt: skip
    return ax


def plot_history(report: FleetReport, ax: Axes | None) -> Axes:
    """Draw a row per fault: its valve's movements, and in red the time for which nobody knew."""
    ax = plt.gca() if ax is None else ax
    faults, commands = report.faults(), report.commands
    hour = 3600.0
    rows = np.arange(len(faults))
    known = faults["alarm_s"].fillna(report.duration).to_numpy()
    start = faults["start_s"].to_numpy()
    names = []
    for row, (valve, code) in enumerate(faults[["valve", "code"]].itertuples(index=False)):
        names.append(f"{code}, valve {valve}")
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
