"""Printed tables beside those that the code generates, and printed figures redrawn."""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

from shipnet import datasets, style
from shipnet.arguments import checked
from shipnet.errors import ArgumentError
from shipnet.fields import check_choice
from shipnet.lazy import Axes, pd
from shipnet.papers import judging
from shipnet.papers.judging import PAPERS
from shipnet.papers.registry import FIGURES, TABLES


@dataclass(frozen=True)
class PrintedTable:
    """A table of a paper, as printed and as the code generates it."""

    paper: str
    item: str

    @property
    def printed(self) -> pd.DataFrame:
        """The table as text, without conversions, indexed by its first column."""
        begin = f"{self.paper}_{self.item.lower().replace(' ', '')}_"
        (file,) = (name for name in datasets.names() if name.startswith(begin))
        rows = datasets.read(file)
        return rows.set_index(rows.columns[0]).drop(columns="name_printed", errors="ignore")

    @property
    def ours(self) -> pd.DataFrame:
        """The same table from the code."""
        made: pd.DataFrame = TABLES[self.paper, self.item]()
        return made

    def differences(self) -> pd.DataFrame:
        """Return every cell that differs, with its kind, claim and reason, NaN if unexplained.

        A row that only one side has is listed once, with an empty column name.
        """
        theirs, ours = self.printed, self.ours
        found = []
        for row in ours.index.union(theirs.index, sort=False):
            if row not in theirs.index or row not in ours.index:
                pair = ("a row", "no row") if row in theirs.index else ("no row", "a row")
                found.append((self.item, row, "", *pair))
                continue
            for column in ours.columns:
                pair = theirs.loc[row, column], ours.loc[row, column]
                if pair[0] != pair[1]:
                    found.append((self.item, row, column, *pair))
        cells = pd.DataFrame(found, columns=["table", "row", "column", "printed", "ours"])
        reasons = datasets.read(f"{self.paper}_table_differences.csv")
        return cells.merge(reasons, on=["table", "row", "column"], how="left")


@checked
def table(paper: str, item: str) -> PrintedTable:
    """Return a table of a paper, as printed and as the code generates it.

    Parameters
    ----------
    paper : str
        A key of `PAPERS`.
    item : str
        The table as the paper numbers it, such as ``"Table 5"``.

    Returns
    -------
    PrintedTable
        With `printed`, `ours` and `differences()`.

    Raises
    ------
    ArgumentError
        If the code does not generate the table; the message lists the tables that it generates.

    Examples
    --------
    >>> five = table("kim2023", "Table 5")
    >>> five.printed.loc["RESET", "I3"], five.ours.loc["RESET", "I3"]
    ('S', '~S')
    >>> len(table("kim2023", "Table 7").differences())
    0
    """
    check_choice("paper", paper, PAPERS)
    judging.load((paper,))
    if (paper, item) not in TABLES:
        raise ArgumentError(f"item is {item!r}; {_known(TABLES, paper)}")
    return PrintedTable(paper, item)


@checked
def figure(paper: str, item: str, ax: Axes | None = None, **inputs: Any) -> Axes:
    """Draw a figure of a paper from our models and outlines.

    Parameters
    ----------
    paper : str
        A key of `PAPERS`.
    item : str
        The figure as the paper numbers it, such as ``"Fig 7"``.
    ax : matplotlib.axes.Axes, optional
        Where to draw; new axes if omitted.
    **inputs
        What the drawing depends on, such as another ``frame``; as in the paper if omitted.

    Returns
    -------
    matplotlib.axes.Axes
        The axes drawn on.

    Raises
    ------
    ArgumentError
        If no function draws the figure; the message lists those that are drawn, and names the
        notebook that shows it, if there is one.

    Examples
    --------
    >>> figure("kim2014", "Fig 7").texts[0].get_text()
    'row 9 of the table'
    """
    check_choice("paper", paper, PAPERS)
    judging.load((paper,))
    # Drawings are registered as their module is imported, which loads matplotlib.
    with suppress(ModuleNotFoundError):
        importlib.import_module(f"shipnet.papers.{paper}.plot")
    if (paper, item) not in FIGURES:
        items = datasets.read("figures_tables.csv").set_index(["paper", "item"])["notebook"]
        shown = items.get((paper, item))
        known = _known(FIGURES, paper) + (f"; see notebooks/{shown}" if shown else "")
        raise ArgumentError(f"item is {item!r}; {known}")
    made: Axes = FIGURES[paper, item](ax=style.axes(ax), **inputs)
    return made


def _known(registered: Mapping[tuple[str, str], object], paper: str) -> str:
    """Return the end of an error that lists the registered items of a paper."""
    items = sorted(item for key, item in registered if key == paper)
    return f"it must be one of {', '.join(items)}" if items else f"{paper} has none"
