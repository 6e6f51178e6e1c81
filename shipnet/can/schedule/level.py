"""The equations of response-time analysis, solved in whole ticks.

A fraction of a tick too much makes a ceiling jump by a whole frame, so nothing in here is a float:
a tick divides both the nanosecond and the bit time.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from shipnet.can.layout import INTERMISSION
from shipnet.can.schedule.convention import NO_ERRORS, Convention, ErrorModel
from shipnet.can.schedule.lengths import length_table
from shipnet.can.schedule.messages import MessageSet, check_set
from shipnet.clock import nanoseconds
from shipnet.fields import check_whole

__all__ = ["Bus", "Level", "meets_all", "on_bus"]

#: Steps of a recursion, or instances of a message, after which a busy period counts as endless.
#: Only loads within about 1e-4 of 1 take as many.
_MOST_STEPS = 200_000


#: Frames that come again and again: period, length, and by how much the first may come early.
_Stream = tuple[int, int, int]


class Bus(NamedTuple):
    """A message set at a bit rate, every time in ticks.

    Attributes
    ----------
    second, bit, nanosecond : int
        Length of a second, a bit time, a nanosecond.
    streams : tuple of (int, int, int)
        Period, frame and jitter of each message, the highest priority first.
    deadline : tuple of int
        Of each message.
    convention : Convention
        How responses are counted.
    """

    second: int
    bit: int
    nanosecond: int
    streams: tuple[_Stream, ...]
    deadline: tuple[int, ...]
    convention: Convention


def on_bus(messages: MessageSet, bit_rate: int, convention: Convention) -> Bus:
    """Return a message set in ticks of the bus.

    Parameters
    ----------
    messages : MessageSet
        The messages.
    bit_rate : int
        Bit rate, 1000..1000000 [bit/s].
    convention : Convention
        How long frames are.

    Returns
    -------
    Bus
        All times in ticks.

    Raises
    ------
    ArgumentError
        If the bit rate is out of range.

    Examples
    --------
    >>> from shipnet.can.schedule.messages import Message
    >>> on_bus(MessageSet([Message("A", 1, 7, 2.5e-3)]), 125_000, Convention()).streams
    ((2500000, 1000000, 0),)
    """
    check_set(messages)
    bit_rate = check_whole("bit_rate", bit_rate, 1000, 1_000_000, " bit/s")
    second = math.lcm(10**9, bit_rate)
    bit, nanosecond = second // bit_rate, second // 10**9
    table = length_table(convention.lengths)
    spared = INTERMISSION if convention.intermission == "nowhere" else 0
    return Bus(
        second,
        bit,
        nanosecond,
        tuple(
            (
                nanoseconds(m.period) * nanosecond,
                ((m.bits or int(table[m.extended][m.dlc])) - spared) * bit,
                nanoseconds(m.jitter) * nanosecond,
            )
            for m in messages
        ),
        tuple(nanoseconds(m.deadline) * nanosecond for m in messages),
        convention,
    )


def meets_all(bus: Bus, errors: ErrorModel) -> bool:
    """Return whether every message meets its deadline.

    Parameters
    ----------
    bus : Bus
        All messages.
    errors : ErrorModel
        What goes wrong.

    Returns
    -------
    bool
        Whether no instance misses its deadline.

    Examples
    --------
    >>> from shipnet.can.schedule.convention import AS_USUAL
    >>> from shipnet.can.schedule.messages import Message
    >>> bus = on_bus(MessageSet([Message("A", 1, 7, 2.5e-3)]), 125_000, AS_USUAL)
    >>> meets_all(bus, NO_ERRORS), meets_all(bus, ErrorModel(2))
    (True, False)
    """
    places = range(len(bus.streams))
    return all(Level(bus, m, range(m), places[m + 1 :], errors).meets_deadline() for m in places)


class Level:
    r"""One message among those that it waits for.

    .. math:: t_m &= B_m + E(t_m)
              + \sum_{k \in hep(m)} \left\lceil \frac{t_m + J_k}{T_k} \right\rceil C_k \\
              w_m(q) &= B_m + E(w_m + C_m) + q C_m
              + \sum_{k \in hp(m)} \left\lceil \frac{w_m + J_k + \tau}{T_k} \right\rceil C_k \\
              R_m &= \max_q \left( J_m + w_m(q) - q T_m + C_m \right), \qquad
              q = 0 \ldots \left\lceil \frac{t_m + J_m}{T_m} \right\rceil - 1

    Parameters
    ----------
    bus : Bus
        All messages.
    message : int
        Place of the message in the tuples of `bus`.
    higher, lower : sequence of int
        Places of the messages of higher and of lower priority.
    errors : ErrorModel
        What goes wrong.
    own_blocking : bool, default False
        Whether the message's own frame may block it, as in the sufficient test.
    """

    def __init__(
        self,
        bus: Bus,
        message: int,
        higher: Sequence[int],
        lower: Sequence[int],
        errors: ErrorModel = NO_ERRORS,
        own_blocking: bool = False,
    ) -> None:
        streams, convention = bus.streams, bus.convention
        self.period, self.frame, self.jitter = streams[message]
        self.deadline = bus.deadline[message]
        foreign = convention.foreign_bits
        if convention.intermission == "nowhere":
            foreign = max(0, foreign - INTERMISSION)
        self.blocking = max([streams[k][1] for k in lower], default=0)
        self.blocking = max(self.blocking, foreign * bus.bit)
        if own_blocking:
            self.blocking = max(self.blocking, self.frame)

        self._reported = self.frame
        if convention.own_jitter:
            self._reported += self.jitter
        if convention.intermission == "between":
            self._reported -= INTERMISSION * bus.bit

        self._tau = convention.arbitration_bits * bus.bit
        self._higher = [streams[k] for k in higher]
        self._equal = [*self._higher, streams[message]]
        self._constant = self.blocking
        if errors.burst:
            # Errors are one more stream, of retransmissions.
            cost = errors.bits * bus.bit + max(frame for _, frame, _ in self._equal)
            endless = errors.interval == math.inf
            self._constant += (errors.burst - (not endless)) * cost
            if not endless:
                interval = nanoseconds(errors.interval) * bus.nanosecond
                self._equal.append((interval, cost, 0))
                # A delay is searched for with tau added, but errors count up to the frame's end.
                self._higher.append((interval, cost, self.frame - self._tau))
        # What is queued together with the message goes first, once at least, even without tau.
        self._least = self._constant + sum(frame for _, frame, _ in self._higher)

    def first_response(self) -> float:
        """Return the longest response of the first instance in a busy period, or infinity."""
        if not _ends(self._constant, self._higher, self._tau):
            return math.inf
        return self._response(0, self._delay(0, self._least))

    def responses(self) -> tuple[float, list[float]]:
        """Return the longest busy period, and the longest response of each instance in it."""
        busy = math.inf
        if _ends(self._constant, self._equal, 0):
            w = self._delay(0, self._least)
            busy = self._busy_period(w)
        if busy == math.inf:
            return busy, [math.inf]
        responses = [self._response(0, w)]
        for q in range(1, self._instances(busy)):
            w = self._delay(q, w + self.frame)
            responses.append(self._response(q, w))
        return busy, responses

    def meets_deadline(self) -> bool:
        """Return whether no instance misses its deadline; stop at the first that does."""
        if not _ends(self._constant, self._equal, 0):
            return False
        # Most misses show in the first instance, before the busy period is known.
        latest = self.deadline - self._reported
        w = self._delay(0, self._least, latest)
        if w > latest:
            return False
        busy = self._busy_period(w)
        if busy == math.inf:
            return False
        for q in range(1, self._instances(busy)):
            latest += self.period
            w = self._delay(q, w + self.frame, latest)
            if w > latest:
                return False
        return True

    def _busy_period(self, delay: float) -> float:
        """Return how long the bus may be busy with this priority or higher, or infinity."""
        # It lasts until the end of the first instance at least: tau is shorter than any frame.
        busy = _settle(self._constant, self._equal, delay + self.frame, 0, math.inf)
        return busy if busy <= _MOST_STEPS * self.period - self.jitter else math.inf

    def _instances(self, busy: float) -> int:
        return int(-(-(busy + self.jitter) // self.period))

    def _delay(self, q: int, start: float, limit: float = math.inf) -> float:
        """Return how long instance q may be delayed, from the begin of the busy period.

        The search begins at `start`, no longer than the delay, and may stop above `limit`.
        """
        return _settle(self._constant + q * self.frame, self._higher, start, self._tau, limit)

    def _response(self, q: int, delay: float) -> float:
        return delay + self._reported - q * self.period


def _ends(constant: int, streams: Sequence[_Stream], tau: int) -> bool:
    """Return whether t = constant + sum of ceil((t + tau + ahead) / period) * frame for some t."""
    load = sum([frame / period for period, frame, _ in streams])
    if abs(load - 1) > 1e-9:
        return load < 1
    hyperperiod = math.lcm(*(period for period, _, _ in streams))
    used = sum(hyperperiod // period * frame for period, frame, _ in streams)
    # At a load of 1 the bus catches up with nothing that it was once late by.
    return used < hyperperiod or (
        used == hyperperiod and constant == 0 and not any(tau + ahead for _, _, ahead in streams)
    )


def _settle(
    constant: int, streams: Sequence[_Stream], start: float, tau: int, limit: float
) -> float:
    """Return the least t >= start with t = constant + sum of ceil((t + tau + ahead) / T) * C.

    The result is whole, or infinite if it takes too many steps to find.
    """
    t = start
    for _ in range(_MOST_STEPS):
        later: float = constant
        # Ceilings, as the floors of negative numbers.
        early = -(t + tau)
        for period, frame, ahead in streams:
            later -= (early - ahead) // period * frame
        if later <= t or later > limit:
            return later
        t = later
    return math.inf
