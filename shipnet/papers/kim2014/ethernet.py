"""Sections 2.2 and 3.5, Figs 5 and 6: the header on Ethernet, and what datagrams do to it."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from shipnet.modbus.pdu import Request
from shipnet.modbus.udp import LossyPath, simulate
from shipnet.papers.registry import check

__all__ = ["MODBUS_TCP"]

#: Transport and port of Modbus TCP: "MODBUS messaging on TCP/IP implementation guide" V1.0b, 2006,
#: sections 2 and 3.1.3.
MODBUS_TCP = ("TCP", 502)


@check("kim2014-014", counter={"transport": "TCP"})
def transport_is_that_of_modbus_tcp(*, transport: str = "UDP") -> bool:
    """Whether Modbus TCP is carried by this protocol."""
    return transport == MODBUS_TCP[0]


@check("kim2014-015", counter={"port": 503})
def port_is_that_of_modbus_tcp(*, port: int = 502) -> bool:
    """Whether Modbus TCP listens at this port."""
    return port == MODBUS_TCP[1]


@check("kim2014-056", counter={"late": 0.0})
def identifier_zero_is_enough(*, late: float = 0.02) -> bool:
    """Whether no answer is taken for another's if all have identifier 0 and a share is late."""
    units = np.tile(np.arange(1, 6), 200)
    path = LossyPath(late=late, lateness=0.6)
    return simulate(units, path, match="nothing", rng=2024).mismatched == 0


@check("kim2014-057", counter={"widths": (2, 2, 1, 2)})
def header_has_these_fields(*, widths: tuple[int, ...] = (2, 2, 2, 1)) -> bool:
    """Whether a header falls into identifier, 0, length of what follows it, and unit id."""
    identifier, unit = 0x1501, 17
    request = Request.read_input_registers(0x4020, 4)
    pdu, adu = request.pdu, request.tcp(unit, identifier)
    ends = np.cumsum([0, *widths])
    fields = [int.from_bytes(adu[a:b], "big") for a, b in pairwise(ends)]
    return fields == [identifier, 0, len(pdu) + 1, unit] and sum(widths) + len(pdu) == len(adu)
