"""Modbus in datagrams: what a late reply does when nothing says which request it answers.

Simulated time only; of a frame, the transaction id and the unit id matter here.
"""

from __future__ import annotations

from collections.abc import Sequence
from heapq import heappop, heappush
from typing import Any, Literal, NamedTuple

import numpy as np

from shipnet.arguments import checked
from shipnet.arrays import Floats, Integers
from shipnet.errors import ArgumentError
from shipnet.fields import check_rng, check_scalar, check_whole, number, record
from shipnet.lazy import pd

__all__ = ["LossyPath", "compare"]

Match = Literal["nothing", "unit id", "transaction id"]

#: Transaction ids have 16 bits.
_IDS = 1 << 16

_MOST = 10**6
_MATCHES: tuple[Match, ...] = ("nothing", "unit id", "transaction id")


@record
class LossyPath:
    """A network that loses, delays and duplicates datagrams, each one independently of the others.

    Examples
    --------
    >>> path = LossyPath(lost=1.0)
    >>> path.transit(2, np.random.default_rng(1)).tolist()
    [[inf, inf], [inf, inf]]
    """

    lost: float = number(0, 1, "", "Probability that a copy never arrives", default=0.0)
    late: float = number(0, 1, "", "Probability that a copy is late", default=0.0)
    duplicated: float = number(
        0, 1, "", "Probability that a datagram is sent on as two copies", default=0.0
    )
    delay: float = number(0, 3600, "s", "How long a datagram takes", default=1e-3)
    lateness: float = number(0, 3600, "s", "How much longer a late one takes", default=1.0)

    def transit(self, n: int, rng: np.random.Generator) -> Floats:
        """Return how long either copy of each of n datagrams takes [s], (n, 2); inf if lost."""
        n = check_whole("n", n, 0, 4 * _MOST)
        fate = rng.random((n, 2, 3))
        gone = fate[..., 0] < self.lost
        gone[:, 1] |= fate[:, 0, 2] >= self.duplicated
        time = np.where(fate[..., 1] < self.late, self.delay + self.lateness, self.delay)
        return np.where(gone, np.inf, time)


class Run(NamedTuple):
    """What became of a master's requests, one entry per request."""

    unit: Integers
    #: When the request went out and a reply was taken [s]; NaN after a time-out.
    sent: Floats
    taken: Floats
    #: The request whose reply was taken, -1 after a time-out.
    reply_to: Integers
    #: How many replies the master received and did not take.
    dropped: int

    @property
    def timeouts(self) -> int:
        """Requests without a reply."""
        return int((self.reply_to < 0).sum())

    @property
    def mismatched(self) -> int:
        """Requests for which the reply to another request was taken."""
        others = self.reply_to != np.arange(self.reply_to.size)
        return int(((self.reply_to >= 0) & others).sum())

    @property
    def wrong_unit(self) -> int:
        """Requests for which the reply of another unit was taken."""
        return int(((self.reply_to >= 0) & (self.unit[self.reply_to] != self.unit)).sum())


def simulate(
    units: Sequence[int] | Integers,
    path: LossyPath,
    *,
    match: Match = "transaction id",
    timeout: float = 0.5,
    period: float = 0.0,
    processing: float = 0.0,
    flush: bool = False,
    rng: Any = None,
) -> Run:
    """Simulate a master that asks one unit after the other in datagrams.

    It takes a reply whose transaction id is its request's own, or, with ids that are all 0, whose
    unit id is right, or any; the other arguments are those of `compare`.
    """
    asked = np.asarray(units)
    if asked.ndim != 1 or not 1 <= asked.size <= _MOST or asked.dtype.kind not in "iu":
        raise ArgumentError(f"units is {units!r}; it must be a row of 1..{_MOST} whole numbers")
    if asked.min() < 0 or asked.max() > 255:
        raise ArgumentError(f"units reach from {asked.min()} to {asked.max()}; they must be 0..255")
    wait = check_scalar("timeout", timeout, "s", 1e-9, 3600)
    step = check_scalar("period", period, "s", 0, 3600)
    work = check_scalar("processing", processing, "s", 0, 3600)
    n, generator = len(asked), check_rng(rng)
    there = path.transit(n, generator)
    back = path.transit(2 * n, generator).reshape(n, 2, 2)
    trips = (there[:, :, np.newaxis] + work + back).reshape(n, 4).tolist()

    marks = {
        "nothing": np.zeros(n, np.int64),
        "unit id": asked,
        "transaction id": np.arange(n) % _IDS,
    }[match].tolist()
    in_transit: list[tuple[float, int]] = []
    sent, taken = np.zeros(n), np.full(n, np.nan)
    reply_to, dropped, now = np.full(n, -1), 0, 0.0
    for k in range(n):
        start = sent[k] = now
        for trip in trips[k]:
            if trip < np.inf:
                heappush(in_transit, (start + trip, k))
        now = start + wait
        while in_transit and in_transit[0][0] <= start + wait:
            arrival, request = heappop(in_transit)
            if marks[request] == marks[k] and not (flush and arrival < start):
                now = max(arrival, start)
                taken[k], reply_to[k] = now, request
                break
            dropped += 1
        now = max(now, start + step)
    return Run(asked, sent, taken, reply_to, dropped)


