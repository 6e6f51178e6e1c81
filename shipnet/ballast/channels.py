"""What the slave of a valve measures, in the units in which the rule table is read.

The paper prints no units; bar, bar, A, degC and percent are our reading (claim kim2014-038).
"""

from __future__ import annotations

import re
from typing import NamedTuple

from shipnet.datasets import path

__all__ = ["CHANNELS", "Channel", "Limit", "normal_values", "rule_limits"]


class Channel(NamedTuple):
    """A sensor.

    Attributes
    ----------
    name : str
        Its name in the rule table.
    meaning : str
        What it measures.
    unit : str
        Its unit, as read.
    column : str
        Its column in a table.
    """

    name: str
    meaning: str
    unit: str
    column: str


#: The five sensors, in the order in which every array of readings has them.
CHANNELS = (
    Channel("FP", "pump pressure", "bar", "FP_bar"),
    Channel("OP", "operating pressure", "bar", "OP_bar"),
    Channel("MC", "motor current", "A", "MC_A"),
    Channel("OT", "motor temperature", "degC", "OT_degC"),
    Channel("VPos", "valve position", "%", "VPos_percent"),
)


class Limit(NamedTuple):
    """A comparison that the rule table makes with a number other than 0.

    Attributes
    ----------
    channel : str
        Sensor.
    comparison : str
        One of ``<``, ``>`` and ``>=``.
    value : float
        Limit, in the unit of the sensor.
    codes : tuple of str
        The rules that ask for it.
    """

    channel: str
    comparison: str
    value: float
    codes: tuple[str, ...]


def normal_values() -> dict[str, float]:
    """Return the readings that row 0 of the rule table prints for a healthy valve.

    Returns
    -------
    dict of str to float
        FP, OP, MC and OT, in bar, bar, A and degC.

    Examples
    --------
    >>> normal_values()
    {'FP': 90.0, 'OP': 2.0, 'MC': 1.2, 'OT': 50.0}
    """
    row = _rules()[0]
    return {name: float(row[f"{name.lower()}_printed"]) for name in ("FP", "OP", "MC", "OT")}


def rule_limits() -> list[Limit]:
    """Return the limits of the rule table, each once.

    Returns
    -------
    list of Limit
        In the order of the table. Comparisons with 0, and with the ends OPEN and CLOSE, to which
        the paper gives no number, are left out.

    Examples
    --------
    >>> for limit in rule_limits():
    ...     print(limit.channel, limit.comparison, limit.value, "/".join(limit.codes))
    FP > 120.0 G1/P1/V1
    MC > 2.5 P1
    FP < 2.5 P2
    MC < 2.5 P2
    OP >= 2.5 V1
    OP < 2.5 V2/Pos1/Pos2
    OT >= 90.0 O1
    """
    found: dict[tuple[str, str, float], list[str]] = {}
    for row in _rules():
        pattern = r"(FP|OP|MC|OT) (<|>=|>) ([0-9.]+)"
        for name, comparison, number in re.findall(pattern, row["antecedent_mended"]):
            found.setdefault((name, comparison, float(number)), []).append(row["code"])
    return [Limit(*key, tuple(codes)) for key, codes in found.items()]


def _rules() -> list[dict[str, str]]:
    import csv

    with path("kim2014_rule_table.csv").open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))
