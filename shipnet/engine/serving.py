"""A real Modbus server with the two junction boxes behind it that the AMS of lee2012 asks."""

from __future__ import annotations

from typing import Any

import numpy as np

from shipnet.engine.junction_box import junction_box
from shipnet.engine.points import load_points
from shipnet.engine.registers import RegisterMap
from shipnet.engine.screen import SyntheticValues
from shipnet.fields import check_scalar
from shipnet.modbus.server import Server, real_clock, serve

__all__ = ["UNITS", "engine_server"]

#: Unit ids of the boxes that answer the AMS, JB1 and JB3; lee2012, Table 2.
UNITS = (2, 3)


def engine_server(
    *, speed: float = 1.0, rng: np.random.Generator | None = None, **options: Any
) -> Server:
    """Return a server for both boxes, each with the values of all points, to be used in ``with``.

    Parameters
    ----------
    speed : float, default 1
        Seconds of the engine in a real one, 0..1e4.
    rng : numpy.random.Generator, optional
        Draws the waves of the synthetic values; one seeded with 2024 if omitted.
    **options
        As `shipnet.modbus.server.serve` takes them: transport, host, port, and for a serial line
        serial_port and line.

    Returns
    -------
    Server
        Unit ids 2 and 3. Function code 3 reads the registers of `RegisterMap`: one a point in the
        order of Table 3, temperatures in tenths of a degree.

    Raises
    ------
    ArgumentError
        If a number is out of range.

    Examples
    --------
    >>> server = engine_server(speed=0)
    >>> server.slaves[2].answer(bytes.fromhex("03 0000 0002")).hex(" ")
    '03 04 03 ae 04 03'
    """
    factor = check_scalar("speed", speed, "s/s", 0, 1e4)
    points = load_points()
    sensors = SyntheticValues(points, np.random.default_rng(2024) if rng is None else rng)
    box = junction_box(RegisterMap(points), sensors.now)
    return serve(dict.fromkeys(UNITS, box), clock=real_clock(factor), **options)
