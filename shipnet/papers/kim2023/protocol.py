"""Sections 3.3 to 3.6, Tables 4 to 7: telegrams, calls, conductors, addresses, times."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from itertools import pairwise

import pandas as pd

from shipnet import datasets
from shipnet.asi.commands import ChangeAddress, ReadCodes, WriteParameter
from shipnet.asi.faults import DeadSlave, MasterFailure
from shipnet.asi.master import Master
from shipnet.asi.plan import Plan
from shipnet.asi.profile import Profile
from shipnet.asi.rules import rule_limits
from shipnet.asi.segment import Repeater, Supply
from shipnet.asi.simulation import simulate
from shipnet.asi.slave import WATCHDOG, RunningSlave, Slave
from shipnet.asi.telegram import (
    REQUEST_BITS,
    RESPONSE_BITS,
    Call,
    Half,
    Request,
    Response,
    frame,
)
from shipnet.asi.timing import BIT_TIME, MASTER_PAUSE_BITS, Cycle, Transaction, exchanges
from shipnet.design.plant import Plant, lines_needed
from shipnet.design.rules import FAST_MS
from shipnet.fields import check_choice
from shipnet.line.network import CableRun
from shipnet.papers.registry import check, is_legal, numeric

# Section 3.4: the bits of a request and of a response, and their parity.

_EXAMPLES = datasets.read("kim2023_examples.csv").set_index("name")["bits"]

#: The request and the response of Fig 5, as printed.
EXAMPLE_REQUEST, EXAMPLE_RESPONSE = str(_EXAMPLES["request"]), str(_EXAMPLES["response"])

#: Frames that a chip maker prints in full: an independent source for the parity rule.
DATASHEET_FRAMES = tuple(datasets.read("asi_datasheet_frames.csv")["bits"])


@numeric("kim2023-026", "icn2007-011", request=True)
@numeric("kim2023-027", "icn2007-012", request=False)
@numeric("icn2007-021", request=True, framed=False)
@numeric("kim2023-008", "icn2007-022", request=False, framed=False)
def telegram_bits(*, request: bool, framed: bool = True) -> int:
    """Bits of a request or of a response, or of the information between its frame."""
    bits = (Request.data_exchange(21, 0xE) if request else Response(0x6)).bits
    return len(bits) - (0 if framed else len(frame("")))


@numeric("kim2023-037", "icn2007-017", part="address")
@numeric("kim2023-038", "icn2007-041", part="data")
def example_request(*, part: str, bits: str = EXAMPLE_REQUEST) -> int:
    """Address or data of a request; its parity bit, which is wrong in the example, is ignored."""
    request = Request.parse(frame(bits[1:-2]))
    return {"address": request.address, "data": request.data}[part]


@numeric("kim2023-039", "icn2007-042")
def example_answer(*, bits: str = EXAMPLE_RESPONSE) -> int:
    """Data in a response."""
    return Response.parse(bits).data


@check("icn2007-043", bits=EXAMPLE_RESPONSE, counter={"bits": "0011011"})
def even_ones(bits: str, *, end_bit: bool = False) -> bool:
    """Return whether the number of ones in a telegram is even; `end_bit` includes the end bit."""
    return (bits if end_bit else bits[:-1]).count("1") % 2 == 0


@check("kim2023-040", "icn2007-037", counter={"bits": Request.data_exchange(21, 0xE).bits})
def example_is_legal(*, bits: str = EXAMPLE_REQUEST) -> bool:
    """Whether a request can be decoded, parity bit included."""
    return is_legal(Request.parse, bits)


@check("kim2023-081", counter={"end_bit": True})
def ones_are_even(*, end_bit: bool = False) -> bool:
    """Whether the example response and a data sheet's frames have an even number of ones."""
    return all(even_ones(bits, end_bit=end_bit) for bits in (EXAMPLE_RESPONSE, *DATASHEET_FRAMES))


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


@check("kim2023-129", counter={"without": ("WRITE_ID1",)})
def listed_calls_exist(*, without: tuple[str, ...] = ("ENTER_PROGRAM_MODE",)) -> bool:
    """Whether the rows of Table 5 are all calls of the data sheets `without` these."""
    return {*printed("Table 5").index[1:], *without} == {call.name for call in Call}


