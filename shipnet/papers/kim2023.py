"""What kim2023 prints, recomputed: AS-Interface for smart ships.

R. G. Kim, Y. H. Cho, K. H. Hyun, "AS-Interface protocol utilization for smart ships", Journal of
the Society of Naval Architects of Korea 60(6), 482-490, 2023, doi 10.3744/SNAK.2023.60.6.482.
"""

from __future__ import annotations

from shipnet import datasets
from shipnet.asi import BIT_TIME, Call, Profile, Request, Response, Transaction
from shipnet.asi.frame import REQUEST_BITS, RESPONSE_BITS, frame
from shipnet.asi.telegram import Half
from shipnet.design import asi_conductors, hardwired_conductors, lines_needed
from shipnet.errors import FrameError
from shipnet.papers import tables
from shipnet.papers.registry import check, numeric

__all__ = ["even_ones", "master_pause_of_chip"]

_EXAMPLES = datasets.read("kim2023_examples.csv").set_index("name")["bits"]
EXAMPLE_REQUEST = str(_EXAMPLES["request"])
EXAMPLE_RESPONSE = str(_EXAMPLES["response"])

# Frames that a chip maker prints whole: the independent witnesses of the parity rule.
DATASHEET_FRAMES = tuple(datasets.read("asi_datasheet_frames.csv")["bits"])


# Counts of slaves, wires and points


@numeric("kim2023-001", "icn2007-010", "icn2007-019")
def slaves_per_master(*, address_bits: int = 5, halves: int = 2) -> int:
    """Every address but 0, each for an A and a B slave."""
    return ((1 << address_bits) - 1) * halves


@numeric("kim2023-002")
def hardwired_strands(*, slaves: int = 62, inputs: int = 4) -> int:
    """Two wires for each input contact of each module."""
    return hardwired_conductors({"contact": slaves * inputs})


@numeric("kim2023-003")
def asi_strands(*, lines: int = 1) -> int:
    """One line of two wires for all modules."""
    return asi_conductors(lines)


@numeric("kim2023-004")
def strands_left(*, slaves: int = 62, inputs: int = 4, lines: int = 1) -> float:
    """Strands that AS-i leaves of the hardwired ones, in percent."""
    return 100 * asi_strands(lines=lines) / hardwired_strands(slaves=slaves, inputs=inputs)


@numeric("kim2023-005")
def reach(*, segment: float = 100, repeaters: int = 2) -> float:
    """Metres from the master through repeaters in series, one more segment each."""
    return segment * (repeaters + 1)


@numeric("kim2023-072")
def submarine_hardwired(*, slaves: int = 190) -> int:
    """One contact of two wires a slave: the basis on which the printed number comes out."""
    return hardwired_conductors({"contact": slaves})


@numeric("kim2023-073")
def submarine_asi(*, masters: int = 14) -> int:
    """Two wires a master."""
    return asi_conductors(masters)


@numeric("kim2023-074")
def submarine_left(*, slaves: int = 190, masters: int = 14) -> float:
    """Strands that AS-i leaves on the submarine, in percent."""
    return 100 * submarine_asi(masters=masters) / submarine_hardwired(slaves=slaves)


@check("kim2023-083", counter={"second_case": 496 / 62})
def same_wires_per_slave(*, first_case: float = 496 / 62, second_case: float = 380 / 190) -> bool:
    """Whether both savings count the same number of hardwired strands for a slave."""
    return first_case == second_case


@numeric("kim2023-075")
def points_per_master(*, slaves: int = 62, points: int = 4) -> int:
    """Four points on each of 62 slaves."""
    return slaves * points


@check("kim2023-076", counter={"profile": "S-7.F"})
def four_outputs_each(*, profile: str = "S-7.A.E") -> bool:
    """Whether a slave that shares its address, as 62 on a line must, has four output bits."""
    return Profile.parse(profile).output_bits == 4


@numeric("kim2023-062")
def lines_for_fermenter(*, valves: int = 400) -> int:
    """Lines for one slave a valve."""
    return lines_needed(valves)


@numeric("kim2023-069")
def slaves_per_submarine_master(*, slaves: int = 190, masters: int = 14) -> float:
    """Average load of a master."""
    return slaves / masters


