"""Figures of rule bases."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes

from shipnet.errors import ArgumentError
from shipnet.fuzzy.decide import Decision
from shipnet.fuzzy.strengths import Firing
from shipnet.fuzzy.terms import Variable
from shipnet.style import LIMIT, PAPER

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["plot_decision", "plot_firing", "plot_overlaps", "plot_terms"]

#: Most columns in which a number can be read.
_MOST_NUMBERS = 20


def plot_terms(variable: Variable, *, ax: Axes, crisp: bool = True) -> Axes:
    """Draw the membership functions of a variable over its universe.

    Parameters
    ----------
    variable : Variable
        What to draw.
    ax : matplotlib.axes.Axes
        Where to draw.
    crisp : bool, default True
        Draw the limits of the comparisons as printed too, dashed in grey.

    Returns
    -------
    matplotlib.axes.Axes
        The axes given; one line a term, in the order of the terms, and a legend.
    """
    grid = np.linspace(variable.low, variable.high, 501)
    for term in variable.terms:
        corners = [x for x in term.corners if variable.low < x < variable.high]
        # A point on either side of a corner draws a step upright.
        sides = [np.nextafter(corners, end) for end in (-np.inf, np.inf)]
        x = np.unique(np.concatenate([grid, corners, *sides]))
        ax.plot(x, term.membership(x), label=term.english or term.name)
    ends = {end for term in variable.terms for end in (term.crisp.low, term.crisp.high)}
    label = "as printed"
    for limit in sorted(end for end in ends if np.isfinite(end)) if crisp else ():
        ax.axvline(limit, **PAPER, linewidth=1, zorder=0.5, label=label)  # type: ignore[arg-type]
        label = "_again"
    # Two narrow terms stand too near each other for labels of their own.
    ax.legend(loc="best", fontsize="small", handlelength=1.2, labelspacing=0.2)
    ax.set_xlim(variable.low, variable.high)
    ax.set_ylim(-0.05, 1.05)
    ax.set_yticks([0, 0.5, 1])
    name = f"{variable.english} {variable.name}".strip()
    ax.set_xlabel(f"{name} [{variable.unit}]" if variable.unit else name)
    ax.set_ylabel("membership")
    return ax


def plot_firing(firing: Firing, *, ax: Axes, labels: Sequence[object] | None = None) -> Axes:
    """Draw the firing strengths of rules and samples as a matrix.

    Parameters
    ----------
    firing : Firing
        Strengths of samples along one axis.
    ax : matplotlib.axes.Axes
        Where to draw.
    labels : sequence, optional
        What to write below each sample; their numbers if omitted.

    Returns
    -------
    matplotlib.axes.Axes
        The axes given: one row a rule, the first on top, one column a sample; strengths above 0
        are written into the cells if there are 20 samples or fewer.
    """
    strength = firing.strength
    if strength.ndim != 2:
        raise ArgumentError(f"strength has {strength.ndim} axes; a matrix has two")
    n_samples = len(strength)
    if labels is not None and len(labels) != n_samples:
        raise ArgumentError(f"there are {len(labels)} labels; expected {n_samples}")
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


def plot_decision(decision: Decision, time: npt.ArrayLike, *, ax: Axes) -> Axes:
    """Draw how strongly every rule fires over time, and when it is active.

    Parameters
    ----------
    decision : Decision
        Of samples along one axis, which is that of time.
    time : array_like of float, shape (n_samples,)
        When, increasing [s]; 2 or more.
    ax : matplotlib.axes.Axes
        Where to draw.

    Returns
    -------
    matplotlib.axes.Axes
        The axes given: one row a rule, the highest priority on top, as dark as its strength; a line
        along its foot while its code is active.

    Raises
    ------
    ArgumentError
        If there are fewer samples, or not as many as times.
    """
    strength, when = decision.firing.strength, np.asarray(time, float)
    if when.size < 2 or strength.shape[:-1] != when.shape:
        raise ArgumentError(
            f"time has the shape {when.shape}, the samples {strength.shape[:-1]}; they must be "
            "equal rows of 2 or more"
        )
    base = decision.firing.base
    ranking, codes = base.ranking, base.codes
    places = [codes.index(code) for code in ranking]
    # What was read holds until the next reading.
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


def plot_overlaps(matrix: pd.DataFrame, *, ax: Axes) -> Axes:
    """Draw which rules can fire together as a matrix.

    Parameters
    ----------
    matrix : pandas.DataFrame
        What `overlap_matrix` returned.
    ax : matplotlib.axes.Axes
        Where to draw.

    Returns
    -------
    matplotlib.axes.Axes
        The axes given. A cell is as dark as the share of the row's rule in which the column's rule
        fires too, written in percent; ``in`` where it always does; white where it cannot.
    """
    count = matrix.to_numpy(dtype=float)
    alone = np.diag(count)[:, None]
    share = np.divide(count, alone, out=np.zeros_like(count), where=alone > 0)
    _matrix(ax, share, 1.0)
    for (row, column), value in np.ndenumerate(share):
        if value > 0 and row != column:
            _write(ax, column, row, "in" if value == 1 else f"{100 * value:.0f}", value)
    names = [str(name) for name in matrix.index]
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
