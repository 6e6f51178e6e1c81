"""Pumps that wear out, as synthetic data, and their remaining life, predicted from a trend.

The law of wear, its rates and the noise are assumptions, and one predictor uses that law: what is
found here is an upper bound of what can be found on a ship.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cache
from math import inf, isnan, nan, sqrt
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from shipnet import style
from shipnet.ballast.actuator import Actuator, hydraulics, load_pressure, stroke_time
from shipnet.errors import ArgumentError
from shipnet.fields import check_scalar, check_whole
from shipnet.fuzzy.terms import Term

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes


Floats = npt.NDArray[np.float64]


#: A stroke may take so long [s]: row 0 of the rule table.
LIMIT = 10.0


#: Leaks that a stroke time is computed for; between them it is interpolated, to 1e-6 s.
_GRID = 2001


@dataclass(frozen=True, eq=False)
class Wear:
    """Valves whose pumps wear out, one row per stroke; `Wear.synthetic` makes such data.

    Parameters
    ----------
    rate : ndarray of float, shape (n_valves,)
        By how much the logarithm of the leak grows with a stroke.
    leak : ndarray of float, shape (n_strokes, n_valves)
        True leak [m3/(s Pa)].
    FP : ndarray of float, shape (n_strokes, n_valves)
        Median of the pump pressure in each stroke, as read [bar].
    stroke_time : ndarray of float, shape (n_strokes, n_valves)
        As read [s].
    life : ndarray of float, shape (n_valves,)
        True number of strokes until one takes 10 s.

    Examples
    --------
    >>> wear = Wear.synthetic(3, 400, rng=2024)
    >>> wear
    Wear(3 valves, 400 strokes, lives 282 to 339)
    >>> wear.predict(1, at=200)
    Prediction(valve 1 after 200 strokes: 140 more, 139 to 142)
    """

    rate: Floats
    leak: Floats
    FP: Floats
    stroke_time: Floats
    life: Floats

    @classmethod
    def synthetic(
        cls,
        n_valves: int = 256,
        n_strokes: int = 1000,
        *,
        rate: float = 2.6e-3,
        spread: float = 0.3,
        noise: tuple[float, float] = (0.1, 0.05),
        rng: Any,
    ) -> Wear:
        """Return synthetic data of pumps whose leak grows by a constant factor per stroke.

        The rates of growth, 1e-6..1 per stroke, have the median `rate` and the standard deviation
        `spread` of their logarithm; `noise` are the standard deviations of FP [bar] and of the
        stroke time [s].
        """
        generator = np.random.default_rng(rng)
        n = check_whole("n_valves", n_valves, 1, 10_000)
        strokes = check_whole("n_strokes", n_strokes, 1, 10**6)
        median = check_scalar("rate", rate, "", 1e-6, 1)
        sigma = check_scalar("spread", spread, "", 0, 2)
        sigmas = [check_scalar("noise", value, "", 0, 1e3) for value in noise]
        usual = Actuator()
        rates = median * np.exp(sigma * generator.standard_normal(n))
        exponent = rates * np.arange(strokes)[:, np.newaxis]
        # Beyond this no oil reaches the cylinder.
        leak = usual.pump_leak * np.exp(np.minimum(exponent, 12.0))
        pressure = mid_pressure(leak)
        grid = np.linspace(0.0, float(exponent.max(initial=0.0)) + 1e-9, _GRID)
        curve = replace(usual, pump_leak=usual.pump_leak * np.exp(np.minimum(grid, 12.0)))
        times = np.interp(exponent, grid, np.minimum(stroke_time(curve), 1e6))
        life = np.log(limit_leak() / usual.pump_leak) / rates
        return cls(
            rates,
            leak,
            pressure + sigmas[0] * generator.standard_normal(leak.shape),
            times + sigmas[1] * generator.standard_normal(leak.shape),
            life,
        )

    def __repr__(self) -> str:
        """Return the numbers of valves and strokes, and the shortest and longest life."""
        n = self.life.size
        return (
            f"Wear({n} valve{'s' if n != 1 else ''}, {len(self.FP)} strokes, "
            f"lives {self.life.min():.0f} to {self.life.max():.0f})"
        )

    def pressure(self, valve: int) -> Floats:
        """Return the pump pressure of one valve, as read in each stroke [bar]."""
        return np.asarray(self.FP[:, self._place(valve)])

    def alarms(self, *, k: int = 3, n: int = 5) -> pd.DataFrame:
        """Return the true life of each valve, and the stroke at which rules report it.

        ``P2`` is FP below 2.5 bar, ``T1`` (ours) a stroke longer than 10 s, each in `k` of the last
        `n` strokes; NaN if the rule never reports.
        """
        import pandas as pd

        window = check_whole("n", n, 1, 10_000)
        least = check_whole("k", k, 1, window)

        def first(fires: npt.NDArray[np.bool_]) -> Floats:
            total = np.cumsum(fires, axis=0)
            before = np.zeros_like(total)
            before[window:] = total[:-window]
            reported = np.asarray(total - before >= least)
            return np.where(reported.any(axis=0), reported.argmax(axis=0).astype(float), np.nan)

        return pd.DataFrame(
            {"life": self.life, "P2": first(self.FP < 2.5), "T1": first(self.stroke_time > LIMIT)},
            index=pd.RangeIndex(1, self.life.size + 1, name="valve"),
        )

    def predict(
        self, valve: int, at: int, *, predictor: str = "leak", window: int = 200
    ) -> Prediction:
        """Predict from the first `at` strokes, of which the last `window` count, how many are left.

        `predictor` is ``leak`` (pump leak from FP by the inverted model, its logarithm straight),
        ``stroke time`` or ``FP membership`` (both straight in the number of strokes).
        """
        k = self._place(valve)
        trend, remaining = predict_life(self, k, at, predictor=predictor, window=window)
        return Prediction(self, valve, at, predictor, trend, remaining)

    def predictions(self, at: int, *, predictor: str = "leak", window: int = 200) -> pd.DataFrame:
        """Return the strokes left of every valve after `at` strokes, indexed by ``valve``.

        ``remaining`` with its interval ``low`` to ``high``, and the ``true`` number.
        """
        import pandas as pd

        rows = {
            valve: self.predict(valve, at, predictor=predictor, window=window).remaining
            for valve in range(1, self.life.size + 1)
        }
        table = pd.DataFrame.from_dict(rows, orient="index", columns=["remaining", "low", "high"])
        table["true"] = self.life - at
        return table.rename_axis("valve")

    def life_table(self, valve: int = 1, at: Iterable[int] = (20, 50, 100, 200)) -> pd.DataFrame:
        """Return the strokes left of one valve, predicted after some numbers of ``strokes``."""
        import pandas as pd

        k = self._place(valve)
        rows = {now: (*self.predict(valve, now).remaining, self.life[k] - now) for now in at}
        columns = ["remaining", "low", "high", "true"]
        table = pd.DataFrame(rows, index=columns, dtype=float).T
        return table.rename_axis("strokes")

    def compare_predictors(
        self, parts: tuple[float, ...] = (0.3, 0.5, 0.7, 0.9), *, window: int = 200
    ) -> pd.DataFrame:
        """Compare the remaining life that each predictor gives with the true one.

        Indexed by ``predictor`` and ``part`` of the true life at which it predicts: number of
        ``valves``, share with a trend ``found``; quantiles ``p05``, ``median``, ``p95`` of the
        predicted over the true life; share ``within_20`` percent; share whose interval ``covers``
        the truth.
        """
        import pandas as pd

        index, rows = [], []
        for predictor in PREDICTORS:
            for part in parts:
                share = check_scalar("part", part, "", 1e-6, 1 - 1e-6)
                ratios, covers = [], []
                for valve, life in enumerate(self.life):
                    now = int(share * life)
                    if not _FEWEST <= now <= len(self.FP):
                        continue
                    left = predict_life(self, valve, now, predictor=predictor, window=window)[1]
                    ratios.append(left.estimate / (life - now))
                    covers.append(left.low <= life - now <= left.high)
                ratio = np.array(ratios, float)
                found = ratio[np.isfinite(ratio)]
                spread = np.quantile(found, [0.05, 0.5, 0.95]) if found.size else [np.nan] * 3
                n = max(ratio.size, 1)
                near = (np.abs(found - 1) <= 0.2).sum() / n
                rows.append((ratio.size, found.size / n, *spread, near, sum(covers) / n))
                index.append((predictor, part))
        return pd.DataFrame(
            rows,
            columns=["valves", "found", "p05", "median", "p95", "within_20", "covers"],
            index=pd.MultiIndex.from_tuples(index, names=["predictor", "part"]),
        )

    def _place(self, valve: int) -> int:
        return check_whole("valve", valve, 1, self.life.size) - 1


@dataclass(frozen=True, eq=False)
class Prediction:
    """The strokes that a worn pump has left, from the trend of its first strokes."""

    wear: Wear
    valve: int
    at: int
    predictor: str
    trend: Trend
    remaining: Crossing

    def __repr__(self) -> str:
        """Return the strokes left with their interval."""
        left = self.remaining
        said = f"{left.estimate:.0f} more, {left.low:.0f} to {left.high:.0f}"
        what = said if self.trend.found else self.trend.text
        return f"Prediction(valve {self.valve} after {self.at} strokes: {what})"

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw what was read, its trend with the interval, and the limit."""
        strokes, k = np.arange(self.at), self.valve - 1
        pressure = self.wear.FP[: self.at, k]
        shown: dict[str, tuple[Floats, float, str]] = {
            "leak": (leak_from_pressure(pressure), limit_leak(), "leak of the pump [m3/(s Pa)]"),
            "stroke time": (self.wear.stroke_time[: self.at, k], LIMIT, "stroke time [s]"),
            "FP membership": (
                WORN.membership(pressure),
                float(WORN.membership(mid_pressure(limit_leak()))),
                "membership of FP in worn [1]",
            ),
        }
        values, limit, label = shown[self.predictor]
        axes = self.trend.plot(strokes, values, limit=limit, ax=ax)
        axes.set(xlabel="stroke", ylabel=label)
        return axes


