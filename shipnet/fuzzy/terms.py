"""Linguistic terms: what "high" means, as a comparison and as a trapezoid."""

from __future__ import annotations

import re
from dataclasses import dataclass
from math import inf, isfinite, isnan
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from shipnet.errors import ArgumentError

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Bools = npt.NDArray[np.bool_]
Floats = npt.NDArray[np.float64]

_NUMBER = r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]{1,3})?"
_COMPARISON = re.compile(
    rf"(?:(?P<low>{_NUMBER})\s*(?P<from><=?)\s*)?x(?:\s*(?P<sign><=?|>=?|==)\s*(?P<end>{_NUMBER}))?"
)


@dataclass(frozen=True, slots=True)
class Interval:
    """The values for which a comparison holds.

    Parameters
    ----------
    low, high : float
        The ends; -inf or inf where there is none.
    low_closed, high_closed : bool, default False
        Whether an end belongs to the interval.

    Raises
    ------
    ArgumentError
        If the interval is empty, or contains every number.

    Examples
    --------
    >>> low = Interval.parse("0 < x < 2.5")
    >>> low.contains([0, 0.1, 2.5]).tolist(), str(Interval(90, float("inf"), low_closed=True))
    ([False, True, False], 'x >= 90')
    """

    low: float = -inf
    high: float = inf
    low_closed: bool = False
    high_closed: bool = False

    def __post_init__(self) -> None:
        """Check that something lies inside, and something outside."""
        point = self.low == self.high and self.low_closed and self.high_closed
        if not (self.low < self.high or point) or (self.low, self.high) == (-inf, inf):
            raise ArgumentError(
                f"the ends are {self.low:g} and {self.high:g}; some numbers must lie between them, "
                "and some not"
            )

    @classmethod
    def parse(cls, text: str) -> Interval:
        """Return the values for which a comparison such as ``0 < x <= 2.5`` holds."""
        found = _COMPARISON.fullmatch(text.strip())
        both = found and found["low"] and found["sign"] in (">", ">=", "==")
        if not found or both or not (found["low"] or found["sign"]):
            raise ArgumentError(f"comparison is {text!r}; it must be like x > 120 or 0 < x <= 2.5")
        low, high = float(found["low"] or -inf), inf
        low_closed, high_closed = found["from"] == "<=", False
        if found["sign"]:
            end, closed = float(found["end"]), found["sign"] != "<" and found["sign"] != ">"
            if found["sign"][0] in ">=":
                low, low_closed = end, closed
            if found["sign"][0] in "<=":
                high, high_closed = end, closed
        return cls(low, high, low_closed, high_closed)

    def __str__(self) -> str:
        """Write it as `parse` reads it."""
        low, high = number_text(self.low), number_text(self.high)
        if self.low == self.high:
            return f"x == {low}"
        if self.high == inf:
            return f"x >{'=' * self.low_closed} {low}"
        left = f"{low} <{'=' * self.low_closed} " if self.low > -inf else ""
        return f"{left}x <{'=' * self.high_closed} {high}"

    def contains(self, x: npt.ArrayLike) -> Bools:
        """Return which values lie inside; NaN never does."""
        values = np.asarray(x, dtype=float)
        above = values >= self.low if self.low_closed else values > self.low
        below = values <= self.high if self.high_closed else values < self.high
        # Without an end, even infinity lies inside.
        above |= (self.low == -inf) & (values == -inf)
        return np.asarray(above & (below | ((self.high == inf) & (values == inf))))


