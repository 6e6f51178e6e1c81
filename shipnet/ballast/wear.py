"""Synthetic data on pumps that wear out, and prediction of their remaining life from a trend.

The law of wear, its rates and the noise are assumptions, and one predictor uses that law, so the
results are an upper bound on the accuracy possible on a ship.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cache
from itertools import product
from math import inf, nan, sqrt
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from shipnet import style
from shipnet.arrays import Bools, Floats
from shipnet.ballast.actuator import Actuator, hydraulics, load_pressure, stroke_time
from shipnet.errors import ArgumentError
from shipnet.fields import check_choice, check_rng, check_scalar, check_whole
from shipnet.fuzzy.firing import persistent
from shipnet.fuzzy.terms import Term
from shipnet.lazy import Axes, pd

#: Longest stroke time of a healthy valve [s], from row 0 of the rule table.
LIMIT = 10.0

#: Number of leaks for which stroke times are computed; the interpolation error is 1e-6 s.
_GRID = 2001


@dataclass(frozen=True, eq=False)
class Wear:
    """Data on valves whose pumps wear out, such as those that `Wear.synthetic` creates.

    Parameters
    ----------
    rate : ndarray of float, shape (n_valves,)
        Growth per stroke of the logarithm of the leak.
    leak : ndarray of float, shape (n_strokes, n_valves)
        True leak [m3/(s Pa)].
    FP : ndarray of float, shape (n_strokes, n_valves)
        Median reading of the pump pressure in each stroke [bar].
    stroke_time : ndarray of float, shape (n_strokes, n_valves)
        Measured time of each stroke [s].
    life : ndarray of float, shape (n_valves,)
        True number of strokes until the stroke time reaches 10 s.

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
        """Return synthetic data on pumps whose leak grows by a constant factor per stroke.

        `rate` is the median of the growth rates, 1e-6..1 per stroke, and `spread` the standard
        deviation of their logarithm, 0..2. `noise` contains the standard deviations, 0..1000, of
        the noise of FP [bar] and of the stroke time [s].
        """
        generator = check_rng(rng)
        n = check_whole("n_valves", n_valves, 1, 10_000)
        strokes = check_whole("n_strokes", n_strokes, 1, 10**6)
        median = check_scalar("rate", rate, "", 1e-6, 1)
        sigma = check_scalar("spread", spread, "", 0, 2)
        sigmas = [check_scalar("noise", value, "", 0, 1e3) for value in noise]
        usual = Actuator()
        rates = median * np.exp(sigma * generator.standard_normal(n))
        exponent = rates * np.arange(strokes)[:, np.newaxis]
        # The leak is limited to a value at which no oil reaches the cylinder.
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
        n = self.life.size
        return (
            f"Wear({n} valve{'s' if n != 1 else ''}, {len(self.FP)} strokes, "
            f"lives {self.life.min():.0f} to {self.life.max():.0f})"
        )

    def pressure(self, valve: int) -> Floats:
        """Return the pump pressure readings of one valve, one per stroke [bar]."""
        return np.asarray(self.FP[:, self._place(valve)])

    def alarms(self) -> pd.DataFrame:
        """Return the true life of each valve, and the stroke at which each rule reports the wear.

        Rule ``P2`` is FP below 2.5 bar, and ``T1`` (ours) a stroke time above 10 s. A rule reports
        the wear when it applies to three of the last five strokes; NaN if it never does.
        """

        def first(fires: Bools) -> Floats:
            reported = persistent(fires, 3, 5)
            return np.where(reported.any(axis=0), reported.argmax(axis=0).astype(float), np.nan)

        return pd.DataFrame(
            {"life": self.life, "P2": first(self.FP < 2.5), "T1": first(self.stroke_time > LIMIT)},
            index=pd.RangeIndex(1, self.life.size + 1, name="valve"),
        )

    def predict(self, valve: int, at: int, *, predictor: str = "leak") -> Prediction:
        """Predict the strokes left after `at` strokes, of which at most the last 200 are used.

        A straight line is fitted to the `predictor`: ``stroke time``, ``FP membership``, or the
        logarithm of ``leak``, the pump leak computed from FP by the inverted model.
        """
        k = self._place(valve)
        check_choice("predictor", predictor, PREDICTORS)
        last = check_whole("at", at, _FEWEST, len(self.FP))
        strokes = slice(max(last - _WINDOW, 0), last)
        values, limit, _ = self._indicator(predictor, strokes, k)
        places = np.arange(strokes.start, last)
        trend = fit_trend(places, values, logarithmic=predictor == "leak")
        return Prediction(self, k + 1, last, predictor, trend, remaining_life(trend, limit, last))

    def predictions(self, at: int) -> pd.DataFrame:
        """Return the strokes left for each valve after `at` strokes, indexed by ``valve``.

        The prediction ``remaining`` has the interval ``low`` to ``high``; ``true`` is the actual
        number.
        """
        rows = {valve: self.predict(valve, at).remaining for valve in range(1, self.life.size + 1)}
        table = pd.DataFrame.from_dict(rows, orient="index", columns=["remaining", "low", "high"])
        table["true"] = self.life - at
        return table.rename_axis("valve")

    def life_table(self, valve: int = 1, at: Iterable[int] = (20, 50, 100, 200)) -> pd.DataFrame:
        """Return the predicted and true remaining life of one valve, indexed by ``strokes``."""
        k = self._place(valve)
        rows = {now: (*self.predict(valve, now).remaining, self.life[k] - now) for now in at}
        columns = ["remaining", "low", "high", "true"]
        table = pd.DataFrame(rows, index=columns, dtype=float).T
        return table.rename_axis("strokes")

    def compare_predictors(self, parts: tuple[float, ...] = (0.3, 0.5, 0.7, 0.9)) -> pd.DataFrame:
        """Compare the remaining life that each predictor gives with the true remaining life.

        Indexed by ``predictor`` and by the ``part`` of the true life that has passed. Columns: the
        number of ``valves``; the fraction with a finite prediction, ``found``; quantiles of the
        ratio of predicted to true remaining life; the fraction ``within_20`` percent of the true
        remaining life; and the fraction whose interval ``covers`` it.
        """
        rows = []
        for predictor, part in product(PREDICTORS, parts):
            share = check_scalar("part", part, "", 1e-6, 1 - 1e-6)
            nows = [int(share * life) for life in self.life]
            valves = [k for k, now in enumerate(nows) if _FEWEST <= now <= len(self.FP)]
            left = [self.predict(k + 1, nows[k], predictor=predictor).remaining for k in valves]
            estimate, low, high = np.array(left).reshape(-1, 3).T
            true = self.life[valves] - np.array(nows)[valves]
            ratio = estimate / true
            finite = ratio[np.isfinite(ratio)]
            spread = np.quantile(finite, [0.05, 0.5, 0.95]) if finite.size else [np.nan] * 3
            hits = np.isfinite(ratio), np.abs(ratio - 1) <= 0.2, (low <= true) & (true <= high)
            predicted, near, covers = (hit.sum() / max(len(valves), 1) for hit in hits)
            rows.append((predictor, part, len(valves), predicted, *spread, near, covers))
        titles = ["valves", "found", "p05", "median", "p95", "within_20", "covers"]
        table = pd.DataFrame(rows, columns=["predictor", "part", *titles])
        return table.set_index(["predictor", "part"])

    def _place(self, valve: int) -> int:
        return check_whole("valve", valve, 1, self.life.size) - 1

    def _indicator(self, predictor: str, rows: slice, k: int) -> tuple[Floats, float, str]:
        """Return the values that a predictor extrapolates, with their limit and name."""
        if predictor == "stroke time":
            return self.stroke_time[rows, k], LIMIT, "stroke time [s]"
        pressure = self.FP[rows, k]
        if predictor == "leak":
            return leak_from_pressure(pressure), limit_leak(), "leak [10⁻¹² m³/(s Pa)]"
        worn = float(WORN.membership(mid_pressure(limit_leak())))
        return WORN.membership(pressure), worn, "membership of FP in worn"


