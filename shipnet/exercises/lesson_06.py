"""Exercises of lesson 6: Modbus requests, silences and scan times."""

from __future__ import annotations

from shipnet.exercises.answers import Bytes, Function, Number, Whole
from shipnet.exercises.exercise import ANY, Solution, solution
from shipnet.modbus.pdu import FunctionCode, Request
from shipnet.modbus.polling import Poll
from shipnet.modbus.uart import SerialLine

_LIMIT = 2.0


def _question(first: int, quantity: int, function: int = 3) -> Request:
    return Request(FunctionCode(function), first, quantity)


@solution(
    "ex-06-1", "request_1", unit=range(2, 31), number=range(301, 1000, 7), quantity=range(2, 11)
)
def request(unit: int, number: int, quantity: int) -> Solution:
    """Bytes of a request for holding registers, without the CRC."""

    def asking(first: int, function: int = 3) -> bytes:
        return bytes([unit, function]) + _question(first, quantity).pdu[1:]

    return Bytes(asking(number - 1)), {
        "manuals count from 1 and requests from 0: which register does this read?": (
            asking(number)
        ),
        "requests count from 0 and manuals from 1: subtract one, not two": asking(number - 2),
        "the quantity counts registers, not bytes": (
            asking(number - 1)[:-2] + (2 * quantity).to_bytes(2)
        ),
        "the quantity has two bytes": asking(number - 1)[:-2] + quantity.to_bytes(1),
        "both numbers are sent high byte first": (
            bytes([unit, 3]) + (number - 1).to_bytes(2, "little") + quantity.to_bytes(2, "little")
        ),
        "those are decimal digits: write the numbers in hexadecimal": (
            bytes.fromhex(f"{unit:02}03{number - 1:04}{quantity:04}")
        ),
        "function code 4 reads input registers; these are holding registers": (
            asking(number - 1, 4)
        ),
        "function code 6 writes a register, but the task is to read": asking(number - 1, 6),
        "function code 1 reads single bits; these are registers": asking(number - 1, 1),
        "Write field by field: unit, function, then two bytes each for register and quantity": ANY,
    }


@solution("ex-06-2", "response_ms", registers=range(6, 31), rate=(2400, 4800, 9600, 19200))
def response_time(registers: int, rate: int) -> Solution:
    """Duration of a response on the line."""

    def lasts(extra: int = 0, character: str = "8E1") -> float:
        size = _question(0, registers).response_size + 3 + extra
        return 1e3 * SerialLine(rate, character).frame_time(size)

    return Number(lasts(), "ms"), {
        "a byte takes more than 8 bits on the line": lasts() * 8 / 11,
        "count the bits of 8E1 again: start, data, parity, stop": lasts(character="8N1"),
        "that is the data alone; which bytes come before and after them?": lasts(-5),
        "two bytes too few: list all bytes of the response": lasts(-2),
        "one byte too few: list all bytes of the response": lasts(-1),
        "one byte too many: list all bytes of the response": lasts(1),
        "count from the first bit to the last: the silence comes after the response": (
            lasts() + 1e3 * SerialLine(rate).t35
        ),
        "that includes the request; only the response counts": lasts(8),
        "Count the bytes of the response one by one, then the bits of one character": ANY,
    }


def _scan(n_slaves: int, n_registers: int, bit_rate: int, *, character: str = "8E1") -> float:
    return Poll(_question(0, n_registers), SerialLine(bit_rate, character)).scan_time(n_slaves)


def _scan_with(silences: float, n_slaves: int, n_registers: int, bit_rate: int) -> float:
    """Return the duration of a scan [s] with `silences` characters of silence per transaction."""
    return n_slaves * (13 + 2 * n_registers + silences) * 11 / bit_rate


#: Smallest scan; highest rate with silences of 3.5 characters; higher rates; largest scan.
_TRIED = [(1, 1, 9600), (31, 10, 19200), (60, 4, 38400), (247, 4, 115200), (247, 125, 4800)]


@solution("ex-06-3", "scan_time")
def scan_time() -> Solution:
    """Duration of a scan of all slaves."""
    return Function(_scan, _TRIED, lambda right: Number(right, "s")), {
        "is the silence 3.5 characters at every bit rate?": lambda *case: _scan_with(7, *case),
        "a transaction has two silences, one after each frame": (
            lambda *case: _scan(*case) - case[0] * SerialLine(case[2]).t35
        ),
        "the silences are missing": lambda *case: _scan_with(0, *case),
        "at 19200 bit/s itself, the silence is still 3.5 characters": (
            lambda n, k, rate: _scan(n, k, rate) - (rate == 19200) * n * (77 / rate - 3.5e-3)
        ),
        "count the bits of 8E1 again: start, data, parity, stop": (
            lambda *case: _scan(*case, character="8N1")
        ),
        "that is one slave; how many are polled?": lambda n, *case: _scan(1, *case),
        "the request takes time too": (
            lambda *case: _scan(*case) - case[0] * 8 * SerialLine(case[2]).character_time
        ),
        "above which bit rate is the silence 1.75 ms?": (
            lambda n, registers, rate: n * ((13 + 2 * registers) * 11 / rate + 2 * 1.75e-3)
        ),
        "Compute one transaction with one slave by hand: request, silence, response, silence": ANY,
    }


@solution(
    "ex-06-4",
    "most_valves",
    rate=(38400, 57600, 115200),
    think_ms=range(3, 9),
    timeout_ms=range(150, 451, 50),
)
def most_valves(rate: int, think_ms: int, timeout_ms: int) -> Solution:
    """Largest number of valves, one of them dead, that a master can scan in 2 s."""
    serial = SerialLine(rate)

    poll = Poll(_question(0, 4, 4), serial, processing=think_ms / 1e3, timeout=timeout_ms / 1e3)

    def fit(silence: float, think: float = think_ms / 1e3) -> int:
        """Return how many valves fit, given each silence and the processing time [s]."""
        left = _LIMIT - 8 * serial.character_time - timeout_ms / 1e3
        return 1 + int(left / (21 * serial.character_time + 2 * silence + think))

    right = poll.max_slaves(_LIMIT, dead=1)
    return Whole(right, "valves"), {
        "this many fit without a dead valve; how much time does one dead valve take?": (
            poll.max_slaves(_LIMIT)
        ),
        "valves need time to process a request": fit(1.75e-3, 0),
        "with one valve more, does the scan still take at most 2 s? The dead one counts": right - 1,
        "with this many valves, one of them dead, does the scan take at most 2 s?": right + 1,
        "there are two silences in each transaction": fit(0),
        "how long is a silence above 19200 bit/s?": fit(3.5 * serial.character_time),
        "there is a silence after the response, too": fit(1.75e-3 / 2),
        "How long does the dead valve take, and how many others fit into the remaining time?": ANY,
    }