@dataclass(frozen=True, slots=True)
class Term:
    """A word for some values of a variable.

    Parameters
    ----------
    name : str
        The word, such as ``high``: letters, digits and underscores.
    corners : tuple of float
        Left foot, left shoulder, right shoulder, right foot of the trapezoid, in rising order; two
        equal corners are a step. Both left corners -inf, or both right ones inf: an open shoulder.
    crisp : Interval or str
        What the word means as a comparison; text such as ``x > 90`` is parsed.
    english, korean : str, default ""
        Labels.

    Raises
    ------
    ArgumentError
        If the name is not a word, the corners do not make a trapezoid, or the comparison cannot be
        read.

    Examples
    --------
    >>> hot = Term("hot", (80, 90, float("inf"), float("inf")), "x >= 90")
    >>> hot.membership([70, 85, 90, float("nan")]).tolist(), str(hot.midpoint)
    ([0.0, 0.5, 1.0, 0.0], 'x >= 85')
    """

    name: str
    corners: tuple[float, float, float, float]
    crisp: Interval
    english: str = ""
    korean: str = ""

    if TYPE_CHECKING:

        def __init__(
            self,
            name: str,
            corners: tuple[float, float, float, float],
            crisp: Interval | str,
            english: str = "",
            korean: str = "",
        ) -> None: ...

    def __post_init__(self) -> None:
        """Check the name and the corners."""
        check_word("term", self.name)
        if isinstance(self.crisp, str):
            object.__setattr__(self, "crisp", Interval.parse(self.crisp))
        corners = tuple(float(corner) for corner in self.corners)
        if len(corners) != 4 or any(isnan(corner) for corner in corners):
            raise ArgumentError(f"corners are {corners}; they must be four numbers")
        left, right = corners[:2], corners[2:]
        open_ends = (left == (-inf, -inf), right == (inf, inf))
        if list(corners) != sorted(corners) or all(open_ends):
            raise ArgumentError(f"corners are {corners}; they must rise, with a foot somewhere")
        closed = (() if open_ends[0] else left) + (() if open_ends[1] else right)
        if not all(isfinite(corner) for corner in closed):
            raise ArgumentError(f"corners are {corners}; an open shoulder has no foot")
        object.__setattr__(self, "corners", corners)

    @property
    def midpoint(self) -> Interval:
        """The values with a membership of 0.5 or more: a comparison in the middle of the ramps."""
        a, b, c, d = self.corners
        # A step holds at its edge, and so does the middle of a ramp.
        return Interval(_middle(a, b), _middle(c, d), a > -inf, d < inf)

    def membership(self, x: npt.ArrayLike) -> Floats:
        """Return the degree of membership of each value, 0..1, by `skfuzzy.trapmf`; 0 for NaN."""
        # Importing scikit-fuzzy takes 0.4 s, so a rule base fires without it.
        from skfuzzy.membership import trapmf

        values = np.asarray(x, dtype=float)
        a, b, c, d = self.corners
        # trapmf has no open shoulders: clip the values to the shoulder that there is.
        if a == -inf:
            a = b = c
            values = np.maximum(values, c)
        if d == inf:
            c = d = b
            values = np.minimum(values, b)
        # It takes one axis only, and calls NaN a full member.
        degree = trapmf(values.reshape(-1), [a, b, c, d]).reshape(values.shape)
        return np.where(np.isnan(values), 0.0, degree)


@dataclass(frozen=True, slots=True)
class Variable:
    """A measured quantity with the words for its values.

    Parameters
    ----------
    name : str
        Its symbol, such as ``FP``: letters, digits and underscores.
    unit : str
        Unit of its values, of the universe and of the corners of the terms.
    low, high : float
        Ends of the universe: what a sensor can say.
    terms : tuple of Term
        The words, one or more; each must mean something within the universe.
    english, korean : str, default ""
        Labels.

    Raises
    ------
    ArgumentError
        If the universe is empty, a term occurs twice, or a term has no full member in it.

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
    korean: str = ""

    def __post_init__(self) -> None:
        """Check the universe, and the terms within it."""
        check_word("variable", self.name)
        low, high = float(self.low), float(self.high)
        object.__setattr__(self, "low", low)
        object.__setattr__(self, "high", high)
        object.__setattr__(self, "terms", tuple(self.terms))
        if not (isfinite(low) and isfinite(high) and low < high):
            raise ArgumentError(f"universe of {self.name} is {low:g}..{high:g}; it must be rising")
        names = [term.name for term in self.terms]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice or not names:
            raise ArgumentError(
                f"{self.name} has {f'term {twice[0]} twice' if twice else 'no term'}; "
                "it must have each once, and at least one"
            )
        for term in self.terms:
            self._check_within(term)

    def _check_within(self, term: Term) -> None:
        crisp = term.crisp
        for what, first, last in (
            ("shoulder", term.corners[1], term.corners[2]),
            ("comparison", crisp.low, crisp.high),
        ):
            if last < self.low or first > self.high:
                raise ArgumentError(
                    f"{what} of {self.name}.{term.name} lies outside {self.low:g}..{self.high:g}; "
                    "it must reach into the universe"
                )

    def __getitem__(self, name: str) -> Term:
        """Return the term of a name."""
        for term in self.terms:
            if term.name == name:
                return term
        names = ", ".join(term.name for term in self.terms)
        raise ArgumentError(f"term is {name!r}; {self.name} has {names}")

    def plot(self, ax: Axes | None = None, *, crisp: bool = True) -> Axes:
        """Draw the membership functions, and with `crisp` the limits of the comparisons, dashed."""
        from shipnet.fuzzy.plot import plot_variable

        return plot_variable(self, ax, crisp)


def check_word(what: str, text: str) -> str:
    """Return a name, or raise unless it is letters, digits and underscores, a letter first."""
    if not isinstance(text, str) or not re.fullmatch("[A-Za-z][A-Za-z0-9_]*", text):
        raise ArgumentError(f"{what} is {text!r}; it must be letters, digits and underscores")
    return text


def number_text(value: float) -> str:
    """Return a number with as many digits as distinguish it; ``""`` for an infinite one."""
    return repr(float(value)).removesuffix(".0") if isfinite(value) else ""


def _middle(a: float, b: float) -> float:
    return a if a == b else (a + b) / 2
