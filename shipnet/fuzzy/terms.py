"""The parts of a rule base: terms such as "high", the variables that they describe, and rules."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import cycle, pairwise
from math import inf, isnan
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from shipnet import style
from shipnet.arrays import Bools, Floats
from shipnet.errors import ArgumentError
from shipnet.fields import check_fields, check_scalar, part, record, text, whole
from shipnet.lazy import Axes

#: Decisions when no rule fires: with its missing readings, no rule could fire, or some could.
NORMAL, UNDETERMINED = "normal", "undetermined"

#: Parts of the universe by which a reading may lie below or above it. They are the failure limits
#: of NAMUR NE 43 for sensors with 4 to 20 mA: 3.6 mA and 21 mA.
_BELOW, _ABOVE = 0.4 / 16, 1 / 16

_NUMBER = r"[+-]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][+-]?[0-9]{1,3})?"
_COMPARISON = re.compile(
    rf"(?:(?P<low>{_NUMBER})\s*(?P<from><=?)\s*)?x(?:\s*(?P<sign><=?|>=?|==)\s*(?P<end>{_NUMBER}))?"
)


@dataclass(frozen=True, slots=True)
class Interval:
    """The values for which a comparison holds.

    Parameters
    ----------
    low, high : float
        The ends; -inf or inf on an unbounded side. At least one end must be finite.
    low_closed, high_closed : bool, default False
        True if the end belongs to the interval.

    Examples
    --------
    >>> Interval(0, 2.5).contains([0, 0.1, 2.5]).tolist(), str(Interval(90, float("inf"), True))
    ([False, True, False], 'x >= 90')
    """

    low: float = -inf
    high: float = inf
    low_closed: bool = False
    high_closed: bool = False

    def __post_init__(self) -> None:
        point = self.low == self.high and self.low_closed and self.high_closed
        if not (self.low < self.high or point) or (self.low, self.high) == (-inf, inf):
            raise ArgumentError(
                f"low is {self.low:g}, high {self.high:g}; low must be below high, "
                "and at least one of them finite"
            )
        # An unbounded side has no end that could belong to the interval.
        object.__setattr__(self, "low_closed", self.low_closed and self.low > -inf)
        object.__setattr__(self, "high_closed", self.high_closed and self.high < inf)

    def __str__(self) -> str:
        low, high = _number_text(self.low), _number_text(self.high)
        if self.low == self.high:
            return f"x == {low}"
        if self.high == inf:
            return f"x >{'=' * self.low_closed} {low}"
        left = f"{low} <{'=' * self.low_closed} " if self.low > -inf else ""
        return f"{left}x <{'=' * self.high_closed} {high}"

    def contains(self, x: npt.ArrayLike) -> Bools:
        """Return a mask of the values inside; NaN is always outside."""
        values = np.asarray(x, dtype=float)
        above = values >= self.low if self.low_closed else values > self.low
        below = values <= self.high if self.high_closed else values < self.high
        # An interval that is unbounded on one side contains the infinity on that side.
        above |= (self.low == -inf) & (values == -inf)
        return np.asarray(above & (below | ((self.high == inf) & (values == inf))))


def parse_comparison(crisp: str) -> Interval:
    """Return the values for which a comparison such as ``0 < x <= 2.5`` holds."""
    match = _COMPARISON.fullmatch(crisp.strip()) if isinstance(crisp, str) else None
    both = match and match["low"] and match["sign"] in (">", ">=", "==")
    if not match or both or not (match["low"] or match["sign"]):
        raise ArgumentError(
            f"crisp is {crisp!r}; it must be an Interval, or text like x > 120 or 0 < x <= 2.5"
        )
    low, high = float(match["low"] or -inf), inf
    low_closed, high_closed = match["from"] == "<=", False
    if match["sign"]:
        end, closed = float(match["end"]), match["sign"] not in ("<", ">")
        if match["sign"][0] in ">=":
            low, low_closed = end, closed
        if match["sign"][0] in "<=":
            high, high_closed = end, closed
    return Interval(low, high, low_closed, high_closed)


@record(slots=True)
class Term:
    """A word for a range of a variable's values.

    Parameters
    ----------
    name : str
        The word, such as ``high``: letters, digits and underscores, the first a letter.
    corners : tuple of float
        The trapezoid's left foot, left shoulder, right shoulder and right foot, in ascending order.
        A foot that equals its shoulder makes a step. If both left corners are -inf, or both right
        corners inf, the shoulder on that side is open.
    crisp : Interval or str
        The word as a comparison, such as ``x > 90``.
    english : str, default ""
        Label in figures and explanations.

    Examples
    --------
    >>> hot = Term("hot", (80, 90, float("inf"), float("inf")), "x >= 90")
    >>> hot.membership([70, 85, 90, float("nan")]).tolist(), str(hot.midpoint)
    ([0.0, 0.5, 1.0, 0.0], 'x >= 85')
    """

    name: str
    corners: tuple[float, float, float, float]
    crisp: Interval = part(Interval, make=parse_comparison)
    english: str = ""

    if TYPE_CHECKING:

        def __init__(
            self,
            name: str,
            corners: tuple[float, float, float, float],
            crisp: Interval | str,
            english: str = "",
        ) -> None: ...

    def __post_init__(self) -> None:
        check_fields(self)
        check_word("name of a term", self.name)
        check_label(f"english of {self.name}", self.english)
        try:
            corners = tuple(float(corner) for corner in self.corners)
        except (TypeError, ValueError, OverflowError):
            corners = ()
        if len(corners) != 4 or any(isnan(corner) for corner in corners):
            raise ArgumentError(f"corners are {self.corners}; they must be four numbers")
        left, right = corners[:2], corners[2:]
        open_ends = (left == (-inf, -inf), right == (inf, inf))
        if list(corners) != sorted(corners) or all(open_ends):
            raise ArgumentError(f"corners are {corners}; they must rise, with one side finite")
        closed = (() if open_ends[0] else left) + (() if open_ends[1] else right)
        if not all(abs(corner) <= 1e300 for corner in closed):
            raise ArgumentError(
                f"corners are {corners}; they must be up to 1e300, or infinite on one whole side"
            )
        object.__setattr__(self, "corners", corners)

    @property
    def midpoint(self) -> Interval:
        """The values with a membership of 0.5 or more."""
        a, b, c, d = self.corners
        # Equal corners, of a step or an open shoulder, are kept as they are.
        low, high = (x if x == y else (x + y) / 2 for x, y in ((a, b), (c, d)))
        return Interval(low, high, a > -inf, d < inf)

    def membership(self, x: npt.ArrayLike) -> Floats:
        """Return the degree of membership of each value, 0..1; 0 for NaN."""
        _, b, c, _ = self.corners
        # Beyond an open shoulder, a value counts as the other end of the shoulder.
        low, high = (c if b == -inf else -inf), (b if c == inf else inf)
        within = np.clip(np.asarray(x, dtype=float), low, high)
        degree = trapezoid(within, *sloping(self.corners, low, high))
        return np.where(np.isnan(within), 0.0, degree)


def trapezoid(
    x: Floats, a: npt.ArrayLike, b: npt.ArrayLike, c: npt.ArrayLike, d: npt.ArrayLike
) -> Floats:
    """Return the membership of each value: it rises from a to b and falls from c to d."""
    rising = (x.clip(a, b) - a) / np.subtract(b, a)
    falling = (d - x.clip(c, d)) / np.subtract(d, c)
    return np.asarray(np.minimum(rising, falling))


def sloping(corners: Sequence[float], low: float, high: float) -> tuple[float, ...]:
    """Return the corners of a trapezoid without steps that has the same memberships in low..high.

    The sides of a step become neighbouring numbers, and an open shoulder begins at low or high.
    """
    a, b, c, d = corners
    if a == b:
        b = max(b, low)
        a = float(np.nextafter(b, -inf))
    if c == d:
        c = min(c, high)
        d = float(np.nextafter(c, inf))
    return a, b, c, d


@dataclass(frozen=True, slots=True)
class Variable:
    """A measured quantity and the words for its values.

    Parameters
    ----------
    name : str
        Symbol of the variable, such as ``FP``: letters, digits and underscores, the first a letter.
    unit : str
        Unit of its values, of the universe and of the corners of the terms.
    low, high : float
        Ends of the universe, the range that the sensor measures, within -1e30..1e30. A value counts
        as missing if it is more than 2.5 % of the range below it or more than 6.25 % above it: a
        4 to 20 mA sensor signals a failure with less than 3.6 mA or more than 21 mA (NAMUR NE 43).
        Values just outside the universe count as its ends, except in comparisons as written.
    terms : tuple of Term
        One or more terms with different names. The range between a term's shoulders, and that of
        its comparison, must reach into the universe.
    english : str, default ""
        Label in figures.

    Examples
    --------
    >>> still = Term("still", (-float("inf"), -float("inf"), 0.5, 1.5), "x == 0")
    >>> Variable("DVPos", "%/s", 0, 30, (still,))["still"].membership([0, 1, 9]).tolist()
    [1.0, 0.5, 0.0]
    """

    name: str
    unit: str
    low: float
    high: float
    terms: tuple[Term, ...]
    english: str = ""

    def __post_init__(self) -> None:
        check_word("name of a variable", self.name)
        for what in ("unit", "english"):
            check_label(f"{what} of {self.name}", getattr(self, what))
        low, high = (
            check_scalar(f"{end} of {self.name}", getattr(self, end), self.unit, -1e30, 1e30)
            for end in ("low", "high")
        )
        object.__setattr__(self, "low", low)
        object.__setattr__(self, "high", high)
        object.__setattr__(self, "terms", tuple(self.terms))
        if not low < high:
            raise ArgumentError(f"low of {self.name} is {low:g}; it must be below high, {high:g}")
        names = [term.name for term in self.terms]
        if not names or len(set(names)) < len(names):
            raise ArgumentError(
                f"terms of {self.name} are {', '.join(names) or 'none'}; "
                "there must be one or more, with different names"
            )
        for term in self.terms:
            ends = {"shoulder": term.corners[1:3], "comparison": (term.crisp.low, term.crisp.high)}
            for what, (first, last) in ends.items():
                if last < low or first > high:
                    raise ArgumentError(
                        f"{what} of {self.name}.{term.name} lies outside {low:g}..{high:g}; "
                        "it must reach into the universe"
                    )

    def __getitem__(self, name: str) -> Term:
        """Return the term with this name."""
        for term in self.terms:
            if term.name == name:
                return term
        names = ", ".join(term.name for term in self.terms)
        raise ArgumentError(f"term is {name!r}; the terms of {self.name} are {names}")

    @property
    def label(self) -> str:
        """Text on an axis."""
        unit = f"[{style.sign(self.unit)}]" if self.unit else ""
        return style.literal(f"{self.english} {self.name} {unit}".strip())

    @property
    def valid(self) -> tuple[float, float]:
        """Lowest and highest values that count as readings."""
        width = self.high - self.low
        return self.low - _BELOW * width, self.high + _ABOVE * width

    def holds(self, x: npt.ArrayLike, method: str) -> Bools:
        """Return which terms hold for each value, by comparison, shape (n, n_terms)."""
        intervals = [term.midpoint if method == "midpoint" else term.crisp for term in self.terms]
        return np.stack([interval.contains(x) for interval in intervals], axis=1)

    def cells(self, method: str) -> list[float]:
        """Return one value for each combination of terms that can hold at once."""
        intervals = [term.midpoint if method == "midpoint" else term.crisp for term in self.terms]
        ends = {end for interval in intervals for end in (interval.low, interval.high)}
        inside = {end for end in ends if self.low < end < self.high}
        edges = [self.low, *sorted(inside), self.high]
        middles = [(a + b) / 2 for a, b in pairwise(edges)]
        points = np.array(sorted([*edges, *middles]))
        # A point inside a cell represents the cell better than a point on its edge.
        inner = np.isin(points, middles)
        chosen: dict[tuple[bool, ...], int] = {}
        for index, row in enumerate(self.holds(points, method).tolist()):
            key = tuple(row)
            if key not in chosen or (inner[index] and not inner[chosen[key]]):
                chosen[key] = index
        return sorted(float(points[index]) for index in chosen.values())

    @style.applied
    def plot(self, ax: Axes | None = None, *, crisp: bool = True) -> Axes:
        """Draw the membership functions; `crisp` adds the comparisons' limits as dashed lines.

        Axes keep the x limits that were set before.
        """
        ax = style.axes(ax)
        if ax.get_autoscalex_on():
            ax.set_xlim(self.low, self.high)
        left, right = ax.get_xlim()
        grid = np.linspace(left, right, 501)
        for term, dashes in zip(self.terms, cycle(("-", "--", "-.")), strict=False):
            corners = [x for x in term.corners if left < x < right]
            # With a point on each side of a corner, a step is drawn vertically.
            sides = [np.nextafter(corners, end) for end in (-np.inf, np.inf)]
            x = np.unique(np.concatenate([grid, corners, *sides]))
            (line,) = ax.plot(x, term.membership(x), dashes)
            # The name is above the visible points with a membership of 1.
            top = x[(left <= x) & (x <= right) & (term.membership(x) > 0.99)]
            if top.size:
                low, high = (term.membership([left, right]) > 0.99).tolist()
                side = "left" if low else "right" if high else "center"
                at = left if low else right if high else (top[0] + top[-1]) / 2
                name = style.literal(term.english or term.name).replace(" ", "\n")
                look: Any = {"textcoords": "offset points", "color": line.get_color(), "ha": side}
                ax.annotate(name, (at, 1), (5 * (low - high), 3), **look)
        ends = {end for term in self.terms for end in (term.crisp.low, term.crisp.high)}
        for limit in sorted(end for end in ends if np.isfinite(end)) if crisp else ():
            ax.axvline(limit, **style.PAPER, linewidth=1)  # type: ignore[arg-type]
            ax.annotate(f"limit {limit:g}", (limit, 1), (limit, 1.32), color="0.4", ha="center")
        ax.set_ylim(-0.05, 1.3)
        ax.set_yticks([0, 0.5, 1])
        ax.set_xlabel(self.label)
        ax.set_ylabel("membership")
        return ax


@record(slots=True)
class Rule:
    """A rule that reports a fault if all of its terms hold.

    Parameters
    ----------
    code : str
        Name of the fault, such as ``V1``; not ``normal`` or ``undetermined``.
    antecedent : str or tuple of (str, str)
        Terms such as ``FP.high & OP.high``, or (variable, term) pairs; each variable only once.
    priority : int
        Rank when several rules fire, 1..9999; 1 is reported first.
    flag : str, default ""
        The flag that the rule sets; several rules may set the same flag.
    english : str, default ""
        Label in figures.

    Examples
    --------
    >>> rule = Rule("V1", "FP.high & OP.high", 3, "ValveStick", "valve stuck")
    >>> rule.antecedent, rule.text
    ((('FP', 'high'), ('OP', 'high')), 'FP.high & OP.high')
    """

    code: str
    antecedent: tuple[tuple[str, str], ...]
    priority: int = whole(1, 9999)
    flag: str = text(default="")
    english: str = text(default="")

    if TYPE_CHECKING:

        def __init__(
            self,
            code: str,
            antecedent: str | tuple[tuple[str, str], ...],
            priority: int,
            flag: str = "",
            english: str = "",
        ) -> None: ...

    def __post_init__(self) -> None:
        check_fields(self)
        if check_word("code", self.code) in (NORMAL, UNDETERMINED):
            raise ArgumentError(f"code is {self.code!r}, which is reserved for when no rule fires")
        for what in ("flag", "english"):
            check_label(f"{what} of {self.code}", getattr(self, what))
        parts: Any = self.antecedent
        if isinstance(parts, str):
            parts = [pair.strip().split(".") for pair in parts.split("&")]
        try:
            pairs = [(variable, term) for variable, term in parts]
        except (TypeError, ValueError):
            raise ArgumentError(
                f"antecedent is {self.antecedent!r}; use text like FP.high & OP.high, or pairs"
            ) from None
        words = ((check_word("variable", a), check_word("term", b)) for a, b in pairs)
        object.__setattr__(self, "antecedent", tuple(words))
        names = self.variables
        if not names or len(set(names)) < len(names):
            raise ArgumentError(
                f"antecedent of {self.code} is {self.text!r}; it must have one or more terms, each "
                "of a different variable"
            )

    @property
    def text(self) -> str:
        """The antecedent as text."""
        return " & ".join(f"{variable}.{term}" for variable, term in self.antecedent)

    @property
    def variables(self) -> tuple[str, ...]:
        """Names of the variables that the rule needs."""
        return tuple(variable for variable, _ in self.antecedent)


def check_word(what: str, text: str) -> str:
    """Return `text`; raise unless it is a letter, then only letters, digits and underscores."""
    if not isinstance(text, str) or not re.fullmatch("[A-Za-z][A-Za-z0-9_]*", text):
        raise ArgumentError(f"{what} is {text!r}; use a letter, then letters, digits, underscores")
    return text


def check_label(what: str, label: str) -> None:
    """Raise unless `label` is printable text, so that it fits in one line of a file."""
    if not isinstance(label, str) or not label.isprintable():
        raise ArgumentError(f"{what} is {label!r}; it must be printable text")


def _number_text(value: float) -> str:
    """Return the shortest text that identifies a number, without a trailing ".0"."""
    return repr(float(value)).removesuffix(".0")
