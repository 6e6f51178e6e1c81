"""Sections 3.3 to 3.6, Tables 4 to 7: telegrams, calls, conductors, addresses, times."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from itertools import pairwise

import numpy as np
import pandas as pd

from shipnet import datasets, style
from shipnet.asi.commands import ChangeAddress, ReadCodes
from shipnet.asi.faults import DeadSlave, MasterFailure
from shipnet.asi.master import Master
from shipnet.asi.plan import Plan
from shipnet.asi.profile import Profile
from shipnet.asi.rules import rule_limits
from shipnet.asi.segment import Repeater, Supply
from shipnet.asi.simulation import Run, Standby, simulate
from shipnet.asi.slave import Slave
from shipnet.asi.telegram import REQUEST_BITS, Call, Half, Request, Response, frame
from shipnet.asi.timing import BIT_TIME, Cycle, Transaction, exchanges
from shipnet.design.plant import Plant, lines_needed
from shipnet.fields import check_choice
from shipnet.lazy import Axes
from shipnet.line.network import CableRun
from shipnet.papers.registry import check, drawing, is_legal, numeric

# Section 3.4: the bits of a request and of a response, and their parity.

_EXAMPLES = datasets.read("kim2023_examples.csv").set_index("name")["bits"]

#: The request and the response of Fig 5, as printed.
EXAMPLE_REQUEST, EXAMPLE_RESPONSE = str(_EXAMPLES["request"]), str(_EXAMPLES["response"])

#: Frames that a chip maker prints in full: an independent source for the parity rule.
DATASHEET_FRAMES = tuple(datasets.read("asi_datasheet_frames.csv")["bits"])


@numeric("kim2023-026")
def request_bits() -> int:
    """Bits of a request."""
    return len(Request.data_exchange(21, 0xE).bits)


@numeric("kim2023-027")
def response_bits() -> int:
    """Bits of a response."""
    return len(Response(0x6).bits)


# The bits of a request and of a response without start, parity and end bit.


@numeric("kim2023-008")
def response_word() -> int:
    """Bits of a response without start, parity and end bit."""
    return len(Response(0x6).bits) - len(frame(""))


def read_in_place(bits: str) -> Request:
    """Decode a request without checking its parity bit, which is wrong in the example."""
    return Request.parse(frame(bits[1:-2]))


@numeric("kim2023-037")
def example_address(*, bits: str = EXAMPLE_REQUEST) -> int:
    """Address in a request."""
    return read_in_place(bits).address


@numeric("kim2023-038")
def example_data(*, bits: str = EXAMPLE_REQUEST) -> int:
    """Data in a request."""
    return read_in_place(bits).data


@numeric("kim2023-039")
def example_answer(*, bits: str = EXAMPLE_RESPONSE) -> int:
    """Data in a response."""
    return Response.parse(bits).data


def even_ones(bits: str, *, end_bit: bool = False) -> bool:
    """Return whether the number of ones in a telegram is even; `end_bit` includes the end bit."""
    return (bits if end_bit else bits[:-1]).count("1") % 2 == 0


@check("kim2023-040", counter={"bits": Request.data_exchange(21, 0xE).bits})
def example_is_legal(*, bits: str = EXAMPLE_REQUEST) -> bool:
    """Whether a request can be decoded, parity bit included."""
    return is_legal(Request.parse, bits)


@check("kim2023-081", counter={"frames": (EXAMPLE_REQUEST,)})
def datasheet_frames_are_even(*, frames: tuple[str, ...] = DATASHEET_FRAMES) -> bool:
    """Whether the number of ones in these frames, end bit included, is even."""
    return all(even_ones(bits, end_bit=True) for bits in frames)


@check("kim2023-082", counter={"request": Request.data_exchange(21, 0xE).bits})
def one_rule_for_both(*, request: str = EXAMPLE_REQUEST, response: str = EXAMPLE_RESPONSE) -> bool:
    """Whether both example telegrams obey one parity rule, with the end bit or without it."""
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


# Section 3.4, Tables 4 to 7: the bits of the calls, and the labels of the tables.


@check("kim2023-085", counter={"calls": (Call.DATA_EXCHANGE, Call.RESET)})
def control_bit_0(
    *, calls: tuple[Call, ...] = (Call.DATA_EXCHANGE, Call.WRITE_PARAMETER, Call.ASSIGN_ADDRESS)
) -> bool:
    """Whether the control bit is 0 in these requests and in no others."""
    return set(calls) == {call for call in Call if call.rule.layout(False)[0] == "0"}


@check("kim2023-042", counter={"half": "B"})
def masters_before_2_1(*, half: Half | None = None) -> bool:
    """Whether commands to this half (None: a standard slave) send S as 0 and its inverse as 1."""
    sent = {"s": "0", "S": "1"}
    for call in Call:
        layout = call.rule.pattern
        for letter in sent.keys() & set(layout):
            if Request(call, 1, half=half).bits[1 + layout.index(letter)] != sent[letter]:
                return False
    return True


@check("kim2023-043", counter={"half": "B"})
def a_slave_like_standard(*, half: Half = "A") -> bool:
    """Whether requests to this half equal requests with data bit 3 = 1 to a standard slave."""
    for call in Call:
        if "s" in call.rule.layout(extended=True).lower():
            standard = Request(call, 21, 8 if call.rule.extended else 0)
            if Request(call, 21, 0, half).bits != standard.bits:
                return False
    return True


@numeric("kim2023-045")
def number_of_calls(*, calls: tuple[Call, ...] = tuple(Call)) -> int:
    """Number of calls."""
    return len(calls)


def _row_agrees(call: str, columns: list[str]) -> bool:
    theirs, ours = (cells.loc[call, columns] for cells in (printed("Table 5"), table("Table 5")))
    return bool((theirs == ours).all())


@check("kim2023-046", counter={"address": 0})
def writes_id1(*, address: int = 21) -> bool:
    """Whether information bits 00000 to this address write ID code 1."""
    return Request.parse(frame(f"1{address:05b}00000")).call is Call.WRITE_ID1


@check("kim2023-048", counter={"call": "DATA_EXCHANGE"})
def information_bits_agree(*, call: str = "WRITE_PARAMETER") -> bool:
    """Whether Table 5 prints bits I2 to I0 of this call as they are sent."""
    return _row_agrees(call, ["I2", "I1", "I0"])


@check("kim2023-049", counter={"expected": "01111111010101"})
def broadcast_bits(*, expected: str = DATASHEET_FRAMES[0]) -> bool:
    """Whether Table 5's broadcast, with computed parity, equals the frame in a data sheet."""
    row = printed("Table 5").loc[["BROADCAST_RESET"]].to_numpy().ravel().tolist()
    return frame("".join(row[1:-2])) == expected


