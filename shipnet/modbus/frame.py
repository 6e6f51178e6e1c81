"""The frame around a PDU: RTU and ASCII on a serial line, the MBAP header in TCP.

A frame is called ADU in the standard. All three carry the same PDU, which
`shipnet.modbus.reader` reads.
"""

from __future__ import annotations

from struct import pack, unpack
from typing import NamedTuple

from shipnet.crc import crc
from shipnet.errors import ArgumentError, CrcError, FieldError, FormError, LengthError, SymbolError
from shipnet.fields import check_whole
from shipnet.modbus.codes import LARGEST_PDU

__all__ = [
    "LAST_UNIT",
    "Adu",
    "decode_ascii",
    "decode_rtu",
    "decode_tcp",
    "encode_ascii",
    "encode_rtu",
    "encode_tcp",
]

#: Highest address of a slave on a serial line; 248..255 are reserved. "MODBUS over serial line"
#: V1.02, section 2.2.
LAST_UNIT = 247

#: Bytes that a frame adds to its PDU: unit id and CRC; MBAP header.
_RTU, _MBAP = 3, 7

_HEXADECIMAL = frozenset(b"0123456789ABCDEFabcdef")


class Adu(NamedTuple):
    """What a frame carries.

    Attributes
    ----------
    unit_id : int
        Address of the slave that is asked or answers; 0 is the broadcast.
    pdu : bytes
        Function code and data, not read yet.
    transaction_id : int or None
        Number that pairs a response with its request in TCP; None on a serial line.
    """

    unit_id: int
    pdu: bytes
    transaction_id: int | None = None


def encode_rtu(unit_id: int, pdu: bytes) -> bytes:
    """Return the RTU frame of a PDU: unit id, PDU, CRC with its low byte first.

    Parameters
    ----------
    unit_id : int
        Address of the slave, 0..247; 0 is the broadcast.
    pdu : bytes-like
        1..253 bytes.

    Returns
    -------
    bytes
        Frame of 4..256 bytes.

    Raises
    ------
    ArgumentError
        If an argument is out of its range.

    Examples
    --------
    >>> encode_rtu(17, bytes.fromhex("03006B0003")).hex(" ")
    '11 03 00 6b 00 03 76 87'
    """
    body = bytes([check_whole("unit_id", unit_id, 0, LAST_UNIT)]) + _checked_pdu(pdu)
    return body + crc("CRC-16/MODBUS", body).to_bytes(2, "little")


def decode_rtu(frame: bytes) -> Adu:
    """Return what an RTU frame carries.

    Parameters
    ----------
    frame : bytes-like
        One whole frame; on the line, silence tells where it ends.

    Returns
    -------
    Adu
        Unit id and PDU.

    Raises
    ------
    LengthError
        If the frame has not 4..256 bytes.
    CrcError
        If the CRC is another than that of the bytes before it.
    FieldError
        If the unit id is reserved.
    ArgumentError
        If `frame` are no bytes.

    Examples
    --------
    >>> decode_rtu(bytes.fromhex("11 03 00 6b 00 03 76 87")).unit_id
    17
    """
    data = _checked_frame(frame, "RTU", 1 + _RTU, LARGEST_PDU + _RTU)
    body, found = data[:-2], int.from_bytes(data[-2:], "little")
    expected = crc("CRC-16/MODBUS", body)
    if found != expected:
        raise CrcError(f"CRC is 0x{found:04X}, but the bytes before it make 0x{expected:04X}")
    return Adu(_serial_unit(body[0]), body[1:])


def encode_ascii(unit_id: int, pdu: bytes) -> bytes:
    r"""Return the ASCII frame of a PDU: colon, hexadecimals with their LRC, CR, LF.

    Parameters
    ----------
    unit_id : int
        Address of the slave, 0..247; 0 is the broadcast.
    pdu : bytes-like
        1..253 bytes.

    Returns
    -------
    bytes
        Frame of 9..513 characters.

    Raises
    ------
    ArgumentError
        If an argument is out of its range.

    Examples
    --------
    >>> encode_ascii(17, bytes.fromhex("03006B0003"))
    b':1103006B00037E\r\n'
    """
    body = bytes([check_whole("unit_id", unit_id, 0, LAST_UNIT)]) + _checked_pdu(pdu)
    return b":%s\r\n" % (body + bytes([_lrc(body)])).hex().upper().encode()


