"""Tables 1 to 3: the messages byte by byte, and the registers."""

from __future__ import annotations

import re
from dataclasses import replace
from math import ceil

import numpy as np

from shipnet import datasets
from shipnet.ballast.plant import Plant
from shipnet.ballast.registers import (
    CODE_READINGS,
    COMMAND_REGISTER,
    FIRST_REGISTER,
    HIGHEST,
    N_REGISTERS,
    SCALES,
    Code,
    RegisterMap,
    command_codes,
    whole_steps,
)
from shipnet.ballast.scan import READ_STATUS, command_poll, status_poll
from shipnet.ballast.sensors import CHANNELS, Sensors
from shipnet.ballast.slave import valve_slaves
from shipnet.fields import check_choice, check_scalar
from shipnet.lazy import pd
from shipnet.modbus.frame import MAX_PDU, rtu_frame
from shipnet.modbus.pdu import FunctionCode, Request, Response, decode
from shipnet.modbus.slave import Slave
from shipnet.modbus.uart import SerialLine
from shipnet.papers.registry import check, is_legal, numeric

# The messages of Tables 2 and 3, byte for byte: as printed, and according to the standard.

#: The messages that write a register, and those that read several.
_TABLES = {
    "write": datasets.read("kim2014_table2_write_register.csv"),
    "read": datasets.read("kim2014_table3_read_registers.csv"),
}

#: Printed texts of fields that contain no number; the fields are 0 here.
_ZERO = ("0.0.0.0", "Position 0-100%", "see bits")


def printed_adu(message: str) -> bytes:
    """Return the bytes of a message as printed."""
    access, kind = message.split()
    rows, adu = _TABLES[access], b""
    for row in rows[rows["message"] == kind].to_dict("records"):
        number = 0 if row["value_printed"] in _ZERO else int(row["value_printed"], 0)
        adu += number.to_bytes(int(row["length_byte"]), "big")
    return adu


#: The same messages according to the standard.
STANDARD = {
    "write query": Request.write_single_register(COMMAND_REGISTER, 0).tcp(1, 0),
    "write response": Request.write_single_register(COMMAND_REGISTER, 0).tcp(1, 0),
    "write error": Response(6, exception=1).tcp(1, 0),  # type: ignore[arg-type]
    "read query": READ_STATUS.tcp(1, 0),
    "read response": Response(4, registers=(0,) * N_REGISTERS).tcp(1, 0),
}


def table(item: str) -> pd.DataFrame:
    """Return the messages of Table 2 or 3 as printed, by the byte at which each field begins.

    Below each are the bytes of the standard, with ``*`` where they differ from the printed ones.
    """
    check_choice("item", item, ("Table 2", "Table 3"))
    access = "write" if item == "Table 2" else "read"
    rows: dict[tuple[str, str], dict[int, str]] = {}
    for message, fields in _TABLES[access].groupby("message", sort=False):
        name = f"{access} {message}"
        first, last = (fields[f"offset_{end}_byte"].astype(int) for end in ("first", "last"))
        for row, column in (("bit", "label"), ("field", "field"), ("as printed", "value")):
            rows[name, row] = dict(zip(first, fields[f"{column}_printed"], strict=True))
        rows[name, "standard"] = {}
        for begin, end in zip(first, last, strict=True):
            theirs, ours = (adu[begin : end + 1] for adu in (printed_adu(name), STANDARD[name]))
            mark = "" if ours == theirs else " *"
            rows[name, "standard"][begin] = ours.hex(" ") + mark
    return pd.DataFrame(rows).T.fillna("").rename_axis(columns="byte")


@check("kim2014-056", counter={"transaction": 1})
def messages_begin_with(*, transaction: int = 0) -> bool:
    """Whether every printed message begins as our encoder begins one with this transaction id."""
    header = READ_STATUS.tcp(1, transaction)[:4]
    first = pd.concat(rows.groupby("message")["value_printed"].first() for rows in _TABLES.values())
    return all(bytes(map(int, text.split("."))) == header for text in first)


# Section 2.1, the first Table 1, Tables 2 and 3: fields, codes and lengths of the messages.

