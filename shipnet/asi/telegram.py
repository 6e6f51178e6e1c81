"""AS-i telegrams: a master's request and a slave's response.

    request   ST=0  CB  A4..A0  I4..I0  PB  EB=1     14 bits
    response  ST=0      I3..I0          PB  EB=1      7 bits

The parity bit makes the number of ones even, counted from the start bit up to and including the
parity bit; the end bit does not count (claim kim2023-040 discusses the other interpretation).
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from functools import cache
from itertools import product
from typing import Any, Literal

from shipnet import style
from shipnet.asi.profile import describe_io_configuration, describe_status
from shipnet.errors import (
    ArgumentError,
    EndBitError,
    LengthError,
    ParityError,
    StartBitError,
    SymbolError,
    UnknownCallError,
)
from shipnet.fields import check_choice, check_kind, check_whole
from shipnet.lazy import Axes, pd


class Answer(IntEnum):
    """Responses that the standard prescribes for every slave."""

    DONE = 0x6
    ERASED = 0x0


@dataclass(frozen=True, slots=True)
class Rule:
    """Bits, wording and response of a call; a pattern shows the bits between start and parity bit.

    0 and 1 are fixed bits, ``a`` is an address bit and ``d`` a data bit; ``s`` is the select bit
    of an A/B slave (0 for A, 1 for B), and ``S`` is its inverse.
    """

    title: str
    pattern: str
    says: str
    extended: str = ""
    symbol: str = "D"
    lowest_address: int = 0
    answer: str | Answer | None = None

    def layout(self, extended: bool) -> str:
        """Return the pattern for an A/B slave if `extended`, otherwise for a standard slave."""
        return self.extended if extended and self.extended else self.pattern


class Call(IntEnum):
    """The 13 calls of a master; their numbers are ours, not the standard's.

    References
    ----------
    .. [1] ZMD AG, "ASI4U Universal AS-Interface IC", data sheet rev. 1.4, 2006, table 6.
    .. [2] ZMD AG, "SAP5S/SAP51 Universal AS-Interface IC", data sheet rev. 3.1, 2012, table 6.

    Examples
    --------
    >>> Call.READ_STATUS.rule.pattern
    '1aaaaa1S110'
    """

    _rule: Rule

    def __new__(cls, rule: Any) -> Call:
        """Number the calls from 0 in the order of their definition."""
        call = int.__new__(cls, len(cls.__members__))
        call._value_, call._rule = len(cls.__members__), rule
        return call

    @property
    def rule(self) -> Rule:
        """Bits, wording and response of the call."""
        return self._rule

    DATA_EXCHANGE = Rule(
        "data exchange",
        "0aaaaa0dddd",
        extended="0aaaaa0Sddd",
        lowest_address=1,
        answer="inputs",
        says="data exchange with slave {slave}: outputs {bits} ({data:X})",
    )
    WRITE_PARAMETER = Rule(
        "write parameter",
        "0aaaaa1dddd",
        extended="0aaaaa1Sddd",
        lowest_address=1,
        symbol="P",
        says="write parameter {bits} ({data:X}) to slave {slave}",
        answer="parameter",
    )
    ASSIGN_ADDRESS = Rule(
        "assign address",
        "000000ddddd",
        symbol="A",
        answer=Answer.DONE,
        says="assign address {data} to the slave at address 0",
    )
    WRITE_ID1 = Rule(
        "write extended ID code 1",
        "1000000dddd",
        symbol="ID",
        answer=Answer.ERASED,
        says="write extended ID code 1 {bits} ({data:X}) to the slave at address 0",
    )
    DELETE_ADDRESS = Rule(
        "delete address",
        "1aaaaa0s000",
        lowest_address=1,
        answer=Answer.ERASED,
        says="delete the address of slave {slave}",
    )
    RESET = Rule("reset slave", "1aaaaa1S100", "reset slave {slave}", answer=Answer.DONE)
    READ_IO_CONFIGURATION = Rule(
        "read I/O configuration",
        "1aaaaa1s000",
        answer="I/O configuration",
        says="read the I/O configuration of slave {slave}",
    )
    READ_ID = Rule(
        "read ID code", "1aaaaa1s001", "read the ID code of slave {slave}", answer="ID code"
    )
    READ_ID1 = Rule(
        "read extended ID code 1",
        "1aaaaa1s010",
        answer="extended ID code 1",
        says="read extended ID code 1 of slave {slave}",
    )
    READ_ID2 = Rule(
        "read extended ID code 2",
        "1aaaaa1s011",
        answer="extended ID code 2",
        says="read extended ID code 2 of slave {slave}",
    )
    READ_STATUS = Rule(
        "read status", "1aaaaa1S110", "read the status of slave {slave}", answer="status"
    )
    BROADCAST_RESET = Rule(
        "broadcast reset", "11111110101", "broadcast reset of all slaves, without response"
    )
    ENTER_PROGRAM_MODE = Rule(
        "enter program mode", "10000011101", "enter program mode at address 0, without response"
    )


#: Number of bits of a master's request and of a slave's response.
REQUEST_BITS, RESPONSE_BITS = 14, 7

#: Parts of a telegram by its number of bits: label, number of bits, key of `style.FIELD`.
#: Names of adjacent single bits are on two lines, for bits that are narrower than their names.
_PARTS = {
    REQUEST_BITS: (
        ("ST", 1, "frame"),
        ("\nCB", 1, "control"),
        ("address\nA4..A0", 5, "address"),
        ("information\nI4..I0", 5, "information"),
        ("\nPB", 1, "parity"),
        ("EB", 1, "frame"),
    ),
    RESPONSE_BITS: (
        ("ST", 1, "frame"),
        ("I3..I0", 4, "information"),
        ("\nPB", 1, "parity"),
        ("EB", 1, "frame"),
    ),
}


@style.applied
def plot_telegram(bits: str, ax: Axes | None = None, *, start: float | None = None) -> Axes:
    """Draw a telegram as coloured bits below its levels; among other telegrams, give `start`."""
    if len(bits) not in _PARTS:
        raise LengthError(f"a telegram has 14 or 7 bits, but {bits!r} has {len(bits)}")
    ax = style.axes(ax, figsize=(6.4, 2.2))
    alone, start = start is None, start or 0.0
    edge = start
    for label, length, colour in _PARTS[len(bits)]:
        style.box(ax, edge, 0, length, 1, facecolor=style.FIELD[colour], edgecolor="0.3")
        ax.text(edge + length / 2, -0.22, label.strip() if alone else label, ha="center", va="top")
        edge += length
    ax.grid(visible=False)
    ax.spines["left"].set_visible(False)
    for index, bit in enumerate(bits):
        ax.text(start + index + 0.5, 0.5, bit, ha="center", va="center", family="monospace")
    edges = [start + index for index in range(len(bits) + 1)]
    levels = [1.35 + 0.5 * int(bit) for bit in bits]
    ax.step(edges, [*levels, levels[-1]], where="post", color="C0")
    ax.set_yticks([0.5, 1.6], ["bit", "level"])
    ax.tick_params(axis="y", length=0)
    short = alone and len(bits) == RESPONSE_BITS
    ax.set(xlabel="time [bit]", ylim=(-0.8 if short else -1.3, 2.1))
    return ax


#: Titles of the bits between start bit and parity bit.
_PLACES = ["CB", "A4", "A3", "A2", "A1", "A0", "I4", "I3", "I2", "I1", "I0"]


def frame(information: str) -> str:
    """Return a telegram: start bit, the bits of `information`, parity bit and end bit."""
    return f"0{information}{information.count('1') % 2}1"


def _call(value: Call | int) -> Call:
    return value if type(value) is Call else Call(check_whole("call", value, 0, len(Call) - 1))


def information_of(bits: str, length: int, what: str) -> str:
    """Return the bits between start and parity bit; raise a FrameError for the first fault."""
    check_kind("bits", bits, str)
    if len(bits) != length:
        raise LengthError(f"a {what} has {length} bits, but {bits!r} has {len(bits)}")
    for index, symbol in enumerate(bits):
        if symbol not in "01":
            raise SymbolError(f"{what} {bits!r} has {symbol!r} at bit {index}; bits are 0 or 1")
    if bits[0] != "0":
        raise StartBitError(f"{what} {bits} starts with 1; the start bit is 0")
    if bits[-1] != "1":
        raise EndBitError(f"{what} {bits} ends with 0; the end bit is 1")
    ones = bits[:-1].count("1")
    if ones % 2:
        raise ParityError(
            f"{what} {bits} has {ones} ones before its end bit; with the parity bit {bits[-2]} "
            "their number must be even"
        )
    return bits[1:-2]


@dataclass(frozen=True, slots=True)
class Response:
    """A slave's response.

    Parameters
    ----------
    data : int
        The four information bits, 0..15.
    call : Call, optional
        The call that it answers, which determines the meaning of the bits.

    Examples
    --------
    >>> Response(0x6).bits
    '0011001'
    >>> print(Response(0x3, Call.READ_IO_CONFIGURATION))
    response to read I/O configuration: 3, ports D0..D3 IN IN OUT OUT
    """

    data: int
    call: Call | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "data", check_whole("data", self.data, 0, 15, " in a response"))
        if self.call is not None:
            object.__setattr__(self, "call", _call(self.call))
            if self.call.rule.answer is None:
                raise ArgumentError(f"call is {self.call.rule.title}, which has no response")

    @property
    def bits(self) -> str:
        """The 7 bits in the order in which they are sent."""
        return frame(f"{self.data:04b}")

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the response as coloured bits, with its levels above; x is in bit times."""
        return plot_telegram(self.bits, ax)

    def __str__(self) -> str:
        if self.call is None:
            return f"response: {self.data:04b} ({self.data:X})"
        answer = self.call.rule.answer
        head = f"response to {self.call.rule.title}: "
        if answer == "I/O configuration":
            return f"{head}{self.data:X}, {describe_io_configuration(self.data)}"
        if answer == "status":
            return f"{head}{self.data:04b}, {describe_status(self.data)}"
        if isinstance(answer, Answer):
            ending = "done" if self.data == answer else f"but the standard requires {answer:X}"
            return f"{head}{self.data:X}, {ending}"
        what = "" if str(answer) in self.call.rule.title else f"{answer} "
        return f"{head}{what}{self.data:04b} ({self.data:X})"

    @classmethod
    def parse(cls, bits: str, call: Call | None = None) -> Response:
        """Read the 7 bits of a response."""
        return cls(int(information_of(bits, RESPONSE_BITS, "response"), 2), call)

    @classmethod
    def fields(cls) -> pd.DataFrame:
        """Return the fields of a response with lengths and values: kim2023's Table 6."""
        return _fields(("I0~I3", "information", 4, "", "", ""))

    @classmethod
    def all(cls) -> tuple[Response, ...]:
        """Return all 16 responses."""
        return tuple(cls(data) for data in range(16))


