"""Which places belong together: clusters within reach, groups of equal size, groups that fit.

Distances are along the axes of the ship (the 1-norm), as cables run.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import ceil, inf, isfinite
from typing import TypeVar

import numpy as np
import numpy.typing as npt
from scipy.cluster.hierarchy import fcluster, linkage
from scipy.spatial.distance import cdist

from shipnet.errors import ArgumentError

__all__ = ["balanced", "divided", "zones"]

#: Above so many places the tree of all distances takes too much memory, and they are halved first.
_MOST = 3000

#: Above so many items groups of equal size are not worth the time that the best ones take.
_MANY = 1000

#: Rounds of moving the centres; assignments settle in a few.
_ROUNDS = 20

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.intp]
Item = TypeVar("Item")
Result = TypeVar("Result")


def zones(places: npt.ArrayLike, *, reach: float, most: int | None = None) -> Ints:
    """Return clusters whose places are all within reach of each other.

    Parameters
    ----------
    places : array_like, shape (n, 3)
        Places [m].
    reach : float
        Longest distance between two places of a cluster, along the axes [m]; 0 or more.
    most : int, optional
        Most places of a cluster.

    Returns
    -------
    ndarray of int, shape (n,)
        Number of each place's cluster, from 0 in the order in which they appear.

    Raises
    ------
    ArgumentError
        If a place is not finite or has no three coordinates, `reach` is negative or `most` is 0.

    Notes
    -----
    The clusters are the largest subtrees of the tree of complete linkage that keep both limits.
    More than 3000 places are first halved across their longest side, again and again.

    Examples
    --------
    >>> zones([[0, 0, 0], [2, 1, 0], [30, 0, 0], [1, 1, 1]], reach=5).tolist()
    [0, 0, 1, 0]
    """
    xyz = _places(places)
    if not (isfinite(reach) and reach >= 0):
        raise ArgumentError(f"reach is {reach!r} m; it must be 0 or more")
    largest = len(xyz) if most is None else most
    if len(xyz) and largest < 1:
        raise ArgumentError(f"most is {most!r}; it must be 1 or more")
    if len(xyz) > _MOST:
        upper = _halves(xyz)
        labels = np.empty(len(xyz), dtype=np.intp)
        low, high = (zones(xyz[side], reach=reach, most=most) for side in (~upper, upper))
        labels[~upper], labels[upper] = low, high + low.max() + 1
        return _renumbered(labels)
    if len(xyz) < 2:
        return np.zeros(len(xyz), dtype=np.intp)
    tree = linkage(xyz, "complete", "cityblock")
    # Beyond its limit a subtree is cut: both shares grow from the leaves to the root.
    excess = np.maximum(tree[:, 2] - reach, (tree[:, 3] > largest).astype(float))
    return _renumbered(fcluster(tree, 1e-9, "monocrit", monocrit=excess).astype(np.intp))


def balanced(
    places: npt.ArrayLike, groups: int, *, kinds: npt.ArrayLike = 0, most: Sequence[int] = ()
) -> Ints:
    """Return groups of nearly equal size whose places are near the middle of their group.

    Parameters
    ----------
    places : array_like, shape (n, 3)
        Places [m].
    groups : int
        Number of groups, 1 or more.
    kinds : array_like of int, shape (n,), default 0
        Kind of each place, from 0; each kind has room of its own in a group.
    most : sequence of int, optional
        Most places of each kind in a group; equal shares if not given.

    Returns
    -------
    ndarray of int, shape (n,)
        Number of each place's group, from 0 in the order in which they appear; a group may stay
        empty where there is more room than places.

    Raises
    ------
    ArgumentError
        If the groups have not enough room, or a place is not finite.

    Notes
    -----
    Centres and assignments by turns: the assignment of least distance to the centres
    (`scipy.optimize.linear_sum_assignment`), then the median of each group, the best place along
    the axes; until nothing moves. The first centres lie along the longest extent. No assignment is
    worse than the one before it.

    Examples
    --------
    Five sensors in one room and three in another, four inputs a module, so that one has to cross:

    >>> balanced([[x, 0, 0] for x in (0, 1, 2, 3, 4, 50, 51, 52)], 2, most=[4]).tolist()
    [0, 0, 0, 0, 1, 1, 1, 1]
    """
    from scipy.optimize import linear_sum_assignment  # slow to load, and few plans need it

    xyz = _places(places)
    kind = np.broadcast_to(np.asarray(kinds, dtype=np.intp), len(xyz))
    if groups < 1:
        raise ArgumentError(f"groups is {groups!r}; it must be 1 or more")
    counts = np.bincount(kind) if len(xyz) else np.zeros(1, dtype=np.intp)
    room = [ceil(count / groups) for count in counts] if not most else list(most)
    for number, count in enumerate(counts):
        if number >= len(room) or count > groups * room[number]:
            raise ArgumentError(f"{count} places of kind {number} have no room in {groups} groups")
    if groups == 1 or len(xyz) < 2:
        return np.zeros(len(xyz), dtype=np.intp)
    centres = _first_centres(xyz, groups)
    labels = np.full(len(xyz), -1, dtype=np.intp)
    for _ in range(_ROUNDS):
        away = cdist(xyz, centres, "cityblock")
        moved = np.empty_like(labels)
        for number, seats in enumerate(room[: len(counts)]):
            mine = np.flatnonzero(kind == number)
            at, seat = linear_sum_assignment(np.repeat(away[mine], seats, axis=1))
            moved[mine[at]] = seat // max(seats, 1)
        if (moved == labels).all():
            break
        labels = moved
        for group in range(groups):
            if (labels == group).any():
                centres[group] = np.median(xyz[labels == group], axis=0)
    return _renumbered(labels)


def divided(
    items: Sequence[Item],
    place: Callable[[Item], Sequence[float]],
    judge: Callable[[Sequence[Item]], tuple[Result, float]],
    halve: Callable[[Item], Sequence[Item]] | None = None,
) -> list[tuple[list[Item], Result]]:
    """Divide items into groups until each keeps its limits.

    Parameters
    ----------
    items : sequence
        What is to be divided.
    place : callable
        Place of an item, three coordinates [m].
    judge : callable
        What a group comes to, and in how many groups of equal size it has to be divided at least:
        1 or less if it keeps all limits, infinite if size is not what it fails by, so that it is
        divided in two where it lies farthest apart.
    halve : callable, optional
        Two items in the place of one that breaks a limit alone; none if it cannot be halved.

    Returns
    -------
    list of tuple of (list, result)
        The groups, with what `judge` said of them. An item that breaks a limit alone and cannot be
        halved is a group, too.

    Examples
    --------
    Lines of at most 10 m from end to end:

    >>> def judge(group):
    ...     length = max(group) - min(group)
    ...     return length, 1 if length <= 10 else inf
    >>> divided([0, 4, 8, 40, 44], lambda x: (x, 0, 0), judge)
    [([0, 4, 8], 8), ([40, 44], 4)]
    """
    waiting = [list(items)] if len(items) else []
    done = []
    while waiting:
        group = waiting.pop(0)
        result, parts = judge(group)
        pieces: list[list[Item]] = []
        if parts > 1 and len(group) > 1:
            pieces = _pieces(group, place, parts)
        elif parts > 1 and halve is not None:
            pieces = [[piece] for piece in halve(group[0])]
        if not pieces:
            done.append((group, result))
        waiting = pieces + waiting
    return done


def _pieces(
    group: list[Item], place: Callable[[Item], Sequence[float]], parts: float
) -> list[list[Item]]:
    xyz = _places([place(item) for item in group])
    if len(group) > _MANY:
        labels = _halves(xyz).astype(np.intp)
    elif parts == inf:
        labels = fcluster(linkage(xyz, "complete", "cityblock"), 2, "maxclust")
        if len(np.unique(labels)) < 2:  # all in one place
            labels = np.arange(len(group)) % 2
    else:
        labels = balanced(xyz, min(ceil(parts), len(group)))
    return [
        [item for item, label in zip(group, labels, strict=True) if label == own]
        for own in dict.fromkeys(labels.tolist())
    ]


def _first_centres(xyz: Floats, groups: int) -> Floats:
    middle = xyz - xyz.mean(axis=0)
    extent = np.linalg.svd(middle, full_matrices=False)[2][0]
    order = np.argsort(middle @ extent, kind="stable")
    chunks = np.array_split(order, groups)
    return np.array([np.median(xyz[c], axis=0) if len(c) else xyz[order[-1]] for c in chunks])


def _halves(xyz: Floats) -> npt.NDArray[np.bool_]:
    along = xyz[:, np.ptp(xyz, axis=0).argmax()]
    upper = np.zeros(len(xyz), dtype=np.bool_)
    upper[np.argsort(along, kind="stable")[len(xyz) // 2 :]] = True
    return upper


def _renumbered(labels: Ints) -> Ints:
    _, first, inverse = np.unique(labels, return_index=True, return_inverse=True)
    return np.asarray(np.argsort(np.argsort(first))[inverse], dtype=np.intp)


def _places(places: npt.ArrayLike) -> Floats:
    xyz = np.asarray(places, dtype=np.float64)
    if xyz.size == 0:
        return np.empty((0, 3))
    if xyz.ndim != 2 or xyz.shape[1] != 3 or not np.isfinite(xyz).all():
        raise ArgumentError("places must be finite coordinates, three a place")
    return xyz
