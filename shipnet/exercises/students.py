"""Who solves the exercises: a name, from which everybody's own numbers follow."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from hashlib import sha256
from typing import TypeVar

from shipnet.errors import ArgumentError

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Student:
    """A student.

    Parameters
    ----------
    name : str
        Name, not empty; capitals, and spaces around it, make no difference.

    Raises
    ------
    ArgumentError
        If there is no name.

    Examples
    --------
    >>> Student(" Kim ") == Student("KIM")
    True
    """

    name: str

    def __post_init__(self) -> None:
        """Check and store the name."""
        plain = self.name.strip().casefold() if isinstance(self.name, str) else ""
        if not plain:
            raise ArgumentError(f"name is {self.name!r}; it must be a text, not empty")
        object.__setattr__(self, "name", plain)

    def pick(self, what: str, options: Sequence[T]) -> T:
        """Return the one of some options that is this student's.

        Parameters
        ----------
        what : str
            What it is for; another purpose, another pick.
        options : sequence
            At least one.

        Returns
        -------
        object
            One of the options.

        Notes
        -----
        It follows from the SHA-256 of name and purpose, so it is the same on every computer and
        with every version of Python, and a teacher can look it up.

        Examples
        --------
        >>> student("Kim").pick("length", range(60, 100)) == student(" KIM").pick(
        ...     "length", range(60, 100)
        ... )
        True
        """
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
        If there is no name.

    Examples
    --------
    >>> student("Kim").name
    'kim'
    """
    return Student(name)
