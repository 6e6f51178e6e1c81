"""A real Modbus server in front of simulated slaves, in TCP, UDP or on a serial port."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import Future
from errno import (
    EACCES,
    EADDRINUSE,
    EADDRNOTAVAIL,
    EAGAIN,
    EBUSY,
    EINVAL,
    EISDIR,
    ENODEV,
    ENOENT,
    ENOTTY,
    ENXIO,
    EPERM,
)
from socket import gaierror
from threading import Thread
from time import monotonic
from typing import Any, Literal

from shipnet.arguments import checked
from shipnet.errors import ArgumentError, load_extra
from shipnet.fields import check_rng, check_scalar, check_whole
from shipnet.modbus.frame import MAX_UNIT
from shipnet.modbus.handlers import Listener, Respond, RtuListener, TcpListener, UdpListener
from shipnet.modbus.pdu import Adu
from shipnet.modbus.slave import Answer, Device, Slave, answer
from shipnet.modbus.uart import SerialLine
from shipnet.modbus.wire import Wire, WireFault, check_faults

Clock = Callable[[], float]
Transport = Literal["tcp", "udp", "rtu"]

_DEFAULT_LINE = SerialLine(9600)

#: What errors of the system mean when a port is opened.
_NETWORK_CAUSES = {
    EADDRINUSE: "port in use; port 0 is any free one",
    EACCES: "not permitted; ports below 1024 may need rights of an administrator",
    EADDRNOTAVAIL: "this machine does not have that address",
}
_SERIAL_CAUSES = {
    ENOENT: "no such device",
    ENXIO: "no such device",
    ENODEV: "no such device",
    EACCES: "not permitted; on Linux the group dialout may use serial ports",
    EPERM: "not permitted",
    EISDIR: "not a tty",
    ENOTTY: "not a tty",
    EAGAIN: "port in use by another program",
    EBUSY: "port in use by another program",
    EINVAL: "the device does not support {character}; a pseudo-terminal has no parity, as in 8N1",
}


def real_clock(speed: float = 1.0) -> Clock:
    """Return a clock that shows 0 now and then runs at a multiple of real time."""
    factor, start = check_scalar("speed", speed, "s/s", 0, 1e6), monotonic()
    return lambda: factor * (monotonic() - start)


class Server:
    """A server that listens between ``with`` and the end of its block; `serve` makes one.

    Attributes
    ----------
    slaves : dict of int to Slave
        Slaves by unit id; their behaviour may be changed while the server listens.
    port : int
        TCP or UDP port that is bound; 0 on a serial line, and while it does not listen.

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
        self._check_idle()
        ready: Future[None] = Future()
        self._thread = Thread(
            target=lambda: asyncio.run(self._hold(ready)), name="shipnet Modbus server", daemon=True
        )
        self._thread.start()
        try:
            ready.result()
        except BaseException:
            self._finish()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        self._finish()

    async def __aenter__(self) -> Server:
        """Listen in the event loop that runs."""
        self._check_idle()
        await self._open()
        return self

    async def __aexit__(self, *_: object) -> None:
        """Stop, and close all connections."""
        await self._close()

    def _check_idle(self) -> None:
        if self._listener is not None or self._thread is not None:
            raise RuntimeError("the server listens already")

    def _finish(self) -> None:
        self._stop()
        self._stop = lambda: None
        if self._thread is not None:
            self._thread.join()
            self._thread = None

    async def _hold(self, ready: Future[None]) -> None:
        loop, stopped = asyncio.get_running_loop(), asyncio.Event()
        self._stop = lambda: loop.call_soon_threadsafe(stopped.set)
        try:
            await self._open()
        except BaseException as problem:
            self._stop = lambda: None
            ready.set_exception(problem)
            return
        ready.set_result(None)
        await stopped.wait()
        await self._close()

    async def _open(self) -> None:
        clock = self._clock()

        def respond(request: Adu) -> Answer:
            return answer(self.slaves, request, clock(), serial=self._serial)

        listener, why = self._make(respond), ""
        try:
            await listener.listen()
        # A serial port that refuses its settings raises no OSError.
        except Exception as problem:
            listener.close()
            why = _cause(problem, listener)
        if why:  # no exception keeps the frames, and with them a half-open port
            raise OSError(f"cannot listen on {listener.place}: {why}")
        self._listener, self.port = listener, listener.port

    async def _close(self) -> None:
        if self._listener is not None:
            self._listener.close()
        self._listener, self.port = None, 0
        # The loop closes a transport, and ends a task, in its next turns.
        for _ in range(3):
            await asyncio.sleep(0)


def _cause(problem: Exception, listener: Listener) -> str:
    """Say why it cannot listen, by the error of the system; pyserial hides it in a text."""
    if isinstance(problem, gaierror | UnicodeError):
        return "unknown host"
    causes, character = _NETWORK_CAUSES, ""
    if isinstance(listener, RtuListener):
        causes, character = _SERIAL_CAUSES, listener.line.character
    raised = (problem, problem.__context__)
    codes = [one for e in raised if e is not None for one in e.args[:1] if one in causes]
    return causes[codes[0]].format(character=character) if codes else str(problem)


