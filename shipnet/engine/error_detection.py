"""Which wrong bits a CRC does not see, found by trying them all."""

from __future__ import annotations

from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from shipnet.can.frame import Frame, decode
from shipnet.crc import ALGORITHMS, crc, crc_batch
from shipnet.errors import ArgumentError, FrameError
from shipnet.fields import check_whole

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["undetected", "undetected_on_can"]

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
    The bits are those that the CRC is computed from. On CAN that is before bit stuffing: two wrong
    bits on the wire can remove one stuff bit and make another, which shifts all between them and
    is far more than two wrong bits to the CRC. `undetected_on_can` tries that.

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


def undetected_on_can(frame: Frame, flips: int = 2) -> pd.DataFrame:
    """Return which wrong bits on the wire, stuff bits included, make another valid CAN frame.

    Parameters
    ----------
    frame : Frame
        What is sent.
    flips : int, default 2
        Wrong bits, 1..2.

    Returns
    -------
    pandas.DataFrame
        One row a pattern: ``first`` and ``second`` (places of the wrong bits in `Frame.bits`; of a
        single one both are the same) and ``received``, the frame that it is taken for.

    Raises
    ------
    ArgumentError
        If `frame` is none, or `flips` is out of range.

    Notes
    -----
    Each pattern goes through `shipnet.can.frame.decode`. A receiver may find fault with a frame
    that others take; here there is one receiver, which acknowledges nothing itself.

    Examples
    --------
    >>> frame = Frame(0x1F3, bytes.fromhex("00F0FFFF00647B0F"))
    >>> print(undetected_on_can(frame).query("first == 39").to_string(index=False))
     first  second             received
        39      85 1F3#00F0BBFF80323D8F
    """
    import pandas as pd

    if not isinstance(frame, Frame):
        raise ArgumentError(f"frame is {frame!r}; it must be a Frame")
    check_whole("flips", flips, 1, 2)
    bits = frame.bits
    rows = []
    for places in combinations(range(len(bits)), flips):
        wrong = list(bits)
        for place in places:
            wrong[place] = "10"[int(bits[place])]
        try:
            received = decode("".join(wrong))
        except FrameError:
            continue
        if received != frame:
            rows.append((places[0], places[-1], str(received)))
    return pd.DataFrame(rows, columns=["first", "second", "received"])
