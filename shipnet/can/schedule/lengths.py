"""How long a CAN frame is: without stuff bits, on average, and at worst."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

import numpy as np
import numpy.typing as npt

from shipnet.can.lengths import nominal_length, worst_length
from shipnet.errors import ArgumentError

__all__ = ["LENGTHS", "Lengths", "frame_bits", "length_table"]

Lengths = Literal["nominal", "mean", "attainable", "worst", "worst 1994"]

#: Mean stuff bits by data bytes, 11-bit and 29-bit identifiers, if identifier and data are
#: uniformly random: the expectation over all of them, CRC included, by dynamic programming over
#: CRC register, last bit and run. The tests do it again, as does `shipnet.can.lengths`, which takes
#: a second for each.
_MEAN_STUFF = (
    (1.968750, 2.018089, 2.248796, 2.648793, 2.348793, 2.548793, 2.815460, 3.352960, 3.283168),
    (2.738010, 2.791322, 3.022456, 3.422457, 3.122450, 3.322451, 3.589117, 4.126897, 4.055775),
)

#: Most stuff bits that any identifier and data of this format and length get, by the same route.
_MOST_STUFF = (
    (6, 7, 9, 12, 14, 15, 18, 21, 22),
    (11, 13, 15, 17, 19, 21, 23, 25, 27),
)


def _bits(add: Callable[[int, bool], float]) -> tuple[tuple[float, ...], tuple[float, ...]]:
    standard, extended = (tuple(add(s, kind) for s in range(9)) for kind in (False, True))
    return standard, extended


_TABLE: dict[Lengths, tuple[tuple[float, ...], tuple[float, ...]]] = {
    "nominal": _bits(lambda s, kind: nominal_length(s, extended=kind)),
    "mean": _bits(lambda s, kind: nominal_length(s, extended=kind) + _MEAN_STUFF[kind][s]),
    "attainable": _bits(lambda s, kind: nominal_length(s, extended=kind) + _MOST_STUFF[kind][s]),
    "worst": _bits(lambda s, kind: worst_length(s, extended=kind)),
    "worst 1994": _bits(lambda s, kind: worst_length(s, extended=kind, year=1994)),
}

#: The ways of counting, shortest frames first.
LENGTHS: tuple[Lengths, ...] = ("nominal", "mean", "worst 1994", "attainable", "worst")


def length_table(lengths: Lengths) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Return the lengths of all frames, for code that looks up one at a time.

    Parameters
    ----------
    lengths : {"nominal", "mean", "attainable", "worst", "worst 1994"}
        Way of counting, as in `frame_bits`.

    Returns
    -------
    tuple of two tuples of nine numbers
        Bits by identifier (11 or 29 bits) and data bytes; whole but for ``"mean"``.

    Raises
    ------
    ArgumentError
        If the way of counting is unknown.

    Examples
    --------
    >>> length_table("worst")[False][8]
    135
    """
    if lengths not in _TABLE:
        raise ArgumentError(f"lengths is {lengths!r}; it must be one of {', '.join(LENGTHS)}")
    return _TABLE[lengths]


def frame_bits(
    dlc: npt.ArrayLike, extended: npt.ArrayLike = False, lengths: Lengths = "worst"
) -> npt.NDArray[np.float64]:
    r"""Return the length of data frames with the intermission behind them.

    With :math:`g` = 34 stuffed bits without data (54 for a 29-bit identifier) and :math:`s` bytes:

    .. math:: n_{2007} = g + 8 s + 13 + \left\lfloor \frac{g + 8 s - 1}{4} \right\rfloor, \qquad
              n_{1994} = g + 8 s + 13 + \left\lfloor \frac{g + 8 s}{5} \right\rfloor

    Parameters
    ----------
    dlc : array_like of int
        Data bytes, 0..8.
    extended : array_like of bool, default False
        Whether the identifier has 29 bits.
    lengths : {"nominal", "mean", "attainable", "worst", "worst 1994"}, default "worst"
        ``"nominal"``: no stuff bits. ``"mean"``: the average number of them over random
        identifiers and data. ``"attainable"``: the most that any identifier and data get.
        ``"worst"``: the bound of [1]_. ``"worst 1994"``: the form of [2]_, which is too short.

    Returns
    -------
    ndarray of float, of the shape of the arguments broadcast
        Length [bit]; whole but for ``"mean"``.

    Raises
    ------
    ArgumentError
        If a number of bytes is not whole or not 0..8, or the way of counting is unknown.

    Notes
    -----
    The bound of [1]_ lets a stuff bit begin the next run, which the older form forgot. It is never
    attained, because the identifier, the reserved bits and the CRC cannot all be chosen: the
    longest standard frame of 8 bytes has 133 bits. Real data are not random: eight zero bytes get
    15 stuff bits, not the mean of 3.3.

    References
    ----------
    .. [1] R. I. Davis, A. Burns, R. J. Bril, J. J. Lukkien, "Controller Area Network (CAN)
       schedulability analysis: refuted, revisited and revised", Real-Time Systems 35, 2007.
    .. [2] K. Tindell, A. Burns, "Guaranteeing message latencies on Control Area Network (CAN)",
       1st International CAN Conference, 1994.

    Examples
    --------
    >>> frame_bits([0, 7, 8]).tolist()
    [55.0, 125.0, 135.0]
    >>> {lengths: float(frame_bits(8, lengths=lengths).round(2)) for lengths in LENGTHS}
    {'nominal': 111.0, 'mean': 114.28, 'worst 1994': 130.0, 'attainable': 133.0, 'worst': 135.0}
    """
    table = np.array(length_table(lengths), dtype=np.float64)
    s = np.asarray(dlc)
    if s.dtype.kind not in "iu" or (s.size and not (0 <= s.min() and s.max() <= 8)):
        raise ArgumentError(f"dlc is {dlc!r}; it must be whole numbers 0..8")
    long = np.asarray(extended)
    if long.dtype.kind != "b":
        raise ArgumentError(f"extended is {extended!r}; it must be True or False")
    return np.asarray(table[long.astype(np.intp), s], dtype=np.float64)
