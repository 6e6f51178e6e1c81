"""Bits on the line -> frame: what a receiver does, and where it finds fault."""

from __future__ import annotations

from shipnet.can.frame import Frame
from shipnet.can.layout import CRC, CRC_BITS, TAIL, payload
from shipnet.can.stuffing import RUN
from shipnet.crc import crc
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

__all__ = ["decode"]


class _Line:
    """The bits that arrive, read field by field without their stuff bits."""

    def __init__(self, bits: str) -> None:
        self.bits = bits
        self.position = 0
        self.last = ""
        self.run = 0
        self.read = ""

    def raw(self, field: str) -> str:
        """Return the next bit as it is."""
        if self.position >= len(self.bits):
            raise LengthError(f"the bits end before bit {self.position}, in the {field}")
        bit = self.bits[self.position]
        if bit not in "01":
            raise SymbolError(f"bit {self.position}, {field}: {bit!r} is neither 0 nor 1")
        self.run = self.run + 1 if bit == self.last else 1
        self.last = bit
        self.position += 1
        return bit

    def skip_stuff_bit(self, field: str) -> None:
        """Read the stuff bit if one is due."""
        if self.run == RUN:
            bit = self.raw(field)
            if self.run > RUN:
                raise StuffError(
                    f"bit {self.position - 1}, {field}: a sixth {bit} in a row instead of a stuff "
                    "bit"
                )

    def take(self, field: str, length: int) -> str:
        """Return the bits of a field that is subject to stuffing."""
        taken = ""
        for _ in range(length):
            self.skip_stuff_bit(field)
            taken += self.raw(field)
        self.read += taken
        return taken

    def fault(self, kind: type[FrameError], field: str, what: str) -> FrameError:
        """Return the error for the bit that was read last."""
        return kind(f"bit {self.position - 1}, {field}: {what}")

    def reserved(self, field: str) -> None:
        """Read a reserved bit, which is dominant."""
        if self.take(field, 1) == "1":
            raise self.fault(
                FormError, field, "recessive, as in no frame of classic CAN; is it CAN FD?"
            )


def decode(bits: str) -> Frame:
    """Read the frame that a stream of bits begins with.

    Parameters
    ----------
    bits : str
        Characters 0 (dominant) and 1, from start of frame on, with stuff bits. What follows the
        end of frame is not looked at.

    Returns
    -------
    Frame
        What was sent. Its `bits` are those given but perhaps for the last of end of frame.

    Raises
    ------
    StartBitError
        If the first bit is recessive.
    StuffError
        If six bits in a row are equal between start of frame and the CRC delimiter.
    CrcError
        If the CRC sequence is not the one computed.
    FormError
        If a reserved bit or a delimiter or the end of frame has the wrong value.
    AcknowledgeError
        If the acknowledge slot is recessive.
    LengthError
        If the bits end before the frame does.
    SymbolError
        If a character of the frame is neither 0 nor 1.
    ArgumentError
        If `bits` is no str.

    Notes
    -----
    Faults are found in the order in which they pass on the line, and the first is raised; its
    message names the bit, counted from 0, and the field. The CRC is judged when its last bit has
    passed. A receiver does not mind the last bit of end of frame: dominant, it is an overload
    condition [1]_.

    The specification lets receivers accept reserved bits of either value. Here they are refused,
    since a `Frame` could not say them: on today's buses they mean CAN FD.

    References
    ----------
    .. [1] Robert Bosch GmbH, "CAN Specification", version 2.0, 1991, part B, section 5.

    Examples
    --------
    >>> line = Frame(0x123, b"ship").bits
    >>> print(decode(line + "111"))
    123#73686970
    >>> decode(line[:20] + "000000" + line[26:])
    Traceback (most recent call last):
        ...
    shipnet.errors.StuffError: bit 22, data: a sixth 0 in a row instead of a stuff bit
    """
    if not isinstance(bits, str):
        raise ArgumentError(f"bits are {type(bits).__name__}; they must be a str of 0 and 1")
    line = _Line(bits)
    if line.take("SOF", 1) == "1":
        raise line.fault(StartBitError, "SOF", "recessive; a frame starts with a dominant bit")
    number = line.take("base identifier", 11)
    remote = line.take("RTR or SRR", 1)
    extended = line.take("IDE", 1) == "1"
    if extended:
        if remote == "0":
            raise line.fault(FormError, "IDE", "recessive behind a dominant SRR")
        number += line.take("identifier extension", 18)
        remote = line.take("RTR", 1)
        line.reserved("r1")
    line.reserved("r0")
    dlc = int(line.take("DLC", 4), 2)
    data = line.take("data", 8 * payload(dlc, remote == "1"))
    expected = crc(CRC, line.read)
    received = int(line.take("CRC sequence", CRC_BITS), 2)
    line.skip_stuff_bit("CRC sequence")
    if received != expected:
        raise line.fault(
            CrcError, "CRC sequence", f"received {received:#06x}, but computed {expected:#06x}"
        )
    for field, fixed in TAIL:
        for place, right in enumerate(fixed, start=1):
            if line.raw(field) == right or (field == "EOF" and place == len(fixed)):
                continue
            if field == "ACK slot":
                raise line.fault(AcknowledgeError, field, "recessive; no receiver answered")
            raise line.fault(FormError, field, "dominant instead of recessive")
    content = int(data, 2).to_bytes(len(data) // 8, "big") if data else b""
    return Frame(int(number, 2), content, extended, remote == "1", dlc)
