"""A real Modbus server with ballast valves behind it; unit id n is valve n."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from shipnet.ballast.faults import Fault
from shipnet.ballast.plant import Plant
from shipnet.ballast.slave import valve_slaves
from shipnet.errors import ArgumentError
from shipnet.fields import check_scalar, check_whole
from shipnet.modbus.adu import MAX_UNIT
from shipnet.modbus.server import Server, real_clock, serve

__all__ = ["parse_fault", "valve_server"]


def parse_fault(text: str, n_valves: int = MAX_UNIT) -> Fault:
    """Return the fault that a text such as ``3:V1:0.8`` names.

    Parameters
    ----------
    text : str
        Unit id of the valve, code of the rule table, and severity, 0..1; 1 if it is left out.
    n_valves : int, default 247
        Number of valves, 1..247.

    Returns
    -------
    Fault
        From time 0 on.

    Raises
    ------
    ArgumentError
        If the text has another form, or names what is not there.

    Examples
    --------
    >>> parse_fault("3:P2:0.5")
    Fault(code='P2', severity=0.5, start=0.0, valves=(2,))
    >>> parse_fault("3:P9")
    Traceback (most recent call last):
        ...
    shipnet.errors.ArgumentError: fault '3:P9': code is 'P9'; it must be one of G1, P1, P2, V1, ...
    """
    parts = text.split(":")
    try:
        if len(parts) not in (2, 3):
            raise ValueError
        unit, severity = int(parts[0]), float(parts[2]) if parts[2:] else 1.0
    except ValueError:
        raise ArgumentError(
            f"fault is {text!r}; it must be VALVE:CODE or VALVE:CODE:SEVERITY, such as 3:V1:0.8"
        ) from None
    try:
        valve = check_whole("valve", unit, 1, n_valves)
        return Fault(parts[1], severity, valves=valve - 1)
    except ArgumentError as error:
        raise ArgumentError(f"fault {text!r}: {error}") from None


def valve_server(
    n_valves: int = 64,
    *,
    faults: Iterable[Fault] = (),
    speed: float = 1.0,
    rng: np.random.Generator | None = None,
    watchdog: float | None = None,
    **options: Any,
) -> Server:
    """Return a server for the valves of a new plant, all closed, to be used in ``with``.

    Parameters
    ----------
    n_valves : int, default 64
        Number of valves, 1..247.
    faults : iterable of Fault, optional
        What is wrong with them, by model time.
    speed : float, default 1
        Seconds of the valves in a real one, 0..1e4.
    rng : numpy.random.Generator, optional
        Draws the noise of the sensors; there is none if omitted.
    watchdog : float, optional
        A motor stops when its valve has had no request for so long, 0.1..3600 [s] of the valves;
        never if omitted.
    **options
        As `shipnet.modbus.server.serve` takes them: transport, host, port, and for a serial line
        serial_port and line.

    Returns
    -------
    Server
        When its block begins, it listens.

    Raises
    ------
    ArgumentError
        If an argument is out of its range.
    ImportError
        If pymodbus, or pyserial for a serial line, is missing.

    Examples
    --------
    >>> with valve_server(3) as server:
    ...     sorted(server.slaves)
    [1, 2, 3]
    """
    count = check_whole("n_valves", n_valves, 1, MAX_UNIT)
    factor = check_scalar("speed", speed, "s/s", 0, 1e4)
    failed = list(faults)
    for fault in failed:
        fault.severities(count)
    plant = Plant(n_valves=count, faults=failed, rng=rng)
    return serve(valve_slaves(plant, watchdog=watchdog), clock=real_clock(factor), **options)
