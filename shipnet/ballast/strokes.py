"""Recorded strokes of hydraulic actuators: features, rules fitted to healthy data, and scores.

The sensors of the shipped recording are not those of kim2014, so the rules use features that any
actuator has, and their limits come from healthy actuators other than the one under test.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache, cached_property
from math import inf
from os import PathLike

import numpy as np
import numpy.typing as npt

from shipnet import datasets
from shipnet.arrays import Floats
from shipnet.errors import ArgumentError, InputError
from shipnet.fuzzy.rules import RuleBase
from shipnet.fuzzy.terms import NORMAL, Interval, Rule, Term, Variable
from shipnet.intervals import share_interval
from shipnet.lazy import pd
from shipnet.line.scope_file import read_arrays

#: Channels of a point, in counts of the converter. Accelerations are given by their standard
#: deviations within the point, times ten.
CHANNELS = (
    "angle",
    "pressure_1",
    "pressure_2",
    "pressure_3",
    "accel_1_std_x10",
    "accel_2_std_x10",
    "accel_3_std_x10",
)

#: The condition of a healthy actuator.
HEALTHY = "healthy"

#: Points per stroke, point by which the actuator has stopped, and point at which the supply stops.
POINTS, _STOPPED, _HELD = 600, 200, 250

#: Ranges of the travel for speed and pressures, and for bursts; at the ends, bursts are common.
_STEADY, _INNER = (0.2, 0.8), (0.25, 0.8)

#: Width of the running median above which a burst is measured [points], and the value added before
#: the logarithm [count], because a quiet point may have the value 0.
_NEAR, _FLOOR = 17, 0.3

#: A limit is the largest of the healthy actuators' quantiles. Above it, a term rises to 1 within a
#: width that we chose with the shipped recording.
_QUANTILE = 0.98
_RULES = {
    "B1": ("burst_1", 3.0, 0.1, "Gear", "burst of acceleration 1"),
    "B2": ("burst_2", 3.0, 0.1, "Gear", "burst of acceleration 2"),
    "F1": ("flow_opening", 10.0, 0.04, "Flow", "fast for its pressure when it opens"),
    "F2": ("flow_closing", 10.0, 0.04, "Flow", "fast for its pressure when it closes"),
}

#: A function of two tables, the known strokes and the strokes to judge. It returns a mask of the
#: second table, True for each stroke to report.
Judge = Callable[["pd.DataFrame", "pd.DataFrame"], npt.ArrayLike]


@dataclass(frozen=True, eq=False)
class Strokes:
    """Recorded strokes of hydraulic actuators, as returned by `read_strokes`.

    Parameters
    ----------
    values : ndarray, shape (n, 600, 7)
        Points of each stroke: angle, three pressures, three accelerations, in raw counts.
    actuator, condition : ndarray of str, shape (n,)
        Name of the actuator, and its condition: ``healthy`` or a fault.
    stroke : ndarray of int, shape (n,)
        Number of the stroke.

    Examples
    --------
    >>> strokes = read_strokes()
    >>> strokes
    Strokes(418 strokes; healthy: Act_1, Act_2, Act_5; gear damage: Act_3; seal defect: Act_4)
    >>> rules = strokes.rules(without="Act_1")
    >>> own = strokes.table().query("actuator == 'Act_1'")
    >>> rules.decide(own[list(rules.names)], applies=strokes.applies.loc[own.index])
    Decision(104 samples: 104 normal)
    """

    values: npt.NDArray[np.generic]
    actuator: npt.NDArray[np.str_]
    condition: npt.NDArray[np.str_]
    stroke: npt.NDArray[np.generic]

    def __repr__(self) -> str:
        pairs = pd.DataFrame({"condition": self.condition, "actuator": self.actuator})
        groups = pairs.drop_duplicates().groupby("condition", sort=False)["actuator"]
        text = "; ".join(f"{name}: {', '.join(sorted(names))}" for name, names in groups)
        return f"Strokes({len(self.values)} strokes; {text})"

    @cached_property
    def way(self) -> Floats:
        """Fraction of the travel completed at each point, shape (n, 600); NaN without movement."""
        angle = self.values[..., 0].astype(float)
        span = (np.median(angle[:, -_STOPPED:], axis=1) - angle[:, 0])[:, np.newaxis]
        moved, way = span != 0, np.full_like(angle, np.nan)
        np.divide(angle - angle[:, :1], span, out=way, where=moved)
        return way

    def table(self) -> pd.DataFrame:
        """Return one row of features per stroke, in points and raw counts.

        ``opening`` is True if the angle rose. ``dead_time`` lasts until 2 % of the travel,
        ``stroke_time`` from 5 to 95 %. From 20 to 80 %, ``moving_difference`` is the median
        absolute difference between the chamber pressures, ``roughness`` the standard deviation of
        the change of speed, divided by the speed, and each ``vibration`` the median logarithm (base
        10) of an acceleration. A ``burst`` is the largest excess of this logarithm over its running
        median from 25 to 80 %; ``burst_1`` occurs at the fraction ``burst_place`` of the travel. At
        rest, the features are ``holding_pressure``, its ``decay``, and ``supply_ripple``.
        ``flow_opening`` and ``flow_closing`` are the speed divided by the square root of the mean
        pressure of the pushing chamber at points 150 to 199; NaN in the other direction.
        """
        return self._features.copy()

    @property
    def applies(self) -> pd.DataFrame:
        """Mask of the strokes to which the features of one direction apply, for `RuleBase.fire`."""
        opening = self._features["opening"]
        return pd.DataFrame({"flow_opening": opening, "flow_closing": ~opening})

    @cached_property
    def _features(self) -> pd.DataFrame:
        from scipy.ndimage import median_filter

        values, way = self.values.astype(float), self.way
        angle, chambers, supply = values[..., 0], values[..., 1:3], values[:, _HELD:, 3]
        moves, every = np.arange(POINTS) < _STOPPED, np.arange(len(way))
        opening = np.median(angle[:, -_STOPPED:], axis=1) > angle[:, 0]
        pushing = chambers[:, -100:].mean(axis=1).argmax(axis=1)
        high = chambers[every, :, pushing]
        steady = moves & (way > _STEADY[0]) & (way < _STEADY[1])
        inner = moves & (way > _INNER[0]) & (way < _INNER[1])

        def reached(share: float) -> Floats:
            """Return the interpolated point at which this fraction of the travel is completed."""
            after = np.maximum((way >= share).argmax(axis=1), 1)
            before, now = way[every, after - 1], way[every, after]
            return np.asarray(after - 1 + (share - before) / (now - before))

        def typical(x: Floats) -> Floats:
            return pd.DataFrame(np.where(steady, x, np.nan)).median(axis=1).to_numpy()

        way_counts = np.abs(np.median(angle[:, -_STOPPED:], axis=1) - angle[:, 0])
        with np.errstate(divide="ignore", invalid="ignore"):
            span = (_STEADY[1] - _STEADY[0]) * way_counts
            speed = span / (reached(_STEADY[1]) - reached(_STEADY[0]))
            flow = speed / np.sqrt(high[:, 150:_STOPPED].mean(axis=1))
            jerk = np.where(steady[:, 2:], np.diff(angle, 2, axis=1), np.nan)
            roughness = pd.DataFrame(jerk).std(axis=1, ddof=0).to_numpy() / speed
            columns = {
                "actuator": self.actuator,
                "condition": self.condition,
                "stroke": self.stroke,
                "opening": opening,
                "dead_time": reached(0.02),
                "stroke_time": reached(0.95) - reached(0.05),
                "moving_difference": typical(np.abs(chambers[..., 0] - chambers[..., 1])),
                "holding_pressure": high[:, -100:].mean(axis=1),
                "decay": high[:, _STOPPED:_HELD].mean(axis=1) - high[:, -50:].mean(axis=1),
                "roughness": roughness,
                "supply_ripple": np.diff(supply, axis=1).std(axis=1),
                "flow_opening": np.where(opening, flow, np.nan),
                "flow_closing": np.where(opening, np.nan, flow),
            }
            for k in range(1, 4):
                level = np.log10(values[..., 3 + k] / 10 + _FLOOR)
                over = level - median_filter(level, size=(1, _NEAR), mode="nearest")
                over = np.where(inner, over, -inf)
                columns[f"vibration_{k}"] = typical(level)
                columns[f"burst_{k}"] = np.where(inner.any(axis=1), over.max(axis=1), np.nan)
                if k == 1:
                    columns["burst_place"] = way[every, over.argmax(axis=1)]
        return pd.DataFrame(columns)

    def rules(self, without: str = "") -> RuleBase:
        """Return rules whose limits come from the healthy actuators, except `without`.

        A limit is the largest of their 98 % quantiles. The crisp rule fires above the limit. The
        fuzzy term rises from the limit, and its rule fires from the middle of the rise.
        """
        features = self._features
        healthy = features[(features["condition"] == HEALTHY) & (features["actuator"] != without)]
        named = [variable for variable, *_ in _RULES.values()]
        limits = healthy.groupby("actuator")[named].quantile(_QUANTILE).max()
        if limits.isna().any():
            missing = ", ".join(limits.index[limits.isna()])
            raise ArgumentError(
                f"without is {without!r}; no other healthy actuator has values of {missing}"
            )
        variables, rules = [], []
        for rank, (code, (name, top, width, flag, says)) in enumerate(_RULES.items(), start=1):
            limit = float(limits[name])
            high = Term("high", (limit, limit + width, inf, inf), Interval(limit), "high")
            variables.append(Variable(name, "", 0, max(top, limit + width), (high,)))
            rules.append(Rule(code, f"{name}.high", rank, flag, says))
        return RuleBase(tuple(variables), tuple(rules))

    def scores(
        self, reference: Strokes | None = None, *, judges: Mapping[str, Judge] | None = None
    ) -> pd.DataFrame:
        """Return how many strokes of each actuator are reported by rules fitted without it.

        Limits come from the healthy actuators of `reference`, by default the shipped recording,
        except the one under test. `judges` maps names of other methods to functions. Each is called
        once per actuator and condition, with the features of all other actuators of `reference`,
        healthy or not, and those of the strokes to judge; it returns a mask of those to report.

        Indexed by ``method``, ``report`` (a flag of the rules, or any), ``actuator`` and
        ``condition``. Columns: the number of ``strokes``, how many were ``reported``, and the
        fraction ``rate`` with its 95 % interval, ``low`` to ``high``. For healthy strokes the rate
        is the false alarm rate. The rules report a stroke without movement, but only under ``any``.
        """
        others = dict(judges or {})
        source = reference if reference is not None else _shipped()
        features, rows = source.table(), []
        for (name, condition), tested in self._features.groupby(["actuator", "condition"]):
            base = source.rules(without=str(name))
            reports = {}
            for method in ("crisp", "fuzzy"):
                applies = self.applies.loc[tested.index]
                decided = base.decide(tested[list(base.names)], method, applies=applies)
                for flag in dict.fromkeys(rule.flag for rule in base.rules):
                    of_flag = [rule.flag == flag for rule in base.rules]
                    reports[method, flag] = decided.active[:, of_flag].any(axis=1)
                reports[method, "any"] = decided.top != NORMAL
            for method, judge in others.items():
                reported = np.asarray(judge(features[features["actuator"] != name], tested))
                if reported.shape != (len(tested),) or reported.dtype != bool:
                    raise ArgumentError(
                        f"judges[{method!r}] returned the shape {reported.shape} and the type "
                        f"{reported.dtype}; expected one bool for each of {len(tested)} strokes"
                    )
                reports[method, "any"] = reported
            rows += [
                (method, report, name, condition, len(tested), int(hits.sum()))
                for (method, report), hits in reports.items()
            ]
        index = ["method", "report", "actuator", "condition"]
        table = pd.DataFrame(rows, columns=[*index, "strokes", "reported"])
        low, high = share_interval(table["reported"], table["strokes"])
        table = table.assign(rate=table["reported"] / table["strokes"], low=low, high=high)
        return table.set_index(index).sort_index()


def read_strokes(path: str | PathLike[str] | None = None) -> Strokes:
    """Read recorded strokes of hydraulic actuators.

    Parameters
    ----------
    path : path, optional
        An ``.npz`` file in the form of the shipped recording (the default): ``values`` of shape
        (strokes, 600, 7), the names of their ``channels``, and for each stroke the ``actuator``,
        its ``condition`` (``healthy`` or a fault) and the number of the ``stroke``.

    Returns
    -------
    Strokes
        The strokes.

    Raises
    ------
    InputError
        If the file cannot be read, or does not have this form.

    Notes
    -----
    The shipped recording, made by others [1]_, is of rotary actuators (15 000 in-lbf) like those
    that turn ship valves: three healthy, one with a damaged gear and one with a leaking seal. Each
    stroke of 3000 samples was reduced to 600 points, each the mean of five samples or, for
    accelerations, ten times their standard deviation. Values are raw counts; the units and the
    sampling period are not published.

    References
    ----------
    .. [1] Virginia Tech National Security Institute, actuator_dataset, 2025; see SOURCES.md.

    Examples
    --------
    Percentage of each actuator's strokes that are reported by rules fitted without it:

    >>> strokes = read_strokes()
    >>> fuzzy = strokes.scores().loc["fuzzy", "any"]
    >>> (100 * fuzzy["rate"]).round(1).droplevel("condition").to_dict()
    {'Act_1': 0.0, 'Act_2': 1.9, 'Act_3': 100.0, 'Act_4': 90.6, 'Act_5': 4.7}
    """
    keys = ("values", "channels", "actuator", "condition", "stroke")
    file = path if path is not None else datasets.path("vtnsi_actuator_strokes.npz")
    held = read_arrays(file, keys)
    for key in ("channels", "actuator", "condition"):
        try:
            "".join(map(str, held[key].ravel())).encode().decode()
        except (ValueError, SystemError):  # NumPy stores any number as a character
            raise InputError(str(file), f"{key} is not text") from None
    values, channels = held["values"], tuple(map(str, held["channels"].ravel()))
    n = len(values) if values.ndim else 0
    if channels != CHANNELS:
        raise InputError(str(file), f"channels are {', '.join(channels)}; expected {CHANNELS}")
    if values.shape[1:] != (POINTS, len(CHANNELS)) or not n or values.dtype.kind not in "iuf":
        raise InputError(
            str(file),
            f"values have the shape {values.shape} and the type {values.dtype}; expected real "
            f"numbers, (strokes, {POINTS}, {len(CHANNELS)})",
        )
    if values.dtype.kind == "f" and not np.isfinite(values).all():
        index = np.argwhere(~np.isfinite(values))[0].tolist()
        raise InputError(str(file), f"values{index} is {values[tuple(index)]}; it must be finite")
    for key, kind in (("actuator", "U"), ("condition", "U"), ("stroke", "iu")):
        if held[key].shape != (n,) or held[key].dtype.kind not in kind:
            raise InputError(
                str(file),
                f"{key} has the shape {held[key].shape} and the type {held[key].dtype}; expected "
                f"one {'string' if kind == 'U' else 'whole number'} for each of {n} strokes",
            )
    return Strokes(values, held["actuator"], held["condition"], held["stroke"])


@cache
def _shipped() -> Strokes:
    """Return the shipped recording, cached so that its features are computed only once."""
    return read_strokes()
