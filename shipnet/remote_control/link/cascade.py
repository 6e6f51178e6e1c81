"""The failure that spreads: RCS waits for a dead SS, and BCS takes RCS as failed as well."""

from __future__ import annotations

from math import ceil, floor
from typing import NamedTuple

from shipnet.errors import ArgumentError
from shipnet.remote_control.link.system import System
from shipnet.remote_control.link.timing import NEVER, counted_parts, packet_time

__all__ = ["Cascade", "cascade"]


class Cascade(NamedTuple):
    """What BCS sees while RCS waits for a dead SS.

    The pairs of times hold for the first turn of an SS that died while it was silent, and go from
    the shortest to the longest, as the timers stand.

    Attributes
    ----------
    wait : tuple of float
        How long RCS waits for an answer [s].
    quiet : tuple of float
        Time that BCS hears nothing, from its last byte to the next 0xDD [s].
    counted : tuple of float
        Time that its counters run without a 0xDD [s].
    longest : float
        Bound of the time that BCS hears nothing [s], over every moment of death and all later
        turns. An SS that dies inside its answer leaves half a packet in the ring of RCS, which
        can spoil the answer of BCS: RCS then waits for both, one after the other.
    alarm : str
        Whether BCS takes RCS, which is alive, as failed too: "certain" (at the first turn
        already), "possible" (as the timers stand and as SS dies, or later) or "never", whenever SS
        dies.
    """

    wait: tuple[float, float]
    quiet: tuple[float, float]
    counted: tuple[float, float]
    longest: float
    alarm: str


def cascade(system: System, n_items: int | None = None) -> Cascade:
    r"""Return what BCS sees when SS dies.

    .. math:: T_q' = t + P + W + b \, t_c

    with a wait W of RCS that ends when its counters run out, or with its turn. If half an answer
    spoils that of BCS as well, RCS waits twice.

    Parameters
    ----------
    system : System
        The link.
    n_items : int, optional
        Items of every packet; all if omitted.

    Returns
    -------
    Cascade
        Times of the first turn, a bound for all, and whether there is a false alarm.

    Raises
    ------
    ArgumentError
        If a packet has no 0xDD, so that the link fails in health.

    Notes
    -----
    The counters of RCS hold what they had counted for SS since its last 0xDD, so that the wait is
    a little shorter than the time to detect a failure; if SS dies behind the 0xDD of an answer,
    it is longer by what came before. `longest` takes it that half an answer always spoils that of
    BCS; it often does not.

    That BCS is not alarmed does not keep the failure at SS: with half an answer in its ring RCS
    can take BCS, which is alive, as failed, unless its turn ends before the counters run out.

    Examples
    --------
    As printed, in health of RCS and BCS; then with a limit of RCS that is shorter; then with a
    turn that ends after 0.2 s:

    >>> cascade(System(bit_rate=600)).alarm
    'certain'
    >>> from shipnet.remote_control.link.supervision import Supervision
    >>> cascade(System(bit_rate=600, master=Supervision(miss_limit=0))).alarm
    'never'
    >>> seen = cascade(System(turn_timeout=0.2))
    >>> seen.alarm, [round(t, 3) for t in seen.quiet]
    ('never', [0.236, 0.236])
    """
    rest, sending, quiet = counted_parts(system, n_items)
    if quiet == NEVER:
        raise ArgumentError("packets without items have no 0xDD: the link fails in health")
    packet, process, rule = packet_time(system, n_items), system.processing, system.master
    # RCS has counted for SS since its last 0xDD: now and then, or without a break.
    if rule.while_sending:
        before = (3 * packet + 2 * process + rest) / rule.tick
        ticks = (rule.n_ticks - before - 1, rule.n_ticks - before)
    else:
        ticks = (rule.n_ticks - ceil(rest / rule.tick) - 1, rule.n_ticks - floor(rest / rule.tick))
    wait = (max(ticks[0], 0) * rule.tick, max(ticks[1], 0) * rule.tick)
    if system.turn_timeout is not None:
        wait = (min(wait[0], system.turn_timeout), min(wait[1], system.turn_timeout))
    first = quiet - 2 * packet - 3 * process
    silent = (process + packet + wait[0] + first, process + packet + wait[1] + first)
    counted = (silent[0] + rest + sending, silent[1] + rest + sending)
    # SS dies behind its last 0xDD: RCS counts anew from there. Later, it waits for BCS as well.
    again = rule.n_ticks * rule.tick
    # Rest is the end of a packet behind its last 0xDD, and the work on it.
    anew = again + packet + 2 * process - rest
    if system.turn_timeout is not None:
        anew, again = min(anew, system.turn_timeout), min(again, system.turn_timeout)
    longest = first + max(process + packet + anew, anew - process + again)
    limit, tick = system.slave.n_ticks, system.slave.tick
    if floor((rest + sending) / tick) + floor(silent[0] / tick) >= limit:
        alarm = "certain"
    else:
        possible = ceil((rest + sending) / tick) + ceil(longest / tick) >= limit
        alarm = "possible" if possible else "never"
    return Cascade(wait, silent, counted, longest, alarm)
