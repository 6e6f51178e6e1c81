"""Analytical bounds on the ages of values, on switch-overs and on the effects of a single fault.

`System` has these functions as methods.
"""

from __future__ import annotations

from math import inf
from typing import Any, NamedTuple

import numpy as np

from shipnet.arrays import Floats, Integers
from shipnet.clock import nanoseconds
from shipnet.engine.faults import (
    BusOff,
    CanBreak,
    DeadBox,
    DeadPort,
    EngineFault,
    LostCanFrames,
    LostModbusFrames,
    ModbusBreak,
    StuckSensor,
)
from shipnet.errors import ArgumentError
from shipnet.fields import check_kind
from shipnet.lazy import pd

#: An `engine.System`; that module imports this one.
System = Any


class SwitchOver(NamedTuple):
    """Times of a switch-over to the other channel [s].

    From the first unanswered request, `request` runs to the first request on the other channel and
    `answer` to the end of its response. `loss` is the longest time from the loss of the channel to
    the end of that response, `gap` the longest time between two responses.
    """

    request: float
    answer: float
    loss: float
    gap: float


class FailureBounds(NamedTuple):
    """The worst effects of a single failure, whatever the phases of the clocks [s].

    `answer` is the longest time from the first request of a poll to its response, `gap` the longest
    time between two responses, and `oldest` the greatest age shown as good, infinite if the age
    grows without limit.
    """

    answer: float
    gap: float
    oldest: float


class StalenessFlag(NamedTuple):
    """Longest time until a box's failure is noticed, and greatest age of its values by then [s]."""

    after: float
    oldest: float


def worst_age(system: System) -> pd.DataFrame:
    r"""Return the greatest age of each point at the AMS, just before its next value arrives.

    .. math:: A = \left( L - o \right) + P + S + R + h + T + t_{response}

    One row per point of a healthy system: ``tag``, ``box``, ``channel`` (over which the bound
    holds), the terms ``sampling_s`` (L - o: from sampling to the end of the box's round),
    ``update_s`` (P: to the end of the next round), ``interrupt_s`` (S: a Modbus request in that
    round), ``can_s`` (R: response time of the message), ``handling_s`` (h: the CAN interrupt),
    ``poll_s`` (T: to the next poll, if one just missed the value), ``transaction_s`` (from
    reading the registers to the end of the response), and their sum ``worst_s``.

    For the polled box's own values L is the conversion alone, and R, h and S are 0. If both
    channels are polled, the lower age counts. ArgumentError is raised if two polls can fall in
    one round of a loop, or the CAN bus is overloaded.
    """
    channels = system.ports if system.polled == "both" else system.ports[:1]
    return _ages(system, channels, system.suspended_ns, system.can_response)


def _ages(
    system: System, channels: tuple[int, ...], suspended: Integers, can_response: Floats
) -> pd.DataFrame:
    """Return each point's age over its best channel, for given delays of boxes and frames."""
    spacing = system.poll_spacing()
    longest = int(system.loop_ns.max()) + system.service_ns
    if longest > nanoseconds(spacing):
        raise ArgumentError(
            f"poll_period is {system.poll_period:g} s; a round of a loop takes "
            f"{longest / 1e9:g} s, so two polls can fall in one round"
        )
    response = can_response[system.message_of]
    box, offset = system.box_of, system.offset_ns
    converted, looped = system.convert_ns[box], system.loop_ns[box]
    receive = system.firmware.receive
    spread = int(system.frame_ns.min()) >= nanoseconds(receive)
    handling = receive if spread else receive * system.sender.size
    tables = []
    for channel, reader in enumerate(channels, start=1):
        of_reader = box == reader
        terms = {
            "sampling_s": (np.where(of_reader, converted, looped) - offset) / 1e9,
            "update_s": system.period_ns[box] / 1e9,
            "interrupt_s": np.where(of_reader, 0, suspended[box]) / 1e9,
            "can_s": np.where(of_reader, 0.0, response),
            "handling_s": np.where(of_reader, 0.0, handling),
            "poll_s": spacing,
            # The silence after the request stands for the equal one after the response.
            "transaction_s": system.poll.shortest_timeout,
        }
        names = [(point.tag, point.box, channel) for point in system.points]
        table = pd.DataFrame(names, columns=["tag", "box", "channel"]).assign(**terms)
        table["worst_s"] = table[list(terms)].sum(axis=1)
        tables.append(table)
    first, last = tables[0], tables[-1]
    better = (first["worst_s"] <= last["worst_s"]).to_numpy()
    return pd.concat([first[better], last[~better]]).sort_index()


