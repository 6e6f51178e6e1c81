"""The kinds of points: their conductors, and their names in I/O lists."""

from __future__ import annotations

import csv
import re
from collections.abc import Mapping
from dataclasses import dataclass
from difflib import get_close_matches
from functools import cache
from typing import Literal, get_args

from shipnet import datasets
from shipnet.errors import ArgumentError
from shipnet.fields import check_choice, check_whole, record, whole

Kind = Literal["DI", "DO", "AI", "AO"]

#: Digital and analogue inputs and outputs, as seen by the host.
KINDS: tuple[Kind, ...] = get_args(Kind)


@dataclass(frozen=True, slots=True)
class Signal:
    """A kind of point: the number of conductors per point, and of those that a group shares."""

    meaning: str
    conductors: int
    common: int = 0
    kind: Kind = "DI"


#: The kinds of points. Their `conductors` follow from the connection, not from a cable catalogue.
SIGNALS: Mapping[str, Signal] = {
    "contact": Signal("switch or limit contact with two wires of its own", 2),
    "contact_common": Signal("contact with a common return for its group", 1, 1),
    "namur": Signal("NAMUR proximity switch with two wires", 2),
    "proximity_3wire": Signal("proximity switch with supply and output wires", 3),
    "solenoid": Signal("coil of a valve or relay with two wires of its own", 2, 0, "DO"),
    "solenoid_common": Signal("coil with a common return for its group", 1, 1, "DO"),
    "rtd_2wire": Signal("resistance thermometer, two wires", 2, 0, "AI"),
    "rtd_3wire": Signal("resistance thermometer, three wires", 3, 0, "AI"),
    "rtd_4wire": Signal("resistance thermometer, four wires", 4, 0, "AI"),
    "thermocouple": Signal("thermocouple, compensating pair", 2, 0, "AI"),
    "current_loop": Signal("4-20 mA transmitter powered by its loop", 2, 0, "AI"),
    "current_loop_3wire": Signal("4-20 mA transmitter with three wires", 3, 0, "AI"),
    "current_loop_4wire": Signal("4-20 mA transmitter with a supply of its own", 4, 0, "AI"),
    "voltage_input": Signal("voltage such as 0-10 V from a device with its own supply", 2, 0, "AI"),
    "potentiometer": Signal("potentiometer with supply and wiper wires", 3, 0, "AI"),
    "serial": Signal("value of a serial device; one pair is counted per value", 2, 0, "AI"),
    "analogue_output": Signal("4-20 mA set point to a positioner or drive", 2, 0, "AO"),
}


@cache
def spellings(of: str) -> Mapping[str, tuple[tuple[str, str], ...]]:
    """Return the words that lists use for columns, types or signals, with their meanings."""
    names = {"signal": SIGNALS, "type": KINDS}.get(of, ())
    words: dict[str, dict[str, str]] = {plain(name): {name: name} for name in names}
    with datasets.path("iolist_words.csv").open(newline="", encoding="utf-8") as stream:
        for row in csv.DictReader(stream):
            if row["of"] == of:
                words.setdefault(plain(row["word"]), {}).setdefault(row["means"], row["word"])
    return {word: tuple(means.items()) for word, means in words.items()}


def plain(text: str) -> str:
    """Return a name in lower case without blanks or punctuation, for comparing spellings."""
    return "".join(re.findall(r"[^\W_]+", text.casefold()))


#: A supply voltage, which does not change the kind of a point.
_SUPPLY = re.compile(
    r"(?<![-.~0-9])\b(?:24|48|110|115|120|220|230) ?V ?(?:[AD]C)?\b", re.IGNORECASE
)


def meanings(text: str) -> tuple[str, ...]:
    """Return the signals that a word, which may include a supply voltage, may mean."""
    table = spellings("signal")
    matches = table.get(plain(text)) or table.get(plain(_SUPPLY.sub(" ", text)), ())
    return tuple(name for name, _ in matches)


def find_signal(text: str, kind: str = "", conductors: int | None = None) -> str:
    """Return the signal that a word in a list means."""
    candidates = meanings(text)
    if len(candidates) > 1:
        if kind in KINDS:
            candidates = tuple(name for name in candidates if SIGNALS[name].kind == kind)
        if conductors is not None and len(candidates) > 1:
            candidates = tuple(
                name for name in candidates if SIGNALS[name].conductors == conductors
            )
        if len(candidates) != 1:
            either = " or ".join(candidates or meanings(text))
            raise ArgumentError(
                f"signal is {text!r}; it may be {either}: name one, or give the conductors"
            )
    if not candidates:
        words = spellings("signal")
        near = get_close_matches(plain(text), words, n=1)
        legal = (
            f"the nearest known is {words[near[0]][0][1]!r}"
            if near
            else f"known signals are {', '.join(SIGNALS)}"
        )
        raise ArgumentError(f"signal is {text!r}; {legal}")
    return candidates[0]


#: Number of conductors of an AS-i line, which carry both data and power.
ASI_PAIR = 2


def hardwired_conductors(points: Mapping[str, int]) -> int:
    """Return the number of conductors to the cabinet if each point is wired separately.

    Parameters
    ----------
    points : mapping of str to int
        Number of points by signal, a key of `SIGNALS`; 0..10**9 each.

    Returns
    -------
    int
        The conductors of all points, and one common return for each signal that has one.

    Raises
    ------
    ArgumentError
        If a signal is unknown or a number is out of range.

    Examples
    --------
    Eight contacts with two conductors each, and eight with one conductor and a common return:

    >>> hardwired_conductors({"contact": 8}), hardwired_conductors({"contact_common": 8})
    (16, 9)
    """
    conductors = 0
    for signal, number in points.items():
        check_choice("signal", signal, SIGNALS)
        count = check_whole(f"number of {signal} points", number, 0, 10**9)
        if count > 0:
            conductors += count * SIGNALS[signal].conductors + SIGNALS[signal].common
    return conductors


@record(slots=True)
class Saving:
    """Numbers of conductors if points are hardwired, and if they are on a bus.

    Examples
    --------
    >>> print(Saving(496, 2))
    496 -> 2 conductors: 0.40 % left, 99.60 % saved
    """

    hardwired: int = whole(1, 10**12, help="Conductors if each point is wired separately")
    bus: int = whole(0, 10**12, help="Conductors if the points are on a bus")

    @property
    def left(self) -> float:
        """Conductors on the bus as a fraction of the hardwired ones."""
        return self.bus / self.hardwired

    @property
    def saved(self) -> float:
        """Fraction of the hardwired conductors that the bus saves."""
        return 1 - self.left

    def __str__(self) -> str:
        return (
            f"{self.hardwired} -> {self.bus} conductors: "
            f"{self.left:.2%} left, {self.saved:.2%} saved".replace("%", " %")
        )
