"""Exercises of lesson 5: who goes first on a CAN bus, and how late the others are."""

from __future__ import annotations

from itertools import permutations

from shipnet.can.frame import Frame, arbitrate, stuff
from shipnet.can.lengths import frame_length
from shipnet.can.messages import Message, MessageSet
from shipnet.can.response import audsley, response_times
from shipnet.exercises.answers import Bits, Choice, Function, Number, Whole
from shipnet.exercises.exercise import Exercise

_RATE = 125_000


def _stops_at(ids: tuple[str, str]) -> int:
    """Return the bit of the id at which the loser stops; no stuff bit stands before it."""
    stopped = arbitrate([Frame(int(number, 16)) for number in ids]).stopped
    return max(bit for bit in stopped if bit is not None)


def _first_one(ids: tuple[str, str]) -> int:
    return 11 - max(int(number, 16) for number in ids).bit_length() + 1


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


def _mine(stop_ms: float, n_bytes: int) -> MessageSet:
    return MessageSet(
        [
            Message("stop", 1, 1, stop_ms / 1e3),
            Message("speed", 2, 4, 0.01),
            Message("yours", 3, n_bytes, 0.1),
            Message("log", 4, 8, 1.0),
        ]
    )


def _response_ms(stop_ms: float, n_bytes: int) -> float:
    return 1e3 * response_times(_mine(stop_ms, n_bytes), _RATE)["yours"].response


def _frame_ms(n_bytes: int) -> float:
    return 1e3 * frame_length(n_bytes) / _RATE


def _without_stuff_bits(stop_ms: float, n_bytes: int) -> float:
    # Every frame counted without stuff bits; stop still comes twice, or once.
    lengths = [1e3 * frame_length(size, stuffing="none") / _RATE for size in (1, 4, n_bytes, 8)]
    once = lengths[3] + lengths[0] + lengths[1]
    return once + (lengths[0] if once > stop_ms else 0.0) + lengths[2]


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


def _order(messages: str) -> str:
    found = audsley(MessageSet.parse(messages), _RATE).messages
    return " ".join(found.names)


def _by_deadline(messages: str) -> str:
    return " ".join(MessageSet.parse(messages).deadline_monotonic().names)


EXERCISES = (
    Exercise(
        "ex-05-1",
        # Neither has five equal bits in a row before they differ, and both have a 1 before it.
        draws={
            "ids": (
                ("0x0AD", "0x0B4"),
                ("0x1B2", "0x1A1"),
                ("0x324", "0x335"),
                ("0x1DB", "0x1D5"),
                ("0x54D", "0x543"),
                ("0x267", "0x26B"),
                ("0x216", "0x213"),
                ("0x342", "0x347"),
            )
        },
        answer=lambda ids: Whole(_stops_at(ids)),
        traps={
            "that counts from the other end: the highest bit of the id is sent first": lambda ids: (
                12 - _stops_at(ids)
            ),
            "the first bit of the id is number 1, not 0": lambda ids: _stops_at(ids) - 1,
            "the start of frame, SOF, is no bit of the id": lambda ids: _stops_at(ids) + 1,
            "there the loser sends its first 1; does the other one send a 0 there?": _first_one,
        },
    ),
    Exercise(
        "ex-05-2",
        answer=lambda: Function(stuff, _TRIED, Bits),
        traps={
            "a stuff bit is itself the first of the next run of five": lambda: _stuffed_as_if_reset,
        },
    ),
    Exercise(
        "ex-05-3",
        draws={"stop_ms": (1.75, 2.0, 2.25), "n_bytes": (5, 6, 7, 8)},
        answer=lambda stop_ms, n_bytes: Number(_response_ms(stop_ms, n_bytes), "ms"),
        traps={
            "a less urgent frame may just have begun: who blocks, and for how long?": (
                lambda stop_ms, n_bytes: sum(map(_frame_ms, (1, 4, n_bytes)))
            ),
            "while you wait, time passes: does a more urgent message come again?": (
                lambda stop_ms, n_bytes: sum(map(_frame_ms, (8, 1, 4, n_bytes)))
            ),
            "that is the wait; your own frame has to be sent too": lambda stop_ms, n_bytes: (
                _response_ms(stop_ms, n_bytes) - _frame_ms(n_bytes)
            ),
            "frames without stuff bits; for the worst case count 55 + 10 n bits": (
                _without_stuff_bits
            ),
        },
    ),
    Exercise(
        "ex-05-4",
        draws={"messages": _SETS},
        answer=lambda messages: Choice(_order(messages), _ORDERS),
        traps={
            "that is the order by deadline; look at the response of the last one": _by_deadline,
            "the most urgent is not first: compare its deadline with a wait for two long frames": (
                lambda messages: " ".join(reversed(_by_deadline(messages).split()))
            ),
        },
    ),
)
