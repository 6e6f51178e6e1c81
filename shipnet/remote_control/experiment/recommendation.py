"""Which check, which sending rule, how many items a packet: what the paper leaves to others."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from shipnet.errors import ArgumentError
from shipnet.fields import check_scalar, check_whole
from shipnet.remote_control.experiment.residual import packet_shares
from shipnet.remote_control.experiment.staleness import Sending, switch_staleness
from shipnet.remote_control.experiment.transmission import CHECKS, check_formats
from shipnet.remote_control.link.supervision import MEANT, Supervision
from shipnet.remote_control.link.system import System
from shipnet.remote_control.link.timing import counted_time, cycle_time

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["Criterion", "Recommendation", "candidates", "recommend"]

_COLUMNS = ["check", "sending", "per_packet", "bytes", "cycle_s", "turn_timeout_s", "refresh_s"]
_COLUMNS += ["wrong_per_year", "stale_s", "counted_s", "errors_ok", "stale_ok", "alarm_ok", "meets"]

_RULES: tuple[Sending, ...] = ("changed", "cyclic")

#: A year of 365 days [s].
_YEAR = 365 * 86400.0


@dataclass(frozen=True, slots=True)
class Criterion:
    """What a link must do. The numbers are ours; the paper states none.

    Parameters
    ----------
    wrong_per_year : float, default 1
        Most packets with wrong items that the receivers take in a year, 1e-12..1e12.
    stale_time : float, default 3
        Longest mean time that a switch is shown in a wrong position after a packet that failed,
        1e-3..1e9 [s], the wait of RCS for the lost answer included; as long as a failed partner
        may stay unnoticed.
    switch_interval : float, default 3600
        Mean time between two moves of a switch, 1e-3..1e9 [s].
    supervision : Supervision, default MEANT
        Rule that must not raise an alarm in a healthy link, however its timer stands.

    Raises
    ------
    ArgumentError
        If a field is out of range.

    Examples
    --------
    >>> Criterion(wrong_per_year=0.1).stale_time
    3.0
    """

    wrong_per_year: float = 1.0
    stale_time: float = 3.0
    switch_interval: float = 3600.0
    supervision: Supervision = MEANT

    def __post_init__(self) -> None:
        """Check the numbers."""
        for name, unit, low, high in (
            ("wrong_per_year", "", 1e-12, 1e12),
            ("stale_time", "s", 1e-3, 1e9),
            ("switch_interval", "s", 1e-3, 1e9),
        ):
            value = check_scalar(name, getattr(self, name), unit, low, high)
            object.__setattr__(self, name, value)


@dataclass(frozen=True, slots=True)
class Recommendation:
    """What to do with a number of items.

    Parameters
    ----------
    check : str
        Of `CHECKS`.
    sending : {"changed", "cyclic"}
        Only changes, or all values in turn.
    per_packet : int
        Most items of a packet.
    turn_timeout : float
        When RCS ends a turn without an answer [s].
    refresh_time : float
        Mean time in which every value has been received once [s]: all packets in turn, the waits
        for lost answers, and again what was lost.
    wrong_per_year : float
        Packets with wrong items that are taken in a year; of a stuffed packet an upper estimate.
    stale_time : float
        Mean time that a switch is wrong after a packet that failed [s].
    why : str
        The reason.

    Examples
    --------
    >>> print(recommend(10))
    CRC, cyclic, 10 items a packet: 142 ms for all values
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
        """Say it in one line."""
        return (
            f"{self.check}, {self.sending}, {self.per_packet} items a packet: "
            f"{self.refresh_time * 1e3:.0f} ms for all values"
        )


