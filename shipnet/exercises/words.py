"""The field's words in English and Korean, by the lesson that uses them first."""

from __future__ import annotations

from typing import TYPE_CHECKING

from shipnet import datasets
from shipnet.errors import ArgumentError

if TYPE_CHECKING:
    import pandas as pd


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
