"""Faults on a CAN bus: bit errors for simulations, and a bound on errors for analyses."""

from __future__ import annotations

import math
from typing import TypeAlias

from shipnet.clock import Fault
from shipnet.errors import ArgumentError
from shipnet.fields import check_fields, number, record, whole

__all__ = ["BitErrors", "ErrorAt", "ErrorBound"]
__dir__ = __all__.copy


@record
class BitErrors(Fault):
    """Random, independent bit errors while the fault lasts, for simulations.

    All nodes detect each error; the frame is destroyed at its first wrong bit and sent again.

    Examples
    --------
    >>> BitErrors(1e-4, start=1.0)
    BitErrors(start=1.0, stop=inf, rate=0.0001)
    """

    rate: float = number(0, 0.5, "", "Probability that a bit is disturbed")


@record
class ErrorAt:
    """One bit error at a given time, for simulations; between frames it has no effect.

    Examples
    --------
    >>> ErrorAt(0.2e-3)
    ErrorAt(time=0.0002)
    """

    time: float = number(0, 1e6, "s", "When the bit is disturbed")


@record
class ErrorBound:
    r"""Bound on the errors in any interval of length :math:`t`, and on the bus time that they cost.

    .. math:: F(t) = n_{burst} + \left\lceil \frac{t}{T_{interval}} \right\rceil - 1, \qquad
              E(t) = F(t) \left( n_{err} \tau + \max_{k \in hep(m)} C_k \right)

    Notes
    -----
    The default cost of 31 bits is from [1]_. Here a frame includes its intermission of 3 bits; [2]_
    excludes it, so that its 29 bits are 26 here. To reproduce its tables, use ``bits=26`` and
    ``Assumptions(intermission="between")``. The least cost, of two error flags of 6 bits and a
    delimiter of 8 bits, is 20.

    References
    ----------
    .. [1] K. Tindell, A. Burns, A. Wellings, "Calculating Controller Area Network (CAN) message
       response times", Control Engineering Practice 3, 1995.
    .. [2] I. Broster, A. Burns, G. Rodriguez-Navas, "Probabilistic analysis of CAN with faults",
       23rd IEEE Real-Time Systems Symposium, 2002.

    Examples
    --------
    >>> ErrorBound(interval=0.1, burst=2)
    ErrorBound(interval=0.1, burst=2, bits=31)
    """

    interval: float = number(
        1e-6, math.inf, "s", "Time between errors after the burst; 1e-6..1e5, or inf if none follow"
    )
    burst: int = whole(0, 10**6, "", "Number of errors in the burst at the beginning", default=1)
    bits: int = whole(
        17,
        31,
        "bit",
        "Cost of an error in addition to sending the frame again",
        default=31,
        kw_only=True,
    )

    def __post_init__(self) -> None:
        check_fields(self)
        if self.interval != math.inf and not (self.interval <= 1e5 and self.burst >= 1):
            raise ArgumentError(
                f"interval is {self.interval:g} s and burst is {self.burst}; interval must be "
                "1e-6..1e5 s with a burst of 1 or more, or inf"
            )


Simulated: TypeAlias = BitErrors | ErrorAt

NO_ERRORS = ErrorBound(math.inf, 0)  #: A bus without errors.
