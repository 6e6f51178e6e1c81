r"""Platinum resistance thermometers Pt100 after IEC 60751, and the leads they hang on.

.. math:: R = R_0 \left( 1 + A t + B t^2 \right), \qquad t \ge 0

.. math:: R = R_0 \left( 1 + A t + B t^2 + C (t - 100) t^3 \right), \qquad t < 0
"""

from __future__ import annotations

from typing import Literal

import numpy as np
import numpy.typing as npt

from shipnet.errors import ArgumentError

__all__ = ["RANGE", "measured_resistance", "pt100_resistance", "pt100_temperature"]

#: Resistance at 0 degC [ohm] and the coefficients of Callendar and Van Dusen [1/degC, 1/degC2,
#: 1/degC4]; IEC 60751:2008, section 4.2. The standard prints 138.51 ohm at 100 degC.
_R0 = 100.0
_A, _B, _C = 3.9083e-3, -5.775e-7, -4.183e-12

#: Range of the standard [degC].
RANGE = (-200.0, 850.0)

_Floats = npt.NDArray[np.float64]


def pt100_resistance(temperature: npt.ArrayLike) -> float | _Floats:
    """Return the resistance of a Pt100.

    Parameters
    ----------
    temperature : float or array_like of float
        Temperature, -200..850 [degC].

    Returns
    -------
    float or ndarray of float
        Resistance [ohm].

    Raises
    ------
    ArgumentError
        If a temperature is out of range or NaN.

    References
    ----------
    .. [1] IEC 60751:2008, "Industrial platinum resistance thermometers and platinum temperature
       sensors", section 4.2 and table 1.

    Examples
    --------
    Table 1 of [1]_ prints 18.52, 100.00, 138.51 and 390.48 ohm:

    >>> pt100_resistance([-200, 0, 100, 850]).round(2).tolist()
    [18.52, 100.0, 138.51, 390.48]
    """
    t = _within("temperature", temperature, *RANGE, "degC")
    cold = np.minimum(t, 0)
    r = _R0 * (1 + _A * t + _B * t**2 + _C * (cold - 100) * cold**3)
    return r if r.ndim else float(r)


def pt100_temperature(resistance: npt.ArrayLike) -> float | _Floats:
    r"""Return the temperature of a Pt100: in closed form from 0 degC on, below it by Newton's rule.

    .. math:: t = \frac{-A + \sqrt{A^2 - 4 B \left( 1 - R / R_0 \right)}}{2 B}, \qquad R \ge R_0

    Parameters
    ----------
    resistance : float or array_like of float
        Resistance, 18.5..390.5 [ohm]; the ends are those of -200..850 degC.

    Returns
    -------
    float or ndarray of float
        Temperature [degC].

    Raises
    ------
    ArgumentError
        If a resistance is out of range or NaN.

    Examples
    --------
    >>> round(pt100_temperature(138.5055), 6), round(pt100_temperature(80.306282), 6)
    (100.0, -50.0)
    """
    low, high = (float(pt100_resistance(end)) for end in RANGE)
    r = _within("resistance", resistance, low, high, "ohm")
    t = (-_A + np.sqrt(_A**2 - 4 * _B * (1 - r / _R0))) / (2 * _B)
    # The formula is 2.5 K off at -200 degC; each step squares the error.
    cold = np.minimum(t, 0)
    for _ in range(4):
        error = 1 + _A * cold + _B * cold**2 + _C * (cold - 100) * cold**3
        error -= np.minimum(r, _R0) / _R0
        cold = cold - error / (_A + 2 * _B * cold + _C * (4 * cold - 300) * cold**2)
    # Adding 0 makes 0 of -0.
    t = np.where(r < _R0, cold, t) + 0.0
    return t if t.ndim else float(t)


def measured_resistance(
    resistance: npt.ArrayLike,
    lead: float,
    *,
    wires: Literal[2, 3, 4] = 3,
    mismatch: float = 0.0,
) -> float | _Floats:
    """Return what a converter measures of a resistor at the end of its leads.

    Parameters
    ----------
    resistance : float or array_like of float
        Resistance of the sensor, 0 or more [ohm].
    lead : float
        Resistance of one lead, 0..1000 [ohm].
    wires : {2, 3, 4}, default 3
        Two wires add both leads. Three, with equal currents through two of them, leave only what
        these differ by. Four leave nothing.
    mismatch : float, default 0
        How much more the second lead has than the first, -100..100 [ohm].

    Returns
    -------
    float or ndarray of float
        Measured resistance [ohm].

    Raises
    ------
    ArgumentError
        If an argument is out of range or NaN.

    Examples
    --------
    20 m of 0.75 mm2 copper have 0.47 ohm: on two wires 2.4 K too much, on three nothing.

    >>> two, three = (measured_resistance(100, 0.47, wires=n) for n in (2, 3))
    >>> round(pt100_temperature(two), 1), pt100_temperature(three)
    (2.4, 0.0)
    """
    r = _within("resistance", resistance, 0, np.inf, "ohm")
    one = float(_within("lead", lead, 0, 1000, "ohm"))
    more = float(_within("mismatch", mismatch, -100, 100, "ohm"))
    if one + more < 0:
        raise ArgumentError(f"mismatch is {mismatch!r} ohm; the second lead would be below 0")
    added = {2: 2 * one + more, 3: more, 4: 0.0}
    if wires not in added:
        raise ArgumentError(f"wires is {wires!r}; it must be 2, 3 or 4")
    total = r + added[wires]
    return total if total.ndim else float(total)


def _within(name: str, value: npt.ArrayLike, low: float, high: float, unit: str) -> _Floats:
    array = np.asarray(value)
    if array.dtype.kind not in "iuf":
        raise ArgumentError(f"{name} is {value!r}; it must be numbers, {low:g}..{high:g} {unit}")
    good = (array >= low) & (array <= high)
    if not good.all():
        worst = array[~good].flat[0]
        raise ArgumentError(f"{name} is {worst:g} {unit}; it must be {low:g}..{high:g} {unit}")
    return array.astype(np.float64)
