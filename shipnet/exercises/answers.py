"""Types of answers; each reads a student's answer and reports how it differs from the right one.

A report states a fact about the answer and does not guess the cause. It must not help a student to
find the right answer by trial and error.
"""

from __future__ import annotations

import ctypes
import linecache
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass, field
from numbers import Integral, Real
from reprlib import Repr
from threading import Thread
from traceback import format_exception_only, walk_tb
from types import TracebackType
from typing import Any, TypeAlias, TypeVar

import numpy as np

T = TypeVar("T")

#: The right answer to an exercise, its `value`. `read` returns a student's answer in a standard
#: form or raises Misread; `fault` returns what is wrong with that, or None if it is right.
Answer: TypeAlias = "Number | Bits | Bytes | Words | Function | Table"

#: Time limit for a student's function, for all its inputs together [s].
LIMIT = 10.0

_SHORT = Repr()
_SHORT.maxstring = _SHORT.maxother = 60

#: Report used if nothing more specific can be said about an answer.
NOT_YET = "not right yet"

#: End of the report on a number that may be the right one, rounded.
ROUNDED = "if you rounded, keep more digits"


class NotSolved(Exception):
    """An exercise has no answer yet."""


class Misread(Exception):
    """An answer has the wrong type or form; the message says why."""


def shown(value: object) -> str:
    """Return a value as text for a message."""
    if isinstance(value, np.generic):
        value = value.item()
    try:
        return f"{value:.6g}" if isinstance(value, float) else _SHORT.repr(value)
    except Exception:  # repr() may be the student's own code
        return type(value).__name__


def blank(raw: object) -> bool:
    """Return whether the answer is missing."""
    return raw is ... or raw is None


def _other(form: str, raw: object) -> Misread:
    return Misread(f"{form}; yours is of type {type(raw).__name__}")


def _number(raw: object, unit: str) -> float:
    """Return an answer as a number; an array must have one element."""
    form = f"a number is expected{f', in {unit}' if unit else ''}"
    if isinstance(raw, np.ndarray) and raw.size == 1:
        raw = raw.item()
    if isinstance(raw, str):
        raise Misread(f"{form}, without quotes and without a unit")
    if isinstance(raw, bool | np.bool_) or not isinstance(raw, Real):
        raise _other(form, raw)
    if not math.isfinite(raw):
        raise Misread(f"{form}; {raw} is not one")
    return float(raw)


def _prefix(number: float, right: float, unit: str, tolerance: float) -> str | None:
    """Return a report if only the sign or the scale (percent, SI prefix) is wrong, else None."""
    scales: dict[float, str | None] = {
        -1.0: "the sign is wrong",
        0.01: "that is a fraction; what is the percentage?" if unit == "%" else None,
        100.0: None if unit else "that is the percentage; what is the fraction, from 0 to 1?",
    }
    for power in range(-24, 25, 3):
        where = f"{10 ** abs(power)} times too {'large' if power > 0 else 'small'}"
        report = f"the digits are right, but the number is {where}: which unit is it in?"
        scales[10.0**power] = report if power else None
    near = (scale for scale in scales if math.isclose(number, scale * right, rel_tol=tolerance))
    return next((scales[scale] for scale in near if scales[scale]), None)


def _rounded(number: float, right: float) -> bool:
    """Return whether a number is the right one rounded to two or three significant digits."""
    for digits in (2, 3):
        step = 10.0 ** (math.floor(math.log10(abs(right))) + 1 - digits)
        on_grid = math.isclose(number, round(number / step) * step, rel_tol=1e-9)
        # Some programs round halves up, others to the nearest even digit.
        if on_grid and abs(number - right) <= step / 2 * (1 + 1e-9):
            return True
    return False


@dataclass(frozen=True)
class Number:
    """A quantity with a unit and a relative tolerance."""

    value: float
    unit: str = ""
    tolerance: float = 0.005

    def read(self, raw: object) -> float:
        """Return an answer as a number."""
        return _number(raw, self.unit)

    def fault(self, answer: float) -> str | None:
        """Return what is wrong with a number, or None if it is right."""
        scale = abs(self.value) or 1.0
        # The last bits of a floating-point product may differ.
        if abs(answer - self.value) <= self.tolerance * scale * (1 + 1e-9):
            return None
        if not self.value:
            return NOT_YET
        if answer and (report := _prefix(answer, self.value, self.unit, self.tolerance)):
            return report
        if _rounded(answer, self.value):
            return f"not within {100 * self.tolerance:g} %: {ROUNDED}"
        if min(answer, self.value) >= 0 and not 1 / 3 <= answer / self.value <= 3:
            return f"far too {'large' if answer > self.value else 'small'}"
        return NOT_YET