@check("kim2023-051", counter={"data": "1", "parameter": "0"})
def information_bit_4(*, data: str = "0", parameter: str = "1") -> bool:
    """Whether I4 has these values in a data request and in a parameter request."""
    bits = table("Table 5").loc[["DATA_EXCHANGE", "WRITE_PARAMETER"], "I4"]
    return list(bits) == [data, parameter]


@check("kim2023-086", counter={"call": Call.RESET})
def address_bits_are_0(*, call: Call = Call.ASSIGN_ADDRESS) -> bool:
    """Whether the address bits of this call are 00000."""
    return call.rule.layout(False)[1:6] == "00000"


@check("kim2023-080", counter={"address": 1})
def address_0_refuses(*, address: int = 0) -> bool:
    """Whether data and parameter requests to this address are illegal."""
    calls = (Call.DATA_EXCHANGE, Call.WRITE_PARAMETER)
    return not any(is_legal(Request, call, address) for call in calls)


@numeric("kim2023-055")
def io_codes() -> int:
    """Number of I/O codes."""
    return len(Profile.table())


@check("kim2023-056", counter={"item": "Table 5"})
def table_agrees(*, item: str = "Table 7") -> bool:
    """Whether a table agrees with ours in every cell."""
    return differences(item).empty


@check("kim2023-052", counter={"shift": 1})
def references_fit(*, shift: int = 0) -> bool:
    """Whether the words with which the text cites each table occur in that table's caption."""
    words = {1: "EMC", 2: "steps", 4: "(detail)", 5: "Slave data map", 6: "I/O configuration"}
    return all(word in _captions()[f"Table {number + shift}"] for number, word in words.items())


