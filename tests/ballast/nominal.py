"""A healthy valve: the paper's values, and those computed from an actuator's parameters."""

from typing import NamedTuple

import numpy as np

from shipnet import datasets
from shipnet.ballast.actuator import (
    hydraulics,
    load_pressure,
    motor_current,
    steady_temperature,
    stroke_time,
)
from shipnet.ballast.sensors import Sensors

#: Sensors without noise, limits or steps.
IDEAL = Sensors((-np.inf,) * 5, (np.inf,) * 5, (0.0,) * 5, None)


def normal_values():
    """Return the readings printed in row 0 of the rule table."""
    row = datasets.read("kim2014_rule_table.csv").iloc[0]
    return {name: float(row[f"{name.lower()}_printed"]) for name in ("FP", "OP", "MC", "OT")}


class OperatingPoint(NamedTuple):
    """A running valve, half open; every attribute has the shape () or (n_valves,)."""

    FP: np.ndarray
    OP: np.ndarray
    MC: np.ndarray
    OT: np.ndarray
    stroke_time: np.ndarray


def operating_point(actuator, direction=1):
    """Return the operating point in closed form.

    The paper prints FP 90, OP 2, MC 1.2, OT 50 and 0 to 10 s for a healthy valve (claims
    kim2014-026 and -072). Ours are close, because we chose the actuator to match. Agreement of all
    shows that the paper's values are consistent with one machine, not that it was this one.
    """
    state = hydraulics(actuator, load_pressure(actuator, 0.5, direction))
    return OperatingPoint(
        state.pump_pressure / 1e5,
        state.cylinder_pressure / 1e5,
        motor_current(actuator, state.pump_pressure),
        steady_temperature(actuator),
        stroke_time(actuator, direction),
    )
