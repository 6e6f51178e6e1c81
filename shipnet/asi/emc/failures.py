"""What lost telegrams do to a cycle: repetitions, slaves that are dropped, and how often.

A master repeats a failed exchange once, at once; a slave that fails so in three cycles in a row is
dropped. An analyser counts *series*: exchanges with one slave that fail in a row, 1 to 6 of them,
the sixth being the drop.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pandas as pd

from shipnet.asi.emc.disturbances import PACKET_LENGTH, PACKET_PERIOD
from shipnet.asi.timing import Transaction
from shipnet.errors import ArgumentError
from shipnet.fields import check_scalar, check_whole

#: Exchanges with a slave in a cycle, the repetition counted; failed cycles in a row that drop it.
#: Beckhoff, EL6201: three data exchange phases in a row; Siemens, AS-i analyser: six exchanges.
TRIES, CYCLES = 2, 3

#: Slots of a cycle beside those of the slaves: management and inclusion, after OMRON W357.
_EXTRA = 2


def cycle_effect(
    rate: npt.ArrayLike, *, slaves: int = 31, cycle_time: float = 5e-3
) -> pd.DataFrame:
    r"""Return what exchanges that fail independently of each other do to a network.

    .. math:: q = p^2, \qquad T = T_c \left(\frac{1}{q} + \frac{1}{q^2} + \frac{1}{q^3}\right)
    """
    p = np.atleast_1d(np.asarray(rate))
    if p.ndim != 1 or p.dtype.kind not in "iuf" or not ((p >= 0) & (p <= 1)).all():
        raise ArgumentError(f"rate is {rate!r}; it must be one probability or a row, 0..1")
    slaves = check_whole("slaves", slaves, 1, 31)
    cycle_time = check_scalar("cycle_time", cycle_time, "s", 1e-6, 1e6)
    p = p.astype(float)
    failure = p**TRIES
    with np.errstate(divide="ignore", over="ignore"):
        between = cycle_time * (failure[:, np.newaxis] ** -np.arange(1.0, CYCLES + 1)).sum(axis=1)
    return pd.DataFrame(
        {
            "rate": p,
            "repetitions_per_s": slaves * p / cycle_time,
            "cycle_failure": failure,
            "three_cycles": failure**CYCLES,
            "between_drops_s": between,
            "drops_per_h": slaves * 3600 / between,
        }
    )


def error_series(
    inside: float,
    rng: np.random.Generator,
    n_packets: int = 1000,
    *,
    slaves: int = 31,
    transaction: Transaction | None = None,
    packet_length: float = PACKET_LENGTH,
    packet_period: float = PACKET_PERIOD,
) -> pd.DataFrame:
    """Lay packets of a burst over the cycles of a network and count failures in a row."""
    inside = check_scalar("inside", inside, "of the exchanges", 0, 1)
    n_packets = check_whole("n_packets", n_packets, 1, 2**31)
    slaves = check_whole("slaves", slaves, 1, 31)
    packet_length = check_scalar("packet_length", packet_length, "s", 0, 10)
    packet_period = check_scalar("packet_period", packet_period, "s", 0, 1e6)
    if packet_period <= packet_length:
        raise ArgumentError(
            f"packet_period is {packet_period:g} s; it must be longer than the packet of "
            f"{packet_length:g} s"
        )
    slot = (transaction or Transaction()).duration
    most = TRIES * CYCLES
    counts = np.zeros(most + 1, dtype=np.int64)
    in_a_row = np.zeros((slaves, n_packets), dtype=np.intp)
    # The packets begin at 0, each somewhere in a cycle that began before it.
    t = -rng.uniform(0, (slaves + _EXTRA) * slot, n_packets)
    while (t < packet_length).any():
        for series in in_a_row:
            asked = np.full(n_packets, True)
            for _ in range(TRIES):
                hit = (t < packet_length) & (t + slot > 0)
                failed = asked & hit & (rng.random(n_packets) < inside)
                t += slot * asked
                over = asked & ~failed
                counts += np.bincount(series[over], minlength=most + 1)
                series[over] = 0
                series += failed
                asked = failed
            dropped = series == most
            counts[most] += np.count_nonzero(dropped)
            series[dropped] = 0
        t += _EXTRA * slot
    # Behind the packet the next exchange succeeds and ends what is still open.
    counts += np.bincount(in_a_row.ravel(), minlength=most + 1)
    per_packet = counts[1:] / n_packets
    return pd.DataFrame(
        {
            "failures": np.arange(1, most + 1),
            "series": counts[1:],
            "per_packet": per_packet,
            "per_h": per_packet * 3600 / packet_period,
        }
    )