@checked
def compare(
    units: Sequence[int] | Integers,
    path: LossyPath,
    *,
    timeout: float = 0.5,
    period: float = 0.0,
    processing: float = 0.0,
    flush: bool = False,
    rng: Any = None,
) -> pd.DataFrame:
    r"""Compare what a master may check in a reply, on the same network.

    Parameters
    ----------
    units : array_like of int, shape (n,)
        Who is asked, in this order, 0..255; at most a million.
    path : LossyPath
        The network, there and back.
    timeout : float, default 0.5
        How long the master waits for a reply, 1e-9..3600 [s].
    period : float, default 0
        Least time from one request to the next, 0..3600 [s]; with 0 the next one follows at once.
    processing : float, default 0
        How long a unit works on its reply, 0..3600 [s].
    flush : bool, default False
        Whether the master empties its socket before each request. Otherwise what arrived since
        the last one is read first.
    rng : int or numpy.random.Generator, optional
        Draws what happens to the datagrams, once for all rows: they differ in what is checked only.

    Returns
    -------
    pandas.DataFrame
        One row per way to check, named by what is compared: ``nothing``, ``unit id``,
        ``transaction id``; columns ``mismatched`` (the reply to another request was taken),
        ``wrong_unit`` (that of another unit), ``timeouts``, ``dropped`` (replies not taken).

    Raises
    ------
    ArgumentError
        If an argument is out of its range.

    Notes
    -----
    The header in tables 2 and 3 of kim2014 [1]_ begins with 0.0.0.0: transaction id 0. A reply
    that comes after its time-out then looks the same as the one that is waited for, where the
    guide has an id that pairs them [2]_. Let a round trip take r and a late one r + L, with
    L < T < r + L for a time-out T, and let the next request follow at once. The late reply comes
    before the one to that request, which is left over for the following, and so on. One late reply
    to request j of n, counted from 0, mismatches all others after it,

    .. math:: n - 1 - j

    and nothing ends it but another fault. A master with `flush` and a period takes only one wrong
    reply for each late one. If a share p of the replies is late, and each comes while request m
    later is waited for and before the reply to that, the expected number is

    .. math:: (n - m) \, p

    References
    ----------
    .. [1] J. H. Kim, Y. H. Yu, J. Korean Soc. Marine Eng. 38(3), 2014, tables 2 and 3.
    .. [2] "MODBUS messaging on TCP/IP implementation guide", V1.0b, 2006, section 4.4.1.

    Examples
    --------
    >>> units, path = np.tile([1, 2, 3, 4], 250), LossyPath(late=0.02, lateness=0.6)
    >>> print(compare(units, path, rng=np.random.default_rng(2024)))
                    mismatched  wrong_unit  timeouts  dropped
    nothing                404         402         4        0
    unit id                 10           0        32       31
    transaction id           0           0        39       38
    """
    seed = int(check_rng(rng).integers(2**63))
    settings = {"timeout": timeout, "period": period, "processing": processing, "flush": flush}
    rows = {}
    for match in _MATCHES:
        run = simulate(units, path, match=match, rng=seed, **settings)  # type: ignore[arg-type]
        rows[match] = (run.mismatched, run.wrong_unit, run.timeouts, run.dropped)
    columns = ["mismatched", "wrong_unit", "timeouts", "dropped"]
    return pd.DataFrame.from_dict(rows, orient="index", columns=columns)
