"""One stroke with compressible oil and moving mass, by differential equations.

Verifies `shipnet.ballast.hydraulics`, which neglects both; about a thousand times slower.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.integrate import solve_ivp

from shipnet.ballast.actuator import Actuator, load_pressure

Floats = npt.NDArray[np.float64]

#: Bulk modulus of mineral oil with a little air [Pa], oil on each side of the lock valve [m3], mass
#: of piston, rack and disc at the rack [kg], viscous friction [N s/m]; our assumptions.
BULK_MODULUS, VOLUME, MASS, DAMPING = 1.2e9, 30e-6, 40.0, 2e4

#: Speed of the rack at which dry friction has 76 % of its value [m/s]; smoothed for the solver.
_STICTION = 2e-6

#: Torque of a stuck valve, which no pump here reaches [N m].
_STUCK = 1e5


class Stroke(NamedTuple):
    """A stroke from standstill."""

    time: Floats
    opening: Floats
    pump_pressure: Floats
    cylinder_pressure: Floats
    end: float


def integrate_stroke(actuator: Actuator, times: Floats, *, direction: int = 1) -> Stroke:
    """Integrate one stroke of one valve from end to end by LSODA."""
    a = actuator
    area, stiffness = float(a.piston_area), BULK_MODULUS / VOLUME
    pumped, length = float(a.displacement * a.speed), float(a.pinion_radius) * np.pi / 2
    stuck = _STUCK / (area * float(a.pinion_radius))

    def rates(_: float, state: Floats) -> list[float]:
        pump, cylinder, travel, rack_speed = state
        opening = travel / length if direction > 0 else 1 - travel / length
        through = float(a.restrictor) * np.sign(pump - cylinder) * np.sqrt(abs(pump - cylinder))
        relieved = float(a.relief_slope) * max(pump - float(a.relief_pressure), 0.0)
        load = min(float(load_pressure(a, opening, direction)), stuck)
        force = area * (cylinder - load * np.tanh(rack_speed / _STICTION)) - DAMPING * rack_speed
        return [
            stiffness * (pumped - float(a.pump_leak) * pump - relieved - through),
            stiffness * (through - float(a.piston_leak) * cylinder - area * rack_speed),
            rack_speed,
            force / MASS,
        ]

    def arrived(_: float, state: Floats) -> float:
        return float(state[2] - length)

    arrived.terminal = True  # type: ignore[attr-defined]
    # LSODA starts with pressures of some pascal, so that the root has a finite slope.
    tolerances = {"rtol": 1e-6, "atol": [10, 10, 1e-9, 1e-9]}
    start, span = [2.0, 1.0, 0.0, 0.0], (0.0, times[-1])
    solution = solve_ivp(rates, span, start, "LSODA", times, events=arrived, **tolerances)
    assert solution.success, solution.message
    travelled = solution.y[2] / length
    end = float(solution.t_events[0][0]) if solution.t_events[0].size else float("inf")
    opening = travelled if direction > 0 else 1 - travelled
    return Stroke(solution.t, opening, solution.y[0], solution.y[1], end)