_READ, _WRITE = FunctionCode.READ_INPUT_REGISTERS, FunctionCode.WRITE_SINGLE_REGISTER

#: The first Table 1, one row per field.
_TABLE_1 = datasets.read("kim2014_function_codes.csv")


def table_1() -> dict[str, int]:
    """Return the lengths that the first Table 1 implies for the messages of Tables 2 and 3."""
    fixed = _TABLE_1["length_fixed_byte"].astype(int)
    each = _TABLE_1["length_per_register_byte"].astype(int)
    function = _TABLE_1["function_code"].map({"0x06": "write", "0x04": "read"})
    sizes = (fixed + N_REGISTERS * each).groupby(function + " " + _TABLE_1["message"]).sum()
    return {str(message): int(size) for message, size in sizes.items()}


def _answer(registers: int) -> Response:
    return Response(_READ, registers=(0,) * registers)


@numeric("kim2014-006")
def crc_bits(*, address: int = 1) -> int:
    """Number of bits of an RTU frame besides its PDU and an address of this many bytes."""
    pdu = Request(_READ, FIRST_REGISTER, N_REGISTERS).pdu
    return 8 * (len(rtu_frame(1, pdu)) - len(pdu) - address)


@numeric("kim2014-009", "kim2014-018", function=6)
@numeric("kim2014-052", function=4)
def exception_code(*, function: int) -> int:
    """First byte of an exception response to this function code."""
    return Response(function, exception=1).pdu[0]  # type: ignore[arg-type]


@numeric("kim2014-010")
def most_registers(*, longest_pdu: int = MAX_PDU) -> int:
    """Largest number of registers in one response."""
    return (longest_pdu - len(_answer(1).pdu) + 2) // 2


@numeric("kim2014-086")
def least_registers(*, data: int = 2) -> int:
    """Fewest registers in a legal query whose response has at least this many data bytes."""
    legal = (n for n in range(126) if is_legal(Request, _READ, FIRST_REGISTER, n))
    return next(n for n in legal if len(_answer(n).pdu) >= 2 + data)


@check("kim2014-011", counter={"message": "query"})
def names_a_register(*, message: str = "response") -> bool:
    """Whether a message differs between two registers that contain the same value."""
    slave = Slave(input_registers=[0] * 4)
    messages = []
    for address in (1, 2):
        query = Request(_READ, address, 1).pdu
        messages.append(query if message == "query" else slave.answer(query))
    return messages[0] != messages[1]


@numeric("kim2014-016", messages=("write query", "write response"))
@numeric("kim2014-017", messages=("write error",))
@numeric("kim2014-019", messages=("read query",))
def length_field(*, messages: tuple[str, ...]) -> int:
    """Number of bytes of unit id and PDU in each of these messages, which are equally long."""
    (length,) = {1 + len(decode(STANDARD[message], "tcp").pdu) for message in messages}
    return length


@numeric("kim2014-020", of="length field")
@numeric("kim2014-054", of="byte count")
@numeric("kim2014-080", of="RTU frame")
def read_response(*, of: str, registers: int = N_REGISTERS) -> int:
    """Length field, byte count, or bytes of the RTU frame of a response with these registers."""
    pdu = _answer(registers).pdu
    sizes = {"length field": 1 + len(pdu), "byte count": pdu[1]}
    return {**sizes, "RTU frame": len(rtu_frame(1, pdu))}[of]


@numeric("kim2014-053")
def quantity(*, first: int = 0x4020, last: int = 0x4023) -> int:
    """Number of registers in a query for `first` to `last`."""
    return Request(_READ, first, last - first + 1).quantity


@check("kim2014-049", counter={"codes": (1, 2, 3, 7)})
def exceptions_exist(*, codes: tuple[int, ...] = (1, 2, 3, 4)) -> bool:
    """Whether the standard defines these exception codes for both function codes."""
    pdus = [bytes([function | 0x80, code]) for function in (_READ, _WRITE) for code in codes]
    return all(is_legal(Response.parse, pdu) for pdu in pdus)


