"""Trends, and when they reach a limit: with an interval, or the answer that there is none."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf, isnan, nan, sqrt
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from shipnet.errors import ArgumentError
from shipnet.fields import check_scalar

__all__ = ["METHODS", "Crossing", "Trend", "fit_trend", "remaining_life"]

Floats = npt.NDArray[np.float64]

#: How a trend is fitted, and on which scale it is straight.
METHODS = {
    "theil-sen": "median of all slopes between two points; Kendall's test",
    "linear": "least squares; t test",
    "log-linear": "least squares of the logarithm; t test",
}


class Crossing(NamedTuple):
    """Where a trend reaches a limit.

    Attributes
    ----------
    estimate : float
        Where the line does, also if that is past; NaN if there is no trend.
    low, high : float
        Interval; NaN and inf if there is no trend.
    """

    estimate: float
    low: float
    high: float


@dataclass(frozen=True, slots=True)
class Trend:
    """A straight line through points, or that there is none.

    Parameters
    ----------
    method : str
        One of `METHODS`.
    slope, slope_low, slope_high : float
        Change for each unit of x, with its interval; of the logarithm if log-linear.
    centre : tuple of float
        x and y of the point that the line goes through: means, or medians if Theil-Sen.
    p_value : float
        Probability of such a trend, or a steeper one, without any; of both signs.
    confidence : float
        Of the intervals; a trend is found if `p_value` is below 1 - confidence.
    n : int
        Number of points.
    margin : float
        Half-width of the interval of the line at the centre; 0 if Theil-Sen, which has none.
    median : float
        Median of the points, on their own scale.
    """

    method: str
    slope: float
    slope_low: float
    slope_high: float
    centre: tuple[float, float]
    p_value: float
    confidence: float
    n: int
    margin: float
    median: float

    @property
    def found(self) -> bool:
        """Whether there is a trend, at this confidence."""
        return self.p_value < 1 - self.confidence

    @property
    def text(self) -> str:
        """The trend in one line."""
        if not self.found:
            return f"no trend in {self.n} points (p = {self.p_value:.2g})"
        per = " of the logarithm" if self.method == "log-linear" else ""
        return (
            f"slope{per} {self.slope:.3g}, {100 * self.confidence:g} % within "
            f"{self.slope_low:.3g} to {self.slope_high:.3g} (p = {self.p_value:.2g})"
        )

    def at(self, x: npt.ArrayLike) -> Floats:
        """Return the line.

        Parameters
        ----------
        x : array_like of float
            Where.

        Returns
        -------
        ndarray of float
            Its values, on the scale of the points.
        """
        return self._back(self.centre[1] + self.slope * (np.asarray(x, float) - self.centre[0]))

    def band(self, x: npt.ArrayLike) -> tuple[Floats, Floats]:
        """Return the interval of the line.

        Parameters
        ----------
        x : array_like of float
            Where.

        Returns
        -------
        low, high : ndarray of float
            Ends, on the scale of the points.
        """
        u = np.asarray(x, float) - self.centre[0]
        one, other = (self._side(u, side) for side in (-1, 1))
        return self._back(np.minimum(one, other)), self._back(np.maximum(one, other))

    def crossing(self, limit: float) -> Crossing:
        r"""Return where the line reaches a limit, and within which x it may.

        Parameters
        ----------
        limit : float
            A value on the scale of the points.

        Returns
        -------
        Crossing
            In units of x; an end of the interval lies where that end of `band` reaches the limit.

        Raises
        ------
        ArgumentError
            If `limit` is no number, or not above 0 if log-linear.

        Notes
        -----
        For least squares this is the interval of E. C. Fieller, "Some problems in interval
        estimation", J. Roy. Statist. Soc. B 16 (1954), 175-185: the u = x - centre with

        .. math:: \left( y + b u - L \right)^2 \le m^2 + w^2 u^2

        where m is `margin` and w half the interval of the slope b.

        Examples
        --------
        >>> line = fit_trend([0, 1, 2, 3, 4], [1.0, 2.1, 2.9, 4.0, 5.1], method="linear")
        >>> [round(x, 1) for x in line.crossing(10.0)]
        [8.9, 8.3, 9.6]
        """
        goal = check_scalar("limit", limit, "", -1e300, 1e300)
        if self.method == "log-linear":
            if goal <= 0:
                raise ArgumentError(f"limit is {limit!r}; it must be above 0 for a logarithm")
            goal = float(np.log(goal))
        if not self.found:
            return Crossing(nan, nan, inf)
        gap, x = goal - self.centre[1], self.centre[0]
        estimate = x + gap / self.slope
        if self.method == "theil-sen":
            slopes = [self.slope_low, self.slope_high]
            if slopes[0] * slopes[1] <= 0:
                # Kendall's test is surer than the interval: one end is as good as flat.
                steepest = x + gap / max(slopes, key=abs)
                return Crossing(estimate, min(steepest, estimate), inf)
            return Crossing(estimate, *sorted(x + gap / slope for slope in slopes))
        w = (self.slope_high - self.slope_low) / 2
        square = self.slope**2 - w**2  # above 0, for the trend is significant
        root = w**2 * gap**2 + self.margin**2 * square
        ends = [(self.slope * gap + side * sqrt(root)) / square for side in (-1, 1)]
        return Crossing(estimate, x + ends[0], x + ends[1])

    def _side(self, u: Floats, side: int) -> Floats:
        if self.method == "theil-sen":
            slope = self.slope_high if side > 0 else self.slope_low
            return np.asarray(self.centre[1] + slope * u)
        w = (self.slope_high - self.slope_low) / 2
        return np.asarray(self.centre[1] + self.slope * u + side * np.hypot(self.margin, w * u))

    def _back(self, y: Floats) -> Floats:
        return np.asarray(np.exp(y) if self.method == "log-linear" else y)


def remaining_life(trend: Trend, limit: float, now: float, *, worse: str = "rising") -> Crossing:
    """Return how long it takes from now on until a trend reaches a limit.

    Parameters
    ----------
    trend : Trend
        What was fitted.
    limit : float
        A value on the scale of the points.
    now : float
        The present, in units of x.
    worse : {"rising", "falling"}, default "rising"
        In which direction the limit is approached.

    Returns
    -------
    Crossing
        In units of x from now on. 0 throughout if the line has passed the limit at `now`, or
        without a trend the median of the points has; else NaN, NaN, inf if there is no trend, and
        inf throughout if it leads the other way.

    Raises
    ------
    ArgumentError
        If an argument is not as above.

    Examples
    --------
    >>> line = fit_trend([0, 1, 2, 3, 4], [1.0, 2.1, 2.9, 4.0, 5.1], method="linear")
    >>> [round(x, 1) for x in remaining_life(line, 10.0, now=4)]
    [4.9, 4.3, 5.6]
    >>> remaining_life(line, 0.0, now=4, worse="falling").estimate
    inf
    >>> remaining_life(line, 0.0, now=4).estimate
    0.0
    """
    if worse not in ("rising", "falling"):
        raise ArgumentError(f"worse is {worse!r}; it must be rising or falling")
    present = check_scalar("now", now, "", -1e300, 1e300)
    found = trend.crossing(limit)
    # Without a trend its slope says nothing: the level counts.
    level = trend.at(present) if trend.found else trend.median
    if (level >= limit) if worse == "rising" else (level <= limit):
        return Crossing(0.0, 0.0, 0.0)
    if not trend.found:
        return found
    if (trend.slope > 0) != (worse == "rising"):
        return Crossing(inf, inf, inf)
    return Crossing(*(max(x - present, 0.0) for x in found))


def fit_trend(
    x: npt.ArrayLike,
    y: npt.ArrayLike,
    *,
    method: str = "theil-sen",
    confidence: float = 0.95,
) -> Trend:
    """Fit a trend to points.

    Parameters
    ----------
    x : array_like of float, shape (n,)
        Such as the number of the stroke.
    y : array_like of float, shape (n,)
        Such as a pressure; points with NaN are left out.
    method : str, default "theil-sen"
        One of `METHODS`.
    confidence : float, default 0.95
        Of the intervals, and of there being a trend at all; above 0, below 1.

    Returns
    -------
    Trend
        The line; ``found`` says whether there is one.

    Raises
    ------
    ArgumentError
        If fewer than 5 points, or fewer than 2 different x, are left, or an argument is not as
        above; a logarithm needs y above 0.

    Notes
    -----
    Both tests take the errors of the points as independent; errors that follow each other make a
    trend look more certain than it is. Theil-Sen stays right with up to 29 % of wild points: P. K.
    Sen, "Estimates of the regression coefficient based on Kendall's tau", J. Amer. Statist. Assoc.
    63 (1968), 1379-1389.

    Examples
    --------
    >>> strokes = np.arange(40)
    >>> noise = np.random.default_rng(2024).normal(0, 0.5, 40)
    >>> fit_trend(strokes, 90 + noise).text
    'no trend in 40 points (p = 0.58)'
    >>> worn = fit_trend(strokes, 90 - 0.2 * strokes + noise)
    >>> worn.found, round(worn.slope, 2)
    (True, -0.21)
    """
    if method not in METHODS:
        raise ArgumentError(f"method is {method!r}; it must be one of {', '.join(METHODS)}")
    if not isinstance(confidence, float) or not 0 < confidence < 1:
        raise ArgumentError(f"confidence is {confidence!r}; it must be above 0 and below 1")
    places, values = _points(x, y, positive=method == "log-linear")
    n = places.size
    middle = float(np.median(values))
    median = float(np.exp(middle)) if method == "log-linear" else middle
    if np.ptp(values) == 0:
        # All alike: no test can say anything, and there is nothing to say.
        return Trend(
            method, 0.0, 0.0, 0.0, (float(np.median(places)), float(values[0])), 1.0, confidence, n,
            0.0, median,
        )  # fmt: skip
    if method == "theil-sen":
        from scipy.stats import kendalltau, theilslopes  # a second, which a line does without

        slope, _, low, high = theilslopes(values, places, alpha=confidence)
        p_value = float(kendalltau(places, values).pvalue)
        centre, margin = (float(np.median(places)), float(np.median(values))), 0.0
    else:
        from scipy.special import stdtr, stdtrit

        # The squares of both must be numbers above 0.
        if not (1e-100 < np.ptp(places) < 1e100 and 1e-100 < np.ptp(values) < 1e100):
            raise ArgumentError(
                f"x and y span {np.ptp(places):g} and {np.ptp(values):g}; it must be 1e-100..1e100"
            )
        centre = float(places.mean()), float(values.mean())
        away = places - centre[0]
        spread = float(away @ away)
        slope = float(away @ (values - centre[1])) / spread
        rest = values - centre[1] - slope * away
        deviation = sqrt(float(rest @ rest) / (n - 2))
        error = deviation / sqrt(spread)
        wide = float(stdtrit(n - 2, (1 + confidence) / 2))
        p_value = 2 * float(stdtr(n - 2, -abs(slope) / error)) if error else 0.0
        low, high = slope - wide * error, slope + wide * error
        margin = wide * deviation / sqrt(n)
    # A straight line without errors leaves 0 / 0.
    p_value = 0.0 if isnan(p_value) else p_value
    return Trend(
        method,
        float(slope),
        float(low),
        float(high),
        centre,
        p_value,
        confidence,
        n,
        margin,
        median,
    )


def _points(x: npt.ArrayLike, y: npt.ArrayLike, *, positive: bool) -> tuple[Floats, Floats]:
    try:
        places, values = np.asarray(x, float), np.asarray(y, float)
    except (TypeError, ValueError):
        raise ArgumentError("x and y must be rows of numbers, NaN where one is missing") from None
    if places.ndim != 1 or places.shape != values.shape:
        raise ArgumentError(
            f"x and y have the shapes {places.shape} and {values.shape}; they must be equal rows"
        )
    known = ~(np.isnan(places) | np.isnan(values))
    places, values = places[known], values[known]
    if places.size < 5 or np.unique(places).size < 2:
        raise ArgumentError(f"x has {places.size} points; it must have 5 or more, not all at one x")
    if not (np.isfinite(places).all() and np.isfinite(values).all()):
        raise ArgumentError("x and y must be finite, or NaN where a point is missing")
    if positive:
        if not (values > 0).all():
            raise ArgumentError(f"y is down to {values.min():g}; a logarithm needs it above 0")
        values = np.log(values)
    return places, values
