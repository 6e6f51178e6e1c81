"""Confidence intervals for counted events: shares of trials, and rates.

They use `scipy.special`, because `scipy.stats` takes a second to load.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from shipnet.arrays import Floats
from shipnet.errors import ArgumentError


def share_interval(
    hits: npt.ArrayLike, trials: npt.ArrayLike, *, confidence: float = 0.95
) -> tuple[Floats, Floats]:
    """Return the ends of the Clopper-Pearson interval for a share; no trials leave 0..1.

    It covers the true share with at least this `confidence`. C. J. Clopper, E. S. Pearson, "The use
    of confidence or fiducial limits", Biometrika 26 (1934), 404-413.
    """
    from scipy.special import betaincinv

    alpha = 1 - _confidence(confidence)
    x, n = _counts("hits", hits), _counts("trials", trials)
    if (x > n).any():
        raise ArgumentError(f"hits is {hits!r} of {trials!r} trials; it must not be more")
    with np.errstate(invalid="ignore"):
        low = np.where(x > 0, betaincinv(x, n - x + 1, alpha / 2), 0.0)
        high = np.where(x < n, betaincinv(x + 1, n - x, 1 - alpha / 2), 1.0)
    return np.asarray(low), np.asarray(high)


def event_interval(
    events: npt.ArrayLike, exposure: npt.ArrayLike, *, confidence: float = 0.95
) -> tuple[Floats, Floats]:
    """Return the ends of the exact interval for the rate of independent events.

    `exposure` is how long they were counted, in any unit. F. Garwood, "Fiducial limits for the
    Poisson distribution", Biometrika 28 (1936), 437-442.
    """
    from scipy.special import gammaincinv

    alpha = 1 - _confidence(confidence)
    x, time = _counts("events", events), np.asarray(exposure, float)
    if not ((time > 0) & np.isfinite(time)).all():
        raise ArgumentError(f"exposure is {exposure!r}; it must be above 0")
    with np.errstate(invalid="ignore"):
        low = np.where(x > 0, gammaincinv(x, alpha / 2), 0.0) / time
    return np.asarray(low), np.asarray(gammaincinv(x + 1, 1 - alpha / 2) / time)


def _confidence(value: float) -> float:
    if not isinstance(value, float) or not 0 < value < 1:
        raise ArgumentError(f"confidence is {value!r}; it must be above 0 and below 1")
    return value


def _counts(name: str, values: npt.ArrayLike) -> Floats:
    try:
        counts = np.asarray(values, float)
    except (TypeError, ValueError):
        counts = np.array(np.nan)
    if not ((counts >= 0) & (counts == np.floor(counts)) & np.isfinite(counts)).all():
        raise ArgumentError(f"{name} is {values!r}; it must be whole numbers, 0 or more")
    return counts
