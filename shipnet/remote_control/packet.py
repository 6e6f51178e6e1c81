"""The packet of a main engine's remote control: numbered data between three marker bytes.

A datum is its number, its low byte and its high byte. The drawing of the packet is lost, and the
text can be read in two ways, so both are here:

- A: ``CC DD (number low high) x n EE``, 3 + 3 n bytes;
- B: ``CC (DD number low high) x n EE``, 2 + 4 n bytes.

That every datum is a packet of its own is reading A with one item a packet.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal, Protocol

from shipnet.errors import ArgumentError, CrcError, FormError, LengthError
from shipnet.fields import check_whole
from shipnet.remote_control.items import (
    Items,
    NumberCheck,
    check_bytes,
    check_items,
    check_number_check,
    check_numbers,
    read_items,
    trailer,
)

__all__ = ["DATA_START", "PACKET_END", "PACKET_START", "Format", "MarkerParser", "Markers"]
__all__ += ["Parser"]

#: The markers; K. Y. Chung and K. S. Rhyu, "A study on the communication method for a ship main
#: engine remote control system", 1998, section 3.2.
PACKET_START, DATA_START, PACKET_END = 0xCC, 0xDD, 0xEE

#: A number below it is none of the markers.
_MOST_NUMBERS = PACKET_START

#: Bytes of an item, and of the CRC.
_ITEM, _CRC = 3, 2


class Parser(Protocol):
    """Finds the packets in a stream of bytes."""

    #: Bytes given up so far, because no packet that holds them was found.
    discarded: int

    def feed(self, data: bytes) -> list[Items]:
        """Return the packets that these bytes complete."""


class Format(Protocol):
    """What a format of packets can do, so that one stands in for another."""

    @property
    def n_numbers(self) -> int:
        """How many numbers there are, and the most items of a packet."""

    @property
    def numbers(self) -> NumberCheck:
        """What a receiver asks of the numbers."""

    def size(self, n_items: int) -> int:
        """Return the length of a packet [byte]."""

    def encode(self, items: Mapping[int, int]) -> bytes:
        """Return a packet."""

    def decode(self, packet: bytes | bytearray) -> Items:
        """Return the items of one packet, or raise."""

    def parser(self) -> Parser:
        """Return a parser that has seen nothing yet."""


@dataclass(frozen=True, slots=True)
class Markers:
    """The format as printed: markers at their places, and nothing else, show a packet in order.

    Parameters
    ----------
    reading : {"A", "B"}, default "A"
        Which way the lost figure is read.
    n_numbers : int, default 10
        How many data there are, 1..204; their numbers are 0..n_numbers - 1.
    numbers : {"any", "known", "rising"}, default "any"
        What the receiver asks of the numbers. The paper names no check of them.
    crc : bool, default False
        Whether CRC-16/MODBUS over all of the packet follows its last marker, low byte first. Not
        in the paper.

    Raises
    ------
    ArgumentError
        If a field is out of its range.

    Notes
    -----
    A value byte may equal a marker; nothing escapes it. With ``numbers="any"`` a receiver that
    stores by number, as printed, writes outside its table when a number is disturbed.

    References
    ----------
    .. [1] K. Y. Chung, K. S. Rhyu, "A study on the communication method for a ship main engine
       remote control system", J. Korean Soc. Marine Eng., 1998, sections 3.2 and 5.

    Examples
    --------
    >>> Markers().encode({0: 120, 3: 0x1234}).hex(" ")
    'cc dd 00 78 00 03 34 12 ee'
    >>> Markers("B").encode({0: 120, 3: 0x1234}).hex(" ")
    'cc dd 00 78 00 dd 03 34 12 ee'
    >>> Markers().size(10), Markers("B").size(10), Markers(crc=True).size(10)
    (33, 42, 35)

    Three false bytes before a packet are passed over:

    >>> parser = Markers().parser()
    >>> parser.feed(b"abc" + Markers().encode({3: 7})), parser.discarded
    ([((3, 7),)], 3)
    """

    reading: Literal["A", "B"] = "A"
    n_numbers: int = 10
    numbers: NumberCheck = "any"
    crc: bool = False

    def __post_init__(self) -> None:
        """Check every field."""
        if self.reading not in ("A", "B"):
            raise ArgumentError(f"reading is {self.reading!r}; it must be 'A' or 'B'")
        check_number_check(self.numbers)
        if not isinstance(self.crc, bool):
            raise ArgumentError(f"crc is {self.crc!r}; it must be True or False")
        most = check_whole("n_numbers", self.n_numbers, 1, _MOST_NUMBERS)
        object.__setattr__(self, "n_numbers", most)

    @property
    def head(self) -> bytes:
        """The markers before the first item."""
        return bytes([PACKET_START, DATA_START] if self.reading == "A" else [PACKET_START])

    @property
    def lead(self) -> bytes:
        """The markers before every item."""
        return b"" if self.reading == "A" else bytes([DATA_START])

    def size(self, n_items: int) -> int:
        """Return the length of a packet [byte].

        Parameters
        ----------
        n_items : int
            How many items it has, 0..n_numbers.
        """
        n = check_whole("n_items", n_items, 0, self.n_numbers)
        return len(self.head) + n * (len(self.lead) + _ITEM) + 1 + _CRC * self.crc

    def encode(self, items: Mapping[int, int]) -> bytes:
        """Return a packet.

        Parameters
        ----------
        items : mapping of int to int
            Numbers 0..n_numbers - 1, with their values 0..65535; they are sent in
            rising order.
        """
        body = b"".join(
            self.lead + bytes([number, value & 0xFF, value >> 8])
            for number, value in check_items(items, self.n_numbers)
        )
        packet = self.head + body + bytes([PACKET_END])
        return packet + trailer(packet) if self.crc else packet

    def decode(self, packet: bytes | bytearray) -> Items:
        """Return the items of one packet.

        Parameters
        ----------
        packet : bytes-like
            All its bytes and no others.

        Raises
        ------
        LengthError
            If no packet has this length.
        FormError
            If a marker is not at its place, or the last one stands where a number should.
        CrcError
            If there is a CRC and it is not the one computed.
        FieldError
            If a number is none that `numbers` allows.
        """
        data, step = check_bytes("packet", packet), len(self.lead) + _ITEM
        end = len(data) - 1 - _CRC * self.crc
        n_items, rest = divmod(end - len(self.head), step)
        if rest or not 0 <= n_items <= self.n_numbers:
            raise LengthError(f"the packet has {len(data)} bytes, which no number of items gives")
        starts = range(len(self.head), end, step)
        markers = not self.lead or all(data.startswith(self.lead, start) for start in starts)
        early = not self.lead and any(data[start] == PACKET_END for start in starts)
        if not (data.startswith(self.head) and markers and data[end] == PACKET_END) or early:
            raise FormError(f"{data.hex(' ')} has no packet's markers at their places")
        if self.crc and data[end + 1 :] != trailer(data[: end + 1]):
            raise CrcError(f"the check of {data.hex(' ')} is {trailer(data[: end + 1]).hex(' ')}")
        items = read_items(b"".join(data[k + len(self.lead) : k + step] for k in starts))
        return check_numbers(items, self.numbers, self.n_numbers)

    def parser(self) -> MarkerParser:
        """Return a parser that has seen nothing yet."""
        return MarkerParser(self)


class MarkerParser:
    """Reads a stream byte by byte: seeks 0xCC, and gives up what breaks the form.

    Parameters
    ----------
    packet_format : Markers
        The format to read.

    Notes
    -----
    As in the paper, all bytes from the start of a broken packet are lost. The byte that broke it
    is looked at again, for it may be the start of the next one.
    """

    def __init__(self, packet_format: Markers) -> None:
        self.discarded = 0
        self._format = packet_format
        self._head, self._lead = packet_format.head, packet_format.lead
        self._packet = bytearray()
        self._size = 0

    @property
    def pending(self) -> int:
        """How many bytes of a packet that is not complete it holds."""
        return len(self._packet)

    def feed(self, data: bytes) -> list[Items]:
        """Return the packets that these bytes complete.

        Parameters
        ----------
        data : bytes-like
            Any bytes, any number of them.
        """
        packets: list[Items] = []
        for byte in check_bytes("data", data):
            if not self._fits(byte):
                self.discarded += len(self._packet)
                self._packet.clear()
                if byte != PACKET_START:
                    self.discarded += 1
                    continue
            self._packet.append(byte)
            if len(self._packet) == self._size:
                self._finish(packets)
        return packets

    def _fits(self, byte: int) -> bool:
        """Tell whether a byte may follow those of the packet so far; note where the packet ends."""
        form, head, lead, place = self._format, self._head, self._lead, len(self._packet)
        if place < len(head):
            self._size = 0
            return byte == head[place]
        if self._size:
            return True
        n_items, within = divmod(place - len(head), len(lead) + _ITEM)
        if within == 0 and byte == PACKET_END:
            self._size = place + 1 + _CRC * form.crc
            return True
        if n_items == form.n_numbers:
            return False
        if within < len(lead):
            return byte == lead[within]
        if within > len(lead) or form.numbers == "any":
            return True
        step = len(lead) + _ITEM
        rises = form.numbers == "known" or n_items == 0 or byte > self._packet[-step]
        return byte < form.n_numbers and rises

    def _finish(self, packets: list[Items]) -> None:
        try:
            packets.append(self._format.decode(self._packet))
        except CrcError:
            self.discarded += self._size
        self._packet.clear()
