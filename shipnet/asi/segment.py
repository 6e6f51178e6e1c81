"""A segment of a plan: cables that meet at nodes, one electrical network.

It says which voltage of the supply is left at each node, which voltages telegrams make there, and
how well they come over. The voltages of telegrams are the signal alone: the 30 V on which it rides
are left out.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from heapq import heappop, heappush
from math import ceil
from typing import Any, NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt

from shipnet.arrays import Bools, Complexes, Floats
from shipnet.asi.elements import DEVICE, Repeater, Supply, Terminator
from shipnet.asi.master import Master
from shipnet.asi.modulation import HALF_BIT, SEND_CURRENT, Modulation, ramp_spectrum
from shipnet.asi.receiver import TOLERANCE, Waveform, receive
from shipnet.asi.slave import Slave
from shipnet.asi.telegram import RESPONSES, Request, Response
from shipnet.errors import ArgumentError
from shipnet.fields import check_scalar
from shipnet.lazy import pd
from shipnet.line.network import CableRun, Load, Network
from shipnet.line.waveform import F_MAX, laplace_grid, record_of, synthesize

#: What a plan is made of.
Element: TypeAlias = CableRun | Master | Supply | Slave | Terminator | Repeater

#: Requests that stand for all 2048: the first makes the least signal, as its pulses are the
#: fewest; runs of ones and of zeros make the most uneven one. A test tries them all.
PROBES = ("01010101010101", "01111111111111", "00011111111111")

#: For judging telegrams: when they begin in their record, and the silence around them [s].
_START, _SILENCE = 5e-6, 60e-6

#: A change of current fades in this time [s], if no more than a share is left at its end. The less
#: the damping [nepers], the less grows what the highest frequency leaves out.
_FADED, _LEFT, _DAMPING = 32e-6, 1e-6, 4.0

# Telegrams as voltages -------------------------------------------------------------------------


def telegram_voltages(
    network: Network,
    master: str,
    nodes: Sequence[str],
    bits: str | Sequence[str] | npt.ArrayLike,
    *,
    dt: float = 250e-9,
    before: float = 6.5e-6,
    after: float = 18.5e-6,
    f_max: float = F_MAX,
) -> Floats:
    """Return the voltages of telegrams between the master and nodes, (n_nodes, n_words, n_t).

    By reciprocity the master hears of a node what the node hears of the master. At the default
    `f_max` [Hz] every voltage is within 5e-5 of its node's peak, on lines, stubs, stars and trees
    of up to 300 m, with a supply or without.
    """
    return _voltages(network, master, nodes, [Modulation(bits)], dt, before, after, f_max)[0]


def _voltages(
    network: Network,
    master: str,
    nodes: Sequence[str],
    telegrams: Sequence[Modulation],
    dt: float,
    before: float,
    after: float,
    f_max: float = F_MAX,
) -> list[Floats]:
    """Return `telegram_voltages` of telegrams of several lengths, by one sweep of the network."""
    many = [np.atleast_2d(code.steps).astype(float) for code in telegrams]
    before = check_scalar("before", before, "s", 0, 1.0)
    after = check_scalar("after", after, "s", 0, 1.0)
    dt = check_scalar("dt", dt, "s", 1e-9, 1e-6)
    slot = round(HALF_BIT / dt)
    if abs(slot * dt / HALF_BIT - 1) > 1e-9:
        raise ArgumentError(f"dt is {dt} s; it must be a whole fraction of {HALF_BIT} s")
    # The record is a whole number of samples; another length would stretch its time.
    sizes = [ceil(round((before + steps.shape[1] * HALF_BIT + after) / dt, 6)) for steps in many]
    rows = [network.index(node, "node") for node in nodes]

    def change(s: Complexes) -> Complexes:
        return np.asarray(network.transfer(master, s)[..., rows, :] * _sent(before, s.tobytes()))

    # One change of current, heard from each node; a telegram is a row of such changes. It soon
    # fades behind a supply; what rings on is computed as long as the longest record.
    short = ceil((before + _FADED) / dt)
    grid = short * dt, f_max, _DAMPING
    heard = synthesize(change(laplace_grid(*grid)), short, short * dt, _DAMPING)
    size = np.abs(heard)
    if (size[:, -short // 8 :].max(axis=1) > _LEFT * size.max(axis=1)).any():
        heard = record_of(change, max(sizes), dt, f_max)
    found = []
    for steps, n_t in zip(many, sizes, strict=True):
        changes = np.zeros((len(nodes), steps.shape[1], n_t))
        for place in range(steps.shape[1]):
            late = changes[:, place, place * slot :]
            length = min(late.shape[1], heard.shape[1])
            late[:, :length] = heard[:, :length]
        found.append(np.asarray(steps @ changes))
    return found


@lru_cache(maxsize=16)
def _sent(before: float, frequencies: bytes) -> Complexes:
    """Return the spectrum of a change of the current that a sender draws, some time from 0."""
    s = np.frombuffer(frequencies, complex)
    return np.asarray(-SEND_CURRENT * ramp_spectrum(s) / s * np.exp(-s * before))


class Quality(NamedTuple):
    """How telegrams come over between a master and each slave: the worst over all of them.

    By reciprocity a slave hears of the master what the master hears of it, if both send with the
    same current, so it serves both directions. The send current does not depend on the voltage
    here; a real sender may clip.

    Attributes
    ----------
    level_least, level_most : ndarray of float, shape (n_slaves,)
        Signal, peak to peak [V].
    evenness : ndarray of float, shape (n_slaves,)
        Smallest pulse over largest pulse of a telegram, 0..1; 0 if none is received.
    ringing : ndarray of float, shape (n_slaves,)
        Largest voltage without a pulse over largest pulse; 1 if none is received.
    received : ndarray of float, shape (n_slaves,)
        Share of the telegrams that are received as they were sent, 0..1.
    slaves : tuple of str
        The slaves.

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

    def table(self) -> pd.DataFrame:
        """Return one row per slave, as a table."""
        columns = ["level_least_Vpp", "level_most_Vpp", "evenness", "ringing", "received"]
        index = pd.Index(self.slaves or range(1, len(self.received) + 1), name="slave")
        return pd.DataFrame(dict(zip(columns, self[:5], strict=True)), index=index)

    @property
    def within_tolerance(self) -> Bools:
        """Which slaves have pulses as even and gaps as still as they should be."""
        return np.asarray(
            (self.evenness >= TOLERANCE.evenness) & (self.ringing <= TOLERANCE.ringing)
        )


