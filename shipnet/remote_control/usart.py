"""The serial chip 8251A: one byte waits in the transmit buffer while another is shifted out.

Simulated time only. The chip is asynchronous, enabled in both directions, and clear to send.
"""

from __future__ import annotations

from collections import Counter
from enum import IntFlag
from typing import NamedTuple

from shipnet.errors import ArgumentError
from shipnet.fields import check_scalar, check_whole

__all__ = ["Sent", "Status", "Usart", "send_meant", "send_printed"]

_NEVER = float("inf")

#: Characters for which a program may stay with one byte; then its loop is taken as endless.
_MOST_CHARACTERS = 10_000


class Status(IntFlag):
    """Bits of the status register.

    References
    ----------
    .. [1] Intel, "8251A programmable communication interface", data sheet, status read format.
    """

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

    Parameters
    ----------
    character_time : float
        How long a character takes with all its bits, 1e-7..1 [s].

    Attributes
    ----------
    line : list of (float, int)
        When each byte began to be sent [s], and the byte.
    overwritten : list of int
        Bytes that a later write replaced in the transmit buffer before they were sent.

    Raises
    ------
    ArgumentError
        If `character_time` is out of range.

    Notes
    -----
    A byte goes from the buffer to the shift register at once when this is free: TxRDY is then 1
    again. TxEMPTY is 1 when both are empty. The status bit TxRDY, other than the pin, says that
    the buffer is empty and nothing else [1]_. A received byte that is not read within a character
    time is replaced by the next one, and the overrun bit is set until `reset_errors`.

    Parity, framing, break and modem bits are never set here.

    References
    ----------
    .. [1] Intel, "8251A programmable communication interface", data sheet.

    Examples
    --------
    Two bytes fit, one in the shift register and one in the buffer; a third replaces the second:

    >>> chip = Usart(10 / 9600)
    >>> for byte in (0xCC, 0xDD, 0xEE):
    ...     print(chip.status(0.0) & Status.TXRDY)
    ...     chip.write(byte, 0.0)
    1
    1
    0
    >>> chip.finish()
    0.0020833333333333333
    >>> [hex(byte) for _, byte in chip.line], chip.overwritten
    (['0xcc', '0xee'], [221])
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
        """Return the status register.

        Parameters
        ----------
        time : float
            When it is read [s]; never earlier than the last call.
        """
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
        """Write a byte to the transmit buffer, whether it is empty or not.

        Parameters
        ----------
        byte : int
            The byte, 0..255.
        time : float
            When [s].
        """
        check_whole("byte", byte, 0, 255)
        self._advance(time)
        if self._waiting is not None:
            self.overwritten.append(self._waiting)
        self._waiting = byte
        self._advance(time)

    def receive(self, byte: int, time: float) -> None:
        """Let a byte arrive from the line.

        Parameters
        ----------
        byte : int
            The byte, 0..255.
        time : float
            When its last bit has arrived [s].
        """
        check_whole("byte", byte, 0, 255)
        self._advance(time)
        self._overrun |= self._received is not None
        self._received = byte

    def read(self, time: float) -> int:
        """Return the byte received last, and be ready for the next.

        Parameters
        ----------
        time : float
            When [s].

        Raises
        ------
        ArgumentError
            If nothing has arrived; a program asks RxRDY first.
        """
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

    Attributes
    ----------
    line : bytes
        What went out on the line from the beginning of the loop on.
    writes : int
        How often the program wrote to the chip.
    lost, repeated : int
        How many of the bytes never went out, and how many went out in excess; what was waiting
        in the chip before counts too.
    busy : float
        How long the program was in its loop [s].
    """

    line: bytes
    writes: int
    lost: int
    repeated: int
    busy: float


def send_printed(usart: Usart, data: bytes, *, start: float = 0.0, poll: float = 20e-6) -> Sent:
    """Send bytes by the loop as printed, which writes while the chip is not ready.

    ``while((inportb(C8251) & 0x01) != 0x01) { outportb(D8251, ch); }``

    Parameters
    ----------
    usart : Usart
        The chip; what it is sending already is finished as well.
    data : bytes
        What to send.
    start : float, default 0
        When the program begins [s].
    poll : float, default 20e-6
        How long the program takes to read the status, and to write a byte, 1e-7..1 [s] each; an
        assumption, the paper names no time.

    Returns
    -------
    Sent
        What happened.

    Raises
    ------
    ArgumentError
        If an argument is out of its range, or the loop does not get away from a byte within
        10 000 characters: with some times of polling it never does.

    Notes
    -----
    The sentence before the loop says what is meant: send a byte when the bit is 1. `send_meant`
    does.

    References
    ----------
    .. [1] K. Y. Chung, K. S. Rhyu, "A study on the communication method for a ship main engine
       remote control system", J. Korean Soc. Marine Eng., 1998, section 4.1.

    Examples
    --------
    A chip that has nothing to do is ready, so nothing is ever written:

    >>> send_printed(Usart(10 / 9600), b"abcde")[:4]
    (b'', 0, 5, 0)

    One that has two bytes to send is not. The loop replaces the second of them with its own
    first, and writes this again and again, until by chance it asks just when the buffer is empty:

    >>> chip = Usart(10 / 9600)
    >>> chip.write(0x31, 0.0)
    >>> chip.write(0x32, 0.0)
    >>> send_printed(chip, b"abcde")[:4]
    (b'aaaaaaaaaaaa', 313, 5, 11)
    """
    return _send(usart, data, start, poll, printed=True)


def send_meant(usart: Usart, data: bytes, *, start: float = 0.0, poll: float = 20e-6) -> Sent:
    """Send bytes by the loop as meant, which waits until the chip is ready and writes once.

    ``while((inportb(C8251) & 0x01) != 0x01); outportb(D8251, ch);``

    Parameters
    ----------
    usart : Usart
        The chip; what it is sending already is finished as well.
    data : bytes
        What to send.
    start : float, default 0
        When the program begins [s].
    poll : float, default 20e-6
        How long the program takes to read the status, and to write a byte, 1e-7..1 [s] each.

    Returns
    -------
    Sent
        What happened.

    Raises
    ------
    ArgumentError
        If an argument is out of its range.

    Notes
    -----
    The program is busy for all characters but the last two, which are in the chip when it ends. A
    station that switches its line driver off must wait for TxEMPTY.

    Examples
    --------
    A packet of ten data at 9600 bit/s takes 34.4 ms; for about 32 ms of it the program waits:

    >>> sent = send_meant(Usart(10 / 9600), bytes(33))
    >>> len(sent.line), sent.writes, sent.lost, round(sent.busy * 1e3)
    (33, 33, 0, 32)
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
                    f"{_MOST_CHARACTERS} characters, for the loop never asks in time"
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
