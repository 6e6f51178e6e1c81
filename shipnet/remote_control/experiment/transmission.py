"""Packets by the million over a line that inverts bits: what each check takes and misses."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from shipnet.errors import ArgumentError
from shipnet.fields import check_scalar, check_whole
from shipnet.intervals import share_interval
from shipnet.remote_control.batch import check_batch, encode_batch
from shipnet.remote_control.experiment.residual import packet_shares
from shipnet.remote_control.packet import Markers
from shipnet.remote_control.stuffed import Stuffed

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["CHECKS", "Interval", "Trial", "check_formats", "compare_checks", "draw_outcomes"]
__all__ += ["transmit"]

Outcome = Literal["intact", "detected", "undetected"]

#: Ways to check a packet: as printed; with CRC-16 behind; with CRC-16 only, stuffed by COBS.
CHECKS = ("markers", "markers + CRC", "CRC")

#: Packets worked on at a time.
_CHUNK = 1 << 16


class Interval(NamedTuple):
    """Bounds of a share, by Clopper and Pearson."""

    low: float
    high: float


@dataclass(frozen=True, slots=True)
class Trial:
    """Packets that were sent over a disturbed line, counted.

    Parameters
    ----------
    sent : int
        Packets.
    detected : int
        Given up by the receiver.
    undetected : int
        Taken with wrong items.

    Examples
    --------
    None of 3000: less than one in a thousand, roughly.

    >>> Trial(3000, 12, 0).interval("undetected").high < 1.3e-3
    True
    """

    sent: int
    detected: int
    undetected: int

    @property
    def intact(self) -> int:
        """Packets taken as they were sent."""
        return self.sent - self.detected - self.undetected

    @property
    def missed(self) -> float:
        """Share of the disturbed packets that is taken; NaN if none was disturbed."""
        hit = self.detected + self.undetected
        return self.undetected / hit if hit else float("nan")

    def share(self, outcome: Outcome) -> float:
        """Return a share of the packets sent; NaN if none was.

        Parameters
        ----------
        outcome : {"intact", "detected", "undetected"}
            Which packets.
        """
        return self._count(outcome) / self.sent if self.sent else float("nan")

    def interval(self, outcome: Outcome, confidence: float = 0.95) -> Interval:
        """Return the interval in which the share lies with a confidence.

        Parameters
        ----------
        outcome : {"intact", "detected", "undetected"}
            Which packets.
        confidence : float, default 0.95
            0.5..0.999999.
        """
        level = check_scalar("confidence", confidence, "", 0.5, 0.999999)
        count = self._count(outcome)
        low, high = share_interval(count, self.sent, confidence=level)
        return Interval(float(low), float(high))

    def _count(self, outcome: Outcome) -> int:
        if outcome not in ("intact", "detected", "undetected"):
            raise ArgumentError(
                f"outcome is {outcome!r}; it must be 'intact', 'detected' or 'undetected'"
            )
        return int(getattr(self, outcome))


def check_formats(n_items: int) -> dict[str, Markers | Stuffed]:
    """Return a format for each way to check packets.

    Parameters
    ----------
    n_items : int
        Items of a packet, 1..84.

    Returns
    -------
    dict of str to Markers or Stuffed
        By the names of `CHECKS`.

    Raises
    ------
    ArgumentError
        If there are too many items.

    Examples
    --------
    >>> {name: form.size(10) for name, form in check_formats(10).items()}
    {'markers': 33, 'markers + CRC': 35, 'CRC': 34}
    """
    n = check_whole("n_items", n_items, 1, 84)
    formats = (Markers("A", n), Markers("A", n, crc=True), Stuffed(n))
    return dict(zip(CHECKS, formats, strict=True))


def draw_outcomes(
    packet_format: Markers | Stuffed,
    n_items: int,
    rate: float,
    n_packets: int,
    rng: np.random.Generator,
) -> npt.NDArray[np.uint8]:
    """Return what became of packets with random values, one after the other.

    Parameters
    ----------
    packet_format : Markers or Stuffed
        The format.
    n_items : int
        Items of each packet, numbered from 0 on; 0..n_numbers.
    rate : float
        Bit error rate, 0..0.5; bits are inverted independently of each other.
    n_packets : int
        How many, 0..1e9.
    rng : numpy.random.Generator
        Chance.

    Returns
    -------
    ndarray of uint8, shape (n_packets,)
        0 intact, 1 detected, 2 undetected.

    Raises
    ------
    ArgumentError
        If an argument is out of range.

    Notes
    -----
    Gaps between inverted bits are drawn, not bits; and only packets that are hit are built and
    checked, since all others are taken as they are.

    Examples
    --------
    >>> outcome = draw_outcomes(Markers(), 10, 1e-3, 100_000, np.random.default_rng(2024))
    >>> np.bincount(outcome, minlength=3).tolist()
    [76837, 2395, 20768]
    """
    p = check_scalar("rate", rate, "", 0, 0.5)
    n = check_whole("n_packets", n_packets, 0, 10**9)
    if not isinstance(rng, np.random.Generator):
        raise ArgumentError(f"rng is {rng!r}; it must be a numpy.random.Generator")
    size = packet_format.size(n_items)
    outcome = np.zeros(n, np.uint8)
    numbers = np.arange(n_items)
    for first in range(0, n, _CHUNK):
        count = min(_CHUNK, n - first)
        place = _hits(8 * size * count, p, rng)
        if place.size == 0:
            continue
        hit, row = np.unique(place // (8 * size), return_inverse=True)
        values = rng.integers(0, 1 << 16, (hit.size, n_items), dtype=np.uint16)
        packets = encode_batch(packet_format, numbers, values)
        bit = place % (8 * size)
        masks = (0x80 >> (bit & 7)).astype(np.uint8)
        np.bitwise_xor.at(packets.reshape(-1), row * size + (bit >> 3), masks)
        checked = check_batch(packet_format, packets)
        same = (checked.numbers == numbers).all(axis=1) & (checked.values == values).all(axis=1)
        fate = np.where(checked.accepted, np.where(same, 0, 2), 1)
        outcome[first + hit] = fate
    return outcome


def _hits(n_bits: int, p: float, rng: np.random.Generator) -> npt.NDArray[np.int64]:
    """Return which of so many bits are inverted, in rising order."""
    if p == 0 or n_bits == 0:
        return np.zeros(0, np.int64)
    parts, reached = [], -1
    while reached < n_bits:
        more = int(1.1 * (n_bits - reached) * p) + 20
        places = reached + np.cumsum(rng.geometric(p, more))
        parts.append(places)
        reached = int(places[-1])
    every = np.concatenate(parts)
    return every[: np.searchsorted(every, n_bits)]


def transmit(
    packet_format: Markers | Stuffed,
    n_items: int,
    rate: float,
    n_packets: int,
    rng: np.random.Generator,
) -> Trial:
    """Return how many of so many packets were given up, and taken with wrong items.

    Parameters
    ----------
    packet_format, n_items, rate, n_packets, rng
        As for `draw_outcomes`.

    Returns
    -------
    Trial
        The counts.

    Raises
    ------
    ArgumentError
        If an argument is out of range.

    Examples
    --------
    >>> transmit(Markers(crc=True), 10, 1e-3, 100_000, np.random.default_rng(2024))
    Trial(sent=100000, detected=24432, undetected=0)
    """
    counts = np.bincount(draw_outcomes(packet_format, n_items, rate, n_packets, rng), minlength=3)
    return Trial(int(counts.sum()), int(counts[1]), int(counts[2]))


def compare_checks(
    n_items: Iterable[int],
    rates: Iterable[float],
    n_packets: int,
    rng: np.random.Generator,
    *,
    formats: Mapping[str, Markers | Stuffed] | None = None,
) -> pd.DataFrame:
    """Return what each check takes and misses, by number of items and bit error rate.

    Parameters
    ----------
    n_items : iterable of int
        Items of a packet, 1..84 each.
    rates : iterable of float
        Bit error rates, 0..0.5 each.
    n_packets : int
        Packets for each row of the result.
    rng : numpy.random.Generator
        Chance.
    formats : mapping of str to Markers or Stuffed, optional
        What to compare; `check_formats` of each number of items if omitted.

    Returns
    -------
    pandas.DataFrame
        A row a check, number of items and rate: ``check``, ``n_items``, ``bit_error_rate``,
        ``bytes``, ``sent``, ``detected``, ``undetected``, ``low`` and ``high`` (95 % bounds of
        the undetected share), ``expected`` (the share by `packet_shares`), ``missed`` (share of
        the disturbed packets that is taken), ``items_lost`` (items given up, for each item that
        was sent).

    Raises
    ------
    ArgumentError
        If an argument is out of range.

    Examples
    --------
    >>> table = compare_checks([1, 10], [1e-3], 20_000, np.random.default_rng(2024))
    >>> table[["check", "n_items", "undetected"]].values.tolist()[:2]
    [['markers', 1, 468], ['markers + CRC', 1, 0]]
    """
    import pandas as pd

    rates = list(rates)
    rows = []
    for n, rate, name, form in _cases(n_items, rates, formats):
        trial = transmit(form, n, rate, n_packets, rng)
        rows.append(
            {
                "check": name,
                "n_items": n,
                "bit_error_rate": rate,
                "bytes": form.size(n),
                "sent": trial.sent,
                "detected": trial.detected,
                "undetected": trial.undetected,
                "low": trial.interval("undetected").low,
                "high": trial.interval("undetected").high,
                "expected": packet_shares(form, n, rate).undetected,
                "missed": trial.missed,
                "items_lost": trial.share("detected"),
            }
        )
    return pd.DataFrame(rows)


def _cases(
    n_items: Iterable[int],
    rates: list[float],
    formats: Mapping[str, Markers | Stuffed] | None,
) -> Iterator[tuple[int, float, str, Markers | Stuffed]]:
    for n in n_items:
        for rate in rates:
            for name, form in (formats or check_formats(n)).items():
                yield n, rate, name, form
