"""The time to poll slaves on a serial line: transactions, time-outs and scans."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from itertools import pairwise
from math import floor, inf, log2, nan
from operator import truediv
from os import PathLike
from typing import NamedTuple, TypeAlias

import numpy as np

from shipnet import style
from shipnet.answers import Utilisation
from shipnet.errors import ArgumentError, InputError
from shipnet.fields import check_fields, check_scalar, check_whole, number, part, record, whole
from shipnet.html import as_html
from shipnet.lazy import Axes, pd
from shipnet.modbus.device_table import read_devices
from shipnet.modbus.frame import MAX_UNIT, RTU_BYTES
from shipnet.modbus.pdu import READ_LIMITS, WRITE_LIMITS, Request
from shipnet.modbus.uart import SerialLine

BIT_RATES = (1200, 2400, 4800, 9600, 19200, 38400, 57600, 115200)  #: Common bit rates [bit/s].


class TcpLink(SerialLine):
    """A TCP connection: its frames and silences take no time beside the latency of a device."""

    __slots__ = ()
    t35 = 0.0

    def frame_time(self, size: int) -> float:
        """Return 0 [s]."""
        return 0.0


@record(slots=True)
class Poll:
    """One request that a master sends to each of its slaves in turn.

    .. math:: T = t_{request} + t_{3.5} + t_{processing} + t_{response} + t_{3.5}

    After a time-out, the next request follows at once, because the line has been silent. "MODBUS
    over serial line" V1.02, section 2.4.1, suggests a time-out of "typically 1 s to several seconds
    at 9600 bit/s".

    Examples
    --------
    Read four input registers from each of 247 slaves at 9600 bit/s, without and with a dead slave:

    >>> poll = Poll(Request.read_input_registers(0, 4), SerialLine(9600))
    >>> round(poll.time * 1e3, 2), round(poll.scan_time(247), 2)
    (32.08, 7.92)
    >>> round(poll.scan_time(247, dead=1), 2), poll.max_slaves(2.0)
    (8.9, 62)
    """

    request: Request = part(Request, "Request that the master sends")
    line: SerialLine = part(SerialLine, "Settings of the line")
    processing: float = number(
        0,
        3600,
        "s",
        "Processing times of slave and master together, in addition to the silences",
        default=0.0,
    )
    timeout: float = number(
        0,
        3600,
        "s",
        "Response time-out: how long the master waits, from the end of its request, "
        "for the whole response; it must not be shorter than a response takes",
        default=1.0,
    )
    retries: int = whole(
        0, 100, help="How many times the master repeats a request that is not answered", default=0
    )
    #: Lengths of the request and response frames, including unit id and CRC [byte].
    request_size: int = field(init=False, repr=False, compare=False)
    response_size: int = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        check_fields(self)
        object.__setattr__(self, "request_size", len(self.request.pdu) + RTU_BYTES)
        object.__setattr__(self, "response_size", self.request.response_size + RTU_BYTES)
        check_scalar("timeout", self.timeout, "s", self.shortest_timeout, 3600)

    @property
    def shortest_timeout(self) -> float:
        """Time from the end of the request to the end of the response [s]."""
        return self.line.t35 + self.processing + self.line.frame_time(self.response_size)

    @property
    def on_wire(self) -> float:
        """Time of request and response, without silences [s]."""
        return self.line.frame_time(self.request_size) + self.line.frame_time(self.response_size)

    @property
    def time(self) -> float:
        """Time from one request to the next if the slave answers [s]."""
        return self.line.frame_time(self.request_size) + self.shortest_timeout + self.line.t35

    @property
    def unanswered_time(self) -> float:
        """Time from one request to the next if the slave does not answer [s]."""
        return self.line.frame_time(self.request_size) + self.timeout

    @property
    def timeout_time(self) -> float:
        """Time spent on a dead slave, including all retries [s]."""
        return (1 + self.retries) * self.unanswered_time

    def scan_time(self, n_slaves: int, *, dead: int = 0) -> float:
        """Return the time [s] to poll 1..247 slaves once if `dead` of them do not answer."""
        slaves = check_whole("n_slaves", n_slaves, 1, MAX_UNIT)
        silent = check_whole("dead", dead, 0, slaves)
        return (slaves - silent) * self.time + silent * self.timeout_time

    def utilisation(self, n_slaves: int, update: float, *, dead: int = 0) -> Utilisation:
        """Return the line's utilisation if all points must be read every `update` seconds."""
        check_scalar("update", update, "s", 1e-6, 1e6)
        scan = self.scan_time(n_slaves, dead=dead)
        capacity = max(n_slaves / MAX_UNIT, scan / update)
        return Utilisation(self._busy_time(n_slaves, dead) / scan, capacity, scan + self.time)

    def _busy_time(self, n_slaves: int, dead: int) -> float:
        """Return the time in a scan during which bytes are on the line [s]."""
        tries = dead * (1 + self.retries)
        return (n_slaves - dead) * self.on_wire + tries * self.line.frame_time(self.request_size)

    def max_slaves(self, period: float, *, dead: int = 0) -> int:
        """Return how many slaves (0..247), including dead ones, can be polled in a period [s]."""
        longest = check_scalar("period", period, "s", 0, 1e6)
        return _most([self], longest, check_whole("dead", dead, 0, MAX_UNIT))


