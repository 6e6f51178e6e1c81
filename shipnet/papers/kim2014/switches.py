"""The ID switches of a slave: two decimal dials and two DIP pins, and which settings are legal.

How dials and pins make an id is not printed; here the pins count hundreds.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from shipnet.errors import ArgumentError
from shipnet.fields import check_whole
from shipnet.modbus.adu import MAX_UNIT

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["switch_table", "unit_id"]


def unit_id(pins: int, tens: int, units: int) -> int:
    """Return the unit id of a setting."""
    number = 100 * check_whole("pins", pins, 0, 3)
    number += 10 * check_whole("tens", tens, 0, 9) + check_whole("units", units, 0, 9)
    if (why := _verdict(number)) != "legal":
        raise ArgumentError(
            f"switches are set to {number}, which is {why}; legal are 1..{MAX_UNIT}"
        )
    return number


def switch_table() -> pd.DataFrame:
    """Return all settings of the switches."""
    import pandas as pd

    rows = [(n // 100, n // 10 % 10, n % 10, n, _verdict(n)) for n in range(400)]
    return pd.DataFrame(rows, columns=["pins", "tens", "units", "number", "verdict"])


def _verdict(number: int) -> str:
    if number > 0xFF:
        return "more than a byte"
    if number > MAX_UNIT:
        return "reserved"
    return "legal" if number else "the broadcast"
