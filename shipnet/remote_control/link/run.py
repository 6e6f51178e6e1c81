"""Simulate the link byte by byte."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import partial
from heapq import heappop, heappush
from itertools import count

import numpy as np

from shipnet.errors import ArgumentError
from shipnet.fields import check_scalar, check_whole
from shipnet.remote_control.items import Items
from shipnet.remote_control.link.faults import BitErrors, Dead, Fault, LostPacket, Stall
from shipnet.remote_control.link.result import Change, LinkRun, Packet, Update
from shipnet.remote_control.link.states import Event, Role, State
from shipnet.remote_control.link.station import Station
from shipnet.remote_control.link.system import System
from shipnet.remote_control.packet import DATA_START, Markers
from shipnet.remote_control.signals import STATIONS, forwarded

__all__ = ["simulate"]

#: What RCS passes on between the slaves.
_FORWARDED = {"BCS": ("SS", forwarded("BCS", "SS")), "SS": ("BCS", forwarded("SS", "BCS"))}

#: Bytes and ticks of the longest simulation.
_MOST_EVENTS = 20_000_000


def simulate(
    system: System,
    duration: float,
    *,
    faults: Iterable[Fault] = (),
    changes: Iterable[tuple[float, str, int, int]] = (),
    phases: Mapping[str, float] | None = None,
    rng: np.random.Generator | None = None,
) -> LinkRun:
    """Simulate the link from switching it on.

    Parameters
    ----------
    system : System
        The link.
    duration : float
        Time to simulate, 0..1e6 [s]; up to 20 million bytes and ticks.
    faults : iterable of Fault, optional
        What goes wrong.
    changes : iterable of (float, str, int, int), optional
        Time [s], station, number and value 0..65535: one of the station's own values changes. It
        goes to each partner of the station; what comes to RCS from one slave and is of use to the
        other by `shipnet.remote_control.signals.SIGNALS`, goes on to that. All values begin as 0.
    phases : mapping of str to float, optional
        When the timer of each station ticks first, after 0 up to its period [s]. Where it is not
        named, chance says if there is an `rng`; else the first tick comes after one period.
    rng : numpy.random.Generator, optional
        Chance: needed for `BitErrors`.

    Returns
    -------
    LinkRun
        Packets, events and states.

    Raises
    ------
    ArgumentError
        If an argument is out of its range.

    Notes
    -----
    A station takes bytes only while it receives (``comm_f`` is 1). Its task looks into the ring
    after every byte, and answers when a packet is complete; a packet that is broken stays without
    answer. What has come of it stays in the ring, and spoils the next packet if its form allows
    that. The timers go on through everything but the death of their station. One byte 0xDD of
    the partner clears the counters, be it a marker or a value; with a format without markers a
    complete packet does.

    Examples
    --------
    SS dies in a link of 600 bit/s. Before RCS finds out, BCS takes RCS as failed:

    >>> system = System(bit_rate=600, repeat=10)
    >>> run = simulate(system, 12, faults=[Dead("SS", start=3.0)])
    >>> run.table[["time_s", "station", "event", "partner"]].round(1).values[1:4].tolist()
    [[7.1, 'BCS', 'failed', 'RCS'], [7.6, 'RCS', 'failed', 'SS'], [7.6, 'BCS', 'answered', 'RCS']]
    """
    return _Simulation(system, duration, faults, changes, phases, rng).run()


class _Simulation:
    """Stations, and what will happen to them."""

    def __init__(
        self,
        system: System,
        duration: float,
        faults: Iterable[Fault],
        changes: Iterable[tuple[float, str, int, int]],
        phases: Mapping[str, float] | None,
        rng: np.random.Generator | None,
    ) -> None:
        self.system = system
        self.end = check_scalar("duration", duration, "s", 0, 1e6)
        rate = 2 / system.character_time + sum(1 / system.rule(name).tick for name in STATIONS)
        if self.end * rate > _MOST_EVENTS:
            raise ArgumentError(
                f"duration is {self.end:g} s, up to {self.end * rate:.3g} bytes and ticks; there "
                f"may be {_MOST_EVENTS:.0e}"
            )
        self.now = 0.0
        self._heap: list[tuple[float, int, Callable[[], None]]] = []
        self._order = count()
        self.stations = {name: Station(name, system) for name in STATIONS}
        self.run_ = LinkRun(system, self.end)
        self.marked = isinstance(system.packet_format, Markers)
        self.rng, self.error_rate = rng, 0.0
        self.losses: list[LostPacket] = []
        # Of each station: packets whose last byte is in its ring and not yet read.
        self.waiting: dict[str, list[Packet]] = {name: [] for name in STATIONS}
        if isinstance(faults, Fault):
            raise ArgumentError(f"faults is {faults!r}; it must be a list of such")
        self._prepare(list(faults), list(changes), dict(phases or {}))

    def _prepare(
        self,
        faults: list[Fault],
        changes: list[tuple[float, str, int, int]],
        phases: dict[str, float],
    ) -> None:
        for fault in faults:
            if isinstance(fault, BitErrors):
                if self.rng is None:
                    raise ArgumentError("rng is None, but BitErrors need one")
                self.error_rate = fault.rate
            elif isinstance(fault, LostPacket):
                self.losses.append(fault)
            elif isinstance(fault, Dead):
                station = self.stations[fault.station]
                self._at(fault.start, partial(self._stop, station))
                self._at(fault.stop, partial(self._start, station))
            elif isinstance(fault, Stall):
                self._at(fault.start, partial(self._stall, fault))
            else:
                raise ArgumentError(f"fault is {fault!r}; it must be one of this package")
        for change_ in changes:
            if not isinstance(change_, tuple) or len(change_) != 4:
                raise ArgumentError(
                    f"change is {change_!r}; it must be a time, a station, a number and a value"
                )
            time, name, number, value = change_
            if name not in self.stations:
                raise ArgumentError(
                    f"station of a change is {name!r}; it must be one of {STATIONS}"
                )
            change = Change(
                check_scalar("time of a change", time, "s", 0, 1e6),
                name,
                check_whole("number of a change", number, 0, self.system.n_items - 1),
                check_whole("value of a change", value, 0, 0xFFFF),
            )
            self.run_.changes.append(change)
            self._at(change.time, partial(self._change, change))
        self.run_.changes.sort()
        if unknown := set(phases) - set(STATIONS):
            raise ArgumentError(f"phases name {min(unknown)!r}; they must name {STATIONS}")
        for name, station in self.stations.items():
            tick = self.system.rule(name).tick
            drawn = tick * (1 - self.rng.random()) if self.rng is not None else tick
            first = check_scalar(f"phase of {name}", phases.get(name, drawn), "s", 0, tick)
            self._at(first, partial(self._tick, station, first, 0))

    def run(self) -> LinkRun:
        for station in self.stations.values():
            self.run_.note_state(0.0, station.name, station.state)
        self._at(0.0, partial(self._send, self.stations["RCS"]))
        while self._heap and self._heap[0][0] <= self.end:
            self.now, _, act = heappop(self._heap)
            act()
        return self.run_

    def _at(self, time: float, act: Callable[[], None]) -> None:
        if time <= self.end:
            heappush(self._heap, (time, next(self._order), act))

    def _note(self, station: Station, event: str, partner: str = "", detail: str = "") -> None:
        self.run_.note(self.now, station.name, event, partner, detail)

    def _go(self, station: Station, event: Event) -> bool:
        gone = station.go(event)
        if gone:
            self.run_.note_state(self.now, station.name, station.state)
        return gone

    # -- sending ------------------------------------------------------------------------------

    def _send(self, station: Station) -> None:
        """Begin a packet to the next partner; its bytes arrive one by one."""
        station.choose_partner()
        if station.state is not State.SENDING:
            station.state = State.SENDING
            self.run_.note_state(self.now, station.name, station.state)
        station.turn += 1
        target, lives = self.stations[station.partner], station.lives
        data = station.senders[target.name].packet(station.sending[target.name])
        items = self.system.packet_format.decode(data)
        character = self.system.character_time
        packet = Packet(self.now, self.now + len(data) * character, station.name, target.name)
        packet.items = items
        self.run_.packets.append(packet)
        arriving = self._disturb(packet, data)
        for place, byte in enumerate(arriving):
            last = place + 1 == len(data)
            if byte is not None or last:
                self._at(
                    packet.start + (place + 1) * character,
                    partial(self._arrive, station, lives, target, byte, last, packet),
                )
        self._at(packet.end, partial(self._sent, station, lives))

    def _is_lost(self, packet: Packet) -> bool:
        for loss in self.losses:
            same = (loss.source, loss.target) == (packet.source, packet.target)
            if same and loss.start <= packet.start:
                self.losses.remove(loss)
                packet.disturbed = True
                return True
        return False

    def _disturb(self, packet: Packet, data: bytes) -> list[int | None]:
        """Return what arrives of each byte: itself, another, or nothing."""
        if self._is_lost(packet):
            return [None] * len(data)
        if self.error_rate == 0 or self.rng is None:
            return list(data)
        # The start bit, and eight of data.
        hit = self.rng.random((len(data), 9)) < self.error_rate
        packet.disturbed = bool(hit.any())
        flips = np.packbits(hit[:, 1:], axis=1)[:, 0].tolist()
        rows = zip(data, hit[:, 0].tolist(), flips, strict=True)
        return [None if start else byte ^ flip for byte, start, flip in rows]

    def _sent(self, station: Station, lives: int) -> None:
        if station.lives != lives or not self._go(station, Event.SENT):
            return
        timeout, turn = self.system.turn_timeout, station.turn
        if station.role is Role.MASTER and timeout is not None:
            self._at(self.now + timeout, partial(self._give_up, station, lives, turn))
        self._look(station)

    # -- receiving ----------------------------------------------------------------------------

    def _arrive(
        self,
        source: Station,
        lives: int,
        target: Station,
        byte: int | None,
        last: bool,
        packet: Packet,
    ) -> None:
        """Store a byte at its receiver, which may be in a state to take it or not."""
        if source.lives != lives or target.state.comm_f != 1:
            return
        if byte is not None:
            target.receiver.store(byte)
            if byte == DATA_START and self.marked:
                self._life(target, source.name)
        if last:
            self.waiting[target.name].append(packet)
        self._look(target)

    def _life(self, station: Station, partner: str) -> None:
        counter = station.counters[partner]
        self.run_.signs.append((self.now, station.name, partner, counter.ticks))
        if counter.clear():
            self._note(station, "answered", partner)

    def _look(self, station: Station) -> None:
        """Let the task look into the ring, if it can."""
        if station.state is not State.RECEIVING or self.now < station.busy_until:
            return
        reading = station.receiver.read()
        self.run_.most_unread = max(self.run_.most_unread, reading.unread)
        if reading.repaired or reading.lost or reading.stopped:
            found = f"{reading.unread} bytes unread, {reading.lost} lost"
            if reading.repaired:
                self._note(station, "ring repaired", "", found)
            elif reading.lost:
                self._note(station, "ring overrun unseen", "", found)
            if reading.stopped:
                self._note(station, "ring stopped", "", found)
            if reading.stopped and not reading.packets:
                self._leave(station, Event.RING_STOPPED, station.turn, station.lives)
                return
        waiting = self.waiting[station.name]
        if not reading.packets:
            return
        read = waiting[-len(reading.packets) :]
        waiting.clear()
        for packet, items in zip(read, reading.packets[-len(read) :], strict=False):
            packet.read, packet.received = self.now, items
        source = read[-1].source if read else station.partner
        if not self.marked:
            self._life(station, source)
        self._go(station, Event.PACKET)
        lives = station.lives
        taken = [item for items in reading.packets for item in items]
        self._at(
            self.now + self.system.processing,
            partial(self._processed, station, lives, source, tuple(taken)),
        )

    def _processed(self, station: Station, lives: int, source: str, items: Items) -> None:
        """Take the values into the tables, and turn to sending."""
        if station.lives != lives:
            return
        if self.now < station.busy_until:
            again = station.busy_until
            self._at(again, partial(self._processed, station, lives, source, items))
            return
        for number, value in items:
            self.run_.updates.append(Update(self.now, station.name, source, number, value))
            if station.role is Role.MASTER and number < self.system.n_items:
                other, numbers = _FORWARDED[source]
                if number in numbers:
                    station.sending[other][number] = value
        if self._go(station, Event.PROCESSED):
            self._send(station)

    # -- supervision --------------------------------------------------------------------------

    def _tick(self, station: Station, first: float, number: int) -> None:
        tick = self.system.rule(station.name).tick
        self._at(first + (number + 1) * tick, partial(self._tick, station, first, number + 1))
        if station.state is State.DEAD:
            return
        always = self.system.rule(station.name).while_sending
        for partner, counter in station.counters.items():
            waits = station.state.comm_f == 1 and station.partner == partner
            if (waits or always) and counter.step():
                station.left_out[partner] = self.system.skip_turns
                self._note(station, "failed", partner)
                if waits:
                    self._leave(station, Event.FAILED, station.turn, station.lives)

    def _give_up(self, station: Station, lives: int, turn: int) -> None:
        if station.lives == lives and station.turn == turn and station.state is State.RECEIVING:
            self._note(station, "given up", station.partner)
            self._leave(station, Event.GIVEN_UP, turn, lives)

    def _leave(self, station: Station, event: Event, turn: int, lives: int) -> None:
        """Let a station that waits in vain go on, as soon as its task can."""
        if self.now < station.busy_until:
            later = station.busy_until
            self._at(later, partial(self._leave, station, event, turn, lives))
            return
        same = station.lives == lives and station.turn == turn
        if same and self._go(station, event) and station.state is State.SENDING:
            self._send(station)

    # -- faults and changes -------------------------------------------------------------------

    def _stop(self, station: Station) -> None:
        if self._go(station, Event.STOPPED):
            station.lives += 1
            self._note(station, Event.STOPPED.value)

    def _start(self, station: Station) -> None:
        if self._go(station, Event.STARTED):
            station.lives += 1
            self._note(station, Event.STARTED.value)
            if station.role is Role.MASTER:
                self._send(station)

    def _stall(self, fault: Stall) -> None:
        station = self.stations[fault.station]
        station.busy_until = max(station.busy_until, fault.stop)
        self._note(station, "task stalls", "", f"until {fault.stop:g} s")
        self._at(fault.stop, partial(self._look, station))

    def _change(self, change: Change) -> None:
        station = self.stations[change.station]
        for values in station.sending.values():
            values[change.number] = change.value
