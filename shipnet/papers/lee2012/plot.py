"""Figures of lee2012, drawn from the text and from our models: no printed figure was available."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes

from shipnet import style
from shipnet.engine.inputs import InputCard
from shipnet.engine.points import read_points
from shipnet.papers.plot import FILL, box, diagrams
from shipnet.papers.registry import drawing

__all__ = ["plot_channels", "plot_inputs"]

diagrams("lee2012", "Fig 6", "Fig 8")
diagrams("lee2012", "Fig 7", "Fig 10", "Fig 12(a)", arrowstyle="-")


@drawing("lee2012", "Fig 2")
def _engine(*, cylinders: int = 8, ax: Axes) -> Axes:
    """Draw a simplified side view of the engine, with a junction box on each floor."""
    box(ax, (0, 0), cylinders, 1, "0.92", "crankcase and bearings", edge="0.4")
    box(ax, (0, 1), cylinders, 1, "0.96", "frame box", edge="0.4")
    for number in range(cylinders):
        box(ax, (number + 0.15, 2), 0.7, 0.9, "#cfe3f3", f"{number + 1}", edge="0.4")
    listed = read_points()
    counted = listed.counts()["points"]
    for floor, name in enumerate(listed.boxes):
        y = 2.1 - floor
        ax.plot([-0.9, cylinders + 0.4], [y - 0.1, y - 0.1], color="0.3", lw=1)
        points = f"{name}\n{counted[name]} points"
        box(ax, (cylinders + 0.55, y), 1.35, 0.6, FILL["amber"], points)
        ax.text(-0.95, y, f"floor {3 - floor}", ha="right")
    return style.bare(ax, (-2.2, cylinders + 2.1), (-0.1, 3.0))


@drawing("lee2012", "Fig 1")
def _wiring(*, ax: Axes) -> Axes:
    """Draw a cable from each sensor to its junction box, and on to the control room."""
    points, top = read_points(), 3.2
    by_box = points.by_box()
    for x, width, room in ((-0.3, 5.5, "engine room"), (6.4, 2.0, "engine control room")):
        box(ax, (x, -0.3), width, top + 0.6, "0.97", edge="0.6", linestyle="--")
        ax.text(x + width / 2, top + 0.4, room, ha="center", va="bottom")
    rise, cables = 0.0, len(points)
    for floor, (name, sensors) in enumerate(by_box.items()):
        y = top - 0.4 - 1.2 * floor
        heights = y + np.linspace(0.38, -0.38, len(sensors))
        ends = top * (1 - (rise + np.arange(len(sensors)) + 0.5) / cables)
        ax.plot(np.full(len(sensors), 0.5), heights, ".", color="C0", markersize=3)
        ax.plot([0.5, 3.4], [heights, heights], color="C0", lw=0.4)
        ax.plot([4.6, 7.0], [heights, ends], color="C0", lw=0.4)
        box(ax, (3.4, y - 0.45), 1.2, 0.9, FILL["amber"], f"{name}\n{len(sensors)} sensors")
        ax.text(0.4, y, f"floor {3 - floor}", ha="right", va="center", rotation=90)
        rise += len(sensors)
    box(ax, (7.0, 0), 0.9, top, FILL["blue"], "AMS")
    return style.bare(ax, (-0.4, 8.5), (-0.4, top + 0.8))


def plot_inputs(card: InputCard, corrected: InputCard, *, axes: Sequence[Axes]) -> None:
    """Draw the voltage at the ADC against the loop current and the Pt100 resistance: Fig 8."""
    current = np.linspace(0, 24e-3, 400)
    resistance = np.linspace(70, 190, 400)
    for inputs, label, line in ((card, "as printed", "-"), (corrected, "corrected", "--")):
        for column, (ax, signal, scale) in enumerate(
            zip(axes, (current, resistance), (1e3, 1), strict=True)
        ):
            signals = np.full((signal.size, 2), [12e-3, 120.0])
            signals[:, column] = signal
            ax.plot(scale * signal, inputs.voltage(signals)[:, column], line, label=label)
    for ax, text in zip(axes, ("loop current [mA]", "resistance of the Pt100 [ohm]"), strict=True):
        ax.set(xlabel=text, ylabel="voltage at the ADC [V]")
    axes[0].legend()


def plot_channels(channels: Mapping[str, tuple[npt.ArrayLike, npt.ArrayLike]], *, ax: Axes) -> Axes:
    """Draw traces one below the other, each with its own scale, as an oscilloscope does."""
    middles = []
    for row, (name, (time, level)) in enumerate(channels.items()):
        at, value = np.asarray(time, dtype=np.float64), np.asarray(level, dtype=np.float64)
        low, high = float(np.nanmin(value)), float(np.nanmax(value))
        base = -1.5 * row
        # A constant trace is drawn in the middle of its row.
        unit = (value - low) / (high - low) if high > low else np.full(value.shape, 0.5)
        ax.plot(at * 1e3, base + unit, drawstyle="steps-post", color=f"C{row}", label=name)
        for text, height in ((low, base), (high, base + 1)):
            ax.annotate(
                f"{text:g}",
                (1.01, height),
                xycoords=("axes fraction", "data"),
                va="center",
                annotation_clip=False,
            )
        middles.append(base + 0.5)
    ax.set_yticks(middles, labels=list(channels))
    ax.set(xlabel="time [ms]", ylim=(-1.5 * (len(channels) - 1) - 0.25, 1.25))
    return ax
