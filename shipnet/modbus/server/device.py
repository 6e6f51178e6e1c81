"""What a Modbus device holds: four tables that are read and written by address."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from enum import Enum
from typing import Any, Protocol, runtime_checkable

from shipnet.errors import ArgumentError
from shipnet.fields import check_whole
from shipnet.modbus.codes import ExceptionCode, check_coils, check_registers

__all__ = ["Device", "DeviceError", "RegisterDevice", "Table"]

_WHOLE_TABLE = 65536


class Table(Enum):
    """Kind of data, each with addresses of its own; "MODBUS application protocol" V1.1b3, 4.3."""

    COILS = "coils"
    DISCRETE_INPUTS = "discrete_inputs"
    HOLDING_REGISTERS = "holding_registers"
    INPUT_REGISTERS = "input_registers"


class DeviceError(Exception):
    """A device refuses a request.

    Parameters
    ----------
    exception : ExceptionCode
        Why, 1..6, 8, 10 or 11; it goes out in the exception response.

    Raises
    ------
    ArgumentError
        If there is no such exception code.

    Examples
    --------
    >>> DeviceError(2).exception.name
    'ILLEGAL_DATA_ADDRESS'
    """

    def __init__(self, exception: ExceptionCode | int) -> None:
        try:
            self.exception = ExceptionCode(exception)
        except ValueError:
            raise ArgumentError(
                f"exception is {exception!r}; it must be 1..6, 8, 10 or 11"
            ) from None
        super().__init__(self.exception.name)


@runtime_checkable
class Device(Protocol):
    """Anything that can be read and written; both raise `DeviceError` to refuse."""

    def read(self, table: Table, address: int, quantity: int, time: float) -> Sequence[int]:
        """Return what stands in a table.

        Parameters
        ----------
        table : Table
            Any of the four.
        address : int
            The first, 0..65535.
        quantity : int
            How many, 1..2000 bits or 1..125 registers.
        time : float
            Model time [s].

        Returns
        -------
        sequence of int
            As many as asked for: 0 and 1, or 0..65535.
        """
        ...

    def write(self, table: Table, address: int, values: Sequence[int], time: float) -> None:
        """Take over values, all of them or none.

        Parameters
        ----------
        table : Table
            Coils or holding registers.
        address : int
            Where the first goes, 0..65535.
        values : sequence of int
            0 and 1, or 0..65535.
        time : float
            Model time [s].
        """
        ...


class RegisterDevice:
    """A device that is nothing but memory.

    Parameters
    ----------
    coils, discrete_inputs : mapping of int to bool, or sequence of bool, optional
        Bits by address; a sequence begins at address 0. What is not given does not exist.
    holding_registers, input_registers : mapping of int to int, or sequence of int, optional
        Registers of 0..65535, likewise.
    limits : mapping of int to (int, int), optional
        Lowest and highest value that may be written to a holding register, by its address;
        anything else is answered with exception 3. Registers without limits take all.

    Attributes
    ----------
    coils, discrete_inputs, holding_registers, input_registers : dict of int to int
        The tables, which may be changed while a server has them.

    Raises
    ------
    ArgumentError
        If an address, a value or a limit is out of its range.

    Examples
    --------
    A valve with its position in 0x4020 and a set point of 0..100 in 0x4001:

    >>> valve = RegisterDevice(input_registers={0x4020: 42}, holding_registers={0x4001: 0},
    ...                        limits={0x4001: (0, 100)})
    >>> valve.read(Table.INPUT_REGISTERS, 0x4020, 1, 0.0)
    [42]
    >>> valve.write(Table.HOLDING_REGISTERS, 0x4001, [101], 0.0)
    Traceback (most recent call last):
        ...
    shipnet.modbus.server.device.DeviceError: ILLEGAL_DATA_VALUE
    """

    def __init__(
        self,
        *,
        coils: Mapping[int, bool] | Iterable[bool] = (),
        discrete_inputs: Mapping[int, bool] | Iterable[bool] = (),
        holding_registers: Mapping[int, int] | Iterable[int] = (),
        input_registers: Mapping[int, int] | Iterable[int] = (),
        limits: Mapping[int, tuple[int, int]] | None = None,
    ) -> None:
        self.coils = _bits("coils", coils)
        self.discrete_inputs = _bits("discrete_inputs", discrete_inputs)
        self.holding_registers = _registers("holding_registers", holding_registers)
        self.input_registers = _registers("input_registers", input_registers)
        self.limits = dict(limits or {})
        for address, (low, high) in self.limits.items():
            if address not in self.holding_registers:
                raise ArgumentError(f"limits names {address}, but there is no such register")
            check_whole(f"limits[{address}][0]", low, 0, 0xFFFF)
            check_whole(f"limits[{address}][1]", high, low, 0xFFFF)

    def read(self, table: Table, address: int, quantity: int, time: float) -> list[int]:
        """Return what stands in a table; exception 2 if any of it does not exist."""
        memory = self._table(table)
        try:
            return [memory[place] for place in range(address, address + quantity)]
        except KeyError:
            raise DeviceError(ExceptionCode.ILLEGAL_DATA_ADDRESS) from None

    def write(self, table: Table, address: int, values: Sequence[int], time: float) -> None:
        """Take over all values, or none: exceptions 2 and 3."""
        new = dict(enumerate(values, address))
        memory = self._table(table)
        if not new.keys() <= memory.keys():
            raise DeviceError(ExceptionCode.ILLEGAL_DATA_ADDRESS)
        if table is Table.HOLDING_REGISTERS:
            for place in new.keys() & self.limits.keys():
                low, high = self.limits[place]
                if not low <= new[place] <= high:
                    raise DeviceError(ExceptionCode.ILLEGAL_DATA_VALUE)
        memory.update(new)

    def _table(self, table: Table) -> dict[int, int]:
        memory: dict[int, int] = getattr(self, table.value)
        return memory


def _bits(name: str, given: Mapping[int, bool] | Iterable[bool]) -> dict[int, int]:
    addresses, values = _columns(name, given)
    coils = check_coils(values, _WHOLE_TABLE) if values else ()
    return dict(zip(addresses, map(int, coils), strict=True))


def _registers(name: str, given: Mapping[int, int] | Iterable[int]) -> dict[int, int]:
    addresses, values = _columns(name, given)
    registers = check_registers(values, _WHOLE_TABLE) if values else ()
    return dict(zip(addresses, registers, strict=True))


def _columns(name: str, given: Mapping[int, Any] | Iterable[Any]) -> tuple[list[int], list[Any]]:
    try:
        pairs = dict(given if isinstance(given, Mapping) else enumerate(given))
    except TypeError:
        raise ArgumentError(f"{name} is {given!r}; it must be a mapping or a sequence") from None
    return [check_whole(f"address in {name}", a, 0, 0xFFFF) for a in pairs], list(pairs.values())
