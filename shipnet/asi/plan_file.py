"""Read and write plans as tables with one row per element.

    kind,node,to,length_m,cable,address,profile,current_ma,channels,voltage_v,rating_a
    master,bridge,,,,,,,,,
    supply,bridge,,,,,,,,30,4
    cable,bridge,deck,60,as-i 1.5,,,,,,
    slave,deck,,,,12A,S-0.A,20,,,
    slave,deck,,,,13,S-7.3,20,4,,

Cells that do not apply to the row's kind of element must be empty; an empty optional cell means
the element's default. Columns may be in any order, and unused ones may be omitted. Titles and cells
may state another unit, such as ``length [mm]`` or ``0.5 A``. `note` has remarks on the
elements; other columns are not used, as a remark says.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from decimal import Decimal
from math import isnan
from os import PathLike
from typing import Any, TypeAlias

from shipnet.asi.master import Master
from shipnet.asi.profile import Profile
from shipnet.asi.segment import Element, Repeater, Supply, Terminator, nodes_of, structure_faults
from shipnet.asi.slave import Slave, slave_key
from shipnet.asi.timing import CHANNELS, transfers_values
from shipnet.errors import ArgumentError
from shipnet.fields import Number, declared
from shipnet.lazy import pd
from shipnet.line.cable import CABLES
from shipnet.line.network import CableRun
from shipnet.lists import Cells, Words
from shipnet.signals import plain
from shipnet.tables import read_sheet, save_table

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
        {name: name for name in ("profile", "channels")}
        | {"current": "current_ma", "conversion": "conversion_ms"},
    ),
}

#: Columns of a plan file, in the order in which they are written.
COLUMNS = tuple(
    "kind node to length_m cable address profile current_ma channels conversion_ms voltage_v "
    "rating_a delay_us resistance_ohm inductance_uh".split()
)

#: Further titles of columns, without units, spaces or punctuation.
_SYNONYMS = {
    "kind": "element",
    "node": "from",
    "cable": "cabletype",
    "length_m": "cablelength",
    "note": "notes remark remarks comment comments description",
}

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


class _Elements(Cells):
    """The cells of a plan."""

    words = Words(
        {
            plain(word): column
            for column in (*COLUMNS, "note")
            for word in [column.partition("_")[0], *_SYNONYMS.get(column, "").split()]
        },
        {column: column.rpartition("_")[2] for column in _NUMBERS},
    )
    noun, key = "element", "kind"
    titled_by = frozenset({"kind", "node"})
    needs_unit = frozenset({"current_ma", "conversion_ms", "delay_us"})

    def column_faults(self) -> list[str]:
        """Return which of the required columns are missing."""
        return [f"no column {name}" for name in ("kind", "node") if name not in self.places]

    def is_entry(self, cell: Callable[[str], str]) -> bool:
        """Return whether a row names a kind of element, or fills two cells."""
        return cell("kind").lower() in _KINDS or sum(bool(cell(name)) for name in COLUMNS) > 1


def read_elements(path: str | PathLike[str]) -> tuple[list[Element], Notes, tuple[str, ...]]:
    """Read the elements of a plan from a file, the notes on them, and remarks on the reading."""
    what = "titles of a plan (at least kind and node)"
    sheet = read_sheet(path, is_titles=_Elements.score(), what=what)
    cells = _Elements(sheet, is_saved={*sheet.titles} <= {*COLUMNS, "note"})
    columns = {column: cells[column] for column in COLUMNS}
    values: dict[str, list[Any]] = {}
    for column in COLUMNS:
        if column in _NUMBERS:
            declaration, _ = _NUMBERS[column]
            unit = declaration.unit.casefold()
            numbers = cells.numbers(column, declaration.low, declaration.high, unit).tolist()
            values[column] = [None if isnan(number) else number for number in numbers]
        else:
            read, legal = _READ.get(column, (str, ""))
            values[column] = cells.values(column, read, legal)
    elements: list[tuple[int, Element]] = []
    for row in range(len(cells.rows)):
        name = columns["kind"][row].lower()
        if name not in _KINDS:
            cells.wrong([row], "kind", f"one of {', '.join(_KINDS)}")
            continue
        make, needed, optional = _KINDS[name]
        used = needed | optional
        for column in needed.values():
            if not columns[column][row]:
                cells.wrong([row], column, f"a value; a {name} needs it")
        for column in columns.keys() - {"kind", *used.values()}:
            if columns[column][row]:
                cells.wrong([row], column, f"an empty cell; a {name} has no {column}")
        arguments = {key: values[column][row] for key, column in used.items()}
        filled = {key: value for key, value in arguments.items() if value is not None}
        try:
            if row not in cells.faulty:
                elements.append((row, make(**filled)))
        except ArgumentError as fault:
            cells.fault(row, "kind", f", {fault}")
    # Check the structure only if every cable was read; otherwise devices would seem unconnected.
    # A row of unknown kind may be meant as a cable.
    kinds = {columns["kind"][row].lower() for row in cells.faulty}
    missing = []
    if kinds <= _KINDS.keys() - {"cable"}:
        if not any(isinstance(element, CableRun) for _, element in elements):
            missing = ["has no row of kind cable; expected at least one"]
        rows = {id(element): row for row, element in elements}
        plan = [element for _, element in elements]
        for element, why in () if missing else structure_faults(plan):
            cells.fault(rows[id(element)], "kind", f": {why}")
    cells.check(*missing)
    texts = cells["note"]
    notes = {note_key(element): texts[row] for row, element in elements if texts[row]}
    return [element for _, element in elements], notes, cells.shown


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
