"""Diagrams of blocks with arrows, and rows of fields."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import TypeAlias

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import FancyArrowPatch

from shipnet import datasets, style
from shipnet.errors import ArgumentError
from shipnet.papers.registry import drawing

#: Text, colour and position of each block by name.
Blocks: TypeAlias = Mapping[str, tuple[str, str, float, float]]

#: Names of two joined blocks, and the label of the arrow or line between them.
Ways: TypeAlias = Sequence[tuple[str, str, str]]

#: Colours of blocks, light enough for text.
FILL = {
    "": "white",
    "blue": style.FIELD["address"],
    "amber": style.FIELD["information"],
    "green": style.FIELD["parity"],
    "purple": style.FIELD["control"],
}

#: Half the width and height of a block.
HALF = (0.82, 0.33)


def diagram(paper: str, item: str, *, ax: Axes, arrowstyle: str = "->") -> Blocks:
    """Draw the blocks of a figure and the arrows between them; return the blocks."""

    def rows(name: str) -> list[list[str]]:
        table = datasets.read(name)
        chosen = (table.paper == paper) & (table.figure == item)
        return table.loc[chosen].iloc[:, 2:].to_numpy().tolist()

    blocks = {
        name: (text.replace(r"\n", "\n"), colour, float(x), float(y))
        for name, text, colour, x, y in rows("diagram_blocks.csv")
    }
    ways = [(start, end, word) for start, end, word in rows("diagram_ways.csv")]
    outline(ax, blocks, ways, arrowstyle)
    return blocks


def diagrams(paper: str, *items: str, arrowstyle: str = "->") -> None:
    """Register figures that consist of a diagram only."""
    for item in items:
        drawing(paper, item)(partial(_diagram, paper, item, arrowstyle))


def _diagram(paper: str, item: str, arrowstyle: str, *, ax: Axes) -> Axes:
    blocks = diagram(paper, item, ax=ax, arrowstyle=arrowstyle).values()
    places = np.array([(x, y) for _, _, x, y in blocks])
    margin = np.array(HALF) + 0.13
    (left, low), (right, top) = places.min(axis=0) - margin, places.max(axis=0) + margin
    return style.bare(ax, (left, right), (low, top))


def outline(ax: Axes, blocks: Blocks, ways: Ways, arrowstyle: str = "->") -> None:
    """Draw blocks, and an arrow or a line between those that are joined."""
    for first, second, word in ways:
        tail, head = (np.array(blocks[name][2:]) for name in (first, second))
        way = head - tail
        with np.errstate(divide="ignore"):
            inside = float(np.min(np.array(HALF) / np.abs(way)))
        begin, end = tail + inside * way, head - inside * way
        arrow(ax, begin, end, arrowstyle)
        if word:
            x, y = (begin + end) / 2
            # The label is above a horizontal arrow, and to the left of any other.
            level = abs(way[1]) < 0.1
            ax.text(
                x - (0 if level else 0.2),
                y + (0.05 if level else 0),
                word,
                ha="center" if level else "right",
                va="bottom" if level else "center",
            )
    width, height = HALF
    for text, fill, x, y in blocks.values():
        box(ax, (x - width, y - height), 2 * width, 2 * height, FILL[fill], text)


def panels(ax: Axes, rows: int, columns: int = 1, *, sharex: bool = False) -> list[Axes]:
    """Divide axes of a grid into panels, for a figure with several parts, and hide the axes."""
    place = ax.get_subplotspec()
    if place is None:
        raise ArgumentError("ax has no place in a grid; create it with pyplot.subplots")
    ax.set_axis_off()
    grid = place.subgridspec(rows, columns).subplots(sharex=sharex, squeeze=False)
    return [panel for row in grid for panel in row]


def box(
    ax: Axes,
    corner: tuple[float, float],
    width: float,
    height: float,
    colour: str,
    text: str = "",
    *,
    edge: str = "0.2",
    linestyle: str = "-",
) -> None:
    """Draw a filled box with text in its centre."""
    style.box(
        ax,
        *corner,
        width,
        height,
        text,
        facecolor=colour,
        edgecolor=edge,
        linestyle=linestyle,
        zorder=2,
    )


def arrow(ax: Axes, tail: Sequence[float], head: Sequence[float], arrowstyle: str = "->") -> None:
    """Draw an arrow between two points."""
    ax.add_patch(
        FancyArrowPatch(
            (tail[0], tail[1]),
            (head[0], head[1]),
            arrowstyle=arrowstyle,
            mutation_scale=10,
            color="0.3",
            shrinkA=0,
            shrinkB=0,
        )
    )


def fields(ax: Axes, rows: Mapping[str, Sequence[tuple[str, str, str]]]) -> Axes:
    """Draw rows of fields, each with text, a colour of `style.FIELD`, and bytes below."""
    widest = 0.0
    for row, (title, parts) in enumerate(rows.items()):
        x, y = 0.0, -1.6 * row
        ax.text(-1, y + 0.5, title, ha="right", va="center")
        for words, kind, data in parts:
            width = max(len(line) for line in [*words.split("\n"), data]) + 3.0
            dotted = ":" if kind == "pause" else "-"
            box(ax, (x, y), width, 1, style.FIELD[kind], words, linestyle=dotted)
            ax.text(x + width / 2, y - 0.08, data, ha="center", va="top", family="monospace")
            x += width
        widest = max(widest, x)
    return style.bare(ax, (-8, widest + 1), (-1.6 * (len(rows) - 1) - 0.55, 1.1))
