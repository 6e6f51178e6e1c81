"""Telegrams on top of each other: what a receiver makes of the sum of their pulses.

Two slaves of one address answer at once; a late answer runs into the next request. Every sender
draws its own current, the currents add up, and so do the voltages: pulses of opposite sign cancel.
The senders count as equally strong here; on a line the nearer one is not, and a receiver may then
follow the stronger (`shipnet.asi.segment` gives the voltages).
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from shipnet.asi.apm import pulses_of
from shipnet.asi.frame import RESPONSE_BITS
from shipnet.asi.response import Response
from shipnet.asi.slots import check_bit_count, check_slots
from shipnet.errors import ArgumentError

__all__ = ["ONE_PULSE_CODES", "add_pulses", "collide"]


def add_pulses(telegrams: Sequence[tuple[str, int]], n_bits: int) -> npt.NDArray[np.int8]:
    """Return the pulses that a receiver finds where several telegrams overlap.

    Parameters
    ----------
    telegrams : sequence of (str, int)
        The bits of each telegram, and when it starts [half-bit]; the receiver counts from 0.
        What lies before 0 or behind the receiver's slots is not heard.
    n_bits : int
        Bits of the telegram that the receiver waits for: `RESPONSE_BITS` or `REQUEST_BITS`.

    Returns
    -------
    ndarray of int8, shape (2 n_bits + 2,)
        Sign of the sum in each slot, as `shipnet.asi.slots.check_slots` takes them.

    Raises
    ------
    ArgumentError
        If there is no telegram, or a bit or `n_bits` is not legal.

    Examples
    --------
    The answers 6 and 5 at once: where they differ, pulses cancel.

    >>> both = add_pulses([(Response(6).bits, 0), (Response(5).bits, 0)], 7)
    >>> "".join("0+-"[pulse] for pulse in both)
    '0-+-0+-000+-0+00'
    """
    check_bit_count(n_bits)
    if not telegrams:
        raise ArgumentError("telegrams is empty; at least one is needed")
    n_slots = 2 * n_bits + 2
    total = np.zeros(n_slots, dtype=np.int64)
    for bits, start in telegrams:
        pulses = pulses_of(bits)
        slots = start + np.arange(pulses.size)
        heard = (slots >= 0) & (slots < n_slots)
        total[slots[heard]] += pulses[heard]
    return np.sign(total).astype(np.int8)


@lru_cache(maxsize=4096)
def collide(telegrams: tuple[tuple[str, int], ...], n_bits: int) -> tuple[str, int]:
    """Return what a receiver reads where several telegrams overlap.

    Parameters
    ----------
    telegrams : tuple of (str, int)
        As for `add_pulses`.
    n_bits : int
        As for `add_pulses`.

    Returns
    -------
    bits : str
        What it reads; empty if there is an error.
    error : int
        0, or the code of the error class that it finds first.

    Raises
    ------
    ArgumentError
        As `add_pulses`.

    Examples
    --------
    Equal answers are one answer; different ones are an error:

    >>> collide((("0011001", 0), ("0011001", 0)), 7)
    ('0011001', 0)
    >>> from shipnet.errors import explain
    >>> bits, error = collide((("0011001", 0), ("0010101", 0)), 7)
    >>> bits, explain(error)
    ('', 'PauseError')
    """
    bits, error = check_slots(add_pulses(telegrams, n_bits), n_bits)
    return ("", int(error)) if error else ("".join(map(str, bits)), 0)


def _one_pulse_codes() -> tuple[tuple[int, ...], ...]:
    table = []
    for data in range(16):
        word = np.pad(pulses_of(Response(data).bits), (0, 2))
        wrong = [
            np.where(np.arange(word.size) == slot, value, word)
            for slot in range(word.size)
            for value in (-1, 0, 1)
            if value != word[slot]
        ]
        table.append(tuple(check_slots(np.stack(wrong), RESPONSE_BITS)[1].tolist()))
    return tuple(table)


#: For each answer 0..15 the error codes of its 32 disturbances of one slot: a pulse lost, turned
#: round or added, in any of the 16 half-bits that its receiver looks at. None of them is 0.
ONE_PULSE_CODES = _one_pulse_codes()
