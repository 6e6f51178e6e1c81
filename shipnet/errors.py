"""Errors in bits and bytes, arguments and files.

Where scalar functions raise a `FrameError`, batch functions return its `code`; 0 means no fault.
"""

import re
from collections.abc import Iterable, Sequence
from importlib import import_module
from typing import Any, ClassVar

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
    "load_extra",
    "name_of",
]
__dir__ = __all__.copy

#: Maximum lengths of a fault, a message and a quoted value [characters]; the middle of longer ones
#: is left out.
_FAULT, _MESSAGE, _QUOTED = 300, 3000, 80

#: A quoted value of at least 80 characters.
_VALUE = re.compile(r"(?<![\w'])'[^']{80,}'|(?<![\w\"])\"[^\"]{80,}\"")


def _without_middle(text: str, most: int) -> str:
    if len(text) <= most:
        return text
    half = (most - 5) // 2
    return f"{text[:half]} ... {text[-half:]}"


def _short(text: str) -> str:
    """Return a message shortened to at most 300 characters per fault and 3000 in all."""
    text = _VALUE.sub(lambda found: _without_middle(found[0], _QUOTED), text)
    faults = [_without_middle(fault, _FAULT) for fault in text.split("; ")]
    return _without_middle("; ".join(faults), _MESSAGE)


class FrameError(ValueError):
    """A frame violates a rule of its bus; the subclass says which."""

    code: ClassVar[int]

    def __init_subclass__(cls, code: int) -> None:
        """Give the class its code."""
        cls.code = code

    def __str__(self) -> str:
        return _short(super().__str__())


class LengthError(FrameError, code=1):
    """The frame is too short or too long."""


class SymbolError(FrameError, code=2):
    """A bit is neither 0 nor 1."""


class StartBitError(FrameError, code=3):
    """The first bit of a telegram or frame is not 0."""


class EndBitError(FrameError, code=4):
    """The last bit of a telegram is not 1."""


class ParityError(FrameError, code=5):
    """The parity bit does not match the bits that it protects."""


class UnknownCallError(FrameError, code=6):
    """The call or function code is unknown."""


class AlternationError(FrameError, code=8):
    """Two successive pulses have the same sign."""


class PauseError(FrameError, code=9):
    """The line is silent inside the telegram: two successive half-bits have no pulse."""


class InformationError(FrameError, code=10):
    """A bit lacks the pulse in its middle."""


class SilenceError(FrameError, code=11):
    """There is no telegram: nothing rises above the noise."""


class StuffError(FrameError, code=12):
    """Six equal bits in succession, where the sixth should have been a stuff bit."""


class FormError(FrameError, code=13):
    """A bit has a value that the format does not allow there."""


class CrcError(FrameError, code=14):
    """The received check sequence differs from the computed one."""


class AcknowledgeError(FrameError, code=15):
    """No receiver acknowledged the frame."""


class FieldError(FrameError, code=16):
    """A field has a value that is not allowed; the message names the field."""


class MismatchError(FrameError, code=17):
    """The response is correct, but it does not belong to the request."""


class ArgumentError(ValueError):
    """An argument is illegal; the message gives its name, its value and the legal values."""

    code = 7

    def __str__(self) -> str:
        return _short(super().__str__())