@cache
def limit_leak(limit: float = LIMIT) -> float:
    """Return the leak of the pump at which a stroke takes as long as it may."""
    from scipy.optimize import brentq

    time = check_scalar("limit", limit, "s", 9.1, 1000)
    usual = Actuator()

    def late(log_factor: float) -> float:
        worn = replace(usual, pump_leak=usual.pump_leak * np.exp(log_factor))
        # A valve that stops is later than any limit.
        return min(float(stroke_time(worn)), 1e6) - time

    return float(usual.pump_leak * np.exp(brentq(late, 0.0, 10.0, xtol=1e-10)))


def leak_from_pressure(pressure: npt.ArrayLike, actuator: Actuator | None = None) -> Floats:
    """Return the leak of a pump from its pressure in the middle of a stroke."""
    a = actuator if actuator is not None else Actuator()
    p = 1e5 * np.asarray(pressure, float)
    load = load_pressure(a, 0.5)
    legal = (p > load) & (p <= a.relief_pressure)
    known = np.where(legal, p, np.nan)
    pumped = np.asarray(a.displacement) * a.speed
    return np.asarray((pumped - a.restrictor * np.sqrt(known - load)) / known)


def mid_pressure(leak: npt.ArrayLike) -> Floats:
    """Return the pump pressure of the usual valve, half open, for leaks of any shape."""
    leaks = np.asarray(leak, float)
    worn = replace(Actuator(), pump_leak=leaks.reshape(-1))
    state = hydraulics(worn, load_pressure(worn, 0.5))
    return np.asarray(state.pump_pressure / 1e5).reshape(leaks.shape)


