"""The time to poll slaves on a serial line: transactions, time-outs and scans."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from math import floor

import numpy as np

from shipnet import style
from shipnet.answers import Utilisation
from shipnet.errors import ArgumentError
from shipnet.fields import check_fields, check_scalar, check_whole, number, part, record, whole
from shipnet.html import as_html
from shipnet.lazy import Axes, pd
from shipnet.modbus.frame import MAX_UNIT, RTU_BYTES
from shipnet.modbus.pdu import Request
from shipnet.modbus.uart import SerialLine

BIT_RATES = (1200, 2400, 4800, 9600, 19200, 38400, 57600, 115200)  #: Common bit rates [bit/s].


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


@dataclass(frozen=True, eq=False, repr=False)
class Scan:
    """One scan, in which a master polls all its slaves once, as returned by `scan`.

    The master sends the requests of `polls` to each of `n_slaves` slaves, of which `dead` do not
    answer. `limit` is the longest time allowed [s], or None.

    Examples
    --------
    >>> from shipnet import modbus
    >>> found = modbus.scan(24, registers=20, bit_rate=19200, dead=2, limit=3.0)
    >>> found
    Scan(24 slaves, 2 dead: 2.765 s at a processing time of 0 ms, limit of 3 s met up to 10.6 ms)
    >>> round(found.dead_time, 3), round(found.slave_time, 3), found.max_slaves
    (1.005, 0.034, 30)
    """

    polls: tuple[Poll, ...]
    n_slaves: int
    dead: int
    limit: float | None

    @property
    def bit_rate(self) -> float:
        """Bit rate of the line [bit/s]."""
        return self.polls[0].line.bit_rate

    @property
    def time(self) -> float:
        """Time of the scan [s]."""
        return sum(poll.scan_time(self.n_slaves, dead=self.dead) for poll in self.polls)

    @property
    def slave_time(self) -> float:
        """Time per slave that answers [s]."""
        return sum(poll.time for poll in self.polls)

    @property
    def dead_time(self) -> float:
        """Time per dead slave, including time-outs and retries [s]."""
        return sum(poll.timeout_time for poll in self.polls)

    @property
    def bus_time(self) -> float:
        """Fraction of the scan time during which bytes are on the line, 0..1."""
        return sum(poll._busy_time(self.n_slaves, self.dead) for poll in self.polls) / self.time

    @property
    def max_slaves(self) -> int | None:
        """Largest number of slaves, including dead ones, that meets the limit; None without one."""
        return None if self.limit is None else _most(self.polls, self.limit, self.dead)

    @property
    def ok(self) -> bool | None:
        """Whether the limit is met; None without a limit."""
        return None if self.limit is None else self.time <= self.limit

    @property
    def max_processing(self) -> float | None:
        """Longest processing time per response that meets time-out and limit [s]; None if none."""
        answers = (self.n_slaves - self.dead) * len(self.polls)
        if self.limit is None or not self.ok or not answers:
            return None
        margin = min(poll.timeout - poll.shortest_timeout for poll in self.polls)
        return self.polls[0].processing + min((self.limit - self.time) / answers, margin)

    @property
    def verdict(self) -> str:
        """The result in one line."""
        dead = f", {self.dead} dead" if self.dead else ""
        processing = f"at a processing time of {1e3 * self.polls[0].processing:g} ms"
        scanned = f"{self.n_slaves} slaves{dead}: {self.time:.3f} s {processing}"
        if self.limit is None:
            return scanned
        most = self.max_processing
        # Rounded down, so that the limit is met at the stated time.
        up_to = "" if most is None else f" up to {floor(1e4 * most) / 10:g} ms"
        return f"{scanned}, limit of {self.limit:g} s {'met' if self.ok else 'exceeded'}{up_to}"

    def table(self) -> pd.DataFrame:
        """Return one row per bit rate (common ones and the scan's own), indexed by ``bit_rate``.

        Columns: ``scan_s``, ``slave_ms``, ``dead_slave_ms``, ``bus_time_percent``, and with a limit
        ``max_slaves`` and ``met``. Bit rates at which a response exceeds the time-out are omitted.
        """
        rows = {}
        for rate in sorted({*BIT_RATES, self.bit_rate}):
            with suppress(ArgumentError):
                line = replace(self.polls[0].line, bit_rate=rate)
                polls = tuple(replace(poll, line=line) for poll in self.polls)
                one = replace(self, polls=polls)
                times = (one.time, 1e3 * one.slave_time, 1e3 * one.dead_time, 100 * one.bus_time)
                rows[rate] = (*times, one.max_slaves, one.ok)
        columns = ["scan_s", "slave_ms", "dead_slave_ms", "bus_time_percent", "max_slaves", "met"]
        table = pd.DataFrame.from_dict(rows, orient="index", columns=columns)
        return table.rename_axis("bit_rate").dropna(axis="columns")

    @style.applied
    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the scan time over the bit rate, with the limit."""
        ax, times = style.axes(ax), self.table()["scan_s"]
        ax.plot(times.index, times, "o-", color="C0", mfc="white", label="other bit rates")
        ax.plot(self.bit_rate, self.time, "o", color="C0", ms=9, label="chosen")
        if self.limit is not None:
            colour, dashes = style.LIMIT["color"], style.LIMIT["linestyle"]
            ax.axhline(self.limit, color=colour, linestyle=dashes, label=f"limit, {self.limit:g} s")
        ax.set(xscale="log", xlabel="bit rate [bit/s]", ylabel="scan time [s]")
        style.logarithmic(ax.yaxis)
        # A bit rate close to the one before, such as 57600, has no room for its name.
        close = times.index.to_series().pct_change() < 0.6
        names = ["" if near else f"{rate:g}" for rate, near in close.items()]
        ax.set_xticks(times.index, names)
        ax.set_xticks([], minor=True)
        ax.set_xlim(0.85 * times.index[0], 1.2 * times.index[-1])
        ax.legend(loc="upper right")
        return ax

    def __repr__(self) -> str:
        return f"Scan({self.verdict})"

    def _repr_html_(self) -> str:
        table = self.table()
        if self.limit is not None:
            table = table.assign(limit_s=self.limit, margin_s=self.limit - table["scan_s"])
        nearest = np.argsort(abs(np.log(table.index / self.bit_rate)), kind="stable")
        return as_html(self, table.iloc[nearest])


def scan(
    n_slaves: int,
    *,
    registers: int,
    bit_rate: float = 9600,
    character: str = "8E1",
    processing: float = 0.0,
    dead: int = 0,
    timeout: float = 1.0,
    retries: int = 0,
    limit: float | None = None,
) -> Scan:
    """Compute how long a master takes to read holding registers from all its slaves once.

    Parameters
    ----------
    n_slaves : int
        Number of slaves, 1..247.
    registers : int
        Registers per slave, 1..65536; each request reads at most 125.
    bit_rate : float, default 9600
        300..10e6 [bit/s].
    character : str, default "8E1"
        Data bits, parity and stop bits.
    processing : float, default 0
        Time that a slave takes to prepare each response, 0..3600 [s]; 0 is optimistic. The answer
        names it, and the longest one that meets the limit.
    dead : int, default 0
        Number of slaves that do not answer, 0..n_slaves.
    timeout : float, default 1
        Response time-out, at most 3600 [s] and not shorter than a response takes.
    retries : int, default 0
        Number of retries if a slave does not answer, 0..100.
    limit : float, optional
        Longest time allowed for the scan, 0..1e6 [s].

    Returns
    -------
    Scan
        The scan: its `time` and parts, whether the limit is met, and times at other bit rates.

    Examples
    --------
    >>> scan(31, registers=4, bit_rate=9600)
    Scan(31 slaves: 0.995 s at a processing time of 0 ms)
    >>> round(scan(24, registers=300, bit_rate=38400).time, 3)
    4.645
    """
    count = check_whole("registers", registers, 1, 1 << 16)
    slaves = check_whole("n_slaves", n_slaves, 1, MAX_UNIT)
    silent = check_whole("dead", dead, 0, slaves)
    if limit is not None:
        check_scalar("limit", limit, "s", 0, 1e6)
    line, most, polls = SerialLine(bit_rate, character), 125, []
    for begin in range(0, count, most):
        request = Request.read_holding_registers(begin, min(most, count - begin))
        polls.append(Poll(request, line, processing, timeout, retries))
    return Scan(tuple(polls), slaves, silent, limit)
