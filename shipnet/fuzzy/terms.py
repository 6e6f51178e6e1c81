"""Linguistic terms: what "high" means, as a comparison and as a trapezoid."""

from __future__ import annotations

import re
from dataclasses import dataclass
from math import inf, isfinite, isnan

import numpy as np
import numpy.typing as npt

from shipnet.errors import ArgumentError

__all__ = ["Interval", "Term", "Variable"]

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
        Its ends; -inf or inf where it has none.
    low_closed, high_closed : bool, default False
        Whether an end belongs to it.

    Raises
    ------
    ArgumentError
        If it is empty, or holds every number.

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
        """Return the values for which a comparison of x with numbers holds.

        Parameters
        ----------
        text : str
            Such as ``x > 120``, ``0 < x <= 2.5`` or ``x == 0``.
        """
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
        """Return which values lie inside; NaN never does.

        Parameters
        ----------
        x : array_like of float, any shape
            Values.
        """
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
        equal ones are a step. Both left corners -inf, or both right ones inf: an open shoulder.
    crisp : Interval
        What the word means without any fuzziness.
    english, korean : str, default ""
        Labels.

    Raises
    ------
    ArgumentError
        If the name is no word, or the corners make no trapezoid.

    Examples
    --------
    >>> hot = Term("hot", (80, 90, float("inf"), float("inf")), Interval.parse("x >= 90"))
    >>> hot.membership([70, 85, 90, float("nan")]).tolist(), str(hot.dead_band)
    ([0.0, 0.5, 1.0, 0.0], 'x >= 85')
    """

    name: str
    corners: tuple[float, float, float, float]
    crisp: Interval
    english: str = ""
    korean: str = ""

    def __post_init__(self) -> None:
        """Check the name and the corners."""
        check_word("term", self.name)
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
    def dead_band(self) -> Interval:
        """The values with a membership of 0.5 or more: the comparison with shifted limits."""
        a, b, c, d = self.corners
        # A step holds at its edge, and so does the middle of a ramp.
        return Interval(_middle(a, b), _middle(c, d), a > -inf, d < inf)

    def membership(self, x: npt.ArrayLike) -> Floats:
        r"""Return the degree of membership of each value.

        .. math:: \mu = \min \left( \frac{x - a}{b - a}, 1, \frac{d - x}{d - c} \right)

        Parameters
        ----------
        x : array_like of float, any shape
            Values.

        Returns
        -------
        ndarray of float, the shape of `x`
            0..1; 0 for NaN.
        """
        values = np.asarray(x, dtype=float)
        a, b, c, d = self.corners
        up = _ramp(values, a, b) if a > -inf else None
        down = _ramp(-values, -d, -c) if d < inf else None
        if up is None or down is None:
            one = down if up is None else up
            assert one is not None
            return one
        return np.asarray(np.minimum(up, down, out=up if up.ndim else None))


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
        If the universe is empty, a term stands twice, or has no full member in the universe.

    Examples
    --------
    >>> still = Term("still", (-float("inf"), -float("inf"), 0.5, 1.5), Interval.parse("x == 0"))
    >>> Variable("DVPos", "%/s", 0, 30, (still,)).term("still").crisp.high
    0.0
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

    def term(self, name: str) -> Term:
        """Return the term of a name.

        Parameters
        ----------
        name : str
            One of the terms' names.
        """
        for term in self.terms:
            if term.name == name:
                return term
        names = ", ".join(term.name for term in self.terms)
        raise ArgumentError(f"term is {name!r}; {self.name} has {names}")


def check_word(what: str, text: str) -> str:
    """Return a name, or raise unless it is a word that an antecedent can hold.

    Parameters
    ----------
    what : str
        What it names.
    text : str
        Letters, digits and underscores, a letter first, as ``VPos``.

    Returns
    -------
    str
        The name.
    """
    if not isinstance(text, str) or not re.fullmatch("[A-Za-z][A-Za-z0-9_]*", text):
        raise ArgumentError(f"{what} is {text!r}; it must be letters, digits and underscores")
    return text


def number_text(value: float) -> str:
    """Return a number as short as it can be told from all others.

    Parameters
    ----------
    value : float
        The number.

    Returns
    -------
    str
        Such as ``120`` or ``0.05``; ``""`` for an infinite one.
    """
    return repr(float(value)).removesuffix(".0") if isfinite(value) else ""


def _middle(a: float, b: float) -> float:
    return a if a == b else (a + b) / 2


def _ramp(x: Floats, foot: float, shoulder: float) -> Floats:
    """Return 0 up to the foot, 1 from the shoulder on, 0 for NaN."""
    if foot == shoulder:
        return np.asarray(x >= foot).astype(float)
    # fmax drops a NaN, which so becomes 0. Nothing overflows, however narrow the ramp.
    part = np.asarray(np.fmax(x, foot))
    np.minimum(part, shoulder, out=part)
    part -= foot
    part /= shoulder - foot
    return part
