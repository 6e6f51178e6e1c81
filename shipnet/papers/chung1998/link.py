"""Sections 1 to 4.1 and 5: stations, packets, turns, supervision, error detection."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import combinations, pairwise, product
from typing import Any, Literal

import numpy as np

from shipnet import datasets
from shipnet.errors import ArgumentError
from shipnet.fields import check_whole
from shipnet.lazy import pd
from shipnet.papers.chung1998.usart import Status, Usart, send
from shipnet.papers.registry import check, is_legal, numeric
from shipnet.remote_control.experiment import recommend, switch_staleness
from shipnet.remote_control.faults import HOPS, STATIONS, DeadStation, Hop, LostPacket
from shipnet.remote_control.packet import MarkerFormat
from shipnet.remote_control.simulation import Change, Run, simulate, switch_delays
from shipnet.remote_control.station import Sender
from shipnet.remote_control.system import BIT_RATES, VALUES, Supervision, System

#: The printed parameters by name: `chung1998_parameters.csv`.
_TABLE = datasets.read("chung1998_parameters.csv")
PRINTED = dict(zip(_TABLE["parameter"], _TABLE["value"], strict=True))

#: Number of inputs of an 8259, and of counters of an 8253, from Intel's data sheets.
_INPUTS, _COUNTERS = 8, 3

# Each line needs an interrupt for received bytes and its own clock; supervision needs another
# interrupt and clock. Sending needs no interrupt, because the sending loop polls the chip.


@check("chung1998-001", counter={"lines": 3})
def chips_are_enough(*, lines: int = int(PRINTED["chips_8251"])) -> bool:
    """Whether interrupt inputs and counters are enough for this many lines and the supervision."""
    return lines + 1 <= _INPUTS and lines + 1 <= _COUNTERS


@numeric("chung1998-029")
def serial_chips(*, hops: tuple[Hop, ...] = tuple(h for h in HOPS if h[0] == "RCS")) -> int:
    """Number of serial chips, one per partner, that the station with the most partners needs."""
    return max(sum(station == source for source, _ in hops) for station in STATIONS)


@check("chung1998-030", counter={"flows": HOPS[:3]})
def values_have_flows(*, flows: Sequence[Hop] = HOPS) -> bool:
    """Whether these data flows carry every value."""
    return all(hop in flows for value in VALUES for hop in value.hops)


def send_loops(
    packet: bytes, waiting: bytes = b"12", polls: Sequence[float] = (20e-6,)
) -> pd.DataFrame:
    """Return what the printed and the intended loop send through an idle and a busy chip.

    The line runs at 9600 bit/s. The time per poll affects only the printed loop with a busy chip.
    """
    if not polls:
        raise ArgumentError("polls is empty; it must contain at least one time [s]")
    ways = [("idle", b"", "printed", polls[0]), ("idle", b"", "intended", polls[0])]
    ways += [("busy", waiting, "printed", poll) for poll in polls]
    ways += [("busy", waiting, "intended", polls[0])]
    rows = []
    for state, before, loop, poll in ways:
        chip = Usart(10 / 9600)
        for byte in before:
            chip.write(byte, 0.0)
        sent = send(chip, packet, printed=loop == "printed", poll=poll)
        rows.append((state, loop, 1e6 * poll, sent.line.hex(" "), sent.writes, sent.lost))
    columns = ["chip", "loop", "poll [us]", "on the line", "writes", "bytes lost"]
    return pd.DataFrame(rows, columns=columns)


@check("chung1998-008", counter={"printed": False})
def loop_sends_each_byte(*, printed: bool = True) -> bool:
    """Whether the loop sends every byte of a packet exactly once through an idle chip."""
    packet = bytes.fromhex("cc dd 03 34 12 ee")
    return send(Usart(10 / 9600), packet, printed=printed).line == packet


@numeric("chung1998-009")
def ready_bit(*, written: int = 1) -> int:
    """Number of the highest status bit that is set after this many bytes are written."""
    chip = Usart(10 / 9600)
    for _ in range(written):
        chip.write(0, 0.0)
    return int(chip.status(0.0) & (Status.TXRDY | Status.TXEMPTY)).bit_length() - 1


# The packet --------------------------------------------------------------------------------

#: Section 5: number of data items in the trial.
ITEMS = int(PRINTED["data_count"])

#: Section 3.2: flags for the start of a packet, the start of its data and its end.
FLAGS = tuple(
    int(PRINTED[f"{flag}_flag"], 16) for flag in ("packet_start", "data_start", "packet_end")
)

_FIELDS = datasets.read("chung1998_packet_format.csv")
_DATUM = tuple(_FIELDS.loc[_FIELDS["kind"] == "data", "field"])


@numeric("chung1998-004", reading="A")
@numeric("chung1998-038", reading="B")
@numeric("chung1998-039", reading="C")
def length(*, reading: Literal["A", "B", "C"], items: int = ITEMS) -> int:
    """Bytes needed to send this many data items; in reading C each item has its own packet."""
    if reading == "C":
        return check_whole("items", items, 0, 204) * MarkerFormat("A").size(1)
    return MarkerFormat(reading, max(items, 1)).size(items)


@check("chung1998-005", counter={"order": ("number", "high", "low")})
def datum_is_number_low_high(*, order: tuple[str, ...] = _DATUM) -> bool:
    """Whether each of the 65536 values can be decoded from three bytes in this order."""
    numbers = range(128)
    form = MarkerFormat(n_numbers=len(numbers))
    for start in range(0, 1 << 16, len(numbers)):
        sent = form.encode({number: start + number for number in numbers})[2:-1]
        fields = dict(zip(order, np.reshape([*sent], (-1, 3)).T, strict=True))
        values = fields["low"] | fields["high"] << 8
        if (fields["number"] != numbers).any() or (values != start + fields["number"]).any():
            return False
    return True


def flags_at(reading: Literal["A", "B"], items: int) -> list[tuple[int, int]]:
    """Return the position and value of each flag in a packet of this many data items."""
    packet = MarkerFormat(reading, items).encode(dict.fromkeys(range(items), 0))
    return [(index, byte) for index, byte in enumerate(packet) if byte >= min(FLAGS)]


@check("chung1998-037", counter={"flags": (0xCC, 0xEE, 0xDD)})
def flags_stand_in_order(*, flags: tuple[int, ...] = FLAGS) -> bool:
    """Whether these flags mark packet start, data start and packet end in all three readings."""
    start, data, end = flags
    once = [(0, start), (1, data)]
    return (
        flags_at("A", ITEMS) == [*once, (length(reading="A") - 1, end)]
        and flags_at("A", 1) == flags_at("B", 1) == [*once, (5, end)]
        and flags_at("B", ITEMS)
        == [(0, start), *((1 + 4 * k, data) for k in range(ITEMS)), (length(reading="B") - 1, end)]
    )


@check("chung1998-036", counter={"numbered": False})
def any_subset_can_be_sent(*, numbered: bool = True) -> bool:
    """Whether each subset of ten data items is stored in the right places."""
    form = MarkerFormat(n_numbers=ITEMS)
    choices = (chosen for k in range(ITEMS + 1) for chosen in combinations(range(ITEMS), k))
    for chosen in choices:
        sent = {number: 1000 + number for number in chosen}
        items = form.decode(form.encode(sent))
        places = [number if numbered else index for index, (number, _) in enumerate(items)]
        if dict(zip(places, (value for _, value in items), strict=True)) != sent:
            return False
    return True


@check("chung1998-010", counter={"lost": 1})
def copies_stay_equal(*, lost: int = 0) -> bool:
    """Whether sending only changes keeps both tables equal if this many packets are lost.

    The length of each of 200 packets must be 3 bytes, plus 3 bytes per changed data item.
    """
    rng = np.random.default_rng(2024)
    form = MarkerFormat(n_numbers=ITEMS)
    sender, sending, table = Sender(ITEMS), [0] * ITEMS, [0] * ITEMS
    for turn in range(200):
        before = list(sending)
        for number in rng.choice(ITEMS, rng.integers(0, 4), replace=False):
            sending[number] = int(rng.integers(1 << 16))
        packet = form.encode(sender.items(sending))
        if len(packet) != 3 + 3 * sum(a != b for a, b in zip(before, sending, strict=True)):
            return False
        for number, value in form.decode(packet) if turn < 200 - lost else ():
            table[number] = value
    return table == sending


# Turns, supervision, switches --------------------------------------------------------------


def as_printed(items: int = ITEMS, **fields: Any) -> System:
    """Return the paper's link in reading A, with all data in every packet."""
    return System(MarkerFormat(n_numbers=items), repeat=items, **fields)


