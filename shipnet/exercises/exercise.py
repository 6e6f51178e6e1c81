"""A student's own numbers, and an exercise: what it draws, its right answer, expected mistakes."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from hashlib import sha256
from typing import Any, TypeVar

from shipnet.errors import ArgumentError
from shipnet.exercises.answers import Answer

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Student:
    """Who solves the exercises: a name, from which the student's own numbers follow.

    Parameters
    ----------
    name : str
        Name, not empty; capitals, and spaces around it, make no difference.

    Raises
    ------
    ArgumentError
        If the name is empty.

    Examples
    --------
    >>> Student(" Kim ") == Student("KIM")
    True
    """

    name: str

    def __post_init__(self) -> None:
        plain = self.name.strip().casefold() if isinstance(self.name, str) else ""
        if not plain:
            raise ArgumentError(f"name is {self.name!r}; it must be a text, not empty")
        object.__setattr__(self, "name", plain)

    def pick(self, what: str, options: Sequence[T]) -> T:
        """Return the one of some options that is this student's, for a purpose."""
        # A hash gives the same on every computer and with every version of Python.
        digest = sha256(f"{self.name}\0{what}".encode()).digest()
        return options[int.from_bytes(digest) % len(options)]


def student(name: str) -> Student:
    """Return the student of this name.

    Parameters
    ----------
    name : str
        Name, not empty.

    Returns
    -------
    Student
        Give it to `given` and `check`.

    Raises
    ------
    ArgumentError
        If the name is empty.

    Examples
    --------
    >>> student("Kim").name
    'kim'
    """
    return Student(name)


@dataclass(frozen=True)
class Exercise:
    """One exercise of a lesson; `traps` maps hints to the wrong answers that they are for."""

    key: str
    answer: Callable[..., Answer]
    draws: Mapping[str, Sequence[Any]] = field(default_factory=dict)
    traps: Mapping[str, Callable[..., object]] = field(default_factory=dict)

    def given(self, me: Student) -> dict[str, Any]:
        """Return the numbers of a student by their names."""
        return {
            name: me.pick(f"{self.key} {name}", options) for name, options in self.draws.items()
        }

    def fault(self, answered: object, me: Student) -> str | None:
        """Say what is wrong with an answer."""
        numbers = self.given(me)
        right = self.answer(**numbers)
        fault = right.fault(answered)
        if fault is None:
            return None
        for hint, wrong in self.traps.items():
            # The same kind of answer, with the trap as what is right.
            trapped: Answer = replace(right, value=wrong(**numbers))  # type: ignore[type-var]
            if trapped.fault(answered) is None:
                return hint
        return fault
