"""Figures of kim2023 whose printed pictures were not available; their positions are ours."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes

from shipnet import style
from shipnet.design.plant import lines_needed
from shipnet.papers.plot import FILL, box
from shipnet.papers.registry import figure

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
