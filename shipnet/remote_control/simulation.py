"""Byte-by-byte simulation of the link: changes of values, events and outcomes of packets."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from functools import partial
from heapq import heappop, heappush
from itertools import count
from math import inf, nan
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from shipnet.clock import Fault, as_faults
from shipnet.errors import ArgumentError
from shipnet.fields import check_rng, check_scalar, check_whole, choice, number, record, whole
from shipnet.html import as_html
from shipnet.lazy import Axes, pd
from shipnet.remote_control.faults import STATIONS, DeadStation, LostPacket, Stall
from shipnet.remote_control.packet import DATA_START, MarkerFormat
from shipnet.remote_control.packet_format import Items
from shipnet.remote_control.station import State, Station
from shipnet.remote_control.system import BIT_RATES, System, forwarded

#: Values that RCS forwards from one slave to the other.
_FORWARDED = {"BCS": ("SS", forwarded("BCS", "SS")), "SS": ("BCS", forwarded("SS", "BCS"))}

#: Largest number of bytes and ticks in a simulation.
_MOST_EVENTS = 20_000_000

#: Time and order of an event, the turn of the station that it belongs to, and what it does.
_Event: TypeAlias = "tuple[float, int, Station | None, int, Callable[..., None], tuple[Any, ...]]"


# Changes and results ---------------------------------------------------------------------------


@record
class Change:
    """A change of a value at a station; all values are 0 at the beginning.

    The station sends the value to its partners. RCS forwards a slave's value to the other slave if
    that slave uses it; ``System().signals()`` lists the sources and readers of each value.

    Examples
    --------
    The bridge's switch *shutdown cancel* is set after one second:

    >>> from shipnet import remote_control as rc
    >>> rc.Change(1.0, "BCS", number=1, value=1)
    Change(time=1.0, station='BCS', number=1, value=1)
    """

    time: float = number(0, 1e6, "s", "Time of the change")
    station: str = choice(STATIONS, "Station that sets the value")
    number: int = whole(0, 203, "", "Number of the value")
    value: int = whole(0, 0xFFFF, "", "New value")


class Update(NamedTuple):
    """A value that `station` received from `source`, and the time at which it was stored [s]."""

    time: float
    station: str
    source: str
    number: int
    value: int


@dataclass(slots=True)
class Packet:
    """A packet, with its items as sent and as received; `start`, `end` and `read` are times [s]."""

    start: float
    end: float
    source: str
    target: str
    items: Items = ()
    received: Items | None = None
    read: float = nan

    @property
    def outcome(self) -> str:
        """Outcome of the packet: "ok", "wrong" (other values were accepted) or "lost"."""
        if self.received is None:
            return "lost"
        return "ok" if self.received == self.items else "wrong"


@dataclass(repr=False, eq=False)
class Run:
    """A finished simulation of the link.

    `system`, `until` [s] and `faults` are as given, and `changes` are sorted by time. `packets` are
    all packets that were begun, `updates` the values that stations received from each other, and
    `heartbeats` the received heartbeats: time [s], receiver, sender and the ticks counted since the
    previous one. `max_unread` is the largest number of unread bytes that a task found in its ring.

    Examples
    --------
    >>> from shipnet import remote_control as rc
    >>> run = rc.simulate(rc.System(), [rc.Change(1.0, "BCS", 1, 1)], until=12)
    >>> run
    Run(12 s, 3838 packets, 0 alarms)
    >>> run.delays("SS")["delay_s"].round(3).tolist()
    [0.016]
    """

    system: System
    until: float
    faults: tuple[Fault, ...] = ()
    changes: list[Change] = field(default_factory=list)
    packets: list[Packet] = field(default_factory=list)
    updates: list[Update] = field(default_factory=list)
    heartbeats: list[tuple[float, str, str, int]] = field(default_factory=list)
    max_unread: int = 0
    _events: list[tuple[float, str, str, str, str]] = field(default_factory=list)
    _states: list[tuple[float, str, State]] = field(default_factory=list)

    def __repr__(self) -> str:
        return f"Run({self.until:g} s, {len(self.packets)} packets, {len(self.alarms())} alarms)"

    def _repr_html_(self) -> str:
        starts, alarms = [packet.start for packet in self.packets], self.alarms()["time_s"]
        middle = bisect_left(starts, alarms.head(1).sum())
        shown = [*starts[max(middle - 10, 0) : middle + 20], self.until]
        plot = partial(self.plot, start=shown[0], stop=shown[-1])
        return as_html(self, ok=alarms.empty, table=self.events(), plot=plot)

    def events(self) -> pd.DataFrame:
        """Return the unusual events, one row each.

        Column ``event`` is "failed", "answered" (after "failed") or "timed out" for a partner, and
        "ring repaired", "ring stopped", "ring overrun unnoticed", "task stalls", "station stops" or
        "station starts" for the station itself.
        """
        columns = ["time_s", "station", "event", "partner", "detail"]
        return pd.DataFrame(self._events, columns=columns)

    def alarms(self) -> pd.DataFrame:
        """Return the events in which a station declares a partner failed."""
        events = self.events()
        return events[events["event"] == "failed"].reset_index(drop=True)

    def traffic(self) -> pd.DataFrame:
        """Return one row per packet, with the time at which it was read and its outcome."""
        rows = [
            (p.start, p.end, p.source, p.target, len(p.items), p.read, p.outcome)
            for p in self.packets
        ]
        columns = ["start_s", "end_s", "source", "target", "n_items", "read_s", "outcome"]
        return pd.DataFrame(rows, columns=columns)

    def states(self) -> pd.DataFrame:
        """Return the times at which each station began to send, receive or process, or died."""
        return pd.DataFrame(self._states, columns=["time_s", "station", "state"])

    def history(self, number: int, station: str) -> pd.DataFrame:
        """Return the history of value `number` at a station; each row is valid from its ``time_s``.

        These are the values that the station set itself, or if it set none, the values that it
        received.
        """
        number = check_whole("number", number, 0, self.system.n_items - 1)
        if station not in STATIONS:
            raise ArgumentError(f"station is {station!r}; it must be one of {STATIONS}")

        def points(values: Iterable[Change | Update]) -> list[tuple[float, int]]:
            here = (station, number)
            return [(v.time, v.value) for v in values if (v.station, v.number) == here]

        rows = [(0.0, 0), *(points(self.changes) or points(self.updates))]
        return pd.DataFrame(rows, columns=["time_s", "value"])

    def delays(self, station: str) -> pd.DataFrame:
        """Return the delay ``delay_s`` with which a station received each change made by others.

        The delay is 0 if the station already had the new value, and NaN if the source changed the
        value again, or the simulation ended, before it was received.
        """
        rows = []
        for change in self.changes:
            if change.station == station:
                continue
            source = (change.station, change.number)
            moves = (c.time for c in self.changes if (c.station, c.number) == source)
            until = min((time for time in moves if time > change.time), default=inf)
            updates = (u for u in self.updates if (u.station, u.number) == (station, change.number))
            history = [(0.0, 0), *((update.time, update.value) for update in updates)]
            shown = bisect_left(history, (change.time, -1)) - 1
            delays = (
                max(time - change.time, 0.0)
                for time, value in history[max(shown, 0) :]
                if value == change.value and time < until
            )
            rows.append((change.time, *source, change.value, next(delays, nan)))
        return pd.DataFrame(rows, columns=["time_s", "station", "number", "value", "delay_s"])

    def plot(
        self, ax: Axes | None = None, *, start: float = 0.0, stop: float | None = None
    ) -> Axes:
        """Draw the packets of each station from `start` to `stop` [s], as in Fig. 2 of chung1998.

        A packet is a block in its sender's row, coloured by receiver, with an arrow to the receiver
        that read it; a lost packet is hatched. A red triangle shows when a station declares a
        partner failed. `stop` defaults to the end of the run; 1 to 500 packets can be drawn.
        """
        from shipnet.remote_control.plot import plot_time_chart

        return plot_time_chart(self, ax, start, self.until if stop is None else stop)


# The simulation --------------------------------------------------------------------------------


def simulate(
    system: System,
    changes: Change | Iterable[Change] = (),
    *,
    until: float,
    faults: Fault | Iterable[Fault] = (),
    rng: np.random.Generator | int | None = None,
) -> Run:
    """Simulate the link byte by byte from power-on.

    Parameters
    ----------
    system : System
        The link.
    changes : Change or iterable of Change, optional
        Changes of values at the stations.
    until : float
        End of the simulation, 0..1e6 [s]; a run may have at most 20 million bytes and ticks.
    faults : Fault or iterable of Fault, optional
        Faults from the namespace `faults`.
    rng : numpy.random.Generator or int, optional
        Random generator or its seed, for the first tick of each station's timer; by default the
        first tick comes after one period.

    Returns
    -------
    Run
        Packets, events and states.

    Notes
    -----
    A station accepts bytes only while it receives or processes (``comm_f`` is 1). Its task reads
    the ring after every byte; when a packet is complete, the station processes it and then sends.
    An incomplete packet gets no response; the bytes that arrived are kept, and can corrupt the next
    packet. A station's timer stops only while the station is dead. In a format with markers, every
    byte 0xDD from a partner, whether a marker or part of a value, clears the counters for that
    partner; in a format without markers, every complete packet does.

    Examples
    --------
    SS dies in a link of 600 bit/s. Before RCS notices, BCS declares RCS failed:

    >>> from shipnet import remote_control as rc
    >>> dead = rc.faults.DeadStation("SS", start=3.0)
    >>> run = rc.simulate(rc.System(bit_rate=600, repeat=10), faults=dead, until=12)
    >>> run.events()[["time_s", "station", "event", "partner"]].round(1).values[1:4].tolist()
    [[7.1, 'BCS', 'failed', 'RCS'], [7.6, 'RCS', 'failed', 'SS'], [7.6, 'BCS', 'answered', 'RCS']]
    """
    changes = (changes,) if isinstance(changes, Change) else tuple(changes)
    faults = as_faults(faults, DeadStation, LostPacket, Stall)
    rng = None if rng is None else check_rng(rng)
    return _Simulation(system, until, faults, changes, rng).run()


class _Simulation:
    """The stations and the pending events."""

    def __init__(
        self,
        system: System,
        until: float,
        faults: tuple[Fault, ...],
        changes: tuple[Change, ...],
        rng: np.random.Generator | None,
    ) -> None:
        self.system = system
        self.end = check_scalar("until", until, "s", 0, 1e6)
        self.stations = {name: Station(name, system) for name in STATIONS}
        stations = self.stations.values()
        rate = 2 / system.character_time + sum(1 / station.rule.tick for station in stations)
        if self.end * rate > _MOST_EVENTS:
            raise ArgumentError(
                f"until is {self.end:g} s, or up to {self.end * rate:.3g} bytes and ticks; the "
                f"limit is {_MOST_EVENTS:.0e}"
            )
        self.now = 0.0
        self._heap: list[_Event] = []
        self._order = count()
        self.result = Run(system, self.end, faults)
        self.marked = isinstance(system.packet_format, MarkerFormat)
        self.losses = [fault for fault in faults if isinstance(fault, LostPacket)]
        # Packets per station whose last byte is in the station's ring but not yet read.
        self.waiting: dict[str, list[Packet]] = {name: [] for name in STATIONS}
        for fault in faults:
            if isinstance(fault, DeadStation):
                station = self.stations[fault.station]
                self._at(fault.start, self._stop, station)
                self._at(fault.stop, self._start, station)
            elif isinstance(fault, Stall):
                self._at(fault.start, self._stall, self.stations[fault.station], fault.stop)
        for change in changes:
            if not isinstance(change, Change):
                raise ArgumentError(f"one of changes is {change!r}; it must be a Change")
            check_whole("number of a change", change.number, 0, system.n_items - 1)
            self._at(change.time, self._change, change)
        self.result.changes.extend(sorted(changes, key=lambda change: change.time))
        for station in stations:
            self._enter(station, "receiving")
            tick = station.rule.tick
            first = tick * (1 - rng.random()) if rng is not None else tick
            self._at(first, self._tick, station, first, 0)

    def run(self) -> Run:
        """Let RCS begin, and process all events in the order of their times."""
        self._in_turn(0.0, self._send, self.stations["RCS"])
        while self._heap:
            self.now, _, station, turn, act, arguments = heappop(self._heap)
            if station is None or station.turn == turn:
                act(*arguments)
        return self.result

    def _at(self, time: float, act: Callable[..., None], *arguments: Any) -> None:
        """Call ``act(*arguments)`` at `time`; events at the same time keep their order."""
        if time <= self.end:
            heappush(self._heap, (time, next(self._order), None, 0, act, arguments))

    def _in_turn(
        self, time: float, act: Callable[..., None], station: Station, *arguments: Any
    ) -> None:
        """Call ``act(station, *arguments)`` at `time` if the station's present turn still lasts."""
        if time <= self.end:
            event = (time, next(self._order), station, station.turn, act, (station, *arguments))
            heappush(self._heap, event)

    def _note(self, station: Station, event: str, partner: str = "", detail: str = "") -> None:
        self.result._events.append((self.now, station.name, event, partner, detail))

    def _enter(self, station: Station, state: State) -> None:
        station.state = state
        self.result._states.append((self.now, station.name, state))

    # sending

    def _send(self, station: Station) -> None:
        """Begin a packet to the next partner; its bytes arrive one by one."""
        following = station.partners.index(station.partner) + 1
        station.partner = station.partners[following % len(station.partners)]
        if station.state != "sending":
            self._enter(station, "sending")
        station.turn += 1
        target = self.stations[station.partner]
        items = station.senders[target.name].items(station.sending[target.name])
        data = self.system.packet_format.encode(items)
        character = self.system.character_time
        packet = Packet(self.now, self.now + len(data) * character, station.name, target.name)
        packet.items = tuple(sorted(items.items()))
        self.result.packets.append(packet)
        for loss in self.losses:
            hop = (loss.source, loss.target)
            if hop == (station.name, target.name) and loss.start <= self.now < loss.stop:
                self.losses.remove(loss)
                break
        else:
            for sent, byte in enumerate(data, start=1):
                time = self.now + sent * character
                last = packet if sent == len(data) else None
                self._in_turn(time, self._arrive, station, target, byte, last)
        self._in_turn(packet.end, self._sent, station)

    def _sent(self, station: Station) -> None:
        self._enter(station, "receiving")
        timeout = self.system.turn_timeout
        if station.master and timeout is not None:
            self._in_turn(self.now + timeout, self._time_out, station)
        self._look(station)

    # receiving

    def _arrive(self, source: Station, target: Station, byte: int, last: Packet | None) -> None:
        """Store a byte at its receiver if the receiver accepts it; `last` is a complete packet."""
        if not target.listens:
            return
        target.store(byte)
        if byte == DATA_START and self.marked:
            self._life(target, source.name)
        if last:
            self.waiting[target.name].append(last)
        self._look(target)

    def _life(self, station: Station, partner: str) -> None:
        counter = station.counters[partner]
        self.result.heartbeats.append((self.now, station.name, partner, counter.ticks))
        if counter.clear():
            self._note(station, "answered", partner)

    def _look(self, station: Station) -> None:
        """Let the task read the ring, if the station is receiving and the task is not busy."""
        if station.state != "receiving" or self.now < station.busy_until:
            return
        unread = station.unread
        self.result.max_unread = max(self.result.max_unread, unread)
        data, event = station.read()
        if event:
            lost = 0 if event == "ring stopped" else unread - len(data)
            self._note(station, event, "", f"{unread} bytes unread, {lost} lost")
        if event == "ring stopped":
            self._leave(station)
            return
        packets = station.parser.feed(data)
        if not packets:
            return
        waiting = self.waiting[station.name]
        read = waiting[-len(packets) :]
        waiting.clear()
        for packet, items in zip(read, packets[-len(read) :], strict=False):
            packet.read, packet.received = self.now, items
        source = read[-1].source if read else station.partner
        if not self.marked:
            self._life(station, source)
        self._enter(station, "processing")
        taken = tuple(item for items in packets for item in items)
        self._in_turn(self.now + self.system.processing, self._processed, station, source, taken)

    def _processed(self, station: Station, source: str, items: Items) -> None:
        """Store the values in the tables, and begin to send."""
        if self.now < station.busy_until:
            self._in_turn(station.busy_until, self._processed, station, source, items)
            return
        for k, value in items:
            self.result.updates.append(Update(self.now, station.name, source, k, value))
            if station.master and k < self.system.n_items:
                other, numbers = _FORWARDED[source]
                if k in numbers:
                    station.sending[other][k] = value
        self._send(station)

    # supervision

    def _tick(self, station: Station, first: float, number: int) -> None:
        self._at(first + (number + 1) * station.rule.tick, self._tick, station, first, number + 1)
        counter = station.counters[station.partner]
        if station.listens and counter.step():
            self._note(station, "failed", station.partner)
            if station.master:
                # We assume that the station continues with its next partner.
                self._leave(station)

    def _time_out(self, station: Station) -> None:
        if station.state == "receiving":
            self._note(station, "timed out", station.partner)
            self._leave(station)

    def _leave(self, station: Station) -> None:
        """End the wait for a response: let the station send as soon as its task is free."""
        if self.now < station.busy_until:
            self._in_turn(station.busy_until, self._leave, station)
        elif station.state == "receiving":
            self._send(station)

    # faults and changes

    def _stop(self, station: Station) -> None:
        if station.state != "dead":
            self._enter(station, "dead")
            station.turn += 1
            self._note(station, "station stops")

    def _start(self, station: Station) -> None:
        if station.state == "dead":
            station.turn += 1
            self._note(station, "station starts")
            if station.master:
                self._send(station)
            else:
                self._enter(station, "receiving")

    def _stall(self, station: Station, stop: float) -> None:
        station.busy_until = max(station.busy_until, stop)
        self._note(station, "task stalls", "", f"until {stop:g} s")
        self._at(stop, self._look, station)

    def _change(self, change: Change) -> None:
        for values in self.stations[change.station].sending.values():
            values[change.number] = change.value