def _most(polls: Sequence[Poll], period: float, dead: int) -> int:
    """Return how many slaves, including dead ones, can be sent all these requests in a period."""
    alive, silent = sum(poll.time for poll in polls), sum(poll.timeout_time for poll in polls)
    # The margin allows for rounding if a period is a whole number of transactions.
    fit = floor((period - dead * silent) / alive * (1 + 1e-12) + 1e-12)
    return min(dead + fit, MAX_UNIT) if fit >= 0 else 0


class Polled(NamedTuple):
    """Equal slaves, each of which is sent all requests of `polls`; or a row of a table."""

    polls: tuple[Poll, ...]
    dead: bool = False
    number: int = 1
    name: str = ""  # only of a row of a table
    unit: tuple[str, int] = ("", 0)  # host and address
    period: float = inf  # wanted time between two updates; infinite if none is, or if dead [s]

    @property
    def times(self) -> tuple[float, float]:
        """Time of the requests to one slave, if it answers and if it is dead [s]."""
        return sum(p.time for p in self.polls), sum(p.timeout_time for p in self.polls)


#: An order of rows. For each row: the number of cycles from one poll to the next, the first cycle,
#: and the longest time between two polls [s].
Order: TypeAlias = tuple[list[int], list[int], list[float]]


def spread(times: Sequence[float], every: Sequence[int]) -> Order:
    """Return the order in which rows of these times [s] are spread, the longest first."""
    first, load = [0] * len(times), np.zeros(max(every))
    order = sorted(range(len(times)), key=lambda k: (every[k], -times[k]))
    for k in order:
        first[k] = int(load.reshape(-1, every[k]).max(axis=0).argmin())
        load[first[k] :: every[k]] += times[k]
    now, begins = 0.0, [list[float]() for _ in times]
    for cycle in range(len(load)):
        for k in (k for k in order if cycle % every[k] == first[k]):
            begins[k].append(now)
            now += times[k]
    gaps = [[b - a for a, b in pairwise([*one, one[0] + now])] for one in begins]
    return [*every], first, [max(one) for one in gaps]


