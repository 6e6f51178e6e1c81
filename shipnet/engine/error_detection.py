"""Which wrong bits a CRC does not see, found by trying them all."""

from __future__ import annotations

from itertools import combinations

import numpy as np

from shipnet.crc import ALGORITHMS, crc, crc_batch
from shipnet.errors import ArgumentError, check_whole

__all__ = ["undetected"]

#: Payload of the frames on which a CRC is tried [byte]: with the CRC of Modbus, the request of
#: eight bytes.
_PAYLOAD = 6


def undetected(algorithm: str, payload: int = _PAYLOAD, flips: int = 2) -> int:
    """Return how many patterns of wrong bits a CRC does not see, by trying all of them.

    Parameters
    ----------
    algorithm : str
        One of `shipnet.crc.ALGORITHMS`.
    payload : int, default 6
        Bytes before the CRC, 1..16.
    flips : int, default 2
        Wrong bits in the frame, 1..2.

    Returns
    -------
    int
        Patterns after which the CRC fits again.

    Raises
    ------
    ArgumentError
        If an argument is out of range.

    Notes
    -----
    On CAN a wrong bit may also shift the stuff bits behind it, which is no matter of the CRC alone
    and is left out.

    Examples
    --------
    The 64 single and 2016 double errors of a request of 8 bytes:

    >>> [undetected("CRC-16/MODBUS", flips=n) for n in (1, 2)]
    [0, 0]
    """
    if algorithm not in ALGORITHMS:
        raise ArgumentError(f"algorithm is {algorithm!r}; it must be one of {sorted(ALGORITHMS)}")
    size = check_whole("payload", payload, 1, 16)
    check_whole("flips", flips, 1, 2)
    width = ALGORITHMS[algorithm].width
    data = np.arange(1, size + 1, dtype=np.uint8)
    pairs = np.array(list(combinations(range(8 * size + width), flips)))
    wrong = np.zeros((len(pairs), 8 * size + width), np.uint8)
    wrong[np.arange(len(pairs))[:, np.newaxis], pairs] = 1
    received = data ^ np.packbits(wrong[:, : 8 * size], axis=1)
    check = crc(algorithm, data.tobytes()) ^ (wrong[:, 8 * size :] @ (1 << np.arange(width)))
    return int((crc_batch(algorithm, received) == check).sum())
