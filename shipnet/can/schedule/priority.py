"""Which message should have which priority."""

from __future__ import annotations

from typing import NamedTuple

from shipnet.can.schedule.convention import AS_USUAL, NO_ERRORS, Convention, ErrorModel
from shipnet.can.schedule.level import Level, on_bus
from shipnet.can.schedule.messages import MessageSet, check_set

__all__ = ["Assignment", "audsley", "deadline_monotonic", "rate_monotonic"]


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
    """

    messages: MessageSet
    feasible: bool
    unplaced: tuple[str, ...]


def rate_monotonic(messages: MessageSet) -> MessageSet:
    """Return the messages in the order of their periods, the shortest first.

    Parameters
    ----------
    messages : MessageSet
        The messages; those with the same period keep their order.

    Returns
    -------
    MessageSet
        The messages, with identifiers that give the order.

    Examples
    --------
    >>> from shipnet.can.schedule.messages import Message
    >>> messages = MessageSet([Message("slow", 1, 8, 0.5), Message("fast", 2, 8, 0.1)])
    >>> rate_monotonic(messages).names
    ('fast', 'slow')
    """
    check_set(messages)
    order = sorted(messages, key=lambda message: message.period)
    return messages.ordered(message.name for message in order)


def deadline_monotonic(messages: MessageSet, *, less_jitter: bool = False) -> MessageSet:
    """Return the messages in the order of their deadlines, the shortest first.

    Parameters
    ----------
    messages : MessageSet
        The messages; those with the same deadline keep their order.
    less_jitter : bool, default False
        Whether to order by deadline less jitter, the time that is left on the bus.

    Returns
    -------
    MessageSet
        The messages, with identifiers that give the order.

    Examples
    --------
    >>> from shipnet.can.schedule.messages import Message
    >>> messages = MessageSet(
    ...     [Message("a", 1, 8, 0.5, jitter=0.2), Message("b", 2, 8, 1.0, deadline=0.4)]
    ... )
    >>> deadline_monotonic(messages).names
    ('b', 'a')
    >>> deadline_monotonic(messages, less_jitter=True).names
    ('a', 'b')
    """
    check_set(messages)
    order = sorted(messages, key=lambda m: m.deadline - (m.jitter if less_jitter else 0))
    return messages.ordered(message.name for message in order)


def audsley(
    messages: MessageSet,
    bit_rate: int,
    *,
    convention: Convention = AS_USUAL,
    errors: ErrorModel = NO_ERRORS,
) -> Assignment:
    """Find an order of priority in which all deadlines are met, if there is one.

    Parameters
    ----------
    messages : MessageSet
        The messages; their own order does not matter.
    bit_rate : int
        Bit rate, 1000..1000000 [bit/s].
    convention : Convention, optional
        How long frames are, and what counts as the response.
    errors : ErrorModel, optional
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

    >>> from shipnet.can.schedule.messages import Message
    >>> from shipnet.can.schedule.response import response_times
    >>> messages = MessageSet(
    ...     [
    ...         Message("X", 1, 7, period=2.75e-3),
    ...         Message("Y", 2, 1, period=3e-3),
    ...         Message("Z", 3, 7, period=2.25e-3, deadline=2e-3),
    ...     ]
    ... )
    >>> by_deadline = deadline_monotonic(messages)
    >>> [f"{r.message.name} {r.response}" for r in response_times(by_deadline, 125_000)]
    ['Z 0.002', 'X 0.00252', 'Y 0.00404']
    >>> found = audsley(messages, 125_000)
    >>> found.feasible
    True
    >>> [f"{r.message.name} {r.response}" for r in response_times(found.messages, 125_000)]
    ['Z 0.002', 'Y 0.00252', 'X 0.00252']
    """
    bus = on_bus(messages, bit_rate, convention)
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
