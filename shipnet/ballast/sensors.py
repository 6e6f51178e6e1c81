"""The channels and sensors of a valve's slave, and the speed at which the position changes.

The paper prints no units; we inferred bar, bar, A, degC and percent (claim kim2014-038).
"""

from __future__ import annotations

from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from shipnet.arrays import Floats
from shipnet.errors import ArgumentError
from shipnet.fields import check_fields, record, whole


class Channel(NamedTuple):
    """A sensor channel of a slave."""

    name: str
    meaning: str
    unit: str
    column: str


#: The five sensors, in the order of every array of readings.
CHANNELS = (
    Channel("FP", "pump pressure", "bar", "FP_bar"),
    Channel("OP", "operating pressure", "bar", "OP_bar"),
    Channel("MC", "motor current", "A", "MC_A"),
    Channel("OT", "motor temperature", "degC", "OT_degC"),
    Channel("VPos", "valve position", "%", "VPos_percent"),
)


#: Time over which the change of position is measured [s]; not printed in the paper.
WINDOW = 1.0


def position_speed(time: Floats, position: Floats) -> Floats:
    """Return the absolute speed of the position over the window [%/s]; NaN in the first window."""
    then = np.searchsorted(time, time - WINDOW + 1e-9) - 1
    speed = np.full(position.shape, np.nan)
    valid = then >= 0
    lasted = (time[valid] - time[then[valid]])[:, np.newaxis]
    speed[valid] = np.abs(position[valid] - position[then[valid]]) / lasted
    return speed


def stroke_speed(speed: Floats, ran: npt.ArrayLike) -> Floats:
    """Return the speed where the motor has run for the whole window, and NaN elsewhere."""
    return np.where(np.asarray(ran) >= WINDOW - 1e-9, speed, np.nan)


@record
class Sensors:
    """The sensors of a slave, in the order and the units of `CHANNELS`: FP, OP, MC, OT, VPos.

    Parameters
    ----------
    low, high : tuple of float
        Ends of the scales; by default 0..160 bar, 0..10 bar, 0..6 A, 0..150 degC, -20..120 %.
    noise : tuple of float
        Standard deviations, 0 or more; by default 0.5 bar, 0.03 bar, 0.02 A, 0.3 degC, 0.1 %.
    bits : int or None, default 12
        Resolution of the converter, 1..24 bits; None means no quantisation.

    Notes
    -----
    The paper prints 12 bits and five channels; scales and noise are our assumptions. The scale of
    the position includes the 105 % and -5 % of the paper's tests.

    Examples
    --------
    >>> Sensors().step.round(4).tolist()
    [0.0391, 0.0024, 0.0015, 0.0366, 0.0342]
    """

    low: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0, -20.0)
    high: tuple[float, ...] = (160.0, 10.0, 6.0, 150.0, 120.0)
    noise: tuple[float, ...] = (0.5, 0.03, 0.02, 0.3, 0.1)
    bits: int | None = whole(1, 24, help="Resolution", default=12, optional=True)

    def __post_init__(self) -> None:
        check_fields(self)
        names = [channel.name for channel in CHANNELS]
        for field in ("low", "high", "noise"):
            values: Any = getattr(self, field)
            try:
                five = tuple(float(value) for value in values)
            except (TypeError, ValueError):
                five = ()
            if len(five) != 5 or np.isnan(five).any():
                raise ArgumentError(
                    f"{field} is {values!r}; it must be five numbers, {', '.join(names)}"
                )
            object.__setattr__(self, field, five)
        for name, low, high, noise in zip(names, self.low, self.high, self.noise, strict=True):
            if not low < high:
                raise ArgumentError(f"scale of {name} is {low:g}..{high:g}; low must be below high")
            if not 0 <= noise < np.inf:
                raise ArgumentError(f"noise of {name} is {noise:g}; it must be 0 or more")
        if self.bits is not None and not np.isfinite([self.low, self.high]).all():
            raise ArgumentError("low and high must be finite unless bits is None")

    @property
    def step(self) -> Floats:
        """Step of the converter, shape (5,), in the units of the channels; 0 if `bits` is None."""
        if self.bits is None:
            return np.zeros(5)
        return np.asarray((np.array(self.high) - self.low) / (2**self.bits - 1))

    @cached_property
    def _scale(self) -> Floats:
        """Low end, high end, noise and step of each sensor as columns, shape (4, 5, 1)."""
        return np.array([self.low, self.high, self.noise, self.step])[..., np.newaxis]

    def read(self, truth: npt.ArrayLike, rng: np.random.Generator | None = None) -> Floats:
        """Return the sensors' readings of true values."""
        values = np.asarray(truth, float)
        if values.ndim < 2 or values.shape[-2] != 5:
            raise ArgumentError(f"truth has the shape {values.shape}; it must be (5, n_valves)")
        low, high, noise, step = self._scale
        if rng is not None:
            values = values + rng.standard_normal(values.shape) * noise
        values = np.minimum(np.maximum(values, low), high)
        if self.bits is None:
            return np.asarray(values)
        return np.asarray(np.rint((values - low) / step) * step + low)
