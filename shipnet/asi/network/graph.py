"""Two questions to a plan's cables: what hangs together, and how far it is from here to there."""

from __future__ import annotations

from collections.abc import Iterable
from heapq import heappop, heappush

from shipnet.asi.network.elements import CableRun

__all__ = ["Groups", "shortest_ways"]


class Groups:
    """Disjoint groups of names.

    Examples
    --------
    >>> groups = Groups()
    >>> groups.join("a", "b"), groups.join("b", "c"), groups.join("c", "a")
    (True, True, False)
    >>> groups.leader("a") == groups.leader("c") != groups.leader("d")
    True
    """

    def __init__(self) -> None:
        self._parent: dict[str, str] = {}

    def __contains__(self, name: str) -> bool:
        """Whether a name has been seen."""
        return name in self._parent

    def leader(self, name: str) -> str:
        """Return the name that stands for a group; a new name is a group of its own."""
        self._parent.setdefault(name, name)
        while self._parent[name] != name:
            self._parent[name] = name = self._parent[self._parent[name]]
        return name

    def join(self, a: str, b: str) -> bool:
        """Make one group of two; return whether they were two."""
        a, b = self.leader(a), self.leader(b)
        self._parent[b] = a
        return a != b


def shortest_ways(cables: Iterable[CableRun], start: str) -> dict[str, float]:
    """Return the shortest way along cables from one node to each that they reach.

    Parameters
    ----------
    cables : iterable of CableRun
        Cables, rings allowed.
    start : str
        Where to begin.

    Returns
    -------
    dict of str to float
        Length of the way to each node [m], 0 to the first one itself.

    Examples
    --------
    >>> ring = [CableRun("a", "b", 30), CableRun("b", "c", 30), CableRun("c", "a", 20)]
    >>> shortest_ways(ring, "a")
    {'a': 0.0, 'c': 20.0, 'b': 30.0}
    """
    near: dict[str, list[tuple[str, float]]] = {}
    for cable in cables:
        near.setdefault(cable.a, []).append((cable.b, cable.length))
        near.setdefault(cable.b, []).append((cable.a, cable.length))
    ways: dict[str, float] = {}
    waiting = [(0.0, start)]
    while waiting:
        so_far, node = heappop(waiting)
        if node not in ways:
            ways[node] = so_far
            for other, length in near.get(node, ()):
                heappush(waiting, (so_far + length, other))
    return ways
