"""What lost telegrams do to a cycle: repetitions, slaves that are dropped, and how often.

A master repeats a failed exchange once, at once; a slave that fails so in three cycles in a row is
dropped. An analyser counts *series*: exchanges with one slave that fail in a row, 1 to 6 of them,
the sixth being the drop.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pandas as pd

from shipnet.asi.cycle import Cycle
from shipnet.asi.emc.disturbances import PACKET_LENGTH, PACKET_PERIOD
from shipnet.asi.receiver import RNGLike
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


def independent_failures(p: npt.ArrayLike, cycle: Cycle | None = None) -> pd.DataFrame:
    r"""Return what exchanges that fail independently of each other do to a network.

    .. math:: q = p^2, \qquad T = T_c \left(\frac{1}{q} + \frac{1}{q^2} + \frac{1}{q^3}\right)

    Parameters
    ----------
    p : float or array_like of float, shape (n,)
        Probability that an exchange fails, 0..1.
    cycle : Cycle, default ``Cycle(31)``
        The cycle, of 1 to 31 slaves.

    Returns
    -------
    pandas.DataFrame
        One row per probability: ``rate``; ``repetitions_per_s``; ``cycle_failure`` q, both tries
        of a slave fail; ``three_cycles``, in three cycles in a row; ``between_drops_s`` T, mean
        time until a slave is dropped; ``drops_per_h`` of all slaves.

    Raises
    ------
    ArgumentError
        If a probability is not 0..1, or the cycle does not have 1 to 31 slaves.

    Examples
    --------
    >>> effect = independent_failures(1 / 60).iloc[0]
    >>> f"{1 / effect['drops_per_h'] / 24:.0f} days"
    '90 days'
    """
    cycle = cycle or Cycle(31)
    return cycle_effect(p, slaves=int(np.asarray(cycle.slaves)), cycle_time=float(cycle.time))


def burst_failures(
    inside: float,
    rng: RNGLike | None = None,
    packets: int = 1000,
    *,
    slaves: int = 31,
    transaction: Transaction | None = None,
    packet_length: float = PACKET_LENGTH,
    packet_period: float = PACKET_PERIOD,
) -> pd.DataFrame:
    """Lay packets of a burst over the cycles of a network and count failures in a row.

    Parameters
    ----------
    inside : float
        Probability that an exchange fails while a packet lasts, 0..1; outside none fails.
    rng : numpy.random.Generator or int, optional
        Source of the random numbers, as `numpy.random.default_rng` takes it.
    packets : int, default 1000
        Packets to lay, each at another moment of a cycle, 1 or more.
    slaves : int, default 31
        Slaves asked in a cycle, 1..31.
    transaction : Transaction, optional
        Length of an exchange; 156 us if omitted.
    packet_length, packet_period : float, default 15e-3 and 300e-3
        Length of a packet, 0..10, and time from one to the next, longer than that [s].

    Returns
    -------
    pandas.DataFrame
        One row per length of series, ``failures`` 1..6: ``series``, how many were seen;
        ``per_packet``; ``per_h``. The sixth failure in a row drops the slave.

    Raises
    ------
    ArgumentError
        If an argument is out of its range.

    Notes
    -----
    Inside a packet exchanges fail independently of each other, which takes the pulses of a packet
    for more random than they are. A slave that was dropped is taken to be back in its next cycle.

    Examples
    --------
    A third of the exchanges of a packet fail, which over the whole test is one in 60. If these
    failed independently, a slave would be dropped every 90 days. Packets do it twice a minute:

    >>> table = burst_failures(1 / 3, 2024, 40_000).set_index("failures")
    >>> f"{table.loc[6, 'per_h'] / 60:.1f} a minute"
    '1.7 a minute'
    """
    return error_series(
        inside, np.random.default_rng(rng), packets,
        slaves=slaves, transaction=transaction,
        packet_length=packet_length, packet_period=packet_period,
    )  # fmt: skip
