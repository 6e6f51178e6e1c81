"""Figures of rule bases."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from matplotlib import pyplot as plt
from matplotlib.axes import Axes

from shipnet.errors import ArgumentError
from shipnet.fuzzy.audit import Overlaps
from shipnet.fuzzy.decision import Decision
from shipnet.fuzzy.firing import Firing
from shipnet.fuzzy.terms import Variable
from shipnet.style import LIMIT, PAPER

#: Most columns in which a number can be read.
_MOST_NUMBERS = 20


def plot_variable(variable: Variable, ax: Axes | None, crisp: bool) -> Axes:
    """Draw the membership functions of a variable; with `crisp` the limits too, dashed in grey."""
    ax = plt.gca() if ax is None else ax
    grid = np.linspace(variable.low, variable.high, 501)
    for term in variable.terms:
        corners = [x for x in term.corners if variable.low < x < variable.high]
        # Points on both sides of a corner draw a step upright.
        sides = [np.nextafter(corners, end) for end in (-np.inf, np.inf)]
        x = np.unique(np.concatenate([grid, corners, *sides]))
        ax.plot(x, term.membership(x), label=term.english or term.name)
    ends = {end for term in variable.terms for end in (term.crisp.low, term.crisp.high)}
    label = "as printed"
    for limit in sorted(end for end in ends if np.isfinite(end)) if crisp else ():
        ax.axvline(limit, **PAPER, linewidth=1, zorder=0.5, label=label)  # type: ignore[arg-type]
        label = "_again"
    # Two narrow terms lie too near each other for labels of their own.
    ax.legend(loc="best", fontsize="small", handlelength=1.2, labelspacing=0.2)
    ax.set_xlim(variable.low, variable.high)
    ax.set_ylim(-0.05, 1.05)
    ax.set_yticks([0, 0.5, 1])
    name = f"{variable.english} {variable.name}".strip()
    ax.set_xlabel(f"{name} [{variable.unit}]" if variable.unit else name)
    ax.set_ylabel("membership")
    return ax


def plot_firing(firing: Firing, ax: Axes | None, labels: Sequence[object] | None) -> Axes:
    """Draw firing strengths as a matrix; those above 0 are written if the samples are few."""
    if firing.strength.ndim > 2:
        raise ArgumentError(f"strength has {firing.strength.ndim} axes; a matrix has two")
    strength = np.atleast_2d(firing.strength)
    n_samples = len(strength)
    if labels is not None and len(labels) != n_samples:
        raise ArgumentError(f"there are {len(labels)} labels; expected {n_samples}")
    ax = plt.gca() if ax is None else ax
    _matrix(ax, strength.T, 1.0)
    if n_samples <= _MOST_NUMBERS:
        for (place, rule), value in np.ndenumerate(strength):
            if value > 0:
                text = "1" if value == 1 else f"{value:.2f}".removeprefix("0")
                _write(ax, place, rule, text, value)
    if labels is not None:
        ax.set_xticks(range(n_samples), [str(label) for label in labels])
    ax.set_yticks(range(len(firing.base.codes)), firing.base.codes)
    ax.set_xlabel("sample")
    ax.set_ylabel("rule")
    return ax


def plot_decision(decision: Decision, time: npt.ArrayLike, ax: Axes | None) -> Axes:
    """Draw strengths over time, and a line along the foot of each row while its code is active."""
    strength, when = decision.firing.strength, np.asarray(time, float)
    if when.size < 2 or strength.shape[:-1] != when.shape:
        raise ArgumentError(
            f"time has the shape {when.shape}, the samples {strength.shape[:-1]}; they must be "
            "equal rows of 2 or more"
        )
    ax = plt.gca() if ax is None else ax
    base = decision.firing.base
    ranking, codes = base.ranking, base.codes
    places = [codes.index(code) for code in ranking]
    # A reading holds until the next one.
    edges = np.append(when, 2 * when[-1] - when[-2])
    rows = np.arange(len(ranking) + 1) - 0.5
    mesh = ax.pcolormesh(edges, rows, strength[:, places].T, cmap="Blues", vmin=0, vmax=1)
    for row, place in enumerate(places):
        active = np.append(decision.active[:, place], False)
        ax.fill_between(
            edges, row + 0.28, row + 0.5, where=active, step="post", color=LIMIT["color"],
            linewidth=0, label="active" if row == 0 else "_again",
        )  # fmt: skip
    ax.set_ylim(len(ranking) - 0.5, -0.5)
    ax.set_yticks(range(len(ranking)), ranking, fontsize=8)
    ax.grid(visible=False)
    ax.tick_params(axis="y", length=0)
    ax.set(xlabel="time [s]", ylabel="rule")
    ax.legend(loc="upper left", bbox_to_anchor=(0, 1.14), fontsize=8, borderpad=0)
    ax.figure.colorbar(mesh, ax=ax, label="firing strength", pad=0.02)
    return ax


def plot_overlaps(overlaps: Overlaps, ax: Axes | None) -> Axes:
    """Draw overlaps as a matrix in percent; ``in`` where the column's rule always fires too."""
    ax = plt.gca() if ax is None else ax
    count = overlaps.matrix.to_numpy(dtype=float)
    alone = np.diag(count)[:, None]
    share = np.divide(count, alone, out=np.zeros_like(count), where=alone > 0)
    _matrix(ax, share, 1.0)
    for (row, column), value in np.ndenumerate(share):
        if value > 0 and row != column:
            _write(ax, column, row, "in" if value == 1 else f"{100 * value:.0f}", value)
    names = overlaps.base.codes
    ax.set_xticks(range(len(names)), names)
    ax.set_yticks(range(len(names)), names)
    ax.set_xlabel("fires too, in percent of the regions")
    ax.set_ylabel("when this fires")
    return ax


def _matrix(ax: Axes, values: npt.NDArray[np.float64], highest: float) -> None:
    rows, columns = values.shape
    ax.imshow(values, cmap="Blues", vmin=0, vmax=highest, aspect="auto", interpolation="nearest")
    ax.grid(visible=False)
    if columns <= _MOST_NUMBERS:
        ax.set_xticks(np.arange(columns - 1) + 0.5, minor=True)
        ax.set_yticks(np.arange(rows - 1) + 0.5, minor=True)
        ax.grid(visible=True, which="minor", color="0.88")
    ax.tick_params(which="both", length=0)


def _write(ax: Axes, column: int, row: int, text: str, value: float) -> None:
    # Black on the pale half of the map, white on the dark one.
    colour = "white" if value > 0.6 else "0.1"
    ax.text(column, row, text, ha="center", va="center", color=colour, fontsize=7)
