"""How a slave answers: from the bytes of a request to the bytes of its response.

No library and no socket is needed here; `serve` puts a server in front of it.
"""

from __future__ import annotations

import logging
from collections.abc import Collection, Mapping
from dataclasses import dataclass, fields
from typing import Any, NamedTuple

from shipnet.errors import ArgumentError, FrameError
from shipnet.fields import check_scalar, check_whole
from shipnet.modbus.codes import ExceptionCode, FunctionCode
from shipnet.modbus.reader import decode_request
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
from shipnet.modbus.server.device import Device, DeviceError, Table

__all__ = ["Answer", "Slave", "answer"]

_READ = {
    FunctionCode.READ_COILS: Table.COILS,
    FunctionCode.READ_DISCRETE_INPUTS: Table.DISCRETE_INPUTS,
    FunctionCode.READ_HOLDING_REGISTERS: Table.HOLDING_REGISTERS,
    FunctionCode.READ_INPUT_REGISTERS: Table.INPUT_REGISTERS,
}

_WRITES = frozenset({5, 6, 15, 16})

_BROADCAST, _SERVER_ITSELF = 0, 255


class Answer(NamedTuple):
    """What goes out upon a request.

    Attributes
    ----------
    pdu : bytes
        Response, function code first; empty where the slave is silent.
    delay : float
        How long after the request [s].
    """

    pdu: bytes
    delay: float


_NOTHING = Answer(b"", 0.0)


@dataclass
class Slave:
    r"""A device with its behaviour on the bus, which may be changed while a server has it.

    Parameters
    ----------
    device : Device
        What it holds.
    functions : collection of int, optional
        Function codes that it serves, all nine of `FunctionCode` if omitted; another one is
        answered with exception 1.
    delay : float, default 0
        How long it works on an answer, 0..3600 [s]. The request is executed at once and the answer
        held back, whatever else is asked meanwhile.
    exception : ExceptionCode, optional
        Exception with which it answers everything that it serves, instead of executing it.
    silent : bool, default False
        Whether it neither executes nor answers anything.

    Raises
    ------
    ArgumentError
        If a field is out of its range, at the start or when it is set later.

    Examples
    --------
    The junction box of an engine serves function code 3 alone:

    >>> from shipnet.modbus.server import RegisterDevice
    >>> box = Slave(RegisterDevice(holding_registers=[350, 412]), functions={3})
    >>> box.answer(bytes.fromhex("03 0000 0002")).hex(" "), box.answer(b"\x07").hex(" ")
    ('03 04 01 5e 01 9c', '87 01')
    """

    device: Device
    functions: Collection[int] = frozenset(FunctionCode)
    delay: float = 0.0
    exception: ExceptionCode | None = None
    silent: bool = False

    def __setattr__(self, name: str, value: Any) -> None:
        """Check every field."""
        match name:
            case "device" if not isinstance(value, Device):
                raise ArgumentError(f"device is {value!r}; it must have read and write")
            case "functions":
                try:
                    value = frozenset(FunctionCode(code) for code in value)
                except (TypeError, ValueError):
                    raise ArgumentError(
                        f"functions is {value!r}; it must be some of 1..6, 15, 16, 23"
                    ) from None
            case "delay":
                value = check_scalar("delay", value, "s", 0, 3600)
            case "exception" if value is not None:
                value = DeviceError(value).exception
            case "silent" if not isinstance(value, bool):
                raise ArgumentError(f"silent is {value!r}; it must be True or False")
            case _ if name not in {field.name for field in fields(self)}:
                raise AttributeError(f"a slave has no {name!r}")
        super().__setattr__(name, value)

    def answer(self, pdu: bytes, time: float = 0.0) -> bytes:
        """Execute a request and return the response.

        Parameters
        ----------
        pdu : bytes
            The request, function code first.
        time : float, default 0
            Model time, which the device gets [s].

        Returns
        -------
        bytes
            The response or an exception response, function code first; nothing if the slave is
            silent, or if the function code is 0 or above 127, which no response could name.

        Notes
        -----
        Exceptions in the order of the state diagrams in "MODBUS application protocol" V1.1b3,
        section 6: 1 for the function code, 3 for a quantity, byte count, coil value or length that
        cannot be, then what the device raises. A device that fails in another way is answered for
        with exception 4, and the failure goes to the log ``shipnet.modbus.server``.
        """
        function = pdu[0] if pdu else 0
        if self.silent or not 1 <= function <= 127:
            return b""
        try:
            if function not in self.functions:
                raise DeviceError(ExceptionCode.ILLEGAL_FUNCTION)
            if self.exception is not None:
                raise DeviceError(self.exception)
            return self._execute(decode_request(pdu), time).pdu
        except DeviceError as refusal:
            exception = refusal.exception
        except FrameError:
            exception = ExceptionCode.ILLEGAL_DATA_VALUE
        # Whatever the device's own code raises, the bus gets an answer.
        except Exception:
            logging.getLogger("shipnet.modbus.server").exception("the device failed")
            exception = ExceptionCode.SERVER_DEVICE_FAILURE
        return ExceptionResponse(function, exception).pdu

    def _execute(self, request: Request, time: float) -> Response:
        read, write = self.device.read, self.device.write
        match request:
            case ReadRequest():
                found = self._read(_READ[request.function], request, time)
                if request.function <= FunctionCode.READ_DISCRETE_INPUTS:
                    return ReadBitsResponse(request.function, found)  # type: ignore[arg-type]
                return ReadRegistersResponse(request.function, found)
            case WriteCoil():
                write(Table.COILS, request.address, [int(request.value)], time)
                return request
            case WriteRegister():
                write(Table.HOLDING_REGISTERS, request.address, [request.value], time)
                return request
            case WriteCoilsRequest():
                coils = [int(coil) for coil in request.coils]
                write(Table.COILS, request.starting_address, coils, time)
            case WriteRegistersRequest():
                registers = list(request.registers)
                write(Table.HOLDING_REGISTERS, request.starting_address, registers, time)
            case ReadWriteRequest():
                # What cannot be read must not be written either, so the address is tried first.
                table = Table.HOLDING_REGISTERS
                read(table, request.starting_address, request.quantity, time)
                write(table, request.write_starting_address, list(request.registers), time)
                return ReadRegistersResponse(request.function, self._read(table, request, time))
        return WriteResponse(request.function, request.starting_address, request.quantity)

    def _read(
        self, table: Table, request: ReadRequest | ReadWriteRequest, time: float
    ) -> tuple[int, ...]:
        found = tuple(self.device.read(table, request.starting_address, request.quantity, time))
        if len(found) != request.quantity:
            raise ArgumentError(f"the device gave {len(found)} values of {request.quantity}")
        return found


