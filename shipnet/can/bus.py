"""Event-by-event simulation of a CAN bus, in whole nanoseconds.

When the bus becomes free, the waiting frame of highest priority is sent without interruption. All
frames released at the same instant take part in the same arbitration.
"""

from __future__ import annotations

from collections.abc import Iterator
from heapq import heappop, heappush
from typing import NamedTuple

import numpy as np

from shipnet.arrays import Integers
from shipnet.can.faults import BitErrors, ErrorAt, Simulated
from shipnet.can.frame import INTERMISSION
from shipnet.clock import NEVER, nanoseconds

WAITING = -1  #: Start time that marks a frame that was never sent.

#: Length of an error frame with intermission and a second error flag of 6 bits [bit].
ERROR_FRAME = 23

#: Error counts at which a node becomes error passive and bus off; number of recessive sequences
#: after which a bus-off node recovers, and their length [bit]; suspend time of an error-passive
#: node after its own frame [bit]: Bosch, CAN specification 2.0, part B, sections 8 and 3.2.5.
PASSIVE, BUS_OFF, RECOVERY_SEQUENCES, SEQUENCE_BITS, SUSPEND_BITS = 128, 256, 128, 11, 8


class Releases(NamedTuple):
    """Frames in order of release, and the frame length of each message; all times in ns."""

    time: Integers
    message: Integers
    length: Integers


_FEW = 30  #: Smallest group of busy periods of similar size that is solved in one array.


class _Traffic:
    """Frames in order of release, and the state of the bus on which they are sent."""

    def __init__(self, releases: Releases) -> None:
        number = len(releases.time)
        self.shift = number.bit_length()
        self.mask = (1 << self.shift) - 1
        # Python loops read lists faster than arrays.
        self.due = [*releases.time.tolist(), NEVER]
        #: Priority and index of each frame in one number; the smallest is sent next.
        self.item = (releases.message << self.shift | np.arange(number)).tolist()
        self.length = releases.length.tolist()
        self.start = [WAITING] * number
        self.waiting: list[int] = []
        self.at = self.now = 0

    def send(self, most: int, until: int) -> list[int]:
        """Send up to `most` frames that begin before `until`; return the priority of each."""
        due, items, length, waiting = self.due, self.item, self.length, self.waiting
        start, shift, mask = self.start, self.shift, self.mask
        at, now, sent = self.at, self.now, []
        upcoming = due[at]
        while now < until:
            while upcoming <= now:
                heappush(waiting, items[at])
                at += 1
                upcoming = due[at]
            if not most:
                break
            if not waiting:
                now = upcoming
                continue
            item = heappop(waiting)
            rank = item >> shift
            start[item & mask] = now
            sent.append(rank)
            now += length[rank]
            most -= 1
        self.at, self.now = at, now
        return sent


def send_undisturbed(releases: Releases, horizon: int) -> Integers:
    """Return each frame's start time if no errors occur [ns]; `WAITING` if not before `horizon`."""
    time, message, length = releases
    duration = length[message]
    done = np.cumsum(duration)
    end = np.maximum.accumulate(time - done + duration) + done
    first = np.flatnonzero(np.r_[True, time[1:] >= end[:-1]][: len(time)])
    size = np.diff(first, append=len(time))
    start, left = time.copy(), size > 1
    for most in (4, 8, 16, 32, 64):
        periods = np.flatnonzero(left & (size <= most))
        if len(periods) < _FEW:
            continue
        left[periods] = False
        # Longest first, so that the unfinished busy periods are the first columns.
        periods = periods[np.argsort(-size[periods], kind="stable")]
        begin, number, row = first[periods], size[periods], np.arange(most)[:, np.newaxis]
        frame = np.minimum(begin + row, len(time) - 1)
        # Time, priority and index of a frame in one number; the smallest is sent first.
        rank = message[frame] * most + row
        shift = int(rank.max()).bit_length()
        gone = most * int(length.max()) + 1 << shift
        release = np.where(row < number, time[frame] - time[begin] << shift, gone)
        now = np.zeros_like(begin)
        for busy in np.searchsorted(-number, -np.arange(number[0])).tolist():
            key = np.maximum(release[:, :busy], now[:busy])
            key += rank[:, :busy]
            least = np.minimum.reduce(key, axis=0)
            picked = least & most - 1
            sent = begin[:busy] + picked
            waited = least >> shift
            start[sent] = time[begin[:busy]] + waited
            now = waited + duration[sent] << shift
            release[picked, np.arange(busy)] = gone
    others = np.repeat(left, size)
    traffic = _Traffic(Releases(time[others], message[others], length))
    traffic.send(len(time), horizon)
    start[others] = traffic.start
    start[start >= horizon] = WAITING
    return start


