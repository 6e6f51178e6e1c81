"""Some students, and what is right for the numbers of each."""

import pytest

from shipnet.exercises import given, student
from shipnet.exercises.exercise import exercise

NAMED = pytest.mark.parametrize("name", ["Kim", "Jeong", "a student", "Lee"])


def solved(key, **numbers):
    """Return the right answer of an exercise for some numbers."""
    return exercise(key).solve(**numbers)[0]


def right(key, name):
    """Return a student's numbers and right answer."""
    numbers = given(key, student(name))
    return numbers, solved(key, **numbers).value
