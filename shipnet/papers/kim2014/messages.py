"""Section 2.1, the first Table 1, Tables 2 and 3: fields, codes and lengths of the messages."""

from __future__ import annotations

import re

import numpy as np

from shipnet import datasets
from shipnet.ballast.registers import COMMAND_REGISTER, FIRST_REGISTER, N_REGISTERS
from shipnet.errors import ArgumentError, FrameError
from shipnet.modbus.adu import rtu_frame
from shipnet.modbus.pdu import MAX_PDU, FunctionCode, Request, Response
from shipnet.modbus.slave import Slave
from shipnet.papers.kim2014.printed_messages import MESSAGES, printed_adu, standard_adu
from shipnet.papers.registry import check, numeric

__all__ = ["table_1"]

_READ, _WRITE = FunctionCode.READ_INPUT_REGISTERS, FunctionCode.WRITE_SINGLE_REGISTER

#: The first Table 1, one row a field.
_TABLE_1 = datasets.read("kim2014_function_codes.csv")

#: Bytes before the first that the length field counts.
_LENGTH_AT = 4


def table_1() -> dict[str, int]:
    """Return how long the first Table 1 makes the messages of Tables 2 and 3.

    Returns
    -------
    dict of str to int
        Message -> length of its PDU, with four registers in a read response [byte].

    Examples
    --------
    >>> table_1()["read response"]
    10
    """
    sizes = {}
    for name, code in (("write", "0x06"), ("read", "0x04")):
        for message in ("query", "response", "error"):
            own = (_TABLE_1["function_code"] == code) & (_TABLE_1["message"] == message)
            fixed, each = (
                _TABLE_1.loc[own, f"length_{what}_byte"].astype(int).sum()
                for what in ("fixed", "per_register")
            )
            sizes[f"{name} {message}"] = int(fixed + N_REGISTERS * each)
    return sizes


def _answer(registers: int) -> Response:
    return Response(_READ, registers=(0,) * registers)


@numeric("kim2014-006")
def crc_bits(*, address: int = 1) -> int:
    """Bits that an RTU frame has beside its PDU and an address of so many bytes."""
    pdu = Request.read(_READ, FIRST_REGISTER, N_REGISTERS).pdu
    return 8 * (len(rtu_frame(1, pdu)) - len(pdu) - address)


@numeric("kim2014-009", "kim2014-018")
def write_error(*, function: int = 6) -> int:
    """First byte of an exception response to this function code."""
    return Response(function, exception=1).pdu[0]  # type: ignore[arg-type]


@numeric("kim2014-052")
def read_error(*, function: int = 4) -> int:
    """First byte of an exception response to this function code."""
    return write_error(function=function)


@numeric("kim2014-010")
def most_registers(*, longest_pdu: int = MAX_PDU) -> int:
    """Registers that one response can hold."""
    return (longest_pdu - len(_answer(1).pdu) + 2) // 2


@numeric("kim2014-086")
def least_registers(*, data: int = 2) -> int:
    """Registers that a legal query must ask for to get so many bytes of data or more."""
    return next(n for n in range(126) if _may_ask(n) and len(_answer(n).pdu) >= 2 + data)


def _may_ask(quantity: int) -> bool:
    try:
        Request.read(_READ, FIRST_REGISTER, quantity)
    except ArgumentError:
        return False
    return True


@check("kim2014-011", counter={"message": "query"})
def names_a_register(*, message: str = "response") -> bool:
    """Whether what follows the function code changes with the address of the register."""
    slave = Slave(input_registers=[0] * 4)
    said = []
    for address in (1, 2):
        query = Request.read(_READ, address, 1).pdu
        said.append(query if message == "query" else slave.answer(query))
    return said[0] != said[1]


def _length_field(message: str, before: int) -> int:
    return len(standard_adu(message)) - before


@numeric("kim2014-016")
def write_length(*, before: int = _LENGTH_AT + 2) -> int:
    """Bytes of the write query and of its response that follow the length field."""
    query, response = (
        _length_field(message, before) for message in ("write query", "write response")
    )
    if query != response:
        raise ArgumentError(f"the query counts {query} bytes, the response {response}")
    return query


