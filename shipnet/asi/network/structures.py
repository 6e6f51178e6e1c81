"""Plans of the usual structures: a line, a star at the end of a trunk, a ring, and those joined.

They are the structures that icn2007, section 4, allows. Slaves are numbered in the order in which
they are given: up to 31 are standard slaves, more share addresses as A and B.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Literal

from shipnet.asi.network.elements import CURRENT, CableRun, Master, Repeater, Slave, Supply
from shipnet.asi.network.plan import Plan
from shipnet.asi.profile import Profile
from shipnet.errors import ArgumentError
from shipnet.fields import check_scalar, check_whole

__all__ = ["behind", "evenly", "line", "numbered", "ring", "star"]

#: Profiles with four inputs, for a slave alone at its address and for one that shares it.
_INPUTS, _SHARED_INPUTS = Profile(0, 0xF), Profile(0, 0xA)

#: Addresses of a line.
_ADDRESSES = 31


def evenly(length: float, n: int) -> list[float]:
    """Return places at equal distances along a cable, the last one at its end.

    Parameters
    ----------
    length : float
        Length of the cable [m].
    n : int
        Number of places, 0 or more.

    Returns
    -------
    list of float
        Distances from the start [m].

    Raises
    ------
    ArgumentError
        If `n` is no whole number of 0 or more, or `length` not 0 to 10 km.

    Examples
    --------
    >>> evenly(100, 4)
    [25.0, 50.0, 75.0, 100.0]
    """
    check_whole("n", n, 0, 10_000)
    check_scalar("length", length, "m", 0, 1e4)
    return [length * (k / n) for k in range(1, n + 1)]


def numbered(
    nodes: Sequence[str], *, pairs: int | None = None, current: float = CURRENT
) -> list[Slave]:
    """Return a slave with four inputs for each node, addressed in their order.

    Parameters
    ----------
    nodes : sequence of str
        Nodes, up to 62; a node may stand there several times.
    pairs : int, optional
        Addresses that an A and a B slave share, so many that the others have one each: n - 31 at
        least, n / 2 at most. If omitted, none or n - 31.
    current : float, default 0.065
        What each slave draws [A].

    Returns
    -------
    list of Slave
        The shared addresses come first. If `pairs` is omitted and there are more than 31 nodes,
        all slaves have the ID code of A/B slaves; otherwise only those that share.

    Raises
    ------
    ArgumentError
        If there are more than 62 nodes, or `pairs` is out of its range.

    Examples
    --------
    >>> [slave.label for slave in numbered(["a", "b", "c"])]
    ['1', '2', '3']
    >>> [slave.label for slave in numbered(["x"] * 33)][:6]
    ['1A', '1B', '2A', '2B', '3A', '4A']
    >>> [slave.label for slave in numbered(["x"] * 4, pairs=1)]
    ['1A', '1B', '2', '3']
    """
    n = len(nodes)
    if n > 2 * _ADDRESSES:
        raise ArgumentError(f"there are {n} slaves; a line has at most {2 * _ADDRESSES}")
    least = max(0, n - _ADDRESSES)
    shared = least if pairs is None else check_whole("pairs", pairs, least, n // 2)
    labels: list[tuple[int, Literal["A", "B"] | None]]
    labels = [(a, half) for a in range(1, shared + 1) for half in ("A", "B")]
    alone: Literal["A"] | None = "A" if pairs is None and shared else None
    labels += [(address, alone) for address in range(shared + 1, n - shared + 1)]
    return [
        Slave(node, address, half, _SHARED_INPUTS if half else _INPUTS, current)
        for node, (address, half) in zip(nodes, labels, strict=True)
    ]


def star(
    trunk: float,
    legs: Sequence[float],
    *,
    along: Sequence[float] = (),
    master: float = 0.0,
    supply: float = 0.0,
    cable: str = "as-i 1.5",
    current: float = CURRENT,
) -> Plan:
    """Return a plan whose cable fans out at its end.

    Parameters
    ----------
    trunk : float
        Length of the cable to the hub of the star, 0 if it lies at the master [m].
    legs : sequence of float
        Length of each leg, with a slave at its end [m].
    along : sequence of float, optional
        Places of more slaves on the trunk, 0..trunk [m].
    master, supply : float, default 0
        Places of the master and of the power supply of 30 V on the trunk [m].
    cable : str, default "as-i 1.5"
        Type of all cables.
    current : float, default 0.065
        What each slave draws [A].

    Returns
    -------
    Plan
        Its nodes are called ``"0 m"``, ``"45 m"`` ... on the trunk and ``"leg 1"`` ... at the
        ends of the legs. The slaves along the trunk come first.

    Raises
    ------
    ArgumentError
        If a place is not on the trunk, or a length is out of range.

    Examples
    --------
    icn2007's 90 m with a star of 62 slaves; 10 m are left for its legs:

    >>> plan = star(90, [10 / 62] * 62)
    >>> len(plan.slaves), round(plan.segments[0].length, 6)
    (62, 100.0)
    """
    named = [("master", master), ("supply", supply), *(("slave", place) for place in along)]
    for what, place in named:
        if not 0 <= place <= trunk:
            raise ArgumentError(f"the {what} is at {place} m; it must be 0..{trunk:g} m")
    places = sorted({0.0, float(trunk), *(float(place) for _, place in named)})
    cables = [
        CableRun(_node(near), _node(far), far - near, cable) for near, far in pairwise(places)
    ]
    ends = [f"leg {number}" for number, _ in enumerate(legs, 1)]
    cables += [CableRun(_node(trunk), end, leg, cable) for end, leg in zip(ends, legs, strict=True)]
    return Plan(
        cables,
        masters=[Master(_node(master))],
        supplies=[Supply(_node(supply))],
        slaves=numbered([*map(_node, along), *ends], current=current),
    )


def line(
    length: float,
    slaves: Sequence[float],
    *,
    master: float = 0.0,
    supply: float = 0.0,
    cable: str = "as-i 1.5",
    current: float = CURRENT,
) -> Plan:
    """Return a plan along one cable.

    Parameters
    ----------
    length : float
        Length of the cable [m].
    slaves : sequence of float
        Places of the slaves, 0..length [m].
    master, supply, cable, current
        As for `star`.

    Returns
    -------
    Plan
        Its nodes are called by their places.

    Raises
    ------
    ArgumentError
        As `star`.

    Examples
    --------
    >>> [str(slave) for slave in line(100, [5, 100]).slaves]
    ['slave 1 at 5 m', 'slave 2 at 100 m']
    """
    return star(
        length, (), along=slaves, master=master, supply=supply, cable=cable, current=current
    )


def ring(
    length: float,
    slaves: Sequence[float],
    *,
    supply: float = 0.0,
    cable: str = "as-i 1.5",
    current: float = CURRENT,
) -> Plan:
    """Return a plan whose cable comes back to the master: a passive ring.

    Parameters
    ----------
    length : float
        Length of the cable around the ring [m].
    slaves : sequence of float
        Places of the slaves, 0 to less than `length` from the master [m].
    supply, cable, current
        As for `star`.

    Returns
    -------
    Plan
        Its nodes are called by their places; the last two cables meet halfway between the last
        place and the master.

    Raises
    ------
    ArgumentError
        If a place is not on the ring, or nothing is placed apart from the master.

    Examples
    --------
    >>> [f"{run}: {run.length:g} m" for run in ring(100, [50]).cables]
    ['cable 0 m - 50 m: 50 m', 'cable 50 m - 75 m: 25 m', 'cable 75 m - 0 m: 25 m']
    """
    last = max((*slaves, supply), default=0.0)
    if not 0 < last < length:
        raise ArgumentError(
            f"the last place on the ring is {last} m; it must lie between 0 and {length} m"
        )
    there = line(last, slaves, supply=supply, cable=cable, current=current)
    # Two cables, since two nodes have at most one between them.
    half = (length - last) / 2
    back = _node(last + half)
    closing = [CableRun(_node(last), back, half, cable), CableRun(back, _node(0), half, cable)]
    return Plan([*there.cables, *closing], there.masters, there.supplies, there.slaves)


def behind(plan: Plan, node: str, other: Plan, *, prefix: str, first: int = 1) -> Plan:
    """Return a plan with another one behind a repeater.

    Parameters
    ----------
    plan : Plan
        What the master sees first.
    node : str
        Where the repeater is connected.
    other : Plan
        What lies behind the repeater; it takes the place of that plan's one master.
    prefix : str
        Put before the names of all nodes of `other`.
    first : int, default 1
        Address at which the slaves of `other` begin, 1..31; they keep their order and halves.

    Returns
    -------
    Plan
        Both, coupled.

    Raises
    ------
    ArgumentError
        If `other` has not one master, an address goes beyond 31, or the names of nodes clash.

    Examples
    --------
    >>> both = behind(line(100, [100]), "100 m", line(100, [50]), prefix="2/", first=2)
    >>> [str(slave) for slave in both.slaves]
    ['slave 1 at 100 m', 'slave 2 at 2/50 m']
    """
    far = other.renamed(prefix)
    if len(far.masters) != 1:
        raise ArgumentError(f"the other plan has {len(far.masters)} masters; it must have one")
    taken = {end for run in plan.cables for end in (run.a, run.b)}
    clash = sorted(taken & {end for run in far.cables for end in (run.a, run.b)})
    if clash:
        raise ArgumentError(f"prefix is {prefix!r}; both plans would have a node {clash[0]!r}")
    moved = [
        Slave(slave.node, slave.address + first - 1, slave.half, slave.profile, slave.current)
        for slave in far.slaves
    ]
    return Plan(
        [*plan.cables, *far.cables],
        plan.masters,
        [*plan.supplies, *far.supplies],
        [*plan.slaves, *moved],
        [*plan.repeaters, *far.repeaters, Repeater(node, far.masters[0].node)],
        [*plan.terminators, *far.terminators],
    )


def _node(place: float) -> str:
    return f"{place:g} m"