def staleness_flag(system: System) -> StalenessFlag:
    r"""Return the longest time that a silent box goes unnoticed, if nothing else fails.

    .. math:: t_{after} = t_{stale} + t_{mark} + h + T + t_{response}

    with the time T from poll to poll. If the silent box is the polled one, the AMS first gets
    no response for :math:`t_{lost}`, retries included; :math:`T_{lost}` is the time from poll
    to poll including that time:

    .. math:: t_{after} \ge T + T_{lost} + t_{request} + t_{response}

    In the printed design any frame of a box restarts the timer that monitors it, so if a box
    dies within a round, values of the previous round stay valid. In the corrected design the
    AMS marks values by age.
    """
    if system.coding == "corrected":
        return StalenessFlag(system.age_limit, system.age_limit)
    transaction = float(worst_age(system)["transaction_s"].iloc[0])
    request = system.serial.frame_time(8)
    lost = max(_in_vain(system, 1 + system.retries, 1))
    healthy, hindered = system.poll_spacing(), system.poll_spacing(lost)
    pile = system.service_ns / 1e9 + system.firmware.receive * system.sender.size
    marked = system.stale_limit + system.firmware.mark + pile
    read = request + system.serial.t35
    after = healthy + max(marked, hindered + read) + transaction
    box = system.box_of
    served = system.service_ns * np.isin(box, system.ports)
    old = system.loop_ns[box] - system.offset_ns + system.period_ns[box] + served
    queued = system.can_response[system.message_of]
    return StalenessFlag(after, after + float((old / 1e9 + queued).max()))


def switch_over(system: System) -> SwitchOver:
    """Return the delays caused by a lost channel, if the AMS polls one channel at a time.

    The paper measures 133 "us" from the loss of channel 1 to the request on channel 2. Read as
    milliseconds, this time consists of a request of 9.17 ms and a time-out of 123.8 ms. A
    response with all 99 points takes 232.6 ms, so such a time-out can only wait for the first
    character.
    """
    if system.polled == "both":
        raise ArgumentError("polled is 'both'; it must be 'one' for a switch-over")
    request = system.poll.line.frame_time(8)
    lost = (1 + system.retries) * (request + system.timeout)
    broken = max(_in_vain(system, 1 + system.retries, 1))
    answer = lost + system.poll.time
    # The channel is lost just after the last bit of a response, or just after the first bit.
    first = request + system.shortest_timeout
    loss = max(system.poll_spacing() + lost + system.serial.t35, broken + system.poll.time - first)
    return SwitchOver(lost, answer, loss, max(_gaps(system, 1)))


def _in_vain(system: System, tries: int, broken: int) -> list[float]:
    """Return the possible total durations of `tries` failed tries on one channel [s].

    Up to `broken` of them end with a broken or damaged response, which the AMS notices when the
    whole response is due; the other tries get no response.
    """
    silent = system.poll.line.frame_time(8) + system.timeout
    damaged = range(min(tries, broken) + 1)
    return [n * system.poll.time + (tries - n) * silent for n in damaged]


