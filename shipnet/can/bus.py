"""What the bus does next, event by event, in whole nanoseconds.

The most important frame that waits when the bus falls free is sent, and nothing interrupts it.
All releases of an instant are gathered before the arbitration, because all nodes begin together.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from heapq import heappop, heappush
from typing import NamedTuple

import numpy as np

from shipnet.arrays import Integers
from shipnet.can.faults import BitErrors, ErrorAt, Simulated
from shipnet.can.frame import INTERMISSION
from shipnet.clock import NEVER, nanoseconds

#: In place of the start of a frame that never began.
WAITING, OVERWRITTEN = -1, -2

#: Counts from which a node is error passive, and off the bus; Bosch CAN specification 2.0,
#: part B, section 8.
PASSIVE, BUS_OFF = 128, 256

#: Sequences of recessive bits that a node off the bus waits for, and their length [bit]; as above.
RECOVERY_SEQUENCES, SEQUENCE_BITS = 128, 11

#: Bits that an error passive node lets pass after its own frame, part B, section 3.2.5.
SUSPEND_BITS = 8


class Releases(NamedTuple):
    """Frames that ask for the bus, in the order of their release."""

    time: Integers
    message: Integers
    duration: Integers


class Unpacked(NamedTuple):
    """Releases as lists, which a loop reads faster than arrays."""

    due: list[int]
    """times of release, then `NEVER` [ns]"""
    rank: list[int]
    duration: list[int]
    item: list[int]
    """priority and place in one number: the smallest is the next to be sent"""
    mask: int
    """which bits of an item are its place"""


def unpacked(releases: Releases) -> Unpacked:
    """Return releases in the form in which the bus works on them."""
    number = len(releases.time)
    shift = number.bit_length()
    return Unpacked(
        [*releases.time.tolist(), NEVER],
        releases.message.tolist(),
        releases.duration.tolist(),
        (releases.message << shift | np.arange(number)).tolist(),
        (1 << shift) - 1,
    )


def send_all(releases: Releases, horizon: int, *, overwrite: bool) -> list[int]:
    """Return when each frame begins on a bus without errors."""
    due, ranks, durations, items, mask = unpacked(releases)
    newest = [-1] * (int(releases.message.max(initial=0)) + 1)
    start = [WAITING] * len(ranks)
    waiting: list[int] = []
    at, upcoming, now = 0, due[0], 0
    while now < horizon:
        while upcoming <= now:
            if overwrite:
                rank = ranks[at]
                if newest[rank] >= 0:
                    start[newest[rank]] = OVERWRITTEN
                newest[rank] = at
            heappush(waiting, items[at])
            at += 1
            upcoming = due[at]
        if not waiting:
            if upcoming == NEVER:
                break
            now = upcoming
            continue
        picked = heappop(waiting) & mask
        if overwrite:
            if start[picked] == OVERWRITTEN:
                continue
            newest[ranks[picked]] = -1
        start[picked] = now
        now += durations[picked]
    return start


# The bus with errors ---------------------------------------------------------------------------


class Nodes:
    """Nodes of a bus: their error counters, and the times before which they rest."""

    def __init__(self, number: int) -> None:
        self.tec, self.rec = [0] * number, [0] * number
        #: Recessive sequences that each node off the bus still waits for.
        self.missing: dict[int, int] = {}
        self.rest_until = [0] * number
        #: How often each node went off the bus.
        self.bus_off = [0] * number
        #: Good frames of each node that the counters do not hold yet.
        self.good = [0] * number
        #: Whether no node is error passive, off the bus or at rest: no counter matters then.
        self.calm = True

    def failed(self, sender: int) -> None:
        """Count an error in a frame of a node, which may take it off the bus."""
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
        """Count the good frames."""
        for node, own in enumerate(self.good):
            others = sum(self.good) - own
            if others and node not in self.missing:
                self.rec[node] = max(min(self.rec[node], PASSIVE) - others, 0)
            self.tec[node] = max(self.tec[node] - own, 0)
        self.good = [0] * len(self.good)

    def sent(self, sender: int, now: int, suspended: int) -> None:
        """Note what a frame of a node, good or not, has made of the nodes.

        An error passive sender rests until `suspended`.
        """
        self.settle()
        if self.state(sender) == "error passive":
            self.rest_until[sender] = suspended
        passive = max(self.tec + self.rec) >= PASSIVE
        self.calm = not (self.missing or passive or max(self.rest_until) > now)

    def come_back(self, sequences: int, now: int) -> None:
        """Count recessive sequences, and let nodes return that have seen enough of them."""
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
    """A frame that was destroyed."""

    release: int
    start: int
    free: int
    """when the bus was free again [ns]"""
    bit: int
    """which bit was disturbed, 0 the start of frame"""
    tec: int
    """transmit error counter afterwards"""
    state: str


def send_disturbed(
    releases: Releases,
    horizon: int,
    sender: Integers,
    faults: Iterable[Simulated],
    bit: int,
    rng: np.random.Generator,
    recover: bool,
    *,
    overwrite: bool,
) -> tuple[list[int], list[Failure], Nodes]:
    """Return when each frame begins on a bus with errors, its failures and the nodes at the end."""
    due, ranks, durations, items, mask = unpacked(releases)
    owner = sender.tolist()
    nodes = Nodes(max(owner) + 1)
    newest = [-1] * len(owner)
    start = [WAITING] * len(ranks)
    failures: list[Failure] = []
    at_times = sorted((nanoseconds(f.time), f.bits) for f in faults if isinstance(f, ErrorAt))
    strikes = iter([*at_times, (NEVER, 0)])
    struck, struck_bits = next(strikes)
    random = [
        (*f.span, f.bits, _gaps(f.rate, rng)) for f in faults if isinstance(f, BitErrors) and f.rate
    ]
    waiting: list[int] = []
    #: Waiting frames of nodes that rest.
    held: dict[int, list[int]] = {}
    rest_until = nodes.rest_until
    at, now, counted = 0, 0, 0
    sequence = SEQUENCE_BITS * bit
    while now < horizon:
        while due[at] <= now:
            if overwrite:
                rank = ranks[at]
                if newest[rank] >= 0:
                    start[newest[rank]] = OVERWRITTEN
                newest[rank] = at
            heappush(waiting, items[at])
            at += 1
        if nodes.missing and recover:
            rested = (now - counted) // sequence
            counted += rested * sequence
            nodes.come_back(rested, now)
        if held:
            for node in [node for node in held if rest_until[node] <= now]:
                for item in held.pop(node):
                    heappush(waiting, item)
        if not waiting:
            nexts = [due[at], *(rest for rest in rest_until if now < rest)]
            if recover:
                nexts += [counted + number * sequence for number in nodes.missing.values()]
            if min(nexts) == NEVER:
                break
            now = min(nexts)
            continue
        item = heappop(waiting)
        picked = item & mask
        node = owner[ranks[picked]]
        if start[picked] == OVERWRITTEN:
            continue
        if rest_until[node] > now:
            held.setdefault(node, []).append(item)
            continue
        open_bits = durations[picked] // bit - INTERMISSION
        while struck < now:
            struck, struck_bits = next(strikes)
        broken, error_bits = open_bits, 0
        if struck < now + open_bits * bit:
            broken, error_bits = (struck - now) // bit, struck_bits
        for begin, end, length, gaps in random:
            # How many bits of the frame pass before the first that is disturbed.
            hit = next(gaps) - 1
            if begin > now:
                hit += -(-(begin - now) // bit)
            if hit < broken and now + hit * bit < end:
                broken, error_bits = hit, length
        good = broken == open_bits
        began = now
        now += durations[picked] if good else (broken + 1 + error_bits) * bit
        # Delimiter, end of frame and intermission are one sequence of 11 recessive bits.
        counted = now
        if nodes.missing and recover:
            nodes.come_back(1, now)
        if good:
            start[picked] = began
            if overwrite:
                newest[ranks[picked]] = -1
            nodes.good[node] += 1
        else:
            heappush(waiting, item)
            nodes.failed(node)
            tec, state = nodes.tec[node], nodes.state(node)
            failures.append(Failure(picked, began, now, broken, tec, state))
        if not (good and nodes.calm):
            nodes.sent(node, now, now + SUSPEND_BITS * bit)
    nodes.settle()
    return start, failures, nodes


def _gaps(rate: float, rng: np.random.Generator) -> Iterator[int]:
    """Yield again and again after how many bits, itself included, one is disturbed."""
    while True:
        yield from rng.geometric(rate, 4096).tolist()


# Many sets of offsets --------------------------------------------------------------------------


#: Messages times sets that are worked on at a time: they stay in a core's own cache.
_CELLS = 40_000


def send_batch(
    first: Integers, period: Integers, length: Integers, horizon: int
) -> tuple[Integers, Integers, Integers]:
    """Return largest response, sum of responses and frames sent, by message and set."""
    # In the largest common tick, times are often short enough for 32 bits.
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
    # Time and priority in one number: of all next frames, the least is sent.
    rank = np.arange(number)
    # In C order, so that flattening copies nothing.
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
