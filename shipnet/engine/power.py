"""The power of a diesel engine from its size."""

from __future__ import annotations

from math import pi
from typing import Literal

from shipnet.fields import check_scalar, choice, number, record, whole


@record(slots=True)
class DieselEngine:
    r"""An engine by the size and number of its cylinders.

    .. math:: P = z \, \frac{\pi}{4} d^2 s \, p_{me} \, n \, \frac{2}{k}

    with :math:`k` strokes per cycle and :math:`n` revolutions per second.

    Raises
    ------
    ArgumentError
        If a field is out of range.

    Examples
    --------
    The engine of lee2012, Table 1: 19 bar and 127 r/min. The project guide has 12640 kW.

    >>> from shipnet import engine
    >>> main = engine.DieselEngine.S50MC_C(8)
    >>> round(main.power(19e5, 127 / 60) / 1e3)
    12634
    >>> round(engine.DieselEngine.S50MC_C(8, strokes=4).power(19e5, 127 / 60) / 1e3)
    6317
    >>> round(main.mean_effective_pressure(12_640e3, 127 / 60) / 1e5, 2)
    19.01
    >>> round(main.speed(12_640e3, 19e5) * 60, 2)
    127.06
    """

    bore: float = number(0.01, 2, "m", "Diameter of a cylinder")
    stroke: float = number(0.01, 5, "m", "Stroke of the piston")
    cylinders: int = whole(1, 24, "", "Number of cylinders")
    strokes: Literal[2, 4] = choice((2, 4), "Strokes per cycle", default=2)

    @classmethod
    def S50MC_C(cls, cylinders: int = 8, *, strokes: Literal[2, 4] = 2) -> DieselEngine:
        """Return the engine of lee2012, which prints neither bore nor stroke.

        Both are from MAN B&W, S50MC-C project guide, Fig. 1.02.
        """
        return cls(0.5, 2.0, cylinders, strokes)

    @property
    def swept_volume(self) -> float:
        """Swept volume of one cylinder [m3]."""
        return pi / 4 * self.bore**2 * self.stroke

    def power(self, pressure: float, rate: float) -> float:
        """Return the power [W] at a mean effective pressure [Pa] and a speed [1/s]."""
        p = check_scalar("pressure", pressure, "Pa", 0, 1e7)
        n = check_scalar("rate", rate, "1/s", 0, 100)
        return p * n * self._per_pressure_and_turn

    def mean_effective_pressure(self, power: float, rate: float) -> float:
        """Return the mean effective pressure [Pa] at a power [W] and a speed [1/s]."""
        p = check_scalar("power", power, "W", 0, 1e9)
        n = check_scalar("rate", rate, "1/s", 1e-3, 100)
        return p / n / self._per_pressure_and_turn

    def speed(self, power: float, pressure: float) -> float:
        """Return the speed [1/s] at a power [W] and a mean effective pressure [Pa]."""
        total = check_scalar("power", power, "W", 0, 1e9)
        p = check_scalar("pressure", pressure, "Pa", 1, 1e7)
        return total / p / self._per_pressure_and_turn

    @property
    def _per_pressure_and_turn(self) -> float:
        """Power by pressure and speed [m3]."""
        return self.cylinders * self.swept_volume * 2 / self.strokes
