"""Tables of Modbus devices, one row per block of registers or coils.

device,address,register,registers,function,period [ms],timeout [ms],retries
fan 1,5,100,20,3,500,200,1
"""

from __future__ import annotations

import re
from collections.abc import Callable
from math import isfinite
from os import PathLike
from typing import Any

import numpy as np

from shipnet.lists import Cells, Words
from shipnet.modbus.frame import MAX_UNIT
from shipnet.modbus.pdu import FunctionCode, exception_code
from shipnet.signals import plain
from shipnet.tables import read_sheet

#: Titles of columns, without units, spaces or punctuation.
_TITLES = {
    "device": "device name drive slave tag",
    "address": "address unit unitid slaveaddress slaveid id node deviceaddress modbusaddress",
    "register": "register firstregister startregister startaddress start",
    "registers": "registers numberofregisters noofregisters count quantity",
    "function": "function functioncode fc",
    "period": "period wantedperiod updateperiod updatetime interval",
    "timeout": "timeout responsetimeout",
    "retries": "retries retry",
    "delay": "delay processing processingtime responsetime latency",
    "host": "host ip ipaddress hostname",
    "dead": "dead silent",
    "values": "values value",
    "exception": "exception exceptioncode",
    "note": "note notes remark remarks comment comments description no nr",
}
_NEEDED, _TIMES = ("address", "register", "registers"), ("period", "timeout", "delay")

#: Numeric columns: lowest and highest value, and whether the numbers are whole.
_NUMBERS = {"address": (0, 255, True), "registers": (1, 1 << 16, True), "retries": (0, 100, True)}
_NUMBERS |= dict.fromkeys(_TIMES, (0, 3600, False))

_SERIAL = f"1..{MAX_UNIT} on a serial line; 0 is the broadcast, and others are reserved"


def _whole(cell: str) -> int:
    """Return the number or value of a register, decimal or as 0x...."""
    value = int(cell, 16 if cell[:2].lower() == "0x" else 10)
    if not 0 <= value <= 0xFFFF:
        raise ValueError
    return value


#: Other columns: the function that reads a cell, and the legal values.
_READ: dict[str, tuple[Callable[[str], Any], str]] = {
    "register": (_whole, "0..65535 or 0x0000..0xFFFF"),
    "function": (lambda cell: FunctionCode(int(cell)), "1..6, 15 or 16"),
    "exception": (lambda cell: exception_code(int(cell)), "1..6, 8, 10 or 11"),
    "dead": (lambda cell: {"yes": True, "no": False}[plain(cell)], "yes or no"),
    "values": (
        lambda cell: [*map(_whole, re.split(r"[\s,;]+", cell))],
        "values of 0..65535 with blanks between them",
    ),
}


class _Devices(Cells):
    """The cells of a table."""

    words = Words(
        {word: column for column, all_ in _TITLES.items() for word in all_.split()},
        dict.fromkeys(_NUMBERS, "") | dict.fromkeys(_TIMES, "s"),
    )
    noun, key, needs_unit, has_spares = "device", "device", frozenset(_TIMES), True
    titled_by = frozenset(_NEEDED)

    def column_faults(self) -> list[str]:
        """Return which of the required columns are missing."""
        return [f"no column {name}" for name in _NEEDED if name not in self.places]

    def is_entry(self, cell: Callable[[str], str]) -> bool:
        """Return whether a row has an address or a register."""
        return any(map(cell, _NEEDED))


def read_devices(path: str | PathLike[str]) -> tuple[list[dict[str, Any]], tuple[str, ...]]:
    """Return the rows of a table by column, None where empty, with `row`; and remarks."""
    what = f"titles of devices (at least {', '.join(_NEEDED)})"
    cells = _Devices(read_sheet(path, is_titles=_Devices.score(), what=what))
    columns: dict[str, list[Any]] = {name: cells.values(name, *one) for name, one in _READ.items()}
    for name, (low, high, whole) in _NUMBERS.items():
        numbers = cells.numbers(name, low, high, whole=whole, positive=name == "period").tolist()
        kind: Callable[[float], float] = int if whole else float
        columns[name] = [kind(value) if isfinite(value) else None for value in numbers]
    columns |= {name: cells[name] for name in ("device", "host")} | {"row": cells.rows}
    above = np.array([(value or 0) > 30000 for value in columns["register"]])
    cells.doubt("registers are addresses on the wire; 40001 of a manual has address 0", above)
    lines, taken = zip(*columns.values(), strict=True), dict[Any, str]()
    rows = [dict(zip(columns, line, strict=True)) for line in lines]
    for index, row in enumerate(rows):
        for name in _NEEDED:
            cells.wrong([index] * (not cells[name][index]), name, "a value")
        if row["host"] and not row["delay"]:
            cells.wrong([index], "delay", "the latency of a device over TCP")
        if not row["host"] and row["address"] in (0, *range(MAX_UNIT + 1, 256)):
            cells.wrong([index], "address", _SERIAL)
        row["function"] = row["function"] or FunctionCode.READ_HOLDING_REGISTERS
        row["device"] = row["device"] or f"{row['host'] or 'unit'} {row['address']}"
        unit, block = (row["host"], row["address"]), (row["function"], row["register"])
        for key, name in ((unit, row["device"]), (unit + block, f"row {row['row']}")):
            if taken.setdefault(key, name) != name:
                what = "address" if key == unit else "address, function and register"
                cells.fault(index, "address", f": the same {what} as {taken[key]}")
        if index not in cells.faulty and row["register"] + row["registers"] > 1 << 16:
            cells.wrong([index], "registers", "at most 65535 for the last register")
        if row["values"] and len(row["values"]) not in (1, row["registers"]):
            cells.wrong([index], "values", f"1 value or {row['registers']}")
    cells.check()
    return rows, cells.shown
