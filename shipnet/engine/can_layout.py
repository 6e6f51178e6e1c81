"""The values of the boxes as CAN messages: which bytes of which frame hold which point.

The paper prints no mapping, so this one is ours: a box sends its analogue values one after the
other, `bits` each, high bit first, filled up to a whole byte, then its switches, eight to a byte,
the first in the lowest bit as Modbus packs coils; and cuts these bytes into frames of eight.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from shipnet.can.messages import packed
from shipnet.engine.points import PointList
from shipnet.errors import ArgumentError
from shipnet.fields import check_whole, part, record, whole
from shipnet.lazy import pd

if TYPE_CHECKING:
    from shipnet.can.messages import MessageSet

#: Data bytes of a classic CAN frame; ISO 11898-1.
_FRAME = 8

#: Identifiers from one box to the next: the box's number times 256, the highest 11-bit one.
_ID_STEP, _HIGHEST_ID = 0x100, 0x7FF

_Values = npt.NDArray[np.uint16]
_Bytes = npt.NDArray[np.uint8]


@record
class CanLayout:
    """Which CAN frame holds which point: box k sends the identifiers from 0x100 k up, k = 1..7.

    Raises
    ------
    ArgumentError
        If there are no points or more than 7 boxes, or `bits` is out of range.

    Notes
    -----
    The identifiers, and so the priorities, are assumed: JB1 before JB2 before JB3. If `bits` does
    not divide 64, some values lie in two frames: between the arrivals of both a receiver holds
    half of an old and half of a new one. `table` shows which.

    Examples
    --------
    >>> from shipnet import engine
    >>> points = engine.read_points()
    >>> layout = engine.CanLayout(points)
    >>> len(layout.messages()), [layout.size(box) for box in layout.boxes]
    (22, [75, 33, 56])
    >>> frames = layout.encode([k * point.analogue for k, point in enumerate(points)])
    >>> bytes(frames["JB1-01"]).hex(" ")
    '00 00 00 01 00 02 00 03'
    >>> layout.volume().loc["all", ["bytes", "frames", "worst_bits", "ms_125k"]].tolist()
    [164.0, 22.0, 2850.0, 22.8]
    """

    points: PointList = part(PointList, "One or more points", make=PointList)
    bits: int = whole(1, 16, "", "Bits of an analogue value", default=16)

    def __post_init__(self) -> None:
        """Check that the identifiers suffice."""
        most = _HIGHEST_ID // _ID_STEP
        if len(self.boxes) > most:
            raise ArgumentError(f"there are {len(self.boxes)} boxes; there must be 1..{most}")
        largest = max(self.size(box) for box in self.boxes)
        if largest > _FRAME * _ID_STEP:
            raise ArgumentError(f"a box has {largest} bytes; its identifiers suffice for 2048")

    @cached_property
    def boxes(self) -> tuple[str, ...]:
        """Boxes in the order of their points."""
        return self.points.boxes

    def size(self, box: str) -> int:
        """Return how many data bytes a box sends."""
        return self._packed(box)[1]

    def messages(self, period: float = 1.0) -> MessageSet:
        """Return the message set, with one update per `period` [s]; the paper prints none."""
        from shipnet.can.messages import Message, MessageSet

        return MessageSet(
            Message(name, identifier, dlc, period, sender=box)
            for box in self.boxes
            for name, identifier, dlc in self._frames(box)
        )

    def encode(self, values: npt.ArrayLike) -> dict[str, _Bytes]:
        """Return the data bytes of each frame, for codes of shape (..., n_points)."""
        codes = self._checked(values)
        frames: dict[str, _Bytes] = {}
        for box in self.boxes:
            analogue, switches = self._analogue(box), self._switches(box)
            shifts = np.arange(self.bits - 1, -1, -1, dtype=np.uint16)
            stream = codes[..., analogue, np.newaxis] >> shifts & 1
            flat = stream.reshape(*codes.shape[:-1], len(analogue) * self.bits).astype(np.uint8)
            states = codes[..., switches].astype(np.uint8)
            data = np.concatenate(
                [np.packbits(flat, axis=-1), np.packbits(states, axis=-1, bitorder="little")],
                axis=-1,
            )
            for place, (name, _, dlc) in enumerate(self._frames(box)):
                frames[name] = data[..., _FRAME * place : _FRAME * place + dlc]
        return frames

    def decode(self, frames: Mapping[str, Any]) -> _Values:
        """Return the codes that frames hold, from the bytes of every message by its name."""
        rows = self._checked_frames(frames)
        shape = next(iter(rows.values())).shape[:-1]
        codes = np.zeros((*shape, len(self.points)), np.uint16)
        weights = 1 << np.arange(self.bits - 1, -1, -1)
        for box in self.boxes:
            analogue, switches = self._analogue(box), self._switches(box)
            data = np.concatenate([rows[name] for name, _, _ in self._frames(box)], axis=-1)
            split = -(-len(analogue) * self.bits // 8)
            flat = np.unpackbits(data[..., :split], axis=-1, count=len(analogue) * self.bits)
            digits = flat.reshape(*shape, len(analogue), self.bits)
            codes[..., analogue] = digits @ weights
            states = data[..., split:]
            codes[..., switches] = np.unpackbits(
                states, axis=-1, count=len(switches), bitorder="little"
            )
        return codes

    def table(self) -> pd.DataFrame:
        """Return in which message and byte every point begins, and its last message: by tag."""
        columns = ["tag", "box", "message", "byte", "bits", "last_message"]
        return pd.DataFrame(self._rows(), columns=columns).set_index("tag")

    def volume(
        self, bit_rates: Sequence[int] = (125_000, 250_000, 500_000, 1_000_000)
    ) -> pd.DataFrame:
        """Return how much one update of all boxes puts on the bus, by box and for ``all``.

        ``worst_bits`` and ``worst_extended_bits`` are for 11-bit and 29-bit identifiers,
        intermission included; ``ms_125k`` and so on is the time of the worst bits of the former.
        """
        from shipnet.can.lengths import Stuffing, frame_length

        rates = [check_whole("bit_rates", rate, 1000, 10**6, " bit/s") for rate in bit_rates]
        table = pd.DataFrame(
            {
                "analogue": [len(self._analogue(box)) for box in self.boxes],
                "switches": [len(self._switches(box)) for box in self.boxes],
                "bytes": [self.size(box) for box in self.boxes],
                "frames": [len(self._frames(box)) for box in self.boxes],
            },
            index=list(self.boxes),
        )
        dlcs = [[dlc for _, _, dlc in self._frames(box)] for box in self.boxes]
        ways: dict[str, tuple[bool, Stuffing]] = {
            "nominal_bits": (False, "none"),
            "worst_bits": (False, "worst"),
            "worst_extended_bits": (True, "worst"),
        }
        for column, (extended, way) in ways.items():
            table[column] = [
                int(frame_length(dlc, stuffing=way, extended=extended).sum()) for dlc in dlcs
            ]
        table.loc["all"] = table.sum()
        for rate in rates:
            table[f"ms_{rate / 1000:g}k"] = table["worst_bits"] / rate * 1e3
        return table

    def _rows(self) -> list[tuple[str, str, str, int, int, str]]:
        """Return tag, box, message, byte, bits and last message of every point."""
        rows = {}
        for box in self.boxes:
            names = [name for name, _, _ in self._frames(box)]
            for k, first in zip(self._places(box), self._packed(box)[0].tolist(), strict=True):
                width = self.bits if self.points[k].analogue else 1
                ends = [place // 8 // _FRAME for place in (first, first + width - 1)]
                byte = first // 8 % _FRAME
                rows[k] = (self.points[k].tag, box, names[ends[0]], byte, width, names[ends[1]])
        return [rows[k] for k in sorted(rows)]

    @cached_property
    def message_of(self) -> npt.NDArray[np.int64]:
        """Number of the message in which each point begins, shape (n_points,)."""
        names = [name for box in self.boxes for name, _, _ in self._frames(box)]
        return np.array([names.index(row[2]) for row in self._rows()], dtype=np.int64)

    def _places(self, box: str) -> list[int]:
        found = [k for k, point in enumerate(self.points) if point.box == box]
        if not found:
            raise ArgumentError(f"box is {box!r}; it must be one of {', '.join(self.boxes)}")
        return found

    def _analogue(self, box: str) -> list[int]:
        return [k for k in self._places(box) if self.points[k].analogue]

    def _switches(self, box: str) -> list[int]:
        return [k for k in self._places(box) if not self.points[k].analogue]

    def _packed(self, box: str) -> tuple[npt.NDArray[np.intp], int]:
        """Return the first bit of each point of a box in its data, and the bytes of these."""
        return packed([self.points[k].analogue for k in self._places(box)], self.bits)

    def _frames(self, box: str) -> list[tuple[str, int, int]]:
        """Return name, identifier and data bytes of each frame of a box."""
        first = (self.boxes.index(box) + 1) * _ID_STEP
        rest = self.size(box)
        return [
            (f"{box}-{n + 1:02}", first + n, min(rest - _FRAME * n, _FRAME))
            for n in range(-(-rest // _FRAME))
        ]

    def _checked(self, values: npt.ArrayLike) -> _Values:
        array = np.asarray(values)
        n = len(self.points)
        if array.dtype.kind not in "iub" or not array.ndim or array.shape[-1] != n:
            raise ArgumentError(
                f"values are {array.dtype} of shape {array.shape}; they must be whole numbers of "
                f"shape (..., {n})"
            )
        highest = np.array([2**self.bits - 1 if p.analogue else 1 for p in self.points])
        bad = (array < 0) | (array > highest)
        if bad.any():
            worst = np.argwhere(bad)[0]
            k = worst[-1]
            raise ArgumentError(
                f"value of {self.points[k].tag} is {array[tuple(worst)]}; it must be a whole "
                f"number 0..{highest[k]}"
            )
        return array.astype(np.uint16)

    def _checked_frames(self, frames: Mapping[str, Any]) -> dict[str, _Bytes]:
        wanted = {name: dlc for box in self.boxes for name, _, dlc in self._frames(box)}
        if set(frames) != set(wanted):
            missing, strange = set(wanted) - set(frames), set(frames) - set(wanted)
            raise ArgumentError(
                f"frames lack {sorted(missing)} and hold {sorted(strange)} beside those of the set"
            )
        rows = {}
        for name, dlc in wanted.items():
            data = frames[name]
            if isinstance(data, bytes | bytearray | memoryview):
                data = np.frombuffer(data, np.uint8)
            row = np.asarray(data)
            if row.dtype != np.uint8 or not row.ndim or row.shape[-1] != dlc:
                raise ArgumentError(
                    f"frame {name} is {row.dtype} of shape {row.shape}; it must be uint8 of shape "
                    f"(..., {dlc})"
                )
            rows[name] = row
        if len({row.shape[:-1] for row in rows.values()}) > 1:
            raise ArgumentError("frames differ in their leading shape; they must have the same")
        return rows
