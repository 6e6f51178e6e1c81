"""The line between a master and its slaves: takes a request, brings a reply, and keeps the time.

Only the slaves at the address of a request are looked at, as all others let it pass. What the
others hear is made up for when their turn comes: a slave is out of step if the request just before
its own was lost on it. A test lets every slave hear every telegram and finds no difference.
"""

from __future__ import annotations

import heapq
from collections.abc import Callable, Sequence
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from shipnet.asi.modulation import ONE_PULSE_CODES, collide
from shipnet.asi.simulation.disturbance import MISSED, PLANES, REQUEST_LOST, draw_disturbances
from shipnet.asi.simulation.master import Phase
from shipnet.asi.simulation.orders import Order
from shipnet.asi.simulation.record import (
    ATTEMPT,
    EXECUTED,
    NO_RESPONSE,
    OUTCOME,
    PHASE,
    RESPONSE,
    STANDBY,
    Record,
)
from shipnet.asi.simulation.slave import OBEY, Slave
from shipnet.asi.simulation.station import Station
from shipnet.asi.simulation.tasks import FAULTY, SILENT
from shipnet.asi.telegram import REQUEST_BITS, RESPONSE_BITS, Response
from shipnet.asi.timing import Timing
from shipnet.errors import SilenceError

__all__ = ["Channel", "MasterStops"]

_NEVER = float("inf")
_NAN = float("nan")
_EXECUTED = 1 << EXECUTED
_ANSWERS = [Response(data).bits for data in range(16)]

#: Cycles for which disturbances are drawn at a time.
_CHUNK = 256

Bytes = npt.NDArray[np.uint8]
_Way: TypeAlias = tuple[Station, Slave, Callable[[Slave, int, float], int], int]


class MasterStops(Exception):
    """The master falls silent: for good, or for a failure of the supply that ends at a time [s]."""

    def __init__(self, until: float) -> None:
        super().__init__(until)
        self.until = until


