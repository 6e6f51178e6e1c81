"""Figures of the ledger."""

from __future__ import annotations

import pandas as pd
from matplotlib.axes import Axes

from shipnet import style
from shipnet.papers.judging import STATUSES

_COLOURS = {
    "recomputed": "#0072B2",
    "checked": "#56B4E9",
    "ours": "#009E73",
    "context": "#d9d9d9",
    "not reproducible": "#8c8c8c",
    "open": "#E69F00",
}


def draw_counts(counts: pd.DataFrame, ax: Axes | None) -> Axes:
    """Draw the counts of a ledger; numbers below 4 are drawn but not written."""
    ax = style.axes(ax)
    left = pd.Series(0, index=counts.index)
    for status in STATUSES:
        bars = ax.barh(
            counts.index, counts[status], left=left, color=_COLOURS[status], label=status
        )
        labels = [str(number) if number >= 4 else "" for number in counts[status]]
        dark = status in ("recomputed", "ours")
        ax.bar_label(
            bars, labels, label_type="center", color="white" if dark else "black", fontsize=8
        )
        left = left + counts[status]
    ax.invert_yaxis()
    ax.set_xlabel("claims [1]")
    ax.grid(visible=False, axis="y")
    ax.legend(ncols=3, loc="lower center", bbox_to_anchor=(0.45, 1.0), fontsize=8)
    return ax
