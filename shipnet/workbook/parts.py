"""What the parts of a workbook hold, gathered from the elements of their XML as they come by."""

from __future__ import annotations

import re
from datetime import datetime
from typing import NamedTuple

from shipnet.workbook.moments import moment

__all__ = ["ERRORS", "Elements", "Gatherer", "Merged", "Row", "Rows", "Strings"]

#: What a cell shows whose formula failed.
ERRORS = ("#DIV/0!", "#N/A", "#NAME?", "#NULL!", "#NUM!", "#REF!", "#VALUE!")

#: Rows and columns of Excel's grid, which ends at XFD1048576.
_ROWS, _COLUMNS = 2**20, 2**14

#: Most cells of a sheet, with the gaps before them.
_CELLS = 2**24

#: A character that XML cannot hold, as ECMA-376 part 1, section 22.9.2.19 writes it; halves of a
#: pair are left as they are.
_ESCAPED = re.compile("_x(?![dD][89a-fA-F])([0-9a-fA-F]{4})_")

#: One cell, or the first and the last of several.
_AREA = re.compile("([A-Z]{1,3})([0-9]{1,7})(?::([A-Z]{1,3})([0-9]{1,7}))?")


class Row(NamedTuple):
    """A row of a sheet.

    Parameters
    ----------
    number : int
        As Excel shows it, from 1.
    cells : list of str
        Without blanks around them, up to the last that is there; an empty one is ``""``.
    odd : dict of int to str
        What a cell is that is neither text nor plain number, by its place from 0: ``"a date or a
        time"``, ``"a number with words beside it"``, ``"true or false"``, ``"an error"``.
    """

    number: int
    cells: list[str]
    odd: dict[int, str]


class Merged(NamedTuple):
    """Cells that Excel shows as one, with what the first of them holds.

    Parameters
    ----------
    top, bottom : int
        First and last row, as Excel numbers them.
    left : int
        Place of the first column, from 0.
    """

    top: int
    bottom: int
    left: int


class _Local(dict[str, str]):
    """Names without their namespaces."""

    def __missing__(self, name: str) -> str:
        return self.setdefault(name, name.rpartition(" ")[2])


class Gatherer:
    """Takes the elements of a part; gathers the text of v and t, but for how it is spoken (rPh)."""

    def __init__(self) -> None:
        self.value = ""
        self.pieces: list[str] = []
        self._spoken = False
        self._local = _Local()

    def start(self, tag: str, own: dict[str, str]) -> None:
        """Take the begin of an element."""
        name = self._local[tag]
        if name == "v" or name == "t":
            self.pieces.clear()
        elif name == "rPh":
            self._spoken = True
        else:
            self._begin(name, own)

    def end(self, tag: str) -> None:
        """Take the end of an element."""
        name = self._local[tag]
        if name == "v" or name == "t":
            if not self._spoken:
                self.value += "".join(self.pieces)
        elif name == "rPh":
            self._spoken = False
        else:
            self._finish(name)

    def _begin(self, name: str, own: dict[str, str]) -> None:
        """Begin what holds texts."""

    def _finish(self, name: str) -> None:
        """End what holds texts."""


class Elements(Gatherer):
    """Takes elements as they are: in `done`, name of the parent, name, and attributes of each."""

    def __init__(self) -> None:
        super().__init__()
        self.done: list[tuple[str, str, dict[str, str]]] = []
        self._above = [""]

    def _begin(self, name: str, own: dict[str, str]) -> None:
        named = {self._local[key]: value for key, value in own.items()}
        self.done.append((self._above[-1], name, named))
        self._above.append(name)

    def _finish(self, name: str) -> None:
        self._above.pop()


class Strings(Gatherer):
    """Takes the texts that cells share: in `found`, each without blanks around it."""

    def __init__(self) -> None:
        super().__init__()
        self.found: list[str] = []

    def _begin(self, name: str, own: dict[str, str]) -> None:
        if name == "si":
            self.value = ""

    def _finish(self, name: str) -> None:
        if name == "si":
            self.found.append(_plain(self.value))