@check("chung1998-031", counter={"turn_timeout": 0.01})
def never_both_send(*, turn_timeout: float | None = None) -> bool:
    """Whether a sender listens as soon as it has finished, and no two packets overlap."""
    form = MarkerFormat(n_numbers=ITEMS)
    run = simulate(System(form, repeat=ITEMS, turn_timeout=turn_timeout), until=1.0)
    apart = all(one.end <= other.start for one, other in pairwise(run.packets))
    listening = run.states().query("state == 'receiving' and time_s > 0")
    ends = [packet.end for packet in run.packets if packet.end <= run.until]
    return apart and listening["time_s"].tolist() == ends


@numeric("chung1998-007", "chung1998-045")
def time_to_report() -> float:
    """Longest time until a dead partner is reported [s]."""
    return Supervision().detection_time[1]


@check("chung1998-043", counter={"readings": ("A", "B")})
def sign_of_life_is_enough(*, readings: tuple[Literal["A", "B"], ...] = ("A",)) -> bool:
    """Whether a healthy link without changes raises no alarm, in these readings of the packet."""
    idle = (System(MarkerFormat(reading, ITEMS)) for reading in readings)
    return all(len(simulate(system, until=8.0).alarms()) == 0 for system in idle)


def alarms(run: Run) -> set[tuple[str, str]]:
    """Return each station that raises an alarm, with the partner that it reports as failed."""
    table = run.alarms()
    return set(zip(table["station"], table["partner"], strict=True))


