"""The plan of an AS-i installation: which elements there are, and what hangs together.

Cables that meet at nodes make a *segment*, one electrical network; segments coupled by repeaters
make a *line*, which one master asks. A plan may hold several lines: a ship has more than one.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TypeVar

from shipnet.asi.network.elements import (
    CableRun,
    Element,
    Master,
    Repeater,
    Slave,
    Supply,
    Terminator,
)
from shipnet.asi.network.graph import Groups, shortest_ways
from shipnet.errors import ArgumentError

__all__ = ["Plan", "PlanSegment", "structure_faults"]

_E = TypeVar("_E", bound=Element)


@dataclass(frozen=True)
class PlanSegment:
    """One electrical network of a plan.

    Attributes
    ----------
    line : int
        Number of the line that it belongs to, from 0.
    cables, masters, supplies, slaves, terminators : tuple
        Elements in it.
    ports : tuple of tuple of (Repeater, str)
        Repeaters at it, each with its node in this segment.
    head : str or None
        Node through which telegrams come from the master: the master's own or that of a repeater;
        None if the line has no master.
    way : tuple of Repeater
        Repeaters between the master and this segment.
    lead : float
        Cable between the master and `head` [m].
    """

    line: int
    cables: tuple[CableRun, ...]
    masters: tuple[Master, ...]
    supplies: tuple[Supply, ...]
    slaves: tuple[Slave, ...]
    terminators: tuple[Terminator, ...]
    ports: tuple[tuple[Repeater, str], ...]
    head: str | None
    way: tuple[Repeater, ...]
    lead: float

    def __str__(self) -> str:
        """Name the segment by its head, or by the first node of its first cable."""
        return f"segment at {self.head or self.cables[0].a}"

    @property
    def length(self) -> float:
        """Cable in it, all branches added up [m]."""
        return sum(cable.length for cable in self.cables)

    @property
    def draws(self) -> tuple[tuple[str, float], ...]:
        """Node and current [A] of each master, slave and repeater at it."""
        own: tuple[Master | Slave, ...] = (*self.masters, *self.slaves)
        return (
            *((device.node, device.current) for device in own),
            *((node, repeater.current) for repeater, node in self.ports),
        )

    @property
    def onward(self) -> tuple[tuple[Repeater, str], ...]:
        """Repeaters that lead away from the master, each with its node in this segment."""
        return tuple(port for port in self.ports if port[1] != self.head)

    @cached_property
    def distances(self) -> dict[str, float]:
        """Shortest way along the cable from `head` to each node [m]; empty without a head."""
        return {} if self.head is None else shortest_ways(self.cables, self.head)

    @property
    def reach(self) -> float:
        """Longest way along the cable from the master to a node [m]; 0 without a master."""
        return self.lead + max(self.distances.values(), default=0.0)


@dataclass(frozen=True, init=False)
class Plan:
    """Cables and what is clamped to them.

    Parameters
    ----------
    cables : sequence of CableRun
        At least one.
    masters : sequence of Master, optional
        One a line; another number breaks a rule, but can be planned.
    supplies : sequence of Supply, optional
        One a segment, likewise.
    slaves : sequence of Slave, optional
        Slaves.
    repeaters : sequence of Repeater, optional
        Repeaters.
    terminators : sequence of Terminator, optional
        Terminators or extension plugs.

    Raises
    ------
    ArgumentError
        If the elements make no network; all the faults that `structure_faults` finds are named.

    Examples
    --------
    A slave behind a repeater:

    >>> plan = Plan(
    ...     [CableRun("bridge", "deck", 80), CableRun("hold", "bow", 60)],
    ...     masters=[Master("bridge")],
    ...     supplies=[Supply("bridge"), Supply("hold")],
    ...     slaves=[Slave("deck", 1), Slave("bow", 2)],
    ...     repeaters=[Repeater("deck", "hold")],
    ... )
    >>> [f"{segment}: {segment.reach:g} m" for segment in plan.segments]
    ['segment at bridge: 80 m', 'segment at hold: 140 m']
    """

    cables: tuple[CableRun, ...]
    masters: tuple[Master, ...] = ()
    supplies: tuple[Supply, ...] = ()
    slaves: tuple[Slave, ...] = ()
    repeaters: tuple[Repeater, ...] = ()
    terminators: tuple[Terminator, ...] = ()

    def __init__(
        self,
        cables: Iterable[CableRun],
        masters: Iterable[Master] = (),
        supplies: Iterable[Supply] = (),
        slaves: Iterable[Slave] = (),
        repeaters: Iterable[Repeater] = (),
        terminators: Iterable[Terminator] = (),
    ) -> None:
        kinds = {
            "cables": (cables, CableRun),
            "masters": (masters, Master),
            "supplies": (supplies, Supply),
            "slaves": (slaves, Slave),
            "repeaters": (repeaters, Repeater),
            "terminators": (terminators, Terminator),
        }
        for name, (given, kind) in kinds.items():
            elements = tuple(given)
            for element in elements:
                if not isinstance(element, kind):
                    raise ArgumentError(f"{name} holds {element!r}; it must be a {kind.__name__}")
            object.__setattr__(self, name, elements)
        if not self.cables:
            raise ArgumentError("the plan has no cable; it needs at least one")
        faults = [fault for _, fault in structure_faults(list(self))]
        if faults:
            raise ArgumentError("; ".join(faults))

    def __iter__(self) -> Iterator[Element]:
        """Go through all elements, kind by kind."""
        yield from self.cables
        yield from self.masters
        yield from self.supplies
        yield from self.slaves
        yield from self.repeaters
        yield from self.terminators

    @cached_property
    def segments(self) -> tuple[PlanSegment, ...]:
        """Segments in the order of their first cable."""
        groups = Groups()
        for cable in self.cables:
            groups.join(cable.a, cable.b)
        lines = Groups()
        for repeater in self.repeaters:
            lines.join(groups.leader(repeater.a), groups.leader(repeater.b))
        leaders = list(dict.fromkeys(groups.leader(cable.a) for cable in self.cables))
        numbers = {
            line: n for n, line in enumerate(dict.fromkeys(lines.leader(x) for x in leaders))
        }

        def within(elements: Iterable[_E], leader: str) -> tuple[_E, ...]:
            return tuple(e for e in elements if groups.leader(_nodes(e)[0]) == leader)

        # From each line's first master outward, repeater by repeater.
        reached: dict[str, tuple[str, tuple[Repeater, ...], float]] = {}
        waiting: list[tuple[str, tuple[Repeater, ...], float]] = []
        started = set()
        for master in self.masters:
            line = lines.leader(groups.leader(master.node))
            if line not in started:
                started.add(line)
                waiting.append((master.node, (), 0.0))
        while waiting:
            head, way, lead = waiting.pop(0)
            here = groups.leader(head)
            reached[here] = (head, way, lead)
            metres = shortest_ways(within(self.cables, here), head)
            for repeater in self.repeaters:
                for near, far in ((repeater.a, repeater.b), (repeater.b, repeater.a)):
                    if groups.leader(near) == here and groups.leader(far) not in reached:
                        waiting.append((far, (*way, repeater), lead + metres[near]))

        return tuple(
            PlanSegment(
                numbers[lines.leader(leader)],
                within(self.cables, leader),
                within(self.masters, leader),
                within(self.supplies, leader),
                within(self.slaves, leader),
                within(self.terminators, leader),
                tuple(
                    (repeater, node)
                    for repeater in self.repeaters
                    for node in (repeater.a, repeater.b)
                    if groups.leader(node) == leader
                ),
                *reached.get(leader, (None, (), 0.0)),
            )
            for leader in leaders
        )

    @property
    def lines(self) -> tuple[tuple[PlanSegment, ...], ...]:
        """The segments of each line."""
        count = 1 + max(segment.line for segment in self.segments)
        return tuple(
            tuple(segment for segment in self.segments if segment.line == line)
            for line in range(count)
        )

    def renamed(self, prefix: str) -> Plan:
        """Return the same plan with other names of nodes, so that it fits beside another.

        Parameters
        ----------
        prefix : str
            Put before every name.

        Returns
        -------
        Plan
            The same elements.

        Examples
        --------
        >>> Plan([CableRun("a", "b", 5)]).renamed("port/").cables[0].b
        'port/b'
        """

        def moved(elements: Iterable[_E]) -> Iterator[_E]:
            for element in elements:
                ends = [name for name in ("node", "a", "b") if hasattr(element, name)]
                yield replace(element, **{name: prefix + getattr(element, name) for name in ends})

        return Plan(
            moved(self.cables),
            moved(self.masters),
            moved(self.supplies),
            moved(self.slaves),
            moved(self.repeaters),
            moved(self.terminators),
        )


def structure_faults(elements: Sequence[Element]) -> list[tuple[Element, str]]:
    """Return what keeps elements from being a network, all of it.

    Parameters
    ----------
    elements : sequence of Element
        Cables and devices in any order.

    Returns
    -------
    list of tuple of (Element, str)
        The element at fault, and why: a cable that lies there already, a cable that closes a
        second ring in its segment, a device at a node that no cable reaches, a repeater with both
        ends in one segment, a repeater by which a telegram could come two ways.

    Examples
    --------
    >>> cables = [CableRun("a", "b", 5), CableRun("b", "a", 6)]
    >>> [fault for _, fault in structure_faults([*cables, Master("c")])]
    ['cable b - a lies there already', 'master at c: no cable reaches its node c']
    """
    faults: list[tuple[Element, str]] = []
    groups, lines = Groups(), Groups()
    laid = set()
    closing = []
    for cable in elements:
        if not isinstance(cable, CableRun):
            continue
        ends = frozenset((cable.a, cable.b))
        if ends in laid:
            faults.append((cable, f"{cable} lies there already"))
        elif not groups.join(cable.a, cable.b):
            closing.append(cable)
        laid.add(ends)
    ringed = set()
    for cable in closing:
        segment = groups.leader(cable.a)
        if segment in ringed:
            faults.append((cable, f"{cable} closes a second ring; a segment has at most one"))
        ringed.add(segment)
    for element in elements:
        if isinstance(element, CableRun):
            continue
        loose = [node for node in _nodes(element) if node not in groups]
        faults += [(element, f"{element}: no cable reaches its node {node}") for node in loose]
        if isinstance(element, Repeater) and not loose:
            a, b = groups.leader(element.a), groups.leader(element.b)
            if a == b:
                faults.append((element, f"{element} has both ends in one segment"))
            elif not lines.join(a, b):
                faults.append((element, f"{element} gives telegrams a second way around"))
    return faults


def _nodes(element: Element) -> tuple[str, ...]:
    if isinstance(element, CableRun | Repeater):
        return element.a, element.b
    return (element.node,)
