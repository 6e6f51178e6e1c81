"""The text files that oscilloscopes write: a header of any length, then columns of numbers.

No two makers agree on the header, so nothing is looked for at a fixed place. The last rows of the
file say which columns hold numbers; the header ends where the first such row stands; titles and
units are what stands above. The layouts that were read for this: Tektronix TDS (the header beside
the data) and MDO, Keysight, Rigol (an increment instead of times), Siglent, LeCroy, PicoScope,
Rohde & Schwarz, OWON, Digilent.
"""

from __future__ import annotations

import io
import re
from collections import Counter
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from shipnet.errors import InputError

__all__ = ["Column", "Table", "read_table"]

#: Rows at the end of the file that decide on its layout, and rows that may be header.
_TAIL, _HEADER = 10, 2000

_NUMBER = r"[+-]?(?:[0-9]+[.,]?[0-9]*|[.,][0-9]+)(?:[eE][+-]?[0-9]+)?"
_IS_NUMBER = re.compile(rf"{_NUMBER}|[+-]?inf", re.ASCII)
_QUANTITY = re.compile(rf"(?:[^:=]*[:=])?\s*({_NUMBER})\s*([a-zµμ/]*)", re.ASCII | re.IGNORECASE)
_UNIT_IN_TITLE = re.compile(r"(.*?)\s*(?:[(\[]([^()\[\]]*)[)\]]|\bin\s+(\S+))\s*")
_INTERVAL = re.compile(
    r"(sampl\w*\s+(interval|period)|time\s+(interval|increment)|(x\s*|t)?inc(rement)?"
    r"|interval|delta\s*t|dt)\b"
)
_RATE = re.compile(r"(sampl\w*\s+(rate|frequency|freq)|samplerate|fs)\b")

#: Prefixes of units; a scope shows no megavolt and no megasecond, so case does not matter there.
_PREFIX = {"": 1.0, "p": 1e-12, "n": 1e-9, "u": 1e-6, "µ": 1e-6, "μ": 1e-6, "m": 1e-3, "k": 1e3}
_BASE = {
    "s": "s", "sec": "s", "second": "s", "seconds": "s",
    "v": "V", "volt": "V", "volts": "V",
    "a": "A", "amp": "A", "ampere": "A", "w": "W", "watt": "W", "hz": "Hz", "db": "dB",
}  # fmt: skip


class Column(NamedTuple):
    """What the header says about one column of numbers.

    Attributes
    ----------
    number : int
        Its place in the file, 1 for the first.
    title : str
        Its title, or ``""``.
    unit : str
        ``"s"``, ``"V"``, another unit, or ``""`` where the header gives none.
    scale : float
        Factor from the unit printed to the base unit: 1e-6 for ``"(us)"``.
    digits : int
        Significant digits of the longest number among the first and the last rows.
    """

    number: int
    title: str
    unit: str
    scale: float
    digits: int


class Table(NamedTuple):
    """The numbers of a text file with what its header says.

    Attributes
    ----------
    values : ndarray of float, shape (n_rows, n_columns)
        As printed, not scaled. What the scope marked as off its scale holds the largest or the
        smallest number of its column.
    columns : list of Column
        One for each column of `values`.
    interval : float or None
        Time between two samples if the header states it [s].
    """

    values: npt.NDArray[np.float64]
    columns: list[Column]
    interval: float | None


def read_table(file: str, data: bytes) -> Table:
    r"""Read what a scope wrote as text.

    Parameters
    ----------
    file : str
        Name of the file for the messages.
    data : bytes
        All of its content: UTF-8, UTF-16 with a mark, or Latin-1; lines that end in LF, CR LF or
        CR; columns separated by tabs, semicolons, commas or blanks; decimal points, or decimal
        commas where the comma does not separate.

    Returns
    -------
    Table
        The columns that hold numbers throughout.

    Raises
    ------
    InputError
        If there is no column of numbers, or a cell within the numbers is none: row and column of
        each.

    Examples
    --------
    >>> table = read_table("a.csv", b"Time;Channel A\r\n(us);(mV)\r\n\r\n-0,5;-20\r\n0,0;1,5\r\n")
    >>> [(column.title, column.unit, column.scale) for column in table.columns]
    [('Time', 's', 1e-06), ('Channel A', 'V', 0.001)]
    >>> table.values.tolist()
    [[-0.5, -20.0], [0.0, 1.5]]
    """
    data = _normal(file, data)
    tail = [line for line in _text(data[-64_000:]).split("\n") if line.strip(" ,;\t")][-_TAIL:]
    separator, places, decimal = _layout(tail)
    if not places:
        raise InputError(file, "no column of numbers at its end; expected time and voltage")
    header, offset = _header(file, data, separator, places, decimal)
    try:
        values = _parse(data, offset, separator, places, decimal)
    except ValueError:
        values = _parse_slowly(file, data, len(header), separator, places, decimal)
    beyond = np.isinf(values)
    if beyond.any():
        finite = np.where(beyond, np.nan, values)
        if np.isnan(finite).all(axis=0).any():
            raise InputError(file, "a column is off the scale throughout")
        values = np.clip(values, np.nanmin(finite, axis=0), np.nanmax(finite, axis=0))
    first = _text(data[offset : offset + 4000]).split("\n")[:-1] or tail
    digits = _digits(first[:_TAIL] + tail, separator, places)
    above = [_split(line, separator) for line in header]
    beside = [_split(line, separator)[: places[0]] for line in first]
    return Table(values, _columns(above, places, digits), _interval(above, beside))


