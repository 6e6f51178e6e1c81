"""What the cells of the lessons call: checks of answers, own numbers, the glossary."""

from __future__ import annotations

import re
from dataclasses import dataclass
from importlib import import_module
from importlib.util import find_spec
from typing import Any

from shipnet import datasets
from shipnet.arguments import checked
from shipnet.errors import ArgumentError
from shipnet.exercises.answers import NotSolved, blank
from shipnet.exercises.exercise import EXERCISES, Exercise, Student
from shipnet.lazy import pd

#: Who has no name yet.
_NOBODY = Student("nobody")


@dataclass(frozen=True)
class Verdict:
    """What a check says, such as ``"not solved yet"``; true if the answer is correct."""

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
    """Return the exercise of this name."""
    form = re.fullmatch(r"ex-(\d\d)-\d+", key) if isinstance(key, str) else None
    known = {one.key: one for one in exercises(int(form[1]))} if form else {}
    if key not in known:
        raise ArgumentError(f"key is {key!r}; there is no such exercise")
    return known[key]


@checked
def given(key: str, me: Student) -> dict[str, Any]:
    """Return the numbers of an exercise that are this student's own.

    Parameters
    ----------
    key : str
        Exercise, such as ``"ex-01-2"``.
    me : Student
        Who solves it.

    Returns
    -------
    dict
        Name -> value.

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


@checked
def check(key: str, answer: object, me: Student | None = None) -> Verdict:
    """Judge an answer; whatever it is, a sentence comes back.

    Parameters
    ----------
    key : str
        Exercise, such as ``"ex-01-2"``.
    answer : object
        What the student found; ``...`` or None if nothing yet.
    me : Student, optional
        Who solves it, where the exercise has numbers of its own for everybody.

    Returns
    -------
    Verdict
        Shows ``correct``, ``not solved yet``, or what is wrong, with a hint; true if correct.

    Raises
    ------
    ArgumentError
        If there is no such exercise, or it has numbers for everybody and `me` is missing.

    Examples
    --------
    >>> from shipnet.exercises import student
    >>> check("ex-01-1", ..., student("Kim"))
    ex-01-1: not solved yet
    """
    one = exercise(key)
    if me is None and one.draws:
        raise ArgumentError(f"me is missing: {key} has numbers of its own for everybody")
    if blank(answer):
        return Verdict(key, "not solved yet")
    try:
        fault = one.fault(answer, me or _NOBODY)
    except NotSolved:
        return Verdict(key, "not solved yet")
    except Exception as error:  # an answer may be any object, and object to being compared
        fault = f"this answer cannot be compared ({type(error).__name__}): what kind is asked?"
    return Verdict(key, fault or "correct")


def glossary(lesson: int | None = None) -> pd.DataFrame:
    """Return the words that a lesson uses first, or all of them.

    Parameters
    ----------
    lesson : int, optional
        Number of the lesson.

    Returns
    -------
    pandas.DataFrame
        Index: the term; columns Korean and meaning.

    Raises
    ------
    ArgumentError
        If no word is new in this lesson.

    Examples
    --------
    >>> glossary(1).loc["bit time", "meaning"]
    'length of one bit: 6 us on AS-i'
    """
    words = datasets.read("glossary.csv")
    if lesson is not None:
        words = words[words["lesson"] == str(lesson)]
        if words.empty:
            raise ArgumentError(f"lesson is {lesson}; no word of the glossary is new there")
    return words.set_index("term")[["korean", "meaning"]]
