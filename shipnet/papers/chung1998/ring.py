"""Sections 3.1, 4.2, 4.3 and 5: the ring, its cases, extraction, repair, trials."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache
from itertools import product
from typing import Literal

import numpy as np

from shipnet.fields import check_whole
from shipnet.lazy import pd
from shipnet.papers.chung1998.link import ITEMS, PRINTED, as_printed, length
from shipnet.papers.registry import check, numeric
from shipnet.remote_control.faults import Stall
from shipnet.remote_control.packet import PACKET_START, MarkerFormat
from shipnet.remote_control.ring_buffer import Case, Ring, State, bytes_of, case_of
from shipnet.remote_control.simulation import simulate
from shipnet.remote_control.system import System

#: Longest time to write a byte into an EEPROM of the 1990s [s]: Atmel, AT28C64B, data sheet,
#: "write cycle time 10 ms maximum". We assume that the paper's chip is similar.
WRITE_TIME = 10e-3

#: The three trials of section 5: name, presses of Enter, and the abnormal states that the paper
#: reports; of the second the paper says only that it was "also" normal.
TRIALS = (
    ("no parameter change", 0, 0),
    ("parameter change", 1, 0),
    ("10 presses of Enter", 10, 1),
)

#: Bytes stored by one press of the Enter key: we assume a 16-bit integer.
BYTES_PER_PRESS = 2

#: Section 5: size of the ring [byte].
SIZE = int(PRINTED["ring_size"])


def states(places: int, flags: int) -> list[State]:
    """Return all states of a ring with this many places, and this many values of each flag."""
    return [State(*four) for four in product(*2 * (range(places), range(flags)))]


@numeric("chung1998-033")
def virtual_rings(*, with_flag: bool = True) -> int:
    """Number of laps that the writer's variables distinguish, with or without the flag."""
    ring, seen = Ring(SIZE), set()
    for _ in range(4 * SIZE):
        seen.add(ring.state[:2] if with_flag else ring.state[:1])
        ring.store(0)
    return len(seen) // SIZE


@numeric("chung1998-049")
def variables(*, flags: int = 2) -> int:
    """Number of variables on which the case depends if a flag has this many values."""
    every = states(2, flags)
    return sum(
        any(
            state.case != state._replace(**{name: value}).case
            for state in every
            for value in {getattr(other, name) for other in every}
        )
        for name in State._fields
    )


@numeric("chung1998-011")
def cases(*, places: int = 2, flags: int = 2) -> int:
    """Number of cases that the states of a ring belong to."""
    return len({state.case for state in states(places, flags)})


def shown(rounds: int) -> set[Case]:
    """Return the cases that occur while fewer than this many laps are unread."""
    table = Ring(SIZE).cases().table()[:rounds]
    cases: tuple[Case, ...] = ("a", "b", "c", "d")
    return {case for case in cases if table[case].sum()}


@check("chung1998-012", counter={"rounds": 1})
def case_a_never_occurs(*, rounds: int = 2) -> bool:
    """Whether case a cannot occur while fewer than this many laps are unread."""
    return "a" not in shown(rounds)


@check("chung1998-050", counter={"rounds": 2})
def normal_cases(*, rounds: int = 1) -> bool:
    """Whether only cases b and d occur while fewer than this many laps are unread."""
    return shown(rounds) == {"b", "d"}


@check("chung1998-052", counter={"rounds": 2})
def groups_have_one_normal_case(*, rounds: int = 1) -> bool:
    """Whether exactly one case with equal flags is normal, and exactly one with different flags."""
    groups = [
        {state.case for state in states(2, 2) if (state[1] == state[3]) == same}
        for same in (True, False)
    ]
    return all(len(group) == 2 and len(group & shown(rounds)) == 1 for group in groups)


@check("chung1998-051", counter={"leads": range(SIZE + 1, 2 * SIZE)})
def case_c_means_an_overrun(*, leads: Sequence[int] = range(-SIZE, 2 * SIZE)) -> bool:
    """Whether case c always means overwritten bytes; if a lead is negative, the reader is ahead."""
    return all(
        lead > SIZE
        for get_no, lead in product(range(SIZE), leads)
        if case_of(get_no, lead, SIZE) == "c"
    )


@check("chung1998-053", counter={"while_receiving": False})
def stops_behind_the_packet(*, while_receiving: bool = True) -> bool:
    """Whether the reader has a complete packet when it stops in case a."""
    ring = Ring(SIZE)
    packet = MarkerFormat(n_numbers=ITEMS).encode(dict.fromkeys(range(ITEMS), 1000))
    ring.store_all(packet[:1] if while_receiving else packet)
    steps = ring.drain()
    return steps[-1].action == "stop" and bytes_of(steps).startswith(packet)


