"""What a run of a motor says in one row: stroke time, pressures, current, temperature."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from shipnet.ballast.simulation import Run
from shipnet.errors import ArgumentError

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["command_features", "running_time"]

Floats = npt.NDArray[np.float64]

#: Shorter ways than this say little about a whole stroke [%]; our choice.
_SHORTEST = 20.0


def running_time(run: Run, before: npt.ArrayLike = np.nan) -> Floats:
    """Return for how long each motor has been running in its direction.

    Parameters
    ----------
    run : Run
        What was read.
    before : array_like of float, shape () or (n_valves,), default NaN
        When a motor that runs at the first instant was started [s]; NaN is then.

    Returns
    -------
    ndarray of float, shape (n_times, n_valves)
        Time since the start [s]; NaN while it does not run.

    Examples
    --------
    >>> from shipnet.ballast import Command, simulate
    >>> run = simulate(commands=[Command("open", 1.0), Command("close", 3.0)], duration=4, step=0.5)
    >>> running_time(run)[:, 0].tolist()
    [nan, nan, 0.0, 0.5, 1.0, 1.5, 0.0, 0.5, 1.0]
    """
    running, time = run.running, run.time
    if not time.size:
        return np.full(running.shape, np.nan)
    starts = running.copy()
    starts[1:] &= ~running[:-1]
    # A motor that was running before goes on, unless it has been told otherwise.
    goes_on = running[0] & np.isfinite(np.asarray(before, float))
    for moved in run.movements:
        # One that runs at the first instant after its end has been started again there.
        row = int(np.searchsorted(time, moved.end - 1e-9))
        if row < time.size and running[row, moved.valve]:
            starts[row, moved.valve] = True
            goes_on[moved.valve] &= row > 0
    began = np.where(starts, time[:, np.newaxis], -np.inf)
    began[0] = np.where(goes_on, before, began[0])
    since = time[:, np.newaxis] - np.maximum.accumulate(began, axis=0)
    return np.where(running, since, np.nan)


def command_features(run: Run) -> pd.DataFrame:
    """Return one row for every run of a motor that has ended, from what sensors and clock say.

    Parameters
    ----------
    run : Run
        What was read.

    Returns
    -------
    pandas.DataFrame
        ``valve``, ``action``, ``start_s``, ``end_s``, ``outcome``; ``duration_s``;
        ``travel_percent`` of VPos; ``stroke_s``, the time of a whole stroke at that speed; medians
        ``FP_bar``, ``MC_A`` and maxima ``OP_max_bar``, ``OT_max_degC`` while the motor ran. NaN
        where nothing was read meanwhile; ``stroke_s`` is NaN too for a way of less than 20 %.

    Examples
    --------
    >>> from shipnet.ballast import Command, simulate
    >>> row = command_features(simulate(commands=[Command("open")], duration=10)).iloc[0]
    >>> row[["stroke_s", "FP_bar", "MC_A"]].astype(float).round(2).to_dict()
    {'stroke_s': 9.0, 'FP_bar': 89.9, 'MC_A': 1.2}
    """
    import pandas as pd

    strokes = run.strokes
    rows = np.full((len(strokes), 5), np.nan)
    for row, moved in zip(rows, run.movements, strict=True):
        first, last = np.searchsorted(run.time, [moved.start - 1e-9, moved.end + 1e-9])
        if last - first < 1:
            continue
        seen = run.readings[first:last, :, moved.valve]
        # The reading after the end is that of the place where it stopped.
        place = run.readings[min(last, run.time.size - 1), 4, moved.valve]
        row[0] = abs(place - seen[0, 4])
        row[1:3] = np.median(seen[:, [0, 2]], axis=0)
        row[3:5] = seen[:, [1, 3]].max(axis=0)
    names = ["travel_percent", "FP_bar", "MC_A", "OP_max_bar", "OT_max_degC"]
    table = strokes.drop(columns="opening").join(pd.DataFrame(rows, columns=names))
    far = table["travel_percent"].where(table["travel_percent"] >= _SHORTEST)
    table["stroke_s"] = 100 * table["duration_s"] / far
    return table


def valve_row(run: Run, time: float) -> int:
    """Return the last instant that is not after a time.

    Parameters
    ----------
    run : Run
        What was read.
    time : float
        Time [s].

    Returns
    -------
    int
        Its row.

    Raises
    ------
    ArgumentError
        If the run begins later, or time is no number.

    Examples
    --------
    >>> from shipnet.ballast import simulate
    >>> valve_row(simulate(duration=2), 0.35)
    3
    """
    if not run.time.size:
        raise ArgumentError(f"time is {time!r}; the run has no instants")
    if not isinstance(time, int | float | np.number) or not time >= run.time[0] - 1e-9:
        raise ArgumentError(
            f"time is {time!r} s; it must be a number, and the run begins at {run.time[0]:g} s"
        )
    return int(np.searchsorted(run.time, time + 1e-9, side="right")) - 1
