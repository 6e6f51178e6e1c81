"""Remaining life of worn pumps, told in advance from what the sensors say.

The data are synthetic, and one predictor knows their law: what it achieves is an upper bound.
"""

from __future__ import annotations

from math import inf
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from shipnet.ballast.trend import Crossing, Trend, fit_trend, remaining_life
from shipnet.ballast.wear import LIMIT, Wear, leak_from_pressure, limit_leak, mid_pressure
from shipnet.errors import ArgumentError
from shipnet.fields import check_scalar, check_whole
from shipnet.fuzzy.terms import Interval, Term

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["PREDICTORS", "WORN", "alarm_strokes", "life_comparison", "predict_life"]

Floats = npt.NDArray[np.float64]

#: A set for FP [bar] that spans all between its normal value and the limit of rule P2; ours.
WORN = Term("worn", (-inf, -inf, 2.5, 90.0), Interval.parse("x < 2.5"), "worn")

#: From what the remaining life is told, and how.
PREDICTORS = {
    "FP membership": "membership of FP in the set worn, straight in the number of strokes",
    "stroke time": "stroke time, straight in the number of strokes",
    "leak": "pump leak from FP by the inverted model, its logarithm straight",
}

#: Strokes without which no prediction is tried.
_FEWEST = 10


def alarm_strokes(wear: Wear, *, k: int = 3, n: int = 5) -> pd.DataFrame:
    """Return at which stroke rules would report a worn pump, beside its true life.

    Parameters
    ----------
    wear : Wear
        What `shipnet.ballast.wear.synthetic_wear` returned.
    k, n : int, default 3 and 5
        A rule reports when it fired in `k` of the last `n` strokes.

    Returns
    -------
    pandas.DataFrame
        One row a valve: ``life``, and the strokes at which ``P2`` (FP below 2.5 bar) and ``T1``
        (stroke longer than 10 s, ours) report; NaN if they never do.

    Raises
    ------
    ArgumentError
        If `k` or `n` is out of range.

    Examples
    --------
    >>> from shipnet.ballast.wear import synthetic_wear
    >>> wear = synthetic_wear(4, 600, rng=np.random.default_rng(2024))
    >>> alarm_strokes(wear).round().astype(object).values.tolist()[0]
    [339.0, nan, 346.0]
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
        {"life": wear.life, "P2": first(wear.FP < 2.5), "T1": first(wear.stroke_time > LIMIT)}
    )


def predict_life(
    wear: Wear, valve: int, now: int, *, predictor: str = "leak", window: int = 200
) -> tuple[Trend, Crossing]:
    """Tell from the strokes so far how many more a valve will make within its limit.

    Parameters
    ----------
    wear : Wear
        What `shipnet.ballast.wear.synthetic_wear` returned.
    valve : int
        Which, from 0 on.
    now : int
        Number of strokes so far, 10 up to those there are.
    predictor : str, default "leak"
        One of `PREDICTORS`.
    window : int, default 200
        The last so many strokes are used, 10 or more.

    Returns
    -------
    trend : Trend
        What was fitted.
    remaining : Crossing
        Strokes from now on, with their interval.

    Raises
    ------
    ArgumentError
        If an argument is out of its range.

    Examples
    --------
    >>> from shipnet.ballast.wear import synthetic_wear
    >>> wear = synthetic_wear(3, 400, rng=np.random.default_rng(2024))
    >>> trend, remaining = predict_life(wear, 0, 200)
    >>> [round(x) for x in remaining], round(wear.life[0] - 200)
    ([140, 139, 142], 139)
    """
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


def life_comparison(
    wear: Wear, *, parts: tuple[float, ...] = (0.3, 0.5, 0.7, 0.9), window: int = 200
) -> pd.DataFrame:
    """Compare the remaining life that each predictor tells with the true one.

    Parameters
    ----------
    wear : Wear
        What `shipnet.ballast.wear.synthetic_wear` returned; valves whose part of life lies beyond
        its strokes are left out.
    parts : tuple of float, default (0.3, 0.5, 0.7, 0.9)
        When it is asked, as parts of the true life, above 0, below 1.
    window : int, default 200
        As for `predict_life`.

    Returns
    -------
    pandas.DataFrame
        Indexed by ``predictor`` and ``part``: number of ``valves``, share with a trend ``found``;
        quantiles ``p05``, ``median``, ``p95`` of the remaining life over the true one, of those;
        share ``within_20`` percent; share whose interval ``covers`` the truth. Both shares are of
        all valves.

    Raises
    ------
    ArgumentError
        If an argument is out of its range.

    Examples
    --------
    >>> from shipnet.ballast.wear import synthetic_wear
    >>> wear = synthetic_wear(20, 600, rng=np.random.default_rng(2024))
    >>> life_comparison(wear, parts=(0.5,))["median"].round(2).to_dict()
    {('FP membership', 0.5): 1.44, ('stroke time', 0.5): 1.64, ('leak', 0.5): 1.0}
    """
    import pandas as pd

    index, rows = [], []
    for predictor in PREDICTORS:
        for part in parts:
            share = check_scalar("part", part, "", 1e-6, 1 - 1e-6)
            ratios, covers = [], []
            for valve, life in enumerate(wear.life):
                now = int(share * life)
                if not _FEWEST <= now <= len(wear.FP):
                    continue
                told = predict_life(wear, valve, now, predictor=predictor, window=window)[1]
                ratios.append(told.estimate / (life - now))
                covers.append(told.low <= life - now <= told.high)
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
