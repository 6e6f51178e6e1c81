"""Packets of numbered values in two formats: as printed with markers, and byte-stuffed with a CRC.

A value is sent as its number, its low byte and its high byte. The drawing of the printed packet is
missing, and the text allows two interpretations:

- A: ``CC DD (number low high) x n EE``, 3 + 3 n bytes;
- B: ``CC (DD number low high) x n EE``, 2 + 4 n bytes.

Sending one packet per value is the same as interpretation A with one item per packet.
"""

from __future__ import annotations

from collections.abc import Iterable
from decimal import Decimal, localcontext
from functools import cache
from typing import Literal

import numpy as np

from shipnet.crc import MODBUS
from shipnet.errors import CrcError, FormError, FrameError
from shipnet.fields import check_scalar, check_whole, choice, record, switch, whole
from shipnet.remote_control.packet_format import (
    Items,
    NumberCheck,
    PacketFormat,
    check_bytes,
    item_bytes,
)

#: The markers; K. Y. Chung and K. S. Rhyu, "A study on the communication method for a ship main
#: engine remote control system", 1998, section 3.2.
PACKET_START, DATA_START, PACKET_END = 0xCC, 0xDD, 0xEE

#: Numbers below this are not markers.
_MOST_NUMBERS = PACKET_START

#: Bytes of an item, and of the CRC.
_ITEM, _CRC = 3, 2

#: Bytes that one code byte of COBS can span; longer data would need more code bytes.
_SPAN = 254

#: Largest number of items in a byte-stuffed packet: 3 x 84 + 2 = 254 bytes before stuffing.
MOST_STUFFED = 84

#: Names of the bytes of an item.
_PARTS = ("number", "low byte", "high byte")

#: Bits of the CRC, and decimal digits for sums whose terms almost cancel.
_CRC_BITS, _DIGITS = 16, 80

_NUMBER_CHECKS = {
    "any": "any number is accepted",
    "known": "the number must be in the receiver's table",
    "rising": "the numbers must be in the table and in ascending order",
}


def _check_crc(data: bytes, packet: bytes) -> None:
    """Raise an error unless the last two bytes of the data are the CRC of the bytes before."""
    if MODBUS.of(data):  # a reflected CRC without final XOR is 0 over data and their CRC
        raise CrcError(f"packet {packet.hex(' ')} has a CRC that does not match its bytes")


# The printed packet ----------------------------------------------------------------------------


