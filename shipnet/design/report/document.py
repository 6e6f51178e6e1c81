"""The report of a comparison: one file that a colleague opens offline and prints."""

from __future__ import annotations

from collections.abc import Sequence
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from shipnet import __version__
from shipnet.design.basis import shown
from shipnet.design.comparison import Comparison
from shipnet.design.costs.quantities import FIGURES
from shipnet.design.digits import number
from shipnet.design.plot import plot_pareto, plot_quantities, plot_tornado, svg
from shipnet.design.report.details import details
from shipnet.design.report.page import bullets, document, picture, section, table, text
from shipnet.errors import ArgumentError

__all__ = ["BANNER", "report_html", "write_report"]

#: What the first page says.
BANNER = "Design aid, not class approval."
_BANNER_MORE = (
    "Computed from an I/O list under the assumptions listed below. Prices, masses and hours are "
    "estimates until a supplier's are put in; a rule is judged only where its text was read, and "
    "no society has seen this."
)


def write_report(
    comparison: Comparison,
    path: str | PathLike[str],
    *,
    title: str | None = None,
    date: str | None = None,
    remarks: Sequence[str] = (),
) -> None:
    """Write a comparison as one self-contained HTML file.

    Parameters
    ----------
    comparison : Comparison
        From `shipnet.design.comparison.compare`.
    path : path
        File, in an existing folder; it is overwritten.
    title : str, optional
        What the report is called; the source of the list if omitted.
    date : str, optional
        Printed as it is; without one, the same comparison always gives the same bytes.
    remarks : sequence of str
        What else there is to say of what was planned, one sentence each.

    Returns
    -------
    None
        Figures and style are in the file: it fetches nothing and runs no script.

    Raises
    ------
    ArgumentError
        If `comparison` is no Comparison.
    OSError
        If the file cannot be written.

    Examples
    --------
    >>> import tempfile
    >>> from shipnet.design.comparison import compare_networks
    >>> from shipnet.design.example import example
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_report(compare_networks([example()]), Path(folder) / "report.html")
    ...     BANNER in (Path(folder) / "report.html").read_text(encoding="utf-8")
    True
    """
    page = report_html(comparison, title=title, date=date, remarks=remarks)
    Path(path).write_text(page, encoding="utf-8", newline="\n")


def report_html(
    comparison: Comparison,
    *,
    title: str | None = None,
    date: str | None = None,
    remarks: Sequence[str] = (),
) -> str:
    """Return the report of a comparison.

    Parameters
    ----------
    comparison : Comparison
        From `shipnet.design.comparison.compare`.
    title, date, remarks
        As `write_report`.

    Returns
    -------
    str
        HTML.

    Raises
    ------
    ArgumentError
        If `comparison` is no Comparison.

    Examples
    --------
    >>> from shipnet.design.comparison import compare_networks
    >>> from shipnet.design.example import example
    >>> page = report_html(compare_networks([example()]), title="A <b> B")
    >>> "A &lt;b&gt; B" in page, "<b>" in page
    (True, False)
    """
    if not isinstance(comparison, Comparison):
        raise ArgumentError(f"comparison is {comparison!r}; it must be a Comparison")
    named = title or f"Connecting the points of {Path(comparison.iolist.source).name}"
    return document(
        named,
        text(named, tag="h1"),
        text(f"{date + ', ' if date else ''}shipnet {__version__}", "lead"),
        f'<p class="banner">{BANNER} <span>{_BANNER_MORE}</span></p>',
        bullets(comparison.sentences),
        _side_by_side(comparison),
        _what(comparison, remarks),
        _pictures(comparison),
        _rules(comparison),
        *details(comparison),
    )


def _side_by_side(comparison: Comparison) -> str:
    shown = comparison.table.drop(columns=["not beaten"])
    rows = []
    for column in shown:
        unit = FIGURES.get(str(column).split(",")[0], "1")
        name = f"{column} [{unit}]" if unit != "1" else str(column)
        rows.append([name, *(number(value) for value in shown[column])])
    rows.append(["not beaten", *("yes" if best else "no" for best in comparison.pareto)])
    return table(
        ["", *map(str, shown.index)], rows, numbers=range(1, len(shown) + 1),
        caption=f"The options side by side. Not beaten: connects every point, and no other is as "
        f"good in {', '.join(comparison.criteria)} and better in one of them.",
    )  # fmt: skip


