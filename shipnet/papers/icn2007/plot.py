"""Figures of icn2007's section 5."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes

from shipnet import style
from shipnet.asi.receiver import TOLERANCE

__all__ = ["plot_heights", "plot_margins"]

Floats = npt.NDArray[np.floating]


def plot_heights(
    lengths: npt.ArrayLike, height: Mapping[tuple[str, str], Sequence[float]], *, ax: Axes
) -> Axes:
    """Draw the height of pulses over the length of the cable."""
    lengths = np.asarray(lengths)
    spacings = list(dict.fromkeys(spacing for spacing, _ in height))
    for (spacing, end), volts in height.items():
        line = "o-" if end == "open" else "--"
        colour = f"C{spacings.index(spacing)}"
        ax.plot(lengths, volts, line, color=colour, markersize=4)
        ax.annotate(
            f"{spacing}, {end}", (lengths[-1], volts[-1]), (4, 0),
            textcoords="offset points", va="center",
        )  # fmt: skip
    ax.set(xlim=(0, 1.35 * lengths[-1]), ylim=(0, None))
    ax.set(xlabel="length of the cable [m]", ylabel="pulse at the master [V]")
    return ax


def plot_margins(
    lengths: npt.ArrayLike, margin: Mapping[str, tuple[Floats, Floats]], *, ax: Axes
) -> Axes:
    """Draw weakest pulse and ringing over the length of the cable, with their tolerances."""
    lengths = np.asarray(lengths)
    for (end, rows), line in zip(margin.items(), ("-", "--", ":"), strict=False):
        for values, colour, what in zip(
            rows, ("C0", "C1"), ("weakest pulse", "ringing"), strict=True
        ):
            ax.plot(lengths, 100 * values, colour + line, label=f"{what}, {end}")
    limit = style.LIMIT["color"]
    for level, text in [
        (TOLERANCE.evenness, "pulses at least"),
        (TOLERANCE.ringing, "ringing at most"),
    ]:
        ax.axhline(100 * level, color=limit, linestyle=style.LIMIT["linestyle"])
        ax.text(lengths[-1], 100 * level - 9, f"{text} {level:.0%}", color=limit, ha="right")
    ax.axvline(100, color=style.PAPER["color"], linestyle=style.PAPER["linestyle"])
    ax.text(102, 103, "icn2007: 100 m", color=style.PAPER["color"])
    ax.set(xlabel="length of the cable [m]", ylabel="share of the largest pulse [%]")
    ax.set_ylim(0, 112)
    ax.legend(loc="center left", bbox_to_anchor=(1, 0.5))
    return ax
