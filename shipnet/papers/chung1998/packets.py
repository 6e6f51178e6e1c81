"""Sections 3.2 and 4.1: the packet in its three readings, and the data that are sent in it."""

from __future__ import annotations

from itertools import combinations
from typing import Literal

import numpy as np

from shipnet import datasets
from shipnet.fields import check_whole
from shipnet.papers.chung1998.stations import PRINTED
from shipnet.papers.registry import check, numeric
from shipnet.remote_control.batch import encode_batch
from shipnet.remote_control.changes import Sender
from shipnet.remote_control.packet import Markers

__all__ = ["FLAGS", "ITEMS", "flags_at", "length"]

#: Section 5: data sent and received in the trial.
ITEMS = int(PRINTED["data_count"])

#: Section 3.2: start of the packet, start of the data, end of the packet.
FLAGS = tuple(
    int(PRINTED[f"{flag}_flag"], 16) for flag in ("packet_start", "data_start", "packet_end")
)

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

    Examples
    --------
    >>> [length(reading, 10) for reading in ("A", "B", "C")]
    [33, 42, 60]
    """
    if reading == "C":
        return check_whole("items", items, 0, 204) * Markers("A").size(1)
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

    Examples
    --------
    >>> [(place, hex(byte)) for place, byte in flags_at("B", 2)]
    [(0, '0xcc'), (1, '0xdd'), (5, '0xdd'), (9, '0xee')]
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
