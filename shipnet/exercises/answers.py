"""Kinds of answers: each says what is wrong with one, as a hint that does not give it away.

A function is tried on inputs, a table is compared row by row.
"""

from __future__ import annotations

import linecache
import math
from collections.abc import Callable, Iterable, Sequence
from copy import deepcopy
from dataclasses import dataclass, field
from numbers import Integral, Real
from reprlib import Repr
from traceback import walk_tb
from types import TracebackType
from typing import Any, Protocol

import numpy as np

_SHORT = Repr()
_SHORT.maxstring = _SHORT.maxother = 60

#: Powers of ten that prefixes of units make: from pico to tera, one way or the other.
_PREFIXES = tuple(power for power in range(-24, 25, 3) if power)

#: Units of time: what bits take, so that bytes in their place make a factor of 8.
_TIMES = ("ns", "us", "ms", "s")


def factor_hint(number: float, right: float, unit: str, tolerance: float) -> str | None:
    """Return which typical mistake explains a wrong number."""
    if not (number and right):
        return None

    def near(factor: float) -> bool:
        return math.isclose(number, factor * right, rel_tol=tolerance)

    if near(-1):
        return "the sign is wrong"
    for power in _PREFIXES:
        if near(10.0**power):
            where = f"{10 ** abs(power)} times too {'large' if power > 0 else 'small'}"
            asked = f": is it in {unit}, or in another unit?" if unit else ": which unit is it in?"
            return f"the digits are right, but it is {where}{asked}"
    if unit == "%" and near(0.01):
        return "that is the share; asked for is the percentage, 100 times as much"
    if not unit and near(100):
        return "that is the percentage; asked for is the share, a hundredth of it"
    if math.isclose(number * right, 1, rel_tol=tolerance) and not math.isclose(
        abs(right), 1, rel_tol=0.05
    ):
        return "that is one over the answer: a rate where a time is asked for, or the other way?"
    for power in range(-8, 9):
        if power and near(10.0**power):
            return "the digits are right, but the point is in the wrong place"
    of_bits = unit in _TIMES or "bit" in unit or "byte" in unit
    if of_bits and (near(8) or near(1 / 8)):
        return "a factor of 8: bits or bytes?"
    if near(2):
        return "that is twice as much: is something counted twice?"
    if near(0.5):
        return "that is half of it: is something left out?"
    return None


class Answer(Protocol):
    """What an answer is compared with."""

    @property
    def value(self) -> object:
        """The right answer."""

    def fault(self, given: object) -> str | None:
        """Say what is wrong with an answer; None if it is right."""


def shown(value: object) -> str:
    """Return a value as a message shows it."""
    if isinstance(value, np.generic):
        value = value.item()
    try:
        return f"{value:.6g}" if isinstance(value, float) else _SHORT.repr(value)
    except Exception:  # a representation is the student's own code
        return f"a {type(value).__name__}"


def blank(given: object) -> bool:
    """Return whether nothing has been answered."""
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
    """A quantity."""

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
    """A count."""

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
    """A row of bits, the first in time first."""

    value: str

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
    """A row of bytes, the first on the line first."""

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
    """One of several words."""

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
    """Some of several words, in any order."""

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


class NotSolved(Exception):
    """Raised where an exercise has no answer yet."""


@dataclass(frozen=True)
class Function:
    """A function of the student's, tried on several inputs."""

    value: Callable[..., Any]
    cases: Sequence[tuple[Any, ...]]
    answer: Callable[[Any], Answer] = Number

    def fault(self, given: object) -> str | None:
        """Say what is wrong with a function; None if it is right."""
        if not callable(given):
            return f"a function is asked for, not a {type(given).__name__}"
        name = getattr(given, "__name__", "your function")
        for case in self.cases:
            call = f"{name}({', '.join(map(shown, case))})"
            try:
                # A function that changes what it is given must not spoil the comparison.
                result = given(*deepcopy(case))
            except NotImplementedError:
                raise NotSolved from None
            except Exception as error:
                return f"{call} stops{_place(given, error.__traceback__)}: {_said(error)}"
            if result is None:
                return f"{call} returned nothing: is there a `return`?"
            if result is ...:
                raise NotSolved
            if fault := self.answer(self.value(*case)).fault(result):
                return f"{call} returned {shown(result)}: {fault}"
        return None


def _said(error: Exception) -> str:
    kind = type(error).__name__
    text = str(error).partition("\n")[0]
    return f"{kind}, {text}" if text else kind


def _place(function: Callable[..., Any], trace: TracebackType | None) -> str:
    """Return the last line of the function that was being executed."""
    code = getattr(function, "__code__", None)
    lines = [
        (line, linecache.getline(code.co_filename, line).strip())
        for frame, line in walk_tb(trace)
        if code and frame.f_code is code
    ]
    if not (code and lines):
        return ""
    line, text = lines[-1]
    return f" in its line {line - code.co_firstlineno + 1}{f', `{text}`' if text else ''}"


def _not_rows(rows: object) -> str | None:
    """Return how something differs from a list of dicts, as the end of a sentence."""
    if isinstance(rows, dict):
        return "; that is a single one"
    if not isinstance(rows, Sequence) or isinstance(rows, str | bytes):
        return f", not a {type(rows).__name__}"
    for number, row in enumerate(rows, start=1):
        if not isinstance(row, dict):
            return f"; row {number} is a {type(row).__name__}"
    return None


@dataclass(frozen=True, eq=False)
class Table:
    """A table, compared row by row."""

    value: Sequence[dict[str, Any]]
    units: dict[str, str] = field(default_factory=dict)
    tolerance: float = 0.005

    def fault(self, given: object) -> str | None:
        """Say what is wrong with a table, a DataFrame or a list of dicts; None if it is right."""
        to_rows = getattr(given, "to_dict", None)
        rows: Any = to_rows("records") if to_rows and hasattr(given, "columns") else given
        columns = list(self.value[0])
        if form := _not_rows(rows):
            row = ", ".join(f"{name!r}: ..." for name in columns)
            return f"a table is asked for, a list of rows such as {{{row}}}{form}"
        if missing := [name for name in columns if any(name not in row for row in rows)]:
            return f"column {missing[0]!r} is missing; asked for are {', '.join(columns)}"
        if len(rows) != len(self.value):
            return f"{len(rows)} rows, but {len(self.value)} are asked for"
        first = columns[0]
        for number, (row, right) in enumerate(zip(rows, self.value, strict=True), start=1):
            for name in columns:
                if blank(row[name]):
                    raise NotSolved
                if fault := self._cell(name, row[name], right[name]):
                    where = f"row {number} ({first} = {shown(right[first])}), {name}"
                    return f"{where} is {shown(row[name])}: {fault}"
        return None

    def _cell(self, name: str, cell: object, right: object) -> str | None:
        if isinstance(right, float | int) and not isinstance(right, bool):
            return Number(right, self.units.get(name, ""), self.tolerance).fault(cell)
        return None if cell == right else "this is not it"
