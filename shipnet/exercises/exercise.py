"""A student's own numbers, and an exercise: what it draws, its right answer, expected mistakes."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from hashlib import sha256
from typing import Any, TypeAlias, TypeVar

from shipnet.arguments import checked
from shipnet.errors import ArgumentError
from shipnet.exercises.answers import Answer, Misread

T = TypeVar("T")


@checked
@dataclass(frozen=True, slots=True)
class Student:
    """Who solves the exercises: a name, from which the student's own numbers follow."""

    name: str

    def __post_init__(self) -> None:
        plain = self.name.strip().casefold() if isinstance(self.name, str) else ""
        if not plain:
            raise ArgumentError(f"name is {self.name!r}; it must be a text, not empty")
        object.__setattr__(self, "name", plain)

    def pick(self, what: str, options: Sequence[T]) -> T:
        """Return the one of some options that is this student's, for a purpose."""
        if not len(options):
            raise ArgumentError("options are empty; there must be one or more")
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
        For `given` and `check`. Capitals, and spaces around the name, make no difference.

    Raises
    ------
    ArgumentError
        If the name is empty.

    Examples
    --------
    >>> student(" Kim ") == student("KIM")
    True
    """
    return Student(name)


#: In place of a wrong answer: the hint for all that no other hint is for, how to begin.
ANY = object()

#: What is right for a student's numbers, and by hint the wrong answer that the hint is for.
Solution: TypeAlias = tuple[Answer, dict[str, object]]


@dataclass(frozen=True)
class Exercise:
    """One exercise of a lesson: what it draws, and its solution for what was drawn."""

    key: str
    draws: Mapping[str, Sequence[Any]]
    solve: Callable[..., Solution]

    def given(self, me: Student) -> dict[str, Any]:
        """Return the numbers of a student by their names."""
        return {
            name: me.pick(f"{self.key} {name}", options) for name, options in self.draws.items()
        }

    def fault(self, answered: object, me: Student) -> str | None:
        """Say what is wrong with an answer.

        A mistake is named only if it, and no other one, gives this answer.
        """
        right, hints = self.solve(**self.given(me))
        try:
            answer = right.read(answered)
        except Misread as kind:
            return str(kind)
        fact = right.fault(answer)
        if fact is None:
            return None
        named = [
            hint
            for hint, wrong in hints.items()
            if wrong is not ANY and replace(right, value=wrong).fault(answer) is None  # type: ignore[type-var]
        ]
        if len(named) == 1:
            return named[0]
        if fact.endswith("?"):
            return fact
        begin = next(hint for hint, wrong in hints.items() if wrong is ANY)
        return f"{fact}. {begin}"


#: The exercises by their keys; filled as the modules of the lessons are imported.
EXERCISES: dict[str, Exercise] = {}


def solution(key: str, **draws: Sequence[Any]) -> Callable[[T], T]:
    """Register a function of the numbers that are drawn as the solution of an exercise."""

    def decorate(solve: T) -> T:
        EXERCISES[key] = Exercise(key, draws, solve)  # type: ignore[arg-type]
        return solve

    return decorate
