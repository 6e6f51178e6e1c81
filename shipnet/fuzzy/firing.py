"""Samples of the variables as arrays, and rules that fire persistently."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from shipnet.arrays import Bools, Floats, Integers
from shipnet.errors import ArgumentError
from shipnet.fields import check_whole
from shipnet.lazy import pd

#: Values by variable name.
Samples: TypeAlias = "Mapping[str, npt.ArrayLike] | pd.DataFrame"

#: How terms are evaluated: by their comparisons as written, by comparisons with the midpoints of
#: their ramps, or by their membership functions.
METHODS = ("crisp", "midpoint", "fuzzy")


def persistent(fires: Bools, k: int, n: int) -> Bools:
    """Return where a rule fired in `k` or more of the last `n` rows; no rule fires before row 0."""
    window = check_whole("n", n, 1, 10**6)
    least = check_whole("k", k, 1, window)
    return fires if window == 1 else np.asarray(_recent(fires, window) >= least)


def undecided(fires: Bools, could: Bools, k: int, n: int) -> Bools:
    """Return where only missing readings keep a rule from being active.

    The rule `could` have fired in `k` of the last `n` rows or, of fewer than `k` rows, in all.
    """
    if could is fires:
        return np.broadcast_to(np.False_, fires.shape)
    if n == 1:
        return could & ~fires
    fired, most = _recent(fires, int(n)), _recent(could, int(n))
    least = np.minimum(np.arange(1, len(fires) + 1), k)
    enough = most >= least.reshape(-1, *[1] * (fires.ndim - 1))
    return np.asarray(enough & (fired < k) & (fired < most))


def _recent(fires: Bools, n: int) -> Integers:
    """Return in how many of the last `n` rows each rule fired."""
    count = np.cumsum(fires, axis=0, dtype=np.int32)
    count[n:] -= count[:-n]
    return np.asarray(count)


def arrays(names: Sequence[str], samples: Samples) -> dict[str, Floats]:
    """Return one array per variable, all of the same shape."""
    if unknown := [str(name) for name in samples if name not in names]:
        raise ArgumentError(
            f"samples contain {', '.join(unknown)}; the variables are {', '.join(names)}"
        )
    values = {}
    for name in names:
        try:
            values[name] = np.asarray(samples[name] if name in samples else np.nan, dtype=float)
        except (TypeError, ValueError):
            raise ArgumentError(f"{name} must be numbers; use NaN for missing values") from None
    if len({x.shape for x in values.values()}) == 1:
        return values
    try:
        return dict(zip(names, np.broadcast_arrays(*values.values()), strict=True))
    except ValueError:
        shapes = ", ".join(f"{name} {x.shape}" for name, x in values.items())
        raise ArgumentError(f"shapes are {shapes}; they must be equal or broadcastable") from None


def masks(names: Sequence[str], applies: Samples, shape: tuple[int, ...]) -> dict[str, Bools]:
    """Return the masks of variables by name, each of this shape."""
    applicable: dict[str, Bools] = {}
    for name, flags in applies.items():
        mask = np.asarray(flags)
        if name not in names or mask.dtype != bool:
            raise ArgumentError(
                f"applies[{name!r}] has the type {mask.dtype}; it must be a bool mask of one of "
                f"{', '.join(names)}"
            )
        try:
            applicable[str(name)] = np.broadcast_to(mask, shape)
        except ValueError:
            raise ArgumentError(
                f"applies[{name!r}] has the shape {mask.shape}; the samples have {shape}"
            ) from None
    return applicable
