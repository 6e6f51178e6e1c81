"""Networks: runs of cable between named nodes, with loads at the nodes and at most one ring."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from operator import add
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from shipnet import fields, style
from shipnet.arrays import Floats
from shipnet.errors import ArgumentError
from shipnet.fields import Quantity, check_fields, check_quantity, check_trees, record
from shipnet.lazy import Axes
from shipnet.line.cable import CABLES, Cable
from shipnet.line.solver import Rooted, check_frequencies, fold, transfer

#: Legal lengths [m]: a shorter run would in effect be a single node, and no field bus is longer.
SHORTEST, LONGEST = 1e-6, 1e6

#: Legal values of a load [ohm, H, F].
LEAST, MOST = 1e-18, 1e18

#: Number of trees times frequencies that are computed at a time, to bound the memory for lines.
_BLOCK = 1 << 13

#: Largest magnitude of DC current and voltage [A, V].
_MOST_DC = 1e9


def _constant(unit: str, help: str) -> Any:
    return fields.number(LEAST, MOST, unit, help, default=None, optional=True, many=True)


@dataclass(frozen=True, slots=True)
class CableRun:
    """A piece of cable between two nodes.

    Parameters
    ----------
    a, b : str
        Nodes at its two ends, which must differ.
    length : float or array_like, shape (n_trees,)
        Length, 1e-6 to 1e6 [m]; the ends of a run of length 0 would be one node.
    cable : str or Cable, default "as-i 1.5"
        The cable, or its key in `CABLES`.

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
        check_node(self.a)
        check_node(self.b)
        metres = check_quantity(f"length of {self}", self.length, "m", low=SHORTEST, high=LONGEST)
        object.__setattr__(self, "length", metres)
        if self.a == self.b:
            raise ArgumentError(f"{self} ends where it begins; its two nodes must differ")
        if not isinstance(self.cable, Cable) and self.cable not in CABLES:
            raise ArgumentError(
                f"the type of {self} is {self.cable!r}; it must be a Cable or one of "
                f"{', '.join(CABLES)}"
            )

    @property
    def made_of(self) -> Cable:
        """The cable, from the catalogue if it was given by name."""
        return self.cable if isinstance(self.cable, Cable) else CABLES[self.cable]

    def __str__(self) -> str:
        return f"cable {self.a} - {self.b}"


@record
class Load:
    """A resistor, an inductor and a capacitor in parallel, from a node to the reference conductor.

    At least one of them must be given. A terminator is a load with a resistor only.

    Examples
    --------
    >>> Load(r=100, c=50e-12) + Load(r=100)
    Load(r=50.0, l=None, c=5e-11)
    """

    r: Quantity | None = _constant("ohm", "Resistance")
    l: Quantity | None = _constant("H", "Inductance")  # noqa: E741  # its symbol
    c: Quantity | None = _constant("F", "Capacitance")

    def __post_init__(self) -> None:
        check_fields(self)
        if self.r is None and self.l is None and self.c is None:
            raise ArgumentError("a load has neither r nor l nor c; it must have at least one")
        check_trees("a load", None, *self.parameters)

    @property
    def parameters(self) -> tuple[Quantity | None, ...]:
        """The constants r, l and c."""
        return self.r, self.l, self.c

    def __add__(self, other: Load) -> Load:
        """Return the load that is equivalent to both loads in parallel."""
        if not isinstance(other, Load):
            return NotImplemented

        def parallel(one: Quantity, second: Quantity) -> Quantity:
            return 1 / (1 / one + 1 / second)

        return Load(
            _joined(self.r, other.r, parallel),
            _joined(self.l, other.l, parallel),
            _joined(self.c, other.c, add),
        )

    @property
    def shunt(self) -> tuple[Quantity, Quantity, Quantity]:
        """Constants of the load that add up at a node: 1/r [S], 1/l [1/H] and c [F]."""
        return (
            0.0 if self.r is None else 1 / self.r,
            0.0 if self.l is None else 1 / self.l,
            0.0 if self.c is None else self.c,
        )


def _joined(
    one: Quantity | None, other: Quantity | None, join: Callable[[Quantity, Quantity], Quantity]
) -> Quantity | None:
    if one is None or other is None:
        return other if one is None else one
    return join(one, other)


