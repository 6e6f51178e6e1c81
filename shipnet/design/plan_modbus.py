"""Stations on Modbus RTU: registers, loops that are scanned in time, unit ids, repeaters."""

from __future__ import annotations

from collections.abc import Sequence
from math import inf
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from shipnet.design.drafting import Backbone, Box, Draft, boxes, divided, lay, route_past, too_far
from shipnet.modbus.pdu import Request
from shipnet.modbus.polling import Poll
from shipnet.modbus.uart import SerialLine

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
    """A loop: trunk, bit rate, scan, longest transactions, time to the second line, repeaters."""

    trunk: Backbone
    bit_rate: int
    scan: float
    longest: list[float]
    switch_over: float
    repeaters: list[int]
    registers: list[Registers]


def plan_modbus(draft: Draft, rows: npt.NDArray[np.intp]) -> None:
    """Connect points by stations in their boxes, on as few Modbus loops as keep the limits."""
    stations = [part for box in boxes(draft, rows) for part in _screened(draft, box)]

    limits = draft.settings.modbus
    # The master takes a unit load, and a repeater one on either side.
    most = min(limits.units, (1 + limits.repeaters) * (limits.unit_loads - 2) + 1)

    def judge(group: Sequence[Box]) -> tuple[_Loop | None, float]:
        return _judge(draft, group) if len(group) <= most else (None, len(group) / most)

    loops = divided(stations, lambda box: box.place, judge, lambda box: box.halved(draft.need))
    for number, (group, loop) in enumerate(loops, 1):
        assert loop is not None
        name = f"Modbus {number}"
        ordered = [group[place] for place in loop.trunk.order]
        names = lay(draft, name, "Modbus", ordered, loop.trunk, limits.cable, loop.repeaters)
        response = []
        for unit, (place, device) in enumerate(zip(loop.trunk.order, names, strict=True), 1):
            box, registers = group[place], loop.registers[place]
            response.append(loop.scan + loop.longest[place])
            for row, length, where in zip(box.rows, box.lengths, registers.addresses, strict=True):
                address = f"{unit} {where}"
                draft.connect(int(row), "Modbus RTU", name, device, address, response[-1])
                draft.drop(int(row), device, box.place, name, float(length))
        needs = np.concatenate([draft.need[box.rows] for box in group])
        draft.segment(
            segment=name, bus="Modbus RTU", points=len(needs),
            devices=len(group) + 1 + len(loop.repeaters), length_m=loop.trunk.length,
            load=loop.scan / float(needs.min()), response_ms=1e3 * max(response),
            slowest_update_ms=1e3 * float(needs.min()), bit_rate=loop.bit_rate,
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
    """Return behind which stations a trunk needs a repeater."""
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


def _judge(draft: Draft, group: Sequence[Box]) -> tuple[_Loop, float]:
    limits = draft.settings.modbus
    trunk = route_past(draft, group)
    repeaters = sections(trunk.hops.tolist(), length=limits.length, unit_loads=limits.unit_loads)
    parts = inf if repeaters is None or len(repeaters) > limits.repeaters else 1.0
    registers = [registers_of([draft.types[row] for row in box.rows]) for box in group]
    needs = np.array([draft.need[box.rows].min() for box in group])
    for rate in sorted(limits.bit_rates):
        polls = [_polls(draft, own, rate) for own in registers]
        times = [[poll.time for poll in own] for own in polls]
        scan = sum(sum(own) for own in times)
        longest = [max(own) for own in times]
        over = float(((scan + np.array(longest)) / needs).max())
        if over <= 1:
            break
    else:
        parts = inf
    switch_over = scan + sum(max(poll.timeout_time for poll in own) for own in polls)
    return _Loop(trunk, rate, scan, longest, switch_over, repeaters or [], registers), parts


def _polls(draft: Draft, registers: Registers, bit_rate: int) -> list[Poll]:
    limits = draft.settings.modbus
    serial = SerialLine(bit_rate, limits.character)
    timeout = limits.timeout + limits.processing + serial.frame_time(256)
    return [
        Poll(request, serial, processing=limits.processing, timeout=timeout)
        for request in registers.requests
    ]


def _screened(draft: Draft, box: Box) -> list[Box]:
    """Return a box with the points that a loop of their own would serve; refuse the others."""
    limits = draft.settings.modbus
    trunk = route_past(draft, [box])
    if trunk.length > limits.length:
        most = "a Modbus section has at most {:.0f} m"
        too_far(draft, box, trunk.length, limits.length, most)
        return []
    rate = max(limits.bit_rates)
    kept = []
    for place, row in enumerate(box.rows):
        (poll,) = _polls(draft, registers_of([draft.types[row]]), rate)
        need = float(draft.need[row])
        if 2 * poll.time <= need:
            kept.append(place)
            continue
        tag = draft.tags[row]
        text = (
            f"{tag} needs an update every {1e3 * need:g} ms; alone on Modbus RTU at {rate} bit/s "
            f"it has a response of {2e3 * poll.time:.3g} ms"
        )
        draft.reason(tag, "update", 2e3 * poll.time, 1e3 * need, "ms", text)
    return [box.part(np.array(kept, dtype=np.intp))] if kept else []