def _normal(file: str, data: bytes) -> bytes:
    """Return the content as UTF-8 or Latin-1 without a mark, its lines ended by LF."""
    if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        data = data.decode("utf-16", errors="replace").encode()
    if b"\0" in data:
        raise InputError(file, "not text: it holds zero bytes; expected a table of numbers")
    data = data.removeprefix("\ufeff".encode())
    if b"\r" in data:
        data = data.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    # How PicoScope marks a sample that is off the scale, and how a word processor writes minus.
    return data.replace("∞".encode(), b"inf").replace("\u2212".encode(), b"-")


def _text(data: bytes) -> str:
    try:
        return data.decode()
    except UnicodeDecodeError:
        return data.decode("latin-1")


def _split(line: str, separator: str | None) -> list[str]:
    cells = line.split(separator)
    return [cell.strip(" \t\"'") for cell in cells]


def _is_number(cell: str) -> bool:
    return _IS_NUMBER.fullmatch(cell) is not None


def _layout(tail: list[str]) -> tuple[str | None, tuple[int, ...], str]:
    """Return separator (None: blanks), places of the columns of numbers, and decimal sign."""
    separator: str | None
    for separator in ("\t", ";", ","):
        if 2 * sum(separator in line for line in tail) > len(tail):
            break
    else:
        # A single column has no separator; its header may well have commas.
        separator = None if any(len(line.split()) > 1 for line in tail) else ","
    rows = [_split(line, separator) for line in tail]
    patterns = Counter(
        tuple(place for place, cell in enumerate(row) if _is_number(cell)) for row in reversed(rows)
    )
    places = next(iter(patterns.most_common(1)), ((), 0))[0]
    cells = [row[place] for row in rows for place in places if place < len(row)]
    decimal = "," if separator != "," and any("," in cell for cell in cells) else "."
    return separator, places, decimal


def _header(
    file: str, data: bytes, separator: str | None, places: tuple[int, ...], decimal: str
) -> tuple[list[str], int]:
    """Return the lines above the numbers and the byte at which the numbers begin.

    A row of numbers counts only if no other line than a row of numbers or a blank one is among
    the next two: a header may hold numbers as well.
    """
    lines: list[str] = []
    starts: list[int] = []
    run = position = 0
    while position < len(data) and len(lines) - run < _HEADER:
        end = data.find(b"\n", position)
        end = len(data) if end < 0 else end
        line = _text(data[position:end])
        lines.append(line)
        starts.append(position)
        position = end + 1
        cells = _split(line, separator)
        if all(_value(cells, place, decimal) is not None for place in places):
            run += 1
        elif any(cells) or not run:
            run = 0
        else:
            run += 1
        if run == 3:
            break
    if not run:
        raise InputError(
            file, f"no row of numbers in the first {_HEADER} rows; expected time and voltage"
        )
    return lines[:-run], starts[-run]


def _value(cells: list[str], place: int, decimal: str) -> float | None:
    if place >= len(cells) or not _is_number(cells[place]):
        return None
    if decimal == "." and "," in cells[place]:
        return None
    try:
        return float(cells[place].replace(",", "."))
    except ValueError:
        return None


def _parse(
    data: bytes, offset: int, separator: str | None, places: tuple[int, ...], decimal: str
) -> npt.NDArray[np.float64]:
    """Read all rows at once; raise ValueError where one is not as the others."""
    import pandas as pd

    body = io.BytesIO(data)
    body.seek(offset)
    frame = pd.read_csv(
        body,
        sep=separator or r"\s+",
        header=None,
        usecols=list(places),
        dtype=np.float64,
        decimal=decimal,
        engine="c",
        quoting=3,
        na_filter=False,
        encoding="latin-1",
    )
    values = frame.to_numpy()
    if np.isnan(values).any():
        raise ValueError
    return values