def answer(
    slaves: Mapping[int, Slave],
    unit_id: int,
    pdu: bytes,
    time: float = 0.0,
    *,
    serial: bool = False,
) -> Answer:
    r"""Return what comes back upon a request to one of several slaves.

    Parameters
    ----------
    slaves : mapping of int to Slave
        Slaves by unit id, 0..247; 0 is the server itself and not for a serial line.
    unit_id : int
        Who is asked, 0..255.
    pdu : bytes
        The request, function code first.
    time : float, default 0
        Model time [s].
    serial : bool, default False
        Whether they share a serial line.

    Returns
    -------
    Answer
        Response and delay.

    Raises
    ------
    ArgumentError
        If `unit_id` is out of range.

    Notes
    -----
    Unit id 0 is a broadcast: all slaves execute a write and none answers [1]_. With a slave 0 in
    TCP, 0 and 255 mean the server itself [2]_. For a unit id that nobody has, a serial line stays
    silent; in TCP the server stands where a gateway would, and that answers with exception 11,
    "usually means that the device is not present on the network" [3]_.

    References
    ----------
    .. [1] "MODBUS over serial line specification and implementation guide", V1.02, 2006,
       section 2.1.
    .. [2] "MODBUS messaging on TCP/IP implementation guide", V1.0b, 2006, section 4.4.2.
    .. [3] "MODBUS application protocol specification", V1.1b3, 2012, section 7.

    Examples
    --------
    >>> from shipnet.modbus.server import RegisterDevice
    >>> slaves = {5: Slave(RegisterDevice(holding_registers=[7]), delay=0.02)}
    >>> answer(slaves, 5, bytes.fromhex("0300000001"))
    Answer(pdu=b'\x03\x02\x00\x07', delay=0.02)
    >>> answer(slaves, 6, bytes.fromhex("0300000001")).pdu.hex(" ")
    '83 0b'
    """
    unit = check_whole("unit_id", unit_id, 0, 255)
    if _BROADCAST in slaves and unit == _SERVER_ITSELF:
        unit = _BROADCAST
    if unit in slaves:
        slave = slaves[unit]
        return Answer(slave.answer(pdu, time), slave.delay)
    function = pdu[0] if pdu else 0
    if unit == _BROADCAST:
        if function in _WRITES:
            for slave in slaves.values():
                slave.answer(pdu, time)
        return _NOTHING
    if serial or not 1 <= function <= 127:
        return _NOTHING
    absent = ExceptionCode.GATEWAY_TARGET_FAILED_TO_RESPOND
    return Answer(ExceptionResponse(function, absent).pdu, 0.0)
