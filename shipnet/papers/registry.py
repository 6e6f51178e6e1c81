"""Which function recomputes which claim.

A *numeric* claim is a number that a paper prints; its function returns ours. A *qualitative* one
is a statement; its function says whether it holds. Both take named inputs, so that a test can
move an input and see the result move: a typed constant cannot pass for a computation.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, TypeVar

__all__ = ["REGISTRY", "Recomputation", "check", "numeric"]

Function = TypeVar("Function", bound=Callable[..., Any])


@dataclass(frozen=True, slots=True)
class Recomputation:
    """One claim's function.

    Parameters
    ----------
    function : callable
        Takes keyword arguments with defaults only.
    counter : mapping, optional
        For a check: inputs for which the answer must turn round. Empty for a number.
    """

    function: Callable[..., Any]
    counter: Mapping[str, object] = field(default_factory=dict)

    @property
    def evidence(self) -> str:
        """Where the function stands."""
        return f"{self.function.__module__}.{self.function.__name__}"


#: Claim id -> its function; filled as the modules of the papers are imported.
REGISTRY: dict[str, Recomputation] = {}


def _register(claim: str, recomputation: Recomputation) -> None:
    # A module that is loaded again registers the same function again.
    if claim in REGISTRY and REGISTRY[claim].evidence != recomputation.evidence:
        raise ValueError(
            f"claim {claim} has two functions: {REGISTRY[claim].evidence} is the first"
        )
    REGISTRY[claim] = recomputation


def numeric(*claims: str) -> Callable[[Function], Function]:
    """Register a function as the recomputation of one or more numbers.

    Parameters
    ----------
    *claims : str
        Ids of numeric claims, or of numbers of our own beside them.

    Returns
    -------
    callable
        A decorator that leaves the function as it is.

    Raises
    ------
    ValueError
        If a claim has a function already.
    """

    def decorate(function: Function) -> Function:
        for claim in claims:
            _register(claim, Recomputation(function))
        return function

    return decorate


def check(*claims: str, counter: Mapping[str, object]) -> Callable[[Function], Function]:
    """Register a function as the check of one or more statements.

    Parameters
    ----------
    *claims : str
        Ids of qualitative claims.
    counter : mapping of str to object
        Inputs with which the answer is the opposite; a test calls the function with them, so
        that a check that cannot fail is found out.

    Returns
    -------
    callable
        A decorator that leaves the function as it is.

    Raises
    ------
    ValueError
        If a claim has a function already.
    """

    def decorate(function: Function) -> Function:
        for claim in claims:
            _register(claim, Recomputation(function, counter))
        return function

    return decorate
