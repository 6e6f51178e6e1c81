"""A wrong value for a number of a public function or class is an error.

The legal calls are those of the doctests: each is repeated with a mistake in one of its numbers.
"""

import doctest
import importlib
import inspect
import math
import re
import types
from contextlib import ExitStack, redirect_stdout
from copy import copy
from dataclasses import is_dataclass
from functools import wraps
from io import StringIO
from pathlib import Path
from unittest.mock import patch

import numpy as np
import pytest

import shipnet
from shipnet.errors import ArgumentError
from shipnet.fields import Number, declared

ROOT = Path(shipnet.__file__).parent
FRONTS = sorted({path.parent.name for path in ROOT.glob("*/__init__.pyi")} - {"papers", "tools"})

#: What a caller may pass by mistake where a number is expected.
MISTAKES = {"text": "x?", "NaN": math.nan, "None": None, "list": [], "object": object()}

#: Called by simulations and servers, with what they have checked.
HOOKS = set("answer apply device disturbance first_sign of run transit view voltage".split())

#: Mistakes that a call accepts, by call and argument.
TAKEN = {
    "decode.sample_interval": "text NaN list object",  # the doctest's records have one of their own
    "decode.dt": "text NaN list object",
    "Rule.meets.computed": "NaN",
    "simulate.idle_step": "text NaN list object",  # valves that are polled have no idle steps
    "Decision.explain.index": "list",  # NumPy takes a list of samples
    "Decision.codes.index": "list",
}


def public(front):
    """Yield the public functions and classes of a package and its namespaces."""
    module = importlib.import_module(f"shipnet.{front}")
    for name in module.__all__:
        value = getattr(module, name)
        inner = value.__all__ if isinstance(value, types.ModuleType) else ()
        yield from ((f"{name}.{each}", getattr(value, each)) for each in inner)
        if not inner:
            yield name, value


def recorded(calls, name, function):
    """Return the function that also keeps the arguments of its first call."""

    @wraps(function)
    def call(*arguments, **options):
        bound = inspect.signature(function).bind(*arguments, **options)
        bound.apply_defaults()
        calls.setdefault(name, (function, bound))
        return function(*arguments, **options)

    return call


def calls(front):
    """Return the legal calls in the doctests of a package: name -> function, arguments."""
    found, modules = {}, {}
    with ExitStack() as stack:
        for name, value in public(front):
            if not (inspect.isfunction(value) or inspect.isclass(value)):
                continue
            module = inspect.getmodule(value)
            modules[module] = None  # in order, unlike a set
            if inspect.isfunction(value):
                new = recorded(found, name, value)
                stack.enter_context(patch.object(module, value.__name__, new))
                continue
            for method, function in list(vars(value).items()):
                if inspect.isfunction(function) and method[0] != "_" and method not in HOOKS:
                    new = recorded(found, f"{name}.{method}", function)
                    stack.enter_context(patch.object(value, method, new))
        for module in modules:
            with redirect_stdout(StringIO()):
                doctest.testmod(module, optionflags=doctest.ELLIPSIS)
    return found


@pytest.mark.parametrize("front", FRONTS)
def test_a_mistake_in_a_number_is_not_silent(front, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    silent, tried = [], 0
    for name, (function, bound) in calls(front).items():
        for argument, parameter in bound.signature.parameters.items():
            single = re.fullmatch(r"(float|int)( \| None)?", str(parameter.annotation))
            if not single or parameter.kind is parameter.VAR_KEYWORD:
                continue
            for kind, mistake in MISTAKES.items():
                if mistake is None and "None" in str(parameter):
                    continue
                wrong = copy(bound)
                wrong.arguments = bound.arguments | {argument: mistake}
                tried += 1
                try:
                    with np.errstate(invalid="ignore"):
                        function(*wrong.args, **wrong.kwargs)
                except Exception:
                    continue
                if kind not in TAKEN.get(f"{name}.{argument}", ""):
                    silent.append(f"{name}({argument}={kind})")
    assert tried
    assert not silent, "\n".join(silent)


@pytest.mark.parametrize("front", FRONTS)
def test_a_declared_number_refuses_what_is_not_one_and_names_the_field(front):
    for _, kind in public(front):
        if not (inspect.isclass(kind) and is_dataclass(kind)):
            continue
        for field, declaration in declared(kind).items():
            if not isinstance(declaration, Number) or getattr(declaration, "at_most", ""):
                continue
            legal = {"None"} if declaration.optional else set()
            legal |= {"NaN"} if declaration.missing else set()
            for mistake in {*MISTAKES, "bool"} - legal:
                with pytest.raises(ArgumentError, match=rf"\b{field}\b"):
                    declaration.check(field, MISTAKES.get(mistake, True), None)
