"""The engine monitoring system: its settings, its parts, and the places of its faults."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from functools import cached_property
from typing import Any, Literal

import numpy as np

from shipnet.arrays import Floats, Integers
from shipnet.can.lengths import frame_length
from shipnet.can.messages import MessageSet
from shipnet.can.response import Assumptions, response_times
from shipnet.clock import Fault, as_faults, nanoseconds
from shipnet.engine import bounds
from shipnet.engine.can_layout import CanLayout
from shipnet.engine.faults import KINDS, WIRES, EngineFault, LostModbusFrames
from shipnet.engine.firmware import Firmware
from shipnet.engine.points import PointList, read_points
from shipnet.errors import ArgumentError
from shipnet.fields import (
    check_fields,
    check_scalar,
    check_whole,
    choice,
    number,
    part,
    record,
    whole,
)
from shipnet.lazy import Axes
from shipnet.modbus.pdu import Request
from shipnet.modbus.polling import Poll
from shipnet.modbus.uart import SerialLine

#: Longest response time permitted by the class rules that lee2012 quotes in section II [s].
RULE = 2.0

#: Longest period, time-out and limit of a system [s].
LONGEST = 100.0


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
        default_factory=read_points,
        make=PointList,
    )
    firmware: Firmware = part(
        Firmware, "Times within a box; all are assumed if not given", default_factory=Firmware
    )
    can_bit_rate: int = whole(
        10_000, 10**6, "bit/s", "Bit rate of CAN; not printed, assumed", default=125_000
    )
    update_period: float = number(
        0,
        LONGEST,
        "s",
        "Time from one round of a box's loop to the next; not printed, assumed. A loop that takes "
        "longer starts again at once, so 0 means no pauses",
        default=0.5,
    )
    topology: Literal["line", "ring"] = choice(("line", "ring"), "CAN topology", default="line")
    serial: SerialLine = part(
        SerialLine, "Both Modbus lines; 9600 bit/s, 8E1 if not given", default=SerialLine(9600)
    )
    poll_period: float = number(0.01, LONGEST, "s", "Time between polls", default=1.0)
    timeout: float = number(
        0, LONGEST, "s", "Time-out from the end of a request; not printed", default=0.1238
    )
    retries: int = whole(
        0, 10, "", "Retries of the AMS before it tries the other channel; assumed", default=0
    )
    polled: Literal["one", "both"] = choice(
        ("one", "both"),
        "Whether the AMS polls one channel, or always both, each through its own port",
        default="one",
    )
    coding: Literal["printed", "corrected"] = choice(
        ("printed", "corrected"), "How values that are too old are marked", default="printed"
    )
    stale_limit: float = number(
        0.01, LONGEST, "s", "Silence after which a box is marked in the printed coding", default=4.0
    )
    age_limit: float = number(
        0.01, LONGEST, "s", "Age above which the corrected coding marks a value", default=RULE
    )

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
        ages = self.sender.size if self.coding == "corrected" else 0
        return len(self.points) + ages

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

    @property
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
        # Switches are read at the end of the conversion.
        offsets = self.convert_ns[self.box_of]
        analogue = np.array([point.analogue for point in self.points])
        each = nanoseconds(self.firmware.input_time)
        for box in range(len(self.boxes)):
            inputs = np.flatnonzero(analogue & (self.box_of == box))
            offsets[inputs] = each * np.arange(inputs.size)
        offsets[analogue] += nanoseconds(self.firmware.sampling_time)
        return offsets

    @cached_property
    def convert_ns(self) -> Integers:
        """Time that each box takes to convert its inputs [ns], shape (n_boxes,)."""
        boxes = self.points.by_box().values()
        counts = [sum(point.analogue for point in points) for points in boxes]
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
        polled = self.ports if self.polled == "both" else self.ports[:1]
        return self.service_ns * np.isin(np.arange(len(self.boxes)), polled).astype(np.int64)

    @cached_property
    def period_ns(self) -> Integers:
        """Time from round to round of each box's loop [ns], shape (n_boxes,)."""
        reserved = self.loop_ns + self.service_ns * np.isin(np.arange(len(self.boxes)), self.ports)
        return np.asarray(np.maximum(nanoseconds(self.update_period), reserved))

    # Analytical bounds

    @cached_property
    def can_response(self) -> Floats:
        """Longest time from queueing a message to its last bit [s], highest priority first."""
        return self._can_response_with(self.suspended_ns)

    def _can_response_with(self, suspended: Integers) -> Floats:
        """Return `can_response` if Modbus polls add these times to the boxes' rounds [ns]."""
        # The receiver's interrupt comes at the end of the frame, so the intermission is left out.
        assumptions = Assumptions(own_jitter=False, intermission="between")
        responses = response_times(
            self._messages(suspended), self.can_bit_rate, assumptions=assumptions
        )
        if not all(response.met for response in responses):
            raise ArgumentError(
                f"can_bit_rate is {self.can_bit_rate} bit/s; frames must arrive within the update "
                f"period of {self.period_ns.max() / 1e9:g} s"
            )
        return np.array([response.response for response in responses])

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

    worst_age = bounds.worst_age
    staleness_flag = bounds.staleness_flag
    switch_over = bounds.switch_over
    failure_bounds = bounds.failure_bounds

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
        checked: tuple[Any, ...] = as_faults(faults, *KINDS, *WIRES.values())
        for fault in checked:
            legal = self.places[fault.at]
            if fault.where not in legal:
                few = ", ".join(legal[:6]) + (", ..." if len(legal) > 6 else "")
                raise ArgumentError(f"where is {fault.where!r}; it must be one of {few}")
        return checked

    def single_faults(self, start: float = 10.0) -> tuple[EngineFault, ...]:
        """Return all lasting single faults, each beginning at `start` [s].

        They are the failure of each cable, port, box and CAN node, the loss of half the frames of
        each box and channel, and a fault that leaves the first sensor of each box stuck.
        """
        first = tuple(points[0].tag for points in self.points.by_box().values())
        places = {**self.places, "sensor": first}
        faults = (kind(where, start=start) for kind in KINDS for where in places[kind.at])
        return tuple(
            replace(fault, response=0.5) if isinstance(fault, LostModbusFrames) else fault
            for fault in faults
        )

    def plot(
        self, faults: EngineFault | Iterable[EngineFault] = (), ax: Axes | None = None
    ) -> Axes:
        """Draw boxes, CAN, both Modbus channels and the AMS, with faults in red."""
        from shipnet.engine.plot import plot_system

        box_of = {point.tag: point.box for point in self.points}
        failed = [(box_of.get(f.where, f.where), str(f)) for f in self.check_faults(faults)]
        counts = {box: len(points) for box, points in self.points.by_box().items()}
        ports = [self.boxes[port] for port in self.ports]
        return plot_system(counts, self.segments, ports, failed, ax=ax)