def _what(comparison: Comparison, remarks: Sequence[str]) -> str:
    iolist, site = comparison.iolist, comparison.site
    counts = iolist.points["type"].value_counts()
    systems = iolist.points["system"].replace("", None).nunique()
    of_systems = f"of {systems} system{'s' if systems > 1 else ''}" if systems else "of no system"
    trays = "cables run square to the ship's axes, as no trays are given"
    if site.trays is not None:
        trays = "cables run on the trays given"
    cabinet = ", ".join(f"{x:g}" for x in site.cabinet)
    where = (
        f"Cabinet at {cabinet} m; {trays}. A cable is {site.detour:g} times its way and "
        f"{site.tails:g} m for both ends{_assumed(comparison, 'detour', 'tails')}."
    )
    if not (iolist.located.any() or np.isfinite(iolist.box_places).all(axis=1).any()):
        where = "The list gives no places: every length is its own."
    lines = [
        f"I/O list {Path(iolist.source).name}: {len(iolist)} points ("
        + ", ".join(f"{n} {kind}" for kind, n in counts.items())
        + f") {of_systems}.",
        *(f"{said[:1].upper()}{said[1:]}." for said in (*iolist.remarks, *remarks)),
        where,
        f"The host adds {comparison.basis.host_time:g} s to a response where a rule counts it"
        f"{_assumed(comparison, 'host_time')}.",
    ]
    return section("What was planned", bullets(lines), _changes(comparison), page=False)


def _assumed(comparison: Comparison, *names: str) -> str:
    """Return what to say of values that nobody gave."""
    if not {*names}.isdisjoint(comparison.changes["name"]):
        return ""
    return ", both assumed" if len(names) > 1 else ", assumed"


def _changes(comparison: Comparison) -> str:
    rows = [
        [row["name"], shown(row["value"]), shown(row["default"]), row["meaning"]]
        for row in comparison.changes.to_dict("records")
    ]
    if not rows:
        return text("Every limit, price and allowance has its default value.")
    return table(
        ["name", "here", "default", "what it is"], rows,
        caption="Values that are not the defaults; all others are.",
    )  # fmt: skip


def _pictures(comparison: Comparison) -> str:
    # A point that is left out costs nothing: no picture may hide that.
    left_out = comparison.table["points left out"]
    named = {
        str(option): f"{option} ({count} left out)" if count else str(option)
        for option, count in left_out.items()
    }
    takes = {named[option]: takes for option, takes in comparison.quantities.items()}
    shown = comparison.table.rename(index=named)
    likely = comparison.likely
    if likely is not None:
        likely = likely.rename(index=named, level="option")
    height = 1.2 + 0.4 * len(takes)
    figures = [
        picture(
            svg(lambda ax: plot_quantities(takes, ax=ax, likely=likely), height=height),
            "Total cost of each option: nominal, and with all assumptions at low and at high"
            + (", and in 9 of 10 draws of them." if likely is not None else "."),
        ),
        picture(
            svg(
                lambda ax: plot_quantities(takes, "conductors at the cabinet", ax=ax), height=height
            ),
            "Conductors in use that enter the cabinet.",
        ),
        picture(
            svg(
                lambda ax: plot_pareto(
                    shown, pareto=comparison.pareto.rename(named), y="lost by one failure", ax=ax
                )
            ),
            "Cost against the points that the worst failure takes along; filled: not beaten.",
        ),
    ]
    if comparison.pareto.any():
        # Of options that leave points out, no difference in cost says anything.
        figures.append(
            picture(
                svg(lambda ax: plot_tornado(comparison.tornado, ax=ax)),
                f"What each assumption does to the {comparison.tornado.subject}.",
            )
        )
    return section("Figures", f'<div class="pair">{"".join(figures)}</div>')


def _rules(comparison: Comparison) -> str:
    rules: Any = comparison.rules  # a table without types
    keys = ["rule_set", "rule"]
    first = rules.drop_duplicates(keys)
    options = list(comparison.networks)
    found = {(r.rule_set, r.rule, r.option): r for r in rules.itertuples()}

    def cell(rule: tuple[str, str], option: str) -> str:
        row = found[*rule, option]
        value = "" if row.computed != row.computed else f": {number(row.computed)} {row.unit}"
        return f"{row.verdict}{value}"

    judged, read, why = [], [], []
    for row in first.itertuples():
        limit = "" if row.limit != row.limit else f"{row.bound} {number(row.limit)} {row.unit}"
        rule = (str(row.rule_set), str(row.rule))
        judged.append([row.rule, row.asks, limit, *(cell(rule, option) for option in options)])
        stated = "yes" if row.confirmed else "no"
        read.append([row.rule, row.rule_set, row.clause, row.edition, row.source, stated])
        same: dict[tuple[str, str], list[str]] = {}
        for option in options:
            mine = found[*rule, option]
            same.setdefault((str(mine.subject), str(mine.why)), []).append(option)
        for (subject, because), shared in same.items():
            named = ", ".join(shared) if len(shared) < len(options) else "all"
            why.append([row.rule, named, subject, because])
    sets = ", ".join(dict.fromkeys(map(str, rules["rule_set"])))
    return section(
        "Rules",
        table(
            ["rule", "asks", "limit", *options],
            judged,
            verdicts=range(3, 3 + len(options)),
            caption=f"Rule sets {sets}. Not verified: nothing in a plan tells, or the text of the "
            "clause was not read; a value is what was computed all the same.",
        ),
        text("Where each rule stands", tag="h3"),
        table(["rule", "set", "clause", "edition", "source", "text read"], read),
        text("What the values are made of", tag="h3"),
        table(["rule", "option", "where", "why"], why),
    )
