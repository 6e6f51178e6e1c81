"""The plan of an AS-i installation: which elements there are, and what hangs together.

Cables that meet at nodes make a *segment*, one electrical network; segments coupled by repeaters
make a *line*, which one master asks. A plan may hold several lines: a ship has more than one.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from os import PathLike
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from shipnet import style
from shipnet.answers import Findings, Utilisation
from shipnet.arguments import checked
from shipnet.arrays import Bools, Floats
from shipnet.asi.elements import Repeater, Supply, Terminator
from shipnet.asi.master import Master
from shipnet.asi.plan_file import read_elements, write_elements
from shipnet.asi.receiver import RECEIVERS, TOLERANCE, Disturbance, RNGLike
from shipnet.asi.recording import record_segment
from shipnet.asi.rules import check_lines
from shipnet.asi.segment import (
    PROBES,
    Element,
    Groups,
    Quality,
    Segment,
    nodes_of,
    shortest_paths,
    structure_faults,
)
from shipnet.asi.slave import Slave
from shipnet.asi.telegram import RESPONSES
from shipnet.asi.timing import (
    ADDRESSES,
    Cycle,
    Direction,
    ResponseTime,
    Transaction,
)
from shipnet.errors import ArgumentError
from shipnet.fields import check_scalar, check_whole
from shipnet.lazy import Axes, pd
from shipnet.line.network import CableRun, Network
from shipnet.line.waveform import Waveform as LineWaveform
from shipnet.style import LIMIT

if TYPE_CHECKING:
    from shipnet.asi.receiver import Receiver, Waveform
    from shipnet.asi.telegram import Request, Response

_E = TypeVar("_E", bound=Element)


#: The kinds of elements of a plan, by the name of their attribute.
_KINDS: dict[str, type[Element]] = {
    "cables": CableRun,
    "masters": Master,
    "supplies": Supply,
    "slaves": Slave,
    "repeaters": Repeater,
    "terminators": Terminator,
}

#: Marker, colour and size by the name in the legend, the last ones drawn on top.
_MARKS: dict[str, tuple[Any, str, int]] = {
    "supply": (6, "C4", 12),  # a caret whose tip is at the node
    "master": ("s", "0.2", 7),
    "repeater": ("D", "C1", 6),
    "terminator": ("|", "0.2", 14),
    "slave": ("o", "C0", 4),
    "slave, passed": ("o", "C0", 4),
    "slave, failed": ("X", LIMIT["color"], 7),
}

#: Most slaves that are named one by one.
_NAMED = 12


@checked
@dataclass(frozen=True, repr=False)
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
    A slave downstream of a repeater:

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

    cables: Sequence[CableRun]
    masters: Sequence[Master] = ()
    supplies: Sequence[Supply] = ()
    slaves: Sequence[Slave] = ()
    repeaters: Sequence[Repeater] = ()
    terminators: Sequence[Terminator] = ()

    def __post_init__(self) -> None:
        for name in _KINDS:
            object.__setattr__(self, name, tuple(getattr(self, name)))
        if not self.cables:
            raise ArgumentError("the plan has no cable; it needs at least one")
        faults = [fault for _, fault in structure_faults(list(self))]
        if faults:
            raise ArgumentError("; ".join(faults))

    def __iter__(self) -> Iterator[Element]:
        for name in _KINDS:
            yield from getattr(self, name)

    def __str__(self) -> str:
        counts = {
            "master": len(self.masters),
            "slave": len(self.slaves),
            "repeater": len(self.repeaters),
            "segment": len(self.segments),
        }
        return ", ".join(f"{n} {name}{'s' if n != 1 else ''}" for name, n in counts.items())

    def __repr__(self) -> str:
        return f"<Plan: {self}>"

    # What hangs together -----------------------------------------------------------------------

    @cached_property
    def segments(self) -> tuple[Segment, ...]:
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
            return tuple(e for e in elements if groups.leader(nodes_of(e)[0]) == leader)

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
            Segment(
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
    def lines(self) -> tuple[tuple[Segment, ...], ...]:
        """The segments of each line."""
        count = 1 + max(segment.line for segment in self.segments)
        return tuple(
            tuple(segment for segment in self.segments if segment.line == line)
            for line in range(count)
        )

    def only(self, what: str) -> Segment:
        """Return the one segment of a plan of one segment, or raise; `what` wants to know."""
        if len(self.segments) != 1:
            raise ArgumentError(f"{what} is of one segment; the plan has {len(self.segments)}")
        return self.segments[0]

    def only_line(self, what: str) -> tuple[Segment, ...]:
        """Return the segments of a plan of one line, or raise; `what` wants to know."""
        if len(self.lines) != 1:
            raise ArgumentError(f"{what} is of one line; the plan has {len(self.lines)}")
        return self.lines[0]

    # Other plans -------------------------------------------------------------------------------

    def renamed(self, prefix: str) -> Plan:
        """Return the same plan with a prefix before the name of each node."""

        def moved(element: Element) -> Element:
            ends = [name for name in ("node", "a", "b") if hasattr(element, name)]
            names: dict[str, Any] = {name: prefix + getattr(element, name) for name in ends}
            return replace(element, **names)

        return plan_of(map(moved, self))

    def with_repeater(
        self,
        node: str,
        other: Plan,
        *,
        delay: float = 6e-6,
        prefix: str = "2/",
        first: int | None = None,
    ) -> Plan:
        """Return this plan with another one downstream of a repeater at one of its nodes.

        The repeater takes the place of the other plan's one master. `prefix` is put before the
        names of the other plan's nodes; its slaves keep their order and halves, and their
        addresses begin at `first`, by default after those in use here. Raises ArgumentError if
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
        link = Repeater(node, downstream.masters[0].node, delay)
        kept = (one for one in downstream if not isinstance(one, Master | Slave))
        return plan_of([*self, *kept, *moved, link])

    def save(self, path: str | PathLike[str]) -> None:
        """Write the plan as a CSV file, from which `read_plan` makes the same plan."""
        write_elements(list(self), path)

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
        `limits` has the form of `rule_limits`. What cannot be computed of a segment is one row
        ``voltages_and_signals`` that is ``not verified`` and says why: voltages need one supply
        per segment, signals and delays a master on the line.

        Signals are judged by the worst of all responses and of three requests, which is stricter
        than `quality`, which judges the responses. They rest on nominal cables and on assumed
        decoupling, send current and repeaters: they tell which slave is the critical one better
        than by how many millivolts it passes. The length of 500 m between two slaves is not a rule
        of its own: it follows from two repeaters to either side of a master in the middle.
        """
        return PlanFindings(check_lines(self.lines, wanted_cycle, transaction, limits), self)

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
        segment = self.only("waveform")
        nodes = tuple(node for _, node in segment.listeners) if node is None else (node,)
        words = RESPONSES if telegrams is None else telegrams
        wave = segment.waveform(words, nodes, dt=dt, before=before, after=after)
        return wave if node is None else replace(wave, u=wave.u[0], names=())

    def record(
        self,
        duration: float = 20e-3,
        *,
        node: str | None = None,
        dt: float = 250e-9,
        weak: Mapping[str, float] | None = None,
        disturbance: Disturbance | None = None,
        amplitude: float = 0.0,
        rng: RNGLike | None = None,
    ) -> LineWaveform:
        """Return what a scope records while the master polls the slaves of a plan of one segment.

        The cables decide who hears whom: a slave answers what it receives, and the master repeats
        what fails, drops slaves, and looks for new ones. All slaves are active at the start, and
        their inputs change at random.

        Parameters
        ----------
        duration : float, default 20e-3
            Length of the record, 1e-3..0.2 [s].
        node : str, optional
            Where the scope is; at the master if omitted.
        dt : float, default 250e-9
            Sampling interval, 50e-9..500e-9 and a whole fraction of 3e-6 [s].
        weak : mapping of str to float, optional
            Send current of slaves by their label, over the nominal 60 mA, 0..10.
        disturbance : Disturbance, optional
            One of `shipnet.asi.emc`, heard everywhere alike.
        amplitude : float, default 0.0
            Its amplitude [V].
        rng : int or numpy.random.Generator, optional
            Source of the inputs, of the slaves' delays and of the disturbance.

        Returns
        -------
        shipnet.line.Waveform
            Voltage between the two wires, on that of the supply [V].

        Raises
        ------
        ArgumentError
            If a value is out of range, a label or node is not in the plan, or the plan has more
            than one segment, no master or no slave.

        Examples
        --------
        >>> from shipnet.asi import decode, line
        >>> capture = decode(line(80, slaves=(1, 40, 80)).record(5e-3, rng=2024))
        >>> print(capture.summary().seen, capture.causes().index.tolist())
        ['1', '2', '3'] []
        """
        return record_segment(
            self.only("record"), duration, node=node, dt=dt, weak=weak or {},
            disturbance=disturbance, amplitude=amplitude, rng=rng,
        )  # fmt: skip

    def quality(self) -> Quality:
        """Return how the 16 responses come over from each slave of a plan of one segment.

        `check` judges three requests as well, and is stricter.
        """
        slaves = self.only("quality").slaves
        found = self.only("quality").quality([slave.node for slave in slaves])
        return found._replace(slaves=tuple(slave.label for slave in slaves))

    def error_rates(
        self, noise_density: float, *, receivers: Mapping[str, Receiver] = RECEIVERS
    ) -> pd.DataFrame:
        """Return how often white noise costs a telegram, in a plan of one segment with a master.

        The noise has a one-sided `noise_density` at every receiver [V per root hertz]. One row per
        slave and receiver: `minimum_V` of the receiver; `request` and `response`, the probability
        that one is not received as it was sent; `exchange`, that either is not. They are NaN where
        `emc.error_rate` cannot say; `why` has the reason.
        """
        from shipnet.asi.emc.error_rates import error_rate

        check_scalar("noise_density", noise_density, "V per root hertz", 1e-12, 1e6)
        waves = self.waveform(PROBES), self.waveform()
        rows = []
        for place, slave in enumerate(self.slaves):
            own = [replace(wave, u=wave.u[place], names=()) for wave in waves]
            for name, receiver in receivers.items():
                request = response = np.nan
                why = ""
                try:
                    request, response = (
                        error_rate(wave, noise_density, receiver=receiver).item() for wave in own
                    )
                except ArgumentError as reason:
                    why = str(reason)
                exchange = request + response - request * response
                rows.append((slave.label, name, receiver.minimum, request, response, exchange, why))
        columns = ["slave", "receiver", "minimum_V", "request", "response", "exchange", "why"]
        return pd.DataFrame(rows, columns=columns).set_index(["slave", "receiver"])

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
        self, *, direction: Direction = "in", repetitions: int = 0, host: float = 0.0
    ) -> pd.DataFrame:
        """Return how soon and how late the host knows of a change at each slave.

        One row per slave of a plan of one line: `best_s`, `typical_s` and `worst_s`, as
        `Cycle.response_time` has them, with the slave's profile, channels and conversion, and
        `update_s`, after which the slave is heard again. They are NaN where nobody knows how a
        profile transfers its values; `why` says so.
        """
        used, cycle = self._addresses(), self.cycle
        again = check_whole("repetitions", repetitions, 0, 10_000)
        rows = {}
        for slave in self.slaves:
            asked: dict[str, Any] = {
                "channels": slave.channels, "direction": direction,
                "paired": used[slave.address] > 1,
            }  # fmt: skip
            try:
                renewed = cycle.update_time(slave.kind, **asked)
            except ArgumentError as unknown:
                rows[slave.label] = (*[np.nan] * 4, str(unknown))
                continue
            asked |= {"conversion": slave.conversion, "repetitions": again, "host": host}
            rows[slave.label] = (*cycle.response_time(slave.kind, **asked), renewed, "")
        columns = [*(f"{name}_s" for name in ResponseTime._fields), "update_s", "why"]
        table = pd.DataFrame.from_dict(rows, orient="index", columns=columns)
        return table.rename_axis("slave")

    def utilisation(self, update: float, *, repetitions: int = 0, host: float = 0.0) -> Utilisation:
        """Return how far a plan of one line is used, where each point needs an `update` [s].

        `repetitions` and `host` as in `response_times`; NaN where that has one.
        """
        check_scalar("update", update, "s", 1e-6, 1e6)
        times = self.response_times(repetitions=repetitions, host=host)
        shares = [len(self._addresses()) / ADDRESSES, *(times["update_s"] / update)]
        worst = times["worst_s"].max(skipna=False)
        return Utilisation(float(self.cycle.bus_time), float(np.max(shares)), float(worst))

    def plot(self, findings: PlanFindings | None = None, *, ax: Axes | None = None) -> Axes:
        """Draw the plan to scale along the cable, the slaves with their verdict.

        A slave that violates a rule is a red cross, a segment that does has red cable. A cable that
        closes a ring is dashed, a repeater is joined to both of its nodes. Up to 12 slaves are
        named.
        """
        ax = style.axes(ax)
        table = None if findings is None else findings.table()
        failed = set() if table is None else set(table.loc[table["verdict"] != "met", "object"])
        points: dict[str, list[Floats]] = {kind: [] for kind in _MARKS}
        places: dict[str, Floats] = {}
        top = 0.0
        for segment in self.segments:
            network = segment.network
            placed = network.layout(segment.head)
            origin = np.array([segment.lead, top])
            places |= dict(zip(network.nodes, placed.spot + origin, strict=True))
            colour = LIMIT["color"] if str(segment) in failed else "0.6"
            for stroke in placed.strokes:
                ax.plot(*(stroke + origin[:, np.newaxis]), color=colour, zorder=1)
            if placed.closing is not None:
                ax.plot(*(placed.closing + origin[:, np.newaxis]), "--", color=colour, zorder=1)
            top += placed.lowest - 1.5
        for master in self.masters:
            points["master"].append(places[master.node])
        for supply in self.supplies:
            points["supply"].append(places[supply.node])
        for terminator in self.terminators:
            points["terminator"].append(places[terminator.node])
        for repeater in self.repeaters:
            ends = np.array([places[repeater.a], places[repeater.b]])
            ax.plot(*ends.T, ":", color="C1", zorder=1)
            # Clear of the branches that hang on the upper one.
            points["repeater"].append(ends[ends[:, 1].argmin()] + [0, 0.75])
        for slave in self.slaves:
            verdict = (
                "slave"
                if table is None
                else f"slave, {'failed' if str(slave) in failed else 'passed'}"
            )
            points[verdict].append(places[slave.node])
        if len(self.slaves) <= _NAMED:
            for node in dict.fromkeys(slave.node for slave in self.slaves):
                labels = " ".join(slave.label for slave in self.slaves if slave.node == node)
                ax.annotate(
                    labels, tuple(places[node]), (0, 6), textcoords="offset points",
                    ha="center",
                )  # fmt: skip
        for label, (marker, colour, size) in _MARKS.items():
            if points[label] or (table is not None and label.startswith("slave,")):
                ax.plot(
                    *np.reshape(points[label], (-1, 2)).T, marker=marker, color=colour,
                    markersize=size, linestyle="none", label=label,
                )  # fmt: skip
        ax.spines["left"].set_visible(False)
        ax.set(
            xlabel="distance from the master [m]",
            yticks=[],
            ylim=(1.04 * top + 0.7, 0.8 - 0.04 * top),
        )
        style.legend(ax, 6)
        return ax


class PlanFindings(Findings):
    """What the rules say of a plan; the drawing shows it."""

    def __init__(self, table: pd.DataFrame, plan: Plan) -> None:
        super().__init__(table)
        self.plan = plan

    def plot(self, *, ax: Axes | None = None) -> Axes:
        """Draw the plan; slaves that violate a rule are red crosses."""
        return self.plan.plot(self, ax=ax)


def plan_of(elements: Iterable[Element]) -> Plan:
    """Return the plan of elements in any order."""
    given = list(elements)
    parts: dict[str, list[Any]] = {
        name: [one for one in given if isinstance(one, kind)] for name, kind in _KINDS.items()
    }
    return Plan(**parts)


@checked
def read_plan(path: str | PathLike[str]) -> Plan:
    """Read a plan from a CSV file.

    Parameters
    ----------
    path : path
        File with a row of column titles, upper or lower case, and one row an element. Separated
        by commas, semicolons or tabs; with semicolons or tabs a decimal comma is understood.
        UTF-8 with or without a mark, UTF-16 with a mark, or Windows-1252. Blank rows are skipped.
        Or an Excel workbook with such a sheet.

    Returns
    -------
    Plan
        The elements in the order of their rows.

    Raises
    ------
    InputError
        If the file cannot be read, or does not describe a network: every fault with its row,
        column and value, and what was expected.

    Examples
    --------
    >>> from shipnet import datasets
    >>> plan = read_plan(datasets.path("synthetic_asi_plan_300m.csv"))
    >>> len(plan.slaves), [f"{segment.length:.0f} m" for segment in plan.segments]
    (62, ['100 m', '100 m', '100 m'])
    """
    return plan_of(read_elements(path))


# Several plans --------------------------------------------------------------------------------


class Comparison:
    """Qualities of several plans, by name."""

    def __init__(self, qualities: Mapping[Any, Quality]) -> None:
        self.qualities = dict(qualities)

    def __repr__(self) -> str:
        good = int(self.within_tolerance.sum())
        return f"<Comparison: {len(self.qualities)} plans, {good} within tolerance>"

    def table(self, *, by_slave: bool = False) -> pd.DataFrame:
        """Return the worst slave of each plan, one row per plan, or one row per slave of each."""
        if by_slave:
            parts = {name: one.table() for name, one in self.qualities.items()}
            return pd.DataFrame(pd.concat(parts, names=["plan"]))
        rows = {
            name: (
                len(q.received), q.received.min(), q.level_least.min(), q.evenness.min(),
                q.ringing.max(),
            )
            for name, q in self.qualities.items()
        }  # fmt: skip
        columns = ["slaves", "received", "level_least_Vpp", "evenness", "ringing"]
        table = pd.DataFrame.from_dict(rows, orient="index", columns=columns)
        return table.rename_axis("plan")

    @property
    def within_tolerance(self) -> Bools:
        """Which plans keep all their slaves within both tolerances."""
        return np.array([bool(one.within_tolerance.all()) for one in self.qualities.values()])

    def plot(self, ax: Axes | None = None, *, label: str = "", **line: Any) -> Axes:
        """Draw weakest pulse and ringing over the names, if these are numbers, or the order."""
        names = list(self.qualities)
        numbers = all(isinstance(name, int | float | np.number) for name in names)
        x = names if numbers else range(1, len(names) + 1)
        ax = style.axes(ax)
        table = self.table()
        name = f", {label}" if label else ""
        for column, colour, marker, what in (
            ("evenness", "C0", "", "weakest pulse"),
            ("ringing", "C1", ".", "ringing"),
        ):
            line |= {"color": colour, "marker": marker, "label": what + name}
            ax.plot(x, 100 * table[column], **line)
        style.limit(ax, 100 * TOLERANCE.evenness, "weakest pulse,\nat least")
        style.limit(ax, 100 * TOLERANCE.ringing, "ringing,\nat most")
        ax.set(ylabel="share of the largest pulse [%]", ylim=(0, 112))
        style.legend(ax, 2)
        return ax


@checked
def compare(plans: Mapping[Any, Plan]) -> Comparison:
    """Compare how the responses of slaves come over in several plans.

    Parameters
    ----------
    plans : mapping of str or float to Plan
        The plans, each of one segment, by name or by what differs, such as the length [m].

    Returns
    -------
    Comparison
        It has ``table(by_slave=False)``, ``within_tolerance`` and ``plot(ax)``.

    Raises
    ------
    ArgumentError
        If there is no plan.

    Examples
    --------
    >>> from shipnet.asi.topologies import line
    >>> lengths = compare({m: line(m, slaves=(5, m)) for m in (50, 100, 200)})
    >>> lengths.table()["evenness"].round(2).to_dict()
    {50: 0.91, 100: 0.95, 200: 0.36}
    >>> lengths.within_tolerance.tolist()
    [True, True, False]
    """
    if not plans:
        raise ArgumentError("plans are empty; there must be at least one")
    return Comparison({name: plan.quality() for name, plan in plans.items()})
