"""A Modbus server for simulated slaves, over TCP, UDP or a serial port."""

from __future__ import annotations

import asyncio
import errno
from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import Future
from os import PathLike
from socket import gaierror
from threading import Thread
from time import monotonic
from typing import Any, Literal, get_args

from shipnet.errors import ArgumentError, load_extra
from shipnet.fields import check_choice, check_rng, check_scalar, check_whole
from shipnet.modbus.frame import MAX_UNIT
from shipnet.modbus.handlers import Listener, Respond, RtuListener, TcpListener, UdpListener
from shipnet.modbus.pdu import Adu
from shipnet.modbus.slave import Answer, Device, Slave, answer, read_slaves
from shipnet.modbus.uart import SerialLine
from shipnet.modbus.wire import Wire, WireFault, check_faults

Clock = Callable[[], float]
Transport = Literal["tcp", "udp", "rtu"]

_DEFAULT_LINE = SerialLine(9600)

_LISTENERS: dict[Transport, type[Listener]] = {
    "tcp": TcpListener,
    "udp": UdpListener,
    "rtu": RtuListener,
}

#: Reasons why a port cannot be opened, by the system's error number.
_NETWORK_CAUSES = {
    errno.EADDRINUSE: "port in use; port 0 selects a free one",
    errno.EACCES: "not permitted; ports below 1024 may require administrator rights",
    errno.EADDRNOTAVAIL: "this machine does not have that address",
}
_SERIAL_CAUSES = {
    **dict.fromkeys((errno.ENOENT, errno.ENXIO, errno.ENODEV), "no such device"),
    errno.EACCES: "not permitted; on Linux, join the group dialout to use serial ports",
    errno.EPERM: "not permitted",
    **dict.fromkeys((errno.EISDIR, errno.ENOTTY), "not a tty"),
    **dict.fromkeys((errno.EAGAIN, errno.EBUSY), "port in use by another program"),
    errno.EINVAL: "the device does not support {character}; a pseudo-terminal needs a setting "
    "without parity, such as 8N1",
}


def real_clock(speed: float = 1.0) -> Clock:
    """Return a clock that starts at 0 now and runs at a multiple of real time."""
    factor, start = check_scalar("speed", speed, "s/s", 0, 1e6), monotonic()
    return lambda: factor * (monotonic() - start)


class Server:
    """A server that listens inside its ``with`` block, as returned by `serve`.

    `slaves` contains the slaves by unit id and may be changed while the server listens; `port` is
    the TCP or UDP port in use, 0 on a serial line or when not listening.

    Examples
    --------
    >>> with serve({1: Slave(input_registers=[7])}) as server:
    ...     server.port > 0
    True
    """

    def __init__(
        self,
        slaves: dict[int, Slave],
        make: Callable[[Respond], Listener],
        clock: Callable[[], Clock],
        serial: bool,
    ) -> None:
        self.slaves = slaves
        self.port = 0
        self._make, self._clock, self._serial = make, clock, serial
        self._listener: Listener | None = None
        self._thread: Thread | None = None
        self._stop: Callable[[], object] = lambda: None

    def __repr__(self) -> str:
        where = f"listens on port {self.port}" if self.port else "listens on a serial line"
        if self._listener is None:
            where = "does not listen"
        return f"Server({len(self.slaves)} slave{'s'[: len(self.slaves) > 1]}, {where})"

    def __enter__(self) -> Server:
        if self._thread is not None:
            raise RuntimeError("the server is already listening")
        ready: Future[None] = Future()
        self._thread = Thread(
            target=lambda: asyncio.run(self._run(ready)), name="shipnet Modbus server", daemon=True
        )
        self._thread.start()
        try:
            ready.result()
        except BaseException:
            self.__exit__()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        if self._thread is not None:
            self._stop()
            self._thread.join()
            self._thread = None

    async def _run(self, ready: Future[None]) -> None:
        """Listen until the end of the block."""
        loop, stopped, clock = asyncio.get_running_loop(), asyncio.Event(), self._clock()

        def respond(request: Adu) -> Answer:
            return answer(self.slaves, request, clock(), serial=self._serial)

        listener = self._make(respond)
        try:
            await listener.listen()
        # A serial port that rejects its settings may raise an error other than OSError.
        except BaseException as problem:
            listener.close()
            self._stop = lambda: None
            why = _cause(problem, listener)
            ready.set_exception(OSError(f"cannot listen on {listener.place}: {why}"))
            return
        self._listener, self.port = listener, listener.port
        self._stop = lambda: loop.call_soon_threadsafe(stopped.set)
        ready.set_result(None)
        await stopped.wait()
        listener.close()
        self._listener, self.port = None, 0
        # The event loop closes transports in its next iterations.
        for _ in range(3):
            await asyncio.sleep(0)


def _cause(problem: BaseException, listener: Listener) -> str:
    """Return why the server cannot listen; pyserial reports the system's error only as text."""
    if isinstance(problem, gaierror | UnicodeError):
        return "unknown host"
    causes, character = _NETWORK_CAUSES, ""
    if isinstance(listener, RtuListener):
        causes, character = _SERIAL_CAUSES, listener.line.character
    raised = (problem, problem.__context__)
    codes = [one for e in raised if e is not None for one in e.args[:1] if one in causes]
    return causes[codes[0]].format(character=character) if codes else str(problem)


