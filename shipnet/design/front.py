"""The Pareto front: what no other beats."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from shipnet.errors import ArgumentError

__all__ = ["not_beaten"]


def not_beaten(values: npt.ArrayLike) -> npt.NDArray[np.bool_]:
    """Return which rows no other row beats: the Pareto front, where less is better.

    Parameters
    ----------
    values : array_like of float, shape (n, k)
        k criteria of n options; NaN is worse than any number.

    Returns
    -------
    ndarray of bool, shape (n,)
        False where another row is as low in every criterion and lower in one.

    Examples
    --------
    >>> not_beaten([[1, 9], [2, 2], [2, 3], [9, 1]]).tolist()
    [True, True, False, True]
    """
    rows = np.asarray(values, float)
    if rows.ndim != 2:
        raise ArgumentError(f"values have shape {rows.shape}; it must be (n, k)")
    rows = np.where(np.isnan(rows), np.inf, rows)
    as_low = (rows[:, None] <= rows).all(axis=-1)
    return np.asarray(~(as_low & ~as_low.T).any(axis=0))
