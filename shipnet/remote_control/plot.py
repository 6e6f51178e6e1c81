"""Figures of the ring, of the link and of the comparison of checks."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from itertools import pairwise

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.patches import Patch, Rectangle, Wedge

from shipnet import style
from shipnet.errors import ArgumentError
from shipnet.lazy import pd

#: The flags and places that define each case, and its colour: pale if normal, strong if abnormal.
_CASES = {
    "b": ("b: same flags, no >= get_no", "#cfe3f3"),
    "d": ("d: flags differ, no < get_no", "#9cc4e4"),
    "c": ("c: flags differ, no >= get_no", "#f2b27a"),
    "a": ("a: same flags, no < get_no", "#c44e52"),
}

#: For each receiving station, the field in `style.FIELD` whose colour its packets get.
_TARGETS = {"RCS": "control", "BCS": "address", "SS": "information"}

#: Largest number of packets in one figure.
_MOST_PACKETS = 500


def plot_ring(
    cells: Sequence[str],
    held: Collection[int],
    places: Mapping[str, int],
    text: str,
    *,
    overrun: bool,
    ax: Axes | None,
) -> Axes:
    """Draw a ring as a circle of cells, clockwise from the top, with its writer and its reader."""
    ax = style.axes(ax)
    size = len(cells)
    step = 360 / size
    shade = style.LIMIT["color"] if overrun else "C0"
    for cell, byte in enumerate(cells):
        middle = 90 - (cell + 0.5) * step
        wedge = Wedge(
            (0, 0),
            1,
            middle - step / 2,
            middle + step / 2,
            width=0.25,
            facecolor=shade if cell in held else "white",
            alpha=0.45 if cell in held else 1,
            edgecolor="0.4",
            linewidth=0.8 if size <= 32 else 0.3,
            label=f"cell {cell}",
            hatch="///" if overrun and cell in held else None,
        )
        ax.add_patch(wedge)
        if size <= 32:
            ax.text(*_at(0.875, middle), byte, ha="center", va="center")
    for (name, cell), radius, tip in zip(places.items(), (1.38, 0.15), (1.02, 0.74), strict=True):
        angle = 90 - (cell + 0.5) * step
        ax.annotate(
            name,
            xy=_at(tip, angle),
            xytext=_at(radius, angle),
            ha="center",
            va="center",
            arrowprops={"arrowstyle": "->", "color": "0.2"},
        )
    ax.text(0, -1.55, text, ha="center", va="top")
    ax.set_xlim(-1.6, 1.6)
    ax.set_ylim(-2.1, 1.5)
    ax.set_aspect("equal")
    ax.set_axis_off()
    return ax


def _at(radius: float, degrees: float) -> tuple[float, float]:
    angle = np.radians(degrees)
    return float(radius * np.cos(angle)), float(radius * np.sin(angle))


def plot_cases(shown: npt.NDArray[np.str_], ax: Axes | None) -> Axes:
    """Draw the cases: one row per place of the reader, one column per number of unread bytes."""
    ax = style.axes(ax)
    size = len(shown)
    order = np.vectorize(list(_CASES).index)(shown)
    colours = [colour for _, colour in _CASES.values()]
    ax.imshow(
        order,
        cmap=ListedColormap(colours),
        norm=BoundaryNorm(np.arange(-0.5, 4), 4),
        origin="lower",
        aspect="auto",
        interpolation="nearest",
    )
    for place, letter in enumerate(_CASES):
        row, column = np.nonzero(order[:, : 2 * size] == place)
        if row.size:
            ax.text(column.mean(), row.mean(), letter)
    ax.axvline(size, color=style.LIMIT["color"], linestyle=style.LIMIT["linestyle"])
    ax.annotate(
        "ring full",
        (size, 0.5),
        (-3, 0),
        xycoords=("data", "axes fraction"),
        textcoords="offset points",
        ha="right",
        va="center",
        color=style.LIMIT["color"],
    )
    ax.set_xlabel("unread bytes [byte]")
    ax.set_ylabel("get_no [index]")
    handles = [Patch(facecolor=colour, label=label) for label, colour in _CASES.values()]
    style.legend(ax, 2, handles=handles)
    ax.grid(visible=False)
    return ax


def plot_lead(letters: Sequence[str], size: int, ax: Axes | None) -> Axes:
    """Draw the number of bytes that the four variables show as unread, over the true number."""
    ax = style.axes(ax)
    leads = np.arange(len(letters))
    ax.plot(leads, leads, color="0.5", linewidth=1, label="truly unread")
    ax.plot(leads, leads % (2 * size), color="C0", label="what the variables show")
    edges = [0, *(np.flatnonzero(np.array(letters[1:]) != np.array(letters[:-1])) + 1), leads.size]
    for start, end in pairwise(edges):
        abnormal = letters[start] in ("a", "c")
        ax.axvspan(start, end, color="#f7d9d5" if abnormal else "#dceaf5", zorder=0)
        ax.text((start + end) / 2, leads.size * 0.93, letters[start], ha="center")
    ax.axvline(size, color=style.LIMIT["color"], linestyle=style.LIMIT["linestyle"])
    ax.annotate(
        "ring full",
        (size, 0.8),
        (4, 0),
        xycoords=("data", "axes fraction"),
        textcoords="offset points",
        color=style.LIMIT["color"],
    )
    ax.set(xlabel="bytes unread [byte]", ylabel="true and shown [byte]")
    ax.set(xlim=(0, leads.size), ylim=(0, leads.size))
    ax.grid(visible=False)
    style.legend(ax)
    return ax


def plot_time_chart(
    traffic: pd.DataFrame,
    alarms: pd.DataFrame,
    ax: Axes | None,
    start: float,
    end: float,
    until: float,
) -> Axes:
    """Draw the packets of each station over time, as in Fig. 2 of chung1998."""
    shown = traffic[(traffic["end_s"] >= start) & (traffic["start_s"] <= end)]
    if not 1 <= len(shown) <= _MOST_PACKETS:
        raise ArgumentError(
            f"start..stop contains {len(shown)} packets; a figure shows 1 to {_MOST_PACKETS}"
        )
    ax = style.axes(ax)
    row = {name: place for place, name in enumerate(("BCS", "RCS", "SS"))}
    columns = ("start_s", "end_s", "source", "target", "read_s", "outcome")
    packets = zip(*(shown[name].tolist() for name in columns), strict=True)
    for begin, sent, source, target, read, outcome in packets:
        # What the end of the run cuts off is not lost.
        lost = outcome == "lost" and sent <= until
        ax.add_patch(
            Rectangle(
                (begin, row[source] - 0.3),
                sent - begin,
                0.6,
                facecolor=style.FIELD[_TARGETS[target]],
                edgecolor="0.3",
                linewidth=0.5,
                hatch="////" if lost else None,
            )
        )
        if outcome != "lost":
            side = 1 if row[target] > row[source] else -1
            ax.annotate(
                "",
                (read, row[target] - 0.3 * side),
                (sent, row[source] + 0.3 * side),
                arrowprops={"arrowstyle": "->", "color": "0.4", "linewidth": 0.8},
            )
    alarms = alarms[(alarms["time_s"] >= start) & (alarms["time_s"] <= end)]
    for one in alarms.to_dict("records"):
        place = row[one["station"]] - 0.4
        ax.plot(one["time_s"], place, marker="v", color=style.LIMIT["color"], linestyle="none")
        ax.annotate(
            f"{one['partner']} failed",
            (one["time_s"], place),
            (3, 3),
            textcoords="offset points",
            color=style.LIMIT["color"],
            bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.5, "alpha": 0.8},
        )
    ax.set_xlim(start, min(end, until))
    ax.set_ylim(2.5, -0.75)
    ax.set_yticks(list(row.values()), list(row))
    ax.set_xlabel("time [s]")
    ax.grid(visible=False, axis="y")
    handles = [
        Patch(facecolor=style.FIELD[field], edgecolor="0.3", label=f"to {name}")
        for name, field in _TARGETS.items()
    ]
    if ((shown["outcome"] == "lost") & (shown["end_s"] <= until)).any():
        handles.append(Patch(facecolor="white", edgecolor="0.3", hatch="////", label="lost"))
    style.legend(ax, handles=handles)
    return ax


def plot_margins(table: pd.DataFrame, ax: Axes | None, limit: float) -> Axes:
    """Draw the time for which a healthy slave's counters run, over the bit rate."""
    ax = style.axes(ax)
    rate = table["bit_rate"].to_numpy(dtype=float)
    for column, label in (
        ("counted_s", "counters run"),
        ("idle_s", "nothing heard"),
        ("packet_s", "one packet"),
    ):
        ax.plot(rate, table[column].to_numpy(dtype=float), marker=".", label=label)
    ax.axhline(limit, color=style.LIMIT["color"], linestyle=style.LIMIT["linestyle"])
    ax.annotate(
        f"failure after {limit:g} s",
        (1, limit),
        (-4, 3),
        xycoords=("axes fraction", "data"),
        textcoords="offset points",
        ha="right",
        color=style.LIMIT["color"],
    )
    ax.set_xscale("log")
    ax.set_yscale("log")
    ax.yaxis.set_major_formatter("{x:g}")
    ax.set_xticks(rate, [f"{one:g}" for one in rate])
    ax.minorticks_off()
    ax.set_xlabel("bit rate [bit/s]")
    ax.set_ylabel("time [s]")
    style.legend(ax)
    return ax


