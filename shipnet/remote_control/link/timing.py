"""How long the link takes in health, in closed form: packets, cycles, silences.

Everything is for a link without bit errors in which every packet has the same number of items.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from shipnet.errors import ArgumentError
from shipnet.fields import check_scalar
from shipnet.remote_control.link.supervision import MEANT, PRINTED
from shipnet.remote_control.link.system import BIT_RATES, System

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["NEVER", "counted_parts", "counted_time", "cycle_time", "fill_time", "most_items"]
__all__ += ["most_ticks", "packet_time", "quiet_time", "timing_table", "worst_age"]

#: Time until something that never happens [s].
NEVER = float("inf")


def packet_time(system: System, n_items: int | None = None) -> float:
    """Return how long a packet is on the line [s].

    Parameters
    ----------
    system : System
        The link.
    n_items : int, optional
        How many items it has; all if omitted.

    Returns
    -------
    float
        Time from the first bit to the last [s].

    Examples
    --------
    Ten items in 33 bytes of 10 bits at 9600 bit/s:

    >>> round(packet_time(System()) * 1e3, 2)
    34.38
    """
    n = system.n_items if n_items is None else n_items
    return system.packet_format.size(n) * system.character_time


def cycle_time(system: System, n_items: int | None = None) -> float:
    r"""Return how long RCS takes to exchange packets with both slaves [s].

    .. math:: T = 4 (P + t)

    with packets of length P, each worked on for a time t.

    Parameters
    ----------
    system : System
        The link.
    n_items : int, optional
        Items of every packet; all if omitted.

    Returns
    -------
    float
        Time from one packet to BCS to the next [s].

    Examples
    --------
    >>> [round(cycle_time(System(bit_rate=rate)), 4) for rate in (9600, 600)]
    [0.1375, 2.2]
    """
    return 4 * (packet_time(system, n_items) + system.processing)


def quiet_time(system: System, n_items: int | None = None) -> float:
    r"""Return how long a slave hears nothing in health, from its last byte to the next 0xDD [s].

    .. math:: T_q = 2 P + 3 t + b \, t_c

    with b bytes of the length t_c up to the first 0xDD.

    Parameters
    ----------
    system : System
        The link.
    n_items : int, optional
        Items of every packet; all if omitted.

    Returns
    -------
    float
        Time [s]; infinite if a packet has no 0xDD.

    Examples
    --------
    At 600 bit/s; and a packet of reading B without any item:

    >>> round(quiet_time(System(bit_rate=600)), 3)
    1.133
    >>> from shipnet.remote_control.packet import Markers
    >>> quiet_time(System(Markers("B"), bit_rate=600), n_items=0)
    inf
    """
    signs = system.signs_of_life(system.n_items if n_items is None else n_items)
    if not signs:
        return NEVER
    first = (signs[0] + 1) * system.character_time
    return 2 * packet_time(system, n_items) + 3 * system.processing + first


def counted_time(system: System, n_items: int | None = None) -> float:
    r"""Return the longest time that the counters of a slave run without a 0xDD in health [s].

    They also run while the rest of a packet comes in and is worked on, but not while the slave
    sends:

    .. math:: T_c = \left( P - b_l \, t_c \right) + t + T_q

    with b_l bytes up to the last 0xDD of a packet. The time on the clock is longer by P, and so
    is the result if the slave's rule counts ``while_sending``.

    Parameters
    ----------
    system : System
        The link.
    n_items : int, optional
        Items of every packet; all if omitted.

    Returns
    -------
    float
        Time [s]; infinite if a packet has no 0xDD.

    Examples
    --------
    Half as much again as the quiet time:

    >>> round(counted_time(System(bit_rate=600)), 3)
    1.65
    """
    return sum(counted_parts(system, n_items))


def counted_parts(system: System, n_items: int | None = None) -> tuple[float, float, float]:
    """Return the parts of `counted_time`.

    Parameters
    ----------
    system : System
        The link.
    n_items : int, optional
        Items of every packet; all if omitted.

    Returns
    -------
    tuple of float
        Time behind the last 0xDD of a packet with the work on it; own packet, 0 unless the rule
        counts ``while_sending``; quiet time [s].

    Examples
    --------
    >>> [round(part, 3) for part in counted_parts(System(bit_rate=600))]
    [0.517, 0.0, 1.133]
    """
    n = system.n_items if n_items is None else n_items
    signs, packet = system.signs_of_life(n), packet_time(system, n)
    if not signs:
        return 0.0, 0.0, NEVER
    rest = packet - (signs[-1] + 1) * system.character_time + system.processing
    sending = packet if system.slave.while_sending else 0.0
    return rest, sending, quiet_time(system, n)


def most_ticks(system: System, n_items: int | None = None) -> float:
    """Return how many ticks a slave counts at most between two 0xDD in health.

    Parameters
    ----------
    system : System
        The link.
    n_items : int, optional
        Items of every packet; all if omitted.

    Returns
    -------
    float
        A whole number, or infinity; with ``system.slave.n_ticks`` or more there is an alarm in a
        healthy link, if the timer stands badly.

    Notes
    -----
    The ticks within the counted stretches are counted for every way the timer can stand to them
    that makes a difference.

    Examples
    --------
    >>> most_ticks(System(bit_rate=600)), PRINTED.miss_ticks, PRINTED.n_ticks
    (17, 11, 44)
    """
    rest, sending, quiet = counted_parts(system, n_items)
    if quiet == NEVER:
        return NEVER
    tick, gap = system.slave.tick, packet_time(system, n_items) - sending
    stretches = [(0.0, rest + sending), (rest + sending + gap, rest + sending + gap + quiet)]
    edges = np.array(stretches) / tick
    # Just before an end and just behind a beginning, the count is at its most.
    phases = np.concatenate([edges.reshape(-1) - 1e-9, edges.reshape(-1) + 1e-9])
    inside = np.floor(edges[:, 1] - phases[:, None]) - np.floor(edges[:, 0] - phases[:, None])
    return int(inside.sum(axis=1).max())


def most_items(
    system: System,
    limit: float,
    *,
    of: Callable[[System], float] = counted_time,
) -> int:
    """Return with how many items a time of a healthy link stays within a limit.

    Parameters
    ----------
    system : System
        The link; its number of items does not matter.
    limit : float
        Longest time, 0..3600 [s].
    of : callable, default counted_time
        Which time: a function of a system, such as `quiet_time` or `cycle_time`, that grows with
        the number of items.

    Returns
    -------
    int
        The most items, up to what the format's numbers allow.

    Raises
    ------
    ArgumentError
        If not even one item stays within the limit.

    Examples
    --------
    3 seconds at 600 bit/s, for both readings of the packet:

    >>> from shipnet.remote_control.packet import Markers
    >>> slow = [System(Markers(reading), bit_rate=600) for reading in "AB"]
    >>> [most_items(system, 3.0, of=quiet_time) for system in slow]
    [28, 21]
    >>> [most_items(system, 3.0) for system in slow]
    [19, 21]
    """
    longest = check_scalar("limit", limit, "s", 0, 3600)

    packet_format: Any = system.packet_format

    def at(n: int) -> float:
        one = replace(packet_format, n_numbers=n)
        return of(replace(system, packet_format=one, repeat=min(system.repeat, n)))

    most = 0
    while True:
        try:
            within = at(most + 1) <= longest * (1 + 1e-12)
        except ArgumentError:
            break
        if not within:
            break
        most += 1
    if most == 0:
        raise ArgumentError(f"limit is {limit:g} s; one item takes {at(1):g} s")
    return most


def fill_time(system: System) -> float:
    """Return how long unbroken reception takes to fill the receive ring [s].

    Parameters
    ----------
    system : System
        The link.

    Returns
    -------
    float
        Time [s].

    Examples
    --------
    >>> round(fill_time(System()), 4), round(fill_time(System(bit_rate=600)), 2)
    (0.1333, 2.13)
    """
    return system.ring_size * system.character_time


def worst_age(system: System, *, hops: int = 2, n_items: int | None = None) -> float:
    r"""Return how old a value can be, at most, when its reader gets it in health [s].

    .. math:: T_a = T + h (P + t)

    It changes just after the packet was made that could have carried it, waits a cycle T, and
    takes h hops.

    Parameters
    ----------
    system : System
        The link.
    hops : {2, 1}
        2 from one slave to the other, 1 to or from RCS.
    n_items : int, optional
        Items of every packet; all if omitted.

    Returns
    -------
    float
        Time from the change to the end of the reader's work on the packet [s].

    Raises
    ------
    ArgumentError
        If there are no such hops.

    Examples
    --------
    A switch on the bridge, to the safety system, at 9600 and at 600 bit/s:

    >>> [round(worst_age(System(bit_rate=rate)), 3) for rate in (9600, 600)]
    [0.206, 3.3]
    """
    if hops not in (1, 2):
        raise ArgumentError(f"hops is {hops!r}; it must be 1 or 2")
    return (4 + hops) * (packet_time(system, n_items) + system.processing)


def timing_table(system: System, bit_rates: Iterable[float] = BIT_RATES) -> pd.DataFrame:
    """Return the times of a link by bit rate, all items sent.

    Parameters
    ----------
    system : System
        The link; its bit rate does not matter.
    bit_rates : iterable of float, optional
        Bit rates [bit/s]; those of chung1998 if omitted.

    Returns
    -------
    pandas.DataFrame
        A row a bit rate: ``bit_rate``, ``packet_s``, ``cycle_s``, ``quiet_s``, ``counted_s``,
        ``fill_s``, ``age_s`` (two hops), ``ticks`` (most in health), ``printed_margin`` and
        ``meant_margin``: ticks that are left before the alarm by either rule.

    Examples
    --------
    >>> table = timing_table(System())[["cycle_s", "quiet_s", "ticks", "printed_margin"]]
    >>> table.iloc[[0, -1]].round(3).values.tolist()
    [[0.138, 0.071, 2.0, 42.0], [2.2, 1.133, 17.0, 27.0]]
    """
    import pandas as pd

    rows = []
    for rate in bit_rates:
        one = replace(system, bit_rate=rate)
        ticks = most_ticks(one)
        rows.append(
            {
                "bit_rate": rate,
                "packet_s": packet_time(one),
                "cycle_s": cycle_time(one),
                "quiet_s": quiet_time(one),
                "counted_s": counted_time(one),
                "fill_s": fill_time(one),
                "age_s": worst_age(one),
                "ticks": ticks,
                "printed_margin": PRINTED.n_ticks - ticks,
                "meant_margin": MEANT.n_ticks - ticks,
            }
        )
    return pd.DataFrame(rows)