@numeric("kim2023-070")
def submarine_cable(*, masters: int = 14, repeaters: int = 5, segment: float = 100) -> float:
    """Metres of cable if every segment is as long as it may be."""
    return (masters + repeaters) * segment


@numeric("kim2023-071")
def valves_per_slave(*, valves: int = 200, slaves: int = 190) -> float:
    """Valves for each slave, of which one has four inputs and three or four outputs."""
    return valves / slaves


# Bits of a telegram


@numeric("kim2023-008", "icn2007-022")
def bits_per_cycle(
    *, response: int = RESPONSE_BITS, start: int = 1, parity: int = 1, end: int = 1
) -> int:
    """User bits of a response: what start, parity and end bit leave of it."""
    return response - start - parity - end


@numeric("kim2023-026", "icn2007-011")
def request_length(
    *,
    start: int = 1,
    control: int = 1,
    address: int = 5,
    information: int = 5,
    parity: int = 1,
    end: int = 1,
) -> int:
    """Bits of a request, field by field."""
    return start + control + address + information + parity + end


@numeric("kim2023-027", "icn2007-012")
def response_length(*, start: int = 1, information: int = 4, parity: int = 1, end: int = 1) -> int:
    """Bits of a response, field by field."""
    return start + information + parity + end


@numeric("kim2023-036")
def example_length(*, bits: str = EXAMPLE_REQUEST) -> int:
    """Bits of the example."""
    return len(bits)


@numeric("kim2023-037")
def example_address(*, bits: str = EXAMPLE_REQUEST) -> int:
    """A4..A0 of the example, read in place: as a whole it breaks the parity rule."""
    return int(bits[2:7], 2)


@numeric("kim2023-038")
def example_data(*, bits: str = EXAMPLE_REQUEST) -> int:
    """D3..D0 of the example."""
    return int(bits[8:12], 2)


@numeric("kim2023-039")
def example_answer(*, bits: str = EXAMPLE_RESPONSE) -> int:
    """Data of the example response."""
    return Response.parse(bits).data


def even_ones(bits: str, *, end_bit: bool = False) -> bool:
    """Tell whether a telegram has an even number of ones, the end bit counted or not."""
    return (bits if end_bit else bits[:-1]).count("1") % 2 == 0


@check("kim2023-040", "icn2007-037", counter={"bits": Request.data_exchange(21, 0xE).bits})
def example_request_parity(*, bits: str = EXAMPLE_REQUEST) -> bool:
    """Whether the example request obeys the parity rule of the standard."""
    try:
        Request.parse(bits)
    except FrameError:
        return False
    return True


@check("kim2023-041", counter={"bits": "0011011"})
def example_response_parity(*, bits: str = EXAMPLE_RESPONSE) -> bool:
    """Whether the example response obeys the parity rule of the standard."""
    return even_ones(bits)


@check("kim2023-081", counter={"frames": (EXAMPLE_REQUEST,)})
def parity_counts_all_bits(*, frames: tuple[str, ...] = DATASHEET_FRAMES) -> bool:
    """Whether frames of a chip maker have even ones when the end bit counts too."""
    return all(even_ones(bits, end_bit=True) for bits in frames)


@check("kim2023-082", counter={"request": Request.data_exchange(21, 0xE).bits})
def one_rule_for_both(*, request: str = EXAMPLE_REQUEST, response: str = EXAMPLE_RESPONSE) -> bool:
    """Whether any single rule passes both example telegrams."""
    return any(
        even_ones(request, end_bit=rule) and even_ones(response, end_bit=rule)
        for rule in (False, True)
    )


@check("kim2023-084", counter={"start": "1"})
def start_0_end_1(*, start: str = "0", end: str = "1") -> bool:
    """Whether every request and every response starts and ends with these bits."""
    telegrams = [Response(data).bits for data in range(16)]
    telegrams += [Request.data_exchange(a, d).bits for a in range(1, 32) for d in range(16)]
    return all(bits[0] == start and bits[-1] == end for bits in telegrams)


@check("kim2023-085", counter={"calls": (Call.DATA_EXCHANGE, Call.RESET)})
def control_bit_0(
    *, calls: tuple[Call, ...] = (Call.DATA_EXCHANGE, Call.WRITE_PARAMETER, Call.ASSIGN_ADDRESS)
) -> bool:
    """Whether control bit 0 marks these requests, and no others."""
    return set(calls) == {call for call in Call if call.rule.pattern[0] == "0"}


