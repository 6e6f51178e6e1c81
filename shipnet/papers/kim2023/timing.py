"""Section 3.4: bits, pauses and cycles in time."""

from __future__ import annotations

from shipnet import datasets
from shipnet.asi.telegram import REQUEST_BITS
from shipnet.asi.timing import BIT_TIME, Transaction
from shipnet.papers.registry import check, numeric

__all__ = ["CHIP_EDGES", "LONGEST_PAUSE", "master_pause_of_chip"]

_PUBLISHED = datasets.read("asi_published_timing.csv").set_index("quantity")["value_us"]

#: Delays between request and response that a chip maker prints [s]: synchronous least and most,
#: then asynchronous least and most.
CHIP_EDGES = tuple(
    1e-6 * float(_PUBLISHED[f"edge to edge, {state}, {end}"])
    for state in ("synchronous", "asynchronous")
    for end in ("least", "most")
)

#: How long a master may wait before its next request [s].
LONGEST_PAUSE = 1e-6 * float(_PUBLISHED["longest pause before the next request"])


@numeric("kim2023-020")
def bit_time_from_rate(*, rate: float = 167e3) -> float:
    """Microseconds a bit, from the rate that the paper prints."""
    return 1e6 / rate


@numeric("kim2023-021", "icn2007-006")
def gross_rate(*, bit_time: float = BIT_TIME) -> float:
    """Kilobits a second, from the bit time."""
    return 1e-3 / bit_time


@numeric("kim2023-022")
def half_bit(*, bit_time: float = BIT_TIME) -> float:
    """Microseconds of a Manchester half-bit."""
    return 1e6 * bit_time / 2


def master_pause_of_chip(*, edge: float, bit_time: float = BIT_TIME) -> float:
    """Pause between request and response, from a chip's delay between two edges.

    Parameters
    ----------
    edge : float
        Delay [s] from the middle of the request's end bit to the first edge of the response,
        which is the middle of its start bit: half a bit belongs to either telegram.
    bit_time : float, default 6e-6
        Length of a bit [s].

    Returns
    -------
    float
        Pause [bit].

    References
    ----------
    .. [1] ZMD AG, "A2SI Advanced AS-Interface IC", data sheet rev. 2.4, 2002, p. 9.

    Examples
    --------
    From [1]_, the middle of 21.25 to 21.75 us for a synchronous slave:

    >>> round(master_pause_of_chip(edge=21.5e-6), 2)
    2.58
    """
    return edge / bit_time - 1


@check("kim2023-028", "icn2007-014", counter={"edges": (10e-6, 33.5e-6)})
def master_pause_in_range(*, edges: tuple[float, ...] = CHIP_EDGES) -> bool:
    """Whether the delays of a chip are pauses of 2 to 10 bit times."""
    return all(2 <= master_pause_of_chip(edge=edge) <= 10 for edge in edges)


@check("kim2023-030", "icn2007-016", counter={"longest": 12e-6})
def slave_pause_at_most_2(*, longest: float = LONGEST_PAUSE) -> bool:
    """Whether the pause after a response never exceeds 2 bit times."""
    return longest <= 2 * BIT_TIME


@numeric("kim2023-031")
def shortest_transaction(*, master_pause: float = 2, slave_pause: float = 1.5) -> float:
    """Bit times with the shortest pauses that are printed."""
    return Transaction(master_pause, slave_pause).bits


@numeric("kim2023-032", "icn2007-030")
def long_transaction(*, master_pause: float = 3, slave_pause: float = 2) -> float:
    """Bit times with the pauses on which vendors base their 156 us."""
    return Transaction(master_pause, slave_pause).bits


@numeric("kim2023-033")
def unanswered_transaction(*, request: int = REQUEST_BITS, timeout: float = 10) -> float:
    """Bit times until a master that hears nothing may send again."""
    return request + timeout


@numeric("kim2023-034")
def cycle_standard(
    *, slaves: int = 31, transaction: float = 26, bit_time: float = BIT_TIME
) -> float:
    """Milliseconds to poll all slaves once, with one more request for inclusion."""
    return 1e3 * (slaves + 1) * transaction * bit_time


@numeric("kim2023-035")
def cycle_extended(
    *, pairs: int = 31, transaction: float = 26, bit_time: float = BIT_TIME
) -> float:
    """Milliseconds until every A and every B slave was polled: two cycles."""
    return 2 * cycle_standard(slaves=pairs, transaction=transaction, bit_time=bit_time)
