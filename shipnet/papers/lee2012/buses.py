"""Section III.2: the Modbus lines of Table 2, and the CAN bus between the junction boxes."""

from __future__ import annotations

from itertools import combinations, pairwise

import numpy as np

from shipnet import datasets
from shipnet.can.faults import ErrorAt
from shipnet.can.frame import TAIL, Frame, stuff
from shipnet.can.frame import decode as decode_can
from shipnet.can.messages import Message, MessageSet, bus_load
from shipnet.can.segment import DOMINANT, RECESSIVE, Segment, Signals
from shipnet.can.simulation import simulate
from shipnet.engine.can_layout import CanLayout
from shipnet.engine.faults import LostModbusFrames
from shipnet.engine.points import read_points
from shipnet.engine.simulation import simulate as simulate_engine
from shipnet.engine.system import RULE, System
from shipnet.errors import CrcError
from shipnet.modbus.frame import MAX_PDU
from shipnet.modbus.pdu import ExceptionCode, FunctionCode, Request, Response, decode
from shipnet.modbus.polling import Poll
from shipnet.modbus.uart import SerialLine
from shipnet.papers.registry import check, is_legal, numeric

_TABLE_2 = datasets.read("lee2012_table2_modbus.csv")
_PRINTED = dict(zip(_TABLE_2["parameter"], _TABLE_2["value_printed"], strict=True))
_STATIONS = dict(zip(_TABLE_2["station"], _TABLE_2["value_printed"], strict=True))

#: Table 2: bit rate [bit/s], line, and addresses of the stations.
BIT_RATE = float(_PRINTED["baud_rate"])
LINE = SerialLine(BIT_RATE, _PRINTED["data_bits"] + _PRINTED["parity"][0] + _PRINTED["stop_bits"])
AMS, JB1, JB3 = (int(_STATIONS[station]) for station in ("AMS", "JB1", "JB3"))

#: Number of points in Table 3, and therefore of registers in one request for all of them.
POINTS = int(datasets.read("lee2012_table3_sensors.csv")["quantity_points"].astype(int).sum())

#: Fig 4: widths of the fields after the silence [byte].
_FIG_4 = datasets.read("lee2012_fig4_frames.csv").query("width_byte != ''")
_WIDTHS = {
    frame: tuple(int(width) for width in fields)
    for frame, fields in _FIG_4.groupby("frame")["width_byte"]
}

_FC03 = FunctionCode.READ_HOLDING_REGISTERS


def read(registers: int, start: int = 0) -> Request:
    """Return a request for this many holding registers."""
    return Request(_FC03, start, registers)


def answer(registers: int) -> Response:
    """Return a response with this many registers, all of them 0."""
    return Response(_FC03, registers=(0,) * registers)


def whole_poll(rate: float = BIT_RATE) -> Poll:
    """Return a poll that reads all points from one junction box, one register per point."""
    return Poll(read(POINTS), SerialLine(rate, LINE.character), timeout=60)


@numeric("lee2012-021", of="bit")
@numeric("lee2012-096", of="character")
@numeric("lee2012-097", of="silence")
@numeric("lee2012-033", of="request")
@numeric("lee2012-034", of="response")
@numeric("lee2012-035", of="poll")
def duration(*, of: str, rate: float = BIT_RATE) -> float:
    """Duration of a bit or character [us], or of the other parts or all of `whole_poll` [ms]."""
    poll = whole_poll(rate)
    line = poll.line
    return {
        "bit": 1e6 * line.character_time / line.character_bits,
        "character": 1e6 * line.character_time,
        "silence": 1e3 * line.t35,
        "request": 1e3 * line.frame_time(poll.request_size),
        "response": 1e3 * line.frame_time(poll.response_size),
        "poll": 1e3 * poll.time,
    }[of]


@numeric("lee2012-022")
def silence(*, bits: int = 8, rate: float = BIT_RATE) -> float:
    """Silence between frames if a character has this many bits [us]."""
    line = SerialLine(rate, LINE.character)
    return 1e6 * line.t35 * bits / line.character_bits