@dataclass(frozen=True)
class Whole(Number):
    """A count."""

    def fault(self, answer: float) -> str | None:
        """Return what is wrong with a count, or None if it is right."""
        if math.isclose(answer, self.value, rel_tol=1e-9):
            return None
        return NOT_YET if answer == round(answer) else f"{NOT_YET}: a whole number is expected"


@dataclass(frozen=True)
class Bits:
    """A sequence of bits in the order in which they are sent."""

    value: str

    def read(self, raw: object) -> str:
        """Return an answer as text without separators."""
        if isinstance(raw, Integral):
            raise Misread("write bits in quotes, such as '0110', to keep leading zeros")
        if not isinstance(raw, Iterable):
            raise _other("bits in quotes are expected, such as '0110'", raw)
        bits = "".join(map(str, raw)).replace(" ", "").replace("_", "")
        if strange := sorted(set(bits) - {"0", "1"}):
            raise Misread(f"{shown(strange[0])} is not a bit")
        return bits

    def fault(self, answer: str) -> str | None:
        """Return what is wrong with the bits, or None if they are right."""
        if answer == self.value:
            return None
        what = "this bit is" if len(answer) == 1 else f"these {len(answer)} bits are"
        return f"{what} {NOT_YET}"


@dataclass(frozen=True)
class Bytes:
    """A sequence of bytes in the order in which they are sent."""

    value: bytes

    def read(self, raw: object) -> bytes:
        """Return an answer as bytes."""
        if isinstance(raw, str):
            try:
                return bytes.fromhex(raw.replace("0x", " ").replace(",", " "))
            except ValueError:
                form = "write two digits per byte, such as '01 0A'"
                raise Misread(f"{shown(raw)} is not hexadecimal: {form}") from None
        if isinstance(raw, Sequence) and all(type(byte) is int for byte in raw):
            try:
                return bytes(raw)
            except ValueError:
                raise Misread("a byte is a number from 0 to 255") from None
        raise _other("bytes are expected, such as '01 0A'", raw)

    def fault(self, answer: bytes) -> str | None:
        """Return what is wrong with the bytes, or None if they are right."""
        if answer == self.value:
            return None
        if len(answer) != len(self.value):
            return f"{len(self.value)} bytes are expected, got {len(answer)}"
        wrong = [k for k, byte in enumerate(self.value, start=1) if answer[k - 1] != byte]
        which, verb = ("byte", "is") if len(wrong) == 1 else ("bytes", "are")
        return f"{which} {', '.join(map(str, wrong))} {verb} {NOT_YET}"


@dataclass(frozen=True)
class Words:
    """Words from a list: one, several in order (a tuple), or several in any order (a set)."""

    value: str | tuple[str, ...] | frozenset[str]
    options: tuple[str, ...]

    def read(self, raw: object) -> object:
        """Return an answer with its words spelt as in the list; case is ignored."""
        if isinstance(self.value, str):
            return self._word(raw)
        if isinstance(raw, str):
            raw = raw.split(",")
        if not isinstance(raw, Iterable):
            raise Misread(f"a list of words is expected; choose from {', '.join(self.options)}")
        return type(self.value)(map(self._word, raw))

    def _word(self, raw: object) -> str:
        by_case = {option.casefold(): option for option in self.options}
        word = by_case.get(raw.strip().casefold()) if isinstance(raw, str) else None
        if word is None:
            raise Misread(f"{shown(raw)} is not one of {', '.join(self.options)}")
        return word

    def fault(self, answer: object) -> str | None:
        """Return `NOT_YET` if the words are wrong, or None if they are right."""
        return None if answer == self.value else NOT_YET