def switch_delays(
    system: System | None = None, *, changes: int = 20, rng: np.random.Generator | int | None = None
) -> pd.DataFrame:
    """Return the delays with which SS follows a switch on the bridge, at the paper's bit rates.

    Parameters
    ----------
    system : System, optional
        The link, by default the paper's; its bit rate is not used.
    changes : int, default 20
        Number of moves of the switch, 1..10000.
    rng : numpy.random.Generator or int, optional
        Random generator, or its seed, for the times of the moves.

    Returns
    -------
    pandas.DataFrame
        One row per bit rate: ``bit_rate``, the number of moves ``followed``, the delays ``mean_s``
        and ``longest_s``, and ``bound_s``, the `System.response_time` of packets with all items.

    Examples
    --------
    >>> from shipnet import remote_control as rc
    >>> table = rc.switch_delays(rng=2024)
    >>> table.followed.tolist(), table[["mean_s", "bound_s"]].round(2).values[[0, 4]].tolist()
    ([20, 20, 20, 20, 20], [[0.02, 0.21], [0.3, 3.3]])
    """
    base = System() if system is None else system
    n = check_whole("changes", changes, 1, 10_000)
    chance, rows = check_rng(rng), []
    for rate in BIT_RATES:
        link = replace(base, bit_rate=rate)
        bound = link.response_time()
        # The interval between moves is twice the longest delay plus a random fraction of a cycle.
        gap = 2 * bound + link.cycle_time * chance.random(n)
        times = np.cumsum(gap)
        moves = [Change(float(t), "BCS", 1, (k + 1) % 2) for k, t in enumerate(times)]
        run = simulate(link, moves, until=float(times[-1] + 2 * bound))
        delay = run.delays("SS")["delay_s"]
        rows.append((rate, int(delay.notna().sum()), delay.mean(), delay.max(), bound))
    columns = ["bit_rate", "followed", "mean_s", "longest_s", "bound_s"]
    return pd.DataFrame(rows, columns=columns)
