"""Code shared by the two packet formats: items, batches of packets, and effects of bit errors.

Bits are inverted independently with a probability p; start and stop bits are not modelled.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal, NamedTuple, Protocol

import numpy as np
import numpy.typing as npt

from shipnet.arrays import Bools, Bytes, Integers, Words
from shipnet.errors import ArgumentError, CrcError, FieldError, FormError, FrameError, LengthError
from shipnet.fields import check_rng, check_scalar, check_whole
from shipnet.lazy import pd

#: Number and value of each item, in the order of the packet.
Items = tuple[tuple[int, int], ...]

#: What a receiver requires of the numbers.
NumberCheck = Literal["any", "known", "rising"]


#: Packets processed at a time.
_CHUNK = 1 << 16

#: The fault of a rejected packet; the last text continues with the legal numbers.
_FAULTS: Mapping[type[FrameError], str] = {
    LengthError: "has a length that no number of items gives",
    FormError: "does not have the form of a packet",
    CrcError: "has a CRC that does not match its bytes",
    FieldError: "has numbers that are not all",
}


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


class Decoded(NamedTuple):
    """The result of decoding many packets: error codes (0 for none), and the accepted items."""

    error: Bytes
    numbers: Bytes
    values: Words

    @property
    def accepted(self) -> Bools:
        """Whether each packet is accepted, shape (n_packets,)."""
        accepted: Bools = self.error == 0
        return accepted


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
        triples = []
        for number in numbers:
            value = check_whole(f"value of item {number}", items[number], 0, 0xFFFF)
            triples.append((number, value & 0xFF, value >> 8))
        row = np.array(triples, np.uint8).reshape(1, len(numbers), 3)
        return self._encode_rows(row).tobytes()

    def decode(self, packet: bytes | bytearray) -> Items:
        """Return the numbers and values in one packet.

        Raises `LengthError`, `FormError`, `CrcError` or `FieldError` (a number is rejected).
        """
        data = check_bytes("packet", packet)
        decoded = self.decode_batch(np.frombuffer(data, np.uint8)[np.newaxis])
        for fault, why in _FAULTS.items():
            if decoded.error[0] == fault.code:
                legal = f" 0..{self.n_numbers - 1}" + " and rising" * (self.numbers == "rising")
                raise fault(f"packet {data.hex(' ')} {why}{legal * (fault is FieldError)}")
        return tuple(zip(decoded.numbers[0].tolist(), decoded.values[0].tolist(), strict=True))

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

    def encode_batch(self, numbers: npt.ArrayLike, values: npt.ArrayLike) -> Bytes:
        """Return many packets as rows of bytes, each as returned by `encode`.

        `values` has the shape (n_packets, n_items); `numbers`, in ascending order in each row, has
        the same shape or (n_items,).
        """
        value = _whole("values", values, 0xFFFF)
        number = _whole("numbers", numbers, self.n_numbers - 1)
        if value.ndim != 2 or number.shape not in (value.shape, value.shape[1:]):
            raise ArgumentError(
                f"numbers and values have the shapes {number.shape} and {value.shape}; values "
                "must be (n_packets, n_items), and numbers the same or (n_items,)"
            )
        if (np.diff(number, axis=-1) <= 0).any():
            raise ArgumentError("numbers must be in ascending order in each row")
        n_packets, n_items = value.shape
        items = np.empty((n_packets, n_items, 3), np.uint8)
        items[..., 0], items[..., 1], items[..., 2] = number, value & 0xFF, value >> 8
        return self._encode_rows(items)

    def decode_batch(self, packets: npt.ArrayLike) -> Decoded:
        """Decode uint8 rows of equal length, each as `decode` does.

        A rejected row has an error code, and its items are 0.
        """
        rows = np.asarray(packets)
        if rows.dtype != np.uint8 or rows.ndim != 2:
            raise ArgumentError(
                f"packets must be a 2-D uint8 array, got {rows.dtype}, {rows.ndim}-D"
            )
        step = self.size(1) - self.size(0)
        n_items, rest = divmod(rows.shape[1] - self.size(0), step)
        if rest or not 0 <= n_items <= self.n_numbers:
            error = np.full(len(rows), LengthError.code, np.uint8)
            none = np.zeros((len(rows), 0), np.uint8)
            return Decoded(error, none, none.astype(np.uint16))
        formed, checked, items = self._decode_rows(rows, n_items)
        numbers = items[..., 0]
        error = np.zeros(len(rows), np.uint8)
        if self.numbers != "any":
            error[(numbers >= self.n_numbers).any(axis=1)] = FieldError.code
        if self.numbers == "rising":
            error[(numbers[:, 1:] <= numbers[:, :-1]).any(axis=1)] = FieldError.code
        error[~checked] = CrcError.code
        error[~formed] = FormError.code
        values = items[..., 1] | items[..., 2].astype(np.uint16) << 8
        good = (error == 0)[:, None]
        return Decoded(error, numbers * good, values * good)

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
        packet = np.frombuffer(self.encode(dict.fromkeys(range(n), 0)), np.uint8)
        flips = np.packbits(np.eye(8 * packet.size, dtype=np.uint8), axis=1)
        return float(self.decode_batch(packet ^ flips).accepted.mean())

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
        size, numbers = self.size(n_items), np.arange(n_items)
        outcome = np.zeros(n, np.uint8)
        for first in range(0, n, _CHUNK):
            count = min(_CHUNK, n - first)
            place = _hits(8 * size * count, p, rng)
            if place.size == 0:
                continue
            hit, row = np.unique(place // (8 * size), return_inverse=True)
            values = rng.integers(0, 1 << 16, (hit.size, n_items), dtype=np.uint16)
            rows = self.encode_batch(numbers, values)
            bit = place % (8 * size)
            masks = (0x80 >> (bit & 7)).astype(np.uint8)
            np.bitwise_xor.at(rows.reshape(-1), row * size + (bit >> 3), masks)
            checked = self.decode_batch(rows)
            same = (checked.numbers == numbers).all(axis=1) & (checked.values == values).all(axis=1)
            outcome[first + hit] = np.where(checked.accepted, np.where(same, 0, 2), 1)
        return outcome

    def _undetected(self, n_items: int, p: float, hit: float) -> float:
        """Return the fraction of packets accepted with errors if a fraction `hit` is disturbed."""
        raise NotImplementedError

    def _meanings(self, stream: bytes) -> list[str]:
        raise NotImplementedError

    def _encode_rows(self, items: Bytes) -> Bytes:
        raise NotImplementedError

    def _decode_rows(self, rows: Bytes, n_items: int) -> tuple[Bools, Bools, Bytes]:
        """Return, by row, whether the form is correct, whether the CRC matches, and the items."""
        raise NotImplementedError


def _whole(name: str, values: npt.ArrayLike, highest: int) -> Integers:
    try:
        array = np.asarray(values)
    except ValueError:
        raise ArgumentError(f"{name} must be whole numbers, in rows of equal length") from None
    if array.size and (array.dtype.kind not in "iu" or array.min() < 0 or array.max() > highest):
        raise ArgumentError(f"{name} must be whole numbers 0..{highest}")
    return array.astype(np.int64)


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
