"""Exercises of lesson 2: delay, echoes, and how long a cable may be."""

from __future__ import annotations

from functools import cache

from shipnet.asi.receiver import TOLERANCE
from shipnet.asi.segment import Quality
from shipnet.asi.topologies import line
from shipnet.exercises.answers import Choice, Function, Number, Whole
from shipnet.exercises.exercise import Solution, solution
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


@solution("ex-02-1", echo=tuple(echo for echo in _ECHOES if echo))
def cable_end(echo: float) -> Solution:
    """What end of the cable makes an echo."""
    end = _ECHOES[echo]
    return Choice(end, tuple(_ENDS)), {
        "think of the sign: which end adds to the voltage, which one takes it away?": (
            _MIRRORED[end]
        ),
        "from an end with the wave impedance nothing comes back": "100 ohm",
    }


@solution("ex-02-2", length=range(60, 321, 20), delay=(5.0, 5.5, 6.0, 6.5, 7.0))
def echo_time(length: int, delay: float) -> Solution:
    """When an echo comes back, for a delay in ns/m."""
    return Number(2 * length * delay * 1e-3, "us"), {
        "the delay is the time for one metre: how long for all?": 2 * length / delay,
        "is that there and back, or one way?": length * delay * 1e-3,
    }


def _echo(volts: float, resistor: float, z0: float) -> float:
    """Return the height of the wave that comes back [V]."""
    return volts * Cable.lossless(z0, 5e-9).reflection(resistor)


_WAVES = [(1.0, 300.0, 100.0), (2.0, 25.0, 100.0), (3.0, 120.0, 120.0), (5.0, 1e6, 60.0)]


@solution("ex-02-3")
def echo_height() -> Solution:
    """How high the wave is that comes back."""
    return Function(_echo, _WAVES, lambda right: Number(right, "V")), {
        "that is the voltage at the end, both waves together; only one comes back": (
            lambda volts, r, z0: volts * 2 * r / (r + z0)
        ),
        "that is the factor: the wave has its volts, too": lambda volts, r, z0: _echo(1, r, z0),
    }


#: Length from which the design goes up, and by how much [m].
_START, _STEP = 50, 10


@cache
def _quality(length: int, delay: float) -> Quality:
    cable = Cable.lossless(100, delay * 1e-9)
    return line(length, slaves=(5, length), cable=cable).quality()


def _in_tolerance(length: int, delay: float) -> bool:
    quality = _quality(length, delay)
    even = quality.evenness.min() >= TOLERANCE.evenness
    return bool(even and quality.ringing.max() <= TOLERANCE.ringing)


@solution("ex-02-4", delay=(4.5, 5.0, 5.5, 6.0, 7.0, 7.5, 8.0))
def longest_cable(delay: float) -> Solution:
    """Last length before the first one that is out of tolerance."""
    longest = readable = _START
    while _in_tolerance(longest + _STEP, delay):
        longest += _STEP
    while _quality(readable + _STEP, delay).received.min() == 1:
        readable += _STEP
    return Whole(longest, "m"), {
        "every answer is still read there, but is the ringing within its tolerance?": readable,
        "a longer cable keeps both tolerances, too: go on until one is broken": longest - _STEP,
        "that is half of it: the echo goes there and back, the cable is laid once": longest // 2,
    }
