"""Markers and CRC compared by number of items: a comparison left to future work by chung1998."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Literal, NamedTuple

import numpy as np

from shipnet.errors import ArgumentError
from shipnet.fields import check_rng, check_scalar, check_whole
from shipnet.intervals import share_interval
from shipnet.lazy import Axes, pd
from shipnet.remote_control.packet import MOST_STUFFED, CobsFormat, MarkerFormat
from shipnet.remote_control.packet_format import PacketFormat, Shares
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
    for n in n_items:
        for rate in rates:
            for name, form in check_formats(n).items():
                trial = form.transmit(n, rate, packets, chance)
                low, high = share_interval(trial.undetected, trial.sent)
                lost = trial.detected / trial.sent if trial.sent else np.nan
                rows.append(
                    (
                        name,
                        n,
                        rate,
                        form.size(n),
                        trial.sent,
                        trial.detected,
                        trial.undetected,
                        float(low),
                        float(high),
                        form.error_shares(n, rate).undetected,
                        trial.missed,
                        lost,
                    )
                )
    return Comparison(tuple(rows))


_COLUMNS = (
    "check",
    "n_items",
    "bit_error_rate",
    "bytes",
    "sent",
    "detected",
    "undetected",
    "low",
    "high",
    "expected",
    "missed",
    "items_lost",
)


@dataclass(frozen=True, repr=False)
class Comparison:
    """The packets that each check detects and misses, by number of items and bit error rate.

    Examples
    --------
    >>> from shipnet import remote_control as rc
    >>> rc.compare_checks([10], [1e-3], packets=20_000, rng=2024)
    Comparison(3 checks, 60000 packets, 4158 accepted with errors)
    """

    _rows: tuple[tuple[object, ...], ...]

    def __repr__(self) -> str:
        table = self.table()
        if table.empty:
            return "Comparison(no packets)"
        return (
            f"Comparison({table['check'].nunique()} checks, {table['sent'].sum()} packets, "
            f"{table['undetected'].sum()} accepted with errors)"
        )

    def table(self) -> pd.DataFrame:
        """Return one row per combination of check, number of items and bit error rate.

        ``low`` and ``high`` are 95 % bounds of the undetected fraction, ``expected`` is that
        fraction by `MarkerFormat.error_shares`, ``missed`` the accepted fraction of the disturbed
        packets, and ``items_lost`` the fraction of items in discarded packets.
        """
        return pd.DataFrame(list(self._rows), columns=list(_COLUMNS))

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the fraction of packets accepted with errors, at the first bit error rate.

        Lines show the theory over the number of items, and dots the counts with their bounds.
        """
        from shipnet.remote_control.plot import plot_checks

        return plot_checks(self.table(), ax)


# A switch that is sent once, or repeatedly -----------------------------------------------------


class Staleness(NamedTuple):
    """How well a receiver follows a switch with two positions.

    `share` is the fraction of time in which the receiver shows a position other than the one last
    sent; `duration` is the mean time from a failed packet to the correct position [s].
    """

    share: float
    duration: float


def switch_staleness(shares: Shares, period: float, interval: float, sending: Sending) -> Staleness:
    r"""Return how well a receiver follows a switch, in closed form.

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
        return Staleness(share, period / (1 - d - u))
    # An old position is correct again after the next move, even if that packet is discarded, unless
    # it is accepted with errors; a wrong position is corrected only by a correct packet.
    spoiled_moves = 1 / (1 - d - u)
    old_moves = 1 + u * spoiled_moves
    moves = (d * old_moves + u * spoiled_moves) / (d + u) if d + u else 1.0
    return Staleness(share, interval * moves)


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
    limit = rule.detection_time[0]
    rows = []
    for name in CHECKS:
        for per_packet in range(1, n + 1):
            form = check_formats(per_packet)[name]
            link = replace(base, packet_format=form)
            cycle, n_packets = link.cycle_time, -(-n // per_packet)
            ways: tuple[Sending, ...] = ("changed", "cyclic") if per_packet == n else ("cyclic",)
            for sending in ways:
                changed = sending == "changed"
                shares = form.error_shares(1 if changed else per_packet, p)
                # One packet per interval if only changes are sent, else four per cycle.
                packets = 1 / _INTERVAL if changed else 4 / cycle
                timeout = cycle / 2 if base.turn_timeout is None else base.turn_timeout
                # A lost response delays the cycle by this time. If a turn ends before the response
                # arrives, nothing is received at all.
                longer = timeout - cycle / 4
                if longer <= 0:
                    continue
                # Each of the four packets of a cycle may be discarded, which causes a wait.
                period = n_packets * (cycle + 4 * shares.detected * longer)
                wait = 0.0 if changed else longer / (1 - shares.detected - shares.undetected)
                after = switch_staleness(shares, period, _INTERVAL, sending)
                stale = after.duration + wait
                wrong = _YEAR * packets * shares.undetected
                counted = link.counted_time
                verdicts = (wrong <= _MOST_WRONG, stale <= longest_stale, counted <= limit)
                refresh = period / (1 - shares.detected - shares.undetected)
                sizes = (form.size(per_packet), cycle, timeout, refresh)
                numbers = (*sizes, wrong, stale, counted)
                rows.append((name, sending, per_packet, *numbers, *verdicts, all(verdicts)))
    columns = ["check", "sending", "per_packet", "bytes", "cycle_s", "turn_timeout_s"]
    columns += ["refresh_s", "wrong_per_year", "stale_s", "counted_s"]
    return pd.DataFrame(rows, columns=[*columns, "errors_ok", "stale_ok", "alarm_ok", "meets"])


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
    if table.empty:
        raise ArgumentError("turn_timeout is shorter than the shortest response, that of one item")
    if good.empty:
        failed = (~table[["errors_ok", "stale_ok", "alarm_ok"]]).sum().astype(int)
        raise ArgumentError(
            f"n_items is {n_items}: of {len(table)} ways to send them, {failed['errors_ok']} let "
            f"too many errors pass, {failed['stale_ok']} show a wrong position for too long, and "
            f"{failed['alarm_ok']} raise false alarms"
        )
    best = good.sort_values("refresh_s", kind="stable").iloc[0]
    markers = table[(table["check"] == "markers") & (table["per_packet"] == best["per_packet"])]
    wrong = float(markers["wrong_per_year"].max())
    most = "at most about " if best["check"] == "CRC" else ""
    why = (
        f"markers alone would accept {wrong:.2g} wrong packets per year, and this choice {most}"
        f"{best['wrong_per_year']:.2g}; a switch is correct again {best['stale_s']:.2g} s after "
        f"a failed packet on average, if RCS ends a turn without a response after "
        f"{best['turn_timeout_s']:.2g} s"
    )
    check, per_packet = str(best["check"]), int(best["per_packet"])
    names = ("turn_timeout_s", "refresh_s", "wrong_per_year", "stale_s")
    timeout, refresh, per_year, stale = (float(best[name]) for name in names)
    return Recommendation(
        check, best["sending"], per_packet, timeout, refresh, per_year, stale, why
    )
