"""Frames of classic CAN: encoding, decoding and arbitration.

A transmitter inserts an inverted stuff bit after five equal bits, up to the end of the CRC
sequence. In arbitration, 0 is dominant and wins over any 1 sent at the same time.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from shipnet.crc import CAN as CRC
from shipnet.errors import (
    AcknowledgeError,
    ArgumentError,
    CrcError,
    FormError,
    FrameError,
    LengthError,
    StartBitError,
    StuffError,
    SymbolError,
)
from shipnet.fields import check_scalar, check_whole
from shipnet.lazy import Axes

CRC_BITS = CRC.width  #: Number of bits in the CRC sequence.
INTERMISSION = 3  #: Minimum number of recessive bits between two frames.

#: Fields after the CRC sequence, and their bits if a receiver acknowledges the frame.
TAIL = (("CRC delimiter", "1"), ("ACK slot", "0"), ("ACK delimiter", "1"), ("EOF", "1111111"))

# "x" marks bits that a transmitter chooses; reserved bits are dominant.
_BASE = {"SOF": "0", "base identifier": "x" * 11, "RTR": "x", "IDE": "0", "r0": "0", "DLC": "xxxx"}
_EXTENDED = {
    "SOF": "0",
    "base identifier": "x" * 11,
    "SRR": "1",
    "IDE": "1",
    "identifier extension": "x" * 18,
    "RTR": "x",
    "r1": "0",
    "r0": "0",
    "DLC": "xxxx",
}

HEADS = (_BASE, _EXTENDED)  #: The fields before the data, without and with an extended identifier.


def highest_id(extended: bool) -> int:
    """Return the highest arbitration id, which has the lowest priority."""
    return 2**29 - 1 if extended else 2**11 - 1


def hexadecimal(number: int, extended: bool) -> str:
    """Return an arbitration id as people read it: hexadecimal, with 3 or 8 digits."""
    return f"0x{number:0{8 if extended else 3}X}"


def stuffed_region(n_bytes: int, extended: bool) -> int:
    """Return the number of bits of a frame that are subject to stuffing, without stuff bits."""
    return sum(map(len, HEADS[extended].values())) + 8 * n_bytes + CRC_BITS


def crc_of(bits: str) -> int:
    """Return the CRC of bits; its register starts at 0, so zeros before them do not change it."""
    return CRC.of(int(bits, 2).to_bytes(-(-len(bits) // 8)))


def check_bit_rate(bit_rate: float, low: float = 1000.0) -> float:
    """Return a bit rate as a float; raise an error unless it is `low`..1e6 bit/s."""
    return check_scalar("bit_rate", bit_rate, "bit/s", low, 1e6)


RUN = 5  #: Number of equal bits after which a stuff bit is sent.


def stuff_places(bits: str) -> list[int]:
    """Return the number of bits before each stuff bit, not counting other stuff bits."""
    places, last, run = [], "", 0
    for count, bit in enumerate(bits, start=1):
        run = run + 1 if bit == last else 1
        last = bit
        if run == RUN:
            places.append(count)
            last, run = "10"[int(bit)], 1
    return places


def stuff(bits: str) -> str:
    """Return bits with stuff bits inserted, including one due after the last bit."""
    parts, begin = [], 0
    for count in stuff_places(bits):
        parts += [bits[begin:count], "10"[int(bits[count - 1])]]
        begin = count
    return "".join([*parts, bits[begin:]])


class Field(NamedTuple):
    """A field of a frame: its value, its place without stuff bits, and its place on the line."""

    name: str
    value: int
    start: int
    length: int
    line_start: int
    line_length: int


@dataclass(frozen=True, slots=True, repr=False)
class Frame:
    """A data or remote frame.

    Parameters
    ----------
    arbitration_id : int
        Arbitration id, 0..2047, or 0..2**29 - 1 if `extended`; the lowest has the highest priority.
    data : bytes, default b""
        Data, 0..8 bytes; a remote frame carries none.
    extended : bool, default False
        True if the arbitration id has 29 bits instead of 11.
    remote : bool, default False
        True if the frame requests data instead of carrying data.
    dlc : int, optional
        Data length code, 0..15; by default the number of data bytes. 9..15 mean 8 bytes. In a
        remote frame it is the number of bytes requested.

    Notes
    -----
    The acknowledge slot is dominant, as on a bus with at least one receiver. CAN 2.0 part A also
    forbade ids that begin with seven recessive bits; ISO 11898-1 does not.

    Examples
    --------
    The longest frame with 8 bytes and an 11-bit id; `frame_length` returns a bound of 135 bits:

    >>> frame = Frame(0x078, bytes.fromhex("01E1E1E1E1E1E00F"))
    >>> frame
    Frame(078#01E1E1E1E1E1E00F)
    >>> frame.stuff_bits, len(frame.bits), frame.length
    (22, 130, 133)
    """

    arbitration_id: int
    data: bytes = b""
    extended: bool = False
    remote: bool = False
    dlc: int = None  # type: ignore[assignment]  # None never outlives the constructor

    def __post_init__(self) -> None:
        for name in ("extended", "remote"):
            flag = getattr(self, name)
            if not isinstance(flag, bool | np.bool_):
                raise ArgumentError(f"{name} is {flag!r}; it must be True or False")
            object.__setattr__(self, name, bool(flag))
        bits = 29 if self.extended else 11
        number = check_whole(
            "arbitration_id", self.arbitration_id, 0, 2**bits - 1, f" for an id of {bits} bits"
        )
        if not isinstance(self.data, bytes | bytearray | memoryview):
            raise ArgumentError(f"data is {self.data!r}; it must be bytes, at most 8")
        data = bytes(self.data)
        if len(data) > 8:
            raise ArgumentError(f"data has {len(data)} bytes; it must have 0..8")
        if self.remote and data:
            raise ArgumentError(f"data has {len(data)} bytes, but a remote frame carries none")
        dlc = len(data) if self.dlc is None else check_whole("dlc", self.dlc, 0, 15)
        if len(data) != (0 if self.remote else min(dlc, 8)):
            raise ArgumentError(f"dlc is {dlc}, but data has {len(data)} bytes")
        object.__setattr__(self, "arbitration_id", number)
        object.__setattr__(self, "data", data)
        object.__setattr__(self, "dlc", dlc)

    def _checked_parts(self) -> dict[str, str]:
        """Return the bits of each field that the CRC covers, by the field's name."""
        number = f"{self.arbitration_id:0{29 if self.extended else 11}b}"
        chosen = {
            "base identifier": number[:11],
            "identifier extension": number[11:],
            "RTR": f"{self.remote:b}",
            "DLC": f"{self.dlc:04b}",
        }
        parts = {name: chosen.get(name, fixed) for name, fixed in HEADS[self.extended].items()}
        if self.data:
            parts["data"] = "".join(f"{byte:08b}" for byte in self.data)
        return parts

    @property
    def crc(self) -> int:
        """The 15-bit CRC over all preceding bits, without stuff bits."""
        return int(self.unstuffed[-CRC_BITS:], 2)

    @property
    def unstuffed(self) -> str:
        """The bits from start of frame to the end of the CRC sequence, without stuff bits."""
        checked = "".join(self._checked_parts().values())
        return f"{checked}{crc_of(checked):0{CRC_BITS}b}"

    @property
    def bits(self) -> str:
        """All bits on the line from start to end of frame, including stuff bits."""
        return stuff(self.unstuffed) + "".join(bits for _, bits in TAIL)

    @property
    def length(self) -> int:
        """Number of bits on the bus, including stuff bits and the 3 bits of intermission."""
        return len(self.bits) + INTERMISSION

    @property
    def stuff_bits(self) -> int:
        """Number of stuff bits."""
        return len(stuff_places(self.unstuffed))

    @property
    def stuff_positions(self) -> tuple[int, ...]:
        """Indices of the stuff bits in `bits`, counted from 0."""
        return tuple(count + k for k, count in enumerate(stuff_places(self.unstuffed)))

    @property
    def fields(self) -> tuple[Field, ...]:
        """The fields with at least one bit, in order of transmission."""
        sequence = {"CRC sequence": self.unstuffed[-CRC_BITS:]}
        places = stuff_places(self.unstuffed)
        fields, start = [], 0
        for name, bits in (self._checked_parts() | sequence | dict(TAIL)).items():
            end = start + len(bits)
            on_line, after = (at + bisect_right(places, at) for at in (start, end))
            fields.append(Field(name, int(bits, 2), start, len(bits), on_line, after - on_line))
            start = end
        return tuple(fields)

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the bits in rows, coloured by field, with the line level above each row."""
        from shipnet.can.plot import plot_fields

        fields = [(field.name, field.line_start, field.line_length) for field in self.fields]
        return plot_fields(self.bits, set(self.stuff_positions), fields, ax)

    def __repr__(self) -> str:
        return f"Frame({self})"

    def __str__(self) -> str:
        number = hexadecimal(self.arbitration_id, self.extended)[2:]
        length = min(self.dlc, 8)
        content = (f"R{length or ''}") if self.remote else self.data.hex().upper()
        return f"{number}#{content}" + (f"_{self.dlc:X}" if self.dlc > 8 else "")


def decode(bits: str) -> Frame:
    """Decode the frame at the beginning of a string of bits.

    Parameters
    ----------
    bits : str
        Characters 0 (dominant) and 1 (recessive), from the start of frame, including stuff bits.
        Characters after the end of frame are ignored.

    Returns
    -------
    Frame
        The frame. Its `Frame.bits` may differ from `bits` only in the last bit of the end of frame.

    Raises
    ------
    StartBitError, StuffError, FormError, CrcError, AcknowledgeError
        If the frame violates a rule of CAN; the message names the first wrong bit, counted from 0,
        and its field. For a wrong CRC, it names the last bit before the CRC delimiter.
    LengthError, SymbolError
        If the bits end before the frame does, or a character is neither 0 nor 1.

    Notes
    -----
    A receiver ignores the last bit of the end of frame; a dominant last bit signals overload
    (Bosch, "CAN Specification" 2.0, 1991, part B, section 5). The specification lets receivers
    accept either value of a reserved bit. Here a recessive reserved bit is a `FormError`, because
    on today's buses it marks a CAN FD frame.

    Examples
    --------
    >>> line = Frame(0x123, b"ship").bits
    >>> decode(line)
    Frame(123#73686970)
    >>> decode(line[:20] + "000000" + line[26:])
    Traceback (most recent call last):
        ...
    shipnet.errors.StuffError: bit 22, data: a sixth 0 in a row instead of a stuff bit
    """
    position, run, last, read = 0, 0, "", ""

    def fault(kind: type[FrameError], field: str, what: str) -> FrameError:
        """Return the error for the bit that was read last."""
        return kind(f"bit {position - 1}, {field}: {what}")

    def raw(field: str) -> str:
        """Return the next bit, which may be a stuff bit."""
        nonlocal position, run, last
        if position >= len(bits):
            raise LengthError(f"the bits end before bit {position}, in the {field}")
        bit = bits[position]
        if bit not in "01":
            raise SymbolError(f"bit {position}, {field}: {bit!r} is neither 0 nor 1")
        run = run + 1 if bit == last else 1
        last, position = bit, position + 1
        return bit

    def skip_stuff_bit(field: str) -> None:
        """Read a stuff bit if one is due."""
        if run == RUN and raw(field) and run > RUN:
            raise fault(StuffError, field, f"a sixth {last} in a row instead of a stuff bit")

    def take(field: str, length: int = 1) -> str:
        """Read and return the bits of a field, without stuff bits; a reserved bit is dominant."""
        nonlocal read
        for _ in range(length):
            skip_stuff_bit(field)
            read += raw(field)
        if field in ("r0", "r1") and last == "1":
            what = "recessive, but dominant in classic CAN; is it CAN FD?"
            raise fault(FormError, field, what)
        return read[len(read) - length :]

    if take("SOF") == "1":
        raise fault(StartBitError, "SOF", "recessive; a frame starts with a dominant bit")
    number = take("base identifier", 11)
    remote = take("RTR or SRR")
    extended = take("IDE") == "1"
    if extended:
        if remote == "0":
            raise fault(FormError, "IDE", "recessive after a dominant SRR")
        number += take("identifier extension", 18)
        remote = take("RTR")
        take("r1")
    take("r0")
    dlc = int(take("DLC", 4), 2)
    data = take("data", 0 if remote == "1" else 8 * min(dlc, 8))
    expected = crc_of(read)
    received = int(take("CRC sequence", CRC_BITS), 2)
    skip_stuff_bit("CRC sequence")
    if received != expected:
        what = f"received {received:#06x}, but computed {expected:#06x}"
        raise fault(CrcError, "CRC sequence", what)
    for field, fixed in TAIL:
        for index, right in enumerate(fixed, start=1):
            if raw(field) == right or (field == "EOF" and index == len(fixed)):
                continue
            if field == "ACK slot":
                raise fault(AcknowledgeError, field, "recessive; no receiver acknowledged")
            raise fault(FormError, field, "dominant instead of recessive")
    content = int(data, 2).to_bytes(len(data) // 8, "big") if data else b""
    return Frame(int(number, 2), content, extended, remote == "1", dlc)


class Arbitration(NamedTuple):
    """The outcome of an arbitration, as returned by `arbitrate`.

    `bus` contains the bits on the bus, including stuff bits, up to the last bit that can decide the
    outcome (IDE, or RTR of an extended frame). `stopped` contains, for each frame, the index of the
    bit at which its sender stopped, or None for the winner.

    Examples
    --------
    >>> arbitrate([Frame(0x200), Frame(0x101)]).winner
    Frame(101#)
    """

    frames: tuple[Frame, ...]
    bus: str
    stopped: tuple[int | None, ...]

    @property
    def winner(self) -> Frame:
        """The frame that wins."""
        return self.frames[self.stopped.index(None)]

    def plot(
        self, names: Sequence[str] = (), ax: Axes | None = None, *, upto: int | None = None
    ) -> Axes:
        """Draw one row of bits per sender above the bits on the bus.

        `names` are the labels of the rows, by default the frames; `upto` is the last bit shown.
        """
        from shipnet.can.plot import plot_contest

        if names and len(names) != len(self.frames):
            raise ArgumentError(f"there are {len(names)} names for {len(self.frames)} frames")
        stuffed = [set(frame.stuff_positions) for frame in self.frames]
        bits = [frame.bits for frame in self.frames]
        rows = zip(names or map(str, self.frames), bits, stuffed, self.stopped, strict=True)
        return plot_contest(list(rows), self.bus, ax, upto)


def arbitrate(frames: Sequence[Frame]) -> Arbitration:
    """Return the arbitration, bit by bit, between frames that begin at the same time.

    Parameters
    ----------
    frames : sequence of Frame
        One or more frames; no two may have the same id, id length and kind.

    Returns
    -------
    Arbitration
        The bits on the bus, and the bit at which each sender stopped.

    Notes
    -----
    Every node is assumed to read the same level within the bit time, as on a short bus (Bosch, "CAN
    Specification" 2.0, 1991, section 1).

    Examples
    --------
    0x200 sends a 1 in bit 2, where the others send 0. 0x101 differs from 0x100 in the last bit of
    the id, which is bit 12 on the bus because a stuff bit precedes it:

    >>> contest = arbitrate([Frame(0x200), Frame(0x101), Frame(0x100)])
    >>> contest.stopped, contest.bus
    ((2, 12, None), '000100000100000')
    """
    contenders = tuple(frames)
    if not contenders:
        raise ArgumentError("frames is empty; it must contain at least one Frame")
    rows = [frame.bits for frame in contenders]
    ends = [_end(frame) for frame in contenders]
    active = set(range(len(contenders)))
    stopped: list[int | None] = [None] * len(contenders)
    bus = ""
    while len(bus) < max(ends[k] for k in active):
        index = len(bus)
        level = min(rows[k][index] for k in active)
        for k in sorted(active):
            if rows[k][index] != level:
                stopped[k] = index
                active.remove(k)
        bus += level
    if len(active) > 1:
        same = " and ".join(str(contenders[k]) for k in sorted(active))
        raise ArgumentError(f"frames {same} have the same id; they would collide in their data")
    return Arbitration(contenders, bus, tuple(stopped))


def _end(frame: Frame) -> int:
    """Return the number of bits, with stuff bits, up to the last one that can be decisive."""
    last = "RTR" if frame.extended else "IDE"
    return 1 + next(field.line_start for field in frame.fields if field.name == last)
