"""Which message should have which priority, and how slow the bus may be."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Sequence
from typing import NamedTuple

from shipnet.can.faults import ErrorBound, bound
from shipnet.can.frame import check_bit_rate
from shipnet.can.messages import BIT_RATES, MessageSet
from shipnet.can.response import AS_USUAL, Assumptions, Level, on_bus, schedulable


class Assignment(NamedTuple):
    """An order of priority, and whether it works.

    Attributes
    ----------
    messages : MessageSet
        The messages, with identifiers that give the order.
    feasible : bool
        Whether all deadlines are met.
    unplaced : tuple of str
        Names of those messages none of which can have the lowest priority among them; empty if
        the order is feasible.

    Examples
    --------
    >>> from shipnet.can import Message
    >>> audsley(MessageSet([Message("A", 1, 8, 1e-3), Message("B", 2, 8, 2e-3)]), 250e3)
    Assignment(messages=MessageSet(2 messages: A, B), feasible=False, unplaced=('A',))
    """

    messages: MessageSet
    feasible: bool
    unplaced: tuple[str, ...]


def audsley(
    messages: MessageSet,
    bit_rate: float,
    *,
    assumptions: Assumptions | None = None,
    faults: ErrorBound | Iterable[ErrorBound] = (),
) -> Assignment:
    """Find an order of priority in which all deadlines are met, if there is one.

    Parameters
    ----------
    messages : MessageSet
        The messages; their own order does not matter.
    bit_rate : float
        Bit rate, 1000..1000000 [bit/s], a whole number.
    assumptions : Assumptions, optional
        How long frames are, and what counts as the response.
    faults : ErrorBound, optional
        How many errors hit the bus; none if not given.

    Returns
    -------
    Assignment
        The order found. If none is feasible, no order of these messages is: the messages of
        `unplaced` then come first, by their deadlines.

    Raises
    ------
    ArgumentError
        If the bit rate is not legal.

    Notes
    -----
    From the lowest priority up, each level goes to a message that meets its deadline there, tried
    from the longest deadline down. That is optimal, since the response of a message depends on
    which messages are above it and which are below it, but not on their order [1]_. Of 20
    messages it takes 210 tests at most, instead of 20! orders.

    References
    ----------
    .. [1] N. C. Audsley, "Optimal priority assignment and feasibility of static priority tasks
       with arbitrary start times", report YCS 164, University of York, 1991; for CAN:
       R. I. Davis et al., Real-Time Systems 35, 2007.

    Examples
    --------
    The order of deadlines Z, X, Y lets Y miss its deadline of 3 ms; the order Z, Y, X works:

    >>> from shipnet.can import Message, response_times
    >>> messages = MessageSet(
    ...     [
    ...         Message("X", 1, 7, period=2.75e-3),
    ...         Message("Y", 2, 1, period=3e-3),
    ...         Message("Z", 3, 7, period=2.25e-3, deadline=2e-3),
    ...     ]
    ... )
    >>> by_deadline = messages.deadline_monotonic()
    >>> [f"{r.message.name} {r.response}" for r in response_times(by_deadline, 125e3)]
    ['Z 0.002', 'X 0.00252', 'Y 0.00404']
    >>> found = audsley(messages, 125e3)
    >>> found.feasible
    True
    >>> [f"{r.message.name} {r.response}" for r in response_times(found.messages, 125e3)]
    ['Z 0.002', 'Y 0.00252', 'X 0.00252']
    """
    errors = bound(faults)
    bus = on_bus(messages, bit_rate, assumptions or AS_USUAL)
    left = sorted(range(len(messages)), key=lambda m: bus.deadline[m])
    placed: list[int] = []
    while left:
        for m in reversed(left):
            higher = [k for k in left if k != m]
            if Level(bus, m, higher, placed, errors).meets_deadline():
                break
        else:
            break
        left.remove(m)
        placed.append(m)
    order = [messages[m].name for m in (*left, *reversed(placed))]
    return Assignment(messages.ordered(order), not left, tuple(messages[m].name for m in left))


def lowest_bit_rate(
    messages: MessageSet,
    candidates: Collection[float] = BIT_RATES,
    *,
    assumptions: Assumptions | None = None,
    faults: ErrorBound | Iterable[ErrorBound] = (),
) -> float:
    """Return the lowest bit rate at which all deadlines are met.

    Parameters
    ----------
    messages : MessageSet
        The messages.
    candidates : collection of float, default `BIT_RATES`
        Bit rates to choose from, 1000..1000000 [bit/s]: ``range(1000, 1_000_001)`` for any.
    assumptions : Assumptions, optional
        How long frames are, and what counts as the response.
    faults : ErrorBound, optional
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
    >>> from shipnet.can import Message
    >>> messages = MessageSet([Message("A", 1, 8, 1e-3), Message("B", 2, 8, 2e-3)])
    >>> lowest_bit_rate(messages), lowest_bit_rate(messages, range(1000, 1_000_001))
    (500000.0, 270000.0)
    """
    errors = bound(faults)
    rates: Sequence[float] = candidates if isinstance(candidates, range) else sorted(candidates)
    for rate in (rates[0], rates[-1]) if len(rates) else ():
        check_bit_rate(rate)

    def works(place: int) -> bool:
        return schedulable(messages, rates[place], assumptions or AS_USUAL, errors)

    place = _first(works, 0, len(rates))
    return float(rates[place]) if place < len(rates) else math.inf


def _first(works: Callable[[int], bool], low: int, high: int) -> int:
    """Return the first number low..high-1 that works, or high; whatever follows it works too."""
    while low < high:
        middle = (low + high) // 2
        if works(middle):
            high = middle
        else:
            low = middle + 1
    return low
