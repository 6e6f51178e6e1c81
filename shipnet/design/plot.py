"""Wiring schematics with their strands counted, and the figures of options side by side."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from importlib.resources import as_file, files
from io import StringIO
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import FancyBboxPatch

from shipnet.design.costs import FIGURES, Quantities, check_figure
from shipnet.design.plant import asi_conductors, count_points, hardwired_conductors
from shipnet.design.settings import words
from shipnet.design.uncertainty import Tornado
from shipnet.errors import ArgumentError
from shipnet.signals import SIGNALS
from shipnet.style import LIMIT

__all__ = ["plot_asi", "plot_hardwired", "plot_pareto", "plot_quantities", "plot_tornado", "svg"]

_PANEL, _DEVICE, _MODULE = "#8cc4e8", "#f5c56b", "#7fcfb4"
_CABLE = "#d4a800"  # the flat AS-i cable is yellow

#: Sizes of a dot and of a label, as parts of what all dots span along x and along y.
_DOT, _WORD = np.array([0.02, 0.03]), np.array([0.3, 0.07])


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
    """Draw every point of an I/O list wired to the panel on its own: kim2023's Fig 1."""
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
    """Draw the same points on one AS-i line: kim2023's Fig 2."""
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


def plot_quantities(
    options: Mapping[str, Quantities],
    figure: str = "total cost",
    *,
    ax: Axes,
    likely: pd.DataFrame | None = None,
) -> Axes:
    """Draw a figure of several options side by side, with its range."""
    check_figure(figure)
    if not options:
        raise ArgumentError("there is no option to draw")
    rows = np.arange(len(options))
    ends = np.array(
        [quantity.table.loc[figure, ["low", "nominal", "high"]] for quantity in options.values()],
        dtype=float,
    )
    ax.barh(rows, ends[:, 1], height=0.6, color="C5", label="nominal")
    ax.hlines(
        rows, ends[:, 0], ends[:, 2], color="0.25", linewidth=1.2, label="all low to all high"
    )
    if likely is not None:
        span = [likely.loc[(option, figure), ["low", "high"]] for option in options]
        low, high = np.array(span, dtype=float).T
        ax.hlines(rows, low, high, color="C0", linewidth=6, alpha=0.8, label="9 of 10 draws")
    ax.set_yticks(rows, list(options))
    ax.invert_yaxis()
    ax.set(xlabel=_label(figure), xlim=(0, None))
    ax.grid(visible=False, axis="y")
    ax.legend(loc="lower left", bbox_to_anchor=(0, 1), ncols=3, fontsize=8)
    return ax


def plot_tornado(tornado: Tornado, *, ax: Axes, rows: int = 8) -> Axes:
    """Draw what each assumption does to a figure, the one that does most on top."""
    names = tornado.top(rows)
    ends = tornado.ends.loc[names]
    y, base = np.arange(len(names)), tornado.at_nominal
    for level, colour in (("low", "C5"), ("high", "C1")):
        values = ends[level].to_numpy()
        ax.barh(y, values - base, left=base, height=0.7, color=colour, label=f"at its {level}")
    ax.axvline(base, color="0.25", linewidth=1)
    ax.set_yticks(y, [words(name) for name in names], fontsize=8)
    ax.set_ylim(max(len(names), 1) - 0.5, -0.5)
    ax.set_xlabel(f"{tornado.subject} [{tornado.unit}]")
    ax.locator_params(axis="x", nbins=6)
    ax.grid(visible=False, axis="y")
    low, high = ax.get_xlim()
    if len(tornado.between) == 2 and low <= 0 <= high:
        ax.axvline(0, color=LIMIT["color"], linestyle=LIMIT["linestyle"])
    ax.legend(loc="lower right", fontsize=8)
    return ax


def plot_pareto(
    table: pd.DataFrame,
    x: str = "total cost",
    y: str = "conductors at the cabinet",
    *,
    pareto: pd.Series | None = None,
    ax: Axes,
) -> Axes:
    """Draw two figures of every option, and which options are Pareto-optimal in them."""
    missing = [name for name in (x, y) if name not in table.columns]
    if missing:
        raise ArgumentError(f"the table has no column {' and no column '.join(missing)}")
    best = pd.Series(False, index=table.index) if pareto is None else pareto.reindex(table.index)
    best = best.astype("boolean").fillna(False).astype(bool)
    front = table[best].sort_values([x, y])
    ax.plot(front[x], front[y], color="C0", linewidth=1, drawstyle="steps-post", zorder=1)
    for at_x, at_y, filled in zip(table[x], table[y], best, strict=True):
        ax.plot(
            [at_x], [at_y], marker="o", markersize=7, linestyle="none", color="C0",
            markerfacecolor="C0" if filled else "white", zorder=3 if filled else 2,
        )  # fmt: skip
    for place in _places(table[[x, y]]):
        # A label stands on the side where there is room, below its dot if one is above already.
        right, up = (-1 if place.left else 1), (-1 if place.below else 1)
        ax.annotate(
            place.names, place.at, (6 * right, 5 * up), textcoords="offset points", fontsize=8,
            ha="right" if place.left else "left", va="top" if place.below else "bottom",
        )  # fmt: skip
    ax.set(xlabel=_label(x), ylabel=_label(y))
    ax.margins(0.15)
    return ax


class _Place(NamedTuple):
    """Options whose dots cover each other, and where their label goes."""

    names: str
    at: tuple[float, float]
    left: bool
    below: bool


def _places(values: pd.DataFrame) -> list[_Place]:
    """Return where options stand, in the order of the table."""
    known = values.dropna().astype(float)
    at = known.to_numpy()
    spread = np.ptp(at, axis=0) if len(at) else np.ones(2)
    shown = (at - at.min(axis=0, initial=np.inf)) / np.where(spread > 0, spread, 1.0)
    groups: list[list[int]] = []
    for row in range(len(shown)):
        near = [g for g in groups if (abs(shown[g[0]] - shown[row]) < _DOT).all()]
        if near:
            near[0].append(row)
        else:
            groups.append([row])
    places = []
    above: list[int] = []
    for first, *others in groups:
        names = ", ".join(str(known.index[row]) for row in (first, *others))
        below = any((abs(shown[row] - shown[first]) < _WORD).all() for row in above)
        places.append(_Place(names, tuple(at[first].tolist()), bool(shown[first, 0] > 0.6), below))
        above += [] if below else [first]
    return places


def _label(name: str) -> str:
    unit = FIGURES.get(name, "1")
    return name if unit == "1" else f"{name} [{unit}]"


def svg(draw: Callable[[Axes], object], *, width: float = 6.4, height: float = 3.2) -> str:
    """Return a drawing as a picture of lines, the same bytes for the same drawing."""
    fixed: Any = {"svg.hashsalt": "shipnet", "svg.fonttype": "path", "text.parse_math": False}
    with as_file(files("shipnet") / "shipnet.mplstyle") as sheet, rc_context(fixed, sheet):
        figure = Figure(figsize=(width, height))
        draw(figure.add_subplot())
        stream = StringIO()
        figure.savefig(stream, format="svg", metadata={"Date": None, "Creator": None})
    return stream.getvalue()