class Layout(NamedTuple):
    """Positions of the nodes of a network in a drawing."""

    spot: Floats  # distance from the root along the cable [m], and row, 0 or negative
    strokes: list[Floats]  # points of each run: x in the first row, y in the second
    closing: Floats | None  # the same for the run that closes a ring

    @property
    def lowest(self) -> float:
        """Lowest y of the drawing."""
        everything = [self.spot[:, 1], *([] if self.closing is None else [self.closing[1]])]
        return float(np.concatenate(everything).min())


class Network:
    """Runs of cable between named nodes, with loads from the nodes to the reference conductor.

    Lengths and the constants of cables and loads may be arrays of shape (n_trees,): these define
    many networks with the same topology, which are computed together.

    Parameters
    ----------
    runs : iterable of CableRun
        Cables that form a tree or a tree with one ring; at most one cable may join any two nodes.
    loads : mapping of str to Load, optional
        The loads at the nodes.

    Examples
    --------
    A supply with its decoupling network, and a slave 100 m away. A current of 1 A at 167 kHz drawn
    by the slave causes this voltage at the supply:

    >>> net = Network(
    ...     [CableRun("supply", "slave", 100, "as-i 1.5")],
    ...     {"supply": Load(r=78, l=100e-6), "slave": Load(r=13.5e3, l=13.5e-3, c=50e-12)},
    ... )
    >>> z = net.transfer("slave", [2j * np.pi * 167e3], to="supply")
    >>> print(f"{abs(z[0]):.1f} ohm")
    97.6 ohm
    >>> net.operating_point("supply", 30, {"slave": 1.0})
    {'supply': 30.0, 'slave': 27.3}
    """

    def __init__(
        self, runs: Iterable[CableRun] = (), loads: Mapping[str, Load] | None = None
    ) -> None:
        self.runs = tuple(runs)
        self.loads = dict(loads or {})
        self._index: dict[str, int] = {}
        self._ring: int | None = None
        ends: set[tuple[int, int]] = set()
        group = list(range(2 * len(self.runs)))
        trees: int | None = None
        checked: set[int] = set()
        for number, run in enumerate(self.runs):
            pair = i, j = self._number(run.a), self._number(run.b)
            if pair in ends:
                raise ArgumentError(f"{run} joins two nodes that another cable already joins")
            ends |= {pair, (j, i)}
            one, other = _leader(group, i), _leader(group, j)
            if one == other:
                if self._ring is not None:
                    raise ArgumentError(
                        f"{run} would close a second ring, after the one closed by "
                        f"{self.runs[self._ring]}; a network has at most one"
                    )
                self._ring = number
            group[one] = other
            if not isinstance(run.length, float):
                trees = check_trees(str(run), trees, run.length)
            if id(run.cable) not in checked:
                checked.add(id(run.cable))
                trees = check_trees(str(run), trees, *run.made_of.parameters)
        for node, load in self.loads.items():
            check_node(node)
            if not isinstance(load, Load):
                raise ArgumentError(f"load at node {node!r} is {load!r}; it must be a Load")
            if id(load) not in checked:
                checked.add(id(load))
                trees = check_trees(f"load at node {node!r}", trees, *load.parameters)
            self._number(node)
        self._trees = trees

    def _number(self, name: str) -> int:
        return self._index.setdefault(name, len(self._index))

    def __repr__(self) -> str:
        shape = "tree" if self._ring is None else "ring"
        many = "" if self._trees is None else f", {self._trees} at once"
        return f"<Network: {shape} of {len(self.nodes)} nodes, {len(self.loads)} loads{many}>"

    @property
    def nodes(self) -> tuple[str, ...]:
        """Names of the nodes in the order of the runs, then those that occur only in `loads`."""
        return tuple(self._index)

    @property
    def ring(self) -> CableRun | None:
        """The run that closes the ring; None for a tree."""
        return None if self._ring is None else self.runs[self._ring]

    @property
    def trees(self) -> int | None:
        """Number of trees of a Monte Carlo simulation; None for a single tree."""
        return self._trees

    def index(self, name: str, what: str = "name") -> int:
        """Return the index of a node, its row in results; `what` names the argument in errors."""
        try:
            return self._index[name]
        except (KeyError, TypeError):
            names = ", ".join(map(repr, self._index)) or "none yet"
            raise ArgumentError(f"{what} is {name!r}; the nodes are {names}") from None

    def shunts(self) -> Floats:
        """Return 1/r [S], 1/l [1/H] and c [F] at each node, shape (3, n_nodes, n_trees or 1)."""
        values = [value for load in self.loads.values() for value in load.shunt]
        single = all(type(value) is float for value in values)
        trees = 1 if single else self._trees or 1
        columns = np.array(values if single else [np.full(trees, value) for value in values])
        sums = np.zeros((3, len(self._index), trees))
        loaded = [self._index[node] for node in self.loads]
        sums[:, loaded] = columns.reshape(-1, 3, trees).swapaxes(0, 1)
        return sums

    def rooted(self, root: str) -> Rooted:
        """Return the network as a tree with a root."""
        if not self.runs:
            raise ArgumentError("the network has no cable; it must have at least one")
        near: list[list[tuple[int, int]]] = [[] for _ in self._index]
        for number, run in enumerate(self.runs):
            i, j = self._index[run.a], self._index[run.b]
            near[i].append((j, number))
            near[j].append((i, number))
        order, parent, above = [self.index(root, "root")], [-1], [-1]
        for index, here in enumerate(order):
            for node, number in near[here]:
                if number not in (above[index], self._ring):
                    order.append(node)
                    parent.append(index)
                    above.append(number)
        if len(order) < len(self.nodes):
            reached = set(order)
            lost = [repr(name) for node, name in enumerate(self.nodes) if node not in reached]
            raise ArgumentError(f"no cable leads from node {root!r} to {', '.join(lost)}")
        return Rooted(order, parent, above)

    #: How `transfer` computes a tree, as plain numbers or arrays.
    fold = staticmethod(fold)

    def transfer(
        self, root: str, s: npt.ArrayLike, to: str | None = None
    ) -> npt.NDArray[np.complex128]:
        """Return the transfer impedances [ohm] between the root and every node, or only node `to`.

        Row k is the voltage at node k per ampere into the root and, because the network is
        reciprocal, the voltage at the root per ampere into node k. `s` contains complex frequencies
        [rad/s]; no real part may be negative. A ring takes two or three times as long as a tree.
        """
        bins = check_frequencies(s)
        pieces, shunts = [(run.made_of, run.length) for run in self.runs], self.shunts()
        roots, ring = [root], None
        if self._ring is not None:
            a, b = self.runs[self._ring].a, self.runs[self._ring].b
            roots, ring = [root, a, b], (self._ring, self.index(a), self.index(b))
        trees = [self.rooted(node) for node in dict.fromkeys(roots)]
        z = np.empty((len(self.nodes), self._trees or 1, bins.size), dtype=complex)
        step = max(1, _BLOCK // (self._trees or 1))
        for part in (slice(k, k + step) for k in range(0, bins.size, step)):
            for node, v in transfer(trees, pieces, shunts, bins[part], ring).items():
                z[node, :, part] = v
        z = z.swapaxes(0, 1) if self._trees else z[:, 0]
        return z if to is None else z[..., self.index(to, "to"), :]

    def operating_point(
        self, supply: str, voltage: npt.ArrayLike, currents: Mapping[str, npt.ArrayLike]
    ) -> dict[str, Quantity]:
        """Return the DC voltage at each node [V] when nodes draw the given `currents` [A].

        The supply keeps its node at `voltage` [V]; loads are ignored. All voltages are NaN if the
        currents cannot flow: somewhere, the cables would drop more than the supply's voltage.
        """
        self.index(supply, "supply")
        tree = self.rooted(supply)
        emf = check_quantity("voltage of the supply", voltage, "V", low=-_MOST_DC, high=_MOST_DC)
        draws = {
            self.index(node, "one of currents"): check_quantity(
                f"current drawn at node {node!r}", current, "A", low=-_MOST_DC, high=_MOST_DC
            )
            for node, current in currents.items()
        }
        trees = check_trees("the supply or a current", self.trees, emf, *draws.values())

        drawn = np.zeros((len(self.nodes), trees or 1))
        for node, draw in draws.items():
            drawn[node] = draw
        ohms = np.zeros((len(self.runs), trees or 1))
        for number, run in enumerate(self.runs):
            ohms[number] = np.multiply(run.made_of.resistance, run.length)

        drop = _drop(tree, drawn, ohms)
        if self.ring is not None:
            # The voltages around the ring add up to 0, which determines the closing run's current.
            ring = self.runs.index(self.ring)
            a, b = (tree.order.index(self.index(end)) for end in (self.ring.a, self.ring.b))
            around = np.zeros_like(drawn)
            around[[tree.order[a], tree.order[b]]] = [[1.0], [-1.0]]
            ring_drop = _drop(tree, around, ohms)
            loop = ohms[ring] + ring_drop[a] - ring_drop[b]
            if np.any(loop == 0):
                raise ArgumentError(
                    f"the ring closed by {self.ring} has no resistance; at least one of its cables "
                    "needs r greater than 0"
                )
            drop = drop + (drop[b] - drop[a]) / loop * ring_drop
        volts = np.empty_like(drop)
        volts[tree.order] = emf - drop
        volts[:, np.any(volts * np.sign(emf) < 0, axis=0)] = np.nan
        return dict(zip(self.nodes, volts[:, 0].tolist() if trees is None else volts, strict=True))

    def layout(self, root: str | None = None) -> Layout:
        """Place the nodes, with cables to scale along x and branches in separate rows."""
        tree = self.rooted(root or next(iter(self.nodes), ""))
        count = len(tree.order)
        length = [float(np.mean(run.length)) for run in self.runs]
        children: list[list[int]] = [[] for _ in range(count)]
        x, reach = [0.0] * count, [0.0] * count
        for node in range(1, count):
            children[tree.parent[node]].append(node)
            x[node] = x[tree.parent[node]] + length[tree.run[node]]
        for node in range(count - 1, 0, -1):
            way = reach[node] + length[tree.run[node]]
            reach[tree.parent[node]] = max(reach[tree.parent[node]], way)

        # A node's longest branch stays in its row; others get rows below, so that no lines cross.
        row, lowest, waiting = [0] * count, 0, [(0, 0)]
        while waiting:
            node, beside = waiting.pop()
            lowest -= beside
            row[node] = lowest if beside or node == 0 else row[tree.parent[node]]
            ahead = sorted(children[node], key=lambda child: reach[child] + x[child], reverse=True)
            waiting += [(child, int(child != ahead[0])) for child in reversed(ahead)]

        strokes = []
        for node in range(1, count):
            near = tree.parent[node]
            stroke = [[x[near], x[near], x[node]], [row[near], row[node], row[node]]]
            strokes.append(np.array(stroke, dtype=float))
        closing = None
        if self.ring is not None:
            a, b = (tree.order.index(self.index(end)) for end in (self.ring.a, self.ring.b))
            below = lowest - 1
            closing = np.array(
                [[x[a], x[a], x[b], x[b]], [row[a], below, below, row[b]]], dtype=float
            )
        spot = np.empty((count, 2))
        spot[tree.order] = np.transpose([x, row])
        return Layout(spot, strokes, closing)

    @style.applied
    def plot(self, ax: Axes | None = None, *, root: str | None = None) -> Axes:
        """Draw the network: cables to scale along x from the root, a filled dot at each load."""
        ax = style.axes(ax)
        placed = self.layout(root)
        for stroke in placed.strokes:
            ax.plot(*stroke, color="C0")
        if placed.closing is not None:
            ax.plot(*placed.closing, color="C0", ls="--")
        loaded = np.asarray(self.shunts().any(axis=(0, 2)))
        for name, spot, filled in zip(self.nodes, placed.spot, loaded, strict=True):
            face = "C0" if filled else "white"
            ax.plot(*spot, "o", color="C0", markerfacecolor=face, markersize=5)
            ax.annotate(
                style.literal(name), tuple(spot), (0, 6), textcoords="offset points", ha="center"
            )
        ax.spines["left"].set_visible(False)
        ax.margins(x=0.1)
        ax.set(xlabel="distance along the cable [m]", yticks=[], ylim=(placed.lowest - 0.6, 0.8))
        return ax


def _drop(tree: Rooted, drawn: Floats, resistance: Floats) -> Floats:
    """Return the voltage drop from the root of a tree to each node [V], in tree order."""
    flow = drawn[tree.order]
    for node in range(len(flow) - 1, 0, -1):
        flow[tree.parent[node]] += flow[node]
    drop = np.zeros_like(flow)
    for node in range(1, len(flow)):
        across = resistance[tree.run[node]] * flow[node]
        drop[node] = drop[tree.parent[node]] + across
    return drop


def check_node(name: object) -> None:
    """Raise ArgumentError unless a node's name can be written to a file and read again."""
    if not isinstance(name, str) or not name or name != name.strip() or not name.isprintable():
        raise ArgumentError(
            f"a node is {name!r}; it must be a printable name without leading or trailing spaces"
        )


def _leader(group: list[int], node: int) -> int:
    while group[node] != node:
        group[node] = node = group[group[node]]
    return node
