"""The engine monitoring system as a whole, and analytical bounds on its times."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from functools import cached_property
from math import inf
from typing import Any, Literal, NamedTuple

import numpy as np

from shipnet.arrays import Floats, Integers
from shipnet.can.lengths import frame_length
from shipnet.can.messages import MessageSet
from shipnet.can.response import Assumptions, response_times
from shipnet.clock import Fault, as_faults, nanoseconds
from shipnet.engine.can_layout import CanLayout
from shipnet.engine.faults import (
    KINDS,
    WIRES,
    BusOff,
    CanBreak,
    DeadBox,
    DeadPort,
    EngineFault,
    LostCanFrames,
    LostModbusFrames,
    ModbusBreak,
    StuckSensor,
)
from shipnet.engine.points import PointList, read_points
from shipnet.errors import ArgumentError
from shipnet.fields import (
    check_fields,
    check_kind,
    check_scalar,
    check_whole,
    choice,
    number,
    part,
    record,
    whole,
)
from shipnet.lazy import Axes, pd
from shipnet.modbus.pdu import Request
from shipnet.modbus.polling import Poll
from shipnet.modbus.uart import SerialLine

#: Longest response time permitted by the class rules that lee2012 quotes in section II [s].
RULE = 2.0

#: Longest period, time-out and limit of a system [s].
LONGEST = 100.0

#: Clock cycles of one conversion of the AT90CAN128's ADC, and clock cycles from its start until the
#: input is sampled; Atmel, AT90CAN128 data sheet, section "ADC".
_CLOCKS, _HOLD = 13, 1.5


@record(slots=True)
class Firmware:
    """Times within a junction box. The paper prints none of them: all are **assumed**.

    The main loop converts all analogue inputs, reads the switches and hands the frames to the CAN
    controller. Three routines interrupt it, in this order of priority: Modbus, timer, CAN.

    Notes
    -----
    The Modbus interrupt suspends everything else; the bytes of its response are sent one by
    one alongside other work. The timer and CAN routines are short and run while the loop waits for
    the multiplexer, so they do not delay the loop (lee2012, section III.2, figures 5 and 6). A
    conversion takes 13 cycles of a clock of 50..200 kHz (Atmel, AT90CAN32/64/128 data sheet).

    Examples
    --------
    Conversion times of the three boxes, which have 37, 16 and 27 analogue inputs [ms]:

    >>> [round(Firmware().conversion_time(n) * 1e3, 2) for n in (37, 16, 27)]
    [40.85, 17.66, 29.81]
    """

    adc_clock: float = number(
        50e3, 200e3, "Hz", "Clock of the ADC; 125 kHz is a 16 MHz crystal divided by 128",
        default=125e3,
    )  # fmt: skip
    settling: float = number(
        0, 1, "s", "Settling time of the input filter after the multiplexer has selected an input",
        default=1e-3,
    )  # fmt: skip
    send: float = number(
        1e-9, 1, "s", "Time to pass one frame to the CAN controller", default=100e-6,
    )  # fmt: skip
    receive: float = number(
        1e-9, 1e-3, "s",
        "Time that the CAN interrupt takes to read a frame and restart a timer", default=50e-6,
    )  # fmt: skip
    mark: float = number(
        1e-9, 1e-3, "s", "Time that the timer interrupt takes to mark stale values", default=100e-6
    )
    processing: float = number(
        1e-9, 1, "s",
        "Time of the Modbus interrupt: from the end of the silence after a request to the first "
        "bit of the response", default=5e-3,
    )  # fmt: skip

    @property
    def input_time(self) -> float:
        """Time of one analogue input: settling and conversion [s]."""
        return self.settling + _CLOCKS / self.adc_clock

    def conversion_time(self, n_analogue: int) -> float:
        """Return the conversion time of 0..1000 analogue inputs [s]."""
        return check_whole("n_analogue", n_analogue, 0, 1000) * self.input_time


class SwitchOver(NamedTuple):
    """Times of a switch-over to the other channel [s].

    From the first unanswered request, `request` runs to the first request on the other channel and
    `answer` to the end of its response. `loss` is the longest time from the loss of the channel to
    the end of that response, `gap` the longest time between two responses.
    """

    request: float
    answer: float
    loss: float
    gap: float


class FailureBounds(NamedTuple):
    """The worst effects of a single failure, whatever the phases of the clocks [s].

    `answer` is the longest time from the first request of a poll to its response, `gap` the longest
    time between two responses, and `oldest` the greatest age shown as good, infinite if the age
    grows without limit.
    """

    answer: float
    gap: float
    oldest: float


class StalenessFlag(NamedTuple):
    """Longest time until a box's failure is noticed, and greatest age of its values by then [s]."""

    after: float
    oldest: float


