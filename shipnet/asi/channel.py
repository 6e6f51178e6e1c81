"""Simulated line between a master and its slaves, with disturbances and a traffic record."""

from __future__ import annotations

import heapq
from collections.abc import Callable, Sequence
from dataclasses import astuple
from functools import cache
from math import inf, nan
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from shipnet.arrays import Indices, Integers
from shipnet.asi.batch import NONE
from shipnet.asi.master import FAULTY, SILENT, Phase, RunningMaster
from shipnet.asi.modulation import ONE_PULSE_CODES, collide
from shipnet.asi.slave import (
    KINDS,
    MOVING,
    STATE,
    RunningSlave,
    Slave,
    States,
    as_read,
    exchange,
    slave_key,
)
from shipnet.asi.telegram import REQUEST_BITS, RESPONSE_BITS, Call, Request, Response
from shipnet.asi.timing import Transaction
from shipnet.compiled import compiled
from shipnet.errors import ArgumentError, SilenceError
from shipnet.fields import check_whole

Rows: TypeAlias = npt.NDArray[np.void]

#: The record of a simulation has one row per transaction.
TRANSACTION = np.dtype(
    [
        ("start", float),  # start of the request [bit]
        ("attempt", np.int64),  # 0 is the first
        ("outcome", np.int64),  # 0, or the code of an error
        ("pause", float),  # pause before the response [bit]; NaN if there was none
        ("response", np.int64),  # data of the response; -1 if it cannot be read
        ("executed", bool),
        ("phase", np.int64),
        ("cycle", np.int64),  # -1 before data exchange
        ("standby", bool),
        ("request", "S14"),
        ("call", np.int64),
        ("address", np.int64),
        ("half", np.int64),  # index in `KINDS`
        ("data", np.int64),
    ]
)

#: Attempt, outcome, pause, response and execution of a request that nobody answers.
_UNANSWERED = (0, SilenceError.code, nan, -1, False)

#: Number of ways to disturb one pulse of a response; the ways are numbered from 1.
VARIANTS = len(ONE_PULSE_CODES[0])

#: Disturbance of a request to a slave and of its response.
DISTURBANCE = np.dtype(
    [
        ("lost", bool),  # the slave misses the request
        ("missed", bool),  # it missed the previous request, which went to another slave
        ("variant", np.uint8),  # how its response is disturbed; 0 if it is not
    ]
)

#: Error code of each response 0..15, by `variant`.
_ERRORS = np.pad(np.array(ONE_PULSE_CODES, dtype=np.int64), ((0, 0), (1, 0)))

#: Number of phases per cycle: data exchange, management and inclusion.
PHASES = 3


def draw_disturbances(
    rng: np.random.Generator, n_cycles: int, rates: Sequence[tuple[float, float]], attempts: int
) -> Rows:
    """Draw independent `DISTURBANCE` values, of shape (n_cycles, 3, n_slaves, attempts).

    `rates` contains each slave's probabilities of a missed request and of a disturbed response.
    """
    drawn = np.zeros((n_cycles, PHASES, len(rates), attempts), dtype=DISTURBANCE)
    shape = (n_cycles, PHASES, attempts)
    for slave, (lost, disturbed) in enumerate(rates):
        to_slave = drawn[:, :, slave]
        if lost > 0:
            to_slave["lost"] = rng.random(shape) < lost
            to_slave["missed"] = rng.random(shape) < lost
        if disturbed > 0:
            variant = rng.integers(1, VARIANTS + 1, shape, dtype=np.uint8)
            to_slave["variant"] = np.where(rng.random(shape) < disturbed, variant, 0)
    return drawn


