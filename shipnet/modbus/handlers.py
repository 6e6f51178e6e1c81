"""The library's servers with our frames in them; importing this needs pymodbus."""

from __future__ import annotations

from asyncio import BaseTransport, TimerHandle
from collections.abc import Callable
from typing import Any

from pymodbus.framer import FramerType
from pymodbus.server import ModbusSerialServer, ModbusTcpServer, ModbusUdpServer
from pymodbus.server.requesthandler import ServerRequestHandler
from pymodbus.simulator import DataType, SimData, SimDevice

from shipnet.errors import FrameError
from shipnet.modbus.frame import MAX_PDU, RTU_BYTES
from shipnet.modbus.pdu import Adu, decode
from shipnet.modbus.slave import Answer
from shipnet.modbus.uart import SerialLine

Respond = Callable[[Adu], Answer]

#: The library's constructors ask for a data store, which our handlers never ask.
_STORE = SimDevice(0, SimData(0, datatype=DataType.REGISTERS))

#: Unsent answers at which a client that does not read is disconnected [byte]: 250 of the longest.
_UNREAD = 1 << 16

#: Bytes before those that the length field of a TCP frame counts, and that length's legal range.
_HEAD, _SHORTEST, _LONGEST = 6, 2, 1 + MAX_PDU


class _Handler(ServerRequestHandler):
    """One connection, one serial port, or all datagrams.

    The library's own handler keeps the request being answered in an attribute: while an answer is
    held back, the next request, perhaps of another client, replaces it, and the answer goes out
    with that one's transaction id and address. It also answers malformed requests with function
    code 0x80. So each answer carries its own address here, and PDUs are read by ours.
    """

    transport: Any

    def __init__(self, owner: Any) -> None:
        super().__init__(owner, None, None, None)  # type: ignore[no-untyped-call]
        self.respond: Respond = owner.respond
        self.received = b""

    def reply(self, request: Adu, to: Any = None, wait: float = 0.0) -> None:
        """Send the answer when it is due."""
        answer = self.respond(request)
        if answer.pdu:
            frame = self.framer.encode(answer.pdu, request.unit_id, request.transaction_id or 0)
            if wait + answer.delay > 0:
                self.loop.call_later(wait + answer.delay, self._send_if_open, frame, to)
            else:
                self._send_if_open(frame, to)

    def _send_if_open(self, frame: bytes, to: Any) -> None:
        if self.transport is not None and not self.transport.is_closing():
            self.send(frame, to)


class _TcpHandler(_Handler):
    def datagram_received(self, data: bytes, addr: Any) -> None:
        """Cut the stream into frames; a length that cannot be ends the connection."""
        self.received += data
        while len(self.received) >= _HEAD:
            length = int.from_bytes(self.received[4:6], "big")
            unread = self.transport.get_write_buffer_size() > _UNREAD
            if unread or not _SHORTEST <= length <= _LONGEST:
                self.received = b""
                self.transport.abort()
                return
            if len(self.received) < _HEAD + length:
                return
            frame = self.received[: _HEAD + length]
            self.received = self.received[_HEAD + length :]
            try:
                adu = decode(frame, "tcp")
            except FrameError:
                continue  # of another protocol
            self.reply(adu)


class _UdpHandler(_Handler):
    def datagram_received(self, data: bytes, addr: Any) -> None:
        """Answer a datagram that is a frame, and ignore others."""
        try:
            adu = decode(data, "tcp")
        except FrameError:
            return
        self.reply(adu, addr)


class _RtuHandler(_Handler):
    """A frame is whole when its CRC is right; silence ends what never becomes one."""

    timer: TimerHandle | None = None

    def datagram_received(self, data: bytes, addr: Any) -> None:
        """Collect bytes until they are a frame, or until silence."""
        if self.timer is not None:
            self.timer.cancel()
        # One byte too many is enough to know that it is not a frame.
        self.received = (self.received + data)[: MAX_PDU + RTU_BYTES + 1]
        try:
            adu = decode(self.received)
        except FrameError:
            self.timer = self.loop.call_later(self.server.silence, self._forget)
            return
        self._forget()
        self.reply(adu, wait=self.server.line.t35)

    def _forget(self) -> None:
        self.received = b""


class TcpServer(ModbusTcpServer):
    """The library's TCP server with our handler."""

    transport: Any

    def __init__(self, respond: Respond, host: str, port: int) -> None:
        super().__init__(_STORE, address=(host, port))
        self.respond = respond

    def callback_new_connection(self) -> _Handler:
        """Return the handler of a connection; every connection begins here."""
        return _TcpHandler(self)

    @property
    def port(self) -> int:
        """The port that is bound."""
        return int(self.transport.sockets[0].getsockname()[1])


class UdpServer(ModbusUdpServer):
    """The library's UDP server with our handler."""

    transport: BaseTransport

    def __init__(self, respond: Respond, host: str, port: int) -> None:
        super().__init__(_STORE, address=(host, port))
        self.respond = respond

    def callback_new_connection(self) -> _Handler:
        """Return the handler of all datagrams."""
        return _UdpHandler(self)

    @property
    def port(self) -> int:
        """The port that is bound."""
        return int(self.transport.get_extra_info("sockname")[1])


class RtuServer(ModbusSerialServer):
    """The library's serial server with our handler."""

    port = 0

    def __init__(self, respond: Respond, path: str, line: SerialLine, silence: float) -> None:
        super().__init__(
            _STORE,
            framer=FramerType.RTU,
            port=path,
            baudrate=round(line.bit_rate),
            parity=line.character[1],
            stopbits=int(line.character[2]),
        )
        self.respond, self.line, self.silence = respond, line, silence

    def callback_new_connection(self) -> _Handler:
        """Return the handler of the port."""
        return _RtuHandler(self)
