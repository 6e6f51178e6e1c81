"""Listeners for requests over TCP, in datagrams or on a serial port."""

from __future__ import annotations

import logging
from asyncio import BufferedProtocol, DatagramProtocol, Protocol, Server, get_running_loop, sleep
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from errno import EINVAL
from importlib import import_module
from typing import Any

from shipnet.errors import FrameError
from shipnet.modbus.frame import MAX_PDU, RTU_BYTES
from shipnet.modbus.pdu import Adu, decode
from shipnet.modbus.slave import Answer
from shipnet.modbus.uart import SerialLine
from shipnet.modbus.wire import Wire

Respond = Callable[[Adu], Answer]

_LOG = logging.getLogger("shipnet.modbus.server")

_QUOTA = 4  #: Maximum number of requests of a client that are answered in one turn.
_READ = 4096  #: Maximum number of bytes per read from a client; they are processed before the next.

#: Maximum numbers of delayed responses: to one client, and to all senders of datagrams together.
#: Further TCP requests wait; further datagrams and serial requests are dropped.
_HELD_BACK, _ALL_HELD_BACK = 256, 1 << 15
_UNSENT = 1 << 16  #: Size of unsent responses above which a client is disconnected [byte].
_APART = 1e-6  #: Time between timers that must fire in order [s].

#: Largest number of TCP connections, and the time without requests after which one is closed [s]:
#: always, and when another client connects beyond the largest number.
_CLIENTS, _IDLE, _REPLACED = 128, 600.0, 10.0
_SILENCE = 0.05  #: Incomplete serial frames are dropped after this silence, or t3.5 if longer [s].

#: Bytes of a TCP frame up to the end of its length field; shortest and longest legal length.
_HEAD, _SHORTEST, _LONGEST = 6, 2, 1 + MAX_PDU


class Listener:
    """Base class of listeners on an address of a host, or on a serial port.

    `place` is the address or device in words, and `port` the bound port.
    """

    def __init__(
        self, respond: Respond, wire: Wire | None, address: tuple[str, int] | str, line: SerialLine
    ) -> None:
        self.respond, self.wire, self.address, self.line = respond, wire, address, line
        self.place = address if isinstance(address, str) else f"{address[0]}, port {address[1]}"
        self.port = 0
        self.handlers: set[_Handler] = set()

    async def listen(self) -> None:
        """Open the port, or raise an error."""
        raise NotImplementedError

    def close(self) -> None:
        """Close the port and all connections."""
        for handler in list(self.handlers):
            handler.transport.abort()
            handler.connection_lost(None)


class _Handler:
    """Base class of the handlers of requests on a TCP connection, UDP socket or serial port."""

    transport: Any = None

    #: Maximum number of unsent bytes (serial: writes); beyond it, responses are dropped.
    unsent = _UNSENT

    def __init__(self, listener: Any) -> None:
        self.listener, self.loop = listener, get_running_loop()
        self.received = b""
        self.held_back: Counter[Any] = Counter()
        self.free = 0.0  # time at which the last response will have left the faulty wire

    def connection_made(self, transport: Any) -> None:
        """Start."""
        self.transport = transport
        self.listener.handlers.add(self)

    def connection_lost(self, exc: Exception | None) -> None:
        """Stop sending."""
        self.transport = None
        self.listener.handlers.discard(self)

    def reply(self, request: Adu, to: Any = None, wait: float = 0.0) -> None:
        """Send the response when it is due."""
        held = self.held_back
        if held[to] >= _HELD_BACK or held.total() >= _ALL_HELD_BACK:
            return
        answer = self.listener.respond(request)
        if not answer.pdu:
            return
        adu = Adu(request.unit_id, answer.pdu, request.transaction_id)
        delay = wait + answer.delay
        if self.listener.wire is not None:
            # Responses stay in order: a slave works on one request at a time.
            due = max(self.loop.time(), self.free) + delay
            for silence, data in self.listener.wire.pieces(adu):
                due += silence + _APART
                held[to] += 1
                self.loop.call_at(due, self._send_late, data, to)
            self.free = due
        elif delay > 0:
            held[to] += 1
            self.loop.call_later(delay, self._send_late, adu.frame, to)
        else:
            self._send_if_open(adu.frame, to)

    def _send_late(self, frame: bytes, to: Any) -> None:
        self.held_back -= Counter([to])  # drops entries of 0
        self._send_if_open(frame, to)

    def _send_if_open(self, frame: bytes, to: Any) -> None:
        if self._is_open() and self.transport.get_write_buffer_size() <= self.unsent:
            self._send(frame, to)

    def _send(self, frame: bytes, to: Any) -> None:
        self.transport.write(frame)

    def _is_open(self) -> bool:
        return self.transport is not None and not self.transport.is_closing()


