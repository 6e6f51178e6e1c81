r"""The power of an engine from its size, and consumption per horsepower and per kilowatt hour.

.. math:: P = z \, \frac{\pi}{4} d^2 s \, p_{me} \, \frac{n}{60} \, \frac{2}{k}

with :math:`k` strokes a cycle.
"""

from __future__ import annotations

from math import pi

from shipnet.errors import ArgumentError
from shipnet.fields import check_scalar, check_whole

__all__ = [
    "METRIC_HORSEPOWER",
    "S50MC_C",
    "engine_power",
    "mean_effective_pressure",
    "per_kilowatt_hour",
    "speed",
    "swept_volume",
]

#: One metric horsepower: 75 kgf m/s by 9.80665 m/s2 [W]. Makers' "BHP" are these.
METRIC_HORSEPOWER = 75 * 9.80665

#: Bore and stroke [m] of the engine of lee2012, which prints neither; MAN B&W, S50MC-C project
#: guide, Fig. 1.02.
S50MC_C = (0.5, 2.0)


def swept_volume(bore: float, stroke: float) -> float:
    """Return the swept volume of a cylinder.

    Parameters
    ----------
    bore : float
        Diameter, 0.01..2 [m].
    stroke : float
        0.01..5 [m].

    Returns
    -------
    float
        Volume [m3].

    Raises
    ------
    ArgumentError
        If a length is out of range.

    Examples
    --------
    >>> round(swept_volume(0.5, 2.0), 4)
    0.3927
    """
    d = check_scalar("bore", bore, "m", 0.01, 2)
    return pi / 4 * d**2 * check_scalar("stroke", stroke, "m", 0.01, 5)


def engine_power(
    bore: float, stroke: float, pressure: float, rate: float, cylinders: int, *, strokes: int = 2
) -> float:
    """Return the power of an engine.

    Parameters
    ----------
    bore, stroke : float
        As for `swept_volume` [m].
    pressure : float
        Mean effective pressure, 0..1e7 [Pa].
    rate : float
        Speed, 0..100 revolutions a second [1/s].
    cylinders : int
        1..24.
    strokes : int, default 2
        Strokes a cycle, 2 or 4.

    Returns
    -------
    float
        Power [W].

    Raises
    ------
    ArgumentError
        If an argument is out of range.

    Examples
    --------
    The S50MC-C of lee2012, Table 1: 19 bar, 127 r/min, 8 cylinders. The project guide has 12640 kW.

    >>> round(engine_power(*S50MC_C, 19e5, 127 / 60, 8) / 1e3)
    12634
    >>> round(engine_power(*S50MC_C, 19e5, 127 / 60, 8, strokes=4) / 1e3)
    6317
    """
    p = check_scalar("pressure", pressure, "Pa", 0, 1e7)
    n = check_scalar("rate", rate, "1/s", 0, 100)
    return p * n * _per_pressure_and_turn(bore, stroke, cylinders, strokes)


def mean_effective_pressure(
    power: float, bore: float, stroke: float, rate: float, cylinders: int, *, strokes: int = 2
) -> float:
    """Return the mean effective pressure at which an engine has a power.

    Parameters
    ----------
    power : float
        Power, 0..1e9 [W].
    bore, stroke : float
        As for `swept_volume` [m].
    rate : float
        Speed, 0.001..100 [1/s].
    cylinders : int
        1..24.
    strokes : int, default 2
        Strokes a cycle, 2 or 4.

    Returns
    -------
    float
        Pressure [Pa].

    Raises
    ------
    ArgumentError
        If an argument is out of range.

    Examples
    --------
    >>> round(mean_effective_pressure(12_640e3, *S50MC_C, 127 / 60, 8) / 1e5, 2)
    19.01
    """
    p = check_scalar("power", power, "W", 0, 1e9)
    n = check_scalar("rate", rate, "1/s", 1e-3, 100)
    return p / n / _per_pressure_and_turn(bore, stroke, cylinders, strokes)


def speed(
    power: float, bore: float, stroke: float, pressure: float, cylinders: int, *, strokes: int = 2
) -> float:
    """Return the speed at which an engine has a power.

    Parameters
    ----------
    power : float
        Power, 0..1e9 [W].
    bore, stroke : float
        As for `swept_volume` [m].
    pressure : float
        Mean effective pressure, 1..1e7 [Pa].
    cylinders : int
        1..24.
    strokes : int, default 2
        Strokes a cycle, 2 or 4.

    Returns
    -------
    float
        Revolutions a second [1/s].

    Raises
    ------
    ArgumentError
        If an argument is out of range.

    Examples
    --------
    >>> round(speed(12_640e3, *S50MC_C, 19e5, 8) * 60, 2)
    127.06
    """
    total = check_scalar("power", power, "W", 0, 1e9)
    p = check_scalar("pressure", pressure, "Pa", 1, 1e7)
    return total / p / _per_pressure_and_turn(bore, stroke, cylinders, strokes)


def per_kilowatt_hour(per_horsepower_hour: float) -> float:
    """Return a consumption per kilowatt hour from that per metric horsepower hour.

    Parameters
    ----------
    per_horsepower_hour : float
        Consumption, 0..1e6, such as [g/BHPh].

    Returns
    -------
    float
        The same per kilowatt hour, such as [g/kWh].

    Raises
    ------
    ArgumentError
        If it is out of range.

    Notes
    -----
    The lower cylinder oil consumption of lee2012, Table 1, 0.7 g/kWh, is 0.7 g/BHPh in the project
    guide, where the upper one is 1.1 g/BHPh, printed as 1.5 g/kWh.

    Examples
    --------
    >>> [round(per_kilowatt_hour(g), 2) for g in (126, 0.7, 1.1)]
    [171.31, 0.95, 1.5]
    """
    given = check_scalar("per_horsepower_hour", per_horsepower_hour, "", 0, 1e6)
    return given * 1e3 / METRIC_HORSEPOWER


def _per_pressure_and_turn(bore: float, stroke: float, cylinders: int, strokes: int) -> float:
    """Return power by pressure and speed [m3]."""
    z = check_whole("cylinders", cylinders, 1, 24)
    if strokes not in (2, 4):
        raise ArgumentError(f"strokes is {strokes!r}; it must be 2 or 4")
    return z * swept_volume(bore, stroke) * 2 / strokes
