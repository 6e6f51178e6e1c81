"""Analysis of message sets: the bit rate they require, and how a log deviates from its plan."""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from shipnet.arrays import Floats, Integers
from shipnet.can.dbc import parse_dbc
from shipnet.can.faults import ErrorBound
from shipnet.can.frame import hexadecimal
from shipnet.can.j1939 import J1939Id, id_parts
from shipnet.can.log import CLOCK_TOLERANCE, Log, coarse, lateness
from shipnet.can.log_files import log_kind, read_log
from shipnet.can.messages import BIT_RATES, Message, MessageSet, bus_load, read_list
from shipnet.can.response import Assignment, Assumptions, ResponseTimes, audsley, response_times
from shipnet.errors import ArgumentError, InputError
from shipnet.fields import check_scalar
from shipnet.files import read_bytes
from shipnet.html import as_html
from shipnet.lazy import Axes, pd
from shipnet.tables import text_of


def read_messages(
    path: str | PathLike[str],
    *,
    columns: Mapping[str, str] | None = None,
    period: float | None = None,
    strict: bool = True,
) -> MessageSet:
    """Read a message set from a CSV, Excel or DBC file, or from a log.

    Parameters
    ----------
    path : path
        A CSV file or Excel workbook with a title row and one row per message; a ``.dbc`` file,
        which requires cantools; or a log of one bus that `read_log` accepts. A CSV file is
        separated by commas, semicolons or tabs, and is in UTF-8, UTF-16 with a byte-order mark, or
        Windows-1252.
    columns : mapping of str to str, optional
        Maps other titles to columns, such as ``{"Every": "period_ms"}``. Required: ``name``,
        ``arbitration_id``, ``dlc`` and, unless `period` is given, ``period_ms``. Optional:
        ``deadline_ms``, ``jitter_ms``, ``offset_ms``, ``extended``, ``sender``, ``bits`` and
        ``transport``.
        ``note`` is ignored. Titles such as ``Cycle time [s]`` and ``CAN-ID (hex)`` are recognised.
    period : float, optional
        Period of messages that have none in the file, 1e-6..1e5 [s].
    strict : bool, default True
        If True, faults in a DBC file raise an error. If False, messages with overlapping or
        oversized signals are kept, other faulty messages (CAN FD, too many bytes, no cycle time,
        duplicate name or identifier) are omitted, and `MessageSet.overlooked` lists all these
        faults.

    Returns
    -------
    MessageSet
        The messages, highest priority first.

    Raises
    ------
    InputError
        If the file cannot be read or is not a message set. The error lists every fault with its
        row, column and value, and with the legal values.
    ImportError
        If the file requires a package that is not installed.

    Notes
    -----
    If there is no column ``extended``, identifiers above 0xFFFF or with eight hexadecimal digits
    count as 29-bit. In a DBC file the period is ``GenMsgCycleTime`` [ms]; 0 means none. Signals are
    checked but not stored. A message of more than 8 bytes is a fast packet if the file is marked as
    NMEA 2000, and otherwise a session of J1939: BAM or, if its PGN has a destination, RTS/CTS.

    A message found in a log is named after its identifier, and its ``dlc`` is the largest found.
    `MessageSet.observed` describes its frames. ``kind`` is ``periodic`` if it was sent throughout
    the log and three quarters of the times between frames are within half a period of the period;
    ``burst`` if several frames at a time are sent periodically; ``unclear`` if there are fewer than
    four frames or bursts; else ``event``. ``period_ms`` is the median time per frame, or per burst,
    between any two, with up to a quarter of the frames lost; ``jitter_ms`` is the range of the
    deviations from the median of 17 neighbours, so that a drifting clock causes none. ``burst`` is
    the largest number of frames without a gap longer than the mean or, of events, in a window as
    long as the shortest period of the set. ``shortest_ms`` is the shortest time between two frames,
    ``longest_ms`` the longest time without a frame, ``wander_ms`` the largest deviation from the
    period as `compare` counts it, and ``step_ms`` the step of the time stamps. No deviation shorter
    than this step can be seen.

    In an analysis, a message that is not periodic has as its period the length of the log per frame
    (a single frame: the given `period`), and as its jitter that of a burst with the shortest time
    between frames. The jitter of a periodic message includes waits for the bus and does not count;
    use `MessageSet.replace` to set one. Each deadline is assumed to be period plus jitter. The load
    equals that of `Log.load`, except that all possible stuff bits count (up to 23 % more), and that
    all frames of a message are as long as its longest.

    Examples
    --------
    >>> from shipnet import datasets
    >>> read_messages(datasets.path("synthetic_can_lee2012.csv"))
    MessageSet(22 messages: JB1-01, JB1-02, JB1-03, ...)
    """
    if period is not None:
        check_scalar("period", period, "s", 1e-6, 1e5)
    file = Path(path)
    if file.suffix.lower() != ".dbc" and log_kind(file):
        log = read_log(file)
        try:
            return log.messages(period=period)
        except ArgumentError as problem:
            raise InputError(str(file), str(problem)) from None
    if file.suffix.lower() == ".dbc":
        return parse_dbc(text_of(read_bytes(file)), str(file), period, strict)
    return read_list(file, columns, period)


