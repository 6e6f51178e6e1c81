"""A segment of a plan, one electrical network: its devices, supply voltages and telegrams.

The voltages of telegrams are those of the signal, without the supply's 30 V.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from heapq import heappop, heappush
from math import ceil
from typing import Any, NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt

from shipnet.arrays import Bools, Complexes, Floats
from shipnet.asi.master import Master
from shipnet.asi.modulation import HALF_BIT, SEND_CURRENT, Modulation, ramp_spectrum
from shipnet.asi.receiver import TOLERANCE, Waveform, receive
from shipnet.asi.slave import CURRENT, DEVICE, Slave
from shipnet.asi.telegram import RESPONSE_BITS, RESPONSES
from shipnet.asi.timing import Transaction
from shipnet.errors import ArgumentError
from shipnet.fields import check_fields, check_scalar, number, part, record, text
from shipnet.html import as_html
from shipnet.lazy import pd
from shipnet.line.network import CableRun as CableRun
from shipnet.line.network import Load, Network, check_node
from shipnet.line.waveform import F_MAX, record_of

#: Decoupling of the power supply, 39 ohm || 50 uH in each wire: assumed, following IEC 62026-2.
POWER_SUPPLY = Load(r=78.0, l=100e-6)


@record
class Supply:
    """A power supply with its decoupling, by default 39 ohm || 50 uH in each wire.

    Examples
    --------
    >>> print(Supply("bridge", rating=4))
    supply at bridge
    """

    node: str = text("Node of the supply")
    voltage: float = number(1, 60, "V", "Voltage", default=30.0)
    rating: float = number(0.01, 100, "A", "Maximum current", default=8.0)
    load: Load = part(Load, "Load for signals", default=POWER_SUPPLY, kw_only=True)

    def __post_init__(self) -> None:
        check_fields(self)
        check_node(self.node)

    def __str__(self) -> str:
        return f"supply at {self.node}"


@record
class Repeater:
    """A repeater, which couples two segments and passes telegrams but no current.

    We found no manufacturer's figure for the delay; the default is one bit time. With two such
    repeaters in series, the slowest response meets the time-out of 10 bit times; with three, it
    does not. The current is assumed to equal a slave's.

    Examples
    --------
    >>> print(Repeater("deck", "hold"))
    repeater deck | hold
    """

    a: str = text("Node in one segment")
    b: str = text("Node in the other segment")
    delay: float = number(0, 1e-3, "s", "Delay in one direction", default=6e-6)
    current: float = number(0, 10, "A", "Current drawn from each segment", default=CURRENT)

    def __post_init__(self) -> None:
        check_fields(self)
        check_node(self.a)
        check_node(self.b)

    def __str__(self) -> str:
        return f"repeater {self.a} | {self.b}"


@record
class Terminator:
    """A terminator or extension plug: a resistor in parallel with an inductor.

    No maker publishes the circuit of such a device. The defaults are assumed, so that a line of the
    makers' 200 m meets all limits for signals with up to 16 slaves; more slaves lower its signals.
    A resistor alone also absorbs the echo, but the pulses then decay too slowly.

    Examples
    --------
    >>> print(Terminator("bow"))
    terminator at bow
    """

    node: str = text("Node of the terminator")
    resistance: float = number(1, 1e6, "ohm", "Resistance", default=180.0)
    inductance: float = number(1e-6, 1e3, "H", "Inductance; 1000 H for none", default=300e-6)

    def __post_init__(self) -> None:
        check_fields(self)
        check_node(self.node)

    def __str__(self) -> str:
        return f"terminator at {self.node}"


#: Elements of a plan.
Element: TypeAlias = CableRun | Master | Supply | Slave | Terminator | Repeater

#: The worst of all 2048 requests: the first has the fewest pulses and so the smallest signal;
#: the others have runs of ones or zeros, which are the most uneven. A test tries all requests.
PROBES = ("01010101010101", "01111111111111", "00011111111111")


def step_response(
    network: Network,
    sender: str,
    rows: Sequence[int],
    size: int,
    dt: float,
    before: float = 0.0,
    f_max: float = F_MAX,
) -> Floats:
    """Return the voltage [V] in `rows` of the network if the current steps at `before` [s]."""

    def voltage(s: Complexes) -> Complexes:
        step = -SEND_CURRENT * ramp_spectrum(s) / s * np.exp(-s * before)
        return np.asarray(network.transfer(sender, s)[..., rows, :] * step)

    return record_of(voltage, size, dt, f_max)


def telegram_voltages(
    network: Network,
    master: str,
    nodes: Sequence[str],
    *bits: str | Sequence[str] | npt.ArrayLike,
    dt: float = 250e-9,
    before: float = 6.5e-6,
    after: float = 18.5e-6,
    f_max: float = F_MAX,
) -> list[Floats]:
    """Return voltages [V], shape (n_nodes, n_words, n_t), per batch of equally long telegrams.

    The voltages are those at the nodes if the master sends, and at the master if the nodes send. At
    the default `f_max` [Hz] their error is at most 5e-5 of the peak on networks of up to 300 m.
    """
    many = [np.atleast_2d(Modulation(batch).steps).astype(float) for batch in bits]
    before = check_scalar("before", before, "s", 0, 1.0)
    after = check_scalar("after", after, "s", 0, 1.0)
    dt = check_scalar("dt", dt, "s", 1e-9, 1e-6)
    slot = round(HALF_BIT / dt)
    if abs(slot * dt / HALF_BIT - 1) > 1e-9:
        raise ArgumentError(f"dt is {dt} s; it must be {HALF_BIT} s divided by an integer")
    # The record has a whole number of samples; any other length would stretch its time axis.
    sizes = [ceil(round((before + steps.shape[1] * HALF_BIT + after) / dt, 6)) for steps in many]
    rows = [network.index(node, "node") for node in nodes]
    # A telegram is a sequence of equal current steps.
    response = step_response(network, master, rows, max(sizes), dt, before, f_max)
    voltages = []
    for steps, n_t in zip(many, sizes, strict=True):
        changes = np.zeros((len(nodes), steps.shape[1], n_t))
        for step in range(steps.shape[1]):
            changes[:, step, step * slot :] = response[:, : n_t - step * slot]
        voltages.append(np.asarray(steps @ changes))
    return voltages


class Quality(NamedTuple):
    """Signal quality between a master and each slave: the worst values of all telegrams.

    It is the same in both directions if master and slave send with the same current. Senders are
    assumed not to clip; real ones may.

    Attributes
    ----------
    level_least, level_most : ndarray of float, shape (n_slaves,)
        Smallest and largest peak-to-peak voltage of a telegram [V].
    evenness : ndarray of float, shape (n_slaves,)
        Smallest pulse divided by largest pulse of a telegram, 0..1; 0 if no pulse is received.
    ringing : ndarray of float, shape (n_slaves,)
        Largest voltage outside pulses divided by largest pulse; 1 if no pulse is received.
    received : ndarray of float, shape (n_slaves,)
        Fraction of the telegrams that are received correctly, 0..1.
    slaves : tuple of str
        Labels of the slaves.

    Examples
    --------
    >>> from shipnet.asi.topologies import line
    >>> quality = line(100, slaves=(5, 100)).quality()
    >>> quality.table()[["level_least_Vpp", "evenness", "ringing"]].round(2).values.tolist()
    [[4.85, 0.96, 0.09], [6.48, 0.95, 0.06]]
    """

    level_least: Floats
    level_most: Floats
    evenness: Floats
    ringing: Floats
    received: Floats
    slaves: tuple[str, ...] = ()

    def __repr__(self) -> str:
        good = f"{int(self.within_tolerance.sum())} of {len(self.received)} slaves"
        worst = f"evenness from {self.evenness.min():.2f}, ringing up to {self.ringing.max():.2f}"
        return f"Quality({good} within tolerance; {worst})"

    def _repr_html_(self) -> str:
        least, most = TOLERANCE.evenness, TOLERANCE.ringing
        rows = self.table()[["evenness", "ringing"]].assign(least_evenness=least, most_ringing=most)
        rows["margin"] = np.minimum(self.evenness - least, most - self.ringing)
        return as_html(self, rows.sort_values("margin"), ok=bool(self.within_tolerance.all()))

    def table(self) -> pd.DataFrame:
        """Return a table with one row per slave."""
        columns = ["level_least_Vpp", "level_most_Vpp", "evenness", "ringing", "received"]
        index = pd.Index(self.slaves or range(1, len(self.received) + 1), name="slave")
        return pd.DataFrame(dict(zip(columns, self[:5], strict=True)), index=index)

    @property
    def within_tolerance(self) -> Bools:
        """True for each slave that meets the tolerances of evenness and ringing."""
        even, quiet = self.evenness >= TOLERANCE.evenness, self.ringing <= TOLERANCE.ringing
        return np.asarray(even & quiet)


def quality_of(*waves: Waveform) -> Quality:
    """Return the quality at each node, over all telegrams of waveforms with the same nodes."""
    parts = []
    for wave in waves:
        received = receive(wave.u, wave.dt, wave.bits.shape[-1])
        right = (received.error == 0) & (received.bits == wave.bits).all(axis=-1)
        weakest, ringing = np.nan_to_num(received.weakest), np.nan_to_num(received.ringing, nan=1.0)
        parts.append(np.stack([np.ptp(wave.u, axis=-1), weakest, ringing, right]))
    level, weakest, ringing, right = np.concatenate(parts, axis=2)
    levels = level.min(axis=1), level.max(axis=1)
    shapes = weakest.min(axis=1), ringing.max(axis=1)
    return Quality(*levels, *shapes, right.mean(axis=1), waves[0].names)


#: Time step of received telegrams, and silence before and after them [s].
_PADDED = {"dt": 250e-9, "before": 5e-6, "after": 55e-6}


@dataclass(frozen=True)
class Segment:
    """One electrical network of a plan, with its elements."""

    #: Index of the line to which it belongs.
    line: int
    cables: tuple[CableRun, ...]
    masters: tuple[Master, ...]
    supplies: tuple[Supply, ...]
    slaves: tuple[Slave, ...]
    terminators: tuple[Terminator, ...]
    #: Repeaters, each with its node in this segment.
    ports: tuple[tuple[Repeater, str], ...]
    #: Node of the master, or of the repeater that leads to it; None if the line has no master.
    head: str | None
    #: Repeaters between the master and this segment.
    path: tuple[Repeater, ...]
    #: Length of cable between the master and `head` [m].
    lead: float

    def __str__(self) -> str:
        return f"segment at {self.head or self.cables[0].a}"

    @property
    def length(self) -> float:
        """Total length of its cables [m]."""
        return sum(float(cable.length) for cable in self.cables)

    @property
    def delay(self) -> float:
        """Total delay of the repeaters on the way to the master, in one direction [s]."""
        return sum(repeater.delay for repeater in self.path)

    @property
    def draws(self) -> list[tuple[str, float]]:
        """Node and current [A] of each master, slave and repeater."""
        devices: tuple[Master | Slave, ...] = (*self.masters, *self.slaves)
        draws = [(device.node, device.current) for device in devices]
        return draws + [(node, repeater.current) for repeater, node in self.ports]

    @property
    def current(self) -> float:
        """Total current of its devices [A]."""
        return sum(current for _, current in self.draws)

    @cached_property
    def distances(self) -> dict[str, float]:
        """Shortest distance along the cable from `head` to each node [m]; empty without a head."""
        return {} if self.head is None else shortest_paths(self.cables, self.head)

    @property
    def reach(self) -> float:
        """Longest distance along the cable from the master to a node [m]; 0 without a master."""
        return self.lead + max(self.distances.values(), default=0.0)

    @property
    def listeners(self) -> list[tuple[str, str]]:
        """Name and node of each slave, then of each repeater that leads away from the master."""
        onward = [(str(repeater), node) for repeater, node in self.ports if node != self.head]
        return [(str(slave), slave.node) for slave in self.slaves] + onward

    @cached_property
    def network(self) -> Network:
        """Network of its cables and loads."""
        attached = [(device.node, device.load) for device in self.slaves]
        attached += [(device.node, DEVICE) for device in self.masters]
        attached += [(node, DEVICE) for _, node in self.ports]
        attached += [(supply.node, supply.load) for supply in self.supplies]
        attached += [
            (plug.node, Load(plug.resistance, plug.inductance)) for plug in self.terminators
        ]
        loads: dict[str, Load] = {}
        for node, load in attached:
            loads[node] = loads[node] + load if node in loads else load
        return Network(self.cables, loads)

    @cached_property
    def voltages(self) -> dict[str, float]:
        """Supply voltage at each node [V], at constant currents; the segment needs one supply.

        All voltages are 0 if the supply cannot drive the currents through the cables.
        """
        if len(self.supplies) != 1:
            raise ArgumentError(f"{self} has {len(self.supplies)} supplies; it must have one")
        drawn: dict[str, float] = {}
        for node, current in self.draws:
            drawn[node] = drawn.get(node, 0.0) + current
        (supply,) = self.supplies
        volts = self.network.operating_point(supply.node, supply.voltage, drawn)
        return {node: float(np.nan_to_num(one)) for node, one in volts.items()}

    def waveforms(
        self, nodes: Sequence[str], *words: Any, dt: float, before: float | None, after: float
    ) -> list[Waveform]:
        """Return the voltages of telegrams between `head` and nodes, one waveform per batch.

        If `before` is None, the batches begin with the pause before the first batch's telegrams.
        """
        if self.head is None:
            raise ArgumentError(f"{self} has no head; its line needs a master")
        if not nodes:
            raise ArgumentError(f"{self} has no slave; at least one must send or receive")
        bits = [Modulation(batch).bits for batch in words]
        if before is None:
            one, response = Transaction(), bits[0].shape[-1] == RESPONSE_BITS
            before = (one.master_pause if response else one.slave_pause) * one.bit_time
        voltages = telegram_voltages(
            self.network, self.head, nodes, *bits, dt=dt, before=before, after=after
        )
        return [
            Waveform(u if b.ndim == 2 else u[:, 0], dt, start=-before, names=tuple(nodes), bits=b)
            for u, b in zip(voltages, bits, strict=True)
        ]

    def quality(self, nodes: Sequence[str], *words: Sequence[str]) -> Quality:
        """Return the quality of batches of telegrams between `head` and nodes; nodes may repeat."""
        distinct = list(dict.fromkeys(nodes))
        quality = quality_of(*self.waveforms(distinct, *words, **_PADDED))
        rows = [distinct.index(node) for node in nodes]
        return Quality._make([*(values[rows] for values in quality[:5]), tuple(nodes)])


def signals_of(segments: Sequence[Segment]) -> list[Quality]:
    """Return the worst quality of the 16 responses and the `PROBES` for each listener."""
    listeners = [[node for _, node in segment.listeners] for segment in segments]
    nodes = [list(dict.fromkeys(repeated)) for repeated in listeners]
    waves = [
        segment.waveforms(distinct, RESPONSES, PROBES, **_PADDED)
        for segment, distinct in zip(segments, nodes, strict=True)
        if distinct or segment.head is None
    ]
    joined = [
        replace(batch[0], u=np.concatenate([wave.u for wave in batch]), names=())
        for batch in zip(*waves, strict=True)
    ]
    values = np.array(quality_of(*joined)[:5]) if joined else np.empty((5, 0))
    parts = np.split(values, np.cumsum([len(distinct) for distinct in nodes])[:-1], axis=1)
    return [
        Quality(*part[:, [distinct.index(node) for node in repeated]])
        for part, distinct, repeated in zip(parts, nodes, listeners, strict=False)
    ]


class Groups:
    """Disjoint groups of names (union-find; loading scipy for it would slow down `read_plan`)."""

    def __init__(self) -> None:
        self._parent: dict[str, str] = {}

    def __contains__(self, name: str) -> bool:
        return name in self._parent

    def leader(self, name: str) -> str:
        """Return the name that represents the group of `name`; a new name forms its own group."""
        self._parent.setdefault(name, name)
        while self._parent[name] != name:
            self._parent[name] = name = self._parent[self._parent[name]]
        return name

    def join(self, a: str, b: str) -> bool:
        """Join the groups of two names; return True if the groups were different."""
        a, b = self.leader(a), self.leader(b)
        self._parent[b] = a
        return a != b


def shortest_paths(cables: Iterable[CableRun], start: str) -> dict[str, float]:
    """Return the shortest distance along cables from a node to each connected node [m]."""
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
    """Return each element that prevents the plan from being a network, and the reason."""
    faults: list[tuple[Element, str]] = []
    groups, lines = Groups(), Groups()
    laid = set()
    closing = []
    cables = [element for element in elements if isinstance(element, CableRun)]
    for cable in cables:
        ends = frozenset((cable.a, cable.b))
        if ends in laid:
            faults.append((cable, f"{cable} joins two nodes that another cable already joins"))
        elif not groups.join(cable.a, cable.b):
            closing.append(cable)
        laid.add(ends)
    ringed = set()
    for cable in closing:
        segment = groups.leader(cable.a)
        if segment in ringed:
            faults.append((cable, f"{cable} closes a second ring; a segment may have at most one"))
        ringed.add(segment)
    for element in elements:
        if isinstance(element, CableRun):
            continue
        loose = [node for node in nodes_of(element) if node not in groups]
        for node in loose:
            fault = f": no cable reaches its node {node}" if node else " has no node; it needs one"
            faults.append((element, f"{element}{fault}"))
        if isinstance(element, Repeater) and not loose:
            a, b = groups.leader(element.a), groups.leader(element.b)
            if a == b:
                faults.append((element, f"{element} has both ends in one segment"))
            elif not lines.join(a, b):
                faults.append((element, f"{element} makes a second path for telegrams"))
    return faults


def nodes_of(element: Element) -> tuple[str, ...]:
    """Return the node, or both nodes, of an element."""
    if isinstance(element, CableRun | Repeater):
        return element.a, element.b
    return (element.node,)
