"""Plans of the topologies of icn2007, section 4: line, star at the end of a trunk, and ring."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from shipnet.asi.master import Master
from shipnet.asi.plan import Plan, plan_of
from shipnet.asi.segment import Supply, Terminator
from shipnet.asi.slave import CURRENT, Slave
from shipnet.asi.timing import ADDRESSES
from shipnet.errors import ArgumentError
from shipnet.fields import check_scalar, check_whole
from shipnet.line.cable import Cable
from shipnet.line.network import CableRun


def line(
    length: float,
    slaves: int | Sequence[float] = 0,
    *,
    pairs: int | None = None,
    master: float = 0.0,
    supply: float = 0.0,
    cable: str | Cable = "as-i 1.5",
    current: float = CURRENT,
    terminator: float | None = None,
) -> Plan:
    """Return a plan of devices along one cable.

    Parameters
    ----------
    length : float
        Length of the cable [m].
    slaves : int or sequence of float, default 0
        Number of slaves, evenly spaced with the last one at the end, or the position of each,
        0..length [m]; at most 62 slaves. Addresses are assigned in this order.
    pairs : int, optional
        Number of shared addresses, n - 31 to n / 2 for n slaves; the last slaves share them. If
        omitted, as few as possible are shared, and if any are, all slaves are A/B slaves.
    master, supply : float, default 0
        Positions of the master and the 30 V power supply [m].
    cable : str or shipnet.line.Cable, default "as-i 1.5"
        Name of a cable type, or a `Cable`.
    current : float, default 0.065
        Current of each slave, 0..10 [A].
    terminator : float, optional
        Resistance of a resistor at the far end, 1..1e6 [ohm]; no resistor if omitted. For a device
        that the makers offer, add a `Terminator` to the plan.

    Returns
    -------
    Plan
        Its nodes are named by their positions: ``"0 m"``, ``"45 m"`` and so on.

    Examples
    --------
    >>> [str(slave) for slave in line(100, [5, 100]).slaves]
    ['slave 1 at 5 m', 'slave 2 at 100 m']
    >>> print(line(100, slaves=62, supply=0).check())
    567 checks, 38 violated
    slave voltage: 24.47 V at slave 31B at 100 m, at least 26.5 V (38 violated)
    """
    plan = star(
        length,
        (),
        along=slaves,
        pairs=pairs,
        master=master,
        supply=supply,
        cable=cable,
        current=current,
    )
    if terminator is None:
        return plan
    return plan_of([*plan, Terminator(_node(length), terminator, inductance=1e3)])


def star(
    trunk: float,
    legs: Sequence[float],
    *,
    along: int | Sequence[float] = (),
    pairs: int | None = None,
    master: float = 0.0,
    supply: float = 0.0,
    cable: str | Cable = "as-i 1.5",
    current: float = CURRENT,
) -> Plan:
    """Return a plan whose cable branches at its end.

    Parameters
    ----------
    trunk : float
        Length of the cable to the hub of the star [m]; 0 if the hub is at the master.
    legs : sequence of float
        Length of each leg [m]; each leg has a slave at its end.
    along : int or sequence of float, default ()
        Slaves on the trunk, in the form of `slaves` of `line`; they get the first addresses.
    pairs, master, supply, cable, current
        As for `line`.

    Returns
    -------
    Plan
        Its nodes are ``"0 m"``, ``"45 m"`` and so on along the trunk, and ``"leg 1"`` and so on
        at the ends of the legs.

    Examples
    --------
    icn2007's star of 62 slaves at the end of a 90 m trunk, which leaves 10 m for the legs:

    >>> plan = star(90, [10 / 62] * 62)
    >>> len(plan.slaves), round(plan.segments[0].length, 6)
    (62, 100.0)
    """
    check_scalar("trunk", trunk, "m", 0, 1e6)
    if isinstance(along, int | float | np.number):
        along = evenly_spaced(trunk, along)
    named = [("master", master), ("supply", supply), *(("slave", position) for position in along)]
    for what, position in named:
        if not 0 <= position <= trunk:
            raise ArgumentError(f"the {what} is at {position} m; it must be 0..{trunk:g} m")
    positions = sorted({0.0, float(trunk), *(float(position) for _, position in named)})
    cables = [CableRun(_node(a), _node(b), b - a, cable) for a, b in pairwise(positions)]
    ends = {f"leg {number}": leg for number, leg in enumerate(legs, 1)}
    cables += [CableRun(_node(trunk), end, leg, cable) for end, leg in ends.items()]
    nodes = [*map(_node, along), *ends]
    labels = assign_addresses(len(nodes), pairs=pairs)
    placed = zip(labels, nodes, strict=True)
    slaves = [Slave(label, node=node, current=current) for label, node in placed]
    return Plan(cables, [Master(node=_node(master))], [Supply(_node(supply))], slaves)


def ring(
    length: float,
    slaves: int | Sequence[float],
    *,
    pairs: int | None = None,
    cable: str | Cable = "as-i 1.5",
    current: float = CURRENT,
) -> Plan:
    """Return a plan whose cable returns to the master: a passive ring.

    Parameters
    ----------
    length : float
        Length of the cable around the ring [m].
    slaves : int or sequence of float
        Number of slaves, evenly spaced, or the position of each, 0 to less than `length` [m].
    pairs, cable, current
        As for `line`.

    Returns
    -------
    Plan
        Its nodes are named by their positions. With only one position besides the master's, a node
        halfway divides the cable that returns to the master.

    Examples
    --------
    >>> [f"{run}: {run.length:g} m" for run in ring(100, [50]).cables]
    ['cable 0 m - 50 m: 50 m', 'cable 50 m - 75 m: 25 m', 'cable 75 m - 0 m: 25 m']
    """
    if isinstance(slaves, int | float | np.number):
        slaves = evenly_spaced(length, slaves + 1)[:-1]
    last = max(slaves, default=0.0)
    if not 0 < last < length:
        raise ArgumentError(
            f"the last position on the ring is {last} m; it must be between 0 and {length} m"
        )
    there = line(last, slaves, pairs=pairs, cable=cable, current=current)
    # Two nodes have at most one cable between them, so a second one needs a node halfway.
    halfway = [] if len(there.cables) > 1 else [last + (length - last) / 2]
    back = pairwise([last, *halfway, length])
    names = pairwise([*map(_node, (last, *halfway)), _node(0)])
    closing = [CableRun(*ends, b - a, cable) for ends, (a, b) in zip(names, back, strict=True)]
    return plan_of([*there, *closing])


def evenly_spaced(length: float, n: int) -> list[float]:
    """Return n evenly spaced positions along a cable [m], the last one at its end."""
    count = check_whole("n", n, 0, 10_000)
    check_scalar("length", length, "m", 0, 1e4)
    return [length * (k / count) for k in range(1, count + 1)]


def assign_addresses(
    n: int,
    *,
    pairs: int | None = None,
    shares: Sequence[bool] | None = None,
    need: Sequence[float] | None = None,
) -> list[str]:
    """Return the labels of n slaves; those that can wait longest share addresses in pairs.

    `pairs` addresses, by default as few as possible, are shared by slaves whose `shares` is True
    (any slaves if omitted): those with the longest `need`, or the last ones if `need` is omitted.
    The other slaves whose `shares` is True are A slaves. If neither `pairs` nor `shares` is given
    and some slaves must share, all others are A slaves.
    """
    able = list(range(n)) if shares is None else [k for k in range(n) if shares[k]]
    most = len(able) // 2
    if n - most > ADDRESSES:
        raise ArgumentError(f"{n} slaves need {n - most} addresses; a line has {ADDRESSES}")
    least = max(0, n - ADDRESSES)
    number = least if pairs is None else check_whole("pairs", pairs, least, most)
    if need is None:
        sharing = able[len(able) - 2 * number :]
    else:
        sharing = sorted(able, key=lambda index: -need[index])[: 2 * number]
    lone_a = set(able) if shares is not None or (pairs is None and number) else set()
    labels = {}
    alone = [index for index in range(n) if index not in set(sharing)]
    for address, index in enumerate(alone, 1):
        labels[index] = f"{address}A" if index in lone_a else f"{address}"
    for rank, index in enumerate(sorted(sharing)):
        labels[index] = f"{len(alone) + 1 + rank // 2}{'AB'[rank % 2]}"
    return [labels[index] for index in range(n)]


def _node(position: float) -> str:
    return f"{position:g} m"
