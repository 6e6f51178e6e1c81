"""Modbus in datagrams: what a late answer does when nothing tells whose answer it is.

Simulated time only; the frames are those of `shipnet.modbus.frame`, of which the transaction id
and the unit id matter here.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from heapq import heappop, heappush
from typing import TYPE_CHECKING, Literal

import numpy as np
import numpy.typing as npt

from shipnet.errors import ArgumentError
from shipnet.fields import check_scalar, check_whole

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["LossyPath", "PollRun", "mix_ups", "poll"]

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

#: Transaction ids have 16 bits.
_IDS = 1 << 16

_MOST = 10**6


@dataclass(frozen=True)
class LossyPath:
    """A network that loses, delays and duplicates datagrams, each one independently of the others.

    Parameters
    ----------
    lost : float, default 0
        Probability that a copy of a datagram never arrives, 0..1.
    late : float, default 0
        Probability that a copy is late, 0..1.
    duplicated : float, default 0
        Probability that a datagram is sent on as two copies, 0..1.
    delay : float, default 1e-3
        How long a datagram takes, 0..3600 [s].
    lateness : float, default 1
        How much longer a late one takes, 0..3600 [s].

    Raises
    ------
    ArgumentError
        If a field is out of its range.

    Examples
    --------
    >>> path = LossyPath(lost=1.0)
    >>> path.transit(2, np.random.default_rng(1)).tolist()
    [[inf, inf], [inf, inf]]
    """

    lost: float = 0.0
    late: float = 0.0
    duplicated: float = 0.0
    delay: float = 1e-3
    lateness: float = 1.0

    def __post_init__(self) -> None:
        """Check every field."""
        for field in fields(self):
            unit, high = ("s", 3600) if field.name in ("delay", "lateness") else ("", 1)
            value = check_scalar(field.name, getattr(self, field.name), unit, 0, high)
            object.__setattr__(self, field.name, value)

    def transit(self, n: int, rng: np.random.Generator) -> Floats:
        """Return how long the copies of datagrams take.

        Parameters
        ----------
        n : int
            How many datagrams are sent, 0..4e6.
        rng : numpy.random.Generator
            Draws what happens to them.

        Returns
        -------
        ndarray of float, shape (n, 2)
            Time on the way of either copy [s], inf for one that does not arrive or exist.
        """
        n = check_whole("n", n, 0, 4 * _MOST)
        fate = rng.random((n, 2, 3))
        gone = fate[..., 0] < self.lost
        gone[:, 1] |= fate[:, 0, 2] >= self.duplicated
        time = np.where(fate[..., 1] < self.late, self.delay + self.lateness, self.delay)
        return np.where(gone, np.inf, time)


@dataclass(frozen=True)
class PollRun:
    """What became of the requests of a master.

    Attributes
    ----------
    table : pandas.DataFrame
        One row a request: ``unit``, ``sent_s``, ``taken_s`` (NaN after a timeout), ``answer_of``
        (the request whose answer was taken, -1 after a timeout).
    dropped : int
        Answers that the master received and did not take.
    """

    table: pd.DataFrame
    dropped: int

    @property
    def timeouts(self) -> int:
        """Requests without an answer."""
        return int((self.table.answer_of < 0).sum())

    @property
    def mixed_up(self) -> int:
        """Requests for which the answer to another request was taken."""
        return int(((self.table.answer_of >= 0) & (self.table.answer_of != self.table.index)).sum())

    @property
    def wrong_unit(self) -> int:
        """Requests for which the answer of another unit was taken."""
        units = self.table.unit.to_numpy()
        answer_of = self.table.answer_of.to_numpy()
        return int(((answer_of >= 0) & (units[answer_of] != units)).sum())


def poll(
    units: Sequence[int] | Integers,
    path: LossyPath,
    rng: np.random.Generator,
    *,
    transaction_ids: Literal["counted", "zero"] = "counted",
    check_unit: bool = False,
    timeout: float = 0.5,
    period: float = 0.0,
    processing: float = 0.0,
    flush: bool = False,
) -> PollRun:
    r"""Simulate a master that asks one unit after the other in datagrams.

    Parameters
    ----------
    units : array_like of int, shape (n,)
        Who is asked, in this order, 0..255; at most a million.
    path : LossyPath
        The network, there and back.
    rng : numpy.random.Generator
        Draws what happens to the datagrams, in the same way for all other arguments.
    transaction_ids : {"counted", "zero"}, default "counted"
        Whether each request has an id of its own, which its answer must repeat, or all have 0.
    check_unit : bool, default False
        Whether the master compares the unit id of an answer with that of its request.
    timeout : float, default 0.5
        How long the master waits for an answer, above 0..3600 [s].
    period : float, default 0
        Least time from one request to the next, 0..3600 [s]; with 0 the next one follows at once.
    processing : float, default 0
        How long a unit works on its answer, 0..3600 [s].
    flush : bool, default False
        Whether the master empties its socket before each request. Else what arrived since the
        last one is read first.

    Returns
    -------
    PollRun
        What became of each request.

    Raises
    ------
    ArgumentError
        If an argument is out of its range.

    Notes
    -----
    The header in tables 2 and 3 of kim2014 [1]_ begins with 0.0.0.0: transaction id 0. An answer
    that comes behind its timeout is then as good as the one that is waited for, where the guide has
    an id that pairs them [2]_. Let a round trip take r and a late one r + L, with L < T < r + L for
    a timeout T, and let the next request follow at once. The late answer comes before the one to
    that request, which is left over for the following, and so on. One late answer to request j of
    n, counted from 0, mixes up all others behind it,

    .. math:: n - 1 - j

    and nothing ends it but another fault. A master with `flush` and a period is mixed up only once
    for each late answer. If a share p of the answers is late, and each comes while request m later
    is waited for and before the answer to that, the expected number is

    .. math:: (n - m) \, p

    References
    ----------
    .. [1] J. H. Kim, Y. H. Yu, J. Korean Soc. Marine Eng. 38(3), 2014, tables 2 and 3.
    .. [2] "MODBUS messaging on TCP/IP implementation guide", V1.0b, 2006, section 4.4.1.

    Examples
    --------
    Every tenth transaction has a late datagram; units 1 to 4 are asked in turn:

    >>> units, path = np.tile([1, 2, 3, 4], 25), LossyPath(late=0.05, lateness=0.6)
    >>> for ids in ("zero", "counted"):
    ...     run = poll(units, path, np.random.default_rng(2024), transaction_ids=ids)
    ...     print(f"{ids}: {run.timeouts} timeouts, {run.mixed_up} mixed up")
    zero: 3 timeouts, 8 mixed up
    counted: 8 timeouts, 0 mixed up
    """
    asked = _units(units)
    if transaction_ids not in ("counted", "zero"):
        raise ArgumentError(
            f"transaction_ids is {transaction_ids!r}; it must be 'counted' or 'zero'"
        )
    for name, flag in (("check_unit", check_unit), ("flush", flush)):
        if not isinstance(flag, bool):
            raise ArgumentError(f"{name} is {flag!r}; it must be True or False")
    wait = check_scalar("timeout", timeout, "s", 1e-9, 3600)
    step = check_scalar("period", period, "s", 0, 3600)
    work = check_scalar("processing", processing, "s", 0, 3600)
    n = len(asked)
    there, back = path.transit(n, rng), path.transit(2 * n, rng).reshape(n, 2, 2)
    trips = (there[:, :, np.newaxis] + work + back).reshape(n, 4).tolist()

    names = np.arange(n) % _IDS if transaction_ids == "counted" else np.zeros(n, np.int64)
    marks = list(zip(names.tolist(), (asked * check_unit).tolist(), strict=True))
    on_the_way: list[tuple[float, int]] = []
    sent, taken = np.zeros(n), np.full(n, np.nan)
    answer_of, dropped, now = np.full(n, -1), 0, 0.0
    for k in range(n):
        start = sent[k] = now
        for trip in trips[k]:
            if trip < np.inf:
                heappush(on_the_way, (start + trip, k))
        now = start + wait
        while on_the_way and on_the_way[0][0] <= start + wait:
            arrival, request = heappop(on_the_way)
            if marks[request] == marks[k] and not (flush and arrival < start):
                now = max(arrival, start)
                taken[k], answer_of[k] = now, request
                break
            dropped += 1
        now = max(now, start + step)
    return PollRun(_table(asked, sent, taken, answer_of), dropped)


def mix_ups(
    units: Sequence[int] | Integers,
    path: LossyPath,
    rng: np.random.Generator,
    *,
    timeout: float = 0.5,
    period: float = 0.0,
    processing: float = 0.0,
    flush: bool = False,
) -> pd.DataFrame:
    """Compare what a master may check of an answer, on the same network.

    Parameters
    ----------
    units : array_like of int, shape (n,)
        Who is asked, in this order, 0..255; at most a million.
    path : LossyPath
        The network, there and back.
    rng : numpy.random.Generator
        Draws what happens to the datagrams, once for all rows: they differ in what is checked only.
    timeout, period, processing, flush
        As for `poll`.

    Returns
    -------
    pandas.DataFrame
        One row a way to check, named by what is compared: ``nothing``, ``unit id``,
        ``transaction id``; columns ``mixed_up``, ``wrong_unit``, ``timeouts``, ``dropped``.

    Raises
    ------
    ArgumentError
        If an argument is out of its range.

    Examples
    --------
    >>> units, path = np.tile([1, 2, 3, 4], 250), LossyPath(late=0.02, lateness=0.6)
    >>> print(mix_ups(units, path, np.random.default_rng(2024)))
                    mixed_up  wrong_unit  timeouts  dropped
    nothing              404         402         4        0
    unit id               10           0        32       31
    transaction id         0           0        39       38
    """
    import pandas as pd

    seed = int(rng.integers(2**63))
    rows = {}
    ways: dict[str, tuple[Literal["counted", "zero"], bool]] = {
        "nothing": ("zero", False),
        "unit id": ("zero", True),
        "transaction id": ("counted", False),
    }
    for compared, (ids, check_unit) in ways.items():
        run = poll(
            units,
            path,
            np.random.default_rng(seed),
            transaction_ids=ids,
            check_unit=check_unit,
            timeout=timeout,
            period=period,
            processing=processing,
            flush=flush,
        )
        rows[compared] = (run.mixed_up, run.wrong_unit, run.timeouts, run.dropped)
    columns = ["mixed_up", "wrong_unit", "timeouts", "dropped"]
    return pd.DataFrame.from_dict(rows, orient="index", columns=columns)


def _units(units: Sequence[int] | Integers) -> Integers:
    asked = np.asarray(units)
    if asked.ndim != 1 or not 1 <= asked.size <= _MOST or asked.dtype.kind not in "iu":
        raise ArgumentError(f"units is {units!r}; it must be a row of 1..{_MOST} whole numbers")
    if asked.min() < 0 or asked.max() > 255:
        raise ArgumentError(f"units reach from {asked.min()} to {asked.max()}; they must be 0..255")
    return asked.astype(np.int64)


def _table(asked: Integers, sent: Floats, taken: Floats, answer_of: Integers) -> pd.DataFrame:
    import pandas as pd

    table = pd.DataFrame({"unit": asked, "sent_s": sent, "taken_s": taken, "answer_of": answer_of})
    return table.rename_axis("request")
