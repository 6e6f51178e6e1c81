"""The cells of an I/O list by column, and the faults that are found in them."""

from __future__ import annotations

import re
from collections.abc import Iterable
from functools import cached_property
from itertools import zip_longest
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from shipnet.design.iolist.titles import column_of
from shipnet.errors import InputError

if TYPE_CHECKING:
    from shipnet.tables import Sheet

__all__ = ["Cells", "clean"]

_POSITION, _BOX = ("x_m", "y_m", "z_m"), ("box_x_m", "box_y_m", "box_z_m")

#: What a spreadsheet may take for a formula begins so; an apostrophe before it makes it text.
_FORMULA = re.compile(r"'+[=+\-@]")


class Cells:
    r"""The cells of a sheet under the columns of an I/O list.

    Parameters
    ----------
    sheet : Sheet
        Titles and rows.

    Raises
    ------
    InputError
        If the titles do not do for an I/O list, or there is no row below them.

    Examples
    --------
    >>> from shipnet.tables import parse_sheet
    >>> cells = Cells(parse_sheet("Tag,I/O,Home run [m]\nLS-1,DI,4"))
    >>> cells["tag"], cells["note"], cells.title("home_run_m")
    (['LS-1'], [''], 'Home run [m]')
    """

    def __init__(self, sheet: Sheet) -> None:
        self.sheet = sheet
        self.rows = [number for number, _ in sheet.rows]
        self.remarks = list(sheet.remarks)
        self.places: dict[str, list[int]] = {}
        self.scales: dict[str, float] = {}
        self._faults: list[tuple[int, int, str]] = []
        self._read_titles()
        width = len(sheet.titles)
        beside = [
            row for row, (_, cells) in enumerate(sheet.rows)
            if len(cells) > width and any(cells[width:])
        ]  # fmt: skip
        if sheet.separator:
            # The row is shifted, or a number has a comma in it.
            for row in beside:
                self.fault(row, "", f" has {len(sheet.rows[row][1])} cells; expected {width}")
        elif beside:
            self.remarks.append(f"not used: what stands beside the table in {len(beside)} rows")

    def __getitem__(self, name: str) -> list[str]:
        """Return the cells of a column, empty ones if the list has no such column."""
        places = self.places.get(name)
        return self.column(places[0]) if places else [""] * len(self.rows)

    def column(self, place: int) -> list[str]:
        """Return the cells of a column by its place."""
        return self._columns[place] if place < len(self._columns) else [""] * len(self.rows)

    @cached_property
    def _columns(self) -> list[list[str]]:
        return [list(c) for c in zip_longest(*(row for _, row in self.sheet.rows), fillvalue="")]

    def given(self, name: str) -> NDArray[np.bool_]:
        """Return whether each cell of a column holds something."""
        return np.array([cell != "" for cell in self[name]], dtype=bool)

    def title(self, name: str) -> str:
        """Return what the list itself calls a column."""
        places = self.places.get(name)
        return self.sheet.titles[places[0]] if places else name

    def fault(self, row: int, name: str, text: str) -> None:
        """Keep a fault of a row."""
        place = self.places[name][0] if name in self.places else -1
        self._faults.append((row, place, f"row {self.rows[row]}{text}"))

    def wrong(self, rows: Iterable[int], name: str, expected: str) -> None:
        """Keep the same fault of some cells of a column."""
        cells = self[name]
        for row in rows:
            what = self.odd(row, name)
            cell = f"{cells[row]!r}{what and f', {what}'}" if cells[row] else "is empty"
            self.fault(row, name, f", column {self.title(name)}: {cell}; expected {expected}")

    def odd(self, row: int, name: str) -> str:
        """Return what a cell is that is neither text nor number, else ``""``."""
        places = self.places.get(name, [-1])
        return self.sheet.odd.get((self.rows[row], places[0]), "")

    def check(self) -> None:
        """Raise all faults that were found, in the order of rows and columns."""
        if self._faults:
            raise InputError(self.sheet.source, *(text for _, _, text in sorted(self._faults)))

    def _read_titles(self) -> None:
        unused = []
        for place, title in enumerate(self.sheet.titles):
            column = column_of(title)
            if column is not None:
                self.places.setdefault(column.name, []).append(place)
                self.scales.setdefault(column.name, column.scale)
            elif title:
                unused.append(title)
            elif any(self.column(place)):
                unused.append(f"column {place + 1}, which has no title")
        faults = [
            f"{' and '.join(repr(self.sheet.titles[place]) for place in places)} both mean {name}"
            for name, places in self.places.items()
            if len(places) > 1 and name != "note"
        ]
        for group in (_POSITION, _BOX):
            missing = [name for name in group if name not in self.places]
            if 0 < len(missing) < 3:
                wanted = ", ".join(group)
                faults.append(f"no column {' and no '.join(missing)}; expected {wanted} or none")
        if "tag" not in self.places:
            faults.append("no column tag")
        if "signal" not in self.places and "type" not in self.places:
            faults.append("no column signal and no column type; expected one at least")
        if not {*_POSITION, "home_run_m"} & self.places.keys():
            faults.append(
                "no column says where a point is; expected x_m, y_m and z_m, or home_run_m, the "
                "length of its cable to the cabinet"
            )
        used = "; ".join(unused)
        if faults:
            faults = [f"row {self.sheet.top}: {fault}" for fault in faults]
            raise InputError(self.sheet.source, *faults, *([f"not known: {used}"] * bool(used)))
        if not self.rows:
            raise InputError(self.sheet.source, "has no points; expected one a row")
        if unused:
            self.remarks.append(f"not used: {used}")


def clean(cell: str) -> str:
    """Return text on one line, without the apostrophe that kept it from being a formula.

    Parameters
    ----------
    cell : str
        What a cell holds.

    Returns
    -------
    str
        The text that is meant.

    Examples
    --------
    >>> clean("jacket  water"), clean("'=A1")
    ('jacket water', '=A1')
    """
    # Of all blanks, only the common one can be printed.
    text = cell if cell.isprintable() and "  " not in cell else " ".join(cell.split())
    return text[1:] if text[:1] == "'" and _FORMULA.match(text) else text