@check("chung1998-054", counter={"before": bytes([0xCC, 0xDD])})
def packet_is_found(*, before: bytes = bytes(5)) -> bool:
    """Whether a packet that follows other bytes is found at every place of the ring."""
    form = MarkerFormat(n_numbers=ITEMS)
    sent = {number: 1000 + number for number in range(ITEMS)}
    for offset in range(SIZE):
        ring, parser = Ring(SIZE, "intended"), form.parser()
        for byte in bytes(offset) + before + form.encode(sent):
            ring.store(byte)
            step = ring.extract()
            packets = parser.feed(bytes([step.byte or 0]))
        if packets != [tuple(sent.items())]:
            return False
    return True


@check("chung1998-023", counter={"wrap": False})
def values_are_whole(*, wrap: bool = True) -> bool:
    """Whether the right values are extracted wherever the packet is, if indices wrap around."""
    return not places_with_a_wrong_value(wrap=wrap)


@numeric("chung1998-077")
def places_with_a_wrong_value(*, items: int = ITEMS, wrap: bool = False) -> int:
    """Number of places of a packet at which the line of code extracts a wrong value."""
    table = extraction(dict.fromkeys(range(items), 1000), wrap=wrap)
    return int((table["wrong"] > 0).sum())


@check("chung1998-034", counter={"with_flag": False})
def ring_counts_as_two(*, with_flag: bool = True) -> bool:
    """Whether one ring distinguishes as many positions as two rings of its size."""
    return virtual_rings(with_flag=with_flag) == 2


# Values extracted from the ring ------------------------------------------------------------


def extraction(
    items: Mapping[int, int], packet_format: MarkerFormat | None = None, *, wrap: bool = False
) -> pd.DataFrame:
    """Count the bytes read outside the ring, and the wrong values, for each place of a packet.

    A column per item number shows whether its value is wrong.

    Without `wrap`, indices can pass the end of the ring, where we assume two zero bytes in memory.
    """
    form = packet_format or MarkerFormat()
    packet = form.encode(items)
    check_whole("bytes of the packet", len(packet), 0, SIZE)
    laid, true = np.array([*packet.ljust(SIZE, b"\0")]), np.reshape(form.decode(packet), (-1, 2))
    first, step = len(form.head) + len(form.lead), len(form.lead) + 3
    rows = []
    for offset in range(SIZE):
        cells = np.roll(laid, offset)
        memory = np.append(cells, cells[:2] * wrap)
        places = (offset + first + step * np.arange(len(true))) % SIZE
        taken = np.stack([memory[places], memory[places + 1] | memory[places + 2] << 8], axis=1)
        outside = np.maximum(places + 3 - SIZE, 0).sum() * (not wrap)
        wrong = (taken != true).any(axis=1)
        rows.append((offset, outside, wrong.sum(), *wrong))
    return pd.DataFrame(rows, columns=["offset", "outside", "wrong", *true[:, 0]])


# Overrun, repair, trials -------------------------------------------------------------------


def stored_in(size: int, received: bytes) -> Ring:
    """Return a ring in which these bytes have been stored and none read."""
    ring = Ring(size)
    ring.store_all(received)
    return ring


@cache
def repaired_rings(items: int = 0) -> list[Ring]:
    """Return rings in case c after their repair, for every place of the writer.

    They contain packets of this many data items, one ring for each byte at which a packet can
    begin. Without data items they contain only 0xCC.
    """
    phases = length(reading="A", items=items) if items else 1
    stream = bytes([PACKET_START]) * 2 * SIZE
    if items:
        stream = MarkerFormat(n_numbers=items).stream(2 * SIZE + phases)
    rings = [
        stored_in(SIZE, stream[phase : phase + SIZE + no])
        for no, phase in product(range(SIZE), range(phases))
    ]
    for ring in rings:
        ring.extract()
    return rings


def given_up(items: int = 0) -> list[int]:
    """Return how many stored bytes each repair of `repaired_rings` discards."""
    return [SIZE - ring.unread for ring in repaired_rings(items)]


def packets_found(waiting: int, rule: Literal["intended", "corrected"], get_no: int = 0) -> int:
    """Return how many packets are found intact in a ring after this many bytes have arrived."""
    check_whole("waiting", waiting, 0, 10**6)
    form = MarkerFormat(n_numbers=ITEMS)
    count = waiting // form.size(ITEMS) + 1
    sent = [dict.fromkeys(range(ITEMS), n) for n in range(1, count + 1)]
    ring = Ring.filled(0, get_no, SIZE, rule)
    ring.store_all(b"".join(map(form.encode, sent))[:waiting])
    packets = form.parser().feed(bytes_of(ring.drain()))
    return sum(tuple(packet.items()) in packets for packet in sent)


