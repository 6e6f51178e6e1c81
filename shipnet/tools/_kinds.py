"""Kinds of what a tool asks for: number, choice, text; each knows what is legal."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import isnan
from numbers import Real
from typing import Any

from shipnet.errors import ArgumentError
from shipnet.fields import check_whole

__all__ = ["Asked", "Choice", "Number", "Series", "Switch", "Text", "Whole"]


@dataclass(frozen=True, kw_only=True)
class Asked:
    """What is asked for in a field; the base of the kinds that there are.

    Attributes
    ----------
    label : str
        What stands beside the control.
    help : str
        One sentence on what it means.
    """

    label: str
    help: str

    def check(self, name: str, value: Any, inputs: Any) -> None:
        """Raise ArgumentError unless the value is legal beside the others of the inputs."""
        raise NotImplementedError

    def check_shown(self, name: str, value: Any) -> None:
        """Raise ArgumentError unless the control can show the value, which is legal."""


@dataclass(frozen=True, kw_only=True)
class Number(Asked):
    """A number with a unit; `shown` is the range of its slider, NaN is legal if `missing` is."""

    low: float
    high: float
    step: float
    unit: str
    shown: tuple[float, float]
    missing: bool

    def check(self, name: str, value: Any, inputs: Any) -> None:
        """Raise ArgumentError unless it is a number in the legal range."""
        if self.missing and isinstance(value, Real) and isnan(value):
            return
        self._within(name, value, self.low, self.high, "it must be")

    def check_shown(self, name: str, value: Any) -> None:
        """Raise ArgumentError unless the slider reaches it."""
        self._within(name, value, *self.shown, "its slider shows")

    def _within(self, name: str, value: Any, low: float, high: float, rule: str) -> None:
        unit = f" {self.unit}" if self.unit else ""
        plain = isinstance(value, Real) and not isinstance(value, bool)
        if not (plain and low <= value <= high):
            given = f"{value:g}{unit}" if plain and not abs(value) > 1e300 else repr(value)
            raise ArgumentError(f"{name} is {given}; {rule} {low:g}..{high:g}{unit}")


@dataclass(frozen=True, kw_only=True)
class Whole(Asked):
    """A whole number; `at_most` names a field before it that it must not exceed."""

    low: int
    high: int
    unit: str
    shown: tuple[int, int]
    at_most: str
    typed: bool

    def check(self, name: str, value: Any, inputs: Any) -> None:
        """Raise ArgumentError unless it is whole and in the legal range."""
        if not self.at_most:
            check_whole(name, value, self.low, self.high)
            return
        other = getattr(inputs, self.at_most)
        check_whole(
            name, value, self.low, min(self.high, other), f", for {self.at_most} is {other}"
        )

    def check_shown(self, name: str, value: Any) -> None:
        """Raise ArgumentError unless the slider reaches it."""
        low, high = self.shown
        if not low <= value <= high:
            raise ArgumentError(f"{name} is {value}; its slider shows {low}..{high}")


@dataclass(frozen=True, kw_only=True)
class Choice(Asked):
    """One of several strings or numbers, by value what is shown for it."""

    options: Mapping[Any, str]
    unit: str
    slider: bool

    def check(self, name: str, value: Any, inputs: Any) -> None:
        """Raise ArgumentError unless it is one of the options."""
        plain = isinstance(value, str | int) and not isinstance(value, bool)
        if not (plain and value in self.options):
            known = ", ".join(map(repr, self.options))
            raise ArgumentError(f"{name} is {value!r}; it must be one of {known}")


@dataclass(frozen=True, kw_only=True)
class Switch(Asked):
    """Yes or no."""

    def check(self, name: str, value: Any, inputs: Any) -> None:
        """Raise ArgumentError unless it is a bool."""
        if not isinstance(value, bool):
            raise ArgumentError(f"{name} is {value!r}; it must be True or False")


@dataclass(frozen=True, kw_only=True)
class Text(Asked):
    """Text of up to `most` characters, in `rows` lines; what is empty shows the `hint`."""

    most: int
    rows: int
    hint: str

    def check(self, name: str, value: Any, inputs: Any) -> None:
        """Raise ArgumentError unless it is text that is not too long."""
        if not isinstance(value, str):
            raise ArgumentError(f"{name} is {value!r}; it must be text")
        if len(value) > self.most:
            raise ArgumentError(f"{name} has {len(value)} characters; it may have {self.most}")


@dataclass(frozen=True, kw_only=True)
class Series(Asked):
    """A row of up to `most` of the strings in `known`; it has no control, but buttons."""

    known: tuple[str, ...]
    most: int

    def check(self, name: str, value: Any, inputs: Any) -> None:
        """Raise ArgumentError unless it is a tuple of known strings that is not too long."""
        if not isinstance(value, tuple):
            raise ArgumentError(f"{name} is {value!r}; it must be a tuple of {self.known}")
        for one in value:
            if one not in self.known:
                raise ArgumentError(f"one of {name} is {one!r}; it must be one of {self.known}")
        if len(value) > self.most:
            raise ArgumentError(f"there are {len(value)} {name}; there may be {self.most}")
