"""Figures of the receive ring."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.patches import Patch, Wedge

from shipnet.fields import check_whole
from shipnet.remote_control.ring_buffer import Case, Ring, State, pointer_case
from shipnet.style import LIMIT

__all__ = ["plot_cases", "plot_ring"]

#: What each case shows, and its colour: normal pale, abnormal strong.
_CASES: dict[Case, tuple[str, str]] = {
    "b": ("b: same flags, no >= get_no", "#cfe3f3"),
    "d": ("d: flags differ, no < get_no", "#9cc4e4"),
    "c": ("c: flags differ, no >= get_no", "#f2b27a"),
    "a": ("a: same flags, no < get_no", "#c44e52"),
}


def plot_ring(ring: Ring, *, ax: Axes) -> Axes:
    """Draw a ring as a circle of cells, clockwise from the top, with its writer and its reader.

    Parameters
    ----------
    ring : Ring
        The ring as it is now.
    ax : matplotlib.axes.Axes
        Where to draw.

    Returns
    -------
    matplotlib.axes.Axes
        The axes given. Cells that hold unread bytes are shaded, in red when others have been
        overwritten unread; flags and case stand below. Rings of up to 32 cells show their
        bytes.
    """
    size, state = ring.size, ring.state
    step = 360 / size
    held = {count % size for count in range(max(0, ring.written - min(ring.unread, size)),
                                            ring.written)}  # fmt: skip
    overrun = ring.unread > size
    shade = LIMIT["color"] if overrun else "C0"
    for cell, byte in enumerate(ring.cells):
        middle = 90 - (cell + 0.5) * step
        wedge = Wedge(
            (0, 0), 1, middle - step / 2, middle + step / 2, width=0.25,
            facecolor=shade if cell in held else "white", alpha=0.45 if cell in held else 1,
            edgecolor="0.4", linewidth=0.8 if size <= 32 else 0.3, label=f"cell {cell}",
        )  # fmt: skip
        ax.add_patch(wedge)
        if size <= 32:
            x, y = _at(0.875, middle)
            written = cell < ring.written or ring.written >= size
            ax.text(x, y, f"{byte:02X}" if written else "", ha="center", va="center", fontsize=8)
    for name, cell, radius, tip in (
        ("no", state.no, 1.38, 1.02),
        ("get_no", state.get_no, 0.15, 0.74),
    ):
        angle = 90 - (cell + 0.5) * step
        ax.annotate(
            name, xy=_at(tip, angle), xytext=_at(radius, angle), ha="center", va="center",
            arrowprops={"arrowstyle": "->", "color": "0.2"},
        )  # fmt: skip
    text = f"ring_f = {state.ring_f}, ring_get_f = {state.ring_get_f}"
    text += f"\ncase {ring.case}, {ring.unread} unread"
    ax.text(0, -1.55, text, ha="center", va="top", fontsize="small")
    ax.set_xlim(-1.6, 1.6)
    ax.set_ylim(-2.1, 1.5)
    ax.set_aspect("equal")
    ax.set_axis_off()
    return ax


def plot_cases(size: int = 128, *, ax: Axes, rounds: int = 3) -> Axes:
    """Draw which case shows over the unread bytes and the reader's place.

    Parameters
    ----------
    size : int, default 128
        Size of the ring, 2..512.
    ax : matplotlib.axes.Axes
        Where to draw.
    rounds : int, default 3
        Up to how many rounds the writer leads, 1..8.

    Returns
    -------
    matplotlib.axes.Axes
        The axes given: a map of the four cases; a red dashed line where the ring is full.
    """
    check_whole("size", size, 2, 512)
    check_whole("rounds", rounds, 1, 8)
    order = list(_CASES)
    shown = np.empty((size, rounds * size), int)
    for get_no in range(size):
        for lead in range(rounds * size):
            ring_f, no = divmod((get_no + lead) % (2 * size), size)
            shown[get_no, lead] = order.index(pointer_case(State(no, ring_f, get_no, 0)))
    colours = [colour for _, colour in _CASES.values()]
    ax.imshow(
        shown, cmap=ListedColormap(colours), norm=BoundaryNorm(np.arange(-0.5, 4), 4),
        origin="lower", aspect="auto", interpolation="nearest",
    )  # fmt: skip
    ax.axvline(size, color=LIMIT["color"], linestyle=LIMIT["linestyle"])
    ax.annotate(
        "ring full", (size, 0.5), (-3, 0), xycoords=("data", "axes fraction"),
        textcoords="offset points", ha="right", va="center", color=LIMIT["color"],
    )  # fmt: skip
    ax.set_xlabel("unread bytes [byte]")
    ax.set_ylabel("get_no [index]")
    handles = [Patch(facecolor=colour, label=label) for label, colour in _CASES.values()]
    ax.legend(handles=handles, loc="lower center", bbox_to_anchor=(0.5, 1), ncols=2, frameon=False)
    ax.grid(visible=False)
    return ax


def _at(radius: float, degrees: float) -> tuple[float, float]:
    angle = np.radians(degrees)
    return float(radius * np.cos(angle)), float(radius * np.sin(angle))