@record
class System:
    """An engine monitoring system; without arguments, the one of lee2012.

    Notes
    -----
    With the `coding` "printed", a box marks all values of another box as 0xFF if it has received no
    frame from that box for `stale_limit`. With "corrected", responses also contain the age of every
    frame, and the AMS marks each value that may be older than `age_limit`. Figure 3 may show a CAN
    ring, which ISO 11898 does not allow; a ring is assumed to work. The AMS is assumed to stay on
    the last channel that responded. The time-out ends at a response's *first* character.

    References
    ----------
    .. [1] J. H. Lee, D. S. Kim, "Design and implementation of distributed control system based on
       dual field-bus for ship engine", J. IEEK 49-SC(2), 2012.

    Examples
    --------
    >>> from shipnet import engine
    >>> system = engine.System()
    >>> system
    System(lee2012: 99 points in 3 boxes, CAN line at 125 kbit/s, Modbus at 9600 bit/s)
    >>> system.boxes, system.registers, engine.System.corrected().registers
    (('JB1', 'JB2', 'JB3'), 99, 121)
    >>> [round(time, 3) for time in system.switch_over()]
    [0.133, 0.388, 1.137, 1.255]
    >>> system.worst_age().groupby("box")["worst_s"].max().round(3).to_dict()
    {'JB1': 1.781, 'JB2': 1.771, 'JB3': 1.789}
    """

    points: PointList = part(
        PointList,
        "Measuring points, in 2..7 boxes; the first box responds on Modbus channel 1, the last on "
        "channel 2. The 99 points of lee2012 if not given",
        default_factory=read_points, make=PointList,
    )  # fmt: skip
    firmware: Firmware = part(
        Firmware, "Times within a box; all are assumed if not given", default_factory=Firmware
    )
    can_bit_rate: int = whole(
        10_000, 10**6, "bit/s", "Bit rate of CAN; not printed, assumed", default=125_000
    )
    update_period: float = number(
        0, LONGEST, "s",
        "Time from one round of a box's loop to the next; not printed, assumed. A loop that takes "
        "longer starts again at once, so 0 means no pauses", default=0.5,
    )  # fmt: skip
    topology: Literal["line", "ring"] = choice(("line", "ring"), "CAN topology", default="line")
    serial: SerialLine = part(
        SerialLine, "Both Modbus lines; 9600 bit/s, 8E1 if not given", default=SerialLine(9600)
    )
    poll_period: float = number(0.01, LONGEST, "s", "Time between polls", default=1.0)
    timeout: float = number(
        0, LONGEST, "s", "Time-out of the AMS from the end of a request; not printed",
        default=0.1238,
    )  # fmt: skip
    retries: int = whole(
        0, 10, "", "Retries of the AMS before it tries the other channel; assumed",
        default=0,
    )  # fmt: skip
    polled: Literal["one", "both"] = choice(
        ("one", "both"),
        "Whether the AMS polls one channel, or always both, each through its own port",
        default="one",
    )
    coding: Literal["printed", "corrected"] = choice(
        ("printed", "corrected"), "How values that are too old are marked", default="printed"
    )
    stale_limit: float = number(
        0.01, LONGEST, "s", "Silence after which a box is marked in the printed coding",
        default=4.0,
    )  # fmt: skip
    age_limit: float = number(
        0.01, LONGEST, "s", "Age beyond which a value is marked in the corrected coding",
        default=RULE,
    )  # fmt: skip

    def __post_init__(self) -> None:
        check_fields(self)
        check_scalar("timeout", self.timeout, "s", self.shortest_timeout, LONGEST)
        if not 2 <= len(self.boxes) <= 7:
            raise ArgumentError(f"points are in {len(self.boxes)} boxes; there must be 2..7")
        if self.polled == "both" and self.coding == "printed":
            raise ArgumentError(
                "polled is 'both' with coding 'printed'; set polled to 'one' or coding to "
                "'corrected', because without ages the AMS cannot tell which of two values is newer"
            )
        check_whole("registers", self.registers, 1, 125, " of one request")
        if self.polled == "both" and self.poll.time > self.poll_period:
            raise ArgumentError(
                f"poll_period is {self.poll_period:g} s; a poll takes {self.poll.time:g} s"
            )

    def __repr__(self) -> str:
        source = "lee2012: " if self == System() else ""
        return (
            f"System({source}{len(self.points)} points in {len(self.boxes)} boxes, "
            f"CAN {self.topology} at {self.can_bit_rate / 1e3:g} kbit/s, "
            f"Modbus at {self.serial.bit_rate:g} bit/s)"
        )

    @classmethod
    def corrected(cls, **changes: Any) -> System:
        """Return a system that meets the 2 s rule for the age of data, with the given `changes`.

        The system has the corrected coding, polls both channels and updates values every 0.25 s.
        """
        fields: dict[str, Any] = {"coding": "corrected", "polled": "both", "update_period": 0.25}
        return cls(**{**fields, **changes})

    # Parts

    @cached_property
    def boxes(self) -> tuple[str, ...]:
        """Boxes, in their order on the CAN bus."""
        return self.points.boxes

    @property
    def ports(self) -> tuple[int, int]:
        """Indices of the boxes that respond on channels 1 and 2."""
        return 0, len(self.boxes) - 1

    @property
    def segments(self) -> tuple[str, ...]:
        """Names of the CAN cables, each formed from the names of the boxes at its ends."""
        ends = list(zip(self.boxes, self.boxes[1:], strict=False))
        if self.topology == "ring" and len(self.boxes) > 2:
            ends.append((self.boxes[-1], self.boxes[0]))
        return tuple(f"{a}-{b}" for a, b in ends)

    @cached_property
    def registers(self) -> int:
        """Number of registers in a response: one per point, plus one age per frame if corrected."""
        return len(self.points) + self.sender.size * (self.coding == "corrected")

    @cached_property
    def poll(self) -> Poll:
        """The transaction that reads all registers."""
        request = Request.read_holding_registers(0, self.registers)
        processing = self.firmware.processing
        return Poll(request, self.serial, processing=processing, timeout=3600)

    @property
    def shortest_timeout(self) -> float:
        """The shortest time-out that a healthy box can meet [s]."""
        return self.serial.t35 + self.firmware.processing

    @cached_property
    def conversion_times(self) -> dict[str, float]:
        """Time that each box takes to convert its inputs [s]."""
        return dict(zip(self.boxes, (self.convert_ns / 1e9).tolist(), strict=True))

    @cached_property
    def _layout(self) -> CanLayout:
        return CanLayout(self.points)

    @cached_property
    def messages(self) -> MessageSet:
        """CAN messages, the highest priority first; their jitter is the delay caused by Modbus."""
        return self._messages(self.suspended_ns)

    def _messages(self, suspended: Integers) -> MessageSet:
        periods = dict(zip(self.boxes, self.period_ns.tolist(), strict=True))
        delays = dict(zip(self.boxes, suspended.tolist(), strict=True))
        return MessageSet(
            replace(
                message,
                period=periods[message.sender] / 1e9,
                deadline=periods[message.sender] / 1e9,
                jitter=delays[message.sender] / 1e9,
            )
            for message in self._layout.messages()
        )

    @cached_property
    def sender(self) -> Integers:
        """Index of the box that sends each message, shape (n_messages,)."""
        return np.array([self.boxes.index(m.sender) for m in self._layout.messages()])

    @cached_property
    def frame_ns(self) -> Integers:
        """Longest time of each message on the bus, intermission included [ns]."""
        bits = frame_length([m.dlc for m in self._layout.messages()])
        return np.rint(bits * 1e9 / self.can_bit_rate).astype(np.int64)

    @property
    def message_of(self) -> Integers:
        """Index of the message that contains each point, shape (n_points,)."""
        return self._layout.message_of

    @cached_property
    def box_of(self) -> Integers:
        """Index of the box of each point, shape (n_points,)."""
        return self.sender[self.message_of]

    # Times of the boxes' loops

    @cached_property
    def offset_ns(self) -> Integers:
        """Sampling time of each point from the start of the round [ns], shape (n_points,)."""
        offsets = np.zeros(len(self.points), dtype=np.int64)
        inputs = [0] * len(self.boxes)
        each = nanoseconds(self.firmware.input_time)
        hold = nanoseconds(self.firmware.settling + _HOLD / self.firmware.adc_clock)
        for place, (point, box) in enumerate(zip(self.points, self.box_of.tolist(), strict=True)):
            if point.analogue:
                offsets[place] = inputs[box] * each + hold
                inputs[box] += 1
            else:
                offsets[place] = self.convert_ns[box]
        return offsets

    @cached_property
    def convert_ns(self) -> Integers:
        """Time that each box takes to convert its inputs [ns], shape (n_boxes,)."""
        counts = [sum(point.analogue for point in own) for own in self.points.by_box().values()]
        return nanoseconds(self.firmware.input_time) * np.array(counts, dtype=np.int64)

    @cached_property
    def loop_ns(self) -> Integers:
        """Duration of one round of each box's loop without interrupts [ns], shape (n_boxes,)."""
        frames = np.bincount(self.sender, minlength=len(self.boxes))
        return np.asarray(self.convert_ns + nanoseconds(self.firmware.send) * frames)

    @property
    def service_ns(self) -> int:
        """Duration of the Modbus interrupt [ns]."""
        return nanoseconds(self.firmware.processing)

    @cached_property
    def suspended_ns(self) -> Integers:
        """Longest time that Modbus polls add to a healthy box's round [ns], shape (n_boxes,)."""
        asked = self.ports if self.polled == "both" else self.ports[:1]
        return self.service_ns * np.isin(np.arange(len(self.boxes)), asked).astype(np.int64)

    @cached_property
    def period_ns(self) -> Integers:
        """Time from round to round of each box's loop [ns], shape (n_boxes,)."""
        reserved = self.loop_ns + self.service_ns * np.isin(np.arange(len(self.boxes)), self.ports)
        return np.asarray(np.maximum(nanoseconds(self.update_period), reserved))

    # Analytical bounds

    @cached_property
    def can_response(self) -> Floats:
        """Longest time from queueing a message to its last bit [s], highest priority first."""
        return self._can_response(self.messages)

    def _can_response(self, messages: MessageSet) -> Floats:
        # The receiver's interrupt comes at the end of the frame, so the intermission is left out.
        assumptions = Assumptions(own_jitter=False, intermission="between")
        found = response_times(messages, self.can_bit_rate, assumptions=assumptions)
        if not all(response.met for response in found):
            raise ArgumentError(
                f"can_bit_rate is {self.can_bit_rate} bit/s; frames must arrive within the update "
                f"period of {self.period_ns.max() / 1e9:g} s"
            )
        return np.array([response.response for response in found])

    def poll_spacing(self, lost: float = 0.0) -> float:
        """Return the time from poll to poll if each poll takes `lost` seconds longer [s]."""
        period = nanoseconds(self.poll_period)
        whole = nanoseconds(check_scalar("lost", lost, "s", 0, 1e6) + self.poll.time)
        return -(-whole // period) * period / 1e9

    def hop_ns(self, reader: int) -> Integers:
        """Return the greatest age of each message when box `reader` receives it [ns].

        The age counts from the start of the sender's round.
        """
        reader = check_whole("reader", reader, 0, len(self.boxes) - 1)
        sender = self.sender
        pile = self.service_ns + nanoseconds(self.firmware.receive) * sender.size
        sent = np.ceil(self.can_response * 1e9).astype(np.int64)
        others = self.loop_ns[sender] + self.suspended_ns[sender] + sent + pile
        return np.where(sender == reader, self.convert_ns[sender] + self.service_ns, others)

    def worst_age(self) -> pd.DataFrame:
        r"""Return the greatest age of each point at the AMS, just before its next value arrives.

        .. math:: A = \left( L - o \right) + P + S + R + h + T + t_{response}

        One row per point of a healthy system: ``tag``, ``box``, ``channel`` (over which the bound
        holds), the terms ``sampling_s`` (L - o: from sampling to the end of the box's round),
        ``update_s`` (P: to the end of the next round), ``interrupt_s`` (S: a Modbus request in that
        round), ``can_s`` (R: response time of the message), ``handling_s`` (h: the CAN interrupt),
        ``poll_s`` (T: to the next poll, if one just missed the value), ``transaction_s`` (from
        reading the registers to the end of the response), and their sum ``worst_s``.

        For the polled box's own values L is the conversion alone, and R, h and S are 0. If both
        channels are polled, the lower age counts. ArgumentError is raised if two polls can fall in
        one round of a loop, or the CAN bus is overloaded.
        """
        channels = self.ports if self.polled == "both" else self.ports[:1]
        return self._ages(channels, self.suspended_ns, self.can_response)

    def _ages(
        self, channels: tuple[int, ...], suspended: Integers, can_response: Floats
    ) -> pd.DataFrame:
        """Return each point's age over its best channel, for given delays of boxes and frames."""
        spacing = self.poll_spacing()
        longest = int(self.loop_ns.max()) + self.service_ns
        if longest > nanoseconds(spacing):
            raise ArgumentError(
                f"poll_period is {self.poll_period:g} s; a round of a loop takes "
                f"{longest / 1e9:g} s, so two polls can fall in one round"
            )
        response = can_response[self.message_of]
        box, offset = self.box_of, self.offset_ns
        converted, looped = self.convert_ns[box], self.loop_ns[box]
        receive = self.firmware.receive
        spread = int(self.frame_ns.min()) >= nanoseconds(receive)
        handling = receive if spread else receive * self.sender.size
        tables = []
        for channel, reader in enumerate(channels, start=1):
            own = box == reader
            terms = {
                "sampling_s": (np.where(own, converted, looped) - offset) / 1e9,
                "update_s": self.period_ns[box] / 1e9,
                "interrupt_s": np.where(own, 0, suspended[box]) / 1e9,
                "can_s": np.where(own, 0.0, response),
                "handling_s": np.where(own, 0.0, handling),
                "poll_s": spacing,
                # The silence after the request stands for the equal one after the response.
                "transaction_s": self.poll.shortest_timeout,
            }
            table = pd.DataFrame(
                {
                    "tag": [point.tag for point in self.points],
                    "box": [point.box for point in self.points],
                    "channel": channel,
                    **terms,
                }
            )
            table["worst_s"] = table[list(terms)].sum(axis=1)
            tables.append(table)
        first, last = tables[0], tables[-1]
        better = (first["worst_s"] <= last["worst_s"]).to_numpy()
        return pd.concat([first[better], last[~better]]).sort_index()

    def staleness_flag(self) -> StalenessFlag:
        r"""Return the longest time that a silent box goes unnoticed, if nothing else fails.

        .. math:: t_{after} = t_{stale} + t_{mark} + h + T + t_{response}

        with the time T from poll to poll. If the silent box is the polled one, the AMS first gets
        no response for :math:`t_{lost}`, retries included; :math:`T_{lost}` is the time from poll
        to poll including that time:

        .. math:: t_{after} \ge T + T_{lost} + t_{request} + t_{response}

        In the printed design any frame of a box restarts the timer that monitors it, so if a box
        dies within a round, values of the previous round stay valid. In the corrected design the
        AMS marks values by age.
        """
        if self.coding == "corrected":
            return StalenessFlag(self.age_limit, self.age_limit)
        transaction = float(self.worst_age()["transaction_s"].iloc[0])
        request = self.serial.frame_time(8)
        lost = max(self._in_vain(1 + self.retries, 1))
        healthy, hindered = self.poll_spacing(), self.poll_spacing(lost)
        pile = self.service_ns / 1e9 + self.firmware.receive * self.sender.size
        marked = self.stale_limit + self.firmware.mark + pile
        read = request + self.serial.t35
        after = healthy + max(marked, hindered + read) + transaction
        box = self.box_of
        served = self.service_ns * np.isin(box, self.ports)
        old = self.loop_ns[box] - self.offset_ns + self.period_ns[box] + served
        queued = self.can_response[self.message_of]
        return StalenessFlag(after, after + float((old / 1e9 + queued).max()))

    def switch_over(self) -> SwitchOver:
        """Return the delays caused by a lost channel, if the AMS polls one channel at a time.

        The paper measures 133 "us" from the loss of channel 1 to the request on channel 2. Read as
        milliseconds, this time consists of a request of 9.17 ms and a time-out of 123.8 ms. A
        response with all 99 points takes 232.6 ms, so such a time-out can only wait for the first
        character.
        """
        if self.polled == "both":
            raise ArgumentError("polled is 'both'; it must be 'one' for a switch-over")
        request = self.poll.line.frame_time(8)
        lost = (1 + self.retries) * (request + self.timeout)
        broken = max(self._in_vain(1 + self.retries, 1))
        answer = lost + self.poll.time
        # The channel is lost just after the last bit of a response, or just after the first bit.
        first = request + self.shortest_timeout
        loss = max(self.poll_spacing() + lost + self.serial.t35, broken + self.poll.time - first)
        return SwitchOver(lost, answer, loss, max(self._gaps(1)))

    def _in_vain(self, tries: int, broken: int) -> list[float]:
        """Return the possible total durations of `tries` failed tries on one channel [s].

        Up to `broken` of them end with a broken or damaged response, which the AMS notices when the
        whole response is due; the other tries get no response.
        """
        silent = self.poll.line.frame_time(8) + self.timeout
        damaged = range(min(tries, broken) + 1)
        return [n * self.poll.time + (tries - n) * silent for n in damaged]

    def _gaps(self, broken: int) -> tuple[float, float]:
        """Return the longest times between responses: when channel 1 fails, and afterwards [s].

        Up to `broken` tries per poll end with a broken response.
        """
        tries = 1 + self.retries
        full = self._in_vain(tries, broken)
        late = [0.0]
        if broken > 1:
            # A retry may be answered, and the next poll may fail again.
            late = [time for n in range(tries) for time in self._in_vain(n, broken)]
        before = max(self.poll_spacing(time) - time for time in late) + max(full)
        after = max(self.poll_spacing(time) - time for time in full)
        return before, max(after, self.poll_spacing())

    def _oldest_read(self, broken: int) -> float:
        """Return the greatest age shown as good when channel 1 fails, or afterwards [s]."""
        before, after = self._gaps(broken)
        healthy, ports = self.suspended_ns, np.isin(np.arange(len(self.boxes)), self.ports)
        # If a round of a loop takes longer than a poll, several requests can fall in one round.
        crowded = int(self.loop_ns.max()) + self.service_ns > nanoseconds(self.poll.time)
        times = 2 + self.retries if crowded else 1
        both = times * self.service_ns * ports.astype(np.int64)
        found = []
        cases = zip(self.ports, (times * healthy, both), (before, after), strict=True)
        for reader, suspended, gap in cases:
            response = self._can_response(self._messages(suspended))
            ages = self._ages((reader,), suspended, response)
            found.append(float((ages["worst_s"] - ages["poll_s"]).max()) + gap)
        return max(found)

    def failure_bounds(self, fault: EngineFault | None = None) -> FailureBounds:
        r"""Return the worst response times and ages, in any phase, with one fault or with none.

        If the channel in use fails, the AMS gets no response for :math:`t_{lost}`: it notices a
        broken response when the response should have ended, and the failure of each of r retries
        after its time-out.

        .. math:: t_{lost} = \max(t_{poll}, t_{silent}) + r \, t_{silent}

        .. math:: t_{gap} = T + t_{lost}, \qquad A' = A - T + t_{gap}

        where :math:`t_{silent}` is the time of a request and its time-out, T the time from poll to
        poll, and A the age from `worst_age`. If frames are damaged at random, each try may take
        :math:`t_{poll}`. When a failure on CAN begins, and again when it ends, the frames of one
        round are lost; A grows by one update period each time. A silent box has the bound of
        `staleness_flag`. In the printed design, lasting random losses on CAN leave A without a
        bound: any frame keeps all values of its box valid.
        """
        answer, gap = self.poll.time, self.poll_spacing()
        healthy = oldest = float(self.worst_age()["worst_s"].max())
        corrected = self.coding == "corrected"
        if corrected:
            healthy = min(healthy, self.age_limit)
        if fault is None:
            return FailureBounds(answer, gap, healthy)
        check_kind("fault", fault, EngineFault)
        self.check_faults(fault)
        lasts, period = fault.stop - fault.start, int(self.period_ns.max()) / 1e9
        place = self.boxes[0] if isinstance(fault, DeadBox) else "1"
        on_line = isinstance(fault, DeadBox | DeadPort | ModbusBreak | LostModbusFrames)
        if on_line and fault.where == place and self.polled == "one":
            broken = 1 + self.retries if isinstance(fault, LostModbusFrames) else 1
            answer += max(self._in_vain(1 + self.retries, broken))
            gap, oldest = max(self._gaps(broken)), self._oldest_read(broken)
        if isinstance(fault, StuckSensor):
            oldest = lasts + healthy
        elif corrected:
            oldest = self.age_limit
        elif isinstance(fault, LostCanFrames):
            # The polled box needs no CAN for its own values.
            oldest = healthy if fault.where == self.boxes[0] else lasts + period + healthy
        elif isinstance(fault, BusOff | CanBreak | DeadBox):
            # When a fault begins, and again when it ends, the frames of one round are lost.
            oldest += period * (1 if lasts == inf else 2)
            if not (isinstance(fault, CanBreak) and len(self.segments) == len(self.boxes)):
                oldest = max(oldest, self.staleness_flag().oldest)
        return FailureBounds(answer, gap, oldest)

    def timeout_for(self, time: float, *, retries: int = 0) -> float:
        """Return the time-out [s] with which a switch-over takes a given time [s]."""
        request = self.serial.frame_time(8)
        tries = 1 + check_whole("retries", retries, 0, 10)
        shortest = self.shortest_timeout
        low, high = (tries * (request + timeout) for timeout in (shortest, LONGEST))
        check_scalar("time", time, "s", low, high)
        # Rounding must not produce a time-out beyond either end of its range.
        return min(max(time / tries - request, shortest), LONGEST)

    # Failures

    @property
    def places(self) -> Mapping[str, tuple[str, ...]]:
        """The places where a fault can occur, keyed by the fault's attribute `at`."""
        return {
            "cable": self.segments,
            "channel": ("1", "2"),
            "box": self.boxes,
            "sensor": tuple(point.tag for point in self.points),
        }

    def check_faults(self, faults: Fault | Iterable[Fault]) -> tuple[EngineFault, ...]:
        """Return one or more faults as a tuple; raise ArgumentError if one has an unknown place."""
        found: list[EngineFault] = []
        places = self.places
        for fault in as_faults(faults, *KINDS, *WIRES.values()):
            assert isinstance(fault, EngineFault)
            legal = places[fault.at]
            if fault.where not in legal:
                few = [*legal[:6], *(["..."] if len(legal) > 6 else [])]
                raise ArgumentError(f"where is {fault.where!r}; it must be one of {', '.join(few)}")
            found.append(fault)
        return tuple(found)

    def single_faults(self, start: float = 10.0) -> tuple[EngineFault, ...]:
        """Return all lasting single faults, each beginning at `start` [s].

        They are the failure of each cable, port, box and CAN node, the loss of half the frames of
        each box and channel, and a fault that leaves the first sensor of each box stuck.
        """
        first = tuple(own[0].tag for own in self.points.by_box().values())
        places = {**self.places, "sensor": first}
        more: dict[type[EngineFault], dict[str, float]] = {LostModbusFrames: {"response": 0.5}}
        return tuple(
            kind(where, start=start, **more.get(kind, {}))
            for kind in KINDS
            for where in places[kind.at]
        )

    def plot(
        self, faults: EngineFault | Iterable[EngineFault] = (), ax: Axes | None = None
    ) -> Axes:
        """Draw boxes, CAN, both Modbus channels and the AMS, with faults in red."""
        from shipnet.engine.plot import plot_system

        box_of = {point.tag: point.box for point in self.points}
        failed = [(box_of.get(f.where, f.where), str(f)) for f in self.check_faults(faults)]
        counts = {box: len(own) for box, own in self.points.by_box().items()}
        ports = [self.boxes[port] for port in self.ports]
        return plot_system(counts, self.segments, ports, failed, ax=ax)
