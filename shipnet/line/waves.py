"""What the lines and loads of a network do at complex frequencies.

With e = exp(-gamma length), the hyperbolic functions of a line are C / 2e and S / 2e, where
C = 1 + e^2 and S = 1 - e^2: these two neither overflow on a long line nor lose digits on a short.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from shipnet.errors import ArgumentError

if TYPE_CHECKING:
    from shipnet.line.network import Network

__all__ = ["Lines", "admittances", "check_frequencies", "part_of_trees", "rows_of"]

Complexes = npt.NDArray[np.complex128]

#: Rows of an array: a view where they follow each other, or where one serves for all.
Rows = slice | npt.NDArray[np.intp]

#: Legal moduli of a complex frequency [rad/s].
_LOWEST, _HIGHEST = 1e-9, 1e15


def check_frequencies(s: npt.ArrayLike) -> Complexes:
    """Return complex frequencies as an array, or raise if one is out of range.

    Parameters
    ----------
    s : array_like of complex, shape (n_s,)
        Complex frequency, its modulus 1e-9 to 1e15, its real part not negative [rad/s].

    Returns
    -------
    ndarray of complex, shape (n_s,)
        The same.

    Raises
    ------
    ArgumentError
        If a frequency is out of range, or if they are not a row of at least one.

    Examples
    --------
    >>> check_frequencies([0j])
    Traceback (most recent call last):
        ...
    shipnet.errors.ArgumentError: s is 0+0j rad/s; its modulus must be 1e-09..1e+15 rad/s and its \
real part not negative
    """
    array = np.asarray(s)
    if array.dtype.kind not in "iufc" or array.ndim != 1 or array.size == 0:
        raise ArgumentError(
            f"s has shape {array.shape} and type {array.dtype}; it must be a row of numbers"
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
    """Return an index for some rows, a slice if the rows follow each other or are all the same.

    Parameters
    ----------
    numbers : list of int
        Rows, at least one.

    Returns
    -------
    slice or ndarray of int
        What picks them; rows that are all the same become one, for broadcasting.

    Examples
    --------
    >>> rows_of([4, 5, 6]), rows_of([4, 4])
    (slice(4, 7, None), slice(4, 5, None))
    """
    first, last = numbers[0], numbers[-1]
    if len(numbers) == 1 or all(number == first for number in numbers):
        return slice(first, first + 1)
    if numbers == list(range(first, last + 1)):
        return slice(first, last + 1)
    return np.array(numbers)


def part_of_trees(array: npt.NDArray[Any], trees: slice) -> npt.NDArray[Any]:
    """Return the part of an array that belongs to some trees of a Monte Carlo.

    Parameters
    ----------
    array : ndarray, shape (n, n_trees or 1, ...)
        Values that differ between the trees, or hold for all.
    trees : slice
        The trees.

    Returns
    -------
    ndarray, shape (n, trees or 1, ...)
        A view.

    Examples
    --------
    >>> part_of_trees(np.zeros((5, 1)), slice(2, 4)).shape
    (5, 1)
    """
    return array if array.shape[1] == 1 else array[:, trees]


class Lines:
    """The different lines of a network: each pair of a cable and a length is computed once.

    Parameters
    ----------
    network : Network
        The network.
    s : ndarray of complex, shape (n_s,)
        Complex frequencies [rad/s].

    Attributes
    ----------
    kind : list of int
        Number of the pair that each branch has.
    cable : list of int
        Number of the cable of each pair.
    trees : int
        Number of trees for which they differ, 1 if for none.

    Examples
    --------
    >>> from shipnet.line import CABLES, Network
    >>> net = Network()
    >>> for a, b, length in (("a", "b", 5), ("b", "c", 9), ("b", "d", 5)):
    ...     net.line(a, b, length, CABLES["as-i"])
    >>> Lines(net, np.array([1e6j])).kind
    [0, 1, 0]
    """

    def __init__(self, network: Network, s: Complexes) -> None:
        kinds: dict[tuple[int, float | int], int] = {}
        cables: dict[int, int] = {}
        length, z, y = [], [], []
        self.kind: list[int] = []
        self.cable: list[int] = []
        for _, _, metres, cable in network.branches:
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
        """Return 2 e, C, S, Yc [S] and Zc [ohm] of some kinds, each (kinds, trees, bins) or 1s."""
        cable = rows_of([self.cable[kind] for kind in kinds])
        length = part_of_trees(self._length, trees)[kinds]
        shrink = np.expm1(part_of_trees(self._loss, trees)[cable, :, bins] * -length)
        # Sine and cosine from the tangent of half the angle: a fifth of the time of a complex exp.
        tangent = np.tan(part_of_trees(self._phase, trees)[cable, :, bins] * (length / 2))
        sine = (2 + 2 * shrink) / (1 + tangent * tangent) * tangent
        x = np.empty(sine.shape, dtype=complex)
        x.real = shrink - sine * tangent
        x.imag = -sine
        # Now x = e - 1, and e^2 - 1 = x (x + 2).
        minus_s = x * (x + 2)
        y0, z0 = (part_of_trees(wave, trees)[cable, :, bins] for wave in (self._y0, self._z0))
        return 2 * x + 2, minus_s + 2, -minus_s, y0, z0


def admittances(
    shunts: npt.NDArray[np.float64], trees: slice, s: Complexes, out: Complexes | None = None
) -> Complexes:
    """Return what the loads at each node admit.

    Parameters
    ----------
    shunts : ndarray of float, shape (3, n_nodes, n_trees or 1)
        As `Network.shunts` returns them.
    trees : slice
        The trees of a Monte Carlo that are wanted.
    s : ndarray of complex, shape (n_s,)
        Complex frequencies [rad/s].
    out : ndarray of complex, shape (n_nodes, trees, n_s), optional
        Where to write the result.

    Returns
    -------
    ndarray of complex, shape (n_nodes, trees or 1, n_s)
        Admittances [S].

    Examples
    --------
    >>> admittances(np.array([[[0.01]], [[0.0]], [[1e-9]]]), slice(0, 1), np.array([1e6j]))
    array([[[0.01+0.001j]]])
    """
    conductance, per_henry, capacitance = (
        part_of_trees(kind, trees)[..., np.newaxis] for kind in shunts
    )
    y: Complexes = np.multiply(capacitance, s, out=out)
    y += conductance
    y += per_henry * (1 / s)
    return y
