"""Exact confidence intervals for counted events: fractions of trials, and rates.

They are computed with `scipy.special`, because `scipy.stats` takes a second to load.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from shipnet.arrays import Floats
from shipnet.errors import ArgumentError


def share_interval(
    hits: npt.ArrayLike, trials: npt.ArrayLike, *, confidence: float = 0.95
) -> tuple[Floats, Floats]:
    """Return the Clopper-Pearson interval for a proportion; it is 0..1 if there are no trials.

    C. J. Clopper, E. S. Pearson, "The use of confidence or fiducial limits", Biometrika 26 (1934),
    404-413.
    """
    from scipy.special import betaincinv

    alpha = 1 - _confidence(confidence)
    x, n = np.asarray(hits, float), np.asarray(trials, float)
    with np.errstate(invalid="ignore"):
        low = np.where(x > 0, betaincinv(x, n - x + 1, alpha / 2), 0.0)
        high = np.where(x < n, betaincinv(x + 1, n - x, 1 - alpha / 2), 1.0)
    return np.asarray(low), np.asarray(high)


def event_interval(
    events: npt.ArrayLike, exposure: npt.ArrayLike, *, confidence: float = 0.95
) -> tuple[Floats, Floats]:
    """Return the interval for the rate of independent events per unit of `exposure`.

    F. Garwood, "Fiducial limits for the Poisson distribution", Biometrika 28 (1936), 437-442.
    """
    from scipy.special import gammaincinv

    alpha = 1 - _confidence(confidence)
    x, time = np.asarray(events, float), np.asarray(exposure, float)
    with np.errstate(invalid="ignore"):
        low = np.where(x > 0, gammaincinv(x, alpha / 2), 0.0) / time
    return np.asarray(low), np.asarray(gammaincinv(x + 1, 1 - alpha / 2) / time)


def _confidence(value: float) -> float:
    if not isinstance(value, float) or not 0 < value < 1:
        raise ArgumentError(f"confidence is {value!r}; it must be above 0 and below 1")
    return value
