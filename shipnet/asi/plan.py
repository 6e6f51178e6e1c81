"""The plan of an AS-i installation: which elements there are, and what hangs together.

Cables that meet at nodes make a *segment*, one electrical network; segments coupled by repeaters
make a *line*, which one master asks. A plan may hold several lines: a ship has more than one.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from heapq import heappop, heappush
from os import PathLike
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from shipnet.asi.cycle import Cycle
from shipnet.asi.elements import (
    CableRun,
    Element,
    Load,
    Master,
    Repeater,
    Slave,
    Supply,
    Terminator,
)
from shipnet.asi.quality import Quality, signal_quality
from shipnet.asi.segment import DEVICE, Segment
from shipnet.asi.telegram import RESPONSES
from shipnet.asi.timing import Transaction
from shipnet.errors import ArgumentError
from shipnet.line.network import Network

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

    from shipnet.asi.receiver import Waveform
    from shipnet.asi.rules import PlanFindings
    from shipnet.asi.telegram import Request, Response

_E = TypeVar("_E", bound=Element)

#: Requests that stand for all 2048: the first makes the least signal, as its pulses are the
#: fewest; runs of ones and of zeros make the most uneven one. A test tries them all.
PROBES = ("01010101010101", "01111111111111", "00011111111111")


@dataclass(frozen=True)
class PlanSegment:
    """One electrical network of a plan, with the elements in it."""

    #: Number of the line that it belongs to, from 0.
    line: int
    cables: tuple[CableRun, ...]
    masters: tuple[Master, ...]
    supplies: tuple[Supply, ...]
    slaves: tuple[Slave, ...]
    terminators: tuple[Terminator, ...]
    #: Repeaters at it, each with its node in this segment.
    ports: tuple[tuple[Repeater, str], ...]
    #: Node through which telegrams come from the master: the master's own or that of a repeater;
    #: None if the line has no master.
    head: str | None
    #: Repeaters between the master and this segment.
    path: tuple[Repeater, ...]
    #: Cable between the master and `head` [m].
    lead: float

    def __str__(self) -> str:
        """Name the segment by its head, or by the first node of its first cable."""
        return f"segment at {self.head or self.cables[0].a}"

    @property
    def length(self) -> float:
        """Cable in it, all branches added up [m]."""
        return sum(float(cable.length) for cable in self.cables)

    @property
    def draws(self) -> tuple[tuple[str, float], ...]:
        """Node and current [A] of each master, slave and repeater at it."""
        own: tuple[Master | Slave, ...] = (*self.masters, *self.slaves)
        return (
            *((device.node, device.current) for device in own),
            *((node, repeater.current) for repeater, node in self.ports),
        )

    @property
    def current(self) -> float:
        """What all its devices draw together [A]."""
        return sum(current for _, current in self.draws)

    @property
    def onward(self) -> tuple[tuple[Repeater, str], ...]:
        """Repeaters that lead away from the master, each with its node in this segment."""
        return tuple(port for port in self.ports if port[1] != self.head)

    @cached_property
    def distances(self) -> dict[str, float]:
        """Shortest way along the cable from `head` to each node [m]; empty without a head."""
        return {} if self.head is None else shortest_paths(self.cables, self.head)

    @property
    def reach(self) -> float:
        """Longest way along the cable from the master to a node [m]; 0 without a master."""
        return self.lead + max(self.distances.values(), default=0.0)

    @property
    def listeners(self) -> tuple[tuple[str, str], ...]:
        """Name and node of each slave, then of each repeater that leads on."""
        slaves = ((str(slave), slave.node) for slave in self.slaves)
        return (*slaves, *((str(repeater), node) for repeater, node in self.onward))

    @cached_property
    def network(self) -> Network:
        """Its cables and loads as a network."""
        loads: dict[str, Load] = {}
        given = [(device.node, device.load) for device in self.slaves]
        given += [(device.node, DEVICE) for device in self.masters]
        given += [(node, DEVICE) for _, node in self.ports]
        given += [(supply.node, supply.load) for supply in self.supplies]
        given += [(plug.node, Load(r=plug.resistance)) for plug in self.terminators]
        for node, load in given:
            loads[node] = loads[node] + load if node in loads else load
        return Network(self.cables, loads)

    @cached_property
    def voltages(self) -> dict[str, float]:
        """Voltage of the supply left at each node [V]; devices draw their current whatever it is.

        Raises ArgumentError unless the segment has exactly one supply.
        """
        if len(self.supplies) != 1:
            raise ArgumentError(f"{self} has {len(self.supplies)} supplies; it must be one")
        drawn: dict[str, float] = {}
        for node, current in self.draws:
            drawn[node] = drawn.get(node, 0.0) + current
        (supply,) = self.supplies
        point = self.network.operating_point(supply.node, supply.voltage, drawn)
        return {node: float(volts) for node, volts in point.voltage.items()}

    def signals(self) -> Quality:
        """Return the worst of all 16 responses and of the requests `PROBES` for each listener."""
        if self.head is None:
            raise ArgumentError(f"{self} has no head; its line needs a master")
        nodes = tuple(node for _, node in self.listeners)
        if not nodes:
            none = np.empty(0)
            return Quality(none, none, none, none, none)
        places = tuple(dict.fromkeys(nodes))
        line = Segment(self.network, self.head, places)
        responses, requests = (signal_quality(line, words) for words in (RESPONSES, PROBES))
        share = len(RESPONSES) / (len(RESPONSES) + len(PROBES))
        worst = responses.worst(requests)._replace(
            received=share * responses.received + (1 - share) * requests.received
        )
        return worst.of([places.index(node) for node in nodes], nodes)


@dataclass(frozen=True, init=False, repr=False)
class Plan:
    """An installation: cables, and what is clamped to them.

    Parameters
    ----------
    cables : iterable of CableRun
        At least one.
    masters : iterable of Master, optional
        One per line; another number breaks a rule, but can be planned.
    supplies : iterable of Supply, optional
        One per segment, likewise.
    slaves : iterable of Slave, optional
        Slaves.
    repeaters : iterable of Repeater, optional
        Repeaters.
    terminators : iterable of Terminator, optional
        Terminators or extension plugs.

    Raises
    ------
    ArgumentError
        If the elements do not make a network. All faults are named: a cable that lies there
        already or closes a second ring in its segment, a device without a node or at one that no
        cable reaches, a repeater with both ends in one segment, or by which a telegram could come
        two ways.

    Examples
    --------
    A slave behind a repeater:

    >>> plan = Plan(
    ...     [CableRun("bridge", "deck", 80), CableRun("hold", "bow", 60)],
    ...     masters=[Master(node="bridge")],
    ...     supplies=[Supply("bridge"), Supply("hold")],
    ...     slaves=[Slave("1", node="deck"), Slave("2", node="bow")],
    ...     repeaters=[Repeater("deck", "hold")],
    ... )
    >>> plan
    <Plan: 1 master, 2 slaves, 1 repeater, 2 segments>
    >>> [f"{segment}: {segment.reach:g} m" for segment in plan.segments]
    ['segment at bridge: 80 m', 'segment at hold: 140 m']
    >>> plan.check()
    <Findings: 39 checks, all met>
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

    def __str__(self) -> str:
        """Count its elements."""
        counts = {
            "master": len(self.masters),
            "slave": len(self.slaves),
            "repeater": len(self.repeaters),
            "segment": len(self.segments),
        }
        return ", ".join(f"{n} {name}{'s' if n != 1 else ''}" for name, n in counts.items())

    def __repr__(self) -> str:
        """Count its elements."""
        return f"<Plan: {self}>"

    # What hangs together -----------------------------------------------------------------------

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
            head, path, lead = waiting.pop(0)
            here = groups.leader(head)
            reached[here] = (head, path, lead)
            metres = shortest_paths(within(self.cables, here), head)
            for repeater in self.repeaters:
                for near, far in ((repeater.a, repeater.b), (repeater.b, repeater.a)):
                    if groups.leader(near) == here and groups.leader(far) not in reached:
                        waiting.append((far, (*path, repeater), lead + metres[near]))

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

    def only(self, what: str) -> PlanSegment:
        """Return the one segment of a plan of one segment, or raise; `what` wants to know."""
        if len(self.segments) != 1:
            raise ArgumentError(f"{what} is of one segment; the plan has {len(self.segments)}")
        return self.segments[0]

    def only_line(self, what: str) -> tuple[PlanSegment, ...]:
        """Return the segments of a plan of one line, or raise; `what` wants to know."""
        if len(self.lines) != 1:
            raise ArgumentError(f"{what} is of one line; the plan has {len(self.lines)}")
        return self.lines[0]

    # Other plans -------------------------------------------------------------------------------

    def renamed(self, prefix: str) -> Plan:
        """Return the same plan with a prefix before the name of each node."""

        def moved(elements: Iterable[_E]) -> Iterator[_E]:
            for element in elements:
                ends = [name for name in ("node", "a", "b") if hasattr(element, name)]
                names: dict[str, Any] = {name: prefix + getattr(element, name) for name in ends}
                yield replace(element, **names)

        return Plan(
            moved(self.cables),
            moved(self.masters),
            moved(self.supplies),
            moved(self.slaves),
            moved(self.repeaters),
            moved(self.terminators),
        )

    def with_repeater(
        self,
        node: str,
        other: Plan,
        *,
        delay: float = 6e-6,
        prefix: str = "2/",
        first: int | None = None,
    ) -> Plan:
        """Return this plan with another one behind a repeater at one of its nodes.

        The repeater takes the place of the other plan's one master. `prefix` stands before the
        names of the other plan's nodes; its slaves keep their order and halves, and their
        addresses begin at `first`, by default behind those in use here. Raises ArgumentError if
        an address goes beyond 31, if the names clash, or unless the other plan has one master.
        """
        downstream = other.renamed(prefix)
        if len(downstream.masters) != 1:
            raise ArgumentError(
                f"the other plan has {len(downstream.masters)} masters; it must have one"
            )
        taken = {end for run in self.cables for end in (run.a, run.b)}
        clash = sorted(taken & {end for run in downstream.cables for end in (run.a, run.b)})
        if clash:
            raise ArgumentError(f"prefix is {prefix!r}; both plans would have a node {clash[0]!r}")
        if first is None:
            first = 1 + max((slave.address for slave in self.slaves), default=0)
        moved = [
            replace(slave, label=f"{slave.address + first - 1}{slave.half or ''}")
            for slave in downstream.slaves
        ]
        return Plan(
            [*self.cables, *downstream.cables],
            self.masters,
            [*self.supplies, *downstream.supplies],
            [*self.slaves, *moved],
            [
                *self.repeaters,
                *downstream.repeaters,
                Repeater(node, downstream.masters[0].node, delay),
            ],
            [*self.terminators, *downstream.terminators],
        )

    def save(self, path: str | PathLike[str]) -> None:
        """Write the plan as a CSV file, from which `read_plan` makes the same plan."""
        from shipnet.asi.plan_file import save_plan

        save_plan(self, path)

    # What it does ------------------------------------------------------------------------------

    def check(
        self,
        *,
        wanted_cycle: float | None = None,
        transaction: Transaction | None = None,
        limits: pd.DataFrame | None = None,
    ) -> PlanFindings:
        """Check the plan against every rule of AS-i.

        `wanted_cycle` is the time within which every slave shall be heard again [s]: without it
        the rule ``update_time`` is left out. A `transaction` takes 26 bit times unless given;
        `limits` has the form of `rule_limits`. A rule is ``not verified`` where its value cannot
        be computed: voltages need one supply per segment, signals a master on the line.

        Signals are judged by the worst of all responses and of three requests, which is stricter
        than `quality`, which judges the responses. They rest on nominal cables and on assumed
        decoupling, send current and repeaters: they tell which slave is the critical one better
        than by how many millivolts it passes. The length of 500 m between two slaves is no rule
        of its own: it follows from two repeaters to either side of a master in the middle.
        """
        from shipnet.asi.rules import check_plan

        return check_plan(self, wanted_cycle=wanted_cycle, transaction=transaction, limits=limits)

    @property
    def network(self) -> Network:
        """The cables and loads of a plan of one segment, as the signal meets them."""
        return self.only("network").network

    def waveform(
        self,
        telegrams: Request | Response | str | Sequence[str] | None = None,
        node: str | None = None,
        *,
        dt: float = 250e-9,
        before: float = 6.5e-6,
        after: float = 18.5e-6,
    ) -> Waveform:
        """Return the voltages of telegrams between the master and each slave, or one node.

        By default all 16 responses are sent; `telegrams` may also be one telegram, or the bits of
        several of one length. By reciprocity the voltage is what the master hears of a slave and
        what the slave hears of the master. It is the signal alone, without the 30 V of the
        supply, sampled every `dt` [s], a whole fraction of 3 us, from `before` the telegram to
        `after` its end [s]. The plan must have one segment with a master.
        """
        from shipnet.asi.segment import telegram_waveform

        segment = self.only("waveform")
        if segment.head is None:
            raise ArgumentError(f"{segment} has no head; its line needs a master")
        nodes = tuple(node for _, node in segment.listeners) if node is None else (node,)
        if not nodes:
            raise ArgumentError(f"{segment} has no slave; one must send or hear")
        wave = telegram_waveform(
            self.network, segment.head, nodes, RESPONSES if telegrams is None else telegrams,
            dt=dt, before=before, after=after,
        )  # fmt: skip
        return wave if node is None else replace(wave, u=wave.u[0], names=())

    def quality(self) -> Quality:
        """Return how the 16 responses come over from each slave of a plan of one segment.

        `check` judges three requests as well, and is stricter.
        """
        segment = self.only("quality")
        if segment.head is None:
            raise ArgumentError(f"{segment} has no head; its line needs a master")
        nodes = tuple(slave.node for slave in segment.slaves)
        places = tuple(dict.fromkeys(nodes))
        if not places:
            raise ArgumentError(f"{segment} has no slave; one must send or hear")
        found = signal_quality(Segment(self.network, segment.head, places))
        rows = [places.index(node) for node in nodes]
        return found.of(rows, tuple(slave.label for slave in segment.slaves))

    @property
    def voltages(self) -> dict[str, float]:
        """Voltage of the supply left at each node [V]; each segment needs one supply."""
        return {
            node: volts for segment in self.segments for node, volts in segment.voltages.items()
        }

    @property
    def cycle(self) -> Cycle:
        """How a plan of one line is polled."""
        used = self._addresses()
        pairs = sum(number > 1 for number in used.values())
        return Cycle(len(used) + pairs, pairs=pairs)

    def _addresses(self) -> Counter[int]:
        line = self.only_line("cycle")
        slaves = [slave for segment in line for slave in segment.slaves if slave.address]
        return Counter(slave.address for slave in slaves)

    def response_times(
        self, *, repetitions: int = 0, host: float = 0.0, conversion: float = 0.0
    ) -> pd.DataFrame:
        """Return how soon and how late the host knows of a change at each slave.

        One row per slave: `best_s` and `worst_s`, as `Cycle.response_time` has them, with so many
        `repetitions` on the line and the time between two looks of the `host` [s]. A slave for
        analogue values transfers one value, after a `conversion` [s].
        """
        import pandas as pd

        from shipnet.asi.cycle import transfers_values

        used, cycle = self._addresses(), self.cycle
        rows = {}
        for slave in self.slaves:
            analogue = transfers_values(slave.kind)
            rows[slave.label] = cycle.response_time(
                slave.kind if analogue else None,
                conversion=conversion if analogue else 0.0,
                paired=used[slave.address] > 1,
                repetitions=repetitions,
                host=host,
            )
        table = pd.DataFrame.from_dict(rows, orient="index", columns=["best_s", "worst_s"])
        return table.rename_axis("slave")

    def plot(self, findings: PlanFindings | None = None, *, ax: Axes | None = None) -> Axes:
        """Draw the plan to scale along the cable; `findings` colour what breaks a rule red."""
        from shipnet.asi.plot import plot_plan

        return plot_plan(self, findings, ax=ax)


