"""Exercises of lesson 2: delays, echoes and the longest cable."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from itertools import permutations

from shipnet.asi.receiver import TOLERANCE
from shipnet.asi.segment import Quality
from shipnet.asi.topologies import line
from shipnet.exercises.answers import Function, Number, Whole, Words
from shipnet.exercises.exercise import ANY, Solution, solution
from shipnet.line.cable import CABLES, Cable

#: Possible ends of a cable of 100 ohm: name -> resistor [ohm].
_ENDS = {
    "open end": None,
    "above 100 ohm": 300.0,
    "100 ohm": 100.0,
    "below 100 ohm": 42.8571,
    "short circuit": 1e-9,
}
# Adding 0 turns -0 into 0.
_ECHOES = {
    round(CABLES["as-i 1.5"].reflection(resistor), 3) + 0: end for end, resistor in _ENDS.items()
}


# Four of the five ends: the fewest for which no mistake below gives the right answer.
@solution("ex-02-1", "ends", echoes=tuple(permutations(_ECHOES, 4)))
def cable_ends(echoes: tuple[float, ...]) -> Solution:
    """Ends of the cables that return the given echoes."""
    right = tuple(_ECHOES[echo] for echo in echoes)

    def taken(*ends: str) -> tuple[str, ...]:
        """Return `right` after replacing the first of each pair in `ends` with the second."""
        other = dict(zip(ends[::2], ends[1::2], strict=True))
        return tuple(other.get(end, end) for end in right)

    opened, above, matched, below, shorted = _ENDS
    return Words(right, tuple(_ENDS)), {
        "which ends raise the voltage, and which lower it?": (
            taken(opened, shorted, shorted, opened, above, below, below, above)
        ),
        "write the ends in the order of your echoes": right[::-1],
        "what returns from an end with the characteristic impedance, and what from an open end?": (
            taken(matched, opened, opened, matched)
        ),
        "two kinds of end return the whole pulse: which of them inverts it?": (
            taken(opened, shorted, shorted, opened)
        ),
        "the signs are right; what does the height mean?": taken(opened, above, shorted, below),
        "is each echo as high as the pulse?": taken(above, opened, below, shorted),
        "For each echo: is it positive, zero or negative, and is it as high as the pulse?": ANY,
    }


@solution(
    "ex-02-2",
    "echo_us",
    length=range(60, 321, 20),
    delay=(5.0, 5.5, 6.0, 7.0, 7.5),
    place=(5, 10, 15),
)
def echo_time(length: int, delay: float, place: int) -> Solution:
    """Time at 0 m between a valve's signal and its echo from the end, for a delay in ns/m."""
    beyond, per_metre = length - place, delay * 1e-3
    right = 2 * beyond * per_metre
    return Number(right, "us"), {
        "the delay is the time per metre; how long does the whole path take?": 2 * beyond / delay,
        "is that the time from the valve to the end, or there and back?": right / 2,
        "you doubled the path once too often": 2 * right,
        "that is from 0 m to the end and back; where is the valve?": 2 * length * per_metre,
        "that is when the echo arrives; when does the signal arrive?": (2 * length - place)
        * per_metre,
        "you used the delay of the lesson's cable; yours has its own": 2 * beyond * 6.5e-3,
        "Draw the paths of signal and echo: how many metres longer is the echo's path?": ANY,
    }


def _echo(volts: float, resistor: float, z0: float) -> float:
    """Return the height of the echo [V]."""
    return volts * Cable.lossless(z0, 5e-9).reflection(resistor)


_WAVES = [
    *((1.0, 300.0, 100.0), (2.0, 25.0, 100.0), (3.0, 120.0, 120.0), (5.0, 1e6, 60.0)),
    (4.0, 60.0, 120.0),
]

_Wave = Callable[[float, float, float], float]


@solution("ex-02-3", "echo_of")
def echo_height() -> Solution:
    """Height of the echo."""
    mistakes: dict[str, _Wave] = {
        "that is the voltage at the end, the sum of both waves; only one of them returns": (
            lambda volts, r, z0: volts * 2 * r / (r + z0)
        ),
        "that is only the factor; how high is the pulse?": lambda volts, r, z0: _echo(1, r, z0),
        "a resistor above the characteristic impedance gives an echo of the same sign": (
            lambda volts, r, z0: -_echo(volts, r, z0)
        ),
        "a resistor below the characteristic impedance gives an echo of the opposite sign": (
            lambda volts, r, z0: abs(_echo(volts, r, z0))
        ),
        "that is a voltage divider; the reflection factor is a difference divided by a sum": (
            lambda volts, r, z0: volts * r / (r + z0)
        ),
        "the difference is divided by the sum, not by the characteristic impedance": (
            lambda volts, r, z0: volts * (r - z0) / z0
        ),
    }
    return Function(_echo, _WAVES, lambda right: Number(right, "V")), {
        **mistakes,
        "Compute by hand, with 1 V and 100 ohm: what returns from 300 ohm, and from 25 ohm?": ANY,
    }


#: First length in the design exercise, and step [m].
_START, _STEP = 50, 10


@cache
def _quality(length: int, delay: float) -> Quality:
    cable = Cable.lossless(100, delay * 1e-9)
    return line(length, slaves=(5, length), cable=cable).quality()


def _in_tolerance(length: int, delay: float) -> bool:
    quality = _quality(length, delay)
    even = quality.evenness.min() >= TOLERANCE.evenness
    return bool(even and quality.ringing.max() <= TOLERANCE.ringing)


def _read(length: int, delay: float) -> bool:
    return bool(_quality(length, delay).received.min() == 1)


def _last(good: Callable[[int, float], bool], delay: float) -> int:
    """Return the last length [m], going up from `_START`, before `good` is first false."""
    length = _START
    while good(length + _STEP, delay):
        length += _STEP
    return length


@solution("ex-02-4", "longest", delay=tuple(k / 10 for k in range(45, 85, 2)))
def longest_cable(delay: float) -> Solution:
    """Last length before a tolerance is first violated."""
    longest = _last(_in_tolerance, delay)
    return Whole(longest, "m"), {
        "at this length every response is received, but is the ringing within tolerance?": (
            _last(_read, delay)
        ),
        "both tolerances are also met at the next length: continue": longest - _STEP,
        "at this length a tolerance is already violated": longest + _STEP,
        "that is the way there and back; how long is the cable itself?": 2 * longest,
        "Print evenness and ringing for each length: where is a tolerance first violated?": ANY,
    }
