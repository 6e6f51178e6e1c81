"""Diagrams and flow charts, and rows of fields."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from math import hypot
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import FancyArrowPatch, Polygon
from matplotlib.path import Path

from shipnet import datasets, style
from shipnet.errors import ArgumentError
from shipnet.papers.registry import drawing

#: A place in a diagram.
Point: TypeAlias = tuple[float, float]

#: Colours of blocks, light enough for text.
FILL = {
    "": "white",
    "blue": style.FIELD["address"],
    "amber": style.FIELD["information"],
    "green": style.FIELD["parity"],
    "purple": style.FIELD["control"],
}

#: Half the width and height of each shape of block; a text has no outline.
_HALF = {"box": (0.88, 0.33), "decision": (1.06, 0.52), "text": (0.82, 0.2)}

#: Half the width and height of a box.
HALF = _HALF["box"]


class Block(NamedTuple):
    """A block of a diagram: its text, shape, colour and centre."""

    text: str
    shape: str
    colour: str
    x: float
    y: float

    def edge(self, towards: Point) -> Point:
        """Return where the line from the centre towards a point leaves the block."""
        dx, dy = towards[0] - self.x, towards[1] - self.y
        width, height = _HALF[self.shape]
        across, up = abs(dx) / width, abs(dy) / height
        part = 1 / (across + up if self.shape == "decision" else max(across, up))
        return self.x + part * dx, self.y + part * dy


def diagram(paper: str, item: str, *, ax: Axes, arrowstyle: str = "->") -> Axes:
    """Draw a diagram or flow chart, whose blocks and ways are data."""

    def rows(name: str) -> list[list[Any]]:
        table = datasets.read(name)
        chosen = (table.paper == paper) & (table.figure == item)
        return table.loc[chosen].iloc[:, 2:].to_numpy().tolist()

    blocks = {
        name: Block(text.replace(r"\n", "\n"), shape, colour, float(x), float(y))
        for name, text, shape, colour, x, y in rows("diagram_blocks.csv")
    }
    corners = []
    for start, end, word, via in rows("diagram_ways.csv"):
        turns = [(float(x), float(y)) for x, y in map(str.split, filter(None, via.split(",")))]
        tail, head = blocks[start], blocks[end]
        points = [tail.edge((turns or [head[3:]])[0]), *turns, head.edge((turns or [tail[3:]])[-1])]
        look: Any = {"arrowstyle": arrowstyle, "mutation_scale": 10, "color": "0.3"}
        ax.add_patch(FancyArrowPatch(path=Path(points), **look))
        corners += turns
        if word:
            _name(ax, points, word, loose=bool(turns))
    for text, shape, colour, x, y in blocks.values():
        width, height = _HALF[shape]
        if shape == "decision":
            outline = [(x - width, y), (x, y + height), (x + width, y), (x, y - height)]
            ax.add_patch(Polygon(outline, facecolor=FILL[colour], edgecolor="0.2", zorder=2))
            ax.text(x, y, text, ha="center", va="center", zorder=3)
        elif shape == "text":
            ax.text(x, y, text, ha="center", va="center")
        else:
            box(ax, (x - width, y - height), 2 * width, 2 * height, FILL[colour], text)
    corners += [
        (x + side * _HALF[shape][0], y + side * _HALF[shape][1])
        for _, shape, _, x, y in blocks.values()
        for side in (-1, 1)
    ]
    (left, low), (right, top) = np.min(corners, axis=0) - 0.1, np.max(corners, axis=0) + 0.1
    return style.bare(ax, (left, right), (low, top))


def _name(ax: Axes, points: Sequence[Point], word: str, *, loose: bool) -> None:
    """Write the name of a way near its middle, or near the beginning of one with corners."""
    (x, y), (end_x, end_y) = points[:2]
    level = abs(end_y - y) < 0.1
    near = 0.12 + 0.07 * len(word) if level else 0.35
    part = min(0.5, near / max(hypot(end_x - x, end_y - y), 0.1)) if loose else 0.5
    ax.text(
        x + part * (end_x - x) - (0 if level else 0.06),
        y + part * (end_y - y) + (0.05 if level else 0),
        word,
        ha="center" if level else "right",
        va="bottom" if level else "center",
    )


def diagrams(paper: str, *items: str, height: float = 3.2, arrowstyle: str = "->") -> None:
    """Register figures that consist of a diagram only, with their height [inch]."""
    for item in items:
        draw = partial(diagram, paper, item, arrowstyle=arrowstyle)
        drawing(paper, item, figsize=(6.4, height))(draw)


def panels(ax: Axes, rows: int, columns: int = 1, *, sharex: bool = False) -> list[Axes]:
    """Divide axes of a grid into panels, for a figure with several parts, and hide the axes."""
    place = ax.get_subplotspec()
    if place is None:
        raise ArgumentError("ax has no place in a grid; create it with pyplot.subplots")
    ax.set_axis_off()
    grid = place.subgridspec(rows, columns).subplots(sharex=sharex, squeeze=False)
    return [panel for row in grid for panel in row]


def box(
    ax: Axes, corner: Point, width: float, height: float, colour: str, text: str = "", **look: Any
) -> None:
    """Draw a filled box with text in its centre."""
    options: Any = {"facecolor": colour, "edgecolor": "0.2", "zorder": 2} | look
    style.box(ax, *corner, width, height, text, **options)


def fields(ax: Axes, rows: Mapping[str, Sequence[tuple[str, str, str, float]]]) -> Axes:
    """Draw rows of fields, each with text, a colour of `style.FIELD`, data below, and bytes.

    The width of a field is its number of bytes.
    """
    widest = 0.0
    for row, (title, parts) in enumerate(rows.items()):
        x, y = 0.0, -1.6 * row
        ax.text(-0.15, y + 0.5, title, ha="right", va="center")
        for words, kind, data, size in parts:
            dotted = ":" if kind == "pause" else "-"
            box(ax, (x, y), size, 1, style.FIELD[kind], words, linestyle=dotted)
            ax.text(x + size / 2, y - 0.08, data, ha="center", va="top", family="monospace")
            x += size
        widest = max(widest, x)
    return style.bare(ax, (-0.09 * widest, 1.01 * widest), (-1.6 * (len(rows) - 1) - 0.55, 1.1))
