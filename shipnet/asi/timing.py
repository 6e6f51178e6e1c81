"""How long a transaction takes: request, master pause, response, slave pause.

All lengths are counted in bit times of 6 us. The end of a pause is the start of the next
telegram's first bit.
"""

from __future__ import annotations

from dataclasses import dataclass
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

    def __post_init__(self) -> None:
        """Check the pauses."""
        low, high = MASTER_PAUSE_BITS
        if not low <= self.master_pause <= high:
            raise ArgumentError(
                f"master_pause is {self.master_pause} bit times; it must be {low:g}..{high:g}"
            )
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


@dataclass(frozen=True, slots=True)
class Timing:
    """The pauses by which a line with all its slaves runs; lengths in bit times."""

    master_pause: float = 3.0
    unsynchronised: float = 2.0
    slave_pause: float = 2.0
    timeout: float = 10.0
    bit_time: float = BIT_TIME

    def __post_init__(self) -> None:
        """Check every value."""
        if not 0 < self.bit_time < float("inf"):
            raise ArgumentError(f"bit_time is {self.bit_time} s; it must be positive")
        longest = LONGEST_SLAVE_PAUSE / self.bit_time
        for name, low, high in (
            ("master_pause", *MASTER_PAUSE_BITS),
            ("unsynchronised", 0.0, 10.0),
            ("slave_pause", 1.0, longest),
            ("timeout", 2.0, 24.0),
        ):
            value = getattr(self, name)
            if not low <= value <= high:
                raise ArgumentError(f"{name} is {value} bit times; it must be {low:g}..{high:.4g}")

    def answered(self, pause: float | None = None) -> float:
        """Return how long an answered request takes, up to the next one [bit]."""
        pause = self.master_pause if pause is None else pause
        return REQUEST_BITS + pause + RESPONSE_BITS + self.slave_pause

    @property
    def unanswered(self) -> float:
        """How long a request takes that nobody answers, up to the next one [bit]."""
        return REQUEST_BITS + self.timeout
