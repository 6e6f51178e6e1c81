"""Exercises of lesson 6: Modbus, its bytes, its silences, and how long a scan takes."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from shipnet.exercises.answers import Bytes, Function, Number, Whole
from shipnet.exercises.exercise import Exercise
from shipnet.modbus.pdu import FunctionCode, Request
from shipnet.modbus.polling import Poll
from shipnet.modbus.uart import SerialLine

_LIMIT = 2.0


def _question(first: int, quantity: int, function: int = 3) -> Request:
    return Request.read(FunctionCode(function), first, quantity)


def _request(unit: int, number: int, quantity: int) -> bytes:
    return bytes([unit]) + _question(number - 1, quantity).pdu


def _with_code(function: int) -> Callable[[int, int, int], bytes]:
    """Return a function for the request with another function code."""

    def request(unit: int, number: int, quantity: int) -> bytes:
        return bytes([unit, function]) + _request(unit, number, quantity)[2:]

    return request


def _low_byte_first(unit: int, number: int, quantity: int) -> bytes:
    first, many = ((n).to_bytes(2, "little") for n in (number - 1, quantity))
    return bytes([unit, 3]) + first + many


def _response_ms(registers: int, rate: int, *, character: str = "8E1", extra: int = 0) -> float:
    """Return how long a response is with some bytes more, or less [ms]."""
    size = _question(0, registers).response_size + 3 + extra
    return 1e3 * SerialLine(rate, character).frame_time(size)


def _scan(n_slaves: int, n_registers: int, bit_rate: int, *, character: str = "8E1") -> float:
    return Poll(_question(0, n_registers), SerialLine(bit_rate, character)).scan_time(n_slaves)


def _scan_with(silences: float, n_slaves: int, n_registers: int, bit_rate: int) -> float:
    """Return a scan with so many characters of silence a transaction, at any bit rate."""
    return n_slaves * (13 + 2 * n_registers + silences) * 11 / bit_rate


#: One slave with one register; where silence begins to be fixed, and beyond; the largest of all.
_TRIED = [(1, 1, 9600), (31, 10, 19200), (60, 4, 38400), (247, 4, 115200), (247, 125, 4800)]


def _poll(rate: int, think_ms: int, timeout_ms: int) -> Poll:
    return Poll(
        _question(0, 4, 4), SerialLine(rate), processing=think_ms / 1e3, timeout=timeout_ms / 1e3
    )


def _most(rate: int, think_ms: int, timeout_ms: int, dead: int = 1) -> int:
    return _poll(rate, think_ms, timeout_ms).max_slaves(_LIMIT, dead=dead)


EXERCISES = (
    Exercise(
        "ex-06-1",
        draws={"unit": range(2, 31), "number": range(301, 1000, 7), "quantity": range(2, 11)},
        answer=lambda unit, number, quantity: Bytes(_request(unit, number, quantity)),
        traps={
            "the manual counts from 1, the line from 0: which register would this read?": (
                lambda unit, number, quantity: _request(unit, number + 1, quantity)
            ),
            "each of the two numbers goes high byte first": _low_byte_first,
            "the 4 in front of 40001 only says that it is a holding register: it is not sent": (
                lambda unit, number, quantity: _request(unit, 40000 + number, quantity)
            ),
            "the 4 in front, as in 40001, is not sent, and the line counts from 0": (
                lambda unit, number, quantity: _request(unit, 40001 + number, quantity)
            ),
            "function code 4 reads input registers; these are holding registers": _with_code(4),
            "function code 6 writes a register; asked for is to read": _with_code(6),
            "function code 1 reads single bits; these are registers": _with_code(1),
        },
    ),
    Exercise(
        "ex-06-2",
        # With 8, 9 and 24 to 26 registers, two of the mistakes below give nearly the same number.
        draws={
            "registers": (6, 7, *range(10, 24), *range(27, 31)),
            "rate": (2400, 4800, 9600, 19200),
        },
        answer=lambda registers, rate: Number(_response_ms(registers, rate), "ms"),
        traps={
            "a byte is more than 8 bits on the line": lambda registers, rate: (
                _response_ms(registers, rate) * 8 / 11
            ),
            "count a character of 8E1 again: start, data, parity, stop": partial(
                _response_ms, character="8N1"
            ),
            "that is the data alone; what stands around them?": partial(_response_ms, extra=-5),
            "every frame ends with a CRC: is it counted?": partial(_response_ms, extra=-2),
            "one byte too few: name those around the data one by one": partial(
                _response_ms, extra=-1
            ),
            "one byte too many: name those around the data one by one": partial(
                _response_ms, extra=1
            ),
            "a register has 16 bits": lambda registers, rate: _response_ms(
                registers, rate, extra=-registers
            ),
        },
    ),
    Exercise(
        "ex-06-3",
        answer=lambda: Function(_scan, _TRIED, lambda right: Number(right, "s")),
        traps={
            "the silence is not counted in characters at every bit rate": lambda: (
                lambda *case: _scan_with(7, *case)
            ),
            "a transaction has a silence behind the request, and one behind the response": lambda: (
                lambda *case: _scan(*case) - case[0] * SerialLine(case[2]).t35
            ),
            "where is the silence?": lambda: lambda *case: _scan_with(0, *case),
            "every frame ends with a CRC: is it counted, twice in a transaction?": lambda: (
                lambda *case: _scan(*case) - case[0] * 4 * SerialLine(case[2]).character_time
            ),
            "a register has 16 bits": lambda: (
                lambda *case: _scan(*case) - case[0] * case[1] * SerialLine(case[2]).character_time
            ),
            "count a character of 8E1 again: start, data, parity, stop": lambda: (
                lambda *case: _scan(*case, character="8N1")
            ),
        },
    ),
    Exercise(
        "ex-06-4",
        draws={
            "rate": (38400, 57600, 115200),
            "think_ms": range(3, 9),
            "timeout_ms": range(150, 451, 50),
        },
        answer=lambda rate, think_ms, timeout_ms: Whole(
            _most(rate, think_ms, timeout_ms), "valves"
        ),
        traps={
            "with all of them alive; what does one dead valve cost?": partial(_most, dead=0),
            "valves need time to think": lambda rate, think_ms, timeout_ms: _most(
                rate, 0, timeout_ms
            ),
        },
    ),
)
