"""The answers of a tool over the values of one of its fields."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from itertools import groupby, pairwise
from math import nan
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from shipnet import style
from shipnet.errors import ArgumentError, InputError, some
from shipnet.fields import Choice, Kind, Number, Part, Text, Whole, check_choice, declared
from shipnet.lazy import pd
from shipnet.tools._view import Measure, View, in_words

#: Number of values of a control that are computed before the places of changes are refined.
_STEPS = 40

#: Maximum number of values that a verdict names, and least part of the axis with a name above it.
_NAMED, _WIDE = 3, 0.12


@dataclass(frozen=True, eq=False, repr=False)
class Sweep:
    """The answers of a tool over the values of one field, as returned by `Tool.sweep`.

    `views` contains the answer at each value of `field`, in order.

    Examples
    --------
    >>> from shipnet import tools
    >>> swept = tools.ModbusScan().sweep("slaves")
    >>> swept, swept.ok
    (Sweep(slaves: in time up to 39; too slow from 40), False)
    >>> table = tools.ModbusScan().sweep("dead", [0, 1]).table()
    >>> table["scan_s"].round(3).tolist(), table["answer"].tolist()
    ([1.576, 2.543], ['in time', 'too slow'])
    """

    field: str
    kind: Kind
    views: Mapping[Any, View]

    @property
    def ok(self) -> bool:
        """Whether the answer is good at every value."""
        return all(view.ok for view in self.views.values())

    @property
    def verdict(self) -> str:
        """The values at which each answer applies, in one line."""
        name, answers = self.kind.label or self.field, [v.short for v in self.views.values()]
        words = [in_words(self.kind, value) for value in self.views]
        if len(set(answers)) == 1:
            return f"{name}: {answers[0]} at all values"
        parts = []
        if isinstance(next(iter(self.views)), str | bool):  # values without an order
            for answer in dict.fromkeys(answers):
                with_it = [word for word, one in zip(words, answers, strict=True) if one == answer]
                parts.append(f"{answer} with {some(with_it, _NAMED)}")
        else:
            changes = [k for k in range(1, len(words)) if answers[k] != answers[k - 1]]
            parts = [f"{answers[0]} up to {words[changes[0] - 1]}"]
            parts += [f"{answers[k]} from {words[k]}" for k in changes]
        return f"{name}: {'; '.join(parts)}"

    def __repr__(self) -> str:
        return f"Sweep({self.verdict})"

    def table(self) -> pd.DataFrame:
        """Return one row per value: the tool's main number, the most allowed, ``answer``, ``ok``.

        The numbers are NaN at a value that is not possible.
        """
        views = self.views.values()
        none = Measure(self._measure.column, "", nan, nan)
        columns = {
            none.column: [(view.measure or none).value for view in views],
            "allowed": [(view.measure or none).limit for view in views],
            "answer": [view.short for view in views],
            "ok": [view.ok for view in views],
        }
        return pd.DataFrame(columns, pd.Index(list(self.views), name=self.field))

    @property
    def _measure(self) -> Measure:
        known = (view.measure for view in self.views.values() if view.measure is not None)
        return next(known, Measure("value", "", nan, nan))

    @property
    def curve(self) -> pd.Series:
        """The main number, by the value of the field if it is a number, or else by its name."""
        curve = self.table()[self._measure.column].astype(float)
        if isinstance(self.kind, Number):
            return curve
        return curve.set_axis([in_words(self.kind, value) for value in self.views])

    @style.applied
    def plot(self, ax: Axes | None = None, *, now: Any = None) -> Axes:
        """Draw the main number and its limit over the field, with a value `now` marked.

        Ranges with a bad answer are shaded, and the last good values are named. Values that are not
        numbers are rows.
        """
        ax, curve, limits = style.axes(ax), self.curve, self.table()["allowed"].to_numpy()
        name, red = self.kind.label or self.field, style.LIMIT["color"]
        if isinstance(self.kind, Number):
            ax.plot(curve.index, curve, color="C0")
            ax.plot(curve.index, limits, color=red, ls=style.LIMIT["linestyle"])
            ax.set(
                xlabel=f"{name} [{style.sign(self.kind.unit)}]".removesuffix(" []"),
                ylabel=self._measure.label,
            )
            ax.set_xlim(curve.index[0], curve.index[-1])
            beside: dict[str, Any] = {"xytext": (6, 0), "textcoords": "offset points"}
            ax.annotate("limit", (curve.index[-1], limits[-1]), color=red, va="center", **beside)
            if now in self.views:
                ax.plot(now, curve[now], "o", color="C0", ms=9)
            self._mark_ranges(ax)
            return ax
        for row, (value, view) in enumerate(self.views.items()):
            if np.isfinite(curve.iloc[row]):
                look, size = "C0o" if view.ok else "C1X", 9 if value == now else 6
                ax.plot(curve.iloc[row], row, look, ms=size)
            else:
                right = ax.get_yaxis_transform()
                ax.text(0.99, row, view.short, ha="right", va="center", transform=right)
        ax.plot(limits, range(len(limits)), "|", ms=14, mew=2.5, color=red, label="limit")
        ax.set_yticks(range(len(limits)), [*map(style.literal, curve.index)])
        ax.set(ylim=(len(limits) - 0.4, -0.6), xlabel=self._measure.label, ylabel=name)
        ax.grid(visible=False, axis="y")
        return ax

    def _mark_ranges(self, ax: Axes) -> None:
        """Shade the ranges with bad answers, name wide ranges, and mark the last good values."""
        curve, views = self.curve, list(self.views.values())
        values, whole = list(curve.index), curve.index[-1] - curve.index[0]
        above, start = ax.get_xaxis_transform(), values[0]
        groups = groupby(range(len(views)), key=lambda k: (views[k].short, views[k].ok))
        for (answer, ok), group in groups:
            *_, last = group
            after = min(last + 1, len(views) - 1)
            end = (values[last] + values[after]) / 2
            if not ok:
                ax.axvspan(start, end, color=style.LIMIT["color"], alpha=0.08, lw=0)
            if end - start > _WIDE * whole:
                centre: dict[str, Any] = {"ha": "center", "va": "bottom", "color": "0.3"}
                ax.text((start + end) / 2, 1.01, answer, transform=above, **centre)
            if ok != views[after].ok:
                edge = values[last] if ok else values[after]
                side = "right" if curve[values[after]] > curve[values[last]] else "left"
                ax.plot(edge, curve[edge], "o", color="C0", mfc="white")
                ax.annotate(f" {edge:g} ", (edge, curve[edge]), ha=side, va="bottom")
            start = end

    def view(self, now: Any = None) -> View:
        """Return the view that a page shows."""
        return View(
            verdict=self.verdict,
            ok=self.ok,
            plot=lambda ax: self.plot(ax, now=now),
            height=3.0 if isinstance(self.kind, Number) else 1.2 + 0.28 * len(self.views),
            about="Answers at all values of a control",
            curve=lambda: self.curve,
            data=self.table,
        )


def sweepable(record: type) -> dict[str, Kind]:
    """Return the fields of a record that can be swept: numbers, choices and switches."""
    return {name: k for name, k in declared(record).items() if not isinstance(k, Part | Text)}


def sweep(
    inputs: Any, field: str, see: Callable[[Any], View], over: Iterable[Any] | None = None
) -> Sweep:
    """Return the views on `inputs` with other values of one field, by default of its control.

    Of a long range, about 40 values are computed first, and then, by bisection, the places where
    the answer changes.
    """
    kinds = sweepable(type(inputs))
    kind = kinds[check_choice("field", field, kinds)]
    grid = _grid(kind, inputs) if over is None else list(over)
    if not grid:
        raise ArgumentError(f"over is empty; it must have at least one value of {field}")
    views: dict[int, View] = {}

    def answer(place: int) -> str:
        if place not in views:
            try:
                views[place] = see(replace(inputs, **{field: grid[place]}))
            except (ArgumentError, InputError) as problem:
                views[place] = View(verdict=str(problem), ok=False, short="not possible")
        return views[place].short

    def refine(first: int, last: int) -> None:
        if answer(first) != answer(last) and last - first > 1:
            middle = (first + last) // 2
            refine(first, middle)
            refine(middle, last)

    end = len(grid) - 1
    places = [*range(0, end, 1 if over is not None else max(1, end // _STEPS)), end]
    answer(0)
    for first, last in pairwise(places):
        refine(first, last)
    return Sweep(field, kind, {grid[place]: views[place] for place in sorted(views)})


def _grid(kind: Kind, inputs: Any) -> list[Any]:
    """Return the values at which a control can stand."""
    if not isinstance(kind, Number):
        return list(kind.options) if isinstance(kind, Choice) else [False, True]
    low, high = kind.shown
    if isinstance(kind, Whole):
        most = getattr(inputs, kind.at_most) if kind.at_most else high
        return list(range(int(low), int(min(high, most)) + 1))
    return [round(low + kind.step * n, 9) for n in range(round((high - low) / kind.step) + 1)]
