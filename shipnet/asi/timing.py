"""How long a transaction takes: request, master pause, response, slave pause.

All lengths are counted in bit times of 6 us. The end of a pause is the start of the next
telegram's first bit.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import numpy.typing as npt

from shipnet.asi.telegram import REQUEST_BITS, RESPONSE_BITS
from shipnet.errors import ArgumentError

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from shipnet.asi.telegram import Request, Response


#: Length of one bit on the line [s], from icn2007 section 5 and OMRON manual W357, p. 5.
BIT_TIME = 6e-6

#: Shortest and longest legal pause between request and response [bit].
MASTER_PAUSE_BITS = (2.0, 10.0)

#: Longest pause that a master may leave before its next request [s], from OMRON manual W357, p. 5.
LONGEST_SLAVE_PAUSE = 500e-6


#: User bits of one exchange in each direction.
USER_BITS = 4


class Span(NamedTuple):
    """One part of a transaction: its name, its start and its length, both in bit times."""

    name: str
    start: float
    length: float

    @property
    def end(self) -> float:
        """Where the part ends [bit]."""
        return self.start + self.length


@dataclass(frozen=True, slots=True)
class Transaction:
    """One request with its response and both pauses.

    Parameters
    ----------
    master_pause : float, default 3
        Pause after the request, 2..10 bit times: a synchronous slave answers after 2 to 3, one
        that is not synchronous needs two more.
    slave_pause : float, default 2
        Pause after the response [bit], 0 or more; 1.5 to 2 in undisturbed operation.
    bit_time : float, default 6e-6
        Length of a bit [s].
    unsynchronised : float, default 2
        How much later a slave answers that is not synchronised, 0..10 bit times [2]_.
    timeout : float, default 10
        How long the master waits for the start of a response before it goes on, 2..24 bit
        times [1]_.

    Raises
    ------
    ArgumentError
        If a pause or the bit time is out of its range.

    Notes
    -----
    Published lengths are 150 us (25 bit times), 153, 154 and 156 us (26 bit times): the pauses
    make the difference, so they are parameters. The default is the longest of them.

    References
    ----------
    .. [1] OMRON, "CQM1-ARM21", manual W357, 1999, p. 5.
    .. [2] "AS-Interface communication system for field networks (2)", ICN, July 2007,
       data link layer, section 2.

    Examples
    --------
    From [1]_, 156 us a transaction:

    >>> round(Transaction().duration * 1e6)
    156
    """

    master_pause: float = 3.0
    slave_pause: float = 2.0
    bit_time: float = BIT_TIME
    unsynchronised: float = field(default=2.0, kw_only=True)
    timeout: float = field(default=10.0, kw_only=True)

    def __post_init__(self) -> None:
        """Check the pauses."""
        for name, low, high in (
            ("master_pause", *MASTER_PAUSE_BITS),
            ("unsynchronised", 0.0, 10.0),
            ("timeout", 2.0, 24.0),
        ):
            value = getattr(self, name)
            if not low <= value <= high:
                raise ArgumentError(f"{name} is {value} bit times; it must be {low:g}..{high:g}")
        if not 0 <= self.slave_pause < float("inf"):
            raise ArgumentError(f"slave_pause is {self.slave_pause} bit times; it must be 0..")
        if not 0 < self.bit_time < float("inf"):
            raise ArgumentError(f"bit_time is {self.bit_time} s; it must be positive")

    @property
    def spans(self) -> tuple[Span, Span, Span, Span]:
        """The four parts in the order in which they pass."""
        response = REQUEST_BITS + self.master_pause
        return (
            Span("request", 0.0, REQUEST_BITS),
            Span("master pause", REQUEST_BITS, self.master_pause),
            Span("response", response, RESPONSE_BITS),
            Span("slave pause", response + RESPONSE_BITS, self.slave_pause),
        )

    @property
    def bits(self) -> float:
        """Length from one request to the next [bit]."""
        return self.spans[-1].end

    @property
    def duration(self) -> float:
        """Length from one request to the next [s]."""
        return self.bits * self.bit_time

    @property
    def unanswered(self) -> float:
        """Length of a request that nobody answers, up to the next one [bit]."""
        return REQUEST_BITS + self.timeout

    def check_line(self) -> None:
        """Raise unless a master may leave such a pause before its next request, 1 bit to 500 us."""
        longest = LONGEST_SLAVE_PAUSE / self.bit_time
        if not 1 <= self.slave_pause <= longest:
            raise ArgumentError(
                f"slave_pause is {self.slave_pause} bit times; it must be 1..{longest:.4g}"
            )

    @property
    def net_rate(self) -> float:
        """User bits of one exchange, four each way, over its length [bit/s]."""
        return 2 * USER_BITS / self.duration

    def efficiency(self, user_bits: npt.ArrayLike = USER_BITS) -> npt.NDArray[np.float64]:
        """Return the share of the line that carries `user_bits` each way.

        AS-i takes one transaction per 4 bits; the rates of buses are left out, since a share of
        the line is compared, not its speed.
        """
        n = np.asarray(user_bits)
        if n.dtype.kind not in "iu" or not (n >= 1).all():
            raise ArgumentError(f"user_bits is {user_bits!r}; it must be whole numbers from 1 on")
        return np.asarray(2 * n / (self.bits * -(-n // USER_BITS)))

    def plot(
        self, request: Request | str, response: Response | str, ax: Axes | None = None
    ) -> Axes:
        """Draw a request, both pauses and a response on one time axis: kim2023's Fig 5.

        Telegrams may be given as bits, right or wrong; x is in bit times, microseconds on top.
        """
        from shipnet.asi.plot import plot_transaction

        return plot_transaction(request, response, self, ax=ax)
