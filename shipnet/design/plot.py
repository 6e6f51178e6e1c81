"""Wiring schematics with their strands counted, and the figures of options side by side."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Mapping
from importlib.resources import as_file, files
from io import StringIO
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.patches import FancyBboxPatch

from shipnet.design.costs import Quantities, check_figure, label
from shipnet.design.designs import Design
from shipnet.design.iolist import IoList
from shipnet.design.settings import words
from shipnet.design.site import Trays
from shipnet.design.uncertainty import Tornado
from shipnet.errors import ArgumentError
from shipnet.signals import ASI_PAIR, SIGNALS, hardwired_conductors
from shipnet.style import LIMIT

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


def _axes(ax: Axes | None, size: tuple[float, float] | None = None) -> Axes:
    """Return the axes given, or new ones."""
    if ax is not None:
        return ax
    from matplotlib import pyplot as plt

    made: Axes = plt.subplots(figsize=size)[1]
    return made


def _devices(iolist: IoList) -> list[tuple[str, pd.DataFrame]]:
    points = iolist.points
    missing = points["tag"][points["device"] == ""]
    if len(missing):
        raise ArgumentError(f"no device is named for {', '.join(missing)}")
    return [(str(device), own) for device, own in points.groupby("device", sort=False)]


def plot_points(iolist: IoList, option: str, *, ax: Axes | None = None) -> Axes:
    """Draw the points of a list by device, wired one by one or on an AS-i line."""
    drawers = {"home runs": plot_hardwired, "AS-i": plot_asi}
    if option not in drawers:
        raise ArgumentError(f"option is {option!r}; it must be one of {', '.join(drawers)}")
    _devices(iolist)
    return drawers[option](iolist, ax=_axes(ax, (8, 4)))


def _finish(ax: Axes, rows: float, text: str) -> Axes:
    ax.text(0.5, 0.01, text, transform=ax.transAxes, ha="center", va="bottom", fontsize=10)
    ax.set(xlim=(-0.1, 10.1), ylim=(-rows, 0.9))
    ax.axis("off")
    return ax


def plot_hardwired(iolist: IoList, *, ax: Axes) -> Axes:
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
    points_by_kind = iolist.counts
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


def plot_asi(iolist: IoList, *, ax: Axes) -> Axes:
    """Draw the same points on one AS-i line: kim2023's Fig 2."""
    devices = _devices(iolist)
    height = len(devices)
    middle = -(height - 1) / 2
    _box(ax, 0, middle, 1.6, height - 0.3, "control\npanel\n(PLC)", _PANEL)
    _box(ax, 2.1, middle, 1.3, 0.9, "AS-i\nmaster", _MODULE)
    ax.plot([1.66, 2.04], [middle, middle], color="0.25", linewidth=3)
    trunk = ASI_PAIR
    ax.plot([3.46, 4.2], [middle, middle], color=_CABLE, linewidth=3)
    ax.plot([4.2, 4.2], [0, -(height - 1)], color=_CABLE, linewidth=3, solid_capstyle="round")
    for row, (device, points) in enumerate(devices):
        ax.plot([4.2, 4.95], [-row, -row], color=_CABLE, linewidth=3)
        _box(ax, 5, -row, 1.3, 0.72, f"slave {row + 1}", _MODULE)
        local = hardwired_conductors(Counter(points["signal"]))
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
    figure: str = "total_cost_eur",
    *,
    ax: Axes | None = None,
    likely: pd.DataFrame | None = None,
) -> Axes:
    """Draw a figure of several options side by side, with its range."""
    check_figure(figure)
    if not options:
        raise ArgumentError("there is no option to draw")
    ax = _axes(ax)
    rows = np.arange(len(options))
    ends = np.array(
        [quantity.figures.loc[figure, ["low", "nominal", "high"]] for quantity in options.values()],
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
    ax.set(xlabel=label(figure), xlim=(0, None))
    ax.grid(visible=False, axis="y")
    ax.legend(loc="lower left", bbox_to_anchor=(0, 1), ncols=3, fontsize=8)
    return ax


def plot_tornado(tornado: Tornado, *, ax: Axes | None = None, rows: int = 8) -> Axes:
    """Draw what each assumption does to a figure, the one that does most on top."""
    ax, names = _axes(ax), tornado.top(rows)
    ends = tornado.ends.loc[names]
    y, base = np.arange(len(names)), tornado.at_nominal
    for level, colour in (("low", "C5"), ("high", "C1")):
        values = ends[level].to_numpy()
        ax.barh(y, values - base, left=base, height=0.7, color=colour, label=f"at its {level}")
    ax.axvline(base, color="0.25", linewidth=1)
    ax.set_yticks(y, [words(name) for name in names], fontsize=8)
    ax.set_ylim(max(len(names), 1) - 0.5, -0.5)
    ax.set_xlabel(f"{tornado.subject} [{tornado.unit}]" if tornado.unit else tornado.subject)
    ax.locator_params(axis="x", nbins=6)
    ax.grid(visible=False, axis="y")
    low, high = ax.get_xlim()
    if len(tornado.between) == 2 and low <= 0 <= high:
        ax.axvline(0, color=LIMIT["color"], linestyle=LIMIT["linestyle"])
    ax.legend(loc="lower right", fontsize=8)
    return ax


def plot_pareto(
    table: pd.DataFrame,
    x: str = "total_cost_eur",
    y: str = "conductors_at_cabinet",
    pareto: Collection[str] = (),
    *,
    ax: Axes | None = None,
) -> Axes:
    """Draw two columns of a comparison, a dot per design; those in `pareto` are filled."""
    missing = [name for name in (x, y) if name not in table.columns]
    if missing:
        raise ArgumentError(f"the table has no column {' and no column '.join(missing)}")
    ax = _axes(ax)
    best = table.index.isin(list(pareto))
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
    ax.set(xlabel=label(x), ylabel=label(y))
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


def plot_costs(quantities: Quantities, *, ax: Axes | None = None) -> Axes:
    """Draw what cable, hardware and labour of a design cost, and the total."""
    ax = _axes(ax)
    names = ["cable_cost_eur", "hardware_cost_eur", "labour_cost_eur", "total_cost_eur"]
    rows, ends = np.arange(len(names)), quantities.figures.loc[names]
    ax.barh(rows, ends["nominal"], height=0.6, color="C5", label="nominal")
    ax.hlines(rows, ends["low"], ends["high"], color="0.25", label="all low to all high")
    ax.set_yticks(rows, [label(name).partition(" [")[0] for name in names])
    ax.invert_yaxis()
    ax.set(xlabel=f"cost of {quantities.name} [EUR]", xlim=(0, None))
    ax.grid(visible=False, axis="y")
    ax.legend(loc="lower left", bbox_to_anchor=(0, 1), ncols=2, fontsize=8)
    return ax


#: Colours of cables by kind, and of devices, in a design from above.
_CABLES = {"home run": "0.7", "drop": "0.8", "feeder": "C1", "trunk": "C0"}


def plot_design(design: Design, *, ax: Axes | None = None) -> Axes:
    """Draw a design from above: cables as straight lines, devices as squares."""
    ax = _axes(ax)
    at = design.devices.set_index("device")[["x_m", "y_m"]]
    points = design.iolist.points.set_index("tag")[["x_m", "y_m"]]
    places = pd.concat([at, points])
    runs = design.cables
    for kind, colour in _CABLES.items():
        own = runs[runs["kind"] == kind]
        if len(own):
            a, b = places.loc[own["a"]].to_numpy(float), places.loc[own["b"]].to_numpy(float)
            lines = LineCollection(
                list(np.stack([a, b], axis=1)), colors=colour, linewidths=1.2, label=kind
            )
            ax.add_collection(lines)
    boxes = design.devices[design.devices["kind"].isin(["box", "module", "station"])]
    ax.plot(boxes["x_m"], boxes["y_m"], "s", color="0.25", markersize=4, label="box or module")
    ax.plot(points["x_m"], points["y_m"], ".", color="0.5", markersize=3, label="point")
    ax.plot(*at.loc[design.cabinet], "D", color="C3", label="cabinet")
    ax.set(xlabel="x [m]", ylabel="y [m]", title=design.name)
    ax.margins(0.05)
    ax.autoscale_view()
    ax.legend(loc="upper left", bbox_to_anchor=(1, 1), fontsize=8)
    return ax


def plot_trays(trays: Trays, *, ax: Axes | None = None) -> Axes:
    """Draw trays from above with their nodes, and the cabinets that have a name."""
    ax = _axes(ax)
    ends = trays.places[trays.ends][:, :, :2]
    ax.add_collection(LineCollection(list(ends), colors="C0", linewidths=1.5))
    ax.plot(*trays.places[:, :2].T, "o", color="C0", markersize=4, label="node")
    for number, (name, place) in enumerate(trays.cabinets.items()):
        ax.plot(*place[:2], "D", color="C3", label="" if number else "cabinet")
        ax.annotate(name, place[:2], (5, 5), textcoords="offset points", fontsize=8)
    ax.set(xlabel="x [m]", ylabel="y [m]")
    ax.margins(0.05)
    ax.legend(fontsize=8)
    return ax


def svg(draw: Callable[[Axes], object], *, width: float = 6.4, height: float = 3.2) -> str:
    """Return a drawing as a picture of lines, the same bytes for the same drawing."""
    fixed: Any = {"svg.hashsalt": "shipnet", "svg.fonttype": "path", "text.parse_math": False}
    with as_file(files("shipnet") / "shipnet.mplstyle") as sheet, rc_context(fixed, sheet):
        figure = Figure(figsize=(width, height))
        draw(figure.add_subplot())
        stream = StringIO()
        figure.savefig(stream, format="svg", metadata={"Date": None, "Creator": None})
    return stream.getvalue()