@dataclass(frozen=True, eq=False, repr=False)
class Analysis:
    """The bit rate and priority order that a message set requires, as returned by `analyse`.

    `responses` contains the response times by bit rate, lowest first. `lowest` is the lowest bit
    rate at which the given order meets all deadlines, and `lowest_in_best_order` the lowest at
    which any order does; each is infinite if none of the rates suffices. `best` is the best order
    at `lowest_in_best_order` or, if that is infinite, at the highest rate examined.

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
        """Return one row per bit rate, lowest rate first, indexed by ``bit_rate_kbit_per_s``.

        ``load_percent`` is the bus load with the longest frames. ``late`` counts the messages that
        may be late; ``first_late`` names the one with the highest priority. ``critical`` is the
        message with the largest ratio of response time to deadline, and ``critical_percent`` is
        that ratio. ``some_order`` is True if some priority order meets all deadlines.
        """
        rows = []
        for rate, times in self.responses.items():
            critical = times[times.critical] if len(times) else None
            share = critical.response / critical.message.deadline if critical else math.nan
            first = times.late[0] if times.late else ""
            works = rate >= self.lowest_in_best_order
            load = 100 * bus_load(self.messages, rate)
            rows.append((load, len(times.late), first, times.critical, 100 * share, works))
        columns = ["load_percent", "late", "first_late", "critical", "critical_percent"]
        index = pd.Index([rate / 1e3 for rate in self.responses], name="bit_rate_kbit_per_s")
        return pd.DataFrame(rows, columns=[*columns, "some_order"], index=index)

    @property
    def at_lowest(self) -> ResponseTimes:
        """Response times at `lowest`, or at the highest bit rate if `lowest` is infinite."""
        return self.responses.get(self.lowest) or self.responses[max(self.responses)]

    @property
    def ok(self) -> bool:
        """True if the given order meets all deadlines at one or more of the bit rates."""
        return self.lowest < math.inf

    @property
    def verdict(self) -> str:
        """The number of messages, `lowest` and `lowest_in_best_order`, in one line.

        For a log, the line ends with the number of messages of each kind, and with the step of
        the time stamps if it is coarse.
        """
        lowest, best = (
            "none" if rate == math.inf else f"{rate / 1e3:g} kbit/s"
            for rate in (self.lowest, self.lowest_in_best_order)
        )
        notes = [
            f"{len(self.messages)} messages, lowest bit rate: {lowest}, in the best order: {best}"
        ]
        if (observed := self.messages.observed) is not None:
            kinds = Counter(observed["kind"].sort_values())
            notes += ["from a log: " + ", ".join(f"{n} {kind}" for kind, n in kinds.items())]
            notes += coarse(observed["step_ms"].max() / 1e3)
        return "; ".join(notes)

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw each message's deadline and longest response time at the bit rate of `at_lowest`."""
        ax = self.at_lowest.plot(ax)
        ax.set_xlabel(f"time at {self.at_lowest.bit_rate / 1e3:g} kbit/s [ms]")
        return ax

    def __repr__(self) -> str:
        return f"Analysis({self.verdict})"

    def _repr_html_(self) -> str:
        return as_html(self, self.at_lowest.tightest)


