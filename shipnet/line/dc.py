"""The network at direct current: what voltage is left at the end of the cable.

Only the resistance of the cables counts. The loads of a network are models for signals, its
inductors would short the supply; currents are drawn by name instead.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from shipnet.errors import ArgumentError
from shipnet.fields import check_quantity, check_trees
from shipnet.line.network import Network
from shipnet.line.tree import Rooted, rooted

__all__ = ["OperatingPoint", "solve_dc"]

Floats = npt.NDArray[np.float64]

#: Legal currents and voltages, and minus that [A, V].
_MOST = 1e9


class OperatingPoint(NamedTuple):
    """Voltages and currents at direct current.

    Attributes
    ----------
    voltage : ndarray of float, shape (n_nodes,) or (n_trees, n_nodes)
        Voltage at each node, in the order of `Network.nodes` [V].
    current : ndarray of float, shape (n_branches,) or (n_trees, n_branches)
        Current in each line from its end a to its end b, in the order of `Network.branches` [A].
    """

    voltage: Floats
    current: Floats


def _flow(tree: Rooted, drawn: Floats, resistance: Floats) -> tuple[Floats, Floats]:
    """Return the current to each place and the drop from the root to it, without the ring."""
    flow = drawn[tree.order]
    for place in range(len(flow) - 1, 0, -1):
        flow[tree.parent[place]] += flow[place]
    drop = np.zeros_like(flow)
    for place in range(1, len(flow)):
        own = resistance[tree.branch[place]] * flow[place]
        drop[place] = drop[tree.parent[place]] + own
    return flow, drop


def solve_dc(
    network: Network,
    supply: str,
    voltage: npt.ArrayLike,
    currents: Mapping[str, npt.ArrayLike],
    *,
    resistance: npt.ArrayLike = 0.0,
) -> OperatingPoint:
    """Return the voltages at all nodes and the currents in all lines.

    Parameters
    ----------
    network : Network
        A tree, or a network with a ring. Its lines count with their loop resistance r times
        length, which may be 0; its loads do not count.
    supply : str
        Node of the power supply.
    voltage : float or array_like, shape (n_trees,)
        Voltage of the supply without load, -1e9 to 1e9 [V].
    currents : mapping of str to float or array_like, shape (n_trees,)
        Current that each node draws, whatever its voltage, -1e9 to 1e9 [A]; nodes not named draw
        none.
    resistance : float or array_like, shape (n_trees,), default 0
        Resistance of the supply, not negative [ohm].

    Returns
    -------
    OperatingPoint
        Voltage at each node and current in each line.

    Raises
    ------
    ArgumentError
        If a node is unknown or connected to nothing, a value is out of range, or no line of the
        ring has any resistance.

    Notes
    -----
    In a ring one current is left free; the voltages around the ring add up to 0 and settle it.

    Examples
    --------
    100 m of two cores of 1.5 mm2 lose 2.7 V at 1 A. Closed to a ring of 200 m, with the load in
    the middle, they lose half as much:

    >>> from shipnet.line import Cable
    >>> cable = Cable(r=0.027, l=0.65e-6, c=65e-12)
    >>> net = Network()
    >>> net.line("supply", "far", 100, cable)
    >>> solve_dc(net, "supply", 30, {"far": 1.0}).voltage.round(2).tolist()
    [30.0, 27.3]
    >>> net.line("far", "back", 99, cable)
    >>> net.line("back", "supply", 1, cable)
    >>> solve_dc(net, "supply", 30, {"far": 1.0}).voltage.round(2).tolist()
    [30.0, 28.65, 29.99]
    """
    tree = rooted(network, supply)
    emf = check_quantity("voltage of the supply", voltage, "V", low=-_MOST, high=_MOST)
    inner = check_quantity("resistance of the supply", resistance, "ohm", high=_MOST)
    draws = {
        network.index(node): check_quantity(
            f"current drawn at node {node!r}", current, "A", low=-_MOST, high=_MOST
        )
        for node, current in currents.items()
    }
    trees = check_trees("the supply or a current", network.trees, emf, inner, *draws.values())

    drawn = np.zeros((len(network.nodes), trees or 1))
    for node, draw in draws.items():
        drawn[node] = draw
    ohms = np.zeros((len(network.branches), trees or 1))
    for number, branch in enumerate(network.branches):
        ohms[number] = np.multiply(branch.cable.r, branch.length)

    flow, drop = _flow(tree, drawn, ohms)
    current = np.zeros_like(ohms)
    if network.ring is not None:
        ring = network.branches.index(network.ring)
        a, b = (tree.order.index(network.index(end)) for end in network.ring[:2])
        around = np.zeros_like(drawn)
        around[[tree.order[a], tree.order[b]]] = [[1.0], [-1.0]]
        ring_flow, ring_drop = _flow(tree, around, ohms)
        loop = ohms[ring] + ring_drop[a] - ring_drop[b]
        if np.any(loop == 0):
            raise ArgumentError(
                f"the ring closed by {network.ring} has no resistance; at least one of its cables "
                "needs r greater than 0"
            )
        current[ring] = (drop[b] - drop[a]) / loop
        flow = flow + current[ring] * ring_flow
        drop = drop + current[ring] * ring_drop

    for place in range(1, len(tree.order)):
        number = tree.branch[place]
        away = network.index(network.branches[number].b) == tree.order[place]
        current[number] = flow[place] if away else -flow[place]
    volts = np.empty_like(drop)
    volts[tree.order] = emf - inner * flow[0] - drop
    point = OperatingPoint(volts.T, current.T)
    return point if trees else OperatingPoint(*(values[0] for values in point))
