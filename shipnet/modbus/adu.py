"""The frame around a PDU, called ADU in the standard: RTU and ASCII on a serial line, and TCP."""

from __future__ import annotations

from dataclasses import dataclass
from struct import pack, unpack
from typing import TYPE_CHECKING, ClassVar, Literal

from shipnet.crc import MODBUS
from shipnet.errors import (
    ArgumentError,
    CrcError,
    FieldError,
    FormError,
    FrameError,
    LengthError,
    SymbolError,
)
from shipnet.fields import check_whole
from shipnet.modbus.pdu import MAX_PDU, READ_LIMITS, Request, Response

if TYPE_CHECKING:
    import pandas as pd

#: Highest address of a slave on a serial line; 248..255 are reserved. "MODBUS over serial line"
#: V1.02, section 2.2.
MAX_UNIT = 247

#: Bytes that a frame adds to its PDU: unit id and CRC; MBAP header.
_RTU, _MBAP = 3, 7

_HEXADECIMAL = frozenset(b"0123456789ABCDEFabcdef")


@dataclass(frozen=True, slots=True)
class Adu:
    r"""A frame: who is asked or answers, and the PDU.

    Parameters
    ----------
    unit_id : int
        Address of the slave, 0..255; on a serial line 0..247, where 0 is the broadcast.
    pdu : bytes or Request or Response
        1..253 bytes, function code first; a request or a response is turned into them.
    transaction_id : int, optional
        Number that pairs a response with its request in TCP, 0..65535; None on a serial line.

    Raises
    ------
    ArgumentError
        If an argument is out of its range.

    Examples
    --------
    >>> adu = Adu(17, Request.read_holding_registers(0x6B, 3))
    >>> adu.rtu.hex(" "), adu.ascii
    ('11 03 00 6b 00 03 76 87', b':1103006B00037E\r\n')
    >>> adu.request()
    Request.read_holding_registers(107, 3)
    """

    unit_id: int
    pdu: bytes
    transaction_id: int | None = None

    #: Longest PDU [byte], and highest address of a slave on a serial line.
    MAX_PDU: ClassVar[int] = MAX_PDU
    MAX_UNIT: ClassVar[int] = MAX_UNIT

    def __post_init__(self) -> None:
        """Check every field."""
        put, unit, pdu = object.__setattr__, self.unit_id, self.pdu
        if not (type(unit) is int and 0 <= unit <= 255):
            put(self, "unit_id", check_whole("unit_id", unit, 0, 255))
        if not (type(pdu) is bytes and 1 <= len(pdu) <= MAX_PDU):
            put(self, "pdu", _checked_pdu(getattr(pdu, "pdu", pdu)))
        if self.transaction_id is not None:
            number = check_whole("transaction_id", self.transaction_id, 0, 0xFFFF)
            put(self, "transaction_id", number)

    @property
    def rtu(self) -> bytes:
        """The RTU frame of 4..256 bytes: unit id, PDU, CRC with its low byte first."""
        return rtu_frame(self.unit_id, self.pdu)

    @property
    def ascii(self) -> bytes:
        """The ASCII frame of 9..513 characters: colon, hexadecimals with their LRC, CR, LF."""
        body = bytes([check_whole("unit_id", self.unit_id, 0, MAX_UNIT)]) + self.pdu
        return b":%s\r\n" % (body + bytes([_lrc(body)])).hex().upper().encode()

    @property
    def tcp(self) -> bytes:
        """The TCP frame of 8..260 bytes: transaction id (0 if None), protocol id 0, length, unit id, PDU."""  # noqa: E501
        return tcp_frame(self.unit_id, self.pdu, self.transaction_id or 0)

    def request(self) -> Request:
        """Return the request that the PDU is, or raise the error that names the wrong field."""
        return Request.parse(self.pdu)

    def response(self, request: Request | None = None) -> Response:
        """Return the response that the PDU is, compared with the request if it is given."""
        return Response.parse(self.pdu, request)

    def table(self) -> pd.DataFrame:
        """Return the bytes of each field, in order; a PDU that may be either is read as a request.

        With a transaction id the frame is that of TCP, else RTU.
        """
        import pandas as pd

        if self.transaction_id is None:
            fields, rest = {"unit id": self.rtu[:1]}, {"CRC": self.rtu[-2:]}
        else:
            head = self.tcp[:_MBAP]
            fields = {
                "transaction id": head[:2],
                "protocol id": head[2:4],
                "length": head[4:6],
                "unit id": head[6:],
            }
            rest = {}
        fields |= _fields(self.pdu) | rest
        return pd.DataFrame(
            {"bytes": [part.hex(" ") for part in fields.values()]},
            index=pd.Index(list(fields), name="field"),
        )


