"""What faults that come at random cost: responses with K faults, and the chance of a miss."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Literal

import numpy as np
import numpy.typing as npt
from scipy import special

from shipnet.can.schedule.convention import AS_USUAL, Convention, ErrorModel
from shipnet.can.schedule.level import Bus, Level, on_bus
from shipnet.can.schedule.messages import MessageSet
from shipnet.errors import ArgumentError
from shipnet.fields import check_whole

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["fault_table", "miss_probability"]

Floats = npt.NDArray[np.float64]
Blocked = Literal["sufficient", "1994"]

#: Faults within one deadline that are told apart; the chance of more counts as a miss.
_MOST_FAULTS = 1000


def fault_table(
    messages: MessageSet,
    bit_rate: int,
    name: str,
    rate: float,
    most: int,
    *,
    method: Blocked = "sufficient",
    convention: Convention = AS_USUAL,
    error_bits: int = 31,
) -> pd.DataFrame:
    r"""Return the response of a message to every number of faults, and how likely it is.

    .. math:: R_K = J + B + K \left( n_{err} \tau + \max_{k \in hep} C_k \right) + I(R_K) + C,
              \qquad p_K = P(K, R_K) - \sum_{j=0}^{K-1} p_j \; P(K - j, R_K - R_j)

    Parameters
    ----------
    messages : MessageSet
        The messages.
    bit_rate : int
        Bit rate, 1000..1000000 [bit/s].
    name : str
        The message.
    rate : float
        Mean rate of the faults, a Poisson process, 0..1e6 [1/s].
    most : int
        Largest number of faults, 0..1000.
    method : {"sufficient", "1994"}, default "sufficient"
        How the first instance is blocked, as in `response_times`.
    convention : Convention, optional
        How long frames are, and what counts as the response.
    error_bits : int, default 31
        Length of an error frame with intermission, 17..31 [bit]; [1]_ has 29.

    Returns
    -------
    pandas.DataFrame
        One row a number of faults: ``faults``, ``response_ms``, ``probability`` (that so many
        faults delay the message, and no more), ``later`` (the probability that more do) and
        ``met``. A response without a bound is infinite and has the probability 0.

    Raises
    ------
    ArgumentError
        If an argument is out of range, or a deadline is longer than its period.

    Notes
    -----
    :math:`P(n, t) = e^{-\lambda t} (\lambda t)^n / n!`. With K faults the message arrives at
    :math:`R_K`, if no smaller number of faults let it arrive before: that is the sum of [1]_. Here
    the count of faults is carried from one :math:`R_K` to the next instead, which adds up positive
    numbers only, so that chances of 1e-30 are as exact as others.

    Every fault is assumed to hit at the worst moment of the worst release, so the probabilities
    of late arrival are upper bounds. Faults count from queueing to arrival.

    References
    ----------
    .. [1] I. Broster, A. Burns, G. Rodriguez-Navas, "Probabilistic analysis of CAN with faults",
       23rd IEEE Real-Time Systems Symposium, 2002.

    Examples
    --------
    >>> from shipnet.can.schedule.messages import Message
    >>> messages = MessageSet([Message("A", 1, 8, 2.5e-3), Message("B", 2, 8, 5e-3)])
    >>> table = fault_table(messages, 250_000, "A", rate=30, most=2)
    >>> table[["faults", "response_ms", "met"]].values.tolist()
    [[0, 1.08, True], [1, 1.744, True], [2, 2.408, True]]
    >>> [f"{p:.3g}" for p in table["later"]]
    ['0.0319', '0.00113', '4.36e-05']
    """
    import pandas as pd

    rates = _rates(rate)
    if rates.size != 1:
        raise ArgumentError(f"rate is {rate!r}; it must be one number")
    check_whole("most", most, 0, _MOST_FAULTS)
    bus = _checked(messages, bit_rate, method, convention)
    place = messages.names.index(messages[name].name)
    found = [_response(bus, place, k, method, error_bits) for k in range(most + 1)]
    bounded = [pair for pair in found if pair[0] < math.inf]
    arrived, left = _first_passage([window / bus.second for _, window in bounded], rates.item())
    arrived = np.append(arrived, np.zeros(len(found) - len(bounded)))
    # From the last row up, so that small chances are not added to large ones.
    later = left + np.append(np.cumsum(arrived[:0:-1])[::-1], 0.0)
    return pd.DataFrame(
        {
            "faults": np.arange(len(found)),
            "response_ms": [round(response / bus.second * 1e3, 9) for response, _ in found],
            "probability": arrived,
            "later": later,
            "met": [response <= bus.deadline[place] for response, _ in found],
        }
    )


def miss_probability(
    messages: MessageSet,
    bit_rate: int,
    rate: npt.ArrayLike,
    *,
    method: Blocked = "sufficient",
    convention: Convention = AS_USUAL,
    error_bits: int = 31,
) -> Floats:
    r"""Return the probability that faults let each message miss its deadline, at most.

    .. math:: P_{miss} = 1 - \sum_{K: R_K \leq D} p_K

    Parameters
    ----------
    messages : MessageSet
        The messages.
    bit_rate : int
        Bit rate, 1000..1000000 [bit/s].
    rate : float or array_like of float
        Mean rate of the faults, a Poisson process, 0..1e6 [1/s]: bit error rate times bit rate,
        where bit errors are independent.
    method : {"sufficient", "1994"}, default "sufficient"
        How the first instance is blocked, as in `response_times`.
    convention : Convention, optional
        How long frames are, and what counts as the response.
    error_bits : int, default 31
        Length of an error frame with intermission, 17..31 [bit].

    Returns
    -------
    ndarray of float, shape of `rate` and (n_messages,)
        Probability for an instance released at the worst moment, in order of priority; 1 for a
        message that misses its deadline without faults.

    Raises
    ------
    ArgumentError
        If an argument is out of range, or a deadline is longer than its period.

    Notes
    -----
    `fault_table` says how. Beyond 1000 faults within a deadline all counts as a miss.

    Examples
    --------
    >>> from shipnet.can.schedule.messages import Message
    >>> messages = MessageSet([Message("A", 1, 8, 2.5e-3), Message("B", 2, 8, 5e-3)])
    >>> miss_probability(messages, 250_000, [0, 30])[:, 0].round(8).tolist()
    [0.0, 4.36e-05]
    """
    rates = _rates(rate)
    bus = _checked(messages, bit_rate, method, convention)
    missed = np.ones((rates.size, len(messages)))
    for place in range(len(messages)):
        windows: list[float] = []
        while len(windows) <= _MOST_FAULTS:
            found = _response(bus, place, len(windows), method, error_bits)
            if found[0] > bus.deadline[place]:
                break
            windows.append(found[1] / bus.second)
        missed[:, place] = [_first_passage(windows, one)[1] for one in rates.ravel()]
    return missed.reshape(*rates.shape, len(messages))


def _rates(rate: npt.ArrayLike) -> Floats:
    rates = np.asarray(rate, dtype=np.float64)
    if not ((rates >= 0) & (rates <= 1e6)).all():
        raise ArgumentError(f"rate is {rate!r}; it must be 0..1e6 faults a second")
    return rates


def _checked(messages: MessageSet, bit_rate: int, method: Blocked, convention: Convention) -> Bus:
    if method not in ("sufficient", "1994"):
        raise ArgumentError(f"method is {method!r}; it must be sufficient or 1994")
    for message in messages:
        if message.deadline > message.period:
            raise ArgumentError(
                f"deadline of {message.name!r} is {message.deadline} s, longer than its period "
                f"{message.period} s: it may wait for itself, which this method does not count"
            )
    return on_bus(messages, bit_rate, convention)


def _response(
    bus: Bus, place: int, faults: int, method: Blocked, error_bits: int
) -> tuple[float, float]:
    """Return the response with some faults and the time in which they can hit it."""
    level = Level(
        bus,
        place,
        range(place),
        range(place + 1, len(bus.streams)),
        ErrorModel(faults, bits=error_bits),
        own_blocking=method == "sufficient",
    )
    response = level.first_response()
    return response, response - bus.convention.own_jitter * level.jitter


def _first_passage(windows: list[float], rate: float) -> tuple[Floats, float]:
    """Return the chances that K faults are the first K that end by `windows[K]`, and of none."""
    # How many faults there were, if the message is still on its way; the last entry: or more.
    n = len(windows)
    waiting = np.zeros(n + 1)
    waiting[0] = 1.0
    arrived = np.zeros(n)
    count = np.arange(n + 1)
    for k, span in enumerate(np.diff(windows, prepend=0.0)):
        mean = rate * span
        chance = np.exp(special.xlogy(count, mean) - mean - special.gammaln(count + 1))
        at_least = np.append(1.0, special.gammainc(count[1:], mean))
        more = waiting[n] + waiting[:n] @ at_least[n:0:-1]
        waiting[:n] = np.convolve(waiting[:n], np.trim_zeros(chance, "b"))[:n]
        waiting[n] = more
        arrived[k], waiting[k] = waiting[k], 0.0
    return arrived, float(waiting[n])
