"""What stands on the screen of the AMS, with **synthetic** values: each varies slowly by itself."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from shipnet.clock import nanoseconds
from shipnet.engine.points import Point, check_points
from shipnet.engine.result import Run
from shipnet.errors import ArgumentError
from shipnet.fields import check_scalar

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["SyntheticValues", "screen"]

Floats = npt.NDArray[np.float64]

#: What a register holds for an error, by lee2012, section III.2.c; as 16 bits it is 0x00FF.
_ERROR = 0xFF


class SyntheticValues:
    """Values that were never measured: a slow wave about a mean for every point.

    Parameters
    ----------
    points : iterable of Point
        What is measured.
    rng : numpy.random.Generator
        Draws mean (40..60 % of the range), amplitude (5..15 %), period (60..600 s) and phase of
        each wave. Switches stay closed, at 0.

    Raises
    ------
    ArgumentError
        If there are no points.

    Examples
    --------
    >>> from shipnet.engine.points import load_points
    >>> values = SyntheticValues(load_points(), np.random.default_rng(2024))
    >>> values.at(0, [0.0, 60.0]).round(1).tolist()
    [94.2, 101.3]
    """

    def __init__(self, points: Iterable[Point], rng: np.random.Generator) -> None:
        self.points = check_points(points)
        low = np.array([point.low for point in self.points])
        span = np.array([point.span for point in self.points])
        n = low.size
        self._mean = low + span * rng.uniform(0.4, 0.6, n)
        self._amplitude = span * rng.uniform(0.05, 0.15, n)
        self._omega = 2 * np.pi / rng.uniform(60, 600, n)
        self._phase = rng.uniform(0, 2 * np.pi, n)

    def at(self, place: int, time: npt.ArrayLike) -> Floats:
        """Return the value of a point at some times.

        Parameters
        ----------
        place : int
            Number of the point.
        time : array_like of float
            Times [s].

        Returns
        -------
        ndarray of float, of the shape of `time`
            Values in the unit of the point.
        """
        t = np.asarray(time, dtype=np.float64)
        if not self.points[place].analogue:
            return np.zeros(t.shape)
        angle = self._omega[place] * t + self._phase[place]
        return np.asarray(self._mean[place] + self._amplitude[place] * np.sin(angle))

    def now(self, time: float) -> Floats:
        """Return the values of all points at one time.

        Parameters
        ----------
        time : float
            When [s].

        Returns
        -------
        ndarray of float, shape (n_points,)
            Values in the units of the points.
        """
        return np.array([self.at(place, time) for place in range(len(self.points))])


def screen(run: Run, time: float, values: SyntheticValues) -> pd.DataFrame:
    """Return what the AMS shows at a time.

    Parameters
    ----------
    run : Run
        What `simulate` returned.
    time : float
        When, from the first answer to the end of the run [s].
    values : SyntheticValues
        What the sensors measure, for the points of the run.

    Returns
    -------
    pandas.DataFrame
        One row a point: ``tag``, ``box``, ``service``, ``value`` shown, ``unit``, ``true`` (what
        the sensor measures now), ``age_s`` of the value, and ``mark``: empty, ``0xFF``,
        ``too old``, or ``0xFF?`` for a good value that equals the code of an error. Value and age
        of what is marked are NaN.

    Raises
    ------
    ArgumentError
        If the time is outside the run, or the values belong to other points.

    Notes
    -----
    In the printed coding a register holds whole units, an **assumption**: the width and the scale
    are not printed. So a temperature of 255 degC cannot be told from an error. In the mended
    coding a value is carried in tenths, and its mark apart from it.

    Examples
    --------
    >>> from shipnet.engine.faults import DeadBox
    >>> from shipnet.engine.simulation import simulate
    >>> from shipnet.engine.system import System
    >>> run = simulate(System(), 20, faults=[DeadBox("JB2", 10)])
    >>> values = SyntheticValues(run.system.points, np.random.default_rng(2024))
    >>> [screen(run, t, values).query("box == 'JB2'")["mark"].unique().tolist() for t in (14, 15)]
    [[''], ['0xFF']]
    """
    import pandas as pd

    seen = run.views.seen
    now = nanoseconds(check_scalar("time", time, "s", 0, 1e6))
    first = int(seen[0]) if seen.size else run.end
    if not first <= now <= run.end:
        raise ArgumentError(f"time is {time} s; it must be {first / 1e9:g}..{run.end / 1e9:g} s")
    if values.points != run.system.points:
        raise ArgumentError("values are of other points than the run; they must be of the same")
    row = int(np.searchsorted(seen, now, side="right")) - 1
    printed = run.system.coding == "printed"
    rows = []
    for place, point in enumerate(run.system.points):
        shown = run.shown(point.tag)
        value, age, mark = np.nan, np.nan, "0xFF" if printed else "too old"
        if shown.good[row] and (now < shown.good_until[row] or shown.good_until[row] == run.end):
            sampled = int(shown.sampled[row]) / 1e9
            age, mark = time - sampled, ""
            value = round(float(values.at(place, sampled)), 0 if printed else 1)
            if printed and int(value) == _ERROR:
                mark = "0xFF?"
        true = float(values.at(place, time))
        rows.append((point.tag, point.box, point.service, value, point.unit, true, age, mark))
    columns = ["tag", "box", "service", "value", "unit", "true", "age_s", "mark"]
    return pd.DataFrame(rows, columns=columns)
