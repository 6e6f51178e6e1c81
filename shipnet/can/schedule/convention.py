"""What counts as a response time, and how many errors have to be reckoned with."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from shipnet.can.schedule.lengths import Lengths, length_table
from shipnet.clock import nanoseconds
from shipnet.errors import ArgumentError
from shipnet.fields import check_whole

__all__ = ["AS_USUAL", "NO_ERRORS", "Convention", "ErrorModel"]


@dataclass(frozen=True, slots=True)
class Convention:
    """What counts as the response time: published tables differ in it by a few bit times.

    Parameters
    ----------
    lengths : {"worst", "attainable", "worst 1994", "nominal"}, default "worst"
        How long frames are, as in `frame_bits`, where a message does not give its own `bits`.
    intermission : {"everywhere", "between", "nowhere"}, default "everywhere"
        Where the three bits behind a frame count: behind all frames; behind all but the frame
        whose response is asked for, which has then arrived; or not at all, as some tables have
        it, though no bus can do without them.
    own_jitter : bool, default True
        Whether the response begins with the event, or when the message is queued. The deadline is
        compared with what is reported.
    arbitration_bits : int, default 1
        A message that is queued up to so many bit times after the bus went idle still takes part
        in the arbitration, 0..11.
    foreign_bits : int, default 0
        Longest frame on the bus that is not in the set, intermission included, 0..160: it may
        block every message once.

    Raises
    ------
    ArgumentError
        If a field is out of range.

    Examples
    --------
    >>> Convention(intermission="between").lengths
    'worst'
    """

    lengths: Lengths = "worst"
    intermission: Literal["everywhere", "between", "nowhere"] = "everywhere"
    own_jitter: bool = True
    arbitration_bits: int = 1
    foreign_bits: int = 0

    def __post_init__(self) -> None:
        """Check every field."""
        length_table(self.lengths)
        if self.lengths == "mean":
            raise ArgumentError("lengths is 'mean'; an average bounds no response time")
        if self.intermission not in ("everywhere", "between", "nowhere"):
            raise ArgumentError(
                f"intermission is {self.intermission!r}; it must be everywhere, between or nowhere"
            )
        if not isinstance(self.own_jitter, bool):
            raise ArgumentError(f"own_jitter is {self.own_jitter!r}; it must be True or False")
        check_whole("arbitration_bits", self.arbitration_bits, 0, 11)
        check_whole("foreign_bits", self.foreign_bits, 0, 160)


@dataclass(frozen=True, slots=True)
class ErrorModel:
    r"""How many errors hit the bus in a time, at most, and what one of them costs.

    .. math:: F(t) = n_{burst} + \left\lceil \frac{t}{T_{err}} \right\rceil - 1, \qquad
              E(t) = F(t) \left( n_{err} \tau + \max_{k \in hep(m)} C_k \right)

    Parameters
    ----------
    burst : int, default 0
        Errors that come together, 0..1e6; 1 or more if others follow.
    interval : float, default inf
        Shortest time between the errors that follow, 1e-6..1e5 [s]; infinite for none, so that
        `burst` is the number of all.
    bits : int, default 31
        Length of an error frame with intermission, 17..31 bit. The longest frame of the message's
        own or a higher priority is sent again in addition.

    Raises
    ------
    ArgumentError
        If a field is out of range.

    Notes
    -----
    The flag is 6 bits, or 12 where the flags of several nodes follow each other, the delimiter 8,
    the intermission 3: 17 to 23 bits. An error-passive node waits for 8 more: 31. The literature
    has 31 [1]_ and 29 [2]_.

    References
    ----------
    .. [1] K. Tindell, A. Burns, "Guaranteeing message latencies on Control Area Network (CAN)",
       1st International CAN Conference, 1994.
    .. [2] I. Broster, A. Burns, G. Rodriguez-Navas, "Probabilistic analysis of CAN with faults",
       23rd IEEE Real-Time Systems Symposium, 2002.

    Examples
    --------
    >>> [ErrorModel(2, 0.01).count(t) for t in (0.001, 0.01, 0.0101)]
    [2, 2, 3]
    """

    burst: int = 0
    interval: float = math.inf
    bits: int = 31

    def __post_init__(self) -> None:
        """Check every field."""
        endless = self.interval == math.inf
        check_whole("burst", self.burst, 0 if endless else 1, 10**6)
        if not (endless or 1e-6 <= self.interval <= 1e5):
            raise ArgumentError(f"interval is {self.interval!r} s; it must be 1e-6..1e5 s, or inf")
        check_whole("bits", self.bits, 17, 31)

    def count(self, time: float) -> int:
        """Return the most errors within a time [s] above 0."""
        if self.interval == math.inf:
            return self.burst
        return self.burst - 1 - -nanoseconds(time) // nanoseconds(self.interval)


#: The convention of Davis et al. 2007.
AS_USUAL = Convention()

NO_ERRORS = ErrorModel()
