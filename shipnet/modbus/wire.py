"""Faults of a server's responses on their way to a client."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Any, Literal, get_args

from shipnet.errors import ArgumentError
from shipnet.fields import check_fields, check_rng, choice, number, record
from shipnet.modbus.frame import MAX_UNIT
from shipnet.modbus.pdu import Adu

Name = Literal[
    "late",
    "delay",
    "gap",
    "double",
    "previous",
    "short",
    "garbage-before",
    "garbage-after",
    "wrong-unit",
    "wrong-function",
    "wrong-count",
    "wrong-crc",
    "wrong-transaction",
]

#: Faults with a duration, and the default duration [s]; that of `late` exceeds usual time-outs.
_SECONDS = {"late": 5.0, "delay": 0.5, "gap": 0.5}

#: Faults of fields that only one kind of frame has.
_ONLY = {
    "wrong-crc": ("rtu", "a serial line; a TCP frame has no CRC"),
    "wrong-transaction": ("tcp", "TCP; an RTU frame has no transaction id"),
}

_GARBAGE = 4

Piece = tuple[float, bytes]  #: The silence before a piece of a response [s], and its bytes.


@record
class WireFault:
    """A fault in some of a server's responses; `serve` accepts any number of faults.

    Notes
    -----
    ``late`` delays a response by `seconds`, and ``delay`` by a random time up to `seconds`. ``gap``
    splits the response by a silence of `seconds`. ``double`` sends it twice without a pause.
    ``previous`` sends the previous response instead, whichever client that was for. ``short`` sends
    only the first half. ``garbage-before`` and ``garbage-after`` add four random bytes.

    The other faults change a field. ``wrong-count`` lowers the byte count of a read response by 2.
    ``wrong-unit`` sends the next unit id, ``wrong-function`` another function code and
    ``wrong-transaction`` the next transaction id; with ``wrong-crc`` the CRC is wrong. All of these
    except ``wrong-count`` flip the last bit of the data, so that a client that accepts the response
    shows a wrong value.

    Examples
    --------
    >>> from shipnet.modbus import Adu, Request
    >>> request = Request.read_holding_registers(0, 2)
    >>> answer = Adu(1, request.response([350, 412]))
    >>> for name in ("wrong-unit", "wrong-count", "gap"):
    ...     print(*((pause, data.hex(" ")) for pause, data in WireFault(name).pieces(answer)))
    (0.0, '02 03 04 01 5e 01 9d 69 24')
    (0.0, '01 03 02 01 5e 01 9c 13 e4')
    (0.0, '01 03 04 01') (0.5, '5e 01 9c 9b e4')
    """

    name: Name = choice(get_args(Name), "Kind of fault; see Notes")
    probability: float = number(0, 1, "", "Fraction of responses with this fault", default=1.0)
    seconds: float | None = number(
        0,
        3600,
        "s",
        "Duration of late (default 5), delay and gap (0.5)",
        default=None,
        optional=True,
    )

    def __post_init__(self) -> None:
        check_fields(self)
        if self.seconds is None:
            object.__setattr__(self, "seconds", _SECONDS.get(self.name))
        elif self.name not in _SECONDS:
            raise ArgumentError(
                f"seconds is {self.seconds:g} s for {self.name!r}; only {', '.join(_SECONDS)} "
                "take time"
            )

    @classmethod
    def parse(cls, fault: str) -> WireFault:
        """Return the fault described by text such as ``late:0.1:3``: name, probability, seconds."""
        name, *numbers = fault.split(":")
        try:
            return cls(name, *map(float, numbers))  # type: ignore[arg-type] # the choice is checked
        except ArgumentError as error:
            raise ArgumentError(f"wire fault {fault!r}: {error}") from None
        except (TypeError, ValueError):
            raise ArgumentError(
                f"wire fault is {fault!r}; it must be NAME, NAME:PROBABILITY or "
                "NAME:PROBABILITY:SECONDS, such as wrong-unit:0.1"
            ) from None

    def pieces(self, answer: Adu, previous: Adu | None = None, rng: Any = None) -> list[Piece]:
        """Return the silence before each piece of a response [s], and its bytes."""
        frame, seconds, random = answer.frame, self.seconds or 0.0, check_rng(rng)
        unit, pdu, half = answer.unit_id, answer.pdu, len(frame) // 2
        other = replace(answer, pdu=pdu[:-1] + bytes([pdu[-1] ^ 1]))
        match self.name:
            case "late":
                return [(seconds, frame)]
            case "delay":
                return [(random.uniform(0, seconds), frame)]
            case "gap":
                return [(0.0, frame[:half]), (seconds, frame[half:])]
            case "double":
                frame += frame
            case "previous":
                frame = (previous or answer).frame
            case "short":
                frame = frame[:half]
            case "garbage-before":
                frame = random.bytes(_GARBAGE) + frame
            case "garbage-after":
                frame += random.bytes(_GARBAGE)
            case "wrong-unit":
                frame = replace(other, unit_id=unit % MAX_UNIT + 1).frame
            case "wrong-function":  # responses to codes 1 and 2, 3 and 4, ... differ only in code
                code = ((pdu[0] - 1 ^ 1) + 1) % 256
                frame = replace(other, pdu=bytes([code]) + other.pdu[1:]).frame
            case "wrong-count" if pdu[0] in (1, 2, 3, 4):
                frame = replace(answer, pdu=bytes([pdu[0], max(pdu[1] - 2, 0)]) + pdu[2:]).frame
            case "wrong-crc":
                frame = other.frame[:-2] + frame[-2:]
            case "wrong-transaction":
                number = ((answer.transaction_id or 0) + 1) % 0x10000
                frame = replace(other, transaction_id=number).frame
        return [(0.0, frame)]


class Wire:
    """The wire of a server, which chooses a fault for each response at random."""

    def __init__(self, faults: Iterable[WireFault], rng: Any) -> None:
        self.faults, self.rng = tuple(faults), check_rng(rng)
        self.previous: Adu | None = None

    def pieces(self, answer: Adu) -> list[Piece]:
        """Return the silence before each piece of a response [s], and its bytes."""
        previous, self.previous = self.previous, answer
        draw = self.rng.random()
        for fault in self.faults:
            if draw < fault.probability:
                return fault.pieces(answer, previous, self.rng)
            draw -= fault.probability
        return [(0.0, answer.frame)]


def check_faults(faults: WireFault | Iterable[WireFault], transport: str) -> tuple[WireFault, ...]:
    """Return faults as a tuple; raise an error if they do not fit the transport or each other."""
    several = (faults,) if isinstance(faults, WireFault) else tuple(faults)
    for fault in several:
        needed, why = _ONLY.get(fault.name, (transport, ""))
        if needed != transport:
            raise ArgumentError(f"wire fault {fault.name!r} needs {why}")
    if several and transport == "udp":
        raise ArgumentError("wire_faults need TCP or a serial line, not datagrams")
    total = sum(fault.probability for fault in several)
    if total > 1 + 1e-9:
        raise ArgumentError(
            f"the probabilities of wire_faults add up to {total:g}; a response has at most one "
            "fault, so they must not exceed 1 in total"
        )
    return several
