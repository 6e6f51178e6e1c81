"""Section 3.4: what error detection costs elsewhere, and what the pulses of AS-i detect."""

from __future__ import annotations

from math import comb

import numpy as np

from shipnet.asi.modulation import CLASSES, pulses_of
from shipnet.asi.telegram import Response
from shipnet.papers.registry import check, numeric

__all__ = ["check_bits_for_distance_4", "undetected"]


def check_bits_for_distance_4(information: int) -> int:
    """Fewest check bits with which any two words differ in at least four places.

    Parameters
    ----------
    information : int
        Bits to protect, 1 or more.

    Returns
    -------
    int
        Check bits r. The columns of the check matrix must be different and of odd weight, and
        there are 2**(r - 1) of these for all information and check bits together.

    References
    ----------
    .. [1] R. W. Hamming, "Error detecting and error correcting codes", Bell Syst. Tech. J. 29(2),
       1950, section 5.

    Examples
    --------
    The (8, 4) code of [1]_, and the (16, 11) code:

    >>> check_bits_for_distance_4(4), check_bits_for_distance_4(11)
    (4, 5)
    """
    r = 2
    while 2 ** (r - 1) < information + r:
        r += 1
    return r


@numeric("kim2023-057", "icn2007-023")
def request_check_bits(*, control: int = 1, address: int = 5, information: int = 5) -> int:
    """Check bits for the 11 bits of a request."""
    return check_bits_for_distance_4(control + address + information)


@numeric("kim2023-058", "icn2007-040")
def response_check_bits(*, information: int = 4) -> int:
    """Check bits for the 4 bits of a response."""
    return check_bits_for_distance_4(information)


@numeric("kim2023-059")
def growth(*, request: int = 11, response: int = 4, extra: int = 7 + 4) -> float:
    """Growth in percent by the extra bits that the paper prints, over the information bits."""
    return 100 * extra / (request + response)


@numeric("kim2023-060", "icn2007-024")
def error_classes(*, classes: tuple[str, ...] = tuple(CLASSES)) -> int:
    """Kinds of error that the receiver tells apart."""
    return len(classes)


def undetected(faults: int) -> tuple[int, int]:
    """Count the faults of pulses that leave a response valid.

    Parameters
    ----------
    faults : int
        Slots that change at once, 1 or more; each takes either of its two other values.

    Returns
    -------
    tuple of int
        Undetected patterns, and all patterns: of the 15 slots from the start pulse on, in each
        of the 16 responses.

    Notes
    -----
    A fault of the model is a slot that is read wrong, whatever the cause; how likely that is on
    a ship, it does not say.

    Examples
    --------
    >>> undetected(1), undetected(2)
    ((0, 480), (0, 6720))
    """
    words = np.array([pulses_of(Response(data).bits) for data in range(16)])
    slots = np.pad(words, ((0, 0), (0, 2)))[:, 1:]
    n = slots.shape[1]
    # The checks accept the 16 responses and nothing else, so a fault passes only if it turns one
    # response into another.
    distance = (slots[:, np.newaxis] != slots).sum(axis=-1)
    return int((distance == faults).sum()), len(slots) * comb(n, faults) * 2**faults


@check("kim2023-061", counter={"faults": 4})
def every_fault_found(*, faults: int = 1) -> bool:
    """Whether every response with so many wrong slots is found faulty."""
    return undetected(faults)[0] == 0
