"""The level on a line while a UART sends bytes, and what a receiver makes of it.

A character is a start bit of level 0, the data with the least significant bit first, a parity bit
if there is one, and one or two stop bits of level 1; an idle line has level 1.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Sequence
from math import ceil
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from shipnet.errors import ArgumentError, FormError, ParityError
from shipnet.fields import check_scalar, check_whole
from shipnet.modbus.timing import Serial

__all__ = ["Characters", "baud_tolerance", "decode_uart", "uart_bits", "uart_waveform"]

Bits = npt.NDArray[np.uint8]
Floats = npt.NDArray[np.float64]

#: Data bits of a character of RTU.
_DATA = 8


def uart_bits(data: bytes, serial: Serial) -> Bits:
    r"""Return the bits of bytes as they follow each other on the line.

    Parameters
    ----------
    data : bytes
        What is sent.
    serial : Serial
        Settings of the line.

    Returns
    -------
    ndarray of uint8, shape (n_bytes, serial.character_bits)
        One row a character: start, data, parity if any, stop.

    Raises
    ------
    ArgumentError
        If `data` is not made of bytes.

    Examples
    --------
    >>> "".join(map(str, uart_bits(b"\x53", Serial(9600))[0]))
    '01100101001'
    """
    if not isinstance(data, bytes | bytearray | memoryview):
        raise ArgumentError(f"data is {data!r}; it must be bytes")
    values = np.frombuffer(data, dtype=np.uint8)
    bits = np.ones((values.size, serial.character_bits), dtype=np.uint8)
    bits[:, 0] = 0
    bits[:, 1 : 1 + _DATA] = np.unpackbits(values[:, None], axis=1, bitorder="little")
    if serial.character[1] != "N":
        odd = serial.character[1] == "O"
        bits[:, 1 + _DATA] = bits[:, 1 : 1 + _DATA].sum(axis=1) % 2 ^ odd
    return bits


def uart_waveform(
    frames: bytes | Sequence[bytes],
    serial: Serial,
    *,
    gap: float | Sequence[float] | None = None,
    start: float | None = None,
    differential: float | None = None,
) -> tuple[Floats, Floats]:
    r"""Return the level on the line during frames, as corners of a step function.

    Parameters
    ----------
    frames : bytes or sequence of bytes
        What is sent; the characters of a frame follow each other at once.
    serial : Serial
        Settings of the line.
    gap : float or sequence of float, optional
        Silence behind each frame, 0..3600 [s]; t3.5 if omitted.
    start : float, optional
        Silence before the first frame, which begins at this time, 0..3600 [s]; t3.5, or one `gap`
        for all, if omitted.
    differential : float, optional
        Give the voltage of RS-485 instead of the level, D1 against D0: this much for 1, and the
        opposite for 0, 0.2..12 [V]. Drivers have 1.5 V or more, an idle line is held at 1 by its
        bias.

    Returns
    -------
    tuple of ndarray of float
        Time [s], the first one 0, and the level from there on, 0 or 1 or a voltage [V]; both end
        with the end of the silence.

    Raises
    ------
    ArgumentError
        If an argument is out of its range.

    References
    ----------
    .. [1] "MODBUS over serial line specification and implementation guide", V1.02, 2006,
       sections 2.5.1 and 3.4.

    Examples
    --------
    >>> time, level = uart_waveform(b"\x53", Serial(9600), gap=0)
    >>> (time * 9600).round(6).tolist(), level.tolist()
    ([0.0, 1.0, 3.0, 5.0, 6.0, 7.0, 8.0, 10.0, 11.0], [0.0, 1.0, 0.0, 1.0, 0.0, 1.0, 0.0, 1.0, 1.0])
    """
    parts = [frames] if isinstance(frames, bytes | bytearray) else list(frames)
    single = serial.t35 if gap is None else gap
    if isinstance(single, Sequence):
        pauses = [check_scalar(f"gap[{k}]", one, "s", 0, 3600) for k, one in enumerate(single)]
        if len(pauses) != len(parts):
            raise ArgumentError(f"gap has {len(pauses)} values; there are {len(parts)} frames")
        first = serial.t35
    else:
        first = check_scalar("gap", single, "s", 0, 3600)
        pauses = [first] * len(parts)
    begin = check_scalar("start", first if start is None else start, "s", 0, 3600)
    if differential is not None:
        check_scalar("differential", differential, "V", 0.2, 12)
    times, levels = [np.zeros(1)], [np.ones(1)]
    for part, pause in zip(parts, pauses, strict=True):
        bits = uart_bits(part, serial).ravel()
        times.append(begin + np.arange(bits.size + 1) / serial.bit_rate)
        levels.append(np.append(bits, 1))
        begin = times[-1][-1] + pause
    time, level = np.concatenate(times), np.concatenate(levels).astype(np.float64)
    # Of corners at one time the last one holds; a corner without a change is none.
    keep = np.append(np.diff(time) > 0, True)
    time, level = time[keep], level[keep]
    corner = np.append(True, np.diff(level) != 0)
    time, level = np.append(time[corner], begin), np.append(level[corner], level[-1])
    return time, level if differential is None else differential * (2 * level - 1)


class Characters(NamedTuple):
    r"""What a receiver took from the line, one entry a character.

    Examples
    --------
    >>> line = Serial(9600)
    >>> decode_uart(*uart_waveform(b"\x01\x03", line), line).data
    b'\x01\x03'
    """

    #: Edge of the start bit, as the receiver saw it [s].
    time: Floats
    #: The byte, whatever its code.
    value: Bits
    #: 0, or the code of `ParityError` or `FormError`; `shipnet.errors.explain` names it.
    code: npt.NDArray[np.int64]

    @property
    def data(self) -> bytes:
        """All bytes, wrong ones included."""
        return self.value.tobytes()


def decode_uart(
    time: npt.ArrayLike,
    level: npt.ArrayLike,
    serial: Serial,
    *,
    threshold: float = 0.5,
    oversampling: int | None = None,
) -> Characters:
    r"""Return the characters that a receiver finds in a waveform.

    Parameters
    ----------
    time : array_like of float, shape (n_samples,)
        Times [s], not falling: corners of a step function or samples of a scope.
    level : array_like of float, shape (n_samples,)
        Level or voltage from that time to the next; the last one stays.
    serial : Serial
        Settings of the receiver, whose bit rate need not be that of the sender.
    threshold : float, default 0.5
        What lies above is 1, -1e6..1e6; 0 for a differential voltage.
    oversampling : int, optional
        The receiver sees the line at this many ticks of a bit only, 4..256, of which one is at
        time 0; most chips have 16. At any moment if omitted.

    Returns
    -------
    Characters
        Time, byte and error code of each; nothing in a waveform raises an error.

    Raises
    ------
    ArgumentError
        If the arrays do not fit each other or hold something other than numbers, or an argument
        is out of its range.

    Notes
    -----
    A start bit begins where the level falls; it counts if it still is 0 half a bit later. All bits
    are sampled in their middle. If the first stop bit is 0, that is a framing error, `FormError`,
    which hides a parity error; a second stop bit is not looked at. The next start bit is looked
    for from the sample of the stop bit on.

    Examples
    --------
    A sender 4.5 % faster than the receiver is read, one 5.3 % faster is not:

    >>> time, level = uart_waveform(b"\x01\x04\x40\x20", Serial(9600))
    >>> decode_uart(time, level, Serial(9600 / 1.045)).data.hex(" ")
    '01 04 40 20'
    >>> decode_uart(time, level, Serial(9600 / 1.053)).code.tolist()
    [13, 13, 13]
    """
    at, one = _logic(time, level, threshold)
    ticks = None if oversampling is None else check_whole("oversampling", oversampling, 4, 256)
    bit = 1 / serial.bit_rate
    bits = 1 + _DATA + (serial.character[1] != "N") + 1
    corners, levels = at.tolist(), one.tolist()
    falls = at[1:][one[:-1] & ~one[1:]].tolist()
    found: list[tuple[float, int, int]] = []
    next_fall = 0
    while next_fall < len(falls):
        edge = falls[next_fall]
        if ticks is not None:
            edge = ceil(edge / bit * ticks - 1e-9) * bit / ticks
        places = [edge + (k + 0.5) * bit for k in range(bits)]
        taken = [levels[max(bisect_right(corners, place) - 1, 0)] for place in places]
        if taken[0]:
            # A pulse shorter than half a bit is no start bit.
            next_fall = max(next_fall + 1, bisect_left(falls, places[0]))
            continue
        value = sum(level << k for k, level in enumerate(taken[1 : 1 + _DATA]))
        parity = sum(taken[1:-1]) % 2
        wrong = serial.character[1] != "N" and parity != (serial.character[1] == "O")
        code = ParityError.code if wrong else 0
        found.append((edge, value, code if taken[-1] else FormError.code))
        next_fall = max(next_fall + 1, bisect_left(falls, places[-1]))
    columns = list(zip(*found, strict=True)) if found else [(), (), ()]
    times, codes = np.array(columns[0], dtype=np.float64), np.array(columns[2], dtype=np.int64)
    return Characters(times, np.array(columns[1], dtype=np.uint8), codes)


def baud_tolerance(serial: Serial, *, oversampling: int | None = None) -> tuple[float, float]:
    r"""Return by how much the sender's bit rate may differ from the receiver's.

    .. math:: -\frac{1/2}{n - 1/2} < \delta < \frac{1/2 - 1/k}{n - 1/2 + 1/k}

    for the n bits up to the first stop bit and k ticks a bit, where 1/k is 0 without ticks. With
    two stop bits the sample of the first may fall into the second, and the right side has n - 1
    instead, from the bit before them.

    Parameters
    ----------
    serial : Serial
        Settings of the receiver.
    oversampling : int, optional
        Ticks of a bit at which the receiver sees the line, 4..256; at any moment if omitted.

    Returns
    -------
    tuple of float
        Lowest and highest deviation of the sender's rate, as a part of the receiver's, between
        which every character is read, whatever stands in it and however close they follow.

    Raises
    ------
    ArgumentError
        If `oversampling` is out of range.

    Notes
    -----
    A deviation adds up from the start bit to the sample of the stop bit, n - 1/2 bits later,
    which must fall into the stop bit. A tick after the edge brings the samples up to 1/k nearer to
    the end of their bits. Rise times and jitter come off this.

    Examples
    --------
    >>> [f"{100 * limit:+.2f} %" for limit in baud_tolerance(Serial(9600))]
    ['-4.76 %', '+4.76 %']
    >>> [f"{100 * limit:+.2f} %" for limit in baud_tolerance(Serial(9600), oversampling=16)]
    ['-4.76 %', '+4.14 %']
    """
    tick = 0.0
    if oversampling is not None:
        tick = 1 / check_whole("oversampling", oversampling, 4, 256)
    n = 1 + _DATA + (serial.character[1] != "N") + 1
    stops = int(serial.character[2])
    highest = min((n - 1) / (n - 1.5 + tick), (n - 1 + stops) / (n - 0.5 + tick))
    return (n - 1) / (n - 0.5) - 1, highest - 1


def _logic(
    time: npt.ArrayLike, level: npt.ArrayLike, threshold: float
) -> tuple[Floats, npt.NDArray[np.bool_]]:
    """Return times and logic levels, checked."""
    border = check_scalar("threshold", threshold, "", -1e6, 1e6)
    try:
        at, value = np.asarray(time, dtype=np.float64), np.asarray(level, dtype=np.float64)
    except (TypeError, ValueError):
        raise ArgumentError("time and level must be rows of numbers") from None
    if at.ndim != 1 or at.shape != value.shape:
        raise ArgumentError(
            f"time has the shape {at.shape} and level {value.shape}; they must be equal rows"
        )
    if not (np.isfinite(at).all() and np.isfinite(value).all()):
        raise ArgumentError("time and level must be finite")
    if (np.diff(at) < 0).any():
        raise ArgumentError("time falls; it must not")
    # Of corners at one time the last one holds.
    keep = np.append(np.diff(at) > 0, True)[: at.size]
    return at[keep], value[keep] > border
