"""What lost telegrams do to a cycle: repetitions, slaves that are dropped, and how often.

A master repeats a failed exchange once, at once; a slave that fails so in three cycles in a row is
dropped. An analyser counts *series*: exchanges with one slave that fail in a row, 1 to 6 of them,
the sixth being the drop.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pandas as pd

from shipnet.asi.emc.fast_transient import PACKET_LENGTH, PACKET_PERIOD
from shipnet.asi.timing import Transaction
from shipnet.errors import ArgumentError
from shipnet.fields import check_scalar, check_whole

__all__ = ["CYCLES", "TRIES", "cycle_effect", "error_series"]

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

    Parameters
    ----------
    rate : float or array_like of float, shape (n_rates,)
        Probability p that an exchange fails, 0..1. An exchange is lost with its request or with
        its response: 1 - (1 - a)(1 - b) with their telegram error rates a and b.
    slaves : int, default 31
        Slaves asked in a cycle, 1..31.
    cycle_time : float, default 5e-3
        Time from one exchange with a slave to the next, without repetitions, above 0 [s].

    Returns
    -------
    pandas.DataFrame
        One row a rate: ``rate``; ``repetitions_per_s`` of the whole network; ``cycle_failure``,
        that both tries of a cycle fail; ``three_cycles``, that three given cycles in a row do;
        ``between_drops_s``, mean time between drops of one slave, infinite where none fails;
        ``drops_per_h`` of the whole network.

    Raises
    ------
    ArgumentError
        If an argument is not as said above.

    Notes
    -----
    Independence is assumed, and holds for white noise. It does not for bursts: a packet lasts as
    long as three undisturbed cycles and meets a slave several times in a row. `error_series` shows
    how much more often slaves are dropped then, at the same mean rate.

    T is the mean waiting time for three failures in a row. A slave that was dropped is taken to
    be back at once.

    References
    ----------
    .. [1] W. Feller, "An Introduction to Probability Theory and Its Applications", vol. 1, 3rd
       ed., 1968, section XIII.7.

    Examples
    --------
    A tenth of all exchanges costs 620 repetitions a second, and each slave is dropped once in
    84 minutes:

    >>> effect = cycle_effect([0.01, 0.1]).set_index("rate")
    >>> effect["repetitions_per_s"].round().tolist()
    [62.0, 620.0]
    >>> f"{effect.loc[0.1, 'between_drops_s'] / 60:.0f} min"
    '84 min'
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
    """Lay packets of a burst over the cycles of a network and count exchanges that fail in a row.

    Parameters
    ----------
    inside : float
        Probability that an exchange fails while a packet lasts, 0..1; outside none fails.
    rng : numpy.random.Generator
        Source of the random numbers.
    n_packets : int, default 1000
        Packets to lay, each at another moment of a cycle, 1 or more.
    slaves : int, default 31
        Slaves asked in a cycle, 1..31.
    transaction : Transaction, optional
        Length of an exchange; 156 us if omitted.
    packet_length, packet_period : float, default 15e-3 and 300e-3
        Length of a packet, 0..10, and time from one to the next, longer than that, up to 1e6 [s].

    Returns
    -------
    pandas.DataFrame
        One row a length of series, ``failures`` 1..6: ``series``, how many were seen;
        ``per_packet``; ``per_h``, with a packet every `packet_period`. The sixth failure in a row
        drops the slave.

    Raises
    ------
    ArgumentError
        If an argument is not as said above.

    Notes
    -----
    A cycle is one exchange with each slave and two more slots; a repetition lengthens it. An
    exchange is in a packet if any part of it is. Inside a packet exchanges fail independently of
    each other, which takes the pulses of a packet for more random than they are. A slave that was
    dropped is taken to be back in its next cycle. All of this is a model: AS-i masters differ.

    Examples
    --------
    A third of the exchanges of a packet fail, which over the whole test is one in 60. If these
    failed independently, a slave would be dropped every 87 days. Packets do it twice a minute:

    >>> effect = cycle_effect(1 / 60).iloc[0]
    >>> f"{1 / effect['drops_per_h'] / 24:.0f} days"
    '87 days'
    >>> table = error_series(1 / 3, np.random.default_rng(2024), 40_000).set_index("failures")
    >>> f"{table.loc[6, 'per_h'] / 60:.1f} a minute"
    '1.7 a minute'

    Repetitions lengthen a cycle, so that a packet meets fewer of them. Where all fail, a cycle of
    31 slaves takes 10 ms, and no packet of 15 ms meets three tries in a row:

    >>> error_series(1.0, np.random.default_rng(2024), 1000)["series"].iloc[-1].item()
    0
    """
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
