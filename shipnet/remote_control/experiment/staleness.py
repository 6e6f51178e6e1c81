"""How long a switch is shown in a position that it has left: sent once, or again and again."""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np

from shipnet.errors import ArgumentError
from shipnet.fields import check_scalar, check_whole
from shipnet.remote_control.experiment.residual import Shares
from shipnet.remote_control.experiment.transmission import draw_outcomes
from shipnet.remote_control.packet import Markers
from shipnet.remote_control.stuffed import Stuffed

__all__ = ["Sending", "Staleness", "simulate_switch", "switch_staleness"]

#: Only when the value has changed, as printed; or in every packet.
Sending = Literal["changed", "cyclic"]


class Staleness(NamedTuple):
    """How a receiver follows a switch of two positions.

    Attributes
    ----------
    share : float
        Share of the time in which it shows another position, or something else, than the last
        packet should have brought; the wait for that packet is left out.
    duration : float
        Mean time that it takes, from a packet that fails, until the right position is shown [s].
    """

    share: float
    duration: float


def switch_staleness(shares: Shares, period: float, interval: float, sending: Sending) -> Staleness:
    r"""Return how well a receiver follows a switch, in closed form.

    Between two packets the switch moves with a probability f: 1 if only changes are sent, else

    .. math:: f = \frac{1}{2} \left( 1 - e^{-2 T / \tau} \right)

    at packets every T and a mean of the time between its moves. A packet that is given up, with
    the probability d, leaves the old position, one that is taken wrongly, u, leaves none. In the
    long run the share of wrong positions is

    .. math:: g + \frac{d f (1 - g)}{1 - d + 2 d f}, \quad g = \frac{u}{1 - d}

    Parameters
    ----------
    shares : Shares
        What becomes of the packets, as `packet_shares` returns it. Every wrong packet is taken
        as one that spoils this switch.
    period : float
        Time T between two packets, 1e-6..1e6 [s].
    interval : float
        Mean time between two moves, 1e-6..1e12 [s]; their times are random.
    sending : {"changed", "cyclic"}
        When the value is sent.

    Returns
    -------
    Staleness
        Share of the time, and mean duration: up to the next move that is received, or the next
        packet that is.

    Raises
    ------
    ArgumentError
        If an argument is out of range, or no packet comes through.

    Examples
    --------
    One packet in a thousand is lost; a switch moves once an hour:

    >>> shares = Shares(0.999, 0.001, 0.0)
    >>> once = switch_staleness(shares, 0.1375, 3600, "changed")
    >>> again = switch_staleness(shares, 0.1375, 3600, "cyclic")
    >>> f"{once.share:.1e} {again.share:.1e}", round(once.duration), round(again.duration, 3)
    ('1.0e-03 3.8e-08', 3600, 0.138)
    """
    _, d, u = shares
    wait = check_scalar("period", period, "s", 1e-6, 1e6)
    mean = check_scalar("interval", interval, "s", 1e-6, 1e12)
    _check_sending(sending)
    if not (0 <= d and 0 <= u and d + u < 1):
        raise ArgumentError(
            f"detected and undetected are {d:g} and {u:g}; they must be 0 or more, and below 1 in "
            "sum"
        )
    flip = 1.0 if sending == "changed" else -float(np.expm1(-2 * wait / mean)) / 2
    spoiled = u / (1 - d)
    share = spoiled + d * flip * (1 - spoiled) / (1 - d + 2 * d * flip)
    if sending == "cyclic":
        return Staleness(share, wait / (1 - d - u))
    # Old: the next move ends it, given up or not, unless it is taken wrongly. Spoiled: only a
    # packet in order ends it.
    spoiled_moves = 1 / (1 - d - u)
    old_moves = 1 + u * spoiled_moves
    moves = (d * old_moves + u * spoiled_moves) / (d + u) if d + u else 1.0
    return Staleness(share, mean * moves)


def simulate_switch(
    packet_format: Markers | Stuffed,
    n_items: int,
    rate: float,
    period: float,
    interval: float,
    sending: Sending,
    n_packets: int,
    rng: np.random.Generator,
) -> float:
    """Return the share of wrong positions by sending real packets over a disturbed line.

    Parameters
    ----------
    packet_format : Markers or Stuffed
        The format.
    n_items : int
        Items of each packet: 1 if only the change is sent.
    rate : float
        Bit error rate, 0..0.5.
    period, interval, sending
        As for `switch_staleness`.
    n_packets : int
        How many packets, 1..1e8.
    rng : numpy.random.Generator
        Chance.

    Returns
    -------
    float
        Share of the packets after which the receiver's position is not that of the switch.

    Raises
    ------
    ArgumentError
        If an argument is out of range.

    Examples
    --------
    >>> rng = np.random.default_rng(2024)
    >>> share = simulate_switch(Markers(crc=True), 1, 1e-3, 0.1, 3600, "changed", 100_000, rng)
    >>> from shipnet.remote_control.experiment.residual import packet_shares
    >>> shares = packet_shares(Markers(crc=True), 1, 1e-3)
    >>> round(share, 3), round(switch_staleness(shares, 0.1, 3600, "changed").share, 3)
    (0.058, 0.058)
    """
    _check_sending(sending)
    n = check_whole("n_packets", n_packets, 1, 10**8)
    wait = check_scalar("period", period, "s", 1e-6, 1e6)
    mean = check_scalar("interval", interval, "s", 1e-6, 1e12)
    outcome = draw_outcomes(packet_format, n_items, rate, n, rng)
    if sending == "changed":
        position = np.arange(n) % 2
    else:
        position = np.cumsum(rng.poisson(wait / mean, n)) % 2
    # What is shown is what the last packet left that was not given up; 0 before the first.
    taken = np.maximum.accumulate(np.where(outcome != 1, np.arange(n), -1))
    shown = np.where(taken >= 0, np.where(outcome[taken] == 2, -1, position[taken]), 0)
    return float((shown != position).mean())


def _check_sending(sending: str) -> None:
    if sending not in ("changed", "cyclic"):
        raise ArgumentError(f"sending is {sending!r}; it must be 'changed' or 'cyclic'")