def _parse_slowly(
    file: str,
    data: bytes,
    skip: int,
    separator: str | None,
    places: tuple[int, ...],
    decimal: str,
) -> npt.NDArray[np.float64]:
    """Read row by row, and name every cell that is not a number."""
    rows: list[list[float]] = []
    faults: list[str] = []
    more = 0
    for number, line in enumerate(_text(data).split("\n")[skip:], start=skip + 1):
        cells = _split(line, separator)
        if not any(cells):
            continue
        row = [_value(cells, place, decimal) for place in places]
        for place, value in zip(places, row, strict=True):
            if value is None and len(faults) == InputError.shown:
                more += 1
            elif value is None:
                cell = cells[place] if place < len(cells) else ""
                what = f"{cell[:20]!r} is not a number" if cell else "is empty"
                faults.append(f"row {number}, column {place + 1}{': ' if cell else ' '}{what}")
        rows.append([np.nan if value is None else value for value in row])
    if faults:
        raise InputError(file, *faults, more=more)
    return np.array(rows)


def _digits(lines: list[str], separator: str | None, places: tuple[int, ...]) -> list[int]:
    rows = [_split(line, separator) for line in lines]
    mantissas = [
        [re.split("[eE]", row[place])[0] for row in rows if place < len(row)] for place in places
    ]
    return [
        max((len(re.sub("[^0-9]", "", cell).lstrip("0")) for cell in column), default=0)
        for column in mantissas
    ]


def _unit(text: str) -> tuple[str, float] | None:
    """Read a unit such as ``Volt``, ``(us)`` or ``mV``; None if it is none."""
    text = text.strip(" ()[]").lower()
    if text in _BASE:
        return _BASE[text], 1.0
    if text[:1] in _PREFIX and text[1:] in ("s", "sec", "v", "volt", "a"):
        return _BASE[text[1:]], _PREFIX[text[0]]
    return None


def _columns(above: list[list[str]], places: tuple[int, ...], digits: list[int]) -> list[Column]:
    titles = [""] * len(places)
    units: list[tuple[str, float] | None] = [None] * len(places)
    for cells in reversed(above[-8:]):
        here = [cells[place] if place < len(cells) else "" for place in places]
        if not any(here):
            continue
        # Keysight titles its channels 1 to 4; other numbers belong to settings of the scope.
        if any(_is_number(cell) and not re.fullmatch("[0-9]{1,2}", cell) for cell in here):
            break
        found = [_unit(cell) for cell in here]
        if any(found) and not any(titles) and not any(units) and _all_units(here, found):
            units = found
        else:
            titles = here
            break
    columns = []
    for place, title, unit, count in zip(places, titles, units, digits, strict=True):
        inside = _UNIT_IN_TITLE.fullmatch(title)
        if unit is None and inside and (unit := _unit(inside[2] or inside[3] or "")):
            title = inside[1]
        name, scale = unit or ("", 1.0)
        columns.append(Column(place + 1, title.lstrip("# "), name, scale, count))
    return columns


def _all_units(here: list[str], found: list[tuple[str, float] | None]) -> bool:
    """Whether a row is one of units; Rigol writes "Sequence" under its counter."""
    return all(
        unit or cell.lower() in ("", "sequence") for cell, unit in zip(here, found, strict=True)
    )


def _interval(above: list[list[str]], beside: list[list[str]]) -> float | None:
    """Find the time between two samples among the cells of the header [s]."""
    header = [*above, *beside]
    for row, cells in enumerate(header):
        below = header[row + 1] if row + 1 < len(header) else []
        for place, cell in enumerate(cells):
            key = cell.lower().lstrip("# ").replace("_", " ")
            kind = _INTERVAL.match(key) or _RATE.match(key)
            # The value stands in the same cell, in the next one, or in the one below.
            around = [re.sub("^[^:=]*", "", cell), *cells[place + 1 : place + 2], *below[place:]]
            for candidate in around[:3] if kind else []:
                value = _quantity(candidate)
                if value and kind:
                    return value if kind.re is _INTERVAL else 1 / value
    return None


def _quantity(text: str) -> float | None:
    """Read a positive number with a unit, such as ``4e-09``, ``4.0ns`` or ``CH1:250 MSa/s``."""
    found = _QUANTITY.fullmatch(text.strip())
    if not found:
        return None
    number, unit = found.groups()
    prefixed = len(unit) > 1 and unit.lower() not in _BASE
    scale = {**_PREFIX, "K": 1e3, "M": 1e6, "G": 1e9}.get(unit[0], 1.0) if prefixed else 1.0
    value = float(number.replace(",", ".")) * scale
    return value if 1e-13 < value < 1e13 else None
