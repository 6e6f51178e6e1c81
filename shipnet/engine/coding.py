"""How a value becomes the content of a register, and which values look like the error mark.

lee2012 marks a value that is missing by 0xFF (section III.2.c) and prints neither the width of a
value nor its scale. `CODINGS` has the readings of that which make sense, and one that is mended.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from math import floor, log10
from typing import TYPE_CHECKING, Literal

import numpy as np
import numpy.typing as npt

from shipnet.engine.points import Point, check_points
from shipnet.errors import ArgumentError
from shipnet.fields import check_scalar, check_whole

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["CODINGS", "MENDED", "Coding", "collisions"]

_Floats = npt.NDArray[np.float64]
_Registers = npt.NDArray[np.uint16]


@dataclass(frozen=True, slots=True)
class Coding:
    """What a register holds.

    Parameters
    ----------
    name : str
        What the coding is called.
    step : float, "full scale" or "decimal"
        What one more in the register is worth, 1e-6..1e6 in the unit of the point. With
        ``"full scale"`` the range fills the bits, from 0 to all ones. With ``"decimal"`` it is the
        largest power of ten within a thousandth of the span.
    error : int
        Content that marks a missing value, 0..65535.
    bits : int, default 16
        Bits in use, 2..16.
    signed : bool, default True
        Whether the highest bit in use is a sign (two's complement over the whole register); a
        full scale has none.

    Raises
    ------
    ArgumentError
        If a field is out of range.

    Notes
    -----
    A value that does not fit is clipped to the nearest content that does. A switch is 0 or 1.

    Examples
    --------
    >>> from shipnet.engine.points import load_points
    >>> exhaust = load_points()[20:21]
    >>> whole = Coding("whole degrees", 1.0, 0x00FF)
    >>> registers = whole.encode(exhaust, [[-1.0], [255.2]])
    >>> registers.ravel().tolist(), whole.decode(exhaust, registers).ravel().tolist()
    ([65535, 255], [-1.0, nan])
    """

    name: str
    step: float | Literal["full scale", "decimal"]
    error: int
    bits: int = 16
    signed: bool = True

    def __post_init__(self) -> None:
        """Check every field."""
        if self.step not in ("full scale", "decimal"):
            object.__setattr__(self, "step", check_scalar("step", self.step, "", 1e-6, 1e6))
        object.__setattr__(self, "error", check_whole("error", self.error, 0, 0xFFFF))
        object.__setattr__(self, "bits", check_whole("bits", self.bits, 2, 16))
        if not isinstance(self.signed, bool):
            raise ArgumentError(f"signed is {self.signed!r}; it must be True or False")

    def step_of(self, point: Point) -> float:
        """Return what one more in the register is worth [unit of the point].

        Parameters
        ----------
        point : Point
            The point.
        """
        if not point.analogue:
            return 1.0
        if self.step == "full scale":
            return float(point.span / (2**self.bits - 1))
        if self.step == "decimal":
            # The logarithm of 1000 may miss 3 by a rounding.
            return float(10.0 ** floor(log10(point.span / 1000) + 1e-9))
        return float(self.step)

    def encode(
        self, points: Iterable[Point], values: npt.ArrayLike, failed: npt.ArrayLike = False
    ) -> _Registers:
        """Return the registers of values.

        Parameters
        ----------
        points : iterable of Point
            One or more.
        values : array_like of float, shape (..., n_points)
            Values in the unit of each point; NaN counts as failed.
        failed : array_like of bool, default False
            Which values are missing, of a shape that fits.
        """
        known = check_points(points)
        v = np.asarray(values)
        if v.dtype.kind not in "iufb" or not v.ndim or v.shape[-1] != len(known):
            raise ArgumentError(f"values have shape {v.shape}; it must be (..., {len(known)})")
        v = v.astype(np.float64)
        bad = np.asarray(failed)
        if bad.dtype.kind != "b":
            raise ArgumentError(f"failed is {failed!r}; it must be True or False")
        try:
            missing = np.broadcast_to(bad, v.shape) | np.isnan(v)
        except ValueError:
            raise ArgumentError(f"failed has shape {bad.shape}, values {v.shape}") from None
        step, zero = self._scale(known)
        low, high = self._bounds(known)
        with np.errstate(over="ignore"):
            count = np.floor((np.where(missing, zero, v) - zero) / step + 0.5)
        whole = np.clip(count, low, high).astype(np.int64) & 0xFFFF
        return np.where(missing, self.error, whole).astype(np.uint16)

    def decode(self, points: Iterable[Point], registers: npt.ArrayLike) -> _Floats:
        """Return the values of registers, NaN where one holds the error mark.

        Parameters
        ----------
        points : iterable of Point
            One or more.
        registers : array_like of int, shape (..., n_points)
            Contents, 0..65535.
        """
        known = check_points(points)
        r = np.asarray(registers)
        if r.dtype.kind not in "iu" or not r.ndim or r.shape[-1] != len(known):
            raise ArgumentError(f"registers have shape {r.shape}; it must be (..., {len(known)})")
        if r.size and not 0 <= r.min() <= r.max() <= 0xFFFF:
            raise ArgumentError("registers are out of range; each must be 0..65535")
        step, zero = self._scale(known)
        return np.where(r == self.error, np.nan, zero + step * self._number(known, r))

    def _number(self, points: tuple[Point, ...], registers: npt.NDArray[np.integer]) -> _Floats:
        """Return the whole numbers that registers stand for."""
        r = registers.astype(np.int64)
        signed = np.array([bool(self._bounds((point,))[0][0] < 0) for point in points])
        return np.where(signed & (r >= 0x8000), r - 0x10000, r).astype(np.float64)

    def _scale(self, points: tuple[Point, ...]) -> tuple[_Floats, _Floats]:
        """Return step and value of content 0, by point."""
        full = self.step == "full scale"
        zero = np.array([point.low if full and point.analogue else 0.0 for point in points])
        return np.array([self.step_of(point) for point in points]), zero

    def _bounds(self, points: tuple[Point, ...]) -> tuple[_Floats, _Floats]:
        """Return the lowest and highest whole number that a register holds, by point.

        The lowest one of two's complement is left out if it is the error mark.
        """
        signed = self.signed and self.step != "full scale"
        high = 2 ** (self.bits - signed) - 1
        low = -high - (self.error != 2**15) if signed else 0
        ends = np.array([(low, high) if point.analogue else (0, 1) for point in points], np.float64)
        return ends[:, 0], ends[:, 1]


#: The mended coding: no value looks like the mark, and `shipnet.engine.registers` says apart from
#: it which values are good and how old they are.
MENDED = Coding("mended: decimal, 0x8000", "decimal", 0x8000)

#: Readings of the coding that the paper does not print, and the mended one, by name.
CODINGS = {
    coding.name: coding
    for coding in (
        Coding("8 bit of the range, 0xFF", "full scale", 0xFF, bits=8),
        Coding("10 bit of the range, 0x00FF", "full scale", 0xFF, bits=10),
        Coding("whole units, 0x00FF", 1.0, 0xFF),
        Coding("tenths, 0x00FF", 0.1, 0xFF),
        Coding("whole units, 0xFFFF", 1.0, 0xFFFF),
        Coding("tenths, 0xFFFF", 0.1, 0xFFFF),
        MENDED,
    )
}


def collisions(points: Iterable[Point], coding: Coding) -> pd.DataFrame:
    """Return which legal readings are coded as the error mark.

    Parameters
    ----------
    points : iterable of Point
        One or more.
    coding : Coding
        How values become registers.

    Returns
    -------
    pandas.DataFrame
        One row a point: ``tag``, ``box``, ``condition``, ``low``, ``high``, ``unit``, ``reads``
        (the value that the mark stands for), ``collides``, ``from`` and ``to``, between which
        readings are taken for an error (NaN if none are), and ``percent``, their part of the
        range.

    Raises
    ------
    ArgumentError
        If there are no points, or `coding` is none.

    Examples
    --------
    >>> from shipnet.engine.points import load_points
    >>> points = load_points()
    >>> for coding in CODINGS.values():
    ...     print(coding.name, "->", collisions(points, coding).collides.sum())
    8 bit of the range, 0xFF -> 80
    10 bit of the range, 0x00FF -> 80
    whole units, 0x00FF -> 20
    tenths, 0x00FF -> 73
    whole units, 0xFFFF -> 38
    tenths, 0xFFFF -> 38
    mended: decimal, 0x8000 -> 0
    """
    import pandas as pd

    known = check_points(points)
    if not isinstance(coding, Coding):
        raise ArgumentError(f"coding is {coding!r}; it must be a Coding")
    mark = np.full(len(known), coding.error, np.int64)
    number = coding._number(known, mark)
    step, zero = coding._scale(known)
    lowest, highest = coding._bounds(known)
    # A clipped value takes the first or the last number, so these reach without end.
    begin = np.where(number <= lowest, -np.inf, zero + step * (number - 0.5))
    end = np.where(number >= highest, np.inf, zero + step * (number + 0.5))
    low = np.array([point.low for point in known])
    high = np.array([point.high for point in known])
    begin, end = np.maximum(begin, low), np.minimum(end, high)
    # The upper end of an interval belongs to the next number, the end of a range to the range.
    meet = (begin < end) | ((begin == end) & (begin == low))
    meet &= (number >= lowest) & (number <= highest)
    return pd.DataFrame(
        {
            "tag": [point.tag for point in known],
            "box": [point.box for point in known],
            "condition": [point.condition for point in known],
            "low": low,
            "high": high,
            "unit": [point.unit for point in known],
            "reads": zero + step * number,
            "collides": meet,
            "from": np.where(meet, begin, np.nan),
            "to": np.where(meet, end, np.nan),
            "percent": np.where(meet, 100 * (end - begin) / (high - low), 0.0),
        }
    )