class Station(RunningSlave):
    """A simulated slave, its position on the line and its disturbances."""

    def __init__(
        self, settings: Slave, states: States, row: int, position: float, delay: float
    ) -> None:
        super().__init__(settings, states, row)
        self.position, self.fields["delay"] = position, delay
        #: Label at the start of the simulation.
        self.name = self.label
        #: Probabilities of a missed request and of a disturbed response.
        self.rates = (0.0, 0.0)
        #: Number of responses that are still to be lost, by call.
        self.lost_replies: dict[Call, int] = {}
        #: Number of active faults that disconnect the slave from the supply.
        self.cuts = 0

    def check_delay(self, transaction: Transaction, late: float = 0.0) -> None:
        """Raise ArgumentError if `late` < 0 or a response may begin after the next request ends."""
        pause = self.fields["delay"] + transaction.unsynchronised + late
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
        self.all: list[Station] = []
        self.states = np.zeros(len(placed), STATE)
        for slave, position, delay in placed:
            pause = transaction.master_pause + 2 * delay / transaction.bit_time
            station = Station(slave, self.states, len(self.all), position, pause)
            station.check_delay(transaction)
            self.all.append(station)
            self.setdefault(station.name, []).append(station)

    def __missing__(self, label: str) -> list[Station]:
        slave_key(label)
        raise ArgumentError(
            f"slave {label} is not on the line; its slaves are {', '.join(self) or 'none'}"
        )


@compiled
def receive(
    states: States, slave: int, number: int, lost: bool, missed: bool, unsynchronised: float
) -> float:
    """Let a slave receive a request; return its pause before the response, or -1 if it is lost.

    Requests are numbered. A slave that `missed` the previous request, to whichever slave, or had no
    supply then, is not synchronised and waits longer, by `unsynchronised`.
    """
    if states["asked"][slave] != number - 1:
        states["synchronised"][slave] = not missed and states["since"][slave] < number
    states["asked"][slave] = number
    pause = states["delay"][slave]
    if not states["synchronised"][slave]:
        pause += unsynchronised
    states["synchronised"][slave] = not lost
    return -1.0 if lost else pause


#: In place of a slave's index: nobody hears a request; or the transaction is unusual, which only
#: `Channel.transact` can simulate.
NOBODY, UNUSUAL = -1, -2


@compiled
def run_cycles(
    keys: Indices,
    polled: int,
    attempt: int,
    record: Rows,
    row: int,
    time: float,
    requests: Rows,
    slaves: Indices,
    states: States,
    disturbances: Rows,
    errors: Integers,
    failures: Integers,
    repetitions: int,
    drop_after: int,
    transaction: tuple[float, float, float, float, float],
    until: float,
    event: float,
) -> tuple[int, int, int, float]:
    """Simulate cycles, telegram by telegram, and record the transactions; times are in bits.

    A row of `keys` is a cycle: the master polls the first slaves, as many as are `polled` (phase
    0), reads the status of one (1), and looks for a slave at a vacant address (2). It repeats a
    failed request at once. `slaves` is -1 where nobody hears a request, and -2 if the transaction
    is unusual. Stop before it, before an event, and before the master drops a slave.
    """
    _, slave_pause, bit_time, unsynchronised, timeout = transaction
    step = 0
    while step < keys.size and time < until:
        # The master sends a request.
        cycle, position = step // keys.shape[1], step % keys.shape[1]
        phase, key = max(0, position - polled + 1), keys[cycle, position]
        slave, end = slaves[phase, key], time + 14
        watchdog = phase == 0 and slave >= 0 and end * bit_time > states["expires"][slave]
        if slave == -2 or watchdog or end >= event:
            break
        record[row] = requests[phase, key]
        record["start"][row], record["attempt"][row] = time, attempt
        record["cycle"][row] += cycle
        time = end + timeout
        failed = True

        # A slave hears it, unless a fault strikes, and responds; its status is 0.
        data = variant = -1
        if slave >= 0:
            fault, loud = disturbances[cycle, phase, slave, attempt], not states["quiet"][slave]
            lost, missed = loud and fault["lost"], loud and fault["missed"]
            pause = receive(states, slave, row + 1, lost, missed, unsynchronised)
            variant = fault["variant"] if loud else 0
            if not lost:
                outputs = requests["data"][phase, key]
                data = exchange(states, slave, outputs, end * bit_time) if phase == 0 else 0

        # The master hears the response, which a fault may have disturbed.
        if data >= 0:
            error = errors[data, variant]
            failed = error > 0
            record["executed"][row], record["pause"][row] = True, pause
            record["outcome"][row], record["response"][row] = error, -1 if failed else data
            time = end + pause + 7 + slave_pause
        row += 1

        # The master repeats a failed request, or continues with the next one.
        attempt = attempt + 1 if failed else 0
        if failed and attempt <= repetitions and phase < 2:
            continue
        if phase == 0:
            if failed and failures[key] + 1 == drop_after:
                break
            failures[key] = failures[key] + 1 if failed else 0
        step, attempt = step + 1, 0
    return step, attempt, row, time


