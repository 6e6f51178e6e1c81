"""Plots of tables: points with their wires, ranges of values, and one column against another."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterator
from typing import Any

import numpy as np
import numpy.typing as npt

from shipnet import style
from shipnet.errors import ArgumentError
from shipnet.fields import check_choice
from shipnet.lazy import Axes, pd
from shipnet.signals import ASI_PAIR, SIGNALS, hardwired_conductors

_PANEL, _DEVICE, _MODULE = "#8cc4e8", "#f5c56b", "#7fcfb4"
_CABLE = "#d4a800"  # the flat AS-i cable is yellow

#: Sizes of a dot and of a label, as fractions of the span of all dots along x and y.
_DOT, _WORD = np.array([0.02, 0.03]), np.array([0.3, 0.07])


def _box(ax: Axes, x: float, y: float, width: float, height: float, text: str, colour: str) -> None:
    from matplotlib.patches import FancyBboxPatch

    patch = FancyBboxPatch((x, y - height / 2), width, height, facecolor=colour, edgecolor="0.3")
    patch.set_boxstyle("round,pad=0.02,rounding_size=0.06")
    ax.add_patch(patch)
    ax.text(x + width / 2, y, style.literal(text), ha="center", va="center")


@style.applied
def plot_points(points: pd.DataFrame, option: str, *, ax: Axes | None = None) -> Axes:
    """Draw the points of a list by device, wired individually or on an AS-i line."""
    drawers = {"home runs": _plot_hardwired, "AS-i": _plot_asi}
    check_choice("option", option, drawers)
    missing = points["tag"][points["device"] == ""]
    if len(missing):
        raise ArgumentError(
            f"the list names no device for {len(missing)} of {len(points)} points, the first is "
            f"{missing.iloc[0]}; add a column device, or draw a design: points.plan('CAN').plot()"
        )
    devices = [(str(device), rows_of) for device, rows_of in points.groupby("device", sort=False)]
    ax = style.axes(ax, figsize=(6.4, 4))
    height = len(devices)
    _box(ax, 0, -(height - 1) / 2, 1.4, height - 0.3, "control\npanel\n(PLC)", _PANEL)
    for row, (device, _) in enumerate(devices):
        _box(ax, 8, -row, 1.9, 0.72, device, _DEVICE)
    rows, text = drawers[option](ax, devices, Counter(points["signal"]))
    ax.text(0.5, 0.01, text, transform=ax.transAxes, ha="center", va="bottom")
    ax.set(xlim=(-0.1, 10.1), ylim=(-rows, 0.9))
    ax.axis("off")
    return ax


def _plot_hardwired(
    ax: Axes, devices: list[tuple[str, pd.DataFrame]], counts: Counter[str]
) -> tuple[float, str]:
    """Draw points wired individually as in kim2023's Fig 1; return the height and a caption."""
    height = len(devices)
    for row, (device, points) in enumerate(devices):
        spread = 0.62 / max(len(points) - 1, 1)
        for number, point in enumerate(points.itertuples()):
            y = -row + 0.31 - number * spread
            conductors = SIGNALS[str(point.signal)].conductors
            for conductor in range(conductors):
                offset = 0.05 * (conductor - (conductors - 1) / 2)
                ax.plot([1.46, 7.94], [y + offset, y + offset], color="0.25", linewidth=0.9)
            s = "s" if conductors > 1 else ""
            words = f"{str(point.tag).removeprefix(f'{device}-')}  {conductors} conductor{s}"
            white = {"facecolor": "white", "edgecolor": "none", "pad": 0.8}
            ax.text(7.7, y, style.literal(words), ha="right", va="center", color="0.25", bbox=white)
    shared = [kind for kind in counts if SIGNALS[kind].common]
    for number, kind in enumerate(shared):
        y = -height + 0.45 - 0.12 * number
        ax.plot([1.46, 7.94], [y, y], color="0.25", linewidth=0.9, linestyle="--")
        ax.text(7.8, y + 0.02, f"return of {kind}", ha="right", va="bottom")
    conductors = hardwired_conductors(counts)
    text = f"hardwired: {conductors} conductors for {counts.total()} points"
    return height + 0.1 + 0.12 * len(shared), text


def _plot_asi(
    ax: Axes, devices: list[tuple[str, pd.DataFrame]], counts: Counter[str]
) -> tuple[float, str]:
    """Draw points on one AS-i line as in kim2023's Fig 2; return the height and a caption."""
    height = len(devices)
    middle = -(height - 1) / 2
    _box(ax, 1.9, middle, 1.4, 0.9, "AS-i\nmaster", _MODULE)
    ax.plot([1.46, 1.84], [middle, middle], color="0.25", linewidth=3)
    ax.plot([3.36, 3.7], [middle, middle], color=_CABLE, linewidth=3)
    ax.plot([3.7, 3.7], [0, -(height - 1)], color=_CABLE, linewidth=3, solid_capstyle="round")
    for row, (_, points) in enumerate(devices):
        ax.plot([3.7, 4.15], [-row, -row], color=_CABLE, linewidth=3)
        _box(ax, 4.2, -row, 1.1, 0.72, f"slave\n{row + 1}", _MODULE)
        local = hardwired_conductors(Counter(points["signal"]))
        ax.plot([5.36, 7.94], [-row, -row], color="0.25", linewidth=2)
        words, above = f"{local} conductors", -row + 0.06
        ax.text(6.65, above, words, ha="center", va="bottom", color="0.25")
    supply = f"{ASI_PAIR} conductors,\ndata and supply"
    ax.text(4.0, 0.42, supply, ha="right", color="#8a6d00")
    return height + 0.1, f"AS-i: {ASI_PAIR} conductors in the trunk for {counts.total()} points"


