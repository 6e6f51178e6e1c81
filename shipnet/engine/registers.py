"""The registers of a junction box: how a value becomes a register, and which address holds what.

lee2012 marks a value that is missing by 0xFF (section III.2.c) and prints neither the width of a
value nor its scale. `CODINGS` has the readings of that which make sense, and a corrected one.

Each of the two boxes that the monitoring system asks holds all points, its own and those that it
heard on CAN. The values come first, in the order of the points. A map with status words adds, for
each box: its age, its heartbeat, and one bit per point, set while the value is good.
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import cached_property
from math import floor, log10
from typing import Any, Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from shipnet.arrays import Bools, Floats
from shipnet.engine.points import Point, PointList
from shipnet.errors import ArgumentError
from shipnet.fields import check_scalar, check_whole, choice, part, record, switch, whole
from shipnet.lazy import pd
from shipnet.modbus.pdu import Request

_Registers = npt.NDArray[np.uint16]


# How a value becomes the content of a register -------------------------------------------------


@record(slots=True)
class Coding:
    """What a register holds.

    `step` is what one more in the register is worth, 1e-6..1e6 in the unit of the point. With
    ``"full scale"`` the range fills the bits, from 0 to all ones. With ``"decimal"`` it is the
    largest power of ten within a thousandth of the span.

    Notes
    -----
    A value that does not fit is clipped to the nearest content that does. A switch is 0 or 1.

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
    bits: int = whole(2, 16, "", "Bits in use", default=16)
    signed: bool = switch(
        "Whether the highest bit in use is a sign (two's complement over the whole register); a "
        "full scale has none", default=True,
    )  # fmt: skip

    def __post_init__(self) -> None:
        """Check the step."""
        if self.step not in ("full scale", "decimal"):
            object.__setattr__(self, "step", check_scalar("step", self.step, "", 1e-6, 1e6))

    def step_of(self, point: Point) -> float:
        """Return what one more in the register is worth [unit of the point]."""
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
        """Return the registers of values; NaN, and what is `failed`, becomes the error mark."""
        known = PointList(points)
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

    def decode(self, points: Iterable[Point], registers: npt.ArrayLike) -> Floats:
        """Return the values of registers, NaN where one holds the error mark."""
        known = PointList(points)
        r = np.asarray(registers)
        if r.dtype.kind not in "iu" or not r.ndim or r.shape[-1] != len(known):
            raise ArgumentError(f"registers have shape {r.shape}; it must be (..., {len(known)})")
        if r.size and not 0 <= r.min() <= r.max() <= 0xFFFF:
            raise ArgumentError("registers are out of range; each must be 0..65535")
        step, zero = self._scale(known)
        return np.where(r == self.error, np.nan, zero + step * self._number(known, r))

    def _number(self, points: PointList, registers: npt.NDArray[np.integer]) -> Floats:
        """Return the whole numbers that registers hold."""
        r = registers.astype(np.int64)
        signed = self._bounds(points)[0] < 0
        return np.where(signed & (r >= 0x8000), r - 0x10000, r).astype(np.float64)

    def _scale(self, points: PointList) -> tuple[Floats, Floats]:
        """Return step and value of content 0, by point."""
        full = self.step == "full scale"
        zero = np.array([point.low if full and point.analogue else 0.0 for point in points])
        return np.array([self.step_of(point) for point in points]), zero

    def _bounds(self, points: PointList) -> tuple[Floats, Floats]:
        """Return the lowest and highest whole number that a register holds, by point.

        The lowest one of two's complement is left out if it is the error mark.
        """
        signed = self.signed and self.step != "full scale"
        high = 2 ** (self.bits - signed) - 1
        low = -high - (self.error != 2**15) if signed else 0
        ends = np.array([(low, high) if point.analogue else (0, 1) for point in points], np.float64)
        return ends[:, 0], ends[:, 1]

    def collisions(self, points: Iterable[Point]) -> pd.DataFrame:
        """Return which legal readings are coded as the error mark, one row per point.

        ``reads`` is the value of the mark; readings between ``from`` and ``to`` are taken for an
        error (NaN if none are), which is ``percent`` of the range.
        """
        known = PointList(points)
        mark = np.full(len(known), self.error, np.int64)
        number = self._number(known, mark)
        step, zero = self._scale(known)
        lowest, highest = self._bounds(known)
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


#: The corrected coding: no value looks like the mark, and status words say apart from it which
#: values are good and how old they are.
CORRECTED = Coding("corrected: decimal, 0x8000", "decimal", 0x8000)

#: Readings of the coding that the paper does not print, and the corrected one, by name.
CODINGS = {
    coding.name: coding
    for coding in (
        Coding("8 bit of the range, 0xFF", "full scale", 0xFF, bits=8),
        Coding("10 bit of the range, 0x00FF", "full scale", 0xFF, bits=10),
        Coding("whole units, 0x00FF", 1.0, 0xFF),
        Coding("tenths, 0x00FF", 0.1, 0xFF),
        Coding("whole units, 0xFFFF", 1.0, 0xFFFF),
        Coding("tenths, 0xFFFF", 0.1, 0xFFFF),
        CORRECTED,
    )
}


