"""Simulated line between a master and its slaves, with disturbances and a traffic record."""

from __future__ import annotations

import heapq
from array import array
from collections.abc import Callable, Sequence
from functools import cached_property
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from shipnet.arrays import Floats, Integers
from shipnet.asi.master import FAULTY, SILENT, Phase
from shipnet.asi.modulation import ONE_PULSE_CODES, collide
from shipnet.asi.slave import KINDS, OBEY, PreparedRequest, RunningSlave, Slave, slave_key
from shipnet.asi.telegram import REQUEST_BITS, RESPONSE_BITS, Call, Request, Response
from shipnet.asi.timing import Transaction
from shipnet.errors import ArgumentError, SilenceError, name_of
from shipnet.fields import check_whole
from shipnet.lazy import pd

# The record has one row per transaction: its start, the pause before the response, and all other
# fields packed into one integer, which is quick to write during a simulation.

#: Position of the lowest bit of each field; bits 0..15 are `PreparedRequest.code`.
ATTEMPT, PHASE, OUTCOME, RESPONSE, EXECUTED, STANDBY = 16, 19, 22, 26, 31, 32

#: Value of the response field if there is no readable response.
NO_RESPONSE = 16

#: Slave labels by code: bits 0..4 are the address, bits 5 and 6 the half (0 none, 1 A, 2 B).
LABELS = np.array([f"{code & 31}{('', 'A', 'B', '')[code >> 5]}" for code in range(1 << 7)])

_OUTCOMES = [name_of(code) for code in range(SilenceError.code + 1)]


class Record:
    """Record of a simulation's transactions, with one growing array per column."""

    def __init__(self, transaction: Transaction) -> None:
        self.transaction = transaction
        self.start = array("d")
        self.pause = array("d")
        self.code = array("q")
        self.cycles: list[tuple[int, int]] = []

    def field(self, shift: int, bits: int) -> Integers:
        """Return a packed field of every row: `bits` bits, beginning with bit `shift`."""
        return np.frombuffer(self.code, dtype=np.int64) >> shift & (1 << bits) - 1

    @cached_property
    def starts(self) -> Floats:
        """Start time of each request [bit]."""
        return np.frombuffer(self.start, dtype=np.float64)

    @cached_property
    def pauses(self) -> Floats:
        """Pause before each response [bit]; NaN if there was no response."""
        return np.frombuffer(self.pause, dtype=np.float64)

    @cached_property
    def cycle(self) -> Integers:
        """Cycle number of each row; -1 in the phases before data exchange."""
        cycle = np.full(self.starts.size, -1, dtype=np.int64)
        if self.cycles:
            rows, numbers = np.array(self.cycles).T
            ends = np.append(rows[1:], self.starts.size)
            cycle[rows[0] :] = np.repeat(numbers, ends - rows)
        return cycle

    def table(self) -> pd.DataFrame:
        """Return the record as a table with names instead of codes."""
        call, address, half = self.field(0, 4), self.field(4, 5), self.field(9, 2)
        data, outcome, response = self.field(11, 5), self.field(OUTCOME, 4), self.field(RESPONSE, 5)
        executed = self.field(EXECUTED, 1).astype(bool)
        which, different = pd.factorize(self.field(0, 16))
        requests = np.array([_bits(code) for code in different.tolist()], dtype="U14")

        def named(codes: Integers, names: Sequence[str]) -> pd.Categorical[str]:
            whole = pd.Categorical.from_codes(codes, pd.Index(names))
            return whole.remove_unused_categories()

        return pd.DataFrame(
            {
                "time_s": self.starts * self.transaction.bit_time,
                "cycle": self.cycle,
                "phase": named(self.field(PHASE, 3), [phase.name.lower() for phase in Phase]),
                "call": named(call, [call.name for call in Call]),
                "address": address,
                "half": named(half, ["", "A", "B"]),
                "slave": LABELS[self.field(4, 7)],
                "request": requests[which],
                "request_data": data,
                "response_data": np.where(response == NO_RESPONSE, -1, response),
                "master_pause_bit": self.pauses,
                "slave_pause_bit": np.where(
                    np.isnan(self.pauses), np.nan, self.transaction.slave_pause
                ),
                "attempt": self.field(ATTEMPT, 3),
                "outcome": named(outcome, _OUTCOMES),
                "executed": executed,
                "executed_but_lost": executed & (outcome > 0),
                "standby": self.field(STANDBY, 1).astype(bool),
            }
        )


