"""Modbus requests, responses and the frames that carry them.

A PDU consists of a function code and its fields; numbers have their high byte first. An ADU is a
frame: a PDU with a unit id and a CRC on a serial line, or with an MBAP header in TCP. Sections are
those of "MODBUS application protocol specification" V1.1b3, 2012.
"""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass
from enum import IntEnum
from struct import pack, unpack, unpack_from
from typing import Any

from shipnet.errors import (
    ArgumentError,
    FieldError,
    FrameError,
    LengthError,
    MismatchError,
    UnknownCallError,
)
from shipnet.fields import check_whole
from shipnet.lazy import pd
from shipnet.modbus.frame import (
    MAX_PDU,
    MBAP_BYTES,
    Framing,
    checked_pdu,
    read_frame,
    rtu_frame,
    tcp_frame,
)

#: Largest number of coils or registers per request, by function code; section 6.
READ_LIMITS = {1: 2000, 2: 2000, 3: 125, 4: 125}
WRITE_LIMITS = {5: 1, 6: 1, 15: 1968, 16: 123}

_COILS, _CODES = frozenset({1, 2, 5, 15}), "1..6, 15 or 16"


class FunctionCode(IntEnum):
    """The function of a request; section 5.1 of the standard.

    Examples
    --------
    >>> FunctionCode(4).name
    'READ_INPUT_REGISTERS'
    """

    READ_COILS = 1
    READ_DISCRETE_INPUTS = 2
    READ_HOLDING_REGISTERS = 3
    READ_INPUT_REGISTERS = 4
    WRITE_SINGLE_COIL = 5
    WRITE_SINGLE_REGISTER = 6
    WRITE_MULTIPLE_COILS = 15
    WRITE_MULTIPLE_REGISTERS = 16


class ExceptionCode(IntEnum):
    """Why a slave refuses a request; section 7 of the standard.

    Examples
    --------
    >>> ExceptionCode(2).name
    'ILLEGAL_DATA_ADDRESS'
    """

    ILLEGAL_FUNCTION = 1
    ILLEGAL_DATA_ADDRESS = 2
    ILLEGAL_DATA_VALUE = 3
    SERVER_DEVICE_FAILURE = 4
    ACKNOWLEDGE = 5
    SERVER_DEVICE_BUSY = 6
    MEMORY_PARITY_ERROR = 8
    GATEWAY_PATH_UNAVAILABLE = 10
    GATEWAY_TARGET_FAILED_TO_RESPOND = 11


def check_registers(
    registers: Iterable[int], most: int, name: str = "registers"
) -> tuple[int, ...]:
    """Return registers as a tuple; raise an error unless there are 1..most, each 0..65535."""
    values = _sequence(name, registers, most)
    # Plain integers are checked all at once, other values one by one.
    if {type(value) for value in values} == {int} and 0 <= min(values) and max(values) <= 0xFFFF:
        return values
    return tuple(check_whole(f"{name}[{k}]", v, 0, 0xFFFF) for k, v in enumerate(values))


def check_coils(coils: Iterable[bool], most: int, name: str = "coils") -> tuple[bool, ...]:
    """Return coils as a tuple of bool; raise an error unless there are 1..most, each 0 or 1."""
    values = _sequence(name, coils, most)
    for k, value in enumerate(values):
        if type(value).__name__ not in ("bool", "bool_"):  # types of Python and NumPy
            check_whole(f"{name}[{k}]", value, 0, 1)
    return tuple(map(bool, values))


def _bits(data: bytes) -> tuple[bool, ...]:
    """Return the coils that bytes contain, eight per byte, the least significant bit first."""
    return tuple(bool(byte >> bit & 1) for byte in data for bit in range(8))


def exception_code(value: int) -> ExceptionCode:
    """Return a value as an exception code, or raise an error if it is not one."""
    try:
        return ExceptionCode(check_whole("exception", value, 1, 11))
    except ValueError:
        raise ArgumentError(f"exception is {value!r}; it must be 1..6, 8, 10 or 11") from None


