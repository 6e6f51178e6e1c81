"""The library's servers with our frames in them; importing this needs pymodbus."""

from __future__ import annotations

import logging
from asyncio import BufferedProtocol, Task, TimerHandle, sleep
from collections.abc import Callable
from contextlib import suppress
from errno import EINVAL
from importlib import import_module
from socket import socket
from typing import Any

from pymodbus.framer import FramerType
from pymodbus.server import ModbusSerialServer, ModbusTcpServer, ModbusUdpServer
from pymodbus.server.base import ModbusBaseServer
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

#: Requests of one client that are answered before all other clients have had their turn.
_QUOTA = 4

#: Bytes that are read from a client at once; until their requests are answered, no more are read.
_READ = 4096

#: Answers held back for one client, or for all datagrams together: further requests must wait, and
#: further datagrams are lost.
_HELD_BACK = 256

#: Unsent answers at which a client that does not read is disconnected [byte]: 250 of the longest.
_UNSENT = 1 << 16

#: Connections that the system holds until they are accepted.
_BACKLOG = 100

#: Pause after a connection that could not be accepted [s].
_PAUSE = 0.01

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

    #: What may wait in the transport before answers are dropped [byte]; a serial one counts parts.
    unsent = _UNSENT

    def __init__(self, owner: Any) -> None:
        super().__init__(owner, None, None, None)  # type: ignore[no-untyped-call]
        self.respond: Respond = owner.respond
        self.received = b""
        self.held_back = 0

    def reply(self, request: Adu, to: Any = None, wait: float = 0.0) -> None:
        """Send the answer when it is due."""
        if self.held_back >= _HELD_BACK:
            return
        answer = self.respond(request)
        if answer.pdu:
            frame = self.framer.encode(answer.pdu, request.unit_id, request.transaction_id or 0)
            if wait + answer.delay > 0:
                self.held_back += 1
                self.loop.call_later(wait + answer.delay, self._send_late, frame, to)
            else:
                self._send_if_open(frame, to)

    def _send_late(self, frame: bytes, to: Any) -> None:
        self.held_back -= 1
        self._send_if_open(frame, to)

    def _send_if_open(self, frame: bytes, to: Any) -> None:
        if self._is_open() and self.transport.get_write_buffer_size() <= self.unsent:
            self.send(frame, to)

    def _is_open(self) -> bool:
        return self.transport is not None and not self.transport.is_closing()


class _TcpHandler(_Handler, BufferedProtocol):
    """A connection, which reads a bounded number of bytes and answers them in turns."""

    def __init__(self, owner: Any) -> None:
        super().__init__(owner)
        self.space = bytearray(_READ)
        self.in_turn = False
        self.last_request = self.loop.time()
        self.timer = self.loop.call_later(owner.idle_limit, self._end_if_idle)

    def callback_disconnected(self, exc: Exception | None) -> None:
        """Forget the idle limit."""
        self.timer.cancel()
        super().callback_disconnected(exc)

    def get_buffer(self, sizehint: int) -> bytearray:
        """Return where the next bytes go."""
        return self.space

    def buffer_updated(self, nbytes: int) -> None:
        """Take the bytes, and answer unless the next turn is coming anyway."""
        self.received += self.space[:nbytes]
        if not self.in_turn:
            self._take_turn()

    def _take_turn(self) -> None:
        """Answer a few requests; the next ones wait until all other clients had their turn."""
        self.in_turn = False
        for _ in range(_QUOTA):
            if not self._is_open():
                return
            if self.held_back >= _HELD_BACK:
                self.transport.pause_reading()  # an answer that is sent takes the next turn
                return
            frame = self._next_frame()
            if not frame:
                self.transport.resume_reading()
                return
            self.last_request = self.loop.time()
            with suppress(FrameError):  # of another protocol
                self.reply(decode(frame, "tcp"))
        self.transport.pause_reading()
        self.in_turn = True
        self.loop.call_soon(self._take_turn)

    def _next_frame(self) -> bytes:
        """Cut a frame off the stream, empty if none is whole; an impossible length ends it."""
        if len(self.received) < _HEAD:
            return b""
        length = int.from_bytes(self.received[4:6], "big")
        if not _SHORTEST <= length <= _LONGEST:
            self.received = b""
            self.transport.abort()
            return b""
        end = _HEAD + length
        if len(self.received) < end:
            return b""
        frame, self.received = self.received[:end], self.received[end:]
        return frame

    def _send_late(self, frame: bytes, to: Any) -> None:
        super()._send_late(frame, to)
        if not self.in_turn:
            self._take_turn()

    def _send_if_open(self, frame: bytes, to: Any) -> None:
        if self._is_open() and self.transport.get_write_buffer_size() > _UNSENT:
            self.transport.abort()
        super()._send_if_open(frame, to)

    def _end_if_idle(self) -> None:
        """End a connection whose last request was answered long ago, or look again later."""
        now, limit = self.loop.time(), self.server.idle_limit
        if self.held_back:
            self.last_request = now
        rest = self.last_request + limit - now
        if rest > 0:
            self.timer = self.loop.call_later(rest, self._end_if_idle)
        elif self._is_open():
            self.transport.abort()


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
    unsent = 4

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


