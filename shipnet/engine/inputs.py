r"""The input converters of a junction box: from a sensor's signal to a code, and back.

An amplifier maps a window :math:`s_0 .. s_1` of a sensor's signal :math:`s` (a resistance, a
current or a contact) to 0..5 V, which the converter of the controller turns into a code:

.. math:: u = U_{ref} \frac{s - s_0}{s_1 - s_0}, \qquad
          c = \left\lfloor \frac{2^n u}{U_{ref}} + \frac{1}{2} \right\rfloor

In lee2012 the window of a 4-20 mA loop is 4..20 mA (250 ohm, then an amplifier
:math:`1.25 (u - 1 V)`), and the window of a thermometer is its range.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from typing import Literal

import numpy as np
import numpy.typing as npt

from shipnet.arrays import Bools, Floats, Integers, Words
from shipnet.engine.points import PT100, Point, PointList, by_point
from shipnet.errors import ArgumentError
from shipnet.fields import number, part, record, whole
from shipnet.lazy import pd

# Thermometers ----------------------------------------------------------------------------------

#: Resistance at 0 degC [ohm] and the coefficients of Callendar and Van Dusen [1/degC, 1/degC2,
#: 1/degC4]; IEC 60751:2008, section 4.2. The standard prints 138.51 ohm at 100 degC.
_R0 = 100.0
_A, _B, _C = 3.9083e-3, -5.775e-7, -4.183e-12


def pt100_resistance(temperature: npt.ArrayLike) -> float | Floats:
    """Return the resistance [ohm] of a Pt100 at -200..850 degC; IEC 60751, section 4.2."""
    t = _within("temperature", temperature, *PT100, "degC")
    cold = np.minimum(t, 0)
    r = _R0 * (1 + _A * t + _B * t**2 + _C * (cold - 100) * cold**3)
    return r if r.ndim else float(r)


def pt100_temperature(resistance: npt.ArrayLike) -> float | Floats:
    """Return the temperature [degC] of a Pt100: closed form above 0 degC, Newton's method below."""
    low, high = (float(pt100_resistance(end)) for end in PT100)
    r = _within("resistance", resistance, low, high, "ohm")
    t = (-_A + np.sqrt(_A**2 - 4 * _B * (1 - r / _R0))) / (2 * _B)
    # The closed form is wrong by 2.5 K at -200 degC; each Newton step squares the error.
    cold = np.minimum(t, 0)
    for _ in range(4):
        error = 1 + _A * cold + _B * cold**2 + _C * (cold - 100) * cold**3
        error -= np.minimum(r, _R0) / _R0
        cold = cold - error / (_A + 2 * _B * cold + _C * (4 * cold - 300) * cold**2)
    # Adding 0 turns -0 into 0.
    t = np.where(r < _R0, cold, t) + 0.0
    return t if t.ndim else float(t)


def _within(name: str, value: npt.ArrayLike, low: float, high: float, unit: str) -> Floats:
    array = np.asarray(value)
    if array.dtype.kind not in "iuf":
        raise ArgumentError(f"{name} is {value!r}; it must be numbers, {low:g}..{high:g} {unit}")
    good = (array >= low) & (array <= high)
    if not good.all():
        worst = array[~good].flat[0]
        raise ArgumentError(f"{name} is {worst:g} {unit}; it must be {low:g}..{high:g} {unit}")
    return array.astype(np.float64)


# Converters ------------------------------------------------------------------------------------

#: Zero and full scale of a current loop [A].
_LOOP = (4e-3, 20e-3)

#: Limits of NAMUR NE 43 [A]: currents between the inner two are values; currents up to the first,
#: or from the last up, are failures.
NAMUR = (3.6e-3, 3.8e-3, 20.5e-3, 21e-3)

#: The same limits, scaled so that 4 mA is 0 and 20 mA is 1; they also apply to thermometers.
_PARTS = [(i - _LOOP[0]) / (_LOOP[1] - _LOOP[0]) for i in NAMUR]

#: Signal of each kind of sensor by wire fault: resistance [ohm], current [A], contact (1 is
#: closed). A short circuit across a transmitter connects the supply to the 250 ohm resistor alone;
#: at 24 V the current is 96 mA, which is outside every window.
WIRE_FAULTS: dict[Literal["open", "short"], dict[str, float]] = {
    "open": {"RTD": np.inf, "4-20 mA": 0.0, "switch": 0.0},
    "short": {"RTD": 0.0, "4-20 mA": np.inf, "switch": 1.0},
}


