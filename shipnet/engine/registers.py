"""The registers of a junction box: the coding of values, and the address map.

lee2012 marks a missing value with 0xFF (section III.2.c) but prints neither the width nor the
scale of a value. Each polled box stores all points, its own and those that it received on CAN, in
the order of the points.
"""

from __future__ import annotations

from collections.abc import Iterable
from math import floor, log10
from typing import Literal

import numpy as np
import numpy.typing as npt

from shipnet.arrays import Floats, Words
from shipnet.engine.points import Point, PointList, by_point
from shipnet.errors import ArgumentError
from shipnet.fields import check_fields, check_scalar, part, record, whole
from shipnet.lazy import pd
from shipnet.modbus.pdu import Request

# Coding of values ------------------------------------------------------------------------------


@record(slots=True)
class Coding:
    """Coding of a value as the content of a register.

    `step` is the value of one count, 1e-6..1e6 in the point's unit. With ``"full scale"`` the
    ends of the range are coded as 0 and as all ones; with ``"decimal"`` the step is the largest
    power of ten up to a thousandth of the span.

    A value that does not fit is clipped to the nearest value that fits. A switch is 0 or 1.

    Examples
    --------
    >>> from shipnet import engine
    >>> exhaust = engine.read_points()[20:21]
    >>> whole = engine.Coding("whole degrees", 1.0, 0x00FF)
    >>> registers = whole.encode(exhaust, [[-1.0], [255.2]])
    >>> registers.ravel().tolist(), whole.decode(exhaust, registers).ravel().tolist()
    ([65535, 255], [-1.0, nan])

    Legal readings that are coded as the error mark:

    >>> for name, coding in engine.CODINGS.items():
    ...     print(name, "->", coding.collisions(engine.read_points()).collides.sum())
    8 bit of the range, 0xFF -> 80
    10 bit of the range, 0x00FF -> 80
    whole units, 0x00FF -> 20
    tenths, 0x00FF -> 73
    whole units, 0xFFFF -> 38
    tenths, 0xFFFF -> 38
    corrected: decimal, 0x8000 -> 0
    """

    name: str
    step: float | Literal["full scale", "decimal"]
    error: int = whole(0, 0xFFFF, "", "Content that marks a missing value")
    bits: int = whole(
        2,
        16,
        "",
        "Bits in use; unless `step` is 'full scale', the number is in two's "
        "complement, with its sign extended to the whole register",
        default=16,
    )

    def __post_init__(self) -> None:
        check_fields(self)
        if self.step not in ("full scale", "decimal"):
            object.__setattr__(self, "step", check_scalar("step", self.step, "", 1e-6, 1e6))

    def step_of(self, point: Point) -> float:
        """Return the value of one count [unit of the point]."""
        if not point.analogue:
            return 1.0
        if self.step == "full scale":
            return float(point.span / (2**self.bits - 1))
        if self.step == "decimal":
            # A rounding error may make the logarithm of 1000 differ from 3.
            return float(10.0 ** floor(log10(point.span / 1000) + 1e-9))
        return float(self.step)

    def encode(
        self, points: Iterable[Point], values: npt.ArrayLike, failed: npt.ArrayLike = False
    ) -> Words:
        """Return the values as registers; NaN and `failed` values get the error mark."""
        listed = PointList(points)
        v = by_point(listed, "values", values).astype(np.float64)
        bad = np.asarray(failed)
        if bad.dtype.kind != "b":
            raise ArgumentError(f"failed is {failed!r}; it must be True or False")
        try:
            missing = np.broadcast_to(bad, v.shape) | np.isnan(v)
        except ValueError:
            raise ArgumentError(f"failed has shape {bad.shape}; values have {v.shape}") from None
        step, zero = self._scale(listed)
        low, high = self._bounds(listed)
        with np.errstate(over="ignore"):
            count = np.floor((np.where(missing, zero, v) - zero) / step + 0.5)
        whole = np.clip(count, low, high).astype(np.int64) & 0xFFFF
        return np.where(missing, self.error, whole).astype(np.uint16)

    def decode(self, points: Iterable[Point], registers: npt.ArrayLike) -> Floats:
        """Return the values of registers; NaN for registers that contain the error mark."""
        listed = PointList(points)
        r = by_point(listed, "registers", registers, "iu")
        if r.size and not 0 <= r.min() <= r.max() <= 0xFFFF:
            raise ArgumentError("registers are out of range; each must be 0..65535")
        step, zero = self._scale(listed)
        return np.where(r == self.error, np.nan, zero + step * self._number(listed, r))

    def _number(self, points: PointList, registers: npt.NDArray[np.integer]) -> Floats:
        """Return the whole numbers that registers contain."""
        r = registers.astype(np.int64)
        signed = self._bounds(points)[0] < 0
        return np.where(signed & (r >= 0x8000), r - 0x10000, r).astype(np.float64)

    def _scale(self, points: PointList) -> tuple[Floats, Floats]:
        """Return the step of each point, and the value for which its register contains 0."""
        full = self.step == "full scale"
        zero = np.array([point.low if full and point.analogue else 0.0 for point in points])
        return np.array([self.step_of(point) for point in points]), zero

    def _bounds(self, points: PointList) -> tuple[Floats, Floats]:
        """Return the lowest and highest number per register, without -32768 if it is the mark."""
        signed = self.step != "full scale"
        high = 2 ** (self.bits - 1 if signed else self.bits) - 1
        low = (-high if self.error == 2**15 else -high - 1) if signed else 0
        ends = np.array([(low, high) if point.analogue else (0, 1) for point in points], np.float64)
        return ends[:, 0], ends[:, 1]

    def collisions(self, points: Iterable[Point]) -> pd.DataFrame:
        """Return the legal readings that are coded as the error mark, one row per point.

        ``reads`` is the value of the mark; readings ``from``..``to`` are mistaken for an error (NaN
        if none are); they cover ``percent`` of the range.
        """
        listed = PointList(points)
        mark = np.full(len(listed), self.error, np.int64)
        number = self._number(listed, mark)
        step, zero = self._scale(listed)
        lowest, highest = self._bounds(listed)
        # Values beyond the ends are clipped to the first or last number, so the outer intervals
        # have no end.
        begin = np.where(number <= lowest, -np.inf, zero + step * (number - 0.5))
        end = np.where(number >= highest, np.inf, zero + step * (number + 0.5))
        low = np.array([point.low for point in listed])
        high = np.array([point.high for point in listed])
        begin, end = np.maximum(begin, low), np.minimum(end, high)
        # The upper end of an interval belongs to the next number, except that a point's range
        # includes its end.
        meet = (begin < end) | ((begin == end) & (begin == high))
        meet &= (number >= lowest) & (number <= highest)
        return pd.DataFrame(
            {
                "tag": [point.tag for point in listed],
                "unit": [point.unit for point in listed],
                "reads": zero + step * number,
                "collides": meet,
                "from": np.where(meet, begin, np.nan),
                "to": np.where(meet, end, np.nan),
                "percent": np.where(meet, 100 * (end - begin) / (high - low), 0.0),
            }
        )