#: The bits of all 16 responses.
RESPONSES = tuple(Response(data).bits for data in range(16))


Half = Literal["A", "B"]


@dataclass(frozen=True, slots=True)
class Request:
    """A master's request.

    Parameters
    ----------
    call : Call
        One of the 13 calls.
    address : int
        Address of the slave, 0..31: 0 for a slave without an address, 31 also for the broadcast.
    data : int, default 0
        The data that the call carries: output or parameter bits 0..15 (0..7 for an A/B slave),
        the new address 1..31, or the extended ID code 1, 0..15; otherwise 0.
    half : {"A", "B"}, optional
        Which of the two A/B slaves at an address; None for a standard slave.

    Notes
    -----
    The select bit is inverted in data exchange, write parameter, reset and read status. A request
    with select bit 0 (to an A slave) thus equals one that masters before specification 2.1 send to
    standard slaves. Claim kim2023-047 shows where the paper's table differs.

    References
    ----------
    .. [1] ZMD AG, "ASI4U Universal AS-Interface IC", data sheet rev. 1.4, 2006, table 6.
    .. [2] R. G. Kim, Y. H. Cho, K. H. Hyun, "AS-Interface protocol utilization for smart ships",
       J. Soc. Nav. Archit. Korea 60(6), 2023, section 3.4.

    Examples
    --------
    The example of [2]_, with the parity bit that makes the number of ones even:

    >>> request = Request.data_exchange(21, 0xE)
    >>> request.bits
    '00101010111001'
    >>> print(request)
    data exchange with slave 21: outputs 1110 (E)
    """

    call: Call
    address: int
    data: int = 0
    half: Half | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "call", _call(self.call))
        rule, layout = self.call.rule, self._layout
        if self.half is not None:
            check_choice("half", self.half, "AB")
        if self.half and "s" not in layout.lower():
            raise ArgumentError(f"half is {self.half!r}, but {rule.title} has no select bit")
        if "a" in layout:
            why = "" if rule.lowest_address == 0 else f": {rule.title} needs an addressed slave"
            address = check_whole("address", self.address, rule.lowest_address, 31, why)
        else:
            only = int(layout[1:6], 2)
            address = check_whole("address", self.address, only, only, f" for {rule.title}")
        lowest = 1 if self.call is Call.ASSIGN_ADDRESS else 0
        why = f" in {rule.title}" + (f" if half is {self.half}" if self.half else "")
        data = check_whole("data", self.data, lowest, 2 ** layout.count("d") - 1, why)
        object.__setattr__(self, "address", address)
        object.__setattr__(self, "data", data)

    @property
    def _layout(self) -> str:
        return self.call.rule.layout(self.half is not None)

    @property
    def bits(self) -> str:
        """The 14 bits in the order in which they are sent."""
        layout = self._layout.replace("aaaaa", f"{self.address:05b}")
        layout = layout.replace("d" * layout.count("d"), self._data_bits)
        is_b = self.half == "B"
        return frame(layout.replace("s", str(int(is_b))).replace("S", str(int(not is_b))))

    @property
    def _data_bits(self) -> str:
        width = self._layout.count("d")
        return f"{self.data:0{width}b}" if width else ""

    @property
    def slave(self) -> str:
        """The slave's label: ``"21"``, ``"21A"``, ``"21B"``."""
        return f"{self.address}{self.half or ''}"

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the request as coloured bits, with its levels above; x is in bit times."""
        return plot_telegram(self.bits, ax)

    def __str__(self) -> str:
        return self.call.rule.says.format(slave=self.slave, data=self.data, bits=self._data_bits)

    def answer(self, data: int | None = None) -> Response:
        """Return the response to this request; a fixed response needs no `data`."""
        expected = self.call.rule.answer
        if data is None and isinstance(expected, Answer):
            data = int(expected)
        if data is None and expected is not None:
            raise ArgumentError(
                f"data is missing: the response to {self.call.rule.title} needs the {expected}, "
                "0..15"
            )
        return Response(0 if data is None else data, self.call)

    @classmethod
    def parse(cls, bits: str, *, extended: bool = False) -> Request:
        """Read the 14 bits of a request."""
        information = information_of(bits, REQUEST_BITS, "request")
        check_kind("extended", extended, bool)
        if request := all_requests(extended).get(bits):
            return request
        raise UnknownCallError(
            f"request {bits}: no call has control bit {information[0]}, address "
            f"{int(information[1:6], 2)} and information {information[6:]}"
        )

    @classmethod
    def data_exchange(cls, address: int, data: int, half: Half | None = None) -> Request:
        """Return a request that sends outputs to a slave and asks for its inputs."""
        return cls(Call.DATA_EXCHANGE, address, data, half)

    @classmethod
    def table(cls) -> pd.DataFrame:
        """Return all requests to A/B slaves bit by bit: kim2023's Table 5.

        A cell is 0 or 1 if the bit is fixed, otherwise the name of its content: ``S`` is the
        select bit, ``~S`` its inverse.
        """
        rows = {}
        for call in Call:
            layout = call.rule.layout(extended=True)
            left = layout.count("d")
            cells = []
            for letter, field in zip(layout, _PLACES, strict=True):
                if letter == "d":
                    left -= 1
                    cells.append(f"{call.rule.symbol}{left}")
                elif letter == "a":
                    cells.append(field)
                else:
                    cells.append({"s": "S", "S": "~S"}.get(letter, letter))
            rows[call.name] = ["0", *cells, "PB", "1"]
        columns = ["ST", *_PLACES, "PB", "EB"]
        return pd.DataFrame.from_dict(rows, orient="index", columns=columns).rename_axis("call")

    @classmethod
    def fields(cls) -> pd.DataFrame:
        """Return the fields of a request with lengths and values: kim2023's Table 4."""
        zero, one = (
            " ".join(call.name for call in Call if call.rule.pattern[0] == bit) for bit in "01"
        )
        return _fields(
            ("CB", "control bit", 1, zero, one, ""),
            ("A0~A4", "address", 5, "", "", ""),
            ("I0~I4", "information", 5, "", "", ""),
        )


