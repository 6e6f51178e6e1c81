"""The report of a comparison: one file that a colleague opens offline and prints."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from shipnet import __version__
from shipnet.design.comparison import Comparison
from shipnet.design.costs.quantities import EXCLUDED, FIGURES
from shipnet.design.digits import number
from shipnet.design.plot import plot_pareto, plot_quantities, plot_tornado, svg
from shipnet.design.report.page import bullets, document, picture, section, table, text
from shipnet.design.rules.cuts import FAILURES
from shipnet.errors import ArgumentError

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["BANNER", "report_html", "write_report"]

#: What the first page says.
BANNER = "Design aid, not class approval."
_BANNER_MORE = (
    "Computed from an I/O list under the assumptions listed below. Prices, masses and hours are "
    "estimates until a supplier's are put in; a rule is judged only where its text was read, and "
    "no society has seen this."
)

#: Rows of a long table that the report shows.
_FAILURES_SHOWN, _POINTS_SHOWN, _REASONS_SHOWN = 8, 2000, 200

_FAILURE_WORDS = {
    "cut": "one cable cut", "short": "one bus cable shorted", "tray": "one tray lost",
    "device": "one device dead (but the cabinet)",
}  # fmt: skip


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
        _failures(comparison),
        _reasons(comparison),
        _segments(comparison),
        _figures(comparison),
        _assumptions(comparison),
        _points(comparison),
    )


def _each(rows: pd.DataFrame) -> Iterator[Any]:
    return iter(rows.itertuples())


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
    trays = "cables run square to the ship's axes, as no trays are given"
    if site.trays is not None:
        trays = "cables run on the trays given"
    cabinet = ", ".join(f"{x:g}" for x in site.cabinet)
    where = (
        f"Cabinet at {cabinet} m; {trays}. A cable is {site.detour:g} times its way and "
        f"{site.tails:g} m for both ends, both assumed."
    )
    if not (iolist.located.any() or np.isfinite(iolist.box_places).all(axis=1).any()):
        where = "The list gives no places: every length is its own."
    lines = [
        f"I/O list {Path(iolist.source).name}: {len(iolist)} points ("
        + ", ".join(f"{n} {kind}" for kind, n in counts.items())
        + f") of {iolist.points['system'].nunique()} systems.",
        *(f"{said[:1].upper()}{said[1:]}." for said in (*iolist.remarks, *remarks)),
        where,
        f"The host adds {comparison.host_time:g} s to a response where a rule counts it, assumed.",
    ]
    return section("What was planned", bullets(lines), page=False)


def _pictures(comparison: Comparison) -> str:
    takes, shown = comparison.quantities, comparison.table
    height = 1.2 + 0.4 * len(takes)
    figures = [
        picture(
            svg(lambda ax: plot_quantities(takes, ax=ax, likely=comparison.likely), height=height),
            "Total cost of each option: nominal, and with all assumptions at low and at high"
            + (", and in 9 of 10 draws of them." if comparison.likely is not None else "."),
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
                    shown, pareto=comparison.pareto, y="lost by one failure", ax=ax
                )
            ),
            "Cost against the points that the worst failure takes along; filled: not beaten.",
        ),
        picture(
            svg(lambda ax: plot_tornado(comparison.tornado, ax=ax)),
            f"What each assumption does to the {comparison.tornado.subject}.",
        ),
    ]
    return section("Figures", f'<div class="pair">{"".join(figures)}</div>')


def _rules(comparison: Comparison) -> str:
    rules = comparison.rules
    keys = ["rule_set", "rule"]
    first = rules.drop_duplicates(keys)
    options = list(comparison.networks)
    found = {(r.rule_set, r.rule, r.option): r for r in _each(rules)}

    def cell(rule: tuple[str, str], option: str) -> str:
        row = found[*rule, option]
        value = "" if row.computed != row.computed else f": {number(row.computed)} {row.unit}"
        return f"{row.verdict}{value}"

    judged, read, why = [], [], []
    for row in _each(first):
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
            caption=f"Rule sets {sets}. Not verified: nothing in a plan tells, or the text of the "
            "clause was not read; a value is what was computed all the same.",
        ),
        text("Where each rule stands", tag="h3"),
        table(["rule", "set", "clause", "edition", "source", "text read"], read),
        text("What the values are made of", tag="h3"),
        table(["rule", "option", "where", "why"], why),
    )


def _failures(comparison: Comparison) -> str:
    rows, details = [], []
    for option, cuts in comparison.cuts.items():
        cuts = cuts[cuts["kind"] != "cabinet"]
        for failure in FAILURES:
            mine = cuts[cuts["failure"] == failure]
            if len(mine):
                worst: Any = mine.iloc[mine["points_lost"].to_numpy().argmax()]
                costs = int((mine["points_lost"] > 0).sum())
                rows.append(
                    [option, _FAILURE_WORDS[failure], str(len(mine)), str(costs),
                     str(worst["points_lost"]), worst["failed"] if costs else "",
                     ", ".join(worst["systems"])]
                )  # fmt: skip
        many = cuts[cuts["points_lost"] > 1].sort_values(
            "points_lost", ascending=False, kind="stable"
        )
        details += [
            [option, row.failure, row.failed, row.segment, str(row.points_lost), _some(row.tags)]
            for row in _each(many.head(_FAILURES_SHOWN))
        ]
    return section(
        "What one failure costs",
        text(
            "Every cable, every pair of a bus, every tray and every device fails alone. A point is "
            "lost when nothing leads from it to the cabinet any more, or its station has no "
            "supply. Reflections at an open end, and what lies in the cabinet, are left out."
        ),
        table(
            ["option", "failure", "cases", "that cost a point", "worst", "what", "systems"], rows,
            numbers=[2, 3, 4],
        ),
        text(f"The {_FAILURES_SHOWN} failures of each option that cost most", tag="h3"),
        table(["option", "failure", "what", "segment", "points", "tags"], details, numbers=[4]),
    )  # fmt: skip


def _some(names: tuple[str, ...], shown: int = 6) -> str:
    more = f" and {len(names) - shown} more" if len(names) > shown else ""
    return ", ".join(names[:shown]) + more


def _reasons(comparison: Comparison) -> str:
    reasons = comparison.reasons
    rows = [
        [row.option, row.subject, row.text, row.limit, f"{number(row.value)} {row.unit}",
         f"{number(row.bound)} {row.unit}"]
        for row in _each(reasons.head(_REASONS_SHOWN))
    ]  # fmt: skip
    if not rows:
        return section("What does not fit", text("Every point fits in every option."), page=False)
    more = len(reasons) - len(rows)
    return section(
        "What does not fit",
        table(["option", "subject", "why", "limit", "value", "bound"], rows, numbers=[4, 5]),
        *([text(f"And {more} reasons more.")] if more else []),
        page=False,
    )


def _segments(comparison: Comparison) -> str:
    rows = [
        [option, row.segment, row.bus, str(row.points), str(row.devices), number(row.length_m),
         "-" if row.load != row.load else f"{row.load:.1%}".replace("%", " %"),
         number(row.response_ms), number(row.slowest_update_ms)]
        for option, network in comparison.networks.items()
        for row in _each(network.segments)
    ]  # fmt: skip
    head = ["option", "segment", "bus", "points", "devices", "trunk [m]", "load", "response [ms]",
            "needed [ms]"]  # fmt: skip
    body = table(head, rows, numbers=range(3, 9)) if rows else text("No option has a bus.")
    return section("Segments", body, page=False)


def _figures(comparison: Comparison) -> str:
    parts = []
    for option, takes in comparison.quantities.items():
        rows = [
            [f"{name} [{row['unit']}]" if row["unit"] != "1" else str(name),
             *(number(row[level]) for level in ("low", "nominal", "high")),
             *_likely(comparison, option, str(name))]
            for name, row in takes.table.iterrows()
        ]  # fmt: skip
        head = ["", "all low", "nominal", "all high"]
        head += ["5 %", "95 %"] if comparison.likely is not None else []
        parts.append(text(option, tag="h3"))
        parts.append(table(head, rows, numbers=range(1, len(head))))
        cables = [
            [str(cable), number(row["runs"]), number(row["length_m"]), number(row["mass_kg"]),
             number(row["cost_eur"])]
            for cable, row in takes.by_cable.iterrows()
        ]  # fmt: skip
        parts.append(table(["cable", "runs", "m", "kg", "EUR"], cables, numbers=range(1, 5)))
    return section("What each option takes", *parts)


def _likely(comparison: Comparison, option: str, figure: str) -> list[str]:
    if comparison.likely is None:
        return []
    row: Any = comparison.likely.loc[(option, figure)]
    return [number(row["low"]), number(row["high"])]


def _assumptions(comparison: Comparison) -> str:
    import pandas as pd

    used = pd.concat([takes.assumptions for takes in comparison.quantities.values()])
    used = used.drop_duplicates("name")
    rows = [
        [row["name"].replace("_", " "),
         *(number(row[level]) for level in ("low", "nominal", "high")),
         row["unit"], row["status"], row["source"]]
        for _, row in used.iterrows()
    ]  # fmt: skip
    return section(
        "What was assumed",
        table(["what", "low", "nominal", "high", "unit", "status", "source"], rows,
              numbers=[1, 2, 3], caption="Every price, mass, hour and factor in use."),
        text("What no figure holds", tag="h3"),
        bullets(EXCLUDED),
    )  # fmt: skip


def _points(comparison: Comparison) -> str:
    listed: pd.DataFrame = comparison.iolist.points.head(_POINTS_SHOWN)
    columns = [listed["tag"], listed["system"], listed["signal"]]
    for network in comparison.networks.values():
        points = network.points.head(_POINTS_SHOWN)
        at = (points["device"] + " " + points["address"]).str.strip()
        columns.append(at.where(points["bus"] != "", "does not fit"))
    rows = list(zip(*columns, strict=True))
    more = len(comparison.iolist) - len(rows)
    return section("Points",
        table(["tag", "system", "signal", *comparison.networks], rows,
              caption="Device and address of each point."),
        *([text(f"And {more} points more.")] if more else []),
    )  # fmt: skip
