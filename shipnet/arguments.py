"""Checks of arguments against a function's annotations."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import is_dataclass
from enum import Enum
from functools import wraps
from importlib import import_module
from inspect import Parameter, isfunction, signature
from numbers import Number, Real
from os import PathLike
from types import ModuleType, NoneType, UnionType
from typing import Any, Literal, NamedTuple, TypeVar, Union, get_args, get_origin

from shipnet.errors import ArgumentError, FrameError, InputError
from shipnet.fields import declared

T = TypeVar("T")


class _Rule(NamedTuple):
    """A type's legal values: `test` runs before a call, `after` (if given) after a failed call."""

    test: Callable[[Any], bool]
    legal: str
    after: Callable[[Any], bool] | None = None
    of_type: bool = False
    within: Sequence[_Rule] = ()


def checked(made: T) -> T:
    """Make a function, or a class's public methods, check arguments against their annotations.

    Numbers are not checked before the call, because the function itself checks their ranges. If it
    fails without naming an argument, an ArgumentError names the first illegal one, if any. Declared
    fields have their own checks.
    """
    if not isinstance(made, type):
        return _checked(made, ())  # type: ignore[no-any-return] # it is called as before
    own: Collection[str] = declared(made) if is_dataclass(made) else ()
    for name, value in list(vars(made).items()):
        function = getattr(value, "__func__", value)
        if isfunction(function) and (name == "__init__" or name[0] != "_"):
            new = _checked(function, own if name == "__init__" else ())
            setattr(made, name, new if function is value else type(value)(new))
    return made


def _checked(function: Any, skipped: Collection[str]) -> Any:
    """Return a function that checks its arguments, or `function` if there is nothing to check."""
    parameters = signature(function).parameters
    given = {
        name: one
        for name, one in parameters.items()
        if one.annotation is not one.empty
        and name not in skipped
        and one.kind not in (Parameter.VAR_POSITIONAL, Parameter.VAR_KEYWORD)
    }
    if not given:
        return function
    names = tuple(parameters)

    known: dict[str, list[_Rule]] = {}
    #: Types already found legal, by the argument's name and by its position.
    passed: dict[str, set[type]] = {}
    places: list[set[type] | None] = []

    def check(name: str, value: Any, failed: bool) -> None:
        allowed = known.get(name)
        if allowed and value is not given[name].default and not _met(allowed, value, failed):
            raise ArgumentError(_fault(name, value, allowed, failed)) from None
        if failed and hasattr(value, "dtype") and value.size == 0:  # a table may be empty
            raise ArgumentError(f"{name} is {value!r}; it must not be empty") from None
        if not failed and any(rule.of_type and rule.test(value) for rule in known[name]):
            passed[name].add(type(value))

    @wraps(function)
    def call(*args: Any, **options: Any) -> Any:
        if not known:
            scope = function.__globals__
            known.update({name: _rules(one.annotation, scope) for name, one in given.items()})
            passed.update({name: set() for name, one in known.items() if not _numbers(one)})
            places.extend(map(passed.get, names))
        for types, name, value in zip(places, names, args):  # noqa: B905 # strict= costs time
            if types is not None and type(value) not in types:
                check(name, value, False)
        for name, value in options.items():
            if name in passed and type(value) not in passed[name]:
                check(name, value, False)
        try:
            return function(*args, **options)
        except (FrameError, InputError):
            raise
        except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError) as error:
            said = str(error) if isinstance(error, ArgumentError) else ""
            if not any(re.search(rf"\b{name}\b", said) for name in names):
                for name, value in (*zip(names, args, strict=False), *options.items()):
                    if name in known:
                        check(name, value, True)
            raise

    return call


def _met(rules: Sequence[_Rule], value: Any, failed: bool = False) -> bool:
    """Return whether a value meets one of the rules; after a `failed` call, tests are stricter."""
    return any(((failed and rule.after) or rule.test)(value) for rule in rules)


def _fault(name: str, value: Any, rules: Sequence[_Rule], failed: bool) -> str:
    """Return the message for a wrong value, or for the first wrong value in a collection."""
    for rule in rules:
        if rule.within and isinstance(value, Collection) and not isinstance(value, str | bytes):
            for part in value.values() if isinstance(value, Mapping) else value:
                if not _met(rule.within, part, failed):
                    of = name if name.startswith("one of ") else f"one of {name}"
                    return _fault(of, part, rule.within, failed)
    return f"{name} is {value!r}; it must be {_legal(rules)}"


def _legal(rules: Sequence[_Rule]) -> str:
    return " or ".join(dict.fromkeys(rule.legal for rule in rules))


def _numbers(rules: list[_Rule]) -> bool:
    """Return whether every value is accepted before a call, and tested only if the call fails."""
    return not rules or any(rule.test is _anything for rule in rules)


def _anything(value: Any) -> bool:
    return True


def _rules(annotation: Any, scope: dict[str, Any]) -> list[_Rule]:
    """Return the rules of an annotation; an empty list if one of its parts cannot be tested."""
    rules = [_rule(part, scope) for part in _parts(annotation, scope)]
    return [] if None in rules else [rule for rule in rules if rule is not None]


def _parts(annotation: Any, scope: dict[str, Any]) -> Iterator[Any]:
    """Yield the types of a union; a type whose name cannot be resolved becomes Any."""
    if isinstance(annotation, str):
        parts, depth = [""], 0
        for sign in annotation.strip(" '\""):
            depth += (sign == "[") - (sign == "]")
            if sign == "|" and not depth:
                parts.append("")
            else:
                parts[-1] += sign
        for part in map(str.strip, parts):
            if part in _NAMED:
                yield part
                continue
            try:
                kind = eval(part, {}, _Names(scope))
            except (AttributeError, NameError, TypeError):
                kind = Any
            yield from _parts(kind, scope)
    elif get_origin(annotation) in (Union, UnionType):
        for part in get_args(annotation):
            yield from _parts(part, scope)
    else:
        yield annotation


