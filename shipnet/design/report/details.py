"""The later pages of a report: failures, what does not fit, segments, figures, assumptions."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from shipnet.design.costs.quantities import EXCLUDED
from shipnet.design.digits import number
from shipnet.design.report.page import bullets, section, table, text
from shipnet.design.rules.cuts import FAILURES

if TYPE_CHECKING:
    import pandas as pd

    from shipnet.design.comparison import Comparison

__all__ = ["details"]

#: Rows of a long table that the report shows.
_FAILURES_SHOWN, _POINTS_SHOWN, _REASONS_SHOWN = 8, 2000, 200

_FAILURE_WORDS = {
    "cut": "one cable cut", "short": "one pair of a bus or a supply shorted",
    "tray": "one tray lost",
    "device": "one device dead (but the cabinet)",
}  # fmt: skip


def details(comparison: Comparison) -> list[str]:
    r"""Return the sections in which the details of a comparison stand.

    Parameters
    ----------
    comparison : Comparison
        From `shipnet.design.comparison.compare`.

    Returns
    -------
    list of str
        HTML of each.

    Examples
    --------
    >>> from shipnet.design.comparison import compare_networks
    >>> from shipnet.design.example import example
    >>> sections = details(compare_networks([example()]))
    >>> sections[1]
    '<section>\n<h2>What does not fit</h2>\n<p>Every point fits in every option.</p>\n</section>'
    """
    return [
        _failures(comparison),
        _reasons(comparison),
        _segments(comparison),
        _figures(comparison),
        _assumptions(comparison),
        _points(comparison),
    ]


def _each(rows: pd.DataFrame) -> Iterator[Any]:
    return iter(rows.itertuples())


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
            "Every cable, every pair of a bus or of its supply, every tray and every device fails "
            "alone. A point is lost when nothing leads from it to the cabinet any more, or its "
            "station has no supply. "
            "Reflections at an open end, and what lies in the cabinet, are not looked at."
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
    head = ["what", "low", "nominal", "high", "unit", "status", "source"]
    return section(
        "What was assumed",
        table(head, rows, numbers=[1, 2, 3], caption="Every price, mass, hour and factor in use."),
        text("What no figure holds", tag="h3"),
        bullets(EXCLUDED),
    )


def _points(comparison: Comparison) -> str:
    listed: pd.DataFrame = comparison.iolist.points.head(_POINTS_SHOWN)
    columns = [listed["tag"], listed["system"], listed["signal"]]
    for network in comparison.networks.values():
        points = network.points.head(_POINTS_SHOWN)
        at = (points["device"] + " " + points["address"]).str.strip()
        columns.append(at.where(points["bus"] != "", "does not fit"))
    rows = list(zip(*columns, strict=True))
    more = len(comparison.iolist) - len(rows)
    return section(
        "Points",
        table(["tag", "system", "signal", *comparison.networks], rows,
              caption="Device and address of each point."),
        *([text(f"And {more} points more.")] if more else []),
    )  # fmt: skip
