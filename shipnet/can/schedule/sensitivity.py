"""How far a message set is from missing a deadline."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Sequence
from typing import Literal

from shipnet.can.schedule.convention import AS_USUAL, NO_ERRORS, Convention, ErrorModel
from shipnet.can.schedule.level import Bus, meets_all, on_bus
from shipnet.can.schedule.messages import MessageSet
from shipnet.can.schedule.response import schedulable
from shipnet.errors import ArgumentError
from shipnet.fields import check_whole

__all__ = ["lowest_bit_rate", "period_factor"]

#: Factors are whole numbers of millionths, up to this one.
_UNIT, _MOST = 10**6, 10**10


def lowest_bit_rate(
    messages: MessageSet,
    candidates: Collection[int] | None = None,
    *,
    convention: Convention = AS_USUAL,
    errors: ErrorModel = NO_ERRORS,
) -> float:
    """Return the lowest bit rate at which all deadlines are met.

    Parameters
    ----------
    messages : MessageSet
        The messages.
    candidates : collection of int, optional
        Bit rates to choose from, 1000..1000000 [bit/s], such as `BIT_RATES`; if not given, every
        whole number of bits a second.
    convention : Convention, optional
        How long frames are, and what counts as the response.
    errors : ErrorModel, optional
        How many errors hit the bus; none if not given.

    Returns
    -------
    float
        Bit rate [bit/s]; infinite if none is high enough.

    Raises
    ------
    ArgumentError
        If a candidate is out of range.

    Notes
    -----
    A faster bus shortens all frames and the arbitration, and so every response; a bisection finds
    the lowest rate.

    Examples
    --------
    >>> from shipnet.can.schedule.load import BIT_RATES
    >>> from shipnet.can.schedule.messages import Message
    >>> messages = MessageSet([Message("A", 1, 8, 1e-3), Message("B", 2, 8, 2e-3)])
    >>> lowest_bit_rate(messages), lowest_bit_rate(messages, BIT_RATES)
    (270000.0, 500000.0)
    """
    rates: Sequence[int] = range(1000, 1_000_001)
    if candidates is not None:
        rates = sorted(check_whole("candidate", rate, 1000, 10**6) for rate in candidates)

    def works(place: int) -> bool:
        return schedulable(messages, rates[place], convention=convention, errors=errors)

    place = _first(works, 0, len(rates))
    return float(rates[place]) if place < len(rates) else math.inf


def period_factor(
    messages: MessageSet,
    bit_rate: int,
    names: Collection[str] | None = None,
    *,
    deadlines: Literal["scaled", "kept"] = "scaled",
    convention: Convention = AS_USUAL,
    errors: ErrorModel = NO_ERRORS,
) -> float:
    """Return the smallest factor on periods with which all deadlines are met.

    Parameters
    ----------
    messages : MessageSet
        The messages.
    bit_rate : int
        Bit rate, 1000..1000000 [bit/s].
    names : collection of str, optional
        Messages whose periods are changed; all if not given.
    deadlines : {"scaled", "kept"}, default "scaled"
        Whether the deadlines of these messages shrink with their periods, or stay.
    convention : Convention, optional
        How long frames are, and what counts as the response.
    errors : ErrorModel, optional
        How many errors hit the bus; none if not given.

    Returns
    -------
    float
        Factor, in millionths, rounded up. Below 1 the periods may shrink so far; above 1 they
        have to grow so far; infinite if no factor up to 10000 helps.

    Raises
    ------
    ArgumentError
        If an argument is out of range, a name is unknown, or there is no name.

    Notes
    -----
    Jitter stays what it is. Shorter periods and deadlines never make a set schedulable, so a
    bisection finds the factor.

    Examples
    --------
    With all periods 0.54 times as long, A has just arrived, behind a B, when its next one is due;
    the period of B alone can go down to twice a frame:

    >>> from shipnet.can.schedule.messages import Message
    >>> messages = MessageSet([Message("A", 1, 8, 1e-3), Message("B", 2, 8, 2e-3)])
    >>> period_factor(messages, 500_000), period_factor(messages, 500_000, ["B"])
    (0.54, 0.27)
    """
    if deadlines not in ("scaled", "kept"):
        raise ArgumentError(f"deadlines is {deadlines!r}; it must be scaled or kept")
    chosen = set(messages.names if names is None else names)
    strange = sorted(chosen - set(messages.names))
    if strange or not chosen:
        raise ArgumentError(
            f"names are {sorted(chosen)}; they must be of {', '.join(messages.names)}, at least one"
        )
    bus = on_bus(messages, bit_rate, convention)
    moved = [message.name in chosen for message in messages]

    def works(millionths: int) -> bool:
        return meets_all(_scaled(bus, moved, millionths, deadlines == "scaled"), errors)

    found = _first(works, 1, _MOST + 1)
    return found / _UNIT if found <= _MOST else math.inf


def _scaled(bus: Bus, moved: list[bool], millionths: int, deadlines: bool) -> Bus:
    def scale(time: int, move: bool) -> int:
        # Rounded down: a period shorter by part of a tick is the safe side.
        return max(1, time * millionths // _UNIT) if move else time

    streams = tuple(
        (scale(period, move), frame, jitter)
        for (period, frame, jitter), move in zip(bus.streams, moved, strict=True)
    )
    deadline = tuple(
        scale(time, move and deadlines) for time, move in zip(bus.deadline, moved, strict=True)
    )
    return bus._replace(streams=streams, deadline=deadline)


def _first(works: Callable[[int], bool], low: int, high: int) -> int:
    """Return the first number low..high-1 that works, or high; whatever follows it works too."""
    while low < high:
        middle = (low + high) // 2
        if works(middle):
            high = middle
        else:
            low = middle + 1
    return low
