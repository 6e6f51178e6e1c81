"""Which function recomputes which claim, draws which figure and generates which table.

The function of a *numeric* claim returns our number; that of a *qualitative* one says whether the
statement holds. Both take named inputs, so that a test can change an input and see the result
change. Claims that differ only in their inputs share a function. A single expression is a lambda;
its claim says in words what it computes.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, TypeVar

from shipnet.errors import ArgumentError, FrameError

Function = TypeVar("Function", bound=Callable[..., Any])


@dataclass(frozen=True, eq=False)
class Recomputation:
    """A function, a claim's own inputs to it, and for a check those that turn its answer round."""

    function: Callable[..., Any]
    inputs: Mapping[str, object]
    counter: Mapping[str, object]

    def __call__(self, **others: object) -> Any:
        """Return what the claim comes to, with other inputs if any are given."""
        return self.function(**{**self.inputs, **others})

    @cached_property
    def value(self) -> Any:
        """The number, or whether the statement holds, with the claim's own inputs."""
        return self()

    @property
    def evidence(self) -> str:
        """Full name of the function, or of its module if the function has no name."""
        return f"{self.function.__module__}.{self.function.__name__}".removesuffix(".<lambda>")


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