class Rows(Gatherer):
    """Takes the rows of a sheet: in `done`, those that are whole; in `merged`, merged cells.

    Parameters
    ----------
    strings : list of str
        The texts that cells share.
    formats : dict of str to str
        As `kind_of`, of the styles that make more of a number.
    epoch : datetime
        Day 0 of the workbook.

    Raises
    ------
    ValueError, LookupError
        If rows or cells are out of order, or hold what they cannot.
    """

    def __init__(self, strings: list[str], formats: dict[str, str], epoch: datetime) -> None:
        super().__init__()
        self.done: list[Row] = []
        self.merged: list[Merged] = []
        self._strings, self._formats, self._epoch = strings, formats, epoch
        self._numbers, self._places = _Numbers(), _Places()
        self._number = self._total = 0
        self._digits = self._kind = self._style = ""
        self._cells: list[str] = []
        self._odd: dict[int, str] = {}

    def _begin(self, name: str, own: dict[str, str]) -> None:
        if name == "c":
            self._go_to(own.get("r"))
            self.value, self._kind, self._style = "", own.get("t", "n"), own.get("s", "")
        elif name == "is":  # text in the cell itself stands for any value before it
            self.value = ""
        elif name == "row":
            number = int(own.get("r", self._number + 1))
            if not self._number < number <= _ROWS:
                raise ValueError(f"row {number} stands behind row {self._number}")
            self._number, self._digits = number, str(number)
            self._cells, self._odd = [], {}
        elif name == "mergeCell":
            self._merge(own["ref"])

    def _finish(self, name: str) -> None:
        if name == "c":
            self._cells.append(self._cell() if self.value else "")
        elif name == "row":
            self._total += len(self._cells)
            if self._total > _CELLS:
                raise ValueError(f"the sheet spans more than {_CELLS} cells")
            self.done.append(Row(self._number, self._cells, self._odd))

    def _go_to(self, reference: str | None) -> None:
        """Fill the row up to a cell; without a reference it is the next."""
        place = len(self._cells)
        if reference is None:
            if place == _COLUMNS:
                raise ValueError(f"row {self._number} has more than {_COLUMNS} cells")
            return
        letters = reference.removesuffix(self._digits)
        if letters == reference:
            raise ValueError(f"cell {reference!r} stands in row {self._number}")
        gap = self._places[letters] - place
        if gap < 0:
            raise ValueError(f"cell {reference!r} is out of order")
        if gap:
            self._cells += [""] * gap

    def _merge(self, reference: str) -> None:
        ends = _AREA.fullmatch(reference)
        if ends is None:
            raise ValueError(f"there are no cells {reference!r}")
        top, bottom = int(ends[2]), int(ends[4] or ends[2])
        self._total += max(0, bottom - top)
        if self._total > _CELLS:
            raise ValueError(f"the sheet spans more than {_CELLS} cells")
        self.merged.append(Merged(top, bottom, self._places[ends[1]]))

    def _cell(self) -> str:
        value, kind = self.value, self._kind
        if kind == "s":
            if not value.isdecimal():
                raise ValueError(f"a cell of row {self._number} holds the text number {value!r}")
            cell = self._strings[int(value)]
        elif kind == "n":
            cell = self._numbers[value]
            if what := self._formats.get(self._style):
                if what[0] == "0":
                    return cell.zfill(len(what)) if cell.isdecimal() else cell
                if what == "words":
                    self._odd[len(self._cells)] = "a number with words beside it"
                    return cell
                self._odd[len(self._cells)] = "a date or a time"
                return moment(float(value), what, self._epoch) or cell
            return cell
        elif kind == "b":
            self._odd[len(self._cells)] = "true or false"
            return str(bool(int(value)))
        elif kind == "d":
            self._odd[len(self._cells)] = "a date or a time"
            return value.replace("T", " ")
        else:
            cell = _plain(value)
        if kind == "e" or cell in ERRORS:
            self._odd[len(self._cells)] = "an error"
        return cell


class _Numbers(dict[str, str]):
    """Numbers as a table shows them, by what the file says; a list holds few different ones."""

    def __missing__(self, cell: str) -> str:
        if cell.removeprefix("-").isdecimal():
            return self.setdefault(cell, str(int(cell)))
        value = float(cell)
        # Excel knows no whole numbers: 7.0 is what it shows as 7.
        text = str(int(value)) if value.is_integer() else str(value)
        return self.setdefault(cell, text)


class _Places(dict[str, int]):
    """Places of columns from 0, by their letters."""

    def __missing__(self, letters: str) -> int:
        number = 0
        for letter in letters if re.fullmatch("[A-Z]{1,3}", letters) else ():
            number = 26 * number + ord(letter) - ord("A") + 1
        if not 1 <= number <= _COLUMNS:
            raise ValueError(f"there is no column {letters!r}")
        return self.setdefault(letters, number - 1)


def _plain(text: str) -> str:
    if "_x" in text:
        text = _ESCAPED.sub(lambda found: chr(int(found[1], 16)), text)
    return text.strip()
