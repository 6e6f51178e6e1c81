"""Sections 3.2, 4.1 and 5: the packet in its three readings, what its markers show and miss."""

from __future__ import annotations

from itertools import combinations
from typing import Literal

import numpy as np

from shipnet import datasets
from shipnet.papers.chung1998.stations import PRINTED
from shipnet.papers.registry import check, numeric
from shipnet.remote_control.batch import encode_batch
from shipnet.remote_control.changes import Sender
from shipnet.remote_control.experiment.recommendation import recommend
from shipnet.remote_control.experiment.residual import packet_shares, single_flip_share
from shipnet.remote_control.experiment.staleness import switch_staleness
from shipnet.remote_control.imitation import imitation_share
from shipnet.remote_control.link.system import System
from shipnet.remote_control.link.timing import cycle_time
from shipnet.remote_control.packet import Markers

__all__ = ["FLAGS", "ITEMS", "PATIENCE", "flags_at", "length"]

#: Section 5: data sent and received in the trial.
ITEMS = int(PRINTED["data_count"])

#: Section 3.2: start of the packet, start of the data, end of the packet.
FLAGS = tuple(
    int(PRINTED[f"{flag}_flag"], 16) for flag in ("packet_start", "data_start", "packet_end")
)

#: How long a partner may be silent [s], and our measure of how long a switch may be wrong.
PATIENCE = float(PRINTED["failure_time"])

_FIELDS = datasets.read("chung1998_packet_format.csv")
_DATUM = tuple(_FIELDS.loc[_FIELDS["kind"] == "data", "field"])


def length(reading: Literal["A", "B", "C"], items: int) -> int:
    """Return the bytes of so many data; in reading C every one is a packet of its own.

    Parameters
    ----------
    reading : {"A", "B", "C"}
        How the lost figure is read.
    items : int
        How many data, 0..204.

    Returns
    -------
    int
        Bytes of all packets.
    """
    if reading == "C":
        return items * Markers("A").size(1)
    return Markers(reading, max(items, 1)).size(items)


@numeric("chung1998-004")
def length_a(*, items: int = ITEMS) -> int:
    """Bytes of a packet in reading A."""
    return length("A", items)


@numeric("chung1998-038")
def length_b(*, items: int = ITEMS) -> int:
    """Bytes of a packet in reading B."""
    return length("B", items)


@numeric("chung1998-039")
def length_c(*, items: int = ITEMS) -> int:
    """Bytes of so many data in reading C."""
    return length("C", items)


@check("chung1998-005", counter={"order": ("number", "high", "low")})
def datum_is_number_low_high(*, order: tuple[str, ...] = _DATUM) -> bool:
    """Whether each of the 65536 values comes back from three bytes in this order."""
    values = np.arange(1 << 16)[:, None]
    packets = encode_batch(Markers(), [7], values)
    fields = dict(zip(order, packets[:, 2:5].T.astype(int), strict=True))
    back = fields["low"] | fields["high"] << 8
    return bool((fields["number"] == 7).all() and (back == values[:, 0]).all())


def flags_at(reading: Literal["A", "B"], items: int) -> list[tuple[int, int]]:
    """Return where each flag stands in a packet of so many data.

    Parameters
    ----------
    reading : {"A", "B"}
        How the lost figure is read; C is A with one datum.
    items : int
        How many data, 1..204.

    Returns
    -------
    list of (int, int)
        Place of the byte and its value.
    """
    packet = Markers(reading, items).encode(dict.fromkeys(range(items), 0))
    return [(place, byte) for place, byte in enumerate(packet) if byte >= min(FLAGS)]


@check("chung1998-037", counter={"flags": (0xCC, 0xEE, 0xDD)})
def flags_stand_in_order(*, flags: tuple[int, ...] = FLAGS) -> bool:
    """Whether a packet begins with the first, its data with the second, and it ends with the third.

    In all three readings.
    """
    start, data, end = flags
    once = [(0, start), (1, data)]
    return (
        flags_at("A", ITEMS) == [*once, (length("A", ITEMS) - 1, end)]
        and flags_at("A", 1) == flags_at("B", 1) == [*once, (5, end)]
        and flags_at("B", ITEMS)
        == [(0, start), *((1 + 4 * k, data) for k in range(ITEMS)), (length("B", ITEMS) - 1, end)]
    )


