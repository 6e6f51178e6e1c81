"""An electro-hydraulic actuator: parameters, hydraulics in closed form, and motor.

The paper prints none of the parameters. Ours describe an actuator of a common size for a butterfly
valve of DN 100 to 150, and put the operating point near row 0 of the rule table; each value is an
assumption unless a source is given.
"""

from __future__ import annotations

from dataclasses import fields
from math import inf, pi, sqrt
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from shipnet.arrays import Floats
from shipnet.errors import ArgumentError
from shipnet.fields import Quantity, check_fields, number, record


def _number(low: float, high: float, unit: str, help: str, default: float) -> Any:
    """Declare a number that may be an array, with one value per valve."""
    return number(low, high, unit, help, default=default, many=True)


@record(slots=True)
class Actuator:
    """Reversible motor and pump, lock valve, cylinder with rack and pinion, butterfly valve.

    Each parameter is one number for all valves, or an array with one value per valve.

    Examples
    --------
    >>> from dataclasses import replace
    >>> worn = replace(Actuator(), pump_leak=[3.6e-13, 3.6e-12])
    >>> worn.n_valves
    2
    """

    displacement: Quantity = _number(1e-9, 1e-3, "m3/rev", "Oil per revolution of the pump", 2.4e-6)
    speed: Quantity = _number(
        0.1, 500, "1/s", "Motor speed, the same at any load: four poles at 50 Hz", 1450 / 60
    )
    pump_leak: Quantity = _number(
        1e-18,
        1e-6,
        "m3/(s Pa)",
        "Laminar leak of the pump: 94.5 % efficiency at 90 bar",
        3.2e-6 / 90e5,
    )
    relief_pressure: Quantity = _number(
        1e5, 1e8, "Pa", "Pressure at which the relief valve begins to open", 125e5
    )
    relief_slope: Quantity = _number(
        1e-14, 1e-6, "m3/(s Pa)", "Flow through the relief valve per unit of excess pressure", 2e-10
    )
    restrictor: Quantity = _number(
        1e-15,
        1e-3,
        "m3/(s sqrt(Pa))",
        "Flow through the lock valve per square root of its pressure drop",
        54.8e-6 / sqrt(88e5),
    )
    piston_area: Quantity = _number(1e-5, 1.0, "m2", "Piston area (100 mm diameter)", 7.85e-3)
    pinion_radius: Quantity = _number(1e-3, 1.0, "m", "Radius of the pinion", 0.04)
    piston_leak: Quantity = _number(1e-18, 1e-6, "m3/(s Pa)", "Laminar leak past the piston", 1e-13)
    trapped: Quantity = _number(
        0, 1, "", "Fraction of the load pressure that the lock valve holds at rest", 0.0
    )
    bearing_torque: Quantity = _number(
        1e-3, inf, "N m", "Friction torque of bearings and packing; inf for a stuck valve", 55.0
    )
    seating_torque: Quantity = _number(
        0, 1e6, "N m", "Friction torque of the seat when the valve is closed", 15.0
    )
    dynamic_torque: Quantity = _number(
        0, 1e6, "N m", "Torque of the flow, in the closing direction", 20.0
    )
    magnetising_current: Quantity = _number(
        0, 1e3, "A", "Reactive current of the motor, the same at any load", 0.56
    )
    torque_constant: Quantity = _number(1e-3, 1e4, "N m/A", "Shaft torque per active current", 4.15)
    pump_efficiency: Quantity = _number(0.05, 1, "", "Mechanical efficiency of the pump", 0.85)
    friction: Quantity = _number(0, 1e4, "N m", "Additional torque that the pump needs", 0.0)
    voltage: Quantity = _number(1, 1e4, "V", "Line voltage, three phases", 400.0)
    no_load_loss: Quantity = _number(
        0, 1e5, "W", "Motor losses that do not depend on the load: iron, bearings, fan", 60.0
    )
    heat_capacity: Quantity = _number(1, 1e7, "J/K", "Heat capacity of the motor", 4000.0)
    cooling: Quantity = _number(
        1e-3, 1e4, "W/K", "Heat flow from the motor per kelvin above its surroundings", 6.4
    )
    ambient: Quantity = _number(
        -40, 100, "degC", "Ambient temperature of the motor; IACS UR M40, machinery spaces", 45.0
    )
    duty: Quantity = _number(
        0, 1, "", "Duty cycle of the motor before time 0: type S3 15 % of IEC 60034-1", 0.15
    )
    motor_time: Quantity = _number(
        0.1, 3600, "s", "Running time after which the controller stops a motor", 20.0
    )

    def __post_init__(self) -> None:
        check_fields(self)
        lengths = {len(value) for value in self._arrays()}
        if len(lengths) > 1:
            raise ArgumentError(
                f"actuator has numbers for {' and for '.join(map(str, sorted(lengths)))} valves; "
                "all arrays must have the same length"
            )
        most = np.sqrt(3) * np.asarray(self.voltage) / (2 * pi * np.asarray(self.speed))
        if np.any(self.torque_constant > most):
            raise ArgumentError(
                f"torque_constant is {np.max(self.torque_constant):g} N m/A; it must be at most "
                f"{np.min(most):.3g} N m/A at this voltage and speed, or the shaft would "
                "deliver more power than the motor draws"
            )

    @property
    def n_valves(self) -> int | None:
        """Number of valves that the arrays describe; None if there are no arrays."""
        return next((len(value) for value in self._arrays()), None)

    @property
    def stroke_volume(self) -> Quantity:
        """Oil volume for a quarter turn [m3]."""
        return self.piston_area * self.pinion_radius * (pi / 2)

    def _arrays(self) -> list[Floats]:
        values = (getattr(self, field.name) for field in fields(self))
        return [value for value in values if isinstance(value, np.ndarray)]