@check("kim2023-046", counter={"address": 0})
def writes_id1(*, address: int = 21) -> bool:
    """Whether information bits 00000 to this address write ID code 1."""
    return Request.parse(frame(f"1{address:05b}00000")).call is Call.WRITE_ID1


#: The seven control requests to one slave that follow "Write ID code 1", and the cells of all bits
#: but the select bit.
_CONTROL = tuple(call.name for call in Call if call.rule.layout(False)[0] == "1")[1:8]
_CELLS = tuple(str(name) for name in Request.table() if name != "I3")


@check("kim2023-122", calls=_CONTROL, cells=_CELLS, counter={"calls": ("WRITE_ID1",)})
@check(
    "kim2023-048", calls=("WRITE_PARAMETER",), cells=_CELLS[-5:-2], counter={"cells": _CELLS[2:7]}
)
def cells_agree(*, calls: tuple[str, ...], cells: tuple[str, ...]) -> bool:
    """Whether Table 5 prints these bits of these calls as they are sent."""
    theirs, ours = (rows.loc[[*calls], [*cells]] for rows in (printed("Table 5"), table("Table 5")))
    return bool((theirs == ours).to_numpy().all())


@check("kim2023-049", counter={"expected": "01111111010101"})
def broadcast_bits(*, expected: str = DATASHEET_FRAMES[0]) -> bool:
    """Whether Table 5's broadcast, with computed parity, equals the frame in a data sheet."""
    row = printed("Table 5").loc[["BROADCAST_RESET"]].to_numpy().ravel().tolist()
    return frame("".join(row[1:-2])) == expected


_ASSIGN, _DATA = ("ASSIGN_ADDRESS",), ("DATA_EXCHANGE", "WRITE_PARAMETER")


@check("kim2023-086", calls=_ASSIGN, cells=_CELLS[2:7], bits="00000", counter={"calls": ("RESET",)})
@check("kim2023-051", calls=_DATA, cells=("I4",), bits="01", counter={"calls": _DATA[::-1]})
def are_sent(*, calls: tuple[str, ...], cells: tuple[str, ...], bits: str) -> bool:
    """Whether these cells of Table 5, as our code sends them, are these bits."""
    return "".join(table("Table 5").loc[[*calls], [*cells]].to_numpy().ravel()) == bits


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
    items = datasets.read("figures_tables.csv").query("paper == 'kim2023'").set_index("item")
    return all(word in items["caption"][f"Table {n + shift}"] for n, word in words.items())


@check("kim2023-094", counter={"codes": (0xA,)})
def codes_are_extended(*, codes: tuple[int, ...] = (0xA, 0xB)) -> bool:
    """Whether slaves with these ID codes have extended addresses."""
    return all(Profile(7, code).extended for code in codes)


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


def beside(item: str) -> pd.DataFrame:
    """Return Table 1, 2, 4, 5 or 6 as printed, beside ours if our code generates it.

    In Table 5, cells that differ are followed by ours in square brackets; Tables 4 and 6 have our
    code's fields in a column of its own.
    """
    items = datasets.read("figures_tables.csv").query("paper == 'kim2023' and printed != ''")
    names = dict(zip(items["item"], items["printed"], strict=True))
    rows = datasets.read(names[check_choice("item", item, names)])
    if item == "Table 5":
        ours, calls = table(item), rows.set_index("call")["name_printed"]
        called = calls.reindex(ours.index, fill_value="[not printed]").to_numpy()
        cells = printed(item).reindex(ours.index, fill_value="")
        differing = (cells + " [" + ours + "]").apply(lambda column: column.str.strip())
        rows = cells.where(cells == ours, differing).reset_index(drop=True)
        rows.insert(0, "name_printed", called)
    elif item in _TABLES:
        differ = set(differences(item)["row"])
        fields = table(item).drop(columns=["field", "length_bit"]).to_dict("index")
        rows["our code"] = [
            "; ".join(f"{str(key).replace('_', ' ')}: {text}" for key, text in row.items() if text)
            for row in fields.values()
        ]
        rows["differs"] = ["yes" if symbol in differ else "" for symbol in fields]
    rows.columns = [str(name).replace("_", " ") for name in rows.columns]
    return rows.set_index(rows.columns[0])


