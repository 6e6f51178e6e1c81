"""DVPos of the rule table: by how much the position changes, which no sensor reads."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

__all__ = ["WINDOW", "position_speed"]

Floats = npt.NDArray[np.float64]

#: Over how long the change of the position is taken [s]; the paper does not say.
WINDOW = 1.0


def position_speed(time: Floats, position: Floats, ran: npt.ArrayLike = np.inf) -> Floats:
    """Return how fast the position changes, up or down.

    Parameters
    ----------
    time : ndarray of float, shape (n_times,)
        Instants, rising [s].
    position : ndarray of float, shape (n_times, n_valves)
        Position then, in any unit.
    ran : array_like of float, shape (n_times, n_valves), optional
        For how long each motor has been running in its direction [s]; if omitted the speed counts
        whether it runs or not.

    Returns
    -------
    ndarray of float, shape (n_times, n_valves)
        Change since the last instant that is `WINDOW` or longer ago, divided by the time since
        [unit of `position` per second]; NaN where there is none, or the motor has not been running
        for `WINDOW`.

    Examples
    --------
    >>> time, position = np.arange(0, 2.5, 0.5), np.array([[0], [0], [5], [10], [10]])
    >>> position_speed(time, position)[:, 0].tolist()
    [nan, nan, 5.0, 10.0, 5.0]
    >>> position_speed(time, position, [[0], [0], [0.5], [1], [1.5]])[:, 0].tolist()
    [nan, nan, nan, 10.0, 5.0]
    """
    then = np.searchsorted(time, time - WINDOW + 1e-9) - 1
    speed = np.full(position.shape, np.nan)
    known = then >= 0
    lasted = (time[known] - time[then[known]])[:, np.newaxis]
    speed[known] = np.abs(position[known] - position[then[known]]) / lasted
    return np.where(np.asarray(ran) < WINDOW - 1e-9, np.nan, speed)
