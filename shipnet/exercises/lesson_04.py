"""Exercises of lesson 4: polling, cycle, efficiency."""

from __future__ import annotations

from shipnet.asi.timing import ADDRESSES, Cycle, Transaction, cycle_time
from shipnet.exercises.answers import Function, Number, Whole
from shipnet.exercises.exercise import Exercise


def _transaction(master_pause: float, slave_pause: float) -> float:
    """Return the time from a request to the next [us]."""
    return Transaction(master_pause, slave_pause).duration * 1e6


def _cycle(slaves: int, bits: int) -> float:
    """Return the cycle with transactions of so many bit times [ms]."""
    return float(cycle_time(slaves, transaction=Transaction(bits - 23, 2))) * 1e3


def _efficiency(user_bits: int, master_pause: float, slave_pause: float) -> float:
    """Return which share of the line carries user data [%]."""
    return 100 * user_bits / Transaction(master_pause, slave_pause).bits


def _most(limit: float, repetitions: int) -> int:
    """Return with how many slaves a change is known within so many milliseconds."""
    known = (
        Cycle(slaves).response_time(repetitions=repetitions).worst
        for slaves in range(1, ADDRESSES + 1)
    )
    return sum(bool(worst <= limit * 1e-3) for worst in known)


EXERCISES = (
    Exercise(
        "ex-04-1",
        draws={"master_pause": (2, 2.5, 4, 5, 6), "slave_pause": (1.5, 2, 2.5)},
        answer=lambda master_pause, slave_pause: Number(
            _transaction(master_pause, slave_pause), "us"
        ),
        traps={
            "the next request waits for the pause behind the response, too": (
                lambda master_pause, slave_pause: _transaction(master_pause, 0)
            ),
            "the response takes its time as well": lambda master_pause, slave_pause: (
                _transaction(master_pause, slave_pause) - 7 * 6
            ),
        },
    ),
    Exercise(
        "ex-04-2",
        draws={"slaves": range(8, 31), "bits": (25, 26, 28)},
        answer=lambda slaves, bits: Number(_cycle(slaves, bits), "ms"),
        traps={
            "two more requests belong to a cycle, besides those to the slaves": (
                lambda slaves, bits: slaves * bits * 6e-3
            ),
            "one request more than slaves is not enough: management, and who is new": (
                lambda slaves, bits: (slaves + 1) * bits * 6e-3
            ),
        },
    ),
    Exercise(
        "ex-04-3",
        answer=lambda: Function(
            _efficiency,
            [(8, 2, 2), (4, 3, 2), (7, 2, 1.5), (8, 10, 2), (0, 2, 2)],
            lambda right: Number(right, "%"),
        ),
        traps={
            "the pauses use up the line, too": (
                lambda: lambda user_bits, master_pause, slave_pause: 100 * user_bits / (14 + 7)
            ),
            "the response belongs to the exchange, too": (
                lambda: (
                    lambda user_bits, master_pause, slave_pause: (
                        100 * user_bits / (14 + master_pause + slave_pause)
                    )
                )
            ),
        },
    ),
    Exercise(
        "ex-04-4",
        # With each limit one slave more fits if the last pause and the response are forgotten,
        # and every mistake below gives another number.
        draws={"limit": (2.2, 2.5, 2.7, 3.0, 3.3, 3.8, 4.1, 4.4, 4.7, 5.0), "repetitions": (3, 4)},
        answer=lambda limit, repetitions: Whole(_most(limit, repetitions), "slaves"),
        traps={
            "each repetition takes the time of one exchange": lambda limit, repetitions: _most(
                limit, 0
            ),
            "after the cycle come a pause and the response, which take their time too": (
                lambda limit, repetitions: _most(limit + 10 * 6e-3, repetitions)
            ),
            "two requests of a cycle go to no slave": lambda limit, repetitions: (
                _most(limit, repetitions) + 2
            ),
        },
    ),
)