@dataclass(frozen=True, eq=False)
class Prediction:
    """The remaining life of a worn pump in strokes, predicted from a trend."""

    wear: Wear
    valve: int
    at: int
    predictor: str
    trend: Trend
    remaining: Crossing

    def __repr__(self) -> str:
        estimate, low, high = self.remaining
        text = f"{estimate:.0f} more, {low:.0f} to {high:.0f}"
        what = text if self.trend.found else self.trend.text
        return f"Prediction(valve {self.valve} after {self.at} strokes: {what})"

    @style.applied
    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the readings, their trend with its interval, and the limit."""
        ax = style.axes(ax)
        trend, strokes = self.trend, np.arange(self.at)
        values, limit, label = self.wear._indicator(
            self.predictor, slice(0, self.at), self.valve - 1
        )
        ax.plot(strokes, values, ".", color="C0", markersize=3)
        ax.text(strokes[-1], values[-1], "\n  readings", color="C0", va="top")
        red, side = style.LIMIT["color"], ax.get_yaxis_transform()
        ax.axhline(limit, **style.LIMIT, linewidth=1)  # type: ignore[arg-type]
        ax.text(0.01, limit, "limit", transform=side, color=red, va="bottom")
        if trend.found:
            crossing, last = trend.crossing(limit), self.at - 1
            # The axis is not extended to a crossing in the past or far in the future.
            end = crossing.estimate if last < crossing.estimate < 5 * last else last
            stop = 1.3 * end
            grid = np.linspace(0, stop, 200)
            low, high = trend.band(grid)
            for part, dashes in ((grid <= last, "-"), (grid >= last, "--")):
                ax.plot(grid[part], trend.at(grid[part]), dashes, color="C2")
            ax.fill_between(grid, low, high, color="C2", alpha=0.25, linewidth=0)
            ax.text(0.5 * end, float(trend.at(0.5 * end)), "trend  ", color="C2", ha="right")
            ax.set_xlim(0, stop)
            if crossing.estimate <= stop:
                ends = np.array(
                    [[crossing.estimate - crossing.low], [crossing.high - crossing.estimate]]
                )
                ax.errorbar(
                    [crossing.estimate],
                    [limit],
                    xerr=np.clip(ends, 0, stop),
                    fmt="o",
                    color="C2",
                    capsize=4,
                    markersize=5,
                )
                words = (
                    f"\n end of life:\n stroke {crossing.estimate:.0f}\n"
                    f" {100 * CONFIDENCE:g} %: {crossing.low:.0f} to {crossing.high:.0f}"
                )
                ax.text(crossing.estimate, limit, words, color="C2", va="top")
        else:
            ax.set_title("no trend")
        if trend.logarithmic:
            style.logarithmic(ax.yaxis)
            ax.yaxis.get_major_locator().set_params(subs=(1, 2, 4, 6, 8))  # type: ignore[call-arg]
            ax.yaxis.set_major_formatter(lambda leak, _: f"{1e12 * leak:g}")
        ax.set(xlabel="stroke", ylabel=label)
        return ax


@cache
def limit_leak() -> float:
    """Return the pump leak at which a stroke takes 10 s [m3/(s Pa)]."""
    from scipy.optimize import brentq

    usual = Actuator()

    def late(log_factor: float) -> float:
        worn = replace(usual, pump_leak=usual.pump_leak * np.exp(log_factor))
        # A valve that stops before the end of its travel has an infinite stroke time.
        return min(float(stroke_time(worn)), 1e6) - LIMIT

    return float(usual.pump_leak * np.exp(brentq(late, 0.0, 10.0, xtol=1e-10)))


def leak_from_pressure(pressure: npt.ArrayLike) -> Floats:
    """Return the leak of a pump [m3/(s Pa)] from its pressure in the middle of a stroke [bar]."""
    a = Actuator()
    p = 1e5 * np.asarray(pressure, float)
    load = load_pressure(a, 0.5)
    p = np.where((p > load) & (p <= a.relief_pressure), p, np.nan)
    pumped = np.asarray(a.displacement) * a.speed
    return np.asarray((pumped - a.restrictor * np.sqrt(p - load)) / p)


def mid_pressure(leak: npt.ArrayLike) -> Floats:
    """Return the default valve's pump pressure at half opening [bar], for an array of leaks."""
    leaks = np.asarray(leak, float)
    worn = replace(Actuator(), pump_leak=leaks.reshape(-1))
    state = hydraulics(worn, load_pressure(worn, 0.5))
    return np.asarray(state.pump_pressure / 1e5).reshape(leaks.shape)


