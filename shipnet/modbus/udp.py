"""Modbus in datagrams: the effect of late responses that do not show which request they answer.

Only the transaction id and the unit id of a frame are modelled, in simulated time.
"""

from __future__ import annotations

from collections.abc import Sequence
from heapq import heappop, heappush
from typing import Any

import numpy as np

from shipnet.arrays import Floats, Integers
from shipnet.errors import ArgumentError
from shipnet.fields import check_rng, check_scalar, check_whole, number, record
from shipnet.lazy import pd

__all__ = ["LossyPath", "compare"]
__dir__ = __all__.copy

_MOST = 10**6  #: Largest number of requests.


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
    delay: float = number(0, 3600, "s", "Transit time of a datagram", default=1e-3)
    lateness: float = number(0, 3600, "s", "Additional time of a late datagram", default=1.0)

    def transit(self, n: int, rng: np.random.Generator) -> Floats:
        """Return transit times of both copies of n datagrams [s], (n, 2); inf if lost or unsent."""
        n = check_whole("n", n, 0, 4 * _MOST)
        fate = rng.random((n, 2, 3))
        gone = fate[..., 0] < self.lost
        gone[:, 1] |= fate[:, 0, 2] >= self.duplicated
        time = np.where(fate[..., 1] < self.late, self.delay + self.lateness, self.delay)
        return np.where(gone, np.inf, time)


def transaction_ids(n: int) -> list[int]:
    """Return the transaction ids of n requests; after 65536 requests they start again at 0."""
    return (np.arange(n) % (1 << 16)).tolist()


def replies(
    marks: Sequence[int], path: LossyPath, timeout: float, rng: np.random.Generator
) -> tuple[Integers, int]:
    """Match responses to requests; return the matches and the number of dropped responses.

    Each request accepts a response to any request with the same mark; its match is the index of
    that request, or -1 after a time-out.
    """
    n = len(marks)
    there = path.transit(n, rng)
    back = path.transit(2 * n, rng).reshape(n, 2, 2)
    trips = (there[:, :, np.newaxis] + back).reshape(n, 4).tolist()
    in_transit: list[tuple[float, int]] = []
    reply_to, dropped, now = np.full(n, -1), 0, 0.0
    for k in range(n):
        start = now
        for trip in trips[k]:
            if trip < np.inf:
                heappush(in_transit, (start + trip, k))
        now = start + timeout
        while in_transit and in_transit[0][0] <= start + timeout:
            arrival, request = heappop(in_transit)
            if marks[request] == marks[k]:
                now = max(arrival, start)
                reply_to[k] = request
                break
            dropped += 1
    return reply_to, dropped


def compare(
    units: Sequence[int] | Integers, path: LossyPath, *, timeout: float = 0.5, rng: Any = None
) -> pd.DataFrame:
    r"""Compare masters that check different fields of a response, on the same network.

    Parameters
    ----------
    units : array_like of int, shape (n,)
        Unit id of each request, 0..255, in the order of the requests; at most a million.
    path : LossyPath
        The network, in both directions.
    timeout : float, default 0.5
        Response time-out, 1e-9..3600 [s].
    rng : int or numpy.random.Generator, optional
        Random generator; all rows of the table use the same datagrams.

    Returns
    -------
    pandas.DataFrame
        One row per field that is checked: ``nothing``, ``unit id``, ``transaction id``. Columns:
        ``mismatched`` (requests that accepted a response to another request), ``wrong_unit`` (those
        that accepted one from another unit), ``timeouts`` and ``dropped`` (responses rejected).

    Notes
    -----
    The header in tables 2 and 3 of kim2014 begins with 0.0.0.0: transaction id 0. A response that
    arrives after its time-out then looks like the response to the next request; a transaction id as
    in "MODBUS messaging on TCP/IP" V1.0b, section 4.4.1, would prevent this. Let a round trip take
    r and a late one r + L, let the time-out T satisfy L < T < r + L, and let each request be sent
    as soon as the previous transaction ends. The next request accepts the late response; its own
    response arrives later and is accepted by the following request, and so on. So, until another
    fault occurs, one late response to request j of n, counted from 0, causes a mismatch in every
    later request; their number is

    .. math:: n - 1 - j

    Examples
    --------
    >>> units, path = np.tile([1, 2, 3, 4], 250), LossyPath(late=0.02, lateness=0.6)
    >>> print(compare(units, path, rng=np.random.default_rng(2024)))
                    mismatched  wrong_unit  timeouts  dropped
    nothing                404         402         4        0
    unit id                 10           0        32       31
    transaction id           0           0        39       38
    """
    unit_ids = np.asarray(units)
    if unit_ids.ndim != 1 or not 1 <= unit_ids.size <= _MOST or unit_ids.dtype.kind not in "iu":
        raise ArgumentError(f"units is {units!r}; it must be a row of 1..{_MOST} whole numbers")
    if unit_ids.min() < 0 or unit_ids.max() > 255:
        raise ArgumentError(
            f"units range from {unit_ids.min()} to {unit_ids.max()}; they must be 0..255"
        )
    wait = check_scalar("timeout", timeout, "s", 1e-9, 3600)
    seed = int(check_rng(rng).integers(2**63))
    n = len(unit_ids)
    marks = {"nothing": [0] * n, "unit id": unit_ids.tolist(), "transaction id": transaction_ids(n)}
    rows = {}
    for name, identifiers in marks.items():
        reply_to, dropped = replies(identifiers, path, wait, check_rng(seed))
        answered = reply_to >= 0
        mismatched = answered & (reply_to != np.arange(n))
        wrong_unit = answered & (unit_ids[reply_to] != unit_ids)
        rows[name] = (mismatched.sum(), wrong_unit.sum(), n - answered.sum(), dropped)
    columns = ["mismatched", "wrong_unit", "timeouts", "dropped"]
    return pd.DataFrame.from_dict(rows, orient="index", columns=columns)
