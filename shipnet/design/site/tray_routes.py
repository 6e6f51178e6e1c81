"""The shortest ways along trays between places beside them."""

from __future__ import annotations

from collections.abc import Collection
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from shipnet.design.site.trays import Trays
from shipnet.errors import ArgumentError

__all__ = ["TrayRoutes"]

_Floats = NDArray[np.float64]
_Wholes = NDArray[np.intp]

#: How much longer a metre of a tray counts that is to be avoided: longer than any way round it.
_AVOIDED = 1e6

#: Distances to trays that are computed at once.
_AT_ONCE = 2**21


class _Entry(NamedTuple):
    """Where places reach the trays: which, how far along it [m], and how far away [m]."""

    tray: _Wholes
    along: _Floats
    off: _Floats


class _Join(NamedTuple):
    """A way from one entry to another.

    First and last node (-1: none), metres on the trays of the entries, and metres in all.
    """

    first: _Wholes
    last: _Wholes
    out: _Floats
    into: _Floats
    length: _Floats


class TrayRoutes:
    """The shortest ways between all places of a ship, for one choice of trays to avoid.

    Parameters
    ----------
    trays : Trays
        The trays.
    avoid : collection of str, optional
        Names of trays that are used only where there is no other way.

    Raises
    ------
    ArgumentError
        If a tray to avoid is unknown.

    Examples
    --------
    >>> from shipnet.design.site.trays import Tray
    >>> trays = Trays({"A": (0, 0, 0), "B": (10, 0, 0)}, (Tray("main", "A", "B"),))
    >>> routes = TrayRoutes(trays)
    >>> a, b = np.array([[1.0, 0, 1]]), np.array([[8.0, 2, 0]])
    >>> routes.lengths(a, b).tolist(), routes.names(a, b)
    ([10.0], [('main',)])
    """

    def __init__(self, trays: Trays, avoid: Collection[str] = ()) -> None:
        names = {avoid} if isinstance(avoid, str) else set(avoid)
        if names - set(trays.names):
            unknown = ", ".join(map(repr, sorted(names - set(trays.names))))
            raise ArgumentError(f"avoid names {unknown}; the trays are {', '.join(trays.names)}")
        self.trays = trays
        self._weight = np.where(np.isin(trays.names, list(names)), _AVOIDED, 1.0)
        size = len(trays.nodes)
        cost, metres = np.full((2, size, size), np.inf)
        self._tray = np.full((size, size), -1, dtype=np.intp)
        counted = trays.lengths * self._weight
        # Of several trays between two nodes, the one that counts least is written last.
        for n in np.argsort(-counted, kind="stable"):
            for a, b in (trays.ends[n], trays.ends[n][::-1]):
                cost[a, b], metres[a, b], self._tray[a, b] = counted[n], trays.lengths[n], n
        a, b = np.nonzero(np.isfinite(cost))
        graph = csr_array((cost[a, b], (a, b)), shape=(size, size))
        self._cost, before = dijkstra(graph, return_predecessors=True)
        self._before = before.astype(np.intp)
        # What counts is not what is laid: metres are summed along the ways found, nearest first.
        self._length = np.zeros((size, size))
        rows = np.arange(size)
        for node in np.argsort(self._cost, axis=1, kind="stable").T[1:]:
            last = self._before[rows, node]
            self._length[rows, node] = self._length[rows, last] + metres[last, node]

    def lengths(self, a: _Floats, b: _Floats) -> _Floats:
        """Return the lengths of the ways between places.

        Parameters
        ----------
        a, b : ndarray, shape (..., 3)
            Places [m]; the shapes are broadcast.

        Returns
        -------
        ndarray, shape (...)
            Lengths [m]; NaN where a place is NaN.
        """
        start, end, direct, shape = self._both(a, b)
        off = start.off + end.off
        length = np.where(direct <= off, direct, off + self._join(start, end).length)
        return np.asarray(length.reshape(shape))

    def names(self, a: _Floats, b: _Floats) -> list[tuple[str, ...]]:
        """Return the names of the trays between places.

        Parameters
        ----------
        a, b : ndarray, shape (..., 3)
            Places [m]; the shapes are broadcast.

        Returns
        -------
        list of tuple of str
            Names from `a` to `b`; none where a place is NaN, or the places are joined directly.
        """
        start, end, direct, _ = self._both(a, b)
        join = self._join(start, end)
        used = start.off + end.off < direct
        # A tray that is only touched at its end is not used.
        keys = np.column_stack([
            np.where(join.out > 0, start.tray, -1), join.first, join.last,
            np.where(join.into > 0, end.tray, -1),
        ])  # fmt: skip
        keys[~used] = -1
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

    def _both(self, a: _Floats, b: _Floats) -> tuple[_Entry, _Entry, _Floats, tuple[int, ...]]:
        """Return the entries of places and their direct distance, flat, and the shape of all."""
        direct = np.abs(a - b).sum(axis=-1)
        start, end = (_spread(self._enter(one), one.shape[:-1], direct.shape) for one in (a, b))
        return start, end, direct.ravel(), direct.shape

    def _enter(self, places: _Floats) -> _Entry:
        """Return where places reach the nearest tray, the first of several as near; flat."""
        points = places.reshape(-1, 3)
        a, b = self.trays.places[self.trays.ends.T]
        span, square = b - a, self.trays.lengths**2
        tray = np.zeros(len(points), dtype=np.intp)
        along, off = np.full((2, len(points)), np.nan)
        known = np.flatnonzero(np.isfinite(points).all(axis=1))
        step = max(1, _AT_ONCE // len(span))
        for rows in (known[k : k + step] for k in range(0, len(known), step)):
            own = points[rows]
            # The nearest point of the line from a to b, kept between its ends.
            share = ((own @ span.T - (a * span).sum(axis=1)) / square).clip(0, 1)
            far = np.zeros_like(share)
            for axis in range(3):
                far += np.abs(own[:, axis, None] - a[:, axis] - share * span[:, axis])
            best = far.argmin(axis=1)
            each = np.arange(len(rows))
            tray[rows], off[rows] = best, far[each, best]
            along[rows] = share[each, best] * self.trays.lengths[best]
        return _Entry(tray, along, off)

    def _join(self, start: _Entry, end: _Entry) -> _Join:
        """Return the way that counts least, over either end of either tray or along one tray."""
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


def _spread(entry: _Entry, own: tuple[int, ...], shape: tuple[int, ...]) -> _Entry:
    """Return entries of places of one shape for another to which it is broadcast, flat."""
    tray = np.broadcast_to(entry.tray.reshape(own), shape).ravel()
    along = np.broadcast_to(entry.along.reshape(own), shape).ravel()
    return _Entry(tray, along, np.broadcast_to(entry.off.reshape(own), shape).ravel())
