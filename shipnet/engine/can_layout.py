"""Mapping of measuring points to CAN messages: the frame and the bytes that contain each point.

The paper prints no mapping; we assume this one. A box sends its analogue values first, with `bits`
bits each, most significant bit first, padded to a whole byte; then its switches, eight per byte,
the first in the least significant bit. The data are sent in frames of at most 8 bytes.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from shipnet.arrays import Integers
from shipnet.can.lengths import Stuffing, frame_length
from shipnet.can.messages import Message, MessageSet, packed
from shipnet.engine.points import PointList
from shipnet.errors import ArgumentError
from shipnet.fields import check_fields, part, record, whole
from shipnet.lazy import pd

#: Largest number of data bytes in a classic CAN frame; ISO 11898-1.
_FRAME = 8

#: Distance between the first identifiers of consecutive boxes, and the highest 11-bit identifier.
_ID_STEP, _HIGHEST_ID = 0x100, 0x7FF


@record
class CanLayout:
    """The mapping of points to CAN frames: box k (1 to 7) sends identifiers from 0x100 * k up.

    The identifiers, and therefore the priorities, are assumed: JB1 before JB2 before JB3. If `bits`
    does not divide 64, values may be split between two frames; `table` shows which.

    Examples
    --------
    >>> from shipnet import engine
    >>> layout = engine.CanLayout(engine.read_points())
    >>> len(layout.messages()), layout.volume().bytes.to_dict()
    (22, {'JB1': 75, 'JB2': 33, 'JB3': 56, 'all': 164})
    >>> layout.volume().loc["all", ["bytes", "frames", "worst_bits", "ms_125k"]].tolist()
    [164.0, 22.0, 2850.0, 22.8]
    """

    points: PointList = part(PointList, "One or more points", make=PointList)
    bits: int = whole(1, 16, "", "Bits of an analogue value", default=16)

    def __post_init__(self) -> None:
        check_fields(self)
        sizes, most = self._packed[1], _HIGHEST_ID // _ID_STEP
        if len(sizes) > most:
            raise ArgumentError(f"there are {len(sizes)} boxes; there must be 1..{most}")
        if (largest := max(sizes.values())) > _FRAME * _ID_STEP:
            raise ArgumentError(f"a box has {largest} bytes; the limit is 2048")

    @cached_property
    def _packed(self) -> tuple[Integers, dict[str, int]]:
        """First bit of each point in the data of all messages, and data bytes per box."""
        first, sizes = np.empty(len(self.points), np.int64), dict[str, int]()
        for box, points in self.points.by_box().items():
            starts, size = packed([point.analogue for point in points], self.bits)
            first[[point.box == box for point in self.points]] = 8 * sum(sizes.values()) + starts
            sizes[box] = size
        return first, sizes

    @cached_property
    def _width(self) -> Integers:
        """Bits of each point, shape (n_points,)."""
        return np.array([self.bits if point.analogue else 1 for point in self.points])

    def messages(self, period: float = 1.0) -> MessageSet:
        """Return the message set, with one update per `period` [s]; the paper prints no period."""
        return MessageSet(
            Message(
                f"{box}-{n + 1:02}",
                number * _ID_STEP + n,
                min(_FRAME, size - _FRAME * n),
                period,
                sender=box,
            )
            for number, (box, size) in enumerate(self._packed[1].items(), 1)
            for n in range(-(-size // _FRAME))
        )

    @cached_property
    def _spans(self) -> dict[str, slice]:
        """The byte range of each message in the data of all messages."""
        dlc = np.array([message.dlc for message in self.messages()])
        ends = np.cumsum(dlc)
        spans = map(slice, (ends - dlc).tolist(), ends.tolist())
        return dict(zip((message.name for message in self.messages()), spans, strict=True))

    def table(self) -> pd.DataFrame:
        """Return the first message, first byte and last message of each point, by tag."""
        names = np.array(list(self._spans), dtype=object)
        begins = np.array([span.start for span in self._spans.values()])
        first, last = self.message_of, self._message_at(self._packed[0] + self._width - 1)
        columns = {
            "box": [point.box for point in self.points],
            "message": names[first],
            "byte": self._packed[0] // 8 - begins[first],
            "bits": self._width,
            "last_message": names[last],
        }
        index = pd.Index([point.tag for point in self.points], name="tag")
        return pd.DataFrame(columns, index=index)

    def volume(self) -> pd.DataFrame:
        """Return the amount of data in one update, per box and in total (``all``).

        ``worst_bits`` and ``worst_extended_bits`` are for 11-bit and 29-bit identifiers,
        intermission included; ``ms_125k`` to ``ms_1000k`` are the durations of ``worst_bits`` [ms].
        """
        messages = self.messages()
        frames = pd.DataFrame(
            {"box": [m.sender for m in messages], "bytes": [m.dlc for m in messages]}
        )
        ways: dict[str, tuple[bool, Stuffing]] = {
            "nominal_bits": (False, "none"),
            "worst_bits": (False, "worst"),
            "worst_extended_bits": (True, "worst"),
        }
        for column, (extended, way) in ways.items():
            bits = frame_length(frames["bytes"], stuffing=way, extended=extended)
            frames[column] = bits.astype(int)
        counts = self.points.counts()[["analogue", "switch"]].set_axis(
            ["analogue", "switches"], axis=1
        )
        of_box = frames.groupby("box", sort=False)
        sums = of_box.sum()
        sums.insert(1, "frames", of_box.size())
        table = counts.join(sums, how="inner")
        table.loc["all"] = table.sum()
        for rate in (125_000, 250_000, 500_000, 1_000_000):
            table[f"ms_{rate / 1000:g}k"] = table["worst_bits"] / rate * 1e3
        return table

    @cached_property
    def message_of(self) -> Integers:
        """Index of the message in which each point begins, shape (n_points,)."""
        return self._message_at(self._packed[0])

    def _message_at(self, bit: Integers) -> Integers:
        begins = [span.start for span in self._spans.values()]
        return np.asarray(np.searchsorted(begins, bit // 8, side="right") - 1)