class Channel:
    """A line with its slaves.

    Parameters
    ----------
    stations : sequence of Station
        The slaves.
    timing : Timing
        The pauses.
    attempts : int
        How often the master sends a request at most.
    rng : numpy.random.Generator
        Draws the disturbances that are not given.
    drawn : ndarray of uint8, shape (n_cycles, 3, n_stations, attempts), optional
        The disturbances by cycle; behind its last cycle there are none.

    Attributes
    ----------
    time : float
        Now [bit].
    record : Record
        What was sent.
    standby : bool
        Whether it is the standby master who sends.
    begun : int
        How many cycles have begun.

    Examples
    --------
    >>> from shipnet.asi import Call
    >>> from shipnet.asi.simulation.orders import order
    >>> from shipnet.asi.simulation.slave import Slave
    >>> slave = Slave("S-0.F", 5, inputs=6)
    >>> channel = Channel([Station(slave)], Timing(), 2, np.random.default_rng(2024))
    >>> channel.transact(order(Call.READ_ID, 5), 0), channel.time
    (15, 28.0)
    >>> channel.transact(order(Call.READ_ID, 5), 0), channel.time
    (15, 54.0)
    """

    def __init__(
        self,
        stations: Sequence[Station],
        timing: Timing,
        attempts: int,
        rng: np.random.Generator,
        drawn: Bytes | None = None,
    ) -> None:
        self.stations, self.timing, self.record = list(stations), timing, Record(timing)
        self._tail = RESPONSE_BITS + timing.slave_pause
        self._put_start = self.record.start.append
        self._put_pause = self.record.pause.append
        self._put_code = self.record.code.append
        self.time = 0.0
        self.standby = False
        self.begun = 0
        self._attempts, self._rng, self._drawn = attempts, rng, drawn
        self._plane = len(self.stations) * attempts
        self._bytes, self._chunk, self._base, self._fields = b"", 0, -1, 0
        for number, station in enumerate(self.stations):
            station.offset = number * attempts
        self._events: list[tuple[float, int, Callable[[], None]]] = []
        self._scheduled = 0
        self._next = _NEVER
        self._number = 0
        #: Number of the last request that a late answer spoilt, and the answer on its way.
        self._spoilt = -1
        self._ghost: tuple[str, float] | None = None
        self.locate()

    @property
    def seconds(self) -> float:
        """Now [s]."""
        return self.time * self.timing.bit_time

    def schedule(self, seconds: float, action: Callable[[], None]) -> None:
        """Have something happen at a time [s]; what is scheduled first happens first."""
        self._scheduled += 1
        entry = (seconds / self.timing.bit_time, self._scheduled, action)
        heapq.heappush(self._events, entry)
        self._next = self._events[0][0]

    def happen(self, until: float) -> None:
        """Carry out what is due up to a time [bit]."""
        while self._events and self._events[0][0] <= until:
            action = heapq.heappop(self._events)[2]
            self._next = self._events[0][0] if self._events else _NEVER
            action()

    def stop_master(self, until: float) -> None:
        """Have the master fall silent now; see `MasterStops`."""
        raise MasterStops(until)

    def locate(self) -> None:
        """Find out anew which slave is at which address; behind the last stand all of them."""
        there = [s for s in self.stations if s.slave.powered]
        there = [s for s in there if not s.slave.programming]
        self._at = [[s for s in there if s.slave.address == address] for address in range(32)]
        self._at.append(there)
        self._routes: dict[Order, list[_Way]] = {}

    def _route(self, order: Order) -> list[_Way]:
        """Return who takes a request for its own, and what each does with it."""
        route = []
        for station in self._at[order.station]:
            said = order.reads[station.slave.kind]
            if said is not None:
                route.append((station, station.slave, OBEY[said.call], said.data))
        self._routes[order] = route
        return route

    def switch(self, station: Station, on: bool, time: float) -> None:
        """Give a slave its supply, or take it away, at a time [s]; the last cause to end counts."""
        station.cuts += -1 if on else 1
        if station.cuts == 0:
            station.slave.switch_on()
            station.since = self._number + 1
        elif station.slave.powered:
            station.slave.switch_off(time)
        self.locate()

    def begin(self, phase: Phase, cycle: int) -> None:
        """Hear of the begin of a phase, as the observer of a master."""
        self._fields = phase << PHASE | self.standby << STANDBY
        if phase < Phase.DATA_EXCHANGE:
            self._base = -1
            self.record.cycles.append((len(self.record.start), -1))
            return
        if phase == Phase.DATA_EXCHANGE:
            self.record.cycles.append((len(self.record.start), cycle))
            self._base = self._plane * PLANES * self._in_chunk(self.begun)
            self.begun += 1
        else:
            self._base += self._plane

    def _in_chunk(self, cycle: int) -> int:
        """Have the disturbances of a cycle ready, and return its number among them."""
        if cycle % _CHUNK == 0 or not self._bytes:
            shape = (_CHUNK, PLANES, len(self.stations), self._attempts)
            if self._drawn is None:
                drawn = self._draw(_CHUNK)
            else:
                drawn = np.zeros(shape, dtype=np.uint8)
                given = self._drawn[cycle : cycle + _CHUNK]
                drawn[: len(given)] = given
            self._bytes = drawn.tobytes()
        return cycle % _CHUNK

    def _draw(self, n_cycles: int) -> Bytes:
        rates = np.array([station.rates for station in self.stations]).reshape(-1, 2)
        return draw_disturbances(
            self._rng, n_cycles, rates[:, 0], rates[:, 1], attempts=self._attempts
        )

    def _draw_one(self, station: Station) -> int:
        """Draw for a request outside the cycles."""
        if station.rates == (0.0, 0.0):
            return 0
        rates: list[npt.NDArray[Any]] = [np.array([rate]) for rate in station.rates]
        return int(draw_disturbances(self._rng, 1, *rates, attempts=1)[0, 0, 0, 0])

    def transact(self, order: Order, attempt: int) -> int:
        """Send a request and return the reply.

        Parameters
        ----------
        order : Order
            The request.
        attempt : int
            0, or the number of the repetition.

        Returns
        -------
        int
            Four bits, 0..15, or `SILENT` or `FAULTY`.
        """
        start, timing = self.time, self.timing
        end = start + REQUEST_BITS
        if end >= self._next:
            self.happen(end)
        before = self._number
        self._number = number = before + 1
        seconds, base, spoilt = end * timing.bit_time, self._base, self._spoilt
        route = self._routes.get(order)
        if route is None:
            route = self._route(order)
        if self._ghost is not None and not self._readable(order, start):
            route = []
        replies = []
        for station, slave, obey, carried in route:
            what = (
                self._bytes[base + station.offset + attempt]
                if base >= 0
                else self._draw_one(station)
            )
            if what or spoilt == before or not slave.synchronised:
                if station.heard != before:
                    missed = what & MISSED or spoilt == before
                    slave.synchronised = not missed and station.since < number
                if what & REQUEST_LOST:
                    slave.synchronised = False
                    station.heard = number
                    continue
            station.heard = number
            pause = station.pause
            if not slave.synchronised:
                slave.synchronised = True
                pause += timing.unsynchronised
            data = obey(slave, carried, seconds)
            if data >= 0:
                replies.append((data, pause, what, station))
        if order.moves:
            self.locate()

        fields = order.code | self._fields | attempt << ATTEMPT
        self._put_start(start)
        if len(replies) == 1:
            data, pause, what, station = replies[0]
            if not what and pause <= timing.timeout and not station.lost_replies:
                self._put_pause(pause)
                self._put_code(fields | data << RESPONSE | _EXECUTED)
                self.time = end + pause + self._tail
                return data
        if replies:
            reply, pause, last, error = self._resolve(order, end, replies)
        else:
            reply, pause, last, error = SILENT, _NAN, _NAN, SilenceError.code
        response = reply << RESPONSE if reply >= 0 else NO_RESPONSE << RESPONSE
        executed = bool(replies) or not order.expects
        self._put_pause(pause)
        self._put_code(
            fields | response | (error if order.expects else 0) << OUTCOME | executed << EXECUTED
        )
        wait = timing.timeout if last != last else last + self._tail
        self.time = end + wait
        return reply

    def _readable(self, order: Order, start: float) -> bool:
        """Whether a request can be read although a late answer falls upon it."""
        assert self._ghost is not None
        bits, begin = self._ghost
        self._ghost = None
        read, _ = collide(((order.bits, 0), (bits, round(2 * (begin - start)))), REQUEST_BITS)
        if read != order.bits:
            self._spoilt = self._number
        return read == order.bits

    def _resolve(
        self, order: Order, end: float, replies: list[tuple[int, float, int, Station]]
    ) -> tuple[int, float, float, int]:
        """Return what the master makes of replies: the reply, first and last pause, error."""
        heard = []
        for data, pause, what, station in replies:
            left = station.lost_replies.get(order.request.call, 0)
            if left:
                station.lost_replies[order.request.call] = left - 1
            elif pause > self.timing.timeout:
                self._ghost = (_ANSWERS[data], end + pause)
            else:
                heard.append((data, pause, what))
        if not heard:
            return SILENT, _NAN, _NAN, SilenceError.code
        first, last = min(h[1] for h in heard), max(h[1] for h in heard)
        data, error = heard[0][0], 0
        if len(heard) > 1:
            # Half-bits count from the first of the answers; order does not matter.
            telegrams = sorted((_ANSWERS[d], round(2 * (pause - first))) for d, pause, _ in heard)
            bits, error = collide(tuple(telegrams), RESPONSE_BITS)
            data = int(bits[1:5], 2) if bits else data
        variant = max(h[2] >> 2 for h in heard)
        if variant and not error:
            error = ONE_PULSE_CODES[data][variant - 1]
        return (FAULTY if error else data), first, last, error
