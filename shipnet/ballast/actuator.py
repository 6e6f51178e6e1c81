"""An electro-hydraulic actuator as one set of numbers: pump, cylinder, valve, motor.

The paper prints none of these numbers. They describe an actuator of common size for a butterfly
valve of DN 100 to 150, chosen so that the operating point comes out near row 0 of the rule table;
each one is an assumption unless a source stands beside it.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from math import pi, sqrt

import numpy as np
import numpy.typing as npt

from shipnet.errors import ArgumentError
from shipnet.fields import Quantity, check_quantity

__all__ = ["Actuator"]

#: Unit and legal range of each number.
_LEGAL: dict[str, tuple[str, float, float]] = {
    "displacement": ("m3/rev", 1e-9, 1e-3),
    "speed": ("1/s", 0.1, 500),
    "pump_leak": ("m3/(s Pa)", 1e-18, 1e-6),
    "relief_pressure": ("Pa", 1e5, 1e8),
    "relief_slope": ("m3/(s Pa)", 1e-14, 1e-6),
    "restrictor": ("m3/(s sqrt(Pa))", 1e-15, 1e-3),
    "piston_area": ("m2", 1e-5, 1.0),
    "pinion_radius": ("m", 1e-3, 1.0),
    "piston_leak": ("m3/(s Pa)", 1e-18, 1e-6),
    "trapped": ("1", 0, 1),
    "bearing_torque": ("N m", 1e-3, float("inf")),
    "seating_torque": ("N m", 0, 1e6),
    "dynamic_torque": ("N m", 0, 1e6),
    "no_load_current": ("A", 0, 1e3),
    "torque_constant": ("N m/A", 1e-3, 1e4),
    "pump_efficiency": ("1", 0.05, 1),
    "friction": ("N m", 0, 1e4),
    "voltage": ("V", 1, 1e4),
    "power_factor": ("1", 0.05, 1),
    "heat_capacity": ("J/K", 1, 1e7),
    "cooling": ("W/K", 1e-3, 1e4),
    "ambient": ("degC", -40, 100),
    "duty": ("1", 0, 1),
    "motor_time": ("s", 0.1, 3600),
}


@dataclass(frozen=True, slots=True)
class Actuator:
    """Reversible motor and pump, lock valve, cylinder with rack and pinion, butterfly valve.

    Every number is one for all valves, or an array of one for each. `dataclasses.replace` makes
    another actuator of this one.

    Parameters
    ----------
    displacement : float or array, default 2.4e-6
        Oil per revolution of the pump [m3/rev].
    speed : float or array, default 1450/60
        Speed of the motor at any load [1/s]: an induction motor with four poles at 50 Hz.
    pump_leak : float or array, default 3.2e-6/90e5
        Laminar leak of the pump [m3/(s Pa)]: 94.5 % volumetric efficiency at 90 bar.
    relief_pressure : float or array, default 125e5
        Pressure at which the relief valve begins to open [Pa].
    relief_slope : float or array, default 2e-10
        What it passes above that [m3/(s Pa)].
    restrictor : float or array, default 54.8e-6/sqrt(88e5)
        Flow through the lock valve over the root of its pressure drop [m3/(s sqrt(Pa))].
    piston_area : float or array, default 7.85e-3
        Area of the piston [m2], 100 mm across.
    pinion_radius : float or array, default 0.04
        Radius of the pinion [m].
    piston_leak : float or array, default 1e-13
        Laminar leak past the piston [m3/(s Pa)].
    trapped : float or array, default 0
        Part of the load's pressure that the lock valve keeps at rest, 0..1.
    bearing_torque : float or array, default 55
        Friction of bearings and packing [N m]; inf is a valve that is stuck.
    seating_torque : float or array, default 15
        Friction of the seat, in the closed valve [N m].
    dynamic_torque : float or array, default 20
        Torque of the flow, which closes the valve [N m].
    no_load_current : float or array, default 0.7
        Magnetising current of the motor [A].
    torque_constant : float or array, default 4.15
        Shaft torque over active current [N m/A].
    pump_efficiency : float or array, default 0.85
        Mechanical efficiency of the pump.
    friction : float or array, default 0
        Torque that the pump needs beside that [N m].
    voltage : float or array, default 400
        Line voltage [V], three phases.
    power_factor : float or array, default 0.85
        Power factor of the motor.
    heat_capacity : float or array, default 4000
        Heat capacity of the motor [J/K].
    cooling : float or array, default 5.5
        What it gives off over its surroundings [W/K].
    ambient : float or array, default 45
        Temperature around it [degC]: IACS UR M40, machinery spaces.
    duty : float or array, default 0.15
        Part of the time that it has been running before: cyclic duration factor of duty type S3
        15 % in IEC 60034-1.
    motor_time : float or array, default 20
        The controller stops a motor that has been running for so long [s].

    Raises
    ------
    ArgumentError
        If a number is out of its range, or if arrays differ in length.

    Examples
    --------
    >>> from dataclasses import replace
    >>> worn = replace(Actuator(), pump_leak=[3.6e-13, 3.6e-12])
    >>> worn.n_valves
    2
    """

    displacement: Quantity = 2.4e-6
    speed: Quantity = 1450 / 60
    pump_leak: Quantity = 3.2e-6 / 90e5
    relief_pressure: Quantity = 125e5
    relief_slope: Quantity = 2e-10
    restrictor: Quantity = 54.8e-6 / sqrt(88e5)
    piston_area: Quantity = 7.85e-3
    pinion_radius: Quantity = 0.04
    piston_leak: Quantity = 1e-13
    trapped: Quantity = 0.0
    bearing_torque: Quantity = 55.0
    seating_torque: Quantity = 15.0
    dynamic_torque: Quantity = 20.0
    no_load_current: Quantity = 0.7
    torque_constant: Quantity = 4.15
    pump_efficiency: Quantity = 0.85
    friction: Quantity = 0.0
    voltage: Quantity = 400.0
    power_factor: Quantity = 0.85
    heat_capacity: Quantity = 4000.0
    cooling: Quantity = 5.5
    ambient: Quantity = 45.0
    duty: Quantity = 0.15
    motor_time: Quantity = 20.0

    def __post_init__(self) -> None:
        """Check every number."""
        for field in fields(self):
            unit, low, high = _LEGAL[field.name]
            value = check_quantity(field.name, getattr(self, field.name), unit, low=low, high=high)
            object.__setattr__(self, field.name, value)
        lengths = {len(value) for value in self._arrays()}
        if len(lengths) > 1:
            raise ArgumentError(
                f"actuator has numbers for {' and for '.join(map(str, sorted(lengths)))} valves"
            )

    @property
    def n_valves(self) -> int | None:
        """For how many valves there are numbers; None if they hold for any."""
        return next((len(value) for value in self._arrays()), None)

    @property
    def stroke_volume(self) -> Quantity:
        """Oil that a quarter turn takes [m3]."""
        return self.piston_area * self.pinion_radius * (pi / 2)

    def _arrays(self) -> list[npt.NDArray[np.float64]]:
        values = (getattr(self, field.name) for field in fields(self))
        return [value for value in values if isinstance(value, np.ndarray)]