# The calls


@check("kim2023-042", counter={"half": "B"})
def masters_before_2_1(*, half: Half | None = None) -> bool:
    """Whether a control request sends 0 where S stands, and 1 where its inverse stands."""
    sent = {"s": "0", "S": "1"}
    for call in Call:
        layout = call.rule.pattern
        for letter in sent.keys() & set(layout):
            if Request(call, 1, half=half).bits[1 + layout.index(letter)] != sent[letter]:
                return False
    return True


@check("kim2023-043", counter={"half": "B"})
def a_slave_like_standard(*, half: Half = "A") -> bool:
    """Whether the requests to this half are those that a standard slave gets.

    Where an A/B slave has its inverted select bit, a standard slave has data bit 3: data 0 to
    the A half is data 8 to the standard slave.
    """
    for call in Call:
        if "s" in call.rule.layout(extended=True).lower():
            standard = Request(call, 21, 8 if call.rule.extended else 0)
            if Request(call, 21, 0, half).bits != standard.bits:
                return False
    return True


@check("kim2023-044", counter={"header": ("A4", "A3", "A2", "A1", "A0")})
def header_names_five_bits(*, header: tuple[str, ...] = ()) -> bool:
    """Whether the header of Table 5 names each address bit once, from the highest down."""
    columns = ["A4", "A3", "A2", "A1", "A0"]
    names = (
        list(header)
        or tables.printed("Table 5").loc[["HEADER"], columns].to_numpy().ravel().tolist()
    )
    return names == columns


@numeric("kim2023-045")
def calls_of_the_standard(*, calls: tuple[Call, ...] = tuple(Call)) -> int:
    """Calls in the data sheets' table; the paper's Table 5 lists one less."""
    return len(calls)


def _row_agrees(call: str, columns: list[str]) -> bool:
    printed, generated = tables.printed("Table 5"), tables.generated("Table 5")
    return bool((printed.loc[[call], columns] == generated.loc[[call], columns]).all(axis=None))


@check("kim2023-046", counter={"address": 0})
def write_id1_to_any_address(*, address: int = 21) -> bool:
    """Whether the bits of write ID code 1 may carry this address: then they mean that call.

    With another address than 0, and data 0, they are the bits of delete address.
    """
    return Request.parse(frame(f"1{address:05b}00000")).call is Call.WRITE_ID1


@check("kim2023-047", counter={"calls": ("READ_STATUS", "READ_ID")})
def select_marks(*, calls: tuple[str, ...] = ("DELETE_ADDRESS", "RESET")) -> bool:
    """Whether Table 5 inverts the select bit where the standard does."""
    return all(_row_agrees(call, ["I3"]) for call in calls)


@check("kim2023-048", counter={"call": "DATA_EXCHANGE"})
def parameter_letters(*, call: str = "WRITE_PARAMETER") -> bool:
    """Whether Table 5 gives the bits that this call carries their names."""
    return _row_agrees(call, ["I2", "I1", "I0"])


@check("kim2023-049", counter={"expected": "01111111010101"})
def broadcast_bits(*, expected: str = DATASHEET_FRAMES[0]) -> bool:
    """Whether Table 5's broadcast, with its parity, is the frame that a data sheet prints."""
    row = tables.printed("Table 5").loc[["BROADCAST_RESET"]].to_numpy().ravel().tolist()
    return frame("".join(row[1:-2])) == expected


@check("kim2023-051", counter={"data": "1", "parameter": "0"})
def information_bit_4(*, data: str = "0", parameter: str = "1") -> bool:
    """Whether I4 tells a data request from a parameter request, with these values."""
    bits = tables.generated("Table 5").loc[["DATA_EXCHANGE", "WRITE_PARAMETER"], "I4"]
    return list(bits) == [data, parameter]


@check("kim2023-086", counter={"call": Call.RESET})
def assigned_at_address_0(*, call: Call = Call.ASSIGN_ADDRESS) -> bool:
    """Whether this call can only go to a slave at address 0."""
    return call.rule.pattern[1:6] == "00000"


@check("kim2023-080", counter={"address": 1})
def address_0_refuses(*, address: int = 0) -> bool:
    """Whether data and parameter requests to this address are refused."""
    refused = 0
    for call in (Call.DATA_EXCHANGE, Call.WRITE_PARAMETER):
        try:
            Request(call, address)
        except ValueError:
            refused += 1
    return refused == 2


