"""Stations on CAN: messages, segments that carry them in time, bit rates that reach."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from math import inf
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from shipnet import datasets
from shipnet.can.schedule import Message, MessageSet, frame_bits, response_times
from shipnet.design.catalogue import cables
from shipnet.design.plan.backbone import Backbone, lay, route_past
from shipnet.design.plan.boxes import Box, boxes, too_far
from shipnet.design.plan.can_packing import Packed, pack
from shipnet.design.plan.clusters import divided
from shipnet.design.plan.draft import Draft

__all__ = ["bit_rate_for", "plan_can"]

#: Most messages of a segment: the identifiers of 11 bits but for the last 16, which early CAN
#: controllers cannot send.
_MESSAGES = 2**11 - 16


class Sent(NamedTuple):
    """Where a message comes from, and how it fares.

    Attributes
    ----------
    station : int
        Place of its station in the group.
    arbitration_id : int
        Identifier.
    response : float
        Longest response time [s]; NaN where the load or the length is too much anyway.
    """

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
    r"""Connect points by stations in their boxes, on as few CAN segments as keep the limits.

    Parameters
    ----------
    draft : Draft
        Where it is put down.
    rows : ndarray of int
        Points. One whose box is out of reach, or that needs an update sooner than a segment of its
        own gives it, does not fit.

    Notes
    -----
    A point's message is sent every `period_share` of its update need, and has the rest of it to
    arrive; its response is that period and the message's longest response time (exact analysis,
    longest frames, no errors). Priorities are deadline monotonic. A station whose points are too
    many for a segment is halved, the urgent points apart.

    Examples
    --------
    >>> from shipnet.design.iolist import parse_iolist
    >>> from shipnet.design.plan.settings import Settings
    >>> from shipnet.design.site import Site
    >>> iolist = parse_iolist("tag,signal,x,y,z\nA,contact,80,0,0\nB,rtd_3wire,90,0,0")
    >>> draft = Draft(iolist, Site((0, 0, 0)), Settings())
    >>> plan_can(draft, np.arange(2))
    >>> network = draft.network("CAN")
    >>> network.points[["device", "address"]].values.tolist()
    [['CAN box 1', '0x001 bit 16'], ['CAN box 1', '0x001 bit 0']]
    >>> network.segments[["bit_rate", "messages"]].values.tolist()
    [[250000, 1]]
    """
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
    """Return the highest bit rate that a trunk is short enough for.

    Parameters
    ----------
    length : float
        Its length [m].
    bit_rates : sequence of int
        Bit rates to choose from [bit/s]; those that ``can_bus_lengths.csv`` does not know count
        as the next higher one that it knows.

    Returns
    -------
    int or None
        Bit rate [bit/s]; None if the trunk is too long for all.

    Examples
    --------
    >>> [bit_rate_for(length, (50_000, 125_000, 250_000)) for length in (250, 251, 1000, 1001)]
    [250000, 125000, 50000, None]
    """
    reaching = [rate for rate in bit_rates if _reach(rate) >= length]
    return max(reaching, default=None)


@cache
def _reach(bit_rate: int) -> float:
    """Return the longest trunk at a bit rate [m]."""
    table = datasets.read("can_bus_lengths.csv")
    rates = table["bit_rate_kbit_per_s"].astype(float) * 1e3
    return float(table.loc[rates >= bit_rate, "length_m"].astype(float).max())


def _longest(draft: Draft) -> float:
    """Return the longest trunk that any of the bit rates, and the cable, allow [m]."""
    limits = draft.settings.can
    return min(max(map(_reach, limits.bit_rates)), cables()[limits.cable].longest_m)


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
    bits = frame_bits([message.dlc for message, _ in packed])
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
    alone = frame_bits(size) / rate
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
