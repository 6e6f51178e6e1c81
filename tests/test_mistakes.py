"""An illegal argument of any public function or class is an error that names the argument."""

import importlib
import inspect
import re
import types

import numpy as np
import pytest

from shipnet.errors import ArgumentError, FrameError, InputError
from tests import front_calls
from tests.support import MISTAKES

FRONTS = sorted(name[3:] for name in vars(front_calls) if name.startswith("of_"))

#: Mistakes that an annotation allows: as an array, NaN is a value like others.
ARRAYS = r"ArrayLike|Floats|Complexes|Integers|Words|Bits|Bytes|Bools|NDArray|Quantity|Samples"
ALLOWED = {
    "None": r"\bNone\b",
    "text": r"\bstr\b|PathLike",
    "path": "PathLike",
    "nan": ARRAYS,
    "empty": rf"{ARRAYS}|Sequence|Iterable|Collection|tuple|list|RNGLike|Faults",
}


def allowed(name, parameter):
    """Return the mistakes that a parameter may take."""
    plain, before = str(parameter.annotation), ""
    while plain != before:
        plain, before = re.sub(r"\[[^\[\]]*\]", "", plain), plain
    if re.search(r"\b(Any|object)\b", plain):
        return set(MISTAKES) if parameter.name != "rng" else {"None", "empty"}
    found = {kind for kind, pattern in ALLOWED.items() if re.search(pattern, plain)}
    found |= {"None", "empty"} if parameter.name == "rng" else set()
    found |= {"None"} if parameter.default is None else set()
    return found | set(front_calls.TAKEN.get(f"{name}.{parameter.name}", "").split())


def public(front):
    """Yield the public functions and classes of a package and its namespaces, except in papers."""
    module = importlib.import_module(f"shipnet.{front}")
    for name in module.__all__:
        value = getattr(module, name)
        if not isinstance(value, types.ModuleType):
            yield name, value
        elif front != "papers":
            yield from ((f"{name}.{inner}", getattr(value, inner)) for inner in value.__all__)


def methods(kind):
    """Return the names of the public methods that a class has from this package."""
    bases = [base for base in kind.__mro__ if base.__module__.startswith("shipnet")]
    return {
        name
        for base in bases
        for name, value in list(vars(base).items())
        if name[0] != "_" and inspect.isfunction(getattr(value, "__func__", value))
    } - front_calls.HOOKS


def legal(name, function, good):
    """Return the legal arguments of a call by name."""
    found = {}
    for key, one in inspect.signature(function).parameters.items():
        if one.kind in (one.VAR_POSITIONAL, one.VAR_KEYWORD) or key[0] == "_":
            continue
        if key == "ax":
            found[key] = front_calls.AX
        elif f"{name}.{key}" in good or one.default is one.empty:
            found[key] = good[f"{name}.{key}" if f"{name}.{key}" in good else key]
        else:
            found[key] = one.default
    return found


def calls(front):
    """Yield each public callable of a package: its name, itself, its legal arguments."""
    good, instances = getattr(front_calls, f"of_{front}")()
    results = front_calls.RESULTS.get(front, "").split()
    for name, value in public(front):
        if inspect.isfunction(value):
            yield name, value, legal(name, value, good)
        if not inspect.isclass(value) or issubclass(value, Exception):
            continue
        if name not in results:
            yield name, value, legal(name, value, good)
        for method in sorted(methods(value)):
            owner = value
            if inspect.isfunction(inspect.getattr_static(value, method)):
                if name not in instances:
                    instances[name] = value(**legal(name, value, good))
                owner = instances[name]
            if owner is not None:
                function = getattr(owner, method)
                yield f"{name}.{method}", function, legal(f"{name}.{method}", function, good)


def similar(value):
    """Return what can be compared of a result: its text, without places in memory and NumPy."""
    return re.sub(r"0x[0-9a-f]{6,}|np\.float64\((.*?)\)", r"\1", repr(value))


def fault(function, good, argument, kind, taken):
    """Return what is wrong with the answer to a mistake, None if nothing is."""
    try:
        with np.errstate(invalid="ignore"):
            function(**good | {argument: MISTAKES[kind]})
    except (InputError, FrameError):
        return None  # of what the file or the bits hold
    except ArgumentError as error:
        if not re.search(rf"\b{argument}\b", str(error)):
            return f"is not named: {error}"
        return "has a long message" if len(str(error)) > 400 else None
    except OSError as error:
        return None if kind in taken and kind in ("text", "path") else f"raises {error!r}"
    except Exception as error:
        return f"raises {error!r}"
    return None if kind in taken else "is taken"


@pytest.mark.parametrize("front", FRONTS)
def test_a_mistake_in_an_argument_is_an_error_that_names_it(front, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    found = []
    for name, function, good in calls(front):
        for argument, value in good.items():
            taken = allowed(name, inspect.signature(function).parameters[argument])
            for kind, mistake in MISTAKES.items():
                if mistake is value or (argument in ("ax", "axes") and mistake is None):
                    continue
                if said := fault(function, good, argument, kind, taken):
                    found.append(f"{name}({argument}={kind}) {said}")
    assert not found, "\n".join(found)


@pytest.mark.parametrize("front", FRONTS)
def test_a_whole_number_may_be_a_float(front, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    found = []
    for name, function, good in calls(front):
        for argument, value in good.items():
            annotation = str(inspect.signature(function).parameters[argument].annotation)
            if type(value) is not int or not re.fullmatch(r"int( \| None)?", annotation):
                continue
            for same in (float(value), np.int64(value)):
                try:
                    result = function(**good | {argument: same})
                except Exception as error:
                    found.append(f"{name}({argument}={same!r}) raises {error!r}")
                else:
                    if "rng" not in good and similar(result) != similar(function(**good)):
                        found.append(f"{name}({argument}={same!r}) is another: {result!r}")
            try:
                function(**good | {argument: value + 0.5})
            except ArgumentError as error:
                if re.search(rf"\b{argument}\b", str(error)):
                    continue
            found.append(f"{name}({argument}={value + 0.5}) is no error that names it")
    assert not found, "\n".join(found)
