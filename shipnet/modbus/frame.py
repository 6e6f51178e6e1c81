"""Modbus frames, called ADUs in the standard: RTU frames on a serial line, and TCP frames."""

from __future__ import annotations

from struct import pack, unpack
from typing import Literal

from shipnet.crc import MODBUS
from shipnet.errors import ArgumentError, CrcError, FieldError, LengthError
from shipnet.fields import check_choice, check_whole

Framing = Literal["rtu", "tcp"]

#: Longest PDU [byte]: "MODBUS application protocol specification" V1.1b3, section 4.1; and highest
#: address of a slave on a serial line: "MODBUS over serial line" V1.02, section 2.2.
MAX_PDU, MAX_UNIT = 253, 247
RTU_BYTES, MBAP_BYTES = 3, 7  #: Bytes added to a PDU: unit id and CRC in RTU; MBAP header in TCP.


def rtu_frame(unit_id: int, pdu: bytes) -> bytes:
    """Return the RTU frame of a PDU: unit id, PDU, and CRC with its low byte first."""
    body = check_whole("unit_id", unit_id, 0, MAX_UNIT).to_bytes() + pdu
    return body + MODBUS.of(body).to_bytes(2, "little")


def tcp_frame(unit_id: int, pdu: bytes, transaction_id: int) -> bytes:
    """Return the TCP frame of a PDU: MBAP header and PDU."""
    unit = check_whole("unit_id", unit_id, 0, 255)
    transaction = check_whole("transaction_id", transaction_id, 0, 0xFFFF)
    return pack(">HHHB", transaction, 0, len(pdu) + 1, unit) + pdu


def read_frame(data: bytes, framing: Framing) -> tuple[int, bytes, int | None]:
    """Return unit id, PDU and transaction id (None in RTU); raise an error at the first fault."""
    if check_choice("framing", framing, ("rtu", "tcp")) == "tcp":
        frame = _checked_frame(data, "TCP", 1 + MBAP_BYTES, MAX_PDU + MBAP_BYTES)
        transaction, protocol, length, unit = unpack(">HHHB", frame[:MBAP_BYTES])
        if protocol != 0:
            raise FieldError(f"protocol id is {protocol}; it must be 0")
        if length != len(frame) - 6:
            raise LengthError(f"length field is {length}, but {len(frame) - 6} bytes follow it")
        return unit, frame[MBAP_BYTES:], transaction
    frame = _checked_frame(data, "RTU", 1 + RTU_BYTES, MAX_PDU + RTU_BYTES)
    body, received = frame[:-2], int.from_bytes(frame[-2:], "little")
    expected = MODBUS.of(body)
    if received != expected:
        raise CrcError(f"CRC is 0x{received:04X}, but the bytes before it give 0x{expected:04X}")
    if body[0] > MAX_UNIT:
        raise FieldError(f"unit id is {body[0]}; it must be 0..{MAX_UNIT}")
    return body[0], body[1:], None


def checked_pdu(pdu: bytes) -> bytes:
    """Return a bytes-like PDU as bytes; raise an error unless it has 1..253 bytes."""
    if not isinstance(pdu, bytes | bytearray | memoryview) or not 1 <= len(pdu) <= MAX_PDU:
        raise ArgumentError(f"pdu is {pdu!r}; it must be 1..{MAX_PDU} bytes")
    return bytes(pdu)


def _checked_frame(frame: bytes, kind: str, low: int, high: int) -> bytes:
    if not isinstance(frame, (bytes, bytearray, memoryview)):
        raise ArgumentError(f"data is {frame!r}; it must be bytes")
    if not low <= len(frame) <= high:
        raise LengthError(f"the {kind} frame has {len(frame)} bytes; it must have {low}..{high}")
    return bytes(frame)