@record
class InputCard:
    """The converters of a list of points: R/V (resistance), I/V (current) and B/V (switch).

    Values and codes are arrays of shape (..., n_points). A switch has value 1 on alarm; its contact
    is then open, or closed if its `signal` begins with ``NO``. A closed contact gives 0 V after its
    opto-coupler. The code of a switch has one bit.

    Examples
    --------
    >>> from shipnet import engine
    >>> card = engine.InputCard(engine.read_points()[20:21])  # -50..600 degC on 4-20 mA
    >>> code = card.code(card.signal([[-50.0], [275.0], [600.0]]))
    >>> code.ravel().tolist(), card.value(code).ravel().round(2).tolist()
    ([0, 512, 1023], [-50.0, 275.0, 599.37])
    >>> card.wire_faults()[["fault", "code", "reads", "detected"]].values.tolist()
    [['open', 0, -50.0, False], ['short', 1023, 599.365234375, False]]
    """

    points: PointList = part(PointList, "One or more points", make=PointList)
    bits: int = whole(
        1, 16, "", "Resolution; the AT90CAN128's converter has 10 bits", default=10, kw_only=True
    )
    reference: float = number(
        0.1, 100, "V", "Reference voltage; 5 V is assumed", default=5.0, kw_only=True
    )
    margin: float = number(
        0,
        1,
        "",
        "Extension of the amplifier's window beyond each end of the range, as a fraction of the "
        "span. In the printed design it is 0: 4..20 mA map to 0..5 V. With 0.125, 2..22 mA map to "
        "0..5 V, so that failures can be distinguished from values",
        default=0.0,
        kw_only=True,
    )

    @property
    def highest(self) -> int:
        """Highest code, ``2**bits - 1``; a step is the reference divided by ``2**bits``.

        Atmel, AT90CAN128 data sheet 4250E-CAN-12/04, p. 277: "the reference minus one LSB".
        """
        return int(2**self.bits - 1)

    @property
    def step(self) -> float:
        """Voltage difference between two successive codes [V]."""
        return float(self.reference / 2**self.bits)

    def signal(self, values: npt.ArrayLike) -> Floats:
        """Return resistances [ohm], currents clipped to 3.8..20.5 mA [A], contacts (1: closed)."""
        v = by_point(self.points, "values", values).astype(np.float64)
        signals = np.empty(v.shape)
        for k, point in enumerate(self.points):
            value = v[..., k]
            if point.condition == "RTD":
                signals[..., k] = pt100_resistance(value)
                continue
            if np.isnan(value).any():
                raise ArgumentError(f"value of {point.tag} is nan; it must be a number")
            if point.condition == "switch":
                if not ((value == 0) | (value == 1)).all():
                    raise ArgumentError(f"value of {point.tag} is neither 0 nor 1")
                signals[..., k] = value if _opens(point) else 1 - value
            else:
                part = (value - point.low) / point.span
                current = _LOOP[0] + (_LOOP[1] - _LOOP[0]) * part
                signals[..., k] = np.clip(current, *NAMUR[1:3])
        return signals

    @property
    def window(self) -> Floats:
        """Signals that correspond to 0 V and to the reference, shape (n_points, 2)."""
        ends = self._ends
        span = ends[:, 1] - ends[:, 0]
        wide = np.array([self.margin * point.analogue for point in self.points])
        return np.column_stack([ends[:, 0] - wide * span, ends[:, 1] + wide * span])

    def voltage(self, signal: npt.ArrayLike) -> Floats:
        """Return the voltages at the converter [V]; a resistance or current may be infinite."""
        s = by_point(self.points, "signal", signal).astype(np.float64)
        if np.isnan(s).any():
            raise ArgumentError("signal is nan; it must be a number")
        low, high = self.window.T
        u = self.reference * (s - low) / (high - low)
        return np.asarray(np.clip(u, 0, self.reference))

    def code(self, signal: npt.ArrayLike) -> Words:
        """Return the codes of signals; for a switch, 0 if its contact is closed, 1 if open."""
        u = self.voltage(signal)
        analogue = np.array([point.analogue for point in self.points])
        steps = np.clip(np.floor(u / self.step + 0.5), 0, self.highest)
        return np.where(analogue, steps, u > self.reference / 2).astype(np.uint16)

    def value(self, code: npt.ArrayLike) -> Floats:
        """Return the values that the firmware computes from codes."""
        c = by_point(self.points, "code", code, "iu")
        highest = np.array([self.highest if p.analogue else 1 for p in self.points])
        if ((c < 0) | (c > highest)).any():
            raise ArgumentError(f"code is out of range; it must be 0..{highest.max()}")
        return self._decoded(c / np.where(highest > 1, self.highest + 1.0, 1.0))

    def _decoded(self, part: npt.ArrayLike) -> Floats:
        """Return the values at fractions of the window (voltage / reference), without rounding."""
        x = np.asarray(part)
        window, ends = self.window, self._ends
        values = np.empty(x.shape)
        for k, point in enumerate(self.points):
            s = window[k, 0] + x[..., k] * (window[k, 1] - window[k, 0])
            if point.condition == "switch":
                values[..., k] = s if _opens(point) else 1 - s
            elif point.condition == "RTD":
                # A window may exceed the range of the standard, so clip to that range.
                lowest, highest = (pt100_resistance(end) for end in PT100)
                values[..., k] = pt100_temperature(np.clip(s, lowest, highest))
            else:
                zero, full = ends[k]
                values[..., k] = point.low + point.span * (s - zero) / (full - zero)
        return values

    @property
    def limits(self) -> Integers:
        """Low and high limits of codes, shape (n_points, 2); codes at or beyond one are failures.

        The limits are the codes of 3.6 and 21 mA, or, for a thermometer, of the same fractions of
        its span. A limit whose code could also be a value is set outside the range of codes.
        """
        ends = self._ends
        signals = [ends[:, 0] + part * (ends[:, 1] - ends[:, 0]) for part in _PARTS]
        low, lowest, highest, high = (self.code(signal).astype(np.int64) for signal in signals)
        analogue = np.array([point.analogue for point in self.points])
        return np.column_stack(
            [
                np.where(analogue & (low < lowest), low, -1),
                np.where(analogue & (high > highest), high, self.highest + 1),
            ]
        )

    def valid(self, code: npt.ArrayLike) -> Bools:
        """Return a mask of the codes that are values, not failures, according to `limits`."""
        low, high = self.limits.T
        c = np.asarray(code)
        return np.asarray((c > low) & (c < high))

    def accuracy(self) -> pd.DataFrame:
        """Return resolution and conversion error: one row per kind of analogue input.

        ``step_low`` and ``step_high`` are the changes in value per code at the ends of the range.
        Only quantisation is counted: sensors and amplifiers are assumed to be ideal.
        """
        rows = []
        for k, count in self.points.kinds():
            point = self.points[k]
            if not point.analogue:
                continue
            card = replace(self, points=PointList([point]))
            n = self.highest + 1
            # Between two steps of the converter the decoded value is constant, so the largest error
            # occurs at a step or at an end of the range.
            edges = card._decoded((np.arange(1, n) - 0.5)[:, np.newaxis] / n)[:, 0]
            decoded = card.value(np.arange(n)[:, np.newaxis])[:, 0]
            inside = (edges > point.low) & (edges < point.high)
            first, last = (int(card.code(card.signal([end]))[0]) for end in (point.low, point.high))
            ends = np.concatenate([[point.low], np.repeat(edges[inside], 2), [point.high]])
            below = np.flatnonzero(inside)
            pairs = np.column_stack([below, below + 1]).ravel()
            codes = np.concatenate([[first], pairs, [last]])
            steps = decoded[first + 1] - decoded[first], decoded[last] - decoded[last - 1]
            error = np.abs(decoded[codes] - ends).max()
            rows.append((point.condition, point.low, point.high, point.unit, count, *steps, error))
        columns = ["condition", "low", "high", "unit", "points"]
        columns += ["step_low", "step_high", "conversion_error"]
        return pd.DataFrame(rows, columns=columns)

    def broken(self, wire: Literal["open", "short"]) -> Words:
        """Return the codes of all points with their wires open or short-circuited."""
        return self.code([WIRE_FAULTS[wire][point.condition] for point in self.points])

    def wire_faults(self) -> pd.DataFrame:
        """Return what a box reads with broken or short-circuited wires: two rows per kind of input.

        ``reads`` is the value decoded from ``code``; ``detected`` is true if the card's limits show
        that the code is a failure.
        """
        rows = []
        for k, count in self.points.kinds():
            point, card = self.points[k], replace(self, points=self.points[k : k + 1])
            for fault in WIRE_FAULTS:
                code = card.broken(fault)
                reads = int(code[0]), float(card.value(code)[0]), not card.valid(code)[0]
                rows.append(
                    (point.condition, point.low, point.high, point.unit, count, fault, *reads)
                )
        columns = ["condition", "low", "high", "unit", "points", "fault", "code", "reads"]
        return pd.DataFrame(rows, columns=[*columns, "detected"])

    @cached_property
    def _ends(self) -> Floats:
        """The signals at both ends of the points' ranges."""
        ends = np.empty((len(self.points), 2))
        for k, point in enumerate(self.points):
            if point.condition == "RTD":
                ends[k] = pt100_resistance([point.low, point.high])
            else:
                # A closed contact is 0 V.
                ends[k] = _LOOP if point.analogue else (1, 0)
        return ends


def _opens(point: Point) -> bool:
    """Return whether the contact is normally open."""
    return point.signal.upper().startswith("NO")
