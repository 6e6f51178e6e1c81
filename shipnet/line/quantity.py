"""Numbers with a unit and a legal range: one value, or one for each tree of a Monte Carlo."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from shipnet.errors import ArgumentError

__all__ = ["Quantity", "check_quantity", "check_scalar", "check_trees"]

Quantity = float | npt.NDArray[np.float64]


def check_quantity(what: str, value: Any, unit: str, *, low: float = 0.0, high: float) -> Quantity:
    """Return a value as a float or a read-only array, or raise if it is out of range.

    Parameters
    ----------
    what : str
        The quantity as the caller knows it, with the branch or node it belongs to.
    value : float or array_like of float, shape (n_trees,)
        What was given.
    unit : str
        Unit, put behind the numbers in the message.
    low, high : float, low is 0 by default
        Legal range, both ends included and finite.

    Returns
    -------
    float or ndarray of float, shape (n_trees,)
        The value; an array is a copy.

    Raises
    ------
    ArgumentError
        If it is not a number or a row of numbers, or if one is out of range.

    Examples
    --------
    >>> check_quantity("length of line 'a'-'b'", -1, "m", high=1e6)
    Traceback (most recent call last):
        ...
    shipnet.errors.ArgumentError: length of line 'a'-'b' is -1 m; it must be 0..1e+06 m
    """
    # A network has hundreds of these numbers: one that is in order takes a microsecond.
    if type(value) in (float, int) and low <= value <= high:
        return float(value)
    legal = f"{low:g}..{high:g} {unit}"
    try:
        array = np.asarray(value)
        if array.dtype.kind not in "iuf" or array.ndim > 1 or array.size == 0:
            raise ValueError
    except (TypeError, ValueError, OverflowError):
        raise ArgumentError(
            f"{what} is {value!r}; it must be a number or a row of numbers, {legal}"
        ) from None
    array = array.astype(float)
    good = (array >= low) & (array <= high)
    if not good.all():
        where = "" if array.ndim == 0 else f" in tree {int(np.argmin(good))}"
        worst = float(array.reshape(-1)[np.argmin(good)])
        raise ArgumentError(f"{what} is {worst:g} {unit}{where}; it must be {legal}")
    if array.ndim == 0:
        return float(array)
    array.flags.writeable = False
    return array


def check_scalar(what: str, value: Any, unit: str, low: float, high: float) -> float:
    """Return a single value, or raise if it is out of range.

    Parameters
    ----------
    what, value, unit, low, high
        As for `check_quantity`.

    Returns
    -------
    float
        The value.

    Raises
    ------
    ArgumentError
        If it is not one number, or out of range.

    Examples
    --------
    >>> check_scalar("dt", 5e-9, "s", 1e-15, 1e6)
    5e-09
    """
    number = check_quantity(what, value, unit, low=low, high=high)
    if not isinstance(number, float):
        raise ArgumentError(f"{what} is {value!r}; it must be a single number")
    return number


def check_trees(what: str, known: int | None, *values: Quantity | None) -> int | None:
    """Return how many trees the values describe, or raise if they do not agree.

    Parameters
    ----------
    what : str
        What the values belong to.
    known : int or None
        The number of trees so far; None while every value was a single one.
    *values : float, ndarray of shape (n_trees,), or None
        Quantities as `check_quantity` returns them.

    Returns
    -------
    int or None
        The number of trees, None if nothing has a Monte Carlo axis.

    Raises
    ------
    ArgumentError
        If two numbers of trees differ.

    Examples
    --------
    >>> check_trees("cable", None, 1.0, np.array([1.0, 2.0]))
    2
    """
    for value in values:
        if isinstance(value, np.ndarray):
            if known is not None and len(value) != known:
                raise ArgumentError(f"{what} has values for {len(value)} trees, others for {known}")
            known = len(value)
    return known
