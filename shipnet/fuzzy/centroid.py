"""Why a fault number must not be defuzzified: the mean of two faults is a third one."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from shipnet.fuzzy.decide import decide
from shipnet.fuzzy.rules import NORMAL, UNKNOWN, RuleBase
from shipnet.fuzzy.strengths import Samples, strengths

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["centroid_codes"]


def centroid_codes(base: RuleBase, samples: Samples) -> pd.DataFrame:
    r"""Defuzzify the number of the fault, as tutorials do with a tip, and see what comes out.

    Rule i has the consequent "number is i", a triangle of half-width 1/2 on i, cut at the firing
    strength. The triangles do not overlap, so that the centroid has a closed form:

    .. math:: z = \frac{\sum_i w_i \left( 2 - w_i \right) i}{\sum_i w_i \left( 2 - w_i \right)}

    Parameters
    ----------
    base : RuleBase
        The rules; their numbers are their places, from 1 on.
    samples : mapping of str to array_like, or DataFrame
        As for `strengths`, along one axis.

    Returns
    -------
    pandas.DataFrame
        One row a sample: ``active`` codes and ``headline`` as `decide` has them, ``centroid``, and
        the code ``nearest`` to it: the lower number of two that are equally near.

    Notes
    -----
    A number names a fault and measures nothing: the mean of pump overload (2) and stuck valve (4)
    is pump leakage (3). One consequent a fault, or no defuzzification at all, avoids it.

    Examples
    --------
    Position above the open end, motor off: S1 (6) with Pos3 (11). Stuck valve that stalls the
    motor: P1 (2) with V1 (4).

    >>> from shipnet.fuzzy import published
    >>> samples = {"MC": [0, 4], "VPos": [105, 50], "FP": [0, 125], "OP": [0, 4]}
    >>> print(centroid_codes(published.rule_base("kim2014"), samples).to_string(index=False))
     active headline  centroid nearest
    S1 Pos3       S1       8.5      O1
      P1 V1       P1       3.0      P2
    """
    import pandas as pd

    firing = strengths(base, samples)
    decision = decide(firing)
    area = firing.strength * (2 - firing.strength)
    total = area.sum(axis=-1)
    number = np.full(total.shape, np.nan)
    np.divide(area @ np.arange(1, len(base.rules) + 1), total, out=number, where=total > 0)
    place = np.where(total > 0, np.ceil(np.nan_to_num(number, nan=1.0) - 0.5), 0).astype(int)
    silent = firing.missing.all(axis=-1)
    nearest = np.array([NORMAL, *base.codes], dtype=object)[place]
    return pd.DataFrame(
        {
            "active": decision.table["active"],
            "headline": decision.headline,
            "centroid": number,
            "nearest": np.where(silent, UNKNOWN, nearest),
        }
    )
