"""Code shared by the two packet formats: items, streams, and effects of bit errors.

Bits are inverted independently with a probability p; start and stop bits are not modelled.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from itertools import pairwise
from typing import Literal, NamedTuple, Protocol

import numpy as np

from shipnet.arrays import Bytes, Integers
from shipnet.errors import ArgumentError, FieldError, FrameError, LengthError
from shipnet.fields import check_rng, check_scalar, check_whole
from shipnet.lazy import pd

#: Number and value of each item, in the order of the packet.
Items = tuple[tuple[int, int], ...]

#: What a receiver requires of the numbers.
NumberCheck = Literal["any", "known", "rising"]


#: Packets processed at a time.
_CHUNK = 1 << 16


def check_bytes(name: str, data: object) -> bytes:
    """Return data as bytes, or raise an error; `bytes` would turn an integer n into n zeros."""
    if not isinstance(data, (bytes, bytearray, memoryview)):
        raise ArgumentError(f"{name} is {data!r}; it must be bytes")
    return bytes(data)


# Outcomes of packets ---------------------------------------------------------------------------


class Outcomes(NamedTuple):
    """The outcomes of packets, as counts or fractions; `undetected` means accepted with errors."""

    intact: float
    detected: float
    undetected: float

    @property
    def missed(self) -> float:
        """Fraction of the disturbed packets that is accepted; NaN if none was disturbed."""
        hit = self.detected + self.undetected
        return self.undetected / hit if hit else float("nan")


# A format --------------------------------------------------------------------------------------


class Parser(Protocol):
    """Finds the packets in a stream; `discarded` counts the bytes that are not part of one."""

    discarded: int

    def feed(self, data: bytes) -> list[Items]:
        """Return the packets that these bytes complete."""


class PacketFormat:
    """Base class of the two formats, which encode, decode and trace packets differently."""

    __slots__ = ()

    #: Number of values, and largest number of items per packet.
    n_numbers: int
    #: What a receiver requires of the numbers.
    numbers: NumberCheck

    def size(self, n_items: int) -> int:
        """Return the length of a packet with 0..n_numbers items [byte]."""
        raise NotImplementedError

    def encode(self, items: Mapping[int, int]) -> bytes:
        """Return a packet of `items`, a mapping of numbers to values 0..65535, sorted by number."""
        if not isinstance(items, Mapping):
            raise ArgumentError(f"items is {items!r}; it must map numbers to values")
        numbers = sorted(check_whole("number", number, 0, self.n_numbers - 1) for number in items)
        values = [check_whole(f"value of item {k}", items[k], 0, 0xFFFF) for k in numbers]
        return self._packet(zip(numbers, values, strict=True))

    def decode(self, packet: bytes | bytearray) -> Items:
        """Return the numbers and values in one packet.

        Raises `LengthError`, `FormError`, `CrcError` or `FieldError` (a number is rejected).
        """
        data = check_bytes("packet", packet)
        n_items, remainder = divmod(len(data) - self.size(0), self.size(1) - self.size(0))
        if remainder or not 0 <= n_items <= self.n_numbers:
            raise LengthError(f"packet {data.hex(' ')} has a length that no number of items gives")
        body = self._body(data)
        items = tuple((body[k], body[k + 1] | body[k + 2] << 8) for k in range(0, len(body), 3))
        legal = self.numbers == "any" or all(number < self.n_numbers for number, _ in items)
        if self.numbers == "rising":
            legal = legal and all(one < following for (one, _), (following, _) in pairwise(items))
        if not legal:
            rising = " and rising" if self.numbers == "rising" else ""
            needed = f"0..{self.n_numbers - 1}{rising}"
            raise FieldError(f"packet {data.hex(' ')} has numbers that are not all {needed}")
        return items

    def parser(self) -> Parser:
        """Return a new parser."""
        raise NotImplementedError

    def trace(self, stream: bytes, *, start: int = 0) -> pd.DataFrame:
        """Return a row per byte, with its meaning to a receiver: ``place``, ``byte``, ``taken_as``.

        The first byte is at place `start` of a ring of 128 bytes.
        """
        data, size = check_bytes("stream", stream), 128
        start = check_whole("start", start, 0, size - 1)
        places = [(start + k) % size for k in range(len(data))]
        shown = [f"0x{byte:02X}" for byte in data]
        return pd.DataFrame({"place": places, "byte": shown, "taken_as": self._meanings(data)})

    def stream(self, n_bytes: int, items: int | None = None) -> bytes:
        """Return `n_bytes` of packets sent without pauses.

        Every packet has the same number of `items`, by default all, each with the value 1000.
        """
        n = check_whole("items", self.n_numbers if items is None else items, 0, self.n_numbers)
        packet = self.encode(dict.fromkeys(range(n), 1000))
        count = check_whole("n_bytes", n_bytes, 0, 10**6)
        return (packet * (count // len(packet) + 1))[:count]

    def error_shares(self, n_items: int, rate: float) -> Outcomes:
        """Return the fractions of intact, detected and undetected packets, in closed form.

        Bits are inverted independently with probability `rate`, 0..0.5; start and stop bits are
        not modelled.
        """
        p = check_scalar("rate", rate, "", 0, 0.5)
        n = check_whole("n_items", n_items, 0, self.n_numbers)
        bits = 8 * self.size(n)
        # 1 - intact, computed without cancellation for small p.
        hit = -float(np.expm1(bits * np.log1p(-p)))
        undetected = self._undetected(n, p, hit)
        return Outcomes((1 - p) ** bits, hit - undetected, undetected)

    def undetected_flips(self, n_items: int) -> float:
        r"""Return the fraction of single-bit errors that a receiver does not detect.

        Every bit is tried, with all values 0. With markers only, the fraction is

        .. math:: S = \frac{24 n}{8 L}

        for n items in a packet of L bytes, unless a bit turns a number into 0xEE.
        """
        n = check_whole("n_items", n_items, 0, self.n_numbers)
        packet = self.encode(dict.fromkeys(range(n), 0))
        bits = range(8 * len(packet))
        return sum(self._read(flipped(packet, [bit])) is not None for bit in bits) / len(bits)

    def transmit(
        self, n_items: int, rate: float, packets: int, rng: np.random.Generator | int | None = None
    ) -> Outcomes:
        """Send packets; return how many arrive intact, are detected as wrong, or are undetected.

        The values are random, and bits are inverted with the probability `rate`, 0..0.5.
        """
        outcomes = self.outcomes(n_items, rate, packets, check_rng(rng))
        return Outcomes(*np.bincount(outcomes, minlength=3).tolist())

    def outcomes(self, n_items: int, rate: float, packets: int, rng: np.random.Generator) -> Bytes:
        """Return the outcomes of packets with random values: 0 intact, 1 detected, 2 undetected."""
        # Only packets with inverted bits are built and checked, because all others are accepted.
        p = check_scalar("rate", rate, "", 0, 0.5)
        n = check_whole("packets", packets, 0, 10**9)
        n_items = check_whole("n_items", n_items, 0, self.n_numbers)
        bits = 8 * self.size(n_items)
        outcome = np.zeros(n, np.uint8)
        for first in range(0, n, _CHUNK):
            positions = _hits(bits * min(_CHUNK, n - first), p, rng)
            hit, start = np.unique(positions // bits, return_index=True)
            values = rng.integers(0, 1 << 16, (hit.size, n_items), dtype=np.uint16)
            flips = np.split(positions % bits, start[1:])
            for k, row, inverted in zip(hit, values.tolist(), flips, strict=False):
                items = tuple(enumerate(row))
                received = self._read(flipped(self._packet(items), inverted.tolist()))
                if received is None:
                    outcome[first + k] = 1
                elif received != items:
                    outcome[first + k] = 2
        return outcome

    def _read(self, packet: bytes) -> Items | None:
        """Return the items in a packet, or None if it is rejected."""
        try:
            return self.decode(packet)
        except FrameError:
            return None

    def _undetected(self, n_items: int, p: float, hit: float) -> float:
        """Return the fraction of packets accepted with errors if a fraction `hit` is disturbed."""
        raise NotImplementedError

    def _meanings(self, stream: bytes) -> list[str]:
        raise NotImplementedError

    def _packet(self, items: Iterable[tuple[int, int]]) -> bytes:
        """Return the packet of numbers and values."""
        raise NotImplementedError

    def _body(self, packet: bytes) -> bytes:
        """Return the bytes of the items, or raise an error if form or CRC is wrong."""
        raise NotImplementedError


def item_bytes(number: int, value: int) -> bytes:
    """Return an item: number, low byte, high byte."""
    return bytes([number, value & 0xFF, value >> 8])


def flipped(packet: bytes, bits: Iterable[int]) -> bytes:
    """Return a packet with these bits inverted, counted from the highest bit of the first byte."""
    data = bytearray(packet)
    for bit in bits:
        data[bit >> 3] ^= 0x80 >> (bit & 7)
    return bytes(data)


def _hits(n_bits: int, p: float, rng: np.random.Generator) -> Integers:
    """Return random places of inverted bits among `n_bits` bits, in ascending order."""
    # The gaps between inverted bits are drawn at random, not the bits themselves.
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