def _bits(code: int) -> str:
    """Return the bits of the request that has a given `PreparedRequest.code`."""
    return Request(Call(code & 15), code >> 4 & 31, code >> 11, KINDS[code >> 9 & 3]).bits


#: Bits 0 and 1 of a disturbance: the slave misses the request, or it missed the previous request,
#: which went to another slave. Bits 2..7 are the variant of a disturbed response, or 0.
REQUEST_LOST, MISSED = 1, 2

#: Number of ways to disturb one pulse of a response; the variants are numbered from 1.
VARIANTS = len(ONE_PULSE_CODES[0])

#: Number of phases per cycle: data exchange, management and inclusion.
PLANES = 3

Bytes = npt.NDArray[np.uint8]


def draw_disturbances(
    rng: np.random.Generator, n_cycles: int, rates: Sequence[tuple[float, float]], attempts: int
) -> Bytes:
    """Draw independent disturbances as bytes, of shape (n_cycles, 3, n_slaves, attempts).

    `rates` contains each slave's probabilities of a missed request and of a disturbed response.
    """
    drawn = np.zeros((n_cycles, PLANES, len(rates), attempts), dtype=np.uint8)
    plane = (n_cycles, PLANES, attempts)
    for slave, (lost, garbled) in enumerate(rates):
        if lost > 0:
            drawn[..., slave, :] |= (rng.random(plane) < lost) * np.uint8(REQUEST_LOST)
            drawn[..., slave, :] |= (rng.random(plane) < lost) * np.uint8(MISSED)
        if garbled > 0:
            variant = rng.integers(1, VARIANTS + 1, plane, dtype=np.uint8) << 2
            drawn[..., slave, :] |= np.where(rng.random(plane) < garbled, variant, 0)
    return drawn


class Station:
    """A simulated slave, its position on the line and its disturbances."""

    __slots__ = (
        "cuts", "heard", "lost_replies", "name", "offset", "pause", "position", "quiet", "rates",
        "since", "slave",
    )  # fmt: skip

    def __init__(self, slave: RunningSlave, position: float = 0.0, pause: float = 3.0) -> None:
        self.slave, self.position, self.pause = slave, position, pause
        #: Label at the start of the simulation.
        self.name = slave.label
        #: Probabilities of a missed request and of a disturbed response.
        self.rates = (0.0, 0.0)
        #: True while drawn disturbances are ignored.
        self.quiet = False
        #: Number of responses that are still to be lost, by call.
        self.lost_replies: dict[Call, int] = {}
        #: Number of active faults that disconnect the slave from the supply.
        self.cuts = 0
        #: Numbers of the last request to the slave, and of the first to any slave since power-on.
        self.heard, self.since = -1, 1
        #: Index of the slave's first disturbance among the disturbances of one phase.
        self.offset = 0

    def check_pause(self, transaction: Transaction, late: float = 0.0) -> None:
        """Raise ArgumentError if `late` < 0 or a response may begin after the next request ends."""
        pause = self.pause + transaction.unsynchronised + late
        most = transaction.timeout + REQUEST_BITS
        if not (late >= 0 and pause < most):
            raise ArgumentError(
                f"slave {self.name} would respond {pause:g} bit times after a request; its delay "
                f"must be at least 0, and it must respond before {most:g} bit times have passed"
            )


