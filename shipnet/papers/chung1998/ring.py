"""Sections 3.1, 4.2 and 4.3: the ring, its four variables, its four cases, what is taken out."""

from __future__ import annotations

from itertools import pairwise, product
from typing import TYPE_CHECKING

from shipnet.fields import check_whole
from shipnet.papers.chung1998.packets import ITEMS
from shipnet.papers.chung1998.stations import PRINTED
from shipnet.papers.registry import check, numeric
from shipnet.remote_control.extraction import extraction_table
from shipnet.remote_control.items import check_bytes
from shipnet.remote_control.packet import Markers
from shipnet.remote_control.ring_buffer import Case, Ring, State, pointer_case
from shipnet.remote_control.ring_states import case_table

if TYPE_CHECKING:
    from collections.abc import Sequence

    import pandas as pd

__all__ = ["SIZE", "reader_steps", "ring_with", "states", "stored"]

#: Section 5: places of the ring.
SIZE = int(PRINTED["ring_size"])


def stored(n: int, size: int = SIZE) -> list[State]:
    """Return the four variables before each of so many bytes that are stored.

    Parameters
    ----------
    n : int
        How many bytes, none of them read.
    size : int, optional
        Places of the ring.

    Returns
    -------
    list of State
        One a byte.

    Examples
    --------
    >>> [(state.no, state.ring_f) for state in stored(5, size=3)]
    [(0, 0), (1, 0), (2, 0), (0, 1), (1, 1)]
    """
    ring = Ring(size)
    found = []
    for _ in range(n):
        found.append(ring.state)
        ring.store(0)
    return found


def ring_with(unread: int, get_no: int, size: int = SIZE) -> Ring:
    """Return a ring with so many bytes unread and the reader at a place.

    Parameters
    ----------
    unread : int
        Bytes stored since the last was read, 0..1e6; the n-th byte of all has the value n.
    get_no : int
        Where the reader stands, 0..size - 1.
    size : int, optional
        Places of the ring.

    Returns
    -------
    Ring
        The ring, by the printed rules, an empty one known as empty.

    Raises
    ------
    ArgumentError
        If a number is out of range.

    Examples
    --------
    >>> ring = ring_with(unread=6, get_no=14, size=16)
    >>> ring.state, ring.case
    (State(no=4, ring_f=1, get_no=14, ring_get_f=0), 'd')
    """
    ring = Ring(size, "meant")
    check_whole("get_no", get_no, 0, size - 1)
    check_whole("unread", unread, 0, 10**6)
    for n in range(get_no + unread):
        ring.store(n % 256)
        if n < get_no:
            ring.extract()
    return ring


def reader_steps(stream: bytes, get_no: int, size: int = SIZE) -> pd.DataFrame:
    """Return what the reader of Fig 8 takes each byte for.

    Parameters
    ----------
    stream : bytes
        What comes into the ring: any bytes, read one by one as packets in reading A.
    get_no : int
        Where the first byte lies, 0..size - 1.
    size : int, optional
        Places of the ring.

    Returns
    -------
    pandas.DataFrame
        A row a byte: ``get_no``, ``byte`` and ``taken_as``.

    Raises
    ------
    ArgumentError
        If the stream is no bytes, or the place is out of range.

    Examples
    --------
    >>> steps = reader_steps(bytes.fromhex("41 cc dd 03 34 12 ee"), get_no=126)
    >>> steps.iloc[[0, 1, 3]].values.tolist()
    [[126, '0x41', 'passed over'], [127, '0xCC', 'start of the packet'], [1, '0x03', 'number']]
    """
    import pandas as pd

    ring, parser = ring_with(0, get_no, size), Markers(n_numbers=ITEMS).parser()
    rows = []
    for byte in check_bytes("stream", stream):
        place = ring.state.get_no
        ring.store(byte)
        taken = bytes([ring.extract().byte or 0])
        complete, held = parser.feed(taken), parser.pending
        if complete:
            what = "end of the packet"
        elif held < 3:
            what = ("passed over", "start of the packet", "start of the data")[held]
        else:
            what = ("number", "low byte", "high byte")[held % 3]
        rows.append((place, f"0x{taken[0]:02X}", what))
    return pd.DataFrame(rows, columns=["get_no", "byte", "taken_as"])


def states(places: int, flags: int) -> list[State]:
    """Return all states of a ring of so many places, with flags of so many values.

    Parameters
    ----------
    places : int
        Places of the ring.
    flags : int
        Values that each flag can have.

    Returns
    -------
    list of State
        Every combination.

    Examples
    --------
    >>> len(states(2, 2))
    16
    """
    return [State(*four) for four in product(*2 * (range(places), range(flags)))]


@numeric("chung1998-033")
def virtual_rings(*, with_flag: bool = True) -> int:
    """Rounds that the variables of the writer tell apart, with their flag or without."""
    seen = {(state.no, state.ring_f if with_flag else 0) for state in stored(4 * SIZE)}
    return len(seen) // SIZE


