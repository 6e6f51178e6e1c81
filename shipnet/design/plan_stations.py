"""Points on CAN and on Modbus RTU: stations in their boxes, and trunks that serve them in time."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import inf
from typing import NamedTuple

import numpy as np

from shipnet.arrays import Floats, Indices
from shipnet.can.bit_timing import longest_bus
from shipnet.can.lengths import frame_length
from shipnet.can.messages import Message, MessageSet, packed
from shipnet.can.response import response_times
from shipnet.design.catalogue import cables
from shipnet.design.drafting import (
    Backbone,
    Box,
    Draft,
    boxes,
    divided,
    lay,
    route_past,
    too_far,
)
from shipnet.design.settings import ModbusLimits
from shipnet.modbus.electrical import INTERFACES
from shipnet.modbus.pdu import Request
from shipnet.modbus.polling import Poll
from shipnet.modbus.uart import SerialLine

# What both have in common ------------------------------------------------------------------------


def _served(
    draft: Draft,
    rows: Indices,
    longest: float,
    most: str,
    alone: Callable[[Box, float], tuple[Floats, str]],
) -> list[Box]:
    """Return boxes with the points that a trunk of their own would serve; refuse the others.

    `alone` returns how late each point of a box would be, for a trunk of some length, in words too.
    """
    found = []
    for box in boxes(draft, rows):
        length = route_past(draft, [box]).length
        if length > longest:
            too_far(draft, box, length, longest, most)
            continue
        need = draft.need[box.rows]
        least, words = alone(box, length)
        for row, late in zip(box.rows[least > need], 1e3 * least[least > need], strict=True):
            tag, wanted = draft.tags[row], 1e3 * float(draft.need[row])
            text = f"{tag} needs an update every {wanted:g} ms; {words} {late:.3g} ms"
            draft.reason(tag, "update", late, wanted, "ms", text)
        kept = np.flatnonzero(least <= need)
        if len(kept):
            found.append(box.part(kept))
    return found


# CAN: messages, and segments that carry them in time --------------------------------------------

#: What a value takes, and what a frame has for data [bit].
ANALOGUE_BITS, FRAME_BITS = 16, 64


class Packed(NamedTuple):
    """A message with its points."""

    output: bool
    need: float
    rows: Indices
    bits: Indices
    dlc: int


def pack(types: Sequence[str], times: Floats) -> list[Packed]:
    """Return the messages of a station, as few as there can be."""
    kinds = np.asarray(types, dtype=object)
    output = np.isin(kinds, ["DO", "AO"])
    analogue = np.isin(kinds, ["AI", "AO"])
    messages = []
    for way in (False, True):
        for time in np.unique(times[output == way]):
            rows = np.flatnonzero((output == way) & (times == time))
            # Values fill whole frames, so none lies in two; the states follow in the last one.
            first, size = packed(analogue[rows], ANALOGUE_BITS)
            frame, bit = np.divmod(first, FRAME_BITS)
            for number in range(-(-8 * size // FRAME_BITS)):
                inside = frame == number
                dlc = min(8, size - 8 * number)
                messages.append(Packed(way, float(time), rows[inside], bit[inside], dlc))
    return messages


#: Most messages of a segment: the identifiers of 11 bits but for the last 16, which early CAN
#: controllers cannot send.
_MESSAGES = 2**11 - 16


class Sent(NamedTuple):
    """Where a message comes from, and how it fares."""

    station: int
    arbitration_id: int
    response: float


class _Segment(NamedTuple):
    """A segment: its trunk, its bit rate, its messages with how they fare, its bus time."""

    trunk: Backbone
    bit_rate: int
    messages: list[tuple[Packed, Sent]]
    bus_time: float


def plan_can(draft: Draft, rows: Indices) -> None:
    """Connect points by stations in their boxes, on as few CAN segments as keep the limits."""
    limits = draft.settings.can
    longest = _longest(draft)
    most = f"a CAN segment has at most {{:.0f}} m at {min(limits.bit_rates) / 1e3:g} kbit/s"

    def alone(box: Box, length: float) -> tuple[Floats, str]:
        rate = bit_rate_for(length, limits.bit_rates) or min(limits.bit_rates)
        size = np.array([2 if draft.types[row][0] == "A" else 1 for row in box.rows])
        # The frame has to arrive in what its period leaves, and must not be more than the load
        # allows.
        share = min(1 - limits.period_share, limits.period_share * limits.load)
        words = f"alone on CAN at {rate / 1e3:g} kbit/s it has one every"
        return frame_length(size) / rate / share, words

    stations = _served(draft, rows, longest, most, alone)

    def judge(group: Sequence[Box]) -> tuple[_Segment | None, float]:
        # The host is a node of each segment.
        if len(group) >= limits.nodes:
            return None, len(group) / (limits.nodes - 1)
        return _segment(draft, group)

    segments = divided(stations, lambda box: box.place, judge, lambda box: box.halved(draft.need))
    for number, (group, segment) in enumerate(segments, 1):
        assert segment is not None
        name = f"CAN {number}"
        ordered = [group[place] for place in segment.trunk.order]
        names = lay(draft, name, "CAN", ordered, segment.trunk, limits.cable)
        devices = {id(box): device for box, device in zip(ordered, names, strict=True)}
        for message, sent in segment.messages:
            box = group[sent.station]
            for row, bit in zip(message.rows, message.bits, strict=True):
                point = int(box.rows[row])
                address = f"{sent.arbitration_id:#05x} bit {bit}"
                response = message.need * limits.period_share + sent.response
                draft.connect(point, "CAN", name, devices[id(box)], address, response)
        for box in group:
            for row, length in zip(box.rows, box.lengths, strict=True):
                draft.drop(int(row), devices[id(box)], box.place, name, float(length))
        everything = np.concatenate([box.rows for box in group])
        draft.segment(
            everything, segment=name, bus="CAN", devices=len(group) + 1,
            length_m=segment.trunk.length, bus_time=segment.bus_time,
            capacity_used=max(segment.bus_time, (len(group) + 1) / limits.nodes),
            bit_rate=segment.bit_rate, messages=len(segment.messages),
            # Every message goes out on both lines, so that none has to take over.
            switch_over_ms=0.0 if draft.settings.redundant else np.nan,
        )  # fmt: skip


def bit_rate_for(length: float, bit_rates: Sequence[int]) -> int | None:
    """Return the highest bit rate that a trunk is short enough for."""
    reaching = [rate for rate in bit_rates if longest_bus(rate) >= length]
    return max(reaching, default=None)


def _longest(draft: Draft) -> float:
    """Return the longest trunk that any of the bit rates, and the cable, allow [m]."""
    limits = draft.settings.can
    return min(max(map(longest_bus, limits.bit_rates)), cables()[limits.cable].longest_m)


def _segment(draft: Draft, group: Sequence[Box]) -> tuple[_Segment, float]:
    limits = draft.settings.can
    trunk = route_past(draft, group)
    longest = _longest(draft)
    rate = bit_rate_for(min(trunk.length, longest), limits.bit_rates) or min(limits.bit_rates)
    packed = [
        (message, place)
        for place, box in enumerate(group)
        for message in pack([draft.types[row] for row in box.rows], draft.need[box.rows])
    ]
    # Priorities are deadline monotonic: the deadline is the same share of every need.
    packed.sort(key=lambda item: item[0].need)
    parts: float = len(packed) / _MESSAGES
    period = np.array([message.need for message, _ in packed]) * limits.period_share
    bits = frame_length([message.dlc for message, _ in packed])
    bus_time = float((bits / period).sum()) / rate
    parts = max(parts, bus_time / limits.load, inf if trunk.length > longest else 1)
    responses = [np.nan] * len(packed)
    if parts <= 1:
        answers = response_times(_message_set(packed, limits.period_share), rate)
        responses = [answer.response for answer in answers]
        if not all(answer.met for answer in answers):
            parts = inf
    messages = [
        (message, Sent(place, number, response))
        for number, ((message, place), response) in enumerate(
            zip(packed, responses, strict=True), 1
        )
    ]
    return _Segment(trunk, rate, messages, bus_time), parts


def _message_set(packed: Sequence[tuple[Packed, int]], share: float) -> MessageSet:
    return MessageSet(
        Message(
            str(number), number, message.dlc, period=share * message.need,
            deadline=(1 - share) * message.need, sender=str(place),
        )
        for number, (message, place) in enumerate(packed, 1)
    )  # fmt: skip


# Modbus RTU: registers, loops that are scanned in time, unit ids, repeaters -----------------------

#: States in a register, and most registers of a read and of a write ("MODBUS application protocol"
#: V1.1b3, sections 6.4 and 6.12).
_STATES, _READ, _WRITE = 16, 125, 123


class Registers(NamedTuple):
    """The registers of a station."""

    inputs: int
    outputs: int
    addresses: list[str]
    requests: list[Request]


class _Loop(NamedTuple):
    """A loop: trunk, bit rate, scan, longest transactions, time to the second line, repeaters.

    `on_wire` is the part of the scan in which a frame is on the wire [s].
    """

    trunk: Backbone
    bit_rate: int
    scan: float
    on_wire: float
    longest: list[float]
    switch_over: float
    repeaters: list[int]
    registers: list[Registers]


def plan_modbus(draft: Draft, rows: Indices) -> None:
    """Connect points by stations in their boxes, on as few Modbus loops as keep the limits."""
    limits = draft.settings.modbus

    def alone(box: Box, length: float) -> tuple[Floats, str]:
        rate = max(rate for rate in limits.bit_rates if _longest_section(limits, rate) >= length)
        types = [draft.types[row] for row in box.rows]
        least = {
            kind: 2 * _polls(draft, registers_of([kind]), rate)[0].time
            for kind in dict.fromkeys(types)
        }
        words = f"alone on Modbus RTU at {rate} bit/s it has a response of"
        return np.array([least[kind] for kind in types]), words

    most_m = "a Modbus section has at most {:.0f} m"
    longest = _longest_section(limits, min(limits.bit_rates))
    stations = _served(draft, rows, longest, most_m, alone)
    # The master takes a unit load, and a repeater one on either side.
    most = min(limits.units, (1 + limits.repeaters) * (limits.unit_loads - 2) + 1)

    def judge(group: Sequence[Box]) -> tuple[_Loop | None, float]:
        return _loop(draft, group) if len(group) <= most else (None, len(group) / most)

    loops = divided(stations, lambda box: box.place, judge, lambda box: box.halved(draft.need))
    for number, (group, loop) in enumerate(loops, 1):
        assert loop is not None
        name = f"Modbus {number}"
        ordered = [group[place] for place in loop.trunk.order]
        names = lay(draft, name, "Modbus", ordered, loop.trunk, limits.cable, loop.repeaters)
        for unit, (place, device) in enumerate(zip(loop.trunk.order, names, strict=True), 1):
            box, registers = group[place], loop.registers[place]
            response = loop.scan + loop.longest[place]
            for row, length, where in zip(box.rows, box.lengths, registers.addresses, strict=True):
                address = f"{unit} {where}"
                draft.connect(int(row), "Modbus RTU", name, device, address, response)
                draft.drop(int(row), device, box.place, name, float(length))
        everything = np.concatenate([box.rows for box in group])
        draft.segment(
            everything, segment=name, bus="Modbus RTU",
            devices=len(group) + 1 + len(loop.repeaters), length_m=loop.trunk.length,
            bus_time=loop.on_wire / loop.scan,
            capacity_used=max(loop.scan / draft.need[everything].min(), len(group) / most),
            bit_rate=loop.bit_rate,
            scan_ms=1e3 * loop.scan, repeaters=len(loop.repeaters),
            switch_over_ms=1e3 * loop.switch_over if draft.settings.redundant else np.nan,
        )  # fmt: skip


def registers_of(types: Sequence[str]) -> Registers:
    """Return the registers of a station, and the requests of a scan."""
    kinds = np.asarray(types, dtype=object)
    addresses = np.full(len(kinds), "", dtype=object)
    numbers = []
    for analogue, digital, what in (("AI", "DI", "input"), ("AO", "DO", "holding")):
        values, states = np.flatnonzero(kinds == analogue), np.flatnonzero(kinds == digital)
        for number, place in enumerate(values):
            addresses[place] = f"{what} register {number}"
        for number, place in enumerate(states):
            register = len(values) + number // _STATES
            addresses[place] = f"{what} register {register} bit {number % _STATES}"
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
    return Registers(inputs, outputs, addresses.tolist(), requests)


def sections(hops: Sequence[float], *, length: float, unit_loads: int) -> list[int] | None:
    """Return after which stations a trunk needs a repeater."""
    found: list[int] = []
    loads, laid = 1, 0.0
    for place, hop in enumerate(hops):
        if hop > length:
            return None
        # Room for a repeater is kept unless this is the last station.
        last = place == len(hops) - 1
        if laid + hop > length or loads + 1 > unit_loads - (not last):
            found.append(place - 1)
            loads, laid = 1, 0.0
        loads, laid = loads + 1, laid + hop
    return found


def _loop(draft: Draft, group: Sequence[Box]) -> tuple[_Loop, float]:
    limits = draft.settings.modbus
    trunk = route_past(draft, group)
    registers = [registers_of([draft.types[row] for row in box.rows]) for box in group]
    needs = np.array([draft.need[box.rows].min() for box in group])
    for rate in sorted(limits.bit_rates):
        polls = [_polls(draft, own, rate) for own in registers]
        times = [[poll.time for poll in own] for own in polls]
        scan = sum(sum(own) for own in times)
        longest = [max(own) for own in times]
        in_time = bool((scan + np.array(longest) <= needs).all())
        if in_time:
            break
    # A still higher bit rate would not help, because its sections are not longer.
    length = _longest_section(limits, rate)
    repeaters = sections(trunk.hops.tolist(), length=length, unit_loads=limits.unit_loads)
    fits = in_time and repeaters is not None and len(repeaters) <= limits.repeaters
    switch_over = scan + sum(max(poll.timeout_time for poll in own) for own in polls)
    on_wire = sum(poll.on_wire for own in polls for poll in own)
    loop = _Loop(trunk, rate, scan, on_wire, longest, switch_over, repeaters or [], registers)
    return loop, 1 if fits else inf


def _longest_section(limits: ModbusLimits, bit_rate: int) -> float:
    """Return the longest cable between ends or repeaters [m]; fast signals do not reach as far."""
    return min(limits.length, INTERFACES["RS-485"].product / bit_rate)


def _polls(draft: Draft, registers: Registers, bit_rate: int) -> list[Poll]:
    limits = draft.settings.modbus
    serial = SerialLine(bit_rate, limits.character)
    timeout = limits.timeout + limits.processing + serial.frame_time(256)
    return [
        Poll(request, serial, processing=limits.processing, timeout=timeout)
        for request in registers.requests
    ]