class Stations(dict[str, list[Station]]):
    """The slaves of a line by initial label; several slaves may share a label."""

    def __init__(
        self, placed: Sequence[tuple[Slave, float, float]], transaction: Transaction
    ) -> None:
        """Place each slave at a distance from the master [m], with a propagation delay [s]."""
        super().__init__()
        check_whole("number of slaves", len(placed), 0, 1000)
        self.all = []
        for slave, position, delay in placed:
            pause = transaction.master_pause + 2 * delay / transaction.bit_time
            station = Station(RunningSlave(slave), position, pause)
            station.check_pause(transaction)
            self.all.append(station)
            self.setdefault(station.name, []).append(station)

    def __missing__(self, label: str) -> list[Station]:
        slave_key(label)
        raise ArgumentError(
            f"slave {label} is not on the line; its slaves are {', '.join(self) or 'none'}"
        )


_NEVER = float("inf")
_NAN = float("nan")
_EXECUTED = 1 << EXECUTED
_ANSWERS = [Response(data).bits for data in range(16)]

#: Number of cycles for which disturbances are drawn at a time.
_CHUNK = 256

_Route: TypeAlias = tuple[Station, RunningSlave, Callable[[RunningSlave, int, float], int], int]


class MasterStops(Exception):
    """Exception that stops the master until the time `until` [s]; infinity means permanently."""

    def __init__(self, until: float) -> None:
        super().__init__(until)
        self.until = until