@record
class MarkerFormat(PacketFormat):
    """The packet as printed; by default, it is accepted if its markers are in the right places.

    Notes
    -----
    A value byte may equal a marker, because the format has no escape sequence. With
    ``numbers="any"``, a receiver that stores values by number, as printed, may write outside its
    table when a number is disturbed. The paper [1]_ mentions neither a number check nor a CRC.

    References
    ----------
    .. [1] K. Y. Chung, K. S. Rhyu, "A study on the communication method for a ship main engine
       remote control system", J. Korean Soc. Marine Eng., 1998, sections 3.2 and 5.

    Examples
    --------
    >>> from shipnet import remote_control as rc
    >>> form = rc.MarkerFormat()
    >>> packet = form.encode({0: 120, 3: 0x1234})
    >>> packet.hex(" "), form.decode(packet)
    ('cc dd 00 78 00 03 34 12 ee', ((0, 120), (3, 4660)))
    >>> rc.MarkerFormat("B").encode({0: 120, 3: 0x1234}).hex(" ")
    'cc dd 00 78 00 dd 03 34 12 ee'

    Three stray bytes before a packet are discarded:

    >>> parser = form.parser()
    >>> parser.feed(b"abc" + form.encode({3: 7})), parser.discarded
    ([((3, 7),)], 3)
    """

    reading: Literal["A", "B"] = choice(
        {"A": "one 0xDD per packet", "B": "one 0xDD per value"},
        "Interpretation of the missing drawing: A has one 0xDD per packet, B one per value",
        default="A",
    )
    n_numbers: int = whole(
        1, _MOST_NUMBERS, "", "Number of values; they are numbered from 0", default=10
    )
    numbers: NumberCheck = choice(
        _NUMBER_CHECKS, "What the receiver requires of the numbers", default="any"
    )
    crc: bool = switch(
        "Whether the packet is followed by its CRC-16/MODBUS, low byte first", default=False
    )

    @property
    def head(self) -> bytes:
        """The markers before the first item."""
        return bytes([PACKET_START, DATA_START] if self.reading == "A" else [PACKET_START])

    @property
    def lead(self) -> bytes:
        """The markers before every item."""
        return b"" if self.reading == "A" else bytes([DATA_START])

    @property
    def _crc_size(self) -> int:
        """Length of the CRC at the end [byte]."""
        return _CRC if self.crc else 0

    def size(self, n_items: int) -> int:
        """Return the length of a packet with 0..n_numbers items [byte]."""
        n = check_whole("n_items", n_items, 0, self.n_numbers)
        return len(self.head) + n * (len(self.lead) + _ITEM) + 1 + self._crc_size

    def parser(self) -> MarkerParser:
        """Return a new parser; its `feed` takes a stream in pieces of any length."""
        return MarkerParser(self)

    def _meanings(self, stream: bytes) -> list[str]:
        parser, packets = self.parser(), list[Items]()
        return [parser.read(byte, packets) for byte in stream]

    @staticmethod
    def false_sync(n_bytes: int, markers: int = 3) -> float:
        r"""Return the probability that at least one of n random bytes equals one of m markers.

        .. math:: P = 1 - \left( 1 - \frac{m}{256} \right)^n

        All byte values are assumed to be equally likely, unlike on a ship: a shaft speed below 204
        rpm sent as a whole number never includes a marker.
        """
        n = check_whole("n_bytes", n_bytes, 0, 10**6)
        return 1 - (1 - check_whole("markers", markers, 0, 256) / 256) ** n

    def _undetected(self, n_items: int, p: float, hit: float) -> float:
        r"""Return the fraction of packets accepted with errors.

        With markers alone, the receiver accepts a packet if its m marker bytes are intact and, in
        interpretation A, none of its n numbers has become the last marker, 0xEE:

        .. math:: P_u = (1 - p)^{8 m} \left( 1 - P_e - (1 - p)^{24 n} \right)

        P_e, the probability of such a number, is 0 in interpretation B. With a CRC, the packet must
        also match its CRC; the upper bound from `crc_residual` is less than a thousandth too high.
        A check of the numbers is ignored, as it would only lower the fraction.
        """
        head, lead = len(self.head), len(self.lead)
        step, end = lead + _ITEM, head + n_items * (lead + _ITEM)
        leads = (head + k * step + j for k in range(n_items) for j in range(lead))
        markers = (*range(head), *leads, end)
        intact = (1 - p) ** (8 * len(markers))
        if self.crc:
            return intact * crc_residual(end + 1, p, markers)
        # The sum is written so that its terms do not cancel for small p.
        changed = -float(np.expm1(24 * n_items * np.log1p(-p)))
        if not lead:
            apart = np.bitwise_count(np.arange(n_items, dtype=np.uint8) ^ np.uint8(PACKET_END))
            early = p**apart * (1 - p) ** (8.0 - apart)
            changed += float(np.expm1(np.log1p(-early).sum()))
        return intact * max(changed, 0.0)

    def _packet(self, items: Iterable[tuple[int, int]]) -> bytes:
        body = b"".join(self.lead + item_bytes(*item) for item in items)
        packet = self.head + body + bytes([PACKET_END])
        return packet + MODBUS.of(packet).to_bytes(_CRC, "little") if self.crc else packet

    def _body(self, packet: bytes) -> bytes:
        head, lead = self.head, self.lead
        end, step = len(packet) - 1 - self._crc_size, len(lead) + _ITEM
        groups = [packet[k : k + step] for k in range(len(head), end, step)]
        formed = packet.startswith(head) and packet[end] == PACKET_END
        if lead:
            formed = formed and all(group.startswith(lead) for group in groups)
        else:  # an item whose number is the end marker would end the packet
            formed = formed and all(group[0] != PACKET_END for group in groups)
        if not formed:
            raise FormError(f"packet {packet.hex(' ')} does not have the form of a packet")
        if self.crc:
            _check_crc(packet, packet)
        return b"".join(group[len(lead) :] for group in groups)


