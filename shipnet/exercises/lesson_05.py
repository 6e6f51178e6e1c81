"""Exercises of lesson 5: who goes first on a CAN bus, and how late the others are."""

from __future__ import annotations

from itertools import permutations

from shipnet.can.frame import Frame, arbitrate, stuff
from shipnet.can.lengths import frame_length
from shipnet.can.messages import Message, MessageSet
from shipnet.can.response import audsley, response_times
from shipnet.exercises.answers import Bits, Choice, Function, Number, Whole
from shipnet.exercises.exercise import Solution, solution

_RATE = 125_000

#: Neither has five equal bits in a row before they differ, and both have a 1 before it.
_PAIRS = (
    *(("0x0AD", "0x0B4"), ("0x1B2", "0x1A1"), ("0x324", "0x335"), ("0x1DB", "0x1D5")),
    *(("0x54D", "0x543"), ("0x267", "0x26B"), ("0x216", "0x213"), ("0x342", "0x347")),
)


@solution("ex-05-1", ids=_PAIRS)
def stops_at(ids: tuple[str, str]) -> Solution:
    """Bit of the id at which the loser stops; no stuff bit stands before it."""
    numbers = [int(number, 16) for number in ids]
    right = max(bit for bit in arbitrate(list(map(Frame, numbers))).stopped if bit is not None)
    return Whole(right), {
        "that counts from the other end: the highest bit of the id is sent first": 12 - right,
        "the first bit of the id is number 1, not 0": right - 1,
        "the start of frame, SOF, is no bit of the id": right + 1,
        "there the loser sends its first 1; does the other one send a 0 there?": (
            12 - max(numbers).bit_length()
        ),
    }


def _stuffed_as_if_reset(bits: str) -> str:
    """Stuff as somebody does who does not count the stuff bit in the run behind it."""
    out, run, last = "", 0, ""
    for bit in bits:
        run = run + 1 if bit == last else 1
        out, last = out + bit, bit
        if run == 5:
            out, run, last = out + "10"[int(bit)], 0, ""
    return out


#: The last row has a stuff bit behind the last bit; the third, one that begins the next run.
_TRIED = [("0110",), ("11111",), ("000001111",), ("0000000000",), ("0111110000011111",)]


@solution("ex-05-2")
def stuffed() -> Solution:
    """Bits with their stuff bits."""
    return Function(stuff, _TRIED, Bits), {
        "a stuff bit is itself the first of the next run of five": _stuffed_as_if_reset,
    }


@solution("ex-05-3", stop_ms=(1.75, 2.0, 2.25), n_bytes=(5, 6, 7, 8))
def response(stop_ms: float, n_bytes: int) -> Solution:
    """Longest response of a message that waits for two others and is blocked by a third."""
    messages = MessageSet(
        [
            Message("stop", 1, 1, stop_ms / 1e3),
            Message("speed", 2, 4, 0.01),
            Message("yours", 3, n_bytes, 0.1),
            Message("log", 4, 8, 1.0),
        ]
    )
    right = 1e3 * response_times(messages, _RATE)["yours"].response
    stop, speed, yours, log = 1e3 * frame_length([1, 4, n_bytes, 8]) / _RATE
    bare = 1e3 * frame_length([1, 4, n_bytes, 8], stuffing="none") / _RATE
    # Every frame counted without stuff bits; stop still comes twice, or once.
    once = bare[3] + bare[0] + bare[1]
    return Number(right, "ms"), {
        "a less urgent frame may just have begun: who blocks, and for how long?": (
            stop + speed + yours
        ),
        "while you wait, time passes: does a more urgent message come again?": (
            log + stop + speed + yours
        ),
        "that is the wait; your own frame has to be sent too": right - yours,
        "frames without stuff bits; for the worst case count 55 + 10 n bits": (
            once + (bare[0] if once > stop_ms else 0.0) + bare[2]
        ),
    }


def _table(*rows: str) -> str:
    return "\n".join(["name,arbitration_id,dlc,period_ms,deadline_ms", *rows])


#: Sets that one order alone keeps in time, and not that by deadline; found by trying many.
_SETS = (
    _table("rudder,1,5,2.5,2.5", "pitch,2,8,2.0,2.0", "pump,3,1,4.75,2.75"),
    _table("pitch,1,5,2.0,2.0", "pump,2,7,2.5,2.5", "rudder,3,1,4.25,2.75"),
    _table("pump,1,8,3.0,3.0", "rudder,2,8,2.25,2.25", "pitch,3,3,4.5,3.75"),
    _table("rudder,1,6,2.75,2.75", "pump,2,6,2.0,2.0", "pitch,3,3,3.5,3.0"),
    _table("pitch,1,8,2.5,2.25", "rudder,2,8,2.75,2.75", "pump,3,1,3.25,3.25"),
    _table("pump,1,5,2.25,2.25", "pitch,2,5,1.75,1.75", "rudder,3,0,3.75,2.75"),
)

_ORDERS = tuple(" ".join(names) for names in permutations(("pitch", "pump", "rudder")))


@solution("ex-05-4", messages=_SETS)
def order(messages: str) -> Solution:
    """Order of messages, the most urgent first, in which all are in time."""
    known = MessageSet.parse(messages)
    by_deadline = known.deadline_monotonic().names
    return Choice(" ".join(audsley(known, _RATE).messages.names), _ORDERS), {
        "that is the order by deadline; look at the response of the last one": (
            " ".join(by_deadline)
        ),
        "the most urgent is not first: compare its deadline with a wait for two long frames": (
            " ".join(reversed(by_deadline))
        ),
    }
