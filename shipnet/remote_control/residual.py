"""What a check lets through, in closed form: markers exactly, CRC-16 by the weights of its code.

Bits are inverted independently of each other with a probability p, start and stop bits left out.
"""

from __future__ import annotations

from decimal import Decimal, localcontext
from functools import cache
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from shipnet.crc import MODBUS
from shipnet.errors import ArgumentError
from shipnet.fields import check_scalar, check_whole
from shipnet.remote_control.packet import PACKET_END, CobsFormat, MarkerFormat, PacketFormat

Floats = npt.NDArray[np.float64]

#: Bits of the CRC, and digits with which sums that almost cancel are taken.
_CRC_BITS, _DIGITS = 16, 80


class Shares(NamedTuple):
    """What becomes of packets, as shares of all; `undetected` are accepted though wrong."""

    intact: float
    detected: float
    undetected: float


def packet_shares(packet_format: PacketFormat, n_items: int, rate: float) -> Shares:
    r"""Return what becomes of packets with the items 0 to n - 1 at a bit error rate p, 0..0.5.

    MarkerFormat alone let every packet pass in which none of the m marker bytes is hit,

    .. math:: P_u = (1 - p)^{8 m} \left( Q - (1 - p)^{24 n} \right)

    with the probability Q that the receiver accepts the n numbers, 1 or nearly so. With a CRC, the
    bits beside the markers must be a code word as well, see `crc_residual`.

    Exact for `MarkerFormat` without CRC. With CRC, `undetected` is an upper bound, though less
    than a thousandth too high: that the numbers are checked as well is left out. For `CobsFormat`
    it is an upper estimate, not a bound: single inverted bits that pass are counted by trying them
    all on a packet with values of 0, and two or more are taken as noise, of which 2**-16 passes.
    They are not noise: of four million pairs of inverted bits none passed.
    """
    p = check_scalar("rate", rate, "", 0, 0.5)
    size = packet_format.size(n_items)
    intact = (1 - p) ** (8 * size)
    # Of the difference 1 - intact nothing is left at small p unless it is taken like this.
    hit = -float(np.expm1(8 * size * np.log1p(-p)))
    if isinstance(packet_format, CobsFormat):
        bits = 8 * size
        single = bits * p * (1 - p) ** (bits - 1)
        passing = single_flip_share(packet_format, n_items)
        undetected = passing * single + max(hit - single, 0.0) * 2.0**-_CRC_BITS
    elif not isinstance(packet_format, MarkerFormat):
        raise ArgumentError(f"packet_format is {packet_format!r}; it must be one of both formats")
    elif packet_format.crc:
        markers = len(packet_format.head) + n_items * len(packet_format.lead) + 1
        undetected = (1 - p) ** (8 * markers) * _residual(
            _marked_weights(packet_format, n_items), p
        )
    else:
        markers = size - 3 * n_items
        changed = _numbers_taken(packet_format, n_items, p) - (1 - p) ** (24 * n_items)
        if packet_format.numbers == "any":
            # As a sum without cancellation, for small p.
            changed = -float(np.expm1(24 * n_items * np.log1p(-p))) - _ends_early(
                packet_format, n_items, p
            )
        undetected = (1 - p) ** (8 * markers) * max(changed, 0.0)
    return Shares(intact, hit - undetected, undetected)


@cache
def single_flip_share(packet_format: PacketFormat, n_items: int) -> float:
    """Return the share of single inverted bits that a receiver does not see, by trying them all."""
    n = check_whole("n_items", n_items, 0, packet_format.n_numbers)
    frame = np.frombuffer(packet_format.encode(dict.fromkeys(range(n), 0)), np.uint8)
    return float(packet_format.decode_batch(_single_flips(frame)).accepted.mean())


def crc_residual(n_bytes: int, rate: float) -> float:
    r"""Return how often CRC-16/MODBUS passes bytes, with their check, that are not those sent.

    By MacWilliams' identity, with the number B of words of weight w in the dual code of a code
    of L bits (T. Fujiwara, T. Kasami, S. Lin, IEEE Trans. Communications 37 (1989) 986-989):

    .. math:: P_u = 2^{-16} \sum_{w=0}^{L} B_w (1 - 2 p)^w - (1 - p)^L
    """
    n = check_whole("n_bytes", n_bytes, 0, 4096)
    p = check_scalar("rate", rate, "", 0, 0.5)
    return _residual(code_weights(n), p)


