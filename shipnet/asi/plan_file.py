"""Plans as CSV files that a spreadsheet can write: one row an element.

    kind,node,to,length_m,cable,address,profile,current_ma,voltage_v,rating_a
    master,bridge,,,,,,,,
    supply,bridge,,,,,,,30,4
    cable,bridge,deck,60,as-i 1.5,,,,,
    slave,deck,,,,12A,S-0.A,20,,

A cell that its kind of row does not know stays empty; a cell that may be left empty takes the
default of its element. Columns may come in any order and be left out if no row needs them.
`note` is for remarks, which are not kept.
"""

from __future__ import annotations

import csv
from collections.abc import Callable, Sequence
from decimal import Decimal
from itertools import zip_longest
from os import PathLike
from pathlib import Path
from typing import Any, NamedTuple

from shipnet.asi.elements import Repeater, Supply, Terminator
from shipnet.asi.master import Master
from shipnet.asi.profile import Profile
from shipnet.asi.segment import Element, structure_faults
from shipnet.asi.slave import Slave, slave_key
from shipnet.errors import ArgumentError, InputError
from shipnet.fields import Number, declared
from shipnet.line.cable import CABLES
from shipnet.line.network import CableRun
from shipnet.tables import NUMBER, Sheet, read_sheet


class _Column(NamedTuple):
    """A column of numbers: how it is declared, and the power of ten of its unit."""

    declared: Number
    power: int = 0


def _declared(element: type, field: str) -> Number:
    kind = declared(element)[field]
    assert isinstance(kind, Number)
    return kind


_NUMBERS = {
    "length_m": _Column(Number(low=0.01, high=10e3, unit="m", shown=(0.01, 10e3))),
    "current_ma": _Column(_declared(Slave, "current"), -3),
    "voltage_v": _Column(_declared(Supply, "voltage")),
    "rating_a": _Column(_declared(Supply, "rating")),
    "delay_us": _Column(_declared(Repeater, "delay"), -6),
    "resistance_ohm": _Column(_declared(Terminator, "resistance")),
}

_PREFIX = {0: "", -3: "m", -6: "u"}

#: Kinds of row: what is made of it, and the column of each of its arguments; those that must not
#: be empty first.
_KINDS: dict[str, tuple[Callable[..., Element], dict[str, str], dict[str, str]]] = {
    "master": (Master, {"node": "node"}, {"current": "current_ma"}),
    "supply": (Supply, {"node": "node"}, {"voltage": "voltage_v", "rating": "rating_a"}),
    "cable": (CableRun, {"a": "node", "b": "to", "length": "length_m"}, {"cable": "cable"}),
    "repeater": (
        Repeater,
        {"a": "node", "b": "to"},
        {"delay": "delay_us", "current": "current_ma"},
    ),
    "terminator": (Terminator, {"node": "node"}, {"resistance": "resistance_ohm"}),
    "slave": (
        Slave,
        {"node": "node", "label": "address"},
        {"profile": "profile", "current": "current_ma"},
    ),
}

#: Columns of a plan file, in the order in which they are written.
COLUMNS = ("kind", "node", "to", "length_m", "cable", "address", "profile", "current_ma",
           "voltage_v", "rating_a", "delay_us", "resistance_ohm")  # fmt: skip


def read_elements(path: str | PathLike[str]) -> list[Element]:
    """Read the elements of a plan from a file; `read_plan` says how."""
    return _parse(read_sheet(path))


def write_elements(elements: Sequence[Element], path: str | PathLike[str]) -> None:
    """Write the elements of a plan as a CSV file, with all digits of their numbers."""
    for one in elements:
        if isinstance(one, CableRun) and not isinstance(one.cable, str):
            raise ArgumentError(f"{one} has a cable of its own; a file names cables by type only")
    used = [column for column in COLUMNS if any(column in _row(element) for element in elements)]
    with Path(path).open("w", newline="", encoding="utf-8") as stream:
        writer = csv.DictWriter(stream, used, restval="", lineterminator="\n")
        writer.writeheader()
        writer.writerows(_row(element) for element in elements)


def _row(element: Element) -> dict[str, str]:
    kind, (_, needed, optional) = next(
        (name, rule) for name, rule in _KINDS.items() if rule[0] is type(element)
    )
    row = {"kind": kind}
    for argument, column in (needed | optional).items():
        value = getattr(element, argument)
        if column in _NUMBERS:
            # Shifting the point of the shortest decimal leaves it the same number, to the bit.
            shifted = Decimal(repr(value)).scaleb(-_NUMBERS[column].power)
            row[column] = f"{shifted.normalize():f}"
        else:
            row[column] = str(value)
    return row


