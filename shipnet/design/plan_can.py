"""Points on CAN: stations, messages, segments that carry them in time, bit rates that reach."""

from __future__ import annotations

from collections.abc import Sequence
from math import inf
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from shipnet.can.bit_timing import longest_bus
from shipnet.can.lengths import frame_length
from shipnet.can.messages import Message, MessageSet, packed
from shipnet.can.response import response_times
from shipnet.design.catalogue import cables
from shipnet.design.drafting import Backbone, Box, Draft, boxes, divided, lay, route_past, too_far
from shipnet.errors import ArgumentError

# Which points share a CAN message: one station, one direction, one update need, 64 bits

#: What a value takes, and what a frame has for data [bit].
ANALOGUE_BITS, FRAME_BITS = 16, 64

Ints = npt.NDArray[np.intp]


class Packed(NamedTuple):
    """A message with its points."""

    output: bool
    need: float
    rows: Ints
    bits: Ints
    dlc: int


def pack(types: Sequence[str], need: npt.ArrayLike) -> list[Packed]:
    """Return the messages of a station, as few as there can be."""
    kinds = np.asarray(types, dtype=object)
    times = np.asarray(need, dtype=np.float64)
    if times.shape != kinds.shape or not (times > 0).all():
        raise ArgumentError(f"need must be a positive time for each of {len(kinds)} points")
    strange = sorted({str(kind) for kind in kinds} - {"DI", "DO", "AI", "AO"})
    if strange:
        raise ArgumentError(f"type is {strange[0]!r}; it must be DI, DO, AI or AO")
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


# Stations on CAN: messages, segments that carry them in time, bit rates that reach

#: Most messages of a segment: the identifiers of 11 bits but for the last 16, which early CAN
#: controllers cannot send.
_MESSAGES = 2**11 - 16


class Sent(NamedTuple):
    """Where a message comes from, and how it fares."""

    station: int
    arbitration_id: int
    response: float


class _Segment(NamedTuple):
    """A segment: its trunk, its bit rate, its messages with how they fare, its load."""

    trunk: Backbone
    bit_rate: int
    messages: list[tuple[Packed, Sent]]
    load: float


def plan_can(draft: Draft, rows: npt.NDArray[np.intp]) -> None:
    """Connect points by stations in their boxes, on as few CAN segments as keep the limits."""
    limits = draft.settings.can
    stations = [part for box in boxes(draft, rows) for part in _screened(draft, box)]

    def judge(group: Sequence[Box]) -> tuple[_Segment | None, float]:
        # The host is a node of each segment.
        if len(group) >= limits.nodes:
            return None, len(group) / (limits.nodes - 1)
        return _judge(draft, group)

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
            segment=name, bus="CAN", points=len(everything), devices=len(group) + 1,
            length_m=segment.trunk.length, load=segment.load,
            response_ms=1e3 * max(m.need * limits.period_share + s.response
                                  for m, s in segment.messages),
            slowest_update_ms=1e3 * float(draft.need[everything].min()),
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


def _judge(draft: Draft, group: Sequence[Box]) -> tuple[_Segment, float]:
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
    load = float((bits / period).sum()) / rate
    parts = max(parts, load / limits.load, inf if trunk.length > longest else 1)
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
    return _Segment(trunk, rate, messages, load), parts


def _message_set(packed: Sequence[tuple[Packed, int]], share: float) -> MessageSet:
    return MessageSet(
        Message(
            str(number), number, message.dlc, period=share * message.need,
            deadline=(1 - share) * message.need, sender=str(place),
        )
        for number, (message, place) in enumerate(packed, 1)
    )  # fmt: skip


def _screened(draft: Draft, box: Box) -> list[Box]:
    """Return a box with the points that a segment of their own would serve; refuse the others."""
    limits = draft.settings.can
    trunk = route_past(draft, [box])
    longest = _longest(draft)
    if trunk.length > longest:
        most = f"a CAN segment has at most {{:.0f}} m at {min(limits.bit_rates) / 1e3:g} kbit/s"
        too_far(draft, box, trunk.length, longest, most)
        return []
    rate = bit_rate_for(trunk.length, limits.bit_rates) or min(limits.bit_rates)
    size = np.array([2 if draft.types[row][0] == "A" else 1 for row in box.rows])
    need = draft.need[box.rows]
    alone = frame_length(size) / rate
    # The frame has to arrive in what its period leaves, and must not be more than the load allows.
    least = alone / min(1 - limits.period_share, limits.period_share * limits.load)
    for row, time in zip(box.rows[least > need], least[least > need], strict=True):
        tag = draft.tags[row]
        text = (
            f"{tag} needs an update every {1e3 * draft.need[row]:g} ms; alone on CAN at "
            f"{rate / 1e3:g} kbit/s it has one every {1e3 * time:.3g} ms"
        )
        draft.reason(tag, "update", 1e3 * time, 1e3 * draft.need[row], "ms", text)
    kept = np.flatnonzero(least <= need)
    return [box.part(kept)] if len(kept) else []
