"""The packet mended: no byte of the data can be taken for a marker, and a CRC checks them all.

``COBS((number low high) x n, CRC) 00``: consistent overhead byte stuffing writes the bytes
without any 0, so that 0 ends a packet and nothing else is ever 0. A receiver that has lost its
place finds it again at the next 0.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from shipnet.errors import CrcError, FormError, FrameError, LengthError
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

__all__ = ["Stuffed", "StuffedParser", "stuff", "unstuff"]

#: Bytes that one code byte of COBS can span; longer packets would need more than one.
_SPAN = 254

#: The largest packet has this many items: 3 x 84 + 2 = 254 bytes.
_MOST_ITEMS = 84


def stuff(data: bytes) -> bytes:
    """Return bytes written without any 0, by consistent overhead byte stuffing (COBS).

    Every 0 is replaced by the distance to the next one, and the distance to the first goes in
    front.

    Parameters
    ----------
    data : bytes
        0..254 bytes.

    Returns
    -------
    bytes
        One byte more.

    Raises
    ------
    ArgumentError
        If there are more bytes.

    References
    ----------
    .. [1] S. Cheshire, M. Baker, "Consistent overhead byte stuffing", IEEE/ACM Transactions on
       Networking 7 (1999) 159-172.

    Examples
    --------
    >>> stuff(bytes([0x45, 0x00, 0x00, 0x2C])).hex(" ")
    '02 45 01 02 2c'
    """
    check_whole("length of data", len(data), 0, _SPAN)
    return b"".join(bytes([len(part) + 1]) + part for part in data.split(b"\0"))


def unstuff(data: bytes) -> bytes:
    """Return the bytes that `stuff` was given.

    Parameters
    ----------
    data : bytes
        1..255 bytes, none of them 0.

    Returns
    -------
    bytes
        One byte less.

    Raises
    ------
    LengthError
        If there are too few or too many bytes.
    FormError
        If a byte is 0, or the last distance does not lead to the end.

    Examples
    --------
    >>> unstuff(bytes.fromhex("02 45 01 02 2c")).hex(" ")
    '45 00 00 2c'
    """
    if not 1 <= len(data) <= _SPAN + 1:
        raise LengthError(f"there are {len(data)} bytes; there must be 1..{_SPAN + 1}")
    if 0 in data:
        raise FormError(f"{data.hex(' ')} has a 0")
    plain, place = bytearray(data), 0
    while place < len(data):
        step, plain[place] = data[place], 0
        place += step
    if place != len(data):
        raise FormError(f"the distances in {data.hex(' ')} do not lead to its end")
    return bytes(plain[1:])


@dataclass(frozen=True, slots=True)
class Stuffed:
    """Items and their CRC-16/MODBUS, stuffed by COBS, and a 0 behind: 4 + 3 n bytes.

    Parameters
    ----------
    n_numbers : int, default 10
        How many data there are, 1..84; their numbers are 0..n_numbers - 1.
    numbers : {"any", "known", "rising"}, default "known"
        What the receiver asks of the numbers.

    Raises
    ------
    ArgumentError
        If a field is out of its range.

    Notes
    -----
    One byte more than reading A of the paper's packet, one item or ten. Not in the paper.

    Examples
    --------
    >>> mended = Stuffed()
    >>> packet = mended.encode({0: 120, 3: 0xCCDD})
    >>> packet.hex(" "), mended.size(2)
    ('01 02 78 06 03 dd cc 09 14 00', 10)
    >>> mended.decode(packet)
    ((0, 120), (3, 52445))
    """

    n_numbers: int = 10
    numbers: NumberCheck = "known"

    def __post_init__(self) -> None:
        """Check both fields."""
        check_number_check(self.numbers)
        most = check_whole("n_numbers", self.n_numbers, 1, _MOST_ITEMS)
        object.__setattr__(self, "n_numbers", most)

    def size(self, n_items: int) -> int:
        """Return the length of a packet [byte].

        Parameters
        ----------
        n_items : int
            How many items it has, 0..n_numbers.
        """
        return 4 + 3 * check_whole("n_items", n_items, 0, self.n_numbers)

    def encode(self, items: Mapping[int, int]) -> bytes:
        """Return a packet.

        Parameters
        ----------
        items : mapping of int to int
            Numbers 0..n_numbers - 1, with their values 0..65535; they are sent in
            rising order.
        """
        body = b"".join(
            bytes([number, value & 0xFF, value >> 8])
            for number, value in check_items(items, self.n_numbers)
        )
        return stuff(body + trailer(body)) + b"\0"

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
            If the only 0 is not the last byte, or the stuffing breaks off.
        CrcError
            If the CRC is not the one computed.
        FieldError
            If a number is none that `numbers` allows.
        """
        data = check_bytes("packet", packet)
        n_items, rest = divmod(len(data) - 4, 3)
        if rest or not 0 <= n_items <= self.n_numbers:
            raise LengthError(f"the packet has {len(data)} bytes, which no number of items gives")
        if data[-1]:
            raise FormError(f"{data.hex(' ')} does not end with 0")
        plain = unstuff(data[:-1])
        body, check = plain[:-2], plain[-2:]
        if check != trailer(body):
            raise CrcError(f"the check is {check.hex(' ')}; it must be {trailer(body).hex(' ')}")
        return check_numbers(read_items(body), self.numbers, self.n_numbers)

    def parser(self) -> StuffedParser:
        """Return a parser that has seen nothing yet."""
        return StuffedParser(self)


class StuffedParser:
    """Reads a stream: whatever stands between two zeros is a packet, or is given up.

    Parameters
    ----------
    packet_format : Stuffed
        The format to read.
    """

    def __init__(self, packet_format: Stuffed) -> None:
        self.discarded = 0
        self._format = packet_format
        self._packet = bytearray()
        self._lost = 0

    def feed(self, data: bytes) -> list[Items]:
        """Return the packets that these bytes complete.

        Parameters
        ----------
        data : bytes-like
            Any bytes, any number of them.
        """
        packets: list[Items] = []
        longest = self._format.size(self._format.n_numbers)
        for byte in check_bytes("data", data):
            if len(self._packet) < longest:
                self._packet.append(byte)
            else:
                self._lost += 1
            if byte == 0:
                self._finish(packets)
        return packets

    def _finish(self, packets: list[Items]) -> None:
        size = len(self._packet) + self._lost
        try:
            if self._lost:
                raise LengthError(f"the packet has {size} bytes")
            packets.append(self._format.decode(self._packet))
        except FrameError:
            self.discarded += size
        self._packet.clear()
        self._lost = 0
