"""The design of the link: its stations and values, its supervision, and its times.

The names of stations and values are those of chung1998, sections 2 and 5. The numbers are our
assumption, and the list may be incomplete, because the text that we have lacks the drawing of Fig.
1. Times apply to a link without bit errors, in which every packet contains all items.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from math import ceil, floor, inf
from typing import Literal, NamedTuple

import numpy as np

from shipnet.errors import ArgumentError
from shipnet.fields import check_fields, check_whole, number, part, record, switch, whole
from shipnet.lazy import Axes, pd
from shipnet.remote_control.faults import HOPS, Hop
from shipnet.remote_control.packet import MarkerFormat
from shipnet.remote_control.packet_format import PacketFormat

#: Bit rates tested in section 5 of chung1998 [bit/s].
BIT_RATES = (9600, 4800, 2400, 1200, 600)


# Values ----------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Value:
    """A 16-bit value that crosses the link, with the stations that set it and that read it.

    `where` is the section of chung1998 that names the value; the number is our assumption.
    """

    number: int
    name: str
    kind: Literal["switch", "command", "measurement", "state"]
    sources: tuple[str, ...]
    readers: tuple[str, ...]
    where: str

    @property
    def mirrored(self) -> bool:
        """True if two stations have the same switch."""
        return len(self.sources) > 1

    @property
    def hops(self) -> tuple[Hop, ...]:
        """The hops (sender, receiver) on which the value is sent, in the order of a cycle."""
        # BCS and SS have no line between them: values from one to the other go through RCS.
        to_rcs = [(source, "RCS") for source in self.sources]
        users = [user for user in self.sources + self.readers if self.sources != (user,)]
        return tuple(hop for hop in HOPS if hop in to_rcs or hop in [("RCS", u) for u in users])


#: Switches come first, so that even a link with few items includes them.
VALUES = (
    Value(0, "control_position", "switch", ("BCS", "RCS"), (), "2; 5"),
    Value(1, "shutdown_cancel", "switch", ("BCS", "SS"), ("RCS",), "5"),
    Value(2, "slowdown_cancel", "switch", ("BCS", "SS"), ("RCS",), "5"),
    Value(3, "speed_command", "command", ("BCS",), ("RCS",), "2"),
    Value(4, "speed", "measurement", ("RCS",), ("BCS", "SS"), "2"),
    Value(5, "engine_state", "state", ("RCS",), ("BCS", "SS"), "2"),
    Value(6, "alarm", "state", ("RCS",), ("BCS", "SS"), "2"),
    Value(7, "safety_speed", "measurement", ("SS",), ("RCS", "BCS"), "2"),
    Value(8, "overspeed", "state", ("SS",), ("RCS", "BCS"), "2"),
    # Shutdown and slowdown share one 16-bit value, because the paper sends ten values.
    Value(9, "shutdown_slowdown", "state", ("SS",), ("RCS", "BCS"), "2"),
)


def values_on(source: str, target: str) -> tuple[Value, ...]:
    """Return the values that one station sends to another, in the order of their numbers."""
    return tuple(value for value in VALUES if (source, target) in value.hops)


def forwarded(source: str, target: str) -> frozenset[int]:
    """Return the numbers of the values that RCS forwards from one slave to the other."""
    values = (value for value in VALUES if source in value.sources)
    return frozenset(value.number for value in values if target in value.sources + value.readers)


# Supervision -----------------------------------------------------------------------------------


@record
class Supervision:
    r"""The rule by which a silent partner is declared failed.

    Every tick adds 1 to ``count``, and any 0xDD clears ``count`` and ``miss``. A ``count`` beyond
    its limit is cleared and adds 1 to ``miss``; a ``miss`` beyond its limit is a failure. With
    limits c and m, the partner is declared failed at tick number

    .. math:: N = (c + 1)(m + 1), \quad \text{or} \quad N = c \, m

    depending on whether "beyond" means exceeding the limit, as printed, or reaching it.

    Notes
    -----
    Section 4 of chung1998 prints "greater than" in both tests, but also a result of 3 seconds,
    which is correct if reaching both limits suffices, as in `intended` (claims chung1998-007 and
    045).

    Examples
    --------
    >>> from shipnet import remote_control as rc
    >>> rules = rc.Supervision(), rc.Supervision.intended()
    >>> [[rule.n_ticks, *(round(time, 3) for time in rule.detection_time)] for rule in rules]
    [[44, 4.3, 4.4], [30, 2.9, 3.0]]
    """

    tick: float = number(1e-3, 10, "s", "Period of the timer", default=0.1)
    count_limit: int = whole(1, 1000, "ticks", "Limit of `count`", default=10)
    miss_limit: int = whole(
        0, 1000, "", "Limit of `miss`, at least 1 if reaching it suffices", default=3
    )
    strict: bool = switch("Whether a limit must be exceeded, not only reached", default=True)

    def __post_init__(self) -> None:
        check_fields(self)
        check_whole("miss_limit", self.miss_limit, 0 if self.strict else 1, 1000)

    @classmethod
    def intended(cls) -> Supervision:
        """Return the rule implied by the printed 3 seconds: reaching both limits suffices."""
        return cls(strict=False)

    @property
    def miss_ticks(self) -> int:
        """Ticks until the first miss."""
        return self.count_limit + self.strict

    @property
    def n_ticks(self) -> int:
        """Ticks until the partner is declared failed."""
        return self.miss_ticks * (self.miss_limit + self.strict)

    @property
    def detection_time(self) -> tuple[float, float]:
        """Limits of the time from a partner's last 0xDD until the partner is declared failed [s].

        The lower limit comes first and is exclusive. The time depends on the delay of the first
        tick after the 0xDD, and is longer if the counting station sends meanwhile.
        """
        return (self.n_ticks - 1) * self.tick, self.n_ticks * self.tick

    def plot(self, ax: Axes | None = None, *, label: str = "") -> Axes:
        """Draw the counters from the last 0xDD of a partner until the partner is declared failed.

        A second rule on the same axes gets its own colour, and its misses are marked higher up.
        """
        from shipnet.remote_control.plot import plot_counters

        counts = [k % self.miss_ticks for k in range(self.n_ticks + 1)]
        times = [k * self.tick for k in range(len(counts))]
        ax = plot_counters(times, counts, times[self.miss_ticks :: self.miss_ticks], label, ax)
        if (self.count_limit, self.tick) == (10, 0.1) and times[-1] <= 5.4:
            ax.set(xlim=(0, 5.4), ylim=(0, 15.5), yticks=range(0, 11, 2))
        return ax


@dataclass(slots=True)
class Counter:
    """The two counters of one station for one partner; `ticks` counts from the last 0xDD."""

    rule: Supervision
    count: int = field(default=0, init=False)
    miss: int = field(default=0, init=False)
    ticks: int = field(default=0, init=False)
    failed: bool = field(default=False, init=False)

    def step(self) -> bool:
        """Count one tick; return whether the partner has just been declared failed."""
        self.count += 1
        self.ticks += 1
        if self.count >= self.rule.miss_ticks:
            self.count = 0
            self.miss += 1
        # A failure restarts the counters, so a partner that stays silent is declared failed again.
        if self.miss >= self.rule.miss_limit + self.rule.strict:
            self.miss = 0
            self.failed = True
            return True
        return False

    def clear(self) -> bool:
        """Clear all counters at a sign of life; return whether the partner was declared failed."""
        failed, self.failed = self.failed, False
        self.count = self.miss = self.ticks = 0
        return failed


# The link --------------------------------------------------------------------------------------


class Cascade(NamedTuple):
    """The silence that BCS observes while RCS waits for a dead SS; times in seconds.

    Each pair contains the shortest and the longest time, depending on the state of the timers, in
    the first turn of SS after its death, if SS was not sending when it died. `wait` is the time for
    which RCS waits for a response, `silent` the time from the last byte that BCS sends to the next
    0xDD that it receives. `longest` is an upper bound on `silent` in any turn, whenever SS dies.
    `alarm` says whether BCS also declares RCS failed, although RCS is alive: "certain" (in the
    first turn), "possible" or "never".
    """

    wait: tuple[float, float]
    silent: tuple[float, float]
    longest: float
    alarm: str


@record
class System:
    r"""The link of three stations: RCS polls BCS and SS in turn, over a separate line to each.

    Notes
    -----
    With packets of duration P and a processing time t per packet, the duration of a cycle is

    .. math:: T = 4 (P + t)

    Examples
    --------
    Ten items in 33 bytes of 10 bits, at 9600 and at 600 bit/s:

    >>> from shipnet import remote_control as rc
    >>> systems = [rc.System(bit_rate=rate) for rate in (9600, 600)]
    >>> [round(system.packet_time * 1e3, 2) for system in systems]
    [34.38, 550.0]
    >>> [round(system.response_time(), 3) for system in systems]
    [0.206, 3.3]
    >>> systems[1].cascade().alarm
    'certain'
    """

    packet_format: PacketFormat = part(
        PacketFormat,
        "Packet format, a MarkerFormat or a CobsFormat; its ``n_numbers`` is the number of "
        "items, the same on all hops",
        default_factory=MarkerFormat,
    )
    bit_rate: float = number(300, 10e6, "bit/s", "Bit rate", default=9600.0)
    character_bits: int = whole(
        10,
        11,
        "bit",
        "Bits per byte on the line: 10, or 11 with a parity bit or a second stop bit; chung1998 "
        "does not say which",
        default=10,
    )
    repeat: int = whole(
        0,
        204,
        "",
        "Number of values that each packet carries in turn, even if they are unchanged; 0 is the "
        "rule as printed, and ``n_items`` sends all values every time",
        default=0,
    )
    processing: float = number(
        0,
        10,
        "s",
        "Time from the last byte of a packet to the first byte of the response; Fig. 2 shows "
        "such a time but prints no number",
        default=0.0,
    )
    master: Supervision = part(Supervision, "Rule of RCS", default_factory=Supervision)
    slave: Supervision = part(Supervision, "Rule of BCS and SS", default_factory=Supervision)
    turn_timeout: float | None = number(
        1e-3,
        3600,
        "s",
        "Time after which RCS goes on to the next partner if it has received no response; if None, "
        "as printed, it waits until it declares the partner failed",
        default=None,
        optional=True,
    )
    ring_size: int = whole(2, 4096, "byte", "Size of the receive ring", default=128)

    def __post_init__(self) -> None:
        check_fields(self)
        check_whole("repeat", self.repeat, 0, self.n_items)

    @property
    def n_items(self) -> int:
        """Largest number of items per packet."""
        return self.packet_format.n_numbers

    @property
    def character_time(self) -> float:
        """Transmission time of a byte [s]."""
        return self.character_bits / self.bit_rate

    @property
    def packet_time(self) -> float:
        """Transmission time of a packet with all items [s]."""
        return self.packet_format.size(self.n_items) * self.character_time

    @property
    def cycle_time(self) -> float:
        """Time in which RCS exchanges packets with both slaves [s]."""
        return 4 * (self.packet_time + self.processing)

    @property
    def idle_time(self) -> float:
        r"""Time without reception at a healthy slave, from its last sent byte to the next 0xDD [s].

        .. math:: T_i = 2 P + 3 t + b \, t_c

        with b bytes, of duration t_c each, up to and including the first 0xDD.
        """
        first = (self.heartbeats()[0] + 1) * self.character_time
        return 2 * self.packet_time + 3 * self.processing + first

    @property
    def counted_time(self) -> float:
        r"""Longest time for which the counters of a healthy slave run without a 0xDD [s].

        The counters also run while the rest of a packet arrives and is processed, but not while the
        slave sends:

        .. math:: T_c = \left( P - b_l \, t_c \right) + t + T_i

        with b_l bytes up to the last 0xDD of a packet. The elapsed time is longer by P.
        """
        return self._rest_time + self.idle_time

    @property
    def max_ticks(self) -> int:
        """Largest number of ticks that a healthy slave counts between two 0xDD.

        With ``slave.n_ticks`` or more, a false alarm is possible.
        """
        rest_time, tick = self._rest_time, self.slave.tick
        end = rest_time + self.packet_time + self.idle_time
        edges = np.array([(0.0, rest_time), (rest_time + self.packet_time, end)]) / tick
        # The count is highest for a tick just before the end or just after the beginning of an
        # interval.
        phases = np.concatenate([edges.reshape(-1) - 1e-9, edges.reshape(-1) + 1e-9])
        inside = np.floor(edges[:, 1] - phases[:, None]) - np.floor(edges[:, 0] - phases[:, None])
        return int(inside.sum(axis=1).max())

    @property
    def fill_time(self) -> float:
        """Time in which uninterrupted reception fills the receive ring [s]."""
        return self.ring_size * self.character_time

    def response_time(self) -> float:
        r"""Return the longest delay of a change from one slave to the other in a healthy link [s].

        .. math:: T_r = T + 2 (P + t)

        At worst the change just misses a packet and waits a cycle T. It then needs two packets,
        because RCS forwards it.
        """
        return 6 * (self.packet_time + self.processing)

    def timing(self) -> Timing:
        """Return the times of the link at the paper's bit rates, for a table and a figure."""
        return Timing(self)

    def signals(self) -> pd.DataFrame:
        """Return the values that cross the link, with their sources, readers and hops."""
        rows = [
            {
                "number": value.number,
                "name": value.name,
                "kind": value.kind,
                "sources": ", ".join(value.sources),
                "readers": ", ".join(value.readers),
                "mirrored": value.mirrored,
                "where": value.where,
            }
            | {f"{source}-{target}": (source, target) in value.hops for source, target in HOPS}
            for value in VALUES
        ]
        return pd.DataFrame(rows)

    def cascade(self) -> Cascade:
        r"""Return the silence that BCS observes when SS dies.

        .. math:: T_i' = t + P + W + b \, t_c

        where W is the time that RCS waits until it declares SS failed or the turn times out. If SS
        dies while it is sending, RCS keeps part of a packet. This part can corrupt the response of
        BCS, and RCS then waits in vain for both slaves; `Cascade.longest` assumes that this always
        happens. RCS can even declare BCS failed, unless the turn times out first.
        """
        packet, process, rule = self.packet_time, self.processing, self.master
        # RCS has already counted since the last 0xDD from SS.
        rest_time = self._rest_time
        before = rest_time / rule.tick
        ticks = rule.n_ticks - ceil(before) - 1, rule.n_ticks - floor(before)
        timeout = inf if self.turn_timeout is None else self.turn_timeout
        wait = (
            min(max(ticks[0], 0) * rule.tick, timeout),
            min(max(ticks[1], 0) * rule.tick, timeout),
        )
        first = self.idle_time - 2 * packet - 3 * process
        silent = process + packet + wait[0] + first, process + packet + wait[1] + first
        # If SS dies after its last 0xDD, RCS counts from that byte, and later also waits for BCS.
        again = rule.n_ticks * rule.tick
        anew = min(again + packet + 2 * process - rest_time, timeout)
        again = min(again, timeout)
        longest = first + max(process + packet + anew, anew - process + again)
        limit, tick = self.slave.n_ticks, self.slave.tick
        if floor(rest_time / tick) + floor(silent[0] / tick) >= limit:
            alarm = "certain"
        elif ceil(rest_time / tick) + ceil(longest / tick) >= limit:
            alarm = "possible"
        else:
            alarm = "never"
        return Cascade(wait, silent, longest, alarm)

    def overrun_stall(self) -> tuple[float, float]:
        r"""Return the limits of the shortest stall of a slave's task that overruns its ring [s].

        The stall begins at the worst moment, just before the first byte of a packet is complete.
        RCS waits in vain for W, exchanges packets with the other slave and sends again, until the
        k-th packet after the first fills the ring:

        .. math:: S = k (W + 3 P + 2 t) + (R - k L - 1) \, t_c, \quad k = \lceil R / L \rceil - 1

        with packets of L bytes that contain all items, and a ring of R bytes. The time depends on
        the timer of RCS; with a ``turn_timeout``, the two limits are equal.
        """
        size, ring = self.packet_format.size(self.n_items), self.ring_size
        packet, rule = self.packet_time, self.master
        rounds = -(-ring // size) - 1
        if rounds < 1:
            raise ArgumentError(
                f"ring_size is {ring}; it must be more than a packet of {size} bytes"
            )
        if self.turn_timeout is None:
            # Ticks counted for this slave before the first wait shorten that wait.
            before = np.ceil((packet + self.processing) / rule.tick) * rule.tick
            longest = rounds * rule.n_ticks * rule.tick
            waits = (longest - rounds * rule.tick - before, longest)
        else:
            waits = (rounds * self.turn_timeout,) * 2
        stall = (ring - rounds * size - 1) * self.character_time
        stall += rounds * (3 * packet + 2 * self.processing)
        return float(waits[0] + stall), float(waits[1] + stall)

    def heartbeats(self) -> tuple[int, ...]:
        """Return the places, from 0, of the bytes in a packet that show that its sender is alive.

        These bytes are the markers 0xDD or, in a format without markers, the last byte.
        """
        if not isinstance(self.packet_format, MarkerFormat):
            return (self.packet_format.size(self.n_items) - 1,)
        if self.packet_format.reading == "A":
            return (1,)
        return tuple(range(1, 1 + 4 * self.n_items, 4))

    @property
    def _rest_time(self) -> float:
        """Time from the last 0xDD of a packet until the packet has been processed [s]."""
        last = (self.heartbeats()[-1] + 1) * self.character_time
        return self.packet_time - last + self.processing


@dataclass(frozen=True)
class Timing:
    """The times of a link by bit rate, with all items in every packet."""

    system: System

    def table(self) -> pd.DataFrame:
        """Return one row per bit rate.

        ``ticks`` is the largest number that a healthy slave counts; ``printed_margin`` and
        ``intended_margin`` are the ticks left before the alarm under each rule.
        """
        rows = []
        for rate in BIT_RATES:
            link = replace(self.system, bit_rate=rate)
            rows.append(
                {
                    "bit_rate": rate,
                    "packet_s": link.packet_time,
                    "cycle_s": link.cycle_time,
                    "idle_s": link.idle_time,
                    "counted_s": link.counted_time,
                    "fill_s": link.fill_time,
                    "response_s": link.response_time(),
                    "ticks": link.max_ticks,
                    "printed_margin": Supervision().n_ticks - link.max_ticks,
                    "intended_margin": Supervision.intended().n_ticks - link.max_ticks,
                }
            )
        return pd.DataFrame(rows)

    def plot(self, ax: Axes | None = None, *, limit: float = 3.0) -> Axes:
        """Draw the time for which a healthy slave's counters run, over the bit rate.

        `limit`, the time after which a partner is declared failed [s], is a red dashed line.
        """
        from shipnet.remote_control.plot import plot_margins

        return plot_margins(self.table(), ax, limit)
