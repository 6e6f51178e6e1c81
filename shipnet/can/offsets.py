"""Response times if each sender's messages share a clock, and offsets that shorten these times.

Times are whole ticks. Each instance of a message is examined on the message's own clock. The phases
between clocks are unknown, so all other clocks are assumed to be at their worst phases.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from shipnet.arrays import Integers
from shipnet.can.messages import MessageSet
from shipnet.clock import nanoseconds
from shipnet.errors import ArgumentError
from shipnet.fields import check_scalar

#: Largest number of releases of a clock in a hyperperiod; further messages of its sender start a
#: new clock, which is safe because it allows more phases.
MOST_RELEASES = 20_000
_MOST_EVENTS = 1_000_000  #: Largest number of releases in a hyperperiod and the margins around it.
_HIGHEST_LOAD = 0.99  #: Lowest load at which busy periods are too long to examine.


class Streams(NamedTuple):
    """Messages as columns in priority order, with times in ticks; `clock` has the clock numbers."""

    period: Integers
    frame: Integers
    jitter: Integers
    offset: Integers
    clock: Integers
    #: Longest time after the bus becomes free within which a higher-priority message can still win.
    tau: int


def clocks(senders: list[str], periods: list[int]) -> Integers:
    """Return the clock number of each message: its sender's, or its own if it has no sender."""
    numbers: list[int] = []
    newest: dict[str, tuple[int, list[int]]] = {}
    for index, (sender, period) in enumerate(zip(senders, periods, strict=True)):
        number, members = newest.get(sender, (index, []))
        whole = math.lcm(period, *members)
        if not sender or sum(whole // each for each in (period, *members)) > MOST_RELEASES:
            number, members = index, []
        newest[sender] = number, [*members, period]
        numbers.append(number)
    return np.array(numbers, dtype=np.int64)


def longest_responses(streams: Streams) -> list[int] | None:
    """Return the longest response time of each message in ticks; None if the load is too high."""
    load = float((streams.frame / streams.period).sum())
    if load >= _HIGHEST_LOAD:
        return None
    jitter = streams.frame * (1 + streams.jitter / streams.period)
    # `most` exceeds all busy periods, but they are usually far shorter, so the span starts small.
    most = 2 * (int((streams.frame.max(initial=0) + jitter.sum()) / (1 - load)) + 2) + streams.tau
    span = int(4 * streams.frame.sum()) + 1
    while (longest := _within(streams, min(span, most))) is None:
        span *= 2
    return longest


class _Clock:
    """Releases of one clock's messages, from `span` before 0 to `span` after a hyperperiod."""

    def __init__(self, streams: Streams, members: list[int], span: int, reach: int = 0) -> None:
        period, frame, jitter, offset = (column[members] for column in streams[:4])
        self.hyperperiod = max(math.lcm(*period.tolist()), reach)
        edge = int(span + jitter.max()) + 1
        window = self.hyperperiod + 2 * edge
        if window > 2**53 or (window // period).sum() > _MOST_EVENTS:
            raise OverflowError
        first = -((offset + edge) // period)
        count = (self.hyperperiod + edge - offset) // period - first + 1
        which = np.repeat(np.arange(len(members)), count)
        number = np.arange(len(which)) - np.repeat(np.cumsum(count) - count, count)
        event = offset[which] + (number + first[which]) * period[which]
        early, late = (
            np.argsort(event, kind="stable"),
            np.argsort(event + jitter[which], kind="stable"),
        )
        #: Times of the events in order, their messages and the work before each; `latest` has the
        #: latest times of release, in order.
        self.event = event[early]
        self.message = np.asarray(members)[which[early]]
        self.work = np.r_[0, np.cumsum(frame[which[early]])]
        self.latest = (event + jitter[which])[late]
        self._gone = np.r_[0, np.cumsum(frame[which[late]])]

    def before(self, time: Integers) -> Integers:
        """Return the work that is released before each time, even at the largest jitter."""
        gone: Integers = self._gone[np.searchsorted(self.latest, time)]
        return gone

    def curve(self, span: int) -> tuple[Integers, Integers]:
        """Return the lengths at which the largest work in a closed window grows, and the growth."""
        begin = np.unique(self.latest[(self.latest >= 0) & (self.latest < self.hyperperiod)])
        first = np.searchsorted(self.event, begin, side="right") - 1
        count = np.searchsorted(self.event, begin + span, side="right") - first
        row = np.repeat(np.arange(len(begin)), count)
        index = np.arange(len(row)) - np.repeat(np.cumsum(count) - count, count) + first[row]
        length = np.maximum(self.event[index] - begin[row], 0)
        work = self.work[index + 1] - self.before(begin)[row]
        order = np.lexsort((work, length))
        length, work = length[order], np.maximum.accumulate(work[order])
        grows = np.diff(work, prepend=0) > 0
        return length[grows], np.diff(work[grows], prepend=0)


def _staircase(curves: list[tuple[Integers, Integers]]) -> tuple[Integers, Integers]:
    """Return the lengths at which a sum of curves grows, and its values: below each, then total."""
    if not curves:
        return np.zeros(0, dtype=np.int64), np.zeros(1, dtype=np.int64)
    length, step = (np.concatenate(column) for column in zip(*curves, strict=True))
    order = np.argsort(length, kind="stable")
    return length[order], np.r_[0, np.cumsum(step[order])]


def _within(streams: Streams, span: int) -> list[int] | None:
    """Return the longest response times, or None if a busy period is longer than the span."""
    curves: dict[int, tuple[Integers, Integers]] = {}
    members: dict[int, list[int]] = {}
    longest = []
    for m, clock in enumerate(streams.clock.tolist()):
        frame, jitter = int(streams.frame[m]), int(streams.jitter[m])
        higher = members.get(clock, [])
        blocking = int(streams.frame[m + 1 :].max(initial=0))
        releases = _Clock(streams, [*higher, m], span)
        # `above`, without this message, must cover the hyperperiod with it.
        above = _Clock(streams, higher, span + jitter, releases.hyperperiod) if higher else None
        others = [curve for number, curve in curves.items() if number != clock]
        curves[clock] = releases.curve(span)

        # The longest busy period, with all clocks, even the message's own, at their worst phase.
        length, work = _staircase([curves[clock], *others])
        ends = np.flatnonzero(blocking + work <= np.r_[np.where(length > 0, length, -1), span + 1])
        if not ends.size:
            return None
        busy = int(blocking + work[ends[0]])

        # Pairs of an instance and a possible start (a latest release) of its busy period.
        events = releases.event[releases.message == m]
        instance = events[(events >= 0) & (events < releases.hyperperiod)]
        begins = np.unique(releases.latest)
        low = np.searchsorted(begins, instance - busy, side="right")
        count = np.searchsorted(begins, instance + jitter, side="right") - low
        begin = begins[np.arange(count.sum()) - np.repeat(np.cumsum(count) - count - low, count)]
        instance = np.repeat(instance, count)
        earlier = np.searchsorted(events, instance) - np.searchsorted(events, begin - jitter)
        constant = blocking + earlier * frame
        if above is not None:
            constant = constant - above.before(begin)

        # The delay of each pair: the least fixed point, approached from below.
        length, work = _staircase(others)
        delay, later = np.full(len(instance), -1), np.zeros(len(instance), dtype=np.int64)
        while (later > delay).any():
            delay = np.maximum(later, delay)
            until = delay + streams.tau
            later = constant + work[np.searchsorted(length, until)]
            if above is not None:
                later = later + above.work[np.searchsorted(above.event, begin + until)]
            if later.max() + streams.tau > span:
                return None
        # A pair whose delay ends before the instance does not count: the bus is idle in between.
        pending = delay >= instance - begin
        longest.append(int((delay + frame - (instance - begin))[pending].max()))
        members[clock] = [*higher, m]
    return longest


def spread_offsets(messages: MessageSet, step: float = 1e-3) -> MessageSet:
    """Return the messages with offsets that spread the messages of each sender over time.

    Parameters
    ----------
    messages : MessageSet
        The messages. A message without a sender keeps its offset.
    step : float, default 1e-3
        Resolution of the offsets, 1e-6..1 [s], such as the cycle time of the senders' task. The
        period of each message with a sender must be a multiple of `step`.

    Returns
    -------
    MessageSet
        The same messages; those with a sender have new offsets, from 0 to less than the period.

    Raises
    ------
    ArgumentError
        If a period is not a multiple of `step`, or a sender's hyperperiod exceeds 1000000 steps.

    Notes
    -----
    The method is a heuristic: the messages of each sender are taken in order of period, shortest
    first, and each gets the offset around which the sender is least busy. `response_times` with
    ``offsets=True`` shows the gain, which is largest for senders with many messages.

    Examples
    --------
    >>> from shipnet import can
    >>> messages = can.MessageSet(
    ...     can.Message(f"m{k}", k, 8, 0.01, sender="engine") for k in range(4)
    ... )
    >>> apart = can.spread_offsets(messages)
    >>> [message.offset for message in apart]
    [0.005, 0.0, 0.007, 0.002]
    >>> can.response_times(messages, 125e3)["m3"].response
    0.00432
    >>> can.response_times(apart, 125e3, offsets=True)["m3"].response
    0.00108
    """
    grain = nanoseconds(check_scalar("step", step, "s", 1e-6, 1))
    periods = messages.times[0]
    length = messages.lengths()
    offsets = [message.offset for message in messages]
    senders = [message.sender for message in messages]
    for sender in sorted({*senders} - {""}):
        members = [index for index, name in enumerate(senders) if name == sender]
        uneven = [messages[index].name for index in members if periods[index] % grain]
        if uneven:
            raise ArgumentError(
                f"step is {step:g} s; the period of {uneven[0]!r} is not a multiple of the step"
            )
        slots = math.lcm(*(int(periods[index]) // grain for index in members))
        if slots > 10**6:
            raise ArgumentError(
                f"step is {step:g} s, but {sender!r} repeats after {slots} steps (limit 1000000)"
            )
        # Load around each slot: the frames in it and, with decreasing weight, in the slots near it.
        far = np.minimum(np.arange(slots), slots - np.arange(slots))
        near, load = np.fft.rfft(1 / (1 + far)), np.zeros(slots)
        for index in sorted(members, key=lambda k: (periods[k], -length[k])):
            every = int(periods[index]) // grain
            crowd = np.fft.irfft(np.fft.rfft(load) * near, slots).reshape(-1, every).sum(axis=0)
            least = np.flatnonzero(crowd <= crowd.min() + 1e-9 * load.sum())
            slot = int(least[len(least) // 2])
            load[slot::every] += length[index]
            offsets[index] = slot * grain / 1e9
    return MessageSet(
        replace(message, offset=offset) for message, offset in zip(messages, offsets, strict=True)
    )
