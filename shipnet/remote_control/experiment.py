"""Markers and CRC compared by number of items: a comparison left to future work by chung1998."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from itertools import product
from typing import Literal

import numpy as np

from shipnet.errors import ArgumentError
from shipnet.fields import check_rng, check_scalar, check_whole
from shipnet.html import as_html
from shipnet.intervals import share_interval
from shipnet.lazy import Axes, pd
from shipnet.parallel import track
from shipnet.remote_control.packet import MOST_STUFFED, CobsFormat, MarkerFormat
from shipnet.remote_control.packet_format import Outcomes, PacketFormat
from shipnet.remote_control.system import Supervision, System

#: The ways of sending a value: only when it has changed (as printed), or in every packet.
Sending = Literal["changed", "cyclic"]

#: Checks of a packet: markers as printed, the same plus CRC-16, and CRC-16 with byte stuffing.
CHECKS = ("markers", "markers + CRC", "CRC")

_YEAR = 365 * 86400.0  #: A year of 365 days [s].

#: Assumptions of `recommend`: how many packets with wrong items the receivers may accept per year,
#: and the mean time between two moves of a switch [s].
_MOST_WRONG, _INTERVAL = 1.0, 3600.0


# Packets over a disturbed line -----------------------------------------------------------------


def check_formats(n_items: int) -> dict[str, PacketFormat]:
    """Return the packet format of each check, by its name in `CHECKS`, for 1..84 items."""
    n = check_whole("n_items", n_items, 1, MOST_STUFFED)
    formats = (MarkerFormat("A", n), MarkerFormat("A", n, crc=True), CobsFormat(n))
    return dict(zip(CHECKS, formats, strict=True))


def compare_checks(
    n_items: Iterable[int],
    rates: Iterable[float],
    *,
    packets: int = 60_000,
    rng: np.random.Generator | int | None = None,
) -> Comparison:
    """Send packets over a disturbed line, and count what each check detects and misses.

    The checks are the markers as printed, the same plus a CRC, and a CRC with byte stuffing.

    Parameters
    ----------
    n_items : iterable of int
        Numbers of items per packet, 1..84 each.
    rates : iterable of float
        Bit error rates, 0..0.5 each.
    packets : int, default 60000
        Packets per combination of check, number of items and rate, 0..1e9.
    rng : numpy.random.Generator or int, optional
        Random generator, or its seed.

    Returns
    -------
    Comparison
        The counts and the closed-form results, as a table and a figure.

    Examples
    --------
    >>> from shipnet import remote_control as rc
    >>> found = rc.compare_checks([1, 10], [1e-3], packets=20_000, rng=2024)
    >>> found.table()[["check", "n_items", "undetected"]].values.tolist()[:2]
    [['markers', 1, 468], ['markers + CRC', 1, 0]]
    """
    rates, chance, rows = list(rates), check_rng(rng), []
    for n in track(list(n_items), "numbers of items"):
        for rate in rates:
            for name, form in check_formats(n).items():
                trial = form.transmit(n, rate, packets, chance)
                low, high = share_interval(trial.undetected, packets)
                rows.append(
                    {
                        "check": name,
                        "n_items": n,
                        "bit_error_rate": rate,
                        "bytes": form.size(n),
                        "sent": int(packets),
                        "detected": trial.detected,
                        "undetected": trial.undetected,
                        "low": float(low),
                        "high": float(high),
                        "expected": form.error_shares(n, rate).undetected,
                        "missed": trial.missed,
                    }
                )
    return Comparison(pd.DataFrame(rows))


@dataclass(frozen=True, eq=False, repr=False)
class Comparison:
    """The packets that each check detects and misses, by number of items and bit error rate.

    Examples
    --------
    >>> from shipnet import remote_control as rc
    >>> rc.compare_checks([10], [1e-3], packets=20_000, rng=2024)
    Comparison(3 checks, 60000 packets, 4158 accepted with errors)
    """

    _table: pd.DataFrame

    def __repr__(self) -> str:
        table = self._table
        return (
            f"Comparison({table['check'].nunique()} checks, {table['sent'].sum()} packets, "
            f"{table['undetected'].sum()} accepted with errors)"
        )

    _repr_html_ = as_html

    def table(self) -> pd.DataFrame:
        """Return one row per combination of check, number of items and bit error rate.

        ``low`` and ``high`` are 95 % bounds of the undetected fraction, ``expected`` is that
        fraction by `MarkerFormat.error_shares`, and ``missed`` the accepted fraction of the
        disturbed packets.
        """
        return self._table.copy()

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the fraction of packets accepted with errors, at the first bit error rate.

        Lines show the theory over the number of items, and dots the counts with their bounds.
        """
        from shipnet.remote_control.plot import plot_checks

        return plot_checks(self._table, ax)


