"""Pulses -> bits: the seven checks by which a receiver tells a telegram from a disturbance.

A telegram of n bits fills 2 n slots of a half-bit each (see `shipnet.asi.apm`); two more must stay
empty behind it. Slot 0 is empty, slot 1 holds the negative pulse of the start bit, every odd slot
holds the pulse in the middle of a bit, and an even slot holds one only between two equal bits. The
seven checks together accept the telegrams and nothing else: the tests prove it by exhaustion.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import numpy.typing as npt

from shipnet.asi.batch import NONE
from shipnet.asi.frame import REQUEST_BITS, RESPONSE_BITS
from shipnet.errors import (
    AlternationError,
    ArgumentError,
    EndBitError,
    FrameError,
    InformationError,
    LengthError,
    ParityError,
    PauseError,
    StartBitError,
)

__all__ = ["CLASSES", "bits_of_slots", "check_slots", "violations"]

Bools = npt.NDArray[np.bool_]
Codes = npt.NDArray[np.uint8]
Signs = npt.NDArray[np.int8]

#: The error classes of kim2023 section 3.4 by name, in the order in which they are checked.
CLASSES: dict[str, type[FrameError]] = {
    "start": StartBitError,
    "alternation": AlternationError,
    "pause": PauseError,
    "information": InformationError,
    "parity": ParityError,
    "end": EndBitError,
    "length": LengthError,
}


def check_bit_count(n_bits: int) -> None:
    """Raise unless a telegram can have so many bits."""
    if n_bits not in (RESPONSE_BITS, REQUEST_BITS):
        raise ArgumentError(
            f"n_bits is {n_bits!r}; it must be {RESPONSE_BITS}, a response, "
            f"or {REQUEST_BITS}, a request"
        )


def _columns(slots: npt.ArrayLike, n_bits: int) -> Signs:
    """Return the slots along the first axis, where numpy works on many telegrams at a time."""
    check_bit_count(n_bits)
    array = np.asarray(slots)
    n_slots = 2 * n_bits + 2
    if array.ndim == 0 or array.shape[-1] != n_slots:
        raise ArgumentError(
            f"slots have the shape {array.shape}; {n_bits} bits need {n_slots} along the last axis"
        )
    if array.dtype.kind not in "iu":
        raise ArgumentError(f"slots must be -1, 0 or 1, but their dtype is {array.dtype}")
    if array.size and (array.min() < -1 or array.max() > 1):
        raise ArgumentError(
            f"slots must be -1, 0 or 1, but range from {array.min()} to {array.max()}"
        )
    return np.ascontiguousarray(np.moveaxis(array, -1, 0), dtype=np.int8)


def _violations(columns: Signs) -> Bools:
    """Return which classes fail; `columns` has the slots, the result the classes in front."""
    telegram, behind = columns[1:-2], columns[-2:]
    middles = telegram[::2]
    empty = telegram == 0
    # Summed up, the pulses are the send current upside down. It has two levels, so the sum never
    # spans more than one step; two pulses of one sign in a row make it span two.
    level = np.cumsum(telegram, axis=0, dtype=np.int8)
    span = np.maximum(level.max(axis=0), 0) - np.minimum(level.min(axis=0), 0)
    return np.stack(
        [
            (columns[0] != 0) | (columns[1] != -1),
            span > 1,
            (empty[1:] & empty[:-1]).any(axis=0),
            empty[::2].any(axis=0),
            np.logical_xor.reduce(middles[1:-1] > 0, axis=0),
            middles[-1] != 1,
            (behind != 0).any(axis=0),
        ]
    )


def check_columns(columns: Signs) -> tuple[Signs, Codes]:
    """Return the bits, in front, and the codes of slots along the first axis."""
    error = np.zeros(columns.shape[1:], dtype=np.uint8)
    failed = _violations(columns)
    # The last written is the first checked.
    for kind, fails in reversed(list(zip(CLASSES.values(), failed, strict=True))):
        error[fails] = kind.code
    middles = columns[1:-2:2]
    return np.where(middles == 0, NONE, middles > 0).astype(np.int8), error


def check_slots(slots: npt.ArrayLike, n_bits: int) -> tuple[Signs, Codes]:
    """Decode the pulses of many telegrams at once; the inverse of `apm.pulses_of`.

    Parameters
    ----------
    slots : array_like of int, shape (..., 2 n_bits + 2)
        Sign of the pulse in each half-bit from the start of the telegram, -1, 0 or +1, and in
        the two half-bits behind its end.
    n_bits : int
        Bits of a telegram, `RESPONSE_BITS` or `REQUEST_BITS`.

    Returns
    -------
    bits : ndarray of int8, shape (..., n_bits)
        What the pulses in the middle of the bits say, and `NONE` where there is no such pulse.
        To be trusted only where `error` is 0.
    error : ndarray of uint8, shape (...)
        0, or the code of the first class of `CLASSES` that fails.

    Raises
    ------
    ArgumentError
        If the shape or a value of `slots`, or `n_bits`, is not as said above. A bad telegram
        raises nothing.

    References
    ----------
    .. [1] ZMD AG, "SAP5S/SAP51 Universal AS-Interface IC", data sheet rev. 3.1, 2012, p. 45.

    Examples
    --------
    >>> silence = [0, 0]
    >>> good = [0, -1, 1, -1, 0, 1, -1, 1, 0, -1, 1, -1, 0, 1] + silence
    >>> lost = [0, -1, 1, -1, 0, 1, -1, 0, 0, -1, 1, -1, 0, 1] + silence
    >>> bits, error = check_slots([good, lost], 7)
    >>> bits.tolist()
    [[0, 0, 1, 1, 0, 0, 1], [0, 0, 1, -1, 0, 0, 1]]
    >>> from shipnet.errors import explain
    >>> [explain(code) for code in error]
    ['ok', 'AlternationError']
    """
    bits, error = check_columns(_columns(slots, n_bits))
    return np.ascontiguousarray(np.moveaxis(bits, 0, -1)), error


def violations(slots: npt.ArrayLike, n_bits: int) -> Bools:
    """Return every check that fails, not only the first: for statistics of disturbances.

    Parameters
    ----------
    slots, n_bits
        As for `check_slots`.

    Returns
    -------
    ndarray of bool, shape (..., 7)
        True where the class fails; the classes along the last axis are `CLASSES`.

    Raises
    ------
    ArgumentError
        As `check_slots`.

    Examples
    --------
    A lost pulse rarely breaks one rule alone:

    >>> lost = [0, -1, 1, -1, 0, 1, -1, 0, 0, -1, 1, -1, 0, 1, 0, 0]
    >>> [name for name, fails in zip(CLASSES, violations(lost, 7)) if fails]
    ['alternation', 'pause', 'information', 'parity']
    """
    return np.ascontiguousarray(np.moveaxis(_violations(_columns(slots, n_bits)), 0, -1))


def bits_of_slots(slots: npt.ArrayLike) -> str:
    """Decode the pulses of one telegram, or say which slot breaks which rule.

    Parameters
    ----------
    slots : array_like of int, shape (16,) or (30,)
        Sign of the pulse in each half-bit, -1, 0 or +1: those of a response or of a request,
        and the two behind its end.

    Returns
    -------
    str
        Bits, the first on the line first.

    Raises
    ------
    StartBitError, AlternationError, PauseError, InformationError, ParityError, EndBitError, \
    LengthError
        The first rule that is broken, in this order; the message names the slot.
    ArgumentError
        If there are not 16 or 30 slots, or a value is not -1, 0 or 1.

    Examples
    --------
    >>> bits_of_slots([0, -1, 1, -1, 0, 1, -1, 1, 0, -1, 1, -1, 0, 1, 0, 0])
    '0011001'
    >>> bits_of_slots([0, -1, 1, -1, 0, 1, -1, 1, 0, -1, 1, -1, 0, 1, -1, 0])
    Traceback (most recent call last):
        ...
    shipnet.errors.LengthError: slot 14 holds -; the line is silent after slot 13, the end bit's
    """
    shape = np.shape(slots)
    lengths = [2 * n_bits + 2 for n_bits in (RESPONSE_BITS, REQUEST_BITS)]
    if len(shape) != 1 or shape[0] not in lengths:
        raise ArgumentError(
            f"slots have the shape {shape}; one telegram has {lengths[0]} of them, a response, "
            f"or {lengths[1]}, a request"
        )
    last = shape[0] - 3
    pulse: list[int] = _columns(slots, (shape[0] - 2) // 2).tolist()

    if pulse[0]:
        raise StartBitError(f"slot 0 holds {_sign(pulse[0])}; the first pulse belongs in slot 1")
    if pulse[1] != -1:
        raise StartBitError(f"slot 1 holds {_sign(pulse[1])}; the start bit's pulse is -")
    filled = [j for j in range(1, last + 1) if pulse[j]]
    for j, k in pairwise(filled):
        if pulse[j] == pulse[k]:
            raise AlternationError(
                f"slot {k} holds {_sign(pulse[k])} like slot {j}, the pulse before it; "
                "the signs alternate"
            )
    for j in range(1, last):
        if not pulse[j] and not pulse[j + 1]:
            raise PauseError(f"slots {j} and {j + 1} are both empty inside the telegram")
    for j in range(1, last + 1, 2):
        if not pulse[j]:
            raise InformationError(f"slot {j} is empty; it is the middle of bit {j // 2}")
    bits = "".join("1" if pulse[j] > 0 else "0" for j in range(1, last + 1, 2))
    ones = bits[:-1].count("1")
    if ones % 2:
        raise ParityError(
            f"slots 1 to {last - 2} hold {bits[:-1]} with {ones} ones; their number must be even"
        )
    if pulse[last] != 1:
        raise EndBitError(f"slot {last} holds {_sign(pulse[last])}; the end bit's pulse is +")
    for j in (last + 1, last + 2):
        if pulse[j]:
            raise LengthError(
                f"slot {j} holds {_sign(pulse[j])}; the line is silent after slot {last}, "
                "the end bit's"
            )
    return bits


def _sign(pulse: int) -> str:
    return {-1: "-", 0: "no pulse", 1: "+"}[pulse]