def decode_ascii(frame: bytes) -> Adu:
    r"""Return what an ASCII frame carries.

    Parameters
    ----------
    frame : bytes-like
        One whole frame, colon and line end included.

    Returns
    -------
    Adu
        Unit id and PDU.

    Raises
    ------
    LengthError
        If the frame has not 9..513 characters, or half a byte too many.
    FormError
        If the colon or the line end is missing.
    SymbolError
        If a character between them is no hexadecimal digit.
    CrcError
        If the LRC is another than that of the bytes before it.
    FieldError
        If the unit id is reserved.
    ArgumentError
        If `frame` are no bytes.

    Examples
    --------
    >>> decode_ascii(b":1103006B00037E\r\n").pdu.hex(" ")
    '03 00 6b 00 03'
    """
    data = _checked_frame(frame, "ASCII", 9, 2 * (LARGEST_PDU + 2) + 3)
    if data[:1] != b":" or data[-2:] != b"\r\n":
        raise FormError("an ASCII frame begins with ':' and ends with carriage return, line feed")
    digits = data[1:-2]
    if odd := set(digits) - _HEXADECIMAL:
        raise SymbolError(f"{bytes([min(odd)])!r} is no hexadecimal digit")
    if len(digits) % 2:
        raise LengthError(f"the ASCII frame has {len(digits)} digits; two make a byte")
    values = bytes.fromhex(digits.decode())
    body, found = values[:-1], values[-1]
    if found != _lrc(body):
        raise CrcError(f"LRC is 0x{found:02X}, but the bytes before it make 0x{_lrc(body):02X}")
    return Adu(_serial_unit(body[0]), body[1:])


def encode_tcp(unit_id: int, pdu: bytes, transaction_id: int) -> bytes:
    """Return the TCP frame of a PDU: transaction id, protocol id 0, length, unit id, PDU.

    Parameters
    ----------
    unit_id : int
        0..255: the slave behind a gateway, or 255 (0 will do) for the server itself.
    pdu : bytes-like
        1..253 bytes.
    transaction_id : int
        0..65535, which the response repeats.

    Returns
    -------
    bytes
        Frame of 8..260 bytes.

    Raises
    ------
    ArgumentError
        If an argument is out of its range.

    Examples
    --------
    >>> encode_tcp(255, bytes.fromhex("0300040001"), 0x1501).hex(" ")
    '15 01 00 00 00 06 ff 03 00 04 00 01'
    """
    body = _checked_pdu(pdu)
    unit = check_whole("unit_id", unit_id, 0, 255)
    transaction = check_whole("transaction_id", transaction_id, 0, 0xFFFF)
    return pack(">HHHB", transaction, 0, len(body) + 1, unit) + body


def decode_tcp(frame: bytes) -> Adu:
    """Return what a TCP frame carries.

    Parameters
    ----------
    frame : bytes-like
        One whole frame; in a stream, its length field (bytes 4 and 5) tells where it ends.

    Returns
    -------
    Adu
        Unit id, PDU and transaction id.

    Raises
    ------
    LengthError
        If the frame has not 8..260 bytes, or not as many as its length field says.
    FieldError
        If the protocol id is not 0.
    ArgumentError
        If `frame` are no bytes.

    Examples
    --------
    >>> decode_tcp(bytes.fromhex("15 01 00 00 00 06 ff 03 00 04 00 01")).transaction_id == 0x1501
    True
    """
    data = _checked_frame(frame, "TCP", 1 + _MBAP, LARGEST_PDU + _MBAP)
    transaction, protocol, length, unit = unpack(">HHHB", data[:_MBAP])
    if protocol != 0:
        raise FieldError(f"protocol id is {protocol}; it must be 0")
    if length != len(data) - 6:
        raise LengthError(f"length field is {length}, but {len(data) - 6} bytes follow it")
    return Adu(unit, data[_MBAP:], transaction)


def _lrc(body: bytes) -> int:
    """Return what makes the sum of all bytes 0."""
    return -sum(body) & 0xFF


def _serial_unit(unit: int) -> int:
    if unit > LAST_UNIT:
        raise FieldError(f"unit id is {unit}; it must be 0..{LAST_UNIT}")
    return unit


def _checked_pdu(pdu: bytes) -> bytes:
    if not isinstance(pdu, bytes | bytearray | memoryview) or not 1 <= len(pdu) <= LARGEST_PDU:
        raise ArgumentError(f"pdu is {pdu!r}; it must be 1..{LARGEST_PDU} bytes")
    return bytes(pdu)


def _checked_frame(frame: bytes, kind: str, low: int, high: int) -> bytes:
    if not isinstance(frame, bytes | bytearray | memoryview):
        raise ArgumentError(f"frame is {frame!r}; it must be bytes")
    if not low <= len(frame) <= high:
        raise LengthError(f"the {kind} frame has {len(frame)} bytes; it must have {low}..{high}")
    return bytes(frame)
