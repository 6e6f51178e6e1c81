"""The plan of an AS-i installation: its elements and connections.

Cables that meet at nodes form a *segment*, one electrical network. Segments coupled by repeaters
form a *line*, which one master polls. A plan may have several lines.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from os import PathLike
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from shipnet import style
from shipnet.answers import Findings, Utilisation
from shipnet.arrays import Bools, Floats
from shipnet.asi.master import Master
from shipnet.asi.plan_file import Notes, note_key, read_elements, write_elements
from shipnet.asi.receiver import RECEIVERS, TOLERANCE, Disturbance, RNGLike
from shipnet.asi.recording import record_segment
from shipnet.asi.rules import check_lines
from shipnet.asi.segment import (
    PROBES,
    Element,
    Groups,
    Quality,
    Repeater,
    Segment,
    Supply,
    Terminator,
    nodes_of,
    shortest_paths,
    structure_faults,
)
from shipnet.asi.slave import Slave
from shipnet.asi.telegram import RESPONSES
from shipnet.asi.timing import ADDRESSES, Cycle, Direction, ResponseTime, Transaction, polling_cycle
from shipnet.errors import ArgumentError
from shipnet.fields import check_scalar
from shipnet.html import as_html
from shipnet.lazy import Axes, pd
from shipnet.line.network import CableRun, Network
from shipnet.line.waveform import Waveform as LineWaveform
from shipnet.style import LIMIT

if TYPE_CHECKING:
    from shipnet.asi.improvement import Improvement
    from shipnet.asi.receiver import Waveform
    from shipnet.asi.telegram import Request, Response

_E = TypeVar("_E", bound=Element)


#: Classes of elements, by the attribute of `Plan` that contains them.
_KINDS: dict[str, type[Element]] = {
    "cables": CableRun,
    "masters": Master,
    "supplies": Supply,
    "slaves": Slave,
    "repeaters": Repeater,
    "terminators": Terminator,
}

#: Marker, colour and size of each legend entry; later entries are drawn on top.
_MARKS: dict[str, tuple[Any, str, int]] = {
    "supply": (6, "C4", 12),  # a caret whose tip is at the node
    "master": ("s", "0.2", 7),
    "repeater": ("D", "C1", 6),
    "terminator": ("|", "0.2", 14),
    "slave": ("o", "C0", 4),
    "slave, passed": ("o", "C0", 4),
    "slave, failed": ("X", LIMIT["color"], 7),
}

#: Slaves, or else nodes with slaves, are labelled in a drawing if there are at most this many.
_NAMED = 12


@dataclass(frozen=True, repr=False)
class Plan:
    """An installation: cables and the devices on them.

    Parameters
    ----------
    cables : iterable of CableRun
        Cables; at least one.
    masters : iterable of Master, optional
        Masters, one per line; any other number violates a rule.
    supplies : iterable of Supply, optional
        Supplies, one per segment; any other number violates a rule.
    slaves : iterable of Slave, optional
        Slaves, each at a node of a cable.
    repeaters : iterable of Repeater, optional
        Repeaters, each between two segments.
    terminators : iterable of Terminator, optional
        Terminators or extension plugs.
    notes : mapping of tuple to str, optional
        Remarks, without effect, by the kind, the nodes and the address of an element, for example
        ``{("slave", "deck", "12A"): "spare"}``.
    remarks : sequence of str, optional
        Remarks on rows and columns of the file that were not used, filled in or assumed.

    Raises
    ------
    ArgumentError
        If the elements do not form a network: two cables connect the same two nodes, a segment
        has two rings, a device has no node, no cable reaches its node, a repeater has both ends in
        one segment, or telegrams have two paths. The error names all such faults.

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
    notes: Notes = field(default_factory=dict, compare=False)
    remarks: Sequence[str] = field(default=(), compare=False)

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
        parts = [("master", self.masters), ("slave", self.slaves), ("repeater", self.repeaters)]
        counts = [(name, len(some)) for name, some in [*parts, ("segment", self.segments)]]
        return ", ".join(f"{n} {name}{'s' if n != 1 else ''}" for name, n in counts)

    def __repr__(self) -> str:
        return f"<Plan: {'; '.join([str(self), *self.remarks])}>"

    def _repr_html_(self) -> str:
        rows = [(str(one), one.length, one.reach, len(one.slaves)) for one in self.segments]
        table = pd.DataFrame(rows, columns=["segment", "length_m", "reach_m", "slaves"])
        return as_html(self, table=table.set_index("segment"))

    # Structure ---------------------------------------------------------------------------------

    @cached_property
    def segments(self) -> tuple[Segment, ...]:
        """Segments of the plan, in the order in which their first cables are listed."""
        groups, lines = Groups(), Groups()
        for cable in self.cables:
            groups.join(cable.a, cable.b)
        ends = [(one, node) for one in self.repeaters for node in (one.a, one.b)]
        for repeater in self.repeaters:
            lines.join(groups.leader(repeater.a), groups.leader(repeater.b))
        leaders = list(dict.fromkeys(groups.leader(cable.a) for cable in self.cables))
        order = list(dict.fromkeys(map(lines.leader, leaders)))

        def within(elements: Iterable[_E], leader: str) -> tuple[_E, ...]:
            return tuple(e for e in elements if groups.leader(nodes_of(e)[0]) == leader)

        # Follow each line from its first master outward, repeater by repeater.
        reached: dict[str, tuple[str, tuple[Repeater, ...], float]] = {}
        for master in self.masters:
            if groups.leader(master.node) in reached:
                continue
            waiting: list[tuple[str, tuple[Repeater, ...], float]] = [(master.node, (), 0.0)]
            while waiting:
                head, path, lead = waiting.pop(0)
                here = groups.leader(head)
                reached[here] = (head, path, lead)
                metres = shortest_paths(within(self.cables, here), head)
                for repeater, near in ends:
                    far = repeater.b if near == repeater.a else repeater.a
                    if groups.leader(near) == here and groups.leader(far) not in reached:
                        waiting.append((far, (*path, repeater), lead + metres[near]))
        return tuple(
            Segment(
                order.index(lines.leader(leader)),
                within(self.cables, leader),
                within(self.masters, leader),
                within(self.supplies, leader),
                within(self.slaves, leader),
                within(self.terminators, leader),
                tuple(end for end in ends if groups.leader(end[1]) == leader),
                *reached.get(leader, (None, (), 0.0)),
            )
            for leader in leaders
        )

    @property
    def lines(self) -> tuple[tuple[Segment, ...], ...]:
        """Segments of each line."""
        numbers = dict.fromkeys(segment.line for segment in self.segments)
        return tuple(tuple(one for one in self.segments if one.line == n) for n in numbers)

    @cached_property
    def located(self) -> list[tuple[Slave, Segment]]:
        """Each slave with its segment."""
        where = {id(slave): segment for segment in self.segments for slave in segment.slaves}
        return [(slave, where[id(slave)]) for slave in self.slaves]

    def only(self, what: str) -> Segment:
        """Return the only segment, or raise an error that names `what` if there are several."""
        if len(self.segments) != 1:
            raise ArgumentError(
                f"{what} needs a plan of one segment; this one has {len(self.segments)}: "
                "make a plan of each without the repeaters"
            )
        return self.segments[0]

    def only_line(self, what: str) -> tuple[Segment, ...]:
        """Return the segments of the only line, or raise an error that names `what`."""
        if len(self.lines) != 1:
            raise ArgumentError(f"{what} needs a plan of one line; this one has {len(self.lines)}")
        return self.lines[0]

    # Other plans -------------------------------------------------------------------------------

    def with_repeater(
        self, node: str, other: Plan, *, delay: float = 6e-6, prefix: str = "2/"
    ) -> Plan:
        """Return this plan extended by another plan downstream of a repeater at `node`.

        The repeater replaces the other plan's only master. The other plan's node names get the
        `prefix`; its addresses are increased by the highest address of this plan.
        """
        if len(other.masters) != 1:
            raise ArgumentError(
                f"the other plan has {len(other.masters)} masters; it must have one"
            )
        taken = {end for run in self.cables for end in (run.a, run.b)}
        clash = sorted(taken & {prefix + end for run in other.cables for end in (run.a, run.b)})
        if clash:
            raise ArgumentError(f"prefix is {prefix!r}; both plans would have a node {clash[0]!r}")
        last = max((slave.address for slave in self.slaves), default=0)
        moved: list[Element] = []
        notes = dict(self.notes)
        for element in other:
            names = [name for name in ("node", "a", "b") if hasattr(element, name)]
            changes: dict[str, Any] = {name: prefix + getattr(element, name) for name in names}
            if isinstance(element, Slave):
                changes["label"] = f"{element.address + last}{element.half or ''}"
            if not isinstance(element, Master):
                moved.append(replace(element, **changes))
                notes[note_key(moved[-1])] = other.notes.get(note_key(element), "")
        link = Repeater(node, prefix + other.masters[0].node, delay)
        return plan_of([*self, *moved, link], notes)

    def save(self, path: str | PathLike[str]) -> None:
        """Write the plan and its notes to a CSV file or an Excel workbook for `read_plan`."""
        write_elements(list(self), path, self.notes)

    # Evaluation --------------------------------------------------------------------------------

    def check(
        self,
        *,
        wanted_cycle: float | None = None,
        transaction: Transaction | None = None,
        limits: pd.DataFrame | None = None,
    ) -> PlanFindings:
        """Check the plan against the rules of AS-i.

        The rule ``update_time`` requires that each slave is polled at least every `wanted_cycle`
        [s]; without `wanted_cycle` it is omitted. `limits` is a table like that of `rule_limits`.
        A segment has a row ``voltages_and_signals`` with the verdict ``not verified`` and the
        reason if its line has no master, or if the segment has slaves, or repeaters to further
        segments, but not exactly one supply.

        Signal values are the worst of all responses and three requests; `quality` uses responses
        only. They are computed for nominal cables and assumed decoupling, send current and
        repeaters: they identify the critical slave, but its margin in millivolts is uncertain. The
        limit of 500 m between two slaves is not a separate rule: it follows from segments of 100 m
        and at most two repeaters on each side of the master.
        """
        return PlanFindings(check_lines(self.lines, wanted_cycle, transaction, limits), self)

    def improve(self, *, limits: pd.DataFrame | None = None) -> Improvement:
        """Return this plan with the fewest repeaters and supplies with which it meets every rule.

        The search tries a repeater at each node, for each way to divide the node's cables and with
        the node's devices on either side, and a supply at each node of a segment that lacks one. It
        adds at most four repeaters, divides no ring, removes nothing, and stops after 2000 tries.
        If no such plan meets the rules on segments, nothing is added. The rules on a line, its
        addresses and the voltages of its supplies are left to the user. `limits` is as in `check`.
        The result has the new `plan`, a table `added` with the rule that required each device, as
        in the plan's notes, and a `verdict` with the rules cured and those that stay.
        """
        from shipnet.asi.improvement import improved

        return improved(self, limits)

    def diff(self, other: Plan) -> pd.DataFrame:
        """Return what the `other` plan changes: one row per element added, removed or changed."""
        from shipnet.asi.differences import differences

        return differences(self, other)

    @property
    def network(self) -> Network:
        """Cables and loads at signal frequencies, for a one-segment plan."""
        return self.only("network").network

    def waveform(
        self,
        telegrams: Request | Response | str | Sequence[str] | None = None,
        node: str | None = None,
        *,
        dt: float = 250e-9,
        before: float | None = None,
        after: float = 18.5e-6,
    ) -> Waveform:
        """Return the signal voltages of telegrams between the master and each slave, or one `node`.

        `telegrams` is one telegram, or the bits of several telegrams of equal length; the default
        is all 16 responses. The voltages exclude the supply's 30 V and are the same in both
        directions. The time between samples, `dt` [s], must be 3 us divided by an integer; they
        begin `before` [s] before the telegram and end `after` [s] after it. By default, `before` is
        the usual pause in which the receiver listens: 12 us before a request, and 18 us before a
        response. The plan must have one segment with a master.
        """
        segment = self.only("waveform")
        nodes = [node for _, node in segment.listeners] if node is None else [node]
        words = RESPONSES if telegrams is None else getattr(telegrams, "bits", telegrams)
        (wave,) = segment.waveforms(nodes, words, dt=dt, before=before, after=after)
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
        """Simulate an oscilloscope record of a master polling the slaves of a one-segment plan.

        Each slave responds to the requests that it receives; the master repeats requests, drops
        slaves and searches for new ones. All slaves are active at first; their inputs are random.

        The record shows the voltage at `node`, by default the master's, for a `duration` of
        1e-3..0.2 s. The time step `dt`, 50e-9..500e-9 s, must be 3 us divided by an integer.
        `weak` maps slave labels to send currents relative to 60 mA, 0..10. A `disturbance` from
        `shipnet.asi.emc` with an `amplitude` [V] is added equally at all nodes.

        Examples
        --------
        >>> from shipnet.asi import decode, line
        >>> capture = decode(line(80, slaves=(1, 40, 80)).record(5e-3, rng=2024))
        >>> print(capture.summary().seen, capture.causes().index.tolist())
        ['1', '2', '3'] []
        """
        return record_segment(
            self.only("record"),
            duration,
            node=node,
            dt=dt,
            weak=weak or {},
            disturbance=disturbance,
            amplitude=amplitude,
            rng=rng,
        )

    def quality(self) -> Quality:
        """Return the signal quality of each slave's 16 responses, for a one-segment plan."""
        segment = self.only("quality")
        signals = segment.quality([slave.node for slave in segment.slaves], RESPONSES)
        return signals._replace(slaves=tuple(slave.label for slave in segment.slaves))

    def error_rates(self, noise_density: float, *, before: float | None = None) -> pd.DataFrame:
        """Return the error rates of telegrams in white noise, for a one-segment plan.

        The noise at every receiver has the one-sided `noise_density` [V per root hertz]. The table
        has one row per slave and receiver of `RECEIVERS`: the receiver's `minimum_V`; the noise
        margin `margin_V`, the largest voltage of noise after the filter that changes no decision,
        whatever its shape; and the probability that a `request`, a `response`, or either of them
        (`exchange`) is not received correctly. What cannot be computed is NaN; `why` gives the
        reason.

        At low noise, most errors are false starts in the silence before a telegram, `before` [s] or
        the default of `waveform`; see `request_silence_s` and `response_silence_s`.
        """
        from shipnet.asi.emc.error_rates import error_rate, noise_margin

        check_scalar("noise_density", noise_density, "V per root hertz", 1e-12, 1e6)
        waves = self.waveform(PROBES, before=before), self.waveform(before=before)
        rows = []
        for index, slave in enumerate(self.slaves):
            of_slave = [replace(wave, u=wave.u[index], names=()) for wave in waves]
            for name, receiver in RECEIVERS.items():
                margin, why = np.nan, ""
                try:
                    margin = min(noise_margin(wave, receiver) for wave in of_slave)
                    request, response = (
                        error_rate(wave, noise_density, receiver=receiver).item()
                        for wave in of_slave
                    )
                except ArgumentError as reason:
                    request, response, why = np.nan, np.nan, str(reason)
                exchange = request + response - request * response
                least = receiver.minimum, margin
                rows.append((slave.label, name, *least, request, response, exchange, why))
        columns = "slave receiver minimum_V margin_V request response exchange why".split()
        table = pd.DataFrame(rows, columns=columns).set_index(["slave", "receiver"])
        silences = {"request_silence_s": -waves[0].start, "response_silence_s": -waves[1].start}
        return table.assign(**silences)

    @property
    def voltages(self) -> dict[str, float]:
        """Supply voltage at each node [V]; each segment must have one supply."""
        return dict(pair for segment in self.segments for pair in segment.voltages.items())

    @property
    def cycle(self) -> Cycle:
        """Polling cycle of a plan that has one line; `cycles` has one per line."""
        self.only_line("cycle")
        return self.cycles[0]

    @property
    def cycles(self) -> tuple[Cycle, ...]:
        """Polling cycle of each line."""
        parts = [
            [(slave.address, one.delay) for one in line for slave in one.slaves]
            for line in self.lines
        ]
        return tuple(map(polling_cycle, parts))

    def response_times(
        self,
        *,
        direction: Direction = "in",
        repetitions: int | None = None,
        input_filter: float = 0.0,
        gateway: float = 0.0,
        host_cycle: float = 0.0,
    ) -> pd.DataFrame:
        """Return the response times of each slave.

        The columns `best_s`, `typical_s` and `worst_s` are computed by `Cycle.response_time`, and
        `update_s` by `Cycle.update_time`; both count the repeaters before each slave. All four are
        NaN, with the reason in `why`, if the number of exchanges that a profile needs for its
        values is unknown, or if repeaters delay a response beyond the master's time-out. The index
        is the `slave`; in a plan of several lines it is the `line`, from 1, and the `slave`.

        By default, the times end at the AS-i master. Three times of up to 10 s extend them to the
        host: the delay of the slave's `input_filter` (for inputs only; Beckhoff, EP1xxx: 3 ms), the
        longest time that a value spends in the `gateway` and on the host's bus (PROFIBUS: two DP
        cycles according to Siemens, CPU 31xC, 2004, p. 5-17), and the `host_cycle`, once per which
        the host reads and writes (10 to 60 ms in Schneider's AS-i help D-SA-0011791). The worst
        case has all in full, the typical case half of the last two, the best case only the filter.
        What the host's program takes to react must be added.
        """
        waits = check_scalar("gateway", gateway, "s", 0, 10)
        waits += check_scalar("host_cycle", host_cycle, "s", 0, 10)
        if check_scalar("input_filter", input_filter, "s", 0, 10) and direction == "out":
            raise ArgumentError(
                f"input_filter is {input_filter:g} s; outputs have none, so omit it"
            )
        extra = input_filter + np.array([0.0, waits / 2, waits])
        cycles, one = self.cycles, Transaction()
        used = Counter((segment.line, slave.address) for slave, segment in self.located)
        rows = []
        for slave, segment in self.located:
            cycle, delay = cycles[segment.line], segment.delay
            polled: dict[str, Any] = {
                "channels": slave.channels,
                "direction": direction,
                "paired": used[segment.line, slave.address] > 1,
            }
            try:
                if one.master_pause * one.bit_time + 2 * delay > one.timeout * one.bit_time:
                    raise ArgumentError("its repeaters delay responses beyond the time-out")
                renewed = cycle.update_time(slave.kind, **polled)
            except ArgumentError as unknown:
                rows.append((segment.line + 1, slave.label, *[np.nan] * 4, str(unknown)))
                continue
            polled |= {"conversion": slave.conversion, "delay": delay, "repetitions": repetitions}
            times = cycle.response_time(slave.kind, **polled)
            rows.append((segment.line + 1, slave.label, *(times + extra), renewed, ""))
        columns = [*(f"{name}_s" for name in ResponseTime._fields), "update_s", "why"]
        table = pd.DataFrame(rows, columns=["line", "slave", *columns])
        several = table.set_index(["line", "slave"])
        return several.droplevel("line") if len(cycles) == 1 else several

    def utilisation(self, update: float) -> Utilisation:
        """Return the busiest line's utilisation if points need an update every `update` [s]."""
        check_scalar("update", update, "s", 1e-6, 1e6)
        times, cycles = self.response_times(), self.cycles
        addresses = max(cycle.addresses for cycle in cycles)
        shares = [addresses / ADDRESSES, *(times["update_s"] / update)]
        worst = times["worst_s"].max(skipna=False)
        busy = max(cycle.bus_time for cycle in cycles)
        return Utilisation(busy, float(np.max(shares)), float(worst))

    @style.applied
    def plot(self, findings: PlanFindings | None = None, *, ax: Axes | None = None) -> Axes:
        """Draw the plan with cable lengths to scale; slaves that violate a rule are red crosses.

        The cables of a segment that violates a rule, or is not verified, are red. A cable that
        closes a ring is dashed. At most 12 slaves are labelled; of more slaves, at most 12 nodes
        have their name and, in brackets, number of slaves.
        """
        ax = style.axes(ax)
        table = None if findings is None else findings.table()
        failed = set() if table is None else set(table.loc[table["verdict"] != "met", "object"])
        points: dict[str, list[Floats]] = {kind: [] for kind in _MARKS}
        spots: dict[str, Floats] = {}
        top = 0.0
        for segment in self.segments:
            network = segment.network
            placed = network.layout(segment.head)
            origin = np.array([segment.lead, top])
            spots |= dict(zip(network.nodes, placed.spot + origin, strict=True))
            colour = LIMIT["color"] if str(segment) in failed else "0.6"
            for stroke in placed.strokes:
                ax.plot(*(stroke + origin[:, np.newaxis]), color=colour, zorder=1)
            if placed.closing is not None:
                ax.plot(*(placed.closing + origin[:, np.newaxis]), "--", color=colour, zorder=1)
            top += placed.lowest - 1.5
        devices: tuple[Any, ...] = (*self.masters, *self.supplies, *self.terminators)
        for device in devices:
            points[type(device).__name__.lower()].append(spots[device.node])
        for repeater in self.repeaters:
            ends = np.array([spots[repeater.a], spots[repeater.b]])
            ax.plot(*ends.T, ":", color="C1", zorder=1)
            # Keep the marker clear of the branches at the upper node.
            points["repeater"].append(ends[ends[:, 1].argmin()] + [0, 0.75])
        for slave in self.slaves:
            verdict = ", failed" if str(slave) in failed else ", passed"
            points["slave" + ("" if findings is None else verdict)].append(spots[slave.node])
        at_node: dict[str, list[str]] = {}
        for slave in self.slaves:
            at_node.setdefault(slave.node, []).append(slave.label)
        for node, labels in at_node.items() if len(at_node) <= _NAMED else ():
            few = len(self.slaves) <= _NAMED
            text = " ".join(labels) if few else f"{node} ({len(labels)})"
            above: dict[str, Any] = {"textcoords": "offset points", "ha": "center"}
            ax.annotate(style.literal(text), tuple(spots[node]), (0, 6), **above)
        for label, (marker, colour, size) in _MARKS.items():
            if points[label]:
                look = {"marker": marker, "color": colour, "markersize": size, "linestyle": "none"}
                ax.plot(*np.reshape(points[label], (-1, 2)).T, label=label, **look)
        ax.spines["left"].set_visible(False)
        ax.set(xlabel="distance from the master [m]", yticks=[])
        ax.set_ylim(1.04 * top + 0.7, 0.8 - 0.04 * top)
        style.legend(ax, 6)
        return ax


