"""What a master asks: one small class per shape of a request.

The bytes here are the PDU, function code first, numbers with the high byte first; the frame around
it is made in `shipnet.modbus.frame`.
"""

from __future__ import annotations

from dataclasses import dataclass
from struct import pack

from shipnet.fields import check_whole
from shipnet.modbus.codes import (
    READ_LIMITS,
    WRITE_LIMITS,
    FunctionCode,
    check_coils,
    check_registers,
    pack_coils,
)

__all__ = [
    "ReadRequest",
    "ReadWriteRequest",
    "Request",
    "WriteCoil",
    "WriteCoilsRequest",
    "WriteRegister",
    "WriteRegistersRequest",
]


@dataclass(frozen=True, slots=True)
class ReadRequest:
    """Function codes 1 to 4: read coils, discrete inputs, holding or input registers.

    Parameters
    ----------
    function : FunctionCode
        1, 2, 3 or 4.
    starting_address : int
        Address on the wire, 0..65535; holding register 40001 of a manual is address 0 here.
    quantity : int
        How many: 1..2000 coils or inputs, 1..125 registers.

    Raises
    ------
    ArgumentError
        If a field is out of its range.

    Notes
    -----
    A range that runs beyond address 65535 is a legal request: the slave answers it with exception
    code 2.

    Examples
    --------
    Holding registers 108 to 110, as section 6.3 of the "MODBUS application protocol" V1.1b3:

    >>> ReadRequest(3, 0x6B, 3).pdu.hex(" ")
    '03 00 6b 00 03'
    """

    function: FunctionCode
    starting_address: int
    quantity: int

    def __post_init__(self) -> None:
        """Check every field."""
        function = FunctionCode(check_whole("function", self.function, 1, 4))
        limit, why = READ_LIMITS[function], f" for function code {function}"
        quantity = check_whole("quantity", self.quantity, 1, limit, why)
        object.__setattr__(self, "function", function)
        object.__setattr__(self, "starting_address", _address(self.starting_address))
        object.__setattr__(self, "quantity", quantity)

    @property
    def pdu(self) -> bytes:
        """The bytes, function code first."""
        return pack(">BHH", self.function, self.starting_address, self.quantity)

    @property
    def response_size(self) -> int:
        """Length of the normal response's PDU [byte]."""
        bits = self.function <= FunctionCode.READ_DISCRETE_INPUTS
        return 2 + (-(-self.quantity // 8) if bits else 2 * self.quantity)


@dataclass(frozen=True, slots=True)
class WriteCoil:
    """Function code 5: write one coil. The normal response is the same, an echo.

    Parameters
    ----------
    address : int
        Address on the wire, 0..65535.
    value : bool
        On or off.

    Raises
    ------
    ArgumentError
        If a field is out of its range.

    Examples
    --------
    Coil 173 on, as section 6.5 of the "MODBUS application protocol" V1.1b3:

    >>> WriteCoil(0xAC, True).pdu.hex(" ")
    '05 00 ac ff 00'
    """

    address: int
    value: bool

    def __post_init__(self) -> None:
        """Check every field."""
        object.__setattr__(self, "address", _address(self.address, "address"))
        object.__setattr__(self, "value", check_coils([self.value], 1)[0])

    @property
    def function(self) -> FunctionCode:
        """Function code 5."""
        return FunctionCode.WRITE_SINGLE_COIL

    @property
    def pdu(self) -> bytes:
        """The bytes, function code first."""
        return pack(">BHH", self.function, self.address, 0xFF00 * self.value)

    @property
    def response_size(self) -> int:
        """Length of the normal response's PDU [byte]."""
        return 5


@dataclass(frozen=True, slots=True)
class WriteRegister:
    """Function code 6: write one holding register. The normal response is the same, an echo.

    Parameters
    ----------
    address : int
        Address on the wire, 0..65535.
    value : int
        Register value, 0..65535.

    Raises
    ------
    ArgumentError
        If a field is out of its range.

    Examples
    --------
    Register 2 is set to 3, as section 6.6 of the "MODBUS application protocol" V1.1b3:

    >>> WriteRegister(1, 3).pdu.hex(" ")
    '06 00 01 00 03'
    """

    address: int
    value: int

    def __post_init__(self) -> None:
        """Check every field."""
        object.__setattr__(self, "address", _address(self.address, "address"))
        object.__setattr__(self, "value", check_whole("value", self.value, 0, 0xFFFF))

    @property
    def function(self) -> FunctionCode:
        """Function code 6."""
        return FunctionCode.WRITE_SINGLE_REGISTER

    @property
    def pdu(self) -> bytes:
        """The bytes, function code first."""
        return pack(">BHH", self.function, self.address, self.value)

    @property
    def response_size(self) -> int:
        """Length of the normal response's PDU [byte]."""
        return 5


@dataclass(frozen=True, slots=True)
class WriteCoilsRequest:
    """Function code 15: write coils in a row.

    Parameters
    ----------
    starting_address : int
        Address on the wire of the first, 0..65535.
    coils : sequence of bool
        1..1968 states, that of the lowest address first.

    Raises
    ------
    ArgumentError
        If a field is out of its range.

    Examples
    --------
    Ten coils from 20 on, as section 6.11 of the "MODBUS application protocol" V1.1b3:

    >>> WriteCoilsRequest(0x13, [1, 0, 1, 1, 0, 0, 1, 1, 1, 0]).pdu.hex(" ")
    '0f 00 13 00 0a 02 cd 01'
    """

    starting_address: int
    coils: tuple[bool, ...]

    def __post_init__(self) -> None:
        """Check every field."""
        object.__setattr__(self, "starting_address", _address(self.starting_address))
        object.__setattr__(self, "coils", check_coils(self.coils, WRITE_LIMITS[self.function]))

    @property
    def function(self) -> FunctionCode:
        """Function code 15."""
        return FunctionCode.WRITE_MULTIPLE_COILS

    @property
    def quantity(self) -> int:
        """How many coils."""
        return len(self.coils)

    @property
    def pdu(self) -> bytes:
        """The bytes, function code first."""
        data = pack_coils(self.coils)
        head = (self.function, self.starting_address, self.quantity, len(data))
        return pack(">BHHB", *head) + data

    @property
    def response_size(self) -> int:
        """Length of the normal response's PDU [byte]."""
        return 5


@dataclass(frozen=True, slots=True)
class WriteRegistersRequest:
    """Function code 16: write holding registers in a row.

    Parameters
    ----------
    starting_address : int
        Address on the wire of the first, 0..65535.
    registers : sequence of int
        1..123 values of 0..65535.

    Raises
    ------
    ArgumentError
        If a field is out of its range.

    Examples
    --------
    Two registers from 2 on, as section 6.12 of the "MODBUS application protocol" V1.1b3:

    >>> WriteRegistersRequest(1, [0x000A, 0x0102]).pdu.hex(" ")
    '10 00 01 00 02 04 00 0a 01 02'
    """

    starting_address: int
    registers: tuple[int, ...]

    def __post_init__(self) -> None:
        """Check every field."""
        registers = check_registers(self.registers, WRITE_LIMITS[self.function])
        object.__setattr__(self, "starting_address", _address(self.starting_address))
        object.__setattr__(self, "registers", registers)

    @property
    def function(self) -> FunctionCode:
        """Function code 16."""
        return FunctionCode.WRITE_MULTIPLE_REGISTERS

    @property
    def quantity(self) -> int:
        """How many registers."""
        return len(self.registers)

    @property
    def pdu(self) -> bytes:
        """The bytes, function code first."""
        n = self.quantity
        return pack(f">BHHB{n}H", self.function, self.starting_address, n, 2 * n, *self.registers)

    @property
    def response_size(self) -> int:
        """Length of the normal response's PDU [byte]."""
        return 5


@dataclass(frozen=True, slots=True)
class ReadWriteRequest:
    """Function code 23: write holding registers, then read some, in one transaction.

    Parameters
    ----------
    starting_address : int
        Address on the wire of the first register to read, 0..65535.
    quantity : int
        How many to read, 1..125.
    write_starting_address : int
        Address on the wire of the first register to write, 0..65535.
    registers : sequence of int
        1..121 values of 0..65535 to write.

    Raises
    ------
    ArgumentError
        If a field is out of its range.

    Examples
    --------
    From section 6.17 of the "MODBUS application protocol" V1.1b3:

    >>> ReadWriteRequest(3, 6, 14, [255, 255, 255]).pdu.hex(" ")
    '17 00 03 00 06 00 0e 00 03 06 00 ff 00 ff 00 ff'
    """

    starting_address: int
    quantity: int
    write_starting_address: int
    registers: tuple[int, ...]

    def __post_init__(self) -> None:
        """Check every field."""
        registers = check_registers(self.registers, WRITE_LIMITS[self.function])
        quantity = check_whole("quantity", self.quantity, 1, READ_LIMITS[self.function])
        write_to = _address(self.write_starting_address, "write_starting_address")
        object.__setattr__(self, "starting_address", _address(self.starting_address))
        object.__setattr__(self, "quantity", quantity)
        object.__setattr__(self, "write_starting_address", write_to)
        object.__setattr__(self, "registers", registers)

    @property
    def function(self) -> FunctionCode:
        """Function code 23."""
        return FunctionCode.READ_WRITE_MULTIPLE_REGISTERS

    @property
    def pdu(self) -> bytes:
        """The bytes, function code first."""
        n = len(self.registers)
        read = (self.function, self.starting_address, self.quantity)
        return pack(f">B4HB{n}H", *read, self.write_starting_address, n, 2 * n, *self.registers)

    @property
    def response_size(self) -> int:
        """Length of the normal response's PDU [byte]."""
        return 2 + 2 * self.quantity


#: Any request.
Request = (
    ReadRequest
    | WriteCoil
    | WriteRegister
    | WriteCoilsRequest
    | WriteRegistersRequest
    | ReadWriteRequest
)


def _address(value: int, name: str = "starting_address") -> int:
    return check_whole(name, value, 0, 0xFFFF)
