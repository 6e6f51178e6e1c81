"""The states of a transmitter between two bits, and all ways through the bits of a frame.

A state is the register of the CRC, the last bit and how many times in a row it was sent, 1 to 4: a
fifth brings a stuff bit, which is a first again. Arrays have the run on their last axis but one
(0 to 3 for the bit 0, 4 to 7 for the bit 1) and the register on their last.

A pattern is the bits that the CRC is taken over, "x" where both values are possible. It begins
with the dominant bit that starts a frame.
"""

from __future__ import annotations

from functools import cache, lru_cache

import numpy as np
import numpy.typing as npt

from shipnet.can.layout import CRC, CRC_BITS
from shipnet.can.stuffing import RUN
from shipnet.crc import crc

__all__ = ["behind", "costliest", "spread"]

Floats = npt.NDArray[np.float64]
Counts = npt.NDArray[np.int8]

#: Bits at the end of a pattern in which frames of one format differ: the data length code.
_SHARED = 4

_RUNS, _REGISTERS = 2 * (RUN - 1), 2**CRC_BITS


def _follow(run: int, bit: int) -> tuple[int, int]:
    """Return the run after one more bit, and how many stuff bits it cost."""
    last, length = divmod(run, RUN - 1)
    if bit != last:
        return bit * (RUN - 1), 0
    if length + 2 < RUN:
        return run + 1, 0
    return (1 - bit) * (RUN - 1), 1


@cache
def _shifts() -> npt.NDArray[np.intp]:
    """Return the register after one more bit: shape (2, registers)."""
    register = np.arange(_REGISTERS)
    polynomial = crc(CRC, "1")
    shifted = register << 1 & _REGISTERS - 1
    out = register >> (CRC_BITS - 1)
    return np.stack([shifted ^ (out ^ bit) * polynomial for bit in (0, 1)])


def _choices(symbol: str) -> tuple[int, ...]:
    return (0, 1) if symbol == "x" else (int(symbol),)


@cache
def _cost_of_crc() -> Counts:
    """Return the stuff bits that the CRC sequence costs from each state on: (runs, registers)."""
    register = np.arange(_REGISTERS)
    follow = np.array([[_follow(run, bit) for bit in (0, 1)] for run in range(_RUNS)])
    run = np.broadcast_to(np.arange(_RUNS)[:, np.newaxis], (_RUNS, _REGISTERS))
    cost = np.zeros((_RUNS, _REGISTERS), dtype=np.int8)
    for place in range(CRC_BITS - 1, -1, -1):
        run, stuffed = np.moveaxis(follow[run, register >> place & 1], -1, 0)
        cost += stuffed.astype(np.int8)
    return cost


def costliest(pattern: str) -> str:
    """Return the bits with most stuff bits, those of the CRC sequence counted.

    Parameters
    ----------
    pattern : str
        Characters 0, 1 and x, the first 0.

    Returns
    -------
    str
        Bits that fit the pattern, the first by order among those that cost most.

    Examples
    --------
    >>> costliest("0xxxxxxxxxxx0000000")
    '0000000000000000000'
    """
    to_come = [_cost_of_crc()]
    for symbol in reversed(pattern[1:]):
        best = np.full((_RUNS, _REGISTERS), -1, dtype=np.int8)
        for bit in _choices(symbol):
            after = to_come[-1][:, _shifts()[bit]]
            for run in range(_RUNS):
                follower, stuffed = _follow(run, bit)
                np.maximum(best[run], after[follower] + np.int8(stuffed), out=best[run])
        to_come.append(best)
    run, register, bits = 0, 0, "0"
    for symbol in pattern[1:]:
        to_come.pop()
        ways = []
        for bit in _choices(symbol):
            follower, stuffed = _follow(run, bit)
            shifted = int(_shifts()[bit, register])
            ways.append((stuffed + to_come[-1][follower, shifted], -bit, follower, shifted))
        _, minus_bit, run, register = max(ways)
        bits += str(-minus_bit)
    return bits


def spread(pattern: str) -> Floats:
    """Return where random bits lead to.

    Parameters
    ----------
    pattern : str
        Characters 0, 1 and x, the first 0; an x has either value with probability 1/2.

    Returns
    -------
    ndarray of float, shape (n + 1, states)
        Probability of each state behind the pattern, with 0, 1, ... n stuff bits before.

    Examples
    --------
    With probability 1/8 the start bit and four of the id are equal, or five of the id:

    >>> spread("0xxxxx").sum(axis=1).tolist()
    [0.90625, 0.09375]
    """
    if len(pattern) > _SHARED:
        now = _shared_spread(pattern[:-_SHARED]).reshape(-1, _RUNS, _REGISTERS)
        rest = pattern[-_SHARED:]
    else:
        now = np.zeros((1, _RUNS, _REGISTERS))
        now[0, 0, 0] = 1
        rest = pattern[1:]
    for symbol in rest:
        after = np.zeros((len(now) + 1, _RUNS, _REGISTERS))
        choices = _choices(symbol)
        for bit in choices:
            # A bit takes every register to another, so that nothing is written twice.
            moved = np.empty_like(now)
            moved[..., _shifts()[bit]] = now / len(choices)
            for run in range(_RUNS):
                follower, stuffed = _follow(run, bit)
                after[stuffed : stuffed + len(now), follower] += moved[:, run]
        now = _trimmed(after)
    return now.reshape(len(now), -1)


@lru_cache(maxsize=2)
def _shared_spread(pattern: str) -> Floats:
    return spread(pattern)


# A hundred megabytes: two neighbours are kept, so that a table over all lengths takes one sweep.
@lru_cache(maxsize=2)
def behind(n_bytes: int) -> Floats:
    """Return how many stuff bits random data and their CRC cost.

    Parameters
    ----------
    n_bytes : int
        Bytes of data, 0..8.

    Returns
    -------
    ndarray of float, shape (n + 1, states)
        Probability of 0, 1, ... n stuff bits from each state on.

    Examples
    --------
    Of the bits of the CRC alone, at most four cost a stuff bit:

    >>> behind(0).shape
    (5, 262144)
    """
    if n_bytes == 0:
        cost = _cost_of_crc()
        now = np.stack([cost == count for count in range(cost.max() + 1)]).astype(float)
    else:
        now = behind(n_bytes - 1).reshape(-1, _RUNS, _REGISTERS)
        for _ in range(8):
            before = np.zeros((len(now) + 1, _RUNS, _REGISTERS))
            half = now / 2
            for bit in (0, 1):
                moved = np.take(half, _shifts()[bit], axis=-1)
                for run in range(_RUNS):
                    follower, stuffed = _follow(run, bit)
                    before[stuffed : stuffed + len(now), run] += moved[:, follower]
            now = _trimmed(before)
    now = now.reshape(len(now), -1)
    now.flags.writeable = False
    return now


def _trimmed(probability: Floats) -> Floats:
    """Return the same without a last row of zeros."""
    return probability if probability[-1].any() else probability[:-1]
