"""The transmitter of the serial chip 8251A in simulated time, and the loops that feed it."""

from __future__ import annotations

from enum import IntFlag
from math import inf
from typing import NamedTuple

from shipnet.errors import ArgumentError
from shipnet.fields import check_scalar

#: Number of characters after which a loop that still writes the same byte counts as infinite.
_MOST_CHARACTERS = 10_000


class Status(IntFlag):
    """Transmitter bits of the status register: Intel, 8251A data sheet, status read format."""

    TXRDY = 0x01
    TXEMPTY = 0x04


class Usart:
    """The transmitter of an 8251A: one byte waits in the buffer while another is shifted out.

    `line` contains the start time [s] and value of each byte sent. TxRDY means that the buffer is
    empty, TxEMPTY that the shift register is empty too.
    """

    def __init__(self, character_time: float) -> None:
        self.character_time = character_time
        self.line: list[tuple[float, int]] = []
        self._waiting: tuple[float, int] | None = None

    def status(self, time: float) -> Status:
        """Return the status register at `time` [s], which must not decrease from call to call."""
        free = self._shift(time)
        if self._waiting is not None:
            return Status(0)
        return Status.TXRDY | Status.TXEMPTY if free <= time else Status.TXRDY

    def write(self, byte: int, time: float) -> bool:
        """Write a byte to the transmit buffer; return whether it replaced a waiting byte."""
        self._shift(time)
        replaced = self._waiting is not None
        self._waiting = time, byte
        self._shift(time)
        return replaced

    def finish(self) -> float:
        """Send the remaining bytes; return the end of the last character [s]."""
        return self._shift(inf)

    def _shift(self, time: float) -> float:
        """Send the waiting byte if possible; return when the shift register is free [s]."""
        free = self.line[-1][0] + self.character_time if self.line else 0.0
        if self._waiting is None or free > time:
            return free
        written, byte = self._waiting
        self.line.append((max(written, free), byte))
        self._waiting = None
        return self.line[-1][0] + self.character_time


class Sent(NamedTuple):
    """The bytes that a loop sent, its number of writes, and the number of bytes never sent."""

    line: bytes
    writes: int
    lost: int


def send(usart: Usart, data: bytes, *, printed: bool, poll: float = 20e-6) -> Sent:
    """Send bytes with the loop as printed, which writes while TxRDY is 0, or with the intended one.

    The printed loop is ``while((inportb(C8251) & 0x01) != 0x01) { outportb(D8251, ch); }``. It
    never writes to an idle chip. On a busy chip it overwrites the waiting byte until it happens to
    read the status while the buffer is empty; if it never does, ArgumentError is raised.

    The intended loop waits, then writes once. `poll` is the time to read the status or to write a
    byte [s]; the paper does not give it.
    """
    step = check_scalar("poll", poll, "s", 1e-7, 1.0)
    time, writes, lost, already = 0.0, 0, 0, len(usart.line)
    written: set[int] = set()
    for index, byte in enumerate(data):
        begun, ready = time, False
        while not ready:
            ready = bool(usart.status(time) & Status.TXRDY)
            # The printed loop fills the buffer again each time it reads the status too early.
            if not ready and time - begun > _MOST_CHARACTERS * usart.character_time:
                raise ArgumentError(
                    f"poll is {step:g} s: byte {index} is still being rewritten after "
                    f"{_MOST_CHARACTERS} characters, because TxRDY is never set when it is read"
                )
            time += step
            if ready is not printed:
                # A byte that overwrites itself is not lost.
                lost += usart.write(byte, time) and index not in written
                written.add(index)
                writes += 1
                time += step
    usart.finish()
    line = bytes(byte for _, byte in usart.line[already:])
    return Sent(line, writes, lost + len(data) - len(written))
