"""The numbers of an I/O list: where points and boxes are, lengths of cables, update times."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from shipnet.design.iolist.cells import Cells
from shipnet.design.iolist.titles import COLUMNS, UNITS
from shipnet.tables import NUMBER

__all__ = ["RANGES", "read_numbers"]

_POSITION, _BOX = ("x_m", "y_m", "z_m"), ("box_x_m", "box_y_m", "box_z_m")

#: Legal values in the unit of the column, both ends included, but for an update time of 0. No ship
#: is a kilometre long, no cable of one ten.
RANGES: Mapping[str, tuple[float, float]] = {
    **dict.fromkeys((*_POSITION, *_BOX), (-1e3, 1e3)),
    **dict.fromkeys(("to_box_m", "home_run_m"), (0.0, 1e4)),
    "update_ms": (0.0, 3.6e6),
}

#: How far a cable may fall short of the straight way, as both are rounded [m].
_ROUNDED = 0.2

_Floats = NDArray[np.float64]


def read_numbers(cells: Cells, boxes: Sequence[str]) -> dict[str, _Floats]:
    r"""Return the numbers of an I/O list, and keep the faults that are found.

    Parameters
    ----------
    cells : Cells
        The list; it keeps the faults.
    boxes : sequence of str
        Name of the junction box of each point, ``""`` if it has none.

    Returns
    -------
    dict of str to ndarray, shape (n,)
        The columns of `RANGES` in their units; NaN where the list gives nothing. A box that has its
        position in one row has it in all.

    Examples
    --------
    >>> from shipnet.tables import parse_sheet
    >>> cells = Cells(parse_sheet("tag;type;home run [mm];update [s]\nLS-1;DI;12500,0;0,5"))
    >>> numbers = read_numbers(cells, [""])
    >>> numbers["home_run_m"].tolist(), numbers["update_ms"].tolist()
    ([12.5], [500.0])
    """
    comma = cells.sheet.separator in (";", "\t") and any(
        "," in cell for name in RANGES if name in cells.places for cell in cells[name]
    )
    numbers = {name: _numbers(cells, name, comma) for name in RANGES}
    _check_positions(cells)
    _check_boxes(cells, boxes, numbers)
    return numbers


def _numbers(cells: Cells, name: str, comma: bool) -> _Floats:
    low, high = RANGES[name]
    if name not in cells.places:
        return np.full(len(cells.rows), np.nan)
    # A list holds few different numbers; each is read once.
    known = {cell: _number(cell, comma) for cell in set(cells[name])}
    wrong = {cell for cell, value in known.items() if cell and value is None}
    bad = [row for row, cell in enumerate(cells[name]) if cell in wrong] if wrong else []
    values = np.array([known[cell] for cell in cells[name]], dtype=np.float64)
    scale = cells.scales[name]
    values = values if scale == 1 else values * scale
    outside = (values < low) | (values > high) | ((values == 0) & (name == "update_ms"))
    unit = next(u for u, s in UNITS[COLUMNS[name][0]].items() if s == scale)
    above = "above 0, up to " if name == "update_ms" else f"{low / scale:.7g}.."
    point = " with a decimal comma" if comma else ""
    expected = f"a number {above}{high / scale:.7g} {unit}{point}"
    cells.wrong([*bad, *np.flatnonzero(outside).tolist()], name, expected)
    return values


def _number(cell: str, comma: bool) -> float | None:
    """Return the number that a cell holds; None, which numpy takes for NaN, if it holds none."""
    if comma:
        # A point beside a decimal comma may part thousands: then the number is not certain.
        cell = cell.replace(",", ".") if "." not in cell else ""
    return float(cell) if NUMBER.fullmatch(cell) else None


def _check_positions(cells: Cells) -> None:
    have = np.column_stack([cells.given(name) for name in _POSITION])
    _check_partly(cells, _POSITION, have)
    for row in np.flatnonzero(~have.any(axis=1) & ~cells.given("home_run_m")).tolist():
        cells.fault(
            row, "",
            f" ({cells['tag'][row]}) has neither a position nor a length; expected x_m, y_m and "
            "z_m, or home_run_m",
        )  # fmt: skip


def _check_partly(cells: Cells, names: Sequence[str], have: NDArray[np.bool_]) -> None:
    for row in np.flatnonzero(have.any(axis=1) & ~have.all(axis=1)).tolist():
        missing = [name for name, one in zip(names, have[row], strict=True) if not one]
        titles = " and ".join(map(cells.title, missing))
        wanted = ", ".join(map(cells.title, names))
        cells.fault(row, missing[0], f", column {titles}: is empty; expected {wanted}, or none")


def _check_boxes(cells: Cells, boxes: Sequence[str], numbers: dict[str, _Floats]) -> None:
    """Check the boxes; all points of a box get the position that one of them names."""
    have = np.column_stack([cells.given(name) for name in _BOX])
    named = np.array([box != "" for box in boxes], dtype=bool)
    _check_partly(cells, _BOX, have)
    alone = (have.any(axis=1) | cells.given("to_box_m")) & ~named
    cells.wrong(np.flatnonzero(alone).tolist(), "box", "a name, as the list says where it is")
    places = np.column_stack([numbers[name] for name in _BOX])
    whole = np.isfinite(places).all(axis=1)
    first: dict[str, int] = {}
    for row in np.flatnonzero(named & whole).tolist():
        first.setdefault(boxes[row], row)
    same = np.array([first.get(box, -1) for box in boxes])
    stray = whole & (same >= 0) & (places != places[same]).any(axis=1)
    for row in np.flatnonzero(stray).tolist():
        where = ", ".join(f"{value:g}" for value in places[same[row]])
        cells.fault(
            row, _BOX[0],
            f", column {cells.title(_BOX[0])}: box {boxes[row]!r} stands elsewhere in row "
            f"{cells.rows[same[row]]}; expected it at {where} m",
        )  # fmt: skip
    fill = (same >= 0) & ~have.any(axis=1)
    for axis, name in enumerate(_BOX):
        numbers[name] = np.where(fill, places[same, axis], numbers[name])
    away = [numbers[own] - numbers[box] for own, box in zip(_POSITION, _BOX, strict=True)]
    straight = np.sqrt(np.square(away).sum(axis=0))
    for row in np.flatnonzero(numbers["to_box_m"] < straight - _ROUNDED).tolist():
        expected = f"the straight way of {straight[row]:.1f} m at least"
        cells.wrong([row], "to_box_m", expected)
