"""Figures of immunity: test levels beside each other, and error rates over a disturbance."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from shipnet import style
from shipnet.asi.emc.immunity import levels_table
from shipnet.style import axes as axes_of

#: Parameters of `levels` that say how severe a test is; the others say what kind of test it is.
_SEVERITY = [
    "voltage", "peak voltage", "field strength", "highest frequency",
    "voltage over that of the supply",
]  # fmt: skip

#: Where a test that AS-i has not is drawn: left of all ratios.
_NONE = 0.4


def plot_levels(*, ax: Axes | None = None, table: pd.DataFrame | None = None) -> Axes:
    """Draw the test levels of AS-i over those that a ship asks for."""
    table = levels_table() if table is None else table
    if ax is None:
        ax = axes_of(ax, figsize=(6.4, 4))
    asked = table["parameter"].isin(_SEVERITY) & (table["gap"] != "not asked")
    rows = table[asked].to_dict("records")
    for y, row in enumerate(rows):
        bad = row["gap"] != "covers"
        colour = style.LIMIT["color"] if bad else "C0"
        missing = row["gap"] == "test missing"
        x = _NONE if missing else row["ratio"]
        unsure = row["confirmed"] != "yes"
        ax.plot([1, x], [y, y], color=colour, linewidth=3, alpha=0.5, visible=not missing)
        ax.plot(
            [x], [y], marker="x" if missing else "o", linestyle="none", color=colour,
            markerfacecolor="white" if unsure else colour,
        )  # fmt: skip
        tested = "no test" if missing else f"{row['asi']:g} {row['unit']}"
        text = f"{tested}, ship {row['marine']:g} {row['unit']}"
        ax.annotate(
            text + (" (not confirmed)" if unsure else ""), (max(x, 1.0), y), (7, 0),
            textcoords="offset points", va="center", fontsize=8,
        )  # fmt: skip
    ax.axvline(1, color=style.LIMIT["color"], linestyle=style.LIMIT["linestyle"], zorder=0)
    ax.annotate(
        "what a ship asks for", (1, 1), (0, 3), xycoords=ax.get_xaxis_transform(),
        textcoords="offset points", ha="center", fontsize=8, color=style.LIMIT["color"],
    )  # fmt: skip
    names = [row["test"] + ("" if row["unit"] != "MHz" else ", highest frequency") for row in rows]
    ax.set_yticks(range(len(rows)), names, fontsize=8)
    ax.set_xscale("log")
    ticks = [0.5, 1, 2, 5]
    ax.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    ax.minorticks_off()
    ax.set(
        xlim=(0.8 * _NONE, 16),
        ylim=(len(rows) - 0.5, -0.5),
        xlabel="AS-i level over marine level [1]",
    )
    ax.grid(visible=False, axis="y")
    return ax


def plot_error_rate(
    table: pd.DataFrame, *, ax: Axes | None = None, label: str | None = None, marker: str = "o"
) -> Axes:
    """Draw error rates over the amplitude of a disturbance."""
    ax = axes_of(ax)
    seen = table[table["failed"] > 0]
    bars = np.stack([seen["rate"] - seen["rate_low"], seen["rate_high"] - seen["rate"]])
    points = ax.errorbar(
        seen["amplitude_V"], seen["rate"], bars, fmt=marker, markersize=4, capsize=2, label=label
    )
    none = table[table["failed"] == 0]
    ax.errorbar(
        none["amplitude_V"], none["rate_high"], 0.5 * none["rate_high"], fmt="_", uplims=True,
        color=points.lines[0].get_color(),
    )  # fmt: skip
    ax.set_yscale("log")
    ax.set(xlabel="amplitude [V]", ylabel="telegram error rate [1]")
    return ax
