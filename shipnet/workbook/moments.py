"""What a format of a workbook makes of a number: a date, a time, a number with words or zeros."""

from __future__ import annotations

import re
from datetime import datetime, timedelta

__all__ = ["kind_of", "moment"]

#: Formats of dates and times that have a number only, ECMA-376 part 1, section 18.8.30; 46 is a
#: span of hours. From 27 on they are those of East Asia.
_DATES = {*range(14, 23), *range(27, 37), 45, 47, *range(50, 59)}
_SPAN = 46

#: What a format shows as it stands: quoted, behind a backslash, as wide as, or repeated.
_LITERAL = re.compile(r'"[^"]*"|[\\_*].')

#: The part of it that can be read as a word: a letter.
_WORD = re.compile(r"[\"\\].*[^\W\d_]")

_DAY = 86_400_000  # ms


def kind_of(number: int, code: str | None) -> str:
    """Return what a number is by its format.

    Parameters
    ----------
    number : int
        Number of the format.
    code : str or None
        The format, if the workbook defines it.

    Returns
    -------
    str
        ``"date"`` also for a time of day, ``"span"`` for hours that may be more than a day,
        ``"words"`` for a number with letters beside it, zeros for a whole number that has as many
        digits at least, and ``""`` for any other number.

    Examples
    --------
    >>> kind_of(14, None), kind_of(164, "[h]:mm"), kind_of(165, '[Red]0.0 "days"')
    ('date', 'span', 'words')
    >>> kind_of(166, "0000"), kind_of(167, "0.00")
    ('0000', '')
    """
    if code is None:
        return "date" if number in _DATES else "span" if number == _SPAN else ""
    shown = _LITERAL.sub("", code).partition(";")[0].lower()
    if re.search(r"\[(h+|m+|s+)\]", shown):
        return "span"
    if re.search("[dmyhs]", re.sub(r"\[[^\]]*\]", "", shown)):
        return "date"
    first = code.partition(";")[0]
    if any(map(_WORD.match, _LITERAL.findall(first))):
        return "words"
    return first if re.fullmatch("00+", first) else ""


def moment(value: float, kind: str, epoch: datetime) -> str:
    """Return a number of days as text.

    Parameters
    ----------
    value : float
        Days since `epoch`.
    kind : {"date", "span"}
        As `kind_of`.
    epoch : datetime
        Day 0: 30 December 1899, or 1 January 1904 where a workbook says so.

    Returns
    -------
    str
        A date with its time, a time of day below 1, or a span; ``""`` if there is no such.

    Examples
    --------
    >>> first = datetime(1899, 12, 30)
    >>> moment(2010.25, "date", first), moment(0.5, "date", first), moment(1.5, "span", first)
    ('1905-07-02 06:00:00', '12:00:00', '1 day, 12:00:00')
    """
    try:
        span = timedelta(milliseconds=round(value * _DAY))
        if kind == "span":
            return str(span)
        if timedelta(0) <= span < timedelta(days=1):
            return str((datetime.min + span).time())
        # Excel's calendar has a 29 February 1900.
        early = 0 < value < 60 and epoch.year < 1904
        return str(epoch + span + timedelta(days=early))
    except (OverflowError, ValueError):
        return ""
