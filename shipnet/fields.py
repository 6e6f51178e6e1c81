"""Numbers that are declared once, with unit, range and meaning.

The check of a value, its error text, the documentation, the settings file and the widget are
derived from the declaration. The functions ``check_...`` check single arguments in the same words.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import MISSING, Field, dataclass, field, fields
from functools import cache
from inspect import cleandoc
from math import inf, isnan
from numbers import Integral, Real
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias, TypeVar, dataclass_transform

from shipnet.errors import ArgumentError

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt

T = TypeVar("T")

#: One value, or one per tree of a Monte Carlo simulation.
Quantity: TypeAlias = "float | npt.NDArray[np.float64]"


def _legal(low: float, high: float, unit: str) -> str:
    """Return a range in words."""
    return f"{low:g}..{high:g} {unit}".rstrip()


def _is_number(value: Any) -> bool:
    """Return whether a value is a single real number; a bool does not count as one."""
    # A float is by far the most frequent, and the test for `Real` is slow.
    return type(value) is float or (isinstance(value, Real) and not isinstance(value, bool))


def check_scalar(
    what: str, value: Any, unit: str, low: float, high: float, rule: str = "it must be"
) -> float:
    """Return a value as a float, or raise if it is not a single number or is out of range."""
    if getattr(value, "ndim", None) == 0:
        value = value.item()  # numpy's results for one number are arrays without dimensions
    if not (_is_number(value) and low <= value <= high):
        short = _is_number(value) and not 1e300 < abs(value) < inf
        text = f"{float(value):g} {unit}".rstrip() if short else repr(value)
        raise ArgumentError(f"{what} is {text}; {rule} {_legal(low, high, unit)}")
    return float(value)


def check_quantity(what: str, value: Any, unit: str, *, low: float = 0.0, high: float) -> Quantity:
    """Return a value as a float or a read-only array of floats, or raise if it is out of range."""
    if isinstance(value, Real):
        return check_scalar(what, value, unit, low, high)
    import numpy as np  # slow to import, and rarely needed here

    legal = _legal(low, high, unit)
    try:
        array = np.array(value)
        if array.dtype.kind not in "iuf" or array.ndim > 1 or array.size == 0:
            raise ValueError
    except (TypeError, ValueError, OverflowError):
        raise ArgumentError(
            f"{what} is {value!r}; it must be a number or a 1-D array of numbers, {legal}"
        ) from None
    if array.ndim == 0:
        return check_scalar(what, array.item(), unit, low, high)
    array = array.astype(float)
    good = (array >= low) & (array <= high)
    if not good.all():
        tree = int(np.argmin(good))
        value = f"{array[tree]:g} {unit}".rstrip()
        raise ArgumentError(f"{what} is {value} in tree {tree}; it must be {legal}")
    array.flags.writeable = False
    return array


def check_trees(what: str, trees: int | None, *values: Quantity | None) -> int | None:
    """Return how many Monte Carlo trees `values` describe, or `trees` if none is an array."""
    for value in values:
        if value is not None and not isinstance(value, float):
            if trees is not None and len(value) != trees:
                raise ArgumentError(f"{what} has values for {len(value)} trees, others for {trees}")
            trees = len(value)
    return trees


def check_whole(name: str, value: int, low: int, high: int, why: str = "") -> int:
    """Return a whole number such as 3 or 3.0 as an int; raise if it is out of range or not whole.

    `why` ends the message. A bool does not count as a number.
    """
    if not (_is_number(value) and low <= value <= high and value % 1 == 0):
        raise ArgumentError(f"{name} is {value!r}; it must be a whole number {low}..{high}{why}")
    return int(value)


def check_choice(name: str, value: Any, options: Iterable[str]) -> str:
    """Return a value, or raise if it is not one of the given strings."""
    legal = tuple(options)
    if not (isinstance(value, str) and value in legal):
        raise ArgumentError(f"{name} is {value!r}; it must be one of {', '.join(map(repr, legal))}")
    return value


def check_kind(name: str, value: Any, kind: type[T]) -> T:
    """Return a value, or raise if it is not an instance of the class."""
    if not isinstance(value, kind):
        article = "an" if kind.__name__[0] in "AEIOaeio" else "a"
        raise ArgumentError(f"{name} is {value!r}; it must be {article} {kind.__name__}")
    return value


def check_rng(rng: Any) -> np.random.Generator:
    """Return `numpy.random.default_rng(rng)`, or raise ArgumentError if `rng` is illegal."""
    import numpy as np  # slow to import, and rarely needed here

    try:
        return np.random.default_rng(rng)
    except (TypeError, ValueError):
        raise ArgumentError(
            f"rng is {rng!r}; it must be a seed, None or a numpy.random.Generator"
        ) from None


class Words(NamedTuple):
    """The text beside a control, and the help on it."""

    label: str
    help: str


#: What explains a field, and the range of its slider.
Help: TypeAlias = str | Words
Ends: TypeAlias = tuple[float, float] | None


@dataclass(frozen=True, kw_only=True)
class Kind:
    """Base class of all kinds of fields; `optional` makes None legal."""

    help: str = ""
    label: str = ""
    unit: str = ""
    optional: bool = False

    @property
    def legal(self) -> str:
        """The legal values in words, without the unit; "" if there are too many to name."""
        return ""

    def check(self, name: str, value: Any, record: Any) -> Any:
        """Return the value to be stored, or raise ArgumentError if the given value is illegal."""
        return value if self.optional and value is None else self._check(name, value, record)

    def check_shown(self, name: str, value: Any) -> None:
        """Raise ArgumentError if the control cannot show the value, although it is legal."""

    def _check(self, name: str, value: Any, record: Any) -> Any:
        raise NotImplementedError


@dataclass(frozen=True, kw_only=True)
class Number(Kind):
    """A number; `shown` is the range of its slider.

    `missing` makes NaN legal; `many` allows an array with one value per Monte Carlo tree.
    """

    low: float
    high: float
    shown: tuple[float, float]
    step: float = 1.0
    missing: bool = False
    many: bool = False

    @property
    def legal(self) -> str:
        """The range."""
        return _legal(self.low, self.high, "")

    def check_shown(self, name: str, value: Any) -> None:
        """Raise ArgumentError if the value is outside the range of the slider."""
        check_scalar(name, value, self.unit, *self.shown, "its slider shows")

    def _check(self, name: str, value: Any, record: Any) -> Any:
        if self.many:
            return check_quantity(name, value, self.unit, low=self.low, high=self.high)
        if self.missing and _is_number(value) and not isinstance(value, Integral) and isnan(value):
            return float(value)
        return check_scalar(name, value, self.unit, self.low, self.high)


@dataclass(frozen=True, kw_only=True)
class Whole(Number):
    """A whole number, without a slider if `typed`; an earlier field, `at_most`, may limit it."""

    low: int
    high: int
    at_most: str = ""
    typed: bool = False

    @property
    def legal(self) -> str:
        """The range, with all digits."""
        return f"{self.low}..{self.high}"

    def _check(self, name: str, value: Any, record: Any) -> int:
        if not self.at_most:
            return check_whole(name, value, self.low, self.high)
        other = getattr(record, self.at_most)
        why = f", because {self.at_most} is {other}"
        return check_whole(name, value, self.low, min(self.high, other), why)


@dataclass(frozen=True, kw_only=True)
class Choice(Kind):
    """One of several strings or numbers, each with the text shown for it."""

    options: Mapping[Any, str]
    slider: bool = False

    @property
    def legal(self) -> str:
        """All values."""
        return ", ".join(map(repr, self.options))

    def _check(self, name: str, value: Any, record: Any) -> Any:
        if not ((isinstance(value, str) or _is_number(value)) and value in self.options):
            raise ArgumentError(f"{name} is {value!r}; it must be one of {self.legal}")
        return next(option for option in self.options if option == value)  # 8 if 8.0 is given


@dataclass(frozen=True, kw_only=True)
class Switch(Kind):
    """Yes or no."""

    def _check(self, name: str, value: Any, record: Any) -> bool:
        if not isinstance(value, bool):
            raise ArgumentError(f"{name} is {value!r}; it must be True or False")
        return value


@dataclass(frozen=True, kw_only=True)
class Text(Kind):
    """Text of up to `most` characters; its control has `rows` lines, and shows `hint` if empty."""

    most: int = 200
    rows: int = 1
    hint: str = ""

    def _check(self, name: str, value: Any, record: Any) -> str:
        if not isinstance(value, str):
            raise ArgumentError(f"{name} is {value!r}; it must be text")
        if len(value) > self.most:
            raise ArgumentError(f"{name} has {len(value)} characters; the limit is {self.most}")
        return value


@dataclass(frozen=True, kw_only=True)
class Part(Kind):
    """An object of the class `of`; `make`, if given, makes one from a value of another class."""

    of: type
    make: Callable[[Any], Any] | None = None

    def _check(self, name: str, value: Any, record: Any) -> Any:
        if self.make is not None and not isinstance(value, self.of):
            return self.make(value)
        return check_kind(name, value, self.of)


def _declare(kind: type[Kind], help: Help, **options: Any) -> Any:
    """Declare a field; `options` are attributes of its kind or arguments of a dataclass field."""
    names = options.keys() & {"default", "default_factory", "kw_only"}
    of_field = {name: options.pop(name) for name in names}
    label, help = help if isinstance(help, Words) else ("", help)
    return field(metadata={"kind": kind(help=help, label=label, **options)}, **of_field)


def number(
    low: float, high: float, unit: str = "", help: Help = "", slider: Ends = None, **options: Any
) -> Any:
    """Declare a `Number` from `low` to `high`; `slider` is the range of its slider."""
    shown = slider or (low, high)
    return _declare(Number, help, low=low, high=high, unit=unit, shown=shown, **options)


def whole(
    low: int, high: int, unit: str = "", help: Help = "", slider: Ends = None, **options: Any
) -> Any:
    """Declare a `Whole` number from `low` to `high`; `slider` is the range of its slider."""
    shown = slider or (low, high)
    return _declare(Whole, help, low=low, high=high, unit=unit, shown=shown, **options)


def choice(options: Mapping[Any, str] | Iterable[Any], help: Help = "", **others: Any) -> Any:
    """Declare a `Choice` of several values; a mapping gives the text shown for each."""
    if not isinstance(options, Mapping):
        options = {value: str(value) for value in options}
    return _declare(Choice, help, options=options, **others)


def switch(help: Help = "", **options: Any) -> Any:
    """Declare a field that is True or False."""
    return _declare(Switch, help, **options)


def text(help: Help = "", **options: Any) -> Any:
    """Declare `Text`."""
    return _declare(Text, help, **options)


def part(of: type, help: Help = "", **options: Any) -> Any:
    """Declare a `Part`: an object of the class `of`."""
    return _declare(Part, help, of=of, **options)


def declared(kind: type) -> Mapping[str, Kind]:
    """Return the declarations of a dataclass's fields, by name and in order."""
    return _declared(kind)


