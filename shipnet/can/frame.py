"""A data or remote frame of classic CAN: what it says, and its bits on the line."""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from shipnet.can.layout import CRC, CRC_BITS, INTERMISSION, TAIL, head, highest_id, payload
from shipnet.can.stuffing import stuff, stuff_places
from shipnet.crc import crc
from shipnet.errors import ArgumentError
from shipnet.fields import check_whole

__all__ = ["Field", "Frame"]


class Field(NamedTuple):
    """One field of a frame, and where it stands without and with stuff bits.

    Attributes
    ----------
    name : str
        Name of the field as the standard has it.
    value : int
        Its bits as a number, the first on the line the highest.
    start, length : int
        First bit and number of bits, stuff bits not counted [bit].
    line_start, line_length : int
        The same on the line; a stuff bit belongs to the field whose bit it follows [bit].
    """

    name: str
    value: int
    start: int
    length: int
    line_start: int
    line_length: int


@dataclass(frozen=True, slots=True)
class Frame:
    """A data or remote frame.

    Parameters
    ----------
    arbitration_id : int
        Arbitration id, 0..2047, or 0..2**29 - 1 if `extended`. The lower goes first.
    data : bytes, default b""
        Up to 8 bytes; none in a remote frame.
    extended : bool, default False
        Whether the arbitration id has 29 bits instead of 11.
    remote : bool, default False
        Whether the frame asks for data instead of carrying them.
    dlc : int, optional
        Data length code, 0..15; the number of data bytes if omitted. 9 to 15 mean 8 bytes, and
        in a remote frame it says how many are asked for.

    Raises
    ------
    ArgumentError
        If a field is out of its range, or `data` and `dlc` do not fit each other.

    Notes
    -----
    The acknowledge slot is dominant, as on a bus where at least one receiver is alive. CAN 2.0
    part A also forbade seven recessive bits at the beginning of an id; ISO 11898-1 does not.

    References
    ----------
    .. [1] Robert Bosch GmbH, "CAN Specification", version 2.0, 1991.
    .. [2] R. I. Davis, A. Burns, R. J. Bril, J. J. Lukkien, "Controller Area Network (CAN)
       schedulability analysis: refuted, revisited and revised", Real-Time Systems 35, 2007.

    Examples
    --------
    The longest frame that there is with 8 bytes and an id of 11 bits; the bound of [2]_ is 135:

    >>> frame = Frame(0x078, bytes.fromhex("01E1E1E1E1E1E00F"))
    >>> frame.stuff_bits, frame.length, frame.length_with_intermission
    (22, 130, 133)
    >>> print(frame)
    078#01E1E1E1E1E1E00F
    >>> frame.bits[:30]
    '000001111100000100100000100000'
    """

    arbitration_id: int
    data: bytes = b""
    extended: bool = False
    remote: bool = False
    dlc: int = None  # type: ignore[assignment]  # None never outlives the constructor

    def __post_init__(self) -> None:
        """Check every field."""
        for name in ("extended", "remote"):
            flag = getattr(self, name)
            if not isinstance(flag, bool | np.bool_):
                raise ArgumentError(f"{name} is {flag!r}; it must be True or False")
            object.__setattr__(self, name, bool(flag))
        why = f" for an id of {29 if self.extended else 11} bits"
        number = check_whole(
            "arbitration_id", self.arbitration_id, 0, highest_id(self.extended), why
        )
        if not isinstance(self.data, bytes | bytearray | memoryview):
            raise ArgumentError(f"data is {self.data!r}; it must be bytes, at most 8")
        data = bytes(self.data)
        if len(data) > 8:
            raise ArgumentError(f"data has {len(data)} bytes; it must have 0..8")
        if self.remote and data:
            raise ArgumentError(f"data has {len(data)} bytes, but a remote frame carries none")
        dlc = len(data) if self.dlc is None else check_whole("dlc", self.dlc, 0, 15)
        if len(data) != payload(dlc, self.remote):
            raise ArgumentError(f"dlc is {dlc}, but data has {len(data)} bytes")
        object.__setattr__(self, "arbitration_id", number)
        object.__setattr__(self, "data", data)
        object.__setattr__(self, "dlc", dlc)

    def _checked_parts(self) -> dict[str, str]:
        """Fields and bits that the CRC is taken over."""
        number = f"{self.arbitration_id:0{29 if self.extended else 11}b}"
        chosen = {
            "base identifier": number[:11],
            "identifier extension": number[11:],
            "RTR": f"{self.remote:b}",
            "DLC": f"{self.dlc:04b}",
        }
        parts = {name: chosen.get(name, fixed) for name, fixed in head(self.extended).items()}
        if self.data:
            parts["data"] = "".join(f"{byte:08b}" for byte in self.data)
        return parts

    @property
    def crc(self) -> int:
        """The check value of 15 bits, over the bits from start of frame to the last of the data."""
        return crc(CRC, "".join(self._checked_parts().values()))

    @property
    def unstuffed(self) -> str:
        """The bits from start of frame to the end of the CRC sequence, without stuff bits."""
        checked = "".join(self._checked_parts().values())
        return f"{checked}{crc(CRC, checked):0{CRC_BITS}b}"

    @property
    def bits(self) -> str:
        """All bits on the line from start of frame to end of frame, with the stuff bits."""
        return stuff(self.unstuffed) + "".join(bits for _, bits in TAIL)

    @property
    def length(self) -> int:
        """Bits on the line from start of frame to end of frame."""
        return len(self.bits)

    @property
    def length_with_intermission(self) -> int:
        """Bits until the next frame may start, what the frame takes of the bus."""
        return self.length + INTERMISSION

    @property
    def stuff_bits(self) -> int:
        """Number of stuff bits."""
        return len(stuff_places(self.unstuffed))

    @property
    def stuff_positions(self) -> tuple[int, ...]:
        """Which of `bits` are stuff bits, counted from 0."""
        return tuple(place + k for k, place in enumerate(stuff_places(self.unstuffed)))

    @property
    def fields(self) -> tuple[Field, ...]:
        """The fields in the order in which they are sent; a field without bits is left out."""
        checked = self._checked_parts()
        parts = checked | {"CRC sequence": f"{self.crc:0{CRC_BITS}b}"} | dict(TAIL)
        places = stuff_places(self.unstuffed)
        fields = []
        start = 0
        for name, bits in parts.items():
            end = start + len(bits)
            on_line, behind = (at + bisect_right(places, at) for at in (start, end))
            fields.append(
                Field(name, int(bits, 2), start, len(bits), on_line, behind - on_line),
            )
            start = end
        return tuple(fields)

    def __str__(self) -> str:
        """Write the frame as the program candump does: id, ``#``, data or ``R``."""
        number = f"{self.arbitration_id:0{8 if self.extended else 3}X}"
        length = min(self.dlc, 8)
        content = (f"R{length or ''}") if self.remote else self.data.hex().upper()
        return f"{number}#{content}" + (f"_{self.dlc:X}" if self.dlc > 8 else "")