@check("kim2023-094", counter={"codes": (0xA,)})
def codes_are_extended(*, codes: tuple[int, ...] = (0xA, 0xB)) -> bool:
    """Whether slaves with these ID codes have extended addresses."""
    return all(Profile(7, code).extended for code in codes)


def _captions() -> dict[str, str]:
    items = datasets.read("figures_tables.csv")
    items = items[items["paper"] == "kim2023"]
    return dict(zip(items["item"], items["caption"], strict=True))


# Tables 4 to 7, generated by the code that encodes and decodes.


def requests() -> pd.DataFrame:
    """Return the bits of every request; the first row repeats the column names."""
    requests = Request.table()
    header = pd.DataFrame([requests.columns], index=["HEADER"], columns=requests.columns)
    return pd.concat([header, requests]).rename_axis("call")


#: The file that transcribes each table, and the function that generates the table.
_TABLES: Mapping[str, tuple[str, Callable[[], pd.DataFrame]]] = {
    "Table 4": ("kim2023_table4_request_fields.csv", lambda: Request.fields().astype(str)),
    "Table 5": ("kim2023_table5_requests.csv", requests),
    "Table 6": ("kim2023_table6_response_fields.csv", lambda: Response.fields().astype(str)),
    "Table 7": ("kim2023_table7_io_codes.csv", Profile.table),
}


def printed(item: str) -> pd.DataFrame:
    """Return the cells of a printed table as text, indexed by its first column."""
    rows = datasets.read(_TABLES[check_choice("item", item, _TABLES)][0])
    return rows.set_index(rows.columns[0]).drop(columns="name_printed", errors="ignore")


def table(item: str) -> pd.DataFrame:
    """Return a table, such as ``"Table 5"``, as the code generates it."""
    return _TABLES[check_choice("item", item, _TABLES)][1]()


def differences(item: str) -> pd.DataFrame:
    """Return the cells of a table that differ from the printed ones, with claim and reason.

    A row that is in only one of the two tables is listed once, with an empty column name.
    """
    theirs, ours = printed(item), table(item)
    rows = []
    for row in ours.index.union(theirs.index, sort=False):
        if row not in theirs.index or row not in ours.index:
            pair = ("a row", "no row") if row in theirs.index else ("no row", "a row")
            rows.append((item, row, "", *pair))
            continue
        for column in ours.columns:
            pair = theirs.loc[row, column], ours.loc[row, column]
            if pair[0] != pair[1]:
                rows.append((item, row, column, *pair))
    cells = pd.DataFrame(rows, columns=["table", "row", "column", "printed", "ours"])
    reasons = datasets.read("kim2023_table_differences.csv")
    return cells.merge(reasons, on=["table", "row", "column"], how="left")


# Sections 3.3, 3.5 and 3.6: how many slaves, conductors and points.


@numeric("kim2023-001", halves=("A", "B"))
def slaves_per_master(*, halves: tuple[Half | None, ...]) -> int:
    """Number of slaves that data requests can address, one per address and half."""
    return sum(
        is_legal(Request, Call.DATA_EXCHANGE, address, 0, half)
        for address in range(256)
        for half in halves
    )


# The 300 m example has modules with four digital inputs. For the submarine, one contact per slave
# gives the printed number of conductors.


@numeric("kim2023-002", slaves=62, inputs=4)
@numeric("kim2023-072", slaves=190, inputs=1)
def hardwired_conductors(*, slaves: int, inputs: int) -> int:
    """Conductors without a bus: two per input contact of each module."""
    return Plant(slaves, inputs).saving.hardwired


@numeric("kim2023-003", lines=1)
@numeric("kim2023-073", lines=14)
def asi_conductors(*, lines: int) -> int:
    """Conductors with AS-i: two per line; each line has one master."""
    return Plant(62, 4, lines=lines).saving.bus


