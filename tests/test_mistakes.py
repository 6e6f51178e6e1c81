"""A wrong value for a number of any public function or class is an error."""

import importlib
import inspect
import math
import re
import types
from dataclasses import is_dataclass

import numpy as np
import pytest

from shipnet.errors import ArgumentError
from shipnet.fields import Number, Whole, declared
from tests import front_calls

FRONTS = sorted(name[3:] for name in vars(front_calls) if name.startswith("of_"))

#: What a caller may pass by mistake where a number is expected.
MISTAKES = {"text": "x?", "NaN": math.nan, "None": None, "list": [], "object": object()}


def is_number(parameter):
    """Return whether a parameter is a single number."""
    return re.fullmatch(r"(float|int)( \| None)?", str(parameter.annotation))


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


@pytest.mark.parametrize("front", FRONTS)
def test_a_mistake_in_a_number_is_not_silent(front, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    silent = []
    for name, function, good in calls(front):
        for argument, value in good.items():
            parameter = inspect.signature(function).parameters[argument]
            if not is_number(parameter):
                continue
            legal = front_calls.TAKEN.get(f"{name}.{argument}", "").split()
            for kind, mistake in MISTAKES.items():
                if mistake is value or (mistake is None and "None" in str(parameter)):
                    continue
                try:
                    with np.errstate(invalid="ignore"):
                        function(**good | {argument: mistake})
                except Exception:
                    continue
                if kind not in legal:
                    silent.append(f"{name}({argument}={kind})")
    assert not silent, "\n".join(silent)


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
            except Exception:
                continue
            found.append(f"{name}({argument}={value + 0.5}) is not refused")
    assert not found, "\n".join(found)


@pytest.mark.parametrize("front", FRONTS)
def test_a_declared_number_refuses_what_is_not_one_and_names_the_field(front):
    for _, kind in public(front):
        if not (inspect.isclass(kind) and is_dataclass(kind)):
            continue
        for field, declaration in declared(kind).items():
            if not isinstance(declaration, Number | Whole) or getattr(declaration, "at_most", ""):
                continue
            legal = {"None"} if declaration.optional else set()
            legal |= {"NaN"} if getattr(declaration, "missing", False) else set()
            for mistake in {*MISTAKES, "bool"} - legal:
                with pytest.raises(ArgumentError, match=rf"\b{field}\b"):
                    declaration.check(field, MISTAKES.get(mistake, True), None)
