r"""The input converters of a junction box: from what a sensor does to a code, and back.

A sensor's signal :math:`s` is a resistance, a current or a contact. An amplifier maps a window
:math:`s_0 .. s_1` of it to 0..5 V, and the converter of the controller makes a code of that:

.. math:: u = U_{ref} \frac{s - s_0}{s_1 - s_0}, \qquad
          c = \left\lfloor \frac{2^n u}{U_{ref}} + \frac{1}{2} \right\rfloor

As lee2012 prints it, the window of a 4-20 mA loop is 4..20 mA, by 250 ohm and an amplifier
:math:`1.25 (u - 1 V)`; that of a thermometer is its range.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import numpy.typing as npt

from shipnet.engine.points import Point, check_points
from shipnet.engine.pt100 import RANGE, pt100_resistance, pt100_temperature
from shipnet.errors import ArgumentError
from shipnet.fields import check_scalar, check_whole

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["BURDEN", "EXCITATION", "NAMUR", "Adc", "InputCard", "Namur", "kinds"]

#: Resistor of a current loop [ohm]: 4-20 mA make 1-5 V; lee2012, section IV.1.b.
BURDEN = 250.0

#: Current through a thermometer [A]; assumed, the paper prints none.
EXCITATION = 1e-3

#: Zero and full scale of a current loop [A].
_LOOP = (4e-3, 20e-3)

_Floats = npt.NDArray[np.float64]
_Codes = npt.NDArray[np.uint16]


class Namur(NamedTuple):
    """Currents that tell a value from a failure.

    Attributes
    ----------
    failed_low, lowest, highest, failed_high : float
        A failure at or below the first, values from the second to the third, a failure at or
        above the fourth [A].
    """

    failed_low: float
    lowest: float
    highest: float
    failed_high: float


#: Recommendation NE 43 of NAMUR.
NAMUR = Namur(3.6e-3, 3.8e-3, 20.5e-3, 21e-3)

#: The same as parts of the span above its zero; thermometers are judged by them too.
_PARTS = [(i - _LOOP[0]) / (_LOOP[1] - _LOOP[0]) for i in NAMUR]


@dataclass(frozen=True, slots=True)
class Adc:
    """An analogue-to-digital converter.

    Parameters
    ----------
    bits : int, default 10
        Resolution, 1..16; that of the AT90CAN128 is 10.
    reference : float, default 5
        Reference voltage, 0.1..100 [V]; 5 V is assumed.

    Raises
    ------
    ArgumentError
        If a field is out of range.

    Notes
    -----
    The highest code is "the reference minus one LSB" [1]_, so a step is the reference over 1024,
    though the formula above that sentence has 1023. Noise and non-linearity are left out.

    References
    ----------
    .. [1] Atmel, AT90CAN128 data sheet, 4250E-CAN-12/04, p. 277, "ADC conversion result".

    Examples
    --------
    >>> adc = Adc()
    >>> round(adc.step * 1e3, 3), adc.code([-1, 0, 2.5, 5, 9]).tolist()
    (4.883, [0, 0, 512, 1023, 1023])
    """

    bits: int = 10
    reference: float = 5.0

    def __post_init__(self) -> None:
        """Check both."""
        object.__setattr__(self, "bits", check_whole("bits", self.bits, 1, 16))
        reference = check_scalar("reference", self.reference, "V", 0.1, 100)
        object.__setattr__(self, "reference", reference)

    @property
    def highest(self) -> int:
        """Highest code."""
        return int(2**self.bits - 1)

    @property
    def step(self) -> float:
        """Voltage from one code to the next [V]."""
        return float(self.reference / 2**self.bits)

    def code(self, voltage: npt.ArrayLike) -> _Codes:
        """Return the codes of voltages [V]; what is out of range is clipped, NaN is an error."""
        u = np.asarray(voltage, np.float64)
        if np.isnan(u).any():
            raise ArgumentError("voltage is nan; a converter always sees some voltage")
        steps = np.clip(np.floor(np.clip(u / self.step, -1, 2**17) + 0.5), 0, self.highest)
        return steps.astype(np.uint16)

    def voltage(self, code: npt.ArrayLike) -> _Floats:
        """Return the voltages in the middle of codes [V]."""
        return np.asarray(code) * self.step


@dataclass(frozen=True, slots=True)
class InputCard:
    """The converters of a list of points: R/V, I/V and B/V.

    Parameters
    ----------
    points : iterable of Point
        One or more.
    adc : Adc, optional
        The converter of the controller; 10 bits, 5 V if not given.
    margin : float, default 0
        How far the amplifier's window reaches beyond both ends of the range, as part of the span,
        0..1. As printed, 0: 4..20 mA fill 0..5 V. With 0.125, 2..22 mA do, and a failure can be
        told from a value.
    linearised : bool, default True
        Whether the firmware solves the curve of the thermometer; if not, it takes the straight
        line between the ends of the range.

    Raises
    ------
    ArgumentError
        If a field is out of range.

    Notes
    -----
    Values and codes are arrays of shape (..., n_points), time in front. A switch has value 1 on
    alarm. Its contact is closed as long as all is well, unless its `signal` begins with ``NO``
    (normally open). Behind the opto-coupler a closed contact is 0 V, and its code is one bit.

    Examples
    --------
    >>> from shipnet.engine.points import load_points
    >>> card = InputCard(load_points()[20:21])  # -50..600 degC on 4-20 mA
    >>> code = card.code(card.signal([[-50.0], [275.0], [600.0]]))
    >>> code.ravel().tolist(), card.value(code).ravel().round(2).tolist()
    ([0, 512, 1023], [-50.0, 275.0, 599.37])
    """

    points: tuple[Point, ...]
    adc: Adc = field(default_factory=Adc)
    margin: float = 0.0
    linearised: bool = True

    def __post_init__(self) -> None:
        """Check every field."""
        object.__setattr__(self, "points", check_points(self.points))
        if not isinstance(self.adc, Adc):
            raise ArgumentError(f"adc is {self.adc!r}; it must be an Adc")
        object.__setattr__(self, "margin", check_scalar("margin", self.margin, "", 0, 1))
        if not isinstance(self.linearised, bool):
            raise ArgumentError(f"linearised is {self.linearised!r}; it must be True or False")

    def signal(self, values: npt.ArrayLike) -> _Floats:
        """Return what the sensors do: resistance [ohm], current [A], contact (1 is closed).

        Parameters
        ----------
        values : array_like of float, shape (..., n_points)
            Values in the unit of each point; 0 or 1 of a switch. A transmitter goes no further
            than 3.8 and 20.5 mA.
        """
        v = self._shaped("values", values)
        signals = np.empty(v.shape)
        for k, point in enumerate(self.points):
            own = v[..., k]
            if point.condition == "RTD":
                signals[..., k] = pt100_resistance(own)
                continue
            if np.isnan(own).any():
                raise ArgumentError(f"value of {point.tag} is nan; a sensor always has some value")
            if point.condition == "switch":
                if not ((own == 0) | (own == 1)).all():
                    raise ArgumentError(f"value of {point.tag} is none of 0 and 1")
                signals[..., k] = own if _opens(point) else 1 - own
            else:
                part = (own - point.low) / point.span
                current = _LOOP[0] + (_LOOP[1] - _LOOP[0]) * part
                signals[..., k] = np.clip(current, NAMUR.lowest, NAMUR.highest)
        return signals

    @property
    def window(self) -> _Floats:
        """Signals that make 0 V and the reference, shape (n_points, 2)."""
        ends = self._ends()
        span = ends[:, 1] - ends[:, 0]
        wide = np.array([self.margin * point.analogue for point in self.points])
        return np.column_stack([ends[:, 0] - wide * span, ends[:, 1] + wide * span])

    def voltage(self, signal: npt.ArrayLike) -> _Floats:
        """Return the voltages at the converter [V], 0 to the reference.

        Parameters
        ----------
        signal : array_like of float, shape (..., n_points)
            What the sensors do; a resistance or a current may be infinite.
        """
        s = self._shaped("signal", signal)
        if np.isnan(s).any():
            raise ArgumentError("signal is nan; a sensor always does something")
        low, high = self.window.T
        u = self.adc.reference * (s - low) / (high - low)
        return np.asarray(np.clip(u, 0, self.adc.reference))

    def code(self, signal: npt.ArrayLike) -> _Codes:
        """Return the codes, shape (..., n_points); of a switch the bit of its port.

        Parameters
        ----------
        signal : array_like of float, shape (..., n_points)
            As for `voltage`.
        """
        u = self.voltage(signal)
        analogue = np.array([point.analogue for point in self.points])
        return np.where(analogue, self.adc.code(u), u > self.adc.reference / 2).astype(np.uint16)

    def value(self, code: npt.ArrayLike) -> _Floats:
        """Return the values that the firmware makes of codes.

        Parameters
        ----------
        code : array_like of int, shape (..., n_points)
            Codes as `code` returns them.
        """
        c = np.asarray(code)
        highest = np.array([self.adc.highest if p.analogue else 1 for p in self.points])
        if c.dtype.kind not in "iu" or not c.ndim or c.shape[-1] != len(highest):
            raise ArgumentError(
                f"code has shape {c.shape}; it must be whole, (..., {len(highest)})"
            )
        if ((c < 0) | (c > highest)).any():
            raise ArgumentError(f"code is out of range; it must be 0..{highest.max()}")
        return self.decoded(c / np.where(highest > 1, self.adc.highest + 1.0, 1.0))

    def decoded(self, part: npt.ArrayLike, *, linearised: bool | None = None) -> _Floats:
        """Return the values that stand behind parts of the window, without rounding.

        Parameters
        ----------
        part : array_like of float, shape (..., n_points)
            Voltage over reference, 0..1.
        linearised : bool, optional
            As for the card; its own if omitted.
        """
        x = self._shaped("part", part)
        curve = self.linearised if linearised is None else linearised
        window, ends = self.window, self._ends()
        values = np.empty(x.shape)
        for k, point in enumerate(self.points):
            s = window[k, 0] + x[..., k] * (window[k, 1] - window[k, 0])
            if point.condition == "switch":
                values[..., k] = s if _opens(point) else 1 - s
            elif point.condition == "RTD" and curve:
                # A window may reach beyond the standard; a value stops there.
                lowest, highest = (pt100_resistance(end) for end in RANGE)
                values[..., k] = pt100_temperature(np.clip(s, lowest, highest))
            else:
                zero, full = ends[k]
                values[..., k] = point.low + point.span * (s - zero) / (full - zero)
        return values

    @property
    def limits(self) -> npt.NDArray[np.int64]:
        """Codes at or below the first and at or above the second are failures, shape (n_points, 2).

        They are the codes of 3.6 and 21 mA, and of the same parts of a thermometer's span; -1 and
        one more than the highest where such a code could be a value too.
        """
        ends = self._ends()
        signals = [ends[:, 0] + part * (ends[:, 1] - ends[:, 0]) for part in _PARTS]
        low, lowest, highest, high = (self.code(signal).astype(np.int64) for signal in signals)
        analogue = np.array([point.analogue for point in self.points])
        return np.column_stack(
            [
                np.where(analogue & (low < lowest), low, -1),
                np.where(analogue & (high > highest), high, self.adc.highest + 1),
            ]
        )

    def valid(self, code: npt.ArrayLike) -> npt.NDArray[np.bool_]:
        """Return which codes are values and no failures, shape (..., n_points).

        Parameters
        ----------
        code : array_like of int, shape (..., n_points)
            Codes as `code` returns them.
        """
        low, high = self.limits.T
        c = np.asarray(code)
        return np.asarray((c > low) & (c < high))

    def amplifiers(self) -> pd.DataFrame:
        """Return the amplifier of each analogue point, behind resistor or current source.

        Returns
        -------
        pandas.DataFrame
            ``tag``, ``low_v`` and ``high_v`` at its input over the window, ``gain``, and
            ``offset_v``, which it takes off before it amplifies.
        """
        import pandas as pd

        rows = []
        for point, ends in zip(self.points, self.window, strict=True):
            if point.analogue:
                low, high = ends * (EXCITATION if point.condition == "RTD" else BURDEN)
                rows.append((point.tag, low, high, self.adc.reference / (high - low), low))
        return pd.DataFrame(rows, columns=["tag", "low_v", "high_v", "gain", "offset_v"])

    def _ends(self) -> _Floats:
        """Return the signals at both ends of the ranges."""
        ends = np.empty((len(self.points), 2))
        for k, point in enumerate(self.points):
            if point.condition == "RTD":
                ends[k] = pt100_resistance([point.low, point.high])
            else:
                # A closed contact is 0 V.
                ends[k] = _LOOP if point.analogue else (1, 0)
        return ends

    def _shaped(self, name: str, values: npt.ArrayLike) -> _Floats:
        array = np.asarray(values)
        n = len(self.points)
        if array.dtype.kind not in "iufb" or not array.ndim or array.shape[-1] != n:
            raise ArgumentError(
                f"{name} have shape {array.shape}; it must be (..., {n}) of numbers"
            )
        return array.astype(np.float64)


def _opens(point: Point) -> bool:
    """Return whether the contact is open as long as all is well."""
    return point.signal.upper().startswith("NO")


def kinds(points: Iterable[Point]) -> list[tuple[int, int]]:
    """Return the first point of each kind of input, and how many there are of it.

    Parameters
    ----------
    points : iterable of Point
        One or more.

    Returns
    -------
    list of (int, int)
        Place and number; points of one kind have condition, range, unit and signal in common.

    Examples
    --------
    >>> from shipnet.engine.points import load_points
    >>> kinds(load_points())[:2]
    [(0, 33), (10, 10)]
    """
    first: dict[tuple[object, ...], list[int]] = {}
    for k, point in enumerate(check_points(points)):
        key = (point.condition, point.low, point.high, point.unit, point.signal)
        first.setdefault(key, []).append(k)
    return [(places[0], len(places)) for places in first.values()]
