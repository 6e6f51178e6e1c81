"""The operating point of a valve: what its sensors would read in the middle of a stroke."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from shipnet.ballast.actuator import Actuator
from shipnet.ballast.hydraulics import hydraulics, load_pressure, stroke_time
from shipnet.ballast.motor import motor_current, steady_temperature
from shipnet.errors import ArgumentError

__all__ = ["OperatingPoint", "operating_point"]

Floats = npt.NDArray[np.float64]


class OperatingPoint(NamedTuple):
    """A running valve, half open; every attribute has the shape () or (n_valves,).

    Attributes
    ----------
    FP, OP : ndarray
        Pump and operating pressure [bar].
    MC : ndarray
        Motor current [A].
    OT : ndarray
        Motor temperature after many strokes [degC].
    stroke_time : ndarray
        From end to end [s]; inf if the valve stops on its way.
    """

    FP: Floats
    OP: Floats
    MC: Floats
    OT: Floats
    stroke_time: Floats


def operating_point(actuator: Actuator, direction: int = 1) -> OperatingPoint:
    """Return the operating point that follows from the numbers of an actuator.

    Parameters
    ----------
    actuator : Actuator
        The valve, or many.
    direction : int, default 1
        1 opens, -1 closes.

    Returns
    -------
    OperatingPoint
        Readings of ideal sensors.

    Raises
    ------
    ArgumentError
        If the direction is neither.

    Notes
    -----
    The paper prints FP 90, OP 2, MC 1.2, OT 50 and 0 to 10 s for a healthy valve (claims
    kim2014-071 and -072). Ours lie near it by the choice of the actuator: that all agree at once
    shows that the paper's values are consistent with one machine, not that it was this one.

    Examples
    --------
    >>> for name, value in operating_point(Actuator())._asdict().items():
    ...     print(name, round(float(value), 2))
    FP 90.06
    OP 2.07
    MC 1.2
    OT 50.03
    stroke_time 9.0
    """
    if direction not in (-1, 1):
        raise ArgumentError(f"direction is {direction!r}; it must be 1 to open or -1 to close")
    state = hydraulics(actuator, load_pressure(actuator, 0.5, direction))
    return OperatingPoint(
        state.pump_pressure / 1e5,
        state.cylinder_pressure / 1e5,
        motor_current(actuator, state.pump_pressure),
        steady_temperature(actuator),
        stroke_time(actuator, direction),
    )