# Sections 3.3, 3.5 and 3.6: how many slaves, conductors and points.


@numeric("icn2007-036", halves=(None,))
@numeric("kim2023-001", "icn2007-010", halves=("A", "B"))
def slaves_per_master(*, halves: tuple[Half | None, ...]) -> int:
    """Number of slaves that data requests can address, one per address and half."""
    return sum(
        is_legal(Request, Call.DATA_EXCHANGE, address, 0, half)
        for address in range(256)
        for half in halves
    )


# The 300 m example has modules with four digital inputs. For the submarine, one contact per slave
# gives the printed 380 conductors; one per valve, as section 3.5.g counts them, gives more.


@numeric("kim2023-002")
def hardwired_conductors(*, slaves: int = 62, inputs: int = 4) -> int:
    """Conductors without a bus: two per input contact of each module."""
    return Plant(slaves, inputs).saving.hardwired


@numeric("kim2023-072")
def conductors_of_valves(*, valves: int = 200, wires: int = 2) -> int:
    """Conductors without a bus if each valve has one contact."""
    return valves * wires


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


@numeric("kim2023-062")
def lines_for_valves(*, valves: int = 400) -> int:
    """Number of lines that this many valves need."""
    return lines_needed(valves)


@numeric("kim2023-070")
def total_length(*, masters: int = 14, repeaters: int = 5, segment: int = 100) -> int:
    """Length of cable that masters and repeaters allow [m]."""
    return (masters + repeaters) * segment


@numeric("kim2023-069", number=190, groups=14)
@numeric("kim2023-071", number=200, groups=190)
def mean_size(*, number: int, groups: int) -> float:
    """Mean number of slaves of a master, or of valves of a slave."""
    return number / groups


# Section 3.4, commands (c) to (e): addresses and ID codes of slaves, on a simulated line.


@check("kim2023-091", counter={"target": "3"})
def moves(*, target: str = "9", within: float = 0.2) -> float:
    """Margin by which a slave in operation is polled at this new address within this time [s]."""
    start, slaves = 0.05, [Slave(label) for label in "123"]
    run = simulate(slaves, until=start + within, commands=[(start, ChangeAddress("2", target))])
    calls = run.events().query("slave in ['0', '2']")["call"].tolist()
    in_order = "DELETE_ADDRESS" in calls and calls.index("DELETE_ADDRESS") < calls.index(
        "ASSIGN_ADDRESS"
    )
    polled = run.events().query("call == 'DATA_EXCHANGE' and outcome == 'ok'")
    times = polled.loc[polled["slave"] == target, "time_s"]
    return 1 - float(times.min() - start) / within if in_order else -1.0


@check("kim2023-097", counter={"labels": ("1A", "1A")})
def codes_tell_apart(*, labels: tuple[str, str] = ("1A", "1B")) -> bool:
    """Whether the master reads different ID codes 1 from two slaves with these labels."""
    slaves = [Slave(label, id1=k) for label, k in zip(labels, (1, 2), strict=True)]
    commands = [(0.05, ReadCodes(label)) for label in sorted(set(labels))]
    run = simulate(slaves, until=0.2, commands=commands)
    answers = run.events().query("time_s > 0.05 and call == 'READ_ID1' and outcome == 'ok'")
    return len(set(answers["response_data"])) == 2


@check("kim2023-054", counter={"watchdog": 0.05})
def outputs_are_reset_after_50_ms(*, watchdog: float = WATCHDOG) -> float:
    """Margin within 50 ms of the silence, in whole ms, after which a slave resets its outputs.

    The slave has this watchdog time [s].
    """
    slave = Slave("1", watchdog=watchdog)
    run = simulate([slave], until=0.4, faults=MasterFailure(start=0.1))
    last = run.events().query("call == 'DATA_EXCHANGE' and time_s < 0.1")["time_s"].max()
    return 1 - round(1e3 * float(run.watchdogs["time_s"].min() - last)) / 50


