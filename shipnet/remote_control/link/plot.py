"""Figures of the link: whose turn it is in time, and what becomes of its margins."""

from __future__ import annotations

from typing import TYPE_CHECKING

from matplotlib.axes import Axes
from matplotlib.patches import Patch, Rectangle

from shipnet import style
from shipnet.errors import ArgumentError
from shipnet.remote_control.signals import STATIONS

if TYPE_CHECKING:
    import pandas as pd

    from shipnet.remote_control.link.result import LinkRun

__all__ = ["plot_margins", "plot_time_chart"]

#: Packets that one figure can show.
_MOST_PACKETS = 500


def plot_time_chart(
    run: LinkRun, *, ax: Axes, start: float = 0.0, stop: float | None = None
) -> Axes:
    """Draw the packets of each station in time, as Fig. 2 of chung1998.

    Its own drawing is not in the text that we have.

    Parameters
    ----------
    run : LinkRun
        What `simulate` returned.
    ax : matplotlib.axes.Axes
        Where to draw.
    start, stop : float, optional
        What to show [s]; all if omitted.

    Returns
    -------
    matplotlib.axes.Axes
        The axes given, a row a station. A packet is a block in the row of its sender, filled by
        whom it goes to, with an arrow to its receiver where that read it; one that is lost is
        hatched. A red triangle marks a partner taken as failed, with its name.

    Raises
    ------
    ArgumentError
        If there is no packet to show, or more than 500.
    """
    end = run.duration if stop is None else stop
    shown = [p for p in run.packets if p.end >= start and p.start <= end]
    if not 1 <= len(shown) <= _MOST_PACKETS:
        raise ArgumentError(
            f"start and stop show {len(shown)} packets; a figure shows 1 to {_MOST_PACKETS}"
        )
    row = {name: place for place, name in enumerate(("BCS", "RCS", "SS"))}
    colour = dict(zip(STATIONS, ("control", "address", "information"), strict=True))
    for packet in shown:
        lost = packet.outcome == "lost"
        ax.add_patch(
            Rectangle(
                (packet.start, row[packet.source] - 0.3), packet.end - packet.start, 0.6,
                facecolor=style.FIELD[colour[packet.target]], edgecolor="0.3", linewidth=0.5,
                hatch="////" if lost else None,
            )
        )  # fmt: skip
        if not lost:
            side = 1 if row[packet.target] > row[packet.source] else -1
            ax.annotate(
                "", (packet.read, row[packet.target] - 0.3 * side),
                (packet.end, row[packet.source] + 0.3 * side),
                arrowprops={"arrowstyle": "->", "color": "0.4", "linewidth": 0.8},
            )  # fmt: skip
    alarms = run.alarms
    alarms = alarms[(alarms["time_s"] >= start) & (alarms["time_s"] <= end)]
    for one in alarms.to_dict("records"):
        place = row[one["station"]] - 0.4
        ax.plot(one["time_s"], place, marker="v", color=style.LIMIT["color"], linestyle="none")
        ax.annotate(
            f"{one['partner']} failed", (one["time_s"], place), (3, 3),
            textcoords="offset points", color=style.LIMIT["color"], fontsize="small",
            bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.5, "alpha": 0.8},
        )  # fmt: skip
    ax.set_xlim(start, min(end, run.duration))
    ax.set_ylim(2.5, -0.75)
    ax.set_yticks(list(row.values()), list(row))
    ax.set_xlabel("time [s]")
    ax.grid(visible=False, axis="y")
    ax.legend(
        handles=[
            Patch(facecolor=style.FIELD[colour[name]], edgecolor="0.3", label=f"to {name}")
            for name in STATIONS
        ]
        + [
            Patch(facecolor="white", edgecolor="0.3", hatch="////", label="lost")
            for _ in range(any(packet.outcome == "lost" for packet in shown))
        ],
        loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=4, frameon=False,
    )  # fmt: skip
    return ax


def plot_margins(table: pd.DataFrame, *, ax: Axes, limit: float = 3.0) -> Axes:
    """Draw how long a slave's counters run in health, over the bit rate.

    Parameters
    ----------
    table : pandas.DataFrame
        What `timing_table` returned.
    ax : matplotlib.axes.Axes
        Where to draw.
    limit : float, default 3
        Time to failure, drawn as a red dashed line [s].

    Returns
    -------
    matplotlib.axes.Axes
        The axes given, both axes logarithmic.
    """
    rate = table["bit_rate"].to_numpy(dtype=float)
    for column, label in (
        ("counted_s", "counters run"),
        ("quiet_s", "nothing heard"),
        ("packet_s", "one packet"),
    ):
        ax.plot(rate, table[column].to_numpy(dtype=float), marker=".", label=label)
    ax.axhline(limit, color=style.LIMIT["color"], linestyle=style.LIMIT["linestyle"])
    ax.annotate(
        f"failure after {limit:g} s", (1, limit), (-4, 3), xycoords=("axes fraction", "data"),
        textcoords="offset points", ha="right", color=style.LIMIT["color"],
    )  # fmt: skip
    ax.set_xscale("log")
    ax.set_yscale("log")
    ax.yaxis.set_major_formatter("{x:g}")
    ax.set_xticks(rate, [f"{one:g}" for one in rate])
    ax.minorticks_off()
    ax.set_xlabel("bit rate [bit/s]")
    ax.set_ylabel("time [s]")
    ax.legend()
    return ax