#: Opening over which the seating torque decays, as a fraction of the quarter turn; our assumption.
_SEAT = 0.03

#: Quadrature nodes per panel; with 48, the error due to the seat's exponential is 1e-9.
_NODES = 48


class Hydraulics(NamedTuple):
    """State of the oil: pressures [Pa] and flow [m3/s]."""

    pump_pressure: Floats
    cylinder_pressure: Floats
    flow: Floats


def load_pressure(
    actuator: Actuator, opening: npt.ArrayLike, direction: npt.ArrayLike = 1
) -> Floats:
    """Return the cylinder pressure [Pa] needed to move a valve at an opening of 0..1."""
    # Bearing, seating and dynamic torque as in AWWA M49, with an assumed shape: the torque of the
    # flow is highest, 0.54 of `dynamic_torque`, at an opening of 58 %.
    x = np.minimum(np.maximum(np.asarray(opening, float), 0), 1)
    flow = np.asarray(direction) * actuator.dynamic_torque * x * np.sin(np.pi * x) ** 2
    friction = actuator.bearing_torque + actuator.seating_torque * np.exp(-x / _SEAT)
    torque = np.maximum(friction + flow, 0.0)
    return np.asarray(torque / (actuator.piston_area * actuator.pinion_radius))


def hydraulics(actuator: Actuator, load: npt.ArrayLike) -> Hydraulics:
    """Return pressures and flow for a load pressure [Pa]."""
    return Oil(actuator).state(load)