#: Interpretations of the coding, which the paper does not print, and a corrected coding, in which
#: no value equals the error mark.
CODINGS = {
    coding.name: coding
    for coding in (
        Coding("8 bit of the range, 0xFF", "full scale", 0xFF, bits=8),
        Coding("10 bit of the range, 0x00FF", "full scale", 0xFF, bits=10),
        Coding("whole units, 0x00FF", 1.0, 0xFF),
        Coding("tenths, 0x00FF", 0.1, 0xFF),
        Coding("whole units, 0xFFFF", 1.0, 0xFFFF),
        Coding("tenths, 0xFFFF", 0.1, 0xFFFF),
        Coding("corrected: decimal, 0x8000", "decimal", 0x8000),
    )
}

# The address map -------------------------------------------------------------------------------

#: Maximum number of registers that one request reads.
_REQUEST = 125


@record
class RegisterMap:
    """Registers of a junction box, one per point.

    The paper prints neither addresses nor scales; we assume this map.

    Examples
    --------
    >>> from shipnet import engine
    >>> registers = engine.RegisterMap(engine.read_points())
    >>> len(registers), registers.requests()
    (99, (Request.read_holding_registers(0, 99),))
    >>> registers.table().loc[98, ["holds", "box"]].tolist()
    ['ME-JB3-099', 'JB3']
    """

    points: PointList = part(PointList, "One or more points", make=PointList)
    coding: Coding = part(
        Coding,
        "Coding of the values; tenths with the error mark 0x00FF if not given",
        default=CODINGS["tenths, 0x00FF"],
    )

    def __len__(self) -> int:
        return len(self.points)

    def requests(self) -> tuple[Request, ...]:
        """Return the requests that read the whole map, at most 125 registers each."""
        return tuple(
            Request.read_holding_registers(start, min(_REQUEST, len(self) - start))
            for start in range(0, len(self), _REQUEST)
        )

    def table(self) -> pd.DataFrame:
        """Return the address map: the tag that each address ``holds``, its box, step and unit."""
        rows = [(p.tag, p.box, self.coding.step_of(p), p.unit) for p in self.points]
        table = pd.DataFrame(rows, columns=["holds", "box", "step", "unit"])
        return table.rename_axis("address")

    def encode(self, values: npt.ArrayLike, failed: npt.ArrayLike = False) -> Words:
        """Return the content of all registers; NaN and `failed` values get the error mark."""
        return self.coding.encode(self.points, values, failed)

    def decode(self, registers: npt.ArrayLike) -> Floats:
        """Return the values of all points, NaN where a register contains the error mark."""
        return self.coding.decode(self.points, registers)
