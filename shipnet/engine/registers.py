"""The register map of a junction box: which address holds which point of which box.

Each of the two boxes that the monitoring system asks holds all points, its own and those that it
heard on CAN. The values come first, in the order of the points. A map with status words adds,
for each box: its age, its heartbeat, and one bit a point, set while the value is good.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from shipnet.engine.coding import CODINGS, MENDED, Coding, collisions
from shipnet.engine.points import Point, by_box, check_points
from shipnet.errors import ArgumentError
from shipnet.fields import check_whole
from shipnet.modbus.pdu import Request

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["AGE_STEP", "PACKED_MARK", "Decoded", "RegisterMap", "Word"]

_Floats = npt.NDArray[np.float64]
_Registers = npt.NDArray[np.uint16]

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
    """A register of the map.

    Attributes
    ----------
    kind : {"value", "switches", "age", "heartbeat", "valid"}
        What it holds.
    box : str
        Box that it belongs to; empty if its switches are of several.
    places : tuple of int
        Points in it, by their place in the list; of bits the lowest first.
    """

    kind: Literal["value", "switches", "age", "heartbeat", "valid"]
    box: str
    places: tuple[int, ...]


class Decoded(NamedTuple):
    """What the monitoring system reads out of the registers.

    Attributes
    ----------
    values : ndarray of float, shape (..., n_points)
        Values in the unit of each point; NaN where one is marked.
    ages : ndarray of float, shape (..., n_boxes)
        Age of each box's values [s], rounded up; NaN without status words.
    heartbeats : ndarray of float, shape (..., n_boxes)
        Counter of each box's scans, modulo 65536; NaN without status words.
    """

    values: _Floats
    ages: _Floats
    heartbeats: _Floats


@dataclass(frozen=True, slots=True)
class RegisterMap:
    """Registers of a junction box.

    Parameters
    ----------
    points : iterable of Point
        One or more.
    coding : Coding, optional
        How values become registers; tenths with the error mark 0x00FF if not given.
    switches : {"single", "box", "all"}, default "single"
        Whether each switch has a register, or fifteen share one, those of a box or all in a row.
        Packed switches follow the other values. Those of a word are marked together, by
        `PACKED_MARK`, whatever the coding; with status words each has a validity bit instead, and
        sixteen share a register.
    status : bool, default False
        Whether age, heartbeat and validity bits follow.
    first_address : int, default 0
        Address on the wire of the first register, 0..65535.

    Raises
    ------
    ArgumentError
        If a field is out of range.

    Notes
    -----
    The paper prints neither addresses nor scales; this map is ours.

    Examples
    --------
    >>> from shipnet.engine.points import load_points
    >>> points = load_points()
    >>> printed, mended = RegisterMap(points), RegisterMap.mended(points)
    >>> len(printed), len(RegisterMap(points, switches="all")), len(mended)
    (99, 82, 113)
    >>> mended.table().tail(3)[["address", "kind", "box"]].values.tolist()
    [[110, 'valid', 'JB3'], [111, 'valid', 'JB3'], [112, 'valid', 'JB3']]
    """

    points: tuple[Point, ...]
    coding: Coding = CODINGS["tenths, 0x00FF"]
    switches: Packing = "single"
    status: bool = False
    first_address: int = 0

    def __post_init__(self) -> None:
        """Check every field."""
        object.__setattr__(self, "points", check_points(self.points))
        if not isinstance(self.coding, Coding):
            raise ArgumentError(f"coding is {self.coding!r}; it must be a Coding")
        if self.switches not in ("single", "box", "all"):
            raise ArgumentError(f"switches is {self.switches!r}; it must be single, box or all")
        if not isinstance(self.status, bool):
            raise ArgumentError(f"status is {self.status!r}; it must be True or False")
        most = 0x10000 - len(self)
        why = f" for {len(self)} registers"
        address = check_whole("first_address", self.first_address, 0, most, why)
        object.__setattr__(self, "first_address", address)

    @classmethod
    def mended(cls, points: Iterable[Point], *, first_address: int = 0) -> RegisterMap:
        """Return the map with the mended coding and status words.

        Parameters
        ----------
        points : iterable of Point
            One or more.
        first_address : int, default 0
            As for the class.
        """
        return cls(check_points(points), MENDED, status=True, first_address=first_address)

    @property
    def words(self) -> tuple[Word, ...]:
        """Registers in the order of their addresses."""
        points = enumerate(self.points)
        own = [k for k, point in points if point.analogue or self.switches == "single"]
        words = [Word("value", self.points[k].box, (k,)) for k in own]
        rest = [k for k in range(len(self.points)) if k not in set(own)]
        boxes = tuple(by_box(self.points))
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
        """Return the address map.

        Returns
        -------
        pandas.DataFrame
            One row a register: ``address``, ``kind``, ``box``, ``tags`` (of bits the lowest
            first), ``step`` (what one more is worth) and its ``unit``.
        """
        import pandas as pd

        rows = []
        for address, word in enumerate(self.words, self.first_address):
            tags = ", ".join(self.points[k].tag for k in word.places)
            step, unit = {"age": (AGE_STEP, "s"), "heartbeat": (1.0, "")}.get(word.kind, (1.0, ""))
            if word.kind == "value":
                point = self.points[word.places[0]]
                step, unit = self.coding.step_of(point), point.unit
            rows.append((address, word.kind, word.box, tags, step, unit))
        return pd.DataFrame(rows, columns=["address", "kind", "box", "tags", "step", "unit"])

    def collisions(self) -> pd.DataFrame:
        """Return which legal readings this map cannot tell from a mark.

        Returns
        -------
        pandas.DataFrame
            As `shipnet.engine.coding.collisions`; a packed switch has no reading that is taken for
            the mark of its word.

        Examples
        --------
        A coding whose mark is 1 cannot show a switch in alarm, unless its word is packed:

        >>> from shipnet.engine.points import load_points
        >>> points, coding = load_points(), Coding("mark 1", 1.0, 1)
        >>> maps = [RegisterMap(points, coding, way) for way in ("single", "box")]
        >>> tables = [one.collisions().query("condition == 'switch'") for one in maps]
        >>> [int(table.collides.sum()) for table in tables]
        [19, 0]
        """
        table = collisions(self.points, self.coding)
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

        Parameters
        ----------
        values : array_like of float, shape (..., n_points)
            Values in the unit of each point; NaN counts as failed.
        failed : array_like of bool, default False
            Which values are missing, of a shape that fits.
        ages : array_like of float, default 0
            Age of each box's values, 0 or more, of a shape that fits (..., n_boxes) [s]; rounded
            up.
        heartbeats : array_like of int, default 0
            Counter of each box's scans, 0 or more; its lowest 16 bits are sent.
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
        boxes = tuple(by_box(self.points))
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
        """Return what the monitoring system reads.

        Parameters
        ----------
        registers : array_like of int, shape (..., n_registers)
            Content of all registers, 0..65535.
        """
        r = np.asarray(registers)
        if r.dtype.kind not in "iu" or not r.ndim or r.shape[-1] != len(self):
            raise ArgumentError(f"registers have shape {r.shape}; it must be (..., {len(self)})")
        boxes = tuple(by_box(self.points))
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
        wanted = (*lead, len(by_box(self.points)))
        try:
            return np.broadcast_to(array, wanted)
        except ValueError:
            raise ArgumentError(f"{name} have shape {array.shape}; it must fit {wanted}") from None


def _cut(places: list[int], most: int) -> list[tuple[int, ...]]:
    return [tuple(places[k : k + most]) for k in range(0, len(places), most)]


def _bits(states: npt.NDArray[np.bool_]) -> Any:
    return states @ (1 << np.arange(states.shape[-1]))
