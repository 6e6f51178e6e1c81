"""Transfer impedances of trees and rings of cables.

A line of length l with series impedance z and shunt admittance y per metre has the propagation
constant gamma = sqrt(z y), the characteristic impedance Zc = z / gamma and a chain (ABCD) matrix:

    V_near = A V_far + B I_far,    A = D = cosh(gamma l),    B = Zc sinh(gamma l),
    I_near = C V_far + D I_far,    C = sinh(gamma l) / Zc.

(D. M. Pozar, Microwave Engineering, 4th ed., table 4.1.) With e = exp(-gamma l), the hyperbolic
cosine is (1 + e^2) / 2e and the sine (1 - e^2) / 2e. We use the matrix times e, whose elements do
not overflow on a long line.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt

from shipnet.arrays import Complexes, Floats
from shipnet.errors import ArgumentError
from shipnet.fields import Quantity
from shipnet.line.cable import Cable

#: Factors e, A e, B e [ohm] and C e [S] of a line, numbers or arrays of equal shape.
Chain: TypeAlias = tuple[Any, Any, Any, Any]

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


class Waves(NamedTuple):
    """Constants of the waves on a cable, by frequency or by tree and frequency."""

    gamma: Complexes  # propagation constant [1/m]
    z0: Complexes  # characteristic impedance [ohm]
    y0: Complexes  # its reciprocal [S]

    @classmethod
    def of(cls, cable: Cable, s: Complexes) -> Waves:
        """Return the waves on a cable at complex frequencies s."""
        z, y = cable.series_impedance(s), cable.shunt_admittance(s)
        gamma = np.sqrt(z * y)
        return cls(gamma, z / gamma, y / gamma)

    def faded(self, length: Quantity) -> Complexes:
        """Return 1 - e for a line of this length [m], with all digits if the line is short."""
        return np.asarray(-np.expm1(-self.gamma * np.expand_dims(length, -1)))

    def chain(self, length: Quantity) -> Chain:
        """Return e and the chain matrix times e."""
        faded = self.faded(length)
        sine = faded * (1 - faded / 2)  # (1 - e^2) / 2
        return 1 - faded, 1 - sine, self.z0 * sine, self.y0 * sine


def fold(parent: Sequence[int], lines: Sequence[Chain], loads: Sequence[Any]) -> list[Any]:
    """Return the voltage at each node of a tree [V] when 1 A flows into its root, node 0.

    `parent` is the node above each node. `lines` contains e, A e, B e and C e of the line to it,
    where e = exp(-gamma length), A = cosh(gamma length), B = Zc sinh(gamma length) [ohm] and
    C = sinh(gamma length) / Zc [S]. `loads` are the admittances at the nodes [S].

    A line of a quarter wave and 100 ohm has e = -1j; it transforms 50 ohm into 200 ohm:

    >>> fold([-1, 0], [None, (-1j, 0, 100, 0.01)], [0, 1 / 50])
    [200.0, -100j]
    """
    # Fold the admittances from the leaves to the root, then let the voltages run out.
    y, v = list(loads), list(loads)
    for node in range(len(y) - 1, 0, -1):
        e, a, b, c = lines[node]
        inverse = 1 / (a + b * y[node])
        y[parent[node]] = y[parent[node]] + (c + a * y[node]) * inverse
        v[node] = e * inverse
    v[0] = 1 / y[0]
    for node in range(1, len(y)):
        v[node] = v[node] * v[parent[node]]
    return v


class Rooted(NamedTuple):
    """A network as a tree with a root; of a ring, the run that closes it is left out."""

    order: list[int]  # indices of the nodes, the root first, each after its parent
    parent: list[int]  # place in `order` of the parent of each node; -1 for the root
    run: list[int]  # index of the run to the parent; -1 for the root


def close(
    v: dict[int, Complexes],
    from_ends: dict[int, dict[int, Complexes]],
    waves: Waves,
    length: Quantity,
) -> dict[int, Complexes]:
    """Return the transfer impedances of a tree after a line has joined two of its nodes, a and b.

    `from_ends` contains the transfer impedances of the tree from a and from b. The waves that enter
    the line at its ends are two unknowns at each frequency. Let u be the sum of their voltages and
    i the difference of their currents; then

        v_a + v_b = (1 + e) u,     i_a + i_b = (1 - e) u / Zc,
        v_a - v_b = (1 - e) Zc i,  i_a - i_b = (1 + e) i.
    """
    (a, from_a), (b, from_b) = from_ends.items()
    less = waves.faded(length)  # 1 - e
    more = 2 - less
    aa, ab, bb = from_a[a], from_a[b], from_b[b]
    # m11 u + m12 i and m21 u + m22 i are the sum and the difference of the tree's v_a and v_b.
    m11, m12 = more + (aa + 2 * ab + bb) * less * waves.y0 / 2, (aa - bb) * more / 2
    m21, m22 = (aa - bb) * less * waves.y0 / 2, less * waves.z0 + (aa - 2 * ab + bb) * more / 2
    sum_v, difference = v[a] + v[b], v[a] - v[b]
    determinant = m11 * m22 - m12 * m21
    u = (m22 * sum_v - m12 * difference) / determinant
    i = (m11 * difference - m21 * sum_v) / determinant
    i_a, i_b = (less * waves.y0 * u + more * i) / 2, (less * waves.y0 * u - more * i) / 2
    return {node: v[node] - from_a[node] * i_a - from_b[node] * i_b for node in v}


def transfer(
    trees: Sequence[Rooted],
    pieces: Sequence[tuple[Cable, Quantity]],
    shunts: Floats,
    s: Complexes,
    ring: tuple[int, int, int] | None,
) -> dict[int, Complexes]:
    """Return the transfer impedance [ohm] between the root and each node of a network, by node.

    The first of `trees` begins at the root. `ring` is the index of the piece that closes a ring and
    of the nodes at its ends, at each of which one of `trees` must begin.
    """
    # Equal cables, lines and loads are computed once; lengths may differ by a rounding error.
    cables = {id(cable): cable for cable, _ in pieces}
    kinds = [
        (id(cable), f"{length:.13g}" if isinstance(length, float) else id(length))
        for cable, length in pieces
    ]
    waves = {one: Waves.of(cable, s) for one, cable in cables.items()}
    lengths = dict(zip(kinds, (length for _, length in pieces), strict=True))
    lines = {kind: waves[kind[0]].chain(length) for kind, length in lengths.items()}
    nodes = shunts.swapaxes(0, 1)
    keys = [load.tobytes() for load in nodes]
    unlike = dict(zip(keys, nodes, strict=True))
    loads = {key: _admittance(load, s) for key, load in unlike.items()}

    voltages = {}
    for order, parent, run in trees:
        v = fold(parent, [lines[kinds[k]] for k in run], [loads[keys[node]] for node in order])
        voltages[order[0]] = dict(zip(order, v, strict=True))
    from_root = voltages[trees[0].order[0]]
    if ring is None:
        return from_root
    closing, a, b = ring
    cable, length = pieces[closing]
    return close(from_root, {a: voltages[a], b: voltages[b]}, waves[id(cable)], length)


def _admittance(load: Floats, s: Complexes) -> Complexes:
    # For a single tree, the result has one axis: numpy adds such rows fastest.
    g, per_henry, c = load if load.shape[-1] == 1 else load[..., np.newaxis]
    return np.asarray(g + per_henry / s + c * s)
