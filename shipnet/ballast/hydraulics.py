r"""Pressures and flow of an actuator whose motor runs, in closed form.

Oil is taken as stiff: pressures follow the load at once. `shipnet.ballast.compliance` shows what
that neglects. A flow q through the restrictor takes a pressure :math:`s^2 = (q/C)^2`, so that each
balance of the pump is a quadratic equation in s:

.. math:: K s^2 + b s = c
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from shipnet.ballast.actuator import Actuator
from shipnet.errors import ArgumentError
from shipnet.fields import check_scalar

__all__ = [
    "Hydraulics",
    "Oil",
    "hydraulics",
    "load_pressure",
    "move_time",
    "stroke_time",
    "valve_torque",
    "velocity",
]

Floats = npt.NDArray[np.float64]

#: Opening over which the seat lets go, as a part of the quarter turn; our assumption.
_SEAT = 0.03

#: Nodes of the quadrature over a stroke; with 48 the seat's exponential is good to 1e-9.
_NODES = 48


class Hydraulics(NamedTuple):
    """State of the oil.

    Attributes
    ----------
    pump_pressure, cylinder_pressure : ndarray
        Pressures before and behind the lock valve [Pa].
    flow : ndarray
        Oil that moves the piston [m3/s]; 0 where the pump cannot move the load.
    """

    pump_pressure: Floats
    cylinder_pressure: Floats
    flow: Floats


def valve_torque(
    actuator: Actuator, opening: npt.ArrayLike, direction: npt.ArrayLike = 1
) -> Floats:
    r"""Return the torque that a butterfly valve needs.

    .. math:: T = T_b + T_s e^{-x/0.03} \pm T_d x \sin^2 \pi x

    Parameters
    ----------
    actuator : Actuator
        Torques of the valve.
    opening : array_like of float
        Opening x, 0 closed to 1 open.
    direction : array_like of int, default 1
        1 opens, against the torque of the flow; -1 closes, with it.

    Returns
    -------
    ndarray of float
        Torque against the movement [N m]; 0 where the flow would close the valve by itself.

    Notes
    -----
    Bearing, seating and dynamic part as in AWWA M49, with an assumed shape: the torque of the flow
    is highest, 0.61 of `dynamic_torque`, at an opening of 58 %.

    Examples
    --------
    >>> valve_torque(Actuator(), [0.0, 0.5, 1.0]).round(1).tolist()
    [70.0, 65.0, 55.0]
    """
    x = np.minimum(np.maximum(np.asarray(opening, float), 0), 1)
    flow = np.asarray(direction) * actuator.dynamic_torque * x * np.sin(np.pi * x) ** 2
    friction = actuator.bearing_torque + actuator.seating_torque * np.exp(-x / _SEAT)
    return np.asarray(np.maximum(friction + flow, 0.0))


def load_pressure(
    actuator: Actuator, opening: npt.ArrayLike, direction: npt.ArrayLike = 1
) -> Floats:
    """Return the cylinder pressure that moves a valve.

    Parameters
    ----------
    actuator, opening, direction
        As for `valve_torque`.

    Returns
    -------
    ndarray of float
        Pressure [Pa].

    Examples
    --------
    >>> round(float(load_pressure(Actuator(), 0.5)) / 1e5, 2)
    2.07
    """
    torque = valve_torque(actuator, opening, direction)
    return np.asarray(torque / (actuator.piston_area * actuator.pinion_radius))


def hydraulics(actuator: Actuator, load: npt.ArrayLike) -> Hydraulics:
    r"""Return pressures and flow for a load.

    Parameters
    ----------
    actuator : Actuator
        Pump, relief valve, lock valve and cylinder.
    load : array_like of float
        Cylinder pressure that would move the valve, as `load_pressure` returns it, 0..inf [Pa].

    Returns
    -------
    Hydraulics
        Pressures and flow, of the shape that load and actuator broadcast to.

    Notes
    -----
    With the relief valve shut the pump gives :math:`D n - K p`, with it open
    :math:`D n - (K + K_r) p + K_r p_r`; the smaller of both is right at any pressure. If the flow
    past a standing piston needs less pressure than the load, the valve stands still.

    Examples
    --------
    A healthy valve, and one that is stuck:

    >>> state = hydraulics(Actuator(), [2e5, float("inf")])
    >>> (state.pump_pressure / 1e5).round(1).tolist(), (state.flow * 1e6).round(1).tolist()
    ([90.0, 127.6], [54.8, 0.0])
    """
    return Oil(actuator).state(load)


class Oil:
    """The oil of an actuator, with what no load changes worked out once.

    Parameters
    ----------
    actuator : Actuator
        Pump, relief valve, lock valve and cylinder.

    Examples
    --------
    >>> oil = Oil(Actuator())
    >>> [(oil.state(load).flow * 1e6).round(1).item() for load in (2e5, 4e5)]
    [54.8, 54.7]
    """

    def __init__(self, actuator: Actuator) -> None:
        a = actuator
        pumped = np.asarray(a.displacement) * a.speed
        leaks = (np.asarray(a.pump_leak), np.asarray(a.pump_leak) + a.relief_slope)
        supplies = (pumped, pumped + np.asarray(a.relief_slope) * a.relief_pressure)
        self._balances = tuple(zip(leaks, supplies, strict=True))
        self._restrictor, self._piston_leak = a.restrictor, a.piston_leak
        # The pressure at which all that passes the lock valve leaks past the piston.
        self._blocked = np.asarray(np.inf)
        for leak, supply in self._balances:
            s = _root(leak, a.restrictor * (1 + leak / a.piston_leak), supply)
            self._blocked = np.minimum(self._blocked, a.restrictor * s / a.piston_leak)

    def state(self, load: npt.ArrayLike) -> Hydraulics:
        """Return pressures and flow for a load.

        Parameters
        ----------
        load : array_like of float
            As for `hydraulics`.

        Returns
        -------
        Hydraulics
            As from `hydraulics`.
        """
        wanted = np.asarray(load, float)
        cylinder = np.minimum(wanted, self._blocked)
        drop = np.asarray(np.inf)
        for leak, supply in self._balances:
            rest = np.maximum(supply - leak * cylinder, 0)
            drop = np.minimum(drop, _root(leak, self._restrictor, rest))
        leaving = self._restrictor * drop - self._piston_leak * cylinder
        flow = np.where(wanted < self._blocked, np.maximum(leaving, 0.0), 0.0)
        return Hydraulics(cylinder + drop**2, cylinder, flow)


def velocity(actuator: Actuator, opening: npt.ArrayLike, direction: npt.ArrayLike = 1) -> Floats:
    """Return how fast a valve turns while its motor runs.

    Parameters
    ----------
    actuator, opening, direction
        As for `valve_torque`.

    Returns
    -------
    ndarray of float
        Strokes per second, 0 or more in both directions [1/s].

    Examples
    --------
    >>> round(float(velocity(Actuator(), 0.5)), 4)
    0.1111
    """
    flow = hydraulics(actuator, load_pressure(actuator, opening, direction)).flow
    return np.asarray(flow / np.asarray(actuator.stroke_volume))


def move_time(actuator: Actuator, begin: float, end: float) -> Floats:
    r"""Return how long a valve takes from one opening to another.

    .. math:: t = \int \frac{dx}{v(x)}

    Parameters
    ----------
    actuator : Actuator
        The valve, or many.
    begin, end : float
        Openings, 0..1; it closes if the second is smaller.

    Returns
    -------
    ndarray of float, shape () or (n_valves,)
        Time [s]; inf if the valve stops on its way.

    Raises
    ------
    ArgumentError
        If an opening is out of range.

    Examples
    --------
    >>> round(float(move_time(Actuator(), 0.2, 0.6)), 2)
    3.6
    """
    first, last = check_scalar("begin", begin, "", 0, 1), check_scalar("end", end, "", 0, 1)
    low, high = min(first, last), max(first, last)
    # Two panels: the seat, which lets go within a few hundredths, needs its own nodes.
    edge = min(max(10 * _SEAT, low), high)
    nodes, weights = np.polynomial.legendre.leggauss(_NODES)
    x = np.concatenate(
        [low + (edge - low) * (nodes + 1) / 2, edge + (high - edge) * (nodes + 1) / 2]
    )
    w = np.concatenate([(edge - low) * weights / 2, (high - edge) * weights / 2])
    speeds = np.stack([velocity(actuator, place, 1 if last >= first else -1) for place in x])
    slow = np.full(speeds.shape, np.inf)
    np.divide(1.0, speeds, out=slow, where=speeds > 0)
    # A panel without width takes no time, however slow the valve is there.
    return np.asarray(np.tensordot(w[w > 0], slow[w > 0], axes=1))


def stroke_time(actuator: Actuator, direction: int = 1) -> Floats:
    """Return how long a valve takes from end to end.

    Parameters
    ----------
    actuator : Actuator
        The valve, or many.
    direction : int, default 1
        1 opens, -1 closes.

    Returns
    -------
    ndarray of float, shape () or (n_valves,)
        Time [s]; inf if the valve stops on its way.

    Raises
    ------
    ArgumentError
        If the direction is neither.

    Examples
    --------
    >>> round(float(stroke_time(Actuator())), 2)
    9.0
    """
    if direction not in (-1, 1):
        raise ArgumentError(f"direction is {direction!r}; it must be 1 to open or -1 to close")
    return move_time(actuator, 0.0, 1.0) if direction > 0 else move_time(actuator, 1.0, 0.0)


def _root(a: npt.ArrayLike, b: npt.ArrayLike, c: npt.ArrayLike) -> Floats:
    """Return the positive s of a s^2 + b s = c, without cancellation where a or c is small."""
    return np.asarray(2 * np.asarray(c) / (b + np.sqrt(np.square(b) + 4 * np.multiply(a, c))))