# Which address holds what ----------------------------------------------------------------------

#: What one more in an age register is worth [s]; the highest content is "so old or older".
AGE_STEP = 0.1

#: What marks a word of packed switches. Its highest bit holds no switch, so no states look like it,
#: as eight switches in alarm would look like 0x00FF.
PACKED_MARK = 0x8000

#: Points in one word of validity bits, switches in one that can be marked, and registers in one
#: request.
_WORD, _SWITCHES, _REQUEST = 16, 15, 125

Packing = Literal["single", "box", "all"]


class Word(NamedTuple):
    """A register: what it holds, of which box, and the places of its points, lowest bit first."""

    kind: Literal["value", "switches", "age", "heartbeat", "valid"]
    box: str
    places: tuple[int, ...]


class Decoded(NamedTuple):
    """What the monitoring system reads: values by point, ages [s] and heartbeats by box.

    A value is NaN where it is marked; without status words, ages and heartbeats are NaN.
    """

    values: Floats
    ages: Floats
    heartbeats: Floats


@record
class RegisterMap:
    """Registers of a junction box.

    Notes
    -----
    The paper prints neither addresses nor scales; this map is ours.

    Examples
    --------
    >>> from shipnet import engine
    >>> points = engine.read_points()
    >>> printed, corrected = engine.RegisterMap(points), engine.RegisterMap.corrected(points)
    >>> len(printed), len(engine.RegisterMap(points, switches="all")), len(corrected)
    (99, 82, 113)
    >>> corrected.table().tail(4)["kind"].to_dict()
    {109: 'heartbeat', 110: 'valid', 111: 'valid', 112: 'valid'}
    """

    points: PointList = part(PointList, "One or more points", make=PointList)
    coding: Coding = part(
        Coding, "How values become registers; tenths with the error mark 0x00FF if not given",
        default=CODINGS["tenths, 0x00FF"],
    )  # fmt: skip
    switches: Packing = choice(
        ("single", "box", "all"),
        "Whether each switch has a register, or fifteen share one, those of a box or all in a row. "
        "Packed switches follow the other values. Those of a word are marked together, by "
        "`PACKED_MARK`, whatever the coding; with status words each has a validity bit instead, "
        "and sixteen share a register", default="single",
    )  # fmt: skip
    status: bool = switch("Whether age, heartbeat and validity bits follow", default=False)
    first_address: int = whole(
        0, 0xFFFF, "", "Address on the wire of the first register", default=0
    )

    def __post_init__(self) -> None:
        """Check that the last address exists."""
        why = f" for {len(self)} registers"
        check_whole("first_address", self.first_address, 0, 0x10000 - len(self), why)

    @classmethod
    def corrected(cls, points: Iterable[Point], *, first_address: int = 0) -> RegisterMap:
        """Return the map with the corrected coding and status words."""
        return cls(PointList(points), CORRECTED, status=True, first_address=first_address)

    @cached_property
    def words(self) -> tuple[Word, ...]:
        """Registers in the order of their addresses."""
        points = enumerate(self.points)
        own = [k for k, point in points if point.analogue or self.switches == "single"]
        words = [Word("value", self.points[k].box, (k,)) for k in own]
        rest = [k for k in range(len(self.points)) if k not in set(own)]
        boxes = self.points.boxes
        most = _WORD if self.status else _SWITCHES
        if self.switches == "all":
            words += [Word("switches", self._box(part), part) for part in _cut(rest, most)]
        else:
            for box in boxes:
                part = [k for k in rest if self.points[k].box == box]
                words += [Word("switches", box, places) for places in _cut(part, most)]
        for box in boxes if self.status else ():
            places = [k for k, point in enumerate(self.points) if point.box == box]
            words += [Word("age", box, ()), Word("heartbeat", box, ())]
            words += [Word("valid", box, part) for part in _cut(places, _WORD)]
        return tuple(words)

    def __len__(self) -> int:
        return len(self.words)

    def requests(self) -> tuple[Request, ...]:
        """Return the requests that read the whole map, 125 registers each at most."""
        size = len(self)
        return tuple(
            Request.read_holding_registers(
                self.first_address + start,
                min(_REQUEST, size - start),
            )
            for start in range(0, size, _REQUEST)
        )

    def table(self) -> pd.DataFrame:
        """Return the address map: by address the kind, box, tags (lowest bit first) and step."""
        rows = []
        for address, word in enumerate(self.words, self.first_address):
            tags = ", ".join(self.points[k].tag for k in word.places)
            step, unit = {"age": (AGE_STEP, "s"), "heartbeat": (1.0, "")}.get(word.kind, (1.0, ""))
            if word.kind == "value":
                point = self.points[word.places[0]]
                step, unit = self.coding.step_of(point), point.unit
            rows.append((address, word.kind, word.box, tags, step, unit))
        columns = ["address", "kind", "box", "tags", "step", "unit"]
        return pd.DataFrame(rows, columns=columns).set_index("address")

    def collisions(self) -> pd.DataFrame:
        """Return which legal readings this map cannot distinguish from a mark.

        As `Coding.collisions`, but a packed switch never collides with the mark of its word.
        """
        table = self.coding.collisions(self.points)
        packed = [k for word in self.words if word.kind == "switches" for k in word.places]
        table.loc[packed, "collides"] = False
        table.loc[packed, ["reads", "from", "to"]] = np.nan
        table.loc[packed, "percent"] = 0.0
        return table

    def encode(
        self,
        values: npt.ArrayLike,
        failed: npt.ArrayLike = False,
        *,
        ages: npt.ArrayLike = 0.0,
        heartbeats: npt.ArrayLike = 0,
    ) -> _Registers:
        """Return the content of all registers.

        `values` and `failed` are by point, `ages` [s] and `heartbeats` by box; NaN counts as
        failed, and ages are rounded up.
        """
        single = self.coding.encode(self.points, values, failed)
        lead = single.shape[:-1]
        given = np.asarray(values, np.float64)
        missing = np.isnan(given) | np.broadcast_to(failed, given.shape)
        age = np.asarray(ages, np.float64)
        beat = np.asarray(heartbeats)
        if not (age >= 0).all():
            raise ArgumentError(f"ages are {ages!r} s; they must be 0 or more")
        if beat.dtype.kind not in "iu" or (beat < 0).any():
            raise ArgumentError(f"heartbeats are {heartbeats!r}; they must be whole, 0 or more")
        boxes = self.points.boxes
        # 0.3 s are 3.0000000000000004 tenths, which must not become 4.
        tenths = np.minimum(np.ceil(age / AGE_STEP - 1e-9), 0xFFFF)
        per_box = {
            "age": self._by_box("ages", tenths, lead),
            "heartbeat": self._by_box("heartbeats", beat & 0xFFFF, lead),
        }
        registers = np.zeros((*lead, len(self)), np.uint16)
        for n, word in enumerate(self.words):
            places = list(word.places)
            if word.kind == "value":
                registers[..., n] = single[..., places[0]]
            elif word.kind in per_box:
                registers[..., n] = per_box[word.kind][..., boxes.index(word.box)]
            elif word.kind == "valid":
                registers[..., n] = _bits(~missing[..., places])
            else:
                gone = missing[..., places]
                # With status words a switch is marked there, and its neighbours stay readable.
                marked = gone.any(axis=-1) & (not self.status)
                states = np.where(gone, False, given[..., places] >= 0.5)
                registers[..., n] = np.where(marked, PACKED_MARK, _bits(states))
        return registers

    def decode(self, registers: npt.ArrayLike) -> Decoded:
        """Return what the monitoring system reads."""
        r = np.asarray(registers)
        if r.dtype.kind not in "iu" or not r.ndim or r.shape[-1] != len(self):
            raise ArgumentError(f"registers have shape {r.shape}; it must be (..., {len(self)})")
        boxes = self.points.boxes
        single = np.zeros((*r.shape[:-1], len(self.points)), np.int64)
        ages, beats = (np.full((*r.shape[:-1], len(boxes)), np.nan) for _ in range(2))
        good = np.ones(single.shape, np.bool_)
        packed = []
        for n, word in enumerate(self.words):
            places, content = list(word.places), r[..., n]
            if word.kind == "value":
                single[..., places[0]] = content
            elif word.kind == "switches":
                marked = (content == PACKED_MARK) & (not self.status)
                states = content[..., np.newaxis] >> np.arange(len(places)) & 1
                packed.append((places, np.where(marked[..., np.newaxis], np.nan, states)))
            elif word.kind == "age":
                ages[..., boxes.index(word.box)] = content * AGE_STEP
            elif word.kind == "heartbeat":
                beats[..., boxes.index(word.box)] = content
            else:
                good[..., places] = content[..., np.newaxis] >> np.arange(len(places)) & 1 == 1
        values = self.coding.decode(self.points, single)
        for places, states in packed:
            values[..., places] = states
        return Decoded(np.where(good, values, np.nan), ages, beats)

    def _box(self, places: tuple[int, ...]) -> str:
        boxes = {self.points[k].box for k in places}
        return boxes.pop() if len(boxes) == 1 else ""

    def _by_box(self, name: str, array: Any, lead: tuple[int, ...]) -> Any:
        wanted = (*lead, len(self.points.boxes))
        try:
            return np.broadcast_to(array, wanted)
        except ValueError:
            raise ArgumentError(f"{name} have shape {array.shape}; it must fit {wanted}") from None


def _cut(places: list[int], most: int) -> list[tuple[int, ...]]:
    return [tuple(places[k : k + most]) for k in range(0, len(places), most)]


def _bits(states: Bools) -> Any:
    return states @ (1 << np.arange(states.shape[-1]))
