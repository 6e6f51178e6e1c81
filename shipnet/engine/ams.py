"""What the AMS asks, on which channel and when: polls, time-outs, retries, switch-over."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from shipnet.clock import nanoseconds
from shipnet.engine.faults import (
    CutModbus,
    DeadBox,
    DeadPort,
    Fault,
    LostModbus,
    outages,
)
from shipnet.engine.system import LONGEST, System
from shipnet.errors import ArgumentError
from shipnet.fields import check_scalar, check_whole

__all__ = ["OUTCOMES", "Attempts", "SwitchOver", "ask", "switch_over", "timeout_for"]

Integers = npt.NDArray[np.int64]

#: What became of a request.
OUTCOMES = ("answered", "no answer", "response damaged")


class Attempts(NamedTuple):
    """Requests of the AMS in order of time.

    Attributes
    ----------
    poll : ndarray of int64, shape (n_attempts,)
        Number of the poll.
    channel : ndarray of int64, shape (n_attempts,)
        0 for channel 1, 1 for channel 2.
    start : ndarray of int64, shape (n_attempts,)
        First bit of the request [ns].
    outcome : ndarray of int64, shape (n_attempts,)
        Place in `OUTCOMES`.
    """

    poll: Integers
    channel: Integers
    start: Integers
    outcome: Integers


def ask(
    system: System,
    horizon: int,
    phase: int,
    faults: Sequence[Fault],
    rng: np.random.Generator | None,
) -> Attempts:
    """Return all requests up to a time.

    Parameters
    ----------
    system : System
        The system.
    horizon : int
        No poll begins at this time or later [ns].
    phase : int
        When the first poll begins [ns].
    faults : sequence of Fault
        What goes wrong.
    rng : numpy.random.Generator or None
        Draws what is lost.

    Returns
    -------
    Attempts
        The requests; both channels together, in order of time.

    Notes
    -----
    A poll begins at a multiple of the poll period, at the first that finds the one before ended.
    What is cut or dead at any moment between the first bit of the request and the end of the
    response makes the box deaf to the request.

    Examples
    --------
    Channel 1 is cut: the AMS waits 133 ms, asks on channel 2, and stays there.

    >>> found = ask(System(), 2 * 10**9, 0, [CutModbus("1")], None)
    >>> found.channel.tolist(), (found.start / 1e6).round(2).tolist(), found.outcome.tolist()
    ([0, 1, 1], [0.0, 132.97, 1000.0], [1, 0, 0])
    """
    lines = [_Line(system, channel, faults, horizon, rng) for channel in (0, 1)]
    if system.polled == "one":
        rows = _follow(system, horizon, phase, lines)
    else:
        rows = [row for line in lines for row in _follow(system, horizon, phase, [line])]
        rows.sort(key=lambda row: (row[2], row[1]))
    columns = np.array(rows, dtype=np.int64).reshape(-1, 4).T
    return Attempts(*columns)


class _Line:
    """A channel with what goes wrong on it."""

    def __init__(
        self,
        system: System,
        channel: int,
        faults: Sequence[Fault],
        horizon: int,
        rng: np.random.Generator | None,
    ) -> None:
        self.channel = channel
        name, box = str(channel + 1), system.boxes[system.ports[channel]]
        self.deaf = outages(faults, name, CutModbus, DeadPort) + outages(faults, box, DeadBox)
        self.losses = [f for f in faults if isinstance(f, LostModbus) and f.where == name]
        self.answered = nanoseconds(system.poll.time)
        self.silent = nanoseconds(system.poll.line.frame_time(8) + system.timeout)
        self.draws: Iterator[list[float]] = iter(())
        if self.losses and rng is not None:
            most = (horizon // nanoseconds(system.poll_period) + 2) * (1 + system.retries)
            self.draws = iter(rng.random((most, 2 * len(self.losses))).tolist())

    def ask(self, start: int) -> tuple[int, int]:
        """Send a request; return its outcome and when the AMS goes on."""
        end = start + self.answered
        deaf = any(begin < end and start < stop for begin, stop in self.deaf)
        damaged = False
        if self.losses:
            chances: list[float] = next(self.draws)
            for fault, request, response in zip(
                self.losses, chances[::2], chances[1::2], strict=True
            ):
                begin, stop = fault.span
                if begin <= start < stop:
                    deaf |= request < fault.request
                    damaged |= response < fault.response
        if deaf:
            return 1, start + self.silent
        return (2 if damaged else 0), end


def _follow(
    system: System, horizon: int, phase: int, lines: list[_Line]
) -> list[tuple[int, int, int, int]]:
    """Return the requests of a port that has one line, or two to choose from."""
    period = nanoseconds(system.poll_period)
    rows = []
    number, now, order = 0, phase, lines
    while now < horizon:
        for line in order:
            for _ in range(1 + system.retries):
                outcome, then = line.ask(now)
                rows.append((number, line.channel, now, outcome))
                now = then
                if outcome == 0:
                    break
            if outcome == 0:
                # Whoever answered is asked first next time; the other one is the spare.
                if system.switch_rule == "stay" and line is not order[0]:
                    order = order[::-1]
                break
        number = max(number + 1, -((phase - now) // period))
        now = phase + number * period
    return rows


class SwitchOver(NamedTuple):
    """What it takes to go over to the other channel.

    Attributes
    ----------
    request : float
        From the request that stays unanswered to the first one on the other channel [s].
    answer : float
        From the same instant to the whole answer on the other channel [s].
    loss : float
        From the loss of the channel to the whole answer, if it is lost just when an answer is
        through [s].
    """

    request: float
    answer: float
    loss: float


def switch_over(system: System) -> SwitchOver:
    """Return what a lost channel costs in time.

    Parameters
    ----------
    system : System
        The system; both its time-out and its retries are assumed.

    Returns
    -------
    SwitchOver
        Three times [s].

    Raises
    ------
    ArgumentError
        If `polled` is both: then nothing is switched over.

    Notes
    -----
    The paper measures 133 "us" from the loss of channel 1 to the request on channel 2, about one
    bit time; read as milliseconds, it is one request of 9.17 ms and a time-out of 123.8 ms, or
    with one retry a time-out of 57.3 ms. A response with all 99 points takes 232.6 ms, so such a
    time-out can only wait for the first character.

    Examples
    --------
    >>> tuple(round(time * 1e3, 1) for time in switch_over(System()))
    (133.0, 387.8, 1133.0)
    >>> round(timeout_for(System(), 0.133, retries=1) * 1e3, 1)
    57.3
    """
    if system.polled == "both":
        raise ArgumentError("polled is 'both'; only a system that polls one channel switches over")
    request = system.poll.line.frame_time(8)
    lost = (1 + system.retries) * (request + system.timeout)
    answer = lost + system.poll.time
    return SwitchOver(lost, answer, system.poll_period - system.poll.time + answer)


def timeout_for(system: System, time: float, *, retries: int = 0) -> float:
    """Return the time-out with which a switch-over takes a given time.

    Parameters
    ----------
    system : System
        The system, for its serial line.
    time : float
        From the request that stays unanswered to the request on the other channel [s]. Each time
        the AMS asks takes the request, and a time-out that a `System` takes: the silence behind it
        and the work of the box at least, and 100 s at most.
    retries : int, default 0
        How many more times the AMS asks, 0..10.

    Returns
    -------
    float
        From the end of a request to the first character of its response [s].

    Raises
    ------
    ArgumentError
        If the time is too short or too long for as many requests.

    Examples
    --------
    >>> round(timeout_for(System(), 0.133) * 1e3, 2)
    123.83
    """
    request = system.serial.frame_time(8)
    tries = 1 + check_whole("retries", retries, 0, 10)
    shortest = system.serial.t35 + system.firmware.processing
    low, high = (tries * (request + timeout) for timeout in (shortest, LONGEST))
    check_scalar("time", time, "s", low, high)
    # At both ends a rounding must not make a time-out that is out of range.
    return min(max(time / tries - request, shortest), LONGEST)
