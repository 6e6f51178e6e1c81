"""The two CSV files that hold a rule base.

    code,antecedent,flag,priority,english,korean
    V1,FP.high & OP.high,ValveStick,3,valve stuck,

    variable,term,unit,low,high,left_foot,left_shoulder,right_shoulder,right_foot,crisp,english,korean
    FP,,bar,0,160,,,,,,oil pump pressure, FP,high,,,,115,125,,,x > 120,high,

A row without a term describes its variable. Both left corners empty, or both right ones, are an
open shoulder. Columns may come in any order; a column `note` is ignored.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from math import inf
from os import PathLike
from typing import TypeAlias, TypeVar

from shipnet.arguments import checked
from shipnet.errors import ArgumentError, InputError
from shipnet.fuzzy.rules import CORNERS, RULE_COLUMNS, TERM_COLUMNS, RuleBase, rule_faults
from shipnet.fuzzy.terms import Rule, Term, Variable
from shipnet.tables import NUMBER, parse_sheet, read_bytes

#: Columns that a row of each kind leaves empty.
_EMPTY = {"variable": (*CORNERS, "crisp"), "term": ("unit", "low", "high")}

_Row: TypeAlias = tuple[str, Mapping[str, str]]
_Made = TypeVar("_Made", Rule, Term, Variable)


@checked
def read_rules(rules: str | PathLike[str], terms: str | PathLike[str]) -> RuleBase:
    """Read a rule base from two CSV files.

    Parameters
    ----------
    rules : path
        File with one row per rule: code, antecedent, flag, priority, english, korean.
    terms : path
        File with one row per variable and one row per term: variable, term, unit, low, high,
        left_foot, left_shoulder, right_shoulder, right_foot, crisp, english, korean. Both files are
        UTF-8, separated by commas, semicolons or tabs, with decimal points. Blank rows are skipped.

    Returns
    -------
    RuleBase
        Variables and rules in the order of the rows.

    Raises
    ------
    InputError
        If a file cannot be read or is faulty: every fault with its row, column and value, and what
        was expected. The terms are read first.

    Examples
    --------
    >>> from shipnet import datasets
    >>> files = (datasets.path(f"kim2014_assumed_{what}.csv") for what in ("rules", "terms"))
    >>> read_rules(*files).rule("V1").text
    'FP.high & OP.high'
    """
    variables = _variables(str(terms), _rows(terms, TERM_COLUMNS, ("variable", "term")))
    rows = _rows(rules, RULE_COLUMNS, ("code", "antecedent", "priority"))
    faults: list[str] = []
    made, places = [], []
    for place, cells in rows:
        rule = _make(place, faults, _rule, cells)
        if rule is not None:
            made.append(rule)
            places.append(place)
    faults += [f"{places[number]}: {fault}" for number, fault in rule_faults(variables, made)]
    if faults or not made:
        raise InputError(str(rules), *(faults or ["has no rule; expected one row per rule"]))
    return RuleBase(tuple(variables), tuple(made))


def _rows(path: str | PathLike[str], known: tuple[str, ...], needed: tuple[str, ...]) -> list[_Row]:
    """Return the rows that are not blank, each with its place, after a check of the titles."""
    file = str(path)
    try:
        # No other encoding is tried, because it would garble the labels.
        sheet = parse_sheet(read_bytes(path).decode("utf-8-sig"), file)
    except UnicodeDecodeError as error:
        raise InputError(file, f"is not UTF-8: byte {error.start} is wrong") from None
    columns = [title.lower() for title in sheet.titles]
    faults = [
        f"column {place}: title {title!r} is unknown; expected one of {', '.join(known)}, note"
        for place, title in enumerate(columns, start=1)
        if title not in (*known, "note")
    ]
    faults += [f"title {t!r} occurs twice" for t in sorted(set(columns)) if columns.count(t) > 1]
    faults += [f"no column {title}" for title in needed if title not in columns]
    # A row that is too long may be shifted, so its cells cannot be trusted.
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
    return Rule(
        cells["code"], cells["antecedent"], int(number), cells["flag"], cells["english"],
        cells["korean"],
    )  # fmt: skip


def _variables(file: str, rows: list[_Row]) -> list[Variable]:
    """Make the variables of the rows, or raise all their faults."""
    faults: list[str] = []
    heads: dict[str, _Row] = {}
    terms: dict[str, list[Term]] = {}
    for place, cells in rows:
        name = cells["variable"]
        kind = "term" if cells["term"] else "variable"
        faults += [
            f"{place}, column {column}: {cells[column]!r}; expected nothing, a {kind} has none"
            for column in _EMPTY[kind]
            if cells[column]
        ]
        if cells["term"]:
            term = _make(place, faults, _term, cells)
            terms.setdefault(name, []).extend([] if term is None else [term])
        elif name in heads:
            faults.append(f"{place}: variable {name} occurs twice")
        else:
            heads[name] = (place, cells)
    faults += [f"no row describes variable {name!r}" for name in terms if name not in heads]
    made = []
    for name, (place, cells) in heads.items():
        mine = tuple(terms.get(name, ()))
        # The faults of its terms, if all are faulty, were reported above.
        if mine or name not in terms:
            made.append(_make(place, faults, _variable, cells, mine))
    if faults or not made:
        raise InputError(file, *(faults or ["has no variable; expected one row per variable"]))
    return [variable for variable in made if variable is not None]


def _variable(cells: Mapping[str, str], terms: tuple[Term, ...]) -> Variable:
    low, high = (_number(cells, column) for column in ("low", "high"))
    labels = (cells["english"], cells["korean"])
    return Variable(cells["variable"], cells["unit"], low, high, terms, *labels)


def _term(cells: Mapping[str, str]) -> Term:
    corners = [
        _number(cells, column, inf if column.startswith("right") else -inf) for column in CORNERS
    ]
    a, b, c, d = corners
    return Term(cells["term"], (a, b, c, d), cells["crisp"], cells["english"], cells["korean"])


def _number(cells: Mapping[str, str], column: str, default: float | None = None) -> float:
    cell = cells[column]
    if not cell and default is not None:
        return default
    if not NUMBER.fullmatch(cell):
        raise ArgumentError(f"column {column}: {cell!r}; expected a number")
    return float(cell)


def _make(
    place: str, faults: list[str], make: Callable[..., _Made], *cells: object
) -> _Made | None:
    """Return what `make` makes of the cells, or None after adding its error to the faults."""
    try:
        return make(*cells)
    except ArgumentError as fault:
        faults.append(f"{place}: {fault}")
        return None
