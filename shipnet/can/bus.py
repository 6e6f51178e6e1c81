"""The loop of a simulated CAN bus: the most urgent waiting frame goes next.

Times are whole nanoseconds, at most 1e18; `simulate` checks its arguments, these functions do not.
Messages are numbered by priority, the most urgent first. Frame k is released at ``release[k]``; the
frames of message m are ``first[m]`` to ``first[m + 1] - 1``, in order. The last of them is released
at the horizon or later, and is never sent.

Examples
--------
Two messages with periods of 3 and 5 ms, whose frames last 1 ms, are released together:

>>> offset, period = np.array([0, 0]), np.array([3_000_000, 5_000_000])
>>> release, first = releases(offset, period, 10_000_000)
>>> send(release, first, np.array([1_000_000, 1_000_000]), 10_000_000)
array([      0, 3000000, 6000000, 9000000,      -1, 1000000, 5000000,
            -1])
"""

from __future__ import annotations

from typing import TypeAlias

import numpy as np

from shipnet.arrays import Floats, Integers
from shipnet.compiled import compiled

#: Error counts at which a node becomes error passive and bus off: Bosch, CAN specification 2.0,
#: part B, section 8.
PASSIVE, BUS_OFF = 128, 256

#: Number, start, end and disturbed bit of a destroyed frame; its sender's TEC and REC afterwards.
Failure: TypeAlias = tuple[int, int, int, int, int, int]


@compiled
def send(release: Integers, first: Integers, length: Integers, horizon: int) -> Integers:
    """Return when each frame starts [ns]; -1 if not before the horizon.

    When the bus is free, the most urgent waiting frame goes next, without interruption.
    """
    start = np.full(len(release), -1)
    head = first[:-1].copy()  # the next frame of each message
    due = release[head]
    now = 0
    while now < horizon:
        upcoming = horizon
        for m in range(len(length)):
            if due[m] <= now:
                start[head[m]] = now
                now += length[m]
                head[m] += 1
                due[m] = release[head[m]]
                break
            upcoming = min(upcoming, due[m])
        else:  # no frame is waiting
            now = upcoming
    return start


@compiled
def releases(offset: Integers, period: Integers, horizon: int) -> tuple[Integers, Integers]:
    """Return when each frame of periodic messages is released, and the first frame of each."""
    first = np.zeros(len(period) + 1, np.int64)
    for m in range(len(period)):
        first[m + 1] = first[m] + max(0, -((offset[m] - horizon) // period[m])) + 1
    release = np.empty(first[-1], np.int64)
    for m in range(len(period)):
        for k in range(first[m], first[m + 1]):
            release[k] = offset[m] + (k - first[m]) * period[m]
    return release, first


@compiled
def send_sets(
    offsets: Integers, period: Integers, length: Integers, horizon: int
) -> tuple[Integers, Floats, Integers]:
    """Return the longest and total response time [ns] and number of frames per set and message."""
    longest, sent = np.zeros(offsets.shape, np.int64), np.zeros(offsets.shape, np.int64)
    total = np.zeros(offsets.shape)
    for s in range(len(offsets)):
        release, first = releases(offsets[s], period, horizon)
        start = send(release, first, length, horizon)
        for m in range(len(period)):
            most, summed, k = 0, 0.0, first[m]
            while start[k] >= 0:
                response = start[k] + length[m] - release[k]
                most = max(most, response)
                summed += response
                k += 1
            longest[s, m], total[s, m], sent[s, m] = most, summed, k - first[m]
    return longest, total, sent


@compiled
def send_disturbed(
    release: Integers,
    first: Integers,
    length: Integers,
    horizon: int,
    owner: Integers,
    bit: int,
    passive: int,
    bus_off: int,
    instants: Integers,
    rate: Floats,
    span: Integers,
    rng: np.random.Generator,
) -> tuple[Integers, list[Failure], Integers, Integers]:
    """Return what `send` returns, the destroyed frames, and each node's error counters TEC and REC.

    Message m belongs to node ``owner[m]``; a node is error passive from the count `passive` and bus
    off from `bus_off`. Bits are disturbed at `instants`, of which the last is never reached, and
    with probability ``rate[f]`` each from ``span[f, 0]`` to ``span[f, 1]``. Source: Bosch, CAN
    specification 2.0, 1991, part B, sections 3.2.5 and 8.
    """
    intermission, error_frame, suspend, sequence = 3 * bit, 23 * bit, 8 * bit, 11 * bit
    start = np.full(len(release), -1)
    failures: list[Failure] = []
    head = first[:-1].copy()
    due = release[head]
    tec, rec, missing, ready = np.zeros((4, owner.max() + 1), np.int64)
    strike = np.full(len(rate), -1)  # next random error
    now = free = at = off = 0
    while True:
        if off:
            for node in range(len(tec)):
                if tec[node] >= bus_off and ready[node] <= now:
                    tec[node] = rec[node] = 0
                    off -= 1
        if now >= horizon:
            return start, failures, tec, rec
        upcoming = horizon
        for m in range(len(length)):
            if due[m] <= now:
                break
            upcoming = min(upcoming, due[m])
        else:
            now = upcoming
            continue
        while instants[at] < now:
            at += 1
        error = instants[at]
        for f in range(len(rate)):
            if strike[f] < now:  # earlier bits do not matter: the errors are independent
                gap = min(rng.geometric(rate[f]), horizon // bit + 1000)
                strike[f] = max(now, span[f, 0]) + (gap - 1) * bit
            if strike[f] < span[f, 1]:
                error = min(error, strike[f])
        begin, sender, broken = now, owner[m], (error - now) // bit
        good = error >= begin + length[m] - intermission
        now += length[m] if good else (broken + 1) * bit + error_frame
        for node in range(len(tec)):
            if node != sender and tec[node] < bus_off:
                if not good:
                    rec[node] += 1
                elif rec[node]:
                    rec[node] = min(rec[node], passive) - 1
        if off:  # idle time consists of sequences of 11 recessive bits; each frame ends with one
            for node in range(len(tec)):
                if tec[node] >= bus_off:
                    missing[node] -= (begin - free) // sequence + 1
                    ready[node] = now + missing[node] * sequence
        if good:
            tec[sender] = max(0, tec[sender] - 1)
            start[head[m]] = begin
            head[m] += 1
            due[m] = release[head[m]]
        else:
            tec[sender] += 8
            failures.append((head[m], begin, now, broken, tec[sender], rec[sender]))
        if tec[sender] >= bus_off:
            off += 1
            missing[sender], ready[sender] = 128, now + 128 * sequence
        elif max(tec[sender], rec[sender]) >= passive:
            ready[sender] = now + suspend
        if off or ready[sender] > now:
            for m in range(len(length)):
                due[m] = max(release[head[m]], ready[owner[m]])
        free = now
