"""Sections 4 and 5 and the data link layer: cable of a star, bits, rates and telegrams."""

from __future__ import annotations

from shipnet.asi.calls import Call
from shipnet.asi.telegram import Half, Request
from shipnet.asi.timing import Transaction
from shipnet.papers.kim2023.timing import CHIP_EDGES, master_pause_of_chip
from shipnet.papers.registry import check, numeric

__all__: list[str] = []


@numeric("icn2007-035")
def metres_per_star_leg(*, total: float = 100, trunk: float = 90, slaves: int = 62) -> float:
    """Cable that is left for each leg of the star at the end of the trunk."""
    return (total - trunk) / slaves


@numeric("icn2007-005")
def bit_time_in_ms(*, rate: float = 167e3) -> float:
    """Milliseconds a bit, from the rate in the same paragraph."""
    return 1e3 / rate


@numeric("icn2007-015")
def extra_pause(*, edges: tuple[float, ...] = CHIP_EDGES) -> float:
    """Bit times that a slave takes longer when it is not synchronous, at most."""
    synchronous, asynchronous = edges[1], edges[-1]
    return master_pause_of_chip(edge=asynchronous) - master_pause_of_chip(edge=synchronous)


@check("icn2007-018", counter={"data": 0xA})
def example_for_21a(*, data: int = 0xE) -> bool:
    """Whether the example's request is also a request to slave 21A with data 6."""
    bits = Request.data_exchange(21, data).bits
    return Request.parse(bits, extended=True) == Request.data_exchange(21, 0x6, "A")


@numeric("icn2007-044")
def standard_output_bits(*, layout: str = Call.DATA_EXCHANGE.rule.pattern) -> int:
    """Output bits of a request to a standard slave."""
    return layout.count("d")


@check("icn2007-045", counter={"asked": True})
def same_answer(
    *, halves: tuple[Half | None, Half | None] = (None, "A"), asked: bool = False
) -> bool:
    """Whether a standard slave and an A slave answer with the same bits (not: are asked)."""
    requests = [Request.data_exchange(21, 0x6, half) for half in halves]
    said = [request if asked else request.answer(0x6) for request in requests]
    return said[0].bits == said[1].bits


@numeric("icn2007-036")
def slaves_before_2_1(*, layout: str = Call.DATA_EXCHANGE.rule.pattern) -> int:
    """Every address but 0."""
    return (1 << layout.count("a")) - 1


@numeric("icn2007-020")
def extended_output_bits(*, layout: str = Call.DATA_EXCHANGE.rule.extended) -> int:
    """Output bits of a request to a slave that shares its address."""
    return layout.count("d")


@numeric("icn2007-021")
def request_information(*, layout: str = Call.DATA_EXCHANGE.rule.pattern) -> int:
    """Bits of a request that must be checked: all but start, parity and end bit."""
    return len(layout)


@numeric("icn2007-025")
def net_rate(*, user_bits: int = 8, master_pause: float = 2, slave_pause: float = 2) -> float:
    """Kilobits of user data a second, four bits each way in every transaction."""
    return 1e-3 * user_bits / Transaction(master_pause, slave_pause).duration


@numeric("icn2007-026")
def efficiency(*, user_bits: int = 8, master_pause: float = 2, slave_pause: float = 2) -> float:
    """User bits in percent of all bit times of a transaction."""
    return 100 * user_bits / Transaction(master_pause, slave_pause).bits


@check("icn2007-029", counter={"call": Call.RESET})
def broadcast_is_silent(*, call: Call = Call.BROADCAST_RESET) -> bool:
    """Whether no slave answers this call."""
    return call.rule.answer is None