@check("kim2014-083", counter={"read": 3})
def codes_are_standard(*, write: int = 6, read: int = 4) -> bool:
    """Whether these function codes write one register and read input registers."""
    return (FunctionCode(write), FunctionCode(read)) == (_WRITE, _READ)


@check("kim2014-058", counter={"first": 1})
def labels_are_offsets(*, first: int = 0) -> bool:
    """Whether labels 5 to 11 are the offsets of the fields' last bytes, counted from `first`."""
    for table in _TABLES.values():
        for _, fields in table.groupby("message"):
            last = np.cumsum(fields["length_byte"].astype(int)) - 1 + first
            labelled = fields["label_printed"].isin([str(label) for label in range(5, 12)])
            if (fields["label_printed"][labelled].astype(int) != last[labelled]).any():
                return False
    return True


@check("kim2014-087", counter={"addresses": (COMMAND_REGISTER, 0x14020)})
def addresses_fit(*, addresses: tuple[int, ...] = (COMMAND_REGISTER, 0x4020, 0x4023)) -> bool:
    """Whether these registers are in the range of addresses that the first Table 1 prints."""
    printed = _TABLE_1[_TABLE_1["value_printed"].str.fullmatch("0x0000~0xFF FF")]
    low, high = (int(printed[f"value_{end}"].iloc[0], 16) for end in ("low", "high"))
    return all(
        low <= address <= high and is_legal(Request.write_single_register, address, 0)
        for address in addresses
    )


@check(
    "kim2014-013", counter={"contents": ("Position", "operating time", "pressure", "motor current")}
)
def registers_in_order(
    *, contents: tuple[str, ...] = ("Position", "temperature", "pressure", "motor current")
) -> bool:
    """Whether the four registers of Table 3 contain, in this order, what section 2.1 says."""
    rows = datasets.read("kim2014_table3_read_registers_bits.csv").query("part == 'register'")
    text = rows["name_printed"] + " " + rows["remark_printed"]
    return all(re.search(what, entry) for what, entry in zip(contents, text, strict=True))


# The response to a command: at once or, as the paper prints, when the valve has arrived.


def answer_table(serial: SerialLine, n_slaves: int, movement: float) -> pd.DataFrame:
    """Compare a response at the start of a movement with one at its end.

    The third row has the shortest time-out that is sufficient for a response at the end.
    """
    moving = check_scalar("movement", movement, "s", 0, 3600)
    scan = status_poll(serial).scan_time(n_slaves)
    write = command_poll(status_poll(serial))
    patient = replace(write, timeout=3600.0, processing=moving).shortest_timeout
    rows = {
        "at the start": (write.timeout, write.time, True, scan + write.time, ceil(moving / scan))
    }
    for case, wait in (("at the end", write.timeout), ("at the end, waited for", patient)):
        answered = wait >= patient
        # The response ends the wait before its time-out.
        cost = write.time + moving if answered else replace(write, timeout=wait).timeout_time
        rows[case] = (wait, cost, answered, scan + cost, max(ceil((moving - cost) / scan), 0))
    columns = ["timeout_s", "write_s", "answered", "scan_gap_s", "polls_while_moving"]
    table = pd.DataFrame.from_dict(rows, orient="index", columns=columns)
    return table.rename_axis("answer")


# Tables 2 and 3, section 3.2: registers of a valve, its command codes, its converter.

_VPOS = [channel.name for channel in CHANNELS].index("VPos")


@numeric("kim2014-023")
def sensors(*, names: tuple[str, ...] = tuple(channel.name for channel in CHANNELS)) -> int:
    """Number of sensors of a valve."""
    return len(names)


@numeric("kim2014-021")
def code_of_position_close() -> int:
    """Code of the command to close to a position, as the sum of its flags."""
    return RegisterMap().command(Code.POSITION_CLOSE, 0) & 0xFF


@check("kim2014-022", counter={"highest": 305.0})
def position_fits(*, highest: float = 100.0) -> bool:
    """Whether positions up to this [%] fit into the high byte of a register."""
    readings = [[0.0] * 2, [0.0] * 2, [0.0] * 2, [50.0] * 2, [0.0, highest]]
    return not RegisterMap().encode(readings, close=False, open=True).saturated[:, _VPOS].any()


