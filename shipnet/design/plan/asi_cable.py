"""One AS-i line: the way of its cable, the segments that repeaters make of it, their supplies.

What comes out is a `shipnet.asi.network.Plan`, so that it is checked by the rules of every other
installation.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.sparse import coo_array
from scipy.sparse.csgraph import shortest_path

from shipnet.asi.network import CableRun, Master, Plan, Repeater, Slave, Supply, rule_limits
from shipnet.asi.network.cables import cable_types
from shipnet.design.plan.settings import AsiLimits
from shipnet.design.plan.trunks import chain, tree

__all__ = ["Drawn", "Piece", "draw", "place_supply", "plan_of"]

#: The cable that the rules reckon with: 1.5 mm2, as any round cable of this area is much alike.
_CABLE = "as-i 1.5"

#: Shortest cable of a plan, and the least that is worth a cable before a repeater [m].
_SHORTEST, _WORTH = 0.01, 1.0

Floats = npt.NDArray[np.float64]


class Piece(NamedTuple):
    """A piece of cable between two nodes of a plan.

    Attributes
    ----------
    near, far : str
        Its nodes: ``"0"`` at the master, ``"3"`` at the third module, ``"0>3 1 in"`` and
        ``"0>3 1 out"`` at the first repeater on the way from one to the other, ``"3 out"`` behind
        a repeater beside a module.
    edge : (int, int)
        The places between which it lies.
    length : float
        Its length [m].
    share : float
        Its share of the cable between both places.
    """

    near: str
    far: str
    edge: tuple[int, int]
    length: float
    share: float


class Drawn(NamedTuple):
    """The cable of a line, before anything is connected.

    Attributes
    ----------
    pieces : list of Piece
        The cable; one is there before any that leaves its far end.
    repeaters : list of (str, str)
        Nodes of each repeater, the one toward the master first.
    depth : int
        Most repeaters between the master and a module.
    reach : float
        Longest way along the cable from the master to a module [m].
    """

    pieces: list[Piece]
    repeaters: list[tuple[str, str]]
    depth: int
    reach: float

    @property
    def length(self) -> float:
        """All of its cable [m]."""
        return sum(piece.length for piece in self.pieces)


class _Segment:
    """A segment while it is drawn: the cable in it [m], and the repeaters before it."""

    def __init__(self, depth: int) -> None:
        self.used, self.depth = 0.0, depth


def draw(ways: Floats, cable: Floats, limits: AsiLimits) -> Drawn:
    """Lead the cable of a line from the master past all modules.

    Parameters
    ----------
    ways, cable : ndarray, shape (n + 1, n + 1)
        Way and cable between any two places [m]; the first place is the master's.
    limits : AsiLimits
        Whether the cable may branch, and how long a segment is at most.

    Returns
    -------
    Drawn
        Where a segment would get too long a repeater begins another one: beside a module if the
        next cable fits into a segment of its own, on the way if it does not.

    Examples
    --------
    Modules 60 and 120 m away, and one 250 m on:

    >>> x = np.array([0.0, 60.0, 120.0, 370.0])
    >>> drawn = draw(abs(x - x[:, None]), abs(x - x[:, None]), AsiLimits())
    >>> for piece in drawn.pieces:
    ...     print(f"{piece.near} - {piece.far}: {piece.length:g} m")
    0 - 1: 60 m
    1 out - 2: 60 m
    2 - 2>3 1 in: 40 m
    2>3 1 out - 2>3 2 in: 100 m
    2>3 2 out - 2>3 3 in: 100 m
    2>3 3 out - 3: 10 m
    >>> drawn.repeaters[0], drawn.depth
    (('1', '1 out'), 4)
    """
    edges = tree(ways) if limits.tree else list(pairwise(chain(ways)))
    ends = {0: ("0", _Segment(0))}
    behind: dict[int, tuple[str, _Segment]] = {}
    reach = {0: 0.0}
    pieces: list[Piece] = []
    repeaters: list[tuple[str, str]] = []

    for near, far in edges:
        whole = left = max(float(cable[near, far]), _SHORTEST)
        reach[far] = reach[near] + whole
        node, segment = ends[near]
        fits = segment.used + whole <= limits.length
        if not fits and near in behind:
            room = limits.length - behind[near][1].used
            if whole <= room or (whole > limits.length and room >= _WORTH):
                node, segment = behind[near]
                fits = whole <= room
        long = whole > limits.length and limits.length - segment.used >= _WORTH
        if not fits and not long:
            repeaters.append((ends[near][0], f"{near} out"))
            node, segment = f"{near} out", _Segment(ends[near][1].depth + 1)
            if near in behind:  # a third segment from one place: a node cannot have one name twice
                node = f"{near} out {len(repeaters)}"
                repeaters[-1] = (ends[near][0], node)
            behind[near] = node, segment
        number = 0
        while left > limits.length - segment.used:
            number += 1
            length = limits.length - segment.used
            into, out = (f"{near}>{far} {number} {side}" for side in ("in", "out"))
            pieces.append(Piece(node, into, (near, far), length, length / whole))
            repeaters.append((into, out))
            segment.used = limits.length
            left -= length
            node, segment = out, _Segment(segment.depth + 1)
        pieces.append(Piece(node, str(far), (near, far), left, left / whole))
        segment.used += left
        ends[far] = str(far), segment
    depth = max(segment.depth for _, segment in ends.values())
    return Drawn(pieces, repeaters, depth, max(reach.values()))


def place_supply(
    pieces: Sequence[Piece], draws: dict[str, float], first: str, voltage: float
) -> str:
    r"""Return the node at which the supply of a segment stands.

    .. math:: \Delta U_j = R' \sum_i I_i \, \frac{d_{si} + d_{sj} - d_{ij}}{2}

    Parameters
    ----------
    pieces : sequence of Piece
        The cable of the segment, without rings.
    draws : dict of str to float
        Current that is drawn at each node that has a device [A].
    first : str
        Node of the master, or any other where the supply should stand if the voltage allows it;
        a name that is not in the segment if there is none.
    voltage : float
        Of the supply [V].

    Returns
    -------
    str
        `first`, or the node with a device from which the least voltage is lost on the way to the
        farthest device: two devices share the resistance of the way that they share.

    Examples
    --------
    A device of 1 A at the end of 100 m loses 2.7 V, two of them more than there is:

    >>> cable = [Piece("0", "1", (0, 1), 99.0, 1.0), Piece("1", "2", (1, 2), 1.0, 1.0)]
    >>> place_supply(cable, {"0": 0.0, "1": 0.0, "2": 1.0}, "0", 30.0)
    '0'
    >>> place_supply(cable, {"0": 0.0, "1": 1.0, "2": 1.0}, "0", 30.0)
    '1'
    """
    nodes = list(dict.fromkeys(node for piece in pieces for node in (piece.near, piece.far)))
    number = {node: place for place, node in enumerate(nodes)}
    near, far = (
        [number[node] for node in side]
        for side in zip(*((p.near, p.far) for p in pieces), strict=True)
    )
    graph = coo_array(([piece.length for piece in pieces], (near, far)), shape=(len(nodes),) * 2)
    away = shortest_path(graph.tocsr(), directed=False)
    current = np.array([draws.get(node, 0.0) for node in nodes])
    # Axes: supply, device, device; what both ways from the supply have in common.
    shared = (away[:, :, None] + away[:, None, :] - away[None]) / 2
    resistance = float(cable_types()[_CABLE].dc.r)
    drop = (resistance * shared @ current).max(axis=1, where=current > 0, initial=0.0)
    least = float(rule_limits()["lowest"]["slave_voltage"])
    if first in number and voltage - drop[number[first]] >= least:
        return first
    drop[[node not in draws for node in nodes]] = np.inf
    return nodes[int(drop.argmin())]


def plan_of(drawn: Drawn, slaves: Sequence[Slave], limits: AsiLimits) -> Plan:
    """Return the plan of a line, with a supply in each segment.

    Parameters
    ----------
    drawn : Drawn
        Its cable.
    slaves : sequence of Slave
        At the nodes ``"1"``, ``"2"`` and so on.
    limits : AsiLimits
        Current of master and repeaters, the supplies.

    Returns
    -------
    Plan
        With the master at ``"0"``.

    Examples
    --------
    >>> away = np.array([[0.0, 20.0], [20.0, 0.0]])
    >>> plan = plan_of(draw(away, away, AsiLimits()), [Slave("1", 1)], AsiLimits())
    >>> plan.supplies[0].node, plan.segments[0].length
    ('0', 20.0)
    """
    runs = [
        CableRun(piece.near, piece.far, max(piece.length, _SHORTEST), _CABLE)
        for piece in drawn.pieces
    ]
    master = Master("0", limits.current)
    repeaters = [Repeater(a, b, current=limits.current) for a, b in drawn.repeaters]
    bare = Plan(runs, [master], (), slaves, repeaters)
    supplies = []
    for segment in bare.segments:
        ends = {(run.a, run.b) for run in segment.cables}
        draws: dict[str, float] = {}
        for node, current in segment.draws:
            draws[node] = draws.get(node, 0.0) + current
        pieces = [piece for piece in drawn.pieces if (piece.near, piece.far) in ends]
        node = place_supply(pieces, draws, "0", limits.voltage)
        supplies.append(Supply(node, limits.voltage, limits.rating))
    return Plan(runs, [master], supplies, slaves, repeaters)
