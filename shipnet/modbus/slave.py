"""Simulated slaves: their values, and their responses as bytes."""

from __future__ import annotations

import logging
from collections.abc import Collection, Iterable, Mapping, Sequence
from contextlib import suppress
from itertools import cycle
from os import PathLike
from typing import Any, Literal, NamedTuple, Protocol, get_args, runtime_checkable

from shipnet.errors import ArgumentError, FrameError, InputError
from shipnet.fields import check_kind, check_scalar, check_whole
from shipnet.modbus.device_table import read_devices
from shipnet.modbus.pdu import (
    Adu,
    ExceptionCode,
    FunctionCode,
    Request,
    Response,
    check_coils,
    check_registers,
    exception_code,
)

#: Kinds of data, each with its own addresses; "MODBUS application protocol" V1.1b3, section 4.3.
Table = Literal["coils", "discrete_inputs", "holding_registers", "input_registers"]

_Values = Mapping[int, Any] | Iterable[Any]  #: Values by address, or in order from address 0.

_READ: dict[int, Table] = dict(enumerate(get_args(Table), start=1))

_WRITES = frozenset({5, 6, 15, 16})
_BROADCAST, _SERVER_ITSELF = 0, 255
_WHOLE_TABLE = 65536


class DeviceError(Exception):
    """A device refuses a request.

    Parameters
    ----------
    exception : ExceptionCode
        The code in the exception response, 1..6, 8, 10 or 11.

    Examples
    --------
    >>> DeviceError(2).exception.name
    'ILLEGAL_DATA_ADDRESS'
    """

    def __init__(self, exception: ExceptionCode | int) -> None:
        self.exception = exception_code(exception)
        super().__init__(self.exception.name)


@runtime_checkable
class Device(Protocol):
    """Any object that can be read and written by address; it raises `DeviceError` to refuse access.

    Examples
    --------
    A clock in one input register, in whole seconds:

    >>> class Clock:
    ...     def read(self, table, address, quantity, time):
    ...         if (table, address, quantity) != ("input_registers", 0, 1):
    ...             raise DeviceError(2)
    ...         return [int(time)]
    ...     def write(self, table, address, values, time):
    ...         raise DeviceError(1)
    >>> Slave(Clock()).answer(Request.read_input_registers(0, 1), time=7.5).hex(" ")
    '04 02 00 07'
    """

    def read(self, table: Table, address: int, quantity: int, time: float) -> Sequence[int]:
        """Return `quantity` values of a table at a simulated time [s]."""
        ...

    def write(self, table: Table, address: int, values: Sequence[int], time: float) -> None:
        """Write all values to coils or holding registers, or none if the device refuses any."""
        ...


class Registers:
    """A device that only stores values; they may be changed while a server uses it."""

    coils: dict[int, int]
    discrete_inputs: dict[int, int]
    holding_registers: dict[int, int]
    input_registers: dict[int, int]

    def __init__(
        self, *, limits: Mapping[int, tuple[int, int]] | None = None, **tables: _Values
    ) -> None:
        for name in get_args(Table):
            values: Any = tables.get(name, ())
            try:  # a sequence starts at address 0
                pairs = dict(values if isinstance(values, Mapping) else enumerate(values))
            except TypeError:
                raise ArgumentError(
                    f"{name} is {values!r}; it must be a mapping or a sequence"
                ) from None
            addresses = [check_whole(f"address in {name}", a, 0, 0xFFFF) for a in pairs]
            check: Any = check_registers if "registers" in name else check_coils
            stored = check(pairs.values(), _WHOLE_TABLE, name) if pairs else ()
            setattr(self, name, dict(zip(addresses, map(int, stored), strict=True)))
        if not isinstance(limits, Mapping | None):
            raise ArgumentError(f"limits is {limits!r}; it must be a mapping")
        self.limits = dict(limits or {})
        for address, (low, high) in self.limits.items():
            if address not in self.holding_registers:
                raise ArgumentError(f"limits has address {address}, but holding_registers does not")
            check_whole(f"limits[{address}][0]", low, 0, 0xFFFF)
            check_whole(f"limits[{address}][1]", high, low, 0xFFFF)

    def read(self, table: Table, address: int, quantity: int, time: float) -> list[int]:
        """Return values of a table, or refuse with exception 2 if an address does not exist."""
        memory: dict[int, int] = getattr(self, table)
        try:
            return [memory[item] for item in range(address, address + quantity)]
        except KeyError:
            raise DeviceError(ExceptionCode.ILLEGAL_DATA_ADDRESS) from None

    def write(self, table: Table, address: int, values: Sequence[int], time: float) -> None:
        """Write all values, or refuse with exception 2 or 3 and write none."""
        new = dict(enumerate(values, address))
        memory: dict[int, int] = getattr(self, table)
        if not new.keys() <= memory.keys():
            raise DeviceError(ExceptionCode.ILLEGAL_DATA_ADDRESS)
        if table == "holding_registers":
            for item in new.keys() & self.limits.keys():
                low, high = self.limits[item]
                if not low <= new[item] <= high:
                    raise DeviceError(ExceptionCode.ILLEGAL_DATA_VALUE)
        memory.update(new)


