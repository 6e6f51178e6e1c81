"""Pumps that wear out, as synthetic data: leak, pressure and stroke time from new to worn out.

The law of wear, its rates and the noise are assumptions: what is found here is an upper bound of
what can be found on a ship, where oil warms up and loads change.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import numpy.typing as npt

from shipnet.ballast.actuator import Actuator
from shipnet.ballast.hydraulics import hydraulics, load_pressure, stroke_time
from shipnet.fields import check_scalar, check_whole

__all__ = ["LIMIT", "Wear", "leak_from_pressure", "limit_leak", "mid_pressure", "synthetic_wear"]

Floats = npt.NDArray[np.float64]

#: A stroke may take so long [s]: row 0 of the rule table.
LIMIT = 10.0

#: Leaks that a stroke time is computed for; between them it is interpolated, to 1e-6 s.
_GRID = 2001


@dataclass(frozen=True, eq=False)
class Wear:
    """Valves whose pumps wear out, one row a stroke.

    Parameters
    ----------
    rate : ndarray of float, shape (n_valves,)
        By how much the logarithm of the leak grows with a stroke.
    leak : ndarray of float, shape (n_strokes, n_valves)
        True leak [m3/(s Pa)].
    FP : ndarray of float, shape (n_strokes, n_valves)
        Median of the pump pressure in each stroke, as read [bar].
    stroke_time : ndarray of float, shape (n_strokes, n_valves)
        As read [s].
    life : ndarray of float, shape (n_valves,)
        True number of strokes until one takes 10 s.
    """

    rate: Floats
    leak: Floats
    FP: Floats
    stroke_time: Floats
    life: Floats


@cache
def limit_leak(limit: float = LIMIT) -> float:
    """Return the leak of the pump at which a stroke takes as long as it may.

    Parameters
    ----------
    limit : float, default 10
        Stroke time, 9.1..1000 [s].

    Returns
    -------
    float
        Leak [m3/(s Pa)] of the usual actuator.

    Raises
    ------
    ArgumentError
        If the limit is out of range.

    Examples
    --------
    Three times the leak of a new pump; the pressure has hardly fallen by then:

    >>> leak = limit_leak()
    >>> round(leak / Actuator().pump_leak, 2)
    3.32
    >>> float(mid_pressure(leak).round(1))
    73.4
    """
    from scipy.optimize import brentq

    time = check_scalar("limit", limit, "s", 9.1, 1000)
    usual = Actuator()

    def late(log_factor: float) -> float:
        worn = replace(usual, pump_leak=usual.pump_leak * np.exp(log_factor))
        # A valve that stops is later than any limit.
        return min(float(stroke_time(worn)), 1e6) - time

    return float(usual.pump_leak * np.exp(brentq(late, 0.0, 10.0, xtol=1e-10)))


def leak_from_pressure(pressure: npt.ArrayLike, actuator: Actuator | None = None) -> Floats:
    r"""Return the leak of a pump from its pressure in the middle of a stroke.

    .. math:: K = \frac{D n - C \sqrt{p - p_L}}{p}

    Parameters
    ----------
    pressure : array_like of float
        Pump pressure, above the load's [bar]; NaN gives NaN.
    actuator : Actuator, optional
        The valve; `Actuator` with its defaults if omitted. Its own leak does not matter.

    Returns
    -------
    ndarray of float
        Leak [m3/(s Pa)]; NaN where the load's pressure is not reached or the relief valve is open.

    Notes
    -----
    `hydraulics` solved for the leak; 0 or less says that the pressure is higher than that of a
    pump without any leak.

    Examples
    --------
    >>> pressure = mid_pressure(1e-12)
    >>> float(leak_from_pressure(pressure).round(18)), float(pressure.round(1))
    (1e-12, 76.4)
    """
    a = actuator if actuator is not None else Actuator()
    p = 1e5 * np.asarray(pressure, float)
    load = load_pressure(a, 0.5)
    legal = (p > load) & (p <= a.relief_pressure)
    known = np.where(legal, p, np.nan)
    pumped = np.asarray(a.displacement) * a.speed
    return np.asarray((pumped - a.restrictor * np.sqrt(known - load)) / known)


def synthetic_wear(
    n_valves: int = 256,
    n_strokes: int = 1000,
    *,
    rate: float = 2.6e-3,
    spread: float = 0.3,
    noise: tuple[float, float] = (0.1, 0.05),
    rng: np.random.Generator,
) -> Wear:
    r"""Return synthetic data of pumps whose leak grows by the same part with every stroke.

    .. math:: K_i = K_0 e^{r i}

    Parameters
    ----------
    n_valves : int, default 256
        How many, 1..10000.
    n_strokes : int, default 1000
        Strokes of each, 1..1e6.
    rate : float, default 2.6e-3
        Median of the rates r, 1e-6..1 a stroke: a life of 462 strokes.
    spread : float, default 0.3
        Standard deviation of their logarithm, 0..2.
    noise : tuple of float, default (0.1, 0.05)
        Standard deviations of what is read of FP [bar] and of the stroke time [s].
    rng : numpy.random.Generator
        Draws rates and noise.

    Returns
    -------
    Wear
        Rates, leaks, readings and lives.

    Raises
    ------
    ArgumentError
        If an argument is out of its range.

    Examples
    --------
    >>> wear = synthetic_wear(3, 400, rng=np.random.default_rng(2024))
    >>> wear.life.round().tolist(), wear.FP[[0, -1], 0].round(1).tolist()
    ([339.0, 282.0, 327.0], [90.0, 69.4])
    """
    n = check_whole("n_valves", n_valves, 1, 10_000)
    strokes = check_whole("n_strokes", n_strokes, 1, 10**6)
    median = check_scalar("rate", rate, "", 1e-6, 1)
    sigma = check_scalar("spread", spread, "", 0, 2)
    sigmas = [check_scalar("noise", value, "", 0, 1e3) for value in noise]
    usual = Actuator()
    rates = median * np.exp(sigma * rng.standard_normal(n))
    exponent = rates * np.arange(strokes)[:, np.newaxis]
    # Beyond this no oil reaches the cylinder.
    leak = usual.pump_leak * np.exp(np.minimum(exponent, 12.0))
    pressure = mid_pressure(leak)
    grid = np.linspace(0.0, float(exponent.max(initial=0.0)) + 1e-9, _GRID)
    curve = replace(usual, pump_leak=usual.pump_leak * np.exp(np.minimum(grid, 12.0)))
    times = np.interp(exponent, grid, np.minimum(stroke_time(curve), 1e6))
    life = np.log(limit_leak() / usual.pump_leak) / rates
    return Wear(
        rates,
        leak,
        pressure + sigmas[0] * rng.standard_normal(leak.shape),
        times + sigmas[1] * rng.standard_normal(leak.shape),
        life,
    )


def mid_pressure(leak: npt.ArrayLike) -> Floats:
    """Return the pump pressure of the usual valve, half open, for leaks of any shape.

    Parameters
    ----------
    leak : array_like of float
        Leak of the pump [m3/(s Pa)].

    Returns
    -------
    ndarray of float, the shape of `leak`
        Pressure [bar].

    Examples
    --------
    >>> mid_pressure([[Actuator().pump_leak, limit_leak()]]).round(1).tolist()
    [[90.1, 73.4]]
    """
    leaks = np.asarray(leak, float)
    worn = replace(Actuator(), pump_leak=leaks.reshape(-1))
    state = hydraulics(worn, load_pressure(worn, 0.5))
    return np.asarray(state.pump_pressure / 1e5).reshape(leaks.shape)
