"""Function codes, exception codes, and how much one request may carry."""

from __future__ import annotations

from collections.abc import Iterable
from enum import IntEnum
from typing import Any

from shipnet.errors import ArgumentError
from shipnet.fields import check_whole

__all__ = [
    "LARGEST_PDU",
    "READ_LIMITS",
    "WRITE_LIMITS",
    "ExceptionCode",
    "FunctionCode",
    "check_coils",
    "check_registers",
    "pack_coils",
    "unpack_coils",
]


class FunctionCode(IntEnum):
    """What a request asks for; "MODBUS application protocol" V1.1b3, section 5.1."""

    READ_COILS = 1
    READ_DISCRETE_INPUTS = 2
    READ_HOLDING_REGISTERS = 3
    READ_INPUT_REGISTERS = 4
    WRITE_SINGLE_COIL = 5
    WRITE_SINGLE_REGISTER = 6
    WRITE_MULTIPLE_COILS = 15
    WRITE_MULTIPLE_REGISTERS = 16
    READ_WRITE_MULTIPLE_REGISTERS = 23


class ExceptionCode(IntEnum):
    """Why a slave refuses a request; "MODBUS application protocol" V1.1b3, section 7."""

    ILLEGAL_FUNCTION = 1
    ILLEGAL_DATA_ADDRESS = 2
    ILLEGAL_DATA_VALUE = 3
    SERVER_DEVICE_FAILURE = 4
    ACKNOWLEDGE = 5
    SERVER_DEVICE_BUSY = 6
    MEMORY_PARITY_ERROR = 8
    GATEWAY_PATH_UNAVAILABLE = 10
    GATEWAY_TARGET_FAILED_TO_RESPOND = 11


#: Longest PDU [byte]: an RS-485 frame of 256 without unit id and CRC; V1.1b3, section 4.1.
LARGEST_PDU = 253

#: Most coils or registers that one request reads; V1.1b3, section 6.
READ_LIMITS = {
    FunctionCode.READ_COILS: 2000,
    FunctionCode.READ_DISCRETE_INPUTS: 2000,
    FunctionCode.READ_HOLDING_REGISTERS: 125,
    FunctionCode.READ_INPUT_REGISTERS: 125,
    FunctionCode.READ_WRITE_MULTIPLE_REGISTERS: 125,
}

#: Most coils or registers that one request writes; V1.1b3, section 6.
WRITE_LIMITS = {
    FunctionCode.WRITE_MULTIPLE_COILS: 1968,
    FunctionCode.WRITE_MULTIPLE_REGISTERS: 123,
    FunctionCode.READ_WRITE_MULTIPLE_REGISTERS: 121,
}


def check_registers(registers: Iterable[int], most: int) -> tuple[int, ...]:
    """Return registers as a tuple, or raise unless there are 1..most of 0..65535.

    Parameters
    ----------
    registers : iterable of int
        Register values, unsigned.
    most : int
        Most registers allowed.

    Returns
    -------
    tuple of int
        The registers.

    Raises
    ------
    ArgumentError
        If their number or one of them is out of range.

    Examples
    --------
    >>> check_registers([1, 65536], 125)
    Traceback (most recent call last):
        ...
    shipnet.errors.ArgumentError: registers[1] is 65536; it must be a whole number 0..65535
    """
    values = _sequence("registers", registers, most)
    return tuple(check_whole(f"registers[{k}]", v, 0, 0xFFFF) for k, v in enumerate(values))


def check_coils(coils: Iterable[bool], most: int) -> tuple[bool, ...]:
    """Return coils as a tuple of bool, or raise unless there are 1..most of 0 and 1.

    Parameters
    ----------
    coils : iterable of bool
        Coil states; 0 and 1 will do.
    most : int
        Most coils allowed.

    Returns
    -------
    tuple of bool
        The coils.

    Raises
    ------
    ArgumentError
        If their number is out of range, or one is neither on nor off.

    Examples
    --------
    >>> check_coils([1, 0], 2000)
    (True, False)
    """
    values = _sequence("coils", coils, most)
    for k, value in enumerate(values):
        if not (isinstance(value, bool) or (hasattr(value, "__index__") and value in (0, 1))):
            # A numpy bool has no index, so its kind is asked for.
            if getattr(getattr(value, "dtype", None), "kind", "") != "b":
                raise ArgumentError(f"coils[{k}] is {value!r}; it must be True or False")
    return tuple(bool(value) for value in values)


def pack_coils(coils: tuple[bool, ...]) -> bytes:
    """Return coils as bytes: the first is the lowest bit, the rest of the last byte is 0.

    Parameters
    ----------
    coils : tuple of bool
        Coil states.

    Returns
    -------
    bytes
        One byte for every eight coils begun.

    Examples
    --------
    >>> pack_coils((True, False, True, True, False, False, True, True, True, False)).hex()
    'cd01'
    """
    value = sum(1 << place for place, coil in enumerate(coils) if coil)
    return value.to_bytes(-(-len(coils) // 8), "little")


def unpack_coils(data: bytes) -> tuple[bool, ...]:
    r"""Return the coils in bytes, eight of each.

    Parameters
    ----------
    data : bytes
        Bytes, the first coil in the lowest bit of the first.

    Returns
    -------
    tuple of bool
        Coil states.

    Examples
    --------
    >>> unpack_coils(b"\x05")[:4]
    (True, False, True, False)
    """
    return tuple(bool(byte >> place & 1) for byte in data for place in range(8))


def _sequence(name: str, values: Iterable[Any], most: int) -> tuple[Any, ...]:
    try:
        found = tuple(values)
    except TypeError:
        raise ArgumentError(f"{name} is {values!r}; it must be a sequence of 1..{most}") from None
    if not 1 <= len(found) <= most:
        raise ArgumentError(f"{name} has {len(found)} values; it must have 1..{most}")
    return found