@check("chung1998-036", counter={"numbered": False})
def any_subset_can_be_sent(*, numbered: bool = True) -> bool:
    """Whether each choice of some of ten data reaches the places where they belong."""
    form = Markers(n_numbers=ITEMS)
    choices = (chosen for k in range(ITEMS + 1) for chosen in combinations(range(ITEMS), k))
    for chosen in choices:
        sent = {number: 1000 + number for number in chosen}
        items = form.decode(form.encode(sent))
        places = [number if numbered else place for place, (number, _) in enumerate(items)]
        if dict(zip(places, (value for _, value in items), strict=True)) != sent:
            return False
    return True


@check("chung1998-010", counter={"lost": 1})
def copies_stay_equal(*, lost: int = 0) -> bool:
    """Whether sending only what differs keeps the receiver's table equal to the sender's.

    Each of 200 packets must have 3 bytes and 3 for each datum that changed; so many are lost.
    """
    rng = np.random.default_rng(2024)
    form = Markers(n_numbers=ITEMS)
    sender, sending, table = Sender(form), [0] * ITEMS, [0] * ITEMS
    for turn in range(200):
        before = list(sending)
        for number in rng.choice(ITEMS, rng.integers(0, 4), replace=False):
            sending[number] = int(rng.integers(1 << 16))
        packet = sender.packet(sending)
        if len(packet) != 3 + 3 * sum(a != b for a, b in zip(before, sending, strict=True)):
            return False
        for number, value in form.decode(packet) if turn < 200 - lost else ():
            table[number] = value
    return table == sending


@numeric("chung1998-018")
def crc_share(*, items: int = ITEMS) -> float:
    """Percent that a CRC adds to a packet of so many data."""
    plain, checked = (Markers(n_numbers=items, crc=crc).size(items) for crc in (False, True))
    return 100 * (checked - plain) / plain


@numeric("chung1998-067")
def crc_share_of_one(*, items: int = 1) -> float:
    """Percent that a CRC adds to a packet of one datum."""
    return crc_share(items=items)


@check("chung1998-019", counter={"crc": True})
def flags_show_errors(*, crc: bool = False) -> bool:
    """Whether a packet whose flags stand at their places has no error, tried with single bits."""
    return single_flip_share(Markers(n_numbers=ITEMS, crc=crc), ITEMS) == 0


@numeric("chung1998-020")
def imitations(*, value_bytes: int = 2 * ITEMS, flags: int = len(FLAGS)) -> float:
    """Percent of packets with random values in which a value byte equals a flag."""
    return 100 * imitation_share(value_bytes, flags)


@check("chung1998-066", counter={"rate": 1e-13})
def crc_is_inefficient_for_few(*, rate: float = 1e-5) -> bool:
    """Whether markers alone are the quickest way to send one datum with few enough errors.

    At this bit error rate, and by the limits of `Criterion`, which are ours.
    """
    return recommend(1, rate=rate).check == "markers"


@check("chung1998-068", counter={"interval": 0.5})
def loss_does_no_harm(*, interval: float = 3600.0) -> bool:
    """Whether a value that moves every so often [s] is right again soon after a lost packet.

    Soon is as long as a partner may be silent. One datum at a bit error rate of 1e-5, which we
    assume; the mean is over random times.
    """
    form = Markers(n_numbers=ITEMS)
    wait = switch_staleness(
        packet_shares(form, 1, 1e-5), cycle_time(System(form)), interval, "changed"
    )
    return wait.duration <= PATIENCE


@check("chung1998-069", counter={"place": 3})
def data_until_next_packet_are_lost(*, place: int = 0) -> bool:
    """Whether an error at this byte costs the data of its packet, and those behind are found."""
    form = Markers(n_numbers=ITEMS)
    stream = b"".join(form.encode({0: turn, 1: turn}) for turn in range(1, 6))
    hit = bytearray(stream)
    hit[2 * form.size(2) + place] ^= 1
    parser = form.parser()
    found = [items[0][1] for items in parser.feed(bytes(hit))]
    return found == [1, 2, 4, 5] and parser.discarded == form.size(2)


@check("chung1998-070", counter={"per_packet": 1})
def one_error_costs_much(*, per_packet: int = 40) -> bool:
    """Whether a bit of an end flag costs more than half of 40 data, so many in each packet."""
    data = {number: 1 for number in range(40)}
    form = Markers(n_numbers=40)
    parts = [dict(list(data.items())[k : k + per_packet]) for k in range(0, 40, per_packet)]
    stream = bytearray(b"".join(form.encode(part) for part in parts))
    stream[form.size(per_packet) - 1] ^= 1
    taken = {number for items in form.parser().feed(bytes(stream)) for number, _ in items}
    return len(data) - len(taken) > len(data) / 2
