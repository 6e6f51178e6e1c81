"""Transfer impedances of trees and rings, computed with arrays.

With e = exp(-gamma length), C = 1 + e^2 and S = 1 - e^2 are a line's hyperbolic cosine and sine
times 2 e; they neither overflow on a long line nor lose digits on a short one. A line transforms
the admittance Y at its far end and divides the voltage, without a pole at any frequency:

    Y_near = Yc (Y C + Yc S) / (Yc C + Y S),      V_far / V_near = 2 e Yc / (Yc C + Y S).

A sweep from the leaves of a tree to its root transforms all admittances, those of equal subtrees
only once; a sweep back multiplies the voltage ratios. A ring needs sweeps from its root and
from both ends of its closing line.
"""

from __future__ import annotations

from bisect import bisect_left
from collections import Counter
from collections.abc import Sequence
from itertools import pairwise, product
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from shipnet.arrays import Complexes, Floats, Indices
from shipnet.errors import ArgumentError
from shipnet.fields import Quantity
from shipnet.line.cable import Cable

#: Cable and length [m] of each run of a network.
Pieces = Sequence[tuple[Cable, Quantity]]

#: Index of rows: a slice if they are consecutive or all the same.
Rows = slice | Indices

#: Legal moduli of a complex frequency [rad/s].
_LOWEST, _HIGHEST = 1e-9, 1e15


def check_frequencies(s: npt.ArrayLike) -> Complexes:
    """Return complex frequencies as an array; raise ArgumentError if one is out of range."""
    array = np.asarray(s)
    if array.dtype.kind not in "iufc" or array.ndim != 1 or array.size == 0:
        raise ArgumentError(
            f"s has shape {array.shape} and type {array.dtype}; it must be a 1-D array of numbers"
        )
    modulus = np.abs(array)
    good = (modulus >= _LOWEST) & (modulus <= _HIGHEST) & (array.real >= 0)
    if not good.all():
        worst = complex(array[np.argmin(good)])
        raise ArgumentError(
            f"s is {worst:g} rad/s; its modulus must be {_LOWEST:g}..{_HIGHEST:g} rad/s and its "
            "real part not negative"
        )
    return array.astype(complex)


def rows_of(numbers: list[int]) -> Rows:
    """Return row numbers as an index: a slice if they are consecutive or all the same."""
    first, last = numbers[0], numbers[-1]
    if len(numbers) == 1 or all(number == first for number in numbers):
        return slice(first, first + 1)
    if numbers == list(range(first, last + 1)):
        return slice(first, last + 1)
    return np.array(numbers)


def part_of_trees(array: npt.NDArray[Any], trees: slice) -> npt.NDArray[Any]:
    """Return the part of an array for some trees of a Monte Carlo simulation."""
    return array if array.shape[1] == 1 else array[:, trees]


class Lines:
    """The distinct lines of a network; each pair of cable and length is computed once."""

    def __init__(self, pieces: Pieces, s: Complexes) -> None:
        kinds: dict[tuple[int, float | int], int] = {}
        cables: dict[int, int] = {}
        length, z, y = [], [], []
        self.kind: list[int] = []
        self.cable: list[int] = []
        for cable, metres in pieces:
            key = (id(cable), metres if isinstance(metres, float) else -id(metres))
            if key not in kinds:
                kinds[key] = len(kinds)
                if id(cable) not in cables:
                    cables[id(cable)] = len(cables)
                    z.append(np.atleast_2d(cable.series_impedance(s)))
                    y.append(np.atleast_2d(cable.shunt_admittance(s)))
                self.cable.append(cables[id(cable)])
                length.append(np.atleast_1d(metres))
            self.kind.append(kinds[key])
        series, shunt = np.stack(np.broadcast_arrays(*z)), np.stack(np.broadcast_arrays(*y))
        gamma = np.sqrt(series * shunt)
        self._length = np.stack(np.broadcast_arrays(*length))[:, :, np.newaxis]
        self._loss, self._phase = np.ascontiguousarray(gamma.real), np.ascontiguousarray(gamma.imag)
        self._y0, self._z0 = shunt / gamma, series / gamma
        self.trees = max(self._length.shape[1], gamma.shape[1])

    def waves(
        self, kinds: list[int], trees: slice, bins: slice
    ) -> tuple[Complexes, Complexes, Complexes, Complexes, Complexes]:
        """Return 2 e, C, S, Yc [S] and Zc [ohm], each of shape (kinds or 1, trees or 1, bins)."""
        cable = rows_of([self.cable[kind] for kind in kinds])
        length = part_of_trees(self._length, trees)[kinds]
        shrink = np.expm1(part_of_trees(self._loss, trees)[cable, :, bins] * -length)
        # The tangent of half the angle gives sine and cosine in a fifth of the time of exp.
        tangent = np.tan(part_of_trees(self._phase, trees)[cable, :, bins] * (length / 2))
        sine = (2 + 2 * shrink) / (1 + tangent * tangent) * tangent
        x = np.empty(sine.shape, dtype=complex)
        x.real = shrink - sine * tangent
        x.imag = -sine
        # Now x = e - 1, and e^2 - 1 = x (x + 2).
        minus_s = x * (x + 2)
        y0, z0 = (part_of_trees(wave, trees)[cable, :, bins] for wave in (self._y0, self._z0))
        return 2 * x + 2, minus_s + 2, -minus_s, y0, z0


