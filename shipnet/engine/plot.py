"""Figures of the engine monitoring system."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from functools import lru_cache

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PathCollection, PolyCollection
from matplotlib.patches import Patch
from matplotlib.path import Path
from matplotlib.textpath import TextPath
from matplotlib.transforms import Affine2D

from shipnet import style
from shipnet.errors import ArgumentError
from shipnet.lazy import pd
from shipnet.style import LIMIT, bare

#: Colour and hatch of each task, from the Okabe-Ito palette.
_TASKS = {
    "convert": ("#56B4E9", ""),
    "send": ("#0072B2", ""),
    "CAN": ("#E69F00", ""),
    "timer": ("#000000", ""),
    "Modbus": ("#D55E00", "////"),
    "request": ("#CC79A7", ""),
    "response": ("#009E73", ""),
}

#: Legend labels of tasks with the same name as a bus or a device.
_LABELS = {name: f"{name} interrupt" for name in ("CAN", "timer", "Modbus")}

#: Maximum number of bars, least tiles per row that show tags, size of their text [1/72 inch].
_MOST_BARS, _TAGGED, _SIZE = 5000, 8, 10


@style.applied
def plot_timeline(table: pd.DataFrame, *, ax: Axes | None) -> Axes:
    """Draw the work of CPUs and lines as rows of bars; each CAN sender has its own row."""
    if not 1 <= len(table) <= _MOST_BARS:
        raise ArgumentError(f"table has {len(table)} rows; it must have 1..{_MOST_BARS}")
    ax = style.axes(ax)
    rows = table["row"].where(table["row"] != "CAN", "CAN, " + table["task"])
    names = [str(name) for name in rows.unique()]
    for (row, task), bars in table.groupby([rows, "task"], sort=False):
        colour, hatch = _TASKS.get(str(task), ("0.35", ""))
        spans = list(zip(bars["start_ms"], bars["end_ms"] - bars["start_ms"], strict=True))
        ax.broken_barh(
            spans,
            (names.index(str(row)) - 0.4, 0.8),
            facecolors=colour,
            hatch=hatch,
            edgecolor="white" if hatch else colour,
            linewidth=0.2 if hatch else 0.6,
        )
    handles = [
        Patch(facecolor=colour, hatch=hatch, edgecolor="white", label=_LABELS.get(task, task))
        for task, (colour, hatch) in _TASKS.items()
        if task in set(table["task"])
    ]
    style.legend(ax, handles=handles)
    ax.set_yticks(range(len(names)), [*map(style.literal, names)])
    ax.set_ylim(len(names) - 0.4, -0.6)
    ax.set_xlim(table["start_ms"].min(), table["end_ms"].max())
    ax.set_xlabel("time [ms]")
    return ax


@style.applied
def plot_ages(
    ages: pd.DataFrame, *, ax: Axes | None, limits: Mapping[str, float] | None, label: str
) -> Axes:
    """Draw the age of a point over time; the background is shaded while the point is marked.

    On axes that have lines already, the line is dashed and the shading is hatched.
    """
    ax, label = style.axes(ax), style.literal(label)
    good = ages["age_s"].notna()
    gap = np.full(len(ages), np.nan)
    x = np.column_stack([ages["seen_s"], ages["good_until_s"], ages["good_until_s"]])
    y = np.column_stack([ages["age_s"], ages["last_age_s"], gap])
    joined = (ages["good_until_s"] == ages["until_s"]) & good
    # A new value makes the line drop vertically; after a mark a new line begins.
    y[:, 2] = np.where(joined, np.append(ages["age_s"].iloc[1:], np.nan), np.nan)
    dashes, hatch = ("--", "///") if ax.lines else ("-", "")
    (line,) = ax.plot(x.ravel(), y.ravel(), dashes, label=label or None)
    bad = ages[ages["good_until_s"] < ages["until_s"]]
    for begin, end in zip(bad["good_until_s"], bad["until_s"], strict=True):
        ax.axvspan(begin, end, color=line.get_color(), alpha=0.15, lw=0, hatch=hatch)
    if len(bad):
        words, across = f" {label}:\n marked" if label else " marked", ax.get_xaxis_transform()
        height, side = (0.04, "bottom") if hatch else (0.96, "top")
        ax.text(bad["good_until_s"].iloc[0], height, words, va=side, transform=across)
    for name, value in (limits or {}).items():
        style.limit(ax, value, name)
    ax.set(xlabel="time [s]", ylabel="age [s]")
    ax.set_ylim(bottom=0)
    if label:
        style.legend(ax, 2)
    return ax


@style.applied
def plot_screen(
    table: pd.DataFrame, *, ax: Axes | None, old: float, columns: int = _TAGGED
) -> Axes:
    """Draw the screen of the AMS as tiles, one per point, with its value or its mark."""
    ax = style.axes(ax)
    table = table.reset_index()
    words: list[tuple[float, float, str, str]] = []
    tiles: dict[str, list[tuple[int, int, str]]] = {"": [], "//": []}
    shown = [table[name].tolist() for name in ("tag", "value", "unit", "age_s", "mark")]
    for tile, (tag, value, unit, age, mark) in enumerate(zip(*shown, strict=True)):
        y, x = divmod(tile, columns)
        colour, star, ink = "#d6eaf8", "", "0.1"
        text = f"{value:g} {style.sign(unit)}".rstrip()
        text = text if unit else {"0": "no alarm", "1": "alarm"}.get(text, text)
        if mark:
            colour, text, ink = "0.2", mark, "1.0"
        elif age > old:
            colour, star = "#E69F00", "*"
        tiles["//" if mark == "0xFF?" else ""].append((x, y, colour))
        if columns < _TAGGED:
            words.append((x + 0.48, y + 0.45, text + star, ink))
        else:
            words += [(x + 0.48, y + 0.65, text, ink), (x + 0.48, y + 0.25, tag[-7:] + star, ink)]
    for hatch, some in tiles.items():
        corners = [[(x, y), (x + 0.96, y), (x + 0.96, y + 0.9), (x, y + 0.9)] for x, y, _ in some]
        colours = [colour for *_, colour in some]
        ax.add_collection(
            PolyCollection(
                corners, facecolors=colours, edgecolors="0.3", linewidths=0.5, hatch=hatch
            )
        )
    # Drawing hundreds of text objects takes ten times as long as drawing one set of outlines.
    ax.add_collection(
        PathCollection(
            [_outline(text) for *_, text, _ in words],
            offsets=[(x, y) for x, y, *_ in words],
            offset_transform=ax.transData,
            transform=Affine2D().scale(1 / 72) + ax.figure.dpi_scale_trans,
            facecolors=[ink for *_, ink in words],
            linewidths=0,
            zorder=3,
        )
    )
    looks = {"#d6eaf8": "good", "#E69F00": f"* older than {old:g} s", "0.2": "marked"}
    handles = [
        Patch(facecolor=colour, edgecolor="0.3", label=name)
        for colour, name in looks.items()
        if any(colour == shown for some in tiles.values() for *_, shown in some)
    ]
    style.legend(ax, handles=handles)
    return bare(ax, (0, columns), (-(-len(table) // columns), 0))


@lru_cache(maxsize=4096)
def _outline(text: str) -> Path:
    """Return the outline of `text` [1/72 inch], centred on the origin: vertically, its capitals."""
    path = TextPath((0, 0), style.literal(text), size=_SIZE)
    ends = path.vertices[:, 0]
    middle = (ends.min() + ends.max()) / 2
    return Affine2D().translate(-middle, -0.36 * _SIZE).transform_path(path)


@style.applied
def plot_system(
    counts: Mapping[str, int],
    segments: Sequence[str],
    ports: Sequence[str],
    failed: Iterable[tuple[str, str]],
    *,
    ax: Axes | None,
) -> Axes:
    """Draw the boxes with their numbers of points, the CAN cables and the AMS's two channels.

    `failed` gives, for each failure, its place (box, cable or channel) and the text at its cross.
    """
    ax = style.axes(ax)
    look = {"facecolor": "white", "edgecolor": "0.2", "zorder": 2}
    spots: dict[str, tuple[float, float]] = {}
    for k, (box, count) in enumerate(counts.items()):
        spots[box] = (2.0 * k, 0.0)
        style.box(ax, 2.0 * k - 0.45, -0.28, 0.9, 0.56, f"{box}\n{count} points", **look)
    middle = len(counts) - 1.0
    style.box(ax, middle - 0.45, 1.72, 0.9, 0.56, "AMS", **look)
    for segment in segments:
        ends = [spots[end][0] for end in segment.split("-")]
        straight = abs(ends[0] - ends[1]) == 2.0
        low = 0.0 if straight else -0.8
        label = "CAN" if segment == segments[0] else None
        ax.plot(np.repeat(ends, 2), [0.0, low, low, 0.0], color="#0072B2", zorder=1, label=label)
        spots[segment] = (sum(ends) / 2, low)
    for channel, port in enumerate(ports, start=1):
        x = spots[port][0]
        ax.plot(
            [x, x, middle],
            [0.0, 2.0, 2.0],
            color="#009E73",
            linestyle="--",
            zorder=1,
            label="Modbus" if channel == 1 else None,
        )
        ax.text(x, 1.0, f" channel {channel}", va="center")
        spots[str(channel)] = (x, 1.4)
    for where, text in failed:
        x, y = spots[where]
        if where in counts:
            y -= 0.35  # below the box, so that its name stays readable
        ax.plot([x], [y], marker="X", markersize=11, color=LIMIT["color"], zorder=4)
        on_cable = where in ("1", "2")  # beside the cable; the channel's name is below
        ax.annotate(
            text,
            (x, y),
            (-9, 0) if on_cable else (0, -10),
            textcoords="offset points",
            color=LIMIT["color"],
            ha="right" if on_cable else "center",
            va="center" if on_cable else "top",
        )
    style.legend(ax)
    lowest = min(-0.35, *(y for _, y in spots.values())) - 0.4
    return bare(ax, (-1.0, 2.0 * middle + 1.0), (lowest, 2.6))
