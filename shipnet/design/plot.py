"""Wiring schematics drawn from an I/O list, with the strands counted on them."""

from __future__ import annotations

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.patches import FancyBboxPatch

from shipnet.design.cabling import SIGNALS, asi_conductors, count_points, hardwired_conductors
from shipnet.errors import ArgumentError

__all__ = ["plot_asi", "plot_hardwired"]

_PANEL, _DEVICE, _MODULE = "#8cc4e8", "#f5c56b", "#7fcfb4"
_CABLE = "#d4a800"  # the flat AS-i cable is yellow


def _box(ax: Axes, x: float, y: float, width: float, height: float, text: str, colour: str) -> None:
    ax.add_patch(
        FancyBboxPatch(
            (x, y - height / 2), width, height,
            boxstyle="round,pad=0.02,rounding_size=0.06", facecolor=colour, edgecolor="0.3",
        )
    )  # fmt: skip
    ax.text(x + width / 2, y, text, ha="center", va="center", fontsize=8)


def _devices(iolist: pd.DataFrame) -> list[tuple[str, pd.DataFrame]]:
    if "device" not in iolist.columns:
        raise ArgumentError("the I/O list has no column device")
    if iolist["device"].isna().any():
        tags = ", ".join(map(str, iolist["tag"][iolist["device"].isna()]))
        raise ArgumentError(f"no device is named for {tags}")
    return [(str(device), points) for device, points in iolist.groupby("device", sort=False)]


def _finish(ax: Axes, rows: float, text: str) -> Axes:
    ax.text(0.5, 0.01, text, transform=ax.transAxes, ha="center", va="bottom", fontsize=10)
    ax.set(xlim=(-0.1, 10.1), ylim=(-rows, 0.9))
    ax.axis("off")
    return ax


def plot_hardwired(iolist: pd.DataFrame, *, ax: Axes) -> Axes:
    """Draw every point of an I/O list wired to the panel on its own: kim2023's Fig 1.

    Parameters
    ----------
    iolist : pandas.DataFrame
        One row a point, with the columns tag, device and signal.
    ax : matplotlib.axes.Axes
        Where to draw.

    Returns
    -------
    matplotlib.axes.Axes
        The axes given; the strands counted stand under the drawing.
    """
    devices = _devices(iolist)
    height = len(devices)
    _box(ax, 0, -(height - 1) / 2, 1.6, height - 0.3, "control\npanel\n(PLC)", _PANEL)
    for row, (device, points) in enumerate(devices):
        spread = 0.62 / max(len(points) - 1, 1)
        for place, point in enumerate(points.itertuples()):
            y = -row + 0.31 - place * spread
            strands = SIGNALS[str(point.signal)].conductors
            for strand in range(strands):
                offset = 0.05 * (strand - (strands - 1) / 2)
                ax.plot([1.66, 7.94], [y + offset, y + offset], color="0.25", linewidth=0.9)
            name = str(point.tag).removeprefix(f"{device}-")
            ax.text(
                7.7, y, f"{name}  {strands} strand{'s' * (strands > 1)}",
                ha="right", va="center", fontsize=7, color="0.25",
                bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.8},
            )  # fmt: skip
        _box(ax, 8, -row, 1.9, 0.72, device, _DEVICE)
    points_by_kind = count_points(iolist)
    shared = [kind for kind in points_by_kind if SIGNALS[kind].common]
    for place, kind in enumerate(shared):
        y = -height + 0.45 - 0.12 * place
        ax.plot([1.66, 7.94], [y, y], color="0.25", linewidth=0.9, linestyle="--")
        ax.text(7.8, y + 0.02, f"return of {kind}", ha="right", va="bottom", fontsize=7)
    strands = hardwired_conductors(points_by_kind)
    return _finish(
        ax,
        height + 0.1 + 0.12 * len(shared),
        f"hardwired: {strands} strands for {len(iolist)} points",
    )


def plot_asi(iolist: pd.DataFrame, *, ax: Axes) -> Axes:
    """Draw the same points on one AS-i line: kim2023's Fig 2.

    Parameters
    ----------
    iolist : pandas.DataFrame
        One row a point, with the columns tag, device and signal; each device gets one module.
    ax : matplotlib.axes.Axes
        Where to draw.

    Returns
    -------
    matplotlib.axes.Axes
        The axes given; the strands counted stand under the drawing.
    """
    devices = _devices(iolist)
    height = len(devices)
    middle = -(height - 1) / 2
    _box(ax, 0, middle, 1.6, height - 0.3, "control\npanel\n(PLC)", _PANEL)
    _box(ax, 2.1, middle, 1.3, 0.9, "AS-i\nmaster", _MODULE)
    ax.plot([1.66, 2.04], [middle, middle], color="0.25", linewidth=3)
    trunk = asi_conductors()
    ax.plot([3.46, 4.2], [middle, middle], color=_CABLE, linewidth=3)
    ax.plot([4.2, 4.2], [0, -(height - 1)], color=_CABLE, linewidth=3, solid_capstyle="round")
    for row, (device, points) in enumerate(devices):
        ax.plot([4.2, 4.95], [-row, -row], color=_CABLE, linewidth=3)
        _box(ax, 5, -row, 1.3, 0.72, f"slave {row + 1}", _MODULE)
        local = hardwired_conductors(count_points(points))
        ax.plot([6.36, 7.94], [-row, -row], color="0.25", linewidth=2)
        ax.text(
            7.15,
            -row + 0.06,
            f"{local} short strands",
            ha="center",
            va="bottom",
            fontsize=7,
            color="0.25",
        )
        _box(ax, 8, -row, 1.9, 0.72, device, _DEVICE)
    ax.text(4.5, 0.45, f"{trunk} strands, data and supply", ha="right", fontsize=8, color="#8a6d00")
    return _finish(ax, height + 0.1, f"AS-i: {trunk} strands in the trunk for {len(iolist)} points")
