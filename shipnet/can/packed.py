"""Many frames at once: their bits as numbers of 128 bits, stuffed and read a byte at a time.

A frame without its stuff bits is at most 118 bits long up to the end of the CRC sequence. It is
kept as two columns of uint64, high and low. A table of states times bytes says what eight more
bits do: how many stuff bits they cost, what goes onto the line, or what is left of the line.
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from shipnet.can.stuffing import RUN

__all__ = [
    "DEAD",
    "Words",
    "columns",
    "left",
    "reading_table",
    "right",
    "stuff_count",
    "stuffing_table",
]

Words = npt.NDArray[np.uint64]

#: States of the stuffing table: before the mark, then the bit 0 sent 1 to 4 times, the bit 1.
_IDLE, _MARK = 0, 1 + (RUN - 1)

#: States of the reading table: nothing read, the bit 0 read 1 to 5 times, the bit 1, a sixth.
_FRESH, _DEAD = 0, 1 + 2 * RUN

#: The last of these as it stands in the table.
DEAD = _DEAD * 256


def left(word: Words, distance: npt.ArrayLike) -> Words:
    """Shift words to the left, each by its own distance.

    Parameters
    ----------
    word : ndarray of uint64, shape (n,)
        Words.
    distance : array_like of int, shape () or (n,)
        Bits; a negative distance is beyond the width too.

    Returns
    -------
    ndarray of uint64, shape (n,)
        Shifted words; 0 where the distance is not 0..63.

    Examples
    --------
    >>> left(np.array([1], np.uint64), [[63], [64], [-1]]).ravel().tolist()
    [9223372036854775808, 0, 0]
    """
    # numpy, unlike C, defines what a distance beyond the width gives.
    shifted: Words = np.left_shift(word, np.asarray(distance).astype(np.uint64))
    return shifted


def right(word: Words, distance: npt.ArrayLike) -> Words:
    """Shift words to the right, each by its own distance.

    Parameters
    ----------
    word : ndarray of uint64, shape (n,)
        Words.
    distance : array_like of int, shape () or (n,)
        Bits; a negative distance is beyond the width too.

    Returns
    -------
    ndarray of uint64, shape (n,)
        Shifted words; 0 where the distance is not 0..63.

    Examples
    --------
    >>> right(np.array([8], np.uint64), [[3], [64], [-1]]).ravel().tolist()
    [1, 0, 0]
    """
    shifted: Words = np.right_shift(word, np.asarray(distance).astype(np.uint64))
    return shifted


def columns(high: Words, low: Words) -> npt.NDArray[np.uint8]:
    """Return the bytes of numbers of 128 bits, byte by byte.

    Parameters
    ----------
    high, low : ndarray of uint64, shape (n,)
        The numbers.

    Returns
    -------
    ndarray of uint8, shape (16, n)
        The highest bytes first.

    Examples
    --------
    >>> columns(np.array([0], np.uint64), np.array([258], np.uint64))[-2:].ravel().tolist()
    [1, 2]
    """
    words = np.stack([high, low], axis=-1).astype(">u8")
    return np.ascontiguousarray(words.view(np.uint8).T)


class StuffingTable(NamedTuple):
    """What eight bits do on their way to the line, by state * 256 + byte; all of shape (2304,).

    Attributes
    ----------
    state : ndarray of uint16
        The state behind them, times 256.
    stuffed : ndarray of uint8
        Stuff bits among and behind them.
    length : ndarray of uint8
        Bits that go onto the line, 0..10.
    dominant : ndarray of uint64
        Which of these are dominant, as a number of `length` bits.
    """

    state: npt.NDArray[np.uint16]
    stuffed: npt.NDArray[np.uint8]
    length: npt.NDArray[np.uint8]
    dominant: Words


@cache
def stuffing_table() -> StuffingTable:
    """Return the table that adds stuff bits.

    Returns
    -------
    StuffingTable
        A frame starts behind the highest 1 of a number, which marks the idle bus; zeros before
        this mark, and the mark, send nothing.

    Examples
    --------
    >>> int(stuffing_table().stuffed[0b10000010])
    1
    """
    size = (1 + 2 * (RUN - 1)) * 256
    table = StuffingTable(
        np.zeros(size, np.uint16),
        np.zeros(size, np.uint8),
        np.zeros(size, np.uint8),
        np.zeros(size, np.uint64),
    )
    for index in range(size):
        state, byte = divmod(index, 256)
        sent, stuffed = "", 0
        for bit in map(int, f"{byte:08b}"):
            if state == _IDLE:
                state = _MARK if bit else _IDLE
                continue
            last, run = divmod(state - 1, RUN - 1)
            run = run + 2 if bit == last else 1
            sent += str(bit)
            if run == RUN:
                bit, run = 1 - bit, 1
                sent += str(bit)
                stuffed += 1
            state = 1 + bit * (RUN - 1) + run - 1
        table.state[index] = state * 256
        table.stuffed[index] = stuffed
        table.length[index] = len(sent)
        table.dominant[index] = int("0" + sent.translate({48: "1", 49: "0"}), 2)
    return table


def stuff_count(high: Words, low: Words) -> npt.NDArray[np.int64]:
    """Return how many stuff bits frames have.

    Parameters
    ----------
    high, low : ndarray of uint64, shape (n,)
        The bits of each frame as a number, behind a 1 that marks the idle bus.

    Returns
    -------
    ndarray of int64, shape (n,)
        Stuff bits, one behind the last bit included.

    Examples
    --------
    >>> stuff_count(np.array([0], np.uint64), np.array([0b1_00000_1111], np.uint64)).tolist()
    [2]
    """
    table = stuffing_table()
    state = np.zeros(high.shape, dtype=np.uint16)
    count = np.zeros(high.shape, dtype=np.uint8)
    for column in columns(high, low):
        index = state | column
        count += table.stuffed.take(index)
        state = table.state.take(index)
    return count.astype(np.int64)


class ReadingTable(NamedTuple):
    """What is left of eight bits of the line, by state * 256 + byte; all of shape (3072,).

    Attributes
    ----------
    state : ndarray of uint16
        The state behind them, times 256.
    length : ndarray of uint8
        Bits that are left, 0..8: those that are no stuff bits.
    bits : ndarray of uint64
        These, as a number of `length` bits.
    passed : ndarray of uint8
        Bits of the line before a sixth equal bit, 0..8.
    """

    state: npt.NDArray[np.uint16]
    length: npt.NDArray[np.uint8]
    bits: Words
    passed: npt.NDArray[np.uint8]


@cache
def reading_table() -> ReadingTable:
    """Return the table that takes stuff bits away.

    Returns
    -------
    ReadingTable
        Nothing is read from the sixth equal bit on.

    Examples
    --------
    >>> table = reading_table()
    >>> int(table.length[0b00000100]), int(table.passed[0b11000000])
    (7, 7)
    """
    size = (_DEAD + 1) * 256
    table = ReadingTable(
        np.zeros(size, np.uint16),
        np.zeros(size, np.uint8),
        np.zeros(size, np.uint64),
        np.zeros(size, np.uint8),
    )
    for index in range(size):
        state, byte = divmod(index, 256)
        kept, passed = "", 0
        for bit in map(int, f"{byte:08b}"):
            last, run = divmod(state - 1, RUN) if state != _FRESH else (1 - bit, 0)
            if state == _DEAD or (run == RUN - 1 and bit == last):
                state = _DEAD
                break
            passed += 1
            if run < RUN - 1:
                kept += str(bit)
            run = run + 1 if bit == last else 0
            state = 1 + bit * RUN + run
        table.state[index] = state * 256
        table.length[index] = len(kept)
        table.bits[index] = int("0" + kept, 2)
        table.passed[index] = passed
    return table
