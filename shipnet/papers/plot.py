"""Blocks and what leads from one to another, rows of fields, and the figures of kim2023."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import TypeAlias

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import FancyArrowPatch

from shipnet import datasets, style
from shipnet.design.plant import lines_needed
from shipnet.papers.registry import figure

#: Text, colour and place of each block by its name.
Blocks: TypeAlias = Mapping[str, tuple[str, str, float, float]]

#: Names of blocks that are joined, and the word on the way.
Ways: TypeAlias = Sequence[tuple[str, str, str]]

#: Colours of blocks, light enough to write on.
FILL = {
    "": "white", "blue": style.FIELD["address"], "amber": style.FIELD["information"],
    "green": style.FIELD["parity"], "purple": style.FIELD["control"],
}  # fmt: skip

#: Half the width and height of a block.
HALF = (0.82, 0.33)


def diagram(paper: str, item: str, *, ax: Axes, arrowstyle: str = "->") -> Blocks:
    """Draw the blocks of a figure and what leads from one to another; return the blocks."""

    def rows(name: str) -> list[list[str]]:
        table = datasets.read(name)
        mine = (table.paper == paper) & (table.figure == item)
        return table.loc[mine].iloc[:, 2:].to_numpy().tolist()

    blocks = {
        name: (text.replace(r"\n", "\n"), colour, float(x), float(y))
        for name, text, colour, x, y in rows("diagram_blocks.csv")
    }
    ways = [(start, end, word) for start, end, word in rows("diagram_ways.csv")]
    outline(ax, blocks, ways, arrowstyle)
    return blocks


def diagrams(paper: str, *items: str, arrowstyle: str = "->") -> None:
    """Register figures that are a diagram and nothing else."""
    for item in items:
        figure(paper, item)(partial(_diagram, paper, item, arrowstyle))


def _diagram(paper: str, item: str, arrowstyle: str, *, ax: Axes) -> Axes:
    blocks = diagram(paper, item, ax=ax, arrowstyle=arrowstyle).values()
    places = np.array([(x, y) for _, _, x, y in blocks])
    margin = np.array(HALF) + 0.13
    (left, low), (right, top) = places.min(axis=0) - margin, places.max(axis=0) + margin
    return style.bare(ax, (left, right), (low, top))


def outline(ax: Axes, blocks: Blocks, ways: Ways, arrowstyle: str = "->") -> None:
    """Draw blocks, and an arrow or a line from edge to edge of those that are joined."""
    for first, second, word in ways:
        tail, head = (np.array(blocks[name][2:]) for name in (first, second))
        way = head - tail
        with np.errstate(divide="ignore"):
            inside = float(np.min(np.array(HALF) / np.abs(way)))
        begin, end = tail + inside * way, head - inside * way
        arrow(ax, begin, end, arrowstyle)
        if word:
            x, y = (begin + end) / 2
            # Above a level way, left of any other.
            level = abs(way[1]) < 0.1
            ax.text(
                x - (0 if level else 0.2), y + (0.05 if level else 0), word,
                ha="center" if level else "right", va="bottom" if level else "center",
            )  # fmt: skip
    width, height = HALF
    for text, fill, x, y in blocks.values():
        box(ax, (x - width, y - height), 2 * width, 2 * height, FILL[fill], text)


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
    """Draw a filled box with a text in its middle."""
    style.box(
        ax, *corner, width, height, text,
        facecolor=colour, edgecolor=edge, linestyle=linestyle, zorder=2,
    )  # fmt: skip


def arrow(ax: Axes, tail: Sequence[float], head: Sequence[float], arrowstyle: str = "->") -> None:
    """Draw an arrow between two points."""
    ax.add_patch(
        FancyArrowPatch(
            (tail[0], tail[1]), (head[0], head[1]), arrowstyle=arrowstyle, mutation_scale=10,
            color="0.3", shrinkA=0, shrinkB=0,
        )
    )  # fmt: skip


def fields(ax: Axes, rows: Mapping[str, Sequence[tuple[str, str, str]]]) -> Axes:
    """Draw rows of fields, each with its words, its colour in `style.FIELD`, and bytes below."""
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


# Figures of kim2023, whose printed pictures were not available; their places are ours.

#: Slaves that one line holds.
_FULL = 62


@figure("kim2023", "Fig 7")
def _valves(*, valves: int = 400, ax: Axes) -> Axes:
    """Draw valves on as many lines as they need, a slave each."""
    lines = lines_needed(valves)
    for row in range(lines):
        here = min(_FULL, valves - row * _FULL)
        box(ax, (-9.5, -row - 0.35), 8, 0.7, FILL["blue"], f"master {row + 1}")
        ax.plot([-1.5, here], [-row, -row], color="0.3", lw=1)
        ax.plot(np.arange(1, here + 1), np.full(here, -row), "o", color="C2", markersize=4)
        ax.text(here + 1, -row, f"{here} valves", va="center")
    return style.bare(ax, (-10, _FULL + 12), (-lines + 0.4, 0.6))


@figure("kim2023", "Fig 9")
def _table(*, drives: int = 10, airboxes: int = 20, ax: Axes) -> Axes:
    """Draw drive units and airboxes around an index table, all on one line."""
    slaves = drives + airboxes
    angle = np.pi - 2 * np.pi * (np.arange(slaves) + 0.5) / slaves
    turn = np.linspace(0, 2 * np.pi, 200)
    ax.fill(0.72 * np.cos(turn), 0.72 * np.sin(turn), color="0.93")
    ax.text(0, 0, "rotary\nindex table", ha="center", va="center")
    x, y = np.cos(angle), np.sin(angle)
    ax.plot([-1.35, *x], [0, *y], color="0.3", lw=1, zorder=0)
    drive = np.arange(slaves) % 3 == 0 if airboxes == 2 * drives else np.arange(slaves) < drives
    for kind, mark, colour, name in (
        (drive, "s", "C1", "drive units"),
        (~drive, "o", "C0", "airboxes"),
    ):
        ax.plot(x[kind], y[kind], mark, color=colour, markersize=7, label=f"{kind.sum()} {name}")
    box(ax, (-2.15, -0.16), 0.8, 0.32, FILL["blue"], "master")
    ax.legend(loc="center left", bbox_to_anchor=(0.95, 0.5))
    ax.set_aspect("equal")
    return style.bare(ax, (-2.3, 1.2), (-1.15, 1.15))
