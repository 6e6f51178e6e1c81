"""How long each message takes at worst, from its event to its arrival."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Literal, NamedTuple

from shipnet.can.schedule.convention import AS_USUAL, NO_ERRORS, Convention, ErrorModel
from shipnet.can.schedule.level import Bus, Level, meets_all, on_bus
from shipnet.can.schedule.messages import Message, MessageSet, check_set
from shipnet.errors import ArgumentError

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["Method", "ResponseTime", "response_table", "response_times", "schedulable"]

Method = Literal["exact", "sufficient", "1994"]


class ResponseTime(NamedTuple):
    """The longest response of a message, and how it comes about.

    Attributes
    ----------
    message : Message
        The message.
    frame_time : float
        Length of its frame [s].
    blocking : float
        Longest frame that may be on the bus already [s].
    busy_period : float
        How long the bus may be busy without a break with messages of this priority or higher,
        blocking included [s]; infinite if it need not end, NaN if the method does without it.
    instances : tuple of float
        Longest response of each instance of the message in the busy period [s]; one that is
        infinite if the busy period need not end.
    response : float
        The longest of them [s].
    met : bool
        Whether it is no longer than the deadline, compared in whole ticks.
    """

    message: Message
    frame_time: float
    blocking: float
    busy_period: float
    instances: tuple[float, ...]
    response: float
    met: bool


def response_times(
    messages: MessageSet,
    bit_rate: int,
    *,
    method: Method = "exact",
    convention: Convention = AS_USUAL,
    errors: ErrorModel = NO_ERRORS,
) -> tuple[ResponseTime, ...]:
    r"""Return the longest response time of every message, the highest priority first.

    .. math:: w_m(q) = B_m + E(w_m + C_m) + q C_m
              + \sum_{k \in hp(m)} \left\lceil \frac{w_m + J_k + \tau}{T_k} \right\rceil C_k,
              \qquad R_m = \max_q \left( J_m + w_m(q) - q T_m + C_m \right)

    Parameters
    ----------
    messages : MessageSet
        The messages. Offsets do not count, as no two nodes share a clock.
    bit_rate : int
        Bit rate, 1000..1000000 [bit/s].
    method : {"exact", "sufficient", "1994"}, default "exact"
        ``"exact"``: all instances in the busy period [1]_. ``"sufficient"``: the first one alone,
        blocked by a frame as long as its own at least; never too short where it meets the
        deadline. ``"1994"``: the first one alone, as in [2]_, which may be too short.
    convention : Convention, optional
        How long frames are, and what counts as the response.
    errors : ErrorModel, optional
        How many errors hit the bus; none if not given.

    Returns
    -------
    tuple of ResponseTime
        One a message; a message that no bound can be given for has an infinite response.

    Raises
    ------
    ArgumentError
        If the bit rate or the method is not legal, or a deadline is longer than its period in
        another method than the exact one.

    Notes
    -----
    All is computed in whole ticks that divide both nanosecond and bit time, so the numbers are
    exact; only the results are rounded to floats. A load within about 1e-4 of 1, of which a busy
    period takes more than 200000 steps or instances, counts as an overload. A node is expected to
    send its most urgent message first and to keep the instances of one message in order.

    References
    ----------
    .. [1] R. I. Davis, A. Burns, R. J. Bril, J. J. Lukkien, "Controller Area Network (CAN)
       schedulability analysis: refuted, revisited and revised", Real-Time Systems 35, 2007.
    .. [2] K. Tindell, A. Burns, "Guaranteeing message latencies on Control Area Network (CAN)",
       1st International CAN Conference, 1994.

    Examples
    --------
    The example of [1]_, 125 kbit/s: C misses its deadline with its second instance, and the older
    analysis does not see it.

    >>> messages = MessageSet(
    ...     [
    ...         Message("A", 1, 7, period=2.5e-3),
    ...         Message("B", 2, 7, period=3.5e-3, deadline=3.25e-3),
    ...         Message("C", 3, 7, period=3.5e-3, deadline=3.25e-3),
    ...     ]
    ... )
    >>> c = response_times(messages, 125_000)[-1]
    >>> c.instances, c.response, c.met
    ((0.003, 0.0035), 0.0035, False)
    >>> [r.response for r in response_times(messages, 125_000, method="1994")]
    [0.002, 0.003, 0.003]
    >>> [r.response for r in response_times(messages, 125_000, method="sufficient")]
    [0.002, 0.003, 0.007]
    """
    check_set(messages)
    if method not in ("exact", "sufficient", "1994"):
        raise ArgumentError(f"method is {method!r}; it must be exact, sufficient or 1994")
    if method != "exact":
        for message in messages:
            if message.deadline > message.period:
                raise ArgumentError(
                    f"deadline of {message.name!r} is {message.deadline} s, longer than its period "
                    f"{message.period} s; only the exact method allows that"
                )
    bus = on_bus(messages, bit_rate, convention)
    return tuple(
        _response(bus, place, message, method, errors) for place, message in enumerate(messages)
    )


def _response(
    bus: Bus, place: int, message: Message, method: Method, errors: ErrorModel
) -> ResponseTime:
    higher, lower = range(place), range(place + 1, len(bus.streams))
    level = Level(bus, place, higher, lower, errors, own_blocking=method == "sufficient")
    if method == "exact":
        busy, ticks = level.responses()
    else:
        busy, ticks = math.nan, [level.first_response()]
    longest = max(ticks)
    return ResponseTime(
        message,
        level.frame / bus.second,
        level.blocking / bus.second,
        busy / bus.second,
        tuple(response / bus.second for response in ticks),
        longest / bus.second,
        longest <= level.deadline,
    )


def schedulable(
    messages: MessageSet,
    bit_rate: int,
    *,
    convention: Convention = AS_USUAL,
    errors: ErrorModel = NO_ERRORS,
) -> bool:
    """Return whether every message meets its deadline, by the exact method.

    Parameters
    ----------
    messages : MessageSet
        The messages.
    bit_rate : int
        Bit rate, 1000..1000000 [bit/s].
    convention : Convention, optional
        How long frames are, and what counts as the response.
    errors : ErrorModel, optional
        How many errors hit the bus; none if not given.

    Returns
    -------
    bool
        Whether all deadlines are met.

    Raises
    ------
    ArgumentError
        As for `response_times`.

    Examples
    --------
    >>> messages = MessageSet([Message("A", 1, 8, 1e-3), Message("B", 2, 8, 1e-3)])
    >>> schedulable(messages, 250_000), schedulable(messages, 500_000)
    (False, True)
    """
    return meets_all(on_bus(messages, bit_rate, convention), errors)


def response_table(responses: tuple[ResponseTime, ...]) -> pd.DataFrame:
    """Return response times as a table, one row a message, the highest priority first.

    Parameters
    ----------
    responses : tuple of ResponseTime
        What `response_times` returned.

    Returns
    -------
    pandas.DataFrame
        ``name``, ``arbitration_id``, ``frame_ms``, ``blocking_ms``, ``busy_period_ms``,
        ``instances`` (how many), ``response_ms``, ``deadline_ms``, ``slack_ms`` (deadline less
        response) and ``met``.

    Examples
    --------
    >>> messages = MessageSet([Message("A", 1, 8, 1e-3), Message("B", 2, 8, 1e-3)])
    >>> table = response_table(response_times(messages, 500_000))
    >>> table[["name", "frame_ms", "response_ms", "slack_ms", "met"]].values.tolist()
    [['A', 0.27, 0.54, 0.46, True], ['B', 0.27, 0.54, 0.46, True]]
    """
    import pandas as pd

    table = pd.DataFrame(
        {
            "name": pd.Series([r.message.name for r in responses], dtype=object),
            "arbitration_id": [r.message.arbitration_id for r in responses],
            "frame_ms": [r.frame_time * 1e3 for r in responses],
            "blocking_ms": [r.blocking * 1e3 for r in responses],
            "busy_period_ms": [r.busy_period * 1e3 for r in responses],
            "instances": [len(r.instances) for r in responses],
            "response_ms": [r.response * 1e3 for r in responses],
            "deadline_ms": [r.message.deadline * 1e3 for r in responses],
            "slack_ms": [(r.message.deadline - r.response) * 1e3 for r in responses],
            "met": pd.Series([r.met for r in responses], dtype=bool),
        }
    )
    # Times are whole nanoseconds and bits; what 1e3 adds behind them is no part of the answer.
    return table.round(9)