@cache
def all_requests(extended: bool) -> dict[str, Request]:
    """Return all requests, to A/B slaves if `extended`, otherwise to standard slaves, by bits.

    Without extended addressing, select bit 0 means a standard slave, not an A slave.
    """
    requests: dict[str, Request] = {}
    for call in Call:
        layout = call.rule.layout(extended)
        addresses = range(call.rule.lowest_address, 32) if "a" in layout else [int(layout[1:6], 2)]
        lowest = 1 if call is Call.ASSIGN_ADDRESS else 0
        halves: tuple[Half | None, ...] = (None,)
        if "s" in layout.lower():
            halves = ("A" if extended else None, "B")
        for half, address in product(halves, addresses):
            for data in range(lowest, 2 ** layout.count("d")):
                request = Request(call, address, data, half)
                requests[request.bits] = request
    return requests


def _fields(*inner: tuple[str, str, int, str, str, str]) -> pd.DataFrame:
    """Return the fields of a telegram: start bit, the `inner` fields, parity bit and end bit."""
    rows = [
        ("ST", "start bit", 1, "valid", "invalid", ""),
        *inner,
        ("PB", "parity bit", 1, "", "", "all bits but the end bit"),
        ("EB", "end bit", 1, "invalid", "valid", ""),
    ]
    columns = ["symbol", "field", "length_bit", "value_0", "value_1", "ones_even_over"]
    return pd.DataFrame(rows, columns=columns).set_index("symbol")
