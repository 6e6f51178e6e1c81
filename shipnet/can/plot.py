"""Figures of a frame's fields, of an arbitration, and of the wait of a message."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Rectangle

from shipnet import style
from shipnet.fields import check_whole

#: Key of each field in `style.FIELD`; all other fields have the key ``frame``.
_COLOURS = {
    "base identifier": "address",
    "identifier extension": "address",
    "RTR": "control",
    "SRR": "control",
    "IDE": "control",
    "r1": "control",
    "r0": "control",
    "DLC": "control",
    "data": "information",
    "CRC sequence": "parity",
}

#: Short names for the labels below narrow fields.
_SHORT = {"CRC delimiter": "CRC del.", "ACK slot": "ACK", "ACK delimiter": "ACK del."}

#: Height of a row, including the labels below and the level line above its cells.
_PITCH = 3.6

_BITS_PER_ROW = 30

#: Width below which the name of a field is written vertically [bit].
_NARROW = 3


@style.applied
def plot_fields(
    bits: str, stuffed: set[int], fields: Sequence[tuple[str, int, int]], ax: Axes | None
) -> Axes:
    """Draw bits as rows of cells, with the line level above; a field is (name, start, length)."""
    width, ax = _BITS_PER_ROW, style.axes(ax)
    colours = [_COLOURS.get(name, "frame") for name, _, length in fields for _ in range(length)]
    for index, (bit, colour) in enumerate(zip(bits, colours, strict=True)):
        row, x = divmod(index, width)
        kind = "pause" if index in stuffed else colour
        look = {"facecolor": style.FIELD[kind], "edgecolor": "0.6", "linewidth": 0.4}
        box = {"facecolor": "white", "pad": 0.4}
        _cell(ax, (x, -row * _PITCH), 1, 0.47, bit, index in stuffed, look, box)
    for name, start, length in fields:
        _outline(ax, name, start, length, width)
    rows = -(-len(bits) // width)
    for row in range(rows):
        levels = [1.3 + 0.5 * int(bit) - row * _PITCH for bit in bits[row * width :][:width]]
        ax.step(range(len(levels) + 1), [*levels, levels[-1]], where="post", color="C0")
        ax.text(-0.4, 0.47 - row * _PITCH, str(row * width), ha="right", va="center")
    ax.set(
        xlim=(-2.2, min(width, len(bits)) + 0.3),
        ylim=(-(rows - 1) * _PITCH - 1.7, 2.1),
        yticks=[],
        xlabel="time from the start of the row [bit]",
    )
    ax.grid(visible=False)
    ax.spines["left"].set_visible(False)
    return ax


def _outline(ax: Axes, name: str, start: int, length: int, width: int) -> None:
    """Draw an outline around each piece of a field, and label the longest piece."""
    pieces = []
    begin = start
    while begin < start + length:
        end = min(start + length, (begin // width + 1) * width)
        pieces.append((begin, end - begin))
        begin = end
    for begin, size in pieces:
        row, x = divmod(begin, width)
        ax.add_patch(
            Rectangle((x, -row * _PITCH), size, 1, facecolor="none", edgecolor="0.2", linewidth=1.0)
        )
    begin, size = max(pieces, key=lambda piece: piece[1])
    row, x = divmod(begin, width)
    anchor, rotation = (x + size / 2, -0.12 - row * _PITCH), 90 if size < _NARROW else 0
    ax.text(*anchor, _SHORT.get(name, name), ha="center", va="top", rotation=rotation)


@style.applied
def plot_contest(
    senders: Sequence[tuple[str, str, set[int], int | None]],
    bus: str,
    ax: Axes | None,
    upto: int | None,
) -> Axes:
    """Draw one row of bits per sender, and the bits on the bus below.

    A sender is (name, bits, indices of stuff bits, bit at which it stopped or None if it won).
    """
    rows, total = len(senders), len(bus)
    last = total - 1 if upto is None else check_whole("upto", upto, 0, total - 1)
    ax = style.axes(ax)
    ax.axvspan(last, last + 1, color="0.93", zorder=0)
    for row, (_, bits, stuffed, stopped) in enumerate(senders):
        end = last if stopped is None else min(last, stopped)
        _bits(ax, bits[: end + 1], stuffed, row)
        if end == stopped:
            corner, red = (stopped, row - 0.34), style.LIMIT["color"]
            ax.add_patch(Rectangle(corner, 1, 0.68, fc="none", ec=red, linewidth=2, zorder=3))
            ax.hlines(row, stopped + 1, last + 1, color="0.5", linestyle=":", linewidth=1.2)
    (winner,) = (stuffed for _, _, stuffed, stopped in senders if stopped is None)
    _bits(ax, bus[: last + 1], winner, rows + 0.35)
    ax.axhline(rows - 0.32, color="0.6", linewidth=0.8)
    names = [style.literal(name) for name, *_ in senders]
    ax.set_yticks([*range(rows), rows + 0.35], labels=[*names, "bus"])
    ax.set(
        xlim=(-0.2, total + 0.2),
        ylim=(rows + 0.9, -0.6),
        xticks=[bit + 0.5 for bit in range(0, total, 2)],
        xticklabels=range(0, total, 2),
        xlabel="bit on the bus, 0 is the start of frame",
    )
    ax.tick_params(length=0)
    ax.grid(visible=False)
    return ax


def _bits(ax: Axes, bits: str, stuffed: set[int], row: float) -> None:
    """Draw bits as a row of cells."""
    for index, bit in enumerate(bits):
        dominant, is_stuff = bit == "0", index in stuffed
        recessive = "white" if is_stuff else style.FIELD["address"]
        look = {
            "facecolor": "#2b6ca3" if dominant else recessive,
            "edgecolor": "0.75" if dominant and is_stuff else "0.5",
            "linewidth": 0.6,
        }
        box = {"facecolor": "#2b6ca3" if dominant else "white", "pad": 0.6}
        text = {"color": "white" if dominant else "black", "zorder": 4}
        _cell(ax, (index, row - 0.34), 0.68, 0.34, bit, is_stuff, look, box, **text)


def _cell(
    ax: Axes,
    corner: tuple[float, float],
    height: float,
    middle: float,
    bit: str,
    is_stuff: bool,
    look: dict[str, Any],
    box: dict[str, Any],
    **text: Any,
) -> None:
    """Draw a bit in its cell; a stuff bit is hatched, with a box behind its text."""
    ax.add_patch(Rectangle(corner, 1, height, hatch="////" if is_stuff else None, **look))
    text |= {"ha": "center", "va": "center", "family": "monospace"}
    bbox = {"edgecolor": "none", **box} if is_stuff else None
    ax.text(corner[0] + 0.5, corner[1] + middle, bit, bbox=bbox, **text)


@style.applied
def plot_wait(
    blocking: float,
    urgent: Sequence[tuple[float, float, float]],
    bit_time: float,
    ax: Axes | None = None,
) -> Axes:
    """Draw the bus time needed within a wait w; `urgent` are frame times, periods and jitters."""
    C, T, J = 1e3 * np.reshape(urgent, (-1, 3)).T
    tau = 1e3 * bit_time

    def needed(w: float) -> float:
        # Rounding keeps a frame that becomes due exactly at the end of w from counting by chance.
        return 1e3 * blocking + float(np.ceil(np.round((w + J + tau) / T, 9)) @ C)

    waits = [1e3 * blocking]
    while (after := needed(waits[-1])) > waits[-1] + 1e-9:
        waits.append(after)
    end = 1.2 * waits[-1] + tau
    jumps = [np.arange(one, end + late, one) - late for one, late in zip(T, J + tau, strict=True)]
    w = [0.0, *sorted(t for several in jumps for t in several if t > 0), end]
    ax = style.axes(ax)
    ax.plot(w, [needed(one + 1e-6) for one in w], drawstyle="steps-post", color="C0")
    ax.plot([0, end], [0, end], "--", color="0.4")
    corners = np.repeat(waits, 2)
    ax.plot(corners[:-1], corners[1:], "C1:.", linewidth=2)
    ax.plot(waits[-1], waits[-1], "C1o", markersize=8)
    label = f"w = {waits[-1]:.2f} ms"
    ax.annotate(label, (waits[-1],) * 2, (4, -14), textcoords="offset points", color="C1")
    ax.annotate("B", (waits[0],) * 2, (-12, 4), textcoords="offset points", color="C1")
    ax.text(0.02 * end, needed(0) + 0.02 * end, "bus time\nneeded", color="C0")
    ax.text(0.45 * end, 0.38 * end, "wait w", color="0.4")
    ax.set(xlabel="wait w [ms]", ylabel="bus time [ms]", xlim=(0, end), ylim=(0, 1.1 * end))
    return ax
