"""The kinds of points: what is connected, with how many conductors, and what lists call it."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from difflib import get_close_matches
from typing import Literal, get_args

from shipnet.errors import ArgumentError
from shipnet.fields import check_whole, record, whole

Kind = Literal["DI", "DO", "AI", "AO"]

#: Digital and analogue, inputs and outputs, as the host sees them.
KINDS: tuple[Kind, ...] = get_args(Kind)


@dataclass(frozen=True, slots=True)
class Signal:
    """A kind of point and the conductors that it needs when it is wired on its own."""

    meaning: str
    conductors: int
    common: int = 0
    kind: Kind = "DI"
    synonyms: tuple[str, ...] = ()


#: The kinds of points; `conductors` follow from the connection, not from a cable catalogue.
SIGNALS: Mapping[str, Signal] = {
    "contact": Signal(
        "switch or limit contact, both wires its own", 2, 0, "DI",
        ("DI", "digital input", "switch", "dry contact", "potential-free contact", "volt-free",
         "limit switch", "float switch", "level switch", "pressure switch", "temperature switch",
         "flow switch", "proximity switch", "proximity switch 2-wire", "2-wire proximity switch",
         "inductive sensor", "inductive sensor 2-wire", "NO contact", "NC contact",
         "DI NO contact", "DI NC contact", "contact NO", "contact NC", "push button",
         "DI 24 V", "status contact"),
    ),
    "contact_common": Signal(
        "contact with a common return for its group", 1, 1, "DI",
        ("contact with common return", "DI common", "contact 1-wire"),
    ),
    "proximity_3wire": Signal(
        "proximity switch with its supply and its output", 3, 0, "DI",
        ("proximity switch", "proximity switch 3-wire", "3-wire proximity switch", "prox 3-wire",
         "PNP", "NPN", "DI PNP", "DI NPN", "3-wire sensor", "inductive sensor", "inductive switch",
         "inductive sensor 3-wire", "capacitive sensor", "DI 3-wire"),
    ),
    "solenoid": Signal(
        "coil of a valve or relay, both wires its own", 2, 0, "DO",
        ("DO", "digital output", "solenoid valve", "coil", "relay", "relay output", "lamp",
         "24 V solenoid/relay", "24 V solenoid", "24 V relay", "24 V coil", "DO 24 V", "command"),
    ),
    "solenoid_common": Signal(
        "coil with a common return for its group", 1, 1, "DO",
        ("solenoid with common return", "coil with common return", "DO common", "coil 1-wire"),
    ),
    "rtd_2wire": Signal(
        "resistance thermometer, two wires", 2, 0, "AI",
        ("RTD 2-wire", "Pt100 2-wire", "RTD Pt100 2-wire", "RTD", "Pt100", "RTD Pt100"),
    ),
    "rtd_3wire": Signal(
        "resistance thermometer, three wires", 3, 0, "AI",
        ("RTD 3-wire", "Pt100 3-wire", "RTD Pt100 3-wire", "RTD", "Pt100", "RTD Pt100"),
    ),
    "rtd_4wire": Signal(
        "resistance thermometer, four wires", 4, 0, "AI",
        ("RTD 4-wire", "Pt100 4-wire", "RTD Pt100 4-wire", "RTD", "Pt100", "RTD Pt100"),
    ),
    "thermocouple": Signal(
        "thermocouple, compensating pair", 2, 0, "AI",
        ("TC", "T/C", "thermocouple type K", "TC type K", "type K", "NiCr-Ni"),
    ),
    "current_loop": Signal(
        "4-20 mA transmitter fed by its loop", 2, 0, "AI",
        ("AI 4-20 mA", "4-20 mA", "4..20 mA", "4 to 20 mA", "4-20 mA 2-wire", "AI 4-20 mA 2-wire",
         "4-20 mA input", "transmitter", "2-wire transmitter", "current loop 2-wire"),
    ),
    "current_loop_4wire": Signal(
        "4-20 mA transmitter with a supply of its own", 4, 0, "AI",
        ("4-20 mA 4-wire", "AI 4-20 mA 4-wire", "4-wire transmitter"),
    ),
    "potentiometer": Signal(
        "potentiometer with its supply and its wiper", 3, 0, "AI",
        ("pot", "potentiometer 3-wire", "potentiometer 3-wire / 4-20 mA", "position potentiometer"),
    ),
    "analogue_output": Signal(
        "4-20 mA set point to a positioner or drive", 2, 0, "AO",
        ("AO", "analog output", "AO 4-20 mA", "4-20 mA", "4..20 mA", "4 to 20 mA",
         "4-20 mA output", "positioner", "set point"),
    ),
}  # fmt: skip


def plain(text: str) -> str:
    """Return a name without case, blanks and punctuation, so that spellings compare equal."""
    return "".join(re.findall(r"[^\W_]+", text.casefold()))


def _named() -> tuple[dict[str, tuple[str, ...]], dict[str, str]]:
    """Return the signals that a plain word may mean, and the word as it is written."""
    named: dict[str, tuple[str, ...]] = {}
    written: dict[str, str] = {}
    for name, signal in SIGNALS.items():
        for word, text in {plain(text): text for text in (*signal.synonyms, name)}.items():
            named[word] = (*named.get(word, ()), name)
            written.setdefault(word, text)
    return named, written


_NAMED, _WRITTEN = _named()


def meanings(text: str) -> tuple[str, ...]:
    """Return the signals that a word may mean."""
    return _NAMED.get(plain(text), ())


def find_signal(text: str, kind: str = "", conductors: int | None = None) -> str:
    """Return the signal that a list means."""
    word = plain(text)
    found = meanings(text)
    if len(found) > 1:
        if kind in KINDS:
            found = tuple(name for name in found if SIGNALS[name].kind == kind)
        if conductors is not None and len(found) > 1:
            found = tuple(name for name in found if SIGNALS[name].conductors == conductors)
        if len(found) != 1:
            either = " or ".join(found or meanings(text))
            raise ArgumentError(
                f"signal is {text!r}; it may be {either}: name one, or give the conductors"
            )
    if not found:
        near = get_close_matches(word, _NAMED, n=1)
        legal = (
            f"the nearest known is {_WRITTEN[near[0]]!r}"
            if near
            else f"known are {', '.join(SIGNALS)}"
        )
        raise ArgumentError(f"signal is {text!r}; {legal}")
    return found[0]


#: Conductors of an AS-i line, which carry data and supply at once.
ASI_PAIR = 2


def hardwired_conductors(points: Mapping[str, int], *, groups: int = 1) -> int:
    """Count the conductors when every point has its own wires to the control panel."""
    groups = check_whole("groups", groups, 1, 10**9)
    total = 0
    for kind, number in points.items():
        if kind not in SIGNALS:
            raise ArgumentError(
                f"kind of point is {kind!r}; it must be one of {', '.join(SIGNALS)}"
            )
        number = check_whole(f"number of {kind}", number, 0, 10**9)
        signal = SIGNALS[kind]
        total += number * signal.conductors + signal.common * min(groups, number)
    return total


@record(slots=True)
class Saving:
    """The conductors of the same points, hardwired and on a bus.

    Examples
    --------
    >>> print(Saving(496, 2))
    496 -> 2 conductors: 0.40 % left, 99.60 % saved
    """

    hardwired: int = whole(1, 10**12, help="Conductors where each point is wired on its own")
    bus: int = whole(0, 10**12, help="Conductors of the bus in their place")

    @property
    def left(self) -> float:
        """Conductors on the bus per conductor hardwired."""
        return self.bus / self.hardwired

    @property
    def saved(self) -> float:
        """Part of the hardwired conductors that is no longer needed."""
        return 1 - self.left

    def __str__(self) -> str:
        """Say both, in percent."""
        return (
            f"{self.hardwired} -> {self.bus} conductors: "
            f"{self.left:.2%} left, {self.saved:.2%} saved".replace("%", " %")
        )
