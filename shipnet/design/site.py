"""The ship for cables: a cabinet, trays, and the routes along them."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial
from math import isfinite, prod
from os import PathLike
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components, dijkstra
from scipy.spatial.distance import cdist

from shipnet import style
from shipnet.arguments import checked
from shipnet.arrays import Floats, Indices
from shipnet.design.plot import draw_cables
from shipnet.design.points import PointTable
from shipnet.design.settings import Settings
from shipnet.errors import ArgumentError, InputError
from shipnet.fields import number, part, record
from shipnet.lazy import Axes, pd
from shipnet.tables import NUMBER, Sheet, in_order, parse_sheet, read_sheet, titled

# Cable trays as a graph --------------------------------------------------------------------------

#: A position on board [m]: x forward, y to port, z up, from the origin of the list.
Place = tuple[float, float, float]

_COLUMNS = ("kind", "name", "x_m", "y_m", "z_m", "from", "to")
_KINDS = ("cabinet", "node", "tray")

#: Most nodes, because the routes between all pairs are kept.
_MOST_NODES = 2000


@dataclass(frozen=True, slots=True)
class Tray:
    """A straight tray between two nodes."""

    name: str
    a: str
    b: str


@checked
@dataclass(frozen=True)
class Trays:
    r"""Cable trays of a ship as a graph, with named cabinets.

    `Trays.read` reads a file with the columns kind (cabinet, node or tray), name, x_m, y_m, z_m,
    from and to.

    Parameters
    ----------
    nodes : mapping of str to tuple of float
        Positions where trays meet, x, y, z [m].
    trays : tuple of Tray
        Straight trays, each from node to node.
    cabinets : mapping of str to tuple of float, optional
        Positions where cables may end [m].

    Raises
    ------
    ArgumentError
        If they are not one connected graph; lists all faults.

    Examples
    --------
    >>> trays = Trays.parse("kind,name,x_m,y_m,z_m,from,to\nnode,A,0,0,0,,\nnode,B,9,0,0,,\n"
    ...                     "tray,T1,,,,A,B\ncabinet,CCR,0,0,2,,\n")
    >>> trays.names, trays.cabinets
    (('T1',), {'CCR': (0.0, 0.0, 2.0)})
    """

    nodes: Mapping[str, Place]
    trays: tuple[Tray, ...]
    cabinets: Mapping[str, Place] = field(default_factory=dict, compare=False)

    def __post_init__(self) -> None:
        if faults := tray_faults(self.nodes, self.trays):
            said = "; ".join(fault for _, fault in faults)
            raise ArgumentError(f"nodes and trays are not a graph: {said}")

    @classmethod
    def read(cls, path: str | PathLike[str]) -> Trays:
        """Read trays from a CSV file or an Excel workbook."""
        return _trays(read_sheet(path))

    @classmethod
    def parse(cls, text: str, source: str = "text") -> Trays:
        """Read trays from text, as an editor holds it."""
        return _trays(parse_sheet(text, source))

    def table(self) -> pd.DataFrame:
        """Return one row per tray: from, to, length_m."""
        names = [(tray.name, tray.a, tray.b) for tray in self.trays]
        table = pd.DataFrame(names, columns=["tray", "from", "to"]).set_index("tray")
        return table.assign(length_m=self.lengths)

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the trays from above, with nodes and named cabinets."""
        ax = style.axes(ax)
        a, b = self.places[self.ends.T][:, :, :2]
        draw_cables(ax, a, b, "C0", width=1.5)
        ax.plot(*self.places[:, :2].T, "o", color="C0", markersize=4, label="node")
        for place, (name, (x, y, _)) in enumerate(self.cabinets.items()):
            ax.plot(x, y, "D", color="C3", label="" if place else "cabinet")
            ax.annotate(name, (x, y), (5, 5), textcoords="offset points")
        ax.set(xlabel="x [m]", ylabel="y [m]")
        ax.margins(0.05)
        style.legend(ax)
        return ax

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the trays in order."""
        return tuple(tray.name for tray in self.trays)

    @cached_property
    def ends(self) -> Indices:
        """Numbers of the nodes at the ends of each tray, shape (m, 2)."""
        number = {name: n for n, name in enumerate(self.nodes)}
        return np.array([(number[tray.a], number[tray.b]) for tray in self.trays], dtype=np.intp)

    @cached_property
    def places(self) -> Floats:
        """Positions of the nodes [m], shape (n, 3)."""
        return np.array(list(self.nodes.values()), dtype=np.float64)

    @cached_property
    def lengths(self) -> Floats:
        """Lengths of the trays [m], shape (m,)."""
        a, b = self.places[self.ends.T]
        return np.asarray(np.linalg.norm(b - a, axis=1))


def tray_faults(nodes: Mapping[str, Place], trays: tuple[Tray, ...]) -> list[tuple[str, str]]:
    """Return why nodes and trays are not one graph, each reason with the name concerned."""
    faults = [
        (name, f"node {name!r} is at {place!r}; expected three finite numbers")
        for name, place in nodes.items()
        if len(place) != 3 or not all(map(isfinite, place))
    ]
    seen: set[str] = set()
    for tray in trays:
        unknown = [end for end in (tray.a, tray.b) if end not in nodes]
        text = f"tray {tray.name!r} ends at {{!r}}, which is not a node"
        faults += [(tray.name, text.format(end)) for end in unknown]
        if tray.name in seen:
            faults.append((tray.name, f"tray {tray.name!r} appears twice"))
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


def _trays(sheet: Sheet) -> Trays:
    rows, faults = titled(sheet, {**dict.fromkeys(_COLUMNS), "note": ""})
    comma = sheet.separator in (";", "\t") and any("," in c for _, row in sheet.rows for c in row)
    places: dict[str, dict[str, Place]] = {"node": {}, "cabinet": {}}
    trays: list[Tray] = []
    lines: dict[str, int] = {}
    for line, cells in rows:
        kind, name = cells["kind"].lower(), cells["name"]
        wrong = []
        if kind not in _KINDS:
            wrong.append(f", column kind: {cells['kind']!r}; expected {', '.join(_KINDS)}")
        if not name or not name.isprintable():
            wrong.append(f", column name: {name!r}; expected printable text")
        if kind == "tray":
            wrong += [f", column {end}: is empty; expected a node" for end in ("from", "to")
                      if not cells[end]]  # fmt: skip
        elif name in places.get(kind, {}):
            wrong.append(f": {kind} {name!r} appears twice")
        place = {axis: _metres(cells[axis], comma) for axis in ("x_m", "y_m", "z_m")}
        if kind in places:
            wrong += [
                f", column {axis}: {cells[axis]!r}; expected a number -1000..1000 m"
                for axis, value in place.items()
                if value is None
            ]
        faults += [(line, fault) for fault in wrong]
        if wrong:
            continue
        if kind == "tray":
            lines[name] = line
            trays.append(Tray(name, cells["from"], cells["to"]))
        else:
            x, y, z = (value or 0.0 for value in place.values())
            places[kind][name] = (x, y, z)
    said = in_order(faults)
    if not said:
        found = tray_faults(places["node"], tuple(trays))
        said = [f"row {lines[name]}: {text}" if name in lines else text for name, text in found]
    if said:
        raise InputError(sheet.source, *said)
    return Trays(places["node"], tuple(trays), places["cabinet"])


def _metres(cell: str, comma: bool) -> float | None:
    if comma:
        cell = "" if "." in cell else cell.replace(",", ".")
    return float(cell) if NUMBER.fullmatch(cell) and abs(float(cell)) <= 1e3 else None


# The shortest routes along trays between positions beside them -----------------------------------

#: Factor on the length of a tray to avoid, so that any detour is shorter.
_AVOIDED = 1e6

#: Distances to trays that are computed at once.
_AT_ONCE = 2**21


class _Entry(NamedTuple):
    """Where positions reach the trays: which tray, how far along it and how far from it [m]."""

    tray: Indices
    along: Floats
    off: Floats


class _Join(NamedTuple):
    """The nodes where routes leave the first tray and reach the last, and the lengths [m]."""

    first: Indices
    last: Indices
    out: Floats
    into: Floats
    length: Floats


class TrayRoutes:
    """The shortest routes between all positions, for one choice of trays to avoid."""

    def __init__(self, trays: Trays, avoid: frozenset[str]) -> None:
        if wrong := avoid.difference(trays.names):
            unknown = ", ".join(map(repr, sorted(wrong)))
            raise ArgumentError(f"avoid names {unknown}; the trays are {', '.join(trays.names)}")
        self.trays = trays
        self._weight = np.where(np.isin(trays.names, list(avoid)), _AVOIDED, 1.0)
        size = len(trays.nodes)
        cost, metres = np.full((2, size, size), np.inf)
        self._tray = np.full((size, size), -1, dtype=np.intp)
        counted = trays.lengths * self._weight
        # Of several trays between two nodes, the cheapest is written last.
        for n in np.argsort(-counted, kind="stable"):
            for a, b in (trays.ends[n], trays.ends[n][::-1]):
                cost[a, b], metres[a, b], self._tray[a, b] = counted[n], trays.lengths[n], n
        a, b = np.nonzero(np.isfinite(cost))
        graph = csr_array((cost[a, b], (a, b)), shape=(size, size))
        self._cost, before = dijkstra(graph, return_predecessors=True)
        self._before = before.astype(np.intp)
        # Costs are not lengths: metres are summed along the routes found, nearest first.
        self._length = np.zeros((size, size))
        rows = np.arange(size)
        for node in np.argsort(self._cost, axis=1, kind="stable").T[1:]:
            last = self._before[rows, node]
            self._length[rows, node] = self._length[rows, last] + metres[last, node]

    def lengths(self, a: Floats, b: Floats) -> Floats:
        """Return the lengths of the routes between positions."""
        start, end, direct, shape = self._both(a, b)
        off = start.off + end.off
        length = np.where(direct <= off, direct, off + self._join(start, end).length)
        return np.asarray(length.reshape(shape))

    def names(self, a: Floats, b: Floats) -> list[tuple[str, ...]]:
        """Return the names of the trays between positions."""
        start, end, direct, _ = self._both(a, b)
        join = self._join(start, end)
        # A tray that is only touched at its end is not used.
        trays = np.where(join.out > 0, start.tray, -1), np.where(join.into > 0, end.tray, -1)
        keys = np.column_stack([trays[0], join.first, join.last, trays[1]])
        keys[start.off + end.off >= direct] = -1
        different, place = np.unique(keys, axis=0, return_inverse=True)
        ways = [self._way(*key) for key in different.tolist()]
        return [ways[n] for n in place.ravel().tolist()]

    def _way(self, start: int, first: int, last: int, end: int) -> tuple[str, ...]:
        """Return the names of the trays from the entry on one tray to that on another."""
        path = [end]
        while last != first:
            before = int(self._before[first, last])
            path.append(int(self._tray[before, last]))
            last = before
        path.append(start)
        numbers = [n for n in reversed(path) if n >= 0]
        return tuple(dict.fromkeys(self.trays.names[n] for n in numbers))

    def _both(self, a: Floats, b: Floats) -> tuple[_Entry, _Entry, Floats, tuple[int, ...]]:
        """Return the entries of positions and their direct distance, flat, and the shape."""
        direct = np.abs(a - b).sum(axis=-1)
        start, end = (
            _Entry._make(np.broadcast_to(column.reshape(one.shape[:-1]), direct.shape).ravel()
                         for column in self._enter(one.reshape(-1, 3)))
            for one in (a, b)
        )  # fmt: skip
        return start, end, direct.ravel(), direct.shape

    def _enter(self, points: Floats) -> _Entry:
        """Return where positions reach the nearest tray, the first of equally near ones."""
        a, b = self.trays.places[self.trays.ends.T]
        span, square = b - a, self.trays.lengths**2
        tray = np.zeros(len(points), dtype=np.intp)
        along, off = np.full((2, len(points)), np.nan)
        known = np.flatnonzero(np.isfinite(points).all(axis=1))
        step = max(1, _AT_ONCE // len(span))
        for rows in (known[k : k + step] for k in range(0, len(known), step)):
            own = points[rows]
            # The point of the tray nearest to each position, between its ends.
            share = ((own @ span.T - (a * span).sum(axis=1)) / square).clip(0, 1)
            far = np.zeros_like(share)
            for axis in range(3):
                far += np.abs(own[:, axis, None] - a[:, axis] - share * span[:, axis])
            best, each = far.argmin(axis=1), np.arange(len(rows))
            tray[rows], off[rows] = best, far[each, best]
            along[rows] = share[each, best] * self.trays.lengths[best]
        return _Entry(tray, along, off)

    def _join(self, start: _Entry, end: _Entry) -> _Join:
        """Return the cheapest route, over either end of either tray or along one tray."""
        ends, lengths, weight = self.trays.ends, self.trays.lengths, self._weight
        between = np.abs(start.along - end.along)
        best = np.where(start.tray == end.tray, weight[start.tray] * between, np.inf)
        none = np.full(len(best), -1, dtype=np.intp)
        join = _Join(none, none, between, between, between)
        for s in (0, 1):
            out = start.along if s == 0 else lengths[start.tray] - start.along
            a = ends[start.tray, s]
            for e in (0, 1):
                into = end.along if e == 0 else lengths[end.tray] - end.along
                b = ends[end.tray, e]
                cost = weight[start.tray] * out + self._cost[a, b] + weight[end.tray] * into
                other = _Join(a, b, out, into, out + self._length[a, b] + into)
                better = cost < best
                best = np.where(better, cost, best)
                join = _Join._make(map(partial(np.where, better), other, join))
        return join


# The site: the cabinet, and routes along trays or square to the ship -----------------------------


@record(eq=False)
class Site:
    """The position of the cabinet, the trays, and the allowances of cables."""

    cabinet: Place
    trays: Trays | None = part(Trays, default=None, optional=True)
    detour: float = number(1, 10, "", "Laid length per route", default=1.15)
    tails: float = number(0, 1000, "m", "Both ends of a cable together", default=5.0)

    def __post_init__(self) -> None:
        cabinet = _places("cabinet", self.cabinet)
        if cabinet.ndim != 1 or np.isnan(cabinet).any():
            raise ArgumentError(f"cabinet is {self.cabinet!r}; it must be three finite numbers")
        object.__setattr__(self, "cabinet", tuple(cabinet.tolist()))

    def length(self, route: ArrayLike) -> Floats:
        """Return the length of cable to lay for a route [m]."""
        return self.detour * np.asarray(route, dtype=float) + self.tails

    def route(self, a: ArrayLike, b: ArrayLike, *, avoid: Collection[str] = ()) -> Floats:
        """Return the length of the route between positions [m]."""
        a, b, routes = self._between(a, b, avoid)
        return np.asarray(np.abs(a - b).sum(axis=-1)) if routes is None else routes.lengths(a, b)

    def ways(
        self, a: ArrayLike, b: ArrayLike, *, avoid: Collection[str] = ()
    ) -> list[tuple[str, ...]]:
        """Return the trays between each pair of positions."""
        a, b, routes = self._between(a, b, avoid)
        if routes is None:
            return [()] * prod(np.broadcast_shapes(a.shape, b.shape)[:-1])
        return routes.names(a, b)

    def _between(
        self, a: ArrayLike, b: ArrayLike, avoid: Collection[str]
    ) -> tuple[Floats, Floats, TrayRoutes | None]:
        """Return both ends as arrays that fit, and the routes of the trays, if any."""
        a, b = _places("a", a), _places("b", b)
        try:
            np.broadcast_shapes(a.shape, b.shape)
        except ValueError:
            raise ArgumentError(
                f"a has shape {a.shape}, which does not fit {b.shape} of b"
            ) from None
        if self.trays is None and avoid:
            raise ArgumentError(f"avoid names {avoid!r}; the site has no trays")
        names = frozenset([avoid] if isinstance(avoid, str) else avoid)
        if self.trays is not None and names not in self._known:
            self._known[names] = TrayRoutes(self.trays, names)
        return a, b, self._known.get(names)

    @cached_property
    def _known(self) -> dict[frozenset[str], TrayRoutes]:
        return {}


def _places(name: str, given: ArrayLike) -> Floats:
    """Return positions as an array (..., 3), or raise."""
    try:
        places = np.asarray(given, dtype=np.float64)
    except (TypeError, ValueError):
        places = np.zeros(0)
    if places.shape[-1:] != (3,):
        raise ArgumentError(f"{name} is {given!r}; it must be an array of shape (..., 3)")
    if np.isinf(places).any():
        raise ArgumentError(f"{name} holds an infinite coordinate; it must be finite, or NaN")
    return places


# The position of the cabinet, inferred from the lengths of home runs -----------------------------

#: Fewest points with position and length: three coordinates and one to check them.
_FEWEST = 4

#: Positions per axis in the first search and in finer ones, and how many each search keeps.
_FIRST, _NEXT, _KEPT = 15, 5, 25

#: Reach of the last search, and how far a length may be rounded [m].
_CLOSE, _ROUNDED = 0.02, 0.2


#: A position [m], the name of a cabinet in the trays, or None to infer it from the list's lengths.
Where: TypeAlias = "tuple[float, float, float] | Sequence[float] | str | Site | None"


class Found(NamedTuple):
    """The position of a cabinet as lengths suggest it."""

    place: tuple[float, float, float]
    misfit: float
    points: int
    settled: bool

    def __str__(self) -> str:
        x, y, z = self.place
        said = (
            f"the cabinet is assumed at {x:g}, {y:g}, {z:g} m, from the cable lengths of "
            f"{self.points} points, half of which it fits within {max(self.misfit, 0.1):.1f} m"
        )
        other = "; other positions fit as well: give the right one if you know it"
        return said if self.settled else said + other


def find_cabinet(iolist: PointTable, *, detour: float = 1.15, tails: float = 5.0) -> Found:
    """Infer the position of the cabinet from home runs of known length."""
    length = iolist.points["home_run_m"].to_numpy(float)
    known = np.isfinite(length) & iolist.located
    if known.sum() < _FEWEST:
        raise ArgumentError(
            f"{known.sum()} points of {iolist.source} have a position and a length to the cabinet; "
            f"{_FEWEST} are needed to find the cabinet"
        )
    places, wanted = iolist.places[known], length[known]

    def off(cabinets: Floats) -> Floats:
        return np.asarray(np.abs(detour * cdist(cabinets, places, "cityblock") + tails - wanted))

    # There are many local minima: search the whole ship, then ever closer around the best.
    centres = places.mean(axis=0, keepdims=True)
    reach, count = float(np.ptp(places, axis=0).max()) / 2 + 1.0, _FIRST
    while reach > _CLOSE:
        steps = np.stack(np.meshgrid(*3 * [np.linspace(-reach, reach, count)]), axis=-1)
        tried = (centres[:, None] + steps.reshape(-1, 3)).reshape(-1, 3)
        scale = max(reach / count, _ROUNDED)
        loss = np.log1p((off(tried) / scale) ** 2).sum(axis=-1)
        centres = tried[loss.argsort(kind="stable")[:_KEPT]]
        reach, count = reach * (2 / count), _NEXT
    x, y, z = (round(float(value), 1) + 0.0 for value in centres[0])
    place = np.array([x, y, z])
    misfits = off(place[None])[0]
    # Points on both sides of the cabinet fix its coordinate.
    side = places[misfits <= max(float(np.median(misfits)), _ROUNDED)] - place
    held = ((side < -_ROUNDED).any(axis=0)) & ((side > _ROUNDED).any(axis=0))
    flat = np.ptp(places, axis=0) < _ROUNDED
    settled = bool((~held).sum() <= 1 and not (flat & ~held).any())
    return Found((x, y, z), float(np.median(misfits)), int(known.sum()), settled)


def site_of(
    iolist: PointTable,
    cabinet: Where,
    trays: Trays | str | PathLike[str] | None,
    settings: Settings,
) -> tuple[Site, str]:
    """Return the site of a list, and a remark if the cabinet's position was inferred."""
    if isinstance(cabinet, Site):
        return cabinet, ""
    if isinstance(trays, str | PathLike):
        trays = Trays.read(trays)
    known = {} if trays is None else trays.cabinets
    names = f", or one of {', '.join(map(repr, known))}" if known else ""
    place, said = cabinet, ""
    if isinstance(cabinet, str):
        place = known.get(cabinet.strip()) or _typed(cabinet, names)
    elif cabinet is None:
        place, said = (0.0, 0.0, 0.0), "every length to the cabinet is given by the list"
        if lost := int(iolist.points["home_run_m"].isna().sum()):
            said = f"{lost} of {len(iolist)} points have neither a place nor a length"
        if iolist.located.any() or np.isfinite(iolist.box_places).any():
            try:
                found = find_cabinet(iolist)
            except ArgumentError as mistake:
                raise ArgumentError(
                    f"cabinet is not given, and {mistake}; give its position x, y, z in m, such "
                    f"as 26,6,14{names}"
                ) from None
            place, said = found.place, str(found)
    return Site(place, trays, settings.detour, settings.tails), said  # type: ignore[arg-type]


def _typed(cabinet: str, names: str) -> Place:
    """Return a position that is given as text."""
    try:
        x, y, z = map(float, cabinet.replace(";", ",").split(","))
        return Site((x, y, z)).cabinet
    except ValueError:
        raise ArgumentError(
            f"cabinet is {cabinet!r}; it must be three numbers x, y, z in m, such as 26,6,14{names}"
        ) from None
