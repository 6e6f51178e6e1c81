"""The link as it is built: its supervision, and its times in closed form.

All times are for a link without bit errors in which every packet has all its items.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from math import ceil, floor
from typing import Literal, NamedTuple

import numpy as np

from shipnet.arguments import checked
from shipnet.errors import ArgumentError
from shipnet.fields import check_whole, choice, number, part, record, switch, whole
from shipnet.lazy import Axes, pd
from shipnet.remote_control.packet import MarkerFormat
from shipnet.remote_control.packet_format import PacketFormat
from shipnet.remote_control.values import HOPS, VALUES

#: Bit rates that section 5 of chung1998 tries [bit/s].
BIT_RATES = (9600, 4800, 2400, 1200, 600)


# Supervision -----------------------------------------------------------------------------------


@checked
@record
class Supervision:
    r"""Rule by which silence becomes a failure.

    Every tick adds 1 to ``count``, any 0xDD clears ``count`` and ``miss``. A ``count`` beyond its
    limit is cleared and adds 1 to ``miss``; a ``miss`` beyond its limit is a failure. With limits
    c and m, the failure comes with tick number

    .. math:: N = (c + 1)(m + 1), \quad \text{or} \quad N = c \, m

    depending on whether "beyond" means greater than the limit (as printed) or reaching it.

    Notes
    -----
    Section 4 of chung1998 prints both tests with "greater than" and calls the outcome 3 seconds;
    that requires "reaching" in both, see `intended` (claims chung1998-007 and 045).

    Examples
    --------
    >>> from shipnet import remote_control as rc
    >>> rule = rc.Supervision()
    >>> rule.n_ticks, [round(time, 3) for time in rule.detection_time]
    (44, [4.3, 4.4])
    >>> rule = rc.Supervision.intended()
    >>> rule.n_ticks, [round(time, 3) for time in rule.detection_time]
    (30, [2.9, 3.0])
    """

    tick: float = number(1e-3, 10, "s", "Period of the timer", default=0.1)
    count_limit: int = whole(1, 1000, "ticks", "Limit of `count`", default=10)
    miss_limit: int = whole(
        0, 1000, "", "Limit of `miss`, at least 1 if reaching it is enough", default=3
    )
    strict: bool = switch("Whether a limit must be exceeded, not only reached", default=True)
    while_sending: bool = switch(
        "Whether ticks count while the station sends; as printed, only while it receives",
        default=False,
    )

    def __post_init__(self) -> None:
        check_whole("miss_limit", self.miss_limit, 0 if self.strict else 1, 1000)

    @classmethod
    def intended(cls) -> Supervision:
        """Return the rule that the printed 3 seconds require: reaching both limits is enough."""
        return cls(strict=False)

    @property
    def miss_ticks(self) -> int:
        """Ticks until the first miss."""
        return self.count_limit + self.strict

    @property
    def n_ticks(self) -> int:
        """Ticks until the failure."""
        return self.miss_ticks * (self.miss_limit + self.strict)

    @property
    def detection_time(self) -> tuple[float, float]:
        """Shortest (excluded) and longest time from the last 0xDD to the failure [s].

        It depends on how soon the first tick follows, and holds for a station that does not send
        in the meantime.
        """
        return (self.n_ticks - 1) * self.tick, self.n_ticks * self.tick

    def plot(self, ax: Axes | None = None, *, label: str = "") -> Axes:
        """Draw the counters after the last 0xDD of a partner, until it is taken as failed.

        A rule that is drawn on the axes of another one gets a colour and a height of its own.
        """
        from shipnet.remote_control.plot import plot_counters

        counter, counts, misses = Counter(self), [0], []
        while not counter.failed:
            counter.step()
            counts.append(counter.count)
            if counter.count == 0:
                misses.append((len(counts) - 1) * self.tick)
        times = [k * self.tick for k in range(len(counts))]
        ax = plot_counters(times, counts, misses, label, ax)
        if (self.count_limit, self.tick) == (10, 0.1) and times[-1] <= 5.4:
            ax.set(xlim=(0, 5.4), ylim=(0, 15.5), yticks=range(0, 11, 2))
        return ax


@dataclass(slots=True)
class Counter:
    """The two counters of one station for one partner; `ticks` counts since the last 0xDD."""

    rule: Supervision
    count: int = field(default=0, init=False)
    miss: int = field(default=0, init=False)
    ticks: int = field(default=0, init=False)
    failed: bool = field(default=False, init=False)

    def step(self) -> bool:
        """Count one tick; return whether the silence has just become a failure.

        The counters begin anew after a failure, so that a partner that stays silent fails again.
        """
        self.count += 1
        self.ticks += 1
        if self.count >= self.rule.miss_ticks:
            self.count = 0
            self.miss += 1
        if self.miss >= self.rule.miss_limit + self.rule.strict:
            self.miss = 0
            self.failed = True
            return True
        return False

    def clear(self) -> bool:
        """Clear everything, because a 0xDD has come; return whether the partner had failed."""
        failed, self.failed = self.failed, False
        self.count = self.miss = self.ticks = 0
        return failed


# The link --------------------------------------------------------------------------------------


class Cascade(NamedTuple):
    """What BCS sees while RCS waits for a dead SS; times in seconds.

    The pairs hold for the first turn of an SS that died while it was silent, and go from the
    shortest to the longest, depending on the timers: how long RCS waits for an answer, how long
    BCS hears nothing from its last byte to the next 0xDD, and how long its counters run meanwhile.

    `longest` is a bound of the time that BCS hears nothing, over every moment of death and all
    later turns: an SS that dies inside its answer leaves half a packet in the ring of RCS, which
    can spoil the answer of BCS, and RCS then waits for both. `alarm` says whether BCS takes RCS,
    which is alive, as failed too: "certain" (at the first turn), "possible" or "never".
    """

    wait: tuple[float, float]
    silent: tuple[float, float]
    counted: tuple[float, float]
    longest: float
    alarm: str


@checked
@record
class System:
    r"""The link of three stations: RCS asks BCS and SS in turn, over a line to each.

    Notes
    -----
    With packets of the length P, each worked on for a time t, a cycle takes

    .. math:: T = 4 (P + t)

    Examples
    --------
    Ten items in 33 bytes of 10 bits, at 9600 and at 600 bit/s:

    >>> from shipnet import remote_control as rc
    >>> systems = [rc.System(bit_rate=rate) for rate in (9600, 600)]
    >>> [round(system.packet_time * 1e3, 2) for system in systems]
    [34.38, 550.0]
    >>> [round(system.cycle_time, 4) for system in systems]
    [0.1375, 2.2]
    >>> [round(system.response_time(), 3) for system in systems]
    [0.206, 3.3]
    >>> systems[1].cascade().alarm
    'certain'
    """

    packet_format: PacketFormat = part(
        PacketFormat,
        "Form of the packets, a MarkerFormat or a CobsFormat; its ``n_numbers`` is the number of "
        "items, the same on all hops", default_factory=MarkerFormat,
    )  # fmt: skip
    bit_rate: float = number(1, 10e6, "bit/s", "Bit rate", default=9600.0)
    character_bits: int = whole(
        10, 11, "bit",
        "Bits on the line per byte, without or with a parity bit (or a second stop bit); chung1998 "
        "does not say which", default=10,
    )  # fmt: skip
    repeat: int = whole(
        0, 204, "",
        "Values that go with each packet in turn, though they have not changed; 0 is the rule as "
        "printed, ``n_items``, the most, sends everything every time", default=0,
    )  # fmt: skip
    processing: float = number(
        0, 10, "s",
        "Work on a packet, from its last byte to the first byte of the answer; longer than 0 by "
        "Fig. 2, which prints no number", default=0.0,
    )  # fmt: skip
    master: Supervision = part(Supervision, "Rule of RCS", default_factory=Supervision)
    slave: Supervision = part(Supervision, "Rule of BCS and SS", default_factory=Supervision)
    turn_timeout: float | None = number(
        1e-3, 3600, "s",
        "How long RCS waits for an answer before it goes on to the next partner; as printed, it "
        "waits until it takes the partner as failed", default=None, optional=True,
    )  # fmt: skip
    skip_turns: int = whole(
        0, 10**6, "",
        "Turns that leave out a partner taken as failed, unless both are; not in the paper",
        default=0,
    )  # fmt: skip
    ring_size: int = whole(2, 4096, "byte", "Size of the receive ring", default=128)
    ring_rule: Literal["intended", "corrected"] = choice(
        ("intended", "corrected"), "How the reader of the ring decides, see `Ring`",
        default="intended",
    )  # fmt: skip

    def __post_init__(self) -> None:
        check_whole("repeat", self.repeat, 0, self.n_items)

    @property
    def n_items(self) -> int:
        """Most items of a packet."""
        return self.packet_format.n_numbers

    @property
    def character_time(self) -> float:
        """How long a byte takes [s]."""
        return self.character_bits / self.bit_rate

    @property
    def packet_time(self) -> float:
        """How long a packet with all items is on the line [s]."""
        return self.packet_format.size(self.n_items) * self.character_time

    @property
    def cycle_time(self) -> float:
        """How long RCS takes to exchange packets with both slaves [s]."""
        return 4 * (self.packet_time + self.processing)

    @property
    def idle_time(self) -> float:
        r"""How long a healthy slave hears nothing, from its last byte to the next 0xDD [s].

        .. math:: T_i = 2 P + 3 t + b \, t_c

        with b bytes of the length t_c up to the first 0xDD.
        """
        first = (self.heartbeats()[0] + 1) * self.character_time
        return 2 * self.packet_time + 3 * self.processing + first

    @property
    def counted_time(self) -> float:
        r"""The longest time that the counters of a healthy slave run without a 0xDD [s].

        They also run while the rest of a packet comes in and is worked on, but not while the slave
        sends:

        .. math:: T_c = \left( P - b_l \, t_c \right) + t + T_i

        with b_l bytes up to the last 0xDD of a packet. The time on the clock is longer by P, and
        so is the result if the slave's rule counts ``while_sending``.
        """
        return sum(self._counted_parts())

    @property
    def max_ticks(self) -> int:
        """How many ticks a healthy slave counts at most between two 0xDD.

        With ``slave.n_ticks`` or more there is a false alarm if the timer is out of step.
        """
        rest, sending, idle = self._counted_parts()
        tick, gap = self.slave.tick, self.packet_time - sending
        stretches = [(0.0, rest + sending), (rest + sending + gap, rest + sending + gap + idle)]
        edges = np.array(stretches) / tick
        # Just before an end and just after a beginning, the count is at its highest.
        phases = np.concatenate([edges.reshape(-1) - 1e-9, edges.reshape(-1) + 1e-9])
        inside = np.floor(edges[:, 1] - phases[:, None]) - np.floor(edges[:, 0] - phases[:, None])
        return int(inside.sum(axis=1).max())

    @property
    def fill_time(self) -> float:
        """How long unbroken reception takes to fill the receive ring [s]."""
        return self.ring_size * self.character_time

    def response_time(self, hops: int = 2) -> float:
        r"""Return how long a change takes at most to reach its reader in a healthy link [s].

        .. math:: T_r = T + h (P + t)

        It comes just after the packet was made that could have carried it, waits a cycle T, and
        takes h `hops`: 2 from one slave to the other, 1 to or from RCS.
        """
        return (4 + check_whole("hops", hops, 1, 2)) * (self.packet_time + self.processing)

    def timing(self, bit_rates: Iterable[float] = BIT_RATES) -> Timing:
        """Return all these times by bit rate [bit/s], as a table and a figure."""
        return Timing(self, tuple(bit_rates))

    def signals(self) -> pd.DataFrame:
        """Return the values that cross the link: who sets them, who reads them, on which hops."""
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
            | {f"{a}-{b}": (a, b) in value.hops for a, b in HOPS}
            for value in VALUES
        ]
        return pd.DataFrame(rows)

    def cascade(self) -> Cascade:
        r"""Return what BCS sees when SS dies.

        .. math:: T_i' = t + P + W + b \, t_c

        with a wait W of RCS that ends when its counters run out, or with its turn. If half an
        answer spoils that of BCS as well, RCS waits twice.

        The counters of RCS hold what they had counted for SS since its last 0xDD, so that the wait
        is a little shorter than the time to detect a failure; if SS dies after the 0xDD of an
        answer, it is longer by what came before. `Cascade.longest` assumes that half an answer
        always spoils that of BCS; it often does not.

        That BCS is not alarmed does not keep the failure at SS: with half an answer in its ring
        RCS can take BCS, which is alive, as failed, unless its turn ends before the counters run
        out.
        """
        rest, sending, idle = self._counted_parts()
        packet, process, rule = self.packet_time, self.processing, self.master
        # RCS has counted for SS since its last 0xDD: now and then, or without a break.
        if rule.while_sending:
            before = (3 * packet + 2 * process + rest) / rule.tick
            ticks = (rule.n_ticks - before - 1, rule.n_ticks - before)
        else:
            ticks = (
                rule.n_ticks - ceil(rest / rule.tick) - 1,
                rule.n_ticks - floor(rest / rule.tick),
            )
        wait = (max(ticks[0], 0) * rule.tick, max(ticks[1], 0) * rule.tick)
        if self.turn_timeout is not None:
            wait = (min(wait[0], self.turn_timeout), min(wait[1], self.turn_timeout))
        first = idle - 2 * packet - 3 * process
        silent = (process + packet + wait[0] + first, process + packet + wait[1] + first)
        counted = (silent[0] + rest + sending, silent[1] + rest + sending)
        # SS dies after its last 0xDD: RCS counts anew from there. Later, it waits for BCS as well.
        again = rule.n_ticks * rule.tick
        # Rest is the end of a packet after its last 0xDD, and the work on it.
        anew = again + packet + 2 * process - rest
        if self.turn_timeout is not None:
            anew, again = min(anew, self.turn_timeout), min(again, self.turn_timeout)
        longest = first + max(process + packet + anew, anew - process + again)
        limit, tick = self.slave.n_ticks, self.slave.tick
        if floor((rest + sending) / tick) + floor(silent[0] / tick) >= limit:
            alarm = "certain"
        else:
            possible = ceil((rest + sending) / tick) + ceil(longest / tick) >= limit
            alarm = "possible" if possible else "never"
        return Cascade(wait, silent, counted, longest, alarm)

    def overrun_stall(self) -> tuple[float, float]:
        r"""Return how long a slave's task must stall until its ring is overrun [s].

        The stall begins at the worst moment, with a packet. RCS waits in vain, W, and comes again
        after an exchange with the other slave, until the k-th packet after the first fills the
        ring:

        .. math:: S = k (W + 3 P + 2 t) + (R - k L - 1) \, t_c, \quad k = \lceil R / L \rceil - 1

        with packets of L bytes, all items in them, and a ring of R. Shortest and longest time,
        depending on the timer of RCS; equal with a ``turn_timeout``.
        """
        if self.skip_turns:
            raise ArgumentError(f"skip_turns is {self.skip_turns}; it must be 0 here")
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
        rest = (ring - rounds * size - 1) * self.character_time
        rest += rounds * (3 * packet + 2 * self.processing)
        return float(waits[0] + rest), float(waits[1] + rest)

    def rule(self, station: str) -> Supervision:
        """Return the supervision of a station."""
        return self.master if station == "RCS" else self.slave

    def heartbeats(self) -> tuple[int, ...]:
        """Return which bytes of a packet show its receiver that the sender is alive.

        They are the markers 0xDD; where the format has none, the last byte. A value byte 0xDD
        works as a marker does, but cannot be relied on.
        """
        if not isinstance(self.packet_format, MarkerFormat):
            return (self.packet_format.size(self.n_items) - 1,)
        if self.packet_format.reading == "A":
            return (1,)
        return tuple(range(1, 1 + 4 * self.n_items, 4))

    def _counted_parts(self) -> tuple[float, float, float]:
        """Return the parts of `counted_time`.

        Time after the last 0xDD of a packet with the work on it; own packet, 0 unless the rule
        counts ``while_sending``; idle time.
        """
        packet = self.packet_time
        rest = packet - (self.heartbeats()[-1] + 1) * self.character_time + self.processing
        return rest, packet if self.slave.while_sending else 0.0, self.idle_time


@dataclass(frozen=True)
class Timing:
    """The times of a link by bit rate, all items sent."""

    system: System
    bit_rates: tuple[float, ...]

    def table(self) -> pd.DataFrame:
        """Return a row per bit rate.

        ``ticks`` are the most that a healthy slave counts, ``printed_margin`` and
        ``intended_margin`` those left before the alarm by either rule.
        """
        rows = []
        for rate in self.bit_rates:
            one = replace(self.system, bit_rate=rate)
            rows.append(
                {
                    "bit_rate": rate,
                    "packet_s": one.packet_time,
                    "cycle_s": one.cycle_time,
                    "idle_s": one.idle_time,
                    "counted_s": one.counted_time,
                    "fill_s": one.fill_time,
                    "response_s": one.response_time(),
                    "ticks": one.max_ticks,
                    "printed_margin": Supervision().n_ticks - one.max_ticks,
                    "intended_margin": Supervision.intended().n_ticks - one.max_ticks,
                }
            )
        return pd.DataFrame(rows)

    def plot(self, ax: Axes | None = None, *, limit: float = 3.0) -> Axes:
        """Draw how long a healthy slave's counters run, over the bit rate.

        `limit` is the time to failure [s], a red dashed line.
        """
        from shipnet.remote_control.plot import plot_margins

        return plot_margins(self.table(), ax, limit)
