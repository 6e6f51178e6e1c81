"""Which of several options are worth a look: whole ones, and those that no other beats."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from shipnet.design.network import Network
from shipnet.errors import ArgumentError

__all__ = ["CRITERIA", "RESPONSE", "complete", "not_beaten"]

RESPONSE = "worst response [ms]"

#: Columns of a comparison in which less is better, and by which options are weighed.
CRITERIA = ("total cost", RESPONSE, "lost by one failure")


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


def complete(networks: Mapping[str, Network]) -> dict[str, Network]:
    """Return the networks that connect every point; all of them if none does.

    Parameters
    ----------
    networks : mapping of str to Network
        By name.

    Returns
    -------
    dict of str to Network
        What it would be wrong to call cheap for what it leaves out is not among them.

    Examples
    --------
    >>> from shipnet.design.example import example
    >>> list(complete({"two stations": example()}))
    ['two stations']
    """
    return {name: network for name, network in networks.items() if network.fits} or dict(networks)
