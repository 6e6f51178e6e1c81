"""The AS-i cycle in closed form: how often each slave is asked, and how late the host knows.

In every cycle the master asks each address once, then sends one management request and looks for
one new slave. An address that an A and a B slave share is asked once a cycle like any other, the
two slaves by turns: each of them is heard every second cycle.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from shipnet.asi.telegram import RESPONSE_BITS
from shipnet.asi.timing import Transaction
from shipnet.errors import ArgumentError

__all__ = [
    "ADDRESSES",
    "ResponseTime",
    "cycle_time",
    "fastest_loop",
    "response_time",
    "update_time",
]

#: Addresses that slaves can be given: five bits without address 0.
ADDRESSES = 31

#: Most transactions of one kind that are taken; no cycle comes near.
_MOST = 10_000

Floats = npt.NDArray[np.float64]


class ResponseTime(NamedTuple):
    """Bounds on the time from a change at a slave's input to the host's knowing of it.

    Attributes
    ----------
    best, worst : float or ndarray
        Shortest and longest time [s].
    """

    best: float | Floats
    worst: float | Floats


def cycle_time(
    alone: npt.ArrayLike,
    pairs: npt.ArrayLike = 0,
    *,
    transaction: Transaction | None = None,
    management: npt.ArrayLike = 1,
    inclusion: npt.ArrayLike = 1,
    repetitions: npt.ArrayLike = 0,
    minimum: float = 0.0,
) -> float | Floats:
    r"""Return the time in which the master asks every address once.

    .. math:: T_c = \max\left(T_{min},\, (n_{alone} + n_{pairs} + m + i + k) \, T\right)

    Parameters
    ----------
    alone : int or array_like of int
        Addresses with one slave, standard or A or B; 0..31.
    pairs : int or array_like of int, default 0
        Addresses that an A and a B slave share, 0..31; with `alone` not more than 31.
    transaction : Transaction, optional
        What one exchange takes; 26 bit times if omitted.
    management, inclusion : int or array_like of int, default 1
        Requests of the management and of the inclusion phase in a cycle.
    repetitions : int or array_like of int, default 0
        Telegrams that must be sent once more.
    minimum : float, default 0
        Time below which the master does not begin the next cycle [s].

    Returns
    -------
    float or ndarray of float
        Cycle time [s]; the arguments broadcast against each other.

    Raises
    ------
    ArgumentError
        If a number is not whole or out of its range.

    Notes
    -----
    The makers print the same formula with different additions. OMRON [1]_ adds two requests to
    any number of slaves. Schneider adds two, but one at 31 slaves [2]_: there is no address left
    where a new slave could be found, which is ``inclusion=0``. Schneider's masters do not go below
    3 ms [3]_, which is ``minimum=3e-3``. The specification's "5 ms for 31 slaves" needs
    transactions of 25 bit times; with 26 it is 5.148 ms.

    References
    ----------
    .. [1] OMRON, "CQM1-ARM21", manual W357, 1999, p. 5.
    .. [2] Schneider Electric, AS-i help D-SA-0011791.
    .. [3] Schneider Electric, FAQ FA231757.

    Examples
    --------
    From [1]_ and [2]_, 31 slaves:

    >>> round(cycle_time(31) * 1e6), round(cycle_time(31, inclusion=0) * 1e6)
    (5148, 4992)

    62 slaves take no longer, but each is heard every other cycle:

    >>> cycle_time(0, pairs=31) == cycle_time(31)
    True
    >>> cycle_time([6, 31], transaction=Transaction(2, 2)).round(5).tolist()
    [0.0012, 0.00495]
    """
    transaction = Transaction() if transaction is None else transaction
    used = _addresses(alone, pairs)
    extra = [
        _whole(name, value, _MOST)
        for name, value in [
            ("management", management), ("inclusion", inclusion), ("repetitions", repetitions)
        ]
    ]  # fmt: skip
    least = _seconds("minimum", minimum)
    return _plain(np.maximum((used + sum(extra)) * transaction.duration, least))


def update_time(
    alone: npt.ArrayLike,
    pairs: npt.ArrayLike = 0,
    *,
    transaction: Transaction | None = None,
    management: npt.ArrayLike = 1,
    inclusion: npt.ArrayLike = 1,
    minimum: float = 0.0,
) -> float | Floats:
    """Return the time after which every slave has been heard again: the slowest counts.

    Parameters
    ----------
    alone, pairs, transaction, management, inclusion, minimum
        As for `cycle_time`.

    Returns
    -------
    float or ndarray of float
        One cycle, or two where an A and a B slave share an address [s].

    Raises
    ------
    ArgumentError
        As `cycle_time`.

    Examples
    --------
    One shared address is enough:

    >>> short = Transaction(2, 2)
    >>> [f"{update_time(*n, transaction=short) * 1e3:.2f} ms" for n in [(31, 0), (30, 1), (0, 31)]]
    ['4.95 ms', '9.90 ms', '9.90 ms']
    """
    cycle = cycle_time(
        alone,
        pairs,
        transaction=transaction,
        management=management,
        inclusion=inclusion,
        minimum=minimum,
    )
    return _plain(np.multiply(cycle, np.where(np.greater(pairs, 0), 2, 1)))


def response_time(
    cycle: npt.ArrayLike,
    *,
    paired: npt.ArrayLike = False,
    repetitions: npt.ArrayLike = 0,
    host: float = 0.0,
    transaction: Transaction | None = None,
) -> ResponseTime:
    """Return how soon and how late the host knows that an input has changed.

    Parameters
    ----------
    cycle : float or array_like
        Cycle time without repetitions, positive [s].
    paired : bool or array_like of bool, default False
        Whether the slave shares its address, and so is asked every second cycle.
    repetitions : int or array_like of int, default 0
        Telegrams repeated while the change waits, at most.
    host : float, default 0
        Time between two looks of the host at the master's image of the inputs [s].
    transaction : Transaction, optional
        What one exchange takes; 26 bit times if omitted.

    Returns
    -------
    ResponseTime
        Best and worst.

    Raises
    ------
    ArgumentError
        If an argument is out of its range.

    Notes
    -----
    A slave is taken to look at its inputs when the request ends. At best the change comes just
    before: pause and response pass. At worst it comes just after, and waits for the next request
    to this slave; every repetition on the line makes that later by one transaction. Delays of the
    input itself, a filter or a relay, come on top.

    Examples
    --------
    A line with 31 slaves, and one with 62:

    >>> for paired in (False, True):
    ...     best, worst = response_time(cycle_time(31), paired=paired, repetitions=1)
    ...     print(f"{best * 1e3:.2f} to {worst * 1e3:.2f} ms")
    0.06 to 5.36 ms
    0.06 to 10.51 ms
    """
    transaction = Transaction() if transaction is None else transaction
    interval = _seconds("cycle", cycle)
    if not (interval > 0).all():
        raise ArgumentError(f"cycle is {cycle!r} s; it must be positive")
    shared = np.asarray(paired)
    if shared.dtype.kind != "b":
        raise ArgumentError(f"paired is {paired!r}; it must be True or False")
    k = _whole("repetitions", repetitions, _MOST)
    answer = (transaction.master_pause + RESPONSE_BITS) * transaction.bit_time
    waited = interval * np.where(shared, 2, 1) + k * transaction.duration
    look = _seconds("host", host)
    return ResponseTime(_plain(np.full(waited.shape, answer)), _plain(waited + answer + look))


def fastest_loop(interval: npt.ArrayLike, *, samples: float = 20.0) -> float | Floats:
    """Return the bandwidth of the fastest control loop that so rare a value can serve.

    Parameters
    ----------
    interval : float or array_like
        Time from one value to the next, positive [s].
    samples : float, default 20
        Values that a period of the bandwidth needs; 10 to 30 are usual [1]_.

    Returns
    -------
    float or ndarray of float
        Bandwidth [Hz].

    Raises
    ------
    ArgumentError
        If an argument is not positive.

    References
    ----------
    .. [1] K. J. Astrom, B. Wittenmark, "Computer-Controlled Systems", 3rd ed., 1997, section 2.9:
       the sampling frequency is 10 to 30 times the bandwidth.

    Examples
    --------
    Four bits every 5 ms, then 16 bits in seven such cycles:

    >>> [f"{fastest_loop(interval):.1f} Hz" for interval in (5e-3, 7 * 5e-3)]
    ['10.0 Hz', '1.4 Hz']
    """
    time = _seconds("interval", interval)
    if not (time > 0).all():
        raise ArgumentError(f"interval is {interval!r} s; it must be positive")
    if not 0 < samples < np.inf:
        raise ArgumentError(f"samples is {samples}; it must be positive")
    return _plain(1 / (samples * time))


def _whole(name: str, value: npt.ArrayLike, high: int) -> npt.NDArray[np.int64]:
    array = np.asarray(value)
    if array.dtype.kind not in "iu" or not ((array >= 0) & (array <= high)).all():
        raise ArgumentError(f"{name} is {value!r}; it must be whole numbers 0..{high}")
    return array.astype(np.int64)


def _addresses(alone: npt.ArrayLike, pairs: npt.ArrayLike) -> npt.NDArray[np.int64]:
    used = _whole("alone", alone, ADDRESSES) + _whole("pairs", pairs, ADDRESSES)
    if (used > ADDRESSES).any():
        raise ArgumentError(
            f"alone and pairs take {used.max()} addresses together; there are {ADDRESSES}"
        )
    return used


def _seconds(name: str, value: npt.ArrayLike) -> Floats:
    array = np.asarray(value)
    if array.dtype.kind not in "iuf" or not ((array >= 0) & np.isfinite(array)).all():
        raise ArgumentError(f"{name} is {value!r} s; it must be 0 or more, and finite")
    return array.astype(np.float64)


def _plain(array: Floats) -> float | Floats:
    return array if array.ndim else float(array)