@numeric("kim2023-004", slaves=62, inputs=4, lines=1)
@numeric("kim2023-074", slaves=190, inputs=1, lines=14)
def conductors_left(*, slaves: int, inputs: int, lines: int) -> float:
    """Conductors with AS-i, as a percentage of those with hardwiring."""
    return 100 * Plant(slaves, inputs, lines=lines).saving.left


@numeric("kim2023-005")
def reach(*, repeaters: int = 2) -> float:
    """Distance to the farthest slave with repeaters in series [m]; NaN unless all rules are met."""
    longest = float(rule_limits()["high"]["cable_length"])
    ends = [f"{k}" for k in range(repeaters + 1)]
    plan = Plan(
        [CableRun(end, f"{end} far", longest) for end in ends],
        masters=[Master(node="0")],
        supplies=[Supply(end) for end in ends],
        slaves=[Slave("1", node=f"{ends[-1]} far")],
        repeaters=[Repeater(f"{a} far", b) for a, b in pairwise(ends)],
    )
    return longest * len(ends) if plan.check().ok else math.nan


@numeric("kim2023-075")
def points_per_line() -> int:
    """Number of inputs and outputs of a line full of A and B slaves."""
    return slaves_per_master(halves=("A", "B")) * len(Profile(io=0, id=0xA).ports)


@check("kim2023-076", counter={"profile": "S-7.F"})
def has_four_outputs(*, profile: str = "S-7.A.E") -> bool:
    """Whether a slave with this profile has four outputs."""
    return Profile.parse(profile).output_bits == 4


@numeric("kim2023-062")
def lines_for_valves(*, valves: int = 400) -> int:
    """Number of lines that this many valves need."""
    return lines_needed(valves)


@numeric("kim2023-069")
def slaves_per_line(*, slaves: int = 190, masters: int = 14) -> float:
    """Mean number of slaves of a master."""
    return slaves / masters


@numeric("kim2023-070")
def total_length(*, masters: int = 14, repeaters: int = 5, segment: int = 100) -> int:
    """Length of cable that masters and repeaters allow [m]."""
    return (masters + repeaters) * segment


@numeric("kim2023-071")
def valves_per_slave(*, valves: int = 200, slaves: int = 190) -> float:
    """Mean number of valves of a slave."""
    return valves / slaves


# Figs 7 and 9, whose printed pictures were not available: the positions are ours.

#: Largest number of slaves on one line.
_FULL = 62


@drawing("kim2023", "Fig 7")
def _valves(*, valves: int = 400, ax: Axes) -> Axes:
    """Draw valves on as many lines as they need, one slave per valve."""
    from shipnet.papers.plot import FILL, box

    lines = lines_needed(valves)
    for row in range(lines):
        here = min(_FULL, valves - row * _FULL)
        box(ax, (-9.5, -row - 0.35), 8, 0.7, FILL["blue"], f"master {row + 1}")
        ax.plot([-1.5, here], [-row, -row], color="0.3", lw=1)
        ax.plot(np.arange(1, here + 1), np.full(here, -row), "o", color="C2", markersize=4)
        ax.text(here + 1, -row, f"{here} valves", va="center")
    return style.bare(ax, (-10, _FULL + 12), (-lines + 0.4, 0.6))


@drawing("kim2023", "Fig 9")
def _index_table(*, ax: Axes) -> Axes:
    """Draw ten drive units and twenty airboxes around an index table, all on one line."""
    from shipnet.papers.plot import FILL, box

    slaves = 30
    angle = np.pi - 2 * np.pi * (np.arange(slaves) + 0.5) / slaves
    turn = np.linspace(0, 2 * np.pi, 200)
    ax.fill(0.72 * np.cos(turn), 0.72 * np.sin(turn), color="0.93")
    ax.text(0, 0, "rotary\nindex table", ha="center", va="center")
    x, y = np.cos(angle), np.sin(angle)
    ax.plot([-1.35, *x], [0, *y], color="0.3", lw=1, zorder=0)
    drive = np.arange(slaves) % 3 == 0
    ax.plot(x[drive], y[drive], "s", color="C1", markersize=7, label="10 drive units")
    ax.plot(x[~drive], y[~drive], "o", color="C0", markersize=7, label="20 airboxes")
    box(ax, (-2.15, -0.16), 0.8, 0.32, FILL["blue"], "master")
    ax.legend(loc="center left", bbox_to_anchor=(0.95, 0.5))
    ax.set_aspect("equal")
    return style.bare(ax, (-2.3, 1.2), (-1.15, 1.15))


