"""Figures of the ring, of the link and of the comparison of checks."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

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
    "d": ("d: flags differ, no < get_no", "#a9cbe6"),
    "c": ("c: flags differ, no >= get_no", "#e8924a"),
    "a": ("a: same flags, no < get_no", "#c44e52"),
}

#: For each receiving station, the field in `style.FIELD` whose colour its packets get.
_TARGETS = {"RCS": "pause", "BCS": "address", "SS": "information"}

#: Largest number of packets in one figure.
_MOST_PACKETS = 500

_LIMIT: dict[str, Any] = style.LIMIT
_RED = style.LIMIT["color"]


@style.applied
def plot_ring(ring: Any, ax: Axes | None) -> Axes:
    """Draw a `Ring` as a circle of cells, clockwise from the top, with its writer and reader."""
    ax = style.axes(ax)
    size, state, overrun = ring.size, ring.state, ring.unread > ring.size
    held = range(ring.written - min(ring.unread, size), ring.written)
    unread = {count % size for count in held}
    angles = 90 - (np.arange(size) + 0.5) * 360 / size

    def at(radius: float, cell: int) -> tuple[float, float]:
        angle = np.radians(angles[cell])
        return float(radius * np.cos(angle)), float(radius * np.sin(angle))

    for cell, (byte, middle) in enumerate(zip(ring.cells, angles, strict=True)):
        full = cell in unread
        wedge = Wedge(
            (0, 0),
            1,
            middle - 180 / size,
            middle + 180 / size,
            width=0.4,
            facecolor="white" if not full else _RED if overrun else "C0",
            alpha=0.45 if full else 1,
            edgecolor="0.4",
            linewidth=0.8 if size <= 32 else 0.3,
            hatch="///" if overrun and full else None,
        )
        ax.add_patch(wedge)
        if size <= 32 and cell < ring.written:
            ax.text(*at(0.82, cell), f"{byte:02X}", ha="center", va="center")
    pointers = (("no", state.no, 1.32, 1.01), ("get_no", state.get_no, 0, 0.59))
    for name, cell, radius, tip in pointers:
        arrow = {"arrowstyle": "->", "color": "0.2", "shrinkB": 0}
        ax.annotate(
            name, at(tip, cell), at(radius, cell), ha="center", va="center", arrowprops=arrow
        )
    flags = f"ring_f = {state.ring_f}, ring_get_f = {state.ring_get_f}\ncase {ring.case}"
    ax.text(0, -1.4, flags, ha="center", va="top")
    shown, lost = ("hatched", f", {ring.unread - size} lost") if overrun else ("shaded", "")
    words = f"\n\n{shown}: {ring.unread} unread{lost}"
    ax.text(0, -1.4, words, color=_RED if overrun else "C0", ha="center", va="top")
    ax.set(xlim=(-1.35, 1.35), ylim=(-1.35, 1.35), aspect="equal")
    ax.set_axis_off()
    return ax


@style.applied
def plot_cases(shown: npt.NDArray[np.str_], ax: Axes | None) -> Axes:
    """Draw the cases: one row per place of the reader, one column per number of unread bytes."""
    ax = style.axes(ax)
    size = len(shown)
    order = np.vectorize(list(_CASES).index)(shown)
    colours = ListedColormap([colour for _, colour in _CASES.values()])
    norm = BoundaryNorm(np.arange(-0.5, 4), 4)
    ax.imshow(
        order, cmap=colours, norm=norm, origin="lower", aspect="auto", interpolation="nearest"
    )
    for number, letter in enumerate(_CASES):
        for start in range(0, order.shape[1], 2 * size):
            row, column = np.nonzero(order[:, start : start + 2 * size] == number)
            if row.size:
                ax.text(start + column.mean(), row.mean(), letter, ha="center", va="center")
    ax.axvline(size, **_LIMIT)
    ax.text(size, size / 2, "ring full ", color=_RED, ha="right", va="center")
    ax.set(xlabel="unread bytes [byte]", ylabel="get_no [index]")
    handles = [Patch(facecolor=colour, label=label) for label, colour in _CASES.values()]
    style.legend(ax, 2, handles=handles)
    ax.grid(visible=False)
    return ax


@style.applied
def plot_lead(letters: Sequence[str], size: int, ax: Axes | None) -> Axes:
    """Draw the number of bytes that the four variables show as unread, over the true number."""
    ax = style.axes(ax)
    leads = np.arange(len(letters))
    ax.plot(leads, leads, color="0.4", linewidth=1)
    ax.plot(leads, leads % (2 * size), color="C0")
    ax.text(leads[-1], 0.78 * leads[-1], "truly unread ", color="0.3", ha="right", va="top")
    ax.text(leads[-1], leads[-1] % (2 * size), "shown ", color="C0", ha="right", va="bottom")
    edges = [0, *(np.flatnonzero(np.array(letters[1:]) != np.array(letters[:-1])) + 1), leads.size]
    for start, end in pairwise(edges):
        abnormal = letters[start] in ("a", "c")
        ax.axvspan(start, end, color="#f0bdb5" if abnormal else "#dceaf5", zorder=0)
        ax.text((start + end) / 2, leads.size * 1.05, f"case\n{letters[start]}", ha="center")
    ax.axvline(size, **_LIMIT)
    ax.text(size, 0.9 * leads.size, " ring full", color=_RED)
    ax.set(xlabel="bytes unread [byte]", ylabel="true and shown [byte]")
    ax.set(xlim=(0, leads.size), ylim=(0, 1.22 * leads.size))
    ax.grid(visible=False)
    return ax


@style.applied
def plot_time_chart(run: Any, ax: Axes | None, start: float, stop: float) -> Axes:
    """Draw the packets of each station in a `Run` over time, as in Fig. 2 of chung1998."""
    shown = [packet for packet in run.packets if packet.end >= start and packet.start <= stop]
    if not 1 <= len(shown) <= _MOST_PACKETS:
        raise ArgumentError(
            f"start..stop contains {len(shown)} packets; a figure shows 1 to {_MOST_PACKETS}"
        )
    ax = style.axes(ax)
    row = {name: y for y, name in enumerate(("BCS", "RCS", "SS"))}
    # What the end of the run cuts off is not lost.
    lost = [packet.outcome == "lost" and packet.end <= run.until for packet in shown]
    for packet, is_lost in zip(shown, lost, strict=True):
        block = Rectangle(
            (packet.start, row[packet.source] - 0.25),
            packet.end - packet.start,
            0.5,
            facecolor=style.FIELD[_TARGETS[packet.target]],
            edgecolor="0.3",
            linewidth=0.5,
            hatch="////" if is_lost else None,
        )
        ax.add_patch(block)
        if packet.outcome != "lost":
            side = 0.25 if row[packet.target] > row[packet.source] else -0.25
            ax.annotate(
                "",
                (packet.read, row[packet.target] - side),
                (packet.end, row[packet.source] + side),
                arrowprops={"arrowstyle": "->", "color": "0.4", "linewidth": 0.8},
            )
    alarms = run.alarms().query("@start <= time_s <= @stop")
    for time, station, partner in alarms[["time_s", "station", "partner"]].itertuples(index=False):
        y = row[station] - 0.45
        ax.plot(time, y, marker="v", color=_RED, linestyle="none")
        ax.text(time, y, f"{partner}  ", color=_RED, ha="right", va="center")
    ax.set(xlim=(start, min(stop, run.until)), ylim=(2.5, -0.75), xlabel="time [s]")
    ax.set_yticks(list(row.values()), list(row))
    ax.grid(visible=False, axis="y")
    handles: list[Any] = [
        Patch(facecolor=style.FIELD[field], edgecolor="0.3", label=f"to {name}")
        for name, field in _TARGETS.items()
    ]
    if any(lost):
        handles.append(Patch(facecolor="white", edgecolor="0.3", hatch="////", label="lost"))
    if len(alarms):
        handles += ax.plot([], [], "v", color=_RED, label="partner failed")
    style.legend(ax, 5, handles=handles)
    return ax


@style.applied
def plot_margins(table: pd.DataFrame, ax: Axes | None, limit: float) -> Axes:
    """Draw the time for which a healthy slave's counters run, over the bit rate."""
    ax = style.axes(ax)
    labels = {"counted_s": "counters run", "idle_s": "nothing heard", "packet_s": "one packet"}
    last = table.sort_values("bit_rate").iloc[-1]
    for number, (column, label) in enumerate(labels.items()):
        colour = f"C{number}"
        ax.plot(table["bit_rate"], table[column], marker=".", color=colour)
        ax.text(last["bit_rate"], last[column], f"  {label}", color=colour, va="center")
    style.limit(ax, limit, f"failure after\n{limit:g} s")
    ax.set(xscale="log", yscale="log", xlabel="bit rate [bit/s]", ylabel="time [s]")
    ax.yaxis.set_major_formatter("{x:g}")
    ax.set_xticks(table["bit_rate"].tolist(), [f"{rate:g}" for rate in table["bit_rate"]])
    ax.minorticks_off()
    return ax


