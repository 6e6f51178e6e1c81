"""Answers that are functions or tables: tried on inputs, compared row by row."""

from __future__ import annotations

import linecache
from collections.abc import Callable, Sequence
from copy import deepcopy
from dataclasses import dataclass, field
from traceback import walk_tb
from types import TracebackType
from typing import Any

from shipnet.exercises.answers import Answer, Number, blank, shown


class NotSolved(Exception):
    """There is no answer yet."""


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