def _sequence(name: str, values: Iterable[Any], most: int) -> tuple[Any, ...]:
    try:
        checked = tuple(values)
    except TypeError:
        raise ArgumentError(f"{name} is {values!r}; it must be a sequence of 1..{most}") from None
    if not 1 <= len(checked) <= most:
        raise ArgumentError(f"{name} has {len(checked)} values; it must have 1..{most}")
    return checked


def _function(value: int) -> FunctionCode:
    try:
        return FunctionCode(value)
    except ValueError:
        raise ArgumentError(f"function is {value!r}; it must be {_CODES}") from None


class _Framed:
    """A PDU that can be put into a frame."""

    @property
    def pdu(self) -> bytes:
        """The bytes, function code first."""
        raise NotImplementedError

    def rtu(self, unit_id: int) -> bytes:
        """Return the RTU frame for a unit id."""
        return rtu_frame(unit_id, self.pdu)

    def tcp(self, unit_id: int, transaction_id: int) -> bytes:
        """Return the TCP frame for a unit id and transaction id."""
        return tcp_frame(unit_id, self.pdu, transaction_id)


@dataclass(frozen=True, init=False, repr=False)
class Request(_Framed):
    """A request; its class methods have the names of the standard's functions.

    Addresses are those on the wire, 0..65535: holding register 40001 of a manual has address 0. A
    request may extend beyond address 65535; slaves then respond with exception 2.

    Parameters
    ----------
    function : FunctionCode
        1..6, 15 or 16.
    address : int
        Address of the first coil or register, 0..65535.
    quantity : int, optional
        Number of values to read: 1..2000 coils or inputs, 1..125 registers. In a write,
        the given value is replaced by the number of values to write.
    coils : sequence of bool, optional
        States to write, lowest address first: 1 with code 5, 1..1968 with code 15.
    registers : sequence of int, optional
        Values to write, lowest address first, each 0..65535: 1 with code 6, 1..123 with code 16.

    Examples
    --------
    Holding registers 108 to 110, as in section 6.3 of the standard:

    >>> request = Request.read_holding_registers(0x6B, 3)
    >>> request.rtu(17).hex(" ")
    '11 03 00 6b 00 03 76 87'
    >>> Request.parse(request.pdu)
    Request.read_holding_registers(107, 3)
    >>> request.response([0x022B, 0x0000, 0x0064]).rtu(17).hex(" ")
    '11 03 06 02 2b 00 00 00 64 c8 ba'
    """

    function: FunctionCode
    address: int
    quantity: int = 0
    coils: tuple[bool, ...] = ()
    registers: tuple[int, ...] = ()

    def __init__(
        self,
        function: int,
        address: int,
        quantity: int = 0,
        coils: Iterable[bool] = (),
        registers: Iterable[int] = (),
    ) -> None:
        stored = vars(self)  # `object.__setattr__` is slow
        stored["function"] = _function(function)
        if function in READ_LIMITS:
            why = f" for function code {function}"
            quantity = check_whole("quantity", quantity, 1, READ_LIMITS[function], why)
            coils = registers = ()
        elif function in _COILS:
            coils, registers = check_coils(coils, WRITE_LIMITS[function]), ()
            quantity = len(coils)
        else:
            coils, registers = (), check_registers(registers, WRITE_LIMITS[function])
            quantity = len(registers)
        stored["coils"], stored["registers"] = coils, registers
        stored["address"] = check_whole("address", address, 0, 0xFFFF)
        stored["quantity"] = quantity

    @classmethod
    def read_coils(cls, address: int, quantity: int) -> Request:
        """Request to read 1..2000 coils, function code 1."""
        return cls(1, address, quantity)

    @classmethod
    def read_discrete_inputs(cls, address: int, quantity: int) -> Request:
        """Request to read 1..2000 discrete inputs, function code 2."""
        return cls(2, address, quantity)

    @classmethod
    def read_holding_registers(cls, address: int, quantity: int) -> Request:
        """Request to read 1..125 holding registers, function code 3."""
        return cls(3, address, quantity)

    @classmethod
    def read_input_registers(cls, address: int, quantity: int) -> Request:
        """Request to read 1..125 input registers, function code 4."""
        return cls(4, address, quantity)

    @classmethod
    def write_single_coil(cls, address: int, value: bool) -> Request:
        """Request to write one coil, function code 5."""
        return cls(5, address, coils=(value,))

    @classmethod
    def write_single_register(cls, address: int, value: int) -> Request:
        """Request to write one holding register, function code 6."""
        return cls(6, address, registers=(value,))

    @classmethod
    def write_multiple_coils(cls, address: int, coils: Iterable[bool]) -> Request:
        """Request to write 1..1968 adjacent coils, function code 15."""
        return cls(15, address, coils=coils)

    @classmethod
    def write_multiple_registers(cls, address: int, registers: Iterable[int]) -> Request:
        """Request to write 1..123 adjacent holding registers, function code 16."""
        return cls(16, address, registers=registers)

    @classmethod
    def parse(cls, pdu: bytes) -> Request:
        """Return the request in a PDU, or raise an error that names the wrong field."""
        data, (address, number), values = _read(pdu, "request", _REQUESTS)
        code = data[0]
        try:
            if code in READ_LIMITS:
                return cls(code, address, number)
            if code in (5, 6):
                return cls(code, address, **_single(code, number))
            if code == 16:
                return cls.write_multiple_registers(address, _registers(values, number))
            if -(-number // 8) != len(values):
                count = f"byte count is {len(values)}"
                raise FieldError(f"{count}, which does not fit {number} coils")
            return cls.write_multiple_coils(address, _bits(values)[:number])
        except ArgumentError as error:
            raise FieldError(str(error)) from None

    @property
    def pdu(self) -> bytes:
        """The bytes, function code first."""
        code, address = int(self.function), self.address
        if code in READ_LIMITS:
            return pack(">BHH", code, address, self.quantity)
        if code in (5, 6):
            return pack(">BHH", code, address, _number(self))
        data = _values(self)
        return pack(">BHHB", code, address, self.quantity, len(data)) + data

    @property
    def response_size(self) -> int:
        """Length of the normal response's PDU [byte]."""
        if self.function not in READ_LIMITS:
            return 5
        return 2 + (-(-self.quantity // 8) if self.function in _COILS else 2 * self.quantity)

    def response(self, values: Iterable[int] = ()) -> Response:
        """Return the normal response; for a read, `values` are the requested coils or registers."""
        code = int(self.function)
        if code in (5, 6):
            return Response(code, coils=self.coils, registers=self.registers, address=self.address)
        if code in WRITE_LIMITS:
            return Response(code, address=self.address, quantity=self.quantity)
        checked = _sequence("values", values, self.quantity)
        if len(checked) != self.quantity:
            raise ArgumentError(f"values has {len(checked)} values; {self.quantity} were requested")
        return Response(code, **_named(code, checked))

    def exception(self, exception: int) -> Response:
        """Return the exception response to this request."""
        return Response(self.function, exception=exception_code(exception))

    def __repr__(self) -> str:
        written = list(self.coils or self.registers)
        last = self.quantity if self.function in READ_LIMITS else written
        if self.function in (5, 6):
            (last,) = written
        return f"Request.{self.function.name.lower()}({self.address}, {last})"


@dataclass(frozen=True, slots=True)
class Response(_Framed):
    """A response; `Request.response` and `Request.exception` return one.

    Parameters
    ----------
    function : int
        1..6, 15 or 16; in an exception response 1..127.
    coils : sequence of bool, optional
        1..2000 states read by code 1 or 2, lowest address first; with code 5, the state written.
    registers : sequence of int, optional
        1..125 values read by code 3 or 4, each 0..65535; with code 6, the value written.
    address : int, optional
        First address written by code 5, 6, 15 or 16, 0..65535.
    quantity : int, optional
        Number of coils (1..1968) or registers (1..123) written by code 15 or 16.
    exception : ExceptionCode, optional
        Reason for a refusal: 1..6, 8, 10 or 11. None in a normal response.

    Examples
    --------
    The response in section 6.3 of the standard, and a refusal:

    >>> request = Request.read_holding_registers(0x6B, 3)
    >>> Response.parse(bytes.fromhex("03 06 02 2b 00 00 00 64"), request).registers
    (555, 0, 100)
    >>> Response.parse(bytes.fromhex("83 02"), request).exception.name
    'ILLEGAL_DATA_ADDRESS'
    """

    function: int
    coils: tuple[bool, ...] = ()
    registers: tuple[int, ...] = ()
    address: int | None = None
    quantity: int | None = None
    exception: ExceptionCode | None = None

    def __post_init__(self) -> None:
        put = object.__setattr__
        if self.exception is not None:
            put(self, "function", check_whole("function", self.function, 1, 127))
            put(self, "exception", exception_code(self.exception))
            return
        function = _function(self.function)
        put(self, "function", function)
        code = int(function)
        if code <= 6 and code in _COILS:
            put(self, "coils", check_coils(self.coils, READ_LIMITS.get(code, 1)))
        elif code <= 6:
            put(self, "registers", check_registers(self.registers, READ_LIMITS.get(code, 1)))
        if code in WRITE_LIMITS:
            address: Any = self.address
            put(self, "address", check_whole("address", address, 0, 0xFFFF))
        if code in (15, 16):
            quantity: Any = self.quantity
            why = f" for function code {code}"
            put(self, "quantity", check_whole("quantity", quantity, 1, WRITE_LIMITS[code], why))

    @classmethod
    def parse(cls, pdu: bytes, request: Request | None = None) -> Response:
        """Return the response in a PDU, or raise an error that names the wrong field.

        If a request is given, the response must match it, and padding after its coils is removed.
        """
        if request is not None and not isinstance(request, Request):
            raise ArgumentError(f"request is {request!r}; it must be a Request")
        data, numbers, values = _read(pdu, "response", _RESPONSES)
        code = data[0]
        try:
            if code > 0x80:
                response = cls(code & 0x7F, exception=data[1])  # type: ignore[arg-type]
            elif code in READ_LIMITS:
                decoded = _bits(values) if code in _COILS else _registers(values)
                response = cls(code, **_named(code, decoded))
            elif code in (5, 6):
                response = cls(code, address=numbers[0], **_single(code, numbers[1]))
            else:
                response = cls(code, address=numbers[0], quantity=numbers[1])
        except ArgumentError as error:
            raise FieldError(str(error)) from None
        if request is None:
            return response
        if response.function != request.function:
            raise MismatchError(
                f"function code is {response.function:d}, but {request.function:d} was requested"
            )
        if response.exception is not None:
            return response
        if code in READ_LIMITS:
            if len(data) != request.response_size:
                expected = request.response_size - 2
                raise MismatchError(f"byte count is {data[1]}, but the request requires {expected}")
            return cls(code, response.coils[: request.quantity], response.registers)
        if data != (echo := request.response().pdu):
            raise MismatchError(f"the echo is {data.hex()}; it must be {echo.hex()}")
        return response

    @property
    def pdu(self) -> bytes:
        """The bytes, function code first."""
        code = int(self.function)
        if self.exception is not None:
            return bytes([code | 0x80, self.exception])
        if code in READ_LIMITS:
            data = _values(self)
            return bytes([code, len(data)]) + data
        return pack(">BHH", code, self.address, _number(self) if code <= 6 else self.quantity)


def _named(code: int, values: tuple[Any, ...]) -> dict[str, Any]:
    """Return values as a keyword argument: coils or registers, depending on the function code."""
    return {"coils" if code in _COILS else "registers": values}


def _values(message: Request | Response) -> bytes:
    """Return the coils or registers of a message as bytes."""
    if coils := message.coils:  # the first in the least significant bit, padded with 0
        number = sum(1 << bit for bit, coil in enumerate(coils) if coil)
        return number.to_bytes(-(-len(coils) // 8), "little")
    return pack(f">{len(message.registers)}H", *message.registers)


def _number(message: Request | Response) -> int:
    """Return the number that encodes the single coil or register of a message."""
    return 0xFF00 * message.coils[0] if message.coils else message.registers[0]


def _single(code: int, number: int) -> dict[str, Any]:
    """Return the single coil or register that a number encodes, as a keyword argument."""
    if code == 5 and number not in (0, 0xFF00):
        raise FieldError(f"coil value is 0x{number:04X}; it must be 0x0000 or 0xFF00")
    return _named(code, (number > 0,) if code == 5 else (number,))


#: Fields after the function code of requests and normal responses, by function code. Each has two
#: bytes, except a byte count and the values that it counts. Sections 6.1 to 6.17.
_BLOCK, _ONE = ("starting address", "quantity"), ("address", "value")
_COUNTED = ("byte count", "values")
_REQUESTS: dict[int, tuple[str, ...]] = {
    **dict.fromkeys((1, 2, 3, 4), _BLOCK),
    **dict.fromkeys((5, 6), _ONE),
    **dict.fromkeys((15, 16), _BLOCK + _COUNTED),
}
_RESPONSES: dict[int, tuple[str, ...]] = {
    **dict.fromkeys((1, 2, 3, 4), _COUNTED),
    **dict.fromkeys((5, 6), _ONE),
    **dict.fromkeys((15, 16), _BLOCK),
}


def _read(
    pdu: bytes, kind: str, layouts: dict[int, tuple[str, ...]]
) -> tuple[bytes, tuple[int, ...], bytes]:
    """Return the PDU, its 16-bit fields, and the bytes that follow a byte count."""
    if not isinstance(pdu, bytes | bytearray | memoryview):
        raise ArgumentError(f"pdu is {pdu!r}; it must be bytes")
    if not 1 <= len(pdu) <= MAX_PDU:
        raise LengthError(f"the {kind} has {len(pdu)} bytes; it must have 1..{MAX_PDU}")
    data = bytes(pdu)
    if data[0] > 0x80 and layouts is _RESPONSES:
        if len(data) != 2:
            raise LengthError(f"the exception has {len(data)} bytes; it must have 2")
        return data, (), b""
    if data[0] not in layouts:
        raise UnknownCallError(f"function code is {data[0]}; it must be {_CODES}")
    names = layouts[data[0]]
    counted = names[-1] == "values"
    n = len(names) - 2 * counted
    end = 1 + 2 * n
    if len(data) <= end if counted else len(data) != end:
        needed = f"{end + 1} or more" if counted else end
        raise LengthError(f"the PDU has {len(data)} bytes; it must have {needed}")
    if counted and data[end] != len(data) - end - 1:
        raise LengthError(f"byte count is {data[end]}, but {len(data) - end - 1} bytes follow")
    return data, unpack_from(f">{n}H", data, 1), data[end + 1 :]


def _registers(data: bytes, quantity: int | None = None) -> tuple[int, ...]:
    if len(data) % 2 or quantity not in (None, len(data) // 2):
        needed = "an even number" if quantity is None else f"2 x {quantity}"
        raise FieldError(f"byte count is {len(data)}; it must be {needed}")
    return unpack(f">{len(data) // 2}H", data)


@dataclass(frozen=True, slots=True)
class Adu:
    r"""A frame: the unit id and the PDU.

    Parameters
    ----------
    unit_id : int
        Address of the slave, 0..255; on a serial line 0..247, where 0 means a broadcast.
    pdu : bytes or Request or Response
        1..253 bytes, function code first; a request or response is converted.
    transaction_id : int, optional
        Number that pairs a TCP response with its request, 0..65535; None on a serial line.

    Examples
    --------
    >>> adu = Adu(17, Request.read_holding_registers(0x6B, 3))
    >>> adu.rtu.hex(" ")
    '11 03 00 6b 00 03 76 87'
    >>> adu.request()
    Request.read_holding_registers(107, 3)
    """

    unit_id: int
    pdu: bytes
    transaction_id: int | None = None

    def __post_init__(self) -> None:
        put, pdu = object.__setattr__, getattr(self.pdu, "pdu", self.pdu)
        put(self, "unit_id", check_whole("unit_id", self.unit_id, 0, 255))
        put(self, "pdu", checked_pdu(pdu))
        if self.transaction_id is not None:
            number = check_whole("transaction_id", self.transaction_id, 0, 0xFFFF)
            put(self, "transaction_id", number)

    @property
    def rtu(self) -> bytes:
        """RTU frame of 4..256 bytes: unit id, PDU, CRC with its low byte first."""
        return rtu_frame(self.unit_id, self.pdu)

    @property
    def tcp(self) -> bytes:
        """TCP frame, 8..260 bytes: transaction id (0 if None), protocol 0, length, unit id, PDU."""
        return tcp_frame(self.unit_id, self.pdu, self.transaction_id or 0)

    @property
    def frame(self) -> bytes:
        """TCP frame if there is a transaction id, otherwise RTU frame."""
        return self.rtu if self.transaction_id is None else self.tcp

    def request(self) -> Request:
        """Return the request in the PDU, or raise an error that names the wrong field."""
        return Request.parse(self.pdu)

    def response(self, request: Request | None = None) -> Response:
        """Return the response in the PDU, checked against the request if one is given."""
        return Response.parse(self.pdu, request)

    def table(self) -> pd.DataFrame:
        """Return the bytes of each field: as TCP if there is a transaction id, otherwise as RTU.

        A PDU that is valid both as a request and as a response is read as a request.
        """
        if self.transaction_id is None:
            fields, tail = {"unit id": self.rtu[:1]}, {"CRC": self.rtu[-2:]}
        else:
            head = self.tcp[:MBAP_BYTES]
            header = ("transaction id", "protocol id", "length", "unit id")
            fields, tail = {name: head[2 * k :][:2] for k, name in enumerate(header)}, {}
        fields["function code"], data = self.pdu[:1], self.pdu[1:]
        names: tuple[str, ...] = ("data",) if data else ()  # of an invalid PDU
        for parse, layouts in ((Response.parse, _RESPONSES), (Request.parse, _REQUESTS)):
            with suppress(FrameError):
                parse(self.pdu)
                names = layouts.get(self.pdu[0], ("exception code",))
        for name in names:
            size = 1 if name == "byte count" else len(data) if name in ("values", "data") else 2
            fields[name], data = data[:size], data[size:]
        table = {name: part.hex(" ") for name, part in (fields | tail).items()}
        return pd.Series(table, name="bytes").rename_axis("field").to_frame()


def decode(data: bytes, framing: Framing = "rtu") -> Adu:
    r"""Return the contents of a frame.

    Parameters
    ----------
    data : bytes-like
        One whole frame.
    framing : {"rtu", "tcp"}, default "rtu"
        Kind of frame.

    Returns
    -------
    Adu
        Unit id, PDU and, in TCP, the transaction id.

    Raises
    ------
    LengthError
        If the frame is too short or too long, or its length field is wrong.
    CrcError
        If the CRC is wrong.
    FieldError
        If the unit id in RTU is reserved (248..255), or the protocol id in TCP is not 0.

    Examples
    --------
    >>> decode(bytes.fromhex("11 03 00 6b 00 03 76 87")).unit_id
    17
    """
    return Adu(*read_frame(data, framing))
