"""Figures of lee2012, drawn from the text and from our models: no printed figure was available."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes

from shipnet import style
from shipnet.engine.faults import DeadBox
from shipnet.engine.points import read_points
from shipnet.engine.simulation import simulate
from shipnet.engine.system import System
from shipnet.fields import check_choice, check_scalar
from shipnet.papers.lee2012.buses import LINE
from shipnet.papers.lee2012.operation import response_scope, switch_over_scope
from shipnet.papers.plot import FILL, box, diagram, diagrams
from shipnet.papers.registry import drawing

__all__ = ["plot_channels"]

#: Start of each box's loop [s]; the boxes do not start together.
_PHASES = {"JB1": 0.0, "JB2": 0.08, "JB3": 0.12}

diagrams("lee2012", "Fig 6", height=3.6)
diagrams("lee2012", "Fig 7", height=4.4, arrowstyle="-")
diagrams("lee2012", "Fig 8", height=2.6)
diagrams("lee2012", "Fig 10", arrowstyle="-")
drawing("lee2012", "Fig 3")(lambda *, ax: System().plot(ax=ax))
drawing("lee2012", "Fig 5")(
    lambda *, ax: simulate(System(), until=1.3, phases=_PHASES).plot_timeline(1.0, 1.3, ax)
)


@drawing("lee2012", "Fig 2")
def _engine(*, cylinders: int = 8, ax: Axes) -> Axes:
    """Draw a simplified side view of the engine, with a junction box on each floor."""
    box(ax, (0, 0), cylinders, 1, "0.92", "crankcase and bearings", edgecolor="0.4")
    box(ax, (0, 1), cylinders, 1, "0.96", "frame box", edgecolor="0.4")
    for number in range(cylinders):
        box(ax, (number + 0.15, 2), 0.7, 0.9, "#cfe3f3", f"{number + 1}", edgecolor="0.4")
    listed = read_points()
    counted = listed.counts()["points"]
    for floor, name in enumerate(listed.boxes):
        y = 2.1 - floor
        ax.plot([-0.9, cylinders + 0.4], [y - 0.1, y - 0.1], color="0.3", lw=1)
        points = f"{name}\n{counted[name]}\npoints"
        box(ax, (cylinders + 0.55, y), 1.35, 0.8, FILL["amber"], points)
        ax.text(-0.95, y, f"floor {3 - floor}", ha="right")
    return style.bare(ax, (-2.2, cylinders + 2.1), (-0.1, 3.0))


@drawing("lee2012", "Fig 1")
def _wiring(*, ax: Axes) -> Axes:
    """Draw a cable from each sensor to its junction box, and on to the control room."""
    points, top = read_points(), 3.2
    by_box = points.by_box()
    for x, width, room in ((-0.3, 5.5, "engine room"), (6.4, 2.0, "engine\ncontrol room")):
        box(ax, (x, -0.3), width, top + 0.6, "0.97", edgecolor="0.6", linestyle="--")
        ax.text(x + width / 2, top + 0.4, room, ha="center", va="bottom")
    rise, cables = 0.0, len(points)
    for floor, (name, sensors) in enumerate(by_box.items()):
        y = top - 0.4 - 1.2 * floor
        heights = y + np.linspace(0.38, -0.38, len(sensors))
        ends = top * (1 - (rise + np.arange(len(sensors)) + 0.5) / cables)
        ax.plot(np.full(len(sensors), 0.5), heights, ".", color="C0", markersize=3)
        ax.plot([0.5, 3.4], [heights, heights], color="C0", lw=0.4)
        ax.plot([4.6, 7.0], [heights, ends], color="C0", lw=0.4)
        box(ax, (3.4, y - 0.45), 1.2, 0.9, FILL["amber"], f"{name}\n{len(sensors)}\nsensors")
        ax.text(0.4, y, f"floor {3 - floor}", ha="right", va="center", rotation=90)
        rise += len(sensors)
    box(ax, (7.0, 0), 0.9, top, FILL["blue"], "AMS")
    return style.bare(ax, (-0.4, 8.5), (-0.4, top + 1))


@drawing("lee2012", "Fig 11")
def _screen(*, ax: Axes) -> Axes:
    """Draw the screen of the AMS after JB2 has died."""
    dead = DeadBox("JB2", start=10.0)
    return simulate(System(), faults=dead, until=20.0, phases=_PHASES).screen(13.0).plot(ax)


@drawing("lee2012", "Fig 12")
def _redundancy(*, part: str = "b", cut: float = 1.5, ax: Axes) -> Axes:
    """Draw part a, the test, or b, what the AMS sends if channel 1 is unplugged at `cut` [s]."""
    check_scalar("cut", cut, "s", 0, 2.9)
    if check_choice("part", part, "ab") == "a":
        return diagram("lee2012", "Fig 12", ax=ax, arrowstyle="-")
    traces = switch_over_scope(System(), cut=cut)
    first, second = (traces[f"Tx of channel {number}"][0] for number in (1, 2))
    plot_channels(traces, ax=ax)
    style.moment(ax, 1e3 * cut, "unplugged")
    lost = 1e3 * first[first > cut][0]
    ax.text(lost, 0.05, "  no response")
    _span(ax, lost, 1e3 * second[1], -0.25, "")
    return ax


@drawing("lee2012", "Fig 13", figsize=(6.4, 2.6))
def _response(*, ax: Axes) -> Axes:
    """Draw a request, a silence and a response, with the silence and the total time."""
    traces, silence = response_scope(), 1e3 * LINE.t35
    plot_channels(traces, ax=ax)
    begin, end = 1e3 * traces["JB1 sends"][0][[1, -1]] - [0, silence]
    _span(ax, begin - silence, begin, -0.25, "silence ")
    _span(ax, 0.0, end, -1.8, "total ")
    ax.set_ylim(-2, 1.2)
    return ax


def _span(ax: Axes, start: float, stop: float, y: float, name: str) -> None:
    """Mark a span of time [ms] by an arrow, with its name and length to the right."""
    arrow = {"arrowstyle": "<->", "shrinkA": 0, "shrinkB": 0}
    ax.annotate("", (start, y), (stop, y), arrowprops=arrow)
    ax.text(stop, y, f"  {name}{stop - start:.3g} ms", va="center")


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
            beside = ax.get_yaxis_transform()
            ax.text(1.01, height, f"{text:g}", transform=beside, va="center")
        middles.append(base + 0.5)
    ax.set_yticks(middles, [name.replace(" of ", " of\n") for name in channels])
    ax.set(xlabel="time [ms]", ylim=(-1.5 * (len(channels) - 1) - 0.25, 1.45))
    return ax
