"""The motor of the pump: its current, what of it becomes heat, how warm it gets."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from shipnet.ballast.actuator import Actuator
from shipnet.ballast.hydraulics import hydraulics, load_pressure

__all__ = ["electric_power", "losses", "motor_current", "steady_temperature"]

Floats = npt.NDArray[np.float64]


def motor_current(actuator: Actuator, pump_pressure: npt.ArrayLike) -> Floats:
    r"""Return the current of the running motor.

    .. math:: I = \sqrt{I_0^2 + \left( \frac{1}{k} \left( \frac{D p}{2 \pi \eta} + T_f
              \right) \right)^2}

    Parameters
    ----------
    actuator : Actuator
        Motor and pump.
    pump_pressure : array_like of float
        Pressure behind the pump [Pa].

    Returns
    -------
    ndarray of float
        Current of each phase [A].

    Notes
    -----
    The current at starting, some five times as high for a tenth of a second, is left out.

    Examples
    --------
    >>> motor_current(Actuator(), [0, 90e5]).round(2).tolist()
    [0.7, 1.2]
    """
    a = actuator
    torque = np.asarray(a.displacement) * pump_pressure / (2 * np.pi * a.pump_efficiency)
    return np.asarray(np.hypot(a.no_load_current, (torque + a.friction) / a.torque_constant))


def electric_power(actuator: Actuator, current: npt.ArrayLike) -> Floats:
    r"""Return what the motor takes from the mains, :math:`\sqrt{3} U I \cos \varphi`.

    Parameters
    ----------
    actuator : Actuator
        Its voltage and power factor.
    current : array_like of float
        Current of each phase [A].

    Returns
    -------
    ndarray of float
        Power [W].

    Examples
    --------
    >>> round(float(electric_power(Actuator(), 1.2)))
    707
    """
    return np.asarray(np.sqrt(3) * actuator.voltage * np.asarray(current) * actuator.power_factor)


def losses(actuator: Actuator, pump_pressure: npt.ArrayLike) -> Floats:
    """Return what becomes heat in motor and pump: all that the oil does not carry away.

    Parameters
    ----------
    actuator : Actuator
        Motor and pump.
    pump_pressure : array_like of float
        Pressure behind the pump [Pa].

    Returns
    -------
    ndarray of float
        Power, 0 or more [W].

    Examples
    --------
    >>> round(float(losses(Actuator(), 90e5)))
    185
    """
    pressure = np.asarray(pump_pressure, float)
    taken = electric_power(actuator, motor_current(actuator, pressure))
    given = np.asarray(actuator.displacement) * actuator.speed * pressure
    return np.asarray(np.maximum(taken - given, 0.0))


def steady_temperature(actuator: Actuator) -> Floats:
    """Return how warm the motor is after many strokes at its duty.

    Parameters
    ----------
    actuator : Actuator
        Motor, pump and duty.

    Returns
    -------
    ndarray of float, shape () or (n_valves,)
        Mean temperature over many cycles of the duty [degC].

    Examples
    --------
    >>> round(float(steady_temperature(Actuator())), 1)
    50.0
    """
    pressure = hydraulics(actuator, load_pressure(actuator, 0.5)).pump_pressure
    return actuator.ambient + actuator.duty * losses(actuator, pressure) / actuator.cooling
