"""What a slave answers: one small class per shape of a response.

The echoes of function codes 5 and 6 are `WriteCoil` and `WriteRegister` themselves.
"""

from __future__ import annotations

from dataclasses import dataclass
from struct import pack

from shipnet.errors import ArgumentError
from shipnet.fields import check_whole
from shipnet.modbus.codes import (
    READ_LIMITS,
    WRITE_LIMITS,
    ExceptionCode,
    FunctionCode,
    check_coils,
    check_registers,
    pack_coils,
)
from shipnet.modbus.request import WriteCoil, WriteRegister

__all__ = [
    "ExceptionResponse",
    "ReadBitsResponse",
    "ReadRegistersResponse",
    "Response",
    "WriteResponse",
]


@dataclass(frozen=True, slots=True)
class ReadBitsResponse:
    """The coils or discrete inputs that function code 1 or 2 asked for.

    Parameters
    ----------
    function : FunctionCode
        1 or 2.
    coils : sequence of bool
        1..2000 states, that of the lowest address first.

    Raises
    ------
    ArgumentError
        If a field is out of its range.

    Examples
    --------
    >>> ReadBitsResponse(1, [1, 0, 1, 1, 0, 0, 1, 1]).pdu.hex(" ")
    '01 01 cd'
    """

    function: FunctionCode
    coils: tuple[bool, ...]

    def __post_init__(self) -> None:
        """Check every field."""
        function = FunctionCode(check_whole("function", self.function, 1, 2))
        object.__setattr__(self, "function", function)
        object.__setattr__(self, "coils", check_coils(self.coils, READ_LIMITS[function]))

    @property
    def pdu(self) -> bytes:
        """The bytes, function code first."""
        data = pack_coils(self.coils)
        return bytes([self.function, len(data)]) + data


@dataclass(frozen=True, slots=True)
class ReadRegistersResponse:
    """The registers that function code 3, 4 or 23 asked for.

    Parameters
    ----------
    function : FunctionCode
        3, 4 or 23.
    registers : sequence of int
        1..125 values of 0..65535.

    Raises
    ------
    ArgumentError
        If a field is out of its range.

    Examples
    --------
    The answer of section 6.3 of the "MODBUS application protocol" V1.1b3:

    >>> ReadRegistersResponse(3, [0x022B, 0x0000, 0x0064]).pdu.hex(" ")
    '03 06 02 2b 00 00 00 64'
    """

    function: FunctionCode
    registers: tuple[int, ...]

    def __post_init__(self) -> None:
        """Check every field."""
        function = _one_of(self.function, (3, 4, 23))
        registers = check_registers(self.registers, READ_LIMITS[function])
        object.__setattr__(self, "function", function)
        object.__setattr__(self, "registers", registers)

    @property
    def pdu(self) -> bytes:
        """The bytes, function code first."""
        n = len(self.registers)
        return pack(f">BB{n}H", self.function, 2 * n, *self.registers)


@dataclass(frozen=True, slots=True)
class WriteResponse:
    """How much function code 15 or 16 wrote, and where.

    Parameters
    ----------
    function : FunctionCode
        15 or 16.
    starting_address : int
        Address on the wire of the first, 0..65535.
    quantity : int
        1..1968 coils or 1..123 registers.

    Raises
    ------
    ArgumentError
        If a field is out of its range.

    Examples
    --------
    >>> WriteResponse(16, 1, 2).pdu.hex(" ")
    '10 00 01 00 02'
    """

    function: FunctionCode
    starting_address: int
    quantity: int

    def __post_init__(self) -> None:
        """Check every field."""
        function = _one_of(self.function, (15, 16))
        address = check_whole("starting_address", self.starting_address, 0, 0xFFFF)
        why = f" for function code {function}"
        quantity = check_whole("quantity", self.quantity, 1, WRITE_LIMITS[function], why)
        object.__setattr__(self, "function", function)
        object.__setattr__(self, "starting_address", address)
        object.__setattr__(self, "quantity", quantity)

    @property
    def pdu(self) -> bytes:
        """The bytes, function code first."""
        return pack(">BHH", self.function, self.starting_address, self.quantity)


@dataclass(frozen=True, slots=True)
class ExceptionResponse:
    """A refusal: the function code with its highest bit set, and the reason.

    Parameters
    ----------
    function : int
        The function code refused, 1..127; a slave refuses codes too that are not in
        `FunctionCode`.
    exception : ExceptionCode
        1..6, 8, 10 or 11.

    Raises
    ------
    ArgumentError
        If a field is out of its range.

    Examples
    --------
    >>> ExceptionResponse(4, 2).pdu.hex(" ")
    '84 02'
    """

    function: int
    exception: ExceptionCode

    def __post_init__(self) -> None:
        """Check every field."""
        function = check_whole("function", self.function, 1, 127)
        code = check_whole("exception", self.exception, 1, 11)
        if code not in {known.value for known in ExceptionCode}:
            raise ArgumentError(f"exception is {code}; it must be 1..6, 8, 10 or 11")
        object.__setattr__(self, "function", function)
        object.__setattr__(self, "exception", ExceptionCode(code))

    @property
    def pdu(self) -> bytes:
        """The bytes, function code first."""
        return bytes([self.function | 0x80, self.exception])


#: Any response.
Response = (
    ReadBitsResponse
    | ReadRegistersResponse
    | WriteCoil
    | WriteRegister
    | WriteResponse
    | ExceptionResponse
)


def _one_of(function: int, legal: tuple[int, ...]) -> FunctionCode:
    whole = check_whole("function", function, 1, 127)
    if whole not in legal:
        raise ArgumentError(f"function is {whole}; it must be one of {legal}")
    return FunctionCode(whole)
