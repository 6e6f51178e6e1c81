"""Audit of a rule base: what fires together, what contains what, what nothing covers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import combinations, pairwise, product
from math import prod
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from shipnet.errors import ArgumentError
from shipnet.fuzzy.decide import decide
from shipnet.fuzzy.rules import RuleBase
from shipnet.fuzzy.strengths import crisp_strengths, strengths
from shipnet.fuzzy.terms import Variable

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["corners", "diagnose", "overlap_matrix", "overlaps", "regions"]

#: Most regions that are looked at.
_MOST = 10**6

Floats = npt.NDArray[np.float64]


def corners(base: RuleBase, *, dead_band: bool = False) -> dict[str, list[float]]:
    """Return values of each variable, one for each set of terms that can hold at once.

    Parameters
    ----------
    base : RuleBase
        The rules.
    dead_band : bool, default False
        Take memberships of 0.5 or more instead of the comparisons as printed.

    Returns
    -------
    dict of str to list of float
        Variable -> one value in the universe for each of its cells, rising.

    Examples
    --------
    The last of MC is over; 2.5 A itself is no term at all as printed:

    >>> from shipnet.fuzzy import published
    >>> corners(published.rule_base("kim2014"))["MC"]
    [0.0, 1.25, 2.5, 4.25]
    """
    return {variable.name: _cells(variable, dead_band) for variable in base.variables}


def regions(
    base: RuleBase,
    *,
    dead_band: bool = False,
    values: Mapping[str, Sequence[float]] | None = None,
) -> pd.DataFrame:
    """Return every combination of cells of the variables, and the rules that fire in it.

    Parameters
    ----------
    base : RuleBase
        The rules.
    dead_band : bool, default False
        As for `corners`.
    values : mapping of str to sequence of float, optional
        Values of each variable; those of `corners` if omitted.

    Returns
    -------
    pandas.DataFrame
        One row a region: a value of each variable, ``fired`` codes, and their number ``count``.

    Raises
    ------
    ArgumentError
        If there are more than a million regions, or values of some variable are not given.

    Notes
    -----
    The terms of a variable hold or not in a whole cell, so that one point stands for a region, and
    the regions together for all that the sensors can say. Their number is no measure of how often
    they occur.

    Examples
    --------
    How many rules fire at once, in how many regions:

    >>> from shipnet.fuzzy import published
    >>> regions(published.rule_base("kim2014"))["count"].value_counts().sort_index().to_dict()
    {0: 41, 1: 127, 2: 147, 3: 77, 4: 26, 5: 12, 6: 2}
    """
    import pandas as pd

    chosen = corners(base, dead_band=dead_band) if values is None else values
    if set(chosen) != set(base.names) or not all(len(one) for one in chosen.values()):
        raise ArgumentError(f"values are of {', '.join(chosen)}; expected {', '.join(base.names)}")
    number = prod(len(one) for one in chosen.values())
    if number > _MOST:
        raise ArgumentError(f"there are {number} regions; the most that are looked at is {_MOST}")
    points = np.array(list(product(*(chosen[name] for name in base.names))), dtype=float)
    table = pd.DataFrame(points, columns=list(base.names))
    fires = crisp_strengths(base, table, dead_band=dead_band).strength > 0
    codes = np.array(base.codes, dtype=object)
    return table.assign(fired=[" ".join(codes[row]) for row in fires], count=fires.sum(axis=1))


def overlap_matrix(base: RuleBase, *, dead_band: bool = False) -> pd.DataFrame:
    """Return which rules can fire together: in how many regions each pair does.

    Parameters
    ----------
    base : RuleBase
        The rules.
    dead_band : bool, default False
        As for `corners`.

    Returns
    -------
    pandas.DataFrame
        Codes by codes; the diagonal is the number of regions in which a rule fires at all.

    Examples
    --------
    >>> from shipnet.fuzzy import published
    >>> table = overlap_matrix(published.rule_base("kim2014"))
    >>> table.loc["Pos1", ["Pos1", "S1", "Pos3", "Pos4"]].tolist()
    [12, 12, 12, 0]
    """
    import pandas as pd

    table = regions(base, dead_band=dead_band)[list(base.names)]
    fires = crisp_strengths(base, table, dead_band=dead_band).strength.astype(np.int64)
    return pd.DataFrame(fires.T @ fires, index=list(base.codes), columns=list(base.codes))


def overlaps(base: RuleBase, *, dead_band: bool = False) -> pd.DataFrame:
    """Return the pairs of rules that can fire together, and which of two contains the other.

    Parameters
    ----------
    base : RuleBase
        The rules.
    dead_band : bool, default False
        As for `corners`.

    Returns
    -------
    pandas.DataFrame
        One row a pair: codes ``a`` and ``b``, and ``relation``: ``equal``, ``a in b`` (whenever a
        fires, b does), ``b in a`` or ``overlap``.

    Examples
    --------
    >>> from shipnet.fuzzy import published
    >>> pairs = overlaps(published.rule_base("kim2014"))
    >>> len(pairs), pairs[pairs["relation"] == "b in a"][["a", "b"]].values.tolist()
    (42, [['S1', 'Pos1'], ['S2', 'Pos2']])
    """
    import pandas as pd

    matrix = overlap_matrix(base, dead_band=dead_band).to_numpy()
    rows = []
    for (i, a), (j, b) in combinations(enumerate(base.codes), 2):
        both, only_a, only_b = matrix[i, j], matrix[i, i], matrix[j, j]
        if both:
            relation = {
                (True, True): "equal", (True, False): "a in b", (False, True): "b in a",
                (False, False): "overlap",
            }[bool(both == only_a), bool(both == only_b)]  # fmt: skip
            rows.append((a, b, relation))
    return pd.DataFrame(rows, columns=["a", "b", "relation"])


def diagnose(base: RuleBase, tests: pd.DataFrame, *, crisp: bool = False) -> pd.DataFrame:
    """Return what the rules make of test values whose diagnosis is known.

    Parameters
    ----------
    base : RuleBase
        The rules.
    tests : pandas.DataFrame
        One row a test, indexed by the code expected, one column a variable; such as `vectors`
        returns.
    crisp : bool, default False
        Take the comparisons as printed instead of the firing strengths.

    Returns
    -------
    pandas.DataFrame
        One row a test: the code ``expected``, the ``fired`` codes, the ``headline``, and whether
        that is ``right``.

    Examples
    --------
    >>> from shipnet.fuzzy import published
    >>> base = published.rule_base("kim2014")
    >>> result = diagnose(base, published.vectors("kim2014", reading="printed"), crisp=True)
    >>> int(result["right"].sum()), result[~result["right"]]["expected"].tolist()
    (10, ['V2', 'S2', 'Pos2'])
    """
    import pandas as pd

    decision = decide((crisp_strengths if crisp else strengths)(base, tests))
    expected = tests.index.astype(str).to_numpy(dtype=object)
    table = decision.table
    return pd.DataFrame(
        {
            "expected": expected,
            "fired": table["active"],
            "headline": table["headline"],
            "right": decision.headline == expected,
        }
    )


def _cells(variable: Variable, dead_band: bool) -> list[float]:
    """Return one value for each set of terms that holds somewhere in the universe."""
    intervals = [term.dead_band if dead_band else term.crisp for term in variable.terms]
    ends = {end for one in intervals for end in (one.low, one.high)} | {variable.low, variable.high}
    edges = sorted(end for end in ends if variable.low <= end <= variable.high)
    middles = [(a + b) / 2 for a, b in pairwise(edges)]
    points = np.array(sorted([*edges, *middles]))
    # An inner point stands for its cell better than an end of the universe does.
    inner = np.isin(points, middles)
    holds = np.stack([one.contains(points) for one in intervals], axis=1)
    found: dict[tuple[bool, ...], int] = {}
    for place, row in enumerate(holds.tolist()):
        key = tuple(row)
        if key not in found or (inner[place] and not inner[found[key]]):
            found[key] = place
    return sorted(float(points[place]) for place in found.values())
