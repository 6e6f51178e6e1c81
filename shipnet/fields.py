"""Fields that declare their range, unit and meaning in one place.

The check, its error text, the documentation, the settings file and the widget are derived from the
declaration. The functions ``check_...`` check single arguments and raise errors of the same form.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import MISSING, dataclass, field, fields
from functools import cache
from inspect import cleandoc
from math import inf, isnan
from numbers import Real
from operator import index
from typing import TYPE_CHECKING, Any, TypeAlias, TypeVar, dataclass_transform, overload

from shipnet.errors import ArgumentError

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt

T = TypeVar("T")

#: One value, or one per tree of a Monte Carlo simulation.
Quantity: TypeAlias = "float | npt.NDArray[np.float64]"


# Checks of one value ---------------------------------------------------------------------------


def _legal(low: float, high: float, unit: str) -> str:
    """Return a range in words."""
    behind = f" {unit}" if unit else ""
    return f"{low:g}..{high:g}{behind}"


def check_quantity(what: str, value: Any, unit: str, *, low: float = 0.0, high: float) -> Quantity:
    """Return a value as a float or a read-only array of floats, or raise if it is out of range."""
    # A network has hundreds of such numbers, so checking a legal one must take only 1 us.
    if type(value) in (float, int) and low <= value <= high:
        return float(value)
    import numpy as np  # slow to import, and rarely needed here

    legal = _legal(low, high, unit)
    try:
        array = np.asarray(value)
        if array.dtype.kind not in "iuf" or array.ndim > 1 or array.size == 0:
            raise ValueError
    except (TypeError, ValueError, OverflowError):
        raise ArgumentError(
            f"{what} is {value!r}; it must be a number or a 1-D array of numbers, {legal}"
        ) from None
    array = array.astype(float)
    good = (array >= low) & (array <= high)
    if not good.all():
        where = "" if array.ndim == 0 else f" in tree {int(np.argmin(good))}"
        worst = float(array.reshape(-1)[np.argmin(good)])
        given = f"{worst:g} {unit}".rstrip()
        raise ArgumentError(f"{what} is {given}{where}; it must be {legal}")
    if array.ndim == 0:
        return float(array)
    array.flags.writeable = False
    return array


def check_scalar(what: str, value: Any, unit: str, low: float, high: float) -> float:
    """Return a value as a float, or raise if it is not a single number or is out of range."""
    number = check_quantity(what, value, unit, low=low, high=high)
    if not isinstance(number, float):
        raise ArgumentError(f"{what} is {value!r}; it must be a single number")
    return number


def check_trees(what: str, known: int | None, *values: Quantity | None) -> int | None:
    """Return how many Monte Carlo trees `values` describe, or `known` if none is an array."""
    for value in values:
        if value is not None and not isinstance(value, float):
            if known is not None and len(value) != known:
                raise ArgumentError(f"{what} has values for {len(value)} trees, others for {known}")
            known = len(value)
    return known


def check_whole(name: str, value: int, low: int, high: int, why: str = "") -> int:
    """Return a whole number such as 3 or 3.0 as an int; raise if it is out of range or not whole.

    `why` ends the message. A bool does not count as a number.
    """
    if type(value) is int and low <= value <= high:
        return value
    try:
        whole = None if isinstance(value, bool) else index(value)
    except TypeError:
        whole = int(value) if isinstance(value, Real) and value % 1 == 0 else None
    if whole is None or not low <= whole <= high:
        raise ArgumentError(f"{name} is {value!r}; it must be a whole number {low}..{high}{why}")
    return whole


def check_choice(name: str, value: Any, options: Iterable[str]) -> str:
    """Return a value, or raise if it is not one of the given strings."""
    known = tuple(options)
    if not (isinstance(value, str) and value in known):
        legal = ", ".join(map(repr, known))
        raise ArgumentError(f"{name} is {value!r}; it must be one of {legal}")
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


# Kinds of fields -------------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class Kind:
    """Base class of all kinds of fields.

    `help` explains the field, `label` is the text beside its control, and `optional` makes None
    legal.
    """

    help: str = ""
    label: str = ""
    unit: str = ""
    optional: bool = False

    @property
    def legal(self) -> str:
        """The legal values in words, without the unit."""
        raise NotImplementedError

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
    step: float = 1.0
    shown: tuple[float, float]
    missing: bool = False
    many: bool = False

    @property
    def legal(self) -> str:
        """The range."""
        return _legal(self.low, self.high, "")

    def _check(self, name: str, value: Any, record: Any) -> Any:
        if self.many:
            return check_quantity(name, value, self.unit, low=self.low, high=self.high)
        if type(value) is float and self.low <= value <= self.high:
            return value  # most values take this fast path
        plain = isinstance(value, Real) and not isinstance(value, bool)
        if self.missing and plain and isnan(value):
            return float(value)
        self._within(name, value, plain, self.low, self.high, "it must be")
        return float(value)

    def check_shown(self, name: str, value: Any) -> None:
        """Raise ArgumentError if the value is outside the range of the slider."""
        self._within(name, value, True, *self.shown, "its slider shows")

    def _within(
        self, name: str, value: Any, plain: bool, low: float, high: float, rule: str
    ) -> None:
        if not (plain and low <= value <= high):
            unit = f" {self.unit}" if self.unit else ""
            given = f"{value:g}{unit}" if plain and not abs(value) > 1e300 else repr(value)
            raise ArgumentError(f"{name} is {given}; {rule} {_legal(low, high, self.unit)}")


@dataclass(frozen=True, kw_only=True)
class Whole(Kind):
    """A whole number, without a slider if `typed`; an earlier field, `at_most`, may limit it."""

    low: int
    high: int
    shown: tuple[int, int]
    at_most: str = ""
    typed: bool = False

    @property
    def legal(self) -> str:
        """The range."""
        return f"{self.low}..{self.high}"

    def _check(self, name: str, value: Any, record: Any) -> int:
        if not self.at_most:
            return check_whole(name, value, self.low, self.high)
        other = getattr(record, self.at_most)
        why = f", because {self.at_most} is {other}"
        return check_whole(name, value, self.low, min(self.high, other), why)

    def check_shown(self, name: str, value: Any) -> None:
        """Raise ArgumentError if the value is outside the range of the slider."""
        low, high = self.shown
        if not low <= value <= high:
            raise ArgumentError(f"{name} is {value}; its slider shows {low}..{high}")


@dataclass(frozen=True, kw_only=True)
class Choice(Kind):
    """One of several strings or whole numbers, each with the text shown for it."""

    options: Mapping[Any, str]
    slider: bool = False

    @property
    def legal(self) -> str:
        """All values."""
        return ", ".join(map(repr, self.options))

    def _check(self, name: str, value: Any, record: Any) -> Any:
        plain = isinstance(value, str | Real) and not isinstance(value, bool)
        if not (plain and value in self.options):
            raise ArgumentError(f"{name} is {value!r}; it must be one of {self.legal}")
        return next(one for one in self.options if one == value)  # 8 if 8.0 is given


@dataclass(frozen=True, kw_only=True)
class Switch(Kind):
    """Yes or no."""

    legal = "True, False"

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

    @property
    def legal(self) -> str:
        """The length."""
        return f"text of up to {self.most} characters"

    def _check(self, name: str, value: Any, record: Any) -> str:
        if not isinstance(value, str):
            raise ArgumentError(f"{name} is {value!r}; it must be text")
        if len(value) > self.most:
            raise ArgumentError(f"{name} has {len(value)} characters; the limit is {self.most}")
        return value


@dataclass(frozen=True, kw_only=True)
class Series(Kind):
    """At most `most` strings from `known`, which may repeat; the controls are buttons."""

    known: tuple[str, ...]
    most: int

    @property
    def legal(self) -> str:
        """The legal strings and their maximum number, in words."""
        return f"up to {self.most} values, each one of {', '.join(map(repr, self.known))}"

    def _check(self, name: str, value: Any, record: Any) -> tuple[str, ...]:
        if not isinstance(value, tuple):
            raise ArgumentError(f"{name} is {value!r}; it must be a tuple of {self.known}")
        for one in value:
            if one not in self.known:
                raise ArgumentError(f"one of {name} is {one!r}; it must be one of {self.known}")
        if len(value) > self.most:
            raise ArgumentError(f"there are {len(value)} {name}; the limit is {self.most}")
        return value


@dataclass(frozen=True, kw_only=True)
class Part(Kind):
    """An object of the class `of`; `make`, if given, makes one from a value of another class."""

    of: type
    make: Callable[[Any], Any] | None = None

    @property
    def legal(self) -> str:
        """The class."""
        return f"a {self.of.__name__}"

    def _check(self, name: str, value: Any, record: Any) -> Any:
        if self.make is not None and not isinstance(value, self.of):
            return self.make(value)
        return check_kind(name, value, self.of)


# Declarations ----------------------------------------------------------------------------------


def _declare(
    of: type[Kind],
    /,
    *,
    default: Any = MISSING,
    default_factory: Any = MISSING,
    kw_only: bool = False,
    **declares: Any,
) -> Any:
    """Return a dataclass field with a declaration of the class `of`, made from `declares`."""
    metadata = {"kind": of(**declares)}
    return field(
        default=default, default_factory=default_factory, kw_only=kw_only, metadata=metadata
    )


def _ranged(
    of: type[Kind],
    low: float,
    high: float,
    unit: str,
    help: str,
    slider: tuple[float, float] | None = None,
    **options: Any,
) -> Any:
    shown = slider or (low, high)
    return _declare(of, low=low, high=high, unit=unit, help=help, shown=shown, **options)


# Each function also takes the attributes of its kind and the keyword arguments of `_declare`.


def number(low: float, high: float, unit: str = "", help: str = "", **options: Any) -> Any:
    """Declare a `Number` from `low` to `high`; `slider` is the range of its slider."""
    return _ranged(Number, low, high, unit, help, **options)


def whole(low: int, high: int, unit: str = "", help: str = "", **options: Any) -> Any:
    """Declare a `Whole` number from `low` to `high`; `slider` is the range of its slider."""
    return _ranged(Whole, low, high, unit, help, **options)


def choice(options: Mapping[Any, str] | Iterable[Any], help: str = "", **others: Any) -> Any:
    """Declare a `Choice` of several values; a mapping gives the text shown for each."""
    if not isinstance(options, Mapping):
        options = {value: str(value) for value in options}
    return _declare(Choice, options=options, help=help, **others)


def switch(help: str = "", **options: Any) -> Any:
    """Declare a field that is True or False."""
    return _declare(Switch, help=help, **options)


def text(help: str = "", **options: Any) -> Any:
    """Declare `Text`."""
    return _declare(Text, help=help, **options)


def series(known: Iterable[str], **options: Any) -> Any:
    """Declare a `Series` of strings, each added by a button."""
    return _declare(Series, known=tuple(known), **options)


def part(of: type, help: str = "", **options: Any) -> Any:
    """Declare a `Part`: an object of the class `of`."""
    return _declare(Part, of=of, help=help, **options)


# Records ---------------------------------------------------------------------------------------


def declared(kind: type) -> dict[str, Kind]:
    """Return the declarations of a dataclass's fields, by name and in order."""
    return {one.name: one.metadata["kind"] for one in fields(kind) if "kind" in one.metadata}


