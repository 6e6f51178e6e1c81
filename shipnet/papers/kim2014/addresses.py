"""Sections 1, 3.2 and 3.3: how many valves one master can address."""

from __future__ import annotations

from itertools import product

from shipnet.errors import ArgumentError
from shipnet.modbus.adu import rtu_frame
from shipnet.modbus.pdu import Request
from shipnet.papers.kim2014.switches import unit_id
from shipnet.papers.registry import numeric

__all__ = ["addresses"]


def addresses(bits: int = 8) -> list[int]:
    """Return the unit ids of single slaves.

    Parameters
    ----------
    bits : int, default 8
        Bits of the number that holds an id.

    Returns
    -------
    list of int
        Those that a frame may carry, the broadcast left out.

    Examples
    --------
    >>> addresses()[0], addresses()[-1]
    (1, 247)
    """
    return [unit for unit in range(1, 2**bits) if _legal(unit)]


def _legal(unit: int) -> bool:
    try:
        rtu_frame(unit, Request.read_input_registers(0, 1).pdu)
    except ArgumentError:
        return False
    return True


@numeric("kim2014-001", "kim2014-002")
def slaves_of_a_master(*, bits: int = 8) -> int:
    """Slaves that one master can call by an id of so many bits."""
    return len(addresses(bits))


@numeric("kim2014-047")
def first_that_needs_two(*, bits: int = 8) -> int:
    """Valves from which on one master is not enough."""
    return slaves_of_a_master(bits=bits) + 1


@numeric("kim2014-003")
def selectable_ids(*, positions: int = 10, pins: int = 2) -> int:
    """Ids that two dials and the DIP pins can be set to, and that a slave may have."""
    found = set()
    for setting in product(range(2**pins), range(positions), range(positions)):
        try:
            found.add(unit_id(*setting))
        except ArgumentError:
            continue
    return len(found)