@check("chung1998-044", counter={"miss": 99})
def nobody_waits_for_ever(*, miss: int = Supervision().miss_limit) -> bool:
    """Whether all stations that wait for a dead partner stop waiting within 20 s."""
    rule = Supervision(miss_limit=miss)
    system = as_printed(master=rule, slave=rule)
    deaths = [DeadStation(dead, start=1.0) for dead in STATIONS]
    missed = [alarms(simulate(system, until=21.0, faults=death)) for death in deaths]
    return set.union(*missed) >= set(HOPS)


@numeric("chung1998-003", of="cycle")
@numeric("chung1998-047", of="silence")
def time_on_the_link(*, of: str, items: int = ITEMS) -> float:
    """Cycle time without processing, or silence at BCS while RCS waits for a dead SS [s]."""
    link = as_printed(items)
    return {"cycle": link.cycle_time, "silence": link.cascade().silent[1]}[of]


@numeric("chung1998-046")
def longest_silence(*, rate: float = BIT_RATES[-1], items: int = ITEMS) -> float:
    """Longest time without a packet at a slave on a healthy link [s]."""
    return as_printed(items, bit_rate=rate).idle_time


def deaths(changes: Mapping[str, Mapping[str, Any]]) -> pd.DataFrame:
    """Count how many of 30 failures of SS, spread over a cycle, lead to each failure report.

    Only the report by RCS that SS has failed is correct. There is one row per rule: `changes` maps
    the name of a rule to the fields of `System` that the rule changes. The bit rate is 600 bit/s.
    """
    pairs = (("RCS", "SS"), ("RCS", "BCS"), ("BCS", "RCS"))
    runs, rows = 30, []
    for name, fields in changes.items():
        system = as_printed(bit_rate=600, **fields)
        rng, cycle, reports = np.random.default_rng(2024), system.cycle_time, []
        for k in range(runs):
            # SS fails in the second cycle; the last report comes within four detection times.
            death = DeadStation("SS", start=(1 + (k + 0.5) / runs) * cycle)
            end = death.start + 4 * system.master.detection_time[1] + cycle
            reports.append(alarms(simulate(system, until=end, faults=death, rng=rng)))
        rows.append((name, runs, *(sum(pair in seen for seen in reports) for pair in pairs)))
    columns = ["rule", "deaths", *(f"{a} reports {b}" for a, b in pairs)]
    return pd.DataFrame(rows, columns=columns)


@check("chung1998-017", counter={"all_data": True})
def speed_has_little_effect(*, all_data: bool = False, limit: float = 1.0) -> float:
    """Margin by which SS follows every switch within `limit` [s] at each bit rate."""
    system = System(MarkerFormat(n_numbers=ITEMS), repeat=ITEMS if all_data else 0)
    table = switch_delays(system, changes=10, rng=2024)
    followed = (table["followed"] == 10).all()
    return 1 - float(table["longest_s"].max()) / limit if followed else -1.0


@check("chung1998-065", counter={"lost": True})
def switches_agree(*, lost: bool = False) -> float:
    """Margin by which SS shows the new state of a bridge switch within `PATIENCE`."""
    faults = [LostPacket("BCS", "RCS", start=1.0)] if lost else []
    system, move = System(MarkerFormat(n_numbers=ITEMS)), Change(1.0, "BCS", 1, 1)
    run = simulate(system, move, faults=faults, until=12.0)
    return 1 - float(run.delays("SS")["delay_s"].fillna(np.inf).max()) / PATIENCE


# Error detection ---------------------------------------------------------------------------

#: How long a partner may be silent and, in our judgement, a switch value may be wrong [s].
PATIENCE = float(PRINTED["failure_time"])


@numeric("chung1998-018")
@numeric("chung1998-067", items=1)
def crc_share(*, items: int = ITEMS) -> float:
    """Percentage by which a CRC lengthens a packet of this many data items."""
    plain, checked = (MarkerFormat(n_numbers=items, crc=crc).size(items) for crc in (False, True))
    return 100 * (checked - plain) / plain


