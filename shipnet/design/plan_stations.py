"""Planning of CAN and Modbus RTU: stations in boxes, and trunks that meet all update times."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import lru_cache
from math import inf
from operator import attrgetter
from typing import NamedTuple

import numpy as np

from shipnet.arrays import Floats, Indices
from shipnet.can.bit_timing import longest_bus
from shipnet.can.lengths import frame_length
from shipnet.can.messages import Message, MessageSet, packed
from shipnet.can.response import response_times
from shipnet.design.catalogue import cables
from shipnet.design.drafting import Backbone, Box, Draft, boxes, divided, lay, route_past
from shipnet.design.settings import ModbusLimits
from shipnet.modbus.electrical import INTERFACES
from shipnet.modbus.pdu import Request
from shipnet.modbus.polling import Poll
from shipnet.modbus.uart import SerialLine

# Shared by both buses ----------------------------------------------------------------------------


def _served(
    draft: Draft,
    rows: Indices,
    longest: float,
    most: str,
    alone: Callable[[Box, float], tuple[Floats, str]],
    prefix: str,
) -> list[Box]:
    """Return boxes of the points that a separate trunk can serve; record why others do not fit.

    `alone` returns the shortest update time or response [s] of each point in a box that has a trunk
    of a given length [m] to itself, and a phrase for the reason.
    """
    served = []
    for box in boxes(draft, rows, prefix):
        length = route_past(draft, [box]).length
        if length > longest:
            for row in box.rows:
                text = f"{draft.tags[row]} needs {length:.0f} m of trunk; {most}"
                draft.reason(draft.tags[row], "length", length, longest, "m", text)
            continue
        need = draft.need[box.rows]
        least, words = alone(box, length)
        for index in np.flatnonzero(least > need):
            draft.too_slow(box.rows[index], float(least[index]), words)
        if (least <= need).any():
            served.append(box.part(np.flatnonzero(least <= need)))
    return served


#: Position and kept segment of a box.
place_of, segment_of = attrgetter("place"), attrgetter("segment")


# CAN: messages, and segments that carry them in time --------------------------------------------

#: Bits per analogue value, and data bits per frame.
ANALOGUE_BITS, FRAME_BITS = 16, 64

#: Maximum number of messages per segment, one per 11-bit identifier except the last 16, which early
#: CAN controllers cannot send.
_MESSAGES = 2**11 - 16


class Packed(NamedTuple):
    """A CAN message with its points."""

    output: bool
    need: float
    rows: Indices
    bits: Indices
    dlc: int


def pack(types: Sequence[str], times: Floats) -> list[Packed]:
    """Pack the points of a station into as few messages as possible."""
    kinds = np.asarray(types, dtype=object)
    output = np.isin(kinds, ["DO", "AO"])
    analogue = np.isin(kinds, ["AI", "AO"])
    messages = []
    for way in (False, True):
        for time in np.unique(times[output == way]):
            rows = np.flatnonzero((output == way) & (times == time))
            # Values come first, four per frame, so that none is split between frames; then states.
            first, size = packed(analogue[rows], ANALOGUE_BITS)
            frame, bit = np.divmod(first, FRAME_BITS)
            for number in range(-(-8 * size // FRAME_BITS)):
                inside = frame == number
                dlc = min(8, size - 8 * number)
                messages.append(Packed(way, float(time), rows[inside], bit[inside], dlc))
    return messages


class _Segment(NamedTuple):
    """A segment, with the station and the response [s] of each message in order of priority."""

    trunk: Backbone
    bit_rate: int
    messages: list[tuple[Packed, int, float]]
    bus_time: float


def plan_can(draft: Draft, rows: Indices, *, doubled: bool = False) -> None:
    """Connect points to stations in their boxes, on as few CAN segments as the limits allow."""
    limits = draft.settings.can
    slowest = min(limits.bit_rates)
    longest = min(max(map(longest_bus, limits.bit_rates)), cables()[limits.cable].longest_m)
    most = f"a CAN segment may have at most {longest:.0f} m at {slowest / 1e3:g} kbit/s"

    def alone(box: Box, length: float) -> tuple[Floats, str]:
        rate = bit_rate_for(length, limits.bit_rates) or slowest
        size = np.array([2 if draft.types[row][0] == "A" else 1 for row in box.rows])
        # The frame must meet its deadline, and must not load the bus above its limit.
        share = min(1 - limits.period_share, limits.period_share * limits.load)
        words = f"even on its own CAN line at {rate / 1e3:g} kbit/s, it gets one every"
        return frame_length(size) / rate / share, words

    def judge(group: Sequence[Box]) -> tuple[_Segment | None, float]:
        # The host is a node of each segment.
        if len(group) >= limits.nodes:
            return None, len(group) / (limits.nodes - 1)
        return _segment(draft, group, longest)

    stations = _served(draft, rows, longest, most, alone, "CAN ")
    segments = divided(stations, place_of, judge, lambda box: box.halved(draft.need), segment_of)
    for number, (group, segment) in enumerate(segments, 1 + draft.segments("CAN")):
        assert segment is not None
        name, order = f"CAN {number}", segment.trunk.order
        ordered = [group[at] for at in order]
        names = lay(draft, name, "CAN", ordered, segment.trunk, limits.cable, (), doubled)
        device = dict(zip(order, names, strict=True))
        for identifier, (message, station, late) in enumerate(segment.messages, 1):
            for row, bit in zip(message.rows, message.bits, strict=True):
                point, address = int(group[station].rows[row]), f"{identifier:#05x} bit {bit}"
                response = message.need * limits.period_share + late
                draft.connect(point, "CAN", name, device[station], address, response)
        for station, box in enumerate(group):
            for row, length in zip(box.rows, box.lengths, strict=True):
                draft.drop(int(row), device[station], box.place, name, float(length))
        draft.segment(
            np.concatenate([box.rows for box in group]),
            segment=name,
            bus="CAN",
            devices=len(group) + 1,
            length_m=segment.trunk.length,
            bus_time=segment.bus_time,
            capacity_used=max(segment.bus_time, (len(group) + 1) / limits.nodes),
            bit_rate=segment.bit_rate,
            messages=len(segment.messages),
            # Every message is sent on both lines, so no change-over is needed.
            switch_over_ms=0.0 if doubled else np.nan,
        )


def bit_rate_for(length: float, bit_rates: Sequence[int]) -> int | None:
    """Return the highest of `bit_rates` that a trunk length [m] allows; None if there is none."""
    return max((rate for rate in bit_rates if longest_bus(rate) >= length), default=None)


def _segment(draft: Draft, group: Sequence[Box], longest: float) -> tuple[_Segment, float]:
    limits = draft.settings.can
    share, trunk = limits.period_share, route_past(draft, group)
    rate = bit_rate_for(min(trunk.length, longest), limits.bit_rates) or min(limits.bit_rates)
    packed = [
        (message, index)
        for index, box in enumerate(group)
        for message in pack([draft.types[row] for row in box.rows], draft.need[box.rows])
    ]
    # Deadline-monotonic priorities: each deadline is the same fraction of the required time.
    packed.sort(key=lambda item: item[0].need)
    period = np.array([message.need for message, _ in packed]) * share
    bus_time = float((frame_length([message.dlc for message, _ in packed]) / period).sum()) / rate
    parts = max(
        len(packed) / _MESSAGES, bus_time / limits.load, inf if trunk.length > longest else 1
    )
    responses = [np.nan] * len(packed)
    if parts <= 1:
        messages = MessageSet(
            Message(
                str(number),
                number,
                message.dlc,
                period=share * message.need,
                deadline=(1 - share) * message.need,
                sender=str(index),
            )
            for number, (message, index) in enumerate(packed, 1)
        )
        answers = response_times(messages, rate)
        responses = [answer.response for answer in answers]
        if not all(answer.met for answer in answers):
            parts = inf
    sent = [(*item, late) for item, late in zip(packed, responses, strict=True)]
    return _Segment(trunk, rate, sent, bus_time), parts


# Modbus RTU: registers, loops that are scanned in time, unit ids, repeaters -----------------------

#: States per register, and maximum number of registers per read and per write ("MODBUS application
#: protocol" V1.1b3, sections 6.4 and 6.12).
_STATES, _READ, _WRITE = 16, 125, 123


class _Loop(NamedTuple):
    """A loop; `on_wire` is the time per scan during which frames are on the wire [s].

    `longest` contains the duration of the longest transaction of each station [s].
    """

    trunk: Backbone
    bit_rate: int
    scan: float
    on_wire: float
    longest: list[float]
    switch_over: float
    repeaters: list[int]


def plan_modbus(draft: Draft, rows: Indices, *, doubled: bool = False) -> None:
    """Connect points to stations in their boxes, on as few Modbus loops as the limits allow."""
    limits = draft.settings.modbus

    def alone(box: Box, length: float) -> tuple[Floats, str]:
        rate = max(rate for rate in limits.bit_rates if _longest_section(limits, rate) >= length)
        types = [draft.types[row] for row in box.rows]
        least = {kind: 2 * _polls(limits, (kind,), rate)[0].time for kind in set(types)}
        words = f"even on its own Modbus RTU line at {rate} bit/s, its response takes"
        return np.array([least[kind] for kind in types]), words

    longest = _longest_section(limits, min(limits.bit_rates))
    most_m = f"a Modbus section may have at most {longest:.0f} m"
    stations = _served(draft, rows, longest, most_m, alone, "Modbus ")
    # The master is one unit load, and a repeater is one unit load on each side.
    most = min(limits.units, (1 + limits.repeaters) * (limits.unit_loads - 2) + 1)

    def judge(group: Sequence[Box]) -> tuple[_Loop | None, float]:
        return _loop(draft, group) if len(group) <= most else (None, len(group) / most)

    loops = divided(stations, place_of, judge, lambda box: box.halved(draft.need), segment_of)
    for number, (group, loop) in enumerate(loops, 1 + draft.segments("Modbus RTU")):
        assert loop is not None
        name, order = f"Modbus {number}", loop.trunk.order
        ordered = [group[index] for index in order]
        names = lay(
            draft, name, "Modbus", ordered, loop.trunk, limits.cable, loop.repeaters, doubled
        )
        for unit, (index, device) in enumerate(zip(order, names, strict=True), 1):
            box = group[index]
            addresses = registers_of([draft.types[row] for row in box.rows])[0]
            response = loop.scan + loop.longest[index]
            for row, length, where in zip(box.rows, box.lengths, addresses, strict=True):
                draft.connect(int(row), "Modbus RTU", name, device, f"{unit} {where}", response)
                draft.drop(int(row), device, box.place, name, float(length))
        everything = np.concatenate([box.rows for box in group])
        draft.segment(
            everything,
            segment=name,
            bus="Modbus RTU",
            devices=len(group) + 1 + len(loop.repeaters),
            length_m=loop.trunk.length,
            bus_time=loop.on_wire / loop.scan,
            capacity_used=max(loop.scan / draft.need[everything].min(), len(group) / most),
            bit_rate=loop.bit_rate,
            scan_ms=1e3 * loop.scan,
            repeaters=len(loop.repeaters),
            switch_over_ms=1e3 * loop.switch_over if doubled else np.nan,
        )


def registers_of(types: Sequence[str]) -> tuple[list[str], list[Request]]:
    """Return the register address of each point of a station, and the requests of a scan."""
    kinds = np.asarray(types, dtype=object)
    addresses = np.full(len(kinds), "", dtype=object)
    numbers = []
    for analogue, digital, what in (("AI", "DI", "input"), ("AO", "DO", "holding")):
        values, states = np.flatnonzero(kinds == analogue), np.flatnonzero(kinds == digital)
        for number, index in enumerate(values):
            addresses[index] = f"{what} register {number}"
        for number, index in enumerate(states):
            register = len(values) + number // _STATES
            addresses[index] = f"{what} register {register} bit {number % _STATES}"
        numbers.append(len(values) + -(-len(states) // _STATES))
    inputs, outputs = numbers
    requests: list[Request] = [
        Request.read_input_registers(start, min(_READ, inputs - start))
        for start in range(0, inputs, _READ)
    ]
    requests += [
        Request.write_multiple_registers(start, (0,) * min(_WRITE, outputs - start))
        for start in range(0, outputs, _WRITE)
    ]
    return addresses.tolist(), requests


def sections(hops: Sequence[float], *, length: float, unit_loads: int) -> list[int] | None:
    """Return the stations after which a trunk needs a repeater, or None if a hop is too long."""
    repeaters: list[int] = []
    loads, laid = 1, 0.0
    for index, hop in enumerate(hops):
        if hop > length:
            return None
        # Leave room for a repeater unless this is the last station.
        last = index == len(hops) - 1
        if laid + hop > length or loads + 1 > unit_loads - (not last):
            repeaters.append(index - 1)
            loads, laid = 1, 0.0
        loads, laid = loads + 1, laid + hop
    return repeaters


def _loop(draft: Draft, group: Sequence[Box]) -> tuple[_Loop, float]:
    limits = draft.settings.modbus
    trunk = route_past(draft, group)
    types = [tuple(draft.types[row] for row in box.rows) for box in group]
    needs = np.array([draft.need[box.rows].min() for box in group])
    for rate in sorted(limits.bit_rates):
        polls = [_polls(limits, station, rate) for station in types]
        times = [[poll.time for poll in station] for station in polls]
        scan = sum(sum(station) for station in times)
        longest = [max(station) for station in times]
        in_time = bool((scan + np.array(longest) <= needs).all())
        if in_time:
            break
    # A higher bit rate would not help, because it does not allow longer sections.
    length = _longest_section(limits, rate)
    repeaters = sections(trunk.hops.tolist(), length=length, unit_loads=limits.unit_loads)
    fits = in_time and repeaters is not None and len(repeaters) <= limits.repeaters
    switch_over = scan + sum(max(poll.timeout_time for poll in station) for station in polls)
    on_wire = sum(poll.on_wire for station in polls for poll in station)
    loop = _Loop(trunk, rate, scan, on_wire, longest, switch_over, repeaters or [])
    return loop, 1 if fits else inf


def _longest_section(limits: ModbusLimits, bit_rate: int) -> float:
    """Return the maximum length of cable between ends or repeaters at a bit rate [m]."""
    return min(limits.length, INTERFACES["RS-485"].product / bit_rate)


@lru_cache(4096)
def _polls(limits: ModbusLimits, types: tuple[str, ...], bit_rate: int) -> list[Poll]:
    """Return the requests to a station with points of these types."""
    serial = SerialLine(bit_rate, limits.character)
    timeout = limits.timeout + limits.processing + serial.frame_time(256)
    return [
        Poll(request, serial, processing=limits.processing, timeout=timeout)
        for request in registers_of(types)[1]
    ]