@checked
def serve(
    devices: Mapping[int, Device | Slave],
    transport: Transport = "tcp",
    *,
    host: str = "127.0.0.1",
    port: int = 0,
    serial_port: str = "",
    line: SerialLine = _DEFAULT_LINE,
    silence: float = 0.05,
    speed: float = 1.0,
    clock: Clock | None = None,
    max_clients: int = 128,
    idle_limit: float = 600.0,
    wire_faults: WireFault | Iterable[WireFault] = (),
    rng: Any = 2024,
) -> Server:
    r"""Return a server for simulated devices, to be used in ``with`` or ``async with``.

    Parameters
    ----------
    devices : mapping of int to Device or Slave
        Devices by unit id: 1..247, and 0 for the server itself, not on a serial line. A bare
        device becomes a `Slave` that serves all function codes at once.
    transport : {"tcp", "udp", "rtu"}, default "tcp"
        Modbus/TCP; the same frames in datagrams, which no standard has but kim2014 uses; or RTU.
    host : str, default "127.0.0.1"
        Address to listen on; the default is reached from this machine only.
    port : int, default 0
        TCP or UDP port, 0..65535; with 0 the system chooses one, see `Server.port`.
    serial_port : str, optional
        Serial port for RTU, such as ``"/dev/ttyUSB0"``.
    line : SerialLine, default 9600 bit/s and 8E1
        Settings of that port. An answer begins no sooner than t3.5 after its request. Linux
        refuses parity on a pseudo-terminal, which takes ``SerialLine(9600, "8N1")``.
    silence : float, default 0.05
        Silence after which bytes that are not a frame are dropped, t3.5..10 [s]. It is longer than
        t3.5 for adapters and drivers that hand on bytes in portions.
    speed : float, default 1
        Model seconds that pass in a real one, from the start of the server, 0..1e6.
    clock : callable, optional
        Model time [s] when called, in place of `speed`. Devices get it with each request. Nothing
        sleeps for it: only answers are held back, for real seconds, by their slave's delay.
    max_clients : int, default 128
        TCP connections at the same time, 1..10000; a further one is closed at once.
    idle_limit : float, default 600
        A TCP connection without a request for so long is closed, 0.01..1e6 [s].
    wire_faults : WireFault or iterable of WireFault, optional
        What becomes of some answers in TCP or on a serial line; at most one hits an answer.
    rng : optional
        Draws which ones, and random delays and bytes; whatever `numpy.random.default_rng` takes.

    Returns
    -------
    Server
        When its block begins, it listens; when it ends, all is closed.

    Raises
    ------
    ArgumentError
        If an argument is out of its range.
    ImportError
        For RTU, if pymodbus or pyserial is missing.
    OSError
        On entry, if it cannot listen there; the text names the cause, such as a port in use, a
        missing device, or a parity that the device does not support.

    Notes
    -----
    A frame of another protocol, a datagram that is not a frame and an RTU frame with a wrong CRC
    get no answer; a TCP connection with an impossible length field is closed, because nothing
    shows where the next frame begins.

    Clients take turns: at most four requests of one TCP client are answered before those of all
    others have had their turn. A client that leaves 64 KiB of answers unread is disconnected; one
    with 256 answers held back must wait. Datagrams share one queue of the system, first come,
    first served: it drops what comes too fast, whoever sent it. Of a sender with 256 answers held
    back, further datagrams are dropped, and of all senders at 32768 answers.

    Examples
    --------
    >>> import socket
    >>> with serve({1: Slave(holding_registers=[350, 412])}) as server:
    ...     with socket.create_connection(("127.0.0.1", server.port)) as client:
    ...         _ = client.send(bytes.fromhex("0001 0000 0006 01 03 0000 0002"))
    ...         print(client.recv(260).hex(" "))
    00 01 00 00 00 07 01 03 04 01 5e 01 9c
    """
    rtu = transport == "rtu"
    if not devices:
        raise ArgumentError("devices is {}; there must be one device or more")
    slaves = {}
    for unit, device in devices.items():
        why = " on a serial line" if rtu else ""
        known = check_whole("unit id", unit, int(rtu), MAX_UNIT, why)
        slaves[known] = device if isinstance(device, Slave) else Slave(device)
    if not host:
        raise ArgumentError(f"host is {host!r}; it must be a name or an address")
    bound = check_whole("port", port, 0, 0xFFFF)
    if rtu != bool(serial_port):
        raise ArgumentError(f"serial_port is {serial_port!r}; RTU needs one, and nothing else does")
    quiet = check_scalar("silence", silence, "s", line.t35, 10)
    limit = check_scalar("idle_limit", idle_limit, "s", 0.01, 1e6)
    most = check_whole("max_clients", max_clients, 1, 10_000)
    check_scalar("speed", speed, "s/s", 0, 1e6)
    faults = check_faults(wire_faults, transport)
    check_rng(rng)
    if rtu:
        for module, package in (("pymodbus", "pymodbus"), ("serial", "pyserial")):
            load_extra(module, package)

    def make(respond: Respond) -> Listener:
        listener: Listener
        if rtu:
            listener = RtuListener(respond, serial_port, line, quiet)
        elif transport == "udp":
            listener = UdpListener(respond, host, bound)
        else:
            listener = TcpListener(respond, host, bound, most, limit)
        listener.wire = Wire(faults, rng) if faults else None
        return listener

    return Server(slaves, make, lambda: clock or real_clock(speed), rtu)
