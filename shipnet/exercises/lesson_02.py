"""Exercises of lesson 2: delay, echoes, and how long a cable may be."""

from __future__ import annotations

from functools import cache

from shipnet.asi.receiver import TOLERANCE
from shipnet.asi.segment import Quality
from shipnet.asi.topologies import line
from shipnet.exercises.answers import Choice, Function, Number, Whole
from shipnet.exercises.exercise import Exercise
from shipnet.line.cable import CABLES, Cable

#: What may be at the end of a cable of 100 ohm: name -> resistor [ohm].
_ENDS = {
    "open end": None,
    "above 100 ohm": 300.0,
    "100 ohm": 100.0,
    "below 100 ohm": 42.8571,
    "short circuit": 1e-9,
}
_ECHOES = {
    round(CABLES["as-i 1.5"].reflection(resistor), 3): end for end, resistor in _ENDS.items()
}
_MIRRORED = dict(zip(_ENDS, reversed(_ENDS), strict=True))

#: Length from which the design goes up, and by how much [m].
_START, _STEP = 50, 10


def _echo(volts: float, resistor: float, z0: float) -> float:
    """Return the height of the wave that comes back [V]."""
    return volts * Cable.lossless(z0, 5e-9).reflection(resistor)


@cache
def _quality(length: int, delay: float) -> Quality:
    cable = Cable.lossless(100, delay * 1e-9)
    return line(length, slaves=(5, length), cable=cable).quality()


def _in_tolerance(length: int, delay: float) -> bool:
    quality = _quality(length, delay)
    even = quality.evenness.min() >= TOLERANCE.evenness
    return bool(even and quality.ringing.max() <= TOLERANCE.ringing)


def _longest(delay: float) -> int:
    """Return the last length before the first one that is out of tolerance [m]."""
    length = _START
    while _in_tolerance(length + _STEP, delay):
        length += _STEP
    return length


def _longest_read(delay: float) -> int:
    length = _START
    while _quality(length + _STEP, delay).received.min() == 1:
        length += _STEP
    return length


EXERCISES = (
    Exercise(
        "ex-02-1",
        draws={"echo": tuple(echo for echo in _ECHOES if echo)},
        answer=lambda echo: Choice(_ECHOES[echo], tuple(_ENDS)),
        traps={
            "think of the sign: which end adds to the voltage, which one takes it away?": (
                lambda echo: _MIRRORED[_ECHOES[echo]]
            ),
            "from an end with the wave impedance nothing comes back": lambda echo: "100 ohm",
        },
    ),
    Exercise(
        "ex-02-2",
        draws={"length": range(60, 321, 20), "delay": (5.0, 5.5, 6.0, 6.5, 7.0)},
        answer=lambda length, delay: Number(2 * length * delay * 1e-3, "us"),
        traps={
            "the delay is the time for one metre: how long for all?": lambda length, delay: (
                2 * length / delay
            ),
            "is that there and back, or one way?": lambda length, delay: length * delay * 1e-3,
        },
    ),
    Exercise(
        "ex-02-3",
        answer=lambda: Function(
            _echo,
            [(1.0, 300.0, 100.0), (2.0, 25.0, 100.0), (3.0, 120.0, 120.0), (5.0, 1e6, 60.0)],
            lambda right: Number(right, "V"),
        ),
        traps={
            "that is the voltage at the end, both waves together; only one comes back": (
                lambda: lambda volts, r, z0: volts * 2 * r / (r + z0)
            ),
            "that is the factor: the wave has its volts, too": (
                lambda: lambda volts, r, z0: _echo(1, r, z0)
            ),
        },
    ),
    Exercise(
        "ex-02-4",
        draws={"delay": (4.5, 5.0, 5.5, 6.0, 7.0, 7.5, 8.0)},
        answer=lambda delay: Whole(_longest(delay), "m"),
        traps={
            "every answer is still read there, but is the ringing within its tolerance?": (
                _longest_read
            ),
            "a longer cable keeps both tolerances, too: go on until one is broken": lambda delay: (
                _longest(delay) - _STEP
            ),
            "that is half of it: the echo goes there and back, the cable is laid once": (
                lambda delay: _longest(delay) // 2
            ),
        },
    ),
)