@numeric("kim2023-055")
def io_codes(*, bits: int = 4) -> int:
    """Codes that the four bits of a response can tell apart."""
    return 1 << bits


@check("kim2023-056", counter={"table": "Table 5"})
def io_code_cells(*, table: str = "Table 7") -> bool:
    """Whether all cells of the printed table are those that the code generates."""
    return tables.differences(table).empty


# Captions


@check("kim2023-007", counter={"cited": "Table 2"})
def cited_table_is_emc(*, cited: str = "Table 1") -> bool:
    """Whether the table that the text cites for EMC has a caption that speaks of it."""
    return "EMC" in _captions()[cited]


@check("kim2023-052", counter={"pair": ("Table 4", "Table 6")})
def captions_differ(*, pair: tuple[str, str] = ("Table 4", "Table 5")) -> bool:
    """Whether two tables have captions of their own, additions in brackets aside."""
    first, second = (_captions()[item].split("(")[0].strip() for item in pair)
    return first != second


def _captions() -> dict[str, str]:
    items = datasets.read("figures_tables.csv")
    items = items[items["paper"] == "kim2023"]
    return dict(zip(items["item"], items["caption"], strict=True))


# Time


@numeric("kim2023-020")
def bit_time_from_rate(*, rate: float = 167e3) -> float:
    """Microseconds a bit, from the rate that the paper prints."""
    return 1e6 / rate


@numeric("kim2023-021", "icn2007-006")
def gross_rate(*, bit_time: float = BIT_TIME) -> float:
    """Kilobits a second, from the bit time."""
    return 1e-3 / bit_time


@numeric("kim2023-022")
def half_bit(*, bit_time: float = BIT_TIME) -> float:
    """Microseconds of a Manchester half-bit."""
    return 1e6 * bit_time / 2


def master_pause_of_chip(*, edge: float, bit_time: float = BIT_TIME) -> float:
    """Pause in bit times, from a chip's delay between two edges.

    The data sheet counts from the middle of the request's end bit to the first edge of the
    response, which is the middle of its start bit: half a bit belongs to either telegram.
    """
    return edge / bit_time - 1


@check("kim2023-028", "icn2007-014", counter={"synchronous": 10e-6})
def master_pause_in_range(*, synchronous: float = 21.5e-6, asynchronous: float = 33.5e-6) -> bool:
    """Whether the delays of a chip (A2SI data sheet) are pauses of 2 to 10 bit times."""
    pauses = [master_pause_of_chip(edge=edge) for edge in (synchronous, asynchronous)]
    return all(2 <= pause <= 10 for pause in pauses)


@check("kim2023-030", "icn2007-016", counter={"longest": 12e-6})
def slave_pause_at_most_2(*, longest: float = 500e-6) -> bool:
    """Whether the pause after a response never exceeds 2 bit times; OMRON W357 allows 500 us."""
    return longest <= 2 * BIT_TIME


@numeric("kim2023-031")
def shortest_transaction(*, master_pause: float = 2, slave_pause: float = 1.5) -> float:
    """Bit times with the shortest pauses that are printed."""
    return Transaction(master_pause, slave_pause).bits


@numeric("kim2023-032", "icn2007-030")
def long_transaction(*, master_pause: float = 3, slave_pause: float = 2) -> float:
    """Bit times with the pauses on which vendors base their 156 us."""
    return Transaction(master_pause, slave_pause).bits


@numeric("kim2023-033")
def unanswered_transaction(*, request: int = REQUEST_BITS, timeout: float = 10) -> float:
    """Bit times until a master that hears nothing may send again."""
    return request + timeout


@numeric("kim2023-034")
def cycle_standard(
    *, slaves: int = 31, transaction: float = 26, bit_time: float = BIT_TIME
) -> float:
    """Milliseconds to poll all slaves once, with one more request for inclusion."""
    return 1e3 * (slaves + 1) * transaction * bit_time


@numeric("kim2023-035")
def cycle_extended(
    *, pairs: int = 31, transaction: float = 26, bit_time: float = BIT_TIME
) -> float:
    """Milliseconds until every A and every B slave was polled: two cycles."""
    return 2 * cycle_standard(slaves=pairs, transaction=transaction, bit_time=bit_time)