class Channel:
    """Simulated line that transmits requests and responses, and tracks the simulated time.

    For each request, only the slaves at its address are simulated. A slave that missed the previous
    request is unsynchronised. A test shows that simulating all slaves gives the same results.
    """

    def __init__(
        self,
        stations: Sequence[Station],
        transaction: Transaction,
        attempts: int,
        rng: np.random.Generator,
    ) -> None:
        self.stations, self.transaction = list(stations), transaction
        self.record = Record(transaction)
        self._tail = RESPONSE_BITS + transaction.slave_pause
        self._put_start = self.record.start.append
        self._put_pause = self.record.pause.append
        self._put_code = self.record.code.append
        self.time = 0.0
        self.standby = False
        self.begun = 0
        self._attempts, self._rng = attempts, rng
        self._plane = len(self.stations) * attempts
        self._bytes, self._chunk, self._base, self._fields = b"", 0, -1, 0
        for number, station in enumerate(self.stations):
            station.offset = number * attempts
        self._events: list[tuple[float, int, Callable[[], None]]] = []
        self._scheduled = 0
        self._next = _NEVER
        self._number = 0
        #: Number of the last request that could not be read because of a late response.
        self._spoilt = -1
        #: Bits and start time [bit] of a late response that may overlap the next request.
        self._ghost: tuple[str, float] | None = None
        self.locate()

    @property
    def seconds(self) -> float:
        """Simulated time [s]."""
        return self.time * self.transaction.bit_time

    def schedule(self, seconds: float, action: Callable[[], None]) -> None:
        """Schedule an action at time `seconds`; simultaneous actions run in the order scheduled."""
        self._scheduled += 1
        entry = (seconds / self.transaction.bit_time, self._scheduled, action)
        heapq.heappush(self._events, entry)
        self._next = self._events[0][0]

    def happen(self, until: float) -> None:
        """Run the actions that are scheduled for times up to and including `until` [bit]."""
        while self._events and self._events[0][0] <= until:
            action = heapq.heappop(self._events)[2]
            self._next = self._events[0][0] if self._events else _NEVER
            action()

    def stop_master(self, until: float) -> None:
        """Stop the master until the time `until` [s]; see `MasterStops`."""
        raise MasterStops(until)

    def locate(self) -> None:
        """Update the lists of powered slaves by address; the last list contains them all."""
        there = [s for s in self.stations if s.slave.powered]
        self._at = [[s for s in there if s.slave.address == address] for address in range(32)]
        self._at.append(there)
        self._routes: dict[PreparedRequest, list[_Route]] = {}

    def _route(self, order: PreparedRequest) -> list[_Route]:
        """Return the slaves that a request addresses, each with its action and the data."""
        route = []
        for station in self._at[order.station]:
            said = order.reads[station.slave.kind]
            if said is not None:
                route.append((station, station.slave, OBEY[said.call], said.data))
        self._routes[order] = route
        return route

    def switch(self, station: Station, on: bool, time: float) -> None:
        """Switch a slave's supply off or on at a time [s]; any active fault keeps it off."""
        station.cuts += -1 if on else 1
        if station.cuts == 0:
            station.slave.switch_on()
            station.since = self._number + 1
        elif station.slave.powered:
            station.slave.switch_off(time)
        self.locate()

    def begin(self, phase: Phase, cycle: int) -> None:
        """Record that a phase of the master begins."""
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
        """Return the index of a cycle in its chunk; a new chunk's disturbances are drawn first."""
        if cycle % _CHUNK == 0 or not self._bytes:
            rates = [station.rates for station in self.stations]
            drawn = draw_disturbances(self._rng, _CHUNK, rates, self._attempts)
            self._bytes = drawn.tobytes()
        return cycle % _CHUNK

    def _draw_one(self, station: Station) -> int:
        """Draw the disturbance of a request in a phase before data exchange."""
        if station.rates == (0.0, 0.0):
            return 0
        return int(draw_disturbances(self._rng, 1, [station.rates], 1)[0, 0, 0, 0])

    def transact(self, order: PreparedRequest, attempt: int) -> int:
        """Send a request and return the data that the master receives, or `SILENT` or `FAULTY`."""
        start, transaction = self.time, self.transaction
        end = start + REQUEST_BITS
        if end >= self._next:
            self.happen(end)
        before = self._number
        self._number = number = before + 1
        seconds, base, spoilt = end * transaction.bit_time, self._base, self._spoilt
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
            if what and station.quiet:
                what = 0
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
                pause += transaction.unsynchronised
            data = obey(slave, carried, seconds)
            if data >= 0:
                replies.append((data, pause, what, station))
        if order.moves:
            self.locate()

        fields = order.code | self._fields | attempt << ATTEMPT
        self._put_start(start)
        if len(replies) == 1:
            data, pause, what, station = replies[0]
            if not what and pause <= transaction.timeout and not station.lost_replies:
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
        wait = transaction.timeout if last != last else last + self._tail
        self.time = end + wait
        return reply

    def _readable(self, order: PreparedRequest, start: float) -> bool:
        """Return True if a request can be read despite its collision with a late response."""
        assert self._ghost is not None
        bits, begin = self._ghost
        self._ghost = None
        read, _ = collide(((order.bits, 0), (bits, round(2 * (begin - start)))), REQUEST_BITS)
        if read != order.bits:
            self._spoilt = self._number
        return read == order.bits

    def _resolve(
        self, order: PreparedRequest, end: float, replies: list[tuple[int, float, int, Station]]
    ) -> tuple[int, float, float, int]:
        """Return the data, `SILENT` or `FAULTY`; shortest and longest pause; and the error code."""
        heard = []
        for data, pause, what, station in replies:
            left = station.lost_replies.get(order.request.call, 0)
            if left:
                station.lost_replies[order.request.call] = left - 1
            elif pause > self.transaction.timeout:
                self._ghost = (_ANSWERS[data], end + pause)
            else:
                heard.append((data, pause, what))
        if not heard:
            return SILENT, _NAN, _NAN, SilenceError.code
        first, last = min(h[1] for h in heard), max(h[1] for h in heard)
        data, error = heard[0][0], 0
        if len(heard) > 1:
            # Start times are in half-bits, relative to the first response.
            telegrams = sorted((_ANSWERS[d], round(2 * (pause - first))) for d, pause, _ in heard)
            bits, error = collide(tuple(telegrams), RESPONSE_BITS)
            data = int(bits[1:5], 2) if bits else data
        variant = max(h[2] >> 2 for h in heard)
        if variant and not error:
            error = ONE_PULSE_CODES[data][variant - 1]
        return (FAULTY if error else data), first, last, error
