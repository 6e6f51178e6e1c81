"""How long it takes to poll slaves on a serial line: transactions, time-outs, scans.

Simulated time only: what a library does on a real port comes on top.
"""

from __future__ import annotations

from dataclasses import field
from math import floor

from shipnet.answers import Utilisation
from shipnet.fields import check_kind, check_scalar, check_whole, number, record, whole
from shipnet.modbus.frame import MAX_UNIT, RTU_BYTES
from shipnet.modbus.pdu import Request
from shipnet.modbus.uart import SerialLine


@record(slots=True)
class Poll:
    r"""One request that a master sends to each of its slaves in turn.

    .. math:: T = t_{request} + t_{3.5} + t_{processing} + t_{response} + t_{3.5}

    Notes
    -----
    After a time-out the next request follows at once, because the line has been silent. The
    response time-out of the guide is "typically 1 s to several seconds at 9600 bit/s" [1]_.

    References
    ----------
    .. [1] "MODBUS over serial line specification and implementation guide", V1.02, 2006,
       section 2.4.1.

    Examples
    --------
    Four input registers of each of 247 slaves at 9600 bit/s; then one of them is dead:

    >>> poll = Poll(Request.read_input_registers(0, 4), SerialLine(9600))
    >>> round(poll.time * 1e3, 2), round(poll.scan_time(247), 2)
    (32.08, 7.92)
    >>> round(poll.scan_time(247, dead=1), 2), poll.max_slaves(2.0)
    (8.9, 62)
    """

    request: Request
    line: SerialLine
    processing: float = number(
        0, 3600, "s",
        "How long the slave, and the master after it, work on top of the silences", default=0.0,
    )  # fmt: skip
    timeout: float = number(
        0, 3600, "s", "Response time-out: how long the master waits, from the end of its request, "
        "for the whole response; it must not be shorter than a response takes", default=1.0,
    )  # fmt: skip
    retries: int = whole(
        0, 100, help="How many more times the master asks a slave that does not answer", default=0
    )
    #: Length of both frames, unit id and CRC included [byte].
    request_size: int = field(init=False, repr=False, compare=False)
    response_size: int = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        check_kind("request", self.request, Request)
        check_kind("line", self.line, SerialLine)
        object.__setattr__(self, "request_size", len(self.request.pdu) + RTU_BYTES)
        object.__setattr__(self, "response_size", self.request.response_size + RTU_BYTES)
        check_scalar("timeout", self.timeout, "s", self.shortest_timeout, 3600)

    @property
    def shortest_timeout(self) -> float:
        """From the end of the request to the end of the response [s]."""
        return self.line.t35 + self.processing + self.line.frame_time(self.response_size)

    @property
    def on_wire(self) -> float:
        """Request and response without the silence around them [s]."""
        return self.line.frame_time(self.request_size) + self.line.frame_time(self.response_size)

    @property
    def time(self) -> float:
        """A transaction, from one request to the next [s]."""
        return self.line.frame_time(self.request_size) + self.shortest_timeout + self.line.t35

    @property
    def unanswered_time(self) -> float:
        """An unanswered try, from one request to the next [s]."""
        return self.line.frame_time(self.request_size) + self.timeout

    @property
    def timeout_time(self) -> float:
        """What a dead slave costs, all retries included [s]."""
        return (1 + self.retries) * self.unanswered_time

    def scan_time(self, n_slaves: int, *, dead: int = 0) -> float:
        """Return how long it takes to poll 1..247 slaves once, of which some are dead [s]."""
        slaves = check_whole("n_slaves", n_slaves, 1, MAX_UNIT)
        silent = check_whole("dead", dead, 0, slaves)
        return (slaves - silent) * self.time + silent * self.timeout_time

    def utilisation(self, n_slaves: int, update: float, *, dead: int = 0) -> Utilisation:
        """Return how far the line is used, where each slave's points need an `update` [s]."""
        check_scalar("update", update, "s", 1e-6, 1e6)
        scan = self.scan_time(n_slaves, dead=dead)
        tries = dead * (1 + self.retries)
        busy = (n_slaves - dead) * self.on_wire + tries * self.line.frame_time(self.request_size)
        capacity = max(n_slaves / MAX_UNIT, scan / update)
        return Utilisation(busy / scan, capacity, scan + self.time)

    def max_slaves(self, period: float, *, dead: int = 0) -> int:
        """Return how many slaves a scan within a period [s] can have, the dead ones included.

        It is 0 if the dead ones alone take longer, and never more than 247.
        """
        longest = check_scalar("period", period, "s", 0, 1e6)
        silent = check_whole("dead", dead, 0, MAX_UNIT)
        # A period that is a whole number of transactions may miss it by a rounding.
        alive = floor((longest - silent * self.timeout_time) / self.time * (1 + 1e-12) + 1e-12)
        return min(silent + alive, MAX_UNIT) if alive >= 0 else 0


def scan_time(
    n_slaves: int,
    *,
    registers: int,
    bit_rate: float = 9600,
    character: str = "8E1",
    processing: float = 0.0,
    dead: int = 0,
    timeout: float = 1.0,
    retries: int = 0,
) -> float:
    """Return how long a master takes to read holding registers of all its slaves once.

    Parameters
    ----------
    n_slaves : int
        Number of slaves, 1..247.
    registers : int
        How many registers the master reads from each, 1..65536; a request reads 125 at most, so
        more take several requests, one after the other.
    bit_rate : float, default 9600
        50..10e6 [bit/s].
    character : str, default "8E1"
        Data bits, parity and stop bits.
    processing : float, default 0
        How long a slave works on its answer, 0..3600 [s].
    dead : int, default 0
        How many of the slaves do not answer, 0..n_slaves.
    timeout : float, default 1
        Response time-out, not shorter than a response takes, up to 3600 [s].
    retries : int, default 0
        How many more times the master asks a slave that does not answer, 0..100.

    Returns
    -------
    float
        Time of a scan [s].

    Raises
    ------
    ArgumentError
        If an argument is out of its range.

    Examples
    --------
    >>> round(scan_time(31, registers=4, bit_rate=9600), 3)
    0.995
    >>> round(scan_time(24, registers=10, dead=2, timeout=0.5, retries=1), 3)
    3.045
    >>> round(scan_time(24, registers=300, bit_rate=38400), 3)
    4.645
    """
    count = check_whole("registers", registers, 1, 1 << 16)
    line, most, time = SerialLine(bit_rate, character), 125, 0.0
    for begin in range(0, count, most):
        request = Request.read_holding_registers(begin, min(most, count - begin))
        poll = Poll(request, line, processing=processing, timeout=timeout, retries=retries)
        time += poll.scan_time(n_slaves, dead=dead)
    return time