class MarkerParser:
    """Reads a stream byte by byte, searches for 0xCC, and discards malformed packets."""

    # As in the paper, a malformed packet is lost up to the byte that violates the form. That byte
    # is tested again, because it may start the next packet.

    def __init__(self, packet_format: MarkerFormat) -> None:
        self.discarded = 0
        self._format = packet_format
        self._head, self._lead = packet_format.head, packet_format.lead
        self._packet = bytearray()
        self._size = 0

    def feed(self, data: bytes) -> list[Items]:
        """Return the packets that these bytes complete."""
        packets: list[Items] = []
        for byte in check_bytes("data", data):
            self.read(byte, packets)
        return packets

    def read(self, byte: int, packets: list[Items]) -> str:
        """Read one byte, add the packet that it completes to `packets`, and return its meaning."""
        meaning = self._meaning(byte)
        if not meaning:
            self.discarded += len(self._packet)
            self._packet.clear()
            if byte != PACKET_START:
                self.discarded += 1
                return "discarded"
            meaning = "start of the packet"
        self._packet.append(byte)
        if len(self._packet) == self._size:
            try:
                packets.append(self._format.decode(self._packet))
            except CrcError:
                self.discarded += self._size
                meaning = "discarded"
            self._packet.clear()
        return meaning

    def _meaning(self, byte: int) -> str:
        """Return what a byte means next in the packet, empty if it violates the form."""
        form, head, lead, index = self._format, self._head, self._lead, len(self._packet)
        if index < len(head):
            self._size = 0
            if byte != head[index]:
                return ""
            return "start of the packet" if index == 0 else "start of the data"
        if self._size:
            return "CRC"
        n_items, within = divmod(index - len(head), len(lead) + _ITEM)
        if within == 0 and byte == PACKET_END:
            self._size = index + 1 + form._crc_size
            return "end of the packet"
        if n_items == form.n_numbers:
            return ""
        if within < len(lead):
            return "start of the data" if byte == lead[within] else ""
        if within == len(lead) and form.numbers != "any":
            falls = n_items and byte <= self._packet[-len(lead) - _ITEM]
            if byte >= form.n_numbers or (form.numbers == "rising" and falls):
                return ""
        return _PARTS[within - len(lead)]


# The byte-stuffed packet -----------------------------------------------------------------------


def stuff(data: bytes) -> bytes:
    """Encode up to 254 bytes by consistent overhead byte stuffing, leaving no zeros."""
    # Each run without zeros is preceded by the distance to the next 0, which is left out.
    check_whole("length of data", len(data), 0, _SPAN)
    return b"".join(bytes([len(run) + 1]) + run for run in data.split(b"\0"))


def unstuff(code: bytes) -> bytes:
    """Return the data that were stuffed, or raise an error if no data are stuffed like this."""
    runs, start = [], 0
    while start < len(code) and code[start]:
        runs.append(code[start + 1 : start + code[start]])
        start += code[start]
    if start != len(code) or 0 in code:
        raise FormError(f"bytes {code.hex(' ')} are not stuffed")
    return b"\0".join(runs)


@record
class CobsFormat(PacketFormat):
    """The corrected packet: it has a CRC, and byte stuffing keeps the end byte out of its data.

    Consistent overhead byte stuffing (COBS) [1]_ encodes the items and their CRC-16/MODBUS without
    zeros, and a 0 ends the packet. A packet of n items has 4 + 3 n bytes. A receiver that has lost
    synchronisation resynchronises at the next 0. This format is not in the paper.

    References
    ----------
    .. [1] S. Cheshire, M. Baker, "Consistent overhead byte stuffing", IEEE/ACM Transactions on
       Networking 7 (1999) 159-172.

    Examples
    --------
    >>> from shipnet import remote_control as rc
    >>> form = rc.CobsFormat()
    >>> packet = form.encode({0: 120, 3: 0xCCDD})
    >>> packet.hex(" "), form.size(2)
    ('01 02 78 06 03 dd cc 09 14 00', 10)
    >>> form.decode(packet)
    ((0, 120), (3, 52445))
    """

    n_numbers: int = whole(
        1, MOST_STUFFED, "", "Number of values; they are numbered from 0", default=10
    )
    numbers: NumberCheck = choice(
        _NUMBER_CHECKS, "What the receiver requires of the numbers", default="known"
    )

    def size(self, n_items: int) -> int:
        """Return the length of a packet with 0..n_numbers items [byte]."""
        return 4 + 3 * check_whole("n_items", n_items, 0, self.n_numbers)

    def parser(self) -> CobsParser:
        """Return a new parser; its `feed` takes a stream in pieces of any length."""
        return CobsParser(self)

    def _meanings(self, stream: bytes) -> list[str]:
        *packets, partial = stream.split(b"\0")
        meanings = [meaning for packet in packets for meaning in self._parts(packet)]
        return meanings + ["not complete"] * len(partial)

    def _parts(self, packet: bytes) -> list[str]:
        """Return the meaning of each byte of a packet and of the 0 that ends it."""
        try:
            items = self.decode(packet + b"\0")
        except FrameError:
            return ["discarded"] * (len(packet) + 1)
        index = packet[0]
        parts = [f"distance to the first 0: {index}", *len(items) * _PARTS, "CRC", "CRC"]
        while index < len(packet):
            parts[index] += f", a 0; distance to the next: {packet[index]}"
            index += packet[index]
        return [*parts, "end of the packet"]

    def _undetected(self, n_items: int, p: float, hit: float) -> float:
        """Return an estimate, usually too high, of the fraction accepted with errors."""
        # No single inverted bit passes. Two or more are treated as noise, of which a fraction of
        # 2**-16 passes. Of four million pairs of inverted bits, none passed.
        bits = 8 * self.size(n_items)
        single = bits * p * (1 - p) ** (bits - 1)
        return max(hit - single, 0.0) * 2.0**-_CRC_BITS

    def _packet(self, items: Iterable[tuple[int, int]]) -> bytes:
        data = b"".join(item_bytes(*item) for item in items)
        return stuff(data + MODBUS.of(data).to_bytes(_CRC, "little")) + b"\0"

    def _body(self, packet: bytes) -> bytes:
        if packet[-1] != 0:
            raise FormError(f"packet {packet.hex(' ')} does not end with 0")
        data = unstuff(packet[:-1])
        _check_crc(data, packet)
        return data[:-_CRC]