def _admittances(shunts: Floats, trees: slice, s: Complexes) -> Complexes:
    """Return the admittances of the nodes' loads, shape (nodes, trees or 1, bins)."""
    conductance, per_henry, capacitance = (
        part_of_trees(kind, trees)[..., np.newaxis] for kind in shunts
    )
    y = capacitance * s
    y += conductance
    y += per_henry * (1 / s)
    return np.asarray(y)


#: Number of elements of a sweep's arrays, for one tree and for many. Larger arrays exceed the
#: cache, and the operating system clears them at every call; a call for many trees reuses them.
_BLOCK, _BLOCK_TREES = 1 << 15, 1 << 18

#: Number of elements for which hyperbolic functions are computed at a time.
_STRIP = 1 << 13


class Rooted(NamedTuple):
    """A network as a tree with a root; of a ring, the run that closes it is left out."""

    order: list[int]  # indices of the nodes, the root first, each after its parent
    parent: list[int]  # place in `order` of the parent of each node; -1 for the root
    run: list[int]  # index of the run to the parent; -1 for the root


class _Height(NamedTuple):
    """The distinct subtrees of one height, each with the line above it."""

    own: slice  # the rows of these subtrees
    line: Rows  # rows of their lines in the table of lines
    joints: list[tuple[int, int, int]]  # row of parent, index of branch, count


class _Subtrees(NamedTuple):
    """The distinct subtrees of a tree, one per row, leaves first."""

    row: list[int]  # row of the subtree at each place of the order
    node: list[int]  # for each row, a node at which its subtree begins
    heights: list[_Height]  # all but the tree itself, which is the last row
    table: list[int]  # kinds of lines that occur


def _subtrees(tree: Rooted, kind: list[int], shunts: Floats) -> _Subtrees:
    """Find the distinct subtrees, which differ in their line, load or branches."""
    loads = [load.tobytes() for load in shunts.swapaxes(0, 1)]
    found: dict[tuple[int, bytes, tuple[int, ...]], int] = {}
    first: list[int] = []
    height: list[int] = []
    which: list[int] = [0] * len(tree.order)
    branches: list[list[int]] = [[] for _ in tree.order]
    for place in range(len(tree.order) - 1, -1, -1):
        parts = tuple(sorted(branches[place]))
        key = kind[tree.run[place]] if place else -1, loads[tree.order[place]], parts
        number = found.setdefault(key, len(found))
        if number == len(first):
            first.append(tree.order[place])
            height.append(1 + max([height[part] for part in parts], default=-1))
        which[place] = number
        if place:
            branches[tree.parent[place]].append(number)

    order = sorted(range(len(found)), key=height.__getitem__)
    row = {number: k for k, number in enumerate(order)}
    joints: list[list[tuple[int, int, int]]] = [[] for _ in range(height[order[-1]])]
    begin = [bisect_left(order, h, key=height.__getitem__) for h in range(len(joints) + 1)]
    lines = [0] * len(order)
    for (line, _, parts), number in found.items():
        lines[row[number]] = line
        for part, times in Counter(parts).items():
            joints[height[part]].append((row[number], row[part] - begin[height[part]], times))
    table = {line: k for k, line in enumerate(dict.fromkeys(lines[:-1]))}
    heights = [
        _Height(slice(low, high), rows_of([table[line] for line in lines[low:high]]), some)
        for (low, high), some in zip(pairwise(begin), joints, strict=True)
    ]
    return _Subtrees([row[k] for k in which], [first[k] for k in order], heights, list(table))