class Answer(NamedTuple):
    """The response PDU, empty if the slave is silent, and its delay [s]."""

    pdu: bytes
    delay: float


_NOTHING = Answer(b"", 0.0)


class Slave:
    """A simulated slave with registers, or with your own device.

    All attributes may be changed while a server uses the slave. If you give no device of your own,
    the attribute `device` contains the tables as dictionaries.

    Parameters
    ----------
    device : Device, optional
        Your own device, in place of the tables.
    coils, discrete_inputs : mapping of int to bool, or sequence of bool, optional
        Bits by address; a sequence starts at address 0. Other addresses do not exist.
    holding_registers, input_registers : mapping of int to int, or sequence of int, optional
        Registers by address, 0..65535 each.
    limits : mapping of int to (int, int), optional
        Lowest and highest value that may be written to a holding register, by address; other
        values are refused with exception 3.
    functions : collection of int, optional
        Function codes served, by default all of `FunctionCode`; others get exception 1.
    delay : float, default 0
        Time before the response is sent, 0..3600 [s]. The request is executed at once.
    exception : ExceptionCode, optional
        Exception that refuses every request whose function code is served.
    silent : bool, default False
        Whether the slave ignores all requests.

    Raises
    ------
    ArgumentError
        If an argument is out of its range, or both a device and tables are given.

    Examples
    --------
    A valve with its position in 0x4020 and a set point of 0..100 in 0x4001:

    >>> valve = Slave(input_registers={0x4020: 42}, holding_registers={0x4001: 0},
    ...               limits={0x4001: (0, 100)})
    >>> valve.answer(Request.read_input_registers(0x4020, 1)).hex(" ")
    '04 02 00 2a'
    >>> valve.answer(Request.write_single_register(0x4001, 101)).hex(" ")
    '86 03'
    """

    __slots__ = ("delay", "device", "exception", "functions", "silent")

    def __init__(
        self,
        device: Device | None = None,
        *,
        coils: Mapping[int, bool] | Iterable[bool] = (),
        discrete_inputs: Mapping[int, bool] | Iterable[bool] = (),
        holding_registers: Mapping[int, int] | Iterable[int] = (),
        input_registers: Mapping[int, int] | Iterable[int] = (),
        limits: Mapping[int, tuple[int, int]] | None = None,
        functions: Collection[int] = frozenset(FunctionCode),
        delay: float = 0.0,
        exception: ExceptionCode | int | None = None,
        silent: bool = False,
    ) -> None:
        tables = {
            "coils": coils,
            "discrete_inputs": discrete_inputs,
            "holding_registers": holding_registers,
            "input_registers": input_registers,
            "limits": limits,
        }
        if device is None:
            device = Registers(**tables)  # type: ignore[arg-type]
        elif names := [name for name, table in tables.items() if table]:
            raise ArgumentError(f"a device and {names[0]} are given; give only one of them")
        if not isinstance(device, Device):
            raise ArgumentError(f"device is {device!r}; it must have the methods read and write")
        self.device = device
        try:
            self.functions = frozenset(map(FunctionCode, functions))
        except (TypeError, ValueError):
            raise ArgumentError(
                f"functions is {functions!r}; each must be 1..6, 15 or 16"
            ) from None
        self.delay = check_scalar("delay", delay, "s", 0, 3600)
        self.exception = None if exception is None else exception_code(exception)
        self.silent = check_kind("silent", silent, bool)

    def __repr__(self) -> str:
        refusal = f", exception {self.exception.name}" if self.exception else ""
        silent = ", silent" if self.silent else ""
        return f"Slave({type(self.device).__name__}, delay {self.delay:g} s{refusal}{silent})"

    def answer(self, request: Request | bytes, time: float = 0.0) -> bytes:
        """Execute a request at a simulated time [s] and return the response PDU.

        The PDU is empty if the slave is silent or the function code is 0 or above 127. Requests are
        checked in the order of "MODBUS application protocol" V1.1b3, section 6: exception 1 for the
        function code, 3 for an illegal field or length, then the device's own. Any other error in
        the device is logged to ``shipnet.modbus.server``, and exception 4 is returned.
        """
        pdu = request.pdu if isinstance(request, Request) else request
        if not isinstance(pdu, bytes | bytearray | memoryview):
            raise ArgumentError(f"request is {request!r}; it must be a Request or bytes")
        function = pdu[0] if pdu else 0
        if self.silent or not 1 <= function <= 127:
            return b""
        try:
            if function not in self.functions:
                raise DeviceError(ExceptionCode.ILLEGAL_FUNCTION)
            if self.exception is not None:
                raise DeviceError(self.exception)
            command, device = Request.parse(pdu), self.device
            values: Iterable[int] = ()
            if function in _READ:
                values = device.read(_READ[function], command.address, command.quantity, time)
            elif command.coils:
                device.write("coils", command.address, list(map(int, command.coils)), time)
            else:
                device.write("holding_registers", command.address, list(command.registers), time)
            return command.response(values).pdu
        except DeviceError as refusal:
            exception = refusal.exception
        except FrameError:
            exception = ExceptionCode.ILLEGAL_DATA_VALUE
        # A response is sent no matter which error the device's code raises.
        except Exception:
            logging.getLogger("shipnet.modbus.server").exception("the device failed")
            exception = ExceptionCode.SERVER_DEVICE_FAILURE
        return Response(function, exception=exception).pdu