@numeric("kim2014-017")
def error_length(*, before: int = _LENGTH_AT + 2) -> int:
    """Bytes of the error response that follow the length field."""
    return _length_field("write error", before)


@numeric("kim2014-019")
def read_length(*, before: int = _LENGTH_AT + 2) -> int:
    """Bytes of the read query that follow the length field."""
    return _length_field("read query", before)


@numeric("kim2014-020")
def response_length(*, registers: int = N_REGISTERS) -> int:
    """Unit id and PDU of a read response [byte]."""
    return 1 + len(_answer(registers).pdu)


@numeric("kim2014-053")
def registers_read(*, first: int = 0x4020, last: int = 0x4023) -> int:
    """Registers that the query from the first to the last of these addresses asks for."""
    return Request.read(_READ, first, last - first + 1).quantity


@numeric("kim2014-054")
def byte_count(*, registers: int = N_REGISTERS) -> int:
    """Byte that follows the function code in the read response."""
    return _answer(registers).pdu[1]


@numeric("kim2014-080")
def rtu_read_response(*, registers: int = N_REGISTERS) -> int:
    """Bytes of the RTU frame that brings so many registers."""
    return len(rtu_frame(1, _answer(registers).pdu))


@check("kim2014-049", counter={"codes": (1, 2, 3, 7)})
def exceptions_exist(*, codes: tuple[int, ...] = (1, 2, 3, 4)) -> bool:
    """Whether the standard has these exception codes, for both function codes."""
    try:
        for function in (_READ, _WRITE):
            for code in codes:
                Response.parse(bytes([function | 0x80, code]))
    except FrameError:
        return False
    return True


@check("kim2014-083", counter={"read": 3})
def functions_are_named_right(*, write: int = 6, read: int = 4) -> bool:
    """Whether these codes write a single register and read input registers."""
    return (FunctionCode(write), FunctionCode(read)) == (_WRITE, _READ)


@check("kim2014-084", counter={"messages": ("write query", "write response", "read query")})
def same_pdu_on_both(*, messages: tuple[str, ...] = tuple(MESSAGES)) -> bool:
    """Whether the messages of Tables 2 and 3 have the PDU lengths of the first Table 1."""
    header = 7
    return all(len(printed_adu(message)) - header == table_1()[message] for message in messages)


@check("kim2014-058", counter={"first": 1})
def labels_are_offsets(*, first: int = 0) -> bool:
    """Whether the labels 5 to 11 are the places of the fields' last bytes, counted from first."""
    for table in ("table2_write_register", "table3_read_registers"):
        for _, fields in datasets.read(f"kim2014_{table}.csv").groupby("message"):
            last = np.cumsum(fields["length_byte"].astype(int)) - 1 + first
            labelled = fields["label_printed"].isin([str(label) for label in range(5, 12)])
            if (fields["label_printed"][labelled].astype(int) != last[labelled]).any():
                return False
    return True


@check("kim2014-087", counter={"addresses": (COMMAND_REGISTER, 0x14020)})
def addresses_fit(*, addresses: tuple[int, ...] = (COMMAND_REGISTER, 0x4020, 0x4023)) -> bool:
    """Whether these registers lie in the range that the first Table 1 prints for an address."""
    printed = _TABLE_1[_TABLE_1["value_printed"].str.fullmatch("0x0000~0xFF FF")]
    low, high = (int(printed[f"value_{end}"].iloc[0], 16) for end in ("low", "high"))
    return all(low <= address <= high and _writable(address) for address in addresses)


def _writable(address: int) -> bool:
    try:
        Request.write_single_register(address, 0)
    except ArgumentError:
        return False
    return True


@check(
    "kim2014-013", counter={"contents": ("Position", "operating time", "pressure", "motor current")}
)
def registers_in_order(
    *, contents: tuple[str, ...] = ("Position", "temperature", "pressure", "motor current")
) -> bool:
    """Whether the four registers of Table 3 name, in this order, what section 2.1 puts there."""
    rows = datasets.read("kim2014_table3_read_registers_bits.csv").query("part == 'register'")
    text = rows["name_printed"] + " " + rows["remark_printed"]
    return all(re.search(what, found) for what, found in zip(contents, text, strict=True))