#: Outputs and parameter of a slave after a reset: austriamicrosystems, AS2702 data sheet, p. 13.
AFTER_RESET = 0xF, 0xF


def after(
    label: str, *requests: Request, profile: str = "S-8.F.F"
) -> tuple[RunningSlave, int | None]:
    """Return a slave after these requests, 0.1 s apart, and its last answer."""
    slave, data = RunningSlave(Slave(label, profile, watchdog=1.0)), None
    for number, request in enumerate(requests):
        slave.pause()
        response = slave.hear(request.bits, 0.1 * number)
        data = None if response is None else response.data
    return slave, data


@check("kim2023-100", counter={"call": Call.READ_STATUS})
def reset_restores_the_initial_state(*, call: Call = Call.RESET) -> bool:
    """Whether this call restores a slave's outputs and parameter, and its address stays."""
    used = [Request(Call.WRITE_PARAMETER, 21, 0x5), Request.data_exchange(21, 0x3)]
    slaves = [after("21", *requests)[0] for requests in (used, [*used, Request(call, 21)])]
    busy, reset = [(int(one.fields["outputs"]), one.parameter) for one in slaves]
    return busy != AFTER_RESET == reset and slaves[-1].address == 21


@check("kim2023-130", counter={"call": Call.WRITE_PARAMETER})
def data_request_reads_and_controls(*, call: Call = Call.DATA_EXCHANGE) -> bool:
    """Whether this call returns a slave's inputs, which are off here, and sets its outputs."""
    requests = [Request(Call.WRITE_PARAMETER, 21, 0x5), Request(call, 21, 0x3)]
    slave, answer = after("21", *requests, profile="S-7.F.F")
    return (answer, int(slave.fields["outputs"])) == (0, 0x3)


@check("kim2023-120", counter={"assigned": 9})
def deletion_is_temporary(*, assigned: int = 0) -> bool:
    """Whether a slave whose address is deleted gets it back by a reset, unless assigned anew."""
    requests = [Request(Call.DELETE_ADDRESS, 21)]
    requests += [Request(Call.ASSIGN_ADDRESS, 0, assigned)] if assigned else []
    deleted = after("21", requests[0])[0].address == 0
    return deleted and after("21", *requests, Request(Call.RESET, assigned))[0].address == 21


@check("kim2023-124", counter={"written": False})
def id1_can_be_written(*, written: bool = True) -> bool:
    """Whether every ID code 1 that is `written` to a slave at address 0 is read back."""
    write = [[Request(Call.WRITE_ID1, 0, code)] if written else [] for code in range(16)]
    read = [after("0", *requests, Request(Call.READ_ID1, 0))[1] for requests in write]
    return read == list(range(16))


@check("kim2023-126", counter={"io": 8})
def without_configuration_all_ports_are_tri(*, io: int = 15) -> bool:
    """Whether none of the ports has a function if the I/O code is this one."""
    return set(Profile(io, 15).ports) == {"TRI"}


@check("kim2023-123", counter={"orders": 0})
def parameters_do_not_delay_data(*, orders: int = 3) -> bool:
    """Whether parameters are written, one request per cycle, and each cycle polls every slave."""
    commands = [(0.05, WriteParameter(f"{k}", 0x5)) for k in range(1, orders + 1)]
    run = simulate(five_slaves(), until=0.1, commands=commands).events().query("time_s > 0.04")
    written = run[(run["call"] == "WRITE_PARAMETER") & (run["time_s"] > 0.05)]
    polls = run[run["call"] == "DATA_EXCHANGE"].groupby("cycle").size().iloc[1:-1]
    return bool(len(written) and written["cycle"].is_unique and (polls == 5).all())


#: Addresses of five slaves.
ADDRESSES = range(1, 6)


def five_slaves() -> list[Slave]:
    """Return five slaves with four inputs each."""
    return [Slave(f"{address}") for address in ADDRESSES]