#: Confidence level of the intervals of a trend, and of the test for a trend.
CONFIDENCE = 0.95


class Crossing(NamedTuple):
    """The point at which a trend reaches a limit."""

    estimate: float
    low: float
    high: float


@dataclass(frozen=True, slots=True)
class Trend:
    """A straight line fitted to points by least squares."""

    #: True if the line is fitted to the logarithms of the values.
    logarithmic: bool
    slope: float
    #: Half-widths of the confidence intervals of the slope, and of the line at its centre.
    slope_margin: float
    margin: float
    centre: tuple[float, float]
    p_value: float
    n: int
    median: float

    @property
    def found(self) -> bool:
        """True if the slope is significant."""
        return self.p_value < 1 - CONFIDENCE

    @property
    def text(self) -> str:
        """The result of the test for a trend, in one line."""
        what = "a trend" if self.found else "no trend"
        return f"{what} in {self.n} points (p = {self.p_value:.2g})"

    def at(self, x: npt.ArrayLike) -> Floats:
        """Return the values of the line."""
        return self._back(self.centre[1] + self.slope * (np.asarray(x, float) - self.centre[0]))

    def band(self, x: npt.ArrayLike) -> tuple[Floats, Floats]:
        """Return the ends of the line's confidence interval."""
        u = np.asarray(x, float) - self.centre[0]
        line, wide = self.centre[1] + self.slope * u, np.hypot(self.margin, self.slope_margin * u)
        return self._back(line - wide), self._back(line + wide)

    def crossing(self, limit: float) -> Crossing:
        """Return the point at which the line reaches a limit, with its interval."""
        if not self.found:
            return Crossing(nan, nan, inf)
        goal = float(np.log(limit)) if self.logarithmic else limit
        gap, x, w = goal - self.centre[1], self.centre[0], self.slope_margin
        square = self.slope**2 - w**2  # positive, because the trend is significant
        root = sqrt(w**2 * gap**2 + self.margin**2 * square)
        low, high = ((self.slope * gap + side * root) / square for side in (-1, 1))
        return Crossing(x + gap / self.slope, x + low, x + high)

    def _back(self, y: Floats) -> Floats:
        return np.asarray(np.exp(y) if self.logarithmic else y)