class _Names(dict[str, Any]):
    """Names that annotations can use: those of the module and of its package's public API."""

    def __missing__(self, name: str) -> Any:
        if name in dir(_front(self)):
            return getattr(_front(self), name)
        raise KeyError(name)


def _front(scope: Mapping[str, Any]) -> ModuleType:
    """Return the package to which a module belongs."""
    return import_module(".".join(scope["__name__"].split(".")[:2]))


def _rule(kind: Any, scope: dict[str, Any]) -> _Rule | None:
    """Return the rule of a type; None if the type cannot be tested."""
    origin, inner = get_origin(kind) or (NoneType if kind is None else kind), get_args(kind)
    if origin is Literal:
        legal = f"one of {', '.join(map(repr, inner))}"
        return _Rule(lambda value: isinstance(value, str | int) and value in inner, legal)
    if origin in _NAMED:
        return _NAMED[origin]
    if origin in (Any, object) or not isinstance(origin, type):
        return None
    article = "an" if origin.__name__[0] in "AEIOaeio" else "a"
    if getattr(origin, "_is_protocol", False):
        wanted = [name for name, one in vars(origin).items() if name[0] != "_" and callable(one)]
        has = lambda value: all(hasattr(value, name) for name in wanted)  # noqa: E731
        return _Rule(has, f"{article} {origin.__name__}") if wanted else None
    if origin.__name__ == "ndarray":  # arrays of text are not checked
        return None if "str_" in str(inner) else _NAMED["npt.ArrayLike"]
    if issubclass(origin, Mapping):
        return _collection(Mapping, "a mapping", _rules(inner[-1], scope) if inner else [])
    if origin in (tuple, list, set, frozenset) or origin.__module__ == Iterable.__module__:
        parts = [_rules(one, scope) for one in inner if one is not ...]
        within = [] if [] in parts else [rule for rules in parts for rule in rules]
        return _collection(Iterable, "a sequence", within)
    if issubclass(origin, Enum):
        return _Rule(lambda value: _is_member(origin, value), f"{article} {origin.__name__}")
    if origin.__subclasses__() and origin.__name__ not in dir(_front(scope)):
        return None  # base classes outside the public API are not checked
    return _Rule(_of(origin), f"{article} {origin.__name__}", of_type=True)


def _collection(kind: type, name: str, within: list[_Rule]) -> _Rule:
    """Return the rule of a collection; the elements of an iterator cannot be checked."""
    plain = not within or any(rule.after for rule in within)
    by_type = all(rule.of_type for rule in within)

    def test(value: Any, failed: bool = False) -> bool:
        if not isinstance(value, kind) or isinstance(value, str | bytes):
            return False
        if (plain and not failed) or not isinstance(value, Collection):
            return True
        parts = value.values() if isinstance(value, Mapping) and kind is Mapping else value
        if by_type:
            parts = {type(part): part for part in parts}.values()
        return not within or all(_met(within, part, failed) for part in parts)

    legal = f"{name} in which each value is {_legal(within)}" if within else name
    return _Rule(test, legal, lambda value: test(value, True), plain, within)


def _is_member(kind: type[Enum], value: Any) -> bool:
    try:
        return kind(value) is not None
    except ValueError:
        return False


def _is_whole(value: Any) -> bool:
    return _is_number(value) and value % 1 == 0


def _is_number(value: Any) -> bool:
    return isinstance(value, Real) and not isinstance(value, bool) and value == value


def _is_array(value: Any) -> bool:
    """Return whether a value is an array of numbers that are not all NaN."""
    import numpy as np  # slow to import, and rarely needed here

    try:
        array = np.asarray(value)
    except ValueError:  # rows of different lengths
        return False
    return array.dtype.kind in "biufc" and not (array.size and (array != array).all())


def _may_be_array(value: Any) -> bool:
    """Return whether a value may become an array; its content is tested only if a call fails."""
    if isinstance(value, str | bytes):
        return False
    return isinstance(value, Number | Iterable) or hasattr(value, "__array__")


def _of(*kinds: type) -> Callable[[Any], bool]:
    return lambda value: isinstance(value, kinds)


#: Rules by type, or by a type's name if importing the type would load a library needlessly.
_NAMED: Mapping[Any, _Rule] = {
    NoneType: _Rule(_of(NoneType), "None", of_type=True),
    str: _Rule(_of(str), "text", of_type=True),
    bytes: _Rule(_of(bytes, bytearray, memoryview), "bytes", of_type=True),
    bool: _Rule(
        lambda value: type(value).__name__ in ("bool", "bool_"), "True or False", of_type=True
    ),
    PathLike: _Rule(_of(PathLike), "a path", of_type=True),
    Callable: _Rule(callable, "a function"),
    float: _Rule(_anything, "a number", _is_number),
    int: _Rule(_anything, "a whole number", _is_whole),
    "Axes": _Rule(lambda value: hasattr(value, "add_patch"), "an Axes"),
    "npt.ArrayLike": _Rule(_may_be_array, "numbers", _is_array, of_type=True),
    "pd.DataFrame": _Rule(
        lambda value: type(value).__name__ == "DataFrame", "a DataFrame", of_type=True
    ),
}
