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


def straight_line(
    length: float,
    slaves: Sequence[float],
    *,
    master: float = 0.0,
    supply: float = 0.0,
    cable: Cable = CABLES["as-i 1.5"],
    terminator: float | None = None,
) -> Segment:
    """Return a segment along one cable."""
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
    """Return a segment whose cable fans out at its end."""
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
    """Return a segment whose cable comes back to the master."""
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