def plot_counters(
    times: Sequence[float],
    counts: Sequence[int],
    misses: Sequence[float],
    label: str,
    ax: Axes | None,
) -> Axes:
    """Draw the counters of Fig 5 of chung1998 after the last 0xDD of a partner.

    The count is a line, and each miss a numbered mark; the last is red and gives the time instead.
    """
    ax = style.axes(ax)
    place = len(ax.get_legend_handles_labels()[1])
    for number, time in enumerate(misses, start=1):
        failed = number == len(misses)
        colour = style.LIMIT["color"] if failed else f"C{place}"
        y = 11.7 + 1.8 * place
        ax.plot(time, y, "v", color=colour)
        ax.annotate(
            f"failed, {time:.1f} s" if failed else f"miss {number}",
            (time, y),
            (5, 0),
            textcoords="offset points",
            va="center",
            color=colour,
        )
    line, name = "-" if place == 0 else "--", label or f"rule {place + 1}"
    ax.plot(times, counts, line, drawstyle="steps-post", color=f"C{place}", label=name)
    ax.set(xlabel="time since the last 0xDD [s]", ylabel="count [tick]")
    style.legend(ax)
    return ax


def plot_checks(table: pd.DataFrame, ax: Axes | None) -> Axes:
    """Draw the fraction of packets accepted with errors, by check, at the first bit error rate."""
    shown = table[table["bit_error_rate"] == table["bit_error_rate"].iloc[0]]
    ax, bounds = style.axes(ax), list[float]()
    for place, (check, rows) in enumerate(shown.groupby("check", sort=False)):
        colour = f"C{place}"
        items = rows["n_items"].to_numpy(dtype=float)
        count = rows["undetected"].to_numpy(dtype=float)
        share = count / rows["sent"].to_numpy(dtype=float)
        # The marks are side by side, so that none hides another.
        beside = items + 0.4 * place
        low, high = (rows[name].to_numpy(dtype=float) for name in ("low", "high"))
        bounds += high[count == 0].tolist()
        # For the byte-stuffed packet, the estimate is usually too high: `CobsFormat._undetected`.
        label = f"{check}" + ", upper estimate" * (check == "CRC")
        ax.plot(items, rows["expected"].to_numpy(dtype=float), color=colour, label=label)
        some = count > 0
        ax.errorbar(
            beside[some],
            share[some],
            yerr=[(share - low)[some], (high - share)[some]],
            color=colour,
            marker="o",
            linestyle="none",
            capsize=3,
        )
    ax.set_yscale("log")
    ax.set_xlabel("items per packet")
    ax.set_ylabel("fraction accepted with errors [-]")
    ax.plot([], [], "o", color="0.4", label="counted, 95 % bounds")
    if bounds:
        ax.axhline(max(bounds), color="0.5", linestyle=":", label="upper bound if none counted")
    style.legend(ax, 3)
    return ax
