"""The stuff bits of all frames of a kind: the witness of the tables in `shipnet.can.lengths`.

All ways through the bits of a frame are followed, by the states of a transmitter between two bits.

A state is the register of the CRC, the last bit and how many times in a row it was sent, 1 to 4: a
fifth brings a stuff bit, which is a first again. Arrays have the run on their last axis but one
(0 to 3 for the bit 0, 4 to 7 for the bit 1) and the register on their last.

A pattern is the bits that the CRC is taken over, "x" where both values are possible. It begins
with the dominant bit that starts a frame.
"""

from __future__ import annotations

from functools import cache, lru_cache
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from shipnet.can.frame import CRC_BITS, RUN, Frame, head, payload
from shipnet.crc import CAN as CRC

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
    polynomial = CRC.of("1")
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
    """Return the bits with most stuff bits, those of the CRC sequence counted."""
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
    """Return where random bits lead to."""
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
    """Return how many stuff bits random data and their CRC cost."""
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


def longest_frame(dlc: int, *, extended: bool = False, remote: bool = False) -> Frame:
    """Return a frame of greatest length among all with this data length code."""
    return _longest_frame(dlc, bool(extended), bool(remote))


@cache
def _longest_frame(dlc: int, extended: bool, remote: bool) -> Frame:
    bits = costliest(_pattern(dlc, extended, remote))
    places = [place for place, symbol in enumerate(_identity(extended)) if symbol == "i"]
    number = int("".join(bits[place] for place in places), 2)
    n_bytes = payload(dlc, remote)
    data = int("0" + bits[len(bits) - 8 * n_bytes :], 2)
    return Frame(number, data.to_bytes(n_bytes, "big"), extended, remote, dlc)


class StuffBits(NamedTuple):
    """How many stuff bits frames have."""

    probability: Floats

    @property
    def mean(self) -> float:
        """Mean number of stuff bits [bit]."""
        return float(self.probability @ np.arange(len(self.probability)))

    @property
    def sd(self) -> float:
        """Standard deviation of the number of stuff bits [bit]."""
        away = np.arange(len(self.probability)) - self.mean
        return float(np.sqrt(self.probability @ away**2))

    def beyond(self) -> Floats:
        """Return the probability of more than 0, 1, ... n stuff bits."""
        return np.append(np.cumsum(self.probability[:0:-1])[::-1], 0.0)

    def quantile(self, tail: float) -> int:
        """Return the number of stuff bits that is exceeded with at most some probability."""
        return int(np.argmax(self.beyond() <= tail))


def stuff_bits(dlc: int, *, extended: bool = False, remote: bool = False) -> StuffBits:
    """Return how many stuff bits a frame has if its id and its data are random."""
    pattern = _pattern(dlc, extended, remote)
    n_bits = 8 * payload(dlc, remote)
    return StuffBits(_distribution(pattern[: len(pattern) - n_bits], n_bits // 8))


def _identity(extended: bool) -> str:
    """Return the bits before the data, "i" where they are those of the id."""
    return "".join(
        ("i" if "identifier" in name else ".") * len(bits) for name, bits in head(extended).items()
    )


def _pattern(dlc: int, extended: bool, remote: bool) -> str:
    """Return the bits that the CRC is taken over, "x" where a frame of this kind may have any."""
    n_bytes = payload(dlc, remote)
    parts = head(extended) | {"RTR": f"{bool(remote):b}", "DLC": f"{dlc:04b}"}
    return "".join(parts.values()) + "x" * 8 * n_bytes


@cache
def _distribution(before_data: str, n_bytes: int) -> Floats:
    before = spread(before_data)
    after = behind(n_bytes)
    both = np.zeros(len(before) + len(after) - 1)
    for count, probability in enumerate(before @ after.T):
        both[count : count + len(after)] += probability
    probability = np.trim_zeros(both, "b")
    probability.flags.writeable = False
    return probability
