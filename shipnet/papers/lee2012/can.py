"""Section III.2.b: the CAN bus between the junction boxes, as far as any CAN bus goes."""

from __future__ import annotations

import numpy as np

from shipnet.can.faults import ErrorAt
from shipnet.can.messages import Message, MessageSet, bus_load
from shipnet.can.simulation import simulate
from shipnet.engine.can_layout import CanLayout
from shipnet.engine.faults import LostModbusFrames
from shipnet.engine.points import read_points
from shipnet.engine.simulation import simulate as simulate_engine
from shipnet.engine.system import System
from shipnet.errors import ArgumentError
from shipnet.papers.registry import check, numeric

__all__ = ["TOGETHER"]

#: Two messages that are released at once.
TOGETHER = MessageSet([Message("first", 0x100, 8, 1.0), Message("second", 0x200, 8, 1.0)])


@numeric("lee2012-038")
def standard_identifier_bits(*, extended: bool = False) -> int:
    """Bits of the highest arbitration id that a frame can carry."""
    bits = 0
    while _legal(2 ** (bits + 1) - 1, extended):
        bits += 1
    return bits


@numeric("lee2012-080")
def extended_identifier_bits(*, extended: bool = True) -> int:
    """Bits of the highest arbitration id of a frame in extended format."""
    return standard_identifier_bits(extended=extended)


def _legal(arbitration_id: int, extended: bool) -> bool:
    try:
        Message("highest", arbitration_id, 8, 1.0, extended=extended)
    except ArgumentError:
        return False
    return True


@check("lee2012-037", counter={"disturbed": (100e-6,)})
def destroys_both(*, disturbed: tuple[float, ...] = ()) -> bool:
    """Whether frames that begin together are destroyed and sent again, as on CSMA/CD."""
    run = simulate(TOGETHER, 125e3, until=0.5, faults=[ErrorAt(time) for time in disturbed])
    return bool((run.events()["retries"] > 0).any())


@check("lee2012-068", counter={"retries": 1})
def both_repeat(*, retries: int = 0) -> bool:
    """Whether what was damaged on CAN and on Modbus is sent again, with so many retries of the AMS.

    A CAN controller repeats by itself; how often a Modbus master asks again is its own affair.
    """
    sent = simulate(TOGETHER, 125e3, until=0.5, faults=ErrorAt(100e-6)).events()
    lost = [LostModbusFrames("1", request=1.0)]
    rng = np.random.default_rng(0)
    asked = simulate_engine(System(retries=retries), faults=lost, until=0.5, rng=rng).requests()
    on_can = sent["retries"].max() > 0 and (sent["outcome"] == "sent").all()
    return bool(on_can and (asked["channel"] == 1).sum() > 1)


@numeric("lee2012-043")
def frames_per_update(*, bits: int = 16) -> int:
    """CAN frames that carry all points once."""
    return len(CanLayout(read_points(), bits).messages())


@numeric("lee2012-044")
def time_per_update(*, bits: int = 16, bit_rate: float = 125e3) -> float:
    """Milliseconds of the bus for all points once, with the most stuff bits."""
    return 1e3 * float(CanLayout(read_points(), bits).volume()["worst_bits"]["all"]) / bit_rate


@numeric("lee2012-100")
def can_load(*, period: float = 1.0, bit_rate: float = 125e3) -> float:
    """Percent of the bus for an update each period."""
    messages = CanLayout(read_points()).messages(period)
    return 100 * bus_load(messages, bit_rate)


@check("lee2012-081", counter={"within": 5e-3})
def all_arrive(*, within: float = 0.1) -> bool:
    """Whether all frames that are released at once arrive intact within some time [s]."""
    messages = CanLayout(read_points()).messages()
    sent = simulate(messages, 125e3, until=0.5).events()
    in_time = (sent["outcome"] == "sent") & (sent["end_ms"] <= 1e3 * within)
    return bool(in_time.all()) and len(sent) == len(messages) and not sent["retries"].any()