def serve(
    devices: Mapping[int, Device | Slave] | str | PathLike[str],
    transport: Transport = "tcp",
    *,
    host: str = "127.0.0.1",
    port: int = 0,
    serial_port: str = "",
    line: SerialLine = _DEFAULT_LINE,
    speed: float = 1.0,
    clock: Clock | None = None,
    wire_faults: WireFault | Iterable[WireFault] = (),
    rng: Any = 2024,
) -> Server:
    """Return a server for simulated devices, for use in a ``with`` block.

    Parameters
    ----------
    devices : mapping of int to Device or Slave, or path
        Devices by unit id, 1..247; over TCP and UDP also 0, the server itself. A bare device
        becomes a `Slave`. Or a table, as for `scan`; see Notes.
    transport : {"tcp", "udp", "rtu"}, default "tcp"
        ``tcp`` is Modbus/TCP; ``udp`` sends the same frames in datagrams, as in kim2014, though no
        standard defines this; ``rtu`` is RTU on a serial line.
    host : str, default "127.0.0.1"
        Address to listen on; by default only this machine can connect. With another address, such
        as ``"0.0.0.0"``, anybody on the network can operate the devices.
    port : int, default 0
        TCP or UDP port, 0..65535; 0 selects a free one, see `Server.port`.
    serial_port : str, optional
        Serial port for RTU, such as ``"/dev/ttyUSB0"``.
    line : SerialLine, default 9600 bit/s and 8E1
        Settings of the serial port; a response is sent after a silence of t3.5. A Linux
        pseudo-terminal has no parity: use ``SerialLine(9600, "8N1")``.
    speed : float, default 1
        Simulated seconds per real second, from the start of the server, 0..1e6.
    clock : callable, optional
        Function that returns the simulated time [s] for the devices, in place of `speed`. A slave's
        delay is in real seconds.
    wire_faults : WireFault or iterable of WireFault, optional
        Faults of responses over TCP or a serial line; a response has at most one of them.
    rng : optional
        Random generator or seed for `wire_faults`, as in `numpy.random.default_rng`.

    Returns
    -------
    Server
        The server, which listens inside its ``with`` block.

    Raises
    ------
    ImportError
        For RTU, if pymodbus or pyserial is missing.
    OSError
        On entering the block, if the server cannot listen; the message names the cause, such as a
        port in use, a missing device or an unsupported parity.

    Notes
    -----
    A table may also have the columns ``values`` (one for all registers of the row or one for each,
    with blanks between them; 0 if empty) and ``exception`` (code that refuses the row's function on
    its registers). Each slave serves the functions of its rows, after the longest ``delay`` of
    them; a ``dead`` one is silent.

    Frames of other protocols, invalid datagrams and RTU frames with a wrong CRC get no response; an
    illegal length field closes the TCP connection, because the next frame cannot be found. On a
    serial line an incomplete frame is dropped after a silence of 50 ms, or t3.5 if that is longer,
    because adapters and drivers may pass on the bytes of a frame in portions.

    Up to 128 TCP connections can be open. A further one replaces a client that has sent no request
    yet, or none for 10 s; otherwise, it is refused and counted in the log. A
    connection without requests is closed after 10 minutes. TCP clients take turns of at most four
    requests. A client that leaves more than 64 KiB of responses unread is disconnected; while 256
    responses to it are delayed, its further requests wait. Datagrams share one queue; they are
    dropped when it is full, and also while 256 responses to their sender or 32768 responses in all
    are delayed.

    Examples
    --------
    >>> import socket
    >>> with serve({1: Slave(holding_registers=[350, 412])}) as server:
    ...     with socket.create_connection(("127.0.0.1", server.port)) as client:
    ...         _ = client.send(bytes.fromhex("0001 0000 0006 01 03 0000 0002"))
    ...         print(client.recv(260).hex(" "))
    00 01 00 00 00 07 01 03 04 01 5e 01 9c
    """
    check_choice("transport", transport, get_args(Transport))
    rtu = transport == "rtu"
    if isinstance(devices, str | PathLike):
        devices = read_slaves(devices)
    if not devices:
        raise ArgumentError("devices is empty; it must contain at least one device")
    slaves = {}
    for unit, device in devices.items():
        why = " on a serial line" if rtu else ""
        unit_id = check_whole("unit id", unit, int(rtu), MAX_UNIT, why)
        slaves[unit_id] = device if isinstance(device, Slave) else Slave(device)
    if not host:
        raise ArgumentError(f"host is {host!r}; it must be a name or an address")
    bound = check_whole("port", port, 0, 0xFFFF)
    if rtu != bool(serial_port):
        raise ArgumentError(f"serial_port is {serial_port!r}; give one for RTU, and only for RTU")
    check_scalar("speed", speed, "s/s", 0, 1e6)
    faults = check_faults(wire_faults, transport)
    check_rng(rng)
    if rtu:
        for module, package in (("pymodbus", "pymodbus"), ("serial", "pyserial")):
            load_extra(module, package)

    def make(respond: Respond) -> Listener:
        wire = Wire(faults, rng) if faults else None
        address = serial_port if rtu else (host, bound)
        return _LISTENERS[transport](respond, wire, address, line)

    return Server(slaves, make, lambda: clock or real_clock(speed), rtu)