@check("chung1998-034", counter={"rings": 1})
def saves_memory(*, rings: int = 2) -> bool:
    """Whether one ring of 128 byte with a byte for each flag is less than so many rings."""
    return len(Ring(SIZE).cells) + 2 < rings * SIZE


@check("chung1998-035", counter={"period": SIZE})
def place_and_flag_go_round(*, period: int = 2 * SIZE) -> bool:
    """Whether the place goes up by one a byte and back to 0, and all is as at first after a period.

    The flag turns over each time the place goes back.
    """
    seen = stored(3 * period + 1)
    in_turn = all(
        b.no == (a.no + 1) % SIZE and (b.ring_f != a.ring_f) == (b.no == 0)
        for a, b in pairwise(seen)
    )
    return in_turn and all(a == b for a, b in zip(seen, seen[period:], strict=False))


@numeric("chung1998-049")
def variables(*, flags: int = 2) -> int:
    """Variables on which it depends what is done next, with flags of so many values."""
    every = states(2, flags)
    return sum(
        any(
            pointer_case(state) != pointer_case(state._replace(**{name: value}))
            for state in every
            for value in {getattr(other, name) for other in every}
        )
        for name in State._fields
    )


@numeric("chung1998-011")
def pointer_cases(*, places: int = 2, flags: int = 2) -> int:
    """Cases that a ring of so many places can show, with flags of so many values."""
    return len({pointer_case(state) for state in states(places, flags)})


def shown(rounds: int) -> set[Case]:
    """Return the cases that show while fewer than so many rounds are unread."""
    table = case_table(SIZE, rounds)
    cases: tuple[Case, ...] = ("a", "b", "c", "d")
    return {case for case in cases if table[case].sum()}


@check("chung1998-012", counter={"rounds": 1})
def left_out_case_never_shows(*, rounds: int = 2) -> bool:
    """Whether case a, same flags and no < get_no, never shows with fewer rounds unread."""
    return "a" not in shown(rounds)


@check("chung1998-050", counter={"rounds": 2})
def normal_cases_are_b_and_d(*, rounds: int = 1) -> bool:
    """Whether with less than a round unread the cases b and d show, and no other."""
    return shown(rounds) == {"b", "d"}


@check("chung1998-052", counter={"rounds": 2})
def groups_have_one_normal_case(*, rounds: int = 1) -> bool:
    """Whether of the two cases with equal flags one is normal, and so with different flags."""
    groups = [
        {pointer_case(state) for state in states(2, 2) if (state[1] == state[3]) == same}
        for same in (True, False)
    ]
    return all(len(group) == 2 and len(group & shown(rounds)) == 1 for group in groups)


def case_of(get_no: int, lead: int) -> Case:
    """Return the case that shows with so many bytes stored ahead of the reader at a place."""
    ring_f, no = divmod((get_no + lead) % (2 * SIZE), SIZE)
    return pointer_case(State(no, ring_f, get_no, 0))


@check("chung1998-051", counter={"leads": range(SIZE + 1, 2 * SIZE)})
def case_c_means_an_overrun(*, leads: Sequence[int] = range(-SIZE, 2 * SIZE)) -> bool:
    """Whether bytes are overwritten wherever case c shows, for these leads of the writer.

    A lead below 0 is that of a reader which has passed the writer.
    """
    return all(
        lead > SIZE for get_no, lead in product(range(SIZE), leads) if case_of(get_no, lead) == "c"
    )


@check("chung1998-053", counter={"while_receiving": False})
def stops_behind_the_packet(*, while_receiving: bool = True) -> bool:
    """Whether the reader has a whole packet when it comes to case a and turns to sending.

    If it begins to read at the first byte, or when all are there.
    """
    ring, taken = Ring(SIZE), bytearray()
    packet = Markers(n_numbers=ITEMS).encode(dict.fromkeys(range(ITEMS), 1000))
    for byte in packet[:1] if while_receiving else packet:
        ring.store(byte)
    while (step := ring.extract()).byte is not None:
        taken.append(step.byte)
    return step.action == "stop" and bytes(taken).startswith(packet)


@check("chung1998-054", counter={"before": bytes([0xCC, 0xDD])})
def packet_is_found(*, before: bytes = bytes(5)) -> bool:
    """Whether all data of a packet are taken at every place of the ring, behind other bytes."""
    form = Markers(n_numbers=ITEMS)
    sent = {number: 1000 + number for number in range(ITEMS)}
    for place in range(SIZE):
        ring, parser = Ring(SIZE, "meant"), form.parser()
        for byte in bytes(place) + before + form.encode(sent):
            ring.store(byte)
            step = ring.extract()
            found = parser.feed(bytes([step.byte or 0]))
        if found != [tuple(sent.items())]:
            return False
    return True


@check("chung1998-023", counter={"wrap": True})
def values_are_whole(*, wrap: bool = False) -> bool:
    """Whether the printed line takes the right values wherever a packet stands in the ring."""
    table = extraction_table({number: 1000 for number in range(ITEMS)}, size=SIZE, wrap=wrap)
    return bool((table["wrong"] == 0).all())