def quality_of(*waves: Waveform) -> Quality:
    """Return how the telegrams of waveforms come over at each of the nodes that they share."""
    levels, weakest, ringing, right = [], [], [], []
    for wave in waves:
        heard = receive(wave.u, wave.dt, wave.bits.shape[-1])
        levels.append(np.ptp(wave.u, axis=-1))
        weakest.append(np.nan_to_num(heard.weakest, nan=0.0))
        ringing.append(np.nan_to_num(heard.ringing, nan=1.0))
        right.append((heard.error == 0) & (heard.bits == wave.bits).all(axis=-1))
    level = np.concatenate(levels, axis=1)
    return Quality(
        level.min(axis=1),
        level.max(axis=1),
        np.concatenate(weakest, axis=1).min(axis=1),
        np.concatenate(ringing, axis=1).max(axis=1),
        np.concatenate(right, axis=1).mean(axis=1),
        waves[0].names,
    )


# Segments -------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Segment:
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
        given = [(device.node, device.load) for device in self.slaves]
        given += [(device.node, DEVICE) for device in self.masters]
        given += [(node, DEVICE) for _, node in self.ports]
        given += [(supply.node, supply.load) for supply in self.supplies]
        given += [(plug.node, Load(r=plug.resistance)) for plug in self.terminators]
        loads: dict[str, Load] = {}
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

    def waveform(
        self,
        telegrams: Request | Response | str | Sequence[str],
        nodes: tuple[str, ...],
        *,
        dt: float = 250e-9,
        before: float = 6.5e-6,
        after: float = 18.5e-6,
    ) -> Waveform:
        """Return the voltages of telegrams between `head` and nodes; t = 0 is their start."""
        words = telegrams.bits if isinstance(telegrams, Request | Response) else telegrams
        return self._waveforms([words], nodes, dt, before, after)[0]

    def _waveforms(
        self, words: Sequence[Any], nodes: tuple[str, ...], dt: float, before: float, after: float
    ) -> list[Waveform]:
        if self.head is None:
            raise ArgumentError(f"{self} has no head; its line needs a master")
        if not nodes:
            raise ArgumentError(f"{self} has no slave; one must send or hear")
        codes = [Modulation(some) for some in words]
        found = _voltages(self.network, self.head, nodes, codes, dt, before, after)
        return [
            Waveform(
                u if c.bits.ndim == 2 else u[:, 0], dt, start=-before, names=nodes, bits=c.bits
            )
            for u, c in zip(found, codes, strict=True)
        ]

    def quality(self, nodes: Sequence[str], *words: Sequence[str]) -> Quality:
        """Return how telegrams come over between `head` and nodes, of which some may be equal.

        They are the 16 responses unless `words` has others, each entry of telegrams of one length.
        """
        places = tuple(dict.fromkeys(nodes))
        found = quality_of(
            *self._waveforms(words or (RESPONSES,), places, 250e-9, _START, _SILENCE - _START)
        )
        rows = [places.index(node) for node in nodes]
        return Quality._make([*(values[rows] for values in found[:5]), tuple(nodes)])

    def signals(self) -> Quality:
        """Return the worst of all 16 responses and of the requests `PROBES` for each listener."""
        nodes = [node for _, node in self.listeners]
        if self.head is not None and not nodes:
            none = np.empty(0)
            return Quality(none, none, none, none, none)
        return self.quality(nodes, RESPONSES, PROBES)


# What hangs together ---------------------------------------------------------------------------


class Groups:
    """Disjoint groups of names, found by union; this module is needed before scipy is loaded."""

    def __init__(self) -> None:
        self._parent: dict[str, str] = {}

    def __contains__(self, name: str) -> bool:
        return name in self._parent

    def leader(self, name: str) -> str:
        """Return the name that represents a group; a new name is a group of its own."""
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
        loose = [node for node in nodes_of(element) if node not in groups]
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


def nodes_of(element: Element) -> tuple[str, ...]:
    """Return the node, or both nodes, of an element."""
    if isinstance(element, CableRun | Repeater):
        return element.a, element.b
    return (element.node,)