def slices(size: int, step: int) -> list[slice]:
    """Divide a range into parts of nearly equal length."""
    parts = -(-size // max(1, step))
    return [slice(*cut) for cut in pairwise(size * part // parts for part in range(parts + 1))]


def tree_transfer(
    tree: Rooted, pieces: Pieces, shunts: Floats, s: Complexes, trees: int
) -> Complexes:
    """Return root-to-node transfer impedances [ohm], shape (trees, nodes, bins)."""
    lines = Lines(pieces, s)
    subtrees = _subtrees(tree, lines.kind, shunts)
    table, shunts, rows = subtrees.table, shunts[:, subtrees.node], len(subtrees.node)

    row = max(1, (_BLOCK if trees == 1 else _BLOCK_TREES) // rows)
    blocks = slices(trees, row // s.size), slices(s.size, row)
    count, size = (max(part.stop - part.start for part in parts) for parts in blocks)
    y_and_v = np.empty((2, rows, count, size), dtype=complex)
    terms = np.empty((4, len(table), min(count, lines.trees), size), dtype=complex)
    strips = slices(len(table), _STRIP // (terms.shape[2] * size))
    # Nodes are the first axis in memory, so that the values of each node are contiguous.
    z = np.empty((len(tree.order), trees, s.size), dtype=complex)
    for some, bins in product(*blocks):
        count, size = some.stop - some.start, bins.stop - bins.start
        y, v = y_and_v[:, :, :count, :size]
        own = terms[:, :, :count, :size]
        for strip in strips:
            own[3, strip], own[1, strip], sinh, y0, z0 = lines.waves(table[strip], some, bins)
            np.multiply(z0, sinh, out=own[0, strip])
            np.multiply(y0, sinh, out=own[2, strip])
        _fold(subtrees.heights, own, _admittances(shunts, some, s[bins]), y, v)
        ratio, voltage = list(v), list(z[:, some, bins])
        np.reciprocal(y[-1], out=voltage[tree.order[0]])
        for place in range(1, len(tree.order)):
            above = voltage[tree.order[tree.parent[place]]]
            np.multiply(ratio[subtrees.row[place]], above, out=voltage[tree.order[place]])
    return z.swapaxes(0, 1)


def _fold(
    heights: list[_Height], terms: Complexes, loads: Complexes, y: Complexes, v: Complexes
) -> None:
    """Write the admittances of nodes with branches into y and the voltage ratios into v."""
    # The terms are Zc S, C, Yc S and 2 e of the lines.
    joined = set()
    for height, (own, line, joints) in enumerate(heights):
        # Denominator and numerator, both divided by Yc, at once: Y Zc S + C and Y C + Yc S.
        both = (y if height else loads)[own] * terms[:2, line]
        both += terms[1:3, line]
        inverse, folded = both
        np.reciprocal(inverse, out=inverse)
        np.multiply(terms[3, line], inverse, out=v[own])
        folded *= inverse
        for whole, part, times in joints:
            before = y if whole in joined else loads
            more = folded[part] if times == 1 else times * folded[part]
            np.add(before[whole], more, out=y[whole])
            joined.add(whole)


def closed_transfer(
    z: Complexes,
    from_ends: tuple[Complexes, Complexes],
    ends: tuple[int, int],
    closing: tuple[Cable, Quantity],
    s: Complexes,
) -> Complexes:
    """Return transfer impedances after a line has joined two nodes of the tree.

    `from_ends` contains the tree's transfer impedances from each end of the line. The sum of the
    end voltages drives equal currents into both ends, and their difference drives opposite ones:
    two unknowns at each frequency.
    """
    from_a, from_b = from_ends
    a, b = ends
    e2, _, sinh, (y0,), (z0,) = Lines([closing], s).waves([0], slice(None), slice(None))
    tanh = sinh[0] / (1 + e2[0] / 2) ** 2  # of half the line
    y, ohms = y0 * tanh / 2, 2 * z0 * tanh
    both, between = z[:, a] + z[:, b], z[:, a] - z[:, b]
    aa, ab, bb = from_a[:, a], from_a[:, b], from_b[:, b]
    own, other, skew = 1 + y * (aa + 2 * ab + bb), ohms + aa - 2 * ab + bb, aa - bb
    determinant = own * other - y * skew * skew
    equal = y * (both * other - skew * between) / determinant
    opposite = (own * between - skew * y * both) / determinant
    at_a, at_b = equal + opposite, equal - opposite
    return np.asarray(z - from_a * at_a[:, np.newaxis] - from_b * at_b[:, np.newaxis])
