"""Command codes of a valve, in the readings that Table 2 allows."""

from __future__ import annotations

import csv
from enum import Enum
from functools import cache
from typing import TYPE_CHECKING

from shipnet.datasets import path
from shipnet.errors import ArgumentError

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["READINGS", "Code", "code_table", "command_codes"]

#: How the codes of Table 2 can be read: column of the data file, base of its numbers.
READINGS = {
    "flag sum": ("code_flag_sum", 10),
    "one bit": ("code_one_bit", 10),
    "decimal": ("code_printed", 10),
    "hexadecimal": ("code_printed", 16),
}


class Code(Enum):
    """What a command register asks for; the names are those of Table 2."""

    MANUAL = "Manual"
    AUTO = "Auto"
    CLOSE = "Close"
    OPEN = "Open"
    POSITION_CLOSE = "Position Close"
    POSITION_OPEN = "Position Open"


@cache
def command_codes(reading: str) -> dict[Code, int]:
    """Return the command codes of a reading of Table 2.

    Parameters
    ----------
    reading : str
        ``flag sum``, ``one bit``, ``decimal`` or ``hexadecimal``; see `RegisterMap`.

    Returns
    -------
    dict of Code to int
        Low byte of the command register.

    Raises
    ------
    ArgumentError
        If there is no such reading.

    Examples
    --------
    >>> [list(command_codes(r).values()) for r in ("flag sum", "hexadecimal")]
    [[1, 2, 4, 8, 6, 10], [1, 2, 4, 8, 8, 16]]
    """
    if reading not in READINGS:
        raise ArgumentError(f"codes is {reading!r}; it must be one of {', '.join(READINGS)}")
    column, base = READINGS[reading]
    with path("kim2014_table2_write_register_bits.csv").open(encoding="utf-8") as file:
        rows = [row for row in csv.DictReader(file) if row["message"] == "query"]
    return {Code(row["name_printed"]): int(row[column], base) for row in rows}


def code_table() -> pd.DataFrame:
    """Return the codes of all readings beside each other.

    Returns
    -------
    pandas.DataFrame
        Indexed by command, one column a reading.

    Examples
    --------
    Only two of the readings tell all commands apart:

    >>> code_table().apply(lambda codes: codes.is_unique).to_dict()
    {'flag sum': True, 'one bit': True, 'decimal': False, 'hexadecimal': False}
    """
    import pandas as pd

    columns = {reading: command_codes(reading) for reading in READINGS}
    index = pd.Index([code.value for code in Code], name="command")
    return pd.DataFrame({r: list(codes.values()) for r, codes in columns.items()}, index=index)
