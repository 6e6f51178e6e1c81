"""The engine monitoring system as a whole: boxes, CAN between them, two Modbus channels, AMS."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from shipnet.can.schedule import MessageSet, frame_bits
from shipnet.clock import nanoseconds
from shipnet.engine.can_messages import CanLayout
from shipnet.engine.firmware import Firmware
from shipnet.engine.points import Point, by_box, check_points, load_points
from shipnet.errors import ArgumentError
from shipnet.fields import check_scalar, check_whole
from shipnet.modbus.pdu import Request
from shipnet.modbus.polling import Poll
from shipnet.modbus.uart import SerialLine

__all__ = ["LONGEST", "RULE", "System"]

Integers = npt.NDArray[np.int64]

#: What lee2012 quotes from the class rules, section II: a response takes 2 s at most [s].
RULE = 2.0

#: Longest period, time-out and limit of a system [s].
LONGEST = 100.0

#: Clocks from the start of a conversion until the input is sampled; Atmel, AT90CAN128 data sheet.
_HOLD = 1.5

_CHOICES = {
    "topology": ("line", "ring"),
    "switch_rule": ("stay", "return"),
    "polled": ("one", "both"),
    "coding": ("printed", "mended"),
}


@dataclass(frozen=True)
class System:
    """An engine monitoring system; as it stands, the one of lee2012.

    Parameters
    ----------
    points : tuple of Point, optional
        What is measured, in two or more boxes; those of the paper if not given. The first box
        answers on Modbus channel 1, the last on channel 2.
    firmware : Firmware, optional
        Times within a box, all assumed.
    can_bit_rate : int, default 125000
        10000..1000000 [bit/s]; not printed, **assumed**.
    update_period : float, default 0.5
        From one round of a box's loop to the next, 0..100 [s]; not printed, **assumed**. A loop
        that takes longer begins again at once, so 0 is a loop that never rests.
    topology : {"line", "ring"}, default "line"
        CAN as a line of boxes, or closed to a ring, as figure 3 may be read. A ring is no bus of
        ISO 11898; here it is one that works.
    serial : SerialLine, default 9600 bit/s, 8E1
        Both Modbus lines.
    poll_period : float, default 1
        From poll to poll, 0.01..100 [s].
    timeout : float, default 0.1238
        How long the AMS waits from the end of a request for the *first* character of the
        response, up to 100 [s]. Not printed: `switch_over` says where the default comes from.
    retries : int, default 0
        How many more times the AMS asks before it tries the other channel, 0..10. Assumed.
    switch_rule : {"stay", "return"}, default "stay"
        Whether the AMS stays on the channel that answered last, or begins every poll with
        channel 1 again. Assumed.
    polled : {"one", "both"}, default "one"
        Whether the AMS asks on one channel, or always on both, each at its own port.
    coding : {"printed", "mended"}, default "printed"
        ``"printed"``: a box marks all values of a box that it has not heard for `stale_limit`, as
        0xFF. ``"mended"``: it sends the age of every frame along, one register each, and the AMS
        marks each value that may be older than `age_limit`.
    stale_limit : float, default 4
        0.01..100 [s].
    age_limit : float, default 2
        0.01..100 [s]; without use in the printed coding.

    Raises
    ------
    ArgumentError
        If a field is out of its range, or they do not fit each other.

    References
    ----------
    .. [1] J. H. Lee, D. S. Kim, "Design and implementation of distributed control system based on
       dual field-bus for ship engine", J. IEEK 49-SC(2), 2012.

    Examples
    --------
    >>> system = System()
    >>> system.boxes, len(system.points), system.registers
    (('JB1', 'JB2', 'JB3'), 99, 99)
    >>> round(system.poll.time * 1e3, 1), System.mended().registers
    (254.8, 121)
    """

    points: tuple[Point, ...] = field(default_factory=load_points)
    firmware: Firmware = field(default_factory=Firmware)
    can_bit_rate: int = 125_000
    update_period: float = 0.5
    topology: Literal["line", "ring"] = "line"
    serial: SerialLine = field(default_factory=lambda: SerialLine(9600))
    poll_period: float = 1.0
    timeout: float = 0.1238
    retries: int = 0
    switch_rule: Literal["stay", "return"] = "stay"
    polled: Literal["one", "both"] = "one"
    coding: Literal["printed", "mended"] = "printed"
    stale_limit: float = 4.0
    age_limit: float = RULE

    def __post_init__(self) -> None:
        """Check every field."""
        object.__setattr__(self, "points", check_points(self.points))
        for name, kind in (("firmware", Firmware), ("serial", SerialLine)):
            if not isinstance(getattr(self, name), kind):
                raise ArgumentError(
                    f"{name} is {getattr(self, name)!r}; it must be of class {kind.__name__}"
                )
        check_whole("can_bit_rate", self.can_bit_rate, 10_000, 10**6, " bit/s")
        check_whole("retries", self.retries, 0, 10)
        shortest = self.serial.t35 + self.firmware.processing
        limits = {
            "update_period": 0.0,
            "poll_period": 0.01,
            "timeout": shortest,
            "stale_limit": 0.01,
            "age_limit": 0.01,
        }
        for name, low in limits.items():
            value = check_scalar(name, getattr(self, name), "s", low, LONGEST)
            object.__setattr__(self, name, value)
        for name, legal in _CHOICES.items():
            if getattr(self, name) not in legal:
                raise ArgumentError(
                    f"{name} is {getattr(self, name)!r}; it must be {' or '.join(legal)}"
                )
        if not 2 <= len(self.boxes) <= 7:
            raise ArgumentError(f"points lie in {len(self.boxes)} boxes; it must be 2..7")
        if self.polled == "both" and self.coding == "printed":
            raise ArgumentError(
                "polled is 'both' with coding 'printed'; without ages the AMS cannot tell which "
                "of two values is the newer: it must be one, or the coding mended"
            )
        check_whole("registers", self.registers, 1, 125, " of one request")
        if self.polled == "both" and self.poll.time > self.poll_period:
            raise ArgumentError(
                f"poll_period is {self.poll_period:g} s; a poll takes {self.poll.time:g} s"
            )

    @classmethod
    def mended(cls, **changes: Any) -> System:
        """Return a system of the same hardware that keeps the 2 s rule for the age of its data.

        Parameters
        ----------
        **changes
            Fields that shall differ from the mended design: mended coding, both channels polled,
            an update every 0.25 s.
        """
        fields: dict[str, Any] = {"coding": "mended", "polled": "both", "update_period": 0.25}
        return cls(**{**fields, **changes})

    @cached_property
    def boxes(self) -> tuple[str, ...]:
        """Boxes, in the order in which CAN joins them."""
        return tuple(by_box(self.points))

    @property
    def ports(self) -> tuple[int, int]:
        """Number of the box that answers on channel 1, and on channel 2."""
        return 0, len(self.boxes) - 1

    @property
    def segments(self) -> tuple[str, ...]:
        """CAN cables, named by both ends."""
        ends = list(zip(self.boxes, self.boxes[1:], strict=False))
        if self.topology == "ring" and len(self.boxes) > 2:
            ends.append((self.boxes[-1], self.boxes[0]))
        return tuple(f"{a}-{b}" for a, b in ends)

    @cached_property
    def registers(self) -> int:
        """Registers of a response: one a point, and in the mended coding one age a frame."""
        ages = len(self._layout.messages()) if self.coding == "mended" else 0
        return len(self.points) + ages

    @cached_property
    def poll(self) -> Poll:
        """The transaction that reads all registers."""
        request = Request.read_holding_registers(0, self.registers)
        processing = self.firmware.processing
        return Poll(request, self.serial, processing=processing, timeout=3600)

    @cached_property
    def _layout(self) -> CanLayout:
        return CanLayout(self.points)

    @cached_property
    def messages(self) -> MessageSet:
        """CAN messages, the highest priority first; jitter is what Modbus delays their box."""
        periods = dict(zip(self.boxes, self.period_ns.tolist(), strict=True))
        delays = dict(zip(self.boxes, self.suspended_ns.tolist(), strict=True))
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
        """Number of the box that sends each message, shape (n_messages,)."""
        senders = [self.boxes.index(m.sender) for m in self._layout.messages()]
        return np.array(senders, dtype=np.int64)

    @cached_property
    def frame_ns(self) -> Integers:
        """Longest time of each message on the bus, intermission included [ns]."""
        bits = frame_bits([m.dlc for m in self._layout.messages()])
        return np.rint(bits * 1e9 / self.can_bit_rate).astype(np.int64)

    @cached_property
    def message_of(self) -> Integers:
        """Number of the message that each point lies in, shape (n_points,)."""
        names = self._layout.messages().names
        rows = self._layout.table()["message"]
        return np.array([names.index(name) for name in rows], dtype=np.int64)

    @cached_property
    def box_of(self) -> Integers:
        """Number of the box of each point, shape (n_points,)."""
        return self.sender[self.message_of]

    @cached_property
    def offset_ns(self) -> Integers:
        """When each point is sampled, from the start of its box's round [ns], shape (n_points,)."""
        offsets = np.zeros(len(self.points), dtype=np.int64)
        inputs = [0] * len(self.boxes)
        hold = nanoseconds(self.firmware.settling + _HOLD / self.firmware.adc_clock)
        for place, (point, box) in enumerate(zip(self.points, self.box_of.tolist(), strict=True)):
            if point.analogue:
                offsets[place] = inputs[box] * self._input_ns + hold
                inputs[box] += 1
            else:
                offsets[place] = self.convert_ns[box]
        return offsets

    @property
    def _input_ns(self) -> int:
        return nanoseconds(self.firmware.input_time)

    @cached_property
    def convert_ns(self) -> Integers:
        """How long the inputs of each box take [ns], shape (n_boxes,)."""
        own = by_box(self.points)
        counts = [sum(point.analogue for point in own[box]) for box in self.boxes]
        return self._input_ns * np.array(counts, dtype=np.int64)

    @cached_property
    def loop_ns(self) -> Integers:
        """How long a round of each box's loop takes without interrupts [ns], shape (n_boxes,)."""
        frames = np.bincount(self.sender, minlength=len(self.boxes))
        return np.asarray(self.convert_ns + nanoseconds(self.firmware.send) * frames)

    @property
    def service_ns(self) -> int:
        """How long the Modbus interrupt takes [ns]."""
        response = self.serial.frame_time(5 + 2 * self.registers) * self.firmware.holds_cpu
        return nanoseconds(self.firmware.processing + response)

    @cached_property
    def suspended_ns(self) -> Integers:
        """What Modbus polls may add to a round of each box, in health [ns], shape (n_boxes,)."""
        asked = self.ports if self.polled == "both" else self.ports[:1]
        return self.service_ns * np.isin(np.arange(len(self.boxes)), asked).astype(np.int64)

    @cached_property
    def period_ns(self) -> Integers:
        """From round to round of each box's loop [ns], shape (n_boxes,)."""
        reserved = self.loop_ns + self.service_ns * np.isin(np.arange(len(self.boxes)), self.ports)
        return np.asarray(np.maximum(nanoseconds(self.update_period), reserved))