#: How a trend is fitted, and on which scale it is straight.
METHODS = {
    "theil-sen": "median of all slopes between two points; Kendall's test",
    "linear": "least squares; t test",
    "log-linear": "least squares of the logarithm; t test",
}


class Crossing(NamedTuple):
    """Where a trend reaches a limit."""

    estimate: float
    low: float
    high: float


@dataclass(frozen=True, slots=True)
class Trend:
    """A straight line through points, or that there is none."""

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
        """Return the line."""
        return self._back(self.centre[1] + self.slope * (np.asarray(x, float) - self.centre[0]))

    def band(self, x: npt.ArrayLike) -> tuple[Floats, Floats]:
        """Return the interval of the line."""
        u = np.asarray(x, float) - self.centre[0]
        one, other = (self._side(u, side) for side in (-1, 1))
        return self._back(np.minimum(one, other)), self._back(np.maximum(one, other))

    def crossing(self, limit: float) -> Crossing:
        """Return where the line reaches a limit, and within which x it may."""
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

    def plot(
        self, x: npt.ArrayLike, y: npt.ArrayLike, *, limit: float, ax: Axes | None = None
    ) -> Axes:
        """Draw points, this trend of them with its interval, and the limit that it runs to."""
        ax = style.axes(ax)
        places, values = np.asarray(x, float), np.asarray(y, float)
        ax.plot(places, values, ".", color="C0", markersize=3, label="read")
        ax.axhline(limit, **style.LIMIT, linewidth=1, label="limit")  # type: ignore[arg-type]
        found = self.crossing(limit)
        first, last = float(places.min()), float(places.max())
        if self.found:
            # A crossing far away, or in the past, does not set the scale.
            far = first + 5 * (last - first)
            end = found.estimate if last < found.estimate < far else last
            stop = end + 0.25 * (end - first)
            grid = np.linspace(first, stop, 200)
            low, high = self.band(grid)
            ax.plot(grid, self.at(grid), color="C2", label="trend")
            share = f"{100 * self.confidence:g} % of it"
            ax.fill_between(grid, low, high, color="C2", alpha=0.25, linewidth=0, label=share)
            ax.set_xlim(first, stop)
            if found.estimate <= stop:
                ends = np.array([[found.estimate - found.low], [found.high - found.estimate]])
                ax.errorbar(
                    [found.estimate], [limit], xerr=np.clip(ends, 0, stop), fmt="o", color="C2",
                    capsize=4, markersize=5, label="end of life",
                )  # fmt: skip
        else:
            ax.plot([], [], " ", label="no trend")
        if self.method == "log-linear":
            ax.set_yscale("log")
        ax.legend(fontsize=8)
        return ax

    def _side(self, u: Floats, side: int) -> Floats:
        if self.method == "theil-sen":
            slope = self.slope_high if side > 0 else self.slope_low
            return np.asarray(self.centre[1] + slope * u)
        w = (self.slope_high - self.slope_low) / 2
        return np.asarray(self.centre[1] + self.slope * u + side * np.hypot(self.margin, w * u))

    def _back(self, y: Floats) -> Floats:
        return np.asarray(np.exp(y) if self.method == "log-linear" else y)