# Section 3.4, commands (c) to (e): addresses and ID codes of slaves, on a simulated line.


@check("kim2023-091", counter={"target": "3"})
def moves(*, target: str = "9") -> bool:
    """Whether a slave in operation can be given this address, and then responds at it."""
    slaves = [Slave(label) for label in "123"]
    run = simulate(slaves, until=0.3, commands=[(0.05, ChangeAddress("2", target))])
    calls = run.events().query("slave in ['0', '2']")["call"].tolist()
    in_order = "DELETE_ADDRESS" in calls and calls.index("DELETE_ADDRESS") < calls.index(
        "ASSIGN_ADDRESS"
    )
    later = run.events().query("time_s > 0.25 and call == 'DATA_EXCHANGE' and outcome == 'ok'")
    return in_order and target in set(later["slave"])


@check("kim2023-097", counter={"labels": ("1A", "1A")})
def codes_tell_apart(*, labels: tuple[str, str] = ("1A", "1B")) -> bool:
    """Whether the master reads different ID codes 1 from two slaves with these labels."""
    slaves = [Slave(label, id1=k) for label, k in zip(labels, (1, 2), strict=True)]
    commands = [(0.05, ReadCodes(label)) for label in sorted(set(labels))]
    run = simulate(slaves, until=0.2, commands=commands)
    answers = run.events().query("time_s > 0.05 and call == 'READ_ID1' and outcome == 'ok'")
    return len(set(answers["response_data"])) == 2


@check("kim2023-054", counter={"silence": 0.1})
def outputs_are_reset(*, silence: float = 0.06) -> bool:
    """Whether a slave resets its outputs after the master has been silent for this time [s]."""
    master = Master({"1": "S-0.F.F"})
    failure, standby = MasterFailure(start=0.1), Standby(master, silence=silence)
    run = simulate([Slave("1")], master, until=0.3, faults=failure, standby=standby)
    return len(run.watchdogs) > 0


@check("kim2023-100", counter={"call": Call.DELETE_ADDRESS})
def reset_is_acknowledged(*, call: Call = Call.RESET) -> bool:
    """Whether a slave responds to this call with 6 and keeps its address."""
    slave = Slave("21")
    table = slave.listen(["", Request(call, 21).bits, "", Request(Call.READ_ID, 21).bits])
    return ": 6" in table["answer"].iloc[1] and table["answer"].iloc[3] != "silence"


#: Addresses of five slaves.
ADDRESSES = range(1, 6)


def five_slaves() -> list[Slave]:
    """Return five slaves with four inputs each."""
    return [Slave(f"{address}") for address in ADDRESSES]


def gap_after_silence(run: Run, slave: str) -> float:
    """Return how long the master waits for a missing response [bit]."""
    rows = run.events()
    silent = rows.index[(rows["slave"] == slave) & (rows["outcome"] == "SilenceError")]
    start = rows["time_s"].to_numpy()
    bit_time = run.transaction.bit_time
    return float(min(start[silent[:-1] + 1] - start[silent[:-1]])) / bit_time - REQUEST_BITS


@check("kim2023-089", repeats=True, counter={"wait": 11.0})
def goes_on_after(*, repeats: bool, wait: float = 10.0) -> bool:
    """Whether the master waits `wait` bit times for a response and, if `repeats`, tries again."""
    run = simulate(five_slaves(), cycles=20, faults=[DeadSlave("3", start=0.02)])
    repeated = (run.events().query("slave == '3'")["attempt"] == 1).any()
    return bool(repeated or not repeats) and round(gap_after_silence(run, "3"), 6) == wait


# Section 3.4: durations of bits, pauses and cycles.

_PUBLISHED = datasets.read("asi_published_timing.csv").set_index("quantity")["value_us"]