class InputError(ValueError):
    """A file cannot be used as it is.

    Parameters
    ----------
    file : str
        The file as the user named it.
    *faults : str
        The faults, each with its row and column, if any, and with what was expected.
    more : int, default 0
        Number of further faults, which are only counted.

    Examples
    --------
    >>> print(InputError("scope.csv", "row 7, column 2: 'x' is not a number", "row 9 is empty"))
    scope.csv: row 7, column 2: 'x' is not a number; row 9 is empty

    The message contains the first ten faults; those that differ only in their rows count as one:

    >>> print(InputError("list.csv", *(f"row {n}, column y: is empty" for n in (2, 3, 4, 9))))
    list.csv: rows 2 to 4 and 9, column y: is empty
    """

    #: Maximum number of groups of faults in one message.
    shown = 10

    def __init__(self, file: str, *faults: str, more: int = 0) -> None:
        super().__init__(file, *faults)
        self.file = file
        self.faults = faults
        self.more = more

    def lines(self, most: int | None = None) -> list[str]:
        """Return one line per group of faults, and a last line that counts any other faults.

        The faults of a group differ only in their rows and in the first value that they quote. At
        most `most` groups have a line, of up to 300 characters; None gives all groups in full.
        """
        groups = self._groups(most is not None)
        if most is None:
            return [text for text, _ in groups] + ([f"and {self.more} more"] if self.more else [])
        hidden = sum(count for _, count in groups[most:]) + self.more
        return [_without_middle(_short(text), _FAULT) for text, _ in groups[:most]] + (
            [f"and {hidden} more"] if hidden else []
        )

    def __str__(self) -> str:
        return f"{self.file}: {'; '.join(self.lines(self.shown))}"

    def _groups(self, short: bool) -> list[tuple[str, int]]:
        groups: dict[tuple[str, str, str], list[tuple[int, str]]] = {}
        for fault in self.faults:
            match = _PLACED.fullmatch(fault)
            parts = tuple(filter(None, match.groups())) if match else ("", "0", fault)
            what, row, head, value, tail = (*parts, "", "")[:5]
            groups.setdefault((what, head, tail), []).append((int(row), value))
        messages = []
        for (what, head, tail), places in groups.items():
            rows, values = [row for row, _ in places], list(dict.fromkeys(v for _, v in places))
            if short and (more := len(values) - _VALUES) > 1:
                values = [*values[:_VALUES], f"{more} more"]
            listing = listed(rows, _RUNS if short else None) if what else ""
            messages.append((f"{what}{listing}{head}{_joined(values)}{tail}", len(places)))
        return messages


#: A fault with its place: "row" or "line", its number, and text that may quote a wrong value.
_PLACED = re.compile(
    r"(row|line) (\d{1,9})([,:][^'\"]*?: )('[^']*'|\"[^\"]*\")(; .*)|"
    r"(row|line) (\d{1,9})([,:].*)",
    re.DOTALL,
)

#: How many runs of rows, and how many values, a group of faults lists before "... more".
_RUNS, _VALUES = 5, 5


def _joined(parts: Sequence[str]) -> str:
    """Join parts with commas and a final "and"."""
    return " and ".join([*([", ".join(parts[:-1])] if parts[1:] else []), parts[-1]])


def listed(numbers: Iterable[int], runs_shown: int | None = _RUNS) -> str:
    """Return row numbers as text to append to "row", such as `` 3`` or ``s 2 to 9 and 12``."""
    runs: list[list[int]] = []
    for number in sorted(set(numbers)):
        if runs and number == runs[-1][-1] + 1:
            runs[-1] = [runs[-1][0], number]
        else:
            runs.append([number])
    shown = len(runs) if runs_shown is None else runs_shown
    parts = [" to ".join(map(str, run)) for run in runs[:shown]]
    if hidden := sum(run[-1] - run[0] + 1 for run in runs[shown:]):
        parts.append(f"{hidden} more")
    return f"{'s' if sum(map(len, runs)) > 1 else ''} {_joined(parts)}"


def some(names: Sequence[str], shown: int) -> str:
    """Return the first names as text with commas, and the number of the others."""
    more = f" and {len(names) - shown} more" if len(names) > shown else ""
    return ", ".join(names[:shown]) + more


_NAMES = {0: "ok"} | {kind.code: kind.__name__ for kind in FrameError.__subclasses__()}
_NAMES[ArgumentError.code] = ArgumentError.__name__


def name_of(code: int) -> str:
    """Return the name of the error class with this code, or ``"ok"`` for 0.

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
    ArgumentError
        If no class has this code.

    Examples
    --------
    >>> name_of(0), name_of(5)
    ('ok', 'ParityError')
    """
    if code not in _NAMES:
        raise ArgumentError(f"code is {code}; it must be one of {sorted(_NAMES)}")
    return _NAMES[code]


def load_extra(module: str, package: str) -> Any:
    """Return an optional module, or raise an error that names the package to install."""
    try:
        return import_module(module)
    except ModuleNotFoundError as problem:
        if problem.name != module:
            raise
        raise ImportError(
            f"{package} is not installed; install it with: python -m pip install {package}"
        ) from None
