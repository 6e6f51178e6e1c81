"""The report of a comparison: one HTML file that can be read offline and printed."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Iterable, Iterator, Mapping, Sequence
from html import escape
from importlib.resources import files
from typing import Any

import numpy as np
import pandas as pd

from shipnet import __version__
from shipnet.design.catalogue import LEVELS
from shipnet.design.costs import EXCLUDED, WEIGHED, Quantities, counted, label, number, ranges_of
from shipnet.design.designs import Design
from shipnet.design.drawing import sheets
from shipnet.design.failures import FAILURES
from shipnet.design.plot import plot_pareto, plot_ranges, svg
from shipnet.design.settings import shown
from shipnet.errors import listed

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

    def cell(tag: str, place: int, value: str) -> str:
        kinds = ["n"] * (place in right)
        if tag == "td":
            # A short value is not wrapped, even in a narrow column.
            kinds += ["k"] * (0 < len(value) <= _SHORT)
            if place in judged:
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
    said = escape(words)
    return (
        f'<figure><img src="data:image/svg+xml;base64,{data}" alt="{said}">'
        f"<figcaption>{said}</figcaption></figure>"
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


def _each(rows: pd.DataFrame) -> Iterator[Any]:
    return iter(rows.itertuples())


def _failures(designs: Mapping[str, Design]) -> str:
    rows, details = [], []
    for option, design in designs.items():
        cuts = design._failures
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
        "Points lost by single failures",
        text(
            "Each cable, each pair of a bus or of its supply, and each device fails alone. A point "
            "is lost if no path connects it to the cabinet, or if its station has no supply. "
            "Reflections at an open end, and parts in the cabinet, are not considered."
        ),
        table(
            ["option", "failure", "cases", "with losses", "max. points", "failed", "systems"], rows,
            numbers=[2, 3, 4],
        ),
        text(f"The {_FAILURES_SHOWN} worst failures of each option", tag="h3"),
        table(["option", "failure", "failed", "segment", "points", "tags"], details, numbers=[4]),
    )  # fmt: skip


def _some(names: tuple[str, ...], shown: int = 6) -> str:
    more = f" and {len(names) - shown} more" if len(names) > shown else ""
    return ", ".join(names[:shown]) + more


def _reasons(reasons: pd.DataFrame) -> str:
    rows = [
        [row.design, row.subject, row.text, row.limit, f"{number(row.value)} {row.unit}",
         f"{number(row.bound)} {row.unit}"]
        for row in _each(reasons.head(_REASONS_SHOWN))
    ]  # fmt: skip
    if not rows:
        return section("Points left out", text("Every point fits in every option."))
    more = len(reasons) - len(rows)
    return section(
        "Points left out",
        table(["option", "subject", "why", "limit", "value", "bound"], rows, numbers=[4, 5]),
        *([text(f"{_FILES} {more} more reasons.")] if more else []),
    )


def _segments(designs: Mapping[str, Design]) -> str:
    rows = [
        [option, row.segment, row.bus, str(row.points), str(row.devices), number(row.length_m),
         *("-" if share != share else f"{share:.1%}".replace("%", " %")
           for share in (row.bus_time, row.capacity_used)),
         number(row.response_ms), number(row.slowest_update_ms)]
        for option, design in designs.items()
        for row in _each(design.segments)
    ]  # fmt: skip
    head = ["option", "segment", "bus", "points", "devices", "trunk [m]", "bus time",
            "capacity used", "response [ms]", "needed [ms]"]  # fmt: skip
    body = table(head, rows, numbers=range(3, 10)) if rows else text("No option has a bus.")
    return section("Segments", body)


def _figures(quantities: Mapping[str, Quantities], likely: pd.DataFrame) -> str:
    parts = []
    head = ["", "all low", "nominal", "all high", "5 %", "95 %"]
    for option, takes in quantities.items():
        drawn: Any = likely.loc[option]
        rows = [
            [label(str(name)), *(number(row[level]) for level in LEVELS),
             number(drawn.loc[name, "low"]), number(drawn.loc[name, "high"])]
            for name, row in takes.figures.iterrows()
        ]  # fmt: skip
        parts.append(text(option, tag="h3"))
        parts.append(table(head, rows, numbers=range(1, len(head))))
        cables = [
            [str(cable), number(row["runs"]), number(row["length_m"]), number(row["mass_kg"]),
             number(row["cost_eur"])]
            for cable, row in takes.by_cable.iterrows()
        ]  # fmt: skip
        parts.append(table(["cable", "runs", "m", "kg", "EUR"], cables, numbers=range(1, 5)))
    return section("Quantities of each option", *parts)


def _assumptions(quantities: Mapping[str, Quantities]) -> str:
    used = pd.concat([takes.assumptions for takes in quantities.values()])
    used = used.drop_duplicates("name")
    rows = [
        [row["name"].replace("_", " "),
         *(number(row[level]) for level in LEVELS),
         row["unit"], row["status"], row["source"]]
        for _, row in used.iterrows()
    ]  # fmt: skip
    head = ["what", "low", "nominal", "high", "unit", "status", "source"]
    return section(
        "Assumptions",
        table(head, rows, numbers=[1, 2, 3], caption="All prices, masses, hours and factors used."),
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


def report_html(found: Any, title: str, date: str) -> str:
    """Return the report of `found`, a `Comparison` (`Any` because its module imports this one)."""
    designs, takes, likely = found.designs, found.quantities, found.likely()
    annexes = [
        _what(found),
        _rules(found.findings().table(), list(designs)),
        _failures(designs),
        _reasons(found.reasons()),
        _segments(designs),
        _figures(takes, likely),
        _assumptions(takes),
        _points(designs),
        _drawings(designs),
    ]
    return document(
        title,
        text(title, tag="h1"),
        text(f"{date + ', ' if date else ''}shipnet {__version__}", "lead"),
        f'<p class="banner">{BANNER} <span>{_BANNER_MORE}</span></p>',
        bullets(found.conclusions()),
        _side_by_side(found.table()),
        _pictures(found, likely),
        *_numbered(annexes),
    )


def _numbered(annexes: Sequence[str]) -> list[str]:
    """Return the table of contents, and the annexes with their letters."""
    made, lines = [], []
    for letter, annex in zip("ABCDEFGHIJ", annexes, strict=False):
        named = annex.replace("<section", f'<section id="annex-{letter}"', 1)
        made.append(named.replace("<h2>", f"<h2>Annex {letter}: ", 1))
        title = made[-1].partition("<h2>")[2].partition("</h2>")[0]
        lines.append(f'<li><a href="#annex-{letter}">{title}</a></li>')
    contents = "\n".join(["<h2>Contents</h2>", '<ul class="contents">', *lines, "</ul>"])
    return [f"<nav>\n{contents}\n</nav>", *made]


def _drawings(designs: Mapping[str, Design]) -> str:
    drawn = [
        picture(sheet, f"{option}: cabinet, boxes and stations on their trunks.")
        for option, design in designs.items()
        for sheet, _ in sheets(design)
    ]
    return section("Single-line drawings", *drawn)


def _side_by_side(compared: pd.DataFrame) -> str:
    shown = compared.drop(columns="pareto")
    rows = [[label(str(name)), *(number(value) for value in shown[name])] for name in shown]
    rows.append([label("pareto"), *("yes" if one else "no" for one in compared["pareto"])])
    return table(
        ["", *map(str, shown.index)], rows, numbers=range(1, len(shown) + 1),
        caption="The designs side by side. Pareto-optimal: the design connects every point, and no "
        f"other is at least as good in {WEIGHED}, and better in one of them.",
    )  # fmt: skip


def _what(found: Any) -> str:
    iolist, site, changes = found.iolist, found.site, found.changes()
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
        *(f"{said[:1].upper()}{said[1:]}." for said in found.remarks),
        where,
        f"The time in the host, {found.settings.host_time:g} s{_assumed(changes, 'host_time')}, is "
        "added to a response if the rule includes it.",
    ]
    read = [
        [f"{note.what[:1].upper()}{note.what[1:]}", str(len(note.rows) or ""),
         listed(note.rows).lstrip("s ") if note.rows else ""]
        for note in iolist.notes
    ]  # fmt: skip
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
    return table(
        ["name", "value", "default", "meaning", "designs"], rows,
        caption="Values that differ from the defaults.",
    )  # fmt: skip


def _pictures(found: Any, likely: pd.DataFrame) -> str:
    compared, tornado = found.table(), found.tornado()
    named = counted(compared)
    axes = ["total_cost_eur", "lost_by_failure"]
    dots = compared[axes].rename(index=named).set_axis(list(map(label, axes)), axis=1)
    best = [named[name] for name in found.pareto()]

    def ranges(figure: str, drawn: pd.DataFrame | None = None) -> str:
        ends = ranges_of(found.quantities, figure).rename(index=named)
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
    return section("Figures", f'<div class="pair">{"".join(figures)}</div>')


def _rules(rules: Any, options: Sequence[str]) -> str:
    keys = ["rule_set", "rule"]
    first = rules.drop_duplicates(keys)
    found = {(r.rule_set, r.rule, r.design): r for r in rules.itertuples()}

    def cell(rule: tuple[str, str], option: str) -> str:
        row = found[*rule, option]
        value = "" if row.value != row.value else f": {number(row.value)} {row.unit}"
        return f"{row.verdict}{value}"

    judged, read, why = [], [], []
    for row in first.itertuples():
        limit = "" if row.limit != row.limit else f"{row.bound} {number(row.limit)} {row.unit}"
        limit += ", from a manufacturer" if row.confirmed == "maker" else ""
        rule = (str(row.rule_set), str(row.rule))
        judged.append([row.rule, row.asks, limit, *(cell(rule, option) for option in options)])
        stated = "only a manufacturer's" if row.confirmed == "maker" else row.confirmed
        read.append([row.rule, row.rule_set, row.clause, row.edition, row.source, stated])
        same: dict[tuple[str, str], list[str]] = {}
        for option in options:
            mine = found[*rule, option]
            same.setdefault((str(mine.object), str(mine.why)), []).append(option)
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