def analyse(
    messages: MessageSet | Log | str | PathLike[str],
    bit_rates: float | Iterable[float] = BIT_RATES,
    *,
    period: float | None = None,
    faults: ErrorBound | None = None,
) -> Analysis:
    """Return the load, response times, lowest bit rate and best priority order of a message set.

    Parameters
    ----------
    messages : MessageSet, Log or path
        The messages, a log, or a file that `read_messages` accepts.
    bit_rates : float or iterable of float, default `BIT_RATES`
        Bit rates to examine, whole numbers 1000..1000000 [bit/s].
    period : float, optional
        Period of messages that have none in the file or log, 1e-6..1e5 [s].
    faults : ErrorBound, optional
        Bound on the number of errors on the bus; no errors by default.

    Returns
    -------
    Analysis
        The response times at each bit rate, and the best priority order. Response times of messages
        from a log begin when a frame is queued.

    Raises
    ------
    InputError
        If a file cannot be read or is not a message set.

    Examples
    --------
    >>> from shipnet import can
    >>> found = can.analyse(can.example(), [50e3, 125e3])
    >>> found
    Analysis(10 messages, lowest bit rate: 125 kbit/s, in the best order: 125 kbit/s)
    >>> found.table()[["late", "first_late", "critical"]].values.tolist()
    [[1, 'speed', 'speed'], [0, '', 'speed']]
    """
    rates = [bit_rates] if isinstance(bit_rates, int | float) else sorted({*bit_rates})
    if not rates or not all(1000 <= rate <= 1e6 and rate % 1 == 0 for rate in rates):
        raise ArgumentError(f"bit_rates is {bit_rates!r}; each must be whole, 1000..1000000 bit/s")
    message_set = _messages(messages, period)
    respond = response_times if message_set.observed is None else _from_queue
    responses = {rate: respond(message_set, rate, faults=faults) for rate in rates}
    lowest = min((rate for rate, times in responses.items() if times.met), default=math.inf)
    if any(message.session for message in message_set):  # in the only order there is
        best = Assignment(message_set, lowest < math.inf, ())
        return Analysis(message_set, responses, lowest, best, lowest)
    best = audsley(message_set, min(lowest, rates[-1]), faults=faults)
    lowest_best = min(lowest, rates[-1]) if best.feasible else math.inf
    for rate in reversed([rate for rate in rates if rate < lowest_best < math.inf]):
        other = audsley(message_set, rate, faults=faults)
        if not other.feasible:
            break
        best, lowest_best = other, rate
    return Analysis(message_set, responses, lowest, best, lowest_best)


def _from_queue(
    messages: MessageSet, bit_rate: float, *, faults: ErrorBound | None
) -> ResponseTimes:
    """Return the response times to the messages of a log, whose jitter is due to bursts.

    They begin when a frame is queued. Frame q of a burst must be sent within q + 1 periods, so a
    burst that is in time has a period more than its jitter, and one that is late only a period.
    """
    from_event = response_times(messages, bit_rate, faults=faults)
    judged = [
        one if from_event[one.name].met else replace(one, deadline=one.deadline - one.jitter)
        for one in messages
    ]
    return response_times(
        MessageSet(judged), bit_rate, assumptions=Assumptions(own_jitter=False), faults=faults
    )


def _messages(source: MessageSet | Log | str | PathLike[str], period: float | None) -> MessageSet:
    """Return the messages of a set, a log or a file."""
    if period is not None:
        check_scalar("period", period, "s", 1e-6, 1e5)
    if isinstance(source, str | PathLike):
        return read_messages(source, period=period)
    return source.messages(period=period) if isinstance(source, Log) else source


