"""What can be wrong with bits and bytes, one class per kind of fault.

Every class carries a `code`, so that a batch function can return an array of codes where a
scalar function raises. Code 0 means that nothing is wrong.
"""

import re

__all__ = [
    "AcknowledgeError",
    "AlternationError",
    "ArgumentError",
    "CrcError",
    "EndBitError",
    "FieldError",
    "FormError",
    "FrameError",
    "InformationError",
    "InputError",
    "LengthError",
    "MismatchError",
    "ParityError",
    "PauseError",
    "SilenceError",
    "StartBitError",
    "StuffError",
    "SymbolError",
    "UnknownCallError",
    "explain",
]


class FrameError(ValueError):
    """A frame breaks a rule of its bus; the subclass says which."""

    code: int


class LengthError(FrameError):
    """The frame has too few or too many bits."""

    code = 1


class SymbolError(FrameError):
    """Something other than 0 and 1 stands where a bit should be."""

    code = 2


class StartBitError(FrameError):
    """The first bit of a telegram is not 0."""

    code = 3


class EndBitError(FrameError):
    """The last bit of a telegram is not 1."""

    code = 4


class ParityError(FrameError):
    """The number of ones, parity bit included, is odd."""

    code = 5


class UnknownCallError(FrameError):
    """The bits are in order, but no call of the standard has this pattern."""

    code = 6


class AlternationError(FrameError):
    """Two pulses in a row have the same sign."""

    code = 8


class PauseError(FrameError):
    """The line falls silent inside the telegram: two half-bits in a row without a pulse."""

    code = 9


class InformationError(FrameError):
    """A bit lacks the pulse in its middle."""

    code = 10


class SilenceError(FrameError):
    """There is no telegram: nothing rises above the noise."""

    code = 11


class StuffError(FrameError):
    """Six equal bits in a row where the sixth had to be a stuff bit."""

    code = 12


class FormError(FrameError):
    """A bit that the format fixes has the other value."""

    code = 13


class CrcError(FrameError):
    """The check sequence received is not the one computed."""

    code = 14


class AcknowledgeError(FrameError):
    """No receiver answered in the acknowledge slot."""

    code = 15


class FieldError(FrameError):
    """A field has a value that the standard does not allow; the message names the field."""

    code = 16


class MismatchError(FrameError):
    """The response is in order, but it does not belong to the request."""

    code = 17


class ArgumentError(ValueError):
    """An argument lies outside its legal range; the message names it, its value and the range."""

    code = 7


class InputError(ValueError):
    """A file cannot be used as it is.

    Parameters
    ----------
    file : str
        The file as the user named it.
    *faults : str
        What is wrong and what was expected, each with its row and column where it has one.
    more : int, default 0
        How many faults there are beside those given.

    Examples
    --------
    >>> print(InputError("scope.csv", "row 7, column 2: 'x' is not a number", "row 9 is empty"))
    scope.csv: row 7, column 2: 'x' is not a number; row 9 is empty

    The message has the first ten; those that differ in nothing but their rows are one:

    >>> print(InputError("list.csv", *(f"row {n}, column y: is empty" for n in (2, 3, 4, 9))))
    list.csv: rows 2 to 4 and 9, column y: is empty
    """

    #: Faults of a file that one message names.
    shown = 10

    def __init__(self, file: str, *faults: str, more: int = 0) -> None:
        super().__init__(file, *faults)
        self.file = file
        self.faults = faults
        self.more = more

    def lines(self, most: int) -> list[str]:
        """Return what is wrong, line by line.

        Parameters
        ----------
        most : int
            Most groups of faults that are named, 1 or more; the last line counts the others.

        Returns
        -------
        list of str
            A line a group: faults that differ in nothing but their rows are one.
        """
        groups = self._groups()
        rest = sum(count for _, count in groups[most:]) + self.more
        return [text for text, _ in groups[:most]] + ([f"and {rest} more"] if rest else [])

    def __str__(self) -> str:
        """Say everything in one line."""
        return f"{self.file}: {'; '.join(self.lines(self.shown))}"

    def _groups(self) -> list[tuple[str, int]]:
        groups: dict[tuple[str, str], list[int]] = {}
        for fault in self.faults:
            placed = _PLACED.fullmatch(fault)
            what, row, rest = placed.groups() if placed else ("", "0", fault)
            groups.setdefault((what, rest), []).append(int(row))
        return [
            (f"{what}{_listed(rows)}{rest}" if what else rest, len(rows))
            for (what, rest), rows in groups.items()
        ]


#: A fault with its place: what is counted, its number, and the rest.
_PLACED = re.compile(r"(row|line) (\d{1,9})([,:].*)", re.DOTALL)

#: Runs of rows that a message names.
_RUNS = 5


def _listed(numbers: list[int]) -> str:
    """Return rows or lines in words, behind their name: `` 3``, ``s 2 to 9 and 12``."""
    runs: list[list[int]] = []
    for number in sorted(set(numbers)):
        if runs and number == runs[-1][-1] + 1:
            runs[-1] = [runs[-1][0], number]
        else:
            runs.append([number])
    parts = [" to ".join(map(str, run)) for run in runs[:_RUNS]]
    if rest := sum(run[-1] - run[0] + 1 for run in runs[_RUNS:]):
        parts.append(f"{rest} more")
    listed = " and ".join([*([", ".join(parts[:-1])] if parts[1:] else []), parts[-1]])
    return f"{'s' if len(set(numbers)) > 1 else ''} {listed}"


_BY_CODE: dict[int, type[FrameError] | type[ArgumentError]] = {
    kind.code: kind
    for kind in (
        LengthError,
        SymbolError,
        StartBitError,
        EndBitError,
        ParityError,
        UnknownCallError,
        ArgumentError,
        AlternationError,
        PauseError,
        InformationError,
        SilenceError,
        StuffError,
        FormError,
        CrcError,
        AcknowledgeError,
        FieldError,
        MismatchError,
    )
}


def explain(code: int) -> str:
    """Return the name of the error class behind a batch code, or ``"ok"`` for 0.

    Parameters
    ----------
    code : int
        Error code as the batch functions return it.

    Returns
    -------
    str
        Class name, or ``"ok"``.

    Raises
    ------
    ValueError
        If no class has this code; the message lists the codes there are.

    Examples
    --------
    >>> explain(0), explain(5)
    ('ok', 'ParityError')
    """
    if code == 0:
        return "ok"
    if code not in _BY_CODE:
        raise ValueError(f"code is {code}, but the error codes are 0 and {sorted(_BY_CODE)}")
    return _BY_CODE[code].__name__
