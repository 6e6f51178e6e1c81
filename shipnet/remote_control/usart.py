"""The serial chip 8251A: one byte waits in the transmit buffer while another is shifted out.

Simulated time only. The chip is asynchronous, enabled in both directions, and clear to send.
"""

from __future__ import annotations

from collections import Counter
from enum import IntFlag
from typing import NamedTuple

from shipnet.errors import ArgumentError
from shipnet.fields import check_scalar, check_whole

_NEVER = float("inf")

#: Characters for which a program may stay with one byte; then its loop is taken as endless.
_MOST_CHARACTERS = 10_000


class Status(IntFlag):
    """Bits of the status register: Intel, 8251A data sheet, status read format."""

    TXRDY = 0x01
    RXRDY = 0x02
    TXEMPTY = 0x04
    PARITY = 0x08
    OVERRUN = 0x10
    FRAMING = 0x20
    SYNDET = 0x40
    DSR = 0x80


class Usart:
    """An 8251A with its line.

    `line` holds when each byte began to be sent [s], and the byte; `overwritten` the bytes that a
    later write replaced in the transmit buffer before they were sent.

    A byte goes from the buffer to the shift register at once when this is free: TxRDY is then 1
    again. TxEMPTY is 1 when both are empty. The status bit TxRDY, unlike the pin, says that the
    buffer is empty and nothing else. A received byte that is not read within a character time is
    replaced by the next one, and the overrun bit is set until `reset_errors`. Parity, framing,
    break and modem bits are never set here (Intel, 8251A data sheet).
    """

    def __init__(self, character_time: float) -> None:
        self.character_time = check_scalar("character_time", character_time, "s", 1e-7, 1.0)
        self.line: list[tuple[float, int]] = []
        self.overwritten: list[int] = []
        self._now = 0.0
        self._shift_free = 0.0
        self._waiting: int | None = None
        self._received: int | None = None
        self._overrun = False

    def status(self, time: float) -> Status:
        """Return the status register at a time [s], never earlier than the last call."""
        self._advance(time)
        status = Status(0)
        if self._waiting is None:
            status |= Status.TXRDY
            if self._shift_free <= time:
                status |= Status.TXEMPTY
        if self._received is not None:
            status |= Status.RXRDY
        return status | Status.OVERRUN if self._overrun else status

    def write(self, byte: int, time: float) -> None:
        """Write a byte to the transmit buffer, whether it is empty or not."""
        check_whole("byte", byte, 0, 255)
        self._advance(time)
        if self._waiting is not None:
            self.overwritten.append(self._waiting)
        self._waiting = byte
        self._advance(time)

    def receive(self, byte: int, time: float) -> None:
        """Let a byte arrive from the line, its last bit at this time [s]."""
        check_whole("byte", byte, 0, 255)
        self._advance(time)
        self._overrun |= self._received is not None
        self._received = byte

    def read(self, time: float) -> int:
        """Return the byte received last, and be ready for the next; raise if none has arrived."""
        self._advance(time)
        if self._received is None:
            raise ArgumentError(f"time is {time} s, but no byte has arrived; RxRDY must be 1")
        byte, self._received = self._received, None
        return byte

    def reset_errors(self) -> None:
        """Clear the error bits, as the command instruction does."""
        self._overrun = False

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
    to the chip, `lost` and `repeated` how many bytes never went out or went out in excess (what
    was waiting in the chip counts too), and `busy` how long the program was in its loop [s].
    """

    line: bytes
    writes: int
    lost: int
    repeated: int
    busy: float


def send_printed(usart: Usart, data: bytes, *, start: float = 0.0, poll: float = 20e-6) -> Sent:
    """Send bytes by the loop as printed, which writes while the chip is not ready.

    ``while((inportb(C8251) & 0x01) != 0x01) { outportb(D8251, ch); }``

    A chip that has nothing to do is ready, so nothing is ever written. On a busy one, the loop
    replaces what waits with its own first byte, and writes this again and again, until by chance
    it asks just when the buffer is empty; with some times of polling it never ends, and raises.
    `poll` is the time to read the status, and to write a byte [s]; the paper names none.
    """
    return _send(usart, data, start, poll, printed=True)


def send_intended(usart: Usart, data: bytes, *, start: float = 0.0, poll: float = 20e-6) -> Sent:
    """Send bytes by the loop as intended, which waits until the chip is ready and writes once.

    ``while((inportb(C8251) & 0x01) != 0x01); outportb(D8251, ch);``

    The program is busy for all characters but the last two, which are in the chip when it ends. A
    station that switches its line driver off must wait for TxEMPTY.
    """
    return _send(usart, data, start, poll, printed=False)


def _send(usart: Usart, data: bytes, start: float, poll: float, *, printed: bool) -> Sent:
    step = check_scalar("poll", poll, "s", 1e-7, 1.0)
    time, writes = start, 0
    usart.status(time)
    already = len(usart.line)
    # Which byte waits in the chip, by its place in the data; -1 is one that waited before.
    waiting = None if usart._waiting is None else -1
    due = range(0 if waiting is None else -1, len(data))
    out: Counter[int] = Counter()

    def write(place: int) -> None:
        nonlocal waiting, writes
        replaced = len(usart.overwritten)
        usart.write(data[place], time)
        if waiting is not None and len(usart.overwritten) == replaced:
            out[waiting] += 1
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
    if waiting is not None:
        out[waiting] += 1
    line = bytes(byte for _, byte in usart.line[already:])
    lost = sum(out[place] == 0 for place in due)
    repeated = sum(times - 1 for times in out.values() if times)
    return Sent(line, writes, lost, repeated, time - start)