@dataclass(frozen=True, eq=False, repr=False)
class LogComparison:
    """Deviations of a log from a plan, as returned by `compare`.

    Examples
    --------
    >>> from shipnet import can
    >>> log = can.simulate(can.example(), 125e3, until=10.0).log()
    >>> can.compare(can.example().replace("speed", period=0.02), log)
    LogComparison(10 messages, 1 faster)
    """

    _table: pd.DataFrame
    _step: float
    #: Number of unknown messages with the PGN of a planned one.
    _alike: int = 0

    def table(self) -> pd.DataFrame:
        """Return one row per message, then one per unplanned identifier, indexed by ``name``.

        ``period_ms`` is the planned period; ``shortest_ms`` and ``mean_ms`` are times between two
        frames; ``longest_ms`` is the longest time without a frame, including both ends of the log.
        """
        return self._table.copy()

    @property
    def ok(self) -> bool | None:
        """True if all messages are as planned; None if the log is too short to decide."""
        odd = set(self._table["verdict"]) - {"as planned"}
        return None if odd == {"not seen"} else not odd

    @property
    def verdict(self) -> str:
        """The number of planned messages, and the number with each kind of deviation."""
        verdicts = self._table["verdict"]
        counts = Counter(word for words in verdicts for word in words.split(", "))
        planned = len(verdicts) - counts["unknown"]
        odd = [f"{counts[word]} {word}" for word in _WORDS if counts[word]]
        hint = f"{self._alike} unknown have the PGN of a planned message: compare by PGN (--pgn)"
        parts = [f"{planned} messages, {', '.join(odd) or 'all as planned'}", *coarse(self._step)]
        return "; ".join(parts + [hint] * bool(self._alike))

    def __repr__(self) -> str:
        return f"LogComparison({self.verdict})"

    def _repr_html_(self) -> str:
        planned = self._table["verdict"] == "as planned"
        return as_html(self, self._table.iloc[planned.argsort(kind="stable")])


#: Verdicts on messages that deviate from the plan; `compare` defines them.
_WORDS = ("missing", "late", "faster", "other length", "unknown", "not seen")