class _TcpHandler(_Handler, BufferedProtocol):
    """Handler of a TCP connection; it limits each read, and takes turns with other connections."""

    def __init__(self, listener: Listener) -> None:
        super().__init__(listener)
        self.space = bytearray(_READ)
        self.in_turn = False
        self.last_request, self.has_requested = self.loop.time(), False
        self.timer = self.loop.call_later(_IDLE, self._end_if_idle)

    def connection_made(self, transport: Any) -> None:
        """Start, in the place of the client that is silent longest if too many are connected."""
        others = self.listener.handlers
        if len(others) >= _CLIENTS:
            silent = min(others, key=lambda one: (one.has_requested, one.last_request))
            busy = silent.held_back or self.loop.time() - silent.last_request < _REPLACED
            if silent.has_requested and busy:
                self.listener.refuse()
                transport.close()
                return
            silent.transport.abort()
            silent.connection_lost(None)
        super().connection_made(transport)

    def connection_lost(self, exc: Exception | None) -> None:
        """Stop the idle timer."""
        self.timer.cancel()
        super().connection_lost(exc)

    def get_buffer(self, sizehint: int) -> bytearray:
        """Return the buffer for the next bytes."""
        return self.space

    def buffer_updated(self, nbytes: int) -> None:
        """Take the bytes, and answer unless the next turn is already scheduled."""
        self.received += self.space[:nbytes]
        if not self.in_turn:
            self._take_turn()

    def _take_turn(self) -> None:
        """Answer a few requests; further ones wait until all other clients have had their turn."""
        self.in_turn = False
        for _ in range(_QUOTA):
            if not self._is_open():
                return
            if self.held_back[None] >= _HELD_BACK:
                self.transport.pause_reading()  # sending a response starts the next turn
                return
            frame = self._next_frame()
            if not frame:
                self.transport.resume_reading()
                return
            self.last_request, self.has_requested = self.loop.time(), True
            with suppress(FrameError):  # frames of other protocols are ignored
                self.reply(decode(frame, "tcp"))
        self.transport.pause_reading()
        self.in_turn = True
        self.loop.call_soon(self._take_turn)

    def _next_frame(self) -> bytes:
        """Return the next whole frame, if any; an illegal length closes the connection."""
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
        """Close a connection without recent requests, or check again later."""
        now = self.loop.time()
        if self.held_back:
            self.last_request = now
        remaining = self.last_request + _IDLE - now
        if remaining > 0:
            self.timer = self.loop.call_later(remaining, self._end_if_idle)
        elif self._is_open():
            self.transport.abort()


class _UdpHandler(_Handler, DatagramProtocol):
    def datagram_received(self, data: bytes, addr: Any) -> None:
        """Answer a datagram if it is a frame; ignore it otherwise."""
        with suppress(FrameError):
            self.reply(decode(data, "tcp"), addr)

    def _send(self, frame: bytes, to: Any) -> None:
        self.transport.sendto(frame, to)


class _RtuHandler(_Handler, Protocol):
    """Handler of a serial port; bytes that do not form a frame are dropped after a silence."""

    unsent = 4

    def __init__(self, listener: Listener) -> None:
        super().__init__(listener)
        self.timer = self.loop.call_soon(self._forget)

    def data_received(self, data: bytes) -> None:
        """Collect bytes until they form a frame, or until the line is silent."""
        self.timer.cancel()
        # One byte more than the longest frame is kept, so that longer data are not read as a frame.
        self.received = (self.received + data)[: MAX_PDU + RTU_BYTES + 1]
        try:
            adu = decode(self.received)
        except FrameError:
            silence = max(_SILENCE, self.listener.line.t35)
            self.timer = self.loop.call_later(silence, self._forget)
            return
        self._forget()
        self.reply(adu, wait=self.listener.line.t35)

    def _forget(self) -> None:
        self.received = b""


class TcpListener(Listener):
    """A listener for a limited number of TCP clients; it counts the connections that it refuses."""

    server: Server | None = None
    refused = 0

    async def listen(self) -> None:
        """Bind all addresses of the host, and accept connections."""
        loop = get_running_loop()
        self.server = await loop.create_server(lambda: _TcpHandler(self), *self.address)
        self.port = self.server.sockets[0].getsockname()[1]

    def refuse(self) -> None:
        """Count a refused connection, and log the first one."""
        self.refused += 1
        if self.refused == 1:
            _LOG.warning("connections are refused: %d clients are connected", _CLIENTS)

    def close(self) -> None:
        """Stop accepting clients, close all connections, and log how many were refused."""
        if self.server is not None:
            self.server.close()
        if self.refused:
            _LOG.warning("connections refused in all: %d", self.refused)
        super().close()


class UdpListener(Listener):
    """A listener for datagrams from any sender."""

    async def listen(self) -> None:
        """Bind the port."""
        transport, _ = await get_running_loop().create_datagram_endpoint(
            lambda: _UdpHandler(self), local_addr=self.address
        )
        self.port = int(transport.get_extra_info("sockname")[1])


class RtuListener(Listener):
    """A listener on a serial port, which it opens through pymodbus and pyserial."""

    async def listen(self) -> None:
        """Open the port and check its parity, which Linux may ignore for a pseudo-terminal."""
        size, parity, stop = tuple(self.line.character)
        library = import_module("pymodbus.transport.serialtransport")
        transport, handler = await library.create_serial_connection(
            get_running_loop(),
            lambda: _RtuHandler(self),
            self.place,
            baudrate=round(self.line.bit_rate),
            bytesize=int(size),
            parity=parity,
            stopbits=int(stop),
            timeout=0,
        )
        # The event loop sets up the transport in its next two iterations.
        while handler.transport is None:
            await sleep(0)
        with suppress(ImportError):  # Windows itself refuses unsupported settings
            termios = import_module("termios")
            flags = termios.tcgetattr(transport.sync_serial.fileno())[2]
            if parity != "N" and not flags & termios.PARENB:
                raise OSError(EINVAL, "the device does not support parity")
