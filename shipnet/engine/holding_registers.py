"""The Modbus side of a junction box: holding registers that function code 3 alone can read."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from shipnet.errors import ArgumentError, FieldError, LengthError, check_whole
from shipnet.modbus.codes import ExceptionCode, FunctionCode
from shipnet.modbus.reader import decode_request
from shipnet.modbus.request import ReadRequest
from shipnet.modbus.response import ExceptionResponse, ReadRegistersResponse

__all__ = ["HoldingRegisters", "answer"]

_READ = FunctionCode.READ_HOLDING_REGISTERS


class HoldingRegisters(Sequence[int]):
    """Registers in a row, as a device holds them.

    Parameters
    ----------
    registers : iterable of int
        1..65536 values of 0..65535.
    first_address : int, default 0
        Address on the wire of the first, 0..65535.

    Raises
    ------
    ArgumentError
        If a number is out of range, or the last address would be.

    Examples
    --------
    >>> box = HoldingRegisters([10, 20, 30], first_address=100)
    >>> box.read(101, 2)
    (20, 30)
    >>> box.write([1, 2, 3])
    >>> box.answer(bytes.fromhex("03 0064 0002")).hex(" ")
    '03 04 00 01 00 02'
    """

    __slots__ = ("_registers", "first_address")

    def __init__(self, registers: Iterable[int], *, first_address: int = 0) -> None:
        self.first_address = check_whole("first_address", first_address, 0, 0xFFFF)
        self._registers = _checked(registers, 0x10000 - self.first_address)

    def __len__(self) -> int:
        return len(self._registers)

    def __getitem__(self, key):  # type: ignore[no-untyped-def] # as a tuple does
        return self._registers[key]

    def write(self, registers: Iterable[int]) -> None:
        """Put new values in place of all registers at once, as the box does after a scan.

        Parameters
        ----------
        registers : iterable of int
            As many values of 0..65535 as there are registers.
        """
        new = _checked(registers, len(self))
        if len(new) != len(self):
            raise ArgumentError(f"registers has {len(new)} values; it must have {len(self)}")
        self._registers = new

    def read(self, address: int, quantity: int) -> tuple[int, ...]:
        """Return registers in a row.

        Parameters
        ----------
        address : int
            Address on the wire of the first.
        quantity : int
            How many, 1..125.

        Raises
        ------
        ArgumentError
            If one of them does not exist.
        """
        count = check_whole("quantity", quantity, 1, 125)
        last = self.first_address + len(self) - 1
        start = check_whole("address", address, self.first_address, last)
        if start + count - 1 > last:
            raise ArgumentError(
                f"addresses {start}..{start + count - 1} are asked for; the registers are "
                f"{self.first_address}..{last}"
            )
        place = start - self.first_address
        return self._registers[place : place + count]

    def answer(self, pdu: bytes) -> bytes:
        """Return the response to a request, as `answer` does.

        Parameters
        ----------
        pdu : bytes-like
            Request, function code first.
        """
        function = _function(pdu)
        if not 1 <= function <= 127:
            return b""
        if function != _READ:
            return ExceptionResponse(function, ExceptionCode.ILLEGAL_FUNCTION).pdu
        try:
            request = decode_request(pdu)
        except (LengthError, FieldError):
            return ExceptionResponse(function, ExceptionCode.ILLEGAL_DATA_VALUE).pdu
        assert isinstance(request, ReadRequest)  # function code 3 has no other shape
        try:
            registers = self.read(request.starting_address, request.quantity)
        except ArgumentError:
            return ExceptionResponse(function, ExceptionCode.ILLEGAL_DATA_ADDRESS).pdu
        return ReadRegistersResponse(_READ, registers).pdu


def answer(pdu: bytes, registers: Iterable[int], *, first_address: int = 0) -> bytes:
    """Return the response of a device that knows function code 3 alone.

    Parameters
    ----------
    pdu : bytes-like
        Request, function code first; any bytes.
    registers : iterable of int
        1..65536 values of 0..65535.
    first_address : int, default 0
        Address on the wire of the first, 0..65535.

    Returns
    -------
    bytes
        PDU of the response. Exception 1 for another function code, 3 for a quantity that is not
        1..125 or a wrong length, 2 for a register that does not exist, checked in this order [1]_.
        No bytes, which is silence, to what is no request: nothing at all, function code 0, or a
        code from 128 on.

    Raises
    ------
    ArgumentError
        If `pdu` are no bytes, or a register or address is out of range.

    Notes
    -----
    lee2012 says that only the response to the monitoring system is supported (section IV.1.a), not
    what follows any other request; this is what the standard asks for.

    References
    ----------
    .. [1] "MODBUS application protocol" V1.1b3, sections 6.3 and 7.

    Examples
    --------
    >>> requests = ("03 0000 0002", "03 0001 0002", "03 0000 0000", "04 0000 0001", "83 01")
    >>> [answer(bytes.fromhex(request), [0x1234, 7]).hex(" ") for request in requests]
    ['03 04 12 34 00 07', '83 02', '83 03', '84 01', '']
    """
    return HoldingRegisters(registers, first_address=first_address).answer(pdu)


def _function(pdu: bytes) -> int:
    if not isinstance(pdu, bytes | bytearray | memoryview):
        raise ArgumentError(f"pdu is {pdu!r}; it must be bytes")
    data = bytes(pdu)
    return data[0] if data else 0


def _checked(registers: Iterable[int], most: int) -> tuple[int, ...]:
    try:
        found = tuple(registers)
    except TypeError:
        raise ArgumentError(f"registers is {registers!r}; it must be a sequence") from None
    if not 1 <= len(found) <= most:
        raise ArgumentError(f"registers has {len(found)} values; it must have 1..{most}")
    return tuple(check_whole(f"registers[{k}]", v, 0, 0xFFFF) for k, v in enumerate(found))
