"""Durations of transactions and cycles, and response times.

A transaction is a request, the master pause, a response and the slave pause; one bit takes 6 us.
In every cycle the master polls each address once, then sends one management request and looks for
one new slave. An A and a B slave that share an address take turns: each is polled every second
cycle.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import KW_ONLY
from functools import cache, lru_cache
from typing import Any, Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from shipnet import datasets, style
from shipnet.arrays import Floats
from shipnet.asi.profile import Profile
from shipnet.asi.telegram import REQUEST_BITS, RESPONSE_BITS, Request, Response, plot_telegram
from shipnet.errors import ArgumentError
from shipnet.fields import (
    check_choice,
    check_fields,
    check_scalar,
    check_whole,
    number,
    part,
    record,
    whole,
)
from shipnet.lazy import Axes

#: Length of one bit on the line [s], from icn2007 section 5 and OMRON manual W357, p. 5.
BIT_TIME = 6e-6

#: Shortest and longest legal pause between request and response [bit].
MASTER_PAUSE_BITS = (2.0, 10.0)

#: Longest pause before a master's next request [s], from OMRON manual W357, p. 5.
LONGEST_SLAVE_PAUSE = 500e-6

#: User bits of one exchange in each direction.
USER_BITS = 4


@record(slots=True)
class Transaction:
    """One request with its response and both pauses.

    Notes
    -----
    Published durations are 150 us (25 bit times), 153, 154 and 156 us (26 bit times, the default);
    they differ in the pauses. A synchronous slave responds after 2 to 3 bit times, any other
    slave 2 bit times later [2]_. The pause after a response is normally 1.5 to 2 bit times long.

    References
    ----------
    .. [1] OMRON, "CQM1-ARM21", manual W357, 1999, p. 5.
    .. [2] "AS-Interface communication system for field networks (2)", ICN, July 2007,
       data link layer, section 2.

    Examples
    --------
    From [1]_, 156 us per transaction:

    >>> round(Transaction().duration * 1e6)
    156
    """

    master_pause: float = number(
        *MASTER_PAUSE_BITS, "bit times", "Pause after the request", default=3.0
    )
    slave_pause: float = number(0, 1e9, "bit times", "Pause after the response", default=2.0)
    bit_time: float = number(1e-12, 1e3, "s", "Length of a bit", default=BIT_TIME)
    _: KW_ONLY
    unsynchronised: float = number(
        0, 10, "bit times", "Additional delay of a slave that is not synchronised", default=2.0
    )
    timeout: float = number(
        2, 24, "bit times", "How long the master waits for a response to begin", default=10.0
    )

    @property
    def bits(self) -> float:
        """Time from one request to the next [bit]."""
        return REQUEST_BITS + self.master_pause + RESPONSE_BITS + self.slave_pause

    @property
    def duration(self) -> float:
        """Time from one request to the next [s]."""
        return self.bits * self.bit_time

    @property
    def unanswered(self) -> float:
        """Time from an unanswered request to the next request [bit]."""
        return REQUEST_BITS + self.timeout

    @property
    def longest(self) -> float:
        """Time from one request to the next [s] if the slave is silent or not synchronised."""
        return max(self.bits + self.unsynchronised, self.unanswered) * self.bit_time

    def check_line(self) -> None:
        """Raise ArgumentError unless the slave pause is 1 bit time to 500 us."""
        longest = LONGEST_SLAVE_PAUSE / self.bit_time
        if not 1 <= self.slave_pause <= longest:
            raise ArgumentError(
                f"slave_pause is {self.slave_pause:g} bit times; it must be 1..{longest:.4g}"
            )

    @property
    def net_rate(self) -> float:
        """User bits of one exchange, four in each direction, divided by its duration [bit/s]."""
        return 2 * USER_BITS / self.duration

    def efficiency(self, user_bits: npt.ArrayLike = USER_BITS) -> Floats:
        """Return the fraction of time spent on user data: `user_bits` in each direction."""
        n = np.asarray(user_bits)
        if n.dtype.kind not in "iu" or not (n >= 1).all():
            raise ArgumentError(f"user_bits is {user_bits!r}; it must be a whole number, 1 or more")
        return np.asarray(2 * n / (self.bits * -(-n // USER_BITS)))

    @style.applied
    def plot(
        self, request: Request | str, response: Response | str, ax: Axes | None = None
    ) -> Axes:
        """Draw a request, both pauses and a response on one time axis: kim2023's Fig 5.

        Telegrams may also be strings of bits, valid or not.
        """
        ax = style.axes(ax, figsize=(8, 2.6))
        arrow = {"arrowstyle": "<->", "color": "0.3", "shrinkA": 0, "shrinkB": 0}
        pause = {"facecolor": style.FIELD["pause"], "edgecolor": "0.3", "linestyle": ":"}
        start = 0.0
        for name, length, telegram in [
            ("request", REQUEST_BITS, request),
            ("master pause", self.master_pause, None),
            ("response", RESPONSE_BITS, response),
            ("slave pause", self.slave_pause, None),
        ]:
            if telegram is None:
                style.box(ax, start, 0, length, 1, **pause)
            else:
                bits = telegram if isinstance(telegram, str) else telegram.bits
                plot_telegram(bits, ax, start=start)
            end = start + length
            ax.annotate("", (start, 2.35), (end, 2.35), arrowprops=arrow)
            label = f"{name}\n{length:g} bit"
            ax.text((start + end) / 2, 2.5, label, ha="center", va="bottom")
            start = end
        ax.set(xlim=(-0.5, self.bits + 0.5), ylim=(-0.75, 3.6), yticks=[], xlabel="time [bit]")
        ax.grid(visible=False)
        ax.spines["left"].set_visible(False)
        bit_us = self.bit_time * 1e6
        top = ax.secondary_xaxis(
            "top",
            functions=(lambda bits: np.multiply(bits, bit_us), lambda us: np.divide(us, bit_us)),
        )
        top.set_xlabel("time [µs]")
        return ax


#: Number of slave addresses: five bits without address 0.
ADDRESSES = 31

#: Maximum number of channels of a slave for analogue values.
CHANNELS = 4

#: Longest conversion time of an analogue value [s]; manufacturers state 20 to 60 ms.
CONVERSION = 60e-3

Direction = Literal["in", "out"]


class ResponseTime(NamedTuple):
    """Time until the master receives a changed input, or the slave receives a changed output [s].

    `typical` is the mean over changes at random times, on a line without disturbances.
    """

    best: float
    typical: float
    worst: float


@record
class Cycle:
    r"""The cycle of a master that polls all slaves of a line.

    .. math:: T_c = (n - n_{pairs} + 1 + i) \, T

    Here T is the duration of a transaction, and the 1 is the request of the management phase.
    Repeaters add twice the `delays` of each polled slave, and twice the longest delay for the
    management request.

    Notes
    -----
    OMRON [1]_ adds two requests for any number of slaves. Schneider adds only one for 31 slaves
    [2]_, because no address is left for a new slave: ``inclusion=0``. The specification's "5 ms
    for 31 slaves" needs transactions of 25 bit times; 26 bit times give 5.148 ms.

    References
    ----------
    .. [1] OMRON, "CQM1-ARM21", manual W357, 1999, p. 5.
    .. [2] Schneider Electric, AS-i help D-SA-0011791.

    Examples
    --------
    From [1]_ and [2]_, 31 slaves:

    >>> round(Cycle(31).time * 1e6), round(Cycle(31, inclusion=0).time * 1e6)
    (5148, 4992)

    62 slaves take the same time, but each is polled every other cycle:

    >>> Cycle(62).time == Cycle(31).time, f"{Cycle(62).update_time() * 1e3:.3f} ms"
    (True, '10.296 ms')
    """

    slaves: int = whole(0, 2 * ADDRESSES, help="Number of slaves n", default=ADDRESSES)
    _: KW_ONLY
    pairs: int | None = whole(
        0,
        ADDRESSES,
        "",
        "Addresses that two slaves share; by default the minimum",
        default=None,
        optional=True,
    )
    transaction: Transaction = part(Transaction, "One exchange", default=Transaction())
    inclusion: int = whole(0, 1, "", "Number i of requests per cycle to find slaves", default=1)
    delays: tuple[tuple[float, ...], ...] = part(
        tuple, "One-way delays of the repeaters before the slaves [s], by address", default=()
    )

    def __post_init__(self) -> None:
        check_fields(self)
        least = max(self.slaves - ADDRESSES, 0)
        pairs = least if self.pairs is None else self.pairs
        if pairs < least or 2 * pairs > self.slaves:
            raise ArgumentError(
                f"pairs is {pairs}; for {self.slaves} slaves it must be {least}..{self.slaves // 2}"
            )
        object.__setattr__(self, "pairs", pairs)
        if self.delays and len(self.delays) != self.addresses:
            raise ArgumentError(
                f"delays are for {len(self.delays)} addresses; they must be for {self.addresses}"
            )
        for delay in (delay for group in self.delays for delay in group):
            check_scalar("a delay", delay, "s", 0, 1)

    @property
    def addresses(self) -> int:
        """Number of addresses that are polled in each cycle."""
        return self.slaves - (self.pairs or 0)

    @property
    def time(self) -> float:
        """Longest time in which the master polls every address once [s]."""
        return self._cycles(1)

    def _cycles(self, number: int, *, disturbed: bool = False) -> float:
        """Return the longest duration of `number` cycles, without repetitions [s]."""
        one = self.transaction
        each = one.longest if disturbed else one.duration
        # The search for a new slave; nobody answers it unless a dropped slave returns.
        search = max(one.unanswered * one.bit_time - each, 0.0)
        if disturbed:
            search += 2 * self._farthest
        cycle = (self.addresses + 1 + self.inclusion) * each + self.inclusion * search
        # Two slaves that share an address take turns, so that an odd cycle may poll the slower one.
        mean = sum(sum(group) / len(group) for group in self.delays)
        slower = sum(map(max, self.delays))
        return number * (cycle + 2 * (mean + self._farthest)) + number % 2 * 2 * (slower - mean)

    @property
    def _farthest(self) -> float:
        """Longest delay of the repeaters before a slave [s]."""
        return max(map(max, self.delays), default=0.0)

    @property
    def bus_time(self) -> float:
        """Fraction of time in which a telegram is on the line, if no new slave answers."""
        answered = (self.addresses + 1) * (REQUEST_BITS + RESPONSE_BITS)
        bits = answered + self.inclusion * REQUEST_BITS
        return bits * self.transaction.bit_time / self.time

    def update_time(
        self,
        profile: Profile | str = "S-0.F",
        *,
        channels: int = 1,
        direction: Direction = "in",
        paired: bool | None = None,
    ) -> float:
        """Return the longest time between two updates of a slave's bits or values [s].

        `response_time` describes the arguments.
        """
        return self._cycles(self._polls(profile, channels, direction, paired))

    def _polls(
        self, profile: Profile | str, channels: int, direction: Direction, paired: bool | None
    ) -> int:
        """Return the number of cycles between two updates."""
        count = check_whole("channels", channels, 1, CHANNELS)
        shared = bool(self.pairs) if paired is None else paired
        polls = (2 if shared else 1) * exchanges(profile, direction)
        return polls * (count if transfers_values(profile) else 1)

    def response_time(
        self,
        profile: Profile | str = "S-0.F",
        *,
        channels: int = 1,
        conversion: float = CONVERSION,
        direction: Direction = "in",
        paired: bool | None = None,
        delay: float = 0.0,
        repetitions: int | None = None,
    ) -> ResponseTime:
        """Return the response times to a change of an input, or of an output.

        A slave with digital inputs reads them when the request ends; digital outputs are ready
        then. At best, the change comes just before the slave reads it, or before the request to it
        begins. At worst, it comes just after that and waits for the next request to the slave, one
        cycle later, or two if the slave shares its address (`paired`; by default, if the cycle has
        pairs). The repeaters before the slave add their `delay` in one direction [s].
        `Plan.response_times` adds input filter, gateway and host.

        A slave whose `profile` transfers values converts its `channels` in turn, each in
        `conversion` [s], and sends the newest values in turn. At worst, the change comes just after
        a conversion, and the next value waits for a whole round of transfers. Siemens adds another
        round for synchronisation (SlimLine analogue module, manual).

        Without `repetitions`, all times are those of a line without disturbances. With them, the
        worst case holds for a disturbed line on which the master repeats that many requests while
        the change waits: all slaves may be out of step, and each repetition takes the longest
        transaction. If all tries of a cycle fail, the slave is polled one cycle later still.
        """
        each = check_scalar("conversion", conversion, "s", 0, 1e9)
        check_scalar("delay", delay, "s", 0, 1)
        one, polls = self.transaction, self._polls(profile, channels, direction, paired)

        def bounds(disturbed: bool) -> tuple[float, float]:
            wait = self._cycles(polls, disturbed=disturbed)
            if transfers_values(profile):
                return wait / channels, wait + channels * each
            if direction == "out":
                return REQUEST_BITS * one.bit_time + delay, wait
            pause = one.master_pause + (one.unsynchronised if disturbed else 0.0)
            return (pause + RESPONSE_BITS) * one.bit_time + 2 * delay, wait

        age, wait = bounds(disturbed=False)
        worst = age + wait
        if repetitions is not None:
            count = check_whole("repetitions", repetitions, 0, 10_000)
            worst = sum(bounds(disturbed=True)) + count * (one.longest + 2 * self._farthest)
        return ResponseTime(age, age + wait / 2, worst)


def cycle_time(slaves: int = ADDRESSES, **options: Any) -> float:
    """Return the time in which the master polls every address once: `Cycle.time`.

    Parameters
    ----------
    slaves : int, default 31
        Number of slaves, 0..62.
    **options
        The other arguments of `Cycle`.

    Returns
    -------
    float
        Cycle time [s].

    Examples
    --------
    >>> cycle_time(31)
    0.005148
    """
    return Cycle(slaves, **options).time


def polling_cycle(
    slaves: Iterable[tuple[int, float]], transaction: Transaction | None = None
) -> Cycle:
    """Return the cycle for slaves, each with its address and the delay of its repeaters [s]."""
    delays: dict[int, list[float]] = {}
    for address, delay in slaves:
        if address:
            delays.setdefault(address, []).append(delay)
    groups = tuple(map(tuple, delays.values()))
    pairs, delayed = sum(len(group) > 1 for group in groups), any(map(any, groups))
    options: dict[str, Any] = {"pairs": pairs, "delays": groups if delayed else ()}
    return Cycle(len(groups) + pairs, transaction=transaction or Transaction(), **options)


# An exchange transfers four bits, so an analogue value is sent in pieces; each type of transfer
# (CTT) divides the value differently. No manufacturer states how many exchanges CTT4 takes.


@cache
def _analogue_profiles() -> dict[tuple[str, str], dict[int, int]]:
    """Return the number of exchanges by profile, direction and value size [bit]; 0 if unknown."""
    profiles: dict[tuple[str, str], dict[int, int]] = {}
    for row in datasets.read("asi_analogue_profiles.csv").to_dict("records"):
        sizes = profiles.setdefault((row["profile"], row["direction"]), {})
        sizes[int(row["value_bit"])] = int(row["cycles"] or 0)
    return profiles


@lru_cache(maxsize=256)
def _sizes(profile: Profile | str, direction: str) -> dict[int, int]:
    """Return the number of exchanges by value size [bit]; S-7.3.C also has the sizes of S-7.3."""
    profile = Profile.parse(profile)
    general, whole = f"S-{profile.io:X}.{profile.id:X}", str(profile)
    profiles = _analogue_profiles()
    return profiles.get((general, direction), {}) | profiles.get((whole, direction), {})


@lru_cache(maxsize=256)
def transfers_values(profile: Profile | str) -> bool:
    """Return True if a profile transfers values of more than four bits."""
    return max((*_sizes(profile, "in"), *_sizes(profile, "out")), default=0) > USER_BITS


def exchanges(profile: Profile | str, direction: Direction = "in") -> int:
    """Return the number of exchanges for a slave's largest value; single bits need one."""
    sizes = _sizes(profile, check_choice("direction", direction, ("in", "out")))
    if not sizes and not transfers_values(profile):
        return 1
    if not sizes or not sizes[max(sizes)]:
        raise ArgumentError(
            f"profile is '{profile}'; its number of exchanges per '{direction}' value is unknown"
        )
    return sizes[max(sizes)]