def candidates(
    n_items: int,
    system: System | None = None,
    *,
    rate: float = 1e-5,
    criterion: Criterion | None = None,
) -> pd.DataFrame:
    """Return all ways to send a number of items, and what each would do.

    Parameters
    ----------
    n_items : int
        Items that each station sends, 1..84.
    system : System, optional
        Bit rate, character, processing and ``turn_timeout``; its format and supervision do not
        matter. That of the paper if omitted. Where it has no ``turn_timeout``, a turn ends after
        half a cycle, twice the time of an answer: waiting until the counters run out, as
        printed, would leave a switch wrong for 4.4 s more.
    rate : float, default 1e-5
        Bit error rate, 0..0.1. Assumed: the paper names none.
    criterion : Criterion, optional
        What is asked.

    Returns
    -------
    pandas.DataFrame
        A row a check, sending rule and number of items a packet: ``check``, ``sending``,
        ``per_packet``, ``bytes`` (longest packet), ``cycle_s``, ``turn_timeout_s``,
        ``refresh_s``, ``wrong_per_year``, ``stale_s``, ``counted_s`` (supervision, in health), and
        whether it keeps within the limits: ``errors_ok``, ``stale_ok``, ``alarm_ok``, ``meets``
        (all three).

    Raises
    ------
    ArgumentError
        If an argument is out of range.

    Notes
    -----
    The closed forms of `packet_shares` and `switch_staleness`. A packet that is given up costs the
    wait of a turn as well, and no other packet: what is left of it in the ring is not counted
    against the next one. A check and size whose answer takes longer than a turn has no row. The
    errors of "CRC" are an upper estimate.

    Where the items are split, all packets are taken as long as the longest, a cycle carries one of
    each station, and a value comes again when all have had their turn. Where only changes are
    sent, a packet is as long as the most items that change at once, taken as all; its failures are
    counted for packets of one item. With packets without items reading A still shows a sign of
    life.

    Examples
    --------
    >>> table = candidates(10).query("per_packet == 10")
    >>> table[["check", "sending", "errors_ok", "stale_ok"]].values.tolist()[:3]
    [['markers', 'changed', False, False], ['markers', 'cyclic', False, True], \
['markers + CRC', 'changed', True, False]]
    """
    import pandas as pd

    n = check_whole("n_items", n_items, 1, 84)
    p = check_scalar("rate", rate, "", 0, 0.1)
    asked = criterion or Criterion()
    base = replace(system or System(), repeat=0, slave=asked.supervision)
    limit = asked.supervision.detection_time[0]
    rows = []
    for name in CHECKS:
        for per_packet in range(1, n + 1):
            form = check_formats(per_packet)[name]
            link = replace(base, packet_format=form)
            cycle, n_packets = cycle_time(link), -(-n // per_packet)
            for sending in _RULES:
                changed = sending == "changed"
                if changed and per_packet < n:
                    continue
                shares = packet_shares(form, 1 if changed else per_packet, p)
                # A packet for one change in each interval, or four in each cycle.
                packets = 1 / asked.switch_interval if changed else 4 / cycle
                timeout = cycle / 2 if base.turn_timeout is None else base.turn_timeout
                # The wait for a lost answer is longer than the answer by this; a turn that ends
                # before the answer is there brings nothing at all.
                longer = timeout - cycle / 4
                if longer <= 0:
                    continue
                # Each of the four packets of a cycle may be given up, and costs a wait.
                period = n_packets * (cycle + 4 * shares.detected * longer)
                wait = 0.0 if changed else longer / (1 - shares.detected - shares.undetected)
                after = switch_staleness(shares, period, asked.switch_interval, sending)
                stale = after.duration + wait
                wrong = _YEAR * packets * shares.undetected
                counted = counted_time(link)
                verdicts = (
                    wrong <= asked.wrong_per_year,
                    stale <= asked.stale_time,
                    counted <= limit,
                )
                refresh = period / (1 - shares.detected - shares.undetected)
                sizes = (form.size(per_packet), cycle, timeout, refresh)
                numbers = (*sizes, wrong, stale, counted)
                rows.append((name, sending, per_packet, *numbers, *verdicts, all(verdicts)))
    return pd.DataFrame(rows, columns=_COLUMNS)


def recommend(
    n_items: int,
    system: System | None = None,
    *,
    rate: float = 1e-5,
    criterion: Criterion | None = None,
) -> Recommendation:
    """Return how to send a number of items: the quickest way found that meets the criterion.

    Parameters
    ----------
    n_items, system, rate, criterion
        As for `candidates`.

    Returns
    -------
    Recommendation
        Of the candidates that keep within all limits, the one whose values are all received once
        in the shortest mean time.

    Raises
    ------
    ArgumentError
        If an argument is out of range, or no candidate keeps within the limits; the message says
        how many fail which.

    Examples
    --------
    Markers alone would do at error rates that no line keeps; 40 items at 600 bit/s must be split:

    >>> recommend(10, rate=1e-13).check
    'markers'
    >>> print(recommend(40, System(bit_rate=600), criterion=Criterion(stale_time=20)))
    CRC, cyclic, 10 items a packet: 9116 ms for all values
    """
    table = candidates(n_items, system, rate=rate, criterion=criterion)
    good = table[table["meets"]]
    if table.empty:
        raise ArgumentError("turn_timeout is shorter than the answer with one item, of any check")
    if good.empty:
        failed = (~table[["errors_ok", "stale_ok", "alarm_ok"]]).sum().astype(int)
        raise ArgumentError(
            f"n_items is {n_items}: of {len(table)} ways to send them, {failed['errors_ok']} let "
            f"too many errors pass, {failed['stale_ok']} leave a switch wrong for too long, and "
            f"{failed['alarm_ok']} raise false alarms"
        )
    best = good.sort_values("refresh_s", kind="stable").iloc[0]
    markers = table[(table["check"] == "markers") & (table["per_packet"] == best["per_packet"])]
    wrong = float(markers["wrong_per_year"].max())
    most = "at most about " if best["check"] == "CRC" else ""
    why = (
        f"markers alone would let {wrong:.2g} wrong packets a year pass, this lets {most}"
        f"{best['wrong_per_year']:.2g}; a switch that misses its packet is right again after "
        f"{best['stale_s']:.2g} s, if RCS ends a turn without an answer after "
        f"{best['turn_timeout_s']:.2g} s"
    )
    return Recommendation(
        str(best["check"]),
        best["sending"],
        int(best["per_packet"]),
        float(best["turn_timeout_s"]),
        float(best["refresh_s"]),
        float(best["wrong_per_year"]),
        float(best["stale_s"]),
        why,
    )