@numeric("lee2012-023")
def character_bits(*, parity: bool = True, stop_bits: int = 1) -> int:
    """Bits of a character on the line, start, parity and stop bits included."""
    return SerialLine(BIT_RATE, f"8{'E' if parity else 'N'}{stop_bits}").character_bits


@numeric("lee2012-032")
def silent_characters(*, rate: float = float(SerialLine.SILENCE_LIMIT)) -> float:
    """Silence between frames, in characters."""
    return SerialLine(rate).t35 / SerialLine(rate).character_time


@check("lee2012-024", counter={"stop_bits": 2})
def setting_is_standard(*, stop_bits: int = 1) -> bool:
    """Whether a character has the standard's default of 11 bits with even parity."""
    setting = SerialLine(BIT_RATE, f"8{LINE.character[1]}{stop_bits}")
    return setting.character_bits == 11 and setting.character == SerialLine(BIT_RATE).character


@numeric("lee2012-075")
def lowest_address(*, broadcast: int = 0) -> int:
    """Lowest unit id that a slave can have."""
    return min(unit for unit in range(256) if unit != broadcast and is_legal(read(1).rtu, unit))


@numeric("lee2012-025")
def highest_address() -> int:
    """Highest unit id that a slave can have."""
    return max(unit for unit in range(256) if is_legal(read(1).rtu, unit))


@check("lee2012-026", counter={"master": JB1})
def master_is_addressed(*, master: int = AMS) -> bool:
    """Whether a request or its response contains the master's address."""
    request = read(1).rtu(JB1)
    response = answer(1).rtu(JB1)
    return master in (decode(request).unit_id, decode(response).unit_id)


@check("lee2012-076", counter={"drawn": JB1})
def response_has_this_address(*, drawn: int = AMS) -> bool:
    """Whether a response from JB1 begins with this address."""
    return answer(1).rtu(JB1)[0] == drawn


@check("lee2012-027", counter={"slaves": (JB1, JB1)})
def slaves_are_distinct(*, slaves: tuple[int, ...] = (JB1, JB3)) -> bool:
    """Whether the slaves have different addresses that the standard allows."""
    return len(set(slaves)) == len(slaves) and all(
        is_legal(read(1).rtu, unit) and unit for unit in slaves
    )


@check("lee2012-028", counter={"widths": (1, 1, 2, 1, 2)})
def request_fields(*, widths: tuple[int, ...] = _WIDTHS["request"]) -> bool:
    """Whether a standard request consists of fields of these widths."""
    start, quantity = 0x0102, POINTS
    frame = read(quantity, start).rtu(JB1)
    ends = np.cumsum([0, *widths])
    parts = [int.from_bytes(frame[a:b], "big") for a, b in pairwise(ends)]
    return sum(widths) == len(frame) and parts[:4] == [JB1, 3, start, quantity]


@numeric("lee2012-029")
def byte_count_width() -> int:
    """Bytes of a response's PDU other than its function code and its registers."""
    return len(answer(POINTS).pdu) - 1 - 2 * POINTS


@numeric("lee2012-079")
def data_width(*, registers: int = 1) -> int:
    """Data bytes of a response with this many registers; Fig 4(b) shows one register."""
    pdu = answer(registers).pdu
    return len(pdu) - 1 - byte_count_width()


@check("lee2012-030", counter={"code": 4})
def reads_holding_registers(*, code: int = int(_PRINTED["function_code"])) -> bool:
    """Whether this function code reads holding registers."""
    return FunctionCode(code) is FunctionCode.READ_HOLDING_REGISTERS


@check("lee2012-031", counter={"exceptions": True})
def data_of_two_bytes(*, exceptions: bool = False) -> bool:
    """Whether two or more bytes follow the function code; `exceptions` adds exception responses."""
    pdus = [read(1).pdu, answer(1).pdu]
    if exceptions:
        pdus.append(Response(_FC03, exception=ExceptionCode.ILLEGAL_DATA_ADDRESS).pdu)
    return min(len(pdu) - 1 for pdu in pdus) >= 2


