"""Faults by degrees: from which severity on they are named.

Valves and faults are those of our own simulator, made to fit the rules: that a fault is found
verifies code, it does not validate the method.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np

from shipnet.ballast.trials import fault_trials
from shipnet.ballast.valve_faults import FAULTS
from shipnet.fuzzy.rules import NORMAL

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["graded_trials"]


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
        As `fault_trials` by the method ``fuzzy``, and what is ``said``: ``nothing``, ``its own
        name``, or ``another fault's name``, by the top fault.

    Raises
    ------
    ArgumentError
        If there is no such fault, or `n_valves` is out of range.

    Examples
    --------
    >>> table = graded_trials(["Pos3"], n_valves=5, rng=np.random.default_rng(2024))
    >>> table[["severity", "top_fault", "said"]].values.tolist()[:2]
    [[0.0, 'normal', 'nothing'], [0.25, 'S1', "another fault's name"]]
    """
    trials = fault_trials(
        codes, n_valves=n_valves, severity=np.linspace(0, 1, max(n_valves, 0)),
        methods=["fuzzy"], rng=rng,
    ).table()  # fmt: skip
    top = trials["top_fault"]
    named = np.where(top == trials["fault"], "its own name", "another fault's name")
    return trials.assign(said=np.where(top == NORMAL, "nothing", named))
