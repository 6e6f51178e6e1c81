"""I/O lists: the points of a ship, from a CSV file or an Excel workbook.

    tag;system;type;signal;cores;x [m];y [m];z [m];JB;update [s];remarks
    BV01-OPN;Ballast valve;DI;limit switch;2;160,0;9,6;2,0;VJB3;1;open
    TE-101;Main engine;AI;Pt100 3-wire;;19;0,1;10,6;JB1;;jacket water

Columns may come in any order, under the names that lists commonly use (`iolist_titles.COLUMNS`),
below lines of a heading. `tag` and `signal` (or `type`) must be there, and for each point its
position or the length of its cable to the cabinet. Columns of other names are not used; the list
says so in its `remarks`. What is used is checked without mercy, and all faults are told at once.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from shipnet.design.iolist.points import points_of
from shipnet.design.iolist.titles import COLUMNS, is_titles
from shipnet.errors import ArgumentError
from shipnet.tables import frame_sheet, parse_sheet, read_sheet

if TYPE_CHECKING:
    from shipnet.tables import Sheet

__all__ = ["IoList", "from_table", "load_iolist", "parse_iolist", "save_iolist"]

_WHAT = "titles of an I/O list, which are at least tag, signal or type, and x, y, z or home run"


@dataclass(frozen=True, eq=False)
class IoList:
    r"""The points of a ship.

    Parameters
    ----------
    points : pandas.DataFrame
        One row a point, numbered from 0, with the columns ``tag``, ``system``, ``type`` (DI, DO,
        AI, AO), ``signal`` (key of `shipnet.design.signals.SIGNALS`), ``conductors``, ``x_m``,
        ``y_m``, ``z_m``, ``box`` (``""`` if none), ``box_x_m``, ``box_y_m``, ``box_z_m``,
        ``to_box_m``, ``home_run_m``, ``update_ms``, ``category`` (I, II, III of IACS UR E22, or
        ``""``) and ``note``. A number that the list does not give is NaN.
    source : str
        File or text that they come from.
    remarks : tuple of str
        What the reader did not use, and what it assumed.

    Raises
    ------
    ArgumentError
        If a column is missing, or rows are not numbered from 0. The contents are checked by
        `from_table`.

    Examples
    --------
    >>> iolist = parse_iolist("tag,type,x,y,z\nLS-1,DI,1,2,3")
    >>> print(iolist)
    1 point (1 DI) of text
    """

    points: pd.DataFrame
    source: str
    remarks: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Check the form of the table."""
        missing = [name for name in COLUMNS if name not in self.points.columns]
        if missing:
            raise ArgumentError(f"points have no column {', '.join(missing)}; use from_table")
        if not self.points.index.equals(pd.RangeIndex(len(self.points))):
            raise ArgumentError("the rows of points must be numbered from 0; use from_table")

    def __len__(self) -> int:
        """Return the number of points."""
        return len(self.points)

    def __str__(self) -> str:
        """Say how many points there are, and of what kind."""
        counts = self.points["type"].value_counts(sort=False)
        kinds = ", ".join(f"{number} {kind}" for kind, number in counts.items())
        s = "" if len(self) == 1 else "s"
        return f"{len(self)} point{s} ({kinds}) of {Path(self.source).name}"

    @property
    def places(self) -> NDArray[np.float64]:
        """Positions of the points [m], shape (n, 3); NaN where the list gives none."""
        return self.points[["x_m", "y_m", "z_m"]].to_numpy(dtype=np.float64)

    @property
    def box_places(self) -> NDArray[np.float64]:
        """Positions of their junction boxes [m], shape (n, 3); NaN where the list gives none."""
        return self.points[["box_x_m", "box_y_m", "box_z_m"]].to_numpy(dtype=np.float64)

    @property
    def located(self) -> NDArray[np.bool_]:
        """Whether the position of each point is known, shape (n,)."""
        return np.asarray(np.isfinite(self.places).all(axis=1))

    @property
    def summary(self) -> pd.DataFrame:
        """Number of points by system and type, with their conductors."""
        table = pd.crosstab(self.points["system"], self.points["type"])
        table["points"] = table.sum(axis=1)
        table["conductors"] = self.points.groupby("system")["conductors"].sum()
        table.columns.name = None
        return table


