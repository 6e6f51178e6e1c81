"""The functions that recompute claims and draw figures of the papers.

The function of a *numeric* claim returns our number. The function of a *qualitative* claim returns
whether the statement holds or, as a float, by which fraction of its limit: negative if it does not
hold. Functions have named inputs, so that a test can change an input
and see the result change. Claims that differ only in their inputs share a function.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable, Collection, Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from typing import Any, TypeVar

from shipnet import datasets, style
from shipnet.errors import ArgumentError, FrameError
from shipnet.fields import check_choice
from shipnet.lazy import Axes

Function = TypeVar("Function", bound=Callable[..., Any])


@dataclass(frozen=True, eq=False)
class Recomputation:
    """A function, its inputs for a claim, and the inputs with which a check must fail."""

    function: Callable[..., Any]
    inputs: Mapping[str, object]
    counter: Mapping[str, object]

    def __call__(self, **others: object) -> Any:
        """Return the claim's value, with some inputs replaced."""
        return self.function(**{**self.inputs, **others})

    @cached_property
    def value(self) -> Any:
        """The number, or whether the statement holds, or its margin."""
        return self()

    @property
    def evidence(self) -> str:
        """Full name of the function."""
        return f"{self.function.__module__}.{self.function.__name__}"


#: The papers by key, in the order in which they are shown.
PAPERS: Mapping[str, str] = {
    "kim2023": "Kim, Cho and Hyun, AS-Interface protocol utilization for smart ships, 2023",
    "icn2007": "AS-Interface communication system for field networks (2), 2007",
    "lee2012": "Lee and Kim, Distributed control system on dual field-bus for ship engine, 2012",
    "chung1998": "Chung and Rhyu, Communication method for a ship main engine remote control, 1998",
    "kim2014": "Kim and Yu, Electro hydraulic ballast remote valve control system, 2014",
}

#: Claim id -> its function; filled as the modules of the papers are imported.
REGISTRY: dict[str, Recomputation] = {}

#: (paper, item) -> function that draws a printed figure on given axes, and its size [inch] if the
#: usual one is too small.
FIGURES: dict[tuple[str, str], tuple[Callable[..., Any], tuple[float, float] | None]] = {}


def load(papers: Collection[str] = tuple(PAPERS)) -> None:
    """Import the modules for the claims of these papers only, because imports take time."""
    for paper in papers:
        importlib.import_module(f"shipnet.papers.{paper}")


def numeric(*claims: str, **inputs: object) -> Callable[[Function], Function]:
    """Register a function, with these inputs, as the recomputation of numeric claims."""
    return check(*claims, counter={}, **inputs)


def check(
    *claims: str, counter: Mapping[str, object], **inputs: object
) -> Callable[[Function], Function]:
    """Register a function, with these inputs, as the check of qualitative claims.

    With the inputs of `counter` the result must be the opposite, or a margin of the opposite sign;
    a test verifies this.
    """

    def decorate(function: Function) -> Function:
        REGISTRY.update(dict.fromkeys(claims, Recomputation(function, inputs, counter)))
        return function

    return decorate


def is_legal(function: Callable[..., object], *arguments: object, **named: object) -> bool:
    """Return whether a function of the package accepts these arguments."""
    try:
        function(*arguments, **named)
    except (ArgumentError, FrameError):
        return False
    return True


def drawing(
    paper: str, *items: str, figsize: tuple[float, float] | None = None
) -> Callable[[Function], Function]:
    """Register a function that draws printed figures on given axes."""

    def decorate(function: Function) -> Function:
        FIGURES.update({(paper, item): (function, figsize) for item in items})
        return function

    return decorate


@style.applied
def figure(paper: str, item: str, ax: Axes | None = None, **inputs: Any) -> Axes:
    """Draw a figure, or a table that is a drawing, from our models and outlines.

    Parameters
    ----------
    paper : str
        A key of `PAPERS`.
    item : str
        The figure as the paper numbers it, such as ``"Fig 7"``.
    ax : matplotlib.axes.Axes, optional
        Where to draw; new axes if omitted.
    **inputs
        Inputs of the drawing, such as another ``frame``; as in the paper if omitted.

    Returns
    -------
    matplotlib.axes.Axes
        The axes drawn on.

    Raises
    ------
    ArgumentError
        If no function draws the item; the message lists the items that are drawn.

    Examples
    --------
    >>> figure("kim2014", "Fig 7").texts[0].get_text()
    'row 9 of the table'
    """
    check_choice("paper", paper, PAPERS)
    load((paper,))
    # Drawings are registered when their module is imported, which loads matplotlib.
    with suppress(ModuleNotFoundError):
        importlib.import_module(f"shipnet.papers.{paper}.plot")
    printed = datasets.read("figures_tables.csv").query("paper == @paper")["item"]
    drawn = [name for name in printed if (paper, name) in FIGURES]
    function, figsize = FIGURES[paper, check_choice("item", item, drawn)]
    options = {"figsize": figsize} if figsize else {}
    made: Axes = function(ax=style.axes(ax, **options), **inputs)
    return made
