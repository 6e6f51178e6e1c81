"""Rule bases and test values that papers print, as the data files hold them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from shipnet import datasets
from shipnet.errors import ArgumentError
from shipnet.fuzzy.file import load_rules
from shipnet.fuzzy.rules import Rule, RuleBase
from shipnet.fuzzy.strengths import crisp_strengths

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["FILLS", "READINGS", "rule_base", "vectors"]

#: The test values as printed, and with the slips of print mended.
READINGS = ("printed", "meant")

#: What is assumed of the sensors that a row does not print.
FILLS = ("absent", "normal", "physical")


def rule_base(paper: str) -> RuleBase:
    """Return the rule base of a paper.

    Parameters
    ----------
    paper : str
        Key of the paper; there is ``kim2014``.

    Returns
    -------
    RuleBase
        Comparisons as printed; ramps, units, universes and priorities are our assumption.

    Raises
    ------
    ValueError
        If there are no data files of such a paper.

    Examples
    --------
    >>> base = rule_base("kim2014")
    >>> base.codes
    ('G1', 'P1', 'P2', 'V1', 'V2', 'S1', 'S2', 'O1', 'Pos1', 'Pos2', 'Pos3', 'Pos4')
    >>> str(base.variable("MC").term("run").crisp), base.variable("MC").term("run").corners
    ('0 < x < 2.5', (0.05, 0.15, 2.0, 3.0))
    """
    files = (datasets.path(f"{paper}_assumed_{what}.csv") for what in ("rules", "terms"))
    return load_rules(*files)


def vectors(paper: str, *, reading: str = "meant", fill: str = "absent") -> pd.DataFrame:
    """Return the values with which a paper tests its rules.

    Parameters
    ----------
    paper : str
        Key of the paper; there is ``kim2014``.
    reading : {"printed", "meant"}, default "meant"
        As printed, or mended.
    fill : {"absent", "normal", "physical"}, default "absent"
        What a sensor says that a row does not print: nothing; its normal value; or what it says in
        the state of the plant that the row describes.

    Returns
    -------
    pandas.DataFrame
        One row a test, indexed by the code that the paper names; one column a variable, NaN where
        it is missing.

    Raises
    ------
    ArgumentError
        If there is no such reading or fill.

    Examples
    --------
    The position of S2 contradicts its rule as printed:

    >>> [vectors("kim2014", reading=r).loc["S2", "VPos"].item() for r in READINGS]
    [305.0, -5.0]
    """
    for name, value, legal in (("reading", reading, READINGS), ("fill", fill, FILLS)):
        if value not in legal:
            raise ArgumentError(f"{name} is {value!r}; it must be one of {', '.join(legal)}")
    base = rule_base(paper)
    names = list(base.names)
    every = datasets.read(f"{paper}_assumed_vectors.csv")
    chosen = every[every["reading"] == reading].set_index("code")
    table = _numbers(chosen[names])
    states = datasets.read(f"{paper}_assumed_fills.csv")
    states = states[states["fill"] == fill]
    left = table.notna().any(axis=1)
    for when, (_, state) in zip(states["when"], _numbers(states[names]).iterrows(), strict=True):
        here = left & (_holds(base, when, table) if when else True)
        table[here] = table[here].fillna(state)
        left &= ~here
    return table


def _numbers(text: pd.DataFrame) -> pd.DataFrame:
    return text.replace("", "nan").astype(float)


def _holds(base: RuleBase, term: str, table: pd.DataFrame) -> npt.NDArray[np.bool_]:
    """Return the rows for which a term holds as printed."""
    rule = Rule("condition", Rule.parse(term), 1)
    return crisp_strengths(RuleBase(base.variables, (rule,)), table).strength[:, 0] > 0