_ANSWERS = [Response(data).bits for data in range(16)]

#: Number of cycles for which disturbances are drawn at a time.
_CHUNK = 256


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
        stations: Stations,
        transaction: Transaction,
        attempts: int,
        rng: np.random.Generator,
        cycles: float,
        until: float,
    ) -> None:
        """Simulate `cycles` cycles, or until the time `until` [bit]."""
        self.stations, self.transaction = stations, transaction
        self.cycles, self.until = cycles, until
        self._pauses: Any = tuple(map(float, astuple(transaction)))
        # A cycle has two more requests; one takes at least 24 bit times, and some ten steps.
        self._steps = 10 * min(cycles * (len(stations.all) + 2), until / 24)
        self._record, self.row = np.empty(0, TRANSACTION), 0
        self.time = 0.0
        self.standby = False
        self.begun = 0
        self._attempts, self._rng = attempts, rng
        self._drawn = np.zeros(0, DISTURBANCE)
        self._phase, self._cycle = Phase.OFFLINE, -1
        self._events: list[tuple[float, int, Callable[[], None]]] = []
        self._scheduled = 0
        #: Number of the last request that could not be read because of a late response.
        self._spoilt = -1
        #: Bits and start time [bit] of a late response that may overlap the next request.
        self._late: tuple[str, float] | None = None
        #: State of the lists, the usual requests, and the slaves that hear them.
        self._table: tuple[object, Rows, Indices] | None = None

    @property
    def record(self) -> Rows:
        """All transactions so far."""
        return self._record[: self.row]

    @property
    def seconds(self) -> float:
        """Simulated time [s]."""
        return self.time * self.transaction.bit_time

    @property
    def over(self) -> bool:
        """True if the simulation ends before the next request."""
        return self.begun > self.cycles or self.time >= self.until

    def schedule(self, seconds: float, action: Callable[[], None]) -> None:
        """Schedule an action at time `seconds`; simultaneous actions run in the order scheduled."""
        self._scheduled += 1
        entry = (seconds / self.transaction.bit_time, self._scheduled, action)
        heapq.heappush(self._events, entry)

    def happen(self, until: float) -> None:
        """Run the actions that are scheduled for times up to and including `until` [bit]."""
        while self._events and self._events[0][0] <= until:
            heapq.heappop(self._events)[2]()

    def stop_master(self, until: float) -> None:
        """Stop the master until the time `until` [s]; see `MasterStops`."""
        raise MasterStops(until)

    def alter(self, change: Callable[..., None], *values: object) -> None:
        """Change the state of a slave, so that what was usual may be unusual now."""
        change(*values)
        self._table = None

    def _addressed(self, request: Request) -> list[tuple[Station, Request]]:
        """Return the slaves that a request addresses, and the request as each of them reads it."""
        everybody = request.call is Call.BROADCAST_RESET
        there = [
            (station, as_read(_columns(request)[0], station.kind))
            for station in self.stations.all
            if station.powered and (everybody or station.address == request.address)
        ]
        return [(station, read) for station, read in there if read]

    def switch(self, station: Station, on: bool, time: float) -> None:
        """Switch a slave's supply off or on at a time [s]; any active fault keeps it off."""
        station.cuts += -1 if on else 1
        if station.cuts == 0:
            station.switch_on()
            station.fields["since"] = self.row + 1
        elif station.powered:
            station.switch_off(time)
        self._table = None

    def begin(self, phase: Phase, cycle: int) -> None:
        """Note that a phase of the master begins; draw the disturbances of the coming cycles."""
        self._phase, self._cycle = phase, -1 if phase < Phase.DATA_EXCHANGE else cycle
        if phase == Phase.DATA_EXCHANGE:
            if self.begun % _CHUNK == 0 or not self._drawn.size:
                rates = [station.rates for station in self.stations.all]
                self._drawn = draw_disturbances(self._rng, _CHUNK, rates, self._attempts)
            self.begun += 1

    def _disturbance(self, station: Station, attempt: int) -> tuple[bool, bool, int]:
        """Return whether a request and the one before are lost, and the response's disturbance."""
        drawn = np.zeros((), DISTURBANCE)
        if self._phase >= Phase.DATA_EXCHANGE:
            cycle, phase = (self.begun - 1) % _CHUNK, self._phase - Phase.DATA_EXCHANGE
            drawn = self._drawn[cycle, phase, station.row, attempt]
        elif station.rates != (0.0, 0.0):
            drawn = draw_disturbances(self._rng, 1, [station.rates], 1)[0, 0, 0, 0]
        if station.fields["quiet"]:
            return False, False, 0
        return bool(drawn["lost"]), bool(drawn["missed"]), int(drawn["variant"])

    def _rows(self, count: int) -> Rows:
        """Return the record with room for `count` more rows."""
        if self.row + count > len(self._record):
            larger = np.empty(2 * (self.row + count), TRANSACTION)
            larger[: self.row] = self.record
            self._record = larger
        return self._record

    def _requests(self, master: RunningMaster) -> tuple[Rows, Indices]:
        """Return the requests of usual cycles by phase and key, and the slaves that hear them."""
        if self._table is None or self._table[0] is not master.lists.schedule:
            requests = np.zeros((PHASES, 64), TRANSACTION)
            slaves = np.full(requests.shape, UNUSUAL)
            for phase, key, request in master.usual():
                begun = (Phase.DATA_EXCHANGE + phase, 0, self.standby)
                requests[phase, key] = (0.0, *_UNANSWERED, *begun, *_columns(request))
                slaves[phase, key] = self._alone(request)
            slaves[2][slaves[2] != NOBODY] = UNUSUAL
            self._table = master.lists.schedule, requests, slaves
        _, requests, slaves = self._table
        requests["cycle"] = master.cycle
        return requests, slaves

    def _alone(self, request: Request) -> int:
        """Return the index of the only slave that a request addresses; `NOBODY` or `UNUSUAL`."""
        addressed = self._addressed(request)
        if len(addressed) != 1:
            return UNUSUAL if addressed else NOBODY
        station, transaction = addressed[0][0], self.transaction
        late = station.fields["delay"] + transaction.unsynchronised > transaction.timeout
        unusual = late or any(station.lost_replies.values()) or station.status(self.seconds)
        return UNUSUAL if unusual else station.row

    def poll(self, master: RunningMaster) -> Phase | None:
        """Poll the slaves of a cycle; return the next phase, or None if the simulation is over.

        If all is usual, simulate many cycles; the next phase is then the data exchange of another.
        """
        polled, attempt = len(master.lists.schedule[0]), 0
        if polled and not self.over:
            self.happen(self.time + REQUEST_BITS)
        drawn = _CHUNK - (self.begun - 1) % _CHUNK
        keys = master.ahead(int(min(drawn, self.cycles - self.begun + 1)))
        while keys.size:
            if self.over:
                return None
            self.happen(self.time + REQUEST_BITS)
            requests, slaves = self._requests(master)
            step, before = 0, self.row
            if self._late is None and self._spoilt < self.row:
                step, attempt, self.row, self.time = run_cycles.run(
                    self._steps,
                    keys,
                    polled,
                    attempt,
                    self._rows(keys.size * (1 + master.repetitions)),
                    self.row,
                    self.time,
                    requests,
                    slaves,
                    self.stations.states,
                    self._drawn[(self.begun - 1) % _CHUNK :],
                    _ERRORS,
                    master.failures,
                    master.repetitions,
                    master.drop_after,
                    self._pauses,
                    self.until,
                    self._events[0][0] if self._events else inf,
                )
            cycle, slot = divmod(step, keys.shape[1])
            ahead, others = min(cycle, len(keys) - 1), keys[:, polled:].ravel()
            done = others[: 2 * cycle + max(0, slot - polled)].tolist()
            master.go_on(ahead, done)
            self.begun, self._cycle = self.begun + ahead, master.cycle
            if step == keys.size:
                return Phase.DATA_EXCHANGE if done else Phase.MANAGEMENT
            if slot >= polled:
                master.attempt = attempt
                return Phase(Phase.MANAGEMENT + slot - polled)
            keys, polled = keys[ahead : ahead + 1, slot:polled], polled - slot
            key, reply = int(keys[0, 0]), FAULTY
            if self.row == before:
                reply = self.transact(master.lists.polls[key], attempt)
                attempt += 1
            if reply >= 0 or attempt > master.repetitions:
                master.receive(key, reply)
                keys, polled, attempt = keys[:, 1:], polled - 1, 0
        return Phase.MANAGEMENT

    def transact(self, request: Request, attempt: int) -> int:
        """Send a request and return the data that the master receives, or `SILENT` or `FAULTY`."""
        start, end = self.time, self.time + REQUEST_BITS
        self.happen(end)
        number, spoilt = self.row + 1, self._spoilt == self.row
        late = self.transaction.unsynchronised
        answers = []
        for station, read in self._addressed(request) if self._readable(request) else []:
            lost, missed, variant = self._disturbance(station, attempt)
            states, row = self.stations.states, station.row
            pause = receive(states, row, number, lost, missed or spoilt, late)
            now = end * self.transaction.bit_time
            data = NONE if lost else station.obey(read.call, read.data, now)
            if data != NONE:
                answers.append((data, float(pause), variant, station))
        if request.call in MOVING:
            self._table = None
        reply, pause, error = self._resolve(request, end, answers)
        silent = request.call.rule.answer is None
        outcome = 0 if silent else error, pause, max(reply, -1), bool(answers) or silent
        begun = self._phase, self._cycle, self.standby
        self._rows(1)[self.row] = (start, attempt, *outcome, *begun, *_columns(request))
        self.row = number
        return reply

    def _readable(self, request: Request) -> bool:
        """Return True if a request can be read; a late response may have collided with it."""
        if self._late is None:
            return True
        bits, begin = self._late
        self._late = None
        shift = round(2 * (begin - self.time))
        readable = collide(((request.bits, 0), (bits, shift)), REQUEST_BITS)[0] == request.bits
        if not readable:
            self._spoilt = self.row + 1
        return readable

    def _resolve(
        self, request: Request, end: float, answers: list[tuple[int, float, int, Station]]
    ) -> tuple[int, float, int]:
        """Return the data, `SILENT` or `FAULTY`; pause; and error code; let the time pass."""
        transaction, responses = self.transaction, []
        for data, pause, variant, station in answers:
            left = station.lost_replies.get(request.call, 0)
            if left:
                station.lost_replies[request.call] = left - 1
            elif pause > transaction.timeout:
                self._late = (_ANSWERS[data], end + pause)
            else:
                responses.append((data, pause, variant))
        if not responses:
            self.time = end + transaction.timeout
            return SILENT, nan, SilenceError.code
        pauses = [pause for _, pause, _ in responses]
        first, last = min(pauses), max(pauses)
        self.time = end + last + RESPONSE_BITS + transaction.slave_pause
        data, error = responses[0][0], 0
        if len(responses) > 1:
            # Start times are in half-bits, relative to the first response.
            telegrams = sorted(
                (_ANSWERS[d], round(2 * (pause - first))) for d, pause, _ in responses
            )
            bits, error = collide(tuple(telegrams), RESPONSE_BITS)
            data = int(bits[1:5], 2) if bits else data
        error = error or int(_ERRORS[data, max(variant for _, _, variant in responses)])
        return (FAULTY if error else data), first, error


@cache
def _columns(request: Request) -> tuple[str, int, int, int, int]:
    """Return a request's columns in a row of `TRANSACTION`."""
    half = KINDS.index(request.half)
    return request.bits, request.call, request.address, half, request.data
