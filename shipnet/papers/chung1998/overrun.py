"""Sections 4.3 and 5: the ring overrun, its repair by Fig 9, and the three trials."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from functools import cache
from typing import TYPE_CHECKING

from shipnet.errors import ArgumentError
from shipnet.fields import check_whole
from shipnet.papers.chung1998.link import as_printed
from shipnet.papers.chung1998.packets import ITEMS, length
from shipnet.papers.chung1998.ring import SIZE
from shipnet.papers.registry import check, numeric
from shipnet.remote_control.link.faults import Stall
from shipnet.remote_control.link.run import simulate
from shipnet.remote_control.link.timing import fill_time as fill_time_of
from shipnet.remote_control.link.trials import BYTES_PER_PRESS, WRITE_TIME
from shipnet.remote_control.packet import PACKET_START, Markers
from shipnet.remote_control.ring_buffer import Ring, Rule, pointer_case

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["full_rings", "given_up", "overrun_rings", "packets_stored", "recovered"]
__all__ += ["recovered_table"]


def packets_stored(
    n: int,
    items: int,
    phase: int = 0,
    size: int = SIZE,
    rule: Rule = "literal",
    get_no: int = 0,
) -> Ring:
    """Return a ring in which so many bytes of packets have been stored and none read.

    Parameters
    ----------
    n : int
        How many bytes.
    items : int
        Data of each packet, 1..204.
    phase : int, default 0
        With which byte of a packet the stream begins.
    size : int, optional
        Places of the ring.
    rule : {"literal", "meant", "mended"}, default "literal"
        How the reader decides.
    get_no : int, default 0
        Where the reader stands, 0..size - 1: so many zeros were stored and read before.

    Returns
    -------
    Ring
        The ring.

    Examples
    --------
    >>> ring = packets_stored(21, items=1, size=16)
    >>> ring.case, ring.extract().lost, ring.unread
    ('c', 12, 9)
    """
    packet = _packet(items)
    ring = Ring(size, rule)
    for _ in range(check_whole("get_no", get_no, 0, ring.size - 1)):
        ring.store(0)
        ring.extract()
    count, begin = check_whole("n", n, 0, 10**6), phase % len(packet)
    stream = packet * ((begin + count) // len(packet) + 1)
    ring.store_all(stream[begin : begin + count])
    return ring


@cache
def _packet(items: int) -> bytes:
    return Markers(n_numbers=items).encode(dict.fromkeys(range(items), 1000))


def overrun_rings(items: int) -> Iterator[Ring]:
    """Return rings that show case c, for every place of the writer and every phase of a stream.

    Parameters
    ----------
    items : int
        Data of each packet.

    Returns
    -------
    iterator of Ring
        Each a ring whose reader stands at 0, a round and more behind the writer.

    Examples
    --------
    128 places of the writer, 33 phases:

    >>> sum(ring.case == "c" for ring in overrun_rings(10)) == 128 * 33
    True
    """
    for no in range(SIZE):
        for phase in range(length("A", items)):
            yield packets_stored(SIZE + no, items, phase)


def full_rings(size: int = SIZE) -> Iterator[Ring]:
    """Return rings of packet starts only that show case c, for every place of the writer.

    Parameters
    ----------
    size : int, optional
        Places of the ring.

    Returns
    -------
    iterator of Ring
        Each a ring whose reader stands at 0.

    Examples
    --------
    >>> [ring.unread for ring in full_rings(4)]
    [4, 5, 6, 7]
    """
    for no in range(size):
        ring = Ring(size)
        for _ in range(size + no):
            ring.store(PACKET_START)
        yield ring


def given_up(rings: Iterable[Ring]) -> list[int]:
    """Return how many bytes that a ring still holds each repair gives up.

    Parameters
    ----------
    rings : iterable of Ring
        Overrun rings; each is repaired.

    Returns
    -------
    list of int
        Bytes, one a ring; those overwritten before the repair are not counted.

    Examples
    --------
    Of a ring of 8, with the writer in each of its places:

    >>> given_up(full_rings(8))
    [4, 3, 2, 1, 4, 3, 2, 1]
    """
    found = []
    for ring in rings:
        ring.extract()
        found.append(ring.size - ring.unread)
    return found


def recovered(waiting: int, rule: Rule, items: int = ITEMS, get_no: int = 0) -> int:
    """Return how many packets are found behind so many bytes that nobody read.

    Parameters
    ----------
    waiting : int
        Bytes stored before the reader begins, 0..1e6.
    rule : {"meant", "mended"}
        How the reader decides. By "literal" it has no end.
    items : int, optional
        Data of each packet; all data of the n-th have the value n.
    get_no : int, default 0
        Where the reader stands, 0..127.

    Returns
    -------
    int
        Packets found as they were sent; none where the reader stops, in case a.

    Raises
    ------
    ArgumentError
        If an argument is out of range, or the rule is none of the two.

    Examples
    --------
    Of the six packets in 200 bytes, with the reader at the start and in the last place; there the
    printed ring shows the case that was left out, and its reader stops:

    >>> recovered(200, "meant"), recovered(200, "mended")
    (2, 3)
    >>> recovered(200, "meant", get_no=127), recovered(200, "mended", get_no=127)
    (0, 3)
    """
    if rule not in ("meant", "mended"):
        raise ArgumentError(f"rule is {rule!r}; it must be 'meant' or 'mended'")
    check_whole("waiting", waiting, 0, 10**6)
    form = Markers(n_numbers=items)
    count = waiting // form.size(items) + 1
    sent = [dict.fromkeys(range(items), n) for n in range(1, count + 1)]
    ring = Ring(SIZE, rule)
    for _ in range(check_whole("get_no", get_no, 0, SIZE - 1)):
        ring.store(0)
        ring.extract()
    ring.store_all(b"".join(map(form.encode, sent))[:waiting])
    taken = bytearray()
    while (step := ring.extract()).action in ("take", "repair"):
        taken += bytes([] if step.byte is None else [step.byte])
    found = form.parser().feed(bytes(taken))
    return sum(tuple(packet.items()) in found for packet in sent)


def recovered_table(
    waiting: Sequence[int] = range(0, 3 * SIZE + 1, 8),
    places: Sequence[int] = range(0, SIZE, 8),
) -> pd.DataFrame:
    """Return how many packets the printed ring and the mended one still hold.

    Parameters
    ----------
    waiting : sequence of int, optional
        Numbers of bytes that wait, 0..1e6.
    places : sequence of int, optional
        Places of the reader, 0..127, at least one.

    Returns
    -------
    pandas.DataFrame
        A row a number of ``waiting`` bytes: packets ``sent`` whole; found in the ``printed`` ring,
        which knows an empty ring as empty, as the mean over the places, with the ``fewest`` and
        the ``most``; share of the places at which its reader ``stops`` in case a; and found in
        the ``mended`` ring.

    Raises
    ------
    ArgumentError
        If a number is out of range, or there is no place.

    Examples
    --------
    >>> recovered_table([100, 200]).values.tolist()
    [[100.0, 3.0, 3.0, 3.0, 3.0, 0.0, 3.0], [200.0, 6.0, 1.0625, 0.0, 3.0, 0.5625, 3.0]]
    """
    import pandas as pd

    if not len(places):
        raise ArgumentError("places is empty; it must hold a place")
    size, rows = length("A", ITEMS), []
    for n in waiting:
        found = [recovered(n, "meant", get_no=place) for place in places]
        stops = [packets_stored(n, ITEMS, get_no=place).case == "a" for place in places]
        # The mended ring counts on: where its reader stands makes no difference.
        mended = recovered(n, "mended", get_no=places[0])
        mean, stopped = (sum(column) / len(places) for column in (found, stops))
        rows.append((n, n // size, mean, min(found), max(found), stopped, mended))
    columns = ["waiting", "sent", "printed", "fewest", "most", "stops", "mended"]
    return pd.DataFrame(rows, columns=columns)


@check("chung1998-013", counter={"shift": 2})
def repair_restores_order(*, shift: int = 1) -> bool:
    """Whether a repair ends at the first 0xCC from SIZE >> shift or from 0, in a normal case.

    Of rings in case c only: in case a there is no repair.
    """
    for ring in overrun_rings(ITEMS):
        cells, no = ring.cells, ring.state.no
        ring.extract()
        place = cells.find(PACKET_START, SIZE >> shift if no < SIZE >> shift else 0)
        if ring.state.get_no != place or ring.case not in ("b", "d"):
            return False
    return True


@check("chung1998-057", counter={"toggled": False})
def toggled_flag_restores_order(*, toggled: bool = True) -> bool:
    """Whether a reader moved to the start of the ring, its flag turned over, is in case b."""
    for ring in full_rings(SIZE):
        before = ring.state
        ring.extract()
        if before.no >= SIZE >> 1:
            flag = ring.state.ring_get_f if toggled else before.ring_get_f
            if pointer_case(ring.state._replace(ring_get_f=flag)) != "b":
                return False
    return True


@check("chung1998-055", counter={"items": 45})
def repair_keeps_a_part(*, items: int = ITEMS) -> bool:
    """Whether some of the bytes that the ring holds are left after every repair, in case c."""
    for ring in overrun_rings(items):
        ring.extract()
        if ring.unread == 0:
            return False
    return True


@numeric("chung1998-056")
def bytes_given_up(*, size: int = SIZE) -> float:
    """Bytes of those still held that a repair gives up, mean over the places of the writer."""
    return sum(given_up(full_rings(size))) / size


@numeric("chung1998-060")
def fill_time(*, size: int = SIZE, rate: float = 9600.0) -> float:
    """Seconds in which unbroken reception fills the ring."""
    return size / SIZE * fill_time_of(as_printed(rate))


@numeric("chung1998-061")
def packets_held(*, size: int = SIZE, items: int = ITEMS) -> float:
    """Packets of so many data that the ring holds."""
    return size / length("A", items)


@numeric("chung1998-015")
def abnormal_states(*, empty_is_empty: bool = True) -> int:
    """Repairs in 100 packets, read byte by byte; or if an empty ring is read on, as printed."""
    ring = Ring(SIZE, "meant" if empty_is_empty else "literal")
    repairs = 0
    for byte in 100 * _packet(ITEMS):
        ring.store(byte)
        # As many steps as there are places: an empty ring that is read on has no end.
        for _ in range(SIZE):
            step = ring.extract()
            repairs += step.action == "repair"
            if step.action in ("wait", "stop"):
                break
    return repairs


@check("chung1998-058", counter={"stall": 14.0})
def parameter_change_does_no_harm(*, stall: float = BYTES_PER_PRESS * WRITE_TIME) -> bool:
    """Whether a task that stalls so long [s] leaves the ring in order.

    How long the paper's task stalled is not printed; 20 ms are assumed for an integer.
    """
    run = simulate(as_printed(), 25.0, faults=[Stall("BCS", 5.0, 5.0 + stall)])
    return not bool(run.table["event"].str.startswith("ring").any())


@check("chung1998-021", counter={"size": SIZE})
def larger_ring_is_not_overrun(*, size: int = 2 * SIZE, stall: float = 0.2) -> bool:
    """Whether bytes that come without a break during a stall [s] leave a ring in a normal case."""
    came = round(stall / as_printed().character_time)
    return packets_stored(came, ITEMS, size=size).case in ("b", "d")
