"""Audit of a rule base: what fires together, what contains what, what nothing covers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations, pairwise, product
from math import prod
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from shipnet.errors import ArgumentError
from shipnet.fuzzy.firing import Samples, check_method
from shipnet.fuzzy.rules import NORMAL, UNKNOWN, RuleBase
from shipnet.fuzzy.terms import Variable

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

#: Most regions that are computed.
_MOST = 10**6


def regions(
    base: RuleBase, method: str, values: Mapping[str, Sequence[float]] | None = None
) -> pd.DataFrame:
    """Return every combination of cells of the variables, and the rules that fire in it."""
    import pandas as pd

    check_method(method, "crisp", "midpoint")
    chosen = {v.name: _cells(v, method) for v in base.variables} if values is None else values
    if set(chosen) != set(base.names) or not all(len(one) for one in chosen.values()):
        raise ArgumentError(f"values are of {', '.join(chosen)}; expected {', '.join(base.names)}")
    number = prod(len(one) for one in chosen.values())
    if number > _MOST:
        raise ArgumentError(f"there are {number} regions; there may be {_MOST}")
    points = np.array(list(product(*(chosen[name] for name in base.names))), dtype=float)
    table = pd.DataFrame(points, columns=list(base.names))
    fires = base.fire(table, method).strength > 0
    codes = np.array(base.codes, dtype=object)
    return table.assign(fired=[" ".join(codes[row]) for row in fires], count=fires.sum(axis=1))


@dataclass(frozen=True)
class Overlaps:
    """The pairs of rules that can fire together, as `RuleBase.overlaps` returns them.

    Parameters
    ----------
    base : RuleBase
        The rules.
    method : {"crisp", "midpoint"}, default "crisp"
        Comparisons as written, or in the middle of the ramps.

    Raises
    ------
    ArgumentError
        If there is no such method.

    Examples
    --------
    >>> from shipnet import datasets
    >>> from shipnet.fuzzy import read_rules
    >>> base = read_rules(*(datasets.path(f"kim2014_assumed_{x}.csv") for x in ("rules", "terms")))
    >>> overlaps = Overlaps(base)
    >>> overlaps
    Overlaps(42 of 66 pairs of rules)
    >>> overlaps.table().query("relation == 'b in a'")[["a", "b"]].to_numpy().tolist()
    [['S1', 'Pos1'], ['S2', 'Pos2']]
    >>> overlaps.matrix.loc["Pos1", ["Pos1", "S1", "Pos3", "Pos4"]].tolist()
    [12, 12, 12, 0]
    """

    base: RuleBase
    method: str = "crisp"

    def __post_init__(self) -> None:
        """Check the method."""
        check_method(self.method, "crisp", "midpoint")

    @cached_property
    def _counts(self) -> npt.NDArray[np.int64]:
        """The number of regions in which each pair of rules fires."""
        table = regions(self.base, self.method)[list(self.base.names)]
        fires = self.base.fire(table, self.method).strength.astype(np.int64)
        return fires.T @ fires

    @property
    def matrix(self) -> pd.DataFrame:
        """In how many regions each pair of rules fires; the diagonal counts those of each rule."""
        import pandas as pd

        codes = list(self.base.codes)
        return pd.DataFrame(self._counts, index=codes, columns=codes)

    def __len__(self) -> int:
        """Return the number of pairs that can fire together."""
        return int(np.count_nonzero(np.triu(self._counts, 1)))

    def __repr__(self) -> str:
        """Return how many pairs there are."""
        n = len(self.base.rules)
        return f"Overlaps({len(self)} of {n * (n - 1) // 2} pairs of rules)"

    def table(self) -> pd.DataFrame:
        """Return one row per pair: codes ``a`` and ``b``, and their ``relation``.

        ``a in b`` means that b fires whenever a does; the others are ``b in a``, ``equal`` and
        ``overlap``.
        """
        import pandas as pd

        names = {
            (True, True): "equal", (True, False): "a in b", (False, True): "b in a",
            (False, False): "overlap",
        }  # fmt: skip
        rows = []
        for (i, a), (j, b) in combinations(enumerate(self.base.codes), 2):
            both, only_a, only_b = self._counts[i, j], self._counts[i, i], self._counts[j, j]
            if both:
                rows.append((a, b, names[bool(both == only_a), bool(both == only_b)]))
        return pd.DataFrame(rows, columns=["a", "b", "relation"])

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw in what share of the regions of the row's rule the column's rule fires too."""
        from shipnet.fuzzy.plot import plot_overlaps

        return plot_overlaps(self, ax)


def check(base: RuleBase, vectors: pd.DataFrame, method: str) -> pd.DataFrame:
    """Return what the rules make of test vectors whose diagnosis is known."""
    import pandas as pd

    decision = base.decide(vectors, method)
    expected = vectors.index.astype(str).to_numpy(dtype=object)
    table = decision.table()
    return pd.DataFrame(
        {
            "expected": expected,
            "fired": table["active"],
            "top": table["top"],
            "right": decision.top == expected,
        }
    )


def centroid(base: RuleBase, samples: Samples) -> pd.DataFrame:
    r"""Return the centroid of the numbers of the faults, and the code nearest to it.

    Rule i has the consequent "number is i", a triangle of half-width 1/2 on i, cut at the firing
    strength. The triangles do not overlap, so the centroid has a closed form:

    .. math:: z = \frac{\sum_i w_i \left( 2 - w_i \right) i}{\sum_i w_i \left( 2 - w_i \right)}

    Of two codes that are equally near, the one of the lower number counts.
    """
    import pandas as pd

    firing = base.fire(samples)
    decided = firing.decide().table()
    strength = np.atleast_2d(firing.strength)
    area = strength * (2 - strength)
    total = area.sum(axis=-1)
    number = np.full(total.shape, np.nan)
    np.divide(area @ np.arange(1, len(base.rules) + 1), total, out=number, where=total > 0)
    place = np.where(total > 0, np.ceil(np.nan_to_num(number, nan=1.0) - 0.5), 0).astype(int)
    silent = np.atleast_1d(firing.missing.all(axis=-1))
    nearest = np.array([NORMAL, *base.codes], dtype=object)[place]
    return pd.DataFrame(
        {
            "active": decided["active"],
            "top": decided["top"],
            "centroid": number,
            "nearest": np.where(silent, UNKNOWN, nearest),
        }
    )


def _cells(variable: Variable, method: str) -> list[float]:
    """Return one value for each set of terms that holds somewhere in the universe."""
    intervals = [term.midpoint if method == "midpoint" else term.crisp for term in variable.terms]
    ends = {end for one in intervals for end in (one.low, one.high)} | {variable.low, variable.high}
    edges = sorted(end for end in ends if variable.low <= end <= variable.high)
    middles = [(a + b) / 2 for a, b in pairwise(edges)]
    points = np.array(sorted([*edges, *middles]))
    # An inner point represents its cell better than an end of the universe does.
    inner = np.isin(points, middles)
    holds = np.stack([one.contains(points) for one in intervals], axis=1)
    found: dict[tuple[bool, ...], int] = {}
    for place, row in enumerate(holds.tolist()):
        key = tuple(row)
        if key not in found or (inner[place] and not inner[found[key]]):
            found[key] = place
    return sorted(float(points[place]) for place in found.values())
