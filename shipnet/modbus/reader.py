"""Read requests and responses from the bytes of a PDU; every fault is named with its field."""

from __future__ import annotations

from struct import unpack

from shipnet.errors import (
    ArgumentError,
    FieldError,
    LengthError,
    MismatchError,
    UnknownCallError,
)
from shipnet.modbus.codes import LARGEST_PDU, FunctionCode, unpack_coils
from shipnet.modbus.request import (
    ReadRequest,
    ReadWriteRequest,
    Request,
    WriteCoil,
    WriteCoilsRequest,
    WriteRegister,
    WriteRegistersRequest,
)
from shipnet.modbus.response import (
    ExceptionResponse,
    ReadBitsResponse,
    ReadRegistersResponse,
    Response,
    WriteResponse,
)

__all__ = ["decode_request", "decode_response"]


def decode_request(pdu: bytes) -> Request:
    """Return the request that a PDU is.

    Parameters
    ----------
    pdu : bytes-like
        The bytes, function code first.

    Returns
    -------
    Request
        An object of one of the request classes.

    Raises
    ------
    LengthError
        If there are too few or too many bytes, or not as many as a byte count says.
    UnknownCallError
        If the function code is none of 1..6, 15, 16 and 23.
    FieldError
        If a quantity, a byte count or a coil value is none that the standard allows.
    ArgumentError
        If `pdu` are no bytes.

    Notes
    -----
    The unused bits of the last byte of coils are not looked at.

    Examples
    --------
    >>> decode_request(bytes.fromhex("0440200004"))
    ReadRequest(function=<FunctionCode.READ_INPUT_REGISTERS: 4>, starting_address=16416, quantity=4)
    >>> decode_request(bytes.fromhex("040000007E"))
    Traceback (most recent call last):
        ...
    shipnet.errors.FieldError: quantity is 126; it must be a whole number 1..125 for function code 4
    """
    data, function = _opened(pdu, "request")
    try:
        return _request(function, data)
    except ArgumentError as error:
        raise FieldError(str(error)) from None


def decode_response(pdu: bytes, request: Request | None = None) -> Response:
    """Return the response that a PDU is.

    Parameters
    ----------
    pdu : bytes-like
        The bytes, function code first.
    request : Request, optional
        What was asked. With it the response is compared, and coils are cut to their quantity,
        which their bytes alone do not tell.

    Returns
    -------
    Response
        An object of one of the response classes; `WriteCoil` and `WriteRegister` are echoes.

    Raises
    ------
    LengthError
        If there are too few or too many bytes, or not as many as a byte count says.
    UnknownCallError
        If the function code, without its highest bit, is none of 1..6, 15, 16 and 23. An exception
        may refuse any code from 1 on.
    FieldError
        If a quantity, a byte count, a coil value or an exception code is none that the standard
        allows.
    MismatchError
        If it does not answer `request`.
    ArgumentError
        If `pdu` are no bytes, or `request` is no request.

    Examples
    --------
    >>> decode_response(bytes.fromhex("8402")).exception.name
    'ILLEGAL_DATA_ADDRESS'
    >>> request = ReadRequest(3, 0, 4)
    >>> decode_response(bytes.fromhex("0304000A000B"), request)
    Traceback (most recent call last):
        ...
    shipnet.errors.MismatchError: byte count is 4, but what was asked makes 8
    """
    if request is not None and not isinstance(request, Request):
        raise ArgumentError(f"request is {request!r}; it must be a request")
    data, function = _opened(pdu, "response")
    try:
        response = _response(function, data)
    except ArgumentError as error:
        raise FieldError(str(error)) from None
    return response if request is None else _answer(request, response, data)


def _opened(pdu: bytes, kind: str) -> tuple[bytes, int]:
    if not isinstance(pdu, bytes | bytearray | memoryview):
        raise ArgumentError(f"pdu is {pdu!r}; it must be bytes")
    data = bytes(pdu)
    if not 1 <= len(data) <= LARGEST_PDU:
        raise LengthError(f"the {kind} has {len(data)} bytes; it must have 1..{LARGEST_PDU}")
    return data, data[0]


