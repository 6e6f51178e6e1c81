"""Modbus in datagrams: what late replies do if nothing shows which request they answer.

Only the transaction id and the unit id of a frame are modelled, in simulated time.
"""

from __future__ import annotations

from collections.abc import Sequence
from heapq import heappop, heappush
from typing import Any, Literal, NamedTuple, get_args

import numpy as np

from shipnet.arguments import checked
from shipnet.arrays import Floats, Integers
from shipnet.errors import ArgumentError
from shipnet.fields import check_rng, check_scalar, check_whole, number, record
from shipnet.lazy import pd

__all__ = ["LossyPath", "compare"]

Match = Literal["nothing", "unit id", "transaction id"]

_IDS = 1 << 16  #: Number of transaction ids.
_MOST = 10**6  #: Most requests.


@record
class LossyPath:
    """A network that independently loses, delays and duplicates datagrams.

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
        """Return the transit times of both copies of n datagrams [s], (n, 2); inf if lost."""
        n = check_whole("n", n, 0, 4 * _MOST)
        fate = rng.random((n, 2, 3))
        gone = fate[..., 0] < self.lost
        gone[:, 1] |= fate[:, 0, 2] >= self.duplicated
        time = np.where(fate[..., 1] < self.late, self.delay + self.lateness, self.delay)
        return np.where(gone, np.inf, time)


class Run(NamedTuple):
    """The requests of a master: the unit of each, and the request whose reply it took.

    `reply_to` is -1 after a time-out; `dropped` counts replies received and not taken.
    """

    unit: Integers
    reply_to: Integers
    dropped: int

    @property
    def timeouts(self) -> int:
        """Requests without a reply."""
        return int((self.reply_to < 0).sum())

    @property
    def mismatched(self) -> int:
        """Requests that took the reply to another request."""
        others = self.reply_to != np.arange(self.reply_to.size)
        return int(((self.reply_to >= 0) & others).sum())

    @property
    def wrong_unit(self) -> int:
        """Requests that took the reply of another unit."""
        return int(((self.reply_to >= 0) & (self.unit[self.reply_to] != self.unit)).sum())


def simulate(
    units: Sequence[int] | Integers,
    path: LossyPath,
    *,
    match: Match = "transaction id",
    timeout: float = 0.5,
    rng: Any = None,
) -> Run:
    """Simulate a master that asks one unit after the other in datagrams.

    It takes a reply whose `match` field equals that of its request; the other arguments are those
    of `compare`.
    """
    asked = np.asarray(units)
    if asked.ndim != 1 or not 1 <= asked.size <= _MOST or asked.dtype.kind not in "iu":
        raise ArgumentError(f"units is {units!r}; it must be a row of 1..{_MOST} whole numbers")
    if asked.min() < 0 or asked.max() > 255:
        raise ArgumentError(f"units reach from {asked.min()} to {asked.max()}; they must be 0..255")
    wait = check_scalar("timeout", timeout, "s", 1e-9, 3600)
    n, generator = len(asked), check_rng(rng)
    there = path.transit(n, generator)
    back = path.transit(2 * n, generator).reshape(n, 2, 2)
    trips = (there[:, :, np.newaxis] + back).reshape(n, 4).tolist()

    marks = {
        "nothing": np.zeros(n, np.int64),
        "unit id": asked,
        "transaction id": np.arange(n) % _IDS,
    }[match].tolist()
    in_transit: list[tuple[float, int]] = []
    reply_to, dropped, now = np.full(n, -1), 0, 0.0
    for k in range(n):
        start = now
        for trip in trips[k]:
            if trip < np.inf:
                heappush(in_transit, (start + trip, k))
        now = start + wait
        while in_transit and in_transit[0][0] <= start + wait:
            arrival, request = heappop(in_transit)
            if marks[request] == marks[k]:
                now = max(arrival, start)
                reply_to[k] = request
                break
            dropped += 1
    return Run(asked, reply_to, dropped)


@checked
def compare(
    units: Sequence[int] | Integers,
    path: LossyPath,
    *,
    timeout: float = 0.5,
    rng: Any = None,
) -> pd.DataFrame:
    r"""Compare masters that check different fields of a reply, on the same network.

    Parameters
    ----------
    units : array_like of int, shape (n,)
        Units in the order of the requests, 0..255; at most a million.
    path : LossyPath
        The network, in both directions.
    timeout : float, default 0.5
        Time-out of a reply, 1e-9..3600 [s].
    rng : int or numpy.random.Generator, optional
        Random generator; all rows see the same datagrams.

    Returns
    -------
    pandas.DataFrame
        One row per field that is checked: ``nothing``, ``unit id``, ``transaction id``. Columns:
        ``mismatched`` (reply to another request taken), ``wrong_unit`` (that of another unit),
        ``timeouts`` and ``dropped`` (replies not taken).

    Notes
    -----
    The header in tables 2 and 3 of kim2014 begins with 0.0.0.0: transaction id 0. A reply after its
    time-out then looks like the next one, which an id as in "MODBUS messaging on TCP/IP" V1.0b,
    section 4.4.1, would prevent. Let a round trip take r and a late one r + L, with L < T < r + L
    for a time-out T, and let requests follow at once. The late reply comes before that to the next
    request, which is left for the following one, and so on. So one late reply to request j of n,
    counted from 0, mismatches all later requests,

    .. math:: n - 1 - j

    until another fault.

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
    rows = {}
    for match in get_args(Match):
        run = simulate(units, path, match=match, timeout=timeout, rng=seed)
        rows[match] = (run.mismatched, run.wrong_unit, run.timeouts, run.dropped)
    columns = ["mismatched", "wrong_unit", "timeouts", "dropped"]
    return pd.DataFrame.from_dict(rows, orient="index", columns=columns)
