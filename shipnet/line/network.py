"""A network of cable: branches between named nodes, loads at them, at most one ring."""

from __future__ import annotations

from itertools import pairwise
from math import ceil
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from shipnet.errors import ArgumentError
from shipnet.fields import Quantity, check_quantity, check_scalar, check_trees
from shipnet.line import nodal, tree
from shipnet.line.cable import Cable

__all__ = ["Branch", "Network"]

#: Legal lengths [m]: a shorter line is a node, a longer one no field bus.
SHORTEST, LONGEST = 1e-6, 1e6

#: Legal values of a load [ohm, H, F].
LEAST, MOST = 1e-18, 1e18


class Branch(NamedTuple):
    """A line between two nodes.

    Attributes
    ----------
    a, b : str
        Nodes at its ends.
    length : float or ndarray, shape (n_trees,)
        Length [m].
    cable : Cable
        What it is made of.
    """

    a: str
    b: str
    length: Quantity
    cable: Cable

    def __str__(self) -> str:
        """Name the branch by its ends."""
        return f"line {self.a!r}-{self.b!r}"


class Network:
    """Cables between named nodes, with loads from the nodes to the reference conductor.

    A node comes to be when it is first named. Lengths, loads and the parameters of cables may be
    arrays of shape (n_trees,): many networks of one shape, computed at once.

    Attributes
    ----------
    branches : tuple of Branch
        Lines in the order in which they were laid.
    ring : Branch or None
        The line that closed a ring; None for a tree.

    Examples
    --------
    A power supply with its decoupling network, and a slave 100 m away. At 167 kHz, a current
    drawn by the slave makes this voltage at the supply, per ampere:

    >>> net = Network()
    >>> net.load("supply", r=78, l=100e-6)
    >>> net.line("supply", "slave", 100, Cable(0.06, 0.65e-6, 65e-12))
    >>> net.load("slave", r=13.5e3, l=13.5e-3, c=50e-12)
    >>> z = net.transfer("slave", [2j * np.pi * 167e3])
    >>> print(f"{abs(z[net.index('supply'), 0]):.1f} ohm")
    97.6 ohm
    """

    def __init__(self) -> None:
        self._index: dict[str, int] = {}
        self._branches: list[Branch] = []
        self._ends: dict[tuple[int, int], int] = {}
        self._near: list[list[tuple[int, int]]] = []
        self._group: list[int] = []
        self._loads: list[list[Quantity]] = []
        self._ring: int | None = None
        self._trees: int | None = None

    def line(self, a: str, b: str, length: npt.ArrayLike, cable: Cable) -> None:
        """Lay a cable between two nodes.

        Parameters
        ----------
        a, b : str
            Nodes at its ends, not the same.
        length : float or array_like, shape (n_trees,)
            Length, 1e-6 to 1e6 [m]. There is no line of length 0: its ends are one node.
        cable : Cable
            What it is made of.

        Raises
        ------
        ArgumentError
            If an argument is out of range, if the two nodes are joined already, or if the line
            would close a second ring; the network stays as it was.
        """
        _check_name(a)
        _check_name(b)
        title = f"line {a!r}-{b!r}"
        if not isinstance(cable, Cable):
            raise ArgumentError(f"cable of {title} is {cable!r}; it must be a Cable")
        metres = check_quantity(f"length of {title}", length, "m", low=SHORTEST, high=LONGEST)
        if a == b:
            raise ArgumentError(f"{title} ends where it begins; its two nodes must differ")
        pair = (self._index.get(a, -1), self._index.get(b, -1))
        if pair in self._ends or pair[::-1] in self._ends:
            raise ArgumentError(f"{title} lies there already; two nodes have at most one line")
        closes = min(pair) >= 0 and self._leader(pair[0]) == self._leader(pair[1])
        if closes and self._ring is not None:
            raise ArgumentError(
                f"{title} would close a second ring, after {self._branches[self._ring]}; "
                "a network has at most one"
            )
        self._trees = check_trees(title, self._trees, metres, *cable.parameters)

        number, i, j = len(self._branches), self._number(a), self._number(b)
        if closes:
            self._ring = number
        self._branches.append(Branch(a, b, metres, cable))
        self._ends[i, j] = number
        self._near[i].append((j, number))
        self._near[j].append((i, number))
        self._group[self._leader(i)] = self._leader(j)

    def load(
        self,
        node: str,
        r: npt.ArrayLike | None = None,
        l: npt.ArrayLike | None = None,  # noqa: E741  # the symbol of an inductance
        c: npt.ArrayLike | None = None,
    ) -> None:
        """Connect a resistor, an inductor and a capacitor in parallel, from a node to reference.

        Parameters
        ----------
        node : str
            Where; several loads at a node add up.
        r, l, c : float or array_like, shape (n_trees,), optional
            Resistance [ohm], inductance [H] and capacitance [F], 1e-18 to 1e18; at least one.

        Raises
        ------
        ArgumentError
            If a value is out of range or all are missing; the network stays as it was.
        """
        _check_name(node)
        if r is None and l is None and c is None:
            raise ArgumentError(f"load at node {node!r} has neither r nor l nor c")
        where = f"of the load at node {node!r}"
        conductance: Quantity = 0.0
        per_henry: Quantity = 0.0
        capacitance: Quantity = 0.0
        if r is not None:
            conductance = 1 / check_quantity(f"r {where}", r, "ohm", low=LEAST, high=MOST)
        if l is not None:
            per_henry = 1 / check_quantity(f"l {where}", l, "H", low=LEAST, high=MOST)
        if c is not None:
            capacitance = check_quantity(f"c {where}", c, "F", low=LEAST, high=MOST)
        self._trees = check_trees(
            f"load at node {node!r}", self._trees, conductance, per_henry, capacitance
        )
        load = self._loads[self._number(node)]
        load[0] = load[0] + conductance
        load[1] = load[1] + per_henry
        load[2] = load[2] + capacitance

    def terminator(self, node: str, r: npt.ArrayLike) -> None:
        """Connect a resistor from a node to reference.

        Parameters
        ----------
        node : str
            Where.
        r : float or array_like, shape (n_trees,)
            Resistance, positive [ohm]; equal to the wave impedance, it swallows every wave.

        Raises
        ------
        ArgumentError
            As `load`.
        """
        self.load(node, r=r)

    @property
    def nodes(self) -> tuple[str, ...]:
        """Names of the nodes, in the order in which they were first named."""
        return tuple(self._index)

    @property
    def branches(self) -> tuple[Branch, ...]:
        """Lines in the order in which they were laid."""
        return tuple(self._branches)

    @property
    def ring(self) -> Branch | None:
        """The line that closed a ring, None for a tree."""
        return None if self._ring is None else self._branches[self._ring]

    @property
    def trees(self) -> int | None:
        """Number of trees of a Monte Carlo, None for a single one."""
        return self._trees

    def index(self, name: str) -> int:
        """Return the number of a node, which is its row in every result.

        Parameters
        ----------
        name : str
            Name of the node.

        Returns
        -------
        int
            Its place in `nodes`.

        Raises
        ------
        ArgumentError
            If there is no such node.
        """
        try:
            return self._index[name]
        except (KeyError, TypeError):
            known = ", ".join(map(repr, self._index)) or "none yet"
            raise ArgumentError(f"node {name!r} is unknown; the nodes are {known}") from None

    def transfer(self, root: str, s: npt.ArrayLike) -> npt.NDArray[np.complex128]:
        """Return the transfer impedances between one node and every node.

        Parameters
        ----------
        root : str
            The one node.
        s : array_like of complex, shape (n_s,)
            Complex frequency, not 0, real part not negative [rad/s].

        Returns
        -------
        ndarray of complex, shape (n_nodes, n_s) or (n_trees, n_nodes, n_s)
            Row k is the voltage at node k for 1 A into the root, and as well the voltage at the
            root for 1 A into node k: such a network is reciprocal [ohm].

        Raises
        ------
        ArgumentError
            If the root is unknown, a node is connected to nothing, there is no line, or an `s`
            is out of range.

        Notes
        -----
        A tree takes one sweep from the leaves to the root and one back, in time proportional to
        nodes x frequencies; a ring takes `dense_transfer`.
        """
        if self._ring is not None:
            return nodal.dense_transfer(self, root, s)
        return tree.transfer(self, root, s)

    def dense_transfer(self, root: str, s: npt.ArrayLike) -> npt.NDArray[np.complex128]:
        """Return the same as `transfer` by a dense solution of the nodal equations.

        Parameters
        ----------
        root : str
            The one node.
        s : array_like of complex, shape (n_s,)
            As for `transfer`.

        Returns
        -------
        ndarray of complex, shape (n_nodes, n_s) or (n_trees, n_nodes, n_s)
            Transfer impedances [ohm].

        Raises
        ------
        ArgumentError
            As `transfer`.

        Notes
        -----
        Here the admittances of a line are infinite where it is a whole number of half waves
        long. A lossless cable on the imaginary axis meets this; `laplace_grid` avoids it.
        """
        return nodal.dense_transfer(self, root, s)

    def shunts(self) -> npt.NDArray[np.float64]:
        """Return what all the loads add up to at each node.

        Returns
        -------
        ndarray of float, shape (3, n_nodes, n_trees)
            Sums of 1/r [S], 1/l [1/H] and c [F]; the last axis is 1 long if no load varies.
        """
        if all(isinstance(value, float) for load in self._loads for value in load):
            return np.array(self._loads, dtype=float).T[:, :, np.newaxis]
        rows = [[np.broadcast_to(v, self._trees or 1) for v in load] for load in self._loads]
        return np.moveaxis(np.array(rows, dtype=float), 1, 0)

    def neighbours(self, node: int) -> list[tuple[int, int]]:
        """Return what lies around a node, but not over the branch that closed a ring.

        Parameters
        ----------
        node : int
            Number of the node.

        Returns
        -------
        list of tuple of int
            Number of a neighbour, and of the branch to it.
        """
        return [(near, number) for near, number in self._near[node] if number != self._ring]

    def subdivided(self, longest: float) -> Network:
        """Return the same network with every line cut into equal sections.

        Parameters
        ----------
        longest : float
            Length that no section exceeds, 1e-3 to 1e6 [m].

        Returns
        -------
        Network
            The nodes of this one first, by the same numbers; then those between the sections,
            named ``a-b:1``, ``a-b:2`` ... from end a to end b of their line.

        Raises
        ------
        ArgumentError
            If `longest` is out of range.

        Examples
        --------
        >>> net = Network()
        >>> net.line("a", "b", 30, Cable.lossless(100, 6.5e-9))
        >>> net.subdivided(10).nodes
        ('a', 'b', 'a-b:1', 'a-b:2')
        """
        limit = check_scalar("longest", longest, "m", 1e-3, LONGEST)
        fine = Network()
        for name, load in zip(self._index, self._loads, strict=True):
            fine._loads[fine._number(name)][:] = load
        fine._trees = self._trees
        for a, b, length, cable in self._branches:
            # 0.3 / 0.1 and the like must not make a section more by rounding.
            sections = ceil(np.max(length / limit) - 1e-9)
            stops = [a, *(f"{a}-{b}:{k}" for k in range(1, sections)), b]
            for start, stop in pairwise(stops):
                fine.line(start, stop, length / sections, cable)
        return fine

    def _number(self, name: str) -> int:
        if name not in self._index:
            self._group.append(len(self._index))
            self._index[name] = len(self._index)
            self._near.append([])
            self._loads.append([0.0, 0.0, 0.0])
        return self._index[name]

    def _leader(self, node: int) -> int:
        while self._group[node] != node:
            self._group[node] = node = self._group[self._group[node]]
        return node


def _check_name(name: str) -> None:
    if not isinstance(name, str) or not name:
        raise ArgumentError(f"node name is {name!r}; it must be a string, not empty")