# A switch that is sent once, or repeatedly -----------------------------------------------------


def switch_staleness(
    shares: Outcomes, period: float, interval: float, sending: Sending
) -> tuple[float, float]:
    r"""Return how well a receiver follows a switch with two positions, in closed form.

    The results are the fraction of time in which the receiver shows a position other than the one
    last sent, and the mean time from a failed packet to the correct position [s].

    A packet is sent every `period` T [s]; the switch moves at random, with a mean `interval` tau
    [s]. Its position changes between packets with a probability f, which is 1 if only changes are
    sent, else

    .. math:: f = \frac{1}{2} \left( 1 - e^{-2 T / \tau} \right)

    A discarded packet (probability d) leaves the old position in place; a packet accepted with
    errors (u) replaces it with a wrong one. In the long run the fraction of wrong positions is

    .. math:: g + \frac{d f (1 - g)}{1 - d + 2 d f}, \quad g = \frac{u}{1 - d}
    """
    _, d, u = shares
    flip = 1.0 if sending == "changed" else -float(np.expm1(-2 * period / interval)) / 2
    spoiled = u / (1 - d)
    share = spoiled + d * flip * (1 - spoiled) / (1 - d + 2 * d * flip)
    if sending == "cyclic":
        return share, period / (1 - d - u)
    # An old position is correct again after the next move, even if that packet is discarded, unless
    # it is accepted with errors; a wrong position is corrected only by a correct packet.
    spoiled_moves = 1 / (1 - d - u)
    old_moves = 1 + u * spoiled_moves
    moves = (d * old_moves + u * spoiled_moves) / (d + u) if d + u else 1.0
    return share, interval * moves


# Recommendation --------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Recommendation:
    """The recommended way to send a number of values, and why.

    `sending` is "changed" or "cyclic"; RCS ends a turn without a response after `turn_timeout` [s];
    `refresh_time` is the mean time to receive every value once [s]; `wrong_per_year` counts packets
    accepted with errors (an upper estimate if byte-stuffed); `stale_time` is the mean time for
    which a switch position is wrong after a failed packet [s].
    """

    check: str
    sending: Sending
    per_packet: int
    turn_timeout: float
    refresh_time: float
    wrong_per_year: float
    stale_time: float
    why: str

    def __str__(self) -> str:
        return (
            f"{self.check}, {self.sending}, {self.per_packet} items per packet: "
            f"{self.refresh_time * 1e3:.0f} ms for all values"
        )


