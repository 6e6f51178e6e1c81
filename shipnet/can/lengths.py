"""How long frames get: the bounds of the literature, the longest frame that there is, the usual.

The stuff bits of a frame depend on all its bits and on the CRC that they lead to. What is exact
here goes through the bits of a frame with the state of the transmitter, which is the register of
the CRC, the last bit and how often it was sent in a row: 2**15 x 8 states (`shipnet.can.states`).
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from shipnet.can import states
from shipnet.can.frame import Frame
from shipnet.can.layout import INTERMISSION, TAIL, head, payload, stuffed_region
from shipnet.errors import ArgumentError
from shipnet.fields import check_whole

__all__ = [
    "StuffBits",
    "longest_frame",
    "nominal_length",
    "stuff_bits",
    "worst_length",
]

Floats = npt.NDArray[np.float64]

#: Bits behind the CRC sequence, up to the end of frame.
_TAIL_BITS = sum(len(bits) for _, bits in TAIL)


def nominal_length(n_bytes: int, *, extended: bool = False, intermission: bool = True) -> int:
    """Return the length of a frame without stuff bits.

    Parameters
    ----------
    n_bytes : int
        Bytes of data, 0..8; 0 for a remote frame.
    extended : bool, default False
        Whether the arbitration id has 29 bits instead of 11.
    intermission : bool, default True
        Whether the 3 bits behind the frame count.

    Returns
    -------
    int
        Length [bit]: 47 + 8 n, or 67 + 8 n with an id of 29 bits.

    Raises
    ------
    ArgumentError
        If `n_bytes` is out of range.

    Examples
    --------
    >>> nominal_length(8), nominal_length(8, extended=True)
    (111, 131)
    """
    n_bytes = check_whole("n_bytes", n_bytes, 0, 8)
    return stuffed_region(n_bytes, extended) + _TAIL_BITS + INTERMISSION * bool(intermission)


def worst_length(
    n_bytes: int, *, extended: bool = False, year: int = 2007, intermission: bool = True
) -> int:
    r"""Return the bound on the length of a frame that response-time analysis goes by.

    .. math:: L = g + 8 n + 13 + \left\lfloor \frac{g + 8 n - 1}{4} \right\rfloor
              \qquad g = 34 \text{ or } 54

    Parameters
    ----------
    n_bytes : int
        Bytes of data, 0..8; 0 for a remote frame.
    extended : bool, default False
        Whether the arbitration id has 29 bits instead of 11.
    year : {2007, 1994}, default 2007
        Which analysis: [1]_, or [2]_, which took a stuff bit for every five bits and so forgot
        that a stuff bit begins the next run.
    intermission : bool, default True
        Whether the 3 bits behind the frame count.

    Returns
    -------
    int
        Length [bit]: 55 + 10 n, or 80 + 10 n with an id of 29 bits.

    Raises
    ------
    ArgumentError
        If `n_bytes` is out of range, or `year` is another.

    Notes
    -----
    No frame gets as long as in [1]_: `longest_frame` has at least 1 bit less. From 3 bytes on, and
    always with an id of 29 bits, there are frames longer than in [2]_, so that its bound is none.

    References
    ----------
    .. [1] R. I. Davis, A. Burns, R. J. Bril, J. J. Lukkien, "Controller Area Network (CAN)
       schedulability analysis: refuted, revisited and revised", Real-Time Systems 35, 2007.
    .. [2] K. Tindell, A. Burns, "Guaranteeing message latencies on Controller Area Network",
       Proc. 1st International CAN Conference, 1994.

    Examples
    --------
    >>> worst_length(8), worst_length(8, extended=True), worst_length(8, year=1994)
    (135, 160, 130)
    """
    bits = stuffed_region(check_whole("n_bytes", n_bytes, 0, 8), extended)
    if year not in (1994, 2007):
        raise ArgumentError(f"year is {year!r}; it must be 2007 or 1994")
    most = (bits - 1) // 4 if year == 2007 else bits // 5
    return nominal_length(n_bytes, extended=extended, intermission=intermission) + most


def longest_frame(dlc: int, *, extended: bool = False, remote: bool = False) -> Frame:
    """Return a frame of greatest length among all with this data length code.

    Parameters
    ----------
    dlc : int
        Data length code, 0..15.
    extended : bool, default False
        Whether the arbitration id has 29 bits instead of 11.
    remote : bool, default False
        Whether it is a remote frame.

    Returns
    -------
    Frame
        The first of the longest frames, if they are sorted by their bits.

    Raises
    ------
    ArgumentError
        If `dlc` is out of range.

    Notes
    -----
    The code 8 is not the costliest of those that mean 8 bytes: with an id of 29 bits, 15 leads to
    159 bits with the intermission, the longest frame there is, and 8 to 158.

    Backwards from the end of the CRC sequence, each state is given the stuff bits that it can
    still cost at most. A second way through the frame, forwards, follows them.

    Examples
    --------
    >>> frame = longest_frame(8)
    >>> frame.length_with_intermission, worst_length(8)
    (133, 135)
    """
    return _longest_frame(check_whole("dlc", dlc, 0, 15), bool(extended), bool(remote))


@cache
def _longest_frame(dlc: int, extended: bool, remote: bool) -> Frame:
    bits = states.costliest(_pattern(dlc, extended, remote))
    places = [place for place, symbol in enumerate(_identity(extended)) if symbol == "i"]
    number = int("".join(bits[place] for place in places), 2)
    n_bytes = payload(dlc, remote)
    data = int("0" + bits[len(bits) - 8 * n_bytes :], 2)
    return Frame(number, data.to_bytes(n_bytes, "big"), extended, remote, dlc)


class StuffBits(NamedTuple):
    """How many stuff bits frames have.

    Attributes
    ----------
    probability : ndarray of float, shape (n + 1,)
        Probability of 0, 1, ... n stuff bits, n being the most that there are.
    """

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
        """Return the probability of more than 0, 1, ... n stuff bits.

        Returns
        -------
        ndarray of float, shape (n + 1,)
            Summed from the far end, so that small probabilities are exact.
        """
        return np.append(np.cumsum(self.probability[:0:-1])[::-1], 0.0)

    def quantile(self, tail: float) -> int:
        """Return the number of stuff bits that is exceeded with at most some probability.

        Parameters
        ----------
        tail : float
            Probability of more stuff bits, 0..1; 0.01 asks for the 99 % quantile.

        Returns
        -------
        int
            The smallest number that is exceeded with at most this probability.

        Raises
        ------
        ArgumentError
            If `tail` is out of range.
        """
        if not 0 <= tail <= 1:
            raise ArgumentError(f"tail is {tail!r}; it must be a probability 0..1")
        return int(np.argmax(self.beyond() <= tail))


def stuff_bits(dlc: int, *, extended: bool = False, remote: bool = False) -> StuffBits:
    """Return how many stuff bits a frame has if its id and its data are random.

    Parameters
    ----------
    dlc : int
        Data length code, 0..15.
    extended : bool, default False
        Whether the arbitration id has 29 bits instead of 11.
    remote : bool, default False
        Whether it is a remote frame.

    Returns
    -------
    StuffBits
        The distribution, exact but for rounding.

    Raises
    ------
    ArgumentError
        If `dlc` is out of range.

    Notes
    -----
    Every id and every payload is taken for equally likely. Real payloads are not: eight bytes of
    0 cost 13 to 17 stuff bits, as the id has it, but of random frames one in 1.3 million has 13.

    Eight bytes take a second. A table over all lengths takes four: each goes on from the last.

    Examples
    --------
    >>> usual = stuff_bits(0)
    >>> round(usual.mean, 2), usual.quantile(0.01), len(usual.probability) - 1
    (1.97, 4, 6)
    """
    pattern = _pattern(check_whole("dlc", dlc, 0, 15), extended, remote)
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
    ahead = states.spread(before_data)
    behind = states.behind(n_bytes)
    both = np.zeros(len(ahead) + len(behind) - 1)
    for count, probability in enumerate(ahead @ behind.T):
        both[count : count + len(behind)] += probability
    probability = np.trim_zeros(both, "b")
    probability.flags.writeable = False
    return probability