@cache
def _declared(kind: type) -> Mapping[str, Kind]:
    return {one.name: one.metadata["kind"] for one in fields(kind) if "kind" in one.metadata}


def check_fields(made: Any) -> None:
    """Check the declared fields of a dataclass instance; store the values the checks return."""
    for name, kind in declared(type(made)).items():
        value = getattr(made, name)
        checked = kind.check(name, value, made)
        if checked is not value:
            object.__setattr__(made, name, checked)


@dataclass_transform(
    frozen_default=True, field_specifiers=(number, whole, choice, switch, text, part, field)
)
def record(kind: type[T] | None = None, /, **options: bool) -> Any:
    """Make a frozen dataclass whose docstring lists its declared fields.

    `check_fields` checks the fields; a class with a ``__post_init__`` calls it there.
    """

    def make(kind: type[T]) -> type[T]:
        if not hasattr(kind, "__post_init__"):
            kind.__post_init__ = check_fields  # type: ignore[attr-defined]
        made = dataclass(frozen=True, **options)(kind)
        made.__doc__ = _documented(made)
        return made

    return make if kind is None else make(kind)


def _documented(kind: type) -> str | None:
    """Return the docstring of a record, with sections on its declared fields before any others."""
    docstring = cleandoc(kind.__doc__ or "")
    if not declared(kind) or "\nParameters\n---" in docstring:
        return kind.__doc__
    public = [one for one in fields(kind) if one.init and not one.name.startswith("_")]
    section = "\n".join(["\n\nParameters\n----------", *map(_entry, public)])
    if "\nRaises\n---" not in docstring:
        section += "\n\nRaises\n------\nArgumentError\n    If a value is out of its range."
    other = re.search(r"\n\n[^\n]+\n---", docstring)
    end = other.start() if other else len(docstring)
    return f"{docstring[:end]}{section}{docstring[end:]}\n"


_TYPES: Mapping[type, str] = {Number: "float", Whole: "int", Switch: "bool", Text: "str"}


def _entry(one: Field[Any]) -> str:
    """Return the entry of one parameter in a numpydoc section."""
    kind, default = one.metadata.get("kind"), one.default
    what = _TYPES.get(type(kind), str(one.type))
    if kind is None:
        optional = default is not MISSING or one.default_factory is not MISSING
        return f"{one.name} : {what}" + (", optional" if optional else "")
    if isinstance(kind, Choice):
        what = f"{{{kind.legal}}}"
    if one.default_factory is not MISSING or default in (None, inf, -inf):
        what += ", optional"
    elif default is not MISSING:
        what += f", default {default!r}"
    meaning = kind.help.rstrip(".")
    if isinstance(kind, Number | Whole):
        meaning += f", {kind.legal}" + (f" [{kind.unit}]" if kind.unit else "")
    return f"{one.name} : {what}\n    {meaning}."
