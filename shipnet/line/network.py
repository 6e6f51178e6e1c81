"""A network as data: runs of cable between named nodes, loads at the nodes, at most one ring."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from itertools import pairwise
from math import ceil
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from shipnet.errors import ArgumentError
from shipnet.fields import Quantity, check_quantity, check_scalar, check_trees
from shipnet.line.cable import CABLES, Cable

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from shipnet.line.solver import OperatingPoint
    from shipnet.line.waveform import Waveform

#: Legal lengths [m]: a shorter line is a node, a longer one is not a field bus.
SHORTEST, LONGEST = 1e-6, 1e6

#: Legal values of a load [ohm, H, F].
LEAST, MOST = 1e-18, 1e18

Floats = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class CableRun:
    """A piece of cable between two nodes.

    Parameters
    ----------
    a, b : str
        Nodes at its ends, not the same.
    length : float or array_like, shape (n_trees,)
        Length, 1e-6 to 1e6 [m]. There is no run of length 0: its ends are one node.
    cable : str or Cable, default "as-i 1.5"
        What it is made of; a name is a key of `CABLES`.

    Raises
    ------
    ArgumentError
        If a node or the cable is unknown, or the length is out of range.

    Examples
    --------
    >>> run = CableRun("supply", "far", 100)
    >>> print(f"{run}: {run.made_of.z0:.0f} ohm")
    cable supply - far: 100 ohm
    """

    a: str
    b: str
    length: Quantity
    cable: str | Cable = "as-i 1.5"

    def __post_init__(self) -> None:
        """Check the ends, the length and the cable."""
        check_node(self.a)
        check_node(self.b)
        metres = check_quantity(f"length of {self}", self.length, "m", low=SHORTEST, high=LONGEST)
        object.__setattr__(self, "length", metres)
        if self.a == self.b:
            raise ArgumentError(f"{self} ends where it begins; its two nodes must differ")
        if not isinstance(self.cable, Cable) and self.cable not in CABLES:
            raise ArgumentError(
                f"cable of {self} is {self.cable!r}; it must be a Cable or one of "
                f"{', '.join(CABLES)}"
            )

    @property
    def made_of(self) -> Cable:
        """The cable, looked up in the catalogue if it was given by name."""
        return self.cable if isinstance(self.cable, Cable) else CABLES[self.cable]

    def __str__(self) -> str:
        """Name the run by its ends."""
        return f"cable {self.a} - {self.b}"


@dataclass(frozen=True, slots=True, eq=False)
class Load:
    """A resistor, an inductor and a capacitor in parallel, from a node to the reference.

    Parameters
    ----------
    r, l, c : float or array_like, shape (n_trees,), optional
        Resistance [ohm], inductance [H] and capacitance [F], 1e-18 to 1e18; at least one.

    Raises
    ------
    ArgumentError
        If a value is out of range or all are missing.

    Examples
    --------
    Loads at one node add up; a terminator is a load that is only a resistor.

    >>> Load(r=100, c=50e-12) + Load(r=100)
    Load(r=50.0, l=None, c=5e-11)
    """

    r: Quantity | None = None
    l: Quantity | None = None  # noqa: E741  # the symbol of an inductance
    c: Quantity | None = None

    def __post_init__(self) -> None:
        """Check the values."""
        if self.r is None and self.l is None and self.c is None:
            raise ArgumentError("a load has neither r nor l nor c; it must have at least one")
        for name, unit in (("r", "ohm"), ("l", "H"), ("c", "F")):
            value = getattr(self, name)
            if value is not None:
                value = check_quantity(f"{name} of a load", value, unit, low=LEAST, high=MOST)
                object.__setattr__(self, name, value)
        check_trees("a load", None, self.r, self.l, self.c)

    def __add__(self, other: Load) -> Load:
        """Return both loads in parallel."""
        if not isinstance(other, Load):
            return NotImplemented
        return Load(_parallel(self.r, other.r), _parallel(self.l, other.l), _sum(self.c, other.c))

    def _key(self) -> tuple[Any, ...]:
        values = (self.r, self.l, self.c)
        return tuple(tuple(v) if isinstance(v, np.ndarray) else v for v in values)

    def __eq__(self, other: object) -> bool:
        """Compare all values."""
        return isinstance(other, Load) and self._key() == other._key()

    def __hash__(self) -> int:
        """Hash all values."""
        return hash(self._key())

    @property
    def shunt(self) -> tuple[Quantity, Quantity, Quantity]:
        """What the load adds at its node: 1/r [S], 1/l [1/H] and c [F]."""
        return (
            0.0 if self.r is None else 1 / self.r,
            0.0 if self.l is None else 1 / self.l,
            0.0 if self.c is None else self.c,
        )


def _parallel(one: Quantity | None, other: Quantity | None) -> Quantity | None:
    if one is None or other is None:
        return other if one is None else one
    return 1 / (1 / one + 1 / other)


def _sum(one: Quantity | None, other: Quantity | None) -> Quantity | None:
    if one is None or other is None:
        return other if one is None else one
    return one + other


class Network:
    """Runs of cable between named nodes, with loads from the nodes to the reference conductor.

    Lengths, loads and the constants of cables may be arrays of shape (n_trees,): many networks
    of one shape, computed at once.

    Parameters
    ----------
    runs : iterable of CableRun
        The cables; together they make a tree, or a tree with one ring.
    loads : mapping of str to Load, optional
        What is connected at the nodes.

    Raises
    ------
    ArgumentError
        If two runs join the same nodes, a run would close a second ring, or arrays have different
        numbers of trees.

    Examples
    --------
    A supply with its decoupling network, and a slave 100 m away. At 167 kHz, a current that the
    slave draws makes this voltage at the supply, per ampere:

    >>> net = Network(
    ...     [CableRun("supply", "slave", 100, "as-i 1.5")],
    ...     {"supply": Load(r=78, l=100e-6), "slave": Load(r=13.5e3, l=13.5e-3, c=50e-12)},
    ... )
    >>> z = net.transfer("slave", [2j * np.pi * 167e3], to="supply")
    >>> print(f"{abs(z[0]):.1f} ohm")
    97.6 ohm
    >>> net.operating_point("supply", 30, {"slave": 1.0}).voltage
    {'supply': 30.0, 'slave': 27.3}
    """

    def __init__(
        self, runs: Iterable[CableRun] = (), loads: Mapping[str, Load] | None = None
    ) -> None:
        self.runs = tuple(runs)
        self.loads = dict(loads or {})
        self._index: dict[str, int] = {}
        self._near: list[list[tuple[int, int]]] = []
        self._ring: int | None = None
        group: list[int] = []
        ends: set[tuple[int, int]] = set()
        trees: int | None = None
        cables: set[int] = set()
        for number, run in enumerate(self.runs):
            i, j = self._number(run.a), self._number(run.b)
            group += range(len(group), len(self._index))
            pair = (i, j) if i < j else (j, i)
            if pair in ends:
                raise ArgumentError(f"{run} lies there already; two nodes have at most one cable")
            ends.add(pair)
            one, other = _leader(group, i), _leader(group, j)
            if one == other:
                if self._ring is not None:
                    raise ArgumentError(
                        f"{run} would close a second ring, after {self.runs[self._ring]}; "
                        "a network has at most one"
                    )
                self._ring = number
            group[one] = other
            self._near[i].append((j, number))
            self._near[j].append((i, number))
            if not isinstance(run.length, float):
                trees = check_trees(str(run), trees, run.length)
            if id(run.cable) not in cables:
                cables.add(id(run.cable))
                trees = check_trees(str(run), trees, *run.made_of.parameters)
        for node, load in self.loads.items():
            check_node(node)
            if not isinstance(load, Load):
                raise ArgumentError(f"load at node {node!r} is {load!r}; it must be a Load")
            trees = check_trees(f"load at node {node!r}", trees, *load.shunt)
            self._number(node)
        self._trees = trees

    def _number(self, name: str) -> int:
        if name not in self._index:
            self._index[name] = len(self._index)
            self._near.append([])
        return self._index[name]

    def __repr__(self) -> str:
        """Count what it is made of."""
        shape = "tree" if self._ring is None else "ring"
        many = "" if self._trees is None else f", {self._trees} at once"
        return f"<Network: {shape} of {len(self.nodes)} nodes, {len(self.loads)} loads{many}>"

    @property
    def nodes(self) -> tuple[str, ...]:
        """Names of the nodes: those of the runs in their order, then those with loads only."""
        return tuple(self._index)

    @property
    def ring(self) -> CableRun | None:
        """The run that closed a ring, None for a tree."""
        return None if self._ring is None else self.runs[self._ring]

    @property
    def trees(self) -> int | None:
        """Number of trees of a Monte Carlo, None for a single one."""
        return self._trees

    def index(self, name: str) -> int:
        """Return the number of a node, which is its row in every result."""
        try:
            return self._index[name]
        except (KeyError, TypeError):
            known = ", ".join(map(repr, self._index)) or "none yet"
            raise ArgumentError(f"node {name!r} is unknown; the nodes are {known}") from None

    def shunts(self) -> Floats:
        """Return 1/r [S], 1/l [1/H] and c [F] at each node, shape (3, n_nodes, n_trees or 1)."""
        if all(type(v) is float for load in self.loads.values() for v in load.shunt):
            sums = np.zeros((3, len(self._index), 1))
        else:
            sums = np.zeros((3, len(self._index), self._trees or 1))
        for node, load in self.loads.items():
            for kind, value in enumerate(load.shunt):
                sums[kind, self._index[node]] = value
        return sums

    def neighbours(self, node: int) -> list[tuple[int, int]]:
        """Return number of each neighbour and of the run to it, without the ring's last run."""
        return [(near, number) for near, number in self._near[node] if number != self._ring]

    def transfer(
        self, root: str, s: npt.ArrayLike, to: str | None = None
    ) -> npt.NDArray[np.complex128]:
        """Return the transfer impedances between one node and every node, or one other [ohm].

        Row k is the voltage at node k per ampere into the root, and as well the voltage at the
        root per ampere into node k: such a network is reciprocal. `s` is one or more complex
        frequencies with a real part that is not negative [rad/s]. A tree takes a time that is
        proportional to nodes x frequencies; a ring needs a dense solution.
        """
        from shipnet.line import solver

        solve = solver.tree_transfer if self._ring is None else solver.dense_transfer
        z = solve(self, root, s)
        return z if to is None else z[..., self.index(to), :]

    def waveforms(
        self,
        root: str,
        spectrum: Callable[[npt.NDArray[np.complex128]], npt.ArrayLike],
        duration: float,
        *,
        dt: float = 50e-9,
        f_max: float = 3e6,
    ) -> Waveform:
        """Return the voltages at all nodes while a current flows into one of them.

        `spectrum` is the Laplace transform of the current [A s] as a function of the complex
        frequency [rad/s]; what it has above `f_max` [Hz] is cut off.
        """
        from shipnet.line.laplace import laplace_grid, synthesize
        from shipnet.line.waveform import Waveform

        n = round(duration / check_scalar("dt", dt, "s", 1e-15, 1e6))
        s = laplace_grid(n * dt, f_max)
        u = synthesize(self.transfer(root, s) * np.asarray(spectrum(s)), n, n * dt)
        return Waveform(u, dt, names=self.nodes)

    def operating_point(
        self,
        supply: str,
        voltage: npt.ArrayLike,
        currents: Mapping[str, npt.ArrayLike],
        *,
        resistance: npt.ArrayLike = 0.0,
    ) -> OperatingPoint:
        """Return all voltages [V] and currents [A] at DC, while nodes draw `currents` [A].

        The supply has an open-circuit `voltage` [V] and an inner `resistance` [ohm]; cables
        count with their resistance at direct current, and loads do not count.
        """
        from shipnet.line.solver import operating_point

        return operating_point(self, supply, voltage, currents, resistance=resistance)

    def subdivided(self, longest: float) -> Network:
        """Return the same network with every run cut into equal sections of at most `longest` [m].

        The nodes between the sections are named ``a-b:1``, ``a-b:2`` ... from end a to end b.
        """
        limit = check_scalar("longest", longest, "m", 1e-3, LONGEST)
        fine = []
        for run in self.runs:
            # 0.3 / 0.1 and the like must not make a section more by rounding.
            sections = ceil(np.max(run.length / limit) - 1e-9)
            stops = [run.a, *(f"{run.a}-{run.b}:{k}" for k in range(1, sections)), run.b]
            length = run.length / sections
            fine += [CableRun(start, stop, length, run.cable) for start, stop in pairwise(stops)]
        return Network(fine, self.loads)

    def plot(self, ax: Axes | None = None, *, root: str | None = None) -> Axes:
        """Draw the network: cables to scale along x from the root, loads as filled dots."""
        from shipnet.line.plot import plot_network

        return plot_network(self, root=root, ax=ax)


def check_node(name: object) -> None:
    """Raise unless a name of a node is one that a file can give back."""
    if not isinstance(name, str) or not name or name != name.strip() or not name.isprintable():
        raise ArgumentError(
            f"a node is {name!r}; it must be a printable name without blanks around it"
        )


def _leader(group: list[int], node: int) -> int:
    while group[node] != node:
        group[node] = node = group[group[node]]
    return node