@style.applied
def plot_ranges(
    ends: pd.DataFrame, words: str, *, likely: pd.DataFrame | None = None, ax: Axes | None = None
) -> Axes:
    """Draw one bar per row of `ends`: nominal value, range, and central 90 % of the draws."""
    ax, rows = style.axes(ax), np.arange(len(ends))
    # A bar of length 0 keeps a row without a value inside the axes.
    ax.barh(rows, ends["nominal"].fillna(0), height=0.6, color="C5", label="nominal")
    ax.hlines(
        rows, ends["low"], ends["high"], color="0.25", linewidth=1.2, label="all low to all high"
    )
    if likely is not None:
        low, high = likely.loc[ends.index, "low"], likely.loc[ends.index, "high"]
        ax.hlines(rows, low, high, color="C0", linewidth=6, alpha=0.8, label="9 of 10 draws")
    ax.set_yticks(rows, [*map(style.literal, ends.index)])
    ax.invert_yaxis()
    ax.set(xlabel=style.literal(words), xlim=(0, None))
    in_thousands(ax)
    ax.grid(visible=False, axis="y")
    ax.legend(loc="lower right", bbox_to_anchor=(1, 1), ncols=3)
    return ax


def in_thousands(ax: Axes) -> None:
    """Number an x axis of costs in kEUR."""
    if (words := ax.get_xlabel()).endswith("[EUR]"):
        ax.set_xlabel(words.replace("[EUR]", "[kEUR]"))
        ax.xaxis.set_major_formatter(lambda x, _: f"{x / 1e3:g}".replace("-", "\N{MINUS SIGN}"))


@style.applied
def plot_pareto(table: pd.DataFrame, pareto: Collection[str], *, ax: Axes | None = None) -> Axes:
    """Plot two columns of a table, one dot per row; dots of rows in `pareto` are filled."""
    ax, (x, y) = style.axes(ax), table.columns
    at, best = table.to_numpy(float), table.index.isin(list(pareto))
    front = at[best][np.lexsort(at[best].T[::-1])]
    ax.plot(*front.T, color="C0", linewidth=1, drawstyle="steps-post", zorder=1)
    for rows, face, name in ((best, "C0", "Pareto-optimal"), (~best, "w", "not Pareto-optimal")):
        look: dict[str, Any] = {"color": "C0", "mfc": face, "label": name}
        ax.plot(*at[rows].T, "o", markersize=7, zorder=3 if face == "C0" else 2, **look)
    for names, xy, left, below in _labels(table.dropna().astype(float)):
        # Each label is on the side with more room, and below its dot if another label is above.
        ha, right = ("right", -6) if left else ("left", 6)
        va, up = ("top", -5) if below else ("bottom", 5)
        place: dict[str, Any] = {"textcoords": "offset points", "ha": ha, "va": va}
        place["bbox"] = {"facecolor": "white", "edgecolor": "none", "pad": 0.5}
        ax.annotate(style.literal(names), xy, (right, up), **place)
    ax.set(xlabel=x, ylabel=y)
    in_thousands(ax)
    ax.margins(0.15)
    if best.any():
        style.legend(ax)
    return ax


def _labels(table: pd.DataFrame) -> Iterator[tuple[str, tuple[float, float], bool, bool]]:
    """Yield each label, the position of its dots, whether it is left of them, and whether below."""
    at = table.to_numpy()
    spread = np.ptp(at, axis=0) if len(at) else np.ones(2)
    shown = (at - at.min(axis=0, initial=np.inf)) / np.where(spread > 0, spread, 1.0)
    groups: list[list[int]] = []
    for row in range(len(shown)):
        near = [g for g in groups if (abs(shown[g[0]] - shown[row]) < _DOT).all()]
        if near:
            near[0].append(row)
        else:
            groups.append([row])
    above: list[int] = []
    for first, *others in groups:
        names = ", ".join(str(table.index[row]) for row in (first, *others))
        below = any((abs(shown[row] - shown[first]) < _WORD).all() for row in above)
        above += [] if below else [first]
        yield names, (at[first, 0], at[first, 1]), bool(shown[first, 0] > 0.6), below


def draw_cables(ax: Axes, ends: npt.ArrayLike, colour: str, dashes: str, label: str) -> None:
    """Draw straight lines between pairs of positions, shape (n, 2, 2)."""
    from matplotlib.collections import LineCollection

    lines = list(np.asarray(ends, dtype=float))
    ax.add_collection(LineCollection(lines, colors=colour, linestyles=dashes, label=label))