@check("kim2014-055", counter={"delay": 20.0})
def echo_means_completion(*, delay: float = 0.0) -> bool:
    """Whether a valve echoes the command to open, and stands still after this time [s]."""
    plant = Plant()
    (valve,) = valve_slaves(plant).values()
    command = Request.write_single_register(COMMAND_REGISTER, RegisterMap().command(Code.OPEN))
    echo = valve.answer(command.pdu)
    plant.run_until(delay)
    return echo == command.pdu and not plant.running[0]


@numeric("kim2014-116")
def command_address() -> int:
    """Lowest register address at which a valve accepts the command to open."""
    (valve,) = valve_slaves(Plant()).values()
    value = RegisterMap().command(Code.OPEN)
    writes = (Request.write_single_register(address, value).pdu for address in range(1 << 16))
    return next(address for address, pdu in enumerate(writes) if valve.answer(pdu) == pdu)


@check("kim2014-103", counter={"function": 5})
def invalid_command_gets_exception_1(*, function: int = 6) -> bool:
    """Whether a valve answers an illegal value, or an unknown function code, with code 01."""
    (valve,) = valve_slaves(Plant()).values()
    return valve.answer(bytes([function, 0x40, 0x01, 0x00, 0x03]))[1:] == b"\x01"


@check("kim2014-104", counter={"registers": 0})
def data_are_two_bytes_each(*, registers: int = 1) -> bool:
    """Whether responses with this many registers or more have twice as many data bytes."""
    counts = range(registers, MAX_PDU // 2)
    return all(is_legal(_answer, n) and len(_answer(n).pdu) == 2 + 2 * n for n in counts)


@numeric("kim2014-078")
def converter_step(*, span: float = 100.0) -> float:
    """Step of the converter for positions 0..`span`, both in percent."""
    high = (*Sensors().high[:_VPOS], span)
    return float(Sensors((0.0,) * len(CHANNELS), high).step[_VPOS])


@check("kim2014-105", counter={"percent": 0.01})
def converter_resolves(*, percent: float = 1.0) -> float:
    """Margin by which the converter distinguishes positions this far apart [%]."""
    return 1 - float(Sensors().step[_VPOS]) / percent


@numeric("kim2014-079")
def register_step(*, travel: float = 90.0) -> float:
    """Step of the position register, for a valve that turns by `travel` [degree]."""
    return SCALES[_VPOS].step / 100 * travel


@numeric("kim2014-081")
def largest_byte(*, bits: int = 8) -> int:
    """Value sent for a position of 305 % in a register of this many bits."""
    return int(whole_steps(np.array([305.0]), 2**bits - 1)[0][0])


@numeric("kim2014-044")
def colours(*, bits: int = 16) -> int:
    """Number of colours with this many bits per pixel."""
    return int(2**bits)


def code_table() -> pd.DataFrame:
    """Return the codes of the commands in each reading of the table."""
    codes = {
        reading: {code.value: number for code, number in command_codes(reading).items()}
        for reading in CODE_READINGS
    }
    return pd.DataFrame(codes).rename_axis("command")


def survival_table() -> pd.DataFrame:
    """Return how the values of the paper's fault tests arrive at the master.

    A value ``survives`` if its error is at most half a step; positions include the corrected ones.
    """
    rows = []
    for rule in datasets.read("kim2014_rule_table.csv").to_dict("records"):
        for channel, scale in zip(CHANNELS, SCALES, strict=True):
            texts = rule[f"{channel.name.lower()}_printed"].split(" or ")
            if channel.name == "VPos":
                texts += rule["vpos_corrected_percent"].split(" or ")
            for value in dict.fromkeys(float(text) for text in texts if text):
                sent, saturated = whole_steps(np.array([value]) / scale.step, HIGHEST)
                received = float(sent[0]) * scale.step
                survives = abs(received - value) <= scale.step / 2 + 1e-9
                rows.append((rule["code"], channel.name, value, received, saturated[0], survives))
    columns = ["code", "channel", "value", "received", "saturated", "survives"]
    return pd.DataFrame(rows, columns=columns)