def recovered(waiting: Sequence[int] = range(0, 3 * SIZE + 1, 8)) -> pd.DataFrame:
    """Return how many packets the intended and the corrected ring yield after ``waiting`` bytes.

    ``intended`` is the mean over places of the reader, ``stops`` the fraction of them in case a.
    """
    size, places, rows = length(reading="A"), range(0, SIZE, 8), []
    for n in waiting:
        counts = [packets_found(n, "intended", get_no=place) for place in places]
        stops = [case_of(place, n, SIZE) == "a" for place in places]
        # The corrected ring works in the same way wherever the reader is.
        corrected = packets_found(n, "corrected", get_no=places[0])
        mean, stopped = (sum(column) / len(places) for column in (counts, stops))
        rows.append((n, n // size, mean, min(counts), max(counts), stopped, corrected))
    columns = ["waiting", "sent", "intended", "fewest", "most", "stops", "corrected"]
    return pd.DataFrame(rows, columns=columns)


@check("chung1998-013", counter={"shift": 2})
def repair_restores_order(*, shift: int = 1) -> bool:
    """Whether each repair ends in case b or d, at the first 0xCC from `SIZE >> shift` or from 0."""
    for ring in repaired_rings(ITEMS):
        middle = SIZE >> shift
        start = ring.cells.find(PACKET_START, middle if ring.state.no < middle else 0)
        if ring.state.get_no != start or ring.case not in ("b", "d"):
            return False
    return True


@check("chung1998-057", counter={"toggled": False})
def toggled_flag_restores_order(*, toggled: bool = True) -> bool:
    """Whether the ring is in case b once the reader has been moved to its start."""
    return all(
        state._replace(ring_get_f=state.ring_get_f if toggled else 1 - state.ring_get_f).case == "b"
        for state in (ring.state for ring in repaired_rings())
        if state.no >= SIZE >> 1
    )


@check("chung1998-055", counter={"items": 45})
def repair_keeps_a_part(*, items: int = ITEMS) -> bool:
    """Whether every repair in case c keeps some of the ring's bytes."""
    return max(given_up(items)) < SIZE


@numeric("chung1998-060")
def fill_time() -> float:
    """Time in which received bytes fill the ring [s]."""
    return as_printed().fill_time


@numeric("chung1998-061")
def packets_in_ring(*, size: int = SIZE, items: int = ITEMS) -> float:
    """Number of packets that fit into the ring."""
    return size / length(reading="A", items=items)


@numeric("chung1998-015")
def abnormal_states(*, empty_is_empty: bool = True) -> int:
    """Repairs as 100 packets are read byte by byte; the printed rule also reads an empty ring."""
    ring = Ring(SIZE, "intended" if empty_is_empty else "printed")
    repairs = 0
    for byte in MarkerFormat(n_numbers=ITEMS).stream(100 * length(reading="A")):
        ring.store(byte)
        # At most one step per place, because the printed rule reads an empty ring for ever.
        for _ in range(SIZE):
            step = ring.extract()
            repairs += step.action == "repair"
            if step.action in ("wait", "stop"):
                break
    return repairs


@check("chung1998-058", counter={"stall": 14.0})
def parameter_change_does_no_harm(*, stall: float = BYTES_PER_PRESS * WRITE_TIME) -> bool:
    """Whether the ring stays in a normal case if a task stalls for this assumed time [s]."""
    run = simulate(as_printed(), faults=Stall("BCS", start=5.0, stop=5.0 + stall), until=25.0)
    return not bool(run.events()["event"].str.startswith("ring").any())


@check("chung1998-021", counter={"size": SIZE})
def larger_ring_is_not_overrun(*, size: int = 2 * SIZE, stall: float = 0.2) -> bool:
    """Whether a ring is in a normal case after a stall [s] during which bytes keep arriving."""
    came = round(stall / as_printed().character_time)
    return stored_in(size, MarkerFormat(n_numbers=ITEMS).stream(came)).case in ("b", "d")


def ring_trials(system: System | None = None) -> pd.DataFrame:
    """Return how often the ring is in an abnormal state in the paper's three trials.

    BCS writes its EEPROM after 5 s, in the second trial for one press of the Enter key and in the
    third for ten. The paper does not give the write time.
    """
    link = System(repeat=10) if system is None else system
    rows = []
    for trial, presses, printed in TRIALS:
        stall = presses * BYTES_PER_PRESS * WRITE_TIME
        faults = [Stall("BCS", start=5.0, stop=5.0 + stall)] if stall else []
        run = simulate(link, faults=faults, until=8.0)
        events = int(run.events()["event"].str.startswith("ring").sum())
        rows.append((trial, stall, events, run.max_unread, len(run.alarms()), printed))
    columns = ["trial", "stall_s", "events", "unread", "alarms", "paper_events"]
    return pd.DataFrame(rows, columns=columns)
