"""A message set at several bit rates at once: what is late, how slow the bus may be, what helps."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from os import PathLike

from shipnet.can.faults import ErrorBound
from shipnet.can.log import Log
from shipnet.can.log_files import log_kind, read_log
from shipnet.can.messages import BIT_RATES, MessageSet, bus_load, check_set, read_messages
from shipnet.can.response import Assignment, Assumptions, ResponseTimes, audsley, response_times
from shipnet.errors import ArgumentError, InputError
from shipnet.fields import check_path, check_scalar
from shipnet.lazy import pd


@dataclass(frozen=True, eq=False, repr=False)
class Analysis:
    """What a message set needs of its bus; `analyse` makes it.

    Attributes
    ----------
    messages : MessageSet
        The messages.
    responses : mapping of float to ResponseTimes
        The longest response times by bit rate, the lowest rate first.
    lowest : float
        Lowest of the bit rates at which all deadlines are met [bit/s]; infinite if there is none.
    best : Assignment
        The best order of priority at `lowest_in_best_order`, or at the highest of the bit rates if
        that is infinite.
    lowest_in_best_order : float
        Lowest of the bit rates at which some order of priority meets all deadlines [bit/s]: what a
        change of identifiers gains.

    Examples
    --------
    >>> from shipnet import can
    >>> found = can.analyse(can.example(), [50e3, 125e3])
    >>> found.responses[50e3].late, found.lowest
    (['speed'], 125000.0)
    """

    messages: MessageSet
    responses: Mapping[float, ResponseTimes]
    lowest: float
    best: Assignment
    lowest_in_best_order: float

    def table(self) -> pd.DataFrame:
        """Return one row per bit rate, the lowest first, indexed by ``bit_rate_kbit_per_s``.

        ``load_percent`` of the longest frames; ``late``, how many messages may be late, and
        ``first_late``, the most urgent of them; ``critical``, the message whose response takes most
        of its deadline, and ``critical_percent``, how much; ``some_order`` says whether any order
        of priority meets all deadlines.
        """
        rows = []
        for rate, found in self.responses.items():
            critical = found[found.critical] if len(found) else None
            share = critical.response / critical.message.deadline if critical else math.nan
            first = found.late[0] if found.late else ""
            works = rate >= self.lowest_in_best_order
            load = 100 * bus_load(self.messages, rate)
            rows.append((load, len(found.late), first, found.critical, 100 * share, works))
        columns = ["load_percent", "late", "first_late", "critical", "critical_percent"]
        index = pd.Index([rate / 1e3 for rate in self.responses], name="bit_rate_kbit_per_s")
        return pd.DataFrame(rows, columns=[*columns, "some_order"], index=index)

    def __repr__(self) -> str:
        given, best = (
            "none" if rate == math.inf else f"{rate / 1e3:g} kbit/s"
            for rate in (self.lowest, self.lowest_in_best_order)
        )
        return (
            f"Analysis({len(self.messages)} messages, lowest bit rate: {given}, "
            f"in the best order: {best})"
        )


def analyse(
    messages: MessageSet | Log | str | PathLike[str],
    bit_rates: float | Iterable[float] = BIT_RATES,
    *,
    period: float | None = None,
    assumptions: Assumptions | None = None,
    faults: ErrorBound | None = None,
) -> Analysis:
    """Return load, response times, lowest bit rate and best order of a message set.

    Parameters
    ----------
    messages : MessageSet, Log or path
        The messages, or what they are found in: a log or its file, as `read_log` takes it, or a
        message list or DBC file, as `read_messages` takes it.
    bit_rates : float or iterable of float, default `BIT_RATES`
        Bit rates to look at, 1000..1000000 [bit/s], whole numbers.
    period : float, optional
        Period of messages for which a file or a log has none [s].
    assumptions : Assumptions, optional
        How long frames are, and what counts as the response.
    faults : ErrorBound, optional
        How many errors hit the bus; none if not given.

    Returns
    -------
    Analysis
        One row per bit rate in its table; what is late, and what another order gains.

    Raises
    ------
    ArgumentError
        If an argument is out of its range.
    InputError
        If a file cannot be read, or does not describe a message set.

    Examples
    --------
    >>> from shipnet import can
    >>> found = can.analyse(can.example(), [50e3, 125e3])
    >>> found
    Analysis(10 messages, lowest bit rate: 125 kbit/s, in the best order: 125 kbit/s)
    >>> found.table()[["late", "first_late", "critical"]].values.tolist()
    [[1, 'speed', 'speed'], [0, '', 'speed']]
    """
    try:
        rates = sorted({float(rate) for rate in bit_rates})  # type: ignore[union-attr]
    except (TypeError, ValueError):
        rates = [bit_rates] if isinstance(bit_rates, int | float) else []
    if not rates or not all(1000 <= rate <= 1e6 and rate % 1 == 0 for rate in rates):
        raise ArgumentError(f"bit_rates is {bit_rates!r}; it must be whole, 1000..1000000 bit/s")
    if period is not None:
        check_scalar("period", period, "s", 1e-6, 1e5)
    known = _messages(messages, period)
    responses = {
        rate: response_times(known, rate, assumptions=assumptions, faults=faults) for rate in rates
    }
    lowest = min((rate for rate, found in responses.items() if found.met), default=math.inf)
    best = audsley(known, min(lowest, rates[-1]), assumptions=assumptions, faults=faults)
    lowest_best = min(lowest, rates[-1]) if best.feasible else math.inf
    for rate in reversed([rate for rate in rates if rate < lowest_best < math.inf]):
        other = audsley(known, rate, assumptions=assumptions, faults=faults)
        if not other.feasible:
            break
        best, lowest_best = other, rate
    return Analysis(known, responses, lowest, best, lowest_best)


def _messages(source: object, period: float | None) -> MessageSet:
    """Return the messages that a set, a log or a file holds."""
    if isinstance(source, Log):
        return source.messages(period=period)
    if not isinstance(source, str | PathLike):
        check_set(source)
        return source  # type: ignore[return-value]
    path = check_path("messages", source)
    try:
        is_log = path.suffix.lower() != ".dbc" and log_kind(path) != ""
    except OSError as problem:
        raise InputError(str(path), f"cannot be read: {problem.strerror}") from None
    return read_log(path).messages(period=period) if is_log else read_messages(path, period=period)