def _parse(sheet: Sheet) -> list[Element]:
    columns = [title.lower() or f"#{n}" for n, title in enumerate(sheet.titles, start=1)]
    faults = _title_faults(sheet.top, columns)
    if faults:
        raise InputError(sheet.source, *faults)
    elements: list[Element] = []
    rows: dict[int, int] = {}
    faulty_cables = False
    comma = sheet.separator != "," and any(
        "," in cell
        for _, row in sheet.rows
        for column, cell in zip(columns, row, strict=False)
        if column in _NUMBERS
    )
    for number, row in sheet.rows:
        if any(row[len(columns) :]):
            faults.append(f"row {number} has {len(row)} cells; expected {len(columns)}")
            faulty_cables = True
            continue
        cells = dict(zip_longest(columns, row[: len(columns)], fillvalue=""))
        element, wrong = _element(cells, "," if comma else ".")
        faults += [f"row {number}, {fault}" for fault in wrong]
        if element is not None:
            rows[id(element)] = number
            elements.append(element)
        else:
            # What is of no known kind may have been meant as a cable.
            faulty_cables |= cells["kind"].lower() not in _KINDS.keys() - {"cable"}
    # With a cable missing, what hangs on it would look loose.
    if not faulty_cables:
        if not any(isinstance(element, CableRun) for element in elements):
            faults.append("has no row of kind cable; expected at least one")
        else:
            found = structure_faults(elements)
            faults += [f"row {rows[id(element)]}: {fault}" for element, fault in found]
    if faults:
        raise InputError(sheet.source, *faults)
    return elements


def _title_faults(row: int, columns: list[str]) -> list[str]:
    faults = [
        f"row {row}, column {place}: title {name!r} is unknown; expected one of "
        f"{', '.join(COLUMNS)}, note"
        for place, name in enumerate(columns, start=1)
        if name not in (*COLUMNS, "note") and not name.startswith("#")
    ]
    twice = sorted({name for name in columns if columns.count(name) > 1})
    faults += [f"row {row}: title {name!r} stands twice" for name in twice]
    missing = [name for name in ("kind", "node") if name not in columns]
    return faults + [f"row {row}: no column {name}" for name in missing]


def _element(cells: dict[str, str], point: str) -> tuple[Element | None, list[str]]:
    """Make an element of a row, or say all that keeps it from being one."""
    name = cells["kind"].lower()
    if name not in _KINDS:
        return None, [f"column kind: {cells['kind']!r}; expected one of {', '.join(_KINDS)}"]
    make, needed, optional = _KINDS[name]
    faults = []
    arguments: dict[str, Any] = {}
    for argument, column in (needed | optional).items():
        cell = cells.get(column, "")
        if not cell:
            if argument in needed:
                faults.append(f"column {column}: is empty; a {name} needs it")
            continue
        try:
            arguments |= _read(argument, column, cell, point)
        except ArgumentError as expected:
            faults.append(f"column {column}: {cell!r}; expected {expected}")
    known = {"kind", "note", *needed.values(), *optional.values()}
    faults += [
        f"column {column}: {cell!r}; expected nothing, a {name} has no {column}"
        for column, cell in cells.items()
        if cell and column not in known
    ]
    if faults:
        return None, faults
    try:
        return make(**arguments), []
    except ArgumentError as fault:
        return None, [str(fault)]


def _read(argument: str, column: str, cell: str, point: str) -> dict[str, Any]:
    """Return the argument that a cell holds; the error says what was expected."""
    if column in _NUMBERS:
        return {argument: _number(column, cell, point)}
    if column == "address":
        label = cell.upper()
        try:
            return {argument: f"{slave_key(label)[0] >> 1}{slave_key(label)[1] or ''}"}
        except ArgumentError:
            raise ArgumentError(
                "0 to 31, with A or B behind it for a slave that shares it"
            ) from None
    if column == "profile":
        try:
            return {argument: Profile.parse(cell)}
        except ArgumentError:
            raise ArgumentError("a profile such as S-7.A.E or S-0.F") from None
    if column == "cable" and cell not in CABLES:
        raise ArgumentError(f"one of {', '.join(CABLES)}")
    return {argument: cell}


def _number(column: str, cell: str, point: str) -> float:
    known, power = _NUMBERS[column]
    low, high = known.low, known.high
    legal = f"a number {low * 10**-power:g}..{high * 10**-power:g} {_PREFIX[power]}{known.unit}"
    other = "," if point == "." else "."
    if other in cell:
        raise ArgumentError(f"{legal}, with a decimal {'point' if point == '.' else 'comma'}")
    text = cell.replace(",", ".")
    if not NUMBER.fullmatch(text):
        raise ArgumentError(legal)
    value = float(Decimal(text).scaleb(power))
    if not low <= value <= high:
        raise ArgumentError(legal)
    return value