def best_order(rows: Sequence[Polled]) -> Order:
    """Return the order in which the largest ratio of interval to wanted period is smallest.

    A row is polled in every 1st, 2nd, 4th, ... or 64th cycle, as often as cycles of some length fit
    in its period: S. Chan and F. Chin, IEEE Trans. Computers 41 (1992) 755. Sixteen lengths, from
    the shortest period down to half of it, are tried. A row without a period counts as the slowest.
    If rows cannot be polled as often as wanted, another sequence may be better by some 15 %.
    """
    periods = [row.period for row in rows]
    wanted = [period for period in periods if period < inf] or [1.0]
    times = [row.number * row.times[row.dead] for row in rows]
    options = {(1,) * len(rows)}
    for base in min(wanted) / 2 ** (np.arange(16) / 16):
        fit = [floor(log2(min(period, max(wanted)) / base) + 1e-9) for period in periods]
        options.add(tuple(2 ** min(one, 6) for one in fit))
    orders = [spread(times, every) for every in sorted(options)]
    return min(orders, key=lambda one: max(map(truediv, one[2], periods)))


@dataclass(frozen=True, eq=False, repr=False)
class Scan:
    """One scan, in which a master polls all its slaves once, as returned by `scan`.

    `rows` are the slaves with the requests that each is sent. `limit` is the longest time allowed
    [s], or None; `remarks` say how a table was read.

    Examples
    --------
    >>> from shipnet import modbus
    >>> result = modbus.scan(24, registers=20, bit_rate=19200, dead=2, limit=3.0)
    >>> result
    Scan(24 slaves, 2 dead: 2.765 s at a processing time of 0 ms, limit of 3 s met up to 10.6 ms)
    >>> round(result.dead_time, 3), round(result.slave_time, 3), result.max_slaves
    (1.005, 0.034, 30)
    """

    rows: tuple[Polled, ...]
    limit: float | None
    remarks: tuple[str, ...] = ()

    @property
    def polls(self) -> tuple[Poll, ...]:
        """Requests to the first slave, and without a table to each slave."""
        return self.rows[0].polls

    @property
    def n_slaves(self) -> int:
        """Number of slaves, including dead ones."""
        return sum({row.unit: row.number for row in self.rows}.values())

    @property
    def dead(self) -> int:
        """Number of dead slaves."""
        return sum({row.unit: row.number for row in self.rows if row.dead}.values())

    @property
    def bit_rate(self) -> float:
        """Bit rate of the line [bit/s]."""
        return self.polls[0].line.bit_rate

    @property
    def time(self) -> float:
        """Time of the scan [s]."""
        return sum(row.number * row.times[row.dead] for row in self.rows)

    @property
    def slave_time(self) -> float:
        """Time per slave that answers; with a table, of the slowest [s]."""
        return self._longest(dead=False)

    @property
    def dead_time(self) -> float:
        """Time per dead slave, including time-outs and retries; with a table, of the worst [s]."""
        return self._longest(dead=True)

    def _longest(self, *, dead: bool) -> float:
        times: dict[tuple[str, int], float] = defaultdict(float)
        for row in self.rows:
            times[row.unit] += row.times[dead]
        return max(times.values())

    @property
    def bus_time(self) -> float:
        """Fraction of the scan time during which bytes are on the line, 0..1."""
        busy = (
            p._busy_time(row.number, row.number * row.dead) for row in self.rows for p in row.polls
        )
        return sum(busy) / self.time

    @property
    def max_slaves(self) -> int | None:
        """Largest number of equal slaves, including dead ones, that meets the limit, or None."""
        if self.limit is None or self.rows[0].name:
            return None
        return _most(self.polls, self.limit, self.dead)

    @property
    def ok(self) -> bool | None:
        """Whether limit and wanted periods are met, these in the best order; None without any."""
        met = [] if self.limit is None else [self.time <= self.limit]
        if any(row.period < inf for row in self.rows):
            met += [bool(self.slaves()["met"].dropna().all())]
        return all(met) if met else None

    @property
    def max_processing(self) -> float | None:
        """Longest processing time per response that meets time-out and limit [s], or None."""
        answers = (self.n_slaves - self.dead) * len(self.polls)
        if self.limit is None or self.rows[0].name or not self.ok or not answers:
            return None
        margin = min(poll.timeout - poll.shortest_timeout for poll in self.polls)
        return self.polls[0].processing + min((self.limit - self.time) / answers, margin)

    @property
    def verdict(self) -> str:
        """The result in one line."""
        dead = f", {self.dead} dead" if self.dead else ""
        more = f" at a processing time of {1e3 * self.polls[0].processing:g} ms"
        if self.rows[0].name:
            met = self.slaves()["met"].dropna()
            late = sum(self.time > row.period for row in self.rows)
            more = f", {late} of {len(met)} rows too late" * (late > 0)
            more += f", {len(met) - sum(met)} in the best order" * (late > 0)
        scanned = f"{self.n_slaves} slaves{dead}: {self.time:.3f} s{more}"
        if self.limit is None:
            return scanned
        most = self.max_processing
        # Rounded down, so that the limit is met at the stated time.
        up_to = "" if most is None else f" up to {floor(1e4 * most) / 10:g} ms"
        return f"{scanned}, limit of {self.limit:g} s {'met' if self.ok else 'exceeded'}{up_to}"

    def slaves(self) -> pd.DataFrame:
        """Return one row per row of the scan, indexed by ``slave``.

        Columns: ``address``, ``host``, ``time_ms`` if it answers, ``dead_adds_ms`` (added to the
        scan if it is dead), ``age_best_ms`` and ``age_worst_ms`` of its values, just after and just
        before they are updated, ``wanted_ms``, and the best order: the number of cycles per poll
        (``every``), the ``first`` cycle, the longest ``interval_ms``, and whether it is ``met``.
        """
        order, rows = best_order(self.rows), []
        for row, *place in zip(self.rows, *order, strict=True):
            (alive, dead), new = row.times, max(poll.shortest_timeout for poll in row.polls)
            ages = (nan, nan) if row.dead else (new, self.time + new)
            ms = 1e3 * np.array([alive, dead - alive, *ages, row.period, place[2]])
            # The margin allows for rounding if a period is a whole number of transactions.
            met = None if row.period == inf else place[2] <= row.period * (1 + 1e-9)
            name, (host, unit) = row.name or "each", row.unit
            rows.append((name, unit, host, *ms[:5], place[0], place[1] + 1, ms[5], met))
        columns = "slave address host time_ms dead_adds_ms age_best_ms age_worst_ms wanted_ms"
        columns += " every first interval_ms met"
        return pd.DataFrame(rows, columns=columns.split()).set_index("slave").replace(inf, nan)

    def table(self) -> pd.DataFrame:
        """Return one row per bit rate (common ones and the scan's own), indexed by ``bit_rate``.

        Columns: ``scan_s``, ``slave_ms``, ``dead_slave_ms``, ``bus_time_percent``, and with a limit
        ``max_slaves`` and ``met``. Bit rates at which a response exceeds the time-out are omitted.
        """
        rows = {}
        for rate in sorted({*BIT_RATES, self.bit_rate}):
            with suppress(ArgumentError):
                one = replace(self, rows=tuple(_at(row, rate) for row in self.rows))
                times = (one.time, 1e3 * one.slave_time, 1e3 * one.dead_time, 100 * one.bus_time)
                rows[rate] = (*times, one.max_slaves, one.ok)
        columns = ["scan_s", "slave_ms", "dead_slave_ms", "bus_time_percent", "max_slaves", "met"]
        table = pd.DataFrame.from_dict(rows, orient="index", columns=columns)
        return table.rename_axis("bit_rate").dropna(axis="columns")

    @style.applied
    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the scan time over the bit rate, with the limit; of a table, the ages of values."""
        if self.rows[0].name:
            return self._plot_ages(style.axes(ax))
        ax, times = style.axes(ax), self.table()["scan_s"]
        ax.plot(times.index, times, "o-", color="C0", mfc="white")
        ax.plot(self.bit_rate, self.time, "o", color="C0", ms=9)
        ax.annotate("chosen", (self.bit_rate, self.time), (6, 6), textcoords="offset points")
        if self.limit is not None:
            style.limit(ax, self.limit, f"limit,\n{self.limit:g} s")
        ax.set(xscale="log", xlabel="bit rate [bit/s]", ylabel="scan time [s]")
        style.logarithmic(ax.yaxis)
        ax.set_xticks(times.index, [f"{rate:g}" for rate in times.index], rotation=90)
        ax.set_xticks([], minor=True)
        ax.set_xlim(0.85 * times.index[0], 1.2 * times.index[-1])
        return ax

    def _plot_ages(self, ax: Axes) -> Axes:
        rows, x = self.slaves(), np.arange(1, len(self.rows) + 1)
        ax.vlines(
            x,
            rows["age_best_ms"],
            rows["age_worst_ms"],
            color="C0",
            lw=3,
            label="age, polled as listed",
        )
        for interval, look, label in (
            ("interval_ms", {"marker": "o", "mfc": "white"}, "oldest in the best order"),
            ("wanted_ms", {"marker": "_", "color": style.LIMIT["color"], "mew": 2}, "wanted"),
        ):
            ax.plot(x, rows[interval] + rows["age_best_ms"], ls="", label=label, **look)
        step = -(-len(x) // 30)
        ax.set_xticks(x[::step], [style.literal(name) for name in rows.index[::step]], rotation=90)
        ax.set(yscale="log", ylabel="age of values [ms]")
        style.logarithmic(ax.yaxis)
        ax.legend(loc="lower center", bbox_to_anchor=(0.5, 1), ncols=3)
        return ax

    def __repr__(self) -> str:
        return f"Scan({self.verdict})"

    def _repr_html_(self) -> str:
        if self.rows[0].name:
            return as_html(self, self.slaves())
        table = self.table()
        if self.limit is not None:
            table = table.assign(limit_s=self.limit, margin_s=self.limit - table["scan_s"])
        nearest = np.argsort(abs(np.log(table.index / self.bit_rate)), kind="stable")
        return as_html(self, table.iloc[nearest])


def _at(row: Polled, bit_rate: float) -> Polled:
    """Return a row with another bit rate."""
    polls = (replace(poll, line=replace(poll.line, bit_rate=bit_rate)) for poll in row.polls)
    return row._replace(polls=tuple(polls))


def _requests(function: int, first: int, count: int) -> Iterator[Request]:
    """Yield requests for adjacent registers or coils, as many in each as the standard allows."""
    most = (READ_LIMITS | WRITE_LIMITS)[function]
    for begin in range(first, first + count, most):
        n = min(most, first + count - begin)
        yield Request(function, begin, n, [False] * n, [0] * n)


def _read_rows(path: str | PathLike[str], default: Poll) -> tuple[list[Polled], tuple[str, ...]]:
    """Return the rows of a table, whose empty cells mean the values of `default`, and remarks."""
    table, remarks = read_devices(path)
    blocks = Counter((one["device"], one["host"], one["address"]) for one in table)
    units = Counter(device for device, *_ in blocks)
    rows, faults = list[Polled](), []
    for one in table:
        name, unit = one["device"], (one["host"], one["address"])
        is_block, is_namesake = blocks[name, *unit] > 1, units[name] > 1
        name += f" {one['host']} {one['address']}".replace("  ", " ") if is_namesake else ""
        name += f" FC{one['function']:d} {one['register']}" if is_block else ""
        columns = {"timeout": "timeout", "retries": "retries", "processing": "delay"}
        options = {key: one[of] for key, of in columns.items() if one[of] is not None}
        options["line"] = TcpLink(default.line.bit_rate) if one["host"] else default.line
        requests = _requests(one["function"], one["register"], one["registers"])
        try:
            polls = tuple(replace(default, request=request, **options) for request in requests)
        except ArgumentError as error:
            faults.append(f"row {one['row']}: {error}")
            continue
        period = inf if one["dead"] else one["period"] or inf
        rows.append(Polled(polls, bool(one["dead"]), 1, name, unit, period))
    if faults:
        raise InputError(str(path), *faults)
    return rows, remarks


def scan(
    slaves: int | str | PathLike[str],
    *,
    registers: int | None = None,
    bit_rate: float = 9600,
    character: str = "8E1",
    processing: float = 0.0,
    dead: int = 0,
    timeout: float = 1.0,
    retries: int = 0,
    limit: float | None = None,
) -> Scan:
    """Compute how long a master takes to poll all its slaves once, and how old values become.

    Parameters
    ----------
    slaves : int or path
        Number of equal slaves, 1..247, or a CSV file or Excel workbook; see Notes.
    registers : int, optional
        Holding registers per slave, 1..65536; each request reads at most 125. Only a number of
        slaves needs it.
    bit_rate : float, default 9600
        300..10e6 [bit/s].
    character : str, default "8E1"
        Data bits, parity and stop bits.
    processing : float, default 0
        Time that a slave takes to prepare each response, 0..3600 [s]; 0 is optimistic. The answer
        names it, and the longest one that meets the limit.
    dead : int, default 0
        Number of slaves that do not answer, 0..slaves; a table has a column instead.
    timeout : float, default 1
        Response time-out, at most 3600 [s] and not shorter than a response takes.
    retries : int, default 0
        Number of retries if a slave does not answer, 0..100.
    limit : float, optional
        Longest time allowed for the scan, 0..1e6 [s].

    Returns
    -------
    Scan
        The scan: its `time` and parts, whether the limit is met, and times at other bit rates; of a
        table, also the ages of values, the cost of each dead slave and the best order.

    Raises
    ------
    InputError
        If a table cannot be read; all its faults are listed.

    Notes
    -----
    A table has one row per block of registers, and at least the columns ``address`` (1..247),
    ``register`` (the first one, 0..65535) and ``registers`` (1..65536). Optional columns, whose
    empty cells mean the arguments above: ``device`` (name), ``function`` (1..6, 15 or 16, default
    3), ``period`` (wanted time between two updates), ``timeout``, ``retries``, ``delay``
    (processing time), ``dead`` (yes or no) and ``host``. Times need a unit, as in ``period [ms]``.
    A slave with a host is polled over TCP: its frames take no time, and its ``delay`` includes the
    latency. The master sends one request at a time; devices polled in parallel need a table of
    their own.

    The age of a value counts from the end of the request. The best order polls a row in one of
    every 1, 2, 4, ... or 64 cycles.

    Examples
    --------
    >>> scan(31, registers=4, bit_rate=9600)
    Scan(31 slaves: 0.995 s at a processing time of 0 ms)
    >>> round(scan(24, registers=300, bit_rate=38400).time, 3)
    4.645
    """
    if limit is not None:
        check_scalar("limit", limit, "s", 0, 1e6)
    line = SerialLine(bit_rate, character)
    if isinstance(slaves, str | PathLike):
        if registers is not None or dead:
            raise ArgumentError("registers or dead is given; a table has columns for them")
        default = Poll(Request(3, 0, 1), line, processing, timeout, retries)
        rows, remarks = _read_rows(slaves, default)
        return Scan(tuple(rows), limit, remarks)
    if registers is None:
        raise ArgumentError("registers is None; give the number of registers per slave")
    count = check_whole("registers", registers, 1, 1 << 16)
    n_slaves = check_whole("slaves", slaves, 1, MAX_UNIT)
    silent = check_whole("dead", dead, 0, n_slaves)
    polls = tuple(Poll(one, line, processing, timeout, retries) for one in _requests(3, 0, count))
    rows = [Polled(polls, False, n_slaves - silent), Polled(polls, True, silent, unit=("", 1))]
    return Scan(tuple(row for row in rows if row.number), limit)
