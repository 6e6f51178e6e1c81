"""Transfer impedances of a tree, by one sweep from its leaves to its root and one back.

A line folds the admittance Y at its far end to its near end, and divides the voltage:

    Y_near = Yc (Y C + Yc S) / (Yc C + Y S),      V_far / V_near = 2 e Yc / (Yc C + Y S),

with e, C and S as in `shipnet.line.waves`. The first sweep folds all admittances, level by level,
the second multiplies all ratios; no term blows up at a whole number of half waves.
"""

from __future__ import annotations

from itertools import pairwise, product
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import numpy.typing as npt

from shipnet.errors import ArgumentError
from shipnet.line.waves import Complexes, Lines, Rows, admittances, check_frequencies, rows_of

if TYPE_CHECKING:
    from shipnet.line.network import Network

__all__ = ["Rooted", "rooted", "slices", "transfer"]

#: Elements of the arrays of a sweep: larger ones leave the cache, and are handed back to the
#: system and zeroed by it again at every call. A Monte Carlo uses them many times in a call.
_BLOCK, _BLOCK_TREES = 1 << 15, 1 << 17

#: Elements that the hyperbolic functions of lines take at a time.
_STRIP = 1 << 13


class Rooted(NamedTuple):
    """A network seen from one node, level by level; a ring without its closing branch.

    Attributes
    ----------
    order : list of int
        Numbers of the nodes, the root first; the children of a node stand together.
    parent : list of int
        Place in `order` of the parent of each node; -1 for the root.
    branch : list of int
        Number of the branch to the parent; -1 for the root.
    levels : list of tuple of int
        First place, and place after the last, of each level below the root.
    """

    order: list[int]
    parent: list[int]
    branch: list[int]
    levels: list[tuple[int, int]]


def rooted(network: Network, root: str) -> Rooted:
    """Return a network as a tree that grows from one of its nodes.

    Parameters
    ----------
    network : Network
        The network.
    root : str
        The node.

    Returns
    -------
    Rooted
        Order of the nodes, their parents, branches and levels.

    Raises
    ------
    ArgumentError
        If the root is unknown, there is no line, or a node is connected to nothing.

    Examples
    --------
    >>> from shipnet.line import CABLES, Network
    >>> net = Network()
    >>> net.line("a", "b", 5, CABLES["as-i"])
    >>> net.line("b", "c", 5, CABLES["as-i"])
    >>> rooted(net, "b")
    Rooted(order=[1, 0, 2], parent=[-1, 0, 0], branch=[-1, 0, 1], levels=[(1, 3)])
    """
    if not network.branches:
        raise ArgumentError("the network has no line; it must have at least one")
    order, parent, branch = [network.index(root)], [-1], [-1]
    levels: list[tuple[int, int]] = []
    low, high = 0, 1
    while low < high:
        for place in range(low, high):
            for node, number in network.neighbours(order[place]):
                if number != branch[place]:
                    order.append(node)
                    parent.append(place)
                    branch.append(number)
        low, high = high, len(order)
        if low < high:
            levels.append((low, high))
    if len(order) < len(network.nodes):
        reached = set(order)
        lost = [repr(name) for node, name in enumerate(network.nodes) if node not in reached]
        raise ArgumentError(f"no line leads from node {root!r} to {', '.join(lost)}")
    return Rooted(order, parent, branch, levels)


class _Level(NamedTuple):
    """Nodes at the same number of lines from the root, as places in the order."""

    own: slice
    """Places of the nodes of the level."""
    line: slice
    """Rows of the lines above them in the table of lines."""
    parent: Rows
    """Place of the parent of each."""
    parents: Rows
    """Places of the parents, each once."""
    runs: list[int] | None
    """Where the children of each parent begin; None if each has one child."""


def _levels(tree: Rooted, kind: list[int]) -> tuple[list[_Level], list[int]]:
    """Return the levels, and the kinds in the table of lines, where each level finds a run."""
    levels = []
    table: list[int] = []
    starts: dict[tuple[int, ...], int] = {}
    for low, high in tree.levels:
        kinds = tuple([kind[number] for number in tree.branch[low:high]])
        if len(set(kinds)) == 1:
            kinds = kinds[:1]
        if kinds not in starts:
            starts[kinds] = len(table)
            table += kinds
        line = slice(starts[kinds], starts[kinds] + len(kinds))
        parent = tree.parent[low:high]
        runs = [i for i in range(high - low) if i == 0 or parent[i] != parent[i - 1]]
        rows = rows_of(parent)
        if len(runs) == len(parent):
            levels.append(_Level(slice(low, high), line, rows, rows, None))
        else:
            parents = rows_of([parent[i] for i in runs])
            levels.append(_Level(slice(low, high), line, rows, parents, runs))
    return levels, table