@check("icn2007-038", repeats=False, counter={"wait": 11.0})
@check("kim2023-089", repeats=True, counter={"wait": 11.0})
def goes_on_after(*, repeats: bool, wait: float = 10.0) -> bool:
    """Whether the master waits `wait` bit times for a response and, if `repeats`, tries again."""
    run = simulate(five_slaves(), cycles=20, faults=[DeadSlave("3", start=0.02)])
    events = run.events()
    after = events["time_s"].diff().shift(-1)[events["outcome"] == "SilenceError"].min()
    repeated = (events.query("slave == '3'")["attempt"] == 1).any()
    waited = float(after) / run.transaction.bit_time - REQUEST_BITS
    return bool(repeated or not repeats) and round(waited, 6) == wait


# Section 3.4: durations of bits, pauses and cycles.

_PUBLISHED = datasets.read("asi_published_timing.csv").set_index("quantity")["value_us"]

#: Edge-to-edge delays between request and response, printed by a chip maker [s]: minimum and
#: maximum of a synchronous slave, then of an asynchronous one.
PUBLISHED_TRANSACTIONS = tuple(_PUBLISHED.loc["transaction"])
CHIP_EDGES = tuple(
    1e-6 * float(_PUBLISHED[f"edge to edge, {state}, {end}"])
    for state in ("synchronous", "asynchronous")
    for end in ("least", "most")
)


@numeric("icn2007-005", unit=1e-3)
@numeric("kim2023-020", unit=1e-6)
@numeric("kim2023-022", unit=2e-6)
def bit_time(*, unit: float) -> float:
    """Duration of a bit as a multiple of `unit`, which is in seconds."""
    return Transaction().bit_time / unit


@numeric("kim2023-021", "icn2007-006")
def bit_rate() -> float:
    """Bit rate [kbit/s]."""
    return 1e-3 * Transaction().bits / Transaction().duration


def master_pause_of_chip(*, edge: float) -> float:
    """Pause between request and response [bit], from a chip's edge-to-edge delay [s]."""
    return edge / BIT_TIME - 1


@check("kim2023-028", "icn2007-014", counter={"edges": (10e-6, 33.5e-6)})
def master_pause_in_range(*, edges: tuple[float, ...] = CHIP_EDGES) -> float:
    """Margin of a chip's pauses in the legal range; -1 unless the printed limits are legal."""
    if not all(is_legal(Transaction, pause) for pause in (2.0, 10.0)):
        return -1.0
    least, most = MASTER_PAUSE_BITS
    pauses = [master_pause_of_chip(edge=edge) for edge in edges]
    return min(min(pauses) / least - 1, 1 - max(pauses) / most)


@check("kim2023-102", "icn2007-062", counter={"edge": CHIP_EDGES[-1]})
def checking_takes_hardly_any_time(*, edge: float = CHIP_EDGES[1]) -> float:
    """Margin within which a chip's delay exceeds the shortest by 5 % of a transaction."""
    least = MASTER_PAUSE_BITS[0]
    return 1 - (master_pause_of_chip(edge=edge) - least) / (0.05 * Transaction(least, 2).bits)


@check("kim2023-030", "icn2007-016", counter={"longest": 1.5})
def slave_pause_is_short(*, longest: float = 2.0) -> bool:
    """Whether published transactions fit 1.5 to `longest` bit times after a legal master pause."""
    bits = [float(length) * 1e-6 / BIT_TIME for length in PUBLISHED_TRANSACTIONS]
    frames = REQUEST_BITS + RESPONSE_BITS
    least, most = MASTER_PAUSE_BITS
    usual = Transaction().slave_pause <= longest and is_legal(Transaction().check_line)
    return usual and all(least + 1.5 <= length - frames <= most + longest for length in bits)


@numeric("kim2023-031", master_pause=2, slave_pause=1.5)
@numeric("kim2023-032", "icn2007-030", master_pause=3, slave_pause=2)
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
def too_slow_for_loops(*, process: float = 1 / 60, loop: float = 1e3 / FAST_MS) -> float:
    """Margin by which 16-bit values suit a `process` but are too slow for a fast `loop` [Hz]."""
    slave = Slave("1", "S-7.3.D")
    fastest = 1 / (SAMPLES * Cycle(31).update_time(slave.kind, channels=slave.channels))
    return float(min(fastest / process, loop / fastest) - 1)