@check("lee2012-078", counter={"quantities": (1, 126)})
def reads_one_or_several(*, quantities: tuple[int, ...] = (1, 2, POINTS)) -> bool:
    """Whether one request with function code 3 can read each of these numbers of registers."""
    return all(is_legal(read, n) and read(n).response_size == 2 + 2 * n for n in quantities)


@check("lee2012-077", counter={"gap": 3.5})
def joins_frames(*, gap: float = 3.0) -> bool:
    """Whether two frames separated by a silence of this many characters are read as one frame."""
    first, second = (read(1).rtu(unit) for unit in (JB1, JB3))
    separate = gap * LINE.character_time >= LINE.t35
    try:
        return not all(map(decode, [first, second] if separate else [first + second]))
    except CrcError:
        return True


@check("lee2012-004", counter={"others": (0b11000000000000101,)})
def crc_finds(*, others: tuple[int, ...] = ()) -> bool:
    """Whether the CRC detects all one- and two-bit errors of a request, and the `others`."""
    frame = read(POINTS).rtu(JB1)
    bits = [1 << bit for bit in range(8 * len(frame))]
    patterns = [*bits, *(a | b for a, b in combinations(bits, 2))]
    # Polynomials have their highest power first, and so does a byte on the line its lowest bit.
    patterns += [int(f"{pattern:b}"[::-1], 2) for pattern in others]
    value = int.from_bytes(frame, "little")
    return not any(is_legal(decode, (value ^ p).to_bytes(len(frame), "little")) for p in patterns)


@numeric("lee2012-036")
def most_registers(*, longest_pdu: int = MAX_PDU) -> int:
    """Largest number of registers in one response."""
    return (longest_pdu - len(answer(1).pdu) + 2) // 2


@numeric("lee2012-098")
def drawn_response(*, widths: tuple[int, ...] = _WIDTHS["response"]) -> int:
    """Bytes of the response in Fig 4(b)."""
    return sum(widths)


@numeric("lee2012-057")
def time_to_response(*, request: int = 8, response: int = 8, rate: float = BIT_RATE) -> float:
    """Time from a request's start to the end of the response in Fig 4, without processing [us]."""
    line = SerialLine(rate, LINE.character)
    return 1e6 * (line.frame_time(request) + line.t35 + line.frame_time(response))


# CAN -------------------------------------------------------------------------------------------

#: Two messages that are released at once.
TOGETHER = MessageSet([Message("first", 0x100, 8, 1.0), Message("second", 0x200, 8, 1.0)])


@numeric("lee2012-038")
@numeric("lee2012-080", extended=True)
def identifier_bits(*, extended: bool = False) -> int:
    """Bits of the highest legal arbitration id."""
    bits = 0
    while is_legal(Message, "highest", 2 ** (bits + 1) - 1, 8, 1.0, extended=extended):
        bits += 1
    return bits


@check("lee2012-037", counter={"disturbed": (100e-6,)})
def destroys_both(*, disturbed: tuple[float, ...] = ()) -> bool:
    """Whether frames that begin together destroy each other and are sent again, as with CSMA/CD."""
    run = simulate(TOGETHER, 125e3, until=0.5, faults=[ErrorAt(time) for time in disturbed])
    return bool((run.events()["retries"] > 0).any())


@check("lee2012-068", counter={"timeout": 2.5})
def asks_and_sends_again(*, timeout: float | None = None) -> float:
    """Margin by which a lost Modbus poll is repeated within 2 s, if CAN repeats a damaged frame."""
    sent = simulate(TOGETHER, 125e3, until=0.5, faults=ErrorAt(100e-6)).events()
    on_can = sent["retries"].max() > 0 and (sent["outcome"] == "sent").all()
    lost, rng = [LostModbusFrames("1", request=1.0)], np.random.default_rng(0)
    system = System() if timeout is None else System(timeout=timeout)
    requests = simulate_engine(system, faults=lost, until=5, rng=rng).requests()
    return 1 - float(np.diff(requests["time_s"])[0]) / RULE if on_can else -1.0