def candidates(n_items: int, system: System, rate: float, stale_time: float) -> pd.DataFrame:
    """Return one row per way to send 1..84 values per station, for comparison by `recommend`.

    A discarded packet also delays the cycle until the turn ends, but affects no other packet. Ways
    in which a turn would end before the response arrives are left out. If the items are split among
    several packets, all are as long as the longest, and each cycle carries only one of them per
    link and direction, so that updating all values takes as many cycles as there are packets. If
    only changes are sent, packets are as long as with all items, but fail as often as with one.
    """
    n = check_whole("n_items", n_items, 1, MOST_STUFFED)
    p = check_scalar("rate", rate, "", 0, 0.1)
    longest_stale = check_scalar("stale_time", stale_time, "s", 1e-3, 1e9)
    rule = Supervision.intended()
    base = replace(system, repeat=0, slave=rule)
    rows = []
    for name, per_packet in product(CHECKS, range(1, n + 1)):
        form = check_formats(per_packet)[name]
        link = replace(base, packet_format=form)
        cycle = link.cycle_time
        timeout = cycle / 2 if base.turn_timeout is None else base.turn_timeout
        # A lost response delays the cycle by this time. If a turn ends before the response arrives,
        # nothing is received at all.
        longer = timeout - cycle / 4
        if longer <= 0:
            continue
        ways: tuple[Sending, ...] = ("changed", "cyclic") if per_packet == n else ("cyclic",)
        for sending in ways:
            # If only changes are sent, one packet with one item per move of the switch, else four
            # packets per cycle.
            changed = sending == "changed"
            shares = form.error_shares(1 if changed else per_packet, p)
            packets = 1 / _INTERVAL if changed else 4 / cycle
            accepted = 1 - shares.detected - shares.undetected
            # Each of the four packets of a cycle may be discarded, which causes a wait.
            period = -(-n // per_packet) * (cycle + 4 * shares.detected * longer)
            stale = switch_staleness(shares, period, _INTERVAL, sending)[1]
            rows.append(
                {
                    "check": name,
                    "sending": sending,
                    "per_packet": per_packet,
                    "bytes": form.size(per_packet),
                    "cycle_s": cycle,
                    "turn_timeout_s": timeout,
                    "refresh_s": period / accepted,
                    "wrong_per_year": _YEAR * packets * shares.undetected,
                    "stale_s": stale + (0.0 if changed else longer / accepted),
                    "counted_s": link.counted_time,
                }
            )
    if not rows:
        raise ArgumentError("turn_timeout is shorter than the shortest response, that of one item")
    table = pd.DataFrame(rows)
    table["errors_ok"] = table["wrong_per_year"] <= _MOST_WRONG
    table["stale_ok"] = table["stale_s"] <= longest_stale
    table["alarm_ok"] = table["counted_s"] <= rule.detection_time[0]
    table["meets"] = table[["errors_ok", "stale_ok", "alarm_ok"]].all(axis=1)
    return table


def recommend(
    n_items: int, system: System | None = None, *, rate: float = 1e-5, stale_time: float = 3.0
) -> Recommendation:
    """Return the recommended way to send a number of values: the fastest that meets all limits.

    The limits are ours; the paper states none. Receivers may accept at most one packet with
    wrong items per year, a switch moves once per hour on average, and ``Supervision.intended()``
    must not raise an alarm in a healthy link.

    Parameters
    ----------
    n_items : int
        Number of values that each station sends, 1..84.
    system : System, optional
        Only bit rate, character, processing and ``turn_timeout`` are used; by default the paper's
        link. Without a ``turn_timeout``, a turn ends after half a cycle, twice the time of a
        response; with the printed wait until the counters reach the limit, a wrong position would
        be shown for up to 4.4 s longer.
    rate : float, default 1e-5
        Bit error rate, 0..0.1; our assumption, because the paper states none.
    stale_time : float, default 3
        Longest mean time for which a switch may be shown in a wrong position after a failed packet,
        1e-3..1e9 [s], including the wait of RCS for the lost response; the default equals the time
        for which a failed partner may go unnoticed.

    Returns
    -------
    Recommendation
        The check, "changed" or "cyclic" sending and the items per packet with which all values are
        received once in the shortest mean time, and ``why``.

    Raises
    ------
    ArgumentError
        If an argument is out of range, or no candidate meets the limits; the message says how many
        candidates fail each limit.

    Examples
    --------
    At 600 bit/s, 40 items must be split:

    >>> from shipnet import remote_control as rc
    >>> print(rc.recommend(10))
    CRC, cyclic, 10 items per packet: 142 ms for all values
    >>> print(rc.recommend(40, rc.System(bit_rate=600), stale_time=20))
    CRC, cyclic, 10 items per packet: 9116 ms for all values
    """
    table = candidates(n_items, system or System(), rate, stale_time)
    good = table[table["meets"]]
    if good.empty:
        failed = (~table[["errors_ok", "stale_ok", "alarm_ok"]]).sum().astype(int)
        raise ArgumentError(
            f"n_items is {n_items}: of {len(table)} ways to send them, {failed['errors_ok']} let "
            f"too many errors pass, {failed['stale_ok']} show a wrong position for too long, and "
            f"{failed['alarm_ok']} raise false alarms"
        )
    best = good.sort_values("refresh_s", kind="stable").iloc[0].to_dict()
    markers = table[(table["check"] == "markers") & (table["per_packet"] == best["per_packet"])]
    most = "at most about " if best["check"] == "CRC" else ""
    why = (
        f"markers alone would accept {markers['wrong_per_year'].max():.2g} wrong packets per year, "
        f"and this choice {most}{best['wrong_per_year']:.2g}; a switch is correct again "
        f"{best['stale_s']:.2g} s after a failed packet on average, if RCS ends a turn without a "
        f"response after {best['turn_timeout_s']:.2g} s"
    )
    return Recommendation(
        best["check"],
        best["sending"],
        best["per_packet"],
        best["turn_timeout_s"],
        best["refresh_s"],
        best["wrong_per_year"],
        best["stale_s"],
        why,
    )
