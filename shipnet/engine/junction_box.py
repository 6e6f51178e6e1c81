"""A junction box as a Modbus slave: what a real client can read from the simulated engine."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy.typing as npt

from shipnet.engine.registers import RegisterMap
from shipnet.errors import ArgumentError
from shipnet.modbus.pdu import ExceptionCode
from shipnet.modbus.slave import DeviceError, Slave, Table

__all__ = ["FUNCTIONS", "JunctionBox", "junction_box"]

#: Function codes of a junction box; lee2012, section IV.1.a.
FUNCTIONS = frozenset({3})


class JunctionBox:
    """The holding registers of a junction box, filled anew for each request.

    Parameters
    ----------
    registers : RegisterMap
        Which register holds which point, and how.
    values : callable
        Takes the time [s], returns the values of all points in their units, shape (n_points,);
        NaN is a value that is missing, and is marked as `registers` has it.

    Raises
    ------
    ArgumentError
        If `registers` is no map, or `values` cannot be called.

    Examples
    --------
    >>> from shipnet.engine.points import load_points
    >>> points = load_points()[:2]
    >>> box = JunctionBox(RegisterMap(points), lambda time: [80 + time, float("nan")])
    >>> box.read("holding_registers", 0, 2, time=1.5)  # tenths of a degree; 0x00FF
    [815, 255]
    """

    def __init__(self, registers: RegisterMap, values: Callable[[float], npt.ArrayLike]) -> None:
        if not isinstance(registers, RegisterMap):
            raise ArgumentError(f"registers is {registers!r}; it must be a RegisterMap")
        if not callable(values):
            raise ArgumentError(f"values is {values!r}; it must take a time")
        self.registers, self.values = registers, values

    def read(self, table: Table, address: int, quantity: int, time: float) -> list[int]:
        """Return registers in a row; exception 2 if one of them does not exist."""
        first = address - self.registers.first_address
        if table != "holding_registers" or not 0 <= first <= len(self.registers) - quantity:
            raise DeviceError(ExceptionCode.ILLEGAL_DATA_ADDRESS)
        content: list[int] = self.registers.encode(self.values(time)).tolist()
        return content[first : first + quantity]

    def write(self, table: Table, address: int, values: Sequence[int], time: float) -> None:
        """Refuse: nothing can be written to a junction box."""
        raise DeviceError(ExceptionCode.ILLEGAL_FUNCTION)


def junction_box(registers: RegisterMap, values: Callable[[float], npt.ArrayLike]) -> Slave:
    """Return a junction box that knows function code 3 alone.

    Parameters
    ----------
    registers, values
        As for `JunctionBox`.

    Returns
    -------
    Slave
        For `shipnet.modbus.server.serve`.

    Raises
    ------
    ArgumentError
        As for `JunctionBox`.

    Examples
    --------
    >>> from shipnet.engine.points import load_points
    >>> registers = RegisterMap(load_points()[:1])
    >>> box = junction_box(registers, lambda time: [80.0])
    >>> box.answer(bytes.fromhex("03 0000 0001")).hex(" "), box.answer(bytes([4])).hex(" ")
    ('03 02 03 20', '84 01')
    """
    return Slave(JunctionBox(registers, values), functions=FUNCTIONS)
