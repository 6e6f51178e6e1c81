"""Message sets in DBC files, which cantools parses."""

from __future__ import annotations

import logging
import re
from typing import Any

from shipnet.can.j1939 import GLOBAL, fast_pgns, id_parts
from shipnet.can.messages import Message, MessageSet, set_faults
from shipnet.errors import ArgumentError, InputError, load_extra

#: Limits of a DBC file, beyond which cantools needs seconds and gigabytes: messages, bytes of one
#: (1785 in J1939) and of all, multiplexer values of all signals, and powers of ten.
_MOST, _LARGEST, _LARGEST_SUM, _MOST_VALUES, _HIGHEST_POWER = 16_384, 1785, 500_000, 65_536, 308

# What is wrong with a file becomes an error; cantools' own log would print it again, line by line.
logging.getLogger("cantools").addHandler(logging.NullHandler())


def _refuse_large(text: str, source: str) -> None:
    """Raise an error if a DBC file contains numbers so large that cantools would take too long."""
    plain = re.sub(r'"[^"]*"?|//[^\n]*', " ", text.replace('\\"', ""))
    lengths = [float(n) for n in re.findall(r"\bBO_\s+\d+\s+\w+\s*:\s*(\d+)", plain)]
    bits = [float(n) for pair in re.findall(r":\s*(\d+)\s*\|\s*(\d+)", plain) for n in pair]
    ranges = re.findall(r"(?<!\d)(\d+)\s*-\s*(\d+)", plain)
    values = [float(end) - float(start) for start, end in ranges]
    powers = [float(n) for n in re.findall(r"(?<![\w.])[\d.]+[eE]\+?(\d+)", plain)]
    for what, value, most in (
        ("the number of messages", len(lengths), _MOST),
        ("the length of a message in bytes", max(lengths, default=0), _LARGEST),
        ("the length of all messages in bytes", sum(lengths), _LARGEST_SUM),
        ("the place of a signal in bits", max(bits, default=0), 8 * _LARGEST),
        ("the length of all signals in bits", sum(bits[1::2]), 8 * _LARGEST_SUM),
        ("the number of multiplexer values", sum(values), _MOST_VALUES),
        ("the power of ten of a number", max(powers, default=0), _HIGHEST_POWER),
    ):
        if not value <= most:
            raise InputError(source, f"{what} is {value:g}; it must be at most {most}")


def parse_dbc(
    text: str, source: str, period: float | None = None, strict: bool = True
) -> MessageSet:
    """Read the messages in the text of a DBC file with cantools."""
    cantools = load_extra("cantools", "cantools")
    _refuse_large(text, source)
    try:
        database = cantools.database.load_string(text, database_format="dbc", strict=False)
    # cantools may raise any exception.
    except Exception as problem:
        raise InputError(source, f"is not a DBC file: {one_line(problem)}") from None
    protocol = database.dbc.attributes.get("ProtocolType")
    marked = str(protocol.value) if protocol is not None else ""
    messages: list[tuple[str, Message]] = []
    faults, overlooked = [], []
    for entry in database.messages:
        where = f"message {entry.name!r}"
        try:
            entry.refresh(strict=True)
        except Exception as problem:
            overlooked.append(f"{where}: {one_line(problem)}")
        try:
            messages.append((where, _message(entry, period, marked)))
        except ArgumentError as fault:
            faults.append(f"{where}{'' if str(fault).startswith('has ') else ':'} {fault}")
    taken = dict(set_faults(message for _, message in messages))
    faults += [f"{messages[number][0]}: {why}" for number, why in taken.items()]
    kept = [message for number, (_, message) in enumerate(messages) if number not in taken]
    if strict:
        faults += [f"{fault}; strict=False accepts the message" for fault in overlooked]
    if not kept or (strict and faults):
        raise InputError(source, *(faults or ["has no message"]))
    any_source = [entry.name for entry in database.messages if _is_j1939(entry, marked)]
    return MessageSet(kept, overlooked=[*overlooked, *faults], any_source=any_source)


def _is_j1939(entry: Any, marked: str) -> bool:
    """Return whether a message of cantools has a PGN; `marked` is the protocol of its file."""
    j1939 = marked in ("J1939", "NMEA2000") or entry.protocol == "j1939"
    return j1939 and bool(entry.is_extended_frame)


def _message(entry: Any, period: float | None, marked: str) -> Message:
    """Return a message of cantools; without a cycle time, it has the given period."""
    _, pgn, _, to = map(int, id_parts(entry.frame_id))
    transport = "BAM" if to == GLOBAL else "RTS/CTS"
    if marked == "NMEA2000":
        transport = "fast packet"
    if entry.length <= 8 and not (transport == "fast packet" and pgn in fast_pgns()):
        transport = ""
    elif not _is_j1939(entry, marked):
        raise ArgumentError(
            f"has {entry.length} bytes; a frame of classic CAN has at most 8, and neither the "
            "message nor the file is marked as J1939 or NMEA 2000"
        )
    try:
        cycle = float(str(entry.cycle_time or 0)) / 1e3 or period
    except ValueError:
        raise ArgumentError(
            f"cycle time is {entry.cycle_time!r}; it must be a number of ms"
        ) from None
    if cycle is None:
        raise ArgumentError(
            "has no cycle time; give one with --period on the command line or period= in Python"
        )
    return Message(
        entry.name,
        entry.frame_id,
        entry.length,
        cycle,
        extended=entry.is_extended_frame,
        # cantools omits Vector__XXX, which marks a message without a sender.
        sender=entry.senders[0] if entry.senders else "",
        transport=transport,
    )


def one_line(problem: Exception) -> str:
    """Return the text of an exception on one line."""
    text = " ".join(str(problem).split())
    return (text if len(text) <= 150 else text[:147] + "...") or type(problem).__name__
