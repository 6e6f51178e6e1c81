"""Table 1 and section III.1: the engine whose points are monitored.

The paper prints neither bore nor stroke; they and the figures in horsepower are from the maker's
project guide.
"""

from __future__ import annotations

import re
from typing import Literal

from shipnet import datasets
from shipnet.engine.power import DieselEngine
from shipnet.papers.registry import check, numeric

__all__ = ["CYLINDERS", "PRESSURE", "SPEED"]

_TABLE_1 = datasets.read("lee2012_table1_engine.csv").set_index("quantity")

#: Table 1: speed [r/min] and mean effective pressure [bar]; and the cylinders of section III.1.
SPEED = float(_TABLE_1["value_low"]["speed"])
PRESSURE = float(_TABLE_1["value_low"]["mean_effective_pressure"])
CYLINDERS = 8

#: Power of the same engine in the project guide [kW].
_GUIDE = 12640.0

_NAMES: dict[Literal[2, 4], str] = {2: "two-stroke", 4: "four-stroke"}

#: One metric horsepower: 75 kgf m/s by 9.80665 m/s2 [W]. Makers' "BHP" are these.
_METRIC_HORSEPOWER = 75 * 9.80665


def per_kilowatt_hour(per_horsepower_hour: float) -> float:
    """Return a consumption per kilowatt hour from that per metric horsepower hour."""
    return per_horsepower_hour * 1e3 / _METRIC_HORSEPOWER


@numeric("lee2012-005")
def power(*, pressure: float = PRESSURE, rate: float = SPEED, cylinders: int = CYLINDERS) -> float:
    """Kilowatts that follow from Table 1 and the size of the cylinders."""
    return DieselEngine.S50MC_C(cylinders).power(1e5 * pressure, rate / 60) / 1e3


@numeric("lee2012-006")
def rate_from_power(*, power: float = _GUIDE, pressure: float = PRESSURE) -> float:
    """Revolutions a minute at which the engine has its power."""
    return 60 * DieselEngine.S50MC_C(CYLINDERS).speed(1e3 * power, 1e5 * pressure)


@numeric("lee2012-007")
def pressure_from_power(*, power: float = _GUIDE, rate: float = SPEED) -> float:
    """Bar of mean effective pressure at which the engine has its power."""
    main = DieselEngine.S50MC_C(CYLINDERS)
    return main.mean_effective_pressure(1e3 * power, rate / 60) / 1e5


@numeric("lee2012-008")
def fuel_consumption(*, per_horsepower_hour: float = 126.0) -> float:
    """Grams of fuel a kilowatt hour, from those a horsepower hour."""
    return per_kilowatt_hour(per_horsepower_hour)


@numeric("lee2012-010")
def least_cylinder_oil(*, per_horsepower_hour: float = 0.7) -> float:
    """Grams of cylinder oil a kilowatt hour, from those a horsepower hour."""
    return per_kilowatt_hour(per_horsepower_hour)


@numeric("lee2012-070")
def most_cylinder_oil(*, per_horsepower_hour: float = 1.1) -> float:
    """Grams of cylinder oil a kilowatt hour, from those a horsepower hour."""
    return per_kilowatt_hour(per_horsepower_hour)


@numeric("lee2012-011")
def cylinders(*, power_class: float = 13000.0, pressure: float = PRESSURE) -> float:
    """Cylinders that the power class takes."""
    return power_class / power(pressure=pressure, cylinders=1)


@check("lee2012-009", counter={"printed": "kg/cyl.24h"})
def unit_is_known(
    *, printed: str = _TABLE_1["unit_printed"]["lubricating_oil_consumption"]
) -> bool:
    """Whether the unit is made of units and of what an engine has."""
    return set(re.findall("[a-z]+", printed)) <= {"kg", "h", "cyl"}


@check("lee2012-071", counter={"called": "two-stroke"})
def called_after_its_strokes(*, called: str = "two-stage") -> bool:
    """Whether the name is that of the strokes with which the engine reaches its class."""
    powers = {
        strokes: DieselEngine.S50MC_C(CYLINDERS, strokes=strokes).power(1e5 * PRESSURE, SPEED / 60)
        for strokes in _NAMES
    }
    fits = min(powers, key=lambda strokes: abs(powers[strokes] - 13e6))
    return called == _NAMES[fits]
