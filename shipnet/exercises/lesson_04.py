"""Exercises of lesson 4: polling, cycles and efficiency."""

from __future__ import annotations

from shipnet.asi.timing import ADDRESSES, Cycle, Transaction, cycle_time
from shipnet.exercises.answers import Function, Number, Whole
from shipnet.exercises.exercise import ANY, Solution, solution

_BIT = 6


@solution(
    "ex-04-1", "exchange_us", master_pause=(4, 4.5, 5, 5.5, 6, 6.5, 7), slave_pause=(1.5, 2, 2.5)
)
def transaction(master_pause: float, slave_pause: float) -> Solution:
    """Time from one request to the next."""
    right = Transaction(master_pause, slave_pause).duration * 1e6
    return Number(right, "us"), {
        "the next request begins only after the second pause": right - slave_pause * _BIT,
        "there is a pause between the request and the response, too": right - master_pause * _BIT,
        "that is the request and the response; where are the pauses?": 21 * _BIT,
        "the response takes time too": right - 7 * _BIT,
        "that is the time until the response begins": (14 + master_pause) * _BIT,
        "those are the pauses; where are the telegrams?": (master_pause + slave_pause) * _BIT,
        "that is in bit times; how long is a bit time?": right / _BIT,
        "stop at the start of the next request: count only one request": right + 14 * _BIT,
        "it takes that long with the pauses in the figure; how long are yours?": 26 * _BIT,
        "List the parts from one request to the next, with their bit times, and add them up": ANY,
    }


@solution("ex-04-2", "cycle_ms", slaves=range(8, 31), bits=(25, 26, 28))
def cycle(slaves: int, bits: int) -> Solution:
    """Cycle time if each exchange takes `bits` bit times."""
    one = bits * _BIT / 1e3
    return Number(float(cycle_time(slaves, transaction=Transaction(bits - 23, 2))) * 1e3, "ms"), {
        "a cycle has two more requests than slaves": slaves * one,
        "management and the search for a new slave are two exchanges, not one": (
            (slaves + 1) * one
        ),
        "that is for 31 slaves; how many does your line have?": (ADDRESSES + 2) * one,
        "that is in bit times; how long is a bit time?": (slaves + 2) * bits,
        "that is one exchange; how many does a cycle have?": one,
        "each exchange takes your `bits`, pauses included": (slaves + 2) * 21 * _BIT / 1e3,
        "How many exchanges does a cycle have in all? How long does one of them take?": ANY,
    }


def _efficiency(user_bits: int, master_pause: float, slave_pause: float) -> float:
    """Return the percentage of time spent on `user_bits`, the user data of both directions."""
    return 100 * user_bits / Transaction(master_pause, slave_pause).bits


_TRIED = [(8, 2, 2), (4, 3, 2), (7, 2, 1.5), (8, 10, 2), (0, 2, 2)]


@solution("ex-04-3", "efficiency_of")
def efficiency() -> Solution:
    """Percentage of time spent on user data."""
    return Function(_efficiency, _TRIED, lambda right: Number(right, "%")), {
        "the pauses take time too": lambda user, p, q: 100 * user / (14 + 7),
        "the response belongs to the exchange too": lambda user, p, q: 100 * user / (14 + p + q),
        "the pause after the response takes time too": lambda user, p, q: 100 * user / (21 + p),
        "the pause before the response takes time too": lambda user, p, q: 100 * user / (21 + q),
        "eight bits are only an example: where is `user_bits`?": lambda user, p, q: (
            800 / (21 + p + q)
        ),
        "`user_bits` already counts both directions": lambda user, p, q: 200 * user / (21 + p + q),
        "How many bit times does an exchange take with its pauses? How many are user bits?": ANY,
    }


def _most(limit: float, repetitions: int) -> int:
    """Return the largest number of slaves with a worst-case response time up to `limit` [ms]."""
    left = limit * 1e-3 - repetitions * Transaction().duration
    return sum(Cycle(slaves).response_time().worst <= left for slaves in range(1, ADDRESSES + 1))


# With each limit, one slave too many seems to fit if the last pause and response are omitted.
@solution(
    "ex-04-4",
    "most_slaves",
    limit=(2.2, 2.5, 2.7, 3.0, 3.3, 3.8, 4.1, 4.4, 4.7, 5.0),
    repetitions=(3, 4),
)
def most_slaves(limit: float, repetitions: int) -> Solution:
    """Largest number of slaves for which the master learns of a change within the limit."""
    right = _most(limit, repetitions)
    return Whole(right, "slaves"), {
        # The result of rounding up, or of omitting an extra request or the last pause and response.
        "with this many slaves, do cycle, repetitions, pause and response fit within the limit?": (
            right + 1
        ),
        "that is the number of addresses; is the limit met with that many slaves?": ADDRESSES,
        "For ten slaves, add the bit times of the wait: cycle, repetitions, pause, response": ANY,
    }