@dataclass(frozen=True)
class Function:
    """A student's function, tested on several inputs."""

    value: Callable[..., Any]
    cases: Sequence[tuple[Any, ...]]
    answer: Callable[[Any], Answer] = Number

    def read(self, raw: object) -> tuple[str, list[Any]]:
        """Return the name of a function and its results for the inputs."""
        if not callable(raw):
            raise _other("a function is expected", raw)
        name = getattr(raw, "__name__", "your function")
        return name, _limited(name, lambda: [self._tried(raw, name, case) for case in self.cases])

    def _tried(self, function: Callable[..., Any], name: str, case: tuple[Any, ...]) -> Any:
        """Return the result of a function for one input."""
        try:
            # A function that changes its input must not affect the comparison.
            result = function(*deepcopy(case))
        except NotImplementedError:
            raise NotSolved from None
        except Exception as error:
            where = _place(function, error.__traceback__)
            message = format_exception_only(error)[-1].partition("\n")[0]
            raise Misread(f"{_call(name, case)} stops{where}: {message}") from None
        if result is None:
            raise Misread(f"{_call(name, case)} returned None: which `return` gives it a value?")
        if result is ...:
            raise NotSolved
        try:
            return self.answer(self.value(*case)).read(result)
        except Misread as kind:
            raise Misread(f"{_call(name, case)} returned {shown(result)}: {kind}") from None

    def fault(self, answer: tuple[str, list[Any]]) -> str | None:
        """Return a report on the first wrong result, or None if all are right."""
        name, results = answer
        for case, result in zip(self.cases, results, strict=True):
            if fact := self.answer(self.value(*case)).fault(result):
                return f"{_call(name, case)} returned {shown(result)}: {fact}"
        return None


def _limited(name: str, work: Callable[[], T]) -> T:
    """Return the result of `work`; raise Misread if `work` does not end within `LIMIT`."""
    done: list[T] = []
    failed: list[BaseException] = []

    def run() -> None:
        try:
            done.append(work())
        except BaseException as error:
            failed.append(error)

    # Unlike an alarm signal, a thread works on every system and can be started from any thread.
    thread = Thread(target=run, name=name, daemon=True)
    thread.start()
    thread.join(LIMIT)
    if thread.is_alive():
        # End the student's loop, which would otherwise use a core until the kernel stops.
        ident = ctypes.c_ulong(thread.ident or 0)
        ctypes.pythonapi.PyThreadState_SetAsyncExc(ident, ctypes.py_object(SystemExit))
        raise Misread(f"{name} did not end within {LIMIT:g} s: does every loop in it end?")
    if failed:
        raise failed[0]
    return done[0]


def _call(name: str, case: tuple[Any, ...]) -> str:
    return f"{name}({', '.join(map(shown, case))})"


def _place(function: Callable[..., Any], trace: TracebackType | None) -> str:
    """Return a phrase that names the last executed line of the function."""
    code = getattr(function, "__code__", None)
    lines = [
        (line, linecache.getline(code.co_filename, line).strip())
        for frame, line in walk_tb(trace)
        if code and frame.f_code is code
    ]
    if not (code and lines):
        return ""
    line, text = lines[-1]
    return f" on line {line - code.co_firstlineno + 1}{f', `{text}`' if text else ''}"


@dataclass(frozen=True, eq=False)
class Table:
    """A table of numbers with rows in any order; the first column identifies a row."""

    value: Sequence[Mapping[str, float]]
    units: dict[str, str] = field(default_factory=dict)

    def read(self, raw: object) -> list[dict[str, float]]:
        """Return the rows of a DataFrame or list of dicts as numbers, sorted by first column."""
        to_rows = getattr(raw, "to_dict", None)
        rows: Any = to_rows("records") if to_rows and hasattr(raw, "columns") else raw
        columns, form = list(self.value[0]), ""
        if isinstance(rows, dict):
            form = "that is a single row"
        elif not isinstance(rows, Sequence) or isinstance(rows, str | bytes):
            form = f"yours is of type {type(rows).__name__}"
        else:
            for number, row in enumerate(rows, start=1):
                if not isinstance(row, dict):
                    form = form or f"row {number} is of type {type(row).__name__}"
        if form:
            row = ", ".join(f"{name!r}: ..." for name in columns)
            raise Misread(f"a table is expected, a list of rows such as {{{row}}}; {form}")
        if missing := [name for name in columns if any(name not in row for row in rows)]:
            raise Misread(f"column {missing[0]!r} is missing; expected: {', '.join(columns)}")
        if len(rows) != len(self.value):
            raise Misread(f"expected number of rows: {len(self.value)}, got {len(rows)}")
        if any(blank(row[name]) for row in rows for name in columns):
            raise NotSolved
        numbers = [
            {name: _number(row[name], self.units.get(name, "")) for name in columns} for row in rows
        ]
        return sorted(numbers, key=lambda row: row[columns[0]])

    def fault(self, answer: list[dict[str, float]]) -> str | None:
        """Return a report on the first wrong cell, or None if all are right."""
        first = next(iter(self.value[0]))
        for row, right in zip(answer, self.value, strict=True):
            for name, value in right.items():
                if fact := Number(value, self.units.get(name, "")).fault(row[name]):
                    where = f"in the row with {first} = {shown(row[first])}, {name}"
                    return f"{where} is {shown(row[name])}: {fact}"
        return None