# What hangs together ---------------------------------------------------------------------------


class Groups:
    """Disjoint groups of names, found by union; this module is needed before scipy is loaded."""

    def __init__(self) -> None:
        self._parent: dict[str, str] = {}

    def __contains__(self, name: str) -> bool:
        """Whether a name has been seen."""
        return name in self._parent

    def leader(self, name: str) -> str:
        """Return the name that stands for a group; a new name is a group of its own."""
        self._parent.setdefault(name, name)
        while self._parent[name] != name:
            self._parent[name] = name = self._parent[self._parent[name]]
        return name

    def join(self, a: str, b: str) -> bool:
        """Make one group of two; return whether they were two."""
        a, b = self.leader(a), self.leader(b)
        self._parent[b] = a
        return a != b


def shortest_paths(cables: Iterable[CableRun], start: str) -> dict[str, float]:
    """Return the shortest way along cables from a node to each that they reach [m]."""
    near: dict[str, list[tuple[str, float]]] = {}
    for cable in cables:
        near.setdefault(cable.a, []).append((cable.b, float(cable.length)))
        near.setdefault(cable.b, []).append((cable.a, float(cable.length)))
    paths: dict[str, float] = {}
    waiting = [(0.0, start)]
    while waiting:
        so_far, node = heappop(waiting)
        if node not in paths:
            paths[node] = so_far
            for other, length in near.get(node, ()):
                heappush(waiting, (so_far + length, other))
    return paths


def structure_faults(elements: Sequence[Element]) -> list[tuple[Element, str]]:
    """Return each element that keeps others from being a network, and why."""
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
        faults += [
            (element, f"{element}: no cable reaches its node {node}" if node else
             f"{element} has no node; a plan needs to know where it is")
            for node in loose
        ]  # fmt: skip
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