def load_iolist(path: str | PathLike[str], sheet: str | None = None) -> IoList:
    """Read an I/O list from a CSV file or an Excel workbook.

    Parameters
    ----------
    path : path
        CSV file separated by commas, semicolons or tabs; with semicolons or tabs a decimal comma
        is understood. UTF-8, UTF-16 with a mark, or Windows-1252. Or an Excel workbook
        (.xlsx).
    sheet : str, optional
        Name of the sheet of a workbook; if it is not given, the first that is not hidden and has
        the titles of an I/O list. Others that have them too are named in the remarks.

    Returns
    -------
    IoList
        The points in the order of their rows.

    Raises
    ------
    InputError
        If the file cannot be read, or is no I/O list: every fault with its row, column and value,
        and what was expected.

    Notes
    -----
    A signal that is not named is that of the type, a type that is not named that of the signal,
    and so with conductors. Where no update time is given, the planners take that of their settings,
    and the remarks say so. The position of a box needs to stand only once.

    Examples
    --------
    >>> from shipnet import datasets
    >>> iolist = load_iolist(datasets.path("synthetic_iolist_ship.csv"))
    >>> print(iolist)
    353 points (176 AI, 129 DI, 48 DO) of synthetic_iolist_ship.csv
    >>> int(iolist.points["conductors"].sum()), iolist.points["box"].nunique()
    (792, 11)
    """
    return _iolist(read_sheet(path, sheet, is_titles=is_titles, what=_WHAT))


def parse_iolist(text: str, source: str = "text") -> IoList:
    r"""Read an I/O list from text, as an editor holds it.

    Parameters
    ----------
    text : str
        What a CSV file for `load_iolist` holds.
    source : str, default "text"
        What to call it in an error.

    Returns
    -------
    IoList
        The points in the order of their rows.

    Raises
    ------
    InputError
        As `load_iolist`.

    Examples
    --------
    >>> parse_iolist("tag;type;home run [m]\nLS-1;DI;12,5\nLS-1;DI;4")
    Traceback (most recent call last):
        ...
    shipnet.errors.InputError: text: row 3, column tag: 'LS-1' stands in row 2 already; ...
    """
    return _iolist(parse_sheet(text, source, is_titles=is_titles, what=_WHAT))


def from_table(table: pd.DataFrame, source: str = "table") -> IoList:
    """Make an I/O list of a table, checked as a file would be.

    Parameters
    ----------
    table : pandas.DataFrame
        Columns under the names that a file may use, in any order; a missing value is an empty
        cell.
    source : str, default "table"
        What to call it in an error.

    Returns
    -------
    IoList
        The points in the order of their rows.

    Raises
    ------
    InputError
        If the table is no I/O list: every fault with its row (the first is 0), column and value,
        and what was expected.

    Examples
    --------
    >>> table = pd.DataFrame({"tag": ["a", "b"], "signal": "RTD 3-wire", "length": [10, 12.5]})
    >>> from_table(table).points["home_run_m"].tolist()
    [10.0, 12.5]
    """
    return _iolist(frame_sheet(table, source))


def save_iolist(iolist: IoList, path: str | PathLike[str]) -> None:
    r"""Write an I/O list as a CSV file, from which `load_iolist` makes the same points.

    Parameters
    ----------
    iolist : IoList
        What to write.
    path : path
        File, in an existing folder; it is overwritten.

    Returns
    -------
    None
        Numbers are written with all digits that tell them apart. Text that a spreadsheet would
        take for a formula gets an apostrophe in front, which `load_iolist` takes away.

    Examples
    --------
    >>> import tempfile
    >>> iolist = parse_iolist("tag,type,home_run\n=LS-1,DI,12.5")
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     save_iolist(iolist, Path(folder) / "list.csv")
    ...     load_iolist(Path(folder) / "list.csv").points.equals(iolist.points)
    True
    """
    table = iolist.points[list(COLUMNS)].copy()
    for name in ("tag", "system", "box", "note"):
        table[name] = [f"'{text}" if re.match(r"'*[=+\-@]", text) else text for text in table[name]]
    with Path(path).open("w", newline="", encoding="utf-8") as stream:
        table.to_csv(stream, index=False, lineterminator="\n")


def _iolist(sheet: Sheet) -> IoList:
    points, remarks = points_of(sheet)
    return IoList(points, sheet.source, remarks)