def _gaps(system: System, broken: int) -> tuple[float, float]:
    """Return the longest times between responses: when channel 1 fails, and afterwards [s].

    Up to `broken` tries per poll end with a broken response.
    """
    tries = 1 + system.retries
    full = _in_vain(system, tries, broken)
    late = [0.0]
    if broken > 1:
        # A retry may be answered, and the next poll may fail again.
        late = [time for n in range(tries) for time in _in_vain(system, n, broken)]
    before = max(system.poll_spacing(time) - time for time in late) + max(full)
    after = max(system.poll_spacing(time) - time for time in full)
    return before, max(after, system.poll_spacing())


def _oldest_read(system: System, broken: int) -> float:
    """Return the greatest age shown as good when channel 1 fails, or afterwards [s]."""
    before, after = _gaps(system, broken)
    healthy, ports = system.suspended_ns, np.isin(np.arange(len(system.boxes)), system.ports)
    # If a round of a loop takes longer than a poll, several requests can fall in one round.
    crowded = int(system.loop_ns.max()) + system.service_ns > nanoseconds(system.poll.time)
    times = 2 + system.retries if crowded else 1
    both = times * system.service_ns * ports.astype(np.int64)
    oldest = []
    cases = zip(system.ports, (times * healthy, both), (before, after), strict=True)
    for reader, suspended, gap in cases:
        response = system._can_response_with(suspended)
        ages = _ages(system, (reader,), suspended, response)
        oldest.append(float((ages["worst_s"] - ages["poll_s"]).max()) + gap)
    return max(oldest)


def failure_bounds(system: System, fault: EngineFault | None = None) -> FailureBounds:
    r"""Return the worst response times and ages, in any phase, with one fault or with none.

    If the channel in use fails, the AMS gets no response for :math:`t_{lost}`: it notices a
    broken response when the response should have ended, and the failure of each of r retries
    after its time-out.

    .. math:: t_{lost} = \max(t_{poll}, t_{silent}) + r \, t_{silent}

    .. math:: t_{gap} = T + t_{lost}, \qquad A' = A - T + t_{gap}

    where :math:`t_{silent}` is the time of a request and its time-out, T the time from poll to
    poll, and A the age from `worst_age`. If frames are damaged at random, each try may take
    :math:`t_{poll}`. When a failure on CAN begins, and again when it ends, the frames of one
    round are lost; A grows by one update period each time. A silent box has the bound of
    `staleness_flag`. In the printed design, lasting random losses on CAN leave A without a
    bound: any frame keeps all values of its box valid.
    """
    answer, gap = system.poll.time, system.poll_spacing()
    healthy = oldest = float(worst_age(system)["worst_s"].max())
    corrected = system.coding == "corrected"
    if corrected:
        healthy = min(healthy, system.age_limit)
    if fault is None:
        return FailureBounds(answer, gap, healthy)
    check_kind("fault", fault, EngineFault)
    system.check_faults(fault)
    lasts, period = fault.stop - fault.start, int(system.period_ns.max()) / 1e9
    in_use = system.boxes[0] if isinstance(fault, DeadBox) else "1"
    on_line = isinstance(fault, DeadBox | DeadPort | ModbusBreak | LostModbusFrames)
    if on_line and fault.where == in_use and system.polled == "one":
        broken = 1 + system.retries if isinstance(fault, LostModbusFrames) else 1
        answer += max(_in_vain(system, 1 + system.retries, broken))
        gap, oldest = max(_gaps(system, broken)), _oldest_read(system, broken)
    if isinstance(fault, StuckSensor):
        oldest = lasts + healthy
    elif corrected:
        oldest = system.age_limit
    elif isinstance(fault, LostCanFrames):
        # The polled box needs no CAN for its own values.
        oldest = healthy if fault.where == system.boxes[0] else lasts + period + healthy
    elif isinstance(fault, BusOff | CanBreak | DeadBox):
        # When a fault begins, and again when it ends, the frames of one round are lost.
        oldest += period * (1 if lasts == inf else 2)
        if not (isinstance(fault, CanBreak) and len(system.segments) == len(system.boxes)):
            oldest = max(oldest, staleness_flag(system).oldest)
    return FailureBounds(answer, gap, oldest)