def remaining_life(trend: Trend, limit: float, now: float) -> Crossing:
    """Return the time from now until a trend rises to a limit."""
    # Without a trend the slope is meaningless, so the median is used.
    if (trend.at(now) if trend.found else trend.median) >= limit:
        return Crossing(0.0, 0.0, 0.0)
    if trend.found and trend.slope < 0:
        return Crossing(inf, inf, inf)
    crossing = trend.crossing(limit)
    return Crossing(*(max(x - now, 0.0) for x in crossing)) if trend.found else crossing


def fit_trend(x: npt.ArrayLike, y: npt.ArrayLike, *, logarithmic: bool = False) -> Trend:
    """Fit a trend to the points that are not NaN; a logarithmic trend uses only those above 0."""
    from scipy.special import stdtr, stdtrit  # scipy.stats takes a second to import

    places, values = np.asarray(x, float), np.asarray(y, float)
    valid = values > 0 if logarithmic else ~np.isnan(values)
    places, values = places[valid], values[valid]
    n = places.size
    if n < 5:
        raise ArgumentError(f"the readings have {n} valid points; a trend needs 5 or more")
    if logarithmic:
        values = np.log(values)
    middle = float(np.median(values))
    median = float(np.exp(middle)) if logarithmic else middle
    if np.ptp(values) == 0:
        # If all values are equal, there is nothing to test.
        centre = float(np.median(places)), float(values[0])
        return Trend(logarithmic, 0.0, 0.0, 0.0, centre, 1.0, n, median)
    centre = float(places.mean()), float(values.mean())
    away = places - centre[0]
    spread = float(away @ away)
    slope = float(away @ (values - centre[1])) / spread
    residual = values - centre[1] - slope * away
    deviation = sqrt(float(residual @ residual) / (n - 2))
    error = deviation / sqrt(spread)
    wide = float(stdtrit(n - 2, (1 + CONFIDENCE) / 2))
    p_value = 2 * float(stdtr(n - 2, -abs(slope) / error)) if error else 0.0
    return Trend(
        logarithmic, slope, wide * error, wide * deviation / sqrt(n), centre, p_value, n, median
    )


#: Fuzzy set of FP [bar], our choice: 1 below the limit of rule P2, 0 from the normal value up.
WORN = Term("worn", (-inf, -inf, 2.5, 90.0), "x < 2.5", "worn")

#: Indicators from which the remaining life can be predicted.
PREDICTORS = ("FP membership", "stroke time", "leak")

#: Smallest and largest number of strokes that a prediction uses.
_FEWEST, _WINDOW = 10, 200
