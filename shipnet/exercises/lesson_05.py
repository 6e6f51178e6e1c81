"""Exercises of lesson 5: arbitration, stuff bits and response times on a CAN bus."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import permutations

from shipnet.can.frame import Frame, arbitrate, stuff
from shipnet.can.lengths import frame_length
from shipnet.can.messages import Message, MessageSet
from shipnet.can.response import audsley, response_times
from shipnet.exercises.answers import Bits, Function, Number
from shipnet.exercises.exercise import ANY, Solution, solution

_RATE = 125_000


def _pair(number: int) -> tuple[str, str]:
    """Return two ids that first differ in one of the bits 2 to 8, counted from the left."""
    bit = 3 + number % 7
    return f"0x{number:03X}", f"0x{number ^ (1 << bit) ^ (number >> 1) % (1 << bit):03X}"


def _stop(ids: Sequence[str]) -> int:
    """Return the bit of the id, counted from 1, at which one of the two senders stops."""
    stopped = arbitrate([Frame(int(number, 16)) for number in ids]).stopped
    return max(bit for bit in stopped if bit is not None)


def _plain(ids: Sequence[str]) -> bool:
    """Return whether the loser stops before any stuff bit, and the bit order affects the answer."""
    last, winner = _stop(ids), f"{min(int(number, 16) for number in ids):011b}"
    early = [bit for number in ids for bit in Frame(int(number, 16)).stuff_positions if bit <= last]
    return not early and winner[::-1][:last] != winner[:last]


#: Pairs of ids of two senders.
_PAIRS = tuple(filter(_plain, map(_pair, range(0x091, 0x780, 0x02F))))


@solution("ex-05-1", "carried", ids=_PAIRS)
def carried(ids: tuple[str, str]) -> Solution:
    """Id bits that the bus carries, up to and including the one at which the loser stops."""
    numbers = [int(number, 16) for number in ids]
    last = _stop(ids)
    winner, loser = (f"{number:011b}" for number in (min(numbers), max(numbers)))
    right = winner[:last]
    return Bits(right), {
        "the first of these bits is not one of the 11 bits of the id": "0" + right,
        "in the last of these bits a 0 meets a 1: what does the bus carry?": loser[:last],
        "that is the whole id; at which of its bits does the loser stop?": winner,
        "include the bit at which the loser stops": right[:-1],
        "the loser stops before the last of these bits": winner[: last + 1],
        "Write both ids as 11 bits, one above the other: what does the bus carry, bit by bit?": ANY,
    }


def _stuffed(
    bits: str, *, after: int = 5, only: str = "01", turned: bool = True, counted: int = 1
) -> str:
    """Return the bits with stuff bits; the rule is right only with the default arguments."""
    out, run, last = "", 0, ""
    for bit in bits:
        run = run + 1 if bit == last else 1
        out, last = out + bit, bit
        if run == after and bit in only:
            last = "10"[int(bit)] if turned else bit
            out, run = out + last, counted
    return out


#: In the third entry, a stuff bit starts a run of five; the fifth needs one at its end.
_TRIED = [
    *(("0110",), ("11111",), ("000001111",), ("0000000000",), ("0111110000011111",), ("",)),
    *(("00000111110",), ("1111000011110000",), ("000000",)),
]


@solution("ex-05-2", "stuffed")
def stuffed() -> Solution:
    """Bits with the stuff bits inserted."""
    return Function(stuff, _TRIED, Bits), {
        "a stuff bit is itself the first bit of the next run": (
            lambda bits: _stuffed(bits, counted=0)
        ),
        "four equal bits are allowed; are five?": lambda bits: _stuffed(bits, after=4),
        "a stuff bit after six equal bits comes too late": lambda bits: _stuffed(bits, after=6),
        "a stuff bit may start a run of five, which `replace` does not detect": (
            lambda bits: bits.replace("00000", "000001").replace("11111", "111110")
        ),
        "five ones get a stuff bit too": lambda bits: _stuffed(bits, only="0"),
        "five zeros get a stuff bit too": lambda bits: _stuffed(bits, only="1"),
        "a stuff bit has the opposite value": lambda bits: _stuffed(bits, turned=False),
        "a run of five at the end gets a stuff bit": lambda bits: _stuffed(bits[:-1]) + bits[-1:],
        "nothing is inserted; when is a stuff bit needed?": lambda bits: bits,
        "Count equal bits as you go: when does the count restart, and from what number?": ANY,
    }


@solution("ex-05-3", "response_ms", stop_ms=(1.75, 2.0, 2.25), n_bytes=range(1, 8))
def response(stop_ms: float, n_bytes: int) -> Solution:
    """Longest response time of a message that waits for two others and is blocked by a third."""
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
    # Without stuff bits, stop is sent twice only if these frames take longer than its period.
    once = bare[3] + bare[0] + bare[1]
    return Number(right, "ms"), {
        "a less urgent frame may have just started: which one blocks, and for how long?": (
            stop + speed + yours
        ),
        "which more urgent message is sent again while yours waits?": log + stop + speed + yours,
        "that is the wait; your own frame has to be sent too": right - yours,
        "those are frames without stuff bits; in the worst case, a frame has 55 + 10 n bits": (
            once + (bare[0] if once > stop_ms else 0.0) + bare[2]
        ),
        "how often is stop sent while yours waits? Compare the wait and the period": right + stop,
        "your own frame is sent only once": right + yours,
        "that is your own frame alone; which frames can come before it?": yours,
        "which message besides stop is more urgent than yours?": right - speed,
        "Write the wait as a sum: the frame that blocks, then the more urgent frames": ANY,
    }


#: Sets that meet all deadlines in only one order, which is not the order of the deadlines; found
#: by search. For each message: bytes, period and deadline [ms].
_SETS = (
    ((5, 2.5, 2.5), (8, 2.0, 2.0), (1, 4.75, 2.75)),
    ((5, 2.0, 2.0), (7, 2.5, 2.5), (1, 4.25, 2.75)),
    ((8, 3.0, 3.0), (8, 2.25, 2.25), (3, 4.5, 3.75)),
    ((6, 2.75, 2.75), (6, 2.0, 2.0), (3, 3.5, 3.0)),
    ((8, 2.5, 2.25), (8, 2.75, 2.75), (1, 3.25, 3.25)),
    ((5, 2.25, 2.25), (5, 1.75, 1.75), (0, 3.75, 2.75)),
)


def _table(names: Sequence[str], rows: Sequence[tuple[int, float, float]]) -> str:
    numbered = enumerate(zip(names, rows, strict=True), start=1)
    lines = [f"{name},{k},{n},{period},{deadline}" for k, (name, (n, period, deadline)) in numbered]
    return "\n".join(["name,arbitration_id,dlc,period_ms,deadline_ms", *lines])


def _slacks(messages: MessageSet) -> dict[str, float]:
    """Return the slack of each message [ms], by name."""
    return {one.message.name: 1e3 * one.slack for one in response_times(messages, _RATE)}


@solution(
    "ex-05-4",
    "slack_ms",
    messages=tuple(
        _table(names, rows) for rows in _SETS for names in permutations(("pitch", "pump", "rudder"))
    ),
)
def slack(messages: str) -> Solution:
    """Smallest slack of three messages in the order that meets all deadlines."""
    message_set = MessageSet.parse(messages)
    good = tuple(audsley(message_set, _RATE).messages.names)
    right = _slacks(message_set.ordered(good))
    mistakes: dict[str, object] = {
        "Compute the slacks with each of the six orders: with which order is none below zero?": ANY,
        "that is the largest slack; which message comes closest to its deadline?": (
            max(right.values())
        ),
        "that is one of the slacks with the right order; is it the smallest?": (
            sorted(right.values())[1]
        ),
    }
    for order in permutations(message_set.names):
        if order != good:
            least = min(_slacks(message_set.ordered(order)).values())
            hint = (
                f"{least:.2f} ms is below zero: this order makes a message late; try another order"
            )
            mistakes[hint] = least
    return Number(min(right.values()), "ms", tolerance=0.01), mistakes