def compare(
    messages: MessageSet | Log | str | PathLike[str],
    log: Log | str | PathLike[str],
    *,
    period: float | None = None,
    pgn: bool = False,
) -> LogComparison:
    r"""Compare a log with a plan: find messages that are missing, late, too frequent or unknown.

    With period :math:`T` and deadline :math:`D`, frame :math:`k` = 0, 1, ... of a message is due
    between :math:`k T` and :math:`k T + D` after the first release. Any :math:`n + 1`
    successive frames are

    .. math:: \text{late if they span more than } n T (1 + \epsilon) + D, \qquad
              \text{faster if they span less than } n T (1 - \epsilon) - D

    where :math:`\epsilon` = 1.58 % is the largest relative error of a clock on the bus (Bosch, "CAN
    Specification" 2.0, 1991, part B, section 9). A jitter above :math:`D` takes its place. The step
    of the time stamps is added to :math:`D`; the verdict names it if it is coarse. In a plan from a
    log, what that log shows is as planned: :math:`D` is at least its ``wander_ms``, the longest
    silence is that of the log, and messages without a period are neither late nor faster.

    Parameters
    ----------
    messages : MessageSet, Log or path
        The planned messages, or a file or another log that contains them.
    log : Log or path
        The log or its file; all its buses are included. Without time stamps, only missing messages,
        unknown messages and unexpected lengths are found.
    period : float, optional
        Period of planned messages that have none in the file, 1e-6..1e5 [s].
    pgn : bool, default False
        True to recognise all messages with 29-bit identifiers by their PGN, whatever the priority,
        and from any source that is not planned. Messages with a transport, and those that a DBC
        file assigns to J1939 or NMEA 2000, always are. Long messages are compared as a whole.

    Returns
    -------
    LogComparison
        One row per message, with a verdict: ``as planned``; one or more of ``late`` (also if no
        frame was sent for more than :math:`T (1 + \epsilon) + D` at either end of the log),
        ``faster`` and ``other length``; ``missing``, or ``not seen`` if the log is too short to
        decide; ``unknown`` if the identifier is not planned. A message recognised by its PGN has
        one row per identifier in the log; if there are several, they are named after it.

    Raises
    ------
    InputError
        If a file cannot be read.

    Examples
    --------
    >>> from shipnet import can
    >>> plan = can.MessageSet([m for m in can.example() if m.name != "alarm"])
    >>> found = can.compare(plan, can.simulate(can.example(), 125e3, until=10.0).log())
    >>> found
    LogComparison(9 messages, 1 unknown)
    >>> found.table().loc["0x080", ["frames", "verdict"]].to_dict()
    {'frames': 100, 'verdict': 'unknown'}
    """
    plan = _messages(messages, period)
    frames = log if isinstance(log, Log) else read_log(log)
    keys, codes, times = frames.keys, frames.dlc.astype(int), frames.time
    if any(message.transport for message in plan):
        packets = [one.arbitration_id for one in plan if one.transport == "fast packet"]
        fast = id_parts(np.array(packets, dtype=int))[1].tolist()
        table, alone = frames.assemble(fast).messages, ~frames.extended | frames.remote
        priority, pgns, source, to = (table[part].to_numpy(int) for part in J1939Id._fields)
        ids = priority << 26 | (pgns | np.where((pgns >> 8 & 0xFF) < 240, to, 0)) << 8 | source
        keys = np.concatenate([keys[alone], ids << 1 | 1])
        codes = np.concatenate([codes[alone], table["size"]])
        times = np.concatenate([times[alone], table["time_s"]])
    order = np.lexsort((times, keys))
    keys, codes = keys[order], codes[order]
    begin, end = (frames.time.min(), np.ptp(frames.time)) if len(frames) else (0.0, math.nan)
    times = times[order] - begin
    planned = {message.arbitration_id << 1 | message.extended: message for message in plan}
    groups: dict[Any, Message] = {}
    for key, message in reversed(planned.items()):
        if message.extended and (pgn or message.name in plan.any_source or message.transport):
            _, group, *ends = J1939Id.of(key >> 1)
            groups[group] = groups[group, *ends] = message
    sources: dict[Message | None, list[int]] = defaultdict(list)
    for key in np.unique(keys).tolist():
        one = planned.get(key)
        if one is None and key & 1:
            _, group, *ends = J1939Id.of(key >> 1)
            one = groups.get((group, *ends), groups.get(group))
        sources[one].append(key)
    for key, message in planned.items():
        if message not in sources:
            sources[message].append(key)
    planned_pgns = {J1939Id.of(one.arbitration_id).pgn for one in plan if one.extended}
    unknown = (J1939Id.of(key >> 1) for key in sources[None] if key & 1)
    alike = sum(one.pgn in planned_pgns for one in unknown)
    rows: list[tuple[Any, ...]] = []
    for message, key in ((one, key) for one in (*plan, None) for key in sources[one]):
        chosen = slice(*np.searchsorted(keys, [key, key + 1]))
        gaps = np.diff(times[chosen])
        silence = float(np.diff(times[chosen], prepend=0.0, append=end).max())
        number, expected, odd = hexadecimal(key >> 1, bool(key & 1)), math.nan, ["unknown"]
        name = number
        if message:
            name, expected = message.name, message.period
            name += f" {number}" if len(sources[message]) > 1 else ""
            seen = None if plan.observed is None else plan.observed.loc[message.name]
            odd = _differences(message, times[chosen], codes[chosen], silence, frames.step, seen)
        usual = (gaps.min(), gaps.mean()) if len(gaps) else (math.nan, math.nan)
        spans = (1e3 * span for span in (expected, *usual, silence))
        rows.append((name, number, len(times[chosen]), *spans, ", ".join(odd) or "as planned"))
    columns = ["name", "arbitration_id", "frames", "period_ms", "shortest_ms", "mean_ms"]
    table = pd.DataFrame(rows, columns=[*columns, "longest_ms", "verdict"])
    return LogComparison(table.set_index("name").round(6), frames.step, alike)


def _differences(
    message: Message, times: Floats, codes: Integers, silence: float, step: float, seen: Any
) -> list[str]:
    """Return the verdicts on the frames of a message; no verdict if they are as planned.

    If the plan is from a log, `seen` is its row there: what that log shows is planned.
    """
    slack = max(message.deadline, message.jitter) + step
    quiet = message.period * (1 + CLOCK_TOLERANCE) + slack
    if seen is not None:
        slack = max(slack, seen["wander_ms"] / 1e3 + step) if seen["wander_ms"] >= 0 else math.inf
        quiet = max(quiet, seen["longest_ms"] / 1e3 + step) if slack < math.inf else math.inf
    if not len(times):
        return ["not seen" if silence <= quiet else "missing"]
    late, early = lateness(times, message.period)
    odd = {
        "late": silence > quiet or late > slack,
        "faster": early > slack,
        "other length": (codes != message.dlc).any(),
    }
    return [word for word, differs in odd.items() if differs]