class PlanFindings(Findings):
    """Findings of a plan, which can also be shown in a drawing of the plan."""

    def __init__(self, table: pd.DataFrame, plan: Plan) -> None:
        super().__init__(table)
        self.plan = plan

    def plot(self, *, ax: Axes | None = None) -> Axes:
        """Draw the plan; slaves that violate a rule are red crosses."""
        return self.plan.plot(self, ax=ax)


def plan_of(elements: Iterable[Element], notes: Notes | None = None) -> Plan:
    """Return a plan with the given elements, which may be in any order."""
    every = list(elements)
    kinds: dict[str, Any] = {
        name: [one for one in every if isinstance(one, kind)] for name, kind in _KINDS.items()
    }
    return Plan(**kinds, notes=notes or {})


def read_plan(path: str | PathLike[str]) -> Plan:
    """Read a plan from a CSV file or an Excel workbook.

    Parameters
    ----------
    path : path
        Table with column titles and one row per element: an Excel workbook, or text separated by
        commas, semicolons or tabs and encoded in UTF-8, UTF-16 with a byte order mark, or
        Windows-1252. With semicolons or tabs as separators, numbers may have decimal commas.

    Returns
    -------
    Plan
        Plan with the elements in the order of their rows.

    Raises
    ------
    InputError
        If the file cannot be read or does not describe a network. The error lists all faults, each
        with its row, column, value and the legal values.

    Examples
    --------
    >>> from shipnet import datasets
    >>> plan = read_plan(datasets.path("synthetic_asi_plan_300m.csv"))
    >>> len(plan.slaves), [f"{segment.length:.0f} m" for segment in plan.segments]
    (62, ['100 m', '100 m', '100 m'])
    """
    elements, notes, remarks = read_elements(path)
    return replace(plan_of(elements, notes), remarks=remarks)


