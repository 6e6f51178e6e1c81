"""The report of a comparison: one HTML file that can be read offline and printed."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Iterable, Mapping, Sequence
from html import escape
from importlib.resources import files
from math import isnan
from typing import Any

import numpy as np
import pandas as pd

from shipnet import __version__
from shipnet.design.catalogue import LEVELS
from shipnet.design.costs import EXCLUDED, WEIGHED, Quantities, counted, label, number, ranges_of
from shipnet.design.designs import Design
from shipnet.design.drawing import sheets
from shipnet.design.failures import FAILURES
from shipnet.design.plot import plot_pareto, plot_ranges
from shipnet.errors import listed, some
from shipnet.toml_file import shown

#: Note on the first page of a report and at the end of a printed comparison.
BANNER = "A design aid, not class approval."


# One page of HTML: tables, pictures and text; it loads no other files and runs no scripts


def document(title: str, *parts: str) -> str:
    """Return a complete page."""
    style = (files("shipnet.design") / "report.css").read_text(encoding="utf-8")
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{escape(title)}</title>\n<style>\n{style}</style>\n</head>\n<body>\n"
        + "\n".join(parts)
        + "\n</body>\n</html>\n"
    )


def section(title: str, *parts: str) -> str:
    """Return a section with its heading."""
    return "\n".join(["<section>", f"<h2>{escape(title)}</h2>", *parts, "</section>"])


def text(words: str, kind: str = "", tag: str = "p") -> str:
    """Return a paragraph, or another element that contains only text."""
    named = f' class="{kind}"' if kind else ""
    return f"<{tag}{named}>{escape(words)}</{tag}>"


def bullets(lines: Iterable[str]) -> str:
    """Return a bulleted list."""
    return "\n".join(["<ul>", *(f"<li>{escape(line)}</li>" for line in lines), "</ul>"])


def table(
    head: Sequence[str],
    rows: Iterable[Sequence[str]],
    *,
    caption: str = "",
    numbers: Iterable[int] = (),
    verdicts: Iterable[int] = (),
) -> str:
    """Return a table."""
    right, judged = set(numbers), set(verdicts)

    def cell(tag: str, column: int, value: str) -> str:
        kinds = ["n"] if column in right else []
        if tag == "td":
            if 0 < len(value) <= _SHORT:
                kinds.append("k")  # a short value is not wrapped, even in a narrow column
            if column in judged:
                kinds += [kind for word, kind in _VERDICTS.items() if value.startswith(word)]
        named = f' class="{" ".join(kinds)}"' if kinds else ""
        scope = ' scope="col"' if tag == "th" else ""
        return f"<{tag}{scope}{named}>{escape(value)}</{tag}>"

    lines = [f"<caption>{escape(caption)}</caption>"] if caption else []
    lines.append("<thead><tr>" + "".join(cell("th", *c) for c in enumerate(head)) + "</tr></thead>")
    body = ("<tr>" + "".join(cell("td", *c) for c in enumerate(row)) + "</tr>" for row in rows)
    return "\n".join(
        ['<div class="wide"><table>', *lines, "<tbody>", *body, "</tbody></table></div>"]
    )


#: Maximum number of characters of a cell that stays on one line.
_SHORT = 9

_VERDICTS = {"met": "pass", "violated": "fail", "not verified": "open"}


def picture(svg: str, words: str) -> str:
    """Return a picture with its caption."""
    data = b64encode(svg.encode()).decode()
    caption = escape(words)
    return (
        f'<figure><img src="data:image/svg+xml;base64,{data}" alt="{caption}">'
        f"<figcaption>{caption}</figcaption></figure>"
    )


# The later pages of a report: failures, points left out, segments, figures, assumptions

#: Maximum numbers of rows in the report's long tables; the saved files contain all rows.
_FAILURES_SHOWN, _POINTS_SHOWN, _REASONS_SHOWN = 4, 100, 50

#: Note on where the omitted rows are.
_FILES = "The tables written by `--tables FOLDER` contain"

_FAILURE_WORDS = {
    "cut": "one cable cut",
    "short": "one pair of a bus or a supply shorted",
    "device": "one device failed (except the cabinet)",
}


def _each(rows: pd.DataFrame) -> Iterable[Any]:
    return rows.itertuples()


def _failures(designs: Mapping[str, Design]) -> str:
    rows, details = [], []
    for option, design in designs.items():
        cuts = design._failures
        cuts = cuts[cuts["kind"] != "cabinet"]
        for failure in FAILURES:
            cases = cuts[cuts["failure"] == failure]
            if len(cases):
                worst: Any = cases.iloc[cases["points_lost"].to_numpy().argmax()]
                losing = int((cases["points_lost"] > 0).sum())
                counts = [str(n) for n in (len(cases), losing, worst["points_lost"])]
                where = [worst["failed"] if losing else "", ", ".join(worst["systems"])]
                rows.append([option, _FAILURE_WORDS[failure], *counts, *where])
        many = cuts[cuts["points_lost"] > 1]
        many = many.sort_values("points_lost", ascending=False, kind="stable")
        for row in _each(many.head(_FAILURES_SHOWN)):
            count, tags = str(row.points_lost), some(row.tags, 6)
            details.append([option, row.failure, row.failed, row.segment, count, tags])
    worst_head = "option,failure,cases,with losses,max. points,failed,systems".split(",")
    return section(
        "Points lost by single failures",
        text(
            "Each cable, each pair of a bus or of its supply, and each device fails alone. A point "
            "is lost if no path connects it to the cabinet, or if its station has no supply. "
            "Reflections at an open end, and parts in the cabinet, are not considered."
        ),
        table(worst_head, rows, numbers=[2, 3, 4]),
        text(f"The {_FAILURES_SHOWN} worst failures of each option", tag="h3"),
        table(["option", "failure", "failed", "segment", "points", "tags"], details, numbers=[4]),
    )


def _reasons(reasons: pd.DataFrame) -> str:
    rows = []
    for row in _each(reasons.head(_REASONS_SHOWN)):
        values = [f"{number(x)} {row.unit}" for x in (row.value, row.bound)]
        rows.append([row.design, row.subject, row.text, row.limit, *values])
    if not rows:
        return section("Points left out", text("Every point fits in every option."))
    more = len(reasons) - len(rows)
    return section(
        "Points left out",
        table(["option", "subject", "why", "limit", "value", "bound"], rows, numbers=[4, 5]),
        *([text(f"{_FILES} {more} more reasons.")] if more else []),
    )


#: Columns of the report's table of segments, with their titles.
_SEGMENTS = {
    "length_m": "trunk [m]",
    "bus_time": "bus time",
    "capacity_used": "capacity used",
    "response_ms": "response [ms]",
    "slowest_update_ms": "needed [ms]",
}


def _segments(designs: Mapping[str, Design]) -> str:
    rows = []
    for option, design in designs.items():
        shown = design.segments[["segment", "bus", "points", "devices", *_SEGMENTS]].astype(object)
        for share in ("bus_time", "capacity_used"):
            shown[share] = ["-" if isnan(x) else f"{100 * x:.1f} %" for x in shown[share]]
        for column in ("length_m", "response_ms", "slowest_update_ms"):
            shown[column] = shown[column].map(number)
        rows += [[option, *map(str, row)] for row in shown.itertuples(index=False)]
    head = ["option", "segment", "bus", "points", "devices", *_SEGMENTS.values()]
    body = table(head, rows, numbers=range(3, 10)) if rows else text("No option has a bus.")
    return section("Segments", body)


def _figures(quantities: Mapping[str, Quantities], likely: pd.DataFrame) -> str:
    parts = []
    head = ["", "all low", "nominal", "all high", "5 %", "95 %"]
    for option, each in quantities.items():
        drawn = pd.DataFrame(likely.loc[option])[["low", "high"]]
        values = pd.concat([each.figures[list(LEVELS)], drawn], axis=1)
        rows = [[label(str(row[0])), *map(number, row[1:])] for row in values.itertuples()]
        cables = [[row[0], *map(number, row[1:])] for row in each.by_cable.itertuples()]
        parts += [
            text(option, tag="h3"),
            table(head, rows, numbers=range(1, len(head))),
            table(["cable", "runs", "m", "kg", "EUR"], cables, numbers=range(1, 5)),
        ]
    return section("Quantities of each option", *parts)


def _assumptions(quantities: Mapping[str, Quantities]) -> str:
    used = pd.concat([each.assumptions for each in quantities.values()]).drop_duplicates("name")
    rows = [
        [name.replace("_", " "), *map(number, ends), unit, status, source]
        for name, *ends, unit, status, source in used.itertuples(index=False)
    ]
    return section(
        "Assumptions",
        table(
            ["what", "low", "nominal", "high", "unit", "status", "source"],
            rows,
            numbers=[1, 2, 3],
            caption="All prices, masses, hours and factors used.",
        ),
        text("Not included in any figure", tag="h3"),
        bullets(EXCLUDED),
    )


def _points(designs: Mapping[str, Design]) -> str:
    iolist = next(iter(designs.values())).iolist
    title = "Points"
    if len(iolist) > _POINTS_SHOWN:
        return section(title, text(f"{_FILES} all {len(iolist)} points."))
    columns = [iolist.points["tag"], iolist.points["system"], iolist.points["signal"]]
    for design in designs.values():
        at = (design.points["device"] + " " + design.points["address"]).str.strip()
        columns.append(at.where(design.points["bus"] != "", "does not fit"))
    rows = list(zip(*columns, strict=True))
    caption = "Device and address of each point."
    return section(title, table(["tag", "system", "signal", *designs], rows, caption=caption))


# The report of a comparison: one file that a colleague can read offline and print ---------------

_BANNER_MORE = (
    "Computed from an I/O list under the assumptions listed below. Prices, masses and hours are "
    "estimates until replaced by a supplier's figures. A rule is judged only if we have read its "
    "text, or a manufacturer's document that gives its limit. No classification society has "
    "reviewed this report."
)


def report_html(comparison: Any, title: str, date: str) -> str:
    """Return the report of `found`, a `Comparison` (`Any` because its module imports this one)."""
    designs, takes, likely = comparison.designs, comparison.quantities, comparison.likely()
    drawn = [
        picture(sheet, f"{option}: cabinet, boxes and stations on their trunks.")
        for option, design in designs.items()
        for sheet, _ in sheets(design)
    ]
    annexes = [
        _what(comparison),
        _rules(comparison.findings().table(), list(designs)),
        _failures(designs),
        _reasons(comparison.reasons()),
        _segments(designs),
        _figures(takes, likely),
        _assumptions(takes),
        _points(designs),
        section("Single-line drawings", *drawn),
    ]
    lettered = [
        annex.replace("<section", f'<section id="annex-{letter}"', 1).replace(
            "<h2>", f"<h2>Annex {letter}: ", 1
        )
        for letter, annex in zip("ABCDEFGHIJ", annexes, strict=False)
    ]
    contents = "\n".join(
        f'<li><a href="#annex-{letter}">{annex.partition("<h2>")[2].partition("</h2>")[0]}</a></li>'
        for letter, annex in zip("ABCDEFGHIJ", lettered, strict=False)
    )
    compared = comparison.table().drop(columns="pareto")
    rows = [[label(str(name)), *map(number, compared[name])] for name in compared]
    rows.append([label("pareto"), *comparison.table()["pareto"].map({True: "yes", False: "no"})])
    side_by_side = table(
        ["", *map(str, compared.index)],
        rows,
        numbers=range(1, len(compared) + 1),
        caption="The designs side by side. Pareto-optimal: the design connects every point, and no "
        f"other is at least as good in {WEIGHED}, and better in one of them.",
    )
    return document(
        title,
        text(title, tag="h1"),
        text(f"{date + ', ' if date else ''}shipnet {__version__}", "lead"),
        f'<p class="banner">{BANNER} <span>{_BANNER_MORE}</span></p>',
        bullets(comparison.conclusions()),
        side_by_side,
        _pictures(comparison, likely),
        f'<nav>\n<h2>Contents</h2>\n<ul class="contents">\n{contents}\n</ul>\n</nav>',
        *lettered,
    )


def _what(comparison: Any) -> str:
    iolist, site, changes = comparison.iolist, comparison.site, comparison.changes()
    host = comparison.settings.host_time
    systems = iolist.points["system"].replace("", None).nunique()
    in_systems = f"{systems} system{'s' if systems > 1 else ''}" if systems else "no system"
    cabinet = ", ".join(f"{x:g}" for x in site.cabinet)
    where = (
        f"Cabinet at {cabinet} m; cables run parallel to the ship's axes. A cable is "
        f"{site.detour:g} times as long as its route, plus {site.tails:g} m for both ends"
        f"{_assumed(changes, 'detour', 'tails')}."
    )
    if not (iolist.located.any() or np.isfinite(iolist.box_places).all(axis=1).any()):
        where = "The list gives no positions, so every length is taken from the list."
    lines = [
        f"I/O list: {iolist}, in {in_systems}.",
        *(f"{remark[:1].upper()}{remark[1:]}." for remark in comparison.remarks),
        where,
        f"The time in the host, {host:g} s{_assumed(changes, 'host_time')}, is "
        "added to a response if the rule includes it.",
    ]
    read = []
    for note in iolist.notes:
        rows = listed(note.rows).lstrip("s ") if note.rows else ""
        read.append([f"{note.what[:1].upper()}{note.what[1:]}", str(len(note.rows) or ""), rows])
    return section(
        "Basis of the plans",
        bullets(lines),
        *([table(["how the list was read", "count", "rows"], read, numbers=[1])] if read else []),
        _changes(changes),
    )


def _assumed(changes: pd.DataFrame, *names: str) -> str:
    """If the named values are all defaults, return a note that they are assumed, else ""."""
    if not {*names}.isdisjoint(changes["name"]):
        return ""
    return " (both assumed)" if len(names) > 1 else " (assumed)"


def _changes(changes: pd.DataFrame) -> str:
    rows = [
        [row["name"], shown(row["value"]), shown(row["default"]), row["meaning"], row["designs"]]
        for row in changes.to_dict("records")
    ]
    if not rows:
        return text("Every limit, price and allowance has its default value.")
    head = ["name", "value", "default", "meaning", "designs"]
    return table(head, rows, caption="Values that differ from the defaults.")


def _pictures(comparison: Any, likely: pd.DataFrame) -> str:
    from shipnet.figure import svg

    compared, tornado = comparison.table(), comparison.tornado()
    named = counted(compared)
    axes = ["total_cost_eur", "lost_by_failure"]
    dots = compared[axes].rename(index=named).set_axis(list(map(label, axes)), axis=1)
    best = [named[name] for name in comparison.pareto()]

    def ranges(figure: str, drawn: pd.DataFrame | None = None) -> str:
        ends = ranges_of(comparison.quantities, figure).rename(index=named)
        return svg(
            lambda ax: plot_ranges(ends, label(figure), likely=drawn, ax=ax),
            height=1.2 + 0.4 * len(ends),
        )

    figures = [
        picture(
            ranges(axes[0], pd.DataFrame(likely.xs(axes[0], level="figure")).rename(index=named)),
            "Total cost of each design: nominal, with all assumptions low or all high, and in 9 of "
            "10 random draws.",
        ),
        picture(ranges("conductors_at_cabinet"), "Conductors in use that enter the cabinet."),
        picture(
            svg(lambda ax: plot_pareto(dots, best, ax=ax)),
            "Points lost in the worst failure, against cost; filled dots: Pareto-optimal designs.",
        ),
    ]
    if best:
        # A difference in cost is meaningless if every option leaves points out.
        figures.append(
            picture(svg(tornado.plot), f"Effect of each assumption on the {tornado.subject}.")
        )
    ship = comparison.drawing().html if comparison.iolist.located.any() else ""
    return section("Figures", f'{ship}<div class="pair">{"".join(figures)}</div>')


def _rules(rules: Any, options: Sequence[str]) -> str:
    keys = ["rule_set", "rule"]
    first = rules.drop_duplicates(keys)
    findings = {(r.rule_set, r.rule, r.design): r for r in rules.itertuples()}

    def cell(rule: tuple[str, str], option: str) -> str:
        row = findings[*rule, option]
        value = "" if isnan(row.value) else f": {number(row.value)} {row.unit}"
        return f"{row.verdict}{value}"

    judged, read, why = [], [], []
    for row in first.itertuples():
        limit = "" if isnan(row.limit) else f"{row.bound} {number(row.limit)} {row.unit}"
        limit += ", from a manufacturer" if row.confirmed == "maker" else ""
        rule = (str(row.rule_set), str(row.rule))
        judged.append([row.rule, row.asks, limit, *(cell(rule, option) for option in options)])
        stated = "only a manufacturer's" if row.confirmed == "maker" else row.confirmed
        read.append([row.rule, row.rule_set, row.clause, row.edition, row.source, stated])
        same: dict[tuple[str, str], list[str]] = {}
        for option in options:
            finding = findings[*rule, option]
            same.setdefault((str(finding.object), str(finding.why)), []).append(option)
        for (subject, because), shared in same.items():
            named = ", ".join(shared) if len(shared) < len(options) else "all"
            why.append([row.rule, named, subject, because])
    sets = ", ".join(dict.fromkeys(map(str, rules["rule_set"])))
    return section(
        "Rules",
        table(
            ["rule", "requirement", "limit", *options],
            judged,
            verdicts=range(3, 3 + len(options)),
            caption=f"Rule sets {sets}. Not verified: a plan cannot show whether the rule is met, "
            "or none of us has read the clause; a value may still be given. From a "
            "manufacturer: its document gives the limit; we have read no standard that does.",
        ),
        text("Source of each rule", tag="h3"),
        table(["rule", "set", "clause", "edition", "source", "text read"], read),
        text("How each value was computed", tag="h3"),
        table(["rule", "option", "where", "why"], why),
    )
