"""Exercises: each student's own numbers, answer checks with hints, and the glossary."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from hashlib import sha256
from importlib import import_module
from importlib.util import find_spec
from typing import Any, TypeAlias, TypeVar

from shipnet import datasets
from shipnet.errors import ArgumentError
from shipnet.exercises.answers import ROUNDED, Answer, Misread, NotSolved, Number, blank
from shipnet.lazy import pd

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Student:
    """A student; the numbers in the exercises are derived from the name."""

    name: str

    def pick(self, what: str, options: Sequence[T]) -> T:
        """Choose one of the options for this student and purpose."""
        # This hash is the same on every computer and in every version of Python.
        digest = sha256(f"{self.name}\0{what}".encode()).digest()
        return options[int.from_bytes(digest) % len(options)]


#: Student for exercises with the same numbers for everybody.
_NOBODY = Student("nobody")


def student(name: str) -> Student:
    """Return the student with this name.

    Parameters
    ----------
    name : str
        Name of the student; must not be empty. Case and surrounding spaces are ignored.

    Returns
    -------
    Student
        Student to pass to `given` and `check`.

    Raises
    ------
    ArgumentError
        If the name is empty.

    Examples
    --------
    >>> student(" Kim ") == student("KIM")
    True
    """
    plain = name.strip().casefold()
    if not plain:
        raise ArgumentError(f"name is {name!r}; it must not be empty")
    return Student(plain)


#: Marks the general hint, for wrong answers that none or several of the other hints explain.
ANY = object()

#: The right answer for a student's numbers, and the wrong answer that each hint explains.
Solution: TypeAlias = tuple[Answer, dict[str, object]]


@dataclass(frozen=True)
class Exercise:
    """An exercise of a lesson: the options for its numbers, and a function that solves it.

    `variable` is the name in the lesson to which a student assigns the answer.
    """

    key: str
    variable: str
    draws: Mapping[str, Sequence[Any]]
    solve: Callable[..., Solution]

    def given(self, me: Student) -> dict[str, Any]:
        """Return a student's numbers, keyed by name."""
        return {
            name: me.pick(f"{self.key} {name}", options) for name, options in self.draws.items()
        }

    def fault(self, answered: object, me: Student) -> str | None:
        """Return what is wrong with an answer, or None if it is right.

        A mistake is named only if no other leads to the same answer, a number to four digits.
        """
        right: Any
        right, hints = self.solve(**self.given(me))
        try:
            answer = right.read(answered)
        except Misread as kind:
            return str(kind)
        fact: str | None = right.fault(answer)
        if fact is None:
            return None
        close = {"tolerance": 5e-4} if isinstance(right, Number) else {}
        named = [
            hint
            for hint, wrong in hints.items()
            if wrong is not ANY and replace(right, value=wrong, **close).fault(answer) is None
        ]
        if len(named) == 1 and ROUNDED not in fact:
            return named[0]
        if fact.endswith("?"):
            return fact
        begin = next(hint for hint, wrong in hints.items() if wrong is ANY)
        return f"{fact}. {begin}"


#: The exercises by key, registered when the modules of the lessons are imported.
EXERCISES: dict[str, Exercise] = {}


def solution(key: str, variable: str, /, **draws: Sequence[Any]) -> Callable[[T], T]:
    """Register the decorated function as the solution of an exercise."""

    def decorate(solve: T) -> T:
        EXERCISES[key] = Exercise(key, variable, draws, solve)  # type: ignore[arg-type]
        return solve

    return decorate


@dataclass(frozen=True)
class Verdict:
    """The result of a check, such as ``"not solved yet"``; true if the answer is correct."""

    key: str
    text: str

    def __bool__(self) -> bool:
        return self.text == "correct"

    def __repr__(self) -> str:
        return f"{self.key}: {self.text}"


def exercises(lesson: int) -> tuple[Exercise, ...]:
    """Return the exercises of a lesson."""
    name = f"shipnet.exercises.lesson_{lesson:02}"
    if find_spec(name) is None:
        raise ArgumentError(f"lesson is {lesson}; there is no such lesson")
    import_module(name)
    return tuple(one for key, one in EXERCISES.items() if key.startswith(f"ex-{lesson:02}-"))


def exercise(key: str) -> Exercise:
    """Return the exercise with this key."""
    form = re.fullmatch(r"ex-(\d\d)-\d+", key) if isinstance(key, str) else None
    by_key = {one.key: one for one in exercises(int(form[1]))} if form else {}
    if key not in by_key:
        raise ArgumentError(f"key is {key!r}; there is no such exercise")
    return by_key[key]


def given(key: str, me: Student) -> dict[str, Any]:
    """Return a student's own numbers for an exercise.

    Parameters
    ----------
    key : str
        Key of the exercise, such as ``"ex-01-2"``.
    me : Student
        Student who solves the exercise.

    Returns
    -------
    dict
        Numbers by name.

    Raises
    ------
    ArgumentError
        If there is no such exercise.

    Examples
    --------
    >>> from shipnet.exercises import student
    >>> sorted(given("ex-01-1", student("Kim")))
    ['bits']
    """
    return exercise(key).given(me)


def check(key: str, answer: object, me: Student | None = None) -> Verdict:
    """Check an answer; a wrong or malformed one does not raise an error.

    Parameters
    ----------
    key : str
        Key of the exercise, such as ``"ex-01-2"``.
    answer : object
        The student's answer; ``...`` or None if there is none yet.
    me : Student, optional
        Student who solves the exercise; required if the numbers depend on the student.

    Returns
    -------
    Verdict
        Shows ``correct``, ``not solved yet``, or a fault, a hint or both; true if correct.

    Raises
    ------
    ArgumentError
        If there is no such exercise, or `me` is required and missing.

    Examples
    --------
    >>> from shipnet.exercises import student
    >>> check("ex-01-1", ..., student("Kim"))
    ex-01-1: not solved yet
    """
    one = exercise(key)
    if me is None and one.draws:
        raise ArgumentError(f"me is missing: the numbers of {key} depend on the student")
    if blank(answer):
        return Verdict(key, "not solved yet")
    try:
        fault = one.fault(answer, me or _NOBODY)
    except NotSolved:
        return Verdict(key, "not solved yet")
    except Exception as error:  # an answer may be an object that cannot be compared
        fault = f"this answer cannot be compared ({type(error).__name__}): what type is expected?"
    return Verdict(key, fault or "correct")


def glossary(lesson: int | None = None) -> pd.DataFrame:
    """Return the terms that a lesson introduces, or all terms.

    Parameters
    ----------
    lesson : int, optional
        Number of the lesson; None for the terms of all lessons.

    Returns
    -------
    pandas.DataFrame
        Columns ``korean`` and ``meaning``, indexed by term.

    Raises
    ------
    ArgumentError
        If the lesson introduces no term.

    Examples
    --------
    >>> glossary(1).loc["bit time", "meaning"]
    'length of one bit: 6 us on AS-i'
    """
    words = datasets.read("glossary.csv")
    if lesson is not None:
        words = words[words["lesson"] == str(lesson)]
        if words.empty:
            raise ArgumentError(f"lesson is {lesson}; it introduces no term of the glossary")
    return words.set_index("term")[["korean", "meaning"]]
