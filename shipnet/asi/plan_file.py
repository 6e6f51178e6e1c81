"""Read and write plans as tables with one row per element.

    kind,node,to,length_m,cable,address,profile,current_ma,channels,voltage_v,rating_a
    master,bridge,,,,,,,,,
    supply,bridge,,,,,,,,30,4
    cable,bridge,deck,60,as-i 1.5,,,,,,
    slave,deck,,,,12A,S-0.A,20,,,
    slave,deck,,,,13,S-7.3,20,4,,

Cells that do not apply to the row's kind of element must be empty; an empty optional cell means
the element's default. Columns may be in any order; `note` (remarks) and unused columns may be
omitted.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from decimal import Decimal
from os import PathLike
from typing import Any, TypeAlias

from shipnet.asi.master import Master
from shipnet.asi.profile import Profile
from shipnet.asi.segment import Element, Repeater, Supply, Terminator, nodes_of, structure_faults
from shipnet.asi.slave import Slave, slave_key
from shipnet.asi.timing import CHANNELS, transfers_values
from shipnet.errors import ArgumentError, InputError
from shipnet.fields import Number, declared
from shipnet.lazy import pd
from shipnet.line.cable import CABLES
from shipnet.line.network import CableRun
from shipnet.tables import NUMBER, in_order, read_sheet, save_table, titled

#: Numeric columns: the declaration of each, and the power of ten of its unit.
_NUMBERS: dict[str, tuple[Any, int]] = {
    "length_m": (Number(low=0.01, high=10e3, unit="m", shown=(0.01, 10e3)), 0),
    "current_ma": (declared(Slave)["current"], -3),
    "conversion_ms": (declared(Slave)["conversion"], -3),
    "voltage_v": (declared(Supply)["voltage"], 0),
    "rating_a": (declared(Supply)["rating"], 0),
    "delay_us": (declared(Repeater)["delay"], -6),
    "resistance_ohm": (declared(Terminator)["resistance"], 0),
    "inductance_uh": (declared(Terminator)["inductance"], -6),
}

_PREFIX = {0: "", -3: "m", -6: "u"}

#: Kinds of rows: class of the element, columns of its required and of its optional arguments.
_KINDS: dict[str, tuple[Callable[..., Element], dict[str, str], dict[str, str]]] = {
    "master": (Master, {"node": "node"}, {"current": "current_ma"}),
    "supply": (Supply, {"node": "node"}, {"voltage": "voltage_v", "rating": "rating_a"}),
    "cable": (CableRun, {"a": "node", "b": "to", "length": "length_m"}, {"cable": "cable"}),
    "repeater": (
        Repeater,
        {"a": "node", "b": "to"},
        {"delay": "delay_us", "current": "current_ma"},
    ),
    "terminator": (
        Terminator,
        {"node": "node"},
        {"resistance": "resistance_ohm", "inductance": "inductance_uh"},
    ),
    "slave": (
        Slave,
        {"node": "node", "label": "address"},
        {
            "profile": "profile",
            "current": "current_ma",
            "channels": "channels",
            "conversion": "conversion_ms",
        },
    ),
}

#: Columns of a plan file, in the order in which they are written.
COLUMNS = tuple(
    "kind node to length_m cable address profile current_ma channels conversion_ms voltage_v "
    "rating_a delay_us resistance_ohm inductance_uh".split()
)


#: Remarks on elements, by `note_key`.
Notes: TypeAlias = Mapping[tuple[str, ...], str]


def note_key(element: Element) -> tuple[str, ...]:
    """Return the key of an element's note: its kind, its node or nodes, and a slave's address."""
    kind = next(name for name, rule in _KINDS.items() if rule[0] is type(element))
    return (kind, *nodes_of(element), *([element.label] if isinstance(element, Slave) else []))


def write_elements(elements: Sequence[Element], path: str | PathLike[str], notes: Notes) -> None:
    """Write the elements of a plan to a file, with their numbers in full precision."""
    for one in elements:
        if isinstance(one, CableRun) and not isinstance(one.cable, str):
            raise ArgumentError(f"{one} has a custom cable; a file can only name a cable type")
    rows = [_row(one) for one in elements]
    for one, row in zip(elements, rows, strict=True):
        if note := notes.get(note_key(one)):
            row["note"] = note
    used = [column for column in (*COLUMNS, "note") if any(column in row for row in rows)]
    save_table(path, pd.DataFrame(rows, columns=used))


def _row(element: Element) -> dict[str, str]:
    kind, (_, needed, optional) = next(
        (name, rule) for name, rule in _KINDS.items() if rule[0] is type(element)
    )
    row = {"kind": kind}
    for argument, column in (needed | optional).items():
        if isinstance(element, Slave) and argument in ("channels", "conversion"):
            if not transfers_values(element.kind):
                continue
        value = getattr(element, argument)
        if column in _NUMBERS:
            # Shifting the decimal point of the shortest exact notation loses no precision.
            shifted = Decimal(repr(value)).scaleb(-_NUMBERS[column][1])
            row[column] = f"{shifted.normalize():f}"
        else:
            row[column] = str(value)
    return row


def read_elements(path: str | PathLike[str]) -> tuple[list[Element], Notes]:
    """Read the elements of a plan from a file, and the notes on them."""
    sheet = read_sheet(path)
    needed = ("kind", "node")
    defaults = {column: None if column in needed else "" for column in (*COLUMNS, "note")}
    rows, faults = titled(sheet, defaults)
    # Check the structure only if every cable was read; otherwise devices would seem unconnected.
    whole = not faults
    point = "."
    if sheet.separator != "," and any("," in row[column] for _, row in rows for column in _NUMBERS):
        point = ","
    elements: list[Element] = []
    notes: dict[tuple[str, ...], str] = {}
    numbers: dict[int, int] = {}
    for number, row in rows:
        element, wrong = _element(row, point)
        faults += [(number, f", {fault}") for fault in wrong]
        if element is not None:
            numbers[id(element)] = number
            elements.append(element)
            if row["note"]:
                notes[note_key(element)] = row["note"]
        else:
            # A row of unknown kind may be meant as a cable.
            whole &= row["kind"].lower() in _KINDS.keys() - {"cable"}
    messages = in_order(faults)
    if whole and not any(isinstance(element, CableRun) for element in elements):
        messages.append("has no row of kind cable; expected at least one")
    elif whole:
        misplaced = structure_faults(elements)
        messages += [f"row {numbers[id(element)]}: {fault}" for element, fault in misplaced]
    if messages:
        raise InputError(sheet.source, *messages)
    return elements, notes


def _element(row: dict[str, str], point: str) -> tuple[Element | None, list[str]]:
    """Return the element that a row describes, or None, and all faults of the row."""
    name = row["kind"].lower()
    if name not in _KINDS:
        return None, [f"column kind: {row['kind']!r}; expected one of {', '.join(_KINDS)}"]
    make, needed, optional = _KINDS[name]
    arguments: dict[str, Any] = {}
    faults = [
        f"column {column} is empty; a {name} needs it"
        for column in needed.values()
        if not row[column]
    ]
    for argument, column in (needed | optional).items():
        try:
            if row[column]:
                arguments[argument] = _value(column, row[column], point)
        except ArgumentError as expected:
            faults.append(f"column {column}: {row[column]!r}; expected {expected}")
    used = {"kind", "note", *needed.values(), *optional.values()}
    faults += [
        f"column {column}: {cell!r}; expected an empty cell; a {name} has no {column}"
        for column, cell in row.items()
        if cell and column not in used
    ]
    try:
        return (None if faults else make(**arguments)), faults
    except ArgumentError as fault:
        return None, [str(fault)]


def _value(column: str, cell: str, point: str) -> Any:
    """Return the value of a cell, or raise an error that states the legal values."""
    if column in _NUMBERS:
        return _number(column, cell, point)
    read, expected = _READ.get(column, (str, ""))
    try:
        return read(cell)
    except (ValueError, KeyError):
        raise ArgumentError(expected) from None


def _label(cell: str) -> str:
    key, half = slave_key(cell.upper())
    return f"{key >> 1}{half or ''}"


#: Other columns with restricted cells: the function that reads a cell, and the legal values.
_READ: dict[str, tuple[Callable[[str], Any], str]] = {
    "address": (_label, "0 to 31, followed by A or B for an A/B slave"),
    "profile": (Profile.parse, "a profile such as S-7.A.E or S-0.F"),
    "channels": (int, f"a whole number, 1 to {CHANNELS}"),
    "cable": (dict(zip(CABLES, CABLES, strict=True)).__getitem__, f"one of {', '.join(CABLES)}"),
}


def _number(column: str, cell: str, point: str) -> float:
    declaration, power = _NUMBERS[column]
    low, high = declaration.low, declaration.high
    legal = (
        f"a number {low * 10**-power:g}..{high * 10**-power:g} {_PREFIX[power]}{declaration.unit}"
    )
    if {".": ",", ",": "."}[point] in cell:
        raise ArgumentError(f"{legal}, with a decimal {'point' if point == '.' else 'comma'}")
    text = cell.replace(",", ".")
    if (
        not NUMBER.fullmatch(text)
        or not low <= (value := float(Decimal(text).scaleb(power))) <= high
    ):
        raise ArgumentError(legal)
    return value
