"""What the AMS shows at a time, with **synthetic** values: each varies slowly by itself."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from shipnet.clock import nanoseconds
from shipnet.engine.points import Point, PointList
from shipnet.engine.system import RULE
from shipnet.errors import ArgumentError
from shipnet.fields import check_scalar

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

    from shipnet.engine.simulation import Run

Floats = npt.NDArray[np.float64]

#: What a register holds for an error, by lee2012, section III.2.c; as 16 bits it is 0x00FF.
_ERROR = 0xFF


class SyntheticValues:
    """Values that were never measured: a slow wave about a mean for every point.

    `rng` draws mean (40..60 % of the range), amplitude (5..15 %), period (60..600 s) and phase of
    each wave. Switches stay closed, at 0.
    """

    def __init__(self, points: Iterable[Point], rng: Any) -> None:
        self.points, rng = PointList(points), np.random.default_rng(rng)
        low = np.array([point.low for point in self.points])
        span = np.array([point.span for point in self.points])
        n = low.size
        self._mean = low + span * rng.uniform(0.4, 0.6, n)
        self._amplitude = span * rng.uniform(0.05, 0.15, n)
        self._omega = 2 * np.pi / rng.uniform(60, 600, n)
        self._phase = rng.uniform(0, 2 * np.pi, n)

    def at(self, place: int, time: npt.ArrayLike) -> Floats:
        """Return the value of point number `place` at some times [s]."""
        t = np.asarray(time, dtype=np.float64)
        if not self.points[place].analogue:
            return np.zeros(t.shape)
        angle = self._omega[place] * t + self._phase[place]
        return np.asarray(self._mean[place] + self._amplitude[place] * np.sin(angle))

    def now(self, time: float) -> Floats:
        """Return the values of all points at one time [s]."""
        return np.array([self.at(place, time) for place in range(len(self.points))])


class Screen:
    """What the AMS shows at a time, with **synthetic** values; `Run.screen` makes one.

    Parameters
    ----------
    time : float
        When [s].
    table : pandas.DataFrame
        One row per point, by tag: ``box``, ``service``, ``value`` shown, ``unit``, ``true`` (what
        the sensor measures now), ``age_s`` of the value, and ``mark``: empty, ``0xFF``,
        ``too old``, or ``0xFF?`` for a good value that equals the code of an error. Value and age
        of what is marked are NaN.
    old : float, default 2
        Age from which a value that is shown as good counts as old [s].

    Notes
    -----
    In the printed coding a register holds whole units, an **assumption**: the width and the scale
    are not printed. So a temperature of 255 degC cannot be distinguished from an error. In the
    corrected coding a value is carried in tenths, and its mark apart from it.

    Examples
    --------
    >>> from shipnet import engine
    >>> dead = engine.faults.DeadBox("JB2", start=10)
    >>> run = engine.simulate(engine.System(), faults=dead, until=20)
    >>> run.screen(13)
    Screen(13 s: 99 points, 0 marked, 18 older than 2 s)
    >>> run.screen(14).mark("JB2"), run.screen(15).mark("JB2")
    ('', '0xFF')
    """

    def __init__(self, time: float, table: pd.DataFrame, old: float = RULE) -> None:
        self.time, self._table, self._old = time, table, old

    def table(self) -> pd.DataFrame:
        """Return all points: one row per tag."""
        return self._table.copy()

    def mark(self, box: str) -> str:
        """Return the mark of the first point of a box; empty if it is shown as good."""
        own = self._table.loc[self._table["box"] == box, "mark"]
        if own.empty:
            raise ArgumentError(
                f"box is {box!r}; it must be one of {', '.join(self._table['box'].unique())}"
            )
        return str(own.iloc[0])

    @property
    def marked(self) -> int:
        """How many points are marked."""
        return int((self._table["mark"] != "").sum())

    @property
    def old(self) -> int:
        """How many points are shown as good, but are older than the rule allows."""
        return int((self._table["age_s"] > self._old).sum())

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the points as tiles: good ones pale blue, old ones orange, marked ones dark.

        A real AMS in the printed coding would not know which values are old.
        """
        from shipnet.engine.plot import plot_screen

        return plot_screen(self._table, ax=ax, old=self._old)

    def __repr__(self) -> str:
        return (
            f"Screen({self.time:g} s: {len(self._table)} points, {self.marked} marked, "
            f"{self.old} older than {self._old:g} s)"
        )


def take_screen(run: Run, time: float, values: SyntheticValues) -> Screen:
    """Return what the AMS shows at a time."""
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
    return Screen(time, pd.DataFrame(rows, columns=columns).set_index("tag"))