class _Listener(ModbusBaseServer):
    """A server of the library that raises what keeps it from listening, instead of logging it."""

    transport: Any

    async def listen(self) -> bool:
        """Open the port."""
        self.is_listener = True
        self.transport = (await self.call_create())[0]
        return True


class TcpServer(ModbusTcpServer):
    """The library's TCP server with our handler, and with a limit of clients."""

    transport: Any

    def __init__(
        self, respond: Respond, host: str, port: int, max_clients: int, idle_limit: float
    ) -> None:
        super().__init__(_STORE, address=(host, port))
        self.address = host, port
        self.respond, self.max_clients, self.idle_limit = respond, max_clients, idle_limit
        self.accepting: list[Task[None]] = []
        self.refuses = False

    async def listen(self) -> bool:
        """Bind all addresses of the host, and accept connections.

        The event loop's own way to accept has no limit of clients, and logs a traceback whenever
        the process has no file descriptor left.
        """
        self.is_listener = True
        self.transport = await self.loop.create_server(
            self.handle_new_connection, *self.address, start_serving=False
        )
        for bound in self.transport.sockets:
            listening = bound.dup()
            listening.setblocking(False)
            listening.listen(_BACKLOG)
            self.accepting.append(self.loop.create_task(self._accept(listening)))
        return True

    def close(self, reconnect: bool = False) -> None:
        """Accept no more, and close all connections."""
        for task in self.accepting:
            task.cancel()
        super().close(reconnect)

    async def _accept(self, listening: socket) -> None:
        """Accept connections for ever; those that are too many are closed at once."""
        spare = _open_socket()  # its descriptor serves to refuse when no other one is left
        try:
            while True:
                try:
                    connection, _ = await self.loop.sock_accept(listening)
                except OSError as problem:
                    self._refuse(str(problem))
                    if spare is not None:
                        spare.close()
                    with suppress(OSError):
                        listening.accept()[0].close()
                    spare = _open_socket()
                    await sleep(_PAUSE)
                    continue
                if len(self.active_connections) >= self.max_clients:
                    self._refuse(f"{self.max_clients} clients are connected")
                    connection.close()
                    continue
                self.refuses = False
                with suppress(OSError):
                    await self.loop.connect_accepted_socket(self.handle_new_connection, connection)
        finally:
            listening.close()
            if spare is not None:
                spare.close()

    def _refuse(self, why: str) -> None:
        """Log the first refusal after a connection that was accepted."""
        if not self.refuses:
            logging.getLogger("shipnet.modbus.server").warning("connections are refused: %s", why)
        self.refuses = True

    def callback_new_connection(self) -> _Handler:
        """Return the handler of a connection; every connection begins here."""
        return _TcpHandler(self)

    @property
    def port(self) -> int:
        """The port that is bound."""
        return int(self.transport.sockets[0].getsockname()[1])


def _open_socket() -> socket | None:
    try:
        return socket()
    except OSError:
        return None


class UdpServer(_Listener, ModbusUdpServer):
    """The library's UDP server with our handler."""

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


class RtuServer(_Listener, ModbusSerialServer):
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

    async def listen(self) -> bool:
        """Open the port, and make sure that it has a parity bit if there should be one.

        Linux may ignore the parity of a pseudo-terminal without an error.
        """
        await super().listen()
        with suppress(ImportError):  # Windows refuses what a port cannot do
            termios = import_module("termios")
            flags = termios.tcgetattr(self.transport.sync_serial.fileno())[2]
            if self.comm_params.parity != "N" and not flags & termios.PARENB:
                await sleep(0)  # what the transport has scheduled needs the port
                raise OSError(EINVAL, "the device has no parity")
        return True

    def callback_new_connection(self) -> _Handler:
        """Return the handler of the port."""
        return _RtuHandler(self)
