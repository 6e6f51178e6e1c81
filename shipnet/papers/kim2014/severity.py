"""Faults by degrees: from which severity on they are named, and how long worn pumps will last.

Valves and faults are those of our own simulator, made to fit the rules: that a fault is found
verifies code, it does not validate the method.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np

from shipnet.ballast.trials import fault_trials
from shipnet.ballast.valve_faults import FAULTS
from shipnet.ballast.wear import Wear, predict_life
from shipnet.fuzzy.rules import NORMAL

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["graded_trials", "life_table"]


def graded_trials(
    codes: Iterable[str] = tuple(FAULTS), *, n_valves: int = 101, rng: np.random.Generator
) -> pd.DataFrame:
    """Let valves with each fault, from healthy to the worst, open and close once.

    Parameters
    ----------
    codes : iterable of str, optional
        Faults; all of the rule table if omitted.
    n_valves : int, default 101
        Valves with each fault, their severities evenly from 0 to 1; 10000 in all at most.
    rng : numpy.random.Generator
        Draws valves and noise of the sensors.

    Returns
    -------
    pandas.DataFrame
        As `fault_trials` of the reading ``fuzzy``, and what is ``said``: ``nothing``, ``its own
        name``, or ``another fault's name``, by the headline.

    Raises
    ------
    ArgumentError
        If there is no such fault, or `n_valves` is out of range.

    Examples
    --------
    >>> table = graded_trials(["Pos3"], n_valves=5, rng=np.random.default_rng(2024))
    >>> table[["severity", "headline", "said"]].values.tolist()[:2]
    [[0.0, 'normal', 'nothing'], [0.25, 'S1', "another fault's name"]]
    """
    trials = fault_trials(
        codes, n_valves=n_valves, severity=np.linspace(0, 1, max(n_valves, 0)),
        readings=["fuzzy"], rng=rng,
    )  # fmt: skip
    headline = trials["headline"]
    named = np.where(headline == trials["fault"], "its own name", "another fault's name")
    return trials.assign(said=np.where(headline == NORMAL, "nothing", named))


def life_table(
    wear: Wear, valve: int = 0, strokes: Iterable[int] = (20, 50, 100, 200)
) -> pd.DataFrame:
    """Return the remaining life that the leak of a pump tells at some points of its life.

    Parameters
    ----------
    wear : Wear
        What `shipnet.ballast.wear.synthetic_wear` returned.
    valve : int, default 0
        Which valve.
    strokes : iterable of int, optional
        After how many strokes it is asked, 10 up to those there are.

    Returns
    -------
    pandas.DataFrame
        Indexed by the number of ``strokes``: how many are still ``to_go``, the interval ``low`` to
        ``high``, and the ``true`` number.

    Raises
    ------
    ArgumentError
        If there is no such valve, or a number of strokes is out of range.

    Examples
    --------
    >>> from shipnet.ballast.wear import synthetic_wear
    >>> wear = synthetic_wear(3, 400, rng=np.random.default_rng(2024))
    >>> life_table(wear, strokes=[200]).round().loc[200].tolist()
    [140.0, 139.0, 142.0, 139.0]
    """
    import pandas as pd

    rows = {now: (*predict_life(wear, valve, now)[1], wear.life[valve] - now) for now in strokes}
    table = pd.DataFrame(rows, index=["to_go", "low", "high", "true"], dtype=float).T
    return table.rename_axis("strokes")
