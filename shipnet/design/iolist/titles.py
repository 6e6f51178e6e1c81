"""What the columns of an I/O list are called, on paper and here."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from shipnet.design.signals import plain

__all__ = ["COLUMNS", "UNITS", "Column", "column_of", "is_titles"]

#: Columns of a list of points, in their order: what they hold ("text", or a quantity whose unit
#: the name ends with), and what lists call them. Case, blanks and punctuation do not matter.
COLUMNS: Mapping[str, tuple[str, tuple[str, ...]]] = {
    "tag": ("text", ("tag no", "tag nr", "tag number", "tag name", "tag id", "io tag", "point",
                     "point id", "point name", "instrument", "instrument tag", "instrument no",
                     "id")),
    "system": ("text", ("sys", "system name", "ship system", "subsystem", "plant")),
    "type": ("text", ("io", "io type", "io kind", "point type", "channel type", "kind")),
    "signal": ("text", ("signal type", "signal kind", "sensor", "sensor type", "connection")),
    "conductors": ("whole", ("cores", "wires", "strands", "no of cores", "no of wires",
                             "number of cores", "number of wires", "number of conductors",
                             "no of conductors", "core count")),
    "x_m": ("length", ("pos x", "position x", "deck x", "x pos", "x position", "x coord",
                       "x coordinate", "coordinate x")),
    "y_m": ("length", ("pos y", "position y", "deck y", "y pos", "y position", "y coord",
                       "y coordinate", "coordinate y")),
    "z_m": ("length", ("pos z", "position z", "deck z", "z pos", "z position", "z coord",
                       "z coordinate", "coordinate z", "height", "elevation")),
    "box": ("text", ("jb", "junction box", "jb no", "box no", "jb tag", "terminal box",
                     "junction box no")),
    "box_x_m": ("length", ("jb x", "junction box x", "x box", "x jb", "x of box")),
    "box_y_m": ("length", ("jb y", "junction box y", "y box", "y jb", "y of box")),
    "box_z_m": ("length", ("jb z", "junction box z", "z box", "z jb", "z of box")),
    "to_box_m": ("length", ("len to jb", "len to box", "length to jb", "length to box",
                            "length to junction box", "cable to box", "cable to jb",
                            "distance to box", "distance to jb", "to jb", "drop", "drop length")),
    "home_run_m": ("length", ("len home run", "length home run", "home run length", "length",
                              "cable length", "cable length to cabinet", "length to cabinet",
                              "distance to cabinet")),
    "update_ms": ("time", ("update time", "update period", "update interval", "update need",
                           "scan", "scan time", "cycle", "cycle time", "sampling time",
                           "refresh time")),
    "category": ("text", ("cat", "e22 category", "system category", "category e22")),
    "note": ("text", ("notes", "remark", "remarks", "comment", "comments", "description",
                      "service")),
}  # fmt: skip

#: Units that a title may name, each as a multiple of that of the column.
UNITS: Mapping[str, Mapping[str, float]] = {
    "length": {"m": 1.0, "mm": 1e-3, "cm": 1e-2},
    "time": {"ms": 1.0, "s": 1e3},
}


class Column(NamedTuple):
    """What a title means: the name of the column, and the multiple of its unit."""

    name: str
    scale: float = 1.0


def _titles() -> dict[str, str]:
    titles: dict[str, str] = {}
    for name, (holds, others) in COLUMNS.items():
        base = name.rpartition("_")[0] if holds in UNITS else name
        titles |= {plain(title): name for title in (base, *others)}
    return titles


_TITLES = _titles()


def column_of(title: str) -> Column | None:
    """Return the column that a title means.

    Parameters
    ----------
    title : str
        Title as the list has it, with or without a unit behind it.

    Returns
    -------
    Column or None
        None for a title that is none of `COLUMNS`.

    Examples
    --------
    >>> column_of("Tag No."), column_of("Update [s]"), column_of("alarm limit")
    (Column(name='tag', scale=1.0), Column(name='update_ms', scale=1000.0), None)
    """
    name = _TITLES.get(plain(title))
    if name is not None:
        return Column(name)
    words = re.findall(r"[^\W_]+", title.casefold())
    name = _TITLES.get("".join(words[:-1])) if words else None
    units = UNITS.get(COLUMNS[name][0], {}) if name is not None else {}
    return Column(name, units[words[-1]]) if name is not None and words[-1] in units else None


def is_titles(cells: Sequence[str]) -> bool:
    """Say whether cells are the titles of an I/O list.

    Parameters
    ----------
    cells : sequence of str
        Cells of a row.

    Returns
    -------
    bool
        Whether two of them at least are known, and one of these says what a point is.

    Examples
    --------
    >>> is_titles(["Tag No.", "", "I/O type"]), is_titles(["LS-1", "DI", "contact"])
    (True, False)
    """
    known = {column.name for column in map(column_of, cells) if column is not None}
    return len(known) > 1 and not known.isdisjoint({"tag", "type", "signal"})