@cache
def _declared(kind: type) -> tuple[tuple[str, Kind], ...]:
    """Return the declarations as pairs of name and kind, cached for each class."""
    return tuple(declared(kind).items())


def check(made: Any) -> None:
    """Check the declared fields of a dataclass instance; store the values the checks return."""
    for name, kind in _declared(type(made)):  # type: ignore[arg-type] # a class is hashable
        given = getattr(made, name)
        value = kind.check(name, given, made)
        if value is not given:
            object.__setattr__(made, name, value)


@overload
def record(kind: type[T], /) -> type[T]: ...


@overload
def record(
    *, kw_only: bool = False, slots: bool = False, repr: bool = True, eq: bool = True
) -> Callable[[type[T]], type[T]]: ...


@dataclass_transform(
    frozen_default=True, field_specifiers=(number, whole, choice, switch, text, series, part, field)
)
def record(kind: type[T] | None = None, /, **options: bool) -> Any:
    """Make a frozen dataclass that checks its declared fields before its own ``__post_init__``.

    If a docstring has no Parameters section, that and a missing Raises section are generated.
    """

    def make(kind: type[T]) -> type[T]:
        own = kind.__dict__.get("__post_init__")
        inherited = getattr(kind, "__post_init__", None)
        if own is not None or not getattr(inherited, "_checks", False):

            def __post_init__(self: Any) -> None:
                check(self)
                if inherited is not None:
                    inherited(self)

            __post_init__._checks = True  # type: ignore[attr-defined]
            kind.__post_init__ = __post_init__  # type: ignore[attr-defined]
        made = dataclass(frozen=True, **options)(kind)
        made.__doc__ = _documented(made)
        return made

    return make if kind is None else make(kind)