@check("chung1998-019", counter={"crc": True})
def flags_alone_decide(*, crc: bool = False) -> bool:
    """Whether each packet with one wrong bit is refused if the bit is in a flag, and only then."""
    form = MarkerFormat(crc=crc)
    packet = form.encode(dict.fromkeys(range(ITEMS), 1000))
    flags = [place for place, _ in flags_at("A", ITEMS)]
    for place, bit in product(range(len(packet)), range(8)):
        wrong = bytearray(packet)
        wrong[place] ^= 1 << bit
        if is_legal(form.decode, bytes(wrong)) is (place in flags):
            return False
    return True


@numeric("chung1998-076")
def missed_flips(*, items: int = ITEMS) -> float:
    """Percentage of the single bit errors in a packet that the flags do not show."""
    return 100 * MarkerFormat(n_numbers=ITEMS).undetected_flips(items)


@numeric("chung1998-020")
def imitations(*, value_bytes: int = 2 * ITEMS, flags: int = len(FLAGS)) -> float:
    """Percentage of packets with random values in which a value byte equals a flag."""
    return 100 * MarkerFormat.false_sync(value_bytes, flags)


@check("chung1998-066", counter={"few": ITEMS, "many": 1})
def crc_costs_more(*, few: int = 1, many: int = ITEMS) -> bool:
    """Whether a CRC lengthens a packet of `few` data items by a larger percentage."""
    return crc_share(items=few) > crc_share(items=many)


@check("chung1998-074", counter={"changed": 7})
def changes_are_shorter(*, changed: int = 6) -> float:
    """Margin by which this many numbered items need fewer bytes than all ten without numbers."""
    form = MarkerFormat(n_numbers=ITEMS)
    return 1 - form.size(changed) / (form.size(ITEMS) - ITEMS)


@check("chung1998-075", counter={"rate": 1e-13})
def flags_are_recommended(*, items: int = 3, rate: float = 1e-5) -> bool:
    """Whether the flags alone are recommended for this many values at this bit error rate."""
    return recommend(items, rate=rate).check == "markers"


@check("chung1998-071", counter={"rate": 7e-12})
def check_depends_on_the_number(*, rate: float = 1e-5) -> bool:
    """Whether the recommended check differs between few and many values."""
    return len({recommend(n, rate=rate).check for n in (1, 3, 10, 40)}) > 1


@check("chung1998-072", counter={"items": 80})
def changes_arrive_soon(*, items: int = ITEMS, limit: float = 1.0) -> float:
    """Margin by which a change on the bridge reaches SS within `limit` [s], all data being sent."""
    return 1 - as_printed(items).response_time() / limit


@check("chung1998-048", counter={"first": 1})
def stations_take_turns(*, first: int = 0) -> bool:
    """Whether RCS sends to BCS, BCS answers, and RCS and SS follow, from packet `first` on."""
    packets = simulate(as_printed(), until=2.0).packets[first:]
    order = [("RCS", "BCS"), ("BCS", "RCS"), ("RCS", "SS"), ("SS", "RCS")]
    return all(
        (packet.source, packet.target) == order[k % len(order)] for k, packet in enumerate(packets)
    )


@check("chung1998-068", counter={"interval": 3600.0})
def loss_does_no_harm(*, interval: float = 1.0) -> float:
    """Margin by which values are right within `PATIENCE`, on average, after a failed packet.

    They change every `interval` [s]. Assumed: one data item per packet, a bit error rate of 1e-5.
    """
    form = MarkerFormat(n_numbers=ITEMS)
    shares, period = form.error_shares(1, 1e-5), System(form).cycle_time
    _, duration = switch_staleness(shares, period, interval, "changed")
    return 1 - duration / PATIENCE


@check("chung1998-069", counter={"place": 3})
def data_until_next_packet_are_lost(*, place: int = 0) -> bool:
    """Whether an error in this byte costs the data of its packet, but of no other packet."""
    form = MarkerFormat(n_numbers=ITEMS)
    stream = b"".join(form.encode({0: turn, 1: turn}) for turn in range(1, 6))
    hit = bytearray(stream)
    hit[2 * form.size(2) + place] ^= 1
    parser = form.parser()
    turns = [items[0][1] for items in parser.feed(bytes(hit))]
    return turns == [1, 2, 4, 5] and parser.discarded == form.size(2)


@check("chung1998-070", counter={"per_packet": 1})
def one_error_costs_much(*, per_packet: int = 40) -> bool:
    """Whether a wrong end flag costs over half of 40 data items, `per_packet` in each packet."""
    data = dict.fromkeys(range(40), 1)
    form = MarkerFormat(n_numbers=40)
    parts = [dict(list(data.items())[k : k + per_packet]) for k in range(0, 40, per_packet)]
    stream = bytearray(b"".join(form.encode(part) for part in parts))
    stream[form.size(per_packet) - 1] ^= 1
    taken = {number for items in form.parser().feed(bytes(stream)) for number, _ in items}
    return len(data) - len(taken) > len(data) / 2
