"""Section 5: what markers show of an error and what they miss, and what a CRC costs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from shipnet.papers.chung1998.packets import FLAGS, ITEMS
from shipnet.papers.chung1998.stations import PRINTED
from shipnet.papers.registry import check, numeric
from shipnet.remote_control.experiment.recommendation import Criterion, recommend
from shipnet.remote_control.experiment.residual import packet_shares, single_flip_share
from shipnet.remote_control.experiment.staleness import switch_staleness
from shipnet.remote_control.imitation import imitation_share
from shipnet.remote_control.link.system import System
from shipnet.remote_control.link.timing import cycle_time
from shipnet.remote_control.packet import Markers

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["PATIENCE", "flip_table", "recommendation_table"]

#: How long a partner may be silent [s], and our measure of how long a switch may be wrong.
PATIENCE = float(PRINTED["failure_time"])


@numeric("chung1998-018")
def crc_share(*, items: int = ITEMS) -> float:
    """Percent that a CRC adds to a packet of so many data."""
    plain, checked = (Markers(n_numbers=items, crc=crc).size(items) for crc in (False, True))
    return 100 * (checked - plain) / plain


@numeric("chung1998-067")
def crc_share_of_one(*, items: int = 1) -> float:
    """Percent that a CRC adds to a packet of one datum."""
    return crc_share(items=items)


def flip_table(items: int = ITEMS) -> pd.DataFrame:
    """Return how many bits of a packet can each be inverted unseen.

    Parameters
    ----------
    items : int, optional
        Data of a packet; of reading C one.

    Returns
    -------
    pandas.DataFrame
        A row a reading and check: ``reading``, ``check``, ``bits`` of the packet, how many
        ``pass`` inverted, and their ``share [%]``.

    Examples
    --------
    >>> print(*flip_table().iloc[0])
    A markers 264 240 90.9
    """
    import pandas as pd

    rows = []
    for reading, what, form, n in (
        ("A", "markers", Markers(n_numbers=items), items),
        ("A", "numbers must be known", Markers(n_numbers=items, numbers="known"), items),
        ("A", "numbers must rise", Markers(n_numbers=items, numbers="rising"), items),
        ("B", "markers", Markers("B", items), items),
        ("C", "markers", Markers(), 1),
        ("A", "markers and CRC", Markers(n_numbers=items, crc=True), items),
    ):
        bits, share = 8 * form.size(n), single_flip_share(form, n)
        rows.append((reading, what, bits, round(share * bits), round(100 * share, 1)))
    return pd.DataFrame(rows, columns=["reading", "check", "bits", "pass", "share [%]"])


def recommendation_table(items: Sequence[int], patience: Mapping[float, float]) -> pd.DataFrame:
    """Return how to send so many data at some bit rates, by `recommend`.

    Parameters
    ----------
    items : sequence of int
        Numbers of data, 1..84 each.
    patience : mapping of float to float
        For each bit rate [bit/s] how long a switch may be wrong [s].

    Returns
    -------
    pandas.DataFrame
        A row a bit rate and number: ``bit/s``, ``values``, ``check``, ``sending``, ``values a
        packet``, ``all sent in [s]``.

    Raises
    ------
    ArgumentError
        If a number is out of range, or nothing keeps the limits.

    Examples
    --------
    >>> print(*recommendation_table([40], {600: 20}).iloc[0].iloc[:5])
    600 40 CRC cyclic 10
    """
    import pandas as pd

    rows = []
    for rate, stale in patience.items():
        for n in items:
            best = recommend(n, System(bit_rate=rate), criterion=Criterion(stale_time=stale))
            rows.append((rate, n, best.check, best.sending, best.per_packet, best.refresh_time))
    columns = ["bit/s", "values", "check", "sending", "values a packet", "all sent in [s]"]
    return pd.DataFrame(rows, columns=columns)


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
