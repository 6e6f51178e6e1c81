"""Figures of lee2012 that are outlines: the engine, the block diagram, the flow charts, the inputs.

None of the printed figures was available; these are drawn from the text and from our models.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.patches import Rectangle

from shipnet import style
from shipnet.engine.inputs import InputCard
from shipnet.engine.points import read_points
from shipnet.errors import ArgumentError
from shipnet.papers.registry import figure

#: Fill of a block by its kind; light enough to write on.
_FILL = {"field": "#8cc4e8", "box": "#f5c56b", "bus": "#7fcfb4", "": "white"}

#: Figure 7: text, kind, and place of each block, and which are joined.
_BLOCKS = {
    "RTD": ("up to 27\nthermometers", "field", 0, 3),
    "loop": ("up to 17 loops\n4-20 mA", "field", 0, 2),
    "switch": ("up to 11 switches", "field", 0, 1),
    "R/V": ("2 R/V converters\n32 inputs", "box", 1, 3),
    "I/V": ("I/V converter\n18 inputs", "box", 1, 2),
    "B/V": ("B/V converter\nopto-couplers", "box", 1, 1),
    "MCU": ("AT90CAN128\nADC, GPIO, CAN, UART", "", 2, 2),
    "mode": ("3-pole switch: mode\n5-pole switch: options", "", 2, 3),
    "LCD": ("text LCD, LEDs", "", 2, 1),
    "CAN": ("PCA82C250\nCAN transceiver", "bus", 3, 3),
    "UART": ("RS-232 / 422 / 485\nconverters", "bus", 3, 1.5),
    "JB": ("CAN bus to the\nother boxes, 120 ohm", "field", 4, 3),
    "AMS": ("Modbus RTU\nto the AMS", "field", 4, 1.5),
}
_JOINED = [
    ("RTD", "R/V"), ("loop", "I/V"), ("switch", "B/V"), ("R/V", "MCU"), ("I/V", "MCU"),
    ("B/V", "MCU"), ("mode", "MCU"), ("MCU", "LCD"), ("MCU", "CAN"), ("MCU", "UART"),
    ("CAN", "JB"), ("UART", "AMS"),
]  # fmt: skip

#: Figure 6: the main loop and the three interrupts, step by step.
_FLOWS: Mapping[str, Sequence[str]] = {
    "main loop": (
        "read the mode switch:\nJB1, JB2 or JB3",
        "convert the inputs\nof this mode",
        "send the values\non CAN",
        "begin again",
    ),
    "(a) Modbus interrupt": ("request received", "copy all values\ninto the response", "send it"),
    "(b) timer interrupt": ("a box not heard\nfor 4 s?", "set its values\nto 0xFF"),
    "(c) CAN interrupt": (
        "frame received",
        "store the values\nof its sender",
        "reset the timer\nof its sender",
    ),
}


@figure("lee2012", "Fig 2")
def plot_outline(*, cylinders: int = 8, ax: Axes) -> Axes:
    """Draw the engine from its side, simplified, with a junction box on each floor: Fig 2."""
    ax.add_patch(Rectangle((0, 0), cylinders, 1, facecolor="0.92", edgecolor="0.4"))
    ax.add_patch(Rectangle((0, 1), cylinders, 1, facecolor="0.96", edgecolor="0.4"))
    for number in range(cylinders):
        ax.add_patch(Rectangle((number + 0.15, 2), 0.7, 0.9, facecolor="#cfe3f3", edgecolor="0.4"))
        ax.text(number + 0.5, 2.45, f"{number + 1}", ha="center", va="center", fontsize=8)
    listed = read_points()
    counted = listed.counts()["points"]
    for floor, box in enumerate(listed.boxes):
        y = 2.1 - floor
        ax.plot([-0.9, cylinders + 0.4], [y - 0.1, y - 0.1], color="0.3", lw=1)
        ax.add_patch(
            Rectangle((cylinders + 0.55, y), 1.35, 0.6, facecolor=_FILL["box"], edgecolor="0.2")
        )
        ax.text(
            cylinders + 1.22, y + 0.3, f"{box}\n{counted[box]} points",
            ha="center", va="center", fontsize=8,
        )  # fmt: skip
        ax.text(-0.95, y, f"floor {3 - floor}", ha="right", fontsize=8)
    for floor, label in enumerate(("crankcase and bearings", "frame box")):
        ax.text(cylinders / 2, floor + 0.5, label, ha="center", va="center", fontsize=8)
    return style.bare(ax, (-2.2, cylinders + 2.1), (-0.1, 3.0))


@figure("lee2012", "Fig 7")
def plot_blocks(*, ax: Axes) -> Axes:
    """Draw the blocks of a junction box from the inputs to the buses: Fig 7."""
    for first, second in _JOINED:
        (*_, x, y), (*_, u, v) = _BLOCKS[first], _BLOCKS[second]
        ax.plot([2 * x, 2 * u], [y, v], color="0.45", lw=1, zorder=1)
    for text, kind, x, y in _BLOCKS.values():
        _block(ax, (2 * x, y), text, _FILL[kind])
    return style.bare(ax, (-0.95, 8.95), (0.55, 3.45))


@figure("lee2012", "Fig 6")
def plot_flow(*, ax: Axes) -> Axes:
    """Draw the main loop of a junction box and its three interrupts: Fig 6."""
    for column, (title, steps) in enumerate(_FLOWS.items()):
        x = 2.2 * column
        ax.text(x, 4.0, title, ha="center", va="center", fontsize=9, weight="bold")
        for place, step in enumerate(steps):
            if place:
                _arrow(ax, (x, 3.98 - place), (x, 3.62 - place))
            _block(ax, (x, 3.3 - place), step, "white" if column else _FILL["box"])
    # The loop goes back to the conversion: the mode is read once.
    ax.plot([-0.82, -1.05, -1.05], [0.3, 0.3, 2.3], color="0.3", lw=1)
    _arrow(ax, (-1.05, 2.3), (-0.82, 2.3))
    return style.bare(ax, (-1.3, 7.6), (-0.1, 4.25))


def plot_inputs(card: InputCard, corrected: InputCard, *, axes: Sequence[Axes]) -> None:
    """Draw what the converter sees of a current loop and of a thermometer: Fig 8."""
    current = np.linspace(0, 24e-3, 400)
    resistance = np.linspace(70, 190, 400)
    for inputs, label, line in ((card, "as printed", "-"), (corrected, "corrected", "--")):
        for place, (ax, signal, scale) in enumerate(
            zip(axes, (current, resistance), (1e3, 1), strict=True)
        ):
            signals = np.full((signal.size, 2), [12e-3, 120.0])
            signals[:, place] = signal
            ax.plot(scale * signal, inputs.voltage(signals)[:, place], line, label=label)
    for ax, text in zip(axes, ("loop current [mA]", "resistance of the Pt100 [ohm]"), strict=True):
        ax.set(xlabel=text, ylabel="voltage at the ADC [V]")
    axes[0].legend()


def _block(ax: Axes, place: tuple[float, float], text: str, fill: str) -> None:
    x, y = place
    ax.add_patch(
        Rectangle((x - 0.82, y - 0.32), 1.64, 0.64, facecolor=fill, edgecolor="0.2", zorder=2)
    )
    ax.text(x, y, text, ha="center", va="center", fontsize=7.5, zorder=3)


def _arrow(ax: Axes, tail: tuple[float, float], head: tuple[float, float]) -> None:
    ax.annotate("", head, tail, arrowprops={"arrowstyle": "->", "color": "0.3"})


def plot_channels(channels: Mapping[str, tuple[npt.ArrayLike, npt.ArrayLike]], *, ax: Axes) -> Axes:
    """Draw several traces one below the other, as an oscilloscope does.

    Each trace has its own scale, with its lowest and highest value at its right end.
    """
    if not channels:
        raise ArgumentError("channels is empty; there must be one or more")
    middles = []
    for place, (name, (time, level)) in enumerate(channels.items()):
        at, value = np.asarray(time, dtype=np.float64), np.asarray(level, dtype=np.float64)
        if at.ndim != 1 or at.shape != value.shape or not at.size:
            raise ArgumentError(
                f"channel {name!r} has times of shape {at.shape} and levels of {value.shape}; "
                "they must be equal rows"
            )
        low, high = float(np.nanmin(value)), float(np.nanmax(value))
        base = -1.5 * place
        # A trace that never changes lies in the middle of its place.
        unit = (value - low) / (high - low) if high > low else np.full(value.shape, 0.5)
        ax.plot(at * 1e3, base + unit, drawstyle="steps-post", color=f"C{place}", label=name)
        for text, height in ((low, base), (high, base + 1)):
            ax.annotate(
                f"{text:g}", (1.01, height), xycoords=("axes fraction", "data"), fontsize=8,
                va="center", annotation_clip=False,
            )  # fmt: skip
        middles.append(base + 0.5)
    ax.set_yticks(middles, labels=list(channels))
    ax.set(xlabel="time [ms]", ylim=(-1.5 * (len(channels) - 1) - 0.25, 1.25))
    return ax
