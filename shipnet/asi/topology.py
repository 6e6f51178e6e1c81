"""Segments of the usual shapes: a straight line, a star at the end of a trunk, a ring.

A network of another shape is a `shipnet.line.Network` of its own, given to `Segment`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise

from shipnet.asi.segment import DEVICE, POWER_SUPPLY, Segment
from shipnet.errors import ArgumentError
from shipnet.line.cable import CABLES, Cable
from shipnet.line.network import CableRun, Load, Network

__all__ = ["ring", "star", "straight_line"]


def straight_line(
    length: float,
    slaves: Sequence[float],
    *,
    master: float = 0.0,
    supply: float = 0.0,
    cable: Cable = CABLES["as-i 1.5"],
    terminator: float | None = None,
) -> Segment:
    """Return a segment along one cable.

    Parameters
    ----------
    length : float
        Length of the cable [m].
    slaves : sequence of float
        Places of the slaves, 0..length [m].
    master, supply : float, default 0
        Places of the master and of the power supply [m].
    cable : shipnet.line.Cable, optional
        The nominal AS-i cable if omitted.
    terminator : float, optional
        Resistance across the far end, as an extension plug has it [ohm].

    Returns
    -------
    Segment
        Its nodes are called by their places: ``"0 m"``, ``"5 m"``.

    Raises
    ------
    ArgumentError
        If a place is not on the cable.

    Examples
    --------
    >>> straight_line(100, slaves=(5, 100)).slaves
    ('5 m', '100 m')
    """
    segment = star(length, (), along=slaves, master=master, supply=supply, cable=cable)
    if terminator is None:
        return segment
    network, end = segment.network, _node(length)
    ended = Network(network.runs, joined(network.loads, {end: Load(r=terminator)}))
    return Segment(ended, segment.master, segment.slaves)


def joined(*several: Mapping[str, Load]) -> dict[str, Load]:
    """Return loads by node, several at a node in parallel."""
    loads: dict[str, Load] = {}
    for one in several:
        for node, load in one.items():
            loads[node] = loads[node] + load if node in loads else load
    return loads


def star(
    trunk: float,
    legs: Sequence[float],
    *,
    along: Sequence[float] = (),
    master: float = 0.0,
    supply: float = 0.0,
    cable: Cable = CABLES["as-i 1.5"],
) -> Segment:
    """Return a segment whose cable fans out at its end.

    Parameters
    ----------
    trunk : float
        Length of the cable to the hub of the star, 0 if it lies at the start [m].
    legs : sequence of float
        Length of each leg, with a slave at its end [m].
    along : sequence of float, optional
        Places of more slaves on the trunk, 0..trunk [m].
    master, supply : float, default 0
        Places of the master and of the power supply on the trunk [m].
    cable : shipnet.line.Cable, optional
        The nominal AS-i cable if omitted.

    Returns
    -------
    Segment
        The slaves along the trunk, called by their places, then those of the legs, ``"leg 1"``
        and so on.

    Raises
    ------
    ArgumentError
        If a place is not on the trunk, or a leg has no legal length.

    Examples
    --------
    >>> star(90, legs=(4, 6), along=(45,)).slaves
    ('45 m', 'leg 1', 'leg 2')
    """
    named = [("master", master), ("supply", supply), *(("slave", place) for place in along)]
    for what, place in named:
        if not 0 <= place <= trunk:
            raise ArgumentError(f"the {what} is at {place} m; it must be 0..{trunk} m")
    places = sorted({0.0, float(trunk), *(float(place) for _, place in named)})
    runs = [CableRun(_node(near), _node(far), far - near, cable) for near, far in pairwise(places)]
    ends = [f"leg {number}" for number, _ in enumerate(legs, 1)]
    runs += [CableRun(_node(trunk), end, leg, cable) for end, leg in zip(ends, legs, strict=True)]
    slaves = (*map(_node, along), *ends)
    devices = [{node: DEVICE} for node in (_node(master), *slaves)]
    network = Network(runs, joined({_node(supply): POWER_SUPPLY}, *devices))
    return Segment(network, _node(master), slaves)


def ring(
    length: float,
    slaves: Sequence[float],
    *,
    supply: float = 0.0,
    cable: Cable = CABLES["as-i 1.5"],
) -> Segment:
    """Return a segment whose cable comes back to the master.

    Parameters
    ----------
    length : float
        Length of the cable around the ring [m].
    slaves : sequence of float
        Places of the slaves, 0 to less than `length` from the master [m]; at least two places
        other than the master's must be taken, by them and the supply.
    supply : float, default 0
        Place of the power supply [m].
    cable : shipnet.line.Cable, optional
        The nominal AS-i cable if omitted.

    Returns
    -------
    Segment
        Its nodes are called by their places; the last line closes the ring.

    Raises
    ------
    ArgumentError
        If a place is not on the ring, or fewer than two are taken beside the master's.

    Examples
    --------
    >>> ring(100, slaves=(25, 50, 75)).network.ring.length
    25.0
    """
    last = max((*slaves, supply), default=0.0)
    if not 0 < last < length:
        raise ArgumentError(
            f"the last place on the ring is {last} m; it must be more than 0 and less than "
            f"{length} m"
        )
    segment = star(last, (), along=slaves, supply=supply, cable=cable)
    closing = CableRun(_node(last), segment.master, length - last, cable)
    network = Network([*segment.network.runs, closing], segment.network.loads)
    return Segment(network, segment.master, segment.slaves)


def _node(place: float) -> str:
    return f"{place:g} m"
