"""Which function recomputes which claim, draws which figure and generates which table.

The function of a *numeric* claim returns our number; that of a *qualitative* one says whether the
statement holds. Both take named inputs, so that a test can change an input and see the result
change. Claims that differ only in their inputs share a function. A single expression is a lambda;
its claim says in words what it computes.
"""

from __future__ import annotations

import inspect
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from types import FrameType
from typing import Any, TypeVar

from shipnet.errors import ArgumentError, FrameError

Function = TypeVar("Function", bound=Callable[..., Any])

#: What a computed value rests on: a model of the package, a formula, or a count in transcriptions.
BASES = ("model", "arithmetic", "count")

#: Packages and modules that model something.
_MODELS = (
    "asi", "ballast", "can", "clock", "crc", "design", "engine", "fuzzy", "line", "modbus",
    "remote_control",
)  # fmt: skip

#: What they only read from transcribed tables: a module, or a function of one.
_READERS = (
    "shipnet.ballast.registers.command_codes",
    "shipnet.engine.points.read_points",
)


@dataclass(frozen=True, eq=False)
class Recomputation:
    """A function, a claim's own inputs to it, and for a check those that turn its answer round."""

    function: Callable[..., Any]
    inputs: Mapping[str, object]
    counter: Mapping[str, object]

    def __call__(self, **others: object) -> Any:
        """Return what the claim comes to, with other inputs if any are given."""
        return self.function(**{**self.inputs, **others})

    @property
    def defaults(self) -> dict[str, object]:
        """Every input, with its value for this claim."""
        known = inspect.signature(self.function).parameters.items()
        return {name: p.default for name, p in known} | dict(self.inputs)

    @cached_property
    def result(self) -> tuple[Any, str]:
        """What the claim comes to, and its basis, one of `BASES`, by what is called on the way.

        It is ``model`` if code of the papers calls a model; else ``count`` if no input is a number;
        else ``arithmetic``.
        """
        models: list[str] = []

        def watch(frame: FrameType, event: str, _: object) -> None:
            caller = frame.f_back
            while caller is not None and caller.f_globals.get("__name__") == "shipnet.arguments":
                caller = caller.f_back
            if event == "call" and caller is not None and _is_paper(caller) and _is_model(frame):
                models.append(frame.f_code.co_name)
                _watch_again(before)

        before = sys.getprofile()
        sys.setprofile(watch)
        try:
            value = self()
        finally:
            _watch_again(before)
        numbers = [one for one in self.defaults.values() if isinstance(one, int | float)]
        counts = all(isinstance(number, bool) for number in numbers)
        return value, "model" if models else "count" if counts else "arithmetic"

    @property
    def evidence(self) -> str:
        """Full name of the function, or of its module if the function has no name."""
        return f"{self.function.__module__}.{self.function.__name__}".removesuffix(".<lambda>")


def _watch_again(profiler: Any) -> None:
    """Restore the previous profiler; that of cProfile is an object that is not called."""
    sys.setprofile(profiler if callable(profiler) else None)
    if hasattr(profiler, "enable"):
        profiler.enable()


def _is_paper(frame: FrameType) -> bool:
    return str(frame.f_globals.get("__name__")).startswith("shipnet.papers.")


def _is_model(frame: FrameType) -> bool:
    module = str(frame.f_globals.get("__name__"))
    package, *rest = module.split(".")
    return (
        package == "shipnet"
        and bool(rest)
        and rest[0] in _MODELS
        and not {module, f"{module}.{frame.f_code.co_name}"} & set(_READERS)
    )


#: Claim id -> its function; filled as the modules of the papers are imported.
REGISTRY: dict[str, Recomputation] = {}

#: (paper, item) -> function that draws a printed figure on given axes.
FIGURES: dict[tuple[str, str], Callable[..., Any]] = {}

#: (paper, item) -> function that generates a printed table.
TABLES: dict[tuple[str, str], Callable[[], Any]] = {}


def numeric(*claims: str, **inputs: object) -> Callable[[Function], Function]:
    """Register a function, with these inputs, as the recomputation of numbers by their claims."""
    return check(*claims, counter={}, **inputs)


def check(
    *claims: str, counter: Mapping[str, object], **inputs: object
) -> Callable[[Function], Function]:
    """Register a function, with these inputs, as the check of statements by their claims.

    With the inputs of `counter` the answer must be the opposite, which a test verifies.
    """

    def decorate(function: Function) -> Function:
        made = Recomputation(function, inputs, counter)
        for claim in claims:
            # A module that is loaded again registers the same function again.
            if claim in REGISTRY and REGISTRY[claim].evidence != made.evidence:
                first = REGISTRY[claim].evidence
                raise ValueError(f"claim {claim} has two functions: {first} is the first")
            REGISTRY[claim] = made
        return function

    return decorate


def is_legal(function: Callable[..., object], *arguments: object, **named: object) -> bool:
    """Whether a function of the package takes these arguments without an error of its own."""
    try:
        function(*arguments, **named)
    except (ArgumentError, FrameError):
        return False
    return True


def figure(paper: str, *items: str) -> Callable[[Function], Function]:
    """Register a function of the axes as the drawing of one or more printed figures."""

    def decorate(function: Function) -> Function:
        FIGURES.update({(paper, item): function for item in items})
        return function

    return decorate


def table(paper: str, item: str) -> Callable[[Function], Function]:
    """Register a function as the generator of a printed table."""

    def decorate(function: Function) -> Function:
        TABLES[paper, item] = function
        return function

    return decorate
