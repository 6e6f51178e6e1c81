"""Which function recomputes which claim, draws which figure and generates which table.

A *numeric* claim is a number that a paper prints; its function returns ours. A *qualitative* one
is a statement; its function says whether it holds. Both take named inputs, so that a test can
move an input and see the result move: a typed constant cannot pass for a computation.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, TypeVar

Function = TypeVar("Function", bound=Callable[..., Any])


@dataclass(frozen=True, slots=True)
class Recomputation:
    """A claim's function, and for a check the inputs with which its answer is the opposite."""

    function: Callable[..., Any]
    counter: Mapping[str, object] = field(default_factory=dict)

    @property
    def evidence(self) -> str:
        """Full name of the function."""
        return f"{self.function.__module__}.{self.function.__name__}"


#: Claim id -> its function; filled as the modules of the papers are imported.
REGISTRY: dict[str, Recomputation] = {}

#: (paper, item) -> function that draws a printed figure on given axes.
FIGURES: dict[tuple[str, str], Callable[..., Any]] = {}

#: (paper, item) -> function that generates a printed table.
TABLES: dict[tuple[str, str], Callable[[], Any]] = {}


def numeric(*claims: str) -> Callable[[Function], Function]:
    """Register a function as the recomputation of numbers, by the ids of their claims."""

    def decorate(function: Function) -> Function:
        for claim in claims:
            _register(claim, Recomputation(function))
        return function

    return decorate


def check(*claims: str, counter: Mapping[str, object]) -> Callable[[Function], Function]:
    """Register a function as the check of statements, by the ids of their claims.

    With the inputs in `counter` the answer is the opposite; a test calls the function with them,
    so that a check that cannot fail is found out.
    """

    def decorate(function: Function) -> Function:
        for claim in claims:
            _register(claim, Recomputation(function, counter))
        return function

    return decorate


def figure(paper: str, *items: str) -> Callable[[Function], Function]:
    """Register a function of the axes as the drawing of one or more printed figures."""

    def decorate(function: Function) -> Function:
        for item in items:
            FIGURES[paper, item] = function
        return function

    return decorate


def table(paper: str, item: str) -> Callable[[Function], Function]:
    """Register a function as the generator of a printed table."""

    def decorate(function: Function) -> Function:
        TABLES[paper, item] = function
        return function

    return decorate


def _register(claim: str, recomputation: Recomputation) -> None:
    # A module that is loaded again registers the same function again.
    if claim in REGISTRY and REGISTRY[claim].evidence != recomputation.evidence:
        raise ValueError(
            f"claim {claim} has two functions: {REGISTRY[claim].evidence} is the first"
        )
    REGISTRY[claim] = recomputation