class Comparison:
    """Signal quality of several plans, by name of the plan."""

    def __init__(self, qualities: Mapping[Any, Quality]) -> None:
        self.qualities = dict(qualities)

    def __repr__(self) -> str:
        good = int(self.within_tolerance.sum())
        return f"<Comparison: {len(self.qualities)} plans, {good} within tolerance>"

    def _repr_html_(self) -> str:
        return as_html(self, ok=bool(self.within_tolerance.all()))

    def table(self) -> pd.DataFrame:
        """Return the worst values of all slaves, one row per plan."""
        rows = {}
        for name, q in self.qualities.items():
            worst = q.received.min(), q.level_least.min(), q.evenness.min(), q.ringing.max()
            rows[name] = len(q.received), *worst
        columns = ["slaves", "received", "level_least_Vpp", "evenness", "ringing"]
        return pd.DataFrame.from_dict(rows, orient="index", columns=columns).rename_axis("plan")

    @property
    def within_tolerance(self) -> Bools:
        """True for each plan whose slaves all meet the tolerances of evenness and ringing."""
        return np.array([bool(one.within_tolerance.all()) for one in self.qualities.values()])

    @style.applied
    def plot(self, ax: Axes | None = None, *, label: str = "", **line: Any) -> Axes:
        """Plot weakest pulse and ringing over the names if all are numbers, else over 1, 2, ..."""
        names = list(self.qualities)
        numbers = all(isinstance(name, int | float | np.number) for name in names)
        x = names if numbers else range(1, len(names) + 1)
        ax = style.axes(ax)
        table = self.table()
        name = f", {label}" if label else ""
        ax.plot(x, 100 * table["evenness"], color="C0", label="weakest pulse" + name, **line)
        ax.plot(x, 100 * table["ringing"], color="C1", marker=".", label="ringing" + name, **line)
        least, most = 100 * TOLERANCE.evenness, 100 * TOLERANCE.ringing
        style.limit(ax, least, f"weakest pulse:\nat least {least:g} %")
        style.limit(ax, most, f"ringing:\nat most {most:g} %")
        ax.set(ylabel="fraction of the largest pulse [%]", ylim=(0, 112))
        style.legend(ax, 2)
        return ax


def compare(plans: Mapping[Any, Plan]) -> Comparison:
    """Compare the quality of the slaves' responses in several plans.

    Parameters
    ----------
    plans : mapping of str or float to Plan
        One-segment plans, at least one, by name or by a number such as the length [m].

    Returns
    -------
    Comparison
        Signal quality per plan: ``table()``, ``within_tolerance`` and ``plot(ax)``.

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
