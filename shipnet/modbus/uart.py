"""A serial line: its characters and silences, its level over time, and what a UART reads.

A character consists of a start bit of level 0, the data with the least significant bit first, an
optional parity bit, and one or two stop bits of level 1; an idle line has level 1.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import numpy as np

from shipnet import style
from shipnet.arrays import Bytes, Floats, Integers
from shipnet.errors import ArgumentError, FormError, ParityError
from shipnet.fields import check_scalar, check_whole, choice, number, record
from shipnet.lazy import Axes
from shipnet.modbus.frame import MAX_PDU, RTU_BYTES

#: Data bits of an RTU character, and the legal characters: data bits, parity, stop bits.
_DATA = 8
CHARACTERS = ("8E1", "8E2", "8O1", "8O2", "8N1", "8N2")


@record(slots=True)
class SerialLine:
    """Settings of an RTU line; "MODBUS over serial line" V1.02, 2006, section 2.5.1.

    Examples
    --------
    >>> line = SerialLine(9600)
    >>> line.character_bits, round(line.t35 * 1e3, 2), round(line.frame_time(8) * 1e3, 2)
    (11, 4.01, 9.17)
    """

    bit_rate: float = number(300, 10e6, "bit/s", "Bit rate")
    character: str = choice(
        CHARACTERS,
        "Data bits (8 in RTU), parity and stop bits. The standard requires 8E1 by "
        "default, and 8N2 without parity; 8N1 is common nevertheless",
        default="8E1",
    )

    #: Highest bit rate at which silences are measured in characters [bit/s], and the fixed
    #: silences at higher bit rates [s]; section 2.5.1.1.
    SILENCE_LIMIT: ClassVar[int] = 19200
    FIXED_T15: ClassVar[float] = 750e-6
    FIXED_T35: ClassVar[float] = 1.75e-3

    @property
    def character_bits(self) -> int:
        """Bits on the line per byte: start, 8 data, parity if any, stop."""
        return 9 + (self.character[1] != "N") + int(self.character[2])

    @property
    def character_time(self) -> float:
        """Time per byte [s]."""
        return self.character_bits / self.bit_rate

    @property
    def t15(self) -> float:
        """Longest silence within a frame [s]."""
        return self.FIXED_T15 if self.bit_rate > self.SILENCE_LIMIT else 1.5 * self.character_time

    @property
    def t35(self) -> float:
        """Shortest silence between two frames [s]."""
        return self.FIXED_T35 if self.bit_rate > self.SILENCE_LIMIT else 3.5 * self.character_time

    def frame_time(self, size: int) -> float:
        """Return the time of a frame of 4..256 bytes, including unit id and CRC [s]."""
        return check_whole("size", size, RTU_BYTES + 1, RTU_BYTES + MAX_PDU) * self.character_time

    def waveform(
        self,
        frames: bytes | Sequence[bytes],
        *,
        gap: float | Sequence[float] | None = None,
        start: float | None = None,
    ) -> Waveform:
        """Return the level while frames are sent, as corners of a step function.

        `gap` is the silence after each frame (one value, or one per frame), and `start` that before
        the first [s]. Both default to t3.5, but a single `gap` is also the default of `start`.
        """
        parts = [frames] if isinstance(frames, bytes | bytearray | memoryview) else list(frames)
        single = self.t35 if gap is None else gap
        if isinstance(single, Sequence):
            pauses = [check_scalar(f"gap[{k}]", one, "s", 0, 3600) for k, one in enumerate(single)]
            if len(pauses) != len(parts):
                raise ArgumentError(f"gap has {len(pauses)} values; there are {len(parts)} frames")
            first = self.t35
        else:
            first = check_scalar("gap", single, "s", 0, 3600)
            pauses = [first] * len(parts)
        begin = check_scalar("start", first if start is None else start, "s", 0, 3600)
        times, levels = [np.zeros(1)], [np.ones(1)]
        for part, pause in zip(parts, pauses, strict=True):
            bits = _line_bits(part, self).ravel()
            times.append(begin + np.arange(bits.size + 1) / self.bit_rate)
            levels.append(np.append(bits, 1))
            begin = times[-1][-1] + pause
        time, level = np.concatenate(times), np.concatenate(levels).astype(np.float64)
        # Of several corners at the same time, keep the last; then keep only changes of the level.
        keep = np.append(np.diff(time) > 0, True)
        time, level = time[keep], level[keep]
        corner = np.append(True, np.diff(level) != 0)
        time, level = np.append(time[corner], begin), np.append(level[corner], level[-1])
        return Waveform(time, level, self)

    def clock_tolerance(self) -> tuple[float, float]:
        r"""Return the lowest and highest relative bit-rate error at which a sender is still read.

        .. math:: -\frac{1/2}{n - 1/2} < \delta < \frac{1/2}{n - 1/2}

        for n bits up to the first stop bit. With two stop bits, the sample of the first stop bit
        may fall into the second one, so the denominator on the right is n - 3/2. Rise times, jitter
        and a receiver that samples the line at discrete times reduce the range.
        """
        n = 1 + _DATA + (self.character[1] != "N") + 1
        stops = int(self.character[2])
        highest = min((n - 1) / (n - 1.5), (n - 1 + stops) / (n - 0.5))
        return (n - 1) / (n - 0.5) - 1, highest - 1


def _line_bits(data: bytes | memoryview, line: SerialLine) -> Bytes:
    """Return the bits of bytes on a line, one row per character."""
    values = np.frombuffer(data, dtype=np.uint8)
    bits = np.ones((values.size, line.character_bits), dtype=np.uint8)
    bits[:, 0] = 0
    bits[:, 1 : 1 + _DATA] = np.unpackbits(values[:, None], axis=1, bitorder="little")
    if line.character[1] != "N":
        odd = line.character[1] == "O"
        bits[:, 1 + _DATA] = bits[:, 1 : 1 + _DATA].sum(axis=1) % 2 ^ odd
    return bits


def read_characters(
    edges: Floats, first: int, bit: float, size: int
) -> tuple[Floats, Integers, int]:
    """Return the starts of characters, their bits from start to first stop bit, and false starts.

    The level is `first` before the first edge. Characters have `size` bits between start and stop
    bit, timed from their start bits. A false start ends before the middle of the start bit.
    """
    falls = edges[first ^ 1 :: 2]

    def level(times: Floats) -> Integers:
        return np.asarray((np.searchsorted(edges, times, side="right") + first) & 1)

    begun = level(falls + bit / 2) == 0
    resume = falls + np.where(begun, size + 1.5, 0.5) * bit
    follow = np.maximum(np.searchsorted(falls, resume), np.arange(len(falls)) + 1).tolist()
    taken, at = [], 0
    while at < len(falls):
        taken.append(at)
        at = follow[at]
    chosen = np.array(taken, dtype=int)
    starts = falls[chosen[begun[chosen]]]
    bits = level(starts[:, np.newaxis] + (np.arange(size + 2) + 0.5) * bit)
    return starts, bits, len(chosen) - len(starts)


def error_codes(bits: Integers, parity: str) -> Integers:
    """Return the error code of each character, given its bits from start to first stop bit."""
    odd = bits[:, 1:-1].sum(axis=1) & 1
    wrong = (parity != "N") & (odd != (parity == "O"))
    codes = np.where(wrong, ParityError.code, 0)
    return np.where(bits[:, -1] == 0, FormError.code, codes)


class Characters(NamedTuple):
    r"""The characters that a receiver reads, with one array entry per character.

    Examples
    --------
    >>> found = SerialLine(9600).waveform(b"\x01\x03").decode()
    >>> found.data, found.code.tolist()
    (b'\x01\x03', [0, 0])
    """

    #: Time at which the receiver detected the edge of the start bit [s].
    time: Floats
    #: The byte, even if it has an error.
    value: Bytes
    #: 0, or the code of `ParityError` or `FormError`; `shipnet.errors.name_of` names it.
    code: Integers

    @property
    def data(self) -> bytes:
        """All bytes, including wrong ones."""
        return self.value.tobytes()


@dataclass(frozen=True, eq=False, repr=False)
class Waveform:
    r"""The level of a line over time, as returned by `SerialLine.waveform`.

    Parameters
    ----------
    time : array_like of float, shape (n_samples,)
        Non-decreasing times [s]: corners of a step function or samples of a scope.
    level : array_like of float, shape (n_samples,)
        Level from each time to the next; above 0.5 it counts as 1. The last level remains.
    line : SerialLine
        Settings of the sender.

    Examples
    --------
    A receiver reads a sender that is 4.5 % fast, but not one that is 5.3 % fast:

    >>> waveform = SerialLine(9600).waveform(b"\x01\x04\x40\x20")
    >>> waveform.decode(SerialLine(9600 / 1.045)).data.hex(" ")
    '01 04 40 20'
    >>> waveform.decode(SerialLine(9600 / 1.053)).code.tolist()
    [13, 13, 13]
    """

    time: Floats
    level: Floats
    line: SerialLine

    def __post_init__(self) -> None:
        at = np.asarray(self.time, dtype=np.float64)
        value = np.asarray(self.level, dtype=np.float64)
        if at.ndim != 1 or at.shape != value.shape:
            raise ArgumentError(
                f"time has shape {at.shape}, level {value.shape}; both must be rows of equal length"
            )
        if not (np.isfinite(at).all() and np.isfinite(value).all()):
            raise ArgumentError("time and level must be finite")
        if (np.diff(at) < 0).any():
            raise ArgumentError("time decreases; it must not decrease")
        object.__setattr__(self, "time", at)
        object.__setattr__(self, "level", value)

    def __repr__(self) -> str:
        end = self.time[-1] if self.time.size else 0.0
        return f"Waveform({self.time.size} corners, {1e3 * end:.3g} ms, {self.line!r})"

    def decode(self, receiver: SerialLine | None = None) -> Characters:
        """Return the characters that a receiver reads; errors become codes, not exceptions.

        `receiver` defaults to the sender's settings; its bit rate may differ. A falling edge begins
        a start bit if the level is still 0 half a bit later; bits are sampled in their middle. A
        first stop bit of 0 is a framing error (`FormError`), which hides a parity error.
        """
        line = self.line if receiver is None else receiver
        # Of several corners at the same time, keep the last one.
        keep = np.append(np.diff(self.time) > 0, True)[: self.time.size]
        time, level = self.time[keep], self.level[keep] > 0.5
        edges, first = time[1:][level[1:] != level[:-1]], int(level[0]) if level.size else 1
        size = _DATA + (line.character[1] != "N")
        starts, bits, _ = read_characters(edges, first, 1 / line.bit_rate, size)
        values = np.packbits(bits[:, 1 : 1 + _DATA].astype(bool), axis=1, bitorder="little")
        return Characters(starts, values.ravel(), error_codes(bits, line.character[1]))

    @style.applied
    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the level over time [ms], with each byte above its data bits; return the axes."""
        ax = style.axes(ax)
        line, time, level = self.line, self.time, self.level
        characters, bit = self.decode(), 1e3 / line.bit_rate
        start = characters.time * 1e3
        data = style.FIELD["information"]
        ax.bar(start + bit, 1, 8 * bit, align="edge", color=data, alpha=0.6)
        for middle, value in zip(
            start + line.character_bits * bit / 2, characters.value, strict=True
        ):
            ax.text(middle, 1.08, f"{value:02X}", ha="center", va="bottom", family="monospace")
        ax.plot(time * 1e3, level, drawstyle="steps-post", color="C0")
        ax.set(xlabel="time [ms]", ylabel="level", xlim=(0, time[-1] * 1e3), ylim=(-0.1, 1.4))
        ax.set_yticks([0, 1])
        return ax
