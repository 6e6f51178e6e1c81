"""Where the cabinet stands and which way cables go to it: along trays, or square to the ship."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from functools import cached_property
from math import isfinite, prod

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shipnet.design.site.tray_routes import TrayRoutes
from shipnet.design.site.trays import Place, Trays
from shipnet.errors import ArgumentError

__all__ = ["Site"]

_Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Site:
    """A ship as cables see it.

    Parameters
    ----------
    cabinet : (float, float, float)
        Place where the cables end [m].
    trays : Trays, optional
        Trays that the cables lie on; without them, a cable runs square to the ship's axes.
    detour : float, default 1.15
        Laid length of a cable as a multiple of its route, for bends and what is in the way;
        1..10. Assumed: the usual allowance of routing programs is of this form, not of this size.
    tails : float, default 5.0
        Length for both ends of a cable together [m], 0..1000. Assumed.

    Raises
    ------
    ArgumentError
        If an argument is out of range.

    Examples
    --------
    >>> site = Site((26, 6, 14))
    >>> round(float(site.length(site.route((19, 0.1, 10.6), site.cabinet))), 1)
    23.7
    """

    cabinet: Place
    trays: Trays | None = None
    detour: float = 1.15
    tails: float = 5.0

    def __post_init__(self) -> None:
        """Check every argument."""
        cabinet = _places("cabinet", self.cabinet)
        if cabinet.ndim != 1 or np.isnan(cabinet).any():
            raise ArgumentError(f"cabinet is {self.cabinet!r}; it must be three finite numbers")
        object.__setattr__(self, "cabinet", tuple(cabinet.tolist()))
        if self.trays is not None and not isinstance(self.trays, Trays):
            raise ArgumentError(f"trays is {self.trays!r}; it must be Trays or None")
        for name, low, high in (("detour", 1.0, 10.0), ("tails", 0.0, 1000.0)):
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, int | float) or not isfinite(value):
                raise ArgumentError(f"{name} is {value!r}; it must be a number {low:g}..{high:g}")
            if not low <= value <= high:
                raise ArgumentError(f"{name} is {value!r}; it must be a number {low:g}..{high:g}")

    def length(self, route: ArrayLike) -> _Floats:
        """Return the length of a cable to lay, for a route [m].

        Parameters
        ----------
        route : array_like
            Routes [m], any shape.

        Returns
        -------
        ndarray
            ``detour * route + tails`` [m], of the same shape.

        Examples
        --------
        >>> Site((0, 0, 0)).length([0, 100]).round(3).tolist()
        [5.0, 120.0]
        """
        return self.detour * np.asarray(route, dtype=np.float64) + self.tails

    def route(self, a: ArrayLike, b: ArrayLike, *, avoid: Collection[str] = ()) -> _Floats:
        """Return the length of the way between places.

        Parameters
        ----------
        a, b : array_like, shape (..., 3)
            Places [m]; the shapes are broadcast. NaN, a place that is not known, gives NaN.
        avoid : collection of str, optional
            Trays to be used only where there is no other way, for the second of two redundant
            cables.

        Returns
        -------
        ndarray, shape (...)
            Without trays, the sum of the differences of the coordinates [m]. With trays, the way
            square to the ship to the nearest point of a tray, the shortest way along trays, and
            the same at the other end; two places nearer to each other than to the trays are
            joined directly.

        Raises
        ------
        ArgumentError
            If the shapes do not fit, or a tray to avoid is unknown.

        Examples
        --------
        >>> Site((0, 0, 0)).route([(3, 4, 0), (1, 1, 1)], (0, 0, 0)).tolist()
        [7.0, 3.0]
        """
        a, b = _places("a", a), _places("b", b)
        _fit(a, b)
        routes = self._routes(avoid)
        return np.asarray(np.abs(a - b).sum(axis=-1)) if routes is None else routes.lengths(a, b)

    def way(self, a: ArrayLike, b: ArrayLike, *, avoid: Collection[str] = ()) -> tuple[str, ...]:
        """Return the trays between two places.

        Parameters
        ----------
        a, b : array_like, shape (3,)
            Places [m].
        avoid : collection of str, optional
            As `route`.

        Returns
        -------
        tuple of str
            Names of the trays from `a` to `b`; empty without trays, or if none is used.

        Raises
        ------
        ArgumentError
            As `route`.

        Examples
        --------
        >>> from shipnet.design.site.trays import Tray, Trays
        >>> trays = Trays({"A": (0, 0, 0), "B": (10, 0, 0)}, (Tray("main", "A", "B"),))
        >>> Site((0, 0, 0), trays).way((1, 0, 1), (8, 2, 0))
        ('main',)
        """
        (names,) = self.ways(np.atleast_2d(_places("a", a)), b, avoid=avoid)
        return names

    def ways(
        self, a: ArrayLike, b: ArrayLike, *, avoid: Collection[str] = ()
    ) -> list[tuple[str, ...]]:
        """Return the trays between each of two rows of places.

        Parameters
        ----------
        a, b : array_like, shape (n, 3) or (3,)
            Places [m].
        avoid : collection of str, optional
            As `route`.

        Returns
        -------
        list of tuple of str
            As `way`, for each pair; empty where a place is not known.

        Raises
        ------
        ArgumentError
            As `route`.

        Examples
        --------
        >>> Site((0, 0, 0)).ways([(1, 2, 3), (4, 5, 6)], (0, 0, 0))
        [(), ()]
        """
        a, b = _places("a", a), _places("b", b)
        shape = _fit(a, b)
        routes = self._routes(avoid)
        return [()] * prod(shape) if routes is None else routes.names(a, b)

    def _routes(self, avoid: Collection[str]) -> TrayRoutes | None:
        if self.trays is None:
            if avoid:
                raise ArgumentError(f"avoid names {avoid!r}; the site has no trays")
            return None
        names = frozenset([avoid] if isinstance(avoid, str) else avoid)
        if names not in self._known:
            self._known[names] = TrayRoutes(self.trays, names)
        return self._known[names]

    @cached_property
    def _known(self) -> dict[frozenset[str], TrayRoutes]:
        return {}


def _fit(a: _Floats, b: _Floats) -> tuple[int, ...]:
    """Return the shape of what two arrays of places are together."""
    try:
        return np.broadcast_shapes(a.shape, b.shape)[:-1]
    except ValueError:
        raise ArgumentError(f"a has shape {a.shape} and b {b.shape}; they must fit") from None


def _places(name: str, given: ArrayLike) -> _Floats:
    """Return places as an array, or raise unless the last axis has three coordinates."""
    try:
        places = np.asarray(given, dtype=np.float64)
    except (TypeError, ValueError):
        places = np.zeros(0)
    if places.shape[-1:] != (3,):
        raise ArgumentError(f"{name} is {given!r}; it must be an array of shape (..., 3)")
    if np.isinf(places).any():
        raise ArgumentError(f"{name} holds an infinite coordinate; it must be finite, or NaN")
    return places