def slices(size: int, step: int) -> list[slice]:
    """Cut a range into parts of about the same length.

    Parameters
    ----------
    size : int
        Length of the range.
    step : int
        Length that no part exceeds; less than 1 counts as 1.

    Returns
    -------
    list of slice
        The parts.

    Examples
    --------
    >>> slices(5, 3)
    [slice(0, 2, None), slice(2, 5, None)]
    """
    parts = -(-size // max(1, step))
    return [slice(*cut) for cut in pairwise(size * part // parts for part in range(parts + 1))]


def transfer(network: Network, root: str, s: npt.ArrayLike) -> Complexes:
    """Return the transfer impedances between one node of a tree and every node.

    Parameters
    ----------
    network : Network
        The network, which must not hold a ring.
    root : str
        The one node.
    s : array_like of complex, shape (n_s,)
        Complex frequency, not 0, real part not negative [rad/s].

    Returns
    -------
    ndarray of complex, shape (n_nodes, n_s) or (n_trees, n_nodes, n_s)
        As `Network.transfer` [ohm].

    Raises
    ------
    ArgumentError
        As `Network.transfer`.

    Examples
    --------
    Into a line that is matched at its far end, a current meets the wave impedance:

    >>> from shipnet.line import Cable, Network
    >>> net = Network()
    >>> net.line("near", "far", 40, Cable.lossless(120, 5e-9))
    >>> net.terminator("far", 120)
    >>> abs(transfer(net, "near", [1e6j])).round(9).tolist()
    [[120.0], [120.0]]
    """
    s = check_frequencies(s)
    tree = rooted(network, root)
    lines = Lines(network, s)
    levels, table = _levels(tree, lines.kind)
    shunts = network.shunts()[:, tree.order]
    nodes, trees = len(tree.order), network.trees or 1

    row = max(1, (_BLOCK if trees == 1 else _BLOCK_TREES) // nodes)
    blocks = slices(trees, row // s.size), slices(s.size, row)
    count, size = (max(part.stop - part.start for part in parts) for parts in blocks)
    y_and_v = np.empty((2, nodes, count, size), dtype=complex)
    terms = np.empty((4, len(table), min(count, lines.trees), size), dtype=complex)
    strips = slices(len(table), _STRIP // (terms.shape[2] * size))
    z = np.empty((trees, nodes, s.size), dtype=complex)
    for some, bins in product(*blocks):
        count, size = some.stop - some.start, bins.stop - bins.start
        y, v = y_and_v[:, :, :count, :size]
        e2, c, ys, zs = terms[:, :, :count, :size]
        for strip in strips:
            e2[strip], c[strip], sinh, y0, z0 = lines.waves(table[strip], some, bins)
            np.multiply(y0, sinh, out=ys[strip])
            np.multiply(z0, sinh, out=zs[strip])
        _sweep(levels, (e2, c, ys, zs), admittances(shunts, some, s[bins], out=y), v)
        for node, voltage in zip(tree.order, v, strict=True):
            z[some, node, bins] = voltage
    return z if network.trees else z[0]


def _sweep(
    levels: list[_Level],
    terms: tuple[Complexes, Complexes, Complexes, Complexes],
    y: Complexes,
    v: Complexes,
) -> None:
    """Write the transfer impedances into v; y holds the loads, and is overwritten."""
    e2, c, ys, zs = terms
    for level in reversed(levels):
        inverse = y[level.own] * zs[level.line]
        inverse += c[level.line]
        np.reciprocal(inverse, out=inverse)
        np.multiply(e2[level.line], inverse, out=v[level.own])
        folded = y[level.own] * c[level.line]
        folded += ys[level.line]
        folded *= inverse
        if level.runs is not None:
            if len(level.runs) == 1:
                folded = np.add.reduce(folded, axis=0, keepdims=True)
            else:
                folded = np.add.reduceat(folded, level.runs, axis=0)
        y[level.parents] += folded
    np.reciprocal(y[0], out=v[0])
    for level in levels:
        v[level.own] *= v[level.parent]
