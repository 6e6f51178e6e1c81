"""Cable trays of a ship as a graph: places where they meet, and the ways along them.

    kind,name,x_m,y_m,z_m,from,to
    cabinet,engine control room,26,6,14,,
    node,P20,20,8,10,,
    node,P60,60,8,10,,
    tray,port 20-60,,,,P20,P60

Trays meet only at nodes, and run straight between them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from math import isfinite
from os import PathLike

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from shipnet.errors import ArgumentError, InputError
from shipnet.tables import NUMBER, Sheet, parse_sheet, read_sheet

__all__ = ["Tray", "Trays", "load_trays", "parse_trays"]

#: A place on board [m]: x from aft to fore, y to port, z up, from wherever the list counts.
Place = tuple[float, float, float]

_COLUMNS = ("kind", "name", "x_m", "y_m", "z_m", "from", "to")
_KINDS = ("cabinet", "node", "tray")

#: Most nodes: the ways between all pairs are kept.
_MOST_NODES = 2000


@dataclass(frozen=True, slots=True)
class Tray:
    """A straight tray between two nodes.

    Parameters
    ----------
    name : str
        What it is called; the names tell whether two routes are apart.
    a, b : str
        Nodes at its ends.
    """

    name: str
    a: str
    b: str


@dataclass(frozen=True, eq=False)
class Trays:
    """The trays of a ship.

    Parameters
    ----------
    nodes : mapping of str to Place
        Places where trays end and meet [m].
    trays : tuple of Tray
        One or more, of different names, each between two nodes apart.
    cabinets : mapping of str to Place, optional
        Cabinets that stand in the same file [m].

    Raises
    ------
    ArgumentError
        If trays are missing, stand twice, name unknown nodes or have no length, if a coordinate is
        not finite, or if the trays are not all joined; the message says all that is wrong.

    Examples
    --------
    >>> trays = Trays({"A": (0, 0, 0), "B": (3, 4, 0)}, (Tray("main", "A", "B"),))
    >>> trays.lengths.tolist()
    [5.0]
    """

    nodes: Mapping[str, Place]
    trays: tuple[Tray, ...]
    cabinets: Mapping[str, Place] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Check that they are one graph."""
        faults = tray_faults(self.nodes, self.trays)
        if faults:
            raise ArgumentError("; ".join(fault for _, fault in faults))

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the trays in their order."""
        return tuple(tray.name for tray in self.trays)

    @cached_property
    def ends(self) -> NDArray[np.intp]:
        """Numbers of the nodes at the ends of each tray, shape (m, 2)."""
        number = {name: n for n, name in enumerate(self.nodes)}
        return np.array([(number[tray.a], number[tray.b]) for tray in self.trays], dtype=np.intp)

    @cached_property
    def places(self) -> NDArray[np.float64]:
        """Places of the nodes [m], shape (n, 3)."""
        return np.array(list(self.nodes.values()), dtype=np.float64)

    @cached_property
    def lengths(self) -> NDArray[np.float64]:
        """Lengths of the trays [m], shape (m,)."""
        a, b = self.places[self.ends.T]
        return np.asarray(np.linalg.norm(b - a, axis=1))


def tray_faults(nodes: Mapping[str, Place], trays: tuple[Tray, ...]) -> list[tuple[str, str]]:
    """Return all that keeps nodes and trays from being one graph, each with the name concerned.

    Parameters
    ----------
    nodes : mapping of str to Place
        Nodes.
    trays : tuple of Tray
        Trays.

    Returns
    -------
    list of (str, str)
        Name of the node or tray, or ``""``, and what is wrong.

    Examples
    --------
    >>> tray_faults({"A": (0, 0, 0)}, (Tray("main", "A", "B"),))
    [('main', "tray 'main' ends at 'B', which is no node")]
    """
    faults = [
        (name, f"node {name!r} is at {place!r}; expected three finite numbers")
        for name, place in nodes.items()
        if len(place) != 3 or not all(map(isfinite, place))
    ]
    seen: set[str] = set()
    for tray in trays:
        unknown = [end for end in (tray.a, tray.b) if end not in nodes]
        text = f"tray {tray.name!r} ends at {{!r}}, which is no node"
        faults += [(tray.name, text.format(end)) for end in unknown]
        if tray.name in seen:
            faults.append((tray.name, f"tray {tray.name!r} stands twice"))
        if not unknown and tuple(nodes[tray.a]) == tuple(nodes[tray.b]):
            faults.append((tray.name, f"tray {tray.name!r} has no length"))
        seen.add(tray.name)
    if not trays:
        faults.append(("", "there is no tray"))
    if len(nodes) > _MOST_NODES:
        faults.append(("", f"there are {len(nodes)} nodes; expected {_MOST_NODES} at most"))
    if not faults:
        number = {name: n for n, name in enumerate(nodes)}
        ends = np.array([(number[tray.a], number[tray.b]) for tray in trays])
        graph = csr_array((np.ones(len(ends)), ends.T), shape=(len(nodes), len(nodes)))
        parts, part = connected_components(graph, directed=False)
        if parts > 1:
            largest = np.bincount(part).argmax()
            apart = [name for name, own in zip(nodes, part, strict=True) if own != largest]
            faults.append((apart[0], f"no tray joins {', '.join(apart)} to the rest"))
    return faults


def load_trays(path: str | PathLike[str]) -> Trays:
    """Read trays from a CSV file or an Excel workbook.

    Parameters
    ----------
    path : path
        File with the columns kind (node, tray or cabinet), name, x_m, y_m, z_m (of a node or a
        cabinet), from, to (nodes of a tray); ``note`` is for remarks, which are not kept.

    Returns
    -------
    Trays
        Nodes, trays and cabinets in the order of their rows.

    Raises
    ------
    InputError
        If the file cannot be read, or does not describe trays: every fault with its row, column
        and value, and what was expected.

    Examples
    --------
    >>> from shipnet import datasets
    >>> trays = load_trays(datasets.path("synthetic_trays_ship.csv"))
    >>> len(trays.nodes), len(trays.trays), list(trays.cabinets)
    (30, 41, ['engine control room', 'ballast control'])
    """
    return _trays(read_sheet(path))


def parse_trays(text: str, source: str = "text") -> Trays:
    """Read trays from text, as an editor holds it.

    Parameters
    ----------
    text : str
        What a CSV file for `load_trays` holds.
    source : str, default "text"
        What to call it in an error.

    Returns
    -------
    Trays
        Nodes, trays and cabinets in the order of their rows.

    Raises
    ------
    InputError
        As `load_trays`.

    Examples
    --------
    >>> trays = parse_trays('''kind;name;x_m;y_m;z_m;from;to
    ... node;A;0;0;0
    ... node;B;10,5;0;0
    ... tray;main;;;;A;B''')
    >>> trays.lengths.tolist()
    [10.5]
    """
    return _trays(parse_sheet(text, source))


def _trays(sheet: Sheet) -> Trays:
    titles = [title.lower() for title in sheet.titles]
    faults = [
        f"row {sheet.top}: title {title!r} is unknown; expected {', '.join(_COLUMNS)}, note"
        for title in titles
        if title not in (*_COLUMNS, "note")
    ]
    faults += [f"row {sheet.top}: no column {name}" for name in _COLUMNS if name not in titles]
    if len(set(titles)) < len(titles):
        faults.append(f"row {sheet.top}: a title stands twice")
    if faults:
        raise InputError(sheet.source, *faults)
    comma = sheet.separator in (";", "\t") and any("," in c for _, row in sheet.rows for c in row)
    places: dict[str, dict[str, Place]] = {"node": {}, "cabinet": {}}
    trays: list[Tray] = []
    rows: dict[str, int] = {}
    for number, row in sheet.rows:
        cells = dict.fromkeys(_COLUMNS, "") | dict(zip(titles, row, strict=False))
        kind, name = cells["kind"].lower(), cells["name"]
        wrong = []
        if any(row[len(titles) :]):
            wrong.append(f" has {len(row)} cells; expected {len(titles)}")
        if kind not in _KINDS:
            wrong.append(f", column kind: {cells['kind']!r}; expected {', '.join(_KINDS)}")
        if not name or not name.isprintable():
            wrong.append(f", column name: {name!r}; expected printable text")
        if kind == "tray":
            wrong += [f", column {end}: is empty; expected a node" for end in ("from", "to")
                      if not cells[end]]  # fmt: skip
        elif name in places.get(kind, {}):
            wrong.append(f": {kind} {name!r} stands twice")
        place = [_metres(cells[axis], comma) for axis in ("x_m", "y_m", "z_m")]
        if kind in places:
            wrong += [
                f", column {axis}: {cells[axis]!r}; expected a number -1000..1000 m"
                for axis, value in zip(("x_m", "y_m", "z_m"), place, strict=True)
                if value is None
            ]
        faults += [f"row {number}{fault}" for fault in wrong]
        if wrong:
            continue
        if kind == "tray":
            rows[name] = number
            trays.append(Tray(name, cells["from"], cells["to"]))
        else:
            x, y, z = (value or 0.0 for value in place)
            places[kind][name] = (x, y, z)
    if not faults:
        found = tray_faults(places["node"], tuple(trays))
        faults = [f"row {rows[name]}: {text}" if name in rows else text for name, text in found]
    if faults:
        raise InputError(sheet.source, *faults)
    return Trays(places["node"], tuple(trays), places["cabinet"])


def _metres(cell: str, comma: bool) -> float | None:
    text = cell.replace(",", ".") if comma and "." not in cell else cell
    if not NUMBER.fullmatch(text) or (comma and "." in cell):
        return None
    value = float(text)
    return value if -1e3 <= value <= 1e3 else None
