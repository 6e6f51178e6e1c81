"""Rule bases as two CSV files that a spreadsheet can write: the rules, and the terms they use.

    code,antecedent,flag,priority,english,korean
    V1,FP.high & OP.high,ValveStick,3,valve stuck,

    variable,term,unit,low,high,left_foot,left_shoulder,right_shoulder,right_foot,crisp,english,korean
    FP,,bar,0,160,,,,,,oil pump pressure,
    FP,high,,,,115,125,,,x > 120,high,

A row of the terms without a term describes its variable; both left corners empty, or both right
ones, are an open shoulder. Columns may come in any order. `note` is for remarks, which are not
kept.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Callable, Mapping
from math import inf
from os import PathLike
from pathlib import Path
from typing import Any, TypeVar

from shipnet.errors import ArgumentError, InputError
from shipnet.fuzzy.rules import Rule, RuleBase, rule_faults
from shipnet.fuzzy.terms import Interval, Term, Variable, number_text
from shipnet.tables import NUMBER, parse_sheet, read_bytes

__all__ = ["RULE_COLUMNS", "TERM_COLUMNS", "load_rules", "save_rules"]

#: Columns of the two files, in the order in which they are written.
RULE_COLUMNS = ("code", "antecedent", "flag", "priority", "english", "korean")
_CORNERS = ("left_foot", "left_shoulder", "right_shoulder", "right_foot")
TERM_COLUMNS = ("variable", "term", "unit", "low", "high", *_CORNERS, "crisp", "english", "korean")

#: Columns that a row of each kind leaves empty.
_NOT_OF_A_VARIABLE, _NOT_OF_A_TERM = (*_CORNERS, "crisp"), ("unit", "low", "high")

_Row = tuple[str, Mapping[str, str]]
_Made = TypeVar("_Made", Rule, Term, Variable)


def load_rules(rules: str | PathLike[str], terms: str | PathLike[str]) -> RuleBase:
    """Read a rule base from two CSV files.

    Parameters
    ----------
    rules : path
        File with the columns of `RULE_COLUMNS`, one row a rule.
    terms : path
        File with the columns of `TERM_COLUMNS`, one row a variable and one row a term. Both are
        UTF-8, separated by commas, semicolons or tabs, numbers with a decimal point. Blank rows are
        skipped.

    Returns
    -------
    RuleBase
        Variables and rules in the order of the rows.

    Raises
    ------
    InputError
        If a file cannot be read, or does not say what it should: every fault of the file with its
        row, column and value, and what was expected. The terms are looked at first.

    Examples
    --------
    >>> from shipnet import datasets
    >>> files = (datasets.path(f"kim2014_assumed_{what}.csv") for what in ("rules", "terms"))
    >>> load_rules(*files).rule("V1").text
    'FP.high & OP.high'
    """
    variables = _variables(str(terms), _rows(terms, TERM_COLUMNS, ("variable", "term")))
    rows = _rows(rules, RULE_COLUMNS, ("code", "antecedent", "priority"))
    faults: list[str] = []
    made, places = [], []
    for place, cells in rows:
        rule = _make(place, faults, lambda cells=cells: _rule(cells))  # type: ignore[misc]
        if rule is not None:
            made.append(rule)
            places.append(place)
    faults += [f"{places[number]}: {fault}" for number, fault in rule_faults(variables, made)]
    if faults or not made:
        raise InputError(str(rules), *(faults or ["has no rule; expected one row a rule"]))
    return RuleBase(tuple(variables), tuple(made))


def save_rules(base: RuleBase, rules: str | PathLike[str], terms: str | PathLike[str]) -> None:
    """Write a rule base as two CSV files, from which `load_rules` makes the same one.

    Parameters
    ----------
    base : RuleBase
        What to write.
    rules, terms : path
        Files, in existing folders; they are overwritten.

    Returns
    -------
    None
        Numbers are written with all digits that tell them apart.

    Examples
    --------
    >>> import tempfile
    >>> from shipnet.fuzzy import published
    >>> base = published.rule_base("kim2014")
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     files = Path(folder) / "rules.csv", Path(folder) / "terms.csv"
    ...     save_rules(base, *files)
    ...     load_rules(*files) == base
    True
    """
    rule_rows = [
        (rule.code, rule.text, rule.flag, rule.priority, rule.english, rule.korean)
        for rule in base.rules
    ]
    term_rows: list[tuple[Any, ...]] = []
    for variable in base.variables:
        ends = (number_text(variable.low), number_text(variable.high))
        labels = (variable.english, variable.korean)
        empty = ("",) * len(_NOT_OF_A_VARIABLE)
        term_rows.append((variable.name, "", variable.unit, *ends, *empty, *labels))
        for term in variable.terms:
            corners = (number_text(corner) for corner in term.corners)
            labels = (term.english, term.korean)
            term_rows.append(
                (variable.name, term.name, "", "", "", *corners, str(term.crisp), *labels)
            )
    for path, titles, rows in ((rules, RULE_COLUMNS, rule_rows), (terms, TERM_COLUMNS, term_rows)):
        with Path(path).open("w", newline="", encoding="utf-8") as stream:
            writer = csv.writer(stream, lineterminator="\n")
            writer.writerow(titles)
            writer.writerows(rows)


def _rows(path: str | PathLike[str], known: tuple[str, ...], needed: tuple[str, ...]) -> list[_Row]:
    """Return the rows that are not blank, each with its place; the titles are checked."""
    file = str(path)
    try:
        # No other encoding is guessed: it would make other letters of the labels.
        sheet = parse_sheet(read_bytes(path).decode("utf-8-sig"), file)
    except UnicodeDecodeError as error:
        raise InputError(file, f"is not UTF-8: byte {error.start} is wrong") from None
    columns = [title.lower() for title in sheet.titles]
    faults = [
        f"column {place}: title {title!r} is unknown; expected one of {', '.join(known)}, note"
        for place, title in enumerate(columns, start=1)
        if title not in (*known, "note")
    ]
    faults += [f"title {t!r} stands twice" for t in sorted(set(columns)) if columns.count(t) > 1]
    faults += [f"no column {title}" for title in needed if title not in columns]
    # A row that is too long is shifted: its cells cannot be trusted.
    faults += [
        f"row {number} has {len(row)} cells; expected {len(columns)}"
        for number, row in sheet.rows
        if any(row[len(columns) :])
    ]
    if faults:
        raise InputError(file, *faults)
    blank = dict.fromkeys(known, "")
    return [
        (f"row {n}", {**blank, **dict(zip(columns, row, strict=False))}) for n, row in sheet.rows
    ]


def _rule(cells: Mapping[str, str]) -> Rule:
    number = cells["priority"]
    if not re.fullmatch("[0-9]{1,4}", number):
        raise ArgumentError(f"column priority: {number!r}; expected a whole number 1..9999")
    antecedent = Rule.parse(cells["antecedent"])
    labels = (cells["english"], cells["korean"])
    return Rule(cells["code"], antecedent, int(number), cells["flag"], *labels)


def _variables(file: str, rows: list[_Row]) -> list[Variable]:
    """Make the variables of the rows, or raise all that is wrong with them."""
    faults: list[str] = []
    heads: dict[str, _Row] = {}
    terms: dict[str, list[Term]] = {}
    for place, cells in rows:
        name, empty = cells["variable"], _NOT_OF_A_TERM if cells["term"] else _NOT_OF_A_VARIABLE
        kind = "term" if cells["term"] else "variable"
        faults += [
            f"{place}, column {column}: {cells[column]!r}; expected nothing, a {kind} has none"
            for column in empty
            if cells[column]
        ]
        if cells["term"]:
            term = _make(place, faults, lambda cells=cells: _term(cells))  # type: ignore[misc]
            terms.setdefault(name, [])
            terms[name] += [term] if term is not None else []
        elif name in heads:
            faults.append(f"{place}: variable {name} stands twice")
        else:
            heads[name] = (place, cells)
    faults += [f"no row describes variable {name!r}" for name in terms if name not in heads]
    made = []
    for name, (place, cells) in heads.items():
        mine = tuple(terms.get(name, ()))
        # Without a row there is nothing else to say; faulty terms were named before.
        if mine or name not in terms:
            make = lambda cells=cells, mine=mine: _variable(cells, mine)  # noqa: E731
            variable = _make(place, faults, make)
            made += [variable] if variable is not None else []
    if faults or not made:
        raise InputError(file, *(faults or ["has no variable; expected one row a variable"]))
    return made


def _variable(cells: Mapping[str, str], terms: tuple[Term, ...]) -> Variable:
    low, high = (_number(cells, column) for column in ("low", "high"))
    labels = (cells["english"], cells["korean"])
    return Variable(cells["variable"], cells["unit"], low, high, terms, *labels)


def _term(cells: Mapping[str, str]) -> Term:
    corners = [
        _number(cells, column, inf if column.startswith("right") else -inf) for column in _CORNERS
    ]
    a, b, c, d = corners
    crisp = Interval.parse(cells["crisp"])
    return Term(cells["term"], (a, b, c, d), crisp, cells["english"], cells["korean"])


def _number(cells: Mapping[str, str], column: str, default: float | None = None) -> float:
    cell = cells[column]
    if not cell and default is not None:
        return default
    if not NUMBER.fullmatch(cell):
        raise ArgumentError(f"column {column}: {cell!r}; expected a number")
    return float(cell)


def _make(place: str, faults: list[str], make: Callable[[], _Made]) -> _Made | None:
    """Return what is made, or None behind a fault that is noted."""
    try:
        return make()
    except ArgumentError as fault:
        faults.append(f"{place}: {fault}")
        return None
