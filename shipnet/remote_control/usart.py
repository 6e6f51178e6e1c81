"""The transmitter of the serial chip 8251A, and the loops of chung1998 that feed it.

Simulated time only. The chip is asynchronous, enabled, and clear to send.
"""

from __future__ import annotations

from enum import IntFlag
from typing import NamedTuple

from shipnet.errors import ArgumentError
from shipnet.fields import check_scalar, check_whole

_NEVER = float("inf")

#: Characters for which a program may stay with one byte; then its loop is taken as endless.
_MOST_CHARACTERS = 10_000


class Status(IntFlag):
    """Bits of the status register for sending: Intel, 8251A data sheet, status read format."""

    TXRDY = 0x01
    TXEMPTY = 0x04


class Usart:
    """The transmitter of an 8251A with its line: one byte waits while another is shifted out.

    `line` holds when each byte began to be sent [s], and the byte; `overwritten` the bytes that a
    later write replaced in the transmit buffer before they were sent.

    A byte goes from the buffer to the shift register at once when this is free: TxRDY is then 1
    again. TxEMPTY is 1 when both are empty. The status bit TxRDY, unlike the pin, says that the
    buffer is empty and nothing else (Intel, 8251A data sheet).
    """

    def __init__(self, character_time: float) -> None:
        self.character_time = check_scalar("character_time", character_time, "s", 1e-7, 1.0)
        self.line: list[tuple[float, int]] = []
        self.overwritten: list[int] = []
        self._now = 0.0
        self._shift_free = 0.0
        self._waiting: int | None = None

    def status(self, time: float) -> Status:
        """Return the status register at a time [s], never earlier than the last call."""
        self._advance(time)
        if self._waiting is not None:
            return Status(0)
        return Status.TXRDY | Status.TXEMPTY if self._shift_free <= time else Status.TXRDY

    def write(self, byte: int, time: float) -> None:
        """Write a byte to the transmit buffer, whether it is empty or not."""
        check_whole("byte", byte, 0, 255)
        self._advance(time)
        if self._waiting is not None:
            self.overwritten.append(self._waiting)
        self._waiting = byte
        self._advance(time)

    def finish(self) -> float:
        """Send what is left; return when the last character has ended [s]."""
        if self._waiting is not None:
            self._advance(max(self._now, self._shift_free))
        return max(self._now, self._shift_free)

    def _advance(self, time: float) -> None:
        if not self._now <= time < _NEVER:
            raise ArgumentError(f"time is {time} s; it must be {self._now} or more, and finite")
        if self._waiting is not None and self._shift_free <= time:
            start = max(self._now, self._shift_free)
            self.line.append((start, self._waiting))
            self._waiting, self._shift_free = None, start + self.character_time
        self._now = time


class Sent(NamedTuple):
    """What a loop made of some bytes.

    `line` is what went out from the beginning of the loop on, `writes` how often the program wrote
    to the chip, and `lost` how many bytes never went out (what was waiting in the chip counts too).
    """

    line: bytes
    writes: int
    lost: int


def send_printed(usart: Usart, data: bytes, *, poll: float = 20e-6) -> Sent:
    """Send bytes by the loop as printed, which writes while the chip is not ready.

    ``while((inportb(C8251) & 0x01) != 0x01) { outportb(D8251, ch); }``

    A chip that has nothing to do is ready, so nothing is ever written. On a busy one, the loop
    replaces what waits with its own first byte, and writes this again and again, until by chance
    it asks just when the buffer is empty; with some times of polling it never ends, and raises.
    `poll` is the time to read the status, and to write a byte [s]; the paper names none.
    """
    return _send(usart, data, poll, printed=True)


def send_intended(usart: Usart, data: bytes, *, poll: float = 20e-6) -> Sent:
    """Send bytes by the loop as intended, which waits until the chip is ready and writes once.

    ``while((inportb(C8251) & 0x01) != 0x01); outportb(D8251, ch);``

    The last two characters are still in the chip when the loop ends: a station that switches its
    line driver off must wait for TxEMPTY.
    """
    return _send(usart, data, poll, printed=False)


def _send(usart: Usart, data: bytes, poll: float, *, printed: bool) -> Sent:
    step = check_scalar("poll", poll, "s", 1e-7, 1.0)
    time, writes = 0.0, 0
    waited = not usart.status(time) & Status.TXRDY
    already = len(usart.line)
    # Which byte waits in the chip, by its place in the data; -1 is one that waited before.
    waiting, out = -1, set[int]()

    def write(place: int) -> None:
        nonlocal waiting, writes
        replaced = len(usart.overwritten)
        usart.write(data[place], time)
        if len(usart.overwritten) == replaced:
            out.add(waiting)
        waiting = place
        writes += 1

    for place in range(len(data)):
        begun = time
        while not usart.status(time) & Status.TXRDY:
            # Each round of the printed loop fills the buffer again; if it always asks too early
            # it has no end.
            if time - begun > _MOST_CHARACTERS * usart.character_time:
                raise ArgumentError(
                    f"poll is {step:g} s: byte {place} is still written again after "
                    f"{_MOST_CHARACTERS} characters, because the loop never asks in time"
                )
            time += step
            if printed:
                write(place)
                time += step
        time += step
        if not printed:
            write(place)
            time += step
    usart.finish()
    out.add(waiting)
    line = bytes(byte for _, byte in usart.line[already:])
    lost = len(set(range(-1 if waited else 0, len(data))) - out)
    return Sent(line, writes, lost)
