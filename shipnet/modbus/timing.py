"""How long Modbus takes on a serial line: characters, silences, transactions, scans.

Simulated time only: what a library does on a real port comes on top.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import floor
from re import fullmatch

from shipnet.errors import ArgumentError
from shipnet.fields import check_scalar, check_whole
from shipnet.modbus.frame import LAST_UNIT
from shipnet.modbus.request import Request

__all__ = ["FIXED_T15", "FIXED_T35", "SILENCE_LIMIT", "Poll", "Serial", "broadcast_time"]

#: Highest bit rate at which the silences are counted in characters [bit/s], and what they are
#: above it [s]; "MODBUS over serial line" V1.02, section 2.5.1.1.
SILENCE_LIMIT, FIXED_T15, FIXED_T35 = 19200, 750e-6, 1.75e-3

#: What an RTU frame adds to its PDU [byte], and the shortest and longest frame.
_OVERHEAD, _SHORTEST, _LONGEST = 3, 4, 256


@dataclass(frozen=True, slots=True)
class Serial:
    """Settings of an RTU line.

    Parameters
    ----------
    bit_rate : float
        50..10e6 [bit/s].
    character : str, default "8E1"
        Data bits (8 in RTU), parity (N, E or O) and stop bits (1 or 2). The standard asks for
        8E1 as default, and for 8N2 without parity; 8N1 is common nevertheless.

    Raises
    ------
    ArgumentError
        If the bit rate is out of range, or there is no such character.

    References
    ----------
    .. [1] "MODBUS over serial line specification and implementation guide", V1.02, 2006,
       section 2.5.1.

    Examples
    --------
    >>> line = Serial(9600)
    >>> line.character_bits, round(line.t35 * 1e3, 2), round(line.frame_time(8) * 1e3, 2)
    (11, 4.01, 9.17)
    """

    bit_rate: float
    character: str = "8E1"

    def __post_init__(self) -> None:
        """Check both."""
        rate = check_scalar("bit_rate", self.bit_rate, "bit/s", 50, 10e6)
        if not isinstance(self.character, str) or not fullmatch("8[NEO][12]", self.character):
            raise ArgumentError(
                f"character is {self.character!r}; it must be 8, one of N, E, O, and 1 or 2"
            )
        object.__setattr__(self, "bit_rate", rate)

    @property
    def character_bits(self) -> int:
        """Bits on the line for a byte: start, 8 data, parity if any, stop."""
        return 9 + (self.character[1] != "N") + int(self.character[2])

    @property
    def character_time(self) -> float:
        """How long a byte takes [s]."""
        return self.character_bits / self.bit_rate

    @property
    def t15(self) -> float:
        """Longest silence within a frame [s]."""
        return FIXED_T15 if self.bit_rate > SILENCE_LIMIT else 1.5 * self.character_time

    @property
    def t35(self) -> float:
        """Shortest silence between two frames [s]."""
        return FIXED_T35 if self.bit_rate > SILENCE_LIMIT else 3.5 * self.character_time

    def frame_time(self, size: int) -> float:
        """Return how long a frame takes whose bytes follow each other at once [s].

        Parameters
        ----------
        size : int
            Length of the frame, unit id and CRC included, 4..256 [byte].
        """
        return check_whole("size", size, _SHORTEST, _LONGEST) * self.character_time


@dataclass(frozen=True, slots=True)
class Poll:
    r"""One request that a master sends to each of its slaves in turn.

    .. math:: T = t_{request} + t_{3.5} + t_{processing} + t_{response} + t_{3.5}

    Parameters
    ----------
    serial : Serial
        Settings of the line.
    request_size, response_size : int
        Length of both frames, unit id and CRC included, 4..256 [byte]; an exception response has
        5. `of` takes them from a request.
    processing : float, default 0
        How long the slave, and the master after it, work on top of the silences, 0..3600 [s].
    timeout : float, default 1
        Response timeout [s]: how long the master waits, from the end of its request, for the
        whole response. It must not be shorter than a response takes, nor longer than 3600.
    retries : int, default 0
        How many more times the master asks a slave that does not answer, 0..100.

    Raises
    ------
    ArgumentError
        If a field is out of its range.

    Notes
    -----
    After a timeout the next request follows at once, for the line has been silent. The response
    timeout of the guide is "typically 1 s to several seconds at 9600 bit/s" [1]_.

    References
    ----------
    .. [1] "MODBUS over serial line specification and implementation guide", V1.02, 2006,
       section 2.4.1.

    Examples
    --------
    Four input registers of each of 247 slaves at 9600 bit/s; then one of them is dead:

    >>> poll = Poll(Serial(9600), 8, 13)
    >>> round(poll.answered * 1e3, 2), round(poll.scan(247), 2), round(poll.scan(247, dead=1), 2)
    (32.08, 7.92, 8.9)
    """

    serial: Serial
    request_size: int
    response_size: int
    processing: float = 0.0
    timeout: float = 1.0
    retries: int = 0

    def __post_init__(self) -> None:
        """Check every field."""
        if not isinstance(self.serial, Serial):
            raise ArgumentError(f"serial is {self.serial!r}; it must be a Serial")
        for name in ("request_size", "response_size"):
            size = check_whole(name, getattr(self, name), _SHORTEST, _LONGEST)
            object.__setattr__(self, name, size)
        processing = check_scalar("processing", self.processing, "s", 0, 3600)
        object.__setattr__(self, "processing", processing)
        object.__setattr__(self, "retries", check_whole("retries", self.retries, 0, 100))
        timeout = check_scalar("timeout", self.timeout, "s", self.shortest_timeout, 3600)
        object.__setattr__(self, "timeout", timeout)

    @classmethod
    def of(
        cls,
        request: Request,
        serial: Serial,
        *,
        processing: float = 0.0,
        timeout: float = 1.0,
        retries: int = 0,
    ) -> Poll:
        """Return the poll that sends a request and gets its normal response.

        Parameters
        ----------
        request : Request
            What is asked.
        serial : Serial
            Settings of the line.
        processing, timeout, retries
            As above.
        """
        if not isinstance(request, Request):
            raise ArgumentError(f"request is {request!r}; it must be a request")
        sizes = (len(request.pdu) + _OVERHEAD, request.response_size + _OVERHEAD)
        return cls(serial, *sizes, processing, timeout, retries)

    @property
    def shortest_timeout(self) -> float:
        """From the end of the request to the end of the response [s]."""
        return self.serial.t35 + self.processing + self.serial.frame_time(self.response_size)

    @property
    def answered(self) -> float:
        """A transaction, from one request to the next [s]."""
        return self.serial.frame_time(self.request_size) + self.shortest_timeout + self.serial.t35

    @property
    def unanswered(self) -> float:
        """One try that nobody answers, from one request to the next [s]."""
        return self.serial.frame_time(self.request_size) + self.timeout

    @property
    def given_up(self) -> float:
        """What a dead slave costs, all retries included [s]."""
        return (1 + self.retries) * self.unanswered

    def expected(self, failure: float) -> float:
        r"""Return the mean time of a poll whose tries fail at random [s].

        .. math:: E = \left( 1 - p^{r+1} \right) T_{answered} + T_{unanswered} \sum_{k=1}^{r+1} p^k

        Parameters
        ----------
        failure : float
            Probability p that a try fails, by a lost request or response, 0..1.
        """
        p = check_scalar("failure", failure, "", 0, 1)
        failed = sum(p**k for k in range(1, self.retries + 2))
        return (1 - p ** (self.retries + 1)) * self.answered + failed * self.unanswered

    def scan(self, n_slaves: int, *, dead: int = 0) -> float:
        """Return how long it takes to poll all slaves once [s].

        Parameters
        ----------
        n_slaves : int
            Number of slaves, 1..247.
        dead : int, default 0
            How many of them do not answer, 0..n_slaves.
        """
        slaves = check_whole("n_slaves", n_slaves, 1, LAST_UNIT)
        silent = check_whole("dead", dead, 0, slaves)
        return (slaves - silent) * self.answered + silent * self.given_up

    def most_slaves(self, period: float, *, dead: int = 0) -> int:
        """Return how many slaves a scan within a period can have, 0..247.

        Parameters
        ----------
        period : float
            Longest scan, 0..1e6 [s].
        dead : int, default 0
            How many of them do not answer, 0..247. The result is 0 if these alone take longer.
        """
        longest = check_scalar("period", period, "s", 0, 1e6)
        silent = check_whole("dead", dead, 0, LAST_UNIT)
        # A period that is a whole number of transactions may miss it by a rounding.
        alive = floor((longest - silent * self.given_up) / self.answered * (1 + 1e-12) + 1e-12)
        return min(silent + alive, LAST_UNIT) if alive >= 0 else 0

    def budget(self, n_slaves: int, period: float) -> float:
        """Return how long each slave may work on a request [s].

        Parameters
        ----------
        n_slaves : int
            Number of slaves, all alive, 1..247.
        period : float
            Longest scan [s]; not shorter than a scan of slaves that answer without delay.

        Raises
        ------
        ArgumentError
            If the period is shorter than the line alone takes.
        """
        slaves = check_whole("n_slaves", n_slaves, 1, LAST_UNIT)
        line = self.answered - self.processing
        longest = check_scalar("period", period, "s", 0, 1e6)
        if longest < slaves * line * (1 - 1e-12):
            raise ArgumentError(
                f"period is {longest:g} s; {slaves} slaves take {slaves * line:g} s on the line"
            )
        return max(longest / slaves - line, 0.0)


def broadcast_time(serial: Serial, request_size: int, *, turnaround: float = 0.1) -> float:
    """Return how long a broadcast takes, up to the next request.

    Parameters
    ----------
    serial : Serial
        Settings of the line.
    request_size : int
        Length of the frame, unit id and CRC included, 4..256 [byte].
    turnaround : float, default 0.1
        Turnaround delay in which all slaves carry it out, t3.5 or longer, up to 3600 [s]. The guide
        names 100 to 200 ms [1]_.

    Returns
    -------
    float
        Time from the first bit to the next request [s].

    Raises
    ------
    ArgumentError
        If an argument is out of its range.

    References
    ----------
    .. [1] "MODBUS over serial line specification and implementation guide", V1.02, 2006,
       section 2.4.1.

    Examples
    --------
    >>> round(broadcast_time(Serial(9600), 8) * 1e3, 2)
    109.17
    """
    delay = check_scalar("turnaround", turnaround, "s", serial.t35, 3600)
    return serial.frame_time(request_size) + delay