class CobsParser:
    """Reads a stream: the bytes between two zeros form a packet or are discarded."""

    def __init__(self, packet_format: CobsFormat) -> None:
        self.discarded = 0
        self._format = packet_format
        # The bytes since the last 0; those beyond the longest packet are only counted.
        self._partial, self._more = b"", 0

    def feed(self, data: bytes) -> list[Items]:
        """Return the packets that these bytes complete."""
        packets: list[Items] = []
        *ended, partial = check_bytes("data", data).split(b"\0")
        for part in ended:
            packet = self._partial + part + b"\0"
            try:
                packets.append(self._format.decode(packet))
            except FrameError:
                self.discarded += self._more + len(packet)
            self._partial, self._more = b"", 0
        longest = self._format.size(self._format.n_numbers)
        self._partial += partial
        self._more += len(self._partial[longest:])
        self._partial = self._partial[:longest]
        return packets


# Errors that pass the checks --------------------------------------------------------------------


def crc_residual(n_bytes: int, rate: float, error_free: tuple[int, ...] = ()) -> float:
    r"""Return the probability that CRC-16/MODBUS accepts data and check bytes with errors.

    The bytes with the indices `error_free` have no errors. If B_w words of the dual code of a code
    of L bits have the weight w, MacWilliams' identity gives (T. Fujiwara, T. Kasami, S. Lin, IEEE
    Trans. Communications 37 (1989) 986-989):

    .. math:: P_u = 2^{-16} \sum_{w=0}^{L} B_w (1 - 2 p)^w - (1 - p)^L
    """
    n = check_whole("n_bytes", n_bytes, 0, 4096)
    p = check_scalar("rate", rate, "", 0, 0.5)
    weights = code_weights(n, error_free)
    with localcontext() as context:
        context.prec = _DIGITS
        exact = Decimal(p)
        total, power, base = Decimal(0), Decimal(1), 1 - 2 * exact
        for number in weights:
            total += number * power
            power *= base
        residual = total / (1 << _CRC_BITS) - (1 - exact) ** (len(weights) - 1)
        # Rounding can make an exact 0 negative.
        return max(0.0, float(residual))


@cache
def code_weights(n_bytes: int, error_free: tuple[int, ...] = ()) -> tuple[int, ...]:
    """Return the number of words of weight 0, 1, ... in the dual code of CRC-16/MODBUS."""
    bits = 8 * np.array(error_free, np.int64)[:, np.newaxis] + np.arange(8)
    syndromes = np.delete(MODBUS.syndromes(n_bytes), bits.reshape(-1))
    # For each of the 2**16 words of the dual code, the Walsh-Hadamard transform gives the number of
    # zeros minus the number of ones.
    sums = np.bincount(syndromes, minlength=1 << _CRC_BITS)
    for bit in range(_CRC_BITS):
        pairs = sums.reshape(-1, 2, 1 << bit)
        sums = np.stack([pairs[:, 0] + pairs[:, 1], pairs[:, 0] - pairs[:, 1]], axis=1)
    weights = (syndromes.size - sums.reshape(-1)) // 2
    return tuple(np.bincount(weights, minlength=syndromes.size + 1).tolist())