class Nodes:
    """Error counters of the nodes, and the time from which each may send again."""

    def __init__(self, number: int) -> None:
        self.tec, self.rec = [0] * number, [0] * number
        #: Number of recessive sequences that each bus-off node still needs to recover.
        self.missing: dict[int, int] = {}
        self.rest_until = [0] * number
        #: Number of times each node went bus off.
        self.bus_off = [0] * number
        #: Number of correct frames per sender that its error counters do not include yet.
        self.good = [0] * number
        #: True if no node is error passive, bus off or suspended; then the counters do not matter.
        self.calm = True

    def failed(self, sender: int) -> None:
        """Count an error in a node's frame; the node may go bus off."""
        self.settle()
        for node in range(len(self.tec)):
            if node != sender and node not in self.missing:
                self.rec[node] += 1
        self.tec[sender] += 8
        if self.tec[sender] >= BUS_OFF:
            self.missing[sender] = RECOVERY_SEQUENCES
            self.bus_off[sender] += 1
            self.rest_until[sender] = NEVER

    def settle(self) -> None:
        """Decrease the error counters for the correct frames sent since the last call."""
        total = sum(self.good)
        if not total:
            return
        for node, own in enumerate(self.good):
            others = total - own
            if others and node not in self.missing:
                self.rec[node] = max(min(self.rec[node], PASSIVE) - others, 0)
            self.tec[node] = max(self.tec[node] - own, 0)
        self.good = [0] * len(self.good)

    def sent(self, sender: int, now: int, suspended: int) -> None:
        """Update the nodes after a frame; an error-passive sender waits until `suspended`."""
        self.settle()
        if self.state(sender) == "error passive":
            self.rest_until[sender] = suspended
        passive = max(self.tec + self.rec) >= PASSIVE
        self.calm = not (self.missing or passive or max(self.rest_until) > now)

    def come_back(self, sequences: int, now: int) -> None:
        """Count recessive sequences; a bus-off node recovers after it has received enough."""
        for node in list(self.missing):
            self.missing[node] -= sequences
            if self.missing[node] <= 0:
                del self.missing[node]
                self.tec[node] = self.rec[node] = 0
                self.rest_until[node] = now

    def state(self, node: int) -> str:
        """Return ``"error active"``, ``"error passive"`` or ``"bus off"``."""
        if node in self.missing:
            return "bus off"
        passive = self.tec[node] >= PASSIVE or self.rec[node] >= PASSIVE
        return "error passive" if passive else "error active"


class Failure(NamedTuple):
    """A destroyed frame: index, times [ns], disturbed bit, and the sender's new TEC and state."""

    release: int
    start: int
    free: int
    bit: int
    tec: int
    state: str


