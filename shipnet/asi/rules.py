"""Check the objects of a plan against the rules of AS-i, whose limits are in a table."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from functools import cache

import numpy as np

from shipnet import datasets
from shipnet.answers import COLUMNS
from shipnet.asi.segment import Segment, signals_of
from shipnet.asi.slave import Slave
from shipnet.asi.timing import BIT_TIME, MASTER_PAUSE_BITS, Transaction, polling_cycle
from shipnet.errors import ArgumentError
from shipnet.lazy import pd

#: Relative rounding error by which a value may exceed its limit.
_SLACK = 1e-9

#: What remains to be done on a line with terminators that violates a rule.
_TERMINATED = {
    "signal_level_least": "terminators and slaves load the line: use fewer slaves",
    "ringing": "terminators slow the decay of pulses: use a smaller inductance",
}

#: One row of the table without its verdict: rule, object, value, upper limit (None unless the
#: object itself sets it), and reason.
_Row = tuple[str, str, float, float | None, str]


def rule_limits() -> pd.DataFrame:
    """Return the limits of all rules with their sources; `Plan.check` accepts a changed table.

    Returns
    -------
    pandas.DataFrame
        Indexed by rule: `object`, `low`, `high`, `unit`, `graded`, `source`, `note`. A limit is
        NaN if there is none, or if the user or the object sets it. A rule that is not graded has no
        margin.

    Examples
    --------
    Allow 20 m more cable:

    >>> limits = rule_limits()
    >>> limits.loc["cable_length", "high"] += 20
    >>> from shipnet.asi.topologies import line
    >>> line(120, [120]).check(limits=limits).ok
    True
    """
    return _published().copy()


@cache
def _published() -> pd.DataFrame:
    table = datasets.read("asi_plan_rules.csv").set_index("rule")
    table = table.rename(columns={"lowest": "low", "highest": "high"})
    for bound in ("low", "high"):
        table[bound] = table[bound].replace("", "nan").astype(float)
    return table.assign(graded=table["graded"] == "yes")


def check_lines(
    lines: Sequence[tuple[Segment, ...]],
    wanted_cycle: float | None,
    transaction: Transaction | None,
    limits: pd.DataFrame | None,
) -> pd.DataFrame:
    """Return the findings of `Plan.check`."""
    if wanted_cycle is not None and not 0 < wanted_cycle < np.inf:
        raise ArgumentError(f"wanted_cycle is {wanted_cycle!r} s; it must be positive")
    published = _published()
    bounds = published if limits is None else limits
    missing = [name for name in published.index if name not in bounds.index]
    missing += [name for name in published.columns if name not in bounds.columns]
    if missing:
        raise ArgumentError(f"limits lack {', '.join(missing)}")
    transaction = Transaction() if transaction is None else transaction
    rows = [row for line in lines for row in _rows(line, wanted_cycle, transaction)]
    rule, name, values, own_limits, why = zip(*rows, strict=True)
    rank = {rule: number for number, rule in enumerate(bounds.index)}
    rows_of_limits = [rank[one] for one in rule]
    limit = {column: bounds[column].to_numpy()[rows_of_limits] for column in published.columns}
    value, low = np.array(values, dtype=float), limit["low"].astype(float)
    high = np.array(own_limits, dtype=float)
    high = np.where(np.isnan(high), limit["high"].astype(float), high)
    # A comparison with NaN, which means no limit, is False.
    beyond = (value < low - _SLACK * abs(low)) | (value > high + _SLACK * abs(high))
    verdict = np.where(np.isnan(value), "not verified", np.where(beyond, "violated", "met"))
    reason = [detail or note for detail, note in zip(why, limit["note"], strict=True)]
    stated = limit["source"], limit["graded"]
    columns = (rule, name, value, low, high, limit["unit"], verdict, reason, *stated)
    return pd.DataFrame(dict(zip((*COLUMNS, "graded"), columns, strict=True)))


def meets(lines: Sequence[tuple[Segment, ...]], limits: pd.DataFrame) -> bool:
    """Return True if every rule is met; stop checking at the first violation."""
    rows = (row for line in lines for row in _rows(line, None, Transaction()))
    return next(_violated(rows, limits), "") == ""


def first_violated(segment: Segment, terminated: bool, limits: pd.DataFrame) -> str:
    """Return the first rule on a segment, its supply or its signals that is not met, or ""."""
    return next(_violated(_rows_of_segments((segment,), terminated), limits), "")


def _violated(rows: Iterable[_Row], limits: pd.DataFrame) -> Iterator[str]:
    ends = limits["low"].fillna(-np.inf), limits["high"].fillna(np.inf)
    bounds = dict(zip(limits.index, zip(*ends, strict=True), strict=True))
    for rule, _, value, own_limit, _ in rows:
        low, high = bounds[rule]
        high = high if own_limit is None else own_limit
        if not low - _SLACK * abs(low) <= value <= high + _SLACK * abs(high):
            yield rule


def _rows(
    line: tuple[Segment, ...], update_limit: float | None, transaction: Transaction
) -> Iterator[_Row]:
    masters = [master for segment in line for master in segment.masters]
    name = f"line of {masters[0]}" if masters else f"line with {line[0]}"
    slaves = [slave for segment in line for slave in segment.slaves]
    yield "masters", name, len(masters), None, ""
    yield "slaves", name, len(slaves), None, ""
    if update_limit is not None:
        delays = [(slave.address, segment.delay) for segment in line for slave in segment.slaves]
        yield (
            "update_time",
            name,
            polling_cycle(delays, transaction).update_time(),
            update_limit,
            "",
        )
    yield from _address_rows(slaves)
    yield from _rows_of_segments(line, any(segment.terminators for segment in line))


def _rows_of_segments(segments: Sequence[Segment], terminated: bool) -> Iterator[_Row]:
    judged = []
    for segment in segments:
        yield from _segment_rows(segment, terminated)
        yield from _supply_rows(segment)
        why = []
        if segment.head is None:
            why.append("no master on the line")
        if len(segment.supplies) != 1 and segment.listeners:
            why.append(f"{len(segment.supplies)} supplies in the segment")
        if why:
            yield "voltages_and_signals", str(segment), np.nan, None, "; ".join(why)
        else:
            judged.append(segment)
    rules = ("signal_level_least", "signal_level_most", "signal_evenness", "ringing", "reception")
    for segment, quality in zip(judged, signals_of(judged), strict=True):
        names = [name for name, _ in segment.listeners]
        for rule, values in zip(rules, quality[:5], strict=True):
            reason = _TERMINATED.get(rule, "") if segment.terminators else ""
            for name, value in zip(names, values.tolist(), strict=True):
                yield rule, name, value, None, reason


def _address_rows(slaves: Sequence[Slave]) -> Iterator[_Row]:
    on_address: dict[int, list[Slave]] = {}
    for slave in slaves:
        on_address.setdefault(slave.address, []).append(slave)
    for slave in slaves:
        name = str(slave)
        yield "address", name, slave.address, None, ""
        # A standard slave answers requests to either half.
        same = [one for one in on_address[slave.address] if one is not slave]
        others = [one for one in same if None in (one.half, slave.half) or one.half == slave.half]
        yield "sharing", name, len(others), None, ", ".join(map(str, others))
        odd = (slave.half is not None) != slave.kind.extended
        yield "half", name, int(odd), None, f"profile {slave.profile}" if odd else ""


def _segment_rows(segment: Segment, terminated: bool) -> Iterator[_Row]:
    name = str(segment)
    rule = "cable_length_terminated" if segment.terminators else "cable_length"
    yield rule, name, segment.length, None, ""
    series = "repeaters_in_series_terminated" if terminated else "repeaters_in_series"
    if segment.head is None:
        return
    yield series, name, len(segment.path), None, f"{segment.reach:g} m from the master"
    per_metre = max(float(run.made_of.delay) for run in segment.cables)
    cable = 2 * segment.reach * per_metre
    # The longest silence before the response of an asynchronous slave [s]. Measured from mid-bit to
    # mid-bit, the published time includes two half-bits that are not silent.
    answer = float(_times()["edge to edge, asynchronous, most"]) * 1e-6 - BIT_TIME
    delay = answer + cable + 2 * segment.delay
    note = ""
    if segment.path:
        room = (MASTER_PAUSE_BITS[1] * BIT_TIME - answer - cable) / (2 * len(segment.path))
        note = f"each repeater may delay signals by up to {room * 1e6:.1f} us"
    yield "answer_delay", name, delay / BIT_TIME, None, note


@cache
def _times() -> pd.Series:
    return datasets.read("asi_published_timing.csv").set_index("quantity")["value_us"]


def _supply_rows(segment: Segment) -> Iterator[_Row]:
    yield "supplies", str(segment), len(segment.supplies), None, ""
    current = segment.current
    for supply in segment.supplies:
        yield "supply_voltage", str(supply), supply.voltage, None, ""
        yield "supply_current", str(supply), current, None, ""
        yield "supply_rating", str(supply), current, supply.rating, ""
    if len(segment.supplies) == 1:
        for slave in segment.slaves:
            volts = segment.voltages[slave.node]
            why = "" if volts else "the supply cannot drive the currents through the cables"
            yield "slave_voltage", str(slave), volts, None, why