def _documented(kind: type) -> str | None:
    """Return the docstring of a record with the sections that describe its declared fields."""
    docstring = kind.__doc__
    if not docstring or kind.__dict__.get("__doc__") is None:
        return docstring
    docstring = cleandoc(docstring)
    if "\nParameters\n---" in docstring:
        return docstring
    lines = []
    for one in fields(kind):
        if not one.init or one.name.startswith("_"):
            continue
        declared = one.metadata.get("kind")
        default = one.default if one.default_factory is MISSING else None
        lines += _entry(one.name, declared, default, str(one.type))
    if not any("kind" in one.metadata for one in fields(kind)):
        return docstring
    section = "\n".join(["Parameters", "----------", *lines])
    if "\nRaises\n---" not in docstring:
        section += "\n\nRaises\n------\nArgumentError\n    If a value is out of its range."
    head, underline, rest = docstring.partition("\n----")
    if not underline:
        return f"{docstring}\n\n{section}\n"
    head, _, title = head.rpartition("\n")
    return f"{head.rstrip()}\n\n{section}\n\n{title}\n----{rest}"


_TYPES: Mapping[type, str] = {
    Number: "float", Whole: "int", Switch: "bool", Text: "str", Series: "tuple of str",
}  # fmt: skip


def _entry(name: str, kind: Kind | None, default: Any, annotation: str) -> list[str]:
    """Return the lines of one parameter in a numpydoc section."""
    if kind is None:
        return [f"{name} : {annotation}" + ("" if default is MISSING else ", optional")]
    what = _TYPES.get(type(kind), annotation)
    if isinstance(kind, Choice):
        what = f"{{{kind.legal}}}"
    if default is not MISSING:
        plain = default is None or default in (inf, -inf)
        what += ", optional" if plain else f", default {default!r}"
    says = kind.help.rstrip(".")
    if isinstance(kind, Number | Whole):
        says += f", {kind.legal}" + (f" [{kind.unit}]" if kind.unit else "")
    return [f"{name} : {what}", f"    {says}."]
