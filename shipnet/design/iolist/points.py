"""Rows of an I/O list made into points, or all that is wrong with them."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from shipnet.design.iolist.cells import Cells, clean
from shipnet.design.iolist.numbers import read_numbers
from shipnet.design.iolist.titles import COLUMNS
from shipnet.design.signals import KINDS, SIGNALS, find_signal, plain
from shipnet.errors import ArgumentError

if TYPE_CHECKING:
    from shipnet.tables import Sheet

__all__ = ["points_of"]

_KIND_WORDS = {
    "DI": ("digital input", "discrete input", "binary input"),
    "DO": ("digital output", "discrete output", "binary output"),
    "AI": ("analogue input", "analog input"),
    "AO": ("analogue output", "analog output"),
}
_KINDS = {plain(word): str(kind) for kind in KINDS for word in (kind, *_KIND_WORDS[kind])}
_CATEGORIES = {
    plain(word): name
    for number, name in enumerate(("I", "II", "III"), start=1)
    for word in (name, str(number), f"cat {name}", f"cat {number}", f"category {name}")
}

#: A signal, and what is wrong with the point by column.
_Found = tuple[str, list[tuple[str, str]]]


def points_of(sheet: Sheet) -> tuple[pd.DataFrame, tuple[str, ...]]:
    r"""Make points of the rows of a sheet.

    Parameters
    ----------
    sheet : Sheet
        Titles and rows.

    Returns
    -------
    points : pandas.DataFrame
        The columns of an I/O list, one row a point.
    remarks : tuple of str
        What was not used, and what was assumed.

    Raises
    ------
    InputError
        If the rows are no I/O list: every fault with its row, column and value, and what was
        expected.

    Examples
    --------
    >>> from shipnet.tables import parse_sheet
    >>> points, remarks = points_of(parse_sheet("tag,signal,home run\nLS-1,limit switch,40"))
    >>> points[["type", "signal", "conductors", "home_run_m"]].values.tolist()
    [['DI', 'contact', 2, 40.0]]
    >>> remarks
    ('1 point has no update time: that of the settings holds, 1000 ms unless they say other',)
    """
    cells = Cells(sheet)
    texts = {name: _text(cells, name) for name in ("tag", "system", "box")}
    _check_tags(cells, texts["tag"])
    signals = _signals(cells, _look_up(cells, "type", _KINDS, "DI, DO, AI or AO"))
    categories = _look_up(cells, "category", _CATEGORIES, "I, II, III or nothing")
    numbers = read_numbers(cells, texts["box"])
    cells.check()
    missing = np.isnan(numbers["update_ms"])
    if missing.any():
        count = int(missing.sum())
        which = f"{count} points have" if count > 1 else "1 point has"
        cells.remarks.append(
            f"{which} no update time: that of the settings holds, 1000 ms unless they say other"
        )
    columns: dict[str, object] = {
        **texts,
        "type": [SIGNALS[name].kind for name in signals],
        "signal": signals,
        "conductors": np.array([SIGNALS[name].conductors for name in signals], dtype=np.int64),
        **numbers,
        "category": categories,
        "note": _notes(cells),
    }
    return pd.DataFrame({name: columns[name] for name in COLUMNS}), tuple(cells.remarks)


def _text(cells: Cells, name: str) -> list[str]:
    texts = [clean(cell) for cell in cells[name]]
    # One look at all of them suffices where nothing is wrong.
    suspect = cells.sheet.odd or not "".join(texts).isprintable()
    bad = [
        row for row, text in enumerate(texts if suspect else ())
        if not text.isprintable() or cells.odd(row, name)
    ]  # fmt: skip
    cells.wrong(bad, name, "printable text")
    return texts


def _notes(cells: Cells) -> list[str]:
    """Return the remarks of each point, of all columns for them; what cannot be shown is left."""
    columns = [map(clean, cells.column(place)) for place in cells.places.get("note", [])]
    if not columns:
        return [""] * len(cells.rows)
    notes = ["; ".join(filter(None, own)) for own in zip(*columns, strict=True)]
    return [
        note if note.isprintable() else "".join(filter(str.isprintable, note)) for note in notes
    ]


def _check_tags(cells: Cells, tags: list[str]) -> None:
    first: dict[str, int] = {}
    cells.wrong([row for row, tag in enumerate(tags) if not tag], "tag", "a tag")
    for row, tag in enumerate(tags):
        before = first.setdefault(tag.casefold(), row)
        if before != row and tag:
            cells.fault(
                row, "tag",
                f", column {cells.title('tag')}: {tag!r} stands in row {cells.rows[before]} "
                "already; expected a tag of its own",
            )  # fmt: skip


def _look_up(cells: Cells, name: str, known: Mapping[str, str], expected: str) -> list[str]:
    """Return what the words of a column stand for; an empty cell stands for nothing."""
    found = {cell: known.get(plain(cell), "") for cell in set(cells[name])}
    rows = [row for row, cell in enumerate(cells[name]) if cell and not found[cell]]
    cells.wrong(rows, name, expected)
    return [found[cell] for cell in cells[name]]


def _signals(cells: Cells, kinds: list[str]) -> list[str]:
    """Return the signal of each point; a list has few different ones, each is looked up once."""
    known: dict[tuple[str, str, str, str], _Found] = {}
    signals = []
    points = zip(
        map(clean, cells["signal"]), cells["type"], kinds, cells["conductors"], strict=True
    )
    for row, point in enumerate(points):
        if point not in known:
            known[point] = _signal(*point)
        signal, faults = known[point]
        for column, text in faults:
            cells.fault(row, column, f", column {cells.title(column)}: {text}")
        signals.append(signal)
    return signals


def _signal(word: str, given: str, kind: str, count: str) -> _Found:
    """Return the signal that a point names, or that of its type if it names none."""
    whole = re.fullmatch(r"([0-9]{1,4})([.,]0+)?", count)
    conductors = int(whole[1]) if whole else None
    faults = []
    if count and not conductors:
        faults.append(("conductors", f"{count!r}; expected a whole number 1..9999"))
    if not word and not kind:
        # That a type is unknown has been said.
        none = [("signal", f"is empty; expected one of {', '.join(SIGNALS)}, or a type")]
        return "contact", faults + none * (not given)
    try:
        signal = find_signal(word or kind, kind, conductors)
    except ArgumentError as error:
        if word:
            return "contact", [*faults, ("signal", str(error))]
        alike = ", ".join(name for name, signal in SIGNALS.items() if signal.kind == kind)
        return "contact", [*faults, ("signal", f"is empty; expected one of {alike}")]
    own = SIGNALS[signal]
    if kind and own.kind != kind:
        faults.append(("type", f"{given!r}; expected {own.kind}, as the signal is {signal}"))
    if conductors and own.conductors != conductors:
        expected = f"expected {own.conductors}, as the signal is {signal}"
        faults.append(("conductors", f"{count!r}; {expected}"))
    return signal, faults
