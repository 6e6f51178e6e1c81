"""The messages of Tables 2 and 3, byte for byte: as printed, and as the standard wants them."""

from __future__ import annotations

import csv
from typing import TYPE_CHECKING

from shipnet.ballast.registers import COMMAND_REGISTER, FIRST_REGISTER, N_REGISTERS
from shipnet.datasets import path
from shipnet.errors import ArgumentError, FrameError
from shipnet.fields import check_whole
from shipnet.modbus.adu import decode, tcp_frame
from shipnet.modbus.pdu import Request, Response

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["MESSAGES", "message_table", "printed_adu", "standard_adu"]

#: File and message by name.
MESSAGES = {
    "write query": ("kim2014_table2_write_register.csv", "query"),
    "write response": ("kim2014_table2_write_register.csv", "response"),
    "write error": ("kim2014_table2_write_register.csv", "error"),
    "read query": ("kim2014_table3_read_registers.csv", "query"),
    "read response": ("kim2014_table3_read_registers.csv", "response"),
}


def printed_adu(
    message: str, *, unit: int = 1, value: int = 0, registers: tuple[int, ...] = (0, 0, 0, 0)
) -> bytes:
    """Return a message with the bytes that the paper prints."""
    words = _checked(message, unit, value, registers)
    file, kind = MESSAGES[message]
    with path(file).open(encoding="utf-8") as table:
        rows = [row for row in csv.DictReader(table) if row["message"] == kind]
    adu = b""
    for row in rows:
        length, text = int(row["length_byte"]), row["value_printed"]
        match row["field_mended"]:
            case "unit identifier":
                number = unit
            case "position in percent":
                number = value >> 8
            case "command" | "status bits":
                number = value & 0xFF
            case "input registers":
                adu += b"".join(word.to_bytes(2, "big") for word in words)
                continue
            case "transaction and protocol identifier":
                adu += bytes(int(part) for part in text.split("."))
                continue
            case _:
                number = int(text, 0)
        adu += number.to_bytes(length, "big")
    return adu


def standard_adu(
    message: str,
    *,
    unit: int = 1,
    value: int = 0,
    registers: tuple[int, ...] = (0, 0, 0, 0),
    transaction_id: int = 0,
) -> bytes:
    """Return the same message as the standard has it."""
    words = _checked(message, unit, value, registers)
    pdus = {
        "write query": Request.write_single_register(COMMAND_REGISTER, value).pdu,
        "write response": Request.write_single_register(COMMAND_REGISTER, value).pdu,
        "write error": Response(6, exception=1).pdu,  # type: ignore[arg-type]
        "read query": Request.read_input_registers(FIRST_REGISTER, N_REGISTERS).pdu,
        "read response": Response(4, registers=words).pdu,
    }
    return tcp_frame(unit, pdus[message], transaction_id)


def message_table() -> pd.DataFrame:
    """Compare the printed messages with the standard's."""
    import pandas as pd

    rows = []
    for message in MESSAGES:
        printed, standard = printed_adu(message), standard_adu(message)
        lengths = [int.from_bytes(adu[4:6], "big") for adu in (printed, standard)]
        rows.append(
            (printed.hex(" "), standard.hex(" "), *lengths, printed == standard, _verdict(message))
        )
    columns = ["printed", "standard", "length_printed", "length_standard", "same", "decoder"]
    return pd.DataFrame(rows, columns=columns, index=pd.Index(MESSAGES, name="message"))


def _verdict(message: str) -> str:
    request = decode(standard_adu(f"{message.split()[0]} query"), "tcp").request()
    try:
        pdu = decode(printed_adu(message), "tcp").pdu
        if message.endswith("query"):
            Request.parse(pdu)
        else:
            Response.parse(pdu, request)
    except FrameError as error:
        return type(error).__name__
    return "ok"


def _checked(message: str, unit: int, value: int, registers: tuple[int, ...]) -> tuple[int, ...]:
    if message not in MESSAGES:
        raise ArgumentError(f"message is {message!r}; it must be one of {', '.join(MESSAGES)}")
    check_whole("unit", unit, 0, 255)
    check_whole("value", value, 0, 0xFFFF)
    if len(registers) != N_REGISTERS:
        raise ArgumentError(f"registers has {len(registers)} values; it must have {N_REGISTERS}")
    return tuple(check_whole("register", word, 0, 0xFFFF) for word in registers)
