"""Some students, and what is right for the numbers of each."""

import pytest

from shipnet.exercises import given, student
from shipnet.exercises.checking import exercise

NAMED = pytest.mark.parametrize("name", ["Kim", "Jeong", "a student", "Lee"])


def right(key, name):
    """Return a student's numbers and right answer."""
    numbers = given(key, student(name))
    return numbers, exercise(key).answer(**numbers).value
