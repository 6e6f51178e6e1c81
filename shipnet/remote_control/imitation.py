"""Data that look like markers: how often they do, and what a parser then makes of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from shipnet.fields import check_whole
from shipnet.remote_control.packet import Format

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["imitation_share", "late_start"]


def imitation_share(n_bytes: int, n_markers: int = 3) -> float:
    r"""Return how often some random bytes hold at least one that equals a marker.

    .. math:: P = 1 - \left( 1 - \frac{m}{256} \right)^n

    Parameters
    ----------
    n_bytes : int
        How many bytes there are, 0..1e6.
    n_markers : int, default 3
        How many markers they can be taken for, 0..256.

    Returns
    -------
    float
        Share, 0..1.

    Raises
    ------
    ArgumentError
        If a number is out of range.

    Notes
    -----
    Every byte is as likely as any other here. Values of a ship are not: a shaft speed below 204
    rpm sent as a whole number never holds a marker.

    Examples
    --------
    The values of ten data, for 0xCC alone and for all three:

    >>> [round(100 * imitation_share(20, m), 1) for m in (1, 3)]
    [7.5, 21.0]
    """
    n = check_whole("n_bytes", n_bytes, 0, 10**6)
    return 1 - (1 - check_whole("n_markers", n_markers, 0, 256) / 256) ** n


def late_start(packet_format: Format, packets: Sequence[Mapping[int, int]]) -> pd.DataFrame:
    """Return what a receiver finds that begins to listen in the middle of a stream.

    Parameters
    ----------
    packet_format : Format
        How packets are made.
    packets : sequence of mapping of int to int
        The items of each packet, sent one after the other without a pause.

    Returns
    -------
    pandas.DataFrame
        A row for each byte of the stream as the first that is heard: ``first_byte``; how many
        packets began there or later and so were ``whole``; how many of these were ``missed``;
        how many were found that nobody sent, ``false``; and how many items in these stand in no
        packet sent, ``wrong_items``.

    Raises
    ------
    ArgumentError
        If a packet cannot be sent.

    Notes
    -----
    In reading A only the two bytes of one value can look like the start of a packet, and what
    follows is the next item: a false packet then has true items. In reading B the items of a
    false packet are out of step.

    Examples
    --------
    The value 0xDDCC, low byte first, looks like the start of a packet:

    >>> from shipnet.remote_control.packet import Markers
    >>> packets = [{0: 0xDDCC, 1: 0xEE05}, {0: 1}]
    >>> late_start(Markers("A"), packets).iloc[1].to_dict()
    {'first_byte': 1, 'whole': 1, 'missed': 0, 'false': 1, 'wrong_items': 0}
    >>> late_start(Markers("B"), packets).iloc[1].to_dict()
    {'first_byte': 1, 'whole': 1, 'missed': 0, 'false': 1, 'wrong_items': 1}
    """
    import pandas as pd

    sent = [packet_format.encode(items) for items in packets]
    stream = b"".join(sent)
    starts = [sum(map(len, sent[:k])) for k in range(len(sent))]
    true = {
        (start + len(packet), packet_format.decode(packet))
        for start, packet in zip(starts, sent, strict=True)
    }
    items_sent = {item for items in packets for item in items.items()}
    rows = []
    for first in range(len(stream)):
        parser = packet_format.parser()
        found = {
            (place + 1, items)
            for place in range(first, len(stream))
            for items in parser.feed(stream[place : place + 1])
        }
        whole = sum(start >= first for start in starts)
        false = found - true
        wrong = sum(item not in items_sent for _, items in false for item in items)
        rows.append((first, whole, whole - len(found & true), len(false), wrong))
    columns = ["first_byte", "whole", "missed", "false", "wrong_items"]
    return pd.DataFrame(rows, columns=columns)
