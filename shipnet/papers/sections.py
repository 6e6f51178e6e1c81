"""What each section of a paper says, and the cells, items and claims that follow it.

`data/paper_sections.csv` has the sections; a cell is written as notebook and cell id, such as
``1_telegrams#1-telegrams-07``, after the words of its link.
"""

from __future__ import annotations

from html import escape

from shipnet import datasets
from shipnet.fields import check_choice
from shipnet.lazy import pd
from shipnet.papers.judging import LEFT, html_table
from shipnet.papers.registry import PAPERS


class Contents:
    """The sections of a paper, in the order of the paper."""

    def __init__(self, paper: str) -> None:
        self.paper = check_choice("paper", paper, PAPERS)

    def table(self) -> pd.DataFrame:
        """Return one row per section: what it says, our cells, its items and its claims."""
        rows = datasets.read("paper_sections.csv").query("paper == @self.paper")
        return rows.drop(columns="paper").set_index("section")

    def __repr__(self) -> str:
        rows = self.table()[["says", "items"]].itertuples(name=None)
        return "\n".join(f"{section}: {says} {items}".rstrip() for section, says, items in rows)

    def _repr_html_(self) -> str:
        return self.html()

    def html(self, folder: str = "") -> str:
        """Return the table with links to the notebooks in a folder, such as ``"notebooks/"``."""
        printed = datasets.read("figures_tables.csv").query("paper == @self.paper")
        treated = printed.set_index("item")[["cell", "treatment"]].to_dict("index")

        def link(words: str, cell: str) -> str:
            notebook, _, id = cell.partition("#")
            href = f"{folder}{notebook}.ipynb#cell-id={id}"
            return f'<a href="{href}">{escape(words)}</a>' if cell else escape(words)

        heads = ("section", "what it says", "here", "figures and tables", "claims")
        rows = []
        for section, says, places, items, claims in self.table().itertuples(name=None):
            pairs = [pair.split("=") for pair in str(places).split("; ")]
            listed = [(item, *treated[item].values()) for item in str(items).split("; ") if item]
            cells = (
                escape(str(section)),
                escape(str(says)),
                "<br>".join(link(*pair) for pair in pairs),
                "<br>".join(f"{link(item, cell)} ({label})" for item, cell, label in listed),
                _short(str(claims).split()),
            )
            rows.append("".join(f"<td {LEFT}>{cell}</td>" for cell in cells))
        return html_table("sections", heads, rows)


def _short(numbers: list[str]) -> str:
    """Return numbers with successive ones as a range: "001-003 007"."""
    runs: list[list[str]] = []
    for number in numbers:
        if not runs or int(number) > int(runs[-1][-1]) + 1:
            runs.append([])
        runs[-1].append(number)
    return " ".join(run[0] if len(run) == 1 else f"{run[0]}-{run[-1]}" for run in runs)


def contents(paper: str) -> Contents:
    """List a paper section by section, with links to the cells that follow it.

    Parameters
    ----------
    paper : str
        A key of `PAPERS`.

    Returns
    -------
    Contents
        Each section with what it says, our cells, and its figures, tables and claims; the numbers
        of claims follow the paper's key, as in ``"icn2007-001"``. ``table()`` returns a DataFrame.

    Raises
    ------
    ArgumentError
        If no paper has this key.

    Examples
    --------
    >>> contents("icn2007").table().loc["intro", "claims"]
    '001'
    """
    return Contents(paper)