class Oil:
    """The hydraulics of an actuator; values that do not depend on the load are computed once."""

    # The oil is assumed to be stiff, so pressures follow the load at once. The pump delivers
    # D n - K p with the relief valve closed, and D n - (K + K_r) p + K_r p_r with it open; the
    # smaller of the two flows is always the correct one. A flow q through the restrictor causes a
    # pressure drop s^2 = (q/C)^2, so each balance is a quadratic equation in s: K s^2 + b s = c.
    def __init__(self, actuator: Actuator) -> None:
        a = actuator
        pumped = np.asarray(a.displacement) * a.speed
        leaks = (np.asarray(a.pump_leak), np.asarray(a.pump_leak) + a.relief_slope)
        supplies = (pumped, pumped + np.asarray(a.relief_slope) * a.relief_pressure)
        self._balances = tuple(zip(leaks, supplies, strict=True))
        self._restrictor, self._piston_leak = a.restrictor, a.piston_leak
        # At this pressure, all the flow through the lock valve leaks past the piston.
        self._blocked = np.asarray(np.inf)
        for leak, supply in self._balances:
            s = _root(leak, a.restrictor * (1 + leak / a.piston_leak), supply)
            self._blocked = np.minimum(self._blocked, a.restrictor * s / a.piston_leak)

    def state(self, load: npt.ArrayLike) -> Hydraulics:
        """Return pressures and flow for a load pressure [Pa]."""
        demand = np.asarray(load, float)
        cylinder = np.minimum(demand, self._blocked)
        drop = np.asarray(np.inf)
        for leak, supply in self._balances:
            left = np.maximum(supply - leak * cylinder, 0)
            drop = np.minimum(drop, _root(leak, self._restrictor, left))
        leaving = self._restrictor * drop - self._piston_leak * cylinder
        flow = np.where(demand < self._blocked, np.maximum(leaving, 0.0), 0.0)
        return Hydraulics(cylinder + drop**2, cylinder, flow)


def velocity(actuator: Actuator, opening: npt.ArrayLike, direction: npt.ArrayLike = 1) -> Floats:
    """Return the speed of a valve while its motor runs, in quarter turns per second."""
    flow = hydraulics(actuator, load_pressure(actuator, opening, direction)).flow
    return np.asarray(flow / np.asarray(actuator.stroke_volume))


def stroke_time(actuator: Actuator, direction: int = 1) -> Floats:
    """Return the end-to-end stroke time of a valve that opens (1) or closes (-1) [s]."""
    # Two panels: the seating torque decays within hundredths of the stroke and needs its own nodes.
    edge = 10 * _SEAT
    nodes, weights = np.polynomial.legendre.leggauss(_NODES)
    x = np.concatenate([edge * (nodes + 1) / 2, edge + (1 - edge) * (nodes + 1) / 2])
    w = np.concatenate([edge * weights / 2, (1 - edge) * weights / 2])
    speeds = np.stack([velocity(actuator, position, direction) for position in x])
    with np.errstate(divide="ignore"):
        return np.asarray(np.tensordot(w, 1 / speeds, axes=1))


def _root(a: npt.ArrayLike, b: npt.ArrayLike, c: npt.ArrayLike) -> Floats:
    """Return the root s >= 0 of a s^2 + b s = c, accurate even where a or c is small."""
    return np.asarray(2 * np.asarray(c) / (b + np.sqrt(np.square(b) + 4 * np.multiply(a, c))))


def _active_current(actuator: Actuator, pump_pressure: npt.ArrayLike) -> Floats:
    """Return the component of the motor's current that is in phase with its voltage [A]."""
    a = actuator
    torque = np.asarray(a.displacement) * pump_pressure / (2 * np.pi * a.pump_efficiency)
    no_load = np.asarray(a.no_load_loss) / (np.sqrt(3) * a.voltage)
    return np.asarray((torque + a.friction) / a.torque_constant + no_load)


def motor_current(actuator: Actuator, pump_pressure: npt.ArrayLike) -> Floats:
    """Return the running motor's current [A]: magnetising and active components in quadrature."""
    active = _active_current(actuator, pump_pressure)
    return np.asarray(np.hypot(actuator.magnetising_current, active))


def losses(actuator: Actuator, pump_pressure: npt.ArrayLike) -> Floats:
    """Return the heat generated in motor and pump [W]: the power not transferred to the oil."""
    pressure = np.asarray(pump_pressure, float)
    electric = np.sqrt(3) * actuator.voltage * _active_current(actuator, pressure)
    return np.asarray(electric - np.asarray(actuator.displacement) * actuator.speed * pressure)


def steady_temperature(actuator: Actuator) -> Floats:
    """Return the steady-state temperature of the motor at its duty cycle [degC]."""
    pressure = hydraulics(actuator, load_pressure(actuator, 0.5)).pump_pressure
    return actuator.ambient + actuator.duty * losses(actuator, pressure) / actuator.cooling
