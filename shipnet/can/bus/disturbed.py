"""What happens on a bus with errors: error frames, retransmission, fault confinement."""

from __future__ import annotations

from heapq import heappop, heappush
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from shipnet.can.bus.arbitration import NEVER, OVERWRITTEN, WAITING, Releases, unpacked
from shipnet.can.bus.confinement import SEQUENCE_BITS, SUSPEND_BITS, Counters
from shipnet.can.layout import INTERMISSION

__all__ = ["Disturbed", "Failure", "Faults", "send_disturbed"]

Integers = npt.NDArray[np.int64]


class Faults(NamedTuple):
    """What disturbs the bus.

    Attributes
    ----------
    rate : float
        Probability that a frame is disturbed, once an attempt.
    instants : ndarray of int64, shape (n_instants,)
        Times at which a bit is disturbed [ns], not falling.
    error_bits : int
        Length of an error frame with intermission [bit].
    recover : bool
        Whether a node off the bus comes back by itself.
    rng : numpy.random.Generator or None
        Chance; None if `rate` is 0.
    """

    rate: float
    instants: Integers
    error_bits: int
    recover: bool
    rng: np.random.Generator | None


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


class Disturbed(NamedTuple):
    """What happened on a disturbed bus."""

    start: list[int]
    failures: list[Failure]
    counters: Counters
    bus_off: list[int]
    """how often each node went off the bus"""


class _Nodes:
    """Nodes with their waiting frames, their counters, and the times before which they rest."""

    def __init__(self, number: int) -> None:
        self.counters = Counters(number)
        self.waiting: list[list[int]] = [[] for _ in range(number)]
        self.rest_until: list[int] = [0] * number
        self.bus_off = [0] * number

    def next_frame(self, now: int, start: list[int], mask: int) -> int:
        """Return the item that wins the arbitration, -1 if there is none."""
        best, winner = -1, -1
        for node, queue in enumerate(self.waiting):
            while queue and start[queue[0] & mask] == OVERWRITTEN:
                heappop(queue)
            if queue and self.rest_until[node] <= now and (best < 0 or queue[0] < best):
                best, winner = queue[0], node
        if winner >= 0:
            heappop(self.waiting[winner])
        return best

    def suspend(self, node: int, until: int) -> None:
        """Make a node that is error passive wait after its own frame."""
        if node not in self.counters.missing and self.counters.is_passive(node):
            self.rest_until[node] = until

    def come_back(self, sequences: int, now: int) -> None:
        """Let nodes return that have seen the bus at rest often enough."""
        for node in self.counters.rested(sequences):
            self.rest_until[node] = now


def send_disturbed(
    releases: Releases,
    horizon: int,
    sender: Integers,
    faults: Faults,
    bit: int,
    *,
    overwrite: bool,
) -> Disturbed:
    """Return what happens on a bus with errors, retransmission and fault confinement.

    Parameters
    ----------
    releases : Releases
        Frames that ask for the bus.
    horizon : int
        Time from which no frame begins [ns].
    sender : ndarray of int64, shape (n_messages,)
        Node that sends each message, from 0 without gaps.
    faults : Faults
        What disturbs the bus.
    bit : int
        Bit time [ns].
    overwrite : bool
        As for `send_all`; a frame that failed is overwritten as well.

    Returns
    -------
    Disturbed
        Starts of the good frames as from `send_all`, and what failed.

    Examples
    --------
    The first frame is disturbed in its fourth bit; an error frame of 23 bits follows:

    >>> frames = Releases(*np.array([[0, 0], [0, 1], [50, 50]]))
    >>> faults = Faults(0.0, np.array([3]), 23, True, None)
    >>> happened = send_disturbed(frames, 500, np.array([0, 1]), faults, 1, overwrite=False)
    >>> happened.start, happened.failures[0].free, happened.counters.tec
    ([27, 77], 27, [7, 0])
    """
    due, ranks, durations, items, mask = unpacked(releases)
    owner = sender.tolist()
    nodes = _Nodes(max(owner) + 1)
    newest = [-1] * len(owner)
    start = [WAITING] * len(ranks)
    failures: list[Failure] = []
    strikes = [*faults.instants.tolist(), NEVER]
    at, strike, now, counted = 0, 0, 0, 0
    sequence = SEQUENCE_BITS * bit
    while now < horizon:
        while due[at] <= now:
            rank = ranks[at]
            if overwrite:
                if newest[rank] >= 0:
                    start[newest[rank]] = OVERWRITTEN
                newest[rank] = at
            heappush(nodes.waiting[owner[rank]], items[at])
            at += 1
        missing = nodes.counters.missing if faults.recover else {}
        if missing:
            rested = (now - counted) // sequence
            counted += rested * sequence
            nodes.come_back(rested, now)
        item = nodes.next_frame(now, start, mask)
        if item < 0:
            nexts = [due[at], *(rest for rest in nodes.rest_until if now < rest)]
            nexts += [counted + sequences * sequence for sequences in missing.values()]
            if min(nexts) == NEVER:
                break
            now = min(nexts)
            continue
        picked = item & mask
        rank = ranks[picked]
        node = owner[rank]
        open_bits = durations[picked] // bit - INTERMISSION
        while strikes[strike] < now:
            strike += 1
        broken = open_bits
        if strikes[strike] < now + open_bits * bit:
            broken = (strikes[strike] - now) // bit
        if faults.rng is not None and faults.rng.random() < faults.rate:
            broken = min(broken, int(faults.rng.integers(open_bits)))
        good = broken == open_bits
        began = now
        now += durations[picked] if good else (broken + 1 + faults.error_bits) * bit
        # Delimiter, end of frame and intermission are one sequence of 11 recessive bits.
        counted = now
        if missing:
            nodes.come_back(1, now)
        if good:
            start[picked] = began
            if newest[rank] == picked:
                newest[rank] = -1
            nodes.counters.sent(node)
        else:
            heappush(nodes.waiting[node], item)
            if nodes.counters.failed(node):
                nodes.bus_off[node] += 1
                nodes.rest_until[node] = NEVER
            tec, state = nodes.counters.tec[node], nodes.counters.state(node)
            failures.append(Failure(picked, began, now, broken, tec, state))
        nodes.suspend(node, now + SUSPEND_BITS * bit)
    return Disturbed(start, failures, nodes.counters, nodes.bus_off)