def send(
    releases: Releases, horizon: int, sender: Integers, faults: tuple[Simulated, ...], bit: int,
    rng: np.random.Generator,
) -> tuple[Integers, list[Failure], Nodes]:  # fmt: skip
    """Return the start time of each frame, the destroyed frames, and the nodes at the end."""
    owner = sender.tolist()
    nodes = Nodes(max(owner) + 1)
    failures: list[Failure] = []
    if not faults:
        return send_undisturbed(releases, horizon), failures, nodes
    traffic = _Traffic(releases)
    start, waiting = traffic.start, traffic.waiting
    at_times = sorted(nanoseconds(fault.time) for fault in faults if isinstance(fault, ErrorAt))
    strikes = iter([*at_times, NEVER])
    struck = next(strikes)
    longest = max(traffic.length)
    random = [f for f in faults if isinstance(f, BitErrors) and f.rate]
    chances = _chances([f.rate for f in random], longest // bit - INTERMISSION, rng)
    clear = 0
    gaps: list[int] = []
    #: Waiting frames of nodes that may not send yet.
    held: dict[int, list[int]] = {}
    rest_until = nodes.rest_until
    counted = 0
    sequence = SEQUENCE_BITS * bit
    while traffic.now < horizon:
        traffic.send(0, horizon)
        now = traffic.now
        if nodes.missing:
            rested = (now - counted) // sequence
            counted += rested * sequence
            nodes.come_back(rested, now)
        if held:
            for node in [node for node in held if rest_until[node] <= now]:
                for item in held.pop(node):
                    heappush(waiting, item)
        if not waiting:
            nexts = [traffic.due[traffic.at], *(rest for rest in rest_until if now < rest)]
            nexts += [counted + number * sequence for number in nodes.missing.values()]
            if min(nexts) == NEVER:
                break
            traffic.now = min(nexts)
            continue
        while struck < now:
            struck = next(strikes)
        if not (clear or gaps):
            clear, gaps = next(chances)
        if nodes.calm and clear and now < min(horizon, struck - longest):
            sent = traffic.send(clear, min(horizon, struck - longest))
            clear -= len(sent)
            if failures:  # otherwise all counters remain 0
                for rank in sent:
                    nodes.good[owner[rank]] += 1
            continue
        item = heappop(waiting)
        picked, rank = item & traffic.mask, item >> traffic.shift
        node = owner[rank]
        if rest_until[node] > now:
            held.setdefault(node, []).append(item)
            continue
        open_bits = traffic.length[rank] // bit - INTERMISSION
        broken = open_bits
        if struck < now + open_bits * bit:
            broken = (struck - now) // bit
        if clear:
            clear -= 1
        else:
            for fault, gap in zip(random, gaps, strict=True):
                begin, end = fault.span
                # Number of bits of the frame before the first disturbed bit.
                hit = gap - 1 + max(-((now - begin) // bit), 0)
                if hit < broken and now + hit * bit < end:
                    broken = hit
            clear, gaps = next(chances)
        good = broken == open_bits
        traffic.now = now + (traffic.length[rank] if good else (broken + 1 + ERROR_FRAME) * bit)
        # Every frame ends with one sequence of 11 recessive bits, intermission included.
        counted = traffic.now
        if nodes.missing:
            nodes.come_back(1, counted)
        if good:
            start[picked] = now
            nodes.good[node] += 1
        else:
            heappush(waiting, item)
            nodes.failed(node)
            tec, state = nodes.tec[node], nodes.state(node)
            failures.append(Failure(picked, now, counted, broken, tec, state))
        if not (good and nodes.calm):
            nodes.sent(node, counted, counted + SUSPEND_BITS * bit)
    nodes.settle()
    return np.array(start, dtype=np.int64), failures, nodes


_BLOCK = 4096  #: Number of random numbers drawn at once.


def _chances(
    rates: list[float], bits: int, rng: np.random.Generator
) -> Iterator[tuple[int, list[int]]]:
    """Yield how many attempts are undisturbed, and the first bit that each fault hits in the next.

    Bits are counted from 1; faults after the first `bits` bits of an attempt are ignored. If the
    list of bits is empty, the next pair describes the attempt.
    """
    if not rates:
        yield NEVER, []
    while True:
        block = np.array([rng.geometric(rate, _BLOCK) for rate in rates])
        tried = 0
        for attempt in np.flatnonzero((block <= bits).any(axis=0)).tolist():
            yield attempt - tried, block[:, attempt].tolist()
            tried = attempt + 1
        yield _BLOCK - tried, []


_CELLS = 40_000  #: Messages times sets simulated at once; their data fit in a core's cache.


def send_batch(
    first: Integers, period: Integers, length: Integers, horizon: int
) -> tuple[Integers, Integers, Integers]:
    """Return the longest and total response time and the number of frames, per message and set."""
    # In ticks of their greatest common divisor, times often fit into 32 bits.
    tick = int(np.gcd.reduce(np.r_[first.ravel(), period, length, horizon]))
    parts = np.array_split(first // tick, max(1, round(first.size / _CELLS)), axis=1)
    solved = [_send_part(part, period // tick, length // tick, horizon // tick) for part in parts]
    largest, total, sent = (np.concatenate(column, axis=1) for column in zip(*solved, strict=True))
    return largest * tick, total * tick, sent


def _send_part(
    first: Integers, period: Integers, length: Integers, horizon: int
) -> tuple[Integers, Integers, Integers]:
    number, shift = len(period), (len(period) - 1).bit_length()
    latest = max(int(first.max(initial=0)), horizon) + 2 * int(period.max()) + int(length.max())
    kind = np.int32 if latest << shift < 2**31 else np.int64
    # Time and priority of each message's next frame in one number; the smallest is sent first.
    rank = np.arange(number)
    # An array in C order is flattened without a copy.
    head = np.ascontiguousarray(first << shift, dtype=kind)
    step = (period << shift).astype(kind)
    busy = ((length << shift) - rank).astype(kind)
    ranks, now = rank[:, np.newaxis].astype(kind), np.zeros(first.shape[1], dtype=kind)
    begin, largest, total = (
        np.empty_like(head),
        np.zeros_like(head),
        np.zeros(head.shape, dtype=np.int64),
    )
    which = columns = np.arange(first.shape[1])
    results = [np.zeros(first.shape, dtype=np.int64) for _ in range(3)]
    while which.size:
        np.maximum(head, now, out=begin)
        begin += ranks
        least = np.minimum.reduce(begin, axis=0)
        if least.max() >= horizon << shift:
            going = least < horizon << shift
            for result, own in zip(results, (largest, total, head), strict=True):
                result[:, which[~going]] = own[:, ~going]
            head, largest, total = (own.compress(going, axis=1) for own in (head, largest, total))
            which, least, begin = which[going], least[going], np.empty_like(head)
            columns = columns[: which.size]
        picked = (least & (1 << shift) - 1).astype(np.intp)
        now = least + busy.take(picked, mode="clip")
        place = picked * which.size + columns
        released = head.reshape(-1).take(place, mode="clip")
        response = now - released
        np.maximum.at(largest.reshape(-1), place, response)
        np.add.at(total.reshape(-1), place, response.astype(np.int64))
        head.reshape(-1)[place] = released + step.take(picked, mode="clip")
    most, summed, behind = (result >> shift for result in results)
    return most, summed, (behind - first) // period[:, np.newaxis]