def remaining_life(trend: Trend, limit: float, now: float, *, worse: str = "rising") -> Crossing:
    """Return how long it takes from now on until a trend reaches a limit."""
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
    """Fit a trend to points."""
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


#: A set for FP [bar] that spans all between its normal value and the limit of rule P2; ours.
WORN = Term("worn", (-inf, -inf, 2.5, 90.0), "x < 2.5", "worn")


#: What the remaining life is predicted from, and how.
PREDICTORS = {
    "FP membership": "membership of FP in the set worn, straight in the number of strokes",
    "stroke time": "stroke time, straight in the number of strokes",
    "leak": "pump leak from FP by the inverted model, its logarithm straight",
}


#: Strokes without which no prediction is tried.
_FEWEST = 10


def predict_life(
    wear: Wear, valve: int, now: int, *, predictor: str = "leak", window: int = 200
) -> tuple[Trend, Crossing]:
    """Return the trend of the strokes so far, and how many are left within the limit."""
    if predictor not in PREDICTORS:
        raise ArgumentError(
            f"predictor is {predictor!r}; it must be one of {', '.join(PREDICTORS)}"
        )
    k = check_whole("valve", valve, 0, wear.life.size - 1)
    last = check_whole("now", now, _FEWEST, len(wear.FP))
    rows = slice(max(last - check_whole("window", window, _FEWEST, 10**6), 0), last)
    strokes = np.arange(rows.start, rows.stop)
    if predictor == "stroke time":
        trend = fit_trend(strokes, wear.stroke_time[rows, k], method="linear")
        return trend, remaining_life(trend, LIMIT, last)
    worn = limit_leak()
    if predictor == "leak":
        leaks = leak_from_pressure(wear.FP[rows, k])
        # Noise may leave a new pump without a leak, which has no logarithm.
        trend = fit_trend(strokes, np.where(leaks > 0, leaks, np.nan), method="log-linear")
        return trend, remaining_life(trend, worn, last)
    trend = fit_trend(strokes, WORN.membership(wear.FP[rows, k]), method="linear")
    limit = float(WORN.membership(mid_pressure(worn)))
    return trend, remaining_life(trend, limit, last)