#: Edge-to-edge delays between request and response, printed by a chip maker [s]: minimum and
#: maximum of a synchronous slave, then of an asynchronous one.
CHIP_EDGES = tuple(
    1e-6 * float(_PUBLISHED[f"edge to edge, {state}, {end}"])
    for state in ("synchronous", "asynchronous")
    for end in ("least", "most")
)


@numeric("kim2023-020", unit=1e-6)
def bit_time(*, unit: float) -> float:
    """Duration of a bit as a multiple of `unit`, which is in seconds."""
    return Transaction().bit_time / unit


@numeric("kim2023-021")
def bit_rate() -> float:
    """Bit rate [kbit/s]."""
    return 1e-3 * Transaction().bits / Transaction().duration


@numeric("kim2023-022")
def half_bit() -> float:
    """Duration of half a bit [us]."""
    return 1e6 * Transaction().bit_time / 2


def master_pause_of_chip(*, edge: float) -> float:
    """Pause between request and response [bit], from a chip's edge-to-edge delay [s]."""
    return edge / BIT_TIME - 1


@check("kim2023-028", counter={"edges": (10e-6, 33.5e-6)})
def master_pause_in_range(*, edges: tuple[float, ...] = CHIP_EDGES) -> bool:
    """Whether the printed limits, and pauses computed from a chip's delays [s], are legal."""
    pauses = [2.0, 10.0, *(master_pause_of_chip(edge=edge) for edge in edges)]
    return all(is_legal(Transaction, pause) for pause in pauses)


@check("kim2023-102", counter={"edge": CHIP_EDGES[-1]})
def checking_takes_hardly_any_time(*, edge: float = CHIP_EDGES[1]) -> bool:
    """Whether a chip's delay exceeds the minimum by at most 5 % of a transaction."""
    least = Transaction(2, 2)
    return master_pause_of_chip(edge=edge) - 2 <= 0.05 * least.bits


@check("kim2023-030", counter={"pause": 84.0})
def short_pause_is_illegal(*, pause: float = 3.0) -> bool:
    """Whether the slave pause may not be this long [bit]."""
    return not is_legal(Transaction(slave_pause=pause).check_line)


@numeric("kim2023-031", master_pause=2, slave_pause=1.5)
@numeric("kim2023-032", master_pause=3, slave_pause=2)
def transaction(*, master_pause: float, slave_pause: float) -> float:
    """Duration of a transaction with these pauses; all are in bit times."""
    return Transaction(master_pause, slave_pause).bits


@numeric("kim2023-033")
def unanswered_bits() -> float:
    """Bit times of a request without response."""
    return Transaction().unanswered


@numeric("kim2023-034", slaves=31)
@numeric("kim2023-035", slaves=62)
def update_time(*, slaves: int) -> float:
    """Duration of a cycle with one management request if all addresses are in use [ms]."""
    return 1e3 * float(Cycle(slaves, inclusion=0).update_time())


# Section 3.3: messages of more than four bits, and the processes that change too fast for them.

#: Ratio of sampling rate to a control loop's bandwidth; 10 to 30 is usual: K. J. Astrom,
#: B. Wittenmark, "Computer-Controlled Systems", 3rd ed., 1997, section 2.9.
SAMPLES = 20.0


def least_cycles(bits: int, *, bits_per_cycle: int = 4) -> int:
    """Return the smallest number of cycles that can carry a message of this many bits."""
    return -(-bits // bits_per_cycle)


@check("kim2023-009", counter={"bits": 4})
def needs_several_cycles(*, bits: int = 5) -> bool:
    """Whether a message of this many bits, and one of an analogue slave, take several cycles."""
    return least_cycles(bits) > 1 and exchanges("S-7.3") > 1


@check("kim2023-090", counter={"loop": 0.1})
def too_slow_for_loops(*, process: float = 1 / 60, loop: float = 10.0) -> bool:
    """Whether 16-bit values are fast enough for a `process` but not for a drive's `loop` [Hz]."""
    fastest = 1 / (SAMPLES * exchanges("S-7.3") * float(Cycle(31).time))
    return bool(process < fastest < loop)
