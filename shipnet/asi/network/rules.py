"""Does a plan keep the rules of AS-i? Each rule on each object, with its limit and its source.

The limits are data, `asi_plan_rules.csv`; what they are compared with is computed here, from the
plan, its voltages and its waveforms.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from shipnet import datasets
from shipnet.asi.cycle import update_time
from shipnet.asi.network.electrical import (
    device_voltages,
    listeners,
    segment_quality,
    supply_current,
)
from shipnet.asi.network.plan import Plan, PlanSegment
from shipnet.asi.timing import BIT_TIME, MASTER_PAUSE_BITS, Transaction
from shipnet.errors import ArgumentError
from shipnet.line.cable import CABLES

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["check", "rule_limits", "worst"]

#: A value that is on its limit but for rounding keeps the rule.
_SLACK = 1e-9

#: One row of the table before it is judged: rule, object, value, highest if the object has a
#: limit of its own, note.
_Row = tuple[str, str, float, float | None, str]


def rule_limits() -> pd.DataFrame:
    """Return the limits of all rules, to be looked at or changed.

    Returns
    -------
    pandas.DataFrame
        Indexed by rule; `lowest` and `highest` are NaN where there is no limit, or where the user
        or the object sets it.

    Examples
    --------
    >>> rule_limits().loc["cable_length", "highest"]
    np.float64(100.0)
    """
    table = datasets.read("asi_plan_rules.csv").set_index("rule")
    for bound in ("lowest", "highest"):
        table[bound] = table[bound].replace("", "nan").astype(float)
    return table


def check(
    plan: Plan,
    *,
    wanted_cycle: float | None = None,
    transaction: Transaction | None = None,
    limits: pd.DataFrame | None = None,
) -> pd.DataFrame:
    """Check a plan against every rule.

    Parameters
    ----------
    plan : Plan
        What to check.
    wanted_cycle : float, optional
        Time within which every slave shall be heard again, positive [s]: two cycles of the line
        where slaves share an address. Without it the rule ``update_time`` is left out.
    transaction : Transaction, optional
        What one exchange takes; 26 bit times if omitted.
    limits : pandas.DataFrame, optional
        Limits in the form of `rule_limits`, which stands for it if omitted.

    Returns
    -------
    pandas.DataFrame
        One row a rule and object: `rule`, `object`, `value`, `lowest`, `highest`, `unit`,
        `passed`, `source`, `note`. The value is NaN, and the rule not passed, where it cannot be
        computed: voltages need one supply in a segment, signals a master on the line.

    Raises
    ------
    ArgumentError
        If `wanted_cycle` is not positive, or `limits` lacks a rule or a column.

    Notes
    -----
    The length of 500 m between two slaves is no rule of its own: it follows from two repeaters to
    either side of a master in the middle. Signals are those of `segment_quality`: nominal cables,
    assumed decoupling, send current and repeaters. They tell which slave is the critical one
    better than by how many millivolts it passes.

    Examples
    --------
    62 slaves in a star at the end of 90 m keep every rule if the supply stands beside them, and
    not if it stands beside the master:

    >>> from shipnet.asi.network.structures import star
    >>> for supply in (90, 0):
    ...     table = check(star(90, [10 / 62] * 62, supply=supply))
    ...     print(table.loc[~table["passed"], "rule"].unique().tolist())
    []
    ['slave_voltage']
    """
    import pandas as pd

    if wanted_cycle is not None and not 0 < wanted_cycle < np.inf:
        raise ArgumentError(f"wanted_cycle is {wanted_cycle!r} s; it must be positive")
    bounds = rule_limits() if limits is None else limits
    _check_limits(bounds)
    transaction = Transaction() if transaction is None else transaction
    rows: list[_Row] = []
    for line in plan.lines:
        rows += _line_rows(line, wanted_cycle, transaction)
        rows += _address_rows(line)
        terminated = any(segment.terminators for segment in line)
        for segment in line:
            rows += _segment_rows(segment, terminated)
            rows += _supply_rows(segment)
            rows += _signal_rows(segment)

    table = pd.DataFrame(rows, columns=["rule", "object", "value", "own", "note"])
    table["value"] = table["value"].astype(float)
    says = bounds.rename(columns={"note": "says"}).drop(columns="object")
    table = table.join(says, on="rule")
    table["highest"] = table["own"].astype(float).fillna(table["highest"])
    low, high = table["lowest"].fillna(-np.inf), table["highest"].fillna(np.inf)
    table["passed"] = (table["value"] >= low - _SLACK * low.abs()) & (
        table["value"] <= high + _SLACK * high.abs()
    )
    table["note"] = table["note"].where(table["note"] != "", table["says"])
    columns = ["rule", "object", "value", "lowest", "highest", "unit", "passed", "source", "note"]
    return table[columns]


def worst(table: pd.DataFrame) -> pd.DataFrame:
    """Return the row of each rule that is nearest to its limit, or farthest beyond it.

    Parameters
    ----------
    table : pandas.DataFrame
        What `check` returned.

    Returns
    -------
    pandas.DataFrame
        One row a rule, indexed by it, with the share of the limit that is left as `margin`: 0 on
        the limit, negative beyond it; NaN if the value is, and such a row comes before all others.

    Examples
    --------
    >>> from shipnet.asi.network.structures import line
    >>> found = worst(check(line(100, [5, 100])))
    >>> found.loc["signal_level_most", "object"]
    'slave 2 at 100 m'
    >>> print(f"{found.loc['signal_level_most', 'margin']:.0%} below the limit")
    19% below the limit
    """
    left = {}
    for bound, sign in (("lowest", 1), ("highest", -1)):
        scale = table[bound].abs().where(table[bound] != 0, 1.0)
        left[bound] = (sign * (table["value"] - table[bound]) / scale).fillna(np.inf)
    margin = left["lowest"].clip(upper=left["highest"]).where(table["value"].notna())
    margin += 0.0  # no minus zero
    order = margin.fillna(-np.inf).sort_values(kind="stable").index
    first = table.assign(margin=margin).loc[order].drop_duplicates("rule")
    return first.sort_index().set_index("rule")


def _check_limits(bounds: pd.DataFrame) -> None:
    rules, columns = datasets.read("asi_plan_rules.csv")["rule"], rule_limits().columns
    missing = [name for name in rules if name not in bounds.index]
    missing += [name for name in columns if name not in bounds.columns]
    if missing:
        raise ArgumentError(f"limits lack {', '.join(missing)}")


def _line_rows(
    line: tuple[PlanSegment, ...], wanted: float | None, transaction: Transaction
) -> Iterator[_Row]:
    masters = [master for segment in line for master in segment.masters]
    name = f"line of {masters[0]}" if masters else f"line with {line[0]}"
    slaves = [slave for segment in line for slave in segment.slaves]
    yield "masters", name, len(masters), None, ""
    yield "slaves", name, len(slaves), None, ""
    if wanted is not None:
        on_address = Counter(slave.address for slave in slaves if slave.address)
        alone = sum(number == 1 for number in on_address.values())
        time = update_time(alone, len(on_address) - alone, transaction=transaction)
        yield "update_time", name, float(time), wanted, ""


def _address_rows(line: tuple[PlanSegment, ...]) -> Iterator[_Row]:
    slaves = [slave for segment in line for slave in segment.slaves]
    for slave in slaves:
        name = str(slave)
        yield "address", name, slave.address, None, ""
        # A standard slave answers whichever half is asked.
        others = [
            other
            for other in slaves
            if other is not slave
            and other.address == slave.address
            and (None in (other.half, slave.half) or other.half == slave.half)
        ]
        yield "sharing", name, len(others), None, ", ".join(map(str, others))
        odd = (slave.half is not None) != slave.profile.extended
        yield "half", name, int(odd), None, f"profile {slave.profile}" if odd else ""


def _segment_rows(segment: PlanSegment, terminated: bool) -> Iterator[_Row]:
    name = str(segment)
    rule = "cable_length_terminated" if segment.terminators else "cable_length"
    yield rule, name, segment.length, None, ""
    series = "repeaters_in_series_terminated" if terminated else "repeaters_in_series"
    if segment.head is None:
        yield series, name, np.nan, None, "no master on the line"
        yield "answer_delay", name, np.nan, None, "no master on the line"
        return
    yield series, name, len(segment.way), None, f"{segment.reach:g} m from the master"
    per_metre = max(float(CABLES[run.cable].delay) for run in segment.cables)
    cable = 2 * segment.reach * per_metre
    answer = _slowest_answer()
    delay = answer + cable + 2 * sum(repeater.delay for repeater in segment.way)
    note = ""
    if segment.way:
        room = (MASTER_PAUSE_BITS[1] * BIT_TIME - answer - cable) / (2 * len(segment.way))
        note = f"each repeater may take {room * 1e6:.1f} us"
    yield "answer_delay", name, delay / BIT_TIME, None, note


def _slowest_answer() -> float:
    """Return the silence before a slave that was not synchronous answers [s]."""
    times = datasets.read("asi_published_timing.csv").set_index("quantity")["value_us"]
    # From edge to edge in the middle of two bits; half a bit of either is no silence.
    return float(times["edge to edge, asynchronous, most"]) * 1e-6 - BIT_TIME


def _supply_rows(segment: PlanSegment) -> Iterator[_Row]:
    yield "supplies", str(segment), len(segment.supplies), None, ""
    current = supply_current(segment)
    for supply in segment.supplies:
        yield "supply_voltage", str(supply), supply.voltage, None, ""
        yield "supply_current", str(supply), current, None, ""
        yield "supply_rating", str(supply), current, supply.rating, ""
    one = len(segment.supplies) == 1
    volts = device_voltages(segment) if one else {}
    note = "" if one else f"{len(segment.supplies)} supplies in the segment"
    for slave in segment.slaves:
        yield "slave_voltage", str(slave), volts.get(slave.node, np.nan), None, note


def _signal_rows(segment: PlanSegment) -> Iterator[_Row]:
    names = [name for name, _ in listeners(segment)]
    rules = ("signal_level_least", "signal_level_most", "signal_evenness", "ringing", "reception")
    why = "no master on the line" if segment.head is None else ""
    if not why and len(segment.supplies) != 1:
        why = f"{len(segment.supplies)} supplies in the segment"
    if why:
        yield from ((rule, name, np.nan, None, why) for rule in rules for name in names)
        return
    for rule, values in zip(rules, segment_quality(segment), strict=True):
        yield from ((rule, name, float(v), None, "") for name, v in zip(names, values, strict=True))
