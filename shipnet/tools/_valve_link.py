"""How the valve client reaches valves: over Modbus/TCP, or in model time without a server."""

from __future__ import annotations

import socket
from collections.abc import Callable

import numpy as np

from shipnet.ballast.plant import Plant
from shipnet.ballast.slave import valve_slaves
from shipnet.ballast.valve_faults import Fault
from shipnet.errors import FrameError
from shipnet.modbus.adu import Adu, decode
from shipnet.modbus.pdu import Request, Response
from shipnet.modbus.slave import answer

#: Takes unit id and request, returns the response: a `Link`, or `ModelValves`.
Ask = Callable[[int, Request], Response]

_MBAP = 7


class Link:
    """A connection to a server, to be called with unit id and request, or closed."""

    def __init__(self, address: str, port: int, timeout: float = 1.0) -> None:
        self.where, self._last = f"{address}, port {port}", 0
        try:
            self._socket = socket.create_connection((address, port), timeout)
        except (OSError, UnicodeError) as problem:
            raise OSError(f"no server at {self.where}: {problem}") from None

    def __call__(self, unit: int, request: Request) -> Response:
        """Send a request and return the response."""
        self._last = (self._last + 1) % 0x10000
        try:
            self._socket.sendall(request.tcp(unit, self._last))
            while True:
                head = self._receive(_MBAP)
                body = self._receive(int.from_bytes(head[4:6], "big") - 1)
                adu = decode(head + body, "tcp")
                # The answer to a request that timed out is not for this one.
                if adu.transaction_id == self._last:
                    return Response.parse(adu.pdu, request)
        except (OSError, FrameError) as problem:
            raise OSError(f"{self.where} does not answer for valve {unit}: {problem}") from None

    def _receive(self, size: int) -> bytes:
        got = b""
        while len(got) < size:
            more = self._socket.recv(size - len(got))
            if not more:
                raise OSError("the connection was closed")
            got += more
        return got

    def close(self) -> None:
        """Close the connection."""
        self._socket.close()


class ModelValves:
    """Valves without a server, whose time is set."""

    def __init__(
        self,
        n_valves: int = 16,
        faults: tuple[Fault, ...] = (),
        rng: np.random.Generator | None = None,
    ) -> None:
        self._slaves = valve_slaves(Plant(n_valves=n_valves, faults=faults, rng=rng))
        self.time = 0.0

    def __call__(self, unit: int, request: Request) -> Response:
        """Answer a request."""
        return Response.parse(answer(self._slaves, Adu(unit, request.pdu), self.time).pdu, request)