@cache
def code_weights(n_bytes: int) -> tuple[int, ...]:
    """Return how many words of weight 0, 1, ... the dual code of CRC-16/MODBUS has."""
    return _weights(np.zeros(n_bytes, np.uint8), np.zeros(0, np.int64))


@cache
def _marked_weights(packet_format: MarkerFormat, n_items: int) -> tuple[int, ...]:
    """Return the weights for all bits of a packet but those of its markers."""
    head, step = len(packet_format.head), len(packet_format.lead) + 3
    end = head + n_items * step
    places = [*range(head), end]
    places += [head + k * step + j for k in range(n_items) for j in range(len(packet_format.lead))]
    bits = (8 * np.array(places)[:, None] + np.arange(8)).reshape(-1)
    return _weights(np.zeros(end + 1, np.uint8), bits)


def _weights(data: npt.NDArray[np.uint8], fixed: npt.NDArray[np.int64]) -> tuple[int, ...]:
    check = int(MODBUS.of(data))
    frame = np.append(data, np.array([check & 0xFF, check >> 8], np.uint8))
    syndromes = np.delete(MODBUS.of(_single_flips(frame)), fixed)
    # The Walsh-Hadamard transform counts, for each of the 2**16 sums of checks, even minus odd.
    sums = np.bincount(syndromes, minlength=1 << _CRC_BITS)
    for bit in range(_CRC_BITS):
        pairs = sums.reshape(-1, 2, 1 << bit)
        sums = np.stack([pairs[:, 0] + pairs[:, 1], pairs[:, 0] - pairs[:, 1]], axis=1)
    length = syndromes.size
    weights = (length - sums.reshape(-1)) // 2
    return tuple(np.bincount(weights, minlength=length + 1).tolist())


def _single_flips(frame: npt.NDArray[np.uint8]) -> npt.NDArray[np.uint8]:
    """Return a frame once for each of its bits, with that bit inverted."""
    bits = np.arange(8 * frame.size)
    rows = np.repeat(frame[None, :], bits.size, axis=0)
    rows[bits, bits >> 3] ^= (0x80 >> (bits & 7)).astype(np.uint8)
    return rows


def _residual(weights: tuple[int, ...], p: float) -> float:
    with localcontext() as context:
        context.prec = _DIGITS
        rate = Decimal(p)
        total, power, base = Decimal(0), Decimal(1), 1 - 2 * rate
        for number in weights:
            total += number * power
            power *= base
        length = len(weights) - 1
        residual = total / (1 << _CRC_BITS) - (1 - rate) ** length
        # Of an exact 0 the rounding may leave less.
        return max(0.0, float(residual))


def _becomes(number: int, p: float) -> Floats:
    """Return with which probability each of the 256 bytes comes instead of a number."""
    distance = np.bitwise_count(np.arange(256, dtype=np.uint8) ^ np.uint8(number))
    return np.asarray(p**distance * (1 - p) ** (8.0 - distance))


def _ends_early(packet_format: MarkerFormat, n_items: int, p: float) -> float:
    """Return how often a number turns into the last marker, which reading A takes for its end."""
    if packet_format.lead:
        return 0.0
    early = [float(_becomes(number, p)[PACKET_END]) for number in range(n_items)]
    return -float(np.expm1(np.log1p(-np.array(early)).sum())) if early else 0.0


def _numbers_taken(packet_format: MarkerFormat, n_items: int, p: float) -> float:
    """Return how often the receiver takes the numbers that arrive."""
    if packet_format.numbers == "any":
        return 1 - _ends_early(packet_format, n_items, p)
    known = np.arange(256) < packet_format.n_numbers
    if packet_format.numbers == "known":
        return float(np.prod([_becomes(number, p)[known].sum() for number in range(n_items)]))
    # Probability that the numbers so far rise, by the last of them; -1 stands in front.
    rising = np.zeros(257)
    rising[0] = 1.0
    for number in range(n_items):
        below = np.cumsum(rising)[:256]
        rising = np.append(0.0, below * _becomes(number, p) * known)
    return float(rising.sum())