def _request(function: int, data: bytes) -> Request:
    match function:
        case 1 | 2 | 3 | 4:
            return ReadRequest(FunctionCode(function), *_two(data))
        case 5 | 6:
            return _single(function, data)
        case 15:
            start, quantity = unpack(">HH", _part(data, 6)[1:5])
            coils = unpack_coils(_counted(data, 5))
            if -(-quantity // 8) != data[5]:
                raise FieldError(f"byte count is {data[5]}, but {quantity} coils need another")
            return WriteCoilsRequest(start, coils[:quantity])
        case 16:
            start, quantity = unpack(">HH", _part(data, 6)[1:5])
            return WriteRegistersRequest(start, _registers(_counted(data, 5), quantity))
        case 23:
            read, quantity, write, n = unpack(">4H", _part(data, 10)[1:9])
            registers = _registers(_counted(data, 9), n)
            return ReadWriteRequest(read, quantity, write, registers)
    raise UnknownCallError(f"function code is {function}; it must be 1..6, 15, 16 or 23")


def _response(function: int, data: bytes) -> Response:
    match function:
        case 1 | 2:
            return ReadBitsResponse(FunctionCode(function), unpack_coils(_counted(data, 1)))
        case 3 | 4 | 23:
            registers = _registers(_counted(data, 1))
            return ReadRegistersResponse(FunctionCode(function), registers)
        case 5 | 6:
            return _single(function, data)
        case 15 | 16:
            return WriteResponse(FunctionCode(function), *_two(data))
        case refused if refused > 0x80:
            if len(data) != 2:
                raise LengthError(f"the exception has {len(data)} bytes; it must have 2")
            return ExceptionResponse(refused & 0x7F, data[1])  # type: ignore[arg-type]
    raise UnknownCallError(f"function code is {function}; it must be 1..6, 15, 16 or 23")


def _single(function: int, data: bytes) -> WriteCoil | WriteRegister:
    address, value = _two(data)
    if function == FunctionCode.WRITE_SINGLE_REGISTER:
        return WriteRegister(address, value)
    if value not in (0, 0xFF00):
        raise FieldError(f"coil value is 0x{value:04X}; it must be 0x0000 or 0xFF00")
    return WriteCoil(address, bool(value))


def _answer(request: Request, response: Response, data: bytes) -> Response:
    """Return the response, or raise if it answers something else."""
    if response.function != request.function:
        raise MismatchError(
            f"function code is {response.function}, but {request.function} was asked"
        )
    match response:
        case ReadBitsResponse() | ReadRegistersResponse() if len(data) != request.response_size:
            expected = request.response_size - 2
            raise MismatchError(f"byte count is {data[1]}, but what was asked makes {expected}")
        case ReadBitsResponse() if isinstance(request, ReadRequest):
            return ReadBitsResponse(response.function, response.coils[: request.quantity])
        case WriteCoil() | WriteRegister() if response != request:
            raise MismatchError(f"the echo is {data.hex()}, but {request.pdu.hex()} was asked")
        case WriteResponse() if data[1:] != request.pdu[1:5]:
            raise MismatchError(
                f"address and quantity are {data[1:].hex()}, but {request.pdu[1:5].hex()} was asked"
            )
    return response


def _part(data: bytes, least: int) -> bytes:
    if len(data) < least:
        raise LengthError(f"the PDU has {len(data)} bytes; it must have {least} or more")
    return data


def _two(data: bytes) -> tuple[int, int]:
    """Read the two fields of a PDU that has 5 bytes."""
    if len(data) != 5:
        raise LengthError(f"the PDU has {len(data)} bytes; it must have 5")
    first, second = unpack(">HH", data[1:])
    return first, second


def _counted(data: bytes, place: int) -> bytes:
    """Return what stands behind a byte count."""
    rest = _part(data, place + 1)[place + 1 :]
    if data[place] != len(rest):
        raise LengthError(f"byte count is {data[place]}, but {len(rest)} bytes follow")
    return rest


def _registers(data: bytes, quantity: int | None = None) -> tuple[int, ...]:
    if len(data) % 2 or quantity not in (None, len(data) // 2):
        needed = "an even number" if quantity is None else f"2 x {quantity}"
        raise FieldError(f"byte count is {len(data)}; it must be {needed}")
    return unpack(f">{len(data) // 2}H", data)