@style.applied
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
    index = len(ax.get_legend_handles_labels()[1])
    y = 11.7 + 1.8 * index
    for number, time in enumerate(misses, start=1):
        failed = number == len(misses)
        colour = _RED if failed else f"C{index}"
        text = f"failed, {time:.1f} s" if failed else f"miss {number}"
        ax.plot(time, y, "v", color=colour)
        ax.annotate(text, (time, y), (5, 0), textcoords="offset points", va="center", color=colour)
    line, name = "-" if index == 0 else "--", label or f"rule {index + 1}"
    ax.plot(times, counts, line, drawstyle="steps-post", color=f"C{index}", label=name)
    ax.set(xlabel="time since the last 0xDD [s]", ylabel="count [tick]")
    style.legend(ax)
    return ax


@style.applied
def plot_checks(table: pd.DataFrame, ax: Axes | None) -> Axes:
    """Draw the fraction of packets accepted with errors, by check, at the first bit error rate."""
    shown = table[table["bit_error_rate"] == table["bit_error_rate"].iloc[0]]
    ax = style.axes(ax)
    place: dict[str, Any] = {"x": shown["n_items"].max(), "ha": "right", "va": "top"}
    for number, (check, rows) in enumerate(shown.groupby("check", sort=False)):
        colour = f"C{number}"
        # For the byte-stuffed packet, the estimate is usually too high: `CobsFormat._undetected`.
        label = f"{check}, upper estimate" if check == "CRC" else check
        ax.plot(rows["n_items"], rows["expected"], color=colour)
        ax.text(y=0.15 * rows["expected"].iloc[-1], s=label, color=colour, **place)
        some = rows[rows["undetected"] > 0]
        share = some["undetected"] / some["sent"]
        ax.errorbar(
            some["n_items"] + 0.4 * number,  # side by side, so that no mark hides another
            share,
            yerr=[share - some["low"], some["high"] - share],
            color=colour,
            marker="o",
            linestyle="none",
            capsize=3,
        )
    ax.set(yscale="log", xlabel="items per packet", ylabel="fraction accepted with errors")
    ax.plot([], [], "o", color="0.4", label="counted, with 95 % bounds")
    none = shown.loc[shown["undetected"] == 0, "high"]
    if len(none):
        bound = none.max()
        ax.axhline(bound, color="0.5", linestyle=":")
        ax.text(y=0.6 * bound, s="upper bound if none counted", color="0.3", **place)
    style.legend(ax)
    return ax
