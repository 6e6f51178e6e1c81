"""How a trunk goes past its devices: branching, or from each to the next."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.sparse.csgraph import depth_first_order, minimum_spanning_tree

from shipnet.errors import ArgumentError

__all__ = ["chain", "tree"]

#: What keeps two devices in one place apart: scipy takes a distance below 1e-8 for no edge [m].
_APART = 1e-6

Floats = npt.NDArray[np.float64]


def tree(ways: npt.ArrayLike) -> list[tuple[int, int]]:
    """Return the branching trunk of least length: the minimum spanning tree.

    Parameters
    ----------
    ways : array_like, shape (n, n)
        Way from each device to each other one [m]; the trunk begins at the first.

    Returns
    -------
    list of tuple of (int, int)
        Ends of each cable, the one nearer to the first device first; a device is reached before
        anything leaves it.

    Raises
    ------
    ArgumentError
        If `ways` is not a square of finite ways, 0 or more.

    Examples
    --------
    >>> x = np.array([0, 10, 12, 30])
    >>> tree(abs(x - x[:, None]))
    [(0, 1), (1, 2), (2, 3)]
    """
    away = _square(ways)
    if len(away) < 2:
        return []
    spanning = minimum_spanning_tree(away + _APART)
    order, before = depth_first_order(spanning, 0, directed=False)
    return [(int(before[place]), int(place)) for place in order[1:]]


def chain(ways: npt.ArrayLike) -> list[int]:
    """Return the order in which a trunk goes from device to device on a short way.

    Parameters
    ----------
    ways : array_like, shape (n, n)
        Way from each device to each other one [m]; the trunk begins at the first.

    Returns
    -------
    list of int
        All devices, the first one first.

    Raises
    ------
    ArgumentError
        If `ways` is not a square of finite ways, 0 or more.

    Notes
    -----
    A walk around the minimum spanning tree, at most twice as long as the best order where no
    detour is shorter than the way itself; then pieces of it are turned round as long as that makes
    it shorter (2-opt, the best turn first). No order is shorter than the tree.

    Examples
    --------
    >>> x = np.array([0, 30, 10, 12])
    >>> chain(abs(x - x[:, None]))
    [0, 2, 3, 1]
    """
    away = _square(ways)
    n = len(away)
    if n < 3:
        return list(range(n))
    order = np.asarray(_walk(tree(away), n))
    # Behind the last device comes a place that is near to all: the chain may end anywhere.
    padded = np.zeros((n + 1, n + 1))
    padded[:n, :n] = away
    order = np.append(order, n)
    first, last = np.triu_indices(n - 1, 0)
    first, last = first + 1, last + 1
    while True:
        before, a, b, behind = order[first - 1], order[first], order[last], order[last + 1]
        change = padded[before, b] + padded[a, behind] - padded[before, a] - padded[b, behind]
        best = int(change.argmin())
        if change[best] > -1e-6:
            return [int(place) for place in order[:-1]]
        start, end = first[best], last[best] + 1
        order[start:end] = order[start:end][::-1].copy()


def _walk(edges: list[tuple[int, int]], n: int) -> list[int]:
    onward: list[list[int]] = [[] for _ in range(n)]
    below = np.ones(n, dtype=np.intp)
    for near, far in edges:
        onward[near].append(far)
    for near, far in reversed(edges):
        below[near] += below[far]
    order, waiting = [], [0]
    while waiting:
        place = waiting.pop()
        order.append(place)
        # The largest branch last: nothing has to come back from it.
        waiting += sorted(onward[place], key=lambda other: -below[other])
    return order


def _square(ways: npt.ArrayLike) -> Floats:
    away = np.asarray(ways, dtype=np.float64)
    square = away.ndim == 2 and away.shape[0] == away.shape[1]
    if not square or not ((away >= 0) & np.isfinite(away)).all():
        raise ArgumentError("ways must be a square of finite ways, 0 m or more")
    return away