def _first_frame(data: bytes = bytes(8)) -> Frame:
    """Return the first frame of JB1, which has the highest priority."""
    return Frame(CanLayout(read_points()).messages()[0].arbitration_id, data)


def _signals(segment: Segment | None = None) -> Signals:
    """Return the beginning of JB1's first frame on 60 m of cable between three boxes."""
    return (segment or Segment(60, nodes=3)).send({1: _first_frame().bits[:14]}, 125e3)


@check("lee2012-041", counter={"terminated": False})
def terminators_suit_the_line(*, terminated: bool = True) -> bool:
    """Whether three boxes on 60 m read JB1's bits correctly with terminators, or without."""
    bare = Segment(60, nodes=3, terminator=None)
    return not _signals(None if terminated else bare).wrong


@check("lee2012-107", counter={"volts": 0.6})
def receivers_tolerate(*, volts: float = 0.4) -> float:
    """Margin by which the boxes tolerate noise up to this between the wires [V]."""
    signals = _signals().table()
    dominant = float(signals["least_dominant_V"].min()) - DOMINANT
    return min(dominant, RECESSIVE - float(signals["most_recessive_V"].max())) / volts - 1


@check("lee2012-106", counter={"patterns": (0b1100010110011001,)})
def can_finds_errors(*, patterns: tuple[int, ...] = ()) -> bool:
    """Whether all bursts of 1 to 15 wrong bits in a CAN frame are detected, and the `patterns`.

    A pattern falsifies the last bits of the CRC sequence and those before it.
    """
    frame = _first_frame(bytes(range(8)))
    sent = int(frame.bits, 2)
    wrong = [
        f"{sent ^ ((1 << length) - 1 << place):0{len(frame.bits)}b}"
        for length in range(1, 16)
        for place in range(1, len(frame.bits) - length)  # receivers ignore the last bit of EOF
    ]
    body = frame.unstuffed
    for pattern in patterns:
        changed = stuff(f"{int(body, 2) ^ pattern:0{len(body)}b}")
        wrong.append(changed + "".join(bits for _, bits in TAIL))
    return not any(is_legal(decode_can, bits) for bits in wrong)


@numeric("lee2012-109", of="stuff_bits")
@numeric("lee2012-113", of="crc")
def part_of_first_frame(*, of: str, value: int = 0) -> int:
    """Stuff bits or CRC of JB1's first frame if all its data bytes have this value."""
    return int(getattr(_first_frame(bytes([value]) * 8), of))


@check("lee2012-083", counter={"kept": 4})
def identifiers_tell_messages_apart(*, kept: int = 11) -> bool:
    """Whether each message has its own identifier, and still if only this many bits are kept."""
    numbers = [m.arbitration_id % 2**kept for m in CanLayout(read_points()).messages()]
    return len(set(numbers)) == len(numbers)


@numeric("lee2012-043")
def can_messages(*, bits: int = 16) -> int:
    """Number of CAN messages for all points, at this many bits per point."""
    return len(CanLayout(read_points(), bits).messages())


@numeric("lee2012-044")
def time_per_update(*, bits: int = 16, bit_rate: float = 125e3) -> float:
    """Bus time of one update of all points, with the maximum number of stuff bits [ms]."""
    return 1e3 * float(CanLayout(read_points(), bits).volume()["worst_bits"]["all"]) / bit_rate


@numeric("lee2012-100")
def can_load(*, period: float = 1.0, bit_rate: float = 125e3) -> float:
    """Bus load of one update per period [%]."""
    messages = CanLayout(read_points()).messages(period)
    return 100 * bus_load(messages, bit_rate)


@check("lee2012-081", counter={"within": 5e-3})
def all_arrive(*, within: float = 0.1) -> float:
    """Margin by which all frames, released at once, arrive intact within this time [s]."""
    messages = CanLayout(read_points()).messages()
    sent = simulate(messages, 125e3, until=0.5).events()
    intact = (sent["outcome"] == "sent").all() and not sent["retries"].any()
    complete = intact and len(sent) == len(messages)
    return 1 - float(sent["end_ms"].max()) / 1e3 / within if complete else -1.0