class _Listed(Slave):
    """A slave of a table; `refused` contains exceptions by function code and address."""

    __slots__ = ("refused",)
    refused: Mapping[tuple[int, int], ExceptionCode]

    def answer(self, request: Request | bytes, time: float = 0.0) -> bytes:
        with suppress(FrameError):
            one = request if isinstance(request, Request) else Request.parse(request)
            for address in range(one.address, one.address + one.quantity):
                if not self.silent and (code := self.refused.get((one.function, address))):
                    return Response(one.function, exception=code).pdu
        return super().answer(request, time)


def read_slaves(path: str | PathLike[str]) -> Mapping[int, Slave]:
    """Return the slaves of a table by unit id; each serves only the functions of its rows."""
    rows_of: dict[int, list[dict[str, Any]]] = {}
    for row in read_devices(path)[0]:
        rows_of.setdefault(row["address"] % _SERVER_ITSELF, []).append(row)
    slaves = dict[int, _Listed]()
    for unit, rows in rows_of.items():
        if len({row["host"] for row in rows}) > 1:
            raise InputError(str(path), f"address {unit} belongs to several hosts; serve one")
        tables: dict[str, dict[int, int]] = {name: {} for name in get_args(Table)}
        stated: dict[str, set[int]] = {name: set() for name in tables}
        refused: dict[tuple[int, int], ExceptionCode] = {}
        # Rows with values come last, so that another function on the same registers keeps them.
        for row in sorted(rows, key=lambda row: row["values"] is not None):
            code, first = row["function"], row["register"]
            name = _READ.get(code) or ("coils" if code in (5, 15) else "holding_registers")
            addresses = range(first, first + row["registers"])
            values = dict(zip(addresses, cycle(row["values"] or [0])))
            if row["values"]:
                for one in sorted(values.keys() & stated[name]):
                    if values[one] != tables[name][one]:
                        why = f"address {one} has another value in an earlier row"
                        raise InputError(str(path), f"row {row['row']}: {why}")
                stated[name] |= values.keys()
            tables[name] |= values
            if row["exception"]:
                refused |= dict.fromkeys(((code, one) for one in addresses), row["exception"])
        functions, silent = {row["function"] for row in rows}, any(row["dead"] for row in rows)
        delay = max(row["delay"] or 0.0 for row in rows)
        device = Registers(limits=None, **tables)
        slaves[unit] = _Listed(device, functions=functions, delay=delay, silent=silent)
        slaves[unit].refused = refused
    return slaves


def answer(
    slaves: Mapping[int, Slave], adu: Adu, time: float = 0.0, *, serial: bool = False
) -> Answer:
    """Return the response of one of several slaves to a request at a simulated time [s].

    Unit id 0 is a broadcast: all slaves execute a write, and none answers ("MODBUS over serial
    line" V1.02, section 2.1). But if `slaves` includes 0, both 0 and 255 mean the server itself
    ("MODBUS messaging on TCP/IP" V1.0b, section 4.4.2). For a missing slave, a serial line stays
    silent; over TCP, exception 11 reports that the target did not respond ("MODBUS application
    protocol" V1.1b3, section 7).
    """
    unit, pdu = adu.unit_id, adu.pdu
    if _BROADCAST in slaves and unit == _SERVER_ITSELF:
        unit = _BROADCAST
    if unit in slaves:
        slave = slaves[unit]
        return Answer(slave.answer(pdu, time), slave.delay)
    if unit == _BROADCAST:
        if pdu[0] in _WRITES:
            for slave in slaves.values():
                slave.answer(pdu, time)
        return _NOTHING
    if serial or not 1 <= pdu[0] <= 127:
        return _NOTHING
    absent = ExceptionCode.GATEWAY_TARGET_FAILED_TO_RESPOND
    return Answer(Response(pdu[0], exception=absent).pdu, 0.0)
