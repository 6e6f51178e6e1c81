"""Exercises of lesson 4: polling, cycle, efficiency."""

from __future__ import annotations

from shipnet.asi.timing import ADDRESSES, Cycle, Transaction, cycle_time
from shipnet.exercises.answers import Function, Number, Whole
from shipnet.exercises.exercise import Solution, solution


@solution("ex-04-1", master_pause=(2, 2.5, 4, 5, 6), slave_pause=(1.5, 2, 2.5))
def transaction(master_pause: float, slave_pause: float) -> Solution:
    """Time from a request to the next."""
    right = Transaction(master_pause, slave_pause).duration * 1e6
    return Number(right, "us"), {
        "the next request waits for the pause behind the response, too": (
            Transaction(master_pause, 0).duration * 1e6
        ),
        "the response takes its time as well": right - 7 * 6,
    }


@solution("ex-04-2", slaves=range(8, 31), bits=(25, 26, 28))
def cycle(slaves: int, bits: int) -> Solution:
    """Cycle time with transactions of so many bit times."""
    right = float(cycle_time(slaves, transaction=Transaction(bits - 23, 2))) * 1e3
    return Number(right, "ms"), {
        "two more requests belong to a cycle, besides those to the slaves": slaves * bits * 6e-3,
        "one request more than slaves is not enough: management, and who is new": (
            (slaves + 1) * bits * 6e-3
        ),
    }


def _efficiency(user_bits: int, master_pause: float, slave_pause: float) -> float:
    """Return which share of the line carries user data [%]."""
    return 100 * user_bits / Transaction(master_pause, slave_pause).bits


_TRIED = [(8, 2, 2), (4, 3, 2), (7, 2, 1.5), (8, 10, 2), (0, 2, 2)]


@solution("ex-04-3")
def efficiency() -> Solution:
    """Share of the line that carries user data."""
    return Function(_efficiency, _TRIED, lambda right: Number(right, "%")), {
        "the pauses use up the line, too": (
            lambda user_bits, master_pause, slave_pause: 100 * user_bits / (14 + 7)
        ),
        "the response belongs to the exchange, too": (
            lambda user_bits, master_pause, slave_pause: (
                100 * user_bits / (14 + master_pause + slave_pause)
            )
        ),
    }


def _most(limit: float, repetitions: int) -> int:
    """Return with how many slaves a change is known within so many milliseconds."""
    known = (
        Cycle(slaves).response_time(repetitions=repetitions).worst
        for slaves in range(1, ADDRESSES + 1)
    )
    return sum(bool(worst <= limit * 1e-3) for worst in known)


# With each limit one slave more fits if the last pause and the response are forgotten, and every
# mistake below gives another number.
@solution("ex-04-4", limit=(2.2, 2.5, 2.7, 3.0, 3.3, 3.8, 4.1, 4.4, 4.7, 5.0), repetitions=(3, 4))
def most_slaves(limit: float, repetitions: int) -> Solution:
    """Most slaves with which a change is known in time."""
    right = _most(limit, repetitions)
    return Whole(right, "slaves"), {
        "each repetition takes the time of one exchange": _most(limit, 0),
        "after the cycle come a pause and the response, which take their time too": (
            _most(limit + 10 * 6e-3, repetitions)
        ),
        "two requests of a cycle go to no slave": right + 2,
    }
