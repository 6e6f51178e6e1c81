"""Kinds of answers: each says what is wrong with one, as a hint that does not give it away."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from numbers import Integral, Real
from reprlib import Repr
from typing import ClassVar, Protocol

import numpy as np

from shipnet.exercises.factors import factor_hint

__all__ = ["Answer", "Bits", "Bytes", "Choice", "Choices", "Number", "Whole", "blank", "shown"]

_SHORT = Repr()
_SHORT.maxstring = _SHORT.maxother = 60


class Answer(Protocol):
    """What an answer is compared with."""

    @property
    def value(self) -> object:
        """The right answer."""

    def fault(self, given: object) -> str | None:
        """Say what is wrong with an answer; None if it is right."""


def shown(value: object) -> str:
    """Return a value as a message shows it.

    Parameters
    ----------
    value : object
        Whatever a student may answer.

    Returns
    -------
    str
        Its representation, cut where it is long.

    Examples
    --------
    >>> shown(np.float64(0.5)), shown("0110")
    ('0.5', "'0110'")
    """
    if isinstance(value, np.generic):
        value = value.item()
    try:
        return f"{value:.6g}" if isinstance(value, float) else _SHORT.repr(value)
    except Exception:  # a representation is the student's own code
        return f"a {type(value).__name__}"


def blank(given: object) -> bool:
    """Return whether nothing has been answered.

    Parameters
    ----------
    given : object
        The answer.

    Returns
    -------
    bool
        True for ``...`` and None.

    Examples
    --------
    >>> blank(...), blank(0)
    (True, False)
    """
    return given is ... or given is None


def _number(given: object, unit: str) -> float | str:
    """Return a single number, or what is wrong with what was given."""
    asked = f"a number is asked for{f', in {unit}' if unit else ''}"
    if isinstance(given, bool | np.bool_) or not isinstance(given, Real):
        if isinstance(given, str):
            return f"{asked}, without quotes and without the unit behind it"
        return f"{asked}, not a {type(given).__name__}"
    if not math.isfinite(given):
        return f"{asked}; {given} is none"
    return float(given)


def _rounded(number: float, right: float) -> bool:
    """Return whether a number is another one rounded to two or three digits."""
    if not right:
        return False
    for digits in (2, 3):
        step = 10.0 ** (math.floor(math.log10(abs(right))) + 1 - digits)
        on_grid = math.isclose(number, round(number / step) * step, rel_tol=1e-9)
        # Half a step itself: some round it up, some to even.
        if on_grid and abs(number - right) <= step / 2 * (1 + 1e-9):
            return True
    return False


@dataclass(frozen=True)
class Number:
    """A quantity.

    Parameters
    ----------
    value : float
        The right number, in `unit`.
    unit : str, default ""
        Unit in which it is asked for; ``"%"`` for a share in percent.
    tolerance : float, default 0.005
        Relative tolerance [1]; of a right answer 0, the absolute one.

    Examples
    --------
    >>> Number(6.0, "us").fault(6e-6)
    'the digits are right, but it is 1000000 times too small: is it in us, or in another unit?'
    >>> Number(6.0, "us").fault(6.01) is None
    True
    """

    value: float
    unit: str = ""
    tolerance: float = 0.005

    def fault(self, given: object) -> str | None:
        """Say what is wrong with an answer; None if it is right."""
        number = _number(given, self.unit)
        if isinstance(number, str):
            return number
        scale = abs(self.value) or 1.0
        # The last bits of a product may go either way.
        if abs(number - self.value) <= self.tolerance * scale * (1 + 1e-9):
            return None
        if hint := factor_hint(number, self.value, self.unit, self.tolerance):
            return hint
        if abs(number - self.value) <= 0.05 * scale:
            if _rounded(number, self.value):
                why = "round only at the end, and keep more digits"
            else:
                why = "is something small missing, or counted twice?"
            return f"close, but not within {100 * self.tolerance:g} %: {why}"
        return f"too {'large' if number > self.value else 'small'}"


@dataclass(frozen=True)
class Whole:
    """A count.

    Parameters
    ----------
    value : int
        The right number.
    unit : str, default ""
        What is counted.

    Examples
    --------
    >>> Whole(31, "slaves").fault(32)
    'one too many'
    """

    value: int
    unit: str = ""

    def fault(self, given: object) -> str | None:
        """Say what is wrong with an answer; None if it is right."""
        number = _number(given, self.unit)
        if isinstance(number, str):
            return number
        if number == self.value:
            return None
        if abs(number - self.value) == 1:
            return f"one too {'many' if number > self.value else 'few'}"
        if hint := factor_hint(number, self.value, self.unit, 1e-9):
            return hint
        if number != round(number):
            return "a whole number is asked for: round up or down, and think which"
        return f"too {'large' if number > self.value else 'small'}"


@dataclass(frozen=True)
class Bits:
    """A row of bits, the first in time first.

    Parameters
    ----------
    value : str
        Zeros and ones.

    Examples
    --------
    >>> Bits("0011001").fault("1001100")
    'the right bits in the reverse order: which one comes first?'
    """

    value: str
    symbols: ClassVar[str] = "01"

    def fault(self, given: object) -> str | None:
        """Say what is wrong with an answer; None if it is right."""
        if isinstance(given, Integral):
            return "bits are written in quotes, '0110', so that zeros in front stay"
        if not isinstance(given, str):
            if not isinstance(given, Iterable):
                return f"bits in quotes are asked for, such as '0110', not a {type(given).__name__}"
            given = "".join(map(str, given))
        bits, right = given.replace(" ", "").replace("_", ""), self.value
        if bits == right:
            return None
        if strange := sorted(set(bits) - {"0", "1"}):
            return f"{shown(strange[0])} is no bit"
        if off := len(bits) - len(right):
            return f"these are {len(bits)} bits: {abs(off)} too {'many' if off > 0 else 'few'}"
        if bits == right[::-1]:
            return "the right bits in the reverse order: which one comes first?"
        if bits == right.translate(str.maketrans("01", "10")):
            return "every bit is the other way round: which level is a 0?"
        if right in (bits[1:] + bits[:1], bits[-1:] + bits[:-1]):
            return "the right bits, moved by one place"
        half = len(right) // 2
        if len(right) % 2 == 0 and bits == right[half:] + right[:half]:
            return "the halves are swapped: which one comes first?"
        wrong = sum(a != b for a, b in zip(bits, right, strict=True))
        return f"{wrong} of {len(right)} bits {'is' if wrong == 1 else 'are'} wrong"


@dataclass(frozen=True)
class Bytes:
    """A row of bytes, the first on the line first.

    Parameters
    ----------
    value : bytes
        The right bytes; an answer may also be hexadecimal text.

    Examples
    --------
    >>> Bytes(bytes.fromhex("0103840A")).fault("01 03 0A 84")
    'the last two bytes are swapped: which one goes first?'
    """

    value: bytes

    def fault(self, given: object) -> str | None:
        """Say what is wrong with an answer; None if it is right."""
        if isinstance(given, str):
            try:
                given = bytes.fromhex(given.replace("0x", " "))
            except ValueError:
                return f"{shown(given)} is not hexadecimal: two digits a byte, such as '01 0A'"
        if not isinstance(given, bytes | bytearray):
            return f"bytes are asked for, such as '01 0A', not a {type(given).__name__}"
        data, right = bytes(given), self.value
        if data == right:
            return None
        if off := len(data) - len(right):
            return f"these are {len(data)} bytes: {abs(off)} too {'many' if off > 0 else 'few'}"
        if data == right[::-1]:
            return "the right bytes in the reverse order: the first on the line comes first"
        if data == right[:-2] + right[:-3:-1]:
            return "the last two bytes are swapped: which one goes first?"
        if data == bytes(int(f"{byte:08b}"[::-1], 2) for byte in right):
            return "the bits of each byte are reversed"
        wrong = [k for k, byte in enumerate(right, start=1) if data[k - 1] != byte]
        which, verb = ("byte", "is") if len(wrong) == 1 else ("bytes", "are")
        return f"{which} {', '.join(map(str, wrong))} of {len(right)} {verb} wrong"


@dataclass(frozen=True)
class Choice:
    """One of several words.

    Parameters
    ----------
    value : str
        The right one.
    options : tuple of str
        All there are.

    Examples
    --------
    >>> Choice("near", ("near", "far")).fault("middle")
    "'middle' is none of near, far"
    """

    value: str
    options: tuple[str, ...]

    def fault(self, given: object) -> str | None:
        """Say what is wrong with an answer; None if it is right."""
        known = {option.casefold(): option for option in self.options}
        chosen = known.get(given.strip().casefold()) if isinstance(given, str) else None
        if chosen is None:
            return f"{shown(given)} is none of {', '.join(self.options)}"
        return None if chosen == self.value else f"it is not {chosen}: try to say why you chose it"


@dataclass(frozen=True)
class Choices:
    """Some of several words, in any order.

    Parameters
    ----------
    value : frozenset of str
        The right ones.
    options : tuple of str
        All there are.

    Examples
    --------
    >>> Choices(frozenset({"a", "b"}), ("a", "b", "c")).fault(["a", "c"])
    '1 of yours does not belong, 1 is missing'
    """

    value: frozenset[str]
    options: tuple[str, ...]

    def fault(self, given: object) -> str | None:
        """Say what is wrong with an answer; None if it is right."""
        if isinstance(given, str):
            given = given.replace(",", " ").split()
        if not isinstance(given, Iterable):
            return f"a list is asked for, some of {', '.join(self.options)}"
        chosen = set(map(str, given))
        if strange := sorted(chosen - set(self.options)):
            return f"{shown(strange[0])} is none of {', '.join(self.options)}"
        extra, missing = len(chosen - self.value), len(self.value - chosen)
        parts = []
        if extra:
            parts.append(f"{extra} of yours {'does' if extra == 1 else 'do'} not belong")
        if missing:
            parts.append(f"{missing} {'is' if missing == 1 else 'are'} missing")
        return ", ".join(parts) or None