def decode(data: bytes, framing: Literal["rtu", "tcp", "ascii"] = "rtu") -> Adu:
    r"""Return what a frame carries.

    Parameters
    ----------
    data : bytes-like
        One whole frame. On a serial line silence shows where an RTU frame ends; in a stream of TCP
        its length field (bytes 4 and 5) does; an ASCII frame includes colon and line end.
    framing : {"rtu", "tcp", "ascii"}, default "rtu"
        Kind of frame.

    Returns
    -------
    Adu
        Unit id and PDU, in TCP the transaction id too.

    Raises
    ------
    LengthError
        If the frame is too short or too long, does not have as many bytes as its length field
        says, or has half a byte too many.
    CrcError
        If the CRC or LRC differs from that of the bytes before it.
    FormError, SymbolError
        If the colon or line end of an ASCII frame is missing, or a character is not hexadecimal.
    FieldError
        If the unit id is reserved, or the protocol id of TCP is not 0.
    ArgumentError
        If `data` is not bytes, or `framing` is unknown.

    Examples
    --------
    >>> decode(bytes.fromhex("11 03 00 6b 00 03 76 87")).unit_id
    17
    >>> decode(b":1103006B00037E\r\n", "ascii").pdu.hex(" ")
    '03 00 6b 00 03'
    >>> decode(bytes.fromhex("15 01 00 00 00 06 ff 03 00 04 00 01"), "tcp").transaction_id == 0x1501
    True
    """
    if framing == "rtu":
        frame = _checked_frame(data, "RTU", 1 + _RTU, MAX_PDU + _RTU)
        body, found = frame[:-2], int.from_bytes(frame[-2:], "little")
        expected = MODBUS.of(body)
        if found != expected:
            raise CrcError(f"CRC is 0x{found:04X}, but the bytes before it make 0x{expected:04X}")
        return Adu(_serial_unit(body[0]), body[1:])
    if framing == "tcp":
        frame = _checked_frame(data, "TCP", 1 + _MBAP, MAX_PDU + _MBAP)
        transaction, protocol, length, unit = unpack(">HHHB", frame[:_MBAP])
        if protocol != 0:
            raise FieldError(f"protocol id is {protocol}; it must be 0")
        if length != len(frame) - 6:
            raise LengthError(f"length field is {length}, but {len(frame) - 6} bytes follow it")
        return Adu(unit, frame[_MBAP:], transaction)
    if framing == "ascii":
        return _decode_ascii(data)
    raise ArgumentError(f"framing is {framing!r}; it must be 'rtu', 'tcp' or 'ascii'")


def rtu_frame(unit_id: int, pdu: bytes) -> bytes:
    """Return the RTU frame of a PDU."""
    unit = unit_id if type(unit_id) is int and 0 <= unit_id <= MAX_UNIT else None
    if unit is None:
        unit = check_whole("unit_id", unit_id, 0, MAX_UNIT)
    body = bytes((unit,)) + _checked_pdu(pdu)
    return body + MODBUS.of(body).to_bytes(2, "little")


def tcp_frame(unit_id: int, pdu: bytes, transaction_id: int) -> bytes:
    """Return the TCP frame of a PDU."""
    body = _checked_pdu(pdu)
    unit = check_whole("unit_id", unit_id, 0, 255)
    transaction = check_whole("transaction_id", transaction_id, 0, 0xFFFF)
    return pack(">HHHB", transaction, 0, len(body) + 1, unit) + body


def _decode_ascii(data: bytes) -> Adu:
    frame = _checked_frame(data, "ASCII", 9, 2 * (MAX_PDU + 2) + 3)
    if frame[:1] != b":" or frame[-2:] != b"\r\n":
        raise FormError("an ASCII frame begins with ':' and ends with carriage return, line feed")
    digits = frame[1:-2]
    if odd := set(digits) - _HEXADECIMAL:
        raise SymbolError(f"{bytes([min(odd)])!r} is not a hexadecimal digit")
    if len(digits) % 2:
        raise LengthError(f"the ASCII frame has {len(digits)} digits; two make a byte")
    values = bytes.fromhex(digits.decode())
    body, found = values[:-1], values[-1]
    if found != _lrc(body):
        raise CrcError(f"LRC is 0x{found:02X}, but the bytes before it make 0x{_lrc(body):02X}")
    return Adu(_serial_unit(body[0]), body[1:])


def _fields(pdu: bytes) -> dict[str, bytes]:
    """Return the bytes of a PDU by field."""
    fields = {"function code": pdu[:1]}
    code, rest = pdu[0], pdu[1:]
    try:
        Request.parse(pdu)
    except FrameError:
        pass
    else:
        if code in (5, 6):
            return fields | {"address": rest[:2], "value": rest[2:]}
        fields |= {"starting address": rest[:2], "quantity": rest[2:4]}
        if code in (15, 16):
            fields |= {"byte count": rest[4:5], "values": rest[5:]}
        elif code == 23:
            fields |= {"write starting address": rest[4:6], "write quantity": rest[6:8]}
            fields |= {"byte count": rest[8:9], "values": rest[9:]}
        return fields
    try:
        response = Response.parse(pdu)
    except FrameError:
        return fields | ({"data": rest} if rest else {})
    if response.exception is not None:
        return fields | {"exception code": rest}
    if code in READ_LIMITS:
        return fields | {"byte count": rest[:1], "values": rest[1:]}
    return fields | {"starting address": rest[:2], "quantity": rest[2:]}


def _lrc(body: bytes) -> int:
    """Return what makes the sum of all bytes 0."""
    return -sum(body) & 0xFF


def _serial_unit(unit: int) -> int:
    if unit > MAX_UNIT:
        raise FieldError(f"unit id is {unit}; it must be 0..{MAX_UNIT}")
    return unit


def _checked_pdu(pdu: bytes) -> bytes:
    if type(pdu) is bytes and 1 <= len(pdu) <= MAX_PDU:
        return pdu
    if not isinstance(pdu, bytes | bytearray | memoryview) or not 1 <= len(pdu) <= MAX_PDU:
        raise ArgumentError(f"pdu is {pdu!r}; it must be 1..{MAX_PDU} bytes")
    return bytes(pdu)


def _checked_frame(frame: bytes, kind: str, low: int, high: int) -> bytes:
    if not isinstance(frame, (bytes, bytearray, memoryview)):
        raise ArgumentError(f"frame is {frame!r}; it must be bytes")
    if not low <= len(frame) <= high:
        raise LengthError(f"the {kind} frame has {len(frame)} bytes; it must have {low}..{high}")
    return bytes(frame)
